//! Whole memories: crossbar, slices, channels, and the ideal one.

use super::client::{Client, Order};
use super::dram::ddr4;
use crate::{
    AccessKind, Crossbar, Dram, DramConfig, Ideal, IdealConfig, Interleave, L2Config, L2Slice, MemoryConfig, MemoryCounts,
    MemoryPlan, PortShape, ReturnPath, TlbConfig,
};
use num::{Cycle, Random};
use sim::{Circuit, Clock, Wiring, run};

sim::circuit! {
    pub(super) struct Rig for () {
        client: Vec<Client>,
        crossbar: Option<Crossbar>,
        l2: Vec<L2Slice>,
        dram: Vec<Dram>,
        return_path: Option<ReturnPath>,
        ideal: Option<Ideal>,
    }
}

fn l2() -> L2Config {
    L2Config {
        slices: 1,
        interleave: 256,
        cached: true,
        lines: 256,
        ways: 8,
        line_bytes: 64,
        sector_bytes: 32,
        lookups_per_cycle: 1,
        misses: 16,
        waiting: 32,
        entries: 32,
        width: 64,
        latency: 4,
        ..L2Config::default()
    }
}

pub(super) fn dram_memory(slices: u32, channels: u32) -> MemoryConfig {
    let dram = DramConfig { channels, t_refi: 0, ..ddr4() };
    MemoryConfig::Dram { l2: L2Config { slices, ..l2() }, dram }
}

pub(super) fn rig(config: MemoryConfig, orders: Vec<Vec<Order>>) -> Rig {
    rig_with(config, None, orders)
}

/// The same with addresses that are translated.
fn rig_with(config: MemoryConfig, tlb: Option<TlbConfig>, orders: Vec<Vec<Order>>) -> Rig {
    let mut wiring = Wiring::new();
    let ids = wiring.bank("client", orders.len());
    let mut plan = MemoryPlan::declare(config, &mut wiring).unwrap();
    if let Some(tlb) = tlb {
        plan = plan.translating(tlb);
    }
    let mut clients = Vec::new();
    for (index, (orders, id)) in orders.into_iter().zip(ids).enumerate() {
        let name = if index == 0 { "texture" } else { "color" };
        let port = plan.client(&mut wiring, name, index, id, PortShape { width: 64, latency: 2, queue: 16 });
        clients.push(Client::new(orders, port));
    }
    let memory = plan.build(&mut wiring);
    Rig::new(wiring, clients, memory.crossbar, memory.l2, memory.dram, memory.return_path, memory.ideal)
}

pub(super) fn is_done(machine: &Rig) -> bool {
    machine.client.iter().all(Client::done)
        && machine.wires().resident() == 0
        && machine.tally().1.iter().all(|&resident| resident == 0)
}

pub(super) fn go(config: MemoryConfig, orders: Vec<Vec<Order>>) -> Rig {
    go_with(config, None, orders)
}

/// The same with addresses that are translated.
pub(super) fn go_with(config: MemoryConfig, tlb: Option<TlbConfig>, orders: Vec<Vec<Order>>) -> Rig {
    let rig = |config, orders| rig_with(config, tlb, orders);
    let mut every = rig(config, orders.clone());
    run(&mut every, &mut (), Clock::EveryCycle, 10_000, |m, _| is_done(m)).unwrap();
    let mut machine = rig(config, orders.clone());
    run(&mut machine, &mut (), Clock::SkipIdle, 10_000, |m, _| is_done(m)).unwrap();
    machine.wires_mut().settle();
    every.wires_mut().settle();
    assert_eq!(machine.tree().json(), every.tree().json(), "the clocks differ");
    let mut shuffled = rig(config, orders);
    run(&mut shuffled, &mut (), Clock::Shuffled(1), 10_000, |m, _| is_done(m)).unwrap();
    shuffled.wires_mut().settle();
    assert_eq!(machine.tree().json(), shuffled.tree().json(), "the order of ticks matters");
    for unit in machine.reading().units {
        assert_eq!(unit.total(), machine.wires().now(), "the account adds up");
    }
    machine
}

/// A client's link 2, into the slice 4, out of it 4, back 2, to be seen; the crossbar and the way back forward in the cycle in
/// which they see a request. On the way out a request is looked up in the cycle in which it arrives, and answered in the next one.
const HIT: Cycle = 2 + 4 + 1 + 4 + 2;

#[test]
fn a_hit_takes_the_hops_and_a_miss_the_channel_as_well() {
    let machine = go(dram_memory(1, 1), vec![vec![Order::read(0, 0, 32), Order::read(500, 0, 32), Order::read(1000, 32, 32)]]);
    let client = &machine.client[0];
    assert_eq!(client.latency(1), HIT);
    let c = ddr4();
    // Looked up, sent in the next cycle, the channel's own hops and times, filled and answered in the next cycle.
    let miss = HIT + 1 + 3 + Cycle::from(c.t_rcd + c.cl + c.burst_cycles);
    assert_eq!(client.latency(0), miss);
    assert_eq!(client.latency(2), miss - Cycle::from(c.t_rcd), "the other sector of the line comes from the open row");
    let counts = machine.l2[0].cache_counts();
    assert_eq!((counts.accesses, counts.hits, counts.misses, counts.evictions), (3, 1, 2, 0));
}

#[test]
fn a_controller_adds_its_latency_each_way_and_carries_as_much() {
    let with = |latency| {
        let MemoryConfig::Dram { l2, dram } = dram_memory(1, 1) else { unreachable!() };
        MemoryConfig::Dram {
            l2: L2Config { misses: 4096, entries: 4096, waiting: 4096, ..l2 },
            dram: DramConfig { latency, ..dram },
        }
    };
    let one = |latency| go(with(latency), vec![vec![Order::read(0, 0, 32)]]).client[0].latency(0);
    assert_eq!((one(2) - one(1), one(60) - one(1)), (2, 2 * 59));
    // A stream is as fast as with the shortest way: its end comes later by what its first answer does.
    let orders: Vec<Order> = (0..1000).map(|line| Order::read(0, line * 64, 64)).collect();
    let end = |latency| go(with(latency), vec![orders.clone()]).client[0].answered[999].unwrap();
    assert_eq!(end(60) - end(1), 2 * 59);
}

#[test]
fn misses_on_one_line_are_asked_for_once() {
    let orders = (0..8).map(|_| Order::read(0, 128, 32)).collect();
    let machine = go(dram_memory(1, 1), vec![orders]);
    assert_eq!(machine.l2[0].counts().fetched_bytes, 32);
    assert_eq!(machine.l2[0].counts().merged, 7);
    assert_eq!(machine.dram[0].counts().read_bytes, 64, "DRAM moves whole bursts");
    let cache = machine.l2[0].cache_counts();
    assert_eq!((cache.hits, cache.misses), (7, 1));
}

#[test]
fn a_request_over_four_lines_is_answered_once_all_are_there() {
    let machine = go(dram_memory(1, 1), vec![vec![Order::read(0, 64, 64), Order::read(400, 0, 256)]]);
    let c = ddr4();
    // The second line is there. The first is asked for at once and the others, looked up in turn, stream behind it; 256 bytes take
    // three cycles more on each of the two links back.
    let first = HIT + 1 + 3 + Cycle::from(c.cl + c.burst_cycles);
    assert_eq!(machine.client[0].latency(1), first + 2 * Cycle::from(c.burst_cycles) + 3 + 3);
}

#[test]
fn whole_sectors_are_written_without_reading_and_partial_ones_are_not() {
    let machine = go(dram_memory(1, 1), vec![vec![Order::write(0, 0, 64), Order::write(0, 64, 40), Order::read(100, 0, 128)]]);
    let counts = machine.l2[0].counts();
    // The second half of the second line is written in part.
    assert_eq!(counts.fetched_bytes, 32);
    assert_eq!((counts.write_bytes, counts.read_bytes, counts.written_back_bytes), (104, 128, 0));
    let mut dirty = Vec::new();
    machine.l2[0].cache().clone().flush(|line, sectors| dirty.push((line, sectors)));
    dirty.sort_unstable();
    assert_eq!(dirty, [(0, 0b11), (1, 0b11)]);
}

#[test]
fn dirty_lines_that_go_are_written_back() {
    // Four times as much as the slice holds.
    let orders: Vec<Order> = (0..1024).map(|line| Order::write(0, line * 64, 64)).collect();
    let machine = go(dram_memory(1, 1), vec![orders]);
    let counts = machine.l2[0].counts();
    assert_eq!(counts.fetched_bytes, 0);
    assert_eq!(counts.written_back_bytes, machine.l2[0].cache_counts().evictions * 64);
    assert_eq!(machine.dram[0].counts().write_bytes, counts.written_back_bytes);
    assert_eq!(machine.l2[0].cache_counts().evictions, 1024 - 256);
}

#[test]
fn atomics_are_answered_and_leave_the_line_dirty() {
    let order = Order { from: 0, kind: AccessKind::Atomic, address: 8, bytes: 4 };
    let machine = go(dram_memory(1, 1), vec![vec![order]]);
    assert_eq!(machine.client[0].answers, 1);
    assert_eq!(machine.l2[0].counts().fetched_bytes, 32);
    let mut dirty = 0;
    machine.l2[0].cache().clone().flush(|_, sectors| dirty |= sectors);
    assert_eq!(dirty, 1);
}

fn uncached(slices: u32, channels: u32) -> MemoryConfig {
    let MemoryConfig::Dram { l2, dram } = dram_memory(slices, channels) else { unreachable!() };
    MemoryConfig::Dram { l2: L2Config { cached: false, ..l2 }, dram }
}

#[test]
fn without_a_cache_all_that_is_asked_for_is_asked_of_dram() {
    let read = |from| Order::read(from, 0, 64);
    let machine = go(uncached(1, 1), vec![vec![read(0), read(500), Order::write(1000, 0, 64), read(1500)]]);
    let counts = machine.l2[0].counts();
    assert_eq!((counts.fetched_bytes, counts.written_back_bytes, counts.merged), (192, 64, 0));
    let dram = machine.dram[0].counts();
    assert_eq!((dram.read_bytes, dram.write_bytes), (192, 64));
    assert_eq!(machine.l2[0].cache_counts(), crate::CacheCounts::default());
    // As long as a miss, and from an open row each time.
    let c = ddr4();
    let miss = HIT + 1 + 3 + Cycle::from(c.t_rcd + c.cl + c.burst_cycles);
    let client = &machine.client[0];
    let row_hit = miss - Cycle::from(c.t_rcd);
    assert_eq!([0, 1, 3].map(|order| client.latency(order)), [miss, row_hit, row_hit]);
    // Whole sectors go, line by line, and an atomic goes both ways: one sector for 4 bytes, and three for the 72 from byte 8 on.
    let atomic = Order { from: 0, kind: AccessKind::Atomic, address: 8, bytes: 4 };
    let machine = go(uncached(1, 1), vec![vec![atomic, Order::write(500, 4096 + 8, 72)]]);
    let counts = machine.l2[0].counts();
    assert_eq!((counts.fetched_bytes, counts.written_back_bytes), (32, 32 + 96));
    assert_eq!(machine.client[0].answers, 1);
}

#[test]
fn clients_take_turns_at_a_slice() {
    // All ask the same line again and again: the slice looks one up per cycle, and nobody gets more than his share.
    let n = 300;
    let orders: Vec<Order> = (0..n).map(|_| Order::read(0, 0, 32)).collect();
    let machine = go(dram_memory(1, 1), vec![orders.clone(), orders.clone(), orders]);
    let ends: Vec<Cycle> = machine.client.iter().map(|client| client.answered[n - 1].unwrap()).collect();
    let (first, last) = (ends.iter().min().unwrap(), ends.iter().max().unwrap());
    assert!(last - first <= 3, "{ends:?}");
}

#[test]
fn random_traffic_is_conserved_over_slices_and_channels() {
    let mut generator = Random::new(9);
    let mut random = |bound: u64| u64::from(generator.below(bound as u32));
    for (slices, channels) in [(1, 1), (4, 2), (4, 4), (6, 3)] {
        let orders: Vec<Vec<Order>> = (0..5)
            .map(|_| {
                (0..600)
                    .map(|_| {
                        let bytes = [4, 16, 32, 64, 128, 256][random(6) as usize];
                        let address = random(1 << 18) / bytes * bytes;
                        let kind =
                            [AccessKind::Read, AccessKind::Read, AccessKind::Write, AccessKind::Atomic][random(4) as usize];
                        Order { from: random(2000), kind, address, bytes: bytes as u32 }
                    })
                    .collect()
            })
            .collect();
        let without = go(uncached(slices, channels), orders.clone());
        let machine = go(dram_memory(slices, channels), orders.clone());
        let asked = |kinds: &[AccessKind]| {
            orders.iter().flatten().filter(|o| kinds.contains(&o.kind)).map(|o| u64::from(o.bytes)).sum::<u64>()
        };
        let l2 = |of: fn(&L2Slice) -> u64| machine.l2.iter().map(of).sum::<u64>();
        assert_eq!(l2(|s| s.counts().read_bytes), asked(&[AccessKind::Read, AccessKind::Atomic]));
        assert_eq!(l2(|s| s.counts().write_bytes), asked(&[AccessKind::Write, AccessKind::Atomic]));
        let crossbar = machine.crossbar.as_ref().unwrap();
        assert_eq!(crossbar.counts().iter().map(|c| c.read_bytes).sum::<u64>(), asked(&[AccessKind::Read, AccessKind::Atomic]));
        let dram = |of: fn(&Dram) -> u64| machine.dram.iter().map(of).sum::<u64>();
        assert!(dram(|d| d.counts().read_bytes) >= l2(|s| s.counts().fetched_bytes), "bursts are whole");
        assert!(dram(|d| d.counts().read_bytes) <= 2 * l2(|s| s.counts().fetched_bytes));
        assert!(machine.dram.iter().all(|d| d.counts().read_bytes > 0), "every channel has its share");
        // A queue keeps nothing back.
        let sum = |of: fn(&L2Slice) -> u64| without.l2.iter().map(of).sum::<u64>();
        assert_eq!(sum(|s| s.counts().read_bytes), asked(&[AccessKind::Read, AccessKind::Atomic]));
        assert!(sum(|s| s.counts().fetched_bytes) >= asked(&[AccessKind::Read, AccessKind::Atomic]));
        assert!(sum(|s| s.counts().written_back_bytes) >= asked(&[AccessKind::Write, AccessKind::Atomic]));
    }
}

#[test]
fn the_ideal_memory_has_its_latency_and_its_bandwidth() {
    let ideal = MemoryConfig::Ideal(IdealConfig { latency: 100, bytes_per_cycle: 32 });
    let machine = go(ideal, vec![vec![Order::read(0, 0, 32), Order::read(500, 0, 128)]]);
    // Links of two cycles each way around the latency; 128 bytes take three cycles more at 32 per cycle and one more on a link of 64.
    assert_eq!(machine.client[0].latency(0), 2 + 100 + 2);
    assert_eq!(machine.client[0].latency(1), 2 + 3 + 100 + 1 + 2);
    let orders: Vec<Order> = (0..500).map(|i| Order::read(0, i * 64, 64)).collect();
    let machine = go(ideal, vec![orders.clone(), orders]);
    let cycles = machine.wires().now();
    let expected = 2 * 500 * 64 / 32;
    assert!(cycles >= expected && cycles < expected + 120, "{cycles}");
    let ends: Vec<Cycle> = machine.client.iter().map(|client| client.answered[499].unwrap()).collect();
    assert!(ends[0].abs_diff(ends[1]) <= 4);
}

#[test]
fn statistics_name_clients_and_channels() {
    let machine = go(
        dram_memory(2, 1),
        vec![vec![Order::read(0, 0, 64)], vec![Order::write(0, 256, 64)], vec![Order::write(0, 512, 32)]],
    );
    let names = [("texture", 0), ("color", 0), ("color", 1)];
    let tree = MemoryCounts::read(&names, machine.crossbar.as_ref().unwrap().counts(), &machine.dram, None).tree();
    assert_eq!(tree.number("memory.clients.texture.read_bytes"), Some(64.0));
    assert_eq!(tree.number("memory.clients.color.write_bytes"), Some(96.0));
    for name in ["read_bytes", "write_bytes", "row_hits", "row_misses", "busy_cycles"] {
        assert!(tree.number(&format!("memory.dram.{name}")).is_some(), "{name}");
    }
}

#[test]
fn runs_of_addresses_are_dealt_evenly_and_uniquely() {
    for slices in [1, 2, 3, 4, 6, 8] {
        let interleave = Interleave::new(slices, 256).unwrap();
        let mut seen = std::collections::BTreeSet::new();
        let mut each = vec![0; slices as usize];
        for run in 0..960 {
            let (slice, address) = interleave.split(run * 256 + 17);
            assert_eq!(address % 256, 17);
            assert!(seen.insert((slice, address)), "two runs in one place");
            each[slice as usize] += 1;
        }
        assert!(each.iter().all(|&count| count == 960 / slices), "{each:?}");
        // A stride of all slices does not stay on one.
        let strided: std::collections::BTreeSet<u32> =
            (0..64).map(|i| interleave.split(i * 256 * u64::from(slices)).0).collect();
        assert_eq!(strided.len() as u32, slices);
    }
    assert!(Interleave::new(4, 128).is_err());
}

#[test]
fn the_slices_of_a_channel_are_served_evenly() {
    // Each client reads what one of four slices has; no line is read again, and DRAM is what all wait for.
    let MemoryConfig::Dram { l2, dram } = dram_memory(4, 1) else { unreachable!() };
    let dram = DramConfig { window: 4, ..dram };
    let interleave = Interleave::new(4, 256).unwrap();
    let lines = |slice| (0..16_000_u64).map(|line| line * 64).filter(move |&line| interleave.split(line).0 == slice);
    let orders = (0..4).map(|slice| lines(slice).take(1000).map(|line| Order::read(0, line, 64)).collect()).collect();
    let machine = go(MemoryConfig::Dram { l2, dram }, orders);
    let ends: Vec<Cycle> = machine.client.iter().map(|client| client.answered[999].unwrap()).collect();
    let (first, last) = (ends.iter().min().unwrap(), ends.iter().max().unwrap());
    assert!(last - first < last / 10, "{ends:?}");
}
