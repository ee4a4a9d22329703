//! Transcendental functions: one portable implementation, the same bits on every host.
//!
//! Only `+ - * /`, `sqrt`, comparisons and integer operations occur, all of which IEEE 754 and Rust define to the bit; there is
//! no fused multiply-add. Scalar functions are branch-free where they can be, so that the loops of [`lanes`] autovectorise with
//! whatever instructions their caller was compiled for.
//!
//! Polynomials are those of the Cephes library (S. L. Moshier, single precision); rare functions come from `libm`.
//! Worst errors against f64, over the ranges that the tests sweep:
//!
//! | function | bound tested | required (WGSL) |
//! |---|---|---|
//! | `exp2`, `exp` | 2 ULP | 3 + 2 \|x\| ULP |
//! | `log2`, `log` | 2 ULP; 2^-22 absolute in \[0.5, 2\] | 3 ULP; 2^-21 |
//! | `sin`, `cos` | 2^-22 absolute in \[-8192, 8192\] | 2^-11 in \[-pi, pi\] |
//! | `inverse_sqrt` | 2 ULP | 2 ULP |
//! | `asin`, `acos`, `atan`, `atan2` | 4 ULP, or 2^-22 absolute | 2^-10 relative or so |
//! | `pow` | as `exp2(y * log2(x))` | the same |

mod exponential;
pub mod lanes;
mod trigonometric;

#[cfg(test)]
mod tests;

pub use exponential::{exp, exp2, log, log2, pow};
pub use trigonometric::{acos, asin, atan, atan2, cos, sin, tan};

/// 1.5 * 2^23: added to and subtracted from a number of magnitude below 2^22 it rounds to the nearest integer, ties to even.
const ROUND: f32 = 12_582_912.0;

/// The nearest integer, ties to even, of a number of magnitude below 2^22. `f32::round_ties_even` is a library call on hosts
/// without a rounding instruction; this is two additions everywhere.
#[inline(always)]
pub(crate) fn round_small(x: f32) -> f32 {
    (x + ROUND) - ROUND
}

/// As [`round_small`], as an integer; NaN and numbers out of range give an unspecified but deterministic integer.
#[inline(always)]
pub(crate) fn round_small_i32(x: f32) -> i32 {
    (x + ROUND).to_bits().wrapping_sub(ROUND.to_bits()) as i32
}

/// 1 / sqrt(x), two roundings: at most 1.5 ULP.
#[inline(always)]
pub fn inverse_sqrt(x: f32) -> f32 {
    1.0 / x.sqrt()
}

/// Hyperbolic sine.
pub fn sinh(x: f32) -> f32 {
    libm::sinhf(x)
}

/// Hyperbolic cosine.
pub fn cosh(x: f32) -> f32 {
    libm::coshf(x)
}

/// Hyperbolic tangent.
pub fn tanh(x: f32) -> f32 {
    libm::tanhf(x)
}

/// Inverse hyperbolic sine.
pub fn asinh(x: f32) -> f32 {
    libm::asinhf(x)
}

/// Inverse hyperbolic cosine; NaN below 1.
pub fn acosh(x: f32) -> f32 {
    libm::acoshf(x)
}

/// Inverse hyperbolic tangent; NaN outside [-1, 1].
pub fn atanh(x: f32) -> f32 {
    libm::atanhf(x)
}
