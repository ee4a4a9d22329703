//! The contents of buffer objects that draws read.

use gl_shader::consts as e;
use num::NumberMap;

use crate::gl::call::{GlResult, INVALID_ENUM, INVALID_OPERATION};
use crate::gl::machine::Gl;
use crate::gl::state::bindings::{GONE, missing};
use crate::gl::state::buffers::OTHER_TARGETS;

impl Gl {
    /// Uploads what the card's copies of buffer objects lack, so that the first wanted frame does not. No pass may be pending.
    pub fn upload_changes(&mut self) {
        let others = self.contexts.other_groups().map(|group| &mut group.buffers);
        for object in [&mut self.objects.buffers].into_iter().chain(others).flat_map(NumberMap::values_mut) {
            if object.is_on_card() {
                self.card.copy(object);
            }
        }
    }

    /// The buffer object that is bound to a target.
    pub fn bound_buffer(&self, target: u32) -> GlResult<u32> {
        Ok(match target {
            e::ARRAY_BUFFER => self.context.arrays.bound[0],
            e::ELEMENT_ARRAY_BUFFER => self.context.arrays.bound[1],
            e::PIXEL_UNPACK_BUFFER => self.context.unpack.buffer,
            e::PIXEL_PACK_BUFFER => self.context.buffers.pack,
            other if OTHER_TARGETS.contains(&other) => self.context.buffers.other.get(other).copied().unwrap_or(0),
            _ => return Err(INVALID_ENUM),
        })
    }

    /// The bytes that uniform blocks of a binding read; none if nothing is bound.
    pub fn uniform_bytes(&self, binding: u32) -> GlResult<&[u8]> {
        let Some(range) = self.context.buffers.uniform.get(binding) else { return Ok(&[]) };
        let Some(object) = self.objects.buffers.get(range.buffer) else {
            return if range.buffer == GONE { Err(missing(GONE, INVALID_OPERATION)) } else { Ok(&[]) };
        };
        let bytes = object.contents().get(range.offset..).unwrap_or(&[]);
        Ok(range.size.and_then(|size| bytes.get(..size)).unwrap_or(bytes))
    }
}
