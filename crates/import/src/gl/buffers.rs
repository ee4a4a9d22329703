//! Contents of buffer objects that a program writes through a mapping: recorders tell them by a call of `memcpy`.

use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, Outcome, Shape};
use super::machine::Gl;

/// A mapped buffer object.
#[derive(Clone, Copy, Debug)]
pub struct Mapping {
    /// The buffer object.
    buffer: u32,
    /// Its target.
    target: u32,
    /// The address in the recorded program of its first byte.
    address: u64,
    /// Mapped bytes, from `offset` on.
    length: u64,
    /// The first byte of the buffer object that is mapped.
    offset: u64,
}

/// Mapped buffers at most.
const MAPPINGS_MAX: usize = 1 << 16;

fn add(gl: &mut Gl, call: &Call, offset: u64, length: Option<u64>) -> Outcome {
    let target = call.u32(0)?;
    let buffer = gl.bound_buffer(target)?;
    let bytes = gl.buffers.get(&buffer).ok_or(INVALID_OPERATION)?.len() as u64;
    let length = length.unwrap_or(bytes);
    let Arg::Pointer(address) = call.result else { return Ok(()) };
    if offset.checked_add(length).is_none_or(|end| end > bytes) || gl.mappings.iter().any(|known| known.buffer == buffer) {
        return Err(INVALID_OPERATION);
    }
    if gl.mappings.len() >= MAPPINGS_MAX {
        return Err(Fault::Limit(format!("more than {MAPPINGS_MAX} mapped buffers")));
    }
    gl.mappings.push(Mapping { buffer, target, address, length, offset });
    Ok(())
}

pub(super) fn map(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    add(gl, call, 0, None)
}

pub(super) fn map_range(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (offset, length) = (call.f64(1)?, call.f64(2)?);
    if offset < 0.0 || length < 0.0 {
        return Err(super::call::INVALID_VALUE);
    }
    add(gl, call, offset as u64, Some(length as u64))
}

pub(super) fn unmap(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let target = call.u32(0)?;
    let buffer = gl.bound_buffer(target)?;
    let at = gl.mappings.iter().position(|known| known.buffer == buffer && known.target == target);
    gl.mappings.remove(at.ok_or(INVALID_OPERATION)?);
    Ok(())
}

/// `memcpy(to, bytes, count)` of the recorder.
pub(super) fn copy(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (Arg::Pointer(to), Arg::Blob(bytes)) = (call.arg(0), call.arg(1)) else {
        return Err(Fault::Damaged("the bytes of a mapped buffer were not recorded".into()));
    };
    let inside = |m: &&Mapping| to.checked_sub(m.address).is_some_and(|at| at + bytes.len() as u64 <= m.length);
    let mapping = gl.mappings.iter().find(inside).copied();
    // Other memory that is copied is none of a buffer object.
    let Some(mapping) = mapping else { return Err(Fault::Unsupported("memcpy into memory that is not mapped".into())) };
    let buffer = gl.buffers.get_mut(&mapping.buffer).ok_or(INVALID_OPERATION)?;
    let at = (mapping.offset + to - mapping.address) as usize;
    let mut all = buffer.to_vec();
    all.get_mut(at..at + bytes.len()).ok_or(INVALID_OPERATION)?.copy_from_slice(bytes);
    *buffer = all.into();
    Ok(())
}

impl Gl {
    /// The buffer object that is bound to a target.
    pub fn bound_buffer(&self, target: u32) -> Outcome<u32> {
        use super::consts as e;
        Ok(match target {
            e::ARRAY_BUFFER => self.arrays.bound[0],
            e::ELEMENT_ARRAY_BUFFER => self.arrays.bound[1],
            e::PIXEL_UNPACK_BUFFER => self.unpack.buffer,
            e::PIXEL_PACK_BUFFER => self.pack_buffer,
            _ => return Err(INVALID_ENUM),
        })
    }
}
