//! Constant caches: hits in both levels, misses, and addresses that differ in a warp.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, memory, port, round_trip, settle};
use super::scenery::{card, draw, step, warp};
use crate::card::Card;
use crate::constant::{Constant, ConstantConfig, ConstantCounts};
use crate::tags::CacheCounts;
use crate::token::WarpToken;
use gfx::stage::Stage;
use mem::Ideal;
use num::Cycle;
use sim::{Circuit, One, Unit, Wiring};
use work::*;

sim::circuit! {
    struct ConstantCircuit for Card {
        source: One<TokenSource<WarpToken>>,
        constant: One<Constant>,
        sink: One<Sink<WarpToken>>,
        ideal: Option<Ideal>,
    }
}

/// 1 KB in lines of 64 bytes, before 4 KB in lines of 256.
fn config() -> ConstantConfig {
    ConstantConfig {
        enabled: true,
        bytes: 1024,
        ways: 4,
        line_bytes: 64,
        second_bytes: 4096,
        second_ways: 4,
        second_line_bytes: 256,
        latency: 10,
        second_latency: 40,
        misses: 8,
        fifo: 16,
        queue: 16,
    }
}

/// The results of the cache: when warps were answered, and its counts.
#[derive(Debug, PartialEq)]
struct Read {
    times: Vec<Cycle>,
    counts: ConstantCounts,
    first: CacheCounts,
    second: Option<CacheCounts>,
    bytes: u64,
}

/// Answers warps that come at their cycles. Each has its parts, and each part the addresses that its invocations read.
fn read(config: &ConstantConfig, warps: &[(Cycle, Vec<Vec<u64>>)]) -> Read {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["source", "constant", "sink"].map(|name| wiring.unit(name, 0));
            let mut plan = memory(&mut wiring);
            let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (out, got) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
            let steps = [RequestKind::Constant, RequestKind::End].map(|then| step([0; Class::COUNT], then));
            let costs = CostTable::from(vec![Cost::from(steps.to_vec())]);
            let mut tile = TileWork { invocations: costs.clone().into(), ..TileWork::default() };
            let mut card = card(1);
            let mut items = Vec::new();
            for (at, parts) in warps {
                let index = warp(&mut card, Stage::Fragment, parts.len() as u32, 16, &costs);
                let warp = &mut card.warps[0][index];
                warp.place = index;
                warp.asked[Service::Constant].push_back(0);
                for (item, addresses) in warp.items.iter_mut().zip(parts) {
                    item.next[Service::Constant] = tile.invocations.requests.len() as u32;
                    let mut lines: Vec<(u32, u32)> = Vec::new();
                    for address in addresses {
                        let (line, word) = ((address / LINE) as u32, 1 << (address % LINE / 4));
                        match lines.iter_mut().find(|(known, _)| *known == line) {
                            Some((_, words)) => *words |= word,
                            None => lines.push((line, word)),
                        }
                    }
                    let first_line = tile.invocations.lines.len() as u32;
                    tile.invocations.requests.push(Request {
                        first_line,
                        lines: lines.len() as u8,
                        operations: 4,
                        ..Request::default()
                    });
                    tile.invocations.lines.extend(lines.iter().map(|(line, _)| line));
                    tile.invocations.lines.extend(lines.iter().map(|(_, words)| !words));
                }
                items.push((*at, WarpToken { warp: index }));
            }
            card.install(0, Arc::new(Segment { tiles: vec![tile], ..Segment::default() }), Arc::new(draw()), 0);
            let memory = port(&mut plan, &mut wiring, ids[1]);
            let ideal = plan.build(&mut wiring).ideal;
            let unit = One(Constant::new(config.clone(), 0, input, out, memory));
            (ConstantCircuit::new(wiring, One(TokenSource::new(items, output)), unit, One(Sink::new(got)), ideal), card)
        },
        |c, _| c.sink.got.len() == warps.len() && c.constant.resident() == 0 && c.wires().resident() == 0,
        |c, _| {
            let order: Vec<_> = c.sink.got.iter().map(|(_, token)| token.warp).collect();
            assert_eq!(order, (0..warps.len() as u32).collect::<Vec<_>>(), "answers come in order");
            let (first, second) = c.constant.caches();
            let bytes = c.ideal.as_ref().unwrap().counts()[0].read_bytes;
            Read { times: c.sink.times(), counts: c.constant.counts(), first, second, bytes }
        },
    )
}

#[test]
fn a_level_answers_after_its_latency_and_memory_when_it_does() {
    // All parts of a warp read at one address: one lookup, in cycle 1, and a line of the second level from memory.
    let same = |address: u64| vec![vec![address; 4]; 8];
    let miss = round_trip(256);
    let got = read(&config(), &[(0, same(4096)), (200, same(4096 + 60)), (400, same(4096 + 64)), (600, same(4096 + 64))]);
    // The same line of the first level; its neighbour, which the second level has; and that again.
    assert_eq!(got.times, [1 + miss + 1, 201 + 10 + 1, 401 + 40 + 1, 601 + 10 + 1]);
    assert_eq!((got.counts.accesses, got.counts.addresses, got.bytes), (4, 4, 256));
    assert_eq!((got.first.hits, got.first.misses), (2, 2));
    assert_eq!(got.second.map(|second| (second.hits, second.misses)), Some((1, 1)));
    // Warps that come while the line is on its way wait for it, in either level.
    let got = read(&config(), &[(0, same(4096)), (1, same(4096)), (2, same(4096 + 128))]);
    assert_eq!((got.times, got.bytes), (vec![1 + miss + 1; 3], 256));
    // A hit in the first level of a line that comes from the second level waits for that.
    let got = read(&config(), &[(0, same(4096)), (200, same(4096 + 64)), (210, same(4096 + 64)), (250, same(4096 + 64))]);
    assert_eq!(got.times[1..], [201 + 40 + 1, 201 + 40 + 1, 251 + 10 + 1]);
    // Without a second level the first asks for its own lines.
    let one = ConstantConfig { second_bytes: 0, ..config() };
    let got = read(&one, &[(0, same(4096)), (200, same(4096 + 64))]);
    assert_eq!((got.times, got.bytes, got.second), (vec![1 + round_trip(64) + 1, 201 + round_trip(64) + 1], 128, None));
}

#[test]
fn different_addresses_are_read_one_after_another() {
    // Eight parts whose invocations read 1, 2, 4, ... 32 words of two lines that are there: a cycle for each word, and one behind another.
    for apart in [1_u64, 2, 4, 8, 16, 32] {
        let warm = vec![vec![4096, 4160]];
        let addresses = |part: u64| (0..4).map(|k| 4096 + (4 * part + k) % apart * 4).collect::<Vec<_>>();
        let work = (0..8).map(addresses).collect::<Vec<_>>();
        let got = read(&config(), &[(0, warm), (200, work.clone()), (200, work)]);
        assert_eq!(got.times[1..], [200 + apart + 10 + 1, 200 + 2 * apart + 10 + 1], "{apart} addresses");
        assert_eq!((got.counts.accesses, got.counts.addresses), (3, 2 + 2 * apart));
    }
    // The levels hold what their bytes say: a ring of 2 KB misses the first and hits the second in its second round, one of 8 KB misses both.
    let ring = |bytes: u64, stride: u64| {
        let round: Vec<_> = (0..bytes / stride).map(|k| vec![vec![4096 + k * stride]]).collect();
        let warps: Vec<_> = round.iter().chain(&round).enumerate().map(|(n, warp)| (200 * n as Cycle, warp.clone())).collect();
        let got = read(&config(), &warps);
        got.times.last().unwrap() - 200 * (warps.len() as Cycle - 1)
    };
    assert_eq!([ring(1024, 64), ring(2048, 64), ring(8192, 256)], [1 + 10 + 1, 1 + 40 + 1, 1 + round_trip(256) + 1]);
}
