//! Coverage of 8x8 grids by convex sets of half planes, 64 positions at once in 32-bit arithmetic.
//!
//! Exactness. An edge function at the positions of a grid of power-of-two pitch `P` (in 1/256 pixel) is
//! `E0 + P (a i + b j)` with integers. Since `P k` is a multiple of P, `E0 + P k >= 0` exactly if `floor(E0 / P) + k >= 0`:
//! the low bits of E0 never matter, and a shift removes them. What is left is `c + a i + b j` with 0 <= i, j < 8 and
//! |a|, |b| < 2^24, so that `|a i + b j| <= 14 * 2^24 < 2^28`. Clamping c to +-2^30 therefore changes no sign (beyond the
//! clamp the sum has the sign of c either way) and every sum stays inside +-(2^30 + 2^28), far from overflow. So 32 bits are
//! exact at every extent up to the guard band, and there is no second, 64-bit path.

use crate::setup::Edge;
use fearless_simd::{Simd, i8x32, i32x8, prelude::*};
use num::SUBPIXEL_BITS;

/// `floor(c / 2^shift)` clamped as the module's proof asks.
#[inline(always)]
pub(super) fn reduce(c: i64, shift: u32) -> i32 {
    (c >> shift).clamp(-(1 << 30), 1 << 30) as i32
}

/// The shift for a grid of single pixels.
pub(super) const PIXEL_SHIFT: u32 = SUBPIXEL_BITS;
/// The shift for a grid of 8x8 blocks.
pub(super) const BLOCK_SHIFT: u32 = SUBPIXEL_BITS + 3;

/// Positions inside all edges, in quad order: bit `4 q + p`, quads of 2x2 row by row (four per row), p as everywhere. An edge is inside where
/// `c + a i + b j >= 0`: slopes as they are in a primitive, which therefore come straight from its memory, and constants from [`reduce`].
#[inline(always)]
pub(super) fn quads<V: Simd, const N: usize>(simd: V, edges: &[Edge; N], c: &[i32; N]) -> u64 {
    // A vector is two quads side by side. The first of each pair covers the left half of a row of quads, the second the right half.
    let right = i32x8::simd_from(simd, [0, 1, 0, 1, 2, 3, 2, 3]);
    let below = i32x8::simd_from(simd, [0, 0, -1, -1, 0, 0, -1, -1]);
    let mut left: [i32x8<V>; N] = std::array::from_fn(|n| {
        let Edge { a, b, .. } = edges[n];
        (right * a + c[n]) + (below & b)
    });
    let mut signs = [left[0]; 8];
    for row in 0..4 {
        let mut beside = left;
        for n in 0..N {
            beside[n] += 4 * edges[n].a;
        }
        signs[2 * row] = negative(&left);
        signs[2 * row + 1] = negative(&beside);
        for n in 0..N {
            left[n] += 2 * edges[n].b;
        }
    }
    !pack(simd, signs)
}

/// Positions inside all edges, row by row: bit `8 j + i`.
#[inline(always)]
pub(super) fn rows<V: Simd, const N: usize>(simd: V, edges: &[Edge; N], c: &[i32; N]) -> u64 {
    let right = i32x8::simd_from(simd, [0, 1, 2, 3, 4, 5, 6, 7]);
    let mut value: [i32x8<V>; N] = std::array::from_fn(|n| right * edges[n].a + c[n]);
    let mut signs = [right; 8];
    for row in &mut signs {
        *row = negative(&value);
        for n in 0..N {
            value[n] += edges[n].b;
        }
    }
    !pack(simd, signs)
}

/// Lanes that are negative where any edge is.
#[inline(always)]
fn negative<V: Simd, const N: usize>(value: &[i32x8<V>; N]) -> i32x8<V> {
    let mut all = value[0];
    for &v in &value[1..] {
        all |= v;
    }
    all
}

/// The signs of all lanes in order.
#[inline(always)]
fn pack<V: Simd>(simd: V, [a, b, c, d, e, f, g, h]: [i32x8<V>; 8]) -> u64 {
    // Saturation keeps signs.
    let low = a.saturating_narrow(b).saturating_narrow(c.saturating_narrow(d));
    let high = e.saturating_narrow(f).saturating_narrow(g.saturating_narrow(h));
    let zero = i8x32::splat(simd, 0);
    low.simd_lt(zero).to_bitmask() | high.simd_lt(zero).to_bitmask() << 32
}

/// Pixels of a block, in quad order, in columns below `k`; with 16 entries a masked index needs no check.
pub(super) const COLUMNS_BELOW: [u64; 16] = prefix_masks(true);
/// Pixels of a block, in quad order, in rows below `k`.
pub(super) const ROWS_BELOW: [u64; 16] = prefix_masks(false);

const fn prefix_masks(columns: bool) -> [u64; 16] {
    let mut out = [0; 16];
    let mut k = 0;
    while k < 16 {
        let mut bit = 0;
        while bit < 64 {
            let (quad, p) = (bit / 4, bit % 4);
            let (x, y) = (quad % 4 * 2 + p % 2, quad / 4 * 2 + p / 2);
            if (if columns { x } else { y }) < k {
                out[k] |= 1 << bit;
            }
            bit += 1;
        }
        k += 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn masks_are_the_signs_up_to_the_proven_bound() {
        const M: i64 = (1 << 24) - 1;
        let mut generator = num::Random::new(1);
        let mut random = || i64::from(generator.bits());
        for case in 0..4000 {
            let shift = [PIXEL_SHIFT, BLOCK_SHIFT][case % 2];
            let bits = 1 + random() as u32 % 24;
            let slope = |random: &mut dyn FnMut() -> i64| match random() % 6 {
                0 => M,
                1 => -M,
                2 => 0,
                _ => random() % (1 << bits) - (1 << (bits - 1)),
            };
            let wide: [[i64; 3]; 3] = std::array::from_fn(|_| {
                let (a, b) = (slope(&mut random), slope(&mut random));
                // Constants about the places where signs change in the grid, and the extremes.
                let (i, j) = (random() % 9 - 1, random() % 9 - 1);
                let c = match random() % 8 {
                    0 => 1 << 50,
                    1 => -(1 << 50),
                    2 => (1 << 30 << shift) + random() % 3 - 1,
                    3 => -(1 << 30 << shift) + random() % 3 - 1,
                    _ => -((a * i + b * j) << shift) + random() % 5 - 2,
                };
                [a, b, c]
            });
            let edges = wide.map(|[a, b, _]| Edge { a: a as i32, b: b as i32, c: 0 });
            let c = &wide.map(|[_, _, c]| reduce(c, shift));
            let inside = |i: i64, j: i64| wide.iter().all(|&[a, b, c]| c + ((a * i + b * j) << shift) >= 0);
            let (quads, rows) = crate::simd::dispatch!(simd => (quads(simd, &edges, c), rows(simd, &edges, c)));
            let base = crate::simd::base();
            assert_eq!((quads, rows), (super::quads(base, &edges, c), super::rows(base, &edges, c)), "{wide:?}");
            for j in 0..8 {
                for i in 0..8 {
                    let bit = 4 * (i / 2 + 4 * (j / 2)) + i % 2 + 2 * (j % 2);
                    assert_eq!(quads >> bit & 1 == 1, inside(i, j), "{wide:?} {i} {j}");
                    assert_eq!(rows >> (8 * j + i) & 1 == 1, inside(i, j), "{wide:?} {i} {j}");
                }
            }
        }
    }
}
