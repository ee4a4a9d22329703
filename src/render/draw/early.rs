//! Early depth and stencil: a block at a time, hierarchical Z first.

use crate::gfx::format::Format;
use crate::gfx::rop::DepthStencilState;
use crate::gfx::setup::{SAMPLES_4, Triangle};
use crate::gfx::state::Compare;
use crate::gfx::traverse::Block;
use crate::num::{LANES, Lanes, SUBPIXEL};
use crate::render::surface::{BlockDepth, depth_key};

use super::frame::Frame;
use super::tile::{TileRun, block_in_tile, quads_in};

/// Quads of a block from which on hierarchical Z and whole-block tests pay.
const LARGE: u32 = 4;

impl TileRun<'_, '_, '_> {
    /// Early depth and stencil: the samples of the block that pass.
    #[inline(always)]
    pub(super) fn test<const S: usize>(
        &mut self,
        state: &DepthStencilState,
        triangle: &Triangle,
        block: &Block<S>,
        quads: u32,
    ) -> [u64; S] {
        let frame = self.frame;
        let Some(tile) = &mut self.job.depth else { return block.samples };
        let at = block_in_tile(block.x, block.y);
        let plane = &triangle.depth;
        let large = quads >= LARGE;
        let writes = state.writes_depth();
        if frame.hierarchical_z && large {
            let (near, far) = plane.block_range(i32::from(block.x), i32::from(block.y), 8);
            let key = |z: f32| depth_key(frame.depth_format, state.code(z));
            let (near, far) = (key(near), key(far));
            let bounds = &mut tile.depth[at];
            if bounds.stale != 0 && !*tile.clear {
                let size = 16 * 4 * S * frame.depth_words;
                *bounds = exact_bounds(frame, &tile.codes[at * size..(at + 1) * size]);
            }
            let reject = match state.compare() {
                Compare::Less => near >= bounds.max,
                Compare::LessEqual => near > bounds.max,
                Compare::Greater => far <= bounds.min,
                Compare::GreaterEqual => far < bounds.min,
                Compare::Equal => near > bounds.max || far < bounds.min,
                _ => false,
            };
            if reject {
                self.counts.tiles_hiz_culled += 1;
                return [0; S];
            }
            if writes {
                *bounds = match state.compare() {
                    Compare::Less | Compare::LessEqual if block.full => {
                        BlockDepth { min: bounds.min.min(near), max: bounds.max.min(far), stale: 0 }
                    }
                    Compare::Greater | Compare::GreaterEqual if block.full => {
                        BlockDepth { min: bounds.min.max(near), max: bounds.max.max(far), stale: 0 }
                    }
                    _ => BlockDepth { min: bounds.min.min(near), max: bounds.max.max(far), stale: 0 },
                };
            }
        } else if writes {
            tile.depth[at].stale = 1;
        }
        tile.materialise(frame.depth_words);
        if S == 1 && large && frame.depth_words == 1 && !state.uses_stencil() {
            let codes: &mut [u32; LANES] =
                (&mut tile.codes[at * LANES..(at + 1) * LANES]).try_into().expect("a block of one sample");
            let mut out = [0; S];
            out[0] = test_block(state, frame, triangle, [block.x, block.y], block.samples[0], codes);
            return out;
        }
        let mut out = [0; S];
        let mut left = quads_in(block.pixels());
        let size = 4 * S * frame.depth_words;
        while left != 0 {
            let q = left.trailing_zeros() as usize / 4;
            left &= left - 1;
            let (x, y) = (i32::from(block.x) + 2 * (q as i32 % 4), i32::from(block.y) + 2 * (q as i32 / 4));
            let depths = depths::<S>(triangle, x, y);
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
fn depths<const S: usize>(triangle: &Triangle, x: i32, y: i32) -> [[f32; 4]; S] {
    let mut out = [[0.0; 4]; S];
    if S == 1 {
        out[0] = triangle.depth.quad(x, y);
        return out;
    }
    for s in 0..S {
        let [dx, dy] = SAMPLES_4[s % 4].map(|v| v as f32 / SUBPIXEL as f32);
        let (x0, y0) = (x as f32 + 0.5 + dx, y as f32 + 0.5 + dy);
        out[s] = triangle.depth.at4([x0, x0 + 1.0, x0, x0 + 1.0], [y0, y0, y0 + 1.0, y0 + 1.0]);
    }
    out
}

/// The exact bounds of a block's stored depths.
#[inline(always)]
fn exact_bounds(frame: &Frame<'_>, codes: &[u32]) -> BlockDepth {
    let (mut min, mut max) = (u32::MAX, 0);
    for run in codes.chunks_exact(4 * frame.depth_words) {
        for &code in &run[..4] {
            let key = depth_key(frame.depth_format, code);
            min = min.min(key);
            max = max.max(key);
        }
    }
    BlockDepth { min, max, stale: 0 }
}

/// Pixel centres of a block's lanes, from its corner.
const CENTERS: ([f32; LANES], [f32; LANES]) = {
    let (mut x, mut y) = ([0.0; LANES], [0.0; LANES]);
    let mut i = 0;
    while i < LANES {
        let (q, p) = (i / 4, i % 4);
        x[i] = (2 * (q % 4) + p % 2) as f32 + 0.5;
        y[i] = (2 * (q / 4) + p / 2) as f32 + 0.5;
        i += 1;
    }
    (x, y)
};

/// Tests and updates the depths of a block of one sample a pixel at once; the pixels of `mask` that pass.
#[inline(always)]
fn test_block(
    state: &DepthStencilState,
    frame: &Frame<'_>,
    triangle: &Triangle,
    [x, y]: [u16; 2],
    mask: u64,
    stored: &mut [u32; LANES],
) -> u64 {
    let (x, y) = (f32::from(x), f32::from(y));
    let plane = triangle.depth;
    let mut z = Lanes::ZERO;
    for i in 0..LANES {
        z.f32_mut()[i] = plane.at(x + CENTERS.0[i], y + CENTERS.1[i]);
    }
    let mut new = Lanes::ZERO;
    state.codes(&z, &mut new);
    let beside = match frame.depth_format {
        Format::Depth24PlusStencil8 => 0xff00_0000,
        _ => 0,
    };
    let float = frame.depth_format == Format::Depth32Float;
    let mut pass = [0_u32; LANES];
    macro_rules! compare {
        ($($name:ident $op:tt),*) => {
            match state.compare() {
                Compare::Never => {}
                Compare::Always => pass = [u32::MAX; LANES],
                $(Compare::$name if float => {
                    for i in 0..LANES {
                        let (new, old) = (f32::from_bits(new.0[i]), f32::from_bits(stored[i]));
                        pass[i] = 0_u32.wrapping_sub(u32::from(new $op old));
                    }
                })*
                // Fixed-point codes have at most 24 bits, so that signed comparison will do.
                $(Compare::$name => {
                    for i in 0..LANES {
                        let (new, old) = (new.0[i] as i32, (stored[i] & !beside) as i32);
                        pass[i] = 0_u32.wrapping_sub(u32::from(new $op old));
                    }
                })*
            }
        };
    }
    compare!(Less <, Equal ==, LessEqual <=, Greater >, NotEqual !=, GreaterEqual >=);
    let passed = bits_of(&pass) & mask;
    if state.writes_depth() && passed != 0 {
        if passed == u64::MAX && beside == 0 {
            *stored = new.0;
        } else {
            for b in 0..8 {
                let byte = (passed >> (8 * b)) as u32;
                for i in 0..8 {
                    let lane = 8 * b + i;
                    let write = 0_u32.wrapping_sub(byte >> i & 1) & !beside;
                    stored[lane] = stored[lane] & !write | new.0[lane] & write;
                }
            }
        }
    }
    passed
}

/// The lanes that are all ones as a mask.
#[inline(always)]
fn bits_of(lanes: &[u32; LANES]) -> u64 {
    // Bit `b` of column `i` is lane `8 b + i`: eight vector operations, then an 8x8 transpose in a register.
    let mut columns = [0_u32; 8];
    for b in 0..8 {
        for i in 0..8 {
            columns[i] |= lanes[8 * b + i] & 1 << b;
        }
    }
    let mut m = u64::from_le_bytes(columns.map(|v| v as u8));
    for (shift, keep) in [(7, 0x00aa_00aa_00aa_00aa_u64), (14, 0x0000_cccc_0000_cccc), (28, 0x0000_0000_f0f0_f0f0)] {
        let t = (m ^ m >> shift) & keep;
        m ^= t ^ t << shift;
    }
    m
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lane_masks_come_out_in_order() {
        let mut state = 0x1234_5678_9abc_def0_u64;
        for _ in 0..1000 {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            let lanes: [u32; LANES] = std::array::from_fn(|i| 0_u32.wrapping_sub((state >> i & 1) as u32));
            assert_eq!(bits_of(&lanes), state);
        }
    }
}
