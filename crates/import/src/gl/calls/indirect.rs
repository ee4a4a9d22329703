//! Draws whose counts a buffer object has. Its contents are those that the program gave: what a shader would write there is not known.

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, Scalar, Shape};
use crate::gl::calls::elements::{bounded, indexed, indices, instances};
use crate::gl::calls::restart::parts;
use crate::gl::elements::scalar;
use crate::gl::machine::Gl;
use crate::gl::state::buffers::BUFFER;
use crate::gl::state::selection::Selection;

/// Maximum number of draws of one call.
const DRAWS_MAX: u32 = 1 << 16;
/// The draw has indices.
pub const INDEXED: u8 = 1;
/// The call has a number of draws, and bytes from one to the next, after the place.
pub const SEVERAL: u8 = 2;

/// `glDrawArraysIndirect(mode, place)`, `glDrawElementsIndirect(mode, type, place)`, and both for several draws, with [`INDEXED`] and
/// [`SEVERAL`] among `PARTS`.
pub fn draw<const PARTS: u8>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (mode, at) = (call.u32(0)?, if PARTS & INDEXED != 0 { 2 } else { 1 });
    let bound = gl.context.buffers.other.get(BUFFER).copied().unwrap_or(0);
    let in_buffer = || GlResult::Ok(gl.objects.buffers.get(bound).ok_or(INVALID_OPERATION)?.bytes()?.clone());
    let (bytes, start) = match call.arg(at) {
        Arg::Blob(bytes) => (bytes.clone(), 0),
        Arg::Pointer(place) => (in_buffer()?, *place as usize),
        Arg::Num(place) => (in_buffer()?, *place as usize),
        Arg::Null => (in_buffer()?, 0),
        _ => return Err(Fault::Damaged("the counts of the draw were not recorded".into())),
    };
    let words = if PARTS & INDEXED != 0 { 5 } else { 4 };
    let (draws, stride) = if PARTS & SEVERAL != 0 { (call.size(at + 1)?, call.size(at + 2)?) } else { (1, 0) };
    if draws > DRAWS_MAX {
        return Err(Fault::Limit(format!("{draws} draws in one call, at most {DRAWS_MAX}")));
    }
    let stride = if stride == 0 { 4 * words } else { stride as usize };
    for k in 0..draws as usize {
        let from = start.saturating_add(k * stride);
        let Some(part) = bytes.get(from..from.saturating_add(4 * words)) else { return Err(INVALID_OPERATION) };
        let word = |k: usize| u32::from_le_bytes([part[4 * k], part[4 * k + 1], part[4 * k + 2], part[4 * k + 3]]);
        let (count, repeated, first) = (word(0), word(1), word(2));
        if word(words - 1) != 0 {
            return Err(Fault::Unsupported(format!("{} with a base instance", call.function.name)));
        }
        bounded(count)?;
        if PARTS & INDEXED == 0 {
            let vertices = Selection::sequence(first, count);
            instances(gl, repeated, count, |gl| gl.elements(mode, &vertices))?;
            continue;
        }
        if gl.context.arrays.bound[1] == 0 {
            return Err(INVALID_OPERATION);
        }
        let kind = call.u32(1)?;
        let (_, size) =
            scalar(kind).filter(|&(s, _)| matches!(s, Scalar::Ubyte | Scalar::Ushort | Scalar::Uint)).ok_or(INVALID_ENUM)?;
        let place = u64::from(first) * size as u64;
        let vertices = indices(gl, count, kind, &Arg::Pointer(place))?;
        let parts = parts(gl, vertices, kind, word(3) as i32)?;
        instances(gl, repeated, count, |gl| indexed(gl, mode, &parts))?;
    }
    Ok(())
}
