//! Modules that are not WGSL, through a trace: SPIR-V as glslang writes it, plain and optimised (`tests/programs/spirv`), and naga's
//! own form; each against the same program in WGSL.

use crate::common::*;
use gfx::format::Format;
use gfx::state::*;
use num::ShaderId;
use trace::command::*;
use trace::record;

const VERTEX: [&[u8]; 2] = [include_bytes!("spirv/engine.vert.spv"), include_bytes!("spirv/engine.vert.opt.spv")];
const FRAGMENT: [&[u8]; 2] = [include_bytes!("spirv/engine.frag.spv"), include_bytes!("spirv/engine.frag.opt.spv")];
const COMPUTE: [&[u8]; 2] = [include_bytes!("spirv/engine.comp.spv"), include_bytes!("spirv/engine.comp.opt.spv")];

const DRAWN: &str = "
    struct Scene { transform: mat4x4f, turn: mat3x3f, offsets: array<vec3f, 4>, scale: f32 }
    struct Push { first: u32, @align(16) tint: vec4f }
    @group(0) @binding(0) var<uniform> scene: Scene;
    var<immediate> push: Push;
    struct Out {
        @builtin(position) at: vec4f,
        @location(0) tinted: vec4f, @location(1) @interpolate(flat) number: u32, @location(2) uv: vec2f,
    }
    @vertex fn vs(
        @location(0) position: vec2f, @location(1) color: vec4f,
        @builtin(vertex_index) v: u32, @builtin(instance_index) i: u32,
    ) -> Out {
        let p = scene.turn * vec3f(position, 0.25) * scene.scale + scene.offsets[(i + push.first) & 3u];
        return Out(scene.transform * vec4f(p, 1.0), color * push.tint, i * 100u + v, position * 0.5 + 0.5);
    }
    @group(0) @binding(1) var albedo: texture_2d<f32>;
    @group(0) @binding(2) var wrap: sampler;
    struct Lamp { at: vec3f, reach: f32, color: vec4f }
    struct Lamps { count: u32, lamps: array<Lamp> }
    @group(0) @binding(3) var<storage, read> lamps: Lamps;
    struct Colors { @location(0) color: vec4f, @location(1) ids: vec4u }
    fn shade(base: vec3f, at: vec2f) -> vec3f {
        var sum = base * 0.1;
        for (var i = 0u; i < lamps.count; i++) {
            let lamp = lamps.lamps[i];
            let d = distance(lamp.at.xy, at);
            if d > lamp.reach { continue; }
            if lamp.color.a == 0.0 { break; }
            switch i % 3u {
                case 0u: { sum += base * lamp.color.rgb * (1.0 - d / lamp.reach); }
                case 1u: { sum.r += 0.25; sum.g += 0.125; }
                default: { sum.g += 0.125; }
            }
        }
        return sum;
    }
    @fragment fn fs(in: Out, @builtin(front_facing) front: bool) -> Colors {
        let texel = textureSample(albedo, wrap, in.uv * 2.0);
        if texel.a < 0.5 && in.at.x < 8.0 { discard; }
        var c = shade(texel.rgb * in.tinted.rgb, in.at.xy);
        if in.at.y < 3.0 { c = textureSampleLevel(albedo, wrap, in.uv, 0.0).bgr; }
        else if in.at.y < 5.0 { c = textureLoad(albedo, vec2i(in.at.xy) & vec2i(3), 0).rgb; }
        let ids = vec4u(in.number, textureDimensions(albedo).x, bitcast<u32>(dpdx(in.at.x)) >> 23u, reverseBits(in.number));
        return Colors(vec4f(c, select(0.5, 1.0, front)), ids);
    }";

/// Draws four instances of a quad with the given stages; the words of both targets.
fn draw(stages: impl FnOnce(&mut Lab) -> [ShaderId; 2]) -> Vec<u32> {
    let mut lab = Lab::new();
    let shaders = stages(&mut lab);
    let kinds = [(0, record::UNIFORM), (1, record::TEXTURE), (2, record::SAMPLER), (3, record::STORAGE_READ)];
    let layout = lab.card.create_bind_group_layout(kinds);
    let pipeline_layout = lab.card.create_pipeline_layout([layout], 32);
    let mut desc = record::render_pipeline(shaders[0], Format::Rgba32Float);
    desc.layout = Some(pipeline_layout);
    desc.fragment = Some(record::stage(shaders[1]));
    desc.targets.push(Some(record::target(Format::Rgba32Uint)));
    desc.primitive.topology = Topology::TriangleStrip;
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x2), (1, VertexFormat::Unorm8x4)])];
    let pipeline = lab.card.create_render_pipeline("", desc);
    let mut next = unit_noise(51);
    // std140: a matrix of 64 bytes, three columns of 16, four vectors of 16, a number.
    let mut scene = vec![0.5, 0.1, 0.0, 0.0, -0.1, 0.4, 0.0, 0.0, 0.0, 0.0, 0.25, 0.0, 0.1, 0.0, 0.5, 1.25];
    scene.extend([0.9, 0.2, 0.0, 7.0, -0.3, 0.8, 0.1, 7.0, 0.0, 0.1, 1.0, 7.0]);
    scene.extend([-0.9, 0.7, 0.0, 7.0, 0.8, 0.6, 0.1, 7.0, 0.9, -0.7, 0.2, 7.0, -0.8, -0.8, 0.3, 7.0, 0.75, 0.0, 0.0, 0.0]);
    let mut lamps = vec![f32::from_bits(6), 0.0, 0.0, 0.0];
    for k in 0..6 {
        lamps.extend([
            next() * 32.0,
            next() * 32.0,
            0.0,
            6.0 + 12.0 * next(),
            next(),
            next(),
            next(),
            f32::from(u8::from(k != 5)),
        ]);
    }
    let mut vertices = Vec::new();
    for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (-1.0, 1.0), (1.0, 1.0)] {
        vertices.extend(bits(&[x, y]));
        vertices.push(u32::from_le_bytes([(next() * 255.0) as u8, 200, (next() * 255.0) as u8, 255]));
    }
    let texels: Vec<u32> = (0..64).map(|_| (next() * 4e9) as u32).collect();
    let texture = lab.card.create_texture("albedo", record::texture_2d(8, 8, Format::Rgba8Unorm));
    lab.card.write_level(texture, 0, "albedo", &bytes(&texels));
    let albedo = lab.card.create_view(texture);
    let sampler = lab.card.create_sampler(record::trilinear_repeat());
    let (scene, lamps, vertices) = (lab.buffer(&bits(&scene)), lab.buffer(&bits(&lamps)), lab.buffer(&vertices));
    let resources = [record::whole(scene), BoundResource::View(albedo), BoundResource::Sampler(sampler), record::whole(lamps)];
    let group = lab.card.create_bind_group(layout, (0..).zip(resources));
    let targets = [Format::Rgba32Float, Format::Rgba32Uint].map(|f| lab.card.create_texture("", record::texture_2d(32, 32, f)));
    let views = targets.map(|t| lab.card.create_view(t));
    {
        let mut pass = lab.card.begin_render_pass(views.map(|v| record::clear(v, [0.0; 4])), None);
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.set_vertex_buffer(0, vertices);
        pass.set_immediates(0, &[1]);
        pass.set_immediates(16, &bits(&[1.0, 0.5, 0.75, 1.0]));
        pass.draw(4, 4);
    }
    targets.into_iter().for_each(|t| lab.card.present(t));
    let frames = lab.frames().unwrap_or_else(|error| panic!("{error}"));
    frames.concat().chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect()
}

#[test]
fn spirv_stages_draw_what_wgsl_does() {
    let want = draw(|lab| [lab.card.create_shader("engine", DRAWN); 2]);
    let covered = want[4 * 1024..].chunks(4).filter(|p| p[1] == 8).count();
    assert!((200..1000).contains(&covered), "{covered} pixels drawn");
    for (vertex, fragment) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
        let got = draw(|lab| {
            [
                lab.card.create_shader_spirv("vertex", VERTEX[vertex]),
                lab.card.create_shader_spirv("fragment", FRAGMENT[fragment]),
            ]
        });
        assert_eq!(got, want, "optimised: {vertex}, {fragment}");
    }
    // One stage of each source.
    let got = draw(|lab| [lab.card.create_shader("engine", DRAWN), lab.card.create_shader_spirv("fragment", FRAGMENT[1])]);
    assert_eq!(got, want);
}

/// naga's own form, as wgpu records it for modules that were built by the program.
fn ir(wgsl: &str) -> String {
    let module = naga::front::wgsl::parse_str(wgsl).unwrap_or_else(|error| panic!("{}", error.emit_to_string(wgsl)));
    ron::to_string(&module).expect("a module is text")
}

#[test]
fn naga_modules_draw_what_wgsl_does() {
    // An immediate in naga's front end needs a capability that its short-cut does not have: the vertex stage stays WGSL.
    let fragment = DRAWN.split("@group(0) @binding(1) var albedo").nth(1).expect("the fragment stage");
    let out = "struct Out {
        @builtin(position) at: vec4f,
        @location(0) tinted: vec4f, @location(1) @interpolate(flat) number: u32, @location(2) uv: vec2f,
    }";
    let text = ir(&format!("{out} @group(0) @binding(1) var albedo{fragment}"));
    let want = draw(|lab| [lab.card.create_shader("engine", DRAWN); 2]);
    let got = draw(|lab| [lab.card.create_shader("engine", DRAWN), lab.card.create_shader_naga_ir("fragment", &text)]);
    assert_eq!(got, want);
}

#[test]
fn spirv_computes_what_it_says() {
    const GROUPS: u32 = 3;
    let mut next = noise(61);
    let input: Vec<u32> = (0..16 * GROUPS).map(|_| next()).collect();
    let mixed = |mut x: u32| {
        x ^= x >> 16;
        x = x.wrapping_mul(0x7feb_352d);
        x ^ x >> 15
    };
    for (binary, rounds) in [(0, 3), (1, 3), (0, 7), (1, 0)] {
        let mut lab = Lab::new();
        let shader = lab.card.create_shader_spirv("compute", COMPUTE[binary]);
        let mut stage = record::stage(shader);
        if rounds != 3 {
            stage.constants = vec![("5".into(), f64::from(rounds))];
        }
        let pipeline = lab.card.create_compute_pipeline("", None, stage);
        let data = lab.buffer(&[&[1, 100][..], &input].concat());
        let [picture, counts] = [Format::Rgba8Unorm, Format::R32Uint]
            .map(|format| lab.card.create_texture("", record::texture_2d(8 * GROUPS, 2, format)));
        let views = [picture, counts].map(|t| lab.card.create_view(t));
        lab.dispatch(
            pipeline,
            [GROUPS, 1, 1],
            [record::whole(data), BoundResource::View(views[0]), BoundResource::View(views[1])],
        );
        lab.show_buffer(data, 64);
        lab.card.present(picture);
        lab.card.present(counts);
        let frames = lab.frames().unwrap_or_else(|error| panic!("{error}"));
        let read =
            |k: usize| -> Vec<u32> { frames[k].chunks_exact(4).map(|b| u32::from_le_bytes(b.try_into().unwrap())).collect() };
        let (got, picture, counts) = (read(0), read(1), read(2));
        let (mut total, mut lowest) = (1u32, 100i32);
        for (g, group) in input.chunks(16).enumerate() {
            let xs: Vec<u32> = group.iter().map(|&x| (0..rounds).fold(x, |x, r| mixed(x.wrapping_add(r)))).collect();
            let sum: u32 = xs.iter().map(|x| x & 1023).sum();
            let most = xs.iter().map(|x| x & 255).max().unwrap();
            total += sum;
            lowest = lowest.min(sum as i32 - 5000);
            for (i, &x) in xs.iter().enumerate() {
                let last = if x == 0 { u32::MAX } else { 31 - x.leading_zeros() };
                let value = (sum * 1000 + most).wrapping_add(last).wrapping_add(x.count_ones());
                assert_eq!(got[2 + 16 * g + i], value, "invocation {i} of group {g}, {rounds} rounds");
                let at = 8 * GROUPS as usize * (i / 8) + 8 * g + i % 8;
                assert_eq!((picture[at], counts[at]), (x, x % 7), "texel of invocation {i} of group {g}");
            }
        }
        assert_eq!((got[0], got[1] as i32), (total, lowest));
    }
}

/// What no front end takes is refused with the module's name.
#[test]
fn damaged_modules_are_refused() {
    let cases: [(&str, Vec<u8>); 3] =
        [("cut short", COMPUTE[0][..COMPUTE[0].len() / 2].to_vec()), ("no SPIR-V", vec![1; 40]), ("empty", Vec::new())];
    for (what, binary) in cases {
        let mut lab = Lab::new();
        let shader = lab.card.create_shader_spirv("broken", &binary);
        let message = lab.refusal_of(shader);
        assert!(message.contains("broken.spv") && message.contains("command 0"), "{what}: {message}");
    }
    let mut lab = Lab::new();
    let shader = lab.card.create_shader_naga_ir("broken", "(types: [], nothing: 3)");
    let message = lab.refusal_of(shader);
    assert!(message.contains("broken.ron") && message.contains("1:23: no naga IR"), "{message}");
}
