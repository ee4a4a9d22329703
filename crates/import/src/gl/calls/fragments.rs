//! Per-fragment operations, and clears.

use gl_shader::{COLORS_MAX, consts as e};

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_VALUE, Shape, parameters};
use crate::gl::draw::clear::ClearValues;
use crate::gl::machine::Gl;
use crate::gl::state::fragments::{ColorWrites, blend_factor, blend_operation, stencil_operation};

pub fn scissor(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (width, height) = (call.size(2)? as i32, call.size(3)? as i32);
    gl.state.scissor = [call.i32(0)?, call.i32(1)?, width, height];
    Ok(())
}

fn comparison(value: u32) -> GlResult<u32> {
    if (e::NEVER..=e::ALWAYS).contains(&value) { Ok(value) } else { Err(INVALID_ENUM) }
}

pub fn alpha_func(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.color.alpha_test = (comparison(call.u32(0)?)?, call.f32(1)?.clamp(0.0, 1.0));
    Ok(())
}

fn sides(face: u32) -> GlResult<std::ops::Range<usize>> {
    match face {
        e::FRONT => Ok(0..1),
        e::BACK => Ok(1..2),
        e::FRONT_AND_BACK => Ok(0..2),
        _ => Err(INVALID_ENUM),
    }
}

fn set_func(gl: &mut Gl, face: u32, call: &Call, first: usize) -> GlResult {
    let (compare, reference, mask) = (comparison(call.u32(first)?)?, call.i32(first + 1)?, call.u32(first + 2)?);
    for side in &mut gl.state.stencil.sides[sides(face)?] {
        (side.compare, side.reference, side.read) = (compare, reference.clamp(0, 255), mask);
    }
    Ok(())
}

/// The stencil faces of calls without a face argument.
fn active_faces(gl: &Gl) -> u32 {
    gl.state.stencil.active_face.unwrap_or(e::FRONT_AND_BACK)
}

/// `glActiveStencilFaceEXT(face)`
pub fn active_stencil_face(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match call.u32(0)? {
        face @ (e::FRONT | e::BACK) => gl.state.stencil.active_face = Some(face),
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

pub fn stencil_func(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set_func(gl, active_faces(gl), call, 0)
}

pub fn stencil_func_separate(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set_func(gl, call.u32(0)?, call, 1)
}

fn set_op(gl: &mut Gl, face: u32, call: &Call, first: usize) -> GlResult {
    let mut ops = [0; 3];
    for (k, op) in ops.iter_mut().enumerate() {
        *op = call.u32(first + k)?;
        stencil_operation(*op)?;
    }
    for side in &mut gl.state.stencil.sides[sides(face)?] {
        side.ops = ops;
    }
    Ok(())
}

/// `glStencilFuncSeparateATI(front, back, reference, mask)`
pub fn stencil_func_both(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (compare, reference, read) =
        ([comparison(call.u32(0)?)?, comparison(call.u32(1)?)?], call.i32(2)?.clamp(0, 255), call.u32(3)?);
    for (side, compare) in gl.state.stencil.sides.iter_mut().zip(compare) {
        (side.compare, side.reference, side.read) = (compare, reference, read);
    }
    Ok(())
}

pub fn stencil_op(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set_op(gl, active_faces(gl), call, 0)
}

pub fn stencil_op_separate(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set_op(gl, call.u32(0)?, call, 1)
}

pub fn stencil_mask(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let mask = call.u32(0)?;
    let sides = sides(active_faces(gl))?;
    gl.state.stencil.sides[sides].iter_mut().for_each(|side| side.write = mask);
    Ok(())
}

pub fn stencil_mask_separate(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (sides, mask) = (sides(call.u32(0)?)?, call.u32(1)?);
    gl.state.stencil.sides[sides].iter_mut().for_each(|side| side.write = mask);
    Ok(())
}

pub fn depth_func(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.depth.func = comparison(call.u32(0)?)?;
    Ok(())
}

pub fn depth_mask(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.depth.write = call.bool(0)?;
    Ok(())
}

/// The state of the colour buffers that a call sets: of one, if the call's first argument is its number, or else of all.
fn writes<'a, const ONE: bool>(gl: &'a mut Gl, call: &Call) -> GlResult<&'a mut [ColorWrites]> {
    let all = &mut gl.state.color.writes;
    if !ONE {
        return Ok(all);
    }
    let k = call.u32(0)? as usize;
    all.get_mut(k..k + 1).ok_or(INVALID_VALUE)
}

pub fn blend_func<const ONE: bool>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let first = usize::from(ONE);
    let (source, destination) = (call.u32(first)?, call.u32(first + 1)?);
    set_blend::<ONE>(gl, call, [source, destination, source, destination])
}

pub fn blend_func_separate<const ONE: bool>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let first = usize::from(ONE);
    let factors = [call.u32(first)?, call.u32(first + 1)?, call.u32(first + 2)?, call.u32(first + 3)?];
    set_blend::<ONE>(gl, call, factors)
}

fn set_blend<const ONE: bool>(gl: &mut Gl, call: &Call, factors: [u32; 4]) -> GlResult {
    for factor in factors {
        blend_factor(factor, true)?;
    }
    writes::<ONE>(gl, call)?.iter_mut().for_each(|writes| writes.factors = factors);
    Ok(())
}

pub fn blend_equation<const ONE: bool>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let op = call.u32(usize::from(ONE))?;
    set_operations::<ONE>(gl, call, [op; 2])
}

pub fn blend_equation_separate<const ONE: bool>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let first = usize::from(ONE);
    let ops = [call.u32(first)?, call.u32(first + 1)?];
    set_operations::<ONE>(gl, call, ops)
}

fn set_operations<const ONE: bool>(gl: &mut Gl, call: &Call, ops: [u32; 2]) -> GlResult {
    for op in ops {
        blend_operation(op)?;
    }
    writes::<ONE>(gl, call)?.iter_mut().for_each(|writes| writes.ops = ops);
    Ok(())
}

fn color(call: &Call) -> GlResult<[f32; 4]> {
    let channel = |value: f32| if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
    Ok([call.f32(0)?, call.f32(1)?, call.f32(2)?, call.f32(3)?].map(channel))
}

pub fn blend_color(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.color.blend_constant = color(call)?;
    Ok(())
}

pub fn logic_op(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let op = call.u32(0)?;
    if !(e::CLEAR..=e::SET).contains(&op) {
        return Err(INVALID_ENUM);
    }
    gl.state.color.logic = op;
    Ok(())
}

pub fn color_mask<const ONE: bool>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let mut mask = 0;
    for channel in 0..4 {
        mask |= u8::from(call.bool(channel + usize::from(ONE))?) << channel;
    }
    writes::<ONE>(gl, call)?.iter_mut().for_each(|writes| writes.mask = mask);
    Ok(())
}

pub fn clear_color(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    // Values are clamped when the colour buffer clamps.
    gl.state.color.clear = [call.f32(0)?, call.f32(1)?, call.f32(2)?, call.f32(3)?];
    Ok(())
}

pub fn clear_depth(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.depth.clear = call.f32(0)?.clamp(0.0, 1.0);
    Ok(())
}

pub fn clear_stencil(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.stencil.clear = call.i32(0)?;
    Ok(())
}

/// `glClearBuffer(buffer, index, values)`, and `glClearBufferfi(buffer, index, depth, stencil)`.
pub fn clear_buffer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (buffer, index) = (call.u32(0)?, call.u32(1)?);
    let values = if buffer == e::DEPTH_STENCIL { vec![call.f64(2)?, call.f64(3)?] } else { parameters(call, 2)? };
    let value = |k: usize| values.get(k).copied().ok_or_else(|| Fault::Damaged(format!("fewer than {} values", k + 1)));
    let mut to = ClearValues::of(&gl.state);
    let bits = match buffer {
        e::COLOR => {
            if index as usize >= COLORS_MAX {
                return Err(INVALID_VALUE);
            }
            to.buffer = Some(index as usize);
            if call.function.name.contains("iv") {
                return Err(Fault::Unsupported(format!("{} of colours", call.function.name)));
            }
            to.color = [value(0)? as f32, value(1)? as f32, value(2)? as f32, value(3)? as f32];
            e::COLOR_BUFFER_BIT
        }
        _ if index != 0 => return Err(INVALID_VALUE),
        e::DEPTH => {
            to.depth = value(0)?.clamp(0.0, 1.0) as f32;
            e::DEPTH_BUFFER_BIT
        }
        e::STENCIL => {
            to.stencil = value(0)? as i32;
            e::STENCIL_BUFFER_BIT
        }
        e::DEPTH_STENCIL => {
            (to.depth, to.stencil) = (value(0)?.clamp(0.0, 1.0) as f32, value(1)? as i32);
            e::DEPTH_BUFFER_BIT | e::STENCIL_BUFFER_BIT
        }
        _ => return Err(INVALID_ENUM),
    };
    if gl.context.render_mode.draws() { gl.clear_buffers(bits, to) } else { Ok(()) }
}

pub fn clear(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let mask = call.u32(0)?;
    let known = e::COLOR_BUFFER_BIT | e::DEPTH_BUFFER_BIT | e::STENCIL_BUFFER_BIT | e::ACCUM_BUFFER_BIT;
    if mask & !known != 0 {
        return Err(INVALID_VALUE);
    }
    if !gl.context.render_mode.draws() {
        return Ok(());
    }
    gl.clear_buffers(mask, ClearValues::of(&gl.state))?;
    let Some(area) = (if mask & e::ACCUM_BUFFER_BIT != 0 { gl.scissor() } else { None }) else { return Ok(()) };
    gl.card.clear_accumulation(gl.context.framebuffers.clear_accum, area);
    Ok(())
}
