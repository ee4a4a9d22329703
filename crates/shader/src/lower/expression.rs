//! Expressions.

use std::rc::Rc;

use naga::{
    BinaryOperator, DerivativeAxis, DerivativeControl, Expression, Handle, Literal, RelationalFunction, Scalar, ScalarKind,
    TypeInner, UnaryOperator,
};

use super::{Lowerer, Result, Root, Val};
use crate::code::Code;
use crate::ir::{NONE, V};
use crate::program::Space;
use crate::types::{Ty, is_half};

impl<'a> Lowerer<'a> {
    /// The value of an expression: as emitted, or computed now if it is one that needs no `Emit`.
    pub fn eval(&mut self, h: Handle<Expression>) -> Result<Val> {
        if let Some(v) = &self.frame().exprs[h.index()] {
            return Ok(v.clone());
        }
        let v = self.compute(h)?;
        self.frame_mut().exprs[h.index()] = Some(v.clone());
        Ok(v)
    }

    fn literal(&mut self, l: Literal) -> Result<V> {
        Ok(match l {
            Literal::F32(x) => self.b.float(x),
            Literal::F16(x) => self.b.float(x.to_f32()),
            Literal::U32(x) => self.b.constant(x),
            Literal::I32(x) => self.b.constant(x as u32),
            Literal::Bool(x) => self.b.constant(u32::from(x)),
            Literal::F64(_) => return self.refuse("64-bit floating-point numbers are not supported"),
            Literal::U64(_) | Literal::I64(_) => return self.refuse("64-bit integers are not supported"),
            Literal::U16(_) | Literal::I16(_) => return self.refuse("16-bit integers are not supported"),
            Literal::AbstractInt(_) | Literal::AbstractFloat(_) => return self.refuse("abstract literal"),
        })
    }

    /// The value of a constant expression of the module.
    pub fn global(&mut self, h: Handle<Expression>) -> Result<Val> {
        if let Some(v) = self.global_exprs.get(&h) {
            return Ok(v.clone());
        }
        let value = self.deeper(|s| s.global_value(h))?;
        self.global_exprs.insert(h, value.clone());
        Ok(value)
    }

    fn global_value(&mut self, h: Handle<Expression>) -> Result<Val> {
        let value = match self.module.global_expressions[h] {
            Expression::Literal(l) => Val::Data([self.literal(l)?].into()),
            Expression::Constant(c) => self.global(self.module.constants[c].init)?,
            Expression::ZeroValue(ty) => Val::Data(self.zeros(Ty::Named(ty))?.into()),
            Expression::Compose { ty, ref components } => {
                let mut out = Vec::with_capacity(self.size(Ty::Named(ty))?);
                for &c in components {
                    if let Val::Data(d) = self.global(c)? {
                        out.extend_from_slice(&d);
                    }
                }
                Val::Data(out.into())
            }
            Expression::Splat { size, value } => match self.global(value)? {
                Val::Data(d) => Val::Data(vec![d[0]; size as usize].into()),
                other => other,
            },
            Expression::Override(o) => {
                let name = self.module.overrides[o].name.clone().unwrap_or_default();
                return self.refuse(format!("the pipeline constant `{name}` has no value"));
            }
            ref other => return self.refuse(format!("a constant expression was not evaluated: {other:?}")),
        };
        self.moved(value)
    }

    /// Counts the steps of moving a value.
    fn moved(&mut self, value: Val) -> Result<Val> {
        if let Val::Data(d) = &value {
            self.spend(d.len() / 8)?;
        }
        Ok(value)
    }

    /// Computes an expression of the current function.
    pub fn compute(&mut self, h: Handle<Expression>) -> Result<Val> {
        let value = self.deeper(|s| s.expression(h))?;
        self.moved(value)
    }

    fn expression(&mut self, h: Handle<Expression>) -> Result<Val> {
        let function = self.frame().function;
        let span = function.expressions.get_span(h);
        if span.is_defined() {
            self.go_to(span);
        }
        Ok(match function.expressions[h] {
            Expression::Literal(l) => Val::Data([self.literal(l)?].into()),
            Expression::Constant(c) => self.global(self.module.constants[c].init)?,
            Expression::Override(o) => {
                let name = self.module.overrides[o].name.clone().unwrap_or_default();
                return self.refuse(format!("the pipeline constant `{name}` has no value"));
            }
            Expression::ZeroValue(ty) => Val::Data(self.zeros(Ty::Named(ty))?.into()),
            Expression::Compose { ty, ref components } => {
                let mut out = Vec::with_capacity(self.size(Ty::Named(ty))?);
                for &c in components {
                    out.extend_from_slice(&self.data(c)?);
                }
                Val::Data(out.into())
            }
            Expression::Access { base, index } => {
                let index = self.scalar(index)?;
                match self.eval(base)? {
                    Val::Place(p) => self.place_choice(&p, index)?,
                    Val::Opaque(g, _) => Val::Opaque(g, Some(index)),
                    Val::Data(d) => {
                        let count = self.value_parts(base)?;
                        Val::Data(self.choose(&d, index, count)?.into())
                    }
                }
            }
            Expression::AccessIndex { base, index } => match self.eval(base)? {
                Val::Place(p) => self.place_part(&p, index)?,
                Val::Opaque(g, _) => {
                    let index = self.b.constant(index);
                    Val::Opaque(g, Some(index))
                }
                Val::Data(d) => {
                    if matches!(self.inner(base), TypeInner::Struct { .. }) {
                        self.spend(index as usize / 8)?;
                    }
                    let (first, n) = self.value_part(base, index)?;
                    Val::Data(d[first..first + n].into())
                }
            },
            Expression::Splat { size, value } => {
                let v = self.scalar(value)?;
                Val::Data(vec![v; size as usize].into())
            }
            Expression::Swizzle { size, vector, pattern } => {
                let d = self.data(vector)?;
                Val::Data(pattern[..size as usize].iter().map(|&p| d[p as usize]).collect())
            }
            Expression::FunctionArgument(i) => self.frame().args[i as usize].clone(),
            Expression::GlobalVariable(g) => match self.globals.get(&g) {
                Some(v) => v.clone(),
                None => return self.refuse("this global variable has an unsupported address space or type"),
            },
            Expression::LocalVariable(l) => {
                let var = self.frame().locals[l.index()];
                let ty = Ty::Named(function.local_variables[l].ty);
                Val::Place(Rc::new(self.variable_place(var, ty)))
            }
            Expression::Load { pointer } => {
                let place = self.place(pointer)?;
                self.load(&place)?
            }
            Expression::ImageSample { .. } => self.image_sample(h)?,
            Expression::ImageLoad { image, coordinate, array_index, sample, level } => {
                self.image_load(image, coordinate, array_index, sample, level)?
            }
            Expression::ImageQuery { image, query } => self.image_query(image, query)?,
            Expression::Unary { op, expr } => self.unary(op, expr)?,
            Expression::Binary { op, left, right } => self.binary(op, left, right)?,
            Expression::Select { condition, accept, reject } => {
                let (c, a, r) = (self.data(condition)?, self.data(accept)?, self.data(reject)?);
                let c = |i: usize| c[i.min(c.len() - 1)];
                Val::Data((0..a.len()).map(|i| self.b.op(Code::Select, &[c(i), a[i], r[i]])).collect())
            }
            Expression::Derivative { axis, ctrl, expr } => self.derivative(axis, ctrl, expr)?,
            Expression::Relational { fun, argument } => {
                let d = self.data(argument)?;
                let all = |s: &mut Self, code| d[1..].iter().fold(d[0], |a, &b| s.b.op(code, &[a, b]));
                match fun {
                    RelationalFunction::All => Val::Data([all(self, Code::And)].into()),
                    RelationalFunction::Any => Val::Data([all(self, Code::Or)].into()),
                    RelationalFunction::IsNan => self.map(&d, Code::FIsNan),
                    RelationalFunction::IsInf => self.map(&d, Code::FIsInf),
                }
            }
            Expression::Math { fun, arg, arg1, arg2, arg3 } => {
                self.math(fun, arg, [arg1, arg2, arg3].into_iter().flatten().collect())?
            }
            Expression::As { expr, kind, convert } => self.cast(expr, kind, convert)?,
            Expression::ArrayLength(pointer) => self.array_length(pointer)?,
            // Statements set these; an unset one belongs to a statement that never ran.
            Expression::CallResult(_)
            | Expression::AtomicResult { .. }
            | Expression::WorkGroupUniformLoadResult { .. }
            | Expression::SubgroupBallotResult
            | Expression::SubgroupOperationResult { .. } => {
                return self.refuse("a result is used before its statement");
            }
            Expression::RayQueryVertexPositions { .. }
            | Expression::RayQueryProceedResult
            | Expression::RayQueryGetIntersection { .. } => return self.refuse("ray queries are not supported"),
            Expression::CooperativeLoad { .. } | Expression::CooperativeMultiplyAdd { .. } => {
                return self.refuse("cooperative matrices are not supported");
            }
        })
    }

    /// Number of parts of a value.
    fn value_parts(&self, h: Handle<Expression>) -> Result<u32> {
        Ok(match *self.inner(h) {
            TypeInner::Vector { size, .. } => size as u32,
            TypeInner::Matrix { columns, .. } => columns as u32,
            TypeInner::Array { size, .. } => match self.types.length(size) {
                Some(n) => n,
                None => return self.refuse("a value without a fixed length is indexed"),
            },
            _ => return self.refuse("this value cannot be indexed at run time"),
        })
    }

    /// First component and number of components of a part of a value.
    fn value_part(&self, h: Handle<Expression>, index: u32) -> Result<(usize, usize)> {
        Ok(match *self.inner(h) {
            TypeInner::Vector { .. } => (index as usize, 1),
            TypeInner::Matrix { rows, .. } => (index as usize * rows as usize, rows as usize),
            TypeInner::Array { base, .. } => {
                let n = self.types.components(Ty::Named(base)) as usize;
                (index as usize * n, n)
            }
            TypeInner::Struct { ref members, .. } => {
                let n = |m: &naga::StructMember| self.types.components(Ty::Named(m.ty)) as usize;
                let i = index as usize;
                (members[..i].iter().map(n).sum(), n(&members[i]))
            }
            _ => return self.refuse("this value has no parts"),
        })
    }

    /// One operation on each component.
    pub fn map(&mut self, d: &[V], code: Code) -> Val {
        Val::Data(d.iter().map(|&v| self.b.op(code, &[v])).collect())
    }

    /// Rounds to `f16` where that is the type.
    pub fn rounded(&mut self, v: V, scalar: Scalar) -> V {
        if is_half(scalar) { self.b.op(Code::Quantize, &[v]) } else { v }
    }

    pub fn scalar_of(&self, h: Handle<Expression>) -> Result<Scalar> {
        match self.types.scalar(self.inner(h)) {
            Some(s) if s.width > 4 => self.refuse("64-bit numbers are not supported"),
            Some(s) if s.width == 2 && s.kind != ScalarKind::Float => self.refuse("16-bit integers are not supported"),
            Some(s) => Ok(s),
            None => self.refuse("not a scalar, vector or matrix"),
        }
    }

    fn unary(&mut self, op: UnaryOperator, expr: Handle<Expression>) -> Result<Val> {
        let scalar = self.scalar_of(expr)?;
        let d = self.data(expr)?;
        let code = match (op, scalar.kind) {
            (UnaryOperator::Negate, ScalarKind::Float) => Code::FNeg,
            (UnaryOperator::Negate, _) => Code::INeg,
            (UnaryOperator::LogicalNot, _) | (UnaryOperator::BitwiseNot, ScalarKind::Bool) => Code::BNot,
            (UnaryOperator::BitwiseNot, _) => Code::INot,
        };
        Ok(self.map(&d, code))
    }

    fn binary(&mut self, op: BinaryOperator, left: Handle<Expression>, right: Handle<Expression>) -> Result<Val> {
        let scalar = self.scalar_of(left)?;
        let (a, b) = (self.data(left)?, self.data(right)?);
        if op == BinaryOperator::Multiply {
            match (self.inner(left), self.inner(right)) {
                (&TypeInner::Matrix { columns, rows, .. }, &TypeInner::Vector { .. }) => {
                    return Ok(self.matrix_vector(&a, &b, columns as usize, rows as usize, scalar));
                }
                (&TypeInner::Vector { .. }, &TypeInner::Matrix { columns, rows, .. }) => {
                    let rows = rows as usize;
                    let out: Vec<V> =
                        (0..columns as usize).map(|c| self.dot(&a, &b[c * rows..(c + 1) * rows], scalar)).collect();
                    return Ok(Val::Data(out.into()));
                }
                (&TypeInner::Matrix { columns: inner, rows, .. }, &TypeInner::Matrix { columns, .. }) => {
                    let (inner, rows) = (inner as usize, rows as usize);
                    let mut out = Vec::new();
                    for c in 0..columns as usize {
                        let column = &b[c * inner..(c + 1) * inner];
                        if let Val::Data(d) = self.matrix_vector(&a, column, inner, rows, scalar) {
                            out.extend_from_slice(&d);
                        }
                    }
                    return Ok(Val::Data(out.into()));
                }
                _ => {}
            }
        }
        let n = a.len().max(b.len());
        let at = |d: &[V], i: usize| d[if d.len() == 1 { 0 } else { i }];
        (0..n).map(|i| self.binary_scalar(op, scalar, at(&a, i), at(&b, i))).collect::<Result<Rc<[V]>>>().map(Val::Data)
    }

    fn binary_scalar(&mut self, op: BinaryOperator, scalar: Scalar, a: V, b: V) -> Result<V> {
        use BinaryOperator as B;
        let float = scalar.kind == ScalarKind::Float;
        let signed = scalar.kind == ScalarKind::Sint;
        let pick = |f: Code, s: Code, u: Code| {
            if float {
                f
            } else if signed {
                s
            } else {
                u
            }
        };
        let (code, swap) = match op {
            B::Add => (pick(Code::FAdd, Code::IAdd, Code::IAdd), false),
            B::Subtract => (pick(Code::FSub, Code::ISub, Code::ISub), false),
            B::Multiply => (pick(Code::FMul, Code::IMul, Code::IMul), false),
            B::Divide => (pick(Code::FDiv, Code::SDiv, Code::UDiv), false),
            B::Modulo => (pick(Code::FRem, Code::SRem, Code::URem), false),
            B::Equal => (pick(Code::FEq, Code::IEq, Code::IEq), false),
            B::NotEqual => (pick(Code::FNe, Code::INe, Code::INe), false),
            B::Less => (pick(Code::FLt, Code::SLt, Code::ULt), false),
            B::LessEqual => (pick(Code::FLe, Code::SLe, Code::ULe), false),
            B::Greater => (pick(Code::FLt, Code::SLt, Code::ULt), true),
            B::GreaterEqual => (pick(Code::FLe, Code::SLe, Code::ULe), true),
            B::And | B::LogicalAnd => (Code::And, false),
            B::InclusiveOr | B::LogicalOr => (Code::Or, false),
            B::ExclusiveOr => (Code::Xor, false),
            B::ShiftLeft => (Code::Shl, false),
            B::ShiftRight => (if signed { Code::ShrS } else { Code::ShrU }, false),
        };
        let v = self.b.op(code, &if swap { [b, a] } else { [a, b] });
        let arithmetic = matches!(op, B::Add | B::Subtract | B::Multiply | B::Divide | B::Modulo);
        Ok(if arithmetic { self.rounded(v, scalar) } else { v })
    }

    fn matrix_vector(&mut self, m: &[V], v: &[V], columns: usize, rows: usize, scalar: Scalar) -> Val {
        let out: Vec<V> = (0..rows)
            .map(|r| {
                let row: Vec<V> = (0..columns).map(|c| m[c * rows + r]).collect();
                self.dot(&row, v, scalar)
            })
            .collect();
        Val::Data(out.into())
    }

    /// Dot product of floating-point vectors, summed from the first component on.
    pub fn dot(&mut self, a: &[V], b: &[V], scalar: Scalar) -> V {
        if is_half(scalar) {
            let mut sum = None;
            for (&x, &y) in a.iter().zip(b) {
                let p = self.b.op(Code::FMul, &[x, y]);
                let p = self.rounded(p, scalar);
                sum = Some(match sum {
                    None => p,
                    Some(s) => {
                        let s = self.b.op(Code::FAdd, &[s, p]);
                        self.rounded(s, scalar)
                    }
                });
            }
            return sum.unwrap_or(NONE);
        }
        // Terms that are exactly zero or one are common (w = 1 of a position): they need no multiplication.
        let known = |s: &Self, v: V| s.b.known(v).map(f32::from_bits);
        if a.iter().chain(b).any(|&v| matches!(known(self, v), Some(x) if x == 1.0)) {
            let mut sum = None;
            for (&x, &y) in a.iter().zip(b) {
                let p = self.b.op(Code::FMul, &[x, y]);
                sum = Some(sum.map_or(p, |s| self.b.op(Code::FAdd, &[s, p])));
            }
            return sum.unwrap_or(NONE);
        }
        let code = match a.len() {
            2 => Code::Dot2,
            3 => Code::Dot3,
            _ => Code::Dot4,
        };
        let operands: Vec<V> = a.iter().chain(b).copied().collect();
        self.b.op(code, &operands)
    }

    fn derivative(&mut self, axis: DerivativeAxis, ctrl: DerivativeControl, expr: Handle<Expression>) -> Result<Val> {
        self.flags.derivatives = true;
        // Where the program leaves the choice, the fine derivative is taken, as in lavapipe.
        let fine = u32::from(ctrl != DerivativeControl::Coarse);
        let scalar = self.scalar_of(expr)?;
        let d = self.data(expr)?;
        let one = |s: &mut Self, v: V, kind: u32| {
            // The difference of a value that all lanes share is 0, except that infinity minus infinity is NaN, as in any difference.
            if s.b.is_uniform(v) {
                return s.b.op(Code::FSub, &[v, v]);
            }
            let d = s.b.ops(Code::Derivative, &[v], kind, 1, false);
            s.rounded(d, scalar)
        };
        Ok(Val::Data(
            d.iter()
                .map(|&v| match axis {
                    DerivativeAxis::X => one(self, v, fine),
                    DerivativeAxis::Y => one(self, v, 2 + fine),
                    DerivativeAxis::Width => {
                        let (x, y) = (one(self, v, fine), one(self, v, 2 + fine));
                        let (x, y) = (self.b.op(Code::FAbs, &[x]), self.b.op(Code::FAbs, &[y]));
                        let sum = self.b.op(Code::FAdd, &[x, y]);
                        self.rounded(sum, scalar)
                    }
                })
                .collect(),
        ))
    }

    fn cast(&mut self, expr: Handle<Expression>, kind: ScalarKind, convert: Option<u8>) -> Result<Val> {
        let from = self.scalar_of(expr)?;
        let d = self.data(expr)?;
        let Some(width) = convert else {
            // One number of 16 bits, or three, have as many bits as floating-point numbers of their own type only.
            if is_half(from) && (kind != ScalarKind::Float || matches!(d.len(), 2 | 4)) {
                return self.refuse("bitcast of 16-bit floating-point numbers is not supported");
            }
            return Ok(Val::Data(d));
        };
        if width > 4 {
            return self.refuse("64-bit numbers are not supported");
        }
        if width == 2 && kind != ScalarKind::Float {
            return self.refuse("16-bit integers are not supported");
        }
        let to = Scalar { kind, width };
        use ScalarKind as K;
        let code = match (from.kind, kind) {
            (K::Float, K::Float) => {
                return Ok(Val::Data(d.iter().map(|&v| self.rounded(v, to)).collect()));
            }
            (K::Float, K::Sint) if is_half(from) => Code::HalfToS,
            (K::Float, K::Uint) if is_half(from) => Code::HalfToU,
            (K::Float, K::Sint) => Code::FToS,
            (K::Float, K::Uint) => Code::FToU,
            (K::Float, K::Bool) => Code::FToBool,
            (K::Sint, K::Float) => Code::SToF,
            (K::Uint, K::Float) => Code::UToF,
            (K::Bool, K::Float) => Code::BoolToF,
            (K::Sint | K::Uint, K::Bool) => Code::IToBool,
            _ => return Ok(Val::Data(d)),
        };
        let out: Vec<V> = d
            .iter()
            .map(|&v| {
                let v = self.b.op(code, &[v]);
                if kind == K::Float { self.rounded(v, to) } else { v }
            })
            .collect();
        Ok(Val::Data(out.into()))
    }

    fn array_length(&mut self, pointer: Handle<Expression>) -> Result<Val> {
        let place = self.place(pointer)?;
        let (Root::Memory { space: Space::Buffer(binding), .. }, Some((offset, stride))) =
            (place.root, self.runtime_array(place.ty))
        else {
            return self.refuse("arrayLength of something that is not a runtime-sized array in a buffer");
        };
        let element = place.element.unwrap_or(NONE);
        let entry = self.b.length_entry(binding, place.offset + offset, stride);
        let v = self.b.ops(Code::ArrayLength, &[element], entry, 1, true);
        Ok(Val::Data([v].into()))
    }
}
