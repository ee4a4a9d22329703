//! Texture views made ready for sampling: a copy of the texels in a form that filters read directly.

use super::read::Reader;
use crate::format::{Format, TexelClass, TexelKind};
use crate::image::ImageDesc;
use crate::state::{Aspect, ViewDimension};
use crate::tiling::{LINE, Tiled, TiledLevel};
use num::Words;

/// Which part of a texture a view shows, and as what.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ViewRange {
    /// Dimension of the view.
    pub dimension: ViewDimension,
    /// Format of the view: the texture's, or its twin with or without sRGB.
    pub format: Format,
    /// Aspect; all of a depth-stencil texture reads as depth.
    pub aspect: Aspect,
    /// First level.
    pub base_level: u32,
    /// Levels.
    pub levels: u32,
    /// First layer (0 for 3D).
    pub base_layer: u32,
    /// Layers (1 for 3D).
    pub layers: u32,
}

/// Why a view cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ViewError {
    /// Levels or layers that the texture does not have.
    #[error("a view of levels {levels:?} and layers {layers:?} of a texture with {has_levels} levels and {has_layers} layers")]
    Range {
        /// First level and number of levels.
        levels: (u32, u32),
        /// First layer and number of layers.
        layers: (u32, u32),
        /// Levels of the texture.
        has_levels: u32,
        /// Layers of the texture.
        has_layers: u32,
    },
    /// The format's texels have another size than the texture's.
    #[error("a view of format {view} of a texture of format {texture}")]
    Format {
        /// Format of the view.
        view: &'static str,
        /// Format of the texture.
        texture: &'static str,
    },
    /// A cube needs square levels and a multiple of six layers.
    #[error("a cube view of {layers} layers of {width} x {height} texels")]
    Cube {
        /// Layers of the view.
        layers: u32,
        /// Width of its first level.
        width: u32,
        /// Height of its first level.
        height: u32,
    },
    /// More texels than places can name.
    #[error("a view of {texels} texels, at most {MOST_TEXELS} are possible")]
    Size {
        /// Texels of the view, with those that its rows repeat.
        texels: u64,
    },
    /// The texture's bytes are fewer than its description asks.
    #[error("a texture of {needed} bytes with {present} present")]
    Bytes {
        /// Bytes that the description asks.
        needed: u64,
        /// Bytes there are.
        present: u64,
    },
}

/// One level of a view. Places are in texels of the view's store.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Level {
    /// Width, height, and slices (3D) or layers.
    pub size: [u32; 3],
    /// TexturePoint of the first texel.
    pub offset: u32,
    /// From a row to the next: with one sample, the width and one texel more, which repeats the row's first.
    pub stride: u32,
    /// From a slice or layer to the next.
    pub slice: u32,
    /// In columns of [`Texels::Unorm8`]: the first of the level, and from a slice or layer to the next.
    pub columns: [u32; 2],
    /// What a filter needs of the level, as vectors load it: the bits of width and height as `f32`, stride, and where the level begins
    /// ([`Texels::geometry`]).
    pub flat: [u32; 4],
}

/// The texels of a view.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Texels {
    /// Four 8-bit channels, red in the low byte, in columns of four rows of which the last is the next column's first
    /// (row `3 g + r` is word r of group g; below the last row is the first): so the four texels of a bilinear filter are two
    /// pairs of words, 16 bytes apart. Of a small triangle's texels a cache line of such columns holds nearly twice as many as
    /// one of rows, or of rows in pairs, and a texture is smaller than in pairs; where texels come from the second-level cache or
    /// beyond, that is what counts.
    Unorm8(Vec<[u32; 4]>),
    /// Four 8-bit channels, three of them sRGB; and the same texels in linear light, 16 bits per channel, 32640 is 1; red, blue,
    /// green, alpha from the low end.
    Srgb8 { codes: Vec<u32>, linear: Vec<u64> },
    /// One number: depth, or a red channel of 32 bits.
    F32(Vec<f32>),
    /// Four numbers.
    F32x4(Vec<[f32; 4]>),
    /// Four integers of 32 bits.
    U32x4(Vec<[u32; 4]>),
}

impl Texels {
    /// Where a level begins, and from a slice or layer of it to the next: in texels, or in columns.
    #[inline(always)]
    pub(super) fn geometry(&self, level: &Level) -> [u32; 2] {
        if let Texels::Unorm8(_) = self { level.columns } else { [level.offset, level.slice] }
    }
}

/// Rows of a group of columns, the one that it shares with the next not counted.
pub(super) const ROWS: u32 = 3;

/// The word of a texel in columns that begin at column `base`, of which `stride` make a group; rows are fewer than 2^16.
#[inline(always)]
pub(super) fn word_in_columns(base: u32, stride: u32, x: u32, y: u32) -> u32 {
    // A third of the row: exact for numbers of 16 bits.
    let group = y.wrapping_mul(43_691) >> 17;
    let column = base.wrapping_add(group.wrapping_mul(stride)).wrapping_add(x);
    column.wrapping_mul(4).wrapping_add(y.wrapping_sub(group.wrapping_mul(ROWS)))
}

/// Texels of a view at most, so that words of their store are numbered in 31 bits.
const MOST_TEXELS: u64 = (1 << 30) - 1;

/// 1 as a 16-bit filter value: 255 * 128, so that an 8-bit code is a shift away and differences fit 16 bits.
pub(super) const FIXED_ONE: f32 = 32640.0;

/// A loop: calls a function once for each number below a count, on any threads and in any order.
pub type Each<'a> = &'a dyn Fn(usize, &(dyn Fn(usize) + Sync));

/// A texture view ready for sampling. It is a copy: make a new one when the texture changes.
#[derive(Clone, Debug)]
pub struct View {
    pub(super) dimension: ViewDimension,
    pub(super) kind: TexelKind,
    /// How wide its texels are for the card's filters.
    pub(super) texel: TexelClass,
    pub(super) levels: Vec<Level>,
    pub(super) texels: Texels,
    pub(super) samples: u32,
    /// Comparison references are clamped to [0, 1]: the depth is fixed-point.
    pub(super) fixed_depth: bool,
    /// The card's layout, for recorded lines.
    pub(super) tiled: Tiled,
    pub(super) base_level: u32,
    pub(super) base_layer: u32,
    pub(super) base_line: u32,
}

impl View {
    /// Copies the texels of a view out of a texture's bytes. `address` is where the texture lies in the card's memory; only
    /// recorded lines depend on it.
    ///
    /// # Errors
    /// If the range does not lie in the texture, or does not fit its dimension and format.
    pub fn new(words: &Words, image: &ImageDesc, range: &ViewRange, address: u64) -> Result<View, ViewError> {
        View::new_in_parts(words, image, range, address, &|parts, part| (0..parts).for_each(part))
    }

    /// As [`View::new`], by a loop that may do parts of the work at once and in any order.
    ///
    /// # Errors
    /// As [`View::new`].
    pub fn new_in_parts(
        words: &Words,
        image: &ImageDesc,
        range: &ViewRange,
        address: u64,
        each: Each<'_>,
    ) -> Result<View, ViewError> {
        check(words, image, range)?;
        let volume = range.dimension == ViewDimension::D3;
        let mut levels = Vec::with_capacity(range.levels as usize);
        let (mut places, mut columns) = (0_u64, 0);
        for level in range.base_level..range.base_level + range.levels {
            let [w, h, d] = image.level_size(level);
            let slices = if volume { d } else { range.layers };
            let stride = if image.samples == 1 { w + 1 } else { w * image.samples };
            let (offset, first_column) = (places as u32, columns);
            places = places.saturating_add((u64::from(stride) * u64::from(h)).saturating_mul(u64::from(slices)));
            if places > MOST_TEXELS {
                return Err(ViewError::Size { texels: places });
            }
            let slice_columns = stride * h.div_ceil(ROWS);
            columns += slice_columns * slices;
            let columns = [first_column, slice_columns];
            levels.push(Level { size: [w, h, slices], offset, stride, slice: stride * h, columns, flat: [0; 4] });
        }
        let places = places as usize;
        let stencil = range.aspect == Aspect::StencilOnly || range.format == Format::Stencil8;
        let texels = Reader { words, image, range, levels: &levels, places, stencil, each }.read();
        for level in &mut levels {
            let [base, _] = texels.geometry(level);
            let [w, h] = [level.size[0], level.size[1]].map(|n| (n as f32).to_bits());
            level.flat = [w, h, level.stride, base];
        }
        let kind = if stencil { TexelKind::Uint } else { range.format.kind() };
        Ok(View {
            dimension: range.dimension,
            kind,
            texel: range.format.texel_class(),
            levels,
            texels,
            samples: image.samples,
            fixed_depth: matches!(range.format, Format::Depth16Unorm | Format::Depth24Plus | Format::Depth24PlusStencil8),
            tiled: Tiled::new(image),
            base_level: range.base_level,
            base_layer: if volume { 0 } else { range.base_layer },
            base_line: (address / LINE) as u32,
        })
    }

    /// Bytes that the texels of a view take when they are ready for sampling, about: nothing is checked.
    pub fn bytes(image: &ImageDesc, range: &ViewRange) -> u64 {
        let texels = |level: u32| {
            let [w, h, d] = image.level_size(level);
            let slices = if range.dimension == ViewDimension::D3 { d } else { range.layers };
            (u64::from(w) + 1) * u64::from(h) * u64::from(slices) * u64::from(image.samples)
        };
        let stored = image.format;
        // Four channels of 8 bits; with a second store in linear light; one number; four numbers.
        let bytes = match stored.block_bytes() {
            _ if stored.is_depth_stencil() || stored == Format::R32Float => 4,
            _ if range.format.is_srgb() => 12,
            _ if stored.is_compressed() => 16,
            1 | 2 | 4 => 10,
            _ => 16,
        };
        let levels = range.base_level..range.base_level.saturating_add(range.levels).min(image.levels);
        levels.map(texels).fold(0, u64::saturating_add).saturating_mul(bytes)
    }

    /// Dimension of the view.
    pub fn dimension(&self) -> ViewDimension {
        self.dimension
    }

    /// How a shader sees the texels.
    pub fn kind(&self) -> TexelKind {
        self.kind
    }

    /// Number of levels.
    pub fn levels(&self) -> u32 {
        self.levels.len() as u32
    }

    /// Number of layers of an array; of a cube array, of cubes.
    pub fn layers(&self) -> u32 {
        match self.dimension {
            ViewDimension::D3 => 1,
            ViewDimension::Cube | ViewDimension::CubeArray => self.levels[0].size[2] / 6,
            _ => self.levels[0].size[2],
        }
    }

    /// Samples per texel.
    pub fn samples(&self) -> u32 {
        self.samples
    }

    /// Width, height and depth of a level in texels (depth 1 but for 3D); zeros where the view has no such level.
    pub fn size(&self, level: u32) -> [u32; 3] {
        match self.levels.get(level as usize) {
            Some(l) => [l.size[0], l.size[1], if self.dimension == ViewDimension::D3 { l.size[2] } else { 1 }],
            None => [0; 3],
        }
    }

    /// Whether coordinates are directions.
    pub(super) fn is_cube(&self) -> bool {
        matches!(self.dimension, ViewDimension::Cube | ViewDimension::CubeArray)
    }

    /// The memory line of a texel of a slice or layer of the view.
    #[inline(always)]
    pub(super) fn line(&self, level: usize, x: u32, y: u32, slice: u32) -> u32 {
        self.base_line.wrapping_add(self.tiled(level).line(x, y, self.base_layer + slice))
    }

    /// Where the lines of a level are.
    #[inline(always)]
    pub(super) fn tiled(&self, level: usize) -> &TiledLevel {
        &self.tiled.levels()[self.base_level as usize + level]
    }

    /// The first line of a slice of a level, and the lines of a row of micro tiles.
    #[inline(always)]
    pub(super) fn rows(&self, level: usize, slice: u32) -> (u32, u32) {
        let (first, row) = self.tiled(level).rows(self.base_layer + slice);
        (self.base_line.wrapping_add(first), row)
    }
}

fn check(words: &Words, image: &ImageDesc, range: &ViewRange) -> Result<(), ViewError> {
    let layers = if range.dimension == ViewDimension::D3 { 1 } else { image.size[2] };
    let inside = |first: u32, count: u32, has: u32| count > 0 && first.checked_add(count).is_some_and(|end| end <= has);
    if !inside(range.base_level, range.levels, image.levels) || !inside(range.base_layer, range.layers, layers) {
        return Err(ViewError::Range {
            levels: (range.base_level, range.levels),
            layers: (range.base_layer, range.layers),
            has_levels: image.levels,
            has_layers: layers,
        });
    }
    let aspect_of = image.format.is_depth_stencil() && range.format.is_depth_stencil();
    let same = range.format.block_bytes() == image.format.block_bytes()
        && range.format.block_dim() == image.format.block_dim()
        && range.format.is_depth_stencil() == image.format.is_depth_stencil();
    if !same && !aspect_of {
        return Err(ViewError::Format { view: range.format.name(), texture: image.format.name() });
    }
    let [width, height, _] = image.level_size(range.base_level);
    let cube = matches!(range.dimension, ViewDimension::Cube | ViewDimension::CubeArray);
    if cube && (width != height || !range.layers.is_multiple_of(6)) {
        return Err(ViewError::Cube { layers: range.layers, width, height });
    }
    if words.len() < image.bytes() {
        return Err(ViewError::Bytes { needed: image.bytes(), present: words.len() });
    }
    Ok(())
}
