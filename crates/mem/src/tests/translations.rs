//! Translation of addresses: hits, misses of both levels, and what goes on meanwhile.

use super::client::Order;
use super::slices::{dram_memory, go_with};
use crate::tlb::Translation;
use crate::{TlbConfig, TlbCounts};
use num::Cycle;

/// Two pages of 4 KB for each port, four of 16 KB for all.
const TLB: TlbConfig = TlbConfig {
    entries: 2,
    page_bytes: 4096,
    second_entries: 4,
    second_page_bytes: 16384,
    second_latency: 10,
    walk_latency: 40,
    queue: 8,
};

/// Latencies of reads of one client, each long after the one before, with translation in addition to those without; and what was counted.
fn added(tlb: TlbConfig, addresses: &[u64]) -> (Vec<Cycle>, TlbCounts) {
    let orders: Vec<_> = (0..).zip(addresses).map(|(n, &address)| Order::read(500 * n, address, 32)).collect();
    let [plain, translated] = [None, Some(tlb)].map(|tlb| go_with(dram_memory(1, 1), tlb, vec![orders.clone()]));
    let latency = |of: usize| translated.client[0].latency(of) - plain.client[0].latency(of);
    let counts = translated.crossbar.as_ref().and_then(|crossbar| crossbar.translations()).unwrap_or_default();
    ((0..addresses.len()).map(latency).collect(), counts)
}

#[test]
fn a_translation_takes_what_the_level_that_has_it_takes() {
    // A walk; the same page; another one of the same page of the second level; one of another.
    let (latencies, counts) = added(TLB, &[0, 64, 4096, 16384]);
    assert_eq!(latencies, [50, 0, 10, 50]);
    assert_eq!((counts.misses, counts.walks, counts.waits), (3, 2, 3));
    // The least recently used page of the first level has gone: 0 is used again before 8192 comes, so 4096 goes.
    let (latencies, _) = added(TLB, &[0, 4096, 64, 8192, 128, 4160]);
    assert_eq!(latencies, [50, 10, 0, 10, 0, 10]);
    // A round through five pages of the second level misses all of them again; a round through four does not.
    let round = |pages: u64| (0..2 * pages).map(|n| n % pages * 16384).collect::<Vec<_>>();
    assert_eq!(added(TLB, &round(5)).0[5..], [50; 5]);
    assert_eq!(added(TLB, &round(4)).0[4..], [10; 4]);
    // Without entries nothing is translated.
    assert_eq!(added(TlbConfig { entries: 0, ..TLB }, &[0, 1 << 30]), (vec![0, 0], TlbCounts::default()));
}

#[test]
fn requests_to_other_pages_go_on_while_one_waits() {
    // Page 0 is there. A walk for 64 KB and a second request to that page; behind them page 0 is not held up.
    let orders = vec![
        Order::read(0, 0, 32),
        Order::read(500, 1 << 16, 32),
        Order::read(501, (1 << 16) + 2048, 32),
        Order::read(502, 0, 32),
    ];
    let run = |tlb| go_with(dram_memory(1, 1), tlb, vec![orders.clone()]);
    let (plain, translated) = (run(None), run(Some(TLB)));
    let answered = |rig: &super::slices::Rig, of: usize| rig.client[0].answered[of].unwrap();
    assert_eq!(answered(&translated, 3), answered(&plain, 3));
    assert_eq!(answered(&translated, 1), answered(&plain, 1) + 50);
    // Both that wait go on when the translation is there, one after another.
    assert!(answered(&translated, 2) > answered(&translated, 1));
    let counts = translated.crossbar.as_ref().and_then(|crossbar| crossbar.translations()).unwrap();
    assert_eq!((counts.misses, counts.walks, counts.waits), (2, 2, 3));
    // Each port has a first level of its own, and they share the second.
    let both = vec![vec![Order::read(0, 0, 32), Order::read(800, 64, 32)], vec![Order::read(400, 128, 32)]];
    let run = |tlb| go_with(dram_memory(1, 1), tlb, both.clone());
    let (plain, translated) = (run(None), run(Some(TLB)));
    let late = |client: usize, of: usize| translated.client[client].latency(of) - plain.client[client].latency(of);
    assert_eq!([late(0, 0), late(1, 0), late(0, 1)], [50, 10, 0]);
}

#[test]
fn waiting_requests_are_as_many_as_there_is_room_for() {
    // Sixteen requests to a page that is not there: with room for four the fifth holds up the port, and all are answered.
    let orders: Vec<_> = (0..16).map(|line| Order::read(0, (1 << 16) + line * 64, 32)).collect();
    let end = |queue| {
        let rig = go_with(dram_memory(1, 1), Some(TlbConfig { queue, ..TLB }), vec![orders.clone()]);
        let counts = rig.crossbar.as_ref().and_then(|crossbar| crossbar.translations()).unwrap();
        (rig.client[0].answered.iter().flatten().max().copied(), counts.misses, counts.waits)
    };
    // What waits goes on one per cycle, and so does what comes later: the last is as late.
    assert_eq!(end(4), (end(16).0, 1, 4));
    assert_eq!(end(16), (end(4).0, 1, 16));
}

#[test]
fn a_page_that_is_looked_up_without_time_is_known_to_its_port_and_to_the_second_level() {
    let mut translation = Translation::new(TLB, 2).expect("it has entries");
    translation.visit(0, 64);
    assert_eq!([0, 1].map(|port| translation.waits_until(port, 128, 100)), [None, Some(110)]);
    let TlbCounts { misses, walks, .. } = translation.counts();
    assert_eq!((misses, walks), (1, 0));
}
