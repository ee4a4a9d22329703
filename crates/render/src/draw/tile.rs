//! One screen tile: every triangle of a segment that touches it, in API order.

use std::sync::atomic::Ordering::Relaxed;

use crate::surface::{TileMut, quad_of};
use gfx::setup::{Bounds, Triangle};
use gfx::simd::{self, Simd, dispatch};
use gfx::stage::Stage;
use gfx::traverse::{Block, Blocks};
use num::Meter;
use shader::{BoundProgram, ShaderFault};
use work::{Areas, Funnel, TILE};

use super::areas;
use super::batch::{Batch, NUMBER, SMALL, WHOLE};
use super::pending::{Pending, PendingQuad};
use super::plan::Piece;
use super::record::{FEW, TileRecord};
use super::vertex::Vertices;
use super::workers::{BlockRoom, FragmentWeights, Worker};
use super::{BoundStage, DrawCall, Drawn};

/// Colour attachments of a pass, at most.
pub const MAX_COLORS: usize = 8;

/// Triangles of a tile's list between a request for their data and its use.
const AHEAD: usize = 24;

/// A tile to be drawn.
pub struct TileJob<'a> {
    /// Number of the tile, row by row.
    pub index: usize,
    /// Column and row.
    pub at: [u32; 2],
    /// Colour attachments, in the order of the call's targets.
    pub colors: [Option<TileMut<'a>>; MAX_COLORS],
    /// Depth attachment.
    pub depth: Option<TileMut<'a>>,
    /// The record of the tile. It stays empty without recording.
    pub record: &'a mut TileRecord,
}

impl<'a> TileJob<'a> {
    /// A tile of a picture of `across` tiles per row, without attachments.
    pub fn new(index: usize, across: u32, record: &'a mut TileRecord) -> Self {
        TileJob { index, at: [index as u32 % across, index as u32 / across], colors: Default::default(), depth: None, record }
    }
}

/// The inputs that all tiles of a segment share.
pub struct SegmentInput<'a, 'f> {
    pub call: &'a DrawCall<'f>,
    pub pieces: &'a [Piece],
    pub batches: &'a [Batch],
    pub vertices: &'a Vertices,
    /// Counts what is recorded.
    pub growth: &'a Meter,
}

/// A tile while it is drawn.
pub struct TileRun<'a, 'f, 'j> {
    pub call: &'a DrawCall<'f>,
    pub input: &'a SegmentInput<'a, 'f>,
    pub job: &'a mut TileJob<'j>,
    pub bound: Option<BoundProgram<'a>>,
    pub pending: &'a mut Pending,
    pub weights: &'a mut FragmentWeights,
    pub recorder: &'a mut shader::Recorder,
    pub counts: Funnel,
    pub samples_passed: u64,
    pub overwritten: u64,
    pub fault: Option<ShaderFault>,
    /// Triangles so far.
    visits: u64,
    /// Steps of which that were reported to the ledger, beside those of shaders.
    reported_steps: u64,
    /// The current triangle: its batch, its number there, its place among the pending ones.
    pub batch: u32,
    pub number: u32,
    pub slot: u32,
    /// The triangle, by batch and number there, for all of which the outputs of the fragment program hold.
    pub shaded: Option<(u32, u32)>,
}

/// Draws a tile.
///
/// # Errors
/// If a fragment program does not end.
pub fn draw(input: &SegmentInput<'_, '_>, worker: &mut Worker, job: &mut TileJob<'_>, record: bool) -> Result<(), ShaderFault> {
    match (input.call.samples, record) {
        (1, false) => dispatch::<1, false>(input, worker, job),
        (1, true) => dispatch::<1, true>(input, worker, job),
        (_, false) => dispatch::<4, false>(input, worker, job),
        (_, true) => dispatch::<4, true>(input, worker, job),
    }
}

/// The same code for the host's widest vectors: traversal and tests are inlined into it.
fn dispatch<const S: usize, const RECORD: bool>(
    input: &SegmentInput<'_, '_>,
    worker: &mut Worker,
    job: &mut TileJob<'_>,
) -> Result<(), ShaderFault>
where
    BlockRoom: AsMut<Blocks<S>>,
{
    dispatch!(simd => run::<S, RECORD, _>(simd, input, worker, job))
}

#[inline(always)]
fn run<const S: usize, const RECORD: bool, V: Simd>(
    simd: V,
    input: &SegmentInput<'_, '_>,
    worker: &mut Worker,
    job: &mut TileJob<'_>,
) -> Result<(), ShaderFault>
where
    BlockRoom: AsMut<Blocks<S>>,
{
    let call = input.call;
    let tile = job.index;
    if call.ledger.steps.verify().is_err() {
        // The draw is refused when all tiles are back.
        return Ok(());
    }
    let [x0, y0] = job.at.map(|v| (v * TILE) as u16);
    let area = Bounds {
        x0,
        y0,
        x1: (u32::from(x0) + TILE).min(call.width) as u16,
        y1: (u32::from(y0) + TILE).min(call.height) as u16,
    };
    let start = if call.overwrites { first_visible(input.batches, tile) } else { (0, 0) };
    worker.pending.clear();
    worker.recorder.extra = call.extra;
    if RECORD {
        job.record.begin(&worker.room);
    }
    let mut run = TileRun {
        call,
        input,
        job,
        bound: call.fragment().map(|BoundStage { stage, resources, uniforms }| {
            let bound = worker.executors[Stage::Fragment].bind(&stage.program, resources, uniforms);
            bound.within(&call.ledger.steps, RECORD.then_some(input.growth)).forgetting()
        }),
        pending: &mut worker.pending,
        weights: &mut worker.weights,
        recorder: &mut worker.recorder,
        counts: Funnel::default(),
        samples_passed: 0,
        overwritten: 0,
        fault: None,
        visits: 0,
        reported_steps: 0,
        batch: 0,
        number: 0,
        slot: u32::MAX,
        shaded: None,
    };
    let blocks = worker.blocks.as_mut();
    blocks.takes_whole = call.options.skips.full_blocks;
    if call.overwrites {
        for (b, batch) in input.batches.iter().enumerate().take(start.0 + 1) {
            let of_batch = batch.in_tile(tile);
            for &r in if b == start.0 { &of_batch[..start.1] } else { of_batch } {
                if !run.may_go_on(1) {
                    break;
                }
                run.hidden(simd, b as u32, r, area, blocks);
            }
        }
    }
    let references = &mut worker.pairs;
    references.clear();
    for (b, batch) in input.batches.iter().enumerate().skip(start.0) {
        let of_batch = batch.in_tile(tile);
        let of_batch = if b == start.0 { &of_batch[start.1..] } else { of_batch };
        references.extend(of_batch.iter().map(|r| (b as u32, r & !WHOLE)));
    }
    let mut at = 0;
    while at < references.len() && run.fault.is_none() {
        let ahead = references.get(at..(at + 8).min(references.len())).unwrap_or_default();
        let small =
            if S == 1 && !RECORD && !call.shade_covered { ahead.iter().take_while(|(_, r)| r & SMALL != 0).count() } else { 0 };
        // Two of them take less time one by one.
        let together = small > 2;
        let n = if together { small } else { small.max(1) };
        if !run.may_go_on(n as u64) {
            break;
        }
        for i in at..at + n {
            // The lists jump through the segment's triangles, which are more than the nearer caches hold.
            if let Some(&(b, r)) = references.get(i + AHEAD) {
                input.batches[b as usize].prefetch((r & NUMBER) as usize);
            }
            if let Some(&(b, r)) = references.get(i + AHEAD / 2) {
                input.batches[b as usize].prefetch_vertices((r & NUMBER) as usize, input.vertices);
            }
        }
        if together {
            run.small(simd, &references[at..at + n], &area);
            at += n;
            continue;
        }
        for &(b, r) in &references[at..at + n] {
            run.triangle::<S, RECORD, _>(simd, b, r & NUMBER, area, blocks);
        }
        at += n;
    }
    run.flush::<S, RECORD>();
    call.ledger.steps.add(run.work());
    if RECORD {
        let bytes = run.recorder.take_bytes() + run.job.record.work.bytes();
        run.job.record.finish(run.recorder, &mut worker.room);
        if !input.growth.add(bytes) {
            // The draw is refused when all tiles are back, whose steps count until then; what they record is of no use.
            *run.job.record = TileRecord::default();
        }
    }
    let TileRun { counts: funnel, samples_passed, overwritten, fault, .. } = run;
    let visible = if areas::surveys(job.at) { funnel.quads_rasterized - funnel.quads_early_culled } else { 0 };
    *worker.drawn.get_or_insert_default() +=
        Drawn { samples_passed, funnel, overwritten, areas: Areas { visible, ..Areas::default() } };
    fault.map_or(Ok(()), Err)
}

/// The last triangle that covers the tile whole, by batch and place there: what was drawn before it cannot be seen. The first of
/// all if there is none.
fn first_visible(batches: &[Batch], tile: usize) -> (usize, usize) {
    let last = |(b, batch): (usize, &Batch)| Some((b, batch.in_tile(tile).iter().rposition(|r| r & WHOLE != 0)?));
    batches.iter().enumerate().rev().find_map(last).unwrap_or((0, 0))
}

/// Bit `4 q` for every quad with a bit in the mask.
#[inline(always)]
pub(super) fn quads_in(mask: u64) -> u64 {
    let pairs = mask | mask >> 1;
    (pairs | pairs >> 2) & 0x1111_1111_1111_1111
}

/// Steps after which they are charged to the ledger.
const TELL: u64 = 1 << 18;

impl TileRun<'_, '_, '_> {
    /// Work beside shaders that was not charged to the ledger yet, in steps: traversal and tests of triangles and quads take about so long.
    fn work(&self) -> u64 {
        16 * self.visits + self.counts.tiles_visited + self.call.quad_steps * self.counts.quads_rasterized - self.reported_steps
    }

    /// Counts a visit; whether the ledger allows it.
    #[inline(always)]
    fn may_go_on(&mut self, visits: u64) -> bool {
        self.visits += visits;
        let work = self.work();
        if work < TELL {
            return true;
        }
        self.reported_steps += work;
        self.call.ledger.steps.add(work)
    }

    /// One triangle.
    #[inline(always)]
    fn triangle<const S: usize, const RECORD: bool, V: Simd>(
        &mut self,
        simd: V,
        b: u32,
        number: u32,
        area: Bounds,
        blocks: &mut Blocks<S>,
    ) {
        let batch = &self.input.batches[b as usize];
        let triangle = &batch.set_up(number as usize, self.call, self.input.vertices);
        (self.batch, self.number, self.slot) = (b, number, u32::MAX);
        blocks.find_with(simd, triangle, area);
        let mut covered = false;
        for block in blocks.iter() {
            covered |= self.block::<S, RECORD, _>(simd, triangle, *block);
        }
        if covered {
            batch.covered[number as usize].store(1, Relaxed);
            if RECORD {
                self.job.record.end_visit(b, number);
            }
        }
    }

    /// Counts what a triangle covers that a later one hides, and what would become of it: since nothing tests or discards
    /// fragments, all of them would be shaded and written ([`overwrites`](super::DrawState)).
    #[inline(never)]
    fn hidden<const S: usize, V: Simd>(&mut self, simd: V, b: u32, reference: u32, area: Bounds, blocks: &mut Blocks<S>) {
        let batch = &self.input.batches[b as usize];
        let number = (reference & NUMBER) as usize;
        let (mut hit, mut quads, mut fragments) = (0, 0, 0);
        if reference & WHOLE != 0 {
            let [w, h] = [area.x1 - area.x0, area.y1 - area.y0].map(u64::from);
            let times = if self.call.per_sample { S as u64 } else { 1 };
            hit = w.div_ceil(8) * h.div_ceil(8);
            quads = times * w.div_ceil(2) * h.div_ceil(2);
            fragments = times * w * h;
        } else {
            blocks.find_with(simd, &batch.set_up(number, self.call, self.input.vertices), area);
            for block in blocks.iter() {
                let [q, f] = self.quads_and_fragments(block);
                (hit, quads, fragments) = (hit + u64::from(f > 0), quads + q, fragments + f);
            }
        }
        if fragments == 0 {
            return;
        }
        batch.covered[number].store(1, Relaxed);
        self.counts.tiles_visited += hit;
        self.counts.quads_rasterized += quads;
        self.counts.fragments_covered += fragments;
        if self.call.fragment().is_none() {
            self.counts.fragments_written += fragments;
            return;
        }
        self.overwritten += fragments;
        self.counts.quads_shaded += quads;
        self.counts.fragments_shaded += fragments;
        self.counts.helper_fragments += 4 * quads - fragments;
        self.counts.fragments_written += fragments;
    }

    /// Quads and fragments of a block, as they go through a machine: of each sample where the program runs once per sample, else of pixels.
    #[inline(always)]
    fn quads_and_fragments<const S: usize>(&self, block: &Block<S>) -> [u64; 2] {
        let count = |mask: u64| [quads_in(mask), mask].map(|bits| u64::from(bits.count_ones()));
        if S > 1 && self.call.per_sample {
            return block
                .samples
                .iter()
                .map(|&mask| count(mask))
                .fold([0; 2], |[q, f], [quads, fragments]| [q + quads, f + fragments]);
        }
        count(block.pixels())
    }

    /// One block of the current triangle; returns whether it covers a sample that may be written.
    #[inline(always)]
    fn block<const S: usize, const RECORD: bool, V: Simd>(
        &mut self,
        simd: V,
        triangle: &Triangle,
        mut block: Block<S>,
    ) -> bool {
        let call = self.call;
        for s in 0..S {
            if call.sample_mask >> s & 1 == 0 {
                block.samples[s] = 0;
            }
        }
        let covered = block.pixels();
        if covered == 0 {
            return false;
        }
        let quads = quads_in(covered);
        let n = quads.count_ones();
        self.counts.tiles_visited += 1;
        let [rasterized, fragments] = self.quads_and_fragments(&block);
        self.counts.quads_rasterized += rasterized;
        self.counts.fragments_covered += fragments;
        let first_record = if RECORD { self.job.record.begin_block(&block, call.per_sample) } else { 0 };
        let mut passed = block;
        if call.early
            && let Some(depth) = &call.depth
        {
            passed.samples = self.test(simd, depth, triangle, &block);
        }
        let alive = passed.pixels();
        self.counts.quads_early_culled += rasterized - self.quads_and_fragments(&passed)[0];
        if call.fragment().is_none() {
            self.samples_passed += passed.samples.iter().map(|m| u64::from(m.count_ones())).sum::<u64>();
            self.counts.fragments_written += u64::from(alive.count_ones());
            return true;
        }
        // Shading for its cost or number alone takes every covered quad; what passed decides what is written.
        let mut left = if call.shade_covered { quads } else { quads_in(alive) };
        if S == 1 && !call.per_sample {
            let first = block_in_tile(block.x, block.y) as u32 * 16;
            while left != 0 {
                let slot = self.slot(triangle);
                let (place, pixels, front) = ([block.x, block.y], [covered, alive], triangle.front);
                let record = (quads, first_record);
                left = if simd::shuffles_bytes(simd) && (!RECORD || n > FEW) {
                    self.pending.push_block_wide::<RECORD, _>(simd, slot, (place, first), record, pixels, left, front)
                } else {
                    self.pending.push_block::<RECORD>(slot, (place, first), record, pixels, left, front)
                };
                self.flush_if_full::<S, RECORD>();
            }
            return true;
        }
        while left != 0 {
            let q = left.trailing_zeros() as usize / 4;
            left &= left - 1;
            let (x, y) = (block.x + 2 * (q as u16 % 4), block.y + 2 * (q as u16 / 4));
            let coverage = block.quad_mask(q);
            let alive = passed.quad_mask(q);
            if !call.per_sample {
                let record = if RECORD { first_record + (quads & ((1 << (4 * q)) - 1)).count_ones() } else { 0 };
                self.push::<S, RECORD>(triangle, [x, y], coverage, alive, 0, record);
            } else {
                let before = if RECORD { first_record + TileRecord::samples_before(&block, q) } else { 0 };
                let mut record = before;
                for s in 0..S {
                    let mask = 15 << (4 * s);
                    if coverage & mask != 0 {
                        if (alive & mask != 0) || call.shade_covered {
                            self.push::<S, RECORD>(triangle, [x, y], coverage & mask, alive & mask, s as u8, record);
                        }
                        record += 1;
                    }
                }
            }
        }
        true
    }

    /// Adds a quad to those that wait to be shaded.
    #[inline(always)]
    fn push<const S: usize, const RECORD: bool>(
        &mut self,
        triangle: &Triangle,
        [x, y]: [u16; 2],
        coverage: u16,
        alive: u16,
        sample: u8,
        record: u32,
    ) {
        let slot = self.slot(triangle);
        let at = quad_of(u32::from(x) % TILE, u32::from(y) % TILE);
        let quad = PendingQuad { place: [x, y], at, coverage, alive, sample, record };
        self.pending.push(slot, triangle.front, quad);
        self.flush_if_full::<S, RECORD>();
    }

    /// The current triangle's place among the pending ones.
    #[inline(always)]
    fn slot(&mut self, triangle: &Triangle) -> u32 {
        if self.slot == u32::MAX {
            self.slot = self.pending.add_triangle(self.batch, self.number);
            if self.call.needs_triangles {
                self.pending.add_data(*triangle);
            }
        }
        self.slot
    }

    #[inline(always)]
    pub(super) fn flush_if_full<const S: usize, const RECORD: bool>(&mut self) {
        if self.pending.is_full() {
            self.flush::<S, RECORD>();
            self.slot = u32::MAX;
        }
    }
}

/// Number of a block in its tile.
#[inline(always)]
pub(super) fn block_in_tile(x: u16, y: u16) -> usize {
    usize::from(y % 64 / 8 * 8 + x % 64 / 8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quads_of_a_mask() {
        assert_eq!(quads_in(0x8000_0000_0000_0021), 0x1000_0000_0000_0011);
    }
}
