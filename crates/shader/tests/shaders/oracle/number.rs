//! Arithmetic of single numbers: operators and conversions.

use naga::{BinaryOperator, Literal, ScalarKind, UnaryOperator};

use super::Fault;
use super::value::{Number, broken};

/// The number that an `f16` holds for `x`: nearest, ties to even. The steps are exact in `f64` until the rounding.
pub fn to_f16(x: f32) -> f32 {
    let magnitude = f64::from(x.abs());
    if x == 0.0 || !x.is_finite() {
        return x;
    }
    // The distance between neighbours: 2^-24 below the least normal number 2^-14, else 2^-10 of the power of two below.
    let exponent = (x.abs().to_bits() >> 23) as i32 - 127;
    let step = 2f64.powi(exponent.max(-14) - 10);
    let rounded = (magnitude / step).round_ties_even() * step;
    let rounded = if rounded > 65504.0 { f32::INFINITY } else { rounded as f32 };
    rounded.copysign(x)
}

/// The 16 bits of an `f16`, of which `x` is rounded to one.
pub fn f16_bits(x: f32) -> u32 {
    let sign = if x.is_sign_negative() { 0x8000 } else { 0 };
    let x = to_f16(x).abs();
    let code = if x.is_nan() {
        0x7e00
    } else if x.is_infinite() {
        0x7c00
    } else if x < 2f32.powi(-14) {
        (x * 2f32.powi(24)) as u32
    } else {
        let exponent = (x.to_bits() >> 23) as i32 - 127;
        let fraction = x / 2f32.powi(exponent) - 1.0;
        ((exponent + 15) as u32) << 10 | (fraction * 1024.0) as u32
    };
    sign | code
}

/// The number whose `f16` bits are the low 16 of `code`.
pub fn f16_value(code: u32) -> f32 {
    let sign = if code & 0x8000 != 0 { -1.0 } else { 1.0 };
    let exponent = (code >> 10 & 31) as i32;
    let fraction = (code & 0x3ff) as f32;
    sign * match exponent {
        31 if fraction == 0.0 => f32::INFINITY,
        31 => f32::NAN,
        0 => fraction * 2f32.powi(-24),
        _ => (1.0 + fraction / 1024.0) * 2f32.powi(exponent - 15),
    }
}

/// The number of a literal.
pub fn literal(literal: Literal) -> Result<Number, Fault> {
    Ok(match literal {
        Literal::F32(x) => Number::Float(x),
        Literal::F16(x) => Number::Half(x.to_f32()),
        Literal::U32(x) => Number::Uint(x),
        Literal::I32(x) => Number::Sint(x),
        Literal::Bool(x) => Number::Bool(x),
        other => return Err(Fault::Unsupported(format!("the literal {other:?}"))),
    })
}

/// A unary operator.
pub fn unary(op: UnaryOperator, x: Number) -> Result<Number, Fault> {
    Ok(match (op, x) {
        (UnaryOperator::Negate, Number::Float(x)) => Number::Float(-x),
        (UnaryOperator::Negate, Number::Half(x)) => Number::Half(-x),
        (UnaryOperator::Negate, Number::Sint(x)) => Number::Sint(x.wrapping_neg()),
        (UnaryOperator::Negate, Number::Uint(x)) => Number::Uint(x.wrapping_neg()),
        (UnaryOperator::LogicalNot | UnaryOperator::BitwiseNot, Number::Bool(x)) => Number::Bool(!x),
        (UnaryOperator::BitwiseNot, Number::Sint(x)) => Number::Sint(!x),
        (UnaryOperator::BitwiseNot, Number::Uint(x)) => Number::Uint(!x),
        _ => return broken("a unary operator with an operand of a wrong type"),
    })
}

/// A binary operator on two numbers.
pub fn binary(op: BinaryOperator, a: Number, b: Number) -> Result<Number, Fault> {
    use Number as N;
    if let BinaryOperator::ShiftLeft | BinaryOperator::ShiftRight = op {
        // WGSL: the shift count is taken modulo the number of bits.
        let left = op == BinaryOperator::ShiftLeft;
        let count = match b {
            N::Uint(n) => n % 32,
            N::Sint(n) => n as u32 % 32,
            _ => return broken("a shift count that is no integer"),
        };
        return Ok(match (a, left) {
            (N::Uint(a), true) => N::Uint(a << count),
            (N::Uint(a), false) => N::Uint(a >> count),
            (N::Sint(a), true) => N::Sint(a << count),
            (N::Sint(a), false) => N::Sint(a >> count),
            _ => return broken("a shift of something that is no integer"),
        });
    }
    match (a, b) {
        (N::Float(x), N::Float(y)) | (N::Half(x), N::Half(y)) => float(op, x, y).map(|r| match r {
            FloatResult::Number(r) => a.same_float(r),
            FloatResult::Truth(r) => N::Bool(r),
        }),
        (N::Sint(x), N::Sint(y)) => signed(op, x, y),
        (N::Uint(x), N::Uint(y)) => unsigned(op, x, y),
        (N::Bool(x), N::Bool(y)) => Ok(N::Bool(match op {
            BinaryOperator::Equal => x == y,
            BinaryOperator::NotEqual => x != y,
            BinaryOperator::And | BinaryOperator::LogicalAnd => x && y,
            BinaryOperator::InclusiveOr | BinaryOperator::LogicalOr => x || y,
            BinaryOperator::ExclusiveOr => x != y,
            _ => return broken("arithmetic of truth values"),
        })),
        _ => broken("operands of different types"),
    }
}

enum FloatResult {
    Number(f32),
    Truth(bool),
}

fn float(op: BinaryOperator, x: f32, y: f32) -> Result<FloatResult, Fault> {
    use FloatResult::{Number, Truth};
    Ok(match op {
        BinaryOperator::Add => Number(x + y),
        BinaryOperator::Subtract => Number(x - y),
        BinaryOperator::Multiply => Number(x * y),
        BinaryOperator::Divide => Number(x / y),
        // WGSL defines the remainder by this formula, which is not that of `fmod`.
        BinaryOperator::Modulo => Number(x - y * (x / y).trunc()),
        BinaryOperator::Equal => Truth(x == y),
        BinaryOperator::NotEqual => Truth(x != y),
        BinaryOperator::Less => Truth(x < y),
        BinaryOperator::LessEqual => Truth(x <= y),
        BinaryOperator::Greater => Truth(x > y),
        BinaryOperator::GreaterEqual => Truth(x >= y),
        _ => return broken("an operator that floats do not have"),
    })
}

fn signed(op: BinaryOperator, x: i32, y: i32) -> Result<Number, Fault> {
    use Number::{Bool, Sint};
    Ok(match op {
        BinaryOperator::Add => Sint(x.wrapping_add(y)),
        BinaryOperator::Subtract => Sint(x.wrapping_sub(y)),
        BinaryOperator::Multiply => Sint(x.wrapping_mul(y)),
        // WGSL: division by zero gives the dividend, and so does the one that overflows; their remainders are 0.
        BinaryOperator::Divide => Sint(x.checked_div(y).unwrap_or(x)),
        BinaryOperator::Modulo => Sint(x.checked_rem(y).unwrap_or(0)),
        BinaryOperator::And => Sint(x & y),
        BinaryOperator::InclusiveOr => Sint(x | y),
        BinaryOperator::ExclusiveOr => Sint(x ^ y),
        BinaryOperator::Equal => Bool(x == y),
        BinaryOperator::NotEqual => Bool(x != y),
        BinaryOperator::Less => Bool(x < y),
        BinaryOperator::LessEqual => Bool(x <= y),
        BinaryOperator::Greater => Bool(x > y),
        BinaryOperator::GreaterEqual => Bool(x >= y),
        _ => return broken("an operator that signed integers do not have"),
    })
}

fn unsigned(op: BinaryOperator, x: u32, y: u32) -> Result<Number, Fault> {
    use Number::{Bool, Uint};
    Ok(match op {
        BinaryOperator::Add => Uint(x.wrapping_add(y)),
        BinaryOperator::Subtract => Uint(x.wrapping_sub(y)),
        BinaryOperator::Multiply => Uint(x.wrapping_mul(y)),
        BinaryOperator::Divide => Uint(x.checked_div(y).unwrap_or(x)),
        BinaryOperator::Modulo => Uint(x.checked_rem(y).unwrap_or(0)),
        BinaryOperator::And => Uint(x & y),
        BinaryOperator::InclusiveOr => Uint(x | y),
        BinaryOperator::ExclusiveOr => Uint(x ^ y),
        BinaryOperator::Equal => Bool(x == y),
        BinaryOperator::NotEqual => Bool(x != y),
        BinaryOperator::Less => Bool(x < y),
        BinaryOperator::LessEqual => Bool(x <= y),
        BinaryOperator::Greater => Bool(x > y),
        BinaryOperator::GreaterEqual => Bool(x >= y),
        _ => return broken("an operator that unsigned integers do not have"),
    })
}

/// WGSL's conversion of a float to an integer: of the integers from `least` to `most` that a float of this kind can be, the nearest to
/// `x` without its fraction. NaN, for which any integer will do, gives 0. The type `f64` has all of these numbers.
fn to_integer(x: f32, half: bool, least: i64, most: i64) -> i64 {
    // The digits of a float: an integer that has more is none.
    let (digits, greatest) = if half { (11, 65_504) } else { (24, i64::MAX) };
    let towards_zero = |n: i64| {
        let magnitude = n.abs();
        let surplus = (64 - magnitude.leading_zeros()).saturating_sub(digits);
        n.signum() * (magnitude >> surplus << surplus).min(greatest)
    };
    let whole = f64::from(x).trunc();
    if whole.is_nan() { 0 } else { whole.clamp(towards_zero(least) as f64, towards_zero(most) as f64) as i64 }
}

/// A conversion that keeps the value where it can.
pub fn convert(x: Number, kind: ScalarKind, width: u8) -> Result<Number, Fault> {
    use Number as N;
    Ok(match (kind, width) {
        (ScalarKind::Bool, _) => N::Bool(match x {
            N::Bool(x) => x,
            N::Sint(x) => x != 0,
            N::Uint(x) => x != 0,
            N::Float(x) | N::Half(x) => x != 0.0,
        }),
        (ScalarKind::Sint, 4) => N::Sint(match x {
            N::Bool(x) => i32::from(x),
            N::Sint(x) => x,
            N::Uint(x) => x as i32,
            N::Float(x) => to_integer(x, false, i32::MIN.into(), i32::MAX.into()) as i32,
            N::Half(x) => to_integer(x, true, i32::MIN.into(), i32::MAX.into()) as i32,
        }),
        (ScalarKind::Uint, 4) => N::Uint(match x {
            N::Bool(x) => u32::from(x),
            N::Sint(x) => x as u32,
            N::Uint(x) => x,
            N::Float(x) => to_integer(x, false, 0, u32::MAX.into()) as u32,
            N::Half(x) => to_integer(x, true, 0, u32::MAX.into()) as u32,
        }),
        (ScalarKind::Float, 2 | 4) => {
            let x = match x {
                N::Bool(x) => f32::from(u8::from(x)),
                N::Sint(x) => x as f32,
                N::Uint(x) => x as f32,
                N::Float(x) | N::Half(x) => x,
            };
            if width == 2 { N::Half(to_f16(x)) } else { N::Float(x) }
        }
        _ => return Err(Fault::Unsupported(format!("conversion to {kind:?} of {width} bytes"))),
    })
}

/// The same 32 bits as another type.
pub fn bitcast(x: Number, kind: ScalarKind) -> Result<Number, Fault> {
    let bits = match x {
        Number::Sint(_) | Number::Uint(_) | Number::Float(_) => x.bits(),
        _ => return broken("a bitcast of something that has not 32 bits"),
    };
    Ok(match kind {
        ScalarKind::Sint => Number::Sint(bits as i32),
        ScalarKind::Uint => Number::Uint(bits),
        ScalarKind::Float => Number::Float(f32::from_bits(bits)),
        _ => return broken("a bitcast to something that has not 32 bits"),
    })
}
