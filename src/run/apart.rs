//! Runs of frames that several machines simulate side by side, behind one rendering.
//!
//! Each run of frames has a machine of its own, which begins with empty caches and is warmed by the run's first frames. So what it counts
//! depends on no other run, and on no number of threads. Work of a run waits until its machine takes it; what waits is bounded in bytes.

use std::collections::BTreeMap;
use std::ops::Range;
use std::sync::{Condvar, Mutex, PoisonError};
use std::time::Duration;

use anyhow::{Result, anyhow};
use crossbeam::channel;

use super::exit::{Exit, Frame};
use super::host::Stopwatch;
use super::rendering::{Consumer, Rendering, Work};
use crate::machine::{Config, Machine};
use crate::render::Held;
use crate::sim::Clock;
use crate::work::Event;

/// Which frames only warm up for others.
pub type WarmsUp<'w> = &'w (dyn Fn(u32) -> bool + Sync);

/// Bytes of work that may wait for all machines.
const WAITING: u64 = 128 << 20;

/// Bytes that wait, and who waits for room.
#[derive(Default)]
struct Room {
    taken: Mutex<u64>,
    freed: Condvar,
}

impl Room {
    /// Waits until there is room. What is larger than all of it gets it alone.
    fn take(&self, bytes: u64) {
        let mut taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        while *taken > 0 && *taken + bytes > WAITING {
            taken = self.freed.wait(taken).unwrap_or_else(PoisonError::into_inner);
        }
        *taken += bytes;
    }

    fn free(&self, bytes: u64) {
        *self.taken.lock().unwrap_or_else(PoisonError::into_inner) -= bytes;
        self.freed.notify_all();
    }
}

/// The work of one run, for its machine. What is left when it goes gives its room back.
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

/// What a machine came to: its frames, and host time in it.
type Ran = Result<(Vec<Frame>, Duration)>;

fn run(config: &Config, clock: Clock, per_draw: bool, work: Waiting<'_>) -> Ran {
    let busy = Stopwatch::start();
    let mut machine = Machine::new(config)?;
    if per_draw {
        machine.watch_draws();
    }
    let mut frames = Vec::new();
    machine.run_each(work, clock, |frame| frames.push(frame.into()))?;
    Ok((frames, busy.elapsed()))
}

/// Adds a machine for each run of frames to a rendering of these. Frames that only warm up are warmed functionally
/// ([`apply`](crate::unit::apply)). Frames leave in order; `time` is host time in all machines.
pub fn simulate_apart<'r>(
    rendering: &mut Rendering<'r>,
    (config, clock): (&'r Config, Clock),
    runs: Vec<Range<u32>>,
    warms_up: WarmsUp<'r>,
    exit: Exit<'r>,
    time: &'r mut Duration,
) {
    rendering.begin_anew(runs.iter().map(|run| run.start..run.start + 1).collect());
    let machines = rendering.turns() as u64;
    let held =
        Held { images: machines * Machine::images(config), pieces: machines * Machine::pieces(config), frames: exit.keeps };
    let read = move |work: Work| lead(work, (config, clock), &runs, warms_up, exit, (time, machines as usize));
    rendering.consume(config.render_key(), Consumer { held, recorded: true, run: Box::new(read) });
}

/// Hands the work of each run to a machine of its own, of which so many run at a time.
fn lead(
    mut work: Work,
    (config, clock): (&Config, Clock),
    runs: &[Range<u32>],
    warms_up: WarmsUp<'_>,
    mut exit: Exit<'_>,
    (time, machines): (&mut Duration, usize),
) -> Result<()> {
    let room = Room::default();
    let (room, per_draw) = (&room, exit.per_draw);
    std::thread::scope(|scope| {
        let (end, ended) = channel::unbounded();
        // Runs that have ended before one that is in front of them.
        let (mut early, mut next, mut under_way) = (BTreeMap::new(), 0, 0);
        let mut take = |(at, ran): (usize, Ran)| -> Result<()> {
            early.insert(at, ran);
            while let Some(ran) = early.remove(&next) {
                let (frames, busy) = ran?;
                *time += busy;
                frames.into_iter().try_for_each(|frame| exit.put(frame))?;
                next += 1;
            }
            Ok(())
        };
        for (at, frames) in runs.iter().enumerate() {
            if under_way == machines {
                under_way -= 1;
                take(ended.recv()?)?;
            }
            let (send, events) = channel::unbounded();
            let (end, waiting) = (end.clone(), Waiting { events, room });
            let machine = move || {
                let ran = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| run(config, clock, per_draw, waiting)));
                let ran = ran.unwrap_or_else(|_| Err(anyhow!("a machine stopped on an internal error")));
                // Nobody listens where another run has failed.
                let _ = end.send((at, ran));
            };
            std::thread::Builder::new().name("machine".into()).spawn_scoped(scope, machine)?;
            under_way += 1;
            let (mut number, mut failed) = (frames.start, false);
            for event in work.by_ref() {
                let bytes = event.bytes();
                let event = match event {
                    Event::Segment(segment) if warms_up(number) => Event::Applied(segment),
                    other => other,
                };
                if let Event::EndFrame(end) = &event {
                    number = end.number + 1;
                }
                if !failed {
                    room.take(bytes);
                    // A machine that has failed says why at its end.
                    failed = send.send((event, bytes)).is_err();
                    if failed {
                        room.free(bytes);
                    }
                }
                if number == frames.end {
                    break;
                }
            }
        }
        while under_way > 0 {
            under_way -= 1;
            take(ended.recv()?)?;
        }
        Ok(())
    })
}
