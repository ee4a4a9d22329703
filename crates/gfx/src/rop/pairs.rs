//! Four 8-bit channels, replaced or blended in codes, two quads at a time in AVX2 registers: the operations of [`super::number`].
//!
//! A register has a pixel in each of eight words, two channels of it in 16 bits each: the first and the third, or the second and alpha. Factors
//! are data and not branches. What the compiler made of loops over arrays of 64 pixels (every step through memory) took three times the
//! instructions.

use std::arch::x86_64::*;

use super::equation::{Operand, Weight};
use super::{Colors, select_mask};
use crate::state::{BlendComponent, BlendFactor, BlendOp};
use num::{Lanes, QUADS};

/// A register for the first and third channel, and one for the second and alpha.
type Pair = [__m256i; 2];

/// Two codes of 1 in a word.
const ONES: u32 = 0x00ff_00ff;
/// The upper of them.
const UPPER: u32 = 0xffff_0000;

/// What a factor names.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Of {
    Source,
    Stored,
    Constant,
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
    /// None where a factor is the lesser of two numbers, or names the second source.
    fn of([color, alpha]: [BlendFactor; 2]) -> Option<Factor> {
        // An operand, whether its alpha, whether it is kept, whether what it lacks is meant.
        let one = |factor: BlendFactor, is_alpha: bool| {
            Some(match Weight::new(factor, is_alpha) {
                // Times 255 is exact: the nearest integer to `255 x / 255`.
                Weight::Zero => (Of::Source, false, false, false),
                Weight::One => (Of::Source, false, false, true),
                Weight::Saturated => return None,
                Weight::Of { operand, alpha, rest } => {
                    let of = match operand {
                        Operand::Source => Of::Source,
                        Operand::Stored => Of::Stored,
                        Operand::Constant => Of::Constant,
                        Operand::Second => return None,
                    };
                    (of, alpha, true, rest)
                }
            })
        };
        let (color, alpha) = (one(color, false)?, one(alpha, true)?);
        let words = |color: bool, alpha: bool| {
            let of = |which: bool| if which { ONES } else { 0 };
            [of(color), of(color) & !UPPER | of(alpha) & UPPER]
        };
        let (keep, flip) = (words(color.2, alpha.2), words(color.3, alpha.3));
        Some(Factor { color: color.0, alpha: alpha.0, by_alpha: color.1, keep, flip })
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
    #[target_feature(enable = "avx2")]
    #[inline]
    fn of_half(&self, half: usize, channels: __m256i) -> __m256i {
        let kept = _mm256_and_si256(channels, _mm256_set1_epi32(self.keep[half] as i32));
        _mm256_xor_si256(kept, _mm256_set1_epi32(self.flip[half] as i32))
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
}

/// The state of a target with four 8-bit channels, not sRGB.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Pairs {
    way: BlendOperation,
    bgra: bool,
    /// Codes of the constant.
    constant: [u16; 4],
    /// Bits that are written.
    bits: u32,
}

impl Pairs {
    /// The source replaces what is stored.
    pub(super) fn replace(bgra: bool, bits: u32) -> Pairs {
        Pairs { way: BlendOperation::Replace, bgra, constant: [0; 4], bits }
    }

    /// The source is blended; none where the equation is another: two operations, minimum and maximum, or a factor that [`Factor`] is not.
    pub(super) fn blend([color, alpha]: [BlendComponent; 2], bgra: bool, constant: [u16; 4], bits: u32) -> Option<Pairs> {
        let factors = [Factor::of([color.src, alpha.src])?, Factor::of([color.dst, alpha.dst])?];
        let way = match color.op {
            _ if color.op != alpha.op => return None,
            BlendOp::Add if factors[1].is_zero() => BlendOperation::Source(factors[0]),
            BlendOp::Add if factors[0].is_zero() => BlendOperation::Stored(factors[1]),
            BlendOp::Add if factors[1].is_one() => BlendOperation::AddTo(factors[0]),
            BlendOp::Add => BlendOperation::Add(factors),
            BlendOp::Subtract => BlendOperation::Subtract(factors),
            BlendOp::ReverseSubtract => BlendOperation::ReverseSubtract(factors),
            BlendOp::Min | BlendOp::Max => return None,
        };
        Some(Pairs { way, bgra, constant, bits })
    }

    /// As [`super::ColorState::blend_batch`] with one or four samples, without a second source.
    #[target_feature(enable = "avx2")]
    pub(super) fn batch<const S: usize>(
        &self,
        quads: usize,
        at: &[u32; QUADS],
        coverage: &[u16; QUADS],
        src: [&Lanes; 4],
        tile: &mut [u32],
    ) {
        let src = src.map(|channel| bytemuck::cast_ref::<_, [[u32; 8]; QUADS / 2]>(&channel.0));
        self.blend_all::<S, _>(&Batch { quads: quads.min(QUADS), at, coverage, src }, tile);
    }

    /// As [`super::ColorState::blend_group`] with one or four samples, without a second source.
    #[target_feature(enable = "avx2")]
    pub(super) fn group<const S: usize>(&self, at: &[u8; 4], coverage: &[u16; 4], src: &Colors<16>, block: &mut [u32]) {
        let src = src.each_ref().map(bytemuck::cast_ref::<_, [[u32; 8]; 2]>);
        self.blend_all::<S, _>(&Batch { quads: 4, at: &at.map(u32::from), coverage, src }, block);
    }

    #[target_feature(enable = "avx2")]
    #[inline]
    fn blend_all<const S: usize, const P: usize>(&self, batch: &Batch<'_, P>, tile: &mut [u32]) {
        let tile = tile.as_chunks_mut().0;
        match &self.way {
            BlendOperation::Replace => self.run::<S, _>(batch, tile, |[source, ..]| join(source)),
            BlendOperation::Source(factor) => self.run::<S, _>(batch, tile, |of| times(of[0], factor, of)),
            BlendOperation::Stored(factor) => self.run::<S, _>(batch, tile, |of| times(of[1], factor, of)),
            BlendOperation::AddTo(factor) if factor.is_one() => {
                self.run::<S, _>(batch, tile, |[source, stored, _]| _mm256_adds_epu8(join(source), join(stored)));
            }
            BlendOperation::AddTo(factor) => {
                self.run::<S, _>(batch, tile, |of| _mm256_adds_epu8(times(of[0], factor, of), join(of[1])));
            }
            // The most frequent of all.
            BlendOperation::Add([a, b]) if a.is_by_source_alpha() && b.is_by_source_alpha() => {
                self.run::<S, _>(batch, tile, |[source, stored, _]| {
                    let alpha = alphas(source);
                    let (a, b) = (a.of_half(0, alpha), b.of_half(0, alpha));
                    let source = [product(source[0], a), product(source[1], a)];
                    let stored = [product(stored[0], b), product(stored[1], b)];
                    _mm256_adds_epu8(join(source), join(stored))
                });
            }
            BlendOperation::Add([a, b]) => {
                self.run::<S, _>(batch, tile, |of| _mm256_adds_epu8(times(of[0], a, of), times(of[1], b, of)));
            }
            BlendOperation::Subtract([a, b]) => {
                self.run::<S, _>(batch, tile, |of| _mm256_subs_epu8(times(of[0], a, of), times(of[1], b, of)));
            }
            BlendOperation::ReverseSubtract([a, b]) => {
                self.run::<S, _>(batch, tile, |of| _mm256_subs_epu8(times(of[1], b, of), times(of[0], a, of)));
            }
        }
    }

    /// `new` makes pixels of the source, of what is stored and of the constant.
    #[target_feature(enable = "avx2")]
    #[inline]
    fn run<const S: usize, const P: usize>(
        &self,
        batch: &Batch<'_, P>,
        tile: &mut [[u32; 4]],
        new: impl Fn([Pair; 3]) -> __m256i,
    ) {
        let (first, third) = if self.bgra { (2, 0) } else { (0, 2) };
        let [a, b, c, d] = [first, third, 1, 3].map(|c| batch.src[c]);
        let low = _mm256_set1_epi32(ONES as i32);
        let bits = _mm256_set1_epi32(self.bits as i32);
        let constant = |c: usize| u32::from(self.constant[c]);
        let constants = [constant(first) | constant(third) << 16, constant(1) | constant(3) << 16];
        let constants = constants.map(|word| _mm256_set1_epi32(word as i32));
        let blend = |source: Pair, old: [[u32; 4]; 2], masks: [u16; 2]| -> [[u32; 4]; 2] {
            let old: __m256i = bytemuck::cast(old);
            let stored = [_mm256_and_si256(old, low), _mm256_and_si256(_mm256_srli_epi16::<8>(old), low)];
            let new = new([source, stored, constants]);
            let write = _mm256_and_si256(bytemuck::cast(masks.map(|mask| select_mask(mask as u8))), bits);
            bytemuck::cast(_mm256_blendv_epi8(old, new, write))
        };
        let places = batch.at.as_chunks::<2>().0.iter().zip(batch.coverage.as_chunks::<2>().0);
        for (i, (&at, &(mut covered))) in places.enumerate().take(batch.quads.div_ceil(2)) {
            if 2 * i + 1 == batch.quads {
                covered[1] = 0;
            }
            let two = |a: [u32; 8], b: [u32; 8]| {
                let (a, b) = (codes(bytemuck::cast(a)), codes(bytemuck::cast(b)));
                _mm256_or_si256(_mm256_and_si256(a, low), _mm256_slli_epi32::<16>(b))
            };
            let source = [two(a[i % P], b[i % P]), two(c[i % P], d[i % P])];
            let [p, q] = at.map(|at| at as usize * S);
            if at[0] != at[1] && covered[0] != 0 && covered[1] != 0 {
                for s in 0..S {
                    let new = blend(source, [tile[p + s], tile[q + s]], covered.map(|covered| covered >> (4 * s)));
                    (tile[p + s], tile[q + s]) = (new[0], new[1]);
                }
                continue;
            }
            // One of them is absent, or both have one place: then they are blended one after the other.
            for (half, place) in [p, q].into_iter().enumerate().filter(|(half, _)| covered[*half] != 0) {
                for s in 0..S {
                    let new = blend(source, [tile[place + s]; 2], [covered[half] >> (4 * s); 2]);
                    tile[place + s] = new[half];
                }
            }
        }
    }
}

/// The operands of at most `P` pairs.
struct Batch<'a, const P: usize> {
    quads: usize,
    at: &'a [u32],
    coverage: &'a [u16],
    src: [&'a [[u32; 8]; P]; 4],
}

/// [`crate::texel::unorm`]; the bits above the lower 16 are those of 2^23.
#[target_feature(enable = "avx2")]
#[inline]
fn codes(color: __m256) -> __m256i {
    // Maximum and minimum give their second operand for NaN, as the scalar selections do.
    let color = _mm256_min_ps(_mm256_max_ps(color, _mm256_setzero_ps()), _mm256_set1_ps(1.0));
    _mm256_castps_si256(_mm256_add_ps(_mm256_mul_ps(color, _mm256_set1_ps(255.0)), _mm256_set1_ps(8_388_608.0)))
}

/// The words of pixels.
#[target_feature(enable = "avx2")]
#[inline]
fn join([lower, upper]: Pair) -> __m256i {
    _mm256_or_si256(lower, _mm256_slli_epi16::<8>(upper))
}

/// Numbers times a factor, as words of pixels.
#[target_feature(enable = "avx2")]
#[inline]
fn times(numbers: Pair, factor: &Factor, [source, stored, constant]: [Pair; 3]) -> __m256i {
    // The same choices in every turn of the loop: branches, since to store all that may be chosen and to load one of them takes longer.
    let operand = |of: Of| match of {
        Of::Source => source,
        Of::Stored => stored,
        Of::Constant => constant,
    };
    let color = operand(factor.color);
    let color = if factor.by_alpha { [alphas(color); 2] } else { color };
    let upper = _mm256_blend_epi16::<0b1010_1010>(color[1], operand(factor.alpha)[1]);
    join([product(numbers[0], factor.of_half(0, color[0])), product(numbers[1], factor.of_half(1, upper))])
}

/// Alpha in both halves of a word.
#[target_feature(enable = "avx2")]
#[inline]
fn alphas(of: Pair) -> __m256i {
    let twice = _mm256_setr_epi8(
        2, 3, 2, 3, 6, 7, 6, 7, 10, 11, 10, 11, 14, 15, 14, 15, 2, 3, 2, 3, 6, 7, 6, 7, 10, 11, 10, 11, 14, 15, 14, 15,
    );
    _mm256_shuffle_epi8(of[1], twice)
}

/// [`super::number::Number::times`] of codes.
#[target_feature(enable = "avx2")]
#[inline]
fn product(a: __m256i, b: __m256i) -> __m256i {
    // With t of at most 255 * 255 + 128, (t + floor(t / 256)) / 256 and 257 t / 65536 have the same whole part.
    let product = _mm256_add_epi16(_mm256_mullo_epi16(a, b), _mm256_set1_epi16(128));
    _mm256_mulhi_epu16(product, _mm256_set1_epi16(257))
}
