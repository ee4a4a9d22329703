//! Values of parameters and members, and access to them by name.

use crate::layout::constant_name;
use std::fmt;
use std::ops::Deref;

/// A value of a parameter, a member, an element of an array, or a result.
///
/// Numbers compare by their bits, so that a NaN equals itself.
#[derive(Clone, Debug)]
pub enum Value {
    /// A null pointer, or the end of a chain.
    Null,
    /// A pointer to something that the recorder did not keep, with the number of elements. Output parameters of a call that failed and
    /// arrays that Vulkan ignores are stored like this.
    Omitted(u64),
    /// 8 bits.
    U8(u8),
    /// 16 bits.
    U16(u16),
    /// 32 bits without a sign: also truth values and flags.
    U32(u32),
    /// 32 bits with a sign.
    I32(i32),
    /// 64 bits without a sign: also sizes, addresses and flags of 64 bits.
    U64(u64),
    /// 64 bits with a sign.
    I64(i64),
    /// A number of single precision.
    F32(f32),
    /// A number of double precision.
    F64(f64),
    /// An object, by its number in the capture. Zero is the null handle.
    Handle(u64),
    /// A constant.
    Enum(Enum),
    /// An array of bytes.
    Bytes(Vec<u8>),
    /// An array of 32-bit numbers without a sign, such as a SPIR-V module or the components of a clear colour.
    Words(Vec<u32>),
    /// A string. What is no UTF-8 was replaced.
    Str(String),
    /// An array of anything else. An array that is declared as such and stored as a single value has one element.
    Array(Vec<Value>),
    /// A structure, by value or behind a pointer.
    Struct(Struct),
}

/// A constant of an enumeration.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Enum {
    /// The type, such as `VkFormat`.
    pub kind: &'static str,
    /// The value.
    pub value: i32,
}

impl Enum {
    /// The name of the constant. None if the table has no constant of this value.
    pub fn name(&self) -> Option<&'static str> {
        constant_name(self.kind, self.value.into())
    }
}

impl fmt::Display for Enum {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.name() {
            Some(name) => f.write_str(name),
            None => write!(f, "{} {}", self.kind, self.value),
        }
    }
}

/// A structure.
#[derive(Clone, Debug, PartialEq)]
pub struct Struct {
    /// The name of its type.
    pub name: &'static str,
    /// The members in their order.
    pub members: Vec<(&'static str, Value)>,
}

impl Struct {
    /// A member.
    ///
    /// # Panics
    ///
    /// If the structure has no such member: its members are known from its name, whatever a capture holds.
    pub fn get(&self, name: &str) -> Member<'_> {
        member(self.name, &self.members, name)
    }

    /// The structures of the chain behind this one, without this one.
    pub fn next(&self) -> Chain<'_> {
        Chain { next: self.behind() }
    }

    /// The structure of a name in the chain behind this one.
    pub fn chained(&self, name: &str) -> Option<&Struct> {
        self.next().find(|next| next.name == name)
    }

    fn behind(&self) -> Option<&Struct> {
        match self.members.get(1) {
            Some(("pNext", Value::Struct(next))) => Some(next),
            _ => None,
        }
    }
}

/// The structures of a chain.
#[derive(Clone, Debug)]
pub struct Chain<'a> {
    next: Option<&'a Struct>,
}

impl<'a> Iterator for Chain<'a> {
    type Item = &'a Struct;

    fn next(&mut self) -> Option<&'a Struct> {
        let here = self.next?;
        self.next = here.behind();
        Some(here)
    }
}

/// A call of Vulkan.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// Its number in a capture, with the family in the upper half.
    pub number: u32,
    /// Its name.
    pub name: &'static str,
    /// The parameters in the order of their declaration, with what the call wrote to them.
    pub parameters: Vec<(&'static str, Value)>,
    /// The result. None for `void`.
    pub result: Option<Value>,
}

impl Call {
    /// A parameter.
    ///
    /// # Panics
    ///
    /// If the call has no such parameter: its parameters are known from its name, whatever a capture holds.
    pub fn get(&self, name: &str) -> Member<'_> {
        member(self.name, &self.parameters, name)
    }

    /// True if the call returned a `VkResult` below zero.
    pub fn failed(&self) -> bool {
        matches!(self.result, Some(Value::Enum(Enum { value: ..0, .. })))
    }
}

fn member<'a>(owner: &'static str, members: &'a [(&'static str, Value)], name: &str) -> Member<'a> {
    let found = members.iter().find(|(member, _)| *member == name);
    let (name, value) = found.unwrap_or_else(|| panic!("{owner} has no member {name}"));
    Member { owner, name, value }
}

/// A value with the name that messages give it. It stands for the [`Value`].
#[derive(Clone, Copy, Debug)]
pub struct Member<'a> {
    /// The call or the structure that has it.
    pub owner: &'static str,
    /// The parameter or the member.
    pub name: &'static str,
    value: &'a Value,
}

impl Deref for Member<'_> {
    type Target = Value;

    fn deref(&self) -> &Value {
        self.value
    }
}

/// A value is of another kind than what was asked for.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{place}{found} where {wanted} is expected")]
pub struct ValueError {
    /// The call or structure with the parameter or member, such as `VkSubmitInfo::pNext: `, or nothing.
    pub place: String,
    /// The kind that was asked for.
    pub wanted: &'static str,
    /// The kind of the value.
    pub found: &'static str,
}

/// Elements of an array that are shown.
const SHOWN: usize = 16;

fn list<T: fmt::Display>(f: &mut fmt::Formatter<'_>, values: impl ExactSizeIterator<Item = T>) -> fmt::Result {
    let count = values.len();
    f.write_str("[")?;
    for (index, value) in values.take(SHOWN).enumerate() {
        let comma = if index > 0 { ", " } else { "" };
        write!(f, "{comma}{value}")?;
    }
    if count > SHOWN {
        write!(f, ", {} more", count - SHOWN)?;
    }
    f.write_str("]")
}

/// Short: long arrays are cut, bytes are counted, and handles are numbers behind `#`.
impl fmt::Display for Value {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Value::Null => f.write_str("null"),
            Value::Omitted(count) => write!(f, "<{count} left out>"),
            Value::U8(value) => write!(f, "{value}"),
            Value::U16(value) => write!(f, "{value}"),
            Value::U32(value) => write!(f, "{value}"),
            Value::I32(value) => write!(f, "{value}"),
            Value::U64(value) => write!(f, "{value}"),
            Value::I64(value) => write!(f, "{value}"),
            Value::F32(value) => write!(f, "{value:?}"),
            Value::F64(value) => write!(f, "{value:?}"),
            Value::Handle(value) => write!(f, "#{value}"),
            Value::Enum(value) => write!(f, "{value}"),
            Value::Bytes(bytes) => write!(f, "<{} bytes>", bytes.len()),
            Value::Words(words) if words.len() > SHOWN => write!(f, "<{} words>", words.len()),
            Value::Words(words) => list(f, words.iter()),
            Value::Str(text) => write!(f, "{text:?}"),
            Value::Array(values) => list(f, values.iter()),
            Value::Struct(structure) => write!(f, "{structure}"),
        }
    }
}

/// The members without `sType`, and the structures of the chain behind it.
impl fmt::Display for Struct {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let members = |f: &mut fmt::Formatter<'_>, structure: &Struct| {
            let shown = structure.members.iter().filter(|(name, _)| !matches!(*name, "sType" | "pNext"));
            write!(f, "{} {{", structure.name)?;
            for (index, (name, value)) in shown.enumerate() {
                let comma = if index > 0 { ", " } else { "" };
                write!(f, "{comma}{name}: {value}")?;
            }
            f.write_str("}")
        };
        members(f, self)?;
        for next in self.next() {
            f.write_str(" + ")?;
            members(f, next)?;
        }
        Ok(())
    }
}

impl fmt::Display for Call {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}(", self.name)?;
        for (index, (name, value)) in self.parameters.iter().enumerate() {
            let comma = if index > 0 { ", " } else { "" };
            write!(f, "{comma}{name}: {value}")?;
        }
        f.write_str(")")?;
        match &self.result {
            Some(result) => write!(f, " -> {result}"),
            None => Ok(()),
        }
    }
}

/// Accessors, once for a value and once for a member, whose errors have its name.
macro_rules! accessors {
    ($life:lifetime $($(#[$doc:meta])* $name:ident -> $of:ty, $wanted:literal: $($pattern:pat => $result:expr),+;)+) => {
        /// Access by kind. It is an error if the value is of another kind.
        impl Value {
            $($(#[$doc])* pub fn $name<$life>(&$life self) -> Result<$of, ValueError> {
                let found: Option<$of> = match self { $($pattern => $result,)+ _ => None };
                found.ok_or(ValueError { place: String::new(), wanted: $wanted, found: self.kind() })
            })+
        }

        /// Access by kind. It is an error with the name of the member if the value is of another kind.
        impl<$life> Member<$life> {
            $($(#[$doc])* pub fn $name(&self) -> Result<$of, ValueError> {
                self.value.$name().map_err(|error| ValueError { place: format!("{}::{}: ", self.owner, self.name), ..error })
            })+
        }
    };
}

accessors! { 'a
    /// A number without a sign that fits into 32 bits, or a constant that is not negative.
    u32 -> u32, "a number of 32 bits":
        Value::U8(value) => Some((*value).into()), Value::U16(value) => Some((*value).into()), Value::U32(value) => Some(*value),
        Value::U64(value) => (*value).try_into().ok(), Value::I32(value) => (*value).try_into().ok(),
        Value::Enum(value) => value.value.try_into().ok();
    /// A number with a sign that fits into 32 bits, or a constant.
    i32 -> i32, "a number of 32 bits with a sign":
        Value::U8(value) => Some((*value).into()), Value::U16(value) => Some((*value).into()), Value::U32(value) => (*value).try_into().ok(),
        Value::I32(value) => Some(*value), Value::I64(value) => (*value).try_into().ok(), Value::Enum(value) => Some(value.value);
    /// A number without a sign.
    u64 -> u64, "a number of 64 bits":
        Value::U8(value) => Some((*value).into()), Value::U16(value) => Some((*value).into()), Value::U32(value) => Some((*value).into()),
        Value::U64(value) => Some(*value), Value::I64(value) => (*value).try_into().ok();
    /// A number of single precision.
    f32 -> f32, "a number of single precision": Value::F32(value) => Some(*value);
    /// A number of double or single precision.
    f64 -> f64, "a number of double precision": Value::F64(value) => Some(*value), Value::F32(value) => Some((*value).into());
    /// A truth value of 32 bits.
    bool -> bool, "a truth value": Value::U32(value) => Some(*value != 0);
    /// The number of an object, zero for none.
    handle -> u64, "a handle": Value::Handle(value) => Some(*value);
    /// A constant.
    constant -> Enum, "a constant": Value::Enum(value) => Some(*value);
    /// Bytes.
    bytes -> &'a [u8], "an array of bytes": Value::Bytes(bytes) => Some(bytes);
    /// Words of 32 bits.
    words -> &'a [u32], "an array of words": Value::Words(words) => Some(words);
    /// A string.
    string -> &'a str, "a string": Value::Str(text) => Some(text);
    /// An array of anything but bytes and words. Null is empty.
    array -> &'a [Value], "an array": Value::Array(values) => Some(values), Value::Null => Some(&[]);
    /// A structure. An array of a single one counts as it.
    structure -> &'a Struct, "a structure":
        Value::Struct(structure) => Some(structure),
        Value::Array(values) => match &values[..] { [Value::Struct(structure)] => Some(structure), _ => None };
    /// The structures of an array. Null is empty.
    structures -> Vec<&'a Struct>, "an array of structures":
        Value::Array(values) => values.iter().map(|value| value.structure().ok()).collect(),
        Value::Struct(structure) => Some(vec![structure]), Value::Null => Some(Vec::new());
    /// The handles of an array. Null is empty.
    handles -> Vec<u64>, "an array of handles":
        Value::Array(values) => values.iter().map(|value| value.handle().ok()).collect(), Value::Null => Some(Vec::new());
    /// The 64-bit numbers of an array. Null is empty.
    u64s -> Vec<u64>, "an array of numbers of 64 bits":
        Value::Array(values) => values.iter().map(|value| value.u64().ok()).collect(), Value::Null => Some(Vec::new());
    /// The numbers of single precision of an array. Null is empty.
    f32s -> Vec<f32>, "an array of numbers of single precision":
        Value::Array(values) => values.iter().map(|value| value.f32().ok()).collect(), Value::Null => Some(Vec::new());
    /// The strings of an array. Null is empty.
    strings -> Vec<&'a str>, "an array of strings":
        Value::Array(values) => values.iter().map(|value| value.string().ok()).collect(), Value::Null => Some(Vec::new());
}

impl<'a> Member<'a> {
    /// The value, for as long as what it is a member of.
    pub fn value(&self) -> &'a Value {
        self.value
    }
}

impl Value {
    /// True for a null pointer.
    pub fn is_null(&self) -> bool {
        matches!(self, Value::Null)
    }

    /// The structure behind a pointer that may be null. Null and what the recorder did not keep are none.
    pub fn optional(&self) -> Option<&Struct> {
        self.structure().ok()
    }

    /// The kind of value, for messages.
    pub fn kind(&self) -> &'static str {
        match self {
            Value::Null => "a null pointer",
            Value::Omitted(_) => "an address without content",
            Value::U8(_) | Value::U16(_) | Value::U32(_) | Value::U64(_) => "a number without a sign",
            Value::I32(_) | Value::I64(_) => "a number with a sign",
            Value::F32(_) | Value::F64(_) => "a floating-point number",
            Value::Handle(_) => "a handle",
            Value::Enum(_) => "a constant",
            Value::Bytes(_) => "an array of bytes",
            Value::Words(_) => "an array of words",
            Value::Str(_) => "a string",
            Value::Array(_) => "an array",
            Value::Struct(_) => "a structure",
        }
    }
}

impl PartialEq for Value {
    fn eq(&self, other: &Value) -> bool {
        match (self, other) {
            (Value::Null, Value::Null) => true,
            (Value::Omitted(a), Value::Omitted(b)) => a == b,
            (Value::U8(a), Value::U8(b)) => a == b,
            (Value::U16(a), Value::U16(b)) => a == b,
            (Value::U32(a), Value::U32(b)) => a == b,
            (Value::I32(a), Value::I32(b)) => a == b,
            (Value::U64(a), Value::U64(b)) | (Value::Handle(a), Value::Handle(b)) => a == b,
            (Value::I64(a), Value::I64(b)) => a == b,
            (Value::F32(a), Value::F32(b)) => a.to_bits() == b.to_bits(),
            (Value::F64(a), Value::F64(b)) => a.to_bits() == b.to_bits(),
            (Value::Enum(a), Value::Enum(b)) => a == b,
            (Value::Bytes(a), Value::Bytes(b)) => a == b,
            (Value::Words(a), Value::Words(b)) => a == b,
            (Value::Str(a), Value::Str(b)) => a == b,
            (Value::Array(a), Value::Array(b)) => a == b,
            (Value::Struct(a), Value::Struct(b)) => a == b,
            _ => false,
        }
    }
}
