//! A long corridor with a trilinear texture array: every ratio of texels to pixels, from magnified to the last level.

use gfx::format::Format;
use gfx::state::*;
use trace::command::{BoundResource, ViewDesc};
use trace::record::{self, Recorder};

use crate::maths::*;
use crate::pixels::*;
use crate::solids::Mesh;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;
const LENGTH: f64 = 60.0;
const LAMPS: u32 = 8;

/// Bricks, four courses a texture, every second one shifted by half a brick.
fn bricks(u: f64, v: f64) -> [f64; 4] {
    let course = (v * 8.0).floor();
    let shifted = u * 4.0 + 0.5 * (course as i64).rem_euclid(2) as f64;
    let (x, y) = (shifted.fract() * 2.0, (v * 8.0).fract());
    let brick = (shifted.floor() as i64).rem_euclid(4) as u32 + 4 * course as u32;
    let edge = x.min(2.0 - x).min(y.min(1.0 - y));
    let tone = 0.65 + 0.5 * uniform(11, brick, 0);
    let rough = turbulence(13, u, v, 16);
    let clay = mix(dvec3(0.30, 0.085, 0.045), dvec3(0.42, 0.16, 0.085), uniform(11, brick, 1));
    let mortar = dvec3(0.33, 0.30, 0.26) * (0.6 + 0.6 * rough);
    opaque(mix(mortar, clay * (tone * (0.6 + 0.8 * rough)), ramp(0.05, 0.11, edge)))
}

/// Stone tiles, light and dark in turn.
fn tiles(u: f64, v: f64) -> [f64; 4] {
    let (x, y) = (u * 4.0, v * 4.0);
    let dark = (x.floor() as i64 + y.floor() as i64) % 2 == 0;
    let edge = x.fract().min(1.0 - x.fract()).min(y.fract()).min(1.0 - y.fract());
    let vein = turbulence(17, u, v, 4);
    let marble = 1.0 - ramp(0.0, 0.05, (vein - 0.5).abs());
    let base = if dark {
        mix(dvec3(0.055, 0.06, 0.07), dvec3(0.22, 0.24, 0.27), marble)
    } else {
        mix(dvec3(0.50, 0.47, 0.42), dvec3(0.28, 0.26, 0.24), marble)
    };
    opaque(mix(dvec3(0.02, 0.02, 0.02), base, ramp(0.005, 0.02, edge)))
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("corridor");
    // Seen from inside; one texture repetition is two units wide. Texture layers change with the normal in the shader.
    let mut mesh = Mesh::default();
    let (half, height) = (2.0, 3.0);
    let repeats = LENGTH / 2.0;
    mesh.quad(dvec3(-half, 0.0, 0.0), dvec3(2.0 * half, 0.0, 0.0), dvec3(0.0, 0.0, -LENGTH), [half, repeats]);
    mesh.quad(dvec3(-half, height, -LENGTH), dvec3(2.0 * half, 0.0, 0.0), dvec3(0.0, 0.0, LENGTH), [half, repeats]);
    mesh.quad(dvec3(-half, 0.0, 0.0), dvec3(0.0, 0.0, -LENGTH), dvec3(0.0, height, 0.0), [repeats, height / 2.0]);
    mesh.quad(dvec3(half, 0.0, -LENGTH), dvec3(0.0, 0.0, LENGTH), dvec3(0.0, height, 0.0), [repeats, height / 2.0]);
    mesh.quad(dvec3(-half, 0.0, -LENGTH), dvec3(2.0 * half, 0.0, 0.0), dvec3(0.0, height, 0.0), [half, height / 2.0]);
    let corridor = mesh.upload(&mut card, "corridor");

    let (texture, _) = mipped_texture(&mut card, "surfaces", &[Image::paint(256, bricks), Image::paint(256, tiles)], true);
    let array = ViewDesc { dimension: Some(ViewDimension::D2Array), ..ViewDesc::default() };
    let surfaces = card.create_view_of(texture, array);
    let sampler = card.create_sampler(record::trilinear_repeat());

    let camera = perspective(62f64.to_radians(), f64::from(WIDTH) / f64::from(HEIGHT), 0.1, 100.0)
        * look_at_mat4(dvec3(-0.55, 1.45, -0.4), dvec3(0.35, 1.2, -10.0), DVec3::Y);
    let mut bytes = matrix(camera);
    for lamp in 0..LAMPS {
        let along = -2.5 - f64::from(lamp) * (LENGTH - 5.0) / f64::from(LAMPS - 1);
        let warm = 0.75 + 0.25 * uniform(19, lamp, 0);
        bytes.extend(floats([0.0, 2.7, along, warm]));
    }
    let scene = card.create_buffer_init("scene", &bytes);
    let layout = card.create_bind_group_layout([(0, record::UNIFORM), (1, record::TEXTURE), (2, record::SAMPLER)]);
    let entries = [(0, record::whole(scene)), (1, BoundResource::View(surfaces)), (2, BoundResource::Sampler(sampler))];
    let group = card.create_bind_group(layout, entries);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);
    let shader = card.create_shader("corridor", include_str!("corridor.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.layout = Some(pipeline_layout);
    desc.buffers = vec![Mesh::layout()];
    desc.primitive.cull_mode = CullMode::Back;
    desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    let pipeline = card.create_render_pipeline("corridor", desc);

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(WIDTH, HEIGHT, Format::Depth32Float));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    let clear = record::clear(target_view, [0.0, 0.0, 0.0, 1.0]);
    let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group);
    pass.set_vertex_buffer(0, corridor.vertices);
    pass.set_index_buffer(corridor.indices, IndexFormat::Uint16);
    pass.draw_indexed(corridor.count, 1);
    drop(pass);
    card.present(target);
    card
}
