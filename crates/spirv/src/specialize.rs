//! Specialization constants become constants, with the values that the pipeline gives them.

use std::collections::{HashMap, HashSet};

use grammar::{BuiltIn, Decoration as D, ExecutionMode, Op};
use half::f16;

use crate::words::{Inst, Parts, Type};
use crate::{Constant, Refusal, Stage};

/// Values that folding may write: more than any program has, few enough for memory.
const VALUES: usize = 1 << 20;

/// The value of a constant.
#[derive(Clone, Debug)]
enum Value {
    /// The bits of a number, zero above its width; 0 or 1 of a boolean.
    Scalar(u64),
    /// The ids of its parts.
    Composite(Vec<u32>),
    /// Zero in all parts.
    Null,
}

/// The kind and width of a scalar.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Scalar {
    Bool,
    Int { bits: u32, signed: bool },
    Float { bits: u32 },
}

impl Scalar {
    fn bits(self) -> u32 {
        match self {
            Scalar::Bool => 1,
            Scalar::Int { bits, .. } | Scalar::Float { bits } => bits.clamp(1, 64),
        }
    }

    fn mask(self, value: u64) -> u64 {
        value & (u64::MAX >> (64 - self.bits()))
    }

    /// A number of this width with its sign.
    fn signed(self, value: u64) -> i64 {
        let unused = 64 - self.bits();
        (value << unused) as i64 >> unused
    }
}

/// Gives each specialization constant its value, folds what is computed from them, and sets the size of workgroups.
///
/// # Errors
/// If a value has the wrong size, or something is computed that Vulkan does not allow.
pub fn rewrite(parts: &mut Parts, function: u32, stage: Stage, given: &[Constant<'_>]) -> Result<(), Refusal> {
    // Of several values for a constant, the first holds.
    let given: HashMap<u32, &Constant<'_>> = given.iter().rev().map(|constant| (constant.id, constant)).collect();
    let ids: HashMap<u32, u32> = decorated(parts, D::SpecId).collect();
    let sizes: Vec<u32> =
        decorated(parts, D::BuiltIn).filter(|&(_, of)| of == BuiltIn::WorkgroupSize as u32).map(|(id, _)| id).collect();
    let globals = std::mem::take(&mut parts.globals);
    let mut folder =
        Folder { types: HashMap::new(), values: HashMap::new(), out: Vec::with_capacity(globals.len()), written: 0, parts };
    for inst in globals {
        folder.declaration(inst, &ids, &given)?;
    }
    let mut size = None;
    for id in sizes.iter().filter(|id| folder.values.contains_key(id)) {
        size = Some(folder.triple(*id));
    }
    let mut globals = std::mem::take(&mut folder.out);
    let sizes: HashSet<u32> = sizes.into_iter().collect();
    for inst in &mut globals {
        if inst.op != Op::ExecutionModeId {
            continue;
        }
        if inst.operand(1) != ExecutionMode::LocalSizeId as u32 || inst.operands.len() != 5 {
            return Err(inst.refuse(format!("execution mode {} is not supported", inst.operand(1))));
        }
        let value = |id: &u32| folder.scalar(*id).map(|value| value as u32);
        let Some(three) = inst.from(2).iter().map(value).collect::<Option<Vec<u32>>>() else {
            return Err(inst.refuse("the size of workgroups is no constant"));
        };
        inst.op = Op::ExecutionMode;
        inst.operands = vec![function, ExecutionMode::LocalSize as u32];
        inst.operands.extend(three);
    }
    globals.retain(|inst| {
        let is_size = inst.operand(1) == D::BuiltIn as u32 && sizes.contains(&inst.operand(0));
        !(inst.op == Op::Decorate && (inst.operand(1) == D::SpecId as u32 || is_size))
    });
    // The size that is decorated wins over that of the execution mode.
    if let (Stage::Compute, Some(size)) = (stage, size) {
        let Some([x, y, z]) = size else {
            return Err(Refusal {
                word: 0,
                instruction: "OpDecorate".to_owned(),
                reason: "the size of workgroups is no constant of three numbers".to_owned(),
            });
        };
        globals.retain(|inst| !(inst.op == Op::ExecutionMode && inst.operand(1) == ExecutionMode::LocalSize as u32));
        let behind = globals.iter().rposition(|inst| inst.op == Op::EntryPoint).map_or(0, |at| at + 1);
        let at = globals.get(behind.saturating_sub(1)).map_or(5, |inst| inst.at);
        let operands = vec![function, ExecutionMode::LocalSize as u32, x, y, z];
        globals.insert(behind, Inst { at, op: Op::ExecutionMode, operands });
    }
    parts.globals = globals;
    Ok(())
}

/// The ids with a decoration, and its operand.
fn decorated(parts: &Parts, kind: D) -> impl Iterator<Item = (u32, u32)> {
    let of_kind = move |inst: &&Inst| inst.op == Op::Decorate && inst.operand(1) == kind as u32;
    parts.globals.iter().filter(of_kind).map(|inst| (inst.operand(0), inst.operand(2)))
}

struct Folder<'p> {
    parts: &'p mut Parts,
    types: HashMap<u32, Type>,
    /// Types and values of constants.
    values: HashMap<u32, (u32, Value)>,
    out: Vec<Inst>,
    /// Parts of values that were written.
    written: usize,
}

impl Folder<'_> {
    fn declaration(
        &mut self,
        mut inst: Inst,
        ids: &HashMap<u32, u32>,
        given: &HashMap<u32, &Constant<'_>>,
    ) -> Result<(), Refusal> {
        if let Some((id, ty)) = Parts::type_of(&inst) {
            self.types.insert(id, ty);
            self.out.push(inst);
            return Ok(());
        }
        let (ty, id) = (inst.operand(0), inst.operand(1));
        let own = |id: &u32| ids.get(id).and_then(|number| given.get(number).copied());
        let value = match inst.op {
            Op::Constant => self.constant(&inst)?,
            Op::ConstantTrue | Op::ConstantFalse => Value::Scalar((inst.op == Op::ConstantTrue).into()),
            Op::ConstantNull | Op::Undef => Value::Null,
            Op::ConstantComposite => Value::Composite(inst.from(2).to_vec()),
            Op::SpecConstantComposite => {
                inst.op = Op::ConstantComposite;
                Value::Composite(inst.from(2).to_vec())
            }
            Op::SpecConstantTrue | Op::SpecConstantFalse => {
                let value = match own(&id) {
                    Some(constant) => self.given(&inst, constant, 4)? != 0,
                    None => inst.op == Op::SpecConstantTrue,
                };
                return self.write(&inst, ty, id, Value::Scalar(value.into()));
            }
            Op::SpecConstant => {
                let value = match own(&id) {
                    Some(constant) => {
                        let bits = self.scalar_type(ty).map_or(0, Scalar::bits);
                        Value::Scalar(self.given(&inst, constant, bits as usize / 8)?)
                    }
                    None => self.constant(&inst)?,
                };
                return self.write(&inst, ty, id, value);
            }
            Op::SpecConstantOp => {
                let value = self.fold(&inst, ty)?;
                return self.write(&inst, ty, id, value);
            }
            _ => {
                self.out.push(inst);
                return Ok(());
            }
        };
        self.values.insert(id, (ty, value));
        self.out.push(inst);
        Ok(())
    }

    /// The number that the pipeline gives.
    fn given(&self, inst: &Inst, constant: &Constant<'_>, bytes: usize) -> Result<u64, Refusal> {
        if constant.bytes.len() != bytes || bytes > 8 {
            let (id, given) = (constant.id, constant.bytes.len());
            return Err(inst.refuse(format!("the pipeline gives {given} bytes for constant {id}, which has {bytes}")));
        }
        let mut all = [0; 8];
        all[..bytes].copy_from_slice(constant.bytes);
        Ok(u64::from_le_bytes(all))
    }

    fn constant(&self, inst: &Inst) -> Result<Value, Refusal> {
        let Some(scalar) = self.scalar_type(inst.operand(0)) else { return Err(inst.refuse("its type is no number")) };
        let all = u64::from(inst.operand(2)) | (u64::from(inst.operand(3)) << 32);
        Ok(Value::Scalar(scalar.mask(all)))
    }

    fn scalar_type(&self, ty: u32) -> Option<Scalar> {
        match *self.types.get(&ty)? {
            Type::Bool => Some(Scalar::Bool),
            Type::Int { bits, signed } => Some(Scalar::Int { bits, signed }),
            Type::Float { bits } => Some(Scalar::Float { bits }),
            _ => None,
        }
    }

    /// The type of the components of a scalar or a vector, and their number.
    fn shape(&self, ty: u32) -> Option<(Scalar, u32, usize)> {
        match *self.types.get(&ty)? {
            Type::Vector { of, count: 1..=4 } => {
                let Type::Vector { count, .. } = self.types[&ty] else { return None };
                Some((self.scalar_type(of)?, of, count as usize))
            }
            _ => Some((self.scalar_type(ty)?, ty, 1)),
        }
    }

    fn scalar(&self, id: u32) -> Option<u64> {
        let (ty, value) = self.values.get(&id)?;
        self.scalar_type(*ty)?;
        match value {
            Value::Scalar(value) => Some(*value),
            Value::Null => Some(0),
            Value::Composite(_) => None,
        }
    }

    /// The components of a scalar or a vector, and their type.
    fn components(&self, id: u32) -> Option<(Scalar, Vec<u64>)> {
        let (ty, value) = self.values.get(&id)?;
        let (scalar, _, count) = self.shape(*ty)?;
        let components = match value {
            Value::Scalar(value) => vec![*value],
            Value::Null => vec![0; count],
            Value::Composite(ids) => ids.iter().map(|&id| self.scalar(id)).collect::<Option<_>>()?,
        };
        (components.len() == count).then_some((scalar, components))
    }

    fn triple(&self, id: u32) -> Option<[u32; 3]> {
        let (_, components) = self.components(id)?;
        let words: Vec<u32> = components.iter().map(|&value| value as u32).collect();
        words.try_into().ok()
    }

    /// Writes a constant.
    fn write(&mut self, inst: &Inst, ty: u32, id: u32, value: Value) -> Result<(), Refusal> {
        let at = inst.at;
        let (op, operands) = match (&value, self.scalar_type(ty)) {
            (Value::Scalar(0), Some(Scalar::Bool)) => (Op::ConstantFalse, vec![ty, id]),
            (Value::Scalar(_), Some(Scalar::Bool)) => (Op::ConstantTrue, vec![ty, id]),
            (Value::Scalar(number), Some(scalar)) => {
                let all =
                    if matches!(scalar, Scalar::Int { signed: true, .. }) { scalar.signed(*number) as u64 } else { *number };
                let words = if scalar.bits() > 32 { vec![all as u32, (all >> 32) as u32] } else { vec![all as u32] };
                (Op::Constant, [ty, id].into_iter().chain(words).collect())
            }
            (Value::Scalar(_), None) => return Err(inst.refuse("its type is no number")),
            (Value::Composite(ids), _) => (Op::ConstantComposite, [ty, id].iter().chain(ids).copied().collect()),
            (Value::Null, _) => (Op::ConstantNull, vec![ty, id]),
        };
        self.written += operands.len();
        if self.written > VALUES {
            return Err(inst.refuse("constants are computed with more parts than are supported"));
        }
        self.out.push(Inst { at, op, operands });
        self.values.insert(id, (ty, value));
        Ok(())
    }

    /// Writes a scalar or vector of these components as a value.
    fn value(&mut self, inst: &Inst, ty: u32, components: &[u64]) -> Result<Value, Refusal> {
        let shape = self.shape(ty).filter(|&(.., count)| count == components.len());
        let (scalar, of, count) = shape.ok_or_else(|| inst.refuse("its type does not fit what it computes"))?;
        if count == 1 {
            return Ok(Value::Scalar(scalar.mask(components[0])));
        }
        let mut ids = Vec::new();
        for &component in components {
            let id = self.parts.fresh();
            self.write(inst, of, id, Value::Scalar(scalar.mask(component)))?;
            ids.push(id);
        }
        Ok(Value::Composite(ids))
    }

    /// The value of an operation on constants.
    fn fold(&mut self, inst: &Inst, ty: u32) -> Result<Value, Refusal> {
        let unknown = || inst.refuse(format!("operation {} of specialization constants is not supported", inst.operand(2)));
        let op = Op::from_u32(inst.operand(2)).ok_or_else(unknown)?;
        let arguments = inst.from(3);
        let no_constant = || inst.refuse("an operand is no constant of the type that it needs");
        match op {
            Op::CompositeExtract => {
                let (&of, path) = arguments.split_first().ok_or_else(no_constant)?;
                let mut value = &self.values.get(&of).ok_or_else(no_constant)?.1;
                for &index in path {
                    value = match value {
                        Value::Composite(ids) => {
                            let part = ids.get(index as usize).and_then(|id| self.values.get(id));
                            &part.ok_or_else(no_constant)?.1
                        }
                        Value::Null => &Value::Null,
                        Value::Scalar(_) => return Err(no_constant()),
                    };
                }
                return Ok(match value {
                    // A constant of zero has its own form where it is a number.
                    Value::Null if self.scalar_type(ty).is_some() => Value::Scalar(0),
                    value => value.clone(),
                });
            }
            Op::CompositeInsert => {
                let [object, into, path @ ..] = arguments else { return Err(no_constant()) };
                return self.insert(inst, *object, *into, path);
            }
            Op::VectorShuffle => {
                let [a, b, picks @ ..] = arguments else { return Err(no_constant()) };
                let (_, mut all) = self.components(*a).ok_or_else(no_constant)?;
                all.extend(self.components(*b).ok_or_else(no_constant)?.1);
                // A component without a number is undefined.
                let picked: Option<Vec<u64>> =
                    picks.iter().map(|&n| if n == u32::MAX { Some(0) } else { all.get(n as usize).copied() }).collect();
                return self.value(inst, ty, &picked.ok_or_else(no_constant)?);
            }
            Op::Select if arguments.len() == 3 && self.scalar(arguments[0]).is_some() => {
                let chosen = if self.scalar(arguments[0]) == Some(0) { arguments[2] } else { arguments[1] };
                return Ok(self.values.get(&chosen).ok_or_else(no_constant)?.1.clone());
            }
            _ => {}
        }
        let (result, _, count) = self.shape(ty).ok_or_else(|| inst.refuse("its type is no number and no vector"))?;
        let operands: Vec<(Scalar, Vec<u64>)> =
            arguments.iter().map(|&id| self.components(id)).collect::<Option<_>>().ok_or_else(no_constant)?;
        let mut components = Vec::new();
        for n in 0..count {
            let each: Option<Vec<(Scalar, u64)>> = operands.iter().map(|(scalar, all)| Some((*scalar, *all.get(n)?))).collect();
            components.push(operation(op, result, &each.ok_or_else(no_constant)?).ok_or_else(unknown)?);
        }
        self.value(inst, ty, &components)
    }

    /// The value of a composite with one part replaced.
    fn insert(&mut self, inst: &Inst, object: u32, into: u32, path: &[u32]) -> Result<Value, Refusal> {
        let wrong = || inst.refuse("an operand is no constant of the type that it needs");
        let Some((&index, rest)) = path.split_first() else {
            return Ok(self.values.get(&object).ok_or_else(wrong)?.1.clone());
        };
        // The composites on the path, from the outermost.
        let mut levels: Vec<(u32, Vec<u32>, usize)> = Vec::new();
        let mut of = into;
        for &index in [index].iter().chain(rest) {
            let (ty, value) = self.values.get(&of).cloned().ok_or_else(wrong)?;
            let parts = match value {
                Value::Composite(ids) => ids,
                Value::Null => self.nulls(inst, ty)?,
                Value::Scalar(_) => return Err(wrong()),
            };
            of = *parts.get(index as usize).ok_or_else(wrong)?;
            self.written += parts.len();
            if self.written > VALUES {
                return Err(inst.refuse("constants are computed with more parts than are supported"));
            }
            levels.push((ty, parts, index as usize));
        }
        let mut part = object;
        while let Some((ty, mut parts, index)) = levels.pop() {
            parts[index] = part;
            if levels.is_empty() {
                return Ok(Value::Composite(parts));
            }
            part = self.parts.fresh();
            self.write(inst, ty, part, Value::Composite(parts))?;
        }
        Err(wrong())
    }

    /// The parts of a composite that is zero.
    fn nulls(&mut self, inst: &Inst, ty: u32) -> Result<Vec<u32>, Refusal> {
        let wrong = || inst.refuse("an operand is no constant of the type that it needs");
        let types = match self.types.get(&ty) {
            Some(&Type::Vector { of, count }) => vec![of; count.min(4) as usize],
            Some(&Type::Matrix { column, count }) => vec![column; count.min(4) as usize],
            Some(&Type::Array { of, length }) => {
                let length = self.scalar(length).filter(|&length| length <= VALUES as u64).ok_or_else(wrong)?;
                vec![of; length as usize]
            }
            Some(Type::Struct { members }) => members.clone(),
            _ => return Err(wrong()),
        };
        let mut ids: HashMap<u32, u32> = HashMap::new();
        let mut all = Vec::with_capacity(types.len());
        for ty in types {
            let id = match ids.get(&ty) {
                Some(&id) => id,
                None => {
                    let id = self.parts.fresh();
                    self.write(inst, ty, id, Value::Null)?;
                    ids.insert(ty, id);
                    id
                }
            };
            all.push(id);
        }
        Ok(all)
    }
}

/// An operation on components; None where it is none that Vulkan allows for specialization constants.
fn operation(op: Op, result: Scalar, operands: &[(Scalar, u64)]) -> Option<u64> {
    let (scalar, a) = *operands.first()?;
    let b = operands.get(1).map(|&(_, b)| b);
    let is_bool = scalar == Scalar::Bool;
    let is_int = matches!(scalar, Scalar::Int { .. });
    let value = match op {
        Op::SConvert if is_int => scalar.signed(a) as u64,
        Op::UConvert if is_int => a,
        Op::FConvert => from_float(result, to_float(scalar, a)?)?,
        Op::QuantizeToF16 => quantize(f32::from_bits(u32::try_from(a).ok()?)).to_bits().into(),
        Op::SNegate if is_int => a.wrapping_neg(),
        Op::Not if is_int => !a,
        Op::LogicalNot if is_bool => a ^ 1,
        Op::LogicalOr if is_bool => a | b?,
        Op::LogicalAnd if is_bool => a & b?,
        Op::LogicalEqual if is_bool => (a == b?).into(),
        Op::LogicalNotEqual if is_bool => (a != b?).into(),
        Op::Select if is_bool => {
            let [_, yes, no] = operands else { return None };
            if a != 0 { yes.1 } else { no.1 }
        }
        _ if is_int => integer(op, scalar, a, b?)?,
        _ => return None,
    };
    Some(result.mask(value))
}

/// An operation on two whole numbers. What is undefined is zero, as `spirv-opt` has it.
fn integer(op: Op, scalar: Scalar, a: u64, b: u64) -> Option<u64> {
    let (x, y) = (scalar.signed(a), scalar.signed(b));
    let bits = u64::from(scalar.bits());
    Some(match op {
        Op::IAdd => a.wrapping_add(b),
        Op::ISub => a.wrapping_sub(b),
        Op::IMul => a.wrapping_mul(b),
        Op::UDiv => a.checked_div(b).unwrap_or(0),
        Op::UMod => a.checked_rem(b).unwrap_or(0),
        Op::SDiv if y == 0 => 0,
        Op::SDiv => x.wrapping_div(y) as u64,
        Op::SRem | Op::SMod if y == 0 => 0,
        Op::SRem => x.wrapping_rem(y) as u64,
        // The remainder has the sign of the divisor.
        Op::SMod => {
            let rest = x.wrapping_rem(y);
            (if rest != 0 && (rest < 0) != (y < 0) { rest.wrapping_add(y) } else { rest }) as u64
        }
        Op::ShiftRightLogical if b < bits => a >> b,
        Op::ShiftRightArithmetic if b < bits => (x >> b) as u64,
        Op::ShiftLeftLogical if b < bits => a << b,
        Op::ShiftRightLogical | Op::ShiftRightArithmetic | Op::ShiftLeftLogical => 0,
        Op::BitwiseOr => a | b,
        Op::BitwiseXor => a ^ b,
        Op::BitwiseAnd => a & b,
        Op::IEqual => (a == b).into(),
        Op::INotEqual => (a != b).into(),
        Op::ULessThan => (a < b).into(),
        Op::ULessThanEqual => (a <= b).into(),
        Op::UGreaterThan => (a > b).into(),
        Op::UGreaterThanEqual => (a >= b).into(),
        Op::SLessThan => (x < y).into(),
        Op::SLessThanEqual => (x <= y).into(),
        Op::SGreaterThan => (x > y).into(),
        Op::SGreaterThanEqual => (x >= y).into(),
        _ => return None,
    })
}

fn to_float(scalar: Scalar, bits: u64) -> Option<f64> {
    match scalar {
        Scalar::Float { bits: 16 } => Some(f16::from_bits(bits as u16).to_f64()),
        Scalar::Float { bits: 32 } => Some(f32::from_bits(bits as u32).into()),
        Scalar::Float { bits: 64 } => Some(f64::from_bits(bits)),
        _ => None,
    }
}

fn from_float(scalar: Scalar, value: f64) -> Option<u64> {
    match scalar {
        Scalar::Float { bits: 16 } => Some(f16::from_f64(value).to_bits().into()),
        Scalar::Float { bits: 32 } => Some((value as f32).to_bits().into()),
        Scalar::Float { bits: 64 } => Some(value.to_bits()),
        _ => None,
    }
}

/// The number that 16 bits hold nearest to this one; zero where that would be denormal.
fn quantize(value: f32) -> f32 {
    let half = f16::from_f32(value);
    if half.is_normal() || !half.is_finite() { half.to_f32() } else { 0f32.copysign(value) }
}
