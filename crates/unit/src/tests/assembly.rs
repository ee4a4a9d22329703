//! Primitive assembly: the order of batches, runs of primitives, sequence numbers.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw, primitive};
use crate::Card;
use crate::assembly::{Assembly, AssemblyConfig, AssemblyPorts, Deal, Mode};
use crate::token::{Kind, Run, VertexBatch, WarpToken};
use num::Cycle;
use sim::{Link, One, Unit, Wiring};
use work::{PrimitiveOutcome, Segment};

sim::circuit! {
    struct AssemblyCircuit for Card {
        batches: One<TokenSource<VertexBatch>>,
        shaded: One<TokenSource<WarpToken>>,
        assembly: One<Assembly>,
        retired: One<Sink<WarpToken>>,
        passed: One<Sink<WarpToken>>,
        geometry: Vec<Sink<Run>>,
    }
}

fn config() -> AssemblyConfig {
    AssemblyConfig { deal: Deal::Turn, primitives_per_cycle: 2, batch: 4, latency: 3, queue: 64, ..AssemblyConfig::default() }
}

/// When each geometry unit gets which runs (kind, sequence number, first, count), and when batches are given back.
type Assembled = (Vec<Vec<(Cycle, (Kind, u32, u32, u32))>>, Vec<(Cycle, u32)>);

/// Assembles triangles of a list. Each batch is given as its number of vertices and the cycle at which it is shaded.
fn assembled(config: &AssemblyConfig, geometry: usize, batches: &[(u32, Cycle)]) -> Assembled {
    let (assembled, passed) = told(config, geometry, batches, false);
    assert_eq!(passed, []);
    assembled
}

/// The same, and the messages to fetch about the indices that were taken, where it asks for them.
fn told(config: &AssemblyConfig, geometry: usize, batches: &[(u32, Cycle)], tells: bool) -> (Assembled, Vec<(Cycle, u32)>) {
    let vertices: u32 = batches.iter().map(|&(vertices, _)| vertices).sum();
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["batches", "shaded", "assembly", "retired", "passed"].map(|name| wiring.unit(name, 0));
            let units = wiring.bank("geometry", geometry);
            let (announce, from_fetch) = wiring.channel("batches", 0, FREE, ids[0], ids[2]);
            let (finish, from_cores) = wiring.channel("shaded", 0, FREE, ids[1], ids[2]);
            let (retire, retired) = wiring.channel("retired", 0, FREE, ids[2], ids[3]);
            let (tell, passed) = wiring.channel("passed", 0, FREE, ids[2], ids[4]);
            let (mut to_geometry, mut sinks) = (Vec::new(), Vec::new());
            for (index, &id) in units.iter().enumerate() {
                // As in the machine: a run or a mark per cycle.
                let (to, from) = wiring.channel("runs", index, Link::items(config.queue, 1, config.latency), ids[2], id);
                to_geometry.push(to);
                sinks.push(Sink::new(from));
            }
            let mut card = card(1);
            let primitives = (0..vertices / 3).map(|p| primitive(3 * p + 3, p, 1, false, PrimitiveOutcome::Drawn)).collect();
            card.install(
                0,
                Arc::new(Segment { primitives, stream: (0..vertices).collect(), ..Segment::default() }),
                Arc::new(draw()),
                0,
            );
            let mut tokens = Vec::new();
            let mut shaded = Vec::new();
            let mut stream_end = 0;
            for (number, &(vertices, at)) in batches.iter().enumerate() {
                stream_end += vertices;
                let number = number as u32;
                tokens.push((0, VertexBatch { slot: 0, kind: Kind::DATA, number, stream_end, vertices }));
                shaded.push((at, WarpToken { warp: number }));
            }
            shaded.sort_by_key(|&(at, _)| at);
            tokens.push((0, VertexBatch { slot: 0, kind: Kind::SEGMENT, number: 0, stream_end: 0, vertices: 0 }));
            let ports = AssemblyPorts {
                batches: from_fetch,
                shaded: vec![from_cores],
                retired: retire,
                passed: tells.then_some(tell),
                geometry: to_geometry,
            };
            let circuit = AssemblyCircuit::new(
                wiring,
                One(TokenSource::new(tokens, announce)),
                One(TokenSource::new(shaded, finish)),
                One(Assembly::new(config.clone(), Mode::Segments, ports)),
                One(Sink::new(retired)),
                One(Sink::new(passed)),
                sinks,
            );
            (circuit, card)
        },
        |c, _| c.geometry.iter().any(|sink| sink.got.last().is_some_and(|(_, run)| run.kind == Kind::SEGMENT)),
        |c, card| {
            assert_eq!((c.assembly.items(), c.assembly.resident()), (card.funnel.total().primitives_in, 0));
            let runs = |sink: &Sink<Run>| sink.log(|run| (run.kind, run.sequence, run.first, run.count));
            let assembled = (c.geometry.iter().map(runs).collect(), c.retired.log(|batch| batch.warp));
            (assembled, c.passed.log(|taken| taken.warp))
        },
    )
}

#[test]
fn primitives_wait_for_their_vertices_and_go_at_the_rate() {
    // Batches of 9 and 6 vertices, 3 and 2 triangles. One geometry unit: no marks between sequence numbers.
    let (runs, retired) = assembled(&config(), 1, &[(9, 9), (6, 29)]);
    // Seen shaded in cycle 10 and 30; two per cycle, 3 cycles on the way. A sequence number has four primitives: the second batch
    // ends it with one and begins the next, which the link takes in the cycle after. The mark has a number of its own.
    let expected = vec![
        (13, (Kind::DATA, 0, 0, 2)),
        (14, (Kind::DATA, 0, 2, 1)),
        (33, (Kind::DATA, 0, 3, 1)),
        (34, (Kind::DATA, 1, 4, 1)),
        (35, (Kind::SEGMENT, 2, 0, 0)),
    ];
    assert_eq!(runs, [expected]);
    assert_eq!(retired, [(11 + 1, 0), (31 + 1, 1)]);
}

#[test]
fn fetch_is_told_which_indices_are_taken() {
    // The batches of the test above. All nine entries of the first are taken when it is seen to be shaded, in cycle 10; those of the second
    // in cycle 30.
    let (_, passed) = told(&config(), 1, &[(9, 9), (6, 29)], true);
    assert_eq!(passed, [(11, 9), (31, 15)]);
    // With places for two only they follow the primitives: six entries are assembled in cycle 10, nine in 11.
    let few = AssemblyConfig { queue: 2, latency: 1, ..config() };
    let (_, passed) = told(&few, 1, &[(12, 9)], true);
    assert_eq!(passed, [(11, 8), (12, 12)]);
}

#[test]
fn batches_are_assembled_in_order_whichever_is_shaded_first() {
    let (runs, retired) = assembled(&config(), 1, &[(6, 40), (6, 5)]);
    assert_eq!(runs[0][..2], [(44, (Kind::DATA, 0, 0, 2)), (45, (Kind::DATA, 0, 2, 2))]);
    assert_eq!(retired, [(42, 0), (43, 1)]);
}

#[test]
fn geometry_units_take_turns_and_marks_cost_no_time() {
    // Sixteen triangles from cycle 1 on, four to a sequence number, which are two cycles; the mark that ends it goes beside the next
    // number's first run, to the other unit. Nothing is lost: a run every cycle.
    let (runs, _) = assembled(&config(), 2, &[(48, 0)]);
    let data = |unit: usize| runs[unit].iter().filter(|(_, run)| run.0 == Kind::DATA).map(|&(at, run)| (at, run.2));
    assert_eq!(data(0).collect::<Vec<_>>(), [(4, 0), (5, 2), (8, 8), (9, 10)]);
    assert_eq!(data(1).collect::<Vec<_>>(), [(6, 4), (7, 6), (10, 12), (11, 14)]);
    let ends = |unit: usize| runs[unit].iter().filter(|(_, run)| run.0 == Kind::END).map(|&(at, run)| (at, run.1));
    assert_eq!(ends(0).collect::<Vec<_>>(), [(6, 0), (10, 2)]);
    assert_eq!(ends(1).collect::<Vec<_>>(), [(8, 1), (12, 3)]);
}
