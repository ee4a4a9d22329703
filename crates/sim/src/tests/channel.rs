//! Not ready at t - 1, ready at t; not free in t, free at t + 1; width, and the channel's own counts.

use super::units::{Item, Sink, Source};
use crate::{Circuit, Clock, Link, One, Wiring, run};
use num::Cycle;

crate::circuit! {
    struct Pair for () {
        source: One<Source>,
        sink: One<Sink>,
    }
}

fn pair(link: Link, n: u64, a_cycle: u32) -> Pair {
    let mut wiring = Wiring::new();
    let (source, sink) = (wiring.unit("source", 0), wiring.unit("sink", 0));
    let (output, input) = wiring.channel::<Item>("items", 0, link, source, sink);
    Pair::new(wiring, One(Source::new(n, a_cycle, output)), One(Sink::new(u32::MAX, input)))
}

fn cycles_of(link: Link, n: u64, a_cycle: u32) -> Vec<Cycle> {
    let mut machine = pair(link, n, a_cycle);
    run(&mut machine, &mut (), Clock::SkipIdle, 1000, |m, _| m.sink.log.len() as u64 == n).unwrap();
    machine.sink.log.iter().map(|&(cycle, _)| cycle).collect()
}

#[test]
fn an_item_comes_out_after_the_latency_and_not_before() {
    for latency in 1..10 {
        assert_eq!(cycles_of(Link::items(16, 1, latency), 3, 1), [0, 1, 2].map(|t| t + Cycle::from(latency)));
    }
}

#[test]
fn a_freed_slot_is_filled_in_the_next_cycle_and_not_before() {
    // One slot, latency 1: pushed at 0, popped at 1, pushed at 2.
    assert_eq!(cycles_of(Link::items(1, 1, 1), 4, 1), [1, 3, 5, 7]);
    // Two slots, latency 1: both rules together allow one item per cycle.
    assert_eq!(cycles_of(Link::items(2, 1, 1), 4, 1), [1, 2, 3, 4]);
    assert_eq!(cycles_of(Link::items(2, 1, 3), 5, 1), [3, 4, 7, 8, 11]);
}

#[test]
fn width_bounds_what_enters_in_a_cycle() {
    assert_eq!(cycles_of(Link::items(16, 3, 2), 7, 8), [2, 2, 2, 3, 3, 3, 4]);
    assert_eq!(cycles_of(Link::items(16, 8, 2), 7, 3), [2, 2, 2, 3, 3, 3, 4]);
}

#[test]
fn width_in_bytes_makes_long_items_take_several_cycles_and_short_ones_share_one() {
    let cycles = |bytes, width| {
        let mut machine = pair(Link::bytes(16, width, 1), 5, 8);
        machine.source.bytes = bytes;
        run(&mut machine, &mut (), Clock::SkipIdle, 1000, |m, _| m.sink.log.len() == 5).unwrap();
        machine.sink.log.iter().map(|&(cycle, _)| cycle).collect::<Vec<_>>()
    };
    assert_eq!(cycles(64, 32), [2, 4, 6, 8, 10]);
    assert_eq!(cycles(8, 16), [1, 1, 2, 2, 3]);
    // 24 bytes on 16 per cycle: ends in cycles 1, 2, 4, 5, 7 of the link.
    assert_eq!(cycles(24, 16), [2, 3, 5, 6, 8]);
}

#[test]
fn a_full_channel_counts_its_full_cycles() {
    for clock in [Clock::SkipIdle, Clock::EveryCycle] {
        let mut machine = pair(Link::items(2, 2, 1), 6, 2);
        machine.sink.a_cycle = 1;
        machine.sink.rest = 10;
        // Pushed 0, 0; popped at 1, then every tenth cycle; each freed slot is filled in the next cycle.
        run(&mut machine, &mut (), clock, 100, |m, _| m.sink.log.len() == 6).unwrap();
        assert_eq!(machine.sink.log.iter().map(|&(t, _)| t).collect::<Vec<_>>(), [1, 11, 21, 31, 41, 51]);
        let reading = machine.reading();
        // Full at the start of cycle 1, and from 3 to 11, 13 to 21, 23 to 31, 33 to 41.
        assert_eq!(reading.channels[0].full_cycles, 1 + 4 * 9);
        assert_eq!(reading.channels[0].items, 6);
        assert_eq!(reading.channels[0].bytes, 96);
        // Residence: 1, 11, 19, 19, 19, 19.
        assert_eq!(reading.channels[0].occupancy, 88);
        assert_eq!(machine.sink.residence, 88);
    }
}

/// Little: the integral of occupancy, taken by looking at the channel in every cycle, is the sum of what the items themselves
/// measured, and is what the channel counts.
#[test]
fn the_sum_of_residence_times_is_the_integral_of_occupancy() {
    for (capacity, width, latency, rest) in [(1, 1, 1, 0), (4, 2, 1, 3), (9, 2, 5, 2), (16, 4, 3, 0)] {
        let n = 100;
        let mut machine = pair(Link::items(capacity, width, latency), n, 3);
        machine.sink.rest = rest;
        let mut integral = 0;
        while (machine.sink.log.len() as u64) < n {
            machine.cycle::<true>(&mut ());
            integral += machine.wires().resident();
            let now = machine.wires().now();
            machine.wires_mut().advance(now + 1);
        }
        assert_eq!(machine.reading().channels[0].occupancy, integral);
        assert_eq!(machine.sink.residence, integral);
    }
}
