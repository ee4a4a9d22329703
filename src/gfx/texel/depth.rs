//! Depth and stencil values. A *code* is a stored depth in the low bits of a `u32`.

use super::Format;

/// Depth as a 24-bit unsigned normalised integer; NaN becomes 0.
#[inline(always)]
pub fn unorm24(depth: f32) -> u32 {
    let d = if depth > 0.0 { depth } else { 0.0 };
    let d = if d < 1.0 { d } else { 1.0 };
    // The product has at most 24 bits before the point, so adding 2^23 and taking it away rounds it where it has a fraction
    // that `f32` can hold, and a number from 2^23 on is an integer already.
    let scaled = d * 16_777_215.0;
    let rounded = if scaled < 8_388_608.0 { (scaled + 8_388_608.0) - 8_388_608.0 } else { scaled };
    rounded as i32 as u32
}

/// The code that a depth format stores for a depth: unsigned normalised, or the bits of the `f32`. NaN becomes 0 in a normalised
/// format and stays NaN in a floating-point one.
#[inline(always)]
pub fn depth_code(format: Format, depth: f32) -> u32 {
    match format {
        Format::Depth16Unorm => super::unorm(depth, 65535.0),
        Format::Depth24Plus | Format::Depth24PlusStencil8 => unorm24(depth),
        _ => depth.to_bits(),
    }
}

/// The depth that a code stands for. Bits above those of the format are ignored.
#[inline(always)]
pub fn depth_value(format: Format, code: u32) -> f32 {
    match format {
        Format::Depth16Unorm => (code & 0xffff) as f32 / 65535.0,
        Format::Depth24Plus | Format::Depth24PlusStencil8 => (code & 0x00ff_ffff) as f32 / 16_777_215.0,
        _ => f32::from_bits(code),
    }
}

/// The stencil value of a texel's bytes; 0 where the format has none.
///
/// # Panics
/// If `bytes` is shorter than a texel.
pub fn stencil_value(format: Format, bytes: &[u8]) -> u8 {
    match format {
        Format::Stencil8 => bytes[0],
        Format::Depth24PlusStencil8 => bytes[3],
        Format::Depth32FloatStencil8 => bytes[4],
        _ => 0,
    }
}
