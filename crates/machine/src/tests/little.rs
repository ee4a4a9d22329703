//! Little's law and the other counts of channels, against a look at every channel in every cycle.

use crate::{Config, Machine};
use num::Cycle;

use sim::{Circuit, Clock};
use trace::Trace;
use work::{Event, RenderKey};

pub(super) fn rendered(name: &str, key: RenderKey) -> Vec<Event> {
    rendered_trace(&Trace::open(format!("{}/../../traces/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap(), key)
}

/// The work of a trace.
pub(super) fn rendered_trace(trace: &Trace, key: RenderKey) -> Vec<Event> {
    let mut events = Vec::new();
    let mut keep = |event| {
        events.push(event);
        Ok(())
    };
    render::render(trace, &render::Options { record: true, key, ..render::Options::default() }, &mut keep).unwrap();
    events
}

/// What was seen of a channel.
#[derive(Clone, Copy, Default)]
struct Seen {
    /// Items inside at the start of each cycle, summed.
    occupancy: u64,
    /// Cycles that began with the channel full.
    full: u64,
    /// Items inside at the start of the last cycle.
    last: u32,
    /// Items that must have come in: growth from cycle to cycle.
    grown: u64,
    most: u32,
}

/// The sum of the times that items spend in a channel is what the channel counts as they come and go; the integral of what is inside is
/// what is seen here from outside. In a run that begins and ends empty they are the same.
fn the_counts_are_what_is_seen(config: &Config, events: &[Event]) {
    let mut machine = Machine::new(config).unwrap();
    machine.card.events.extend(events.iter().cloned());
    machine.card.closed = true;
    let links: Vec<_> = machine.wires().map(|wire| (wire.name, wire.index, wire.link)).collect();
    let mut seen = vec![Seen::default(); links.len()];
    let mut looked: Cycle = 0;
    loop {
        machine.circuit.wires_mut().wake_all();
        sim::run(&mut machine.circuit, &mut machine.card, Clock::EveryCycle, 100_000, |circuit, card| {
            // Asked before every cycle: once for each number of cycles gone by.
            if circuit.wires().now() == looked {
                looked += 1;
                for ((seen, fill), (_, _, link)) in seen.iter_mut().zip(circuit.wires().fills()).zip(&links) {
                    seen.occupancy += u64::from(fill);
                    seen.full += u64::from(fill == link.capacity);
                    seen.grown += u64::from(fill.saturating_sub(seen.last));
                    seen.most = seen.most.max(fill);
                    seen.last = fill;
                }
            }
            circuit.command.frame_over() || card.events.is_empty() && circuit.command.idle() && super::super::quiet(circuit)
        })
        .unwrap();
        if machine.circuit.command.frame_over() {
            machine.circuit.command.take_frame();
        } else {
            break;
        }
    }
    machine.empty().unwrap();
    let reading = machine.circuit.reading();
    assert_eq!(looked, reading.cycle + 1, "every cycle was looked at");
    let mut busy = 0;
    for ((seen, counts), (name, index, link)) in seen.iter().zip(&reading.channels).zip(&links) {
        assert_eq!(counts.occupancy, seen.occupancy, "item cycles of {name}[{index}] on {}", config.name);
        assert_eq!(counts.full_cycles, seen.full, "full cycles of {name}[{index}] on {}", config.name);
        // Some items come in the cycle in which others leave.
        assert!(counts.items >= seen.grown, "{name}[{index}]");
        assert_eq!(counts.items == 0, seen.most == 0, "{name}[{index}]");
        assert!(seen.most <= link.capacity, "{name}[{index}]");
        // Nothing is faster than the latency.
        assert!(counts.occupancy >= counts.items * u64::from(link.latency), "{name}[{index}]");
        busy += usize::from(counts.items > 0);
    }
    assert!(busy > 20, "{busy} channels carried something");
}

pub(super) fn config(name: &str, changes: &[&str]) -> Config {
    let mut config = Config::built_in(name).unwrap();
    for change in changes {
        config.set(change).unwrap();
    }
    config
}

#[test]
fn the_integral_of_occupancy_is_the_sum_of_residence_times_on_every_channel() {
    let triangle = rendered("triangle", RenderKey::default());
    the_counts_are_what_is_seen(&config("four-pipelines", &[]), &triangle);
    the_counts_are_what_is_seen(&config("tiny", &[]), &triangle);
    the_counts_are_what_is_seen(&config("attila", &[]), &triangle);
    let cube = rendered("cube", RenderKey::default());
    the_counts_are_what_is_seen(&config("four-pipelines", &[]), &cube);
    // Short queues, which are full much of the time.
    let short =
        ["traverse.queue=2", "depth.output_queue=2", "network.receive_queue=2", "memory.port_queue=2", "texture.queue=2"];
    the_counts_are_what_is_seen(&config("four-pipelines", &short), &cube);
    // Samples that are resolved, and workgroups over several frames.
    the_counts_are_what_is_seen(
        &config("four-pipelines", &["memory.kind=ideal"]),
        &rendered("spokes-msaa", RenderKey::default()),
    );
    the_counts_are_what_is_seen(&config("four-pipelines", &[]), &rendered("particles", RenderKey::default()));
}
