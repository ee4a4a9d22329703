//! The work of a core between its exchanges with other units: warps issue, wait for their latencies, and reach the ends of their
//! steps.
//!
//! Other units see nothing of this until a warp comes to the end of its step, and it is known how long that takes at least. So a
//! core sleeps until then, or until a warp comes to it, and catches up with the cycles gone by in one go. That is exact, and costs
//! the host half of a tick every cycle.

use num::{Cycle, NEVER};
use work::{Class, RequestKind, Step};

use super::{CoreConfig, Scheduling};

/// Most warps of a core.
pub(super) const PLACES: usize = 64;

/// Cycles that the wheel of latencies holds. A longer wait goes round again.
const WHEEL: u64 = 64;

/// Most instructions of a run: its waits fit 32 bits.
const LONGEST_RUN: u32 = 256;

/// Most of a wait after a run that is distinguished, for the same reason. Only a bound is made of it.
const MOST_AFTER: i64 = 1 << 30;

/// Waits between instructions of a warp are counted in parts of a cycle.
pub(super) const CYCLE: u32 = 256;

/// State that does not change between the core's exchanges with other units.
#[derive(Clone, Debug)]
pub(super) struct Fixed {
    /// Warps that issue in a cycle.
    issue: u32,
    /// Instructions of a class that its lanes take in a cycle in which they take any.
    room: [u32; Class::COUNT],
    /// Cycles until the lanes of a class take the next instruction. Either this or `room` is 1.
    interval: [Cycle; Class::COUNT],
    /// Lanes of each class, and whether neither they nor a warp are a multiple of the other: then what they take differs from cycle to cycle.
    lanes: [u64; Class::COUNT],
    uneven: [bool; Class::COUNT],
    /// Invocations of a warp.
    width: u64,
    /// Cycles from an instruction to one that needs its result, by class.
    latency: [u32; Class::COUNT],
    /// Whether an instruction waits only for instructions whose results it needs.
    scoreboard: bool,
    /// Whether a warp issues two instructions in a cycle.
    dual: bool,
    /// Whether an instruction holds the lanes of its class alone.
    overlap: bool,
    scheduling: Scheduling,
    /// When the warp of each place was taken in, in order.
    age: [u64; PLACES],
}

impl Fixed {
    pub(super) fn new(config: &CoreConfig) -> Fixed {
        let lanes = config.lanes();
        let width = config.warp_width;
        Fixed {
            issue: config.issue,
            room: lanes.map(|lanes| lanes.div_ceil(width)),
            interval: lanes.map(|lanes| Cycle::from(width.div_ceil(lanes))),
            lanes: lanes.map(u64::from),
            uneven: lanes.map(|lanes| !lanes.is_multiple_of(width) && !width.is_multiple_of(lanes)),
            width: u64::from(width),
            latency: config.latencies(),
            scoreboard: config.scoreboard,
            dual: config.dual_issue,
            overlap: config.overlap,
            scheduling: config.scheduling,
            age: [0; PLACES],
        }
    }

    /// A place is taken by a warp, as the youngest.
    pub(super) fn take(&mut self, place: u32, born: u64) {
        self.age[place as usize] = born;
    }

    /// Whether a place was last taken by a warp.
    pub(super) fn is_of(&self, place: u32, born: u64) -> bool {
        self.age[place as usize] == born
    }

    /// The time that a warp waits after an instruction of each class of a step, in parts of a cycle; whether these are the latencies; and the
    /// number of instructions, of 256, that are issued beside the instruction before them.
    ///
    /// A step takes a warp as long as its longest chain, or as the issue of its instructions. Where the chain is shorter than all
    /// instructions one after another, all waits are shorter by the same factor: a compiler puts instructions that do not need each other
    /// between those that do.
    pub(super) fn waits(&self, step: &Step) -> ([u32; Class::COUNT], bool, u32) {
        if self.latencies_are_waits(step) {
            return (self.latency.map(|latency| latency * CYCLE), true, 0);
        }
        let cycles = |counts: &[u32; Class::COUNT]| -> u64 {
            counts.iter().zip(self.latency).map(|(&count, latency)| u64::from(count) * u64::from(latency)).sum()
        };
        let count: u64 = step.instructions.iter().map(|&count| u64::from(count)).sum();
        let (all, chain) = (cycles(&step.instructions).max(1), cycles(&step.chain) * u64::from(CYCLE));
        let least = CYCLE >> u32::from(self.dual);
        let together = if self.scoreboard {
            chain.max(count * u64::from(least)).min(all * u64::from(CYCLE))
        } else {
            all * u64::from(CYCLE)
        };
        let waits = self.latency.map(|latency| ((u64::from(latency) * together / all) as u32).max(least));
        // As many instructions as wait for the same are issued in pairs.
        let pairs = if self.dual { ((all * u64::from(CYCLE) - together) * 256 / together.max(1)).min(256) as u32 } else { 0 };
        (waits, false, pairs)
    }

    /// Whether a warp waits for the latency of each instruction of a step.
    #[inline(always)]
    fn latencies_are_waits(&self, step: &Step) -> bool {
        let long = self.latency[Class::Multiply as usize] >= WHEEL as u32 && step.instructions[Class::Multiply as usize] > 0;
        !long && (!self.scoreboard || step.chain == step.instructions)
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
    left << 3 | (7 - class as u32)
}

/// The largest of some counts.
#[inline(always)]
fn largest(keys: &[u32; Class::COUNT]) -> u32 {
    keys[0].max(keys[1]).max(keys[2].max(keys[3])).max(keys[4])
}

/// The class of a step's next instruction, if any is left: the one it has most of. Costs name no order, and this spreads the rarer
/// classes over the step.
#[inline(always)]
fn next_class(keys: &[u32; Class::COUNT]) -> Option<usize> {
    let most = largest(keys);
    (most > 7).then_some(7 - (most & 7) as usize)
}

/// The lowest `count` bits of a set, or all if there are fewer.
#[inline(always)]
fn lowest(set: u64, count: u32) -> u64 {
    let without = |set: u64| set & set.wrapping_sub(1);
    match count {
        1 => set ^ without(set),
        4 => set ^ without(without(without(without(set)))),
        _ => set ^ (0..count).fold(set, |rest, _| without(rest)),
    }
}

/// The warps of a core between the beginnings and the ends of their steps. Sets of places are masks.
///
/// A warp's instructions come in runs of one class, of which only the length is counted down: which class comes next is asked at
/// the end of a run. Whole sets of warps are taken from a cycle at once.
#[derive(Clone, Debug)]
pub(super) struct Issue {
    /// The cycles before this one are done.
    at: Cycle,
    /// No warp comes to the end of its step before this.
    quiet_until: Cycle,
    /// The class of each place's run, where one is at work.
    class: [u8; PLACES],
    /// Instructions left of each place's run.
    run: [i32; PLACES],
    /// The wait after each instruction of the run, in parts of a cycle.
    wait: [i32; PLACES],
    /// Parts of a cycle from the end of the run, its last wait included, to the step's last instruction. Together with the run this is the least
    /// time that the step still takes. The largest number where no warp is at work.
    after: [i32; PLACES],
    /// The parts of a cycle that each place has waited too little so far.
    late: [u32; PLACES],
    /// The cycles that each place waits after the instruction that it has just issued.
    cycles: [u32; PLACES],
    /// The waits of a step by class; those of a place where they are not the latencies.
    waits: Vec<[u32; Class::COUNT]>,
    /// Places whose waits are the latencies.
    exact: u64,
    /// Places that go round the wheel again, and for how many cycles.
    again: u64,
    rounds: [u32; PLACES],
    /// How many of 256 instructions a place issues beside the one before, how many of 256 it is short of that, places that issue a second
    /// instruction in this cycle, and instructions issued in it by class.
    pairs: [u32; PLACES],
    paired: [u32; PLACES],
    second: u64,
    used: [u32; Class::COUNT],
    /// Instructions left of each place's step after its run, by class, as [`key`].
    left: [[u32; Class::COUNT]; PLACES],
    /// `after` without its bound.
    rest: [i64; PLACES],
    /// For each place whose step has an order of instructions: the runs that are left after the current one, the next run last.
    orders: Vec<Vec<(Class, u32)>>,
    /// Places whose run is the last instruction of their step.
    last: u64,
    /// Places that can issue.
    ready: u64,
    /// Places whose run is of a class.
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
    /// When each class's lanes take the next instruction; and when they are free, in cycles times lanes, where they are uneven.
    free_at: [Cycle; Class::COUNT],
    lanes_at: [u64; Class::COUNT],
    /// Cycles in which lanes take in instructions, up to `taken_until`.
    taken: u64,
    taken_until: Cycle,
    /// Where round robin goes on, modulo the places.
    next: u32,
    /// Warp instructions issued by class.
    pub(super) issued: [u64; Class::COUNT],
}

impl Issue {
    pub(super) fn new() -> Issue {
        Issue {
            at: 0,
            quiet_until: NEVER,
            class: [0; PLACES],
            run: [0; PLACES],
            wait: [0; PLACES],
            after: [i32::MAX; PLACES],
            late: [0; PLACES],
            cycles: [0; PLACES],
            waits: vec![[0; Class::COUNT]; PLACES],
            exact: 0,
            again: 0,
            rounds: [0; PLACES],
            pairs: [0; PLACES],
            paired: [0; PLACES],
            second: 0,
            used: [0; Class::COUNT],
            left: [[0; Class::COUNT]; PLACES],
            rest: [0; PLACES],
            orders: Vec::new(),
            last: 0,
            ready: 0,
            next_is: [0; Class::COUNT],
            ends_in_barrier: 0,
            ends_in_end: 0,
            asking: 0,
            finished: 0,
            barrier: 0,
            wheel: [0; WHEEL as usize],
            turning: 0,
            free_at: [0; Class::COUNT],
            lanes_at: [0; Class::COUNT],
            taken: 0,
            taken_until: 0,
            next: 0,
            issued: [0; Class::COUNT],
        }
    }

    /// A warp begins a step. It can issue in the next cycle that is done. Where the instructions have an order they come in it, and are as
    /// many.
    pub(super) fn enter(&mut self, fixed: &Fixed, place: u32, step: &Step, order: &[(Class, u32)]) {
        let bit = 1_u64 << place;
        let mark = |set: u64, on: bool| set & !bit | if on { bit } else { 0 };
        self.ends_in_barrier = mark(self.ends_in_barrier, step.then == RequestKind::Barrier);
        self.ends_in_end = mark(self.ends_in_end, step.then == RequestKind::End);
        let place = place as usize;
        let (waits, exact, pairs) = fixed.waits(step);
        self.exact = mark(self.exact, exact);
        if !exact {
            self.waits[place] = waits;
        }
        (self.late[place], self.pairs[place], self.paired[place]) = (0, pairs, 0);
        // Most first, and of equals the first: the last instruction is of the last class there is.
        let (mut together, mut last) = (0_i64, 0);
        for class in 0..Class::COUNT {
            let count = step.instructions[class].min(u32::MAX >> 3);
            self.left[place][class] = key(class, count);
            self.issued[class] += u64::from(count);
            together += i64::from(count) * i64::from(waits[class]);
            last = if count > 0 { waits[class] } else { last };
        }
        if let Some(&(class, _)) = order.last() {
            last = waits[class as usize];
            self.orders.resize_with(PLACES, Vec::new);
            self.orders[place].extend(order.iter().rev());
        }
        // The second of a pair comes earlier by the wait between both, and by what was waited too little before, less than a cycle.
        let paired = if fixed.dual { waits.into_iter().max().unwrap_or(0) + CYCLE } else { 0 };
        let together = (together - i64::from(last + paired)).max(0);
        self.rest[place] = together;
        if self.begin_run(fixed, place) {
            self.ready |= bit;
            self.quiet_until = self.quiet_until.min(self.at + together as Cycle / Cycle::from(CYCLE));
        } else {
            self.end(bit);
        }
    }

    /// The next run of a place's step, of the class that it has most of: as many as issue before it has more of another. The last
    /// instruction of the step is a run of its own. False if there is none left.
    fn begin_run(&mut self, fixed: &Fixed, place: usize) -> bool {
        let bit = 1_u64 << place;
        self.last &= !bit;
        if let Some(next) = self.orders.get_mut(place).and_then(Vec::pop) {
            self.begin_in_order(fixed, place, next);
            return true;
        }
        let left = &mut self.left[place];
        let Some(class) = next_class(left) else {
            self.run[place] = 0;
            self.after[place] = i32::MAX;
            return false;
        };
        let most = std::mem::replace(&mut left[class], 0);
        let other = largest(left);
        let (mut run, count) = ((most - other).div_ceil(8), most >> 3);
        let wait = if self.exact & bit != 0 { fixed.latency[class] * CYCLE } else { self.waits[place][class] };
        self.wait[place] = wait as i32;
        if other <= 7 && count == 1 {
            // Its end is not a matter of waits to come.
            self.last |= bit;
            self.after[place] = i32::MAX - wait as i32;
            run = 1;
        } else {
            // Without others the run is all but the last.
            run = run.min(if other <= 7 { count - 1 } else { count }).min(LONGEST_RUN);
            self.rest[place] -= i64::from(run) * i64::from(wait);
            self.after[place] = self.rest[place].clamp(-MOST_AFTER, MOST_AFTER) as i32;
        }
        left[class] = most - (run << 3);
        self.run[place] = run as i32;
        self.class[place] = class as u8;
        self.next_is[class] |= bit;
        true
    }

    /// [`Issue::begin_run`] of the next instructions in order.
    #[cold]
    fn begin_in_order(&mut self, fixed: &Fixed, place: usize, (class, count): (Class, u32)) {
        let bit = 1_u64 << place;
        let order = &mut self.orders[place];
        let class = class as usize;
        let wait = if self.exact & bit != 0 { fixed.latency[class] * CYCLE } else { self.waits[place][class] };
        self.left[place] = [0; Class::COUNT];
        self.wait[place] = wait as i32;
        let run = if order.is_empty() && count == 1 {
            self.last |= bit;
            self.after[place] = i32::MAX - wait as i32;
            1
        } else {
            let run = if order.is_empty() { count - 1 } else { count }.min(LONGEST_RUN);
            if run < count {
                order.push((Class::ALL[class], count - run));
            }
            self.rest[place] -= i64::from(run) * i64::from(wait);
            self.after[place] = self.rest[place].clamp(-MOST_AFTER, MOST_AFTER) as i32;
            run
        };
        self.run[place] = run as i32;
        self.class[place] = class as u8;
        self.next_is[class] |= bit;
    }

    /// All instructions of a step are issued. What follows does not wait for the last one's latency: costs count what it
    /// produces as part of the request.
    #[inline(always)]
    fn end(&mut self, bit: u64) {
        self.barrier |= bit & self.ends_in_barrier;
        self.finished |= bit & self.ends_in_end;
        self.asking |= bit & !self.ends_in_barrier & !self.ends_in_end;
    }

    /// The cycles before `cycle` in which lanes take in instructions, all before it being done.
    #[inline(always)]
    pub(super) fn taken_before(&self, cycle: Cycle) -> u64 {
        self.taken - self.taken_until.saturating_sub(cycle)
    }

    /// Lanes are taken to be free from a cycle on: no warp is left.
    pub(super) fn stop_lanes(&mut self, cycle: Cycle) {
        self.taken = self.taken_before(cycle);
        self.taken_until = self.taken_until.min(cycle);
    }

    /// Whether no warp issues before `cycle` that has not issued yet.
    pub(super) fn is_done_before(&self, cycle: Cycle) -> bool {
        self.at >= cycle || self.next(self.at) >= cycle
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
            Scheduling::RoundRobin => (candidates.rotate_right(self.next).trailing_zeros() + self.next) % 64,
            Scheduling::Oldest => {
                bits(candidates).min_by_key(|&place| fixed.age[place as usize]).expect("there are candidates")
            }
        }
    }

    /// The class of the first of some places at work, and which of them are of it. A loop over classes would look at all four, of
    /// which one is there most of the time.
    #[inline(always)]
    fn of_class(&self, places: u64) -> (usize, u64) {
        let class = usize::from(self.class[places.trailing_zeros() as usize % PLACES]) % Class::COUNT;
        (class, places & self.next_is[class])
    }

    /// The ready places that issue in a cycle, chosen round robin: as many as schedulers and lanes take. A warp issues in order: a warp whose
    /// next instruction finds no free lane waits.
    #[inline(always)]
    fn chosen(&mut self, fixed: &Fixed, now: Cycle) -> u64 {
        if fixed.scheduling == Scheduling::Oldest {
            return self.oldest(fixed, now);
        }
        // Turns go round from `next`. A place issues if its turn comes before its class's room and all room are spent by those
        // before it; those that find their own class's room spent take none. So these are the first of each class, and the first
        // of those.
        let mut turns = 0;
        let mut left = self.ready;
        while left != 0 {
            let (class, ready) = self.of_class(left);
            left ^= ready;
            if self.free_at[class] <= now {
                let ready = ready.rotate_right(self.next);
                let room = self.room(fixed, now, class);
                turns |= if room >= fixed.issue { ready } else { lowest(ready, room) };
            }
        }
        let turns = lowest(turns, fixed.issue);
        let chosen = turns.rotate_left(self.next);
        if turns != 0 {
            self.next = self.behind(turns);
        }
        chosen
    }

    /// [`Issue::chosen`] of those that have been in the core longest.
    #[inline(never)]
    fn oldest(&self, fixed: &Fixed, now: Cycle) -> u64 {
        let mut room: [u32; Class::COUNT] = std::array::from_fn(|class| self.room(fixed, now, class));
        let (mut left, mut chosen) = (fixed.issue, 0);
        let mut open: u64 =
            (0..Class::COUNT).filter(|&class| self.free_at[class] <= now).fold(0, |open, class| open | self.next_is[class]);
        open &= self.ready;
        while open != 0 && left > 0 {
            let bit = 1 << self.choose(fixed, open);
            chosen |= bit;
            open &= !bit;
            left -= 1;
            for class in 0..Class::COUNT {
                if self.next_is[class] & bit != 0 {
                    room[class] -= 1;
                    open &= if room[class] == 0 { !self.next_is[class] } else { u64::MAX };
                }
            }
        }
        chosen
    }

    /// Simulates one cycle: warps whose latency is over become ready, and schedulers and lanes issue what they can. Returns whether an
    /// instruction was issued.
    #[inline(always)]
    fn step(&mut self, fixed: &Fixed, now: Cycle) -> bool {
        let slot = now % WHEEL;
        if fixed.dual {
            self.used = [0; Class::COUNT];
        }
        let mut awake = std::mem::take(&mut self.wheel[slot as usize]);
        self.turning &= !(1 << slot);
        if awake & self.again != 0 {
            awake = self.go_round(now, awake);
        }
        self.ready |= awake;
        if self.ready == 0 {
            return false;
        }
        // Most of the time all that are ready are of one class.
        let (class, places) = self.of_class(self.ready);
        if places == self.ready && fixed.scheduling == Scheduling::RoundRobin {
            if self.free_at[class] > now {
                return false;
            }
            let turns = lowest(places.rotate_right(self.next), self.room(fixed, now, class).min(fixed.issue));
            let chosen = turns.rotate_left(self.next);
            self.next = self.behind(turns);
            self.ready = places ^ chosen;
            self.issue(fixed, now, class, chosen);
            if self.second != 0 {
                self.issue_second(fixed, now);
            }
            return true;
        }
        let chosen = self.chosen(fixed, now);
        self.ready &= !chosen;
        let mut left = chosen;
        while left != 0 {
            let (class, places) = self.of_class(left);
            left ^= places;
            self.issue(fixed, now, class, places);
        }
        if self.second != 0 {
            self.issue_second(fixed, now);
        }
        chosen != 0
    }

    /// Instructions of a class that its lanes take in this cycle, in which they take at least one.
    #[inline(always)]
    fn room(&self, fixed: &Fixed, now: Cycle, class: usize) -> u32 {
        if !fixed.uneven[class] {
            return fixed.room[class];
        }
        let (begin, end) = (now * fixed.lanes[class], (now + 1) * fixed.lanes[class]);
        (end - self.lanes_at[class].clamp(begin, end)).div_ceil(fixed.width) as u32
    }

    /// Places that waited for the wheel's longest wait wait for the rest. Returns the others.
    #[cold]
    fn go_round(&mut self, now: Cycle, awake: u64) -> u64 {
        let round = awake & self.again;
        self.again &= !round;
        for place in bits(round) {
            self.sleep(now, place as usize, self.rounds[place as usize]);
        }
        awake & !round
    }

    /// A place becomes ready in a number of cycles, which is not 0.
    #[inline(always)]
    fn sleep(&mut self, now: Cycle, place: usize, cycles: u32) {
        let mut wait = Cycle::from(cycles);
        if wait >= WHEEL {
            self.rounds[place] = (wait - (WHEEL - 1)) as u32;
            self.again |= 1 << place;
            wait = WHEEL - 1;
        }
        let slot = (now + wait) % WHEEL;
        self.wheel[slot as usize] |= 1 << place;
        self.turning |= 1 << slot;
    }

    /// Warps issue a second instruction in a cycle, where its lanes take it. The others do in the next cycle.
    #[cold]
    fn issue_second(&mut self, fixed: &Fixed, now: Cycle) {
        for place in bits(std::mem::take(&mut self.second)) {
            let class = usize::from(self.class[place as usize]);
            let room = if fixed.uneven[class] {
                self.room(fixed, now, class)
            } else {
                fixed.room[class].saturating_sub(self.used[class])
            };
            let taken = fixed.interval[class] > 1 && self.free_at[class] > now;
            if room == 0 || taken {
                self.ready |= 1 << place;
                continue;
            }
            let pairs = std::mem::take(&mut self.pairs[place as usize]);
            self.issue(fixed, now, class, 1 << place);
            self.pairs[place as usize] = pairs;
        }
    }

    /// The turn after the last of some, which are not none.
    #[inline(always)]
    fn behind(&self, turns: u64) -> u32 {
        (self.next + 1 + turns.ilog2()) % 64
    }

    /// Places issue an instruction of their class each.
    #[inline(always)]
    fn issue(&mut self, fixed: &Fixed, now: Cycle, class: usize, mut places: u64) {
        let free = now + fixed.interval[class];
        if !fixed.overlap {
            self.free_at = [free; Class::COUNT];
            self.lanes_at = fixed.lanes.map(|lanes| free * lanes);
        } else if fixed.uneven[class] {
            let lanes = fixed.lanes[class];
            self.lanes_at[class] = self.lanes_at[class].max(now * lanes) + u64::from(places.count_ones()) * fixed.width;
            self.free_at[class] = (self.lanes_at[class] / lanes).max(now + 1);
        } else {
            self.free_at[class] = free;
        }
        let until = self.free_at[class];
        self.taken += until.saturating_sub(self.taken_until.max(now));
        self.taken_until = self.taken_until.max(until);
        self.used[class] += if fixed.dual { places.count_ones() } else { 0 };
        let exact = self.exact;
        let (mut going, mut done) = (places, 0);
        let mut waits = places & !exact;
        while places != 0 {
            let place = places.trailing_zeros() as usize % PLACES;
            places &= places - 1;
            self.run[place] -= 1;
            if self.run[place] == 0 {
                done |= 1 << place;
            }
        }
        // How long those wait that do not wait for latencies is found before their next runs begin.
        if waits != 0 {
            waits = self.count_waits(fixed, waits);
        }
        if done != 0 {
            let ended = self.end_runs(fixed, class, done);
            going &= !ended;
            self.second &= !ended;
        }
        let same = going & exact;
        if same != 0 {
            let slot = (now + Cycle::from(fixed.latency[class])) % WHEEL;
            self.wheel[slot as usize] |= same;
            self.turning |= 1 << slot;
        }
        for place in bits(going & waits) {
            self.sleep(now, place as usize, self.cycles[place as usize]);
        }
    }

    /// Sets the waits of the places that have issued an instruction. Returns the places that wait; the others issue a second instruction.
    #[inline(always)]
    fn count_waits(&mut self, fixed: &Fixed, places: u64) -> u64 {
        let mut waits = places;
        for place in bits(places) {
            let bit = 1 << place;
            let place = place as usize;
            let wait = self.late[place] + self.wait[place] as u32;
            if fixed.dual {
                self.paired[place] += self.pairs[place];
                // An instruction that found no lane beside the instruction before it has come early enough.
                if self.pairs[place] > 0 && self.paired[place] >= 256 && self.late[place] < CYCLE {
                    self.paired[place] -= 256;
                    self.late[place] = wait;
                    self.second |= bit;
                    waits &= !bit;
                    continue;
                }
            }
            self.cycles[place] = (wait / CYCLE).max(1);
            self.late[place] = wait.saturating_sub(self.cycles[place] * CYCLE);
        }
        waits
    }

    /// Runs of a class are done: the next begin. Returns the places whose steps are done too.
    #[inline(never)]
    fn end_runs(&mut self, fixed: &Fixed, class: usize, done: u64) -> u64 {
        self.next_is[class] &= !done;
        let mut ended = 0;
        for place in bits(done) {
            if !self.begin_run(fixed, place as usize) {
                ended |= 1 << place;
            }
        }
        self.end(ended);
        ended
    }

    /// The first cycle from `from` on, with all before it done, in which a warp may issue or become ready; [`NEVER`] if none will
    /// by itself.
    #[inline(always)]
    fn next(&self, from: Cycle) -> Cycle {
        let ahead = self.turning.rotate_right((from % WHEEL) as u32);
        if ahead & 1 != 0 {
            return from;
        }
        let mut next = if ahead == 0 { NEVER } else { from + u64::from(ahead.trailing_zeros()) };
        let mut left = self.ready;
        while left != 0 {
            let (class, ready) = self.of_class(left);
            left ^= ready;
            next = next.min(self.free_at[class].max(from));
        }
        next
    }

    /// The next cycle in which a warp may issue or become ready; [`NEVER`] if none will by itself.
    pub(super) fn next_event(&self) -> Cycle {
        self.next(self.at)
    }

    /// Does the cycles before `until`. Returns the cycle after the last of them in which any warp issued, 0 if none did; in those
    /// before the last, no warp comes to the end of its step.
    // Not inlined: the core calls it for the cycles gone by and for its own, and both have to fit the host's instruction cache.
    #[inline(never)]
    pub(super) fn advance(&mut self, fixed: &Fixed, until: Cycle) -> Cycle {
        let mut issued = 0;
        while self.at < until {
            self.at = self.next(self.at).min(until);
            if self.at < until {
                let any = self.step(fixed, self.at);
                self.at += 1;
                issued = if any { self.at } else { issued };
            }
        }
        issued
    }

    /// A cycle before which no warp comes to the end of its step, all up to now being done; [`NEVER`] if none is at work.
    #[inline(always)]
    pub(super) fn quiet_until(&mut self, fixed: &Fixed) -> Cycle {
        if self.quiet_until <= self.at {
            // A warp that has more than one instruction left waits for the latencies of all but the last.
            let mut least = i32::MAX;
            for place in 0..PLACES {
                least = least.min(self.run[place] * self.wait[place] + self.after[place]);
            }
            let mut until = if least == i32::MAX { NEVER } else { self.at + least.max(0) as Cycle / Cycle::from(CYCLE) };
            if self.last != 0 {
                until = until.min(self.next_last(fixed));
            }
            // Nothing ends without issuing.
            self.quiet_until = until.max(self.next(self.at));
        }
        self.quiet_until
    }

    /// A cycle before which no warp issues the last instruction of its step, if any has come so far.
    #[inline(never)]
    fn next_last(&self, fixed: &Fixed) -> Cycle {
        let soonest = self.next_of_wheel(self.last);
        if self.last & self.ready == 0 {
            return self.at.saturating_add(soonest);
        }
        if fixed.scheduling != Scheduling::RoundRobin {
            return self.at;
        }
        // Those that can issue do in turn. The first of them comes after all before it whose lanes are never spent: these are not
        // passed over, and take all there is to issue.
        let first = (self.last & self.ready).rotate_right(self.next).trailing_zeros();
        let mut open = 0;
        for class in 0..Class::COUNT {
            let never_spent = !fixed.dual && fixed.lanes[class] >= u64::from(fixed.issue) * fixed.width;
            open |= if never_spent { self.next_is[class] } else { 0 };
        }
        let before = (self.ready & open).rotate_right(self.next) & ((1 << first) - 1);
        self.at + soonest.min(Cycle::from(before.count_ones() / fixed.issue))
    }

    /// Cycles until the first of some places becomes ready.
    #[inline(always)]
    fn next_of_wheel(&self, places: u64) -> Cycle {
        let mut ahead = self.turning.rotate_right((self.at % WHEEL) as u32);
        while ahead != 0 {
            let wait = Cycle::from(ahead.trailing_zeros());
            if self.wheel[((self.at + wait) % WHEEL) as usize] & places != 0 {
                return wait;
            }
            ahead &= ahead - 1;
        }
        NEVER
    }
}
