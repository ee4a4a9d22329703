//! Wooden crates with a mipmapped texture and a depth test: one in front, a row that recedes behind it.

use gfx::format::Format;
use gfx::state::*;
use trace::command::BoundResource;
use trace::record::{self, Recorder};

use crate::maths::*;
use crate::pixels::*;
use crate::solids::Mesh;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

/// Planks in a frame with a diagonal brace.
fn crate_side(u: f64, v: f64) -> [f64; 4] {
    let edge = u.min(1.0 - u).min(v).min(1.0 - v);
    let framed = edge < 0.11;
    let brace = (u - v).abs() < 0.085 && !framed;
    let along = if framed && v.min(1.0 - v) < u.min(1.0 - u) || brace { u } else { v };
    let across = if along == u { v } else { u };
    let plank = (across * 5.0).floor();
    let grain = turbulence(3, along + plank * 0.37, across * 6.0, 4);
    let tone = 0.75 + 0.35 * uniform(5, plank as u32, 0);
    let mut color = mix(dvec3(0.22, 0.105, 0.035), dvec3(0.48, 0.27, 0.105), grain) * tone;
    if framed || brace {
        color = mix(dvec3(0.30, 0.15, 0.05), dvec3(0.52, 0.30, 0.13), grain) * 1.05;
    } else {
        let gap = (across * 5.0).fract();
        color *= ramp(0.0, 0.06, gap.min(1.0 - gap)) * 0.8 + 0.2;
    }
    // The shadow of the frame on the planks, and the rim of the crate.
    color *= if framed { ramp(-0.01, 0.02, edge) } else { 0.45 + 0.55 * ramp(0.11, 0.16, edge) };
    // Nails.
    for (x, y) in [(0.055, 0.055), (0.945, 0.055), (0.055, 0.945), (0.945, 0.945), (0.5, 0.055), (0.5, 0.945)] {
        let distance = ((u - x) * (u - x) + (v - y) * (v - y)).sqrt();
        color = mix(dvec3(0.55, 0.56, 0.6), color, ramp(0.012, 0.018, distance));
    }
    opaque(color)
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("cube");
    let cube = Mesh::cube().upload(&mut card, "cube");
    let (_, image) = mipped_texture(&mut card, "crate", &[Image::paint(256, crate_side)], true);
    let sampler = card.create_sampler(record::trilinear_repeat());

    let eye = dvec3(0.0, 1.5, 5.3);
    let camera = perspective(42f64.to_radians(), f64::from(WIDTH) / f64::from(HEIGHT), 0.5, 200.0)
        * look_at_mat4(eye, dvec3(0.6, -0.1, 0.0), DVec3::Y);
    let mut bytes = matrix(camera);
    let models = (0..9).map(|i| {
        let far = f64::from(i);
        let turn = DMat4::from_rotation_y(0.62 + 1.3 * far);
        let tilt = if i == 0 { turn * DMat4::from_rotation_x(0.35) } else { turn };
        let side = if i % 2 == 0 { -0.35 } else { 1.0 };
        let place = if i == 0 { DVec3::ZERO } else { dvec3(2.2 * far * side - 0.4, -0.6, -1.6 - 3.6 * far) };
        DMat4::from_translation(place) * tilt
    });
    models.for_each(|model| bytes.extend(matrix(model)));
    let scene = card.create_buffer_init("scene", &bytes);

    let layout = card.create_bind_group_layout([(0, record::UNIFORM), (1, record::TEXTURE), (2, record::SAMPLER)]);
    let entries = [(0, record::whole(scene)), (1, BoundResource::View(image)), (2, BoundResource::Sampler(sampler))];
    let group = card.create_bind_group(layout, entries);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);
    let shader = card.create_shader("cube", include_str!("cube.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.layout = Some(pipeline_layout);
    desc.buffers = vec![Mesh::layout()];
    desc.primitive.cull_mode = CullMode::Back;
    desc.depth_stencil = Some(record::depth_less(Format::Depth24Plus));
    let pipeline = card.create_render_pipeline("cube", desc);

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(WIDTH, HEIGHT, Format::Depth24Plus));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    let clear = record::clear(target_view, [0.16, 0.21, 0.29, 1.0]);
    let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
    pass.set_pipeline(pipeline);
    pass.set_bind_group(0, group);
    pass.set_vertex_buffer(0, cube.vertices);
    pass.set_index_buffer(cube.indices, IndexFormat::Uint16);
    pass.draw_indexed(cube.count, 9);
    drop(pass);
    card.present(target);
    card
}
