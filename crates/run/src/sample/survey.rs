//! Estimates for all frames: frames are compared by them, and counts are scaled in proportion to them.
//!
//! Some frames, one of each of several equal parts, are recorded and estimated ([`Bound`]); of the others only counts are taken ([`Counts`]),
//! without colours where nothing reads them ([`Needs`](render::Needs)). What is estimated of those follows from their counts, and from what the
//! pipelines that they use take of cores and texture units ([`Shaded`]), by ridge regression over the recorded frames (two-phase sampling with
//! regression: Cochran, Sampling Techniques, 1977, chapter 12). A regression knows nothing of what the recorded frames do not do. So frames are
//! compared by what units take for their counts, too ([`takes`]).

use std::fmt;
use std::ops::Range;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, ensure};
use rayon::ThreadPool;

use super::clusters::{Clusters, Interval, Share, signature, total};
use super::ridge::{Law, Ridge, Summary};
use super::shaded::{Costs, Runs, SHADED, Shaded, Walk};
use super::table::{self, Table};
use crate::bound::{Bound, PhaseEstimate};
use crate::frame_sink::{Ended, Pictures, Progress, pictured};
use crate::host::Stopwatch;
use crate::rendering::{Consumer, Work};
use crate::replay::Options;
use machine::Config;
use mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, DRAM, DramCounts};
use num::{OUR_FAULT, Random};
use render::{ConsumerMemory, Dependencies, FrameSet, Want};
use stats::{Counter, FRAME, FrameCounts, Tree, counter};
use trace::Trace;
use work::profile::{FrameProfile, Profiler};
use work::{Areas, Event};

/// Bytes that a client of memory reads.
pub const READ: Counter<ClientCounts> = counter!(ClientCounts, read_bytes);
const CYCLES: Counter<FrameCounts> = counter!(FrameCounts, cycles);
const WRITTEN: Counter<ClientCounts> = counter!(ClientCounts, write_bytes);
/// Bytes that DRAM reads.
pub const DRAM_READ: Counter<DramCounts> = counter!(DramCounts, read_bytes);
/// Bytes that DRAM writes.
pub const DRAM_WRITTEN: Counter<DramCounts> = counter!(DramCounts, write_bytes);
/// Lookups of a cache.
pub const ACCESSES: Counter<CacheCounts> = counter!(CacheCounts, accesses);
/// Lookups that found their line.
pub const HITS: Counter<CacheCounts> = counter!(CacheCounts, hits);
/// Lookups that did not.
pub const MISSES: Counter<CacheCounts> = counter!(CacheCounts, misses);
/// Lines that made room.
pub const EVICTIONS: Counter<CacheCounts> = counter!(CacheCounts, evictions);

/// Something that machines count and whose sum over all frames is estimated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Count {
    /// Cycles.
    Cycles,
    /// Bytes of a client of memory.
    Client(String, Counter<ClientCounts>),
    /// Bytes of DRAM, read or written.
    Dram(Counter<DramCounts>),
    /// Bytes of DRAM both ways.
    DramBytes,
    /// A counter over all caches of a kind.
    Cache(String, Counter<CacheCounts>),
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let path = match self {
            Count::Cycles => FRAME.counter(CYCLES).path(""),
            Count::Client(name, bytes) => CLIENTS.counter(*bytes).of(name).path(""),
            Count::Dram(bytes) => DRAM.counter(*bytes).path(""),
            Count::DramBytes => format!("{DRAM}.bytes"),
            Count::Cache(name, what) => CACHES.counter(*what).of(name).path(""),
        };
        f.write_str(&path)
    }
}

/// The caches of a kind, in the statistics of a machine.
pub(super) fn banks(tree: &Tree, cache: &str) -> Vec<CacheCounts> {
    CACHES.find_of(tree, cache).into_iter().map(Tree::read).collect()
}

/// The bytes of each client of memory and of DRAM, as the statistics of a machine have them.
pub(super) fn traffic(tree: &Tree) -> Vec<Count> {
    let clients = CLIENTS.banks(tree).map(|(name, _)| name);
    let mut found: Vec<Count> =
        clients.flat_map(|name| [READ, WRITTEN].map(|bytes| Count::Client(name.to_owned(), bytes))).collect();
    found.extend([DRAM_READ, DRAM_WRITTEN].map(Count::Dram).into_iter().filter(|count| count.is_in(tree)));
    found
}

impl Count {
    /// Whether the statistics of a machine have this quantity.
    pub fn is_in(&self, tree: &Tree) -> bool {
        match self {
            Count::Cycles => true,
            Count::Client(name, _) => !CLIENTS.find_of(tree, name).is_empty(),
            Count::Dram(_) | Count::DramBytes => !DRAM.find(tree).is_empty(),
            Count::Cache(name, _) => !CACHES.find_of(tree, name).is_empty(),
        }
    }

    /// Its value in the statistics of a machine; the sum over a kind of cache.
    pub fn of(&self, tree: &Tree) -> f64 {
        let count = match self {
            Count::Cycles => CYCLES.of(&FRAME.sum(tree)),
            Count::Client(name, bytes) => bytes.of(&CLIENTS.sum_of(tree, name)),
            Count::Dram(bytes) => bytes.of(&DRAM.sum(tree)),
            Count::DramBytes => {
                let DramCounts { read_bytes, write_bytes, .. } = DRAM.sum(tree);
                read_bytes + write_bytes
            }
            Count::Cache(name, what) => what.of(&CACHES.sum_of(tree, name)),
        };
        count as f64
    }

    /// Puts bytes of a client or of DRAM into statistics that have them.
    pub(super) fn put(&self, tree: &mut Tree, value: u64) {
        match self {
            Count::Client(name, bytes) => bytes.put(CLIENTS.at_of(tree, name), value),
            Count::Dram(bytes) => bytes.put(DRAM.at(tree, 0), value),
            Count::Cycles | Count::DramBytes | Count::Cache(..) => {}
        }
    }

    /// The estimate that it is in proportion to: its own, if there is one; else cycles.
    fn by(&self) -> usize {
        match self {
            Count::Dram(bytes) if *bytes == DRAM_READ => 1,
            Count::Dram(bytes) if *bytes == DRAM_WRITTEN => 2,
            Count::DramBytes => 3,
            Count::Cache(name, what) if name == "l2" && *what == ACCESSES => 4,
            Count::Cache(name, what) if name == "l2" && *what == MISSES => 5,
            Count::Cache(name, what) if name == "texture" && *what == ACCESSES => 6,
            Count::Cache(name, what) if name == "texture" && *what == MISSES => 7,
            // Texture caches read the lines that they miss.
            Count::Client(name, bytes) if name == "texture" && *bytes == READ => 7,
            _ => 0,
        }
    }
}

/// The estimates of a frame, in the order of [`Count::by`].
const ESTIMATES: [fn(&PhaseEstimate) -> f64; 8] = [
    |phase| phase.cycles,
    |phase| phase.memory.read,
    |phase| phase.memory.written,
    |phase| phase.memory.read + phase.memory.written,
    |phase| phase.memory.lookups,
    |phase| phase.memory.misses,
    |phase| phase.textures[0],
    |phase| phase.textures[1],
];

/// The estimates of all frames: a few numbers each, which are not kept in memory.
#[derive(Debug)]
pub struct Survey {
    /// The trace's own numbers of the frames.
    pub numbers: Range<u32>,
    /// A row for each frame: its signature, then its estimates.
    rows: Table<f64>,
    /// Host time of profiles and estimates, rendering left out.
    pub time: Duration,
}

/// Recorded frames of a survey; all of a sequence of not more than twice as many.
const RECORDED: u32 = 16;

/// The frames that are recorded of `frames` frames, the first of which is `first`.
fn recorded(first: u32, frames: u32) -> FrameSet {
    if frames <= 2 * RECORDED {
        return (first..first + frames).into();
    }
    // A random frame in each of `RECORDED` equal parts: at equal distances, the frames could all be alike in a sequence that repeats.
    let begin = |part: u32| (u64::from(part) * u64::from(frames) / u64::from(RECORDED)) as u32;
    let any = |part: u32| first + begin(part) + Random::nth(0x5a3e, part.into()).below(begin(part + 1) - begin(part));
    (0..RECORDED).map(any).map(|frame| frame..frame + 1).collect()
}

/// Parts that a sequence is cut into, which are rendered side by side.
const PARTS: u32 = 2;

/// The functions that a survey calls for its frames.
#[derive(Clone, Copy)]
pub struct Observers<'t> {
    /// Gets what they show.
    pub pictures: Option<&'t Pictures<'t>>,
    /// Called for each that has been read.
    pub progress: &'t Progress<'t>,
}

impl Default for Observers<'_> {
    /// Nobody.
    fn default() -> Self {
        Observers { pictures: None, progress: &|_| () }
    }
}

/// A survey of the frames of a replay.
///
/// # Errors
/// If the trace cannot be rendered.
pub fn survey(trace: &Trace, options: &Options, dependencies: &Dependencies, observers: Observers<'_>) -> Result<Survey> {
    survey_in_parts(trace, options, dependencies, observers, PARTS)
}

/// A survey whose frames are cut into parts. Each is rendered from the start of the trace, and draws of the frames before it what
/// its own read. So the parts do not wait for each other. What comes out does not depend on their number.
///
/// # Errors
/// If the trace cannot be rendered.
pub fn survey_in_parts(
    trace: &Trace,
    options: &Options,
    dependencies: &Dependencies,
    observers: Observers<'_>,
    parts: u32,
) -> Result<Survey> {
    let range = options.frames.start..options.frames.end.min(dependencies.frames());
    let recorded = recorded(range.start, range.len() as u32);
    let bound = |part: u32| range.start + (range.len() as u64 * u64::from(part) / u64::from(parts)) as u32;
    let ranges: Vec<Range<u32>> = (0..parts).map(|part| bound(part)..bound(part + 1)).filter(|part| !part.is_empty()).collect();
    // Together about as many threads as there are for one rendering.
    let side_by_side = rayon::current_num_threads().min(ranges.len()).max(1);
    let threads = rayon::current_num_threads().div_ceil(side_by_side);
    let pool = || rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let pools = (0..side_by_side).map(|_| pool()).collect::<Result<Vec<_>, _>>().context("cannot start threads")?;
    let mut read: Vec<Result<Read>> = Vec::new();
    for ranges in ranges.chunks(side_by_side) {
        std::thread::scope(|scope| {
            let mut started = Vec::new();
            for (pool, frames) in pools.iter().zip(ranges) {
                let (frames, recorded) = (frames.clone(), &recorded);
                let one = move || read_part(trace, options, dependencies, frames, recorded, observers, pool);
                started.push(std::thread::Builder::new().name("survey".into()).spawn_scoped(scope, one));
            }
            read.extend(started.into_iter().map(|thread| {
                let joined = thread.context("cannot start a thread")?.join();
                joined.map_err(|_| anyhow!("a part of the survey stopped on an internal error. {OUR_FAULT}"))?
            }));
        });
    }
    let read: Vec<Read> = read.into_iter().collect::<Result<_>>()?;
    let watch = Stopwatch::start();
    let mut bound = Bound::proxy(&options.config);
    let profiles = || read.iter().flat_map(|part| &part.profiles);
    let costs =
        Costs::new(&options.config, &bound, read.iter().map(|part| &part.runs), profiles().map(|(_, profile)| &**profile));
    // The regressors: counts, and the time of shaders.
    let (mut regressors, mut summary, mut end) = (Table::new(REGRESSORS), Summary::default(), range.start);
    for Read { first, counts, runs, .. } in &read {
        ensure!(*first == end, "frame {first} was surveyed where frame {end} was to be");
        let mut walk = Walk::new(runs, &costs);
        for range in table::parts(counts.rows()) {
            let mut rows = Vec::new();
            counts.fill(&range, &mut rows)?;
            for row in rows.chunks_exact(counts.width()) {
                let shaded = walk.frame(row[COUNTS] as usize)?;
                let regressor = std::array::from_fn(|at| if at < COUNTS { row[at] } else { shaded[at - COUNTS] });
                summary.add(&regressor);
                regressors.add(&regressor)?;
            }
        }
        end += counts.rows() as u32;
    }
    let (mut known, mut units) = (Vec::new(), Vec::new());
    for (number, profile) in profiles() {
        let estimate = bound.frame(profile);
        let work = estimate.phases.iter().flat_map(|phase| phase.units.iter().copied());
        let signature = signature(work, &mut units);
        let estimates = ESTIMATES.map(|of| estimate.phases.iter().map(of).sum());
        let row = regressors.row((number - range.start) as usize)?;
        known.push(EstimatedFrame { number: *number, regressors: std::array::from_fn(|at| row[at]), signature, estimates });
    }
    let rows = predict(&options.config, range.start, &regressors, &summary, known, units.len())?;
    let time = read.iter().map(|part| part.time).sum::<Duration>() + watch.elapsed();
    Ok(Survey { numbers: range.start..end, rows, time })
}

/// A part that was read.
struct Read {
    /// The number of its first frame.
    first: u32,
    /// The counts of its frames, and how many pipelines each has used.
    counts: Table<f64>,
    /// The numbers of runs of the pipelines.
    runs: Runs,
    /// Frames that are recorded: their numbers and profiles. They are few.
    profiles: Vec<(u32, Box<FrameProfile>)>,
    /// Host time of profiles.
    time: Duration,
}

/// Reads some frames, rendered on the threads of a pool.
fn read_part(
    trace: &Trace,
    options: &Options,
    dependencies: &Dependencies,
    frames: Range<u32>,
    recorded: &FrameSet,
    observers: Observers<'_>,
    pool: &ThreadPool,
) -> Result<Read> {
    let key = options.config.render_key();
    let (mut profiler, mut counts, mut number) = (Profiler::new(key.shade), Counts::default(), frames.start);
    let counted = Table::new(COUNTS + 1);
    let mut read =
        Read { first: frames.start, counts: counted, runs: Runs::default(), profiles: Vec::new(), time: Duration::ZERO };
    let of = u64::from(options.frames.end.min(dependencies.frames()) - options.frames.start);
    let needs = dependencies.needs(|frame| match () {
        _ if !frames.contains(&frame) => Want::Nothing,
        _ if recorded.contains(frame) || observers.pictures.is_some() => Want::All,
        _ => Want::Counts,
    })?;
    let mut rendering = options.rendering_of(trace, frames.clone().into());
    rendering.needs(needs, Some(recorded.clone()));
    rendering.areas();
    rendering.on(pool);
    let run = |work: Work| {
        for event in work {
            let records = recorded.contains(number);
            counts.add(&event, records, key.early_z);
            read.runs.add(&event, key.early_z);
            let watch = records.then(Stopwatch::start);
            let profile = if records { profiler.event(&event) } else { None };
            read.time += watch.map_or(Duration::ZERO, |watch| watch.elapsed());
            if let Event::EndFrame(end) = &event {
                (observers.progress)(Ended { frame: end.number, surveyed: true, of: Some(of) });
                observers.pictures.map_or(Ok(()), |pictures| pictures(pictured(end)))?;
                ensure!(end.number == number, "frame {} ended where frame {number} was to end", end.number);
                let (own, used) = (std::mem::take(&mut counts).0, read.runs.end_frame()? as u64);
                let mut row = [0.0; COUNTS + 1];
                row.iter_mut().zip(own.iter().chain([&used])).for_each(|(to, &count)| *to = count as f64);
                read.counts.add(&row)?;
                read.profiles.extend(profile.map(|profile| (number, Box::new(profile))));
                if records {
                    // A profile knows nothing of the frames before, which may be in another part.
                    profiler = Profiler::new(key.shade);
                }
                number = end.number + 1;
            }
        }
        Ok(())
    };
    rendering.consume(key, Consumer { memory: ConsumerMemory::default(), recorded: true, stored: true, run: Box::new(run) });
    rendering.run()?;
    Ok(read)
}

/// A frame that was estimated.
struct EstimatedFrame {
    number: u32,
    regressors: [f64; REGRESSORS],
    signature: Vec<f64>,
    estimates: [f64; ESTIMATES.len()],
}

/// Estimates all frames: those that are known by what is known, the others by regression. What units take for its counts follows the signature
/// of each.
fn predict(
    config: &Config,
    first: u32,
    regressors: &Table<f64>,
    summary: &Summary<REGRESSORS>,
    known: Vec<EstimatedFrame>,
    units: usize,
) -> Result<Table<f64>> {
    let ridge = Ridge::new(summary, known.iter().map(|known| known.regressors).collect());
    let fit = |of: &dyn Fn(&EstimatedFrame) -> f64| ridge.fit(&known.iter().map(of).collect::<Vec<f64>>());
    let mut laws: Vec<Law> = (0..units).map(|unit| fit(&|known| known.signature.get(unit).copied().unwrap_or(0.0))).collect();
    laws.extend((0..ESTIMATES.len()).map(|at| fit(&|known| known.estimates[at])));
    let (mut rows, mut number, mut row) = (Table::new(laws.len() + TAKES), first, vec![0.0; laws.len() + TAKES]);
    let mut known = known.iter().peekable();
    let mut failed = Ok(());
    regressors.each(|_, regressors| {
        let regressors = std::array::from_fn(|at| regressors[at]);
        let (signature, others) = row.split_at_mut(units);
        let (takes_of, estimates) = others.split_at_mut(TAKES);
        takes_of.copy_from_slice(&takes(config, &regressors));
        let values = signature.iter_mut().chain(&mut *estimates);
        values.zip(&laws).for_each(|(value, law)| *value = ridge.value(law, &regressors));
        if let Some(known) = known.next_if(|known| known.number == number) {
            signature.fill(0.0);
            signature[..known.signature.len()].copy_from_slice(&known.signature);
            estimates.copy_from_slice(&known.estimates);
        }
        number += 1;
        if failed.is_ok() {
            failed = rows.add(&row);
        }
    })?;
    failed?;
    Ok(rows)
}

/// The regressors: the counts of a frame, and the time of its shaders.
const REGRESSORS: usize = COUNTS + SHADED;

/// How many numbers [`takes`] gives.
const TAKES: usize = 9 + SHADED;

/// The cycles that units take for the counts of a frame: work divided by a rate, without anything that is learnt.
fn takes(config: &Config, regressors: &[f64; REGRESSORS]) -> [f64; TAKES] {
    let [draws, passes, samples, indices, _, primitives, clipped, triangles, _, quads, _, _, _, moved, shown, ..] = *regressors;
    let pipelines = f64::from(config.card.pipelines);
    let port = f64::from(config.memory.port_width);
    let shaded: Shaded = std::array::from_fn(|at| regressors[COUNTS + at]);
    let own = [
        draws * f64::from(config.command.command_cycles),
        passes * f64::from(config.command.barrier_cycles),
        // Samples have four bytes each.
        samples * 4.0 / port / pipelines,
        indices / f64::from(config.fetch.indices_per_cycle),
        primitives / f64::from(config.assembly.primitives_per_cycle)
            + clipped * f64::from(config.clip.clip_cycles) / f64::from(config.card.geometry_units),
        triangles * f64::from(config.setup.interval) / f64::from(config.setup.triangles_per_cycle) / pipelines,
        quads / 256.0 * f64::from(config.color.interval) / f64::from(config.color.quads_per_cycle) / pipelines,
        moved / port,
        shown / port,
    ];
    std::array::from_fn(|at| if at < own.len() { own[at] } else { shaded[at - own.len()] })
}

/// What is counted in a frame without its work: draws, passes, samples of attachments, vertices read, vertices shaded, primitives, clipped
/// primitives, triangles; blocks of 8 x 8 pixels, quads, fragments and visible quads as [`Areas`] have them; invocations of dispatches, bytes
/// moved, bytes shown.
#[derive(Clone, Copy, Debug, Default)]
struct Counts([u64; COUNTS]);

/// How many that are.
const COUNTS: usize = 15;

impl Counts {
    /// Adds an event of a frame that is recorded or not; whether recorded fragments are tested early where they may be.
    fn add(&mut self, event: &Event, recorded: bool, early: bool) {
        let mut add = |at: usize, n: u64| self.0[at] += n;
        match event {
            Event::Draw(_) => add(0, 1),
            Event::BeginPass(pass) => {
                add(1, 1);
                let attachments = (pass.color.iter().flatten().count() + usize::from(pass.depth.is_some())) as u64;
                add(2, attachments * u64::from(pass.width) * u64::from(pass.height) * u64::from(pass.samples));
            }
            Event::Segment(segment) | Event::Applied(segment) => {
                // Without a record a draw is one segment.
                add(0, u64::from(!recorded));
                let funnel = &segment.funnel;
                let counted =
                    [funnel.vertices_in, funnel.vertices_shaded, funnel.primitives_in, funnel.clipped, funnel.triangles_setup];
                counted.into_iter().enumerate().for_each(|(at, n)| add(3 + at, n));
                // Frames that are recorded are known by the same estimates as the others.
                let Areas { fragments, quads, blocks, visible } = segment.areas;
                // Without colours tests come early wherever they may.
                let visible = if early { visible } else { 0 };
                [blocks, quads, fragments, visible].into_iter().enumerate().for_each(|(at, n)| add(8 + at, n));
            }
            Event::Dispatch(dispatch) => add(12, dispatch.groups * u64::from(dispatch.invocations)),
            Event::Transfer(transfer) => add(13, transfer.bytes),
            Event::EndFrame(end) => {
                if let Some(shown) = end.shown {
                    add(14, u64::from(shown.width) * u64::from(shown.height) * u64::from(shown.format.block_bytes()));
                }
            }
            Event::Contents(_) | Event::EndPass(_) | Event::Groups(_) | Event::FramesFollow => {}
        }
    }
}

impl Survey {
    /// Frames of the sequence.
    pub fn frames(&self) -> usize {
        self.rows.rows()
    }

    /// The trace's own number of a frame.
    pub fn number(&self, frame: usize) -> u32 {
        self.numbers.start + frame as u32
    }

    /// The row of a frame: its signature, then its estimates.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn row(&self, frame: usize) -> Result<Vec<f64>> {
        Ok(self.rows.row(frame)?)
    }

    /// Calls `each` with every frame in order and what is estimated of what a count is in proportion to.
    ///
    /// # Errors
    /// If the rows cannot be read.
    pub fn estimates(&self, count: &Count, mut each: impl FnMut(usize, f64)) -> Result<()> {
        let at = self.rows.width() - ESTIMATES.len() + count.by();
        Ok(self.rows.each(|frame, row| each(frame, row[at]))?)
    }

    /// Clusters of frames that are alike: that of the first frame, and at most `count` others.
    ///
    /// # Errors
    /// If what is kept of the frames cannot be read or written.
    pub fn clusters(&self, count: usize) -> Result<Clusters> {
        Clusters::new(&self.rows, self.rows.width() - ESTIMATES.len(), count)
    }

    /// Clusters, with what their frames come to by estimate.
    ///
    /// # Errors
    /// As [`Survey::clusters`].
    pub fn strata(&self, count: usize) -> Result<Strata<'_>> {
        let clusters = self.clusters(count)?;
        let mut sums = vec![[0.0; ESTIMATES.len()]; clusters.len()];
        clusters.each_row(&self.rows, |cluster, row| {
            let estimates = &row[row.len() - ESTIMATES.len()..];
            sums[cluster].iter_mut().zip(estimates).for_each(|(sum, own)| *sum += own);
        })?;
        Ok(Strata { survey: self, clusters, sums })
    }
}

/// Clusters of frames, with what these come to by estimate.
#[derive(Debug)]
pub struct Strata<'s> {
    survey: &'s Survey,
    clusters: Clusters,
    sums: Vec<[f64; ESTIMATES.len()]>,
}

/// A frame of each cluster, drawn at random.
#[derive(Debug)]
pub struct Drawn<'s> {
    strata: &'s Strata<'s>,
    /// The frames, by place in the sequence.
    pub frames: Vec<usize>,
    own: Vec<[f64; ESTIMATES.len()]>,
}

impl Strata<'_> {
    /// The clusters.
    pub fn clusters(&self) -> &Clusters {
        &self.clusters
    }

    /// Draws frames.
    ///
    /// # Errors
    /// If what is kept of the frames cannot be read.
    pub fn draw(&self, random: &mut Random) -> Result<Drawn<'_>> {
        let frames = self.clusters.draw(random)?;
        let own = |&frame: &usize| {
            let row = self.survey.row(frame)?;
            let estimates = row.len() - ESTIMATES.len();
            Ok(std::array::from_fn(|at| row[estimates + at]))
        };
        let own = frames.iter().map(own).collect::<Result<_>>()?;
        Ok(Drawn { strata: self, frames, own })
    }
}

impl Drawn<'_> {
    fn shares(&self, count: &Count) -> Vec<Share> {
        let Strata { clusters, sums, .. } = self.strata;
        let (at, each) = (count.by(), clusters.sizes().zip(sums).zip(&self.own));
        each.map(|((frames, sums), own)| Share { frames, sum: sums[at], own: own[at] }).collect()
    }

    /// The weight of each drawn frame, for the quantity that a count is in proportion to.
    pub fn weights(&self, count: &Count) -> Vec<f64> {
        self.shares(count).iter().map(Share::weight).collect()
    }

    /// The sum over all frames of what was counted in those drawn, and is in proportion to what a count is.
    pub fn total_of(&self, by: &Count, counted: &[f64]) -> Interval {
        total(&self.shares(by), counted)
    }

    /// The sum of a count over all frames, by the statistics of those drawn.
    pub fn total(&self, count: &Count, frames: &[&Tree]) -> Interval {
        let own: Vec<f64> = frames.iter().map(|tree| count.of(tree)).collect();
        self.total_of(count, &own)
    }
}
