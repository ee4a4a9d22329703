//! Depths of quads, what they pass, and the bounds of blocks.

use crate::card::{Group, PassState, Work};
use crate::frame::Store;
use crate::token::{DepthBounds, fragments};
use gfx::hierarchical::depth_key;
use gfx::rop::DepthStencilState;
use gfx::setup::{SAMPLES_1, SAMPLES_4};
use num::SUBPIXEL;
use work::{BLOCK, Triangle};

/// The result of a group's test.
#[derive(Clone, Copy, Debug, Default)]
pub struct Tested {
    /// Quads still alive.
    pub alive: u8,
    /// Fragments that have failed.
    pub failed_fragments: u32,
    /// Samples that have failed.
    pub failed_samples: u32,
}

/// Tests a group's quads against the stored depths and stencils, and writes what passes; `late`: with the depths that the shader has
/// found, if it does.
#[inline(always)]
pub fn test_group(
    state: &DepthStencilState,
    work: &Work,
    group: &mut Group,
    pass: &PassState,
    store: &mut Store,
    late: bool,
) -> Tested {
    let samples = store.surface.samples as usize;
    let triangle = &work.segment.triangles[group.triangle as usize];
    let tile = &work.segment.tiles[group.tile as usize];
    let quads = &tile.quads[group.first as usize..][..usize::from(group.count)];
    let (left, top) = (group.block % pass.blocks_across * BLOCK, group.block / pass.blocks_across * BLOCK);
    let mut tested = Tested::default();
    for (live, quad) in group.live.iter_mut().zip(quads) {
        if *live == 0 {
            continue;
        }
        let mut codes = [[0_u32; 4]; 4];
        // A test that comes before the shader in API order does not know its depths, wherever it is made.
        if late && !work.early && work.draw.depth_words > 0 {
            let words = &tile.payload[quad.payload as usize..];
            for (codes, words) in codes[..samples].iter_mut().zip(words.chunks_exact(4)) {
                *codes = state.code_quad(std::array::from_fn(|p| f32::from_bits(words[p])));
            }
        } else {
            let x = (left + u32::from(quad.position) % 4 * 2) as i32;
            let y = (top + u32::from(quad.position) / 4 * 2) as i32;
            sample_depths(state, triangle, x, y, samples, &mut codes);
        }
        let before = *live;
        *live = state.test_quad(samples, triangle.back, before, &codes, store.quad_mut(group.block, quad.position));
        tested.failed_fragments += fragments(before) - fragments(*live);
        tested.failed_samples += before.count_ones() - live.count_ones();
        tested.alive += u8::from(*live != 0);
    }
    tested
}

/// Tests a group's quads ahead of the test that counts, by the state that their draw has for it, against depths known of a pass `across`
/// blocks wide; gives the quads still alive.
pub fn test_ahead(state: &DepthStencilState, work: &Work, group: &mut Group, across: u32, store: &mut Store) -> u8 {
    let samples = store.surface.samples as usize;
    let triangle = &work.segment.triangles[group.triangle as usize];
    let quads = &work.segment.tiles[group.tile as usize].quads[group.first as usize..][..usize::from(group.count)];
    let (left, top) = (group.block % across * BLOCK, group.block / across * BLOCK);
    let mut alive = 0;
    for (live, quad) in group.live.iter_mut().zip(quads).filter(|(live, _)| **live != 0) {
        let mut codes = [[0_u32; 4]; 4];
        let x = (left + u32::from(quad.position) % 4 * 2) as i32;
        let y = (top + u32::from(quad.position) / 4 * 2) as i32;
        sample_depths(state, triangle, x, y, samples, &mut codes);
        *live = state.test_quad(samples, triangle.back, *live, &codes, store.quad_mut(group.block, quad.position));
        alive += u8::from(*live != 0);
    }
    alive
}

/// Depths of a quad's samples, as codes.
#[inline(always)]
pub fn sample_depths(
    state: &DepthStencilState,
    triangle: &Triangle,
    x: i32,
    y: i32,
    samples: usize,
    codes: &mut [[u32; 4]; 4],
) {
    let positions: &[[i32; 2]] = if samples == 1 { &SAMPLES_1 } else { &SAMPLES_4 };
    for (codes, &[dx, dy]) in codes.iter_mut().zip(positions) {
        let (dx, dy) = (dx as f32 / SUBPIXEL as f32 + 0.5, dy as f32 / SUBPIXEL as f32 + 0.5);
        *codes = state.code_quad(std::array::from_fn(|p| {
            triangle.depth.at((x + p as i32 % 2) as f32 + dx, (y + p as i32 / 2) as f32 + dy)
        }));
    }
}

/// The bounds of a block's depths, from its own bytes.
pub fn bounds(store: &Store, block: u32, pass: u32) -> DepthBounds {
    let format = store.surface.format;
    let (mut min, mut max) = (u32::MAX, 0);
    let stride = 4 * store.words as usize;
    for pixels in store.block(block).chunks_exact(stride) {
        for &code in &pixels[..4] {
            let key = depth_key(format, code);
            min = min.min(key);
            max = max.max(key);
        }
    }
    DepthBounds { block, min, max, pass }
}
