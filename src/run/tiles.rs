//! Sampling over screen tiles: a frame is drawn in some of its tiles of 64 x 64 pixels, several times with others, and each run stands
//! for all of it.
//!
//! Tiles are dealt to groups at random, those of each pipeline by themselves. A run keeps all geometry and the pixels of one group, so that depths, blending and caches of
//! these tiles are what they are in the whole frame. The cycles of a pass are taken times the estimate ([`Bound`]) of the whole by that
//! of the part, what its pixels move times the whole's quads by its own, and what geometry moves as it is. The runs differ by chance, and the interval is Student's for their number.
//! What all have in common is not in it: the estimate's own error in going from the part to the whole.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Result, bail};
use rayon::prelude::*;

use super::bound::{Bound, PhaseEstimate};
use super::host::Stopwatch;
use super::replay::{Frame, Options, Replay};
use super::sample::{Interval, LEVEL, STUDENT, random};
use crate::machine::{Config, Machine};
use crate::num::Cycle;
use crate::render::{self, Held};
use crate::report::files::funnel_tree;
use crate::stats::{Node, Tree};
use crate::trace::Trace;
use crate::unit::interleave::Interleave;
use crate::unit::phase::{Phase, PhaseKind};
use crate::work::profile::{FrameProfile, PhaseProfile, Profiler};
use crate::work::{BLOCK, Event, Funnel, Segment, TILE, TileWork, Visit};

/// How tiles are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileSampling {
    /// Runs: at least 2, for an interval.
    pub samples: u32,
    /// Groups that tiles are dealt to; each run draws those of one. At least as many as runs.
    pub groups: u32,
    /// Of the random numbers.
    pub seed: u64,
}

/// Deals tiles to groups at random, those of each pipeline by themselves, so that a group has work for all.
fn deal(tiles: BTreeSet<(u16, u16)>, config: &Config, size: [u32; 2], sampling: &TileSampling) -> BTreeMap<(u16, u16), u32> {
    let distribute = &config.distribute;
    let mut interleave = Interleave::new(distribute.pattern, config.card.pipelines, distribute.tile);
    interleave.begin_pass(size[0], size[1]);
    let mut random = random(sampling.seed);
    let mut order: Vec<(u8, u64, (u16, u16))> = tiles
        .into_iter()
        .map(|(x, y)| {
            let [column, row] = [x, y].map(|at| u32::from(at) * TILE / BLOCK);
            (interleave.owner(column, row), random(), (x, y))
        })
        .collect();
    order.sort_unstable();
    order.into_iter().zip(0..).map(|((_, _, tile), at)| (tile, at % sampling.groups)).collect()
}

/// A segment with the pixels of some tiles only.
fn part(segment: &Segment, keep: impl Fn(&TileWork) -> bool) -> Segment {
    let kept: Vec<bool> = segment.tiles.iter().map(keep).collect();
    let mut visits: Vec<Visit> = Vec::with_capacity(segment.visits.len());
    let triangles = segment.triangles.iter().map(|triangle| {
        let first_visit = visits.len() as u32;
        let all = &segment.visits[triangle.first_visit as usize..][..triangle.visits as usize];
        visits.extend(all.iter().filter(|visit| kept[visit.tile as usize]));
        crate::work::Triangle { first_visit, visits: visits.len() as u32 - first_visit, ..*triangle }
    });
    let triangles = triangles.collect();
    let tiles = segment.tiles.iter().zip(&kept);
    let tiles =
        tiles.map(|(tile, kept)| if *kept { tile.clone() } else { TileWork { x: tile.x, y: tile.y, ..TileWork::default() } });
    Segment {
        index_address: segment.index_address,
        index_bytes: segment.index_bytes,
        stream: segment.stream.clone(),
        vertices: segment.vertices.clone(),
        primitives: segment.primitives.clone(),
        triangles,
        tiles: tiles.collect(),
        visits,
        requests: segment.requests.clone(),
        lines: segment.lines.clone(),
        signatures: segment.signatures.clone(),
        costs: segment.costs.clone(),
        funnel: segment.funnel,
    }
}

/// One run: its counts, the cycles of the whole by it, its quads, and host time of the machine.
struct Run {
    tree: Tree,
    cycles: f64,
    quads: f64,
    time: Duration,
}

/// Replays a trace with some tiles drawn at a time.
///
/// # Errors
/// If the trace cannot be rendered, the configuration's rates are not known, or the machine stops.
pub fn sampled(trace: &Trace, options: &Options, sampling: &TileSampling) -> Result<Replay> {
    let watch = Stopwatch::start();
    let TileSampling { samples, groups, .. } = *sampling;
    if samples < 2 || groups < samples {
        bail!("{samples} runs over {groups} groups of tiles: 2 runs are the least, and groups are at least as many");
    }
    let mut bound = Bound::new(&options.config)?;
    // All work is kept, and the runs go side by side, each with its part of the work.
    let runs = u64::from(samples);
    let held = Held { images: runs * Machine::images(&options.config), pieces: u64::MAX, pictures: true };
    let render_options = render::Options { held, ..options.rendering() };
    // 1. The whole, once.
    let mut whole = Profiler::default();
    let mut frames: Vec<FrameProfile> = Vec::new();
    let mut events: Vec<Event> = Vec::new();
    let (mut funnel, mut shown) = (Funnel::default(), Vec::new());
    let mut own = Funnel::default();
    let (mut tiles, mut size) = (BTreeSet::new(), [1; 2]);
    render::render(trace, &render_options, &mut |event| {
        frames.extend(whole.event(&event));
        match &event {
            Event::Segment(segment) => {
                own += segment.funnel;
                tiles.extend(segment.tiles.iter().map(|tile| (tile.x, tile.y)));
            }
            Event::BeginPass(pass) => size = [size[0].max(pass.width), size[1].max(pass.height)],
            Event::EndFrame(end) => {
                let mut tree = Tree::new();
                tree.set("funnel", Node::Tree(funnel_tree(&own)));
                funnel += std::mem::take(&mut own);
                let picture = end.shown.map(|surface| (surface, end.reference.to_vec()));
                shown.push(Frame { number: end.number, shown: picture, tree, phases: Vec::new() });
            }
            _ => {}
        }
        events.push(event);
        Ok(())
    })?;
    let start = Instant::now();
    let estimate: Vec<PhaseEstimate> = frames.iter().flat_map(|frame| bound.frame(frame).phases).collect();
    let estimating = start.elapsed();

    // 2. Its parts.
    let groups_of = deal(tiles, &options.config, size, sampling);
    let run = |own: u32| -> Result<Run> {
        let parts: Vec<Event> = events
            .iter()
            .map(|event| match event {
                Event::Segment(segment) => Event::Segment(Arc::new(part(segment, |tile| groups_of[&(tile.x, tile.y)] == own))),
                other => other.clone(),
            })
            .collect();
        let mut profiler = Profiler::default();
        let profiles: Vec<FrameProfile> = parts.iter().filter_map(|event| profiler.event(event)).collect();
        let mut bound = Bound::new(&options.config)?;
        let parts_of = profiles.iter().flat_map(|frame| bound.frame(frame).phases);
        let quads = profiles.iter().flat_map(|frame| &frame.phases).map(PhaseProfile::quads).sum::<u64>() as f64;
        let mut machine = Machine::new(&options.config)?;
        let busy = Stopwatch::start();
        let mut phases: Vec<(Phase, Cycle)> = Vec::new();
        let report = machine.run_each(parts.into_iter(), options.clock, |frame| phases.extend(frame.phases))?;
        let time = busy.elapsed();
        // Passes grow with their pixels; what lies between them is all there.
        let grown = phases.iter().zip(parts_of).zip(&estimate).map(|(((phase, cycles), part), whole)| {
            let by = if phase.kind == PhaseKind::Pass { whole.cycles / part.cycles } else { 1.0 };
            by * *cycles as f64
        });
        let cycles = grown.sum();
        Ok(Run { tree: report.total, cycles, quads, time })
    };
    let runs = (0..samples).into_par_iter().map(run).collect::<Result<Vec<Run>>>()?;

    // 3. What they say together: cycles by estimate, what pixels do by their number, all else as it is.
    let mut total = Tree::new();
    let mut margins = Tree::new();
    let left = 1.0 - f64::from(samples) / f64::from(groups);
    let mut say = |path: &str, values: Vec<f64>| {
        let interval = mean(&values, left);
        margins.real(path, interval.margin);
        interval.value
    };
    let scaled = |path: &str, by: &dyn Fn(&Run) -> f64| -> Vec<f64> {
        runs.iter().map(|run| by(run) * run.tree.number(path).unwrap_or(0.0)).collect()
    };
    let quads = funnel.quads_rasterized as f64;
    let pixels = |run: &Run| quads / run.quads.max(1.0);
    let cycles = say("cycles", runs.iter().map(|run| run.cycles).collect());
    total.count("cycles", cycles.round() as u64);
    total.real("seconds", cycles / (f64::from(options.config.card.clock_mhz) * 1e6));
    total.set("funnel", Node::Tree(funnel_tree(&funnel)));
    if let Some(Node::Tree(clients)) = runs.first().and_then(|run| run.tree.get("memory.clients")) {
        for (client, _) in clients.entries() {
            for what in ["read_bytes", "write_bytes"] {
                let path = format!("memory.clients.{client}.{what}");
                let by: &dyn Fn(&Run) -> f64 = if ["color", "depth", "texture"].contains(&client) { &pixels } else { &|_| 1.0 };
                let bytes = say(&path, scaled(&path, by));
                total.child("memory").child("clients").child(client).count(what, bytes.round() as u64);
            }
        }
    }
    for cache in ["texture", "depth", "color"] {
        let sum =
            |run: &Run, what: &str| (0..).map_while(|i| run.tree.number(&format!("caches.{cache}[{i}].{what}"))).sum::<f64>();
        if runs.iter().all(|run| sum(run, "accesses") > 0.0) {
            let path = format!("caches.{cache}.hit_rate");
            let rate = say(&path, runs.iter().map(|run| sum(run, "hits") / sum(run, "accesses")).collect());
            total.child("caches").child(cache).real("hit_rate", rate);
        }
    }
    let node = total.child("sampled");
    node.count("frames", frames.len() as u64);
    node.count("runs", u64::from(samples));
    node.count("groups_of_tiles", u64::from(groups));
    node.real("level", LEVEL);
    node.set("margins", Node::Tree(margins));
    let machine_time = runs.iter().map(|run| run.time).sum::<Duration>() + estimating;
    Ok(Replay { frames: shown, total, machine_time, clock_time: watch.clock() })
}

/// The mean of independent values, of which `left` are not looked at, with its interval.
fn mean(values: &[f64], left: f64) -> Interval {
    let n = values.len() as f64;
    let value = values.iter().sum::<f64>() / n;
    let spread = values.iter().map(|v| (v - value) * (v - value)).sum::<f64>() / (n - 1.0);
    let t = STUDENT.get(values.len() - 2).copied().unwrap_or(STUDENT[STUDENT.len() - 1]);
    Interval { value, margin: t * (spread / n * left).sqrt() }
}
