//! Every numeric built-in function, operator and conversion of WGSL at its special values.
//!
//! What a result may be is WGSL's own rule, evaluated in `f64`: one value, a number of units in the last place, an absolute error, or
//! what a formula of other functions comes to ([`interval`]). Operands are those that the WebGPU conformance suite tries: zeros, ends of
//! the subnormal and normal numbers, neighbours of integers, halves between them, fractions of pi, ends of the integer types; and
//! others at random. WGSL leaves open what infinities and what is no number give, and whether subnormal numbers are flushed to 0:
//! no operand is infinite, results that may overflow are not looked at, and a subnormal number may count as 0. It promises nothing for
//! `determinant`, which is not among them.

mod floats;
mod interval;
mod words;

use anyhow::{Context, Result, ensure};

use super::programs::{GROUP, program, run};
use crate::{Row, Section, Setting, Target};
use gfx::vertex::half_to_f32;
use interval::Interval;
use num::Random;

pub const BUILTINS: Target = Target {
    id: "builtins",
    section: Section::Raster,
    what: "Every numeric built-in function, operator and conversion of WGSL, at the special values of the WebGPU conformance suite \
           and at random",
    bound: "each result within what WGSL allows: exact, correctly rounded, n ULP, an absolute error, or inherited from a formula",
    fault: "the last bit of the first operand is inverted",
    check,
};

/// What a result may be.
#[derive(Clone, Copy, Debug)]
pub enum Want {
    /// This word.
    Word(u32),
    /// One of two.
    Either(u32, u32),
    /// A number in an interval.
    In(Interval),
}

impl Want {
    /// Whether anything is promised.
    fn promises(self) -> bool {
        !matches!(self, Want::In(interval) if interval.is_any())
    }

    fn allows(self, got: u32) -> bool {
        match self {
            Want::Word(word) => got == word,
            Want::Either(one, other) => got == one || got == other,
            Want::In(interval) => interval.allows(f32::from_bits(got)),
        }
    }
}

/// What operands an entry is tried with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Operands {
    /// A number, two, three.
    One,
    Two,
    Three,
    /// A number and a signed word.
    Scaled,
    /// Two halves, as codes; what is expected is made of the same numbers as `f32`.
    Halves,
    /// A word, two, three.
    Words1,
    Words2,
    Words3,
}

/// A built-in function, operator or conversion.
pub struct Builtin {
    pub name: &'static str,
    /// In WGSL.
    pub expression: &'static str,
    /// Whether the result is an `f32`; else it is a word.
    pub float: bool,
    pub operands: Operands,
    /// What WGSL allows for these operands.
    pub want: fn([u32; 3]) -> Want,
}

const GROUPS: [(&str, &[&[Builtin]]); 4] = [
    ("correctly rounded", &[floats::ROUNDED, floats::SCALED]),
    ("within ULP or an absolute error", &[floats::BOUNDED]),
    ("inherited from a formula", &[floats::INHERITED]),
    ("words, conversions and packing", &[words::WORDS, words::CONVERSIONS]),
];

/// Numbers with something special, which are tried with both signs.
fn special() -> Vec<f32> {
    use std::f32::consts::PI;
    let bits = |list: &[u32]| list.iter().map(|&bits| f32::from_bits(bits)).collect::<Vec<_>>();
    let power = |exponent: i32| libm::ldexpf(1.0, exponent);
    // Zero, subnormal numbers, the ends of the normal ones, neighbours of 1.
    let mut all =
        bits(&[0, 1, 2, 0x40_0000, 0x7f_ffff, 0x80_0000, 0x80_0001, 0x7f7f_fffe, 0x7f7f_ffff, 0x3f7f_ffff, 0x3f80_0001]);
    // Powers of 2 where exponents, mantissas and the types' ends are.
    all.extend(
        [-126, -64, -25, -24, -23, -15, -14, -11, -1, 0, 1, 2, 10, 11, 15, 16, 22, 23, 24, 31, 32, 63, 126, 127].map(power),
    );
    all.extend([22, 23, 24, 31, 32].map(|exponent| power(exponent).next_down()));
    all.extend([22, 23, 24, 31, 32].map(|exponent| power(exponent).next_up()));
    // Ties and their neighbours.
    all.extend([0.5, 1.5, 2.5, 3.5, 4_194_303.5].into_iter().flat_map(|x: f32| [x.next_down(), x, x.next_up()]));
    all.extend([1.0 / 254.0, 3.0 / 254.0, 1.0 / 510.0, 1.0 / 65_534.0, 127.5, 126.5]);
    // Fractions of pi.
    all.extend([6.0, 4.0, 3.0, 2.0, 1.5, 1.0].map(|part| PI / part));
    // Ends of the halves.
    all.extend([65_504.0, 65_519.996, 65_520.0, 6.103_515_6e-5, 6.097_555e-5, 5.960_464_5e-8, 2.980_232_2e-8]);
    all.extend([0.1, 0.9, 1.11, 3.0, 10.0, 10.0001, 88.7, 87.3, 100.25, 1.0e9, 1.0e-9]);
    all.iter().flat_map(|&x| [x, -x]).collect()
}

/// Fewer, of which all triples are tried.
const SPARSE: [f32; 17] = [
    0.0,
    1.0,
    -1.0,
    0.5,
    -0.5,
    2.0,
    -3.0,
    0.1,
    -10.5,
    1000.0,
    1.0e-6,
    f32::MIN_POSITIVE,
    1.0e-40,
    -1.0e-40,
    1.0e19,
    f32::MAX,
    f32::MIN,
];

const WORDS: [u32; 34] = [
    0,
    1,
    2,
    3,
    4,
    5,
    7,
    8,
    15,
    16,
    30,
    31,
    32,
    33,
    127,
    128,
    255,
    256,
    0x7fff,
    0x8000,
    0xffff,
    0x1_0000,
    0x5555_5555,
    0xaaaa_aaaa,
    0x7000_0000,
    0x7fff_ff80,
    0x7fff_fffe,
    0x7fff_ffff,
    0x8000_0000,
    0x8000_0001,
    0x807f_ff01,
    0xffff_ff80,
    0xffff_fffe,
    u32::MAX,
];

/// Of which all triples are tried.
const FEW_WORDS: [u32; 16] =
    [0, 1, 2, 5, 8, 24, 31, 32, 40, 127, 200, 0x1234_5678, 0x7fff_ffff, 0x8000_0000, 0xffff_ff01, u32::MAX];

/// Two lists, every element of one with every one of the other.
fn pairs(one: &[u32], two: &[u32]) -> Vec<[u32; 3]> {
    one.iter().flat_map(|&x| two.iter().map(move |&y| [x, y, 0])).collect()
}

fn triples(list: &[u32]) -> Vec<[u32; 3]> {
    let pairs = pairs(list, list);
    pairs.iter().flat_map(|&[x, y, _]| list.iter().map(move |&z| [x, y, z])).collect()
}

impl Operands {
    /// Which of the operands are numbers, that may be flushed.
    fn numbers(self) -> usize {
        match self {
            Operands::One | Operands::Scaled => 1,
            Operands::Two | Operands::Halves => 2,
            Operands::Three => 3,
            Operands::Words1 | Operands::Words2 | Operands::Words3 => 0,
        }
    }

    fn special(self) -> Vec<[u32; 3]> {
        let bits = |list: &[f32]| list.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        let halves = || {
            let codes =
                [0, 1, 2, 0x200, 0x3ff, 0x400, 0x401, 0x3800, 0x3bff, 0x3c00, 0x3c01, 0x3e00, 0x4100, 0x6400, 0x6bff, 0x7bff];
            codes.into_iter().flat_map(|code| [code, code | 0x8000]).collect::<Vec<u32>>()
        };
        let alone = |list: Vec<u32>| list.into_iter().map(|x| [x, 0, 0]).collect();
        match self {
            Operands::One => alone(bits(&special())),
            Operands::Two => pairs(&bits(&special()), &bits(&special())),
            Operands::Three => triples(&bits(&SPARSE)),
            Operands::Scaled => {
                let exponents = [-300, -280, -150, -149, -127, -126, -125, -24, -1, 0, 1, 2, 24, 126, 127, 128];
                pairs(&bits(&special()), &exponents.map(|exponent: i32| exponent as u32))
            }
            Operands::Halves => pairs(&halves(), &halves()),
            Operands::Words1 => alone(WORDS.to_vec()),
            Operands::Words2 => pairs(&WORDS, &WORDS),
            Operands::Words3 => triples(&FEW_WORDS),
        }
    }

    fn random(self, random: &mut Random) -> [u32; 3] {
        // Of every size, or of those sizes where most functions have their shape.
        let wild = random.below(2) == 0;
        let mut number = || loop {
            let x = if wild { f32::from_bits(random.bits()) } else { random.range(-8.0, 8.0) };
            if x.is_finite() {
                return x.to_bits();
            }
        };
        match self {
            Operands::One | Operands::Two | Operands::Three => [number(), number(), number()],
            Operands::Scaled => [number(), random.between(-160, 129) as u32, 0],
            Operands::Halves => [0; 3].map(|_| {
                loop {
                    let code = random.bits() & 0xffff;
                    if code & 0x7c00 != 0x7c00 {
                        return code;
                    }
                }
            }),
            Operands::Words1 | Operands::Words2 | Operands::Words3 => {
                let shift = random.below(32);
                [random.bits(), random.bits() >> shift, random.bits() >> random.below(32)]
            }
        }
    }

    /// The numbers that stand for the operands where these are codes.
    fn meant(self, operands: [u32; 3]) -> [u32; 3] {
        if self == Operands::Halves { operands.map(|code| half_to_f32(code as u16).to_bits()) } else { operands }
    }
}

/// The operands with some of their subnormal numbers flushed.
fn flushed(operands: [u32; 3], numbers: usize) -> impl Iterator<Item = [u32; 3]> {
    let tiny = move |k: usize| k < numbers && f32::from_bits(operands[k]).is_subnormal();
    (0..8_u32)
        .filter(move |which| (0..3).all(|k| which >> k & 1 == 0 || tiny(k)))
        .map(move |which| std::array::from_fn(|k| if which >> k & 1 != 0 { operands[k] & 1 << 31 } else { operands[k] }))
}

/// What an entry came to: results that are not allowed, those that were looked at, and the first wrong one in words.
fn try_out(builtin: &Builtin, setting: &Setting, number: u64) -> Result<(u64, u64, String)> {
    let expression =
        if builtin.float { format!("bitcast<u32>({})", builtin.expression) } else { builtin.expression.to_owned() };
    let program = program(&expression)?;
    let mut operands = builtin.operands.special();
    let mut random = Random::nth(setting.seed, number);
    operands.extend((0..setting.pick(256, 16_384, 1 << 20)).map(|_| builtin.operands.random(&mut random)));
    operands.resize(operands.len().next_multiple_of(GROUP), operands[0]);
    let spoiled = |&[x, y, z]: &[u32; 3]| [x ^ u32::from(setting.inject_fault), y, z];
    let got = run(&program, &operands.iter().map(spoiled).collect::<Vec<_>>())?;
    let (mut wrong, mut seen, mut first) = (0, 0, String::new());
    for (&operands, got) in operands.iter().zip(got) {
        let meant = builtin.operands.meant(operands);
        let wants = || flushed(meant, builtin.operands.numbers()).map(builtin.want);
        if wants().any(|want| !want.promises()) {
            continue;
        }
        seen += 1;
        if !wants().any(|want| want.allows(got)) {
            if wrong == 0 {
                let numbers = meant.map(f32::from_bits);
                let number = f32::from_bits(got);
                first = format!(
                    "{}: {meant:x?} {numbers:?} gives {got:x} {number:?}, not {:x?}",
                    builtin.name,
                    (builtin.want)(meant)
                );
            }
            wrong += 1;
        }
    }
    ensure!(seen >= 8, "{}: only {seen} results are promised anything", builtin.name);
    Ok((wrong, seen, first))
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (group, lists) in GROUPS {
        let builtins: Vec<&Builtin> = lists.iter().copied().flatten().collect();
        let count = builtins.len() as u64;
        let tried =
            setting.pieces(count, |k, _| try_out(builtins[k as usize], setting, k).with_context(|| builtins[k as usize].name));
        let tried = tried.into_iter().collect::<Result<Vec<_>>>()?;
        let wrong = tried.iter().map(|(wrong, ..)| wrong).sum();
        rows.push(Row::none(format!("{group}, {count} functions and operators: results that are not allowed"), wrong));
        rows.extend(tried.into_iter().filter(|(wrong, ..)| *wrong > 0).map(|(wrong, _, first)| Row::none(first, wrong)));
    }
    Ok(rows)
}
