//! Depth and stencil, one unit per pipeline: the early tests of quads on their way to the cores and the late tests of those that come
//! back, through one Z cache. The tests are applied for real to the machine's own depth buffer, in the order of arrival.

mod questions;

use std::collections::VecDeque;

use super::block_cache::{BlockCache, BlockCounts, Policy, Quads, ROP};
use super::block_sets::BlockSets;
use super::card::notes::note;
use super::card::{Ahead, Card, Group, Work};
use super::class_state::ClassState;
use super::compression::{Codec, Compression};
use super::copies::own;
use super::depths::{Tested, bounds, test_group};
use super::frame::FrameBuffers;
use super::stamps::Stamps;
use super::tags::CacheCounts;
use super::token::{Ack, DepthBounds, GroupToken, Kind, bytes, fragments};
use super::touch::Touching;
use super::traverse::HierarchicalUpdate;
use knob::Allowed;
use mem::{CACHES, MemoryPort};
use num::Cycle;
use questions::Questions;
use sim::{Counted, In, Out, Tick, Unit, Wires};

pub use questions::QuestionPorts;

knob::choices! {
    /// What becomes of the Z cache at the end of a pass.
    pub enum PassEnd {
        /// It is written back and emptied.
        WriteBack "write-back",
        /// It stays as it is: blocks go to memory when others need their places, unless the surface is cleared before.
        Keep "keep",
    }
}

knob::knobs! {
    /// Depth and stencil tests, early and late.
    pub struct DepthConfig {
        /// Whether depth and stencil are tested before shading, where that cannot change the result; else all tests come after it.
        early: bool ["", Allowed::Switch, "in cards since the Radeon of 2000"]
            {estimate: RefusedUnless(Is(&["true"]), "late tests of everything"), relax: Skip(&[("true", "early Z")]), advice: [LateFailures, NothingHidden]},
        /// Quads tested per cycle, early and late together.
        quads_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "assumed: twice as many as colours are written; ATTILA bGPU.ini ZSTENCILTEST StampsPerCycle = 1"]
            {estimate: Used, relax: Rate, advice: []},
        /// Blocks of 8x8 pixels of 32 bits, 256 bytes, that the Z cache holds. A block with more bytes takes the places of several.
        cache_blocks: u32 ["blocks", Allowed::PowerOfTwo(4, 65536), "assumed: 64 KB cover the latency of the second level; ATTILA bGPU.ini ZCacheWays = 4, ZCacheLines = 16 lines of 16 stamps"]
            {estimate: Used, relax: Cache, advice: [Cache("depth")]},
        /// Ways of the Z cache; where they are as many as its blocks or more, any block goes anywhere.
        cache_ways: u32 ["ways", Allowed::PowerOfTwo(2, 65536), "assumed: as those of the colour cache; ATTILA bGPU.ini ZCacheWays = 4"]
            {estimate: Used, relax: Never, advice: []},
        /// Which set of the cache is a block's.
        cache_sets: BlockSets ["", Allowed::Choice(BlockSets::NAMES), "caches fold addresses; ATTILA takes bits 8 to 11 of the address, of which 10 and 11 are the unit's"]
            {estimate: RefusedUnless(Is(&["hashed"]), "sets by position"), relax: Never, advice: []},
        /// Requests to memory in flight.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory"]
            {estimate: RefusedUnless(AtLeast(2), "depths that wait one for the other"), relax: Room, advice: []},
        /// Groups of quads between lookup and test, for the early and for the late tests each.
        fifo: u32 ["groups", Allowed::Range(1, 4096), "assumed: covers the latency of the second level; ATTILA bGPU.ini ZSTENCILTEST FetchQueueSize = 256 stamps"]
            {estimate: RefusedUnless(AtLeast(32), "depth tests with few quads in flight"), relax: Room, advice: []},
        /// Cycles from lookup to test where the block is in the cache.
        latency: u32 ["cycles", Allowed::Range(1, 256), "assumed; ATTILA bGPU.ini ZALULatency = 2 and the queues before it"]
            {estimate: Used, relax: Latency, advice: []},
        /// What becomes of the cache at the end of a pass. Kept blocks are still in the cache for what reads depths from memory: no time is
        /// modelled for bringing them there.
        pass_end: PassEnd ["", Allowed::Choice(PassEnd::NAMES), "a pass's depths can be read as a texture after it; ATTILA flushes colours alone at a swap"]
            {estimate: RefusedUnless(Is(&["write-back"]), "depths that stay in the cache"), relax: Never, advice: []},
        /// Whether blocks are compressed as they leave the cache.
        compression: bool ["", Allowed::Switch, "assumed; ATTILA bGPU.ini DisableCompression = FALSE"]
            {estimate: Used, relax: Skip(&[("true", "compressed depths")]), advice: []},
        /// How they are: estimates of the bytes that they take (`--fidelity bound`) know `planes` only.
        codec: Codec ["", Allowed::Choice(Codec::NAMES), "cards since 2005 have planes of depth (Hasselgren and Akenine-Moller 2006); ATTILA CompressionAlgorithm = 0: two references"]
            {estimate: RefusedUnless(Is(&["planes"]), "blocks compressed by references"), relax: Never, advice: []},
        /// Whether a block that is stored raw is compressed when it is written again; if not, it is raw until its surface is cleared.
        recompress: bool ["", Allowed::Switch, "a compressor sees whole blocks; ATTILA's ROPCache writes a block that is uncompressed in memory uncompressed"]
            {estimate: RefusedUnless(Is(&["true"]), "blocks that stay raw"), relax: Never, advice: []},
        /// Cycles from here to interpolation.
        output_latency: u32 ["cycles", Allowed::Range(1, 64), "assumed: wires"]
            {estimate: RefusedUnless(AtMost(32), "long ways behind depth tests"), relax: Latency, advice: []},
        /// Groups of quads queued before interpolation.
        output_queue: u32 ["groups", Allowed::Range(2, 4096), "assumed; ATTILA bGPU.ini EarlyZTestedStampQueueSize = 32"]
            {estimate: RefusedUnless(AtLeast(4), "short queues behind depth tests"), relax: Room, advice: []},
    }
}

/// Ports of the depth unit.
#[derive(Clone)]
pub struct DepthPorts {
    /// Quads from traversal, and to interpolation; none: this unit tests only what is shaded.
    pub early: Option<TestPorts>,
    /// Shaded quads to be tested, and to the colour unit; none: this unit tests only what is not yet shaded.
    pub late: Option<TestPorts>,
    /// Questions of pipelines that draw here and own nothing, if there are any.
    pub questions: Option<QuestionPorts>,
    /// New bounds, to hierarchical Z, and when they are sent.
    pub updates: Option<(Out<DepthBounds>, HierarchicalUpdate)>,
    /// The colour unit has seen the end of the pass.
    pub end: In<Ack>,
    /// The cache is written back, to the command processor.
    pub ack: Out<Ack>,
}

/// The way of quads through a test.
#[derive(Clone)]
pub struct TestPorts {
    /// To be tested.
    pub input: In<GroupToken>,
    /// Tested.
    pub output: Out<GroupToken>,
}

stats::counters! {
    /// Checks of what hierarchical Z has accepted.
    pub struct DepthCounts {
        /// Samples of blocks that hierarchical Z has accepted, and that fail when they are tested: none, if its bounds hold.
        accepted_failed: "samples",
    }
}

/// A group between lookup and test.
#[derive(Clone, Copy, Debug)]
struct DepthGroup {
    token: GroupToken,
    /// The block's place in the cache; none: nothing is tested.
    line: Option<u32>,
    from: Cycle,
}

/// The depth unit. Its items are quads tested.
#[derive(Clone)]
pub struct Depth {
    config: DepthConfig,
    pipeline: u8,
    ports: DepthPorts,
    cache: BlockCache,
    early: VecDeque<DepthGroup>,
    late: VecDeque<DepthGroup>,
    questions: Option<Box<Questions>>,
    /// Quads on their way to the cores and back to their late test. (Groups may be parted on the way.)
    away: u32,
    /// The end of a tile is under way: nothing of the next is looked up.
    ending: bool,
    /// All blocks of that tile are written back.
    ended: bool,
    /// Passes that have ended here. What belongs to a later one than the next waits until all blocks are written back.
    ended_passes: u32,
    /// When the testers are free, in cycles times `quads_per_cycle`.
    free_at: u64,
    /// Bounds to be sent.
    bounds: VecDeque<DepthBounds>,
    /// Where blocks are kept: the current pass, and the surfaces that have blocks here, with their renewals.
    pass: u32,
    kept: Vec<(usize, u32)>,
    told: DepthCounts,
    items: u64,
}

impl Depth {
    /// An idle depth unit of pipeline `pipeline`, with an empty cache.
    pub fn new(config: DepthConfig, pipeline: u8, mut ports: DepthPorts, memory: MemoryPort) -> Depth {
        let compression = Compression { enabled: config.compression, codec: config.codec, again: config.recompress };
        Depth {
            cache: BlockCache::new(config.cache_blocks, config.cache_ways, config.misses, compression, memory)
                .with(Policy { sets: config.cache_sets, ..Policy::default() }),
            early: VecDeque::with_capacity(config.fifo as usize),
            late: VecDeque::with_capacity(config.fifo as usize),
            questions: ports.questions.take().map(|ports| Box::new(Questions::new(ports))),
            away: 0,
            ending: false,
            ended_passes: 0,
            ended: false,
            free_at: 0,
            bounds: VecDeque::with_capacity(4),
            pass: u32::MAX,
            kept: Vec::new(),
            told: DepthCounts::default(),
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

    /// The counters of the unit: what its checks of hierarchical Z have found.
    pub fn told(&self) -> DepthCounts {
        self.told
    }

    /// Whether the unit sends new bounds to hierarchical Z at the events of kind `when`.
    #[inline(always)]
    fn tells(&self, when: HierarchicalUpdate) -> bool {
        self.ports.updates.as_ref().is_some_and(|&(_, update)| update == when)
    }

    /// Takes note that functional warming has used a block; gives the bounds of blocks that the unit would have sent to hierarchical Z for
    /// that.
    #[must_use]
    pub(super) fn visit(
        &mut self,
        frame: &mut FrameBuffers,
        at: (usize, u32),
        written: bool,
        pass: u32,
        memory: &mut Touching,
    ) -> Vec<DepthBounds> {
        let mut left = self.cache.visit(frame, at, written, memory);
        left.retain(|&(surface, _)| surface == at.0 && self.tells(HierarchicalUpdate::Eviction));
        if written && self.tells(HierarchicalUpdate::Write) {
            left.push(at);
        }
        left.into_iter().map(|(surface, block)| bounds(&frame.stores[surface], block, pass)).collect()
    }

    /// Looks a group's block up; `Ok(None)` where nothing is tested.
    #[inline(always)]
    fn look_up(&mut self, card: &mut Card, token: GroupToken) -> Result<Option<u32>, Tick> {
        let Card { groups, work, passes, frame, class_state: ClassState { copies, .. }, .. } = card;
        let frame = own(frame, copies, self.pipeline);
        let group = &groups[usize::from(self.pipeline)][token.group];
        let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
        let Some(pass) = passes.get(work.pass) else { return Ok(None) };
        let (surface, pass_number) = (pass.depth, pass.number);
        let (Some(state), Some(surface)) = (&work.depth, surface) else { return Ok(None) };
        if state.is_idle() {
            return Ok(None);
        }
        if self.config.pass_end == PassEnd::Keep && self.pass != pass_number {
            self.pass = pass_number;
            forget_renewed(&mut self.cache, &mut self.kept, frame, surface);
        }
        // Bounds of a block that leaves must find room.
        if self.bounds.len() >= 3 {
            return Err(Tick::Blocked);
        }
        let mut left = None;
        let quads = match group.ahead {
            // A block whose samples all pass, and of which nothing is written, need not be looked up.
            Ahead::Passes => return Ok(None),
            Ahead::Writes => written(work, group, frame.stores[surface].surface.samples),
            Ahead::Nothing => Quads::ANY,
        };
        let place = self.cache.pin(frame, surface, group.block, quads, &mut left);
        // A block of another surface, kept from a pass before, says nothing of this one's depths.
        if let Some((left, block)) = left
            && left == surface
            && self.tells(HierarchicalUpdate::Eviction)
        {
            self.bounds.push_back(bounds(&frame.stores[surface], block, pass_number));
        }
        Ok(Some(place? as u32))
    }

    /// Tests a group for real; returns the quads that are still alive.
    // Not inlined: the early and the late test share it, and the host's instruction cache is small.
    #[inline(never)]
    fn test(&mut self, card: &mut Card, token: GroupToken, line: u32, late: bool) -> u8 {
        let Card { groups, work, passes, frame, class_state: ClassState { copies, .. }, funnel, .. } = card;
        let frame = own(frame, copies, self.pipeline);
        let group = &mut groups[usize::from(self.pipeline)][token.group];
        let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
        let pass = passes.get(work.pass).expect("quads are tested in a pass");
        let (Some(state), Some(surface)) = (&work.depth, pass.depth) else { return token.quads };
        let store = &mut frame.stores[surface];
        let Tested { alive, failed_fragments, failed_samples } = test_group(state, work, group, pass, store, late);
        if late {
            funnel[group.slot].fragments_late_failed += u64::from(failed_fragments);
        }
        if group.ahead == Ahead::Writes {
            self.told.accepted_failed += u64::from(failed_samples);
        }
        let written = state.writes_depth() || state.writes_stencil();
        self.cache.release(line as usize, written);
        if written && self.tells(HierarchicalUpdate::Write) {
            self.bounds.push_back(bounds(store, group.block, pass.number));
        }
        self.items += u64::from(token.quads);
        alive
    }

    /// Tests what is ready at the head of one of the queues.
    #[inline(always)]
    fn drain(&mut self, wires: &mut Wires, card: &mut Card, late: bool) -> Tick {
        let mut did = Tick::Starved;
        let rate = u64::from(self.config.quads_per_cycle);
        loop {
            let queue = if late { &self.late } else { &self.early };
            let Some(&entry) = queue.front() else { return did };
            if entry.from > wires.now() {
                wires.sleep_until(entry.from);
                return did.or(Tick::Working);
            }
            if entry.token.kind == Kind::TILE && !late {
                let done = self.end_tile(card, entry.token);
                if !self.ended {
                    return did.or(done);
                }
            }
            if let Some(line) = entry.line
                && !self.cache.ready(line as usize)
            {
                return did.or(Tick::Memory);
            }
            // The testers are at work on what came before.
            if self.free_at >= (wires.now() + 1) * rate {
                wires.sleep_until(self.free_at / rate);
                return did.or(Tick::Working);
            }
            if self.bounds.len() >= 3 {
                return did.or(Tick::Blocked);
            }
            let ports = if late { &self.ports.late } else { &self.ports.early };
            let Some(TestPorts { output, .. }) = ports else { return did };
            if !wires.can_push(output) {
                return did.or(Tick::Blocked);
            }
            if entry.token.kind == Kind::DATA {
                self.free_at = self.free_at.max(wires.now() * rate) + u64::from(entry.token.quads.max(1));
            }
            if late {
                self.late.pop_front()
            } else {
                self.early.pop_front()
            };
            did = Tick::Moved;
            let mut token = entry.token;
            if token.kind != Kind::DATA {
                if token.kind == Kind::TILE {
                    (self.ending, self.ended) = (false, false);
                }
                wires.push_sized(output, token, bytes::MARK);
                continue;
            }
            let before = token.quads;
            if let Some(line) = entry.line {
                token.quads = self.test(card, token, line, late);
            }
            let ports = if late { &self.ports.late } else { &self.ports.early };
            let Some(TestPorts { output, .. }) = ports else { return did };
            let pipeline = usize::from(self.pipeline);
            if late {
                // The colour unit counts groups to keep their order, so an empty one goes on too.
                if self.ports.early.is_some() {
                    self.away -= u32::from(card.groups[pipeline][token.group].count);
                } else {
                    token.quads = drop_discarded(card, pipeline, token);
                }
                wires.push_sized(output, token, u32::from(token.quads).max(1) * bytes::QUAD);
                continue;
            }
            let group = card.groups[pipeline][token.group];
            if entry.line.is_some() {
                card.funnel[group.slot].quads_early_culled += u64::from(before - token.quads);
                let pass = card.work(group.slot).pass;
                if let Some(notes) = &mut card.notes {
                    note(notes, card.passes.get(pass), group.block, |block| block.early += u32::from(before - token.quads));
                }
            }
            let work = card.work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
            if !work.draw.shades() {
                // Depth and stencil only: done.
                let written: u32 = group.live[..usize::from(group.count)].iter().map(|&live| fragments(live)).sum();
                card.funnel[group.slot].fragments_written += u64::from(written);
                if let Some(copy) = card.class_state.copies.get_mut(pipeline) {
                    mark(work, &group, &mut copy.stamps, false);
                }
                card.groups[pipeline].remove(token.group);
            } else if token.quads == 0 {
                card.groups[pipeline].remove(token.group);
            } else {
                wires.push_sized(output, token, u32::from(token.quads) * bytes::QUAD);
            }
        }
    }

    /// Takes the token at the head of an input.
    #[inline(always)]
    fn take(&mut self, wires: &mut Wires, late: bool) {
        let ports = if late { &self.ports.late } else { &self.ports.early };
        if let Some(ports) = ports {
            wires.take(&ports.input);
        }
    }

    /// Whether work belongs to a pass that must wait for the end of the pass before, which empties the cache.
    #[inline(always)]
    fn is_ahead(&self, card: &Card, work: &Work) -> bool {
        card.passes.get(work.pass).is_some_and(|pass| pass.number != self.ended_passes)
    }

    /// Looks up what comes from traversal.
    #[inline(always)]
    fn accept_early(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = self.config.quads_per_cycle;
        while let Some(token) = self.ports.early.as_ref().and_then(|ports| wires.front(&ports.input)) {
            if self.early.len() as u32 == self.config.fifo {
                return did.or(Tick::Blocked);
            }
            let mut line = None;
            if self.ending {
                return did.or(Tick::Blocked);
            }
            self.ending = token.kind == Kind::TILE;
            if token.kind == Kind::DATA {
                if budget == 0 {
                    return Tick::Moved;
                }
                let group = &card.groups[usize::from(self.pipeline)][token.group];
                let work = card.work(group.slot);
                if self.is_ahead(card, work) {
                    return did.or(Tick::Blocked);
                }
                if work.early {
                    // Quads that are tested late come before this one in API order, and have yet to be.
                    if self.away > 0 {
                        return did.or(Tick::Blocked);
                    }
                    line = match self.look_up(card, token) {
                        Ok(line) => line,
                        Err(stall) => return did.or(stall),
                    };
                } else {
                    self.away += u32::from(group.count);
                }
                budget = budget.saturating_sub(u32::from(token.quads));
            }
            self.early.push_back(DepthGroup { token, line, from: wires.now() + Cycle::from(self.config.latency) });
            self.take(wires, false);
            did = Tick::Moved;
        }
        did
    }

    /// Looks up what comes back from the cores.
    #[inline(always)]
    fn accept_late(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let mut budget = self.config.quads_per_cycle;
        while let Some(token) = self.ports.late.as_ref().and_then(|ports| wires.front(&ports.input)) {
            if self.late.len() as u32 == self.config.fifo {
                return did.or(Tick::Blocked);
            }
            if budget == 0 {
                return Tick::Moved;
            }
            let line = if token.quads == 0 {
                None
            } else {
                let group = &card.groups[usize::from(self.pipeline)][token.group];
                if self.ports.early.is_none() && self.is_ahead(card, card.work(group.slot)) {
                    return did.or(Tick::Blocked);
                }
                match self.look_up(card, token) {
                    Ok(line) => line,
                    Err(stall) => return did.or(stall),
                }
            };
            budget = budget.saturating_sub(u32::from(token.quads).max(1));
            self.late.push_back(DepthGroup { token, line, from: wires.now() + Cycle::from(self.config.latency) });
            self.take(wires, true);
            did = Tick::Moved;
        }
        did
    }

    /// Ends a tile: writes back what is wanted of it once its last quads are tested, and forgets the rest.
    #[cold]
    fn end_tile(&mut self, card: &mut Card, token: GroupToken) -> Tick {
        if self.ended || self.away > 0 || !self.late.is_empty() {
            return Tick::Starved;
        }
        let Card { frame, class_state: ClassState { copies, .. }, passes, .. } = card;
        let frame = own(frame, copies, self.pipeline);
        let pass = passes.current().expect("tiles are drawn in a pass");
        // More of the pass follows: all of it is needed again.
        let keep = token.group != 0 || pass.pass.depth.is_some_and(|depth| depth.store || depth.stencil_store);
        let did = self.cache.flush_tile(frame, |_| keep);
        self.ended = did != Tick::Moved && self.cache.flushed();
        did
    }

    /// Ends the pass: writes the cache back, then reports.
    #[cold]
    fn end(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let Some(ack) = wires.front(&self.ports.end) else { return Tick::Starved };
        let Card { frame, class_state: ClassState { copies, .. }, passes, .. } = card;
        // Copies are composed by their depths, stored or not.
        let composed = copies.len() > 1;
        let frame = own(frame, copies, self.pipeline);
        let pass = passes.get(ack.slot as u8).expect("a pass is ending");
        let keep = composed || pass.pass.depth.is_some_and(|depth| depth.store || depth.stencil_store);
        if self.config.pass_end == PassEnd::Keep && keep && !composed {
            if !self.cache.quiet() {
                return Tick::Memory;
            }
        } else {
            let did = self.cache.flush(frame, |_| keep);
            if did == Tick::Moved || !self.cache.flushed() {
                return did;
            }
        }
        if !wires.try_push(&self.ports.ack, ack) {
            return Tick::Blocked;
        }
        wires.pop(&self.ports.end);
        self.ended_passes = self.ended_passes.wrapping_add(1);
        Tick::Moved
    }
}

/// Takes note that a pass with that surface begins: of all surfaces that have blocks in the cache, forgets those that were cleared or
/// written by something else since.
#[cold]
fn forget_renewed(cache: &mut BlockCache, kept: &mut Vec<(usize, u32)>, frame: &FrameBuffers, surface: usize) {
    kept.retain(|&(known, renewals)| {
        let same = frame.stores[known].renewals == renewals;
        if !same {
            cache.forget_surface(known);
        }
        same
    });
    if kept.iter().all(|&(known, _)| known != surface) {
        kept.push((surface, frame.stores[surface].renewals));
    }
}

/// The quads of its block that a passing group writes whole, and those that it writes in part.
fn written(work: &Work, group: &Group, samples: u32) -> Quads {
    let all = u16::MAX >> (16 - 4 * samples.clamp(1, 4));
    let mut quads = Quads::default();
    for quad in &work.segment.tiles[group.tile as usize].quads[group.first as usize..][..usize::from(group.count)] {
        let bit = 1 << quad.position;
        if quad.coverage == all { quads.whole |= bit } else { quads.part |= bit }
    }
    quads
}

/// Writes into the stamps of a copy which primitive has written a group's samples.
#[cold]
pub(super) fn mark(work: &Work, group: &Group, stamps: &mut Stamps, colors: bool) {
    let primitive = work.segment.triangles[group.triangle as usize].primitive;
    let quads = &work.segment.tiles[group.tile as usize].quads[group.first as usize..][..usize::from(group.count)];
    for (&live, quad) in group.live.iter().zip(quads) {
        stamps.mark(group.block, quad.position, live, work.marks, primitive, colors);
    }
}

/// Drops what the shader has discarded of quads whose test comes before the shader in API order; gives the quads still alive.
fn drop_discarded(card: &mut Card, pipeline: usize, token: GroupToken) -> u8 {
    let Card { groups, work, funnel, .. } = card;
    let group = &mut groups[pipeline][token.group];
    let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
    if !work.early || !work.draw.shades() {
        return token.quads;
    }
    let quads = &work.segment.tiles[group.tile as usize].quads[group.first as usize..][..usize::from(group.count)];
    let (mut alive, funnel) = (0, &mut funnel[group.slot]);
    for (live, quad) in group.live.iter_mut().zip(quads) {
        let before = fragments(*live);
        *live &= quad.kept;
        funnel.fragments_discarded += u64::from(before - fragments(*live));
        alive += u8::from(*live != 0);
    }
    alive
}

impl Unit<Card> for Depth {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Memory: blocks come, requests go.
        let mut did = Tick::moved_or(self.cache.exchange(wires), Tick::Starved);

        // 2. Hierarchical Z is updated.
        while let Some(&update) = self.bounds.front() {
            if !self.ports.updates.as_ref().is_none_or(|(updates, _)| wires.try_push(updates, update)) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.bounds.pop_front();
            did = Tick::Moved;
        }

        // 3. Test, late before early: what is nearer the end makes room.
        did = did.or(self.drain(wires, card, true));
        did = did.or(self.answer(wires, card));
        did = did.or(self.drain(wires, card, false));

        // 4. Look the next ones up.
        did = did.or(self.accept_late(wires, card));
        did = did.or(self.take_questions(wires, card));
        did = did.or(self.accept_early(wires, card));

        // 5. The end of the pass.
        did.or(self.end(wires, card))
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        let questions = self.questions.as_ref().map_or(0, |questions| questions.resident());
        (self.early.len() + self.late.len() + self.bounds.len() + questions) as u64 + self.cache.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(CACHES.named("depth"), |unit| unit.cache.cache());
        groups.group(ROP.named("depth"), |unit| unit.cache.counts());
        groups.group(ROP.named("depth"), |unit| unit.told);
    }
}
