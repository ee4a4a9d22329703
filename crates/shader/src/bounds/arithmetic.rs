//! Arithmetic on ranges.
//!
//! Sums, differences, products, quotients and square roots are rounded to nearest. Rounding to nearest is monotone: if x <= y then
//! fl(x) <= fl(y). So the operation itself, applied to the ends of its operands, gives bounds of all *rounded* results, and no bound has
//! to be widened. Where an operation of the instruction set rounds twice, this code also rounds twice. The result of an operation that is
//! not monotone, or that can overflow, divide by zero or wrap round, may be anything.

use crate::code::{Code, eval};

use super::range::Range;

/// Least and greatest.
type Ends<T> = (T, T);

type Floats = Ends<f32>;

/// Applies a function that never falls to both ends.
fn rising(a: Floats, f: impl Fn(f32) -> f32) -> Range {
    Range::floats(f(a.0), f(a.1))
}

/// Least and greatest of four; anything if one of them is NaN or infinite.
fn hull(x: [f32; 4]) -> Range {
    if x.iter().any(|x| !x.is_finite()) {
        return Range::ANY;
    }
    let least = x.iter().copied().fold(f32::INFINITY, |a, b| if b < a { b } else { a });
    let greatest = x.iter().copied().fold(f32::NEG_INFINITY, |a, b| if b > a { b } else { a });
    Range::floats(least, greatest)
}

pub(super) fn add(a: Range, b: Range) -> Range {
    match (a.float, b.float) {
        (Some(a), Some(b)) => Range::floats(a.0 + b.0, a.1 + b.1),
        _ => Range::ANY,
    }
}

pub(super) fn subtract(a: Range, b: Range) -> Range {
    match (a.float, b.float) {
        (Some(a), Some(b)) => Range::floats(a.0 - b.1, a.1 - b.0),
        _ => Range::ANY,
    }
}

/// A product; `square`: of one register with itself. While one factor stays, a product is monotone in the other, so that its extremes
/// are at the corners.
pub(super) fn multiply(a: Range, b: Range, square: bool) -> Range {
    match (a.float, b.float) {
        (Some(a), Some(_)) if square => {
            let (x, y) = (a.0 * a.0, a.1 * a.1);
            let least = if a.0 <= 0.0 && a.1 >= 0.0 { 0.0 } else { x.min(y) };
            Range::floats(least, x.max(y))
        }
        (Some(a), Some(b)) => hull([a.0 * b.0, a.0 * b.1, a.1 * b.0, a.1 * b.1]),
        _ => Range::ANY,
    }
}

fn divide(a: Floats, b: Floats) -> Range {
    if b.0 <= 0.0 && b.1 >= 0.0 {
        return Range::ANY;
    }
    hull([a.0 / b.0, a.0 / b.1, a.1 / b.0, a.1 / b.1])
}

/// As `gfx::math::inverse_sqrt`.
pub(super) fn inverse_root(a: Range) -> Range {
    match a.float {
        Some((least, greatest)) if least > 0.0 => Range::floats(1.0 / greatest.sqrt(), 1.0 / least.sqrt()),
        _ => Range::ANY,
    }
}

/// Whether a comparison holds for all values, for none, or is not decided.
fn decided(yes: bool, no: bool) -> Range {
    match (yes, no) {
        (true, _) => Range::point(1),
        (_, true) => Range::point(0),
        _ => Range::BOOL,
    }
}

/// One operand that may be several values.
pub(super) fn unary(code: Code, a: Range) -> Range {
    match code {
        Code::FIsNan | Code::FIsInf => decided(false, a.float.is_some()),
        Code::FSaturate => a.float.map_or(Range::floats(0.0, 1.0), |a| rising(a, |x| eval::fmin(eval::fmax(x, 0.0), 1.0))),
        Code::FToBool => decided(a.float.is_some_and(|(least, greatest)| least > 0.0 || greatest < 0.0), false),
        Code::IToBool => a.truth().map_or(Range::BOOL, |truth| Range::point(u32::from(truth))),
        Code::BoolToF => a.truth().map_or(Range::floats(0.0, 1.0), |truth| Range::point(if truth { 0x3f80_0000 } else { 0 })),
        Code::SToF => a.signed.map_or(Range::ANY, |(a, b)| Range::floats(a as f32, b as f32)),
        Code::UToF => a.unsigned.map_or(Range::ANY, |(a, b)| Range::floats(a as f32, b as f32)),
        Code::INeg => match a.signed {
            Some((least, greatest)) if least != i32::MIN => Range::integers(None, Some((-greatest, -least))),
            _ => Range::ANY,
        },
        Code::INot => a.unsigned.map_or(Range::ANY, |(a, b)| Range::unsigned(!b, !a)),
        Code::BNot => match a.unsigned {
            Some((_, greatest)) if greatest <= 1 => Range::BOOL,
            _ => Range::ANY,
        },
        _ => a.float.map_or(Range::ANY, |a| float(code, a)),
    }
}

/// One operand in floating point.
fn float(code: Code, a: Floats) -> Range {
    match code {
        Code::FNeg => Range::floats(-a.1, -a.0),
        Code::FAbs if a.0 >= 0.0 => Range::floats(a.0, a.1),
        Code::FAbs if a.1 <= 0.0 => Range::floats(-a.1, -a.0),
        Code::FAbs => Range::floats(0.0, a.1.max(-a.0)),
        Code::FFloor => rising(a, f32::floor),
        Code::FCeil => rising(a, f32::ceil),
        Code::FRound => rising(a, f32::round_ties_even),
        Code::FTrunc => rising(a, f32::trunc),
        // Between two integers the fraction rises with the number. Else the fraction is anything from 0 to 1; it is 1 where a number just
        // below an integer is rounded.
        Code::FFract if a.0.floor() == a.1.floor() => rising(a, |x| x - x.floor()),
        Code::FFract => Range::floats(0.0, 1.0),
        Code::FSign => rising(a, eval::sign),
        Code::FSqrt if a.0 >= 0.0 => rising(a, f32::sqrt),
        Code::FInvSqrt => inverse_root(Range::floats(a.0, a.1)),
        Code::Quantize => rising(a, |x| eval::from_half(eval::to_half(x))),
        Code::FToS => Range::integers(None, Some((eval::to_s(a.0), eval::to_s(a.1)))),
        Code::FToU => Range::unsigned(eval::to_u(a.0), eval::to_u(a.1)),
        Code::HalfToS => Range::integers(None, Some((eval::half_to_s(a.0), eval::half_to_s(a.1)))),
        Code::HalfToU => Range::unsigned(eval::half_to_u(a.0), eval::half_to_u(a.1)),
        _ => Range::ANY,
    }
}

/// Two operands of which one may be several values; `same`: they are one register.
pub(super) fn binary(code: Code, a: Range, b: Range, same: bool) -> Range {
    match code {
        Code::FAdd => return add(a, b),
        Code::FSub => return subtract(a, b),
        Code::FMul => return multiply(a, b, same),
        _ => {}
    }
    if let (Some(x), Some(y)) = (a.float, b.float) {
        match code {
            Code::FDiv => return divide(x, y),
            Code::FMin => return Range::floats(eval::fmin(x.0, y.0), eval::fmin(x.1, y.1)),
            Code::FMax => return Range::floats(eval::fmax(x.0, y.0), eval::fmax(x.1, y.1)),
            Code::FLt => return decided(x.1 < y.0, x.0 >= y.1),
            Code::FLe => return decided(x.1 <= y.0, x.0 > y.1),
            Code::FEq => return decided(false, x.1 < y.0 || y.1 < x.0),
            Code::FNe => return decided(x.1 < y.0 || y.1 < x.0, false),
            _ => {}
        }
    }
    match code {
        Code::FLt | Code::FLe | Code::FEq | Code::FNe => Range::BOOL,
        _ => integer(code, a, b),
    }
}

/// All ones up to the highest bit of a number.
fn ones(x: u32) -> u32 {
    u32::MAX.checked_shr(x.leading_zeros()).unwrap_or(0)
}

/// Two operands as integers.
fn integer(code: Code, a: Range, b: Range) -> Range {
    let (u, s) = (a.unsigned.zip(b.unsigned), a.signed.zip(b.signed));
    let unsigned = |f: &dyn Fn(Ends<u32>, Ends<u32>) -> Option<Ends<u32>>| u.and_then(|(a, b)| f(a, b));
    let signed = |f: &dyn Fn(Ends<i32>, Ends<i32>) -> Option<Ends<i32>>| s.and_then(|(a, b)| f(a, b));
    match code {
        Code::IAdd => Range::integers(
            unsigned(&|a, b| Some((a.0.checked_add(b.0)?, a.1.checked_add(b.1)?))),
            signed(&|a, b| Some((a.0.checked_add(b.0)?, a.1.checked_add(b.1)?))),
        ),
        Code::ISub => Range::integers(
            unsigned(&|a, b| Some((a.0.checked_sub(b.1)?, a.1.checked_sub(b.0)?))),
            signed(&|a, b| Some((a.0.checked_sub(b.1)?, a.1.checked_sub(b.0)?))),
        ),
        Code::IMul => Range::integers(
            unsigned(&|a, b| Some((a.0.checked_mul(b.0)?, a.1.checked_mul(b.1)?))),
            signed(&|a, b| {
                let x = [a.0.checked_mul(b.0)?, a.0.checked_mul(b.1)?, a.1.checked_mul(b.0)?, a.1.checked_mul(b.1)?];
                Some((x.into_iter().min()?, x.into_iter().max()?))
            }),
        ),
        Code::UDiv => Range::integers(unsigned(&|a, b| Some((a.0.checked_div(b.1)?, a.1.checked_div(b.0)?))), None),
        Code::URem => Range::integers(
            unsigned(&|a, b| match b {
                (0, _) => None,
                (one, other) if one == other && a.0 / one == a.1 / one => Some((a.0 % one, a.1 % one)),
                _ => Some((0, a.1.min(b.1 - 1))),
            }),
            None,
        ),
        Code::SDiv => Range::integers(None, signed(&|a, b| (b.0 == b.1 && b.0 > 0).then(|| (a.0 / b.0, a.1 / b.0)))),
        Code::SRem => Range::integers(
            None,
            signed(&|a, b| match (a.0 >= 0, b.0 > 0) {
                (true, true) if b.0 == b.1 && a.0 / b.0 == a.1 / b.0 => Some((a.0 % b.0, a.1 % b.0)),
                (true, true) => Some((0, a.1.min(b.1 - 1))),
                _ => None,
            }),
        ),
        // At most the smaller one, whatever the other is.
        Code::And => match (a.unsigned, b.unsigned) {
            (None, None) => Range::ANY,
            (x, y) => Range::unsigned(0, x.map_or(u32::MAX, |x| x.1).min(y.map_or(u32::MAX, |y| y.1))),
        },
        Code::Or => Range::integers(unsigned(&|a, b| Some((a.0.max(b.0), ones(a.1 | b.1)))), None),
        Code::Xor => Range::integers(unsigned(&|a, b| Some((0, ones(a.1 | b.1)))), None),
        Code::Shl => Range::integers(
            unsigned(&|a, b| (b.0 == b.1 && a.1.leading_zeros() >= b.0 & 31).then(|| (a.0 << (b.0 & 31), a.1 << (b.0 & 31)))),
            None,
        ),
        Code::ShrU => match (a.unsigned, b.bits()) {
            (Some((least, greatest)), Some(by)) => Range::unsigned(least >> (by & 31), greatest >> (by & 31)),
            (Some((_, greatest)), None) => Range::unsigned(0, greatest),
            (None, Some(by)) => Range::unsigned(0, u32::MAX >> (by & 31)),
            (None, None) => Range::ANY,
        },
        Code::ShrS => match (a.signed, b.bits()) {
            (Some((least, greatest)), Some(by)) => Range::integers(None, Some((least >> (by & 31), greatest >> (by & 31)))),
            _ => Range::ANY,
        },
        Code::UMin => Range::integers(unsigned(&|a, b| Some((a.0.min(b.0), a.1.min(b.1)))), None),
        Code::UMax => Range::integers(unsigned(&|a, b| Some((a.0.max(b.0), a.1.max(b.1)))), None),
        Code::SMin => Range::integers(None, signed(&|a, b| Some((a.0.min(b.0), a.1.min(b.1))))),
        Code::SMax => Range::integers(None, signed(&|a, b| Some((a.0.max(b.0), a.1.max(b.1))))),
        Code::ULt => u.map_or(Range::BOOL, |(a, b)| decided(a.1 < b.0, a.0 >= b.1)),
        Code::ULe => u.map_or(Range::BOOL, |(a, b)| decided(a.1 <= b.0, a.0 > b.1)),
        Code::SLt => s.map_or(Range::BOOL, |(a, b)| decided(a.1 < b.0, a.0 >= b.1)),
        Code::SLe => s.map_or(Range::BOOL, |(a, b)| decided(a.1 <= b.0, a.0 > b.1)),
        Code::IEq => decided(false, u.is_some_and(|(a, b)| a.1 < b.0 || b.1 < a.0)),
        Code::INe => decided(u.is_some_and(|(a, b)| a.1 < b.0 || b.1 < a.0), false),
        _ => Range::ANY,
    }
}

/// Three operands of which one may be several values.
pub(super) fn ternary(code: Code, a: Range, b: Range, c: Range) -> Range {
    match code {
        Code::Select => match a.truth() {
            Some(true) => b,
            Some(false) => c,
            None => b.join(c),
        },
        // NaN becomes the lower bound, and an infinity becomes one of the two bounds.
        Code::FClamp => match (a.float, b.float, c.float) {
            (Some(x), Some(low), Some(high)) => {
                let clamp = |x, low, high| eval::fmin(eval::fmax(x, low), high);
                Range::floats(clamp(x.0, low.0, high.0), clamp(x.1, low.1, high.1))
            }
            (None, Some(low), Some(high)) => Range::floats(eval::fmin(low.0, high.0), high.1),
            _ => Range::ANY,
        },
        _ => Range::ANY,
    }
}
