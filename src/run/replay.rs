//! A replay: a trace in; pictures and statistics out.

use std::cell::Cell;
use std::ops::Range;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use crossbeam::channel;

use crate::machine::{Config, Machine};
use crate::num::Cycle;
use crate::render::{self, FrameSet, Held, Skips, Watch};
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

impl Fidelity {
    /// Its name, as the command line and the statistics have it.
    pub fn name(self) -> &'static str {
        match self {
            Fidelity::Functional => "functional",
            Fidelity::Bound => "bound",
            Fidelity::Sampled(_) => "sampled",
            Fidelity::Cycle => "cycle",
        }
    }
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
    /// Is told of every rendering that begins.
    pub watch: Option<Arc<Watch>>,
}

impl Options {
    /// How the trace is rendered for work.
    pub(super) fn rendering(&self) -> render::Options {
        render::Options {
            record: true,
            frames: self.frames.clone().into(),
            skips: Skips::default(),
            key: self.config.render_key(),
            watch: self.watch.clone(),
            ..render::Options::default()
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

/// What a replay came to whose frames have left.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// Statistics over all frames.
    pub total: Tree,
    /// Host time spent in the machine (processor time where the system tells).
    pub machine_time: Duration,
    /// Host time on the clock, from the first command to the last statistic.
    pub clock_time: Duration,
}

/// What a replay came to, with its frames.
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

/// Events in flight between renderer and machine; segments are bounded, and so is what waits.
const EVENTS_IN_FLIGHT: usize = 8;

/// Replays a trace and keeps all frames. `progress` hears the number of each finished frame.
///
/// # Errors
/// If the trace cannot be rendered, or the machine stops.
pub fn replay(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync)) -> Result<Replay> {
    let mut frames = Vec::new();
    let mut keep = |frame| {
        frames.push(frame);
        Ok(())
    };
    let Outcome { total, machine_time, clock_time } = leave(trace, options, progress, &mut Exit::new(&mut keep, true))?;
    Ok(Replay { frames, total, machine_time, clock_time })
}

/// Replays a trace and gives every frame away when it ends: memory does not grow with their number.
///
/// # Errors
/// If the trace cannot be rendered, the machine stops, or the taker fails.
pub fn replay_to(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync), taker: &mut Taker<'_>) -> Result<Outcome> {
    leave(trace, options, progress, &mut Exit::new(taker, false))
}

/// Takes frames in order, each when it ends.
pub type Taker<'t> = dyn FnMut(Frame) -> Result<()> + 't;

/// Where frames leave.
pub(super) struct Exit<'e, 't> {
    taker: &'e mut Taker<'t>,
    /// Whether the taker keeps them, which the account of memory is told.
    keeps: bool,
    /// Why the taker takes no more.
    failed: Option<anyhow::Error>,
}

impl<'e, 't> Exit<'e, 't> {
    pub fn new(taker: &'e mut Taker<'t>, keeps: bool) -> Exit<'e, 't> {
        Exit { taker, keeps, failed: None }
    }

    /// A frame has ended.
    pub fn put(&mut self, frame: Frame) {
        if self.failed.is_none() {
            self.failed = self.pass(frame).err();
        }
    }

    /// The same, where another exit stops.
    ///
    /// # Errors
    /// Why the taker takes no more.
    pub fn pass(&mut self, frame: Frame) -> Result<()> {
        (self.taker)(frame)
    }

    /// Stops a rendering whose frames nobody takes any more.
    fn goes_on(&self) -> Result<(), render::Stop> {
        if self.failed.is_some() { Err(render::Stop) } else { Ok(()) }
    }
}

fn leave(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync), exit: &mut Exit<'_, '_>) -> Result<Outcome> {
    let outcome = match options.fidelity {
        Fidelity::Functional => functional(trace, options, progress, exit),
        Fidelity::Bound => bound(trace, options, progress, exit),
        Fidelity::Sampled(sampling) => sampled(trace, options, &sampling, progress, exit),
        Fidelity::Cycle => cycle(trace, options, progress, exit),
    }?;
    exit.failed.take().map_or(Ok(outcome), Err)
}

/// What a frame shows, where the renderer's picture is the picture.
fn reference(end: &EndFrame) -> Option<(Surface, Vec<u8>)> {
    end.shown.map(|surface| (surface, end.reference.to_vec()))
}

fn functional(trace: &Trace, options: &Options, progress: &dyn Fn(u32), exit: &mut Exit<'_, '_>) -> Result<Outcome> {
    let watch = Stopwatch::start();
    let mut funnel = Funnel::default();
    let mut total = Funnel::default();
    let held = Held { frames: exit.keeps, ..Held::default() };
    let render_options = render::Options { record: false, held, ..options.rendering() };
    render::render(trace, &render_options, &mut |event| {
        match event {
            Event::Segment(segment) => funnel += segment.funnel,
            Event::EndFrame(end) => {
                total += funnel;
                let tree = functional_tree(&std::mem::take(&mut funnel));
                progress(end.number);
                exit.put(Frame { number: end.number, shown: reference(&end), tree, phases: Vec::new() });
                return exit.goes_on();
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(Outcome { total: functional_tree(&total), machine_time: Duration::ZERO, clock_time: watch.clock() })
}

/// Bytes of pictures that wait for estimates: a batch ends with them.
const BATCH_BYTES: usize = 16 << 20;

/// Frames that wait for their estimates, each with its profile and what was counted of it.
#[derive(Default)]
struct Gathered {
    frames: Vec<(FrameProfile, EndFrame, Funnel)>,
    bytes: usize,
}

fn bound(trace: &Trace, options: &Options, progress: &dyn Fn(u32), exit: &mut Exit<'_, '_>) -> Result<Outcome> {
    let watch = Stopwatch::start();
    let mut bound = Bound::new(&options.config)?;
    let mut machine_time = Duration::ZERO;
    let mut profiler = Profiler::default();
    let mut funnel = Funnel::default();
    let mut sum = BoundSum::default();
    let held = Held { frames: exit.keeps, ..Held::default() };
    let render_options = render::Options { held, ..options.rendering() };
    let mut estimate = |gathered: &mut Gathered, exit: &mut Exit<'_, '_>| {
        let start = Instant::now();
        let estimates: Vec<FrameEstimate> = gathered.frames.iter().map(|(profile, ..)| bound.frame(profile)).collect();
        machine_time += start.elapsed();
        for (estimate, (_, end, funnel)) in estimates.into_iter().zip(gathered.frames.drain(..)) {
            let mut own = BoundSum { funnel, ..BoundSum::default() };
            own.add(&estimate);
            sum.funnel += funnel;
            sum.add(&estimate);
            progress(end.number);
            let tree = own.tree(&options.config);
            exit.put(Frame { number: end.number, shown: reference(&end), tree, phases: estimate.phases() });
        }
        gathered.bytes = 0;
    };
    let mut gathered = Gathered::default();
    render::render(trace, &render_options, &mut |event| {
        let profile = profiler.event(&event);
        match event {
            Event::Segment(segment) => funnel += segment.funnel,
            Event::EndFrame(end) => {
                gathered.bytes += end.reference.len();
                gathered.frames.push((profile.unwrap_or_default(), end, std::mem::take(&mut funnel)));
                if gathered.frames.len() == BATCH || gathered.bytes >= BATCH_BYTES {
                    estimate(&mut gathered, exit);
                }
                return exit.goes_on();
            }
            _ => {}
        }
        Ok(())
    })?;
    estimate(&mut gathered, exit);
    let total = sum.tree(&options.config);
    Ok(Outcome { total, machine_time, clock_time: watch.clock() })
}

/// What estimates of phases add up to, over a frame or over all.
#[derive(Default)]
struct BoundSum {
    cycles: f64,
    funnel: Funnel,
    memory: Traffic,
    textures: [f64; 2],
}

impl BoundSum {
    /// Phase by phase, so that the sum over all frames does not depend on where one ends.
    fn add(&mut self, estimate: &FrameEstimate) {
        for phase in &estimate.phases {
            self.cycles += phase.cycles;
            self.memory += phase.memory;
            self.textures = [0, 1].map(|side: usize| self.textures[side] + phase.textures[side]);
        }
    }

    fn tree(&self, config: &Config) -> Tree {
        let mut tree = Tree::new();
        tree.count("cycles", self.cycles.round() as u64);
        tree.real("seconds", self.cycles / (f64::from(config.card.clock_mhz) * 1e6));
        tree.set("funnel", Node::Tree(funnel_tree(&self.funnel)));
        let dram = tree.child("memory").child("dram");
        dram.count("read_bytes", self.memory.read.round() as u64);
        dram.count("write_bytes", self.memory.written.round() as u64);
        let [lookups, misses] = self.textures;
        for (name, lookups, misses) in [("texture", lookups, misses), ("l2", self.memory.lookups, self.memory.misses)] {
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
}

/// A funnel as a subtree of counters.
fn funnel_tree(funnel: &Funnel) -> Tree {
    let mut tree = Tree::new();
    for (name, value) in Funnel::NAMES.iter().zip(funnel.values()) {
        tree.count(name, value);
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
    /// Their statistics together.
    pub total: Tree,
    /// Host time in the machine.
    pub machine_time: Duration,
}

/// Replays some frames of a trace on the machine, renderer and machine side by side; those that only warm up for others are drawn at
/// once ([`apply`](crate::unit::apply)).
///
/// # Errors
/// If the trace cannot be rendered, the machine stops, or the taker of frames fails.
pub(super) fn simulate(
    trace: &Trace,
    options: &Options,
    frames: FrameSet,
    warms_up: &(dyn Fn(u32) -> bool + Sync),
    progress: &(dyn Fn(u32) + Sync),
    exit: &mut Exit<'_, '_>,
) -> Result<Simulated> {
    let mut machine = Machine::new(&options.config)?;
    let mut under_way = frames.next(0);
    let held = Held {
        images: Machine::images(&options.config),
        pieces: Machine::pieces(&options.config) + EVENTS_IN_FLIGHT as u64,
        frames: exit.keeps,
    };
    let render_options = render::Options { frames: frames.clone(), held, ..options.rendering() };
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
        let closed = Cell::new(false);
        let events = receive.into_iter().take_while(|_| !closed.get());
        let run = machine.run_each(events, options.clock, |frame| {
            progress(frame.number);
            let shown = frame.picture.map(|picture| (picture.surface, picture.bytes));
            exit.put(Frame { number: frame.number, shown, tree: frame.tree, phases: frame.phases });
            closed.set(exit.failed.is_some());
        });
        let machine_time = busy.elapsed();
        let rendered = renderer.join().map_err(|_| anyhow!("the renderer stopped on an internal error"))?;
        // What the renderer says comes first: a machine that lost its input has nothing to add.
        rendered?;
        if let Some(failed) = exit.failed.take() {
            return Err(failed);
        }
        Ok(Simulated { total: run?.total, machine_time })
    })
}

fn cycle(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync), exit: &mut Exit<'_, '_>) -> Result<Outcome> {
    let watch = Stopwatch::start();
    let Simulated { total, machine_time } =
        simulate(trace, options, options.frames.clone().into(), &|_| false, progress, exit)?;
    Ok(Outcome { total, machine_time, clock_time: watch.clock() })
}
