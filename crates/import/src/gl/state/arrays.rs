//! Client arrays, generic attributes and vertex array objects.

use std::rc::Rc;

use gl_shader::UNITS;
use gl_shader::arb::program::GENERICS;
use num::NumberMap;

use crate::gl::elements::Element;
use crate::gl::state::bindings::lose;
use crate::gl::state::restart::Restart;

/// Slots of arrays: position, normal, colour, secondary colour, fog coordinate, edge flag, texture coordinates from 8 on, generic attributes
/// from 16 on. The bits are those of [`Vertex::over`].
const SLOTS: usize = GENERIC + GENERICS;

/// The slot of the first generic attribute.
pub const GENERIC: usize = 8 + UNITS;

/// Where the elements of an array are.
#[derive(Clone, Debug, Default)]
pub enum Source {
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
    pub enabled: bool,
    pub size: usize,
    pub kind: u32,
    pub stride: usize,
    pub source: Source,
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
    pub slots: [Array; SLOTS],
    /// The active client texture unit.
    pub active: usize,
    /// Indices that end primitives.
    pub restart: Restart,
    /// The bound buffers: of arrays, of indices.
    pub bound: [u32; 2],
    /// The bound vertex array object; 0: the default one.
    pub object: u32,
    /// The state of the others: slots and the buffer of indices.
    pub objects: NumberMap<u32, (Box<[Array; SLOTS]>, u32)>,
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
                .filter_map(|array| if let Source::Buffer(name, _) = &mut array.source { Some(name) } else { None });
            for name in arrays.chain([indices]).filter(|name| **name == from) {
                (*name, found) = (to, true);
            }
        }
        found
    }

    /// Enables or disables an array.
    pub fn switch(&mut self, slot: usize, enabled: bool) {
        self.slots[slot].enabled = enabled;
    }

    /// Marks bindings to a buffer object that another context deletes.
    pub fn lose_buffer(&mut self, name: u32) {
        let objects = self.objects.values_mut().map(|(slots, indices)| (&mut **slots, indices));
        let [_, indices] = &mut self.bound;
        for (slots, indices) in objects.chain([(&mut self.slots, indices)]) {
            let names = slots.iter_mut().filter_map(|array| match &mut array.source {
                Source::Buffer(name, _) => Some(name),
                _ => None,
            });
            lose(names.chain([indices]), name);
        }
        lose(&mut self.bound[..1], name);
    }
}

/// An enabled array that is ready to be read.
pub struct Ready {
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
