//! Two passes: depth from the light, then the scene with nine comparisons per pixel.

use std::f64::consts::TAU;

use gfx::format::Format;
use gfx::state::*;
use trace::command::BoundResource;
use trace::record::{self, Recorder, RenderPass};

use crate::maths::*;
use crate::solids::{Mesh, Solid};

const WIDTH: u32 = 800;
const HEIGHT: u32 = 600;
const SHADOW: u32 = 1_024;

/// A model matrix and a colour.
type Object = (DMat4, DVec3);

/// Boxes and balls.
fn objects() -> (Vec<Object>, Vec<Object>) {
    let mut boxes = vec![(placed(dvec3(0.0, -0.5, 0.0), 0.0, dvec3(14.0, 0.5, 14.0)), dvec3(0.48, 0.52, 0.44))];
    // A ring of columns and a stair of slabs inside it.
    for i in 0..10 {
        let angle = TAU * (f64::from(i) + 0.5) / 10.0;
        let place = dvec3(5.2 * libm::cos(angle), 1.5, 5.2 * libm::sin(angle));
        boxes.push((placed(place, -angle, dvec3(0.34, 1.5, 0.34)), dvec3(0.70, 0.66, 0.58)));
        boxes.push((placed(place.with_y(3.1), -angle, dvec3(0.5, 0.14, 0.9)), dvec3(0.62, 0.57, 0.50)));
    }
    for i in 0..4 {
        let half = 2.2 - 0.45 * f64::from(i);
        let place = dvec3(0.0, 0.16 + 0.32 * f64::from(i), 0.0);
        boxes.push((placed(place, 0.25 * f64::from(i), dvec3(half, 0.16, half)), dvec3(0.60, 0.34, 0.26)));
    }
    let mut balls = vec![(placed(dvec3(0.0, 2.08, 0.0), 0.0, DVec3::splat(0.8)), dvec3(0.78, 0.58, 0.18))];
    for i in 0..14 {
        let r = |channel| uniform(47, i, channel);
        let (angle, radius) = (TAU * r(0), 0.16 + 0.3 * r(1));
        let out = 2.9 + 1.5 * r(2);
        let place = dvec3(out * libm::cos(angle), radius, out * libm::sin(angle));
        let color = mix(dvec3(0.18, 0.42, 0.62), dvec3(0.72, 0.22, 0.34), r(3));
        balls.push((placed(place, 0.0, DVec3::splat(radius)), color));
    }
    (boxes, balls)
}

fn draw(pass: &mut RenderPass, cube: &Solid, boxes: u32, ball: &Solid, balls: u32) {
    pass.set_vertex_buffer(0, cube.vertices);
    pass.set_index_buffer(cube.indices, IndexFormat::Uint16);
    pass.draw_indexed(cube.count, boxes);
    pass.set_vertex_buffer(0, ball.vertices);
    pass.set_index_buffer(ball.indices, IndexFormat::Uint16);
    pass.draw_indexed_from(ball.count, balls, 0, 0, boxes);
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("shadow");
    let cube = Mesh::cube().upload(&mut card, "cube");
    let ball = Mesh::sphere(40, 24).upload(&mut card, "ball");
    let (boxes, balls) = objects();
    let mut bytes = Vec::new();
    for (model, color) in boxes.iter().chain(&balls) {
        bytes.extend(matrix(*model));
        // Colours are chosen by eye: their squares are near to linear light.
        bytes.extend(floats((color * color).extend(0.0).to_array()));
    }
    let objects = card.create_buffer_init("objects", &bytes);
    let (boxes, balls) = (boxes.len() as u32, balls.len() as u32);

    let eye = dvec3(3.5, 5.6, 10.8);
    let sun = dvec3(0.55, 0.78, 0.30).normalize();
    let camera = perspective(44f64.to_radians(), f64::from(WIDTH) / f64::from(HEIGHT), 1.0, 60.0)
        * look_at_mat4(eye, dvec3(0.0, 0.9, 0.0), DVec3::Y);
    let mut light = orthographic(-9.0, 9.0, -9.0, 9.0, 1.0, 40.0) * look_at_mat4(sun * 20.0, DVec3::ZERO, DVec3::Y);
    // The projection of a symmetric box has -0 in its last column. The sum with 0 is the 0 that the trace has.
    light.w_axis += 0.0;
    let mut bytes = matrix(camera);
    bytes.extend(matrix(light));
    bytes.extend(floats(sun.extend(1.0 / f64::from(SHADOW)).to_array()));
    bytes.extend(floats(eye.extend(0.0).to_array()));
    let scene = card.create_buffer_init("scene", &bytes);

    let shadow = card.create_texture("shadow", record::texture_2d(SHADOW, SHADOW, Format::Depth32Float));
    let shadow_view = card.create_view(shadow);
    let compare = card.create_sampler(SamplerDesc {
        mag: FilterMode::Linear,
        min: FilterMode::Linear,
        compare: Some(Compare::LessEqual),
        ..SamplerDesc::default()
    });
    let scene_layout = card.create_bind_group_layout([(0, record::UNIFORM), (1, record::STORAGE_READ)]);
    let shadow_layout = card.create_bind_group_layout([(0, record::TEXTURE), (1, record::SAMPLER)]);
    let scene_group = card.create_bind_group(scene_layout, [(0, record::whole(scene)), (1, record::whole(objects))]);
    let shadow_group =
        card.create_bind_group(shadow_layout, [(0, BoundResource::View(shadow_view)), (1, BoundResource::Sampler(compare))]);
    let depth_layout = card.create_pipeline_layout([scene_layout], 0);
    let full_layout = card.create_pipeline_layout([scene_layout, shadow_layout], 0);

    let shader = card.create_shader("shadow", include_str!("shadow.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
    desc.layout = Some(depth_layout);
    desc.vertex = record::stage_entry(shader, "from_light");
    desc.fragment = None;
    desc.targets = Vec::new();
    desc.buffers = vec![Mesh::layout()];
    desc.primitive.cull_mode = CullMode::Back;
    desc.depth_stencil = Some(DepthStencil { bias: 2.0, bias_slope: 2.5, ..record::depth_less(Format::Depth32Float) });
    let cast = card.create_render_pipeline("cast", desc.clone());
    desc.layout = Some(full_layout);
    desc.vertex = record::stage_entry(shader, "place");
    desc.fragment = Some(record::stage_entry(shader, "shade"));
    desc.targets = vec![Some(record::target(Format::Rgba8UnormSrgb))];
    desc.depth_stencil = Some(record::depth_less(Format::Depth24Plus));
    let shade = card.create_render_pipeline("shade", desc);

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let depth = card.create_texture("depth", record::texture_2d(WIDTH, HEIGHT, Format::Depth24Plus));
    let (target_view, depth_view) = (card.create_view(target), card.create_view(depth));
    {
        let mut pass = card.begin_render_pass([], record::clear_depth(shadow_view, true));
        pass.set_pipeline(cast);
        pass.set_bind_group(0, scene_group);
        draw(&mut pass, &cube, boxes, &ball, balls);
    }
    {
        let clear = record::clear(target_view, [0.30, 0.44, 0.62, 1.0]);
        let mut pass = card.begin_render_pass([clear], record::clear_depth(depth_view, false));
        pass.set_pipeline(shade);
        pass.set_bind_group(0, scene_group);
        pass.set_bind_group(1, shadow_group);
        draw(&mut pass, &cube, boxes, &ball, balls);
    }
    card.present(target);
    card
}
