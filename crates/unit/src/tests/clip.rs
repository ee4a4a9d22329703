//! Clip and cull: the rate of tests, and what holds the clipper.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw, primitive};
use crate::Card;
use crate::clip::{Clip, ClipConfig};
use crate::token::{Kind, Run};
use num::Cycle;
use sim::{Link, One, Unit, Wiring};
use work::{Funnel, Primitive, PrimitiveOutcome, Segment};

sim::circuit! {
    struct ClipCircuit for Card {
        source: One<TokenSource<Run>>,
        clip: One<Clip>,
        sink: One<Sink<Run>>,
    }
}

/// When runs of survivors leave, with their first and number.
type Runs = Vec<(Cycle, (u32, u32))>;

/// What leaves a clipper of two primitives per cycle, up to `runs` runs, and what it has counted.
fn clipped(primitives: &[Primitive], runs: usize) -> (Runs, Funnel) {
    clipped_by(1, primitives, runs)
}

/// The same of two primitives in an interval.
fn clipped_by(interval: u32, primitives: &[Primitive], runs: usize) -> (Runs, Funnel) {
    let count = primitives.len() as u32;
    settle(
        || {
            let mut wiring = Wiring::new();
            let (a, b, c) = (wiring.unit("source", 0), wiring.unit("clip", 0), wiring.unit("sink", 0));
            let (output, into) = wiring.channel("in", 0, FREE, a, b);
            let (out, input) = wiring.channel("out", 0, Link::items(64, 1, 1), b, c);
            let mut card = card(1);
            let segment = Segment { primitives: primitives.to_vec(), ..Segment::default() };
            card.install(0, Arc::new(segment), Arc::new(draw()), 0);
            let items = vec![(0, Run { slot: 0, kind: Kind::DATA, sequence: 0, first: 0, count })];
            let config = ClipConfig {
                primitives_per_cycle: 2,
                interval,
                clip_cycles: 7,
                latency: 1,
                queue: 64,
                ..ClipConfig::default()
            };
            let (source, sink) = (One(TokenSource::new(items, output)), One(Sink::new(input)));
            (ClipCircuit::new(wiring, source, One(Clip::new(config, true, into, out)), sink), card)
        },
        |c, _| c.clip.items() == u64::from(count) && c.sink.got.len() == runs,
        |c, card| (c.sink.log(|run| (run.first, run.count)), card.funnel.total()),
    )
}

#[test]
fn so_many_are_tested_a_cycle_and_one_that_is_cut_holds_the_unit() {
    let kinds = [
        primitive(0, 0, 1, false, PrimitiveOutcome::Drawn),
        primitive(0, 1, 0, false, PrimitiveOutcome::Backface),
        primitive(0, 1, 2, true, PrimitiveOutcome::Drawn),
        primitive(0, 3, 1, false, PrimitiveOutcome::Drawn),
        primitive(0, 4, 0, false, PrimitiveOutcome::Frustum),
        primitive(0, 4, 0, false, PrimitiveOutcome::Degenerate),
    ];
    let (log, funnel) = clipped(&kinds, 3);
    // Cycle 1: one survivor, one culled. Cycle 2: the cut one, which holds the unit to 9. Then the rest.
    assert_eq!(log, vec![(2, (0, 1)), (3, (1, 2)), (10, (3, 1))]);
    assert_eq!((funnel.culled_backface, funnel.culled_frustum, funnel.culled_degenerate, funnel.clipped), (1, 1, 1, 1));
}

#[test]
fn rates_below_one_a_cycle_are_intervals() {
    let kinds = [0, 1, 2, 3, 4, 5].map(|n| primitive(0, n, 1, false, PrimitiveOutcome::Drawn));
    assert_eq!(clipped_by(1, &kinds, 3).0, [(2, (0, 2)), (3, (2, 2)), (4, (4, 2))]);
    assert_eq!(clipped_by(3, &kinds, 3).0, [(2, (0, 2)), (5, (2, 2)), (8, (4, 2))]);
}

#[test]
fn what_is_cut_away_holds_the_unit_and_is_not_drawn() {
    let outside = |cut_away| Primitive { cut_away, ..primitive(0, 0, 0, false, PrimitiveOutcome::Frustum) };
    for (cut_away, at) in [(false, 2), (true, 9)] {
        let kinds = [outside(cut_away), primitive(0, 0, 1, false, PrimitiveOutcome::Drawn)];
        let (log, funnel) = clipped(&kinds, 1);
        assert_eq!((log, funnel.culled_frustum, funnel.clipped), (vec![(at, (0, 1))], 1, 0));
    }
}

#[test]
fn what_is_culled_takes_its_turn() {
    // Seven culled primitives, two per cycle, before the one that is drawn: tested in cycle 4 with the last of them.
    let mut kinds = vec![primitive(0, 0, 0, false, PrimitiveOutcome::Scissor); 7];
    kinds.push(primitive(0, 0, 1, false, PrimitiveOutcome::Drawn));
    let (log, funnel) = clipped(&kinds, 1);
    assert_eq!((log, funnel.culled_scissor), (vec![(5, (0, 1))], 7));
}
