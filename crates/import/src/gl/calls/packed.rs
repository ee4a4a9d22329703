//! Attributes that are packed in words (`glVertexP3ui` and its like), between Begin and End too.

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, Scalar, Shape};
use crate::gl::calls::arb;
use crate::gl::elements::{Element, scalar};
use crate::gl::machine::Gl;
use crate::gl::names;

/// Three floats of 11, 11 and 10 bits.
const PACKED_FLOATS: u32 = 0x8c3b;

/// The components of a call's word, unchanged and normalised. Its type is the argument `kind`, the word is the argument `at`.
fn unpacked(call: &Call, shape: Shape, kind: usize, at: usize) -> GlResult<([f32; 4], [f32; 4])> {
    let kind = call.u32(kind)?;
    let scalar = match scalar(kind) {
        Some((scalar @ (Scalar::Packed | Scalar::PackedSigned), _)) => scalar,
        _ if kind == PACKED_FLOATS => {
            return Err(Fault::Unsupported(format!("{} of type {}", call.function.name, names::name(kind))));
        }
        _ => return Err(INVALID_ENUM),
    };
    let word = match call.arg(at) {
        Arg::Nums(numbers) => *numbers.first().ok_or_else(|| Fault::Damaged("an array of no words".into()))? as i64 as u32,
        _ => call.u32(at)?,
    };
    Ok(Element { scalar, size: shape.count, blue_first: false }.components(&word.to_le_bytes()))
}

pub fn vertex(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (position, _) = unpacked(call, shape, 0, 1)?;
    gl.vertex_at(position)
}

pub fn normal(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (_, [x, y, z, _]) = unpacked(call, shape, 0, 1)?;
    gl.state.current.normal = [x, y, z];
    Ok(())
}

pub fn color(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    gl.state.current.color = unpacked(call, shape, 0, 1)?.1;
    Ok(())
}

pub fn secondary(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (_, [r, g, b, _]) = unpacked(call, shape, 0, 1)?;
    gl.state.current.secondary = [r, g, b];
    Ok(())
}

pub fn texture(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (coordinates, _) = unpacked(call, shape, 0, 1)?;
    gl.state.current.set_texture(0, coordinates);
    Ok(())
}

pub fn multi_texture(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let unit = call.unit(0)?;
    let (coordinates, _) = unpacked(call, shape, 1, 2)?;
    gl.state.current.set_texture(unit, coordinates);
    Ok(())
}

/// `glVertexAttribP4ui(index, type, normalized, value)`
pub fn attribute(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (plain, normalized) = unpacked(call, shape, 1, 3)?;
    arb::attribute_at(gl, call.u32(0)?, if call.bool(2)? { normalized } else { plain })
}
