//! Buffer objects. Recorders report writes to a mapped buffer as calls of `memcpy`.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;

use num::{BufferId, NumberMap};

use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Outcome, Scalar, Shape};
use super::card::Card;
use super::components::Element;
use super::consts as e;
use super::contexts::{GONE, missing};
use super::geometry::KEPT_MAX;
use super::machine::Gl;

/// Separate ranges that the card lacks at most; more are joined.
const RANGES_MAX: usize = 32;

/// Conversions of a buffer object's contents that are remembered at most.
const CONVERSIONS_MAX: usize = 256;

/// A conversion of a buffer object's contents to what the card can read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Conversion {
    /// All elements of an array as floats, without gaps.
    Elements {
        /// How they are stored.
        element: Element,
        /// Whether integers are normalised.
        normalized: bool,
        /// Bytes from one element to the next.
        stride: usize,
        /// The first byte of the first element.
        start: usize,
    },
    /// Indices of a draw in the order and the type in which the card reads them.
    Indices {
        /// The mode of the draw.
        mode: u32,
        /// Whether the primitives become a list.
        list: bool,
        /// Whether diagonals of quadrilaterals begin at first vertices.
        begins: bool,
        /// Type of the indices; none: consecutive vertices.
        kind: Option<Scalar>,
        /// The first byte of the indices, or the first vertex.
        at: usize,
        /// Added to each index.
        base: i32,
        /// Number of vertices.
        count: usize,
    },
}

/// The use of a conversion since the buffer object changed.
#[derive(Debug)]
struct Converted {
    conversion: Conversion,
    /// Vertices that were drawn with it.
    drawn: u64,
    /// What the card keeps of it, and its bytes.
    copy: Option<(BufferId, u64)>,
}

/// A buffer object. The card has a copy once it has drawn from it.
#[derive(Debug, Default)]
pub struct BufferObject {
    bytes: Rc<[u8]>,
    /// The card's copy.
    copy: Option<BufferId>,
    /// Bytes that the copy lacks, in order. Bytes that the program never gave are zero in both.
    lacking: Vec<Range<u64>>,
    /// Conversions of the present contents.
    converted: RefCell<Vec<Converted>>,
    /// Whether pixels were read back into it since its contents were given.
    read_back: bool,
    /// The flags of its storage, if its size is fixed (`glBufferStorage`).
    storage: Option<u32>,
}

impl BufferObject {
    /// A buffer object with these contents.
    fn new(bytes: Rc<[u8]>) -> BufferObject {
        let mut object = BufferObject { bytes, ..BufferObject::default() };
        object.changed(0..object.size());
        object
    }

    /// Its contents.
    ///
    /// # Errors
    /// If these are pixels that were read back: a recording does not have them.
    pub fn bytes(&self) -> Outcome<&Rc<[u8]>> {
        if self.read_back {
            return Err(Fault::Unsupported("reading of a buffer object into which pixels were read back".into()));
        }
        Ok(&self.bytes)
    }

    /// Its size in bytes.
    fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Writes bytes at an offset.
    fn write(&mut self, at: usize, bytes: &[u8], card: &mut Card) -> Outcome {
        let end = at.checked_add(bytes.len()).filter(|&end| end <= self.bytes.len()).ok_or(INVALID_VALUE)?;
        Rc::make_mut(&mut self.bytes)[at..end].copy_from_slice(bytes);
        self.read_back &= bytes.len() < self.bytes.len();
        self.changed(at as u64..end as u64);
        card.free_converted(self);
        Ok(())
    }

    /// Notes that the card's copy lacks these bytes.
    fn changed(&mut self, mut range: Range<u64>) {
        if range.is_empty() {
            return;
        }
        let first = self.lacking.partition_point(|known| known.end < range.start);
        let last = self.lacking.partition_point(|known| known.start <= range.end);
        if let Some(joined) = self.lacking.get(first..last).filter(|joined| !joined.is_empty()) {
            range = range.start.min(joined[0].start)..range.end.max(joined[joined.len() - 1].end);
        }
        self.lacking.splice(first..last, [range]);
        if self.lacking.len() > RANGES_MAX {
            let end = self.lacking[RANGES_MAX].end;
            self.lacking.truncate(1);
            self.lacking[0].end = end;
        }
    }

    /// Whether the card's copy lacks all bytes.
    fn lacks_all(&self) -> bool {
        matches!(&self.lacking[..], [all] if *all == (0..self.size()))
    }
}

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

/// A flag of storage that is written by `glBufferSubData`.
const DYNAMIC_STORAGE: u32 = 0x100;

const UNIFORM_BUFFER: u32 = 0x8a11;

/// Targets to which a buffer object may be bound to change it: texture, transform feedback, uniform, copy read and write, draw and dispatch
/// indirect, shader storage, query and atomic counter buffers. What else they serve for is refused where it is used.
const OTHER_TARGETS: [u32; 10] =
    [0x8c2a, 0x8c8e, UNIFORM_BUFFER, 0x8f36, 0x8f37, super::indirect::BUFFER, 0x90ee, 0x90d2, 0x9192, 0x92c0];

/// Maximum number of a binding of uniform blocks.
const BINDING_MAX: u32 = 1 << 10;

/// The part of a buffer object that a uniform block reads.
#[derive(Clone, Debug)]
pub struct UniformRange {
    buffer: u32,
    offset: usize,
    /// Bytes; none: up to its end.
    size: Option<usize>,
}

impl UniformRange {
    /// The name of the buffer object.
    pub fn buffer(&mut self) -> &mut u32 {
        &mut self.buffer
    }
}

pub(super) fn bind(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (target, name) = (call.u32(0)?, call.u32(1)?);
    match target {
        e::ARRAY_BUFFER => gl.arrays.bound[0] = name,
        e::ELEMENT_ARRAY_BUFFER => gl.arrays.bound[1] = name,
        e::PIXEL_UNPACK_BUFFER => gl.unpack.buffer = name,
        e::PIXEL_PACK_BUFFER => gl.pack_buffer = name,
        other if OTHER_TARGETS.contains(&other) => {
            gl.other_buffers.insert(other, name);
        }
        _ => return Err(INVALID_ENUM),
    }
    if name != 0 {
        gl.buffers.get_or_insert_with(name, BufferObject::default);
    }
    Ok(())
}

/// `glBindBufferBase(target, index, buffer)`, or `glBindBufferRange(target, index, buffer, offset, size)`
pub(super) fn bind_part<const RANGE: bool>(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (target, index, buffer) = (call.u32(0)?, call.u32(1)?, call.u32(2)?);
    if target != UNIFORM_BUFFER {
        return Err(Fault::Unsupported(format!("{} of {}", call.function.name, super::names::name(target))));
    }
    if index > BINDING_MAX {
        return Err(INVALID_VALUE);
    }
    gl.other_buffers.insert(target, buffer);
    if buffer == 0 {
        gl.uniform_buffers.remove(index);
        return Ok(());
    }
    gl.buffers.get_or_insert_with(buffer, BufferObject::default);
    let (offset, size) = if RANGE { (call.f64(3)? as usize, Some(call.f64(4)? as usize)) } else { (0, None) };
    gl.uniform_buffers.insert(index, UniformRange { buffer, offset, size });
    Ok(())
}

/// As many of the recorded bytes as a call gives.
fn recorded(bytes: &[u8], size: usize) -> Outcome<&[u8]> {
    let few = || Fault::Damaged(format!("{} of {size} bytes were recorded", bytes.len()));
    bytes.get(..size).ok_or_else(few)
}

pub(super) fn data(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (bound, size) = (gl.bound_buffer(call.u32(0)?)?, call.f64(1)? as u64);
    if bound == 0 {
        return Err(INVALID_OPERATION);
    }
    if gl.buffers.get(bound).is_some_and(|object| object.storage.is_some()) {
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
        None => BufferObject { bytes: vec![0; size as usize].into(), ..BufferObject::default() },
    };
    let mut old = gl.buffers.remove(bound).unwrap_or_default();
    gl.card.free_converted(&mut old);
    // The card's copy is written again if all its bytes are given anew.
    let again = old.size() == object.size() && object.lacks_all();
    let copy = old.copy.filter(|_| again);
    if !again {
        gl.card.free_copy(old);
    }
    gl.buffers.insert(bound, BufferObject { copy, ..object });
    Ok(())
}

/// `glBufferStorage(target, size, bytes, flags)`
pub(super) fn storage(gl: &mut Gl, call: &Call, shape: Shape) -> Outcome {
    if !(call.f64(1)? > 0.0) {
        return Err(INVALID_VALUE);
    }
    let flags = call.u32(3)?;
    data(gl, call, shape)?;
    let bound = gl.bound_buffer(call.u32(0)?)?;
    gl.buffers.get_mut(bound).ok_or(INVALID_OPERATION)?.storage = Some(flags);
    Ok(())
}

/// `glCopyBufferSubData(from target, to target, from offset, to offset, size)`
pub(super) fn copy_part(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
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
    let source = gl.buffers.get(from).ok_or(INVALID_OPERATION)?.bytes()?;
    let end = start.checked_add(size).ok_or(INVALID_VALUE)?;
    let bytes: Rc<[u8]> = Rc::from(source.get(start..end).ok_or(INVALID_VALUE)?);
    if from == to && start < at.saturating_add(size) && at < end {
        return Err(INVALID_VALUE);
    }
    gl.buffers.get_mut(to).ok_or(INVALID_OPERATION)?.write(at, &bytes, &mut gl.card)
}

/// `glReadPixels` and its like. Pictures do not depend on what a program reads, unless it reads into a buffer object and draws from that.
pub(super) fn read_back(gl: &mut Gl, _: &Call, _: Shape) -> Outcome {
    if let Some(object) = gl.buffers.get_mut(gl.pack_buffer).filter(|_| gl.pack_buffer != 0) {
        object.read_back = true;
    }
    Ok(())
}

pub(super) fn sub_data(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (bound, at) = (gl.bound_buffer(call.u32(0)?)?, call.f64(1)? as u64 as usize);
    let object = gl.buffers.get_mut(bound).ok_or(INVALID_OPERATION)?;
    if object.storage.is_some_and(|flags| flags & DYNAMIC_STORAGE == 0) {
        return Err(INVALID_OPERATION);
    }
    let size = call.f64(2)? as usize;
    if size == 0 {
        return Ok(());
    }
    let Arg::Blob(bytes) = call.arg(3) else { return Err(Fault::Damaged("the bytes were not recorded".into())) };
    object.write(at, recorded(bytes, size)?, &mut gl.card)
}

/// Maximum number of times that a vertex array object is searched for a deleted buffer object.
const LOOKS_MAX: u64 = 1 << 26;

pub(super) fn delete(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        if let Some(object) = gl.buffers.remove(name) {
            gl.contexts.sharing().for_each(|context| context.lose_buffer(name));
            // Vertex array objects that are not bound keep it, under a name that the program does not have.
            gl.looks += gl.arrays.objects() as u64;
            if gl.looks > LOOKS_MAX {
                let what = "more than {LOOKS_MAX} looks at vertex array objects for deleted buffer objects";
                return Err(Fault::Limit(what.replace("{LOOKS_MAX}", &LOOKS_MAX.to_string())));
            }
            let hidden = (0..u32::MAX - gl.renamed).rev().find(|&hidden| !gl.buffers.contains(hidden)).unwrap_or(0);
            if gl.arrays.rename(name, hidden) {
                gl.renamed += 1;
                gl.buffers.insert(hidden, object);
            } else {
                gl.card.free_copy(object);
            }
        }
        let others = gl.other_buffers.values_mut().chain([&mut gl.unpack.buffer, &mut gl.pack_buffer]);
        for bound in gl.arrays.bound.iter_mut().chain(others).filter(|bound| **bound == name) {
            *bound = 0;
        }
    }
    Ok(())
}

fn add(gl: &mut Gl, call: &Call, offset: u64, length: Option<u64>) -> Outcome {
    let target = call.u32(0)?;
    let buffer = gl.bound_buffer(target)?;
    let bytes = gl.buffers.get(buffer).ok_or(INVALID_OPERATION)?.size();
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
    // Threads without a context write to mapped memory too.
    let own = [(&gl.mappings, &mut gl.buffers)].into_iter();
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

impl Card {
    /// Whether draws may read a buffer object from the card's memory now. They may not if pending draws read bytes of the copy that have
    /// changed since. A new copy takes the place of the old one if the program has given all bytes anew.
    pub fn can_read(&self, object: &BufferObject) -> bool {
        let Some(copy) = object.copy else { return !object.bytes.is_empty() };
        !object.lacking.iter().any(|range| self.reads(copy, range)) || object.lacks_all() && self.is_wanted()
    }

    /// The copy of a buffer object that [`Card::can_read`]; uploads what it lacks.
    pub fn copy(&mut self, object: &mut BufferObject) -> BufferId {
        if let Some(copy) = object.copy
            && object.lacking.iter().any(|range| self.reads(copy, range))
        {
            object.copy = None;
            self.condemn(copy, object.size());
        }
        let size = object.size();
        let copy = *object.copy.get_or_insert_with(|| self.recorder.create_buffer("buffer", size));
        for range in object.lacking.drain(..) {
            self.bytes += range.end - range.start;
            let bytes = &object.bytes[range.start as usize..range.end as usize];
            self.recorder.write_buffer(copy, range.start, "buffer", bytes);
        }
        copy
    }

    /// Whether a draw of `count` vertices reads a conversion of `bytes` bytes from the card's memory. It is kept there once `least` vertices
    /// were drawn with it, so that it costs no more than what it saves if the buffer object changes often.
    pub fn keeps(&self, object: &BufferObject, conversion: Conversion, [count, least, bytes]: [u64; 3]) -> bool {
        let mut all = object.converted.borrow_mut();
        let known = match all.iter_mut().position(|known| known.conversion == conversion) {
            Some(at) => &mut all[at],
            None if all.len() < CONVERSIONS_MAX => all.push_mut(Converted { conversion, drawn: 0, copy: None }),
            None => return false,
        };
        known.drawn = known.drawn.saturating_add(count);
        known.copy.is_some() || known.drawn >= least && self.kept_bytes.saturating_add(bytes) <= KEPT_MAX
    }

    /// The copy of a conversion that [`Card::keeps`]; made once.
    pub fn converted(
        &mut self,
        object: &mut BufferObject,
        conversion: Conversion,
        make: impl FnOnce(&[u8]) -> Vec<u8>,
    ) -> Option<BufferId> {
        let known = object.converted.get_mut().iter_mut().find(|known| known.conversion == conversion)?;
        if let Some((copy, _)) = known.copy {
            return Some(copy);
        }
        let bytes = make(&object.bytes);
        let copy = self.recorder.create_buffer_init("converted", &bytes);
        self.kept_bytes += bytes.len() as u64;
        // The trace keeps them even if the card does not.
        self.bytes += bytes.len() as u64;
        known.copy = Some((copy, bytes.len() as u64));
        Some(copy)
    }

    /// Frees the conversions of a buffer object that changes.
    fn free_converted(&mut self, object: &mut BufferObject) {
        for (copy, bytes) in object.converted.get_mut().drain(..).filter_map(|known| known.copy) {
            self.kept_bytes -= bytes;
            self.condemn(copy, bytes);
        }
    }

    /// Frees the copy of a buffer object.
    pub(super) fn free_copy(&mut self, mut object: BufferObject) {
        self.free_converted(&mut object);
        if let Some(copy) = object.copy {
            self.condemn(copy, object.size());
        }
    }
}

impl Gl {
    /// Uploads what the card's copies of buffer objects lack, so that the first wanted frame does not. No pass may be pending.
    pub fn upload_changes(&mut self) {
        let others = self.contexts.other_groups().map(|group| &mut group.buffers);
        for object in [&mut self.buffers].into_iter().chain(others).flat_map(NumberMap::values_mut) {
            if object.copy.is_some() {
                self.card.copy(object);
            }
        }
    }

    /// The buffer object that is bound to a target.
    pub fn bound_buffer(&self, target: u32) -> Outcome<u32> {
        Ok(match target {
            e::ARRAY_BUFFER => self.arrays.bound[0],
            e::ELEMENT_ARRAY_BUFFER => self.arrays.bound[1],
            e::PIXEL_UNPACK_BUFFER => self.unpack.buffer,
            e::PIXEL_PACK_BUFFER => self.pack_buffer,
            other if OTHER_TARGETS.contains(&other) => self.other_buffers.get(other).copied().unwrap_or(0),
            _ => return Err(INVALID_ENUM),
        })
    }

    /// The bytes that uniform blocks of a binding read; none if nothing is bound.
    pub fn uniform_bytes(&self, binding: u32) -> Outcome<&[u8]> {
        let Some(range) = self.uniform_buffers.get(binding) else { return Ok(&[]) };
        let Some(object) = self.buffers.get(range.buffer) else {
            return if range.buffer == GONE { Err(missing(GONE, INVALID_OPERATION)) } else { Ok(&[]) };
        };
        let bytes = object.bytes.get(range.offset..).unwrap_or(&[]);
        Ok(range.size.and_then(|size| bytes.get(..size)).unwrap_or(bytes))
    }
}
