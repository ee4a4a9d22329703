//! Copies between buffers, textures and the trace's blobs, as bytes.

use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::{Aspect, TextureDimension};
use num::Words;
use trace::command::{LinearLayout, TextureEnd};

/// A copy that cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum CopyError {
    #[error("the depth of depth24plus-stencil8 cannot be copied alone: its layout is not defined")]
    Depth24Alone,
    #[error("level {level} of texture {texture}, which has {levels}")]
    Level { level: u32, texture: u32, levels: u32 },
    #[error("texels {origin:?} + {size:?} reach outside level {level} of texture {texture} ({} x {} x {})", all[0], all[1], all[2])]
    Outside { origin: [u32; 3], size: [u32; 3], level: u32, texture: u32, all: [u32; 3] },
    #[error("texel {origin:?} is not the first of a {dim}x{dim} block")]
    InsideBlock { origin: [u32; 3], dim: u32 },
    #[error("{pitch} bytes a row and {rows} rows an image are less than the {row} and {copied} copied")]
    Pitch { pitch: u64, rows: u64, row: u64, copied: u32 },
    #[error("the copy needs {} bytes from offset {offset}, there are {available}", .needed.map_or("too many".into(), |bytes| bytes.to_string()))]
    Short { needed: Option<u64>, offset: u64, available: u64 },
    #[error("{:?} blocks of {} bytes cannot be copied to {:?} blocks of {} bytes", from.0, from.1, to.0, to.1)]
    Shapes { from: ([u32; 3], u64), to: ([u32; 3], u64) },
}

/// The part of a stored texel that a copy moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Element {
    /// Bytes from one texel (or block) to the next in the texture.
    stride: u64,
    /// First byte in the texel.
    offset: u64,
    /// Bytes moved.
    bytes: u64,
}

impl Element {
    fn new(image: &ImageDesc, aspect: Aspect) -> Result<Element, CopyError> {
        let stride = image.texel_bytes();
        let whole = Element { stride, offset: 0, bytes: stride };
        Ok(match (image.format, aspect) {
            (Format::Depth24PlusStencil8, Aspect::StencilOnly) => Element { offset: 3, bytes: 1, ..whole },
            (Format::Depth32FloatStencil8, Aspect::StencilOnly) => Element { offset: 4, bytes: 1, ..whole },
            (Format::Depth32FloatStencil8, Aspect::DepthOnly) => Element { bytes: 4, ..whole },
            (Format::Depth24PlusStencil8, Aspect::DepthOnly) => {
                return Err(CopyError::Depth24Alone);
            }
            _ => whole,
        })
    }
}

/// A box of texels in one level of a texture, checked to be inside.
#[derive(Clone, Copy, Debug)]
pub struct Region {
    image: ImageDesc,
    level: u32,
    /// First column and row of blocks, first layer or slice.
    origin: [u32; 3],
    /// Columns and rows of blocks, layers or slices.
    size: [u32; 3],
    element: Element,
}

impl Region {
    /// Checks a box of `size` texels at one end of a copy.
    ///
    /// # Errors
    /// If it reaches outside the level, or does not start at a block.
    pub fn new(image: &ImageDesc, end: &TextureEnd, size: [u32; 3]) -> Result<Region, CopyError> {
        if end.level >= image.levels {
            return Err(CopyError::Level { level: end.level, texture: end.texture.0, levels: image.levels });
        }
        let dim = image.format.block_dim();
        let mut all = image.level_size(end.level);
        // A compressed level is copied in whole blocks, beyond its last texel where that is inside a block.
        all[0] = all[0].next_multiple_of(dim);
        all[1] = all[1].next_multiple_of(dim);
        for axis in 0..3 {
            let fits = end.origin[axis].checked_add(size[axis]).is_some_and(|stop| stop <= all[axis]);
            if !fits {
                let &TextureEnd { origin, level, texture, .. } = end;
                return Err(CopyError::Outside { origin, size, level, texture: texture.0, all });
            }
        }
        if !end.origin[0].is_multiple_of(dim) || !end.origin[1].is_multiple_of(dim) {
            return Err(CopyError::InsideBlock { origin: end.origin, dim });
        }
        Ok(Region {
            image: *image,
            level: end.level,
            origin: [end.origin[0] / dim, end.origin[1] / dim, end.origin[2]],
            size: [size[0].div_ceil(dim), size[1].div_ceil(dim), size[2]],
            element: Element::new(image, end.aspect)?,
        })
    }

    /// Layers or slices, as a range.
    pub fn layers(&self) -> std::ops::Range<u32> {
        self.origin[2]..self.origin[2] + self.size[2]
    }

    /// Bytes moved.
    pub fn bytes(&self) -> u64 {
        self.size.iter().map(|&n| u64::from(n)).product::<u64>() * self.element.bytes
    }

    /// Whether the box is a whole image (one layer or slice, all aspects).
    pub fn is_whole_image(&self) -> bool {
        let [columns, rows] = self.image.level_blocks(self.level);
        self.size == [columns, rows, 1] && self.element.bytes == self.element.stride
    }

    fn row_offset(&self, layer: u32, row: u32) -> u64 {
        self.image.offset(self.level, self.origin[2] + layer)
            + u64::from(self.origin[1] + row) * self.image.row_bytes(self.level)
            + u64::from(self.origin[0]) * self.element.stride
    }

    /// Resolves a linear layout for this box: (bytes per row, bytes per image), checked against `available` bytes.
    fn linear(&self, layout: &LinearLayout, available: u64) -> Result<(u64, u64), CopyError> {
        let row = u64::from(self.size[0]) * self.element.bytes;
        let pitch = layout.bytes_per_row.map_or(row, u64::from);
        let rows = layout.rows_per_image.map_or(u64::from(self.size[1]), u64::from);
        if pitch < row && self.size[1] > 1 || rows < u64::from(self.size[1]) && self.size[2] > 1 {
            return Err(CopyError::Pitch { pitch, rows, row, copied: self.size[1] });
        }
        if self.size.contains(&0) {
            return Ok((pitch, pitch * rows));
        }
        let end = (u64::from(self.size[2]) - 1)
            .checked_mul(pitch.saturating_mul(rows))
            .and_then(|n| n.checked_add((u64::from(self.size[1]) - 1).saturating_mul(pitch)))
            .and_then(|n| n.checked_add(row))
            .and_then(|n| n.checked_add(layout.offset));
        match end {
            Some(end) if end <= available => Ok((pitch, pitch * rows)),
            _ => Err(CopyError::Short { needed: end.map(|end| end - layout.offset), offset: layout.offset, available }),
        }
    }

    /// Writes the box from linear bytes.
    ///
    /// # Errors
    /// If the bytes do not reach.
    pub fn write_from(&self, words: &Words, source: &[u8], layout: &LinearLayout) -> Result<(), CopyError> {
        let (pitch, image_pitch) = self.linear(layout, source.len() as u64)?;
        let row_bytes = self.size[0] as usize * self.element.bytes as usize;
        for layer in 0..self.size[2] {
            for row in 0..self.size[1] {
                let from = (layout.offset + u64::from(layer) * image_pitch + u64::from(row) * pitch) as usize;
                self.write_row(words, layer, row, &source[from..from + row_bytes]);
            }
        }
        Ok(())
    }

    /// Writes the box from a buffer.
    ///
    /// # Errors
    /// If the buffer does not reach.
    pub fn write_from_buffer(&self, words: &Words, buffer: &Words, layout: &LinearLayout) -> Result<(), CopyError> {
        let (pitch, image_pitch) = self.linear(layout, buffer.len())?;
        let mut bytes = vec![0; self.size[0] as usize * self.element.bytes as usize];
        for layer in 0..self.size[2] {
            for row in 0..self.size[1] {
                buffer.read(layout.offset + u64::from(layer) * image_pitch + u64::from(row) * pitch, &mut bytes);
                self.write_row(words, layer, row, &bytes);
            }
        }
        Ok(())
    }

    /// Reads the box into a buffer.
    ///
    /// # Errors
    /// If the buffer does not reach.
    pub fn read_to_buffer(&self, words: &Words, buffer: &Words, layout: &LinearLayout) -> Result<(), CopyError> {
        let (pitch, image_pitch) = self.linear(layout, buffer.len())?;
        let mut bytes = vec![0; self.size[0] as usize * self.element.bytes as usize];
        for layer in 0..self.size[2] {
            for row in 0..self.size[1] {
                self.read_row(words, layer, row, &mut bytes);
                buffer.write(layout.offset + u64::from(layer) * image_pitch + u64::from(row) * pitch, &bytes);
            }
        }
        Ok(())
    }

    /// Copies this box to a box of the same shape in another texture (or this one).
    ///
    /// # Errors
    /// If the boxes or texels differ in size.
    pub fn copy_to(&self, words: &Words, to: &Region, to_words: &Words) -> Result<(), CopyError> {
        if self.size != to.size || self.element.bytes != to.element.bytes {
            let [from, to] = [self, to].map(|region| (region.size, region.element.bytes));
            return Err(CopyError::Shapes { from, to });
        }
        let row_bytes = self.size[0] as usize * self.element.bytes as usize;
        let mut image = vec![0; row_bytes * self.size[1] as usize];
        for layer in 0..self.size[2] {
            // A whole layer is read before it is written: source and destination may be one texture.
            for row in 0..self.size[1] {
                self.read_row(words, layer, row, &mut image[row as usize * row_bytes..][..row_bytes]);
            }
            for row in 0..self.size[1] {
                to.write_row(to_words, layer, row, &image[row as usize * row_bytes..][..row_bytes]);
            }
        }
        Ok(())
    }

    fn write_row(&self, words: &Words, layer: u32, row: u32, bytes: &[u8]) {
        let at = self.row_offset(layer, row);
        if self.element.bytes == self.element.stride {
            words.write(at, bytes);
        } else {
            for (column, element) in bytes.chunks_exact(self.element.bytes as usize).enumerate() {
                words.write(at + column as u64 * self.element.stride + self.element.offset, element);
            }
        }
    }

    fn read_row(&self, words: &Words, layer: u32, row: u32, bytes: &mut [u8]) {
        let at = self.row_offset(layer, row);
        if self.element.bytes == self.element.stride {
            words.read(at, bytes);
        } else {
            for (column, element) in bytes.chunks_exact_mut(self.element.bytes as usize).enumerate() {
                words.read(at + column as u64 * self.element.stride + self.element.offset, element);
            }
        }
    }
}

/// Sets an aspect of one image to zero.
pub fn clear_image(image: &ImageDesc, words: &Words, level: u32, layer: u32, aspect: Aspect) {
    let keep_depth = aspect == Aspect::StencilOnly;
    let keep_stencil = aspect == Aspect::DepthOnly;
    let at = image.offset(level, layer);
    let bytes = image.layer_bytes(level);
    match image.format {
        Format::Depth24PlusStencil8 if keep_depth || keep_stencil => {
            let keep = if keep_depth { 0x00ff_ffff } else { 0xff00_0000 };
            for word in at / 4..(at + bytes) / 4 {
                words.store(word as usize, words.load(word as usize) & keep);
            }
        }
        Format::Depth32FloatStencil8 if keep_depth || keep_stencil => {
            let first = at / 4 + u64::from(keep_depth);
            for word in (first..(at + bytes) / 4).step_by(2) {
                words.store(word as usize, 0);
            }
        }
        _ => {
            let zeros = vec![0; image.row_bytes(level) as usize];
            for row in 0..u64::from(image.level_blocks(level)[1]) {
                words.write(at + row * image.row_bytes(level), &zeros);
            }
        }
    }
}

/// Layers or slices of a level that a range of array layers names: all slices of a 3D texture.
pub fn layers_of(image: &ImageDesc, level: u32, base: u32, count: u32) -> std::ops::Range<u32> {
    match image.dimension {
        TextureDimension::D3 => 0..image.level_size(level)[2],
        _ => base..base + count,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use num::TextureId;

    fn image(format: Format) -> ImageDesc {
        ImageDesc { dimension: TextureDimension::D2, size: [5, 4, 2], levels: 1, samples: 1, format }
    }

    fn end(origin: [u32; 3], aspect: Aspect) -> TextureEnd {
        TextureEnd { texture: TextureId(3), level: 0, origin, aspect }
    }

    #[test]
    fn padded_rows_go_in_and_come_out() {
        let image = image(Format::Rgba8Unorm);
        let words = Words::new(image.bytes());
        let region = Region::new(&image, &end([1, 1, 1], Aspect::All), [3, 2, 1]).unwrap();
        let source: Vec<u8> = (0..64).collect();
        let layout = LinearLayout { offset: 4, bytes_per_row: Some(32), rows_per_image: None };
        region.write_from(&words, &source, &layout).unwrap();
        let out = Words::new(64);
        region.read_to_buffer(&words, &out, &layout).unwrap();
        let mut back = vec![0; 64];
        out.read(0, &mut back);
        assert_eq!(back[4..16], source[4..16]);
        assert_eq!(back[36..48], source[36..48]);
        assert_eq!(back[16..36], [0; 20]);
        assert_eq!(words.byte((image.offset(0, 1) + 20 + 4) as usize), 4, "texel (1, 1) of layer 1");
    }

    #[test]
    fn what_does_not_fit_is_refused_with_numbers() {
        let image = image(Format::Rgba8Unorm);
        let reason = Region::new(&image, &end([3, 0, 0], Aspect::All), [3, 1, 1]).unwrap_err().to_string();
        assert!(reason.contains("outside level 0 of texture 3"), "{reason}");
        let region = Region::new(&image, &end([0, 0, 0], Aspect::All), [5, 4, 2]).unwrap();
        let layout = LinearLayout { offset: 0, bytes_per_row: Some(256), rows_per_image: Some(4) };
        let reason = region.write_from(&Words::new(image.bytes()), &[0; 100], &layout).unwrap_err().to_string();
        assert!(reason.contains("there are 100"), "{reason}");
    }

    #[test]
    fn aspects_are_copied_and_cleared_alone() {
        for format in [Format::Depth24PlusStencil8, Format::Depth32FloatStencil8] {
            let image = image(format);
            let words = Words::new(image.bytes());
            words.write(0, &vec![0xff; image.bytes() as usize]);
            let stencil = Region::new(&image, &end([0, 0, 0], Aspect::StencilOnly), [5, 4, 1]).unwrap();
            let values: Vec<u8> = (0..20).collect();
            stencil
                .write_from(&words, &values, &LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None })
                .unwrap();
            let stride = format.block_bytes() as usize;
            let at = if format == Format::Depth24PlusStencil8 { 3 } else { 4 };
            assert_eq!(words.byte(7 * stride + at), 7);
            assert_eq!(words.byte(7 * stride), 0xff);
            clear_image(&image, &words, 0, 0, Aspect::DepthOnly);
            assert_eq!(words.byte(7 * stride + at), 7);
            assert_eq!(words.byte(7 * stride), 0);
            assert_eq!(words.byte(image.offset(0, 1) as usize), 0xff, "the other layer keeps its bytes");
            clear_image(&image, &words, 0, 0, Aspect::StencilOnly);
            assert_eq!(words.byte(7 * stride + at), 0);
        }
    }
}
