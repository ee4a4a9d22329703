//! Fragment programs: inputs and outputs, derivatives, discard, textures, costs.

use super::*;
use gfx::format::Format;
use gfx::image::ImageDesc;
use gfx::state::{Aspect, SamplerDesc, TextureDimension, ViewDimension};
use gfx::texture::{Sampler, View, ViewRange};
use num::Lanes;
use work::RequestKind;

fn fragment(source: &str) -> Program {
    let module = Module::new("test", ModuleSource::Wgsl(source)).unwrap_or_else(|e| panic!("{e}"));
    compile(&module, Stage::Fragment, None, &Options::default()).unwrap_or_else(|e| panic!("{e}"))
}

/// x of each lane: quads in a row of 32 pixels, two rows.
fn x_of(lane: usize) -> f32 {
    (lane / 4 * 2 + lane % 2) as f32
}

fn y_of(lane: usize) -> f32 {
    (lane / 2 % 2) as f32
}

/// Writes x, y into the first two components of input slot 0, as far as they are read.
fn fill(bound: &mut BoundProgram<'_>) {
    for (c, f) in [(0, x_of as fn(usize) -> f32), (1, y_of)] {
        if let Some(lanes) = bound.input_mut(0, c) {
            *lanes = Lanes(std::array::from_fn(|i| f(i).to_bits()));
        }
    }
}

#[test]
fn derivatives_are_differences_in_the_quad() {
    let p = fragment(
        "@fragment fn fs(@location(0) p: vec2f) -> @location(0) vec4f {
            let v = p.x * p.x + 10.0 * p.y * p.x;
            return vec4f(dpdxCoarse(v), dpdxFine(v), dpdyCoarse(v), dpdyFine(v) + fwidthCoarse(v) * 0.0);
        }",
    );
    assert!(p.interface().uses_derivatives);
    let resources = Resources::default();
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    fill(&mut bound);
    bound.run(!0, 0).expect("it ends");
    let v = |x: f32, y: f32| x * x + 10.0 * y * x;
    for i in 0..64 {
        let (x0, x, y) = (x_of(i / 4 * 4), x_of(i), y_of(i));
        let want = [v(x0 + 1.0, 0.0) - v(x0, 0.0), v(x0 + 1.0, y) - v(x0, y), v(x0, 1.0) - v(x0, 0.0), v(x, 1.0) - v(x, 0.0)];
        for (c, want) in want.into_iter().enumerate() {
            assert_eq!(bound.output(0, c).f32()[i], want, "lane {i} component {c}");
        }
    }
}

#[test]
fn a_derivative_is_the_same_whether_its_operand_is_computed_once_or_by_every_lane() {
    let source = "@group(0) @binding(0) var<uniform> u: vec2f;
        @fragment fn fs(@location(0) p: vec2f) -> @location(0) vec4f { return vec4f(dpdx(u.x), dpdy(u.y), p); }";
    let module = Module::new("test", ModuleSource::Wgsl(source)).expect("the program is valid");
    let words = words_of(&[f32::INFINITY.to_bits(), 2.5f32.to_bits()]);
    let bindings = [vec![Resource::Buffer(BufferRange { words: &words, offset: 0, size: 8, address: 0 })]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    for optimisations in [Optimisations::ALL, Optimisations::NONE] {
        let options = Options { optimisations, ..Options::default() };
        let p = compile(&module, Stage::Fragment, None, &options).expect("it compiles");
        let uniforms = p.uniforms(&resources);
        let mut executor = Executor::new();
        let mut bound = executor.bind(&p, &resources, &uniforms);
        fill(&mut bound);
        bound.run(!0, 0).expect("it ends");
        assert!(bound.output(0, 0).f32()[5].is_nan(), "infinity differs from itself by no number");
        assert_eq!(bound.output(0, 1).f32()[5], 0.0);
    }
}

#[test]
fn discarded_lanes_have_no_effects_and_still_help() {
    let p = fragment(
        "@group(0) @binding(0) var<storage, read_write> hits: array<atomic<u32>, 2>;
         @fragment fn fs(@location(0) p: vec2f) -> @location(0) vec4f {
            if (u32(p.x) % 4u < 1u) { discard; }
            atomicAdd(&hits[0], 1u);
            return vec4f(dpdxFine(p.x * p.x));
        }",
    );
    assert!(p.interface().discards && p.interface().side_effects && p.interface().bindings[0].written);
    let hits = Words::new(8);
    let bindings = vec![vec![Resource::Buffer(BufferRange { words: &hits, offset: 0, size: 8, address: 0 })]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    fill(&mut bound);
    let active = !0 >> 8;
    let outcome = bound.run(active, !active).expect("it ends");
    let want = (0..56).filter(|&i| x_of(i) as u32 % 4 >= 1).fold(0u64, |m, i| m | 1 << i);
    assert_eq!(outcome.mask, want);
    assert_eq!(hits.load(0), want.count_ones());
    for i in 0..56 {
        let x0 = x_of(i / 4 * 4);
        assert_eq!(bound.output(0, 0).f32()[i], (x0 + 1.0) * (x0 + 1.0) - x0 * x0);
    }
}

#[test]
fn textures_are_sampled_loaded_and_asked() {
    let p = fragment(
        "@group(1) @binding(0) var t: texture_2d<f32>;
         @group(1) @binding(3) var s: sampler;
         @fragment fn fs(@location(0) p: vec2f) -> @location(0) vec4f {
            let size = vec2f(textureDimensions(t));
            let a = textureSample(t, s, (p + 0.5) / size);
            let b = textureLoad(t, vec2u(p), 0);
            let g = textureGather(1, t, s, (p + 1.0) / size);
            return vec4f(a.r, b.g, g.w, f32(textureNumLevels(t)) + size.x);
        }",
    );
    let words = Words::new(4 * 32 * 4);
    for y in 0..4u32 {
        for x in 0..32u32 {
            words.store((y * 32 + x) as usize, (x * 7) | ((y * 50 + x) << 8) | (255 << 24));
        }
    }
    let image =
        ImageDesc { dimension: TextureDimension::D2, size: [32, 4, 1], levels: 1, samples: 1, format: Format::Rgba8Unorm };
    let range = ViewRange {
        dimension: ViewDimension::D2,
        format: Format::Rgba8Unorm,
        aspect: Aspect::All,
        base_level: 0,
        levels: 1,
        base_layer: 0,
        layers: 1,
    };
    let view = View::new(&words, &image, &range, 0).expect("a view");
    let sampler = Sampler::new(&SamplerDesc::default());
    let bindings = vec![vec![Resource::Texture(&view)], vec![Resource::Sampler(&sampler)]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    fill(&mut bound);
    let mut recorder = Recorder::new();
    bound.run_recorded(!0, 0, &mut recorder).expect("it ends");
    for i in 0..64 {
        let (x, y) = (x_of(i), y_of(i));
        let unorm = |v: f32| v / 255.0;
        assert!((bound.output(0, 0).f32()[i] - unorm(x * 7.0)).abs() < 1e-6);
        assert_eq!(bound.output(0, 1).f32()[i], unorm(y * 50.0 + x));
        assert!((bound.output(0, 2).f32()[i] - unorm(y * 50.0 + x)).abs() < 1e-6);
        assert_eq!(bound.output(0, 3).f32()[i], 33.0);
    }
    let cost = &recorder.costs[recorder.quads[3].cost];
    let kinds: Vec<RequestKind> = cost.steps.iter().map(|s| s.then).collect();
    assert_eq!(kinds, [RequestKind::Texture, RequestKind::Texture, RequestKind::Texture, RequestKind::End]);
    assert_eq!(recorder.requests.len(), 48);
    assert!(recorder.requests.iter().all(|r| r.lines >= 1 && r.operations >= 1));
}

#[test]
fn an_element_of_a_binding_array_sees_the_coordinates_of_all_lanes() {
    let p = fragment(
        "enable wgpu_binding_array;
         @group(0) @binding(0) var t: binding_array<texture_2d<f32>, 2>;
         @group(0) @binding(1) var s: sampler;
         @fragment fn fs(@location(0) p: vec2f) -> @location(0) vec4f {
             return textureSample(t[u32(p.x) & 1u], s, (p + 0.5) / 64.0);
         }",
    );
    // A texel per pixel: all lanes read the first level, which is zero; the second is one.
    let image =
        ImageDesc { dimension: TextureDimension::D2, size: [64, 64, 1], levels: 2, samples: 1, format: Format::Rgba8Unorm };
    let words = Words::new(image.bytes());
    (64 * 64..words.words().len()).for_each(|k| words.store(k, u32::MAX));
    let range = ViewRange {
        dimension: ViewDimension::D2,
        format: Format::Rgba8Unorm,
        aspect: Aspect::All,
        base_level: 0,
        levels: 2,
        base_layer: 0,
        layers: 1,
    };
    let view = View::new(&words, &image, &range, 0).expect("a view");
    let sampler = Sampler::new(&SamplerDesc::default());
    let bindings = vec![vec![Resource::Texture(&view); 2], vec![Resource::Sampler(&sampler)]];
    let resources = Resources { bindings: &bindings, ..Resources::default() };
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    fill(&mut bound);
    bound.run(!0, 0).expect("it ends");
    for c in 0..4 {
        assert_eq!(bound.output(0, c).f32(), &[0.0; 64], "component {c}");
    }
}

#[test]
fn costs_follow_each_quads_own_path() {
    let p = fragment(
        "@fragment fn fs(@location(0) p: vec2f) -> @location(0) vec4f {
            var r = p.x;
            if (p.x < 8.0) { for (var k = 0.0; k < p.x; k += 1.0) { r = sqrt(r + 1.0); } }
            return vec4f(r);
        }",
    );
    let resources = Resources::default();
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    fill(&mut bound);
    let mut recorder = Recorder::new();
    bound.run_recorded(!0, 0, &mut recorder).expect("it ends");
    let special = |q: usize| recorder.costs[recorder.quads[q].cost].instructions()[2];
    // Quad q holds x = 2q and 2q + 1: it goes round as often as its farthest lane.
    assert_eq!((0..6).map(special).collect::<Vec<_>>(), [1, 3, 5, 7, 0, 0]);
    assert_eq!(recorder.quads[4].cost, recorder.quads[15].cost);
    assert_eq!(recorder.costs.costs.len(), 5);
    // The same batch again finds the same costs.
    fill(&mut bound);
    bound.run_recorded(!0, 0, &mut recorder).expect("it ends");
    assert_eq!(recorder.costs.costs.len(), 5);
}

#[test]
fn outputs_that_nobody_reads_are_not_computed() {
    let source = "
        struct Out { @builtin(position) p: vec4f, @location(0) a: vec4f, @location(3) b: f32 }
        @vertex fn vs(@location(0) p: vec4f, @location(1) q: vec4f) -> Out { return Out(p, sin(q), cos(q.x)); }";
    let module = Module::new("test", ModuleSource::Wgsl(source)).expect("valid");
    let kept = compile(&module, Stage::Vertex, None, &Options { constants: &[], outputs: Some(&[3]), ..Options::default() })
        .expect("compiles");
    assert_eq!(kept.interface().outputs.len(), 2);
    assert_eq!(kept.interface().output_location(3), Some(1));
    assert_eq!(kept.operations().0, 2, "a cosine and the end");
    assert!(kept.inputs[1][1] == program::NO_REG);
}

/// The instructions of a path's spans between two requests are those of the step between them; what a path adds costs nothing else.
#[test]
fn paths_are_what_steps_are_made_of() {
    let p = fragment(
        "@fragment fn fs(@location(0) p: vec2f) -> @location(0) vec4f {
            var r = p.x;
            for (var k = 0.0; k < p.x; k += 1.0) { if (k > p.y) { break; } r = sqrt(r + 1.0); }
            if (p.x < 8.0) { r += dpdx(p.y) * sin(r); } else { switch u32(p.x) % 3u { case 0u: { discard; } case 1u: { r = exp(r); } default: {} } }
            return vec4f(r);
        }",
    );
    let resources = Resources::default();
    let uniforms = p.uniforms(&resources);
    let mut executor = Executor::new();
    let mut bound = executor.bind(&p, &resources, &uniforms);
    let mut record = |paths: bool| {
        fill(&mut bound);
        let mut recorder = Recorder::with(Extra { paths, ..Extra::default() });
        bound.run_recorded(!0, 0, &mut recorder).expect("it ends");
        recorder
    };
    let (with, without) = (record(true), record(false));
    assert!(with.costs.spans.len() > 5 && without.costs.spans.is_empty());
    for q in 0..16 {
        let cost = &with.costs[with.quads[q].cost];
        assert_eq!(cost.steps, without.costs[without.quads[q].cost].steps);
        assert!(without.costs[without.quads[q].cost].path.is_empty());
        let mut steps = vec![[0; 5]];
        for point in &cost.path {
            for &(class, count) in &with.costs.spans[point.span as usize].runs {
                steps.last_mut().expect("a step")[class as usize] += count;
            }
            if point.then != RequestKind::End {
                steps.push([0; 5]);
            }
        }
        assert_eq!(steps, cost.steps.iter().map(|step| step.instructions).collect::<Vec<_>>(), "quad {q}");
    }
}
