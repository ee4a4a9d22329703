//! What the front of each card reaches: long draws at the rate that its configuration declares, short ones at that of their commands, and
//! no loss where more indices come.

use std::sync::Arc;

use crate::common::{Figures, config, rendered, run};
use fillrate::gfx::stage::Stage;
use fillrate::gfx::state::Compare;
use fillrate::machine::Config;
use fillrate::machine::config::SortClass;
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};
use fillrate::work::*;

/// Squares of a grid across; two triangles each, in rows.
const ACROSS: u32 = 64;

/// A segment of an indexed grid whose triangles all face away.
fn grid(rows: u32, index_bytes: u32) -> Segment {
    let mut segment = Segment { index_address: Some(1 << 24), index_bytes, ..Segment::default() };
    let cost = Cost::from(vec![Step::dependent([4, 0, 0, 0, 0], RequestKind::End)]);
    segment.invocations[Stage::Vertex] = CostTable::from(vec![cost]).into();
    let vertex = |index| Vertex { index, instance: 0, cost: 0, first_request: 0 };
    segment.vertices = (0..(rows + 1) * (ACROSS + 1)).map(vertex).collect();
    for row in 0..rows {
        for column in 0..ACROSS {
            let a = row * (ACROSS + 1) + column;
            let c = a + ACROSS + 1;
            for vertices in [[a, a + 1, c], [a + 1, c + 1, c]] {
                segment.stream.extend(vertices);
                segment.primitives.push(Primitive {
                    vertices,
                    stream_end: segment.stream.len() as u32,
                    first_triangle: 0,
                    triangles: 0,
                    clipped: false,
                    cut_away: false,
                    outcome: PrimitiveOutcome::Backface,
                });
            }
        }
    }
    segment
}

/// A frame of one pass whose draws have these segments, and nothing is seen.
fn frame(segments: Vec<Segment>) -> Vec<Event> {
    let plain = Scene { draws: 1, triangles: 1, size: 0.0, depth_format: None, textures: 0, segments: 1, ..Scene::default() };
    let mut out = Vec::new();
    let mut segments = segments.into_iter();
    for event in events(&plain) {
        match event {
            Event::Draw(draw) => {
                let attribute = AttributeFetch { stride: 8, bytes: 8, ..draw.attributes[0] };
                let draw = Arc::new(Draw { attributes: vec![attribute], ..(*draw).clone() });
                for segment in segments.by_ref() {
                    out.extend([Event::Draw(draw.clone()), Event::Segment(Arc::new(segment))]);
                }
            }
            Event::Segment(_) => {}
            event => out.push(event),
        }
    }
    out
}

/// Cycles of a run without scan-out.
fn cycles(config: &Config, events: &[Event]) -> f64 {
    let mut config = config.clone();
    config.set("scanout.enabled=false").expect("a knob");
    run(&config, events, Clock::SkipIdle).total.number("cycles").expect("a run has cycles")
}

/// The triangles per cycle that a configuration declares for a list with indices of `index_bytes` bytes: the lowest of its units' rates.
fn declared(config: &Config, index_bytes: u32) -> f64 {
    let bytes = f64::from(config.memory.port_width) / f64::from(index_bytes);
    let units = f64::from(config.card.geometry_units);
    [
        f64::from(config.fetch.indices_per_cycle).min(bytes) / 3.0,
        f64::from(config.assembly.primitives_per_cycle),
        units * f64::from(config.clip.primitives_per_cycle),
    ]
    .into_iter()
    .fold(f64::INFINITY, f64::min)
}

#[test]
fn long_indexed_draws_reach_the_rate_that_each_configuration_declares() {
    // All but tiny, whose queues are short so that units wait for each other.
    for name in ["four-pipelines", "wide", "gtx-titan", "geforce2-ultra", "attila"] {
        for index_bytes in [2, 4] {
            let config = config(name, &[]);
            let time = |rows| cycles(&config, &frame(vec![grid(rows, index_bytes)]));
            // What a longer draw takes in addition.
            let rate = f64::from(2 * ACROSS * (256 - 64)) / (time(256) - time(64));
            let declared = declared(&config, index_bytes);
            assert!(
                (0.95..1.01).contains(&(rate / declared)),
                "{name}, indices of {index_bytes} bytes: {rate:.3} triangles a cycle of {declared:.3}"
            );
        }
    }
}

#[test]
fn small_draws_follow_each_other_as_fast_as_their_commands_in_every_class() {
    // One triangle per draw, each with three indices of its own in memory.
    let draws = 600;
    let triangle = |n: u32| {
        let mut segment = grid(1, 4);
        segment.primitives.truncate(1);
        segment.stream.truncate(3);
        segment.vertices.iter_mut().for_each(|vertex| vertex.index += 3 * n);
        segment.index_address = Some((1 << 24) + 12 * u64::from(n));
        segment
    };
    let events = frame((0..draws).map(triangle).collect());
    let few = frame((0..draws / 2).map(triangle).collect());
    for class in SortClass::NAMES {
        // As many in flight as the latency of memory asks for.
        let config = config(class, &["command.segments=1024"]);
        let each = (cycles(&config, &events) - cycles(&config, &few)) / f64::from(draws / 2);
        // A draw is read in one cycle, and its segment takes `command_cycles`.
        let command = f64::from(config.command.command_cycles) + 1.0;
        // Fences of binned draws go to the pipelines when all is binned, one per cycle.
        assert!((0.98 * command..1.02 * (1.0 + command)).contains(&each), "{class}: {each:.2} cycles a draw");
    }
}

#[test]
fn more_indices_a_cycle_make_no_class_slower() {
    // Triangles of a few pixels, each of which shares a vertex with the one before. All are drawn, whatever comes first.
    let plain = Scene { depth_format: None, compare: Compare::Always, ..Scene::default() };
    let events = events(&Scene { draws: 1, segments: 1, triangles: 3000, size: 6.0, ..plain });
    for class in SortClass::NAMES {
        let with = |rate: u32| {
            let config = config(class, &[&format!("fetch.indices_per_cycle={rate}")]);
            let report = run(&config, &events, Clock::SkipIdle).total;
            let batches = Figures(&report).sum("channels.vertex_warps", "items") as f64;
            let vertices = report.number("funnel.vertices_shaded").expect("a counter");
            (report.number("cycles").expect("a counter"), vertices / batches)
        };
        let mut before = with(2);
        for rate in [4, 8, 16, 32] {
            let (cycles, vertices) = with(rate);
            assert!(cycles <= 1.02 * before.0, "{class}, {rate} indices a cycle: {cycles} cycles after {}", before.0);
            // Batches are nearly as full as they were.
            assert!(
                vertices > 0.85 * before.1,
                "{class}, {rate} indices a cycle: {vertices} vertices a batch after {}",
                before.1
            );
            before.0 = cycles;
        }
    }
}

#[test]
fn draws_share_a_state_until_a_command_changes_it() {
    let events = rendered("town.zip");
    let states = |events: &[Event]| -> Vec<u32> {
        let state = |event: &Event| if let Event::Draw(draw) = event { Some(draw.state.number) } else { None };
        events.iter().filter_map(state).collect()
    };
    let states = states(&events);
    let changes = 1 + states.windows(2).filter(|pair| pair[0] != pair[1]).count();
    // The ground has a pipeline, and all that stands on it another.
    assert_eq!((states.len(), changes), (398, 2));
    let counted = |changes: &[&str]| {
        let report = run(&config("four-pipelines", changes), &events, Clock::SkipIdle).total;
        ["command.state_changes", "cycles"].map(|name| report.number(name).expect("a counter"))
    };
    let [free, slow] = [0, 1000].map(|cycles| counted(&[&format!("command.state_cycles={cycles}")]));
    assert_eq!((free[0], slow[0]), (2.0, 2.0));
    let added = slow[1] - free[1];
    assert!((500.0..2100.0).contains(&added), "{added} cycles for two changes of 1,000");
}
