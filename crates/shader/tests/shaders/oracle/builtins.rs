//! Numeric built-in functions, number by number. Vectors and matrices as a whole are in `geometry`, bits and packing in `bits`.

use gfx::math;
use naga::MathFunction;

use super::Fault;
use super::value::{Number, Value, broken};
use super::{bits, geometry};

/// Minimum; of a number and a NaN, the number.
pub fn min(a: f32, b: f32) -> f32 {
    if a < b || b.is_nan() { a } else { b }
}

/// Maximum; of a number and a NaN, the number.
pub fn max(a: f32, b: f32) -> f32 {
    if a > b || b.is_nan() { a } else { b }
}

/// Clamp: WGSL's first definition, min(max(x, low), high).
pub fn clamp(x: f32, low: f32, high: f32) -> f32 {
    min(max(x, low), high)
}

fn sign(x: f32) -> f32 {
    if x > 0.0 {
        1.0
    } else if x < 0.0 {
        -1.0
    } else {
        0.0
    }
}

fn smooth_step(low: f32, high: f32, x: f32) -> f32 {
    let t = clamp((x - low) / (high - low), 0.0, 1.0);
    (t * t) * (3.0 - 2.0 * t)
}

/// The fraction of `x` in [0.5, 1) and the exponent of 2 that goes with it.
fn frexp(x: f32) -> (f32, i32) {
    if x == 0.0 || !x.is_finite() {
        return (x, 0);
    }
    // As an `f64` every `f32` is a normal number.
    let wide = f64::from(x).to_bits();
    let exponent = (wide >> 52 & 0x7ff) as i32 - 1022;
    let fraction = f64::from_bits(wide & !(0x7ff << 52) | 1022 << 52);
    (fraction as f32, exponent)
}

/// `x` times 2 to the power `e`, rounded once.
fn ldexp(x: f32, e: i32) -> f32 {
    (f64::from(x) * 2f64.powi(e.clamp(-400, 400))) as f32
}

/// `x` to the power `y`. A constant whole exponent from 1 to 64 (or 128 or 256) means a product, built by squaring.
fn power(x: f32, y: f32, constant: bool) -> f32 {
    let whole = y.fract() == 0.0 && (1.0..=64.0).contains(&y) || y == 128.0 || y == 256.0;
    if !constant || !whole {
        return math::pow(x, y);
    }
    if x < 0.0 {
        return f32::NAN;
    }
    let (mut square, mut left, mut product) = (x, y as u32, None);
    loop {
        if left & 1 != 0 {
            product = Some(product.map_or(square, |p: f32| p * square));
        }
        left >>= 1;
        if left == 0 {
            return product.unwrap_or(1.0);
        }
        square *= square;
    }
}

/// A function of one float on each number, rounded to the type.
fn each(x: &Value, f: impl Fn(f32) -> f32) -> Result<Value, Fault> {
    x.map(&mut |n| match n {
        Number::Float(x) | Number::Half(x) => Ok(n.same_float(f(x))),
        _ => broken("a built-in function of floats with another argument"),
    })
}

/// A function of two floats on corresponding numbers.
fn each2(x: &Value, y: &Value, f: impl Fn(f32, f32) -> f32) -> Result<Value, Fault> {
    x.zip(y, &mut |a, b| match (a, b) {
        (Number::Float(x), Number::Float(y)) | (Number::Half(x), Number::Half(y)) => Ok(a.same_float(f(x, y))),
        _ => broken("a built-in function of floats with other arguments"),
    })
}

/// A function of three numbers on corresponding ones; single ones go with each of the others.
pub fn each3(args: [&Value; 3], f: impl Fn(Number, Number, Number) -> Result<Number, Fault>) -> Result<Value, Fault> {
    let [a, b, c] = [args[0].numbers()?, args[1].numbers()?, args[2].numbers()?];
    let n = a.len().max(b.len()).max(c.len());
    let at = |v: &[Number], i: usize| if v.len() == 1 { v[0] } else { v[i] };
    let out: Vec<Number> = (0..n).map(|i| f(at(a, i), at(b, i), at(c, i))).collect::<Result<_, _>>()?;
    Ok(Value::of_numbers(&out))
}

/// The same with floats.
fn each3_float(args: [&Value; 3], f: impl Fn(f32, f32, f32) -> f32) -> Result<Value, Fault> {
    each3(args, |a, b, c| match (a, b, c) {
        (Number::Float(x), Number::Float(y), Number::Float(z)) | (Number::Half(x), Number::Half(y), Number::Half(z)) => {
            Ok(a.same_float(f(x, y, z)))
        }
        _ => broken("a built-in function of floats with other arguments"),
    })
}

fn smaller(a: Number, b: Number) -> Result<Number, Fault> {
    Ok(match (a, b) {
        (Number::Float(x), Number::Float(y)) | (Number::Half(x), Number::Half(y)) => a.same_float(min(x, y)),
        (Number::Sint(x), Number::Sint(y)) => Number::Sint(x.min(y)),
        (Number::Uint(x), Number::Uint(y)) => Number::Uint(x.min(y)),
        _ => return broken("`min` of numbers of different types"),
    })
}

fn larger(a: Number, b: Number) -> Result<Number, Fault> {
    Ok(match (a, b) {
        (Number::Float(x), Number::Float(y)) | (Number::Half(x), Number::Half(y)) => a.same_float(max(x, y)),
        (Number::Sint(x), Number::Sint(y)) => Number::Sint(x.max(y)),
        (Number::Uint(x), Number::Uint(y)) => Number::Uint(x.max(y)),
        _ => return broken("`max` of numbers of different types"),
    })
}

/// A built-in function; `constant` tells whether the second argument is a constant of the program.
pub fn call(fun: MathFunction, args: &[Value], constant: bool) -> Result<Value, Fault> {
    use MathFunction as M;
    let [x, rest @ ..] = args else { return broken("a built-in function without arguments") };
    let second = || rest.first().ok_or_else(|| Fault::Unsupported(format!("{fun:?} without a second argument")));
    let third = || rest.get(1).ok_or_else(|| Fault::Unsupported(format!("{fun:?} without a third argument")));
    match fun {
        M::Abs => x.map(&mut |n| {
            Ok(match n {
                Number::Float(x) => Number::Float(x.abs()),
                Number::Half(x) => Number::Half(x.abs()),
                Number::Sint(x) => Number::Sint(x.wrapping_abs()),
                Number::Uint(x) => Number::Uint(x),
                Number::Bool(_) => return broken("`abs` of a `bool`"),
            })
        }),
        M::Sign => x.map(&mut |n| {
            Ok(match n {
                Number::Float(x) => Number::Float(sign(x)),
                Number::Half(x) => Number::Half(sign(x)),
                Number::Sint(x) => Number::Sint(x.signum()),
                _ => return broken("`sign` of a number without a sign"),
            })
        }),
        M::Min => x.zip(second()?, &mut smaller),
        M::Max => x.zip(second()?, &mut larger),
        M::Clamp => each3([x, second()?, third()?], |x, low, high| smaller(larger(x, low)?, high)),
        M::Saturate => each(x, |x| clamp(x, 0.0, 1.0)),

        M::Cos => each(x, math::cos),
        M::Cosh => each(x, math::cosh),
        M::Sin => each(x, math::sin),
        M::Sinh => each(x, math::sinh),
        M::Tan => each(x, math::tan),
        M::Tanh => each(x, math::tanh),
        M::Acos => each(x, math::acos),
        M::Asin => each(x, math::asin),
        M::Atan => each(x, math::atan),
        M::Atan2 => each2(x, second()?, math::atan2),
        M::Asinh => each(x, math::asinh),
        M::Acosh => each(x, math::acosh),
        M::Atanh => each(x, math::atanh),
        M::Exp => each(x, math::exp),
        M::Exp2 => each(x, math::exp2),
        M::Log => each(x, math::log),
        M::Log2 => each(x, math::log2),
        M::Pow => each2(x, second()?, |x, y| power(x, y, constant)),
        M::Sqrt => each(x, f32::sqrt),
        M::InverseSqrt => each(x, |x| 1.0 / x.sqrt()),

        M::Radians => each(x, |x| x * (std::f32::consts::PI / 180.0)),
        M::Degrees => each(x, |x| x * (180.0 / std::f32::consts::PI)),
        M::Ceil => each(x, f32::ceil),
        M::Floor => each(x, f32::floor),
        M::Round => each(x, f32::round_ties_even),
        M::Trunc => each(x, f32::trunc),
        M::Fract => each(x, |x| x - x.floor()),
        M::Modf => Ok(Value::Parts(vec![each(x, |x| x - x.trunc())?, each(x, f32::trunc)?])),
        M::Frexp => {
            let fraction = each(x, |x| frexp(x).0)?;
            let exponent = x.map(&mut |n| match n {
                Number::Float(x) | Number::Half(x) => Ok(Number::Sint(frexp(x).1)),
                _ => broken("`frexp` of something that is no float"),
            })?;
            Ok(Value::Parts(vec![fraction, exponent]))
        }
        M::Ldexp => x.zip(second()?, &mut |x, e| match (x, e) {
            (Number::Float(f) | Number::Half(f), Number::Sint(e)) => Ok(x.same_float(ldexp(f, e))),
            _ => broken("`ldexp` with arguments of other types"),
        }),
        M::Fma => each3_float([x, second()?, third()?], |x, y, z| x * y + z),
        M::Mix => each3_float([x, second()?, third()?], |x, y, t| x * (1.0 - t) + y * t),
        M::Step => each2(x, second()?, |edge, x| if edge <= x { 1.0 } else { 0.0 }),
        M::SmoothStep => each3_float([x, second()?, third()?], smooth_step),
        M::QuantizeToF16 => each(x, super::number::to_f16),

        M::Dot
        | M::Outer
        | M::Cross
        | M::Distance
        | M::Length
        | M::Normalize
        | M::FaceForward
        | M::Reflect
        | M::Refract
        | M::Inverse
        | M::Transpose
        | M::Determinant => geometry::call(fun, args),

        _ => bits::call(fun, args),
    }
}
