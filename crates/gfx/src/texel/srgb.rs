//! The sRGB transfer function of 8-bit codes (IEC 61966-2-1), by exact tables.

use std::sync::LazyLock;

/// Numbers below this encode to 0 and need no finer distinction: half a code is 1.5e-4.
const LOWEST: u32 = 0x3900_0000; // 2^-13

/// Bits of a number that choose a bucket of the encoding table: 128 buckets an octave, narrow enough that no bucket holds more
/// than one boundary between codes (a test checks it).
const SHIFT: u32 = 16;

const BUCKETS: usize = ((0x3f80_0000 - LOWEST) >> SHIFT) as usize + 1;

struct Tables {
    /// The linear number of each code.
    decode: [f32; 256],
    /// The smallest number that encodes to code `k + 1` or more; the last is infinity.
    boundary: [f32; 256],
    /// The code of the smallest number of each bucket.
    bucket: [u8; BUCKETS],
}

/// The linear value of a code that need not be whole, in f64.
fn linear(code: f64) -> f64 {
    let c = code / 255.0;
    if c <= 0.04045 { c / 12.92 } else { libm::pow((c + 0.055) / 1.055, 2.4) }
}

static TABLES: LazyLock<Box<Tables>> = LazyLock::new(|| {
    let mut tables = Box::new(Tables { decode: [0.0; 256], boundary: [f32::INFINITY; 256], bucket: [0; BUCKETS] });
    for code in 0..256 {
        tables.decode[code] = linear(code as f64) as f32;
    }
    for code in 0..255 {
        // Rounded up, so that the boundary itself belongs to the upper code in f32 as well as in exact arithmetic.
        let exact = linear(code as f64 + 0.5);
        let near = exact as f32;
        tables.boundary[code] = if f64::from(near) < exact { f32::from_bits(near.to_bits() + 1) } else { near };
    }
    for bucket in 0..BUCKETS {
        let least = f32::from_bits(LOWEST + ((bucket as u32) << SHIFT));
        tables.bucket[bucket] = tables.boundary.iter().take_while(|b| **b <= least).count() as u8;
    }
    tables
});

/// The linear numbers of all codes: fetch once outside a loop.
pub fn srgb_table() -> &'static [f32; 256] {
    &TABLES.decode
}

/// The linear number of a code.
#[inline(always)]
pub fn decode_srgb8(code: u8) -> f32 {
    TABLES.decode[usize::from(code)]
}

/// The code nearest to a linear number on the encoded scale; clamps to [0, 1], NaN becomes 0.
#[inline(always)]
pub fn encode_srgb8(x: f32) -> u8 {
    Encoder::new().encode(x)
}

/// [`encode_srgb8`] with the tables fetched: make one outside a loop.
#[derive(Clone, Copy)]
pub(crate) struct Encoder(&'static Tables);

impl Encoder {
    #[inline(always)]
    pub(crate) fn new() -> Encoder {
        Encoder(&TABLES)
    }

    #[inline(always)]
    pub(crate) fn encode(self, x: f32) -> u8 {
        const LEAST: f32 = f32::from_bits(LOWEST);
        let x = if x > LEAST { x } else { LEAST };
        let x = if x < 1.0 { x } else { 1.0 };
        let code = self.0.bucket[((x.to_bits() - LOWEST) >> SHIFT) as usize];
        code.wrapping_add(u8::from(x >= self.0.boundary[usize::from(code)]))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_bucket_holds_two_boundaries() {
        for pair in TABLES.boundary[..255].windows(2) {
            assert!(pair[0] < pair[1]);
            assert_ne!(pair[0].to_bits() >> SHIFT, pair[1].to_bits() >> SHIFT);
        }
    }

    #[test]
    fn decoding_rises_and_encoding_is_its_exact_inverse() {
        for code in 0..=255_u8 {
            assert_eq!(encode_srgb8(decode_srgb8(code)), code);
            if code > 0 {
                assert!(decode_srgb8(code) > decode_srgb8(code - 1));
            }
        }
    }

    #[test]
    fn encoding_rounds_to_the_nearest_code() {
        let encoded = |x: f64| if x <= 0.003_130_8 { x * 12.92 } else { 1.055 * libm::pow(x, 1.0 / 2.4) - 0.055 };
        for i in 0..=1_000_000 {
            let x = i as f32 / 1_000_000.0;
            let exact = encoded(f64::from(x)) * 255.0;
            let error = (f64::from(encode_srgb8(x)) - exact).abs();
            assert!(error < 0.501, "{x}: {exact}");
        }
        for (x, code) in [(f32::NAN, 0), (-1.0, 0), (2.0, 255), (f32::INFINITY, 255), (f32::NEG_INFINITY, 0), (0.0, 0)] {
            assert_eq!(encode_srgb8(x), code);
        }
    }
}
