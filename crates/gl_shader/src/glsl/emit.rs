//! Emits a rewritten stage as WGSL. Naga translates the text to WGSL; then uniforms replace the variables that stand for them.

use host::guarded;
use naga::front::glsl::{Frontend, Options};
use naga::valid::{Capabilities, ValidationFlags, Validator};
use naga::{AddressSpace, Expression, Handle, Literal, Module, ShaderStage, TypeInner};

use super::access::{Layout, Roots, Structures, Substitution};
use super::blocks::{self, Block, Filled};
use super::builtins::Role;
use super::outs::outs;
use super::rewrite::{FLIP, Global, RewrittenStage, Storage};
use super::sampler::{Read, Sampler};
use super::{TranslateResult, Wrong};
use crate::arb::program::Param;
use crate::arb::program::ProgramStage;

/// Number of lines in the text for naga before the first source line.
const LINES_BEFORE: u32 = 2;
/// Maximum number of vec4 slots of a stage's uniforms.
const SLOTS_MAX: usize = 4096;

/// Maximum number of vectors of a variable between stages.
const VARIABLE_MAX: usize = 64;

/// A uniform that the program sets.
#[derive(Clone, Debug, PartialEq)]
pub struct Uniform {
    /// Its name.
    pub name: String,
    /// Its type.
    pub layout: Layout,
    /// Its first vector.
    pub first: usize,
    /// Whether its declaration has an initialiser.
    pub initialised: bool,
    /// The location that its declaration states.
    pub location: Option<u32>,
}

/// An input from the previous stage or an output to the next one.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Its declaration.
    pub global: Global,
    /// Its type.
    pub layout: Layout,
    /// Its name in WGSL.
    pub wgsl: String,
}

/// A built-in name in WGSL.
#[derive(Clone, Debug, PartialEq)]
pub struct Named {
    /// Its meaning.
    pub role: Role,
    /// Its name in WGSL.
    pub wgsl: String,
    /// Its components.
    pub components: usize,
}

/// A function that reads a texture.
#[derive(Clone, Debug, PartialEq)]
pub struct Call {
    /// Its name in WGSL.
    pub wgsl: String,
    /// The sampler.
    pub sampler: usize,
    /// How it reads.
    pub read: Read,
    /// Types of its arguments.
    pub arguments: Vec<Layout>,
    /// Whether it returns a scalar.
    pub one: bool,
}

/// A stage in WGSL. Sampler units, locations and the other stage are known only later.
#[derive(Clone, Debug, PartialEq)]
pub struct Translated {
    /// Structures, constants, variables and functions.
    pub text: String,
    /// The entry function of the stage.
    pub entry: String,
    /// Uniforms that the program sets.
    pub uniforms: Vec<Uniform>,
    /// vec4 slots of uniforms: the machine's state that fills each, or none if the program sets it.
    pub slots: Vec<Option<(Param, u8)>>,
    /// Values of uniforms before the program sets them.
    pub defaults: Vec<[f32; 4]>,
    /// Samplers.
    pub samplers: Vec<Sampler>,
    /// Uniform blocks.
    pub blocks: Vec<Block>,
    /// Vectors of uniforms that come from buffers.
    pub filled: Vec<Filled>,
    /// Functions that read textures.
    pub calls: Vec<Call>,
    /// Variables that come from or go to other stages.
    pub variables: Vec<Variable>,
    /// Built-in names that the stage uses.
    pub named: Vec<Named>,
    /// The factor of derivatives along y.
    pub flip: Option<String>,
    /// Whether the position is that of the fixed-function pipeline.
    pub invariant: bool,
    /// How the position of a fragment is counted ([`RewrittenStage`]).
    pub coordinates: [bool; 2],
}

impl Translated {
    /// Whether it reads the number of the vertex.
    #[inline]
    pub fn numbered(&self) -> bool {
        self.named.iter().any(|named| named.role == Role::VertexId)
    }

    /// Uniforms and samplers whose declarations state a location.
    #[inline]
    pub fn located(&self) -> impl Iterator<Item = (&str, u32)> {
        let uniforms = self.uniforms.iter().map(|uniform| (uniform.name.as_str(), uniform.location));
        let samplers = self.samplers.iter().map(|sampler| (sampler.name.as_str(), sampler.location));
        uniforms.chain(samplers).filter_map(|(name, location)| Some((name, location?)))
    }
}

/// Translates a stage. `array` is the expression of the array of its uniforms.
pub fn translate(stage: ProgramStage, source: &RewrittenStage, array: &str) -> TranslateResult<Translated> {
    let mut module = parse(stage, source)?;
    module.entry_points.clear();
    guarded(|| outs(&mut module)).map_err(|reason| Wrong::at(0, reason))?;
    let prefix = match stage {
        ProgramStage::Vertex => "vs_",
        ProgramStage::Fragment => "fs_",
    };
    // Both stages are one module of WGSL.
    let names: Vec<String> =
        module.global_variables.iter().map(|(_, global)| global.name.clone().unwrap_or_default()).collect();
    let functions: Vec<String> =
        module.functions.iter().map(|(_, function)| function.name.clone().unwrap_or_default()).collect();
    let mark = |name: &mut Option<String>| *name = name.as_ref().map(|name| format!("{prefix}{name}"));
    module.global_variables.iter_mut().for_each(|(_, global)| mark(&mut global.name));
    for (_, function) in module.functions.iter_mut() {
        mark(&mut function.name);
        // The uniforms of the machine are in `u`.
        let locals = function.local_variables.iter_mut().map(|(_, local)| &mut local.name);
        let arguments = function.arguments.iter_mut().map(|argument| &mut argument.name);
        for name in locals.chain(arguments).flatten().filter(|name| *name == "u") {
            *name = "own_u".into();
        }
        function.named_expressions.values_mut().filter(|name| *name == "u").for_each(|name| *name = "own_u".into());
    }
    module.constants.iter_mut().for_each(|(_, constant)| mark(&mut constant.name));
    let structures: Vec<Handle<naga::Type>> = module
        .types
        .iter()
        .filter(|(_, kind)| matches!(kind.inner, TypeInner::Struct { .. }))
        .map(|(handle, _)| handle)
        .collect();
    for &handle in &structures {
        let mut kind = module.types[handle].clone();
        mark(&mut kind.name);
        module.types.replace(handle, kind);
    }
    let wrong = |reason: String| Wrong::at(0, reason);
    let flags = ValidationFlags::all() & !ValidationFlags::CONTROL_FLOW_UNIFORMITY;
    let info = guarded(|| {
        Validator::new(flags, Capabilities::all()).validate(&module).map_err(|error| {
            let line = error.location(&source.text).map_or(0, |place| line_of(source, place.line_number));
            Wrong::at(line, chain(error.as_inner()))
        })
    });
    let info = info.map_err(wrong)??;
    let write = || naga::back::wgsl::write_string(&module, &info, naga::back::wgsl::WriterFlags::empty());
    let text = guarded(write).map_err(wrong)?.map_err(|error| wrong(chain(&error)))?;
    let parts = Parts::of(&text).ok_or_else(|| wrong("WGSL of an unknown form".into()))?;
    if parts.globals.len() != names.len()
        || parts.functions.len() != functions.len()
        || parts.structures.len() != structures.len()
    {
        return Err(wrong("a resource that is not supported".into()));
    }
    let written = |&(name, text): &(&str, &str)| (name.to_owned(), members(text));
    let structures: Structures = structures.iter().copied().zip(parts.structures.iter().map(written)).collect();

    let mut out = Translated {
        text: String::new(),
        entry: String::new(),
        uniforms: Vec::new(),
        slots: Vec::new(),
        defaults: Vec::new(),
        samplers: source.samplers.clone(),
        blocks: source.blocks.clone(),
        filled: Vec::new(),
        calls: Vec::new(),
        variables: Vec::new(),
        named: Vec::new(),
        flip: None,
        invariant: source.invariant,
        coordinates: source.coordinates,
    };
    let mut roots = Roots::new();
    let mut ends = vec![0; source.blocks.len()];
    let mut variables = String::new();
    for (((_, global), name), &(wgsl, line)) in module.global_variables.iter().zip(&names).zip(&parts.globals) {
        if global.space != AddressSpace::Private {
            return Err(wrong(format!("{name} is a resource that is not supported")));
        }
        if global.init.is_none() && source.initialised.contains(name) {
            return Err(wrong(format!("{name} has an initialiser that is no constant, which is not supported")));
        }
        let layout = || {
            let bytes = module.types[global.ty].inner.size(module.to_ctx());
            if bytes as usize > 16 * SLOTS_MAX {
                return Err(wrong(format!("{name} has {bytes} bytes, at most {}", 16 * SLOTS_MAX)));
            }
            Layout::of(&module, global.ty, &structures).map_err(|reason| wrong(format!("{name} has {reason}")))
        };
        let declared = source.globals.iter().find(|known| known.renamed == *name);
        let builtin = source.builtins.get(name);
        if let Some(&Global { storage: Storage::Uniform, ref name, location, block, .. }) = declared {
            let (layout, first) = (layout()?, out.slots.len());
            let count = layout.slots();
            if first.saturating_add(count) > SLOTS_MAX {
                return Err(wrong(format!("more than {SLOTS_MAX} vectors of uniforms")));
            }
            out.slots.resize(first + count, None);
            out.defaults.resize(first + count, [0.0; 4]);
            if let Some(init) = global.init {
                initial(&module, init, &layout, &mut out.defaults[first..]);
            }
            roots.insert(wgsl.to_owned(), (layout.clone(), first));
            if let Some(block) = block {
                let (start, end) = blocks::place(&layout, ends[block]);
                ends[block] = end;
                blocks::fill(&layout, block, start, &mut first.clone(), &mut out.filled);
                continue;
            }
            out.uniforms.push(Uniform { name: name.clone(), layout, first, initialised: global.init.is_some(), location });
            continue;
        }
        if let Some(Role::State(slots)) = builtin.map(|builtin| &builtin.role) {
            let layout = layout()?;
            debug_assert_eq!(layout.slots(), slots.len(), "{name}");
            roots.insert(wgsl.to_owned(), (layout, out.slots.len()));
            out.slots.extend(slots.iter().map(|slot| Some(*slot)));
            out.defaults.resize(out.slots.len(), [0.0; 4]);
            continue;
        }
        variables.push_str(line);
        variables.push('\n');
        if let Some(global) = declared {
            let layout = layout()?;
            if layout.slots() > VARIABLE_MAX {
                return Err(wrong(format!("{name} has {} vectors, at most {VARIABLE_MAX}", layout.slots())));
            }
            out.variables.push(Variable { global: global.clone(), layout, wgsl: wgsl.to_owned() });
        } else if let Some(builtin) = builtin {
            let components = match layout()? {
                Layout::Vector(n, _) => n,
                _ => 1,
            };
            out.named.push(Named { role: builtin.role.clone(), wgsl: wgsl.to_owned(), components });
        } else if name == FLIP {
            out.flip = Some(wgsl.to_owned());
        }
    }
    let mut bodies = String::new();
    let mut calls = Vec::new();
    for (((_, function), name), &(wgsl, body)) in module.functions.iter().zip(&functions).zip(&parts.functions) {
        if let Some(&(sampler, read)) = source.reads.get(name) {
            let arguments = function
                .arguments
                .iter()
                .map(|argument| Layout::of(&module, argument.ty, &structures).map_err(wrong))
                .collect::<TranslateResult<_>>()?;
            calls.push(Call { wgsl: wgsl.to_owned(), sampler, read, arguments, one: name.contains("One_") });
            continue;
        }
        if name == "main" && function.arguments.is_empty() {
            out.entry = wgsl.to_owned();
        }
        bodies.push_str(body);
    }
    if out.entry.is_empty() {
        return Err(wrong("no function main".into()));
    }
    calls.retain(|call| bodies.contains(&format!("{}(", call.wgsl)));
    out.calls = calls;
    for (_, structure) in &parts.structures {
        out.text.push_str(structure);
    }
    out.text.push_str(&parts.constants);
    out.text.push_str(&variables);
    out.text.push_str(&Substitution::new(&roots, array).functions(&bodies).map_err(wrong)?);
    Ok(out)
}

/// An error with all its causes.
fn chain(error: &dyn std::error::Error) -> String {
    let mut text = error.to_string();
    let mut cause = error.source();
    while let Some(error) = cause {
        text += &format!(": {error}");
        cause = error.source();
    }
    text.replace("glx_", "gl_")
}

/// The line of the source of a line of the text for naga.
fn line_of(source: &RewrittenStage, line: u32) -> u32 {
    let line = line.checked_sub(LINES_BEFORE + 1).and_then(|line| source.lines.get(line as usize).or(source.lines.last()));
    line.copied().unwrap_or(0)
}

fn parse(stage: ProgramStage, source: &RewrittenStage) -> TranslateResult<Module> {
    let text = &source.text;
    let stage = match stage {
        ProgramStage::Vertex => ShaderStage::Vertex,
        ProgramStage::Fragment => ShaderStage::Fragment,
    };
    // A recording can have any text, and this front end is not made for that.
    match guarded(|| Frontend::default().parse(&Options::from(stage), text)).map_err(|reason| Wrong::at(0, reason))? {
        Ok(module) => Ok(module),
        Err(errors) => {
            let Some(error) = errors.errors.first() else { return Err(Wrong::at(0, "an error without a name")) };
            let line = error.location(text).map_or(0, |place| line_of(source, place.line_number));
            Err(Wrong::at(line, chain(&error.kind)))
        }
    }
}

/// Writes the initial value of a uniform to its vectors.
fn initial(module: &Module, init: Handle<Expression>, layout: &Layout, to: &mut [[f32; 4]]) {
    let (mut values, mut leaves) = (Vec::new(), Vec::new());
    scalars(module, init, &mut values);
    layout.leaves("", &mut leaves);
    let mut values = values.into_iter();
    for (slot, (_, components, _)) in to.iter_mut().zip(leaves) {
        for component in &mut slot[..components] {
            *component = values.next().unwrap_or_default();
        }
    }
}

/// The scalars of a constant expression, with the bits as stored in uniforms.
fn scalars(module: &Module, expression: Handle<Expression>, out: &mut Vec<f32>) {
    match &module.global_expressions[expression] {
        Expression::Literal(literal) => out.push(match *literal {
            Literal::F32(value) => value,
            Literal::F64(value) | Literal::AbstractFloat(value) => value as f32,
            Literal::I32(value) => f32::from_bits(value as u32),
            Literal::U32(value) => f32::from_bits(value),
            Literal::AbstractInt(value) => f32::from_bits(value as u32),
            Literal::Bool(value) => f32::from(u8::from(value)),
            _ => 0.0,
        }),
        Expression::Constant(constant) => scalars(module, module.constants[*constant].init, out),
        Expression::Compose { components, .. } => components.iter().for_each(|&part| scalars(module, part, out)),
        Expression::Splat { size, value } => (0..*size as usize).for_each(|_| scalars(module, *value, out)),
        // The rest is zero.
        _ => {}
    }
}

/// The names of the members of a structure that naga has written, one per line.
fn members(structure: &str) -> Vec<String> {
    let name = |line: &str| Some(line.strip_suffix(',')?.split_once(": ")?.0.split_whitespace().next_back()?.to_owned());
    structure.lines().filter_map(name).collect()
}

/// Naga's output in parts: names, and texts that end in a new line.
struct Parts<'a> {
    structures: Vec<(&'a str, &'a str)>,
    constants: String,
    globals: Vec<(&'a str, &'a str)>,
    functions: Vec<(&'a str, &'a str)>,
}

impl<'a> Parts<'a> {
    fn of(text: &'a str) -> Option<Parts<'a>> {
        let mut parts = Parts { structures: Vec::new(), constants: String::new(), globals: Vec::new(), functions: Vec::new() };
        let mut at = 0;
        while at < text.len() {
            let rest = &text[at..];
            let line = rest.lines().next()?;
            let mut end = at + line.len() + 1;
            if let Some(from) = line.strip_prefix("struct ") {
                end = at + rest.find("\n}\n")? + 3;
                parts.structures.push((from.split_once(' ')?.0, &text[at..end]));
            } else if let Some(from) = line.strip_prefix("fn ") {
                end = at + rest.find("\n}\n")? + 3;
                parts.functions.push((from.split_once('(')?.0, &text[at..end]));
            } else if let Some(from) = line.strip_prefix("var<private> ") {
                parts.globals.push((from.split_once(':')?.0, line));
            } else if line.starts_with("const ") {
                parts.constants.push_str(line);
                parts.constants.push('\n');
            } else if !line.is_empty() {
                return None;
            }
            at = end.min(text.len());
        }
        Some(parts)
    }
}
