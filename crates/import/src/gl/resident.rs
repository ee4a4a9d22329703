//! Draws from buffer objects whose contents stay on the card. It reads the program's arrays with their own strides, offsets and formats, as a
//! real card does, so a buffer object that does not change is uploaded once.

use std::ops::Range;

use gfx::state::*;
use gl_shader::wgsl::location;
use num::word_bytes;

use super::arrays::{GENERIC, Ready};
use super::buffers::Conversion;
use super::call::{Outcome, Scalar};
use super::card::{Order, VertexRange};
use super::components::float_elements;
use super::consts as e;
use super::elements::{Selection, Selector};
use super::geometry::Geometry;
use super::machine::Gl;
use super::materials::tracked;
use super::pack::{STREAMS_MAX, float_format};
use super::primitive::{Batch, Class, Sent, class_of, points_and_lines, triangles};
use super::state::Vertex;
use super::summary::Summary;

/// Maximum number of bytes between two vertices that the card reads.
const STRIDE_MAX: u64 = 1 << 16;

/// Vertices on the card.
#[derive(Clone, Copy)]
pub enum Kept<'a> {
    /// A primitive of a display list.
    List(&'a Geometry),
    /// Arrays in buffer objects.
    Buffers(&'a Resident),
}

/// A draw from buffer objects.
pub struct Resident {
    /// The values of attributes that are the same for all vertices.
    pub constant: Vertex,
    /// What its arrays may hold.
    pub summary: Summary,
    /// Number of indices, or of vertices.
    pub count: u32,
    attributes: Vec<Attribute>,
    indices: Indices,
    /// The vertices that it may read.
    vertices: Range<u64>,
}

/// An attribute in a buffer object.
#[derive(Clone, Copy, Debug)]
struct Attribute {
    location: u32,
    format: VertexFormat,
    /// The name of the buffer object.
    buffer: u32,
    /// What the card reads in its place, if it does not have the format of its elements.
    converted: Option<Conversion>,
    /// Size of the buffer.
    size: u64,
    offset: u64,
    stride: u64,
}

impl Attribute {
    /// The attribute of an array at a location.
    fn new(location: u32, array: &Ready, buffer: u32) -> Attribute {
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
    fn bytes(&self) -> Range<u64> {
        self.offset..self.offset.saturating_add(u64::from(self.format.bytes()))
    }
}

enum Indices {
    /// None: consecutive vertices, from this one on.
    None(u32),
    /// Made by the import. The card may keep them as a conversion of a buffer object.
    Made(Vec<u32>, Option<(u32, Conversion)>),
    /// In a buffer object.
    Buffer { name: u32, at: u64, format: IndexFormat, base: i32 },
}

/// Attributes that one vertex buffer has.
struct Group {
    buffer: u32,
    converted: Option<Conversion>,
    stride: u64,
    bytes: Range<u64>,
    attributes: Vec<Attribute>,
}

/// Where the attributes of a draw are.
pub struct Placed {
    /// Layouts of the vertex buffers.
    pub layouts: Vec<VertexBufferLayout>,
    groups: Vec<Group>,
}

impl Placed {
    /// Attributes of interleaved arrays share a vertex buffer.
    fn new(attributes: impl Iterator<Item = Attribute>) -> Placed {
        let mut groups: Vec<Group> = Vec::new();
        for attribute in attributes {
            let Attribute { buffer, converted, stride, .. } = attribute;
            let joined = |group: &Group| {
                let bytes = attribute.bytes();
                group.bytes.start.min(bytes.start)..group.bytes.end.max(bytes.end)
            };
            let fits = |group: &&mut Group| {
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
                    groups.push(Group { buffer, converted, stride, bytes, attributes: vec![attribute] });
                }
            }
        }
        let layout = |group: &Group| {
            let place = |of: &Attribute| VertexAttribute {
                format: of.format,
                offset: of.offset - group.bytes.start,
                location: of.location,
            };
            let attributes = group.attributes.iter().map(place).collect();
            VertexBufferLayout { stride: group.stride, step: StepMode::Vertex, attributes }
        };
        Placed { layouts: groups.iter().map(layout).collect(), groups }
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
fn is_normalized(array: &Ready) -> bool {
    matches!(array.slot, 1..=3) || array.slot >= GENERIC && array.normalized
}

/// The format in which the card reads the elements of an array, if it has one.
fn format_of(array: &Ready) -> Option<VertexFormat> {
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
    pub fn placed(&self, attributes: &[(u32, VertexFormat)]) -> Placed {
        let find = |&(location, _): &(u32, VertexFormat)| self.attributes.iter().find(|of| of.location == location).copied();
        Placed::new(attributes.iter().filter_map(find))
    }

    /// The attributes of arrays, if all are in buffer objects, and positions among them.
    fn attributes(ready: &[Ready]) -> Option<(Vec<Attribute>, Attribute)> {
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
        let groups = Placed::new(attributes.iter().copied()).groups.len();
        (groups <= STREAMS_MAX).then_some((attributes, positions))
    }
}

/// The summary of vertices of these arrays; attributes without an array are those of `constant`.
fn summary_of(ready: &[Ready], constant: &Vertex) -> Summary {
    let mut summary = Summary::of(std::slice::from_ref(constant));
    // Components of arrays; only four of them hold a q.
    for array in ready.iter().filter(|array| array.instance.is_none()) {
        let (varying, size) = (&mut summary.varying, array.element.size.max(2) as u8);
        match array.slot {
            0 | GENERIC => summary.position = size,
            1 => varying.normal = true,
            2 => (varying.color, summary.opaque) = (true, size < 4),
            3 => varying.secondary = true,
            4 => varying.fog = true,
            5..8 => {}
            slot @ 8..GENERIC => (varying.texture[slot - 8], summary.texture[slot - 8]) = (true, size),
            slot => {
                varying.generic |= 1 << (slot - GENERIC);
                summary.generic[slot - GENERIC] = size;
            }
        }
    }
    summary
}

impl Gl {
    /// Draws vertices of arrays from the card's memory. False if it cannot read them from there; then nothing is drawn.
    pub(super) fn draw_resident(&mut self, mode: u32, ready: &[Ready], selection: &Selection) -> Outcome<bool> {
        let Some((resident, batch)) = self.resident(mode, ready, selection)? else { return Ok(false) };
        self.flush()?;
        let mut batch = batch;
        let outcome = self.draw(&mut batch, Some(Kept::Buffers(&resident)));
        self.settled(outcome)?;
        Ok(true)
    }

    /// A draw from the card's memory, if none of its vertices depends on the state and the card can read all.
    fn resident(&mut self, mode: u32, ready: &[Ready], selection: &Selection) -> Outcome<Option<(Resident, Batch)>> {
        let Some((class, topology, count)) = self.native(mode, selection.numbers.len() as u32) else { return Ok(None) };
        let state = &self.state;
        let other = self.survey || self.compiling.is_some() || self.render_mode != e::RENDER || state.is(e::COLOR_LOGIC_OP);
        if other || ready.iter().any(|array| array.buffer.is_none()) {
            return Ok(None);
        }
        // As a triangle strip, a quadrilateral strip has each pair of vertices exchanged.
        let turned = mode == e::QUAD_STRIP && topology.is_some();
        let numbers = &selection.numbers[..count as usize];
        let Some((attributes, positions)) = Resident::attributes(ready) else { return Ok(None) };
        let can_read = |name: u32| self.buffers.get(name).is_some_and(|object| self.card.can_read(object));
        let (Some(&first), Some(&last)) = (numbers.iter().min(), numbers.iter().max()) else { return Ok(None) };
        // Indices may select elements behind the end of a buffer object. The card reads zeros there, as Mesa does.
        let inside = |of: &Attribute| {
            let end = of.stride.checked_mul(u64::from(last)).and_then(|at| at.checked_add(of.bytes().end));
            end.is_some_and(|end| end <= of.size) || selection.by != Selector::Sequence && of.offset < of.size
        };
        let keeps = |name: u32, conversion: Conversion, costs: [u64; 3]| {
            self.buffers.get(name).is_some_and(|object| self.card.keeps(object, conversion, costs))
        };
        let on_card = |of: &Attribute| match of.converted {
            Some(conversion) => keeps(of.buffer, conversion, [u64::from(count), of.size / of.stride, of.size]),
            None => can_read(of.buffer),
        };
        if !attributes.iter().all(|of| inside(of) && on_card(of)) {
            return Ok(None);
        }
        let constant = self.fetch(ready, numbers[0])?;
        let summary = summary_of(ready, &constant);
        // Whether colours keep a material depends on whether they differ.
        let colored = state.is(e::LIGHTING) && summary.varying.color && tracked(state) != [0; 2];
        if colored && self.given.kept(constant.color) != [0; 2] {
            return Ok(None);
        }
        let native = match selection.by {
            _ if topology.is_none() || turned => None,
            Selector::Sequence => Some(Indices::None(first)),
            Selector::Buffer { name, at, kind, base } if can_read(name) => {
                let format = match kind {
                    Scalar::Ushort => Some(IndexFormat::Uint16),
                    Scalar::Uint => Some(IndexFormat::Uint32),
                    _ => None,
                };
                let format = format.filter(|format| at.is_multiple_of(format.bytes() as usize));
                format.map(|format| Indices::Buffer { name, at: at as u64, format, base })
            }
            _ => None,
        };
        let (indices, count) = match native {
            Some(native) => (native, count),
            None => {
                let diagonals = if mode == e::QUADS && topology.is_none() && self.begins_diagonals() {
                    let position = |&number: &u32| Ok(self.fetch(ready, number)?.position);
                    self.diagonals(&numbers.iter().map(position).collect::<Outcome<Vec<_>>>()?, summary.varying.color)
                } else {
                    Vec::new()
                };
                let begins = diagonals.first() == Some(&true);
                let alike = diagonals.iter().all(|&other| other == begins);
                let made: Vec<u32> = match (class, topology) {
                    (_, Some(_)) if turned => (0..count).map(|i| numbers[i as usize ^ 1]).collect(),
                    (_, Some(_)) => numbers.to_vec(),
                    (Class::Triangles, None) => {
                        let corners = triangles(mode, count, &diagonals);
                        corners.as_flattened().iter().map(|&corner| numbers[corner as usize]).collect()
                    }
                    (_, None) => points_and_lines(mode, count).into_iter().map(|k| numbers[k as usize]).collect(),
                };
                let (name, kind, at, base) = match selection.by {
                    Selector::Buffer { name, at, kind, base } => (name, Some(kind), at, base),
                    _ => (positions.buffer, None, first as usize, 0),
                };
                let list = topology.is_none();
                let conversion = Conversion::Indices { mode, list, begins, kind, at, base, count: numbers.len() };
                let n = made.len() as u64;
                let own = alike && (selection.by == Selector::Sequence || kind.is_some());
                let kept = own && keeps(name, conversion, [n, 2 * n, 4 * n]);
                (Indices::Made(made, kept.then_some((name, conversion))), n as u32)
            }
        };
        let slots = ready.iter().filter(|array| array.instance.is_none()).fold(0, |all, array| all | 1 << array.slot);
        let sent = self.keep_draws.then_some(Sent::Arrays { position: usize::from(summary.position), slots });
        let batch = Batch { class, topology, sent, turned, ..Batch::default() };
        let vertices = u64::from(first)..u64::from(last) + 1;
        Ok(Some((Resident { constant, summary, count, attributes, indices, vertices }, batch)))
    }

    /// How the card draws `n` vertices of a mode without a change to them: the type, the topology (none: a list of triangles with other
    /// indices), and the number of vertices.
    fn native(&mut self, mode: u32, n: u32) -> Option<(Class, Option<Topology>, u32)> {
        let class = class_of(mode);
        let plain = match class {
            Class::Points => {
                let apart = self.reaches_out();
                let state = &self.state;
                let one = state.point_size <= 1.0 && state.point_attenuation == [1.0, 0.0, 0.0] && !apart;
                one && !state.is(e::POINT_SMOOTH) && !state.is(e::POINT_SPRITE) && state.programs == 0 && !self.glsl.used()
            }
            Class::Lines => !self.widens_lines() && !self.line_stippled(),
            Class::Triangles => n >= 3 && self.fills() && !self.sides_differ(&Batch::default()),
        };
        if !plain {
            return None;
        }
        let (topology, count) = match mode {
            e::POINTS => (Some(Topology::PointList), n),
            e::LINES => (Some(Topology::LineList), n / 2 * 2),
            e::LINE_STRIP if n > 1 => (Some(Topology::LineStrip), n),
            e::LINE_LOOP if n > 1 => (None, n),
            _ if class == Class::Lines => return None,
            // Joined draws have these as triangles that begin with other vertices, which rounds otherwise.
            e::QUADS | e::QUAD_STRIP | e::POLYGON if !self.keep_draws => (None, n),
            _ => self.assembled(mode, n).map_or((None, n), |(topology, count)| (Some(topology), count)),
        };
        (count > 0).then_some((class, topology, count))
    }

    /// The vertex buffers of a draw. Uploads what the card lacks.
    pub(super) fn vertex_ranges(&mut self, resident: &Resident, placed: &Placed) -> Vec<VertexRange> {
        let mut ranges = Vec::with_capacity(placed.groups.len());
        for group in &placed.groups {
            let Some(object) = self.buffers.get_mut(group.buffer) else { continue };
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

    /// The order of a draw's vertices. Uploads the indices that the card lacks.
    pub(super) fn order(&mut self, resident: &Resident) -> Order {
        match &resident.indices {
            Indices::None(first) => Order::Sequence(*first),
            Indices::Made(made, kept) => {
                if let Some((name, conversion)) = *kept
                    && let Some(object) = self.buffers.get_mut(name)
                    && let Some(buffer) = self.card.converted(object, conversion, |_| word_bytes(made))
                {
                    return Order::Indices { buffer: Some(buffer), format: IndexFormat::Uint32, first: 0, base: 0 };
                }
                let pass = &mut self.card.pass;
                pass.indices.extend_from_slice(made);
                Order::pass((pass.indices.len() - made.len()) as u32)
            }
            &Indices::Buffer { name, at, format, base } => {
                let Some(object) = self.buffers.get_mut(name) else { return Order::Sequence(0) };
                let buffer = self.card.copy(object);
                let bytes = u64::from(format.bytes());
                self.card.pass.read(buffer, at..at + bytes * u64::from(resident.count));
                Order::Indices { buffer: Some(buffer), format, first: (at / bytes) as u32, base }
            }
        }
    }
}
