//! What is left out of a trace for what is asked of each frame, against the trace rendered whole: random frames that read what others have
//! left in every way that there is.

use gfx::format::Format;
use num::*;
use render::{self, Dependencies, Need, Options, Want};
use trace::Trace;
use trace::command::*;
use trace::record::{self, Recorder, whole};
use work::{Areas, Event, Funnel};

/// All programs; what is drawn where follows from the number of the instance.
const PROGRAMS: &str = "
    struct Out { @builtin(position) at: vec4f, @location(0) @interpolate(flat) number: u32 }
    fn place(i: u32, n: u32) -> Out {
        let corner = vec2f(f32(n & 3u), f32(n >> 2u & 3u)) * 0.5 - 1.0;
        let size = 0.4 + f32(n >> 4u & 3u) * 0.6;
        let at = corner + size * vec2f(f32(i % 3u & 1u), f32(i % 3u >> 1u));
        return Out(vec4f(at, f32(n >> 6u & 7u) / 8.0, 1.0), n);
    }
    @group(0) @binding(0) var image: texture_2d<f32>;
    @group(0) @binding(1) var<storage, read_write> memory: array<atomic<u32>>;
    @group(0) @binding(2) var<storage, read> words: array<u32>;
    @vertex fn plain(@builtin(vertex_index) i: u32, @builtin(instance_index) n: u32) -> Out { return place(i, n); }
    @vertex fn moved(@builtin(vertex_index) i: u32, @builtin(instance_index) n: u32) -> Out { return place(i, n ^ words[n & 7u]); }
    @fragment fn paint(in: Out) -> @location(0) vec4f { return vec4f(f32(in.number & 255u), f32(in.number >> 3u & 255u), 7.0, 255.0) / 255.0; }
    @fragment fn look(in: Out) -> @location(0) vec4f { return textureLoad(image, vec2u(in.at.xy) / 2u, 0) * 0.75 + 0.1; }
    @fragment fn sieve(in: Out) -> @location(0) vec4f {
        let seen = textureLoad(image, vec2u(in.at.xy), 0);
        if seen.x > 0.3 { discard; }
        return seen + 0.2;
    }
    @fragment fn mark(in: Out) -> @location(0) vec4f {
        atomicAdd(&memory[in.number & 7u], 1u);
        return vec4f(0.5);
    }
    @group(0) @binding(3) var<storage, read_write> state: array<u32>;
    @compute @workgroup_size(8) fn step(@builtin(local_invocation_index) i: u32) { state[i] = state[i] * 5u + i + 1u; }
    @group(0) @binding(4) var<storage, read_write> arguments: array<u32>;
    @compute @workgroup_size(1) fn decide() {
        arguments[0] = 3u * (words[1] & 1u);
        arguments[1] = 1u;
        arguments[2] = 0u;
        arguments[3] = words[2] & 511u;
    }
";

const FRAMES: u32 = 7;

/// A trace of random frames.
fn random_frames(seed: u64) -> Trace {
    let mut random = Random::new(seed);
    let mut pick = move |n: u32| random.bits() % n;
    let mut card = Recorder::new("frames");
    let shader = card.create_shader("programs", PROGRAMS);
    let format = Format::Rgba8Unorm;
    let colors: [TextureId; 3] = std::array::from_fn(|_| card.create_texture("", record::texture_2d(16, 16, format)));
    let views = colors.map(|color| card.create_view(color));
    let samples = card.create_texture("samples", record::texture_multisampled(16, 16, 4, format));
    let samples = card.create_view(samples);
    let depth = card.create_texture("depth", record::texture_2d(16, 16, Format::Depth32Float));
    let depth = card.create_view(depth);
    let memory = card.create_buffer("memory", 256);
    let arguments = card.create_buffer("arguments", 256);
    let queries = card.create_query_set(QueryKind::Occlusion, 2);
    let mut pipeline = |vertex: &str, fragment: &str, deep: bool, samples: u32| {
        let mut desc = record::render_pipeline(shader, format);
        desc.vertex = record::stage_entry(shader, vertex);
        desc.fragment = Some(record::stage_entry(shader, fragment));
        desc.depth_stencil = deep.then(|| record::depth_less(Format::Depth32Float));
        desc.multisample.count = samples;
        card.create_render_pipeline("", desc)
    };
    let kinds = [("plain", "paint"), ("moved", "paint"), ("plain", "look"), ("plain", "sieve"), ("plain", "mark")];
    let flat = kinds.map(|(vertex, fragment)| pipeline(vertex, fragment, false, 1));
    let deep = kinds.map(|(vertex, fragment)| pipeline(vertex, fragment, true, 1));
    let multisampled = pipeline("plain", "paint", false, 4);
    let [step, decide] =
        ["step", "decide"].map(|entry| card.create_compute_pipeline("", None, record::stage_entry(shader, entry)));
    for _ in 0..FRAMES {
        for _ in 0..2 + pick(5) {
            let (to, from, number) = (pick(3) as usize, pick(2) as usize, pick(512));
            let from = (to + 1 + from) % 3;
            let mut attachment =
                if pick(2) == 0 { record::clear(views[to], [0.1, 0.2, 0.3, 1.0]) } else { record::load(views[to]) };
            match pick(8) {
                kind @ 0..=3 => {
                    let (at, tested, indirect, asked) = (pick(5) as usize, pick(2) == 0, pick(4) == 0, pick(4) == 0);
                    let pipeline = if tested { deep[at] } else { flat[at] };
                    let resources = match at {
                        1 => vec![(2, whole(memory))],
                        2 | 3 => vec![(0, BoundResource::View(views[from]))],
                        4 => vec![(1, whole(memory))],
                        _ => vec![],
                    };
                    let layout = card.get_bind_group_layout(AnyPipeline::Render(pipeline), 0);
                    let group = (!resources.is_empty()).then(|| card.create_bind_group(layout, resources));
                    attachment.store = kind != 3 || pick(3) != 0;
                    let depth = tested.then(|| {
                        let mut depth = record::clear_depth(depth, pick(2) == 0).expect("an attachment");
                        depth.depth_clear = depth.depth_clear.filter(|_| kind == 0);
                        depth
                    });
                    let mut draws = vec![Command::SetRenderPipeline(pipeline)];
                    draws.extend(group.map(|group| Command::SetBindGroup { index: 0, group: Some(group), offsets: vec![] }));
                    draws.push(Command::Draw { vertices: 3, instances: 2, first_vertex: 0, first_instance: number });
                    if indirect {
                        let buffer = arguments;
                        draws.push(Command::DrawIndirect { buffer, offset: 0, indexed: false, count: 1, count_buffer: None });
                    }
                    // Some of them in a bundle, which is destroyed behind the pass.
                    let bundled = (pick(3) == 0).then(|| {
                        let mut bundle = card.begin_bundle();
                        draws.drain(..).for_each(|command| bundle.push(command));
                        bundle.id()
                    });
                    draws.extend(bundled.map(|bundle| Command::ExecuteBundles(vec![bundle])));
                    card.push(Command::BeginRenderPass {
                        color: vec![Some(attachment)],
                        depth,
                        occlusion: asked.then_some(queries),
                        timestamps: None,
                        label: None,
                    });
                    if asked {
                        card.push(Command::BeginOcclusionQuery { index: 0 });
                    }
                    draws.into_iter().for_each(|command| card.push(command));
                    if asked {
                        card.push(Command::EndOcclusionQuery);
                    }
                    card.push(Command::EndRenderPass);
                    bundled.into_iter().for_each(|bundle| card.push(Command::Destroy(Object::Bundle(bundle))));
                    if asked {
                        card.resolve_queries(queries, 0, 1, memory, 8 * u64::from(pick(4)));
                    }
                }
                4 => {
                    let resolved = record::clear_and_resolve(samples, [0.0; 4], views[to]);
                    let mut pass = card.begin_render_pass([resolved], None);
                    pass.set_pipeline(multisampled);
                    pass.draw_from(3, 1, 0, number);
                }
                kind @ 5..=6 => {
                    let (pipeline, resources) = match kind {
                        5 => (step, vec![(3, whole(memory))]),
                        _ => (decide, vec![(2, whole(memory)), (4, whole(arguments))]),
                    };
                    let layout = card.get_bind_group_layout(AnyPipeline::Compute(pipeline), 0);
                    let group = card.create_bind_group(layout, resources);
                    let mut pass = card.begin_compute_pass();
                    pass.set_pipeline(pipeline);
                    pass.set_bind_group(0, group);
                    pass.dispatch(1, 1, 1);
                }
                _ => {
                    let end = |texture| TextureEnd { texture, level: 0, origin: [0; 3], aspect: Default::default() };
                    card.copy_texture_to_texture(end(colors[from]), end(colors[to]), [16, 16, 1]);
                }
            }
        }
        card.present(colors[pick(3) as usize]);
    }
    card.finish()
}

/// What a frame shows, the counts that do not depend on colours (the first four: nor on coverage), and what its primitives are expected to cover.
#[derive(Debug, PartialEq, Eq)]
struct Shown {
    picture: Vec<u8>,
    counts: [u64; 7],
    areas: Areas,
}

fn counts(funnel: &Funnel) -> [u64; 7] {
    let passed = funnel.quads_rasterized - funnel.quads_early_culled;
    [
        funnel.vertices_in,
        funnel.vertices_shaded,
        funnel.primitives_in,
        funnel.triangles_setup,
        funnel.quads_rasterized,
        funnel.fragments_covered,
        passed,
    ]
}

fn rendered(trace: &Trace, options: &Options) -> Vec<Shown> {
    let (mut frames, mut funnel, mut areas) = (Vec::new(), Funnel::default(), Areas::default());
    let mut each = |event| {
        match event {
            Event::Segment(segment) => {
                funnel += segment.funnel;
                areas += segment.areas;
            }
            Event::EndFrame(end) => {
                let (counts, areas) = (counts(&std::mem::take(&mut funnel)), std::mem::take(&mut areas));
                frames.push(Shown { picture: end.reference.to_vec(), counts, areas });
            }
            _ => {}
        }
        Ok(())
    };
    render::render(trace, options, &mut each).unwrap_or_else(|error| panic!("{error}"));
    frames
}

#[test]
fn what_is_left_out_changes_nothing_that_is_asked_for() {
    let mut left_out = [0; 4];
    for seed in 0..40 {
        let trace = random_frames(seed);
        let all = rendered(&trace, &Options { areas: true, ..Options::default() });
        let dependencies = Dependencies::of(&trace, u32::MAX).expect("it renders");
        assert_eq!(dependencies.frames(), FRAMES);
        for asked in 0..FRAMES {
            for others in [Want::Nothing, Want::Counts] {
                let needs = dependencies.needs(|frame| if frame == asked { Want::All } else { others }).expect("kept");
                needs.passes().iter().zip(&mut left_out).for_each(|(n, sum)| *sum += n);
                let some = rendered(&trace, &Options { needs: Some(needs.into()), areas: true, ..Options::default() });
                for (at, (some, all)) in some.iter().zip(&all).enumerate() {
                    if at == asked as usize {
                        assert_eq!(some, all, "seed {seed}, frame {at}");
                    } else if others == Want::Counts {
                        assert_eq!(
                            (&some.counts[..4], some.areas),
                            (&all.counts[..4], all.areas),
                            "seed {seed}, frame {at}, asked for {asked}"
                        );
                        assert!(some.picture.is_empty());
                    }
                }
            }
        }
    }
    // A good part is left out, ends behind geometry, or is drawn without colours.
    let passes: u64 = left_out.iter().sum();
    assert!(left_out.iter().all(|&n| 10 * n > passes), "{left_out:?} of {passes}");
}

#[test]
fn only_the_frame_that_is_asked_for_is_drawn_where_none_reads_another() {
    let mut card = Recorder::new("frames");
    let shader = card.create_shader("programs", PROGRAMS);
    let color = card.create_texture("", record::texture_2d(16, 16, Format::Rgba8Unorm));
    let view = card.create_view(color);
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.vertex = record::stage_entry(shader, "plain");
    desc.fragment = Some(record::stage_entry(shader, "paint"));
    let pipeline = card.create_render_pipeline("", desc);
    for frame in 0..4 {
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.draw_from(3, 1, 0, frame);
        drop(pass);
        card.present(color);
    }
    let dependencies = Dependencies::of(&card.finish(), u32::MAX).expect("it renders");
    let needs = dependencies.needs(|frame| if frame == 2 { Want::All } else { Want::Nothing }).expect("kept");
    assert_eq!([0, 1, 2, 3].map(|pass| needs.pass(pass)), [Need::Nothing, Need::Nothing, Need::Colors, Need::Nothing]);
    assert_eq!([1, 2].map(|frame| needs.picture(frame)), [false, true]);
}

/// Draws and dispatches without a vertex, instance or workgroup use nothing: what they would need may be missing, for rendering and for all
/// walks over the trace. Those that do something are refused alike.
#[test]
fn empty_draws_and_dispatches_need_no_bindings() {
    let of = |count: u32| {
        let mut card = Recorder::new("empty");
        let shader = card.create_shader("programs", PROGRAMS);
        let format = Format::Rgba8Unorm;
        let color = card.create_texture("", record::texture_2d(16, 16, format));
        let view = card.create_view(color);
        // Zeros.
        let arguments = card.create_buffer("arguments", 256);
        let mut desc = record::render_pipeline(shader, format);
        desc.vertex = record::stage_entry(shader, "moved");
        desc.fragment = Some(record::stage_entry(shader, "look"));
        let drawn = card.create_render_pipeline("", desc.clone());
        desc.fragment = Some(record::stage_entry(shader, "nowhere"));
        let refused = card.create_render_pipeline("", desc);
        let computed = card.create_compute_pipeline("", None, record::stage_entry(shader, "step"));
        let mut pass = card.begin_render_pass([record::clear(view, [0.5; 4])], None);
        pass.set_pipeline(refused);
        pass.draw(3, 0);
        pass.set_pipeline(drawn);
        pass.draw(0, 1);
        pass.draw(3, count);
        pass.draw_indirect(arguments, 0, false);
        drop(pass);
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(computed);
        pass.dispatch(4, 4, 0);
        pass.dispatch_indirect(arguments, 0);
        drop(pass);
        card.present(color);
        card.finish()
    };
    let trace = of(0);
    assert_eq!(rendered(&trace, &Options::default()).len(), 1);
    let dependencies = Dependencies::of(&trace, u32::MAX).unwrap_or_else(|error| panic!("{error}"));
    assert_eq!(dependencies.frames(), 1);
    let inspection = render::inspect(&trace).unwrap_or_else(|error| panic!("{error}"));
    assert!(inspection.refused.is_empty() && inspection.unused.len() == 1, "{:?}", inspection.refused);

    let trace = of(1);
    let fault = render::render(&trace, &Options::default(), &mut |_| Ok(())).map(|_| ()).expect_err("a binding is missing");
    let same = Dependencies::of(&trace, u32::MAX).map(|_| ()).expect_err("a binding is missing");
    assert_eq!(fault.to_string(), same.to_string());
}
