//! Buffer objects, and their copies on the card.

use std::cell::RefCell;
use std::ops::Range;
use std::rc::Rc;

use num::{BufferId, NumberMap};

use crate::gl::call::{Fault, GlResult, INVALID_VALUE, Scalar};
use crate::gl::card::device::{Card, ON_CARD_MAX};
use crate::gl::elements::Element;

/// Separate ranges that the card lacks at most; more are joined.
const RANGES_MAX: usize = 32;
/// Conversions of a buffer object's contents that are remembered at most.
const CONVERSIONS_MAX: usize = 256;
/// Maximum number of mapped buffers.
pub const MAPPINGS_MAX: usize = 1 << 16;
/// A flag of storage that is written by `glBufferSubData`.
const DYNAMIC_STORAGE: u32 = 0x100;
pub const UNIFORM_BUFFER: u32 = 0x8a11;
/// Targets to which a buffer object may be bound to change it: texture, transform feedback, uniform, copy read and write, draw and dispatch
/// indirect, shader storage, query and atomic counter buffers. What else they serve for is refused where it is used.
pub const OTHER_TARGETS: [u32; 10] = [0x8c2a, 0x8c8e, UNIFORM_BUFFER, 0x8f36, 0x8f37, BUFFER, 0x90ee, 0x90d2, 0x9192, 0x92c0];
/// Maximum number of a binding of uniform blocks.
pub const BINDING_MAX: u32 = 1 << 10;
/// Maximum number of times that a vertex array object is searched for a deleted buffer object.
pub const LOOKS_MAX: u64 = 1 << 26;
/// `GL_DRAW_INDIRECT_BUFFER`.
pub const BUFFER: u32 = 0x8f3f;

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
    pub fn new(bytes: Rc<[u8]>) -> BufferObject {
        let mut object = BufferObject { bytes, ..BufferObject::default() };
        object.changed(0..object.size());
        object
    }

    /// A buffer object without contents: the program gives them later.
    pub fn without_contents(size: usize) -> BufferObject {
        BufferObject { bytes: vec![0; size].into(), ..BufferObject::default() }
    }

    /// Fixes its size; the flags say what may change its contents (`glBufferStorage`).
    pub fn fix_size(&mut self, flags: u32) {
        self.storage = Some(flags);
    }

    /// Whether its size is fixed.
    pub fn has_fixed_size(&self) -> bool {
        self.storage.is_some()
    }

    /// Whether `glBufferSubData` may not change its contents.
    pub fn refuses_data(&self) -> bool {
        self.storage.is_some_and(|flags| flags & DYNAMIC_STORAGE == 0)
    }

    /// Notes that pixels are read back into it.
    pub fn note_read_back(&mut self) {
        self.read_back = true;
    }

    /// Its contents. Pixels that were read back into it are missing.
    pub fn contents(&self) -> &[u8] {
        &self.bytes
    }

    /// Whether the card has a copy.
    pub fn is_on_card(&self) -> bool {
        self.copy.is_some()
    }

    /// Its contents.
    ///
    /// # Errors
    /// If these are pixels that were read back: a recording does not have them.
    pub fn bytes(&self) -> GlResult<&Rc<[u8]>> {
        if self.read_back {
            return Err(Fault::Unsupported("reading of a buffer object into which pixels were read back".into()));
        }
        Ok(&self.bytes)
    }

    /// Its size in bytes.
    pub fn size(&self) -> u64 {
        self.bytes.len() as u64
    }

    /// Writes bytes at an offset.
    pub fn write(&mut self, at: usize, bytes: &[u8], card: &mut Card) -> GlResult {
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
    /// The buffer object.
    pub buffer: u32,
    /// Its target.
    pub target: u32,
    /// The address of its first mapped byte in the recorded program.
    pub address: u64,
    /// Number of mapped bytes, from `offset` on.
    pub length: u64,
    /// The first byte of the buffer object that is mapped.
    pub offset: u64,
}

/// The part of a buffer object that a uniform block reads.
#[derive(Clone, Debug)]
pub struct UniformRange {
    pub buffer: u32,
    /// Its first byte that is read.
    pub offset: usize,
    /// Bytes; none: up to its end.
    pub size: Option<usize>,
}

impl UniformRange {
    /// The name of the buffer object.
    pub fn buffer(&mut self) -> &mut u32 {
        &mut self.buffer
    }
}

/// The buffer objects that are bound to targets beside those of arrays and of pixels that are read.
#[derive(Default)]
pub struct BufferBindings {
    /// Those that uniform blocks read, by binding.
    pub uniform: NumberMap<u32, UniformRange>,
    /// Those of targets that no draw reads.
    pub other: NumberMap<u32, u32>,
    /// The one that pixels are read back into.
    pub pack: u32,
}

/// Names that buffer objects get when they are deleted while vertex array objects have them.
#[derive(Default)]
pub struct Renames {
    /// Number of names given.
    pub given: u32,
    /// How often a vertex array object has been searched for a deleted buffer object.
    pub searches: u64,
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
    pub fn keeps_conversion(&self, object: &BufferObject, conversion: Conversion, [count, least, bytes]: [u64; 3]) -> bool {
        let mut all = object.converted.borrow_mut();
        let known = match all.iter_mut().position(|known| known.conversion == conversion) {
            Some(at) => &mut all[at],
            None if all.len() < CONVERSIONS_MAX => all.push_mut(Converted { conversion, drawn: 0, copy: None }),
            None => return false,
        };
        known.drawn = known.drawn.saturating_add(count);
        known.copy.is_some() || known.drawn >= least && self.on_card_bytes.saturating_add(bytes) <= ON_CARD_MAX
    }

    /// The copy of a conversion that [`Card::keeps_conversion`]; made once.
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
        self.on_card_bytes += bytes.len() as u64;
        // The trace keeps them even if the card does not.
        self.bytes += bytes.len() as u64;
        known.copy = Some((copy, bytes.len() as u64));
        Some(copy)
    }

    /// Puts a buffer object in the place of another one. The card's copy is written again if all its bytes are given anew.
    pub fn replace_buffer(&mut self, mut old: BufferObject, new: BufferObject) -> BufferObject {
        self.free_converted(&mut old);
        if old.size() == new.size() && new.lacks_all() {
            return BufferObject { copy: old.copy, ..new };
        }
        self.free_copy(old);
        new
    }

    /// Frees the conversions of a buffer object that changes.
    fn free_converted(&mut self, object: &mut BufferObject) {
        for (copy, bytes) in object.converted.get_mut().drain(..).filter_map(|known| known.copy) {
            self.on_card_bytes -= bytes;
            self.condemn(copy, bytes);
        }
    }

    /// Frees the copy of a buffer object.
    pub fn free_copy(&mut self, mut object: BufferObject) {
        self.free_converted(&mut object);
        if let Some(copy) = object.copy {
            self.condemn(copy, object.size());
        }
    }
}

/// All whole elements of an array as floats.
pub fn float_elements(conversion: Conversion, bytes: &[u8]) -> Vec<u8> {
    let Conversion::Elements { element, normalized, stride, start } = conversion else { return Vec::new() };
    let mut out = Vec::new();
    let mut at = start;
    while let Some(of) = bytes.get(at..at.saturating_add(element.bytes())) {
        let (plain, scaled) = element.components(of);
        for value in &(if normalized { scaled } else { plain })[..element.size] {
            out.extend_from_slice(&value.to_le_bytes());
        }
        at = at.saturating_add(stride);
    }
    out
}
