//! Immediate mode: vertices between Begin and End.

use gl_shader::consts as e;

use crate::gl::call::{Call, GlResult, INVALID_ENUM, INVALID_OPERATION, Shape, components};
use crate::gl::machine::Gl;

pub fn begin(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let mode = call.u32(0)?;
    if gl.context.open_primitive.is_some() {
        return Err(INVALID_OPERATION);
    }
    if mode > e::POLYGON {
        return Err(INVALID_ENUM);
    }
    gl.apply_materials()?;
    gl.context.open_primitive = Some((mode, std::mem::take(&mut gl.drawing.spare)));
    Ok(())
}

pub fn end(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    let (mode, mut vertices) = gl.context.open_primitive.take().ok_or(INVALID_OPERATION)?;
    let outcome = gl.send(mode, &vertices);
    vertices.clear();
    gl.drawing.spare = vertices;
    outcome
}

/// `glPrimitiveRestartNV()`: ends a primitive and begins the next one of its kind.
pub fn restart(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let mode = gl.context.open_primitive.as_ref().map(|(mode, _)| *mode).ok_or(INVALID_OPERATION)?;
    end(gl, call, shape)?;
    gl.context.open_primitive = Some((mode, std::mem::take(&mut gl.drawing.spare)));
    Ok(())
}

/// The position, or the texture coordinates, of a call.
pub fn position(call: &Call, shape: Shape) -> GlResult<[f32; 4]> {
    Ok(components(call, shape, 0)?.0.map(|value| value as f32))
}

pub fn vertex(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    gl.vertex_at(position(call, shape)?)
}

fn normalized(call: &Call, shape: Shape) -> GlResult<([f32; 4], usize)> {
    let (values, count) = components(call, shape, 0)?;
    Ok((std::array::from_fn(|k| if k < count { shape.scalar.normalized(values[k]) } else { values[k] as f32 }), count))
}

/// The normal of a call.
pub fn normal_of(call: &Call, shape: Shape) -> GlResult<[f32; 3]> {
    let ([x, y, z, _], _) = normalized(call, shape)?;
    Ok([x, y, z])
}

/// The colour of a call.
pub fn color_of(call: &Call, shape: Shape) -> GlResult<[f32; 4]> {
    Ok(normalized(call, shape)?.0)
}

pub fn normal(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    gl.state.current.normal = normal_of(call, shape)?;
    Ok(())
}

pub fn color(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    gl.state.current.color = color_of(call, shape)?;
    Ok(())
}

pub fn secondary(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let ([r, g, b, _], _) = normalized(call, shape)?;
    gl.state.current.secondary = [r, g, b];
    Ok(())
}

pub fn fog_coordinate(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    gl.state.current.fog = components(call, shape, 0)?.0[0] as f32;
    Ok(())
}

pub fn edge_flag(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.state.current.edge = call.bool(0)?;
    Ok(())
}

pub fn texture(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let value = position(call, shape)?;
    gl.state.current.set_texture(0, value);
    Ok(())
}

pub fn multi_texture(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let unit = call.unit(0)?;
    gl.state.current.set_texture(unit, components(call, shape, 1)?.0.map(|value| value as f32));
    Ok(())
}

pub fn rectangle(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    gl.apply_materials()?;
    let [x1, y1, x2, y2] = if shape.vector {
        let ([a, b], [c, d]) = (call.array::<2>(0)?, call.array::<2>(1)?);
        [a, b, c, d]
    } else {
        [call.f64(0)?, call.f64(1)?, call.f64(2)?, call.f64(3)?]
    };
    let corners = [[x1, y1], [x2, y1], [x2, y2], [x1, y2]].map(|[x, y]| {
        let mut vertex = gl.state.current.clone();
        (vertex.position, vertex.edge) = ([x as f32, y as f32, 0.0, 1.0], true);
        vertex
    });
    let outcome = gl.primitive(e::QUADS, &corners);
    gl.drawing.batch.quads = None;
    outcome
}
