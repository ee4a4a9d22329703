//! What the circuits here are made of: generator, worker and collector of the accuracy suite, and a fork and a join.

pub(super) use crate::kit::{Item, Sink, Source, Worker};
use crate::{Budget, In, Out, Tick, Unit, Wires};
use num::Cycle;

/// Item n to output n mod the number of outputs, as many per cycle as go.
pub struct Split {
    pub items: u64,
    pub input: In<Item>,
    pub outputs: Vec<Out<Item>>,
}

impl<C> Unit<C> for Split {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let now = wires.now();
        let mut did = Tick::Starved;
        while let Some(item) = wires.front(&self.input) {
            let output = &self.outputs[(item.number % self.outputs.len() as u64) as usize];
            if !wires.try_push(output, Item { pushed: now, ..item }) {
                return did.or(Tick::Blocked);
            }
            wires.pop(&self.input);
            self.items += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        0
    }
}

/// Takes items in the order of their numbers from inputs that each hold every n-th.
pub struct Merge {
    pub inputs: Vec<In<Item>>,
    pub log: Vec<(Cycle, u64)>,
}

impl<C> Unit<C> for Merge {
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = Budget::new(2);
        while budget.spend() {
            let Some(item) = wires.pop(&self.inputs[self.log.len() % self.inputs.len()]) else { break };
            assert_eq!(item.number, self.log.len() as u64, "merged in order");
            self.log.push((wires.now(), item.number));
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
