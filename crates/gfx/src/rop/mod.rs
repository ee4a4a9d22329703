//! Raster operations: depth, stencil, blending, resolve. WHAT is stored; which unit does it when is not known here.
//!
//! All operate on *codes*, the stored form of a value in little-endian words: one word for up to four bytes, else two or four.
//! The codes of a quad are one run: sample after sample, in a sample word after word, and last the four pixels (in the order of
//! [`num::LANES`]). Coverage has bit `4 sample + pixel`. The functional renderer runs batches of 16 quads, the simulated
//! units single quads; both end in the same inner functions, so that their images are equal bit for bit.

mod blend;
mod block;
mod channels;
mod compose;
mod depth;
mod equation;
mod late;
mod number;
mod pairs;
mod resolve;

#[cfg(test)]
mod tests;

pub use blend::ColorState;
pub use compose::{compare_depths, composes_over, over};
pub use depth::DepthStencilState;
pub use late::LateQuads;
pub use resolve::{alpha_to_coverage, resolve};

/// Words of a stored pixel's code: formats of up to 4 bytes take one `u32` each, larger ones two or four.
pub fn code_words(format: crate::format::Format) -> usize {
    (format.block_bytes() as usize).div_ceil(4)
}

/// The four words that start at a place.
#[inline(always)]
fn four(words: &[u32], at: usize) -> [u32; 4] {
    let run = &words[at..at + 4];
    [run[0], run[1], run[2], run[3]]
}

/// Colours of `N` pixels, a channel after the other.
pub type Colors<const N: usize, T = f32> = [[T; N]; 4];

/// The same, the channels where they are.
type ColorRefs<'a, const N: usize> = [&'a [f32; N]; 4];

/// All ones where bit `p` of a quad's mask is set.
#[inline(always)]
fn select_mask(mask: u8) -> [u32; 4] {
    // A table: the shifts and negations would be more instructions than what the mask is needed for.
    const MASKS: [[u32; 4]; 16] = {
        let mut masks = [[0; 4]; 16];
        let mut i = 0;
        while i < 64 {
            masks[i / 4][i % 4] = if i / 4 >> (i % 4) & 1 == 1 { !0 } else { 0 };
            i += 1;
        }
        masks
    };
    MASKS[usize::from(mask & 15)]
}
