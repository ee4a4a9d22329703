//! Hidden-surface removal, one unit per pipeline of a binning machine: holds the opaque quads of a tile back until it is known which of
//! them are seen at the end, so that only these are shaded.

use std::collections::VecDeque;

use super::card::Card;
use super::token::fragments;
use super::token::{GroupToken, Kind, bytes};
use sim::{Budget, Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;
use work::BLOCK;

stats::counters! {
    /// What hidden-surface removal saves.
    pub struct HideCounts {
        /// Quads that passed their depth test and were covered by later opaque ones before they were shaded.
        hidden_quads: "quads",
        /// Fragments of these, and of others.
        hidden_fragments: "fragments",
    }
}

/// The last opaque quad that covers a place of the tile.
#[derive(Clone, Copy, Debug, Default)]
struct LastQuad {
    /// Its place in the queue, counted from the start; and which of the group's quads it is.
    group: u64,
    quad: u8,
    /// Samples in which it is the last.
    samples: u16,
}

/// Quads of a tile: at most 64 x 64 pixels.
const QUADS: usize = 32 * 32;

/// Opaque quads that cover a place of the tile one over the other, each in some samples.
const LAYERS: usize = 4;

/// Hidden-surface removal. Its items are quads.
#[derive(Clone)]
pub struct Hide {
    pipeline: u8,
    /// Blocks across a tile.
    side: u32,
    rate: u32,
    input: In<GroupToken>,
    output: Out<GroupToken>,
    /// Groups held back, and the number of the first of them.
    held: VecDeque<GroupToken>,
    first: u64,
    /// Groups at the front of the queue that are released.
    released: usize,
    seen: Vec<[LastQuad; LAYERS]>,
    counts: HideCounts,
    items: u64,
}

impl Hide {
    /// An empty unit for one pipeline and tiles of `side` blocks. It takes and gives `rate` quads per cycle.
    pub fn new(pipeline: u8, side: u32, rate: u32, input: In<GroupToken>, output: Out<GroupToken>) -> Hide {
        Hide {
            pipeline,
            side,
            rate,
            input,
            output,
            held: VecDeque::new(),
            first: 0,
            released: 0,
            seen: vec![[LastQuad::default(); LAYERS]; QUADS],
            counts: HideCounts::default(),
            items: 0,
        }
    }

    /// The counters of what the unit has saved.
    pub fn counts(&self) -> HideCounts {
        self.counts
    }

    /// Whether a group's quads replace the contents of all attachments, and only their coverage decides where.
    fn opaque(card: &Card, token: GroupToken, pipeline: usize) -> bool {
        let group = &card.groups[pipeline][token.group];
        let work = card.work(group.slot);
        let tile = &work.segment.tiles[group.tile as usize];
        let quads = &tile.quads[group.first as usize..][..usize::from(group.count)];
        let writes = |target: usize| {
            let state = work.colors.get(target).and_then(Option::as_ref);
            let slot = work.draw.targets.get(target).and_then(Option::as_ref);
            state.is_some_and(|state| !state.reads() && !state.is_idle()) && slot.is_some_and(|slot| slot.payload.is_some())
        };
        let Some(pass) = card.passes.current() else { return false };
        let whole = (0..pass.color.len()).all(|target| pass.color[target].is_none() || writes(target));
        // Where early tests may cull, shading has no effect other than its colours.
        let plain = work.early && work.draw.hierarchical_z && work.depth.as_ref().is_none_or(|depth| !depth.uses_stencil());
        plain && whole && quads.iter().all(|quad| quad.kept == quad.coverage)
    }

    /// Takes note of a group of opaque quads: what they cover of those held back is not seen.
    fn cover(&mut self, card: &mut Card, token: GroupToken) {
        let pipeline = usize::from(self.pipeline);
        let number = self.first + self.held.len() as u64;
        let group = card.groups[pipeline][token.group];
        let across = card.passes.current().map_or(1, |pass| pass.blocks_across);
        let (x, y) = (group.block % across % self.side, group.block / across % self.side);
        for index in 0..group.count {
            let live = group.live[usize::from(index)];
            if live == 0 {
                continue;
            }
            let work = card.work(group.slot);
            let quad = &work.segment.tiles[group.tile as usize].quads[group.first as usize + usize::from(index)];
            let position = u32::from(quad.position);
            let place = (y * BLOCK / 2 + position / 4) * 32 + x * BLOCK / 2 + position % 4;
            let layers = &mut self.seen[place as usize];
            for seen in layers.iter_mut().filter(|seen| seen.samples & live != 0) {
                let hidden = seen.samples & live;
                seen.samples &= !live;
                if seen.group < self.first {
                    continue;
                }
                let below = self.held[(seen.group - self.first) as usize];
                let below = &mut card.groups[pipeline][below.group].live[usize::from(seen.quad)];
                let before = fragments(*below);
                *below &= !hidden;
                self.counts.hidden_fragments += u64::from(before - fragments(*below));
                self.counts.hidden_quads += u64::from(*below == 0);
            }
            // A place without room forgets a layer: its quad is shaded, hidden or not.
            let free = layers.iter().position(|seen| seen.samples == 0).unwrap_or(0);
            layers[free] = LastQuad { group: number, quad: index, samples: live };
        }
    }

    /// All that is held back is released.
    fn release(&mut self) {
        self.released = self.held.len();
        self.seen.fill([LastQuad::default(); LAYERS]);
    }
}

impl Unit<Card> for Hide {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let pipeline = usize::from(self.pipeline);

        // 1. Released groups go on, without the quads that are not seen.
        let mut budget = Budget::new(self.rate);
        while self.released > 0 {
            let Some(&token) = self.held.front() else { break };
            if token.kind == Kind::DATA {
                let group = &card.groups[pipeline][token.group];
                let quads = group.live.iter().map(|&live| u8::from(live != 0)).sum::<u8>();
                if quads == 0 {
                    card.groups[pipeline].remove(token.group);
                } else {
                    if budget.left() == 0 {
                        return Tick::Moved;
                    }
                    if !wires.can_push(&self.output) {
                        return did.or(Tick::Blocked);
                    }
                    budget.take(u32::from(quads).min(budget.left()));
                    wires.push_sized(&self.output, GroupToken { quads, ..token }, u32::from(quads) * bytes::QUAD);
                    self.items += u64::from(quads);
                }
            } else {
                if !wires.can_push(&self.output) {
                    return did.or(Tick::Blocked);
                }
                wires.push_sized(&self.output, token, bytes::MARK);
            }
            self.held.pop_front();
            self.first += 1;
            self.released -= 1;
            did = Tick::Moved;
        }

        // 2. Opaque quads are held back; what is not opaque, and the end of the tile, release them and follow.
        let mut budget = Budget::new(self.rate);
        while self.released == 0
            && let Some(token) = wires.front(&self.input)
        {
            let opaque = token.kind == Kind::DATA && Hide::opaque(card, token, pipeline);
            if token.kind == Kind::DATA {
                if budget.left() == 0 {
                    return Tick::Moved;
                }
                budget.take(u32::from(token.quads).min(budget.left()));
            }
            if opaque {
                self.cover(card, token);
            }
            self.held.push_back(token);
            wires.take(&self.input);
            did = Tick::Moved;
            if !opaque {
                self.release();
            }
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.held.len() as u64
    }

    fn counted(groups: &mut Counted<Self>) {
        let heading = Heading::new("hiding.hide[i]", "Hidden-surface removal, where it is on.");
        groups.group(heading, |unit| unit.counts);
    }
}
