//! Built-in functions and operators on bits, whole numbers and packed words: each result is one value, or for rounding two.

use super::interval::{ANY, Interval, rounded};
use super::{Builtin, Operands, Want};

/// An entry whose result is a word, which follows from the operands.
macro_rules! words {
    ($($name:literal, $expression:literal, $operands:ident, |$words:pat_param| $want:expr;)*) => {
        &[$(Builtin {
            name: $name,
            expression: $expression,
            float: false,
            operands: Operands::$operands,
            want: |$words| Want::Word($want),
        }),*]
    };
}

fn signed(word: u32, of: impl Fn(i32) -> i32) -> u32 {
    of(word as i32) as u32
}

fn both(x: u32, y: u32, of: impl Fn(i32, i32) -> i32) -> u32 {
    of(x as i32, y as i32) as u32
}

/// Offset and count of bits within 32.
fn field(offset: u32, count: u32) -> (u32, u32) {
    let offset = offset.min(32);
    (offset, count.min(32 - offset))
}

fn mask(count: u32) -> u32 {
    u32::MAX.checked_shr(32 - count).unwrap_or(0)
}

fn extract(x: u32, offset: u32, count: u32) -> u32 {
    let (offset, count) = field(offset, count);
    x.checked_shr(offset).unwrap_or(0) & mask(count)
}

fn extract_signed(x: u32, offset: u32, count: u32) -> u32 {
    let (_, bits) = field(offset, count);
    let unused = 32 - bits;
    if bits == 0 { 0 } else { ((extract(x, offset, count) << unused) as i32 >> unused) as u32 }
}

fn insert(x: u32, y: u32, offset: u32, count: u32) -> u32 {
    let (offset, count) = field(offset, count);
    let field = mask(count).checked_shl(offset).unwrap_or(0);
    x & !field | y.checked_shl(offset).unwrap_or(0) & field
}

fn first_leading(x: u32) -> u32 {
    31_u32.wrapping_sub(x.leading_zeros())
}

fn first_leading_signed(x: u32) -> u32 {
    first_leading(if x >> 31 != 0 { !x } else { x })
}

fn first_trailing(x: u32) -> u32 {
    if x == 0 { u32::MAX } else { x.trailing_zeros() }
}

fn bytes(x: u32) -> [i32; 4] {
    x.to_le_bytes().map(i32::from)
}

fn signed_bytes(x: u32) -> [i32; 4] {
    x.to_le_bytes().map(|byte| i32::from(byte as i8))
}

fn dot4(x: [i32; 4], y: [i32; 4]) -> u32 {
    x.iter().zip(y).map(|(x, y)| x * y).sum::<i32>() as u32
}

/// The lowest bytes of four words.
fn low_bytes(words: [u32; 4]) -> u32 {
    u32::from_le_bytes(words.map(|word| word as u8))
}

/// WGSL: floor(0.5 + scale * clamp(x)), of which the sum is exact or rounded.
fn normal(x: u32, low: f64, scale: f64) -> u32 {
    libm::floor(0.5 + scale * f64::from(f32::from_bits(x)).clamp(low, 1.0)) as i32 as u32
}

/// Of two words the lowest halves.
fn halves(x: u32, y: u32) -> u32 {
    x & 0xffff | y << 16
}

/// Exact.
pub const WORDS: &[Builtin] = words![
    "i32 +", "bitcast<u32>(i + j)", Words2, |[x, y, _]| x.wrapping_add(y);
    "i32 -", "bitcast<u32>(i - j)", Words2, |[x, y, _]| x.wrapping_sub(y);
    "i32 *", "bitcast<u32>(i * j)", Words2, |[x, y, _]| x.wrapping_mul(y);
    "i32 /: by 0 and the least by -1 the dividend", "bitcast<u32>(i / j)", Words2, |[x, y, _]| {
        both(x, y, |x, y| if y == 0 { x } else { x.wrapping_div(y) })
    };
    "i32 %: by 0 and the least by -1 nothing", "bitcast<u32>(i % j)", Words2, |[x, y, _]| {
        both(x, y, |x, y| if y == 0 { 0 } else { x.wrapping_rem(y) })
    };
    "u32 /: by 0 the dividend", "x / y", Words2, |[x, y, _]| x.checked_div(y).unwrap_or(x);
    "u32 %: by 0 nothing", "x % y", Words2, |[x, y, _]| x.checked_rem(y).unwrap_or(0);
    "u32 * +", "x * y + z", Words3, |[x, y, z]| x.wrapping_mul(y).wrapping_add(z);
    "i32 negation", "bitcast<u32>(-i)", Words1, |[x, ..]| signed(x, i32::wrapping_neg);
    "shift left, modulo 32", "x << y", Words2, |[x, y, _]| x.wrapping_shl(y);
    "u32 shift right, modulo 32", "x >> y", Words2, |[x, y, _]| x.wrapping_shr(y);
    "i32 shift right, modulo 32", "bitcast<u32>(i >> y)", Words2, |[x, y, _]| signed(x, |x| x.wrapping_shr(y));
    "& | ^ ~", "(x & y) | (~x ^ z)", Words3, |[x, y, z]| x & y | (!x ^ z);
    "i32 < <= == != >= >", "select(0u, 1u, i < j) | select(0u, 2u, i <= j) | select(0u, 4u, i == j) | select(0u, 8u, i >= j)",
        Words2, |[x, y, _]| {
        let (x, y) = (x as i32, y as i32);
        u32::from(x < y) | u32::from(x <= y) << 1 | u32::from(x == y) << 2 | u32::from(x >= y) << 3
    };
    "u32 < <= >= >", "select(0u, 1u, x < y) | select(0u, 2u, x <= y) | select(0u, 4u, x > y)", Words2, |[x, y, _]| {
        u32::from(x < y) | u32::from(x <= y) << 1 | u32::from(x > y) << 2
    };
    "all", "u32(all(vec3u(x, y, z) > vec3u(7u)))", Words3, |words| u32::from(words.iter().all(|&word| word > 7));
    "any", "u32(any(vec3u(x, y, z) > vec3u(7u)))", Words3, |words| u32::from(words.iter().any(|&word| word > 7));
    "i32 abs", "bitcast<u32>(abs(i))", Words1, |[x, ..]| signed(x, i32::wrapping_abs);
    "i32 sign", "bitcast<u32>(sign(i))", Words1, |[x, ..]| signed(x, i32::signum);
    "i32 min", "bitcast<u32>(min(i, j))", Words2, |[x, y, _]| both(x, y, i32::min);
    "i32 max", "bitcast<u32>(max(i, j))", Words2, |[x, y, _]| both(x, y, i32::max);
    "u32 min", "min(x, y)", Words2, |[x, y, _]| x.min(y);
    "u32 max", "max(x, y)", Words2, |[x, y, _]| x.max(y);
    "i32 clamp", "bitcast<u32>(clamp(i, j, k))", Words3, |[x, y, z]| ((x as i32).max(y as i32)).min(z as i32) as u32;
    "u32 clamp", "clamp(x, y, z)", Words3, |[x, y, z]| x.max(y).min(z);
    "countLeadingZeros", "countLeadingZeros(x)", Words1, |[x, ..]| x.leading_zeros();
    "countOneBits", "countOneBits(x)", Words1, |[x, ..]| x.count_ones();
    "countTrailingZeros", "countTrailingZeros(x)", Words1, |[x, ..]| x.trailing_zeros();
    "firstLeadingBit of u32", "firstLeadingBit(x)", Words1, |[x, ..]| first_leading(x);
    "firstLeadingBit of i32", "bitcast<u32>(firstLeadingBit(i))", Words1, |[x, ..]| first_leading_signed(x);
    "firstTrailingBit", "firstTrailingBit(x)", Words1, |[x, ..]| first_trailing(x);
    "reverseBits", "reverseBits(x)", Words1, |[x, ..]| x.reverse_bits();
    "extractBits of u32", "extractBits(x, y, z)", Words3, |[x, y, z]| extract(x, y, z);
    "extractBits of i32", "bitcast<u32>(extractBits(i, y, z))", Words3, |[x, y, z]| extract_signed(x, y, z);
    "insertBits", "insertBits(x, 0xdeadbeefu, y, z)", Words3, |[x, y, z]| insert(x, 0xdead_beef, y, z);
    "dot of i32", "bitcast<u32>(dot(vec2i(i, j), vec2i(k, i)))", Words3, |[x, y, z]| {
        x.wrapping_mul(z).wrapping_add(y.wrapping_mul(x))
    };
    "dot4U8Packed", "dot4U8Packed(x, y)", Words2, |[x, y, _]| dot4(bytes(x), bytes(y));
    "dot4I8Packed", "bitcast<u32>(dot4I8Packed(x, y))", Words2, |[x, y, _]| dot4(signed_bytes(x), signed_bytes(y));
    "pack4xI8", "pack4xI8(vec4i(i, j, k, i))", Words3, |[x, y, z]| low_bytes([x, y, z, x]);
    "pack4xU8", "pack4xU8(vec4u(x, y, z, x))", Words3, |[x, y, z]| low_bytes([x, y, z, x]);
    "pack4xI8Clamp", "pack4xI8Clamp(vec4i(i, j, k, i))", Words3, |[x, y, z]| {
        low_bytes([x, y, z, x].map(|word| signed(word, |word| word.clamp(-128, 127))))
    };
    "pack4xU8Clamp", "pack4xU8Clamp(vec4u(x, y, z, x))", Words3, |[x, y, z]| low_bytes([x, y, z, x].map(|word| word.min(255)));
    "unpack4xI8", "bitcast<u32>(unpack4xI8(x)[y & 3u])", Words2, |[x, y, _]| signed_bytes(x)[y as usize & 3] as u32;
    "unpack4xU8", "unpack4xU8(x)[y & 3u]", Words2, |[x, y, _]| bytes(x)[y as usize & 3] as u32;
    "bitcast", "bitcast<u32>(bitcast<f32>(bitcast<i32>(x)))", One, |[x, ..]| x;
    "u32 of i32, i32 of u32", "u32(i32(x))", Words1, |[x, ..]| x;
    "u32 of bool, bool of i32 and u32", "u32(bool(i)) + u32(bool(x)) + u32(i32(true))", Words1, |[x, ..]| {
        1 + 2 * u32::from(x != 0)
    };
    "bool of f32", "u32(bool(a))", One, |[x, ..]| u32::from(f32::from_bits(x) != 0.0);
    "f32 < <= == >= >", "select(0u, 1u, a < b) | select(0u, 2u, a <= b) | select(0u, 4u, a == b) | select(0u, 8u, a > b)", Two,
        |[x, y, _]| {
        let (x, y) = (f32::from_bits(x), f32::from_bits(y));
        u32::from(x < y) | u32::from(x <= y) << 1 | u32::from(x == y) << 2 | u32::from(x > y) << 3
    };
];

fn one(word: u32) -> Interval {
    super::interval::point(f64::from(f32::from_bits(word)))
}

/// A float as a whole number, which stays within its type; beyond it the last one that the type has, or the last one that is also an
/// `f32`: both are in use.
fn whole(x: u32, least: f64, most: u32) -> Want {
    let x = libm::trunc(f64::from(f32::from_bits(x)));
    if x > f64::from(most) {
        Want::Either(most, (f64::from((most as f32).next_down()) as u64) as u32)
    } else {
        Want::Word(x.max(least) as i64 as u32)
    }
}

/// Words of normalised numbers: where the sum before the floor is not exact in `f32`, it may be rounded up.
fn packed(parts: &[u32], low: f64, scale: f64, bits: u32) -> Want {
    let pack = |parts: Vec<u32>| {
        let mask = mask(bits);
        parts.iter().enumerate().fold(0, |word, (k, &part)| word | (part & mask) << (bits * k as u32))
    };
    let exact = pack(parts.iter().map(|&x| normal(x, low, scale)).collect());
    let rounded = pack(
        parts
            .iter()
            .map(|&x| libm::floorf(0.5 + scale as f32 * f32::from_bits(x).clamp(low as f32, 1.0)) as i32 as u32)
            .collect(),
    );
    Want::Either(exact, rounded)
}

fn unpacked(value: i32, scale: f64) -> Want {
    // The quotient inherits the accuracy of a division.
    Want::In(super::interval::point(f64::from(value)).over(super::interval::point(scale)).map(|x| x.max(-1.0)))
}

const fn of(
    name: &'static str,
    expression: &'static str,
    float: bool,
    operands: Operands,
    want: fn([u32; 3]) -> Want,
) -> Builtin {
    Builtin { name, expression, float, operands, want }
}

/// Conversions, packing and unpacking of floats.
pub const CONVERSIONS: &[Builtin] = &[
    of("f32 of i32", "f32(i)", true, Operands::Words1, |[x, ..]| Want::In(rounded(f64::from(x as i32)))),
    of("f32 of u32", "f32(x)", true, Operands::Words1, |[x, ..]| Want::In(rounded(f64::from(x)))),
    of("f32 of bool", "f32(bool(x))", true, Operands::Words1, |[x, ..]| Want::In(rounded(f64::from(u8::from(x != 0))))),
    of("i32 of f32: to 0, within the type", "bitcast<u32>(i32(a))", false, Operands::One, |[x, ..]| {
        whole(x, f64::from(i32::MIN), i32::MAX as u32)
    }),
    of("u32 of f32: to 0, within the type", "u32(a)", false, Operands::One, |[x, ..]| whole(x, 0.0, u32::MAX)),
    of("pack4x8snorm", "pack4x8snorm(vec4f(a, b, c, a))", false, Operands::Three, |[x, y, z]| {
        packed(&[x, y, z, x], -1.0, 127.0, 8)
    }),
    of("pack4x8unorm", "pack4x8unorm(vec4f(a, b, c, a))", false, Operands::Three, |[x, y, z]| {
        packed(&[x, y, z, x], 0.0, 255.0, 8)
    }),
    of("pack2x16snorm", "pack2x16snorm(vec2f(a, b))", false, Operands::Two, |[x, y, _]| packed(&[x, y], -1.0, 32_767.0, 16)),
    of("pack2x16unorm", "pack2x16unorm(vec2f(a, b))", false, Operands::Two, |[x, y, _]| packed(&[x, y], 0.0, 65_535.0, 16)),
    of("unpack4x8snorm", "unpack4x8snorm(x)[y & 3u]", true, Operands::Words2, |[x, y, _]| {
        unpacked(signed_bytes(x)[y as usize & 3], 127.0)
    }),
    of("unpack4x8unorm", "unpack4x8unorm(x)[y & 3u]", true, Operands::Words2, |[x, y, _]| {
        unpacked(bytes(x)[y as usize & 3], 255.0)
    }),
    of("unpack2x16snorm", "unpack2x16snorm(x).y", true, Operands::Words1, |[x, ..]| unpacked((x as i32) >> 16, 32_767.0)),
    of("unpack2x16unorm", "unpack2x16unorm(x).y", true, Operands::Words1, |[x, ..]| unpacked((x >> 16) as i32, 65_535.0)),
    of("unpack2x16float", "unpack2x16float(x).x", true, Operands::Halves, |[x, ..]| Want::In(one(x))),
    of("pack2x16float of halves", "pack2x16float(unpack2x16float(x))", false, Operands::Words1, |[x, ..]| {
        // Where it is a number; which one infinities and no-numbers become is open.
        let number = |half: u32| half & 0x7c00 != 0x7c00;
        if number(x) && number(x >> 16) { Want::Word(halves(x, x >> 16)) } else { Want::In(ANY) }
    }),
];
