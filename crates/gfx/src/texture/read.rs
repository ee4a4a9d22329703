//! The texels of a view, out of a texture's bytes.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};
use std::sync::{Mutex, PoisonError};

use num::Words;

use super::view::{Each, FIXED_ONE, Level, ROWS, Texels, ViewRange};
use crate::format::{Format, TexelKind};
use crate::image::ImageDesc;
use crate::state::ViewDimension;
use crate::texel::{Rgba8, decode, decode_block, decode_block_rgba8, decode_srgb8, depth_value, stencil_value};

/// What is needed to copy the texels of a view.
pub(super) struct Reader<'a> {
    pub words: &'a Words,
    pub image: &'a ImageDesc,
    pub range: &'a ViewRange,
    pub levels: &'a [Level],
    pub places: usize,
    pub stencil: bool,
    pub each: Each<'a>,
}

impl Reader<'_> {
    pub fn read(&self) -> Texels {
        // The texture's own format says what the bytes are; the view's format says whether colours are sRGB, or picks an aspect.
        let stored = self.image.format;
        let view = if stored.is_depth_stencil() { stored } else { self.range.format };
        if self.stencil {
            return Texels::U32x4(self.texels([0; 4], |bytes| [u32::from(stencil_value(stored, bytes)), 0, 0, 1]));
        }
        if let Some(layout) = Rgba8::of(view) {
            return match (layout.srgb, layout.bgra) {
                (true, bgra) => {
                    self.four_channels(if bgra { self.words_as(red_first) } else { self.words_as(|code| code) }, true)
                }
                (false, true) => self.words_in_columns(red_first),
                (false, false) => self.words_in_columns(|code| code),
            };
        }
        match view {
            Format::Bc1RgbaUnorm
            | Format::Bc1RgbaUnormSrgb
            | Format::Bc2RgbaUnorm
            | Format::Bc2RgbaUnormSrgb
            | Format::Bc3RgbaUnorm
            | Format::Bc3RgbaUnormSrgb
            | Format::Bc7RgbaUnorm
            | Format::Bc7RgbaUnormSrgb => {
                self.four_channels(self.blocks(0, |block| decode_block_rgba8(view, block)), view.is_srgb())
            }
            _ if view.is_compressed() => {
                let block = |block: &[u8]| decode_block(view, block).map(|t| t.map(f32::from_bits));
                Texels::F32x4(self.blocks([0.0; 4], block))
            }
            Format::R8Unorm => self.four_channels(self.texels(0, |b| u32::from(b[0]) | 0xff00_0000), false),
            Format::Rg8Unorm => {
                self.four_channels(self.texels(0, |b| u32::from(b[0]) | u32::from(b[1]) << 8 | 0xff00_0000), false)
            }
            Format::R32Float | Format::Depth32Float => Texels::F32(self.words_as(f32::from_bits)),
            Format::Depth24Plus | Format::Depth24PlusStencil8 => Texels::F32(self.words_as(|code| depth_value(view, code))),
            _ if view.has_depth() => Texels::F32(self.texels(0.0, |bytes| f32::from_bits(decode(view, bytes)[0]))),
            _ => match view.kind() {
                TexelKind::Float => Texels::F32x4(self.texels([0.0; 4], |bytes| decode(view, bytes).map(f32::from_bits))),
                _ => Texels::U32x4(self.texels([0; 4], |bytes| decode(view, bytes))),
            },
        }
    }

    /// The layer or slice of the texture that a slice of the view is.
    fn layer(&self, slice: u32) -> u32 {
        if self.range.dimension == ViewDimension::D3 { slice } else { self.range.base_layer + slice }
    }

    /// Calls `row(level, place of the row, first byte of the row)` for every row of texels (of blocks) of the view.
    fn rows(&self, mut row: impl FnMut(&Level, usize, u64)) {
        let dim = self.image.format.block_dim();
        for (index, level) in self.levels.iter().enumerate() {
            let in_image = self.range.base_level + index as u32;
            for slice in 0..level.size[2] {
                let first = self.image.offset(in_image, self.layer(slice));
                for y in (0..level.size[1]).step_by(dim as usize) {
                    let place = level.offset as usize + (slice * level.slice + y * level.stride) as usize;
                    row(level, place, first + u64::from(y / dim) * self.image.row_bytes(in_image));
                }
            }
        }
    }

    /// Repeats the first texel of a row behind its last, where there is room for it.
    fn close_row<T: Copy>(&self, row: &mut [T]) {
        if self.image.samples == 1
            && let [first, .., last] = row
        {
            *last = *first;
        }
    }

    /// Texels of four bytes. Rows come in the order of their places.
    fn words_as<T: Copy>(&self, f: impl Fn(u32) -> T) -> Vec<T> {
        let mut out = Vec::with_capacity(self.places);
        self.rows(|level, place, byte| {
            let count = (level.size[0] * self.image.samples) as usize;
            let words = &self.words.words()[byte as usize / 4..byte as usize / 4 + count];
            out.extend(words.iter().map(|word| f(word.load(Relaxed))));
            if self.image.samples == 1
                && let Some(&first) = out.get(place)
            {
                out.push(first);
            }
        });
        out
    }

    /// Texels of any size.
    fn texels<T: Copy>(&self, zero: T, f: impl Fn(&[u8]) -> T) -> Vec<T> {
        let mut out = vec![zero; self.places];
        let size = self.image.format.block_bytes() as usize;
        let mut bytes = Vec::new();
        self.rows(|level, place, byte| {
            let row = &mut out[place..place + level.stride as usize];
            bytes.resize((level.size[0] * self.image.samples) as usize * size, 0);
            self.words.read(byte, &mut bytes);
            for (texel, bytes) in row.iter_mut().zip(bytes.chunks_exact(size)) {
                *texel = f(bytes);
            }
            self.close_row(row);
        });
        out
    }

    /// Texels of blocks of 4x4.
    fn blocks<T: Copy>(&self, zero: T, f: impl Fn(&[u8]) -> [T; 16]) -> Vec<T> {
        let mut out = vec![zero; self.places];
        let size = self.image.format.block_bytes() as usize;
        let mut bytes = Vec::new();
        self.rows(|level, place, byte| {
            let (width, stride) = (level.size[0] as usize, level.stride as usize);
            let in_slice = (place - level.offset as usize) % level.slice as usize;
            let rows = (level.size[1] as usize - in_slice / stride).min(4);
            bytes.resize(width.div_ceil(4) * size, 0);
            self.words.read(byte, &mut bytes);
            for (column, block) in bytes.chunks_exact(size).enumerate() {
                let texels = f(block);
                let columns = (width - 4 * column).min(4);
                for y in 0..rows {
                    let at = place + y * stride + 4 * column;
                    out[at..at + columns].copy_from_slice(&texels[4 * y..4 * y + columns]);
                }
            }
            for y in 0..rows {
                self.close_row(&mut out[place + y * stride..place + (y + 1) * stride]);
            }
        });
        out
    }

    /// The store of texels of four 8-bit channels.
    fn four_channels(&self, codes: Vec<u32>, srgb: bool) -> Texels {
        if srgb {
            return Texels::Srgb8 { linear: linear_light(&codes), codes };
        }
        let slice_of = |level: usize, slice: u32| {
            let level = &self.levels[level];
            &codes[(level.offset + slice * level.slice) as usize..][..level.slice as usize]
        };
        self.columns(slice_of, |code| *code)
    }

    /// The same of texels that are words: out of these at once, since what passes draw is read so in each frame.
    fn words_in_columns(&self, code: impl Fn(u32) -> u32 + Sync) -> Texels {
        let slice_of = |level: usize, slice: u32| {
            let first = self.image.offset(self.range.base_level + level as u32, self.layer(slice)) / 4;
            let [width, height, _] = self.levels[level].size;
            &self.words.words()[first as usize..][..(width * self.image.samples * height) as usize]
        };
        self.columns(slice_of, |word: &AtomicU32| code(word.load(Relaxed)))
    }

    /// Columns of the texels of each slice of a level, row by row, by what makes codes of them.
    fn columns<'t, T: Sync + 't>(&self, slice_of: impl Fn(usize, u32) -> &'t [T], code: impl Fn(&T) -> u32 + Sync) -> Texels {
        let count = self.levels.last().map_or(0, |l| l.columns[0] + l.columns[1] * l.size[2]);
        // One more than there are: who reads a place of the last reads eight words.
        let mut columns = vec![[0; 4]; count as usize + 1];
        let mut rest = &mut columns[..];
        let mut parts = Vec::new();
        for (index, level) in self.levels.iter().enumerate() {
            for slice in 0..level.size[2] {
                let texels = slice_of(index, slice);
                for first in (0..level.size[1]).step_by(PART_ROWS as usize) {
                    let groups = (level.size[1] - first).min(PART_ROWS).div_ceil(ROWS);
                    let (out, behind) = rest.split_at_mut((groups * level.stride) as usize);
                    rest = behind;
                    parts.push(Mutex::new(RowBlock { level, texels, first: first as usize, out }));
                }
            }
        }
        (self.each)(parts.len(), &|number| parts[number].lock().unwrap_or_else(PoisonError::into_inner).fill(&code));
        drop(parts);
        Texels::Unorm8(columns)
    }
}

/// Rows of a level whose columns are filled together: groups of [`ROWS`].
const PART_ROWS: u32 = 32 * ROWS;

/// Some rows of a slice of a level, and where their columns go.
struct RowBlock<'a, T> {
    level: &'a Level,
    /// Those of the slice.
    texels: &'a [T],
    /// The first row.
    first: usize,
    out: &'a mut [[u32; 4]],
}

impl<T> RowBlock<'_, T> {
    fn fill(&mut self, code: impl Fn(&T) -> u32) {
        let (height, stride) = (self.level.size[1] as usize, self.level.stride as usize);
        let width = self.texels.len() / height;
        for (group, out) in self.out.chunks_exact_mut(stride).enumerate() {
            let row = |r: usize| &self.texels[(self.first + group * ROWS as usize + r) % height * width..][..width];
            let rows = row(0).iter().zip(row(1)).zip(row(2)).zip(row(3));
            for (out, (((a, b), c), d)) in out.iter_mut().zip(rows) {
                *out = [a, b, c, d].map(&code);
            }
            // The first texel of a row once more, where it is not there and there is room for it.
            if let ([first, ..], Some(last)) = (&*out, width.lt(&stride).then_some(width)) {
                out[last] = *first;
            }
        }
    }
}

/// Four 8-bit channels with blue in the low byte as such with red there.
fn red_first(code: u32) -> u32 {
    code & 0xff00_ff00 | code >> 16 & 0xff | (code & 0xff) << 16
}

/// sRGB texels in linear light.
fn linear_light(codes: &[u32]) -> Vec<u64> {
    let table: [u64; 256] = std::array::from_fn(|code| (decode_srgb8(code as u8) * FIXED_ONE + 0.5) as u64);
    let one = |code: &u32| {
        let [r, g, b, a] = code.to_le_bytes();
        table[usize::from(r)] | table[usize::from(b)] << 16 | table[usize::from(g)] << 32 | u64::from(a) << (48 + 7)
    };
    codes.iter().map(one).collect()
}
