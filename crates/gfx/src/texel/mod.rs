//! Texels: from the bytes of memory to the four numbers that a shader sees, and back.
//!
//! Rounding is the WebGPU and Vulkan rule: a number is clamped to the format's range, scaled, and rounded to the nearest
//! integer, ties to even; NaN becomes 0. Every code decodes to a number that encodes to the same code, with two exceptions that
//! the specifications make: the smallest snorm code is a second -1, and the shared-exponent format has many codes a number.

mod block;
mod depth;
mod pack;
mod small_float;
mod srgb;

#[cfg(test)]
mod tests;

pub use block::decode_block;
#[allow(unused_imports, reason = "for prepared textures")]
pub(crate) use block::decode_block_rgba8;
pub use depth::{aspect_masks, depth_code, depth_stencil_code, depth_value, stencil_value, unorm24};
pub use pack::{Rgba8, pack_rgba8};
pub use small_float::{f16_to_f32, f32_to_f16};
pub(crate) use srgb::Encoder as SrgbEncoder;
pub use srgb::{decode_srgb8, encode_srgb8, srgb_table};

use super::format::Format;
use small_float::*;

/// The bits of 1.0.
const ONE: u32 = 0x3f80_0000;

/// `x` in [0, 1] as an unsigned normalised integer of maximum `max` (at most 2^16 - 1).
#[inline(always)]
pub fn unorm(x: f32, max: f32) -> u32 {
    // The first selection takes NaN to 0; adding 2^23 rounds to nearest even and leaves the integer in the mantissa.
    let x = if x > 0.0 { x } else { 0.0 };
    let x = if x < 1.0 { x } else { 1.0 };
    (x * max + 8_388_608.0).to_bits() & 0x007f_ffff
}

/// `x` in [-1, 1] as a signed normalised integer of maximum `max` (at most 2^15 - 1), sign-extended.
#[inline(always)]
pub fn snorm(x: f32, max: f32) -> i32 {
    let x = if x.is_nan() { 0.0 } else { x };
    (x.clamp(-1.0, 1.0) * max + 12_582_912.0).to_bits().wrapping_sub(12_582_912.0_f32.to_bits()) as i32
}

/// A signed normalised code as a number: `max(code / max, -1)`.
#[inline(always)]
fn from_snorm(code: i32, max: f32) -> u32 {
    (code as f32 / max).max(-1.0).to_bits()
}

/// An unsigned normalised code as a number.
#[inline(always)]
fn from_unorm(code: u32, max: f32) -> u32 {
    (code as f32 / max).to_bits()
}

fn u16_of(bytes: &[u8], index: usize) -> u32 {
    u32::from(u16::from_le_bytes([bytes[2 * index], bytes[2 * index + 1]]))
}

fn u32_of(bytes: &[u8], index: usize) -> u32 {
    u32::from_le_bytes([bytes[4 * index], bytes[4 * index + 1], bytes[4 * index + 2], bytes[4 * index + 3]])
}

/// Decodes one texel of an uncompressed format: the bits of four `f32`, `u32` or `i32` as [`Format::kind`] says. Missing
/// components are 0, 0, 0, 1. A depth format gives its depth as `f32` (`stencil8` its stencil as `u32`); the stencil of a
/// combined format is what [`stencil_value`] gives.
///
/// # Panics
/// If the format is compressed or `bytes` is shorter than a texel.
pub fn decode(format: Format, bytes: &[u8]) -> [u32; 4] {
    use Format::*;
    let byte = |i: usize| u32::from(bytes[i]);
    let sbyte = |i: usize| i32::from(bytes[i] as i8);
    let short = |i: usize| u16_of(bytes, i);
    let sshort = |i: usize| i32::from(u16_of(bytes, i) as u16 as i16);
    let word = |i: usize| u32_of(bytes, i);
    let half = |i: usize| f16_to_f32(u16_of(bytes, i) as u16).to_bits();
    let u8n = |i: usize| from_unorm(byte(i), 255.0);
    let s8n = |i: usize| from_snorm(sbyte(i), 127.0);
    let u16n = |i: usize| from_unorm(short(i), 65535.0);
    let s16n = |i: usize| from_snorm(sshort(i), 32767.0);
    let srgb = |i: usize| decode_srgb8(bytes[i]).to_bits();
    match format {
        R8Unorm => [u8n(0), 0, 0, ONE],
        R8Snorm => [s8n(0), 0, 0, ONE],
        R8Uint => [byte(0), 0, 0, 1],
        R8Sint => [sbyte(0) as u32, 0, 0, 1],
        R16Unorm => [u16n(0), 0, 0, ONE],
        R16Snorm => [s16n(0), 0, 0, ONE],
        R16Uint => [short(0), 0, 0, 1],
        R16Sint => [sshort(0) as u32, 0, 0, 1],
        R16Float => [half(0), 0, 0, ONE],
        Rg8Unorm => [u8n(0), u8n(1), 0, ONE],
        Rg8Snorm => [s8n(0), s8n(1), 0, ONE],
        Rg8Uint => [byte(0), byte(1), 0, 1],
        Rg8Sint => [sbyte(0) as u32, sbyte(1) as u32, 0, 1],
        R32Uint | R32Sint => [word(0), 0, 0, 1],
        R32Float => [word(0), 0, 0, ONE],
        Rg16Unorm => [u16n(0), u16n(1), 0, ONE],
        Rg16Snorm => [s16n(0), s16n(1), 0, ONE],
        Rg16Uint => [short(0), short(1), 0, 1],
        Rg16Sint => [sshort(0) as u32, sshort(1) as u32, 0, 1],
        Rg16Float => [half(0), half(1), 0, ONE],
        Rgba8Unorm => [u8n(0), u8n(1), u8n(2), u8n(3)],
        Rgba8UnormSrgb => [srgb(0), srgb(1), srgb(2), u8n(3)],
        Rgba8Snorm => [s8n(0), s8n(1), s8n(2), s8n(3)],
        Rgba8Uint => [byte(0), byte(1), byte(2), byte(3)],
        Rgba8Sint => [sbyte(0) as u32, sbyte(1) as u32, sbyte(2) as u32, sbyte(3) as u32],
        Bgra8Unorm => [u8n(2), u8n(1), u8n(0), u8n(3)],
        Bgra8UnormSrgb => [srgb(2), srgb(1), srgb(0), u8n(3)],
        Rgb9e5Ufloat => {
            let [r, g, b] = from_rgb9e5(word(0));
            [r.to_bits(), g.to_bits(), b.to_bits(), ONE]
        }
        Rgb10a2Uint => [word(0) & 1023, word(0) >> 10 & 1023, word(0) >> 20 & 1023, word(0) >> 30],
        Rgb10a2Unorm => [
            from_unorm(word(0) & 1023, 1023.0),
            from_unorm(word(0) >> 10 & 1023, 1023.0),
            from_unorm(word(0) >> 20 & 1023, 1023.0),
            from_unorm(word(0) >> 30, 3.0),
        ],
        Rg11b10Ufloat => [
            from_small_float::<6>(word(0) & 0x7ff).to_bits(),
            from_small_float::<6>(word(0) >> 11 & 0x7ff).to_bits(),
            from_small_float::<5>(word(0) >> 22).to_bits(),
            ONE,
        ],
        R64Uint => [word(0), word(1), 0, 1],
        Rg32Uint | Rg32Sint => [word(0), word(1), 0, 1],
        Rg32Float => [word(0), word(1), 0, ONE],
        Rgba16Unorm => [u16n(0), u16n(1), u16n(2), u16n(3)],
        Rgba16Snorm => [s16n(0), s16n(1), s16n(2), s16n(3)],
        Rgba16Uint => [short(0), short(1), short(2), short(3)],
        Rgba16Sint => [sshort(0) as u32, sshort(1) as u32, sshort(2) as u32, sshort(3) as u32],
        Rgba16Float => [half(0), half(1), half(2), half(3)],
        Rgba32Uint | Rgba32Sint | Rgba32Float => [word(0), word(1), word(2), word(3)],
        Stencil8 => [byte(0), 0, 0, 1],
        Depth16Unorm => [depth_value(format, short(0)).to_bits(), 0, 0, ONE],
        Depth24Plus | Depth24PlusStencil8 | Depth32Float | Depth32FloatStencil8 => {
            [depth_value(format, word(0)).to_bits(), 0, 0, ONE]
        }
        Bc1RgbaUnorm | Bc1RgbaUnormSrgb | Bc2RgbaUnorm | Bc2RgbaUnormSrgb | Bc3RgbaUnorm | Bc3RgbaUnormSrgb | Bc4RUnorm
        | Bc4RSnorm | Bc5RgUnorm | Bc5RgSnorm | Bc6hRgbUfloat | Bc6hRgbFloat | Bc7RgbaUnorm | Bc7RgbaUnormSrgb => {
            panic!("{} is decoded by blocks", format.name())
        }
    }
}

/// Encodes one texel of an uncompressed format; the inverse of [`decode`]. Integers outside the format's range saturate.
/// Returns the bytes (the first [`Format::block_bytes`] count). A combined depth-stencil format takes depth from component 0 and
/// stencil from component 1.
///
/// # Panics
/// If the format is compressed.
pub fn encode(format: Format, texel: [u32; 4]) -> [u8; 16] {
    use Format::*;
    let f = |i: usize| f32::from_bits(texel[i]);
    let u8n = |i: usize| unorm(f(i), 255.0);
    let s8n = |i: usize| snorm(f(i), 127.0) as u32 & 0xff;
    let u16n = |i: usize| unorm(f(i), 65535.0);
    let s16n = |i: usize| snorm(f(i), 32767.0) as u32 & 0xffff;
    let u8i = |i: usize| texel[i].min(255);
    let s8i = |i: usize| (texel[i] as i32).clamp(-128, 127) as u32 & 0xff;
    let u16i = |i: usize| texel[i].min(65535);
    let s16i = |i: usize| (texel[i] as i32).clamp(-32768, 32767) as u32 & 0xffff;
    let half = |i: usize| u32::from(f32_to_f16(f(i)));
    let srgb = |i: usize| u32::from(encode_srgb8(f(i)));
    let four = |a: u32, b: u32, c: u32, d: u32| a | b << 8 | c << 16 | d << 24;
    let (low, high) = match format {
        R8Unorm => (u8n(0), 0),
        R8Snorm => (s8n(0), 0),
        R8Uint => (u8i(0), 0),
        R8Sint => (s8i(0), 0),
        R16Unorm => (u16n(0), 0),
        R16Snorm => (s16n(0), 0),
        R16Uint => (u16i(0), 0),
        R16Sint => (s16i(0), 0),
        R16Float => (half(0), 0),
        Rg8Unorm => (u8n(0) | u8n(1) << 8, 0),
        Rg8Snorm => (s8n(0) | s8n(1) << 8, 0),
        Rg8Uint => (u8i(0) | u8i(1) << 8, 0),
        Rg8Sint => (s8i(0) | s8i(1) << 8, 0),
        R32Uint | R32Sint | R32Float => (texel[0], 0),
        Rg16Unorm => (u16n(0) | u16n(1) << 16, 0),
        Rg16Snorm => (s16n(0) | s16n(1) << 16, 0),
        Rg16Uint => (u16i(0) | u16i(1) << 16, 0),
        Rg16Sint => (s16i(0) | s16i(1) << 16, 0),
        Rg16Float => (half(0) | half(1) << 16, 0),
        Rgba8Unorm => (four(u8n(0), u8n(1), u8n(2), u8n(3)), 0),
        Rgba8UnormSrgb => (four(srgb(0), srgb(1), srgb(2), u8n(3)), 0),
        Rgba8Snorm => (four(s8n(0), s8n(1), s8n(2), s8n(3)), 0),
        Rgba8Uint => (four(u8i(0), u8i(1), u8i(2), u8i(3)), 0),
        Rgba8Sint => (four(s8i(0), s8i(1), s8i(2), s8i(3)), 0),
        Bgra8Unorm => (four(u8n(2), u8n(1), u8n(0), u8n(3)), 0),
        Bgra8UnormSrgb => (four(srgb(2), srgb(1), srgb(0), u8n(3)), 0),
        Rgb9e5Ufloat => (to_rgb9e5([f(0), f(1), f(2)]), 0),
        Rgb10a2Uint => (texel[0].min(1023) | texel[1].min(1023) << 10 | texel[2].min(1023) << 20 | texel[3].min(3) << 30, 0),
        Rgb10a2Unorm => {
            (unorm(f(0), 1023.0) | unorm(f(1), 1023.0) << 10 | unorm(f(2), 1023.0) << 20 | unorm(f(3), 3.0) << 30, 0)
        }
        Rg11b10Ufloat => (to_small_float::<6>(f(0)) | to_small_float::<6>(f(1)) << 11 | to_small_float::<5>(f(2)) << 22, 0),
        R64Uint | Rg32Uint | Rg32Sint | Rg32Float => (texel[0], texel[1]),
        Rgba16Unorm => (u16n(0) | u16n(1) << 16, u16n(2) | u16n(3) << 16),
        Rgba16Snorm => (s16n(0) | s16n(1) << 16, s16n(2) | s16n(3) << 16),
        Rgba16Uint => (u16i(0) | u16i(1) << 16, u16i(2) | u16i(3) << 16),
        Rgba16Sint => (s16i(0) | s16i(1) << 16, s16i(2) | s16i(3) << 16),
        Rgba16Float => (half(0) | half(1) << 16, half(2) | half(3) << 16),
        Rgba32Uint | Rgba32Sint | Rgba32Float => {
            return bytemuck::cast(texel.map(u32::to_le));
        }
        Stencil8 => (texel[0].min(255), 0),
        Depth16Unorm | Depth24Plus | Depth32Float => (depth_code(format, f(0)), 0),
        Depth24PlusStencil8 => (depth_code(format, f(0)) | texel[1].min(255) << 24, 0),
        Depth32FloatStencil8 => (depth_code(format, f(0)), texel[1].min(255)),
        Bc1RgbaUnorm | Bc1RgbaUnormSrgb | Bc2RgbaUnorm | Bc2RgbaUnormSrgb | Bc3RgbaUnorm | Bc3RgbaUnormSrgb | Bc4RUnorm
        | Bc4RSnorm | Bc5RgUnorm | Bc5RgSnorm | Bc6hRgbUfloat | Bc6hRgbFloat | Bc7RgbaUnorm | Bc7RgbaUnormSrgb => {
            panic!("{} is not encoded by texels", format.name())
        }
    };
    bytemuck::cast([low.to_le(), high.to_le(), 0, 0])
}

/// [`decode`] of a texel held in little-endian words, as tile buffers hold codes: one word for up to four bytes, else two or four.
///
/// # Panics
/// If the format is compressed or there are too few words.
pub fn decode_code(format: Format, code: &[u32]) -> [u32; 4] {
    let mut words = [0; 4];
    for (word, bits) in words.iter_mut().zip(code) {
        *word = bits.to_le();
    }
    decode(format, bytemuck::bytes_of(&words))
}

/// [`encode`] to little-endian words.
///
/// # Panics
/// If the format is compressed.
pub fn encode_code(format: Format, texel: [u32; 4]) -> [u32; 4] {
    bytemuck::cast::<[u8; 16], [u32; 4]>(encode(format, texel)).map(u32::from_le)
}
