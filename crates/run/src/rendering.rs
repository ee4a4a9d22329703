//! One rendering, many questions: a trace is rendered once per render key, and its work is handed to any number of consumers.
//!
//! A consumer reads events on a thread of its own, as an iterator. The renderer hands every event to all consumers and waits for the slowest:
//! what is in flight is a window of [`EVENTS_IN_FLIGHT`] events, however long the trace and however many the consumers. A consumer that finds no
//! event is suspended inside of `next`, and goes on where it was: nothing that it computes can depend on how far the rendering is. The number
//! of consumers that run at a time is at most the number of turns.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering::Relaxed};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow};
use crossbeam::channel::{self, Receiver, Sender, TryRecvError};
use rayon::ThreadPool;

use super::profiles::{self, Reader};
use machine::MachineError;
use num::{Limits, OUR_FAULT};
use render::{self, ConsumerMemory, Needs, Stop};
use trace::Trace;
use work::{Event, RenderKey};

/// Events in flight between the renderer and a consumer; segments are bounded, and so is what waits.
pub const EVENTS_IN_FLIGHT: usize = 8;

/// Reads the work of a rendering.
pub struct Consumer<'c> {
    /// The memory that it keeps of the events, without the events in flight.
    pub memory: ConsumerMemory,
    /// Whether it needs more of a draw than its counts.
    pub recorded: bool,
    /// Whether it needs the memory that blocks of attachments take when a pass ends.
    pub stored: bool,
    /// Reads all events, or as many as it needs. An error ends the rendering for all consumers.
    pub run: Box<dyn FnOnce(Work) -> Result<()> + Send + 'c>,
}

/// The events of a rendering in order.
pub struct Work {
    events: Receiver<Event>,
    turn: ComputePermit,
    /// Whether the last event has been read.
    ended: Arc<AtomicBool>,
}

impl Iterator for Work {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        match self.events.try_recv() {
            Ok(event) => Some(event),
            Err(TryRecvError::Disconnected) => {
                self.ended.store(true, Relaxed);
                None
            }
            Err(TryRecvError::Empty) => {
                self.turn.end();
                let event = self.events.recv().ok();
                self.turn.begin();
                if event.is_none() {
                    self.ended.store(true, Relaxed);
                }
                event
            }
        }
    }
}

/// A consumer's turn to compute, which it has while it has events.
struct ComputePermit {
    free: Receiver<()>,
    back: Sender<()>,
    mine: bool,
}

impl ComputePermit {
    fn begin(&mut self) {
        // The channel lives as long as this has both its ends.
        self.mine = self.free.recv().is_ok();
    }

    fn end(&mut self) {
        if std::mem::take(&mut self.mine) {
            let _ = self.back.send(());
        }
    }
}

impl Drop for ComputePermit {
    fn drop(&mut self) {
        self.end();
    }
}

/// The times of renderings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Rendered {
    /// Host time on the clock, without the time in which the renderer waited for consumers.
    pub time: Duration,
    /// Host time of making profiles (processor time where the system has it).
    pub profiling: Duration,
}

/// A rendering of a trace, with those that read it.
pub struct Rendering<'r> {
    trace: &'r Trace,
    options: render::Options,
    turns: usize,
    /// Threads that it is rendered on; none: all.
    pool: Option<&'r ThreadPool>,
    /// The readers of the work of each render key.
    readers: Vec<(RenderKey, Readers<'r>)>,
}

#[derive(Default)]
struct Readers<'r> {
    consumers: Vec<Consumer<'r>>,
    /// Readers of profiles of frames share one consumer.
    profiles: Vec<Reader<'r>>,
}

impl<'r> Rendering<'r> {
    /// A rendering without readers. Of the options it takes the frames, the skips, the watch and the reader of targets.
    pub fn new(trace: &'r Trace, options: render::Options) -> Rendering<'r> {
        Rendering { trace, options, turns: rayon::current_num_threads(), pool: None, readers: Vec::new() }
    }

    /// Leaves out what is not needed, and records some frames only; none: all.
    pub fn needs(&mut self, needs: Needs, recorded: Option<render::FrameSet>) {
        self.options.needs = Some(Arc::new(needs));
        self.options.recorded = recorded;
    }

    /// Has the areas of triangles counted in addition to the work of frames.
    pub fn areas(&mut self) {
        self.options.areas = true;
    }

    /// Leaves out the pictures of what is shown.
    pub fn no_pictures(&mut self) {
        self.options.pictures = false;
    }

    /// Renders on the threads of a pool, beside renderings that have others.
    pub fn on(&mut self, pool: &'r ThreadPool) {
        self.pool = Some(pool);
    }

    /// Lets machines begin anew in some frames: they get the contents that they load there, whatever an earlier machine has.
    pub fn begin_anew(&mut self, frames: render::FrameSet) {
        self.options.begins = Some(frames);
    }

    /// The limits of the trace.
    pub fn limits(&self) -> &'r Limits {
        self.trace.limits()
    }

    /// How many consumers may compute at a time.
    pub fn turns(&self) -> usize {
        self.turns.max(1)
    }

    /// Lets consumers compute one at a time, so that none disturbs the other's host time.
    pub fn one_at_a_time(&mut self) {
        self.turns = 1;
    }

    /// Adds a consumer of the work that a key asks for.
    pub fn consume(&mut self, key: RenderKey, consumer: Consumer<'r>) {
        self.of(key).consumers.push(consumer);
    }

    /// Adds a reader of the frames' profiles.
    pub fn profile(&mut self, key: RenderKey, reader: Reader<'r>) {
        self.of(key).profiles.push(reader);
    }

    fn of(&mut self, key: RenderKey) -> &mut Readers<'r> {
        let at = self.readers.iter().position(|(known, _)| *known == key).unwrap_or_else(|| {
            self.readers.push((key, Readers::default()));
            self.readers.len() - 1
        });
        &mut self.readers[at].1
    }

    /// Renders the trace once for each key.
    ///
    /// # Errors
    /// That of the first consumer, in the order in which they were added, that stopped before the end of its events or on a limit; else that of
    /// the trace, if it cannot be rendered; else that of the first consumer that has one.
    pub fn run(self) -> Result<Rendered> {
        let mut rendered = Rendered::default();
        for (key, Readers { mut consumers, profiles }) in self.readers {
            let mut profiling = Duration::ZERO;
            if !profiles.is_empty() {
                consumers.push(profiles::consumer(key.shade, profiles, &mut profiling));
            }
            let pieces = consumers.iter().map(|consumer| consumer.memory.pieces).max().unwrap_or(0);
            let memory = ConsumerMemory {
                images: consumers.iter().map(|consumer| consumer.memory.images).sum(),
                // All read the same pieces, and none is further behind than the window.
                pieces: pieces + EVENTS_IN_FLIGHT as u64,
                frames: consumers.iter().any(|consumer| consumer.memory.frames),
            };
            let record = consumers.iter().any(|consumer| consumer.recorded);
            let stored = consumers.iter().any(|consumer| consumer.stored);
            let options = render::Options { key, record, stored, consumer_memory: memory, ..self.options.clone() };
            rendered.time += render(self.trace, &options, consumers, self.turns, self.pool)?;
            rendered.profiling += profiling;
        }
        Ok(rendered)
    }
}

/// Renders once; the time that it took, without that of waiting.
fn render(
    trace: &Trace,
    options: &render::Options,
    consumers: Vec<Consumer<'_>>,
    turns: usize,
    pool: Option<&ThreadPool>,
) -> Result<Duration> {
    let (back, free) = channel::unbounded();
    for _ in 0..turns.max(1) {
        let _ = back.send(());
    }
    let (mut sends, mut runs) = (Vec::new(), Vec::new());
    let failed = &AtomicBool::new(false);
    for Consumer { run, .. } in consumers {
        let (send, events) = channel::bounded(EVENTS_IN_FLIGHT);
        let ended = Arc::new(AtomicBool::new(false));
        let turn = ComputePermit { free: free.clone(), back: back.clone(), mine: false };
        // The renderer waits for a consumer that has dropped its events until it is known whether that failed.
        let known = events.clone();
        let mut work = Work { events, turn, ended: ended.clone() };
        sends.push(send);
        runs.push(move || {
            work.turn.begin();
            let done = run(work).map_err(|error| {
                failed.store(true, Relaxed);
                let own = !ended.load(Relaxed) || limit(&error);
                Failed { error, own }
            });
            drop(known);
            done
        });
    }
    std::thread::scope(|scope| {
        let start = |name: &str| std::thread::Builder::new().name(name.into());
        // Consumers see the end of the stream when the senders go with the renderer.
        let renderer = move || {
            let (begin, mut waited) = (Instant::now(), Duration::ZERO);
            let mut hand_on = |event: Event| {
                let full = Instant::now();
                sends.retain(|send| send.send(event.clone()).is_ok());
                waited += full.elapsed();
                if sends.is_empty() || failed.load(Relaxed) { Err(Stop) } else { Ok(()) }
            };
            let rendered = match pool {
                Some(pool) => pool.install(|| render::render(trace, options, &mut hand_on)),
                // A thread of the pool shares its work with those that are free, and goes on with it itself; one that is not of the pool
                // sleeps until others have done all. Who reads counts asks nothing of the pool, which may have one thread only.
                None if !options.record => rayon::scope(|_| render::render(trace, options, &mut hand_on)),
                None => render::render(trace, options, &mut hand_on),
            };
            rendered.map(|_| begin.elapsed().saturating_sub(waited))
        };
        let renderer = start("renderer").spawn_scoped(scope, renderer).context("cannot start the renderer's thread")?;
        // The first consumer has this thread.
        let mut runs = runs.into_iter();
        let first = runs.next();
        let started: Vec<_> = runs.map(|run| start("consumer").spawn_scoped(scope, run)).collect();
        let mut failures: Vec<Failed> = first.and_then(|run| run().err()).into_iter().collect();
        for thread in started {
            let thread = thread.context("cannot start a consumer's thread")?;
            let joined =
                thread.join().map_err(|_| anyhow!("a consumer of the work stopped on an internal error. {OUR_FAULT}"))?;
            failures.extend(joined.err());
        }
        let rendered = renderer.join().map_err(|_| anyhow!("the renderer stopped on an internal error. {OUR_FAULT}"))?;
        // A machine that lost its input has nothing to add to the renderer's error. What stopped by itself did so at an event that the
        // renderer reached whatever comes behind it, and how far the renderer went after it depends on the host.
        let own = failures.iter().position(|failure| failure.own);
        match (own, rendered) {
            (None, Err(error)) => Err(error.into()),
            (None, Ok(time)) if failures.is_empty() => Ok(time),
            (own, _) => {
                let error = failures.swap_remove(own.unwrap_or(0)).error;
                Err(if limit(&error) { error.context(trace.file().display().to_string()) } else { error })
            }
        }
    })
}

/// A consumer's error.
struct Failed {
    error: anyhow::Error,
    /// Whether it has another cause than the end of its events.
    own: bool,
}

/// Whether a machine stopped on a limit.
fn limit(error: &anyhow::Error) -> bool {
    matches!(error.downcast_ref(), Some(MachineError::Limit(_)))
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};

    use anyhow::bail;

    use super::*;
    use gfx::format::Format;
    use trace::record::{Recorder, texture_2d};

    const FRAMES: usize = 100;

    fn frames() -> Trace {
        let mut card = Recorder::new("frames");
        let texture = card.create_texture("shown", texture_2d(4, 4, Format::Rgba8Unorm));
        (0..FRAMES).for_each(|_| card.present(texture));
        card.finish()
    }

    fn counts<'c>(run: impl FnOnce(Work) -> Result<()> + Send + 'c) -> Consumer<'c> {
        Consumer { memory: ConsumerMemory::default(), recorded: false, stored: false, run: Box::new(run) }
    }

    #[test]
    fn all_read_the_same_work_and_nobody_runs_ahead() {
        let trace = frames();
        let other = RenderKey { early_z: false, ..RenderKey::default() };
        for turns in [1, 4] {
            let [fast, slow, alone] = [0; 3].map(AtomicUsize::new);
            let mut rendering = Rendering::new(&trace, render::Options::default());
            rendering.turns = turns;
            let first = counts(|work| {
                for _ in work {
                    let own = fast.fetch_add(1, SeqCst) + 1;
                    assert!(own <= slow.load(SeqCst) + EVENTS_IN_FLIGHT + 2, "{own} events, the other {}", slow.load(SeqCst));
                }
                Ok(())
            });
            rendering.consume(RenderKey::default(), first);
            let second = counts(|work| {
                for _ in work {
                    std::thread::sleep(Duration::from_micros(200));
                    slow.fetch_add(1, SeqCst);
                }
                Ok(())
            });
            rendering.consume(RenderKey::default(), second);
            let third = counts(|work| {
                alone.store(work.count(), SeqCst);
                Ok(())
            });
            rendering.consume(other, third);
            rendering.run().expect("it renders");
            assert_eq!([fast, slow, alone].map(AtomicUsize::into_inner), [FRAMES; 3]);
        }
    }

    #[test]
    fn a_consumer_that_fails_ends_the_rendering() {
        let trace = frames();
        let read = AtomicUsize::new(0);
        let mut rendering = Rendering::new(&trace, render::Options::default());
        rendering.consume(RenderKey::default(), counts(|work| bail!("failed after {}", work.take(3).count())));
        let other = counts(|work| {
            read.store(work.count(), SeqCst);
            bail!("failed at the end")
        });
        rendering.consume(RenderKey::default(), other);
        assert_eq!(rendering.run().expect_err("it fails").to_string(), "failed after 3");
        let read = read.into_inner();
        assert!((3..=3 + 2 * EVENTS_IN_FLIGHT + 2).contains(&read), "{read} events");
    }

    /// Whatever the renderer found behind it.
    #[test]
    fn a_consumer_that_stops_by_itself_is_reported_before_the_trace() {
        let mut card = Recorder::new("frames");
        let texture = card.create_texture("shown", texture_2d(4, 4, Format::Rgba8Unorm));
        (0..5).for_each(|_| card.present(texture));
        card.begin_compute_pass().dispatch(1, 1, 1);
        let trace = card.finish();
        let wrong = |run: Option<usize>| {
            let mut rendering = Rendering::new(&trace, render::Options::default());
            let reader = counts(move |work| match run {
                Some(events) => bail!("failed after {}", work.take(events).count()),
                None => bail!("lost its input after {}", work.count()),
            });
            rendering.consume(RenderKey::default(), reader);
            rendering.consume(
                RenderKey::default(),
                counts(|work| {
                    work.for_each(drop);
                    Ok(())
                }),
            );
            rendering.run().expect_err("it fails").to_string()
        };
        assert_eq!(wrong(Some(3)), "failed after 3");
        let lost = wrong(None);
        assert!(lost.contains("pipeline"), "{lost}");
    }
}
