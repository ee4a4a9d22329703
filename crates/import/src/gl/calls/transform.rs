//! Matrices, viewport and clip planes.

use gl_shader::{PLANES, consts as e};
use glam::{Mat4, Vec3};

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_VALUE, Shape};
use crate::gl::machine::{Factor, Gl};
use crate::gl::matrix;
use crate::gl::state::arb::MATRIX0;

pub fn matrix_mode(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    match call.u32(0)? {
        mode @ MATRIX0.. if ((mode - MATRIX0) as usize) < gl.context.programs.matrices.len() => {
            gl.state.transform.matrix_mode = mode
        }
        mode @ (e::MODELVIEW | e::PROJECTION | e::TEXTURE | e::COLOR) => gl.state.transform.matrix_mode = mode,
        _ => return Err(INVALID_ENUM),
    }
    Ok(())
}

fn given(call: &Call) -> GlResult<Mat4> {
    Ok(Mat4::from_cols_array(&call.array::<16>(0)?.map(|value| value as f32)))
}

pub fn load_identity(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    gl.stack()?.top = Mat4::IDENTITY;
    Ok(())
}

pub fn load_matrix(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.stack()?.top = given(call)?;
    Ok(())
}

pub fn load_transposed(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.stack()?.top = given(call)?.transpose();
    Ok(())
}

pub fn push_matrix(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    if gl.stack()?.push() { Ok(()) } else { Err(Fault::Error("GL_STACK_OVERFLOW")) }
}

pub fn pop_matrix(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    if gl.stack()?.pop() { Ok(()) } else { Err(Fault::Error("GL_STACK_UNDERFLOW")) }
}

fn box_of(call: &Call) -> GlResult<[f64; 6]> {
    let mut values = [0.0; 6];
    for (k, value) in values.iter_mut().enumerate() {
        *value = call.f64(k)?;
    }
    if values[0] == values[1] || values[2] == values[3] || values[4] == values[5] {
        return Err(INVALID_VALUE);
    }
    Ok(values)
}

/// That of a function, by its name without type; none: it does not multiply.
pub fn factor(stem: &str) -> Option<Factor> {
    Some(match stem {
        "Frustum" => frustum_of,
        "MultMatrix" => given,
        "MultTransposeMatrix" => transposed,
        "Ortho" => ortho_of,
        "Rotate" => rotation,
        "Scale" => |call| Ok(Mat4::from_scale(vector(call)?)),
        "Translate" => |call| Ok(Mat4::from_translation(vector(call)?)),
        _ => return None,
    })
}

fn multiply(gl: &mut Gl, by: Mat4) -> GlResult {
    gl.stack()?.top *= by;
    Ok(())
}

pub fn frustum(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    multiply(gl, frustum_of(call)?)
}

pub fn multiply_matrix(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    multiply(gl, given(call)?)
}

pub fn multiply_transposed(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    multiply(gl, transposed(call)?)
}

pub fn ortho(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    multiply(gl, ortho_of(call)?)
}

pub fn rotate(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    multiply(gl, rotation(call)?)
}

pub fn scale(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    multiply(gl, Mat4::from_scale(vector(call)?))
}

pub fn translate(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    multiply(gl, Mat4::from_translation(vector(call)?))
}

fn transposed(call: &Call) -> GlResult<Mat4> {
    Ok(given(call)?.transpose())
}

fn vector(call: &Call) -> GlResult<Vec3> {
    Ok(Vec3::new(call.f32(0)?, call.f32(1)?, call.f32(2)?))
}

fn rotation(call: &Call) -> GlResult<Mat4> {
    Ok(matrix::rotation(call.f64(0)?, [call.f64(1)?, call.f64(2)?, call.f64(3)?]))
}

fn ortho_of(call: &Call) -> GlResult<Mat4> {
    Ok(matrix::ortho(box_of(call)?))
}

fn frustum_of(call: &Call) -> GlResult<Mat4> {
    let values = box_of(call)?;
    if values[4] <= 0.0 || values[5] <= 0.0 {
        return Err(INVALID_VALUE);
    }
    Ok(matrix::frustum(values))
}

/// Maximum size of viewports, and maximum distance of their origin from the window's corner.
const VIEWPORT_MAX: u32 = 16_384;
const VIEWPORT_REACH: i32 = 32_768;

pub fn viewport(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (x, y, width, height) = (call.i32(0)?, call.i32(1)?, call.size(2)?, call.size(3)?);
    let reach = |from: i32, size: u32| (i64::from(from) + i64::from(size)).clamp(0, i64::from(u32::MAX)) as u32;
    // With a framebuffer object bound, the viewport says nothing about the window's size.
    if gl.context.framebuffers.draw == 0 {
        gl.window([reach(x, width), reach(y, height)], false)?;
    }
    // Viewports are clamped as in Mesa.
    let [x, y] = [x, y].map(|place| place.clamp(-VIEWPORT_REACH, VIEWPORT_REACH - 1));
    let [width, height] = [width, height].map(|edge| edge.min(VIEWPORT_MAX) as i32);
    gl.state.transform.viewport = [x, y, width, height];
    Ok(())
}

pub fn depth_range(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.transform.depth_range = [call.f32(0)?.clamp(0.0, 1.0), call.f32(1)?.clamp(0.0, 1.0)];
    Ok(())
}

pub fn clip_plane(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let plane = call.u32(0)?.wrapping_sub(e::CLIP_PLANE0) as usize;
    let equation = call.array::<4>(1)?.map(|value| value as f32);
    let inverse = matrix::inverse(&gl.context.matrices.modelview.top).unwrap_or(Mat4::IDENTITY);
    *gl.state.transform.planes.get_mut(plane).filter(|_| plane < PLANES).ok_or(INVALID_ENUM)? =
        matrix::transform_plane(equation, &inverse);
    Ok(())
}
