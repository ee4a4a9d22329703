//! Tandem queues against their closed form.

use super::units::{Item, Sink, Source, Worker};
use crate::num::Cycle;
use crate::sim::{Circuit, Clock, Link, One, Wiring, run};

crate::circuit! {
    struct Tandem for () {
        source: One<Source>,
        worker: Vec<Worker>,
        sink: One<Sink>,
    }
}

fn tandem(n: u64, service: &[Cycle], link: Link) -> Tandem {
    let mut wiring = Wiring::new();
    let source = wiring.unit("source", 0);
    let worker = wiring.bank("worker", service.len());
    let sink = wiring.unit("sink", 0);
    let (output, mut input) = wiring.channel::<Item>("hop", 0, link, source, worker[0]);
    let mut workers = Vec::new();
    for (stage, &service) in service.iter().enumerate() {
        let next = worker.get(stage + 1).copied().unwrap_or(sink);
        let (out, next_input) = wiring.channel("hop", stage + 1, link, worker[stage], next);
        workers.push(Worker::new(service, std::mem::replace(&mut input, next_input), out));
    }
    Tandem::new(wiring, One(Source::new(n, 1, output)), workers, One(Sink::new(1, input)))
}

/// T = sum s_j + (n - 1) max s_j, and one hop of latency before each stage and before the sink; the last item enters in its
/// cycle, so the count of cycles is one more.
#[test]
fn stages_of_3_7_2_and_5_cycles_take_7010_for_1000_items() {
    for clock in [Clock::SkipIdle, Clock::EveryCycle] {
        for (latency, capacity) in [(1, 2), (1, 1), (3, 4), (2, 16)] {
            let mut machine = tandem(1000, &[3, 7, 2, 5], Link::items(capacity, 1, latency));
            run(&mut machine, &mut (), clock, 1000, |m, _| m.sink.log.len() == 1000).unwrap();
            let hops = 5 * Cycle::from(latency);
            assert_eq!(machine.wires().now(), 7010 + hops + 1, "latency {latency}, capacity {capacity}");
        }
    }
}

#[test]
fn any_tandem_follows_the_closed_form_and_keeps_its_accounts() {
    let mut state = 7u64;
    let mut random = |bound: u64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 33) % bound
    };
    for _ in 0..50 {
        let service: Vec<Cycle> = (0..1 + random(5)).map(|_| 2 + random(9)).collect();
        let n = 1 + random(200);
        let latency = 1 + random(1) as u32;
        let mut machine = tandem(n, &service, Link::items(1 + random(4) as u32, 1, latency));
        run(&mut machine, &mut (), Clock::SkipIdle, 1000, |m, _| m.sink.log.len() as u64 == n).unwrap();
        let hops = (service.len() as u64 + 1) * Cycle::from(latency);
        let expected = service.iter().sum::<u64>() + (n - 1) * service.iter().max().unwrap() + hops + 1;
        assert_eq!(machine.wires().now(), expected, "{service:?}, n {n}");
        machine.wires_mut().settle();
        let reading = machine.wires().reading();
        for unit in &reading.units {
            assert_eq!(unit.total(), expected);
        }
        for (stage, worker) in machine.worker.iter().enumerate() {
            assert_eq!(worker.items, n, "conservation in stage {stage}");
            assert_eq!(worker.residence, reading.channels[stage].occupancy, "Little in channel {stage}");
            assert!(reading.units[1 + stage].busy >= n * service[stage]);
        }
    }
}

/// Doubling the speed of a stage that is not critical changes nothing for the worse; doubling the critical one gives
/// min(2, next bound).
#[test]
fn only_the_bottleneck_pays() {
    let cycles = |service: &[Cycle]| {
        let mut machine = tandem(2000, service, Link::items(4, 1, 1));
        run(&mut machine, &mut (), Clock::SkipIdle, 1000, |m, _| m.sink.log.len() == 2000).unwrap();
        machine.wires().now() as f64
    };
    let base = cycles(&[4, 12, 8, 2]);
    for other in [[2, 12, 8, 2], [4, 12, 4, 2], [4, 12, 8, 1]] {
        let faster = cycles(&other);
        assert!(faster <= base && faster > 0.99 * base, "{other:?}: {faster} of {base}");
    }
    let gain = base / cycles(&[4, 6, 8, 2]);
    assert!((gain / (12.0 / 8.0) - 1.0).abs() < 0.02, "{gain}");
    let gain = base / cycles(&[4, 6, 5, 2]);
    assert!((gain / 2.0 - 1.0).abs() < 0.02, "{gain}");
}

/// Bernoulli arrivals, one server of S cycles: the wait before service is rho (S - 1) / (2 (1 - rho)) cycles.
#[test]
fn one_server_queues_as_the_formula_says() {
    for (service, rho) in [(4u64, 0.3), (4, 0.6), (10, 0.5), (10, 0.8)] {
        let n = 400_000u64;
        let p = rho / service as f64;
        let mut state = 0x9e37_79b9_7f4a_7c15u64;
        let mut uniform = || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 11) as f64 / (1u64 << 53) as f64
        };
        let mut machine = tandem(0, &[service], Link::items(4096, 1, 1));
        let mut arrived = 0;
        // The arrivals drive the source from outside: an item is due in this cycle or it is not.
        while (machine.sink.log.len() as u64) < n {
            if arrived < n && uniform() < p {
                machine.source.n += 1;
                arrived += 1;
            }
            machine.cycle::<true>(&mut ());
            let now = machine.wires().now();
            machine.wires_mut().advance(now + 1);
        }
        // An item that finds the server free still spends the hop's one cycle in the channel.
        let wait = machine.worker[0].residence as f64 / n as f64 - 1.0;
        let expected = rho * (service - 1) as f64 / (2.0 * (1.0 - rho));
        assert!((wait / expected - 1.0).abs() < 0.02, "S {service}, rho {rho}: {wait} instead of {expected}");
    }
}
