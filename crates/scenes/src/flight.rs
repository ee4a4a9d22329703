//! Ten seconds of a camera that flies among globes over a chequered floor: 600 short frames whose load rises and falls, for what
//! looks at sequences of frames. As programs do, it draws only what may be seen.

use gfx::format::Format;
use gfx::state::*;
use glam::dvec4;
use trace::command::BoundResource;
use trace::record::{self, Recorder};

use crate::maths::*;
use crate::pixels::*;
use crate::solids::Mesh;

const WIDTH: u32 = 512;
const HEIGHT: u32 = 384;
const FRAMES: u32 = 600;
const GLOBES: u32 = 96;

/// Bands of colour with a grain.
fn bands(u: f64, v: f64) -> [f64; 4] {
    let band = uniform(11, (v * 9.0) as u32, 0);
    let base = mix(dvec3(0.55, 0.24, 0.12), dvec3(0.16, 0.33, 0.52), band);
    opaque(base * (0.55 + 0.9 * turbulence(12, u * 3.0, v * 9.0, 4)))
}

/// Tiles with joints.
fn tiles(u: f64, v: f64) -> [f64; 4] {
    let [x, y] = [u, v].map(|at| (at * 8.0).fract());
    let joint = x.min(y).min(1.0 - x).min(1.0 - y);
    let odd = ((u * 8.0) as u32 + (v * 8.0) as u32) % 2 == 1;
    let base = if odd { dvec3(0.36, 0.35, 0.33) } else { dvec3(0.13, 0.14, 0.16) };
    opaque(base * (0.4 + 0.6 * ramp(0.01, 0.05, joint)))
}

/// Where the camera is at a moment from 0 to 1: rounds through the field, low and high, slow and fast.
fn place(at: f64) -> DVec3 {
    let turn = 2.0 * std::f64::consts::TAU * (at + 0.08 * libm::sin(3.0 * std::f64::consts::TAU * at));
    let away = 9.0 + 5.5 * libm::sin(2.5 * turn * 0.5 + 0.4);
    dvec3(away * libm::cos(turn), 1.6 + 1.2 * libm::sin(1.5 * turn), away * libm::sin(turn))
}

/// Centre and size of a globe: most stand together on one side, in the order of their angle.
fn globe_at(i: u32) -> [f64; 4] {
    let around = (f64::from(i) + 0.8 * uniform(7, i, 0)) / f64::from(GLOBES);
    let turn = std::f64::consts::TAU * around * around;
    let away = 2.0 + 15.0 * uniform(7, i, 1).sqrt();
    let size = 0.35 + 0.9 * uniform(7, i, 2);
    [away * libm::cos(turn), size + 2.4 * uniform(7, i, 3), away * libm::sin(turn), size]
}

/// Whether a sphere may be seen: not behind the camera and not beside what it sees.
fn seen(camera: DMat4, [x, y, z, size]: [f64; 4]) -> bool {
    let at = camera * dvec4(x, y, z, 1.0);
    let length = |r: usize| (camera.row(3) + camera.row(r)).truncate().length();
    at.w > -size && [0, 1].into_iter().all(|r| at.w + size * length(r) > at[r].abs())
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("flight");
    let globe = Mesh::sphere(16, 10).upload(&mut card, "globe");
    let mut floor = Mesh::default();
    floor.quad(dvec3(-40.0, 0.0, 40.0), dvec3(80.0, 0.0, 0.0), dvec3(0.0, 0.0, -80.0), [20.0, 20.0]);
    let floor = floor.upload(&mut card, "floor");
    let (_, globes) = mipped_texture(&mut card, "globe", &[Image::paint(64, bands)], true);
    let (_, ground) = mipped_texture(&mut card, "floor", &[Image::paint(128, tiles)], true);
    let sampler = card.create_sampler(record::trilinear_repeat());

    // Places and sizes; the floor is the last, where it is.
    let crowd: Vec<[f64; 4]> = (0..GLOBES).map(globe_at).collect();
    let floor_place = [0.0, 0.0, 0.0, 1.0];
    let places = card.create_buffer_init("places", floats(crowd.iter().flatten().copied().chain(floor_place)));

    let entries = [(0, record::STORAGE_READ), (1, record::TEXTURE), (2, record::SAMPLER)];
    let layout = card.create_bind_group_layout(entries);
    let mut group = |image| {
        let entries = [(0, record::whole(places)), (1, BoundResource::View(image)), (2, BoundResource::Sampler(sampler))];
        card.create_bind_group(layout, entries)
    };
    let (globe_group, floor_group) = (group(globes), group(ground));
    let pipeline_layout = card.create_pipeline_layout([layout], 64);
    let shader = card.create_shader("flight", include_str!("flight.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.layout = Some(pipeline_layout);
    desc.buffers = vec![Mesh::layout()];
    desc.primitive.cull_mode = CullMode::Back;
    desc.depth_stencil = Some(record::depth_less(Format::Depth24Plus));
    let pipeline = card.create_render_pipeline("flight", desc);

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(WIDTH, HEIGHT, Format::Depth24Plus));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    let lens = perspective(55f64.to_radians(), f64::from(WIDTH) / f64::from(HEIGHT), 0.1, 100.0);
    for frame in 0..FRAMES {
        let at = f64::from(frame) / f64::from(FRAMES);
        let (eye, ahead) = (place(at), place(at + 0.035));
        let camera = lens * look_at_mat4(eye, dvec3(0.7 * ahead.x, ahead.y - 0.5, 0.7 * ahead.z), DVec3::Y);
        let words = camera.to_cols_array().map(|value| (value as f32).to_bits());
        let clear = record::clear(target_view, [0.30, 0.42, 0.60, 1.0]);
        let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
        pass.set_pipeline(pipeline);
        pass.set_immediates(0, &words);
        pass.set_bind_group(0, globe_group);
        pass.set_vertex_buffer(0, globe.vertices);
        pass.set_index_buffer(globe.indices, IndexFormat::Uint16);
        let mut next = 0;
        while let Some(first) = (next..GLOBES).find(|&i| seen(camera, crowd[i as usize])) {
            next = (first..GLOBES).find(|&i| !seen(camera, crowd[i as usize])).unwrap_or(GLOBES);
            pass.draw_indexed_from(globe.count, next - first, 0, 0, first);
        }
        pass.set_bind_group(0, floor_group);
        pass.set_vertex_buffer(0, floor.vertices);
        pass.set_index_buffer(floor.indices, IndexFormat::Uint16);
        pass.draw_indexed_from(floor.count, 1, 0, 0, GLOBES);
        drop(pass);
        card.present(target);
    }
    card
}
