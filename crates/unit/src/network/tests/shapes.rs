//! Links and tables, without time.

use std::collections::BTreeSet;

use super::kit::{ALL, config, hops};
use crate::network::topology::{End, Plan};
use crate::network::{MAX_ENDS, Names, NetworkConfig, NetworkPlan, Topology};
use sim::Wiring;

/// Senders and receivers of the shapes tried here.
fn sizes() -> impl Iterator<Item = (usize, usize)> {
    let some = [1, 2, 3, 4, 5, 6, 7, 8, 11, 16, 17, 31, 64];
    some.into_iter().flat_map(move |senders| some.into_iter().map(move |receivers| (senders, receivers)))
}

#[test]
fn every_way_is_the_shortest_and_no_link_is_on_none() {
    for (senders, receivers) in sizes() {
        for topology in ALL.into_iter().filter(|&topology| topology != Topology::PointToPoint) {
            // The others have no radix.
            let radices = if topology == Topology::Butterfly { &[2, 4, 8][..] } else { &[2] };
            for &radix in radices {
                let config = NetworkConfig { radix, ..config(topology) };
                let plan = Plan::new(topology, radix, senders, receivers);
                let mut used = BTreeSet::new();
                for from in 0..senders {
                    for to in 0..receivers {
                        let way = plan.way(from, to);
                        assert_eq!(plan.links[way[way.len() - 1]].to, End::Receiver(to as u16));
                        let near = way.iter().filter(|&&link| plan.links[link].near).count();
                        let expected = hops(&config, senders, receivers, from, to);
                        assert_eq!((near as u64, (way.len() - near) as u64), expected, "{topology:?} {from} to {to}");
                        used.extend(way);
                    }
                }
                assert_eq!(used.len(), plan.links.len(), "{topology:?} of {senders} and {receivers}");
            }
        }
    }
}

/// Whether some link waits, over others, for itself.
fn is_cyclic(plan: &Plan, senders: usize, receivers: usize) -> bool {
    let mut waits = BTreeSet::new();
    for from in 0..senders {
        for to in 0..receivers {
            waits.extend(plan.way(from, to).windows(2).map(|pair| (pair[0], pair[1])));
        }
    }
    // Links that wait for nobody empty, and then nobody waits for them, until none is left.
    let mut left: BTreeSet<usize> = (0..plan.links.len()).collect();
    loop {
        let blocked: BTreeSet<usize> = waits.iter().filter(|(_, to)| left.contains(to)).map(|&(from, _)| from).collect();
        let next: BTreeSet<usize> = left.intersection(&blocked).copied().collect();
        if next.len() == left.len() {
            return !left.is_empty();
        }
        left = next;
    }
}

#[test]
fn links_wait_for_themselves_on_rings_only() {
    for (senders, receivers) in sizes() {
        for topology in [Topology::Bus, Topology::Crossbar, Topology::Mesh, Topology::Butterfly] {
            let plan = Plan::new(topology, 2, senders, receivers);
            assert!(!is_cyclic(&plan, senders, receivers), "{topology:?} of {senders} and {receivers}");
        }
    }
    // The ring is why bubbles are there. Of four nodes up, the even ones go halfway round one way and the odd ones the other.
    for (nodes, cyclic) in [(1, false), (2, false), (3, false), (4, false), (5, true), (8, true), (64, true)] {
        assert_eq!(is_cyclic(&Plan::new(Topology::Ring, 2, nodes, nodes), nodes, nodes), cyclic, "{nodes} nodes");
    }
}

#[test]
fn only_what_comes_from_the_node_itself_leaves_a_bubble() {
    let plan = Plan::new(Topology::Ring, 2, 8, 8);
    for router in &plan.routers {
        let own = router.inputs.iter().position(|&link| matches!(plan.links[link].from, End::Sender(_))).unwrap();
        assert_eq!(router.through, Some(0b111 & !(1 << own)));
    }
    for topology in [Topology::Bus, Topology::Crossbar, Topology::Mesh, Topology::Butterfly] {
        assert!(Plan::new(topology, 2, 8, 8).routers.iter().all(|router| router.through.is_none()), "{topology:?}");
    }
}

#[test]
fn networks_of_no_ends_or_too_many_are_refused() {
    for (senders, receivers) in [(0, 1), (1, 0), (MAX_ENDS + 1, 1), (1, MAX_ENDS + 1)] {
        for topology in ALL {
            let plan = NetworkPlan::declare(&config(topology), Names::SORT, senders, receivers, &mut Wiring::new());
            let message = plan.expect_err("refused").to_string();
            assert!(message.contains("there must be 1 to 64"), "{message}");
        }
    }
}
