//! Where the vertices of a draw from buffer objects are.

use std::ops::Range;

use gfx::state::*;
use gl_shader::wgsl::location;

use crate::gl::call::Scalar;
use crate::gl::geometry::pack::{STREAMS_MAX, float_format};
use crate::gl::geometry::summary::Summary;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::state::arrays::{ArrayView, GENERIC};
use crate::gl::state::buffers::Conversion;

/// Maximum number of bytes between two vertices that the card reads.
const STRIDE_MAX: u64 = 1 << 16;

/// A draw from buffer objects.
pub struct Resident {
    /// The values of attributes that are the same for all vertices.
    pub constant: Vertex,
    /// What its arrays may hold.
    pub summary: Summary,
    /// Number of indices, or of vertices.
    pub count: u32,
    /// The attributes that its arrays hold.
    pub attributes: Vec<Attribute>,
    /// How its vertices are selected.
    pub indices: Indices,
    /// The vertices that it may read.
    pub vertices: Range<u64>,
}

/// An attribute in a buffer object.
#[derive(Clone, Copy, Debug)]
pub struct Attribute {
    location: u32,
    format: VertexFormat,
    /// The name of the buffer object.
    pub buffer: u32,
    /// What the card reads in its place, if it does not have the format of its elements.
    pub converted: Option<Conversion>,
    /// Size of the buffer.
    pub size: u64,
    /// Where the attribute of the first vertex is.
    pub offset: u64,
    /// Bytes from one vertex to the next.
    pub stride: u64,
}

impl Attribute {
    /// The attribute of an array at a location.
    fn new(location: u32, array: &ArrayView, buffer: u32) -> Attribute {
        let (offset, stride, size) = (array.start as u64, array.stride as u64, array.data.len() as u64);
        let fits = |format: &VertexFormat| (u64::from(format.bytes())..=STRIDE_MAX).contains(&stride);
        if let Some(format) = format_of(array).filter(fits) {
            return Attribute { location, format, buffer, converted: None, size, offset, stride };
        }
        let format = float_format(array.element.size);
        let (start, before) = (array.start % array.stride, array.start / array.stride);
        let room = array.data.len().checked_sub(start + array.element.bytes());
        let elements = room.map_or(0, |room| room as u64 / stride + 1);
        let (element, normalized, bytes) = (array.element, is_normalized(array), u64::from(format.bytes()));
        let converted = Conversion::Elements { element, normalized, stride: array.stride, start };
        let (size, offset) = (elements * bytes, (before as u64).saturating_mul(bytes));
        Attribute { location, format, buffer, converted: Some(converted), size, offset, stride: bytes }
    }

    /// Where its first element is.
    pub fn bytes(&self) -> Range<u64> {
        self.offset..self.offset.saturating_add(u64::from(self.format.bytes()))
    }
}

/// The indices of a draw.
pub enum Indices {
    /// None: consecutive vertices, from this one on.
    None(u32),
    /// Made by the import. The card may keep them as a conversion of a buffer object.
    Made(Vec<u32>, Option<(u32, Conversion)>),
    /// In a buffer object.
    Buffer { name: u32, at: u64, format: IndexFormat, base: i32 },
}

/// Attributes that one vertex buffer has.
pub struct VertexStream {
    /// The name of the buffer object.
    pub buffer: u32,
    /// The conversion of its contents that is read in its place.
    pub converted: Option<Conversion>,
    /// Bytes from one vertex to the next.
    pub stride: u64,
    /// The bytes of the first vertex.
    pub bytes: Range<u64>,
    attributes: Vec<Attribute>,
}

/// Where the attributes of a draw are.
pub struct VertexStreams {
    /// Layouts of the vertex buffers.
    pub layouts: Vec<VertexBufferLayout>,
    /// What each of them holds.
    pub groups: Vec<VertexStream>,
}

impl VertexStreams {
    /// Attributes of interleaved arrays share a vertex buffer.
    fn new(attributes: impl Iterator<Item = Attribute>) -> VertexStreams {
        let mut groups: Vec<VertexStream> = Vec::new();
        for attribute in attributes {
            let Attribute { buffer, converted, stride, .. } = attribute;
            let joined = |group: &VertexStream| {
                let bytes = attribute.bytes();
                group.bytes.start.min(bytes.start)..group.bytes.end.max(bytes.end)
            };
            let fits = |group: &&mut VertexStream| {
                let bytes = joined(group);
                let same = (group.buffer, group.converted, group.stride) == (buffer, None, stride);
                same && converted.is_none() && bytes.end - bytes.start <= stride
            };
            match groups.iter_mut().find(fits) {
                Some(group) => {
                    group.bytes = joined(group);
                    group.attributes.push(attribute);
                }
                None => {
                    let bytes = attribute.bytes();
                    groups.push(VertexStream { buffer, converted, stride, bytes, attributes: vec![attribute] });
                }
            }
        }
        let layout = |group: &VertexStream| {
            let place = |of: &Attribute| VertexAttribute {
                format: of.format,
                offset: of.offset - group.bytes.start,
                location: of.location,
            };
            let attributes = group.attributes.iter().map(place).collect();
            VertexBufferLayout { stride: group.stride, step: StepMode::Vertex, attributes }
        };
        VertexStreams { layouts: groups.iter().map(layout).collect(), groups }
    }
}

/// The location of the attribute of a slot; none for edge flags.
fn location_of(slot: usize) -> Option<u32> {
    Some(match slot {
        0 | GENERIC => location::POSITION,
        1 => location::NORMAL,
        2 => location::COLOR,
        3 => location::SECONDARY,
        4 => location::FOG,
        5..8 => return None,
        8..GENERIC => location::TEXTURE + (slot - 8) as u32,
        _ => location::GENERIC + (slot - GENERIC) as u32,
    })
}

/// Whether integers of an array are normalised.
fn is_normalized(array: &ArrayView) -> bool {
    matches!(array.slot, 1..=3) || array.slot >= GENERIC && array.normalized
}

/// The format in which the card reads the elements of an array, if it has one.
fn format_of(array: &ArrayView) -> Option<VertexFormat> {
    use VertexFormat::*;
    let normalized = is_normalized(array);
    let formats = match array.element.scalar {
        Scalar::Ubyte if array.element.blue_first => [None, None, None, Some(Unorm8x4Bgra)],
        _ if array.element.blue_first => [None; 4],
        Scalar::Half => [Some(Float16), Some(Float16x2), None, Some(Float16x4)],
        Scalar::Float => [Some(Float32), Some(Float32x2), Some(Float32x3), Some(Float32x4)],
        Scalar::Double => [Some(Float64), Some(Float64x2), Some(Float64x3), Some(Float64x4)],
        Scalar::Ubyte if normalized => [Some(Unorm8), Some(Unorm8x2), None, Some(Unorm8x4)],
        Scalar::Ushort if normalized => [Some(Unorm16), Some(Unorm16x2), None, Some(Unorm16x4)],
        // The card gives shaders integers as integers, and its signed normalised numbers have a zero, which OpenGL's of that time have not.
        _ => [None; 4],
    };
    formats[array.element.size - 1]
}

impl Resident {
    /// Where the attributes with these locations are.
    pub fn streams(&self, attributes: &[(u32, VertexFormat)]) -> VertexStreams {
        let find = |&(location, _): &(u32, VertexFormat)| self.attributes.iter().find(|of| of.location == location).copied();
        VertexStreams::new(attributes.iter().filter_map(find))
    }

    /// The attributes of arrays, if all are in buffer objects, and positions among them.
    pub fn attributes(ready: &[ArrayView]) -> Option<(Vec<Attribute>, Attribute)> {
        let mut attributes: Vec<Attribute> = Vec::new();
        for array in ready {
            let (Some(location), buffer) = (location_of(array.slot), array.buffer?) else { continue };
            if location == location::POSITION {
                // The generic attribute 0 takes the place of positions.
                attributes.retain(|of| of.location != location);
            }
            if array.instance.is_some() {
                continue;
            }
            attributes.push(Attribute::new(location, array, buffer));
        }
        let positions = *attributes.iter().find(|of| of.location == location::POSITION)?;
        let groups = VertexStreams::new(attributes.iter().copied()).groups.len();
        (groups <= STREAMS_MAX).then_some((attributes, positions))
    }
}
