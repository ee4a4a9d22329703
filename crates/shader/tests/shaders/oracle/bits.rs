//! Built-in functions of bits: counts, fields, packing.

use naga::MathFunction;

use super::Fault;
use super::number::{f16_bits, f16_value};
use super::value::{Number, Value, broken};

/// A function of the bits of each integer, whose result has the type of the argument.
fn each(x: &Value, f: impl Fn(u32) -> u32) -> Result<Value, Fault> {
    x.map(&mut |n| match n {
        Number::Sint(x) => Ok(Number::Sint(f(x as u32) as i32)),
        Number::Uint(x) => Ok(Number::Uint(f(x))),
        _ => broken("a built-in function of integers with another argument"),
    })
}

/// The number of the highest bit that is set; all ones if none is.
fn first_leading(x: u32) -> u32 {
    (0..32).rev().find(|&i| x >> i & 1 != 0).unwrap_or(u32::MAX)
}

/// The number of the lowest bit that is set; all ones if none is.
fn first_trailing(x: u32) -> u32 {
    (0..32).find(|&i| x >> i & 1 != 0).unwrap_or(u32::MAX)
}

/// WGSL: a field begins at bit 32 at most and ends there at most.
fn field(offset: u32, count: u32) -> (u32, u32) {
    let offset = offset.min(32);
    (offset, count.min(32 - offset))
}

/// The bits of a field, its lowest bit first.
fn extract(x: u32, offset: u32, count: u32, signed: bool) -> u32 {
    let (offset, count) = field(offset, count);
    let mut out = 0;
    for i in 0..count {
        out |= (x >> (offset + i) & 1) << i;
    }
    if signed && count > 0 && out >> (count - 1) & 1 != 0 {
        for i in count..32 {
            out |= 1 << i;
        }
    }
    out
}

/// `x` with the lowest `count` bits of `new` in a field.
fn insert(x: u32, new: u32, offset: u32, count: u32) -> u32 {
    let (offset, count) = field(offset, count);
    let mut out = x;
    for i in 0..count {
        out = out & !(1 << (offset + i)) | (new >> i & 1) << (offset + i);
    }
    out
}

/// Packs each number as a code of `width` bits, the first lowest.
fn pack(x: &Value, width: u32, code: impl Fn(Number) -> Result<u32, Fault>) -> Result<Value, Fault> {
    let mut out = 0;
    for (i, &n) in x.numbers()?.iter().enumerate() {
        out |= (code(n)? & ((1 << width) - 1)) << (width * i as u32);
    }
    Ok(Value::Number(Number::Uint(out)))
}

/// The codes of `width` bits in a word, the lowest first.
fn unpack(x: &Value, width: u32, number: impl Fn(u32) -> Number) -> Result<Value, Fault> {
    let word = x.integer()?;
    let numbers: Vec<Number> = (0..32 / width).map(|i| number(word >> (width * i) & ((1 << width) - 1))).collect();
    Ok(Value::vector(&numbers))
}

/// A code of `width` bits with its sign.
fn with_sign(code: u32, width: u32) -> i32 {
    (code << (32 - width)) as i32 >> (32 - width)
}

/// The code of a number in [low, 1], where 1 is `scale`: floor(0.5 + scale * x). NaN is taken for the lower bound.
fn normalized(low: f32, scale: f32) -> impl Fn(Number) -> Result<u32, Fault> {
    move |n| match n {
        Number::Float(x) => Ok((0.5 + scale * super::builtins::clamp(x, low, 1.0)).floor() as i32 as u32),
        _ => broken("a pack function of floats with another argument"),
    }
}

fn half(n: Number) -> Result<u32, Fault> {
    match n {
        Number::Float(x) => Ok(f16_bits(x)),
        _ => broken("a pack function of floats with another argument"),
    }
}

/// The sum of the products of the four bytes of two words.
fn dot4(args: &[Value], signed: bool) -> Result<Value, Fault> {
    let (a, b) = (args[0].integer()?, args[1].integer()?);
    let mut sum = 0i32;
    for i in 0..4 {
        let byte = |x: u32| if signed { with_sign(x >> (8 * i) & 255, 8) } else { (x >> (8 * i) & 255) as i32 };
        sum += byte(a) * byte(b);
    }
    Ok(Value::Number(if signed { Number::Sint(sum) } else { Number::Uint(sum as u32) }))
}

/// A built-in function of bits.
pub fn call(fun: MathFunction, args: &[Value]) -> Result<Value, Fault> {
    use MathFunction as M;
    let x = &args[0];
    match fun {
        M::CountTrailingZeros => each(x, |x| first_trailing(x).min(32)),
        M::CountLeadingZeros => each(x, |x| if x == 0 { 32 } else { 31 - first_leading(x) }),
        M::CountOneBits => each(x, |x| (0..32).map(|i| x >> i & 1).sum()),
        M::ReverseBits => each(x, |x| (0..32).fold(0, |out, i| out | (x >> i & 1) << (31 - i))),
        M::FirstTrailingBit => each(x, first_trailing),
        M::FirstLeadingBit => x.map(&mut |n| match n {
            Number::Uint(x) => Ok(Number::Uint(first_leading(x))),
            // Of a negative number: the highest bit that differs from the sign.
            Number::Sint(x) => Ok(Number::Sint(first_leading(if x < 0 { !x } else { x } as u32) as i32)),
            _ => broken("`firstLeadingBit` of something that is no integer"),
        }),
        M::ExtractBits => {
            let (offset, count) = (args[1].integer()?, args[2].integer()?);
            x.map(&mut |n| match n {
                Number::Uint(x) => Ok(Number::Uint(extract(x, offset, count, false))),
                Number::Sint(x) => Ok(Number::Sint(extract(x as u32, offset, count, true) as i32)),
                _ => broken("`extractBits` of something that is no integer"),
            })
        }
        M::InsertBits => {
            let (offset, count) = (args[2].integer()?, args[3].integer()?);
            x.zip(&args[1], &mut |x, new| match (x, new) {
                (Number::Uint(x), Number::Uint(new)) => Ok(Number::Uint(insert(x, new, offset, count))),
                (Number::Sint(x), Number::Sint(new)) => Ok(Number::Sint(insert(x as u32, new as u32, offset, count) as i32)),
                _ => broken("`insertBits` with arguments of other types"),
            })
        }
        M::Dot4I8Packed => dot4(args, true),
        M::Dot4U8Packed => dot4(args, false),
        M::Pack4x8snorm => pack(x, 8, normalized(-1.0, 127.0)),
        M::Pack4x8unorm => pack(x, 8, normalized(0.0, 255.0)),
        M::Pack2x16snorm => pack(x, 16, normalized(-1.0, 32767.0)),
        M::Pack2x16unorm => pack(x, 16, normalized(0.0, 65535.0)),
        M::Pack2x16float => pack(x, 16, half),
        M::Pack4xI8 | M::Pack4xU8 => pack(x, 8, |n| Ok(n.bits())),
        M::Pack4xI8Clamp => pack(x, 8, |n| Ok((n.bits() as i32).clamp(-128, 127) as u32)),
        M::Pack4xU8Clamp => pack(x, 8, |n| Ok(n.bits().min(255))),
        M::Unpack4x8snorm => unpack(x, 8, |c| Number::Float((with_sign(c, 8) as f32 / 127.0).max(-1.0))),
        M::Unpack4x8unorm => unpack(x, 8, |c| Number::Float(c as f32 / 255.0)),
        M::Unpack2x16snorm => unpack(x, 16, |c| Number::Float((with_sign(c, 16) as f32 / 32767.0).max(-1.0))),
        M::Unpack2x16unorm => unpack(x, 16, |c| Number::Float(c as f32 / 65535.0)),
        M::Unpack2x16float => unpack(x, 16, |c| Number::Float(f16_value(c))),
        M::Unpack4xI8 => unpack(x, 8, |c| Number::Sint(with_sign(c, 8))),
        M::Unpack4xU8 => unpack(x, 8, Number::Uint),
        other => Err(Fault::Unsupported(format!("the built-in function {other:?}"))),
    }
}
