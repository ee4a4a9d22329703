//! The order in which the units of a memory tick changes nothing.

use super::client::Order;
use super::slices::{Rig, dram_memory, is_done, rig};
use crate::{AccessKind, IdealConfig, MemoryConfig};
use num::{Cycle, Random};
use sim::kit::{permutations, step};
use sim::{Circuit, Clock, run};

/// Requests of every kind and size, which meet on a few lines and rows.
fn orders(clients: u64, each: u64) -> Vec<Vec<Order>> {
    let mut generator = Random::new(3);
    let mut random = |bound: u64| u64::from(generator.below(bound as u32));
    let mut order = || {
        let bytes = [4, 32, 64, 256][random(4) as usize];
        let address = random(1 << 14) / bytes * bytes;
        let kind = [AccessKind::Read, AccessKind::Read, AccessKind::Write, AccessKind::Atomic][random(4) as usize];
        Order { from: random(40), kind, address, bytes: bytes as u32 }
    };
    (0..clients).map(|_| (0..each).map(|_| order()).collect()).collect()
}

/// When every request was answered, and all that is counted.
fn outcome(mut machine: Rig) -> (Vec<Vec<Option<Cycle>>>, String) {
    machine.wires_mut().settle();
    let mut text = machine.tree().json().to_string();
    for slice in &machine.l2 {
        text.push_str(&format!("{:?} {:?}", slice.counts(), slice.cache_counts()));
    }
    for channel in &machine.dram {
        text.push_str(&format!("{:?}", channel.counts()));
    }
    (machine.client.iter().map(|client| client.answered.clone()).collect(), text)
}

fn every_order_is_one(config: MemoryConfig, clients: u64, units: usize) {
    let make = || rig(config, orders(clients, 25));
    let mut machine = make();
    run(&mut machine, &mut (), Clock::SkipIdle, 10_000, |m, _| is_done(m)).unwrap();
    let expected = outcome(machine);
    for order in permutations(units) {
        let mut machine = make();
        while !is_done(&machine) {
            step(&mut machine, &order, &mut ());
        }
        assert_eq!(outcome(machine), expected, "order {order:?}");
    }
}

#[test]
fn all_720_orders_of_a_memory_give_one_outcome() {
    // Two clients, crossbar, slice, channel, return path.
    every_order_is_one(dram_memory(1, 1), 2, 6);
}

#[test]
fn all_120_orders_of_an_ideal_memory_give_one_outcome() {
    // Four clients, who contend for its bandwidth.
    every_order_is_one(MemoryConfig::Ideal(IdealConfig { latency: 20, bytes_per_cycle: 24 }), 4, 5);
}
