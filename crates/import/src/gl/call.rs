//! One recorded call, in a form common to all readers.

use std::borrow::Cow;
use std::rc::Rc;

use gl_shader::{IMAGES, UNITS, consts as e};

/// Components of a typed call from the argument `first` on. They are in an array if its name ends in `v`.
pub fn components(call: &Call, shape: Shape, first: usize) -> GlResult<([f64; 4], usize)> {
    let mut values = [0.0, 0.0, 0.0, 1.0];
    let count = shape.count.clamp(1, 4);
    if shape.vector {
        match call.arg(first) {
            Arg::Nums(numbers) => {
                let numbers =
                    numbers.get(..count).ok_or_else(|| Fault::Damaged(format!("an array of fewer than {count} numbers")))?;
                values[..count].copy_from_slice(numbers);
            }
            _ => values[0] = call.f64(first)?,
        }
    } else {
        for k in 0..count {
            values[k] = call.f64(first + k)?;
        }
    }
    Ok((values, count))
}

/// As [`parameters`], of a call whose parameter may be a colour or a place. One that has a single number gives zeros for the others, as
/// Mesa takes it.
pub fn padded(call: &Call, shape: Shape, first: usize) -> GlResult<Vec<f64>> {
    let mut values = parameters(call, first)?;
    if !shape.vector {
        values.resize(4, 0.0);
    }
    Ok(values)
}

/// Parameters of a typed call without a number in its name, from the argument `first` on.
pub fn parameters(call: &Call, first: usize) -> GlResult<Vec<f64>> {
    call.numbers(first).map(|numbers| numbers.into_owned())
}

/// A function that a recording calls.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Function {
    /// Its number in this recording: dense, from 0.
    pub id: u32,
    /// Its name.
    pub name: Rc<str>,
}

/// A value of an argument. Numbers of all types are `f64`, which has every value that OpenGL passes.
#[derive(Clone, Debug, PartialEq)]
pub enum Arg {
    /// A null pointer, or an argument that was not recorded.
    Null,
    /// A number, an enumerant, a bit mask or a truth value.
    Num(f64),
    /// An array of numbers.
    Nums(Rc<[f64]>),
    /// Bytes.
    Blob(Rc<[u8]>),
    /// Text.
    Str(Rc<str>),
    /// An address, or an offset in a buffer object.
    Pointer(u64),
    /// An array of other values, or the members of a structure.
    List(Rc<[Arg]>),
}

/// One call.
#[derive(Clone, Debug)]
pub struct Call {
    /// Its number in the recording, from 0.
    pub number: u64,
    /// Where it begins: a byte of the expanded stream, or a line.
    pub place: u64,
    /// The thread that calls.
    pub thread: u32,
    /// What is called.
    pub function: Rc<Function>,
    /// Its arguments.
    pub args: Vec<Arg>,
    /// Its return value; `Null` if none.
    pub result: Arg,
}

/// Why a call has no effect.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// It raises an OpenGL error: by the standard, the call is ignored.
    Error(&'static str),
    /// The call, or a feature that it uses, is not supported: the name of it.
    Unsupported(String),
    /// An argument is missing or of another kind: the recording is damaged.
    Damaged(String),
    /// It asks for more than a limit allows.
    Limit(String),
}

/// The result of a call.
pub type GlResult<T = ()> = Result<T, Fault>;

/// The error of an invalid value.
pub const INVALID_VALUE: Fault = Fault::Error("GL_INVALID_VALUE");
/// The error of an invalid enumerant.
pub const INVALID_ENUM: Fault = Fault::Error("GL_INVALID_ENUM");
/// The error of a call that is not allowed in this state.
pub const INVALID_OPERATION: Fault = Fault::Error("GL_INVALID_OPERATION");

impl Call {
    /// An argument; `Null` if it was not recorded.
    pub fn arg(&self, index: usize) -> &Arg {
        self.args.get(index).unwrap_or(&Arg::Null)
    }

    fn wrong(&self, index: usize, wanted: &str) -> Fault {
        Fault::Damaged(format!("argument {index} is no {wanted}"))
    }

    /// A number.
    pub fn f64(&self, index: usize) -> GlResult<f64> {
        match self.arg(index) {
            Arg::Num(number) => Ok(*number),
            Arg::Pointer(address) => Ok(*address as f64),
            Arg::Nums(numbers) if numbers.len() == 1 => Ok(numbers[0]),
            // A null pointer in place of an integer.
            Arg::Null if index < self.args.len() => Ok(0.0),
            _ => Err(self.wrong(index, "number")),
        }
    }

    /// A number in single precision.
    pub fn f32(&self, index: usize) -> GlResult<f32> {
        self.f64(index).map(|number| number as f32)
    }

    /// A whole number, or an enumerant; negative ones wrap as in C.
    pub fn u32(&self, index: usize) -> GlResult<u32> {
        self.f64(index).map(|number| number as i64 as u32)
    }

    /// A whole number.
    pub fn i32(&self, index: usize) -> GlResult<i32> {
        self.f64(index).map(|number| number as i64 as i32)
    }

    /// A unit of texture coordinates, from `GL_TEXTURE0` on.
    pub fn unit(&self, index: usize) -> GlResult<usize> {
        self.image_unit(index).and_then(|unit| if unit < UNITS { Ok(unit) } else { Err(INVALID_ENUM) })
    }

    /// A texture unit that programs may read, from `GL_TEXTURE0` on.
    pub fn image_unit(&self, index: usize) -> GlResult<usize> {
        let unit = self.u32(index)?.wrapping_sub(e::TEXTURE0) as usize;
        if unit < IMAGES { Ok(unit) } else { Err(INVALID_ENUM) }
    }

    /// A size: whole and not negative.
    pub fn size(&self, index: usize) -> GlResult<u32> {
        u32::try_from(self.i32(index)?).map_err(|_| INVALID_VALUE)
    }

    /// A truth value.
    pub fn bool(&self, index: usize) -> GlResult<bool> {
        self.f64(index).map(|number| number != 0.0)
    }

    /// An array of numbers; a single number is an array of one.
    pub fn numbers(&self, index: usize) -> GlResult<Cow<'_, [f64]>> {
        match self.arg(index) {
            Arg::Nums(numbers) => Ok(Cow::Borrowed(numbers)),
            Arg::Num(number) => Ok(Cow::Owned(vec![*number])),
            _ => Err(self.wrong(index, "array of numbers")),
        }
    }

    /// The first numbers of an array.
    pub fn array<const N: usize>(&self, index: usize) -> GlResult<[f64; N]> {
        let numbers = self.numbers(index)?;
        let start = numbers.get(..N).ok_or_else(|| Fault::Damaged(format!("argument {index} has fewer than {N} numbers")))?;
        Ok(std::array::from_fn(|k| start[k]))
    }
}

/// The type that the suffix of a function's name states.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// `b`
    Byte,
    /// `s`
    Short,
    /// `i`
    Int,
    /// `f`
    Float,
    /// `d`
    Double,
    /// `ub`
    Ubyte,
    /// `us`
    Ushort,
    /// `ui`
    Uint,
    /// Half precision; only in arrays.
    Half,
    /// Four integers without sign in one word, of 10, 10, 10 and 2 bits from the lowest on; only in arrays.
    Packed,
    /// The same with signs.
    PackedSigned,
}

impl Scalar {
    /// Normalises a component as for colours and normals: integers become [0, 1] or [-1, 1] (OpenGL 1.5, table 2.9).
    pub fn normalized(self, value: f64) -> f32 {
        (match self {
            Scalar::Float | Scalar::Double | Scalar::Half | Scalar::Packed | Scalar::PackedSigned => value,
            Scalar::Ubyte => value / 255.0,
            Scalar::Ushort => value / 65_535.0,
            Scalar::Uint => value / 4_294_967_295.0,
            Scalar::Byte => (2.0 * value + 1.0) / 255.0,
            Scalar::Short => (2.0 * value + 1.0) / 65_535.0,
            Scalar::Int => (2.0 * value + 1.0) / 4_294_967_295.0,
        }) as f32
    }
}

/// The arguments by the suffix of a function's name: `glColor4ubv` has 4 components of type `ub` in an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shape {
    /// Components; 0 where the name has no number.
    pub count: usize,
    /// Their type.
    pub scalar: Scalar,
    /// Whether they are in an array.
    pub vector: bool,
}

/// Suffixes of extension functions, which do the same as the core function.
const EXTENSIONS: &[&str] = &["ARB", "EXT", "SGIS", "NV", "ATI", "APPLE", "MESA"];

/// A name without the prefix `gl` and the suffix of an extension.
pub fn core_name(name: &str) -> Option<&str> {
    let name = name.strip_prefix("gl").filter(|rest| rest.starts_with(|c: char| c.is_ascii_uppercase()))?;
    Some(EXTENSIONS.iter().find_map(|end| name.strip_suffix(end)).unwrap_or(name))
}

/// Splits a name into its stem and the shape of its arguments.
pub fn shape(name: &str) -> Option<(&str, Shape)> {
    let (rest, vector) = name.strip_suffix('v').map_or((name, false), |rest| (rest, true));
    const TYPES: &[(&str, Scalar)] = &[
        ("ub", Scalar::Ubyte),
        ("us", Scalar::Ushort),
        ("ui", Scalar::Uint),
        ("b", Scalar::Byte),
        ("s", Scalar::Short),
        ("i", Scalar::Int),
        ("f", Scalar::Float),
        ("d", Scalar::Double),
    ];
    let (rest, scalar) = TYPES.iter().find_map(|&(end, scalar)| Some((rest.strip_suffix(end)?, scalar)))?;
    let (stem, count) = match rest.strip_suffix(['1', '2', '3', '4']) {
        Some(stem) => (stem, usize::from(rest.as_bytes()[rest.len() - 1] - b'0')),
        None => (rest, 0),
    };
    Some((stem, Shape { count, scalar, vector }))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_parted_into_stem_and_shape() {
        let of = |name| shape(core_name(name).expect("a function of OpenGL"));
        assert_eq!(of("glColor4ubv"), Some(("Color", Shape { count: 4, scalar: Scalar::Ubyte, vector: true })));
        assert_eq!(
            of("glMultiTexCoord2fARB"),
            Some(("MultiTexCoord", Shape { count: 2, scalar: Scalar::Float, vector: false }))
        );
        assert_eq!(of("glLightfv"), Some(("Light", Shape { count: 0, scalar: Scalar::Float, vector: true })));
        assert_eq!(of("glRotated"), Some(("Rotate", Shape { count: 0, scalar: Scalar::Double, vector: false })));
        assert_eq!(core_name("glXSwapBuffers"), Some("XSwapBuffers"));
        assert_eq!(core_name("wglSwapBuffers"), None);
    }

    #[test]
    fn integers_are_normalised_as_colours_are() {
        assert_eq!(Scalar::Ubyte.normalized(255.0), 1.0);
        assert_eq!(Scalar::Byte.normalized(-128.0), -1.0);
        assert_eq!(Scalar::Byte.normalized(127.0), 1.0);
        assert_eq!(Scalar::Int.normalized(2_147_483_647.0), 1.0);
        assert_eq!(Scalar::Float.normalized(3.0), 3.0);
    }
}
