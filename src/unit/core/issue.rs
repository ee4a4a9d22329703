//! What a core does between its dealings with other units: warps issue, wait for their latencies, and reach the ends of their
//! steps.
//!
//! Other units see nothing of this until a warp comes to the end of its step, and it is known how long that takes at least. So a
//! core sleeps until then, or until a warp comes to it, and catches up with the cycles gone by in one go. That is exact, and costs
//! the host half of a tick every cycle.

use crate::num::{Cycle, NEVER};
use crate::work::{Class, RequestKind};

use super::{CoreConfig, Scheduling};

/// Most warps of a core.
pub(super) const PLACES: usize = 64;

/// Cycles that the wheel of latencies holds: more than the longest latency.
const WHEEL: u64 = 64;

/// What does not change between the core's dealings with others.
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    /// Invocations of a warp.
    width: u64,
    /// Warp instructions issued a cycle.
    issue: u64,
    /// Invocations executed a cycle, by class.
    lanes: [u64; Class::COUNT],
    /// Cycles from a warp's instruction to its next, by class.
    latency: [u32; Class::COUNT],
    scheduling: Scheduling,
    /// When the warp of each place was taken in, in order.
    age: [u64; PLACES],
}

impl Fixed {
    pub(super) fn new(config: &CoreConfig) -> Fixed {
        let lanes = [config.float_lanes, config.integer_lanes, config.special_lanes, config.control_lanes];
        Fixed {
            width: u64::from(config.warp_width),
            issue: u64::from(config.issue),
            lanes: lanes.map(u64::from),
            latency: [config.float_latency, config.integer_latency, config.special_latency, config.control_latency],
            scheduling: config.scheduling,
            age: [0; PLACES],
        }
    }

    /// A place is taken by a warp, as the youngest.
    pub(super) fn take(&mut self, place: u32, born: u64) {
        self.age[place as usize] = born;
    }
}

/// The set bits of a mask, lowest first.
#[inline(always)]
pub(super) fn bits(mut mask: u64) -> impl Iterator<Item = u32> {
    std::iter::from_fn(move || {
        (mask != 0).then(|| {
            let bit = mask.trailing_zeros();
            mask &= mask - 1;
            bit
        })
    })
}

/// A count of instructions of a class as a number, so that the largest of four is the class with most, and of these the first.
#[inline(always)]
fn key(class: usize, left: u32) -> u32 {
    left << 2 | (3 - class as u32)
}

/// The class of a step's next instruction, if any is left: the one it has most of. Costs name no order, and this spreads the rarer
/// classes over the step.
#[inline(always)]
fn next_class(keys: &[u32; Class::COUNT]) -> Option<usize> {
    let most = keys[0].max(keys[1]).max(keys[2].max(keys[3]));
    (most > 3).then_some(3 - (most & 3) as usize)
}

/// The warps of a core between the beginnings and the ends of their steps. Sets of places are masks.
#[derive(Clone, Debug)]
pub(super) struct Issue {
    /// The cycles before this one are done.
    at: Cycle,
    /// No warp comes to the end of its step before this.
    quiet_until: Cycle,
    /// Instructions left of each place's step, by class, as [`key`].
    left: [[u32; Class::COUNT]; PLACES],
    /// Cycles from the next instruction of each place's step to the last, at least; the most there is where a warp is not at work.
    remaining: [u32; PLACES],
    /// The class of each place's next instruction.
    class: [u8; PLACES],
    /// Places that can issue.
    ready: u64,
    /// Places whose next instruction is of a class.
    next_is: [u64; Class::COUNT],
    /// Places whose step ends with a barrier, or with the warp; the others end with a request.
    ends_in_barrier: u64,
    ends_in_end: u64,
    /// Places at the end of their step that ask the texture unit, are done, or wait for their group.
    pub(super) asking: u64,
    pub(super) finished: u64,
    pub(super) barrier: u64,
    /// Places that become ready at a cycle, modulo the wheel; and the cycles with any, a bit each.
    wheel: [u64; WHEEL as usize],
    turning: u64,
    /// When the schedulers are free, in cycles times instructions a cycle.
    issue_at: u64,
    /// When each class's lanes are free, in cycles times lanes.
    free_at: [u64; Class::COUNT],
    /// Where round robin goes on.
    next: u32,
    /// Warp instructions issued by class.
    pub(super) issued: [u64; Class::COUNT],
}

impl Issue {
    pub(super) fn new() -> Issue {
        Issue {
            at: 0,
            quiet_until: NEVER,
            left: [[0; Class::COUNT]; PLACES],
            remaining: [u32::MAX; PLACES],
            class: [0; PLACES],
            ready: 0,
            next_is: [0; Class::COUNT],
            ends_in_barrier: 0,
            ends_in_end: 0,
            asking: 0,
            finished: 0,
            barrier: 0,
            wheel: [0; WHEEL as usize],
            turning: 0,
            issue_at: 0,
            free_at: [0; Class::COUNT],
            next: 0,
            issued: [0; Class::COUNT],
        }
    }

    /// A warp begins a step of so many instructions, and what comes then. It can issue in the next cycle that is done.
    pub(super) fn enter(&mut self, fixed: &Fixed, place: u32, instructions: [u32; Class::COUNT], then: RequestKind) {
        let bit = 1_u64 << place;
        let mark = |set: u64, on: bool| set & !bit | if on { bit } else { 0 };
        self.ends_in_barrier = mark(self.ends_in_barrier, then == RequestKind::Barrier);
        self.ends_in_end = mark(self.ends_in_end, then == RequestKind::End);
        let place = place as usize;
        // Most first, and of equals the first: the last instruction is of the last class there is.
        let (mut cycles, mut last) = (0_u32, 0);
        for class in 0..Class::COUNT {
            let count = instructions[class].min(u32::MAX >> 2);
            self.left[place][class] = key(class, count);
            self.issued[class] += u64::from(count);
            cycles = cycles.saturating_add(count.saturating_mul(fixed.latency[class]));
            last = if count > 0 { fixed.latency[class] } else { last };
        }
        match next_class(&self.left[place]) {
            Some(class) => {
                self.class[place] = class as u8;
                self.next_is[class] |= bit;
                self.ready |= bit;
                self.remaining[place] = (cycles - last).min(u32::MAX - 1);
                self.quiet_until = self.quiet_until.min(self.at + u64::from(self.remaining[place]));
            }
            None => self.end(bit),
        }
    }

    /// All instructions of a step are issued. What follows does not wait for the last one's latency: costs count what it
    /// produces as part of the request.
    #[inline(always)]
    fn end(&mut self, bit: u64) {
        self.barrier |= bit & self.ends_in_barrier;
        self.finished |= bit & self.ends_in_end;
        self.asking |= bit & !self.ends_in_barrier & !self.ends_in_end;
    }

    /// Whether a warp waits at the end of its step.
    #[inline(always)]
    pub(super) fn any_ended(&self) -> bool {
        self.asking | self.finished | self.barrier != 0
    }

    /// The place whose turn it is among candidates.
    #[inline(always)]
    pub(super) fn choose(&self, fixed: &Fixed, candidates: u64) -> u32 {
        match fixed.scheduling {
            Scheduling::RoundRobin => {
                let after = candidates & (u64::MAX << (self.next % 64));
                if after != 0 { after.trailing_zeros() } else { candidates.trailing_zeros() }
            }
            Scheduling::Oldest => {
                bits(candidates).min_by_key(|&place| fixed.age[place as usize]).expect("there are candidates")
            }
        }
    }

    /// One cycle: warps whose latency is over are ready, and schedulers and lanes issue what they take. A warp issues in order: one
    /// whose next instruction finds no free lane waits. Returns whether any was issued.
    #[inline(always)]
    fn step(&mut self, fixed: &Fixed, now: Cycle) -> bool {
        let slot = now % WHEEL;
        self.ready |= std::mem::take(&mut self.wheel[slot as usize]);
        self.turning &= !(1 << slot);

        let mut candidates = 0;
        for class in 0..Class::COUNT {
            let open = self.free_at[class] < (now + 1) * fixed.lanes[class];
            candidates |= self.next_is[class] & self.ready & 0_u64.wrapping_sub(u64::from(open));
        }
        let end = (now + 1) * fixed.issue;
        let mut issue_at = self.issue_at.max(now * fixed.issue);
        let any = candidates != 0 && issue_at < end;
        while candidates != 0 && issue_at < end {
            let place = self.choose(fixed, candidates) as usize % PLACES;
            let bit = 1_u64 << place;
            self.next = place as u32 + 1;
            let class = usize::from(self.class[place]) % Class::COUNT;
            let left = &mut self.left[place];
            left[class] -= 1 << 2;
            let next = next_class(left);

            self.ready &= !bit;
            self.next_is[class] &= !bit;
            candidates &= !bit;
            let free_at = self.free_at[class].max(now * fixed.lanes[class]) + fixed.width;
            self.free_at[class] = free_at;
            if free_at >= (now + 1) * fixed.lanes[class] {
                candidates &= !self.next_is[class];
            }
            issue_at += 1;
            match next {
                // Instructions are taken as dependent.
                Some(next) => {
                    self.class[place] = next as u8;
                    self.next_is[next] |= bit;
                    self.remaining[place] -= fixed.latency[class];
                    let slot = (now + u64::from(fixed.latency[class])) % WHEEL;
                    self.wheel[slot as usize] |= bit;
                    self.turning |= 1 << slot;
                }
                None => {
                    self.remaining[place] = u32::MAX;
                    self.end(bit);
                }
            }
        }
        self.issue_at = issue_at;
        any
    }

    /// The first cycle from `from` on, with all before it done, in which a warp may issue or become ready; [`NEVER`] if none will
    /// by itself.
    #[inline(always)]
    fn next(&self, fixed: &Fixed, from: Cycle) -> Cycle {
        let ahead = self.turning.rotate_right((from % WHEEL) as u32);
        let mut next = if ahead == 0 { NEVER } else { from + u64::from(ahead.trailing_zeros()) };
        if self.ready != 0 && next > from {
            let issue = self.issue_at / fixed.issue;
            for class in 0..Class::COUNT {
                if self.next_is[class] & self.ready != 0 {
                    next = next.min((self.free_at[class] / fixed.lanes[class]).max(issue).max(from));
                }
            }
        }
        next
    }

    /// The next cycle in which a warp may issue or become ready; [`NEVER`] if none will by itself.
    pub(super) fn next_event(&self, fixed: &Fixed) -> Cycle {
        self.next(fixed, self.at)
    }

    /// Does the cycles before `now`, in which no warp comes to the end of its step.
    #[inline(always)]
    pub(super) fn catch_up(&mut self, fixed: &Fixed, now: Cycle) {
        while self.at < now {
            self.at = self.next(fixed, self.at).min(now);
            if self.at < now {
                self.step(fixed, self.at);
                self.at += 1;
            }
        }
    }

    /// Does cycle `now`, after those before it. Returns whether any warp issued.
    #[inline(always)]
    pub(super) fn cycle(&mut self, fixed: &Fixed, now: Cycle) -> bool {
        self.at = now + 1;
        self.step(fixed, now)
    }

    /// A cycle before which no warp comes to the end of its step, all up to now being done; [`NEVER`] if none is at work.
    #[inline(always)]
    pub(super) fn quiet_until(&mut self) -> Cycle {
        if self.quiet_until <= self.at {
            let least = self.remaining.iter().fold(u32::MAX, |least, &cycles| least.min(cycles));
            self.quiet_until = if least == u32::MAX { NEVER } else { self.at + u64::from(least) };
        }
        self.quiet_until
    }
}
