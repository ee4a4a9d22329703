//! Values: numbers with their types, and what is made of them.

use std::rc::Rc;

use naga::{Handle, Scalar, ScalarKind, Type, TypeInner};

use super::Fault;
use super::number::to_f16;

/// A number with its type.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Number {
    Bool(bool),
    Sint(i32),
    Uint(u32),
    Float(f32),
    /// An `f16`: always one that an `f16` can hold.
    Half(f32),
}

impl Number {
    /// The number of a type with these bits, as registers and interfaces hold them: an `f16` as the `f32` of its value.
    pub fn from_bits(scalar: Scalar, bits: u32) -> Result<Number, Fault> {
        Ok(match (scalar.kind, scalar.width) {
            (ScalarKind::Bool, _) => Number::Bool(bits != 0),
            (ScalarKind::Sint, 4) => Number::Sint(bits as i32),
            (ScalarKind::Uint, 4) => Number::Uint(bits),
            (ScalarKind::Float, 4) => Number::Float(f32::from_bits(bits)),
            (ScalarKind::Float, 2) => Number::Half(to_f16(f32::from_bits(bits))),
            _ => return Err(Fault::Unsupported(format!("numbers of type {scalar:?}"))),
        })
    }

    /// The reverse of [`Number::from_bits`].
    pub fn bits(self) -> u32 {
        match self {
            Number::Bool(x) => u32::from(x),
            Number::Sint(x) => x as u32,
            Number::Uint(x) => x,
            Number::Float(x) | Number::Half(x) => x.to_bits(),
        }
    }

    /// A float of the same type as this one: an `f16` is rounded.
    pub fn same_float(self, x: f32) -> Number {
        if let Number::Half(_) = self { Number::Half(to_f16(x)) } else { Number::Float(x) }
    }
}

/// Up to four numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Vector {
    length: u8,
    numbers: [Number; 4],
}

impl Vector {
    /// A vector of these numbers, at most four.
    pub fn new(numbers: &[Number]) -> Vector {
        let mut out = Vector { length: numbers.len() as u8, numbers: [Number::Bool(false); 4] };
        out.numbers[..numbers.len()].copy_from_slice(numbers);
        out
    }

    /// Its numbers.
    pub fn numbers(&self) -> &[Number] {
        &self.numbers[..usize::from(self.length)]
    }

    /// Its numbers, to change them.
    pub fn numbers_mut(&mut self) -> &mut [Number] {
        &mut self.numbers[..usize::from(self.length)]
    }
}

/// Where a variable lives.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Root {
    /// A variable of a function that is being called: number of its frame from the outermost, number of the variable.
    Local(usize, usize),
    /// A private global variable, by its number in the module.
    Private(usize),
    /// A workgroup variable, by its number in the module.
    Workgroup(usize),
}

/// What a pointer points to.
#[derive(Clone, Debug, PartialEq)]
pub enum Pointer {
    /// A part of a variable: the index at each step into it.
    Variable { root: Root, path: Vec<u32> },
    /// Bytes of a buffer.
    Memory {
        /// Group and binding; none: the immediates.
        binding: Option<(u32, u32)>,
        /// Element of a binding array.
        element: u32,
        /// Offset in bytes from constant indices and members.
        fixed: u64,
        /// Offset in bytes from indices computed at run time; it wraps in 32 bits.
        chosen: u32,
    },
}

/// A value of any type.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    Number(Number),
    Vector(Vector),
    /// Columns of a matrix, elements of an array, members of a structure.
    Parts(Vec<Value>),
    Pointer(Rc<Pointer>),
    /// A texture or sampler: group and binding, element of a binding array.
    Resource((u32, u32), u32),
}

/// A fault of a program that naga should not have let through, or that this file's authors did not think of.
pub fn broken<T>(what: &str) -> Result<T, Fault> {
    Err(Fault::Unsupported(what.to_owned()))
}

impl Value {
    /// A vector value.
    pub fn vector(numbers: &[Number]) -> Value {
        Value::Vector(Vector::new(numbers))
    }

    /// A number, or a vector of several.
    pub fn of_numbers(numbers: &[Number]) -> Value {
        if let [one] = *numbers { Value::Number(one) } else { Value::vector(numbers) }
    }

    /// The only number of a scalar.
    pub fn number(&self) -> Result<Number, Fault> {
        if let Value::Number(n) = *self { Ok(n) } else { broken("a scalar was expected") }
    }

    /// A condition.
    pub fn truth(&self) -> Result<bool, Fault> {
        if let Value::Number(Number::Bool(b)) = *self { Ok(b) } else { broken("a `bool` was expected") }
    }

    /// The bits of an integer.
    pub fn integer(&self) -> Result<u32, Fault> {
        match *self {
            Value::Number(Number::Sint(x)) => Ok(x as u32),
            Value::Number(Number::Uint(x)) => Ok(x),
            _ => broken("an integer was expected"),
        }
    }

    /// The numbers of a scalar or vector.
    pub fn numbers(&self) -> Result<&[Number], Fault> {
        match self {
            Value::Number(n) => Ok(std::slice::from_ref(n)),
            Value::Vector(v) => Ok(v.numbers()),
            _ => broken("a scalar or vector was expected"),
        }
    }

    /// The 32-bit floats of a scalar or vector.
    pub fn floats(&self) -> Result<Vec<f32>, Fault> {
        let float = |n: &Number| match *n {
            Number::Float(x) | Number::Half(x) => Ok(x),
            _ => broken("a float was expected"),
        };
        self.numbers()?.iter().map(float).collect()
    }

    /// Part `index`, or the last part if `index` is beyond it.
    pub fn part(&self, index: u32) -> Result<Value, Fault> {
        let index = index as usize;
        match self {
            Value::Vector(v) => Ok(Value::Number(v.numbers()[index.min(v.numbers().len() - 1)])),
            Value::Parts(parts) if !parts.is_empty() => Ok(parts[index.min(parts.len() - 1)].clone()),
            &Value::Resource(binding, _) => Ok(Value::Resource(binding, index as u32)),
            _ => broken("a value without parts is indexed"),
        }
    }

    /// All numbers in it, in order.
    pub fn flatten(&self, out: &mut Vec<Number>) -> Result<(), Fault> {
        match self {
            Value::Number(n) => out.push(*n),
            Value::Vector(v) => out.extend_from_slice(v.numbers()),
            Value::Parts(parts) => {
                for part in parts {
                    part.flatten(out)?;
                }
            }
            _ => return broken("a pointer or resource is used as a value"),
        }
        Ok(())
    }

    /// The same shape with a function applied to each number.
    pub fn map(&self, f: &mut impl FnMut(Number) -> Result<Number, Fault>) -> Result<Value, Fault> {
        Ok(match self {
            Value::Number(n) => Value::Number(f(*n)?),
            Value::Vector(v) => {
                let mut out = *v;
                for n in out.numbers_mut() {
                    *n = f(*n)?;
                }
                Value::Vector(out)
            }
            Value::Parts(parts) => Value::Parts(parts.iter().map(|p| p.map(f)).collect::<Result<_, _>>()?),
            _ => return broken("a pointer or resource is used as a value"),
        })
    }

    /// A function applied to corresponding numbers of two values; a single number goes with each one of the other.
    pub fn zip(&self, other: &Value, f: &mut impl FnMut(Number, Number) -> Result<Number, Fault>) -> Result<Value, Fault> {
        match (self, other) {
            (&Value::Number(a), b) => b.map(&mut |n| f(a, n)),
            (a, &Value::Number(b)) => a.map(&mut |n| f(n, b)),
            (Value::Vector(a), Value::Vector(b)) if a.length == b.length => {
                let mut out = *a;
                for (x, &y) in out.numbers_mut().iter_mut().zip(b.numbers()) {
                    *x = f(*x, y)?;
                }
                Ok(Value::Vector(out))
            }
            (Value::Parts(a), Value::Parts(b)) if a.len() == b.len() => {
                Ok(Value::Parts(a.iter().zip(b).map(|(x, y)| x.zip(y, f)).collect::<Result<_, _>>()?))
            }
            _ => broken("operands of different shapes"),
        }
    }
}

/// The number of elements of an array type; none: as many as memory holds.
pub fn array_length(module: &naga::Module, size: naga::ArraySize) -> Option<u32> {
    match size {
        naga::ArraySize::Constant(n) => Some(n.get()),
        naga::ArraySize::Pending(_) | naga::ArraySize::Dynamic => match size.resolve(module.to_ctx()) {
            Ok(naga::proc::IndexableLength::Known(n)) => Some(n),
            _ => None,
        },
    }
}

/// The zero of a type.
pub fn zero(module: &naga::Module, ty: Handle<Type>) -> Result<Value, Fault> {
    Ok(match module.types[ty].inner {
        TypeInner::Scalar(s) | TypeInner::Atomic(s) => Value::Number(Number::from_bits(s, 0)?),
        TypeInner::Vector { size, scalar } => Value::vector(&vec![Number::from_bits(scalar, 0)?; size as usize]),
        TypeInner::Matrix { columns, rows, scalar } => {
            Value::Parts(vec![Value::vector(&vec![Number::from_bits(scalar, 0)?; rows as usize]); columns as usize])
        }
        TypeInner::Array { base, size, .. } => {
            let Some(n) = array_length(module, size) else { return broken("the zero of a runtime-sized array") };
            Value::Parts(vec![zero(module, base)?; n as usize])
        }
        TypeInner::Struct { ref members, .. } => {
            Value::Parts(members.iter().map(|m| zero(module, m.ty)).collect::<Result<_, _>>()?)
        }
        ref other => return Err(Fault::Unsupported(format!("the zero of {other:?}"))),
    })
}
