//! Vertices of a batch as the card reads them: only what differs between them, and points and lines as triangles where they are wide.

use gfx::state::VertexFormat;

use super::key::ShaderKey;
use super::matrix::{self, Matrix};
use super::primitive::{Batch, Class};
use super::state::{UNITS, Vertex};
use super::wgsl::{self, location};

/// Corners of an expanded point or line, and the triangles between them.
const CORNERS: [[f32; 2]; 4] = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
const QUAD: [u32; 6] = [0, 1, 2, 0, 2, 3];

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
fn layout(key: &ShaderKey, vertices: &[Vertex]) -> Vec<Attribute> {
    let mut list: Vec<Attribute> = Vec::new();
    let position = components(vertices.iter().map(|vertex| vertex.position), 2);
    list.push((location::POSITION, position, |v, _| v.position));
    if key.varying.color {
        let opaque = vertices.iter().all(|vertex| vertex.color[3] == 1.0);
        list.push((location::COLOR, if opaque { 3 } else { 4 }, |v, _| v.color));
    }
    if key.varying.normal {
        list.push((location::NORMAL, 3, |v, _| [v.normal[0], v.normal[1], v.normal[2], 0.0]));
    }
    if key.varying.secondary {
        list.push((location::SECONDARY, 3, |v, _| [v.secondary[0], v.secondary[1], v.secondary[2], 0.0]));
    }
    if key.varying.fog {
        list.push((location::FOG, 1, |v, _| [v.fog; 4]));
    }
    if key.line_stipple {
        list.push((location::ALONG, 1, |v, _| [v.along; 4]));
    }
    for unit in key.units.iter().filter(|unit| wgsl::reads_coordinates(key, unit)) {
        let count = components(vertices.iter().map(|vertex| vertex.texture[unit.unit]), 2);
        list.push((location::TEXTURE + unit.unit as u32, count, |v, at| v.texture[(at - location::TEXTURE) as usize]));
    }
    list
}

/// Vertices as the card reads them.
pub fn pack(key: &ShaderKey, batch: &Batch) -> Packed {
    let layout = layout(key, &batch.vertices);
    let mut bytes = Vec::new();
    for vertex in &batch.vertices {
        for &(location, count, of) in &layout {
            for value in &of(vertex, location)[..count] {
                bytes.extend_from_slice(&value.to_le_bytes());
            }
        }
    }
    let attributes = layout.iter().map(|&(location, count, _)| (location, float_format(count))).collect();
    (attributes, bytes, batch.indices.clone())
}

/// Points and lines as two triangles each. Lines are clipped to the near plane, since their ends are projected in the shader.
pub fn expand(key: &ShaderKey, batch: &Batch, clip: &Matrix, flat: bool) -> Packed {
    let lines = batch.class == Class::Lines;
    let layout = layout(key, &batch.vertices);
    let mut attributes: Vec<(u32, VertexFormat)> = layout.iter().map(|&(at, count, _)| (at, float_format(count))).collect();
    attributes.push((location::CORNER, VertexFormat::Float32x2));
    if lines {
        attributes.push((location::OTHER, VertexFormat::Float32x4));
    }
    let (mut bytes, mut indices, mut count) = (Vec::new(), Vec::new(), 0_u32);
    for primitive in batch.indices.chunks_exact(if lines { 2 } else { 1 }) {
        let mut ends: Vec<Vertex> = primitive.iter().map(|&i| batch.vertices[i as usize]).collect();
        if lines && !near_clip(&mut ends, clip, flat) {
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
        indices.extend(QUAD.map(|k| count + k));
        count += 4;
    }
    (attributes, bytes, indices)
}

/// Cuts a line at the near plane; whether anything is left.
fn near_clip(ends: &mut [Vertex], clip: &Matrix, flat: bool) -> bool {
    let [a, b] = [0, 1].map(|k| matrix::transform(clip, ends[k].position)[2]);
    if flat {
        ends[0].color = ends[1].color;
        ends[0].normal = ends[1].normal;
    }
    if !(a >= 0.0) && !(b >= 0.0) {
        return false;
    }
    if a >= 0.0 && b >= 0.0 {
        return true;
    }
    let t = a / (a - b);
    let mix = |x: f32, y: f32| x + (y - x) * t;
    let (from, to) = (ends[0], ends[1]);
    let mut cut = from;
    let mix4 = |x: [f32; 4], y: [f32; 4]| std::array::from_fn(|k| mix(x[k], y[k]));
    cut.position = mix4(from.position, to.position);
    cut.color = mix4(from.color, to.color);
    cut.normal = std::array::from_fn(|k| mix(from.normal[k], to.normal[k]));
    cut.secondary = std::array::from_fn(|k| mix(from.secondary[k], to.secondary[k]));
    cut.fog = mix(from.fog, to.fog);
    cut.along = mix(from.along, to.along);
    for unit in 0..UNITS {
        cut.texture[unit] = mix4(from.texture[unit], to.texture[unit]);
    }
    ends[usize::from(!(b >= 0.0))] = cut;
    true
}
