//! Triangles that are traversed together: those that wait, or batches of which all triangles that come here are there.

use super::{Traverse, TrianglePosition};
use crate::card::Card;
use crate::distribute::{Overlap, owners};
use crate::token::{Kind, TriangleToken};
use sim::{In, Wires};
use work::{End, Triangle};

/// The batch at the head.
#[derive(Clone)]
pub(super) struct Gather {
    /// Triangles of a draw in a batch.
    triangles: u32,
    /// How the receivers of triangles are found, how many there are, and which one this is.
    overlap: Overlap,
    rasterisers: usize,
    number: u8,
    /// Triangles that wait, and the last one of their batch that comes here.
    held: Vec<TriangleToken>,
    last: u32,
}

impl Gather {
    pub fn new(triangles: u32, overlap: Overlap, rasterisers: usize, number: u8) -> Gather {
        Gather { triangles, overlap, rasterisers, number, held: Vec::with_capacity(triangles as usize), last: 0 }
    }

    /// How many triangles wait.
    pub fn held(&self) -> u64 {
        self.held.len() as u64
    }

    /// The triangles of the batch, in their order. None are left.
    pub fn batch(&mut self) -> impl Iterator<Item = TriangleToken> + '_ {
        self.held.drain(..)
    }

    /// Takes in the triangles of the batch; whether they are all there, or something else is at the head.
    pub fn fill(&mut self, wires: &mut Wires, input: &In<TriangleToken>, card: &Card, moved: &mut bool) -> bool {
        loop {
            if self.held.last().is_some_and(|held| held.triangle >= self.last) {
                return true;
            }
            let Some(token) = wires.front(input) else { return false };
            let batch = |of: &TriangleToken| (of.slot, of.triangle / self.triangles);
            if token.kind != Kind::DATA || self.held.first().is_some_and(|first| batch(first) != batch(&token)) {
                return true;
            }
            wires.take(input);
            if self.held.is_empty() {
                self.last = self.last_of(card, token);
            }
            self.held.push(token);
            *moved = true;
        }
    }

    /// The last triangle of the batch of this one that comes here.
    fn last_of(&self, card: &Card, token: TriangleToken) -> u32 {
        let work = card.work(token.slot);
        let triangles = &work.segment.triangles;
        let end = (token.triangle / self.triangles + 1).saturating_mul(self.triangles).min(triangles.len() as u32);
        // Triangles that end in setup do not come here.
        let comes = |triangle: &Triangle| {
            triangle.end != End::Setup && owners(card, work, triangle, self.overlap, self.rasterisers) >> self.number & 1 != 0
        };
        (token.triangle + 1..end).rev().find(|&triangle| comes(&triangles[triangle as usize])).unwrap_or(token.triangle)
    }
}

impl Traverse {
    /// Takes a triangle in hand that is traversed together with others.
    fn begin_together(&mut self, card: &Card, token: TriangleToken) {
        self.begin(card, token);
        self.place.next = self.skip_foreign(card);
        self.together.push(self.place);
    }

    /// Takes the triangles that wait and may be traversed together with the current one.
    pub(super) fn join(&mut self, wires: &mut Wires, card: &Card) {
        let first = self.place;
        while (self.together.len() as u32) + 1 < self.config.triangles {
            let same = |token: &TriangleToken| {
                token.kind == Kind::DATA && (token.slot, token.sequence) == (first.slot, first.sequence)
            };
            let Some(token) = wires.front(&self.input).filter(same) else { break };
            wires.take(&self.input);
            self.begin_together(card, token);
        }
        self.place = first;
    }

    /// Begins the triangles of a batch, where batches are gathered. Returns false until all of its triangles that come here are there.
    pub(super) fn begin_gathered(&mut self, wires: &mut Wires, card: &Card, moved: &mut bool) -> bool {
        let Some(mut gather) = self.gather.take() else { return true };
        let complete = gather.fill(wires, &self.input, card, moved);
        if complete {
            for token in gather.batch() {
                self.begin_together(card, token);
                *moved = true;
            }
            self.place = self.together.pop().unwrap_or_default();
        }
        self.gather = Some(gather);
        complete
    }

    /// Continues with the triangle whose next block is the first on the screen, among those that are traversed together. If several have this
    /// block, the first of them. A triangle without more blocks ends before any other goes on.
    pub(super) fn choose(&mut self, card: &Card) {
        self.place.next = self.skip_foreign(card);
        let order = |place: &TrianglePosition| (place.next, place.triangle);
        for other in &mut self.together {
            if order(other) < order(&self.place) {
                std::mem::swap(other, &mut self.place);
            }
        }
    }
}
