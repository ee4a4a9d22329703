//! The blend equation: factors taken apart, and a channel of it over any number of pixels.

use super::Colors;
use super::number::Number;
use crate::state::{BlendComponent, BlendFactor, BlendOp};

/// Which colour a factor names.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Operand {
    Source,
    Stored,
    /// The second output of the fragment shader.
    Second,
    Constant,
}

/// A factor of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Weight {
    Zero,
    One,
    /// The lesser of the source's alpha and what the stored alpha lacks to 1.
    Saturated,
    /// A number of a colour.
    Of {
        operand: Operand,
        /// Whether it is the colour's alpha, else its number of the same channel.
        alpha: bool,
        /// Whether what the number lacks to 1 is meant.
        rest: bool,
    },
}

impl Weight {
    /// The factor of the colour's channels, or of alpha (`is_alpha`).
    #[inline(always)]
    pub(super) fn new(factor: BlendFactor, is_alpha: bool) -> Weight {
        use Operand::{Constant, Second, Source, Stored};
        let (operand, alpha, rest) = match factor {
            BlendFactor::Zero => return Weight::Zero,
            BlendFactor::One => return Weight::One,
            BlendFactor::SrcAlphaSaturated => return if is_alpha { Weight::One } else { Weight::Saturated },
            BlendFactor::Src => (Source, false, false),
            BlendFactor::OneMinusSrc => (Source, false, true),
            BlendFactor::SrcAlpha => (Source, true, false),
            BlendFactor::OneMinusSrcAlpha => (Source, true, true),
            BlendFactor::Dst => (Stored, false, false),
            BlendFactor::OneMinusDst => (Stored, false, true),
            BlendFactor::DstAlpha => (Stored, true, false),
            BlendFactor::OneMinusDstAlpha => (Stored, true, true),
            BlendFactor::Src1 => (Second, false, false),
            BlendFactor::OneMinusSrc1 => (Second, false, true),
            BlendFactor::Src1Alpha => (Second, true, false),
            BlendFactor::OneMinusSrc1Alpha => (Second, true, true),
            BlendFactor::Constant => (Constant, false, false),
            BlendFactor::OneMinusConstant => (Constant, false, true),
        };
        Weight::Of { operand, alpha, rest }
    }
}

/// One channel of the blend equation for `N` pixels.
#[inline(always)]
pub(super) fn blend_channel<T: Number, const N: usize>(
    c: usize,
    blend: BlendComponent,
    constant: &[T; 4],
    src: &Colors<N, T>,
    src1: &Colors<N, T>,
    dst: &Colors<N, T>,
    out: &mut [T; N],
) {
    // Plain loops rather than array adaptors: they take on the instruction set of the function they are inlined into.
    let (s, d) = (&src[c], &dst[c]);
    match blend.op {
        BlendOp::Min => {
            for i in 0..N {
                out[i] = if s[i] < d[i] { s[i] } else { d[i] };
            }
        }
        BlendOp::Max => {
            for i in 0..N {
                out[i] = if s[i] > d[i] { s[i] } else { d[i] };
            }
        }
        _ => {
            let mut other = [T::ZERO; N];
            weigh(blend.src, s, c, constant, src, src1, dst, out);
            weigh(blend.dst, d, c, constant, src, src1, dst, &mut other);
            match blend.op {
                BlendOp::Subtract => {
                    for i in 0..N {
                        out[i] = out[i].minus(other[i]);
                    }
                }
                BlendOp::ReverseSubtract => {
                    for i in 0..N {
                        out[i] = other[i].minus(out[i]);
                    }
                }
                _ => {
                    for i in 0..N {
                        out[i] = out[i].plus(other[i]);
                    }
                }
            }
        }
    }
}

/// A channel times its factor. Factors 0 and 1 are exact even for infinities and NaN, as if the term were absent or bare.
#[inline(always)]
fn weigh<T: Number, const N: usize>(
    factor: BlendFactor,
    x: &[T; N],
    c: usize,
    constant: &[T; 4],
    src: &Colors<N, T>,
    src1: &Colors<N, T>,
    dst: &Colors<N, T>,
    out: &mut [T; N],
) {
    let constant = [constant[c]; N];
    let mut saturated = [T::ZERO; N];
    let (numbers, rest) = match Weight::new(factor, c == 3) {
        Weight::Zero => {
            *out = [T::ZERO; N];
            return;
        }
        Weight::One => {
            *out = *x;
            return;
        }
        Weight::Saturated => {
            for i in 0..N {
                let (a, rest) = (src[3][i], dst[3][i].complement());
                saturated[i] = if a < rest { a } else { rest };
            }
            (&saturated, false)
        }
        Weight::Of { operand, alpha, rest } => {
            let channel = if alpha { 3 } else { c };
            let numbers = match operand {
                Operand::Source => &src[channel],
                Operand::Stored => &dst[channel],
                Operand::Second => &src1[channel],
                Operand::Constant => &constant,
            };
            (numbers, rest)
        }
    };
    if rest {
        for i in 0..N {
            out[i] = x[i].times(numbers[i].complement());
        }
    } else {
        for i in 0..N {
            out[i] = x[i].times(numbers[i]);
        }
    }
}
