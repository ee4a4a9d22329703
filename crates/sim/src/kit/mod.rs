//! Generator, worker, collector: what circuits small enough to be counted by hand are made of; and cycles in any order of units.
//! Tests and accuracy targets of this package and of those above build their circuits of these.

mod order;

use super::{Budget, In, Out, Tick, Unit, Wires};
use num::Cycle;
pub use order::{permutations, step};

/// An item that knows when it was pushed last.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Item {
    /// Its place in the source's order, from 0.
    pub number: u64,
    /// The cycle in which it was pushed last.
    pub pushed: Cycle,
}

/// Pushes items 0 to n-1, up to `a_cycle` per cycle, none before its `gap` has passed since the cycle of the one before.
pub struct Source {
    /// Items in all.
    pub n: u64,
    /// Most items pushed in a cycle.
    pub a_cycle: u32,
    /// Least cycles between two items.
    pub gap: Cycle,
    /// Size that a channel counts for an item.
    pub bytes: u32,
    /// Items pushed so far.
    pub next: u64,
    /// The first cycle in which it moves an item again.
    pub free_at: Cycle,
    /// Where items go.
    pub output: Out<Item>,
}

impl Source {
    /// A source of items of 16 bytes without gaps.
    pub fn new(n: u64, a_cycle: u32, output: Out<Item>) -> Source {
        Source { n, a_cycle, gap: 0, bytes: 16, next: 0, free_at: 0, output }
    }
}

impl<C> Unit<C> for Source {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let mut budget = Budget::new(self.a_cycle);
        let mut did = Tick::Idle;
        while self.next < self.n {
            let now = wires.now();
            if now < self.free_at {
                wires.sleep_until(self.free_at);
                return did.or(Tick::Working);
            }
            if !wires.can_push(&self.output) {
                return did.or(Tick::Blocked);
            }
            if !budget.spend() {
                break;
            }
            wires.push_sized(&self.output, Item { number: self.next, pushed: now }, self.bytes);
            self.next += 1;
            self.free_at = now + self.gap;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.next
    }

    fn resident(&self) -> u64 {
        self.n - self.next
    }
}

/// Works `service` cycles on an item, one at a time, then hands it on, keeping it if there is no room.
pub struct Worker {
    /// Cycles of work on an item.
    pub service: Cycle,
    /// The item at work, and the cycle in which it is done.
    pub holds: Option<(Item, Cycle)>,
    /// Items handed on so far.
    pub items: u64,
    /// Sum over items of the cycles they spent in the input channel.
    pub residence: u64,
    /// Where items come from.
    pub input: In<Item>,
    /// Where items go.
    pub output: Out<Item>,
}

impl Worker {
    /// A worker without an item.
    pub fn new(service: Cycle, input: In<Item>, output: Out<Item>) -> Worker {
        Worker { service, holds: None, items: 0, residence: 0, input, output }
    }
}

impl<C> Unit<C> for Worker {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let now = wires.now();
        let mut did = Tick::Idle;
        // 1. What is done leaves.
        if let Some((item, done)) = self.holds {
            if done > now {
                wires.sleep_until(done);
                return Tick::Working;
            }
            if !wires.try_push(&self.output, Item { pushed: now, ..item }) {
                return Tick::Blocked;
            }
            self.holds = None;
            self.items += 1;
            did = Tick::Moved;
        }
        // 2. The next one comes in.
        match wires.pop(&self.input) {
            Some(item) => {
                self.residence += now - item.pushed;
                self.holds = Some((item, now + self.service));
                Tick::Moved
            }
            None => did.or(Tick::Starved),
        }
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.holds.is_some())
    }
}

/// Takes up to `a_cycle` items per cycle, none for `rest` cycles after the last, and logs them.
pub struct Sink {
    /// Most items taken in a cycle.
    pub a_cycle: u32,
    /// Cycles after an item in which none is taken.
    pub rest: Cycle,
    /// The first cycle in which it moves an item again.
    pub free_at: Cycle,
    /// Each item's cycle of arrival and number.
    pub log: Vec<(Cycle, u64)>,
    /// Sum over items of the cycles that they spent in the input channel.
    pub residence: u64,
    /// Where items come from.
    pub input: In<Item>,
}

impl Sink {
    /// A sink that never rests.
    pub fn new(a_cycle: u32, input: In<Item>) -> Sink {
        Sink { a_cycle, rest: 0, free_at: 0, log: Vec::new(), residence: 0, input }
    }
}

impl<C> Unit<C> for Sink {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let mut budget = Budget::new(self.a_cycle);
        let mut did = Tick::Starved;
        let now = wires.now();
        if now < self.free_at {
            wires.sleep_until(self.free_at);
            return Tick::Working;
        }
        while budget.left() > 0 {
            let Some(item) = wires.pop(&self.input) else { break };
            budget.spend();
            self.log.push((now, item.number));
            self.residence += now - item.pushed;
            self.free_at = now + self.rest;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.log.len() as u64
    }

    fn resident(&self) -> u64 {
        0
    }
}
