//! Scenes at random, which nobody has chosen: what an estimate is judged by.
//!
//! A scene is one to three passes. Their targets, samples, geometry, shaders, textures and colours are drawn independently, sizes evenly on a
//! scale of powers of two: a draw has 1 to 100,000 triangles.

use crate::scenes::kit::{Kit, OVER, Target};
use gfx::format::Format;
use gfx::state::*;
use num::Random;
use trace::Trace;
use trace::command::{AnyPipeline, BoundResource, ColorAttachment};
use trace::record::{self, Recorder};

/// Triangles of a draw, at most.
const TRIANGLES: f32 = 100_000.0;

/// Samples that a pass covers, at most, about: more would only take longer to simulate.
const SAMPLES: f32 = 3_000_000.0;

/// Functions that the shaders of all scenes have.
const COMMON: &str = "
fn scrambled(x: u32) -> u32 {
    let a = (x ^ (x >> 16u)) * 0x7feb352du;
    let b = (a ^ (a >> 15u)) * 0x846ca68bu;
    return b ^ (b >> 16u);
}
fn unit(x: u32) -> f32 { return f32(scrambled(x) >> 8u) / 16777216.0; }
struct Place { at: vec2f, depth: f32 }
";

/// A whole number from 1 to `most`, evenly by its logarithm.
fn size(random: &mut Random, most: f32) -> u32 {
    libm::expf(random.range(0.0, libm::logf(most + 1.0))) as u32
}

/// One of several things.
fn one<T: Clone>(random: &mut Random, of: &[T]) -> T {
    of[random.below(of.len() as u32) as usize].clone()
}

/// The scene of a seed.
pub fn scene(seed: u64) -> Trace {
    record(seed).finish()
}

/// The scene of a seed, as it can be saved.
pub fn record(seed: u64) -> Recorder {
    let random = &mut Random::nth(0x5ce9e, seed);
    let mut kit = Kit::new("generated");
    let window = extent(random);
    let shown = kit.target("window", window, Format::Rgba8Unorm);
    let passes = 1 + random.below(3);
    let mut before: Option<Target> = None;
    for n in 0..passes {
        let last = n + 1 == passes;
        before = Some(pass(&mut kit, random, before, last.then_some((shown, window))));
    }
    kit.present(shown);
    kit.card
}

/// Width and height of a target.
fn extent(random: &mut Random) -> [u32; 2] {
    [64 + size(random, 1200.0), 48 + size(random, 700.0)]
}

/// How the vertices of a draw are placed: a body that gives position and depth of vertex `v` of instance `i`.
fn geometry(random: &mut Random, draws: u32) -> (String, u32, f32) {
    let z = one(
        random,
        &["0.5", "unit(i * 977u + v / 3u + 5u)", "0.9 - 0.8 * f32(i % 16u) / 16.0", "0.1 + 0.8 * f32(i % 16u) / 16.0"],
    );
    match random.below(3) {
        // Triangles over the whole target.
        0 => {
            let layers = 1 + random.below(6);
            let body = "return Place(vec2f(f32((v % 3u) & 1u) * 4.0 - 1.0, f32((v % 3u) >> 1u) * 4.0 - 1.0), Z);";
            (body.replace('Z', z), 3 * layers, layers as f32 * draws as f32)
        }
        // A grid in rows.
        1 => {
            let cells = libm::sqrtf(0.5 * size(random, TRIANGLES / draws as f32) as f32).max(1.0) as u32;
            let bend = one(random, &["0.0", "0.3 * sin(at.x * 9.0 + at.y * 5.0)"]);
            let body = "
                let cell = v / 6u; let corner = array(0u, 1u, 2u, 1u, 2u, 3u)[v % 6u];
                let at = vec2f(f32(cell % CELLSu + (corner & 1u)), f32(cell / CELLSu + (corner >> 1u))) / CELLS.0 * 2.0 - 1.0;
                let moved = at * (1.0 - 0.05 * f32(i % 8u)) + vec2f(BEND, 0.0);
                return Place(moved, Z);";
            let body = body.replace("CELLS", &cells.to_string()).replace("BEND", bend).replace('Z', z);
            (body, 6 * cells * cells, draws as f32)
        }
        // Triangles anywhere, of one size.
        _ => {
            let triangles = size(random, TRIANGLES / draws as f32).max(1);
            // So large that they cover at most a few layers in all.
            let most = libm::sqrtf(8.0 / (triangles * draws) as f32).min(1.0);
            let edge = most * random.range(0.1, 1.0);
            let body = "
                let t = v / 3u + i * 7919u; let turn = f32(v % 3u) * 2.0944 + unit(t);
                let middle = vec2f(unit(t * 2u + 11u), unit(t * 2u + 12u)) * 2.0 - 1.0;
                return Place(middle + EDGE * vec2f(cos(turn), sin(turn)), Z);";
            let body = body.replace("EDGE", &format!("{edge:.5}")).replace('Z', z);
            (body, 3 * triangles, triangles as f32 * draws as f32 * edge * edge * 0.33)
        }
    }
}

/// The body of a fragment stage that gives a colour, with what it looks up.
fn shading(random: &mut Random, textures: u32) -> String {
    let mut body = one(
        random,
        &[
            "var c = vec4f(0.25, 0.5, 0.75, 0.6);",
            "var c = vec4f(v.at.xy / 1300.0, 0.5, 0.6);",
            "let n = u32(v.at.x) + u32(v.at.y) * 4099u; var c = vec4f(unit(n), unit(n + 77u), unit(n + 177u), unit(n + 277u));",
            "let n = u32(v.at.x / 9.0) + u32(v.at.y / 9.0) * 4099u; var c = vec4f(unit(n), unit(n + 77u), unit(n + 177u), 0.6);",
            "var c = vec4f(v.color, 0.7);",
        ],
    )
    .to_owned();
    for at in 0..textures {
        let scale = one(random, &["0.25", "1.0", "1.0", "3.7"]);
        body += &format!("c += textureSample(t{at}, s{at}, v.uv * {scale} + c.xy * 0.01) * 0.3;");
    }
    match random.below(4) {
        0 => {
            let steps = size(random, 40.0);
            body += &"c = fma(c, vec4f(0.98), c.yzwx * 0.02);".repeat(steps as usize);
        }
        1 => {
            let steps = size(random, 40.0);
            body += &format!(
                "for (var k = 0u; k < {steps}u; k++) {{ c = c * 0.99 + vec4f(sin(c.x), 0.001, c.z * c.y, 0.0) * 0.01; }}"
            );
        }
        2 => body += "c = vec4f(pow(abs(c.xyz), vec3f(0.45)), c.w) * inverseSqrt(dot(c, c) + 0.5);",
        _ => {}
    }
    if random.below(8) == 0 {
        body += "if (fract(v.at.x * 0.071 + v.at.y * 0.053) < 0.3) { discard; }";
    }
    body
}

/// Adds a pass, which may look up what the pass before has drawn; gives what holds its picture afterwards.
fn pass(kit: &mut Kit, random: &mut Random, before: Option<Target>, last: Option<(Target, [u32; 2])>) -> Target {
    let format = match last {
        Some(_) => Format::Rgba8Unorm,
        None => {
            one(random, &[Format::Rgba8Unorm, Format::Rgba8Unorm, Format::Rgba16Float, Format::Rgb10a2Unorm, Format::R8Unorm])
        }
    };
    let samples = if random.below(4) == 0 { 4 } else { 1 };
    let [width, height] = last.map_or_else(|| extent(random), |(_, size)| size);
    let depth = one(random, &[None, Some(Format::Depth32Float), Some(Format::Depth24PlusStencil8)]);
    let target = |kit: &mut Kit, format| kit.texture("target", record::texture_multisampled(width, height, samples, format));
    let single = match last {
        Some((shown, _)) => shown,
        None => kit.target("picture", [width, height], format),
    };
    let drawn = if samples > 1 { target(kit, format) } else { single };
    let depths = depth.map(|format| target(kit, format));

    let pixels = (width * height * samples) as f32;
    let mut left = SAMPLES;
    let mut made = Vec::new();
    for _ in 0..1 + random.below(3) {
        let draws = if random.below(3) == 0 { size(random, 400.0) } else { 1 };
        let (body, vertices, layers) = geometry(random, draws);
        // What would take too long is left out.
        left -= layers * pixels;
        if left < 0.0 && !made.is_empty() {
            break;
        }
        let mut resources: Vec<BoundResource> = Vec::new();
        let mut source = COMMON.to_owned();
        let textures = [0, 0, 1, 1, 2, 3][random.below(6) as usize];
        for at in 0..textures {
            let texture = match before {
                Some(before) if at == 0 && before.format != Format::Depth32Float => before,
                _ => noise(kit, random),
            };
            let filter = one(random, &[FilterMode::Linear, FilterMode::Linear, FilterMode::Nearest]);
            let sampler = SamplerDesc { mag: filter, min: filter, mipmap: filter, ..record::trilinear_repeat() };
            resources.extend([texture.bound(), kit.sampler(sampler)]);
            let (first, second) = (2 * at, 2 * at + 1);
            source += &format!(
                "@group(0) @binding({first}) var t{at}: texture_2d<f32>; @group(0) @binding({second}) var s{at}: sampler;\n"
            );
        }
        let work = if random.below(3) == 0 {
            let steps = size(random, 30.0);
            format!(
                "var w = vec4f(p.at, p.depth, 1.0); for (var k = 0u; k < {steps}u; k++) {{ w = w * 0.999 + w.yzwx * 0.001; }} color += w.xyz * 0.001;"
            )
        } else {
            String::new()
        };
        let fragment = shading(random, textures);
        source += &format!(
            "struct V {{ @builtin(position) at: vec4f, @location(0) uv: vec2f, @location(1) color: vec3f }}
             fn place(v: u32, i: u32) -> Place {{ {body} }}
             @vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32, @location(0) tint: vec4f) -> V {{
                 let p = place(v, i); var color = tint.xyz * vec3f(unit(v), unit(v + 5u), unit(v + 9u));
                 {work}
                 return V(vec4f(p.at, p.depth, 1.0), p.at * 0.5 + 0.5, color);
             }}
             @fragment fn fs(v: V) -> @location(0) vec4f {{ {fragment} return c; }}"
        );
        let shader = kit.card.create_shader("program", &source);
        let mut desc = record::render_pipeline(shader, format);
        desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x4)])];
        let blend = (random.below(4) == 0).then_some(OVER);
        desc.targets = vec![Some(ColorTarget { blend, ..record::target(format) })];
        desc.multisample.count = samples;
        let compare = one(random, &[Compare::LessEqual, Compare::LessEqual, Compare::Always, Compare::GreaterEqual]);
        let test = |format| DepthStencil { depth_compare: compare, depth_write: blend.is_none(), ..record::depth_less(format) };
        desc.depth_stencil = depth.map(test);
        desc.primitive.cull_mode = one(random, &[CullMode::None, CullMode::None, CullMode::Back]);
        let pipeline = kit.card.create_render_pipeline("", desc);
        let group = (!resources.is_empty()).then(|| {
            let layout = kit.card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
            kit.card.create_bind_group(layout, (0..).zip(resources))
        });
        let tints: Vec<f32> = (0..4 * vertices).map(|n| 0.5 + 0.5 * (n % 7) as f32 / 7.0).collect();
        made.push((pipeline, group, kit.floats("tints", &tints), vertices, draws));
    }
    let color =
        ColorAttachment { resolve: (samples > 1).then_some(single.view), ..record::clear(drawn.view, [0.1, 0.2, 0.3, 1.0]) };
    let store = random.below(2) == 0;
    let depth = depths.and_then(|depths| record::clear_depth(depths.view, store));
    let mut open = kit.card.begin_render_pass([color], depth);
    for (pipeline, group, tints, vertices, draws) in made {
        open.set_pipeline(pipeline);
        if let Some(group) = group {
            open.set_bind_group(0, group);
        }
        open.set_vertex_buffer(0, tints);
        for draw in 0..draws {
            open.draw_from(vertices, 1, 0, draw);
        }
    }
    drop(open);
    single
}

/// A texture of noise, or of one colour, with all levels.
fn noise(kit: &mut Kit, random: &mut Random) -> Target {
    let format =
        one(random, &[Format::Rgba8Unorm, Format::Rgba8Unorm, Format::Bc1RgbaUnorm, Format::Rgba16Float, Format::R8Unorm]);
    let edge = 8_u32 << random.below(7);
    let levels = edge.ilog2() + 1;
    let levels = if format.block_dim() > 1 { levels - 2 } else { levels };
    let texture = kit.texture("texture", record::texture_mipped(edge, edge, levels, format));
    let mask = one(random, &[0x3f, 0x3f, 0x01, 0x00]);
    for level in 0..levels {
        let blocks = (edge >> level).max(1).div_ceil(format.block_dim());
        let bytes: Vec<u8> = (0..blocks * blocks * format.block_bytes()).map(|_| (random.bits() & mask) as u8).collect();
        kit.card.write_level(texture.texture, level, "noise", &bytes);
    }
    texture
}
