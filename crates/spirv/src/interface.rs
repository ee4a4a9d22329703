//! What connects a stage to others: locations, built-in values, and y of positions.

use std::collections::{HashMap, HashSet};

use grammar::{BuiltIn, Decoration as D, ExecutionMode, Op, StorageClass};

use crate::words::{Code, Decoration, Inst, Parts, Type, text};
use crate::{Refusal, Stage};

/// Locations below this are read: more than any card has. naga's validator takes a bit of memory for each up to the largest.
const LOCATIONS: u32 = 1 << 12;

/// Rewrites decorations of inputs and outputs.
///
/// # Errors
/// If a variable begins within a location, a location is beyond all limits, or the stage chooses a viewport or a layer.
pub fn rewrite(parts: &mut Parts, stage: Stage) -> Result<(), Refusal> {
    // naga takes each index for one of dual-source blending. Where there is no second source, the first says nothing.
    let is_index = |inst: &Inst| inst.op == Op::Decorate && inst.operand(1) == D::Index as u32;
    if !parts.globals.iter().any(|inst| is_index(inst) && inst.operand(2) != 0) {
        parts.globals.retain(|inst| !is_index(inst));
    }
    for inst in &parts.globals {
        let (kind, value) = match inst.op {
            Op::Decorate => (inst.operand(1), inst.operand(2)),
            Op::MemberDecorate => (inst.operand(2), inst.operand(3)),
            _ => continue,
        };
        // naga reads it from the first component of its location.
        if kind == D::Component as u32 && value != 0 {
            return Err(inst.refuse("an input or output that begins within a location is not supported"));
        }
        if kind == D::Location as u32 && value >= LOCATIONS {
            return Err(inst.refuse(format!("location {value} is not supported: they end with {}", LOCATIONS - 1)));
        }
    }
    for (builtin, what) in [(BuiltIn::ViewportIndex, "viewport"), (BuiltIn::Layer, "layer")] {
        let chosen = builtins(parts, builtin, StorageClass::Output);
        let is_chosen = |inst: &&Inst| inst.op == Op::Variable && chosen.contains(&inst.operand(1));
        if let Some(inst) = parts.globals.iter().find(is_chosen) {
            return Err(inst.refuse(format!("a {stage} stage that chooses the {what} is not supported")));
        }
    }
    if matches!(stage, Stage::Vertex | Stage::Fragment) {
        flatten(parts, stage);
    }
    Ok(())
}

/// Decorates varyings that are whole numbers as flat: Vulkan asks for it in fragment stages alone, and old compilers forgot it.
fn flatten(parts: &mut Parts, stage: Stage) {
    let (types, decorations) = (parts.types(), parts.decorations());
    let class = if stage == Stage::Vertex { StorageClass::Output } else { StorageClass::Input };
    let all = decorations.iter().flat_map(|(&id, all)| all.iter().map(move |d| (id, d.member, d.kind)));
    let all: HashSet<(u32, Option<u32>, u32)> = all.collect();
    let has = |id: u32, member: Option<u32>, kind: D| all.contains(&(id, member, kind as u32));
    let mut added = Vec::new();
    for inst in parts.globals.iter().filter(|inst| inst.op == Op::Variable && inst.operand(2) == class as u32) {
        let Some(&Type::Pointer { to, .. }) = types.get(&inst.operand(0)) else { continue };
        let id = inst.operand(1);
        let mut add = |id: u32, member: Option<u32>, ty: u32| {
            if has(id, member, D::Location) && !has(id, member, D::Flat) && is_whole(&types, ty) {
                let target = [Some(id), member, Some(D::Flat as u32)];
                let op = if member.is_some() { Op::MemberDecorate } else { Op::Decorate };
                added.push(Inst { at: inst.at, op, operands: target.into_iter().flatten().collect() });
            }
        };
        match types.get(&to) {
            Some(Type::Struct { members }) => (0..).zip(members).for_each(|(n, &ty)| add(to, Some(n), ty)),
            _ => add(id, None, to),
        }
    }
    let at = parts.first_type();
    parts.globals.splice(at..at, added);
}

fn is_whole(types: &HashMap<u32, Type>, ty: u32) -> bool {
    match types.get(&ty) {
        Some(Type::Int { .. }) => true,
        Some(Type::Vector { of, .. }) => matches!(types.get(of), Some(Type::Int { .. })),
        _ => false,
    }
}

/// The variables that are a built-in value as a whole.
fn builtins(parts: &Parts, builtin: BuiltIn, class: StorageClass) -> Vec<u32> {
    let decorations = parts.decorations();
    let is_it = |d: &Decoration| d.member.is_none() && d.kind == D::BuiltIn as u32 && d.value == builtin as u32;
    let variables = parts.globals.iter().filter(|inst| inst.op == Op::Variable && inst.operand(2) == class as u32);
    let ids = variables.map(|inst| inst.operand(1));
    ids.filter(|id| decorations.get(id).into_iter().flatten().any(is_it)).collect()
}

/// Variables of one built-in value that are read: a compiler makes one.
const VARIABLES: usize = 16;

/// The input variables that are a built-in value as a whole.
///
/// # Errors
/// If there are more than any module has.
fn input_builtins(parts: &Parts, builtin: BuiltIn) -> Result<Vec<u32>, Refusal> {
    let ids = builtins(parts, builtin, StorageClass::Input);
    match parts.globals.last().filter(|_| ids.len() > VARIABLES) {
        Some(inst) => Err(inst.refuse(format!("there are more variables of {builtin:?} than are supported"))),
        None => Ok(ids),
    }
}

/// Gives built-in values, which are whole numbers, constants: the variables become private ones.
///
/// # Errors
/// If there are more variables than any module has.
pub fn fix(parts: &mut Parts, fixed: &[(BuiltIn, u32)]) -> Result<(), Refusal> {
    for &(builtin, value) in fixed {
        for id in input_builtins(parts, builtin)? {
            let types = parts.types();
            let Some(at) = parts.globals.iter().position(|inst| inst.op == Op::Variable && inst.operand(1) == id) else {
                continue;
            };
            let Some(&Type::Pointer { to, .. }) = types.get(&parts.globals[at].operand(0)) else { continue };
            if !matches!(types.get(&to), Some(Type::Int { bits: 32, .. })) {
                continue;
            }
            let variable = parts.globals.remove(at);
            let (value, pointer) = (parts.constant(to, value), parts.pointer_type(StorageClass::Private, to));
            let operands = vec![pointer, id, StorageClass::Private as u32, value];
            parts.globals.push(Inst { operands, ..variable });
            parts.globals.retain(|inst| !(inst.op == Op::Decorate && inst.operand(0) == id));
            unlist(parts, id);
        }
    }
    Ok(())
}

/// Adds the first workgroup of a dispatch to the numbers of workgroups, and its invocations to those of invocations. The variables become
/// private ones, and the function around that of the entry point writes them.
///
/// # Errors
/// If there are more variables than any module has.
pub fn move_workgroups(parts: &mut Parts, around: &mut Around, base: [u32; 3]) -> Result<(), Refusal> {
    let is_size = |inst: &&Inst| inst.op == Op::ExecutionMode && inst.operand(1) == ExecutionMode::LocalSize as u32;
    let size = parts.globals.iter().find(is_size).map_or([1; 3], |inst| [2, 3, 4].map(|at| inst.operand(at)));
    let invocations = [0, 1, 2].map(|axis| base[axis].wrapping_mul(size[axis]));
    for (builtin, by) in [(BuiltIn::WorkgroupId, base), (BuiltIn::GlobalInvocationId, invocations)] {
        for id in input_builtins(parts, builtin)? {
            let types = parts.types();
            let Some(place) = parts.globals.iter().position(|inst| inst.op == Op::Variable && inst.operand(1) == id) else {
                continue;
            };
            let Some(&Type::Pointer { to, .. }) = types.get(&parts.globals[place].operand(0)) else { continue };
            let Some(&Type::Vector { of, count: 3 }) = types.get(&to) else { continue };
            if !matches!(types.get(&of), Some(Type::Int { bits: 32, .. })) {
                continue;
            }
            let variable = parts.globals.remove(place);
            let (at, own) = (variable.at, parts.fresh());
            let pointer = parts.pointer_type(StorageClass::Private, to);
            let axes = by.map(|by| parts.constant(of, by));
            let added = parts.declared(Op::ConstantComposite, &[to, axes[0], axes[1], axes[2]]);
            let input = Inst { operands: vec![variable.operand(0), own, StorageClass::Input as u32], ..variable };
            let private = Inst { at, op: Op::Variable, operands: vec![pointer, id, StorageClass::Private as u32] };
            parts.globals.extend([input, private]);
            for inst in parts.globals.iter_mut().filter(|inst| inst.op == Op::Decorate && inst.operand(0) == id) {
                inst.operands[0] = own;
            }
            unlist(parts, id);
            list(parts, own);
            let number = around.before.value(parts, at, Op::Load, to, &[own]);
            let moved = around.before.value(parts, at, Op::IAdd, to, &[number, added]);
            around.before.0.push(Inst { at, op: Op::Store, operands: vec![id, moved] });
        }
    }
    Ok(())
}

/// The variable of the fragment's position.
pub fn fragment_position(parts: &mut Parts) -> u32 {
    if let Some(&id) = builtins(parts, BuiltIn::FragCoord, StorageClass::Input).first() {
        list(parts, id);
        return id;
    }
    let float = parts.float_type();
    let vector = parts.vector_type(float, 4);
    let pointer = parts.pointer_type(StorageClass::Input, vector);
    let id = parts.fresh();
    let at = parts.globals.last().map_or(5, |inst| inst.at);
    parts.globals.push(Inst { at, op: Op::Variable, operands: vec![pointer, id, StorageClass::Input as u32] });
    let first = parts.first_type();
    let operands = vec![id, D::BuiltIn as u32, BuiltIn::FragCoord as u32];
    parts.globals.insert(first, Inst { at, op: Op::Decorate, operands });
    list(parts, id);
    id
}

/// Takes a variable from those of the entry point.
pub fn unlist(parts: &mut Parts, id: u32) {
    if let Some(entry) = parts.globals.iter_mut().find(|inst| inst.op == Op::EntryPoint) {
        let before = 2 + text(entry.from(2)).map_or(0, |(_, words)| words);
        let kept = entry.from(before).iter().copied().filter(|&other| other != id).collect::<Vec<u32>>();
        entry.operands.truncate(before);
        entry.operands.extend(kept);
    }
}

/// Lists a variable among those of the entry point.
pub fn list(parts: &mut Parts, id: u32) {
    if let Some(entry) = parts.globals.iter_mut().find(|inst| inst.op == Op::EntryPoint) {
        let before = 2 + text(entry.from(2)).map_or(0, |(_, words)| words);
        if !entry.from(before).contains(&id) {
            entry.operands.push(id);
        }
    }
}

/// Instructions around the function of the entry point.
#[derive(Default)]
pub struct Around {
    pub before: Code,
    pub after: Code,
}

/// Interpolates what a fragment stage reads at each sample.
pub fn sample_inputs(parts: &mut Parts) {
    let decorations = parts.decorations();
    let has = |id: u32, kind: D| {
        decorations.get(&id).into_iter().flatten().any(|own| own.member.is_none() && own.kind == kind as u32)
    };
    let inputs = parts.globals.iter().filter(|inst| inst.op == Op::Variable && inst.operand(2) == StorageClass::Input as u32);
    let read = inputs.map(|inst| (inst.at, inst.operand(1))).filter(|&(_, id)| has(id, D::Location) && !has(id, D::Flat));
    let first = parts.first_type();
    for (at, id) in read.collect::<Vec<_>>() {
        parts.globals.insert(first, Inst { at, op: Op::Decorate, operands: vec![id, D::Sample as u32] });
    }
}

/// Turns y of positions, and moves their depths from those between -w and w to those from 0 on.
pub fn move_positions(parts: &mut Parts, around: &mut Around, flip: bool, from_minus_one: bool) {
    let (types, decorations) = (parts.types(), parts.decorations());
    let is_position = |d: &&Decoration| d.kind == D::BuiltIn as u32 && d.value == BuiltIn::Position as u32;
    // Each position: the variable, the number of the member where it is one of a block, and the place in the module.
    let mut positions: Vec<(u32, Option<u32>, u32)> = Vec::new();
    for inst in parts.globals.iter().filter(|inst| inst.op == Op::Variable && inst.operand(2) == StorageClass::Output as u32) {
        let Some(&Type::Pointer { to, .. }) = types.get(&inst.operand(0)) else { continue };
        let id = inst.operand(1);
        for (of, is_member) in [(id, false), (to, true)] {
            let found = decorations.get(&of).into_iter().flatten().find(is_position);
            if let Some(decoration) = found.filter(|decoration| decoration.member.is_some() == is_member) {
                positions.push((id, decoration.member, inst.at));
            }
        }
    }
    if positions.is_empty() {
        return;
    }
    let (float, unsigned) = (parts.float_type(), parts.int_type(false));
    let pointer = parts.pointer_type(StorageClass::Output, float);
    let [one, two, three] = [1, 2, 3].map(|axis| parts.constant(unsigned, axis));
    let half = parts.constant(float, 0.5f32.to_bits());
    for (variable, member, at) in positions {
        let member = member.map(|member| parts.constant(unsigned, member));
        let mut load = |parts: &mut Parts, axis: u32| {
            let path: Vec<u32> = [Some(variable), member, Some(axis)].into_iter().flatten().collect();
            let place = around.after.value(parts, at, Op::AccessChain, pointer, &path);
            (place, around.after.value(parts, at, Op::Load, float, &[place]))
        };
        let y = flip.then(|| load(parts, one));
        let depth = from_minus_one.then(|| (load(parts, two), load(parts, three)));
        if let Some((place, value)) = y {
            let negative = around.after.value(parts, at, Op::FNegate, float, &[value]);
            around.after.0.push(Inst { at, op: Op::Store, operands: vec![place, negative] });
        }
        if let Some(((place, z), (_, w))) = depth {
            let sum = around.after.value(parts, at, Op::FAdd, float, &[z, w]);
            let middle = around.after.value(parts, at, Op::FMul, float, &[sum, half]);
            around.after.0.push(Inst { at, op: Op::Store, operands: vec![place, middle] });
        }
    }
}

/// Puts a function around that of the entry point, if there is something to do around it.
///
/// # Errors
/// If the function of the entry point is none.
pub fn surround(parts: &mut Parts, function: u32, around: Around) -> Result<(), Refusal> {
    let Around { before, after } = around;
    if before.0.is_empty() && after.0.is_empty() {
        return Ok(());
    }
    let is_own = |insts: &&Vec<Inst>| insts.first().and_then(Inst::result) == Some(function);
    let Some(head) = parts.functions.iter().find(is_own).and_then(|insts| insts.first()).cloned() else { return Ok(()) };
    let (at, void, signature) = (head.at, head.operand(0), head.operand(3));
    if head.operands.len() != 4 {
        return Err(head.refuse("a function has a type, an id, a control and a signature"));
    }
    let outer = parts.fresh();
    let mut out = vec![
        Inst { at, op: Op::Function, operands: vec![void, outer, 0, signature] },
        Inst { at, op: Op::Label, operands: vec![parts.fresh()] },
    ];
    out.extend(before.0);
    out.push(Inst { at, op: Op::FunctionCall, operands: vec![void, parts.fresh(), function] });
    out.extend(after.0);
    out.push(Inst { at, op: Op::Return, operands: Vec::new() });
    out.push(Inst { at, op: Op::FunctionEnd, operands: Vec::new() });
    parts.functions.push(out);
    for inst in &mut parts.globals {
        match inst.op {
            Op::EntryPoint if inst.operand(1) == function => inst.operands[1] = outer,
            Op::ExecutionMode if inst.operand(0) == function => inst.operands[0] = outer,
            _ => {}
        }
    }
    Ok(())
}
