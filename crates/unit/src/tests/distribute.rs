//! Distribution: who receives a triangle, and how fast.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{card_of_tiles, draw, row_of_tiles};
use crate::Card;
use crate::distribute::{Distribute, DistributeConfig, Overlap};
use crate::interleave::Pattern;
use crate::network::Sender;
use crate::sorting::SortCounts;
use crate::token::{Kind, NextDraw, Run, TriangleToken, bytes};
use num::Cycle;
use sim::{Link, One, Wiring};
use work::{End, Segment};

sim::circuit! {
    struct DistributeCircuit for Card {
        source: One<TokenSource<Run>>,
        distribute: One<Distribute>,
        sink: Vec<Sink<TriangleToken>>,
        turns: Option<TokenSource<NextDraw>>,
    }
}

fn config(overlap: Overlap, tile: u32) -> DistributeConfig {
    DistributeConfig {
        tile,
        pattern: Pattern::Skewed,
        overlap,
        triangles_per_cycle: 1,
        interval: 1,
        ..DistributeConfig::default()
    }
}

/// When each of `pipelines` rasterisers receives triangles, and what is counted, for a run of all triangles of a segment.
fn distributed(pipelines: usize, config: &DistributeConfig, segment: &Segment) -> (Vec<Vec<Cycle>>, SortCounts) {
    linked(pipelines, config, 1, segment)
}

/// As [`distributed`], over links that take `link_width` triangles per cycle.
fn linked(pipelines: usize, config: &DistributeConfig, link_width: u32, segment: &Segment) -> (Vec<Vec<Cycle>>, SortCounts) {
    let run = Run { slot: 0, kind: Kind::DATA, sequence: 0, first: 0, count: segment.triangles.len() as u32 };
    let end = Run { kind: Kind::END, count: 0, ..run };
    let (times, counts) = settle(
        || {
            let mut wiring = Wiring::new();
            let (a, b) = (wiring.unit("source", 0), wiring.unit("distribute", 0));
            let sinks = wiring.bank("sink", pipelines);
            let (output, into) = wiring.channel("in", 0, FREE, a, b);
            let (mut outputs, mut sink) = (Vec::new(), Vec::new());
            for (index, &id) in sinks.iter().enumerate() {
                let link = Link::bytes(8, link_width * bytes::TRIANGLE, 3);
                let (out, input) = wiring.channel("out", index, link, b, id);
                outputs.push(out);
                sink.push(Sink::new(input));
            }
            let mut card = card_of_tiles(pipelines, config.tile);
            card.install(0, Arc::new(segment.clone()), Arc::new(draw()), 0);
            let source = One(TokenSource::new(vec![(0, run), (0, end)], output));
            let unit = One(Distribute::new(config.clone(), 0, into, Sender::direct(outputs)));
            (DistributeCircuit::new(wiring, source, unit, sink, None), card)
        },
        |c, _| c.sink.iter().all(|sink| sink.got.last().is_some_and(|(_, token)| token.kind == Kind::END)),
        |c, card| {
            assert_eq!(card.funnel.total().triangles_setup, c.distribute.counts().sorted_items);
            let data = |sink: &Sink<TriangleToken>| {
                sink.got.iter().filter(|(_, token)| token.kind == Kind::DATA).map(|&(at, _)| at).collect::<Vec<_>>()
            };
            (c.sink.iter().map(data).collect::<Vec<_>>(), c.distribute.counts())
        },
    );
    (times, counts)
}

#[test]
fn a_triangle_goes_to_every_owner_of_what_it_covers_and_to_no_other() {
    // Three tiles in a row belong to pipelines 0, 1 and 2. In the unit's hands in cycle 1, 3 cycles on the way.
    for overlap in [Overlap::Exact, Overlap::Bounds] {
        let (times, counts) = distributed(4, &config(overlap, 64), &row_of_tiles(3, 8, 4, 0));
        assert_eq!(times, [vec![4], vec![4], vec![4], vec![]], "{overlap:?}");
        assert_eq!((counts.sorted_items, counts.sent, counts.redistributed_items), (1, 1, 3));
        assert_eq!((counts.redistributed_bytes, counts.marks), (3 * u64::from(bytes::TRIANGLE), 4));
    }
    // A bounding box with eight rows of blocks more reaches the tiles below, which belong to pipelines 3, 0 and 1 (a step of 3).
    let (times, _) = distributed(4, &config(Overlap::Bounds, 64), &row_of_tiles(3, 8, 4, 8));
    assert_eq!(times.concat().len(), 4);
    let (times, _) = distributed(4, &config(Overlap::Exact, 64), &row_of_tiles(3, 8, 4, 8));
    assert_eq!(times.concat().len(), 3);
    // Tiles of two blocks: eight blocks in a row are four tiles, all owners in turn.
    let (times, _) = distributed(8, &config(Overlap::Exact, 16), &row_of_tiles(1, 8, 4, 0));
    assert_eq!(times.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 1, 1, 0, 0, 0, 0]);
}

#[test]
fn a_triangle_that_covers_nothing_is_dropped_where_that_is_seen() {
    let mut segment = row_of_tiles(1, 8, 4, 0);
    segment.triangles.push(segment.triangles[0]);
    segment.triangles[0].visits = 0;
    for pipelines in [1, 4] {
        let (times, counts) = distributed(pipelines, &config(Overlap::Exact, 64), &segment);
        // It has taken its turn of the routing.
        assert_eq!(times[0], [5], "{pipelines} pipelines");
        assert_eq!((counts.sorted_items, counts.sent, counts.redistributed_items), (2, 1, 1));
        // A bounding box says nothing of coverage.
        let (times, counts) = distributed(pipelines, &config(Overlap::Bounds, 64), &segment);
        assert_eq!(times[0], [4, 5], "{pipelines} pipelines");
        assert_eq!((counts.sorted_items, counts.sent, counts.redistributed_items), (2, 2, 2));
    }
}

#[test]
fn a_triangle_that_is_not_culled_goes_where_its_bounds_are() {
    let mut segment = row_of_tiles(3, 8, 4, 0);
    (segment.triangles[0].visits, segment.triangles[0].end) = (0, End::Setup);
    for overlap in [Overlap::Exact, Overlap::Bounds] {
        let (times, counts) = distributed(4, &config(overlap, 64), &segment);
        assert_eq!(times.iter().map(Vec::len).collect::<Vec<_>>(), [1, 1, 1, 0], "{overlap:?}");
        assert_eq!((counts.sent, counts.redistributed_items), (1, 3));
    }
    // Outside of all pixels: to one pipeline, whose turn goes by the primitive.
    for (primitive, to) in [(0, 0), (3, 3), (6, 2)] {
        let triangle = &mut segment.triangles[0];
        (triangle.bounds, triangle.primitive) = ([0; 4], primitive);
        let (times, counts) = distributed(4, &config(Overlap::Exact, 64), &segment);
        assert_eq!((times[to].len(), counts.redistributed_items), (1, 1), "primitive {primitive}");
    }
    assert_eq!(distributed(1, &config(Overlap::Exact, 64), &segment).0[0].len(), 1);
}

#[test]
fn so_many_are_routed_a_cycle_and_the_links_take_their_width() {
    let mut segment = row_of_tiles(1, 8, 4, 0);
    segment.triangles = vec![segment.triangles[0]; 6];
    let times = |routed, link_width| {
        let config = DistributeConfig { triangles_per_cycle: routed, ..config(Overlap::Exact, 64) };
        linked(2, &config, link_width, &segment).0[0].clone()
    };
    assert_eq!(times(1, 1), [4, 5, 6, 7, 8, 9]);
    assert_eq!(times(2, 2), [4, 4, 5, 5, 6, 6]);
    assert_eq!(times(1, 2), [4, 5, 6, 7, 8, 9]);
    assert_eq!(times(2, 1), [4, 5, 6, 7, 8, 9]);
    // Where a triangle takes some cycles, that decides.
    let apart = |interval| {
        let config = DistributeConfig { interval, ..config(Overlap::Exact, 64) };
        linked(2, &config, 1, &segment).0[0].clone()
    };
    assert_eq!(apart(4), [4, 8, 12, 16, 20, 24]);
}

#[test]
fn triangles_wait_for_the_turn_of_their_draw() {
    let times = settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["source", "distribute", "sink", "turns"].map(|name| wiring.unit(name, 0));
            let (output, into) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (out, input) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
            let (tell, told) = wiring.channel("turns", 0, FREE, ids[3], ids[1]);
            let mut card = card_of_tiles(1, 64);
            let segment = Arc::new(row_of_tiles(1, 1, 1, 0));
            card.install(0, segment.clone(), Arc::new(draw()), 7);
            card.install(1, segment, Arc::new(draw()), 8);
            let run = |slot, kind, count| (0, Run { slot, kind, sequence: 0, first: 0, count });
            let runs = vec![run(0, Kind::DATA, 1), run(0, Kind::SEGMENT, 0), run(1, Kind::DATA, 1), run(1, Kind::SEGMENT, 0)];
            let unit = Distribute::new(config(Overlap::Exact, 64), 0, into, Sender::direct(vec![out])).in_turn(told);
            let turns = vec![(10, NextDraw { draw: 7 }), (30, NextDraw { draw: 8 })];
            let circuit = DistributeCircuit::new(
                wiring,
                One(TokenSource::new(runs, output)),
                One(unit),
                vec![Sink::new(input)],
                Some(TokenSource::new(turns, tell)),
            );
            (circuit, card)
        },
        |c, _| c.sink[0].got.len() == 4,
        |c, _| c.sink[0].log(|token| token.kind),
    );
    // A turn told in cycle 10 is there in 11, its triangle a cycle later. Marks do not wait.
    assert_eq!(times, [(12, Kind::DATA), (12, Kind::SEGMENT), (32, Kind::DATA), (32, Kind::SEGMENT)]);
}
