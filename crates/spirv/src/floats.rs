//! Operations on floating-point numbers that naga does not read: both parts of a number, and rounding to 16 bits.

use std::collections::HashMap;

use grammar::{GlslStd450Op, Op};

use crate::Refusal;
use crate::words::{Code, Inst, Parts, Type, glsl};

/// Rewrites `Modf`, `ModfStruct` and `OpQuantizeToF16`.
///
/// # Errors
/// If one has a type that is no number and no vector.
pub fn rewrite(parts: &mut Parts) -> Result<(), Refusal> {
    let is_rewritten = |inst: &Inst| inst.op == Op::QuantizeToF16 || splits(inst);
    if !parts.functions.iter().flatten().any(is_rewritten) {
        return Ok(());
    }
    let set = glsl(parts);
    let (types, values) = (parts.types(), parts.values());
    for function in std::mem::take(&mut parts.functions) {
        let mut out = Code::default();
        for inst in function {
            let (at, ty, id) = (inst.at, inst.operand(0), inst.operand(1));
            if inst.op == Op::QuantizeToF16 {
                quantize(parts, &types, set, &inst, &mut out)?;
            } else if splits(&inst) && inst.operand(2) == set {
                let x = inst.operand(4);
                let Some(&of) = values.get(&x) else { return Err(inst.refuse("its operand is no value")) };
                let (whole, rest) = (parts.fresh(), parts.fresh());
                out.0.push(Inst { at, op: Op::ExtInst, operands: vec![of, whole, set, GlslStd450Op::Trunc as u32, x] });
                let is_structure = inst.operand(3) == GlslStd450Op::ModfStruct as u32;
                out.0.push(Inst { at, op: Op::FSub, operands: vec![of, if is_structure { rest } else { id }, x, whole] });
                if is_structure {
                    out.0.push(Inst { at, op: Op::CompositeConstruct, operands: vec![ty, id, rest, whole] });
                } else {
                    out.0.push(Inst { at, op: Op::Store, operands: vec![inst.operand(5), whole] });
                }
            } else {
                out.0.push(inst);
            }
        }
        parts.functions.push(out.0);
    }
    Ok(())
}

/// Whether an instruction splits a number into its whole and its fractional part.
fn splits(inst: &Inst) -> bool {
    let parts = [GlslStd450Op::Modf, GlslStd450Op::ModfStruct].map(|op| op as u32);
    inst.op == Op::ExtInst && parts.contains(&inst.operand(3))
}

/// Packs each number into 16 bits and unpacks it.
fn quantize(parts: &mut Parts, types: &HashMap<u32, Type>, set: u32, inst: &Inst, out: &mut Code) -> Result<(), Refusal> {
    let (at, ty, id, x) = (inst.at, inst.operand(0), inst.operand(1), inst.operand(2));
    let (scalar, count) = match types.get(&ty) {
        Some(&Type::Vector { of, count: count @ 2..=4 }) => (of, count),
        Some(Type::Float { bits: 32 }) => (ty, 1),
        _ => return Err(inst.refuse("its type is no number and no vector")),
    };
    let unsigned = parts.int_type(false);
    let pair = parts.vector_type(scalar, 2);
    let mut all = Vec::new();
    for n in 0..count {
        let number = if count == 1 { x } else { out.value(parts, at, Op::CompositeExtract, scalar, &[x, n]) };
        let both = out.value(parts, at, Op::CompositeConstruct, pair, &[number, number]);
        let packed = out.value(parts, at, Op::ExtInst, unsigned, &[set, GlslStd450Op::PackHalf2x16 as u32, both]);
        let unpacked = out.value(parts, at, Op::ExtInst, pair, &[set, GlslStd450Op::UnpackHalf2x16 as u32, packed]);
        all.push(out.value(parts, at, Op::CompositeExtract, scalar, &[unpacked, 0]));
    }
    let op = if count == 1 { Op::CopyObject } else { Op::CompositeConstruct };
    out.0.push(Inst { at, op, operands: [ty, id].into_iter().chain(all).collect() });
    Ok(())
}
