//! Numeric built-in functions against f64 or exact integers, with stated bounds.

use super::*;

/// Inputs that cover magnitudes, signs and special places of a range.
fn samples(low: f32, high: f32) -> impl Fn(u32) -> u32 {
    move |i| {
        let t = i as f32 / 63.0;
        (low + (high - low) * t).to_bits()
    }
}

fn ulp(x: f64) -> f64 {
    let x = (x as f32).abs();
    if x < f32::MIN_POSITIVE { f64::from(f32::from_bits(1)) } else { f64::from(f32::from_bits(x.to_bits() + 1)) - f64::from(x) }
}

/// One function of `f` (an `f32`), its reference, and the bound in ULP plus an absolute one.
#[track_caller]
fn unary(expression: &str, range: (f32, f32), reference: impl Fn(f64) -> f64, ulps: f64, absolute: f64) {
    let input = samples(range.0, range.1);
    let got = each_u32(&format!("let f = bitcast<f32>(x); r = bitcast<u32>({expression});"), &input);
    for i in 0..64 {
        let x = f64::from(f32::from_bits(input(i)));
        let (want, have) = (reference(x), f64::from(f32::from_bits(got[i as usize])));
        let error = (want - have).abs();
        assert!(error <= ulps * ulp(want) + absolute, "{expression} at {x}: {have} instead of {want}");
    }
}

#[test]
fn floating_point_functions() {
    unary("abs(f)", (-3.0, 3.0), f64::abs, 0.0, 0.0);
    unary("ceil(f)", (-3.0, 3.0), f64::ceil, 0.0, 0.0);
    unary("floor(f)", (-3.0, 3.0), f64::floor, 0.0, 0.0);
    unary("trunc(f)", (-3.0, 3.0), f64::trunc, 0.0, 0.0);
    unary("round(f)", (-15.75, 15.75), f64::round_ties_even, 0.0, 0.0);
    unary("fract(f)", (-3.0, 3.0), |x| x - x.floor(), 1.0, 6e-8);
    unary("sign(f)", (-3.0, 3.0), |x| if x == 0.0 { 0.0 } else { x.signum() }, 0.0, 0.0);
    unary("saturate(f)", (-1.0, 2.0), |x| x.clamp(0.0, 1.0), 0.0, 0.0);
    unary("sqrt(f)", (0.0, 9.0), f64::sqrt, 0.5, 0.0);
    unary("inverseSqrt(f)", (0.01, 9.0), |x| 1.0 / x.sqrt(), 2.0, 0.0);
    unary("1.0 / f", (0.01, 9.0), |x| 1.0 / x, 0.5, 0.0);
    unary("exp(f)", (-10.0, 10.0), f64::exp, 23.0, 0.0);
    unary("exp2(f)", (-20.0, 20.0), f64::exp2, 43.0, 0.0);
    unary("log(f)", (2.1, 100.0), f64::ln, 3.0, 0.0);
    unary("log2(f)", (2.1, 100.0), f64::log2, 3.0, 0.0);
    unary("log2(f)", (0.5, 2.0), f64::log2, 0.0, 2f64.powi(-21));
    unary("sin(f)", (-std::f32::consts::PI, std::f32::consts::PI), f64::sin, 0.0, 2f64.powi(-11));
    unary("cos(f)", (-std::f32::consts::PI, std::f32::consts::PI), f64::cos, 0.0, 2f64.powi(-11));
    unary("tan(f)", (-1.4, 1.4), f64::tan, 100.0, 1e-6);
    unary("asin(f)", (-1.0, 1.0), f64::asin, 4.0, 1e-6);
    unary("acos(f)", (-1.0, 1.0), f64::acos, 4.0, 1e-6);
    unary("atan(f)", (-5.0, 5.0), f64::atan, 4.0, 1e-6);
    unary("atan2(f, 0.5)", (-5.0, 5.0), |x| x.atan2(0.5), 4.0, 1e-6);
    unary("atan2(f, -0.5)", (-5.0, 5.0), |x| x.atan2(-0.5), 4.0, 1e-6);
    unary("sinh(f)", (-4.0, 4.0), f64::sinh, 8.0, 1e-6);
    unary("cosh(f)", (-4.0, 4.0), f64::cosh, 8.0, 0.0);
    unary("tanh(f)", (-4.0, 4.0), f64::tanh, 8.0, 1e-6);
    unary("asinh(f)", (-4.0, 4.0), f64::asinh, 8.0, 1e-6);
    unary("acosh(f)", (1.0, 9.0), f64::acosh, 8.0, 1e-6);
    unary("atanh(f)", (-0.9, 0.9), f64::atanh, 8.0, 1e-6);
    unary("degrees(f)", (-4.0, 4.0), f64::to_degrees, 2.0, 0.0);
    unary("radians(f)", (-400.0, 400.0), f64::to_radians, 2.0, 0.0);
    unary("pow(abs(f), 2.5)", (0.1, 9.0), |x| x.powf(2.5), 64.0, 0.0);
    unary("pow(max(f, 0.0), 32.0)", (-0.2, 1.0), |x| x.max(0.0).powi(32), 1024.0, 1e-30);
    unary("f % 0.75", (-3.0, 3.0), |x| x % 0.75, 2.0, 5e-7);
    unary("fma(f, f, 1.5)", (-3.0, 3.0), |x| x * x + 1.5, 1.0, 1e-6);
    unary("mix(2.0, 5.0, f)", (0.0, 1.0), |x| 2.0 + 3.0 * x, 2.0, 0.0);
    unary("step(0.5, f)", (0.0, 1.0), |x| f64::from(u8::from(x >= 0.5)), 0.0, 0.0);
    unary(
        "smoothstep(-1.0, 2.0, f)",
        (-2.0, 3.0),
        |x| {
            let t = ((x + 1.0) / 3.0).clamp(0.0, 1.0);
            t * t * (3.0 - 2.0 * t)
        },
        8.0,
        1e-7,
    );
    unary("clamp(f, -0.5, 0.25)", (-2.0, 3.0), |x| x.clamp(-0.5, 0.25), 0.0, 0.0);
    unary("min(f, 0.25)", (-2.0, 3.0), |x| x.min(0.25), 0.0, 0.0);
    unary("ldexp(f, 3)", (-2.0, 3.0), |x| x * 8.0, 0.0, 0.0);
    unary("ldexp(f, -130)", (1.0, 3.0), |x| x * 2f64.powi(-130), 1.0, 0.0);
    unary("modf(f).fract", (-3.0, 3.0), f64::fract, 0.0, 0.0);
    unary("modf(f).whole", (-3.0, 3.0), f64::trunc, 0.0, 0.0);
    unary("ldexp(frexp(f).fract, frexp(f).exp)", (-300.0, 300.0), |x| x, 0.0, 0.0);
    unary("frexp(f).fract", (1.0, 1.9), |x| x / 2.0, 0.0, 0.0);
    unary("quantizeToF16(f)", (-2000.0, 2000.0), |x| x, 0.0, 0.5);
}

#[test]
fn vector_functions() {
    let v = "let a = vec3f(f, 1.0 - f, 0.5); let b = vec3f(0.25, f * f, -f);";
    let with = |e: &str, reference: &dyn Fn(f64) -> f64| {
        let input = samples(-2.0, 2.0);
        let got = each_u32(&format!("let f = bitcast<f32>(x); {v} r = bitcast<u32>(f32({e}));"), &input);
        for i in 0..64 {
            let x = f64::from(f32::from_bits(input(i)));
            let (want, have) = (reference(x), f64::from(f32::from_bits(got[i as usize])));
            assert!((want - have).abs() <= 4e-6 * (1.0 + want.abs()), "{e} at {x}: {have} instead of {want}");
        }
    };
    let a = |f: f64| [f, 1.0 - f, 0.5];
    let b = |f: f64| [0.25, f * f, -f];
    let dot = |p: [f64; 3], q: [f64; 3]| p[0] * q[0] + p[1] * q[1] + p[2] * q[2];
    with("dot(a, b)", &|f| dot(a(f), b(f)));
    with("length(a)", &|f| dot(a(f), a(f)).sqrt());
    with("distance(a, b)", &|f| {
        let d: [f64; 3] = std::array::from_fn(|i| a(f)[i] - b(f)[i]);
        dot(d, d).sqrt()
    });
    with("normalize(a).y", &|f| a(f)[1] / dot(a(f), a(f)).sqrt());
    with("normalize(a.xz).y", &|f| 0.5 / (f * f + 0.25).sqrt());
    with("normalize(vec4f(a, f)).w", &|f| f / (dot(a(f), a(f)) + f * f).sqrt());
    with("cross(a, b).x", &|f| a(f)[1] * b(f)[2] - a(f)[2] * b(f)[1]);
    with("cross(a, b).z", &|f| a(f)[0] * b(f)[1] - a(f)[1] * b(f)[0]);
    with("reflect(a, b).y", &|f| a(f)[1] - 2.0 * dot(a(f), b(f)) * b(f)[1]);
    with("faceForward(a, b, a).x", &|f| if dot(b(f), a(f)) < 0.0 { f } else { -f });
    with("refract(normalize(a), vec3f(0.0, 0.0, 1.0), 0.5).z", &|f| {
        let n = dot(a(f), a(f)).sqrt();
        let d = 0.5 / n;
        0.5 * d - (0.5 * d + (1.0 - 0.25 * (1.0 - d * d)).sqrt())
    });
    with("determinant(mat3x3f(a, b, vec3f(1.0, 2.0, f)))", &|f| {
        let (a, b, c) = (a(f), b(f), [1.0, 2.0, f]);
        a[0] * (b[1] * c[2] - b[2] * c[1]) - a[1] * (b[0] * c[2] - b[2] * c[0]) + a[2] * (b[0] * c[1] - b[1] * c[0])
    });
    with("(mat3x3f(a, b, vec3f(1.0, 2.0, f)) * vec3f(f, 2.0, 3.0)).y", &|f| (1.0 - f) * f + f * f * 2.0 + 6.0);
    with("(vec3f(f, 2.0, 3.0) * mat3x3f(a, b, vec3f(1.0, 2.0, f))).y", &|f| 0.25 * f + 2.0 * f * f - 3.0 * f);
    with("(mat2x3f(a, b) * mat3x2f(a.xy, b.yz, vec2f(2.0, f)))[2].z", &|f| 0.5 * 2.0 - f * f);
    with("transpose(mat2x3f(a, b))[2].y", &|f| -f);
    with("(mat2x3f(a, b) + mat2x3f(b, a))[1].x", &|f| f + 0.25);
    with("(2.0 * mat2x2f(f, 1.0, 2.0, 3.0))[0].x", &|f| 2.0 * f);
    with("a[u32(x) % 3u] * 0.0 + b[2]", &|f| -f);
}

#[test]
fn integer_functions() {
    let input = |i: u32| i.wrapping_mul(0x9e37_79b9) ^ (i << 27);
    let check = |e: &str, reference: &dyn Fn(u32) -> u32| {
        let got = each_u32(&format!("let s = bitcast<i32>(x); r = u32({e});"), input);
        for i in 0..64 {
            let x = input(i);
            assert_eq!(got[i as usize], reference(x), "{e} at {x:#x}");
        }
    };
    check("countOneBits(x)", &u32::count_ones);
    check("countLeadingZeros(x)", &u32::leading_zeros);
    check("countTrailingZeros(x)", &u32::trailing_zeros);
    check("reverseBits(x)", &u32::reverse_bits);
    check("firstLeadingBit(x)", &|x| 31u32.wrapping_sub(x.leading_zeros()));
    check("firstLeadingBit(s)", &|x| {
        let y = if (x as i32) < 0 { !x } else { x };
        31u32.wrapping_sub(y.leading_zeros())
    });
    check("firstTrailingBit(x)", &|x| if x == 0 { u32::MAX } else { x.trailing_zeros() });
    check("extractBits(x, 5u, 9u)", &|x| x >> 5 & 511);
    check("extractBits(s, 5u, 9u)", &|x| (((x >> 5 & 511) as i32) << 23 >> 23) as u32);
    check("extractBits(x, 20u, 40u)", &|x| x >> 20);
    check("extractBits(x, 40u, 3u)", &|_| 0);
    check("extractBits(x, x & 31u, x >> 27u)", &|x| {
        let (o, c) = (x & 31, (x >> 27).min(32 - (x & 31)));
        if c == 0 { 0 } else { ((u64::from(x) >> o) & ((1u64 << c) - 1)) as u32 }
    });
    check("insertBits(x, 0xabcu, 4u, 8u)", &|x| x & !0xff0 | 0xbc0);
    check("insertBits(x, 5u, 31u, 9u)", &|x| x & 0x7fff_ffff | 0x8000_0000);
    check("insertBits(x, 5u, 3u, 0u)", &|x| x);
    check("abs(s)", &|x| (x as i32).wrapping_abs() as u32);
    check("sign(s)", &|x| (x as i32).signum() as u32);
    check("min(s, -7)", &|x| (x as i32).min(-7) as u32);
    check("clamp(s, -100000, 100000)", &|x| (x as i32).clamp(-100_000, 100_000) as u32);
    check("clamp(x, 5u, 70000u)", &|x| x.clamp(5, 70_000));
    check("x / (x & 3u)", &|x| x.checked_div(x & 3).unwrap_or(x));
    check("x % (x & 3u)", &|x| x.checked_rem(x & 3).unwrap_or(0));
    check("s / (s & 3)", &|x| (x as i32).checked_div(x as i32 & 3).unwrap_or(x as i32) as u32);
    check("s % 7", &|x| (x as i32 % 7) as u32);
    check("s >> (x & 31u)", &|x| (x as i32 >> (x & 31)) as u32);
    check("x << (x & 31u)", &|x| x << (x & 31));
    check("~x ^ (x | 5u)", &|x| !x ^ (x | 5));
    check("dot(vec3u(x, 3u, x), vec3u(2u, x, x))", &|x| {
        x.wrapping_mul(2).wrapping_add(x.wrapping_mul(3)).wrapping_add(x.wrapping_mul(x))
    });
    check("dot4U8Packed(x, 0x01020304u)", &|x| (x & 255) * 4 + (x >> 8 & 255) * 3 + (x >> 16 & 255) * 2 + (x >> 24));
    check("dot4I8Packed(x, 0x01020304u)", &|x| {
        let b = |k: u32| i32::from((x >> k) as u8 as i8);
        (b(0) * 4 + b(8) * 3 + b(16) * 2 + b(24)) as u32
    });
    check("i32(f32(s))", &|x| ((x as i32 as f32) as i32).min(2_147_483_520) as u32);
    check("u32(f32(x) * 4.0)", &|x| ((x as f32 * 4.0) as u32).min(4_294_967_040));
    check("u32(-f32(x))", &|_| 0);
    check("u32(bool(x & 1u)) + u32(f32(true))", &|x| (x & 1) + 1);
    check("select(x, 9u, s < 0)", &|x| if (x as i32) < 0 { 9 } else { x });
    check("u32(all(vec2u(x) > vec2u(5u, 9u)))", &|x| u32::from(x > 9));
    check("u32(any(vec2<bool>(x == 0u, s < 0)))", &|x| u32::from(x == 0 || (x as i32) < 0));
}

#[test]
fn packing_functions() {
    let input = |i: u32| i.wrapping_mul(0x9e37_79b9) ^ (i << 27);
    let check = |e: &str, reference: &dyn Fn(u32) -> u32| {
        let got = each_u32(&format!("r = {e};"), input);
        for i in 0..64 {
            let x = input(i);
            assert_eq!(got[i as usize], reference(x), "{e} at {x:#x}");
        }
    };
    // What unpacks exactly packs to the same bits (the lowest signed code has a twin).
    check("pack4x8unorm(unpack4x8unorm(x))", &|x| x);
    check("pack2x16unorm(unpack2x16unorm(x))", &|x| x);
    check("pack4x8snorm(unpack4x8snorm(x))", &|x| {
        (0..4)
            .map(|k| u32::from((x >> (8 * k)) as u8))
            .enumerate()
            .fold(0, |sum, (k, b)| sum | (if b == 0x80 { 0x81 } else { b }) << (8 * k))
    });
    check("pack2x16snorm(unpack2x16snorm(x & 0x7fff7fffu))", &|x| x & 0x7fff_7fff);
    check("pack4xU8(unpack4xU8(x))", &|x| x);
    check("pack4xI8(unpack4xI8(x))", &|x| x);
    check("pack4xU8Clamp(vec4u(x & 511u, 7u, 300u, 0u))", &|x| (x & 511).min(255) | 7 << 8 | 255 << 16);
    check("pack4xI8Clamp(vec4i(i32(x & 511u) - 256, 7, 300, -300))", &|x| {
        (((x & 511) as i32 - 256).clamp(-128, 127) as u32 & 255) | 7 << 8 | 127 << 16 | 128 << 24
    });
    check("pack2x16float(vec2f(unpack2x16float(x & 0x7bff7bffu)))", &|x| x & 0x7bff_7bff);
}

#[test]
fn half_conversions_are_exact() {
    // All 65,536 codes there and back, and rounding at every boundary between two neighbours.
    use crate::code::eval::{from_half, to_half};
    for h in 0..0x10000u32 {
        let x = from_half(h);
        if x.is_nan() {
            assert!(h & 0x7fff > 0x7c00);
            continue;
        }
        assert_eq!(to_half(x), h);
        let magnitude = h & 0x7fff;
        if magnitude < 0x7bff {
            let next = from_half(h + 1);
            let middle = (x + next) / 2.0;
            assert_eq!(to_half(middle), h + (h & 1), "ties go to even at {h:#x}");
            let above = f32::from_bits(middle.to_bits() + 1);
            assert_eq!(to_half(above), h + 1);
            if middle != 0.0 {
                assert_eq!(to_half(f32::from_bits(middle.to_bits() - 1)), h);
            }
        }
    }
    assert_eq!(to_half(65_519.9), 0x7bff);
    assert_eq!(to_half(65_520.0), 0x7c00);
    assert_eq!(to_half(1e-9), 0);
}

#[test]
fn conversions_to_integers_end_with_the_last_that_a_float_can_be() {
    use crate::code::eval::{from_half, half_to_s, half_to_u, to_half, to_s, to_u};
    let special = [0.0, -0.0, 0.5, -0.5, 1.0, -1.0, 1.5, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN, 1e-40];
    let powers = (0..64).flat_map(|e| {
        let p = 2f32.powi(e - 4);
        [p, -p, f32::from_bits(p.to_bits() - 1), f32::from_bits(p.to_bits() + 1), -f32::from_bits(p.to_bits() - 1)]
    });
    let random = (0..100_000u32).map(|i| f32::from_bits(i.wrapping_mul(0x9e37_79b9)));
    for x in special.into_iter().chain(powers).chain(random) {
        assert_eq!(to_s(x), (x as i32).min(2_147_483_520), "{x}");
        assert_eq!(to_u(x), (x as u32).min(4_294_967_040), "{x}");
        let half = from_half(to_half(x));
        assert_eq!(half_to_s(half), (half as i32).clamp(-65_504, 65_504), "{half}");
        assert_eq!(half_to_u(half), (half as u32).min(65_504), "{half}");
    }
}

/// Floats that no integer of 32 bits is, and neighbours of the last that one is.
const FAR: [f32; 12] = [
    1e20,
    -1e20,
    3e38,
    2_147_483_648.0,
    2_147_483_520.0,
    -2_147_483_648.0,
    -2_147_483_904.0,
    4_294_967_296.0,
    4_294_967_040.0,
    3e9,
    -0.75,
    65_504.0,
];

#[test]
fn a_conversion_to_an_integer_has_one_value_wherever_it_is_computed() {
    // By naga, which folds constants; by the compiler, which folds what naga leaves; in a batch; in vectors.
    for x in FAR {
        let (signed, unsigned) = ((x as i32).min(2_147_483_520) as u32, (x as u32).min(4_294_967_040));
        for (to, expected) in [("i32", signed), ("u32", unsigned)] {
            let word = if to == "i32" { "bitcast<u32>" } else { "" };
            let forms = [
                format!("const c = {to}({x:?}f); r = {word}(c);"),
                format!("const c = vec2<{to}>(vec2f({x:?}f, 1)); r = {word}(c.x);"),
                format!("var f = {x:?}f; r = {word}({to}(f));"),
                format!("r = {word}({to}(bitcast<f32>(x)));"),
                format!("let v = vec3<{to}>(vec3f(0, bitcast<f32>(x), 1)); r = {word}(v.y);"),
                format!("r = {word}({to}(select(0f, bitcast<f32>(x), x != 1)));"),
            ];
            for form in forms {
                assert_eq!(each_u32(&form, |_| x.to_bits()), [expected; 64], "{form}");
            }
        }
    }
    // The greatest f16 is what an infinite one becomes.
    for (to, word, low) in [("i32", "bitcast<u32>", -65_504_i32 as u32), ("u32", "", 0)] {
        let half = |body: &str, x: f32| {
            let head = "enable f16; @group(0) @binding(0) var<storage, read_write> result: array<u32>;
                @group(0) @binding(1) var<storage, read> input: array<u32>;
                @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) { let x = input[id.x];";
            each(&format!("{head} result[id.x] = {body}; }}"), |_| x.to_bits())
        };
        let overflow = format!("{word}({to}(f16(bitcast<f32>(x)) * 2h))");
        assert_eq!(half(&overflow, 65_504.0), [65_504; 64]);
        assert_eq!(half(&overflow, -65_504.0), [low; 64]);
        assert_eq!(half(&overflow, 1234.0), [2468; 64]);
        assert_eq!(half(&format!("{word}({to}(65504h))"), 0.0), [65_504; 64]);
        assert_eq!(half(&format!("{word}(vec2<{to}>(vec2<f16>(f16(bitcast<f32>(x)) * 2h))).y"), 65_504.0), [65_504; 64]);
    }
}
