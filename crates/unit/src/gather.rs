//! Gathering, one unit per pipeline of a sort-first machine: takes the primitives that were routed to the pipeline from all that route,
//! in the order of their sequence numbers, and hands them to the pipeline's geometry in runs.

use super::card::Card;
use super::network::Receiver;
use super::sorting::{Keep, Merge, OrderCounts};
use super::token::{Kind, Run, TriangleToken};
use sim::{Out, StallProbe, Tick, Unit, Wires};

/// Gathering. Its items are primitives.
#[derive(Clone)]
pub struct Gather {
    /// Primitives per cycle.
    rate: u32,
    input: Receiver<TriangleToken>,
    output: Out<Run>,
    merge: Merge,
    items: u64,
}

impl Gather {
    /// A gather unit at the beginning of the order, which takes `rate` primitives per cycle. The state of `probe` is what it waits for.
    pub fn new(rate: u32, keep: Keep, probe: StallProbe, input: Receiver<TriangleToken>, output: Out<Run>) -> Gather {
        Gather { rate, merge: Merge::new(keep, probe, &input), input, output, items: 0 }
    }

    /// The counters of the unit.
    pub fn counts(&self) -> OrderCounts {
        self.merge.counts()
    }
}

impl Gather {
    fn step(&mut self, wires: &mut Wires) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = self.rate;
        loop {
            let Some((from, token)) = self.merge.next(wires, &self.input) else { return did };
            let TriangleToken { slot, kind, sequence, triangle: first } = token;
            // 1. A number has ended; a fence, which has one of its own, goes on.
            if kind != Kind::DATA {
                if kind != Kind::END && !wires.try_push(&self.output, Run { slot, kind, sequence, first: 0, count: 0 }) {
                    return did.or(Tick::Blocked);
                }
                self.merge.take(wires, &mut self.input, from, token);
                did = Tick::Moved;
                continue;
            }
            // 2. As many primitives as follow each other are a run.
            if budget == 0 {
                return Tick::Moved;
            }
            if !wires.can_push(&self.output) {
                return did.or(Tick::Blocked);
            }
            let mut run = Run { slot, kind, sequence, first, count: 0 };
            while budget > 0
                && let Some(next) = self.input.front(wires, from)
                && next.kind == Kind::DATA
                && next.sequence == sequence
                && next.triangle == first + run.count
            {
                self.merge.take(wires, &mut self.input, from, next);
                run.count += 1;
                budget -= 1;
            }
            self.items += u64::from(run.count);
            wires.push(&self.output, run);
            did = Tick::Moved;
        }
    }
}

impl Unit<Card> for Gather {
    fn tick(&mut self, wires: &mut Wires, _: &mut Card) -> Tick {
        self.merge.begin(wires.now());
        self.input.poll(wires);
        let did = self.step(wires);
        self.merge.end(wires);
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.input.resident()
    }
}
