//! Interpolation: a quad with more words takes more intervals.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw_with, group, row_of_tiles};
use crate::Card;
use crate::interpolate::{Interpolate, InterpolateConfig};
use crate::token::GroupToken;
use gfx::stage::Stage;
use num::Cycle;
use sim::{One, Wiring};
use work::ShaderShape;

sim::circuit! {
    struct InterpolateCircuit for Card {
        source: One<TokenSource<GroupToken>>,
        interpolate: One<Interpolate>,
        sink: One<Sink<GroupToken>>,
    }
}

/// When groups of `quads` quads leave, at 2 quads of 4 words in an interval.
fn interpolated(quads: u8, words: u32, interval: u32) -> Vec<Cycle> {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = [wiring.unit("source", 0), wiring.unit("interpolate", 0), wiring.unit("sink", 0)];
            let (output, into) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (out, input) = wiring.channel("out", 0, FREE, ids[1], ids[2]);
            let mut card = card(1);
            let shape = ShaderShape { registers: 16, inputs: words, outputs: 4 };
            let draw = draw_with(|state| state.shapes[Stage::Fragment] = Some(shape));
            card.install(0, Arc::new(row_of_tiles(1, 1, 4, 0)), Arc::new(draw), 0);
            let items = (0..6).map(|_| (0, group(&mut card, 0, 0, 0, quads))).collect();
            let config = InterpolateConfig {
                quads_per_cycle: 2,
                interval,
                words_per_cycle: 4,
                latency: 1,
                queue: 64,
                skip_varyings: true,
                ..InterpolateConfig::default()
            };
            let unit = One(Interpolate::new(config, into, out));
            (InterpolateCircuit::new(wiring, One(TokenSource::new(items, output)), unit, One(Sink::new(input))), card)
        },
        |c, _| c.sink.got.len() == 6,
        |c, _| c.sink.times(),
    )
}

#[test]
fn a_quad_takes_a_turn_for_every_so_many_words() {
    // Groups of 4 quads at 2 quads per cycle: 2 cycles per group with 4 words or fewer, 4 with 5, 6 with 9 to 12.
    for (words, cycles) in [(0, 2), (4, 2), (5, 4), (12, 6)] {
        assert_eq!(interpolated(4, words, 1), (0..6).map(|n| 2 + n * cycles).collect::<Vec<_>>(), "{words} words");
    }
    // Groups of 3: a turn is left over every other time, and the next group begins in it.
    assert_eq!(interpolated(3, 4, 1), [2, 3, 5, 6, 8, 9]);
    // Two quads in three cycles: six cycles per group.
    assert_eq!(interpolated(4, 4, 3), (0..6).map(|n| 2 + 6 * n).collect::<Vec<_>>());
}
