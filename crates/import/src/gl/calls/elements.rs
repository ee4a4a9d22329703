//! Draws from arrays: consecutive vertices, or those that indices select.

use std::rc::Rc;

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Scalar, Shape};
use crate::gl::calls::restart::parts;
use crate::gl::elements::scalar;
use crate::gl::machine::Gl;
use crate::gl::state::bindings::missing;
use crate::gl::state::selection::{Selection, Selector};

/// Maximum number of vertices of one draw.
const VERTICES_MAX: u32 = 1 << 22;

/// Checks the number of vertices of a draw.
pub fn bounded(count: u32) -> GlResult {
    if count > VERTICES_MAX {
        return Err(Fault::Limit(format!("{count} vertices in one draw, at most {VERTICES_MAX}")));
    }
    Ok(())
}

/// `glDrawArrays(mode, first, count)`
pub fn draw_arrays(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (mode, first, count) = (call.u32(0)?, call.size(1)?, call.size(2)?);
    bounded(count)?;
    gl.elements(mode, &Selection::sequence(first, count))
}

/// `glDrawArraysInstanced(mode, first, count, instances)`
pub fn draw_arrays_instanced(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (mode, first, count) = (call.u32(0)?, call.size(1)?, call.size(2)?);
    bounded(count)?;
    not_in_list(gl)?;
    let vertices = Selection::sequence(first, count);
    instances(gl, call.size(3)?, count, |gl| gl.elements(mode, &vertices))
}

/// Display lists cannot have draws of instances.
fn not_in_list(gl: &Gl) -> GlResult {
    if gl.context.compiling.is_some() { Err(INVALID_OPERATION) } else { Ok(()) }
}

/// Runs a draw once for each instance.
pub fn instances(gl: &mut Gl, count: u32, vertices: u32, mut draw: impl FnMut(&mut Gl) -> GlResult) -> GlResult {
    if u64::from(count) * u64::from(vertices) > u64::from(VERTICES_MAX) {
        return Err(Fault::Limit(format!(
            "{count} instances of {vertices} vertices in one draw, at most {VERTICES_MAX} in all"
        )));
    }
    // GLSL programs may read the instance number.
    let alone = gl.context.glsl_program != 0;
    let mut outcome = gl.flush();
    for instance in 0..count {
        if outcome.is_err() {
            break;
        }
        gl.drawing.instance = instance;
        outcome = draw(gl);
        if alone && outcome.is_ok() {
            outcome = gl.flush();
        }
    }
    gl.drawing.instance = 0;
    outcome
}

/// The call has start and end after the mode.
pub const RANGE: u8 = 1;
/// The call has a number of instances after the indices.
pub const INSTANCED: u8 = 2;
/// The call's last argument is added to each index.
pub const BASED: u8 = 4;

/// `glDrawElements(mode, count, type, indices)`, with [`RANGE`], [`INSTANCED`] and [`BASED`] among `PARTS`.
pub fn draw_elements<const PARTS: u8>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let at = if PARTS & RANGE != 0 { 3 } else { 1 };
    if PARTS & INSTANCED != 0 {
        not_in_list(gl)?;
    }
    let behind = at + 3;
    let (mode, kind) = (call.u32(0)?, call.u32(at + 1)?);
    let vertices = indices(gl, call.size(at)?, kind, call.arg(at + 2))?;
    let added = if PARTS & BASED != 0 { call.i32(behind + usize::from(PARTS & INSTANCED != 0))? } else { 0 };
    let count = vertices.numbers.len() as u32;
    let parts = parts(gl, vertices, kind, added)?;
    if PARTS & INSTANCED == 0 {
        return indexed(gl, mode, &parts);
    }
    instances(gl, call.size(behind)?, count, |gl| indexed(gl, mode, &parts))
}

/// Draws vertices that indices select, in parts.
pub fn indexed(gl: &mut Gl, mode: u32, parts: &[Selection]) -> GlResult {
    gl.drawing.indexed = true;
    let outcome = parts.iter().try_for_each(|vertices| gl.elements(mode, vertices));
    gl.drawing.indexed = false;
    outcome
}

/// The vertices that indices of a type select.
pub fn indices(gl: &Gl, count: u32, kind: u32, data: &Arg) -> GlResult<Selection> {
    bounded(count)?;
    let (scalar, bytes) =
        scalar(kind).filter(|&(s, _)| matches!(s, Scalar::Ubyte | Scalar::Ushort | Scalar::Uint)).ok_or(INVALID_ENUM)?;
    let bound = gl.context.arrays.bound[1];
    let in_buffer = |at: u64| {
        let bytes = gl.objects.buffers.get(bound).ok_or_else(|| missing(bound, INVALID_OPERATION))?.bytes()?.clone();
        Ok((bytes, at as usize, Selector::Buffer { name: bound, at: at as usize, kind: scalar, base: 0 }))
    };
    let (data, start, by): (Rc<[u8]>, usize, Selector) = match data {
        Arg::Blob(bytes) => (bytes.clone(), 0, Selector::Memory),
        Arg::Pointer(at) if bound != 0 => in_buffer(*at)?,
        Arg::Num(at) if bound != 0 => in_buffer(*at as u64)?,
        Arg::Null if bound != 0 => in_buffer(0)?,
        Arg::Nums(numbers) => {
            let numbers = numbers.iter().take(count as usize).map(|&n| n as u32).collect();
            return Ok(Selection { numbers, by: Selector::Memory });
        }
        _ if count == 0 => return Ok(Selection { numbers: Vec::new(), by: Selector::Memory }),
        _ => return Err(Fault::Damaged("the indices were not recorded".into())),
    };
    let end = start.saturating_add((count as usize).saturating_mul(bytes));
    let Some(part) = data.get(start..end) else {
        return Err(Fault::Damaged(format!("{count} indices reach past {} bytes", data.len())));
    };
    let numbers = match scalar {
        Scalar::Ushort => part.as_chunks().0.iter().map(|&bytes| u32::from(u16::from_le_bytes(bytes))).collect(),
        Scalar::Uint => part.as_chunks().0.iter().map(|&bytes| u32::from_le_bytes(bytes)).collect(),
        _ => part.iter().map(|&byte| u32::from(byte)).collect(),
    };
    Ok(Selection { numbers, by })
}

pub fn multi_draw_arrays(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (mode, firsts, counts) = (call.u32(0)?, call.numbers(1)?, call.numbers(2)?);
    for (&first, &count) in firsts.iter().zip(counts.iter()) {
        let (first, count) = (first as u32, count as u32);
        bounded(count)?;
        gl.elements(mode, &Selection::sequence(first, count))?;
    }
    Ok(())
}

/// `glMultiDrawElements(mode, counts, type, indices, number)`, also with a number for each draw that is added to its indices.
pub fn multi_draw_elements(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (mode, counts, kind) = (call.u32(0)?, call.numbers(1)?, call.u32(2)?);
    let of = |k: usize| match call.arg(3) {
        Arg::List(list) => list.get(k).cloned(),
        Arg::Nums(offsets) => offsets.get(k).map(|&at| Arg::Num(at)),
        _ => None,
    };
    let bases = if call.args.len() > 5 { Some(call.numbers(5)?) } else { None };
    for (k, &count) in counts.iter().enumerate() {
        let data = of(k).ok_or_else(|| Fault::Damaged(format!("the indices of draw {k} were not recorded")))?;
        let count = u32::try_from(count as i64).map_err(|_| INVALID_VALUE)?;
        let vertices = indices(gl, count, kind, &data)?;
        let base = |bases: &[f64]| bases.get(k).map(|&base| base as i32);
        let unknown = || Fault::Damaged(format!("the base vertex of draw {k} was not recorded"));
        let added = bases.as_deref().map_or(Some(0), base).ok_or_else(unknown)?;
        indexed(gl, mode, &parts(gl, vertices, kind, added)?)?;
    }
    Ok(())
}
