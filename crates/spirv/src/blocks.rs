//! Blocks of buffers whose layout or access naga does not have.

use std::collections::{BTreeSet, HashMap, HashSet};

use grammar::{Decoration as D, Op, StorageClass};

use crate::words::{Decoration, Inst, Parts, Type};
use crate::{Moved, Place, Refusal, UNIFORM_BINDINGS};

/// Moves uniform blocks to storage buffers where one has arrays that WebGPU does not allow in uniform buffers: with elements at distances that
/// are no multiple of 16. Says which were moved.
///
/// Types of pointers are shared by all blocks, so that all blocks of the module move, and old storage blocks take the new form.
///
/// # Errors
/// If a block has no place.
pub fn move_uniforms(parts: &mut Parts) -> Result<Vec<Moved>, Refusal> {
    let (types, decorations) = (parts.types(), parts.decorations());
    let has =
        |id: u32, kind: D| decorations.get(&id).into_iter().flatten().any(|d| d.member.is_none() && d.kind == kind as u32);
    let is_uniform = |inst: &&Inst| inst.op == Op::Variable && inst.operand(2) == StorageClass::Uniform as u32;
    let block_of = |inst: &Inst| block(&types, inst.operand(0));
    let needs = parts
        .globals
        .iter()
        .filter(is_uniform)
        .filter_map(block_of)
        .any(|id| !has(id, D::BufferBlock) && is_dense(&types, &decorations, id, &mut HashSet::new()));
    if !needs {
        return Ok(Vec::new());
    }
    let mut moved = BTreeSet::new();
    let mut rebound = HashMap::new();
    let mut read_only = Vec::new();
    for inst in parts.globals.iter().filter(is_uniform) {
        if block_of(inst).is_some_and(|id| has(id, D::BufferBlock)) {
            continue;
        }
        let id = inst.operand(1);
        let value = |kind: D| {
            let all = decorations.get(&id).into_iter().flatten();
            all.filter(|d| d.member.is_none() && d.kind == kind as u32).map(|d| d.value).next()
        };
        let place = value(D::DescriptorSet).zip(value(D::Binding)).filter(|&(_, binding)| binding < crate::SAMPLER_BINDINGS);
        let Some((set, binding)) = place else {
            return Err(inst.refuse(format!("a uniform block has a set and a binding below {}", crate::SAMPLER_BINDINGS)));
        };
        moved.insert(Moved { place: Place { set, binding }, binding: binding + UNIFORM_BINDINGS });
        rebound.insert(id, binding + UNIFORM_BINDINGS);
        read_only.push(Inst { at: inst.at, op: Op::Decorate, operands: vec![id, D::NonWritable as u32] });
    }
    for inst in parts.insts_mut() {
        let class = match inst.op {
            Op::Variable => 2,
            Op::TypePointer => 1,
            Op::Decorate => {
                if inst.operand(1) == D::BufferBlock as u32 {
                    inst.operands[1] = D::Block as u32;
                }
                if let Some(&binding) = rebound.get(&inst.operand(0)).filter(|_| inst.operand(1) == D::Binding as u32) {
                    inst.operands = vec![inst.operand(0), D::Binding as u32, binding];
                }
                continue;
            }
            _ => continue,
        };
        if inst.operand(class) == StorageClass::Uniform as u32 {
            inst.operands[class] = StorageClass::StorageBuffer as u32;
        }
    }
    let at = parts.first_type();
    parts.globals.splice(at..at, read_only);
    Ok(moved.into_iter().collect())
}

/// Refuses arrays of buffers: naga reads them as one buffer with an array in it. With one element both are the same.
///
/// # Errors
/// If there is an array of several buffers.
pub fn refuse_arrays(parts: &Parts) -> Result<(), Refusal> {
    let (types, constants) = (parts.types(), parts.constants());
    let buffers = [StorageClass::Uniform, StorageClass::StorageBuffer].map(|class| class as u32);
    for inst in parts.globals.iter().filter(|inst| inst.op == Op::Variable && buffers.contains(&inst.operand(2))) {
        let Some(&Type::Pointer { to, .. }) = types.get(&inst.operand(0)) else { continue };
        let is_several = match types.get(&to) {
            Some(Type::Array { length, .. }) => constants.get(length) != Some(&1),
            Some(Type::RuntimeArray { .. }) => true,
            _ => false,
        };
        if is_several {
            return Err(inst.refuse("an array of several buffers is not supported"));
        }
    }
    Ok(())
}

/// The structure that a variable of this type holds, or its elements do.
fn block(types: &HashMap<u32, Type>, mut ty: u32) -> Option<u32> {
    for _ in 0..8 {
        ty = match types.get(&ty)? {
            Type::Struct { .. } => return Some(ty),
            &(Type::Pointer { to, .. } | Type::Array { of: to, .. } | Type::RuntimeArray { of: to }) => to,
            _ => return None,
        };
    }
    None
}

/// Whether a type has an array whose elements lie at no multiple of 16 bytes, or arrays or structures within a structure do.
fn is_dense(types: &HashMap<u32, Type>, decorations: &HashMap<u32, Vec<Decoration>>, ty: u32, seen: &mut HashSet<u32>) -> bool {
    let mut open = vec![ty];
    while let Some(ty) = open.pop() {
        if !seen.insert(ty) {
            continue;
        }
        match types.get(&ty) {
            Some(Type::Struct { members }) => {
                let nested = |n: u32| {
                    let ty = members.get(n as usize).and_then(|ty| types.get(ty));
                    matches!(ty, Some(Type::Struct { .. } | Type::Array { .. }))
                };
                let offsets = decorations.get(&ty).into_iter().flatten().filter(|d| d.kind == D::Offset as u32);
                if offsets.filter(|d| d.value % 16 != 0).any(|d| d.member.is_some_and(nested)) {
                    return true;
                }
                open.extend(members);
            }
            Some(&(Type::Array { of, .. } | Type::RuntimeArray { of })) => {
                let strides = decorations.get(&ty).into_iter().flatten().filter(|d| d.kind == D::ArrayStride as u32);
                if strides.map(|d| d.value).any(|stride| stride % 16 != 0) {
                    return true;
                }
                open.push(of);
            }
            _ => {}
        }
    }
    false
}

/// Storage buffers that are only written may be read as well: naga has no others.
pub fn allow_reads(parts: &mut Parts) {
    let types = parts.types();
    let variables = parts.globals.iter().filter(|inst| inst.op == Op::Variable);
    let buffers: HashSet<u32> =
        variables.filter(|inst| block(&types, inst.operand(0)).is_some()).map(|inst| inst.operand(1)).collect();
    parts.globals.retain(|inst| match inst.op {
        Op::MemberDecorate => inst.operand(2) != D::NonReadable as u32,
        Op::Decorate => !(inst.operand(1) == D::NonReadable as u32 && buffers.contains(&inst.operand(0))),
        _ => true,
    });
}
