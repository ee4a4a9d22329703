//! Generated sequences of any length: what lives on from frame to frame differs from kind to kind.

use crate::scenes::kit::OVER;
use gfx::format::Format;
use gfx::state::*;
use num::{BindGroupId, RenderPipelineId};
use trace::command::{AnyPipeline, BoundResource, RenderPipelineDesc};
use trace::record::{self, Recorder};

/// A kind of sequence.
#[derive(Clone, Copy, Debug)]
pub struct Sequence {
    /// Its name.
    pub name: &'static str,
    /// What lives on in it.
    pub what: &'static str,
    /// Records the given number of frames.
    pub record: fn(u32) -> Recorder,
}

/// All kinds.
pub const SEQUENCES: [Sequence; 3] = [
    Sequence { name: "interface", what: "a window that is loaded, of which each frame draws a part anew", record: interface },
    Sequence { name: "swarm", what: "particles in a storage buffer, and a picture that fades", record: swarm },
    Sequence { name: "shadow-once", what: "a shadow map that the first frame draws", record: shadow_once },
];

const SIZE: [u32; 2] = [320, 240];
const WINDOW: Format = Format::Rgba8Unorm;

/// A pipeline with derived layouts, and its group 0.
fn pipeline(
    card: &mut Recorder,
    source: &str,
    change: impl FnOnce(&mut RenderPipelineDesc),
    resources: &[BoundResource],
) -> (RenderPipelineId, Option<BindGroupId>) {
    let shader = card.create_shader("program", source);
    let mut desc = record::render_pipeline(shader, WINDOW);
    desc.vertex = record::stage_entry(shader, "vs");
    desc.fragment = Some(record::stage_entry(shader, "fs"));
    change(&mut desc);
    let pipeline = card.create_render_pipeline("", desc);
    let group = (!resources.is_empty()).then(|| {
        let layout = card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
        card.create_bind_group(layout, (0..).zip(resources.iter().cloned()))
    });
    (pipeline, group)
}

/// Glyphs and panels: a strip of the window is scrolled on in each frame, the rest stays.
fn interface(frames: u32) -> Recorder {
    const SOURCE: &str = "
        var<immediate> frame: u32;
        @group(0) @binding(0) var glyphs: texture_2d<f32>;
        @group(0) @binding(1) var filtered: sampler;
        struct Vertex { @builtin(position) at: vec4f, @location(0) uv: vec2f, @location(1) color: vec4f }
        @vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Vertex {
            let corner = vec2f(f32(v & 1u), f32(v >> 1u));
            // The first quad is the ground of the strip; glyphs follow, 30 a line.
            let place = vec2f(f32((i + 29u) % 30u), f32((i + 29u) / 30u) - 1.0);
            let scrolled = (place.y * 15.0 + f32(frame * 3u % 15u)) / 120.0;
            let strip = f32(frame % 4u) * 0.5 - 1.0;
            let at = select(vec2f(place.x / 15.5 - 0.97, strip + scrolled * 0.25), vec2f(-1.0, strip), i == 0u);
            let size = select(vec2f(0.055, 0.028), vec2f(2.0, 0.5), i == 0u);
            let glyph = (i * 2654435761u + frame * 40503u) >> 26u;
            let uv = (vec2f(f32(glyph & 7u), f32(glyph >> 3u)) + corner) / 8.0;
            let color = select(vec4f(1.0, 0.9, 0.6, 0.9), vec4f(0.1, 0.12, 0.2 + f32(frame % 8u) * 0.02, 1.0), i == 0u);
            return Vertex(vec4f(at + corner * size, 0.5, 1.0), uv, color);
        }
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {
            let texel = textureSample(glyphs, filtered, v.uv);
            return vec4f(v.color.rgb, v.color.a * select(texel.r, 1.0, v.color.a == 1.0));
        }";
    let mut card = Recorder::new("interface");
    let glyphs = card.create_texture("glyphs", record::texture_2d(128, 128, Format::R8Unorm));
    let ink = |at: u32| if (at % 16 * 7 + at / 128 % 16 * 5 + at / 16 * 3) % 11 < 5 { 255 } else { 0 };
    card.write_level(glyphs, 0, "glyphs", &(0..128 * 128).map(ink).collect::<Vec<u8>>());
    let view = card.create_view(glyphs);
    let sampler = card.create_sampler(record::trilinear_repeat());
    let resources = [BoundResource::View(view), BoundResource::Sampler(sampler)];
    let strip = |desc: &mut RenderPipelineDesc| {
        desc.primitive.topology = Topology::TriangleStrip;
        desc.targets = vec![Some(ColorTarget { blend: Some(OVER), ..record::target(WINDOW) })];
    };
    let (glyph, group) = pipeline(&mut card, SOURCE, strip, &resources);
    let window = card.create_texture("window", record::texture_2d(SIZE[0], SIZE[1], WINDOW));
    let view = card.create_view(window);
    for frame in 0..frames {
        let color = if frame == 0 { record::clear(view, [0.05, 0.05, 0.08, 1.0]) } else { record::load(view) };
        let mut pass = card.begin_render_pass([color], None);
        pass.set_pipeline(glyph);
        group.iter().for_each(|&group| pass.set_bind_group(0, group));
        pass.set_immediates(0, &[frame]);
        pass.draw(4, 1 + 30 * (4 + frame % 5));
        drop(pass);
        card.present(window);
    }
    card
}

/// Particles that a dispatch moves, over what the frames before have left.
fn swarm(frames: u32) -> Recorder {
    const PARTICLES: u32 = 2048;
    const MOVE: &str = "
        var<immediate> frame: u32;
        @group(0) @binding(0) var<storage, read_write> particles: array<vec4f>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {
            let i = id.x;
            var p = particles[i];
            if frame == 0u {
                let h = i * 2654435761u;
                p = vec4f(f32(h >> 22u) / 512.0 - 1.0, f32((h >> 12u) & 1023u) / 512.0 - 1.0, 0.0, 0.0);
            }
            // Around a centre that wanders.
            let centre = vec2f(f32(frame % 40u) / 40.0 - 0.5, f32(frame % 25u) / 25.0 - 0.5);
            let pull = centre - p.xy;
            let v = p.zw * 0.98 + 0.002 * pull + 0.001 * vec2f(-pull.y, pull.x);
            particles[i] = vec4f(p.xy + v, v);
        }";
    const SHOW: &str = "
        @group(0) @binding(0) var<storage, read> particles: array<vec4f>;
        struct Vertex { @builtin(position) at: vec4f, @location(0) out: vec2f }
        @vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Vertex {
            let corner = vec2f(f32(v & 1u), f32(v >> 1u)) * 2.0 - 1.0;
            return Vertex(vec4f(particles[i].xy + corner * vec2f(0.015, 0.02), 0.5, 1.0), corner);
        }
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {
            return vec4f(0.9, 0.5, 0.2, 0.6 * max(1.0 - dot(v.out, v.out), 0.0));
        }";
    const FADE: &str = "
        @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
            return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
        }
        @fragment fn fs() -> @location(0) vec4f { return vec4f(0.0, 0.0, 0.03, 0.1); }";
    let mut card = Recorder::new("swarm");
    let particles = card.create_buffer("particles", 16 * u64::from(PARTICLES));
    let shader = card.create_shader("move", MOVE);
    let step = card.create_compute_pipeline("move", None, record::stage_entry(shader, "main"));
    let layout = card.get_bind_group_layout(AnyPipeline::Compute(step), 0);
    let moved = card.create_bind_group(layout, [(0, record::whole(particles))]);
    let blended = |desc: &mut RenderPipelineDesc| {
        desc.targets = vec![Some(ColorTarget { blend: Some(OVER), ..record::target(WINDOW) })];
    };
    let strip = |desc: &mut RenderPipelineDesc| {
        desc.primitive.topology = Topology::TriangleStrip;
        blended(desc);
    };
    let (show, shown) = pipeline(&mut card, SHOW, strip, &[record::whole(particles)]);
    let (fade, _) = pipeline(&mut card, FADE, blended, &[]);
    let window = card.create_texture("window", record::texture_2d(SIZE[0], SIZE[1], WINDOW));
    let view = card.create_view(window);
    for frame in 0..frames {
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(step);
        pass.set_bind_group(0, moved);
        pass.set_immediates(0, &[frame]);
        pass.dispatch(PARTICLES / 64, 1, 1);
        drop(pass);
        let color = if frame == 0 { record::clear(view, [0.0, 0.0, 0.03, 1.0]) } else { record::load(view) };
        let mut pass = card.begin_render_pass([color], None);
        pass.set_pipeline(fade);
        pass.draw(3, 1);
        pass.set_pipeline(show);
        shown.iter().for_each(|&group| pass.set_bind_group(0, group));
        pass.draw(4, PARTICLES);
        drop(pass);
        card.present(window);
    }
    card
}

/// Boxes on a floor under a camera that turns, in the light of a map that is drawn once.
fn shadow_once(frames: u32) -> Recorder {
    const MAP: u32 = 512;
    const BOXES: u32 = 48;
    const SOURCE: &str = "
        var<immediate> frame: u32;
        const CORNERS = array<u32, 36>(0, 1, 2, 2, 1, 3, 4, 6, 5, 5, 6, 7, 0, 4, 1, 1, 4, 5, 2, 3, 6, 6, 3, 7, 0, 2, 4, 4, 2, 6, 1, 5, 3, 3, 5, 7);
        fn corner(v: u32, i: u32) -> vec3f {
            let c = CORNERS[v];
            let unit = vec3f(f32(c & 1u), f32((c >> 1u) & 1u), f32(c >> 2u)) - 0.5;
            if i == 0u { return unit * vec3f(8.0, 0.1, 8.0); }
            let h = i * 2654435761u;
            let at = vec3f(f32(h >> 27u) / 5.0 - 3.1, 0.35, f32((h >> 22u) & 31u) / 5.0 - 3.1);
            return at + unit * vec3f(0.35, 0.6 + f32((h >> 17u) & 7u) * 0.1, 0.35);
        }
        // The light looks down along (1, 2, 1); all lies between -8 and 8.
        fn lit(p: vec3f) -> vec4f { return vec4f((p.x - 0.5 * p.y) / 5.0, (p.z - 0.5 * p.y) / 5.0, 0.5 - p.y / 8.0, 1.0); }
        @vertex fn caster(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> @builtin(position) vec4f {
            return lit(corner(v, i));
        }
        @group(0) @binding(0) var map: texture_depth_2d;
        @group(0) @binding(1) var compared: sampler_comparison;
        struct Vertex { @builtin(position) at: vec4f, @location(0) light: vec3f, @location(1) place: vec3f }
        @vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> Vertex {
            let p = corner(v, i);
            // A turn by 1/200 each frame.
            let angle = f32(frame % 200u) * 0.031415927;
            let turned = vec3f(p.x * cos(angle) - p.z * sin(angle), p.y, p.x * sin(angle) + p.z * cos(angle));
            let seen = vec3f(turned.x, turned.y * 0.87 + turned.z * 0.5, turned.z * 0.87 - turned.y * 0.5 + 7.0);
            return Vertex(vec4f(seen.x * 1.2, seen.y * 1.6, (seen.z - 1.0) * 1.1, seen.z), lit(p).xyz, p);
        }
        @fragment fn fs(v: Vertex) -> @location(0) vec4f {
            let uv = v.light.xy * vec2f(0.5, -0.5) + 0.5;
            var sum = 0.0;
            for (var i = 0u; i < 4u; i++) {
                let off = vec2f(f32(i & 1u), f32(i >> 1u)) / 512.0;
                sum += textureSampleCompareLevel(map, compared, uv + off, v.light.z - 0.004);
            }
            return vec4f(fract(v.place * 0.5) * (0.3 + 0.175 * sum), 1.0);
        }";
    let mut card = Recorder::new("shadow-once");
    let map = card.create_texture("map", record::texture_2d(MAP, MAP, Format::Depth32Float));
    let map = card.create_view(map);
    let less = SamplerDesc {
        mag: FilterMode::Linear,
        min: FilterMode::Linear,
        compare: Some(Compare::LessEqual),
        ..SamplerDesc::default()
    };
    let sampler = card.create_sampler(less);
    let shader = card.create_shader("scene", SOURCE);
    let mut desc = record::render_pipeline(shader, WINDOW);
    desc.vertex = record::stage_entry(shader, "caster");
    (desc.fragment, desc.targets) = (None, Vec::new());
    desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    let cast = card.create_render_pipeline("cast", desc);
    let depth = |desc: &mut RenderPipelineDesc| desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    let (show, group) = pipeline(&mut card, SOURCE, depth, &[BoundResource::View(map), BoundResource::Sampler(sampler)]);
    let window = card.create_texture("window", record::texture_2d(SIZE[0], SIZE[1], WINDOW));
    let view = card.create_view(window);
    let depths = card.create_texture("depths", record::texture_2d(SIZE[0], SIZE[1], Format::Depth32Float));
    let depths = card.create_view(depths);
    for frame in 0..frames {
        if frame == 0 {
            let mut pass = card.begin_render_pass([], record::clear_depth(map, true));
            pass.set_pipeline(cast);
            pass.draw(36, BOXES);
        }
        let mut pass = card.begin_render_pass([record::clear(view, [0.3, 0.4, 0.6, 1.0])], record::clear_depth(depths, false));
        pass.set_pipeline(show);
        group.iter().for_each(|&group| pass.set_bind_group(0, group));
        pass.set_immediates(0, &[frame]);
        pass.draw(36, BOXES);
        drop(pass);
        card.present(window);
    }
    card
}
