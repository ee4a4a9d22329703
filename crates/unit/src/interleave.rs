//! Which pipeline owns which pixels.

use work::BLOCK;

knob::choices! {
    /// How screen tiles are dealt to pipelines.
    pub enum Pattern {
        /// Rows of tiles in turn, each shifted against the others, so that every rectangle of as many tiles as there are pipelines belongs to
        /// most of them, and an aligned one whose sides divide their number belongs to all.
        Skewed "skewed",
        /// Whole rows of tiles in turn.
        Rows "rows",
        /// Along the Z-order curve.
        Morton "morton",
        /// By a hash of column and row.
        Hashed "hashed",
        /// One band of rows for each.
        Bands "bands",
        /// One rectangle for each, in a grid as near to square as their number allows.
        Blocks "blocks",
        /// One band of rows for each, whose borders follow the load of the frame before.
        Balanced "balanced",
    }
}

impl Pattern {
    /// Whether the size of a pass decides who owns a tile.
    pub fn is_of_pass(self) -> bool {
        matches!(self, Pattern::Bands | Pattern::Blocks | Pattern::Balanced)
    }
}

/// A partition of the screen.
#[derive(Clone, Debug)]
pub struct Interleave {
    pattern: Pattern,
    pipelines: u32,
    shift: u32,
    /// By row, modulo the pipelines, the owner of the first tile.
    skews: Vec<u32>,
    /// Tiles across and down the pass.
    across: u32,
    down: u32,
    /// Regions in a row, where they form a grid.
    columns: u32,
    /// Rows at which the bands after the first begin, where these are balanced.
    borders: Vec<u32>,
    /// Load by row of tiles, of each pass of this frame and of the one before.
    load: Vec<Vec<u64>>,
    before: Vec<Vec<u64>>,
}

impl Interleave {
    /// Tiles of `tile` x `tile` pixels (a power of two, at least 8) dealt to `pipelines`.
    pub fn new(pattern: Pattern, pipelines: u32, tile: u32) -> Interleave {
        let columns = (1..=pipelines).filter(|c| pipelines.is_multiple_of(*c)).find(|c| c * c >= pipelines).unwrap_or(1);
        Interleave {
            pattern,
            pipelines,
            shift: tile.trailing_zeros() - BLOCK.trailing_zeros(),
            skews: (0..pipelines).map(|row| skew(row, pipelines)).collect(),
            across: 1,
            down: 1,
            columns,
            borders: Vec::new(),
            load: Vec::new(),
            before: Vec::new(),
        }
    }

    /// Edge of a tile in pixels.
    pub fn tile(&self) -> u32 {
        BLOCK << self.shift
    }

    /// A pass of `width` by `height` pixels begins.
    pub fn begin_pass(&mut self, width: u32, height: u32) {
        (self.across, self.down) = (width.div_ceil(self.tile()).max(1), height.div_ceil(self.tile()).max(1));
        if self.pattern != Pattern::Balanced {
            return;
        }
        // Where the frame before had no such pass, rows count alike.
        let rows = self.down as usize;
        let load = match self.before.get(self.load.len()) {
            Some(load) if load.len() == rows && load.iter().any(|&row| row > 0) => load.clone(),
            _ => vec![1; rows],
        };
        self.load.push(vec![0; rows]);
        self.borders = borders(&load, self.pipelines);
    }

    /// A frame has ended.
    pub fn end_frame(&mut self) {
        self.before = std::mem::take(&mut self.load);
    }

    /// Whether the load of rows decides over the next frame.
    #[inline(always)]
    pub fn is_balanced(&self) -> bool {
        self.pattern == Pattern::Balanced
    }

    /// Notes that `quads` quads were found in a row of blocks.
    pub fn note(&mut self, block_y: u32, quads: u32) {
        if let Some(row) = self.load.last_mut().and_then(|load| load.get_mut((block_y >> self.shift) as usize)) {
            *row += u64::from(quads);
        }
    }

    /// Owner of the 8x8 block in that column and row.
    #[inline(always)]
    pub fn owner(&self, block_x: u32, block_y: u32) -> u8 {
        if self.pipelines == 1 {
            return 0;
        }
        let (x, y) = (block_x >> self.shift, block_y >> self.shift);
        let number = match self.pattern {
            Pattern::Skewed => x + self.skews[(y % self.pipelines) as usize],
            Pattern::Rows => y,
            Pattern::Morton => spread(x) | spread(y) << 1,
            Pattern::Hashed => {
                let mixed = (x.wrapping_mul(0x9e37_79b1) ^ y.wrapping_mul(0x85eb_ca6b)).wrapping_mul(0xc2b2_ae35);
                mixed ^ mixed >> 15
            }
            Pattern::Bands => y.min(self.down - 1) * self.pipelines / self.down,
            Pattern::Blocks => {
                let rows = self.pipelines / self.columns;
                y.min(self.down - 1) * rows / self.down * self.columns + x.min(self.across - 1) * self.columns / self.across
            }
            Pattern::Balanced => self.borders.partition_point(|&border| border <= y) as u32,
        };
        (number % self.pipelines) as u8
    }
}

/// Rows at which the bands after the first begin, so that each band's load is near the mean: a row goes to the band in which the
/// middle of its load lies.
fn borders(load: &[u64], bands: u32) -> Vec<u32> {
    let sum = load.iter().sum::<u64>().max(1);
    let mut borders = Vec::new();
    let mut before = 0;
    for (row, &own) in (0..).zip(load) {
        let band = ((2 * before + own) * u64::from(bands) / (2 * sum)).min(u64::from(bands) - 1);
        while (borders.len() as u64) < band {
            borders.push(row);
        }
        before += own;
    }
    borders.resize(bands as usize - 1, load.len() as u32);
    borders
}

/// The distance by which a row of tiles is shifted: its number with the digits reversed, in a mixed base of the prime factors of the pipelines. So
/// rows that are near each other are shifted far apart, and any as many rows as there are pipelines are shifted differently. A single digit
/// has no reverse: there each row takes a step near half the pipelines.
fn skew(row: u32, pipelines: u32) -> u32 {
    let smallest = |n: u32| (2..=n).find(|&factor| n.is_multiple_of(factor)).unwrap_or(1);
    if smallest(pipelines) == pipelines {
        let step = (1..=pipelines).rev().find(|&s| s <= pipelines / 2 + 1 && gcd(s, pipelines) == 1).unwrap_or(1);
        return row * step % pipelines;
    }
    let (mut row, mut left, mut shift) = (row, pipelines, 0);
    while left > 1 {
        let base = smallest(left);
        left /= base;
        shift += row % base * left;
        row /= base;
    }
    shift
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
        use Pattern::{Balanced, Bands, Blocks, Hashed, Morton, Rows, Skewed};
        for pattern in [Skewed, Rows, Morton, Hashed, Bands, Blocks, Balanced] {
            for pipelines in [1, 2, 3, 4, 7, 16, 64] {
                let mut interleave = Interleave::new(pattern, pipelines, 32);
                interleave.begin_pass(64 * 32, 64 * 32);
                let mut count = vec![0u32; pipelines as usize];
                for y in 0..64 * 4 {
                    for x in 0..64 * 4 {
                        count[usize::from(interleave.owner(x, y))] += 1;
                    }
                }
                // Tiles are 4x4 blocks. A hash deals them as at random: within four standard deviations.
                let mean = 4096.0 / f64::from(pipelines);
                // Whole rows, or whole columns of them, cannot be parted.
                let allowed = match pattern {
                    Hashed => 4.0 * mean.sqrt(),
                    Bands | Blocks | Balanced => 64.0,
                    _ => mean / 8.0,
                };
                let far = count.iter().map(|&c| (f64::from(c) / 16.0 - mean).abs()).fold(0.0, f64::max);
                assert!(far <= allowed, "{pattern:?} {pipelines}: {count:?}");
            }
        }
    }

    #[test]
    fn small_targets_belong_to_all_pipelines() {
        // Targets of 64, 128, 256 and 512 pixels in tiles of 64: as many tiles of each pipeline as of every other.
        for (pipelines, across, down) in [
            (4, 2, 2),
            (4, 4, 1),
            (4, 1, 4),
            (4, 4, 4),
            (16, 4, 4),
            (16, 2, 8),
            (16, 8, 2),
            (16, 8, 8),
            (6, 3, 2),
            (8, 4, 2),
            (9, 3, 3),
        ] {
            let interleave = Interleave::new(Pattern::Skewed, pipelines, 64);
            // Wherever the columns begin.
            for left in 0..pipelines {
                let mut count = vec![0; pipelines as usize];
                for (x, y) in (0..down).flat_map(|y| (left..left + across).map(move |x| (x, y))) {
                    count[usize::from(interleave.owner(x * 8, y * 8))] += 1;
                }
                assert_eq!(
                    count,
                    vec![across * down / pipelines; pipelines as usize],
                    "{pipelines}: {across}x{down} at {left}"
                );
            }
        }
        // Neighbours in both directions have different owners, and five tiles in a row or a column have five.
        let interleave = Interleave::new(Pattern::Skewed, 5, 8);
        let owners = |of: &dyn Fn(u32) -> (u32, u32)| (0..5).map(of).map(|(x, y)| 1 << interleave.owner(x, y)).sum::<u32>();
        assert_eq!((owners(&|n| (n, 3)), owners(&|n| (3, n))), (31, 31));
    }

    #[test]
    fn blocks_of_a_tile_have_one_owner() {
        let interleave = Interleave::new(Pattern::Skewed, 4, 64);
        for x in 0..8 {
            assert_eq!(interleave.owner(x, 3), interleave.owner(0, 0));
        }
        assert_ne!(interleave.owner(8, 0), interleave.owner(0, 0));
    }

    #[test]
    fn bands_follow_the_load_of_the_frame_before() {
        let mut interleave = Interleave::new(Pattern::Balanced, 4, 8);
        let owners = |interleave: &Interleave| (0..8).map(|y| interleave.owner(5, y)).collect::<Vec<_>>();
        interleave.begin_pass(64, 64);
        assert_eq!(owners(&interleave), [0, 0, 1, 1, 2, 2, 3, 3]);
        // All of the load in the last rows but one: 4, 4, 4, 4 quads.
        for row in 3..7 {
            interleave.note(row, 4);
        }
        assert_eq!(owners(&interleave), [0, 0, 1, 1, 2, 2, 3, 3], "not before the frame ends");
        interleave.end_frame();
        interleave.begin_pass(64, 64);
        assert_eq!(owners(&interleave), [0, 0, 0, 0, 1, 2, 3, 3]);
        // A pass of another size, and one that the frame before did not have.
        interleave.begin_pass(64, 32);
        assert_eq!((0..4).map(|y| interleave.owner(0, y)).collect::<Vec<_>>(), [0, 1, 2, 3]);
    }

    #[test]
    fn blocks_are_rectangles() {
        let mut interleave = Interleave::new(Pattern::Blocks, 6, 8);
        interleave.begin_pass(6 * 8, 4 * 8);
        let row = |y| (0..6).map(|x| interleave.owner(x, y)).collect::<Vec<_>>();
        assert_eq!((row(0), row(1)), (vec![0, 0, 1, 1, 2, 2], vec![0, 0, 1, 1, 2, 2]));
        assert_eq!((row(2), row(3)), (vec![3, 3, 4, 4, 5, 5], vec![3, 3, 4, 4, 5, 5]));
    }
}
