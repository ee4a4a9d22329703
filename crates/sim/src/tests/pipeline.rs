//! Tandem queues against their closed form.

use super::units::{Item, Sink, Source, Worker};
use crate::{Circuit, Clock, Link, One, Wiring, run};
use num::{Cycle, Random};

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
        let mut random = Random::new(1);
        let mut uniform = || f64::from(random.unit());
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
