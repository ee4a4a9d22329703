//! Circuits of a few units against their closed forms.

use anyhow::Result;

use crate::{Row, Section, Setting, Target};
use num::{Cycle, Random};
use sim::kit::{Item, Sink, Source, Worker};
use sim::{Circuit, Clock, Link, One, Wiring, run};

pub(super) const LITTLE: Target = Target {
    id: "little",
    section: Section::Exact,
    what: "The times that items spend in a channel, as they measure them, are the integral of its occupancy, as seen in every cycle, \
           and what the channel counts (random tandems of servers, queues and links; the suite's tests look at every channel of whole \
           machines)",
    bound: "exact",
    fault: "the look at every hundredth cycle is missed",
    check: little,
};

pub(super) const PIPELINE: Target = Target {
    id: "pipeline",
    section: Section::Exact,
    what: "A tandem of stages of s_j cycles takes n items in sum s_j + (n - 1) max s_j, whatever its buffers, beside the latency of its \
           hops",
    bound: "exact",
    fault: "the last hop takes a cycle longer",
    check: pipeline,
};

pub(super) const CREDIT: Target = Target {
    id: "credit",
    section: Section::Exact,
    what: "Throughput of a channel of B places, L cycles of latency, and a consumer that takes an item in S cycles: min(1, 1/S, B/RTT), \
           where RTT = L + 1",
    bound: "1e-3 of it",
    fault: "the channel has one place fewer",
    check: credit,
};

sim::circuit! {
    /// Servers one after the other.
    pub(super) struct Tandem for () {
        source: One<Source>,
        worker: Vec<Worker>,
        sink: One<Sink>,
    }
}

/// A row of servers that take `service` cycles each, with a link before each server and one behind the last.
pub(super) fn tandem(n: u64, service: &[Cycle], links: &[Link]) -> Tandem {
    let mut wiring = Wiring::new();
    let source = wiring.unit("source", 0);
    let worker = wiring.bank("worker", service.len());
    let sink = wiring.unit("sink", 0);
    let first = worker.first().copied().unwrap_or(sink);
    let (output, mut input) = wiring.channel::<Item>("hop", 0, links[0], source, first);
    let mut workers = Vec::new();
    for (stage, &service) in service.iter().enumerate() {
        let next = worker.get(stage + 1).copied().unwrap_or(sink);
        let (out, next_input) = wiring.channel("hop", stage + 1, links[stage + 1], worker[stage], next);
        workers.push(Worker::new(service, std::mem::replace(&mut input, next_input), out));
    }
    Tandem::new(wiring, One(Source::new(n, 1, output)), workers, One(Sink::new(1, input)))
}

/// Servers and links at random, none of which holds up a server of two cycles.
pub(super) fn at_random(random: &mut Random) -> (Vec<Cycle>, Vec<Link>) {
    let service: Vec<Cycle> = (0..1 + random.below(5)).map(|_| 2 + u64::from(random.below(9))).collect();
    let links = (0..=service.len())
        .map(|_| {
            let latency = 1 + random.below(4);
            Link::items((latency + 1).div_ceil(2) + random.below(4), 1, latency)
        })
        .collect();
    (service, links)
}

/// Cycles of a tandem from the first push to the end of the last item, beside its hops.
fn cycles(setting: &Setting, n: u64, service: &[Cycle], links: &[Link], clock: Clock) -> Result<u64> {
    let mut links = links.to_vec();
    if setting.inject_fault
        && let Some(last) = links.last_mut()
    {
        *last = Link::items(last.capacity + 1, 1, last.latency + 1);
    }
    let hops: Cycle = links.iter().map(|link| Cycle::from(link.latency)).sum::<Cycle>() - u64::from(setting.inject_fault);
    let mut machine = tandem(n, service, &links);
    run(&mut machine, &mut (), clock, 100_000, |m, _| m.sink.log.len() as u64 == n)?;
    // The cycle in which the last item arrives is over then.
    Ok(machine.wires().now() - hops - 1)
}

fn pipeline(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    for (latency, capacity) in [(1, 2), (1, 1), (3, 4), (2, 16)] {
        let links = [Link::items(capacity, 1, latency); 5];
        let measured = cycles(setting, 1000, &[3, 7, 2, 5], &links, Clock::SkipIdle)?;
        let case = format!("stages of 3, 7, 2, 5, 1000 items, latency {latency}, queues of {capacity}: cycles");
        rows.push(Row::exact(case, 7010.0, measured as f64));
    }
    let wrong = setting.pieces(setting.pick(40, 1000, 50_000), |_, random| -> Result<u64> {
        let (service, links) = at_random(random);
        let n = 1 + u64::from(random.below(200));
        let expected = service.iter().sum::<Cycle>() + (n - 1) * service.iter().max().copied().unwrap_or(0);
        Ok(u64::from(cycles(setting, n, &service, &links, Clock::SkipIdle)? != expected))
    });
    rows.push(Row::none("random tandems that take another time", wrong.into_iter().sum::<Result<u64>>()?));
    Ok(rows)
}

fn little(setting: &Setting) -> Result<Vec<Row>> {
    let sums = setting.pieces(setting.pick(20, 500, 20_000), |_, random| -> Result<(u64, u64, [u64; 2])> {
        let (service, links) = at_random(random);
        let n = 1 + u64::from(random.below(200));
        let mut machine = tandem(n, &service, &links);
        machine.sink.rest = u64::from(random.below(12));
        let mut seen = vec![0_u64; links.len()];
        // Asked before every cycle, and after the last.
        run(&mut machine, &mut (), Clock::EveryCycle, 100_000, |m, _| {
            if !setting.inject_fault || m.wires().now() % 100 != 99 {
                m.wires().fills().zip(&mut seen).for_each(|(fill, sum)| *sum += u64::from(fill));
            }
            m.sink.log.len() as u64 == n
        })?;
        let own = machine.worker.iter().map(|worker| worker.residence).chain([machine.sink.residence]);
        let counted = machine.reading().channels;
        let mut wrong = [0_u64; 2];
        let mut all = 0;
        for ((own, seen), counted) in own.zip(&seen).zip(&counted) {
            wrong[0] += u64::from(own != *seen);
            wrong[1] += u64::from(counted.occupancy != *seen);
            all += seen;
        }
        Ok((all, machine.worker.iter().map(|w| w.residence).sum::<u64>() + machine.sink.residence, wrong))
    });
    let sums = sums.into_iter().collect::<Result<Vec<_>>>()?;
    let sum = |of: fn(&(u64, u64, [u64; 2])) -> u64| sums.iter().map(of).sum::<u64>();
    Ok(vec![
        Row::exact("item cycles: as items measure them against as seen", sum(|s| s.0) as f64, sum(|s| s.1) as f64),
        Row::none("channels whose items measure another time than is seen", sum(|s| s.2[0])),
        Row::none("channels that count another time than is seen", sum(|s| s.2[1])),
    ])
}

/// Items per cycle through a channel, over whole rounds of credits.
fn throughput(setting: &Setting, capacity: u32, latency: u32, service: u32) -> Result<f64> {
    let (warm, rounds) = (u64::from(4 * (capacity + latency) * service), setting.pick(20, 50, 200));
    let window = u64::from(capacity * service) * rounds;
    let n = warm + window + 1;
    let places = if setting.inject_fault { capacity - 1 } else { capacity };
    let mut machine = tandem(n, &[], &[Link::items(places, 1, latency)]);
    machine.sink.rest = u64::from(service);
    run(&mut machine, &mut (), Clock::SkipIdle, 100_000, |m, _| m.sink.log.len() as u64 == n)?;
    let at = |item: u64| machine.sink.log[item as usize].0;
    Ok(window as f64 / (at(warm + window) - at(warm)) as f64)
}

fn credit(setting: &Setting) -> Result<Vec<Row>> {
    let formula = |b: u32, l: u32, s: u32| (f64::from(b) / (f64::from(l) + 1.0)).min(1.0 / f64::from(s));
    let mut rows = Vec::new();
    for latency in [1, 5, 13] {
        for service in [1, 3] {
            let mut worst: Option<Row> = None;
            for capacity in 2..setting.pick(8, 20, 20) {
                let expected = formula(capacity, latency, service);
                let measured = throughput(setting, capacity, latency, service)?;
                let case = format!("L = {latency}, S = {service}, B from 2 on: the worst");
                let row = Row::within(case, expected, measured, 1e-3 * expected);
                if worst.as_ref().is_none_or(|worst| row.error > worst.error) {
                    worst = Some(row);
                }
            }
            rows.extend(worst);
        }
    }
    let errors = setting.pieces(setting.pick(20, 300, 10_000), |_, random| -> Result<f64> {
        let [b, l, s] = [2 + random.below(32), 1 + random.below(32), 1 + random.below(4)];
        let expected = formula(b, l, s);
        Ok((throughput(setting, b, l, s)? / expected - 1.0).abs())
    });
    let errors = errors.into_iter().collect::<Result<Vec<f64>>>()?;
    rows.push(Row::at_most("random B, L, S: the largest relative error", errors.into_iter().fold(0.0, f64::max), 1e-3));
    Ok(rows)
}
