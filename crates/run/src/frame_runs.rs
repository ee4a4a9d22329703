//! Runs of frames that several machines simulate side by side, behind one rendering.
//!
//! Each run of frames has a machine of its own. What it counts depends on no other run, and on no number of threads. There are two ways
//! for a machine to begin ([`Begin`]): with empty caches, or as a clone of one machine that is warmed functionally with all frames in order. Work of
//! a run waits until its machine takes it, and frames wait until those in front of them have left; what waits is bounded in bytes.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Condvar, Mutex, MutexGuard, PoisonError};
use std::time::Duration;

use anyhow::{Context, Result, anyhow};
use crossbeam::channel;

use super::cycle::Simulated;
use super::frame_sink::{Frame, FrameSink};
use super::host::Stopwatch;
use super::rendering::{Consumer, Rendering, Work};
use machine::{Config, FrameReport, Machine, Totals};
use num::{Limits, OUR_FAULT};
use render::ConsumerMemory;
use sim::Clock;
use work::Event;

/// Whether a frame only warms up the machine for later frames.
pub type WarmsUp<'w> = &'w (dyn Fn(u32) -> bool + Sync);

/// Bytes of work that may wait, for each machine that runs beside the first. A run begins when all work of the run before has been handed on: of
/// machines side by side one has just begun, one is almost done, and half of a run's work waits for each in the mean. With less, machines wait:
/// with 8 MiB two machines on `swarm` (tests/scaling.sh) left a ninth of two processors idle, with 16 a twenty-fifth.
const WORK_WAITING: u64 = 16 << 20;

/// Bytes of frames that may wait for those in front of them.
const FRAMES_WAITING: u64 = 8 << 20;

/// Bytes of a frame without its picture, about.
const FRAME: u64 = 16 << 10;

/// Where the machines of runs begin, and which frames are in a run.
enum Begin<'w> {
    /// With nothing: the runs are these, and some of their frames only warm up.
    Anew(Vec<Range<u32>>, WarmsUp<'w>),
    /// As clones of a machine that has been warmed with all frames before. The number is the frames per run.
    Warmed(u32),
}

/// A lock whose holder's panic is reported elsewhere.
fn locked<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Bytes of waiting work; a thread that has more waits here for room.
struct Room {
    all: u64,
    taken: Mutex<u64>,
    freed: Condvar,
}

impl Room {
    /// Room for the work of `machines` machines that run side by side.
    fn new(machines: usize) -> Room {
        let beside = machines.saturating_sub(1).max(1) as u64;
        Room { all: beside * WORK_WAITING, taken: Mutex::new(0), freed: Condvar::new() }
    }

    /// Waits until there is room. What is larger than all of it gets it alone.
    fn take(&self, bytes: u64) {
        let mut taken = locked(&self.taken);
        while *taken > 0 && *taken + bytes > self.all {
            taken = self.freed.wait(taken).unwrap_or_else(PoisonError::into_inner);
        }
        *taken += bytes;
    }

    fn free(&self, bytes: u64) {
        *locked(&self.taken) -= bytes;
        self.freed.notify_all();
    }
}

/// The work of one run, for its machine. Work that is left when this is dropped gives its room back.
struct Waiting<'a> {
    events: channel::Receiver<(Event, u64)>,
    room: &'a Room,
}

impl Iterator for Waiting<'_> {
    type Item = Event;

    fn next(&mut self) -> Option<Event> {
        let (event, bytes) = self.events.recv().ok()?;
        self.room.free(bytes);
        Some(event)
    }
}

impl Drop for Waiting<'_> {
    fn drop(&mut self) {
        // The sender goes at the end of the run.
        self.events.iter().for_each(|(_, bytes)| self.room.free(bytes));
    }
}

/// The result of a machine: its counts, and host time spent in it.
type Ran = Result<(Totals, Duration)>;

/// Where the frames of all runs leave in order.
struct Outlet<'e> {
    state: Mutex<Leaving<'e>>,
    changed: Condvar,
}

struct Leaving<'e> {
    sink: FrameSink<'e>,
    /// The run whose frames leave as they end. Those before it have ended.
    next: usize,
    /// Frames of later runs, and what these came to where they have ended.
    early: BTreeMap<usize, (Vec<Frame>, Option<Ran>)>,
    /// Bytes of these frames.
    waiting: u64,
    under_way: usize,
    /// Something has failed: no run begins any more.
    failing: bool,
    /// Why, once all runs in front of it have ended. No frame leaves any more.
    failed: Option<anyhow::Error>,
    totals: Option<Totals>,
    /// Host time in all machines, and in that one which is warmed for the others.
    time: Duration,
    warming: Duration,
}

impl Leaving<'_> {
    fn put(&mut self, frame: Frame) {
        if self.failed.is_none()
            && let Err(error) = self.sink.put(frame)
        {
            (self.failing, self.failed) = (true, Some(error));
        }
    }

    /// Runs that have ended leave, and of the one behind them all frames so far.
    fn advance(&mut self) {
        while let Some((frames, ran)) = self.early.get_mut(&self.next) {
            let (frames, ran) = (std::mem::take(frames), ran.take());
            for frame in frames {
                self.waiting -= bytes(&frame);
                self.put(frame);
            }
            let Some(ran) = ran else { return };
            self.early.remove(&self.next);
            self.next += 1;
            match ran {
                Ok((totals, time)) => {
                    self.time += time;
                    match &mut self.totals {
                        Some(sum) => sum.add(&totals),
                        sum => *sum = Some(totals),
                    }
                }
                Err(error) => {
                    self.failed.get_or_insert(error);
                }
            }
        }
    }
}

/// Bytes of a frame that waits, about.
fn bytes(frame: &Frame) -> u64 {
    FRAME + frame.shown.as_ref().map_or(0, |(_, bytes)| bytes.len() as u64)
}

impl<'e> Outlet<'e> {
    fn new(sink: FrameSink<'e>) -> Outlet<'e> {
        let state = Leaving {
            sink,
            next: 0,
            early: BTreeMap::new(),
            waiting: 0,
            under_way: 0,
            failing: false,
            failed: None,
            totals: None,
            time: Duration::ZERO,
            warming: Duration::ZERO,
        };
        Outlet { state: Mutex::new(state), changed: Condvar::new() }
    }

    fn wait<'s>(&self, state: MutexGuard<'s, Leaving<'e>>) -> MutexGuard<'s, Leaving<'e>> {
        self.changed.wait(state).unwrap_or_else(PoisonError::into_inner)
    }

    /// Waits until fewer than `most` runs are under way, and begins another. Returns `false` if a run has failed.
    fn begin(&self, most: usize) -> bool {
        let mut state = locked(&self.state);
        while state.under_way >= most && !state.failing {
            state = self.wait(state);
        }
        state.under_way += 1;
        !state.failing
    }

    /// A frame of a run has ended. It leaves at once if all in front of it have; else it waits, and its machine does where too many wait.
    fn put(&self, run: usize, frame: Frame) {
        let mut state = locked(&self.state);
        let bytes = bytes(&frame);
        while state.next != run && state.waiting > 0 && state.waiting + bytes > FRAMES_WAITING {
            state = self.wait(state);
        }
        if state.next == run {
            // The frames that waited are in front of it.
            state.advance();
            state.put(frame);
        } else {
            state.waiting += bytes;
            state.early.entry(run).or_default().0.push(frame);
        }
    }

    /// A run has ended.
    fn end(&self, run: usize, ran: Ran) {
        let mut state = locked(&self.state);
        state.under_way -= 1;
        state.failing |= ran.is_err();
        state.early.entry(run).or_default().1 = Some(ran);
        state.advance();
        self.changed.notify_all();
    }
}

/// The machines of runs, each on a thread of its own.
struct Machines<'s, 'e> {
    outlet: &'s Outlet<'e>,
    room: &'s Room,
    clock: Clock,
    per_draw: bool,
    /// How many run at a time.
    most: usize,
    limits: &'s Limits,
}

impl<'s> Machines<'s, '_> {
    /// Begins a run of frames on a machine when one may run; gives where its work goes, or nothing where something has failed.
    fn begin<'t>(
        &self,
        scope: &'t std::thread::Scope<'t, '_>,
        run: usize,
        machine: impl FnOnce() -> Result<Machine>,
    ) -> Result<Option<Feed<'s>>>
    where
        's: 't,
    {
        let Machines { outlet, room, clock, per_draw, most, .. } = *self;
        if !outlet.begin(most) {
            return Ok(None);
        }
        let mut machine = machine()?;
        if per_draw {
            machine.watch_draws();
        }
        let (send, events) = channel::unbounded();
        let work = Waiting { events, room };
        let simulate = move || -> Ran {
            let busy = Stopwatch::start();
            let report = machine.run_each(work, clock, |frame: FrameReport| outlet.put(run, frame.into()))?;
            Ok((report.totals, busy.elapsed()))
        };
        let thread = move || {
            let ran = std::panic::catch_unwind(std::panic::AssertUnwindSafe(simulate));
            outlet.end(run, ran.unwrap_or_else(|_| Err(anyhow!("a machine stopped on an internal error. {OUR_FAULT}"))));
        };
        let thread = std::thread::Builder::new().name("machine".into()).spawn_scoped(scope, thread);
        thread.context("cannot start a machine's thread")?;
        Ok(Some(Feed { send, room, failed: false }))
    }
}

/// Where the work of a run goes.
struct Feed<'a> {
    send: channel::Sender<(Event, u64)>,
    room: &'a Room,
    failed: bool,
}

impl Feed<'_> {
    fn put(&mut self, event: Event) {
        // A machine that has failed says why at its end.
        if !self.failed {
            let bytes = event.bytes();
            self.room.take(bytes);
            self.failed = self.send.send((event, bytes)).is_err();
            if self.failed {
                self.room.free(bytes);
            }
        }
    }
}

/// Adds a machine for each of some runs of frames to a rendering of these. A machine begins with empty caches. Frames that only warm up are
/// warmed functionally ([`apply`](unit::apply)). Frames leave in order; `time` is host time in all machines.
pub fn simulate_given_runs<'r>(
    rendering: &mut Rendering<'r>,
    card: (&'r Config, Clock),
    runs: Vec<Range<u32>>,
    warms_up: WarmsUp<'r>,
    sink: FrameSink<'r>,
    time: &'r mut Duration,
) {
    rendering.begin_anew(runs.iter().map(|run| run.start..run.start + 1).collect());
    let most = rendering.turns();
    let done = move |_: Option<Totals>, [busy, _]: [Duration; 2]| *time = busy;
    consume(rendering, card, Begin::Anew(runs, warms_up), most, sink, done);
}

/// Adds machines that simulate all frames of a rendering, cut into runs of `frames_per_run` frames. The machine of a run begins as a clone of
/// one machine that is warmed functionally with all frames in order. So surfaces, and which blocks are compressed or cleared, are what they
/// would be behind one machine that simulates all; what caches and DRAM rows hold is that, as far as it does not depend on time.
pub fn simulate_in_runs<'r>(
    rendering: &mut Rendering<'r>,
    card: (&'r Config, Clock),
    frames: u32,
    sink: FrameSink<'r>,
    out: &'r mut Simulated,
) -> Result<()> {
    let machine = Machine::new(card.0)?;
    let most = rendering.turns();
    let done = move |totals: Option<Totals>, [machine_time, warming_time]: [Duration; 2]| {
        let total = totals.as_ref().map(|totals| totals.tree(&machine)).unwrap_or_default();
        let cycles = totals.as_ref().map_or(0, Totals::cycles);
        *out = Simulated { cycles, total, machine_time, warming_time, ..Simulated::default() };
    };
    consume(rendering, card, Begin::Warmed(frames), most, sink, done);
    Ok(())
}

fn consume<'r>(
    rendering: &mut Rendering<'r>,
    (config, clock): (&'r Config, Clock),
    begin: Begin<'r>,
    most: usize,
    sink: FrameSink<'r>,
    done: impl FnOnce(Option<Totals>, [Duration; 2]) + Send + 'r,
) {
    // One more machine holds the state that the clones begin with.
    let machines = most as u64 + u64::from(matches!(begin, Begin::Warmed(_)));
    let memory = ConsumerMemory {
        images: machines * Machine::images(config),
        pieces: machines * Machine::pieces(config),
        frames: sink.keeps,
    };
    let limits = rendering.limits();
    let read = move |work: Work| {
        let per_draw = sink.per_draw;
        let (outlet, room) = (Outlet::new(sink), Room::new(most));
        let machines = Machines { outlet: &outlet, room: &room, clock, per_draw, most, limits };
        let led = std::thread::scope(|scope| match begin {
            Begin::Anew(runs, warms_up) => lead_anew(work, scope, &machines, config, (&runs, warms_up)),
            Begin::Warmed(frames) => lead_warmed(work, scope, &machines, config, frames),
        });
        let Leaving { failed, totals, time, warming, .. } = outlet.state.into_inner().unwrap_or_else(PoisonError::into_inner);
        // A machine's error comes before that of what led it.
        failed.map_or(led, Err)?;
        done(totals, [time + warming, warming]);
        Ok(())
    };
    rendering.consume(config.render_key(), Consumer { memory, recorded: true, stored: false, run: Box::new(read) });
}

/// Hands the work of each run to a machine that begins with nothing.
fn lead_anew<'s, 't>(
    mut work: Work,
    scope: &'t std::thread::Scope<'t, '_>,
    machines: &Machines<'s, '_>,
    config: &Config,
    (runs, warms_up): (&[Range<u32>], WarmsUp<'_>),
) -> Result<()>
where
    's: 't,
{
    for (run, frames) in runs.iter().enumerate() {
        let machine = || Ok(Machine::new(config)?.within(machines.limits));
        let Some(mut feed) = machines.begin(scope, run, machine)? else { return Ok(()) };
        let mut number = frames.start;
        for event in work.by_ref() {
            let event = match event {
                Event::Segment(segment) if warms_up(number) => Event::Applied(segment),
                other => other,
            };
            if let Event::EndFrame(end) = &event {
                number = end.number + 1;
            }
            feed.put(event);
            if number == frames.end {
                break;
            }
        }
        // A frame of a sequence does not wait for the display, and no chosen frame is to.
        feed.put(Event::FramesFollow);
    }
    Ok(())
}

/// Hands the work of each run to a clone of a machine that is warmed with it afterwards.
fn lead_warmed<'s, 't>(
    mut work: Work,
    scope: &'t std::thread::Scope<'t, '_>,
    machines: &Machines<'s, '_>,
    config: &Config,
    frames: u32,
) -> Result<()>
where
    's: 't,
{
    let busy = Stopwatch::start();
    let (mut warmed, mut run) = (Machine::new(config)?.within(machines.limits), 0);
    let mut ahead = work.next();
    while ahead.is_some() {
        let Some(mut feed) = machines.begin(scope, run, || Ok(warmed.clone()))? else { break };
        let (mut left, mut ends) = (frames, false);
        let events = std::iter::from_fn(|| {
            if ends {
                return None;
            }
            let event = if left > 0 {
                ahead.take().or_else(|| work.next())?
            } else {
                ends = true;
                ahead = work.next();
                ahead.as_ref().map(|_| Event::FramesFollow)?
            };
            left -= u32::from(matches!(event, Event::EndFrame(_)));
            feed.put(event.clone());
            Some(event)
        });
        warmed.warm(events, machines.clock)?;
        drop(feed);
        run += 1;
    }
    locked(&machines.outlet.state).warming = busy.elapsed();
    Ok(())
}
