//! The `sampled` fidelity: some frames are simulated and stand for all ([`sample`](super::sample)).
//!
//! The trace is rendered twice: once for the profiles of all frames, by which those to be simulated are chosen, and once more with work
//! recorded for these alone.

use std::ops::Range;
use std::time::{Duration, Instant};

use anyhow::{Result, anyhow, bail};

use super::bound::{Bound, FrameEstimate};
use super::host::Stopwatch;
use super::replay::{Frame, Options, Replay, Simulated, simulate};
use super::sample::{Clusters, Interval, LEVEL, random, signature};
use crate::render::{self, FrameSet, Skips};
use crate::stats::{Leaf, Tree};
use crate::trace::Trace;
use crate::work::profile::Profiler;

/// How frames are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sampling {
    /// Frames to be simulated and counted: at least 2, for an interval.
    pub samples: u32,
    /// Of the random numbers.
    pub seed: u64,
    /// Frames simulated before each of these to warm the caches, and not counted.
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
    let bound = Bound::proxy(&options.config);
    let mut profiler = Profiler::default();
    let (mut frames, mut signatures, mut units, mut time) = (Vec::new(), Vec::new(), Vec::new(), Duration::ZERO);
    let render_options = render::Options {
        record: true,
        frames: options.frames.clone().into(),
        skips: Skips::default(),
        key: options.config.render_key(),
    };
    render::render(trace, &render_options, &mut |event| {
        if let Some(profile) = profiler.event(&event) {
            let start = Instant::now();
            let estimate = bound.frame(&profile);
            signatures.push(signature(&estimate, &mut units));
            frames.push(estimate);
            time += start.elapsed();
        }
        Ok(())
    })?;
    Ok(Survey { frames, signatures, time })
}

impl Survey {
    /// Estimated cycles by frame.
    pub fn cycles(&self) -> Vec<f64> {
        self.frames.iter().map(FrameEstimate::cycles).collect()
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

/// Replays a trace with some of its frames simulated; the statistics over all are estimates, with the intervals of the most important.
///
/// # Errors
/// If the trace cannot be rendered, has too few frames, or the machine stops.
pub fn sampled(trace: &Trace, options: &Options, sampling: &Sampling, progress: &(dyn Fn(u32) + Sync)) -> Result<Replay> {
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
    let Simulated { frames, machine_time, .. } = simulate(trace, options, chosen, progress)?;
    let mut counted: Vec<Option<Frame>> = frames.into_iter().map(Some).collect();
    let mut take = |number: &u32| {
        let frame = counted.iter_mut().find(|frame| frame.as_ref().is_some_and(|frame| frame.number == *number));
        frame.and_then(Option::take).ok_or_else(|| anyhow!("frame {number} was not simulated"))
    };
    let frames = numbers.iter().map(&mut take).collect::<Result<Vec<Frame>>>()?;

    let cycles = survey.cycles();
    let weights = clusters.weights(&drawn, &cycles);
    let trees: Vec<(f64, &Tree)> = weights.iter().copied().zip(frames.iter().map(|frame| &frame.tree)).collect();
    let mut total = Tree::weighted(&trees);
    let cycles_in_all = total.number("cycles").unwrap_or(0.0);
    total.real("seconds", cycles_in_all / (f64::from(options.config.card.clock_mhz) * 1e6));
    let node = total.child("sampled");
    node.count("frames", all as u64);
    node.count("counted_frames", drawn.len() as u64);
    node.count("simulated_frames", simulated);
    node.real("level", LEVEL);
    for (name, interval) in intervals(&clusters, &drawn, &cycles, &frames) {
        node.child("margins").real(&name, interval.margin);
    }
    let mut frames = frames;
    frames.sort_by_key(|frame| frame.number);
    Ok(Replay { frames, total, machine_time: machine_time + survey.time, clock_time: watch.clock() })
}

/// The intervals of the cycles, of the bytes of each client and of DRAM, and of the hit rate of each kind of cache.
fn intervals(clusters: &Clusters, drawn: &[usize], cycles: &[f64], frames: &[Frame]) -> Vec<(String, Interval)> {
    let mut found = Vec::new();
    let Some(first) = frames.first() else { return found };
    let mut paths = vec!["cycles".to_owned()];
    let mut caches: Vec<String> = Vec::new();
    first.tree.leaves(&mut |path, leaf| {
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
    for path in paths {
        let counted: Vec<f64> = frames.iter().map(|frame| frame.tree.number(&path).unwrap_or(0.0)).collect();
        found.push((path, clusters.total(drawn, cycles, &counted)));
    }
    for cache in caches {
        let sum = |frame: &Frame, what: &str| {
            let parts = (0..).map_while(|i| frame.tree.number(&format!("caches.{cache}[{i}].{what}")));
            parts.sum::<f64>()
        };
        let hits: Vec<f64> = frames.iter().map(|frame| sum(frame, "hits")).collect();
        let accesses: Vec<f64> = frames.iter().map(|frame| sum(frame, "accesses")).collect();
        let all = clusters.total(drawn, cycles, &accesses).value;
        if all > 0.0 {
            let rate = clusters.total(drawn, cycles, &hits).value / all;
            // A quotient of two totals, linearised: its error is that of what hits are beside the rate.
            let beside: Vec<f64> = hits.iter().zip(&accesses).map(|(hits, accesses)| hits - rate * accesses).collect();
            let margin = clusters.total(drawn, cycles, &beside).margin / all;
            found.push((format!("caches.{cache}.hit_rate"), Interval { value: rate, margin }));
        }
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
