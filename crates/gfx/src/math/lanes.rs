//! The functions of [`super`] over the 64 lanes of a batch.
//!
//! All are `#[inline(always)]`: they take on the instruction set of the function that calls them. Inactive lanes are computed
//! like any others, which costs nothing and cannot trap.

use super::trigonometric::{REDUCIBLE, cos_small, sin_small, tan_small};
use num::{LANES, Lanes};

/// Applies a function of one number to every lane.
#[inline(always)]
pub fn map(x: &Lanes, out: &mut Lanes, f: impl Fn(f32) -> f32) {
    let (x, out) = (x.f32(), out.f32_mut());
    for i in 0..LANES {
        out[i] = f(x[i]);
    }
}

/// Applies a function of two numbers to every lane.
#[inline(always)]
pub fn map2(x: &Lanes, y: &Lanes, out: &mut Lanes, f: impl Fn(f32, f32) -> f32) {
    let (x, y, out) = (x.f32(), y.f32(), out.f32_mut());
    for i in 0..LANES {
        out[i] = f(x[i], y[i]);
    }
}

/// A function that is fast for reducible arguments, and `slow` for the lanes where some are not.
#[inline(always)]
fn reducible(x: &Lanes, out: &mut Lanes, fast: impl Fn(f32) -> f32, slow: impl Fn(f32) -> f32) {
    map(x, out, fast);
    let (x, out) = (x.f32(), out.f32_mut());
    // A sum instead of `any`: without an early exit the loop is a few vector instructions. NaN counts as not reducible.
    let far: u32 = x.iter().map(|v| u32::from(v.abs() > REDUCIBLE || v.is_nan())).sum();
    if far != 0 {
        for i in 0..LANES {
            if x[i].abs() > REDUCIBLE || x[i].is_nan() {
                out[i] = slow(x[i]);
            }
        }
    }
}

macro_rules! unary {
    ($($name:ident)*) => {$(
        #[doc = concat!("[`super::", stringify!($name), "`] of every lane.")]
        #[inline(always)]
        pub fn $name(x: &Lanes, out: &mut Lanes) {
            map(x, out, super::$name);
        }
    )*};
}

unary! { exp exp2 log log2 asin acos atan inverse_sqrt sinh cosh tanh asinh acosh atanh }

/// Sine of every lane.
#[inline(always)]
pub fn sin(x: &Lanes, out: &mut Lanes) {
    reducible(x, out, sin_small, libm::sinf);
}

/// Cosine of every lane.
#[inline(always)]
pub fn cos(x: &Lanes, out: &mut Lanes) {
    reducible(x, out, cos_small, libm::cosf);
}

/// Tangent of every lane.
#[inline(always)]
pub fn tan(x: &Lanes, out: &mut Lanes) {
    reducible(x, out, tan_small, libm::tanf);
}

/// Square root of every lane, correctly rounded.
#[inline(always)]
pub fn sqrt(x: &Lanes, out: &mut Lanes) {
    map(x, out, f32::sqrt);
}

/// [`super::pow`] of every lane.
#[inline(always)]
pub fn pow(x: &Lanes, y: &Lanes, out: &mut Lanes) {
    map2(x, y, out, super::pow);
}

/// [`super::atan2`] of every lane.
#[inline(always)]
pub fn atan2(y: &Lanes, x: &Lanes, out: &mut Lanes) {
    map2(y, x, out, super::atan2);
}
