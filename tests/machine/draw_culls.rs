//! Draws and instances that bounds show to be out of view are left out, on whole traces: nothing else changes. (One pipeline at a time:
//! `render::draw::tests::cull`; the bounds themselves: `shader::tests::bounds`.)

use std::path::{Path, PathBuf};

use crate::common::entries;
use fillrate::gfx::format::Format;
use fillrate::gfx::state::VertexFormat;
use fillrate::import;
use fillrate::machine::Config;
use fillrate::render;
use fillrate::run::replay::{Fidelity, Options, Replay, replay};
use fillrate::trace::Trace;
use fillrate::trace::command::{AnyPipeline, BoundResource, Command, QueryKind};
use fillrate::trace::record::{self, Recorder};
use fillrate::work::{Cull, Culling, Event, Funnel, RenderKey};
use rayon::prelude::*;

/// The results of a render: pictures, the funnel, and the results of bounds tests.
#[derive(Default)]
struct Rendered {
    pictures: Vec<Vec<u8>>,
    funnel: Funnel,
    culling: Culling,
}

fn rendered(trace: &Trace, cull: Cull) -> Rendered {
    let mut out = Rendered::default();
    let key = RenderKey { cull, ..RenderKey::default() };
    // Only the first frames of a long sequence.
    let options = render::Options { record: true, key, frames: (0..6).into(), ..render::Options::default() };
    let mut keep = |event| {
        match event {
            Event::Draw(draw) => {
                let (sum, one) = (&mut out.culling, draw.culling);
                sum.tests += one.tests;
                sum.draws += one.draws;
                sum.instances += one.instances;
                sum.primitives += one.primitives;
                sum.vertices += one.vertices;
            }
            Event::Segment(segment) => out.funnel += segment.funnel,
            Event::EndFrame(end) => out.pictures.push(end.reference.to_vec()),
            _ => {}
        }
        Ok(())
    };
    render::render(trace, &options, &mut keep).unwrap_or_else(|error| panic!("{error}"));
    out
}

/// Renders with and without culling and compares. Returns how many of the primitives out of view were left out, by draws and by instances.
fn compared(name: &str, trace: &Trace) -> (u64, [Culling; 2]) {
    let plain = rendered(trace, Cull::None);
    assert_eq!(plain.culling, Culling::default(), "{name}");
    let left = [Cull::Draws, Cull::Instances].map(|cull| {
        let Rendered { pictures, funnel, culling } = rendered(trace, cull);
        assert!(pictures == plain.pictures, "{name}, {cull:?}: another picture");
        // All primitives that are left out would have been culled outside the view volume.
        let all = Funnel {
            primitives_in: funnel.primitives_in + culling.primitives,
            vertices_in: funnel.vertices_in + culling.vertices,
            culled_frustum: funnel.culled_frustum + culling.primitives,
            vertices_shaded: plain.funnel.vertices_shaded,
            ..funnel
        };
        assert_eq!(all, plain.funnel, "{name}, {cull:?}");
        assert!(funnel.vertices_shaded <= plain.funnel.vertices_shaded, "{name}, {cull:?}");
        culling
    });
    assert!(left[0].primitives <= left[1].primitives, "{name}: {left:?}");
    (plain.funnel.culled_frustum, left)
}

/// Compares traces, each under its name.
fn all(traces: &[PathBuf]) -> Vec<(String, u64, [Culling; 2])> {
    let each = |path: &PathBuf| {
        let name = path.file_stem().expect("a name").to_string_lossy().into_owned();
        let trace = import::open(path).unwrap_or_else(|error| panic!("{error}"));
        let (outside, left) = compared(&name, &trace);
        let [by_draw, by_instance] = left.map(|left| format!("{} by {} tests", left.primitives, left.tests));
        eprintln!("{name}: {outside} primitives out of view; left out {by_draw} of draws, {by_instance} of instances");
        (name, outside, left)
    };
    traces.par_iter().map(each).collect()
}

#[test]
fn scenes_are_drawn_the_same() {
    let found = all(&entries(&Path::new(env!("CARGO_MANIFEST_DIR")).join("traces")));
    let (_, outside, [by_draw, by_instance]) = found.iter().find(|(name, ..)| name == "town").expect("the town");
    assert_eq!((by_draw.draws, by_draw.primitives), (290, 7_692));
    assert_eq!((by_instance.instances, by_instance.primitives), (972, 15_876));
    // What remains: draws and instances in part out of view, and those behind a corner of it.
    assert!(by_instance.primitives * 100 > outside * 97, "{outside} primitives are out of view");
}

#[test]
fn visible_traces_are_drawn_the_same() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded wgpu traces to draw");
        return;
    };
    let traces: Vec<PathBuf> = entries(&Path::new(&root).join("wgpu")).into_iter().filter(|path| path.is_dir()).collect();
    assert!(!all(&traces).is_empty(), "no traces in FILLRATE_PEERS/wgpu");
}

fn simulated(trace: &Trace, sort: &str, cull: &str) -> Replay {
    let mut config = Config::built_in("four-pipelines").expect("it is built in");
    for setting in [format!("sort={sort}"), format!("command.cull={cull}"), "pipelines=2".into()] {
        config.set(&setting).unwrap_or_else(|error| panic!("{error}"));
    }
    let options = Options { frames: 0..1, ..Options::new(config, Fidelity::Cycle) };
    replay(trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{sort}, {cull}: {error:#}"))
}

#[test]
fn machines_of_all_classes_draw_what_is_left() {
    let trace = import::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/town.zip")).expect("a trace of the repository");
    let classes = ["sort-first", "sort-middle", "sort-middle-binned", "sort-last-fragment", "sort-last-image"];
    for sort in classes {
        let runs = ["none", "draws", "instances"].map(|cull| simulated(&trace, sort, cull));
        let number = |run: &Replay, path: &str| run.total.number(path).unwrap_or_else(|| panic!("{path}"));
        for run in &runs {
            assert!(run.frames[0].shown == runs[0].frames[0].shown, "{sort}: another picture");
            assert_eq!(number(run, "sort.wrong_pixels"), 0.0, "{sort}");
            let sum = |paths: [&str; 2]| paths.map(|path| number(run, path)).iter().sum::<f64>();
            assert_eq!(sum(["funnel.primitives_in", "command.primitives_culled"]), 22_942.0, "{sort}");
            assert_eq!(sum(["funnel.vertices_in", "command.vertices_culled"]), 68_826.0, "{sort}");
            // If each pipeline has its own depths, the fragments that pass depend on the distribution of triangles.
            let all = if sort == "sort-last-image" { 2 } else { 3 };
            for path in &["funnel.triangles_setup", "funnel.fragments_covered", "funnel.fragments_written"][..all] {
                assert_eq!(number(run, path), number(&runs[0], path), "{sort}: {path}");
            }
        }
        let tests = runs.each_ref().map(|run| number(run, "command.bounds_tested"));
        assert_eq!(tests, [0.0, 398.0, 398.0 + 1_060.0], "{sort}");
        let cycles = runs.each_ref().map(|run| number(run, "cycles"));
        assert!(cycles[1] < cycles[0], "{sort}: {cycles:?} cycles");
    }
}

const SHADER: &str = "
struct Varying { @builtin(position) position: vec4<f32> }
@vertex fn vertex(@location(0) at: vec4<f32>) -> Varying { return Varying(at); }
@fragment fn fragment() -> @location(0) vec4<f32> { return vec4<f32>(1.0); }
@group(0) @binding(0) var<storage, read_write> places: array<vec4<f32>>;
@compute @workgroup_size(1) fn move_in(@builtin(global_invocation_id) id: vec3<u32>) { places[id.x].x -= 4.0; }
";

/// How vertices that are out of view come into it.
#[derive(Clone, Copy, Debug)]
enum Comes {
    Never,
    Written,
    Copied,
    Cleared,
    Computed,
    /// The indices choose others.
    ByIndex,
}

/// Two frames with a triangle each, which is out of view in the first and may have come into it in the second.
fn moving(comes: Comes) -> Trace {
    let mut card = Recorder::new("moving");
    let bytes = |values: &[f32]| values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<u8>>();
    let corners = |x: f32| {
        let at = [[x - 0.5, -0.5], [x + 0.5, -0.5], [x, 0.5]];
        bytes(&at.iter().flat_map(|&[x, y]| [x, y, 0.5, 1.0]).collect::<Vec<f32>>())
    };
    let away = if let Comes::Cleared = comes {
        // Such that one x that becomes zero brings a part of it in.
        bytes(&[[4.0, -1.0, 0.5, 1.0], [4.0, 1.0, 0.5, 1.0], [4.0, 0.0, 0.5, 1.0]].concat())
    } else {
        corners(4.0)
    };
    let vertices = card.create_buffer_init("vertices", [away, corners(0.0)].concat());
    let others = card.create_buffer_init("others", corners(0.0));
    let index = |first: u16| (first..first + 3).chain([0]).flat_map(u16::to_le_bytes).collect::<Vec<u8>>();
    let indices = card.create_buffer_init("indices", index(0));
    let shader = card.create_shader("moving", SHADER);
    let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
    desc.buffers = vec![record::vertex_buffer(&[(0, VertexFormat::Float32x4)])];
    let pipeline = card.create_render_pipeline("moving", desc);
    let stage = record::stage(shader);
    let compute = card.create_compute_pipeline("moving", None, stage);
    let layout = card.get_bind_group_layout(AnyPipeline::Compute(compute), 0);
    let places = BoundResource::Buffer { buffer: vertices, offset: 0, size: None };
    let group = card.create_bind_group(layout, [(0, places)]);
    let target = card.create_texture("target", record::texture_2d(16, 16, Format::Rgba8Unorm));
    let view = card.create_view(target);
    for frame in 0..2 {
        if frame == 1 {
            match comes {
                Comes::Never => {}
                Comes::Written => card.write_buffer(vertices, 0, "again", corners(0.0)),
                Comes::Copied => card.copy_buffer_to_buffer((others, 0), (vertices, 0), 48),
                Comes::Cleared => card.push(Command::ClearBuffer { buffer: vertices, offset: 0, size: Some(4) }),
                Comes::Computed => {
                    let mut pass = card.begin_compute_pass();
                    pass.set_pipeline(compute);
                    pass.set_bind_group(0, group);
                    pass.dispatch(3, 1, 1);
                }
                Comes::ByIndex => card.write_buffer(indices, 0, "others", index(3)),
            }
        }
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.set_vertex_buffer(0, vertices);
        pass.set_index_buffer(indices, gfx::state::IndexFormat::Uint16);
        pass.draw_indexed(3, 1);
        drop(pass);
        card.present(target);
    }
    card.finish()
}

#[test]
fn what_has_come_into_view_is_drawn() {
    for comes in [Comes::Never, Comes::Written, Comes::Copied, Comes::Cleared, Comes::Computed, Comes::ByIndex] {
        let name = format!("{comes:?}");
        let trace = moving(comes);
        let (_, [by_draw, _]) = compared(&name, &trace);
        let stays = matches!(comes, Comes::Never);
        assert_eq!((by_draw.tests, by_draw.draws), (2, if stays { 2 } else { 1 }), "{name}");
        let pictures = rendered(&trace, Cull::Draws).pictures;
        assert_eq!(pictures[0] == pictures[1], stays, "{name}");
    }
}

#[test]
fn what_counts_primitives_is_not_tested() {
    let mut card = Recorder::new("counted");
    let shader = card.create_shader(
        "counted",
        "@vertex fn vertex(@builtin(vertex_index) i: u32) -> @builtin(position) vec4<f32> { return vec4<f32>(3.0 + f32(i), 0.0, 0.5, 1.0); }
         @fragment fn fragment() -> @location(0) vec4<f32> { return vec4<f32>(1.0); }",
    );
    let pipeline = card.create_render_pipeline("counted", record::render_pipeline(shader, Format::Rgba8Unorm));
    let set = card.create_query_set(QueryKind::PipelineStatistics(31), 1);
    let occlusion = card.create_query_set(QueryKind::Occlusion, 1);
    let target = card.create_texture("target", record::texture_2d(16, 16, Format::Rgba8Unorm));
    let view = card.create_view(target);
    let mut pass = card.begin_render_pass_with([record::clear(view, [0.0; 4])], None, Some(occlusion));
    pass.set_pipeline(pipeline);
    pass.draw(3, 1);
    pass.push(Command::BeginStatisticsQuery { set, index: 0 });
    pass.draw(3, 1);
    pass.push(Command::EndStatisticsQuery);
    // Samples are none either way.
    pass.occlusion_query(0, |pass| pass.draw(3, 1));
    drop(pass);
    card.present(target);
    let (_, [by_draw, by_instance]) = compared("counted", &card.finish());
    assert_eq!((by_draw.tests, by_draw.draws), (2, 2));
    assert_eq!(by_instance, by_draw);
}
