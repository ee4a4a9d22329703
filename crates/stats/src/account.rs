//! Where the cycles of a unit go.

use super::{Declaration, Heading};
use num::Cycle;

/// What a cycle of a unit is attributed to.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[repr(u8)]
pub enum Why {
    /// The unit moved something, or worked on an item that it holds.
    Busy,
    /// Its input was empty.
    Starved,
    /// Its output had no room.
    Blocked,
    /// It waited for data from memory.
    Memory,
    /// Nothing was left to do: its input stayed empty until the reading.
    Idle,
}

crate::counters! {
    /// A unit's cycles by what they went to. They add up to the cycles of the run.
    pub struct Cycles {
        /// The unit moved an item or worked on one that it held.
        busy: "cycles",
        /// The unit's input was empty, and later another item came.
        starved: "cycles",
        /// The unit's output had no room.
        blocked: "cycles",
        /// The unit waited for data from memory.
        memory: "cycles",
        /// A core held warps, and the instructions that they had issued were not complete. Other units count such cycles as `busy`.
        latency: "cycles",
        /// Nothing was left to do: the unit's input stayed empty until the end of the frame.
        idle: "cycles",
    }
}

/// The time of a frame, or of a run.
pub const SECONDS: Declaration = Declaration::new("seconds", "s", "The same at the configuration's `clock_mhz`.");

/// The top of the statistics.
pub const FRAME: Heading = Heading::new("", "Time.");

crate::counters! {
    /// What is counted of a frame, or of a run, before anything else.
    pub struct FrameCounts {
        /// Cycles of the card's clock that the frame (or the run) took.
        cycles: "cycles",
    }
}

impl Cycles {
    /// The sum of all six, which is the number of cycles accounted for.
    pub fn total(&self) -> u64 {
        self.busy + self.starved + self.blocked + self.memory + self.latency + self.idle
    }
}

/// The running account of one unit.
///
/// Cycles are attributed in spans: a reason holds from the cycle in which it is noted until another one is noted. A unit that
/// sleeps therefore costs nothing, and a clock that skips its sleep leaves the same account as one that ticks it every cycle.
#[derive(Clone, Debug)]
pub struct Account {
    counts: [u64; 5],
    since: Cycle,
    why: Why,
}

impl Account {
    /// An account that starts at cycle `start`, idle until the first note.
    pub fn new(start: Cycle) -> Account {
        Account { counts: [0; 5], since: start, why: Why::Idle }
    }

    /// From cycle `now` on, cycles go to `why`. Calls come in order of time.
    #[inline(always)]
    pub fn note(&mut self, now: Cycle, why: Why) {
        // A span goes on while the reason stays. By arithmetic: units change it too often for a branch to be foreseen.
        let closed = (now - self.since) & 0_u64.wrapping_sub(u64::from(self.why != why));
        self.counts[self.why as usize] += closed;
        self.since += closed;
        self.why = why;
    }

    /// What cycles are attributed to at present.
    pub fn why(&self) -> Why {
        self.why
    }

    /// Closes the account before cycle `now`: a unit that is starved then was idle since its input ran dry. Everything before
    /// `now` is final after this; the account goes on.
    pub fn settle(&mut self, now: Cycle) {
        let class = if self.why == Why::Starved { Why::Idle } else { self.why };
        self.counts[class as usize] += now - self.since;
        self.since = now;
    }

    /// The cycles before `now` in which the unit was at work or waited for data from memory, and those in which its output had no
    /// room, whether or not it has ticked in `now`.
    pub fn held(&self, now: Cycle) -> [u64; 2] {
        let [busy, _, blocked, memory, _] = self.counts;
        // A unit that has moved in `now` and rests after it is accounted for up to the next cycle.
        let ahead = self.since.saturating_sub(now);
        let open = now.saturating_sub(self.since);
        let held = if matches!(self.why, Why::Busy | Why::Memory) { open } else { 0 };
        let stuck = if self.why == Why::Blocked { open } else { 0 };
        [busy + memory - ahead + held, blocked + stuck]
    }

    /// The cycles before `now` by class. Only after [`Account::settle`] at `now` is a trailing starvation told from idleness.
    pub fn read(&self, now: Cycle) -> Cycles {
        let mut counts = self.counts;
        counts[self.why as usize] += now - self.since;
        let [busy, starved, blocked, memory, idle] = counts;
        Cycles { busy, starved, blocked, memory, latency: 0, idle }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_unit_held_before_a_cycle_does_not_depend_on_its_tick_in_it() {
        let mut account = Account::new(0);
        account.note(0, Why::Starved);
        account.note(4, Why::Memory);
        account.note(10, Why::Starved);
        assert_eq!(account.held(12), [6, 0]);
        // It moves in 12 and rests from 13 on.
        account.note(12, Why::Busy);
        assert_eq!(account.held(12), [6, 0]);
        account.note(13, Why::Blocked);
        assert_eq!((account.held(12), account.held(13), account.held(20)), ([6, 0], [7, 0], [7, 7]));
    }

    #[test]
    fn spans_add_up_and_trailing_starvation_is_idleness() {
        let mut account = Account::new(0);
        account.note(0, Why::Starved);
        account.note(4, Why::Busy);
        account.note(4, Why::Busy);
        account.note(10, Why::Blocked);
        account.note(11, Why::Memory);
        account.note(20, Why::Starved);
        account.settle(25);
        let cycles = account.read(25);
        assert_eq!(cycles, Cycles { busy: 6, starved: 4, blocked: 1, memory: 9, latency: 0, idle: 5 });
        assert_eq!(cycles.total(), 25);
        // The account goes on after the reading: starved cycles of the next frame count as such if an item comes.
        account.note(30, Why::Busy);
        account.settle(31);
        assert_eq!(account.read(31).since(&cycles), Cycles { busy: 1, starved: 5, ..Cycles::default() });
    }
}
