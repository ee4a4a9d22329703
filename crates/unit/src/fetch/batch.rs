//! Batches of vertices: looked up, closed, handed to shading and assembly.

use super::super::card::{Card, Work};
use super::super::token::{Kind, VertexBatch, WarpToken};
use super::super::warp::Item;
use super::{Fetch, Gathered};
use crate::assembly::MAX_BATCHES;
use gfx::stage::Stage;
use gfx::state::StepMode;
use num::Cycle;
use sim::{Tick, Wires};

impl Fetch {
    /// Looks up the lines of the current vertex's attributes.
    #[inline(always)]
    pub(super) fn look_up(&mut self, wires: &mut Wires, work: &Work, budget: &mut u32) -> Result<(), Tick> {
        let Some(&vertex) = self.vertices.back() else { return Ok(()) };
        let vertex = &work.segment.vertices[vertex as usize];
        // A power of two: divisions of 64 bits are slow.
        let line_shift = self.config.line_bytes.trailing_zeros();
        for fetch in work.draw.attributes.get(self.attribute..).unwrap_or_default() {
            let element = match fetch.step {
                StepMode::Vertex => vertex.index,
                StepMode::Instance => vertex.instance,
            };
            let address = fetch.address + u64::from(element) * fetch.stride;
            let first = address >> line_shift;
            let last = (address + u64::from(fetch.bytes.max(1)) - 1) >> line_shift;
            let mut line = first + self.attribute_line;
            while line <= last {
                // The same line as just before, for this vertex or the one before, is not looked up again.
                if line != self.last_line
                    && let Err(stall) = self.look_up_line(wires, line, budget)
                {
                    self.attribute_line = line - first;
                    return Err(stall);
                }
                if !self.misses.reached(self.last_needs) {
                    self.open_needs = self.misses.later(self.open_needs, self.last_needs);
                }
                line += 1;
            }
            self.attribute += 1;
            self.attribute_line = 0;
        }
        self.vertex_open = false;
        Ok(())
    }

    /// Looks up a line of attributes, and requests it if it is missing.
    #[inline(always)]
    fn look_up_line(&mut self, wires: &mut Wires, line: u64, budget: &mut u32) -> Result<(), Tick> {
        if *budget == 0 {
            return Err(Tick::Moved);
        }
        self.last_needs = if let Some(place) = self.tags.find(line) {
            *self.tags.data(place)
        } else {
            if self.misses.room() == 0 {
                return Err(Tick::Memory);
            }
            if !self.ports.vertex.can_send(wires) {
                return Err(Tick::Blocked);
            }
            let tag = self.misses.issue();
            let bytes = self.config.line_bytes;
            self.ports.vertex.read(wires, line * u64::from(bytes), bytes, tag);
            let place = self.tags.victim(line, |_| true).expect("any line may go");
            self.tags.replace(place, line, self.misses.issued());
            self.misses.issued()
        };
        *budget -= 1;
        self.last_line = line;
        Ok(())
    }

    /// Closes the open batch, at what has been read of the stream.
    pub(super) fn close(&mut self, slot: u16) {
        self.close_at(slot, self.stream_end());
    }

    /// Closes the open batch. Once it is shaded, the stream can be assembled up to entry `stream_end`.
    pub(super) fn close_at(&mut self, slot: u16, stream_end: u32) {
        let Fetch { number, open: count, open_needs: needs, .. } = *self;
        let batch = Gathered { slot, number, stream_end, count, needs, kind: Kind::DATA };
        self.gathered.push_back(batch);
        // A batch without vertices needs no number: assembly does not wait for it.
        if count > 0 {
            self.closed.push_back(batch);
            self.number = number.wrapping_add(1);
            self.in_flight += 1;
            assert!(self.in_flight <= MAX_BATCHES, "assembly has a flag for each batch in flight");
        }
        self.open = 0;
        self.open_needs = None;
        self.reading.clear();
    }

    /// Starts batches on cores when their attributes are there, and announces what has been read to assembly, each in order.
    #[inline(always)]
    pub(super) fn start(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        while let Some(&batch) = self.closed.front() {
            if let Err(stall) = self.shade(wires, card, batch) {
                did = did.or(stall);
                break;
            }
            self.closed.pop_front();
            did = Tick::Moved;
        }
        while let Some(&Gathered { slot, kind, number, stream_end, count, .. }) = self.gathered.front() {
            let token = VertexBatch { slot, kind, number, stream_end, vertices: count };
            if !wires.try_push(&self.ports.batches, token) {
                return did.or(Tick::Blocked);
            }
            self.gathered.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Starts a batch on a core.
    #[inline(always)]
    pub(super) fn shade(&mut self, wires: &mut Wires, card: &mut Card, batch: Gathered) -> Result<(), Tick> {
        if batch.needs.is_some_and(|needs| !self.misses.reached(needs)) {
            return Err(Tick::Memory);
        }
        if self.way_free > wires.now() {
            wires.sleep_until(self.way_free);
            return Err(Tick::Working);
        }
        let cores = &self.ports.cores;
        let Some(core) = self.deal.choose(wires.now(), |core| wires.can_push(&cores[core].1)) else {
            return Err(Tick::Blocked);
        };
        self.deal.dealt(wires.now(), core);
        if self.config.vertices_per_cycle > 0 {
            self.way_free = wires.now() + Cycle::from(batch.count.div_ceil(self.config.vertices_per_cycle));
        }
        let (cluster, output) = &self.ports.cores[core];
        let Card { work, warps, .. } = card;
        let work = work[usize::from(batch.slot)].as_ref().expect("a batch's segment is in flight");
        let index = warps[*cluster].insert(Stage::Vertex, batch.slot, work.draw.shape(Stage::Vertex).registers);
        let warp = &mut warps[*cluster][index];
        warp.number = batch.number;
        for vertex in self.vertices.drain(..batch.count as usize) {
            let vertex = &work.segment.vertices[vertex as usize];
            warp.items.push(Item::new(0, vertex.first_request, vertex.cost));
        }
        warp.merge(|_| &work.segment.invocations[Stage::Vertex].costs);
        wires.push(output, WarpToken { warp: index });
        Ok(())
    }
}
