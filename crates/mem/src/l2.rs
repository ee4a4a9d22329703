//! A slice of the second-level cache, which all clients share: write-back, write-allocate, in sectors.

use std::collections::VecDeque;

use super::cache::{self, CACHES, Cache, CacheShape, ShapeError};
use super::misses::Misses;
use super::port::{AccessKind, DramAnswer, DramRequest, SliceAnswer, SliceRequest};
use super::system::ChannelShare;
use knob::Allowed;
use sim::{Budget, Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;

knob::knobs! {
    /// The second-level cache, in slices.
    #[derive(Copy)]
    pub struct L2Config {
        /// Slices; a multiple of the DRAM channels.
        slices: u32 ["slices", Allowed::Range(1, 64), "assumed: two a memory channel"] {estimate: Used, relax: Bandwidth, advice: []},
        /// Bytes that stay together in a slice.
        interleave: u32 ["bytes", Allowed::PowerOfTwo(256, 65536), "assumed; ATTILA bGPU.ini V2ChannelInterleavingMask \"10 9 8\": 256"]
            {estimate: RefusedUnless(AtMost(16384), "slices and channels with unequal load"), relax: Never, advice: []},
        /// Whether lines stay in a slice. If not, a slice is a queue before its channel: all that is asked of it is asked of DRAM.
        cached: bool ["", Allowed::Switch, "in cards since 2010; ATTILA's memory controller has no cache"]
            {estimate: RefusedUnless(Is(&["true"]), "memory without a second-level cache"), relax: Never, advice: []},
        /// Lines of a slice.
        lines: u32 ["lines", Allowed::PowerOfTwo(1, 1048576), "128 KB a slice: 2 MB in all (NVIDIA 2014, GeForce GTX 980 white paper, p. 7)"]
            {estimate: Used, relax: Cache, advice: []},
        /// Ways.
        ways: u32 ["ways", Allowed::PowerOfTwo(1, 64), "16 in cards since 2010"] {estimate: Used, relax: Never, advice: []},
        /// Bytes of a line.
        line_bytes: u32 ["bytes", Allowed::PowerOfTwo(32, 256), "128 in cards since 2010"] {estimate: Used, relax: Never, advice: []},
        /// Bytes of a sector, fetched and written by itself.
        sector_bytes: u32 ["bytes", Allowed::PowerOfTwo(16, 256), "32 in cards since 2010"]
            {estimate: RefusedUnless(AtMost(64), "long sectors of the second level"), relax: Never, advice: []},
        /// Lines looked up per cycle.
        lookups_per_cycle: u32 ["lines/cycle", Allowed::Range(1, 16), "assumed: one port"] {estimate: Used, relax: Rate, advice: []},
        /// Lines with sectors on their way.
        misses: u32 ["lines", Allowed::Range(1, 4096), "assumed: covers the latency of DRAM at full bandwidth"]
            {estimate: RefusedUnless(AtLeast(8), "waits of the second-level cache"), relax: Room, advice: []},
        /// Requests waiting for sectors.
        waiting: u32 ["requests", Allowed::Range(1, 4096), "assumed: two a missing line"]
            {estimate: RefusedUnless(AtLeast(8), "waits of the second-level cache"), relax: Room, advice: []},
        /// Requests between lookup and answer.
        entries: u32 ["requests", Allowed::Range(1, 4096), "assumed: two a missing line"]
            {estimate: RefusedUnless(AtLeast(4), "waits of the second-level cache"), relax: Room, advice: []},
        /// Bytes per cycle into a slice, and out of it.
        width: u32 ["bytes/cycle", Allowed::Range(8, 4096), "32 a slice: 512 in all, of which 379 are measured (Jia et al. 2019, table 3.4)"]
            {estimate: RefusedUnless(AtLeast(16), "narrow ways to the second level"), relax: Rate, advice: []},
        /// Cycles from the crossbar to a slice, and back.
        latency: u32 ["cycles", Allowed::Range(1, 1024), "assumed: the rest of a hit's 207 cycles (Jia et al. 2019, table 3.1, GM204)"]
            {estimate: Used, relax: Latency, advice: []},
    }
}

impl L2Config {
    /// Lines, ways, bytes of lines and sectors of a slice.
    ///
    /// # Errors
    /// If they make no cache.
    pub fn shape(&self) -> Result<CacheShape, ShapeError> {
        CacheShape::new(self.lines, self.ways, self.line_bytes, self.sector_bytes)
    }
}

/// Where slices count.
pub const SLICES: Heading = Heading::new("memory.l2[i]", "Second-level slices, beside their caches.");

stats::counters! {
    /// What a slice counts in addition to its cache's counts.
    pub struct L2Counts {
        /// Bytes that clients read.
        read_bytes: "bytes",
        /// Bytes that clients wrote.
        write_bytes: "bytes",
        /// Bytes fetched from DRAM.
        fetched_bytes: "bytes",
        /// Bytes written back to DRAM.
        written_back_bytes: "bytes",
        /// Lookups that found their sectors on the way and waited for them without asking again.
        merged: "lookups",
    }
}

/// A request that is past its lookups and waits for sectors or for its turn on the way back.
#[derive(Clone, Copy, Debug)]
struct PendingRequest {
    answer: SliceAnswer,
    /// Lines it waits for, and one while it is being looked up.
    waits: u32,
}

/// A slice. Its items are requests.
#[derive(Clone, Debug)]
pub struct L2Slice {
    config: L2Config,
    cache: Cache,
    misses: Misses,
    entries: Vec<PendingRequest>,
    free: Vec<u32>,
    /// Entries that can be answered.
    ready: VecDeque<u32>,
    /// Requests for DRAM, not yet sent, with addresses within the slice.
    outgoing: VecDeque<DramRequest>,
    /// The next byte of the request at the head to be looked up, from its address, and its entry.
    done: u32,
    entry: Option<u32>,
    items: u64,
    counts: L2Counts,
    share: ChannelShare,
    input: In<SliceRequest>,
    output: Out<SliceAnswer>,
    to_dram: Out<DramRequest>,
    from_dram: In<DramAnswer>,
}

/// Requests for DRAM that are held while the channel there is full; a lookup adds at most two.
const OUTGOING: usize = 4;

impl L2Slice {
    /// An empty slice, which has a share of its channel's addresses.
    ///
    /// # Panics
    /// If its cache has no shape, which a [`MemoryPlan`](super::MemoryPlan) refuses.
    pub fn new(
        config: L2Config,
        share: ChannelShare,
        input: In<SliceRequest>,
        output: Out<SliceAnswer>,
        to_dram: Out<DramRequest>,
        from_dram: In<DramAnswer>,
    ) -> L2Slice {
        let shape = config.shape().expect("a shape that was checked");
        let fresh = PendingRequest { answer: SliceAnswer { tag: 0, client: 0, bytes: 0 }, waits: 0 };
        L2Slice {
            cache: Cache::new(shape),
            misses: Misses::new(shape.lines(), config.misses, config.waiting),
            entries: vec![fresh; config.entries as usize],
            free: (0..config.entries).rev().collect(),
            ready: VecDeque::with_capacity(config.entries as usize),
            outgoing: VecDeque::with_capacity(OUTGOING),
            done: 0,
            entry: None,
            items: 0,
            counts: L2Counts::default(),
            config,
            share,
            input,
            output,
            to_dram,
            from_dram,
        }
    }

    /// What its cache has counted.
    #[cfg(test)]
    pub(crate) fn cache_counts(&self) -> cache::CacheCounts {
        self.cache.counts()
    }

    /// What it has counted.
    pub fn counts(&self) -> L2Counts {
        self.counts
    }

    /// Its cache, for a look at what is in it.
    pub fn cache(&self) -> &Cache {
        &self.cache
    }

    /// Has what a request touches looked up without any time: it is in the cache then, and neither counted nor asked of DRAM.
    pub fn visit(&mut self, address: u64, bytes: u32, write: bool) {
        if !self.config.cached {
            return;
        }
        let shape = self.cache.shape();
        let mut done = 0;
        while done < bytes {
            let address = address + u64::from(done);
            let offset = address as u32 & (shape.line() - 1);
            let part = (bytes - done).min(shape.line() - offset);
            done += part;
            let line = self.cache.line_of(address);
            let place = match self.cache.find(line) {
                Some(place) => {
                    self.cache.touch(place);
                    place
                }
                None => {
                    // Where all of a set is on its way, the line goes by.
                    let Some(place) = self.cache.victim(line) else { continue };
                    let counts = self.cache.counts();
                    self.cache.replace(place, line);
                    self.cache.recount(counts);
                    place
                }
            };
            let sectors = self.cache.sectors(offset, part);
            if write {
                self.cache.write(place, sectors, sectors);
            } else {
                self.cache.fill(place, sectors & !self.cache.fetching(place));
            }
        }
    }

    /// Answers that are ready leave.
    #[inline(always)]
    fn answer(&mut self, wires: &mut Wires) -> Tick {
        let mut did = Tick::Idle;
        while let Some(&entry) = self.ready.front() {
            if !wires.can_push(&self.output) {
                return did.or(Tick::Blocked);
            }
            let answer = self.entries[entry as usize].answer;
            wires.push_sized(&self.output, answer, u32::from(answer.bytes));
            self.ready.pop_front();
            self.free.push(entry);
            self.items += 1;
            did = Tick::Moved;
        }
        did
    }

    /// Sectors come from DRAM, and whom they serve is ready.
    #[inline(always)]
    fn fill(&mut self, wires: &mut Wires) -> Tick {
        let mut did = Tick::Idle;
        while let Some(DramAnswer { id }) = wires.pop(&self.from_dram) {
            let (entries, ready) = (&mut self.entries, &mut self.ready);
            let mut serve = |entry: u32| {
                entries[entry as usize].waits -= 1;
                if entries[entry as usize].waits == 0 {
                    ready.push_back(entry);
                }
            };
            did = Tick::Moved;
            if !self.config.cached {
                serve(id);
                continue;
            }
            let (place, sectors) = (cache::CacheSlot(id >> 8), id as u8);
            self.cache.fill(place, sectors);
            let valid = self.cache.valid(place);
            self.misses.serve(place, valid, serve);
            if self.cache.fetching(place) == 0 {
                self.misses.close(place);
            }
        }
        did
    }

    /// Requests go to DRAM.
    #[inline(always)]
    fn send(&mut self, wires: &mut Wires) -> Tick {
        let mut did = Tick::Idle;
        while let Some(&request) = self.outgoing.front() {
            if !wires.can_push(&self.to_dram) {
                return did.or(Tick::Memory);
            }
            let request = DramRequest { address: self.share.address(request.address), ..request };
            wires.push_sized(&self.to_dram, request, u32::from(request.bytes));
            self.outgoing.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// The request at the head is looked up, line by line.
    #[inline(always)]
    fn look_up(&mut self, wires: &mut Wires) -> Tick {
        let mut did = Tick::Idle;
        let mut budget = Budget::new(self.config.lookups_per_cycle);
        while budget.left() > 0 {
            let Some(request) = wires.front(&self.input) else { return did.or(Tick::Starved) };
            if self.entry.is_none() && request.kind().is_answered() {
                let Some(entry) = self.free.pop() else { return did.or(Tick::Memory) };
                let answer = SliceAnswer { tag: request.tag, client: request.client, bytes: request.bytes() as u16 };
                self.entries[entry as usize] = PendingRequest { answer, waits: 1 };
                self.entry = Some(entry);
                did = Tick::Moved;
            }
            let done = if self.config.cached { self.look_up_line(&request) } else { self.pass_line(&request) };
            if !done {
                return did.or(Tick::Memory);
            }
            budget.spend();
            did = Tick::Moved;
            if self.done < request.bytes() {
                continue;
            }
            self.done = 0;
            wires.take(&self.input);
            match request.kind() {
                AccessKind::Read => self.counts.read_bytes += u64::from(request.bytes()),
                AccessKind::Write => self.counts.write_bytes += u64::from(request.bytes()),
                AccessKind::Atomic => {
                    self.counts.read_bytes += u64::from(request.bytes());
                    self.counts.write_bytes += u64::from(request.bytes());
                }
            }
            match self.entry.take() {
                Some(entry) => {
                    self.entries[entry as usize].waits -= 1;
                    if self.entries[entry as usize].waits == 0 {
                        self.ready.push_back(entry);
                    }
                }
                None => self.items += 1,
            }
        }
        did
    }

    /// Passes the next line of a request on to DRAM; false if there is no room for it, and then nothing has changed.
    #[inline(always)]
    fn pass_line(&mut self, request: &SliceRequest) -> bool {
        if self.outgoing.len() + 2 > OUTGOING {
            return false;
        }
        let shape = self.cache.shape();
        let address = request.address + u64::from(self.done);
        let bytes = (request.bytes() - self.done).min(shape.line() - (address as u32 & (shape.line() - 1)));
        let first = address & !u64::from(shape.sector() - 1);
        let length = ((address - first) as u32 + bytes).next_multiple_of(shape.sector());
        if let Some(entry) = self.entry {
            self.entries[entry as usize].waits += 1;
            self.outgoing.push_back(DramRequest { address: first, id: entry, bytes: length as u16, write: 0 });
            self.counts.fetched_bytes += u64::from(length);
        }
        if request.kind() != AccessKind::Read {
            self.outgoing.push_back(DramRequest { address: first, id: 0, bytes: length as u16, write: 1 });
            self.counts.written_back_bytes += u64::from(length);
        }
        self.done += bytes;
        true
    }

    /// Looks up the next line of a request; false if a resource is missing, and then nothing has changed.
    #[inline(always)]
    fn look_up_line(&mut self, request: &SliceRequest) -> bool {
        let shape = self.cache.shape();
        let address = request.address + u64::from(self.done);
        let offset = address as u32 & (shape.line() - 1);
        let bytes = (request.bytes() - self.done).min(shape.line() - offset);
        let line = self.cache.line_of(address);
        let sectors = self.cache.sectors(offset, bytes);
        // A write needs from DRAM what it covers only in part; all else needs all it touches.
        let whole = if request.kind() == AccessKind::Write { self.cache.covered(offset, bytes) } else { 0 };
        let needs = sectors & !whole;

        let found = self.cache.find(line);
        let (valid, fetching) = found.map_or((0, 0), |place| (self.cache.valid(place), self.cache.fetching(place)));
        let missing = needs & !valid;
        let ask = missing & !fetching;
        let opens = ask != 0 && fetching == 0;
        let waits = self.entry.is_some() && missing != 0;
        if (opens && !self.misses.has_register()) || (waits && !self.misses.has_waiter()) || self.outgoing.len() + 2 > OUTGOING
        {
            return false;
        }
        let place = match found {
            Some(place) => {
                self.cache.touch(place);
                place
            }
            None => {
                let Some(place) = self.cache.victim(line) else { return false };
                if let Some((old, dirty)) = self.cache.replace(place, line) {
                    self.write_back(old, dirty);
                }
                place
            }
        };
        self.cache.count(found.is_some() && ask == 0);
        self.counts.merged += u64::from(missing != 0 && ask == 0);
        if ask != 0 {
            if opens {
                self.misses.open();
            }
            self.cache.fetch(place, ask);
            let first = ask.trailing_zeros() * shape.sector();
            let length = ask.count_ones() * shape.sector();
            let address = line * u64::from(shape.line()) + u64::from(first);
            self.outgoing.push_back(DramRequest { address, id: place.0 << 8 | u32::from(ask), bytes: length as u16, write: 0 });
            self.counts.fetched_bytes += u64::from(length);
        }
        if let (true, Some(entry)) = (waits, self.entry) {
            self.entries[entry as usize].waits += 1;
            self.misses.wait(place, entry, missing);
        }
        if request.kind() != AccessKind::Read {
            self.cache.write(place, sectors, whole);
        }
        self.done += bytes;
        true
    }

    #[inline(always)]
    fn write_back(&mut self, line: u64, dirty: u8) {
        if dirty != 0 {
            let shape = self.cache.shape();
            let bytes = dirty.count_ones() * shape.sector();
            let address = line * u64::from(shape.line()) + u64::from(dirty.trailing_zeros() * shape.sector());
            self.outgoing.push_back(DramRequest { address, id: 0, bytes: bytes as u16, write: 1 });
            self.counts.written_back_bytes += u64::from(bytes);
        }
    }
}

impl<C> Unit<C> for L2Slice {
    #[inline]
    fn tick(&mut self, wires: &mut Wires, _: &mut C) -> Tick {
        // 1. Answers leave. 2. Sectors come. 3. Requests go to DRAM. 4. Requests are looked up.
        let mut did = self.answer(wires);
        did = did.or(self.fill(wires));
        did = did.or(self.send(wires));
        did = did.or(self.look_up(wires));
        let asked = if self.config.cached { !self.misses.is_empty() } else { self.free.len() < self.entries.len() };
        let starved = if !asked && self.outgoing.is_empty() { Tick::Starved } else { Tick::Memory };
        if did == Tick::Moved && self.ready.is_empty() && self.outgoing.is_empty() && !wires.can_pop(&self.input) {
            wires.rest(starved);
        }
        if did == Tick::Starved { starved } else { did }
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        let held = self.entries.len() - self.free.len() + self.outgoing.len();
        held as u64 + u64::from(self.misses.len())
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(CACHES.named("l2"), |slice| slice.cache.counts());
        groups.group(SLICES, |slice| slice.counts);
    }
}
