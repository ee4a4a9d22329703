//! Which pipeline owns which pixels.

use crate::work::BLOCK;

crate::choices! {
    /// How screen tiles are dealt to pipelines.
    pub enum Pattern {
        /// Each row of tiles goes on where a skewed step from the row above starts, so that no column belongs to few pipelines.
        Skewed "skewed",
        /// Whole rows of tiles in turn.
        Rows "rows",
        /// Along the Z-order curve.
        Morton "morton",
        /// By a hash of column and row.
        Hashed "hashed",
    }
}

/// A partition of the screen.
#[derive(Clone, Copy, Debug)]
pub struct Interleave {
    pattern: Pattern,
    pipelines: u32,
    shift: u32,
    skew: u32,
}

impl Interleave {
    /// Tiles of `tile` x `tile` pixels (a power of two, at least 8) dealt to `pipelines`.
    pub fn new(pattern: Pattern, pipelines: u32, tile: u32) -> Interleave {
        // A step near half the pipelines and coprime to them visits all of them down a column.
        let skew = (1..=pipelines).rev().find(|&s| s <= pipelines / 2 + 1 && gcd(s, pipelines) == 1).unwrap_or(1);
        Interleave { pattern, pipelines, shift: tile.trailing_zeros() - BLOCK.trailing_zeros(), skew }
    }

    /// Edge of a tile in pixels.
    pub fn tile(&self) -> u32 {
        BLOCK << self.shift
    }

    /// Owner of the 8x8 block in that column and row.
    #[inline(always)]
    pub fn owner(&self, block_x: u32, block_y: u32) -> u8 {
        if self.pipelines == 1 {
            return 0;
        }
        let (x, y) = (block_x >> self.shift, block_y >> self.shift);
        let number = match self.pattern {
            Pattern::Skewed => x + y * self.skew,
            Pattern::Rows => y,
            Pattern::Morton => spread(x) | spread(y) << 1,
            Pattern::Hashed => {
                let mixed = (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
                mixed ^ mixed >> 15
            }
        };
        (number % self.pipelines) as u8
    }
}

fn gcd(a: u32, b: u32) -> u32 {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// The bits of a 16-bit number at even places.
fn spread(x: u32) -> u32 {
    let x = (x | x << 8) & 0x00ff_00ff;
    let x = (x | x << 4) & 0x0f0f_0f0f;
    let x = (x | x << 2) & 0x3333_3333;
    (x | x << 1) & 0x5555_5555
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pattern_deals_evenly() {
        for pattern in [Pattern::Skewed, Pattern::Rows, Pattern::Morton, Pattern::Hashed] {
            for pipelines in [1, 2, 3, 4, 7, 16, 64] {
                let interleave = Interleave::new(pattern, pipelines, 32);
                let mut count = vec![0u32; pipelines as usize];
                for y in 0..64 * 4 {
                    for x in 0..64 * 4 {
                        count[usize::from(interleave.owner(x, y))] += 1;
                    }
                }
                // Tiles are 4x4 blocks. A hash deals them as at random: within four standard deviations.
                let mean = 4096.0 / f64::from(pipelines);
                let allowed = if pattern == Pattern::Hashed { 4.0 * mean.sqrt() } else { mean / 8.0 };
                let far = count.iter().map(|&c| (f64::from(c) / 16.0 - mean).abs()).fold(0.0, f64::max);
                assert!(far <= allowed, "{pattern:?} {pipelines}: {count:?}");
            }
        }
    }

    #[test]
    fn blocks_of_a_tile_have_one_owner() {
        let interleave = Interleave::new(Pattern::Skewed, 4, 64);
        for x in 0..8 {
            assert_eq!(interleave.owner(x, 3), interleave.owner(0, 0));
        }
        assert_ne!(interleave.owner(8, 0), interleave.owner(0, 0));
    }
}
