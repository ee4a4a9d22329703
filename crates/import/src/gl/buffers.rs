//! Buffer objects. Recorders report writes to a mapped buffer as calls of `memcpy`.

use std::rc::Rc;

use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Outcome, Shape};
use super::consts as e;
use super::machine::Gl;

/// A mapped buffer object.
#[derive(Clone, Copy, Debug)]
pub struct Mapping {
    /// The buffer object.
    buffer: u32,
    /// Its target.
    target: u32,
    /// The address of its first mapped byte in the recorded program.
    address: u64,
    /// Number of mapped bytes, from `offset` on.
    length: u64,
    /// The first byte of the buffer object that is mapped.
    offset: u64,
}

/// Maximum number of mapped buffers.
const MAPPINGS_MAX: usize = 1 << 16;

fn target(call: &Call) -> Outcome<usize> {
    match call.u32(0)? {
        e::ARRAY_BUFFER => Ok(0),
        e::ELEMENT_ARRAY_BUFFER => Ok(1),
        e::PIXEL_UNPACK_BUFFER => Ok(2),
        e::PIXEL_PACK_BUFFER => Ok(3),
        _ => Err(INVALID_ENUM),
    }
}

pub(super) fn bind(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let name = call.u32(1)?;
    match target(call)? {
        2 => gl.unpack.buffer = name,
        3 => gl.pack_buffer = name,
        target => gl.arrays.bound[target] = name,
    }
    if name != 0 {
        gl.buffers.get_or_insert_with(name, || Rc::from([]));
    }
    Ok(())
}

pub(super) fn data(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (bound, size) = (gl.bound_buffer(call.u32(0)?)?, call.f64(1)? as u64);
    if bound == 0 {
        return Err(INVALID_OPERATION);
    }
    let bytes: Rc<[u8]> = match call.arg(2) {
        Arg::Blob(bytes) => bytes.get(..size as usize).map_or_else(|| bytes.clone(), Rc::from),
        _ if size > 1 << 28 => return Err(Fault::Limit(format!("a buffer object of {size} bytes without contents"))),
        _ => vec![0; size as usize].into(),
    };
    gl.buffers.insert(bound, bytes);
    Ok(())
}

pub(super) fn sub_data(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (bound, at) = (gl.bound_buffer(call.u32(0)?)?, call.f64(1)? as u64 as usize);
    let buffer = gl.buffers.get_mut(bound).ok_or(INVALID_OPERATION)?;
    if call.f64(2)? == 0.0 {
        return Ok(());
    }
    let Arg::Blob(bytes) = call.arg(3) else { return Err(Fault::Damaged("the bytes were not recorded".into())) };
    let mut all = buffer.to_vec();
    let part = all.get_mut(at..at.saturating_add(bytes.len())).ok_or(INVALID_VALUE)?;
    part.copy_from_slice(bytes);
    *buffer = all.into();
    Ok(())
}

pub(super) fn delete(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        gl.buffers.remove(name);
        let pixels = [&mut gl.unpack.buffer, &mut gl.pack_buffer];
        for bound in gl.arrays.bound.iter_mut().chain(pixels).filter(|bound| **bound == name) {
            *bound = 0;
        }
    }
    Ok(())
}

fn add(gl: &mut Gl, call: &Call, offset: u64, length: Option<u64>) -> Outcome {
    let target = call.u32(0)?;
    let buffer = gl.bound_buffer(target)?;
    let bytes = gl.buffers.get(buffer).ok_or(INVALID_OPERATION)?.len() as u64;
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
        return Err(INVALID_VALUE);
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
    // A copy to any other address does not write to a buffer object.
    let Some(mapping) = mapping else { return Err(Fault::Unsupported("memcpy into memory that is not mapped".into())) };
    let buffer = gl.buffers.get_mut(mapping.buffer).ok_or(INVALID_OPERATION)?;
    let at = (mapping.offset + to - mapping.address) as usize;
    let mut all = buffer.to_vec();
    all.get_mut(at..at + bytes.len()).ok_or(INVALID_OPERATION)?.copy_from_slice(bytes);
    *buffer = all.into();
    Ok(())
}

impl Gl {
    /// The buffer object that is bound to a target.
    pub fn bound_buffer(&self, target: u32) -> Outcome<u32> {
        Ok(match target {
            e::ARRAY_BUFFER => self.arrays.bound[0],
            e::ELEMENT_ARRAY_BUFFER => self.arrays.bound[1],
            e::PIXEL_UNPACK_BUFFER => self.unpack.buffer,
            e::PIXEL_PACK_BUFFER => self.pack_buffer,
            _ => return Err(INVALID_ENUM),
        })
    }
}
