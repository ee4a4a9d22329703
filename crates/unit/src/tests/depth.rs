//! Depth and stencil tests: their rate, the Z cache, early behind late, the end of a pass.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, memory, port, round_trip, settle, write_time};
use super::scenery::{attachment, begin_pass, card, depth_test, draw_with, group, mark, pass, row_of_tiles, surface};
use crate::Card;
use crate::block_cache::BlockCounts;
use crate::block_sets::BlockSets;
use crate::card::Ahead;
use crate::compression::Codec;
use crate::depth::{Depth, DepthConfig, DepthPorts, PassEnd, TestPorts};
use crate::token::{Ack, DepthBounds, GroupToken, Kind};
use crate::traverse::HierarchicalUpdate;
use gfx::format::Format;
use gfx::hierarchical::depth_key;
use gfx::setup::DepthPlane;
use gfx::stage::Stage;
use gfx::state::Compare;
use mem::Ideal;
use num::Cycle;
use sim::{Circuit, One, Unit, Wiring};
use work::{Attachment, Funnel};

sim::circuit! {
    struct DepthCircuit for Card {
        /// The sources of early and late tests. The sinks, interpolation and colour units, have the same order.
        groups: Vec<TokenSource<GroupToken>>,
        end: One<TokenSource<Ack>>,
        depth: One<Depth>,
        tested: Vec<Sink<GroupToken>>,
        updates: One<Sink<DepthBounds>>,
        ack: One<Sink<Ack>>,
        ideal: Option<Ideal>,
    }
}

fn config() -> DepthConfig {
    DepthConfig {
        codec: Codec::Planes,
        recompress: true,
        cache_sets: BlockSets::Hashed,
        quads_per_cycle: 4,
        cache_blocks: 16,
        cache_ways: 16,
        misses: 16,
        fifo: 64,
        latency: 6,
        compression: false,
        ..DepthConfig::default()
    }
}

/// Where the pass, the draw and the tokens come from.
struct Scene {
    config: DepthConfig,
    update: HierarchicalUpdate,
    compare: Compare,
    /// Blocks hold depth 0.5, in memory or by flag.
    cleared: bool,
    /// The pass keeps its depths.
    store: bool,
    /// Groups on their way to the early tests, each of its block and number of quads; a mark follows them. All are there at once.
    groups: Vec<(u32, u8)>,
    /// When the pass ends.
    end: Option<Cycle>,
}

impl Default for Scene {
    fn default() -> Scene {
        Scene {
            config: config(),
            update: HierarchicalUpdate::Eviction,
            compare: Compare::Always,
            cleared: true,
            store: true,
            groups: Vec::new(),
            end: None,
        }
    }
}

/// The results of the unit.
#[derive(Debug, PartialEq)]
struct Tested {
    /// When groups came to interpolation, and when the mark behind them did.
    early: Vec<Cycle>,
    mark: Cycle,
    color: Vec<Cycle>,
    updates: Vec<(Cycle, (u32, u32, u32))>,
    ack: Vec<Cycle>,
    counts: BlockCounts,
    funnel: Funnel,
    items: u64,
}

/// A card in a pass over 16 blocks of depth 0.5, with a triangle of depth 0.25 in slot 0 for early tests and in slot 1 for late ones.
fn prepared(scene: &Scene) -> Card {
    let mut card = card(1);
    let target = attachment(surface(1, Format::Depth32Float, 16, 1));
    let target = Attachment { store: scene.store, stencil_store: false, ..target };
    begin_pass(&mut card, pass(vec![], Some(target)), scene.cleared);
    card.frame.stores[0].clear([0.5_f32.to_bits(), 0, 0, 0]);
    let mut segment = row_of_tiles(1, 1, 16, 0);
    segment.triangles[0].depth = DepthPlane::constant(0.25);
    let segment = Arc::new(segment);
    for (slot, early) in [true, false].into_iter().enumerate() {
        let draw = draw_with(|state| (state.depth_stencil, state.early) = (Some(depth_test(scene.compare)), early));
        card.install(slot as u16, segment.clone(), Arc::new(draw), slot as u32);
    }
    card
}

fn tested(scene: &Scene) -> Tested {
    let early = |card: &mut Card| {
        let groups = scene.groups.iter().map(|&(block, quads)| (0, group(card, 0, block, 0, quads))).collect::<Vec<_>>();
        groups.into_iter().chain([(0, mark(Kind::SEGMENT, 0))]).collect()
    };
    run(scene, early, |_| Vec::new())
}

fn run(
    scene: &Scene,
    early: impl Fn(&mut Card) -> Vec<(Cycle, GroupToken)>,
    late: impl Fn(&mut Card) -> Vec<(Cycle, GroupToken)>,
) -> Tested {
    settle(
        || {
            let mut wiring = Wiring::new();
            let groups = wiring.bank("groups", 2);
            let end = wiring.unit("end", 0);
            let depth = wiring.unit("depth", 0);
            let tested = wiring.bank("tested", 2);
            let [traverse, command] = ["updates", "ack"].map(|name| wiring.unit(name, 0));
            let mut plan = memory(&mut wiring);
            let (to_early, from_traverse) = wiring.channel("early", 0, FREE, groups[0], depth);
            let (to_late, from_cores) = wiring.channel("late", 0, FREE, groups[1], depth);
            let (to_end, from_color) = wiring.channel("end", 0, FREE, end, depth);
            let (interpolate, at_interpolate) = wiring.channel("tested", 0, FREE, depth, tested[0]);
            let (color, at_color) = wiring.channel("tested", 1, FREE, depth, tested[1]);
            let (updates, at_traverse) = wiring.channel("updates", 0, FREE, depth, traverse);
            let (ack, at_command) = wiring.channel("ack", 0, FREE, depth, command);
            let ports = DepthPorts {
                questions: None,
                early: Some(TestPorts { input: from_traverse, output: interpolate }),
                late: Some(TestPorts { input: from_cores, output: color }),
                updates: Some((updates, scene.update)),
                end: from_color,
                ack,
            };
            let memory = port(&mut plan, &mut wiring, depth);
            let mut card = prepared(scene);
            let (early, late) = (early(&mut card), late(&mut card));
            let end = scene.end.iter().map(|&at| (at, Ack { slot: 0, kind: Kind::PASS })).collect();
            let ideal = plan.build(&mut wiring).ideal;
            let circuit = DepthCircuit::new(
                wiring,
                vec![TokenSource::new(early, to_early), TokenSource::new(late, to_late)],
                One(TokenSource::new(end, to_end)),
                One(Depth::new(scene.config.clone(), 0, ports, memory)),
                vec![Sink::new(at_interpolate), Sink::new(at_color)],
                One(Sink::new(at_traverse)),
                One(Sink::new(at_command)),
                ideal,
            );
            (circuit, card)
        },
        |c, _| {
            let marked = c.tested[0].got.iter().any(|(_, token)| token.kind == Kind::SEGMENT);
            let ended = c.ack.got.len() == scene.end.iter().count();
            marked && ended && c.depth.resident() == 0 && c.wires().resident() == 0
        },
        |c, card| {
            let data = |token: &&(Cycle, GroupToken)| token.1.kind == Kind::DATA;
            Tested {
                early: c.tested[0].got.iter().filter(data).map(|&(at, _)| at).collect(),
                mark: c.tested[0].got.iter().find(|(_, token)| token.kind == Kind::SEGMENT).expect("a mark").0,
                color: c.tested[1].times(),
                updates: c.updates.log(|update| (update.block, update.min, update.max)),
                ack: c.ack.times(),
                counts: c.depth.counts(),
                funnel: card.funnel.total(),
                items: c.depth.items(),
            }
        },
    )
}

#[test]
fn a_cleared_block_is_tested_after_the_latency_and_without_memory() {
    // In hand in cycle 1, looked up in it, tested 6 later, a cycle on the way.
    let got = tested(&Scene { groups: vec![(0, 4)], ..Scene::default() });
    assert_eq!((got.early, got.items), (vec![8], 4));
    assert_eq!((got.counts.cleared_fills, got.counts.fills), (1, 0));
}

#[test]
fn quads_are_tested_at_the_rate_whether_they_pass_or_not() {
    let groups: Vec<_> = (0..4).map(|block| (block, 4)).collect();
    for (rate, times) in [(1, [8, 12, 16, 20]), (2, [8, 10, 12, 14]), (4, [8, 9, 10, 11]), (8, [8, 8, 9, 9])] {
        let config = DepthConfig { quads_per_cycle: rate, ..config() };
        let scene = |compare| Scene { config: config.clone(), compare, groups: groups.clone(), ..Scene::default() };
        let got = tested(&scene(Compare::Less));
        assert_eq!(got.early, times, "{rate} a cycle");
        // The mark goes on when the last test is over.
        let over = 7 + Cycle::from(16 / rate) + 1;
        assert_eq!((got.mark, got.funnel.quads_early_culled), (over, 0), "{rate} a cycle");
        // The same when none passes: depth 0.25 is not greater than 0.5.
        let got = tested(&scene(Compare::Greater));
        assert_eq!((got.early, got.mark, got.funnel.quads_early_culled), (vec![], over, 16), "{rate} a cycle");
    }
    // Groups of three fill a rate of four: 24 quads in 6 cycles, three groups in two of three cycles and one in each third.
    let got = tested(&Scene { groups: (0..8).map(|block| (block, 3)).collect(), ..Scene::default() });
    assert_eq!(got.early, [8, 8, 9, 10, 11, 11, 12, 13]);
}

#[test]
fn blocks_in_memory_are_waited_for() {
    // Looked up in cycle 1, asked for in 2, tested as they come. A block of 256 bytes takes the port 4 cycles, so that the next comes
    // 4 later; a second group of the same block goes with the first.
    let groups = vec![(0, 4), (0, 4), (1, 4), (2, 4)];
    let here = 2 + round_trip(256);
    let got = tested(&Scene { cleared: false, groups: groups.clone(), ..Scene::default() });
    assert_eq!(got.early, [here + 1, here + 2, here + 4 + 1, here + 8 + 1]);
    assert_eq!((got.counts.cleared_fills, got.counts.fills), (0, 3));
    // One request at a time.
    let config = DepthConfig { misses: 1, ..config() };
    let got = tested(&Scene { config, cleared: false, groups, ..Scene::default() });
    let next = |n| 2 + n * round_trip(256) + 1;
    assert_eq!(got.early, [next(1), next(1) + 1, next(2), next(3)]);
}

#[test]
fn early_tests_wait_for_late_ones_before_them() {
    // A group of a draw that is tested late passes by, in cycles 1 to 7; it comes back from the cores in 101, is tested in 107 and is a
    // cycle on the way to the colour unit. Only then is the group behind it looked up, and tested 6 later.
    let scene = Scene { compare: Compare::Less, ..Scene::default() };
    let early = |card: &mut Card| {
        let (first, second) = (group(card, 1, 0, 0, 4), group(card, 0, 0, 4, 4));
        vec![(0, first), (0, second), (0, mark(Kind::SEGMENT, 0))]
    };
    // The late group is the first that was made: number 0 of the pipeline's.
    let late = |_: &mut Card| vec![(100, GroupToken { group: 0, sequence: 0, kind: Kind::DATA, quads: 4, pool: 0 })];
    let got = run(&scene, early, late);
    assert_eq!((got.early, got.color), (vec![8, 107 + 6 + 1], vec![108]));
    assert_eq!(got.items, 8);
    // One that has no quad left takes its turn and is not tested.
    let empty = |_: &mut Card| vec![(100, GroupToken { group: 0, sequence: 0, kind: Kind::DATA, quads: 0, pool: 0 })];
    let got = run(&scene, early, empty);
    assert_eq!((got.early, got.color, got.items), (vec![8, 107 + 6 + 1], vec![108], 4));
}

#[test]
fn the_end_of_a_pass_writes_back_what_is_dirty() {
    // From cycle 101 on a block per cycle is put down for writing; the first is sent in 102, the others as the port takes 264 bytes
    // each. When the last is sent, the end is reported: a cycle on the way.
    let groups: Vec<_> = (0..8).map(|block| (block, 4)).collect();
    let scene = Scene { groups, end: Some(100), ..Scene::default() };
    let got = tested(&scene);
    assert_eq!((got.ack, got.counts.write_backs), (vec![102 + write_time(7, 256) + 1], 8));
    // A single block: one cycle to put it down, one to find that there are no more, and the report.
    let got = tested(&Scene { groups: vec![(0, 4)], end: Some(100), ..Scene::default() });
    assert_eq!((got.ack, got.counts.write_backs), (vec![103 + 1], 1));
    // A cache that is kept ends at once.
    let config = DepthConfig { pass_end: PassEnd::Keep, ..config() };
    let got = tested(&Scene { config, groups: (0..8).map(|block| (block, 4)).collect(), end: Some(100), ..Scene::default() });
    assert_eq!((got.ack, got.counts.write_backs), (vec![101 + 1], 0));
    // What the pass does not keep is looked at and forgotten.
    let got = tested(&Scene { store: false, ..scene });
    assert_eq!((got.ack, got.counts.write_backs), (vec![101 + 8 + 1 + 1], 0));
}

#[test]
fn hierarchical_z_is_told_at_every_write_or_when_a_block_leaves() {
    let key = |depth: f32| depth_key(Format::Depth32Float, depth.to_bits());
    // Tested in cycle 7, told in 8. A group of 4 quads leaves three quarters of the block as they were.
    let groups = vec![(0, 4), (1, 4)];
    let (compare, update) = (Compare::Less, HierarchicalUpdate::Write);
    let got = tested(&Scene { update, compare, groups: groups.clone(), ..Scene::default() });
    let both = (key(0.25), key(0.5));
    assert_eq!(got.updates, [(9, (0, both.0, both.1)), (10, (1, both.0, both.1))]);
    let got = tested(&Scene { compare, groups, ..Scene::default() });
    assert_eq!(got.updates, []);
    // A cache of four blocks, all in use until block 0 is tested in cycle 7. In that cycle block 4 takes its place and is tested 6
    // later; block 0 is written back.
    let config = DepthConfig { cache_blocks: 4, cache_ways: 4, ..config() };
    let got = tested(&Scene { config, compare, groups: (0..5).map(|block| (block, 4)).collect(), ..Scene::default() });
    assert_eq!(got.updates, [(9, (0, both.0, both.1))]);
    assert_eq!((got.early, got.counts.write_backs), (vec![8, 9, 10, 11, 14], 1));
}

#[test]
fn a_draw_without_fragment_stage_ends_here() {
    let scene = Scene { compare: Compare::Less, ..Scene::default() };
    let early = |card: &mut Card| {
        let (segment, mut only) = (card.work(0).segment.clone(), (*card.work(0).draw).clone());
        Arc::make_mut(&mut only.state).shapes[Stage::Fragment] = None;
        card.install(0, segment, Arc::new(only), 0);
        vec![(0, group(card, 0, 0, 0, 4)), (0, mark(Kind::SEGMENT, 0))]
    };
    let got = run(&scene, early, |_| Vec::new());
    assert_eq!((got.early, got.funnel.fragments_written), (vec![], 16));
}

/// Groups of four quads of slot 0, each of its block, first quad and what is known of it.
fn known(card: &mut Card, groups: &[(u32, u32, Ahead)]) -> Vec<(Cycle, GroupToken)> {
    let made = |&(block, first, ahead): &(u32, u32, Ahead)| {
        let token = group(card, 0, block, first, 4);
        card.groups[0][token.group].ahead = ahead;
        (0, token)
    };
    let groups: Vec<_> = groups.iter().map(made).collect();
    groups.into_iter().chain([(0, mark(Kind::SEGMENT, 0))]).collect()
}

#[test]
fn what_is_known_ahead_is_not_read() {
    let scene = Scene { cleared: false, compare: Compare::Less, ..Scene::default() };
    // All four groups of a block that is in memory, tested as if it were here.
    let whole = [0, 4, 8, 12].map(|first| (0, first, Ahead::Writes));
    let got = run(&scene, |card| known(card, &whole), |_| Vec::new());
    assert_eq!((got.early, got.items), (vec![8, 9, 10, 11], 16));
    assert_eq!((got.counts.overwritten, got.counts.fills, got.counts.cleared_fills), (1, 0, 0));
    // Of a block written in part the rest is read when the pass ends, and no sooner.
    let part = Scene { end: Some(100), ..Scene { cleared: false, compare: Compare::Less, ..Scene::default() } };
    let got = run(&part, |card| known(card, &whole[..2]), |_| Vec::new());
    assert_eq!((got.early, got.counts.overwritten, got.counts.fills), (vec![8, 9], 0, 1));
    // What passes and stays is not even looked up.
    let passes = [(0, 0, Ahead::Passes), (1, 0, Ahead::Passes)];
    let got = run(&scene, |card| known(card, &passes), |_| Vec::new());
    assert_eq!((got.early.len(), got.items, got.counts), (2, 0, BlockCounts::default()));
}
