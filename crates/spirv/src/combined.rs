//! Combined image samplers become an image and a sampler.
//!
//! A variable of `OpTypeSampledImage` keeps its id and becomes one of the image; beside it stands a new one of the sampler. Arrays, pointers,
//! access chains and parameters of functions are doubled in the same manner. A load of the variable becomes nothing: each instruction that
//! uses what was loaded loads both and joins them with `OpSampledImage`, as both must stand in one block.

use std::collections::{BTreeSet, HashMap};

use grammar::{Decoration as D, Op, StorageClass};

use crate::words::{Inst, Parts, Type};
use crate::{Combined, Place, Refusal, SAMPLER_BINDINGS};

/// A value loaded from a combined image sampler.
#[derive(Clone, Copy)]
struct Loaded {
    /// Its type: `OpTypeSampledImage`.
    ty: u32,
    /// Pointers to both.
    image: u32,
    sampler: u32,
}

#[derive(Default)]
struct Splitter {
    /// For types that hold a combined image sampler: those of its image and of its sampler. Types of pointers: their own id, and that of the
    /// pointer to the sampler.
    split: HashMap<u32, (u32, u32)>,
    /// For pointers to combined image samplers: pointers to the sampler.
    samplers: HashMap<u32, u32>,
    loaded: HashMap<u32, Loaded>,
    /// The type of samplers.
    sampler: u32,
}

/// Splits all combined image samplers, and says which there are.
///
/// # Errors
/// If a descriptor has no place, or a value is used in a manner that has no form without it.
pub fn rewrite(parts: &mut Parts) -> Result<Vec<Combined>, Refusal> {
    let types = parts.types();
    let is_resource = |inst: &&Inst| inst.op == Op::Variable && inst.operand(2) == StorageClass::UniformConstant as u32;
    let mut splitter = Splitter::default();
    let is_combined = |inst: &Inst| holds_combined(&types, inst.operand(0));
    if !parts.globals.iter().filter(is_resource).any(is_combined) {
        return Ok(Vec::new());
    }
    splitter.sampler = parts.hoist(Op::TypeSampler, &[]);
    let places = splitter.globals(parts)?;
    for function in std::mem::take(&mut parts.functions) {
        let mut out = Vec::with_capacity(function.len());
        for inst in function {
            splitter.instruction(parts, inst, &mut out)?;
        }
        parts.functions.push(out);
    }
    Ok(places.into_iter().collect())
}

/// Whether a pointer leads to a combined image sampler or an array of them.
fn holds_combined(types: &HashMap<u32, Type>, mut ty: u32) -> bool {
    // Types are declared before what is made of them, but nothing has checked that.
    for _ in 0..8 {
        ty = match types.get(&ty) {
            Some(&Type::Pointer { to, .. }) => to,
            Some(&(Type::Array { of, .. } | Type::RuntimeArray { of })) => of,
            Some(Type::SampledImage { .. }) => return true,
            _ => return false,
        };
    }
    false
}

impl Splitter {
    /// Doubles types and variables.
    fn globals(&mut self, parts: &mut Parts) -> Result<BTreeSet<Combined>, Refusal> {
        let decorations = parts.decorations();
        let mut places = BTreeSet::new();
        let mut decorated = Vec::new();
        let mut out = Vec::with_capacity(parts.globals.len());
        for mut inst in std::mem::take(&mut parts.globals) {
            match inst.op {
                Op::TypeSampledImage => {
                    self.split.insert(inst.operand(0), (inst.operand(1), self.sampler));
                }
                Op::TypeArray | Op::TypeRuntimeArray => {
                    if let Some(&(image, sampler)) = self.split.get(&inst.operand(1)) {
                        let id = parts.fresh();
                        let mut second = inst.clone();
                        second.operands[..2].copy_from_slice(&[id, sampler]);
                        inst.operands[1] = image;
                        self.split.insert(inst.operand(0), (inst.operand(0), id));
                        out.push(second);
                    }
                }
                Op::TypePointer => {
                    if let Some(&(image, sampler)) = self.split.get(&inst.operand(2)) {
                        if inst.operand(1) != StorageClass::UniformConstant as u32 {
                            return Err(inst.refuse("a pointer to a combined image sampler that is no descriptor"));
                        }
                        let id = parts.fresh();
                        let mut second = inst.clone();
                        second.operands = vec![id, inst.operand(1), sampler];
                        inst.operands[2] = image;
                        self.split.insert(inst.operand(0), (inst.operand(0), id));
                        out.push(second);
                    }
                }
                Op::TypeFunction => {
                    let parameters = inst.from(2).iter().flat_map(|ty| [Some(*ty), self.second(*ty)]).flatten();
                    inst.operands = inst.operands.iter().take(2).copied().chain(parameters).collect();
                }
                Op::Variable => {
                    if let Some(sampler) = self.second(inst.operand(0)) {
                        let id = inst.operand(1);
                        let of_kind = |kind: D| {
                            let all = decorations.get(&id).into_iter().flatten();
                            all.filter(move |d| d.member.is_none() && d.kind == kind as u32).map(|d| d.value).next()
                        };
                        let place = of_kind(D::DescriptorSet).zip(of_kind(D::Binding));
                        let Some((set, binding)) = place.filter(|&(_, binding)| binding < SAMPLER_BINDINGS) else {
                            return Err(inst
                                .refuse(format!("a combined image sampler has a set and a binding below {SAMPLER_BINDINGS}")));
                        };
                        let second = parts.fresh();
                        let sampler_binding = binding + SAMPLER_BINDINGS;
                        places.insert(Combined { place: Place { set, binding }, sampler_binding });
                        for (kind, value) in [(D::DescriptorSet, set), (D::Binding, sampler_binding)] {
                            decorated.push(Inst { at: inst.at, op: Op::Decorate, operands: vec![second, kind as u32, value] });
                        }
                        self.samplers.insert(id, second);
                        out.push(Inst { operands: vec![sampler, second, inst.operand(2)], ..inst.clone() });
                    }
                }
                _ => {}
            }
            out.push(inst);
        }
        parts.globals = out;
        let at = parts.first_type();
        parts.globals.splice(at..at, decorated);
        // From version 1.4 on, entry points list all variables that they use.
        if let Some(entry) = parts.globals.iter_mut().find(|inst| inst.op == Op::EntryPoint) {
            let name = crate::words::text(entry.from(2)).map_or(0, |(_, words)| words);
            let added: Vec<u32> = entry.from(2 + name).iter().filter_map(|id| self.samplers.get(id)).copied().collect();
            entry.operands.extend(added);
        }
        Ok(places)
    }

    /// The type of the pointer to the sampler, beside that to the image.
    fn second(&self, pointer: u32) -> Option<u32> {
        self.split.get(&pointer).filter(|&&(first, _)| first == pointer).map(|&(_, sampler)| sampler)
    }

    fn instruction(&mut self, parts: &mut Parts, mut inst: Inst, out: &mut Vec<Inst>) -> Result<(), Refusal> {
        match inst.op {
            Op::FunctionParameter => {
                let sampler = self.second(inst.operand(0));
                let id = inst.operand(1);
                let at = inst.at;
                out.push(inst);
                if let Some(ty) = sampler {
                    let second = parts.fresh();
                    self.samplers.insert(id, second);
                    out.push(Inst { at, op: Op::FunctionParameter, operands: vec![ty, second] });
                }
                return Ok(());
            }
            Op::FunctionCall => {
                let arguments = inst.from(3).iter().flat_map(|id| [Some(*id), self.samplers.get(id).copied()]).flatten();
                inst.operands = inst.operands.iter().take(3).copied().chain(arguments).collect();
            }
            Op::AccessChain | Op::InBoundsAccessChain | Op::CopyObject if self.samplers.contains_key(&inst.operand(2)) => {
                let Some(ty) = self.second(inst.operand(0)) else {
                    return Err(inst.refuse("its type is no pointer to a combined image sampler"));
                };
                let mut second = inst.clone();
                let id = parts.fresh();
                second.operands[..3].copy_from_slice(&[ty, id, self.samplers[&inst.operand(2)]]);
                self.samplers.insert(inst.operand(1), id);
                out.push(second);
            }
            Op::Load => {
                if let Some(&sampler) = self.samplers.get(&inst.operand(2)) {
                    let ty = inst.operand(0);
                    if self.split.get(&ty).is_none_or(|&(first, _)| first == ty) {
                        return Err(inst.refuse("a load of a whole array of combined image samplers is not supported"));
                    }
                    self.loaded.insert(inst.operand(1), Loaded { ty, image: inst.operand(2), sampler });
                    return Ok(());
                }
            }
            Op::CopyObject => {
                if let Some(&loaded) = self.loaded.get(&inst.operand(2)) {
                    self.loaded.insert(inst.operand(1), loaded);
                    return Ok(());
                }
            }
            Op::Image => {
                if let Some(loaded) = self.loaded.get(&inst.operand(2)) {
                    inst.op = Op::Load;
                    inst.operands[2] = loaded.image;
                }
            }
            _ if samples(inst.op) => {
                if let Some(&loaded) = self.loaded.get(&inst.operand(2)) {
                    let &(image, sampler) = &self.split[&loaded.ty];
                    let (first, second, joined) = (parts.fresh(), parts.fresh(), parts.fresh());
                    let at = inst.at;
                    out.push(Inst { at, op: Op::Load, operands: vec![image, first, loaded.image] });
                    out.push(Inst { at, op: Op::Load, operands: vec![sampler, second, loaded.sampler] });
                    out.push(Inst { at, op: Op::SampledImage, operands: vec![loaded.ty, joined, first, second] });
                    inst.operands[2] = joined;
                }
            }
            _ => {}
        }
        self.check(&inst)?;
        out.push(inst);
        Ok(())
    }

    /// Refuses what uses a combined image sampler in another manner.
    fn check(&self, inst: &Inst) -> Result<(), Refusal> {
        let takes_values = matches!(inst.op, Op::Phi | Op::Select | Op::Store | Op::ReturnValue | Op::CompositeConstruct);
        let used = |id: &u32| self.loaded.contains_key(id) || self.samplers.contains_key(id);
        if takes_values && inst.operands.iter().any(used) {
            return Err(inst.refuse("a combined image sampler is chosen or stored, which is not supported"));
        }
        Ok(())
    }
}

/// Whether an instruction takes a sampled image as its first operand.
pub fn samples(op: Op) -> bool {
    matches!(
        op,
        Op::ImageSampleImplicitLod
            | Op::ImageSampleExplicitLod
            | Op::ImageSampleDrefImplicitLod
            | Op::ImageSampleDrefExplicitLod
            | Op::ImageSampleProjImplicitLod
            | Op::ImageSampleProjExplicitLod
            | Op::ImageSampleProjDrefImplicitLod
            | Op::ImageSampleProjDrefExplicitLod
            | Op::ImageGather
            | Op::ImageDrefGather
            | Op::ImageQueryLod
    )
}
