//! Memory: where values lie in buffers, loads, stores and atomics through pointers.

use naga::{AtomicFunction, Handle, Scalar, ScalarKind, Type, TypeInner, VectorSize};

use super::machine::{Invocation, World};
use super::number::{f16_bits, f16_value};
use super::value::{Number, Pointer, Root, Value, array_length, broken};
use super::{Fault, Resource};

/// A type that a pointer points to: one of the module, or a part of a vector or matrix.
#[derive(Clone, Copy, Debug)]
pub enum Pointee {
    Type(Handle<Type>),
    Vector(VectorSize, Scalar),
    Scalar(Scalar),
}

impl Pointee {
    /// What a pointer of this type points to.
    pub fn of(pointer: &TypeInner) -> Result<Pointee, Fault> {
        match *pointer {
            TypeInner::Pointer { base, .. } => Ok(Pointee::Type(base)),
            TypeInner::ValuePointer { size: Some(size), scalar, .. } => Ok(Pointee::Vector(size, scalar)),
            TypeInner::ValuePointer { size: None, scalar, .. } => Ok(Pointee::Scalar(scalar)),
            _ => broken("a pointer was expected"),
        }
    }
}

/// The distance of the parts of a type that can be indexed at run time, and their number; none: as many as memory holds.
struct Layout {
    stride: u32,
    parts: Option<u32>,
}

/// Bytes from one column of a matrix to the next.
fn column_stride(rows: VectorSize, scalar: Scalar) -> u32 {
    let padded = if rows == VectorSize::Bi { 2 } else { 4 };
    padded * u32::from(scalar.width)
}

fn layout(module: &naga::Module, pointee: Pointee) -> Result<Layout, Fault> {
    let vector = |size: VectorSize, s: Scalar| Layout { stride: u32::from(s.width), parts: Some(size as u32) };
    match pointee {
        Pointee::Vector(size, scalar) => Ok(vector(size, scalar)),
        Pointee::Scalar(_) => broken("a pointer to a scalar is indexed"),
        Pointee::Type(ty) => match module.types[ty].inner {
            TypeInner::Vector { size, scalar } => Ok(vector(size, scalar)),
            TypeInner::Matrix { columns, rows, scalar } => {
                Ok(Layout { stride: column_stride(rows, scalar), parts: Some(columns as u32) })
            }
            TypeInner::Array { size, stride, .. } => Ok(Layout { stride, parts: array_length(module, size) }),
            _ => broken("a pointer to something without parts is indexed"),
        },
    }
}

/// The pointer to part `index` of what a pointer points to. `constant` tells whether the index stands in the program; one
/// computed at run time is brought into the bounds of a sized type.
pub fn part(module: &naga::Module, pointer: &Pointer, pointee: Pointee, index: u32, constant: bool) -> Result<Pointer, Fault> {
    if let Pointee::Type(ty) = pointee
        && let TypeInner::BindingArray { .. } = module.types[ty].inner
    {
        let Pointer::Memory { binding, fixed, chosen, .. } = *pointer else {
            return broken("a binding array that is no memory");
        };
        return Ok(Pointer::Memory { binding, element: index, fixed, chosen });
    }
    let member = match pointee {
        Pointee::Type(ty) => match module.types[ty].inner {
            TypeInner::Struct { ref members, .. } => members.get(index as usize).map(|m| m.offset),
            _ => None,
        },
        _ => None,
    };
    let bounded = |parts: Option<u32>| parts.map_or(index, |n| index.min(n.saturating_sub(1)));
    match pointer {
        Pointer::Variable { root, path } => {
            let index = if member.is_some() { index } else { bounded(layout(module, pointee)?.parts) };
            let mut path = path.clone();
            path.push(index);
            Ok(Pointer::Variable { root: *root, path })
        }
        &Pointer::Memory { binding, element, fixed, chosen } => {
            let (mut fixed, mut chosen) = (fixed, chosen);
            if let Some(offset) = member {
                fixed += u64::from(offset);
            } else {
                let Layout { stride, parts } = layout(module, pointee)?;
                if constant {
                    fixed += u64::from(bounded(parts)) * u64::from(stride);
                } else {
                    chosen = chosen.wrapping_add(bounded(parts).wrapping_mul(stride));
                }
            }
            Ok(Pointer::Memory { binding, element, fixed, chosen })
        }
    }
}

/// The elements of the runtime-sized array that a pointer points to, as many as fit in the buffer.
pub fn runtime_length(world: &World<'_>, pointer: &Pointer, pointee: Pointee) -> Result<u32, Fault> {
    let Pointer::Memory { binding: Some(binding), element, fixed, .. } = *pointer else {
        return broken("`arrayLength` of something that is in no buffer");
    };
    let stride = match layout(world.module, pointee)? {
        Layout { stride, parts: None } => u64::from(stride),
        _ => return broken("`arrayLength` of a sized array"),
    };
    let bytes = world.buffer(binding, element).map_or(0, <[u8]>::len) as u64;
    Ok((bytes.saturating_sub(fixed) / stride) as u32)
}

/// A number in memory. What is not wholly inside reads as zero.
fn read_number(bytes: &[u8], at: u64, scalar: Scalar) -> Result<Number, Fault> {
    let start = usize::try_from(at).unwrap_or(usize::MAX);
    let inside = start.checked_add(usize::from(scalar.width)).and_then(|end| bytes.get(start..end));
    match (scalar.kind, scalar.width) {
        (ScalarKind::Float, 2) => {
            Ok(Number::Half(inside.map_or(0.0, |b| f16_value(u32::from(u16::from_le_bytes([b[0], b[1]]))))))
        }
        (_, 4) => Number::from_bits(scalar, inside.map_or(0, |b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))),
        _ => Err(Fault::Unsupported(format!("{scalar:?} in memory"))),
    }
}

/// Writes a number to memory, if all of it is inside.
fn write_number(bytes: &mut [u8], at: u64, number: Number) {
    let start = usize::try_from(at).unwrap_or(usize::MAX);
    let (code, size) = match number {
        Number::Half(x) => (f16_bits(x), 2),
        other => (other.bits(), 4),
    };
    if let Some(place) = start.checked_add(size).and_then(|end| bytes.get_mut(start..end)) {
        place.copy_from_slice(&code.to_le_bytes()[..size]);
    }
}

/// A value in memory.
fn read(module: &naga::Module, bytes: &[u8], at: u64, pointee: Pointee) -> Result<Value, Fault> {
    let vector = |size: VectorSize, s: Scalar, at: u64| -> Result<Value, Fault> {
        let width = u64::from(s.width);
        let numbers = (0..size as u64).map(|i| read_number(bytes, at + i * width, s)).collect::<Result<Vec<_>, _>>()?;
        Ok(Value::vector(&numbers))
    };
    let ty = match pointee {
        Pointee::Scalar(s) => return Ok(Value::Number(read_number(bytes, at, s)?)),
        Pointee::Vector(size, s) => return vector(size, s, at),
        Pointee::Type(ty) => ty,
    };
    Ok(match module.types[ty].inner {
        TypeInner::Scalar(s) | TypeInner::Atomic(s) => Value::Number(read_number(bytes, at, s)?),
        TypeInner::Vector { size, scalar } => vector(size, scalar, at)?,
        TypeInner::Matrix { columns, rows, scalar } => {
            let stride = u64::from(column_stride(rows, scalar));
            Value::Parts((0..columns as u64).map(|c| vector(rows, scalar, at + c * stride)).collect::<Result<_, _>>()?)
        }
        TypeInner::Array { base, size, stride } => {
            let Some(n) = array_length(module, size) else { return broken("a runtime-sized array is loaded") };
            let element = |i: u32| read(module, bytes, at + u64::from(i) * u64::from(stride), Pointee::Type(base));
            Value::Parts((0..n).map(element).collect::<Result<_, _>>()?)
        }
        TypeInner::Struct { ref members, .. } => {
            let member = |m: &naga::StructMember| read(module, bytes, at + u64::from(m.offset), Pointee::Type(m.ty));
            Value::Parts(members.iter().map(member).collect::<Result<_, _>>()?)
        }
        ref other => return Err(Fault::Unsupported(format!("a load of {other:?}"))),
    })
}

/// Writes a value to memory.
fn write(module: &naga::Module, bytes: &mut [u8], at: u64, pointee: Pointee, value: &Value) -> Result<(), Fault> {
    match (value, pointee) {
        (&Value::Number(n), _) => write_number(bytes, at, n),
        (Value::Vector(v), _) => {
            let size = if let Number::Half(_) = v.numbers()[0] { 2 } else { 4 };
            for (i, &n) in (0u64..).zip(v.numbers()) {
                write_number(bytes, at + i * size, n);
            }
        }
        (Value::Parts(parts), Pointee::Type(ty)) => match module.types[ty].inner {
            TypeInner::Matrix { rows, scalar, .. } => {
                let stride = u64::from(column_stride(rows, scalar));
                for (c, column) in (0u64..).zip(parts) {
                    write(module, bytes, at + c * stride, Pointee::Vector(rows, scalar), column)?;
                }
            }
            TypeInner::Array { base, stride, .. } => {
                for (i, element) in (0u64..).zip(parts) {
                    write(module, bytes, at + i * u64::from(stride), Pointee::Type(base), element)?;
                }
            }
            TypeInner::Struct { ref members, .. } => {
                for (m, part) in members.iter().zip(parts) {
                    write(module, bytes, at + u64::from(m.offset), Pointee::Type(m.ty), part)?;
                }
            }
            _ => return broken("a value is stored that does not fit its type"),
        },
        _ => return broken("a pointer or resource is stored"),
    }
    Ok(())
}

impl<'a> World<'a> {
    /// The bytes of a bound buffer. An element out of bounds is the last one.
    pub fn buffer(&self, binding: (u32, u32), element: u32) -> Option<&[u8]> {
        match self.resource(binding, element)? {
            Resource::Buffer(bytes) => Some(bytes),
            _ => None,
        }
    }

    /// The variable behind a root.
    fn variable<'v>(&'v mut self, invocation: &'v mut Invocation<'a>, root: Root) -> Result<&'v mut Value, Fault> {
        let found = match root {
            Root::Local(frame, index) => invocation.frames.get_mut(frame).and_then(|f| f.locals.get_mut(index)),
            Root::Private(index) => invocation.private.get_mut(index).and_then(Option::as_mut),
            Root::Workgroup(index) => self.workgroup.get_mut(index).and_then(Option::as_mut),
        };
        found.ok_or_else(|| Fault::Unsupported("a pointer to a variable that is not there".into()))
    }

    /// What a pointer points to.
    pub fn load(&mut self, invocation: &mut Invocation<'a>, pointer: &Pointer, pointee: Pointee) -> Result<Value, Fault> {
        match pointer {
            Pointer::Variable { root, path } => {
                let Some((&last, path)) = path.split_last() else { return Ok(self.variable(invocation, *root)?.clone()) };
                inside(self.variable(invocation, *root)?, path)?.part(last)
            }
            &Pointer::Memory { binding, element, fixed, chosen } => {
                let at = fixed + u64::from(chosen);
                let bytes = match binding {
                    Some(binding) => self.buffer(binding, element).unwrap_or(&[]),
                    None => &self.immediates,
                };
                read(self.module, bytes, at, pointee)
            }
        }
    }

    /// Stores to what a pointer points to. Invocations that have no effects store to their own variables only.
    pub fn store(
        &mut self,
        invocation: &mut Invocation<'a>,
        pointer: &Pointer,
        pointee: Pointee,
        value: Value,
    ) -> Result<(), Fault> {
        match pointer {
            Pointer::Variable { root: Root::Workgroup(_), .. } if !invocation.has_effects() => Ok(()),
            Pointer::Variable { root, path } => {
                let Some((&last, path)) = path.split_last() else {
                    *self.variable(invocation, *root)? = value;
                    return Ok(());
                };
                let index = last as usize;
                match (inside(self.variable(invocation, *root)?, path)?, value) {
                    (Value::Vector(v), Value::Number(n)) if index < v.numbers().len() => v.numbers_mut()[index] = n,
                    (Value::Parts(parts), value) if index < parts.len() => parts[index] = value,
                    _ => return broken("a store through a pointer that does not fit"),
                }
                Ok(())
            }
            Pointer::Memory { .. } if !invocation.has_effects() => Ok(()),
            &Pointer::Memory { binding: Some(binding), element, fixed, chosen } => {
                let module = self.module;
                match self.resource_mut(binding, element) {
                    Some(Resource::Buffer(bytes)) => write(module, bytes, fixed + u64::from(chosen), pointee, &value),
                    _ => Ok(()),
                }
            }
            Pointer::Memory { binding: None, .. } => broken("a store to the immediates"),
        }
    }

    /// Changes an atomic; what it held before, and whether that equalled `compare`. An atomic that is not there, or of an
    /// invocation without effects, gives zero and false.
    pub fn atomic(
        &mut self,
        invocation: &mut Invocation<'a>,
        pointer: &Pointer,
        fun: AtomicFunction,
        value: Number,
        compare: Option<Number>,
    ) -> Result<(Number, bool), Fault> {
        let scalar = match value {
            Number::Sint(_) => Scalar::I32,
            Number::Uint(_) => Scalar::U32,
            Number::Float(_) => Scalar::F32,
            _ => return broken("an atomic of this type"),
        };
        if !invocation.has_effects() || !self.holds(pointer) {
            return Ok((Number::from_bits(scalar, 0)?, false));
        }
        let pointee = Pointee::Scalar(scalar);
        let old = self.load(invocation, pointer, pointee)?.number()?;
        let new = atomic_result(fun, old, value, compare)?;
        self.store(invocation, pointer, pointee, Value::Number(new))?;
        Ok((old, compare.is_some_and(|c| c.bits() == old.bits())))
    }

    /// Whether there is a word where a pointer points to.
    fn holds(&self, pointer: &Pointer) -> bool {
        match *pointer {
            Pointer::Variable { .. } => true,
            Pointer::Memory { binding: Some(binding), element, fixed, chosen } => {
                let bytes = self.buffer(binding, element).map_or(0, <[u8]>::len) as u64;
                fixed + u64::from(chosen) + 4 <= bytes
            }
            Pointer::Memory { binding: None, .. } => false,
        }
    }
}

/// The part of a variable at the end of a path.
fn inside<'v>(variable: &'v mut Value, path: &[u32]) -> Result<&'v mut Value, Fault> {
    path.iter().try_fold(variable, |value, &index| match value {
        Value::Parts(parts) => {
            parts.get_mut(index as usize).ok_or_else(|| Fault::Unsupported("a pointer beyond a variable".into()))
        }
        _ => broken("a pointer into something without parts"),
    })
}

/// The new value of an atomic.
pub fn atomic_result(fun: AtomicFunction, old: Number, value: Number, compare: Option<Number>) -> Result<Number, Fault> {
    use AtomicFunction as A;
    use Number::{Float, Sint, Uint};
    Ok(match (fun, old, value) {
        (A::Exchange { compare: None }, ..) => value,
        (A::Exchange { compare: Some(_) }, ..) => {
            if compare.is_some_and(|c| c.bits() == old.bits()) {
                value
            } else {
                old
            }
        }
        (A::Add, Float(a), Float(b)) => Float(a + b),
        (A::Subtract, Float(a), Float(b)) => Float(a - b),
        (A::Add, Uint(a), Uint(b)) => Uint(a.wrapping_add(b)),
        (A::Add, Sint(a), Sint(b)) => Sint(a.wrapping_add(b)),
        (A::Subtract, Uint(a), Uint(b)) => Uint(a.wrapping_sub(b)),
        (A::Subtract, Sint(a), Sint(b)) => Sint(a.wrapping_sub(b)),
        (A::And, Uint(a), Uint(b)) => Uint(a & b),
        (A::And, Sint(a), Sint(b)) => Sint(a & b),
        (A::InclusiveOr, Uint(a), Uint(b)) => Uint(a | b),
        (A::InclusiveOr, Sint(a), Sint(b)) => Sint(a | b),
        (A::ExclusiveOr, Uint(a), Uint(b)) => Uint(a ^ b),
        (A::ExclusiveOr, Sint(a), Sint(b)) => Sint(a ^ b),
        (A::Min, Uint(a), Uint(b)) => Uint(a.min(b)),
        (A::Min, Sint(a), Sint(b)) => Sint(a.min(b)),
        (A::Max, Uint(a), Uint(b)) => Uint(a.max(b)),
        (A::Max, Sint(a), Sint(b)) => Sint(a.max(b)),
        _ => return Err(Fault::Unsupported(format!("atomic {fun:?} of {old:?}"))),
    })
}
