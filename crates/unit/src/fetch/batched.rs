//! Vertices that can be used again within their batch only: primitives are taken whole, and a batch ends where the next one does not fit.

use super::super::card::Card;
use super::super::token::Run;
use super::Fetch;
use num::Cycle;
use sim::{Tick, Wires};
use work::Primitive;

/// The primitive that is read, and its vertices that the open batch has still to get.
#[derive(Clone, Debug, Default)]
pub(super) struct Reading {
    /// Its number in the segment, and the number after the last one of the walk.
    next: u32,
    end: u32,
    /// Vertices to be added, the next one last.
    adding: Vec<u32>,
    /// Indices of the primitives in the open batch.
    indices: u32,
}

impl Reading {
    /// A walk through `count` primitives begins.
    pub fn begin(&mut self, first: u32, count: u32) {
        (self.next, self.end) = (first, first + count);
    }

    /// A batch begins.
    pub fn clear(&mut self) {
        self.indices = 0;
    }
}

/// The number of different vertices of a primitive. A point repeats its vertex, a line its second one.
fn different(primitive: &Primitive) -> &[u32] {
    let [a, b, c] = primitive.vertices;
    let count = 1 + usize::from(b != a) + usize::from(c != b && c != a);
    &primitive.vertices[..count]
}

impl Fetch {
    /// Reads the current walk; it is no longer begun when all of it is read.
    pub(super) fn read_batches(
        &mut self,
        wires: &mut Wires,
        card: &mut Card,
        run: Run,
        here: u32,
        indices: &mut u32,
        lookups: &mut u32,
    ) -> Tick {
        let mut did = Tick::Starved;
        let work = card.work[usize::from(run.slot)].as_ref().expect("a piece is in flight");
        let segment = &work.segment;
        loop {
            // 1. The attributes of the current vertex.
            if self.vertex_open {
                let before = (self.attribute, self.attribute_line);
                let result = self.look_up(wires, work, lookups);
                if result.is_ok() || before != (self.attribute, self.attribute_line) {
                    did = Tick::Moved;
                }
                if let Err(stall) = result {
                    return did.or(stall);
                }
            }
            // 2. The vertices of the current primitive.
            if let Some(vertex) = self.reading.adding.pop() {
                // It may have been added since, as another vertex of the primitive.
                if self.forgotten(vertex) {
                    self.shaded_at[vertex as usize] = self.shaded;
                    self.shaded = self.shaded.wrapping_add(1);
                    card.funnel[run.slot].vertices_shaded += 1;
                    self.vertices.push_back(vertex);
                    self.open += 1;
                    self.open_slot = run.slot;
                    self.start_at = wires.now() + Cycle::from(self.config.patience);
                    (self.attribute, self.attribute_line, self.vertex_open) = (0, 0, !self.brought);
                }
                did = Tick::Moved;
                continue;
            }
            // 3. The indices of the next primitive, or what is left of the walk.
            let primitive = (self.reading.next < self.reading.end).then(|| &segment.primitives[self.reading.next as usize]);
            let until = primitive.map_or(self.walk.length, |primitive| self.walk.position(primitive.stream_end));
            if self.position < until {
                let stream = self.walk.ahead(segment, self.position, here.min(until).max(self.position));
                let stream = &stream[..stream.len().min(*indices as usize)];
                if stream.is_empty() {
                    return if *indices == 0 { Tick::Moved } else { did.or(Tick::Memory) };
                }
                let restarts = stream.iter().filter(|&&vertex| vertex == u32::MAX).count() as u64;
                *indices -= stream.len() as u32;
                self.position += stream.len() as u32;
                let read = stream.len() as u64 - restarts;
                self.items += read;
                // Vertices of a segment with primitives that go to all pipelines are counted where the segment is dealt.
                if self.counts && !work.has_shared() {
                    card.funnel[run.slot].vertices_in += read;
                }
                did = Tick::Moved;
                continue;
            }
            let Some(primitive) = primitive else { break };
            // 4. The primitive joins the open batch, or the next one if it does not fit.
            let vertices = different(primitive);
            let new = vertices.iter().filter(|&&vertex| self.forgotten(vertex)).count() as u32;
            let full = self.open + new > self.width || self.reading.indices + vertices.len() as u32 > self.config.batch_indices;
            if self.open > 0 && full {
                let before = self.reading.next.checked_sub(1).map_or(0, |last| segment.primitives[last as usize].stream_end);
                self.close_at(run.slot, before);
            }
            if self.open == 0 && self.in_flight >= self.config.batches {
                return did.or(Tick::Blocked);
            }
            self.reading.indices += vertices.len() as u32;
            self.reading.next += 1;
            self.reading.adding.extend(vertices.iter().rev());
            did = Tick::Moved;
        }
        self.end_walk(run);
        Tick::Moved
    }

    /// Whether the open batch does not have a vertex, or can no longer reuse it.
    #[inline(always)]
    fn forgotten(&self, vertex: u32) -> bool {
        self.shaded.wrapping_sub(self.shaded_at[vertex as usize]) > self.config.reuse.min(self.open)
    }
}
