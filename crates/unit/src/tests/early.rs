//! Early tests in pipelines that own no pixels: their copy of the depths, and the owner's answers.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, memory, port, round_trip, settle};
use super::scenery::{attachment, begin_pass, card, depth_test, draw_with, group, mark, pass, row_of_tiles, surface};
use crate::Card;
use crate::block_cache::BlockCache;
use crate::compression::{Codec, Compression};
use crate::copies;
use crate::depth::{Depth, DepthConfig, DepthPorts, QuestionPorts};
use crate::early::{DepthSource, Early, EarlyCounts, EarlyRate};
use crate::token::{Ack, GroupToken, Kind};
use gfx::format::Format;
use gfx::setup::DepthPlane;
use gfx::state::Compare;
use mem::Ideal;
use num::Cycle;
use sim::{Circuit, Link, One, Unit, Wiring};

sim::circuit! {
    struct EarlyCircuit for Card {
        source: One<TokenSource<GroupToken>>,
        early: One<Early>,
        end: One<TokenSource<Ack>>,
        depth: One<Depth>,
        sink: One<Sink<GroupToken>>,
        ack: One<Sink<Ack>>,
        ideal: Option<Ideal>,
    }
}

/// The groups, and the depths that are known.
struct Scene {
    /// Cycles to the owner and back; none: the pipeline has a copy.
    latency: Option<u32>,
    quads_per_cycle: u32,
    queue: u32,
    compare: Compare,
    /// Blocks hold depth 0.5, in memory or by flag.
    cleared: bool,
    /// Groups of four quads by block, of a triangle with depth 0.25.
    groups: Vec<u32>,
}

impl Default for Scene {
    fn default() -> Scene {
        Scene { latency: None, quads_per_cycle: 4, queue: 64, compare: Compare::Less, cleared: true, groups: vec![0] }
    }
}

/// When groups came to interpolation, when the mark behind them did, what was counted.
fn tested(scene: &Scene) -> (Vec<Cycle>, Cycle, EarlyCounts) {
    let prepared = || {
        let mut card = card(1);
        begin_pass(&mut card, pass(vec![], Some(attachment(surface(1, Format::Depth32Float, 16, 1)))), scene.cleared);
        card.frame.stores[0].clear([0.5_f32.to_bits(), 0, 0, 0]);
        card.class_state.seen = vec![Default::default()];
        copies::begin_seen(&card.frame, &mut card.class_state.seen, 0, false);
        let mut segment = row_of_tiles(1, 1, 16, 0);
        segment.triangles[0].depth = DepthPlane::constant(0.25);
        let draw = draw_with(|state| state.depth_stencil = Some(depth_test(scene.compare)));
        card.install(0, Arc::new(segment), Arc::new(draw), 0);
        card
    };
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["source", "early", "end", "depth", "sink", "ack"].map(|name| wiring.unit(name, 0));
            let mut plan = memory(&mut wiring);
            let (to_early, from_traverse) = wiring.channel("groups", 0, FREE, ids[0], ids[1]);
            let (output, tested) = wiring.channel("tested", 0, FREE, ids[1], ids[4]);
            let (to_end, from_color) = wiring.channel("end", 0, FREE, ids[2], ids[3]);
            let (ack, acked) = wiring.channel("ack", 0, FREE, ids[3], ids[5]);
            let way = Link::bytes(64, 256, scene.latency.unwrap_or(1));
            let (ask, questions) = wiring.channel("questions", 0, way, ids[1], ids[3]);
            let (answer, answers) = wiring.channel("answers", 0, way, ids[3], ids[1]);
            let known = match scene.latency {
                Some(_) => DepthSource::Owners { questions: vec![ask], answers: vec![answers] },
                None => {
                    let memory = port(&mut plan, &mut wiring, ids[1]);
                    DepthSource::Copy(Box::new(BlockCache::new(
                        16,
                        16,
                        16,
                        Compression { enabled: false, codec: Codec::Planes, again: true },
                        memory,
                    )))
                }
            };
            let questions = Some(QuestionPorts { questions: vec![questions], answers: vec![answer] });
            let ports = DepthPorts { early: None, late: None, questions, updates: None, end: from_color, ack };
            let config = DepthConfig {
                quads_per_cycle: 4,
                cache_blocks: 16,
                cache_ways: 16,
                misses: 16,
                fifo: 64,
                latency: 6,
                ..DepthConfig::default()
            };
            let owner = Depth::new(config, 0, ports, port(&mut plan, &mut wiring, ids[3]));
            let mut card = prepared();
            let groups: Vec<_> = scene.groups.iter().map(|&block| (0, group(&mut card, 0, block, 0, 4))).collect();
            let items = groups.into_iter().chain([(0, mark(Kind::SEGMENT, 0))]).collect();
            let rate = EarlyRate { quads_per_cycle: scene.quads_per_cycle, queue: scene.queue, latency: 6 };
            let ideal = plan.build(&mut wiring).ideal;
            let circuit = EarlyCircuit::new(
                wiring,
                One(TokenSource::new(items, to_early)),
                One(Early::new(0, rate, from_traverse, output, known)),
                One(TokenSource::new(Vec::new(), to_end)),
                One(owner),
                One(Sink::new(tested)),
                One(Sink::new(acked)),
                ideal,
            );
            (circuit, card)
        },
        |c, _| c.early.resident() == 0 && c.depth.resident() == 0 && c.wires().resident() == 0 && !c.sink.got.is_empty(),
        |c, card| {
            assert_eq!(card.funnel.total().quads_early_culled, c.early.counts().culled);
            let data = |token: &&(Cycle, GroupToken)| token.1.kind == Kind::DATA;
            let times = c.sink.got.iter().filter(data).map(|&(at, _)| at).collect();
            let mark = c.sink.got.iter().find(|(_, token)| token.kind == Kind::SEGMENT).expect("a mark").0;
            (times, mark, c.early.counts())
        },
    )
}

#[test]
fn a_copy_knows_what_the_pipeline_has_drawn() {
    // In hand in cycle 1, tested 6 later, a cycle on the way: as in a depth unit. The second group is behind the first.
    let (times, mark, counts) = tested(&Scene { groups: vec![0, 0, 1], ..Scene::default() });
    assert_eq!((times, mark), (vec![8, 10], 11));
    assert_eq!((counts.asked, counts.answered, counts.culled, counts.culled_fragments), (12, 12, 4, 16));
    assert_eq!((counts.question_bytes, counts.answer_bytes), (0, 0));
    // Equal depths pass where they may.
    let (times, _, counts) = tested(&Scene { groups: vec![0, 0], compare: Compare::LessEqual, ..Scene::default() });
    assert_eq!((times, counts.culled), (vec![8, 9], 0));
    // What the pass has loaded is read: asked for in cycle 2.
    let (times, ..) = tested(&Scene { cleared: false, ..Scene::default() });
    assert_eq!(times, [2 + round_trip(256) + 1]);
    // A draw whose test says nothing ahead goes by, at the rate.
    let (times, _, counts) = tested(&Scene { groups: vec![0, 0], compare: Compare::Always, ..Scene::default() });
    assert_eq!((times, counts.asked), (vec![8, 9], 0));
}

#[test]
fn an_owner_answers_after_two_ways_and_a_test() {
    // Asked in cycle 1, tested there when it has come and 6 cycles have gone by; the answer is as long on its way, and the group then a
    // cycle on its own. Four quads per cycle are tested here and there.
    for latency in [1, 5, 40] {
        let remote = |groups, compare| tested(&Scene { latency: Some(latency), groups, compare, ..Scene::default() });
        let (times, mark, counts) = remote(vec![0, 0, 1], Compare::Less);
        let first = 1 + 2 * Cycle::from(latency) + 6 + 1;
        assert_eq!((times, mark), (vec![first, first + 1, first + 2], first + 3), "{latency}");
        // The owner has drawn none of them yet. 8 bytes per question, 16 per quad in the answer.
        assert_eq!((counts.asked, counts.culled, counts.question_bytes, counts.answer_bytes), (12, 0, 24, 192));
        // Depth 0.25 is not greater than the owner's 0.5.
        let (times, _, counts) = remote(vec![0, 1], Compare::Greater);
        assert_eq!((times, counts.culled), (vec![], 8), "{latency}");
    }
}

#[test]
fn no_more_wait_than_there_are_places() {
    // One group at a time: the next is taken in hand in the cycle in which the first goes on.
    let scene = Scene { latency: Some(5), queue: 1, groups: vec![0, 1], ..Scene::default() };
    assert_eq!(tested(&scene).0, [18, 18 + 16]);
    // Two per cycle where there is room: 17 apart from the first question to the second answer.
    assert_eq!(tested(&Scene { queue: 2, ..scene }).0, [18, 19]);
}
