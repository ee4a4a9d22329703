//! Texture units: hits and misses, the rate of filters by mode, the FIFO that covers the latency of misses.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, memory, port, round_trip, settle};
use super::scenery::{card, draw, step, warp};
use crate::Card;
use crate::tags::CacheCounts;
use crate::texture::{Texture, TextureConfig, TextureCounts, TextureUser};
use crate::token::WarpToken;
use gfx::format::TexelClass;
use gfx::stage::Stage;
use mem::Ideal;
use num::Cycle;
use sim::{Circuit, One, Unit, Wiring};
use work::*;

sim::circuit! {
    struct TextureCircuit for Card {
        source: One<TokenSource<WarpToken>>,
        texture: One<Texture>,
        sink: One<Sink<WarpToken>>,
        ideal: Option<Ideal>,
    }
}

fn config() -> TextureConfig {
    TextureConfig {
        filter_single: 1,
        filter_halves: 2,
        filter_pair: 3,
        filter_full: 4,
        load_full: 2,
        quads_per_cycle: 16,
        lookups_per_cycle: 32,
        access_bytes: 128,
        accesses_per_cycle: 1,
        filters_per_cycle: 8,
        skip_levels: true,
        cache_lines: 1024,
        cache_ways: 1024,
        line_bytes: 64,
        sector_bytes: 64,
        misses: 256,
        fifo: 256,
        latency: 20,
        queue: 16,
        ..TextureConfig::default()
    }
}

/// Cycles from the request for a line to its answer.
const MISS: Cycle = round_trip(LINE as u32);

/// The results of the unit.
#[derive(Debug, PartialEq)]
struct Textured {
    /// When warps were answered.
    times: Vec<Cycle>,
    cache: CacheCounts,
    counts: TextureCounts,
    read: u64,
    written: u64,
    requests: u64,
}

/// A warp: its quads, each a list of lines, and the operations of each.
type Quads = (Vec<Vec<u32>>, u8);

/// Answers warps that are all there from the beginning.
fn textured(config: &TextureConfig, kind: RequestKind, warps: &[Quads]) -> Textured {
    let from: Vec<_> = warps.iter().map(|warp| (0, warp.clone())).collect();
    textured_from(config, kind, &from)
}

/// The same for warps that come at their cycles.
fn textured_from(config: &TextureConfig, kind: RequestKind, warps: &[(Cycle, Quads)]) -> Textured {
    textured_as(config, kind, (TexelClass::Bytes, false), 3, warps)
}

/// The same with texels of some width, loaded or filtered; loads from buffers read these halves of their lines.
fn textured_as(
    config: &TextureConfig,
    kind: RequestKind,
    (texel, loads): (TexelClass, bool),
    halves: u32,
    warps: &[(Cycle, Quads)],
) -> Textured {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["source", "texture", "sink"].map(|name| wiring.unit(name, 0));
            let mut plan = memory(&mut wiring);
            let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (out, got) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
            let costs =
                CostTable::from(vec![Cost::from(vec![step([0; Class::COUNT], kind), step([1, 0, 0, 0, 0], RequestKind::End)])]);
            let mut tile = TileWork { invocations: costs.clone().into(), ..TileWork::default() };
            let mut card = card(1);
            let mut items = Vec::new();
            for (at, (quads, operations)) in warps {
                let index = warp(&mut card, Stage::Fragment, quads.len() as u32, 16, &costs);
                card.warps[0][index].place = index;
                for (item, lines) in card.warps[0][index].items.iter_mut().zip(quads) {
                    item.next[Service::Texture] = tile.invocations.requests.len() as u32;
                    let first_line = tile.invocations.lines.len() as u32;
                    tile.invocations.requests.push(Request {
                        first_line,
                        lines: lines.len() as u8,
                        operations: *operations,
                        texel,
                        loads,
                    });
                    tile.invocations.lines.extend(lines);
                    tile.invocations.lines.resize(tile.invocations.lines.len() + lines.len().div_ceil(8), !(halves * 0x5555));
                }
                items.push((*at, WarpToken { warp: index }));
            }
            card.install(0, Arc::new(Segment { tiles: vec![tile], ..Segment::default() }), Arc::new(draw()), 0);
            let memory = port(&mut plan, &mut wiring, ids[1]);
            let ideal = plan.build(&mut wiring).ideal;
            let unit = One(Texture::new(config.clone(), TextureUser::default(), input, out, memory));
            (TextureCircuit::new(wiring, One(TokenSource::new(items, output)), unit, One(Sink::new(got)), ideal), card)
        },
        |c, _| c.sink.got.len() == warps.len() && c.texture.resident() == 0 && c.wires().resident() == 0,
        |c, _| {
            let memory = c.ideal.as_ref().unwrap().counts()[0];
            let order: Vec<_> = c.sink.got.iter().map(|(_, token)| token.warp).collect();
            assert_eq!(order, (0..warps.len() as u32).collect::<Vec<_>>(), "answers come in order");
            Textured {
                times: c.sink.times(),
                cache: c.texture.cache(),
                counts: c.texture.counts(),
                read: memory.read_bytes,
                written: memory.write_bytes,
                requests: memory.requests,
            }
        },
    )
}

#[test]
fn a_hit_takes_the_latency_and_a_miss_the_memory() {
    // Addressed in cycle 1; the line is asked for in that cycle and is here a miss later; then filtered, and a cycle on the way.
    let one = |lines: &[u32]| (vec![lines.to_vec()], 4);
    let got = textured(&config(), RequestKind::Texture, &[one(&[5])]);
    assert_eq!((got.times, got.cache.misses, got.read), (vec![1 + MISS + 1], 1, LINE));
    // A second warp, long after: a hit. One that comes while the line is on its way counts as a hit too, and waits for it.
    let late = [(0, one(&[5])), (10, one(&[5])), (200, one(&[5])), (200, one(&[5, 6]))];
    let got = textured_from(&config(), RequestKind::Texture, &late);
    assert_eq!(got.times, [56, 56, 201 + 20 + 1, 201 + MISS + 1]);
    assert_eq!((got.cache.hits, got.cache.misses, got.counts.quads), (3, 2, 4));
    // A miss shorter than the latency is covered by it.
    let slow = TextureConfig { latency: 100, ..config() };
    assert_eq!(textured(&slow, RequestKind::Texture, &[one(&[5])]).times, [1 + 100 + 1]);
}

#[test]
fn lines_are_looked_up_at_their_rate() {
    // Eight quads of four lines each, two of them lines of the quad before. One lookup per cycle: the last of 32 in cycle 32, by which
    // time its line, which is new, is asked for.
    let quads: Vec<Vec<u32>> = (0..8).map(|quad| (0..4).map(|line| 2 * quad + line).collect()).collect();
    let warp = [(quads, 4)];
    for (lookups, last) in [(1, 32), (4, 8), (8, 4), (32, 1)] {
        let config = TextureConfig { lookups_per_cycle: lookups, ..config() };
        let got = textured(&config, RequestKind::Texture, &warp);
        // Eighteen lines are asked for; eight requests per cycle are what the port takes, and a line per cycle what it brings back.
        let sent = last.max(18_u64.div_ceil(8));
        let brought = (1 + 2 + 50 + 17 + 2).max(sent + MISS);
        assert_eq!((got.times, got.cache.accesses, got.cache.misses), (vec![brought + 1], 32, 18), "{lookups} lookups");
    }
    // Two quads per cycle: the last in cycle 4, with lines that are there.
    let two = TextureConfig { quads_per_cycle: 2, filters_per_cycle: 64, ..config() };
    let same = (vec![vec![3]; 8], 4);
    let got = textured_from(&two, RequestKind::Texture, &[(0, same.clone()), (200, same)]);
    assert_eq!(got.times[1], 204 + 20 + 1);
}

#[test]
fn filters_work_at_their_rate_by_mode() {
    // Warps of eight quads with all lines there: 4 operations per quad are bilinear, 8 trilinear, 64 sixteen-fold anisotropic. At 8 a
    // cycle entry k is begun (k operations) / 8 cycles after the first.
    let warp = |operations| (vec![vec![3]; 8], operations);
    for operations in [4_u8, 8, 64, 12] {
        let got =
            textured_from(&config(), RequestKind::Texture, &[(0, warp(4)), (200, warp(operations)), (200, warp(operations))]);
        let begun = |entry: u64| 201 + 20 + entry * u64::from(operations) / 8;
        assert_eq!(got.times[1..], [begun(7) + 1, begun(15) + 1], "{operations} operations");
        assert_eq!(got.counts.operations, 8 * (4 + 2 * u64::from(operations)));
    }
}

#[test]
fn the_fifo_covers_the_latency_as_far_as_it_goes() {
    // A quad per cycle, each with a line of its own. With places for all that are asked for during a miss, nothing is lost; with fewer
    // places D, a quad can be addressed when the one D before it leaves: D quads in the time of a miss.
    let warps: Vec<_> = (0..160).map(|line| (vec![vec![line]], 1)).collect();
    for places in [1, 8, 40, 54, 55, 128] {
        for (fifo, misses) in [(places, 256), (256, places)] {
            let config = TextureConfig { quads_per_cycle: 1, fifo, misses, ..config() };
            let got = textured(&config, RequestKind::Texture, &warps);
            let (last, places) = (159, u64::from(places));
            let addressed = if places >= MISS { 1 + last } else { 1 + last % places + last / places * MISS };
            assert_eq!(*got.times.last().unwrap(), addressed + MISS + 1, "{fifo} places, {misses} misses");
        }
    }
}

#[test]
fn stores_and_atomics_take_the_same_way() {
    // A store is answered after the latency: nothing comes back. Its bytes are those of the words that it moves.
    let warp = [(vec![vec![2, 3]], 16)];
    let got = textured(&config(), RequestKind::Store, &warp);
    assert_eq!((got.times, got.written, got.read, got.counts.accesses), (vec![1 + 20 + 1], 64, 0, 1));
    // An atomic is done in memory, each time anew.
    let got = textured(&config(), RequestKind::Atomic, &[warp[0].clone(), warp[0].clone()]);
    assert_eq!((got.requests, got.written, got.cache.accesses), (4, 16, 0));
    assert_eq!(got.times, [1 + MISS + 1, 2 + MISS + 1]);
    // A load goes through the cache and takes no filter.
    let got = textured(&config(), RequestKind::Load, &[(vec![vec![7]; 8], 4)]);
    assert_eq!((got.times, got.counts.operations, got.counts.accesses), (vec![1 + MISS + 1], 0, 8));
}

#[test]
fn accesses_of_a_warp_are_looked_up_once_a_piece() {
    // Eight parts that have the lines of a stride each: all in one piece of 128 bytes; a piece for each two parts; one for each part.
    let warp = |stride: u32| ((0..8).map(|part| vec![part * stride / 4]).collect::<Vec<_>>(), 4);
    for (stride, pieces, lines) in [(1, 1, 2), (4, 4, 8), (8, 8, 8), (64, 8, 8)] {
        let asked = [(0, warp(stride)), (200, warp(stride))];
        let got = textured_from(&config(), RequestKind::Load, &asked);
        // With all lines there, the last is looked up a cycle for each piece after the first.
        assert_eq!(got.times[1], 201 + (pieces - 1) + 20 + 1, "stride {stride}");
        assert_eq!((got.cache.misses, got.cache.hits, got.counts.pieces), (lines, lines, 2 * pieces), "stride {stride}");
        assert_eq!((got.read, got.counts.accesses), (64 * lines, 16), "stride {stride}");
    }
    // Two pieces per cycle, and smaller ones.
    let last =
        |config: &TextureConfig| textured_from(config, RequestKind::Load, &[(0, warp(8)), (200, warp(8))]).times[1] - 222;
    assert_eq!(last(&TextureConfig { accesses_per_cycle: 2, ..config() }), 3);
    assert_eq!(last(&TextureConfig { access_bytes: 256, ..config() }), 3);
    // In any order, and the same place for all.
    let mixed = (vec![vec![3, 0], vec![1], vec![2, 3], vec![0]], 4);
    let got = textured(&config(), RequestKind::Load, &[mixed.clone(), (vec![vec![9]; 8], 4)]);
    assert_eq!((got.cache.misses, got.cache.hits, got.counts.pieces), (5, 0, 3));
    // A store of a warp sends each line once, with the bytes of all parts.
    let quarter = (vec![vec![7]; 4], 4);
    let got = textured(&config(), RequestKind::Store, &[quarter]);
    assert_eq!((got.requests, got.written), (1, 64));
    // Atomics are done one by one.
    let got = textured(&config(), RequestKind::Atomic, &[(vec![vec![7]; 8], 4)]);
    assert_eq!((got.requests, got.counts.pieces), (8, 1));
    // Fewer entries of the queue than parts.
    let narrow = TextureConfig { fifo: 1, ..config() };
    assert_eq!(textured(&narrow, RequestKind::Load, &[(vec![vec![7]; 8], 4)]).times, [1 + MISS + 1]);
}

#[test]
fn the_least_recently_used_line_of_a_set_goes() {
    // Lines 0, 1, 2, 0 in turn: a cache of two lines has lost line 0.
    let warps: Vec<_> = [0, 1, 2, 0].map(|line| (vec![vec![line]], 1)).to_vec();
    let misses = |lines| {
        let config = TextureConfig { cache_lines: lines, cache_ways: lines, ..config() };
        textured(&config, RequestKind::Texture, &warps).cache.misses
    };
    assert_eq!((misses(2), misses(4)), (4, 3));
}

#[test]
fn a_longer_line_is_read_whole_and_serves_its_neighbours() {
    // Pieces 4 to 7 of 64 bytes are one line of 256, piece 8 is of the next.
    let warps: Vec<_> = [5, 4, 7, 8].map(|piece| (vec![vec![piece]], 1)).to_vec();
    for (bytes, misses) in [(64, 4), (128, 3), (256, 2)] {
        let got = textured(&TextureConfig { line_bytes: bytes, sector_bytes: bytes, ..config() }, RequestKind::Texture, &warps);
        assert_eq!((got.cache.accesses, got.cache.misses, got.read), (4, misses, misses * u64::from(bytes)), "{bytes} bytes");
        // Asked for in cycle 1; the first answer is that of a request of this size.
        assert_eq!(got.times[0], 1 + round_trip(bytes) + 1, "{bytes} bytes");
    }
}

#[test]
fn a_miss_reads_the_sectors_that_are_asked_for() {
    // Four pieces of 64 bytes make two lines of 128 in sectors of 32. A warp of one part each: the lower halves of the pieces, then the upper ones.
    let sectored = TextureConfig { line_bytes: 128, sector_bytes: 32, ..config() };
    let loads = |config: &TextureConfig, halves, warps: &[(Cycle, Quads)]| {
        textured_as(config, RequestKind::Load, (TexelClass::Bytes, false), halves, warps)
    };
    let part = |piece: u32| (vec![vec![piece]], 4);
    let got = loads(&sectored, 1, &[(0, part(5)), (200, part(5)), (400, part(4)), (600, part(5))]);
    // The first is missed, then there; its neighbour in the line is another sector, which is read alone.
    assert_eq!((got.read, got.requests, got.cache.misses, got.cache.hits), (64, 2, 2, 2));
    assert_eq!(got.times, [1 + MISS + 1, 201 + 20 + 1, 401 + MISS + 1, 601 + 20 + 1]);
    // A warp asks once for what all of its parts read of a line: four sectors, and two runs of one where they are apart.
    let whole = (vec![vec![4], vec![5]], 4);
    let got = loads(&sectored, 3, &[(0, whole.clone())]);
    assert_eq!((got.read, got.requests, got.cache.misses, got.cache.hits), (128, 1, 1, 1));
    let got = loads(&sectored, 2, &[(0, whole.clone()), (200, whole)]);
    assert_eq!((got.read, got.requests, got.cache.misses, got.cache.hits), (64, 2, 1, 3));
    // Samples ask for pieces of 64 bytes. One tag has two: of 2 KB, 1 KB of every other piece is all that stays.
    let samples: Vec<_> = (0..32).chain(0..32).map(|n| (200 * Cycle::from(n), part(2 * (n % 32)))).collect();
    let small = TextureConfig { cache_lines: 16, cache_ways: 16, ..sectored.clone() };
    let times = |config: &TextureConfig| {
        textured(config, RequestKind::Texture, &samples.iter().map(|(_, q)| q.clone()).collect::<Vec<_>>())
    };
    assert_eq!([times(&small).read, times(&sectored).read], [64 * 64, 32 * 64]);
    // Sectors as long as lines read whole lines.
    let whole_lines = TextureConfig { sector_bytes: 128, ..sectored };
    let got = loads(&whole_lines, 1, &[(0, part(5)), (200, part(4))]);
    assert_eq!((got.read, got.cache.misses, got.cache.hits), (128, 1, 1));
}

#[test]
fn wide_texels_take_as_long_as_the_card_says() {
    use TexelClass::{Bytes, Full, Halves, Packed, Pair, Single};
    let config = TextureConfig { filter_single: 1, filter_halves: 2, filter_pair: 3, filter_full: 4, load_full: 2, ..config() };
    for (texel, loads, times) in [
        (Bytes, false, 1),
        (Packed, false, 1),
        (Single, false, 1),
        (Halves, false, 2),
        (Pair, false, 3),
        (Full, false, 4),
        (Halves, true, 1),
        (Full, true, 2),
    ] {
        // Eight quads of four operations, the second time from the cache: addressed in 201, and 20 later the first is filtered. Eight
        // operations per cycle: the last begins when 28 of their times are done. A cycle on the way.
        let warp = (vec![vec![3]; 8], 4);
        let got = textured_as(&config, RequestKind::Texture, (texel, loads), 3, &[(0, warp.clone()), (200, warp)]);
        assert_eq!(got.times[1], 201 + 20 + 28 * times / 8 + 1, "{texel:?}, loaded: {loads}");
    }
}
