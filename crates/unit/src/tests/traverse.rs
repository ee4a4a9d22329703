//! Traversal: the longest of covered blocks, tests and quads; hierarchical Z.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{
    attachment, begin_pass, card, card_of_tiles, depth_test, draw, draw_with, pass, row_of_tiles, surface, triangle,
};
use crate::Card;
use crate::card::DepthStart;
use crate::distribute::Overlap;
use crate::token::{DepthBounds, GroupToken, Kind, TriangleToken};
use crate::traverse::{HierarchicalTest, Territory, Traverse, TraverseConfig, TraverseCounts};
use gfx::format::Format;
use gfx::hierarchical::depth_key;
use gfx::setup::DepthPlane;
use gfx::stage::Stage;
use gfx::state::Compare;
use num::Cycle;
use sim::{Link, One, Unit, Wiring};
use work::{End, Funnel, RecordedState, Segment};

sim::circuit! {
    struct GatherCircuit for Card {
        source: One<TokenSource<TriangleToken>>,
        traverse: One<Traverse>,
        sink: One<Sink<GroupToken>>,
    }
}

sim::circuit! {
    struct TraverseCircuit for Card {
        source: One<TokenSource<TriangleToken>>,
        bounds: One<TokenSource<DepthBounds>>,
        traverse: One<Traverse>,
        sink: One<Sink<GroupToken>>,
    }
}

pub fn config() -> TraverseConfig {
    TraverseConfig {
        blocks_per_cycle: 1,
        tests_per_cycle: 4,
        quads_per_cycle: 4,
        depth_quads_per_cycle: 4,
        interval: 1,
        latency: 1,
        queue: 4096,
        hierarchical_z: true,
        hierarchical_latency: 1,
        hierarchical_queue: 16,
        pixel_tests_per_cycle: 1,
        ..TraverseConfig::default()
    }
}

/// When groups and the mark behind them leave the traversal of pipeline 0, for all triangles of a segment; with `prepare` doing
/// what is to be done to the card first.
pub fn traversed(
    config: &TraverseConfig,
    segment: &Segment,
    updates: &[(Cycle, DepthBounds)],
    prepare: impl Fn(&mut Card),
) -> (Vec<(Cycle, Kind)>, Funnel, TraverseCounts) {
    traverse_with(config, segment, updates, prepare, |c, card| {
        assert_eq!(c.traverse.items(), card.funnel.total().quads_rasterized);
        (c.sink.log(|token| token.kind), card.funnel.total(), c.traverse.counts())
    })
}

/// The same, with what is asked of the circuit at the end.
fn traverse_with<R: PartialEq + std::fmt::Debug>(
    config: &TraverseConfig,
    segment: &Segment,
    updates: &[(Cycle, DepthBounds)],
    prepare: impl Fn(&mut Card),
    result: impl Fn(&TraverseCircuit, &Card) -> R,
) -> R {
    settle(
        || {
            let mut wiring = Wiring::new();
            let names = ["source", "bounds", "traverse", "sink"];
            let ids = names.map(|name| wiring.unit(name, 0));
            let (output, into) = wiring.channel("in", 0, FREE, ids[0], ids[2]);
            let (bounds_out, told) = wiring.channel("updates", 0, FREE, ids[1], ids[2]);
            // As wide as can be, so that what is measured is the unit's own.
            let link = Link::items(config.queue, 4096, config.latency);
            let (out, input) = wiring.channel("out", 0, link, ids[2], ids[3]);
            let mut card = card(1);
            prepare(&mut card);
            if card.work[0].is_none() {
                card.install(0, Arc::new(segment.clone()), Arc::new(draw()), 0);
            }
            let triangles = (0..segment.triangles.len()).map(|t| (0, triangle(Kind::DATA, 0, t as u32)));
            let items = triangles.chain([(0, triangle(Kind::SEGMENT, 0, 0))]).collect();
            let circuit = TraverseCircuit::new(
                wiring,
                One(TokenSource::new(items, output)),
                One(TokenSource::new(updates.to_vec(), bounds_out)),
                One(Traverse::new(config.clone(), 0, Territory::Tiles, into, Some(told), out)),
                One(Sink::new(input)),
            );
            (circuit, card)
        },
        |c, _| c.sink.got.last().is_some_and(|(_, token)| token.kind == Kind::SEGMENT),
        result,
    )
}

/// Cycles from the first triangle in the unit's hands to the mark behind the last: what all triangles take. (The mark leaves in
/// the cycle in which the last triangle ends, which counts, and is a cycle on the way.)
pub fn cycles(config: &TraverseConfig, segment: &Segment) -> Cycle {
    let (log, ..) = traversed(config, segment, &[], |_| ());
    log.last().expect("a mark").0 - 1
}

/// A segment of `count` triangles, each of `blocks` blocks of `quads` quads and `empty` blocks more in its bounding box.
pub fn triangles(count: usize, blocks: u32, quads: u8, empty: u16) -> Segment {
    let mut segment = row_of_tiles(1, blocks, quads, 0);
    // One row of blocks, or two that the bounding box has but the triangle does not.
    let row = segment.triangles[0];
    segment.triangles[0].bounds = [0, 0, blocks as u16 + empty, 1];
    segment.triangles[0].pixels = [0, 0, 8 * (blocks as u16 + empty), 8];
    assert!(blocks as u16 + empty <= 8 && row.visits == 1);
    segment.triangles = vec![segment.triangles[0]; count];
    segment
}

/// A unit between a source of triangles and a sink of groups, over channels without a limit.
fn gather_circuit(
    items: Vec<(Cycle, TriangleToken)>,
    unit: impl FnOnce(sim::In<TriangleToken>, sim::Out<GroupToken>) -> Traverse,
) -> GatherCircuit {
    let mut wiring = Wiring::new();
    let ids = ["source", "traverse", "sink"].map(|name| wiring.unit(name, 0));
    let (output, into) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
    let (out, input) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
    GatherCircuit::new(wiring, One(TokenSource::new(items, output)), One(unit(into, out)), One(Sink::new(input)))
}

#[test]
fn triangles_wait_for_those_of_their_batch_that_come_here() {
    // Six triangles of a block of four quads, in batches of four; they come in these cycles, and a mark behind the last. Groups leave a cycle apart.
    let left = |config: &TraverseConfig, rasterisers: usize, owner: usize, come: &[(Cycle, u32)]| {
        let segment = triangles(6, 1, 4, 0);
        settle(
            || {
                let mut card = card_of_tiles(rasterisers, 8);
                let mut segment = segment.clone();
                // Those with an odd number lie in the next tile, of another rasteriser.
                for triangle in segment.triangles.iter_mut().skip(1).step_by(2) {
                    triangle.bounds = [1, 0, 2, 1];
                }
                card.install(0, Arc::new(segment), Arc::new(draw()), 0);
                let last = come.last().expect("a triangle").0;
                let items = come.iter().map(|&(at, number)| (at, triangle(Kind::DATA, 0, number)));
                let items = items.chain([(last, triangle(Kind::SEGMENT, 0, 0))]).collect();
                assert_eq!(card.interleave.owner(0, 0), owner as u8);
                let unit = |into, out| {
                    Traverse::new(config.clone(), 0, Territory::Tiles, into, None, out).gathering(Overlap::Bounds, rasterisers)
                };
                (gather_circuit(items, unit), card)
            },
            |c, _| c.sink.got.last().is_some_and(|(_, token)| token.kind == Kind::SEGMENT),
            |c, _| c.sink.got.iter().filter(|(_, token)| token.kind == Kind::DATA).map(|&(at, _)| at).collect::<Vec<_>>(),
        )
    };
    let four = TraverseConfig { triangles: 4, quads_per_cycle: 4, blocks_per_cycle: 1, tests_per_cycle: 1, ..config() };
    // One rasteriser: four that are there in cycle 21, and the last two when both are.
    let come = [(0, 0), (5, 1), (10, 2), (20, 3), (40, 4), (60, 5)];
    assert_eq!(left(&four, 1, 0, &come), [22, 23, 24, 25, 62, 63]);
    // Of two rasterisers, numbers 0, 2 and 4 come here: of a batch nothing else is waited for.
    let here = [(0, 0), (10, 2), (40, 4)];
    assert_eq!(left(&four, 2, 0, &here), [12, 13, 42]);
}

#[test]
fn triangles_together_are_traversed_block_by_block() {
    // Three triangles of 4 blocks of 6 quads, two groups each, and one over the last two of these blocks alone.
    let mut segment = triangles(4, 4, 6, 0);
    segment.visits.push(work::Visit { tile: 0, first_block: 2, blocks: 2 });
    segment.triangles[1].first_visit = 1;
    let order = |triangles: u32| {
        let config = TraverseConfig { triangles, ..config() };
        traverse_with(
            &config,
            &segment,
            &[],
            |_| {},
            |c, card| {
                let groups = c.sink.got.iter().filter(|(_, token)| token.kind == Kind::DATA);
                let of = |token: &GroupToken| {
                    let group = &card.groups[0][token.group];
                    (group.block, group.triangle, group.first)
                };
                (groups.map(|(_, token)| of(token)).collect::<Vec<_>>(), card.funnel.total())
            },
        )
    };
    let (alone, funnel) = order(1);
    assert_eq!(alone.len(), 2 * (3 * 4 + 2));
    assert!(alone.is_sorted_by_key(|&(block, triangle, first)| (triangle, block, first)));
    // All four wait from the first cycle on, but the first is taken before the others come.
    for together in [2, 3, 4, 64] {
        let (mut groups, same) = order(together);
        assert_eq!(same, funnel, "{together}");
        assert_ne!(groups, alone, "{together}");
        for block in 0..4 {
            let in_block: Vec<_> = groups.iter().filter(|group| group.0 == block).collect();
            assert!(in_block.is_sorted_by_key(|&&(_, triangle, first)| (triangle, first)), "API order in block {block}");
        }
        groups.sort_unstable();
        let mut all = alone.clone();
        all.sort_unstable();
        assert_eq!(groups, all, "each group once");
    }
}

#[test]
fn a_triangle_takes_the_longest_of_blocks_tests_and_quads() {
    // 8 blocks of 3 quads at a block per cycle; 8 blocks of 16 quads at 4 quads per cycle.
    for (quads, each) in [(3, 8), (16, 32)] {
        let segment = triangles(2, 8, quads, 0);
        assert_eq!(cycles(&config(), &segment), 2 * each, "{quads} quads a block");
        let (log, funnel, _) = traversed(&config(), &segment, &[], |_| ());
        assert_eq!(log.len(), 2 * 8 * usize::from(quads).div_ceil(4) + 1);
        assert_eq!((funnel.tiles_visited, funnel.quads_rasterized), (16, 16 * u64::from(quads)));
        assert_eq!(funnel.fragments_covered, 64 * u64::from(quads));
    }
    let two = TraverseConfig { blocks_per_cycle: 2, ..config() };
    assert_eq!(cycles(&two, &triangles(2, 8, 2, 0)), 2 * 4);
    // Four quads in two cycles: of 64 groups the last leaves in the first cycle of its interval.
    let slow = TraverseConfig { interval: 2, ..config() };
    assert_eq!(cycles(&slow, &triangles(2, 8, 16, 0)), 2 * 64 - 1);
}

#[test]
fn quads_without_colours_have_a_rate_of_their_own() {
    // Sixteen blocks of 16 quads: 64 cycles at four per cycle, 32 at eight. At two per cycle they are slower than those with colours.
    let segment = triangles(2, 8, 16, 0);
    for (rate, without, with) in [(4, 64, 64), (8, 32, 64), (2, 127, 64)] {
        let config = TraverseConfig { depth_quads_per_cycle: rate, ..config() };
        for (fragment, expected) in [(draw().shapes[Stage::Fragment], with), (None, without)] {
            let install = |card: &mut Card| {
                let draw = draw_with(|state| state.shapes[Stage::Fragment] = fragment);
                card.install(0, Arc::new(segment.clone()), Arc::new(draw), 0);
            };
            let (log, ..) = traversed(&config, &segment, &[], install);
            assert_eq!(log.last().expect("a mark").0 - 1, expected, "{rate} a cycle, {fragment:?}");
        }
    }
}

#[test]
fn empty_blocks_take_tests_and_the_testers_run_ahead() {
    // One covered block and seven empty ones, 4 tests per cycle: 2 cycles per triangle.
    assert_eq!(cycles(&config(), &triangles(1, 1, 4, 7)), 2);
    assert_eq!(cycles(&config(), &triangles(5, 1, 4, 7)), 5 * 2);
    // One and eight would be 9 tests: 2 1/4 cycles. Here with one test per cycle, which is no more than a covered block takes.
    let slow = TraverseConfig { tests_per_cycle: 1, ..config() };
    assert_eq!(cycles(&slow, &triangles(3, 3, 4, 5)), 3 * 8);
    // Two tests per cycle: 8 tests are 4 cycles, more than the 3 covered blocks take.
    let two = TraverseConfig { tests_per_cycle: 2, ..config() };
    assert_eq!(cycles(&two, &triangles(3, 3, 4, 5)), 3 * 4);
    // Six covered blocks take longer than the tests: the two empty ones cost nothing. Eight rows of eight empty ones do: 72 tests.
    assert_eq!(cycles(&two, &triangles(3, 6, 4, 2)), 3 * 6);
    let mut tall = row_of_tiles(1, 8, 4, 7);
    assert_eq!(cycles(&config(), &tall), 16, "64 tests at 4 a cycle");
    // Quads that take longer than all tests hide them: 8 blocks of 16 quads.
    tall = row_of_tiles(1, 8, 16, 7);
    assert_eq!(cycles(&config(), &tall), 32);
}

#[test]
fn a_triangle_that_covers_nothing_here_takes_a_test() {
    let mut segment = row_of_tiles(1, 8, 4, 0);
    segment.triangles[0].visits = 0;
    segment.triangles = vec![segment.triangles[0]; 12];
    assert_eq!(cycles(&config(), &segment), 3);
}

#[test]
fn only_own_blocks_are_tested() {
    // Tiles of one block, dealt to two pipelines in turn: of 8 covered blocks and 56 empty ones half are pipeline 0's.
    let segment = row_of_tiles(1, 8, 4, 7);
    let share = |card: &mut Card| {
        *card = card_of_tiles(2, 8);
        card.install(0, Arc::new(segment.clone()), Arc::new(draw()), 0);
    };
    let (log, funnel, _) = traversed(&config(), &segment, &[], share);
    assert_eq!(log.last().unwrap().0 - 1, 32 / 4);
    assert_eq!((funnel.tiles_visited, log.len()), (4, 4 + 1));
}

#[test]
fn a_full_link_holds_traversal_up() {
    // Four places and a latency of 7: four groups in every 8 cycles.
    let config = TraverseConfig { queue: 4, latency: 7, ..config() };
    let (log, ..) = traversed(&config, &triangles(1, 8, 4, 0), &[], |_| ());
    let times: Vec<_> = log.iter().map(|&(at, _)| at).collect();
    assert_eq!(times, [8, 9, 10, 11, 16, 17, 18, 19, 24]);
}

/// A depth attachment whose hierarchical Z starts at 0.5, under triangles of depth 0.75.
fn hidden(segment: &Segment, cleared_to: Option<f32>) -> impl Fn(&mut Card) {
    let segment = segment.clone();
    move |card| {
        let surface = surface(1, Format::Depth32Float, 8, 1);
        begin_pass(card, pass(vec![], Some(attachment(surface))), true);
        let key = |depth: f32| depth_key(Format::Depth32Float, depth.to_bits());
        let bounds = cleared_to.map_or((0, u32::MAX), |depth| (key(depth), key(depth)));
        card.passes.current_mut().unwrap().depth_start = Some(DepthStart { bounds: Some(bounds), began: (0, bounds) });
        let draw = draw_with(|state| state.depth_stencil = Some(depth_test(Compare::Less)));
        card.install(0, Arc::new(segment.clone()), Arc::new(draw), 0);
    }
}

#[test]
fn hidden_blocks_take_a_test_and_no_quads() {
    let mut segment = triangles(2, 8, 16, 0);
    for triangle in &mut segment.triangles {
        triangle.depth = DepthPlane::constant(0.75);
    }
    // All hidden: a block per cycle instead of one in four.
    let (log, funnel, _) = traversed(&config(), &segment, &[], hidden(&segment, Some(0.5)));
    assert_eq!(log, [(16 + 1, Kind::SEGMENT)]);
    assert_eq!((funnel.tiles_visited, funnel.tiles_hiz_culled, funnel.quads_early_culled), (16, 16, 256));
    // Nothing known of the depths, or the culling switched off: all are sent.
    for (known, switch) in [(None, true), (Some(0.5), false)] {
        let config = TraverseConfig { hierarchical_z: switch, ..config() };
        let (log, funnel, _) = traversed(&config, &segment, &[], hidden(&segment, known));
        assert_eq!((log.last().unwrap().0, funnel.tiles_hiz_culled), (64 + 1, 0), "{known:?}");
    }
}

#[test]
fn an_update_hides_from_the_cycle_on_in_which_it_comes() {
    let mut segment = triangles(1, 8, 4, 0);
    segment.triangles[0].depth = DepthPlane::constant(0.75);
    let key = depth_key(Format::Depth32Float, 0.5_f32.to_bits());
    // Block n is tested in cycle 1 + n. What the source sends in cycle 3 comes in 4, in time for block 3 but not for block 2; a
    // word from another pass means nothing.
    let tell = |block, pass| (3, DepthBounds { block, min: key, max: key, pass });
    let (log, funnel, _) = traversed(&config(), &segment, &[tell(2, 0), tell(3, 0), tell(4, 9)], hidden(&segment, None));
    assert_eq!(funnel.tiles_hiz_culled, 1);
    let times: Vec<_> = log.iter().map(|&(at, _)| at).collect();
    assert_eq!(times, [2, 3, 4, 6, 7, 8, 9, 9]);
}

#[test]
fn a_line_of_bounds_keeps_what_it_was_read_with() {
    let mut segment = triangles(1, 8, 4, 0);
    segment.triangles[0].depth = DepthPlane::constant(0.75);
    let key = depth_key(Format::Depth32Float, 0.5_f32.to_bits());
    let tell = |at, block| (at, DepthBounds { block, min: key, max: key, pass: 0 });
    let hides = |lines, updates: &[(Cycle, DepthBounds)]| {
        let config = TraverseConfig { hierarchical_lines: lines, ..config() };
        traversed(&config, &segment, updates, hidden(&segment, None)).1.tiles_hiz_culled
    };
    // The line of blocks 0 to 3 is read for block 0 in cycle 1, that of 4 to 7 for block 4 in cycle 5. What comes in 4 for block 3 is too
    // late for its line, for block 5 it is not.
    let updates = [tell(3, 3), tell(3, 5)];
    assert_eq!((hides(0, &updates), hides(1, &updates)), (2, 1));
    assert_eq!((hides(1, &[tell(4, 5)]), hides(1, &[tell(5, 5)])), (1, 0));
}

#[test]
fn single_quads_are_hidden_by_their_own_depths() {
    // Depth grows from 0 at the left edge of a block to 1 at the right, and 0.5 is known: the right half is hidden.
    let mut segment = triangles(1, 1, 16, 0);
    segment.triangles[0].depth = DepthPlane { dzdx: 0.125, min: 0.0, max: 1.0, ..DepthPlane::constant(0.0) };
    let quads = |test| {
        let config = TraverseConfig { hierarchical_test: test, ..config() };
        traverse_with(&config, &segment, &[], hidden(&segment, Some(0.5)), |c, card| {
            let groups = c.sink.got.iter().filter(|(_, token)| token.kind == Kind::DATA);
            let of = |token: &GroupToken| (token.quads, card.groups[0][token.group].live.map(|live| live != 0));
            (groups.map(|(_, token)| of(token)).collect::<Vec<_>>(), card.funnel.total().quads_early_culled)
        })
    };
    assert_eq!(quads(HierarchicalTest::Block), (vec![(4, [true; 4]); 4], 0));
    assert_eq!(quads(HierarchicalTest::Quad), (vec![(2, [true, true, false, false]); 4], 8));
}

/// Triangles of these depths over the same eight blocks, whole.
fn over_each_other(depths: &[f32]) -> Segment {
    let mut segment = triangles(depths.len(), 8, 16, 0);
    for (triangle, &depth) in segment.triangles.iter_mut().zip(depths) {
        triangle.depth = DepthPlane::constant(depth);
    }
    segment
}

#[test]
fn blocks_are_accepted_by_what_they_can_hold_once_all_before_is_tested() {
    let config = TraverseConfig { hierarchical_accept: true, ..config() };
    let accepted = |depths: &[f32], cleared_to, change: &dyn Fn(&mut RecordedState)| {
        let segment = over_each_other(depths);
        let start = hidden(&segment, cleared_to);
        let prepare = |card: &mut Card| {
            start(card);
            let mut draw = (*card.work(0).draw).clone();
            change(Arc::make_mut(&mut draw.state));
            card.install(0, Arc::new(segment.clone()), Arc::new(draw), 0);
        };
        TraverseCounts { tested: 0, ..traversed(&config, &segment, &[], prepare).2 }
    };
    let blocks = |n: u64| TraverseCounts { accepted: 8 * n, unwritten: 0, ..TraverseCounts::default() };
    let as_it_is = |_: &mut RecordedState| ();
    // Nothing has been written yet when the second comes, which may yet lie behind the first; the third lies before both.
    assert_eq!(accepted(&[0.3, 0.4, 0.2], Some(0.5), &as_it_is), blocks(2));
    assert_eq!(accepted(&[0.3, 0.3], Some(0.5), &as_it_is), blocks(1));
    // Nothing is known of what was there.
    assert_eq!(accepted(&[0.3, 0.2], None, &as_it_is), blocks(0));
    // A test without a write needs neither to be read, and changes nothing for those behind it.
    let reads = |state: &mut RecordedState| state.depth_stencil.as_mut().expect("a test").depth_write = false;
    assert_eq!(
        accepted(&[0.3, 0.4], Some(0.5), &reads),
        TraverseCounts { accepted: 16, unwritten: 16, ..TraverseCounts::default() }
    );
    // Late tests write too, but none of them is decided ahead; and a shader's depths can be anywhere.
    assert_eq!(accepted(&[0.3], Some(0.5), &|state| state.early = false), blocks(0));
    // The other way round: farther passes.
    let farther =
        |state: &mut RecordedState| state.depth_stencil.as_mut().expect("a test").depth_compare = Compare::GreaterEqual;
    assert_eq!(accepted(&[0.6, 0.55, 0.6], Some(0.5), &farther), blocks(2));
    // With stencils beside them.
    let stencil =
        |state: &mut RecordedState| state.depth_stencil.as_mut().expect("a test").format = Format::Depth32FloatStencil8;
    assert_eq!(
        accepted(&[0.3], Some(0.5), &stencil),
        TraverseCounts { accepted: 8, unwritten: 0, ..TraverseCounts::default() }
    );
    // Off, nothing is.
    let segment = over_each_other(&[0.3]);
    let counts = traversed(&self::config(), &segment, &[], hidden(&segment, Some(0.5))).2;
    assert_eq!(counts, TraverseCounts { tested: 8, ..TraverseCounts::default() });
}

#[test]
fn a_triangle_without_samples_takes_all_blocks_of_its_bounds() {
    // Three of them, 4 tests per cycle; bounds of one, 8, 9 and 600 blocks, of which a pipeline alone owns all.
    for (x1, y1, all) in [(1, 1, 1), (8, 1, 6), (9, 1, 7), (30, 20, 450)] {
        let mut segment = triangles(3, 1, 4, 0);
        for triangle in &mut segment.triangles {
            (triangle.visits, triangle.bounds, triangle.end) = (0, [0, 0, x1, y1], End::Traversal);
        }
        assert_eq!(cycles(&config(), &segment), all, "{x1} x {y1} blocks");
        let (log, funnel, counts) = traversed(&config(), &segment, &[], |_| ());
        assert_eq!((log.len(), funnel.quads_rasterized), (1, 0));
        let blocks_in_vain = 3 * u64::from(x1) * u64::from(y1);
        assert_eq!(counts, TraverseCounts { tested: blocks_in_vain, ended: 3, blocks_in_vain, ..TraverseCounts::default() });
        // Of several pipelines each has its own tiles: the first of four owns every fourth tile of a row.
        let (.., counts) = traversed(&config(), &segment, &[], |own| *own = card_of_tiles(4, 8));
        assert!(counts.blocks_in_vain < blocks_in_vain || x1 == 1, "{counts:?}");
    }
}

#[test]
fn of_a_triangle_that_all_pipelines_get_each_draws_its_own_tiles() {
    // A block of four quads in each of four tiles, of which pipelines 0 to 3 own one each.
    let drawn = |territory: Territory, pipeline: u8, shared: bool| {
        let segment = row_of_tiles(4, 1, 4, 0);
        settle(
            || {
                let mut card = card(4);
                card.install(0, Arc::new(segment.clone()), Arc::new(draw()), 0);
                card.work[0].as_mut().expect("installed").shared = vec![shared];
                let items = vec![(0, triangle(Kind::DATA, 0, 0)), (0, triangle(Kind::PART_END, 0, 0))];
                let unit = |into, out| Traverse::new(config(), pipeline, territory, into, None, out);
                (gather_circuit(items, unit), card)
            },
            |c, _| c.sink.got.last().is_some_and(|(_, token)| token.kind == Kind::PART_END),
            |c, card| {
                let data = c.sink.got.iter().filter(|(_, token)| token.kind == Kind::DATA);
                let tiles: Vec<_> = data.map(|(_, token)| card.groups[usize::from(token.pool)][token.group].tile).collect();
                (tiles, card.funnel.total().quads_rasterized)
            },
        )
    };
    for territory in [Territory::Screen, Territory::Copy] {
        for pipeline in 0..4 {
            assert_eq!(drawn(territory, pipeline, true), (vec![u32::from(pipeline)], 4), "{territory:?}");
            assert_eq!(drawn(territory, pipeline, false), (vec![0, 1, 2, 3], 16), "{territory:?}");
        }
    }
}
