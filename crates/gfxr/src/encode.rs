//! Bytes of a call from its values: the opposite of [`crate::decode`].

use crate::decode::{
    ACCELERATION_STRUCTURE, CHAIN, INLINE_UNIFORM_BLOCK, NESTED, TEMPLATE, attribute::*, geometry, motion, template_groups,
};
use crate::error::{Cause, Fault};
use crate::layout::{CallLayout, Field, Kind, StructLayout, layout};
use crate::value::{Call, Struct, Value};

/// The address of everything in the recorded process. A reader skips it.
const SOME_ADDRESS: u64 = 0x1000;

/// The bytes of the parameters and the result of a call.
pub(crate) fn call(of: &CallLayout, call: &Call) -> Result<Vec<u8>, Fault> {
    let mut bytes = Bytes { bytes: Vec::new(), nested: 0, depth: 0 };
    bytes.fields(of.name, &of.parameters, &call.parameters)?;
    match (&of.result, &call.result) {
        (None, None) => {}
        (Some(kind), Some(value)) => bytes.value(kind, value).map_err(|fault| fault.member("the result"))?,
        (None, Some(_)) => return Err(Cause::Value(format!("{} has no result", of.name)).into()),
        (Some(_), None) => return Err(Cause::Value(format!("{} has a result", of.name)).into()),
    }
    Ok(bytes.bytes)
}

struct Bytes {
    bytes: Vec<u8>,
    /// Structures around the next value, without and with the links of chains.
    nested: usize,
    depth: usize,
}

impl Bytes {
    fn put(&mut self, bytes: &[u8]) {
        self.bytes.extend_from_slice(bytes);
    }

    /// An attribute word, and the address and the length that it announces.
    fn attributes(&mut self, attributes: u32, length: Option<u64>) {
        self.put(&attributes.to_le_bytes());
        if attributes & ADDRESS != 0 {
            self.put(&SOME_ADDRESS.to_le_bytes());
        }
        if let Some(length) = length {
            self.put(&length.to_le_bytes());
        }
    }

    fn fields(&mut self, owner: &'static str, of: &[Field], values: &[(&'static str, Value)]) -> Result<(), Fault> {
        if of.len() != values.len() {
            return Err(Cause::Value(format!("{owner} has {} members, not {}", of.len(), values.len())).into());
        }
        for (field, (name, value)) in of.iter().zip(values) {
            if field.name != *name {
                return Err(Cause::Value(format!("{owner} has {} where {name} stands", field.name)).into());
            }
            let put = match &field.kind {
                Kind::Union(union) => self.union(union, values, value),
                kind => self.value(kind, value),
            };
            put.map_err(|fault| fault.member(field.name))?;
        }
        Ok(())
    }

    fn union(&mut self, union: &'static str, all: &[(&'static str, Value)], value: &Value) -> Result<(), Fault> {
        let selector = |name: &str| all.iter().find_map(|(member, value)| (*member == name).then(|| value.i32().ok())?);
        let structure = match union {
            "VkPerformanceValueDataINTEL" if selector("type") == Some(4) => return self.value(&Kind::Str, value),
            "VkPerformanceValueDataINTEL" => return self.value(&Kind::U64, value),
            "VkAccelerationStructureGeometryDataKHR" => selector("geometryType").and_then(geometry),
            "VkAccelerationStructureMotionInstanceDataNV" => selector("type").and_then(motion),
            _ => None,
        };
        self.structure(structure.and_then(|name| layout().structure(name)).ok_or(Cause::Union(union))?, value)
    }

    fn structure(&mut self, of: &StructLayout, value: &Value) -> Result<(), Fault> {
        let Value::Struct(Struct { name, members }) = value else { return Err(misfit(of.name, value)) };
        if *name != of.name {
            return Err(Cause::Value(format!("{name} where {} is declared", of.name)).into());
        }
        if self.nested == NESTED {
            return Err(Cause::Depth(NESTED).into());
        }
        self.nested += 1;
        self.depth += 1;
        self.fields(of.name, &of.fields, members)?;
        self.nested -= 1;
        self.depth -= 1;
        Ok(())
    }

    /// A chain. The rest of a structure stands after the whole chain behind it.
    fn chain(&mut self, mut value: &Value) -> Result<(), Fault> {
        let mut open = Vec::new();
        let depth = self.depth;
        while let Value::Struct(next) = value {
            let fault = |cause: Cause| Fault::from(cause).index(open.len());
            let of = layout().structure(next.name).filter(|of| of.tag.is_some());
            let of = of.ok_or_else(|| fault(Cause::Value(format!("{} cannot stand in a chain", next.name))))?;
            let [(_, Value::Enum(tag)), (_, behind), rest @ ..] = &next.members[..] else {
                return Err(fault(Cause::Value(format!("{} has no sType and pNext", next.name))));
            };
            if Some(tag.value.cast_unsigned()) != of.tag {
                return Err(fault(Cause::Value(format!("the sType of {} is another", next.name))));
            }
            if self.depth >= CHAIN {
                return Err(fault(Cause::Depth(CHAIN)));
            }
            self.depth += 1;
            self.attributes(ADDRESS | DATA | SINGLE | STRUCT, None);
            self.put(&tag.value.to_le_bytes());
            open.push((of, rest));
            value = behind;
        }
        match value {
            Value::Null => self.attributes(NULL | SINGLE | STRUCT, None),
            Value::Omitted(1) => self.attributes(ADDRESS | SINGLE | STRUCT, None),
            other => return Err(misfit("a structure", other)),
        }
        while let Some((of, rest)) = open.pop() {
            self.fields(of.name, &of.fields[2..], rest).map_err(|fault| fault.index(open.len()))?;
        }
        self.depth = depth;
        Ok(())
    }

    fn value(&mut self, kind: &Kind, value: &Value) -> Result<(), Fault> {
        match (kind, value) {
            (Kind::U8, Value::U8(number)) => self.put(&number.to_le_bytes()),
            (Kind::U16, Value::U16(number)) => self.put(&number.to_le_bytes()),
            (Kind::U32, Value::U32(number)) => self.put(&number.to_le_bytes()),
            (Kind::I32, Value::I32(number)) => self.put(&number.to_le_bytes()),
            (Kind::U64, Value::U64(number)) | (Kind::Handle, Value::Handle(number)) => self.put(&number.to_le_bytes()),
            (Kind::I64, Value::I64(number)) => self.put(&number.to_le_bytes()),
            (Kind::F32, Value::F32(number)) => self.put(&number.to_le_bytes()),
            (Kind::F64, Value::F64(number)) => self.put(&number.to_le_bytes()),
            (Kind::Enum(_), Value::Enum(constant)) => self.put(&constant.value.to_le_bytes()),
            (Kind::Struct(place), value) => return self.structure(&layout().structs[*place], value),
            (Kind::Union(union), _) => return Err(Cause::Union(union).into()),
            (Kind::Pointer(inner), value) => return self.pointer(inner, false, value),
            (Kind::Array(inner), value) => return self.pointer(inner, true, value),
            (Kind::Str | Kind::WideStr, value) => return self.pointer(kind, false, value),
            (Kind::Next, value) => return self.chain(value),
            (Kind::Template, value) => return self.template(value),
            (kind, value) => return Err(misfit(kind.name(), value)),
        }
        Ok(())
    }

    /// A pointer with its content. `inner` is the type of an element. `array` is true if several are declared.
    fn pointer(&mut self, inner: &Kind, array: bool, value: &Value) -> Result<(), Fault> {
        let of = match inner {
            Kind::Struct(_) => STRUCT,
            Kind::Str => STRING,
            Kind::WideStr => WIDE,
            _ => 0,
        };
        let text = matches!(inner, Kind::Str | Kind::WideStr);
        let several = of | if matches!(inner, Kind::Array(_)) { ARRAY_2D } else { ARRAY };
        let single = of | SINGLE;
        match (inner, value) {
            (_, Value::Null) => self.attributes(NULL | if array { several } else { single }, None),
            (_, Value::Omitted(count)) if array => self.attributes(ADDRESS | several, Some(*count)),
            (_, Value::Omitted(count)) if text => self.attributes(ADDRESS | single, Some(*count)),
            (_, Value::Omitted(1)) => self.attributes(ADDRESS | single, None),
            (_, Value::Omitted(count)) => self.attributes(ADDRESS | several, Some(*count)),
            (Kind::Str, Value::Str(text)) if !array => {
                self.attributes(ADDRESS | DATA | single, Some(text.len() as u64));
                self.put(text.as_bytes());
            }
            (Kind::WideStr, Value::Str(text)) if !array => {
                self.attributes(ADDRESS | DATA | single, Some(text.encode_utf16().count() as u64));
                text.encode_utf16().for_each(|unit| self.put(&unit.to_le_bytes()));
            }
            (Kind::U8, Value::Bytes(bytes)) => {
                self.attributes(ADDRESS | DATA | several, Some(bytes.len() as u64));
                self.put(bytes);
            }
            (Kind::U32, Value::Words(words)) => {
                self.attributes(ADDRESS | DATA | several, Some(words.len() as u64));
                words.iter().for_each(|word| self.put(&word.to_le_bytes()));
            }
            (Kind::U8 | Kind::U32, _) if array => return Err(misfit(inner.name(), value)),
            (_, Value::Array(values)) if array || !text => {
                self.attributes(ADDRESS | DATA | several, Some(values.len() as u64));
                for (index, value) in values.iter().enumerate() {
                    self.value(inner, value).map_err(|fault| fault.index(index))?;
                }
            }
            _ if array || text => return Err(misfit("an array", value)),
            (inner, value) => {
                self.attributes(ADDRESS | DATA | single, None);
                self.value(inner, value)?;
            }
        }
        Ok(())
    }

    fn template(&mut self, value: &Value) -> Result<(), Fault> {
        let data = match value {
            Value::Null => {
                self.attributes(NULL | SINGLE | STRUCT, None);
                return Ok(());
            }
            Value::Omitted(count) => {
                self.attributes(ADDRESS | ARRAY | STRUCT, Some(*count));
                return Ok(());
            }
            Value::Struct(data) if data.name == TEMPLATE && data.members.len() == 5 => data,
            other => return Err(misfit(TEMPLATE, other)),
        };
        self.attributes(ADDRESS | DATA | SINGLE | STRUCT, None);
        let list = |place: usize| data.members[place].1.array().map_err(|error| Cause::Value(error.to_string()));
        for place in 0..3 {
            self.put(&(list(place)?.len() as u64).to_le_bytes());
        }
        for (place, (name, of)) in template_groups().into_iter().enumerate() {
            for (index, value) in list(place)?.iter().enumerate() {
                let put = match of {
                    Some(of) => self.structure(of, value),
                    None => self.value(&Kind::Handle, value),
                };
                put.map_err(|fault| fault.index(index).member(name))?;
            }
        }
        let structures = list(3)?;
        if !structures.is_empty() {
            self.put(&(structures.len() as u64).to_le_bytes());
            self.put(&ACCELERATION_STRUCTURE.to_le_bytes());
            for value in structures {
                self.value(&Kind::Handle, value)?;
            }
        }
        let block = data.members[4].1.bytes().map_err(|error| Cause::Value(error.to_string()))?;
        if !block.is_empty() {
            self.put(&(block.len() as u64).to_le_bytes());
            self.put(&INLINE_UNIFORM_BLOCK.to_le_bytes());
            self.put(block);
        }
        Ok(())
    }
}

fn misfit(declared: &str, value: &Value) -> Fault {
    Cause::Value(format!("{} where {declared} is declared", value.kind())).into()
}
