use super::*;
use crate::rop::code_words;
use crate::setup::SAMPLES_4;
use crate::texel::depth_code;
use num::Random;
use proptest::prelude::*;

const DEPTHS: [Format; 5] = [
    Format::Depth16Unorm,
    Format::Depth24Plus,
    Format::Depth24PlusStencil8,
    Format::Depth32Float,
    Format::Depth32FloatStencil8,
];

/// A block of codes from a function of pixel, sample and word.
fn block(format: Format, samples: usize, f: impl Fn(usize, usize, usize, usize) -> u32) -> Vec<u32> {
    let words = code_words(format);
    let mut codes = vec![0; PIXELS * samples * words];
    for y in 0..8 {
        for x in 0..8 {
            for s in 0..samples {
                for w in 0..words {
                    let quad = y / 2 * 4 + x / 2;
                    codes[((quad * samples + s) * words + w) * 4 + y % 2 * 2 + x % 2] = f(x, y, s, w);
                }
            }
        }
    }
    codes
}

/// Compresses, checks that the count is honest and that the block comes back; gives the count.
fn check(format: Format, samples: usize, codes: &[u32]) -> u32 {
    let bytes = encode(format, samples, codes);
    let (stored, raw) = (stored_bytes(format, samples, codes), raw_bytes(format, samples));
    assert!(bytes.len() as u32 <= raw + 1);
    assert!(stored <= raw);
    let mut writer = Writer::default();
    write(format, samples, codes, &mut writer);
    assert_eq!(size::bits(format, samples, codes), writer.bits(), "{format:?} {samples}");
    assert!(stored == raw || stored % LINE == 0 && bytes.len() as u32 <= stored + 1, "{} {stored}", bytes.len());
    assert_eq!(decode(format, samples, &bytes).as_deref(), Some(codes), "{format:?} {samples}");
    stored
}

#[test]
fn blocks_of_one_triangle_always_compress() {
    let mut random = Random::new(1);
    for round in 0..2000 {
        let mut unit = || f64::from(random.bits()) / f64::from(u32::MAX);
        let (z, scale) = (0.1 + 0.8 * unit(), 10_f64.powf(-6.0 * unit()) / 80.0);
        let (dx, dy) = ((unit() - 0.5) * scale, (unit() - 0.5) * scale);
        for format in DEPTHS {
            for samples in [1, 4] {
                let codes = block(format, samples, |x, y, s, w| {
                    let offset = if samples == 4 { SAMPLES_4[s].map(|o| f64::from(o) / 256.0) } else { [0.0; 2] };
                    let depth = (z + dx * (x as f64 + offset[0]) + dy * (y as f64 + offset[1])) as f32;
                    if w == 0 { depth_code(format, depth) } else { 7 }
                });
                let (stored, raw) = (check(format, samples, &codes), raw_bytes(format, samples));
                assert!(2 * stored <= raw, "round {round}: {format:?} x{samples} takes {stored} of {raw}");
            }
        }
    }
}

#[test]
fn noise_never_takes_more_than_raw() {
    let mut random = Random::new(2);
    for &format in Format::ALL.iter().filter(|f| !f.is_compressed()) {
        for samples in [1, 4] {
            let width = format.block_bytes() * 8;
            let mut codes = block(format, samples, |_, _, _, _| 0);
            for (i, code) in codes.iter_mut().enumerate() {
                let word = (i / 4 % code_words(format)) as u32;
                *code = random.bits() & mask(width.saturating_sub(32 * word).min(32));
            }
            assert_eq!(check(format, samples, &codes), raw_bytes(format, samples), "{format:?}");
        }
    }
}

#[test]
fn constant_and_smooth_colours_compress() {
    for samples in [1, 4] {
        let flat = block(Format::Rgba8Unorm, samples, |_, _, _, _| 0xff33_2211);
        assert_eq!(check(Format::Rgba8Unorm, samples, &flat), 64);
        let smooth = block(Format::Rgba8Unorm, samples, |x, y, _, _| {
            0xff00_0000 | (100 + 2 * x as u32 + y as u32) << 16 | (90 + y as u32) << 8 | (50 + x as u32)
        });
        assert!(check(Format::Rgba8Unorm, samples, &smooth) <= 128);
    }
    // An edge inside a multisampled block: samples differ in a few pixels.
    let edge = block(Format::Rgba8Unorm, 4, |x, y, s, _| if 2 * x + y + s > 11 { 0xff80_4020 } else { 0xff10_f0e0 });
    assert!(check(Format::Rgba8Unorm, 4, &edge) < 1024);
    let same = block(Format::Rgba32Float, 4, |_, _, _, w| (w as f32).to_bits());
    assert_eq!(check(Format::Rgba32Float, 4, &same), 64);
}

#[test]
fn damaged_bytes_do_not_panic() {
    let codes = block(Format::Depth24Plus, 1, |x, y, _, _| (1000 * x + 77 * y) as u32);
    let bytes = encode(Format::Depth24Plus, 1, &codes);
    for cut in 0..bytes.len() {
        let _ = decode(Format::Depth24Plus, 1, &bytes[..cut]);
    }
    for at in 0..bytes.len() {
        let mut bytes = bytes.clone();
        bytes[at] ^= 0x5a;
        let _ = decode(Format::Depth24Plus, 1, &bytes);
    }
}

proptest! {
    #[test]
    fn any_block_comes_back(seed in any::<u32>(), step in 0_u32..32, pick in 0_usize..64, four in any::<bool>()) {
        let formats: Vec<Format> = Format::ALL.iter().copied().filter(|f| !f.is_compressed()).collect();
        let format = formats[pick % formats.len()];
        let samples = if four { 4 } else { 1 };
        let mut random = Random::new(seed.into());
        let start = random.bits();
        let mut codes = block(format, samples, |_, _, _, _| 0);
        for (i, code) in codes.iter_mut().enumerate() {
            // Neighbours differ by less than 2^step.
            let word = (i / 4 % code_words(format)) as u32;
            let bits = (format.block_bytes() * 8).saturating_sub(32 * word).min(32);
            *code = start.wrapping_add(random.bits() & mask(step)) & mask(bits);
        }
        check(format, samples, &codes);
    }
}
