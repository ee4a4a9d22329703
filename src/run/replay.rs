//! A replay: a trace in; pictures and statistics out.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::ErrorKind;
use std::ops::Range;
use std::path::Path;
use std::sync::Arc;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use crossbeam::channel;

use crate::host;
use crate::machine::{Config, Machine, Picture};
use crate::num::Cycle;
use crate::render::{self, FrameSet, Held, Skips, Watch};
use crate::report::files::{FrameStatistics, Statistics, funnel_tree};
use crate::report::picture::picture;
use crate::sim::Clock;
use crate::stats::{Node, Tree};
use crate::trace::Trace;
use crate::unit::phase::Phase;
use crate::work::profile::{FrameProfile, Profiler};
use crate::work::{Event, Funnel, Surface};

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

/// Events in flight between renderer and machine; segments are bounded, and so is what waits.
const EVENTS_IN_FLIGHT: usize = 8;

/// Replays a trace and keeps all pictures. `progress` hears the number of each finished frame.
///
/// # Errors
/// If the trace cannot be rendered, or the machine stops.
pub fn replay(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync)) -> Result<Replay> {
    hang(trace, options, progress, &mut Gallery { taker: None, failed: None })
}

/// Replays a trace and gives every frame's picture away when the frame ends: memory does not grow with their number. No frame of the replay
/// has one.
///
/// # Errors
/// If the trace cannot be rendered, the machine stops, or the taker fails.
pub fn replay_to(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync), taker: &mut Taker<'_>) -> Result<Replay> {
    hang(trace, options, progress, &mut Gallery { taker: Some(taker), failed: None })
}

/// Takes the number of a frame, what it shows, and the bytes of that.
pub type Taker<'t> = dyn FnMut(u32, &Surface, &[u8]) -> Result<()> + 't;

/// Where pictures go.
struct Gallery<'g, 't> {
    /// None: the frames keep them.
    taker: Option<&'g mut Taker<'t>>,
    /// Why the taker takes no more.
    failed: Option<anyhow::Error>,
}

impl Gallery<'_, '_> {
    /// What a frame keeps of its picture.
    fn hang(&mut self, number: u32, surface: Option<Surface>, bytes: Cow<'_, [u8]>) -> Option<(Surface, Vec<u8>)> {
        let surface = surface?;
        let Some(taker) = &mut self.taker else { return Some((surface, bytes.into_owned())) };
        if self.failed.is_none() {
            self.failed = taker(number, &surface, &bytes).err();
        }
        None
    }

    /// Whether frames keep their pictures.
    fn keeps(&self) -> bool {
        self.taker.is_none()
    }

    /// Stops a rendering whose pictures nobody takes any more.
    fn goes_on(&self) -> Result<(), render::Stop> {
        if self.failed.is_some() { Err(render::Stop) } else { Ok(()) }
    }
}

fn hang(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync), gallery: &mut Gallery<'_, '_>) -> Result<Replay> {
    let mut replay = match options.fidelity {
        Fidelity::Functional => functional(trace, options, progress, gallery),
        Fidelity::Bound => bound(trace, options, progress, gallery),
        Fidelity::Sampled(sampling) => sampled(trace, options, &sampling, progress),
        Fidelity::Cycle => cycle(trace, options, progress, gallery),
    }?;
    // Sampled replays have few frames and choose them at the end.
    for frame in &mut replay.frames {
        if let Some((surface, bytes)) = frame.shown.take() {
            frame.shown = gallery.hang(frame.number, Some(surface), bytes.into());
        }
    }
    gallery.failed.take().map_or(Ok(replay), Err)
}

fn functional(trace: &Trace, options: &Options, progress: &dyn Fn(u32), gallery: &mut Gallery<'_, '_>) -> Result<Replay> {
    let watch = Stopwatch::start();
    let mut frames = Vec::new();
    let mut funnel = Funnel::default();
    let mut total = Funnel::default();
    let render_options =
        render::Options { record: false, held: Held { pictures: gallery.keeps(), ..Held::default() }, ..options.rendering() };
    render::render(trace, &render_options, &mut |event| {
        match event {
            Event::Segment(segment) => funnel += segment.funnel,
            Event::EndFrame(end) => {
                total += funnel;
                let tree = functional_tree(&std::mem::take(&mut funnel));
                progress(end.number);
                let shown = gallery.hang(end.number, end.shown, (&*end.reference).into());
                frames.push(Frame { number: end.number, shown, tree, phases: Vec::new() });
                return gallery.goes_on();
            }
            _ => {}
        }
        Ok(())
    })?;
    Ok(Replay { frames, total: functional_tree(&total), machine_time: Duration::ZERO, clock_time: watch.clock() })
}

/// A frame that waits for its estimate: its profile, what it shows, its number, and what was counted of it.
type Gathered = (FrameProfile, Option<(Surface, Vec<u8>)>, u32, Funnel);

fn bound(trace: &Trace, options: &Options, progress: &dyn Fn(u32), gallery: &mut Gallery<'_, '_>) -> Result<Replay> {
    let watch = Stopwatch::start();
    let mut bound = Bound::new(&options.config)?;
    let mut machine_time = Duration::ZERO;
    let (mut frames, mut profiler) = (Vec::new(), Profiler::default());
    let (mut funnel, mut total) = (Funnel::default(), Funnel::default());
    let mut sum = FrameEstimate::default();
    let held = Held { pictures: gallery.keeps(), ..Held::default() };
    let render_options = render::Options { held, ..options.rendering() };
    let mut estimate = |gathered: &mut Vec<Gathered>| {
        let start = Instant::now();
        let estimates: Vec<FrameEstimate> = gathered.iter().map(|(profile, ..)| bound.frame(profile)).collect();
        machine_time += start.elapsed();
        for (estimate, (_, shown, number, funnel)) in estimates.into_iter().zip(gathered.drain(..)) {
            total += funnel;
            let tree = bound_tree(&estimate, &funnel, &options.config);
            progress(number);
            frames.push(Frame { number, shown, tree, phases: estimate.phases() });
            sum.phases.extend(estimate.phases);
        }
    };
    let mut gathered = Vec::with_capacity(BATCH);
    render::render(trace, &render_options, &mut |event| {
        let profile = profiler.event(&event);
        match event {
            Event::Segment(segment) => funnel += segment.funnel,
            Event::EndFrame(end) => {
                let shown = gallery.hang(end.number, end.shown, (&*end.reference).into());
                gathered.push((profile.unwrap_or_default(), shown, end.number, std::mem::take(&mut funnel)));
                if gathered.len() == BATCH {
                    estimate(&mut gathered);
                }
                return gallery.goes_on();
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
    simulate_to(trace, options, frames, warms_up, progress, &mut Gallery { taker: None, failed: None })
}

fn simulate_to(
    trace: &Trace,
    options: &Options,
    frames: FrameSet,
    warms_up: &(dyn Fn(u32) -> bool + Sync),
    progress: &(dyn Fn(u32) + Sync),
    gallery: &mut Gallery<'_, '_>,
) -> Result<Simulated> {
    let mut machine = Machine::new(&options.config)?;
    let mut under_way = frames.next(0);
    let held = Held {
        images: Machine::images(&options.config),
        pieces: Machine::pieces(&options.config) + EVENTS_IN_FLIGHT as u64,
        pictures: gallery.keeps(),
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
        let mut frames = Vec::new();
        let closed = Cell::new(false);
        let events = receive.into_iter().take_while(|_| !closed.get());
        let run = machine.run_each(events, options.clock, |frame| {
            progress(frame.number);
            let hang = |picture: Picture| gallery.hang(frame.number, Some(picture.surface), picture.bytes.into());
            let shown = frame.picture.and_then(hang);
            closed.set(gallery.failed.is_some());
            frames.push(Frame { number: frame.number, shown, tree: frame.tree, phases: frame.phases });
        });
        let machine_time = busy.elapsed();
        let rendered = renderer.join().map_err(|_| anyhow!("the renderer stopped on an internal error"))?;
        // What the renderer says comes first: a machine that lost its input has nothing to add.
        rendered?;
        if let Some(failed) = gallery.failed.take() {
            return Err(failed);
        }
        Ok(Simulated { frames, total: run?.total, machine_time })
    })
}

fn cycle(trace: &Trace, options: &Options, progress: &(dyn Fn(u32) + Sync), gallery: &mut Gallery<'_, '_>) -> Result<Replay> {
    let watch = Stopwatch::start();
    let Simulated { frames, total, machine_time } =
        simulate_to(trace, options, options.frames.clone().into(), &|_| false, progress, gallery)?;
    Ok(Replay { frames, total, machine_time, clock_time: watch.clock() })
}

/// The file that a replay writes last.
const STATISTICS: &str = "stats.json";

/// Writes pictures into a folder as frames end.
pub struct Album<'o> {
    out: &'o Path,
    /// What was shown last, and its file: the same again takes no time.
    last: Option<(Surface, Vec<u8>, Vec<u8>)>,
}

impl Album<'_> {
    /// An album in a folder, which is made where it is missing. The statistics of an earlier replay go: a folder that has them is complete,
    /// and they must not stand for the pictures of this one.
    ///
    /// # Errors
    /// If it cannot be made, or an earlier replay's statistics cannot be removed.
    pub fn new(out: &Path) -> Result<Album<'_>> {
        std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
        match std::fs::remove_file(out.join(STATISTICS)) {
            Err(error) if error.kind() != ErrorKind::NotFound => {
                Err(error).with_context(|| format!("cannot replace {}", out.join(STATISTICS).display()))
            }
            _ => Ok(Album { out, last: None }),
        }
    }

    /// Writes the picture of a frame.
    ///
    /// # Errors
    /// If a picture cannot be made of what it shows, or the file cannot be written.
    pub fn put(&mut self, number: u32, surface: &Surface, bytes: &[u8]) -> Result<()> {
        let again = |(shown, known, _): &(Surface, Vec<u8>, Vec<u8>)| shown == surface && known == bytes;
        if !self.last.as_ref().is_some_and(again) {
            let image = picture(surface, bytes).map_err(|reason| anyhow!("frame {number}: {reason}"))?;
            let mut png = Vec::new();
            image.write_to(&mut std::io::Cursor::new(&mut png), image::ImageFormat::Png)?;
            self.last = Some((*surface, bytes.to_vec(), png));
        }
        let Some((.., png)) = &self.last else { return Ok(()) };
        put(self.out, &format!("frame-{number:04}.png"), png)
    }
}

/// Writes a file into a folder: complete under its name, or not there.
fn put(out: &Path, name: &str, bytes: &[u8]) -> Result<()> {
    let path = out.join(name);
    host::write_file(&path, bytes).with_context(|| format!("cannot write {}", path.display()))
}

/// Writes the files of a replay into a folder, which is made where it is missing. The last is `stats.json`.
///
/// # Errors
/// If a picture cannot be made of what a frame shows, or a file cannot be written.
pub fn write(replay: &Replay, trace: &str, options: &Options, out: &Path) -> Result<()> {
    let mut album = Album::new(out)?;
    for frame in &replay.frames {
        if let Some((surface, bytes)) = &frame.shown {
            album.put(frame.number, surface, bytes)?;
        }
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
    put(out, "stats.csv", statistics.csv().as_bytes())?;
    put(out, "config.ron", options.config.resolved().as_bytes())?;
    put(out, STATISTICS, serde_json::to_string_pretty(&statistics.json())?.as_bytes())
}
