//! From several samples to one: resolve; and from alpha to samples.

use super::code_words;
use crate::format::{Format, TexelKind};
use crate::texel::{Rgba8, decode_code, encode_code};

/// The code of a resolved pixel: the mean of the samples' decoded values, in linear light for sRGB formats; the first sample
/// where values cannot be averaged (integers, depth, stencil).
///
/// `samples` holds the samples' codes one after the other ([`code_words`] words each), `out` receives one.
///
/// # Panics
/// If the lengths do not fit the format.
pub fn resolve(format: Format, samples: &[u32], out: &mut [u32]) {
    let words = code_words(format);
    let count = samples.len() / words;
    if count == 1 || format.kind() != TexelKind::Float {
        out.copy_from_slice(&samples[..words]);
        return;
    }
    if count == 4 && Rgba8::of(format).is_some_and(|layout| !layout.srgb) {
        out[0] = mean_of_bytes(samples[0], samples[1], samples[2], samples[3]);
        return;
    }
    let mut sum = [0.0_f32; 4];
    for sample in samples.chunks_exact(words) {
        let texel = decode_code(format, sample);
        for c in 0..4 {
            sum[c] += f32::from_bits(texel[c]);
        }
    }
    let code = encode_code(format, sum.map(|s| (s / count as f32).to_bits()));
    out.copy_from_slice(&code[..words]);
}

/// The mean of four words of four bytes each, byte by byte, to nearest even.
#[inline(always)]
fn mean_of_bytes(a: u32, b: u32, c: u32, d: u32) -> u32 {
    // Two bytes at a time in the halves of a word: a sum of four takes ten bits.
    let mean = |shift: u32| {
        let half = |x: u32| x >> shift & 0x00ff_00ff;
        let sum = half(a) + half(b) + half(c) + half(d);
        let even = sum >> 2 & 0x0001_0001;
        (sum + 0x0001_0001 + even) >> 2 & 0x00ff_00ff
    };
    mean(0) | mean(8) << 8
}

/// The samples that a fragment of an alpha covers, to be combined with its coverage: sample `i` of `n` is covered where
/// alpha > i / n, so that the count rises with alpha from none at 0 to all near 1. NaN covers none.
#[inline(always)]
pub fn alpha_to_coverage(alpha: f32, samples: u32) -> u32 {
    (0..samples).map(|i| u32::from(alpha > i as f32 / samples as f32) << i).sum()
}
