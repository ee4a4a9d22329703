//! Units in tiny circuits: a source, the unit, a sink. Times are exact: not a cycle before, not a cycle after.

use std::sync::Arc;

use super::card::Card;
use super::clip::{Clip, ClipConfig};
use super::core::{Core, CoreConfig, CorePorts, Scheduling};
use super::distribute::{Distribute, DistributeConfig, Overlap};
use super::interleave::{Interleave, Pattern};
use super::interpolate::{Interpolate, InterpolateConfig};
use super::setup::{Setup, SetupConfig};
use super::token::{GroupToken, Kind, Run, TriangleToken, WarpToken, bytes};
use super::traverse::{Traverse, TraverseConfig};
use super::warp::{Item, Program};
use crate::num::Cycle;
use crate::sim::{Clock, In, Link, One, Out, Tick, Token, Unit, Wires, Wiring, run};
use crate::work::*;

/// Pushes its items in order, each as soon as it can and not before its cycle.
struct Source<T> {
    items: Vec<(Cycle, T)>,
    next: usize,
    output: Out<T>,
}

impl<T: Token> Unit<Card> for Source<T> {
    fn tick(&mut self, wires: &mut Wires, _: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        while let Some(&(at, item)) = self.items.get(self.next) {
            if at > wires.now() {
                wires.sleep_until(at);
                return did.or(Tick::Working);
            }
            if !wires.try_push(&self.output, item) {
                return did.or(Tick::Blocked);
            }
            self.next += 1;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.next as u64
    }

    fn resident(&self) -> u64 {
        (self.items.len() - self.next) as u64
    }
}

/// Takes whatever comes and notes when.
struct Sink<T> {
    got: Vec<(Cycle, T)>,
    input: In<T>,
}

impl<T: Token> Unit<Card> for Sink<T> {
    fn tick(&mut self, wires: &mut Wires, _: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        while let Some(item) = wires.pop(&self.input) {
            self.got.push((wires.now(), item));
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.got.len() as u64
    }

    fn resident(&self) -> u64 {
        0
    }
}

/// A channel that is never in the way.
const FREE: Link = Link::items(4096, 4096, 1);

fn card(pipelines: usize) -> Card {
    Card::new(pipelines, 4, 4, Interleave::new(Pattern::Skewed, pipelines as u32, 64))
}

fn draw(fragment_inputs: u32) -> Arc<Draw> {
    Arc::new(Draw {
        number: 0,
        label: String::new(),
        vertex: ShaderShape::default(),
        fragment: Some(ShaderShape { registers: 16, inputs: fragment_inputs, outputs: 4 }),
        attributes: Vec::new(),
        depth_stencil: None,
        stencil_reference: 0,
        targets: Vec::new(),
        blend_constant: [0.0; 4],
        depth_words: 0,
        payload_words: 0,
        early: true,
        hierarchical_z: true,
        depth_range: [0.0, 1.0],
    })
}

fn primitive(first_triangle: u32, triangles: u8, clipped: bool, outcome: Outcome) -> Primitive {
    Primitive { vertices: [0; 3], stream_end: 0, first_triangle, triangles, clipped, outcome }
}

/// A triangle over whole tiles of a row: `blocks` blocks of `quads` quads in each of `tiles` tiles.
fn row_of_tiles(tiles: u16, blocks: u32, quads: u8) -> Segment {
    let quad = Quad { coverage: 15, kept: 15, position: 0, flags: QUAD_SHADED, cost: 0, payload: 0, first_request: 0 };
    let work = |x| TileWork {
        x,
        blocks: (0..blocks)
            .map(|b| Block { first_quad: b * u32::from(quads), x: x * 8 + b as u16 % 8, y: b as u16 / 8, quads, full: false })
            .collect(),
        quads: vec![quad; blocks as usize * usize::from(quads)],
        ..TileWork::default()
    };
    Segment {
        triangles: vec![Triangle {
            primitive: 0,
            depth: Default::default(),
            back: false,
            bounds: [0, 0, tiles * 8, blocks.div_ceil(8) as u16],
            first_visit: 0,
            visits: u32::from(tiles),
        }],
        visits: (0..u32::from(tiles)).map(|tile| Visit { tile, first_block: 0, blocks }).collect(),
        tiles: (0..tiles).map(work).collect(),
        ..Segment::default()
    }
}

crate::circuit! {
    struct SetupCircuit for Card {
        source: Vec<Source<TriangleToken>>,
        setup: One<Setup>,
        sink: One<Sink<TriangleToken>>,
    }
}

fn set_up(config: SetupConfig, inputs: Vec<Vec<(Cycle, TriangleToken)>>) -> Vec<(Cycle, u32)> {
    let outcome = |clock| {
        let mut wiring = Wiring::new();
        let sources = wiring.bank("source", inputs.len());
        let (setup, sink) = (wiring.unit("setup", 0), wiring.unit("sink", 0));
        let (mut source, mut into) = (Vec::new(), Vec::new());
        for (index, items) in inputs.iter().enumerate() {
            let (output, input) = wiring.channel("in", index, FREE, sources[index], setup);
            source.push(Source { items: items.clone(), next: 0, output });
            into.push(input);
        }
        let link = Link::items(config.queue, config.triangles_per_cycle, config.latency);
        let (output, input) = wiring.channel("out", 0, link, setup, sink);
        let wanted = inputs.iter().flatten().filter(|(_, token)| token.kind == Kind::DATA).count();
        let unit = Setup::new(config.clone(), into, output);
        let mut circuit = SetupCircuit::new(wiring, source, One(unit), One(Sink { got: Vec::new(), input }));
        run(&mut circuit, &mut card(1), clock, 1000, |c, _| c.sink.got.len() == wanted).unwrap();
        circuit.sink.got.iter().map(|&(at, token)| (at, token.triangle)).collect::<Vec<_>>()
    };
    let every = outcome(Clock::EveryCycle);
    assert_eq!(every, outcome(Clock::SkipIdle));
    every
}

fn triangle(kind: Kind, sequence: u32, triangle: u32) -> TriangleToken {
    TriangleToken { slot: 0, kind, sequence, triangle }
}

#[test]
fn setup_takes_its_interval_and_latency() {
    let items: Vec<_> = (0..4).map(|t| (0, triangle(Kind::DATA, 0, t))).collect();
    let config = SetupConfig { triangles_per_cycle: 1, interval: 3, latency: 10, queue: 16 };
    // In the unit's hands from cycle 1; one every 3 cycles; 10 on the way.
    assert_eq!(set_up(config.clone(), vec![items.clone()]), vec![(11, 0), (14, 1), (17, 2), (20, 3)]);
    let config = SetupConfig { triangles_per_cycle: 2, interval: 1, ..config };
    assert_eq!(set_up(config, vec![items]), vec![(11, 0), (11, 1), (12, 2), (12, 3)]);
}

#[test]
fn setup_restores_the_order_of_sequence_numbers() {
    let config = SetupConfig { triangles_per_cycle: 1, interval: 1, latency: 1, queue: 16 };
    let inputs = vec![
        vec![(9, triangle(Kind::DATA, 0, 0)), (9, triangle(Kind::END, 0, 0)), (9, triangle(Kind::DATA, 2, 3))],
        vec![(0, triangle(Kind::DATA, 1, 1)), (0, triangle(Kind::DATA, 1, 2)), (5, triangle(Kind::END, 1, 0))],
    ];
    // Everything waits for sequence number 0, which comes late. Without the merge triangle 1 would be first.
    assert_eq!(set_up(config, inputs), vec![(11, 0), (12, 1), (13, 2), (14, 3)]);
}

crate::circuit! {
    struct ClipCircuit for Card {
        source: One<Source<Run>>,
        clip: One<Clip>,
        sink: One<Sink<Run>>,
    }
}

#[test]
fn clip_tests_so_many_a_cycle_and_holds_what_it_cuts() {
    let outcome = |clock| {
        let mut wiring = Wiring::new();
        let (a, b, c) = (wiring.unit("source", 0), wiring.unit("clip", 0), wiring.unit("sink", 0));
        let (output, into) = wiring.channel("in", 0, FREE, a, b);
        let (out, input) = wiring.channel("out", 0, Link::items(64, 1, 1), b, c);
        let mut card = card(1);
        let kinds = [
            primitive(0, 1, false, Outcome::Drawn),
            primitive(1, 0, false, Outcome::Backface),
            primitive(1, 2, true, Outcome::Drawn),
            primitive(3, 1, false, Outcome::Drawn),
            primitive(4, 0, false, Outcome::Frustum),
            primitive(4, 0, false, Outcome::Degenerate),
        ];
        let segment = Segment { primitives: kinds.to_vec(), ..Segment::default() };
        card.install(0, Arc::new(segment), draw(0), 0);
        let items = vec![(0, Run { slot: 0, kind: Kind::DATA, sequence: 0, first: 0, count: 6 })];
        let config = ClipConfig { primitives_per_cycle: 2, clip_cycles: 7, latency: 1, queue: 64 };
        let mut circuit = ClipCircuit::new(
            wiring,
            One(Source { items, next: 0, output }),
            One(Clip::new(config, into, out)),
            One(Sink { got: Vec::new(), input }),
        );
        run(&mut circuit, &mut card, clock, 1000, |c, _| c.clip.items() == 6 && c.sink.got.len() == 3).unwrap();
        assert_eq!((card.funnel.culled_backface, card.funnel.culled_frustum, card.funnel.clipped), (1, 1, 1));
        circuit.sink.got.iter().map(|&(at, run)| (at, run.first, run.count)).collect::<Vec<_>>()
    };
    // Cycle 1: one survivor, one culled. Cycle 2: the cut one, which holds the unit to 9. Then the rest.
    let expected = vec![(2, 0, 1), (3, 1, 2), (10, 3, 1)];
    assert_eq!(outcome(Clock::EveryCycle), expected);
    assert_eq!(outcome(Clock::SkipIdle), expected);
}

crate::circuit! {
    struct DistributeCircuit for Card {
        source: One<Source<Run>>,
        distribute: One<Distribute>,
        sink: Vec<Sink<TriangleToken>>,
    }
}

#[test]
fn distribution_sends_a_triangle_to_every_owner_and_to_no_other() {
    for (overlap, expected) in [(Overlap::Exact, [1, 1, 1, 0]), (Overlap::Bounds, [1, 1, 1, 0])] {
        let mut wiring = Wiring::new();
        let (a, b) = (wiring.unit("source", 0), wiring.unit("distribute", 0));
        let sinks = wiring.bank("sink", 4);
        let (output, into) = wiring.channel("in", 0, FREE, a, b);
        let (mut outputs, mut sink) = (Vec::new(), Vec::new());
        for (index, &id) in sinks.iter().enumerate() {
            let (out, input) = wiring.channel("out", index, Link::bytes(8, bytes::TRIANGLE, 3), b, id);
            outputs.push(out);
            sink.push(Sink { got: Vec::new(), input });
        }
        let mut card = card(4);
        card.install(0, Arc::new(row_of_tiles(3, 8, 4)), draw(0), 0);
        let config = DistributeConfig {
            tile: 64,
            pattern: Pattern::Skewed,
            overlap,
            triangles_per_cycle: 1,
            link_width: 1,
            latency: 3,
            queue: 8,
        };
        let items = vec![(0, Run { slot: 0, kind: Kind::DATA, sequence: 0, first: 0, count: 1 })];
        let source = One(Source { items, next: 0, output });
        let mut circuit = DistributeCircuit::new(wiring, source, One(Distribute::new(config, into, outputs)), sink);
        run(&mut circuit, &mut card, Clock::SkipIdle, 1000, |c, _| c.sink.iter().map(|s| s.got.len()).sum::<usize>() == 3)
            .unwrap();
        let got: Vec<usize> = circuit.sink.iter().map(|sink| sink.got.len()).collect();
        assert_eq!(got, expected, "{overlap:?}");
        assert!(circuit.sink.iter().flat_map(|sink| &sink.got).all(|&(at, _)| at == 1 + 3));
        let counts = circuit.distribute.counts();
        assert_eq!((counts.triangles, counts.redistributed_items), (1, 3));
        assert_eq!(counts.redistributed_bytes, 3 * u64::from(bytes::TRIANGLE));
    }
}

crate::circuit! {
    struct TraverseCircuit for Card {
        source: One<Source<TriangleToken>>,
        bounds: One<Source<super::token::DepthBounds>>,
        traverse: One<Traverse>,
        sink: One<Sink<GroupToken>>,
    }
}

crate::circuit! {
    struct InterpolateCircuit for Card {
        source: One<Source<GroupToken>>,
        interpolate: One<Interpolate>,
        sink: One<Sink<GroupToken>>,
    }
}

#[test]
fn interpolation_takes_a_turn_for_every_so_many_words() {
    // 6 groups of 4 quads at 2 quads a cycle: 2 cycles a group with 4 words or fewer, 6 with 9 to 12.
    for (words, cycles) in [(0, 2), (4, 2), (12, 6)] {
        let mut wiring = Wiring::new();
        let ids = [wiring.unit("source", 0), wiring.unit("interpolate", 0), wiring.unit("sink", 0)];
        let (output, into) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
        let (out, input) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
        let mut card = card(1);
        card.install(0, Arc::new(Segment::default()), draw(words), 0);
        let items: Vec<_> = (0..6)
            .map(|_| {
                let group = card.groups[0].insert(super::card::Group { count: 4, live: [15; 4], ..Default::default() });
                (0, GroupToken { group, sequence: 0, kind: Kind::DATA, quads: 4 })
            })
            .collect();
        let config = InterpolateConfig { quads_per_cycle: 2, words_per_cycle: 4, latency: 1, queue: 64 };
        let source = One(Source { items, next: 0, output });
        let unit = One(Interpolate::new(config, 0, into, out));
        let mut circuit = InterpolateCircuit::new(wiring, source, unit, One(Sink { got: Vec::new(), input }));
        run(&mut circuit, &mut card, Clock::SkipIdle, 1000, |c, _| c.sink.got.len() == 6).unwrap();
        let times: Vec<_> = circuit.sink.got.iter().map(|&(at, _)| at).collect();
        assert_eq!(times, (0..6).map(|n| 2 + n * cycles).collect::<Vec<_>>(), "{words} words");
    }
}

crate::circuit! {
    struct CoreCircuit for Card {
        source: One<Source<WarpToken>>,
        core: One<Core>,
        texture: One<Sink<WarpToken>>,
        answers: One<Source<WarpToken>>,
        sink: One<Sink<WarpToken>>,
    }
}

fn core_config() -> CoreConfig {
    CoreConfig {
        per_pipeline: 1,
        unified: true,
        warp_width: 32,
        warps: 8,
        registers: 65_536,
        shared_bytes: 16_384,
        issue: 1,
        float_lanes: 32,
        integer_lanes: 32,
        special_lanes: 8,
        control_lanes: 32,
        float_latency: 6,
        integer_latency: 6,
        special_latency: 20,
        control_latency: 8,
        run: 1,
        scheduling: Scheduling::RoundRobin,
        output_queue: 8,
        ..CoreConfig::default()
    }
}

/// When the last of `warps` warps of so many instructions is done, counted from the core's first cycle.
fn shade(config: CoreConfig, warps: u32, instructions: [u32; 4], registers: u32) -> Cycle {
    let outcome = |clock| {
        let mut wiring = Wiring::new();
        let ids = [
            wiring.unit("source", 0),
            wiring.unit("core", 0),
            wiring.unit("texture", 0),
            wiring.unit("answers", 0),
            wiring.unit("sink", 0),
        ];
        let (output, into) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
        let (ask, asked) = wiring.channel("ask", 0, FREE, ids[1], ids[2]);
        let (answer, answered) = wiring.channel("answer", 0, FREE, ids[3], ids[1]);
        let (out, input) = wiring.channel("out", 0, FREE, ids[1], ids[4]);
        let mut card = card(1);
        let table = CostTable { costs: vec![Cost { steps: vec![Step { instructions, then: RequestKind::End }] }] };
        let items: Vec<_> = (0..warps)
            .map(|_| {
                let index = card.warps[0].insert(Program::Fragment, 0, registers);
                let warp = &mut card.warps[0][index];
                warp.items.push(Item { source: 0, request: 0, cost: 0 });
                warp.merge(|_| &table);
                (0, WarpToken { warp: index })
            })
            .collect();
        let ports = CorePorts { fragment: Some((into, out)), vertex: None, compute: None, texture: (ask, answered) };
        let mut circuit = CoreCircuit::new(
            wiring,
            One(Source { items, next: 0, output }),
            One(Core::new(config.clone(), 0, ports)),
            One(Sink { got: Vec::new(), input: asked }),
            One(Source { items: Vec::new(), next: 0, output: answer }),
            One(Sink { got: Vec::new(), input }),
        );
        run(&mut circuit, &mut card, clock, 10_000, |c, _| c.sink.got.len() == warps as usize).unwrap();
        circuit.sink.got.last().unwrap().0
    };
    let every = outcome(Clock::EveryCycle);
    assert_eq!(every, outcome(Clock::SkipIdle));
    // Taken in cycle 1, first issue in cycle 2, sent on in the cycle after the last, a cycle on the way.
    every - 2 - 1 - 1
}

#[test]
fn one_warp_is_bound_by_latency_and_many_by_issue() {
    // The last instruction issues after all latencies but its own.
    assert_eq!(shade(core_config(), 1, [10, 0, 0, 0], 16), 9 * 6);
    // Six warps hide six cycles of latency, eight more than that: one instruction a cycle.
    assert_eq!(shade(core_config(), 6, [10, 0, 0, 0], 16), 6 * 10 - 1);
    assert_eq!(shade(core_config(), 8, [10, 0, 0, 0], 16), 8 * 10 - 1);
    // Half as many lanes take twice as long; a quarter for transcendentals.
    assert_eq!(shade(CoreConfig { float_lanes: 16, ..core_config() }, 8, [10, 0, 0, 0], 16), 2 * (8 * 10 - 1));
    assert_eq!(shade(core_config(), 8, [0, 0, 10, 0], 16), 4 * (8 * 10 - 1));
}

#[test]
fn registers_bound_the_warps_in_flight() {
    // 1024 registers a lane of 32: two warps of 16 registers, so that latency shows: 2 of 6 cycles used.
    let config = CoreConfig { registers: 1024, ..core_config() };
    let (two, eight) = (shade(config, 8, [10, 0, 0, 0], 16), shade(core_config(), 8, [10, 0, 0, 0], 16));
    assert!(two > 2 * eight, "{two} against {eight}");
}

#[test]
fn runs_keep_rates_and_latencies() {
    for run in [1, 4, 8] {
        let config = CoreConfig { run, ..core_config() };
        assert_eq!(shade(config.clone(), 1, [16, 0, 0, 0], 16), 15 * 6, "run {run}");
        let busy = shade(config, 8, [16, 0, 0, 0], 16);
        assert!((8 * 16 - 1..=8 * 16 + 8 * 6).contains(&busy), "run {run}: {busy}");
    }
}

#[test]
fn traversal_takes_the_longer_of_blocks_and_quads() {
    // 8 blocks of 3 quads at a block a cycle; 8 blocks of 16 quads at 4 quads a cycle.
    for (quads, cycles) in [(3_u8, 8), (16, 32)] {
        let mut wiring = Wiring::new();
        let ids = [wiring.unit("source", 0), wiring.unit("bounds", 0), wiring.unit("traverse", 0), wiring.unit("sink", 0)];
        let (output, into) = wiring.channel("in", 0, FREE, ids[0], ids[2]);
        let (bounds_out, updates) = wiring.channel("updates", 0, FREE, ids[1], ids[2]);
        let (out, input) = wiring.channel("out", 0, Link::bytes(64, 4 * bytes::QUAD, 1), ids[2], ids[3]);
        let mut card = card(1);
        let mut segment = row_of_tiles(1, 8, quads);
        segment.triangles.push(segment.triangles[0]);
        card.install(0, Arc::new(segment), draw(0), 0);
        let config = TraverseConfig {
            blocks_per_cycle: 1,
            tests_per_cycle: 4,
            quads_per_cycle: 4,
            latency: 1,
            queue: 64,
            hierarchical_z: true,
            hierarchical_latency: 1,
            hierarchical_queue: 16,
            ..TraverseConfig::default()
        };
        let items = vec![(0, triangle(Kind::DATA, 0, 0)), (0, triangle(Kind::DATA, 0, 1))];
        let mut circuit = TraverseCircuit::new(
            wiring,
            One(Source { items, next: 0, output }),
            One(Source { items: Vec::new(), next: 0, output: bounds_out }),
            One(Traverse::new(config, 0, into, updates, out)),
            One(Sink { got: Vec::new(), input }),
        );
        let wanted = 16 * usize::from(quads).div_ceil(4);
        run(&mut circuit, &mut card, Clock::SkipIdle, 1000, |c, _| c.sink.got.len() == wanted).unwrap();
        let first_of_second = circuit.sink.got[wanted / 2].0;
        assert_eq!(first_of_second - circuit.sink.got[0].0, cycles, "{quads} quads a block");
        assert_eq!(card.funnel.quads_rasterized, 16 * u64::from(quads));
        assert_eq!(card.groups[0].len(), wanted);
    }
}
