//! The cache of a ROP: lines are blocks of 8x8 pixels, cleared by flag, compressed as they leave, fetched compressed.

use std::collections::VecDeque;

use super::block_sets::{BlockSets, Squares};
use super::compression::Compression;
use super::frame::{BlockState, FrameBuffers, Store};
use super::misses::Misses;
use super::tags::{CacheCounts, Tags};
use super::touch::{Touch, Touching};
use mem::{MemoryPort, requests};
use sim::{Tick, Wires};
use stats::Heading;
use work::BLOCK;

/// The heading of the ROPs' caches in the statistics.
pub const ROP: Heading = Heading::new(
    "rop.NAME[i]",
    "What the depth and colour caches of the ROPs moved, and those of early tests; the last is of `depth` only.",
);

stats::counters! {
    /// What a ROP cache moves.
    pub struct BlockCounts {
        /// Blocks filled from a clear flag, without memory.
        cleared_fills: "blocks",
        /// Blocks read from memory.
        fills: "blocks",
        /// Blocks written to memory.
        write_backs: "blocks",
        /// Blocks written that compression had made smaller.
        compressed: "blocks",
        /// Bytes that compression kept from being written.
        bytes_saved: "bytes",
        /// Blocks that were not read because all that was kept of them was written anew.
        overwritten: "blocks",
    }
}

/// Quads of a block, a bit each by their position: what a user writes whole of it, and what in part or reads.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Quads {
    /// Quads that are written whole.
    pub whole: u16,
    /// Quads of which something is kept or read.
    pub part: u16,
}

impl Quads {
    /// All of a block may be read.
    pub const ANY: Quads = Quads { whole: 0, part: u16::MAX };
}

/// The state of a block in the cache.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// Its data are there when all misses before this number are back.
    needs: u32,
    /// Users between lookup and use.
    pins: u32,
    dirty: bool,
    /// Places of its set that it takes.
    places: u32,
    /// Quads that are in memory only: the block has not been read, and they have not been written since.
    absent: u16,
}

/// A transfer to come.
#[derive(Clone, Copy, Debug)]
struct Operation {
    address: u64,
    bytes: u32,
    write: bool,
}

/// How a cache of blocks differs from the plain one.
#[derive(Clone, Copy, Debug, Default)]
pub struct Policy {
    /// Which set is a block's.
    pub sets: BlockSets,
    /// Whether memory takes parts of a block that is stored raw. If so, unwritten parts are never read just to be written back.
    pub masked: bool,
}

/// A ROP's cache of blocks.
#[derive(Clone)]
pub struct BlockCache {
    /// See [`Policy::masked`].
    masked: bool,
    /// Gives a block's set by its place; none: the set is folded from the key.
    squares: Option<Squares>,
    tags: Tags<Line>,
    /// Places of each set that blocks take.
    taken: Vec<u32>,
    misses: Misses,
    outbox: VecDeque<Operation>,
    memory: MemoryPort,
    compression: Compression,
    counts: BlockCounts,
    /// The position of writing back. Before it, the parts that are missing in the blocks to be written back are read.
    flushing: usize,
    completing: usize,
}

/// Bytes of a place: a block of pixels of 32 bits.
pub const PLACE: u32 = 4 * BLOCK * BLOCK;

/// The quads of a block that lie in its surface.
fn inside(store: &Store, block: u32) -> u16 {
    let (x, y) = (block % store.across * BLOCK, block / store.across * BLOCK);
    let quads = |size: u32, from: u32| (size - from).div_ceil(2).min(BLOCK / 2);
    let row = (1_u32 << quads(store.surface.width, x)) - 1;
    (0..quads(store.surface.height, y)).fold(0, |mask, y| mask | (row << (4 * y)) as u16)
}

/// Operations that may wait for the memory port: enough for the largest block's write-back and fill.
const OUTBOX: usize = 48;

impl BlockCache {
    /// An empty cache of `lines` places for blocks of pixels of 32 bits, `ways` to a set, with at most `misses` requests in flight. A block
    /// with more bytes takes several places of its set, all of them at most.
    pub fn new(lines: u32, ways: u32, misses: u32, compression: Compression, memory: MemoryPort) -> BlockCache {
        let tags = Tags::new(lines, ways);
        BlockCache {
            masked: false,
            squares: None,
            taken: vec![0; tags.sets() as usize],
            tags,
            misses: Misses::new(misses),
            outbox: VecDeque::with_capacity(OUTBOX),
            memory,
            compression,
            counts: BlockCounts::default(),
            flushing: 0,
            completing: 0,
        }
    }

    /// This cache with another policy.
    pub fn with(mut self, policy: Policy) -> BlockCache {
        self.masked = policy.masked;
        if policy.sets == BlockSets::Position {
            self.tags = self.tags.unfolded();
            self.squares = Some(Squares::of_sets(self.tags.sets()));
        }
        self
    }

    #[inline(always)]
    fn key(&self, store: &Store, surface: usize, block: u32) -> u64 {
        let number = self.squares.map_or(block, |squares| squares.number(block, store.across));
        (surface as u64) << 32 | u64::from(number)
    }

    /// Surface and block of a key.
    #[inline(always)]
    fn of_key(&self, frame: &FrameBuffers, key: u64) -> (usize, u32) {
        let (surface, number) = ((key >> 32) as usize, key as u32);
        (surface, self.squares.map_or(number, |squares| squares.block(number, frame.stores[surface].across)))
    }

    /// The counters of its tags.
    pub fn cache(&self) -> CacheCounts {
        self.tags.counts()
    }

    /// The counters of what it moved.
    pub fn counts(&self) -> BlockCounts {
        self.counts
    }

    /// Requests waiting or in flight.
    pub fn resident(&self) -> u64 {
        self.outbox.len() as u64 + u64::from(self.misses.in_flight())
    }

    /// Takes answers and sends requests; true if anything moved.
    #[inline(always)]
    pub fn exchange(&mut self, wires: &mut Wires) -> bool {
        let mut moved = false;
        while let Some(tag) = self.memory.answer(wires) {
            self.misses.answer(tag);
            moved = true;
        }
        while let Some(&operation) = self.outbox.front() {
            if !operation.write && self.misses.room() == 0 || !self.memory.can_send(wires) {
                break;
            }
            if operation.write {
                self.memory.write(wires, operation.address, operation.bytes);
            } else {
                let tag = self.misses.issue();
                self.memory.read(wires, operation.address, operation.bytes, tag);
            }
            self.outbox.pop_front();
            moved = true;
        }
        moved
    }

    /// Reads in the outbox and so without a number yet.
    fn unsent(&self) -> u32 {
        self.outbox.iter().filter(|operation| !operation.write).count() as u32
    }

    /// Places of its set that a block of a surface takes.
    #[inline(always)]
    fn places(&self, store: &Store) -> u32 {
        store.block_bytes().div_ceil(PLACE).min(self.tags.ways() as u32)
    }

    /// Forgets the block in a place.
    fn forget_block(&mut self, place: usize) {
        self.taken[place / self.tags.ways()] -= self.tags.data(place).places;
        self.tags.forget(place);
    }

    /// Puts a block into a place, instead of what is there.
    #[inline(always)]
    fn replace(&mut self, place: usize, key: u64, line: Line) {
        let taken = &mut self.taken[place / self.tags.ways()];
        *taken = *taken - self.tags.data(place).places + line.places;
        self.tags.replace(place, key, line);
    }

    /// The place that a missing block takes, or one that has to be given up before it finds room; and whether it finds room then.
    #[inline(always)]
    fn room(&mut self, key: u64, places: u32) -> Option<(usize, bool)> {
        let (set, ways) = (self.tags.set_of(key), self.tags.ways() as u32);
        if self.taken[set] + places <= ways {
            return Some((self.tags.victim(key, |line| line.pins == 0)?, true));
        }
        let place = self.tags.oldest(key, |line| line.pins == 0)?;
        let fits = self.taken[set] - self.tags.data(place).places + places <= ways;
        Some((place, fits))
    }

    fn send(&mut self, address: u64, bytes: u32, write: bool) {
        self.outbox.extend(requests(address, bytes).map(|(address, bytes)| Operation { address, bytes, write }));
    }

    /// Writes a dirty block back. Of one that is stored raw and was not read, only lines are written that hold anything new of it.
    fn write_back(&mut self, frame: &mut FrameBuffers, surface: usize, block: u32, absent: u16) {
        let store = &mut frame.stores[surface];
        let full = store.block_bytes();
        if absent != 0 {
            self.counts.write_backs += 1;
            let (address, row) = (store.address(block), full / (BLOCK / 2));
            let written = inside(store, block) & !absent;
            for k in (0..BLOCK / 2).filter(|k| written >> (4 * k) & 15 != 0) {
                self.send(address + u64::from(k * row), row, true);
            }
            return;
        }
        let bytes = self.compression.bytes(store, block);
        self.counts.write_backs += 1;
        if bytes < full {
            self.counts.compressed += 1;
            self.counts.bytes_saved += u64::from(full - bytes);
        }
        store.blocks[block as usize] = BlockState::Stored(bytes as u16);
        let address = store.address(block);
        self.send(address, bytes, true);
    }

    /// Reads what is absent of a block in the cache.
    fn complete(&mut self, frame: &FrameBuffers, place: usize) {
        let Some(key) = self.tags.key(place) else { return };
        let (surface, block) = self.of_key(frame, key);
        if let Some((address, bytes)) = frame.stores[surface].stored(block) {
            self.counts.fills += 1;
            self.send(address, bytes, false);
        }
        let needs = self.misses.issued().wrapping_add(self.unsent());
        let line = self.tags.data(place);
        (line.absent, line.needs) = (0, needs);
    }

    /// Pins a block in the cache and says in which place, bringing it in if it is missing and any of it is needed: `quads` says what
    /// of it is. Of a dirty block that had to leave, the number is put into `left`.
    ///
    /// # Errors
    /// Why it has to wait.
    #[inline(always)]
    pub fn pin(
        &mut self,
        frame: &mut FrameBuffers,
        surface: usize,
        block: u32,
        quads: Quads,
        left: &mut Option<(usize, u32)>,
    ) -> Result<usize, Tick> {
        let key = self.key(&frame.stores[surface], surface, block);
        if let Some(place) = self.tags.find(key) {
            let line = self.tags.data(place);
            line.pins += 1;
            if line.absent != 0 {
                return self.add(frame, place, quads);
            }
            return Ok(place);
        }
        self.fill(frame, surface, block, quads, left)
    }

    /// Goes on with a pinned block of which something is absent.
    #[inline(never)]
    fn add(&mut self, frame: &FrameBuffers, place: usize, quads: Quads) -> Result<usize, Tick> {
        let absent = self.tags.data(place).absent;
        if quads.part & absent == 0 {
            let absent = absent & !quads.whole;
            self.tags.data(place).absent = absent;
            self.counts.overwritten += u64::from(absent == 0);
            return Ok(place);
        }
        if self.outbox.len() + 16 > OUTBOX {
            self.tags.data(place).pins -= 1;
            return Err(Tick::Blocked);
        }
        self.complete(frame, place);
        Ok(place)
    }

    #[inline(never)]
    fn fill(
        &mut self,
        frame: &mut FrameBuffers,
        surface: usize,
        block: u32,
        quads: Quads,
        left: &mut Option<(usize, u32)>,
    ) -> Result<usize, Tick> {
        // A block is at most 16 requests each way.
        if self.outbox.len() + 32 > OUTBOX {
            return Err(Tick::Blocked);
        }
        let key = self.key(&frame.stores[surface], surface, block);
        let places = self.places(&frame.stores[surface]);
        let Some((place, fits)) = self.room(key, places) else { return Err(Tick::Memory) };
        if let Some(old) = self.tags.key(place)
            && self.tags.data(place).dirty
        {
            let Line { absent, needs, .. } = *self.tags.data(place);
            if absent != 0 && !self.masked {
                self.complete(frame, place);
                return Err(Tick::Moved);
            }
            if !self.misses.reached(needs) {
                return Err(Tick::Memory);
            }
            let (surface, block) = self.of_key(frame, old);
            self.write_back(frame, surface, block, absent);
            *left = Some((surface, block));
        }
        if !fits {
            // A block goes in a cycle.
            self.forget_block(place);
            return Err(Tick::Moved);
        }
        let store = &frame.stores[surface];
        let mut absent = 0;
        // A block that is not read waits for nothing.
        let mut needs = self.misses.frontier();
        // A block that is compressed, or that lies in another copy's memory, has to be read before a part of it is written.
        let raw = matches!(store.blocks[block as usize], BlockState::Stored(_));
        match store.stored(block) {
            Some((_, bytes))
                if quads.whole != 0 && quads.part == 0 && (!self.masked || raw && bytes == store.block_bytes()) =>
            {
                absent = inside(store, block) & !quads.whole;
                self.counts.overwritten += u64::from(absent == 0);
            }
            stored => {
                match stored {
                    None => self.counts.cleared_fills += 1,
                    Some((address, bytes)) => {
                        self.counts.fills += 1;
                        self.send(address, bytes, false);
                    }
                }
                needs = self.misses.issued().wrapping_add(self.unsent());
            }
        }
        self.replace(place, key, Line { needs, pins: 1, dirty: false, places, absent });
        Ok(place)
    }

    /// Has a block used without any time, while none is pinned: it is here then, what had to leave is in memory, and nothing is
    /// counted. Gives the dirty blocks that had to leave.
    pub fn visit(
        &mut self,
        frame: &mut FrameBuffers,
        (surface, block): (usize, u32),
        written: bool,
        memory: &mut Touching,
    ) -> Vec<(usize, u32)> {
        let key = self.key(&frame.stores[surface], surface, block);
        let counts = self.tags.counts();
        let mut left = Vec::new();
        let mut place = self.tags.find(key);
        if place.is_none() {
            let places = self.places(&frame.stores[surface]);
            while let Some((victim, fits)) = self.room(key, places) {
                if let Some(old) = self.tags.key(victim).filter(|_| self.tags.data(victim).dirty) {
                    let (surface, block) = self.of_key(frame, old);
                    let store = &mut frame.stores[surface];
                    let bytes = self.compression.bytes(store, block);
                    store.blocks[block as usize] = BlockState::Stored(bytes as u16);
                    memory.push(Touch { port: self.memory.number, address: store.address(block), bytes, write: true });
                    left.push((surface, block));
                }
                if !fits {
                    self.forget_block(victim);
                    continue;
                }
                if let Some((address, bytes)) = frame.stores[surface].stored(block) {
                    memory.push(Touch { port: self.memory.number, address, bytes, write: false });
                }
                let needs = self.misses.frontier();
                self.replace(victim, key, Line { needs, places, ..Line::default() });
                place = Some(victim);
                break;
            }
        }
        self.tags.recount(counts);
        if let Some(place) = place {
            let line = self.tags.data(place);
            line.dirty |= written;
            line.absent = 0;
        }
        left
    }

    /// Whether the data of a pinned block have arrived.
    #[inline(always)]
    pub fn ready(&mut self, place: usize) -> bool {
        let needs = self.tags.data(place).needs;
        self.misses.reached(needs)
    }

    /// A pinned block has been used.
    #[inline(always)]
    pub fn release(&mut self, place: usize, written: bool) {
        let line = self.tags.data(place);
        line.pins -= 1;
        line.dirty |= written;
    }

    /// Writes all dirty blocks back, as fast as memory takes them, and forgets everything; `keep` says for a surface whether its
    /// blocks are worth writing. `None` while there is more to do or in flight, with what was done; each block that is written
    /// back is passed to `left`.
    pub fn flush(&mut self, frame: &mut FrameBuffers, keep: impl Fn(usize) -> bool) -> Tick {
        let mut did = Tick::Memory;
        while self.completing < self.tags.len() {
            if self.outbox.len() + 16 > OUTBOX {
                return did.or(Tick::Blocked);
            }
            let place = self.completing;
            self.completing += 1;
            let line = *self.tags.data(place);
            if !self.masked
                && line.dirty
                && line.absent != 0
                && self.tags.key(place).is_some_and(|key| keep((key >> 32) as usize))
            {
                self.complete(frame, place);
                return Tick::Moved;
            }
        }
        while self.flushing < self.tags.len() {
            if self.outbox.len() + 16 > OUTBOX {
                return did.or(Tick::Blocked);
            }
            let place = self.flushing;
            if let Some(key) = self.tags.key(place) {
                let (surface, block) = self.of_key(frame, key);
                let Line { dirty, needs, absent, .. } = *self.tags.data(place);
                let written = dirty && keep(surface);
                if written && !self.misses.reached(needs) {
                    return did.or(Tick::Memory);
                }
                self.flushing += 1;
                if written {
                    self.write_back(frame, surface, block, absent);
                }
                self.forget_block(place);
                // One block per cycle goes through the compressor.
                return Tick::Moved;
            }
            self.flushing += 1;
            did = Tick::Moved;
        }
        did
    }

    /// [`BlockCache::flush`] at the end of a tile: what is not worth writing is forgotten without taking time.
    pub fn flush_tile(&mut self, frame: &mut FrameBuffers, keep: impl Fn(usize) -> bool) -> Tick {
        while self.flushing < self.tags.len() {
            let place = self.flushing;
            let key = self.tags.key(place);
            let written = key.is_some_and(|key| self.tags.data(place).dirty && keep((key >> 32) as usize));
            if written {
                return self.flush(frame, keep);
            }
            self.flushing += 1;
            if key.is_some() {
                self.forget_block(place);
            }
        }
        Tick::Memory
    }

    /// Forgets the blocks of a surface, none of which is in use or worth writing.
    pub fn forget_surface(&mut self, surface: usize) {
        for place in 0..self.tags.len() {
            if self.tags.key(place).is_some_and(|key| key >> 32 == surface as u64) {
                self.forget_block(place);
            }
        }
    }

    /// Whether nothing is on its way to memory or back.
    pub fn quiet(&self) -> bool {
        self.outbox.is_empty() && !self.misses.any()
    }

    /// Forgets all blocks, none of which is in use or worth writing.
    pub fn forget(&mut self) {
        self.tags.clear();
        self.taken.fill(0);
    }

    /// Whether a flush is complete, which resets it.
    pub fn flushed(&mut self) -> bool {
        let done = self.flushing == self.tags.len() && self.quiet();
        if done {
            (self.flushing, self.completing) = (0, 0);
        }
        done
    }
}
