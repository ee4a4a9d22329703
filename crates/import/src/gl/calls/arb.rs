//! Assembly programs: program objects, their parameters, and the programs that a draw uses. [`gl_shader::arb`] translates them.

use std::rc::Rc;

use gl_shader::arb::program::{GENERICS, PARAMETERS, ProgramStage};

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_VALUE, Shape, components};
use crate::gl::machine::Gl;
use crate::gl::state::arb::{FRAGMENT_PROGRAM, VERTEX_PROGRAM};

const PROGRAM_FORMAT_ASCII: u32 = 0x8875;

fn stage(target: u32) -> GlResult<ProgramStage> {
    match target {
        VERTEX_PROGRAM => Ok(ProgramStage::Vertex),
        FRAGMENT_PROGRAM => Ok(ProgramStage::Fragment),
        _ => Err(INVALID_ENUM),
    }
}

pub fn bind(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (stage, name) = (stage(call.u32(0)?)?, call.u32(1)?);
    gl.context.programs.bind(stage, name);
    gl.objects.programs.bound(&gl.context.programs, stage);
    Ok(())
}

pub fn delete(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        gl.objects.programs.remove(name);
        gl.context.programs.unbind(name);
    }
    Ok(())
}

/// `glProgramStringARB(target, format, length, text)`
pub fn string(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.flush()?;
    let (stage, format, length) = (stage(call.u32(0)?)?, call.u32(1)?, call.size(2)? as usize);
    if format != PROGRAM_FORMAT_ASCII {
        return Err(INVALID_ENUM);
    }
    let text: Rc<str> = match call.arg(3) {
        Arg::Str(text) => text.clone(),
        Arg::Blob(bytes) => String::from_utf8_lossy(bytes.get(..length).unwrap_or(bytes)).into(),
        _ => return Err(Fault::Damaged("the program's text was not recorded".into())),
    };
    let loaded = gl.programs.load(stage, &text);
    let object = gl.objects.programs.bound(&gl.context.programs, stage);
    if let Err(reason) = &loaded {
        // A driver refuses such a text too; the previous program remains.
        gl.log.note_error(&format!("{}: GL_INVALID_OPERATION: {reason}", call.function.name));
        if !matches!(object.text, Some(Ok(_))) {
            object.text = Some(Err(format!("text is wrong: {reason} (call {})", call.number)));
        }
        return Ok(());
    }
    object.text = Some(loaded);
    Ok(())
}

/// Sets parameters from this one on.
fn set(gl: &mut Gl, stage: ProgramStage, local: bool, first: u32, values: &[f64]) -> GlResult {
    let list = match local {
        true => &mut gl.objects.programs.bound(&gl.context.programs, stage).local,
        false => gl.context.programs.environment_mut(stage),
    };
    for (k, value) in values.chunks_exact(4).enumerate() {
        let at = first.checked_add(k as u32).filter(|&at| at < PARAMETERS).ok_or(INVALID_VALUE)? as usize;
        if list.len() <= at {
            list.resize(at + 1, [0.0; 4]);
        }
        list[at] = std::array::from_fn(|c| value[c] as f32);
    }
    Ok(())
}

pub fn environment(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (stage, index) = (stage(call.u32(0)?)?, call.u32(1)?);
    set(gl, stage, false, index, &components(call, shape, 2)?.0)
}

pub fn local(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (stage, index) = (stage(call.u32(0)?)?, call.u32(1)?);
    set(gl, stage, true, index, &components(call, shape, 2)?.0)
}

/// `glProgramEnvParameters4fvEXT(target, index, count, values)`
pub fn environments(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (stage, index, values) = (stage(call.u32(0)?)?, call.u32(1)?, call.numbers(3)?);
    set(gl, stage, false, index, &values)
}

/// `glProgramLocalParameters4fvEXT(target, index, count, values)`
pub fn locals(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (stage, index, values) = (stage(call.u32(0)?)?, call.u32(1)?, call.numbers(3)?);
    set(gl, stage, true, index, &values)
}

/// Sets the current value of a generic attribute; 0 sends a vertex.
pub fn attribute_at(gl: &mut Gl, index: u32, value: [f32; 4]) -> GlResult {
    match index as usize {
        0 if gl.context.open_primitive.is_some() => gl.vertex_at(value),
        // It stays for draws without an array of positions.
        0 => {
            gl.state.current.position = value;
            Ok(())
        }
        k if k < GENERICS => {
            gl.state.current.set_generic(k, value);
            Ok(())
        }
        _ => Err(INVALID_VALUE),
    }
}

/// `glVertexAttrib3f(index, ...)`
pub fn attribute(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let value = components(call, shape, 1)?.0.map(|value| value as f32);
    attribute_at(gl, call.u32(0)?, value)
}

/// `glVertexAttrib4Nub(index, ...)`
pub fn attribute_normalized(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let value = components(call, Shape { count: 4, ..shape }, 1)?.0.map(|value| shape.scalar.normalized(value));
    attribute_at(gl, call.u32(0)?, value)
}
