//! Values that the recorded program sets for uniforms.

use gl_shader::glsl::{Layout, Translated};
use naga::ScalarKind;

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scalar, Shape};
use crate::gl::machine::Gl;

/// The position of a part of a uniform: its layout, its first vector, and the number of array elements from there on.
fn part(layout: &Layout, path: &str, first: usize) -> Option<(Layout, usize, usize)> {
    if path.is_empty() {
        return Some(match layout {
            Layout::Array(element, count) => (Layout::clone(element), first, *count),
            other => (other.clone(), first, 1),
        });
    }
    match layout {
        Layout::Array(element, count) => {
            let (index, rest) = path.strip_prefix('[')?.split_once(']')?;
            let index: usize = index.parse().ok().filter(|index| index < count)?;
            let at = first + index * element.slots();
            match rest {
                "" => Some((Layout::clone(element), at, count - index)),
                rest => part(element, rest, at),
            }
        }
        Layout::Struct(_, members) => {
            let rest = path.strip_prefix('.')?;
            let end = rest.find(['.', '[']).unwrap_or(rest.len());
            // A name that later versions reserve has a line behind it.
            let names = |name: &str| name.strip_suffix('_') == Some(&rest[..end]);
            let at = members.iter().position(|member| member.name == rest[..end]);
            let at = at.or_else(|| members.iter().position(|member| names(&member.name)))?;
            let before: usize = members[..at].iter().map(|member| member.layout.slots()).sum();
            part(&members[at].layout, &rest[end..], first + before)
        }
        _ => None,
    }
}

/// Splits a name into its root and the path after it.
fn root(name: &str) -> (&str, &str) {
    name.split_at(name.find(['.', '[']).unwrap_or(name.len()))
}

/// Writes numbers to a uniform of the program `name`: `shape` is the columns and rows of each value.
fn set(gl: &mut Gl, name: u32, location: i64, shape: [usize; 2], numbers: &[f64], scalar: Scalar) -> GlResult {
    let Ok(location) = u64::try_from(location) else { return Ok(()) };
    let unnamed = || Fault::Unsupported("uniforms at locations that the recording does not name".into());
    let object = gl.objects.glsl.program(name)?;
    let linked = match object.executable.linked.clone() {
        Some(Ok(linked)) => linked,
        // Drawing with it is refused.
        Some(Err(_)) => return Ok(()),
        None => return Err(INVALID_OPERATION),
    };
    // The location of a uniform was queried by the program, is stated in its declaration, or follows one of these in an array.
    let declared = |location: u64| {
        let mut all = linked.stages.iter().flatten().flat_map(Translated::located);
        all.find(|&(_, at)| u64::from(at) == location).map(|(name, _)| name.to_owned())
    };
    let asked = |at: u64| Some((at, object.executable.locations.get(at)?.clone()));
    let before = || object.executable.locations.keys_in(0..location).next_back().and_then(asked);
    let exact = asked(location).or_else(|| Some((location, declared(location)?)));
    let Some((at, path)) = exact.or_else(before) else {
        return Err(unnamed());
    };
    let (root, rest) = root(&path);
    let offset = (location - at) as usize;
    let samplers = || linked.stages.iter().flatten().flat_map(|stage| &stage.samplers);
    if samplers().any(|sampler| sampler.name.strip_prefix(root).is_some_and(|rest| rest.starts_with('['))) {
        // An array of samplers: the call sets several from this one on.
        let index = rest.strip_prefix('[').and_then(|rest| rest.strip_suffix(']')?.parse().ok());
        let first = offset.saturating_add(index.unwrap_or(0));
        for (k, &unit) in numbers.iter().enumerate() {
            let name = format!("{root}[{}]", first.saturating_add(k));
            if samplers().any(|sampler| sampler.name == name) {
                object.executable.units.insert(&name, unit as u32);
            }
        }
        return Ok(());
    }
    if samplers().any(|sampler| sampler.name == root) {
        if offset != 0 {
            return Err(unnamed());
        }
        let unit = numbers.first().ok_or(INVALID_VALUE)?;
        object.executable.units.insert(root, *unit as u32);
        return Ok(());
    }
    let [columns, rows] = shape;
    for (values, stage) in object.executable.values.iter_mut().zip(linked.stages()) {
        let Some(uniform) = stage.and_then(|stage| stage.uniforms.iter().find(|uniform| uniform.name == root)) else {
            continue;
        };
        let (element, first, count) = part(&uniform.layout, rest, uniform.first).ok_or(INVALID_OPERATION)?;
        if offset >= count {
            return Err(unnamed());
        }
        let kind = match element {
            Layout::Vector(n, kind) if [1, n] == shape => kind,
            Layout::Matrix(c, r) if [c, r] == shape => ScalarKind::Float,
            _ => return Err(INVALID_OPERATION),
        };
        for (k, value) in numbers.chunks_exact(columns * rows).enumerate().take(count.saturating_sub(offset)) {
            let to = first + (offset + k) * element.slots();
            for (slot, column) in values[to..].iter_mut().zip(value.chunks_exact(rows)) {
                for (to, &number) in slot.iter_mut().zip(column) {
                    *to = match kind {
                        ScalarKind::Bool => f32::from(u8::from(number != 0.0)),
                        ScalarKind::Sint | ScalarKind::Uint if scalar == Scalar::Float => return Err(INVALID_OPERATION),
                        ScalarKind::Sint | ScalarKind::Uint => f32::from_bits(number as i64 as u32),
                        _ => number as f32,
                    };
                }
            }
        }
    }
    Ok(())
}

/// The program whose uniform a call sets, and the argument that is its location: the current program, or with `NAMED` that of the first
/// argument.
fn program<const NAMED: bool>(gl: &Gl, call: &Call) -> GlResult<(u32, usize)> {
    if NAMED { Ok((call.u32(0)?, 1)) } else { Ok((gl.context.glsl_program, 0)) }
}

/// `glUniform3f(location, x, y, z)`, `glUniform3fv(location, count, values)`; `glProgramUniform3f(program, location, x, y, z)`
pub fn uniform<const NAMED: bool>(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let (name, at) = program::<NAMED>(gl, call)?;
    let n = if (1..=4).contains(&shape.count) { shape.count } else { return Err(INVALID_ENUM) };
    let numbers: Vec<f64> = if shape.vector {
        let count = call.size(at + 1)? as usize;
        call.numbers(at + 2)?.iter().copied().take(count.saturating_mul(n)).collect()
    } else {
        (1..=n).map(|k| call.f64(at + k)).collect::<GlResult<_>>()?
    };
    set(gl, name, i64::from(call.i32(at)?), [1, n], &numbers, shape.scalar)
}

/// `glUniformMatrix4fv(location, count, transpose, values)`
fn matrices<const NAMED: bool>(gl: &mut Gl, call: &Call, columns: usize, rows: usize) -> GlResult {
    let (name, at) = program::<NAMED>(gl, call)?;
    let (count, transpose, numbers) = (call.size(at + 1)? as usize, call.bool(at + 2)?, call.numbers(at + 3)?);
    let mut values = Vec::new();
    for matrix in numbers.chunks_exact(columns * rows).take(count) {
        if transpose {
            values.extend((0..columns * rows).map(|k| matrix[k % rows * columns + k / rows]));
        } else {
            values.extend_from_slice(matrix);
        }
    }
    set(gl, name, i64::from(call.i32(at)?), [columns, rows], &values, Scalar::Float)
}

pub fn uniform_matrix<const NAMED: bool>(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let n = if (2..=4).contains(&shape.count) { shape.count } else { return Err(INVALID_ENUM) };
    matrices::<NAMED>(gl, call, n, n)
}

/// `glUniformMatrix2x3fv`: the number of columns is in the stem of the name.
pub fn uniform_matrix_of<const NAMED: bool>(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    let columns = ["2x", "3x", "4x"].iter().position(|part| call.function.name.contains(part)).ok_or(INVALID_ENUM)? + 2;
    let rows = if (2..=4).contains(&shape.count) { shape.count } else { return Err(INVALID_ENUM) };
    matrices::<NAMED>(gl, call, columns, rows)
}
