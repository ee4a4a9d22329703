//! The bus, where one transfer reaches all.

use super::kit::{ALL, Case, Order, Taste, config};
use crate::network::{Names, NetworkConfig, NetworkPlan, Topology};
use num::Cycle;
use sim::Wiring;

#[test]
fn one_transfer_reaches_all() {
    for receivers in [1, 2, 5, 64] {
        let orders = vec![vec![Order { at: 0, to: None, bytes: 32 }; 10], vec![Order { at: 0, to: None, bytes: 32 }; 10]];
        let outcome = Case::new(config(Topology::Bus), orders, receivers).settle();
        assert_eq!(outcome.tree.number("channels.sort_link[0].bytes"), Some(20.0 * 32.0), "once for all");
        for receiver in 0..receivers {
            // Two cycles each on a bus of 16 bytes per cycle; 1 + 3 + 1 cycles and one more on each of three links.
            let times: Vec<Cycle> = outcome.got[receiver].iter().map(|&(at, _)| at).collect();
            assert_eq!(times, (0..20).map(|n| 8 + 2 * n).collect::<Vec<_>>(), "{receivers} receivers");
            let bytes = outcome.tree.number(&format!("channels.sort_out[{receiver}].bytes"));
            assert_eq!(bytes, Some(20.0 * 32.0));
        }
    }
}

#[test]
fn all_must_have_a_place() {
    // Receiver 1 takes nothing before cycle 500, and has three places.
    let orders = vec![vec![Order { at: 0, to: None, bytes: 4 }; 10]];
    let config = NetworkConfig { receive_queue: 3, ..config(Topology::Bus) };
    let mut case = Case::new(config, orders, 3);
    case.sinks[1] = (Taste::Any, 0, 500);
    let outcome = case.settle();
    assert_eq!(outcome.sent[0].iter().filter(|&&at| at < 500).count(), 3);
    assert_eq!(outcome.got[0].iter().filter(|&&(at, _)| at < 500).count(), 3);
}

#[test]
fn tokens_for_all_and_for_one_keep_their_order() {
    let orders = (0..6).map(|sender| {
        let to = |n: usize| if (n + sender).is_multiple_of(3) { None } else { Some((n * 5 + sender) % 4) };
        (0..60).map(|n| Order { at: 0, to: to(n), bytes: 4 + 12 * (n as u32 % 3) }).collect()
    });
    let case = Case {
        config: NetworkConfig { queue: 2, receive_queue: 2, ..config(Topology::Bus) },
        orders: orders.collect(),
        sinks: (0..4).map(|receiver| (Taste::Any, receiver, 0)).collect(),
    };
    case.settle();
}

#[test]
fn copies_that_weigh_nothing_ride_along() {
    // To three of four receivers: one copy weighs, and two do not. A transfer per cycle goes on behind them.
    let orders = (0..30).map(|n| Order::new(0, n % 3, if n % 3 == 0 { 16 } else { 0 })).collect();
    let outcome = Case::new(NetworkConfig { queue: 64, ..config(Topology::Bus) }, vec![orders], 4).settle();
    assert_eq!(outcome.tree.number("channels.sort_link[0].bytes"), Some(160.0));
    assert!(outcome.last() <= 5 + 10, "{}", outcome.last());
}

#[test]
fn only_a_bus_is_shared() {
    for topology in ALL {
        let mut wiring = Wiring::new();
        let ends = wiring.bank("end", 2);
        let plan = NetworkPlan::declare(&config(topology), Names::SORT, 2, 2, &mut wiring).unwrap();
        let network = plan.connect::<[u32; 2]>(&mut wiring, &ends, &ends);
        assert!(network.senders.iter().all(|sender| sender.is_shared() == (topology == Topology::Bus)), "{topology:?}");
        assert!(network.senders.iter().all(|sender| sender.receivers() == 2));
        assert!(network.receivers.iter().all(|receiver| receiver.senders() == 2));
    }
}
