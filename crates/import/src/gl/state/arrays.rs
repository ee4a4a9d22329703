//! Client arrays, generic attributes and vertex array objects.

use std::rc::Rc;

use gl_shader::arb::program::GENERICS;
use gl_shader::{UNITS, consts as e};
use num::NumberMap;

use crate::gl::call::{Arg, Fault, GlResult, INVALID_ENUM, INVALID_VALUE};
use crate::gl::elements::Element;
use crate::gl::state::bindings::lose;
use crate::gl::state::restart::Restart;

/// Slots of arrays: position, normal, colour, secondary colour, fog coordinate, edge flag, texture coordinates from 8 on, generic attributes
/// from 16 on. The bits are those of [`crate::gl::geometry::vertex::Vertex::over`].
const SLOTS: usize = GENERIC + GENERICS;
/// The slot of the first generic attribute.
pub const GENERIC: usize = 8 + UNITS;
/// The slot of colour indices, which have no effect.
const INDEX: usize = 6;
/// The size of an array whose elements are colours with blue first.
pub const BLUE_FIRST: usize = e::BGRA as usize;
/// Maximum number of vertex array objects.
const OBJECTS_MAX: usize = 1 << 16;

/// Where the elements of an array are.
#[derive(Clone, Debug, Default)]
pub enum ArrayData {
    /// No memory.
    #[default]
    None,
    /// In the client's memory, as the recorder saw it.
    Memory(Rc<[u8]>),
    /// In a buffer object, from this byte on.
    Buffer(u32, u64),
}

/// One array.
#[derive(Clone, Debug, Default)]
pub struct Array {
    enabled: bool,
    /// Components of an element.
    pub size: usize,
    /// Their type.
    pub kind: u32,
    /// Bytes from one element to the next; 0: there is no gap.
    pub stride: usize,
    /// Where its elements are.
    pub source: ArrayData,
    /// Integers of a generic attribute are normalised.
    pub normalized: bool,
    /// Blue comes first (`GL_BGRA`).
    pub blue_first: bool,
    /// This number of instances share an element; 0: each vertex has its own.
    pub divisor: u32,
    /// Whether shaders get its integers as such.
    pub whole: bool,
}

/// All client arrays.
#[derive(Clone, Debug, Default)]
pub struct Arrays {
    slots: [Array; SLOTS],
    /// The active client texture unit.
    pub active: usize,
    /// Indices that end primitives.
    pub restart: Restart,
    /// The bound buffers: of arrays, of indices.
    pub bound: [u32; 2],
    /// The bound vertex array object; 0: the default one.
    object: u32,
    /// The state of the others: slots and the buffer of indices.
    objects: NumberMap<u32, (Box<[Array; SLOTS]>, u32)>,
}

impl Arrays {
    /// Number of vertex array objects that are not bound.
    pub fn objects(&self) -> usize {
        self.objects.len()
    }

    /// Gives a buffer object another name in the vertex array objects that are not bound; returns whether one of them has it.
    pub fn rename(&mut self, from: u32, to: u32) -> bool {
        let mut found = false;
        for (slots, indices) in self.objects.values_mut() {
            let arrays = slots
                .iter_mut()
                .filter_map(|array| if let ArrayData::Buffer(name, _) = &mut array.source { Some(name) } else { None });
            for name in arrays.chain([indices]).filter(|name| **name == from) {
                (*name, found) = (to, true);
            }
        }
        found
    }

    /// The slot of a client state.
    pub fn slot(&self, array: u32) -> GlResult<usize> {
        Ok(match array {
            e::VERTEX_ARRAY => 0,
            e::NORMAL_ARRAY => 1,
            e::COLOR_ARRAY => 2,
            e::SECONDARY_COLOR_ARRAY => 3,
            e::FOG_COORD_ARRAY => 4,
            e::EDGE_FLAG_ARRAY => 5,
            e::INDEX_ARRAY => INDEX,
            e::TEXTURE_COORD_ARRAY => 8 + self.active,
            _ => return Err(INVALID_ENUM),
        })
    }

    /// Enables or disables an array.
    pub fn switch(&mut self, slot: usize, enabled: bool) {
        self.slots[slot].enabled = enabled;
    }

    /// Sets an array: `size` components of a type, or colours with blue first. Its contents are those that were recorded, or those of the bound
    /// buffer object from an offset on.
    pub fn point(&mut self, slot: usize, size: usize, kind: u32, stride: i32, data: &Arg) -> GlResult {
        let stride = usize::try_from(stride).map_err(|_| INVALID_VALUE)?;
        let source = match (data, self.bound[0]) {
            (Arg::Blob(bytes), _) => ArrayData::Memory(bytes.clone()),
            // The recorder gives the contents right before the draw.
            (_, 0) => ArrayData::None,
            (Arg::Pointer(at), buffer) => ArrayData::Buffer(buffer, *at),
            (Arg::Num(at), buffer) => ArrayData::Buffer(buffer, *at as u64),
            (Arg::Null, buffer) => ArrayData::Buffer(buffer, 0),
            _ => ArrayData::None,
        };
        let Array { enabled, divisor, .. } = self.slots[slot];
        let (size, blue_first) = if size == BLUE_FIRST { (4, true) } else { (size, false) };
        self.slots[slot] = Array { enabled, size, kind, stride, source, normalized: false, blue_first, divisor, whole: false };
        Ok(())
    }

    /// Says that integers of a generic attribute are normalised.
    pub fn normalize(&mut self, slot: usize, normalized: bool) {
        self.slots[slot].normalized = normalized;
    }

    /// Says that shaders get the integers of an array as such.
    pub fn keep_integers(&mut self, slot: usize) {
        self.slots[slot].whole = true;
    }

    /// Sets the number of instances that share an element of an array.
    pub fn set_divisor(&mut self, slot: usize, divisor: u32) {
        self.slots[slot].divisor = divisor;
    }

    /// The enabled arrays with their slots, without that of colour indices.
    pub fn enabled(&self) -> impl Iterator<Item = (usize, &Array)> {
        self.slots.iter().enumerate().filter(|(slot, array)| array.enabled && *slot != INDEX)
    }

    /// Binds a vertex array object.
    pub fn bind(&mut self, name: u32) -> GlResult {
        if name == self.object {
            return Ok(());
        }
        if self.objects.len() >= OBJECTS_MAX {
            return Err(Fault::Limit(format!("more than {OBJECTS_MAX} vertex array objects")));
        }
        let (slots, indices) = self.objects.remove(name).unwrap_or_default();
        let old = (Box::new(std::mem::replace(&mut self.slots, *slots)), self.bound[1]);
        self.objects.insert(self.object, old);
        (self.bound[1], self.object) = (indices, name);
        Ok(())
    }

    /// Deletes a vertex array object; the default one takes its place if it is bound.
    pub fn delete(&mut self, name: u32) -> GlResult {
        if name == self.object {
            self.bind(0)?;
        }
        self.objects.remove(name);
        Ok(())
    }

    /// Marks bindings to a buffer object that another context deletes.
    pub fn lose_buffer(&mut self, name: u32) {
        let objects = self.objects.values_mut().map(|(slots, indices)| (&mut **slots, indices));
        let [_, indices] = &mut self.bound;
        for (slots, indices) in objects.chain([(&mut self.slots, indices)]) {
            let names = slots.iter_mut().filter_map(|array| match &mut array.source {
                ArrayData::Buffer(name, _) => Some(name),
                _ => None,
            });
            lose(names.chain([indices]), name);
        }
        lose(&mut self.bound[..1], name);
    }
}

/// An enabled array that is ready to be read.
pub struct ArrayView {
    /// Its slot.
    pub slot: usize,
    /// Its elements.
    pub element: Element,
    /// Whether integers of a generic attribute are normalised.
    pub normalized: bool,
    /// Bytes from one element to the next.
    pub stride: usize,
    /// Where the first element is, in bytes.
    pub start: usize,
    /// The bytes.
    pub data: Rc<[u8]>,
    /// The buffer object that it is in. Arrays in memory were recorded for their draw, so that all elements must be present.
    pub buffer: Option<u32>,
    /// The element for all vertices, if the array has one for each instance.
    pub instance: Option<u32>,
}
