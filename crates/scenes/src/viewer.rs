//! A viewer of models: one layout of vertices and one vertex program for all that it draws, whatever the pass reads of them. Depths
//! come first, from positions alone; then the models that are selected are shaded, and the others plain. Behind them hangs a picture that is
//! larger on the screen than in memory. It sends what lies beside its pane, too.

use std::f64::consts::TAU;

use gfx::format::Format;
use gfx::state::*;
use trace::command::BoundResource;
use trace::record::{self, Recorder};

use crate::maths::*;
use crate::pixels::*;

const WIDTH: u32 = 256;
const HEIGHT: u32 = 192;
const SLICES: u16 = 24;
const STACKS: u16 = 16;
const MODELS: u32 = 40;
const COLUMNS: u32 = 8;
/// Of these the first are shaded, and the others plain.
const SHADED: u32 = 16;
/// The pane that it draws in; to the right of it lies what it does not draw.
const PANE: Rect = Rect { x: 0, y: 0, width: 208, height: HEIGHT };

/// Positions, and all else of the vertices in a buffer of its own: normal, tangent, texture coordinates, colour.
#[derive(Default)]
struct Mesh {
    positions: Vec<u8>,
    more: Vec<u8>,
    indices: Vec<u16>,
}

impl Mesh {
    fn vertex(&mut self, position: DVec3, normal: DVec3, tangent: DVec3, uv: [f64; 2], color: DVec3) {
        self.positions.extend(floats(position.to_array()));
        for direction in [normal, tangent] {
            self.more.extend(direction.extend(0.0).to_array().iter().flat_map(|&value| snorm16(value).to_le_bytes()));
        }
        self.more.extend(floats(uv));
        self.more.extend(color.extend(1.0).to_array().map(unorm8));
    }
}

/// A ball with bumps; its colour follows them.
fn ball() -> Mesh {
    let mut mesh = Mesh::default();
    for stack in 0..=STACKS {
        for slice in 0..=SLICES {
            let (u, v) = (f64::from(slice) / f64::from(SLICES), f64::from(stack) / f64::from(STACKS));
            let (turn, tilt) = (u * TAU, v * TAU / 2.0);
            let ring = libm::sin(tilt);
            let normal = dvec3(ring * libm::cos(turn), libm::cos(tilt), -ring * libm::sin(turn));
            let bump = libm::sin(6.0 * turn) * libm::sin(5.0 * tilt);
            let color = mix(dvec3(0.85, 0.75, 0.6), dvec3(0.45, 0.55, 0.75), 0.5 + 0.5 * bump);
            let tangent = dvec3(-libm::sin(turn), 0.0, -libm::cos(turn));
            mesh.vertex(normal * (0.9 + 0.1 * bump), normal, tangent, [3.0 * u, 2.0 * v], color);
        }
    }
    for stack in 0..STACKS {
        for slice in 0..SLICES {
            let a = stack * (SLICES + 1) + slice;
            let b = a + SLICES + 1;
            mesh.indices.extend([a, b, b + 1, a, b + 1, a + 1]);
        }
    }
    mesh
}

/// The picture on the wall.
fn wall() -> Mesh {
    let mut mesh = Mesh::default();
    for [x, y] in [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]] {
        mesh.vertex(dvec3(x, y, 0.0), DVec3::Z, DVec3::X, [(x + 1.0) / 2.0, (1.0 - y) / 2.0], DVec3::ONE);
    }
    mesh.indices = vec![0, 1, 2, 0, 2, 3];
    mesh
}

/// Hills under a sky.
fn picture(u: f64, v: f64) -> [f64; 4] {
    let hill = 0.45 + 0.3 * turbulence(5, u, 0.5, 4);
    opaque(if v > hill {
        mix(dvec3(0.25, 0.4, 0.15), dvec3(0.1, 0.2, 0.1), v)
    } else {
        mix(dvec3(0.35, 0.5, 0.8), dvec3(0.85, 0.85, 0.8), v / hill)
    })
}

/// Scratches in brass.
fn brass(u: f64, v: f64) -> [f64; 4] {
    opaque(dvec3(0.9, 0.75, 0.45) * (0.6 + 0.6 * turbulence(9, u, 8.0 * v, 8)))
}

/// Places and sizes, the first at the front.
fn models() -> Vec<u8> {
    let one = |i: u32| {
        let r = |channel| uniform(13, i, channel);
        let (column, row) = (f64::from(i % COLUMNS), f64::from(i / COLUMNS));
        floats([2.1 * (column - 3.5) + 0.3 * r(0), 1.2 * row - 3.0 + 0.3 * r(1), -1.5 * row, 0.75 + 0.3 * r(2)])
    };
    (0..MODELS).flat_map(one).collect()
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("viewer");
    let camera = perspective(50f64.to_radians(), f64::from(WIDTH) / f64::from(HEIGHT), 0.5, 60.0)
        * look_at_mat4(dvec3(0.0, 1.5, 9.5), dvec3(0.0, 0.0, -3.0), DVec3::Y);
    let sun = dvec3(0.4, 0.7, 0.6).normalize();
    let mut bytes = matrix(camera);
    bytes.extend(floats(sun.extend(0.0).to_array()));
    let scene = card.create_buffer_init("scene", &bytes);
    let mut buffers = |label: &str, mesh: &Mesh| {
        let indices: Vec<u8> = mesh.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        [("positions", &mesh.positions), ("more", &mesh.more), ("indices", &indices)]
            .map(|(part, bytes)| card.create_buffer_init(&format!("{label}-{part}"), bytes))
    };
    let (ball, wall) = (ball(), wall());
    let (ball_buffers, wall_buffers) = (buffers("ball", &ball), buffers("wall", &wall));
    let places = card.create_buffer_init("places", models());
    let behind = card.create_buffer_init("behind", floats([0.0, 2.0, -12.0, 9.0]));

    let brass = mipped_texture(&mut card, "brass", &[Image::paint(64, brass)], true).1;
    let picture = mipped_texture(&mut card, "picture", &[Image::paint(32, picture)], true).1;
    let sampler = card.create_sampler(record::trilinear_repeat());
    let scene_layout = card.create_bind_group_layout([(0, record::UNIFORM)]);
    let material_layout = card.create_bind_group_layout([(0, record::TEXTURE), (1, record::SAMPLER)]);
    let scene_group = card.create_bind_group(scene_layout, [(0, record::whole(scene))]);
    let mut material =
        |view| card.create_bind_group(material_layout, [(0, BoundResource::View(view)), (1, BoundResource::Sampler(sampler))]);
    let (brass, picture) = (material(brass), material(picture));
    let layout = card.create_pipeline_layout([scene_layout, material_layout], 0);

    let shader = card.create_shader("viewer", include_str!("viewer.wgsl"));
    let more =
        [(1, VertexFormat::Snorm16x4), (2, VertexFormat::Snorm16x4), (3, VertexFormat::Float32x2), (4, VertexFormat::Unorm8x4)];
    let mut pipeline = |label: &str, vertex: &str, fragment: Option<&str>| {
        let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
        desc.layout = Some(layout);
        desc.vertex = record::stage_entry(shader, vertex);
        desc.fragment = fragment.map(|entry| record::stage_entry(shader, entry));
        desc.buffers = vec![
            record::vertex_buffer(&[(0, VertexFormat::Float32x3)]),
            record::vertex_buffer(&more),
            record::instance_buffer(&[(5, VertexFormat::Float32x4)]),
        ];
        desc.primitive.cull_mode = CullMode::Back;
        let mut depth = record::depth_less(Format::Depth32Float);
        if fragment.is_some() {
            (depth.depth_compare, depth.depth_write) = (Compare::LessEqual, false);
        } else {
            desc.targets.clear();
        }
        desc.depth_stencil = Some(depth);
        card.create_render_pipeline(label, desc)
    };
    let depths = pipeline("depths", "position_only", None);
    let shaded = pipeline("shaded", "model", Some("shaded"));
    let plain = pipeline("plain", "model", Some("plain"));
    let hung = pipeline("picture", "model", Some("picture"));

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(WIDTH, HEIGHT, Format::Depth32Float));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    let balls = ball.indices.len() as u32;

    let mut pass = card.begin_render_pass([], record::clear_depth(depth_view, true));
    pass.set_pipeline(depths);
    pass.set_bind_group(0, scene_group);
    pass.set_bind_group(1, brass);
    pass.set_scissor(PANE);
    for (buffers, instances, indices, count) in [(ball_buffers, places, balls, MODELS), (wall_buffers, behind, 6, 1)] {
        let [positions, more, index] = buffers;
        pass.set_vertex_buffer(0, positions);
        pass.set_vertex_buffer(1, more);
        pass.set_vertex_buffer(2, instances);
        pass.set_index_buffer(index, IndexFormat::Uint16);
        pass.draw_indexed(indices, count);
    }
    drop(pass);

    let mut again = record::clear_depth(depth_view, false);
    if let Some(attachment) = &mut again {
        attachment.depth_clear = None;
    }
    let mut pass = card.begin_render_pass([record::clear(target_view, [0.02, 0.02, 0.03, 1.0])], again);
    pass.set_bind_group(0, scene_group);
    pass.set_scissor(PANE);
    let draws = [
        (hung, picture, wall_buffers, behind, 6, 0..1),
        (shaded, brass, ball_buffers, places, balls, 0..SHADED),
        (plain, brass, ball_buffers, places, balls, SHADED..MODELS),
    ];
    for (pipeline, material, [positions, more, index], instances, indices, range) in draws {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(1, material);
        pass.set_vertex_buffer(0, positions);
        pass.set_vertex_buffer(1, more);
        pass.set_vertex_buffer(2, instances);
        pass.set_index_buffer(index, IndexFormat::Uint16);
        pass.draw_indexed_from(indices, range.len() as u32, 0, 0, range.start);
    }
    drop(pass);
    card.present(target);
    card
}
