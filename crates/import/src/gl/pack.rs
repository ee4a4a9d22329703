//! Vertices of a batch as the card reads them: only what differs between them, and points and lines as triangles where they are wide.

use gfx::state::VertexFormat;

use super::arb::GENERICS;
use super::key::{Expand, ShaderKey};
use super::matrix::{self, Matrix};
use super::primitive::{Batch, Class};
use super::state::{UNITS, Vertex};
use super::stipple::{VIEW_VOLUME, between, visible};
use super::wgsl::{self, location};

/// Corners of an expanded point or line, and the triangles between them.
const CORNERS: [[f32; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
const QUAD: [u32; 6] = [0, 1, 2, 0, 2, 3];
/// Those of a smooth line: its coverage is interpolated with perspective, so that the diagonal shows. It is Mesa's.
const SMOOTH_QUAD: [u32; 6] = [0, 1, 3, 1, 2, 3];

/// Where arrays of attributes may begin, in bytes. By ATTILA's counts of lines they begin at lines of its cache.
pub const STREAM_ALIGN: usize = 256;

/// Vertex buffers that a draw can have.
pub const STREAMS_MAX: usize = 8;

/// A packed batch: attributes, bytes, indices.
pub type Packed = (Vec<(u32, VertexFormat)>, Vec<u8>, Vec<u32>);

/// The components that are needed of an attribute whose missing ones are 0, 0, 1.
fn components(values: impl Iterator<Item = [f32; 4]>, least: usize) -> usize {
    values.fold(least, |most, [_, _, z, w]| {
        most.max(if w != 1.0 {
            4
        } else if z != 0.0 {
            3
        } else {
            2
        })
    })
}

fn float_format(components: usize) -> VertexFormat {
    [VertexFormat::Float32, VertexFormat::Float32x2, VertexFormat::Float32x3, VertexFormat::Float32x4][components - 1]
}

/// An attribute: its location, its components, and where it is in a vertex.
type Attribute = (u32, usize, fn(&Vertex, u32) -> [f32; 4]);

/// Attributes of a key: location, components, and where they are in a vertex.
fn layout(key: &ShaderKey, batch: &Batch) -> Vec<Attribute> {
    let (vertices, sent) = (&batch.vertices, batch.sent);
    let mut list: Vec<Attribute> = Vec::new();
    let least = |slot: usize| sent.map_or(2, |sent| sent.least(slot));
    let has = |slot: usize| sent.is_some_and(|sent| sent.has(slot));
    let position = components(vertices.iter().map(|vertex| vertex.position), least(0));
    list.push((location::POSITION, position, |v, _| v.position));
    if key.varying.color || has(2) {
        let opaque = sent.is_none() && vertices.iter().all(|vertex| vertex.color[3] == 1.0);
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
    if key.line_stipple {
        list.push((location::ALONG, 1, |v, _| [v.along; 4]));
    }
    for unit in (0..UNITS).filter(|&unit| wgsl::reads_coordinates(key, unit) || has(8 + unit)) {
        let count = components(vertices.iter().map(|vertex| vertex.texture(unit)), least(8 + unit));
        list.push((location::TEXTURE + unit as u32, count, |v, at| v.texture((at - location::TEXTURE) as usize)));
    }
    for k in (0..GENERICS).filter(|&k| key.varying.generic & 1 << k != 0 || (k > 0 && has(16 + k))) {
        let count = components(vertices.iter().map(|vertex| vertex.generic(k)), least(16 + k));
        list.push((location::GENERIC + k as u32, count, |v, at| v.generic((at - location::GENERIC) as usize)));
    }
    list
}

/// Where the arrays of attributes begin that lie one behind another, each for so many vertices.
pub fn streams(attributes: &[(u32, VertexFormat)], vertices: usize) -> Vec<u64> {
    let mut end = 0;
    let place = |&(_, format): &(u32, VertexFormat)| {
        let start = usize::next_multiple_of(end, STREAM_ALIGN);
        end = start + vertices * format.bytes() as usize;
        start as u64
    };
    attributes.iter().map(place).collect()
}

/// Vertices as the card reads them: one behind another; of draws that are kept, an array for each attribute.
pub fn pack(key: &ShaderKey, batch: &Batch) -> Packed {
    let layout = layout(key, batch);
    let components: usize = layout.iter().map(|&(_, count, _)| count).sum();
    let attributes = layout.iter().map(|&(location, count, _)| (location, float_format(count))).collect();
    let mut bytes = Vec::with_capacity(4 * components * batch.vertices.len());
    if batch.sent.is_some() && layout.len() <= STREAMS_MAX {
        for &(location, count, of) in &layout {
            bytes.resize(bytes.len().next_multiple_of(STREAM_ALIGN), 0);
            for vertex in &batch.vertices {
                bytes.extend(of(vertex, location)[..count].iter().flat_map(|value| value.to_le_bytes()));
            }
        }
        return (attributes, bytes, batch.indices.clone());
    }
    for vertex in &batch.vertices {
        for &(location, count, of) in &layout {
            for value in &of(vertex, location)[..count] {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        }
    }
    (attributes, bytes, batch.indices.clone())
}

/// Points and lines as two triangles each. Lines are clipped to the near plane, since their ends are projected in the shader.
/// Smooth ones are clipped to the view volume, as Mesa does: their ends are soft where they leave the window.
pub fn expand(key: &ShaderKey, batch: &Batch, clip: &Matrix, flat: bool) -> Packed {
    let lines = batch.class == Class::Lines;
    let smooth = key.expand == Expand::SmoothLine;
    let layout = layout(key, batch);
    let mut attributes: Vec<(u32, VertexFormat)> = layout.iter().map(|&(at, count, _)| (at, float_format(count))).collect();
    attributes.push((location::CORNER, VertexFormat::Float32x2));
    if lines {
        attributes.push((location::OTHER, VertexFormat::Float32x4));
    }
    let (mut bytes, mut indices, mut count) = (Vec::new(), Vec::new(), 0_u32);
    for primitive in batch.indices.chunks_exact(if lines { 2 } else { 1 }) {
        let mut ends: Vec<Vertex> = primitive.iter().map(|&i| batch.vertices[i as usize].clone()).collect();
        if lines && !cut(&mut ends, clip, flat, smooth) {
            continue;
        }
        for corner in CORNERS {
            let (this, other) = match lines {
                true if corner[1] > 0.0 => (&ends[1], &ends[0]),
                true => (&ends[0], &ends[1]),
                false => (&ends[0], &ends[0]),
            };
            for &(location, count, of) in &layout {
                for value in &of(this, location)[..count] {
                    bytes.extend_from_slice(&value.to_le_bytes());
                }
            }
            let tail: &[f32] = if lines { &other.position } else { &[] };
            for value in corner.iter().chain(tail) {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        }
        indices.extend(if smooth { SMOOTH_QUAD } else { QUAD }.map(|k| count + k));
        count += 4;
    }
    (attributes, bytes, indices)
}

/// Cuts a line at the near plane, or at the whole view volume; whether anything is left.
fn cut(ends: &mut [Vertex], clip: &Matrix, flat: bool, whole: bool) -> bool {
    if flat {
        ends[0].color = ends[1].color;
        ends[0].normal = ends[1].normal;
    }
    let [a, b] = [0, 1].map(|k| matrix::transform(clip, ends[k].position));
    let Some([from, to]) = visible(a, b, if whole { &VIEW_VOLUME } else { &VIEW_VOLUME[..1] }) else { return false };
    let both = [ends[0].clone(), ends[1].clone()];
    (ends[0], ends[1]) = (between(&both, from), between(&both, to));
    true
}
