//! One sender, one receiver: latency, width, places.

use super::kit::{ALL, Case, Order, RigResult, Taste, config, hops};
use crate::network::{NetworkConfig, Topology};
use num::Cycle;

/// Cycles of a parcel on an empty network: the latency of each link, and of the cycles that its bytes take all but the first.
fn unloaded(config: &NetworkConfig, senders: usize, receivers: usize, pair: (usize, usize), bytes: u32) -> Cycle {
    let (near, far) = hops(config, senders, receivers, pair.0, pair.1);
    let more = Cycle::from(bytes.div_ceil(config.link_bytes) - 1);
    near * (1 + more) + far * (Cycle::from(config.link_latency) + more)
}

/// Orders of one sender among several.
fn only(senders: usize, sender: usize, orders: Vec<Order>) -> Vec<Vec<Order>> {
    let mut all = vec![Vec::new(); senders];
    all[sender] = orders;
    all
}

#[test]
fn an_empty_network_takes_the_hops() {
    for topology in ALL {
        for (senders, receivers) in [(1, 1), (2, 3), (5, 5), (8, 2), (3, 11), (16, 16)] {
            for (bytes, link_bytes) in [(4, 16), (16, 16), (40, 16), (144, 32)] {
                let config = NetworkConfig { link_bytes, ..config(topology) };
                for sender in [0, senders / 2, senders - 1] {
                    let takes = |to| unloaded(&config, senders, receivers, (sender, to), bytes);
                    // Each parcel is sent when the one before has arrived.
                    let apart = 1 + (0..receivers).map(takes).max().expect("a receiver");
                    let orders = (0..receivers).map(|to| Order::new(apart * to as Cycle, to, bytes)).collect();
                    let case = Case::new(config.clone(), only(senders, sender, orders), receivers);
                    let outcome = case.settle();
                    for (to, got) in outcome.got.iter().enumerate() {
                        let expected = apart * to as Cycle + takes(to);
                        assert_eq!(got.len(), 1);
                        assert_eq!(got[0].0, expected, "{topology:?} {sender} to {to} of {senders} and {receivers}");
                    }
                }
            }
        }
    }
}

/// The last of eight senders sends to the first of eight receivers, which takes one in `rest` cycles and starts at `start`.
fn stream(config: &NetworkConfig, count: usize, bytes: u32, rest: Cycle, start: Cycle) -> RigResult {
    let orders = only(8, 7, vec![Order::new(0, 0, bytes); count]);
    let mut case = Case::new(config.clone(), orders, 8);
    case.sinks[0] = (Taste::Any, rest, start);
    case.settle()
}

#[test]
fn a_stream_takes_the_width_of_a_link() {
    for topology in ALL {
        for bytes in [16, 24, 64] {
            let config = NetworkConfig { queue: 16, ..config(topology) };
            let got = &stream(&config, 100, bytes, 0, 0).got[0];
            // Of parcels that do not fill whole cycles the last may end in a cycle's first half.
            let expected = (99 * Cycle::from(bytes)).div_ceil(16);
            assert!((expected - 1..=expected).contains(&(got[99].0 - got[0].0)), "{topology:?} {bytes}: {got:?}");
        }
    }
}

#[test]
fn one_place_carries_one_parcel_a_round_trip() {
    for topology in ALL {
        for credit_latency in [2, 5, 9] {
            let config = NetworkConfig { receive_queue: 1, credit_latency, ..config(topology) };
            let outcome = stream(&config, 5, 16, 0, 0);
            let way = unloaded(&config, 8, 8, (7, 0), 16);
            // A channel's slot is free a cycle after it was emptied.
            let back = if topology == Topology::PointToPoint { 1 } else { Cycle::from(credit_latency) };
            let sent: Vec<Cycle> = (0..5).map(|n| n * (way + back)).collect();
            assert_eq!(outcome.sent[7], sent, "{topology:?}");
            let pairs = (0..8).flat_map(|from| (0..8).map(move |to| (from, to)));
            let longest = pairs.map(|pair| unloaded(&config, 8, 8, pair, 16)).max().unwrap();
            assert_eq!(Cycle::from(config.round_trip(8, 8)), longest + back, "{topology:?}");
        }
    }
}

#[test]
fn places_for_a_round_trip_and_a_third_carry_a_parcel_a_cycle() {
    for topology in ALL {
        // The longest way of each: halfway round, from corner to corner.
        let (from, to) = if topology == Topology::Ring { (0, 4) } else { (0, 7) };
        let busy = |receive_queue| {
            let config = NetworkConfig { receive_queue, ..config(topology) };
            let case = Case::new(config, only(8, from, vec![Order::new(0, to, 16); 200]), 8);
            let sent = case.settle().sent[from].clone();
            sent[199] - sent[0] > 199
        };
        let round_trip = config(topology).round_trip(8, 8);
        assert!(!busy(round_trip + round_trip.div_ceil(3)), "{topology:?}");
        assert!(busy(round_trip - 1), "{topology:?}");
    }
}

#[test]
fn a_receiver_that_takes_nothing_has_places_for_so_many_and_the_sender_waits() {
    for topology in ALL {
        for receive_queue in [1, 3, 7, 20] {
            let config = NetworkConfig { receive_queue, ..config(topology) };
            let outcome = stream(&config, 50, 16, 0, 1000);
            let before = outcome.sent[7].iter().filter(|&&at| at < 1000).count();
            assert_eq!(before, receive_queue as usize, "{topology:?}");
            // All that has come is taken at once when it starts.
            assert!(outcome.got[0][..receive_queue as usize].iter().all(|&(at, _)| at == 1000), "{topology:?}");
        }
    }
}

#[test]
fn a_slow_receiver_sets_the_pace() {
    for topology in ALL {
        let got = &stream(&config(topology), 60, 16, 7, 0).got[0];
        assert!(got.windows(2).all(|pair| pair[1].0 - pair[0].0 == 7), "{topology:?}: {got:?}");
    }
}

#[test]
fn a_receiver_that_is_not_served_does_not_hold_up_the_others() {
    for topology in ALL {
        // Receiver 1 starts late. Sender 0 has as much for it as it has places; sender 2 has something for all others.
        let mut orders = vec![Vec::new(); 8];
        orders[0] = vec![Order::new(0, 1, 16); 32];
        orders[2] = (0..80).map(|n| Order::new(0, [0, 2, 3, 4][n % 4], 16)).collect();
        let mut case = Case::new(config(topology), orders, 8);
        case.sinks[1] = (Taste::Any, 0, 3000);
        let outcome = case.settle();
        let others = [0, 2, 3, 4].map(|receiver| outcome.got[receiver].iter().map(|&(at, _)| at).max().unwrap());
        assert!(others.into_iter().all(|at| at < 300), "{topology:?}: {others:?}");
        assert!(outcome.got[1].iter().all(|&(at, _)| at == 3000), "{topology:?}");
    }
}

#[test]
fn credits_that_wait_for_their_link_are_added_up() {
    // Sixteen receivers give one sender places back in every cycle, over a link that tells of one receiver per cycle.
    let orders = vec![vec![Order { at: 0, to: None, bytes: 1 }; 60]];
    let case = Case::new(NetworkConfig { receive_queue: 3, ..config(Topology::Bus) }, orders, 16);
    let outcome = case.settle();
    let told = outcome.tree.number("channels.sort_credit[0].items").unwrap();
    let freed: f64 = (0..16).map(|r| outcome.tree.number(&format!("channels.sort_freed[{r}].items")).unwrap()).sum();
    assert!(told < freed && freed <= 60.0 * 16.0, "{told} of {freed}");
    // None is lost: there are three places to the end.
    assert!(outcome.sent[0].chunks(3).all(|burst| burst[2] - burst[0] <= 2), "{:?}", outcome.sent);
}
