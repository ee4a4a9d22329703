//! Calls of buffer objects. Recorders report writes to a mapped buffer as calls of `memcpy`.

use std::rc::Rc;

use gl_shader::consts as e;

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Shape};
use crate::gl::machine::Gl;
use crate::gl::names::name;
use crate::gl::state::buffers::{
    BINDING_MAX, BufferObject, LOOKS_MAX, MAPPINGS_MAX, Mapping, OTHER_TARGETS, UNIFORM_BUFFER, UniformRange,
};

pub fn bind(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (target, name) = (call.u32(0)?, call.u32(1)?);
    match target {
        e::ARRAY_BUFFER => gl.context.arrays.bound[0] = name,
        e::ELEMENT_ARRAY_BUFFER => gl.context.arrays.bound[1] = name,
        e::PIXEL_UNPACK_BUFFER => gl.context.unpack.buffer = name,
        e::PIXEL_PACK_BUFFER => gl.context.buffers.pack = name,
        other if OTHER_TARGETS.contains(&other) => {
            gl.context.buffers.other.insert(other, name);
        }
        _ => return Err(INVALID_ENUM),
    }
    if name != 0 {
        gl.objects.buffers.get_or_insert_with(name, BufferObject::default);
    }
    Ok(())
}

/// `glBindBufferBase(target, index, buffer)`, or `glBindBufferRange(target, index, buffer, offset, size)`
pub fn bind_part<const RANGE: bool>(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (target, index, buffer) = (call.u32(0)?, call.u32(1)?, call.u32(2)?);
    if target != UNIFORM_BUFFER {
        return Err(Fault::Unsupported(format!("{} of {}", call.function.name, name(target))));
    }
    if index > BINDING_MAX {
        return Err(INVALID_VALUE);
    }
    gl.context.buffers.other.insert(target, buffer);
    if buffer == 0 {
        gl.context.buffers.uniform.remove(index);
        return Ok(());
    }
    gl.objects.buffers.get_or_insert_with(buffer, BufferObject::default);
    let (offset, size) = if RANGE { (call.f64(3)? as usize, Some(call.f64(4)? as usize)) } else { (0, None) };
    gl.context.buffers.uniform.insert(index, UniformRange { buffer, offset, size });
    Ok(())
}

/// As many of the recorded bytes as a call gives.
fn recorded(bytes: &[u8], size: usize) -> GlResult<&[u8]> {
    let few = || Fault::Damaged(format!("{} of {size} bytes were recorded", bytes.len()));
    bytes.get(..size).ok_or_else(few)
}

pub fn data(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (bound, size) = (gl.bound_buffer(call.u32(0)?)?, call.f64(1)? as u64);
    if bound == 0 {
        return Err(INVALID_OPERATION);
    }
    if gl.objects.buffers.get(bound).is_some_and(BufferObject::has_fixed_size) {
        return Err(INVALID_OPERATION);
    }
    let given = match call.arg(2) {
        Arg::Blob(bytes) => {
            Some(if bytes.len() as u64 == size { bytes.clone() } else { recorded(bytes, size as usize)?.into() })
        }
        _ if size > 1 << 28 => return Err(Fault::Limit(format!("a buffer object of {size} bytes without contents"))),
        _ => None,
    };
    let object = match given {
        Some(bytes) => BufferObject::new(bytes),
        None => BufferObject::without_contents(size as usize),
    };
    let old = gl.objects.buffers.remove(bound).unwrap_or_default();
    let object = gl.card.replace_buffer(old, object);
    gl.objects.buffers.insert(bound, object);
    Ok(())
}

/// `glBufferStorage(target, size, bytes, flags)`
pub fn storage(gl: &mut Gl, call: &Call, shape: Shape) -> GlResult {
    if !(call.f64(1)? > 0.0) {
        return Err(INVALID_VALUE);
    }
    let flags = call.u32(3)?;
    data(gl, call, shape)?;
    let bound = gl.bound_buffer(call.u32(0)?)?;
    gl.objects.buffers.get_mut(bound).ok_or(INVALID_OPERATION)?.fix_size(flags);
    Ok(())
}

/// `glCopyBufferSubData(from target, to target, from offset, to offset, size)`
pub fn copy_part(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let [from, to] = [gl.bound_buffer(call.u32(0)?)?, gl.bound_buffer(call.u32(1)?)?];
    let mut places = [0; 3];
    for (k, place) in places.iter_mut().enumerate() {
        let value = call.f64(2 + k)?;
        if !(value >= 0.0) {
            return Err(INVALID_VALUE);
        }
        *place = value as usize;
    }
    let [start, at, size] = places;
    let source = gl.objects.buffers.get(from).ok_or(INVALID_OPERATION)?.bytes()?;
    let end = start.checked_add(size).ok_or(INVALID_VALUE)?;
    let bytes: Rc<[u8]> = Rc::from(source.get(start..end).ok_or(INVALID_VALUE)?);
    if from == to && start < at.saturating_add(size) && at < end {
        return Err(INVALID_VALUE);
    }
    gl.objects.buffers.get_mut(to).ok_or(INVALID_OPERATION)?.write(at, &bytes, &mut gl.card)
}

/// `glReadPixels` and its like. Pictures do not depend on what a program reads, unless it reads into a buffer object and draws from that.
pub fn read_back(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    if let Some(object) = gl.objects.buffers.get_mut(gl.context.buffers.pack).filter(|_| gl.context.buffers.pack != 0) {
        object.note_read_back();
    }
    Ok(())
}

pub fn sub_data(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (bound, at) = (gl.bound_buffer(call.u32(0)?)?, call.f64(1)? as u64 as usize);
    let object = gl.objects.buffers.get_mut(bound).ok_or(INVALID_OPERATION)?;
    if object.refuses_data() {
        return Err(INVALID_OPERATION);
    }
    let size = call.f64(2)? as usize;
    if size == 0 {
        return Ok(());
    }
    let Arg::Blob(bytes) = call.arg(3) else { return Err(Fault::Damaged("the bytes were not recorded".into())) };
    object.write(at, recorded(bytes, size)?, &mut gl.card)
}

pub fn delete(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        if let Some(object) = gl.objects.buffers.remove(name) {
            gl.contexts.sharing().for_each(|context| context.lose_buffer(name));
            // Vertex array objects that are not bound keep it, under a name that the program does not have.
            gl.renames.searches += gl.context.arrays.objects() as u64;
            if gl.renames.searches > LOOKS_MAX {
                let what = "more than {LOOKS_MAX} looks at vertex array objects for deleted buffer objects";
                return Err(Fault::Limit(what.replace("{LOOKS_MAX}", &LOOKS_MAX.to_string())));
            }
            let hidden =
                (0..u32::MAX - gl.renames.given).rev().find(|&hidden| !gl.objects.buffers.contains(hidden)).unwrap_or(0);
            if gl.context.arrays.rename(name, hidden) {
                gl.renames.given += 1;
                gl.objects.buffers.insert(hidden, object);
            } else {
                gl.card.free_copy(object);
            }
        }
        let others = gl.context.buffers.other.values_mut().chain([&mut gl.context.unpack.buffer, &mut gl.context.buffers.pack]);
        for bound in gl.context.arrays.bound.iter_mut().chain(others).filter(|bound| **bound == name) {
            *bound = 0;
        }
    }
    Ok(())
}

fn add(gl: &mut Gl, call: &Call, offset: u64, length: Option<u64>) -> GlResult {
    let target = call.u32(0)?;
    let buffer = gl.bound_buffer(target)?;
    let bytes = gl.objects.buffers.get(buffer).ok_or(INVALID_OPERATION)?.size();
    let length = length.unwrap_or(bytes);
    let Arg::Pointer(address) = call.result else { return Ok(()) };
    if offset.checked_add(length).is_none_or(|end| end > bytes)
        || gl.objects.mappings.iter().any(|known| known.buffer == buffer)
    {
        return Err(INVALID_OPERATION);
    }
    if gl.objects.mappings.len() >= MAPPINGS_MAX {
        return Err(Fault::Limit(format!("more than {MAPPINGS_MAX} mapped buffers")));
    }
    gl.objects.mappings.push(Mapping { buffer, target, address, length, offset });
    Ok(())
}

pub fn map(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    add(gl, call, 0, None)
}

pub fn map_range(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (offset, length) = (call.f64(1)?, call.f64(2)?);
    if offset < 0.0 || length < 0.0 {
        return Err(INVALID_VALUE);
    }
    add(gl, call, offset as u64, Some(length as u64))
}

pub fn unmap(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let target = call.u32(0)?;
    let buffer = gl.bound_buffer(target)?;
    let at = gl.objects.mappings.iter().position(|known| known.buffer == buffer && known.target == target);
    gl.objects.mappings.remove(at.ok_or(INVALID_OPERATION)?);
    Ok(())
}

/// `memcpy(to, bytes, count)` of the recorder.
pub fn copy(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (Arg::Pointer(to), Arg::Blob(bytes)) = (call.arg(0), call.arg(1)) else {
        return Err(Fault::Damaged("the bytes of a mapped buffer were not recorded".into()));
    };
    let inside = |m: &&Mapping| to.checked_sub(m.address).is_some_and(|at| at + bytes.len() as u64 <= m.length);
    // Threads without a context write to mapped memory too.
    let own = [(&gl.objects.mappings, &mut gl.objects.buffers)].into_iter();
    let others = gl.contexts.other_groups().map(|group| (&group.mappings, &mut group.buffers));
    let found = own.chain(others).find_map(|(mappings, buffers)| Some((*mappings.iter().find(inside)?, buffers)));
    // A copy to any other address does not write to a buffer object.
    let Some((mapping, buffers)) = found else {
        return Err(Fault::Unsupported("memcpy into memory that is not mapped".into()));
    };
    let object = buffers.get_mut(mapping.buffer).ok_or(INVALID_OPERATION)?;
    let at = (mapping.offset + to - mapping.address) as usize;
    object.write(at, bytes, &mut gl.card).map_err(|_| INVALID_OPERATION)
}
