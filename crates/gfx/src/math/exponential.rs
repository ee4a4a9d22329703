//! Exponentials, logarithms and powers.

use super::{ROUND, round_small_i32};

/// 2^e for `-126 <= e <= 127`.
#[inline(always)]
fn power_of_two(e: i32) -> f32 {
    f32::from_bits((e.wrapping_add(127) as u32) << 23)
}

/// `p * 2^e` for `-254 <= e <= 254`, rounding once where the result is subnormal.
#[inline(always)]
fn scale(p: f32, e: i32) -> f32 {
    // Two exact powers of two: their product may lie outside the range of one. The first product is exact, because p is near 1
    // and half of e stays within the exponents of normal numbers.
    let half = e >> 1;
    p * power_of_two(half) * power_of_two(e.wrapping_sub(half))
}

/// 2^x. Overflows to infinity from 128 on, goes through the subnormal numbers to 0; NaN stays NaN.
#[inline(always)]
pub fn exp2(x: f32) -> f32 {
    // Written as selections so that NaN passes through.
    let x = if x > 129.0 { 129.0 } else { x };
    let x = if x < -151.0 { -151.0 } else { x };
    let whole = (x + ROUND) - ROUND;
    let f = x - whole;
    let mut p = 1.535_336_2e-4_f32;
    p = p * f + 1.339_887_4e-3;
    p = p * f + 9.618_437e-3;
    p = p * f + 5.550_332_5e-2;
    p = p * f + 2.402_264_8e-1;
    p = p * f + 6.931_472e-1;
    p = p * f + 1.0;
    scale(p, round_small_i32(x))
}

/// e^x.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let x = if x > 89.5 { 89.5 } else { x };
    let x = if x < -104.5 { -104.5 } else { x };
    let t = x * core::f32::consts::LOG2_E;
    let n = (t + ROUND) - ROUND;
    // ln 2 in two parts. The first has few bits, so its product with n is exact.
    let r = x - n * 0.693_359_4;
    let r = r - n * -2.121_944_4e-4;
    let mut p = 1.987_569_1e-4_f32;
    p = p * r + 1.398_199_9e-3;
    p = p * r + 8.333_452e-3;
    p = p * r + 4.166_579_6e-2;
    p = p * r + 1.666_666_5e-1;
    p = p * r + 0.5;
    p = p * (r * r) + r + 1.0;
    scale(p, round_small_i32(t))
}

/// Splits a positive finite number into `m - 1` with m in [sqrt(1/2), sqrt(2)) and its exponent, and gives the tail of the series
/// ln m = (m - 1) + tail.
#[inline(always)]
fn log_parts(x: f32) -> (f32, f32, f32) {
    // Subnormal numbers are scaled into the normal range first.
    let tiny = x < f32::MIN_POSITIVE;
    let scaled = if tiny { x * 8_388_608.0 } else { x };
    let bits = scaled.to_bits();
    // Adding the distance from sqrt(1/2) to 1 carries into the exponent exactly when the mantissa is at least sqrt(2).
    let shifted = bits.wrapping_add(0x3f80_0000 - 0x3f35_04f3);
    let e = (shifted >> 23) as i32 - 127 - if tiny { 23 } else { 0 };
    let m = f32::from_bits((shifted & 0x007f_ffff) + 0x3f35_04f3);
    let r = m - 1.0;
    let mut p = 7.037_683_6e-2_f32;
    p = p * r - 1.151_461e-1;
    p = p * r + 1.167_699_9e-1;
    p = p * r - 1.242_014_1e-1;
    p = p * r + 1.424_932_3e-1;
    p = p * r - 1.666_805_8e-1;
    p = p * r + 2.000_071_5e-1;
    p = p * r - 2.499_999_4e-1;
    p = p * r + 3.333_333e-1;
    let square = r * r;
    let tail = p * r * square - 0.5 * square;
    (r, tail, e as f32)
}

/// The value of a logarithm where the series does not apply: 0, negative numbers, infinity, NaN.
#[inline(always)]
fn log_special(x: f32, value: f32) -> f32 {
    let value = if x == f32::INFINITY { x } else { value };
    let value = if x == 0.0 { f32::NEG_INFINITY } else { value };
    if x >= 0.0 { value } else { f32::NAN }
}

/// Base-2 logarithm: -infinity at 0, NaN below.
#[inline(always)]
pub fn log2(x: f32) -> f32 {
    let (r, tail, e) = log_parts(x);
    // log2(e) - 1: the parts with weight 1 are added last, where they cost no accuracy.
    const LOG2_E_LESS_1: f32 = 0.442_695_04;
    let small = tail * LOG2_E_LESS_1 + r * LOG2_E_LESS_1;
    log_special(x, small + tail + r + e)
}

/// Natural logarithm: -infinity at 0, NaN below.
#[inline(always)]
pub fn log(x: f32) -> f32 {
    let (r, tail, e) = log_parts(x);
    let tail = tail + e * -2.121_944_4e-4;
    log_special(x, r + tail + e * 0.693_359_4)
}

/// x^y as `exp2(y * log2(x))`; 1 where y is 0; NaN for negative x.
#[inline(always)]
pub fn pow(x: f32, y: f32) -> f32 {
    let value = exp2(y * log2(x));
    if y == 0.0 { 1.0 } else { value }
}
