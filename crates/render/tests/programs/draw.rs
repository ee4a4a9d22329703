//! Draws through a trace: built-in values, indirect and bundled draws, queries, blending with two sources, clipping, skinning.

use crate::common::*;
use gfx::format::Format;
use gfx::state::*;
use glam::{DVec3, dvec3};
use num::{BufferId, TextureId, ViewId};
use trace::command::*;
use trace::record::{self, RenderPass};

/// A lab with one target.
struct Canvas {
    lab: Lab,
    target: TextureId,
    view: ViewId,
    format: Format,
}

impl Canvas {
    fn new(width: u32, height: u32, format: Format) -> Canvas {
        let mut lab = Lab::new();
        let target = lab.card.create_texture("target", record::texture_2d(width, height, format));
        let view = lab.card.create_view(target);
        Canvas { lab, target, view, format }
    }

    /// A pipeline of a module with one vertex and one fragment stage, changed by `change`.
    fn pipeline(&mut self, source: &str, change: impl FnOnce(&mut RenderPipelineDesc)) -> num::RenderPipelineId {
        let shader = self.lab.card.create_shader("program", source);
        let mut desc = record::render_pipeline(shader, self.format);
        change(&mut desc);
        self.lab.card.create_render_pipeline("", desc)
    }

    fn pass(&mut self, draws: impl FnOnce(&mut RenderPass<'_>)) {
        let mut pass = self.lab.card.begin_render_pass([record::clear(self.view, [0.0; 4])], None);
        draws(&mut pass);
    }

    /// The target's words.
    fn finish(mut self) -> Vec<u32> {
        self.lab.card.present(self.target);
        self.lab.last_frame()
    }
}

/// A vertex stage in which the n-th vertex (of 6 an instance) makes a rectangle of one pixel: pixel `at` of a row of `width`.
fn dot(width: u32, at: &str, more_members: &str, more_arguments: &str, more_values: &str) -> String {
    format!(
        "struct V {{ @builtin(position) p: vec4f, {more_members} }}
         @vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32 {more_arguments}) -> V {{
             let corner = array<vec2f, 6>(vec2f(0, 0), vec2f(1, 0), vec2f(0, 1), vec2f(0, 1), vec2f(1, 0), vec2f(1, 1))[v % 6u];
             let x = (f32({at}) + corner.x) / {width}.0 * 2.0 - 1.0;
             return V(vec4f(x, 1.0 - 2.0 * corner.y, 0.5, 1.0) {more_values});
         }}"
    )
}

/// The built-in position is that of the pixel's centre, whatever is interpolated elsewhere beside it.
#[test]
fn position_beside_a_centroid_varying() {
    let draw = |sampling: &str| {
        let mut canvas = Canvas::new(32, 32, Format::Rgba8Unorm);
        let source = format!(
            "struct V {{
                 @builtin(position) p: vec4f,
                 @location(0) a: f32,
                 @location(1) @interpolate(perspective, {sampling}) b: f32,
             }}
             @vertex fn vs(@builtin(vertex_index) v: u32) -> V {{
                 let w = array<f32, 3>(1.0, 9.0, 2.0)[v];
                 let at = array<vec2f, 3>(vec2f(-0.9, -0.8), vec2f(0.7, -0.6), vec2f(-0.3, 0.9))[v];
                 return V(vec4f(at, 0.5, 1.0) * w, w / 9.0, w / 9.0);
             }}
             @fragment fn fs(in: V) -> @location(0) vec4f {{ return vec4f(in.p.w, in.a, in.b, 1.0); }}"
        );
        let many = canvas.lab.card.create_texture("", record::texture_multisampled(32, 32, 4, Format::Rgba8Unorm));
        let samples = canvas.lab.card.create_view(many);
        let pipeline = canvas.pipeline(&source, |desc| desc.multisample.count = 4);
        let resolved = record::clear_and_resolve(samples, [0.0; 4], canvas.view);
        let mut pass = canvas.lab.card.begin_render_pass([resolved], None);
        pass.set_pipeline(pipeline);
        pass.draw(3, 1);
        drop(pass);
        canvas.finish()
    };
    let (center, centroid) = (draw("center"), draw("centroid"));
    assert!(
        center.iter().zip(&centroid).all(|(a, b)| a & 0xffff == b & 0xffff),
        "1/w and what lies at the centre are the same"
    );
    assert!(center != centroid, "the centroids are elsewhere");
}

/// Arguments in buffers: several draws at once, their number in a buffer too, with and without indices, from an instance on.
#[test]
fn indirect_draws() {
    let mut canvas = Canvas::new(32, 1, Format::R32Uint);
    let source = format!(
        "{} @fragment fn fs(v: V) -> @location(0) u32 {{ return v.tag; }}",
        dot(32, "i", "@location(0) @interpolate(flat) tag: u32", ", @location(0) tag: u32", ", tag * 100u + v")
    );
    let pipeline = canvas.pipeline(&source, |desc| {
        desc.buffers = vec![record::instance_buffer(&[(0, VertexFormat::Uint32)])];
        desc.primitive.topology = Topology::TriangleList;
    });
    let tags = canvas.lab.buffer(&(1..=32).collect::<Vec<u32>>());
    // Vertices, instances, first vertex, first instance.
    let plain = canvas.lab.buffer(&[99, 6, 2, 0, 0, 6, 1, 6, 3, 6, 0, 0, 5, 6, 1, 12, 6]);
    // Indices, instances, first index, base vertex, first instance.
    let indexed = canvas.lab.buffer(&[6, 1, 0, 0, 10, 6, 2, 6, 6, 12, 6, 1, 0, 0, 20]);
    let indices: Vec<u32> = (0..6).chain(0..6).collect();
    let indices = canvas.lab.buffer(&indices);
    let counts = canvas.lab.buffer(&[7, 2, 100]);
    canvas.pass(|pass| {
        pass.set_pipeline(pipeline);
        pass.set_vertex_buffer(0, tags);
        pass.set_index_buffer(indices, IndexFormat::Uint32);
        let draw = |buffer, offset, indexed, count, count_buffer| Command::DrawIndirect {
            buffer,
            offset,
            indexed,
            count,
            count_buffer,
        };
        pass.push(draw(plain, 4, false, 4, None));
        // At most two of the three, because the buffer says so; then at most one, because the command does.
        pass.push(draw(indexed, 0, true, 3, Some((counts, 4))));
        pass.push(draw(indexed, 40, true, 1, Some((counts, 8))));
    });
    let mut expected = vec![0u32; 32];
    // The provoking vertex is the first of each triangle: the pixel's centre lies on the diagonal, which is the second's.
    let mut put = |x: usize, first: u32| expected[x] = (x as u32 + 1) * 100 + first;
    (0..2).for_each(|x| put(x, 3));
    put(3, 9);
    put(6, 15);
    put(10, 3);
    // Indices 0 to 5 and base vertex 6.
    (12..14).for_each(|x| put(x, 9));
    put(20, 3);
    let got = canvas.finish();
    // Which of the two triangles has the centre is the fill rule's business.
    let got: Vec<u32> = got.iter().map(|&v| if v == 0 { 0 } else { (v / 100) * 100 + (v % 100 / 6) * 6 + 3 }).collect();
    assert_eq!(got, expected);
}

/// What a draw hands to its vertex stage, and to its fragment stage.
#[test]
fn built_in_values() {
    let mut canvas = Canvas::new(16, 1, Format::Rgba32Uint);
    let source = format!(
        "enable primitive_index; {}
         @fragment fn fs(v: V, @builtin(primitive_index) p: u32, @builtin(front_facing) f: bool) -> @location(0) vec4u {{
             return vec4u(v.numbers, p * 10u + select(0u, 1u, f), u32(v.p.x));
         }}",
        dot(16, "v / 6u + i - 3u", "@location(0) @interpolate(flat, either) numbers: vec2u", "", ", vec2u(v / 6u, i)")
    );
    let pipeline = canvas.pipeline(&source, |desc| desc.primitive.front_face = FrontFace::Cw);
    canvas.pass(|pass| {
        pass.set_pipeline(pipeline);
        pass.draw_from(12, 2, 6, 3); // vertices 6 to 17: squares 1 and 2; instances 3 and 4
    });
    let got = canvas.finish();
    // Square s of instance i is pixel s + i - 3; the second instance is drawn over the first.
    for (x, numbers) in [(1, [1, 3]), (2, [1, 4]), (3, [2, 4])] {
        let p = &got[4 * x..4 * x + 4];
        assert_eq!(p[..2], numbers, "pixel {x}");
        assert_eq!(p[2] % 10, 1, "the front faces");
        assert_eq!(p[2] / 10 / 2, numbers[0] - 1, "two triangles a square, counted from 0 in each instance");
        assert_eq!(p[3], x as u32);
    }
    assert!(got[..4].iter().chain(&got[16..]).all(|&v| v == 0));
}

/// A bundle with dynamic offsets, executed twice between draws of its pass; immediates set in it and outside.
#[test]
fn bundles_immediates_and_dynamic_offsets() {
    let mut canvas = Canvas::new(8, 1, Format::R32Uint);
    let source = format!(
        "struct Now {{ at: u32, add: u32 }}
         var<immediate> now: Now;
         @group(0) @binding(3) var<uniform> base: vec4u;
         @group(0) @binding(5) var<storage, read> list: array<u32>;
         {} @fragment fn fs(v: V) -> @location(0) u32 {{ return base.y * 100u + list[1] * 10u + now.add; }}",
        dot(8, "now.at", "", "", "")
    );
    let layout = canvas.lab.card.create_bind_group_layout([
        (3, BindingKind::Uniform { dynamic_offset: true }),
        (5, BindingKind::Storage { read_only: true, dynamic_offset: true }),
    ]);
    let layout_of_pipeline = canvas.lab.card.create_pipeline_layout([layout], 8);
    let pipeline = canvas.pipeline(&source, |desc| desc.layout = Some(layout_of_pipeline));
    let words: Vec<u32> = (0..256).map(|k| k / 64 + 1).collect();
    let buffer = canvas.lab.buffer(&words);
    let window = |offset, size| BoundResource::Buffer { buffer, offset, size: Some(size) };
    let group = canvas.lab.card.create_bind_group(layout, [(3, window(0, 16)), (5, window(256, 8))]);
    let bundle = {
        let mut bundle = canvas.lab.card.begin_bundle();
        bundle.set_pipeline(pipeline);
        for (at, offsets) in [(2, [256, 0]), (3, [0, 512])] {
            bundle.set_bind_group_at(0, group, &offsets);
            bundle.set_immediates(0, &[at, 7]);
            bundle.draw(6, 1);
        }
        bundle.id()
    };
    canvas.pass(|pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group_at(0, group, &[768, 256]);
        pass.set_immediates(0, &[0, 1]);
        pass.draw(6, 1);
        pass.set_immediates(0, &[1]);
        pass.draw(6, 1);
        pass.execute_bundles(&[bundle, bundle]);
        // A bundle leaves nothing set.
        pass.set_pipeline(pipeline);
        pass.set_bind_group_at(0, group, &[0, 0]);
        pass.set_immediates(0, &[5, 9]);
        pass.draw(6, 1);
    });
    // Hundreds: the uniform's window; tens: the list's, which begins at 256.
    assert_eq!(canvas.finish(), [431, 431, 227, 147, 0, 129, 0, 0]);
}

/// Occlusion queries count samples that pass, statistics what went through the stages, time stamps go up.
#[test]
fn queries() {
    let mut canvas = Canvas::new(64, 64, Format::Rgba8Unorm);
    let depth = canvas.lab.card.create_texture("depth", record::texture_2d(64, 64, Format::Depth32Float));
    let depth = canvas.lab.card.create_view(depth);
    let source = "
        var<immediate> r: array<f32, 5>;
        @vertex fn vs(@builtin(vertex_index) v: u32) -> @builtin(position) vec4f {
            let x = select(r[0], r[2], (v & 1u) == 1u);
            let y = select(r[1], r[3], v >= 2u);
            return vec4f(x / 32.0 - 1.0, 1.0 - y / 32.0, r[4], 1.0);
        }
        @fragment fn fs() -> @location(0) vec4f { return vec4f(1.0); }";
    let layout = canvas.lab.card.create_pipeline_layout([], 20);
    let pipeline = canvas.pipeline(source, |desc| {
        desc.layout = Some(layout);
        desc.primitive.topology = Topology::TriangleStrip;
        desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    });
    let culling = canvas.pipeline(source, |desc| {
        desc.layout = Some(layout);
        desc.primitive.topology = Topology::TriangleStrip;
        desc.primitive.cull_mode = CullMode::Front;
        desc.primitive.front_face = FrontFace::Cw;
        desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
    });
    let occlusion = canvas.lab.card.create_query_set(QueryKind::Occlusion, 6);
    let statistics = canvas.lab.card.create_query_set(QueryKind::PipelineStatistics(0b11111), 3);
    let some = canvas.lab.card.create_query_set(QueryKind::PipelineStatistics(0b01001), 2);
    let times = canvas.lab.card.create_query_set(QueryKind::Timestamp, 4);
    canvas.lab.card.push(Command::WriteTimestamp { set: times, index: 0 });
    canvas.lab.card.push(Command::BeginRenderPass {
        color: vec![Some(record::clear(canvas.view, [0.0; 4]))],
        depth: record::clear_depth(depth, true),
        occlusion: Some(occlusion),
        timestamps: Some(PassTimestamps { set: times, begin: Some(1), end: Some(2) }),
        label: None,
    });
    let rectangle = |pipeline, [x0, y0, x1, y1, z]: [f32; 5]| {
        [
            Command::SetRenderPipeline(pipeline),
            Command::SetImmediates { offset: 0, words: bits(&[x0, y0, x1, y1, z]) },
            Command::Draw { vertices: 4, instances: 1, first_vertex: 0, first_instance: 0 },
        ]
    };
    let begin = |index| vec![Command::BeginOcclusionQuery { index }];
    let end = || vec![Command::EndOcclusionQuery];
    let count = |set, index| vec![Command::BeginStatisticsQuery { set, index }];
    let counted = || vec![Command::EndStatisticsQuery];
    let draw = |rectangles: &[[f32; 5]]| -> Vec<Command> { rectangles.iter().flat_map(|&r| rectangle(pipeline, r)).collect() };
    let commands = [
        draw(&[[0.0, 0.0, 32.0, 64.0, 0.5]]),
        begin(1),
        // The first has half of its fragments behind the left half.
        draw(&[[16.0, 8.0, 48.0, 24.0, 0.7], [60.0, 60.0, 64.0, 64.0, 0.9]]),
        end(),
        begin(4),
        draw(&[[0.0, 0.0, 9.0, 9.0, 0.9]]),
        end(),
        count(statistics, 1),
        // In view; out of view; partly out of view; facing away.
        draw(&[[40.0, 40.0, 50.0, 50.0, 0.2], [70.0, 0.0, 80.0, 10.0, 0.2], [-10.0, 0.0, 2.0, 2.0, 0.1]]),
        rectangle(culling, [10.0, 10.0, 20.0, 20.0, 0.1]).to_vec(),
        counted(),
        count(some, 0),
        draw(&[[50.0, 0.0, 53.0, 3.0, 0.05]]),
        counted(),
        vec![Command::EndRenderPass],
    ];
    commands.into_iter().flatten().for_each(|command| canvas.lab.card.push(command));
    let compute = canvas.lab.compute("@compute @workgroup_size(6, 7) fn main() {}");
    {
        let mut pass = canvas.lab.card.begin_compute_pass();
        pass.set_pipeline(compute);
        pass.push(Command::BeginStatisticsQuery { set: statistics, index: 2 });
        pass.dispatch(2, 3, 1);
        pass.dispatch(1, 1, 1);
        pass.push(Command::EndStatisticsQuery);
    }
    canvas.lab.card.push(Command::WriteTimestamp { set: times, index: 3 });
    let result = canvas.lab.words(128);
    canvas.lab.card.resolve_queries(occlusion, 0, 5, result, 0);
    canvas.lab.card.resolve_queries(statistics, 1, 2, result, 256);
    canvas.lab.card.resolve_queries(some, 0, 1, result, 384);
    let stamps = canvas.lab.words(64);
    canvas.lab.card.resolve_queries(times, 0, 4, stamps, 0);
    canvas.lab.show_buffer(stamps, 64);
    canvas.lab.show_buffer(result, 128);
    let frames = canvas.lab.frames().unwrap_or_else(|error| panic!("{error}"));
    let numbers =
        |frame: &[u8]| -> Vec<u64> { frame.chunks_exact(8).map(|b| u64::from_le_bytes(b.try_into().unwrap())).collect() };
    let got = numbers(&frames[1]);
    assert_eq!(got[..5], [0, 16 * 16 + 16, 0, 0, 0], "samples passed");
    // Sixteen vertices, eight triangles, six of them in view; 100 + 4 fragments; no compute invocation.
    assert_eq!(got[32..42], [16, 8, 6, 104, 0, 0, 0, 0, 0, 7 * 42]);
    assert_eq!(got[48..50], [4, 9]);
    let stamps = numbers(&frames[0]);
    assert!(stamps[..4].windows(2).all(|w| w[0] < w[1]), "{:?}", &stamps[..4]);
}

/// Every fragment of a draw counts as shaded and as passing, also where a later one of the same draw covers it.
#[test]
fn queries_count_what_is_overwritten() {
    let mut canvas = Canvas::new(32, 32, Format::Rgba8Unorm);
    let source = format!("{COVER} @fragment fn fs() -> @location(0) vec4f {{ return vec4f(1.0); }}");
    let pipeline = canvas.pipeline(&source, |_| {});
    let occlusion = canvas.lab.card.create_query_set(QueryKind::Occlusion, 1);
    let statistics = canvas.lab.card.create_query_set(QueryKind::PipelineStatistics(0b1000), 2);
    {
        let color = [record::clear(canvas.view, [0.0; 4])];
        let mut pass = canvas.lab.card.begin_render_pass_with(color, None, Some(occlusion));
        pass.set_pipeline(pipeline);
        pass.push(Command::BeginStatisticsQuery { set: statistics, index: 0 });
        pass.occlusion_query(0, |pass| pass.draw(3, 5));
        pass.push(Command::EndStatisticsQuery);
        // Here nobody counts samples.
        pass.push(Command::BeginStatisticsQuery { set: statistics, index: 1 });
        pass.draw(3, 5);
        pass.push(Command::EndStatisticsQuery);
    }
    let result = canvas.lab.words(132);
    canvas.lab.card.resolve_queries(occlusion, 0, 1, result, 0);
    canvas.lab.card.resolve_queries(statistics, 0, 2, result, 256);
    let got = canvas.lab.read(result, 132);
    assert_eq!((got[0], got[64], got[66]), (5 * 1024, 5 * 1024, 5 * 1024));
}

/// Two colours of the fragment stage in one equation.
#[test]
fn dual_source_blending() {
    let mut canvas = Canvas::new(4, 4, Format::Rgba8Unorm);
    let source = format!(
        "enable dual_source_blending; {COVER}
         struct Two {{ @location(0) @blend_src(0) color: vec4f, @location(0) @blend_src(1) weight: vec4f }}
         @fragment fn fs() -> Two {{ return Two(vec4f(0.5, 0.25, 1.0, 0.5), vec4f(0.2, 1.0, 0.4, 0.5)); }}"
    );
    let component = BlendComponent { src: BlendFactor::Src1, dst: BlendFactor::OneMinusSrc1, op: BlendOp::Add };
    let alpha = BlendComponent { src: BlendFactor::Src1Alpha, dst: BlendFactor::OneMinusSrc1Alpha, op: BlendOp::Add };
    let pipeline = canvas.pipeline(&source, |desc| {
        desc.targets[0].as_mut().unwrap().blend = Some(Blend { color: component, alpha });
    });
    let view = canvas.view;
    {
        let mut pass = canvas.lab.card.begin_render_pass([record::clear(view, [1.0, 0.0, 0.2, 0.0])], None);
        pass.set_pipeline(pipeline);
        pass.draw(3, 1);
    }
    // source * weight + target * (1 - weight)
    let expected = [0.5 * 0.2 + 0.8, 0.25, 0.4 + 0.2 * 0.6, 0.25].map(|x: f64| (x * 255.0).round() as u8);
    let got = canvas.finish()[0].to_le_bytes();
    for c in 0..4 {
        assert!(got[c].abs_diff(expected[c]) <= 1, "{got:?} is not {expected:?}");
    }
}

/// The fragment stage sees the depth that is not clamped, bias and samples included; what is tested and written is clamped.
#[test]
fn the_fragment_stage_sees_depth_beyond_the_viewport() {
    for (samples, unclipped, bias, late) in [
        (1, true, 0, false),
        (1, true, 0, true),
        (4, true, 0, false),
        (1, true, 1 << 22, false),
        (1, false, 0, false),
        (4, false, 1 << 22, false),
    ] {
        let mut canvas = Canvas::new(16, 1, Format::R32Float);
        let source = format!(
            "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{
                // Depth goes from -1 at the left edge to 2 at the right, by perspective.
                let x = f32(i & 1u) * 4.0 - 1.0;
                let w = {};
                return vec4f(x, f32(i >> 1u) * 4.0 - 1.0, x * 1.5 + 0.5, 1.0) * w;
            }}
            @fragment fn fs(@builtin(position) p: vec4f {}) -> {} {{",
            if unclipped { "f32(i + 1u)" } else { "1.0" },
            if samples == 4 { ", @builtin(sample_index) s: u32" } else { "" },
            if late { "F" } else { "@location(0) f32" },
        );
        let source = match late {
            true => {
                format!("struct F {{ @location(0) z: f32, @builtin(frag_depth) depth: f32 }} {source} return F(p.z, p.z); }}")
            }
            false => format!("{source} return p.z; }}"),
        };
        let pipeline = canvas.pipeline(&source, |desc| {
            desc.primitive.unclipped_depth = unclipped;
            desc.multisample.count = samples;
            desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
            let state = desc.depth_stencil.as_mut().unwrap();
            (state.depth_compare, state.bias) = (Compare::Always, bias as f32);
        });
        let made = |format| match samples {
            1 => record::texture_2d(16, 1, format),
            _ => record::texture_multisampled(16, 1, 4, format),
        };
        let [color, depth] = [Format::R32Float, Format::Depth32Float].map(|f| canvas.lab.card.create_texture("", made(f)));
        let views = [color, depth].map(|texture| canvas.lab.card.create_view(texture));
        {
            let depth = record::clear_depth(views[1], true);
            let mut pass = canvas.lab.card.begin_render_pass([record::clear(views[0], [9.0; 4])], depth);
            pass.set_viewport(Viewport { x: 0.0, y: 0.0, width: 16.0, height: 1.0, min_depth: 0.25, max_depth: 0.75 });
            pass.set_pipeline(pipeline);
            pass.draw(3, 1);
        }
        // Both, sample by sample, in a buffer.
        let kinds = if samples == 4 {
            ["texture_multisampled_2d<f32>", "texture_depth_multisampled_2d"]
        } else {
            ["texture_2d<f32>", "texture_depth_2d"]
        };
        let reader = format!(
            "@group(0) @binding(0) var<storage, read_write> out: array<f32>;
             @group(0) @binding(1) var color: {};
             @group(0) @binding(2) var depth: {};
             @compute @workgroup_size(16) fn main(@builtin(local_invocation_index) x: u32) {{
                 for (var s = 0; s < {samples}; s++) {{
                     out[8 * x + 2 * u32(s)] = textureLoad(color, vec2u(x, 0), s).x;
                     out[8 * x + 2 * u32(s) + 1] = textureLoad(depth, vec2u(x, 0), s);
                 }}
             }}",
            kinds[0], kinds[1],
        );
        let result = canvas.lab.words(128);
        let reader = canvas.lab.compute(&reader);
        let resources = vec![record::whole(result), BoundResource::View(views[0]), BoundResource::View(views[1])];
        canvas.lab.dispatch(reader, [1, 1, 1], resources);
        let got = floats(&canvas.lab.read(result, 128));
        let sample_x = if samples == 4 { [0.375, 0.875, 0.125, 0.625] } else { [0.5; 4] };
        let mut beyond = 0;
        for x in 0..16 {
            for s in 0..samples as usize {
                let ndc = (x as f64 + sample_x[s]) / 16.0 * 3.0 - 1.0;
                if !unclipped && !(0.0..=1.0).contains(&ndc) {
                    continue;
                }
                let exact = 0.25 + 0.5 * ndc;
                // The bias is the step of a float at the greatest depth of the primitive times the constant.
                let greatest: f64 = if unclipped { 0.25 + 0.5 * 5.0 } else { 0.75 };
                let offset = f64::from(bias) * 2f64.powi(greatest.log2().floor() as i32 - 23);
                let want = exact + offset;
                let (seen, written) = (got[8 * x + 2 * s], got[8 * x + 2 * s + 1]);
                let name = format!("pixel {x}, sample {s} of {samples}, unclipped {unclipped}, bias {bias}, late {late}");
                assert_near(seen, want, 0.0, 1e-2, &name);
                assert_eq!(written, seen.clamp(0.25, 0.75), "{name}");
                beyond += u32::from(!(0.25..=0.75).contains(&seen));
            }
        }
        assert_eq!(beyond > 0, unclipped || bias > 0);
    }
}

/// Depths beyond the planes: cut away, or kept and clamped where the pipeline says so.
#[test]
fn unclipped_depth() {
    for unclipped in [false, true] {
        let mut canvas = Canvas::new(16, 1, Format::R32Uint);
        let source = "
            @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
                // Depth goes from -1 at the left edge to 2 at the right.
                let x = f32(i & 1u) * 4.0 - 1.0;
                return vec4f(x, f32(i >> 1u) * 4.0 - 1.0, x * 1.5 + 0.5, 1.0);
            }
            @fragment fn fs() -> @location(0) u32 { return 1u; }";
        let pipeline = canvas.pipeline(source, |desc| {
            desc.primitive.unclipped_depth = unclipped;
            desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
            desc.depth_stencil.as_mut().unwrap().depth_compare = Compare::Always;
        });
        let texture = canvas.lab.card.create_texture("depth", record::texture_2d(16, 1, Format::Depth32Float));
        let depth = canvas.lab.card.create_view(texture);
        let attachment = record::clear_depth(depth, true).map(|d| DepthAttachment { depth_clear: Some(0.25), ..d });
        {
            let color = [record::clear(canvas.view, [0.0; 4])];
            let mut pass = canvas.lab.card.begin_render_pass(color, attachment);
            pass.set_pipeline(pipeline);
            pass.draw(3, 1);
        }
        let result = canvas.lab.words(64);
        let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
        canvas.lab.card.copy_texture_to_buffer(whole(texture), result, layout, [16, 1, 1]);
        let got = floats(&canvas.lab.read(result, 16));
        for (x, &depth) in got.iter().enumerate() {
            let z = (x as f64 + 0.5) / 16.0 * 3.0 - 1.0;
            let want = if unclipped {
                z.clamp(0.0, 1.0)
            } else if (0.0..=1.0).contains(&z) {
                z
            } else {
                0.25
            };
            // Where the triangle is cut, its new corners are snapped to 1/256 of a pixel.
            assert_near(depth, want, 0.0, 3.0 / 16.0 / 512.0 + 1e-6, &format!("pixel {x}, unclipped {unclipped}"));
        }
    }
}

/// Planes of the program's own.
#[test]
fn clip_distances() {
    let mut canvas = Canvas::new(8, 8, Format::R32Uint);
    let source = "
        enable clip_distances;
        struct V { @builtin(position) p: vec4f, @builtin(clip_distances) d: array<f32, 3> }
        @vertex fn vs(@builtin(vertex_index) i: u32) -> V {
            let p = vec2f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0);
            // Right of the second pixel, above the last two rows, and left of a slanted line.
            return V(vec4f(p, 0.5, 1.0), array<f32, 3>(p.x + 0.5, p.y + 0.5, 1.0 - p.x - p.y * 0.001));
        }
        @fragment fn fs(v: V) -> @location(0) u32 { return u32(v.p.x) + 10u; }";
    let source = source.replace("fs(v: V)", "fs(@builtin(position) at: vec4f)").replace("u32(v.p.x)", "u32(at.x)");
    let pipeline = canvas.pipeline(&source, |_| {});
    canvas.pass(|pass| {
        pass.set_pipeline(pipeline);
        pass.draw(3, 1);
    });
    let got = canvas.finish();
    for y in 0..8 {
        for x in 0..8 {
            let inside = x >= 2 && y < 6;
            assert_eq!(got[8 * y + x], if inside { 10 + x as u32 } else { 0 }, "pixel {x}, {y}");
        }
    }
}

/// Positions blended from four matrices each, then moved by weighted targets in a texture: what leaves the vertex stage.
#[test]
fn skinning_and_morphing() {
    const N: usize = 40;
    let mut next = unit_noise(31);
    let joints: Vec<f32> = (0..8 * 16).map(|_| 2.0 * next() - 1.0).collect();
    let morphs: Vec<f32> = (0..3 * N * 4).map(|_| next() - 0.5).collect();
    let mut vertices = Vec::new();
    let mut rows = Vec::new();
    for _ in 0..N {
        let position = [next(), next(), next()];
        let indices: [u8; 4] = std::array::from_fn(|_| (next() * 8.0) as u8);
        let weights: [u8; 4] = std::array::from_fn(|_| (next() * 255.0) as u8);
        vertices.extend(bits(&position));
        vertices.push(u32::from_le_bytes(indices));
        vertices.push(u32::from_le_bytes(weights));
        rows.push((position, indices, weights));
    }
    let mut canvas = Canvas::new(N as u32, 1, Format::Rgba32Float);
    let source = format!(
        "struct Skin {{ joints: array<mat4x4f, 8> }}
         struct Weights {{ list: array<vec4f, 1> }}
         @group(0) @binding(0) var<uniform> skin: Skin;
         @group(0) @binding(1) var<uniform> weights: Weights;
         @group(0) @binding(2) var morphs: texture_3d<f32>;
         struct In {{ @location(0) p: vec3f, @location(1) joints: vec4u, @location(2) weights: vec4f, @builtin(vertex_index) v: u32 }}
         struct Out {{ @builtin(position) at: vec4f, @location(0) @interpolate(flat) p: vec4f }}
         fn morphed(v: u32, p: vec3f) -> vec3f {{
             var out = p;
             for (var k = 0u; k < 3u; k++) {{
                 let w = weights.list[k >> 2u][k & 3u];
                 if w == 0.0 {{ continue; }}
                 out += w * textureLoad(morphs, vec3u(v, 0u, k), 0).xyz;
             }}
             return out;
         }}
         @vertex fn vs(i: In) -> Out {{
             let m = skin.joints[i.joints.x] * i.weights.x + skin.joints[i.joints.y] * i.weights.y
                 + skin.joints[i.joints.z] * i.weights.z + skin.joints[i.joints.w] * i.weights.w;
             return Out(vec4f((f32(i.v) + 0.5) / {N}.0 * 2.0 - 1.0, 0.0, 0.5, 1.0), m * vec4f(morphed(i.v, i.p), 1.0));
         }}
         @fragment fn fs(o: Out) -> @location(0) vec4f {{ return o.p; }}"
    );
    let pipeline = canvas.pipeline(&source, |desc| {
        desc.primitive.topology = Topology::PointList;
        desc.buffers = vec![record::vertex_buffer(&[
            (0, VertexFormat::Float32x3),
            (1, VertexFormat::Uint8x4),
            (2, VertexFormat::Unorm8x4),
        ])];
    });
    let factors = [0.5f32, 0.0, -1.25, 0.0];
    let texture = TextureDesc {
        dimension: TextureDimension::D3,
        size: [N as u32, 1, 3],
        ..record::texture_2d(1, 1, Format::Rgba32Float)
    };
    let texture = canvas.lab.card.create_texture("morphs", texture);
    canvas.lab.card.write_level(texture, 0, "morphs", &bytes(&bits(&morphs)));
    let texture = canvas.lab.card.create_view(texture);
    let (skin, weights, vertices): (BufferId, BufferId, BufferId) =
        (canvas.lab.buffer(&bits(&joints)), canvas.lab.buffer(&bits(&factors)), canvas.lab.buffer(&vertices));
    let group = canvas.lab.group(
        AnyPipeline::Render(pipeline),
        0,
        [record::whole(skin), record::whole(weights), BoundResource::View(texture)],
    );
    canvas.pass(|pass| {
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.set_vertex_buffer(0, vertices);
        pass.draw(N as u32, 1);
    });
    let got = floats(&canvas.finish());
    for (v, (position, indices, weights)) in rows.iter().enumerate() {
        let p: Vec<f64> = (0..4)
            .map(|c| match c {
                3 => 1.0,
                _ => (0..3)
                    .fold(f64::from(position[c]), |p, k| p + f64::from(factors[k]) * f64::from(morphs[4 * (k * N + v) + c])),
            })
            .collect();
        for r in 0..4 {
            let want: f64 = (0..4)
                .map(|j| {
                    let m = |c: usize| f64::from(joints[16 * usize::from(indices[j]) + 4 * c + r]);
                    f64::from(weights[j]) / 255.0 * (0..4).map(|c| m(c) * p[c]).sum::<f64>()
                })
                .sum();
            assert_near(got[4 * v + r], want, 1e-5, 1e-5, &format!("vertex {v}, component {r}"));
        }
    }
}

/// Lights in clusters found by compute, summed by a physically based fragment stage over a cascade of shadows; against f64.
#[test]
fn clustered_lights_with_cascaded_shadows() {
    const W: usize = 16;
    let mut next = unit_noise(41);
    // Position and range, colour and intensity.
    let lights: Vec<f32> = (0..20)
        .flat_map(|_| {
            [next() * 16.0, next() * 16.0, 0.5 + next() * 2.0, 2.0 + 3.0 * next(), next(), next(), next(), 5.0 * next()]
        })
        .collect();
    let assign = "
        struct Light { position: vec3f, range: f32, color: vec3f, intensity: f32 }
        @group(0) @binding(0) var<storage, read> lights: array<Light>;
        @group(0) @binding(1) var<storage, read_write> clusters: array<vec2u, 16>;
        @group(0) @binding(2) var<storage, read_write> list: array<u32>;
        @group(0) @binding(3) var<storage, read_write> used: atomic<u32>;
        @compute @workgroup_size(16) fn main(@builtin(local_invocation_index) i: u32) {
            let low = vec2f(vec2u(i % 4u, i / 4u)) * 4.0;
            var found: array<u32, 20>;
            var n = 0u;
            for (var k = 0u; k < arrayLength(&lights); k++) {
                let light = lights[k];
                let nearest = clamp(light.position.xy, low, low + 4.0);
                if distance(nearest, light.position.xy) <= light.range { found[n] = k; n++; }
            }
            let first = atomicAdd(&used, n);
            for (var k = 0u; k < n; k++) { list[first + k] = found[k]; }
            clusters[i] = vec2u(first, n);
        }";
    let shade = "
        struct Light { position: vec3f, range: f32, color: vec3f, intensity: f32 }
        struct Cascade { texel: f32, far: f32 }
        struct View { eye: vec3f, roughness: f32, cascades: array<vec4f, 3>, metallic: f32 }
        @group(0) @binding(0) var<storage, read> lights: array<Light>;
        @group(0) @binding(1) var<storage, read> clusters: array<vec2u, 16>;
        @group(0) @binding(2) var<storage, read> list: array<u32>;
        @group(0) @binding(3) var<uniform> view: View;
        @group(0) @binding(4) var shadows: texture_depth_2d_array;
        @group(0) @binding(5) var compare: sampler_comparison;
        const PI = 3.14159265358979;
        fn distribution(nh: f32, a: f32) -> f32 { let a2 = a * a; let f = (nh * a2 - nh) * nh + 1.0; return a2 / (PI * f * f); }
        fn visibility(nv: f32, nl: f32, a: f32) -> f32 {
            let a2 = a * a;
            return 0.5 / (nl * sqrt((nv - a2 * nv) * nv + a2) + nv * sqrt((nl - a2 * nl) * nl + a2));
        }
        fn fresnel(u: f32, f0: vec3f) -> vec3f { return f0 + (vec3f(1.0) - f0) * pow(1.0 - u, 5.0); }
        fn cascade(x: f32) -> u32 {
            for (var k = 0u; k < 3u; k++) { if x < view.cascades[k].x { return k; } }
            return 2u;
        }
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {
            let p = vec3f(at.xy, 0.0);
            let n = normalize(vec3f(sin(at.x), cos(at.y * 0.5), 4.0));
            let v = normalize(view.eye - p);
            let base = vec3f(0.8, 0.4, 0.2);
            let f0 = mix(vec3f(0.04), base, view.metallic);
            let a = view.roughness * view.roughness;
            let range = clusters[u32(at.x) / 4u + u32(at.y) / 4u * 4u];
            var sum = vec3f(0.0);
            for (var k = range.x; k < range.x + range.y; k++) {
                let light = lights[list[k]];
                let d = light.position - p;
                let l = normalize(d);
                let nl = saturate(dot(n, l));
                if nl <= 0.0 { continue; }
                let h = normalize(l + v);
                let nv = max(dot(n, v), 1e-4);
                let s = distribution(saturate(dot(n, h)), a) * visibility(nv, nl, a) * fresnel(saturate(dot(v, h)), f0);
                let ratio = dot(d, d) / (light.range * light.range);
                let window = saturate(1.0 - ratio * ratio);
                let falloff = window * window / max(dot(d, d), 1e-4);
                sum += (base * (1.0 - view.metallic) / PI + s) * nl * light.color * light.intensity * falloff;
            }
            let c = cascade(at.x);
            let lit = textureSampleCompareLevel(shadows, compare, vec2f(0.5), c, view.cascades[c].y);
            return vec4f(sum * (0.25 + 0.75 * lit), f32(c) + lit * 0.5);
        }";
    let mut lab = Lab::new();
    let light_buffer = lab.card.create_buffer_init("lights", bytes(&bits(&lights)));
    let (clusters, list, used) = (lab.words(64), lab.words(512), lab.words(1));
    let assign = lab.compute(assign);
    lab.dispatch(assign, [1, 1, 1], [light_buffer, clusters, list, used].map(record::whole));
    // Three layers of one depth each, cleared by passes of their own: 0.2, 0.5, 0.8.
    let shadows =
        lab.card.create_texture("shadows", TextureDesc { size: [4, 4, 3], ..record::texture_2d(4, 4, Format::Depth16Unorm) });
    for layer in 0..3 {
        let desc = ViewDesc { base_layer: layer, layers: Some(1), dimension: Some(ViewDimension::D2), ..ViewDesc::default() };
        let view = lab.card.create_view_of(shadows, desc);
        let clear =
            record::clear_depth(view, true).map(|d| DepthAttachment { depth_clear: Some(0.2 + 0.3 * layer as f32), ..d });
        lab.card.begin_render_pass([], clear);
    }
    let shadows = lab.card.create_view(shadows);
    let compare = lab.card.create_sampler(SamplerDesc { compare: Some(Compare::LessEqual), ..SamplerDesc::default() });
    // Far ends 5, 10, 100; references 0.1 (lit), 0.6 (not), 0.79 (lit).
    let view = [8.0, 8.0, 10.0, 0.4, 5.0, 0.1, 0.0, 0.0, 10.0, 0.6, 0.0, 0.0, 100.0, 0.79, 0.0, 0.0, 0.3, 0.0, 0.0, 0.0];
    let view = lab.buffer(&bits(&view));
    let resources = vec![
        record::whole(light_buffer),
        BoundResource::Buffer { buffer: clusters, offset: 0, size: Some(128) },
        record::whole(list),
        record::whole(view),
        BoundResource::View(shadows),
        BoundResource::Sampler(compare),
    ];
    let got = floats(&paint(lab, shade, [W as u32, W as u32], Format::Rgba32Float, resources));
    let pi = std::f64::consts::PI;
    for y in 0..W {
        for x in 0..W {
            let at = [x as f64 + 0.5, y as f64 + 0.5];
            let n = dvec3(at[0].sin(), (at[1] * 0.5).cos(), 4.0).normalize();
            let v = dvec3(8.0 - at[0], 8.0 - at[1], 10.0).normalize();
            let (base, metallic, a) = (dvec3(0.8, 0.4, 0.2), 0.3, 0.16);
            let a2: f64 = a * a;
            let mut sum = DVec3::ZERO;
            for light in lights.chunks(8) {
                let q: Vec<f64> = light.iter().map(|&x| f64::from(x)).collect();
                let d = dvec3(q[0] - at[0], q[1] - at[1], q[2]);
                let l = d.normalize();
                let nl = n.dot(l).clamp(0.0, 1.0);
                let window = (1.0 - (d.length_squared() / (q[3] * q[3])).powi(2)).clamp(0.0, 1.0);
                if nl <= 0.0 || window == 0.0 {
                    continue;
                }
                let h = (l + v).normalize();
                let (nv, nh, vh) = (n.dot(v).max(1e-4), n.dot(h).clamp(0.0, 1.0), v.dot(h).clamp(0.0, 1.0));
                let f = (nh * a2 - nh) * nh + 1.0;
                let smith = nl * ((nv - a2 * nv) * nv + a2).sqrt() + nv * ((nl - a2 * nl) * nl + a2).sqrt();
                let s = a2 / (pi * f * f) * 0.5 / smith;
                for c in 0..3 {
                    let f0 = 0.04 * (1.0 - metallic) + base[c] * metallic;
                    let fresnel = f0 + (1.0 - f0) * (1.0 - vh).powi(5);
                    sum[c] += (base[c] * (1.0 - metallic) / pi + s * fresnel) * nl * q[4 + c] * q[7] * window * window
                        / d.length_squared().max(1e-4);
                }
            }
            let (cascade, lit) = if at[0] < 5.0 {
                (0.0, 1.0)
            } else if at[0] < 10.0 {
                (1.0, 0.0)
            } else {
                (2.0, 1.0)
            };
            let pixel = &got[4 * (y * W + x)..4 * (y * W + x) + 4];
            for c in 0..3 {
                assert_near(pixel[c], sum[c] * (0.25 + 0.75 * lit), 2e-4, 1e-5, &format!("pixel {x}, {y}, channel {c}"));
            }
            assert_eq!(f64::from(pixel[3]), cascade + lit * 0.5, "pixel {x}, {y}: cascade");
        }
    }
}
