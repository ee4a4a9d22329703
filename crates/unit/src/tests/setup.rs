//! Triangle setup: its rate, and the order of sequence numbers.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw, row_of_tiles, triangle};
use crate::network::Receiver;
use crate::setup::{Setup, SetupConfig};
use crate::sorting::Keep;
use crate::token::{Kind, TriangleToken};
use num::Cycle;
use sim::{Link, One, StallProbe, Wiring};
use work::{End, Segment};

sim::circuit! {
    struct SetupCircuit for crate::Card {
        source: Vec<TokenSource<TriangleToken>>,
        setup: One<Setup>,
        sink: One<Sink<TriangleToken>>,
    }
}

/// When triangles come out of a setup unit whose geometry units send them as listed.
fn set_up(config: &SetupConfig, inputs: &[Vec<(Cycle, TriangleToken)>]) -> Vec<(Cycle, u32)> {
    set_up_of(config, inputs, None).0
}

/// The same where something is known of the triangles; and how many end in the unit.
fn set_up_of(
    config: &SetupConfig,
    inputs: &[Vec<(Cycle, TriangleToken)>],
    segment: Option<&Segment>,
) -> (Vec<(Cycle, u32)>, u64) {
    let ends = |token: &TriangleToken| segment.is_some_and(|s| s.triangles[token.triangle as usize].end == End::Setup);
    let wanted = inputs.iter().flatten().filter(|(_, token)| token.kind == Kind::DATA && !ends(token)).count();
    settle(
        || {
            let mut wiring = Wiring::new();
            let sources = wiring.bank("source", inputs.len());
            let (setup, sink) = (wiring.unit("setup", 0), wiring.unit("sink", 0));
            let (mut source, mut into) = (Vec::new(), Vec::new());
            for (index, items) in inputs.iter().enumerate() {
                let (output, input) = wiring.channel("in", index, FREE, sources[index], setup);
                source.push(TokenSource::new(items.clone(), output));
                into.push(input);
            }
            let link = Link::items(config.queue, config.triangles_per_cycle, config.latency);
            let (output, input) = wiring.channel("out", 0, link, setup, sink);
            let unit = Setup::new(config.clone(), Receiver::direct(into), false, Keep::Always, StallProbe::default(), output);
            let mut card = card(1);
            if let Some(segment) = segment {
                card.install(0, Arc::new(segment.clone()), Arc::new(draw()), 0);
            }
            (SetupCircuit::new(wiring, source, One(unit), One(Sink::new(input))), card)
        },
        |c, _| c.sink.got.len() == wanted,
        |c, _| (c.sink.log(|token| token.triangle), c.setup.found().ended),
    )
}

fn config() -> SetupConfig {
    SetupConfig { triangles_per_cycle: 1, interval: 1, latency: 10, queue: 16, ..SetupConfig::default() }
}

#[test]
fn a_triangle_takes_the_interval_and_the_latency() {
    let items: Vec<_> = (0..4).map(|t| (0, triangle(Kind::DATA, 0, t))).collect();
    // In the unit's hands from cycle 1; one every 3 cycles; 10 on the way.
    let slow = SetupConfig { interval: 3, ..config() };
    let inputs = [items];
    assert_eq!(set_up(&slow, &inputs), vec![(11, 0), (14, 1), (17, 2), (20, 3)]);
    let two = SetupConfig { triangles_per_cycle: 2, ..config() };
    assert_eq!(set_up(&two, &inputs), vec![(11, 0), (11, 1), (12, 2), (12, 3)]);
}

#[test]
fn a_triangle_that_ends_here_takes_its_time_and_no_place_behind() {
    let mut segment = row_of_tiles(1, 1, 1, 0);
    segment.triangles = vec![segment.triangles[0]; 4];
    for ended in [1, 2] {
        segment.triangles[ended].end = End::Setup;
    }
    let items: Vec<_> = (0..4).map(|t| (0, triangle(Kind::DATA, 0, t))).collect();
    let config = SetupConfig { interval: 3, ..config() };
    assert_eq!(set_up_of(&config, &[items], Some(&segment)), (vec![(11, 0), (20, 3)], 2));
}

#[test]
fn the_order_of_sequence_numbers_is_restored() {
    let inputs = [
        vec![(9, triangle(Kind::DATA, 0, 0)), (9, triangle(Kind::END, 0, 0)), (9, triangle(Kind::DATA, 2, 3))],
        vec![(0, triangle(Kind::DATA, 1, 1)), (0, triangle(Kind::DATA, 1, 2)), (5, triangle(Kind::END, 1, 0))],
    ];
    // Everything waits for sequence number 0, which comes late. Without the merge triangle 1 would be first.
    let config = SetupConfig { latency: 1, ..config() };
    assert_eq!(set_up(&config, &inputs), vec![(11, 0), (12, 1), (13, 2), (14, 3)]);
}

#[test]
fn a_full_queue_holds_setup_up() {
    // Two places and a latency of 5: two triangles in every 6 cycles, the places being free again in the cycle after the sink has
    // taken what was in them.
    let items: Vec<_> = (0..6).map(|t| (0, triangle(Kind::DATA, 0, t))).collect();
    let config = SetupConfig { latency: 5, queue: 2, ..config() };
    let times: Vec<_> = set_up(&config, &[items]).iter().map(|&(at, _)| at).collect();
    assert_eq!(times, [6, 7, 12, 13, 18, 19]);
}
