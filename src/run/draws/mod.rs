//! Sampling over draws: some draws of a pass are simulated and stand for all ([`sample`](super::sample)).
//!
//! A pass is cut into *pieces*: whole segments one after another, at least [`GRAIN`] estimated cycles of them, as the machine has that
//! much under way at once and shorter draws cannot be told apart. Pieces are put into clusters by what they have to do, and of each
//! cluster one is drawn at random. It is simulated behind some that fill the pipelines and warm the caches, and before one that keeps
//! them full; all others are drawn at once ([`apply`](crate::unit::apply)), so that depths, blocks in caches and what is in memory are
//! what they are in the whole frame, and so is the picture, bit for bit.
//!
//! A piece takes from the cycle in which the last segment before it has retired to that in which its own has. The first piece of a pass
//! and its last one are simulated in any case and count once: the former has all that lies before it since the pass before, and what
//! follows the last is counted too. So the pieces of a frame add up to the frame, and a run with all of them simulated is the frame.

mod cut;

use std::time::Duration;

use anyhow::{Result, anyhow, bail};

use super::host::Stopwatch;
use super::replay::{Frame, Options, Replay};
use super::sample::{Clusters, Interval, LEVEL, random, signature};
use super::sampled::counted;
use crate::machine::config::SortClass;
use crate::machine::{Config, Machine, Retirement};
use crate::num::Cycle;
use crate::render::{self, Held};
use crate::report::files::funnel_tree;
use crate::stats::{Node, Tree};
use crate::trace::Trace;
use crate::unit::sorting::{EarlyTest, Keep};
use crate::work::{Event, Funnel};
use cut::{Cutter, Piece, weights};

pub use cut::{Estimate, GRAIN};

/// How draws are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawSampling {
    /// Pieces to be simulated and counted: at least [`LEAST`].
    pub samples: u32,
    /// Of the random numbers.
    pub seed: u64,
    /// Pieces simulated before each of these, and not counted: at least 1.
    pub warm_up: u32,
}

/// Pieces that must be sampled for intervals that hold: of four, those of bytes did so in 43 to 100 of 100 draws.
pub const LEAST: u32 = 8;

/// Rendered work, cut into pieces.
pub struct Pieces {
    events: Vec<Event>,
    pieces: Vec<Piece>,
    /// The places of those that are drawn from.
    inner: Vec<usize>,
    /// What is expected of these.
    pub expected: Vec<Estimate>,
    /// Their signatures.
    pub signatures: Vec<Vec<f64>>,
    /// Host time of the estimates, rendering and profiles left out.
    pub time: Duration,
    funnel: Funnel,
    /// Frames with what the renderer counts.
    frames: Vec<(u32, Funnel)>,
}

/// What a piece is to a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// It is drawn at once.
    Applied,
    /// It is simulated so that others are right.
    Around,
    /// It is simulated and counted.
    Counted,
}

/// Refuses what draws cannot be sampled on.
pub(super) fn check(config: &Config) -> Result<()> {
    let name = &config.name;
    let reason = match config.card.sort {
        SortClass::MiddleBinned => "it draws tile after tile, each with all draws of a pass",
        SortClass::LastImage => "its pipelines draw into copies, and composition takes as long as these differ",
        SortClass::LastFragment if config.order.keep != Keep::Always => "its draws do not end in order (order.keep)",
        SortClass::LastFragment if config.order.early == EarlyTest::Local => {
            "its pipelines keep depths of what they have drawn themselves (order.early)"
        }
        _ => return Ok(()),
    };
    bail!("draws cannot be sampled on {name}: {reason}; use --sample frames, or cycle")
}

impl Pieces {
    /// Renders a trace and cuts it.
    ///
    /// # Errors
    /// If the machine is one on which draws cannot be sampled, or the trace cannot be rendered.
    pub fn render(trace: &Trace, options: &Options) -> Result<Pieces> {
        check(&options.config)?;
        let mut cutter = Cutter::new(&options.config);
        let mut events = Vec::new();
        let (mut funnel, mut own, mut frames) = (Funnel::default(), Funnel::default(), Vec::new());
        // All pieces are kept; a machine follows that draws them.
        let held = Held { images: Machine::images(&options.config), pieces: u64::MAX, pictures: true };
        let render_options = render::Options { held, ..options.rendering() };
        render::render(trace, &render_options, &mut |event| {
            match &event {
                Event::Segment(segment) => own += segment.funnel,
                Event::EndFrame(end) => {
                    funnel += own;
                    frames.push((end.number, std::mem::take(&mut own)));
                }
                _ => {}
            }
            cutter.event(&event);
            events.push(event);
            Ok(())
        })?;
        let Cutter { pieces, estimates, time, .. } = cutter;
        let inner: Vec<usize> = (0..pieces.len()).filter(|&at| !pieces[at].edge).collect();
        let expected: Vec<Estimate> = inner.iter().map(|&at| estimates[at].clone()).collect();
        let mut units = Vec::new();
        let signatures = expected.iter().map(|piece| signature(piece.units.iter().copied(), &mut units)).collect();
        Ok(Pieces { events, pieces, inner, expected, signatures, time, funnel, frames })
    }

    /// Pieces that are drawn from.
    pub fn len(&self) -> usize {
        self.inner.len()
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.inner.is_empty()
    }

    /// What each piece is, with these drawn.
    fn roles(&self, drawn: &[usize], warm_up: u32) -> Vec<Role> {
        let mut roles = vec![Role::Applied; self.pieces.len()];
        let counted = drawn.iter().map(|&at| self.inner[at]);
        let counted: Vec<usize> = counted.chain((0..self.pieces.len()).filter(|&at| self.pieces[at].edge)).collect();
        for &at in &counted {
            let warm = at.saturating_sub(warm_up as usize).max(self.pieces[at].pass);
            roles[warm..(at + 2).min(self.pieces.len())].fill(Role::Around);
        }
        counted.iter().for_each(|&at| roles[at] = Role::Counted);
        roles
    }

    /// The stream of events with pieces in these roles.
    fn stream<'p>(&'p self, roles: &'p [Role]) -> impl Iterator<Item = Event> + 'p {
        let mut number = 0;
        let mut piece = 0;
        self.events.iter().map(move |event| {
            let Event::Segment(segment) = event else { return event.clone() };
            while self.pieces[piece].segments.end <= number {
                piece += 1;
            }
            number += 1;
            if roles[piece] == Role::Applied { Event::Applied(segment.clone()) } else { event.clone() }
        })
    }

    /// Simulates pieces in these roles.
    fn simulate(&self, options: &Options, roles: &[Role], progress: &(dyn Fn(u32) + Sync)) -> Result<Windows> {
        let mut machine = Machine::new(&options.config)?;
        let mut ends = vec![None; self.pieces.len()];
        let (mut shown, mut wrong_pixels) = (Vec::new(), 0);
        let busy = Stopwatch::start();
        let report = machine.run_watched(
            self.stream(roles),
            options.clock,
            |frame| {
                progress(frame.number);
                wrong_pixels += frame.picture.as_ref().map_or(0, |picture| picture.wrong_pixels);
                shown.push(frame.picture.map(|picture| (picture.surface, picture.bytes)));
            },
            |Retirement { segment, cycle, counts }| {
                let at = self.pieces.partition_point(|piece| piece.segments.end <= segment);
                if self.pieces.get(at).is_some_and(|piece| piece.segments.end == segment + 1) {
                    ends[at] = Some((cycle, counts));
                }
            },
        )?;
        let time = busy.elapsed();
        let mut pieces = vec![None; self.pieces.len()];
        for (at, role) in roles.iter().enumerate().filter(|(_, role)| **role == Role::Counted) {
            let missing = || anyhow!("piece {at}, {role:?}, was not simulated behind another");
            let (cycle, counts) = ends[at].as_ref().ok_or_else(missing)?;
            let begin = match at.checked_sub(1) {
                Some(before) => Some(ends[before].as_ref().ok_or_else(missing)?),
                None => None,
            };
            pieces[at] = Some(match begin {
                Some((begin, before)) => window(cycle - begin, counts.since(before)),
                None => window(*cycle, counts.clone()),
            });
        }
        let last = ends.last().and_then(Option::as_ref);
        let (cycles, counts) = (report.cycles, parts(&report.total));
        let tail = match last {
            Some((cycle, before)) => window(cycles - cycle, counts.since(before)),
            None => window(cycles, counts),
        };
        Ok(Windows { pieces, tail, shown, wrong_pixels, time })
    }
}

/// The part of a run's statistics that is told at retirements.
fn parts(total: &Tree) -> Tree {
    let mut tree = Tree::new();
    for name in ["caches", "memory"] {
        if let Some(node) = total.get(name) {
            tree.set(name, node.clone());
        }
    }
    tree
}

/// A piece's own statistics.
fn window(cycles: Cycle, counts: Tree) -> Tree {
    let mut tree = Tree::new();
    tree.count("cycles", cycles);
    tree.extend(counts);
    tree
}

/// What simulating pieces came to.
struct Windows {
    /// The statistics of those counted.
    pieces: Vec<Option<Tree>>,
    /// Those of what follows the last.
    tail: Tree,
    shown: Vec<Option<(crate::work::Surface, Vec<u8>)>>,
    wrong_pixels: u64,
    time: Duration,
}

/// What was counted of all pieces of a trace, simulated one after another.
pub struct Census {
    /// The trace, cut.
    pub pieces: Pieces,
    /// The statistics of those that are drawn from.
    pub inner: Vec<Tree>,
    /// Those of all else.
    pub rest: Vec<Tree>,
    /// Cycles of the frames as they are without pieces.
    pub cycles: Cycle,
}

/// Simulates all pieces of a trace, for a look at what sampling them would have told.
///
/// # Errors
/// If the machine is one on which draws cannot be sampled, the trace cannot be rendered, or the machine stops.
pub fn census(trace: &Trace, options: &Options) -> Result<Census> {
    let pieces = Pieces::render(trace, options)?;
    let windows = pieces.simulate(options, &vec![Role::Counted; pieces.pieces.len()], &|_| ())?;
    let (mut inner, mut rest) = (Vec::new(), vec![windows.tail]);
    for (piece, counted) in pieces.pieces.iter().zip(windows.pieces) {
        let to = if piece.edge { &mut rest } else { &mut inner };
        to.extend(counted);
    }
    let cycles = inner.iter().chain(&rest).map(|tree| counted(tree, "cycles")).sum::<f64>() as Cycle;
    Ok(Census { pieces, inner, rest, cycles })
}

/// What is told of a run: sums over those pieces that count once, and what the drawn ones stand for.
pub struct Told<'t> {
    /// What is expected of those drawn from.
    pub expected: &'t [Estimate],
    /// Their clusters.
    pub clusters: &'t Clusters,
    /// Those drawn, one of each.
    pub drawn: &'t [usize],
    /// Their statistics.
    pub own: &'t [&'t Tree],
    /// Those of what counts once.
    pub rest: &'t [&'t Tree],
}

impl Told<'_> {
    /// A count over all. Of cycles deviations count by their share, as all pieces have some; of what only few pieces do all count alike, so
    /// that a cluster with little of it tells that others may have more than is expected.
    pub fn total(&self, path: &str) -> Interval {
        let rest: f64 = self.rest.iter().map(|tree| counted(tree, path)).sum();
        let own: Vec<f64> = self.own.iter().map(|tree| counted(tree, path)).collect();
        let drawn = self.clusters.total(self.drawn, &weights(self.expected, path), &own, path == "cycles");
        Interval { value: rest + drawn.value, margin: drawn.margin }
    }

    /// The hit rate of a kind of cache, if anything was looked up there: a quotient of two totals, linearised; its error is that of what
    /// hits are beside the rate.
    fn hit_rate(&self, cache: &str) -> Option<Interval> {
        let [hits, lookups] = ["hits", "accesses"].map(|what| format!("caches.{cache}.{what}"));
        let all = self.total(&lookups).value;
        if all <= 0.0 {
            return None;
        }
        let rate = self.total(&hits).value / all;
        let beside: Vec<f64> = self.own.iter().map(|tree| counted(tree, &hits) - rate * counted(tree, &lookups)).collect();
        let margin = self.clusters.total(self.drawn, &weights(self.expected, &lookups), &beside, false).margin / all;
        Some(Interval { value: rate, margin })
    }
}

/// Replays a trace with some of its draws simulated; its statistics are estimates, with intervals. The pictures are the machine's own.
///
/// # Errors
/// If the machine is one on which draws cannot be sampled, the trace cannot be rendered or has too few draws, or the machine stops.
pub fn sampled(trace: &Trace, options: &Options, sampling: &DrawSampling, progress: &(dyn Fn(u32) + Sync)) -> Result<Replay> {
    let watch = Stopwatch::start();
    let DrawSampling { samples, seed, warm_up } = *sampling;
    if samples < LEAST {
        bail!(
            "{samples} pieces to be sampled miss what few of them do, and their intervals do not hold: {LEAST} are the least"
        );
    }
    if warm_up < 1 {
        bail!("a piece is timed from the end of the one before it: --warm-up 1 is the least");
    }
    let pieces = Pieces::render(trace, options)?;
    let all = pieces.len();
    let around = u64::from(samples) * (u64::from(warm_up) + 2);
    if (all as u64) < around {
        bail!(
            "the draws make {all} pieces of {GRAIN} estimated cycles or more, beside the first and the last of each pass: too few to sample {samples}, for which {around} are simulated; use cycle"
        );
    }
    let clusters = Clusters::new(&pieces.signatures, samples as usize);
    if clusters.members.len() < 2 {
        bail!("the {all} pieces are all alike, and one cannot give an interval: use cycle");
    }
    let drawn = clusters.draw(&mut random(seed));
    let roles = pieces.roles(&drawn, warm_up);
    let windows = pieces.simulate(options, &roles, progress)?;
    let of = |at: usize| windows.pieces[at].as_ref().ok_or_else(|| anyhow!("piece {at} was not counted"));
    let own = drawn.iter().map(|&at| of(pieces.inner[at])).collect::<Result<Vec<&Tree>>>()?;
    let edges = pieces.pieces.iter().enumerate().filter(|(_, piece)| piece.edge);
    let mut rest = edges.map(|(at, _)| of(at)).collect::<Result<Vec<&Tree>>>()?;
    rest.push(&windows.tail);
    let told = Told { expected: &pieces.expected, clusters: &clusters, drawn: &drawn, own: &own, rest: &rest };

    let mut total = told.tree(&pieces.funnel, options);
    total.child("sort").count("wrong_pixels", windows.wrong_pixels);
    let node = total.child("sampled");
    node.count("frames", pieces.frames.len() as u64);
    node.count("pieces", pieces.pieces.len() as u64);
    node.count("counted_pieces", drawn.len() as u64);
    node.count("edge_pieces", rest.len() as u64 - 1);
    node.count("simulated_pieces", roles.iter().filter(|role| **role != Role::Applied).count() as u64);
    let frames = pieces.frames.iter().zip(windows.shown);
    let frames = frames.map(|(&(number, funnel), shown)| {
        let mut tree = Tree::new();
        tree.set("funnel", Node::Tree(funnel_tree(&funnel)));
        Frame { number, shown, tree, phases: Vec::new() }
    });
    let machine_time = windows.time + pieces.time;
    Ok(Replay { frames: frames.collect(), total, machine_time, clock_time: watch.clock() })
}

impl Told<'_> {
    /// Statistics over all, with the margins of what is estimated; all caches of a kind as one.
    fn tree(&self, funnel: &Funnel, options: &Options) -> Tree {
        let mut total = Tree::new();
        let mut margins = Tree::new();
        let mut say = |path: &str, interval: Interval| {
            margins.real(path, interval.margin);
            interval.value.max(0.0).round() as u64
        };
        let cycles = say("cycles", self.total("cycles"));
        total.count("cycles", cycles);
        total.real("seconds", cycles as f64 / (f64::from(options.config.card.clock_mhz) * 1e6));
        total.set("funnel", Node::Tree(funnel_tree(funnel)));
        let Some(shape) = self.rest.first() else { return total };
        if let Some(Node::Tree(clients)) = shape.get("memory.clients") {
            for (client, _) in clients.entries() {
                for what in ["read_bytes", "write_bytes"] {
                    let path = format!("memory.clients.{client}.{what}");
                    let bytes = say(&path, self.total(&path));
                    total.child("memory").child("clients").child(client).count(what, bytes);
                }
            }
        }
        if shape.get("memory.dram").is_some() {
            for what in ["read_bytes", "write_bytes"] {
                let path = format!("memory.dram.{what}");
                let bytes = say(&path, self.total(&path));
                total.child("memory").child("dram").count(what, bytes);
            }
            say("memory.dram.bytes", self.total("memory.dram.bytes"));
        }
        if let Some(Node::Tree(caches)) = shape.get("caches") {
            for (cache, _) in caches.entries() {
                let Some(rate) = self.hit_rate(cache) else { continue };
                say(&format!("caches.{cache}.hit_rate"), rate);
                let misses = say(&format!("caches.{cache}.misses"), self.total(&format!("caches.{cache}.misses")));
                let accesses = self.total(&format!("caches.{cache}.accesses")).value.round() as u64;
                let counts = total.child("caches").element(cache, 0);
                counts.count("accesses", accesses.max(misses));
                counts.count("hits", accesses.saturating_sub(misses));
                counts.count("misses", misses);
            }
        }
        let node = total.child("sampled");
        node.real("level", LEVEL);
        node.set("margins", Node::Tree(margins));
        total
    }
}
