//! The input of fetch in each of its four modes: segments, runs of primitives, and primitives that were routed or brought.

use super::super::card::{Card, is_newer};
use super::super::index_runs::Walk;
use super::super::token::{Kind, Run};
use super::{ENTRIES, Fetch, Gathered, Reuse};
use num::Cycle;
use sim::{Tick, Wires};

/// The name of no vertex: of a restart, or of a vertex of another draw.
pub(super) const NO_VERTEX: (u32, u32) = (u32::MAX, u32::MAX);

impl Fetch {
    /// Makes ready for a segment. What was shaded lately in the same draw is still there; a new draw starts afresh.
    #[cold]
    pub(super) fn begin(&mut self, card: &Card, slot: u16) {
        let work = card.work(slot);
        let vertices = &work.segment.vertices;
        self.shaded_at.clear();
        // A vertex that was never shaded stands as one of half the numbers ago; a segment is far shorter than that.
        self.shaded_at.resize(vertices.len(), self.shaded.wrapping_sub(1 << 31));
        if self.draw != Some(work.draw_number) {
            self.draw = Some(work.draw_number);
            if self.config.reuse_until == Reuse::Assembled {
                // Indices of the draw before are still on their way to assembly. They have their places, and name no vertex of this one.
                self.recent.iter_mut().for_each(|vertex| *vertex = NO_VERTEX);
            } else {
                self.recent.clear();
            }
        } else if !self.recent.is_empty() {
            let mut known: Vec<_> = self.recent.iter().enumerate().map(|(at, &vertex)| (vertex, at)).collect();
            known.sort_unstable();
            let first = self.shaded.wrapping_sub(self.recent.len() as u32);
            for (vertex, at) in vertices.iter().zip(&mut self.shaded_at) {
                // The last one that names it.
                let wanted = (vertex.index, vertex.instance);
                let behind = known.partition_point(|&(vertex, _)| vertex <= wanted);
                if let Some(&(_, place)) = known[..behind].last().filter(|(vertex, _)| *vertex == wanted) {
                    *at = first.wrapping_add(place as u32);
                }
            }
        }
        if is_newer(work.epoch, self.epoch) {
            self.epoch = work.epoch;
            self.tags.clear();
        }
        self.last_line = u64::MAX;
        self.last_needs = self.misses.frontier();
        self.segment = Some(work.number);
    }

    /// Takes a segment or a run in hand.
    pub(super) fn open(&mut self, card: &Card, run: Run) {
        let work = card.work(run.slot);
        if self.segment != Some(work.number) {
            self.begin(card, run.slot);
        }
        self.walk = if self.ports.input.in_runs() {
            self.announce(Kind::RUN, run.slot, run.sequence, run.first, run.count);
            self.reading.begin(run.first, run.count);
            Walk::run(&work.segment, &run)
        } else {
            self.reading.begin(0, work.segment.primitives.len() as u32);
            Walk::segment(&work.segment, &run)
        };
        self.position = 0;
        self.begun = true;
    }

    /// Puts a mark for assembly behind the batches.
    pub(super) fn announce(&mut self, kind: Kind, slot: u16, number: u32, stream_end: u32, count: u32) {
        self.gathered.push_back(Gathered { slot, number, stream_end, count, needs: None, kind });
    }

    /// Entries of the segment's stream that have been read, as far as primitives of the current run are concerned.
    #[inline(always)]
    pub(super) fn stream_end(&self) -> u32 {
        if self.begun && self.position >= self.walk.head_count { self.walk.entry(self.position) } else { 0 }
    }

    /// All of a segment or a run is read. What is left of a segment is a batch; what is left of a run waits for that of the next.
    pub(super) fn end_walk(&mut self, run: Run) {
        if self.ports.input.in_runs() {
            let waits = u32::from(self.open > 0);
            self.announce(Kind::PART, run.slot, self.number, self.stream_end(), waits);
        } else {
            self.close(run.slot);
        }
        self.begun = false;
    }

    /// With nothing that can be taken in hand: in time the open batch is started as it is, since assembly may wait for it.
    pub(super) fn wait(&mut self, wires: &mut Wires) -> Tick {
        if self.open == 0 {
            return Tick::Starved;
        }
        if self.start_at > wires.now() {
            wires.sleep_until(self.start_at);
            return Tick::Starved;
        }
        self.close(self.open_slot);
        Tick::Moved
    }

    /// Reads indices, finds vertices that must be shaded, looks up their attributes.
    #[inline(always)]
    pub(super) fn read(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut indices = self.config.indices_per_cycle;
        let mut lookups = self.config.lookups_per_cycle;
        loop {
            let Some(piece) = self.runs.front() else { return did.or(self.wait(wires)) };
            if !self.begun && self.gathered.len() > ENTRIES {
                return did.or(self.wait(wires).or(Tick::Blocked));
            }
            if piece.kind.is_fence() {
                // The batch of a run may still be open.
                if self.open > 0 {
                    self.close(self.open_slot);
                }
                self.announce(piece.kind, piece.slot, piece.sequence, 0, 0);
                self.runs.take();
                did = Tick::Moved;
                continue;
            }
            if piece.kind.is_end() {
                self.announce(piece.kind, piece.slot, piece.sequence, 0, 0);
                self.runs.take();
                did = Tick::Moved;
                continue;
            }
            if !self.begun {
                // A warp runs one program with one state, and vertices are known by their number in a segment.
                if self.open > 0 && self.segment != Some(card.work(piece.slot).number) {
                    self.close(self.open_slot);
                }
                self.open(card, piece);
                did = Tick::Moved;
            }
            let work = card.work[usize::from(piece.slot)].as_ref().expect("a piece is in flight");
            let length = self.walk.length;
            let here = self.runs.here(work, &self.walk, self.position);
            if self.config.reuse_until != Reuse::Replaced {
                let Fetch { position, .. } = *self;
                did = did.or(match self.config.reuse_until {
                    Reuse::Assembled => self.read_ahead(wires, card, piece.slot, here, &mut indices, &mut lookups),
                    _ => self.read_batches(wires, card, piece, here, &mut indices, &mut lookups),
                });
                if self.begun {
                    return if self.position > position { Tick::Moved } else { did };
                }
                self.runs.take();
                did = Tick::Moved;
                continue;
            }
            loop {
                // 1. The attributes of the current vertex.
                if self.vertex_open {
                    let before = (self.attribute, self.attribute_line);
                    let result = self.look_up(wires, work, &mut lookups);
                    if result.is_ok() || before != (self.attribute, self.attribute_line) {
                        did = Tick::Moved;
                    }
                    if let Err(stall) = result {
                        return did.or(stall);
                    }
                }
                // 2. A full batch goes on its way.
                if self.open == self.width {
                    self.close(piece.slot);
                    did = Tick::Moved;
                }
                if self.position == length {
                    break;
                }
                if self.in_flight >= self.config.batches {
                    return did.or(Tick::Blocked);
                }
                // 3. Indices of vertices that are still among the last few shaded need nothing more.
                let stream = self.walk.ahead(&work.segment, self.position, here.max(self.position));
                let mut vertex = u32::MAX;
                let (mut read, mut restarts) = (0, 0);
                for &next in &stream[..stream.len().min(indices as usize)] {
                    read += 1;
                    if next == u32::MAX {
                        restarts += 1;
                    } else if self.shaded.wrapping_sub(self.shaded_at[next as usize]) > self.config.reuse {
                        vertex = next;
                        break;
                    }
                }
                if read == 0 {
                    return if stream.is_empty() { did.or(Tick::Memory) } else { Tick::Moved };
                }
                did = Tick::Moved;
                indices -= read;
                self.position += read;
                self.items += u64::from(read - restarts);
                // Vertices of a segment with primitives that go to all pipelines are counted where the segment is dealt.
                if self.counts && !work.has_shared() {
                    card.funnel[piece.slot].vertices_in += u64::from(read - restarts);
                }
                if vertex == u32::MAX {
                    continue;
                }
                // 4. It must be shaded.
                self.shaded_at[vertex as usize] = self.shaded;
                self.shaded = self.shaded.wrapping_add(1);
                card.funnel[piece.slot].vertices_shaded += 1;
                if self.config.reuse > 0 {
                    if self.recent.len() as u32 == self.config.reuse {
                        self.recent.pop_front();
                    }
                    let vertex = &work.segment.vertices[vertex as usize];
                    self.recent.push_back((vertex.index, vertex.instance));
                }
                self.vertices.push_back(vertex);
                self.open += 1;
                self.open_slot = piece.slot;
                self.start_at = wires.now() + Cycle::from(self.config.patience);
                (self.attribute, self.attribute_line, self.vertex_open) = (0, 0, !self.brought);
            }
            // 5. All is read.
            self.end_walk(piece);
            self.runs.take();
            did = Tick::Moved;
        }
    }
}
