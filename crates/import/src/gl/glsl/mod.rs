//! GLSL: shader and program objects, uniforms, and the stages that a draw uses. [`gl_shader::glsl`] translates them.

pub mod uniforms;

use std::collections::BTreeMap;
use std::rc::Rc;

use num::{NameMap, NumberMap};

use gl_shader::glsl::{Linked, Sources, link, stage};
use naga::ScalarKind;

use super::arb::{Active, Loaded, Stage};
use super::call::{Arg, Call, Fault, INVALID_OPERATION, INVALID_VALUE, Outcome as CallOutcome, Shape};
use super::machine::Gl;

/// Maximum number of bytes of a shader's source.
const SOURCE_MAX: usize = 1 << 22;

const FRAGMENT_SHADER: u32 = 0x8b30;
const VERTEX_SHADER: u32 = 0x8b31;
const LINK_STATUS: u32 = 0x8b82;

/// A shader object.
#[derive(Clone)]
struct Shader {
    /// The stage; that of others is refused when a program with it draws.
    stage: Result<Stage, u32>,
    source: Rc<str>,
    /// The source when it was compiled.
    compiled: Option<Rc<str>>,
}

/// A program object.
#[derive(Clone, Default)]
struct Object {
    attached: Vec<u32>,
    /// Locations that the program has chosen.
    attributes: NameMap<u32>,
    /// Also which source of blending each is.
    outputs: NameMap<[u32; 2]>,
    executable: Executable,
    /// What it was before the last link, until the recording says how that went.
    before: Option<Executable>,
    /// Whether the last link has failed, as the recording says.
    failed: bool,
}

/// What linking makes of a program object.
#[derive(Clone, Default)]
struct Executable {
    linked: Option<Result<Rc<Linked>, String>>,
    /// Names of uniforms by location.
    locations: NumberMap<u64, String>,
    /// Values of uniforms of both stages.
    values: [Vec<[f32; 4]>; 2],
    /// Units of samplers.
    units: NameMap<u32>,
    /// Names of uniform blocks by index, as the recorded driver has numbered them.
    block_names: NumberMap<u64, String>,
    /// Bindings of uniform blocks that the program has chosen.
    bindings: NameMap<u32>,
}

/// The key of a stage's translated program: the linked program, the stage, units of samplers, locations of attributes and outputs.
type CodeKey = (u32, Stage, Vec<u32>, Vec<Option<[u32; 2]>>);

/// Shader and program objects.
#[derive(Default)]
pub struct Glsl {
    shaders: NumberMap<u32, Shader>,
    objects: NumberMap<u32, Object>,
    /// The current program; 0: none.
    current: u32,
    linked: BTreeMap<Sources, Result<Rc<Linked>, String>>,
    codes: BTreeMap<CodeKey, Result<Loaded, String>>,
}

/// The part of [`Glsl`] that belongs to a share group.
#[derive(Default)]
pub struct OfGroup {
    shaders: NumberMap<u32, Shader>,
    objects: NumberMap<u32, Object>,
}

impl OfGroup {
    /// Whether there are no objects.
    pub fn is_empty(&self) -> bool {
        self.shaders.is_empty() && self.objects.is_empty()
    }
}

impl Glsl {
    /// Exchanges the current program, which belongs to a context, and the objects of its share group.
    pub fn exchange(&mut self, current: &mut u32, group: &mut OfGroup) {
        std::mem::swap(&mut self.current, current);
        std::mem::swap(&mut self.shaders, &mut group.shaders);
        std::mem::swap(&mut self.objects, &mut group.objects);
    }

    /// The number of objects of the most numerous kind.
    pub fn len(&self) -> usize {
        self.shaders.len().max(self.objects.len()).max(self.linked.len()).max(self.codes.len())
    }

    /// What linking has made of the current program.
    fn linked(&self) -> Option<&Result<Rc<Linked>, String>> {
        self.objects.get(self.current)?.executable.linked.as_ref()
    }

    /// Whether the current program has a stage. One that cannot be translated may have any.
    pub fn has(&self, stage: Stage) -> bool {
        match self.linked() {
            Some(Ok(linked)) => linked.stages[stage as usize - 1].is_some(),
            Some(Err(_)) => true,
            None => false,
        }
    }

    /// Whether the current program reads the number of the vertex.
    pub fn numbers_vertices(&self) -> bool {
        matches!(self.linked(), Some(Ok(linked)) if linked.stages[0].as_ref().is_some_and(|stage| stage.numbered()))
    }

    /// Whether the current program reads uniform blocks.
    pub fn reads_blocks(&self) -> bool {
        match self.linked() {
            Some(Ok(linked)) => linked.stages.iter().flatten().any(|stage| !stage.blocks.is_empty()),
            _ => false,
        }
    }

    /// Whether there is a current program.
    pub fn used(&self) -> bool {
        self.current != 0
    }
}

impl Gl {
    /// The stage of the current program.
    pub fn glsl_program(&mut self, stage: Stage) -> CallOutcome<Option<Active>> {
        let index = stage as usize - 1;
        let object = self.glsl.objects.get(self.glsl.current).ok_or(INVALID_OPERATION)?;
        let refused = |reason: &str| Fault::Unsupported(format!("drawing with GLSL program {}: {reason}", self.glsl.current));
        let linked = match &object.executable.linked {
            None => return Err(INVALID_OPERATION),
            Some(Err(reason)) => return Err(refused(reason)),
            Some(Ok(linked)) => linked,
        };
        let Some(translated) = &linked.stages[index] else { return Ok(None) };
        let unit = |name: &str| object.executable.units.get(name).copied().unwrap_or(0);
        let units = translated.samplers.iter().map(|sampler| unit(&sampler.name)).collect();
        let attribute = |name: &str| object.attributes.get(name).copied();
        let output = |name: &str| object.outputs.get(name).copied();
        let location = |name: &str| if stage == Stage::Vertex { attribute(name).map(|at| [at, 0]) } else { output(name) };
        let chosen = translated.variables.iter().map(|variable| location(&variable.global.name)).collect();
        let key: CodeKey = (linked.number, stage, units, chosen);
        let loaded = match self.glsl.codes.get(&key) {
            Some(loaded) => loaded.clone(),
            None => {
                let joints = stage::Joints { attribute: &attribute, output: &output, unit: &unit };
                let program = stage::program(linked.stages(), stage, &joints);
                let number = self.programs.number();
                let loaded = program.map(|program| Loaded { number, program: Rc::new(program) });
                self.glsl.codes.insert(key, loaded.clone());
                loaded
            }
        };
        let object = self.glsl.objects.get(self.glsl.current).ok_or(INVALID_OPERATION)?;
        let Loaded { number, program } = loaded.map_err(|reason| refused(&reason))?;
        let given = object.executable.values[index].iter().zip(&translated.slots);
        let values = given.map(|(value, slot)| match slot {
            None => *value,
            Some((param, component)) => {
                let mut value = super::arb::state_value(self, *param);
                value.rotate_left(usize::from(*component));
                value
            }
        });
        let mut values: Vec<[f32; 4]> = values.collect();
        for of in &translated.filled {
            let block = &translated.blocks[of.block];
            let binding = object.executable.bindings.get(&block.name).copied().or(block.binding).unwrap_or(0);
            let bytes = self.uniform_bytes(binding)?;
            for k in 0..of.components {
                // What is behind the end of a buffer is zero, as in Mesa.
                let at = of.offset + 4 * k;
                let word = bytes.get(at..at + 4).map_or([0; 4], |word| [word[0], word[1], word[2], word[3]]);
                let word = u32::from_le_bytes(word);
                let value = if of.kind == ScalarKind::Bool { f32::from(u8::from(word != 0)) } else { f32::from_bits(word) };
                values[of.slot][k] = value;
            }
        }
        Ok(Some(Active { number, program, values }))
    }

    fn glsl_object(&mut self, name: u32) -> CallOutcome<&mut Object> {
        self.glsl.objects.get_mut(name).ok_or(INVALID_VALUE)
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
        VERTEX_SHADER => Ok(Stage::Vertex),
        FRAGMENT_SHADER => Ok(Stage::Fragment),
        other => Err(other),
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
    gl.glsl.shaders.get_mut(call.u32(0)?).ok_or(INVALID_VALUE)?.source = text.into();
    Ok(())
}

pub(super) fn compile_shader(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let shader = gl.glsl.shaders.get_mut(call.u32(0)?).ok_or(INVALID_VALUE)?;
    shader.compiled = Some(shader.source.clone());
    Ok(())
}

pub(super) fn create_program(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    gl.glsl.objects.insert(created(call)?, Object::default());
    Ok(())
}

pub(super) fn attach(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let shader = call.u32(1)?;
    if !gl.glsl.shaders.contains(shader) {
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
    let (mut sources, mut other) = (Sources::default(), None);
    for shader in attached.iter().filter_map(|&shader| gl.glsl.shaders.get(shader)) {
        let text = shader.compiled.clone().ok_or(INVALID_OPERATION)?;
        match shader.stage {
            Ok(stage) => sources[stage as usize - 1].push(text),
            Err(stage) => other = Some(stage),
        }
    }
    let number = gl.glsl.linked.len() as u32;
    let linked = match other {
        Some(stage) => Err(format!("shaders of the stage {} are not supported", super::names::name(stage))),
        None => gl.glsl.linked.entry(sources).or_insert_with_key(|sources| link(number, sources, &gl.limits)).clone(),
    };
    let object = gl.glsl_object(name)?;
    let mut executable = Executable::default();
    if let Ok(linked) = &linked {
        for (values, stage) in executable.values.iter_mut().zip(linked.stages()) {
            *values = stage.map(|stage| stage.defaults.clone()).unwrap_or_default();
        }
    }
    executable.linked = Some(linked);
    object.before = Some(std::mem::replace(&mut object.executable, executable));
    object.failed = false;
    Ok(())
}

/// `glGetProgramiv(program, GL_LINK_STATUS, status)`: a link that has failed leaves the current program's executable as it was
/// (OpenGL 4.5, section 7.3).
pub(super) fn link_status(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    if call.u32(1)? != LINK_STATUS || call.numbers(2).ok().and_then(|status| status.first().copied()) != Some(0.0) {
        return Ok(());
    }
    gl.flush()?;
    let object = gl.glsl_object(call.u32(0)?)?;
    if let Some(before) = object.before.take() {
        object.executable = before;
        object.failed = true;
    }
    Ok(())
}

pub(super) fn use_program(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = call.u32(0)?;
    // A program that cannot be translated may be bound; drawing with it is refused. A program that was never linked cannot be bound.
    if name != 0 {
        let object = gl.glsl_object(name)?;
        if object.failed || object.executable.linked.is_none() {
            return Err(INVALID_OPERATION);
        }
    }
    gl.glsl.current = name;
    Ok(())
}

pub(super) fn delete_shader(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = call.u32(0)?;
    // An attached shader is not deleted.
    if !gl.glsl.objects.values().any(|object| object.attached.contains(&name)) {
        gl.glsl.shaders.remove(name);
    }
    Ok(())
}

pub(super) fn delete_program(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = call.u32(0)?;
    // A program that is current in a context is not deleted.
    if gl.glsl.current != name && !gl.contexts.sharing().any(|context| context.uses(name)) {
        gl.flush()?;
        gl.glsl.objects.remove(name);
    }
    Ok(())
}

/// `glDeleteObjectARB`: a shader or a program.
pub(super) fn delete_object(gl: &mut Gl, call: &Call, shape: Shape) -> CallOutcome {
    if gl.glsl.shaders.contains(call.u32(0)?) { delete_shader(gl, call, shape) } else { delete_program(gl, call, shape) }
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
    gl.glsl_object(call.u32(0)?)?.attributes.insert(&name, index);
    Ok(())
}

pub(super) fn bind_output(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let (location, name) = (call.u32(1)?, text(call, 2)?);
    gl.glsl_object(call.u32(0)?)?.outputs.insert(&name, [location, 0]);
    Ok(())
}

/// `glBindFragDataLocationIndexed(program, location, index, name)`
pub(super) fn bind_indexed_output(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let (location, index, name) = (call.u32(1)?, call.u32(2)?, text(call, 3)?);
    gl.glsl_object(call.u32(0)?)?.outputs.insert(&name, [location, index]);
    Ok(())
}

/// The location that the recorded driver returned.
fn answer(call: &Call) -> Option<i64> {
    match call.result {
        Arg::Num(location) if location >= 0.0 => Some(location as i64),
        _ => None,
    }
}

pub(super) fn attribute_location(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = text(call, 1)?;
    if let Some(location) = answer(call) {
        gl.glsl_object(call.u32(0)?)?.attributes.insert(&name, location as u32);
    }
    Ok(())
}

pub(super) fn output_location(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = text(call, 1)?;
    if let Some(location) = answer(call) {
        let outputs = &mut gl.glsl_object(call.u32(0)?)?.outputs;
        let index = outputs.get(&name).map_or(0, |&[_, index]| index);
        outputs.insert(&name, [location as u32, index]);
    }
    Ok(())
}

/// `glGetUniformBlockIndex(program, name)`
pub(super) fn block_index(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = text(call, 1)?;
    // There is no such block if the index is GL_INVALID_INDEX.
    if let Some(index) = answer(call).and_then(|index| u32::try_from(index).ok()).filter(|&index| index != u32::MAX) {
        gl.glsl_object(call.u32(0)?)?.executable.block_names.insert(u64::from(index), name);
    }
    Ok(())
}

/// `glGetActiveUniformBlockName(program, index, size, length, name)`
pub(super) fn block_name(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    if let Ok(name) = text(call, 4) {
        let index = u64::from(call.u32(1)?);
        gl.glsl_object(call.u32(0)?)?.executable.block_names.insert(index, name);
    }
    Ok(())
}

/// `glUniformBlockBinding(program, index, binding)`
pub(super) fn block_binding(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let (index, binding) = (u64::from(call.u32(1)?), call.u32(2)?);
    let object = gl.glsl_object(call.u32(0)?)?;
    if let Some(Err(_)) = object.executable.linked {
        // Drawing with it is refused.
        return Ok(());
    }
    let unnamed = || Fault::Unsupported("uniform blocks at indices that the recording does not name".into());
    let name = object.executable.block_names.get(index).ok_or_else(unnamed)?;
    object.executable.bindings.insert(name, binding);
    Ok(())
}

pub(super) fn uniform_location(gl: &mut Gl, call: &Call, _: Shape) -> CallOutcome {
    let name = text(call, 1)?;
    // Negative: there is no such uniform.
    if let Some(location) = answer(call).and_then(|location| u64::try_from(location).ok()) {
        gl.glsl_object(call.u32(0)?)?.executable.locations.insert(location, name);
    }
    Ok(())
}
