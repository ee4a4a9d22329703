//! The parameters of a call and the members of a structure, by name. A value of another kind than expected is a damaged capture.

use std::borrow::Cow;

use gfxr::{Call, Struct, Value};

use super::fault::{Fault, Outcome};

/// The parameters of a call, or the members of a structure.
#[derive(Clone, Copy)]
pub struct Args<'a> {
    /// The call or the structure.
    pub owner: &'static str,
    members: &'a [(&'static str, Value)],
}

impl<'a> From<&'a Call> for Args<'a> {
    fn from(call: &'a Call) -> Args<'a> {
        Args { owner: call.name, members: &call.parameters }
    }
}

impl<'a> From<&'a Struct> for Args<'a> {
    fn from(of: &'a Struct) -> Args<'a> {
        Args { owner: of.name, members: &of.members }
    }
}

/// A number, a flag, a constant or a handle.
fn number(value: &Value) -> Option<u64> {
    Some(match value {
        Value::U8(number) => (*number).into(),
        Value::U16(number) => (*number).into(),
        Value::U32(number) => (*number).into(),
        Value::I32(number) => *number as u64,
        Value::U64(number) | Value::Handle(number) => *number,
        Value::I64(number) => *number as u64,
        Value::Enum(constant) => constant.value as u64,
        _ => return None,
    })
}

impl<'a> Args<'a> {
    fn value(&self, name: &str) -> Outcome<&'a Value> {
        let found = self.members.iter().find(|(member, _)| *member == name);
        found.map(|(_, value)| value).ok_or_else(|| Fault::Damaged(format!("{} has no {name}", self.owner)))
    }

    fn wrong(&self, name: &str, wanted: &str) -> Fault {
        Fault::Damaged(format!("{}: {name} is not {wanted}", self.owner))
    }

    /// A number, a flag, a constant or a handle. Of an output parameter that the call did not write: an error.
    pub fn u64(&self, name: &str) -> Outcome<u64> {
        number(self.value(name)?).ok_or_else(|| self.wrong(name, "a number"))
    }

    /// As [`Args::u64`], in 32 bits.
    pub fn u32(&self, name: &str) -> Outcome<u32> {
        Ok(self.u64(name)? as u32)
    }

    /// A signed number of 32 bits.
    pub fn i32(&self, name: &str) -> Outcome<i32> {
        Ok(self.u64(name)? as i32)
    }

    /// A truth value.
    pub fn flag(&self, name: &str) -> Outcome<bool> {
        Ok(self.u64(name)? != 0)
    }

    /// A number of single precision.
    pub fn f32(&self, name: &str) -> Outcome<f32> {
        match self.value(name)? {
            Value::F32(number) => Ok(*number),
            _ => Err(self.wrong(name, "a floating-point number")),
        }
    }

    /// A string; empty where it is null.
    pub fn text(&self, name: &str) -> Outcome<&'a str> {
        match self.value(name)? {
            Value::Str(text) => Ok(text),
            Value::Null | Value::Omitted(_) => Ok(""),
            _ => Err(self.wrong(name, "a string")),
        }
    }

    /// Whether a pointer has contents.
    pub fn is_some(&self, name: &str) -> Outcome<bool> {
        Ok(!matches!(self.value(name)?, Value::Null | Value::Omitted(_)))
    }

    /// A structure that may be missing.
    pub fn maybe(&self, name: &str) -> Outcome<Option<Args<'a>>> {
        match self.value(name)? {
            Value::Struct(of) => Ok(Some(of.into())),
            Value::Null | Value::Omitted(_) => Ok(None),
            Value::Array(elements) if elements.is_empty() => Ok(None),
            Value::Array(elements) => match &elements[0] {
                Value::Struct(of) => Ok(Some(of.into())),
                _ => Err(self.wrong(name, "a structure")),
            },
            _ => Err(self.wrong(name, "a structure")),
        }
    }

    /// A structure.
    pub fn of(&self, name: &str) -> Outcome<Args<'a>> {
        self.maybe(name)?.ok_or_else(|| self.wrong(name, "there"))
    }

    /// The structures of an array; none where it is null.
    pub fn list(&self, name: &str) -> Outcome<Vec<Args<'a>>> {
        let of = |value: &'a Value| match value {
            Value::Struct(of) => Ok(Args::from(of)),
            _ => Err(self.wrong(name, "an array of structures")),
        };
        match self.value(name)? {
            Value::Null | Value::Omitted(_) => Ok(Vec::new()),
            Value::Array(elements) => elements.iter().map(of).collect(),
            single => Ok(vec![of(single)?]),
        }
    }

    /// The numbers or handles of an array; none where it is null.
    pub fn numbers(&self, name: &str) -> Outcome<Vec<u64>> {
        let wrong = || self.wrong(name, "an array of numbers");
        match self.value(name)? {
            Value::Null | Value::Omitted(_) => Ok(Vec::new()),
            Value::Array(elements) => elements.iter().map(|value| number(value).ok_or_else(wrong)).collect(),
            Value::Words(words) => Ok(words.iter().map(|&word| word.into()).collect()),
            Value::Bytes(bytes) => Ok(bytes.iter().map(|&byte| byte.into()).collect()),
            single => Ok(vec![number(single).ok_or_else(wrong)?]),
        }
    }

    /// The numbers of an array of single precision.
    pub fn floats(&self, name: &str) -> Outcome<Vec<f32>> {
        let of = |value: &Value| match value {
            Value::F32(number) => Ok(*number),
            _ => Err(self.wrong(name, "an array of floating-point numbers")),
        };
        match self.value(name)? {
            Value::Null | Value::Omitted(_) => Ok(Vec::new()),
            Value::Array(elements) => elements.iter().map(of).collect(),
            single => Ok(vec![of(single)?]),
        }
    }

    /// The bytes of an array; none where it is null.
    pub fn bytes(&self, name: &str) -> Outcome<Cow<'a, [u8]>> {
        match self.value(name)? {
            Value::Bytes(bytes) => Ok(Cow::Borrowed(bytes)),
            Value::Words(words) => Ok(words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>().into()),
            Value::Null | Value::Omitted(_) => Ok(Cow::Borrowed(&[])),
            _ => Err(self.wrong(name, "an array of bytes")),
        }
    }

    /// The words of an array; none where it is null.
    pub fn words(&self, name: &str) -> Outcome<Cow<'a, [u32]>> {
        match self.value(name)? {
            Value::Words(words) => Ok(Cow::Borrowed(words)),
            _ => Ok(self.numbers(name)?.into_iter().map(|number| number as u32).collect::<Vec<u32>>().into()),
        }
    }

    /// The words of the values of an array of clear values.
    pub fn clear_values(&self, name: &str) -> Outcome<Vec<&'a [u32]>> {
        let of = |value: &'a Value| match value {
            Value::Words(words) => Ok(words.as_slice()),
            _ => Err(self.wrong(name, "an array of clear values")),
        };
        match self.value(name)? {
            Value::Null | Value::Omitted(_) => Ok(Vec::new()),
            Value::Array(elements) => elements.iter().map(of).collect(),
            single => Ok(vec![of(single)?]),
        }
    }

    /// The structure of a type in the chain behind this structure.
    pub fn chained(&self, kind: &str) -> Option<Args<'a>> {
        let mut here = *self;
        while let Some((_, Value::Struct(next))) = here.members.iter().find(|(name, _)| *name == "pNext") {
            if next.name == kind || next.name.strip_prefix(kind).is_some_and(|rest| matches!(rest, "KHR" | "EXT")) {
                return Some(next.into());
            }
            here = next.into();
        }
        None
    }

    /// Two numbers of a structure within, such as an extent.
    pub fn pair(&self, name: &str, members: [&str; 2]) -> Outcome<[u32; 2]> {
        let of = self.of(name)?;
        Ok([of.u32(members[0])?, of.u32(members[1])?])
    }

    /// Three numbers of a structure within, such as an offset.
    pub fn triple(&self, name: &str, members: [&str; 3]) -> Outcome<[u32; 3]> {
        let of = self.of(name)?;
        Ok([of.u32(members[0])?, of.u32(members[1])?, of.u32(members[2])?])
    }
}

/// Members of `VkExtent3D`.
pub const EXTENT: [&str; 3] = ["width", "height", "depth"];
/// Members of `VkOffset3D`.
pub const OFFSET: [&str; 3] = ["x", "y", "z"];
