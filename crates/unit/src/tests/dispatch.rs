//! Fragment dispatch: packing of warps, and their order after shading.

use std::sync::Arc;

use super::kit::{Echo, FREE, Sink, TokenSource, settle};
use super::scenery::{card, draw, draw_with, group, mark, row_of_tiles};
use crate::Card;
use crate::dispatch::{Dispatch, DispatchConfig, DispatchPorts, Outlet};
use crate::token::{GroupToken, Kind, Packing, WarpToken};
use num::Cycle;
use sim::{Circuit, One, StallProbe, Unit, Wiring};
use work::Funnel;

sim::circuit! {
    struct DispatchCircuit for Card {
        source: One<TokenSource<GroupToken>>,
        dispatch: One<Dispatch>,
        core: Vec<Echo<WarpToken>>,
        begun: Option<Sink<Packing>>,
        late: One<Sink<GroupToken>>,
        color: One<Sink<GroupToken>>,
    }
}

fn config() -> DispatchConfig {
    DispatchConfig {
        quads_per_cycle: 4,
        interval: 1,
        reorder: 64,
        patience: 16,
        queue: 64,
        latency: 1,
        output_quads: 4,
        output_latency: 1,
        output_queue: 64,
        ..DispatchConfig::default()
    }
}

/// The results of the unit.
#[derive(Debug, PartialEq)]
struct Dispatched {
    /// When warps came to each core.
    cores: Vec<Vec<Cycle>>,
    /// When groups came to the colour unit and to the late test: sequence number and quads.
    color: Vec<(Cycle, (Kind, u32, u8))>,
    late: Vec<(Cycle, (Kind, u32, u8))>,
    funnel: Funnel,
    /// When it told vertex fetch of its quads: core and state.
    begun: Vec<(Cycle, (u16, u16))>,
}

/// Dispatches groups, given as cycle, slot and quads, to cores that take so long for a warp of 32 invocations: eight quads. A mark
/// comes at the end. Slot 1 is a draw that is tested late.
fn dispatched(config: &DispatchConfig, cores: &[Cycle], groups: &[(Cycle, u16, u8)]) -> Dispatched {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = [wiring.unit("source", 0), wiring.unit("dispatch", 0)];
            let core_ids = wiring.bank("core", cores.len());
            let begun_id = wiring.unit("begun", 0);
            let ends = [wiring.unit("late", 0), wiring.unit("color", 0)];
            let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (mut to_cores, mut shaded, mut core) = (Vec::new(), Vec::new(), Vec::new());
            for (index, (&id, &time)) in core_ids.iter().zip(cores).enumerate() {
                let (to, at_core) = wiring.channel("warps", index, FREE, ids[1], id);
                let (back, from_core) = wiring.channel("shaded", index, FREE, id, ids[1]);
                to_cores.push(to);
                shaded.push(from_core);
                core.push(Echo::new(time, at_core, back));
            }
            let (begun, at_begun) = wiring.channel("begun", 0, FREE, ids[1], begun_id);
            let (late, at_late) = wiring.channel("out", 0, FREE, ids[1], ends[0]);
            let (color, at_color) = wiring.channel("out", 1, FREE, ids[1], ends[1]);
            let mut card = card(1);
            let segment = Arc::new(row_of_tiles(1, 1, 16, 0));
            card.install(0, segment.clone(), Arc::new(draw()), 0);
            card.install(1, segment, Arc::new(draw_with(|state| state.early = false)), 1);
            let mut items = Vec::new();
            let mut last = 0;
            for &(at, slot, quads) in groups {
                items.push((at, group(&mut card, slot, 0, 0, quads)));
                last = at;
            }
            items.push((last + 1000, mark(Kind::SEGMENT, 0)));
            let ports = DispatchPorts {
                input,
                cores: to_cores,
                shaded,
                output: Outlet::Own { late, color },
                begun: Some(begun),
                probe: StallProbe::default(),
            };
            let circuit = DispatchCircuit::new(
                wiring,
                One(TokenSource::new(items, output)),
                One(Dispatch::new(config.clone(), 0, 32, ports)),
                core,
                Some(Sink::new(at_begun)),
                One(Sink::new(at_late)),
                One(Sink::new(at_color)),
            );
            (circuit, card)
        },
        |c, _| c.color.got.iter().any(|(_, token)| token.kind == Kind::SEGMENT) && c.wires().resident() == 0,
        |c, card| {
            assert_eq!((c.dispatch.items(), c.dispatch.resident()), (card.funnel.total().quads_shaded, 0));
            assert!(card.warps[0].is_empty());
            let of = |token: &GroupToken| (token.kind, token.sequence, token.quads);
            Dispatched {
                cores: c.core.iter().map(Echo::times).collect(),
                color: c.color.log(of),
                late: c.late.log(of),
                funnel: card.funnel.total(),
                begun: c.begun.as_ref().map_or(Vec::new(), |begun| begun.log(|token| (token.core, token.state))),
            }
        },
    )
}

#[test]
fn warps_fill_at_the_rate_and_start_when_they_are_full() {
    // Eight quads per warp. The first are packed in cycle 1; the warp starts in the cycle of its last, a cycle on the way.
    let groups = [(0, 0, 4); 6];
    for (rate, times) in [(1, [9, 17, 25]), (2, [5, 9, 13]), (4, [3, 5, 7]), (8, [2, 3, 4])] {
        let config = DispatchConfig { quads_per_cycle: rate, ..config() };
        let got = dispatched(&config, &[1], &groups);
        assert_eq!(got.cores, [times], "{rate} a cycle");
        assert_eq!((got.funnel.quads_shaded, got.funnel.fragments_shaded), (24, 96));
    }
    // A quad in two cycles: the eighth in 15.
    let half = DispatchConfig { quads_per_cycle: 1, interval: 2, ..config() };
    assert_eq!(dispatched(&half, &[1], &groups).cores, [[16, 32, 48]]);
    // Groups of 3: every warp but the last has parts of groups, which are parted.
    let got = dispatched(&config(), &[1], &[(0, 0, 3); 8]);
    assert_eq!(got.cores, [[3, 5, 7]]);
    assert_eq!(got.color.iter().filter(|(_, token)| token.0 == Kind::DATA).map(|(_, token)| token.2).sum::<u8>(), 24);
}

#[test]
fn a_warp_that_is_not_full_starts_when_patience_is_over() {
    // The last quads came in cycle 1; 16 cycles later the warp starts as it is.
    let got = dispatched(&config(), &[1], &[(0, 0, 4)]);
    assert_eq!(got.cores, [[1 + 16 + 1]]);
    // Quads that come in time begin the waiting anew.
    let got = dispatched(&config(), &[1], &[(0, 0, 2), (10, 0, 2)]);
    assert_eq!(got.cores, [[11 + 16 + 1]]);
    // Quads that come a cycle too late make another warp.
    let got = dispatched(&config(), &[1], &[(0, 0, 2), (17, 0, 2)]);
    assert_eq!(got.cores, [[18, 18 + 16 + 1]]);
}

#[test]
fn a_warp_has_one_state() {
    // The quads of another segment start the open warp at once.
    let got = dispatched(&config(), &[1], &[(0, 0, 2), (5, 1, 2)]);
    assert_eq!(got.cores, [[6 + 1, 6 + 16 + 1]]);
    // What is tested late goes to the depth unit, and all have one order.
    assert_eq!(got.late.iter().map(|(_, token)| *token).collect::<Vec<_>>(), [(Kind::DATA, 1, 2)]);
    assert_eq!(got.color.iter().map(|(_, token)| token.1).collect::<Vec<_>>(), [0, 2]);
}

#[test]
fn shaded_warps_leave_in_order() {
    // Two cores, the first slow. Warps 0 and 1 come to them in cycles 3 and 5, warp 2 to the first in 7. Warp 1 is shaded by cycle 16
    // and has to wait for warp 0: 3 + 40, and a cycle back. Both leave then, two groups each; warp 2 is not shaded before 7 + 40 + 1.
    let got = dispatched(&config(), &[40, 10], &[(0, 0, 4); 6]);
    assert_eq!(got.cores, [vec![3, 7], vec![5]]);
    // Vertex fetch learns of a warp's core in the cycle in which the warp comes there, and of quads that wait.
    let (first, started, waiting) = (Packing::STARTED | Packing::FIRST, Packing::STARTED, Packing::WAITING);
    let told = [(2, (0, waiting)), (3, (0, first)), (4, (1, waiting)), (5, (1, started)), (6, (0, waiting)), (7, (0, started))];
    assert_eq!(got.begun, told);
    let left: Vec<_> = got.color[..6].iter().map(|&(at, token)| (at, token.1)).collect();
    assert_eq!(left, [(45, 0), (45, 1), (45, 2), (45, 3), (49, 4), (49, 5)]);
}

#[test]
fn so_many_warps_are_under_way() {
    // Two places: the third warp is begun when the first has left, in the cycle in which it is seen shaded: 3 + 20 + 1.
    let config = DispatchConfig { reorder: 2, ..config() };
    let got = dispatched(&config, &[20], &[(0, 0, 4); 6]);
    assert_eq!(got.cores, [[3, 5, 24 + 1 + 1]]);
}

#[test]
fn quads_that_died_are_not_shaded_and_what_discards_is_counted() {
    let prepare = |quads: [u16; 4]| {
        let got = settle_with(quads);
        (got.quads_shaded, got.fragments_shaded, got.helper_fragments)
    };
    // Quads with 4, 0, 2 and 1 pixels alive: three are shaded; the rest of their invocations are helpers.
    assert_eq!(prepare([15, 0, 3, 8]), (3, 7, 5));
    assert_eq!(prepare([15, 15, 15, 15]), (4, 16, 0));
}

/// The funnel of one group whose quads have these pixels alive.
fn settle_with(live: [u16; 4]) -> Funnel {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = ["source", "dispatch", "core", "late", "color"].map(|name| wiring.unit(name, 0));
            let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (to, at_core) = wiring.channel("warps", 0, FREE, ids[1], ids[2]);
            let (back, from_core) = wiring.channel("shaded", 0, FREE, ids[2], ids[1]);
            let (late, at_late) = wiring.channel("out", 0, FREE, ids[1], ids[3]);
            let (color, at_color) = wiring.channel("out", 1, FREE, ids[1], ids[4]);
            let mut card = card(1);
            card.install(0, Arc::new(row_of_tiles(1, 1, 16, 0)), Arc::new(draw()), 0);
            let token = group(&mut card, 0, 0, 0, 4);
            card.groups[0][token.group].live = live;
            let ports = DispatchPorts {
                input,
                cores: vec![to],
                shaded: vec![from_core],
                output: Outlet::Own { late, color },
                begun: None,
                probe: StallProbe::default(),
            };
            let circuit = DispatchCircuit::new(
                wiring,
                One(TokenSource::new(vec![(0, token)], output)),
                One(Dispatch::new(config(), 0, 32, ports)),
                vec![Echo::new(1, at_core, back)],
                None,
                One(Sink::new(at_late)),
                One(Sink::new(at_color)),
            );
            (circuit, card)
        },
        |c, _| c.color.got.len() == 1,
        |_, card| card.funnel.total(),
    )
}
