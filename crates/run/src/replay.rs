//! A replay: a trace in; pictures and statistics out.

use std::num::NonZeroU32;
use std::ops::Range;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Result, bail};

use super::bound::frames::{self, Estimated, estimate};
use super::cycle::{Simulated, simulate};
use super::error::ReplayError;
use super::frame_runs::simulate_in_runs;
use super::frame_sink::{FrameSink, Pictures};
use super::functional;
use super::host::Stopwatch;
use super::rendering::Rendering;
use super::sample::{Sampled, Sampling, sampled};
use machine::{Config, Machine, PhaseReport, Shown, Watcher};
use render::{self, FrameSet, Watch};
use sim::Clock;
use stats::Tree;
use trace::Trace;
use work::Funnel;

pub use super::frame_sink::{Ended, Frame, FrameConsumer, Progress};

/// The detail in which the card is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// The image and the funnel: no time.
    Functional,
    /// The image, the funnel, and cycles from counts and rates ([`bound`](super::bound)).
    Bound,
    /// The same of some frames, which stand for all ([`sample`](super::sample)).
    BoundSampled(Sampling),
    /// Every cycle of some frames, which stand for all ([`sample`](super::sample)).
    Sampled(Sampling),
    /// Every cycle.
    Cycle,
}

impl Fidelity {
    /// Its name, as the command line and the statistics have it.
    pub fn name(self) -> &'static str {
        match self {
            Fidelity::Functional => "functional",
            Fidelity::Bound | Fidelity::BoundSampled(_) => "bound",
            Fidelity::Sampled(_) => "sampled",
            Fidelity::Cycle => "cycle",
        }
    }
}

/// Says that a trace has none of these frames, and how many it has.
///
/// # Errors
/// If the trace cannot be read to its end.
pub fn no_frames(trace: &Trace, frames: &Range<u32>) -> Result<String> {
    let has = trace::check(trace)?.frames;
    let asked = if frames.len() == 1 {
        format!("no frame {}", frames.start)
    } else {
        format!("no frame in {}..{}", frames.start, frames.end)
    };
    Ok(format!("{asked}; it has {has}, numbered from 0"))
}

/// Reads a range of frames: half-open, as in `2..4`, `2..` or `..4`, or one frame, as in `3`.
///
/// # Errors
/// What is wrong with the text.
pub fn frame_range(text: &str) -> Result<Range<u32>, String> {
    let number = |text: &str, default: u32| match text {
        "" => Ok(default),
        text => text.parse().map_err(|_| format!("`{text}` is no frame number")),
    };
    let range = match text.split_once("..") {
        Some((a, b)) => number(a, 0)?..number(b, u32::MAX)?,
        None if text.is_empty() => return Err("write it as A..B, or as the number of one frame".into()),
        None => {
            let one = number(text, 0)?;
            one..one.checked_add(1).ok_or("a trace has fewer frames")?
        }
    };
    if range.is_empty() { Err("it holds no frame".into()) } else { Ok(range) }
}

/// The options of a replay.
#[derive(Clone, Debug)]
pub struct Options {
    /// The card.
    pub config: Config,
    /// Fidelity.
    pub fidelity: Fidelity,
    /// Clock of the cycle fidelity.
    pub clock: Clock,
    /// Frames, half-open.
    pub frames: Range<u32>,
    /// Gets the ledger of every rendering that begins.
    pub watch: Option<Arc<Watch>>,
    /// Whether frames report their draws, under the cycle fidelity. No other result depends on it.
    pub per_draw: bool,
    /// Whether frames leave with their pictures, where no machine compares them. No other result depends on it.
    pub pictures: bool,
    /// Under the cycle fidelity, frames in a run, each of which has a machine of its own ([`simulate_in_runs`]); none: one machine
    /// simulates all frames.
    pub frames_per_run: Option<NonZeroU32>,
}

impl Options {
    /// All frames of a trace on a card, one after another.
    pub fn new(config: Config, fidelity: Fidelity) -> Options {
        Options {
            config,
            fidelity,
            clock: Clock::SkipIdle,
            frames: 0..u32::MAX,
            watch: None,
            per_draw: false,
            pictures: true,
            frames_per_run: None,
        }
    }

    /// Why frames cannot be simulated in runs; none: they can.
    pub fn no_runs(&self) -> Option<&'static str> {
        match &self.config {
            config if config.scanout.ties_frames().is_some() => config.scanout.ties_frames(),
            config if !Machine::warms(config) => Some("functional warming does not leave on this card what drawing leaves"),
            _ => None,
        }
    }

    /// Frames in a run, where there is more than one run.
    fn runs(&self, trace: &Trace) -> Result<Option<u32>> {
        let Some(frames) = self.frames_per_run.map(NonZeroU32::get) else { return Ok(None) };
        if let Some(why) = self.no_runs() {
            bail!("frames cannot be simulated in runs: {why}");
        }
        Ok(self.more_than(frames, trace).then_some(frames))
    }

    /// Whether more than `frames` frames are replayed.
    pub fn more_than(&self, frames: u32, trace: &Trace) -> bool {
        let range = &self.frames;
        range.end - range.start > frames && trace.presents(u64::from(range.start) + u64::from(frames) + 1)
    }

    /// A rendering of the frames.
    pub fn rendering<'r>(&self, trace: &'r Trace) -> Rendering<'r> {
        self.rendering_of(trace, self.frames.clone().into())
    }

    /// A rendering of the frames for consumers that read no pictures of it.
    fn rendering_for_counts<'r>(&self, trace: &'r Trace) -> Rendering<'r> {
        let mut rendering = self.rendering(trace);
        if !self.pictures {
            rendering.no_pictures();
        }
        rendering
    }

    /// A rendering of some of them.
    pub(super) fn rendering_of<'r>(&self, trace: &'r Trace, frames: FrameSet) -> Rendering<'r> {
        Rendering::new(trace, render::Options { frames, watch: self.watch.clone(), ..render::Options::default() })
    }
}

/// The outcome of a replay whose frames have been handed on.
#[derive(Clone, Debug, Default)]
pub struct ReplayOutcome {
    /// Cycles of all frames; none where no time is simulated.
    pub cycles: Option<f64>,
    /// Statistics over all frames.
    pub total: Tree,
    /// How they were estimated; none: they were counted.
    pub sampled: Option<Sampled>,
    /// The refreshes of a free-running display since the last frame ended.
    pub display: Shown,
    /// Frames in a run, where runs had machines of their own.
    pub frames_per_run: Option<u32>,
    /// By estimate, what limits the phases of the first frames, where they were simulated and asked for.
    pub limits: Vec<Vec<PhaseReport>>,
    /// Host time spent in the machine (processor time where the system has it).
    pub machine_time: Duration,
    /// That part of it in which a machine was only warmed, for the runs of frames to begin with.
    pub warming_time: Duration,
    /// Host time on the clock, from the first command to the last statistic.
    pub clock_time: Duration,
}

/// The outcome of a replay, with its frames.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Frames in order.
    pub frames: Vec<Frame>,
    /// Statistics over all of them.
    pub total: Tree,
    /// Host time spent in the machine (processor time where the system has it).
    pub machine_time: Duration,
    /// Host time on the clock, from the first command to the last statistic.
    pub clock_time: Duration,
}

/// Replays a trace and keeps all frames. `progress` is called for each frame when it ends.
///
/// # Errors
/// If the trace cannot be rendered, or the machine stops.
pub fn replay(trace: &Trace, options: &Options, progress: &Progress<'_>) -> Result<Replay, ReplayError> {
    let mut frames = Vec::new();
    let keep = |frame| {
        frames.push(frame);
        Ok(())
    };
    let done = leave(trace, options, FrameSink { keeps: true, progress, per_draw: options.per_draw, ..FrameSink::new(keep) })?;
    Ok(Replay { frames, total: done.total, machine_time: done.machine_time, clock_time: done.clock_time })
}

/// Replays a trace and gives every frame away when it ends: memory does not grow with their number.
///
/// # Errors
/// If the trace cannot be rendered, the machine stops, or the taker fails.
pub fn replay_to(
    trace: &Trace,
    options: &Options,
    progress: &Progress<'_>,
    taker: &mut FrameConsumer<'_>,
) -> Result<ReplayOutcome> {
    leave(trace, options, FrameSink { progress, per_draw: options.per_draw, limits: true, ..FrameSink::new(taker) })
}

/// As [`replay_to`]. `pictures` gets what all frames show, also those that are not simulated: the survey draws them.
///
/// # Errors
/// As [`replay_to`]; if `pictures` fails; if the fidelity samples no frames.
pub fn replay_pictured(
    trace: &Trace,
    options: &Options,
    progress: &Progress<'_>,
    taker: &mut FrameConsumer<'_>,
    pictures: &Pictures<'_>,
) -> Result<ReplayOutcome> {
    if !matches!(options.fidelity, Fidelity::Sampled(_) | Fidelity::BoundSampled(_)) {
        bail!(
            "pictures leave without their frames where frames are sampled, not with the fidelity {}",
            options.fidelity.name()
        );
    }
    let pictures = Some(pictures);
    leave(trace, options, FrameSink { progress, per_draw: options.per_draw, pictures, ..FrameSink::new(taker) })
}

/// As [`replay_to`], while the machine is watched.
///
/// # Errors
/// As [`replay_to`]; if the fidelity is not [`Fidelity::Cycle`], of which alone one machine draws all frames.
pub fn replay_watched(
    trace: &Trace,
    options: &Options,
    progress: &Progress<'_>,
    taker: &mut FrameConsumer<'_>,
    watcher: &mut (dyn Watcher + Send),
) -> Result<ReplayOutcome> {
    if options.fidelity != Fidelity::Cycle {
        bail!("a machine is watched with the fidelity cycle, not {}", options.fidelity.name());
    }
    let watcher: Option<Box<dyn Watcher + Send + '_>> = Some(Box::new(watcher));
    leave(trace, options, FrameSink { progress, per_draw: options.per_draw, limits: true, watcher, ..FrameSink::new(taker) })
}

fn leave(trace: &Trace, options: &Options, sink: FrameSink<'_>) -> Result<ReplayOutcome> {
    let watch = Stopwatch::start();
    let config = &options.config;
    let outcome = match options.fidelity {
        Fidelity::Functional => {
            let mut total = Funnel::default();
            let mut rendering = options.rendering_for_counts(trace);
            rendering.consume(config.render_key(), functional::counting(sink, &mut total));
            rendering.run()?;
            ReplayOutcome { total: functional::tree(&total), ..ReplayOutcome::default() }
        }
        Fidelity::Bound => {
            let mut sum = Estimated::default();
            let mut rendering = options.rendering_for_counts(trace);
            estimate(&mut rendering, config, sink, &mut sum)?;
            rendering.run()?;
            ReplayOutcome {
                cycles: Some(sum.cycles),
                total: sum.tree(config),
                machine_time: sum.time,
                ..ReplayOutcome::default()
            }
        }
        Fidelity::Sampled(sampling) | Fidelity::BoundSampled(sampling) => sampled(trace, options, &sampling, sink)?,
        Fidelity::Cycle => {
            let (mut out, mut limited) = (Simulated::default(), Vec::new());
            let mut rendering = options.rendering(trace);
            let limits = sink.limits;
            let card = (config, options.clock);
            // A watcher reads one machine.
            let frames_per_run = if sink.watcher.is_some() { None } else { options.runs(trace)? };
            match frames_per_run {
                None => simulate(&mut rendering, card, sink, &mut out)?,
                Some(frames) => simulate_in_runs(&mut rendering, card, frames, sink, &mut out)?,
            }
            if limits {
                frames::limits(&mut rendering, config, &mut limited);
            }
            rendering.run()?;
            let Simulated { cycles, total, machine_time, warming_time, display } = out;
            let cycles = Some(cycles as f64);
            ReplayOutcome {
                cycles,
                total,
                machine_time,
                warming_time,
                frames_per_run,
                limits: limited,
                display,
                ..ReplayOutcome::default()
            }
        }
    };
    Ok(ReplayOutcome { clock_time: watch.clock(), ..outcome })
}
