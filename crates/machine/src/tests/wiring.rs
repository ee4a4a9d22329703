//! The channels of a machine against its configuration.

use crate::{Config, Machine};
use knob::Allowed;
use num::Random;
use sim::{Link, Wire};

/// The key of the queue that a channel is, if it is a knob; all others must be long enough whatever the knobs say.
fn key(channel: &str) -> Option<&'static str> {
    Some(match channel {
        "vertex_warps" => "fetch.queue",
        "primitives" => "assembly.queue",
        "triangles" => "clip.queue",
        "sorted" => "network.receive_queue",
        "set_up" => "setup.queue",
        "rasterized" => "traverse.queue",
        "depth_bounds" => "traverse.hierarchical_queue",
        "tested_early" | "tested_late" => "depth.output_queue",
        "interpolated" => "interpolate.queue",
        "fragment_warps" => "dispatch.queue",
        "to_late_test" | "shaded" => "dispatch.output_queue",
        "compute_warps" => "compute.queue",
        "memory_requests" | "memory_answers" => "memory.port_queue",
        _ => return None,
    })
}

/// Whether a channel can carry its full width in every cycle: a place is taken for `latency` cycles, and for one more until the producer may
/// fill it again.
fn sustains_width(link: &Link) -> bool {
    let items = if link.by_bytes { 1 } else { link.width };
    u64::from(link.capacity) >= u64::from(items) * (u64::from(link.latency) + 1)
}

#[test]
fn every_channel_that_cannot_carry_its_width_is_warned_of() {
    let mut generator = Random::new(5);
    let mut random = |bound: u64| u64::from(generator.below(bound as u32));
    let (mut short, mut fine) = (0, 0);
    for _ in 0..60 {
        // Queues, latencies and rates at random.
        let mut config = Config::built_in("four-pipelines").unwrap();
        for (section, knobs) in Config::built_in("four-pipelines").unwrap().sections() {
            for knob in knobs.knobs() {
                let shapes = ["queue", "latency", "per_cycle", "width", "quads", "batches"];
                if let Allowed::Range(low, high) = knob.allowed
                    && shapes.iter().any(|shape| knob.name.contains(shape))
                    // Its watermarks lie within it.
                    && knob.name != "write_queue"
                {
                    let value = (low + random(24)).min(high);
                    config.set(&format!("{section}.{}={value}", knob.name)).unwrap();
                }
            }
        }
        if config.check().is_err() {
            continue;
        }
        let warnings = config.warnings();
        let machine = Machine::new(&config).unwrap();
        for Wire { name, index, link, .. } in machine.wires() {
            match key(name) {
                _ if sustains_width(&link) => fine += 1,
                Some(key) => {
                    assert!(
                        warnings.iter().any(|warning| warning.starts_with(&format!("{key} is {}:", link.capacity))),
                        "{key}: {warnings:?}"
                    );
                    short += 1;
                }
                None => panic!("{name}[{index}] cannot carry its width: {link:?}"),
            }
        }
    }
    assert!(short > 100 && fine > 1000, "{short} short, {fine} long enough");
}
