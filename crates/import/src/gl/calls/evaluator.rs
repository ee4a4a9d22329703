//! Evaluators: Bezier curves and surfaces (OpenGL 1.5, section 5.1).

use gl_shader::consts as e;
use glam::{Vec3, Vec4};

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scalar, Shape, components};
use crate::gl::machine::Gl;
use crate::gl::state::evaluator::{COLOR, COMPONENTS, NORMAL, ORDER_MAX, TEXTURE, VERTEX_3, VERTEX_4};
use crate::gl::state::server::capability;

/// Points of a mesh at most.
const MESH_MAX: i64 = 1 << 20;

pub fn map(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let target = call.u32(0)?;
    let surface = shape.count == 2;
    let first = if surface { e::MAP2_COLOR_4 } else { e::MAP1_COLOR_4 };
    let index = target.wrapping_sub(first) as usize;
    let size = *COMPONENTS.get(index).ok_or(INVALID_ENUM)?;
    let range = |at: usize| -> GlResult<(f32, f32, usize, usize)> {
        let (from, to, stride, order) =
            (call.f32(at)?, call.f32(at + 1)?, call.size(at + 2)? as usize, call.size(at + 3)? as usize);
        if from == to || !(1..=ORDER_MAX).contains(&order) || stride < size {
            Err(INVALID_VALUE)
        } else {
            Ok((from, to, stride, order))
        }
    };
    let u = range(1)?;
    let v = if surface { range(5)? } else { (0.0, 1.0, 0, 1) };
    let numbers: Vec<f64> = match call.arg(if surface { 9 } else { 5 }) {
        Arg::Nums(numbers) => numbers.to_vec(),
        Arg::Blob(bytes) if shape.scalar == Scalar::Double => {
            bytes.chunks_exact(8).map(|b| f64::from_le_bytes([b[0], b[1], b[2], b[3], b[4], b[5], b[6], b[7]])).collect()
        }
        Arg::Blob(bytes) => bytes.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))).collect(),
        _ => return Err(Fault::Damaged("the control points were not recorded".into())),
    };
    let mut points = Vec::new();
    for i in 0..u.3 {
        for j in 0..v.3 {
            let at = i.saturating_mul(u.2).saturating_add(j.saturating_mul(v.2));
            let part = numbers
                .get(at..at.saturating_add(size))
                .ok_or_else(|| Fault::Damaged("fewer control points than the order says".into()))?;
            let mut point = [0.0, 0.0, 0.0, 1.0];
            point.iter_mut().zip(part).for_each(|(value, &number)| *value = number as f32);
            points.push(point);
        }
    }
    gl.context.maps.set(surface, index, [(u.0, u.1, u.3), (v.0, v.1, v.3)], points);
    Ok(())
}

pub fn grid(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let axes = if shape.count == 2 { 2 } else { 1 };
    for axis in 0..axes {
        let count = call.i32(3 * axis)?;
        if count < 1 {
            return Err(INVALID_VALUE);
        }
        gl.state.grids[axis] = (count, call.f32(3 * axis + 1)?, call.f32(3 * axis + 2)?);
    }
    Ok(())
}

impl Gl {
    /// Sends the vertex at a parameter, with the attributes of the enabled maps. The current attributes do not change.
    fn evaluate(&mut self, surface: bool, u: f32, v: f32) -> GlResult {
        let first = if surface { e::MAP2_COLOR_4 } else { e::MAP1_COLOR_4 };
        let on = |index: usize| capability(first + index as u32).is_some_and(|bit| self.state.enabled & bit != 0);
        let map = |index: usize| self.context.maps.get(surface, index).filter(|_| on(index));
        let saved = self.state.current.clone();
        let mut vertex = saved.clone();
        if let Some(map) = map(COLOR) {
            vertex.color = map.at(u, v)[0];
        }
        if let Some(map) = map(NORMAL) {
            let [x, y, z, _] = map.at(u, v)[0];
            vertex.normal = [x, y, z];
        }
        // Of several texture maps, the one with the most coordinates is used.
        if let Some(map) = (TEXTURE..TEXTURE + 4).rev().find_map(map) {
            vertex.set_texture(0, map.at(u, v)[0]);
        }
        let Some(map) = map(VERTEX_4).or_else(|| map(VERTEX_3)) else { return Ok(()) };
        let [p, du, dv] = map.at(u, v);
        if surface && self.state.is(e::AUTO_NORMAL) {
            let at = Vec4::from(p);
            let part = |d: [f32; 4]| -> Vec3 {
                let d = Vec4::from(d);
                d.truncate() * at.w - at.truncate() * if at.w == 1.0 { 0.0 } else { d.w }
            };
            vertex.normal = part(du).cross(part(dv)).normalize_or_zero().to_array();
        }
        self.state.current = vertex;
        let outcome = self.vertex_at(p);
        self.state.current = saved;
        outcome
    }

    /// The parameter of a grid point.
    fn grid_at(&self, axis: usize, i: i32) -> f32 {
        let (count, from, to) = self.state.grids[axis];
        if i == count { to } else { from + i as f32 * ((to - from) / count as f32) }
    }
}

pub fn coordinate(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let ([u, v, ..], count) = components(call, shape, 0)?;
    gl.evaluate(count == 2, u as f32, v as f32)
}

pub fn point_1(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let u = gl.grid_at(0, call.i32(0)?);
    gl.evaluate(false, u, 0.0)
}

pub fn point_2(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (u, v) = (gl.grid_at(0, call.i32(0)?), gl.grid_at(1, call.i32(1)?));
    gl.evaluate(true, u, v)
}

fn emit(gl: &mut Gl, mode: u32, points: impl Iterator<Item = (i32, Option<i32>)>) -> GlResult {
    if gl.context.open_primitive.is_some() {
        return Err(INVALID_OPERATION);
    }
    gl.context.open_primitive = Some((mode, Vec::new()));
    for (i, j) in points {
        let u = gl.grid_at(0, i);
        let v = j.map_or(0.0, |j| gl.grid_at(1, j));
        gl.evaluate(j.is_some(), u, v)?;
    }
    let Some((mode, vertices)) = gl.context.open_primitive.take() else { return Ok(()) };
    gl.primitive(mode, &vertices)
}

fn bounded(ranges: &[(i32, i32)]) -> GlResult {
    let points: i64 = ranges.iter().map(|&(from, to)| (i64::from(to) - i64::from(from) + 1).clamp(0, MESH_MAX + 1)).product();
    if points > MESH_MAX { Err(Fault::Limit(format!("{points} points of a mesh, at most {MESH_MAX}"))) } else { Ok(()) }
}

pub fn mesh_1(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.apply_materials()?;
    let mode = match call.u32(0)? {
        e::POINT => e::POINTS,
        e::LINE => e::LINE_STRIP,
        _ => return Err(INVALID_ENUM),
    };
    let (from, to) = (call.i32(1)?, call.i32(2)?);
    bounded(&[(from, to)])?;
    emit(gl, mode, (from..=to).map(|i| (i, None)))
}

pub fn mesh_2(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.apply_materials()?;
    let mode = call.u32(0)?;
    let (i1, i2, j1, j2) = (call.i32(1)?, call.i32(2)?, call.i32(3)?, call.i32(4)?);
    bounded(&[(i1, i2), (j1, j2)])?;
    // A mesh that is empty along one axis has no points, whatever the range of the other.
    let empty = i1 > i2 || j1 > j2;
    match mode {
        e::POINT | e::LINE | e::FILL if empty => Ok(()),
        e::POINT => emit(gl, e::POINTS, (i1..=i2).flat_map(move |i| (j1..=j2).map(move |j| (i, Some(j))))),
        e::LINE => {
            for j in j1..=j2 {
                emit(gl, e::LINE_STRIP, (i1..=i2).map(|i| (i, Some(j))))?;
            }
            for i in i1..=i2 {
                emit(gl, e::LINE_STRIP, (j1..=j2).map(|j| (i, Some(j))))?;
            }
            Ok(())
        }
        e::FILL => {
            // The diagonals of smooth quadrilaterals are those of Mesa, which draws strips of triangles.
            let smooth = gl.fills() && !gl.state.lighting.flat;
            let strip = if smooth { e::TRIANGLE_STRIP } else { e::QUAD_STRIP };
            for j in j1..j2 {
                emit(gl, strip, (i1..=i2).flat_map(|i| [(i, Some(j)), (i, Some(j + 1))]))?;
            }
            Ok(())
        }
        _ => Err(INVALID_ENUM),
    }
}
