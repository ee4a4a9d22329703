//! Vertices of client arrays.

use crate::gl::call::{Fault, GlResult, INVALID_OPERATION};
use crate::gl::elements::{Element, scalar};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::names;
use crate::gl::state::arrays::{ArrayData, ArrayView, GENERIC};
use crate::gl::state::bindings::missing;

/// Data beyond the end of a buffer object, as wide as the widest element.
const ZEROS: [u8; 32] = [0; 32];

impl Gl {
    /// Enabled arrays, and a bit for each.
    pub fn array_views(&self) -> GlResult<(Vec<ArrayView>, u32)> {
        let mut ready = Vec::new();
        let mut bits = 0;
        for (slot, array) in self.context.arrays.enabled() {
            let refused = || Fault::Unsupported(format!("vertex arrays of type {}", names::name(array.kind)));
            if array.whole {
                return Err(Fault::Unsupported("vertex arrays of whole numbers (glVertexAttribIPointer)".into()));
            }
            let (scalar, _) = scalar(array.kind).ok_or_else(refused)?;
            let element = Element { scalar, size: array.size, blue_first: array.blue_first };
            let (data, start, buffer) = match &array.source {
                ArrayData::None => return Err(Fault::Damaged("an enabled array has no contents".into())),
                ArrayData::Memory(bytes) => (bytes.clone(), 0, None),
                ArrayData::Buffer(name, at) => {
                    let object = self.objects.buffers.get(*name).ok_or_else(|| missing(*name, INVALID_OPERATION))?;
                    (object.bytes()?.clone(), *at as usize, Some(*name))
                }
            };
            let stride = if array.stride == 0 { element.bytes() } else { array.stride };
            let normalized = array.normalized;
            let instance = array.divisor.checked_sub(1).map(|_| self.drawing.instance / array.divisor);
            ready.push(ArrayView { slot, element, normalized, stride, start, data, buffer, instance });
            bits |= 1 << slot;
        }
        Ok((ready, bits))
    }

    /// The vertex of an index.
    pub fn fetch(&self, ready: &[ArrayView], index: u32) -> GlResult<Vertex> {
        let mut vertex = self.state.current.clone();
        for array in ready {
            let index = array.instance.unwrap_or(index);
            let at = (index as usize).saturating_mul(array.stride).saturating_add(array.start);
            let element = match array.data.get(at..at.saturating_add(array.element.bytes())) {
                Some(element) => element,
                // Some programs read beyond the end of their buffer objects; Mesa returns zeros.
                None if array.buffer.is_some() => &ZEROS[..array.element.bytes()],
                None if array.instance.is_some() => {
                    return Err(Fault::Unsupported(
                        "elements of instances in memory, of which the recorder gives too few".into(),
                    ));
                }
                None => {
                    return Err(Fault::Damaged(format!("vertex {index} is outside of an array's {} bytes", array.data.len())));
                }
            };
            let (plain, normalized) = array.element.components(element);
            match array.slot {
                0 => vertex.position = plain,
                1 => vertex.normal = [normalized[0], normalized[1], normalized[2]],
                2 => vertex.color = normalized,
                3 => vertex.secondary = [normalized[0], normalized[1], normalized[2]],
                4 => vertex.fog = plain[0],
                5 => vertex.edge = plain[0] != 0.0,
                GENERIC => vertex.position = if array.normalized { normalized } else { plain },
                slot if slot > GENERIC => vertex.set_generic(slot - GENERIC, if array.normalized { normalized } else { plain }),
                slot => vertex.set_texture(slot - 8, plain),
            }
        }
        Ok(vertex)
    }
}
