//! A torus knot of 70,000 triangles with Blinn-Phong lighting a pixel. Positions and normals are 16-bit codes.

use std::f64::consts::TAU;

use gfx::format::Format;
use gfx::state::*;
use trace::record::{self, Recorder};

use crate::maths::*;

/// Rings along the knot.
const RINGS: u16 = 1_400;
/// Vertices of a ring.
const SIDES: u16 = 25;
/// Radius of the tube.
const TUBE: f64 = 0.42;
/// Positions lie in a cube from -EXTENT to EXTENT.
const EXTENT: f64 = 4.0;

/// The knot's curve and its frame: place, normal, binormal.
fn frame(u: f64) -> (DVec3, DVec3, DVec3) {
    let curve = |u: f64| {
        let r = 2.0 + libm::cos(3.0 * u);
        dvec3(r * libm::cos(2.0 * u), r * libm::sin(2.0 * u), -0.95 * libm::sin(3.0 * u))
    };
    let here = curve(u);
    let next = curve(u + 1e-4);
    let tangent = next - here;
    let binormal = tangent.cross(next + here).normalize();
    (here, binormal.cross(tangent).normalize(), binormal)
}

pub fn record() -> Recorder {
    let mut vertices = Vec::new();
    for ring in 0..RINGS {
        let (center, normal, binormal) = frame(TAU * f64::from(ring) / f64::from(RINGS));
        for side in 0..SIDES {
            let angle = TAU * f64::from(side) / f64::from(SIDES);
            let out = normal * libm::cos(angle) + binormal * libm::sin(angle);
            let position = center + out * TUBE;
            // Up and down again, so that the colour has no seam.
            let hue = 1.0 - (2.0 * f64::from(ring) / f64::from(RINGS) - 1.0).abs();
            vertices.extend(vertex(position / EXTENT, out, hue));
        }
    }
    let mut indices = Vec::new();
    for ring in 0..RINGS {
        for side in 0..SIDES {
            let (next_ring, next_side) = ((ring + 1) % RINGS, (side + 1) % SIDES);
            let at = |ring: u16, side: u16| ring * SIDES + side;
            let (a, b) = (at(ring, side), at(next_ring, side));
            let (c, d) = (at(ring, next_side), at(next_ring, next_side));
            indices.extend([a, c, b, c, d, b]);
        }
    }
    let eye = dvec3(0.9, -2.2, 8.4);
    shown(&Shot { name: "torus-knot", size: [800, 600], eye, extent: EXTENT }, &vertices, &indices)
}

/// The bytes of a vertex: its place in the cube from -1 to 1, its normal and its hue.
pub fn vertex(place: DVec3, normal: DVec3, hue: f64) -> Vec<u8> {
    let mut bytes: Vec<u8> = place.to_array().iter().flat_map(|v| unorm16(v * 0.5 + 0.5).to_le_bytes()).collect();
    bytes.extend(unorm16(hue).to_le_bytes());
    bytes.extend(normal.extend(0.0).to_array().iter().flat_map(|&v| snorm16(v).to_le_bytes()));
    bytes
}

/// How a mesh is looked at.
pub struct Shot {
    pub name: &'static str,
    /// Width and height of the picture.
    pub size: [u32; 2],
    /// From where the origin is looked at.
    pub eye: DVec3,
    /// Vertices lie in the cube from minus this to this.
    pub extent: f64,
}

/// Records a lit mesh of triangles.
pub fn shown(shot: &Shot, vertices: &[u8], indices: &[u16]) -> Recorder {
    let [width, height] = shot.size;
    let mut card = Recorder::new(shot.name);
    let count = indices.len() as u32;
    let indices: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
    let vertices = card.create_buffer_init("vertices", vertices);
    let indices = card.create_buffer_init("indices", &indices);

    let aspect = f64::from(width) / f64::from(height);
    let mut bytes = matrix(perspective(45f64.to_radians(), aspect, 1.0, 30.0) * look_at_mat4(shot.eye, DVec3::ZERO, DVec3::Y));
    bytes.extend(floats(shot.eye.extend(shot.extent).to_array()));
    let camera = card.create_buffer_init("camera", &bytes);
    let layout = card.create_bind_group_layout([(0, record::UNIFORM)]);
    let group = card.create_bind_group(layout, [(0, record::whole(camera))]);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);

    let shader = card.create_shader(shot.name, include_str!("knot.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.layout = Some(pipeline_layout);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Unorm16x4), (1, VertexFormat::Snorm16x4)])];
    desc.primitive.cull_mode = CullMode::Back;
    desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    let pipeline = card.create_render_pipeline(shot.name, desc);

    let target = card.create_texture("target", record::texture_2d(width, height, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(width, height, Format::Depth32Float));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    let clear = record::clear(target_view, [0.012, 0.014, 0.022, 1.0]);
    let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group);
    pass.set_vertex_buffer(0, vertices);
    pass.set_index_buffer(indices, IndexFormat::Uint16);
    pass.draw_indexed(count, 1);
    drop(pass);
    card.present(target);
    card
}
