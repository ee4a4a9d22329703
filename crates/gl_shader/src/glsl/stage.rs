//! Connects translated stages to each other, to attributes, to texture units and to the fixed-function stages.

use std::fmt::Write;

use naga::ScalarKind;

use super::access::{Layout, vector_name};
use super::builtins::Role;
use super::emit::{Call, Named, Translated, Variable};
use super::rewrite::Storage;
use super::sampler::{Read, Sampler};
use crate::arb::program::GENERICS;
use crate::arb::program::{Output, Program, ProgramStage, input};
use crate::arb::wgsl::{input_name, output_name};
use crate::key::{Expand, ShaderKey};
use crate::{COLORS_MAX, IMAGES, STAGE_IMAGES};

/// Ways to read a texture: a bit each.
pub mod way {
    /// At coordinates.
    pub const PLAIN: u8 = 1;
    /// With a bias.
    pub const BIAS: u8 = 2;
    /// At a level of detail.
    pub const LEVEL: u8 = 4;
    /// With derivatives.
    pub const GRADIENT: u8 = 8;
    /// One texel.
    pub const FETCH: u8 = 16;
    /// Its size.
    pub const SIZE: u8 = 32;
}

/// A value that goes from the vertex stage to the fragment stage.
#[derive(Clone, Debug, PartialEq)]
pub struct Varying {
    /// Its type in WGSL.
    pub kind: String,
    /// `flat`, `linear`, or none for interpolation with perspective.
    pub interpolation: Option<&'static str>,
    /// Its expression in the vertex stage.
    pub from: String,
    /// Its expression in the fragment stage.
    pub to: String,
}

/// A GLSL stage as part of a program of the machine.
#[derive(Clone, Debug, PartialEq)]
pub struct Code {
    /// Structures, variables and functions at module scope.
    pub functions: String,
    /// The entry function of the stage.
    entry: String,
    /// Variables that are set before it runs, and their values.
    set: Vec<(String, String)>,
    /// Results, and the expressions of their values.
    results: Vec<(Output, String)>,
    /// Values that go from stage to stage.
    pub varyings: Vec<Varying>,
    /// Whether it reads `gl_FrontFacing`.
    pub facing: bool,
    /// Whether all colour buffers have the colour of `gl_FragColor`.
    pub broadcast: bool,
    /// What clip planes cut.
    pub clip: Option<Clip>,
}

/// What clip planes cut, in a vertex stage: expressions of WGSL.
#[derive(Clone, Debug, PartialEq)]
pub enum Clip {
    /// A position in eye space.
    Position(String),
    /// An array of distances, one for each plane.
    Distances(String),
}

impl Code {
    /// Whether a vertex stage can run twice for one vertex, and its results can be mixed in clip space: no variable has a value from the
    /// run before, and none is interpolated in the window.
    pub fn is_repeatable(&self) -> bool {
        let keeps = |line: &str| line.starts_with("var<private>") && line.contains('=');
        !self.functions.lines().any(keeps) && self.varyings.iter().all(|varying| varying.interpolation != Some("linear"))
    }
}

/// The bindings of a program object.
pub struct Joints<'a> {
    /// The location of an attribute.
    pub attribute: &'a dyn Fn(&str) -> Option<u32>,
    /// The location of an output, and which source of blending it is.
    pub output: &'a dyn Fn(&str) -> Option<[u32; 2]>,
    /// The unit of a sampler.
    pub unit: &'a dyn Fn(&str) -> u32,
}

/// The varyings between the stages of a program that has both.
fn varyings(vertex: &Translated, fragment: &Translated) -> Result<Vec<Varying>, String> {
    let mut list = Vec::new();
    let of = |stage: &'static Storage, from: &Translated| -> Vec<Variable> {
        from.variables.iter().filter(|variable| variable.global.storage == *stage).cloned().collect()
    };
    let written = of(&Storage::Out, vertex);
    for read in of(&Storage::In, fragment) {
        let same = |given: &&Variable| {
            given.global.name == read.global.name
                || given.global.location.is_some() && given.global.location == read.global.location
        };
        let Some(given) = written.iter().find(same) else {
            // One that is declared and not read needs no value.
            if !is_read(&fragment.text, &read.wgsl) {
                continue;
            }
            return Err(format!("the vertex shader does not write {}", read.global.name));
        };
        let (mut from, mut to) = (Vec::new(), Vec::new());
        given.layout.leaves(&given.wgsl, &mut from);
        read.layout.leaves(&read.wgsl, &mut to);
        let kinds = |leaves: &[(String, usize, ScalarKind)]| leaves.iter().map(|leaf| (leaf.1, leaf.2)).collect::<Vec<_>>();
        if kinds(&from) != kinds(&to) {
            return Err(format!("{} has another type in each shader", read.global.name));
        }
        for ((from, n, kind), (to, ..)) in from.into_iter().zip(to) {
            let whole = kind != ScalarKind::Float;
            let interpolation = if whole { Some("flat") } else { read.global.interpolation.or(given.global.interpolation) };
            list.push(Varying { kind: vector_name(n, kind), interpolation, from, to });
        }
    }
    Ok(list)
}

/// Whether the text has this name outside of its declaration.
fn is_read(text: &str, name: &str) -> bool {
    let is_part = |c: char| c.is_ascii_alphanumeric() || c == '_';
    text.split(|c: char| !is_part(c)).filter(|word| *word == name).nth(1).is_some()
}

/// The program of a stage of a program object.
pub fn program(stages: [Option<&Translated>; 2], stage: ProgramStage, joints: &Joints) -> Result<Program, String> {
    let of = stages[stage as usize - 1].ok_or("a stage that is not there")?;
    let mut code = Code {
        functions: of.text.clone(),
        entry: of.entry.clone(),
        set: Vec::new(),
        results: Vec::new(),
        varyings: match stages {
            [Some(vertex), Some(fragment)] => varyings(vertex, fragment)?,
            _ => Vec::new(),
        },
        facing: false,
        broadcast: false,
        clip: None,
    };
    let mut program = Program { invariant: of.invariant, ..Program::new(stage) };
    for named in &of.named {
        builtin(named, &mut code, &mut program);
    }
    if let (ProgramStage::Fragment, [upper, whole]) = (stage, of.coordinates) {
        let position = input_name(input::POSITION);
        for (_, value) in code.set.iter_mut().filter(|(_, value)| *value == position) {
            let y = if upper { format!("u.height.z - {position}.y") } else { format!("{position}.y") };
            let centre = if whole { "0.5" } else { "0.0" };
            *value = format!("vec4f({position}.x - {centre}, {y} - {centre}, {position}.zw)");
        }
    }
    if of.numbered() && of.named.iter().any(|named| named.role == Role::Input(input::FOG)) {
        return Err("gl_VertexID beside gl_FogCoord is not supported".into());
    }
    if of.named.iter().any(|named| named.role == Role::ClipVertex) && matches!(code.clip, Some(Clip::Distances(_))) {
        return Err("gl_ClipDistance beside gl_ClipVertex is not supported".into());
    }
    if let Some(flip) = &of.flip {
        // The uniform for this is present if the fragment position is read.
        program.inputs |= 1 << input::POSITION;
        code.set.push((flip.clone(), if stage == ProgramStage::Fragment { "u.height.y".into() } else { "1.0".into() }));
    }
    match stage {
        ProgramStage::Vertex => attributes(of, joints, &mut code, &mut program)?,
        ProgramStage::Fragment => {
            // Without a vertex shader, varyings are undefined; here they are 0.
            colors(of, joints, &mut code)?;
        }
    }
    for (k, sampler) in of.samplers.iter().enumerate().filter(|(k, _)| of.calls.iter().any(|call| call.sampler == *k)) {
        let unit = (joints.unit)(&sampler.name) as usize;
        if unit >= IMAGES {
            return Err(format!("{} is texture unit {unit}, of at most {IMAGES}", sampler.name));
        }
        if program.image(unit).is_some_and(|image| image.target != sampler.target) {
            return Err(format!("texture unit {unit} is read as textures of two kinds"));
        }
        let calls = of.calls.iter().filter(|call| call.sampler == k);
        let ways = calls.fold(0, |ways, call| ways | read(call, unit, sampler, stage, &mut code.functions));
        program.reads(unit, sampler.target, ways);
    }
    if program.images.len() > STAGE_IMAGES {
        return Err(format!("a stage reads {} textures, at most {STAGE_IMAGES}", program.images.len()));
    }
    program.outputs = code.results.iter().map(|&(output, _)| output).collect();
    program.code = Some(code);
    Ok(program)
}

/// The outputs of a fragment shader that it declares itself, at their locations.
fn colors(of: &Translated, joints: &Joints, code: &mut Code) -> Result<(), String> {
    let outputs: Vec<&Variable> = of.variables.iter().filter(|v| v.global.storage == Storage::Out).collect();
    let chosen = |v: &Variable| (joints.output)(&v.global.name);
    let location = |v: &Variable| v.global.location.or_else(|| chosen(v).map(|[location, _]| location));
    let index = |v: &Variable| v.global.index.or_else(|| chosen(v).map(|[_, index]| index)).unwrap_or(0);
    let (first, second): (Vec<&Variable>, Vec<&Variable>) = outputs.into_iter().partition(|v| index(v) == 0);
    let span = |v: &Variable| v.layout.slots().min(COLORS_MAX) as u32;
    let mut taken = 0_u64;
    for output in &first {
        if let Some(first) = location(output).filter(|&first| first < COLORS_MAX as u32) {
            taken |= ((1 << span(output)) - 1) << first;
        }
    }
    for output in first {
        let name = &output.global.name;
        let first = match location(output) {
            Some(first) => first,
            // A linker chooses; the first that is free.
            None => {
                let wanted = (1_u64 << span(output)) - 1;
                let free = (0..COLORS_MAX as u32).find(|&k| taken & wanted << k == 0);
                let first = free.ok_or_else(|| format!("no colour buffer is left for {name}"))?;
                taken |= wanted << first;
                first
            }
        };
        let mut leaves = Vec::new();
        output.layout.leaves(&output.wgsl, &mut leaves);
        for (k, (wgsl, n, kind)) in leaves.into_iter().enumerate() {
            let location = first as usize + k;
            if location >= COLORS_MAX {
                return Err(format!("{name} is colour buffer {location}, of at most {COLORS_MAX}"));
            }
            code.results.push((Output::Color(location as u8), color(name, &wgsl, n, kind)?));
        }
    }
    for output in second {
        let (name, mut leaves) = (&output.global.name, Vec::new());
        output.layout.leaves(&output.wgsl, &mut leaves);
        match &leaves[..] {
            [(wgsl, n, kind)] if index(output) == 1 && location(output).unwrap_or(0) == 0 => {
                code.results.push((Output::Second, color(name, wgsl, *n, *kind)?));
            }
            _ => return Err(format!("{name} is a source of blending other than the second one of the first colour buffer")),
        }
    }
    Ok(())
}

/// The value of a colour with `n` components.
fn color(name: &str, wgsl: &str, n: usize, kind: ScalarKind) -> Result<String, String> {
    if kind != ScalarKind::Float {
        return Err(format!("{name} is a colour of whole numbers, which is not supported"));
    }
    let rest = ["0, 0, 1", "0, 1", "1"].get(n - 1).map_or(String::new(), |rest| format!(", {rest}"));
    Ok(format!("vec4f({wgsl}{rest})"))
}

fn builtin(named: &Named, code: &mut Code, program: &mut Program) {
    let wgsl = named.wgsl.clone();
    let part =
        |name: &str| if named.components == 4 { name.to_owned() } else { format!("{name}.{}", &"xyz"[..named.components]) };
    match named.role {
        Role::Input(bit) => {
            program.inputs |= 1 << bit;
            code.set.push((wgsl, part(&input_name(bit))));
        }
        Role::Facing => {
            code.facing = true;
            code.set.push((wgsl, "front".into()));
        }
        Role::PointCoord => code.set.push((wgsl, "point_place".into())),
        Role::Output(output) => {
            code.broadcast |= wgsl.ends_with("FragColor");
            let value = if named.components == 4 { wgsl } else { format!("vec4f({wgsl})") };
            code.results.push((output, value));
        }
        Role::ClipVertex => code.clip = Some(Clip::Position(wgsl)),
        Role::ClipDistance => code.clip = Some(Clip::Distances(wgsl)),
        Role::VertexId => {
            program.numbered = true;
            program.inputs |= 1 << input::FOG;
            code.set.push((wgsl, format!("bitcast<i32>({}.x)", input_name(input::FOG))));
        }
        Role::Constant(_) | Role::State(_) => {}
    }
}

fn attributes(of: &Translated, joints: &Joints, code: &mut Code, program: &mut Program) -> Result<(), String> {
    let inputs: Vec<&Variable> = of.variables.iter().filter(|variable| variable.global.storage == Storage::In).collect();
    let given = |v: &Variable| v.global.location.or_else(|| (joints.attribute)(&v.global.name));
    let mut taken = 0_u64;
    for variable in &inputs {
        if let Some(first) = given(variable) {
            let slots = variable.layout.slots().min(GENERICS) as u32;
            taken |= ((1_u64 << slots) - 1).checked_shl(first).unwrap_or_default();
        }
    }
    for variable in inputs {
        let mut leaves = Vec::new();
        variable.layout.leaves(&variable.wgsl, &mut leaves);
        let name = &variable.global.name;
        let first = match given(variable) {
            Some(first) => first,
            // A linker chooses; the first that is free.
            None => {
                let wanted = (1_u64 << leaves.len().min(GENERICS)) - 1;
                let free = (0..GENERICS as u32).find(|&k| taken & wanted << k == 0);
                let first = free.ok_or_else(|| format!("no location is left for {name}"))?;
                taken |= wanted << first;
                first
            }
        };
        for (k, (to, n, kind)) in leaves.into_iter().enumerate() {
            let location = first as usize + k;
            if location >= GENERICS {
                return Err(format!("{name} is at location {location}, of at most {GENERICS}"));
            }
            if kind != ScalarKind::Float {
                return Err(format!("{name} is an attribute of whole numbers, which is not supported"));
            }
            let bit = if location == 0 { input::POSITION } else { input::GENERIC + location as u32 };
            program.inputs |= 1 << bit;
            code.set.push((to, format!("{}.{}", input_name(bit), &"xyzw"[..n])));
        }
    }
    Ok(())
}

/// Writes the function of a call; returns its kind of read.
fn read(call: &Call, unit: usize, sampler: &Sampler, stage: ProgramStage, out: &mut String) -> u8 {
    let kind = |layout: &Layout| match layout {
        Layout::Vector(n, kind) => (*n, vector_name(*n, *kind)),
        _ => (4, "vec4f".into()),
    };
    let arguments: Vec<(usize, String)> = call.arguments.iter().map(kind).collect();
    let first = arguments.first().map_or(0, |&(n, _)| n);
    let at = match (call.read, first) {
        (Read::Projected | Read::ProjectedLevel, 2) => "vec3f(a0.x / a0.y, 0, 0)",
        (Read::Projected | Read::ProjectedLevel, 3) => "vec3f(a0.xy / a0.z, 0)",
        (Read::Projected | Read::ProjectedLevel, _) => "a0.xyz / a0.w",
        (_, 1) => "vec3f(a0, 0, 0)",
        (_, 2) => "vec3f(a0, 0)",
        _ => "a0",
    };
    let (value, way) = match call.read {
        Read::Size => {
            let level = if arguments.is_empty() { "0" } else { "a0" };
            let part = ["x", "xy", "xy", "xyz", "xy"][sampler.target];
            (format!("texel{unit}_size({level}).{part}"), way::SIZE)
        }
        Read::Fetch => {
            let level = if arguments.len() > 1 { "a1" } else { "0" };
            let at = at.replace("vec3f", "vec3i");
            (format!("texel{unit}_fetch({at}, {level})"), way::FETCH)
        }
        Read::Gradient => {
            let wide = |name: &str| if sampler.dimensions == 1 { format!("vec2f({name}, 0)") } else { name.to_owned() };
            (format!("texel{unit}_gradient({at}, {}, {})", wide("a1"), wide("a2")), way::GRADIENT)
        }
        Read::Level | Read::ProjectedLevel => (format!("texel{unit}_level({at}, a1)"), way::LEVEL),
        // The vertex stage has no derivatives.
        Read::Plain | Read::Projected if stage == ProgramStage::Vertex => (format!("texel{unit}_level({at}, 0.0)"), way::LEVEL),
        Read::Plain | Read::Projected if arguments.len() > 1 => (format!("texel{unit}_bias({at}, a1)"), way::BIAS),
        Read::Plain | Read::Projected => (format!("texel{unit}({at})"), way::PLAIN),
    };
    let parameters: Vec<String> = arguments.iter().enumerate().map(|(k, (_, kind))| format!("a{k}: {kind}")).collect();
    let result = match (call.read, sampler.target) {
        (Read::Size, 0) => "i32",
        (Read::Size, 3) => "vec3i",
        (Read::Size, _) => "vec2i",
        _ if call.one => "f32",
        _ => "vec4f",
    };
    let part = if call.one { ".x" } else { "" };
    line!(out, "fn {}({}) -> {result} {{\n    return {value}{part};\n}}", call.wgsl, parameters.join(", "));
    way
}

/// Writes the stage into a function of the module. Inputs and results are in variables.
pub(crate) fn body(key: &ShaderKey, code: &Code, stage: ProgramStage, out: &mut String) {
    if code.set.iter().any(|(_, value)| value == "point_place") {
        match key.expand {
            Expand::No => line!(out, "    let point_place = vec2f(0.5);"),
            _ => line!(out, "    let point_place = 0.5 + vec2f(0.5, -0.5) * v.corner.xy / v.corner.z;"),
        }
    }
    for (to, value) in &code.set {
        line!(out, "    {to} = {value};");
    }
    if stage == ProgramStage::Fragment {
        for (k, varying) in code.varyings.iter().enumerate() {
            line!(out, "    {} = v.user{k};", varying.to);
        }
    }
    line!(out, "    {}();", code.entry);
    for (output, value) in &code.results {
        line!(out, "    let {} = {value};", output_name(*output));
    }
    if stage == ProgramStage::Vertex {
        for (k, varying) in code.varyings.iter().enumerate() {
            line!(out, "    o.user{k} = {};", varying.from);
        }
    }
}
