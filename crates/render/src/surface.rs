//! Working storage of an attachment: tiles of 64x64 pixels, each contiguous, so that tiles are handed to threads as disjoint slices.
//!
//! Inside a tile the order is the one in which draws touch it: 64 blocks of 8x8 pixels row by row, in a block 16 quads row by row,
//! in a quad sample after sample, in a sample word after word, and last the four pixels. The codes of a quad are therefore one
//! run of memory in the order of coverage bits (`4 sample + pixel`), and those of a block with one sample are a batch of 64 lanes.
//! A texel of up to four bytes takes one word here, whatever its size in memory.

mod linear;

use crate::parallel;
use gfx::format::Format;
use gfx::rop;
use work::{BLOCK, TILE};

/// Blocks in a tile.
pub const TILE_BLOCKS: usize = ((TILE / BLOCK) * (TILE / BLOCK)) as usize;

/// Quads in a tile.
pub const TILE_QUADS: usize = ((TILE / 2) * (TILE / 2)) as usize;

/// Number of the quad that holds a pixel of a tile (`x`, `y` below 64), counted in storage order.
#[inline(always)]
pub fn quad_of(x: u32, y: u32) -> u32 {
    let block = (y / BLOCK) * (TILE / BLOCK) + x / BLOCK;
    block * 16 + (y % BLOCK / 2) * 4 + x % BLOCK / 2
}

/// Shape of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Format of the stored texels.
    pub format: Format,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples per pixel: 1 or 4.
    pub samples: u32,
}

impl Shape {
    /// Tiles across and down.
    pub fn tiles(&self) -> [u32; 2] {
        [self.width.div_ceil(TILE), self.height.div_ceil(TILE)]
    }

    /// Words of working storage a sample: 1, 2 or 4.
    pub fn words(&self) -> usize {
        (self.format.block_bytes() as usize).div_ceil(4)
    }

    /// Words of working storage a tile.
    pub fn tile_words(&self) -> usize {
        (TILE * TILE) as usize * self.samples as usize * self.words()
    }

    /// Bytes of working storage.
    pub fn tiled_bytes(&self) -> u64 {
        let [across, down] = self.tiles().map(u64::from);
        4 * across * down * self.tile_words() as u64
    }

    /// Whether a pixel is one whole word.
    fn is_plain(&self) -> bool {
        self.samples == 1 && self.format.block_bytes() == 4
    }

    /// Bytes of the linear image.
    pub fn bytes(&self) -> u64 {
        u64::from(self.width) * u64::from(self.height) * u64::from(self.samples) * u64::from(self.format.block_bytes())
    }
}

/// One tile, to draw into.
pub struct TileMut<'a> {
    /// Its codes.
    pub codes: &'a mut [u32],
    /// Whether it still holds nothing but the clear value, not yet written to `codes`.
    pub clear: &'a mut bool,
    /// Whether its texels may differ from those of the linear image ([`TileSurface::store`]).
    pub changed: &'a mut bool,
    /// The clear value.
    pub value: [u32; 4],
}

impl TileMut<'_> {
    /// Before it is drawn into: writes the clear value if that is still to be done.
    #[inline(always)]
    pub fn materialise(&mut self, words: usize) {
        *self.changed = true;
        if *self.clear {
            fill(self.codes, words, self.value);
            *self.clear = false;
        }
    }
}

fn fill(codes: &mut [u32], words: usize, value: [u32; 4]) {
    match words {
        1 => codes.fill(value[0]),
        _ => {
            for texels in codes.chunks_exact_mut(4 * words) {
                for (w, run) in texels.chunks_exact_mut(4).enumerate() {
                    run.fill(value[w]);
                }
            }
        }
    }
}

/// All bits of a texel.
pub const ALL: [u32; 4] = [u32::MAX; 4];

/// An attachment's working storage.
#[derive(Clone, Debug)]
pub struct TileSurface {
    shape: Shape,
    codes: Vec<u32>,
    clear: Vec<bool>,
    /// Tiles that may differ from the linear image to which the surface was last stored, or from which it was loaded.
    changed: Vec<bool>,
    value: [u32; 4],
    /// Bits that every texel has as `value` has them. OpenGL programs that have a stencil buffer and leave it alone clear depths beside it
    /// every frame: what is known of it spares the pass over memory.
    known: [u32; 4],
}

impl TileSurface {
    /// Storage of all zeros (kept as a clear, so that this costs no pass over the memory).
    pub fn new(shape: Shape) -> TileSurface {
        let [tx, ty] = shape.tiles();
        let tiles = (tx * ty) as usize;
        let mut surface = TileSurface {
            shape,
            codes: vec![0; tiles * shape.tile_words()],
            clear: vec![true; tiles],
            changed: vec![true; tiles],
            value: [0; 4],
            known: ALL,
        };
        surface.clear([0; 4]);
        surface
    }

    /// Its shape.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// Sets every texel to a stored texel's words (its bytes, little-endian).
    pub fn clear(&mut self, value: [u32; 4]) {
        self.value = value;
        self.known = ALL;
        self.clear.fill(true);
        self.changed.fill(true);
    }

    /// Sets the bits of every texel that `mask` selects (an aspect: see [`texel::aspect_masks`](gfx::texel::aspect_masks)) and keeps the others.
    pub fn clear_masked(&mut self, value: [u32; 4], mask: [u32; 4]) {
        let merge = |old: u32, w: usize| old & !mask[w] | value[w] & mask[w];
        let words = self.shape.words();
        let merged: [u32; 4] = std::array::from_fn(|w| merge(self.value[w], w));
        let knows = |bits: fn(u32) -> u32| (0..words).all(|w| bits(mask[w]) & !self.known[w] == 0);
        if knows(|mask| mask) && merged == self.value {
            return;
        }
        if knows(|mask| !mask) {
            self.clear(merged);
            return;
        }
        parallel::each(self.tiles_mut(mask), parallel::ANY, |_, mut tile| {
            tile.materialise(words);
            if words == 1 {
                // Depth of 24 bits beside stencil, above all: one run of memory.
                let (keep, put) = (!mask[0], value[0] & mask[0]);
                tile.codes.iter_mut().for_each(|code| *code = *code & keep | put);
                return;
            }
            for texels in tile.codes.chunks_exact_mut(4 * words) {
                for (w, run) in texels.chunks_exact_mut(4).enumerate() {
                    for code in run {
                        *code = merge(*code, w);
                    }
                }
            }
        });
        self.value = merged;
        for w in 0..words {
            self.known[w] |= mask[w];
        }
    }

    /// All tiles in row-major order, to hand to threads. `written` are the bits of texels that may be written.
    pub fn tiles_mut(&mut self, written: [u32; 4]) -> impl Iterator<Item = TileMut<'_>> {
        let value = self.value;
        self.forget(written);
        let tiles = self.codes.chunks_exact_mut(self.shape.tile_words()).zip(&mut self.clear).zip(&mut self.changed);
        tiles.map(move |((codes, clear), changed)| TileMut { codes, clear, changed, value })
    }

    /// One tile, to draw into. `written` are the bits of texels that may be written.
    pub fn tile_mut(&mut self, index: usize, written: [u32; 4]) -> TileMut<'_> {
        self.forget(written);
        let n = self.shape.tile_words();
        TileMut {
            codes: &mut self.codes[index * n..(index + 1) * n],
            clear: &mut self.clear[index],
            changed: &mut self.changed[index],
            value: self.value,
        }
    }

    fn forget(&mut self, written: [u32; 4]) {
        for (known, written) in self.known.iter_mut().zip(written) {
            *known &= !written;
        }
    }

    /// The words of one texel: pixel, sample.
    ///
    /// # Panics
    /// If the pixel is outside.
    pub fn texel(&self, x: u32, y: u32, sample: u32) -> [u32; 4] {
        assert!(x < self.shape.width && y < self.shape.height && sample < self.shape.samples);
        let index = (y / TILE * self.shape.tiles()[0] + x / TILE) as usize;
        let Some(codes) = self.tile(index) else { return self.value };
        let words = self.shape.words();
        let quad = quad_of(x % TILE, y % TILE) as usize;
        let at = (quad * self.shape.samples as usize + sample as usize) * words * 4 + (y % 2 * 2 + x % 2) as usize;
        std::array::from_fn(|w| if w < words { codes[at + 4 * w] } else { 0 })
    }

    /// One sample per pixel: the mean of the samples of each, of values in `format` (which may differ in sRGB-ness from the
    /// surface's own).
    pub fn resolve(&self, format: Format) -> TileSurface {
        let mut out = TileSurface::new(Shape { samples: 1, ..self.shape });
        let (words, samples) = (self.shape.words(), self.shape.samples as usize);
        out.clear(self.value);
        parallel::each(out.tiles_mut(ALL), parallel::ANY, |index, tile| {
            let Some(codes) = self.tile(index) else { return };
            *tile.clear = false;
            let mut gathered = [0; 16];
            let mut mean = [0; 4];
            for quad in 0..TILE_QUADS {
                for pixel in 0..4 {
                    for sample in 0..samples {
                        for w in 0..words {
                            gathered[sample * words + w] = codes[((quad * samples + sample) * words + w) * 4 + pixel];
                        }
                    }
                    rop::resolve(format, &gathered[..samples * words], &mut mean[..words]);
                    for w in 0..words {
                        tile.codes[(quad * words + w) * 4 + pixel] = mean[w];
                    }
                }
            }
        });
        out
    }

    /// A tile's codes, or none where it holds only the clear value.
    pub fn tile(&self, index: usize) -> Option<&[u32]> {
        let n = self.shape.tile_words();
        (!self.clear[index]).then(|| &self.codes[index * n..(index + 1) * n])
    }

    /// The clear value's words.
    pub fn clear_value(&self) -> [u32; 4] {
        self.value
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use gfx::texel::aspect_masks;
    use num::Words;

    fn pattern(shape: Shape, offset: u64) -> (Words, Vec<u8>) {
        let mut bytes = vec![0; (offset + shape.bytes()) as usize];
        for (i, byte) in bytes.iter_mut().enumerate() {
            *byte = (i * 7 + i / 251) as u8;
        }
        let words = Words::new(bytes.len() as u64);
        words.write(0, &bytes);
        (words, bytes)
    }

    #[test]
    fn every_size_of_texel_goes_in_and_comes_out_unchanged() {
        for format in [
            Format::R8Unorm,
            Format::Rg8Unorm,
            Format::Rgba8Unorm,
            Format::Rgba16Float,
            Format::Rgba32Uint,
            Format::Stencil8,
            Format::Depth16Unorm,
            Format::Depth24PlusStencil8,
            Format::Depth32FloatStencil8,
        ] {
            for samples in [1, 4] {
                for (width, height) in [(1, 1), (67, 5), (64, 64), (130, 70)] {
                    let shape = Shape { format, width, height, samples };
                    let (words, bytes) = pattern(shape, 16);
                    let mut surface = TileSurface::new(shape);
                    surface.load(&words, 16);
                    assert_eq!(surface.to_bytes(), bytes[16..], "{shape:?}");
                    let back = Words::new(bytes.len() as u64);
                    surface.tiles_mut(ALL).for_each(|mut tile| tile.materialise(shape.words()));
                    surface.store(&back, 16);
                    assert_eq!(back.to_vec()[16..], bytes[16..], "{shape:?}");
                }
            }
        }
    }

    #[test]
    fn only_tiles_that_have_changed_are_stored_again() {
        let shape = Shape { format: Format::Rgba8Unorm, width: 200, height: 130, samples: 1 };
        let (words, _) = pattern(shape, 0);
        let mut surface = TileSurface::new(shape);
        surface.load(&words, 0);
        let stored = |surface: &mut TileSurface| {
            // Zeros stay where a tile is not stored.
            let words = Words::new(shape.bytes());
            surface.store(&words, 0);
            let at = |tile: u32| words.load((tile / 4 * 64 * 200 + tile % 4 * 64) as usize) != 0;
            (0..12).filter(|&tile| at(tile)).collect::<Vec<_>>()
        };
        assert_eq!(stored(&mut surface), Vec::<u32>::new());
        let mut tile = surface.tile_mut(6, ALL);
        tile.materialise(1);
        tile.codes[0] = 77;
        assert_eq!(stored(&mut surface), [6]);
        assert_eq!(stored(&mut surface), Vec::<u32>::new());
        surface.clear_masked([7; 4], [0xff; 4]);
        assert_eq!(stored(&mut surface), Vec::from_iter(0..12));
        surface.clear([5; 4]);
        assert_eq!(stored(&mut surface), Vec::from_iter(0..12));
        // A new one was never stored.
        let mut fresh = TileSurface::new(shape);
        fresh.tile_mut(0, ALL).materialise(1);
        fresh.store(&words, 0);
        assert_eq!(words.to_vec(), vec![0; shape.bytes() as usize]);
    }

    #[test]
    fn texels_are_found_where_the_linear_image_has_them() {
        let shape = Shape { format: Format::R32Uint, width: 100, height: 80, samples: 4 };
        let words = Words::new(shape.bytes());
        for i in 0..shape.bytes() / 4 {
            words.store(i as usize, i as u32);
        }
        let mut surface = TileSurface::new(shape);
        surface.load(&words, 0);
        for (x, y, s) in [(0, 0, 0), (1, 0, 3), (63, 64, 1), (99, 79, 2)] {
            assert_eq!(surface.texel(x, y, s)[0], (y * 100 + x) * 4 + s);
        }
    }

    #[test]
    fn clears_are_lazy_and_masks_keep_the_other_aspect() {
        let shape = Shape { format: Format::Depth24PlusStencil8, width: 65, height: 3, samples: 1 };
        let mut surface = TileSurface::new(shape);
        surface.clear([0x07ff_ffff, 0, 0, 0]);
        surface.clear_masked([0x0900_0000, 0, 0, 0], [0xff00_0000, 0, 0, 0]);
        assert_eq!(surface.texel(64, 2, 0)[0], 0x09ff_ffff);
        assert!(surface.tile(0).is_none(), "no memory has been touched");
        surface.tiles_mut(ALL).next().unwrap().materialise(1);
        surface.clear_masked([5, 0, 0, 0], [0x00ff_ffff, 0, 0, 0]);
        assert_eq!(surface.texel(0, 0, 0)[0], 0x0900_0005);
        assert_eq!(surface.texel(64, 2, 0)[0], 0x0900_0005);
    }

    #[test]
    fn depths_are_cleared_beside_a_stencil_that_nobody_wrote_without_a_pass_over_memory() {
        let shape = Shape { format: Format::Depth24PlusStencil8, width: 65, height: 3, samples: 1 };
        let (depth, stencil) = aspect_masks(shape.format);
        let mut surface = TileSurface::new(shape);
        surface.clear([0x0700_0001, 0, 0, 0]);
        surface.tile_mut(0, depth).materialise(1);
        surface.tile_mut(0, depth).codes[0] = 0x0700_0005;
        surface.clear_masked([9, 0, 0, 0], depth);
        assert!(surface.tile(0).is_none());
        assert_eq!(surface.texel(0, 0, 0)[0], 0x0700_0009);
        surface.tile_mut(0, stencil).materialise(1);
        surface.clear_masked([4, 0, 0, 0], depth);
        assert!(surface.tile(0).is_some());
    }

    #[test]
    fn clears_and_draws_in_any_order_leave_what_they_leave_in_a_plain_image() {
        for format in [Format::Depth24PlusStencil8, Format::Depth32FloatStencil8] {
            let shape = Shape { format, width: 70, height: 2, samples: 1 };
            let (depth, stencil) = aspect_masks(format);
            let both: [u32; 4] = std::array::from_fn(|w| depth[w] | stencil[w]);
            let words = shape.words();
            let mut random = num::Random::new(3);
            let mut surface = TileSurface::new(shape);
            let mut plain = vec![[0_u32; 4]; 140];
            for step in 0..2000 {
                let bits = random.bits();
                let mask = [depth, stencil, both][(bits >> 8) as usize % 3];
                // Few values, so that some are there already.
                let value: [u32; 4] = std::array::from_fn(|w| (0x0101_0101 * (bits >> (2 * w + 16) & 3)) & both[w]);
                let set = |texel: &mut [u32; 4]| (0..4).for_each(|w| texel[w] = texel[w] & !mask[w] | value[w] & mask[w]);
                match bits & 3 {
                    0 if bits >> 2 & 3 == 0 => {
                        surface.clear(value);
                        plain.fill(value);
                    }
                    0 | 1 => {
                        surface.clear_masked(value, mask);
                        plain.iter_mut().for_each(set);
                    }
                    _ => {
                        let x = bits >> 24 & 63;
                        let mut tile = surface.tile_mut(0, mask);
                        tile.materialise(words);
                        let mut texel = plain[x as usize];
                        set(&mut texel);
                        for w in 0..words {
                            tile.codes[(quad_of(x, 0) as usize * words + w) * 4 + x as usize % 2] = texel[w];
                        }
                        plain[x as usize] = texel;
                    }
                }
                for (i, want) in plain.iter().enumerate() {
                    assert_eq!(surface.texel(i as u32 % 70, i as u32 / 70, 0)[..words], want[..words], "{format:?} {step} {i}");
                }
            }
        }
    }

    #[test]
    fn quads_are_numbered_block_by_block() {
        for quad in 0..TILE_QUADS as u32 {
            let (block, in_block) = (quad / 16, quad % 16);
            let (x, y) = (block % 8 * 8 + in_block % 4 * 2, block / 8 * 8 + in_block / 4 * 2);
            assert_eq!(quad_of(x, y), quad);
            assert_eq!(quad_of(x + 1, y + 1), quad);
        }
        assert_eq!(quad_of(8, 0), 16);
    }
}
