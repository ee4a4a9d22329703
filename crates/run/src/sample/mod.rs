//! The `sampled` fidelity: some frames are simulated and stand for all. In `bound` they are estimated, and stand for all in the same way.
//!
//! The commands are read three times: for what depends on what ([`Dependencies`]), in which nothing is drawn; for a [`survey`] of all frames, by
//! which those to be simulated are chosen ([`clusters`]); and once more with work recorded for these alone, where only what they read of
//! other frames is drawn.

pub mod clusters;
mod means;
mod ridge;
mod shaded;
pub mod survey;
pub mod table;

use std::ops::Range;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow, bail};

use super::bound::frames::{Estimated, estimate};
use super::frame_runs::simulate_given_runs;
use super::frame_sink::{Frame, FrameSink};
use super::host::Stopwatch;
use super::rendering::{Consumer, Work};
use super::replay::{Fidelity, Options, ReplayOutcome};
use clusters::{Interval, LEVEL};
use survey::{ACCESSES, Count, DRAM_READ, DRAM_WRITTEN, Drawn, EVICTIONS, HITS, MISSES, Observers, READ, Survey};

use machine::{Machine, Shown};
use mem::{CACHES, CacheCounts};
use num::Random;
use render::{ConsumerMemory, Dependencies, FrameSet, Want};
use stats::{Counter, Declaration, Group, Leaf, Node, SECONDS, Tree};
use trace::Trace;

/// How frames are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Frames to be drawn, simulated and counted in addition to the first, which always is: at least 2, for an interval.
    pub samples: u32,
    /// The seed of the random generator for sampling.
    pub seed: u64,
    /// Frames before each of these that warm the caches, and are not counted. Machines that can be warmed functionally
    /// ([`apply`](unit::apply)) are; the others simulate these frames. With the default, each buffer of a free-running display has been
    /// written before, and a second level of 2 MB holds most of what frames share.
    pub warm_up: u32,
    /// Takes as many samples as the whole replay has time for on this host, by the time that a few take; not
    /// `samples` then. The statistics say how many they were: with as many the result comes again.
    pub time_limit: Option<Duration>,
}

impl Default for Sampling {
    fn default() -> Self {
        Sampling { samples: 8, seed: 1, warm_up: 4, time_limit: None }
    }
}

/// Caches of which misses are estimated.
const ESTIMATED: [&str; 2] = ["texture", "l2"];

/// The estimates over all frames.
#[derive(Clone, Debug)]
pub struct Sampled {
    /// Frames of the sequence.
    pub frames: u64,
    /// Frames that were simulated and counted.
    pub counted: u64,
    /// Frames that were simulated, those that warm up among them.
    pub simulated: u64,
    /// Estimates with intervals.
    pub margins: Vec<Margin>,
}

/// The quantity that an interval is about.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// A count.
    Count(Count),
    /// The hit rate of a kind of cache.
    HitRate(String),
}

/// The hits of a cache, divided by its lookups.
const HIT_RATE: Declaration = Declaration::new("hit_rate", "ratio", "Lookups that found their line, divided by all lookups.");

impl std::fmt::Display for Quantity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Quantity::Count(count) => count.fmt(f),
            Quantity::HitRate(cache) => f.write_str(&CACHES.statistic(&HIT_RATE).of(cache).path("")),
        }
    }
}

/// An estimate with its interval.
#[derive(Clone, Debug)]
pub struct Margin {
    /// The quantity that it is about.
    pub of: Quantity,
    /// The value in the statistics over all frames.
    pub value: f64,
    /// Half the interval's width.
    pub margin: f64,
}

/// Sorted ranges of frame numbers: those drawn, each with those that warm up for it.
fn ranges(numbers: &[u32], first: u32, warm_up: u32) -> FrameSet {
    let mut numbers = numbers.to_vec();
    numbers.sort_unstable();
    let mut ranges: Vec<Range<u32>> = Vec::new();
    for number in numbers {
        let begin = number.saturating_sub(warm_up).max(first);
        match ranges.last_mut() {
            Some(last) if last.end >= begin => last.end = number + 1,
            _ => ranges.push(begin..number + 1),
        }
    }
    ranges.into_iter().collect()
}

/// Replays a trace with some of its frames simulated, which leave as they end; the statistics over all are estimates, with the intervals of the
/// most important.
///
/// # Errors
/// If the trace cannot be rendered, has too few frames, or the machine stops.
pub(super) fn sampled(trace: &Trace, options: &Options, sampling: &Sampling, sink: FrameSink<'_>) -> Result<ReplayOutcome> {
    let watch = Stopwatch::start();
    let sampler = Sampler::new(trace, options, Observers { pictures: sink.pictures, progress: sink.progress })?;
    let samples = match sampling.time_limit {
        Some(limit) => sampler.samples_within(limit, sampling, &watch)?,
        None => sampling.samples,
    };
    let outcome = sampler.run(&Sampling { samples, ..*sampling }, sink)?;
    Ok(ReplayOutcome { clock_time: watch.clock(), ..outcome })
}

/// A sequence that has been surveyed: any number of its frames can be drawn and simulated, again and again.
pub struct Sampler<'t> {
    trace: &'t Trace,
    options: &'t Options,
    dependencies: Dependencies,
    survey: Survey,
    /// Host time of the survey.
    time: Duration,
}

impl<'t> Sampler<'t> {
    /// Surveys all frames.
    ///
    /// # Errors
    /// If the trace cannot be rendered, the configuration's display does not let frames be taken apart, or who gets the pictures fails.
    pub fn new(trace: &'t Trace, options: &'t Options, observers: Observers<'_>) -> Result<Sampler<'t>> {
        if let Some(why) = options.config.scanout.ties_frames() {
            bail!("the sampled fidelity takes frames apart (scanout.mode=\"free-running\"): {why}; use cycle");
        }
        let watch = Stopwatch::start();
        let dependencies = Dependencies::of(trace, options.frames.end)?;
        let survey = survey::survey(trace, options, &dependencies, observers)?;
        Ok(Sampler { trace, options, dependencies, survey, time: watch.clock() })
    }

    /// The survey of all frames.
    pub fn survey(&self) -> &Survey {
        &self.survey
    }

    /// As many samples as the rest of a time limit allows.
    fn samples_within(&self, limit: Duration, sampling: &Sampling, watch: &Stopwatch) -> Result<u32> {
        let all = self.survey.frames() as u32;
        if all <= 3 {
            return Ok(sampling.samples);
        }
        let trial = self.trial(sampling)?;
        let left = limit.saturating_sub(watch.clock()).as_secs_f64();
        Ok(trial.samples_in(left).clamp(2, MOST_SAMPLES.min(all - 2)))
    }

    /// Takes a few samples close together, early in the sequence: so what samples share takes a small part of its time there, and what each takes
    /// is not the difference of two long times.
    fn trial(&self, sampling: &Sampling) -> Result<Trial> {
        let all = self.survey.frames();
        let begin = all / TRIAL_PART;
        // A frame lies between one sample and what warms up for the next, so that each has a machine of its own, as in the replay.
        let apart = sampling.warm_up as usize + 2;
        let drawn: Vec<usize> = (begin..all).skip(sampling.warm_up as usize).step_by(apart).take(TRIAL_SAMPLES).collect();
        let drawn = if drawn.is_empty() { vec![all - 1] } else { drawn };
        let chosen: Vec<u32> = drawn.iter().map(|&frame| self.survey.number(frame)).collect();

        let begun = Instant::now();
        let mut arrived = None;
        let sink = FrameSink::new(|_| Ok(()));
        simulated(&self.dependencies, (self.trace, self.options), (&chosen, sampling.warm_up), sink, Some(&mut arrived))?;
        let time = begun.elapsed().as_secs_f64();
        let before = arrived.map_or(time, |at| (at - begun).as_secs_f64());
        // Frames that have more to do take longer.
        let (mut of_drawn, mut of_all) = (0.0, 0.0);
        self.survey.estimates(&Count::Cycles, |frame, cycles| {
            of_all += cycles / all as f64;
            of_drawn += if drawn.binary_search(&frame).is_ok() { cycles / drawn.len() as f64 } else { 0.0 };
        })?;
        let heavier = if of_drawn > 0.0 { (of_all / of_drawn).clamp(0.25, 4.0) } else { 1.0 };

        let begun = Instant::now();
        let clusters = self.survey.clusters(TRIAL_SAMPLES)?;
        let clustering = begun.elapsed().as_secs_f64() / clusters.len().max(1) as f64;
        Ok(Trial {
            shared: before * all as f64 / (begin as f64).max(1.0),
            each: (time - before) / drawn.len() as f64 * heavier + clustering,
        })
    }

    /// Simulates some frames for all. The times of what comes out include the survey.
    ///
    /// # Errors
    /// If the trace cannot be rendered, has too few frames, or the machine stops.
    pub fn run(&self, sampling: &Sampling, sink: FrameSink<'_>) -> Result<ReplayOutcome> {
        let outcome = of_survey(&self.survey, &self.dependencies, self.trace, self.options, sampling, sink)?;
        Ok(ReplayOutcome {
            machine_time: outcome.machine_time + self.survey.time,
            clock_time: outcome.clock_time + self.time,
            ..outcome
        })
    }
}

/// The time of samples, in seconds.
struct Trial {
    /// The time of work that all samples share: commands are read, and images that later frames read are drawn.
    shared: f64,
    /// The time of each sample: it is rendered with its work recorded, simulated, and put into a cluster.
    each: f64,
}

impl Trial {
    /// The number of samples that fit into `left` seconds. If less than a tenth of the shared time would be left for them: the number that
    /// adds a tenth to the shared time.
    fn samples_in(&self, left: f64) -> u32 {
        ((left - self.shared).max(self.shared / 10.0) / self.each.max(1e-6)) as u32
    }
}

/// Samples of a trial.
const TRIAL_SAMPLES: usize = 16;

/// The part of a sequence that a trial has in front of it.
const TRIAL_PART: usize = 8;

/// Most samples within a time limit. Statistics of each are kept, about 200 KB in all: so memory is bounded, at some 260 MB.
const MOST_SAMPLES: u32 = 1000;

/// Simulates and counts some frames, each behind those that warm up; gives the statistics of each, how many were simulated, and host time in
/// machines. `arrived` gets the time at which their first work came out of the renderer.
fn simulated(
    dependencies: &Dependencies,
    (trace, options): (&Trace, &Options),
    (numbers, warm_up): (&[u32], u32),
    sink: FrameSink<'_>,
    arrived: Option<&mut Option<Instant>>,
) -> Result<(Vec<Tree>, u64, Duration)> {
    let chosen = ranges(numbers, options.frames.start, warm_up);
    let simulated_frames = chosen.count();
    // On other machines, frames that warm up are simulated.
    let functional = Machine::warms(&options.config);
    let warms_up = |number: u32| functional && !numbers.contains(&number);

    // The statistics of the drawn frames. Frames that only warm up are not reported.
    let mut counted: Vec<Option<Tree>> = vec![None; numbers.len()];
    let FrameSink { mut taker, keeps, progress, per_draw, .. } = sink;
    let count = |mut frame: Frame| {
        // The pictures that a free-running display shows between frames that are not simulated are no pictures of the sequence.
        if options.config.scanout.runs_free() {
            frame.display = Shown::default();
        }
        let Some(at) = numbers.iter().position(|&number| number == frame.number) else { return Ok(()) };
        counted[at] = Some(frame.tree.clone());
        taker(frame)
    };
    let (mut machine_time, mut by_estimate) = (Duration::ZERO, Estimated::default());
    let runs = chosen.ranges().to_vec();
    let needs = dependencies.needs(|frame| if chosen.contains(frame) { Want::All } else { Want::Nothing })?;
    let mut rendering = options.rendering_of(trace, chosen);
    rendering.needs(needs, None);
    let sink = FrameSink { keeps, progress, per_draw, of: Some(simulated_frames), ..FrameSink::new(count) };
    match options.fidelity {
        Fidelity::BoundSampled(_) => estimate(&mut rendering, &options.config, sink, &mut by_estimate)?,
        _ => simulate_given_runs(&mut rendering, (&options.config, options.clock), runs, &warms_up, sink, &mut machine_time),
    }
    if let Some(arrived) = arrived {
        let first = |mut work: Work| {
            *arrived = work.next().map(|_| Instant::now());
            Ok(())
        };
        let key = options.config.render_key();
        rendering
            .consume(key, Consumer { memory: ConsumerMemory::default(), recorded: false, stored: false, run: Box::new(first) });
    }
    rendering.run()?;
    machine_time += by_estimate.time;
    let found = counted.into_iter().zip(numbers);
    let found = found.map(|(tree, number)| tree.ok_or_else(|| anyhow!("frame {number} was not simulated")));
    Ok((found.collect::<Result<Vec<Tree>>>()?, simulated_frames, machine_time))
}

/// Simulates some frames for all, by a survey of them.
fn of_survey(
    survey: &Survey,
    dependencies: &Dependencies,
    trace: &Trace,
    options: &Options,
    sampling: &Sampling,
    sink: FrameSink<'_>,
) -> Result<ReplayOutcome> {
    let watch = Stopwatch::start();
    let all = survey.frames();
    if sampling.samples < 2 {
        bail!("{} frames to be sampled give no interval: 2 are the least", sampling.samples);
    }
    if all <= sampling.samples as usize + 1 {
        bail!("{all} frames are too few to sample the first and {} others: use cycle", sampling.samples);
    }
    let strata = survey.strata(sampling.samples as usize)?;
    if strata.clusters().len() < 3 {
        bail!(
            "the {} frames behind the first are all alike, and one cannot give an interval: use cycle with --frames",
            all - 1
        );
    }
    let drawn = strata.draw(&mut Random::new(sampling.seed))?;
    let numbers: Vec<u32> = drawn.frames.iter().map(|&frame| survey.number(frame)).collect();
    let (counted, simulated_frames, machine_time) =
        simulated(dependencies, (trace, options), (&numbers, sampling.warm_up), sink, None)?;

    let weights = drawn.weights(&Count::Cycles);
    let trees: Vec<(f64, &Tree)> = weights.iter().copied().zip(&counted).collect();
    let mut total = Tree::weighted(&trees);
    let cycles = Count::Cycles.of(&total);
    total.real(SECONDS.name, options.config.seconds(cycles));
    let trees: Vec<&Tree> = counted.iter().collect();
    estimated(&mut total, &drawn, &trees);
    let margins = intervals(&drawn, &trees).into_iter().map(|(of, Interval { margin, .. })| {
        let value = match &of {
            Quantity::Count(count) => count.of(&total),
            Quantity::HitRate(cache) => {
                let sum = |what| Count::Cache(cache.clone(), what).of(&total);
                sum(HITS) / sum(ACCESSES).max(1.0)
            }
        };
        Margin { of, value, margin }
    });
    let sampled = Sampled {
        frames: all as u64,
        counted: drawn.frames.len() as u64,
        simulated: simulated_frames,
        margins: margins.collect(),
    };
    sampled.put(&mut total);
    Ok(ReplayOutcome {
        cycles: Some(cycles),
        total,
        sampled: Some(sampled),
        machine_time,
        clock_time: watch.clock(),
        ..ReplayOutcome::default()
    })
}

impl Sampled {
    /// Puts it into the statistics over all frames.
    fn put(&self, total: &mut Tree) {
        let node = total.child("sampled");
        node.count("frames", self.frames);
        node.count("counted_frames", self.counted);
        node.count("simulated_frames", self.simulated);
        node.real("level", LEVEL);
        for Margin { of, margin, .. } in &self.margins {
            node.child("margins").set(of.to_string(), Node::Leaf(Leaf::Real(*margin)));
        }
    }
}

/// Puts what caches and DRAM do into the total, by what is estimated of just that.
fn estimated(total: &mut Tree, drawn: &Drawn<'_>, frames: &[&Tree]) {
    let sum = |by: &Count, own: &dyn Fn(&Tree) -> f64| -> f64 {
        let weights = drawn.weights(by);
        weights.iter().zip(frames).map(|(weight, tree)| weight * own(tree)).sum()
    };
    for count in [Count::Dram(DRAM_READ), Count::Dram(DRAM_WRITTEN), Count::Client("texture".into(), READ)] {
        if count.is_in(total) {
            let bytes = sum(&count, &|tree| count.of(tree)).round() as u64;
            count.put(total, bytes);
        }
    }
    for cache in ESTIMATED {
        for at in 0..survey::banks(total, cache).len() {
            let of = |by: Counter<CacheCounts>, what: Counter<CacheCounts>| {
                let own = |tree: &Tree| survey::banks(tree, cache).get(at).map_or(0.0, |counts| what.of(counts) as f64);
                sum(&Count::Cache(cache.to_owned(), by), &own).round() as u64
            };
            let misses = of(MISSES, MISSES);
            let evictions = of(MISSES, EVICTIONS);
            let accesses = of(ACCESSES, ACCESSES).max(misses);
            let counts = CacheCounts { accesses, hits: accesses - misses, misses, evictions };
            CACHES.named(cache).at(total, at).extend(counts.tree());
        }
    }
}

/// The intervals of the cycles, of the bytes of each client and of DRAM, and of the hit rate of each kind of cache; of the caches of
/// which misses are estimated, of these too.
fn intervals(drawn: &Drawn<'_>, frames: &[&Tree]) -> Vec<(Quantity, Interval)> {
    let mut found = Vec::new();
    let Some(first) = frames.first() else { return found };
    let mut counts = vec![Count::Cycles];
    counts.extend(survey::traffic(first));
    counts.push(Count::DramBytes);
    for count in counts {
        let interval = drawn.total(&count, frames);
        found.push((Quantity::Count(count), interval));
    }
    for (cache, _) in CACHES.banks(first) {
        let of = |what| Count::Cache(cache.to_owned(), what);
        let total = |what| drawn.total(&of(what), frames);
        let accesses = total(ACCESSES);
        if accesses.value <= 0.0 {
            continue;
        }
        let hit_rate = Quantity::HitRate(cache.to_owned());
        if ESTIMATED.contains(&cache) {
            // Lookups are known all but exactly: the rate is off by what misses are.
            let misses = total(MISSES);
            let rate = 1.0 - misses.value / accesses.value;
            found.push((hit_rate, Interval { value: rate, margin: misses.margin / accesses.value }));
            found.push((Quantity::Count(of(MISSES)), misses));
            continue;
        }
        let counts = |what| frames.iter().map(|tree| of(what).of(tree)).collect();
        let (hits, lookups): (Vec<f64>, Vec<f64>) = (counts(HITS), counts(ACCESSES));
        let rate = total(HITS).value / accesses.value;
        // A quotient of two totals, linearised: its error is that of what hits are beside the rate.
        let beside: Vec<f64> = hits.iter().zip(&lookups).map(|(hits, lookups)| hits - rate * lookups).collect();
        let margin = drawn.total_of(&Count::Cycles, &beside).margin / accesses.value;
        found.push((hit_rate, Interval { value: rate, margin }));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_that_samples_share_is_not_taken_for_theirs() {
        let samples = |shared, each, left| Trial { shared, each }.samples_in(left);
        assert_eq!((samples(0.0, 0.5, 10.0), samples(4.0, 0.5, 10.0)), (20, 12));
        assert_eq!((samples(8.0, 0.1, 4.0), samples(1.0, 1.0, 0.0)), (8, 0));
    }

    #[test]
    fn frames_warm_up_for_each_other() {
        let all = |set: FrameSet| (0..30).filter(|&frame| set.contains(frame)).collect::<Vec<u32>>();
        assert_eq!(all(ranges(&[7, 3, 8, 20], 0, 1)), [2, 3, 6, 7, 8, 19, 20]);
        assert_eq!(ranges(&[7, 3, 8, 20], 0, 1).count(), 7);
        assert_eq!(all(ranges(&[5], 5, 3)), [5]);
        assert_eq!(ranges(&[5, 0], 0, 2), [0..1, 3..6].into_iter().collect());
    }
}
