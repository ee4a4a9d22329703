//! A replay: a trace in; pictures and statistics out.

use std::io::ErrorKind;
use std::ops::Range;
use std::path::Path;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use crossbeam::channel;

use crate::host;
use crate::machine::{Config, FrameReport, Machine};
use crate::num::Cycle;
use crate::render::{self, FrameSet, Skips};
use crate::report::files::{FrameStatistics, Statistics, funnel_tree};
use crate::report::picture::picture;
use crate::sim::Clock;
use crate::stats::{Node, Tree};
use crate::trace::Trace;
use crate::unit::phase::Phase;
use crate::work::profile::{FrameProfile, Profiler};
use crate::work::{EndFrame, Event, Funnel, Surface};

use super::bound::{BATCH, Bound, FrameEstimate, Traffic};
use super::host::Stopwatch;
use super::sampled::{Sampling, sampled};

/// How much of the card is simulated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fidelity {
    /// The image and the funnel: no time.
    Functional,
    /// The image, the funnel, and cycles from counts and rates ([`bound`](super::bound)).
    Bound,
    /// Every cycle of some frames, which stand for all ([`sampled`](super::sampled)).
    Sampled(Sampling),
    /// Every cycle.
    Cycle,
}

/// What to replay, and how.
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
}

impl Options {
    /// How the trace is rendered for work.
    pub(super) fn rendering(&self) -> render::Options {
        render::Options {
            record: true,
            frames: self.frames.clone().into(),
            skips: Skips::default(),
            key: self.config.render_key(),
        }
    }
}

/// One frame of a replay.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its number in the trace.
    pub number: u32,
    /// What is shown and its bytes; none where nothing was ever drawn.
    pub shown: Option<(Surface, Vec<u8>)>,
    /// Its statistics.
    pub tree: Tree,
    /// What was done one after another, and for how long; empty where no time is simulated.
    pub phases: Vec<(Phase, Cycle)>,
}

/// What a replay came to.
#[derive(Clone, Debug)]
pub struct Replay {
    /// Frames in order.
    pub frames: Vec<Frame>,
    /// Statistics over all of them.
    pub total: Tree,
    /// Host time spent in the machine (processor time where the system tells).
    pub machine_time: Duration,
    /// Host time on the clock, from the first command to the last statistic.
    pub clock_time: Duration,
}

impl Frame {
    /// A frame that was simulated.
    fn new(frame: FrameReport) -> Frame {
        let shown = frame.picture.map(|picture| (picture.surface, picture.bytes));
        Frame { number: frame.number, shown, tree: frame.tree, phases: frame.phases }
    }
}

/// Events in flight between renderer and machine; segments are bounded, and so is what waits.
const EVENTS_IN_FLIGHT: usize = 8;

/// Replays a trace. `progress` hears the number of each finished frame.
///
/// # Errors
/// If the trace cannot be rendered, or the machine stops.
pub fn replay(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync)) -> Result<Replay> {
    match options.fidelity {
        Fidelity::Functional => functional(trace, options, progress),
        Fidelity::Bound => bound(trace, options, progress),
        Fidelity::Sampled(sampling) => sampled(trace, options, &sampling, progress),
        Fidelity::Cycle => cycle(trace, options, progress),
    }
}

fn functional(trace: &Trace, options: &Options, progress: &dyn Fn(u32)) -> Result<Replay> {
    let watch = Stopwatch::start();
    let mut frames = Vec::new();
    let mut funnel = Funnel::default();
    let mut total = Funnel::default();
    let render_options = render::Options {
        record: false,
        frames: options.frames.clone().into(),
        skips: Skips::default(),
        key: options.config.render_key(),
    };
    render::render(trace, &render_options, &mut |event| {
        match event {
            Event::Segment(segment) => funnel += segment.funnel,
            Event::EndFrame(end) => {
                total += funnel;
                let tree = functional_tree(&std::mem::take(&mut funnel));
                progress(end.number);
                frames.push(Frame {
                    number: end.number,
                    shown: end.shown.map(|s| (s, end.reference.to_vec())),
                    tree,
                    phases: Vec::new(),
                });
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(Replay { frames, total: functional_tree(&total), machine_time: Duration::ZERO, clock_time: watch.clock() })
}

fn bound(trace: &Trace, options: &Options, progress: &dyn Fn(u32)) -> Result<Replay> {
    let watch = Stopwatch::start();
    let mut bound = Bound::new(&options.config)?;
    let mut machine_time = Duration::ZERO;
    let (mut frames, mut profiler) = (Vec::new(), Profiler::default());
    let (mut funnel, mut total) = (Funnel::default(), Funnel::default());
    let mut sum = FrameEstimate::default();
    let render_options = options.rendering();
    let mut estimate = |gathered: &mut Vec<(FrameProfile, EndFrame, Funnel)>| {
        let start = Instant::now();
        let estimates: Vec<FrameEstimate> = gathered.iter().map(|(profile, ..)| bound.frame(profile)).collect();
        machine_time += start.elapsed();
        for (estimate, (_, end, funnel)) in estimates.into_iter().zip(gathered.drain(..)) {
            total += funnel;
            let tree = bound_tree(&estimate, &funnel, &options.config);
            progress(end.number);
            let shown = end.shown.map(|s| (s, end.reference.to_vec()));
            frames.push(Frame { number: end.number, shown, tree, phases: estimate.phases() });
            sum.phases.extend(estimate.phases);
        }
    };
    let mut gathered = Vec::with_capacity(BATCH);
    render::render(trace, &render_options, &mut |event| {
        let profile = profiler.event(&event);
        match event {
            Event::Segment(segment) => funnel += segment.funnel,
            Event::EndFrame(end) => {
                gathered.push((profile.unwrap_or_default(), end, std::mem::take(&mut funnel)));
                if gathered.len() == BATCH {
                    estimate(&mut gathered);
                }
            }
            _ => {}
        }
        Ok(())
    })?;
    estimate(&mut gathered);
    let total = bound_tree(&sum, &total, &options.config);
    Ok(Replay { frames, total, machine_time, clock_time: watch.clock() })
}

fn bound_tree(estimate: &FrameEstimate, funnel: &Funnel, config: &Config) -> Tree {
    let mut tree = Tree::new();
    let cycles = estimate.cycles();
    tree.count("cycles", cycles.round() as u64);
    tree.real("seconds", cycles / (f64::from(config.card.clock_mhz) * 1e6));
    tree.set("funnel", Node::Tree(funnel_tree(funnel)));
    let mut memory = Traffic::default();
    estimate.phases.iter().for_each(|phase| memory += phase.memory);
    let dram = tree.child("memory").child("dram");
    dram.count("read_bytes", memory.read.round() as u64);
    dram.count("write_bytes", memory.written.round() as u64);
    let texture = |side: usize| estimate.phases.iter().map(|phase| phase.textures[side]).sum::<f64>();
    for (name, lookups, misses) in [("texture", texture(0), texture(1)), ("l2", memory.lookups, memory.misses)] {
        let [lookups, misses] = [lookups, misses].map(|n| n.round() as u64);
        let mut counts = Tree::new();
        counts.count("accesses", lookups);
        counts.count("hits", lookups.saturating_sub(misses));
        counts.count("misses", misses);
        // All pipelines' caches, and all slices, as one.
        tree.child("caches").set(name, Node::List(vec![counts]));
    }
    tree
}

fn functional_tree(funnel: &Funnel) -> Tree {
    let mut tree = Tree::new();
    tree.set("funnel", Node::Tree(funnel_tree(funnel)));
    tree
}

/// What simulating some frames came to.
pub(super) struct Simulated {
    /// These frames.
    pub frames: Vec<Frame>,
    /// Their statistics together.
    pub total: Tree,
    /// Host time in the machine.
    pub machine_time: Duration,
}

/// Replays some frames of a trace on the machine, renderer and machine side by side; those that only warm up for others are drawn at
/// once ([`apply`](crate::unit::apply)).
///
/// # Errors
/// If the trace cannot be rendered, or the machine stops.
pub(super) fn simulate(
    trace: &Trace,
    options: &Options,
    frames: FrameSet,
    warms_up: &(dyn Fn(u32) -> bool + Sync),
    progress: &(dyn Fn(u32) + Sync),
) -> Result<Simulated> {
    let mut machine = Machine::new(&options.config)?;
    let mut under_way = frames.next(0);
    let render_options = render::Options { frames: frames.clone(), ..options.rendering() };
    let mut role = move |event| match event {
        Event::Segment(segment) if under_way.is_some_and(warms_up) => Event::Applied(segment),
        Event::EndFrame(end) => {
            under_way = frames.next(end.number + 1);
            Event::EndFrame(end)
        }
        other => other,
    };
    let (send, receive) = channel::bounded(EVENTS_IN_FLIGHT);
    std::thread::scope(|scope| {
        // The machine's thread sees the end of the stream when the sender goes with the renderer.
        let renderer =
            move || render::render(trace, &render_options, &mut |event| send.send(role(event)).map_err(|_| render::Stop));
        let named = std::thread::Builder::new().name("renderer".into());
        let renderer = named.spawn_scoped(scope, renderer).context("cannot start the renderer's thread")?;
        let busy = Stopwatch::start();
        let mut frames = Vec::new();
        let run = machine.run_each(receive.into_iter(), options.clock, |frame| {
            progress(frame.number);
            frames.push(Frame::new(frame));
        });
        let machine_time = busy.elapsed();
        let rendered = renderer.join().map_err(|_| anyhow!("the renderer stopped on an internal error"))?;
        // What the renderer says comes first: a machine that lost its input has nothing to add.
        rendered?;
        Ok(Simulated { frames, total: run?.total, machine_time })
    })
}

fn cycle(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync)) -> Result<Replay> {
    let watch = Stopwatch::start();
    let Simulated { frames, total, machine_time } =
        simulate(trace, options, options.frames.clone().into(), &|_| false, progress)?;
    Ok(Replay { frames, total, machine_time, clock_time: watch.clock() })
}

/// The file that a replay writes last.
const STATISTICS: &str = "stats.json";

/// Writes the files of a replay into a folder, which is made where it is missing. Each is complete under its name or not there; the last is
/// `stats.json`.
///
/// # Errors
/// If a picture cannot be made of what a frame shows, or a file cannot be written.
pub fn write(replay: &Replay, trace: &str, options: &Options, out: &Path) -> Result<()> {
    std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
    let put = |name: &str, bytes: &[u8]| {
        let path = out.join(name);
        host::write_file(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
    };
    // The statistics are written last: a folder that has them is complete, and those of an earlier replay must not stand for this one's
    // pictures.
    match std::fs::remove_file(out.join(STATISTICS)) {
        Err(error) if error.kind() != ErrorKind::NotFound => {
            return Err(error).with_context(|| format!("cannot replace {}", out.join(STATISTICS).display()));
        }
        _ => {}
    }
    for frame in &replay.frames {
        let Some((surface, bytes)) = &frame.shown else { continue };
        let image = picture(surface, bytes).map_err(|reason| anyhow!("frame {}: {reason}", frame.number))?;
        let mut png = Vec::new();
        image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)?;
        put(&format!("frame-{:04}.png", frame.number), &png)?;
    }
    let statistics = Statistics {
        trace: trace.to_owned(),
        config: options.config.name.clone(),
        fidelity: match options.fidelity {
            Fidelity::Functional => "functional".into(),
            Fidelity::Bound => "bound".into(),
            Fidelity::Sampled(_) => "sampled".into(),
            Fidelity::Cycle => "cycle".into(),
        },
        total: replay.total.clone(),
        frames: replay
            .frames
            .iter()
            .map(|frame| FrameStatistics { number: frame.number, tree: frame.tree.clone(), phases: frame.phases.clone() })
            .collect(),
    };
    put("stats.csv", statistics.csv().as_bytes())?;
    put("config.ron", options.config.resolved().as_bytes())?;
    put(STATISTICS, serde_json::to_string_pretty(&statistics.json())?.as_bytes())
}
