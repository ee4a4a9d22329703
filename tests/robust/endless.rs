//! Traces that ask for work without an end: they are refused before it begins where its amount is known, and stopped while they run where
//! it is not, with words that do not depend on the number of threads.

use std::path::{Path, PathBuf};

use fillrate::gfx::format::Format;
use fillrate::num::{BindGroupId, ComputePipelineId, RenderPipelineId, ViewId};
use fillrate::render::{self, Options};
use fillrate::trace::Trace;
use fillrate::trace::command::*;
use fillrate::trace::record::{self, Recorder};
use tempfile::TempDir;

use super::process::{Output, done, fillrate, refused};

const FORMAT: Format = Format::Rgba8Unorm;

/// A recorded trace in a folder that goes with it.
pub struct Hostile {
    folder: TempDir,
}

impl Hostile {
    pub fn new(card: Recorder) -> Hostile {
        let folder = TempDir::new().expect("a folder");
        card.save(folder.path()).unwrap_or_else(|error| panic!("{error}"));
        Hostile { folder }
    }

    pub fn path(&self) -> &Path {
        self.folder.path()
    }

    /// Replays it.
    pub fn replay(&self, options: &[&str]) -> Output {
        let arguments = ["replay".into(), self.path().as_os_str().to_owned(), "--fidelity".into(), "functional".into()];
        options.iter().fold(fillrate(arguments), |run, option| run.arg(option)).run()
    }
}

/// A pass with what is drawn in it; `fs` is the body of the fragment shader.
fn drawing(size: u32, fs: &str, draw: impl FnOnce(&mut Recorder, RenderPipelineId, ViewId)) -> Hostile {
    let mut card = Recorder::new("hostile");
    let texture = card.create_texture("target", record::texture_2d(size, size, FORMAT));
    let view = card.create_view(texture);
    let source = format!(
        "@vertex fn vs(@builtin(vertex_index) v: u32) -> @builtin(position) vec4f {{
            return vec4f(f32(v % 3u / 2u) * 4.0 - 1.0, f32(v % 3u % 2u) * 4.0 - 1.0, 0.5, 1.0);
        }}
        @fragment fn fs(@builtin(position) p: vec4f) -> @location(0) vec4f {{ {fs} }}"
    );
    let shader = card.create_shader("hostile", &source);
    let pipeline = card.create_render_pipeline("hostile", record::render_pipeline(shader, FORMAT));
    draw(&mut card, pipeline, view);
    Hostile::new(card)
}

/// A compute pass; `body` is that of a program whose workgroups have 64 invocations.
fn computing(body: &str, dispatch: impl FnOnce(&mut Recorder, ComputePipelineId, BindGroupId)) -> Hostile {
    let mut card = Recorder::new("hostile");
    let buffer = card.create_buffer("sums", 256);
    let source = format!(
        "@group(0) @binding(0) var<storage, read_write> b: array<u32>;
        @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{ {body} }}"
    );
    let shader = card.create_shader("hostile", &source);
    let pipeline = card.create_compute_pipeline("hostile", None, record::stage(shader));
    let layout = card.get_bind_group_layout(AnyPipeline::Compute(pipeline), 0);
    let group = card.create_bind_group(layout, [(0, record::whole(buffer))]);
    dispatch(&mut card, pipeline, group);
    Hostile::new(card)
}

fn dispatched(body: &str, [x, y, z]: [u32; 3]) -> Hostile {
    computing(body, |card, pipeline, group| {
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.dispatch(x, y, z);
    })
}

fn drawn(vertices: u32, instances: u32) -> Hostile {
    drawing(16, "return p;", |card, pipeline, view| {
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.draw(vertices, instances);
    })
}

/// Asserts that the message of a limit has the file, the command, and the remedy.
fn at_limit(output: &Output, command: &str, limit: &str) {
    refused(output, &["trace.ron:", ": command ", &format!("{command}: "), &format!("--limit {limit}=N allows more")]);
}

#[test]
fn what_is_known_to_be_endless_does_not_begin() {
    const MAX: u32 = u32::MAX;
    for (vertices, instances) in [(3, MAX), (MAX, 3), (MAX, MAX)] {
        at_limit(&drawn(vertices, instances).replay(&[]), "Draw", "work.vertices");
    }
    for groups in [[65_535, 65_535, 1], [65_535; 3]] {
        at_limit(&dispatched("b[0] = 1u;", groups).replay(&[]), "Dispatch", "work.workgroups");
    }
    // Few enough workgroups, and more operations than are allowed even without a loop.
    let output = dispatched("b[id.x & 63u] += id.x;", [65_535, 1, 1]).replay(&["--limit", "work.shader_steps=1000000"]);
    at_limit(&output, "Dispatch", "work.shader_steps");
}

#[test]
fn what_buffers_say_at_run_time_is_looked_at() {
    let garbage = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    for indexed in [false, true] {
        let hostile = drawing(16, "return p;", |card, pipeline, view| {
            let arguments = card.create_buffer_init("arguments", garbage(&[u32::MAX; 40]));
            let indices = card.create_buffer_init("indices", garbage(&[0, 1, 2]));
            let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
            pass.set_pipeline(pipeline);
            pass.set_index_buffer(indices, gfx::state::IndexFormat::Uint32);
            pass.push(Command::DrawIndirect { buffer: arguments, offset: 0, indexed, count: 8, count_buffer: None });
        });
        at_limit(&hostile.replay(&[]), "DrawIndirect", "work.vertices");
    }
    let hostile = computing("b[0] = 1u;", |card, pipeline, group| {
        let arguments = card.create_buffer_init("arguments", garbage(&[65_535; 3]));
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.dispatch_indirect(arguments, 0);
    });
    at_limit(&hostile.replay(&[]), "DispatchIndirect", "work.workgroups");
    // A million draws of nothing, and as many as a bundle can make of a few lines.
    let hostile = drawing(16, "return p;", |card, pipeline, view| {
        let arguments = card.create_buffer("arguments", 16 << 20);
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.push(Command::DrawIndirect { buffer: arguments, offset: 0, indexed: false, count: 1 << 20, count_buffer: None });
    });
    at_limit(&hostile.replay(&["--limit", "work.commands=1000000"]), "DrawIndirect", "work.commands");
    let hostile = drawing(16, "return p;", |card, pipeline, view| {
        let bundle = {
            let mut bundle = card.begin_bundle();
            bundle.set_pipeline(pipeline);
            (0..1000).for_each(|_| bundle.draw(0, 1));
            bundle.id()
        };
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.execute_bundles(&vec![bundle; 1000]);
    });
    at_limit(&hostile.replay(&["--limit", "work.commands=1000000"]), "ExecuteBundles", "work.commands");
}

#[test]
fn loops_in_loops_come_to_an_end() {
    const STEPS: [&str; 2] = ["--limit", "work.shader_steps=10000000"];
    // Each stays far below the turns that one loop may make.
    let nested = "var s = id.x;
        for (var i = 0u; i < 100000u; i++) { for (var j = 0u; j < 100000u; j++) { for (var k = 0u; k < 100000u; k++) { s = s * 3u + k; } } }
        b[0] = s;";
    at_limit(&dispatched(nested, [1, 1, 1]).replay(&STEPS), "Dispatch", "work.shader_steps");
    // Few turns in each of many workgroups.
    let short = "var s = id.x; for (var i = 0u; i < 1000u; i++) { s = s * 3u + i; } b[0] = s;";
    at_limit(&dispatched(short, [65_535, 200, 1]).replay(&STEPS), "Dispatch", "work.shader_steps");
    let endless = "loop { b[0] += 1u; if (b[1] == 7u) { break; } }";
    let output = dispatched(endless, [1, 1, 1]).replay(&[]);
    refused(&output, &["command ", "Dispatch: ", "main", "without an end", "--limit work.loop_turns=N"]);
    let output = dispatched(endless, [1, 1, 1]).replay(&["--limit", "work.loop_turns=1000"]);
    refused(&output, &["a loop ran 1000 times"]);
}

#[test]
fn what_threads_do_side_by_side_ends_with_the_same_words() {
    let hostile = drawing(
        1024,
        "var s = 0.0; for (var i = 0; i < 2000; i++) { s += fract(p.x * f32(i)); if (s > p.y * 3.0) { s = 0.0; } } return vec4f(s);",
        |card, pipeline, view| {
            let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
            pass.set_pipeline(pipeline);
            pass.draw(300, 1);
        },
    );
    let said = ["1", "2", "8"].map(|threads| {
        let output = hostile.replay(&["--threads", threads, "--limit", "work.shader_steps=5000000"]);
        at_limit(&output, "Draw", "work.shader_steps");
        output.stderr
    });
    assert!(said.iter().all(|text| *text == said[0]), "{said:?}");
    // Triangles over all of a large target, many times.
    let hostile = drawing(8192, "return p;", |card, pipeline, view| {
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.draw(3_000, 1);
    });
    let said = ["1", "2", "8"].map(|threads| {
        let output = hostile.replay(&["--threads", threads, "--limit", "work.quads=2000000"]);
        at_limit(&output, "Draw", "work.quads");
        output.stderr
    });
    assert!(said.iter().all(|text| *text == said[0]), "{said:?}");
}

#[test]
fn a_machine_stops_behind_the_cycles_that_it_may_take() {
    let hostile = dispatched("for (var k = 0u; k < 2000u; k++) { b[id.x & 63u] += k; }", [4, 1, 1]);
    let replay = |options: &[&str]| {
        let run = fillrate(["replay".as_ref(), hostile.path().as_os_str(), "--config".as_ref(), "tiny".as_ref()]);
        options.iter().fold(run, |run, option| run.arg(option)).run()
    };
    for options in [&[][..], &["--clock", "every-cycle"], &["--frames-per-run", "1"]] {
        let output = replay(&[options, &["--limit", "work.cycles=2000"]].concat());
        refused(&output, &["trace.ron: ", "more than 2000 cycles of a machine, the limit; --limit work.cycles=N allows more"]);
    }
    done(&replay(&["--limit", "work.cycles=10000000"]));
    // What its units do is looked at from time to time: with both clocks, and in one run or several, it is the same.
    let mut refusals = 0;
    for steps in [0, 20_000, 200_000, 2_000_000, 20_000_000, 200_000_000] {
        let limit = format!("work.machine_steps={steps}");
        let said: Vec<Output> = [&[][..], &["--clock", "every-cycle"], &["--frames-per-run", "1"], &["--threads", "1"]]
            .iter()
            .map(|options| replay(&[options, &["--limit", &limit][..]].concat()))
            .collect();
        assert!(said.iter().all(|other| other.status == said[0].status && other.stderr == said[0].stderr), "{said:?}");
        if !said[0].status.success() {
            refusals += 1;
            let text =
                format!("more than {steps} steps of a machine's units, the limit; --limit work.machine_steps=N allows more");
            refused(&said[0], &["trace.ron: ", &text]);
        }
    }
    assert!((2..=5).contains(&refusals), "{refusals}");
    // Without a machine there are no cycles.
    done(&hostile.replay(&["--limit", "work.cycles=1"]));
}

/// A frame of each recorded trace, and what it would come to in its most frames: a hundredth of every limit at most, a tenth of the bytes, and
/// a quarter of the steps, which take longest.
#[test]
fn recorded_traces_come_to_a_small_part_of_every_limit() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("traces");
    let mut paths: Vec<PathBuf> =
        std::fs::read_dir(&root).expect("the traces").map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    for path in paths {
        let trace = Trace::open(&path).unwrap_or_else(|error| panic!("{error}"));
        // The flight has 600 frames that are much alike; four of them are drawn here.
        let frames = if path.ends_with("flight.zip") { 4 } else { u32::MAX };
        let options = Options { frames: (0..frames).into(), record: true, ..Options::default() };
        let summary = render::render(&trace, &options, &mut |_| Ok(())).unwrap_or_else(|error| panic!("{error}"));
        let times = if frames == 4 { 150 } else { 1 };
        for meter in summary.ledger.meters() {
            let (spent, limit) = (meter.spent() * times, meter.limit().get());
            println!("{}: {} {spent} of {limit}", path.display(), meter.limit().info().name);
            let name = meter.limit().info().name;
            let share = match name {
                "work.shader_steps" => 4,
                "work.bytes" => 10,
                _ => 100,
            };
            assert!(spent * share <= limit, "{}: {name} {spent}, more than 1/{share} of {limit}", path.display());
        }
        println!("{}: most alive {}", path.display(), summary.ledger.most_alive());
    }
}
