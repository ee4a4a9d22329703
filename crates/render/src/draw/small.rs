//! Small triangles, eight at a time.
//!
//! A mesh of millions covers two pixels with each triangle. What costs then are branches that nobody can predict: how many
//! blocks, how many quads, whether any of them passes. So the quads of eight triangles are listed first, and one loop goes
//! through the list without such a branch.

use std::sync::atomic::Ordering::Relaxed;

use gfx::setup::{Bounds, Eight, EightQuad, ScreenVertex};
use gfx::simd::Simd;

use super::batch::NUMBER;
use super::tile::TileRun;

impl TileRun<'_, '_, '_> {
    /// Up to eight triangles that are marked as small.
    #[inline(always)]
    pub(super) fn small<V: Simd>(&mut self, simd: V, references: &[(u32, u32)], area: &Bounds) {
        let (call, input) = (self.call, self.input);
        let mut vertices = [[ScreenVertex::default(); 3]; 8];
        for (vertices, &(b, r)) in vertices.iter_mut().zip(references) {
            input.batches[b as usize].screen_into((r & NUMBER) as usize, input.vertices, vertices);
        }
        let mut eight = Eight::default();
        eight.set_up(simd, &call.setup, area, &vertices);
        let n = references.len().min(8);
        let mut list = [EightQuad::default(); 48];
        let quads = eight.quads(n, &mut list);
        for (i, &(b, r)) in references.iter().enumerate().take(8) {
            let pixels = eight.pixels(i);
            self.counts.fragments_covered += u64::from(pixels.count_ones());
            if pixels != 0 {
                input.batches[b as usize].covered[(r & NUMBER) as usize].store(1, Relaxed);
            }
        }
        self.counts.tiles_visited += u64::from(eight.blocks(n));
        self.counts.quads_rasterized += quads as u64;
        let depth = call.depth.as_ref().filter(|_| call.early);
        if let (Some(_), Some(tile)) = (depth, &mut self.job.depth) {
            tile.materialise(call.depth_words);
        }
        let mut last = usize::MAX;
        let mut passed = 0;
        for &quad in &list[..quads] {
            let at = quad.in_tile();
            let coverage = quad.coverage();
            let mut alive = coverage;
            if let (Some(state), Some(tile)) = (depth, &mut self.job.depth) {
                let stored = &mut tile.codes.as_chunks_mut::<4>().0[at as usize];
                alive = state.test_quad_of(simd, &eight, quad, stored);
            }
            passed += usize::from(alive != 0);
            if call.fragment().is_none() {
                self.samples_passed += u64::from(alive.count_ones());
                self.counts.fragments_written += u64::from(alive.count_ones());
                continue;
            }
            let i = quad.triangle();
            let (b, r) = references[i];
            let (same, name) = (last == i, (b, r & NUMBER));
            let added = self.pending.push_if_alive(same, name, eight.pixel(quad), at, coverage, alive, eight.is_front(i));
            if call.needs_triangles && added && !same {
                let triangle = input.batches[b as usize].set_up(name.1 as usize, call, input.vertices);
                self.pending.add_data(triangle);
            }
            last = if added { i } else { last };
            if self.pending.is_full() {
                self.flush::<1, false>();
                last = usize::MAX;
            }
        }
        self.counts.quads_early_culled += (quads - passed) as u64;
        self.slot = u32::MAX;
    }
}
