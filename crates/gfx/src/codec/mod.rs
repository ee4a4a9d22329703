//! Compression of 8x8-pixel blocks of depth and colour: what a block takes when it leaves a ROP's cache.
//!
//! A block's codes are split into *planes* of one number per sample: depth (and stencil beside it), or the bytes of a colour. Each
//! plane is stored in the smallest of four forms: one value; a flat plane through three corners and what is left over (depth of
//! one triangle: Morein 2000, and the plane compression of later cards); each value from its neighbours (the median predictor
//! of JPEG-LS) with a width for each row; raw. Where all samples of every pixel agree only the first is stored. A block that
//! would not save a line is stored raw; which form it has is a tag beside the block, not in it.
//!
//! [`stored_bytes`] is what the timing model asks for. [`encode`] and [`decode`] do what it counts, so that the count is honest.

mod bits;
mod plane;
mod references;
mod size;

#[cfg(test)]
mod tests;

use super::format::Format;
use bits::{Reader, Sink, Writer};
use plane::{Layout, read_plane, write_plane};

/// Pixels of a block.
const PIXELS: usize = 64;

/// Bytes of a memory line: compressed blocks take whole lines.
const LINE: u32 = 64;

/// Bytes of a block that is not compressed.
pub fn raw_bytes(format: Format, samples: usize) -> u32 {
    PIXELS as u32 * samples as u32 * format.block_bytes()
}

/// Bytes that a block takes in memory: whole lines, at most its raw size.
///
/// `codes` is a block as tiles hold it: quads row by row, in a quad sample after sample, in a sample word after word, in a word
/// the four pixels.
///
/// # Panics
/// If the number of codes is not that of a block.
pub fn stored_bytes(format: Format, samples: usize, codes: &[u32]) -> u32 {
    let lines = size::bits(format, samples, codes).div_ceil(8 * u64::from(LINE)).max(1);
    (lines as u32 * LINE).min(raw_bytes(format, samples))
}

/// As [`stored_bytes`], by two references of 32 bits: one, two or three lines, but at most `most` bytes, or the raw size. Codes of more than a word and of several samples
/// are stored raw.
pub fn stored_bytes_by_references(format: Format, samples: usize, codes: &[u32], most: u32) -> u32 {
    let raw = raw_bytes(format, samples);
    if format.block_bytes() != 4 {
        return raw;
    }
    references::bytes(codes, most).map_or(raw, |bytes| bytes.min(raw))
}

/// Codecs of which [`lines`] tells.
pub const CODECS: usize = 3;

/// Memory lines of 64 bytes that a block takes by each codec: that of [`stored_bytes`]; of [`stored_bytes_by_references`]; and of the same
/// with at most half of the raw size. The arguments are those of [`stored_bytes`].
///
/// # Panics
/// If the number of codes is not that of a block.
pub fn lines(format: Format, samples: usize, codes: &[u32]) -> [u8; CODECS] {
    let raw = raw_bytes(format, samples);
    let by_references = |most| stored_bytes_by_references(format, samples, codes, most);
    // A block of 8 samples of 16 bytes has 128 lines.
    [stored_bytes(format, samples, codes), by_references(raw), by_references(raw / 2)].map(|bytes| bytes.div_ceil(LINE) as u8)
}

/// Compresses a block; the arguments are those of [`stored_bytes`]. Not more than one byte longer than the raw block.
///
/// # Panics
/// If the number of codes is not that of a block.
pub fn encode(format: Format, samples: usize, codes: &[u32]) -> Vec<u8> {
    let mut writer = Writer::default();
    writer.put(1, 8);
    write(format, samples, codes, &mut writer);
    let bytes = writer.finish();
    if bytes.len() <= raw_bytes(format, samples) as usize {
        return bytes;
    }
    let mut writer = Writer::default();
    writer.put(0, 8);
    let layout = Layout::new(samples, false);
    for plane in planes(format).0 {
        for i in 0..layout.count() {
            writer.put(plane.get(codes, layout.index(i, plane.words)), plane.bits);
        }
    }
    writer.finish()
}

/// Restores a block from what [`encode`] gave; none if the bytes are not that.
pub fn decode(format: Format, samples: usize, bytes: &[u8]) -> Option<Vec<u32>> {
    let mut reader = Reader::new(bytes);
    let (planes, words) = planes(format);
    let mut codes = vec![0; PIXELS * samples * words];
    let compressed = reader.get(8)? == 1;
    let agree = compressed && samples > 1 && reader.get(1)? == 1;
    let layout = Layout::new(samples, agree);
    for plane in planes {
        let mut values = vec![0; layout.count()];
        if compressed {
            read_plane(&layout, plane, &mut reader, &mut values)?;
        } else {
            for value in &mut values {
                *value = reader.get(plane.bits)?;
            }
        }
        for (i, value) in values.into_iter().enumerate() {
            for sample in 0..if agree { samples } else { 1 } {
                plane.set(&mut codes, layout.index(i, words) + 4 * words * sample, value);
            }
        }
    }
    Some(codes)
}

/// Writes the compressed form.
fn write(format: Format, samples: usize, codes: &[u32], sink: &mut impl Sink) {
    let (planes, words) = planes(format);
    assert_eq!(codes.len(), PIXELS * samples * words, "codes of a block of {}", format.name());
    let run = 4 * words;
    let agree = samples > 1
        && codes.chunks_exact(run * samples).all(|quad| quad.chunks_exact(run).all(|sample| sample == &quad[..run]));
    if samples > 1 {
        sink.put(u32::from(agree), 1);
    }
    let layout = Layout::new(samples, agree);
    let mut values = [0_u32; 4 * PIXELS];
    for plane in planes {
        let values = &mut values[..layout.count()];
        for (i, value) in values.iter_mut().enumerate() {
            *value = plane.get(codes, layout.index(i, words));
        }
        write_plane(&layout, plane, values, sink);
    }
}

/// What the numbers of a plane are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum PlaneKind {
    /// A byte of a colour, or a stencil value: no geometry behind it.
    Byte,
    /// A normalised depth: linear over a triangle.
    Depth,
    /// The bits of a floating-point depth: its value is linear over a triangle.
    FloatDepth,
}

/// One number per sample: some bits of one word of its code.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Plane {
    kind: PlaneKind,
    word: usize,
    shift: u32,
    bits: u32,
    /// Words of a code.
    words: usize,
}

impl Plane {
    fn get(&self, codes: &[u32], index: usize) -> u32 {
        codes[index + 4 * self.word] >> self.shift & mask(self.bits)
    }

    fn set(&self, codes: &mut [u32], index: usize, value: u32) {
        codes[index + 4 * self.word] |= value << self.shift;
    }
}

/// The low bits of a word.
fn mask(bits: u32) -> u32 {
    if bits >= 32 { !0 } else { (1 << bits) - 1 }
}

/// Planes of colours by their words: the bytes of a texel of one, two and four words.
const BYTES: [[Plane; 16]; 3] = [bytes(1), bytes(2), bytes(4)];

const fn bytes(words: usize) -> [Plane; 16] {
    let mut planes = [Plane { kind: PlaneKind::Byte, word: 0, shift: 0, bits: 8, words }; 16];
    let mut byte = 0;
    while byte < 16 {
        (planes[byte].word, planes[byte].shift) = (byte / 4, byte as u32 % 4 * 8);
        byte += 1;
    }
    planes
}

const fn depth(kind: PlaneKind, bits: u32, words: usize) -> Plane {
    Plane { kind, word: 0, shift: 0, bits, words }
}

const DEPTH16: [Plane; 1] = [depth(PlaneKind::Depth, 16, 1)];
const DEPTH24: [Plane; 2] = [depth(PlaneKind::Depth, 24, 1), Plane { shift: 24, ..BYTES[0][0] }];
const DEPTH32: [Plane; 1] = [depth(PlaneKind::FloatDepth, 32, 1)];
const DEPTH32_STENCIL: [Plane; 5] = [depth(PlaneKind::FloatDepth, 32, 2), BYTES[1][4], BYTES[1][5], BYTES[1][6], BYTES[1][7]];

/// The planes of a format's codes, those of one word side by side, and the words of a code; no bit of a stored texel is left out.
fn planes(format: Format) -> (&'static [Plane], usize) {
    let words = super::rop::code_words(format);
    let planes: &[Plane] = match format {
        Format::Depth16Unorm => &DEPTH16,
        Format::Depth24Plus | Format::Depth24PlusStencil8 => &DEPTH24,
        Format::Depth32Float => &DEPTH32,
        Format::Depth32FloatStencil8 => &DEPTH32_STENCIL,
        _ => &BYTES[words.ilog2() as usize][..format.block_bytes() as usize],
    };
    (planes, words)
}
