//! Bounds, setup and coverage of eight triangles at once, a lane of a vector each.
//!
//! The operations are those of [`super::bounds`], [`super::within`] and traversal, in the same order where they round, so that
//! the bits are the same. One by one, the small triangles of a mesh of millions take four times as long.

#[cfg(test)]
mod tests;
mod vectors;

use super::{Bounds, Culled, DepthPlane, ScreenVertex, SetupState};
use num::SUBPIXEL;

/// Width and height of the window that holds the pixels of a small triangle.
const WINDOW: [u16; 2] = [6, 4];

/// Greatest distance of a small triangle's vertex from its first pixel along an axis, in 1/256 pixel. Slopes are then at most
/// 2^12, distances from vertices to pixels of the window below 2^12, and edge functions below 2^25: 32 bits are exact.
const NEAR: i32 = 8 * SUBPIXEL;

/// Whether a triangle with these scissored bounds may be given to [`Eight::set_up`].
#[inline(always)]
pub fn is_small(v: &[ScreenVertex; 3], b: &Bounds) -> bool {
    let fits = |first: u16, end: u16, window: u16| end - (first & !1) <= window;
    let near = |p: i32, first: u16| ((p - i32::from(first) * SUBPIXEL).unsigned_abs()) <= NEAR as u32;
    // Without branches between: which of them fails is not predictable.
    let inside = |v: &ScreenVertex| near(v.x, b.x0) & near(v.y, b.y0);
    fits(b.x0, b.x1, WINDOW[0]) & fits(b.y0, b.y1, WINDOW[1]) & inside(&v[0]) & inside(&v[1]) & inside(&v[2])
}

/// What [`super::bounds`] says of eight triangles: bit `i` of a mask is triangle i.
#[derive(Clone, Copy, Debug, Default)]
pub struct EightBounds {
    /// Those of which nothing is known, because they are large; the rest holds for the others.
    pub large: u32,
    /// Those that [`is_small`].
    pub small: u32,
    degenerate: u32,
    face: u32,
    no_sample: u32,
    scissor: u32,
    bounds: [[i32; 8]; 4],
}

impl EightBounds {
    /// The outcome for a triangle.
    ///
    /// # Errors
    /// Why it is not drawn.
    #[inline(always)]
    pub fn get(&self, i: usize) -> Result<Bounds, Culled> {
        if (self.degenerate | self.face | self.no_sample | self.scissor) >> i & 1 == 1 {
            return Err(if self.degenerate >> i & 1 == 1 {
                Culled::Degenerate
            } else if self.face >> i & 1 == 1 {
                Culled::Face
            } else if self.no_sample >> i & 1 == 1 {
                Culled::NoSample
            } else {
                Culled::Scissor
            });
        }
        let [x0, y0, x1, y1] = &self.bounds;
        Ok(Bounds { x0: x0[i] as u16, y0: y0[i] as u16, x1: x1[i] as u16, y1: y1[i] as u16 })
    }
}

/// Eight small triangles: windows, coverage and depth.
#[derive(Clone, Copy, Debug, Default)]
pub struct Eight {
    /// Covered pixels of each window: bit `4 q + p`, quad q = column + 3 row.
    mask: [u32; 8],
    /// The quads of each window, q by q: what [`EightQuad`] takes apart.
    quads: [[u32; 8]; 6],
    /// Bit `i`: triangle i faces front.
    front: u32,
    /// Of the up to four aligned 8x8 blocks in which a window lies: bit `i` where triangle i covers pixels there.
    parts: [u32; 4],
    /// Corner of each window, in its area.
    corner: [[u32; 8]; 2],
    /// Centre of the window's first pixel from the reference point of the depth plane.
    first: [[f32; 8]; 2],
    /// Depth there, changes to the right and down, least and greatest: of the depth planes.
    z0: [f32; 8],
    slope: [[f32; 8]; 2],
    range: [[f32; 8]; 2],
    /// Reference points.
    origin: [[f32; 8]; 2],
}

/// A quad of one of [`Eight`] triangles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EightQuad(u32);

impl EightQuad {
    /// Which triangle it is of.
    #[inline(always)]
    pub fn triangle(self) -> usize {
        (self.0 >> 13 & 7) as usize
    }

    /// Its column and row in the window.
    #[inline(always)]
    pub fn place(self) -> [usize; 2] {
        const PLACES: [[u8; 2]; 8] = [[0, 0], [1, 0], [2, 0], [0, 1], [1, 1], [2, 1], [0, 0], [0, 0]];
        PLACES[(self.0 >> 10 & 7) as usize].map(usize::from)
    }

    /// Number of the quad in its 64x64 tile: blocks of 8x8 row by row, quads of a block row by row.
    #[inline(always)]
    pub fn in_tile(self) -> u32 {
        self.0 & 0x3ff
    }

    /// Covered pixels.
    #[inline(always)]
    pub fn coverage(self) -> u32 {
        self.0 >> 16 & 15
    }
}

impl Eight {
    /// Whether a triangle faces front.
    #[inline(always)]
    pub fn is_front(&self, i: usize) -> bool {
        self.front >> i & 1 == 1
    }

    /// Covered pixels of a triangle; their number matters.
    #[inline(always)]
    pub fn pixels(&self, i: usize) -> u32 {
        self.mask[i]
    }

    /// Lists the quads with coverage of the first `n` triangles, in order; returns their number.
    #[inline(always)]
    pub fn quads(&self, n: usize, out: &mut [EightQuad; 48]) -> usize {
        let mut count = 0;
        for i in 0..n.min(8) {
            for q in 0..6 {
                // Written in any case and kept if there is coverage: which quads have some is not predictable.
                let quad = EightQuad(self.quads[q][i]);
                out[count.min(47)] = quad;
                count += usize::from(quad.coverage() != 0);
            }
        }
        count
    }

    /// Aligned 8x8 blocks in which the first `n` triangles cover pixels, those of each counted for itself.
    #[inline(always)]
    pub fn blocks(&self, n: usize) -> u32 {
        self.parts.iter().map(|part| (part & ((1 << n) - 1)).count_ones()).sum()
    }

    /// The left upper pixel of a quad.
    #[inline(always)]
    pub fn pixel(&self, quad: EightQuad) -> [u16; 2] {
        let (i, [column, row]) = (quad.triangle(), quad.place());
        [self.corner[0][i] as u16 + 2 * column as u16, self.corner[1][i] as u16 + 2 * row as u16]
    }

    /// The depth plane of a triangle.
    pub fn depth(&self, i: usize) -> DepthPlane {
        DepthPlane {
            x0: self.origin[0][i],
            y0: self.origin[1][i],
            z0: self.z0[i],
            dzdx: self.slope[0][i],
            dzdy: self.slope[1][i],
            min: self.range[0][i],
            max: self.range[1][i],
        }
    }
}
