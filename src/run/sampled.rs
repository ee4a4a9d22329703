//! The `sampled` fidelity: some frames are simulated and stand for all ([`sample`](super::sample)).
//!
//! The trace is rendered twice: once for the profiles of all frames, by which those to be simulated are chosen, and once more with work
//! recorded for these alone.

use std::ops::Range;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow, bail};

use super::bound::{BATCH, Bound, FrameEstimate, PhaseEstimate};
use super::host::Stopwatch;
use super::replay::{Exit, Frame, Options, Outcome, Simulated, simulate};
use super::sample::{Clusters, Interval, LEVEL, random, signature};
use crate::machine::Config;
use crate::machine::config::SortClass;
use crate::render::{self, FrameSet};
use crate::stats::{Leaf, Tree};
use crate::trace::Trace;
use crate::unit::sorting::{EarlyTest, Keep};
use crate::work::profile::{FrameProfile, Profiler};

/// How frames are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Frames to be simulated and counted: at least 2, for an interval.
    pub samples: u32,
    /// Of the random numbers.
    pub seed: u64,
    /// Frames before each of these that warm the caches, and are not counted: drawn at once where the machine is one on which they can be
    /// ([`apply`](crate::unit::apply)), else simulated.
    pub warm_up: u32,
}

impl Default for Sampling {
    fn default() -> Self {
        Sampling { samples: 8, seed: 1, warm_up: 1 }
    }
}

/// The estimates of all frames, by which they are compared.
#[derive(Clone, Debug)]
pub struct Survey {
    /// A frame's number, and its estimate.
    pub frames: Vec<FrameEstimate>,
    /// Their signatures.
    pub signatures: Vec<Vec<f64>>,
    /// Host time of the estimates, rendering and profiles left out.
    pub time: Duration,
}

/// Renders a trace for the estimates of its frames.
///
/// # Errors
/// If it cannot be rendered.
pub fn survey(trace: &Trace, options: &Options) -> Result<Survey> {
    let mut bound = Bound::proxy(&options.config);
    let mut profiler = Profiler::default();
    let (mut frames, mut signatures, mut units, mut time) = (Vec::new(), Vec::new(), Vec::new(), Duration::ZERO);
    let mut estimate = |profiles: &mut Vec<FrameProfile>| {
        let start = Instant::now();
        for profile in profiles.drain(..) {
            let estimate = bound.frame(&profile);
            signatures.push(signature(estimate.phases.iter().flat_map(|phase| phase.units.iter().copied()), &mut units));
            frames.push(estimate);
        }
        time += start.elapsed();
    };
    let mut profiles: Vec<FrameProfile> = Vec::with_capacity(BATCH);
    let render_options = options.rendering();
    render::render(trace, &render_options, &mut |event| {
        profiles.extend(profiler.event(&event));
        if profiles.len() == BATCH {
            estimate(&mut profiles);
        }
        Ok(())
    })?;
    estimate(&mut profiles);
    Ok(Survey { frames, signatures, time })
}

/// What is estimated of a phase, to which a count of its is taken to be in proportion.
pub type Quantity = fn(&PhaseEstimate) -> f64;

/// What a count is in proportion to: what is estimated of just this, where it is, else cycles.
fn quantity(path: &str) -> Quantity {
    match path {
        "memory.dram.read_bytes" => |phase| phase.memory.read,
        "memory.dram.write_bytes" => |phase| phase.memory.written,
        "memory.dram.bytes" => |phase| phase.memory.read + phase.memory.written,
        "caches.l2.accesses" => |phase| phase.memory.lookups,
        "caches.l2.misses" => |phase| phase.memory.misses,
        "caches.texture.accesses" => |phase| phase.textures[0],
        "caches.texture.misses" | TEXTURE_BYTES => |phase| phase.textures[1],
        _ => |phase| phase.cycles,
    }
}

/// What texture caches read: lines that they miss.
const TEXTURE_BYTES: &str = "memory.clients.texture.read_bytes";

/// Caches of which misses are estimated.
const ESTIMATED: [&str; 2] = ["texture", "l2"];

/// The sum over a kind of cache; or of DRAM's bytes; or any other count.
pub fn counted(tree: &Tree, path: &str) -> f64 {
    let n = |path: &str| tree.number(path).unwrap_or(0.0);
    match path.strip_prefix("caches.").and_then(|rest| rest.split_once('.')) {
        Some((cache, what)) => (0..).map_while(|i| tree.number(&format!("caches.{cache}[{i}].{what}"))).sum(),
        None if path == "memory.dram.bytes" => n("memory.dram.read_bytes") + n("memory.dram.write_bytes"),
        None => n(path),
    }
}

impl Survey {
    /// What is estimated by frame, of what a count is in proportion to.
    pub fn estimates(&self, path: &str) -> Vec<f64> {
        let quantity = quantity(path);
        self.frames.iter().map(|frame| frame.phases.iter().map(quantity).sum()).collect()
    }

    /// The sum over all frames of what was counted in those drawn.
    pub fn total(&self, clusters: &Clusters, drawn: &[usize], path: &str, frames: &[&Tree]) -> Interval {
        let own: Vec<f64> = frames.iter().map(|tree| counted(tree, path)).collect();
        clusters.total(drawn, &self.estimates(path), &own)
    }
}

/// Whether functional warming ([`apply`](crate::unit::apply)) leaves on this machine what simulating a frame leaves. Frames that warm up
/// are simulated on the others: a tile-based machine draws tile after tile, each with all draws of a pass; pipelines of sort-last image
/// draw into copies; with some policies of sort-last fragment draws do not end in order, or are tested against depths of one pipeline.
fn warms_functionally(config: &Config) -> bool {
    match config.card.sort {
        SortClass::First | SortClass::Middle => true,
        SortClass::LastFragment => config.order.keep == Keep::Always && config.order.early != EarlyTest::Local,
        SortClass::MiddleBinned | SortClass::LastImage => false,
    }
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
pub(super) fn sampled(
    trace: &Trace,
    options: &Options,
    sampling: &Sampling,
    progress: &(dyn Fn(u32) + Sync),
    exit: &mut Exit<'_, '_>,
) -> Result<Outcome> {
    let watch = Stopwatch::start();
    let survey = survey(trace, options)?;
    let all = survey.frames.len();
    if sampling.samples < 2 {
        bail!("{} frames to be sampled give no interval: 2 are the least", sampling.samples);
    }
    if all <= sampling.samples as usize {
        bail!("{all} frames are too few to sample {} of them: use cycle", sampling.samples);
    }
    let clusters = Clusters::new(&survey.signatures, sampling.samples as usize);
    if clusters.members.len() < 2 {
        bail!("the {all} frames are all alike, and one cannot give an interval: use cycle with --frames");
    }
    let drawn = clusters.draw(&mut random(sampling.seed));
    let numbers: Vec<u32> = drawn.iter().map(|&frame| survey.frames[frame].number).collect();
    let chosen = ranges(&numbers, options.frames.start, sampling.warm_up);
    let simulated = chosen.count();
    let functional = warms_functionally(&options.config);
    let warms_up = |number: u32| functional && !numbers.contains(&number);
    // What was counted of the frames drawn; those that warm up are not reported.
    let mut counted: Vec<Option<Tree>> = vec![None; numbers.len()];
    let mut count = |frame: Frame| {
        let Some(at) = numbers.iter().position(|&number| number == frame.number) else { return Ok(()) };
        counted[at] = Some(frame.tree.clone());
        exit.pass(frame)
    };
    let Simulated { machine_time, .. } =
        simulate(trace, options, chosen, &warms_up, progress, &mut Exit::new(&mut count, false))?;
    let found = counted.into_iter().zip(&numbers);
    let found = found.map(|(tree, number)| tree.ok_or_else(|| anyhow!("frame {number} was not simulated")));
    let counted = found.collect::<Result<Vec<Tree>>>()?;

    let weights = clusters.weights(&drawn, &survey.estimates("cycles"));
    let trees: Vec<(f64, &Tree)> = weights.iter().copied().zip(&counted).collect();
    let mut total = Tree::weighted(&trees);
    let cycles_in_all = total.number("cycles").unwrap_or(0.0);
    total.real("seconds", cycles_in_all / (f64::from(options.config.card.clock_mhz) * 1e6));
    let trees: Vec<&Tree> = counted.iter().collect();
    estimated(&mut total, &survey, &clusters, &drawn, &trees);
    let margins = intervals(&survey, &clusters, &drawn, &trees);
    let node = total.child("sampled");
    node.count("frames", all as u64);
    node.count("counted_frames", drawn.len() as u64);
    node.count("simulated_frames", simulated);
    node.real("level", LEVEL);
    for (name, interval) in margins {
        node.child("margins").real(&name, interval.margin);
    }
    Ok(Outcome { total, machine_time: machine_time + survey.time, clock_time: watch.clock() })
}

/// Puts what caches and DRAM do into the total, by what is estimated of just that.
fn estimated(total: &mut Tree, survey: &Survey, clusters: &Clusters, drawn: &[usize], frames: &[&Tree]) {
    let sum = |path: &str, leaf: &str| -> f64 {
        let weights = clusters.weights(drawn, &survey.estimates(path));
        weights.iter().zip(frames).map(|(weight, tree)| weight * tree.number(leaf).unwrap_or(0.0)).sum()
    };
    for (path, names) in [
        ("memory.dram.read_bytes", &["memory", "dram"][..]),
        ("memory.dram.write_bytes", &["memory", "dram"]),
        (TEXTURE_BYTES, &["memory", "clients", "texture"]),
    ] {
        if total.number(path).is_some() {
            let bytes = sum(path, path).round() as u64;
            let node = names.iter().fold(&mut *total, |node, name| node.child(name));
            node.count(path.rsplit('.').next().unwrap_or(path), bytes);
        }
    }
    for cache in ESTIMATED {
        let count = (0..).take_while(|i| total.number(&format!("caches.{cache}[{i}].misses")).is_some()).count();
        for at in 0..count {
            let of = |quantity: &str, what: &str| {
                sum(&format!("caches.{cache}.{quantity}"), &format!("caches.{cache}[{at}].{what}")).round() as u64
            };
            let (misses, evictions) = (of("misses", "misses"), of("misses", "evictions"));
            let accesses = of("accesses", "accesses").max(misses);
            let node = total.child("caches").element(cache, at);
            node.count("accesses", accesses);
            node.count("hits", accesses - misses);
            node.count("misses", misses);
            node.count("evictions", evictions);
        }
    }
}

/// The intervals of the cycles, of the bytes of each client and of DRAM, and of the hit rate of each kind of cache; of the caches of
/// which misses are estimated, of these too.
fn intervals(survey: &Survey, clusters: &Clusters, drawn: &[usize], frames: &[&Tree]) -> Vec<(String, Interval)> {
    let mut found = Vec::new();
    let Some(first) = frames.first() else { return found };
    let mut paths = vec!["cycles".to_owned()];
    let mut caches: Vec<String> = Vec::new();
    first.leaves(&mut |path, leaf| {
        if !matches!(leaf, Leaf::Count(_)) {
            return;
        }
        if path.starts_with("memory.clients.") && path.ends_with("_bytes")
            || path.starts_with("memory.dram.") && path.ends_with("_bytes")
        {
            paths.push(path.to_owned());
        }
        if let Some((name, _)) = path.strip_prefix("caches.").and_then(|rest| rest.split_once('['))
            && caches.iter().all(|known| known != name)
        {
            caches.push(name.to_owned());
        }
    });
    paths.push("memory.dram.bytes".into());
    for path in paths {
        let interval = survey.total(clusters, drawn, &path, frames);
        found.push((path, interval));
    }
    let total = |path: &str| survey.total(clusters, drawn, path, frames);
    for cache in caches {
        let accesses = total(&format!("caches.{cache}.accesses"));
        if accesses.value <= 0.0 {
            continue;
        }
        let path = format!("caches.{cache}.hit_rate");
        if ESTIMATED.contains(&cache.as_str()) {
            // Lookups are known all but exactly: the rate is off by what misses are.
            let misses = total(&format!("caches.{cache}.misses"));
            let rate = 1.0 - misses.value / accesses.value;
            found.push((path, Interval { value: rate, margin: misses.margin / accesses.value }));
            found.push((format!("caches.{cache}.misses"), misses));
            continue;
        }
        let counts = |what: &str| frames.iter().map(|tree| counted(tree, &format!("caches.{cache}.{what}"))).collect();
        let (hits, lookups): (Vec<f64>, Vec<f64>) = (counts("hits"), counts("accesses"));
        let rate = total(&format!("caches.{cache}.hits")).value / accesses.value;
        // A quotient of two totals, linearised: its error is that of what hits are beside the rate.
        let beside: Vec<f64> = hits.iter().zip(&lookups).map(|(hits, lookups)| hits - rate * lookups).collect();
        let margin = clusters.total(drawn, &survey.estimates("cycles"), &beside).margin / accesses.value;
        found.push((path, Interval { value: rate, margin }));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_warm_up_for_each_other() {
        let all = |set: FrameSet| (0..30).filter(|&frame| set.contains(frame)).collect::<Vec<u32>>();
        assert_eq!(all(ranges(&[7, 3, 8, 20], 0, 1)), [2, 3, 6, 7, 8, 19, 20]);
        assert_eq!(ranges(&[7, 3, 8, 20], 0, 1).count(), 7);
        assert_eq!(all(ranges(&[5], 5, 3)), [5]);
        assert_eq!(ranges(&[5, 0], 0, 2), [0..1, 3..6].into_iter().collect());
    }
}
