//! The order at a ROP: which quads wait for which ends.

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw, group, mark, row_of_tiles};
use crate::Card;
use crate::network::Receiver;
use crate::order::Order;
use crate::sorting::Keep;
use crate::token::{GroupToken, Kind};
use num::Cycle;
use sim::{One, StallProbe, Wiring};
use std::sync::Arc;

sim::circuit! {
    struct OrderCircuit for Card {
        source: Vec<TokenSource<GroupToken>>,
        order: One<Order>,
        late: One<Sink<GroupToken>>,
        color: One<Sink<GroupToken>>,
    }
}

/// When a group of number 1 that a second pipeline sends in cycle 0 leaves, if the pipelines send these marks of number 0.
fn leaves(marks: [Option<(Cycle, Kind)>; 2]) -> Cycle {
    settle(
        || {
            let mut wiring = Wiring::new();
            let sources = wiring.bank("source", 2);
            let ids = ["order", "late", "color"].map(|name| wiring.unit(name, 0));
            let mut card = card(1);
            card.install(0, Arc::new(row_of_tiles(1, 1, 4, 0)), Arc::new(draw()), 0);
            let quads = GroupToken { sequence: 1, ..group(&mut card, 0, 0, 0, 4) };
            let (mut inputs, mut source) = (Vec::new(), Vec::new());
            for (n, id) in sources.into_iter().enumerate() {
                let (output, input) = wiring.channel("in", n, FREE, id, ids[0]);
                let marks = marks[n].map(|(at, kind)| (at, mark(kind, 0)));
                let quads = (n == 1).then_some((marks.map_or(0, |(at, _)| at), quads));
                source.push(TokenSource::new(marks.into_iter().chain(quads).collect(), output));
                inputs.push(input);
            }
            let (late, tested) = wiring.channel("late", 0, FREE, ids[0], ids[1]);
            let (color, shaded) = wiring.channel("color", 0, FREE, ids[0], ids[2]);
            let probe = StallProbe::default();
            let unit = Order::new(0, 4, Keep::Always, probe, Receiver::direct(inputs), late, color);
            (OrderCircuit::new(wiring, source, One(unit), One(Sink::new(tested)), One(Sink::new(shaded))), card)
        },
        |c, _| c.color.got.len() == 1,
        |c, _| c.color.got[0].0,
    )
}

#[test]
fn a_number_that_all_pipelines_draw_ends_with_its_last_part() {
    // Any pipeline may send the single end of a number. It is seen a cycle later, and is a cycle on the way.
    assert_eq!(leaves([Some((20, Kind::END)), None]), 22);
    assert_eq!(leaves([None, Some((5, Kind::END))]), 7);
    // Of two parts both.
    assert_eq!(leaves([Some((20, Kind::PART_END)), Some((5, Kind::PART_END))]), 22);
    assert_eq!(leaves([Some((5, Kind::PART_END)), Some((20, Kind::PART_END))]), 22);
}
