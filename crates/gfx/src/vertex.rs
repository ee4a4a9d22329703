//! Vertex attributes: from the bytes of vertex buffers to lanes.
//!
//! Every WebGPU vertex format. Missing components are 0, a missing fourth is 1 (of the attribute's type). Reads are robust:
//! an attribute that does not lie wholly inside the bound range is decoded from zero bytes.

use std::sync::atomic::{AtomicU32, Ordering::Relaxed};

use num::{LANES, Lanes, Words};

use super::state::VertexFormat;

/// The range of a buffer that is bound to a vertex slot.
#[derive(Clone, Copy, Debug)]
pub struct VertexSource<'a> {
    /// The buffer.
    pub words: &'a Words,
    /// First byte of the range.
    pub offset: u64,
    /// Bytes of the range; what of it lies beyond the buffer's end counts as outside.
    pub size: u64,
    /// Bytes from one vertex (or instance) to the next.
    pub stride: u64,
}

/// Type of the components that a vertex format gives to a shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ComponentKind {
    /// `f32`; 64-bit floats are rounded to it.
    Float,
    /// `u32`.
    Uint,
    /// `i32`.
    Sint,
}

/// How one component lies in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Encoding {
    Uint8,
    Sint8,
    Unorm8,
    Snorm8,
    Uint16,
    Sint16,
    Unorm16,
    Snorm16,
    Float16,
    Bits32,
    Float64,
    Unorm10x3x2,
    Unorm8Bgra,
}

const fn encoding(format: VertexFormat) -> Encoding {
    use VertexFormat::*;
    match format {
        Uint8 | Uint8x2 | Uint8x4 => Encoding::Uint8,
        Sint8 | Sint8x2 | Sint8x4 => Encoding::Sint8,
        Unorm8 | Unorm8x2 | Unorm8x4 => Encoding::Unorm8,
        Snorm8 | Snorm8x2 | Snorm8x4 => Encoding::Snorm8,
        Uint16 | Uint16x2 | Uint16x4 => Encoding::Uint16,
        Sint16 | Sint16x2 | Sint16x4 => Encoding::Sint16,
        Unorm16 | Unorm16x2 | Unorm16x4 => Encoding::Unorm16,
        Snorm16 | Snorm16x2 | Snorm16x4 => Encoding::Snorm16,
        Float16 | Float16x2 | Float16x4 => Encoding::Float16,
        Float32 | Float32x2 | Float32x3 | Float32x4 => Encoding::Bits32,
        Uint32 | Uint32x2 | Uint32x3 | Uint32x4 => Encoding::Bits32,
        Sint32 | Sint32x2 | Sint32x3 | Sint32x4 => Encoding::Bits32,
        Float64 | Float64x2 | Float64x3 | Float64x4 => Encoding::Float64,
        Unorm10x10x10x2 => Encoding::Unorm10x3x2,
        Unorm8x4Bgra => Encoding::Unorm8Bgra,
    }
}

/// The type in which a shader sees a vertex format.
pub const fn component_kind(format: VertexFormat) -> ComponentKind {
    use VertexFormat::*;
    match format {
        Uint8 | Uint8x2 | Uint8x4 | Uint16 | Uint16x2 | Uint16x4 | Uint32 | Uint32x2 | Uint32x3 | Uint32x4 => {
            ComponentKind::Uint
        }
        Sint8 | Sint8x2 | Sint8x4 | Sint16 | Sint16x2 | Sint16x4 | Sint32 | Sint32x2 | Sint32x3 | Sint32x4 => {
            ComponentKind::Sint
        }
        _ => ComponentKind::Float,
    }
}

impl VertexSource<'_> {
    /// Reads the attribute at byte `offset` of vertices `index[..n]` into lanes `0..n`, as the bits of four components.
    ///
    /// `index` counts vertices or instances from the start of the range, base vertex and first instance included. Lanes from
    /// `n` on are left as they are.
    pub fn fetch(&self, format: VertexFormat, offset: u64, index: &[u32; LANES], n: usize, out: &mut [Lanes; 4]) {
        let n = n.min(LANES);
        let bytes = u64::from(format.bytes());
        let end = self.offset.saturating_add(self.size).min(self.words.len());
        let place = |index: u32| {
            let start = self.stride.checked_mul(u64::from(index))?.checked_add(self.offset)?.checked_add(offset)?;
            (start.checked_add(bytes)? <= end).then_some(start as usize)
        };
        let last = index[..n].iter().fold(0, |most, i| most.max(*i));
        // If the last one is inside, so are all, and nothing overflows.
        let all_inside = place(last).is_some();
        let kind = component_kind(format);
        let components = format.components() as usize;
        let one = if kind == ComponentKind::Float { 1f32.to_bits() } else { 1 };
        for c in components..4 {
            out[c].0[..n].fill(if c == 3 { one } else { 0 });
        }
        let words = self.words.words();
        let encoding = encoding(format);
        if all_inside && encoding == Encoding::Bits32 && (self.offset | offset | self.stride).is_multiple_of(4) {
            // The case that matters.
            let from = Strided { words: &words[((self.offset + offset) / 4) as usize..], stride: (self.stride / 4) as usize };
            return match components {
                1 => from.copy::<1>(&index[..n], out),
                2 => from.copy::<2>(&index[..n], out),
                3 => from.copy::<3>(&index[..n], out),
                _ => from.copy::<4>(&index[..n], out),
            };
        }
        // The first byte of each lane's attribute, or the sentinel for one outside.
        let mut at = [usize::MAX; LANES];
        let mut inside = true;
        let mut aligned = 0;
        if all_inside {
            let (first, stride) = ((self.offset + offset) as usize, self.stride as usize);
            for i in 0..n {
                at[i] = first + stride * index[i] as usize;
                aligned |= at[i];
            }
        } else {
            for i in 0..n {
                match place(index[i]) {
                    Some(start) => {
                        at[i] = start;
                        aligned |= start;
                    }
                    None => inside = false,
                }
            }
        }
        // Choose by format outside the loop over lanes.
        if inside && aligned % 4 == 0 {
            match encoding {
                Encoding::Bits32 => {
                    match components {
                        1 => copy::<1>(words, &at[..n], out),
                        2 => copy::<2>(words, &at[..n], out),
                        3 => copy::<3>(words, &at[..n], out),
                        _ => copy::<4>(words, &at[..n], out),
                    }
                    return;
                }
                Encoding::Unorm8 if components == 4 => {
                    let mut packed = [0; LANES];
                    for i in 0..n {
                        packed[i] = words[at[i] / 4].load(Relaxed);
                    }
                    for c in 0..4 {
                        for i in 0..n {
                            out[c].0[i] = unorm::<8>(packed[i] >> (8 * c)).to_bits();
                        }
                    }
                    return;
                }
                _ => {}
            }
        }
        for i in 0..n {
            let mut raw = [0u8; 32];
            if at[i] != usize::MAX {
                self.words.read(at[i] as u64, &mut raw[..bytes as usize]);
            }
            let value = decode(encoding, components, &raw);
            for c in 0..components {
                out[c].0[i] = value[c];
            }
        }
    }
}

/// Attributes of whole words, from the first on.
struct Strided<'a> {
    words: &'a [AtomicU32],
    /// Words from one vertex to the next.
    stride: usize,
}

impl Strided<'_> {
    /// Copies those of `N` words of some vertices.
    #[inline(always)]
    fn copy<const N: usize>(&self, index: &[u32], out: &mut [Lanes; 4]) {
        for (i, &index) in index.iter().enumerate().take(LANES) {
            let source: &[AtomicU32; N] =
                self.words[self.stride * index as usize..].first_chunk().expect("the last one is inside");
            for c in 0..N {
                out[c].0[i] = source[c].load(Relaxed);
            }
        }
    }
}

/// Copies attributes of `N` words that begin at these bytes.
#[inline(always)]
fn copy<const N: usize>(words: &[AtomicU32], at: &[usize], out: &mut [Lanes; 4]) {
    for (i, at) in at.iter().enumerate().take(LANES) {
        let source: &[AtomicU32; N] = words[at / 4..].first_chunk().expect("places were checked");
        for c in 0..N {
            out[c].0[i] = source[c].load(Relaxed);
        }
    }
}

/// An unsigned normalised value in the low `BITS` bits: v / (2^BITS - 1), correctly rounded.
#[inline(always)]
fn unorm<const BITS: u32>(value: u32) -> f32 {
    let max = (1u32 << BITS) - 1;
    (value & max) as f32 / max as f32
}

/// A signed normalised value: v / (2^(BITS-1) - 1), the least value being -1 too.
#[inline(always)]
fn snorm<const BITS: u32>(value: i32) -> f32 {
    (value as f32 / ((1i32 << (BITS - 1)) - 1) as f32).max(-1.0)
}

/// The value of a 16-bit float, exactly.
pub fn half_to_f32(half: u16) -> f32 {
    let sign = u32::from(half & 0x8000) << 16;
    let exponent = u32::from(half >> 10 & 31);
    let mantissa = u32::from(half & 0x3ff);
    match exponent {
        0 => {
            // Zero or subnormal: mantissa * 2^-24 is exact.
            let magnitude = mantissa as f32 * (1.0 / 16_777_216.0);
            f32::from_bits(magnitude.to_bits() | sign)
        }
        31 => f32::from_bits(sign | 0x7f80_0000 | mantissa << 13),
        _ => f32::from_bits(sign | (exponent + 112) << 23 | mantissa << 13),
    }
}

fn decode(encoding: Encoding, components: usize, raw: &[u8; 32]) -> [u32; 4] {
    let u8_at = |c: usize| u32::from(raw[c]);
    let u16_at = |c: usize| u16::from_le_bytes([raw[2 * c], raw[2 * c + 1]]);
    let u32_at = |c: usize| u32::from_le_bytes([raw[4 * c], raw[4 * c + 1], raw[4 * c + 2], raw[4 * c + 3]]);
    let mut out = [0; 4];
    for c in 0..components {
        out[c] = match encoding {
            Encoding::Uint8 => u8_at(c),
            Encoding::Sint8 => i32::from(raw[c] as i8) as u32,
            Encoding::Unorm8 => unorm::<8>(u8_at(c)).to_bits(),
            Encoding::Snorm8 => snorm::<8>(i32::from(raw[c] as i8)).to_bits(),
            Encoding::Uint16 => u32::from(u16_at(c)),
            Encoding::Sint16 => i32::from(u16_at(c) as i16) as u32,
            Encoding::Unorm16 => unorm::<16>(u32::from(u16_at(c))).to_bits(),
            Encoding::Snorm16 => snorm::<16>(i32::from(u16_at(c) as i16)).to_bits(),
            Encoding::Float16 => half_to_f32(u16_at(c)).to_bits(),
            Encoding::Bits32 => u32_at(c),
            Encoding::Float64 => {
                let bits = u64::from(u32_at(2 * c)) | u64::from(u32_at(2 * c + 1)) << 32;
                (f64::from_bits(bits) as f32).to_bits()
            }
            Encoding::Unorm10x3x2 if c == 3 => unorm::<2>(u32_at(0) >> 30).to_bits(),
            Encoding::Unorm10x3x2 => unorm::<10>(u32_at(0) >> (10 * c)).to_bits(),
            Encoding::Unorm8Bgra => unorm::<8>(u8_at([2, 1, 0, 3][c])).to_bits(),
        };
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    fn fetch(format: VertexFormat, bytes: &[u8], offset: u64) -> [u32; 4] {
        let words = Words::new(64);
        words.write(offset, bytes);
        let source = VertexSource { words: &words, offset: 0, size: 64, stride: offset };
        let mut out = [Lanes::splat(0xdead); 4];
        source.fetch(format, 0, &[1; LANES], 3, &mut out);
        for lanes in &out {
            assert_eq!(lanes.0[3], 0xdead, "a lane that was not asked for changed");
            assert_eq!(lanes.0[0], lanes.0[2]);
        }
        out.map(|lanes| lanes.0[1])
    }

    fn floats(values: [f32; 4]) -> [u32; 4] {
        values.map(f32::to_bits)
    }

    #[test]
    fn every_encoding_decodes_to_its_definition() {
        use VertexFormat::*;
        for offset in [4, 7, 16] {
            assert_eq!(fetch(Uint8x4, &[1, 2, 254, 255], offset), [1, 2, 254, 255]);
            assert_eq!(fetch(Sint8x2, &[0xff, 0x80], offset), [-1i32 as u32, -128i32 as u32, 0, 1]);
            assert_eq!(fetch(Unorm8x4, &[0, 255, 51, 102], offset), floats([0.0, 1.0, 0.2, 0.4]));
            assert_eq!(fetch(Unorm8x4Bgra, &[0, 255, 51, 102], offset), floats([0.2, 1.0, 0.0, 0.4]));
            assert_eq!(fetch(Snorm8x4, &[0x80, 0x81, 127, 0], offset), floats([-1.0, -1.0, 1.0, 0.0]));
            assert_eq!(fetch(Uint16x2, &[1, 2, 255, 255], offset), [0x201, 0xffff, 0, 1]);
            assert_eq!(fetch(Sint16, &[0xfe, 0xff], offset), [-2i32 as u32, 0, 0, 1]);
            assert_eq!(fetch(Unorm16x2, &[255, 255, 0, 0], offset), floats([1.0, 0.0, 0.0, 1.0]));
            assert_eq!(fetch(Snorm16x2, &[0, 0x80, 0xff, 0x7f], offset), floats([-1.0, 1.0, 0.0, 1.0]));
            assert_eq!(fetch(Float16x2, &[0, 0x3c, 1, 0x80], offset), floats([1.0, -(2f32.powi(-24)), 0.0, 1.0]));
            assert_eq!(fetch(Float32x3, bytemuck::bytes_of(&[1.5f32, -2.0, 3.25]), offset), floats([1.5, -2.0, 3.25, 1.0]));
            assert_eq!(fetch(Sint32x2, bytemuck::bytes_of(&[-5i32, 6]), offset), [-5i32 as u32, 6, 0, 1]);
            assert_eq!(fetch(Float64x2, bytemuck::bytes_of(&[0.1f64, 2.0]), offset), floats([0.1, 2.0, 0.0, 1.0]));
            let packed = 1023u32 | 341 << 20 | 2 << 30;
            assert_eq!(fetch(Unorm10x10x10x2, &packed.to_le_bytes(), offset), floats([1.0, 0.0, 1.0 / 3.0, 2.0 / 3.0]));
        }
    }

    #[test]
    fn halves_are_exact() {
        assert_eq!(half_to_f32(0x7c00), f32::INFINITY);
        assert!(half_to_f32(0x7e01).is_nan());
        assert_eq!(half_to_f32(0x7bff), 65504.0);
        assert_eq!(half_to_f32(0x0400), 2f32.powi(-14));
        assert_eq!(half_to_f32(0x8000).to_bits(), (-0f32).to_bits());
    }

    #[test]
    fn reads_outside_the_range_give_zero() {
        let words = Words::new(64);
        words.write(0, &[0xff; 64]);
        let mut out = [Lanes::ZERO; 4];
        let mut index = [0; LANES];
        index[..6].copy_from_slice(&[0, 1, 2, 3, u32::MAX, 0]);
        // Three vertices of 16 bytes fit 50 bytes from offset 8; the fourth would end at 72.
        let source = VertexSource { words: &words, offset: 8, size: 50, stride: 16 };
        source.fetch(VertexFormat::Uint32x4, 0, &index, 6, &mut out);
        for lanes in &out {
            assert_eq!(lanes.0[..6], [!0, !0, !0, 0, 0, !0]);
        }
        for (offset, size, stride) in [(u64::MAX, 1, 1), (0, u64::MAX, u64::MAX), (60, 50, 16), (0, 0, 0)] {
            let source = VertexSource { words: &words, offset, size, stride };
            source.fetch(VertexFormat::Float32x3, u64::MAX - 3, &index, 6, &mut out);
            for c in 0..3 {
                assert_eq!(out[c].0[..6], [0; 6]);
            }
            assert_eq!(out[3].0[0], 1f32.to_bits());
        }
    }
}
