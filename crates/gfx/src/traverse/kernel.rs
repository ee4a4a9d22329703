//! Coverage of 8x8 grids by convex sets of half planes, 64 positions at once in 32-bit arithmetic.
//!
//! Exactness. An edge function at the positions of a grid of power-of-two pitch `P` (in 1/256 pixel) is
//! `E0 + P (a i + b j)` with integers. Since `P k` is a multiple of P, `E0 + P k >= 0` exactly if `floor(E0 / P) + k >= 0`:
//! the low bits of E0 never matter, and a shift removes them. What is left is `c + a i + b j` with 0 <= i, j < 8 and
//! |a|, |b| < 2^24, so that `|a i + b j| <= 14 * 2^24 < 2^28`. Clamping c to +-2^30 therefore changes no sign (beyond the
//! clamp the sum has the sign of c either way) and every sum stays inside +-(2^30 + 2^28), far from overflow. So 32 bits are
//! exact at every extent up to the guard band, and there is no second, 64-bit path.

use crate::setup::Edge;
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

/// Where 64 positions lie, by whatever instructions. An edge is inside where `c + a i + b j >= 0`: slopes as they are in a
/// primitive, which therefore come straight from its memory, and constants from [`reduce`].
pub(super) trait Kernel {
    /// Positions inside all edges, in quad order: bit `4 q + p`, quads of 2x2 row by row (four per row), p as everywhere.
    fn quads<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64;

    /// Positions inside all edges, row by row: bit `8 j + i`.
    fn rows<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64;
}

/// Without vector instructions by name.
pub(super) struct Portable;

/// Packs the top byte of each of eight lanes, lane 0 lowest.
#[inline(always)]
fn pack(outside: [u32; 8]) -> u64 {
    u64::from_le_bytes(outside.map(|v| (v >> 24) as u8))
}

impl Kernel for Portable {
    #[inline(always)]
    fn quads<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64 {
        // A lane is a byte of the mask: two quads side by side, 4x2 pixels. Its eight bits are visited in order.
        let mut value = [[0i32; 8]; N];
        for n in 0..N {
            let Edge { a, b, .. } = edges[n];
            for lane in 0..8 {
                value[n][lane] = c[n] + a * (4 * (lane as i32 & 1)) + b * (2 * (lane as i32 >> 1));
            }
        }
        // Steps from each position of a byte to the next: right, left and down, right, right and up, and again.
        walk(value, |n, t| match t & 3 {
            1 => edges[n].b - edges[n].a,
            3 => edges[n].a - edges[n].b,
            _ => edges[n].a,
        })
    }

    #[inline(always)]
    fn rows<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64 {
        // A lane is a row.
        let mut value = [[0i32; 8]; N];
        for n in 0..N {
            for lane in 0..8 {
                value[n][lane] = c[n] + edges[n].b * lane as i32;
            }
        }
        walk(value, |n, _| edges[n].a)
    }
}

/// Collects the signs of eight positions per lane; `step(n, t)` leads edge n from position t to the next.
#[inline(always)]
fn walk<const N: usize>(mut value: [[i32; 8]; N], step: impl Fn(usize, usize) -> i32) -> u64 {
    let mut outside = [0u32; 8];
    for t in 0..8 {
        for lane in 0..8 {
            let mut sign = 0;
            for n in 0..N {
                sign |= value[n][lane];
            }
            outside[lane] = outside[lane] >> 1 | sign as u32 & 0x8000_0000;
        }
        for n in 0..N {
            for lane in 0..8 {
                value[n][lane] += step(n, t);
            }
        }
    }
    !pack(outside)
}

/// With AVX2: a third of the portable kernel's time, because its signs leave the registers by two instructions. To be used
/// only in functions that are compiled for AVX2 and run only on hosts that have it.
#[cfg(target_arch = "x86_64")]
pub(super) struct Avx2;

#[cfg(target_arch = "x86_64")]
mod avx2 {
    use std::arch::x86_64::*;

    use super::Edge;

    /// The signs of `N` edges at eight steps of eight positions each: bit 31 of each lane is set where any edge is negative.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn negative<const N: usize>(value: &[__m256i; N]) -> __m256i {
        let mut all = value[0];
        for v in &value[1..] {
            all = _mm256_or_si256(all, *v);
        }
        all
    }

    /// Packs the signs of 4 x 8 lanes into bytes; each 128-bit half holds its lanes of all four in order.
    #[inline]
    #[target_feature(enable = "avx2")]
    fn pack([a, b, c, d]: [__m256i; 4]) -> __m256i {
        // Saturation keeps signs.
        _mm256_packs_epi16(_mm256_packs_epi32(a, b), _mm256_packs_epi32(c, d))
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn quads<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64 {
        // The lower half is a quad, the upper the quad below it. Four steps of two pixels to the right cover two rows of
        // quads, and packing leaves their bits in order; the same again four pixels further down.
        let mut value = [_mm256_setzero_si256(); N];
        for n in 0..N {
            let Edge { a, b, .. } = edges[n];
            let right = _mm256_and_si256(_mm256_set1_epi32(a), _mm256_setr_epi32(0, -1, 0, -1, 0, -1, 0, -1));
            let down = _mm256_mullo_epi32(_mm256_set1_epi32(b), _mm256_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3));
            value[n] = _mm256_add_epi32(_mm256_set1_epi32(c[n]), _mm256_add_epi32(right, down));
        }
        let mut mask = 0;
        for half in 0..2 {
            let mut signs = [_mm256_setzero_si256(); 4];
            let mut at = value;
            for t in 0..4 {
                signs[t] = negative(&at);
                for n in 0..N {
                    at[n] = _mm256_add_epi32(at[n], _mm256_set1_epi32(2 * edges[n].a));
                }
            }
            mask |= u64::from(_mm256_movemask_epi8(pack(signs)) as u32) << (32 * half);
            for n in 0..N {
                value[n] = _mm256_add_epi32(value[n], _mm256_set1_epi32(4 * edges[n].b));
            }
        }
        !mask
    }

    #[inline]
    #[target_feature(enable = "avx2")]
    pub(super) fn rows<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64 {
        let mut value = [_mm256_setzero_si256(); N];
        for n in 0..N {
            let Edge { a, .. } = edges[n];
            let right = _mm256_mullo_epi32(_mm256_set1_epi32(a), _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7));
            value[n] = _mm256_add_epi32(_mm256_set1_epi32(c[n]), right);
        }
        let mut mask = 0;
        for half in 0..2 {
            let mut signs = [_mm256_setzero_si256(); 4];
            for t in 0..4 {
                signs[t] = negative(&value);
                for n in 0..N {
                    value[n] = _mm256_add_epi32(value[n], _mm256_set1_epi32(edges[n].b));
                }
            }
            // Left halves of four rows, then their right halves: interleave them.
            let bytes = _mm256_permutevar8x32_epi32(pack(signs), _mm256_setr_epi32(0, 4, 1, 5, 2, 6, 3, 7));
            mask |= u64::from(_mm256_movemask_epi8(bytes) as u32) << (32 * half);
        }
        !mask
    }
}

#[cfg(target_arch = "x86_64")]
impl Kernel for Avx2 {
    #[inline(always)]
    fn quads<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64 {
        // SAFETY: by the type's contract the host has AVX2; nothing else is asked for.
        unsafe { avx2::quads(edges, c) }
    }

    #[inline(always)]
    fn rows<const N: usize>(edges: &[Edge; N], c: &[i32; N]) -> u64 {
        // SAFETY: by the type's contract the host has AVX2; nothing else is asked for.
        unsafe { avx2::rows(edges, c) }
    }
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
            let (quads, rows) = (Portable::quads(&edges, c), Portable::rows(&edges, c));
            #[cfg(target_arch = "x86_64")]
            if crate::simd::host_has!("avx2") {
                assert_eq!((quads, rows), (Avx2::quads(&edges, c), Avx2::rows(&edges, c)), "{wide:?}");
            }
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
