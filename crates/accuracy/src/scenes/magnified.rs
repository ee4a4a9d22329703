//! Sprites that are magnified: what their edges become.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::stage::Image;
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::{FilterMode, SamplerDesc};
use trace::record;

pub(super) const MAGNIFIED: Scene = Scene {
    name: "magnified",
    group: "Transparency",
    what: "A disc in 16 by 16 texels, magnified eight times behind an alpha test of a half (Green, Improved Alpha-Tested Magnification, 2007): pixels are those of f64. With \
           coverage in the texels and a bilinear filter the edge is within an eighth of a texel of the circle; with opaque and transparent texels alone, or without the \
           filter, it is more than a third of one off.",
    fault: "the first frame is not filtered",
    play,
};

/// Texels and pixels each way, and the disc: centre and radius in texels.
const TEXELS: u32 = 16;
const SIZE: [u32; 2] = [128, 128];
const CENTRE: [f64; 2] = [8.1, 7.9];
const RADIUS: f64 = 5.3;

const SOURCE: &str = "
struct Vertex { @builtin(position) at: vec4f, @location(0) uv: vec2f }
@group(0) @binding(0) var disc: texture_2d<f32>;
@group(0) @binding(1) var s: sampler;
@vertex fn vs(@builtin(vertex_index) i: u32) -> Vertex {
    let corner = vec2f(f32(i & 1u), f32(i >> 1u)) * 2.0;
    return Vertex(vec4f(corner.x * 2.0 - 1.0, 1.0 - corner.y * 2.0, 0.5, 1.0), corner);
}
@fragment fn fs(v: Vertex) -> @location(0) vec4f {
    let color = textureSample(disc, s, v.uv);
    if color.a < 0.5 { discard; }
    return vec4f(color.rgb, 1.0);
}";

/// How far a place in texels is outside of the circle.
fn outside([x, y]: [f64; 2]) -> f64 {
    (x - CENTRE[0]).hypot(y - CENTRE[1]) - RADIUS
}

/// The alpha of a texel: the share of it that the disc covers, or all or nothing by its centre.
fn alpha(u: u32, v: u32, coverage: bool) -> u8 {
    const PARTS: u32 = 64;
    if !coverage {
        return if outside([f64::from(u) + 0.5, f64::from(v) + 0.5]) < 0.0 { 255 } else { 0 };
    }
    let part = |corner: u32, part: u32| f64::from(corner) + (f64::from(part) + 0.5) / f64::from(PARTS);
    let inside = (0..PARTS * PARTS).filter(|i| outside([part(u, i % PARTS), part(v, i / PARTS)]) < 0.0).count();
    (255.0 * inside as f64 / f64::from(PARTS * PARTS)).round() as u8
}

/// The alphas of all texels, row by row.
fn alphas(coverage: bool) -> Vec<u8> {
    (0..TEXELS * TEXELS).map(|texel| alpha(texel % TEXELS, texel / TEXELS, coverage)).collect()
}

/// The alpha of a pixel in f64.
fn sampled(alphas: &[u8], x: u32, y: u32, linear: bool) -> f64 {
    let scale = f64::from(SIZE[0] / TEXELS);
    let place = [x, y].map(|c| (f64::from(c) + 0.5) / scale);
    // The disc does not reach the edge, so it does not matter what is beyond.
    let of = |u: f64, v: f64| {
        let [u, v] = [u, v].map(|c| c.clamp(0.0, f64::from(TEXELS - 1)) as usize);
        f64::from(alphas[v * TEXELS as usize + u]) / 255.0
    };
    if !linear {
        return of(place[0].floor(), place[1].floor());
    }
    let [a, b] = place.map(|c| (c - 0.5).floor());
    let [p, q] = [place[0] - 0.5 - a, place[1] - 0.5 - b];
    (1.0 - q) * ((1.0 - p) * of(a, b) + p * of(a + 1.0, b)) + q * ((1.0 - p) * of(a, b + 1.0) + p * of(a + 1.0, b + 1.0))
}

/// How far the edge of what was drawn is from the circle at most, in texels: between neighbours of which one was drawn, half a pixel aside.
fn farthest(image: &Image) -> f64 {
    let drawn = |x: u32, y: u32| image.rgba(x, y)[1] > 0;
    let scale = f64::from(SIZE[0] / TEXELS);
    let mut most = 0.0_f64;
    for (x, y) in image.places() {
        for [i, j] in [[1, 0], [0, 1]] {
            let [other_x, other_y] = [x + i, y + j];
            if other_x < SIZE[0] && other_y < SIZE[1] && drawn(x, y) != drawn(other_x, other_y) {
                let edge = [x + other_x, y + other_y].map(|sum| (0.5 * f64::from(sum) + 0.5) / scale);
                most = most.max(outside(edge).abs() - 0.5 / scale);
            }
        }
    }
    most
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let mut kit = Kit::new("magnified");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let alphas = [alphas(true), alphas(false)];
    let discs = alphas.each_ref().map(|alphas| {
        let disc = kit.texture("disc", record::texture_2d(TEXELS, TEXELS, Format::Rgba8Unorm));
        let texels: Vec<u8> = alphas.iter().flat_map(|&alpha| [40, 160, 220, alpha]).collect();
        kit.card.write_level(disc.texture, 0, "disc", &texels);
        disc
    });
    let cases = [("coverage, filtered", 0, true), ("all or nothing, filtered", 1, true), ("coverage, not filtered", 0, false)];
    for (frame, (_, disc, linear)) in cases.into_iter().enumerate() {
        let linear = linear && !(stage.fault() && frame == 0);
        let filter = if linear { FilterMode::Linear } else { FilterMode::Nearest };
        let sampler = kit.sampler(SamplerDesc { mag: filter, min: filter, ..SamplerDesc::default() });
        let board = Draw::list(SOURCE, 0, Vec::new()).count(3).with([discs[disc].bound(), sampler]);
        kit.pass(&Pass { color: vec![(target, Some([0.0, 0.0, 0.0, 1.0]))], ..Pass::default() }, &[board]);
        kit.present(target);
    }
    let frames = stage.show(&kit.finish())?;
    for (frame, (name, disc, linear)) in frames.iter().zip(cases) {
        let wrong = |&(x, y): &(u32, u32)| {
            let alpha = sampled(&alphas[disc], x, y, linear);
            (alpha - 0.5).abs() > 1.0 / 256.0 && (alpha >= 0.5) != (frame.rgba(x, y)[1] > 0)
        };
        let wrong = frame.places().filter(wrong).count() as u64;
        stage.row(Row::none(format!("{name}: pixels that are not as f64 has them"), wrong));
    }
    stage.row(Row::at_most("coverage, filtered: texels from the circle at most", farthest(&frames[0]), 0.125));
    stage.row(Row::at_least("all or nothing, filtered: texels from the circle at most", 0.333, farthest(&frames[1])));
    stage.row(Row::at_least("coverage, not filtered: texels from the circle at most", 0.333, farthest(&frames[2])));
    Ok(())
}
