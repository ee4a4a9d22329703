//! A texture unit, one per core: addresses, a first-level cache, a FIFO that covers the latency of misses, and
//! filters. Loads, stores and atomics of shaders take the same way.

use std::collections::VecDeque;

use super::card::notes::{block_of, note};
use super::card::{Card, is_newer};
use super::misses::Misses;
use super::tags::{CacheCounts, Tags};
use super::token::WarpToken;
use super::touch::{Touch, Touching};
use super::warp::{Item, Warp};
use gfx::stage::Stage;
use knob::Allowed;
use mem::{CACHES, MemoryPort};
use num::Cycle;
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;
use work::{Invocations, LINE, Request, RequestKind, Service};

knob::knobs! {
    /// A texture unit.
    pub struct TextureConfig {
        /// Quads addressed per cycle.
        quads_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "4 bilinear texels per cycle and quad pipe; 8 texels per cycle and SM of 2014"]
            {estimate: Used, relax: Rate, advice: []},
        /// Pieces of 64 bytes looked up in the cache per cycle.
        lookups_per_cycle: u32 ["pieces/cycle", Allowed::Range(1, 32), "assumed: four banks, one a texel of a bilinear footprint"]
            {estimate: Used, relax: Rate, advice: []},
        /// Bytes of an aligned piece of memory of which a load, store or atomic of a warp has one looked up at a time, whatever its invocations need of it.
        access_bytes: u32 ["bytes", Allowed::PowerOfTwo(64, 256), "128: a warp's accesses to a line of 128 bytes are one transaction since 2010 (NVIDIA, CUDA C Programming Guide, \"Global Memory\")"]
            {estimate: Used, relax: Never, advice: []},
        /// Such pieces per cycle.
        accesses_per_cycle: u32 ["pieces/cycle", Allowed::Range(1, 64), "one: 128 bytes per cycle are the bound of an SM's first-level cache (Jia et al. 2019, table 3.2)"]
            {estimate: Used, relax: Rate, advice: []},
        /// Bilinear filter operations per cycle: 1 per fragment for bilinear, 2 for trilinear, N for an anisotropy of N; times what the format costs.
        filters_per_cycle: u32 ["operations/cycle", Allowed::Range(1, 128), "8 bilinear texels per cycle: the texel rate of 2014's SM"]
            {estimate: Used, relax: Rate, advice: []},
        /// Operations of a bilinear sample of one component of 32 bits, in those of one of 8-bit components, which is 1.
        filter_single: u32 ["operations", Allowed::Range(1, 16), "1 on GeForce and Radeon of 2012 to 2016; 2 on Mali-G57 (Arm GPU Datasheet v7)"]
            {estimate: UsedBy("texture.costs"), relax: Never, advice: []},
        /// The same where texels have 64 bits in narrower components.
        filter_halves: u32 ["operations", Allowed::Range(1, 16), "RGBA16F: 1 on GeForce (hardware.fr 928-3); 2 on Radeon HD 7000 to Fiji and on Mali-G57"]
            {estimate: UsedBy("texture.costs"), relax: Never, advice: []},
        /// The same where texels have two components of 32 bits.
        filter_pair: u32 ["operations", Allowed::Range(1, 16), "RG32F: assumed as on the RTX 3090 (sebbbi, perftest: full rate); 4 on Mali-G57"]
            {estimate: UsedBy("texture.costs"), relax: Never, advice: []},
        /// The same where texels have four components of 32 bits.
        filter_full: u32 ["operations", Allowed::Range(1, 16), "RGBA32F: 4 on GeForce (sebbbi, perftest: RTX 3090) and Radeon; 8 on Mali-G57"]
            {estimate: UsedBy("texture.costs"), relax: Never, advice: []},
        /// Operations of a load, without filtering, of a texel of 128 bits; other loads take one.
        load_full: u32 ["operations", Allowed::Range(1, 16), "2 on the GTX 980 Ti: up to 64 bit full rate, 128 bit half (sebbbi, perftest)"]
            {estimate: UsedBy("texture.costs"), relax: Never, advice: []},
        /// Whether a sample between two levels asks for the second only where that has a weight.
        skip_levels: bool ["", Allowed::Switch, "known with the level of detail; off: always both levels, as Vulkan's \"Image Level(s) Selection\" has it"]
            {estimate: UsedBy("config.render_key"), relax: Skip(&[("true", "only levels that have a weight")]), advice: []},
        /// Lines of the first-level cache; a multiple of its ways, or fewer than they are.
        cache_lines: u32 ["lines", Allowed::Range(1, 65536), "48 KB a multiprocessor (NVIDIA 2016, GeForce GTX 1080 white paper); 16 KB is enough for one screen row of bilinear (Hakura and Gupta 1997)"]
            {estimate: RefusedUnless(AtLeast(4), "texture caches of fewer lines than a request reads"), relax: Cache, advice: [Cache("texture")]},
        /// Bytes of a line of the first-level cache, which has one tag. Whatever it is, 64 bytes are looked up at a time: rates of misses compare.
        line_bytes: u32 ["bytes", Allowed::PowerOfTwo(64, 256), "128 on GM204 (Jia et al. 2019, table 3.1); 16 texels of 4 bytes; Hakura and Gupta 1997 vary it from 32 to 256"]
            {estimate: RefusedUnless(Is(&["64", "128"]), "longer lines of textures"), relax: Never, advice: []},
        /// Bytes of a sector of such a line, at most the line: a miss reads the sectors that are asked for and are not there. Samples ask for 64 bytes at least.
        sector_bytes: u32 ["bytes", Allowed::PowerOfTwo(32, 256), "32 on GM204 (Jia et al. 2019, table 3.1: load granularity); as long as a line in caches without sectors"]
            {estimate: RefusedUnless(Is(&["32", "64"]), "longer lines of textures"), relax: Never, advice: []},
        /// Ways of the first-level cache; where they are as many as its lines or more, any line goes anywhere.
        cache_ways: u32 ["ways", Allowed::PowerOfTwo(1, 65536), "assumed; ATTILA bGPU.ini TextureCacheWaysL1 = 16"]
            {estimate: Used, relax: Never, advice: []},
        /// Misses in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory (357 cycles) at two thirds of a miss per cycle"]
            {estimate: RefusedUnless(AtLeast(8), "texture units with few misses in flight"), relax: Room, advice: []},
        /// Quads between address and filter.
        fifo: u32 ["quads", Allowed::Range(1, 4096), "assumed: covers the latency of memory (357 cycles) at the rate of quads (Igehy et al. 1998); ATTILA bGPU.ini TextureAccessQueue = 256"]
            {estimate: Used, relax: Room, advice: []},
        /// Cycles from address to filter where all lines are in the cache.
        latency: u32 ["cycles", Allowed::Range(1, 256), "a hit takes 82 cycles on GM204 (Jia et al. 2019, table 3.1), 8 of them outside; ATTILA bGPU.ini AddressALULatency + FilterALULatency = 10"]
            {estimate: Used, relax: Latency, advice: []},
        /// Warps queued before the unit.
        queue: u32 ["warps", Allowed::Range(2, 256), "assumed; ATTILA bGPU.ini TextureRequestQueueSize = 512 texels"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
    }
}

impl TextureConfig {
    /// The cost of an operation by [`Request::rate`], in operations on texels of 8-bit components.
    pub fn costs(&self) -> [u32; Request::RATES] {
        [1, 1, self.filter_single, self.filter_halves, self.filter_pair, self.filter_full, self.load_full]
    }
}

/// A quad on its way through the latency-covering FIFO.
#[derive(Clone, Copy, Debug)]
struct FilterQuad {
    /// The quad can be filtered when all misses before this number are back, and cycle `from` has come.
    needs: u32,
    /// The first cycle in which the quad can be filtered.
    from: Cycle,
    /// Filter operations.
    operations: u32,
    /// The place of the warp to be answered after it, if it is the warp's last.
    answer: Option<u32>,
}

/// A line of the first-level cache.
#[derive(Clone, Copy, Debug, Default)]
struct Line {
    /// The sectors that are there or on their way, a bit each.
    asked: u8,
    /// A number for each sector: the sector is valid when all misses before this number are back.
    needs: [u32; 8],
}

/// Where the unit is in the warp at the head of its input.
#[derive(Clone, Copy, Debug, Default)]
struct WarpProgress {
    item: usize,
    line: u32,
    needs: Option<u32>,
    /// Lines of the current request that missed.
    missed: u32,
}

/// The lines and pieces that have been looked up for the load or store of the warp at the head of the input.
#[derive(Clone, Debug, Default)]
struct Coalesced {
    lines: Vec<u32>,
    pieces: Vec<u32>,
    /// For a load, the sectors that any invocation reads of each line of the cache. Empty unless lines have several sectors.
    sectors: Vec<(u64, u8)>,
    noted: bool,
}

/// The heading of texture units in the statistics.
pub const TEXTURES: Heading = Heading::new("shading.texture[i]", "Texture units.");

stats::counters! {
    /// What a texture unit counts.
    pub struct TextureCounts {
        /// Quads with a texture request.
        quads: "quads",
        /// Bilinear filter operations.
        operations: "operations",
        /// Requests of buffer loads, stores and atomics, by fours of invocations.
        accesses: "requests",
        /// Pieces of memory ([`TextureConfig::access_bytes`]) that these had looked up, each once per warp.
        pieces: "pieces",
    }
}

/// The heading under which first-level caches count what they read.
pub const FILLS: Heading = Heading::new("shading.fills[i]", "First-level caches of textures and data, by texture unit.");

stats::counters! {
    /// What a first-level cache has read.
    pub struct FillCounts {
        /// Sectors ([`TextureConfig::sector_bytes`]).
        sectors: "sectors",
    }
}

/// The core that a texture unit serves.
#[derive(Clone, Copy, Debug, Default)]
pub struct TextureUser {
    /// The cluster of its warps.
    pub cluster: usize,
    /// Its number among the texture units of all cores.
    pub number: usize,
    /// Whether its core shades nothing but vertices.
    pub vertices: bool,
    /// Whether its core has no constant cache: it serves loads from uniform buffers too.
    pub constants: bool,
}

/// A texture unit. Its items are requests of quads.
#[derive(Clone)]
pub struct Texture {
    config: TextureConfig,
    user: TextureUser,
    input: In<WarpToken>,
    output: Out<WarpToken>,
    memory: MemoryPort,
    tags: Tags<Line>,
    /// Shift from the number of half a piece of [`LINE`] bytes to the number of its sector.
    sector_shift: u32,
    fills: FillCounts,
    /// Shift from the number of a piece of [`LINE`] bytes to the number of its cache line.
    line_shift: u32,
    misses: Misses,
    fifo: VecDeque<FilterQuad>,
    place: WarpProgress,
    coalesced: Coalesced,
    /// Shift from the number of a piece of [`LINE`] bytes to the number of the piece that an access reads.
    piece_shift: u32,
    /// When the filters are free, in cycles times their rate.
    free_at: u64,
    /// The pass or dispatch that the cache's contents belong to.
    epoch: u32,
    items: u64,
    counts: TextureCounts,
    /// The cost of an operation by the rate of its request.
    costs: [u32; Request::RATES],
}

impl Texture {
    /// An idle texture unit with an empty cache.
    pub fn new(
        config: TextureConfig,
        user: TextureUser,
        input: In<WarpToken>,
        output: Out<WarpToken>,
        memory: MemoryPort,
    ) -> Texture {
        Texture {
            user,
            input,
            output,
            memory,
            tags: Tags::new(config.cache_lines, config.cache_ways),
            line_shift: config.line_bytes.trailing_zeros() - LINE.trailing_zeros(),
            sector_shift: config.sector_bytes.min(config.line_bytes).trailing_zeros() - (LINE / 2).trailing_zeros(),
            fills: FillCounts::default(),
            misses: Misses::new(config.misses),
            fifo: VecDeque::with_capacity(config.fifo as usize),
            place: WarpProgress::default(),
            coalesced: Coalesced::default(),
            piece_shift: config.access_bytes.trailing_zeros().saturating_sub(LINE.trailing_zeros()),
            free_at: 0,
            epoch: 0,
            items: 0,
            counts: TextureCounts::default(),
            costs: config.costs(),
            config,
        }
    }

    /// The counters of the unit.
    pub fn counts(&self) -> TextureCounts {
        self.counts
    }

    /// The counters of its cache.
    pub fn cache(&self) -> CacheCounts {
        self.tags.counts()
    }

    /// Has the halves of a line looked up without any time: they are in the cache then, and nothing is counted.
    pub(super) fn visit(&mut self, line: u32, halves: u8, epoch: u32, memory: &mut Touching) {
        if self.epoch != epoch {
            self.epoch = epoch;
            self.tags.clear();
        }
        let (key, counts) = (self.key(line), self.tags.counts());
        let wanted = self.sectors(line, halves);
        let found = self.tags.find(key).or_else(|| {
            let place = self.tags.victim(key, |_| true)?;
            self.tags.replace(place, key, Line::default());
            Some(place)
        });
        let frontier = self.misses.frontier();
        if let Some(place) = found {
            while let Some((run, address, bytes)) = self.missing(place, key, wanted) {
                memory.push(Touch { port: self.memory.number, address, bytes, write: false });
                self.tags.data(place).ask(run, frontier);
            }
        }
        self.tags.recount(counts);
    }

    /// The touch of a store of bytes to a line.
    pub(super) fn store(&self, line: u32, bytes: u32) -> Touch {
        Touch { port: self.memory.number, address: u64::from(line) * LINE, bytes, write: true }
    }

    /// The number of the cache's line that a line of memory lies in.
    #[inline(always)]
    fn key(&self, line: u32) -> u64 {
        u64::from(line >> self.line_shift)
    }

    /// The sectors of the cache's line that halves of a line of memory lie in.
    #[inline(always)]
    fn sectors(&self, line: u32, halves: u8) -> u8 {
        let first = 2 * (line & ((1 << self.line_shift) - 1));
        let of = |half: u8| (halves >> half & 1) << ((first + u32::from(half)) >> self.sector_shift);
        of(0) | of(1)
    }

    /// The first run of sectors that are wanted of a line and not asked for, its address and its bytes.
    #[inline(always)]
    fn missing(&mut self, place: usize, key: u64, wanted: u8) -> Option<(u8, u64, u32)> {
        let missing = wanted & !self.tags.data(place).asked;
        if missing == 0 {
            return None;
        }
        let first = missing.trailing_zeros();
        let count = (!(missing >> first)).trailing_zeros();
        let run = (((1_u32 << count) - 1) << first) as u8;
        let sector = LINE / 2 << self.sector_shift;
        let address = key * u64::from(self.config.line_bytes) + u64::from(first) * sector;
        Some((run, address, count * sector as u32))
    }

    /// Notes the sectors that a load of a warp reads of each line of the cache, if lines have several sectors.
    fn note_sectors(&mut self, card: &Card, warp: &Warp) {
        self.coalesced.noted = true;
        for (part, item) in warp.items.iter().enumerate() {
            let kind = warp.then(warp.asking(Service::Texture), part, || card.cost(warp, item));
            if kind != RequestKind::Load {
                continue;
            }
            let Invocations { requests, lines: all, .. } = card.invocations(warp, item);
            let request = &requests[item.next[Service::Texture] as usize];
            for (at, &line) in (0..).zip(&all[request.first_line as usize..][..usize::from(request.lines)]) {
                let (key, sectors) = (self.key(line), self.sectors(line, request.halves(all, at)));
                match self.coalesced.sectors.iter_mut().find(|(known, _)| *known == key) {
                    Some((_, known)) => *known |= sectors,
                    None => self.coalesced.sectors.push((key, sectors)),
                }
            }
        }
    }

    /// Looks up sectors of a line and asks for those that are not there; the unit cannot go on if that cannot be done.
    #[inline(always)]
    fn look_up(&mut self, wires: &mut Wires, key: u64, wanted: u8) -> Result<(), Tick> {
        let before = self.tags.counts();
        let place = match self.tags.find(key) {
            Some(place) => {
                let line = *self.tags.data(place);
                if wanted & !line.asked == 0 {
                    // A sector that is still on its way is waited for like a miss of this request.
                    let mut left = wanted;
                    while left != 0 {
                        let needs = line.needs[left.trailing_zeros() as usize];
                        if !self.misses.reached(needs) {
                            self.place.needs = self.misses.later(self.place.needs, needs);
                        }
                        left &= left - 1;
                    }
                    return Ok(());
                }
                self.tags.recount(CacheCounts { misses: before.misses + 1, accesses: before.accesses + 1, ..before });
                place
            }
            None => {
                // It is put in when the first of its sectors can be asked for.
                self.can_ask(wires)?;
                let place = self.tags.victim(key, |_| true).expect("any line may go");
                self.tags.replace(place, key, Line::default());
                place
            }
        };
        while let Some((run, address, bytes)) = self.missing(place, key, wanted) {
            if let Err(why) = self.can_ask(wires) {
                // The lookup is counted when it has ended.
                let evictions = self.tags.counts().evictions;
                self.tags.recount(CacheCounts { evictions, ..before });
                return Err(why);
            }
            let tag = self.misses.issue();
            self.memory.read(wires, address, bytes, tag);
            let needs = self.misses.issued();
            self.tags.data(place).ask(run, needs);
            self.fills.sectors += u64::from(run.count_ones());
        }
        // Sectors that were on their way before are back no later than those that were asked for last.
        self.place.needs = Some(self.misses.issued());
        self.place.missed += 1;
        Ok(())
    }

    /// Whether a miss can be sent.
    #[inline(always)]
    fn can_ask(&self, wires: &mut Wires) -> Result<(), Tick> {
        match (self.misses.room(), self.memory.can_send(wires)) {
            (0, _) => Err(Tick::Memory),
            (_, false) => Err(Tick::Blocked),
            _ => Ok(()),
        }
    }

    /// Whether the unit serves requests to a service.
    #[inline(always)]
    fn serves(&self, service: Service) -> bool {
        match service {
            Service::Texture => true,
            Service::Constant => self.user.constants,
            Service::Shared => false,
        }
    }

    /// An item's request and the lines of it that are left from `line` on.
    #[inline(always)]
    fn request<'a>(card: &'a Card, warp: &Warp, item: &Item, at: u32, line: u32) -> (&'a Request, &'a [u32]) {
        let Invocations { requests, lines, .. } = card.invocations(warp, item);
        let request = &requests[at as usize];
        (request, &lines[(request.first_line + line) as usize..(request.first_line + u32::from(request.lines)) as usize])
    }

    /// Bytes that a warp's parts from one on store in a line, at most all of them.
    fn stored(card: &Card, warp: &Warp, from: usize, line: u32) -> u32 {
        let mut bytes = 0;
        for (part, item) in warp.items.iter().enumerate().skip(from) {
            let kind = warp.then(warp.asking(Service::Texture), part, || card.cost(warp, item));
            if kind == RequestKind::Store {
                let (request, lines) = Self::request(card, warp, item, item.next[Service::Texture], 0);
                bytes += if lines.contains(&line) { stored_bytes(request) } else { 0 };
            }
        }
        bytes.min(LINE as u32)
    }

    /// Notes the misses of a quad's request.
    #[cold]
    fn note_misses(&self, card: &mut Card, slot: u16, item: &Item, at: u32) {
        let Card { work, passes, notes: Some(notes), .. } = card else { return };
        let Some(work) = &work[usize::from(slot)] else { return };
        let Some(pass) = passes.get(work.pass) else { return };
        let tile = &work.segment.tiles[item.source as usize];
        if let Some(block) = block_of(tile, at, pass.blocks_across) {
            note(notes, Some(pass), block, |of| of.misses += self.place.missed);
        }
    }

    /// Filters entries whose lines are there, in order.
    #[inline(always)]
    fn filter(&mut self, wires: &mut Wires) -> Tick {
        let mut did = Tick::Starved;
        let rate = u64::from(self.config.filters_per_cycle);
        let now = wires.now();
        while let Some(entry) = self.fifo.front() {
            if !self.misses.reached(entry.needs) {
                return did.or(Tick::Memory);
            }
            if entry.from > now {
                wires.sleep_until(entry.from);
                return did.or(Tick::Working);
            }
            if self.free_at >= (now + 1) * rate {
                wires.sleep_until(self.free_at / rate);
                return did.or(Tick::Working);
            }
            if let Some(place) = entry.answer
                && !wires.try_push(&self.output, WarpToken { warp: place })
            {
                return did.or(Tick::Blocked);
            }
            self.free_at = self.free_at.max(now * rate) + u64::from(entry.operations);
            self.fifo.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Looks lines up for the warp at the head of the input, quad after quad.
    #[inline(always)]
    fn address(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut quads = self.config.quads_per_cycle;
        let mut lookups = self.config.lookups_per_cycle;
        let mut pieces = self.config.accesses_per_cycle;
        while let Some(token) = wires.front(&self.input) {
            let warp = &card.warps[self.user.cluster][token.warp];
            // Lines that an earlier pass or dispatch may have written are dropped.
            let epoch = card.epoch_of(warp.stage, warp.slot);
            if is_newer(epoch, self.epoch) {
                self.epoch = epoch;
                self.tags.clear();
            }
            let items = warp.items.len();
            while self.place.item < items {
                let warp = &card.warps[self.user.cluster][token.warp];
                let item = warp.items[self.place.item];
                let last = self.place.item + 1 == items;
                let kind = warp.then(warp.asking(Service::Texture), self.place.item, || card.cost(warp, &item));
                let Some(service) = kind.service().filter(|&service| self.serves(service)) else {
                    if !last {
                        self.place.item += 1;
                        continue;
                    }
                    // The answer still goes out behind the requests of the others.
                    if self.fifo.len() as u32 == self.config.fifo {
                        return did.or(Tick::Blocked);
                    }
                    let place = warp.place;
                    self.enter(wires.now(), self.place.needs, 0, Some(place));
                    did = Tick::Moved;
                    continue;
                };
                if self.fifo.len() as u32 == self.config.fifo {
                    return did.or(Tick::Blocked);
                }
                let texture = kind == RequestKind::Texture;
                let at = item.next[service];
                if texture && quads == 0 {
                    return Tick::Moved;
                }
                if kind == RequestKind::Load && self.config.sector_bytes < self.config.line_bytes && !self.coalesced.noted {
                    self.note_sectors(card, warp);
                }
                let (request, lines) = Self::request(card, warp, &item, at, self.place.line);
                for &line in lines {
                    if !texture {
                        // A line that another invocation of the warp has asked for comes with that request. Atomics are done one by one.
                        if kind != RequestKind::Atomic && self.coalesced.lines.contains(&line) {
                            self.place.line += 1;
                            did = Tick::Moved;
                            continue;
                        }
                        let piece = line >> self.piece_shift;
                        if !self.coalesced.pieces.contains(&piece) {
                            if pieces == 0 {
                                return Tick::Moved;
                            }
                            pieces -= 1;
                            self.counts.pieces += 1;
                            self.coalesced.pieces.push(piece);
                        }
                    } else if lookups == 0 {
                        return Tick::Moved;
                    }
                    match kind {
                        RequestKind::Texture | RequestKind::Load | RequestKind::Constant => {
                            let key = self.key(line);
                            let all = self.sectors(line, 3);
                            let of_load =
                                self.coalesced.sectors.iter().find(|(known, _)| kind == RequestKind::Load && *known == key);
                            let wanted = of_load.map_or(all, |(_, sectors)| *sectors);
                            if let Err(why) = self.look_up(wires, key, wanted) {
                                return did.or(why);
                            }
                        }
                        RequestKind::Store => {
                            if !self.memory.can_send(wires) {
                                return did.or(Tick::Blocked);
                            }
                            let bytes = Self::stored(card, warp, self.place.item, line);
                            self.memory.write(wires, u64::from(line) * LINE, bytes);
                        }
                        RequestKind::Atomic => {
                            if self.misses.room() == 0 {
                                return did.or(Tick::Memory);
                            }
                            if !self.memory.can_send(wires) {
                                return did.or(Tick::Blocked);
                            }
                            let tag = self.misses.issue();
                            self.memory.atomic(wires, u64::from(line) * LINE, 4, tag);
                            self.place.needs = Some(self.misses.issued());
                        }
                        RequestKind::End | RequestKind::Barrier | RequestKind::Shared => {
                            unreachable!("a texture unit serves no {kind:?}")
                        }
                    }
                    if texture {
                        lookups -= 1;
                    } else {
                        self.coalesced.lines.push(line);
                    }
                    self.place.line += 1;
                    did = Tick::Moved;
                }
                quads -= u32::from(texture);
                let operations = match texture {
                    true => {
                        self.counts.quads += 1;
                        self.counts.operations += u64::from(request.operations);
                        u32::from(request.operations) * self.costs[request.rate()]
                    }
                    false => {
                        self.counts.accesses += 1;
                        0
                    }
                };
                self.items += 1;
                let (needs, place) = (self.place.needs, warp.place);
                if self.place.missed > 0 && card.notes.is_some() && warp.stage == Stage::Fragment {
                    let slot = warp.slot;
                    self.note_misses(card, slot, &item, at);
                }
                // The part goes on to its next request, for the step after this one.
                let item = &mut card.warps[self.user.cluster][token.warp].items[self.place.item];
                item.next[service] += 1;
                if texture || last {
                    self.enter(wires.now(), needs, operations, last.then_some(place));
                } else {
                    // Loads and stores of a warp have one entry together.
                    self.place = WarpProgress { item: self.place.item + 1, line: 0, needs, missed: 0 };
                }
                did = Tick::Moved;
            }
            self.place = WarpProgress::default();
            card.warps[self.user.cluster][token.warp].asked[Service::Texture].pop_front();
            self.coalesced.lines.clear();
            self.coalesced.pieces.clear();
            self.coalesced.sectors.clear();
            self.coalesced.noted = false;
            wires.take(&self.input);
            did = Tick::Moved;
        }
        did
    }

    /// An entry goes into the FIFO, and the next part of the warp is current.
    #[inline(always)]
    fn enter(&mut self, now: Cycle, needs: Option<u32>, operations: u32, answer: Option<u32>) {
        let needs = needs.unwrap_or(self.misses.frontier());
        self.fifo.push_back(FilterQuad { needs, from: now + Cycle::from(self.config.latency), operations, answer });
        self.place = WarpProgress { item: self.place.item + 1, line: 0, needs: None, missed: 0 };
    }
}

impl Line {
    /// Sectors are asked for, and are there when all misses before a number are back.
    #[inline(always)]
    fn ask(&mut self, sectors: u8, needs: u32) {
        self.asked |= sectors;
        let mut left = sectors;
        while left != 0 {
            self.needs[left.trailing_zeros() as usize] = needs;
            left &= left - 1;
        }
    }
}

/// Bytes that a store writes into each of its lines.
pub(super) fn stored_bytes(request: &Request) -> u32 {
    (u32::from(request.operations) * 4 / u32::from(request.lines).max(1)).clamp(4, 64)
}

impl Unit<Card> for Texture {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Lines that have come.
        while let Some(tag) = self.memory.answer(wires) {
            self.misses.answer(tag);
            did = Tick::Moved;
        }

        // 2. Filter what is complete; it leaves in order.
        did = did.or(self.filter(wires));

        // 3. Address the next quads.
        did.or(self.address(wires, card))
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.fifo.len() as u64 + u64::from(self.misses.in_flight())
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.numbered(CACHES.named("texture"), |unit| (unit.user.number, unit.tags.counts()));
        groups.numbered(FILLS, |unit| (unit.user.number, unit.fills));
        groups.group_if(TEXTURES, |unit| (!unit.user.vertices).then_some(unit.counts));
    }
}
