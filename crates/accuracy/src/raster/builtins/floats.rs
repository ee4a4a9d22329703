//! Floating-point built-in functions and operators: for each what WGSL's table of accuracies allows.

use super::interval::{ANY, Interval, atan2, dot, length, near, point, rounded, rounded16};
use super::{Builtin, Operands, Want};

/// The operands as numbers.
fn numbers(words: [u32; 3]) -> [f64; 3] {
    words.map(|word| f64::from(f32::from_bits(word)))
}

const fn float(name: &'static str, expression: &'static str, operands: Operands, want: fn([u32; 3]) -> Want) -> Builtin {
    Builtin { name, expression, float: true, operands, want }
}

/// An entry whose result follows from the operands as numbers.
macro_rules! floats {
    ($($name:literal, $expression:literal, $operands:ident, |$a:pat_param| $want:expr;)*) => {
        &[$(float($name, $expression, Operands::$operands, |words| {
            let $a = numbers(words);
            Want::In($want)
        })),*]
    };
}

/// Half of a sum of exponentials, inherited from their table.
fn hyperbolic(x: f64, combine: fn(Interval, Interval) -> Interval) -> Interval {
    combine(point(x).exp(), point(-x).exp()).times(point(0.5))
}

fn sinh(x: f64) -> Interval {
    hyperbolic(x, Interval::minus)
}

fn cosh(x: f64) -> Interval {
    hyperbolic(x, Interval::plus)
}

/// As CEIL, FLOOR and so on of a number: an integer that is exact.
fn round_even(x: f64) -> f64 {
    let below = libm::floor(x);
    match x - below {
        d if d < 0.5 => below,
        d if d > 0.5 => below + 1.0,
        _ if below % 2.0 == 0.0 => below,
        _ => below + 1.0,
    }
}

fn sign(x: f64) -> f64 {
    f64::from(i8::from(x > 0.0) - i8::from(x < 0.0))
}

/// Clamped between bounds in order; else any of the bounds, by min and max or by the median.
fn clamp(x: f64, low: f64, high: f64) -> Interval {
    if low <= high { point(x.max(low).min(high)) } else { point(low).or(point(high)).or(point(x)) }
}

fn remainder(x: f64, y: f64) -> Interval {
    let quotient = point(x).over(point(y)).map(libm::trunc);
    point(x).minus(point(y).times(quotient))
}

fn degrees(x: f64, factor: f64) -> Interval {
    point(x).times(rounded(factor))
}

fn smoothstep(low: f64, high: f64, x: f64) -> Interval {
    if low >= high {
        return ANY;
    }
    let t = point(x).minus(point(low)).over(point(high).minus(point(low)));
    if t.is_any() {
        return ANY;
    }
    let t = t.map(|t| t.clamp(0.0, 1.0));
    let rest = point(3.0).minus(point(2.0).times(t));
    // As the conformance suite has it, and as the formula reads.
    t.times(t.times(rest)).or(t.times(t).times(rest))
}

/// The first component of (a, b) less twice its share along (b, c).
fn reflect(a: f64, b: f64, c: f64) -> Interval {
    let (e, n) = ([point(a), point(b)], [point(b), point(c)]);
    e[0].minus(point(2.0).times(dot(&n, &e)).times(n[0]))
}

/// The first component of refract((a, b), (b, a), c).
fn refract(a: f64, b: f64, c: f64) -> Interval {
    let (e, n, eta) = ([point(a), point(b)], [point(b), point(a)], point(c));
    let along = dot(&n, &e);
    let k = point(1.0).minus(eta.times(eta).times(point(1.0).minus(along.times(along))));
    let least = f64::from(f32::MIN_POSITIVE);
    match k {
        k if k.is_any() || k.hi > -least && k.lo < least => ANY,
        k if k.hi < 0.0 => point(0.0),
        k => eta.times(e[0]).minus(eta.times(along).plus(k.sqrt()).times(n[0])),
    }
}

/// (a, b) turned so that it does not point along (b, c), seen from (c, a): its first component.
fn face_forward(a: f64, b: f64, c: f64) -> Interval {
    let side = dot(&[point(b), point(c)], &[point(c), point(a)]);
    match side {
        side if side.hi < 0.0 => point(a),
        side if side.lo > 0.0 => point(-a),
        _ => point(a).or(point(-a)),
    }
}

fn ldexp(words: [u32; 3]) -> Want {
    let (x, exponent) = (f64::from(f32::from_bits(words[0])), words[1] as i32);
    // The sum of the exponent and the bias 127 is at most 255.
    Want::In(if exponent > 128 { ANY } else { rounded(libm::ldexp(x, exponent.max(-1000))) })
}

/// A normal number's fraction in [0.5, 1) and its exponent.
fn split(x: f64) -> Option<(f64, i32)> {
    match x {
        0.0 => Some((0.0, 0)),
        x if x.abs() < f64::from(f32::MIN_POSITIVE) => None,
        x => Some(libm::frexp(x)),
    }
}

/// Correctly rounded: of a result that is no number of `f32`, both neighbours.
pub const ROUNDED: &[Builtin] = floats![
    "+", "a + b", Two, |[a, b, _]| rounded(a + b);
    "-", "a - b", Two, |[a, b, _]| rounded(a - b);
    "*", "a * b", Two, |[a, b, _]| rounded(a * b);
    "negation", "-a", One, |[a, ..]| point(-a);
    "abs", "abs(a)", One, |[a, ..]| point(a.abs());
    "ceil", "ceil(a)", One, |[a, ..]| point(libm::ceil(a));
    "floor", "floor(a)", One, |[a, ..]| point(libm::floor(a));
    "trunc", "trunc(a)", One, |[a, ..]| point(libm::trunc(a));
    "round, ties to even", "round(a)", One, |[a, ..]| point(round_even(a));
    "sign", "sign(a)", One, |[a, ..]| point(sign(a));
    "saturate", "saturate(a)", One, |[a, ..]| point(a.clamp(0.0, 1.0));
    "min", "min(a, b)", Two, |[a, b, _]| point(a.min(b));
    "max", "max(a, b)", Two, |[a, b, _]| point(a.max(b));
    "clamp", "clamp(a, b, c)", Three, |[a, b, c]| clamp(a, b, c);
    "step", "step(a, b)", Two, |[a, b, _]| point(f64::from(u8::from(a <= b)));
    "modf, fraction", "modf(a).fract", One, |[a, ..]| point(a - libm::trunc(a));
    "modf, whole", "modf(a).whole", One, |[a, ..]| point(libm::trunc(a));
    "frexp, fraction", "frexp(a).fract", One, |[a, ..]| split(a).map_or(ANY, |(fraction, _)| point(fraction));
    "frexp, exponent", "f32(frexp(a).exp)", One, |[a, ..]| split(a).map_or(ANY, |(_, exponent)| point(exponent.into()));
    "quantizeToF16", "quantizeToF16(a)", One, |[a, ..]| rounded16(a);
    "select", "select(a, b, a < b)", Two, |[a, b, _]| point(if a < b { b } else { a });
    "transpose", "transpose(mat2x3f(a, b, c, 1.0, 2.0, 3.0))[1].x", Three, |[_, b, _]| point(b);
    "matrix product", "(mat2x2f(a, b, c, 1.0) * mat2x2f(0.0, 1.0, 1.0, 0.0))[0].x", Three, |[_, _, c]| point(c);
    "f16 of f32", "f32(f16(a))", One, |[a, ..]| rounded16(a);
    "f16 +", "f32(f16(unpack2x16float(x).x) + f16(unpack2x16float(y).x))", Halves, |[a, b, _]| rounded16(a + b);
    "f16 -", "f32(f16(unpack2x16float(x).x) - f16(unpack2x16float(y).x))", Halves, |[a, b, _]| rounded16(a - b);
    "f16 *", "f32(f16(unpack2x16float(x).x) * f16(unpack2x16float(y).x))", Halves, |[a, b, _]| rounded16(a * b);
    "f16 floor", "f32(floor(f16(unpack2x16float(x).x)))", Halves, |[a, ..]| point(libm::floor(a));
    "f16 round", "f32(round(f16(unpack2x16float(x).x)))", Halves, |[a, ..]| point(round_even(a));
    "f16 abs", "f32(abs(f16(unpack2x16float(x).x)))", Halves, |[a, ..]| point(a.abs());
    "f16 max", "f32(max(f16(unpack2x16float(x).x), f16(unpack2x16float(y).x)))", Halves, |[a, b, _]| point(a.max(b));
];

/// [`ROUNDED`] of what is not numbers alone.
pub const SCALED: &[Builtin] = &[float("ldexp", "ldexp(a, j)", Operands::Scaled, ldexp)];

/// A number of units in the last place, or an absolute error.
pub const BOUNDED: &[Builtin] = floats![
    "/", "a / b", Two, |[a, b, _]| point(a).over(point(b));
    "inverseSqrt", "inverseSqrt(a)", One, |[a, ..]| point(a).inverse_sqrt();
    "exp", "exp(a)", One, |[a, ..]| point(a).exp();
    "exp2", "exp2(a)", One, |[a, ..]| point(a).exp2();
    "log", "log(a)", One, |[a, ..]| point(a).log();
    "log2", "log2(a)", One, |[a, ..]| point(a).log2();
    "sin", "sin(a)", One, |[a, ..]| point(a).circular(libm::sin);
    "cos", "cos(a)", One, |[a, ..]| point(a).circular(libm::cos);
    "atan", "atan(a)", One, |[a, ..]| point(a).atan();
    "atan2", "atan2(a, b)", Two, |[a, b, _]| atan2(a, b);
    "acos", "acos(a)", One, |[a, ..]| if a.abs() > 1.0 { ANY } else { near(libm::acos(a), 6.77e-5) };
    "asin", "asin(a)", One, |[a, ..]| if a.abs() > 1.0 { ANY } else { near(libm::asin(a), 6.77e-5) };
    "tanh", "tanh(a)", One, |[a, ..]| near(libm::tanh(a), 1.0e-5);
];

/// Inherited from a formula.
pub const INHERITED: &[Builtin] = floats![
    "%", "a % b", Two, |[a, b, _]| remainder(a, b);
    "sqrt", "sqrt(a)", One, |[a, ..]| point(a).sqrt();
    "tan", "tan(a)", One, |[a, ..]| point(a).circular(libm::sin).over(point(a).circular(libm::cos));
    "sinh", "sinh(a)", One, |[a, ..]| sinh(a);
    "cosh", "cosh(a)", One, |[a, ..]| cosh(a);
    "acosh", "acosh(a)", One, |[a, ..]| point(a).plus(point(a).times(point(a)).minus(point(1.0)).sqrt()).log();
    "asinh", "asinh(a)", One, |[a, ..]| point(a).plus(point(a).times(point(a)).plus(point(1.0)).sqrt()).log();
    "atanh", "atanh(a)", One, |[a, ..]| {
        let ratio = point(1.0).plus(point(a)).over(point(1.0).minus(point(a)));
        ratio.log().times(point(0.5))
    };
    "degrees", "degrees(a)", One, |[a, ..]| degrees(a, 57.295_779_513_082_32);
    "radians", "radians(a)", One, |[a, ..]| degrees(a, 0.017_453_292_519_943_295);
    "fract", "fract(a)", One, |[a, ..]| point(a).minus(point(libm::floor(a)));
    "pow", "pow(a, b)", Two, |[a, b, _]| point(b).times(point(a).log2()).exp2();
    "fma", "fma(a, b, c)", Three, |[a, b, c]| point(a).times(point(b)).plus(point(c)).or(rounded(a * b + c));
    "mix", "mix(a, b, c)", Three, |[a, b, c]| {
        point(a).times(point(1.0).minus(point(c))).plus(point(b).times(point(c)))
    };
    "smoothstep", "smoothstep(a, b, c)", Three, |[a, b, c]| smoothstep(a, b, c);
    "dot", "dot(vec2f(a, b), vec2f(b, c))", Three, |[a, b, c]| dot(&[point(a), point(b)], &[point(b), point(c)]);
    "dot of three", "dot(vec3f(a, b, c), vec3f(b, c, a))", Three, |[a, b, c]| {
        let [a, b, c] = [a, b, c].map(point);
        dot(&[a, b, c], &[b, c, a])
    };
    "matrix times vector", "(mat2x2f(a, b, b, c) * vec2f(c, a)).x", Three, |[a, b, c]| {
        dot(&[point(a), point(b)], &[point(c), point(a)])
    };
    "cross", "cross(vec3f(a, b, c), vec3f(b, c, a)).x", Three, |[a, b, c]| {
        point(b).times(point(a)).minus(point(c).times(point(c)))
    };
    "length", "length(vec2f(a, b))", Two, |[a, b, _]| length(&[point(a), point(b)]);
    "length of a scalar", "length(a)", One, |[a, ..]| point(a).times(point(a)).sqrt();
    "distance", "distance(vec2f(a, b), vec2f(b, c))", Three, |[a, b, c]| {
        length(&[point(a).minus(point(b)), point(b).minus(point(c))])
    };
    "normalize", "normalize(vec2f(a, b)).x", Two, |[a, b, _]| point(a).over(length(&[point(a), point(b)]));
    "reflect", "reflect(vec2f(a, b), vec2f(b, c)).x", Three, |[a, b, c]| reflect(a, b, c);
    "refract", "refract(vec2f(a, b), vec2f(b, a), c).x", Three, |[a, b, c]| refract(a, b, c);
    "faceForward", "faceForward(vec2f(a, b), vec2f(b, c), vec2f(c, a)).x", Three, |[a, b, c]| face_forward(a, b, c);
];
