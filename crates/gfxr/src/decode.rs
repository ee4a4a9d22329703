//! Values of a call from its bytes, by the table and the attribute words.

use crate::error::{Cause, Fault};
use crate::layout::{CallLayout, Field, Kind, StructLayout, layout};
use crate::value::{Call, Enum, Struct, Value};

/// Bits of an attribute word.
pub(crate) mod attribute {
    pub const NULL: u32 = 1;
    pub const SINGLE: u32 = 2;
    pub const ARRAY: u32 = 4;
    pub const STRING: u32 = 8;
    pub const WIDE: u32 = 16;
    pub const STRUCT: u32 = 32;
    pub const ADDRESS: u32 = 64;
    pub const DATA: u32 = 128;
    pub const ARRAY_2D: u32 = 256;
}
use attribute::*;

/// The most structures of a chain, all those within which it stands included. All structures that extend the features of a device are fewer.
pub(crate) const CHAIN: usize = 512;
/// The most structures within structures that are no links of a chain.
pub(crate) const NESTED: usize = 48;

pub(crate) const ACCELERATION_STRUCTURE: u32 = 1_000_150_000;
pub(crate) const INLINE_UNIFORM_BLOCK: u32 = 1_000_138_000;
/// The members of the data of an update template, which have no name in Vulkan.
pub(crate) const TEMPLATE: &str = "UpdateTemplateData";

/// The structure that stands for `VkAccelerationStructureGeometryDataKHR`, by `geometryType`.
pub(crate) fn geometry(kind: i32) -> Option<&'static str> {
    Some(match kind {
        0 => "VkAccelerationStructureGeometryTrianglesDataKHR",
        1 => "VkAccelerationStructureGeometryAabbsDataKHR",
        2 => "VkAccelerationStructureGeometryInstancesDataKHR",
        _ => return None,
    })
}

/// The structure that stands for `VkAccelerationStructureMotionInstanceDataNV`, by `type`.
pub(crate) fn motion(kind: i32) -> Option<&'static str> {
    Some(match kind {
        0 => "VkAccelerationStructureInstanceKHR",
        1 => "VkAccelerationStructureMatrixMotionInstanceNV",
        2 => "VkAccelerationStructureSRTMotionInstanceNV",
        _ => return None,
    })
}

/// The parameters and the result of a call.
pub(crate) fn call(of: &'static CallLayout, bytes: &[u8]) -> Result<Call, Fault> {
    let mut values = Values { bytes, nested: 0, depth: 0 };
    let mut parameters = Vec::with_capacity(of.parameters.len());
    values.fields(&of.parameters, &mut parameters)?;
    let result = of.result.as_ref().map(|kind| values.value(kind)).transpose().map_err(|fault| fault.member("the result"))?;
    match values.bytes.len() {
        0 => Ok(Call { number: of.number, name: of.name, parameters, result }),
        left => Err(Cause::Left(left as u64).into()),
    }
}

/// The bytes that are left.
struct Values<'a> {
    bytes: &'a [u8],
    /// Structures around the next value, without and with the links of chains.
    nested: usize,
    depth: usize,
}

impl Values<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], Cause> {
        let (first, rest) = self.bytes.split_first_chunk().ok_or(Cause::End)?;
        self.bytes = rest;
        Ok(*first)
    }

    fn u32(&mut self) -> Result<u32, Cause> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, Cause> {
        self.take().map(u64::from_le_bytes)
    }

    /// The next `count` bytes.
    fn run(&mut self, count: u64) -> Result<&[u8], Cause> {
        let (run, rest) =
            usize::try_from(count).ok().and_then(|count| self.bytes.split_at_checked(count)).ok_or(Cause::Length(count))?;
        self.bytes = rest;
        Ok(run)
    }

    fn fields(&mut self, of: &'static [Field], into: &mut Vec<(&'static str, Value)>) -> Result<(), Fault> {
        for field in of {
            let value = match &field.kind {
                Kind::Union(union) => self.union(union, into),
                kind => self.value(kind),
            };
            into.push((field.name, value.map_err(|fault| fault.member(field.name))?));
        }
        Ok(())
    }

    /// A union, by the members before it.
    fn union(&mut self, union: &'static str, before: &[(&'static str, Value)]) -> Result<Value, Fault> {
        let selector = |name: &str| before.iter().find_map(|(member, value)| (*member == name).then(|| value.i32().ok())?);
        let structure = match union {
            "VkPerformanceValueDataINTEL" if selector("type") == Some(4) => return self.value(&Kind::Str),
            "VkPerformanceValueDataINTEL" => return self.value(&Kind::U64),
            "VkAccelerationStructureGeometryDataKHR" => selector("geometryType").and_then(geometry),
            "VkAccelerationStructureMotionInstanceDataNV" => selector("type").and_then(motion),
            _ => None,
        };
        let of = structure.and_then(|name| layout().structure(name)).ok_or(Cause::Union(union))?;
        Ok(Value::Struct(self.structure(of)?))
    }

    fn structure(&mut self, of: &'static StructLayout) -> Result<Struct, Fault> {
        if self.nested == NESTED {
            return Err(Cause::Depth(NESTED).into());
        }
        self.nested += 1;
        self.depth += 1;
        let mut members = Vec::with_capacity(of.fields.len());
        self.fields(&of.fields, &mut members)?;
        self.nested -= 1;
        self.depth -= 1;
        Ok(Struct { name: of.name, members })
    }

    /// A chain. The rest of a structure stands after the whole chain behind it. It takes no stack, however long it is.
    fn chain(&mut self) -> Result<Value, Fault> {
        let mut open: Vec<(&StructLayout, Vec<(&'static str, Value)>)> = Vec::new();
        let depth = self.depth;
        let mut value = loop {
            match self.link().map_err(|cause| Fault::from(cause).index(open.len()))? {
                Ok(of) if self.depth == CHAIN => {
                    return Err(Fault::from(Cause::Depth(CHAIN)).index(open.len()).member(of.name));
                }
                Ok(of) => {
                    self.depth += 1;
                    let mut members = Vec::with_capacity(of.fields.len());
                    self.fields(&of.fields[..1], &mut members)?;
                    open.push((of, members));
                }
                Err(end) => break end,
            }
        };
        while let Some((of, mut members)) = open.pop() {
            members.push(("pNext", value));
            self.fields(&of.fields[2..], &mut members).map_err(|fault| fault.index(open.len()))?;
            value = Value::Struct(Struct { name: of.name, members });
        }
        self.depth = depth;
        Ok(value)
    }

    /// The next structure of a chain, or the value at its end.
    fn link(&mut self) -> Result<Result<&'static StructLayout, Value>, Cause> {
        let attributes = self.u32()?;
        if attributes & NULL != 0 {
            return Ok(Err(Value::Null));
        }
        if attributes & ADDRESS != 0 {
            self.u64()?;
        }
        if attributes & (ARRAY | ARRAY_2D | STRING | WIDE) != 0 {
            return Err(Cause::Attributes(attributes));
        }
        if attributes & DATA == 0 {
            return Ok(Err(Value::Omitted(1)));
        }
        let tag = self.bytes.first_chunk().map(|tag| u32::from_le_bytes(*tag)).ok_or(Cause::End)?;
        layout().chained(tag).map(Ok).ok_or(Cause::Structure(tag))
    }

    fn value(&mut self, kind: &'static Kind) -> Result<Value, Fault> {
        Ok(match kind {
            Kind::U8 => Value::U8(self.take::<1>()?[0]),
            Kind::U16 => Value::U16(self.take().map(u16::from_le_bytes)?),
            Kind::U32 => Value::U32(self.u32()?),
            Kind::I32 => Value::I32(self.take().map(i32::from_le_bytes)?),
            Kind::U64 => Value::U64(self.u64()?),
            Kind::I64 => Value::I64(self.take().map(i64::from_le_bytes)?),
            Kind::F32 => Value::F32(self.take().map(f32::from_le_bytes)?),
            Kind::F64 => Value::F64(self.take().map(f64::from_le_bytes)?),
            Kind::Handle => Value::Handle(self.u64()?),
            Kind::Enum(kind) => Value::Enum(Enum { kind, value: self.take().map(i32::from_le_bytes)? }),
            Kind::Struct(place) => Value::Struct(self.structure(&layout().structs[*place])?),
            Kind::Union(union) => self.union(union, &[])?,
            Kind::Pointer(inner) | Kind::Array(inner) => self.pointer(inner, matches!(kind, Kind::Array(_)))?,
            Kind::Str | Kind::WideStr => self.pointer(kind, false)?,
            Kind::Next => self.chain()?,
            Kind::Template => self.template()?,
        })
    }

    /// The content of a pointer, by its attribute word. `inner` is the type of an element. `array` is true if several are declared.
    fn pointer(&mut self, inner: &'static Kind, array: bool) -> Result<Value, Fault> {
        let attributes = self.u32()?;
        if attributes & NULL != 0 {
            return Ok(Value::Null);
        }
        if attributes & ADDRESS != 0 {
            self.u64()?;
        }
        let several = attributes & (ARRAY | ARRAY_2D) != 0;
        let text = matches!(inner, Kind::Str | Kind::WideStr);
        if (attributes & (STRING | WIDE) != 0) != text || (text && several != array) {
            return Err(Cause::Attributes(attributes).into());
        }
        let count = if several || text { self.u64()? } else { 1 };
        if attributes & DATA == 0 {
            return Ok(Value::Omitted(count));
        }
        match inner {
            Kind::Str if !several => return Ok(Value::Str(String::from_utf8_lossy(self.run(count)?).into_owned())),
            Kind::WideStr if !several => {
                let units = self.run(count.checked_mul(2).ok_or(Cause::Length(count))?)?;
                let units: Vec<u16> = units.as_chunks().0.iter().map(|unit| u16::from_le_bytes(*unit)).collect();
                return Ok(Value::Str(String::from_utf16_lossy(&units)));
            }
            Kind::U8 if array || several => return Ok(Value::Bytes(self.run(count)?.to_vec())),
            Kind::U32 if array || several => {
                let words = self.run(count.checked_mul(4).ok_or(Cause::Length(count))?)?;
                return Ok(Value::Words(words.as_chunks().0.iter().map(|word| u32::from_le_bytes(*word)).collect()));
            }
            _ if !array && !several => return self.value(inner),
            _ => {}
        }
        // Each element has a byte at least.
        if count > self.bytes.len() as u64 {
            return Err(Cause::Length(count).into());
        }
        let count = count as usize;
        let mut values = Vec::new();
        for index in 0..count {
            values.push(self.value(inner).map_err(|fault| fault.index(index))?);
        }
        Ok(Value::Array(values))
    }

    /// The data of an update template: three counts, what they count, and then other kinds to the end.
    fn template(&mut self) -> Result<Value, Fault> {
        let attributes = self.u32()?;
        if attributes & NULL != 0 {
            return Ok(Value::Null);
        }
        if attributes & ADDRESS != 0 {
            self.u64()?;
        }
        // The recorder did not know the template.
        if attributes & ARRAY != 0 {
            return Ok(Value::Omitted(self.u64()?));
        }
        if attributes & DATA == 0 {
            return Ok(Value::Omitted(1));
        }
        let counts = [self.u64()?, self.u64()?, self.u64()?];
        let mut members = Vec::new();
        for ((name, of), count) in template_groups().into_iter().zip(counts) {
            if count > self.bytes.len() as u64 {
                return Err(Fault::from(Cause::Length(count)).member(name));
            }
            let element = |index| match of {
                Some(of) => self.structure(of).map(Value::Struct).map_err(|fault: Fault| fault.index(index).member(name)),
                None => Ok(Value::Handle(self.u64()?)),
            };
            members.push((name, Value::Array((0..count as usize).map(element).collect::<Result<_, _>>()?)));
        }
        let (mut structures, mut blocks) = (Vec::new(), Vec::new());
        while !self.bytes.is_empty() {
            let (count, kind) = (self.u64()?, self.u32()?);
            match kind {
                ACCELERATION_STRUCTURE => {
                    // It ends where the data end.
                    for _ in 0..count {
                        structures.push(Value::Handle(self.u64()?));
                    }
                }
                INLINE_UNIFORM_BLOCK => blocks.extend_from_slice(self.run(count)?),
                other => return Err(Cause::Descriptor(other).into()),
            }
        }
        members.push(("accelerationStructures", Value::Array(structures)));
        members.push(("inlineUniformBlocks", Value::Bytes(blocks)));
        Ok(Value::Struct(Struct { name: TEMPLATE, members }))
    }
}

/// The groups of the data of an update template that are counted at its beginning. The last has handles.
pub(crate) fn template_groups() -> [(&'static str, Option<&'static StructLayout>); 3] {
    [
        ("imageInfos", layout().structure("VkDescriptorImageInfo")),
        ("bufferInfos", layout().structure("VkDescriptorBufferInfo")),
        ("texelBufferViews", None),
    ]
}
