//! Inputs and outputs that take several locations: matrices, arrays, and structures with them.
//!
//! naga has one vector or number for each location. So the variable becomes a private one of the module, and each vector in it gets a variable
//! of its own. A function around that of the entry point copies inputs before it and outputs after it.

use std::collections::{HashMap, HashSet};

use grammar::{BuiltIn, Decoration as D, Op, StorageClass};

use crate::interface::{Around, list, unlist};
use crate::words::{Code, Decoration, Inst, Parts, Type};
use crate::{Refusal, Stage};

/// Vectors of one variable that are read, and variables: more than any card has locations.
const VECTORS: usize = 256;

/// How a varying is interpolated; an output and an input say it alike.
const INTERPOLATION: [D; 6] = [D::Flat, D::NoPerspective, D::Centroid, D::Sample, D::RelaxedPrecision, D::Invariant];

/// A vector or number of a variable.
struct Part {
    /// The numbers of members and elements that lead to it.
    path: Vec<u32>,
    ty: u32,
    /// What its own variable is decorated with: a location, or the mask of samples.
    place: [u32; 2],
    interpolation: Vec<u32>,
}

/// What a variable is made of.
#[derive(Default)]
struct Found {
    parts: Vec<Part>,
    /// Types that were looked at: structures may be empty.
    steps: usize,
}

/// What is known of a module.
struct Known {
    types: HashMap<u32, Type>,
    constants: HashMap<u32, u32>,
    decorations: HashMap<u32, Vec<Decoration>>,
    /// Types that have matrices or arrays.
    composite: HashSet<u32>,
}

/// Splits the variables of several locations.
///
/// # Errors
/// If one has no location or too many.
pub fn rewrite(parts: &mut Parts, stage: Stage, around: &mut Around) -> Result<(), Refusal> {
    if stage == Stage::Compute {
        return Ok(());
    }
    let mut known = Known {
        types: parts.types(),
        constants: parts.constants(),
        decorations: parts.decorations(),
        composite: HashSet::new(),
    };
    for (id, ty) in parts.globals.iter().filter_map(Parts::type_of) {
        let is_composite = match ty {
            Type::Matrix { .. } | Type::Array { .. } => true,
            Type::Struct { members } => members.iter().any(|member| known.composite.contains(member)),
            _ => false,
        };
        if is_composite {
            known.composite.insert(id);
        }
    }
    let classes = [StorageClass::Input, StorageClass::Output];
    let is_varying = |inst: &&Inst| inst.op == Op::Variable && classes.iter().any(|&class| class as u32 == inst.operand(2));
    let variables: Vec<Inst> = parts.globals.iter().filter(is_varying).cloned().collect();
    let mut all = 0;
    for variable in variables {
        let Some(&Type::Pointer { to, .. }) = known.types.get(&variable.operand(0)) else { continue };
        let is_builtin = known.is_builtin(variable.operand(1)) || known.is_builtin(to);
        if known.composite.contains(&to) && (!is_builtin || known.is_mask(variable.operand(1), to)) {
            all += 1;
            if all > VECTORS {
                return Err(variable.refuse("there are more inputs and outputs than are supported"));
            }
            split(parts, &known, &variable, to, around)?;
        }
    }
    Ok(())
}

impl Known {
    fn is_builtin(&self, id: u32) -> bool {
        self.decorations.get(&id).into_iter().flatten().any(|d| d.kind == D::BuiltIn as u32)
    }

    /// Whether a variable is the mask of samples: an array with one element, where naga has a number.
    fn is_mask(&self, id: u32, to: u32) -> bool {
        let is_mask = |d: &Decoration| d.kind == D::BuiltIn as u32 && d.value == BuiltIn::SampleMask as u32;
        let Some(Type::Array { of, length }) = self.types.get(&to) else { return false };
        let is_int = matches!(self.types.get(of), Some(Type::Int { bits: 32, .. }));
        is_int && self.constants.get(length) == Some(&1) && self.decorations.get(&id).into_iter().flatten().any(is_mask)
    }

    fn location(&self, id: u32, member: Option<u32>) -> Option<u32> {
        let all = self.decorations.get(&id).into_iter().flatten();
        all.filter(|d| d.member == member && d.kind == D::Location as u32).map(|d| d.value).next()
    }

    fn interpolation(&self, id: u32, member: Option<u32>) -> Vec<u32> {
        let all = self.decorations.get(&id).into_iter().flatten().filter(|d| d.member == member);
        all.map(|d| d.kind).filter(|&kind| INTERPOLATION.iter().any(|&known| known as u32 == kind)).collect()
    }

    /// Lists the vectors of a type, from the next location on.
    fn parts(
        &self,
        variable: &Inst,
        ty: u32,
        path: &[u32],
        interpolation: &[u32],
        next: &mut Option<u32>,
        found: &mut Found,
    ) -> Result<(), Refusal> {
        found.steps += 1;
        if found.parts.len() >= VECTORS || found.steps > 4 * VECTORS || path.len() > 8 {
            return Err(variable.refuse("an input or output has more vectors than are supported"));
        }
        let mut each = |n: u32, ty: u32, interpolation: &[u32], next: &mut Option<u32>| {
            let path: Vec<u32> = path.iter().copied().chain([n]).collect();
            self.parts(variable, ty, &path, interpolation, next, found)
        };
        match self.types.get(&ty) {
            Some(&Type::Matrix { column, count }) => (0..count).try_for_each(|n| each(n, column, interpolation, next)),
            Some(&Type::Array { of, length }) => {
                let length = self.constants.get(&length).copied().unwrap_or(u32::MAX);
                (0..length).try_for_each(|n| each(n, of, interpolation, next))
            }
            Some(Type::Struct { members }) => (0..).zip(members).try_for_each(|(n, &member)| {
                *next = self.location(ty, Some(n)).or(*next);
                let own = [interpolation, &self.interpolation(ty, Some(n))].concat();
                each(n, member, &own, next)
            }),
            _ => {
                let Some(location) = *next else { return Err(variable.refuse("an input or output has no location")) };
                *next = location.checked_add(1);
                let place = [D::Location as u32, location];
                found.parts.push(Part { path: path.to_vec(), ty, place, interpolation: interpolation.to_vec() });
                Ok(())
            }
        }
    }
}

fn split(parts: &mut Parts, known: &Known, variable: &Inst, to: u32, around: &mut Around) -> Result<(), Refusal> {
    let (at, id, class) = (variable.at, variable.operand(1), variable.operand(2));
    let unsigned = parts.int_type(false);
    let mut found = Found::default();
    if known.is_mask(id, to) {
        let Some(&Type::Array { of, .. }) = known.types.get(&to) else { return Ok(()) };
        let place = [D::BuiltIn as u32, BuiltIn::SampleMask as u32];
        found.parts.push(Part { path: vec![0], ty: of, place, interpolation: Vec::new() });
    } else {
        let mut next = known.location(id, None);
        known.parts(variable, to, &[], &known.interpolation(id, None), &mut next, &mut found)?;
    }

    let private = StorageClass::Private;
    let pointer = parts.pointer_type(private, to);
    parts.globals.retain(|inst| {
        let is_own = inst.op == Op::Decorate && inst.operand(0) == id;
        let is_location = inst.op == Op::MemberDecorate && inst.operand(0) == to && inst.operand(2) == D::Location as u32;
        !(is_own || is_location || inst.op == Op::Variable && inst.operand(1) == id)
    });
    let mut operands = variable.operands.clone();
    (operands[0], operands[2]) = (pointer, private as u32);
    parts.globals.push(Inst { at, op: Op::Variable, operands });
    unlist(parts, id);

    let mut decorated = Vec::new();
    for part in found.parts {
        // The mask has no sign in naga.
        let own_type = if part.place[0] == D::BuiltIn as u32 { unsigned } else { part.ty };
        let outer = parts.declared(Op::TypePointer, &[class, own_type]);
        let inner = parts.pointer_type(private, part.ty);
        let own = parts.fresh();
        parts.globals.push(Inst { at, op: Op::Variable, operands: vec![outer, own, class] });
        list(parts, own);
        let mut decorate = |operands: Vec<u32>| decorated.push(Inst { at, op: Op::Decorate, operands });
        decorate(vec![own, part.place[0], part.place[1]]);
        part.interpolation.iter().for_each(|&kind| decorate(vec![own, kind]));
        let path: Vec<u32> = part.path.iter().map(|&n| parts.constant(unsigned, n)).collect();
        let code: &mut Code = if class == StorageClass::Input as u32 { &mut around.before } else { &mut around.after };
        let place = code.value(parts, at, Op::AccessChain, inner, &[&[id], &path[..]].concat());
        let is_input = class == StorageClass::Input as u32;
        let (from, from_type, into, into_type) =
            if is_input { (own, own_type, place, part.ty) } else { (place, part.ty, own, own_type) };
        let mut value = code.value(parts, at, Op::Load, from_type, &[from]);
        if from_type != into_type {
            value = code.value(parts, at, Op::Bitcast, into_type, &[value]);
        }
        code.0.push(Inst { at, op: Op::Store, operands: vec![into, value] });
    }
    let first = parts.first_type();
    parts.globals.splice(first..first, decorated);
    Ok(())
}
