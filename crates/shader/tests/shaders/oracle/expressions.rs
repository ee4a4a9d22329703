//! Expressions.

use std::rc::Rc;

use naga::{BinaryOperator, Expression, Handle, RelationalFunction, ScalarKind, TypeInner};

use super::Fault;
use super::groups::Request;
use super::machine::{Invocation, World, compose};
use super::memory::{self, Pointee};
use super::number;
use super::value::{Number, Pointer, Root, Value, broken, zero};
use super::{builtins, geometry};

impl<'a> Invocation<'a> {
    /// The type of an expression of the innermost function.
    pub fn type_of(&mut self, world: &World<'a>, h: Handle<Expression>) -> Result<&'a TypeInner, Fault> {
        let info = self.frame()?.info;
        Ok(info[h].ty.inner_with(&world.module.types))
    }

    /// The value of an expression: as it was emitted, or of one that needs no `Emit`, now.
    pub fn evaluate(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<Value, Fault> {
        if let Some(value) = &self.frame()?.expressions[h.index()] {
            return Ok(value.clone());
        }
        match self.frame()?.function.expressions[h] {
            Expression::Literal(_)
            | Expression::Constant(_)
            | Expression::ZeroValue(_)
            | Expression::FunctionArgument(_)
            | Expression::GlobalVariable(_)
            | Expression::LocalVariable(_) => {}
            // First values of variables, and offsets of texture samples, are such expressions without an `Emit`.
            _ if self.is_constant(h)? => {}
            ref other => return Err(Fault::Unsupported(format!("{other:?} is used before it is computed"))),
        }
        // None of these changes while the function runs.
        let value = self.compute(world, h)?;
        self.frame()?.expressions[h.index()] = Some(value.clone());
        Ok(value)
    }

    /// Whether an expression stands in the program as a constant.
    fn is_constant(&mut self, h: Handle<Expression>) -> Result<bool, Fault> {
        let function = self.frame()?.function;
        fn constant(function: &naga::Function, h: Handle<Expression>) -> bool {
            match function.expressions[h] {
                Expression::Literal(_) | Expression::Constant(_) | Expression::ZeroValue(_) => true,
                Expression::Compose { ref components, .. } => components.iter().all(|&c| constant(function, c)),
                Expression::Splat { value, .. } => constant(function, value),
                Expression::Swizzle { vector, .. } => constant(function, vector),
                Expression::AccessIndex { base, .. } => constant(function, base),
                Expression::Unary { expr, .. } | Expression::As { expr, .. } => constant(function, expr),
                Expression::Binary { left, right, .. } => constant(function, left) && constant(function, right),
                _ => false,
            }
        }
        Ok(constant(function, h))
    }

    /// What an expression asks of other invocations, if it cannot be computed alone.
    pub fn request_of(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<Option<Request>, Fault> {
        Ok(match self.frame()?.function.expressions[h] {
            Expression::Derivative { axis, ctrl, expr } => {
                Some(Request::Derivative { axis, control: ctrl, value: self.evaluate(world, expr)? })
            }
            Expression::ImageSample { gather: None, level: naga::SampleLevel::Auto | naga::SampleLevel::Bias(_), .. } => {
                Some(Request::Sample(Box::new(self.sample_of(world, h)?)))
            }
            _ => None,
        })
    }

    /// Part of a value, or the pointer to a part of what a pointer points to.
    fn part(&mut self, world: &mut World<'a>, base: Handle<Expression>, index: u32, constant: bool) -> Result<Value, Fault> {
        // Without a copy of the whole where that is at hand.
        if let Some(value @ (Value::Vector(_) | Value::Parts(_))) = &self.frame()?.expressions[base.index()] {
            return value.part(index);
        }
        match self.evaluate(world, base)? {
            Value::Pointer(pointer) => {
                let pointee = Pointee::of(self.type_of(world, base)?)?;
                Ok(Value::Pointer(Rc::new(memory::part(world.module, &pointer, pointee, index, constant)?)))
            }
            value => value.part(index),
        }
    }

    /// Computes an expression.
    pub fn compute(&mut self, world: &mut World<'a>, h: Handle<Expression>) -> Result<Value, Fault> {
        let frame = self.frame()?;
        let function = frame.function;
        Ok(match function.expressions[h] {
            Expression::Literal(literal) => Value::Number(number::literal(literal)?),
            Expression::Constant(c) => world.constant(world.module.constants[c].init)?,
            Expression::ZeroValue(ty) => zero(world.module, ty)?,
            Expression::FunctionArgument(i) => frame.arguments[i as usize].clone(),
            Expression::GlobalVariable(g) => global(world.module, g)?,
            Expression::LocalVariable(l) => {
                let root = Root::Local(self.frames.len() - 1, l.index());
                Value::Pointer(Rc::new(Pointer::Variable { root, path: Vec::new() }))
            }
            Expression::Compose { ty, ref components } => {
                let parts = components.iter().map(|&c| self.evaluate(world, c)).collect::<Result<Vec<_>, _>>()?;
                compose(&world.module.types[ty].inner, parts)?
            }
            Expression::Access { base, index } => {
                let index = self.evaluate(world, index)?.integer()?;
                self.part(world, base, index, false)?
            }
            Expression::AccessIndex { base, index } => self.part(world, base, index, true)?,
            Expression::Splat { size, value } => Value::vector(&vec![self.evaluate(world, value)?.number()?; size as usize]),
            Expression::Swizzle { size, vector, pattern } => {
                let vector = self.evaluate(world, vector)?;
                let from = vector.numbers()?;
                Value::vector(&pattern[..size as usize].iter().map(|&c| from[c as usize]).collect::<Vec<_>>())
            }
            Expression::Load { pointer } => {
                let pointee = Pointee::of(self.type_of(world, pointer)?)?;
                let Value::Pointer(pointer) = self.evaluate(world, pointer)? else {
                    return broken("a load through something that is no pointer");
                };
                world.load(self, &pointer, pointee)?
            }
            Expression::Unary { op, expr } => self.evaluate(world, expr)?.map(&mut |x| number::unary(op, x))?,
            Expression::Binary { op, left, right } => {
                let (a, b) = (self.evaluate(world, left)?, self.evaluate(world, right)?);
                binary(op, &a, &b)?
            }
            Expression::Select { condition, accept, reject } => {
                let condition = self.evaluate(world, condition)?;
                let (accept, reject) = (self.evaluate(world, accept)?, self.evaluate(world, reject)?);
                select(&condition, accept, reject)?
            }
            Expression::Relational { fun, argument } => relational(fun, &self.evaluate(world, argument)?)?,
            Expression::Math { fun, arg, arg1, arg2, arg3 } => {
                let handles = [Some(arg), arg1, arg2, arg3];
                let args = handles.into_iter().flatten().map(|h| self.evaluate(world, h)).collect::<Result<Vec<_>, _>>()?;
                let constant = arg1.map_or(Ok(false), |h| self.is_constant(h))?;
                builtins::call(fun, &args, constant)?
            }
            Expression::As { expr, kind, convert } => {
                let value = self.evaluate(world, expr)?;
                match convert {
                    Some(width) => value.map(&mut |x| number::convert(x, kind, width))?,
                    None => value.map(&mut |x| number::bitcast(x, kind))?,
                }
            }
            Expression::ArrayLength(pointer) => {
                let pointee = Pointee::of(self.type_of(world, pointer)?)?;
                let Value::Pointer(pointer) = self.evaluate(world, pointer)? else {
                    return broken("`arrayLength` of something that is no pointer");
                };
                Value::Number(Number::Uint(memory::runtime_length(world, &pointer, pointee)?))
            }
            Expression::ImageSample { .. } => self.image_sample(world, h)?,
            Expression::ImageLoad { .. } => self.image_load(world, h)?,
            Expression::ImageQuery { image, query } => self.image_query(world, image, query)?,
            ref other => return Err(Fault::Unsupported(format!("the expression {other:?}"))),
        })
    }
}

/// What the name of a global variable stands for: a pointer, or a texture or sampler.
fn global(module: &naga::Module, g: Handle<naga::GlobalVariable>) -> Result<Value, Fault> {
    use naga::AddressSpace as A;
    let variable = &module.global_variables[g];
    let binding = || match &variable.binding {
        Some(at) => Ok((at.group, at.binding)),
        None => broken("a resource without a binding"),
    };
    let variable_at = |root| Pointer::Variable { root, path: Vec::new() };
    let memory = |binding| Pointer::Memory { binding, element: 0, fixed: 0, chosen: 0 };
    Ok(Value::Pointer(Rc::new(match variable.space {
        A::Handle => return Ok(Value::Resource(binding()?, 0)),
        A::Private => variable_at(Root::Private(g.index())),
        A::WorkGroup => variable_at(Root::Workgroup(g.index())),
        A::Uniform | A::Storage { .. } => memory(Some(binding()?)),
        A::Immediate => memory(None),
        other => return Err(Fault::Unsupported(format!("the address space {other:?}"))),
    })))
}

/// A binary operator on values: products of matrices as a whole, all else number by number.
fn binary(op: BinaryOperator, a: &Value, b: &Value) -> Result<Value, Fault> {
    let whole = matches!((a, b), (Value::Parts(_), Value::Vector(_) | Value::Parts(_)) | (Value::Vector(_), Value::Parts(_)));
    if op == BinaryOperator::Multiply && whole {
        return geometry::product(a, b);
    }
    a.zip(b, &mut |x, y| number::binary(op, x, y))
}

/// One of two values, or of each two numbers of vectors.
fn select(condition: &Value, accept: Value, reject: Value) -> Result<Value, Fault> {
    let Value::Vector(conditions) = condition else {
        return Ok(if condition.truth()? { accept } else { reject });
    };
    let (a, r) = (accept.numbers()?, reject.numbers()?);
    let one = |(i, c): (usize, &Number)| if *c == Number::Bool(true) { a[i] } else { r[i] };
    Ok(Value::vector(&conditions.numbers().iter().enumerate().map(one).collect::<Vec<_>>()))
}

fn relational(fun: RelationalFunction, argument: &Value) -> Result<Value, Fault> {
    let all = |value| Ok(argument.numbers()?.iter().all(|&n| n == Number::Bool(value)));
    let float = |n: Number, f: &dyn Fn(f32) -> bool| match n {
        Number::Float(x) | Number::Half(x) => Ok(Number::Bool(f(x))),
        _ => broken("a test of a number that is no float"),
    };
    match fun {
        RelationalFunction::All => Ok(Value::Number(Number::Bool(all(true)?))),
        RelationalFunction::Any => Ok(Value::Number(Number::Bool(!all(false)?))),
        RelationalFunction::IsNan => argument.map(&mut |n| float(n, &f32::is_nan)),
        RelationalFunction::IsInf => argument.map(&mut |n| float(n, &f32::is_infinite)),
    }
}

/// The kind of the numbers of an image's texels, and whether they are depths.
pub fn texel_kind(class: naga::ImageClass) -> Result<(ScalarKind, bool), Fault> {
    Ok(match class {
        naga::ImageClass::Sampled { kind, .. } => (kind, false),
        naga::ImageClass::Depth { .. } => (ScalarKind::Float, true),
        naga::ImageClass::Storage { format, .. } => (naga::Scalar::from(format).kind, false),
        naga::ImageClass::External => return Err(Fault::Unsupported("external textures".into())),
    })
}
