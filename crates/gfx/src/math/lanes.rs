//! The functions of [`super`] over the lanes of a batch, or of a part of it.
//!
//! All are `#[inline(always)]`: they take on the instruction set of the function that calls them. Inactive lanes are computed
//! like any others, which costs nothing and cannot trap.

use super::trigonometric::{REDUCIBLE, cos_small, sin_small, tan_small};

/// Applies a function of one number to every lane.
#[inline(always)]
fn map<const N: usize>(x: &[f32; N], out: &mut [f32; N], f: impl Fn(f32) -> f32) {
    for i in 0..N {
        out[i] = f(x[i]);
    }
}

/// Applies a function of two numbers to every lane.
#[inline(always)]
fn map2<const N: usize>(x: &[f32; N], y: &[f32; N], out: &mut [f32; N], f: impl Fn(f32, f32) -> f32) {
    for i in 0..N {
        out[i] = f(x[i], y[i]);
    }
}

/// A function that is fast for reducible arguments, and `slow` for the lanes where some are not.
#[inline(always)]
fn reducible<const N: usize>(x: &[f32; N], out: &mut [f32; N], fast: impl Fn(f32) -> f32, slow: impl Fn(f32) -> f32) {
    map(x, out, fast);
    // A sum instead of `any`: without an early exit the loop is a few vector instructions. NaN counts as not reducible.
    let far: u32 = x.iter().map(|v| u32::from(v.abs() > REDUCIBLE || v.is_nan())).sum();
    if far != 0 {
        for i in 0..N {
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
        pub fn $name<const N: usize>(x: &[f32; N], out: &mut [f32; N]) {
            map(x, out, super::$name);
        }
    )*};
}

unary! { exp exp2 log log2 asin acos atan inverse_sqrt sinh cosh tanh asinh acosh atanh }

/// Sine of every lane.
#[inline(always)]
pub fn sin<const N: usize>(x: &[f32; N], out: &mut [f32; N]) {
    reducible(x, out, sin_small, libm::sinf);
}

/// Cosine of every lane.
#[inline(always)]
pub fn cos<const N: usize>(x: &[f32; N], out: &mut [f32; N]) {
    reducible(x, out, cos_small, libm::cosf);
}

/// Tangent of every lane.
#[inline(always)]
pub fn tan<const N: usize>(x: &[f32; N], out: &mut [f32; N]) {
    reducible(x, out, tan_small, libm::tanf);
}

/// Square root of every lane, correctly rounded.
#[inline(always)]
pub fn sqrt<const N: usize>(x: &[f32; N], out: &mut [f32; N]) {
    map(x, out, f32::sqrt);
}

/// [`super::pow`] of every lane.
#[inline(always)]
pub fn pow<const N: usize>(x: &[f32; N], y: &[f32; N], out: &mut [f32; N]) {
    map2(x, y, out, super::pow);
}

/// [`super::atan2`] of every lane.
#[inline(always)]
pub fn atan2<const N: usize>(y: &[f32; N], x: &[f32; N], out: &mut [f32; N]) {
    map2(y, x, out, super::atan2);
}
