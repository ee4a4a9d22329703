//! Gathering, one unit a pipeline of a sort-first machine: takes the primitives that were routed to the pipeline from all that route,
//! in the order of their sequence numbers, and hands them to the pipeline's geometry in runs.

use super::card::Card;
use super::network::Receiver;
use super::sorting::{Ended, Keep, OrderClock, OrderCounts};
use super::token::{Kind, Run, TriangleToken};
use crate::sim::{Out, Tick, Unit, Wires};

/// Gathering. Its items are primitives.
pub struct Gather {
    /// Primitives a cycle.
    rate: u32,
    input: Receiver<TriangleToken>,
    output: Out<Run>,
    /// The sequence number that is being taken, and who sends it, once it is known.
    sequence: u32,
    current: Option<usize>,
    keep: Keep,
    /// What has ended, where no order is kept.
    ended: Ended,
    clock: OrderClock,
    items: u64,
}

impl Gather {
    /// One at the beginning of the order, which takes so many primitives a cycle.
    pub fn new(rate: u32, keep: Keep, input: Receiver<TriangleToken>, output: Out<Run>) -> Gather {
        Gather {
            rate,
            input,
            output,
            sequence: 0,
            current: None,
            keep,
            ended: Ended::default(),
            clock: OrderClock::default(),
            items: 0,
        }
    }

    /// What it has counted.
    pub fn counts(&self) -> OrderCounts {
        self.clock.counts()
    }

    /// The next token in order, and who sends it, if it is here.
    fn next(&mut self, wires: &mut Wires) -> Option<(usize, TriangleToken)> {
        if let Some(from) = self.current {
            return Some((from, self.input.front(wires, from)?));
        }
        let sought = |token: &TriangleToken| match self.keep {
            Keep::Never => self.ended.takes(token.kind, token.sequence),
            _ => token.sequence == self.sequence,
        };
        let (from, token) = self.input.find(wires, sought)?;
        if self.keep != Keep::Never {
            self.current = Some(from);
        }
        Some((from, token))
    }
}

impl Unit<Card> for Gather {
    fn tick(&mut self, wires: &mut Wires, _: &mut Card) -> Tick {
        self.clock.begin(wires.now());
        self.input.poll(wires);
        let mut did = Tick::Starved;
        let mut budget = self.rate;
        loop {
            let Some((from, token)) = self.next(wires) else {
                if self.input.find(wires, |_| true).is_some() {
                    self.clock.wait(wires.now());
                }
                return did;
            };
            let TriangleToken { slot, kind, sequence, triangle: first } = token;
            // 1. A number has ended; a fence, which has one of its own, goes on.
            if kind != Kind::DATA {
                if kind != Kind::END && !wires.try_push(&self.output, Run { slot, kind, sequence, first: 0, count: 0 }) {
                    return did.or(Tick::Blocked);
                }
                self.input.take(wires, from);
                if self.keep == Keep::Never {
                    self.ended.note(sequence);
                }
                self.sequence = self.sequence.wrapping_add(1);
                self.current = None;
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
                self.input.take(wires, from);
                run.count += 1;
                budget -= 1;
            }
            self.items += u64::from(run.count);
            wires.push(&self.output, run);
            did = Tick::Moved;
        }
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.input.resident()
    }
}
