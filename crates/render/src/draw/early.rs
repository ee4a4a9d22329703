//! Early depth and stencil: a block at a time.

use gfx::rop::DepthStencilState;
use gfx::setup::{DepthPlane, SAMPLES_4, Triangle};
use gfx::simd::Simd;
use gfx::traverse::Block;
use num::{LANES, SUBPIXEL};

use super::tile::{TileRun, block_in_tile, quads_in};

impl TileRun<'_, '_, '_> {
    /// Early depth and stencil: the samples of the block that pass.
    #[inline(always)]
    pub(super) fn test<const S: usize, V: Simd>(
        &mut self,
        simd: V,
        state: &DepthStencilState,
        triangle: &Triangle,
        block: &Block<S>,
    ) -> [u64; S] {
        let plane = &triangle.depth;
        let call = self.call;
        let Some(tile) = &mut self.job.depth else { return block.samples };
        let at = block_in_tile(block.x, block.y);
        tile.materialise(call.depth_words);
        if S == 1 && call.tests_blocks {
            let codes: &mut [u32; LANES] =
                (&mut tile.codes[at * LANES..(at + 1) * LANES]).try_into().expect("a block of one sample");
            let mut out = [0; S];
            out[0] = state.test_block(simd, plane, [block.x, block.y], block.samples[0], codes);
            return out;
        }
        let mut out = [0; S];
        let mut left = quads_in(block.pixels());
        let size = 4 * S * call.depth_words;
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
