//! Sizes of textures and of the linear memory that copies read and write.

use gfx::format::Format;
use gfx::state::{Aspect, TextureDimension, ViewDimension};

use super::command::{LinearLayout, TextureDesc, ViewDesc};

impl TextureDesc {
    /// Size of a level in texels: width, height, depth or layers.
    pub fn level_size(&self, level: u32) -> [u32; 3] {
        let shrink = |extent: u32| extent.checked_shr(level).unwrap_or(0).max(1);
        let [width, height, depth] = self.size;
        match self.dimension {
            TextureDimension::D1 => [shrink(width), 1, 1],
            TextureDimension::D2 => [shrink(width), shrink(height), depth],
            TextureDimension::D3 => [shrink(width), shrink(height), shrink(depth)],
        }
    }

    /// Layers: 1 unless it is a 2D texture.
    pub fn layers(&self) -> u32 {
        if self.dimension == TextureDimension::D2 { self.size[2] } else { 1 }
    }

    /// Levels of a full chain, down to one texel.
    pub fn full_levels(&self) -> u32 {
        let [width, height, depth] = self.size;
        let longest = match self.dimension {
            TextureDimension::D1 => 1,
            TextureDimension::D2 => width.max(height),
            TextureDimension::D3 => width.max(height).max(depth),
        };
        longest.max(1).ilog2() + 1
    }

    /// Bytes of all levels, tightly packed; none if that is more than 64 bits count.
    pub fn bytes(&self) -> Option<u64> {
        (0..self.levels.min(32)).try_fold(0u64, |sum, level| {
            let [width, height, depth] = self.level_size(level);
            let dim = self.format.block_dim();
            let blocks = u64::from(width.div_ceil(dim)) * u64::from(height.div_ceil(dim));
            let bytes = u64::from(self.format.block_bytes()) * u64::from(self.samples);
            sum.checked_add(blocks.checked_mul(u64::from(depth))?.checked_mul(bytes)?)
        })
    }
}

impl ViewDesc {
    /// The dimension of this view of a texture: what is asked for, or what follows from the texture.
    pub fn dimension_of(&self, texture: &TextureDesc) -> ViewDimension {
        self.dimension.unwrap_or(match texture.dimension {
            TextureDimension::D1 => ViewDimension::D1,
            TextureDimension::D3 => ViewDimension::D3,
            TextureDimension::D2 if texture.layers() == 1 => ViewDimension::D2,
            TextureDimension::D2 => ViewDimension::D2Array,
        })
    }

    /// Number of levels of this view of a texture.
    pub fn levels_of(&self, texture: &TextureDesc) -> u32 {
        self.levels.unwrap_or(texture.levels.saturating_sub(self.base_level))
    }

    /// Number of layers of this view of a texture: what is asked for, or what follows from the dimension.
    pub fn layers_of(&self, texture: &TextureDesc) -> u32 {
        self.layers.unwrap_or(match self.dimension_of(texture) {
            ViewDimension::D1 | ViewDimension::D2 | ViewDimension::D3 => 1,
            ViewDimension::Cube => 6,
            ViewDimension::D2Array | ViewDimension::CubeArray => texture.layers().saturating_sub(self.base_layer),
        })
    }
}

/// Bytes of a block of one aspect of a format in linear memory; none if the format does not have that aspect, or has two and
/// none is chosen. 24-bit depth takes four bytes.
pub fn copy_block_bytes(format: Format, aspect: Aspect) -> Option<u32> {
    let depth = match format {
        Format::Depth16Unorm => 2,
        _ => 4,
    };
    match (format.has_depth(), format.has_stencil(), aspect) {
        (false, false, Aspect::All) => Some(format.block_bytes()),
        (true, false, Aspect::All) | (true, _, Aspect::DepthOnly) => Some(depth),
        (false, true, Aspect::All) | (_, true, Aspect::StencilOnly) => Some(1),
        _ => None,
    }
}

/// How a copy of texels lies in linear memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LinearExtent {
    /// Bytes of one row of blocks that are copied.
    pub row_bytes: u64,
    /// Rows of blocks in one image.
    pub rows: u64,
    /// Images.
    pub images: u64,
    /// Bytes from one row to the next.
    pub row_pitch: u64,
    /// Bytes from one image to the next.
    pub image_pitch: u64,
    /// First byte.
    pub offset: u64,
    /// Byte after the last one that is copied.
    pub end: u64,
}

impl LinearLayout {
    /// Where a copy of `size` texels of a format lies; an error says why the layout does not fit.
    pub fn extent(&self, format: Format, block_bytes: u32, size: [u32; 3]) -> Result<LinearExtent, String> {
        let dim = format.block_dim();
        let row_bytes = u64::from(size[0].div_ceil(dim)) * u64::from(block_bytes);
        let rows = u64::from(size[1].div_ceil(dim));
        let images = u64::from(size[2]);
        let row_pitch = self.bytes_per_row.map_or(row_bytes, u64::from);
        if row_pitch < row_bytes {
            return Err(format!("bytes_per_row is {row_pitch}, a row has {row_bytes}"));
        }
        let rows_per_image = self.rows_per_image.map_or(rows, u64::from);
        if rows_per_image < rows {
            return Err(format!("rows_per_image is {rows_per_image}, an image has {rows}"));
        }
        let overflow = || "the copy is larger than memory can be".to_owned();
        let image_pitch = row_pitch.checked_mul(rows_per_image).ok_or_else(overflow)?;
        let end = if row_bytes == 0 || rows == 0 || images == 0 {
            Some(self.offset)
        } else {
            let last_image = image_pitch.checked_mul(images - 1);
            let last_row = row_pitch * (rows - 1);
            last_image.and_then(|at| at.checked_add(last_row + row_bytes)?.checked_add(self.offset))
        };
        Ok(LinearExtent {
            row_bytes,
            rows,
            images,
            row_pitch,
            image_pitch,
            offset: self.offset,
            end: end.ok_or_else(overflow)?,
        })
    }
}
