//! Colour formats as blending sees them: their range, the bits of their channels, and four 8-bit channels over many pixels.

use super::{ColorRefs, Colors};
use crate::format::Format;
use crate::state::BlendFactor;
use crate::texel::{Rgba8, SrgbEncoder, srgb_table, unorm};
use num::{LANES, Lanes, QUADS};

/// Whether a factor names the second source.
pub(super) fn names_second(factor: BlendFactor) -> bool {
    matches!(factor, BlendFactor::Src1 | BlendFactor::OneMinusSrc1 | BlendFactor::Src1Alpha | BlendFactor::OneMinusSrc1Alpha)
}

/// The range of a fixed-point format's numbers; all numbers for a floating-point one.
pub(super) fn range(format: Format) -> [f32; 2] {
    let name = format.name();
    if name.contains("unorm") {
        [0.0, 1.0]
    } else if name.contains("snorm") {
        [-1.0, 1.0]
    } else {
        [f32::NEG_INFINITY, f32::INFINITY]
    }
}

/// Clamps to a finite range, NaN to 0; leaves numbers alone where the range is infinite.
#[inline(always)]
pub(super) fn limit(x: f32, range: [f32; 2]) -> f32 {
    if range[1] == f32::INFINITY {
        return x;
    }
    let x = if x.is_nan() { 0.0 } else { x };
    let x = if x > range[0] { x } else { range[0] };
    if x < range[1] { x } else { range[1] }
}

/// The bits of a code that a channel mask writes.
pub(super) fn write_bits(format: Format, mask: u8) -> [u32; 4] {
    let channels: [bool; 4] = std::array::from_fn(|c| mask >> c & 1 != 0);
    if format == Format::Rgb9e5Ufloat {
        // The exponent belongs to all channels: they are written together or not at all.
        return if mask & 7 == 0 { [0; 4] } else { [!0, 0, 0, 0] };
    }
    let widths: [u32; 4] = match format {
        Format::Rgb10a2Uint | Format::Rgb10a2Unorm => [10, 10, 10, 2],
        Format::Rg11b10Ufloat => [11, 11, 10, 0],
        Format::R64Uint => [64, 0, 0, 0],
        _ => {
            let width = format.block_bytes() * 8 / format.components();
            std::array::from_fn(|c| if (c as u32) < format.components() { width } else { 0 })
        }
    };
    // Blue is stored first in two formats.
    let order = if Rgba8::of(format).is_some_and(|layout| layout.bgra) { [2, 1, 0, 3] } else { [0, 1, 2, 3] };
    let mut bits = 0_u128;
    let mut at = 0;
    for place in 0..4 {
        let width = widths[place];
        if width > 0 && channels[order[place]] {
            bits |= ((1_u128 << width) - 1) << at;
        }
        at += width;
    }
    std::array::from_fn(|word| (bits >> (32 * word)) as u32)
}

/// The first quad after `first` whose place occurred before it in the run that starts at `first`.
#[inline(always)]
pub(super) fn distinct_run(at: &[u32; QUADS], first: usize, quads: usize) -> usize {
    // A bloom filter of 64 bits: only a quad whose bit is taken is compared with the run.
    let mut seen = 0_u64;
    for q in first..quads {
        let bit = 1_u64 << (at[q] >> 1 & 63);
        if seen & bit != 0 && at[first..q].contains(&at[q]) {
            return q;
        }
        seen |= bit;
    }
    quads
}

/// Decodes codes of four 8-bit channels.
#[inline(always)]
pub(super) fn unpack<const N: usize>(layout: Rgba8, codes: &[u32; N]) -> Colors<N> {
    let shift = if layout.bgra { [16, 8, 0, 24] } else { [0, 8, 16, 24] };
    let mut out = [[0.0; N]; 4];
    for c in 0..4 {
        if layout.srgb && c < 3 {
            let table = srgb_table();
            for i in 0..N {
                out[c][i] = table[(codes[i] >> shift[c] & 255) as usize];
            }
        } else {
            for i in 0..N {
                out[c][i] = (codes[i] >> shift[c] & 255) as i32 as f32 / 255.0;
            }
        }
    }
    out
}

/// Encodes colours of four 8-bit channels.
#[inline(always)]
pub(super) fn pack<const N: usize>(layout: Rgba8, color: ColorRefs<'_, N>, out: &mut [u32; N]) {
    let (first, third) = if layout.bgra { (2, 0) } else { (0, 2) };
    let (a, b, c, d) = (color[first], color[1], color[third], color[3]);
    if layout.srgb {
        let encoder = SrgbEncoder::new();
        for i in 0..N {
            let low = u32::from(encoder.encode(a[i])) | u32::from(encoder.encode(b[i])) << 8;
            out[i] = low | u32::from(encoder.encode(c[i])) << 16 | unorm(d[i], 255.0) << 24;
        }
    } else {
        for i in 0..N {
            out[i] = unorm(a[i], 255.0) | unorm(b[i], 255.0) << 8 | unorm(c[i], 255.0) << 16 | unorm(d[i], 255.0) << 24;
        }
    }
}

/// Whether blending is in 8-bit codes ([`super::number`]).
pub(super) fn blends_codes(format: Format) -> bool {
    matches!(format, Format::R8Unorm | Format::Rg8Unorm | Format::Rgba8Unorm | Format::Bgra8Unorm)
}

/// Colours as 8-bit codes: clamped, to the nearest, ties to even; NaN is 0.
#[inline(always)]
pub(super) fn quantize<const N: usize>(color: ColorRefs<'_, N>, out: &mut Colors<N, u16>) {
    for c in 0..4 {
        for i in 0..N {
            out[c][i] = unorm(color[c][i], 255.0) as u16;
        }
    }
}

/// Takes words of four 8-bit codes apart.
#[inline(always)]
pub(super) fn split<const N: usize>(bgra: bool, words: &[u32; N]) -> Colors<N, u16> {
    let shift = if bgra { [16, 8, 0, 24] } else { [0, 8, 16, 24] };
    let mut out = [[0; N]; 4];
    for c in 0..4 {
        for i in 0..N {
            out[c][i] = (words[i] >> shift[c] & 255) as u16;
        }
    }
    out
}

/// Puts words of four 8-bit codes together.
#[inline(always)]
pub(super) fn join<const N: usize>(bgra: bool, color: &Colors<N, u16>, out: &mut [u32; N]) {
    let (first, third) = if bgra { (2, 0) } else { (0, 2) };
    let (a, b, c, d) = (&color[first], &color[1], &color[third], &color[3]);
    for i in 0..N {
        out[i] = u32::from(a[i] | b[i] << 8) | u32::from(c[i] | d[i] << 8) << 16;
    }
}

#[inline(always)]
pub(super) fn floats(bits: &[[u32; 4]; 4]) -> Colors<4> {
    bits.map(|c| c.map(f32::from_bits))
}

#[inline(always)]
pub(super) fn lanes(color: [&Lanes; 4]) -> ColorRefs<'_, LANES> {
    [color[0].f32(), color[1].f32(), color[2].f32(), color[3].f32()]
}
