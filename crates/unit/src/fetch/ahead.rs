//! Vertices that can be used again until they are assembled: indices are read ahead of attributes, up to as many as are on their way to
//! assembly at a time.

use super::super::card::Card;
use super::Fetch;
use super::input::NO_VERTEX;
use sim::{Tick, Wires};

impl Fetch {
    /// Assembly has taken `passed` indices since the start. Vertices that no later index names are forgotten.
    pub(super) fn pass(&mut self, passed: u32) {
        let first = self.shaded.wrapping_sub(self.recent.len() as u32);
        // Vertices of a draw before this one are forgotten already.
        let gone = (passed.wrapping_sub(first) as i32).max(0) as usize;
        self.recent.drain(..gone.min(self.recent.len()));
    }

    /// Reads the current segment; it is no longer begun when all of it is read and all its batches are closed.
    pub(super) fn read_ahead(
        &mut self,
        wires: &mut Wires,
        card: &mut Card,
        slot: u16,
        here: u32,
        indices: &mut u32,
        lookups: &mut u32,
    ) -> Tick {
        // 1. Indices.
        let mut did = self.read_indices(card, slot, here, indices);
        let full = self.recent.len() as u32 == self.config.reuse;

        // 2. Attributes, of one vertex after the other.
        let work = card.work[usize::from(slot)].as_ref().expect("a piece is in flight");
        loop {
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
            if self.open == self.width {
                self.close_ahead(slot, self.open_end);
                did = Tick::Moved;
            }
            if self.waiting.is_empty() {
                break;
            }
            if self.in_flight >= self.config.batches {
                return did.or(Tick::Blocked);
            }
            let Some((vertex, end)) = self.waiting.pop_front() else { break };
            self.vertices.push_back(vertex);
            self.open += 1;
            (self.open_slot, self.open_end) = (slot, end);
            (self.attribute, self.attribute_line, self.vertex_open) = (0, 0, true);
            did = Tick::Moved;
        }

        // 3. The rest of a segment is a batch, too. So are the vertices that assembly has to take before more is read, once it has taken all others.
        if self.position == self.walk.length {
            self.close_ahead(slot, self.position);
            self.closed_end = 0;
            self.begun = false;
            return Tick::Moved;
        }
        if full && self.in_flight == 0 && self.closed_end < self.position {
            self.close_ahead(slot, self.position);
            return Tick::Moved;
        }
        did
    }

    fn close_ahead(&mut self, slot: u16, end: u32) {
        self.close_at(slot, end);
        self.closed_end = end;
    }

    /// Finds out which vertices must be shaded of the indices that are here.
    fn read_indices(&mut self, card: &mut Card, slot: u16, here: u32, indices: &mut u32) -> Tick {
        let work = card.work[usize::from(slot)].as_ref().expect("a piece is in flight");
        let segment = &work.segment;
        let stream = self.walk.ahead(segment, self.position, here.max(self.position));
        let (mut read, mut restarts, mut shaded) = (0_u64, 0_u64, 0_u64);
        let mut why = if self.position < self.walk.length { Tick::Memory } else { Tick::Starved };
        for &next in stream {
            if *indices == 0 {
                break;
            }
            if self.recent.len() as u32 == self.config.reuse {
                why = Tick::Blocked;
                break;
            }
            let mut name = NO_VERTEX;
            if next == u32::MAX {
                restarts += 1;
            } else {
                let on_its_way = self.recent.len() as u32;
                if self.shaded.wrapping_sub(self.shaded_at[next as usize]) > on_its_way {
                    if self.waiting.len() as u32 == self.config.ahead {
                        why = Tick::Blocked;
                        break;
                    }
                    self.waiting.push_back((next, self.position + 1));
                    shaded += 1;
                }
                self.shaded_at[next as usize] = self.shaded;
                let vertex = &segment.vertices[next as usize];
                name = (vertex.index, vertex.instance);
            }
            self.recent.push_back(name);
            self.shaded = self.shaded.wrapping_add(1);
            self.position += 1;
            *indices -= 1;
            read += 1;
        }
        self.items += read - restarts;
        card.funnel[slot].vertices_in += read - restarts;
        card.funnel[slot].vertices_shaded += shaded;
        if read > 0 { Tick::Moved } else { why }
    }
}
