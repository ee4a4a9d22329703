//! Functional warming: segments that are only applied, among others that are simulated.

use std::sync::Arc;

use super::little::{config, rendered, rendered_trace};
use crate::config::Config;
use crate::{FrameReport, Machine, MachineError, Totals};
use gfx::format::Format;
use gfx::state::Topology;
use num::{RenderPipelineId, TextureId, ViewId};
use sim::Clock;
use stats::Tree;
use trace::Trace;
use trace::record::{self, Recorder};
use unit::Fault;
use unit::frame::{BlockState, Store};
use unit::traverse::{DepthsKnown, Traverse};
use work::{Event, SurfaceKey};

/// Marks the segments that `chosen` names by their number for functional warming.
fn applied(events: &[Event], mut chosen: impl FnMut(u32) -> bool) -> Vec<Event> {
    let mut number = 0;
    let replace = |event: &Event| match event {
        Event::Segment(segment) => {
            number += 1;
            if chosen(number - 1) { Event::Applied(segment.clone()) } else { event.clone() }
        }
        event => event.clone(),
    };
    events.iter().map(replace).collect()
}

/// What is left of a run.
struct RunResult {
    frames: Vec<FrameReport>,
    total: Tree,
    blocks: Vec<(SurfaceKey, Vec<u32>, Vec<BlockState>)>,
}

fn run(config: &Config, events: Vec<Event>) -> RunResult {
    let mut machine = Machine::new(config).unwrap();
    let mut frames = Vec::new();
    let total = machine.run_each(events.into_iter(), Clock::SkipIdle, |frame| frames.push(frame)).unwrap().total;
    let blocks = |store: &Store| (store.surface.key, store.codes.clone(), store.blocks.clone());
    RunResult { frames, total, blocks: machine.card.frame.stores.iter().map(blocks).collect() }
}

/// All that can be seen of surfaces is what it is where all is simulated: texels, and what they take in memory.
fn the_same(config: &Config, scene: &str, events: &[Event]) {
    let whole = run(config, events.to_vec());
    // Every other one; two of three in runs; all.
    let patterns: [fn(u32) -> bool; 3] = [|n| n % 2 == 1, |n| n % 12 < 8, |_| true];
    for (pattern, chosen) in patterns.into_iter().enumerate() {
        let found = run(config, applied(events, chosen));
        let at = format!("{scene} on {}, pattern {pattern}", config.name);
        assert_eq!(found.frames.len(), whole.frames.len(), "{at}");
        for (found, whole) in found.frames.iter().zip(&whole.frames) {
            assert_eq!(found.picture, whole.picture, "{at}");
        }
        assert_eq!(found.blocks.len(), whole.blocks.len(), "{at}");
        for ((key, codes, blocks), (_, codes_whole, blocks_whole)) in found.blocks.iter().zip(&whole.blocks) {
            assert!(codes == codes_whole, "{at}: texels of {key:?}");
            let other = blocks.iter().zip(blocks_whole).filter(|(a, b)| a != b).count();
            assert_eq!(other, 0, "{at}: blocks of {key:?} in memory");
        }
        let sum = |path: &str| (0..).map_while(|i| found.total.number(&format!("rop.depth[{i}].{path}"))).sum::<f64>();
        assert_eq!(sum("accepted_failed"), 0.0, "{at}");
    }
}

#[test]
fn functional_warming_leaves_what_a_simulation_leaves() {
    let told = ["traverse.hierarchical_accept=true", "traverse.hierarchical_update=write", "color.skip_reads=true"];
    let owners = ["sort=sort-last-fragment", "order.early=remote"];
    let references = [
        "color.codec=references",
        "depth.codec=references",
        "color.recompress=false",
        "depth.recompress=false",
        "color.cache_sets=position",
        "depth.cache_sets=position",
        "memory.l2.cached=false",
    ];
    let machines = [
        config("four-pipelines", &[]),
        config("four-pipelines", &told),
        config("four-pipelines", &["color.cache_blocks=4", "depth.cache_blocks=4", "color.cache_ways=2", "depth.cache_ways=2"]),
        config("four-pipelines", &["sort=sort-first", "distribute.pattern=balanced"]),
        config("four-pipelines", &owners),
        config("four-pipelines", &["depth.early=false", "memory.kind=ideal"]),
        config("four-pipelines", &references),
    ];
    for machine in &machines {
        the_same(machine, "cube", &rendered("cube", machine.render_key()));
    }
    // Samples that are resolved, and particles that a dispatch moves, over several frames.
    for scene in ["spokes-msaa", "particles"] {
        the_same(&machines[1], scene, &rendered(scene, machines[1].render_key()));
    }
}

/// Frames of a scene, each with its events.
fn frames(scene: &str, config: &Config) -> Vec<Vec<Event>> {
    let events = rendered(scene, config.render_key());
    events.split_inclusive(|event| matches!(event, Event::EndFrame(_))).map(<[Event]>::to_vec).collect()
}

/// What a machine holds of surfaces.
fn held(machine: &Machine) -> Vec<(SurfaceKey, Vec<u32>, Vec<BlockState>)> {
    machine.card.frame.stores.iter().map(|store| (store.surface.key, store.codes.clone(), store.blocks.clone())).collect()
}

#[test]
fn a_clone_goes_on_as_the_machine_does() {
    let machines = [&[][..], &["sort=sort-middle-binned"], &["sort=sort-last-image"], &["sort=sort-last-fragment"]];
    for config in machines.map(|changes| config("four-pipelines", changes)) {
        let frames = frames("particles", &config);
        let mut machine = Machine::new(&config).unwrap();
        let run = |machine: &mut Machine, frames: &[Vec<Event>]| {
            let report = machine.run(frames.concat().into_iter(), Clock::SkipIdle).unwrap();
            (report.total, report.frames.into_iter().map(|frame| (frame.number, frame.tree, frame.picture)).collect::<Vec<_>>())
        };
        run(&mut machine, &frames[..2]);
        let mut clone = machine.clone();
        assert_eq!(run(&mut machine, &frames[2..]), run(&mut clone, &frames[2..]), "{}", config.name);
        assert_eq!(held(&machine), held(&clone), "{}", config.name);
    }
}

#[test]
fn warming_with_frames_leaves_what_they_leave() {
    for changes in
        [&[][..], &["sort=sort-first"], &["sort=sort-last-fragment"], &["color.cache_blocks=4", "color.cache_ways=2"]]
    {
        // When DRAM refreshes depends on the time that has passed, which warming does not know.
        let changes = [changes, &["memory.dram.t_refi=0"]].concat();
        let config = config("four-pipelines", &changes);
        let frames = frames("particles", &config);
        let mut simulated = Machine::new(&config).unwrap();
        simulated.run(frames[..3].concat().into_iter(), Clock::SkipIdle).unwrap();
        let mut warmed = Machine::new(&config).unwrap();
        for frame in &frames[..3] {
            warmed.warm(frame.iter().cloned(), Clock::SkipIdle).unwrap();
        }
        assert_eq!(held(&warmed), held(&simulated), "{changes:?}");
        let compressed = |(_, _, blocks): &(_, _, Vec<BlockState>)| blocks.iter().any(|block| *block != blocks[0]);
        assert!(held(&warmed).iter().any(compressed), "{changes:?}: no block is cleared by flag or compressed");

        // Three runs add up to what one machine counts, as far as it does not depend on time.
        let mut sum: Option<Totals> = None;
        let mut warmed = Machine::new(&config).unwrap();
        for frame in &frames {
            let mut machine = warmed.clone();
            let report = machine.run(frame.iter().cloned(), Clock::SkipIdle).unwrap();
            warmed.warm(frame.iter().cloned(), Clock::SkipIdle).unwrap();
            match &mut sum {
                Some(sum) => sum.add(&report.totals),
                sum => *sum = Some(report.totals),
            }
        }
        let whole = Machine::new(&config).unwrap().run(frames.concat().into_iter(), Clock::SkipIdle).unwrap();
        let sum = sum.unwrap();
        let (tree, cycles) = (sum.tree(&warmed), sum.cycles() as f64);
        for path in [
            "funnel.fragments_shaded",
            "funnel.vertices_shaded",
            "sort.sent",
            "sort.wrong_pixels",
            "memory.clients.vertex.read_bytes",
        ] {
            assert_eq!(tree.number(path).unwrap(), whole.total.number(path).unwrap(), "{changes:?}: {path}");
        }
        assert!((cycles / whole.cycles as f64 - 1.0).abs() < 2e-3, "{changes:?}: {cycles} cycles in runs, {}", whole.cycles);
    }
}

/// Walks of page tables take hundreds of cycles: a frame that begins a run has as many as one behind others.
#[test]
fn warming_knows_the_pages_that_draws_touch() {
    let config = config(
        "baseline",
        &[
            "scanout.enabled=false",
            "memory.tlb.page_bytes=4096",
            "memory.tlb.second_page_bytes=4096",
            "memory.tlb.second_entries=4096",
        ],
    );
    let frames = frames("particles", &config);
    let walks = |begin: &dyn Fn(&mut Machine)| {
        let mut machine = Machine::new(&config).unwrap();
        begin(&mut machine);
        let report = machine.run(frames[1].iter().cloned(), Clock::SkipIdle).unwrap();
        report.frames[0].tree.number("memory.tlb.walks").unwrap()
    };
    let cold = walks(&|_| ());
    let behind = walks(&|machine| {
        machine.run(frames[0].iter().cloned(), Clock::SkipIdle).unwrap();
    });
    let warmed = walks(&|machine| machine.warm(frames[0].iter().cloned(), Clock::SkipIdle).unwrap());
    assert!(cold > 2.0 * behind, "{cold} walks, {behind} behind another frame");
    assert_eq!(warmed, behind);
}

/// A recorder with a pipeline of strips that tests depths, and attachments of 128x96 pixels.
struct DepthDraws {
    card: Recorder,
    pipeline: RenderPipelineId,
    window: TextureId,
    view: ViewId,
    depth: ViewId,
}

impl DepthDraws {
    fn new(name: &str, source: &str) -> DepthDraws {
        let mut card = Recorder::new(name);
        let shader = card.create_shader("program", source);
        let mut desc = record::render_pipeline(shader, Format::Rgba8Unorm);
        desc.primitive.topology = Topology::TriangleStrip;
        desc.depth_stencil = Some(record::depth_less(Format::Depth32Float));
        let pipeline = card.create_render_pipeline("", desc);
        let [window, depths] = [Format::Rgba8Unorm, Format::Depth32Float]
            .map(|format| card.create_texture("attachment", record::texture_2d(128, 96, format)));
        let [view, depth] = [window, depths].map(|texture| card.create_view(texture));
        DepthDraws { card, pipeline, window, view, depth }
    }
}

/// Frames that load the depths of those before them: each draws strips nearer to the eye, and a wall that they hide in part.
fn loaded_depths() -> Trace {
    const SOURCE: &str = "
        var<immediate> frame: u32;
        @vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) i: u32) -> @builtin(position) vec4f {
            let corner = vec2f(f32(v & 1u), f32(v >> 1u));
            let left = f32((i * 5u + frame * 3u) % 16u) / 8.0 - 1.0;
            let strip = vec4f(left + corner.x * 0.3, corner.y * 1.7 - 0.9, 0.6 - f32(frame) * 0.1 - corner.y * 0.05, 1.0);
            let wall = vec4f(corner * 2.0 - 1.0, 0.7 + corner.x * 0.1, 1.0);
            return select(strip, wall, i == 3u);
        }
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f { return vec4f(at.z, 0.5, 0.2, 1.0); }";
    let DepthDraws { mut card, pipeline, window, view, depth } = DepthDraws::new("loaded depths", SOURCE);
    for frame in 0..4 {
        let mut depth = record::clear_depth(depth, true);
        let mut color = record::clear(view, [0.0; 4]);
        if frame > 0 {
            color = record::load(view);
            depth.iter_mut().for_each(|attachment| attachment.depth_clear = None);
        }
        let mut pass = card.begin_render_pass([color], depth);
        pass.set_pipeline(pipeline);
        pass.set_immediates(0, &[frame]);
        pass.draw(4, 4);
        drop(pass);
        card.present(window);
    }
    card.finish()
}

/// What a machine knows of depths: whose they are, and their bounds in each pipeline.
fn depths_known(machine: &Machine) -> (Option<SurfaceKey>, Vec<DepthsKnown>) {
    let circuit = &machine.circuit;
    (circuit.command.depth_known(), circuit.traverse.iter().map(Traverse::depth_bounds).collect())
}

/// Machines before each frame: one that has simulated those before, and one that a run begins with.
fn before_each_frame(config: &Config, mut compare: impl FnMut(usize, &Machine, &Machine)) {
    let events = rendered_trace(&loaded_depths(), config.render_key());
    let [mut simulated, mut warmed] = [(); 2].map(|()| Machine::new(config).unwrap());
    for (number, frame) in events.split_inclusive(|event| matches!(event, Event::EndFrame(_))).enumerate() {
        compare(number, &simulated, &warmed);
        simulated.run(frame.iter().cloned(), Clock::SkipIdle).unwrap();
        warmed.warm(frame.iter().cloned(), Clock::SkipIdle).unwrap();
    }
}

#[test]
fn a_run_begins_with_the_hierarchical_z_of_one_machine() {
    let few = ["depth.cache_blocks=4", "depth.cache_ways=2"];
    let accepts = ["traverse.hierarchical_accept=true"];
    for changes in [&[][..], &few, &accepts, &["sort=sort-first"]] {
        // If hierarchical Z learns of each write, both machines know the same.
        let mut told = Vec::new();
        let every_write = config("four-pipelines", &[changes, &["traverse.hierarchical_update=write"]].concat());
        before_each_frame(&every_write, |number, simulated, warmed| {
            let at = format!("{changes:?}, told each write: before frame {number}");
            let (begin, own) = (depths_known(warmed), depths_known(simulated));
            assert!(begin == own, "{at}: what is known of depths");
            assert!(held(warmed) == held(simulated), "{at}: blocks");
            let differ = begin.1.iter().any(|known| known.bounds.iter().any(|bounds| *bounds != known.bounds[0]));
            assert_eq!((begin.0.is_some(), differ), (number > 0, number > 0), "{at}: depths that are loaded are known");
            told.push(begin);
        });
        assert_eq!(told.len(), 4);
        // If it learns of blocks that leave the cache, timing decides which blocks have left. What each machine knows is true.
        before_each_frame(&config("four-pipelines", changes), |number, simulated, warmed| {
            let at = format!("{changes:?}: before frame {number}");
            assert!(held(warmed) == held(simulated), "{at}: blocks");
            for machine in [simulated, warmed] {
                let (surface, known) = depths_known(machine);
                assert_eq!(surface, told[number].0, "{at}");
                for (known, told) in known.iter().zip(&told[number].1) {
                    assert_eq!((known.valid, &known.outer), (told.valid, &told.outer), "{at}");
                    assert_eq!(known.bounds.len(), told.bounds.len(), "{at}");
                    let holds = known.bounds.iter().zip(&told.bounds).all(|(known, told)| known[1] >= told[1]);
                    assert!(holds, "{at}: a depth is greater than is known");
                }
            }
        });
    }
}

#[test]
fn a_pipeline_that_draws_nothing_after_a_clear_forgets_the_depths_before() {
    const SOURCE: &str = "
        var<immediate> quad: vec4f;
        @vertex fn vs(@builtin(vertex_index) v: u32) -> @builtin(position) vec4f {
            return vec4f(vec2f(f32(v & 1u), f32(v >> 1u)) * quad.x - 1.0, quad.y, 1.0);
        }
        @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f { return vec4f(at.z, 0.5, 0.2, 1.0); }";
    let DepthDraws { mut card, pipeline, window, view, depth } = DepthDraws::new("cleared farther", SOURCE);
    // All is near; a clear to the far plane, and something in one corner; a wall between.
    for (clear, size, z) in [(Some(0.5), 2.0_f32, 0.4_f32), (Some(1.0), 0.05, 0.3), (None, 2.0, 0.7)] {
        let mut depth = record::clear_depth(depth, true);
        depth.iter_mut().for_each(|attachment| attachment.depth_clear = clear);
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], depth);
        pass.set_pipeline(pipeline);
        pass.set_immediates(0, &[size.to_bits(), z.to_bits(), 0, 0]);
        pass.draw(4, 1);
    }
    card.present(window);
    let trace = card.finish();
    for changes in [&[][..], &["traverse.hierarchical_update=write"], &["sort=sort-first"], &["sort=sort-last-fragment"]] {
        let config = config("four-pipelines", changes);
        let events = rendered_trace(&trace, config.render_key());
        let Some(Event::EndFrame(end)) = events.last().cloned() else { panic!("a frame ends") };
        let report = Machine::new(&config).unwrap().run(events.into_iter(), Clock::SkipIdle).unwrap();
        let picture = report.frames[0].picture.as_ref().unwrap();
        assert!(picture.bytes[..] == end.reference[..], "{changes:?}");
    }
}

#[test]
fn depths_that_are_forgotten_are_seen() {
    // What is warmed functionally leaves no depths here: quads behind it pass that are not shaded in API order.
    let events = rendered("cube", config("four-pipelines", &[]).render_key());
    let mut forgetful = Vec::new();
    for event in applied(&events, |number| number % 2 == 0) {
        match event {
            Event::Draw(draw) => {
                let mut draw = (*draw).clone();
                if let Some(state) = &mut Arc::make_mut(&mut draw.state).depth_stencil {
                    state.depth_write = false;
                }
                forgetful.push(Event::Draw(Arc::new(draw)));
            }
            event => forgetful.push(event),
        }
    }
    let machine = || Machine::new(&config("four-pipelines", &[])).unwrap();
    machine().run(applied(&events, |number| number % 2 == 0).into_iter(), Clock::SkipIdle).unwrap();
    let error = machine().run(forgetful.into_iter(), Clock::SkipIdle).unwrap_err();
    assert!(matches!(error, MachineError::Fault(Fault::Visibility { .. })), "{error}");
}

#[test]
fn machines_that_keep_pixels_elsewhere_refuse() {
    for changes in [["sort=sort-middle-binned"], ["sort=sort-last-image"]] {
        let machine = config("four-pipelines", &changes);
        let events = applied(&rendered("triangle", machine.render_key()), |_| true);
        let error = Machine::new(&machine).unwrap().run(events.into_iter(), Clock::SkipIdle).unwrap_err();
        assert!(matches!(error, MachineError::Fault(_)), "{error}");
        assert!(error.to_string().contains("functional warming"), "{error}");
    }
}
