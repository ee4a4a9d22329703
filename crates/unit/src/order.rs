//! The order at the ROP, one unit per pipeline of a machine that sorts fragments: takes quads from all pipelines in the order of their
//! sequence numbers, or as they come where order does not matter, and hands them to the ROP's tests and blending.

use super::card::Card;
use super::network::Receiver;
use super::sorting::{Ended, Keep, OrderClock, OrderCounts};
use super::token::{GroupToken, Kind, bytes};
use sim::{Budget, Out, StallProbe, Tick, Unit, Wires};

/// The order at a ROP. Its items are quads.
#[derive(Clone)]
pub struct Order {
    pipeline: u8,
    /// Quads per cycle.
    rate: u32,
    /// From all pipelines.
    input: Receiver<GroupToken>,
    /// To the depth test, and straight to the colour unit.
    late: Out<GroupToken>,
    color: Out<GroupToken>,
    keep: Keep,
    ended: Ended,
    /// Place in the ROP's order.
    place: u32,
    clock: OrderClock,
    items: u64,
}

impl Order {
    /// An order unit at the beginning of the order, which hands on `rate` quads per cycle. The state of `probe` is what it waits for.
    pub fn new(
        pipeline: u8,
        rate: u32,
        keep: Keep,
        probe: StallProbe,
        input: Receiver<GroupToken>,
        late: Out<GroupToken>,
        color: Out<GroupToken>,
    ) -> Order {
        Order {
            pipeline,
            rate,
            input,
            late,
            color,
            keep,
            ended: Ended::default(),
            place: 0,
            clock: OrderClock::new(probe),
            items: 0,
        }
    }

    /// The counters of the unit.
    pub fn counts(&self) -> OrderCounts {
        self.clock.counts()
    }

    /// Whether a token may be taken now.
    #[inline(always)]
    fn due(&self, card: &Card, token: &GroupToken) -> bool {
        match token.kind {
            kind if kind.is_end() => true,
            Kind::DATA if self.keep == Keep::Never => true,
            Kind::DATA => {
                let group = &card.groups[usize::from(self.pipeline)][token.group];
                self.ended.before(card.work(group.slot).order_from.unwrap_or(token.sequence))
            }
            _ => self.ended.before(token.sequence),
        }
    }
}

impl Order {
    fn step(&mut self, wires: &mut Wires, card: &Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = Budget::new(self.rate);
        loop {
            // 1. Something that may be taken.
            let Some((from, token)) = self.input.find(wires, |token| self.due(card, token)) else {
                let here = self.input.find(wires, |_| true).is_some();
                self.clock.wait(wires.now(), here, true);
                return did;
            };

            // 2. The end of a number.
            if token.kind.is_end() {
                // If all pipelines draw a number, each sends the end of its part.
                let parts = if token.kind == Kind::PART_END { self.input.senders() } else { 1 };
                self.ended.note_part(token.sequence, parts);
                self.input.take(wires, from);
                did = Tick::Moved;
                continue;
            }

            // 3. Quads go to their tests, or straight to the colour unit if there are none; fences follow them there.
            let tested = token.kind == Kind::DATA && {
                let group = &card.groups[usize::from(self.pipeline)][token.group];
                card.work(group.slot).depth.is_some()
            };
            let output = if tested { &self.late } else { &self.color };
            if budget.left() == 0 {
                return Tick::Moved;
            }
            if !wires.can_push(output) {
                return did.or(Tick::Blocked);
            }
            let size = if token.kind == Kind::DATA { u32::from(token.quads).max(1) * bytes::QUAD } else { bytes::MARK };
            wires.push_sized(output, GroupToken { sequence: self.place, ..token }, size);
            self.place = self.place.wrapping_add(1);
            self.input.take(wires, from);
            did = Tick::Moved;
            if token.kind == Kind::DATA {
                let quads = u32::from(token.quads).max(1);
                budget.take(quads.min(budget.left()));
                self.items += u64::from(token.quads);
            } else {
                self.ended.note(token.sequence);
            }
        }
    }
}

impl Unit<Card> for Order {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        self.clock.begin(wires.now());
        self.input.poll(wires);
        let did = self.step(wires, card);
        self.clock.end(wires);
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.input.resident()
    }
}
