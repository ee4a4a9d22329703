//! The buffers that a draw from buffer objects reads.

use std::ops::Range;

use gfx::state::*;
use num::word_bytes;

use crate::gl::card::pass::{Order, VertexRange};
use crate::gl::geometry::listed::Geometry;
use crate::gl::machine::Gl;
use crate::gl::state::buffers::float_elements;
use crate::gl::state::placement::{Indices, Resident, VertexStreams};

/// Vertices on the card.
#[derive(Clone, Copy)]
pub enum OnCard<'a> {
    /// A primitive of a display list.
    List(&'a Geometry),
    /// Arrays in buffer objects.
    Buffers(&'a Resident),
}

impl Gl {
    /// The order of a draw's vertices. Uploads the indices that the card lacks.
    pub fn order(&mut self, resident: &Resident) -> Order {
        match &resident.indices {
            Indices::None(first) => Order::Sequence(*first),
            Indices::Made(made, kept) => {
                if let Some((name, conversion)) = *kept
                    && let Some(object) = self.objects.buffers.get_mut(name)
                    && let Some(buffer) = self.card.converted(object, conversion, |_| word_bytes(made))
                {
                    return Order::Indices { buffer: Some(buffer), format: IndexFormat::Uint32, first: 0, base: 0 };
                }
                let pass = &mut self.card.pass;
                pass.indices.extend_from_slice(made);
                Order::pass((pass.indices.len() - made.len()) as u32)
            }
            &Indices::Buffer { name, at, format, base } => {
                let Some(object) = self.objects.buffers.get_mut(name) else { return Order::Sequence(0) };
                let buffer = self.card.copy(object);
                let bytes = u64::from(format.bytes());
                self.card.pass.read(buffer, at..at + bytes * u64::from(resident.count));
                Order::Indices { buffer: Some(buffer), format, first: (at / bytes) as u32, base }
            }
        }
    }

    /// The vertex buffers of a draw. Uploads what the card lacks.
    pub fn vertex_ranges(&mut self, resident: &Resident, streams: &VertexStreams) -> Vec<VertexRange> {
        let mut ranges = Vec::with_capacity(streams.groups.len());
        for group in &streams.groups {
            let Some(object) = self.objects.buffers.get_mut(group.buffer) else { continue };
            if let Some(conversion) = group.converted {
                let buffer = self.card.converted(object, conversion, |bytes| float_elements(conversion, bytes));
                ranges.push(VertexRange { buffer, offset: group.bytes.start });
                continue;
            }
            let buffer = self.card.copy(object);
            let at = |vertex: u64, from: u64| vertex.saturating_mul(group.stride).saturating_add(from);
            let Range { start, end } = resident.vertices;
            self.card.pass.read(buffer, at(start, group.bytes.start)..at(end - 1, group.bytes.end));
            ranges.push(VertexRange { buffer: Some(buffer), offset: group.bytes.start });
        }
        ranges
    }
}
