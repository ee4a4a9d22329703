//! Circular functions and their inverses.

use super::{round_small, round_small_i32};
use core::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI};

/// Up to this magnitude three parts of pi/2 reduce an argument to full accuracy; beyond it `libm` does.
pub(super) const REDUCIBLE: f32 = 8192.0;

/// The argument less the nearest multiple of pi/2, and which multiple, modulo 4 in the low bits.
#[inline(always)]
fn reduce(x: f32) -> (f32, i32) {
    let t = x * core::f32::consts::FRAC_2_PI;
    let n = round_small(t);
    // The first two parts have few bits, so their products with n (below 2^13) are exact.
    let r = ((x - n * 1.570_312_5) - n * 4.837_513e-4) - n * 7.549_79e-8;
    (r, round_small_i32(t))
}

/// Sine of a reduced argument, |r| <= pi/4.
#[inline(always)]
fn sin_kernel(r: f32) -> f32 {
    let z = r * r;
    let mut p = -1.951_529_6e-4_f32;
    p = p * z + 8.332_161e-3;
    p = p * z - 1.666_665_5e-1;
    p * z * r + r
}

/// Cosine of a reduced argument, |r| <= pi/4.
#[inline(always)]
fn cos_kernel(r: f32) -> f32 {
    let z = r * r;
    let mut p = 2.443_315_7e-5_f32;
    p = p * z - 1.388_731_6e-3;
    p = p * z + 4.166_664_6e-2;
    p * z * z - 0.5 * z + 1.0
}

/// The quarter turn `quadrant` of the sine, given a reduced argument.
#[inline(always)]
fn turned(r: f32, quadrant: i32) -> f32 {
    let (s, c) = (sin_kernel(r), cos_kernel(r));
    let value = if quadrant & 1 == 0 { s } else { c };
    f32::from_bits(value.to_bits() ^ ((quadrant as u32 & 2) << 30))
}

/// Sine where |x| <= [`REDUCIBLE`]; unspecified elsewhere.
#[inline(always)]
pub(super) fn sin_small(x: f32) -> f32 {
    let (r, n) = reduce(x);
    turned(r, n)
}

/// Cosine where |x| <= [`REDUCIBLE`]; unspecified elsewhere.
#[inline(always)]
pub(super) fn cos_small(x: f32) -> f32 {
    let (r, n) = reduce(x);
    turned(r, n.wrapping_add(1))
}

/// Tangent where |x| <= [`REDUCIBLE`]; unspecified elsewhere.
#[inline(always)]
pub(super) fn tan_small(x: f32) -> f32 {
    let (r, n) = reduce(x);
    turned(r, n) / turned(r, n.wrapping_add(1))
}

/// Sine; NaN for infinities.
#[inline(always)]
pub fn sin(x: f32) -> f32 {
    if x.abs() <= REDUCIBLE { sin_small(x) } else { libm::sinf(x) }
}

/// Cosine; NaN for infinities.
#[inline(always)]
pub fn cos(x: f32) -> f32 {
    if x.abs() <= REDUCIBLE { cos_small(x) } else { libm::cosf(x) }
}

/// Tangent; NaN for infinities.
#[inline(always)]
pub fn tan(x: f32) -> f32 {
    if x.abs() <= REDUCIBLE { tan_small(x) } else { libm::tanf(x) }
}

/// Arc sine of 0 <= a <= 0.5, given its square.
#[inline(always)]
fn asin_kernel(a: f32, z: f32) -> f32 {
    let mut p = 4.216_32e-2_f32;
    p = p * z + 2.418_131e-2;
    p = p * z + 4.547_002_6e-2;
    p = p * z + 7.495_300_3e-2;
    p = p * z + 1.666_675_2e-1;
    p * z * a + a
}

/// Arc sine in [-pi/2, pi/2]; NaN outside [-1, 1].
#[inline(always)]
pub fn asin(x: f32) -> f32 {
    let a = x.abs();
    let outer = a > 0.5;
    let z = if outer { 0.5 * (1.0 - a) } else { a * a };
    let root = if outer { z.sqrt() } else { a };
    let k = asin_kernel(root, z);
    let value = if outer { FRAC_PI_2 - (k + k) } else { k };
    value.copysign(x)
}

/// Arc cosine in [0, pi]; NaN outside [-1, 1].
#[inline(always)]
pub fn acos(x: f32) -> f32 {
    let a = x.abs();
    let outer = a > 0.5;
    let z = if outer { 0.5 * (1.0 - a) } else { a * a };
    let root = if outer { z.sqrt() } else { a };
    let k = asin_kernel(root, z);
    let far = if x < 0.0 { PI - (k + k) } else { k + k };
    if outer { far } else { FRAC_PI_2 - k.copysign(x) }
}

/// Arc tangent of a number that is not negative.
#[inline(always)]
fn atan_positive(a: f32) -> f32 {
    let (far, middle) = (a > 2.414_213_6, a > 0.414_213_57);
    let reduced = if far {
        -1.0 / a
    } else if middle {
        (a - 1.0) / (a + 1.0)
    } else {
        a
    };
    let base = if far {
        FRAC_PI_2
    } else if middle {
        FRAC_PI_4
    } else {
        0.0
    };
    let z = reduced * reduced;
    let mut p = 8.053_745e-2_f32;
    p = p * z - 1.387_768_6e-1;
    p = p * z + 1.997_771_1e-1;
    p = p * z - 3.333_295e-1;
    base + (p * z * reduced + reduced)
}

/// Arc tangent in [-pi/2, pi/2].
#[inline(always)]
pub fn atan(x: f32) -> f32 {
    atan_positive(x.abs()).copysign(x)
}

/// Angle of the point (x, y) in [-pi, pi]; 0 at the origin with x >= 0, signs of zeros as in IEEE 754.
#[inline(always)]
pub fn atan2(y: f32, x: f32) -> f32 {
    let (ay, ax) = (y.abs(), x.abs());
    let (low, high) = if ay > ax { (ax, ay) } else { (ay, ax) };
    // Equal magnitudes are one eighth of a turn, two infinities included; two zeros are none.
    let ratio = if low == high { 1.0 } else { low / high };
    let ratio = if high == 0.0 { 0.0 } else { ratio };
    let base = atan_positive(ratio);
    let base = if ay > ax { FRAC_PI_2 - base } else { base };
    let base = if x.is_sign_negative() { PI - base } else { base };
    let value = if x.is_nan() || y.is_nan() { f32::NAN } else { base };
    value.copysign(y)
}
