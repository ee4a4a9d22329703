//! A constant cache, one per core: loads from uniform buffers, through two levels of tags in front of the second-level cache of the card.
//!
//! A warp whose invocations read at one address has one access. Invocations that read at different addresses are served one address after
//! another (NVIDIA, CUDA C Programming Guide, "Constant Memory": a request is split into as many as there are different addresses in it).
//! Components of uniform buffers at places that a program names are operands of its instructions, and are not asked for here.

use std::collections::VecDeque;

use super::card::{Card, is_newer};
use super::misses::Misses;
use super::tags::{CacheCounts, Tags};
use super::token::WarpToken;
use super::touch::{Touch, Touching};
use knob::Allowed;
use mem::{CACHES, MemoryPort};
use num::Cycle;
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;
use work::{LINE, RequestKind, Service};

knob::knobs! {
    /// A constant cache.
    pub struct ConstantConfig {
        /// Whether cores that shade fragments read uniform buffers through a cache of their own. If not, and in separate vertex cores, they read them through the texture unit.
        enabled: bool ["", Allowed::Switch, "CUDA C programming guide: cards of every compute capability have one"]
            {estimate: Used, relax: Never, advice: []},
        /// Bytes of the first level.
        bytes: u32 ["bytes", Allowed::PowerOfTwo(256, 1048576), "2 KB on Kepler and Maxwell (Jia et al. 2019, table 3.1)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Ways of the first level.
        ways: u32 ["ways", Allowed::PowerOfTwo(1, 256), "assumed: 4"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Bytes of a line of the first level.
        line_bytes: u32 ["bytes", Allowed::PowerOfTwo(64, 256), "assumed: 64"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Bytes of the second level, a multiple of its line; 0: there is none.
        second_bytes: u32 ["bytes", Allowed::Range(0, 1048576), "32 KB on Kepler and Maxwell, called L1.5 (Jia et al. 2019, table 3.1)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Ways of the second level.
        second_ways: u32 ["ways", Allowed::PowerOfTwo(1, 256), "assumed as in the first level"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Bytes of a line of the second level.
        second_line_bytes: u32 ["bytes", Allowed::PowerOfTwo(64, 256), "assumed: 256"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Cycles from an access to its answer where the first level has the line.
        latency: u32 ["cycles", Allowed::Range(1, 256), "a hit takes 25 cycles on GM204 (Jia et al. 2019, table 3.1), 14 of them outside: the index and the way to the cache and back"]
            {estimate: Used, relax: Latency, advice: []},
        /// Cycles from an access to its answer where the second level has the line.
        second_latency: u32 ["cycles", Allowed::Range(1, 1024), "a hit takes 81 cycles on GM204 (Jia et al. 2019, table 3.1), 14 of them outside"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Latency, advice: []},
        /// Misses of both levels in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of the card's second level at an address in 16 cycles"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Accesses of warps between lookup and answer.
        fifo: u32 ["accesses", Allowed::Range(1, 4096), "assumed: one for each warp of a core"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Warps queued before the cache.
        queue: u32 ["warps", Allowed::Range(2, 256), "assumed: as before a texture unit"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
    }
}

/// The heading of constant caches in the statistics.
pub const CONSTANTS: Heading = Heading::new("shading.constant[i]", "Constant caches.");

stats::counters! {
    /// What a constant cache counts.
    pub struct ConstantCounts {
        /// Accesses of warps.
        accesses: "accesses",
        /// Addresses looked up, one per cycle: the different ones of each access.
        addresses: "addresses",
    }
}

/// When a line of the cache is valid.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// The line is valid when all misses before this number are back, and cycle `from` has come.
    needs: u32,
    /// The first cycle in which the line can be valid.
    from: Cycle,
}

/// The access of a warp on its way to its answer.
#[derive(Clone, Copy, Debug)]
struct Access {
    needs: u32,
    from: Cycle,
    /// The place of the warp.
    place: u32,
}

/// A level of the cache: its tags, and the bytes of a line.
#[derive(Clone, Debug)]
struct Level {
    tags: Tags<Line>,
    line: u32,
}

impl Level {
    fn new(bytes: u32, ways: u32, line: u32) -> Level {
        Level { tags: Tags::new((bytes / line).max(1), ways), line }
    }

    /// The number of the line that has a byte.
    fn key(&self, address: u64) -> u64 {
        address / u64::from(self.line)
    }

    fn find(&mut self, address: u64) -> Option<Line> {
        let place = self.tags.find(self.key(address))?;
        Some(*self.tags.data(place))
    }

    fn put(&mut self, address: u64, line: Line) {
        let key = self.key(address);
        let place = self.tags.victim(key, |_| true).expect("any line may go");
        self.tags.replace(place, key, line);
    }
}

/// A constant cache. Its items are accesses of warps.
#[derive(Clone)]
pub struct Constant {
    config: ConstantConfig,
    cluster: usize,
    input: In<WarpToken>,
    output: Out<WarpToken>,
    memory: MemoryPort,
    first: Level,
    second: Option<Level>,
    misses: Misses,
    fifo: VecDeque<Access>,
    /// Whether the access of the warp at the head of the input has begun; the addresses of it that are still to be looked up, by their lines,
    /// and what it needs so far.
    begun: Option<Line>,
    addresses: VecDeque<u64>,
    /// The pass or dispatch that the contents belong to.
    epoch: u32,
    items: u64,
    counts: ConstantCounts,
}

impl Constant {
    /// An empty cache, which serves a core of a cluster.
    pub fn new(
        config: ConstantConfig,
        cluster: usize,
        input: In<WarpToken>,
        output: Out<WarpToken>,
        memory: MemoryPort,
    ) -> Constant {
        Constant {
            cluster,
            input,
            output,
            memory,
            first: Level::new(config.bytes, config.ways, config.line_bytes),
            second: (config.second_bytes > 0)
                .then(|| Level::new(config.second_bytes, config.second_ways, config.second_line_bytes)),
            misses: Misses::new(config.misses),
            fifo: VecDeque::with_capacity(config.fifo as usize),
            begun: None,
            addresses: VecDeque::new(),
            epoch: 0,
            items: 0,
            counts: ConstantCounts::default(),
            config,
        }
    }

    /// The counters of the cache.
    pub fn counts(&self) -> ConstantCounts {
        self.counts
    }

    /// The counters of its levels.
    pub fn caches(&self) -> (CacheCounts, Option<CacheCounts>) {
        (self.first.tags.counts(), self.second.as_ref().map(|level| level.tags.counts()))
    }

    /// Drops the lines of earlier epochs, since an earlier pass or dispatch may have written their memory.
    fn begin_epoch(&mut self, epoch: u32) {
        if self.epoch != epoch {
            self.epoch = epoch;
            self.first.tags.clear();
            self.second.iter_mut().for_each(|level| level.tags.clear());
        }
    }

    /// Has a line looked up without any time: it is in the cache then, and nothing is counted.
    pub(super) fn visit(&mut self, line: u32, epoch: u32, memory: &mut Touching) {
        self.begin_epoch(epoch);
        let (address, there) = (u64::from(line) * LINE, Line { needs: self.misses.frontier(), from: 0 });
        let counts = self.caches();
        if self.first.find(address).is_none() {
            let missing = match &mut self.second {
                None => Some(self.first.line),
                Some(second) => second.find(address).is_none().then(|| {
                    second.put(address, there);
                    second.line
                }),
            };
            if let Some(bytes) = missing {
                let address = address - address % u64::from(bytes);
                memory.push(Touch { port: self.memory.number, address, bytes, write: false });
            }
            self.first.put(address, there);
        }
        self.first.tags.recount(counts.0);
        if let (Some(second), Some(counts)) = (&mut self.second, counts.1) {
            second.tags.recount(counts);
        }
    }

    /// Answers accesses whose lines are there, in order.
    fn answer(&mut self, wires: &mut Wires) -> Tick {
        let mut did = Tick::Starved;
        while let Some(access) = self.fifo.front() {
            if !self.misses.reached(access.needs) {
                return did.or(Tick::Memory);
            }
            if access.from > wires.now() {
                wires.sleep_until(access.from);
                return did.or(Tick::Working);
            }
            if !wires.try_push(&self.output, WarpToken { warp: access.place }) {
                return did.or(Tick::Blocked);
            }
            self.fifo.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// The access of the warp at the head of the input begins: its different addresses are found.
    fn begin(&mut self, card: &mut Card, number: u32) {
        let mut words: Vec<(u32, u16)> = Vec::new();
        for part in 0..card.warps[self.cluster][number].items.len() {
            let warp = &card.warps[self.cluster][number];
            let (item, step) = (warp.items[part], warp.asking(Service::Constant));
            let kind = warp.then(step, part, || card.cost(warp, &item));
            if kind != RequestKind::Constant {
                continue;
            }
            let invocations = card.invocations(warp, &item);
            let request = &invocations.requests[item.next[Service::Constant] as usize];
            for (line, read) in request.words(&invocations.lines) {
                match words.iter_mut().find(|(known, _)| *known == line) {
                    Some((_, known)) => *known |= read,
                    None => words.push((line, read)),
                }
            }
            card.warps[self.cluster][number].items[part].next[Service::Constant] += 1;
        }
        for (line, read) in words {
            // A line that a load only ends in is looked up like the others.
            let times = read.count_ones().max(1) as usize;
            self.addresses.extend(std::iter::repeat_n(u64::from(line) * LINE, times));
        }
        self.begun = Some(Line { needs: self.misses.frontier(), from: 0 });
        self.counts.accesses += 1;
    }

    /// Looks one address up. What the line is waited for; none, and why, where it cannot be asked for.
    fn look_up(&mut self, wires: &mut Wires, address: u64) -> Result<Line, Tick> {
        let at = |latency: u32| wires.now() + Cycle::from(latency);
        let (hit, second_hit) = (at(self.config.latency), at(self.config.second_latency));
        if let Some(line) = self.first.find(address) {
            return Ok(Line { from: line.from.max(hit), ..line });
        }
        if let Some(line) = self.second.as_mut().and_then(|second| second.find(address)) {
            let line = Line { from: line.from.max(second_hit), ..line };
            self.first.put(address, line);
            return Ok(line);
        }
        if self.misses.room() == 0 {
            return Err(Tick::Memory);
        }
        if !self.memory.can_send(wires) {
            return Err(Tick::Blocked);
        }
        let bytes = self.second.as_ref().map_or(self.first.line, |second| second.line);
        let tag = self.misses.issue();
        self.memory.read(wires, address - address % u64::from(bytes), bytes, tag);
        let line = Line { needs: self.misses.issued(), from: hit };
        if let Some(second) = &mut self.second {
            second.put(address, line);
        }
        self.first.put(address, line);
        Ok(line)
    }

    /// Looks up the next address of the warp at the head of the input.
    fn address(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let Some(token) = wires.front(&self.input) else { return Tick::Starved };
        if self.fifo.len() as u32 == self.config.fifo {
            return Tick::Blocked;
        }
        if self.begun.is_none() {
            let warp = &card.warps[self.cluster][token.warp];
            let epoch = card.epoch_of(warp.stage, warp.slot);
            if is_newer(epoch, self.epoch) {
                self.begin_epoch(epoch);
            }
            self.begin(card, token.warp);
        }
        if let Some(&address) = self.addresses.front() {
            let line = match self.look_up(wires, address) {
                Ok(line) => line,
                Err(why) => return why,
            };
            self.addresses.pop_front();
            self.counts.addresses += 1;
            let begun = self.begun.as_mut().expect("an access has begun");
            begun.from = begun.from.max(line.from);
            if !self.misses.reached(line.needs) {
                begun.needs = self.misses.later(Some(begun.needs), line.needs).unwrap_or(line.needs);
            }
        }
        if self.addresses.is_empty() {
            let Line { needs, from } = self.begun.take().expect("an access has begun");
            let warp = &mut card.warps[self.cluster][token.warp];
            warp.asked[Service::Constant].pop_front();
            self.fifo.push_back(Access { needs, from, place: warp.place });
            self.items += 1;
            wires.take(&self.input);
        }
        Tick::Moved
    }
}

impl Unit<Card> for Constant {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Lines that have come.
        while let Some(tag) = self.memory.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }

        // 2. Answers, in order.
        did = did.or(self.answer(wires));

        // 3. The next address.
        did.or(self.address(wires, card))
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.fifo.len() as u64 + u64::from(self.misses.in_flight())
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(CACHES.named("constant"), |unit| unit.first.tags.counts());
        groups.group_if(CACHES.named("constant-second"), |unit| unit.caches().1);
        groups.group(CONSTANTS, |unit| unit.counts);
    }
}
