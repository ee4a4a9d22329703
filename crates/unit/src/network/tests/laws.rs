//! Laws of every network under any traffic: no token is lost, order is kept, no sender gets stuck, and every clock gives the same.

use super::kit::{ALL, Case, Order, Taste, config, hops, is_over};
use crate::network::{Arbitration, LinkCounts, NetworkConfig, Topology};
use num::{Cycle, Random};
use sim::kit::{permutations, step};
use sim::{Circuit, Clock};

/// The orders of every sender: `count` tokens for random receivers.
fn random_orders(senders: usize, receivers: usize, count: usize, seed: u64) -> Vec<Vec<Order>> {
    let mut random = Random::new(seed);
    let order =
        |random: &mut Random| Order::new(0, random.below(receivers as u32) as usize, [4, 16, 24, 60][random.below(4) as usize]);
    (0..senders).map(|_| (0..count).map(|_| order(&mut random)).collect()).collect()
}

/// Receivers that take tokens in one order of all tokens of the network, which is random but for the order of each sender. Some know whose
/// token comes next, some look for it.
fn in_global_order(orders: &[Vec<Order>], receivers: usize, seed: u64) -> Vec<(Taste, Cycle, Cycle)> {
    let mut random = Random::new(seed);
    let mut next = vec![0; orders.len()];
    let mut tastes = vec![Vec::new(); receivers];
    for _ in 0..orders.iter().map(Vec::len).sum() {
        let mut sender = random.below(orders.len() as u32) as usize;
        while next[sender] == orders[sender].len() {
            sender = (sender + 1) % orders.len();
        }
        let to = orders[sender][next[sender]].to.expect("one receiver");
        tastes[to].push(sender);
        next[sender] += 1;
    }
    let taste = |order| if random.below(2) == 0 { Taste::Order(order) } else { Taste::Sought(order) };
    let tastes: Vec<Taste> = tastes.into_iter().map(taste).collect();
    tastes.into_iter().map(|taste| (taste, Cycle::from(random.below(4)), 0)).collect()
}

/// Queues as short as they may be.
fn tight(topology: Topology, receive_queue: u32) -> NetworkConfig {
    NetworkConfig { queue: 2, receive_queue, link_latency: 1, credit_latency: 2, ..config(topology) }
}

#[test]
fn saturated_networks_with_receivers_that_wait_for_an_order_never_get_stuck() {
    for topology in ALL {
        for nodes in [1, 2, 3, 5, 8, 16, 64] {
            for (receive_queue, seed) in [(1, 1), (2, 2), (32, 3)] {
                let orders = random_orders(nodes, nodes, 400 / nodes + 20, seed);
                let sinks = in_global_order(&orders, nodes, seed);
                let case = Case { config: tight(topology, receive_queue), orders, sinks };
                case.check(&case.run(Clock::SkipIdle));
            }
        }
    }
}

#[test]
fn full_rings_turn() {
    // Everyone sends to who is nearly halfway round, as fast as links take it; all slots fill.
    for nodes in [5, 8, 9, 16, 64] {
        for (queue, receive_queue) in [(2, 64), (3, 8), (4, 64)] {
            let apart = (nodes - 1) / 2;
            let orders = (0..nodes).map(|from| vec![Order::new(0, (from + apart) % nodes, 16); 300]).collect();
            let config = NetworkConfig { queue, receive_queue, ..config(Topology::Ring) };
            let case = Case::new(config, orders, nodes);
            case.check(&case.run(Clock::SkipIdle));
        }
    }
}

#[test]
fn all_clocks_agree_whatever_the_network() {
    for topology in ALL {
        for (senders, receivers) in [(1, 1), (2, 5), (5, 2), (7, 7), (16, 4)] {
            for seed in 0..4 {
                let orders = random_orders(senders, receivers, 40, seed);
                let sinks = match seed % 2 {
                    0 => vec![(Taste::Any, seed, 0); receivers],
                    _ => in_global_order(&orders, receivers, seed),
                };
                let arbitration = [Arbitration::RoundRobin, Arbitration::OldestFirst][seed as usize / 2];
                let config = match seed {
                    0 | 3 => tight(topology, 3),
                    _ => config(topology),
                };
                Case { config: NetworkConfig { arbitration, ..config }, orders, sinks }.settle();
            }
        }
    }
}

#[test]
fn all_orders_of_ticks_give_one_outcome() {
    // Up to six units, 720 orders.
    for (topology, senders, receivers) in [
        (Topology::PointToPoint, 2, 2),
        (Topology::Bus, 1, 2),
        (Topology::Crossbar, 2, 2),
        (Topology::Ring, 1, 2),
        (Topology::Mesh, 2, 1),
        (Topology::Butterfly, 2, 2),
    ] {
        let orders = random_orders(senders, receivers, 8, 5);
        let sinks = in_global_order(&orders, receivers, 6);
        let case = Case { config: tight(topology, 2), orders, sinks };
        let expected = case.settle();
        let (rig, _) = case.build();
        for order in permutations(rig.tally().0.len()) {
            let (mut rig, map) = case.build();
            while !is_over(&rig) {
                step(&mut rig, &order, &mut ());
                assert!(rig.wires().now() < 2000, "{topology:?} {order:?}: stuck");
            }
            assert_eq!(super::kit::RigResult::of(rig, &map), expected, "{topology:?} {order:?}");
        }
    }
}

#[test]
fn a_unit_is_not_busy_because_something_else_arrives() {
    // Sender 1's tokens come in cycles 30 to 39, and sender 0's, which all must wait for, from cycle 100 on.
    for topology in ALL {
        let orders = vec![vec![Order::new(100, 0, 16); 10], vec![Order::new(30, 0, 16); 10]];
        let mut case = Case::new(config(topology), orders, 2);
        case.sinks[0] = (Taste::Order([vec![0; 10], vec![1; 10]].concat()), 0, 0);
        let outcome = case.settle();
        let mut cycles: Vec<Cycle> = outcome.got[0].iter().map(|&(at, _)| at).collect();
        cycles.dedup();
        assert_eq!(outcome.tree.number("units.sink[0].busy"), Some(cycles.len() as f64), "{topology:?}");
        assert!(cycles[0] > 100 && cycles.len() <= 11, "{topology:?}: {cycles:?}");
    }
}

#[test]
fn links_count_what_the_hops_carry() {
    for topology in ALL {
        for (senders, receivers) in [(1, 1), (3, 8), (8, 8), (16, 5), (13, 13)] {
            let config = config(topology);
            let orders = random_orders(senders, receivers, 50, 9);
            let (mut items, mut bytes) = (0, 0);
            for (from, orders) in orders.iter().enumerate() {
                for order in orders {
                    let (near, far) = hops(&config, senders, receivers, from, order.to.unwrap());
                    items += near + far;
                    bytes += (near + far) * u64::from(order.bytes);
                }
            }
            let traffic = Case::new(config, orders, receivers).run(Clock::SkipIdle).traffic;
            assert_eq!(
                traffic.carried,
                LinkCounts { hops: items, link_bytes: bytes },
                "{topology:?} of {senders} and {receivers}"
            );
        }
    }
}

#[test]
fn an_unbuilt_link_has_no_traffic_and_an_empty_run_no_hot_spot() {
    let case = Case::new(config(Topology::Mesh), vec![Vec::new(); 4], 4);
    let (rig, map) = case.build();
    let traffic = map.traffic(&rig.tree(), 0);
    assert_eq!((traffic.carried, traffic.mean, traffic.hottest), (LinkCounts::default(), 0.0, 0.0));
    assert_eq!(traffic.hot_spot, "");
    // Four nodes in a square: four links between them each way round, and one in and out of each.
    assert_eq!(traffic.links, 8 + 8);
}
