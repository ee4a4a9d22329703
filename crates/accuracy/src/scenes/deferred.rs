//! Light on what is drawn, or on what is seen.

use anyhow::Result;

use super::kit::{Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Compare;
use trace::Trace;

pub(super) const DEFERRED: Scene = Scene {
    name: "deferred",
    group: "Light",
    what: "Layers of slanted squares under eight point lights: shaded when they are drawn (forward), or once for each pixel from colours, heights and slopes that were stored as \
           f32 (deferred). Both are within a code of f64.",
    fault: "the deferred pass leaves out a light",
    play,
};

const SIZE: [u32; 2] = [64, 64];
const LIGHTS: u32 = 8;

/// The slope of a layer along x.
fn slope(layer: u32) -> f64 {
    0.25 * f64::from(layer % 4)
}

/// Lights: f32 is exact.
const LIT: &str = "
fn lit(p: vec3f, slope: f32, color: vec3f) -> vec3f {
    let n = normalize(vec3f(-slope, 0.0, 1.0));
    var sum = 0.05;
    for (var k = 0u; k < COUNT; k++) {
        let to = vec3f(f32(k % 4u) * 0.5 - 0.75, f32(k / 4u) - 0.5, 3.0) - p;
        let d = length(to);
        sum += 0.5 * max(dot(n, to / d), 0.0) / (1.0 + d * d);
    }
    return sum * color;
}
fn height(layer: u32, x: f32) -> f32 { return 0.125 * f32(layer) + 0.25 * f32(layer % 4u) * x; }
fn tint(layer: u32) -> vec3f { return vec3f(1.0, 0.5 + 0.0625 * f32(layer % 8u), 0.25 + 0.25 * f32(layer % 3u)); }
";

/// Layers from far to near, or from near to far: each covers all.
fn layers(order: &[u32], fragment: &str) -> Draw {
    let source = format!(
        "struct Vertex {{ @builtin(position) at: vec4f, @location(0) @interpolate(flat) layer: f32 }}
        @vertex fn vs(@location(0) at: vec4f) -> Vertex {{ return Vertex(vec4f(at.xyz, 1.0), at.w); }}
        {fragment}"
    );
    let corners = [[-1.0, -1.0], [3.0, -1.0], [-1.0, 3.0]];
    let vertices = order
        .iter()
        .flat_map(|&layer| corners.iter().flat_map(move |&[x, y]: &[f32; 2]| [x, y, 0.9 - layer as f32 / 32.0, layer as f32]));
    Draw::list(source, 1, vertices.collect()).depth(Format::Depth32Float, Compare::Less)
}

fn forward(order: &[u32]) -> Trace {
    let mut kit = Kit::new("forward");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let fragment = format!(
        "{LIT} @fragment fn fs(v: Vertex) -> @location(0) vec4f {{
            let xy = v.at.xy / 32.0 - 1.0;
            let layer = u32(v.layer);
            return vec4f(lit(vec3f(xy, height(layer, xy.x)), 0.25 * f32(layer % 4u), tint(layer)), 1.0);
        }}"
    );
    let pass = Pass { color: vec![(target, Some([0.0; 4]))], depth: Some((depth, Some((1.0, 0)))), ..Pass::default() };
    kit.pass(&pass, &[layers(order, &fragment.replace("COUNT", "8u"))]);
    kit.present(target);
    kit.finish()
}

fn deferred(order: &[u32], fault: bool) -> Trace {
    let mut kit = Kit::new("deferred");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let depth = kit.target("depth", SIZE, Format::Depth32Float);
    let stored = kit.target("heights", SIZE, Format::Rg32Float);
    let color = kit.target("colors", SIZE, Format::Rgba16Float);
    let fragment = format!(
        "{LIT} struct Out {{ @location(0) stored: vec4f, @location(1) color: vec4f }}
        @fragment fn fs(v: Vertex) -> Out {{
            let layer = u32(v.layer);
            let x = v.at.x / 32.0 - 1.0;
            return Out(vec4f(height(layer, x), 0.25 * f32(layer % 4u), 0.0, 0.0), vec4f(tint(layer), 1.0));
        }}"
    );
    let pass = Pass {
        color: vec![(stored, Some([0.0; 4])), (color, Some([0.0; 4]))],
        depth: Some((depth, Some((1.0, 0)))),
        ..Pass::default()
    };
    kit.pass(&pass, &[layers(order, &fragment.replace("COUNT", "8u"))]);
    let light = format!(
        "{LIT} @group(0) @binding(0) var stored: texture_2d<f32>;
        @group(0) @binding(1) var colors: texture_2d<f32>;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
            let own = textureLoad(stored, vec2u(at.xy), 0).xy;
            return vec4f(lit(vec3f(at.xy / 32.0 - 1.0, own.x), own.y, textureLoad(colors, vec2u(at.xy), 0).rgb), 1.0);
        }}"
    );
    let light = light.replace("COUNT", if fault { "7u" } else { "8u" });
    kit.pass(
        &Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() },
        &[Draw::cover(&light).with([stored.bound(), color.bound()])],
    );
    kit.present(target);
    kit.finish()
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let order = |layers: u32| (0..layers).collect::<Vec<u32>>();
    let stored = stage.show(&deferred(&order(8), stage.fault()))?;
    let drawn = stage.frames(&forward(&order(8)))?;
    let exact = |x: u32, y: u32| {
        let layer = 7;
        let [px, py] = [x, y].map(|c| (f64::from(c) + 0.5) / 32.0 - 1.0);
        let slope = slope(layer);
        let p = [px, py, 0.125 * f64::from(layer) + slope * px];
        let steep = (1.0 + slope * slope).sqrt();
        let light = |k: u32| {
            let to = [f64::from(k % 4) * 0.5 - 0.75 - p[0], f64::from(k / 4) - 0.5 - p[1], 3.0 - p[2]];
            let square = to.iter().map(|c| c * c).sum::<f64>();
            0.5 * ((to[2] - slope * to[0]) / steep / square.sqrt()).max(0.0) / (1.0 + square)
        };
        let sum = 0.05 + (0..LIGHTS).map(light).sum::<f64>();
        [1.0, 0.5 + 0.0625 * f64::from(layer % 8), 0.25 + 0.25 * f64::from(layer % 3)].map(|c| c * sum)
    };
    stage.row(Row::at_most("forward: largest difference from f64, in codes", drawn[0].worst(exact), 1.0));
    stage.row(Row::at_most("deferred: largest difference from f64, in codes", stored[0].worst(exact), 1.0));
    if !stage.fault() {
        // From back to front, so that all layers are shaded: what deferred shading is for.
        let mut told = Vec::new();
        let mut ratios = Vec::new();
        for count in [1, 2, 4, 8, 16] {
            let (one, other) =
                (stage.time(&forward(&order(count)), &[])?.0, stage.time(&deferred(&order(count), false), &[])?.0);
            told.push(format!("{count} layers {one} against {other}"));
            ratios.push(one / other);
        }
        let mut reversed = order(16);
        reversed.reverse();
        let (one, other) = (stage.time(&forward(&reversed), &[])?.0, stage.time(&deferred(&reversed, false), &[])?.0);
        stage.row(Row::at_least("one layer: cycles of deferred over forward", 1.0, 1.0 / ratios[0]));
        stage.row(Row::at_least("16 layers from back to front: cycles of forward over deferred", 1.0, ratios[4]));
        stage.row(Row::at_least("16 layers from front to back: cycles of deferred over forward", 1.0, other / one));
        stage.answer(
            "Forward or deferred shading?",
            format!(
                "In cycles, forward against deferred, from back to front: {}. From front to back the depth test does what deferring does: 16 layers {one} against {other}.",
                told.join(", ")
            ),
        );
    }
    Ok(())
}
