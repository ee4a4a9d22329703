//! Dealing: parts the primitives of segments into numbered batches and gives each to a pipeline whose geometry is its own.

use super::assembly::{AssemblyConfig, Deal as Policy};
use super::card::Card;
use super::sorting::{Keep, Opaque, any_order};
use super::token::{Kind, Piece, Run};
use sim::{In, Out, Tick, Unit, Wires};

/// Dealing. Its items are batches.
#[derive(Clone)]
pub struct Deal {
    policy: Policy,
    /// Primitives of a batch.
    batch: u32,
    input: In<Piece>,
    /// To each pipeline.
    outputs: Vec<Out<Run>>,
    /// The next primitive of the current segment.
    next: u32,
    /// The next sequence number.
    sequence: u32,
    /// The pipeline whose turn it is.
    turn: usize,
    /// The pipeline that has the batch just dealt; the mark of the batch's end is still to be sent to it.
    open: Option<usize>,
    /// Whether quads of opaque draws may come in any order.
    relaxed: bool,
    /// The first number since which all draws are opaque and of one kind, the kind, and the pass in which.
    opaque: Option<(u32, Opaque, u32)>,
    /// Whether fences go to all pipelines, and not to one that passes them on; and the pipelines that have still to get the current fence.
    everyone: bool,
    waiting: u64,
    /// Primitives of the pass that are dealt.
    dealt: u64,
    items: u64,
}

impl Deal {
    /// An idle one. With `everyone` fences go to all pipelines, and not to one that passes them on.
    pub fn new(config: &AssemblyConfig, keep: Keep, everyone: bool, input: In<Piece>, outputs: Vec<Out<Run>>) -> Deal {
        Deal {
            policy: config.deal,
            batch: config.batch,
            input,
            outputs,
            next: 0,
            sequence: 0,
            turn: 0,
            open: None,
            relaxed: keep == Keep::WhereNeeded,
            opaque: None,
            everyone,
            waiting: 0,
            dealt: 0,
            items: 0,
        }
    }

    /// Notes from which number on the quads of a segment, which is dealt from now on, may come in any order.
    fn relax(&mut self, card: &mut Card, slot: u16) {
        let pass = card.pass.as_ref().map_or(0, |pass| pass.number);
        self.opaque = any_order(card.work(slot)).map(|kind| match self.opaque {
            Some((first, same, in_pass)) if same == kind && in_pass == pass => (first, kind, pass),
            _ => (self.sequence, kind, pass),
        });
        if let Some(work) = &mut card.work[usize::from(slot)] {
            work.order_from = self.opaque.map(|(first, _, _)| first);
        }
    }

    /// Sends a fence to all that have room; whether any had.
    fn fence(&mut self, wires: &mut Wires, fence: Run) -> bool {
        let mut moved = false;
        if self.waiting == 0 {
            self.waiting = u64::MAX >> (64 - self.outputs.len());
        }
        for (n, output) in self.outputs.iter().enumerate() {
            if self.waiting >> n & 1 == 1 && wires.try_push(output, fence) {
                self.waiting &= !(1 << n);
                moved = true;
            }
        }
        moved
    }

    /// The pipeline whose run of the pass the next primitive is in, and how many more are.
    fn run_of(&self, primitives: u64) -> (usize, u64) {
        let pipelines = self.outputs.len() as u64;
        let end = |pipeline: u64| primitives * (pipeline + 1) / pipelines;
        let pipeline = (0..pipelines).find(|&pipeline| self.dealt < end(pipeline)).unwrap_or(pipelines - 1);
        (pipeline as usize, end(pipeline).saturating_sub(self.dealt).max(1))
    }

    /// The pipeline that gets a primitive of a segment that is warmed with: the one whose turn it is then.
    pub(super) fn dealt(&self, primitive: u32) -> usize {
        (self.turn + (primitive / self.batch) as usize) % self.outputs.len()
    }

    /// Takes turns for a segment that is warmed with: one for each batch of primitives, and one for the mark behind them.
    pub(super) fn visit(&mut self, primitives: usize) {
        self.turn = (self.turn + primitives.div_ceil(self.batch as usize) + 1) % self.outputs.len();
    }

    /// The next in turn.
    fn advance(&mut self) {
        self.turn = (self.turn + 1) % self.outputs.len();
        self.sequence = self.sequence.wrapping_add(1);
    }
}

impl Unit<Card> for Deal {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        loop {
            let Some(Piece { slot, kind }) = wires.front(&self.input) else { return did };

            // 1. The end of the batch just dealt.
            let sequence = self.sequence;
            if let Some(output) = self.open {
                let end = Run { slot, kind: Kind::END, sequence, first: 0, count: 0 };
                if !wires.try_push(&self.outputs[output], end) {
                    return did.or(Tick::Blocked);
                }
                self.open = None;
                self.advance();
                did = Tick::Moved;
                continue;
            }

            // 2. All of a segment is dealt.
            let left = if kind == Kind::DATA { card.work(slot).segment.primitives.len() as u32 - self.next } else { 0 };
            if kind == Kind::DATA && left == 0 {
                self.next = 0;
                wires.take(&self.input);
                did = Tick::Moved;
                continue;
            }

            if self.relaxed && kind == Kind::DATA && self.next == 0 {
                self.relax(card, slot);
            }

            // 3. A fence for all.
            if kind != Kind::DATA && self.everyone {
                if self.fence(wires, Run { slot, kind, sequence, first: 0, count: 0 }) {
                    did = Tick::Moved;
                }
                if self.waiting != 0 {
                    return did.or(Tick::Blocked);
                }
                if kind == Kind::PASS {
                    self.dealt = 0;
                }
                wires.take(&self.input);
                self.advance();
                did = Tick::Moved;
                continue;
            }

            // 4. A batch, or a fence with a number of its own.
            let (output, most) = match (self.policy, &card.pass) {
                (Policy::Contiguous, Some(pass)) => self.run_of(pass.primitives),
                _ => (self.policy.choose(wires, &self.outputs, self.turn), u64::MAX),
            };
            let count = left.min(self.batch).min(most.min(u64::from(u32::MAX)) as u32);
            let run = Run { slot, kind, sequence, first: self.next, count };
            if !wires.try_push(&self.outputs[output], run) {
                return did.or(Tick::Blocked);
            }
            did = Tick::Moved;
            if kind == Kind::DATA {
                self.next += count;
                self.dealt += u64::from(count);
                self.items += 1;
                self.open = Some(output);
            } else {
                wires.take(&self.input);
                self.advance();
            }
        }
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.open.is_some())
    }
}
