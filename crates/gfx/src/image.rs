//! Where the texels of a texture lie in its [`Words`](num::Words).
//!
//! Linear and tightly packed: level after level; inside a level layer after layer (or slice after slice); inside a layer rows of
//! blocks, top to bottom; a multisampled texel is its samples in order. Levels start at multiples of 16 bytes. (The card's memory
//! is tiled otherwise: see `gfx::tiling`, which only addresses use.)

use super::format::Format;
use super::state::TextureDimension;

/// Shape of a texture.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ImageDesc {
    /// Dimension.
    pub dimension: TextureDimension,
    /// Width, height, and depth or layers, in texels, all at least 1.
    pub size: [u32; 3],
    /// Mip levels, at least 1.
    pub levels: u32,
    /// Samples per texel.
    pub samples: u32,
    /// Format.
    pub format: Format,
}

impl ImageDesc {
    /// Width, height, and depth or layers, of a level in texels.
    pub fn level_size(&self, level: u32) -> [u32; 3] {
        let shrink = |n: u32| (n >> level.min(31)).max(1);
        match self.dimension {
            TextureDimension::D1 => [shrink(self.size[0]), 1, self.size[2]],
            TextureDimension::D2 => [shrink(self.size[0]), shrink(self.size[1]), self.size[2]],
            TextureDimension::D3 => [shrink(self.size[0]), shrink(self.size[1]), shrink(self.size[2])],
        }
    }

    /// Columns and rows of blocks of a level.
    pub fn level_blocks(&self, level: u32) -> [u32; 2] {
        let [w, h, _] = self.level_size(level);
        let dim = self.format.block_dim();
        [w.div_ceil(dim), h.div_ceil(dim)]
    }

    /// Bytes of one texel (all samples), or of one block of a compressed format.
    pub fn texel_bytes(&self) -> u64 {
        u64::from(self.format.block_bytes()) * u64::from(self.samples)
    }

    /// Bytes of one row of blocks of a level.
    pub fn row_bytes(&self, level: u32) -> u64 {
        u64::from(self.level_blocks(level)[0]) * self.texel_bytes()
    }

    /// Bytes of one layer or slice of a level.
    pub fn layer_bytes(&self, level: u32) -> u64 {
        self.row_bytes(level) * u64::from(self.level_blocks(level)[1])
    }

    /// Bytes of a level, padding to the next level included.
    pub fn level_bytes(&self, level: u32) -> u64 {
        (self.layer_bytes(level) * u64::from(self.level_size(level)[2])).next_multiple_of(16)
    }

    /// First byte of a layer or slice of a level.
    pub fn offset(&self, level: u32, layer: u32) -> u64 {
        (0..level).map(|l| self.level_bytes(l)).sum::<u64>() + u64::from(layer) * self.layer_bytes(level)
    }

    /// Bytes in all.
    pub fn bytes(&self) -> u64 {
        (0..self.levels).map(|l| self.level_bytes(l)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subresources_follow_each_other() {
        let image =
            ImageDesc { dimension: TextureDimension::D2, size: [10, 6, 3], levels: 3, samples: 1, format: Format::Rgba8Unorm };
        assert_eq!(image.level_size(2), [2, 1, 3]);
        assert_eq!(image.layer_bytes(0), 240);
        assert_eq!(image.offset(0, 2), 480);
        assert_eq!(image.offset(1, 0), 720);
        assert_eq!(image.level_bytes(1), 192, "180 bytes, padded to 16");
        assert_eq!(image.bytes(), 720 + 192 + 32);
        let blocks = ImageDesc { format: Format::Bc1RgbaUnorm, ..image };
        assert_eq!(blocks.level_blocks(0), [3, 2]);
        assert_eq!(blocks.layer_bytes(0), 48);
        let volume = ImageDesc { dimension: TextureDimension::D3, size: [4, 4, 4], ..image };
        assert_eq!(volume.level_size(1), [2, 2, 2]);
    }
}
