//! Where addresses lie: no two of them in one bank, row and column.

use std::collections::BTreeSet;

use super::client::Order;
use super::dram::ddr4;
use super::slices::{dram_memory, go};
use crate::{ChannelShare, DramConfig, Interleave, MemoryConfig};
use num::Random;

/// Channel, bank, row and column of an address.
fn located(interleave: Interleave, channels: u32, dram: &DramConfig, address: u64) -> (u32, u32, u64, u64) {
    let (slice, within) = interleave.split(address);
    let address = ChannelShare::new(interleave, slice, channels).address(within);
    let (bank, row) = dram.place(address);
    (slice % channels, bank, row, address % u64::from(dram.row_bytes))
}

#[test]
fn every_address_has_a_bank_row_and_column_of_its_own() {
    let mut generator = Random::new(57);
    let mut random = |bound: u32| generator.below(bound);
    for case in 0..60 {
        let channels = 1 + random(8);
        let slices = channels * (1 + random(64 / channels));
        let interleave = Interleave::new(slices, 256 << random(5)).unwrap();
        let dram =
            DramConfig { channels, banks: 1 + random(64), row_bytes: 256 << random(6), hash_banks: random(2) == 0, ..ddr4() };
        // Whole runs, and addresses far apart.
        let mut addresses: BTreeSet<u64> = (0..6_000).map(|run| run * 128).collect();
        addresses.extend((0..6_000).map(|_| (u64::from(random(1 << 30)) << 7 | 64) & ((1 << 36) - 1)));
        let places: BTreeSet<_> = addresses.iter().map(|&address| located(interleave, channels, &dram, address)).collect();
        assert_eq!(places.len(), addresses.len(), "case {case}: {slices} slices of {interleave:?}, {dram:?}");
    }
}

#[test]
fn a_row_gives_no_more_bursts_than_it_has() {
    for (slices, channels) in [(1, 1), (2, 1), (8, 1), (6, 2), (8, 4), (16, 2)] {
        let MemoryConfig::Dram { l2, dram } = dram_memory(slices, channels) else { unreachable!() };
        let dram = DramConfig { row_bytes: 512, hash_banks: true, ..dram };
        let orders: Vec<Order> = (0..4096).map(|line| Order::read(0, line * 64, 64)).collect();
        let machine = go(MemoryConfig::Dram { l2, dram }, vec![orders]);
        let bursts: u64 = machine.dram.iter().map(|d| d.counts().row_hits + d.counts().row_misses).sum();
        let activations: u64 = machine.dram.iter().map(|d| d.counts().row_misses).sum();
        assert_eq!(bursts, 4096);
        let most = bursts * u64::from(dram.burst_bytes) / u64::from(dram.row_bytes);
        assert!(activations >= most, "{slices} slices: {bursts} bursts of {activations} activations");
        // Lines come nearly in order: a row that is open is read to its end, or nearly so.
        assert!(activations <= most + most / 2, "{slices} slices: {bursts} bursts of {activations} activations");
    }
}
