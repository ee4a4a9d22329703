//! The blend equation in 8-bit codes ([`super::number`]) over the pixels of a group, factors as data and not as branches.

use super::Colors;
use super::equation::{Operand, Weight};
use super::number::Number;
use crate::state::{BlendComponent, BlendFactor, BlendOp};
use crate::texel::unorm;

/// Pixels of a group.
const PIXELS: usize = 16;

/// Rows of numbers that a factor may name: channel by channel the source, what is stored, the second source, and the constant.
type Rows = [[u16; PIXELS]; 16];
const STORED: usize = 4;
const SECOND: usize = 8;
const CONSTANT: usize = 12;

/// A factor: the number of a row, as far as it is kept, or what it lacks to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Factor {
    row: u8,
    keep: u16,
    flip: u16,
}

impl Factor {
    /// The factor of a channel; none where it is the lesser of two numbers.
    fn of(factor: BlendFactor, channel: usize) -> Option<Factor> {
        Some(match Weight::new(factor, channel == 3) {
            // Times 255 is exact: the nearest integer to `255 x / 255`.
            Weight::Zero => Factor { row: 0, keep: 0, flip: 0 },
            Weight::One => Factor { row: 0, keep: 0, flip: 255 },
            Weight::Saturated => return None,
            Weight::Of { operand, alpha, rest } => {
                let first = match operand {
                    Operand::Source => 0,
                    Operand::Stored => STORED,
                    Operand::Second => SECOND,
                    Operand::Constant => CONSTANT,
                };
                let row = first + if alpha { 3 } else { channel };
                Factor { row: row as u8, keep: !0, flip: if rest { 255 } else { 0 } }
            }
        })
    }
}

/// The equation of a target with four 8-bit channels, made ready.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Equation {
    /// Of the source and of what is stored, by channel.
    factors: [[Factor; 4]; 2],
    op: BlendOp,
    bgra: bool,
    constant: [u16; 4],
    dual: bool,
}

impl Equation {
    /// None where the equation is another: two operations, minimum and maximum, or a factor that is the lesser of two numbers. `dual`: whether a
    /// factor names the second source.
    pub(super) fn of([color, alpha]: [BlendComponent; 2], bgra: bool, constant: [u16; 4], dual: bool) -> Option<Equation> {
        let one = color.op == alpha.op && !matches!(color.op, BlendOp::Min | BlendOp::Max);
        let mut factors = [[Factor { row: 0, keep: 0, flip: 0 }; 4]; 2];
        for channel in 0..4 {
            let of = if channel == 3 { alpha } else { color };
            factors[0][channel] = Factor::of(of.src, channel)?;
            factors[1][channel] = Factor::of(of.dst, channel)?;
        }
        one.then_some(Equation { factors, op: color.op, bgra, constant, dual })
    }

    /// The codes of the pixels of a group.
    #[inline(always)]
    pub(super) fn blend(&self, src: &Colors<PIXELS>, src1: &Colors<PIXELS>, old: &[u32; PIXELS]) -> [u32; PIXELS] {
        // The compiler takes a loop of 16 apart before it would make vectors of it, and then makes few: it is not told that 16 is constant.
        let count = std::hint::black_box(PIXELS).min(PIXELS);
        let shift: [u32; 4] = if self.bgra { [16, 8, 0, 24] } else { [0, 8, 16, 24] };
        let mut rows: Rows = [[0; PIXELS]; 16];
        quantize(count, src, &mut rows[..STORED]);
        for i in 0..count {
            for c in 0..4 {
                rows[STORED + c][i] = (old[i] >> shift[c] & 255) as u16;
            }
        }
        if self.dual {
            second(count, src1, &mut rows[SECOND..CONSTANT]);
        }
        for c in 0..4 {
            rows[CONSTANT + c] = [self.constant[c]; PIXELS];
        }
        match self.op {
            BlendOp::Subtract => self.weigh(count, &rows, shift, u16::minus),
            BlendOp::ReverseSubtract => self.weigh(count, &rows, shift, |src, dst| dst.minus(src)),
            _ => self.weigh(count, &rows, shift, u16::plus),
        }
    }

    #[inline(always)]
    fn weigh(&self, count: usize, rows: &Rows, shift: [u32; 4], op: impl Fn(u16, u16) -> u16) -> [u32; PIXELS] {
        let mut out = [0; PIXELS];
        for c in 0..4 {
            let [src, dst] = self.factors.map(|of| of[c]);
            let (by, stored_by) = (&rows[usize::from(src.row & 15)], &rows[usize::from(dst.row & 15)]);
            for i in 0..count {
                let weighed = rows[c][i].times(by[i] & src.keep ^ src.flip);
                let stored = rows[STORED + c][i].times(stored_by[i] & dst.keep ^ dst.flip);
                out[i] |= u32::from(op(weighed, stored)) << shift[c];
            }
        }
        out
    }
}

/// [`quantize`] of the second source, which few states name: inlined, the compiler computes it for all.
#[cold]
#[inline(never)]
fn second(count: usize, colors: &Colors<PIXELS>, rows: &mut [[u16; PIXELS]]) {
    quantize(count, colors, rows);
}

/// Colours as codes: clamped, to the nearest, ties to even; NaN is 0.
#[inline(always)]
fn quantize(count: usize, colors: &Colors<PIXELS>, rows: &mut [[u16; PIXELS]]) {
    let [a, b, c, d] = rows else { return };
    for i in 0..count {
        a[i] = unorm(colors[0][i], 255.0) as u16;
        b[i] = unorm(colors[1][i], 255.0) as u16;
        c[i] = unorm(colors[2][i], 255.0) as u16;
        d[i] = unorm(colors[3][i], 255.0) as u16;
    }
}
