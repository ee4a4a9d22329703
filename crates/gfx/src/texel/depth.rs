//! Depth and stencil values. A *code* is a stored depth in the low bits of a `u32`.

use super::Format;

/// Depth as a 24-bit unsigned normalised integer; NaN becomes 0.
#[inline(always)]
pub fn unorm24(depth: f32) -> u32 {
    let d = if depth > 0.0 { depth } else { 0.0 };
    let d = if d < 1.0 { d } else { 1.0 };
    // Adding 2^23 rounds a smaller product to an integer, which is then in the low bits; one from 2^23 on is an integer already,
    // without its leading bit in the mantissa. No conversion that would have to saturate.
    const HALF: f32 = 8_388_608.0;
    let scaled = d * 16_777_215.0;
    let small = (scaled + HALF).to_bits().wrapping_sub(HALF.to_bits());
    let large = scaled.to_bits().wrapping_sub(HALF.to_bits()).wrapping_add(1 << 23);
    if scaled < HALF { small } else { large }
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
        Format::Depth16Unorm => (code & 0xffff) as i32 as f32 / 65535.0,
        Format::Depth24Plus | Format::Depth24PlusStencil8 => (code & 0x00ff_ffff) as i32 as f32 / 16_777_215.0,
        _ => f32::from_bits(code),
    }
}

/// The bits of a stored texel's words that belong to depth, and those that belong to stencil.
pub fn aspect_masks(format: Format) -> ([u32; 4], [u32; 4]) {
    let depth = match format {
        Format::Depth16Unorm => 0xffff,
        Format::Depth24Plus | Format::Depth24PlusStencil8 => 0x00ff_ffff,
        Format::Depth32Float | Format::Depth32FloatStencil8 => u32::MAX,
        _ => 0,
    };
    let stencil = match format {
        Format::Stencil8 => [0xff, 0, 0, 0],
        Format::Depth24PlusStencil8 => [0xff00_0000, 0, 0, 0],
        Format::Depth32FloatStencil8 => [0, 0xff, 0, 0],
        _ => [0; 4],
    };
    ([depth, 0, 0, 0], stencil)
}

/// The words of a stored texel of a depth or stencil format with these values, and the bits of the words that the values take. Of a stencil value
/// the low eight bits count. A value whose aspect the format does not have takes no bits.
pub fn depth_stencil_code(format: Format, depth: Option<f32>, stencil: Option<u32>) -> ([u32; 4], [u32; 4]) {
    let (depth_mask, stencil_mask) = aspect_masks(format);
    let (mut code, mut mask) = ([0; 4], [0; 4]);
    for w in 0..4 {
        if let Some(depth) = depth {
            code[w] |= depth_code(format, depth) & depth_mask[w];
            mask[w] |= depth_mask[w];
        }
        if let Some(stencil) = stencil {
            code[w] |= stencil.checked_shl(stencil_mask[w].trailing_zeros()).unwrap_or(0) & stencil_mask[w];
            mask[w] |= stencil_mask[w];
        }
    }
    (code, mask)
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
