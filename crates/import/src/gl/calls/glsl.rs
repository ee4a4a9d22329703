//! GLSL: shader and program objects, uniforms, and the stages that a draw uses. [`gl_shader::glsl`] translates them.

use gl_shader::arb::program::ProgramStage;
use gl_shader::glsl::{Sources, link};

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_OPERATION, INVALID_VALUE, Shape};
use crate::gl::machine::Gl;
use crate::gl::names;
use crate::gl::state::glsl::{Executable, Object, Shader};

/// Maximum number of bytes of a shader's source.
const SOURCE_MAX: usize = 1 << 22;
const FRAGMENT_SHADER: u32 = 0x8b30;
const VERTEX_SHADER: u32 = 0x8b31;
const LINK_STATUS: u32 = 0x8b82;

/// The name that a call gives to a new object.
fn created(call: &Call) -> GlResult<u32> {
    match call.result {
        Arg::Num(name) if name > 0.0 => Ok(name as u32),
        Arg::Num(_) => Err(INVALID_OPERATION),
        _ => Err(Fault::Damaged("the name of the new object was not recorded".into())),
    }
}

pub fn create_shader(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let stage = match call.u32(0)? {
        VERTEX_SHADER => Ok(ProgramStage::Vertex),
        FRAGMENT_SHADER => Ok(ProgramStage::Fragment),
        other => Err(other),
    };
    gl.objects.glsl.shaders.insert(created(call)?, Shader { stage, source: "".into(), compiled: None });
    Ok(())
}

/// `glShaderSource(shader, count, strings, lengths)`
pub fn shader_source(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
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
    gl.objects.glsl.shaders.get_mut(call.u32(0)?).ok_or(INVALID_VALUE)?.source = text.into();
    Ok(())
}

pub fn compile_shader(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let shader = gl.objects.glsl.shaders.get_mut(call.u32(0)?).ok_or(INVALID_VALUE)?;
    shader.compiled = Some(shader.source.clone());
    Ok(())
}

pub fn create_program(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.objects.glsl.programs.insert(created(call)?, Object::default());
    Ok(())
}

pub fn attach(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let shader = call.u32(1)?;
    if !gl.objects.glsl.shaders.contains(shader) {
        return Err(INVALID_VALUE);
    }
    let object = gl.objects.glsl.program(call.u32(0)?)?;
    if object.attached.contains(&shader) {
        return Err(INVALID_OPERATION);
    }
    object.attached.push(shader);
    Ok(())
}

pub fn detach(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let shader = call.u32(1)?;
    gl.objects.glsl.program(call.u32(0)?)?.attached.retain(|&known| known != shader);
    Ok(())
}

pub fn link_program(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.flush()?;
    let name = call.u32(0)?;
    let attached = gl.objects.glsl.program(name)?.attached.clone();
    let (mut sources, mut other) = (Sources::default(), None);
    for shader in attached.iter().filter_map(|&shader| gl.objects.glsl.shaders.get(shader)) {
        let text = shader.compiled.clone().ok_or(INVALID_OPERATION)?;
        match shader.stage {
            Ok(stage) => sources[stage as usize - 1].push(text),
            Err(stage) => other = Some(stage),
        }
    }
    let number = gl.glsl.linked.len() as u32;
    let linked = match other {
        Some(stage) => Err(format!("shaders of the stage {} are not supported", names::name(stage))),
        None => gl.glsl.linked.entry(sources).or_insert_with_key(|sources| link(number, sources, &gl.limits)).clone(),
    };
    let object = gl.objects.glsl.program(name)?;
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
pub fn link_status(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if call.u32(1)? != LINK_STATUS || call.numbers(2).ok().and_then(|status| status.first().copied()) != Some(0.0) {
        return Ok(());
    }
    gl.flush()?;
    let object = gl.objects.glsl.program(call.u32(0)?)?;
    if let Some(before) = object.before.take() {
        object.executable = before;
        object.failed = true;
    }
    Ok(())
}

pub fn use_program(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = call.u32(0)?;
    // A program that cannot be translated may be bound; drawing with it is refused. A program that was never linked cannot be bound.
    if name != 0 {
        let object = gl.objects.glsl.program(name)?;
        if object.failed || object.executable.linked.is_none() {
            return Err(INVALID_OPERATION);
        }
    }
    gl.context.glsl_program = name;
    Ok(())
}

pub fn delete_shader(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = call.u32(0)?;
    // An attached shader is not deleted.
    if !gl.objects.glsl.programs.values().any(|object| object.attached.contains(&name)) {
        gl.objects.glsl.shaders.remove(name);
    }
    Ok(())
}

pub fn delete_program(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = call.u32(0)?;
    // A program that is current in a context is not deleted.
    if gl.context.glsl_program != name && !gl.contexts.sharing().any(|context| context.uses(name)) {
        gl.flush()?;
        gl.objects.glsl.programs.remove(name);
    }
    Ok(())
}

/// `glDeleteObjectARB`: a shader or a program.
pub fn delete_object(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    if gl.objects.glsl.shaders.contains(call.u32(0)?) {
        delete_shader(gl, call, shape)
    } else {
        delete_program(gl, call, shape)
    }
}

fn text(call: &Call, index: usize) -> GlResult<String> {
    match call.arg(index) {
        Arg::Str(text) => Ok(text.to_string()),
        Arg::Blob(bytes) => Ok(String::from_utf8_lossy(bytes).trim_end_matches('\0').into()),
        _ => Err(Fault::Damaged(format!("argument {index} is no text"))),
    }
}

pub fn bind_attribute(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (index, name) = (call.u32(1)?, text(call, 2)?);
    gl.objects.glsl.program(call.u32(0)?)?.attributes.insert(&name, index);
    Ok(())
}

pub fn bind_output(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (location, name) = (call.u32(1)?, text(call, 2)?);
    gl.objects.glsl.program(call.u32(0)?)?.outputs.insert(&name, [location, 0]);
    Ok(())
}

/// `glBindFragDataLocationIndexed(program, location, index, name)`
pub fn bind_indexed_output(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (location, index, name) = (call.u32(1)?, call.u32(2)?, text(call, 3)?);
    gl.objects.glsl.program(call.u32(0)?)?.outputs.insert(&name, [location, index]);
    Ok(())
}

/// The location that the recorded driver returned.
fn answer(call: &Call) -> Option<i64> {
    match call.result {
        Arg::Num(location) if location >= 0.0 => Some(location as i64),
        _ => None,
    }
}

pub fn attribute_location(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = text(call, 1)?;
    if let Some(location) = answer(call) {
        gl.objects.glsl.program(call.u32(0)?)?.attributes.insert(&name, location as u32);
    }
    Ok(())
}

pub fn output_location(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = text(call, 1)?;
    if let Some(location) = answer(call) {
        let outputs = &mut gl.objects.glsl.program(call.u32(0)?)?.outputs;
        let index = outputs.get(&name).map_or(0, |&[_, index]| index);
        outputs.insert(&name, [location as u32, index]);
    }
    Ok(())
}

/// `glGetUniformBlockIndex(program, name)`
pub fn block_index(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = text(call, 1)?;
    // There is no such block if the index is GL_INVALID_INDEX.
    if let Some(index) = answer(call).and_then(|index| u32::try_from(index).ok()).filter(|&index| index != u32::MAX) {
        gl.objects.glsl.program(call.u32(0)?)?.executable.block_names.insert(u64::from(index), name);
    }
    Ok(())
}

/// `glGetActiveUniformBlockName(program, index, size, length, name)`
pub fn block_name(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if let Ok(name) = text(call, 4) {
        let index = u64::from(call.u32(1)?);
        gl.objects.glsl.program(call.u32(0)?)?.executable.block_names.insert(index, name);
    }
    Ok(())
}

/// `glUniformBlockBinding(program, index, binding)`
pub fn block_binding(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (index, binding) = (u64::from(call.u32(1)?), call.u32(2)?);
    let object = gl.objects.glsl.program(call.u32(0)?)?;
    if let Some(Err(_)) = object.executable.linked {
        // Drawing with it is refused.
        return Ok(());
    }
    let unnamed = || Fault::Unsupported("uniform blocks at indices that the recording does not name".into());
    let name = object.executable.block_names.get(index).ok_or_else(unnamed)?;
    object.executable.bindings.insert(name, binding);
    Ok(())
}

pub fn uniform_location(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = text(call, 1)?;
    // Negative: there is no such uniform.
    if let Some(location) = answer(call).and_then(|location| u64::try_from(location).ok()) {
        gl.objects.glsl.program(call.u32(0)?)?.executable.locations.insert(location, name);
    }
    Ok(())
}
