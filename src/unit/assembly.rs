//! Primitive assembly: takes vertex batches in order, waits until they are shaded, and hands out primitives to the geometry units.

use super::card::Card;
use super::token::{Kind, Run, VertexBatch, WarpToken};
use crate::sim::{Budget, In, Out, Tick, Unit, Wires};
use crate::unit::knob::Allowed;

crate::knobs! {
    /// Primitive assembly.
    pub struct AssemblyConfig {
        /// Primitives assembled a cycle.
        primitives_per_cycle: u32 ["primitives/cycle", Allowed::Range(1, 16),
            "ATTILA bGPU.ini PRIMITIVEASSEMBLY TrianglesCycle = 2; cards from 2010 on assemble 1 to 4"],
        /// Primitives that get one sequence number and go to one geometry unit before the next one's turn.
        batch: u32 ["primitives", Allowed::Range(1, 1024),
            "GPUs switch geometry engines every 16 to 64 primitives; small enough to balance, large enough to amortise marks"],
        /// Cycles from here to the geometry units.
        latency: u32 ["cycles", Allowed::Range(1, 64), "ATTILA bGPU.ini InputBusLatency = 10, less what shading adds here"],
        /// Runs of primitives queued before each geometry unit.
        queue: u32 ["runs", Allowed::Range(2, 1024), "ATTILA bGPU.ini AssemblyQueueSize = 32"],
    }
}

/// Batches that can be shaded but not yet assembled: bounds the ring of flags.
pub const MAX_BATCHES: u32 = 1024;

/// Ports of primitive assembly.
pub struct AssemblyPorts {
    /// Batches in order, from vertex fetch.
    pub batches: In<VertexBatch>,
    /// Shaded batches, from each cluster's cores; the token's warp is the batch number.
    pub shaded: Vec<In<WarpToken>>,
    /// Batches whose vertices are no longer needed, to vertex fetch.
    pub retired: Out<WarpToken>,
    /// Primitives, to each geometry unit.
    pub geometry: Vec<Out<Run>>,
}

/// Primitive assembly. Its items are primitives.
pub struct Assembly {
    config: AssemblyConfig,
    ports: AssemblyPorts,
    /// Which batches are shaded, by number modulo [`MAX_BATCHES`].
    done: Vec<bool>,
    /// The next primitive of the current segment.
    next: u32,
    /// Sequence number of the current batch of primitives, and how many are in it.
    sequence: u32,
    in_batch: u32,
    items: u64,
}

impl Assembly {
    /// An empty one.
    pub fn new(config: AssemblyConfig, ports: AssemblyPorts) -> Assembly {
        Assembly { config, ports, done: vec![false; MAX_BATCHES as usize], next: 0, sequence: 0, in_batch: 0, items: 0 }
    }

    /// The output whose turn it is.
    #[inline(always)]
    fn output(&self) -> &Out<Run> {
        &self.ports.geometry[self.sequence as usize % self.ports.geometry.len()]
    }

    fn next_sequence(&mut self) {
        self.sequence = self.sequence.wrapping_add(1);
        self.in_batch = 0;
    }

    /// Ends the open sequence number. With one geometry unit there is nothing to merge and no mark is sent.
    fn close(&mut self, wires: &mut Wires, slot: u16) -> bool {
        if self.ports.geometry.len() > 1 {
            let run = Run { slot, kind: Kind::END, sequence: self.sequence, first: 0, count: 0 };
            if !wires.try_push(self.output(), run) {
                return false;
            }
        }
        self.next_sequence();
        true
    }
}

impl Unit<Card> for Assembly {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Note the batches that cores have shaded.
        for shaded in &self.ports.shaded {
            while let Some(batch) = wires.pop(shaded) {
                self.done[(batch.warp % MAX_BATCHES) as usize] = true;
                did = Tick::Moved;
            }
        }

        // 2. Assemble primitives of the batch at the head, as far as its vertices go.
        let mut budget = Budget::new(self.config.primitives_per_cycle);
        while let Some(batch) = wires.front(&self.ports.batches) {
            if batch.kind == Kind::DATA {
                if batch.vertices > 0 && !self.done[(batch.number % MAX_BATCHES) as usize] {
                    // Shaders are at work: another item will come.
                    return did.or(Tick::Starved);
                }
                let work = card.work(batch.slot);
                let primitives = &work.segment.primitives[self.next as usize..];
                let room = self.config.batch - self.in_batch;
                let most = primitives.len().min(room.min(budget.left()) as usize);
                let count = primitives[..most].iter().take_while(|p| p.stream_end <= batch.stream_end).count() as u32;
                if count > 0 {
                    let run = Run { slot: batch.slot, kind: Kind::DATA, sequence: self.sequence, first: self.next, count };
                    if !wires.try_push(self.output(), run) {
                        return did.or(Tick::Blocked);
                    }
                    budget.take(count);
                    self.next += count;
                    self.in_batch += count;
                    self.items += u64::from(count);
                    card.funnel.primitives_in += u64::from(count);
                    did = Tick::Moved;
                }
                if self.in_batch == self.config.batch {
                    if !self.close(wires, batch.slot) {
                        return did.or(Tick::Blocked);
                    }
                    did = Tick::Moved;
                }
                let more = card.work(batch.slot).segment.primitives.get(self.next as usize);
                if more.is_some_and(|p| p.stream_end <= batch.stream_end) {
                    if budget.left() == 0 {
                        return Tick::Moved;
                    }
                    continue;
                }
            } else {
                // A mark has a sequence number of its own.
                if self.in_batch > 0 {
                    if !self.close(wires, batch.slot) {
                        return did.or(Tick::Blocked);
                    }
                    did = Tick::Moved;
                }
                let run = Run { slot: batch.slot, kind: batch.kind, sequence: self.sequence, first: 0, count: 0 };
                if !wires.try_push(self.output(), run) {
                    return did.or(Tick::Blocked);
                }
                self.next_sequence();
                did = Tick::Moved;
            }

            // 3. The batch is used up: its vertices may be overwritten.
            if batch.kind == Kind::DATA && batch.vertices > 0 {
                if !wires.try_push(&self.ports.retired, WarpToken { warp: batch.number }) {
                    return did.or(Tick::Blocked);
                }
                self.done[(batch.number % MAX_BATCHES) as usize] = false;
            }
            if batch.kind == Kind::SEGMENT {
                self.next = 0;
            }
            wires.pop(&self.ports.batches);
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.done.iter().filter(|&&done| done).count() as u64
    }
}
