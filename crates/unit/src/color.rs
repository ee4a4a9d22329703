//! The colour ROP, one unit per pipeline: blends shaded quads into its own part of the colour buffers, through a cache of blocks.

use std::collections::VecDeque;

use super::block_cache::{BlockCache, BlockCounts, Policy, Quads, ROP};
use super::block_sets::BlockSets;
use super::card::notes::note;
use super::card::{Card, Group, Output, Work};
use super::class_state::ClassState;
use super::compression::{Codec, Compression};
use super::copies::own;
use super::depth::mark;
use super::frame::FrameBuffers;
use super::tags::CacheCounts;
use super::token::fragments;
use super::token::{Ack, GroupToken, Kind};
use super::touch::Touching;
use gfx::format::TexelClass;
use gfx::rop::{Colors, composes_over};
use knob::Allowed;
use mem::{CACHES, MemoryPort};
use num::Cycle;
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;
use work::{Quad, Surface};

knob::knobs! {
    /// Blending and colour writes.
    pub struct ColorConfig {
        /// Quads written per cycle, once for each target.
        quads_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "8 pixels per cycle and partition in cards of 2010 to 2016"]
            {estimate: Used, relax: Rate, advice: []},
        /// Quads blended per cycle where the stored colour is read.
        blends_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "RGBA8 blends at full rate since 2010 (Mavridis and Papaioannou 2012: 8.28 Gpixel/s with and without)"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles that writing `quads_per_cycle` quads or blending `blends_per_cycle` quads takes, for rates below one quad per cycle.
        interval: u32 ["cycles", Allowed::Range(1, 64), "pipelined; 2 where a core writes two pixels per cycle (Mali-G57, Arm GPU Datasheet v7)"]
            {estimate: Used, relax: Never, advice: []},
        /// How many times as long a pixel of 64 bits takes to be written as one of up to 32 bits.
        write_64: u32 ["times", Allowed::Range(1, 16), "RGBA16F, RG32F: 2 (Mavridis and Papaioannou 2012: 4.61 and 4.56 of 8.28 Gpixel/s, GTX 460)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// The same of a pixel of 128 bits.
        write_128: u32 ["times", Allowed::Range(1, 16), "RGBA32F: 4 (Mavridis and Papaioannou 2012: 2.42 of 8.28 Gpixel/s)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// How many times as long a pixel of up to 32 bits with components of more than 8 bits takes to be blended as one with components of 8 bits.
        blend_packed: u32 ["times", Allowed::Range(1, 32), "RG16F: 2 (Mavridis and Papaioannou 2012: 4.52 of 8.28 Gpixel/s); R11G11B10F: 2 (hardware.fr 948)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// The same of a pixel with one component of 32 bits.
        blend_single: u32 ["times", Allowed::Range(1, 32), "R32F: 2: full rate on Radeons only (hardware.fr 948)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// The same of a pixel of 64 bits in narrower components.
        blend_halves: u32 ["times", Allowed::Range(1, 32), "RGBA16F: 2 (Mavridis and Papaioannou 2012: 4.56 of 8.28 Gpixel/s)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// The same of a pixel with two components of 32 bits.
        blend_pair: u32 ["times", Allowed::Range(1, 32), "RG32F: 4 (Mavridis and Papaioannou 2012: 1.99 of 8.28 Gpixel/s)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// The same of a pixel of 128 bits.
        blend_full: u32 ["times", Allowed::Range(1, 32), "RGBA32F: 8 (Mavridis and Papaioannou 2012: 1.10 of 8.28 Gpixel/s)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// Samples of a pixel that take as long as one; more take as many times as long.
        samples: u32 ["samples/pixel", Allowed::Range(1, 16), "4: no loss where samples compress (AMD GCN white paper 2012: up to 8 colour samples per pixel)"]
            {estimate: UsedBy("color.times"), relax: Never, advice: []},
        /// Blocks of 8x8 pixels of 32 bits, 256 bytes, that the colour cache holds. A block with more bytes takes the places of several.
        cache_blocks: u32 ["blocks", Allowed::PowerOfTwo(4, 65536), "assumed: 64 KB cover the latency of the second level; ATTILA bGPU.ini ColorCacheWays = 4, ColorCacheLines = 16 lines of 16 stamps"]
            {estimate: Used, relax: Cache, advice: [Cache("color")]},
        /// Ways of the colour cache; where they are as many as its blocks or more, any block goes anywhere.
        cache_ways: u32 ["ways", Allowed::PowerOfTwo(2, 65536), "assumed: all 64 tags are compared at once, so that no full set holds up what lies elsewhere; ATTILA bGPU.ini ColorCacheWays = 4"]
            {estimate: Used, relax: Never, advice: []},
        /// Which set of the cache is a block's.
        cache_sets: BlockSets ["", Allowed::Choice(BlockSets::NAMES), "caches fold addresses; ATTILA takes bits 8 to 11 of the address, of which 10 and 11 are the unit's"]
            {estimate: RefusedUnless(Is(&["hashed"]), "sets by position"), relax: Never, advice: []},
        /// Requests to memory in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory"]
            {estimate: RefusedUnless(AtLeast(2), "colours that wait one for the other"), relax: Room, advice: []},
        /// Groups of quads between lookup and blending.
        fifo: u32 ["groups", Allowed::Range(8, 4096), "assumed: covers the latency of the second level; ATTILA bGPU.ini COLORWRITE FetchQueueSize = 256 stamps"]
            {estimate: RefusedUnless(AtLeast(32), "blending with few quads in flight"), relax: Room, advice: []},
        /// Cycles from lookup to blending where the block is in the cache.
        latency: u32 ["cycles", Allowed::Range(1, 256), "assumed; ATTILA bGPU.ini BlendALULatency = 2 and the queues before it"]
            {estimate: Used, relax: Latency, advice: []},
        /// Whether blocks are compressed as they leave the cache.
        compression: bool ["", Allowed::Switch, "assumed; ATTILA bGPU.ini COLORWRITE DisableCompression = FALSE"]
            {estimate: Used, relax: Skip(&[("true", "compressed colours")]), advice: []},
        /// How they are: estimates of the bytes that they take (`--fidelity bound`) know `planes` only.
        codec: Codec ["", Allowed::Choice(Codec::NAMES), "cards since 2005 have planes of depth (Hasselgren and Akenine-Moller 2006); ATTILA CompressionAlgorithm = 0: two references"]
            {estimate: RefusedUnless(Is(&["planes"]), "blocks compressed by references"), relax: Never, advice: []},
        /// Whether a block that is stored raw is compressed when it is written again; if not, it is raw until its surface is cleared.
        recompress: bool ["", Allowed::Switch, "a compressor sees whole blocks; ATTILA's ROPCache writes a block that is uncompressed in memory uncompressed"]
            {estimate: RefusedUnless(Is(&["true"]), "blocks that stay raw"), relax: Never, advice: []},
        /// Whether a block that is overwritten whole is not read from memory before.
        skip_reads: bool ["", Allowed::Switch, "write-validate caches (Jouppi 1993); a Radeon X700 XT writes 82 % of its pins' bytes in opaque fills (Beyond3D 2004)"]
            {estimate: Used, relax: Skip(&[("true", "no reads of blocks that are overwritten whole")]), advice: []},
        /// Whether memory takes single bytes of a block that is stored raw, so that only what is blended is ever read; needs `skip_reads`.
        masked_writes: bool ["", Allowed::Switch, "DRAMs have data masks; ATTILA reads a block to write it only where it is stored compressed, as its counters show"]
            {estimate: RefusedUnless(Is(&["false"]), "blocks that are written in part"), relax: Skip(&[("true", "blocks written in part, without reads")]), advice: []},
        /// Whether a pass that clears an attachment sets flags instead of writing memory.
        fast_clear: bool ["", Allowed::Switch, "in cards since the Radeon of 2000"]
            {estimate: Used, relax: Skip(&[("true", "fast clears")]), advice: []},
        /// Blocks whose flags are set per cycle, in each pipeline.
        clears_per_cycle: u32 ["blocks/cycle", Allowed::Range(1, 4096), "assumed; ATTILA bGPU.ini BlocksClearedPerCycle = 1024 for the card"]
            {estimate: RefusedUnless(AtLeast(2), "slow clears of flags"), relax: Rate, advice: []},
    }
}

impl ColorConfig {
    /// How many times as long as a pixel of 8-bit components with one sample one of a class and number of samples takes, written or
    /// blended.
    pub fn times(&self, texel: TexelClass, samples: u32, blended: bool) -> u64 {
        let of_format = match (texel, blended) {
            (TexelClass::Bytes, _) | (TexelClass::Packed | TexelClass::Single, false) => 1,
            (TexelClass::Halves | TexelClass::Pair, false) => self.write_64,
            (TexelClass::Full, false) => self.write_128,
            (TexelClass::Packed, true) => self.blend_packed,
            (TexelClass::Single, true) => self.blend_single,
            (TexelClass::Halves, true) => self.blend_halves,
            (TexelClass::Pair, true) => self.blend_pair,
            (TexelClass::Full, true) => self.blend_full,
        };
        u64::from(of_format * samples.div_ceil(self.samples))
    }
}

/// Ports of the colour unit.
#[derive(Clone)]
pub struct ColorPorts {
    /// Quads from the cores.
    pub shaded: In<GroupToken>,
    /// Quads from the late depth test.
    pub tested: In<GroupToken>,
    /// The end of a pass, to the depth unit.
    pub end: Out<Ack>,
    /// Fences seen, to the command processor.
    pub ack: Out<Ack>,
}

/// A group and a target between lookup and blending, or a fence.
#[derive(Clone, Copy, Debug)]
struct ColorGroup {
    token: GroupToken,
    /// The target, among those that the draw writes, and whether its colours are read.
    output: u8,
    reads: bool,
    /// How many times as long as pixels of 8-bit components its pixels take.
    times: u8,
    /// Whether it is the group's last.
    last: bool,
    line: Option<u32>,
    from: Cycle,
}

/// The colour unit. Its items are quads written, counted once for each target.
#[derive(Clone)]
pub struct Color {
    config: ColorConfig,
    pipeline: u8,
    ports: ColorPorts,
    cache: BlockCache,
    fifo: VecDeque<ColorGroup>,
    /// The group that is next in order, and its next target among those that are written.
    sequence: u32,
    output: u8,
    /// When the blending units are free, in cycles times `quads_per_cycle`.
    free_at: u64,
    /// A pass has ended: writing back.
    ending: bool,
    blended: BlendCounts,
    items: u64,
}

/// The heading of colour units in the statistics.
pub const BLENDING: Heading = Heading::new("blending.color[i]", "What the colour units blended.");

stats::counters! {
    /// What a colour unit has blended.
    pub struct BlendCounts {
        /// Quads blended with what was stored, once for each target.
        quads: "quads",
    }
}

impl Color {
    /// An idle colour ROP of pipeline `pipeline`, with an empty cache.
    pub fn new(config: ColorConfig, pipeline: u8, ports: ColorPorts, memory: MemoryPort) -> Color {
        let compression = Compression { enabled: config.compression, codec: config.codec, again: config.recompress };
        Color {
            cache: BlockCache::new(config.cache_blocks, config.cache_ways, config.misses, compression, memory)
                .with(Policy { sets: config.cache_sets, masked: config.masked_writes && config.skip_reads }),
            fifo: VecDeque::with_capacity(config.fifo as usize + 8),
            sequence: 0,
            output: 0,
            free_at: 0,
            ending: false,
            blended: BlendCounts::default(),
            items: 0,
            config,
            pipeline,
            ports,
        }
    }

    /// The counters of the cache's tags.
    pub fn cache(&self) -> CacheCounts {
        self.cache.cache()
    }

    /// The counters of what the cache moved.
    pub fn counts(&self) -> BlockCounts {
        self.cache.counts()
    }

    /// Takes note that functional warming has written a block.
    pub(super) fn visit(&mut self, frame: &mut FrameBuffers, at: (usize, u32), memory: &mut Touching) {
        self.cache.visit(frame, at, true, memory);
    }

    /// Blends one group into one target.
    #[inline(always)]
    fn blend(&mut self, card: &mut Card, entry: ColorGroup, line: u32) {
        let Card { groups, work, frame, class_state: ClassState { copies, .. }, .. } = card;
        let frame = own(frame, copies, self.pipeline);
        let group = &groups[usize::from(self.pipeline)][entry.token.group];
        let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
        blend_group(work, group, &work.outputs[usize::from(entry.output)], frame);
        self.cache.release(line as usize, true);
        self.items += u64::from(entry.token.quads);
    }

    /// Blends what is ready, in order.
    #[inline(always)]
    fn drain(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let rate = u64::from(self.config.quads_per_cycle);
        let pipeline = usize::from(self.pipeline);
        while let Some(&entry) = self.fifo.front() {
            let now = wires.now();
            if entry.from > now {
                wires.sleep_until(entry.from);
                return did.or(Tick::Working);
            }
            if entry.token.kind != Kind::DATA {
                // A fence: everything before it is in the cache.
                if entry.token.kind == Kind::TILE {
                    let done = self.end_tile(card, entry.token);
                    if done != Tick::Moved || self.ending {
                        return done.or(did);
                    }
                    self.fifo.pop_front();
                    did = Tick::Moved;
                    continue;
                }
                if entry.token.kind == Kind::PASS {
                    self.ending = true;
                    return self.finish(wires, card, entry).or(did);
                }
                let ack = Ack { slot: entry.token.group as u16, kind: entry.token.kind };
                if !wires.try_push(&self.ports.ack, ack) {
                    return did.or(Tick::Blocked);
                }
                self.fifo.pop_front();
                did = Tick::Moved;
                continue;
            }
            if let Some(line) = entry.line {
                if !self.cache.ready(line as usize) {
                    return did.or(Tick::Memory);
                }
                if self.free_at >= (now + 1) * rate {
                    wires.sleep_until(self.free_at / rate);
                    return did.or(Tick::Working);
                }
                let quads = u64::from(entry.token.quads);
                // Blending takes the turns of as many writes as it is slower.
                let turns = if entry.reads { (quads * rate).div_ceil(u64::from(self.config.blends_per_cycle)) } else { quads };
                let turns = turns * u64::from(entry.times) * u64::from(self.config.interval);
                self.free_at = self.free_at.max(now * rate) + turns;
                self.blend(card, entry, line);
            }
            if entry.last {
                let group = &card.groups[pipeline][entry.token.group];
                let written: u32 = group.live[..usize::from(group.count)].iter().map(|&live| fragments(live)).sum();
                card.funnel[group.slot].fragments_written += u64::from(written);
                if let Some(copy) = card.class_state.copies.get_mut(pipeline) {
                    mark(card.work[usize::from(group.slot)].as_ref().expect("in flight"), group, &mut copy.stamps, true);
                }
                card.groups[pipeline].remove(entry.token.group);
            }
            self.fifo.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Writes back at the end of a tile what is wanted of it, and forgets the rest.
    #[cold]
    fn end_tile(&mut self, card: &mut Card, token: GroupToken) -> Tick {
        let Card { frame, class_state: ClassState { copies, .. }, passes, .. } = card;
        let frame = own(frame, copies, self.pipeline);
        let pass = passes.current().expect("tiles are drawn in a pass");
        // More of the pass follows: all blocks are needed again. A surface that is resolved is read from memory, stored or not.
        let keep = |surface: usize| {
            let index = pass.color.iter().position(|&index| index == Some(surface));
            let attachment = index.and_then(|index| pass.pass.color[index]);
            token.group != 0 || attachment.is_some_and(|attachment| attachment.store || attachment.resolve.is_some())
        };
        let did = self.cache.flush_tile(frame, keep);
        if did != Tick::Moved && self.cache.flushed() {
            self.ending = false;
            return Tick::Moved;
        }
        did
    }

    /// Writes the cache back at the end of a pass, then passes the fence on.
    #[cold]
    fn finish(&mut self, wires: &mut Wires, card: &mut Card, entry: ColorGroup) -> Tick {
        let Card { frame, class_state: ClassState { copies, .. }, passes, .. } = card;
        let frame = own(frame, copies, self.pipeline);
        let pass = passes.get(entry.token.group as u8).expect("a pass is ending");
        let keep = |surface: usize| {
            let index = pass.color.iter().position(|&index| index == Some(surface));
            index.and_then(|index| pass.pass.color[index]).is_some_and(|attachment| attachment.store)
        };
        // Attachments that are resolved are read again from memory, stored or not.
        let resolved = |surface: usize| {
            let index = pass.color.iter().position(|&index| index == Some(surface));
            index.and_then(|index| pass.pass.color[index]).is_some_and(|attachment| attachment.resolve.is_some())
        };
        let did = self.cache.flush(frame, |surface| keep(surface) || resolved(surface));
        if did == Tick::Moved || !self.cache.flushed() {
            return did;
        }
        if !wires.can_push(&self.ports.end) || !wires.can_push(&self.ports.ack) {
            return Tick::Blocked;
        }
        let ack = Ack { slot: entry.token.group as u16, kind: Kind::PASS };
        wires.push(&self.ports.end, ack);
        wires.push(&self.ports.ack, ack);
        self.ending = false;
        self.fifo.pop_front();
        Tick::Moved
    }

    /// Looks up the next groups in order, one target at a time.
    #[inline(always)]
    fn accept(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = self.config.quads_per_cycle;
        loop {
            // The group whose turn it is comes either straight from the cores or from the late test.
            let from_shaded = wires.front(&self.ports.shaded).filter(|token| token.sequence == self.sequence);
            let (token, shaded) = match from_shaded {
                Some(token) => (token, true),
                None => match wires.front(&self.ports.tested).filter(|token| token.sequence == self.sequence) {
                    Some(token) => (token, false),
                    None => return did,
                },
            };
            if self.fifo.len() as u32 >= self.config.fifo {
                return did.or(Tick::Blocked);
            }
            if budget == 0 {
                return Tick::Moved;
            }
            let from = wires.now() + Cycle::from(self.config.latency);
            let mut entry = ColorGroup { token, output: self.output, reads: false, times: 1, last: true, line: None, from };
            if token.kind == Kind::DATA && token.quads > 0 {
                let Card { groups, work, passes, frame, class_state: ClassState { copies, .. }, notes, .. } = card;
                let frame = own(frame, copies, self.pipeline);
                let group = &groups[usize::from(self.pipeline)][token.group];
                let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
                if let Some(output) = work.outputs.get(usize::from(self.output)) {
                    let quads = if self.config.skip_reads {
                        quads(frame, work, group, output, self.config.masked_writes)
                    } else {
                        Quads::ANY
                    };
                    match self.cache.pin(frame, output.surface, group.block, quads, &mut None) {
                        Ok(place) => entry.line = Some(place as u32),
                        Err(stall) => return did.or(stall),
                    }
                    self.output += 1;
                    entry.reads = output.reads;
                    let Surface { format, samples, .. } = frame.stores[output.surface].surface;
                    entry.times = self.config.times(format.texel_class(), samples, output.reads) as u8;
                    entry.last = usize::from(self.output) == work.outputs.len();
                    if output.combines {
                        self.blended.quads +=
                            group.live[..usize::from(group.count)].iter().filter(|live| **live != 0).count() as u64;
                    }
                }
                budget = budget.saturating_sub(u32::from(token.quads));
                if let Some(notes) = notes {
                    note(notes, passes.get(work.pass), group.block, |block| block.drawn = from);
                }
            }
            self.fifo.push_back(entry);
            did = Tick::Moved;
            if matches!(token.kind, Kind::TILE | Kind::PASS) {
                // The blocks in the cache belong to the tile or pass that ends.
                self.ending = true;
            }
            if entry.last {
                self.output = 0;
                self.sequence = self.sequence.wrapping_add(1);
                if shaded {
                    wires.take(&self.ports.shaded)
                } else {
                    wires.take(&self.ports.tested)
                };
                if self.ending {
                    return did;
                }
            }
        }
    }
}

/// Blends a group's quads into one target.
#[inline(always)]
pub(super) fn blend_group(work: &Work, group: &Group, output: &Output, frame: &mut FrameBuffers) {
    let &Output { surface, ref state, .. } = output;
    if work.marks.over && output.combines {
        empty(frame, work, group, surface);
    }
    let store = &mut frame.stores[surface];
    let samples = store.surface.samples as usize;
    let tile = &work.segment.tiles[group.tile as usize];
    let quads = &tile.quads[group.first as usize..][..usize::from(group.count)];
    if state.groups() && !output.packed {
        // Behind the group's last quad there may be anything in `live`.
        let (mut at, mut coverage) = ([0; 4], [0; 4]);
        let (mut src, mut src1) = ([[0.0; 16]; 4], [[0.0; 16]; 4]);
        for (q, (&live, quad)) in group.live.iter().zip(quads).enumerate() {
            if live != 0 {
                (at[q], coverage[q]) = (quad.position, live);
                put_colors(payload(&tile.payload, quad, output.payload), output, q, &mut src);
                if let Some(second) = output.second {
                    put_colors(payload(&tile.payload, quad, second), output, q, &mut src1);
                }
            }
        }
        state.blend_group(samples, (&at, &coverage), &src, &src1, store.block_mut(group.block));
        return;
    }
    for (&live, quad) in group.live.iter().zip(quads) {
        if live == 0 {
            continue;
        }
        let words = payload(&tile.payload, quad, output.payload);
        let run = store.quad_mut(group.block, quad.position);
        if output.packed {
            state.put_quad(samples, live, words, run);
        } else {
            let src = colors(words, output);
            let src1 = match output.second {
                Some(second) => colors(payload(&tile.payload, quad, second), output),
                None => [[0; 4]; 4],
            };
            state.blend_quad(samples, live, &src, &src1, run);
        }
    }
}

/// The quads of its block that a group writes whole in a target, and those whose stored colours it keeps in part or reads.
fn quads(frame: &FrameBuffers, work: &Work, group: &Group, output: &Output, masked: bool) -> Quads {
    if masked && !output.combines {
        // Pixels and channels that are not written are masked.
        let tile = &work.segment.tiles[group.tile as usize];
        let all = &tile.quads[group.first as usize..][..usize::from(group.count)];
        let live = group.live.iter().zip(all).filter(|(live, _)| **live != 0);
        return Quads { whole: live.fold(0, |mask, (_, quad)| mask | 1 << quad.position), part: 0 };
    }
    if output.reads {
        return Quads::ANY;
    }
    let full = u16::MAX >> (16 - 4 * frame.stores[output.surface].surface.samples);
    let tile = &work.segment.tiles[group.tile as usize];
    let mut quads = Quads::default();
    for (&live, quad) in group.live.iter().zip(&tile.quads[group.first as usize..][..usize::from(group.count)]) {
        match live {
            0 => {}
            live if live == full => quads.whole |= 1 << quad.position,
            _ => quads.part |= 1 << quad.position,
        }
    }
    quads
}

/// Empties the samples that are blended first. For a copy that is blended over nothing, and put over what is behind it later.
#[cold]
fn empty(copy: &mut FrameBuffers, work: &Work, group: &Group, surface: usize) {
    let FrameBuffers { stores, stamps } = copy;
    let store = &mut stores[surface];
    if !composes_over(store.surface.format) {
        return;
    }
    let words = store.words as usize;
    let quads = &work.segment.tiles[group.tile as usize].quads[group.first as usize..][..usize::from(group.count)];
    for (&live, quad) in group.live.iter().zip(quads) {
        let mut left = stamps.untouched(group.block, quad.position, live);
        let run = store.quad_mut(group.block, quad.position);
        while left != 0 {
            let bit = left.trailing_zeros() as usize;
            left &= left - 1;
            (0..words).for_each(|w| run[bit / 4 * 4 * words + 4 * w + bit % 4] = 0);
        }
    }
}

/// Words of a quad's payload from one of its words on.
#[inline(always)]
fn payload<'a>(payload: &'a [u32], quad: &Quad, first: u8) -> &'a [u32] {
    &payload[quad.payload as usize + usize::from(first)..]
}

/// A quad's colours, channel by channel.
#[inline(always)]
fn colors(words: &[u32], output: &Output) -> [[u32; 4]; 4] {
    let count = usize::from(output.words).min(4);
    std::array::from_fn(|c| if c < count { std::array::from_fn(|p| words[4 * c + p]) } else { [0; 4] })
}

/// Puts a quad's colours among those of its group, channel by channel.
#[inline(always)]
fn put_colors(words: &[u32], output: &Output, quad: usize, colors: &mut Colors<16>) {
    for (channel, words) in colors.iter_mut().zip(words.chunks_exact(4)).take(usize::from(output.words)) {
        for p in 0..4 {
            channel[4 * quad + p] = f32::from_bits(words[p]);
        }
    }
}

impl Unit<Card> for Color {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Memory: blocks come, requests go.
        let mut did = Tick::moved_or(self.cache.exchange(wires), Tick::Starved);

        // 2. Blend what is ready.
        did = did.or(self.drain(wires, card));

        // 3. Look the next ones up, in order.
        if !self.ending {
            did = did.or(self.accept(wires, card));
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.fifo.len() as u64 + self.cache.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(CACHES.named("color"), |unit| unit.cache.cache());
        groups.group(BLENDING, |unit| unit.blended);
        groups.group(ROP.named("color"), |unit| unit.cache.counts());
    }
}
