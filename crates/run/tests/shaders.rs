//! Samples of sequences whose frames differ in their shaders alone: what is said of all frames is compared with the frames one by one.

use gfx::format::Format;
use machine::Config;
use num::{Random, RenderPipelineId};
use run::replay::{Fidelity, Options, replay_to};
use run::sample::Sampler;
use run::sample::survey::{Count, Observers};
use trace::Trace;
use trace::command::AnyPipeline;
use trace::record::{self, Recorder};

const FRAMES: u32 = 60;

/// Frames that are drawn beside the first.
const SAMPLES: usize = 8;

/// Draws of frames.
const SEEDS: u64 = 200;

/// What the fragment stages of some pipelines do: little, 8 operations in a row, and two loops.
const BODIES: [&str; 4] = [
    "c = c * 0.5;",
    "ROW",
    "for (var k = 0u; k < 32u; k++) { c = fma(c, vec4f(0.98), c.yzwx * 0.02); }",
    "for (var k = 0u; k < 20u; k++) { c = c * 0.99 + vec4f(sin(c.x), cos(c.y), c.z * c.y, 0.0) * 0.01; }",
];

/// A sequence whose frames draw over the whole target, with each pipeline as many times as `layers` says.
fn sequence(layers: impl Fn(u32) -> [u32; 4]) -> Trace {
    let mut card = Recorder::new("sequence");
    let format = Format::Rgba8Unorm;
    let pipeline = |card: &mut Recorder, body: &str| -> RenderPipelineId {
        let body = body.replace("ROW", &"c = fma(c, vec4f(0.98), c.yzwx * 0.02);".repeat(8));
        let source = format!(
            "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{
                 return vec4f(f32(i & 1u) * 4.0 - 1.0, f32(i >> 1u) * 4.0 - 1.0, 0.5, 1.0);
             }}
             @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{
                 var c = vec4f(at.xy / 256.0, 0.5, 1.0);
                 {body}
                 return c;
             }}"
        );
        let shader = card.create_shader("program", &source);
        card.create_render_pipeline("", record::render_pipeline(shader, format))
    };
    let pipelines = BODIES.map(|body| pipeline(&mut card, body));
    let target = card.create_texture("window", record::texture_2d(96, 64, format));
    let view = card.create_view(target);
    for frame in 0..FRAMES {
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        for (&pipeline, layers) in pipelines.iter().zip(layers(frame)) {
            pass.set_pipeline(pipeline);
            (0..layers).for_each(|_| pass.draw(3, 1));
        }
        drop(pass);
        card.present(target);
    }
    card.finish()
}

/// A sequence whose frames dispatch one of two programs over a buffer.
fn dispatches(of: impl Fn(u32) -> usize) -> Trace {
    let mut card = Recorder::new("sequence");
    let numbers = card.create_buffer("numbers", 4 * 4096);
    let programs = [2, 60].map(|turns| {
        let source = format!(
            "@group(0) @binding(0) var<storage, read_write> numbers: array<f32>;
             @compute @workgroup_size(64) fn main(@builtin(global_invocation_id) id: vec3u) {{
                 var x = numbers[id.x];
                 for (var k = 0u; k < {turns}u; k++) {{ x = fma(x, 0.98, 0.01); }}
                 numbers[id.x] = x;
             }}"
        );
        let shader = card.create_shader("program", &source);
        let pipeline = card.create_compute_pipeline("", None, record::stage_entry(shader, "main"));
        let layout = card.get_bind_group_layout(AnyPipeline::Compute(pipeline), 0);
        (pipeline, card.create_bind_group(layout, [(0, record::whole(numbers))]))
    });
    let target = card.create_texture("window", record::texture_2d(16, 16, Format::Rgba8Unorm));
    for frame in 0..FRAMES {
        let (pipeline, group) = programs[of(frame)];
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.dispatch(64, 1, 1);
        drop(pass);
        card.present(target);
    }
    card.finish()
}

/// The largest error and the largest half interval of many draws of frames, relative, and how many intervals hold the truth.
fn judged(trace: &Trace) -> (f64, f64, u64) {
    let options = Options::new(Config::built_in("four-pipelines").expect("it is built in"), Fidelity::Cycle);
    let mut cycles: Vec<f64> = Vec::new();
    let count = &mut |frame: run::frame_sink::Frame| {
        cycles.push(Count::Cycles.of(&frame.tree));
        Ok(())
    };
    replay_to(trace, &options, &|_| (), count).expect("a replay");
    let truth: f64 = cycles.iter().sum();
    let sampler = Sampler::new(trace, &options, Observers::default()).expect("a survey");
    let strata = sampler.survey().strata(SAMPLES).expect("clusters");
    let (mut error, mut margin, mut held) = (0.0_f64, 0.0_f64, 0);
    for seed in 0..SEEDS {
        let drawn = strata.draw(&mut Random::new(seed)).expect("drawn");
        let own: Vec<f64> = drawn.frames.iter().map(|&frame| cycles[frame]).collect();
        let told = drawn.total_of(&Count::Cycles, &own);
        error = error.max((told.value / truth - 1.0).abs());
        margin = margin.max(told.margin / truth);
        held += u64::from(told.covers(truth));
    }
    eprintln!(
        "{truth} cycles: errors within {:.2} %, half intervals within {:.1} %, {held} hold",
        100.0 * error,
        100.0 * margin
    );
    (error, margin, held)
}

#[test]
fn frames_that_differ_in_shaders_are_told_apart() {
    let random = |seed: u64, frame: u32| -> [u32; 4] {
        let random = &mut Random::nth(seed, frame.into());
        std::array::from_fn(|at| if at < 3 { random.below(4) } else { 0 })
    };
    for (name, (error, margin, held)) in [
        ("a row", judged(&sequence(|frame| if frame % 2 == 0 { [4, 0, 0, 0] } else { [0, 4, 0, 0] }))),
        ("a loop", judged(&sequence(|frame| if frame % 2 == 0 { [4, 0, 0, 0] } else { [0, 0, 4, 0] }))),
        ("four pipelines", judged(&sequence(|frame| std::array::from_fn(|at| if at as u32 == frame % 4 { 4 } else { 0 })))),
        ("mixes", judged(&sequence(|frame| random(1, frame)))),
        ("dispatches", judged(&dispatches(|frame| frame as usize % 2))),
    ] {
        assert!(error < 0.03, "{name}: {error}");
        // How far estimates are off differs between one dispatch and another, and is taken for chance.
        assert!(margin < 0.4, "{name}: {margin}");
        // Of intervals of 99.7 %.
        assert!(held >= SEEDS - 2, "{name}: {held}");
    }
}

#[test]
fn one_frame_that_differs_is_drawn_and_says_nothing_of_the_others() {
    for (name, (error, margin, held)) in [
        ("another shader", judged(&sequence(|frame| if frame == 37 { [0, 0, 0, 4] } else { [4, 0, 0, 0] }))),
        ("more layers", judged(&sequence(|frame| if frame == 22 { [4, 0, 40, 0] } else { [4, 0, 0, 0] }))),
        (
            "among frames that differ a little",
            judged(&sequence(|frame| if frame == 51 { [0, 0, 0, 30] } else { [4 + frame % 3, frame * 7 % 5, 0, 0] })),
        ),
    ] {
        assert!(error < 0.01, "{name}: {error}");
        assert!(margin < 0.2, "{name}: {margin}");
        assert_eq!(held, SEEDS, "{name}");
    }
}
