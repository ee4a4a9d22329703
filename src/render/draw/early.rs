//! Early depth and stencil: a block at a time, hierarchical Z first.

use crate::gfx::hierarchical::{culls, depth_key, may_raise_lower};
use crate::gfx::rop::DepthStencilState;
use crate::gfx::setup::{DepthPlane, SAMPLES_4, Triangle};
use crate::gfx::state::Compare;
use crate::gfx::traverse::Block;
#[cfg(target_arch = "x86_64")]
use crate::num::LANES;
use crate::num::SUBPIXEL;
use crate::render::surface::BlockDepth;

use super::frame::Frame;
use super::tile::{TileRun, block_in_tile, quads_in};

/// Quads of a block from which on hierarchical Z pays: more than those of a small triangle.
const LARGE: u32 = 7;

/// Quads that may have been written in a block after which its bounds are found anew, for a primitive that covers some of it,
/// or all: exact bounds cost about as much as testing the whole block.
const REFRESH: [u32; 2] = [64, 1];

impl TileRun<'_, '_, '_> {
    /// Early depth and stencil: the samples of the block that pass. `WIDE`: the caller is compiled for AVX2.
    #[inline(always)]
    pub(super) fn test<const S: usize, const WIDE: bool>(
        &mut self,
        state: &DepthStencilState,
        triangle: &Triangle,
        block: &Block<S>,
        quads: u32,
    ) -> [u64; S] {
        let plane = &triangle.depth;
        let frame = self.frame;
        let Some(tile) = &mut self.job.depth else { return block.samples };
        let at = block_in_tile(block.x, block.y);
        let writes = state.writes_depth();
        if frame.hierarchical_z && quads >= LARGE {
            let bounds = &mut tile.depth[at];
            if bounds.stale >= REFRESH[usize::from(block.full)] && !*tile.clear {
                let size = 16 * 4 * S * frame.depth_words;
                *bounds = exact_bounds(frame, &tile.codes[at * size..(at + 1) * size]);
            }
            let (near, far) = plane.block_range(i32::from(block.x), i32::from(block.y), 8);
            let key = |z: f32| depth_key(frame.depth_format, state.code(z));
            let (near, far) = (key(near), key(far));
            if culls(state.compare(), near, far, bounds.min, bounds.max) {
                self.counts.tiles_hiz_culled += 1;
                return [0; S];
            }
            if writes {
                bounds.written(state.compare(), quads, [near, far], block.full);
            }
        } else if writes {
            tile.depth[at].written(state.compare(), quads, [0, u32::MAX], false);
        }
        tile.materialise(frame.depth_words);
        #[cfg(target_arch = "x86_64")]
        if WIDE && S == 1 && frame.tests_blocks {
            let codes: &mut [u32; LANES] =
                (&mut tile.codes[at * LANES..(at + 1) * LANES]).try_into().expect("a block of one sample");
            let mut out = [0; S];
            // SAFETY: `WIDE` says that the host has AVX2.
            out[0] = unsafe { state.test_block_avx2(plane, [block.x, block.y], block.samples[0], codes) };
            return out;
        }
        let mut out = [0; S];
        let mut left = quads_in(block.pixels());
        let size = 4 * S * frame.depth_words;
        while left != 0 {
            let q = left.trailing_zeros() as usize / 4;
            left &= left - 1;
            let (x, y) = (i32::from(block.x) + 2 * (q as i32 % 4), i32::from(block.y) + 2 * (q as i32 / 4));
            let depths = depths::<S>(plane, x, y);
            let mut codes = [[0; 4]; S];
            for s in 0..S {
                codes[s] = state.code_quad(depths[s]);
            }
            let run = &mut tile.codes[(at * 16 + q) * size..][..size];
            let passed = state.test_quad(S, !triangle.front, block.quad_mask(q), &codes, run);
            for s in 0..S {
                out[s] |= u64::from(passed >> (4 * s) & 15) << (4 * q);
            }
        }
        out
    }
}

/// Depths of a quad at the samples of its four pixels.
#[inline(always)]
fn depths<const S: usize>(plane: &DepthPlane, x: i32, y: i32) -> [[f32; 4]; S] {
    let mut out = [[0.0; 4]; S];
    if S == 1 {
        out[0] = plane.quad(x, y);
        return out;
    }
    for s in 0..S {
        let [dx, dy] = SAMPLES_4[s % 4].map(|v| v as f32 / SUBPIXEL as f32);
        let (x0, y0) = (x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
        out[s] = plane.at4([x0, x0 + 1.0, x0, x0 + 1.0], [y0, y0, y0 + 1.0, y0 + 1.0]);
    }
    out
}

/// The exact bounds of a block's stored depths.
#[inline(always)]
fn exact_bounds(frame: &Frame<'_>, codes: &[u32]) -> BlockDepth {
    let format = frame.depth_format;
    let (mut min, mut max) = ([u32::MAX; 8], [0; 8]);
    let mut take = |codes: &[u32; 8]| {
        for i in 0..8 {
            let key = depth_key(format, codes[i]);
            min[i] = min[i].min(key);
            max[i] = max[i].max(key);
        }
    };
    if frame.depth_words == 1 {
        codes.as_chunks::<8>().0.iter().for_each(take);
    } else {
        // Depth is the first word of each run of a quad and sample.
        for run in codes.chunks_exact(4 * frame.depth_words) {
            take(&[run[0], run[1], run[2], run[3], run[0], run[1], run[2], run[3]]);
        }
    }
    let (min, max) = (min.iter().fold(u32::MAX, |a, b| a.min(*b)), max.iter().fold(0, |a, b| a.max(*b)));
    BlockDepth { min, max, stale: 0 }
}

impl BlockDepth {
    /// Keeps the bounds true when a draw with this comparison writes depths between two keys to quads of the block; `full`: to
    /// all of it, wherever the comparison passes.
    #[inline(always)]
    pub(super) fn written(&mut self, compare: Compare, quads: u32, [low, high]: [u32; 2], full: bool) {
        let (raises, lowers) = may_raise_lower(compare);
        let before = *self;
        self.stale = self.stale.saturating_add(quads);
        if lowers {
            self.min = before.min.min(low);
            // What is left is no greater than what came, so that the least of both bounds holds.
            if full && !raises {
                self.max = before.max.min(high);
            }
        }
        if raises {
            self.max = before.max.max(high);
            if full && !lowers {
                self.min = before.min.max(low);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bounds_stay_true() {
        let mut seed = 3_u32;
        let mut random = move |n: u32| {
            seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (seed >> 16) % n
        };
        for case in 0..20_000 {
            let compare = Compare::ALL[case % 8];
            let mut stored: [u32; 4] = std::array::from_fn(|_| random(20));
            let low = random(20);
            let high = low + random(20 - low);
            let full = random(2) == 0;
            let range = |v: &[u32; 4]| (*v.iter().min().unwrap(), *v.iter().max().unwrap());
            let (min, max) = range(&stored);
            let mut bounds = BlockDepth { min: min - random(min + 1), max: max + random(4), stale: 0 };
            bounds.written(compare, 1, [low, high], full);
            for depth in &mut stored {
                let new = low + random(high - low + 1);
                if (full || random(2) == 0) && compare.test(new as f32, *depth as f32) {
                    *depth = new;
                }
            }
            let (min, max) = range(&stored);
            assert!(bounds.min <= min && bounds.max >= max, "{compare:?} {full} {bounds:?} {stored:?}");
        }
    }
}
