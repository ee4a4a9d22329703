//! Entry points: their inputs and outputs, and the invocations that run them.

use std::collections::BTreeMap;

use naga::valid::ModuleInfo;
use naga::{Binding, BuiltIn, Handle, ShaderStage, Type, TypeInner};

use super::groups::run_all;
use super::machine::{Invocation, State, World};
use super::value::{Number, Value, array_length, broken};
use super::{Batch, BatchResult, Bindings, Fault, Io, LANES};

/// The connection that a binding means.
fn connection(binding: &Binding) -> Io {
    match *binding {
        Binding::BuiltIn(BuiltIn::Position { .. }) => Io::BuiltIn(BuiltIn::Position { invariant: false }),
        Binding::BuiltIn(builtin) => Io::BuiltIn(builtin),
        Binding::Location { location, blend_src, .. } => Io::Location { location, second: blend_src == Some(1) },
    }
}

/// A value of a type from the bits of its components.
fn from_bits(module: &naga::Module, ty: Handle<Type>, component: &mut dyn FnMut() -> u32) -> Result<Value, Fault> {
    match module.types[ty].inner {
        TypeInner::Scalar(s) => Ok(Value::Number(Number::from_bits(s, component())?)),
        TypeInner::Vector { size, scalar } => {
            let numbers = (0..size as u32).map(|_| Number::from_bits(scalar, component())).collect::<Result<Vec<_>, _>>()?;
            Ok(Value::vector(&numbers))
        }
        TypeInner::Array { base, size, .. } => {
            let n = array_length(module, size).unwrap_or(0);
            Ok(Value::Parts((0..n).map(|_| from_bits(module, base, component)).collect::<Result<_, _>>()?))
        }
        ref other => Err(Fault::Unsupported(format!("an input of type {other:?}"))),
    }
}

/// The arguments of an entry point; `input` gives the bits of a component of a connection.
fn arguments(module: &naga::Module, function: &naga::Function, input: &dyn Fn(Io, usize) -> u32) -> Result<Vec<Value>, Fault> {
    let value = |ty: Handle<Type>, binding: &Binding| {
        let (io, mut next) = (connection(binding), 0);
        from_bits(module, ty, &mut || {
            next += 1;
            input(io, next - 1)
        })
    };
    let mut out = Vec::new();
    for argument in &function.arguments {
        out.push(match (&argument.binding, &module.types[argument.ty].inner) {
            (Some(binding), _) => value(argument.ty, binding)?,
            (None, TypeInner::Struct { members, .. }) => {
                let mut parts = Vec::new();
                for member in members {
                    let Some(binding) = &member.binding else { return broken("a member of an input without a binding") };
                    parts.push(value(member.ty, binding)?);
                }
                Value::Parts(parts)
            }
            (None, _) => return broken("an input without a binding"),
        });
    }
    Ok(out)
}

/// Notes the result of an entry point.
fn outputs(
    module: &naga::Module,
    function: &naga::Function,
    lane: usize,
    value: &Value,
    out: &mut BTreeMap<Io, Vec<[u32; LANES]>>,
) -> Result<(), Fault> {
    let Some(result) = &function.result else { return Ok(()) };
    let mut note = |binding: &Binding, value: &Value| {
        let mut numbers = Vec::new();
        value.flatten(&mut numbers)?;
        let components = out.entry(connection(binding)).or_insert_with(|| vec![[0; LANES]; numbers.len()]);
        for (component, number) in components.iter_mut().zip(numbers) {
            component[lane] = number.bits();
        }
        Ok(())
    };
    match (&result.binding, &module.types[result.ty].inner, value) {
        (Some(binding), ..) => note(binding, value),
        (None, TypeInner::Struct { members, .. }, Value::Parts(parts)) => {
            for (member, part) in members.iter().zip(parts) {
                let Some(binding) = &member.binding else { return broken("a member of an output without a binding") };
                note(binding, part)?;
            }
            Ok(())
        }
        _ => broken("an output without a binding"),
    }
}

/// An invocation at the beginning of its entry point.
fn begin<'a>(
    world: &mut World<'a>,
    index: usize,
    helper: bool,
    private: Vec<Option<Value>>,
    input: &dyn Fn(Io, usize) -> u32,
) -> Result<Invocation<'a>, Fault> {
    let (module, info) = (world.module, world.info);
    let function = &module.entry_points[world.entry].function;
    let mut invocation =
        Invocation { index, helper, discarded: false, frames: Vec::new(), private, state: State::Runs, result: None };
    let arguments = arguments(module, function, input)?;
    invocation.call(world, function, info.get_entry_point(world.entry), arguments, None)?;
    Ok(invocation)
}

fn find(module: &naga::Module, stage: ShaderStage, name: &str) -> Result<usize, Fault> {
    let found = module.entry_points.iter().position(|e| e.stage == stage && e.name == name);
    found.ok_or_else(|| Fault::Unsupported(format!("there is no entry point `{name}` of the {stage:?} stage")))
}

pub fn run_compute(
    module: &naga::Module,
    info: &ModuleInfo,
    entry: &str,
    groups: [u32; 3],
    bindings: &mut Bindings,
    steps: u64,
) -> Result<(), Fault> {
    let entry = find(module, ShaderStage::Compute, entry)?;
    let size = module.entry_points[entry].workgroup_size;
    let count = size.iter().product::<u32>();
    let mut world = World::new(module, info, entry, bindings, steps);
    let private = world.private_variables()?;
    let numbers = (0..groups[2]).flat_map(|z| (0..groups[1]).flat_map(move |y| (0..groups[0]).map(move |x| [x, y, z])));
    for group in numbers {
        world.clear_workgroup()?;
        let mut invocations = Vec::with_capacity(count as usize);
        for index in 0..count {
            let local = [index % size[0], index / size[0] % size[1], index / size[0] / size[1]];
            let input = |io: Io, c: usize| match io {
                Io::BuiltIn(BuiltIn::GlobalInvocationId) => group[c].wrapping_mul(size[c]).wrapping_add(local[c]),
                Io::BuiltIn(BuiltIn::LocalInvocationId) => local[c],
                Io::BuiltIn(BuiltIn::LocalInvocationIndex) => index,
                Io::BuiltIn(BuiltIn::WorkGroupId) => group[c],
                Io::BuiltIn(BuiltIn::WorkGroupSize) => size[c],
                Io::BuiltIn(BuiltIn::NumWorkGroups) => groups[c],
                Io::BuiltIn(BuiltIn::SubgroupSize) => LANES as u32,
                Io::BuiltIn(BuiltIn::SubgroupInvocationId) => index % LANES as u32,
                Io::BuiltIn(BuiltIn::SubgroupId) => index / LANES as u32,
                Io::BuiltIn(BuiltIn::NumSubgroups) => count.div_ceil(LANES as u32),
                _ => 0,
            };
            invocations.push(begin(&mut world, index as usize, false, private.clone(), &input)?);
        }
        run_all(&mut world, &mut invocations)?;
    }
    Ok(())
}

pub fn run_batch(
    module: &naga::Module,
    info: &ModuleInfo,
    stage: ShaderStage,
    entry: &str,
    batch: &Batch,
    bindings: &mut Bindings,
    steps: u64,
) -> Result<BatchResult, Fault> {
    let entry = find(module, stage, entry)?;
    let mut world = World::new(module, info, entry, bindings, steps);
    let private = world.private_variables()?;
    let mut invocations = Vec::new();
    for lane in (0..LANES).filter(|lane| (batch.active | batch.helpers) >> lane & 1 != 0) {
        let input = |io: Io, c: usize| match (io, batch.inputs.get(&io)) {
            (Io::BuiltIn(BuiltIn::SubgroupSize), _) => LANES as u32,
            (_, Some(components)) => components.get(c).map_or(0, |lanes| lanes[lane]),
            (Io::BuiltIn(BuiltIn::SubgroupInvocationId), None) => lane as u32,
            _ => 0,
        };
        let helper = batch.active >> lane & 1 == 0;
        invocations.push(begin(&mut world, lane, helper, private.clone(), &input)?);
    }
    run_all(&mut world, &mut invocations)?;
    let mut outcome = BatchResult::default();
    for invocation in &invocations {
        if invocation.has_effects() {
            outcome.live |= 1 << invocation.index;
        }
        if let Some(value) = &invocation.result {
            let function = &module.entry_points[entry].function;
            outputs(module, function, invocation.index, value, &mut outcome.outputs)?;
        }
    }
    Ok(outcome)
}
