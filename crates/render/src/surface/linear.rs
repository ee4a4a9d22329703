//! Surfaces out of linear images and into them.

use std::sync::atomic::Ordering::Relaxed;

use num::Words;
use work::{BLOCK, TILE};

use super::{ALL, Shape, TileSurface, quad_of};
use crate::parallel;

impl TileSurface {
    /// Takes the texels from a linear image that starts at byte `offset`.
    ///
    /// # Panics
    /// If the image does not lie in `from`.
    pub fn load(&mut self, from: &Words, offset: u64) {
        let shape = self.shape;
        let across = shape.tiles()[0] as usize;
        parallel::each(self.tiles_mut(ALL), parallel::ANY, |index, tile| {
            (*tile.clear, *tile.changed) = (false, false);
            let geometry = TileGeometry::new(shape, index, across);
            geometry.rows(|row| load_row(shape, &geometry, row, tile.codes, from, offset));
        });
    }

    /// Writes the texels as a linear image that starts at byte `offset`. It is the image to which the surface was last stored, or from which it
    /// was loaded, if there was one: tiles that have not changed since then are there.
    ///
    /// # Panics
    /// If the image does not lie in `to`.
    pub fn store(&mut self, to: &Words, offset: u64) {
        self.write(to, offset, |tile| self.changed[tile]);
        self.changed.fill(false);
    }

    /// Writes some tiles as a linear image has them.
    fn write(&self, to: &Words, offset: u64, wanted: impl Fn(usize) -> bool + Sync) {
        let shape = self.shape;
        let across = shape.tiles()[0] as usize;
        // A word of the image is written by one tile only: tiles are 64 texels wide, and with rows that are no multiple of four
        // bytes, whole rows go to one thread.
        let aligned = offset.is_multiple_of(4) && (shape.bytes() / u64::from(shape.height)).is_multiple_of(4);
        let rows_of_tiles = shape.tiles()[1] as usize;
        let one_row = |ty: usize| {
            for tx in 0..across {
                let index = ty * across + tx;
                if !wanted(index) {
                    continue;
                }
                let geometry = TileGeometry::new(shape, index, across);
                geometry.rows(|row| store_row(shape, &geometry, row, self.tile(index), self.value, to, offset));
            }
        };
        if aligned {
            parallel::each_number(rows_of_tiles, parallel::ANY, &one_row);
        } else {
            (0..rows_of_tiles).for_each(one_row);
        }
    }

    /// The texels as a linear image: rows top to bottom, pixels left to right, samples in order, tightly packed.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = vec![0; self.shape.bytes() as usize];
        self.read(&mut out);
        out
    }

    /// Copies the texels out as a linear image, as [`TileSurface::to_bytes`] gives it.
    ///
    /// # Panics
    /// If there are fewer bytes than the image has.
    pub fn read(&self, out: &mut [u8]) {
        let shape = self.shape;
        if !shape.is_plain() {
            let words = Words::new(shape.bytes());
            self.write(&words, 0, |_| true);
            return words.read(0, &mut out[..shape.bytes() as usize]);
        }
        let across = shape.tiles()[0] as usize;
        let row = 4 * shape.width as usize;
        let rows_of_tiles = out[..shape.bytes() as usize].chunks_mut(row * TILE as usize);
        parallel::each(rows_of_tiles, parallel::ANY, |ty, out| {
            for (y, out) in out.chunks_exact_mut(row).enumerate() {
                for (tx, out) in out.chunks_mut(4 * TILE as usize).enumerate() {
                    let (pixels, _) = out.as_chunks_mut::<4>();
                    match self.tile(ty * across + tx) {
                        None => pixels.fill(self.value[0].to_le_bytes()),
                        Some(codes) => copy_row(codes, y as u32, pixels, u32::to_le_bytes),
                    }
                }
            }
        });
    }
}

/// The part of a tile that lies in the surface.
struct TileGeometry {
    x: u32,
    y: u32,
    width: u32,
    height: u32,
}

impl TileGeometry {
    fn new(shape: Shape, index: usize, across: usize) -> TileGeometry {
        let (x, y) = ((index % across) as u32 * TILE, (index / across) as u32 * TILE);
        TileGeometry { x, y, width: TILE.min(shape.width - x), height: TILE.min(shape.height - y) }
    }

    fn rows(&self, row: impl FnMut(u32)) {
        (0..self.height).for_each(row);
    }
}

/// Byte address of a texel row of a tile in the linear image.
fn row_offset(shape: Shape, geometry: &TileGeometry, row: u32, offset: u64) -> usize {
    let texel = u64::from(shape.format.block_bytes()) * u64::from(shape.samples);
    (offset + (u64::from(geometry.y + row) * u64::from(shape.width) + u64::from(geometry.x)) * texel) as usize
}

fn load_row(shape: Shape, geometry: &TileGeometry, row: u32, codes: &mut [u32], from: &Words, offset: u64) {
    let mut at = row_offset(shape, geometry, row, offset);
    let (words, samples) = (shape.words(), shape.samples as usize);
    if shape.is_plain() && at.is_multiple_of(4) {
        let source = &from.words()[at / 4..at / 4 + geometry.width as usize];
        let (blocks, rest) = source.as_chunks::<8>();
        for (block, texels) in blocks.iter().enumerate() {
            let quads = &mut codes[texel_at(BLOCK * block as u32, row)..][..14];
            for (k, texel) in texels.iter().enumerate() {
                quads[in_row(k)] = texel.load(Relaxed);
            }
        }
        for (k, texel) in rest.iter().enumerate() {
            codes[texel_at(BLOCK * blocks.len() as u32, row) + in_row(k)] = texel.load(Relaxed);
        }
        return;
    }
    for x in 0..geometry.width {
        let quad = quad_of(x, row) as usize;
        let pixel = (row % 2 * 2 + x % 2) as usize;
        for sample in 0..samples {
            let base = (quad * samples + sample) * words * 4 + pixel;
            match shape.format.block_bytes() {
                1 => codes[base] = u32::from(from.byte(at)),
                2 => codes[base] = u32::from(from.u16_at(at)),
                _ => {
                    for w in 0..words {
                        codes[base + 4 * w] = from.u32_at(at + 4 * w);
                    }
                }
            }
            at += shape.format.block_bytes() as usize;
        }
    }
}

/// Copies the start of a row of a tile of one word and one sample, a block's eight texels at a time.
fn copy_row<T>(codes: &[u32], y: u32, out: &mut [T], texel: impl Fn(u32) -> T) {
    let (blocks, rest) = out.as_chunks_mut::<8>();
    for (block, texels) in blocks.iter_mut().enumerate() {
        let quads = &codes[texel_at(BLOCK * block as u32, y)..][..14];
        *texels = std::array::from_fn(|k| texel(quads[in_row(k)]));
    }
    let whole = blocks.len();
    for (k, out) in rest.iter_mut().enumerate() {
        *out = texel(codes[texel_at(BLOCK * whole as u32, y) + in_row(k)]);
    }
}

/// The position of texel `k` of a block's row behind the first texel, in a tile of one word and one sample. Each quad has two of them.
#[inline(always)]
fn in_row(k: usize) -> usize {
    4 * (k / 2) + k % 2
}

/// Index of a pixel's code in a tile of one word and one sample.
#[inline(always)]
fn texel_at(x: u32, y: u32) -> usize {
    (quad_of(x, y) * 4 + y % 2 * 2 + x % 2) as usize
}

fn store_row(shape: Shape, geometry: &TileGeometry, row: u32, codes: Option<&[u32]>, value: [u32; 4], to: &Words, offset: u64) {
    let mut at = row_offset(shape, geometry, row, offset);
    let (words, samples) = (shape.words(), shape.samples as usize);
    if shape.is_plain() && at.is_multiple_of(4) {
        let target = &to.words()[at / 4..at / 4 + geometry.width as usize];
        let mut texels = [value[0]; TILE as usize];
        let texels = &mut texels[..target.len()];
        if let Some(codes) = codes {
            copy_row(codes, row, texels, |code| code);
        }
        target.iter().zip(texels).for_each(|(word, texel)| word.store(*texel, Relaxed));
        return;
    }
    for x in 0..geometry.width {
        let quad = quad_of(x, row) as usize;
        let pixel = (row % 2 * 2 + x % 2) as usize;
        for sample in 0..samples {
            let base = (quad * samples + sample) * words * 4 + pixel;
            let word = |w: usize| codes.map_or(value[w], |c| c[base + 4 * w]);
            let size = shape.format.block_bytes() as usize;
            if size >= 4 && at.is_multiple_of(4) {
                (0..words).for_each(|w| to.store(at / 4 + w, word(w)));
            } else {
                let stored: [u32; 4] = std::array::from_fn(|w| if w < words { word(w).to_le() } else { 0 });
                to.write(at as u64, &bytemuck::bytes_of(&stored)[..size]);
            }
            at += size;
        }
    }
}
