//! Alpha-blended sprites from an atlas, back to front, over a gradient: soft clouds, then leaves, then additive sparks.

use std::f64::consts::TAU;

use gfx::format::Format;
use gfx::state::*;
use trace::command::BoundResource;
use trace::record::{self, Recorder};

use crate::maths::*;
use crate::pixels::*;

const WIDTH: u32 = 640;
const HEIGHT: u32 = 480;

const OVER: Blend = Blend {
    color: BlendComponent { src: BlendFactor::One, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add },
    alpha: BlendComponent { src: BlendFactor::One, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add },
};

const ADD: Blend = Blend {
    color: BlendComponent { src: BlendFactor::SrcAlpha, dst: BlendFactor::One, op: BlendOp::Add },
    alpha: BlendComponent { src: BlendFactor::Zero, dst: BlendFactor::One, op: BlendOp::Add },
};

/// Four cells, each half the atlas wide: cloud, leaf, spark, ring; premultiplied alpha.
fn atlas(u: f64, v: f64) -> [f64; 4] {
    let (right, lower) = (u >= 0.5, v >= 0.5);
    let (x, y) = ((u * 2.0).fract() * 2.0 - 1.0, (v * 2.0).fract() * 2.0 - 1.0);
    let radius = (x * x + y * y).sqrt();
    let (value, alpha) = match (right, lower) {
        (false, false) => {
            let puff = turbulence(31, x * 0.5 + 0.5, y * 0.5 + 0.5, 4);
            (0.75 + 0.25 * puff, (1.0 - ramp(0.1, 0.95, radius)) * ramp(0.2, 0.75, puff + 0.25 * (1.0 - radius)))
        }
        (true, false) => {
            // Two arcs and a midrib.
            let inside = (x * x + (y.abs() + 0.75) * (y.abs() + 0.75)).sqrt();
            let rib = 1.0 - ramp(0.0, 0.05, y.abs());
            let veins = 0.5 + 0.5 * libm::cos(14.0 * (x - y.abs() * 0.8));
            (0.55 + 0.25 * veins * (1.0 - rib) + 0.4 * rib, 1.0 - ramp(1.15, 1.19, inside))
        }
        (false, true) => {
            let glow = libm::exp(-radius * radius * 9.0);
            let rays = (1.0 - ramp(0.0, 0.25, (x * y).abs() * 6.0)) * (1.0 - ramp(0.2, 0.95, radius));
            (1.0, (glow + 0.5 * rays).min(1.0) * (1.0 - ramp(0.8, 0.98, radius)))
        }
        (true, true) => {
            (1.0, ramp(0.62, 0.72, radius) * (1.0 - ramp(0.82, 0.92, radius)) + 0.15 * (1.0 - ramp(0.6, 0.7, radius)))
        }
    };
    [value * alpha, value * alpha, value * alpha, alpha]
}

/// A sprite: centre and half size in pixels, rotation in radians, cell of the atlas, colour, opacity.
struct Sprite {
    center: [f64; 2],
    size: f64,
    turn: f64,
    cell: u8,
    color: DVec3,
    opacity: f64,
}

impl Sprite {
    /// 20 bytes: centre as float32x2, the two axes as snorm16x2 of 512 pixels, colour and opacity as unorm8x4, cell as uint8x4.
    fn bytes(&self) -> Vec<u8> {
        let mut bytes = floats(self.center);
        let (s, c) = (libm::sin(self.turn), libm::cos(self.turn));
        bytes.extend([self.size * c / 512.0, self.size * s / 512.0].iter().flat_map(|&v| snorm16(v).to_le_bytes()));
        bytes.extend(self.color.extend(self.opacity).to_array().map(unorm8));
        bytes.extend([self.cell, 0, 0, 0]);
        bytes
    }
}

fn sprites() -> (Vec<Sprite>, Vec<Sprite>) {
    let mut over = Vec::new();
    for i in 0..60 {
        let r = |channel| uniform(37, i, channel);
        let depth = f64::from(i) / 60.0;
        over.push(Sprite {
            center: [r(0) * 760.0 - 60.0, 140.0 + 300.0 * depth + 60.0 * r(1)],
            size: 60.0 + 90.0 * r(2) + 40.0 * depth,
            turn: TAU * r(3),
            cell: 0,
            color: mix(dvec3(0.95, 0.62, 0.52), dvec3(0.42, 0.36, 0.62), depth),
            opacity: 0.30 + 0.35 * r(4),
        });
    }
    for i in 0..140 {
        let r = |channel| uniform(41, i, channel);
        over.push(Sprite {
            center: [r(0) * 660.0 - 10.0, r(1) * 500.0 - 10.0],
            size: 9.0 + 26.0 * r(2) * r(2),
            turn: TAU * r(3),
            cell: 1,
            color: mix(mix(dvec3(0.93, 0.55, 0.12), dvec3(0.80, 0.16, 0.10), r(4)), dvec3(0.55, 0.62, 0.18), r(5) * r(5)),
            opacity: 0.75 + 0.25 * r(6),
        });
    }
    let mut add = Vec::new();
    for i in 0..110 {
        let r = |channel| uniform(43, i, channel);
        let ring = i % 7 == 0;
        add.push(Sprite {
            center: [r(0) * 640.0, r(1) * 480.0],
            size: if ring { 14.0 + 40.0 * r(2) } else { 5.0 + 22.0 * r(2) * r(2) },
            turn: 0.785 * r(3),
            cell: if ring { 3 } else { 2 },
            color: mix(dvec3(1.0, 0.86, 0.55), dvec3(0.75, 0.85, 1.0), r(4)),
            opacity: if ring { 0.18 } else { 0.35 + 0.6 * r(5) },
        });
    }
    (over, add)
}

pub fn record() -> Recorder {
    let mut card = Recorder::new("sprites");
    let (over, add) = sprites();
    let bytes: Vec<u8> = over.iter().chain(&add).flat_map(Sprite::bytes).collect();
    let instances = card.create_buffer_init("instances", &bytes);
    let (_, image) = mipped_texture(&mut card, "atlas", &[Image::paint(128, atlas)], false);
    let sampler = card.create_sampler(SamplerDesc { address: [AddressMode::ClampToEdge; 3], ..record::trilinear_repeat() });
    let layout = card.create_bind_group_layout([(0, record::TEXTURE), (1, record::SAMPLER)]);
    let group = card.create_bind_group(layout, [(0, BoundResource::View(image)), (1, BoundResource::Sampler(sampler))]);
    let pipeline_layout = card.create_pipeline_layout([layout], 0);

    let backdrop = card.create_shader("backdrop", include_str!("backdrop.wgsl"));
    let backdrop = card.create_render_pipeline("backdrop", record::render_pipeline(backdrop, Format::Rgba8Unorm));
    let shader = card.create_shader("sprites", include_str!("sprites.wgsl"));
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.layout = Some(pipeline_layout);
    desc.primitive.topology = Topology::TriangleStrip;
    desc.buffers = vec![record::instance_buffer(&[
        (0, VertexFormat::Float32x2),
        (1, VertexFormat::Snorm16x2),
        (2, VertexFormat::Unorm8x4),
        (3, VertexFormat::Uint8x4),
    ])];
    desc.fragment = Some(record::stage_entry(shader, "over"));
    desc.targets = vec![Some(ColorTarget { blend: Some(OVER), ..record::target(Format::Rgba8Unorm) })];
    let over_pipeline = card.create_render_pipeline("over", desc.clone());
    desc.fragment = Some(record::stage_entry(shader, "add"));
    desc.targets = vec![Some(ColorTarget { blend: Some(ADD), ..record::target(Format::Rgba8Unorm) })];
    let add_pipeline = card.create_render_pipeline("add", desc);

    let target = card.create_texture("target", record::texture_2d(WIDTH, HEIGHT, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let mut pass = card.begin_render_pass([record::clear(view, [0.0, 0.0, 0.0, 1.0])], None);
    pass.set_pipeline(backdrop);
    pass.draw(3, 1);
    pass.set_pipeline(over_pipeline);
    pass.set_bind_group(0, group);
    pass.set_vertex_buffer(0, instances);
    pass.draw(4, over.len() as u32);
    pass.set_pipeline(add_pipeline);
    pass.draw_from(4, add.len() as u32, 0, over.len() as u32);
    drop(pass);
    card.present(target);
    card
}
