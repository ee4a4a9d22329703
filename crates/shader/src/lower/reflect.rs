//! The entry point: its bindings, inputs and outputs, and the walk's beginning and end.

use std::rc::Rc;

use naga::{AddressSpace, ArraySize, Handle, ScalarKind, StorageAccess, TypeInner};

use super::texture::Image;
use super::{AccessPath, Flags, Lowered, Lowerer, Result, Root, Stop, Val, writes};
use crate::interface::{
    Binding, BindingKind, BuiltIn, Connection, DepthPromise, Interface, Interpolation, Sampling, Scalar, Slot, stage_of,
};
use crate::ir::{Builder, Def, V};
use crate::module::{Module, Places, ShaderError};
use crate::options::Optimisations;
use crate::program::Space;
use crate::types::{Ty, Types, component_counts};
use gfx::stage::Stage;

/// Instructions that unrolled loops of one entry point may add.
const UNROLL_BUDGET: usize = 3000;

/// Lowers one entry point of a module without overrides. `keep` says which user-defined outputs are wanted.
pub(crate) fn lower(
    origin: &Module,
    module: &naga::Module,
    info: &naga::valid::ModuleInfo,
    index: usize,
    keep: &dyn Fn(u32) -> bool,
    optimisations: Optimisations,
) -> std::result::Result<Lowered, ShaderError> {
    let entry = &module.entry_points[index];
    let counts = component_counts(module);
    let mut l = Lowerer {
        module,
        info,
        types: Types { module, counts: &counts },
        origin,
        entry: &entry.name,
        b: Builder::new(optimisations),
        state: Vec::new(),
        frames: Vec::new(),
        regions: Vec::new(),
        depth: 0,
        slot: 0,
        globals: Default::default(),
        bindings: Default::default(),
        written_bindings: Vec::new(),
        uniform_bindings: Vec::new(),
        global_exprs: Default::default(),
        writes: Default::default(),
        indexed: writes::find_indexed(module, info, index),
        span: naga::Span::UNDEFINED,
        lines: match &origin.places {
            Places::Text(text, _) => line_starts(text),
            Places::Binary(_) | Places::None => Vec::new(),
        },
        range_top: 0,
        unroll_budget: UNROLL_BUDGET,
        unroll_steps: origin.limits.shader_unrolling.get(),
        level: 0,
        early: Default::default(),
        flags: Flags::default(),
        shared_bytes: 0,
        immediate_size: 0,
    };
    l.entry_point(index, keep).map_err(|stop| match stop {
        Stop::Error(e) => *e,
        Stop::Unroll => l.error("a loop was left half unrolled".to_owned()),
    })
}

/// First bytes of the lines of a text.
fn line_starts(text: &str) -> Vec<u32> {
    let after = text.bytes().enumerate().filter(|&(_, byte)| byte == b'\n').map(|(at, _)| at as u32 + 1);
    std::iter::once(0).chain(after).collect()
}

impl<'a> Lowerer<'a> {
    fn entry_point(&mut self, index: usize, keep: &dyn Fn(u32) -> bool) -> Result<Lowered> {
        let module: &'a naga::Module = self.module;
        let info: &'a naga::valid::ModuleInfo = self.info;
        let entry = &module.entry_points[index];
        let Some(stage) = stage_of(entry.stage) else {
            return self.refuse(format!("the {:?} stage is not supported", entry.stage));
        };
        let invocations = entry.workgroup_size.iter().fold(1u64, |n, &side| n.saturating_mul(u64::from(side)));
        let workgroup_size = if stage.has_workgroups() { entry.workgroup_size } else { [1; 3] };
        if workgroup_size.contains(&0) {
            return self.refuse("a workgroup without invocations");
        }
        self.within(self.origin.limits.shader_invocations, invocations)?;
        let bindings = self.reflect_bindings(index)?;
        self.written_bindings = vec![false; bindings.len()];
        self.uniform_bindings = bindings.iter().map(|of| matches!(of.kind, BindingKind::Uniform { .. })).collect();
        let workgroup_bytes = self.global_variables(index)?;
        let (inputs, input_slots, args) = self.inputs(&entry.function)?;
        let value = self.inline(None, &entry.function, info.get_entry_point(index), args)?;
        let (outputs, output_slots) = self.outputs(&entry.function, stage, value, keep)?;
        let depth = output_slots.iter().any(|s| s.is_builtin(BuiltIn::FragDepth));
        let promise = match entry.early_depth_test {
            Some(naga::EarlyDepthTest::Allow { conservative }) => match conservative {
                naga::ConservativeDepth::GreaterEqual => DepthPromise::GreaterEqual,
                naga::ConservativeDepth::LessEqual => DepthPromise::LessEqual,
                naga::ConservativeDepth::Unchanged => DepthPromise::Unchanged,
            },
            _ => DepthPromise::Any,
        };
        let is_sample = |s: &Slot| {
            matches!(s.connection, Connection::Location { sampling: Sampling::Sample, .. })
                || s.is_builtin(BuiltIn::SampleIndex)
        };
        let interface = Interface {
            stage,
            entry: entry.name.clone(),
            bindings: bindings.into_iter().zip(&self.written_bindings).map(|(b, &written)| Binding { written, ..b }).collect(),
            per_sample: match stage {
                Stage::Fragment => input_slots.iter().any(is_sample),
                Stage::Vertex | Stage::Compute => false,
            },
            writes_sample_mask: output_slots.iter().any(|s| s.is_builtin(BuiltIn::SampleMask)),
            inputs: input_slots,
            outputs: output_slots,
            workgroup_size,
            workgroup_bytes,
            immediate_bytes: self.flags.immediate_bytes,
            registers: 0,
            uses_derivatives: self.flags.derivatives,
            discards: self.flags.discards,
            writes_depth: depth.then_some(promise),
            force_early_depth: entry.early_depth_test == Some(naga::EarlyDepthTest::Force),
            side_effects: self.flags.side_effects,
            barriers: self.flags.barriers,
            subgroups: self.flags.subgroups,
        };
        Ok(Lowered { builder: std::mem::take(&mut self.b), interface, inputs, outputs, shared_bytes: self.shared_bytes })
    }

    /// The bindings that the entry point and the functions it calls name.
    fn reflect_bindings(&mut self, index: usize) -> Result<Vec<Binding>> {
        let info = self.info.get_entry_point(index);
        let mut out = Vec::new();
        for (h, g) in self.module.global_variables.iter() {
            let Some(at) = g.binding.filter(|_| !info[h].is_empty()) else { continue };
            self.span = self.module.global_variables.get_span(h);
            let (ty, count) = match self.module.types[g.ty].inner {
                TypeInner::BindingArray { base, size } => {
                    let n = self.types.length(size).unwrap_or(0);
                    (base, Some(n))
                }
                _ => (g.ty, None),
            };
            let kind = match (g.space, &self.module.types[ty].inner) {
                (AddressSpace::Uniform, _) => BindingKind::Uniform { min_size: self.min_size(ty) },
                (AddressSpace::Storage { access }, _) => BindingKind::Storage {
                    min_size: self.min_size(ty),
                    writable: access.intersects(StorageAccess::STORE | StorageAccess::ATOMIC),
                },
                (_, &TypeInner::Sampler { comparison }) => BindingKind::Sampler { comparison },
                (_, &TypeInner::Image { dim, arrayed, class }) => match (Image { dim, arrayed, class }).kind() {
                    Ok(kind) => kind,
                    Err(message) => return self.refuse(message),
                },
                _ => return self.refuse("this kind of binding is not supported"),
            };
            out.push((h, Binding { group: at.group, binding: at.binding, kind, count, written: false }));
        }
        if out.len() > usize::from(u16::MAX) {
            return self.refuse(format!("more than {} bindings, which operations number with 16 bits", u16::MAX));
        }
        out.sort_by_key(|(_, b)| (b.group, b.binding));
        for (i, (h, _)) in out.iter().enumerate() {
            self.bindings.insert(*h, i as u16);
        }
        Ok(out.into_iter().map(|(_, b)| b).collect())
    }

    /// Bytes that a buffer must have at least: a runtime array counts one element.
    fn min_size(&self, ty: Handle<naga::Type>) -> u64 {
        match self.module.types[ty].inner {
            TypeInner::Array { size: ArraySize::Dynamic, stride, .. } => u64::from(stride),
            TypeInner::Struct { ref members, span } => match members.last() {
                Some(m) if self.module.types[m.ty].inner.is_dynamically_sized(&self.module.types) => {
                    u64::from(m.offset) + self.min_size(m.ty)
                }
                _ => u64::from(span),
            },
            ref inner => inner.try_size(self.module.to_ctx()).map_or(u64::MAX, u64::from),
        }
    }

    /// Bytes of a type of fixed size.
    fn byte_size(&self, ty: Handle<naga::Type>) -> Result<u32> {
        match self.module.types[ty].inner.try_size(self.module.to_ctx()) {
            Some(bytes) => Ok(bytes),
            None => self.refuse("this type is too large"),
        }
    }

    /// Gives every global variable that is used its value; the bytes of workgroup memory.
    fn global_variables(&mut self, index: usize) -> Result<u32> {
        let info = self.info.get_entry_point(index);
        let mut workgroup_bytes = 0u32;
        for (h, g) in self.module.global_variables.iter() {
            if info[h].is_empty() {
                continue;
            }
            self.span = self.module.global_variables.get_span(h);
            let ty = Ty::Named(g.ty);
            let memory = |space, constant, offset| AccessPath::new(Root::Memory { space, constant }, ty, offset);
            let value = match g.space {
                AddressSpace::Private => {
                    let initial = match g.init {
                        Some(init) => match self.global(init)? {
                            Val::Data(d) => d.to_vec(),
                            _ => return self.refuse("an initial value that is not a value"),
                        },
                        None => self.zeros(ty)?,
                    };
                    let indexed = self.indexed.globals.contains(&h);
                    let var = self.variable(indexed, &initial)?;
                    Val::Place(Rc::new(self.variable_place(var, ty)))
                }
                AddressSpace::WorkGroup => {
                    let bytes = self.byte_size(g.ty)?;
                    workgroup_bytes = workgroup_bytes.next_multiple_of(16).saturating_add(bytes);
                    let offset = self.shared_bytes;
                    let size = self.types.components(ty).saturating_mul(4);
                    self.shared_bytes = self.shared_bytes.saturating_add(size);
                    self.within(self.origin.limits.shader_workgroup, u64::from(self.shared_bytes))?;
                    Val::Place(Rc::new(memory(Space::Shared, false, offset)))
                }
                AddressSpace::Immediate => {
                    self.immediate_size = self.byte_size(g.ty)?;
                    Val::Place(Rc::new(memory(Space::Immediate, true, 0)))
                }
                AddressSpace::Handle => Val::Opaque(h, None),
                AddressSpace::Uniform | AddressSpace::Storage { .. } => {
                    let Some(&binding) = self.bindings.get(&h) else { continue };
                    let constant = match g.space {
                        AddressSpace::Storage { access } => !access.intersects(StorageAccess::STORE | StorageAccess::ATOMIC),
                        _ => true,
                    };
                    Val::Place(Rc::new(memory(Space::Buffer(binding), constant, 0)))
                }
                other => return self.refuse(format!("variables in the {other:?} address space are not supported")),
            };
            self.globals.insert(h, value);
        }
        Ok(workgroup_bytes)
    }

    /// Connection, components and scalar of one interface value.
    fn slot(&mut self, ty: Handle<naga::Type>, binding: &naga::Binding) -> Result<Slot> {
        let types = self.types;
        let inner = &self.module.types[ty].inner;
        let components = types.components(Ty::Named(ty));
        let scalar = match *inner {
            TypeInner::Array { base, .. } => types.scalar(&self.module.types[base].inner),
            ref inner => types.scalar(inner),
        };
        let scalar = match scalar {
            Some(s) if s.width > 4 => return self.refuse("64-bit inputs and outputs are not supported"),
            Some(s) => match s.kind {
                ScalarKind::Sint => Scalar::Sint,
                ScalarKind::Uint => Scalar::Uint,
                ScalarKind::Bool => Scalar::Bool,
                _ => Scalar::Float,
            },
            None => return self.refuse("an input or output of this type is not supported"),
        };
        let connection = match *binding {
            naga::Binding::BuiltIn(b) => Connection::BuiltIn(self.builtin(b)?),
            naga::Binding::Location { location, interpolation, sampling, blend_src, per_primitive } => {
                if per_primitive {
                    return self.refuse("per-primitive varyings are not supported");
                }
                let default = if scalar == Scalar::Float { Interpolation::Perspective } else { Interpolation::Flat };
                let interpolation = match interpolation {
                    None => default,
                    Some(naga::Interpolation::Perspective) => Interpolation::Perspective,
                    Some(naga::Interpolation::Linear) => Interpolation::Linear,
                    Some(naga::Interpolation::Flat) => Interpolation::Flat,
                    Some(naga::Interpolation::PerVertex) => {
                        return self.refuse("per-vertex varyings are not supported");
                    }
                };
                let sampling = match sampling {
                    Some(naga::Sampling::Centroid) => Sampling::Centroid,
                    Some(naga::Sampling::Sample) => Sampling::Sample,
                    _ => Sampling::Center,
                };
                Connection::Location { location, interpolation, sampling, blend_src: blend_src.unwrap_or(0) }
            }
        };
        Ok(Slot { connection, components, scalar, used: true })
    }

    fn builtin(&mut self, b: naga::BuiltIn) -> Result<BuiltIn> {
        use naga::BuiltIn as N;
        Ok(match b {
            N::Position { .. } => BuiltIn::Position,
            N::VertexIndex => BuiltIn::VertexIndex,
            N::InstanceIndex => BuiltIn::InstanceIndex,
            N::BaseVertex => BuiltIn::BaseVertex,
            N::BaseInstance => BuiltIn::BaseInstance,
            N::DrawIndex => BuiltIn::DrawIndex,
            N::PointSize => BuiltIn::PointSize,
            N::ClipDistances => BuiltIn::ClipDistances,
            N::FrontFacing => BuiltIn::FrontFacing,
            N::PrimitiveIndex => BuiltIn::PrimitiveIndex,
            N::SampleIndex => BuiltIn::SampleIndex,
            N::SampleMask => BuiltIn::SampleMask,
            N::FragDepth => BuiltIn::FragDepth,
            N::Barycentric { perspective } => BuiltIn::Barycentric { perspective },
            N::PointCoord => BuiltIn::PointCoord,
            N::GlobalInvocationId => BuiltIn::GlobalInvocationId,
            N::LocalInvocationId => BuiltIn::LocalInvocationId,
            N::LocalInvocationIndex => BuiltIn::LocalInvocationIndex,
            N::WorkGroupId => BuiltIn::WorkGroupId,
            N::NumWorkGroups => BuiltIn::NumWorkGroups,
            N::SubgroupSize => BuiltIn::SubgroupSize,
            N::SubgroupInvocationId => BuiltIn::SubgroupInvocationId,
            N::SubgroupId => BuiltIn::SubgroupId,
            N::NumSubgroups => BuiltIn::NumSubgroups,
            other => return self.refuse(format!("the built-in value {other:?} is not supported")),
        })
    }

    /// The interface values of a type: its own, or those of its members.
    fn slots_of(&mut self, ty: Handle<naga::Type>, binding: Option<&naga::Binding>) -> Result<Vec<Slot>> {
        if let Some(b) = binding {
            return Ok(vec![self.slot(ty, b)?]);
        }
        let module: &'a naga::Module = self.module;
        let TypeInner::Struct { ref members, .. } = module.types[ty].inner else {
            return self.refuse("an input or output without a binding");
        };
        let mut out = Vec::new();
        for m in members {
            match &m.binding {
                Some(b) => out.push(self.slot(m.ty, b)?),
                None => return self.refuse("a member of an input or output without a binding"),
            }
        }
        Ok(out)
    }

    #[allow(clippy::type_complexity)]
    fn inputs(&mut self, function: &'a naga::Function) -> Result<(Vec<Vec<V>>, Vec<Slot>, Vec<Val>)> {
        let (mut values, mut slots, mut args) = (Vec::new(), Vec::new(), Vec::new());
        for argument in &function.arguments {
            let mut all = Vec::new();
            for slot in self.slots_of(argument.ty, argument.binding.as_ref())? {
                if slot.is_builtin(BuiltIn::SubgroupSize) {
                    // A constant of this implementation: no input is needed.
                    all.push(self.b.constant(num::LANES as u32));
                    continue;
                }
                let v: Vec<V> = (0..slot.components).map(|_| self.b.define(Def::Input)).collect();
                all.extend_from_slice(&v);
                values.push(v);
                slots.push(slot);
            }
            args.push(Val::Data(all.into()));
        }
        Ok((values, slots, args))
    }

    fn outputs(
        &mut self,
        function: &'a naga::Function,
        stage: Stage,
        value: Option<Val>,
        keep: &dyn Fn(u32) -> bool,
    ) -> Result<(Vec<Vec<V>>, Vec<Slot>)> {
        let Some(result) = &function.result else { return Ok(Default::default()) };
        let slots = self.slots_of(result.ty, result.binding.as_ref())?;
        let data = match value {
            Some(Val::Data(d)) => d,
            _ => self.zeros(Ty::Named(result.ty))?.into(),
        };
        let (mut values, mut kept) = (Vec::new(), Vec::new());
        let mut first = 0;
        for slot in slots {
            let n = slot.components as usize;
            let v = data[first..first + n].to_vec();
            first += n;
            let wanted = match slot.connection {
                Connection::Location { location, .. } => keep(location),
                Connection::BuiltIn(b) => !(stage.is_geometry() && b == BuiltIn::PointSize),
            };
            if wanted {
                values.push(v);
                kept.push(slot);
            }
        }
        Ok((values, kept))
    }
}
