//! Raster operations: depth, stencil, blending, resolve. WHAT is stored; which unit does it when is not known here.
//!
//! All operate on *codes*, the stored form of a value, and per quad: four pixels in the order of a quad (see [`crate::num::LANES`]).
//! The functional renderer runs batches of 16 quads, the simulated units single quads; both end in the same inner functions, so
//! that their images are equal bit for bit.

mod blend;
mod depth;
mod resolve;

#[cfg(test)]
mod tests;

pub use blend::ColorState;
pub use depth::DepthStencilState;
pub use resolve::{alpha_to_coverage, resolve};

/// Where the pixels of a quad lie in a tile buffer, counted in pixels from the quad's first one.
///
/// Pixel `p` of sample `s` is at `(p & 1) + (p >> 1) * row + s * sample`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pitch {
    /// From a pixel to the one below it.
    pub row: usize,
    /// From a sample to the next.
    pub sample: usize,
}

impl Pitch {
    /// Quads stored one after the other, samples of a quad one after the other (see [`crate::gfx::tiling::quad_order`]).
    pub const QUADS: Pitch = Pitch { row: 2, sample: 4 };
}

/// Words of a stored pixel's code: formats of up to 4 bytes take one `u32` each, larger ones two or four.
pub fn code_words(format: crate::gfx::format::Format) -> usize {
    (format.block_bytes() as usize).div_ceil(4)
}

/// Four neighbouring pixels, one word each.
#[inline(always)]
fn load_quad<T: Copy>(buffer: &[T], at: usize, row: usize) -> [T; 4] {
    let (top, bottom) = (&buffer[at..at + 2], &buffer[at + row..at + row + 2]);
    [top[0], top[1], bottom[0], bottom[1]]
}

/// The inverse of [`load_quad`].
#[inline(always)]
fn store_quad<T: Copy>(buffer: &mut [T], at: usize, row: usize, quad: [T; 4]) {
    let top = &mut buffer[at..at + 2];
    (top[0], top[1]) = (quad[0], quad[1]);
    let bottom = &mut buffer[at + row..at + row + 2];
    (bottom[0], bottom[1]) = (quad[2], quad[3]);
}

/// All ones where bit `p` of a quad's mask is set.
#[inline(always)]
fn select_mask(mask: u8) -> [u32; 4] {
    std::array::from_fn(|p| 0_u32.wrapping_sub(u32::from(mask >> p & 1)))
}
