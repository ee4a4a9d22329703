//! Tiled traversal with hierarchical Z, one unit per rasteriser: finds the blocks of a triangle in its own tiles, throws away those
//! that hierarchical Z proves hidden, and sends the quads of the others on in groups.

mod hierarchical;
mod territory;
mod together;
mod walk;

use super::card::notes::note;
use super::card::{Ahead, Card, Group, PassState, Work};
use super::distribute::Overlap;
use super::token::{DepthBounds, GroupToken, Kind, TriangleToken, bits, bytes, fragments};
use gfx::hierarchical::{accepts, depth_key, may_raise_lower};
use gfx::rop::DepthStencilState;
use hierarchical::{Bounds, HierarchicalZ, Lines};
use knob::Allowed;
use num::{Cycle, prefetch};
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;
use walk::Pace;
use work::{BLOCK, Block, End, Quad, Triangle};

use territory::BlockAt;
pub use territory::Territory;
use together::Gather;
pub use walk::Walk;

knob::choices! {
    /// When the hierarchical Z buffer learns of new depths.
    pub enum HierarchicalUpdate {
        /// When a block leaves the Z cache.
        Eviction "eviction",
        /// At every write.
        Write "write",
    }
}

knob::choices! {
    /// What hierarchical Z throws away at a time.
    pub enum HierarchicalTest {
        /// A block, by bounds of the triangle's depth in all of it.
        Block "block",
        /// A quad, by the depths of what is covered of it.
        Quad "quad",
    }
}

knob::knobs! {
    /// Traversal of triangles in blocks of 8x8 pixels.
    pub struct TraverseConfig {
        /// Blocks with coverage per cycle.
        blocks_per_cycle: u32 ["blocks/cycle", Allowed::Range(1, 8), "assumed; ATTILA bGPU.ini GenWidth x GenHeight = 8 x 8 per cycle"]
            {estimate: Used, relax: Rate, advice: []},
        /// Blocks of bounding boxes tested per cycle, those without coverage included; a triangle takes at least one test. Blocks
        /// of a 64x64 tile that the triangle does not touch are thrown away with the tile.
        tests_per_cycle: u32 ["blocks/cycle", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini ScanWidth x ScanHeight = 16 x 16 pixels of scan tile"]
            {estimate: Used, relax: Rate, advice: []},
        /// The largest number of waiting triangles that are traversed together: block by block, and in each block triangle by triangle. More
        /// keep blocks longer in the ROP caches. Walk by blocks only.
        triangles: u32 ["triangles", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini RasterizationBatchSize = 4 where RecursiveMode = TRUE"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Traverse batches of `traverse.triangles` consecutive triangles of a draw together. Each batch waits until all of its triangles that
        /// come to this rasteriser are there. Only where distribution sorts triangles.
        gather: bool ["", Allowed::Switch, "triangles are traversed as they come; ATTILA waits until it has RasterizationBatchSize (TriangleTraversal)"]
            {estimate: RefusedUnless(Is(&["false"]), "triangles that wait for others"), relax: Never, advice: []},
        /// What of a triangle is tested for coverage. Walks other than by blocks test single pixels.
        walk: Walk ["", Allowed::Choice(Walk::NAMES), "assumed; ATTILA scans tiles"]
            {estimate: RefusedUnless(Is(&["blocks"]), "walks that test single pixels"), relax: Never, advice: []},
        /// Rows and pixels tested per cycle by walks other than by blocks; a triangle takes at least one test.
        pixel_tests_per_cycle: u32 ["tests/cycle", Allowed::Range(1, 4096), "assumed: as many pixels as four blocks have, 16 x 16: what the walk by blocks tests"]
            {estimate: Ignored("without effect where traverse.walk is blocks"), relax: Rate, advice: []},
        /// Quads sent on per cycle.
        quads_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "assumed; ATTILA bGPU.ini StampsPerCycle = 4"]
            {estimate: Used, relax: Rate, advice: []},
        /// Quads of draws without a fragment stage sent on per cycle.
        depth_quads_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "assumed: twice the rate with colours; GF100 and Cypress reach 80 to 90 % of theirs (Beyond3D 2010)"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles that sending `quads_per_cycle` quads takes, for rates below one quad per cycle.
        interval: u32 ["cycles", Allowed::Range(1, 64), "pipelined; 2 where a core shades two fragments per cycle (Mali-G57, Arm GPU Datasheet v7)"]
            {estimate: Used, relax: Never, advice: []},
        /// Cycles from here to the early depth test.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini HZAccessLatency = 5, HZUpdateLatency = 4"]
            {estimate: Used, relax: Latency, advice: []},
        /// Groups of quads queued before the early depth test.
        queue: u32 ["groups", Allowed::Range(2, 4096), "assumed; ATTILA bGPU.ini EarlyZQueueSize = 256 stamps"]
            {estimate: RefusedUnless(AtLeast(8), "short queues behind traversal"), relax: Room, advice: []},
        /// Whether blocks are tested against the hierarchical Z buffer.
        hierarchical_z: bool ["", Allowed::Switch, "assumed; ATTILA bGPU.ini DisableHZ = FALSE"]
            {estimate: Used, relax: Skip(&[("true", "hierarchical Z")]), advice: [NothingHidden]},
        /// Whether blocks that are certain to pass are passed on the strength of it. What is then written whole is not read from
        /// memory, nor is what is not written at all.
        hierarchical_accept: bool ["", Allowed::Switch, "ATI's HyperZ of 2002 on; off where a card has one bound a block"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Skip(&[("true", "acceptance by hierarchical Z")]), advice: []},
        /// What it throws away at a time.
        hierarchical_test: HierarchicalTest ["", Allowed::Choice(HierarchicalTest::NAMES), "blocks in cards; ATTILA tests stamps"]
            {estimate: RefusedUnless(Is(&["block"]), "quads that hierarchical Z rejects"), relax: Never, advice: []},
        /// Lines of 4x4 blocks in a cache before the hierarchical Z buffer. A line keeps its bounds, whatever the buffer learns, until it
        /// is replaced. Reading one takes no time, but keeps its place for `traverse.latency` cycles. 0: the buffer itself is asked.
        hierarchical_lines: u32 ["lines", Allowed::Range(0, 64), "assumed: on-chip buffers need none; ATTILA bGPU.ini HZCacheLines = 8, HZCacheLineSize = 16"]
            {estimate: RefusedUnless(Is(&["0"]), "bounds behind a cache"), relax: Never, advice: []},
        /// When the hierarchical Z buffer learns of new depths.
        hierarchical_update: HierarchicalUpdate ["", Allowed::Choice(HierarchicalUpdate::NAMES), "assumed; ATTILA updates it from the Z cache's evicted lines"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Cycles from the ROP to the hierarchical Z buffer.
        hierarchical_latency: u32 ["cycles", Allowed::Range(1, 256), "assumed; ATTILA bGPU.ini HZUpdateLatency = 4"]
            {estimate: RefusedUnless(AtMost(64), "waits for hierarchical Z"), relax: Latency, advice: []},
        /// Updates queued before the hierarchical Z buffer.
        hierarchical_queue: u32 ["updates", Allowed::Range(2, 1024), "assumed: enough never to hold up the ROP"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
    }
}

/// The heading of traversal in the statistics.
pub const TRAVERSAL: Heading = Heading::new(
    "hierarchical.traverse[i]",
    "What traversal finds out: blocks that hierarchical Z accepts, where that is on, and triangles that nothing is drawn of, where \
     geometry lets them through. What hierarchical Z throws away is in the funnel.",
);

stats::counters! {
    /// What is found out in addition to what hierarchical Z throws away.
    pub struct TraverseCounts {
        /// Tests for coverage: of blocks, or of rows and pixels, as `traverse.walk` has it.
        tested: "tests",
        /// Triangles that end here, since all of their bounds hold no sample of them: where geometry does not find that out.
        ended: "triangles",
        /// Blocks tested for them.
        blocks_in_vain: "blocks",
        /// Blocks covered whole: their edges need no test.
        whole: "blocks",
        /// Blocks certain to pass the early test.
        accepted: "blocks",
        /// Of these, those that are not written.
        unwritten: "blocks",
    }
}

/// Where in the current triangle the unit is.
#[derive(Clone, Copy, Debug, Default)]
struct TrianglePosition {
    /// There is a current triangle.
    active: bool,
    slot: u16,
    sequence: u32,
    triangle: u32,
    /// Visit, block in it, quad in it.
    visit: u32,
    block: u32,
    quad: u32,
    /// Whether the block has been tested.
    tested: bool,
    /// The result of the block's early test, as far as it is known.
    ahead: Ahead,
    /// The quads of the block that hierarchical Z hides, a bit each, if it tests quads.
    hidden: u64,
    /// Blocks of the bounding box still to be found empty.
    empty: u32,
    /// Whether the triangle goes to all pipelines, each of which draws its own tiles of it.
    shared: bool,
    /// For a triangle that is traversed together with others, the position of its next block. None if no block is left.
    next: Option<BlockAt>,
}

/// Traversal. Its items are quads with coverage, those culled included.
#[derive(Clone)]
pub struct Traverse {
    config: TraverseConfig,
    pipeline: u8,
    territory: Territory,
    input: In<TriangleToken>,
    updates: Option<In<DepthBounds>>,
    output: Out<GroupToken>,
    place: TrianglePosition,
    /// Triangles that are traversed together with the current one.
    together: Vec<TrianglePosition>,
    /// The batch that is gathered, where batches are traversed together.
    gather: Option<Gather>,
    pace: Pace,
    /// When the next quads may be sent, where that has an interval or one kind of quads is slower than the link.
    free_at: Cycle,
    hierarchical: HierarchicalZ,
    /// The pass that `hierarchical` belongs to.
    pass: u32,
    /// The pass that set the depths of `hierarchical` ([`DepthStart::began`](super::card::DepthStart)).
    began: Option<u32>,
    counts: TraverseCounts,
    items: u64,
}

/// The contents of a hierarchical Z buffer: [`Traverse::depth_bounds`].
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct DepthsKnown {
    /// Bounds of the depths that are stored in each block.
    pub bounds: Vec<[u32; 2]>,
    /// Bounds of the depths that each block will have when all that went through here is tested.
    pub outer: Vec<[u32; 2]>,
    /// Whether the lower and the upper ones of `bounds` hold.
    pub valid: [bool; 2],
}

impl Traverse {
    /// An idle traversal unit of pipeline `pipeline`. Without `updates` its hierarchical Z buffer knows only how the pass began.
    pub fn new(
        config: TraverseConfig,
        pipeline: u8,
        territory: Territory,
        input: In<TriangleToken>,
        updates: Option<In<DepthBounds>>,
        output: Out<GroupToken>,
    ) -> Traverse {
        Traverse {
            pace: Pace::new(config.pixel_tests_per_cycle),
            hierarchical: HierarchicalZ { lines: Lines::new(config.hierarchical_lines), ..HierarchicalZ::default() },
            config,
            pipeline,
            territory,
            input,
            updates,
            output,
            place: TrianglePosition::default(),
            together: Vec::new(),
            gather: None,
            free_at: 0,
            pass: u32::MAX,
            began: None,
            counts: TraverseCounts::default(),
            items: 0,
        }
    }

    /// Makes the unit wait for all triangles of a batch that come here. Distribution sends the batch to `rasterisers` rasterisers.
    #[must_use]
    pub fn gathering(self, overlap: Overlap, rasterisers: usize) -> Traverse {
        let gather = Gather::new(self.config.triangles, overlap, rasterisers, self.pipeline);
        Traverse { gather: Some(gather), ..self }
    }

    /// Where it finds blocks.
    pub(super) fn territory(&self) -> Territory {
        self.territory
    }

    /// The counters of the unit.
    pub fn counts(&self) -> TraverseCounts {
        self.counts
    }

    /// What its hierarchical Z buffer knows, as ordered keys: of each block its least and its greatest depth, and those that it will have when all
    /// that went through here is tested; whether the first two hold, which a pass may break.
    pub fn depth_bounds(&self) -> DepthsKnown {
        let HierarchicalZ { bounds, outer, min_valid, max_valid, .. } = &self.hierarchical;
        let keys = |bounds: &[Bounds]| bounds.iter().map(|of| [of.min, of.max]).collect();
        DepthsKnown { bounds: keys(bounds), outer: keys(outer), valid: [*min_valid, *max_valid] }
    }

    /// Makes the hierarchical Z buffer that of the current pass.
    #[cold]
    fn begin_pass(&mut self, pass: &PassState) {
        self.pass = pass.number;
        let Some(start) = pass.depth_start else { return };
        let hierarchical = &mut self.hierarchical;
        hierarchical.lines.clear();
        // A pipeline that finds all that is drawn in a block, before any other unit does, can bound the depths in it.
        if self.config.hierarchical_z
            && self.config.hierarchical_accept
            && matches!(self.territory, Territory::Tiles | Territory::Copy)
        {
            let (min, max) = start.bounds.unwrap_or((0, u32::MAX));
            hierarchical.outer.clear();
            hierarchical.outer.resize(pass.blocks, Bounds { min, max });
        }
        // Nothing has been drawn here since the depths were told to all, where nothing came here in that pass: what is known is older.
        let missed = self.began.replace(start.began.0) != Some(start.began.0);
        if let Some((min, max)) = start.bounds.or(missed.then_some(start.began.1)) {
            hierarchical.bounds.clear();
            hierarchical.bounds.resize(pass.blocks, Bounds { min, max });
            (hierarchical.max_valid, hierarchical.min_valid) = (true, true);
        }
    }

    /// Takes note of a draw of which a triangle comes; `drawn`: it covers samples.
    pub(super) fn note(&mut self, pass: Option<&PassState>, work: &Work, drawn: bool) {
        if let Some(pass) = pass.filter(|pass| pass.number != self.pass) {
            self.begin_pass(pass);
        }
        if let Some(state) = &work.depth
            && state.writes_depth()
            && drawn
        {
            let (raises, lowers) = may_raise_lower(state.compare());
            self.hierarchical.max_valid &= !raises;
            self.hierarchical.min_valid &= !lowers;
        }
    }

    /// Takes note of a block that is drawn without this unit; whether hierarchical Z hides it.
    pub(super) fn passes_by(&mut self, work: &Work, triangle: &Triangle, block: &Block, number: u32) -> bool {
        let hidden = self.hidden(work, triangle, u32::from(block.x), u32::from(block.y), number);
        if !hidden && !self.hierarchical.outer.is_empty() {
            let counts = self.counts;
            self.look_ahead(work, triangle, block, number);
            self.counts = counts;
        }
        hidden
    }

    /// Learns what a block's depths are.
    pub(super) fn learn(&mut self, update: DepthBounds) {
        if update.pass == self.pass
            && let Some(bounds) = self.hierarchical.bounds.get_mut(update.block as usize)
        {
            *bounds = Bounds { min: update.min, max: update.max };
        }
    }

    /// Takes a triangle in hand.
    fn begin(&mut self, card: &Card, token: TriangleToken) {
        let work = card.work(token.slot);
        let triangle = &work.segment.triangles[token.triangle as usize];
        let drawn = triangle.end == End::Nowhere;
        self.note(card.passes.get(work.pass), work, drawn);
        let TriangleToken { slot, sequence, triangle: number, .. } = token;
        let shared = work.is_shared(triangle.primitive);
        self.place = TrianglePosition { active: true, slot, sequence, triangle: number, shared, ..TrianglePosition::default() };
        if let Territory::Bins(side) = self.territory {
            self.place.visit = self.visit_of_bin(card, work, triangle, sequence, side);
        }
        let [empty, covered] =
            if drawn { self.empty_blocks(card, work, triangle) } else { [self.blocks_in_vain(card, triangle), 0] };
        if !drawn {
            self.counts.ended += 1;
            self.counts.blocks_in_vain += u64::from(empty);
        }
        if self.config.walk == Walk::Blocks {
            self.place.empty = empty;
            self.counts.tested += u64::from(empty + covered);
        } else {
            self.begin_walk(card, work, triangle);
        }
    }

    /// Whether hierarchical Z hides a block.
    #[inline(always)]
    fn hidden(&self, work: &Work, triangle: &Triangle, x: u32, y: u32, number: u32) -> bool {
        let Some(state) = self.tests(work) else { return false };
        let Some(&bounds) = self.hierarchical.bounds.get(number as usize) else { return false };
        self.hierarchical.hides(bounds, state, work, triangle, (x, y))
    }

    /// By which state hierarchical Z tests a draw, if it does.
    #[inline(always)]
    fn tests<'w>(&self, work: &'w Work) -> Option<&'w DepthStencilState> {
        work.depth.as_ref().filter(|_| work.draw.hierarchical_z && self.config.hierarchical_z)
    }

    /// The quads of the current block that hierarchical Z hides, a bit each.
    #[inline(always)]
    fn hidden_quads(
        &mut self,
        now: Cycle,
        card: &Card,
        work: &Work,
        triangle: &Triangle,
        block: &Block,
        quads: &[Quad],
    ) -> u64 {
        let (Some(state), Some(pass)) = (self.tests(work), card.passes.get(work.pass)) else { return 0 };
        let (x, y) = (u32::from(block.x), u32::from(block.y));
        let (number, across) = (y * pass.blocks_across + x, pass.blocks_across);
        let hierarchical = &mut self.hierarchical;
        if number as usize >= hierarchical.bounds.len() {
            return 0;
        }
        let latency = Cycle::from(self.config.latency);
        let bounds = hierarchical.lines.look_up(&hierarchical.bounds, number, across, now, latency);
        if self.config.hierarchical_test == HierarchicalTest::Quad
            && let Some(surface) = pass.depth
        {
            let samples = card.frame.stores[surface].surface.samples;
            return hierarchical.hides_quads(bounds, state, work, triangle, (x, y), samples, quads);
        }
        if hierarchical.hides(bounds, state, work, triangle, (x, y)) { u64::MAX >> (64 - quads.len()) } else { 0 }
    }

    /// Notes that `count` quads of the current block are done. With its last quads, the block is done.
    #[inline(always)]
    fn pass_quads(&mut self, count: u32, block: &Block) {
        self.place.quad += count;
        if self.place.quad == u32::from(block.quads) {
            (self.place.quad, self.place.tested) = (0, false);
            self.place.block += 1;
        }
    }

    /// The result of the early test of a block that is drawn, as far as it is certain. Notes how far its depths can go then.
    // Off by default, and not to be in the way.
    #[inline(never)]
    fn look_ahead(&mut self, work: &Work, triangle: &Triangle, block: &Block, number: u32) -> Ahead {
        let Some(outer) = self.hierarchical.outer.get_mut(number as usize) else { return Ahead::Nothing };
        let Some(state) = &work.depth else { return Ahead::Nothing };
        let before = *outer;
        let (x, y) = (u32::from(block.x) * BLOCK, u32::from(block.y) * BLOCK);
        let (low, high) = triangle.depth.block_range(x as i32, y as i32, BLOCK as i32);
        let key = |depth: f32| depth_key(work.depth_format, state.code(depth));
        let (low, high) = (key(low), key(high));
        if state.writes_depth() {
            // A shader's depth can be anywhere.
            let plane = work.draw.depth_words == 0;
            outer.min = if plane { outer.min.min(low) } else { 0 };
            outer.max = if plane { outer.max.max(high) } else { u32::MAX };
        }
        let early = work.early && work.draw.hierarchical_z && !state.uses_stencil() && !state.is_idle();
        if !early || !accepts(state.compare(), low, high, before.min, before.max) {
            return Ahead::Nothing;
        }
        self.counts.accepted += 1;
        if !state.writes_depth() {
            self.counts.unwritten += 1;
            return Ahead::Passes;
        }
        // Stencils are kept, and so they are read.
        if work.depth_format.has_stencil() { Ahead::Nothing } else { Ahead::Writes }
    }
}

impl Unit<Card> for Traverse {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut moved = false;

        // 1. The hierarchical Z buffer learns what the ROP has written. Both bounds may be late; where writes of this pass could
        //    have broken one, it is not used.
        while let Some(update) = self.updates.as_ref().and_then(|updates| wires.pop(updates)) {
            self.learn(update);
            moved = true;
        }

        let mut blocks = self.config.blocks_per_cycle;
        // Quads with colours take as many parts of the cycle as there are quads without, and the other way round.
        let rates = [self.config.quads_per_cycle, self.config.depth_quads_per_cycle];
        let in_cycle = rates[0] * rates[1];
        let mut parts = if self.free_at > wires.now() { 0 } else { in_cycle };
        let mut sent = 0;
        let paced = self.config.walk != Walk::Blocks;
        let mut tests = if paced { u32::MAX } else { self.config.tests_per_cycle };
        self.pace.cycle(wires.now(), self.place.active);
        // Tests that covered blocks leave: the testers run ahead with them and find empty blocks.
        let mut spare = if paced { 0 } else { tests.saturating_sub(blocks) };
        loop {
            // 2. The next triangle.
            if !self.place.active
                && let Some(place) = self.together.pop()
            {
                self.place = place;
            }
            if !self.place.active && !self.begin_gathered(wires, card, &mut moved) {
                return wires.stop(Tick::moved_or(moved, Tick::Starved), Tick::Starved);
            }
            if !self.place.active {
                let Some(token) = wires.front(&self.input) else {
                    return wires.stop(Tick::moved_or(moved, Tick::Starved), Tick::Starved);
                };
                if token.kind != Kind::DATA {
                    let TriangleToken { slot, sequence, kind, .. } = token;
                    let fence = GroupToken { group: u32::from(slot), sequence, kind, quads: 0, pool: self.pipeline };
                    if !wires.can_push(&self.output) {
                        return Tick::moved_or(moved, Tick::Blocked);
                    }
                    wires.push_sized(&self.output, fence, bytes::MARK);
                    wires.take(&self.input);
                    moved = true;
                    continue;
                }
                wires.take(&self.input);
                self.begin(card, token);
                moved = true;
                if self.config.triangles > 1 {
                    self.join(wires, card);
                }
            }
            if !self.together.is_empty() && !self.place.tested {
                self.choose(card);
            }
            let ahead = self.place.empty.min(spare).min(tests);
            self.place.empty -= ahead;
            spare -= ahead;
            tests -= ahead;
            moved |= ahead > 0;

            // 3. The next block of this pipeline.
            let work = card.work[usize::from(self.place.slot)].as_ref().expect("a triangle's segment is in flight");
            let triangle = &work.segment.triangles[self.place.triangle as usize];
            let visits = work.visits(triangle);
            let at_end = self.territory != Territory::Tiles && self.past_bin(card, work, triangle);
            let Some(visit) = visits.get(self.place.visit as usize).filter(|_| !at_end) else {
                // 4. All covered blocks are done; what is left of the empty ones takes all tests.
                let found = self.place.empty.min(tests);
                self.place.empty -= found;
                tests -= found;
                if paced && !self.pace.ends() {
                    return self.pace.wait(wires, moved);
                }
                moved = true;
                if self.place.empty > 0 {
                    return Tick::Moved;
                }
                self.place = TrianglePosition::default();
                continue;
            };
            let bins = matches!(self.territory, Territory::Bins(_));
            let whole = work.owners.get(visit.tile as usize).filter(|_| !bins);
            if self.place.block == visit.blocks || whole.is_some_and(|&owner| !self.enters(owner)) {
                self.place.visit += 1;
                self.place.block = 0;
                continue;
            }
            let tile = &work.segment.tiles[visit.tile as usize];
            let block = &tile.blocks[(visit.first_block + self.place.block) as usize];
            let (x, y) = (u32::from(block.x), u32::from(block.y));
            if whole.is_none() && !(self.in_bin(card, x, y) && (bins || self.enters(card.interleave.owner(x, y)))) {
                self.place.block += 1;
                continue;
            }
            let number = y * card.passes.get(work.pass).map_or(0, |pass| pass.blocks_across) + x;

            // 5. Test it, once.
            if !self.place.tested {
                if blocks == 0 || tests == 0 {
                    return Tick::Moved;
                }
                let all = &tile.quads[block.first_quad as usize..][..usize::from(block.quads)];
                if paced {
                    let own = self.tests_of(triangle, block, all);
                    if !self.pace.reached(own) {
                        return self.pace.wait(wires, moved);
                    }
                    self.pace.next_block();
                }
                blocks -= 1;
                tests -= 1;
                moved = true;
                self.items += u64::from(block.quads);
                self.counts.whole += u64::from(block.full);
                let covered = all.iter().map(|quad: &Quad| u64::from(fragments(quad.coverage))).sum::<u64>();
                let hidden = self.hidden_quads(wires.now(), card, work, triangle, block, all);
                if card.interleave.is_balanced() {
                    card.interleave.note(y, block.quads.into());
                }
                let funnel = &mut card.funnel[self.place.slot];
                funnel.tiles_visited += 1;
                funnel.quads_rasterized += u64::from(block.quads);
                funnel.fragments_covered += covered;
                if hidden != 0 {
                    let gone = hidden.count_ones();
                    funnel.tiles_hiz_culled += u64::from(gone == u32::from(block.quads));
                    funnel.quads_hiz_culled += u64::from(gone);
                    funnel.quads_early_culled += u64::from(gone);
                    if let Some(notes) = &mut card.notes {
                        note(notes, card.passes.get(work.pass), number, |of| of.hierarchical += gone);
                    }
                    if gone == u32::from(block.quads) {
                        self.place.block += 1;
                        continue;
                    }
                }
                (self.place.tested, self.place.hidden) = (true, hidden);
                if !self.hierarchical.outer.is_empty() {
                    self.place.ahead = self.look_ahead(work, triangle, block, number);
                }
            }

            // 6. Send its quads on, four at a time; where all of four are hidden, the next.
            let count = (u32::from(block.quads) - self.place.quad).min(4);
            let hidden = self.place.hidden >> self.place.quad & 15;
            let alive = count - bits(hidden as u16);
            if alive == 0 {
                self.pass_quads(count, block);
                continue;
            }
            let needs = alive * if work.draw.shades() { rates[1] } else { rates[0] };
            // Fewer than a group may remain of the budget where it is no multiple of four: the link takes the rest of the time.
            if parts < needs && parts < in_cycle {
                if self.free_at > wires.now() {
                    wires.sleep_until(self.free_at);
                    return Tick::moved_or(moved, Tick::Working);
                }
                return Tick::Moved;
            }
            if !wires.can_push(&self.output) {
                return Tick::moved_or(moved, Tick::Blocked);
            }
            parts = parts.saturating_sub(needs);
            sent += needs;
            if self.config.interval > 1 || rates[0] != rates[1] {
                self.free_at = wires.now() + Cycle::from((sent * self.config.interval).div_ceil(in_cycle));
            }
            let first = block.first_quad + self.place.quad;
            let mut live = [0; 4];
            for (n, quad) in tile.quads[first as usize..][..count as usize].iter().enumerate() {
                live[n] = if hidden >> n & 1 == 0 { quad.coverage } else { 0 };
            }
            let group = Group {
                slot: self.place.slot,
                count: count as u8,
                triangle: self.place.triangle,
                tile: visit.tile,
                first,
                block: number,
                live,
                ahead: self.place.ahead,
            };
            // The host is asked for the depths that will be tested in some cycles. No part of the model.
            if let Some(surface) = card.passes.get(work.pass).and_then(|pass| pass.depth) {
                prefetch(&card.frame.stores[surface].quad(number, tile.quads[first as usize].position)[0]);
            }
            let pool = if self.territory == Territory::Screen { card.interleave.owner(x, y) } else { self.pipeline };
            let index = card.groups[usize::from(pool)].insert(group);
            let sequence = self.place.sequence;
            let token = GroupToken { group: index, sequence, kind: Kind::DATA, quads: alive as u8, pool };
            wires.push_sized(&self.output, token, alive * bytes::QUAD);
            moved = true;
            self.pass_quads(count, block);
        }
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        u64::from(self.place.active) + self.together.len() as u64 + self.gather.as_ref().map_or(0, Gather::held)
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(TRAVERSAL, |unit| unit.counts);
        let heading = Heading::new(
            "hierarchical.lines[i]",
            "The cache of the hierarchical Z buffer, where there is one. What it does not know yet hides less.",
        );
        groups.group_if(heading, |unit| (unit.config.hierarchical_lines > 0).then_some(unit.hierarchical.lines.counts));
    }
}
