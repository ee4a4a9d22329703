//! Programs in GLSL: shader and program objects, uniforms, and what a draw takes of them.
//!
//! The way of a shader: [`tokens`] (preprocessor), [`rewrite`] (dialect of version 4.50, names of OpenGL as plain variables), naga's front
//! end and its WGSL ([`emit`]), uniforms in the place of variables ([`access`]), and the stage in the machine's module ([`stage`]), where
//! fixed functions do what programs leave.

mod access;
mod builtins;
mod emit;
mod rewrite;
pub mod stage;
mod tokens;

use std::collections::BTreeMap;
use std::rc::Rc;

use host::with_room_for;
use naga::ScalarKind;
use num::Limits;

use super::arb::{Active, Loaded, Stage};
use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Outcome as CallOutcome, Scalar, Shape};
use super::machine::Gl;
use access::Layout;
use emit::{Translated, translate};
use stage::Joints;

/// Tokens of a shader at most.
const TOKENS_MAX: usize = 1 << 18;
/// Bytes of a shader's source at most.
const SOURCE_MAX: usize = 1 << 22;

const FRAGMENT_SHADER: u32 = 0x8b30;
const VERTEX_SHADER: u32 = 0x8b31;

/// What is wrong with a shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wrong {
    /// The line of its source; 0 if that is not known.
    pub line: u32,
    /// What.
    pub reason: String,
}

impl Wrong {
    fn at(line: u32, reason: impl Into<String>) -> Wrong {
        Wrong { line, reason: reason.into() }
    }
}

type Outcome<T = ()> = Result<T, Wrong>;

/// A shader object.
#[derive(Clone)]
struct Shader {
    stage: Stage,
    source: Rc<str>,
    /// The source when it was compiled.
    compiled: Option<Rc<str>>,
}

/// Both stages of a program after they have been translated.
struct Linked {
    number: u32,
    stages: [Option<Translated>; 2],
}

impl Linked {
    fn stages(&self) -> [Option<&Translated>; 2] {
        self.stages.each_ref().map(Option::as_ref)
    }
}

/// A program object.
#[derive(Clone, Default)]
struct Object {
    attached: Vec<u32>,
    /// Locations that the program has chosen.
    attributes: BTreeMap<String, u32>,
    outputs: BTreeMap<String, u32>,
    linked: Option<Result<Rc<Linked>, String>>,
    /// Names of uniforms by location.
    locations: BTreeMap<i64, String>,
    /// Values of uniforms of both stages.
    values: [Vec<[f32; 4]>; 2],
    /// Units of samplers.
    units: BTreeMap<String, u32>,
}

/// Sources of both stages.
type Sources = [Vec<Rc<str>>; 2];
/// What decides a stage's program: the linked program, the stage, units of samplers, locations of attributes and outputs.
type CodeKey = (u32, Stage, Vec<u32>, Vec<Option<u32>>);

/// Shader and program objects.
#[derive(Default)]
pub struct Glsl {
    shaders: BTreeMap<u32, Shader>,
    objects: BTreeMap<u32, Object>,
    /// The program that is used; 0: none.
    current: u32,
    linked: BTreeMap<Sources, Result<Rc<Linked>, String>>,
    codes: BTreeMap<CodeKey, Result<Loaded, String>>,
}

impl Glsl {
    /// Objects of one kind at most.
    pub fn len(&self) -> usize {
        self.shaders.len().max(self.objects.len()).max(self.linked.len()).max(self.codes.len())
    }

    /// Whether a program is used that has a stage.
    pub fn has(&self, stage: Stage) -> bool {
        match self.objects.get(&self.current).and_then(|object| object.linked.as_ref()) {
            Some(Ok(linked)) => linked.stages[stage as usize - 1].is_some(),
            _ => false,
        }
    }

    /// Whether a program is used.
    pub fn used(&self) -> bool {
        self.current != 0
    }
}

fn link(number: u32, sources: &Sources, limits: &Limits) -> Result<Rc<Linked>, String> {
    let mut stages = [None, None];
    for (k, (stage, texts)) in [Stage::Vertex, Stage::Fragment].into_iter().zip(sources).enumerate() {
        if texts.is_empty() {
            continue;
        }
        let array = ["u.vertex_params", "u.fragment_params"][k];
        let translated = (|| {
            let tokens = texts.iter().map(|text| tokens::preprocess(text)).collect::<Outcome<Vec<_>>>()?;
            for (_, tokens) in &tokens {
                let levels = tokens::nesting(tokens);
                limits.shader_nesting.check(levels).map_err(|error| Wrong::at(0, error.to_string()))?;
                limits.shader_constants.check(tokens::reach(tokens)).map_err(|error| Wrong::at(0, error.to_string()))?;
            }
            let run = || translate(stage, &rewrite::rewrite(stage, tokens)?, array);
            with_room_for(limits.shader_nesting.get(), run).unwrap_or_else(|reason| Err(Wrong::at(0, reason)))
        })();
        let name = ["vertex", "fragment"][k];
        stages[k] = Some(translated.map_err(|wrong| match wrong.line {
            0 => format!("{name} shader: {}", wrong.reason),
            line => format!("{name} shader, line {line}: {}", wrong.reason),
        })?);
    }
    Ok(Rc::new(Linked { number, stages }))
}

impl Gl {
    /// The stage of the program that is used.
    pub fn glsl_program(&mut self, stage: Stage) -> CallOutcome<Option<Active>> {
        let index = stage as usize - 1;
        let object = self.glsl.objects.get(&self.glsl.current).ok_or(INVALID_OPERATION)?;
        let refused = |reason: &str| Fault::Unsupported(format!("drawing with GLSL program {}: {reason}", self.glsl.current));
        let linked = match &object.linked {
            None => return Err(INVALID_OPERATION),
            Some(Err(reason)) => return Err(refused(reason)),
            Some(Ok(linked)) => linked,
        };
        let Some(translated) = &linked.stages[index] else { return Ok(None) };
        let unit = |name: &str| object.units.get(name).copied().unwrap_or(0);
        let units = translated.samplers.iter().map(|sampler| unit(&sampler.name)).collect();
        let locations = [&object.attributes, &object.outputs][index];
        let location = |name: &str| locations.get(name).copied();
        let chosen = translated.variables.iter().map(|variable| location(&variable.global.name)).collect();
        let key: CodeKey = (linked.number, stage, units, chosen);
        let loaded = match self.glsl.codes.get(&key) {
            Some(loaded) => loaded.clone(),
            None => {
                let joints = Joints { attribute: &location, output: &location, unit: &unit };
                let program = stage::program(linked.stages(), stage, &joints);
                let number = self.programs.number();
                let loaded = program.map(|program| Loaded { number, program: Rc::new(program) });
                self.glsl.codes.insert(key, loaded.clone());
                loaded
            }
        };
        let object = &self.glsl.objects[&self.glsl.current];
        let Loaded { number, program } = loaded.map_err(|reason| refused(&reason))?;
        let given = object.values[index].iter().zip(&translated.slots);
        let values = given.map(|(value, slot)| match slot {
            None => *value,
            Some((param, component)) => {
                let mut value = super::arb::state_value(self, *param);
                value.rotate_left(usize::from(*component));
                value
            }
        });
        Ok(Some(Active { number, program, values: values.collect() }))
    }

    fn glsl_object(&mut self, name: u32) -> CallOutcome<&mut Object> {
        self.glsl.objects.get_mut(&name).ok_or(INVALID_VALUE)
    }
}

/// The name that a call gives to a new object.
fn created(call: &Call) -> CallOutcome<u32> {
    match call.result {
        Arg::Num(name) if name > 0.0 => Ok(name as u32),
        Arg::Num(_) => Err(INVALID_OPERATION),
        _ => Err(Fault::Damaged("the name of the new object was not recorded".into())),
    }
}

pub(super) fn create_shader(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let stage = match call.u32(0)? {
        VERTEX_SHADER => Stage::Vertex,
        FRAGMENT_SHADER => Stage::Fragment,
        other => return Err(Fault::Unsupported(format!("shaders of the stage {}", super::names::name(other)))),
    };
    gl.glsl.shaders.insert(created(call)?, Shader { stage, source: "".into(), compiled: None });
    Ok(())
}

/// `glShaderSource(shader, count, strings, lengths)`
pub(super) fn shader_source(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let mut text = String::new();
    // A plain number is a null pointer.
    let lengths = if let Arg::Nums(lengths) = call.arg(3) { Some(lengths) } else { None };
    let strings: &[Arg] = match call.arg(2) {
        Arg::List(list) => list,
        one => std::slice::from_ref(one),
    };
    for (k, string) in strings.iter().enumerate() {
        let string: String = match string {
            Arg::Str(text) => text.to_string(),
            Arg::Blob(bytes) => String::from_utf8_lossy(bytes).into(),
            _ => return Err(Fault::Damaged("the shader's source was not recorded".into())),
        };
        let length = lengths.as_ref().and_then(|lengths| lengths.get(k)).filter(|&&length| length >= 0.0);
        text.push_str(length.and_then(|&length| string.get(..length as usize)).unwrap_or(&string));
    }
    if text.len() > SOURCE_MAX {
        return Err(Fault::Limit(format!("a shader of {} bytes, at most {SOURCE_MAX}", text.len())));
    }
    gl.glsl.shaders.get_mut(&call.u32(0)?).ok_or(INVALID_VALUE)?.source = text.into();
    Ok(())
}

pub(super) fn compile_shader(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let shader = gl.glsl.shaders.get_mut(&call.u32(0)?).ok_or(INVALID_VALUE)?;
    shader.compiled = Some(shader.source.clone());
    Ok(())
}

pub(super) fn create_program(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    gl.glsl.objects.insert(created(call)?, Object::default());
    Ok(())
}

pub(super) fn attach(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let shader = call.u32(1)?;
    if !gl.glsl.shaders.contains_key(&shader) {
        return Err(INVALID_VALUE);
    }
    let object = gl.glsl_object(call.u32(0)?)?;
    if object.attached.contains(&shader) {
        return Err(INVALID_OPERATION);
    }
    object.attached.push(shader);
    Ok(())
}

pub(super) fn detach(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let shader = call.u32(1)?;
    gl.glsl_object(call.u32(0)?)?.attached.retain(|&known| known != shader);
    Ok(())
}

pub(super) fn link_program(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    gl.flush()?;
    let name = call.u32(0)?;
    let attached = gl.glsl_object(name)?.attached.clone();
    let mut sources = Sources::default();
    for shader in attached.iter().filter_map(|shader| gl.glsl.shaders.get(shader)) {
        let text = shader.compiled.clone().ok_or(INVALID_OPERATION)?;
        sources[shader.stage as usize - 1].push(text);
    }
    let number = gl.glsl.linked.len() as u32;
    let linked = gl.glsl.linked.entry(sources).or_insert_with_key(|sources| link(number, sources, &gl.limits)).clone();
    let object = gl.glsl_object(name)?;
    (object.locations, object.units) = (BTreeMap::new(), BTreeMap::new());
    if let Ok(linked) = &linked {
        for (values, stage) in object.values.iter_mut().zip(linked.stages()) {
            *values = stage.map(|stage| stage.defaults.clone()).unwrap_or_default();
        }
    }
    object.linked = Some(linked);
    Ok(())
}

pub(super) fn use_program(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = call.u32(0)?;
    if name != 0 {
        gl.glsl_object(name)?;
    }
    gl.glsl.current = name;
    Ok(())
}

pub(super) fn delete_shader(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = call.u32(0)?;
    // What is attached stays until it is not.
    if !gl.glsl.objects.values().any(|object| object.attached.contains(&name)) {
        gl.glsl.shaders.remove(&name);
    }
    Ok(())
}

pub(super) fn delete_program(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = call.u32(0)?;
    // The program that is used stays until it is not.
    if gl.glsl.current != name {
        gl.flush()?;
        gl.glsl.objects.remove(&name);
    }
    Ok(())
}

/// `glDeleteObjectARB`: a shader or a program.
pub(super) fn delete_object(gl: &mut Gl, call: &Call, shape: Shape) -> CallOutcome {
    if gl.glsl.shaders.contains_key(&call.u32(0)?) { delete_shader(gl, call, shape) } else { delete_program(gl, call, shape) }
}

fn text(call: &Call, index: usize) -> CallOutcome<String> {
    match call.arg(index) {
        Arg::Str(text) => Ok(text.to_string()),
        Arg::Blob(bytes) => Ok(String::from_utf8_lossy(bytes).trim_end_matches('\0').into()),
        _ => Err(Fault::Damaged(format!("argument {index} is no text"))),
    }
}

pub(super) fn bind_attribute(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let (index, name) = (call.u32(1)?, text(call, 2)?);
    gl.glsl_object(call.u32(0)?)?.attributes.insert(name, index);
    Ok(())
}

pub(super) fn bind_output(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let (index, name) = (call.u32(1)?, text(call, 2)?);
    gl.glsl_object(call.u32(0)?)?.outputs.insert(name, index);
    Ok(())
}

/// The answer of a driver, which chose the location.
fn answer(call: &Call) -> Option<i64> {
    match call.result {
        Arg::Num(location) if location >= 0.0 => Some(location as i64),
        _ => None,
    }
}

pub(super) fn attribute_location(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = text(call, 1)?;
    if let Some(location) = answer(call) {
        gl.glsl_object(call.u32(0)?)?.attributes.insert(name, location as u32);
    }
    Ok(())
}

pub(super) fn output_location(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = text(call, 1)?;
    if let Some(location) = answer(call) {
        gl.glsl_object(call.u32(0)?)?.outputs.insert(name, location as u32);
    }
    Ok(())
}

pub(super) fn uniform_location(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = text(call, 1)?;
    if let Some(location) = answer(call) {
        gl.glsl_object(call.u32(0)?)?.locations.insert(location, name);
    }
    Ok(())
}

/// Where a part of a uniform is: its layout, its first vector, and how many elements of an array begin there.
fn part(layout: &Layout, path: &str, first: usize) -> Option<(Layout, usize, usize)> {
    if path.is_empty() {
        return Some(match layout {
            Layout::Array(element, count) => (Layout::clone(element), first, *count),
            other => (other.clone(), first, 1),
        });
    }
    match layout {
        Layout::Array(element, count) => {
            let (index, rest) = path.strip_prefix('[')?.split_once(']')?;
            let index: usize = index.parse().ok().filter(|index| index < count)?;
            let at = first + index * element.slots();
            match rest {
                "" => Some((Layout::clone(element), at, count - index)),
                rest => part(element, rest, at),
            }
        }
        Layout::Struct(_, members) => {
            let rest = path.strip_prefix('.')?;
            let end = rest.find(['.', '[']).unwrap_or(rest.len());
            let mut at = first;
            for (name, member) in members {
                if *name == rest[..end] {
                    return part(member, &rest[end..], at);
                }
                at += member.slots();
            }
            None
        }
        _ => None,
    }
}

/// A name's root and the path behind it.
fn root(name: &str) -> (&str, &str) {
    name.split_at(name.find(['.', '[']).unwrap_or(name.len()))
}

/// Writes numbers to a uniform of the program `name`: `shape` is the columns and rows of each value.
fn set(gl: &mut Gl, name: u32, location: i64, shape: [usize; 2], numbers: &[f64], scalar: Scalar) -> CallOutcome {
    if location < 0 {
        return Ok(());
    }
    let unnamed = || Fault::Unsupported("uniforms at locations that the recording does not name".into());
    let object = gl.glsl_object(name)?;
    let Some(Ok(linked)) = object.linked.clone() else { return Err(INVALID_OPERATION) };
    // A uniform has a location that the program has asked for, or that its declaration states, or lies in an array behind one.
    let declared = |location: i64| {
        let mut all = linked.stages.iter().flatten().flat_map(Translated::located);
        all.find(|&(_, at)| i64::from(at) == location).map(|(name, _)| name.to_owned())
    };
    let asked = object.locations.range(..=location).next_back().map(|(&at, name)| (at, name.clone()));
    let found = asked.or_else(|| declared(location).map(|name| (location, name)));
    let Some((at, path)) = found else {
        return Err(unnamed());
    };
    let (root, rest) = root(&path);
    let offset = (location - at) as usize;
    if linked.stages.iter().flatten().any(|stage| stage.samplers.iter().any(|sampler| sampler.name == root)) {
        let unit = numbers.first().ok_or(INVALID_VALUE)?;
        object.units.insert(root.to_owned(), *unit as u32);
        return Ok(());
    }
    let [columns, rows] = shape;
    for (values, stage) in object.values.iter_mut().zip(linked.stages()) {
        let Some(uniform) = stage.and_then(|stage| stage.uniforms.iter().find(|uniform| uniform.name == root)) else {
            continue;
        };
        let (element, first, count) = part(&uniform.layout, rest, uniform.first).ok_or(INVALID_OPERATION)?;
        if offset >= count {
            return Err(unnamed());
        }
        let kind = match element {
            Layout::Vector(n, kind) if [1, n] == shape => kind,
            Layout::Matrix(c, r) if [c, r] == shape => ScalarKind::Float,
            _ => return Err(INVALID_OPERATION),
        };
        for (k, value) in numbers.chunks_exact(columns * rows).enumerate().take(count.saturating_sub(offset)) {
            let to = first + (offset + k) * element.slots();
            for (slot, column) in values[to..].iter_mut().zip(value.chunks_exact(rows)) {
                for (to, &number) in slot.iter_mut().zip(column) {
                    *to = match kind {
                        ScalarKind::Bool => f32::from(u8::from(number != 0.0)),
                        ScalarKind::Sint | ScalarKind::Uint if scalar == Scalar::Float => return Err(INVALID_OPERATION),
                        ScalarKind::Sint | ScalarKind::Uint => f32::from_bits(number as i64 as u32),
                        _ => number as f32,
                    };
                }
            }
        }
    }
    Ok(())
}

/// `glUniform3f(location, x, y, z)`, `glUniform3fv(location, count, values)`
pub(super) fn uniform(gl: &mut Gl, call: &Call, shape: Shape) -> CallOutcome {
    let n = if (1..=4).contains(&shape.count) { shape.count } else { return Err(INVALID_ENUM) };
    let numbers: Vec<f64> = if shape.vector {
        let count = call.size(1)? as usize;
        call.numbers(2)?.iter().copied().take(count.saturating_mul(n)).collect()
    } else {
        (1..=n).map(|k| call.f64(k)).collect::<CallOutcome<_>>()?
    };
    set(gl, gl.glsl.current, i64::from(call.i32(0)?), [1, n], &numbers, shape.scalar)
}

/// `glUniformMatrix4fv(location, count, transpose, values)`
fn matrices(gl: &mut Gl, call: &Call, columns: usize, rows: usize) -> CallOutcome {
    let (count, transpose, numbers) = (call.size(1)? as usize, call.bool(2)?, call.numbers(3)?);
    let mut values = Vec::new();
    for matrix in numbers.chunks_exact(columns * rows).take(count) {
        if transpose {
            values.extend((0..columns * rows).map(|k| matrix[k % rows * columns + k / rows]));
        } else {
            values.extend_from_slice(matrix);
        }
    }
    set(gl, gl.glsl.current, i64::from(call.i32(0)?), [columns, rows], &values, Scalar::Float)
}

pub(super) fn uniform_matrix(gl: &mut Gl, call: &Call, shape: Shape) -> CallOutcome {
    let n = if (2..=4).contains(&shape.count) { shape.count } else { return Err(INVALID_ENUM) };
    matrices(gl, call, n, n)
}

/// `glUniformMatrix2x3fv`: the number of columns is in the stem of the name.
pub(super) fn uniform_matrix_of(gl: &mut Gl, call: &Call, shape: Shape) -> CallOutcome {
    let columns = ["2x", "3x", "4x"].iter().position(|part| call.function.name.contains(part)).ok_or(INVALID_ENUM)? + 2;
    let rows = if (2..=4).contains(&shape.count) { shape.count } else { return Err(INVALID_ENUM) };
    matrices(gl, call, columns, rows)
}
