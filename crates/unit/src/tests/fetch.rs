//! Vertex fetch: indices, reuse, attributes, batches.

use std::collections::VecDeque;
use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, memory, port, round_trip, settle};
use super::scenery::{card, draw, primitive};
use crate::Card;
use crate::fetch::{Fetch, FetchConfig, FetchInput, FetchPorts, Reuse, VertexDeal};
use crate::tags::CacheCounts;
use crate::token::{Kind, Packing, Piece, VertexBatch, WarpToken};
use gfx::stage::Stage;
use gfx::state::StepMode;
use mem::Ideal;
use num::Cycle;
use sim::{Link, One, StallProbe, Unit, Wiring};
use work::*;

sim::circuit! {
    struct FetchCircuit for Card {
        source: One<TokenSource<Piece>>,
        fetch: One<Fetch>,
        core: Vec<Sink<WarpToken>>,
        batches: One<Sink<VertexBatch>>,
        /// The messages of assembly: batches that it gives back, and the number of indices that it has taken.
        told: Vec<TokenSource<WarpToken>>,
        /// The messages of each pipeline about its fragments.
        packed: Vec<TokenSource<Packing>>,
        ideal: Option<Ideal>,
    }
}

fn config() -> FetchConfig {
    FetchConfig {
        line_bytes: 64,
        vertices_per_cycle: 0,
        deal: VertexDeal::RoundRobin,
        deal_warps: 64,
        patience: 16,
        indices_per_cycle: 2,
        runs: 16,
        index_lines: 16,
        reuse: 16,
        batch_indices: 96,
        announced: 256,
        reuse_until: Reuse::Replaced,
        ahead: 8,
        lookups_per_cycle: 1,
        skip_attributes: true,
        cache_lines: 16,
        cache_ways: 16,
        misses: 64,
        batches: 64,
        latency: 1,
        queue: 64,
        ..FetchConfig::default()
    }
}

/// Cycles from the request for a line to its answer.
const MISS: Cycle = round_trip(LINE as u32);

/// Vertices of a batch.
const WIDTH: u32 = 4;

/// The results of vertex fetch.
#[derive(Debug, PartialEq)]
struct Fetched {
    /// When batches came to each core.
    warps: Vec<Vec<Cycle>>,
    /// When batches were announced: number, end in the stream, vertices.
    batches: Vec<(Cycle, (u32, u32, u32))>,
    cache: CacheCounts,
    shaded: u64,
    requests: u64,
}

/// Fetches the vertices of segments, sends them to `cores` cores, and retires batches at the given cycles.
fn fetched(
    config: &FetchConfig,
    cores: usize,
    attributes: &[AttributeFetch],
    segments: &[Segment],
    retired: &[Cycle],
) -> Fetched {
    fetched_as_passed(config, cores, attributes, segments, retired, &[])
}

/// The same, where assembly tells at those cycles how many indices it has taken.
fn fetched_as_passed(
    config: &FetchConfig,
    cores: usize,
    attributes: &[AttributeFetch],
    segments: &[Segment],
    retired: &[Cycle],
    passed: &[(Cycle, u32)],
) -> Fetched {
    fetched_beside(config, (cores, FREE), attributes, segments, (retired, passed), &[])
}

/// The same, with links to the cores, and where each pipeline tells at some cycles of its fragments: core and state.
fn fetched_beside(
    config: &FetchConfig,
    cores: (usize, Link),
    attributes: &[AttributeFetch],
    segments: &[Segment],
    answers: (&[Cycle], &[(Cycle, u32)]),
    fragments: &[&[(Cycle, u16, u16)]],
) -> Fetched {
    fetched_by(WIDTH, config, cores, attributes, segments, answers, fragments)
}

/// The same, in batches of `width` vertices.
fn fetched_by(
    width: u32,
    config: &FetchConfig,
    (cores, link): (usize, Link),
    attributes: &[AttributeFetch],
    segments: &[Segment],
    (retired, passed): (&[Cycle], &[(Cycle, u32)]),
    fragments: &[&[(Cycle, u16, u16)]],
) -> Fetched {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = [wiring.unit("source", 0), wiring.unit("fetch", 0)];
            let core_ids = wiring.bank("core", cores);
            let announced_to = wiring.unit("batches", 0);
            let told_by = wiring.bank("told", 2);
            let packed_by = wiring.bank("packed", fragments.len());
            let mut plan = memory(&mut wiring);
            let (output, input) = wiring.channel("pieces", 0, FREE, ids[0], ids[1]);
            let (mut to_cores, mut core) = (Vec::new(), Vec::new());
            for (index, &id) in core_ids.iter().enumerate() {
                let (to, from) = wiring.channel("warps", index, link, ids[1], id);
                to_cores.push((0, to));
                core.push(Sink::new(from));
            }
            let (announce, announced) = wiring.channel("batches", 0, FREE, ids[1], announced_to);
            let (retire, from_assembly) = wiring.channel("retired", 0, FREE, told_by[0], ids[1]);
            let (tell, heeded) = wiring.channel("passed", 0, FREE, told_by[1], ids[1]);
            let follow = packed_by.iter().enumerate().map(|(n, &id)| wiring.channel("fragments", n, FREE, id, ids[1]));
            let (tell_cores, followed): (Vec<_>, Vec<_>) = follow.unzip();
            let ports = FetchPorts {
                input: FetchInput::Segments(input),
                cores: to_cores,
                batches: announce,
                retired: from_assembly,
                passed: (config.reuse_until == Reuse::Assembled).then_some(heeded),
                fragments: followed,
                index: port(&mut plan, &mut wiring, ids[1]),
                vertex: port(&mut plan, &mut wiring, ids[1]),
                probe: StallProbe::default(),
            };
            let mut card = card(1);
            let draw = Arc::new(Draw { attributes: attributes.to_vec(), ..draw() });
            let mut pieces = Vec::new();
            for (slot, segment) in segments.iter().enumerate() {
                card.install(slot as u16, Arc::new(segment.clone()), draw.clone(), 0);
                pieces.extend([Kind::DATA, Kind::SEGMENT].map(|kind| (0, Piece { slot: slot as u16, kind })));
            }
            let done = retired.iter().enumerate().map(|(n, &at)| (at, WarpToken { warp: n as u32 })).collect();
            let told = vec![TokenSource::new(done, retire), TokenSource::new(tokens(passed), tell)];
            let packing =
                |of: &&[(Cycle, u16, u16)]| of.iter().map(|&(at, core, state)| (at, Packing { core, state })).collect();
            let packed = fragments.iter().zip(tell_cores).map(|(of, output)| TokenSource::new(packing(of), output)).collect();
            let ideal = plan.build(&mut wiring).ideal;
            let circuit = FetchCircuit::new(
                wiring,
                One(TokenSource::new(pieces, output)),
                One(Fetch::new(config.clone(), width, ports)),
                core,
                One(Sink::new(announced)),
                told,
                packed,
                ideal,
            );
            (circuit, card)
        },
        |c, _| {
            let ends = |(_, batch): &&(Cycle, VertexBatch)| batch.kind == Kind::SEGMENT;
            let warps: usize = c.core.iter().map(|core| core.got.len()).sum();
            let batches = c.batches.got.iter().filter(|(_, batch)| batch.vertices > 0).count();
            c.batches.got.iter().filter(ends).count() == segments.len() && warps == batches
        },
        |c, card| {
            assert_eq!(c.fetch.items(), card.funnel.total().vertices_in);
            let batches = c.batches.got.iter().filter(|(_, batch)| batch.kind == Kind::DATA);
            Fetched {
                warps: c.core.iter().map(Sink::times).collect(),
                batches: batches.map(|&(at, batch)| (at, (batch.number, batch.stream_end, batch.vertices))).collect(),
                cache: c.fetch.cache(),
                shaded: card.funnel.total().vertices_shaded,
                requests: c.ideal.as_ref().unwrap().counts().iter().map(|count| count.requests).sum(),
            }
        },
    )
}

fn tokens(numbers: &[(Cycle, u32)]) -> Vec<(Cycle, WarpToken)> {
    numbers.iter().map(|&(at, warp)| (at, WarpToken { warp })).collect()
}

/// A segment that reads a stream of vertices, all of which have the same cost; `base` is the index of vertex 0.
fn reading(stream: Vec<u32>, base: u32) -> Segment {
    let count = stream.iter().filter(|&&vertex| vertex != u32::MAX).max().map_or(0, |&last| last + 1);
    let vertices = (0..count).map(|index| Vertex { index: base + index, instance: 0, cost: 0, first_request: 0 }).collect();
    let costs = CostTable::from(vec![Cost::from(vec![Step::dependent([1, 0, 0, 0, 0], RequestKind::End)])]);
    let mut segment = Segment { stream, vertices, ..Segment::default() };
    segment.invocations[Stage::Vertex] = costs.into();
    segment
}

/// A segment of `count` vertices, none of them twice.
fn fresh(count: u32) -> Segment {
    reading((0..count).collect(), 0)
}

#[test]
fn batches_fill_as_fast_as_indices_are_read() {
    // The first indices are read in cycle 1; batch k is full when 4 (k + 1) of them are, starts in the next cycle, and is a cycle on
    // the way. A segment ends with a batch of what is left, of nothing if need be.
    for (rate, times) in [(1, [6, 10]), (2, [4, 6]), (4, [3, 4]), (8, [3, 3])] {
        let config = FetchConfig { indices_per_cycle: rate, ..config() };
        let got = fetched(&config, 1, &[], &[fresh(8)], &[]);
        assert_eq!(got.warps, [times.to_vec()], "{rate} a cycle");
        assert_eq!(got.batches, [(times[0], (0, 4, 4)), (times[1], (1, 8, 4)), (times[1], (2, 8, 0))]);
    }
    let got = fetched(&config(), 1, &[], &[fresh(6)], &[]);
    assert_eq!((got.warps, got.batches), (vec![vec![4, 5]], vec![(4, (0, 4, 4)), (5, (1, 6, 2))]));
    // Cores take turns.
    assert_eq!(fetched(&config(), 2, &[], &[fresh(12)], &[]).warps, [vec![4, 8], vec![6]]);
}

#[test]
fn a_vertex_is_shaded_once_while_it_is_among_the_last_few() {
    // A strip as a list: 12 indices, 6 vertices. Read two per cycle: the fourth vertex comes in cycle 3, the sixth in cycle 6.
    let strip = vec![0, 1, 2, 1, 2, 3, 2, 3, 4, 3, 4, 5];
    let got = fetched(&config(), 1, &[], &[reading(strip.clone(), 0)], &[]);
    assert_eq!((got.shaded, got.warps), (6, vec![vec![5, 8]]));
    // Without reuse all twelve are shaded: one batch in two cycles.
    let none = FetchConfig { reuse: 0, ..config() };
    let got = fetched(&none, 1, &[], &[reading(strip, 0)], &[]);
    assert_eq!((got.shaded, got.warps), (12, vec![vec![4, 6, 8]]));
    // What an earlier segment of the draw has shaded counts too; a restart is read and is no vertex.
    let got = fetched(&config(), 1, &[], &[fresh(4), reading(vec![0, 1, u32::MAX, 2, 3], 2)], &[]);
    assert_eq!(got.shaded, 4 + 2);
}

/// The number of vertices shaded with a FIFO of `places` vertices, by the definition.
fn fifo(stream: &[u32], places: usize) -> u64 {
    let (mut held, mut shaded) = (VecDeque::new(), 0);
    for vertex in stream {
        if !held.contains(vertex) {
            shaded += 1;
            held.push_back(*vertex);
            if held.len() > places {
                held.pop_front();
            }
        }
    }
    shaded
}

#[test]
fn reuse_on_a_grid_is_that_of_a_fifo() {
    let (width, height) = (10, 10);
    let mut stream = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (a, b) = (y * (width + 1) + x, (y + 1) * (width + 1) + x);
            stream.extend([a, b, a + 1, a + 1, b, b + 1]);
        }
    }
    let shaded = |reuse| {
        let config = FetchConfig { reuse, indices_per_cycle: 32, batches: 1024, ..config() };
        fetched(&config, 1, &[], &[reading(stream.clone(), 0)], &[]).shaded
    };
    for places in 0..26 {
        assert_eq!(shaded(places), fifo(&stream, places as usize), "a FIFO of {places}");
    }
    // Two rows fit: every vertex once. Half of that: the two rows of vertices of each row of squares.
    assert_eq!(shaded(2 * (width + 1)), u64::from((width + 1) * (height + 1)));
    assert_eq!(shaded(width), u64::from(2 * (width + 1) * height));
}

#[test]
fn indices_come_from_memory_line_by_line() {
    // 32 indices of 4 bytes are two lines. Both are asked for in cycle 1 and here a miss later.
    let segment = Segment { index_address: Some(1 << 20), index_bytes: 4, ..fresh(32) };
    let first = 1 + MISS;
    let got = fetched(&config(), 1, &[], std::slice::from_ref(&segment), &[]);
    assert_eq!(got.warps, [(0..8).map(|k| first + 1 + 2 * k + 2).collect::<Vec<_>>()]);
    assert_eq!(got.requests, 2);
    // With a buffer of one line the second is asked for in the cycle after the last index of the first was read.
    let short = FetchConfig { index_lines: 1, ..config() };
    let second = first + 8 + MISS;
    let times = (0..4).map(|k| first + 1 + 2 * k + 2).chain((0..4).map(|k| second + 1 + 2 * k + 2));
    assert_eq!(fetched(&short, 1, &[], &[segment], &[]).warps, [times.collect::<Vec<_>>()]);
    // Only two indices of 2 bytes lie in the line where these begin.
    let segment = Segment { index_address: Some((1 << 20) + 60), index_bytes: 2, ..fresh(4) };
    assert_eq!(fetched(&short, 1, &[], &[segment], &[]).warps, [vec![first + 1 + MISS + 2]]);
}

const ATTRIBUTE: AttributeFetch = AttributeFetch { address: 1 << 22, stride: 32, step: StepMode::Vertex, bytes: 32 };

#[test]
fn attributes_come_from_memory_through_a_cache() {
    // Two vertices share a line. One line is looked up per cycle: those of batch 0 in cycles 1 and 2, of batch 1 in 3 and 4. A batch
    // starts when its last line is here.
    let fast = FetchConfig { indices_per_cycle: 4, ..config() };
    let got = fetched(&fast, 1, &[ATTRIBUTE], &[fresh(8)], &[]);
    assert_eq!((got.warps, got.requests, got.cache.misses), (vec![vec![2 + MISS + 1, 4 + MISS + 1]], 4, 4));
    // Each is announced to assembly as soon as it is full.
    assert_eq!(got.batches[..2], [(4, (0, 4, 4)), (6, (1, 8, 4))]);
    // Two lookups per cycle: all four lines are asked for in cycles 1 and 2, and the port brings one per cycle.
    let two = FetchConfig { lookups_per_cycle: 2, ..fast.clone() };
    assert_eq!(fetched(&two, 1, &[ATTRIBUTE], &[fresh(8)], &[]).warps, [[1 + MISS + 1 + 1, 1 + MISS + 3 + 1]]);
    // One miss at a time: each line is asked for when the one before is here.
    let one = FetchConfig { misses: 1, ..fast.clone() };
    assert_eq!(fetched(&one, 1, &[ATTRIBUTE], &[fresh(8)], &[]).warps, [[1 + 2 * MISS + 1, 1 + 4 * MISS + 1]]);
    // The same vertices again, without reuse: their lines are there or on their way, and nothing more is asked for.
    let again = FetchConfig { reuse: 0, ..fast.clone() };
    let got = fetched(&again, 1, &[ATTRIBUTE], &[fresh(8), fresh(8)], &[]);
    assert_eq!((got.warps, got.requests), (vec![vec![57, 59, 59, 59]], 4));
    // An attribute over two lines takes two lookups: four vertices, eight lines, the last in cycle 8.
    let wide = AttributeFetch { stride: 128, bytes: 100, ..ATTRIBUTE };
    assert_eq!(fetched(&fast, 1, &[wide], &[fresh(4)], &[]).warps, [[8 + MISS + 1]]);
    // That of an instance is the same line for all vertices.
    let instance = AttributeFetch { step: StepMode::Instance, ..ATTRIBUTE };
    let got = fetched(&fast, 1, &[instance], &[fresh(8)], &[]);
    assert_eq!((got.warps, got.requests), (vec![vec![1 + MISS + 1; 2]], 1));
}

#[test]
fn a_line_that_was_evicted_is_fetched_again() {
    // A line per vertex; vertices 0, 1, 2 and 0 again.
    let attribute = AttributeFetch { stride: 64, ..ATTRIBUTE };
    let misses = |lines| {
        let config = FetchConfig { reuse: 0, cache_lines: lines, cache_ways: lines, ..config() };
        let got = fetched(&config, 1, &[attribute], &[reading(vec![0, 1, 2, 0], 0)], &[]);
        (got.cache.misses, got.cache.evictions, got.requests)
    };
    assert_eq!(misses(4), (3, 0, 3));
    assert_eq!(misses(2), (4, 2, 4));
}

#[test]
fn batches_in_flight_are_bounded() {
    // One at a time: the second is read when the first, which assembly gives back in cycle 100, is seen a cycle later.
    let one = FetchConfig { batches: 1, ..config() };
    assert_eq!(fetched(&one, 1, &[], &[fresh(8)], &[100, 200]).warps, [[4, 101 + 1 + 2]]);
}

#[test]
fn a_vertex_is_shaded_once_while_an_index_of_it_is_on_its_way_to_assembly() {
    let until = FetchConfig { reuse_until: Reuse::Assembled, ..config() };
    let shaded =
        |passed: &[(Cycle, u32)]| fetched_as_passed(&until, 1, &[], &[reading(vec![0, 1, 2, 3, 0, 1, 4, 5], 0)], &[], passed);
    // Read two per cycle. Without a word from assembly all are on their way: six vertices, of which the fourth comes in cycle 2 and the sixth
    // in cycle 4.
    let got = shaded(&[]);
    assert_eq!((got.shaded, got.warps), (6, vec![vec![4, 6]]));
    assert_eq!(got.batches, [(4, (0, 4, 4)), (6, (1, 8, 2))]);
    // What is sent in cycle 2 comes in 3, in time for the second index of vertices 0 and 1, which have to be shaded again; in 4 it is late.
    assert_eq!(shaded(&[(2, 2)]).shaded, 8);
    assert_eq!(shaded(&[(3, 2)]).shaded, 6);
    // Vertex 0 has an index on its way after the first has gone.
    let again =
        |passed: &[(Cycle, u32)]| fetched_as_passed(&until, 1, &[], &[reading(vec![0, 1, 0, 2, 0, 1], 0)], &[], passed).shaded;
    assert_eq!((again(&[(2, 2)]), again(&[(2, 3)])), (4, 5));
    // The next segment of the draw knows what is on its way.
    let got = fetched_as_passed(&until, 1, &[], &[fresh(4), reading(vec![0, 1, 2, 3], 2)], &[], &[]);
    assert_eq!(got.shaded, 6);
    let got = fetched_as_passed(&until, 1, &[], &[fresh(4), reading(vec![0, 1, 2, 3], 2)], &[], &[(2, 3)]);
    assert_eq!(got.shaded, 7);
}

#[test]
fn indices_on_their_way_are_bounded() {
    // Four at a time: the fifth is read when the first four have been taken, which is known in cycle 100.
    let four = FetchConfig { reuse_until: Reuse::Assembled, reuse: 4, ..config() };
    let got = fetched_as_passed(&four, 1, &[], &[fresh(8)], &[98], &[(99, 4)]);
    assert_eq!(got.warps, [[4, 100 + 1 + 2]]);
    // Place for one makes a batch that is not full, which is started since assembly has nothing else to do.
    let got = fetched_as_passed(&four, 1, &[], &[fresh(6)], &[98], &[(99, 1), (120, 5)]);
    assert_eq!((got.shaded, got.warps), (6, vec![vec![4, 102, 123]]));
    // Attributes are looked up behind: with places for two vertices before it, the third index is read when the first vertex's line is
    // asked for, one per cycle.
    let two = FetchConfig { reuse_until: Reuse::Assembled, ahead: 2, indices_per_cycle: 4, ..config() };
    let attribute = AttributeFetch { stride: 64, ..ATTRIBUTE };
    let got = fetched_as_passed(&two, 1, &[attribute], &[fresh(4)], &[], &[]);
    assert_eq!((got.warps, got.requests), (vec![vec![4 + MISS + 1]], 4));
}

#[test]
fn batches_of_vertices_follow_warps_of_fragments() {
    // Batches start in cycles 3, 5, 7 and so on, and come a cycle later.
    let follow = FetchConfig { deal: VertexDeal::AfterFragments, ..config() };
    let dealt = |config: &FetchConfig, fragments: &[&[(Cycle, u16, u16)]]| {
        fetched_beside(config, (4, FREE), &[], &[fresh(20)], (&[], &[]), fragments).warps
    };
    let cores = |fragments: &[&[(Cycle, u16, u16)]]| dealt(&follow, fragments);
    let started = Packing::STARTED;
    // Without fragments they take turns.
    assert_eq!(cores(&[&[]]), [vec![4, 12], vec![6], vec![8], vec![10]]);
    // A warp went to core 3 in cycle 4, which is known in 5: the batch of that cycle follows it, the next ones take turns from there.
    assert_eq!(cores(&[&[(4, 3, started)]]), [vec![4, 8], vec![10], vec![12], vec![6]]);
    // A cycle later it is the next batch.
    assert_eq!(cores(&[&[(5, 3, started)]]), [vec![4, 10], vec![6, 12], vec![], vec![8]]);
    // Of two in one cycle the one of the later pipeline counts.
    assert_eq!(cores(&[&[(4, 1, started)], &[(4, 2, started)]]), [vec![4, 10], vec![12], vec![6], vec![8]]);
    // With turns of two warps, a core's second warp of fragments takes the turn to the next core.
    let two = FetchConfig { deal_warps: 2, ..follow.clone() };
    assert_eq!(dealt(&two, &[&[(3, 2, started), (4, 2, started)]]), [vec![4, 8], vec![10], vec![12], vec![6]]);
    // A batch that waits for its core stays with it, whatever warps begin meanwhile: core 1 takes one in 20 cycles.
    let slow = Link::items(1, 1, 20);
    let warps = [(2, 1, started), (4, 1, started), (8, 0, started)];
    let got = fetched_beside(&follow, (2, slow), &[], &[fresh(24)], (&[], &[]), &[&warps]).warps;
    assert_eq!((&got[0][..1], &got[1][..2]), (&[24 + 20][..], &[3 + 20, 24 + 20][..]));
}

#[test]
fn so_many_vertices_go_to_the_cores_in_a_cycle() {
    // Batches of four come every second cycle where nothing else holds them up.
    let times = |vertices_per_cycle| {
        let config = FetchConfig { vertices_per_cycle, ..config() };
        fetched_beside(&config, (1, FREE), &[], &[fresh(16)], (&[], &[]), &[]).warps[0].clone()
    };
    assert_eq!(times(0), [4, 6, 8, 10]);
    assert_eq!(times(2), [4, 6, 8, 10]);
    assert_eq!(times(1), [4, 8, 12, 16]);
}

#[test]
fn batches_of_vertices_follow_quads_that_wait() {
    let follow = FetchConfig { deal: VertexDeal::AfterFragments, ..config() };
    let cores = |rate: u32, fragments: &[&[(Cycle, u16, u16)]]| {
        let config = FetchConfig { indices_per_cycle: rate, ..follow.clone() };
        fetched_beside(&config, (4, FREE), &[], &[fresh(20)], (&[], &[]), fragments).warps
    };
    let waiting = Packing::WAITING;
    // As long as quads of the first pipeline wait for its core 2, all batches go there; afterwards they take turns from it.
    assert_eq!(cores(2, &[&[(3, 2, waiting)], &[]]), [vec![4], vec![], vec![6, 8, 10, 12], vec![]]);
    assert_eq!(cores(2, &[&[(3, 2, waiting), (8, 2, 0)], &[]]), [vec![4, 12], vec![], vec![6, 8], vec![10]]);
    // Those of another pipeline do not count.
    assert_eq!(cores(2, &[&[], &[(3, 2, waiting)]]), [vec![4, 12], vec![6], vec![8], vec![10]]);
    // Batches in cycles that follow each other, from cycle 2 on, take turns all the same.
    assert_eq!(cores(4, &[&[(1, 2, waiting)], &[]]), [vec![5], vec![6], vec![3, 7], vec![4]]);
    // The search begins at a pipeline that its core holds up, until a draw begins.
    let held_up = waiting | Packing::BLOCKED;
    let after = |later: &[(Cycle, u16, u16)]| cores(2, &[later, &[(3, 2, held_up), (4, 2, waiting)]]);
    assert_eq!(after(&[]), [vec![4], vec![], vec![6, 8, 10, 12], vec![]]);
    assert_eq!(after(&[(6, 0, Packing::STARTED | Packing::FIRST)]), [vec![4, 8], vec![10], vec![6, 12], vec![]]);
}

#[test]
fn draws_do_not_wait_for_the_memory_of_those_before() {
    // Three segments with a line of indices and a line of attributes each. All lines of indices are asked for in cycle 1 and come one per
    // cycle; four vertices are read in two cycles, and their lines of attributes asked for as the first of them is read.
    let attribute = AttributeFetch { stride: 16, bytes: 16, ..ATTRIBUTE };
    let segments: Vec<_> = (0..3)
        .map(|n| Segment {
            index_address: Some((1 << 20) + n * LINE),
            index_bytes: 4,
            ..reading((0..4).collect(), 4 * n as u32)
        })
        .collect();
    let got = fetched(&config(), 1, &[attribute], &segments, &[]);
    let first = 1 + MISS;
    assert_eq!(got.warps, [(0..3).map(|n| first + 2 * n + MISS + 1).collect::<Vec<_>>()]);
    // Batches are announced as they are read, numbered without gaps. What ends a segment has no vertices and needs no number.
    let announced: Vec<_> = got.batches.iter().map(|&(_, batch)| batch).collect();
    assert_eq!(announced, [(0, 4, 4), (1, 4, 0), (1, 4, 4), (2, 4, 0), (2, 4, 4), (3, 4, 0)]);
    // One at a time, the indices of each are asked for when those of the one before are read, in two cycles, and its mark is taken; its
    // attributes need not be here.
    let one = FetchConfig { runs: 1, ..config() };
    let got = fetched(&one, 1, &[attribute], &segments, &[]);
    assert_eq!(got.requests, 6);
    let apart: Vec<_> = got.warps[0].windows(2).map(|pair| pair[1] - pair[0]).collect();
    assert_eq!(apart, [MISS + 3; 2]);
}

#[test]
fn a_line_of_indices_is_read_once_for_draws_that_share_it() {
    // Five draws of three indices, 4 bytes each: 60 bytes of one line. The fourth slot's draw begins in the next line.
    let draw =
        |n: u64| Segment { index_address: Some((1 << 20) + 12 * n), index_bytes: 4, ..reading(vec![0, 1, 2], 3 * n as u32) };
    let got = fetched(&config(), 1, &[], &[draw(0), draw(1), draw(2), draw(3)], &[]);
    assert_eq!((got.requests, got.shaded), (1, 12));
    // The last of them has two indices in the first line and one in the second.
    let got = fetched(&config(), 1, &[], &[draw(3), draw(4), draw(5), draw(6)], &[]);
    assert_eq!((got.requests, got.shaded), (2, 12));
    // A buffer of one line goes on to the next line all the same.
    let short = FetchConfig { index_lines: 1, ..config() };
    let got = fetched(&short, 1, &[], &[draw(3), draw(4), draw(5), draw(6)], &[]);
    assert_eq!((got.requests, got.shaded), (2, 12));
}

/// A segment whose primitives are triangles of a list.
fn triangles(indices: &[u32]) -> Segment {
    let ends = indices.chunks_exact(3).zip((1..).map(|n| 3 * n));
    let primitives = ends.map(|(of, end)| Primitive {
        vertices: of.try_into().expect("three"),
        ..primitive(end, 0, 1, false, PrimitiveOutcome::Drawn)
    });
    Segment { primitives: primitives.collect(), ..reading(indices.to_vec(), 0) }
}

/// A strip of `count` triangles.
fn strip(count: u32) -> Segment {
    let primitives =
        (0..count).map(|n| Primitive { vertices: [n, n + 1, n + 2], ..primitive(n + 3, 0, 1, false, PrimitiveOutcome::Drawn) });
    Segment { primitives: primitives.collect(), ..fresh(count + 2) }
}

/// Invocations by the definition: a batch holds `width` vertices of whole triangles with at most `indices` indices, and remembers the last
/// `places` of its vertices.
fn in_batches(triangles: &[[u32; 3]], width: usize, indices: usize, places: usize) -> u64 {
    let (mut batch, mut read, mut shaded) = (Vec::new(), 0, 0);
    for triangle in triangles {
        let missing = |batch: &Vec<u32>| {
            let known = &batch[batch.len().saturating_sub(places)..];
            let mut new: Vec<u32> = triangle.iter().copied().filter(|vertex| !known.contains(vertex)).collect();
            new.sort_unstable();
            new.dedup();
            new.len()
        };
        if batch.len() + missing(&batch) > width || read + 3 > indices {
            batch.clear();
            read = 0;
        }
        for vertex in triangle {
            if !batch[batch.len().saturating_sub(places)..].contains(vertex) {
                batch.push(*vertex);
                shaded += 1;
            }
        }
        read += 3;
    }
    shaded
}

/// The number of vertices shaded by batches of at most `width` vertices and `batch_indices` indices, if the last `reuse` vertices are
/// remembered.
fn shaded_in_batches(segment: &Segment, (width, batch_indices, reuse): (u32, u32, u32), rate: u32) -> u64 {
    let config =
        FetchConfig { reuse_until: Reuse::Batch, reuse, batch_indices, indices_per_cycle: rate, batches: 1024, ..config() };
    let segments = std::slice::from_ref(segment);
    fetched_by(width, &config, (1, FREE), &[], segments, (&[], &[]), &[]).shaded
}

#[test]
fn nothing_is_reused_across_batches() {
    const NVIDIA: (u32, u32, u32) = (32, 96, 32);
    const AMD: (u32, u32, u32) = (64, 384, 14);
    // One triangle again and again: three invocations for each batch of 96 indices (Kerbl et al. 2018), or of 384.
    for (card, indices) in [(NVIDIA, 96), (AMD, 384)] {
        for count in [3, 48, 93, 96, 99, 192, 195, 384, 387] {
            let same: Vec<u32> = (0..count).map(|n| n % 3).collect();
            let batches = u64::from(count.div_ceil(indices));
            for rate in [1, 4, 32] {
                assert_eq!(shaded_in_batches(&triangles(&same), card, rate), 3 * batches, "{count} indices, {rate} a cycle");
            }
        }
    }
    // Triangles that share nothing: ten fill 30 of 32 places, and the eleventh begins a batch.
    let apart: Vec<u32> = (0..330).collect();
    assert_eq!(shaded_in_batches(&triangles(&apart), NVIDIA, 4), 330);
    // A strip: a batch of 32 vertices holds 30 triangles, and the next one begins with a whole triangle.
    assert_eq!(shaded_in_batches(&strip(30), NVIDIA, 4), 32);
    assert_eq!(shaded_in_batches(&strip(31), NVIDIA, 4), 32 + 3);
    assert_eq!(shaded_in_batches(&strip(90), NVIDIA, 4), 3 * 32);
}

#[test]
fn reuse_in_batches_on_a_grid_is_that_of_the_definition() {
    let (width, height) = (20, 9);
    let mut list = Vec::new();
    for y in 0..height {
        for x in 0..width {
            let (a, b) = (y * (width + 1) + x, (y + 1) * (width + 1) + x);
            list.extend([[a, b, a + 1], [a + 1, b, b + 1]]);
        }
    }
    let segment = triangles(list.as_flattened());
    for (vertices, indices, places) in [(32, 96, 32), (64, 384, 14), (32, 4096, 32), (16, 30, 7), (8, 12, 8), (4, 3, 0)] {
        assert_eq!(
            shaded_in_batches(&segment, (vertices, indices, places), 5),
            in_batches(&list, vertices as usize, indices as usize, places as usize),
            "{vertices} vertices, {indices} indices, {places} places"
        );
    }
}
