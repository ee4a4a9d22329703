//! If geometry does not cull, setup and traversal find the triangles that are not drawn: later, in a known number, and with the same
//! picture, on every sort class.

use std::sync::Arc;

use crate::common::{Figures, accounts_add_up, config, everything};
use fillrate::gfx::format::Format;
use fillrate::gfx::state::*;
use fillrate::machine::{Config, Machine, MachineReport};
use fillrate::num::Random;
use fillrate::render;
use fillrate::sim::Clock;
use fillrate::trace::Trace;
use fillrate::trace::record::{self, Recorder};
use fillrate::work::{End, Event, PrimitiveOutcome, Segment};

const SHADER: &str = "
struct Varying { @builtin(position) position: vec4<f32>, @location(0) tint: vec4<f32> }
@vertex fn vertex(@location(0) at: vec4<f32>, @location(1) tint: vec4<f32>) -> Varying { return Varying(at, tint); }
@fragment fn fragment(in: Varying) -> @location(0) vec4<f32> { return in.tint; }
";

const SWITCHES: [&str; 4] = ["clip.cull_facing", "clip.cull_frustum", "clip.cull_scissor", "clip.cull_no_sample"];

/// Triangles of all sizes in and about the view volume, behind the eye, beyond the guard band, without area and without samples; as
/// they are, as lines, and multisampled or not.
fn scene(samples: u32) -> Trace {
    let mut card = Recorder::new("culls");
    let mut random = Random::new(5);
    let mut vertices: Vec<f32> = Vec::new();
    for n in 0..100 {
        let mut unit = |scale: f32| (random.below(2001) as f32 / 1000.0 - 1.0) * scale;
        let reach = if n % 3 == 0 { 3.0 } else { 1.1 };
        let size = [0.001, 0.05, 0.5, 2.0, 2000.0][n % 5];
        let (x, y, z) = (unit(reach), unit(reach), if n % 7 == 0 { unit(1.5) } else { 0.5 });
        let tint = [0.5 + unit(0.5), 0.5 + unit(0.5), 0.5 + unit(0.5), 1.0];
        let w = if n % 11 == 0 { unit(1.0) } else { 1.0 };
        for corner in 0..3 {
            let [dx, dy, dz] = if n % 13 == 0 && corner > 0 { [0.0; 3] } else { [unit(size), unit(size), unit(0.1)] };
            let nan = n == 52 && corner == 2;
            vertices.extend([if nan { f32::NAN } else { x + dx }, y + dy, z + dz, w]);
            vertices.extend(tint);
        }
    }
    let bytes: Vec<u8> = vertices.iter().flat_map(|v| v.to_le_bytes()).collect();
    let buffer = card.create_buffer_init("triangles", &bytes);
    let shader = card.create_shader("culls", SHADER);
    let layout = [(0, VertexFormat::Float32x4), (1, VertexFormat::Float32x4)];
    let mut pipeline = |topology: Topology, mode: PolygonMode| {
        let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
        desc.buffers = vec![record::vertex_buffer(&layout)];
        desc.multisample.count = samples;
        desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
        desc.primitive.topology = topology;
        desc.primitive.polygon_mode = mode;
        desc.primitive.cull_mode = CullMode::Back;
        card.create_render_pipeline("culls", desc)
    };
    let filled = pipeline(Topology::TriangleList, PolygonMode::Fill);
    let outlined = pipeline(Topology::TriangleList, PolygonMode::Line);
    let strip = pipeline(Topology::TriangleStrip, PolygonMode::Fill);
    let lines = pipeline(Topology::LineList, PolygonMode::Fill);
    let points = pipeline(Topology::PointList, PolygonMode::Fill);
    let texture = |samples, format| record::texture_multisampled(150, 100, samples, format);
    let shown = card.create_texture("shown", texture(1, Format::Rgba8Unorm));
    let shown_view = card.create_view(shown);
    let target = if samples == 1 { shown } else { card.create_texture("target", texture(samples, Format::Rgba8Unorm)) };
    let target_view = card.create_view(target);
    let depth = card.create_texture("depth", texture(samples, Format::Depth32Float));
    let depth_view = card.create_view(depth);
    let color = match samples {
        1 => record::clear(target_view, [0.0; 4]),
        _ => record::clear_and_resolve(target_view, [0.0; 4], shown_view),
    };
    let mut pass = card.begin_render_pass([color], record::clear_depth(depth_view, false));
    pass.set_vertex_buffer(0, buffer);
    for (pipeline, count) in [(filled, 300), (outlined, 150), (strip, 100), (lines, 200), (points, 150)] {
        pass.set_pipeline(pipeline);
        pass.set_scissor(Rect { x: 20, y: 10, width: 90, height: 60 });
        pass.draw(count, 1);
        pass.set_scissor(Rect { x: 0, y: 0, width: 150, height: 100 });
        pass.draw(count / 2, 1);
    }
    drop(pass);
    card.present(shown);
    card.finish()
}

fn work(trace: &Trace, config: &Config) -> Vec<Event> {
    let mut events = Vec::new();
    let options = render::Options { record: true, key: config.render_key(), ..render::Options::default() };
    let mut keep = |event| {
        events.push(event);
        Ok(())
    };
    render::render(trace, &options, &mut keep).unwrap();
    events
}

fn segments(events: &[Event]) -> impl Iterator<Item = &Segment> {
    events.iter().filter_map(|event| match event {
        Event::Segment(segment) => Some(&**segment),
        _ => None,
    })
}

fn run(config: &Config, events: &[Event]) -> MachineReport {
    crate::common::run(config, events, Clock::SkipIdle)
}

/// A machine with some culls off.
fn machine(class: &str, pipelines: u32, off: &[&str], more: &[&str]) -> Config {
    let mut changes = vec![format!("sort={class}"), format!("pipelines={pipelines}")];
    changes.extend(off.iter().map(|switch| format!("{switch}=false")));
    changes.extend(more.iter().map(|&change| change.to_owned()));
    config("four-pipelines", &changes.iter().map(String::as_str).collect::<Vec<_>>())
}

/// Counters that no cull may change.
const KEPT: [&str; 12] = [
    "primitives_in",
    "culled_degenerate",
    "culled_backface",
    "culled_frustum",
    "culled_scissor",
    "culled_no_sample",
    "clipped",
    "quads_rasterized",
    "fragments_covered",
    "fragments_shaded",
    "fragments_written",
    "tiles_visited",
];

#[test]
fn what_is_not_culled_is_found_out_later_on_every_class() {
    let (mut late, mut wrong) = (0, Vec::new());
    for (samples, class) in [
        (1, "sort-first"),
        (4, "sort-middle"),
        (1, "sort-middle"),
        (1, "sort-middle-binned"),
        (1, "sort-last-fragment"),
        (1, "sort-last-image"),
    ] {
        let trace = scene(samples);
        for (pipelines, more) in
            [(1, &[][..]), (3, &["distribute.tile=16"]), (4, &["distribute.overlap=bounding-box", "network.topology=bus"])]
        {
            let on = machine(class, pipelines, &[], more);
            let plain = run(&on, &work(&trace, &on));
            for off in [&SWITCHES[..1], &SWITCHES[1..2], &SWITCHES[2..3], &SWITCHES[3..], &SWITCHES[..]] {
                let off_config = machine(class, pipelines, off, more);
                let events = work(&trace, &off_config);
                let report = run(&off_config, &events);
                let context = format!("{class}, {pipelines} pipelines, {samples} samples, without {off:?}");
                let bytes = |report: &MachineReport| report.frames[0].picture.as_ref().map(|picture| picture.bytes.clone());
                if bytes(&report) != bytes(&plain) {
                    wrong.push(context.clone());
                }
                let (a, b) = (Figures(&plain.total), Figures(&report.total));
                for name in KEPT {
                    // Routing discards triangles that would have to be clipped; a triangle that several pipelines clip counts in each.
                    if class == "sort-first" && name == "clipped" {
                        continue;
                    }
                    let path = format!("funnel.{name}");
                    assert_eq!(a.at(&path), b.at(&path), "{path}: {context}");
                }
                accounts_add_up(&report.total);
                let count = |end: End| segments(&events).flat_map(|s| &s.triangles).filter(|t| t.end == end).count() as u64;
                let (in_setup, in_traversal) = (count(End::Setup), count(End::Traversal));
                late += in_setup + in_traversal;
                let ended = (b.sum("setup.setup", "ended"), b.sum("hierarchical.traverse", "ended"));
                assert!(b.sum("hierarchical.traverse", "blocks_in_vain") >= ended.1, "{context}");
                if pipelines == 1 && class != "sort-middle-binned" {
                    assert_eq!(ended, (in_setup, in_traversal), "{context}");
                } else if class != "sort-middle-binned" {
                    // Each copy is culled at its destination; no pipeline gets two.
                    let most = u64::from(pipelines);
                    assert!((in_setup..=most * in_setup).contains(&ended.0), "{context}: {ended:?}");
                    assert!((in_traversal..=most * in_traversal).contains(&ended.1), "{context}: {ended:?}");
                }
                let more = b.at("funnel.triangles_setup") - a.at("funnel.triangles_setup");
                assert!(more >= in_setup && in_setup + in_traversal > 0, "{context}: {more} of {in_setup}");
                if off.len() == 4 {
                    let every = crate::common::run(&off_config, &events, Clock::EveryCycle);
                    assert!(everything(&every) == everything(&report), "{context}");
                    let shuffled = crate::common::run(&off_config, &events, Clock::Shuffled(3));
                    assert!(everything(&shuffled) == everything(&report), "{context}");
                }
            }
        }
    }
    assert!(late > 2000, "{late}");
    assert_eq!(wrong, Vec::<String>::new());
}

#[test]
fn each_switch_is_about_the_primitives_that_the_funnel_counts_for_it() {
    let trace = scene(1);
    let plain = work(&trace, &machine("sort-middle", 4, &[], &[]));
    assert!(segments(&plain).all(|s| s.triangles.iter().all(|t| t.end == End::Nowhere)));
    let ended =
        |outcome: PrimitiveOutcome| segments(&plain).flat_map(|s| &s.primitives).filter(|p| p.outcome == outcome).count();
    for (switch, outcomes) in SWITCHES.iter().zip([
        &[PrimitiveOutcome::Backface][..],
        &[PrimitiveOutcome::Frustum],
        &[PrimitiveOutcome::Scissor],
        &[PrimitiveOutcome::NoSample, PrimitiveOutcome::Degenerate],
    ]) {
        let events = work(&trace, &machine("sort-middle", 4, &[switch], &[]));
        let (mut late, mut cut_away, mut clipped) = (0, 0, 0);
        for segment in segments(&events) {
            let mut next = 0;
            for primitive in &segment.primitives {
                assert_eq!(primitive.first_triangle, next, "triangles lie in the order of primitives");
                next += u32::from(primitive.triangles);
                let own = &segment.triangles[primitive.first_triangle as usize..next as usize];
                let is = own.iter().any(|t| t.end != End::Nowhere) && primitive.outcome != PrimitiveOutcome::Drawn;
                assert!(!is || outcomes.contains(&primitive.outcome), "{switch}: {primitive:?}");
                late += usize::from(is);
                cut_away += usize::from(primitive.cut_away);
                clipped += usize::from(primitive.cut_away && primitive.clipped);
            }
            assert_eq!(next as usize, segment.triangles.len());
        }
        let all: usize = outcomes.iter().map(|&outcome| ended(outcome)).sum();
        assert!(all > 10, "{switch}: {all}");
        assert_eq!(late + cut_away, all, "{switch}");
        assert_eq!(cut_away > 0, *switch == "clip.cull_frustum", "{switch}");
        assert_eq!(clipped, 0);
    }
}

/// A triangle that is culled by mistake is missing from the picture, so the other tests would detect it.
#[test]
fn a_triangle_that_setup_takes_for_one_that_ends_is_missing() {
    let trace = scene(1);
    let config = machine("sort-middle", 4, &SWITCHES, &[]);
    let mut events = work(&trace, &config);
    let wrong = |events: &[Event]| {
        let report = run(&config, events);
        report.frames[0].picture.as_ref().unwrap().wrong_pixels
    };
    assert_eq!(wrong(&events), 0);
    for event in &mut events {
        if let Event::Segment(segment) = event {
            let mut changed = Segment::clone(segment);
            for triangle in changed.triangles.iter_mut().filter(|t| t.visits > 0) {
                triangle.end = End::Setup;
            }
            *segment = Arc::new(changed);
        }
    }
    assert!(wrong(&events) > 1000);
}

#[test]
fn the_bound_fidelity_says_that_it_does_not_know() {
    let config = machine("sort-middle", 4, &["clip.cull_facing"], &[]);
    let error = run::bound::Bound::new(&config).err().map(|error| error.to_string()).unwrap_or_default();
    assert!(error.contains("clip.cull_facing"), "{error}");
    let _ = Machine::new(&config).unwrap();
}
