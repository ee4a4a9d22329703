//! Immediate mode: vertices between Begin and End.

use super::call::{Call, Fault, INVALID_ENUM, INVALID_OPERATION, Outcome, Shape};
use super::consts as e;
use super::machine::{Gl, components};
use super::materials::Tracked;
use super::state::{Vertex, capability};

/// Maximum number of vertices between Begin and End.
const VERTICES_MAX: usize = 1 << 22;

pub(super) fn begin(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let mode = call.u32(0)?;
    if gl.begun.is_some() {
        return Err(INVALID_OPERATION);
    }
    if mode > e::POLYGON {
        return Err(INVALID_ENUM);
    }
    gl.materials_meet()?;
    gl.begun = Some((mode, std::mem::take(&mut gl.spare)));
    Ok(())
}

pub(super) fn end(gl: &mut Gl, _: &Call, _: Shape) -> Outcome {
    let (mode, mut vertices) = gl.begun.take().ok_or(INVALID_OPERATION)?;
    let outcome = gl.send(mode, &vertices);
    vertices.clear();
    gl.spare = vertices;
    outcome
}

/// `glPrimitiveRestartNV()`: ends a primitive and begins the next one of its kind.
pub(super) fn restart(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let mode = gl.begun.as_ref().map(|(mode, _)| *mode).ok_or(INVALID_OPERATION)?;
    end(gl, call, shape)?;
    gl.begun = Some((mode, std::mem::take(&mut gl.spare)));
    Ok(())
}

/// The position, or the texture coordinates, of a call.
pub(super) fn position(call: &Call, shape: Shape) -> Outcome<[f32; 4]> {
    Ok(components(call, shape, 0)?.0.map(|value| value as f32))
}

pub(super) fn vertex(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    gl.vertex_at(position(call, shape)?)
}

impl Gl {
    /// Draws the vertices between Begin and End, or those before a change of material. If their materials differ, colour material gives them.
    pub(super) fn send(&mut self, mode: u32, vertices: &[Vertex]) -> Outcome {
        let key = match self.tracked.take() {
            None => return self.primitive(mode, vertices),
            Some(Tracked::Color(key, _)) => key,
            Some(Tracked::Lit) => {
                let enabled = self.without_lighting();
                return self.with_enabled(enabled, |gl| gl.primitive(mode, vertices));
            }
        };
        self.flush()?;
        self.prepared = None;
        let (enabled, saved) = (self.state.enabled, self.state.color_material);
        self.state.enabled |= capability(e::COLOR_MATERIAL).unwrap_or(0);
        self.state.color_material = key;
        let outcome = self.primitive(mode, vertices).and_then(|()| self.flush());
        (self.state.enabled, self.state.color_material) = (enabled, saved);
        self.prepared = None;
        outcome
    }

    /// Sends a vertex with the current attributes. Outside Begin and End it has no effect.
    pub fn vertex_at(&mut self, position: [f32; 4]) -> Outcome {
        let mut vertex = self.state.current.clone();
        vertex.position = position;
        match self.tracked {
            None => {}
            Some(Tracked::Color(_, color)) => vertex.color = color,
            Some(Tracked::Lit) => {
                (vertex.color, vertex.secondary) = super::lit::colors(&self.state, &self.modelview.top, &vertex);
            }
        }
        let Some((_, vertices)) = &mut self.begun else { return Ok(()) };
        if vertices.len() >= VERTICES_MAX {
            return Err(Fault::Limit(format!("more than {VERTICES_MAX} vertices between glBegin and glEnd")));
        }
        vertices.push(vertex);
        Ok(())
    }
}

fn normalized(call: &Call, shape: Shape) -> Outcome<([f32; 4], usize)> {
    let (values, count) = components(call, shape, 0)?;
    Ok((std::array::from_fn(|k| if k < count { shape.scalar.normalized(values[k]) } else { values[k] as f32 }), count))
}

/// The normal of a call.
pub(super) fn normal_of(call: &Call, shape: Shape) -> Outcome<[f32; 3]> {
    let ([x, y, z, _], _) = normalized(call, shape)?;
    Ok([x, y, z])
}

/// The colour of a call.
pub(super) fn color_of(call: &Call, shape: Shape) -> Outcome<[f32; 4]> {
    Ok(normalized(call, shape)?.0)
}

pub(super) fn normal(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    gl.state.current.normal = normal_of(call, shape)?;
    Ok(())
}

pub(super) fn color(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    gl.state.current.color = color_of(call, shape)?;
    Ok(())
}

pub(super) fn secondary(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let ([r, g, b, _], _) = normalized(call, shape)?;
    gl.state.current.secondary = [r, g, b];
    Ok(())
}

pub(super) fn fog_coordinate(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    gl.state.current.fog = components(call, shape, 0)?.0[0] as f32;
    Ok(())
}

pub(super) fn edge_flag(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.state.current.edge = call.bool(0)?;
    Ok(())
}

pub(super) fn texture(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let value = position(call, shape)?;
    gl.state.current.set_texture(0, value);
    Ok(())
}

pub(super) fn multi_texture(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    let unit = call.unit(0)?;
    gl.state.current.set_texture(unit, components(call, shape, 1)?.0.map(|value| value as f32));
    Ok(())
}

pub(super) fn rectangle(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    gl.materials_meet()?;
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
    gl.batch.quads = None;
    outcome
}
