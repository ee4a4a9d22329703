use super::*;
use crate::format::TexelKind;
use num::Lanes;
use proptest::prelude::*;

/// Whether two decoded components mean the same: NaN equals NaN.
fn same(kind: TexelKind, a: u32, b: u32) -> bool {
    a == b || kind != TexelKind::Uint && kind != TexelKind::Sint && f32::from_bits(a).is_nan() && f32::from_bits(b).is_nan()
}

/// Decoding and encoding a code gives a code that decodes to the same numbers.
fn check_round_trip(format: Format, bytes: &[u8]) {
    let texel = decode(format, bytes);
    let mut with_stencil = texel;
    if format.has_depth() && format.has_stencil() {
        with_stencil[1] = u32::from(stencil_value(format, bytes));
    }
    let back = encode(format, with_stencil);
    let again = decode(format, &back);
    for c in 0..4 {
        assert!(same(format.kind(), texel[c], again[c]), "{}: {bytes:?} -> {texel:x?} -> {back:?}", format.name());
    }
    assert_eq!(stencil_value(format, bytes), stencil_value(format, &back));
    // Except where two codes mean the same number, the code itself comes back.
    let exact = match format {
        Format::Rgb9e5Ufloat => false,
        Format::R16Float | Format::Rg16Float | Format::Rgba16Float | Format::Rg11b10Ufloat => {
            texel.iter().all(|b| f32::from_bits(*b).is_finite())
        }
        _ => !format.name().contains("snorm"),
    };
    let len = match format {
        Format::Depth24Plus => 3,
        Format::Depth32FloatStencil8 => 5,
        _ => format.block_bytes() as usize,
    };
    if exact {
        assert_eq!(&back[..len], &bytes[..len], "{}", format.name());
    }
}

#[test]
fn every_short_code_of_every_format_round_trips() {
    for &format in Format::ALL {
        if format.is_compressed() || format.block_bytes() > 2 {
            continue;
        }
        for code in 0..=u16::MAX {
            let bytes = code.to_le_bytes();
            check_round_trip(format, &bytes[..format.block_bytes() as usize]);
        }
    }
}

#[test]
fn every_24_bit_depth_round_trips() {
    for code in 0..1 << 24 {
        let depth = depth_value(Format::Depth24Plus, code);
        assert_eq!(depth_code(Format::Depth24Plus, depth), code);
    }
    assert_eq!(unorm24(f32::NAN), 0);
    assert_eq!(unorm24(-1.0), 0);
    assert_eq!(unorm24(7.0), 0xff_ffff);
}

#[test]
fn small_floats_round_to_nearest() {
    for code in 0..0x7c0_u32 {
        let (a, b) = (from_small_float::<6>(code), from_small_float::<6>(code + 1));
        if code + 1 < 0x7c0 {
            let middle = a + (b - a) / 2.0;
            assert_eq!(to_small_float::<6>(middle), if code & 1 == 0 { code } else { code + 1 });
            assert_eq!(to_small_float::<6>(f32::from_bits(middle.to_bits() + 1)), code + 1);
            assert_eq!(to_small_float::<6>(f32::from_bits(middle.to_bits() - 1)), code);
        }
    }
    assert_eq!(to_small_float::<5>(1e9), 0x3df);
    assert_eq!(to_small_float::<5>(f32::INFINITY), 0x3e0);
    assert_eq!(to_small_float::<5>(-3.0), 0);
    for half in 0..=u16::MAX {
        let x = f16_to_f32(half);
        assert!(f32_to_f16(x) == half || x.is_nan() && f16_to_f32(f32_to_f16(x)).is_nan());
        if half & 0x7fff < 0x7bff {
            let next = f16_to_f32(half + 1);
            let middle = x + (next - x) / 2.0;
            assert_eq!(f32_to_f16(middle), if half & 1 == 0 { half } else { half + 1 }, "{half:x}");
        }
    }
    assert_eq!(f32_to_f16(65519.9), 0x7bff);
    assert_eq!(f32_to_f16(65520.0), 0x7c00);
}

#[test]
fn shared_exponents_are_within_half_a_unit() {
    let mut random = num::Random::new(3);
    for _ in 0..100_000 {
        let rgb: [f32; 3] = std::array::from_fn(|_| f32::from_bits(0x3000_0000 + random.below(0x1780_0000)).min(65408.0));
        let code = to_rgb9e5(rgb);
        let unit = f32::from_bits(((code >> 27) + 127 - 24) << 23);
        for (x, y) in rgb.iter().zip(from_rgb9e5(code)) {
            assert!((x - y).abs() <= unit * 0.5, "{rgb:?}");
        }
    }
    assert_eq!(from_rgb9e5(to_rgb9e5([f32::NAN, -1.0, 1e9])), [0.0, 0.0, 65408.0]);
}

#[test]
fn normalised_numbers_round_to_nearest_even() {
    assert_eq!(unorm(0.5, 255.0), 128); // 127.5
    assert_eq!(unorm(2.5 / 255.0, 255.0), 2);
    assert_eq!(unorm(f32::NAN, 255.0), 0);
    assert_eq!(unorm(f32::INFINITY, 65535.0), 65535);
    assert_eq!(snorm(-0.5, 127.0), -64); // -63.5
    assert_eq!(snorm(f32::NAN, 127.0), 0);
    assert_eq!(snorm(-7.0, 127.0), -127);
    assert_eq!(decode(Format::R8Snorm, &[0x80])[0], (-1.0_f32).to_bits());
}

#[test]
fn channels_are_in_their_places() {
    let one = |format| decode(format, &[1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15, 16]);
    assert_eq!(one(Format::Rgba8Uint), [1, 2, 3, 4]);
    assert_eq!(one(Format::Bgra8Unorm).map(|b| (f32::from_bits(b) * 255.0).round()), [3.0, 2.0, 1.0, 4.0]);
    assert_eq!(one(Format::Rg8Uint), [1, 2, 0, 1]);
    assert_eq!(one(Format::Rgba32Uint), [0x0403_0201, 0x0807_0605, 0x0c0b_0a09, 0x100f_0e0d]);
    let rgb10a2 = encode(Format::Rgb10a2Uint, [1, 2, 3, 2]);
    assert_eq!(u32_of(&rgb10a2, 0), 1 | 2 << 10 | 3 << 20 | 2 << 30);
    let rg11b10 = encode(Format::Rg11b10Ufloat, [1.0_f32, 0.0, 1.0, 0.0].map(f32::to_bits));
    assert_eq!(u32_of(&rg11b10, 0), 0x3c0 | 0x1e0 << 22);
    assert_eq!(encode(Format::R8Sint, [-200_i32 as u32, 0, 0, 0])[0] as i8, -128);
    assert_eq!(encode(Format::Rg16Uint, [70_000, 1, 0, 0])[..4], [255, 255, 1, 0]);
}

#[test]
fn blocks_decode_as_published() {
    // BC1: colours 0xf800 (red) and 0x001f (blue), four-colour mode, indices 0 1 2 3 in the first row.
    let bc1 = [0x00, 0xf8, 0x1f, 0x00, 0b1110_0100, 0, 0, 0];
    let texels = decode_block(Format::Bc1RgbaUnorm, &bc1).map(|t| t.map(|b| (f32::from_bits(b) * 255.0).round() as u32));
    assert_eq!(texels[0], [255, 0, 0, 255]);
    assert_eq!(texels[1], [0, 0, 255, 255]);
    assert_eq!(texels[2], [170, 0, 85, 255]);
    assert_eq!(texels[3], [85, 0, 170, 255]);
    assert_eq!(texels[4], [255, 0, 0, 255]);
    // Three-colour mode: index 3 is transparent black.
    let bc1 = [0x1f, 0x00, 0x00, 0xf8, 0b1110_0100, 0, 0, 0];
    assert_eq!(decode_block(Format::Bc1RgbaUnorm, &bc1)[3], [0, 0, 0, 0]);
    // BC4: end points 255 and 0, index 2 is 6/7.
    let bc4 = [255, 0, 0b010, 0, 0, 0, 0, 0];
    let r = f32::from_bits(decode_block(Format::Bc4RUnorm, &bc4)[0][0]);
    assert!((r - 6.0 / 7.0).abs() < 1.0 / 255.0, "{r}");
    let bc5 = [127, 129, 0, 0, 0, 0, 0, 0, 129, 127, 0, 0, 0, 0, 0, 0];
    let rg = decode_block(Format::Bc5RgSnorm, &bc5)[5];
    assert_eq!(rg.map(f32::from_bits), [1.0, -1.0, 0.0, 1.0]);
}

proptest! {
    #[test]
    fn random_texels_round_trip(bytes in any::<[u8; 16]>(), index in 0..Format::ALL.len()) {
        let format = Format::ALL[index];
        if !format.is_compressed() {
            let mut bytes = bytes;
            if format == Format::Depth32FloatStencil8 {
                bytes[5..8].fill(0);
            }
            check_round_trip(format, &bytes[..format.block_bytes() as usize]);
        } else {
            for texel in decode_block(format, &bytes) {
                if format.name().contains("unorm") {
                    prop_assert!(texel.iter().all(|b| (0.0..=1.0).contains(&f32::from_bits(*b))));
                }
            }
        }
    }

    #[test]
    fn any_number_encodes_without_panic(texel in any::<[u32; 4]>()) {
        for &format in Format::ALL {
            if !format.is_compressed() {
                let bytes = encode(format, texel);
                check_round_trip(format, &bytes[..format.block_bytes() as usize]);
            }
        }
    }

    #[test]
    fn batches_pack_as_single_texels(bits in proptest::collection::vec(any::<u32>(), 256)) {
        let color: [Lanes; 4] = std::array::from_fn(|c| {
            Lanes(std::array::from_fn(|i| {
                let b = bits[64 * c + i];
                // Half of them ordinary colours, half anything.
                if b & 1 == 0 { b } else { (b as f32 / u32::MAX as f32 * 1.2 - 0.1).to_bits() }
            }))
        });
        for format in [Format::Rgba8Unorm, Format::Rgba8UnormSrgb, Format::Bgra8Unorm, Format::Bgra8UnormSrgb] {
            let mut out = [0; 64];
            pack_rgba8(Rgba8::of(format).expect("four bytes"), &color, &mut out);
            for i in 0..64 {
                let single = encode(format, std::array::from_fn(|c| color[c].0[i]));
                prop_assert_eq!(&out[i].to_le_bytes()[..], &single[..4]);
            }
        }
    }
}
