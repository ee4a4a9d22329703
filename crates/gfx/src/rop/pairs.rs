//! Four 8-bit channels, replaced or blended in codes, two quads at a time: the operations of [`super::number`] in vectors.
//!
//! A vector has a pixel in each of eight words, two channels of it in 16 bits each: the first and the third, or the second and alpha. Factors
//! are data and not branches. Loops over arrays of 64 pixels (every step through memory) took three times the instructions.

use fearless_simd::{f32x8, prelude::*, u8x32, u16x16, u32x4, u32x8};

use super::equation::{Operand, Weight};
use super::{Colors, select_mask};
use crate::simd::{Simd, inlined, least, most};
use crate::state::{BlendComponent, BlendFactor, BlendOp};
use num::{Lanes, QUADS};

/// A vector for the first and third channel, and one for the second and alpha.
type Pair<V> = [u16x16<V>; 2];

/// Pixels as words of four codes.
type Pixels<V> = u8x32<V>;

/// Two codes of 1 in a word.
const ONES: u32 = 0x00ff_00ff;
/// The upper of them.
const UPPER: u32 = 0xffff_0000;
/// Alpha in the word of a pixel.
const ALPHA: u32 = 0xff00_0000;

/// What a factor names.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Of {
    Source,
    Stored,
    Constant,
    /// The second source.
    Second,
    /// The lesser of the source's alpha and what the stored alpha lacks to 1.
    Lesser,
}

/// A factor: the numbers of an operand for the colour and of one for alpha, as far as they are kept, or what they lack to 1.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Factor {
    color: Of,
    alpha: Of,
    /// Whether the colour's is the operand's alpha.
    by_alpha: bool,
    keep: [u32; 2],
    flip: [u32; 2],
}

impl Factor {
    fn of([color, alpha]: [BlendFactor; 2]) -> Factor {
        // An operand, whether its alpha, whether it is kept, whether what it lacks is meant.
        let one = |factor: BlendFactor, is_alpha: bool| match Weight::new(factor, is_alpha) {
            // Times 255 is exact: the nearest integer to `255 x / 255`.
            Weight::Zero => (Of::Source, false, false, false),
            Weight::One => (Of::Source, false, false, true),
            Weight::Saturated => (Of::Lesser, false, true, false),
            Weight::Of { operand, alpha, rest } => {
                let of = match operand {
                    Operand::Source => Of::Source,
                    Operand::Stored => Of::Stored,
                    Operand::Constant => Of::Constant,
                    Operand::Second => Of::Second,
                };
                (of, alpha, true, rest)
            }
        };
        let (color, alpha) = (one(color, false), one(alpha, true));
        let words = |color: bool, alpha: bool| {
            let of = |which: bool| if which { ONES } else { 0 };
            [of(color), of(color) & !UPPER | of(alpha) & UPPER]
        };
        let (keep, flip) = (words(color.2, alpha.2), words(color.3, alpha.3));
        Factor { color: color.0, alpha: alpha.0, by_alpha: color.1, keep, flip }
    }

    /// Whether it is 0 for all channels.
    fn is_zero(&self) -> bool {
        [self.keep, self.flip] == [[0; 2]; 2]
    }

    /// Whether it is the same for all channels and depends on nothing but the source's alpha.
    fn is_by_source_alpha(&self) -> bool {
        let is_alpha = self.alpha == Of::Source && (self.color == Of::Source && self.by_alpha || self.keep[0] == 0);
        is_alpha && self.keep[0] == self.keep[1] && self.flip[0] == self.flip[1]
    }

    /// What it makes of half of an operand's channels.
    #[inline(always)]
    fn of_half<V: Simd>(&self, half: usize, channels: u16x16<V>) -> u16x16<V> {
        let channels: u32x8<V> = channels.bitcast();
        (channels & self.keep[half] ^ self.flip[half]).bitcast()
    }

    /// Whether it is 1 for all channels.
    fn is_one(&self) -> bool {
        [self.keep, self.flip] == [[0; 2], [ONES; 2]]
    }
}

/// What becomes of the source.
#[derive(Clone, Copy, Debug, PartialEq)]
enum BlendOperation {
    Replace,
    /// The source times a factor.
    Source(Factor),
    /// What is stored times a factor.
    Stored(Factor),
    Add([Factor; 2]),
    /// The source times a factor, added to what is stored.
    AddTo(Factor),
    Subtract([Factor; 2]),
    ReverseSubtract([Factor; 2]),
    /// An operation for the colour and one for alpha.
    Each([Factor; 2], [BlendOp; 2]),
}

/// The state of a target with four 8-bit channels, not sRGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pairs {
    way: BlendOperation,
    bgra: bool,
    /// Whether a factor names the second source.
    dual: bool,
    /// Codes of the constant.
    constant: [u16; 4],
    /// Bits that are written.
    bits: u32,
}

impl Pairs {
    /// The source replaces what is stored.
    pub(super) fn replace(bgra: bool, bits: u32) -> Pairs {
        Pairs { way: BlendOperation::Replace, bgra, dual: false, constant: [0; 4], bits }
    }

    /// The source is blended. `dual`: whether a factor names the second source.
    pub(super) fn blend([color, alpha]: [BlendComponent; 2], bgra: bool, dual: bool, constant: [u16; 4], bits: u32) -> Pairs {
        let factors = [Factor::of([color.src, alpha.src]), Factor::of([color.dst, alpha.dst])];
        let way = match color.op {
            _ if color.op != alpha.op => BlendOperation::Each(factors, [color.op, alpha.op]),
            BlendOp::Add if factors[1].is_zero() => BlendOperation::Source(factors[0]),
            BlendOp::Add if factors[0].is_zero() => BlendOperation::Stored(factors[1]),
            BlendOp::Add if factors[1].is_one() => BlendOperation::AddTo(factors[0]),
            BlendOp::Add => BlendOperation::Add(factors),
            BlendOp::Subtract => BlendOperation::Subtract(factors),
            BlendOp::ReverseSubtract => BlendOperation::ReverseSubtract(factors),
            BlendOp::Min | BlendOp::Max => BlendOperation::Each(factors, [color.op; 2]),
        };
        Pairs { way, bgra, dual, constant, bits }
    }

    /// As [`super::ColorState::blend_batch`]; `src` has the first and the second source.
    #[inline(always)]
    pub(super) fn batch<V: Simd>(
        &self,
        simd: V,
        samples: usize,
        quads: usize,
        (at, coverage): (&[u32; QUADS], &[u16; QUADS]),
        src: [[&Lanes; 4]; 2],
        tile: &mut [u32],
    ) {
        let src = src.map(|color| color.map(|channel| bytemuck::cast_ref::<_, [[f32; 8]; QUADS / 2]>(&channel.0)));
        self.blend_all(simd, samples, &Batch { quads: quads.min(QUADS), at, coverage, src }, tile);
    }

    /// As [`super::ColorState::blend_group`]; `src` has the first and the second source.
    #[inline(always)]
    pub(super) fn group<V: Simd>(
        &self,
        simd: V,
        samples: usize,
        (at, coverage): (&[u8; 4], &[u16; 4]),
        src: [&Colors<16>; 2],
        block: &mut [u32],
    ) {
        let src = src.map(|color| color.each_ref().map(bytemuck::cast_ref::<_, [[f32; 8]; 2]>));
        self.blend_all(simd, samples, &Batch { quads: 4, at: &at.map(u32::from), coverage, src }, block);
    }

    #[inline(always)]
    fn blend_all<V: Simd, const P: usize>(&self, simd: V, samples: usize, batch: &Batch<'_, P>, tile: &mut [u32]) {
        let tile = tile.as_chunks_mut().0;
        if samples == 1 {
            self.blend_samples::<V, 1, P>(simd, batch, tile);
        } else {
            assert_eq!(samples, 4, "samples of a pixel");
            self.blend_samples::<V, 4, P>(simd, batch, tile);
        }
    }

    #[inline(always)]
    fn blend_samples<V: Simd, const S: usize, const P: usize>(&self, simd: V, batch: &Batch<'_, P>, tile: &mut [[u32; 4]]) {
        macro_rules! run {
            ($new:expr) => {
                self.run::<V, S, P>(
                    simd,
                    batch,
                    tile,
                    #[inline(always)]
                    $new,
                )
            };
        }
        match &self.way {
            BlendOperation::Replace => run!(|of: &Operands<V>| join(of.source)),
            BlendOperation::Source(factor) => run!(|of: &Operands<V>| times(of.source, factor, of)),
            BlendOperation::Stored(factor) => run!(|of: &Operands<V>| times(of.stored, factor, of)),
            BlendOperation::AddTo(factor) if factor.is_one() => {
                run!(|of: &Operands<V>| join(of.source).saturating_add(join(of.stored)));
            }
            BlendOperation::AddTo(factor) => {
                run!(|of: &Operands<V>| times(of.source, factor, of).saturating_add(join(of.stored)))
            }
            // The most frequent of all.
            BlendOperation::Add([a, b]) if a.is_by_source_alpha() && b.is_by_source_alpha() => run!(|of: &Operands<V>| {
                let alpha = alphas(of.source);
                let (a, b) = (a.of_half(0, alpha), b.of_half(0, alpha));
                let source = [product(of.source[0], a), product(of.source[1], a)];
                let stored = [product(of.stored[0], b), product(of.stored[1], b)];
                join(source).saturating_add(join(stored))
            }),
            BlendOperation::Add([a, b]) => {
                run!(|of: &Operands<V>| times(of.source, a, of).saturating_add(times(of.stored, b, of)));
            }
            BlendOperation::Subtract([a, b]) => {
                run!(|of: &Operands<V>| times(of.source, a, of).saturating_sub(times(of.stored, b, of)));
            }
            BlendOperation::ReverseSubtract([a, b]) => {
                run!(|of: &Operands<V>| times(of.stored, b, of).saturating_sub(times(of.source, a, of)));
            }
            BlendOperation::Each(factors, ops) => run!(|of: &Operands<V>| {
                let (color, alpha) = (words(operation(ops[0], factors, of)), words(operation(ops[1], factors, of)));
                (color & !ALPHA | alpha & ALPHA).bitcast()
            }),
        }
    }

    /// `new` makes pixels of the operands. Not inlined: there is one for each way.
    #[inline(never)]
    fn run<V: Simd, const S: usize, const P: usize>(
        &self,
        simd: V,
        batch: &Batch<'_, P>,
        tile: &mut [[u32; 4]],
        new: impl Fn(&Operands<V>) -> Pixels<V>,
    ) {
        simd.vectorize(
            #[inline(always)]
            || self.run_here::<V, S, P>(simd, batch, tile, new),
        );
    }

    #[inline(always)]
    fn run_here<V: Simd, const S: usize, const P: usize>(
        &self,
        simd: V,
        batch: &Batch<'_, P>,
        tile: &mut [[u32; 4]],
        new: impl Fn(&Operands<V>) -> Pixels<V>,
    ) {
        let (first, third) = if self.bgra { (2, 0) } else { (0, 2) };
        let constant = |c: usize| u32::from(self.constant[c]);
        let (lower, upper) = (constant(first) | constant(third) << 16, constant(1) | constant(3) << 16);
        let constant: Pair<V> = [u32x8::splat(simd, lower).bitcast(), u32x8::splat(simd, upper).bitcast()];
        let source_of = inlined(
            #[inline(always)]
            |(src, i): (&[&[[f32; 8]; P]; 4], usize)| -> Pair<V> {
                // Four calls: what `map` calls is not always inlined.
                let (a, b) = (codes(simd, src[first][i % P]), codes(simd, src[third][i % P]));
                let (c, d) = (codes(simd, src[1][i % P]), codes(simd, src[3][i % P]));
                [(a & ONES | b << 16).bitcast(), (c & ONES | d << 16).bitcast()]
            },
        );
        let blend = inlined(
            #[inline(always)]
            |(source, second, old, masks): (Pair<V>, Pair<V>, [[u32; 4]; 2], [u16; 2])| -> [[u32; 4]; 2] {
                let two = inlined(
                    #[inline(always)]
                    |[a, b]: [[u32; 4]; 2]| -> u32x8<V> { u32x4::simd_from(simd, a).combine(u32x4::simd_from(simd, b)) },
                );
                let old = two(old);
                let stored = [(old & ONES).bitcast(), (old >> 8 & ONES).bitcast()];
                let new = words(new(&Operands { source, stored, constant, second }));
                let write = two([select_mask(masks[0] as u8), select_mask(masks[1] as u8)]) & self.bits;
                let (first, second) = (old & !write | new & write).split();
                [first.into(), second.into()]
            },
        );
        let places = batch.at.as_chunks::<2>().0.iter().zip(batch.coverage.as_chunks::<2>().0);
        for (i, (&at, &(mut covered))) in places.enumerate().take(batch.quads.div_ceil(2)) {
            if 2 * i + 1 == batch.quads {
                covered[1] = 0;
            }
            let source = source_of((&batch.src[0], i));
            let second = if self.dual { source_of((&batch.src[1], i)) } else { source };
            let [p, q] = at.map(|at| at as usize * S);
            if at[0] != at[1] && covered[0] != 0 && covered[1] != 0 {
                for s in 0..S {
                    let masks = [covered[0] >> (4 * s), covered[1] >> (4 * s)];
                    let new = blend((source, second, [tile[p + s], tile[q + s]], masks));
                    (tile[p + s], tile[q + s]) = (new[0], new[1]);
                }
                continue;
            }
            // One of them is absent, or both have one place: then they are blended one after the other.
            for (half, place) in [p, q].into_iter().enumerate().filter(|(half, _)| covered[*half] != 0) {
                for s in 0..S {
                    let new = blend((source, second, [tile[place + s]; 2], [covered[half] >> (4 * s); 2]));
                    tile[place + s] = new[half];
                }
            }
        }
    }
}

/// The quads of at most `P` pairs, with their first and second source.
struct Batch<'a, const P: usize> {
    quads: usize,
    at: &'a [u32],
    coverage: &'a [u16],
    src: [[&'a [[f32; 8]; P]; 4]; 2],
}

/// The operands of an equation.
struct Operands<V: Simd> {
    source: Pair<V>,
    stored: Pair<V>,
    constant: Pair<V>,
    /// The second source.
    second: Pair<V>,
}

/// [`crate::texel::unorm`]; the bits above the lower 16 are those of 2^23.
#[inline(always)]
fn codes<V: Simd>(simd: V, color: [f32; 8]) -> u32x8<V> {
    let color = f32x8::simd_from(simd, color);
    let color = least(most(color, f32x8::splat(simd, 0.0)), f32x8::splat(simd, 1.0));
    (color * 255.0 + 8_388_608.0).to_bits()
}

/// The words of pixels.
#[inline(always)]
fn words<V: Simd>(pixels: Pixels<V>) -> u32x8<V> {
    pixels.bitcast()
}

/// Pixels of their channels.
#[inline(always)]
fn join<V: Simd>([lower, upper]: Pair<V>) -> Pixels<V> {
    (lower | upper << 8).bitcast()
}

/// Applies an operation to all channels.
#[inline(always)]
fn operation<V: Simd>(op: BlendOp, [a, b]: &[Factor; 2], of: &Operands<V>) -> Pixels<V> {
    match op {
        BlendOp::Add => times(of.source, a, of).saturating_add(times(of.stored, b, of)),
        BlendOp::Subtract => times(of.source, a, of).saturating_sub(times(of.stored, b, of)),
        BlendOp::ReverseSubtract => times(of.stored, b, of).saturating_sub(times(of.source, a, of)),
        BlendOp::Min => join(of.source).min(join(of.stored)),
        BlendOp::Max => join(of.source).max(join(of.stored)),
    }
}

/// Numbers times a factor, as pixels.
#[inline(always)]
fn times<V: Simd>(numbers: Pair<V>, factor: &Factor, of: &Operands<V>) -> Pixels<V> {
    // The same choices for all pixels: branches, since to store all that may be chosen and to load one of them takes longer.
    let operand = inlined(
        #[inline(always)]
        |which: Of| match which {
            Of::Source => of.source,
            Of::Stored => of.stored,
            Of::Constant => of.constant,
            Of::Second => of.second,
            Of::Lesser => {
                let lacks: u32x8<V> = alphas(of.stored).bitcast();
                [alphas(of.source).min((lacks ^ ONES).bitcast::<u16x16<V>>()); 2]
            }
        },
    );
    let color = operand(factor.color);
    let color = if factor.by_alpha { [alphas(color); 2] } else { color };
    let (lower, upper): (u32x8<V>, u32x8<V>) = (color[1].bitcast(), operand(factor.alpha)[1].bitcast());
    let by = (lower & !UPPER | upper & UPPER).bitcast();
    join([product(numbers[0], factor.of_half(0, color[0])), product(numbers[1], factor.of_half(1, by))])
}

/// Alpha in both halves of a word.
#[inline(always)]
fn alphas<V: Simd>(of: Pair<V>) -> u16x16<V> {
    let alpha: u32x8<V> = of[1].bitcast();
    (alpha & UPPER | alpha >> 16).bitcast()
}

/// [`super::number::Number::times`] of codes.
#[inline(always)]
fn product<V: Simd>(a: u16x16<V>, b: u16x16<V>) -> u16x16<V> {
    let product = a * b + 128;
    (product + (product >> 8)) >> 8
}
