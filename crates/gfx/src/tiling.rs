//! Where texels lie in the simulated card's memory.
//!
//! This differs on purpose from the linear store that holds their bytes ([`super::image`]): the card's layout is blocked, as on
//! real cards, so that a 64-byte line holds a square of texels and walking a texture along or across costs the same. Only
//! addresses of this kind reach a cache model; no byte is stored there.

use super::format::Format;
use super::image::ImageDesc;

/// Bytes of a memory line, the unit of all addresses that leave this module as line numbers.
pub const LINE: u64 = 64;

/// Edge of a render target block in pixels.
pub const BLOCK: u32 = 8;

/// Width and height, as powers of two, of the square or 2:1 group of blocks that fills one line.
const fn line_shape(block_bytes: u64) -> (u32, u32) {
    match block_bytes {
        0 | 1 => (3, 3),
        2 => (3, 2),
        3 | 4 => (2, 2),
        5..=8 => (2, 1),
        9..=16 => (1, 1),
        17..=32 => (1, 0),
        _ => (0, 0),
    }
}

/// The layout of a sampled texture in the simulated card's memory.
///
/// A line of 64 bytes holds a micro tile: 4x4 texels of four bytes, 8x8 of one, 2x2 of sixteen, 4x2 blocks of BC1. Micro tiles
/// follow each other along the rows of a slice; slices, then levels, follow each other, each aligned to a line.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Tiled {
    levels: Vec<TiledLevel>,
    lines: u32,
}

/// One level of a [`Tiled`] texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TiledLevel {
    /// First line, counted from the texture's base.
    first: u32,
    /// Lines of a row of micro tiles.
    row: u32,
    /// Lines of a slice.
    slice: u32,
    /// Texels of a micro tile, as powers of two.
    shift: (u32, u32),
    /// Lines of one micro tile: more than 1 only where a texel with its samples is larger than a line.
    tile: u32,
}

impl TiledLevel {
    /// The line of a texel, counted from the texture's base. Coordinates must be inside the level.
    #[inline(always)]
    pub fn line(&self, x: u32, y: u32, slice: u32) -> u32 {
        self.first
            .wrapping_add(slice.wrapping_mul(self.slice))
            .wrapping_add((y >> self.shift.1).wrapping_mul(self.row))
            .wrapping_add((x >> self.shift.0).wrapping_mul(self.tile))
    }

    /// The first line of a slice, counted from the texture's base, and the lines of a row of micro tiles.
    #[inline(always)]
    pub fn rows(&self, slice: u32) -> (u32, u32) {
        (self.first.wrapping_add(slice.wrapping_mul(self.slice)), self.row)
    }

    /// Texels of a micro tile across and down, as powers of two, and its lines: the same in all levels of a texture.
    #[inline(always)]
    pub fn micro_tile(&self) -> ((u32, u32), u32) {
        (self.shift, self.tile)
    }
}

impl Tiled {
    /// The layout of a texture.
    ///
    /// # Panics
    /// If the texture has more than 2^32 lines (256 GiB).
    pub fn new(image: &ImageDesc) -> Tiled {
        let (sx, sy) = line_shape(image.texel_bytes());
        let block = image.format.block_dim().trailing_zeros();
        let tile = image.texel_bytes().div_ceil(LINE).max(1);
        let mut lines = 0_u64;
        let levels = (0..image.levels)
            .map(|level| {
                let ([w, h], slices) = (image.level_blocks(level), image.level_size(level)[2]);
                let row = u64::from(w.div_ceil(1 << sx)) * tile;
                let slice = row * u64::from(h.div_ceil(1 << sy));
                let first = lines;
                lines += slice * u64::from(slices);
                assert!(lines <= u64::from(u32::MAX), "a texture of {lines} lines");
                TiledLevel {
                    first: first as u32,
                    row: row as u32,
                    slice: slice as u32,
                    shift: (sx + block, sy + block),
                    tile: tile as u32,
                }
            })
            .collect();
        Tiled { levels, lines: lines as u32 }
    }

    /// Levels, the largest first.
    pub fn levels(&self) -> &[TiledLevel] {
        &self.levels
    }

    /// Bytes of the whole texture.
    pub fn bytes(&self) -> u64 {
        u64::from(self.lines) * LINE
    }
}

/// The layout of one slice of a render target in the simulated card's memory: blocks of 8x8 pixels, each contiguous, along rows.
///
/// A block of one-sample four-byte pixels is four lines; the unit of fast clear and compression.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BlockLayout {
    /// Blocks in a row.
    pub columns: u32,
    /// Rows of blocks.
    pub rows: u32,
    /// Bytes of a block, all samples.
    pub block_bytes: u32,
}

impl BlockLayout {
    /// The layout of a target of `width` x `height` pixels.
    pub fn new(width: u32, height: u32, samples: u32, format: Format) -> BlockLayout {
        BlockLayout {
            columns: width.div_ceil(BLOCK),
            rows: height.div_ceil(BLOCK),
            block_bytes: format.block_bytes() * samples * BLOCK * BLOCK,
        }
    }

    /// Number of blocks.
    pub fn blocks(&self) -> u32 {
        self.columns * self.rows
    }

    /// The block that holds a pixel.
    #[inline(always)]
    pub fn block(&self, x: u32, y: u32) -> u32 {
        (y / BLOCK) * self.columns + x / BLOCK
    }

    /// First byte of a block, counted from the slice's base.
    #[inline(always)]
    pub fn address(&self, block: u32) -> u64 {
        u64::from(block) * u64::from(self.block_bytes)
    }

    /// Bytes of the whole slice.
    pub fn bytes(&self) -> u64 {
        self.address(self.blocks())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::state::TextureDimension;
    use std::collections::BTreeSet;

    #[test]
    fn lines_hold_squares_and_are_all_used() {
        for (format, texels) in [
            (Format::R8Unorm, 64),
            (Format::R16Float, 32),
            (Format::Rgba8Unorm, 16),
            (Format::Rgba16Float, 8),
            (Format::Rgba32Float, 4),
            (Format::Bc1RgbaUnorm, 128),
            (Format::Bc7RgbaUnorm, 64),
        ] {
            let shape = ImageDesc { dimension: TextureDimension::D2, size: [64, 32, 2], levels: 6, samples: 1, format };
            let tiled = Tiled::new(&shape);
            let mut seen = BTreeSet::new();
            let mut first = 0;
            for y in 0..32 {
                for x in 0..64 {
                    let line = tiled.levels()[0].line(x, y, 0);
                    first += u32::from(line == 0);
                    seen.insert(line);
                }
            }
            assert_eq!(first, texels, "{format:?}");
            assert_eq!(seen.len() as u32, 64 * 32 / texels);
            for level in 0..6 {
                let [w, h, d] = shape.level_size(level);
                for slice in 0..d {
                    for y in 0..h {
                        for x in 0..w {
                            seen.insert(tiled.levels()[level as usize].line(x, y, slice));
                        }
                    }
                }
            }
            assert_eq!(seen.len() as u64 * LINE, tiled.bytes());
            assert_eq!(seen.last().copied(), Some(tiled.lines - 1));
        }
    }

    #[test]
    fn blocks_hold_eight_by_eight_pixels() {
        let layout = BlockLayout::new(20, 9, 4, Format::Rgba8Unorm);
        assert_eq!((layout.columns, layout.rows, layout.block_bytes), (3, 2, 1024));
        assert_eq!(layout.block(19, 8), 5);
        assert_eq!(layout.bytes(), 6 * 1024);
    }
}
