//! Where the cycles of a core go, and how many warps it holds.
//!
//! The core works while it sleeps: only it knows in which of the cycles gone by its lanes took in instructions. What the other cycles wait for
//! changes in ticks alone, so that it is noted at the end of each tick and holds until the next.

use super::{Core, CoreCounts};
use num::Cycle;
use stats::Cycles;
use std::collections::VecDeque;
use work::Service;

/// What a core waits for in cycles in which its lanes take in no instruction: what its oldest warp waits for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) enum Wait {
    /// It holds no warp, or all wait for other warps of their workgroups that have not come.
    #[default]
    Warps,
    /// An instruction, or an access to workgroup memory, is not complete.
    Latency,
    /// The texture unit, which also loads from buffers.
    Texture,
    /// The cache of constants.
    Constants,
    /// The next unit has no room.
    Output,
}

/// Why a warp that has come is not taken in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Full {
    /// All slots hold warps.
    Warps,
    /// The registers that are left are too few.
    Registers,
    /// Its workgroup does not fit beside those that the core holds.
    Workgroups,
}

/// The cycles of a core before its last tick, and what holds since then.
#[derive(Clone, Debug, Default)]
pub(super) struct Hours {
    /// The cycle of the last tick, and the cycles before it in which lanes took in instructions.
    since: Cycle,
    issued: u64,
    /// What holds since then: warps held, what the oldest waits for, and why another is not taken in.
    held: u64,
    wait: Wait,
    full: Option<Full>,
    /// A warp found no room behind the core.
    pub stuck: bool,
    /// Cycles before the last tick.
    counts: Spans,
    /// Slots with the numbers of the warps taken into them, the oldest warp first. Those of warps that have left are removed when they
    /// come to the front.
    order: VecDeque<(u32, u64)>,
}

/// Cycles by what holds in them.
#[derive(Clone, Copy, Debug, Default)]
struct Spans {
    /// Lanes take in no instruction, by [`Wait`].
    waits: [u64; 5],
    /// Warps held, summed over the cycles.
    held: u64,
    /// A warp is not taken in, by [`Full`].
    full: [u64; 3],
}

impl Hours {
    /// A slot is taken by a warp.
    #[inline(always)]
    pub fn take(&mut self, place: u32, born: u64) {
        self.order.push_back((place, born));
    }

    /// A warp that has come is not taken in. Of several reasons the first counts.
    #[inline(always)]
    pub fn refuse(&mut self, full: Full) {
        self.full.get_or_insert(full);
    }

    /// The spans up to `cycle`, before which lanes took in instructions in `issued` cycles.
    #[inline(always)]
    fn spans(&self, cycle: Cycle, issued: u64) -> Spans {
        let cycles = cycle - self.since;
        let mut counts = self.counts;
        counts.waits[self.wait as usize] += cycles - (issued - self.issued);
        counts.held += cycles * self.held;
        if let Some(full) = self.full {
            counts.full[full as usize] += cycles;
        }
        counts
    }
}

impl Core {
    /// Closes the span from the last tick to `now`, before which all is issued.
    #[inline(always)]
    pub(super) fn close_span(&mut self, now: Cycle) {
        let issued = self.issue.taken_before(now);
        self.hours.counts = self.hours.spans(now, issued);
        (self.hours.since, self.hours.issued) = (now, issued);
        (self.hours.full, self.hours.stuck) = (None, false);
    }

    /// Notes at the end of a tick what holds until the next.
    #[inline(always)]
    pub(super) fn open_span(&mut self, now: Cycle) {
        self.hours.held = u64::from(self.held.count_ones());
        if self.held == 0 {
            self.issue.stop_lanes(now + 1);
            self.hours.order.clear();
        }
        self.hours.wait = self.wait();
    }

    /// What the oldest warp waits for that does not wait for others of its workgroup.
    fn wait(&mut self) -> Wait {
        let is_there = |&(place, born): &(u32, u64), core: &Core| core.held >> place & 1 != 0 && core.fixed.is_of(place, born);
        while self.hours.order.front().is_some_and(|first| !is_there(first, self)) {
            self.hours.order.pop_front();
        }
        let mut warps = self.hours.order.iter().filter(|warp| is_there(warp, self)).map(|&(place, _)| place);
        let Some(place) = warps.find(|place| self.issue.barrier >> place & 1 == 0) else { return Wait::Warps };
        let bit = 1_u64 << place;
        if (self.issue.finished | self.issue.asking) & bit != 0 {
            return if self.hours.stuck { Wait::Output } else { Wait::Latency };
        }
        if self.waiting & bit == 0 {
            return Wait::Latency;
        }
        let unanswered = &self.unanswered[place as usize];
        if unanswered[Service::Texture] > 0 {
            Wait::Texture
        } else if unanswered[Service::Constant] > 0 {
            Wait::Constants
        } else {
            Wait::Latency
        }
    }

    /// The spans before a cycle, and in how many cycles lanes took in instructions. Up to the next tick the core issues by itself.
    fn spans_before(&self, cycle: Cycle) -> (Spans, u64) {
        let issued = if self.issue.is_done_before(cycle) {
            self.issue.taken_before(cycle)
        } else {
            let mut ahead = self.issue.clone();
            ahead.advance(&self.fixed, cycle);
            ahead.taken_before(cycle)
        };
        (self.hours.spans(cycle, issued), issued)
    }

    /// Attributes the cycles in which the core held warps, and gives these warps, summed over the cycles.
    pub(super) fn attribute(&self, account: Cycles, cycle: Cycle) -> (Cycles, u64) {
        let (Spans { waits: [warps, latency, texture, constants, blocked], held, .. }, busy) = self.spans_before(cycle);
        let account =
            Cycles { busy, starved: warps - account.idle, blocked, memory: texture + constants, latency, idle: account.idle };
        (account, held)
    }

    /// What it has counted before a cycle.
    pub fn counts(&self, cycle: Cycle) -> CoreCounts {
        let (Spans { waits: [_, _, texture, _, _], held, full: [full_warps, full_registers, full_workgroups] }, _) =
            self.spans_before(cycle);
        let [float, integer, special, control, multiply] = self.issue.issued;
        CoreCounts {
            float,
            integer,
            special,
            control,
            multiply,
            vertex: self.vertex,
            texture_waits: texture,
            warp_cycles: held,
            slot_cycles: cycle * u64::from(self.config.warps),
            full_warps,
            full_registers,
            full_workgroups,
        }
    }
}
