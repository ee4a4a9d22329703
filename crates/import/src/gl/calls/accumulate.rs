//! The accumulation buffer (OpenGL 1.5, section 4.2.4), kept in half precision, and occlusion queries.

use gfx::format::Format;
use gl_shader::consts as e;

use crate::gl::call::{Call, GlResult, INVALID_ENUM, INVALID_OPERATION, Shape};
use crate::gl::card::copy_key::{Combine, CopyKey, CopySource, SAME};
use crate::gl::machine::Gl;

const HALF_MAX: f32 = 65_504.0;

pub fn clear_value(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.context.framebuffers.clear_accum =
        [call.f32(0)?, call.f32(1)?, call.f32(2)?, call.f32(3)?].map(|value| value.clamp(-1.0, 1.0));
    Ok(())
}

pub fn accumulate(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    // Half precision has no larger numbers; NaN becomes 0.
    let (op, value) = (call.u32(0)?, call.f32(1)?);
    let value = if value.is_nan() { 0.0 } else { value.clamp(-HALF_MAX, HALF_MAX) };
    if !matches!(op, e::ACCUM | e::LOAD | e::RETURN | e::MULT | e::ADD) {
        return Err(INVALID_ENUM);
    }
    if gl.context.framebuffers.draw != 0 || gl.accumulates == Some(false) {
        return Err(INVALID_OPERATION);
    }
    let target = gl.aim()?;
    let (Some(area), Some(color), Some(sum)) = (gl.scissor(), target.color, gl.card.accumulation()) else { return Ok(()) };
    let into = |result, combine| CopyKey { from: CopySource::Color, result, format: "rgba16float", combine, mask: 15 };
    match op {
        e::RETURN => {
            let key = CopyKey {
                from: CopySource::Color,
                result: "vec4f(saturate(c.rgb * u.source.z), 1)",
                format: color.format.name(),
                combine: Combine::Replace,
                mask: gl.mask(),
            };
            gl.card.copy_pixels(key, color.format, sum, color, SAME, value, area);
        }
        e::LOAD | e::ACCUM => {
            let combine = if op == e::LOAD { Combine::Replace } else { Combine::Add };
            gl.flush()?;
            let (source, ..) = gl.read_source(false)?;
            gl.card.copy_pixels(into("c * u.source.z", combine), Format::Rgba16Float, source, sum, SAME, value, area);
        }
        e::MULT => gl.card.copy_pixels(into("c", Combine::Scale), Format::Rgba16Float, color, sum, SAME, value, area),
        _ => gl.card.copy_pixels(into("vec4f(u.source.z)", Combine::Add), Format::Rgba16Float, color, sum, SAME, value, area),
    }
    Ok(())
}

pub fn begin_query(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match call.u32(0)? {
        // The card counts samples for all of these.
        e::SAMPLES_PASSED | ANY_SAMPLES_PASSED | ANY_SAMPLES_PASSED_CONSERVATIVE => {}
        TIME_ELAPSED | PRIMITIVES_GENERATED => return Ok(()),
        _ => return Err(INVALID_ENUM),
    }
    if gl.context.query.is_some() || call.u32(1)? == 0 {
        return Err(INVALID_OPERATION);
    }
    // Each use of a query object is a query of its own.
    gl.context.query = Some(call.number);
    gl.log.queries += 1;
    Ok(())
}

const ANY_SAMPLES_PASSED: u32 = 0x8c2f;
const ANY_SAMPLES_PASSED_CONSERVATIVE: u32 = 0x8d6a;

// Times and counts do not change the picture.
const TIME_ELAPSED: u32 = 0x88bf;
const PRIMITIVES_GENERATED: u32 = 0x8c87;

pub fn end_query(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if matches!(call.u32(0)?, TIME_ELAPSED | PRIMITIVES_GENERATED) {
        return Ok(());
    }
    gl.context.query.take().map(drop).ok_or(INVALID_OPERATION)
}
