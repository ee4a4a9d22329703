//! The instruction set: its codes, what the arithmetic ones compute for one lane, and what each counts as.
//!
//! The scalar functions here are the only definition of arithmetic: the compiler folds constants with them and the executor
//! applies them to whole registers, so a value does not depend on where it was computed.

use gfx::math;
use work::Class;

/// The arithmetic of one lane, on bits. WGSL's rules for what other languages leave undefined: integer division by zero gives
/// the dividend, its remainder 0; shifts use the low five bits; float-to-integer conversion saturates, NaN gives 0.
pub(super) mod eval {
    use super::math;

    #[inline(always)]
    pub fn f(x: u32) -> f32 {
        f32::from_bits(x)
    }

    #[inline(always)]
    pub fn u(x: f32) -> u32 {
        x.to_bits()
    }

    /// Minimum, where one NaN loses.
    #[inline(always)]
    pub fn fmin(a: f32, b: f32) -> f32 {
        if a < b || b.is_nan() { a } else { b }
    }

    /// Maximum, where one NaN loses.
    #[inline(always)]
    pub fn fmax(a: f32, b: f32) -> f32 {
        if a > b || b.is_nan() { a } else { b }
    }

    #[inline(always)]
    pub fn sign(x: f32) -> f32 {
        if x > 0.0 {
            1.0
        } else if x < 0.0 {
            -1.0
        } else {
            0.0
        }
    }

    #[inline(always)]
    pub fn div_s(a: i32, b: i32) -> i32 {
        if b == 0 || (a == i32::MIN && b == -1) { a } else { a.wrapping_div(b) }
    }

    #[inline(always)]
    pub fn rem_s(a: i32, b: i32) -> i32 {
        if b == 0 || b == -1 { 0 } else { a.wrapping_rem(b) }
    }

    /// Bits of `half` nearest to `x`, ties to even; too large becomes infinity.
    #[inline(always)]
    pub fn to_half(x: f32) -> u32 {
        let bits = x.to_bits();
        let sign = bits >> 16 & 0x8000;
        let magnitude = bits & 0x7fff_ffff;
        // Normal results: rebias the exponent and round at bit 13.
        let normal = (magnitude.wrapping_sub(112 << 23).wrapping_add(0xfff + (magnitude >> 13 & 1))) >> 13;
        // Subnormal results: an addition whose sum has its last bit where the half's last bit is.
        let magic = f32::from_bits(126 << 23);
        let subnormal = (f32::from_bits(magnitude) + magic).to_bits().wrapping_sub(126 << 23);
        let finite = if magnitude < 113 << 23 { subnormal } else { normal };
        let out = if magnitude > 0x7f80_0000 {
            0x7e00
        } else if magnitude >= 0x4780_0000 {
            0x7c00
        } else {
            finite
        };
        sign | out
    }

    /// The number whose `half` bits are the low 16 of `h`.
    #[inline(always)]
    pub fn from_half(h: u32) -> f32 {
        let sign = (h & 0x8000) << 16;
        let magnitude = h & 0x7fff;
        let normal = (magnitude << 13).wrapping_add(112 << 23);
        let special = (magnitude << 13) | 0x7f80_0000;
        let subnormal = (magnitude as f32 * f32::from_bits(103 << 23)).to_bits();
        let out = if magnitude >= 0x7c00 {
            special
        } else if magnitude >= 0x400 {
            normal
        } else {
            subnormal
        };
        f32::from_bits(sign | out)
    }

    /// The significand of `x` with magnitude in [0.5, 1); zero, infinity and NaN stay.
    #[inline(always)]
    pub fn frexp_fraction(x: f32) -> f32 {
        let scaled = if x.abs() < f32::MIN_POSITIVE { x * 16_777_216.0 } else { x };
        if x == 0.0 || !x.is_finite() { x } else { f32::from_bits(scaled.to_bits() & 0x807f_ffff | 126 << 23) }
    }

    /// The exponent that belongs to [`frexp_fraction`]; 0 for zero, infinity and NaN.
    #[inline(always)]
    pub fn frexp_exponent(x: f32) -> i32 {
        let tiny = x.abs() < f32::MIN_POSITIVE;
        let scaled = if tiny { x * 16_777_216.0 } else { x };
        let e = (scaled.to_bits() >> 23 & 255) as i32 - 126 - if tiny { 24 } else { 0 };
        if x == 0.0 || !x.is_finite() { 0 } else { e }
    }

    /// `x` times 2 to the power `e`, in steps that are exact until the last.
    #[inline(always)]
    pub fn ldexp(x: f32, e: i32) -> f32 {
        let e = e.clamp(-300, 300);
        let part = |e: i32| f32::from_bits(((e.clamp(-126, 127) + 127) as u32) << 23);
        let first = e.clamp(-126, 127);
        let second = (e - first).clamp(-126, 127);
        let third = e - first - second;
        // The largest step comes last. Only that product can round: where a smaller one before it rounds, the number is so small
        // that zero is left in the end. (The largest step first would make numbers subnormal, and the next one round again.)
        x * part(third) * part(second) * part(first)
    }

    #[inline(always)]
    pub fn extract_u(e: u32, offset: u32, count: u32) -> u32 {
        let o = offset.min(32);
        let c = count.min(32 - o);
        if c == 0 { 0 } else { e << (32 - c - o) >> (32 - c) }
    }

    #[inline(always)]
    pub fn extract_s(e: i32, offset: u32, count: u32) -> i32 {
        let o = offset.min(32);
        let c = count.min(32 - o);
        if c == 0 { 0 } else { e << (32 - c - o) >> (32 - c) }
    }

    /// The bits that `insertBits` replaces.
    #[inline(always)]
    pub fn field_mask(offset: u32, count: u32) -> u32 {
        let o = offset.min(32);
        let c = count.min(32 - o);
        if c == 0 { 0 } else { (u32::MAX >> (32 - c)) << o }
    }

    #[inline(always)]
    pub fn dot4_u8(a: u32, b: u32) -> u32 {
        let p = |k: u32| (a >> k & 255) * (b >> k & 255);
        p(0) + p(8) + p(16) + p(24)
    }

    #[inline(always)]
    pub fn dot4_i8(a: u32, b: u32) -> i32 {
        let e = |x: u32, k: u32| (x << (24 - k)) as i32 >> 24;
        let p = |k: u32| e(a, k) * e(b, k);
        p(0) + p(8) + p(16) + p(24)
    }

    /// The greatest `f16`.
    const HALF_MAX: f32 = 65_504.0;

    /// A number between two others; 0 for NaN. Selections, of which the compiler makes vector instructions.
    #[inline(always)]
    fn within(x: f32, low: f32, high: f32) -> f32 {
        let x = if high < x { high } else { x };
        let x = if low > x { low } else { x };
        if x.is_nan() { 0.0 } else { x }
    }

    /// WGSL's conversion of an `f32`: towards zero, and beyond the range of the integers to the last of them that an `f32` can be.
    /// That is less than `i32::MAX`, with which `x as i32` ends. NaN becomes 0.
    #[inline(always)]
    pub fn to_s(x: f32) -> i32 {
        /// The greatest `f32` below 2^31.
        const LAST: f32 = 2_147_483_520.0;
        (if x > LAST { LAST } else { x }) as i32
    }

    /// As [`to_s`], without a choice that the compiler could make a branch of.
    #[inline(always)]
    pub fn to_u(x: f32) -> u32 {
        const HALF: f32 = 2_147_483_648.0;
        /// The greatest `f32` below 2^32.
        const LAST: f32 = 4_294_967_040.0;
        let x = if x > 0.0 { x } else { 0.0 };
        let x = if x < LAST { x } else { LAST };
        let upper = u32::from(x >= HALF).wrapping_neg();
        // Exact: both are multiples of 128 there.
        let rest = x - f32::from_bits(upper & HALF.to_bits());
        rest as i32 as u32 ^ upper & 0x8000_0000
    }

    /// WGSL's conversion of an `f16`: an infinity becomes the integer of the last finite `f16`.
    #[inline(always)]
    pub fn half_to_s(x: f32) -> i32 {
        to_s(within(x, -HALF_MAX, HALF_MAX))
    }

    /// As [`half_to_s`].
    #[inline(always)]
    pub fn half_to_u(x: f32) -> u32 {
        to_s(within(x, 0.0, HALF_MAX)) as u32
    }

    /// Nearest integer to `x` clamped to [low, high], scaled; NaN as the lower bound.
    #[inline(always)]
    pub fn to_norm(x: f32, low: f32, scale: f32) -> u32 {
        let x = if x > low { x } else { low };
        let x = if x < 1.0 { x } else { 1.0 };
        to_s((0.5 + x * scale).floor()) as u32
    }

    pub use math::*;
}

macro_rules! codes {
    (
        unary { $($un:ident $unc:ident |$ux:ident| $ue:expr;)* }
        heavy1 { $($h1:ident $h1w:literal $h1f:ident;)* }
        binary { $($bi:ident $bic:ident |$ba:ident, $bb:ident| $be:expr;)* }
        ternary { $($te:ident $tec:ident |$ta:ident, $tb:ident, $tc:ident| $tex:expr;)* }
        other { $($(#[$od:meta])* $ot:ident $otc:ident $otn:literal;)* }
    ) => {
        /// Operation codes.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
        #[repr(u16)]
        pub(super) enum Code {
            $($un,)* $($h1,)* $($bi,)* $($te,)* $($(#[$od])* $ot,)*
        }

        impl Code {
            /// The class and number of machine instructions it counts as.
            pub fn weight(self) -> (Class, u32) {
                match self {
                    $(Code::$un => (Class::$unc, 1),)*
                    $(Code::$h1 => (Class::Special, $h1w),)*
                    $(Code::$bi => (Class::$bic, 1),)*
                    $(Code::$te => (Class::$tec, 1),)*
                    $(Code::$ot => (Class::$otc, $otn),)*
                }
            }

            /// What it counts as work of the host, in steps: about the time of one addition of a batch. None is free, so that no loop is.
            pub fn steps(self) -> u64 {
                match self {
                    Code::Texture | Code::TextureStore | Code::TextureAtomic | Code::Atomic => 64,
                    Code::Subgroup => 32,
                    Code::Load | Code::Store => 24,
                    Code::LoadIndexed | Code::StoreIndexed | Code::LoadConst => 8,
                    code => u64::from(code.weight().1.max(1)),
                }
            }

            /// Whether the result depends on the operands alone, lane by lane, so that it may be folded, shared and moved.
            pub fn is_pure(self) -> bool {
                matches!(self, $(Code::$un)|* $(| Code::$h1)* $(| Code::$bi)* $(| Code::$te)*
                    | Code::Pow | Code::Atan2 | Code::Dot2 | Code::Dot3 | Code::Dot4 | Code::Normalize2 | Code::Normalize3
                    | Code::MulAdd | Code::MulSub | Code::NegMulAdd)
            }

            /// The value of a pure operation with one result on constants; none for the others.
            pub fn fold(self, s: &[u32]) -> Option<u32> {
                #[allow(unused_imports)]
                use eval::{f, u};
                Some(match self {
                    $(Code::$un => { let $ux = s[0]; $ue })*
                    $(Code::$h1 => u(eval::$h1f(f(s[0]))),)*
                    $(Code::$bi => { let ($ba, $bb) = (s[0], s[1]); $be })*
                    $(Code::$te => { let ($ta, $tb, $tc) = (s[0], s[1], s[2]); $tex })*
                    Code::Pow => u(eval::pow(f(s[0]), f(s[1]))),
                    Code::Atan2 => u(eval::atan2(f(s[0]), f(s[1]))),
                    Code::MulAdd => u(f(s[0]) * f(s[1]) + f(s[2])),
                    Code::MulSub => u(f(s[0]) * f(s[1]) - f(s[2])),
                    Code::NegMulAdd => u(f(s[2]) - f(s[0]) * f(s[1])),
                    Code::Dot2 => u(f(s[0]) * f(s[2]) + f(s[1]) * f(s[3])),
                    Code::Dot3 => u(f(s[0]) * f(s[3]) + f(s[1]) * f(s[4]) + f(s[2]) * f(s[5])),
                    Code::Dot4 => u(f(s[0]) * f(s[4]) + f(s[1]) * f(s[5]) + f(s[2]) * f(s[6]) + f(s[3]) * f(s[7])),
                    _ => return None,
                })
            }
        }

        /// Runs `$body` style kernels for every arithmetic code: the executor's half of the table.
        #[inline(always)]
        pub(super) fn arithmetic<K: Kernels>(code: Code, k: &K) -> bool {
            #[allow(unused_imports)]
            use eval::{f, u};
            match code {
                $(Code::$un => k.unary(#[inline(always)] |$ux| $ue),)*
                $(Code::$h1 => k.heavy(#[inline(always)] |x, out| math::lanes::$h1f(x, out)),)*
                $(Code::$bi => k.binary(#[inline(always)] |$ba, $bb| $be),)*
                $(Code::$te => k.ternary(#[inline(always)] |$ta, $tb, $tc| $tex),)*
                _ => return false,
            }
            true
        }
    };
}

impl Code {
    /// Whether the execution mask may change here, or a request is made: where costs are accounted.
    pub fn breaks_block(self) -> bool {
        use Code as C;
        matches!(
            self,
            C::Load
                | C::Store
                | C::Atomic
                | C::Texture
                | C::TextureStore
                | C::TextureAtomic
                | C::If
                | C::Else
                | C::EndIf
                | C::RegionBegin
                | C::RegionEnd
                | C::LoopBegin
                | C::Continuing
                | C::LoopEnd
                | C::LoopEndIf
                | C::Exit
                | C::BreakIf
                | C::BreakIfNot
                | C::Continue
                | C::Discard
                | C::Barrier
                | C::End
        )
    }
}

/// Lanes that a kernel takes at once: one 256-bit register.
pub(super) const CHUNK: usize = 8;

/// How the executor applies a lane function to whole registers.
pub(super) trait Kernels {
    /// One operand.
    fn unary(&self, f: impl Fn(u32) -> u32);
    /// Two operands.
    fn binary(&self, f: impl Fn(u32, u32) -> u32);
    /// Three operands.
    fn ternary(&self, f: impl Fn(u32, u32, u32) -> u32);
    /// One operand, a long function over some lanes at once.
    fn heavy(&self, f: impl Fn(&[f32; CHUNK], &mut [f32; CHUNK]));
}

codes! {
    unary {
        FNeg Float |x| x ^ 0x8000_0000;
        FAbs Float |x| x & 0x7fff_ffff;
        FFloor Float |x| u(f(x).floor());
        FCeil Float |x| u(f(x).ceil());
        FRound Float |x| u(f(x).round_ties_even());
        FTrunc Float |x| u(f(x).trunc());
        FFract Float |x| u(f(x) - f(x).floor());
        FSign Float |x| u(eval::sign(f(x)));
        FSaturate Float |x| u(eval::fmin(eval::fmax(f(x), 0.0), 1.0));
        FSqrt Special |x| u(f(x).sqrt());
        FInvSqrt Special |x| u(1.0 / f(x).sqrt());
        FIsNan Float |x| u32::from(x & 0x7fff_ffff > 0x7f80_0000);
        FIsInf Float |x| u32::from(x & 0x7fff_ffff == 0x7f80_0000);
        Quantize Float |x| u(eval::from_half(eval::to_half(f(x))));
        ToHalf Float |x| eval::to_half(f(x));
        FromHalf Float |x| u(eval::from_half(x & 0xffff));
        ToSnorm8 Float |x| eval::to_norm(f(x), -1.0, 127.0) & 0xff;
        ToUnorm8 Float |x| eval::to_norm(f(x), 0.0, 255.0) & 0xff;
        ToSnorm16 Float |x| eval::to_norm(f(x), -1.0, 32767.0) & 0xffff;
        ToUnorm16 Float |x| eval::to_norm(f(x), 0.0, 65535.0) & 0xffff;
        FrexpFraction Float |x| u(eval::frexp_fraction(f(x)));
        FrexpExponent Integer |x| eval::frexp_exponent(f(x)) as u32;
        FToS Float |x| eval::to_s(f(x)) as u32;
        FToU Float |x| eval::to_u(f(x));
        HalfToS Float |x| eval::half_to_s(f(x)) as u32;
        HalfToU Float |x| eval::half_to_u(f(x));
        SToF Float |x| u(x as i32 as f32);
        UToF Float |x| u(x as f32);
        FToBool Float |x| u32::from(f(x) != 0.0);
        IToBool Integer |x| u32::from(x != 0);
        BoolToF Float |x| if x != 0 { 0x3f80_0000 } else { 0 };
        INeg Integer |x| x.wrapping_neg();
        INot Integer |x| !x;
        BNot Integer |x| x ^ 1;
        IAbs Integer |x| (x as i32).wrapping_abs() as u32;
        ISign Integer |x| u32::from(x as i32 > 0).wrapping_sub(x >> 31);
        Clz Integer |x| x.leading_zeros();
        Ctz Integer |x| x.trailing_zeros();
        PopCount Integer |x| x.count_ones();
        ReverseBits Integer |x| x.reverse_bits();
        FirstTrailing Integer |x| if x == 0 { u32::MAX } else { x.trailing_zeros() };
        FirstLeadingU Integer |x| if x == 0 { u32::MAX } else { 31 - x.leading_zeros() };
        FirstLeadingS Integer |x| {
            let y = x ^ ((x as i32 >> 31) as u32);
            if y == 0 { u32::MAX } else { 31 - y.leading_zeros() }
        };
    }
    heavy1 {
        Sin 1 sin;
        Cos 1 cos;
        Tan 3 tan;
        Asin 4 asin;
        Acos 4 acos;
        Atan 4 atan;
        Sinh 4 sinh;
        Cosh 4 cosh;
        Tanh 4 tanh;
        Asinh 4 asinh;
        Acosh 4 acosh;
        Atanh 4 atanh;
        Exp 1 exp;
        Exp2 1 exp2;
        Log 1 log;
        Log2 1 log2;
    }
    binary {
        FAdd Float |a, b| u(f(a) + f(b));
        FSub Float |a, b| u(f(a) - f(b));
        FMul Float |a, b| u(f(a) * f(b));
        FDiv Special |a, b| u(f(a) / f(b));
        FRem Special |a, b| u(f(a) - f(b) * (f(a) / f(b)).trunc());
        FMin Float |a, b| u(eval::fmin(f(a), f(b)));
        FMax Float |a, b| u(eval::fmax(f(a), f(b)));
        FEq Float |a, b| u32::from(f(a) == f(b));
        FNe Float |a, b| u32::from(f(a) != f(b));
        FLt Float |a, b| u32::from(f(a) < f(b));
        FLe Float |a, b| u32::from(f(a) <= f(b));
        Ldexp Float |a, b| u(eval::ldexp(f(a), b as i32));
        IAdd Integer |a, b| a.wrapping_add(b);
        ISub Integer |a, b| a.wrapping_sub(b);
        IMul Integer |a, b| a.wrapping_mul(b);
        SDiv Special |a, b| eval::div_s(a as i32, b as i32) as u32;
        UDiv Special |a, b| a.checked_div(b).unwrap_or(a);
        SRem Special |a, b| eval::rem_s(a as i32, b as i32) as u32;
        URem Special |a, b| a.checked_rem(b).unwrap_or(0);
        And Integer |a, b| a & b;
        Or Integer |a, b| a | b;
        Xor Integer |a, b| a ^ b;
        Shl Integer |a, b| a << (b & 31);
        ShrS Integer |a, b| (a as i32 >> (b & 31)) as u32;
        ShrU Integer |a, b| a >> (b & 31);
        SMin Integer |a, b| (a as i32).min(b as i32) as u32;
        SMax Integer |a, b| (a as i32).max(b as i32) as u32;
        UMin Integer |a, b| a.min(b);
        UMax Integer |a, b| a.max(b);
        IEq Integer |a, b| u32::from(a == b);
        INe Integer |a, b| u32::from(a != b);
        SLt Integer |a, b| u32::from((a as i32) < b as i32);
        SLe Integer |a, b| u32::from(a as i32 <= b as i32);
        ULt Integer |a, b| u32::from(a < b);
        ULe Integer |a, b| u32::from(a <= b);
        Dot4U8 Integer |a, b| eval::dot4_u8(a, b);
        Dot4I8 Integer |a, b| eval::dot4_i8(a, b) as u32;
        FieldMask Integer |a, b| eval::field_mask(a, b);
    }
    ternary {
        Select Float |c, a, b| if c != 0 { a } else { b };
        FClamp Float |x, low, high| u(eval::fmin(eval::fmax(f(x), f(low)), f(high)));
        ExtractU Integer |e, offset, count| eval::extract_u(e, offset, count);
        ExtractS Integer |e, offset, count| eval::extract_s(e as i32, offset, count) as u32;
        Merge Integer |mask, a, b| a & mask | b & !mask;
    }
    other {
        /// `s0` to the power `s1`.
        Pow Special 3;
        /// Angle of (`s1`, `s0`).
        Atan2 Special 4;
        /// `s0 * s1 + s2`, rounded twice.
        MulAdd Float 2;
        /// `s0 * s1 - s2`, rounded twice.
        MulSub Float 2;
        /// `s2 - s0 * s1`, rounded twice.
        NegMulAdd Float 2;
        Dot2 Float 3;
        Dot3 Float 5;
        Dot4 Float 7;
        /// Both components divided by the length: times the reciprocal square root of the dot product.
        Normalize2 Float 6;
        /// The same for three components.
        Normalize3 Float 9;
        /// Copy under the execution mask.
        Mov Float 1;
        /// Copy of all lanes.
        Copy Float 1;
        /// Begins the life of a mutable register; no operation.
        Undef Float 0;
        /// Difference along x or y inside quads; `imm`: 0 x coarse, 1 x fine, 2 y coarse, 3 y fine.
        Derivative Float 1;
        /// Element of a register range, chosen by lane; `imm`: number of registers in the range.
        LoadIndexed Integer 2;
        /// Store to an element of a register range under the mask.
        StoreIndexed Integer 2;
        /// Element of the constant table; `imm`: first entry and number.
        LoadConst Integer 1;
        /// Memory read; `imm`: entry of the memory table.
        Load Integer 1;
        Store Integer 1;
        Atomic Integer 1;
        ArrayLength Integer 1;
        /// Texture access; `imm`: entry of the texture table.
        Texture Integer 1;
        TextureStore Integer 1;
        TextureAtomic Integer 1;
        TextureQuery Integer 1;
        /// `imm`: entry of the subgroup table.
        Subgroup Integer 1;
        If Control 1;
        Else Control 1;
        EndIf Control 0;
        RegionBegin Control 0;
        RegionEnd Control 0;
        LoopBegin Control 0;
        Continuing Control 0;
        /// Back edge.
        LoopEnd Control 1;
        /// Back edge with a condition to leave.
        LoopEndIf Control 1;
        /// All active lanes leave an enclosing region.
        Exit Control 1;
        /// Lanes where the condition holds leave the loop.
        BreakIf Control 1;
        /// Lanes where the condition does not hold leave the loop.
        BreakIfNot Control 1;
        Continue Control 1;
        Discard Control 1;
        Barrier Control 1;
        End Control 0;
    }
}
