//! Frames in runs against one machine that simulates all: what differs, and what it takes.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::num::NonZeroU32;
use std::time::Duration;

use anyhow::{Result, bail, ensure};

use run::cycle::{Simulated, simulate};
use run::frame_runs::simulate_in_runs;
use run::frame_sink::FrameSink;
use run::host::process_cpu_time;
use run::replay::{Fidelity, Options, ReplayOutcome, replay_to};
use run::sample::survey::{Count, MISSES};
use stats::Tree;
use trace::Trace;
use work::Surface;

/// What is compared, in this order.
fn counts() -> [(&'static str, Count); COUNTS] {
    let misses = |cache: &str| Count::Cache(cache.to_owned(), MISSES);
    [
        ("cycles", Count::Cycles),
        ("DRAM bytes", Count::DramBytes),
        ("L2 misses", misses("l2")),
        ("texture misses", misses("texture")),
    ]
}

/// How many that are.
const COUNTS: usize = 4;

/// A sequence, simulated both ways.
#[derive(Clone, Debug)]
pub struct Compared {
    /// The sequence.
    pub name: String,
    /// Its frames.
    pub frames: usize,
    /// Cycles on one machine.
    pub cycles: f64,
    /// By how much the sums over all runs differ from one machine's, as shares; none where there is nothing.
    pub off: [Option<f64>; COUNTS],
    /// Mean and greatest difference of a frame's cycles, as shares.
    pub frame: [f64; 2],
    /// Frames that show other bytes.
    pub other_pictures: usize,
    /// Clock time of the whole replay: on one machine, and in runs; of each pair.
    pub times: Vec<[Duration; 2]>,
    /// Processor time of the first pair, where the system tells.
    pub spent: Option<[Spent; 2]>,
}

/// Where processor time went.
#[derive(Clone, Copy, Debug)]
pub struct Spent {
    /// In the renderer, and whatever else is no machine.
    pub rendering: Duration,
    /// In the machine that is warmed for the runs to begin with.
    pub warming: Duration,
    /// In the machines that simulate.
    pub machines: Duration,
}

impl Spent {
    /// In all.
    fn all(&self) -> f64 {
        (self.rendering + self.warming + self.machines).as_secs_f64()
    }

    /// The least time on `cores` cores. All of them share the work evenly, but none of it ends before the machine that is warmed with one
    /// frame after another. The renderer draws the tiles of a frame in parallel.
    fn least(&self, cores: f64) -> f64 {
        (self.all() / cores).max(self.warming.as_secs_f64())
    }
}

/// Cycles and picture of each frame by its number.
type Frames = BTreeMap<u32, (f64, Option<(Surface, blake3::Hash)>)>;

fn run(trace: &Trace, options: &Options) -> Result<(Frames, ReplayOutcome, Option<Spent>)> {
    let (mut frames, before) = (Frames::new(), process_cpu_time());
    let outcome = replay_to(trace, options, &|_| (), &mut |frame| {
        let picture = frame.shown.map(|(surface, bytes)| (surface, blake3::hash(&bytes)));
        frames.insert(frame.number, (Count::Cycles.of(&frame.tree), picture));
        Ok(())
    })?;
    let spent = process_cpu_time().zip(before).map(|(now, before)| Spent {
        rendering: (now - before).saturating_sub(outcome.machine_time),
        warming: outcome.warming_time,
        machines: outcome.machine_time.saturating_sub(outcome.warming_time),
    });
    Ok((frames, outcome, spent))
}

/// Simulates a sequence on one machine, then in runs of `frames_per_run` frames, and repeats this `pairs` times.
///
/// # Errors
/// If the trace cannot be replayed, the card cannot be warmed functionally, or the sequence has no more frames than a run.
pub fn compare(name: &str, trace: &Trace, options: &Options, frames_per_run: NonZeroU32, pairs: u32) -> Result<Compared> {
    let one = Options { fidelity: Fidelity::Cycle, frames_per_run: None, ..options.clone() };
    let cut = Options { frames_per_run: Some(frames_per_run), ..one.clone() };
    let ((frames, whole, spent), (frames_in_runs, runs, spent_in_runs)) = (run(trace, &one)?, run(trace, &cut)?);
    ensure!(runs.frames_per_run.is_some(), "{name} has {} frames: one run has {frames_per_run}", frames.len());
    let mut times = vec![[whole.clock_time, runs.clock_time]];
    for _ in 1..pairs {
        times.push([run(trace, &one)?.1.clock_time, run(trace, &cut)?.1.clock_time]);
    }
    let off = counts().map(|(_, count)| {
        let (one, runs) = (count.of(&whole.total), count.of(&runs.total));
        (one > 0.0).then(|| runs / one - 1.0)
    });
    let (mut mean, mut greatest, mut other_pictures) = (0.0, 0.0_f64, 0);
    for (number, (cycles, picture)) in &frames {
        let (other, shown) = &frames_in_runs[number];
        let off = (other / cycles - 1.0).abs();
        mean += off / frames.len() as f64;
        greatest = greatest.max(off);
        other_pictures += usize::from(picture != shown);
    }
    let cycles = Count::Cycles.of(&whole.total);
    let (name, frames, frame) = (name.to_owned(), frames.len(), [mean, greatest]);
    let spent = spent.zip(spent_in_runs).map(|(one, runs)| [one, runs]);
    Ok(Compared { name, frames, cycles, off, frame, other_pictures, times, spent })
}

/// A sequence on one machine, and as one run of frames: nothing may differ.
#[derive(Clone, Debug)]
pub struct OneRun {
    /// The sequence.
    pub name: String,
    /// Its frames.
    pub frames: usize,
    /// Cycles on one machine.
    pub cycles: u64,
    /// Frames that have other statistics.
    pub other_statistics: usize,
    /// Frames that show other bytes.
    pub other_pictures: usize,
    /// Whether the sums over all frames are the same.
    pub same_sums: bool,
}

impl OneRun {
    /// Whether nothing differs.
    pub fn equal(&self) -> bool {
        self.same_sums && self.other_statistics == 0 && self.other_pictures == 0
    }
}

/// Statistics and picture of each frame.
type FramesInFull = Vec<(u32, Tree, Option<(Surface, blake3::Hash)>)>;

/// On one machine, or in one run, even of few frames: a replay would not cut those.
fn in_full(trace: &Trace, options: &Options, in_runs: bool) -> Result<(FramesInFull, Simulated)> {
    let (mut frames, mut out) = (FramesInFull::new(), Simulated::default());
    let (card, mut rendering) = ((&options.config, options.clock), options.rendering(trace));
    let sink = FrameSink::new(|frame| {
        let picture = frame.shown.map(|(surface, bytes)| (surface, blake3::hash(&bytes)));
        frames.push((frame.number, frame.tree, picture));
        Ok(())
    });
    if in_runs {
        simulate_in_runs(&mut rendering, card, u32::MAX, sink, &mut out)?;
    } else {
        simulate(&mut rendering, card, sink, &mut out)?;
    }
    rendering.run()?;
    Ok((frames, out))
}

/// Simulates a sequence on one machine and as one run of all its frames.
///
/// # Errors
/// If the trace cannot be replayed, has no frame, or the card cannot be warmed functionally.
pub fn one_run(name: &str, trace: &Trace, options: &Options) -> Result<OneRun> {
    if let Some(why) = options.no_runs() {
        bail!("frames cannot be simulated in runs: {why}");
    }
    let ((one, sum), (run, sum_of_run)) = (in_full(trace, options, false)?, in_full(trace, options, true)?);
    ensure!(!one.is_empty(), "{name} has no frame");
    ensure!(one.len() == run.len(), "{name} has {} frames on one machine, {} in a run", one.len(), run.len());
    let differ = |differs: &dyn Fn(usize) -> bool| (0..one.len()).filter(|&at| differs(at)).count();
    Ok(OneRun {
        name: name.to_owned(),
        frames: one.len(),
        cycles: sum.cycles,
        other_statistics: differ(&|at| (one[at].0, &one[at].1) != (run[at].0, &run[at].1)),
        other_pictures: differ(&|at| one[at].2 != run[at].2),
        same_sums: (sum.cycles, &sum.total) == (sum_of_run.cycles, &sum_of_run.total),
    })
}

/// The head of the table of [`row_of_one_run`].
pub fn head_of_one_run() -> &'static str {
    "| sequence | frames | cycles on one machine | frames with other statistics | frames that look different | sums over all frames |\n\
     |---|--:|--:|--:|--:|---|\n"
}

/// What differs, as a row of a table in Markdown.
pub fn row_of_one_run(compared: &OneRun) -> String {
    let OneRun { name, frames, cycles, other_statistics, other_pictures, same_sums } = compared;
    let sums = if *same_sums { "equal" } else { "different" };
    format!("| {name} | {frames} | {cycles} | {other_statistics} | {other_pictures} | {sums} |\n")
}

/// What differs, as a table in Markdown: the same on every host.
pub fn table(compared: &[Compared]) -> String {
    let names = counts().map(|(name, _)| format!("in {name}")).join(" | ");
    let mut out = format!(
        "| sequence | frames | cycles on one machine | {names} | of a frame's cycles: mean, greatest | frames that look different |\n\
         |---|--:|--:|{}--:|--:|\n",
        "--:|".repeat(COUNTS)
    );
    for Compared { name, frames, cycles, off, frame: [mean, greatest], other_pictures, .. } in compared {
        let off = off.map(|off| off.map_or("-".into(), |off| format!("{:+.3} %", 100.0 * off))).join(" | ");
        let (mean, greatest) = (100.0 * mean, 100.0 * greatest);
        let _ = writeln!(out, "| {name} | {frames} | {cycles} | {off} | {mean:.2}, {greatest:.2} % | {other_pictures} |");
    }
    out
}

/// Host times, as a table in Markdown: medians of the pairs.
pub fn times(compared: &[Compared]) -> String {
    let mut out = String::from("| sequence | one machine | in runs | share: median, least, greatest |\n|---|--:|--:|--:|\n");
    for Compared { name, times, .. } in compared {
        let sorted = |of: &dyn Fn(&[Duration; 2]) -> f64| {
            let mut values: Vec<f64> = times.iter().map(of).collect();
            values.sort_by(f64::total_cmp);
            values
        };
        let [one, runs] = [0, 1].map(|at: usize| sorted(&|pair| pair[at].as_secs_f64())[times.len() / 2]);
        let shares = sorted(&|[one, runs]| runs.as_secs_f64() / one.as_secs_f64());
        let (median, least, greatest) = (shares[shares.len() / 2], shares[0], shares[shares.len() - 1]);
        let _ = writeln!(out, "| {name} | {one:.2} s | {runs:.2} s | {median:.2}, {least:.2}, {greatest:.2} |");
    }
    out
}

/// Where the processor time of runs went, and what follows for more cores, as a table in Markdown; nothing where the system does not tell.
pub fn shares(compared: &[Compared]) -> String {
    const CORES: [f64; 4] = [2.0, 4.0, 8.0, 16.0];
    let mut out = String::from(
        "| sequence | one machine: processor time | in runs: renderer | warming | machines | least time on 2, 4, 8, 16 cores, of one core's | \
         measured here |\n\
         |---|--:|--:|--:|--:|--:|--:|\n",
    );
    let mut known = false;
    for Compared { name, spent, times, .. } in compared {
        let Some([one, runs]) = spent else { continue };
        known = true;
        let least = CORES.map(|cores| format!("{:.2}", runs.least(cores) / one.all())).join(", ");
        let [rendering, warming, machines] = [runs.rendering, runs.warming, runs.machines].map(|time| time.as_secs_f64());
        let all = one.all();
        // The processor time of one machine is the clock time of one core: its renderer runs beside it on another one.
        let measured = times[0][1].as_secs_f64() / all;
        let _ = writeln!(
            out,
            "| {name} | {all:.2} s | {rendering:.2} s | {warming:.2} s | {machines:.2} s | {least} | {measured:.2} |"
        );
    }
    if known { out } else { String::new() }
}
