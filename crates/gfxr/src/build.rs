//! Calls and structures from values, for the writer.

use crate::layout::{Field, Kind, constant, layout};
use crate::value::{Call, Enum, Struct, Value};

impl Call {
    /// A call by its name, with all parameters zero or null and the result zero.
    ///
    /// # Panics
    ///
    /// If Vulkan has no call of this name.
    pub fn new(name: &str) -> Self {
        let of = layout().call_of_name(name).unwrap_or_else(|| panic!("{name} is no call"));
        Call { number: of.number, name: of.name, parameters: zeros(&of.parameters), result: of.result.as_ref().map(zero) }
    }

    /// With a parameter. See [`Struct::with`] for what values can be given.
    ///
    /// # Panics
    ///
    /// If the call has no such parameter, or if the value does not fit it.
    pub fn with(mut self, parameter: &str, value: impl Into<Value>) -> Self {
        let of = layout().call(self.number).expect("the table has it");
        set(self.name, &of.parameters, &mut self.parameters, parameter, value.into());
        self
    }

    /// With a result, a number or the name of a `VkResult`.
    ///
    /// # Panics
    ///
    /// If the call has no result, or if the value does not fit it.
    pub fn returning(mut self, value: impl Into<Value>) -> Self {
        let of = layout().call(self.number).expect("the table has it");
        let fit = of.result.as_ref().and_then(|kind| fit(kind, value.into()));
        self.result = Some(fit.unwrap_or_else(|| panic!("the value does not fit the result of {}", self.name)));
        self
    }
}

impl Struct {
    /// A structure by its name, with all members zero or null and its own `sType`.
    ///
    /// # Panics
    ///
    /// If Vulkan has no structure of this name.
    pub fn new(name: &str) -> Self {
        let of = layout().structure(name).unwrap_or_else(|| panic!("{name} is no structure"));
        let mut members = zeros(&of.fields);
        if let (Some(tag), Some((_, Value::Enum(kind)))) = (of.tag, members.first_mut()) {
            kind.value = tag.cast_signed();
        }
        Struct { name: of.name, members }
    }

    /// With a member. The value is turned into the member's type: numbers into numbers that can hold them, into handles and into
    /// constants; names of constants, with `|` between flags, into their values; one structure into an array of one.
    ///
    /// # Panics
    ///
    /// If the structure has no such member, or if the value does not fit it.
    pub fn with(mut self, member: &str, value: impl Into<Value>) -> Self {
        let of = layout().structure(self.name).expect("the table has it");
        set(self.name, &of.fields, &mut self.members, member, value.into());
        self
    }

    /// With a structure at the end of its chain.
    ///
    /// # Panics
    ///
    /// If this structure has no chain.
    pub fn chain(mut self, next: Struct) -> Self {
        let mut end = &mut self;
        loop {
            let Some(("pNext", link)) = end.members.get_mut(1) else { panic!("{} has no chain", end.name) };
            match link {
                Value::Struct(behind) => end = behind,
                link => {
                    *link = Value::Struct(next);
                    return self;
                }
            }
        }
    }
}

fn zeros(fields: &[Field]) -> Vec<(&'static str, Value)> {
    fields.iter().map(|field| (field.name, zero(&field.kind))).collect()
}

fn zero(kind: &Kind) -> Value {
    match kind {
        Kind::U8 => Value::U8(0),
        Kind::U16 => Value::U16(0),
        Kind::U32 => Value::U32(0),
        Kind::I32 => Value::I32(0),
        Kind::U64 => Value::U64(0),
        Kind::I64 => Value::I64(0),
        Kind::F32 => Value::F32(0.0),
        Kind::F64 => Value::F64(0.0),
        Kind::Handle => Value::Handle(0),
        Kind::Enum(kind) => Value::Enum(Enum { kind, value: 0 }),
        Kind::Struct(place) => Value::Struct(Struct::new(layout().structs[*place].name)),
        // Which member it holds is for who makes the structure to say.
        Kind::Union(_) => Value::Null,
        Kind::Pointer(_) | Kind::Array(_) | Kind::Str | Kind::WideStr | Kind::Next | Kind::Template => Value::Null,
    }
}

fn set(owner: &str, fields: &[Field], members: &mut [(&'static str, Value)], name: &str, value: Value) {
    let place = fields.iter().position(|field| field.name == name);
    let place = place.unwrap_or_else(|| panic!("{owner} has no member {name}"));
    let given = value.kind();
    members[place].1 = fit(&fields[place].kind, value).unwrap_or_else(|| panic!("{owner}::{name} cannot be {given}"));
}

/// The value as the kind wants it. None if it does not fit.
fn fit(kind: &Kind, value: Value) -> Option<Value> {
    Some(match (kind, value) {
        (_, Value::Str(text)) if matches!(kind, Kind::Enum(_) | Kind::U32 | Kind::U64) => {
            let bits = text.split('|').try_fold(0, |bits, name| Some(bits | constant(name.trim())?))?;
            return if *kind == Kind::U64 { Some(Value::U64(bits.cast_unsigned())) } else { fit(kind, Value::I64(bits)) };
        }
        (
            Kind::Pointer(_) | Kind::Array(_) | Kind::Str | Kind::WideStr | Kind::Next | Kind::Template,
            value @ (Value::Null | Value::Omitted(_)),
        ) => value,
        (Kind::Str | Kind::WideStr, value @ Value::Str(_)) => value,
        (Kind::Next | Kind::Template | Kind::Struct(_) | Kind::Union(_), value @ Value::Struct(_)) => value,
        (Kind::Union(_), value) => value,
        (Kind::Array(inner), value @ Value::Bytes(_)) if **inner == Kind::U8 => value,
        (Kind::Array(inner), value @ Value::Words(_)) if **inner == Kind::U32 => value,
        (Kind::Array(inner) | Kind::Pointer(inner), Value::Array(values)) => {
            let values: Vec<_> = values.into_iter().map(|value| fit(inner, value)).collect::<Option<_>>()?;
            match **inner {
                Kind::U8 => {
                    Value::Bytes(values.iter().map(|value| if let Value::U8(byte) = value { *byte } else { 0 }).collect())
                }
                Kind::U32 => {
                    Value::Words(values.iter().map(|value| if let Value::U32(word) = value { *word } else { 0 }).collect())
                }
                _ => Value::Array(values),
            }
        }
        (Kind::Array(_), value @ Value::Struct(_)) => return fit(kind, Value::Array(vec![value])),
        (Kind::Pointer(inner), value) => return fit(inner, value),
        (Kind::F32, value @ Value::F32(_)) | (Kind::F64, value @ Value::F64(_)) => value,
        (Kind::F64, Value::F32(number)) => Value::F64(number.into()),
        (kind, value) => {
            let number = match value {
                Value::U8(number) => number.into(),
                Value::U16(number) => number.into(),
                Value::U32(number) => number.into(),
                Value::I32(number) => number.into(),
                Value::U64(number) | Value::Handle(number) => number.into(),
                Value::I64(number) => number.into(),
                Value::Enum(constant) => constant.value.into(),
                _ => return None,
            };
            let number: i128 = number;
            match kind {
                Kind::U8 => Value::U8(number.try_into().ok()?),
                Kind::U16 => Value::U16(number.try_into().ok()?),
                Kind::U32 => Value::U32(number.try_into().ok()?),
                Kind::I32 => Value::I32(number.try_into().ok()?),
                Kind::U64 => Value::U64(number.try_into().ok()?),
                Kind::I64 => Value::I64(number.try_into().ok()?),
                Kind::Handle => Value::Handle(number.try_into().ok()?),
                Kind::Enum(kind) => Value::Enum(Enum { kind, value: number.try_into().ok()? }),
                _ => return None,
            }
        }
    })
}

/// Values of one kind each.
macro_rules! from {
    ($($of:ty: $value:ident => $into:expr,)+) => {
        $(impl From<$of> for Value {
            fn from($value: $of) -> Value {
                $into
            }
        })+
    };
}

from! {
    u8: value => Value::U8(value),
    u16: value => Value::U16(value),
    u32: value => Value::U32(value),
    i32: value => Value::I32(value),
    u64: value => Value::U64(value),
    usize: value => Value::U64(value as u64),
    i64: value => Value::I64(value),
    f32: value => Value::F32(value),
    f64: value => Value::F64(value),
    bool: value => Value::U32(value.into()),
    Enum: value => Value::Enum(value),
    &str: value => Value::Str(value.to_owned()),
    String: value => Value::Str(value),
    Struct: value => Value::Struct(value),
}

impl<T: Into<Value>> From<Vec<T>> for Value {
    fn from(values: Vec<T>) -> Value {
        Value::Array(values.into_iter().map(Into::into).collect())
    }
}

impl<T: Into<Value>, const N: usize> From<[T; N]> for Value {
    fn from(values: [T; N]) -> Value {
        Value::Array(values.into_iter().map(Into::into).collect())
    }
}
