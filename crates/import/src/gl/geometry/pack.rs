//! Vertices of a batch as the card reads them: only the attributes that differ between vertices; wide points and lines become triangles.

use gfx::state::{VertexBufferLayout, VertexFormat};
use gl_shader::arb::program::GENERICS;
use gl_shader::expand::far_locations;
use gl_shader::key::{Expand, ShaderKey};
use gl_shader::wgsl::location;
use gl_shader::{UNITS, wgsl};
use glam::Mat4;
use trace::record::vertex_buffer;

use crate::gl::geometry::clip::{between, visible};
use crate::gl::geometry::primitive::{Class, SentAttributes};
use crate::gl::geometry::summary::Summary;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::matrix;

/// Corners of an expanded point or line, and the triangles between them.
const CORNERS: [[f32; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
const QUAD: [u32; 6] = [0, 1, 2, 0, 2, 3];
/// The triangles of a smooth line. Its coverage is interpolated with perspective, so the choice of the diagonal is visible: it is Mesa's.
const SMOOTH_QUAD: [u32; 6] = [0, 1, 3, 1, 2, 3];
/// Alignment of attribute arrays in bytes. ATTILA's counts of cache lines show that its arrays begin at cache lines.
pub const STREAM_ALIGN: usize = 256;
/// Maximum number of vertex buffers of a draw.
pub const STREAMS_MAX: usize = 8;

/// The format of a number of floats.
pub fn float_format(components: usize) -> VertexFormat {
    [VertexFormat::Float32, VertexFormat::Float32x2, VertexFormat::Float32x3, VertexFormat::Float32x4][components - 1]
}

/// An attribute: its location, its components, and where it is in a vertex.
type Attribute = (u32, usize, fn(&Vertex, u32) -> [f32; 4]);

/// Attributes of a key: location, components, and where they are in a vertex.
fn layout(key: &ShaderKey, summary: &Summary, sent: Option<SentAttributes>) -> Vec<Attribute> {
    let mut list: Vec<Attribute> = Vec::new();
    let least = |slot: usize| sent.map_or(2, |sent| sent.least(slot));
    let has = |slot: usize| sent.is_some_and(|sent| sent.has(slot));
    list.push((location::POSITION, usize::from(summary.position).max(least(0)), |v, _| v.position));
    if key.varying.color || has(2) {
        let opaque = sent.is_none() && summary.opaque;
        list.push((location::COLOR, if opaque { 3 } else { 4 }, |v, _| v.color));
    }
    if key.varying.normal || has(1) {
        list.push((location::NORMAL, 3, |v, _| [v.normal[0], v.normal[1], v.normal[2], 0.0]));
    }
    if key.varying.secondary || has(3) {
        list.push((location::SECONDARY, 3, |v, _| [v.secondary[0], v.secondary[1], v.secondary[2], 0.0]));
    }
    if key.varying.fog || has(4) {
        list.push((location::FOG, 1, |v, _| [v.fog; 4]));
    }
    if key.offset {
        list.push((location::OFFSET, 1, |v, _| [v.offset; 4]));
    }
    for unit in (0..UNITS).filter(|&unit| wgsl::reads_coordinates(key, unit) || has(8 + unit)) {
        let count = usize::from(summary.texture[unit]).max(least(8 + unit));
        list.push((location::TEXTURE + unit as u32, count, |v, at| v.texture((at - location::TEXTURE) as usize)));
    }
    for k in (0..GENERICS).filter(|&k| key.varying.generic & 1 << k != 0 || (k > 0 && has(16 + k))) {
        let count = usize::from(summary.generic[k]).max(least(16 + k));
        list.push((location::GENERIC + k as u32, count, |v, at| v.generic((at - location::GENERIC) as usize)));
    }
    list
}

/// The offsets of attribute arrays that follow each other, each with this number of vertices.
pub fn streams(attributes: &[(u32, VertexFormat)], vertices: usize) -> Vec<u64> {
    let mut end = 0;
    let place = |&(_, format): &(u32, VertexFormat)| {
        let start = usize::next_multiple_of(end, STREAM_ALIGN);
        end = start + vertices * format.bytes() as usize;
        start as u64
    };
    attributes.iter().map(place).collect()
}

/// The layout of a draw's vertices in its buffer.
pub struct Packing {
    /// Attributes: location and format.
    pub attributes: Vec<(u32, VertexFormat)>,
    layout: Vec<Attribute>,
    expand: Expand,
    class: Class,
    /// Whether each corner of a line has the attributes of both ends.
    both_ends: bool,
    /// Whether each attribute has an array of its own.
    pub streams: bool,
}

/// Appends an attribute of a vertex.
fn append(vertex: &Vertex, &(location, count, get): &Attribute, bytes: &mut Vec<u8>) {
    let value = get(vertex, location);
    let [a, b, c, d] = value.map(f32::to_le_bytes);
    let all = [a, b, c, d];
    bytes.extend_from_slice(all[..count].as_flattened());
}

impl Packing {
    /// The layout for draws with this key, whose vertices have this summary.
    pub fn new(key: &ShaderKey, summary: &Summary, class: Class, sent: Option<SentAttributes>) -> Packing {
        let both_ends = key.both_ends();
        let layout = layout(key, summary, if both_ends { None } else { sent });
        let mut attributes: Vec<(u32, VertexFormat)> = layout.iter().map(|&(at, count, _)| (at, float_format(count))).collect();
        if key.expand != Expand::No {
            attributes.push((location::CORNER, VertexFormat::Float32x2));
            if class == Class::Lines {
                attributes.push((location::OTHER, VertexFormat::Float32x4));
            }
        }
        if both_ends {
            let own = layout.iter().filter(|of| of.0 != location::POSITION);
            attributes.extend(own.zip(far_locations(key)).map(|(&(_, count, _), at)| (at, float_format(count))));
        }
        let streams = key.expand == Expand::No && sent.is_some() && layout.len() <= STREAMS_MAX;
        Packing { attributes, layout, expand: key.expand, class, both_ends, streams }
    }

    /// Layouts of its vertex buffers.
    pub fn buffers(&self) -> Vec<VertexBufferLayout> {
        let each = if self.streams { 1 } else { self.attributes.len().max(1) };
        self.attributes.chunks(each).filter_map(vertex_buffer).collect()
    }

    /// Whether the written vertices depend on the matrix: lines are clipped.
    pub fn cuts(&self) -> bool {
        self.expand != Expand::No && self.class == Class::Lines && !self.both_ends
    }

    /// Whether another draw's vertices have the same layout.
    pub fn is_like(&self, other: &Packing) -> bool {
        self.attributes == other.attributes && self.expand == other.expand
    }

    /// Appends vertices as the card reads them: interleaved, or as one array for each attribute if `streams` is set. Indices count from the
    /// first of them. `clip` (the matrix to clip space) and `flat` (whether shading is flat) serve to clip lines that become triangles.
    pub fn write(&self, of: DrawInput<'_>, clip: &Mat4, flat: bool, bytes: &mut Vec<u8>, indices: &mut Vec<u32>) {
        if self.expand != Expand::No {
            return self.expand(of, clip, flat, bytes, indices);
        }
        indices.extend_from_slice(of.indices);
        let components: usize = self.layout.iter().map(|&(_, count, _)| count).sum();
        bytes.reserve(4 * components * of.vertices.len());
        if self.streams {
            let start = bytes.len();
            for &(location, count, get) in &self.layout {
                bytes.resize(start + (bytes.len() - start).next_multiple_of(STREAM_ALIGN), 0);
                for vertex in of.vertices {
                    for value in &get(vertex, location)[..count] {
                        bytes.extend_from_slice(&value.to_le_bytes());
                    }
                }
            }
            return;
        }
        for vertex in of.vertices {
            self.vertex(vertex, bytes);
        }
    }

    /// Appends the attributes of a vertex.
    fn vertex(&self, vertex: &Vertex, bytes: &mut Vec<u8>) {
        for attribute in &self.layout {
            append(vertex, attribute, bytes);
        }
    }

    /// Points and lines as two triangles each. Lines are clipped to the view volume: they end where their middle leaves it.
    fn expand(&self, of: DrawInput<'_>, clip: &Mat4, flat: bool, bytes: &mut Vec<u8>, indices: &mut Vec<u32>) {
        let smooth = self.expand == Expand::SmoothLine;
        let mut count = 0;
        let mut quad = |bytes: &mut Vec<u8>, corners: [(&Vertex, Option<&Vertex>); 4]| {
            for (corner, (this, other)) in CORNERS.into_iter().zip(corners) {
                self.vertex(this, bytes);
                for value in corner.iter().chain(other.map_or(&[][..], |other| &other.position)) {
                    bytes.extend_from_slice(&value.to_le_bytes());
                }
                for attribute in self.layout.iter().filter(|of| self.both_ends && of.0 != location::POSITION) {
                    append(other.unwrap_or(this), attribute, bytes);
                }
            }
            indices.extend(if smooth { SMOOTH_QUAD } else { QUAD }.map(|k| count + k));
            count += 4;
        };
        if self.class != Class::Lines {
            for &index in of.indices {
                quad(bytes, [(&of.vertices[index as usize], None); 4]);
            }
            return;
        }
        for line in of.indices.chunks_exact(2) {
            let mut ends = [0, 1].map(|k| of.vertices[line[k] as usize].clone());
            // Where a program computes positions, the shader cuts.
            if self.both_ends || cut(&mut ends, clip, flat) {
                let [a, b] = &ends;
                // The first two corners are at the first end.
                quad(bytes, [(a, Some(b)), (a, Some(b)), (b, Some(a)), (b, Some(a))]);
            }
        }
    }
}

/// Primitives of one draw.
#[derive(Clone, Copy)]
pub struct DrawInput<'a> {
    /// Vertices.
    pub vertices: &'a [Vertex],
    /// Indices of points, lines or triangles.
    pub indices: &'a [u32],
}

/// Clips a line to the view volume; returns whether anything is left.
fn cut(ends: &mut [Vertex], clip: &Mat4, flat: bool) -> bool {
    if flat {
        ends[0].color = ends[1].color;
        ends[0].normal = ends[1].normal;
    }
    let [a, b] = [0, 1].map(|k| matrix::transform(clip, ends[k].position));
    let Some([from, to]) = visible(a, b) else { return false };
    let both = [ends[0].clone(), ends[1].clone()];
    (ends[0], ends[1]) = (between(&both, from), between(&both, to));
    true
}
