//! Dealing: parts the primitives of segments into numbered batches and gives each to a pipeline whose geometry is its own.
//!
//! What is drawn is taken in the order of numbers by units behind the pipelines. A pipeline can send on ahead of its turn only what the
//! receivers have places for, and can hold only what its shaded quads have places for: what exceeds both is drawn while all others wait. So
//! batches end by size, and a primitive that alone is too large goes to all pipelines, each of which draws its own tiles of it.

use super::assembly::{AssemblyConfig, Deal as Policy};
use super::card::{Card, Work};
use super::sorting::{Keep, Opaque, any_order};
use super::token::{Kind, Piece, Run};
use sim::{In, Out, Tick, Unit, Wires};
use work::End;

/// Dealing. Its items are batches.
#[derive(Clone)]
pub struct Deal {
    policy: Policy,
    /// Primitives of a batch.
    batch: u32,
    input: In<Piece>,
    /// To each pipeline.
    outputs: Vec<Out<Run>>,
    /// The next primitive of the current segment, and whether the segment has begun.
    next: u32,
    begun: bool,
    /// The next sequence number.
    sequence: u32,
    /// The pipeline whose turn it is.
    turn: usize,
    /// Groups of quads at which a batch ends; none: batches end by primitives only.
    most: Option<u32>,
    /// The pipelines that have still to get the current item, a bit each.
    pending: u64,
    run: Option<Run>,
    /// The pipelines that have the batch just dealt; the mark of the batch's end is still to be sent to them.
    open: u64,
    /// Whether quads of opaque draws may come in any order.
    relaxed: bool,
    /// The first number since which all draws are opaque and of one kind, the kind, and the pass in which.
    opaque: Option<(u32, Opaque, u32)>,
    /// Whether fences go to all pipelines, and not to one that passes them on.
    everyone: bool,
    /// Primitives of the pass that are dealt.
    dealt: u64,
    items: u64,
}

/// The groups of quads at which batches end by size. A sender can send this number on ahead of its turn to one receiver, which has places for
/// `receive_queue` parcels, the mark behind them included, and it has places for the shaded quads.
pub fn most_groups(receive_queue: u32, reorder: u32, warp_width: u32) -> u32 {
    let ahead = (receive_queue * 3 / 4).saturating_sub(1);
    ahead.min(reorder * warp_width / 16).max(1)
}

/// The groups of four quads that rasterisation is expected to make of a primitive: one for each of its triangles that is drawn, and what half
/// of their bounding boxes holds.
fn groups(work: &Work, primitive: usize) -> u64 {
    let of = &work.segment.primitives[primitive];
    let triangles = &work.segment.triangles[of.first_triangle as usize..][..usize::from(of.triangles)];
    let size = |[x0, y0, x1, y1]: [u16; 4]| u64::from(x1.saturating_sub(x0)) * u64::from(y1.saturating_sub(y0));
    let drawn = triangles.iter().filter(|triangle| triangle.end == End::Nowhere && triangle.visits > 0);
    drawn.map(|triangle| 1 + size(triangle.pixels) / 32).sum()
}

impl Deal {
    /// An idle unit. With `everyone` fences go to all pipelines, and not to one that passes them on. With `most`, batches end at that number
    /// of groups of quads, and larger primitives go to all pipelines.
    pub fn new(
        config: &AssemblyConfig,
        keep: Keep,
        everyone: bool,
        most: Option<u32>,
        input: In<Piece>,
        outputs: Vec<Out<Run>>,
    ) -> Deal {
        let sized = config.by_size && config.deal != Policy::Contiguous && outputs.len() > 1;
        Deal {
            policy: config.deal,
            batch: config.batch,
            input,
            outputs,
            next: 0,
            begun: false,
            sequence: 0,
            turn: 0,
            most: most.filter(|_| sized),
            pending: 0,
            run: None,
            open: 0,
            relaxed: keep == Keep::WhereNeeded,
            opaque: None,
            everyone,
            dealt: 0,
            items: 0,
        }
    }

    /// Notes from which number on the quads of a segment, which is dealt from now on, may come in any order.
    fn relax(&mut self, card: &mut Card, slot: u16) {
        let pass = card.pass_of(slot).map_or(0, |pass| pass.number);
        self.opaque = any_order(card.work(slot)).map(|kind| match self.opaque {
            Some((first, same, in_pass)) if same == kind && in_pass == pass => (first, kind, pass),
            _ => (self.sequence, kind, pass),
        });
        if let Some(work) = &mut card.work[usize::from(slot)] {
            work.order_from = self.opaque.map(|(first, _, _)| first);
        }
    }

    /// All pipelines, a bit each.
    fn all(&self) -> u64 {
        u64::MAX >> (64 - self.outputs.len())
    }

    /// Sends a run or a mark to those pipelines of a set that have room; gives the others.
    fn send(&self, wires: &mut Wires, to: u64, run: Run) -> u64 {
        let mut left = to;
        for (n, output) in self.outputs.iter().enumerate() {
            if to >> n & 1 == 1 && wires.try_push(output, run) {
                left &= !(1 << n);
            }
        }
        left
    }

    /// Which primitives of a segment go to all pipelines; empty if none do.
    pub(super) fn too_large(&self, work: &Work) -> Vec<bool> {
        let Some(most) = self.most else { return Vec::new() };
        let primitives = 0..work.segment.primitives.len();
        let shared: Vec<bool> = primitives.map(|primitive| groups(work, primitive) > u64::from(most)).collect();
        if shared.contains(&true) { shared } else { Vec::new() }
    }

    /// Notes which primitives of a segment go to all pipelines, and counts them: each comes to several.
    fn share(&self, card: &mut Card, slot: u16) {
        let shared = self.too_large(card.work(slot));
        if shared.is_empty() {
            return;
        }
        let funnel = &mut card.funnel[slot];
        let work = card.work[usize::from(slot)].as_mut().expect("a piece's segment is in flight");
        // A batch that ends within a strip reads again what the next one needs, so vertices are counted here, once.
        funnel.vertices_in += work.segment.stream.iter().filter(|&&vertex| vertex != u32::MAX).count() as u64;
        for primitive in
            work.segment.primitives.iter().zip(&shared).filter(|&(_, &shared)| shared).map(|(primitive, _)| primitive)
        {
            funnel.primitives_in += 1;
            funnel.end(primitive, 1);
            funnel.clipped += u64::from(primitive.clipped);
            funnel.triangles_setup += u64::from(primitive.triangles);
        }
        work.shared = shared;
    }

    /// The primitives of a batch that begins with `first`, from 1 to `at_most`; and whether all pipelines draw them. Primitives that are too
    /// large are noted in `work` before.
    fn batch_of(&self, work: &Work, first: u32, at_most: u32) -> (u32, bool) {
        let Some(most) = self.most else { return (at_most, false) };
        let shared = work.is_shared(first);
        let same = (first..first + at_most).take_while(|&primitive| work.is_shared(primitive) == shared);
        if shared {
            return (same.count() as u32, true);
        }
        let mut sum = 0;
        let fits = |&primitive: &u32| {
            sum += groups(work, primitive as usize);
            sum <= u64::from(most)
        };
        (same.take_while(fits).count() as u32, false)
    }

    /// The pipeline whose run of the pass the next primitive is in, and how many more are.
    fn run_of(&self, primitives: u64) -> (usize, u64) {
        let pipelines = self.outputs.len() as u64;
        let end = |pipeline: u64| primitives * (pipeline + 1) / pipelines;
        let pipeline = (0..pipelines).find(|&pipeline| self.dealt < end(pipeline)).unwrap_or(pipelines - 1);
        (pipeline as usize, end(pipeline).saturating_sub(self.dealt).max(1))
    }

    /// Takes turns for a segment that is warmed with: one for each batch of primitives, and one for the mark behind them. Gives for each
    /// primitive the pipeline that would draw it; none if all do.
    pub(super) fn visit(&mut self, work: &Work) -> Vec<Option<usize>> {
        let primitives = work.segment.primitives.len() as u32;
        let mut dealt = Vec::with_capacity(primitives as usize);
        while (dealt.len() as u32) < primitives {
            let first = dealt.len() as u32;
            let (count, shared) = self.batch_of(work, first, self.batch.min(primitives - first));
            let pipeline = (!shared).then_some(self.turn);
            dealt.resize((first + count) as usize, pipeline);
            self.turn = (self.turn + 1) % self.outputs.len();
        }
        self.turn = (self.turn + 1) % self.outputs.len();
        dealt
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
            // 1. Send the item that is on its way to several pipelines.
            if let Some(run) = self.run {
                let left = self.send(wires, self.pending, run);
                if left != self.pending {
                    did = Tick::Moved;
                }
                self.pending = left;
                if left != 0 {
                    return did.or(Tick::Blocked);
                }
                self.run = None;
                if run.kind != Kind::DATA {
                    self.advance();
                }
            }
            let Some(Piece { slot, kind }) = wires.front(&self.input) else { return did };

            // 2. The end of the batch just dealt.
            let sequence = self.sequence;
            if self.open != 0 {
                let kind = if self.open.count_ones() == 1 { Kind::END } else { Kind::PART_END };
                self.run = Some(Run { slot, kind, sequence, first: 0, count: 0 });
                self.pending = std::mem::take(&mut self.open);
                continue;
            }

            // 3. All of a segment is dealt.
            let left = if kind == Kind::DATA { card.work(slot).segment.primitives.len() as u32 - self.next } else { 0 };
            if kind == Kind::DATA && left == 0 {
                (self.next, self.begun) = (0, false);
                wires.take(&self.input);
                did = Tick::Moved;
                continue;
            }

            if kind == Kind::DATA && !self.begun {
                self.begun = true;
                if self.relaxed {
                    self.relax(card, slot);
                }
                self.share(card, slot);
            }

            // 4. A fence for all.
            if kind != Kind::DATA && self.everyone {
                self.run = Some(Run { slot, kind, sequence, first: 0, count: 0 });
                self.pending = self.all();
                if kind == Kind::PASS {
                    self.dealt = 0;
                }
                wires.take(&self.input);
                did = Tick::Moved;
                continue;
            }

            // 5. A batch, or a fence with a number of its own.
            let (output, most) = match (self.policy, card.passes.current()) {
                (Policy::Contiguous, Some(pass)) => self.run_of(pass.primitives),
                _ => (self.policy.choose(wires, &self.outputs, self.turn), u64::MAX),
            };
            let data = kind == Kind::DATA;
            let to_all = data && card.work(slot).is_shared(self.next);
            if !to_all && !wires.can_push(&self.outputs[output]) {
                return did.or(Tick::Blocked);
            }
            let at_most = left.min(self.batch).min(most.min(u64::from(u32::MAX)) as u32);
            let (count, shared) = if data { self.batch_of(card.work(slot), self.next, at_most) } else { (0, false) };
            let run = Run { slot, kind, sequence, first: self.next, count };
            if shared {
                (self.run, self.pending, self.open) = (Some(run), self.all(), self.all());
            } else {
                wires.push(&self.outputs[output], run);
                self.open = if data { 1 << output } else { 0 };
            }
            did = Tick::Moved;
            if kind == Kind::DATA {
                self.next += count;
                self.dealt += u64::from(count);
                self.items += 1;
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
        u64::from(self.open != 0) + u64::from(self.run.is_some())
    }
}
