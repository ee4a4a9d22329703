//! The resolve unit, one per pipeline: turns the samples of its own blocks of a finished attachment into pixels, block after block.

use std::collections::VecDeque;

use super::card::Card;
use super::compression::Compression;
use super::frame::{BlockState, FrameBuffers};
use super::misses::Misses;
use super::token::{Ack, Kind, Piece};
use gfx::format::Format;
use gfx::rop;
use knob::Allowed;
use mem::{self, MemoryPort};
use num::Cycle;
use sim::{In, Out, Tick, Unit, Wires};

knob::knobs! {
    /// Resolving of multisampled attachments.
    pub struct ResolveConfig {
        /// The cycles that a block of 8x8 pixels takes in each pipeline's unit.
        block_cycles: u32 ["cycles/block", Allowed::Range(1, 256), "assumed: 16 pixels of four samples per cycle"]
            {estimate: Used, relax: Interval, advice: []},
        /// Requests to memory in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory"]
            {estimate: RefusedUnless(AtLeast(64), "resolves with few requests in flight"), relax: Room, advice: []},
    }
}

/// Writes that may wait before no further block is resolved: those of the largest block, twice.
const WRITES: usize = 8;

/// A transfer to come.
#[derive(Clone, Copy, Debug)]
pub(super) struct Operation {
    pub(super) address: u64,
    pub(super) bytes: u32,
}

/// The piece that asks for a colour attachment of the pass in a slot, by its location.
pub fn piece_of(pass: u8, location: u16) -> Piece {
    Piece { slot: u16::from(pass) << 8 | location, kind: Kind::DATA }
}

/// The slot of a pass and the location of its attachment.
fn attachment_of(piece: Piece) -> (u8, usize) {
    ((piece.slot >> 8) as u8, usize::from(piece.slot & 0xff))
}

/// A pipeline's resolve unit. Its items are blocks.
#[derive(Clone)]
pub struct Resolve {
    config: ResolveConfig,
    pipeline: u8,
    /// How blocks of pixels are written: as the colour unit writes them.
    compression: Compression,
    input: In<Piece>,
    output: Out<Ack>,
    memory: MemoryPort,
    misses: Misses,
    /// Reads and writes waiting for the port.
    reads: VecDeque<Operation>,
    writes: VecDeque<Operation>,
    /// The unit's blocks of the current attachment, once they are known.
    blocks: Option<Vec<u32>>,
    /// Next of them to be read and to be resolved.
    asked: usize,
    /// A number for each block that was asked for: the block is here when all misses before this number are back.
    waiting: VecDeque<u32>,
    resolved: usize,
    free_at: Cycle,
    items: u64,
}

impl Resolve {
    /// An idle unit of a pipeline, which writes blocks with some compression.
    pub fn new(
        config: ResolveConfig,
        pipeline: u8,
        compression: Compression,
        input: In<Piece>,
        output: Out<Ack>,
        memory: MemoryPort,
    ) -> Resolve {
        Resolve {
            misses: Misses::new(config.misses),
            reads: VecDeque::new(),
            writes: VecDeque::new(),
            blocks: None,
            asked: 0,
            waiting: VecDeque::new(),
            resolved: 0,
            free_at: 0,
            items: 0,
            config,
            pipeline,
            compression,
            input,
            output,
            memory,
        }
    }
}

/// Cuts a run of bytes into requests.
pub(super) fn requests(address: u64, bytes: u32, queue: &mut VecDeque<Operation>) -> u32 {
    let before = queue.len();
    queue.extend(mem::requests(address, bytes).map(|(address, bytes)| Operation { address, bytes }));
    (queue.len() - before) as u32
}

/// Resolves a block of one surface into another; the values of both are those of a format.
fn resolve_block(frame: &mut FrameBuffers, format: Format, from: usize, to: usize, block: u32) {
    if from == to {
        return;
    }
    let (low, high) = frame.stores.split_at_mut(from.max(to));
    let (source, target) = if from < to { (&low[from], &mut high[0]) } else { (&high[0], &mut low[to]) };
    let samples = source.surface.samples as usize;
    let words = target.words as usize;
    for position in 0..16_u8 {
        let quad = &source.block(block)[usize::from(position) * 4 * words * samples..][..4 * words * samples];
        let resolved = target.quad_mut(block, position);
        for p in 0..4 {
            // A pixel's samples lie apart in the run of its quad.
            let mut texels = [0; 16];
            let mut pixel = [0; 4];
            for s in 0..samples {
                for w in 0..words {
                    texels[s * words + w] = quad[(s * words + w) * 4 + p];
                }
            }
            rop::resolve(format, &texels[..samples * words], &mut pixel[..words]);
            for w in 0..words {
                resolved[4 * w + p] = pixel[w];
            }
        }
    }
}

impl Unit<Card> for Resolve {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Memory.
        while let Some(tag) = self.memory.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }
        // Reads go first: they are short, and what they bring is waited for.
        while let Some(&Operation { address, bytes }) = self.reads.front() {
            if self.misses.room() == 0 || !self.memory.can_send(wires) {
                break;
            }
            let tag = self.misses.issue();
            self.memory.read(wires, address, bytes, tag);
            self.reads.pop_front();
            did = Tick::Moved;
        }
        while let Some(&Operation { address, bytes }) = self.writes.front() {
            if !self.memory.can_send(wires) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.memory.write(wires, address, bytes);
            self.writes.pop_front();
            did = Tick::Moved;
        }

        // 2. The current attachment.
        let Some(piece) = wires.front(&self.input) else { return did };
        let Card { passes, frame, interleave, .. } = card;
        let (slot, location) = attachment_of(piece);
        let pass = passes.get(slot).expect("a pass is ending");
        let attachment = pass.pass.color[location];
        let resolved = attachment.and_then(|attachment| Some((attachment.surface.format, attachment.resolve?)));
        let (Some(from), Some((format, target))) = (pass.color[location], resolved) else {
            wires.pop(&self.input);
            return Tick::Moved;
        };
        let to = frame.surface(&target);
        let blocks = self.blocks.get_or_insert_with(|| {
            let (count, across) = (frame.stores[from].blocks.len() as u32, frame.stores[from].across);
            (0..count).filter(|block| interleave.owner(block % across, block / across) == self.pipeline).collect()
        });

        // 3. Resolve the next block whose samples are there, if there is place for its pixels behind the write that waits.
        if let Some(&needs) = self.waiting.front() {
            if !self.misses.reached(needs) {
                did = did.or(Tick::Memory);
            } else if self.free_at > wires.now() {
                wires.sleep_until(self.free_at);
                did = did.or(Tick::Working);
            } else if self.writes.len() < WRITES {
                let block = blocks[self.resolved];
                resolve_block(frame, format, from, to, block);
                let store = &mut frame.stores[to];
                let bytes = self.compression.bytes(store, block);
                store.blocks[block as usize] = BlockState::Stored(bytes as u16);
                requests(store.address(block), bytes, &mut self.writes);
                self.waiting.pop_front();
                self.resolved += 1;
                self.items += 1;
                self.free_at = wires.now() + Cycle::from(self.config.block_cycles);
                did = Tick::Moved;
            }
        }

        // 4. Ask for the samples of the next.
        while self.asked < blocks.len() && self.reads.is_empty() && self.waiting.len() < self.config.misses as usize {
            let store = &frame.stores[from];
            let stored = store.stored(blocks[self.asked]);
            let count = stored.map_or(0, |(address, bytes)| requests(address, bytes, &mut self.reads));
            self.waiting.push_back(self.misses.issued().wrapping_add(count));
            self.asked += 1;
            did = Tick::Moved;
        }

        // 5. All done.
        if self.resolved == blocks.len() && self.writes.is_empty() {
            if !wires.try_push(&self.output, Ack { slot: piece.slot, kind: Kind::DATA }) {
                return did.or(Tick::Blocked);
            }
            wires.pop(&self.input);
            (self.blocks, self.asked, self.resolved) = (None, 0, 0);
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.waiting.len() as u64 + u64::from(self.misses.in_flight())
    }
}
