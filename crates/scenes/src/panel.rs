//! A panel of dials, four frames of which only some needles move. Like many programs it wipes its target in a pass of its own before
//! the pass that clears it, and ends every frame with a pass for notices, of which there are none.

use std::f64::consts::TAU;

use gfx::format::Format;
use gfx::state::*;
use trace::command::BoundResource;
use trace::record::{self, Recorder};

use crate::maths::*;
use crate::pixels::*;

const WIDTH: u32 = 256;
const HEIGHT: u32 = 192;
const FRAMES: u32 = 4;
const DIALS: u32 = 12;

/// A rectangle: its centre, and the ways from there to its right and lower edge, in pixels.
struct Part {
    center: [f64; 2],
    right: [f64; 2],
    down: [f64; 2],
    color: DVec3,
}

impl Part {
    /// 28 bytes: three times float32x2, and a colour as unorm8x4.
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = floats([self.center, self.right, self.down].into_iter().flatten());
        bytes.extend(self.color.extend(1.0).to_array().map(unorm8));
        bytes
    }
}

fn grain(u: f64, v: f64) -> [f64; 4] {
    let value = turbulence(61, u * 8.0, v * 8.0, 4);
    [value, value, value, 1.0]
}

fn place(dial: u32) -> [f64; 2] {
    [32.0 + 64.0 * f64::from(dial % 4), 32.0 + 64.0 * f64::from(dial / 4)]
}

fn dial(dial: u32) -> Part {
    let color = mix(dvec3(0.93, 0.90, 0.82), dvec3(0.62, 0.74, 0.80), uniform(63, dial, 0));
    Part { center: place(dial), right: [26.0, 0.0], down: [0.0, 26.0], color }
}

/// Three needles move.
fn needle(dial: u32, frame: u32) -> Part {
    let speed = if matches!(dial, 0 | 7 | 9) { 0.06 + 0.1 * uniform(63, dial, 1) } else { 0.0 };
    let turn = TAU * (uniform(63, dial, 2) + speed * f64::from(frame));
    let (s, c) = (libm::sin(turn), libm::cos(turn));
    let [x, y] = place(dial);
    // It turns around a point near its thick end.
    let center = [x + 6.5 * c, y + 6.5 * s];
    Part { center, right: [10.5 * c, 10.5 * s], down: [-1.75 * s, 1.75 * c], color: dvec3(0.80, 0.10, 0.08) }
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("panel");
    let plate = Part { center: [128.0, 96.0], right: [128.0, 0.0], down: [0.0, 96.0], color: dvec3(0.46, 0.48, 0.52) };
    let still: Vec<u8> = std::iter::once(plate).chain((0..DIALS).map(dial)).flat_map(|part| part.bytes()).collect();
    let still = card.create_buffer_init("plate and dials", &still);
    let needles = card.create_buffer("needles", u64::from(DIALS) * 28);
    let (_, image) = mipped_texture(&mut card, "grain", &[Image::paint(64, grain)], false);
    let sampler = card.create_sampler(record::trilinear_repeat());
    let layout = card.create_bind_group_layout([(0, record::TEXTURE), (1, record::SAMPLER)]);
    let group = card.create_bind_group(layout, [(0, BoundResource::View(image)), (1, BoundResource::Sampler(sampler))]);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);
    let shader = card.create_shader("panel", include_str!("panel.wgsl"));
    let over = BlendComponent { src: BlendFactor::One, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add };
    let mut pipeline = |entry: &str, blend: Option<Blend>| {
        let mut desc = record::render_pipeline(shader, Format::Rgba8UnormSrgb);
        desc.layout = Some(pipeline_layout);
        desc.primitive.topology = Topology::TriangleStrip;
        desc.buffers = vec![record::instance_buffer(&[
            (0, VertexFormat::Float32x2),
            (1, VertexFormat::Float32x2),
            (2, VertexFormat::Float32x2),
            (3, VertexFormat::Unorm8x4),
        ])];
        desc.fragment = Some(record::stage_entry(shader, entry));
        desc.targets = vec![Some(ColorTarget { blend, ..record::target(Format::Rgba8UnormSrgb) })];
        card.create_render_pipeline(entry, desc)
    };
    let blend = Some(Blend { color: over, alpha: over });
    let (plate, dial, pointer) = (pipeline("plate", None), pipeline("dial", blend), pipeline("needle", blend));

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8UnormSrgb));
    let view = card.create_view(target);
    for frame in 0..FRAMES {
        let turned: Vec<u8> = (0..DIALS).flat_map(|dial| needle(dial, frame).bytes()).collect();
        card.write_buffer(needles, 0, &format!("needles-{frame}"), &turned);
        drop(card.begin_render_pass([record::clear(view, [0.0; 4])], None));
        let mut pass = card.begin_render_pass([record::clear(view, [0.0, 0.0, 0.0, 1.0])], None);
        pass.set_bind_group(0, group);
        pass.set_pipeline(plate);
        pass.set_vertex_buffer(0, still);
        pass.draw(4, 1);
        pass.set_pipeline(dial);
        pass.draw_from(4, DIALS, 0, 1);
        pass.set_pipeline(pointer);
        pass.set_vertex_buffer(0, needles);
        pass.draw(4, DIALS);
        drop(pass);
        drop(card.begin_render_pass([record::load(view)], None));
        card.present(target);
    }
    card
}
