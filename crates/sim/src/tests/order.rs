//! The order in which units tick changes nothing, and neither does skipping idle cycles.

use super::units::{Item, Merge, Source, Split, Worker};
use crate::clock::shuffle;
use crate::kit::{permutations, step};
use crate::{Circuit, Clock, Link, One, Reading, Wiring, run};
use num::{Cycle, Random};

crate::circuit! {
    /// A fork and a join with back pressure: the smallest circuit in which the order of ticks could matter in all the ways that
    /// it can (a slot freed and filled, an item pushed and popped, two producers of one consumer).
    struct Diamond for () {
        source: One<Source>,
        split: One<Split>,
        worker: Vec<Worker>,
        merge: One<Merge>,
    }
}

const ITEMS: u64 = 60;

/// `shape` gives capacity, width and latency of the five channels.
fn diamond(shape: [(u32, u32, u32); 5], service: [Cycle; 2]) -> Diamond {
    let mut wiring = Wiring::new();
    let source = wiring.unit("source", 0);
    let split = wiring.unit("split", 0);
    let workers = wiring.bank("worker", 2);
    let merge = wiring.unit("merge", 0);
    let link = shape.map(|(capacity, width, latency)| Link::items(capacity, width, latency));
    let (out, into_split) = wiring.channel::<Item>("input", 0, link[0], source, split);
    let (left, into_left) = wiring.channel("work", 0, link[1], split, workers[0]);
    let (right, into_right) = wiring.channel("work", 1, link[2], split, workers[1]);
    let (from_left, left_done) = wiring.channel("done", 0, link[3], workers[0], merge);
    let (from_right, right_done) = wiring.channel("done", 1, link[4], workers[1], merge);
    Diamond::new(
        wiring,
        One(Source::new(ITEMS, 2, out)),
        One(Split { items: 0, input: into_split, outputs: vec![left, right] }),
        vec![Worker::new(service[0], into_left, from_left), Worker::new(service[1], into_right, from_right)],
        One(Merge { inputs: vec![left_done, right_done], log: Vec::new() }),
    )
}

fn done(machine: &Diamond) -> bool {
    machine.merge.log.len() as u64 == ITEMS
}

type RunRecord = (Vec<(Cycle, u64)>, Reading, Vec<u64>);

fn outcome(mut machine: Diamond) -> RunRecord {
    assert_eq!(machine.wires().resident(), 0);
    machine.wires_mut().settle();
    let (items, resident) = machine.tally();
    assert_eq!(resident, [0; 5]);
    (std::mem::take(&mut machine.merge.log), machine.reading(), items)
}

const SHAPES: [[(u32, u32, u32); 5]; 4] = [
    [(1, 1, 1); 5],
    [(2, 2, 1), (1, 1, 2), (2, 1, 1), (1, 1, 1), (3, 1, 3)],
    [(4, 1, 3), (2, 2, 1), (5, 1, 4), (2, 1, 1), (1, 1, 1)],
    [(8, 2, 2), (8, 2, 2), (8, 2, 2), (8, 2, 2), (8, 2, 2)],
];

#[test]
fn all_120_orders_and_both_clocks_give_one_outcome() {
    let orders = permutations(5);
    assert_eq!(orders.len(), 120);
    for shape in SHAPES {
        for service in [[3, 2], [1, 1], [0, 7]] {
            let mut skipping = diamond(shape, service);
            run(&mut skipping, &mut (), Clock::SkipIdle, 100, |m, _| done(m)).unwrap();
            let expected = outcome(skipping);
            for unit in &expected.1.units {
                assert_eq!(unit.total(), expected.1.cycle, "the account adds up");
            }
            let mut every = diamond(shape, service);
            run(&mut every, &mut (), Clock::EveryCycle, 100, |m, _| done(m)).unwrap();
            assert_eq!(outcome(every), expected, "every-cycle differs from skip-idle for {shape:?}, {service:?}");
            for order in &orders {
                let mut machine = diamond(shape, service);
                while !done(&machine) {
                    step(&mut machine, order, &mut ());
                }
                assert_eq!(outcome(machine), expected, "order {order:?} differs for {shape:?}, {service:?}");
            }
        }
    }
}

#[test]
fn orders_that_change_from_cycle_to_cycle_change_nothing() {
    let orders = permutations(5);
    for shape in SHAPES {
        let mut reference = diamond(shape, [2, 5]);
        run(&mut reference, &mut (), Clock::SkipIdle, 100, |m, _| done(m)).unwrap();
        let expected = outcome(reference);
        let mut machine = diamond(shape, [2, 5]);
        let mut random = Random::new(1);
        while !done(&machine) {
            step(&mut machine, &orders[random.below(orders.len() as u32) as usize], &mut ());
        }
        assert_eq!(outcome(machine), expected);
    }
}

#[test]
fn the_shuffling_clock_draws_orders_of_all_units() {
    // Every unit ticks once per cycle, and over some cycles every unit comes first and last; the outcome is that of the other clocks.
    let mut skipping = diamond(SHAPES[1], [2, 5]);
    run(&mut skipping, &mut (), Clock::SkipIdle, 100, |m, _| done(m)).unwrap();
    let expected = outcome(skipping);
    for seed in 0..50 {
        let mut machine = diamond(SHAPES[1], [2, 5]);
        run(&mut machine, &mut (), Clock::Shuffled(seed), 100, |m, _| done(m)).unwrap();
        assert_eq!(outcome(machine), expected, "seed {seed}");
    }
    let (mut first, mut last) = ([0; 5], [0; 5]);
    for cycle in 0..1000 {
        let mut order = Vec::new();
        shuffle(&mut order, 5, 1, cycle);
        first[order[0]] += 1;
        last[order[4]] += 1;
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2, 3, 4]);
    }
    assert!(first.iter().chain(&last).all(|&count| (120..280).contains(&count)), "{first:?} {last:?}");
}
