//! Arithmetic of shaders: programs in WGSL, run, against `f64`.

use anyhow::{Context, Result};

use super::numbers::ulp;
use super::programs;
use crate::{Row, Section, Setting, Target};
use num::Random;

pub const ARITHMETIC: Target = Target {
    id: "arithmetic",
    section: Section::Raster,
    what: "What programs in WGSL compute, against f64, over numbers of every size",
    bound: "WGSL's table: +, -, x correctly rounded; / 2.5 ULP, inverseSqrt and sqrt 2, exp and exp2 3 + 2|x|, log and log2 3 and 2^-21 \
            in [0.5, 2], sin and cos 2^-11 in [-pi, pi]",
    fault: "the last bit of the program's first operand is inverted",
    check,
};

/// How far off a result may be.
#[derive(Clone, Copy)]
enum ErrorBound {
    /// No error beyond rounding: the result of real arithmetic, rounded once.
    Rounded,
    /// At most this number of units in the last place.
    Ulp(f64),
    /// At most this number of units in the last place, and twice the operand more.
    UlpAndTwice(f64),
    /// At most this difference.
    Absolute(f64),
}

/// An operation, its definition, and its operands.
struct Operation {
    expression: &'static str,
    case: &'static str,
    exact: fn(f64, f64) -> f64,
    operands: fn(&mut Random) -> [f32; 2],
    bound: ErrorBound,
}

/// Any bits: numbers of every size, and now and then no number.
fn any(random: &mut Random) -> [f32; 2] {
    [f32::from_bits(random.bits()), f32::from_bits(random.bits())]
}

/// Two numbers whose sizes are near enough that their sum loses bits.
fn near(random: &mut Random) -> [f32; 2] {
    let exponent = random.between(-100, 100);
    let mut one = || {
        let sign = if random.below(2) == 0 { 1.0 } else { -1.0 };
        sign * (1.0 + random.unit()) * libm::exp2f((exponent + random.between(-26, 27)) as f32)
    };
    [one(), one()]
}

/// A positive normal number of any size.
fn positive(random: &mut Random) -> f32 {
    (1.0 + random.unit()) * libm::exp2f(random.between(-126, 128) as f32)
}

/// As WGSL has them: outside of [0.5, 2].
fn away_from_one(random: &mut Random) -> [f32; 2] {
    loop {
        let x = positive(random);
        if !(0.5..=2.0).contains(&x) {
            return [x, 0.0];
        }
    }
}

const PI: f32 = std::f32::consts::PI;

const OPERATIONS: &[Operation] = &[
    Operation { expression: "a + b", case: "+, any bits", exact: |a, b| a + b, operands: any, bound: ErrorBound::Rounded },
    Operation { expression: "a + b", case: "+, near sizes", exact: |a, b| a + b, operands: near, bound: ErrorBound::Rounded },
    Operation { expression: "a - b", case: "-, near sizes", exact: |a, b| a - b, operands: near, bound: ErrorBound::Rounded },
    Operation { expression: "a * b", case: "x, any bits", exact: |a, b| a * b, operands: any, bound: ErrorBound::Rounded },
    Operation { expression: "a / b", case: "/", exact: |a, b| a / b, operands: near, bound: ErrorBound::Ulp(2.5) },
    Operation {
        expression: "inverseSqrt(a)",
        case: "inverseSqrt",
        exact: |a, _| 1.0 / libm::sqrt(a),
        operands: |random| [positive(random), 0.0],
        bound: ErrorBound::Ulp(2.0),
    },
    Operation {
        expression: "sqrt(a)",
        case: "sqrt",
        exact: |a, _| libm::sqrt(a),
        operands: |random| [positive(random), 0.0],
        bound: ErrorBound::Ulp(2.0),
    },
    Operation {
        expression: "exp2(a)",
        case: "exp2",
        exact: |a, _| libm::exp2(a),
        operands: |random| [random.range(-126.0, 127.9), 0.0],
        bound: ErrorBound::UlpAndTwice(3.0),
    },
    Operation {
        expression: "exp(a)",
        case: "exp",
        exact: |a, _| libm::exp(a),
        operands: |random| [random.range(-87.0, 88.7), 0.0],
        bound: ErrorBound::UlpAndTwice(3.0),
    },
    Operation {
        expression: "log2(a)",
        case: "log2 outside [0.5, 2]",
        exact: |a, _| libm::log2(a),
        operands: away_from_one,
        bound: ErrorBound::Ulp(3.0),
    },
    Operation {
        expression: "log2(a)",
        case: "log2 in [0.5, 2]",
        exact: |a, _| libm::log2(a),
        operands: |random| [random.range(0.5, 2.0), 0.0],
        bound: ErrorBound::Absolute(1.0 / (1 << 21) as f64),
    },
    Operation {
        expression: "log(a)",
        case: "log outside [0.5, 2]",
        exact: |a, _| libm::log(a),
        operands: away_from_one,
        bound: ErrorBound::Ulp(3.0),
    },
    Operation {
        expression: "sin(a)",
        case: "sin in [-pi, pi]",
        exact: |a, _| libm::sin(a),
        operands: |random| [random.range(-PI, PI), 0.0],
        bound: ErrorBound::Absolute(1.0 / (1 << 11) as f64),
    },
    Operation {
        expression: "cos(a)",
        case: "cos in [-pi, pi]",
        exact: |a, _| libm::cos(a),
        operands: |random| [random.range(-PI, PI), 0.0],
        bound: ErrorBound::Absolute(1.0 / (1 << 11) as f64),
    },
];

/// Operands of a piece of work: 64 a workgroup.
const PIECE: u32 = 1 << 12;

/// The error of one result, in the unit of its bound; infinite where one is a number and the other is not.
fn error(bound: ErrorBound, operand: f32, got: f32, exact: f64) -> f64 {
    if got.is_nan() || exact.is_nan() {
        return if got.is_nan() && exact.is_nan() { 0.0 } else { f64::INFINITY };
    }
    let off = (f64::from(got) - exact).abs();
    match bound {
        ErrorBound::Rounded => f64::from(u8::from(got != exact as f32)),
        ErrorBound::Ulp(_) => off / ulp(exact),
        ErrorBound::UlpAndTwice(least) => off / ulp(exact) / (least + 2.0 * f64::from(operand.abs())),
        ErrorBound::Absolute(_) => off,
    }
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (number, operation) in OPERATIONS.iter().enumerate() {
        let program = programs::program(&format!("bitcast<u32>({})", operation.expression))?;
        let of_operation = Setting { seed: setting.seed.wrapping_mul(64).wrapping_add(number as u64), ..*setting };
        let errors = of_operation.pieces(setting.pick(1, 256, 4_096), |_, random| {
            let pairs: Vec<[f32; 2]> = (0..PIECE).map(|_| (operation.operands)(random)).collect();
            let spoiled = |[a, b]: &[f32; 2]| [a.to_bits() ^ u32::from(setting.inject_fault), b.to_bits(), 0];
            let got = programs::run(&program, &pairs.iter().map(spoiled).collect::<Vec<_>>())?;
            let each = pairs
                .iter()
                .zip(got)
                .map(|(&[a, b], got)| error(operation.bound, a, f32::from_bits(got), (operation.exact)(a.into(), b.into())));
            // Wrong roundings are counted; of the others the worst counts.
            Ok(match operation.bound {
                ErrorBound::Rounded => each.sum::<f64>(),
                _ => each.fold(0.0, f64::max),
            })
        });
        let errors: Vec<f64> = errors.into_iter().collect::<Result<_>>().with_context(|| operation.case)?;
        let worst = errors.iter().copied().fold(0.0, f64::max);
        let case = operation.case;
        rows.push(match operation.bound {
            ErrorBound::Rounded => Row::exact(format!("{case}: results not rounded correctly"), 0.0, errors.iter().sum()),
            ErrorBound::Ulp(most) => Row::at_most(format!("{case}: worst, in ULP"), worst, most),
            ErrorBound::UlpAndTwice(_) => Row::at_most(format!("{case}: worst, as a share of the bound"), worst, 1.0),
            ErrorBound::Absolute(most) => Row::at_most(format!("{case}: worst, absolute"), worst, most),
        });
    }
    Ok(rows)
}
