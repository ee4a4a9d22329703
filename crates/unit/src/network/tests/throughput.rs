//! The throughput of a network, and its hot spots.

use super::kit::{ALL, Case, Order, RigResult, config};
use crate::network::{Arbitration, NetworkConfig, Topology};
use num::{Cycle, Random};
use sim::Clock;

/// Bytes of a parcel here: one cycle of a link.
const BYTES: u32 = 16;

/// Room enough that only links matter.
fn roomy(topology: Topology) -> NetworkConfig {
    NetworkConfig { queue: 64, receive_queue: 256, ..config(topology) }
}

/// Every node sends to all nodes in turn, `rounds` times.
fn all_to_all(nodes: usize, rounds: usize) -> Vec<Vec<Order>> {
    (0..nodes).map(|from| (0..rounds * nodes).map(|n| Order::new(0, (from + n) % nodes, BYTES)).collect()).collect()
}

/// The parcels on the busiest link of a class.
fn busiest(outcome: &RigResult, channels: &str) -> u64 {
    let count = |index| outcome.tree.number(&format!("channels.{channels}[{index}].items"));
    (0..).map_while(count).map(|items| items as u64).max().unwrap_or(0)
}

#[test]
fn a_crossbar_carries_as_much_as_its_receivers_take() {
    for nodes in [2, 3, 8, 16, 64] {
        let rounds = 4000 / nodes;
        let case = Case::new(roomy(Topology::Crossbar), all_to_all(nodes, rounds), nodes);
        let outcome = case.run(Clock::SkipIdle);
        // Each link out carries a parcel per cycle from the first to the last; before lie two links of 3 cycles.
        let cycles = (rounds * nodes) as Cycle;
        assert!(outcome.got.iter().all(|got| got.len() as Cycle == cycles));
        assert_eq!(outcome.last(), 6 + cycles - 1, "{nodes} nodes");
    }
    // The same with receivers drawn at random, where the fullest receiver is the bound: queues for each output lose next to nothing.
    let (nodes, count) = (16, 4000);
    let mut random = Random::new(1);
    let orders =
        (0..nodes).map(|_| (0..count).map(|_| Order::new(0, random.below(nodes as u32) as usize, BYTES)).collect()).collect();
    let outcome = Case::new(roomy(Topology::Crossbar), orders, nodes).run(Clock::SkipIdle);
    let most = outcome.got.iter().map(Vec::len).max().unwrap() as f64;
    let reached = most / outcome.last() as f64;
    assert!(reached > 0.97, "{reached}");
}

#[test]
fn rings_and_meshes_carry_what_their_bisection_does() {
    // Of a ring of N (even), a link of each direction is on N N / 8 of the N N ways; of a mesh of C columns and R rows, one between the
    // halves of a row is on (C R / 2)(C R / 2) / R ways.
    for (topology, nodes, ways, rounds) in [
        (Topology::Ring, 8, 8, 100),
        (Topology::Ring, 16, 32, 25),
        (Topology::Ring, 64, 512, 4),
        (Topology::Mesh, 16, 16, 50),
        (Topology::Mesh, 36, 54, 15),
        (Topology::Mesh, 64, 128, 6),
    ] {
        let case = Case::new(roomy(topology), all_to_all(nodes, rounds), nodes);
        let outcome = case.run(Clock::SkipIdle);
        let bound = rounds as u64 * ways;
        // While all senders are in step, the ties of a ring need not fall evenly.
        assert_eq!(busiest(&outcome, "sort_link"), bound, "{topology:?} of {nodes}");
        let share = bound as f64 / outcome.last() as f64;
        // What is lost is the first parcels' way in and the last ones' way out, and turns that come out unevenly.
        assert!((0.95..=1.0).contains(&share), "{topology:?} of {nodes}: {share}");
    }
}

#[test]
fn a_bus_carries_one_link_for_all() {
    let case = Case::new(roomy(Topology::Bus), all_to_all(8, 20), 8);
    let outcome = case.settle();
    // 1 cycle to the bus, 3 on it, 1 off it.
    assert_eq!(outcome.last(), 5 + 8 * 8 * 20 - 1);
    assert_eq!(outcome.traffic.hot_spot, "sort_link[0] from router 0 to router 1");
}

#[test]
fn a_hot_spot_is_one_link_and_is_shared_evenly() {
    for topology in ALL {
        let (nodes, count) = (8, 100);
        let orders = vec![vec![Order::new(0, 2, BYTES); count]; nodes];
        let outcome = Case::new(roomy(topology), orders, nodes).settle();
        let total = (nodes * count) as Cycle;
        if topology == Topology::PointToPoint {
            // A channel each: none is hotter than another.
            assert_eq!(outcome.last(), 3 + count as Cycle - 1);
            continue;
        }
        // The last link carries a parcel per cycle from the first on.
        let got = &outcome.got[2];
        assert_eq!(got[got.len() - 1].0 - got[0].0, total - 1, "{topology:?}");
        let hot = &outcome.traffic;
        let spot = if topology == Topology::Bus { "sort_link[0] from router 0 to router 1" } else { "sort_out[2] from router" };
        assert!(hot.hot_spot.starts_with(spot), "{topology:?}: {}", hot.hot_spot);
        assert!((hot.hottest - total as f64 / outcome.cycles as f64).abs() < 1e-12, "{topology:?}");
        assert!(hot.hottest > 0.97 && hot.mean < 0.6 * hot.hottest, "{topology:?}: {hot:?}");
        // One router in turn: of any eight parcels in a row one is each sender's.
        if matches!(topology, Topology::Bus | Topology::Crossbar) {
            for window in got.windows(nodes) {
                let senders: u32 = window.iter().map(|(_, item)| 1 << item[0]).sum();
                assert_eq!(senders, 0xff, "{topology:?}");
            }
        }
    }
}

#[test]
fn traffic_that_a_butterfly_cannot_spread_is_hot_inside() {
    // Bit reversal: of eight senders pairs share a link between stages, though every receiver has its own sender.
    let count = 200;
    let orders = (0..8).map(|from| vec![Order::new(0, [0, 4, 2, 6, 1, 5, 3, 7][from], BYTES); count]).collect();
    let outcome = Case::new(roomy(Topology::Butterfly), orders, 8).settle();
    assert_eq!(busiest(&outcome, "sort_link"), 2 * count as u64);
    assert_eq!(busiest(&outcome, "sort_out"), count as u64);
    // Four links of 3 cycles, and twice the parcels on the busiest.
    assert_eq!(outcome.last(), 12 + 2 * count as Cycle - 1);
    assert!(outcome.traffic.hot_spot.starts_with("sort_link"), "{}", outcome.traffic.hot_spot);
}

#[test]
fn who_came_first_goes_first_if_asked_for() {
    // From cycle 3 on the router gets a parcel per cycle from each of senders 0 and 1 and sends one on; in cycle 11, with eight sent and
    // eight waiting, one from sender 2.
    let orders = vec![vec![Order::new(0, 0, BYTES); 20], vec![Order::new(0, 0, BYTES); 20], vec![Order::new(8, 0, BYTES)]];
    let place = |arbitration| {
        let config = NetworkConfig { arbitration, ..roomy(Topology::Crossbar) };
        let got = Case::new(config, orders.clone(), 1).settle().got;
        got[0].iter().position(|(_, item)| item[0] == 2).unwrap()
    };
    // Zero and one have had their turns.
    assert_eq!(place(Arbitration::RoundRobin), 8);
    // Sixteen came before, two in the same cycle.
    let oldest = place(Arbitration::OldestFirst);
    assert!((16..=18).contains(&oldest), "{oldest}");
}
