//! Particles that a program moves and the card draws.

use anyhow::Result;

use super::kit::{ADD, Draw, Kit, Pass};
use super::{Scene, SceneRun};
use crate::Row;
use gfx::format::Format;
use gfx::state::Topology;
use num::Random;
use trace::Trace;
use trace::command::BoundResource;
use trace::record;

pub(super) const FOUNTAIN: Scene = Scene {
    name: "fountain",
    group: "Light",
    what: "96 particles that a compute shader moves by 6 steps a frame, with gravity and a floor from which they rebound with half their speed, drawn as round spots that are \
           added: three frames, each within a code of f64.",
    fault: "particles rebound with all their speed",
    play,
};

const SIZE: [u32; 2] = [128, 128];
const PARTICLES: usize = 96;
const FRAMES: u32 = 3;
const STEPS: u32 = 6;

/// Place and speed in pixels and pixels per step, y up: all on a grid on which f32 is exact.
fn begin() -> Vec<[f32; 4]> {
    let mut random = Random::new(31);
    (0..PARTICLES)
        .map(|_| {
            let [x, y] = [62 + random.below(5), random.below(30)].map(|c| c as f32);
            let [u, v] = [random.between(-160, 161) as f32 / 64.0, random.between(-64, 320) as f32 / 64.0];
            [x, y, u, v]
        })
        .collect()
}

/// The spot: (1 - d^2/R^2)^2 of a colour, which is 0 and flat at its border.
const RADIUS: f64 = 5.0;
const COLOR: [f64; 3] = [0.2, 0.35, 0.5];

fn recorded(moves: bool, draws: bool, rebound: f32) -> Trace {
    let mut kit = Kit::new("fountain");
    let target = kit.target("target", SIZE, Format::Rgba8Unorm);
    let sums = kit.target("sums", SIZE, Format::Rgba16Float);
    let buffer = kit.floats("particles", begin().as_flattened());
    let particles: BoundResource = record::whole(buffer);
    let step = format!(
        "@group(0) @binding(0) var<storage, read_write> particles: array<vec4f>;
        @compute @workgroup_size(32) fn main(@builtin(global_invocation_id) id: vec3u) {{
            var p = particles[id.x];
            for (var k = 0; k < {STEPS}; k++) {{
                p.w -= 0.125;
                p.x += p.z;
                p.y += p.w;
                if p.y < 0.0 {{
                    p.y = -p.y;
                    p.w = -p.w * {rebound:?};
                }}
            }}
            particles[id.x] = p;
        }}"
    );
    let spot = "
        struct Vertex { @builtin(position) at: vec4f, @location(0) off: vec2f }
        @group(0) @binding(0) var<storage, read> particles: array<vec4f>;
        @vertex fn vs(@builtin(vertex_index) i: u32, @builtin(instance_index) k: u32) -> Vertex {
            let off = vec2f(f32(i & 1u), f32(i >> 1u)) * 12.0 - 6.0;
            let p = particles[k].xy + vec2f(0.0, 8.0) + off;
            return Vertex(vec4f(p / 64.0 - 1.0, 0.5, 1.0), off);
        }
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {
            let w = max(1.0 - dot(v.off, v.off) / 25.0, 0.0);
            return vec4f(0.2, 0.35, 0.5, 0.0) * (w * w);
        }";
    let show = "@group(0) @binding(0) var sums: texture_2d<f32>;
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
            return vec4f(textureLoad(sums, vec2u(at.xy), 0).rgb, 1.0);
        }";
    for _ in 0..FRAMES {
        if moves {
            kit.compute(&step, [particles.clone()], [PARTICLES as u32 / 32, 1, 1]);
        }
        let draw = Draw::list(spot, 0, Vec::new()).count(4).with([particles.clone()]).blend(ADD);
        let draw = Draw { instances: PARTICLES as u32, topology: Topology::TriangleStrip, ..draw };
        kit.pass(
            &Pass { color: vec![(sums, Some([0.0; 4]))], ..Pass::default() },
            if draws { std::slice::from_ref(&draw) } else { &[] },
        );
        kit.pass(&Pass { color: vec![(target, Some([0.0; 4]))], ..Pass::default() }, &[Draw::cover(show).with([sums.bound()])]);
        kit.present(target);
    }
    kit.finish()
}

fn play(stage: &mut SceneRun) -> Result<()> {
    let trace = recorded(true, true, if stage.fault() { 1.0 } else { 0.5 });
    let frames = stage.show(&trace)?;
    let mut particles: Vec<[f64; 4]> = begin().iter().map(|p| p.map(f64::from)).collect();
    let mut rebounds = 0;
    for (number, frame) in frames.iter().enumerate() {
        for p in &mut particles {
            for _ in 0..STEPS {
                p[3] -= 0.125;
                p[0] += p[2];
                p[1] += p[3];
                if p[1] < 0.0 {
                    (p[1], p[3]) = (-p[1], -p[3] * 0.5);
                    rebounds += 1;
                }
            }
        }
        let exact = |x: u32, y: u32| {
            let [x, y] = [f64::from(x) + 0.5, 120.0 - f64::from(y) - 0.5];
            let spot = |p: &[f64; 4]| {
                let square = (x - p[0]).powi(2) + (y - p[1]).powi(2);
                (1.0 - square / (RADIUS * RADIUS)).max(0.0).powi(2)
            };
            let sum: f64 = particles.iter().map(spot).sum();
            COLOR.map(|c| c * sum)
        };
        stage.row(Row::at_most(format!("frame {number}: largest difference from f64, in codes"), frame.worst(exact), 1.0));
    }
    stage.row(Row::at_least("rebounds from the floor", 20.0, f64::from(rebounds)));
    let lit = frames[0].places().filter(|&(x, y)| frames[0].rgba(x, y)[2] > 30).count();
    stage.row(Row::at_least("pixels of spots in the first frame", 1_000.0, lit as f64));
    if !stage.fault() {
        let [still, moved] = [false, true].map(|moves| stage.time(&recorded(moves, false, 0.5), &[]).map(|run| run.0));
        let (both, still, moved) = (stage.time(&trace, &[])?.0, still?, moved?);
        stage.row(Row::at_least("cycles of drawing over those of moving", 1.0, (both - moved) / (moved - still)));
        stage.answer(
            "What does it cost to move particles on the card?",
            format!("In three frames {} cycles, and to draw them {}.", moved - still, both - moved),
        );
    }
    Ok(())
}
