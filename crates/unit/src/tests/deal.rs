//! Dealing: how large batches are, who gets them, and what all pipelines get.

use std::sync::Arc;

use super::kit::{FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw, primitive, row_of_tiles};
use crate::Card;
use crate::assembly::{AssemblyConfig, Deal as Policy};
use crate::deal::Deal;
use crate::sorting::Keep;
use crate::token::{Kind, Piece, Run};
use num::Cycle;
use sim::{Link, One, Wiring};
use work::{Funnel, PrimitiveOutcome, Segment};

sim::circuit! {
    struct DealCircuit for Card {
        source: One<TokenSource<Piece>>,
        deal: One<Deal>,
        sink: Vec<Sink<Run>>,
    }
}

/// Primitives of one triangle each, with square bounding boxes of these edges.
fn squares(edges: &[u16]) -> Segment {
    let mut segment = row_of_tiles(1, 1, 4, 0);
    let triangle = segment.triangles[0];
    segment.triangles =
        (0..).zip(edges).map(|(n, &edge)| work::Triangle { primitive: n, pixels: [0, 0, edge, edge], ..triangle }).collect();
    segment.stream = vec![0; 3 * edges.len()];
    segment.primitives = (0..edges.len() as u32).map(|n| primitive(3 * n + 3, n, 1, false, PrimitiveOutcome::Drawn)).collect();
    segment
}

/// When a pipeline gets what: the kind, the number, the first primitive and how many.
type Got = (Cycle, u16, u32, u32, u32);

/// The items of a segment and the fence behind it that three pipelines get, the primitives that all of them draw, and the counts.
fn dealt(config: &AssemblyConfig, most: Option<u32>, segment: &Segment) -> (Vec<Vec<Got>>, Vec<bool>, Funnel) {
    settle(
        || {
            let mut wiring = Wiring::new();
            let (a, b) = (wiring.unit("source", 0), wiring.unit("deal", 0));
            let (output, input) = wiring.channel("in", 0, FREE, a, b);
            let (mut outputs, mut sinks) = (Vec::new(), Vec::new());
            for (index, id) in wiring.bank("sink", 3).into_iter().enumerate() {
                // As in machines: one run per cycle to each.
                let (out, input) = wiring.channel("out", index, Link::items(64, 1, 1), b, id);
                outputs.push(out);
                sinks.push(Sink::new(input));
            }
            let mut card = card(3);
            card.install(0, Arc::new(segment.clone()), Arc::new(draw()), 0);
            let pieces = vec![(0, Piece { slot: 0, kind: Kind::DATA }), (0, Piece { slot: 0, kind: Kind::SEGMENT })];
            let unit = Deal::new(config, Keep::Always, true, most, input, outputs);
            (DealCircuit::new(wiring, One(TokenSource::new(pieces, output)), One(unit), sinks), card)
        },
        |c, _| c.sink.iter().all(|sink| sink.got.last().is_some_and(|(_, run)| run.kind == Kind::SEGMENT)),
        |c, card| {
            let got = |sink: &Sink<Run>| -> Vec<Got> {
                sink.got.iter().map(|&(at, run)| (at, run.kind.0, run.sequence, run.first, run.count)).collect()
            };
            (c.sink.iter().map(got).collect(), card.work(0).shared.clone(), card.funnel.total())
        },
    )
}

fn config(batch: u32) -> AssemblyConfig {
    AssemblyConfig { deal: Policy::Turn, batch, by_size: true, ..AssemblyConfig::default() }
}

const DATA: u16 = Kind::DATA.0;
const END: u16 = Kind::END.0;
const PART_END: u16 = Kind::PART_END.0;
const FENCE: u16 = Kind::SEGMENT.0;

#[test]
fn batches_end_by_primitives_or_by_size() {
    // A box of 16x16 pixels is expected to make 1 + 256 / 32 = 9 groups of quads: two of them are 18, three are 27.
    let segment = squares(&[16; 5]);
    let two = vec![
        vec![(2, DATA, 0, 0, 2), (3, END, 0, 0, 0), (5, FENCE, 3, 0, 0)],
        vec![(3, DATA, 1, 2, 2), (4, END, 1, 0, 0), (5, FENCE, 3, 0, 0)],
        vec![(4, DATA, 2, 4, 1), (5, END, 2, 0, 0), (6, FENCE, 3, 0, 0)],
    ];
    for (config, most) in [(config(32), Some(18)), (config(32), Some(26)), (config(2), None), (config(2), Some(1000))] {
        assert_eq!(dealt(&config, most, &segment), (two.clone(), Vec::new(), Funnel::default()), "{most:?}");
    }
    // Off, or with one run for each pipeline, size does not matter.
    let off = AssemblyConfig { by_size: false, ..config(32) };
    let all = vec![
        vec![(2, DATA, 0, 0, 5), (3, END, 0, 0, 0), (4, FENCE, 1, 0, 0)],
        vec![(3, FENCE, 1, 0, 0)],
        vec![(3, FENCE, 1, 0, 0)],
    ];
    assert_eq!(dealt(&off, Some(18), &segment).0, all);
}

#[test]
fn what_is_too_large_for_one_goes_to_all_with_one_number() {
    // Boxes of 64x64 pixels are 129 groups.
    let (got, shared, funnel) = dealt(&config(32), Some(18), &squares(&[16, 64, 64, 16]));
    let all = [(3, DATA, 1, 1, 2), (4, PART_END, 1, 0, 0)];
    // The first batch goes to pipeline 0, the second to all, a cycle later to pipeline 0, whose link the mark of the first has; the third, as
    // soon as all have the mark of the second, to pipeline 2.
    assert_eq!(
        got[0],
        [&[(2, DATA, 0, 0, 1), (3, END, 0, 0, 0)][..], &[(4, DATA, 1, 1, 2), (5, PART_END, 1, 0, 0)], &[(6, FENCE, 3, 0, 0)]]
            .concat()
    );
    assert_eq!(got[1], [&all[..], &[(6, FENCE, 3, 0, 0)]].concat());
    assert_eq!(got[2], [&all[..], &[(5, DATA, 2, 3, 1), (6, END, 2, 0, 0), (7, FENCE, 3, 0, 0)]].concat());
    assert_eq!(shared, [false, true, true, false]);
    // Each of the two is counted once, wherever it is drawn, and so are the vertices of the whole segment.
    assert_eq!((funnel.vertices_in, funnel.primitives_in, funnel.triangles_setup), (12, 2, 2));
}
