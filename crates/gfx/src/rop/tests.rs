use super::*;
use crate::format::{Format, TexelKind};
use crate::state::*;
use crate::texel::{decode_code, depth_code, encode_code};
use num::{LANES, Lanes, QUADS, Random};
use proptest::prelude::*;

/// The blend equation in f64, straight from the specification.
fn reference(blend: BlendComponent, c: usize, s: [f64; 4], s1: [f64; 4], d: [f64; 4], k: [f64; 4]) -> f64 {
    let factor = |f: BlendFactor| match f {
        BlendFactor::Zero => 0.0,
        BlendFactor::One => 1.0,
        BlendFactor::Src => s[c],
        BlendFactor::OneMinusSrc => 1.0 - s[c],
        BlendFactor::SrcAlpha => s[3],
        BlendFactor::OneMinusSrcAlpha => 1.0 - s[3],
        BlendFactor::Dst => d[c],
        BlendFactor::OneMinusDst => 1.0 - d[c],
        BlendFactor::DstAlpha => d[3],
        BlendFactor::OneMinusDstAlpha => 1.0 - d[3],
        BlendFactor::SrcAlphaSaturated => {
            if c == 3 {
                1.0
            } else {
                s[3].min(1.0 - d[3])
            }
        }
        BlendFactor::Constant => k[c],
        BlendFactor::OneMinusConstant => 1.0 - k[c],
        BlendFactor::Src1 => s1[c],
        BlendFactor::OneMinusSrc1 => 1.0 - s1[c],
        BlendFactor::Src1Alpha => s1[3],
        BlendFactor::OneMinusSrc1Alpha => 1.0 - s1[3],
    };
    match blend.op {
        BlendOp::Add => s[c] * factor(blend.src) + d[c] * factor(blend.dst),
        BlendOp::Subtract => s[c] * factor(blend.src) - d[c] * factor(blend.dst),
        BlendOp::ReverseSubtract => d[c] * factor(blend.dst) - s[c] * factor(blend.src),
        BlendOp::Min => s[c].min(d[c]),
        BlendOp::Max => s[c].max(d[c]),
    }
}

/// A number in [-0.5, 1.5): fixed-point targets must clamp it.
fn colour(random: &mut Random) -> f32 {
    random.bits() as f32 / 2_147_483_648.0 - 0.5
}

#[test]
fn every_factor_and_operation_agrees_with_f64() {
    let mut random = Random::new(1);
    // Bounds in the target's own steps: half a step of rounding and a little for arithmetic. Targets that blend in 8-bit codes
    // round two sources, two factors and two products: up to half a step each.
    const CODES: f64 = 255.0 / 6.0;
    let formats = [
        (Format::Rgba8Unorm, CODES),
        (Format::Bgra8Unorm, CODES),
        (Format::Rgb10a2Unorm, 3.0),
        (Format::Rgba16Unorm, 65535.0),
        (Format::Rgba32Float, 1e6),
        (Format::Rgba8UnormSrgb, 100.0),
        (Format::R8Unorm, CODES),
    ];
    for (format, steps) in formats {
        for &src in BlendFactor::ALL {
            for &dst in BlendFactor::ALL {
                for &op in BlendOp::ALL {
                    let component = BlendComponent { src, dst, op };
                    let target = ColorTarget {
                        format,
                        blend: Some(Blend { color: component, alpha: component }),
                        logic: None,
                        write_mask: 15,
                    };
                    let constant: [f32; 4] = std::array::from_fn(|_| colour(&mut random));
                    let state = ColorState::new(&target, constant);
                    let color: [[u32; 4]; 4] = std::array::from_fn(|_| std::array::from_fn(|_| colour(&mut random).to_bits()));
                    let second: [[u32; 4]; 4] = std::array::from_fn(|_| std::array::from_fn(|_| colour(&mut random).to_bits()));
                    let words = code_words(format);
                    let mut run = vec![0; 4 * words];
                    let stored: [[u32; 4]; 4] =
                        std::array::from_fn(|_| encode_code(format, std::array::from_fn(|_| colour(&mut random).to_bits())));
                    for p in 0..4 {
                        for w in 0..words {
                            run[4 * w + p] = stored[p][w];
                        }
                    }
                    state.blend_quad(1, 15, &color, &second, &mut run);
                    for p in 0..4 {
                        let fixed = format != Format::Rgba32Float;
                        let limit = |x: f32| f64::from(if fixed { x.clamp(0.0, 1.0) } else { x });
                        let number = |t: &[[u32; 4]; 4]| std::array::from_fn(|c| limit(f32::from_bits(t[c][p])));
                        let d = decode_code(format, &stored[p]).map(|b| f64::from(f32::from_bits(b)));
                        let code: [u32; 4] = std::array::from_fn(|w| if w < words { run[4 * w + p] } else { 0 });
                        let got = decode_code(format, &code).map(|b| f64::from(f32::from_bits(b)));
                        for c in 0..format.components() as usize {
                            let want = reference(component, c, number(&color), number(&second), d, constant.map(limit));
                            let want = if fixed { want.clamp(0.0, 1.0) } else { want };
                            let error = (got[c] - want).abs();
                            assert!(error <= 0.51 / steps, "{format:?} {component:?} channel {c}: {} for {want}", got[c]);
                        }
                    }
                }
            }
        }
    }
}

#[test]
fn codes_blend_by_whole_numbers() {
    // Sources that are codes themselves: what remains is one rounding a product, in whole numbers here.
    let product = |a: i32, b: i32| (2 * a * b + 255).div_euclid(510);
    let mut random = Random::new(9);
    for (format, shifts) in [
        (Format::Rgba8Unorm, [0, 8, 16, 24]),
        (Format::Bgra8Unorm, [16, 8, 0, 24]),
        (Format::Rg8Unorm, [0, 8, 32, 32]),
        (Format::R8Unorm, [0, 32, 32, 32]),
    ] {
        for &src in BlendFactor::ALL {
            for &dst in BlendFactor::ALL {
                for &op in BlendOp::ALL {
                    let component = BlendComponent { src, dst, op };
                    let target = ColorTarget {
                        format,
                        blend: Some(Blend { color: component, alpha: component }),
                        logic: None,
                        write_mask: 15,
                    };
                    let mut color = || -> [i32; 4] { std::array::from_fn(|_| (random.bits() & 255) as i32) };
                    let (s, s1, k, mut d) = (color(), color(), color(), color());
                    let floats = |t: [i32; 4]| t.map(|c| c as f32 / 255.0);
                    let lanes = |t: [i32; 4]| floats(t).map(|c| [c.to_bits(); 4]);
                    let mut stored = 0;
                    for c in 0..4 {
                        if shifts[c] < 32 {
                            stored |= (d[c] as u32) << shifts[c];
                        } else {
                            d[c] = if c == 3 { 255 } else { 0 };
                        }
                    }
                    let mut run = [stored; 4];
                    ColorState::new(&target, floats(k)).blend_quad(1, 15, &lanes(s), &lanes(s1), &mut run);
                    for c in (0..4).filter(|c| shifts[*c] < 32) {
                        let term = |f: BlendFactor, x: i32| match f {
                            BlendFactor::Zero => 0,
                            BlendFactor::One => x,
                            BlendFactor::Src => product(x, s[c]),
                            BlendFactor::OneMinusSrc => product(x, 255 - s[c]),
                            BlendFactor::SrcAlpha => product(x, s[3]),
                            BlendFactor::OneMinusSrcAlpha => product(x, 255 - s[3]),
                            BlendFactor::Dst => product(x, d[c]),
                            BlendFactor::OneMinusDst => product(x, 255 - d[c]),
                            BlendFactor::DstAlpha => product(x, d[3]),
                            BlendFactor::OneMinusDstAlpha => product(x, 255 - d[3]),
                            BlendFactor::SrcAlphaSaturated if c == 3 => x,
                            BlendFactor::SrcAlphaSaturated => product(x, s[3].min(255 - d[3])),
                            BlendFactor::Constant => product(x, k[c]),
                            BlendFactor::OneMinusConstant => product(x, 255 - k[c]),
                            BlendFactor::Src1 => product(x, s1[c]),
                            BlendFactor::OneMinusSrc1 => product(x, 255 - s1[c]),
                            BlendFactor::Src1Alpha => product(x, s1[3]),
                            BlendFactor::OneMinusSrc1Alpha => product(x, 255 - s1[3]),
                        };
                        let (a, b) = (term(src, s[c]), term(dst, d[c]));
                        let want = match op {
                            BlendOp::Add => (a + b).min(255),
                            BlendOp::Subtract => (a - b).max(0),
                            BlendOp::ReverseSubtract => (b - a).max(0),
                            BlendOp::Min => s[c].min(d[c]),
                            BlendOp::Max => s[c].max(d[c]),
                        };
                        let got = run[1] >> shifts[c] & 255;
                        assert_eq!(got as i32, want, "{format:?} {component:?} channel {c}");
                    }
                }
            }
        }
    }
}

#[test]
fn write_masks_keep_channels_of_every_format() {
    let mut random = Random::new(5);
    for &format in Format::ALL {
        if format.is_compressed() || format.is_depth_stencil() || matches!(format, Format::Rgb9e5Ufloat | Format::R64Uint) {
            continue;
        }
        for mask in 0..16 {
            let state = ColorState::new(&ColorTarget { format, blend: None, logic: None, write_mask: mask }, [0.0; 4]);
            let pick = |random: &mut Random| -> [u32; 4] {
                std::array::from_fn(|_| match format.kind() {
                    TexelKind::Float => colour(random).abs().to_bits(),
                    _ => random.bits() & 3,
                })
            };
            let (old, new) = (encode_code(format, pick(&mut random)), pick(&mut random));
            let words = code_words(format);
            let mut run: Vec<u32> = (0..4 * words).map(|i| old[i / 4]).collect();
            let color = new.map(|b| [b; 4]);
            state.blend_quad(1, 0b0101, &color, &color, &mut run);
            let (before, after) = (decode_code(format, &old), decode_code(format, &encode_code(format, new)));
            for p in 0..4 {
                let code: [u32; 4] = std::array::from_fn(|w| if w < words { run[4 * w + p] } else { 0 });
                let got = decode_code(format, &code);
                for c in 0..format.components() as usize {
                    let written = p % 2 == 0 && mask >> c & 1 != 0;
                    assert_eq!(
                        got[c],
                        if written { after[c] } else { before[c] },
                        "{format:?} mask {mask:b} pixel {p} channel {c}"
                    );
                }
            }
        }
    }
}

fn depth_state(format: Format, compare: Compare, write: bool) -> DepthStencil {
    DepthStencil {
        format,
        depth_write: write,
        depth_compare: compare,
        stencil_front: StencilFace::default(),
        stencil_back: StencilFace::default(),
        stencil_read_mask: 0xff,
        stencil_write_mask: 0xff,
        stencil_back_masks: None,
        bias: 0.0,
        bias_slope: 0.0,
        bias_clamp: 0.0,
    }
}

#[test]
fn depth_comparisons_are_on_stored_codes() {
    for format in [Format::Depth16Unorm, Format::Depth24Plus, Format::Depth24PlusStencil8, Format::Depth32Float] {
        for &compare in Compare::ALL {
            for write in [false, true] {
                let state = DepthStencilState::new(&depth_state(format, compare, write), [0; 2], [0.0, 1.0]);
                let depths = [0.25_f32, 0.5, 0.75, 2.0];
                let stored = depth_code(format, 0.5);
                let beside = if format == Format::Depth24PlusStencil8 { 0xab00_0000 } else { 0 };
                let mut run = [stored | beside; 4];
                let codes = depths.map(|d| state.code(d));
                assert_eq!(codes[3], depth_code(format, 1.0), "clamped to the viewport's range");
                let passed = state.test_quad(1, false, 0b1111, &[codes], &mut run);
                for p in 0..4 {
                    let pass = compare.test(depths[p].min(1.0), 0.5);
                    assert_eq!(passed >> p & 1 != 0, pass, "{format:?} {compare:?} {p}");
                    assert_eq!(run[p], if pass && write { codes[p] } else { stored } | beside);
                }
                let mut run = [stored; 4];
                assert_eq!(state.test_quad(1, false, 0b0100, &[codes], &mut run) & !0b0100, 0);
                assert_eq!([run[0], run[1], run[3]], [stored; 3], "pixels that are not covered stay");
            }
        }
    }
    // NaN passes what is not an ordering.
    let state = |compare| DepthStencilState::new(&depth_state(Format::Depth32Float, compare, false), [0; 2], [0.0, 1.0]);
    for (compare, pass) in [(Compare::Less, 0), (Compare::GreaterEqual, 0), (Compare::NotEqual, 15), (Compare::Always, 15)] {
        let nan = state(compare).code(f32::NAN);
        assert_eq!(state(compare).test_quad(1, false, 15, &[[nan; 4]], &mut [0; 4]), pass, "{compare:?}");
    }
}

#[test]
fn stencil_operations_follow_the_three_outcomes() {
    let expected = |op: StencilOp, v: u8, r: u8| match op {
        StencilOp::Keep => v,
        StencilOp::Zero => 0,
        StencilOp::Replace => r,
        StencilOp::Invert => !v,
        StencilOp::IncrementClamp => {
            if v == 255 {
                255
            } else {
                v + 1
            }
        }
        StencilOp::DecrementClamp => {
            if v == 0 {
                0
            } else {
                v - 1
            }
        }
        StencilOp::IncrementWrap => {
            if v == 255 {
                0
            } else {
                v + 1
            }
        }
        StencilOp::DecrementWrap => {
            if v == 0 {
                255
            } else {
                v - 1
            }
        }
    };
    for format in [Format::Depth24PlusStencil8, Format::Depth32FloatStencil8, Format::Stencil8] {
        let (word, shift) = match format {
            Format::Depth24PlusStencil8 => (0, 24),
            Format::Depth32FloatStencil8 => (1, 0),
            _ => (0, 0),
        };
        for &op in StencilOp::ALL {
            for value in [0_u8, 1, 0x5a, 254, 255] {
                for outcome in 0..3 {
                    // The stencil test fails, the depth test fails, both pass.
                    let face = StencilFace {
                        compare: if outcome == 0 { Compare::Never } else { Compare::Always },
                        fail_op: if outcome == 0 { op } else { StencilOp::Invert },
                        depth_fail_op: if outcome == 1 { op } else { StencilOp::Invert },
                        pass_op: if outcome == 2 { op } else { StencilOp::Invert },
                    };
                    if outcome == 1 && !format.has_depth() {
                        continue;
                    }
                    let compare = if outcome == 1 { Compare::Never } else { Compare::Always };
                    for write_mask in [0xff, 0x0f] {
                        let desc = DepthStencil {
                            stencil_back: face,
                            stencil_write_mask: write_mask,
                            ..depth_state(format, compare, false)
                        };
                        let state = DepthStencilState::new(&desc, [0x1c3; 2], [0.0, 1.0]);
                        let mut run = vec![0_u32; 4 * code_words(format)];
                        run[4 * word + 1] = u32::from(value) << shift;
                        let passed = state.test_quad(1, true, 0b0010, &[[0; 4]], &mut run);
                        assert_eq!(passed, if outcome == 2 { 2 } else { 0 });
                        let mask = write_mask as u8;
                        let want = value & !mask | expected(op, value, 0xc3) & mask;
                        assert_eq!(run[4 * word + 1], u32::from(want) << shift, "{format:?} {op:?} {value} {outcome}");
                        assert_eq!(run.iter().filter(|w| **w != 0).count(), usize::from(want != 0), "others stay zero");
                    }
                }
            }
        }
    }
}

#[test]
fn stencil_comparison_masks_both_sides() {
    for &compare in Compare::ALL {
        let face = StencilFace { compare, ..StencilFace::default() };
        let desc = DepthStencil {
            stencil_front: face,
            stencil_read_mask: 0x0f,
            ..depth_state(Format::Depth24PlusStencil8, Compare::Always, false)
        };
        let state = DepthStencilState::new(&desc, [0xf5; 2], [0.0, 1.0]);
        let mut run = [0x0400_0000, 0x3500_0000, 0x0600_0000, 0xff00_0000];
        let passed = state.test_quad(1, false, 15, &[[0; 4]], &mut run);
        for (p, stored) in [4.0, 5.0, 6.0, 15.0].into_iter().enumerate() {
            assert_eq!(passed >> p & 1 != 0, compare.test(5.0, stored), "{compare:?}");
        }
    }
}

#[test]
fn logic_operations_follow_their_table() {
    // Results for new and stored bits 00, 01, 10, 11, from the lowest bit on: the table of the Vulkan specification.
    let tables = [
        0b0000, 0b1000, 0b0100, 0b1100, 0b0010, 0b1010, 0b0110, 0b1110, 0b0001, 0b1001, 0b0101, 0b1101, 0b0011, 0b1011, 0b0111,
        0b1111,
    ];
    let formats =
        [Format::Rgba8Unorm, Format::Bgra8Unorm, Format::R8Uint, Format::Rgba8Snorm, Format::Rgb10a2Unorm, Format::Rgba32Sint];
    let mut random = Random::new(5);
    for (&op, table) in LogicOp::ALL.iter().zip(tables) {
        for format in formats {
            for write_mask in [15, 0b0110] {
                let target = ColorTarget { format, blend: None, logic: Some(op), write_mask };
                let (state, plain) = (ColorState::new(&target, [0.0; 4]), ColorTarget { logic: None, ..target });
                let plain = ColorState::new(&plain, [0.0; 4]);
                let float = format.kind() == TexelKind::Float;
                let color: [[u32; 4]; 4] = std::array::from_fn(|_| {
                    std::array::from_fn(|_| if float { colour(&mut random).to_bits() } else { random.bits() & 0x7f })
                });
                let words = code_words(format);
                let before: Vec<u32> = (0..4 * words).map(|_| random.bits()).collect();
                let (mut run, mut new, mut kept) = (before.clone(), before.clone(), vec![0; 4 * words]);
                state.blend_quad(1, 0b1011, &color, &color, &mut run);
                // All that a colour without an operation writes, and where it writes.
                plain.blend_quad(1, 15, &color, &color, &mut new);
                let ones = ColorState::new(&ColorTarget { logic: Some(LogicOp::Set), ..target }, [0.0; 4]);
                ones.blend_quad(1, 0b1011, &color, &color, &mut kept);
                for (at, &word) in run.iter().enumerate() {
                    let bit = |of: u32, bit: u32| of >> bit & 1;
                    for b in 0..32 {
                        let index = bit(new[at], b) << 1 | bit(before[at], b);
                        let want = if bit(kept[at], b) == 1 { table >> index & 1 } else { bit(before[at], b) };
                        assert_eq!(bit(word, b), want, "{op:?} {format:?} {write_mask} {at} {b}");
                    }
                }
                assert!(kept.iter().any(|&word| word != 0) || write_mask != 15);
                assert_eq!(kept[2], 0, "the third pixel is not covered");
                // A bit that differs between two stored ones makes the operation read.
                assert_eq!(op.reads(), (table ^ table >> 1) & 0b0101 != 0);
                assert_eq!(state.is_idle(), op == LogicOp::NoOp || format == Format::R8Uint && write_mask != 15);
            }
        }
    }
    for format in
        [Format::Rgba8UnormSrgb, Format::Rgba16Float, Format::Rg11b10Ufloat, Format::Rgb9e5Ufloat, Format::Depth16Unorm]
    {
        assert!(!LogicOp::applies_to(format), "{format:?}");
    }
    assert!(formats.into_iter().all(LogicOp::applies_to));
}

#[test]
fn faces_have_stencil_masks_and_references_of_their_own() {
    let face =
        StencilFace { compare: Compare::Equal, pass_op: StencilOp::Replace, fail_op: StencilOp::Invert, ..Default::default() };
    for (masks, back) in [(None, [0x0f, 0xf0]), (Some([0xf0, 0x3c]), [0xf0, 0x3c])] {
        let desc = DepthStencil {
            stencil_front: face,
            stencil_back: face,
            stencil_read_mask: 0x0f,
            stencil_write_mask: 0xf0,
            stencil_back_masks: masks.map(|[read, write]| StencilMasks { read, write }),
            ..depth_state(Format::Stencil8, Compare::Always, false)
        };
        let references = [0x15_u32, 0x5a];
        let state = DepthStencilState::new(&desc, references, [0.0, 1.0]);
        let values = [0x15_u32, 0x5a, 0x5f, 0xe5];
        for (side, [read, write]) in [[0x0f, 0xf0], back].into_iter().enumerate() {
            let mut run = values;
            let passed = state.test_quad(1, side == 1, 15, &[[0; 4]], &mut run);
            for p in 0..4 {
                let equal = references[side] & read == values[p] & read;
                let new = if equal { references[side] } else { !values[p] };
                assert_eq!(run[p], (values[p] & !write | new & write) & 0xff, "{masks:?} {side} {p}");
                assert_eq!(passed >> p & 1 == 1, equal);
            }
        }
        // One face alone may write.
        let only = |write: u32| DepthStencil {
            stencil_write_mask: 0,
            stencil_back_masks: Some(StencilMasks { read: 0xff, write }),
            ..desc
        };
        for (write, writes) in [(0, false), (1, true), (0x100, false)] {
            assert_eq!(DepthStencilState::new(&only(write), references, [0.0, 1.0]).writes_stencil(), writes);
            assert_eq!(only(write).writes_stencil(), writes);
        }
    }
}

#[test]
fn resolve_is_the_mean_in_linear_light() {
    for value in 0..256_u32 {
        let mut out = [0];
        let samples = [value, 255 - value, value ^ 0x0f, 0].map(|v| v | v << 16);
        resolve(Format::Rgba8Unorm, &samples, &mut out);
        let mean = samples.iter().map(|s| f64::from(s & 255)).sum::<f64>() / 4.0;
        assert_eq!(f64::from(out[0] & 255), mean.round_ties_even());
        assert_eq!(out[0] & 255, out[0] >> 16);
    }
    let mut out = [0];
    resolve(Format::Rgba8UnormSrgb, &[0xffff_ffff, 0xffff_ffff, 0xff00_0000, 0xff00_0000], &mut out);
    assert_eq!(out[0], 0xffbc_bcbc, "half the light is code 188");
    resolve(Format::R32Uint, &[7, 9, 9, 9], &mut out);
    assert_eq!(out[0], 7);
    let mut wide = [0; 4];
    let samples: Vec<u32> = (0..16).map(|i| ((i / 4) as f32).to_bits()).collect();
    resolve(Format::Rgba32Float, &samples, &mut wide);
    assert_eq!(wide.map(f32::from_bits), [1.5; 4]);
}

#[test]
fn alpha_covers_more_samples_as_it_rises() {
    let count = |alpha: f32| alpha_to_coverage(alpha, 4).count_ones();
    assert_eq!([0.0, 0.1, 0.26, 0.51, 0.76, 1.0].map(count), [0, 1, 2, 3, 4, 4]);
    assert_eq!(count(f32::NAN), 0);
    assert_eq!(count(f32::INFINITY), 4);
}

fn any_blend() -> impl Strategy<Value = Option<Blend>> {
    let factor = || proptest::sample::select(BlendFactor::ALL.to_vec());
    let op = || proptest::sample::select(BlendOp::ALL.to_vec());
    let component = || (factor(), factor(), op()).prop_map(|(src, dst, op)| BlendComponent { src, dst, op });
    proptest::option::of((component(), component()).prop_map(|(color, alpha)| Blend { color, alpha }))
}

proptest! {
    #[test]
    fn batches_blend_as_single_quads(
        blend in any_blend(),
        logic in proptest::option::of(proptest::sample::select(LogicOp::ALL.to_vec())),
        write_mask in 0_u8..16,
        pick in 0_usize..9,
        four in any::<bool>(),
        seed in any::<u32>(),
        wild in any::<bool>(),
    ) {
        let format = [
            Format::Rgba8Unorm, Format::Bgra8UnormSrgb, Format::Rgba16Float, Format::Rgba32Float, Format::Rgb10a2Unorm,
            Format::Rg11b10Ufloat, Format::Rgba8Uint, Format::Rg16Sint, Format::Rg8Unorm,
        ][pick];
        let logic = logic.filter(|_| LogicOp::applies_to(format));
        let samples = if four { 4 } else { 1 };
        let mut random = Random::new(seed.into());
        let state = ColorState::new(&ColorTarget { format, blend, logic, write_mask }, [0.1, 0.4, 2.0, -1.0]);
        let mut lanes = || -> [Lanes; 4] {
            std::array::from_fn(|_| Lanes(std::array::from_fn(|_| if wild { random.bits() } else { colour(&mut random).to_bits() })))
        };
        let (src, src1) = (lanes(), lanes());
        let size = 4 * samples * code_words(format);
        // Few places, so that some quads meet.
        let at: [u32; QUADS] = std::array::from_fn(|_| random.bits() % 20);
        let coverage: [u16; QUADS] = std::array::from_fn(|_| random.bits() as u16 & if four { !0 } else { 15 });
        // The unused bits of a code are zero.
        let used = if format == Format::Rg8Unorm { 0xffff } else { !0 };
        let tile: Vec<u32> = (0..20 * size).map(|_| random.bits() & used).collect();
        let (mut batch, mut single, mut packed) = (tile.clone(), tile.clone(), tile);
        state.blend_batch(samples, QUADS, &at, &coverage, src.each_ref(), src1.each_ref(), &mut batch);
        let mut codes = [Lanes::ZERO; 4];
        state.pack_batch(src.each_ref(), &mut codes);
        for q in 0..QUADS {
            let quad = |c: &[Lanes; 4]| c.each_ref().map(|c| [c.0[4 * q], c.0[4 * q + 1], c.0[4 * q + 2], c.0[4 * q + 3]]);
            let range = at[q] as usize * size..(at[q] as usize + 1) * size;
            state.blend_quad(samples, coverage[q], &quad(&src), &quad(&src1), &mut single[range.clone()]);
            let words: Vec<u32> = quad(&codes).concat();
            state.put_quad(samples, coverage[q], &words, &mut packed[range]);
        }
        prop_assert_eq!(&batch, &single);
        if blend.is_none() {
            prop_assert_eq!(&batch, &packed);
        }
    }

    #[test]
    fn pairs_of_quads_blend_as_single_ones(
        factors in proptest::collection::vec(proptest::sample::select(BlendFactor::ALL.to_vec()), 4),
        op in proptest::option::of(proptest::sample::select(vec![BlendOp::Add, BlendOp::Subtract, BlendOp::ReverseSubtract])),
        write_mask in 1_u8..16,
        bgra in any::<bool>(),
        four in any::<bool>(),
        quads in 1..=QUADS,
        seed in any::<u32>(),
        wild in any::<bool>(),
    ) {
        let format = if bgra { Format::Bgra8Unorm } else { Format::Rgba8Unorm };
        let samples = if four { 4 } else { 1 };
        let mut random = Random::new(seed.into());
        let component = |at: usize, op| BlendComponent { src: factors[at], dst: factors[at + 1], op };
        let blend = op.map(|op| Blend { color: component(0, op), alpha: component(2, op) });
        let state = ColorState::new(&ColorTarget { format, blend, logic: None, write_mask }, [0.1, 0.4, 2.0, -1.0]);
        let mut lanes = || -> [Lanes; 4] {
            std::array::from_fn(|_| Lanes(std::array::from_fn(|_| if wild { random.bits() } else { colour(&mut random).to_bits() })))
        };
        let (src, src1) = (lanes(), lanes());
        // Few places, so that some quads meet; what lies behind the last is of no quad.
        let at: [u32; QUADS] = std::array::from_fn(|q| if q < quads { random.bits() % 5 } else { u32::MAX });
        let coverage: [u16; QUADS] = std::array::from_fn(|_| random.bits() as u16 & if four { !0 } else { 15 } & if random.below(4) == 0 { 0 } else { !0 });
        let tile: Vec<u32> = (0..5 * 4 * samples).map(|_| random.bits()).collect();
        let (mut batch, mut single) = (tile.clone(), tile);
        state.blend_batch(samples, quads, &at, &coverage, src.each_ref(), src1.each_ref(), &mut batch);
        for q in 0..quads {
            let quad = |c: &[Lanes; 4]| c.each_ref().map(|c| [c.0[4 * q], c.0[4 * q + 1], c.0[4 * q + 2], c.0[4 * q + 3]]);
            let run = &mut single[at[q] as usize * 4 * samples..][..4 * samples];
            state.blend_quad(samples, coverage[q], &quad(&src), &quad(&src1), run);
        }
        prop_assert_eq!(&batch, &single);
    }

    #[test]
    fn groups_blend_as_single_quads(
        factors in proptest::collection::vec(proptest::sample::select(BlendFactor::ALL.to_vec()), 4),
        op in proptest::sample::select(BlendOp::ALL.to_vec()),
        write_mask in 1_u8..16,
        bgra in any::<bool>(),
        four in any::<bool>(),
        seed in any::<u32>(),
        wild in any::<bool>(),
    ) {
        let format = if bgra { Format::Bgra8Unorm } else { Format::Rgba8Unorm };
        let samples = if four { 4 } else { 1 };
        let mut random = Random::new(seed.into());
        let component = |at: usize| BlendComponent { src: factors[at], dst: factors[at + 1], op };
        let blend = Some(Blend { color: component(0), alpha: component(2) });
        let state = ColorState::new(&ColorTarget { format, blend, logic: None, write_mask }, [0.1, 0.4, 2.0, -1.0]);
        let mut colors = || -> Colors<16> {
            std::array::from_fn(|_| std::array::from_fn(|_| if wild { f32::from_bits(random.bits()) } else { colour(&mut random) }))
        };
        let (src, src1) = (colors(), colors());
        // At distinct places, and some of them absent.
        let first = random.bits() % 16;
        let at: [u8; 4] = std::array::from_fn(|q| ((first + 5 * q as u32) % 16) as u8);
        let coverage: [u16; 4] = std::array::from_fn(|_| random.bits() as u16 & if four { !0 } else { 15 } & if random.below(4) == 0 { 0 } else { !0 });
        let size = 4 * samples;
        let block: Vec<u32> = (0..16 * size).map(|_| random.bits()).collect();
        let (mut group, mut single) = (block.clone(), block);
        state.blend_group(samples, (&at, &coverage), &src, &src1, &mut group);
        prop_assert_eq!(state.groups(), state.blends());
        if state.groups() {
            for q in 0..4 {
                let quad = |c: &Colors<16>| c.map(|c| std::array::from_fn(|p| c[4 * q + p].to_bits()));
                let run = &mut single[usize::from(at[q]) * size..][..size];
                state.blend_quad(samples, coverage[q], &quad(&src), &quad(&src1), run);
            }
        }
        prop_assert_eq!(&group, &single);
    }

    #[test]
    fn batches_test_as_single_quads(
        pick in 0_usize..6,
        compare in proptest::sample::select(Compare::ALL.to_vec()),
        ops in proptest::collection::vec(proptest::sample::select(StencilOp::ALL.to_vec()), 6),
        masks in any::<[u8; 6]>(),
        write in any::<bool>(),
        four in any::<bool>(),
        seed in any::<u32>(),
    ) {
        let format = [
            Format::Depth16Unorm, Format::Depth24Plus, Format::Depth24PlusStencil8, Format::Depth32Float,
            Format::Depth32FloatStencil8, Format::Stencil8,
        ][pick];
        let face = |i: usize| StencilFace { compare, fail_op: ops[i], depth_fail_op: ops[i + 1], pass_op: ops[i + 2] };
        let desc = DepthStencil {
            stencil_front: face(0),
            stencil_back: face(3),
            stencil_read_mask: u32::from(masks[0]),
            stencil_write_mask: u32::from(masks[1]),
            stencil_back_masks: Some(StencilMasks { read: masks[3].into(), write: masks[4].into() }),
            ..depth_state(format, compare, write)
        };
        let state = DepthStencilState::new(&desc, [masks[2], masks[5]].map(u32::from), [0.0, 1.0]);
        let samples = if four { 4 } else { 1 };
        let mut random = Random::new(seed.into());
        let depth: Vec<Lanes> =
            (0..samples).map(|_| Lanes(std::array::from_fn(|_| (random.bits() as f32 / u32::MAX as f32).to_bits()))).collect();
        let codes: Vec<Lanes> = depth
            .iter()
            .map(|d| {
                let mut out = Lanes::ZERO;
                state.codes(d, &mut out);
                for i in 0..LANES {
                    assert_eq!(out.0[i], state.code(d.f32()[i]));
                }
                out
            })
            .collect();
        let size = 4 * samples * code_words(format);
        let at: [u32; QUADS] = std::array::from_fn(|_| random.bits() % 20);
        let covered: [u16; QUADS] = std::array::from_fn(|_| random.bits() as u16 & if four { !0 } else { 15 });
        let tile: Vec<u32> = (0..20 * size)
            .map(|_| if format == Format::Depth32Float { (random.bits() as f32 / u32::MAX as f32).to_bits() } else { random.bits() })
            .collect();
        let back = random.bits() as u16;
        let (mut batch, mut single) = (tile.clone(), tile);
        let mut coverage = covered;
        state.test_batch(samples, QUADS, back, &at, &codes, &mut batch, &mut coverage);
        for q in 0..QUADS {
            let quad: Vec<[u32; 4]> = codes.iter().map(|c| std::array::from_fn(|p| c.0[4 * q + p])).collect();
            let run = &mut single[at[q] as usize * size..(at[q] as usize + 1) * size];
            let passed = state.test_quad(samples, back >> q & 1 != 0, covered[q], &quad, run);
            prop_assert_eq!(passed, coverage[q]);
        }
        prop_assert_eq!(&batch, &single);
        // Without writes the outcome of one test is the same and nothing changes.
        let before = single.clone();
        let quad: Vec<[u32; 4]> = codes.iter().map(|c| std::array::from_fn(|p| c.0[p])).collect();
        let run = &mut single[..size];
        let passed = state.read_only().test_quad(samples, false, covered[0], &quad, run);
        prop_assert_eq!(&before[..size], &run[..]);
        prop_assert_eq!(passed, state.test_quad(samples, false, covered[0], &quad, run));
    }
}
