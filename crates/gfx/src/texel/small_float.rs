//! Floating-point numbers of fewer than 32 bits: half, the unsigned 11- and 10-bit floats, and the shared-exponent format.

/// A half-precision number as `f32`, exactly.
#[inline(always)]
pub fn f16_to_f32(half: u16) -> f32 {
    let bits = u32::from(half & 0x7fff) << 13;
    let sign = u32::from(half & 0x8000) << 16;
    // Multiplying by 2^112 moves the exponent's bias from 15 to 127, subnormal numbers included.
    let magnitude = f32::from_bits(bits) * f32::from_bits(0x7780_0000);
    let special = half & 0x7c00 == 0x7c00;
    f32::from_bits(if special { bits | 0x7f80_0000 } else { magnitude.to_bits() } | sign)
}

/// The nearest half-precision number, ties to even; too large becomes infinity, NaN a quiet NaN.
#[inline(always)]
pub fn f32_to_f16(x: f32) -> u16 {
    let bits = x.to_bits();
    let (sign, magnitude) = (bits >> 16 & 0x8000, bits & 0x7fff_ffff);
    // All cases are computed and one is chosen, so that loops over lanes become vectors.
    // Subnormal: adding 0.5 aligns the number's units with the last place of 0.5, which is 2^-24.
    let small = (f32::from_bits(magnitude) + 0.5).to_bits().wrapping_sub(0x3f00_0000);
    // Rebias, and round by adding half of what is dropped, less one where the last kept bit is even.
    let usual = magnitude.wrapping_sub(0x3800_0000).wrapping_add(0x0fff + (magnitude >> 13 & 1)) >> 13;
    let code = if magnitude < 0x3880_0000 { small } else { usual };
    let code = if magnitude >= 0x4780_0000 { 0x7c00 } else { code };
    let code = if magnitude > 0x7f80_0000 { 0x7e00 } else { code };
    (sign | code) as u16
}

/// An unsigned float of 5 exponent bits and `M` mantissa bits as `f32`, exactly.
#[inline(always)]
pub(super) fn from_small_float<const M: u32>(code: u32) -> f32 {
    f16_to_f32((code << (10 - M)) as u16)
}

/// The nearest unsigned float of 5 exponent bits and `M` mantissa bits, ties to even. Negative numbers become 0, finite numbers
/// too large the largest finite, infinity and NaN stay.
#[inline(always)]
pub(super) fn to_small_float<const M: u32>(x: f32) -> u32 {
    let infinity = 0x1f << M;
    if x.is_nan() {
        return infinity | 1 << (M - 1);
    }
    if x == f32::INFINITY {
        return infinity;
    }
    if x <= 0.0 {
        return 0;
    }
    let bits = x.to_bits();
    let code = if bits < 0x3880_0000 {
        // Subnormal: units of 2^(-14 - M). The product is exact, and rounds at the addition of 2^23.
        let units = x * f32::from_bits((127 + 14 + M) << 23);
        (units + 8_388_608.0).to_bits() & 0x007f_ffff
    } else {
        let drop = 23 - M;
        (bits - 0x3800_0000).saturating_add((1 << (drop - 1)) - 1 + (bits >> drop & 1)) >> drop
    };
    code.min(infinity - 1)
}

/// The three numbers of a shared-exponent texel, exactly: mantissa * 2^(exponent - 15 - 9).
#[inline(always)]
pub(super) fn from_rgb9e5(code: u32) -> [f32; 3] {
    let unit = f32::from_bits(((code >> 27) + 127 - 24) << 23);
    [(code & 511) as f32 * unit, (code >> 9 & 511) as f32 * unit, (code >> 18 & 511) as f32 * unit]
}

/// The shared-exponent texel nearest to three numbers (`EXT_texture_shared_exponent`, with rounding to nearest, ties up, as
/// that specification says). Negative numbers and NaN become 0.
pub(super) fn to_rgb9e5(rgb: [f32; 3]) -> u32 {
    const MAX: f32 = 65408.0;
    let rgb = rgb.map(|x| if x > 0.0 { x.min(MAX) } else { 0.0 });
    let most = rgb[0].max(rgb[1]).max(rgb[2]);
    // floor(log2(most)) from the exponent bits; numbers below 2^-16 share the smallest exponent.
    let exponent = ((most.to_bits() >> 23) as i32 - 127).max(-16) + 16;
    let scale = |exponent: i32| f32::from_bits(((127 + 24 - exponent) as u32) << 23);
    let mantissa = |x: f32, exponent: i32| (x * scale(exponent) + 0.5) as u32;
    let exponent = if mantissa(most, exponent) == 512 { exponent + 1 } else { exponent };
    let [r, g, b] = rgb.map(|x| mantissa(x, exponent));
    r | g << 9 | b << 18 | (exponent as u32) << 27
}
