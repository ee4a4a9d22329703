//! Compute dispatch: warps of workgroups, and the choice of a core.

use std::sync::Arc;

use super::kit::{Echo, FREE, Sink, TokenSource, settle};
use super::scenery::{card, step};
use crate::Card;
use crate::card::ComputeWork;
use crate::compute::{Compute, ComputeConfig, ComputePorts};
use crate::token::{Ack, Kind, Piece, WarpToken};
use num::Cycle;
use sim::{One, Unit, Wiring};
use work::*;

sim::circuit! {
    struct ComputeCircuit for Card {
        source: One<TokenSource<Piece>>,
        compute: One<Compute>,
        core: Vec<Echo<WarpToken>>,
        ack: One<Sink<Ack>>,
    }
}

/// A core gives a warp up and names the workgroup that it belongs to.
fn finish(token: WarpToken, card: &mut Card) -> WarpToken {
    let number = card.warps[0][token.warp].number;
    card.warps[0].remove(token.warp);
    WarpToken { warp: number }
}

/// When warps came to each core, and when runs of workgroups were reported done.
type Computed = (Vec<Vec<Cycle>>, Vec<(Cycle, u16)>);

/// Runs several runs of workgroups of `invocations` invocations on cores that hold four warps of 32 invocations. `runs` has the number of
/// workgroups of each run, `cores` the cycles that each core takes for a warp.
fn computed(rate: u32, cores: &[Cycle], runs: &[u32], invocations: u32) -> Computed {
    settle(
        || {
            let mut wiring = Wiring::new();
            let ids = [wiring.unit("source", 0), wiring.unit("compute", 0)];
            let core_ids = wiring.bank("core", cores.len());
            let ack_id = wiring.unit("ack", 0);
            let (output, input) = wiring.channel("in", 0, FREE, ids[0], ids[1]);
            let (mut to_cores, mut finished, mut core) = (Vec::new(), Vec::new(), Vec::new());
            for (index, (&id, &time)) in core_ids.iter().zip(cores).enumerate() {
                let (to, at_core) = wiring.channel("warps", index, FREE, ids[1], id);
                let (back, from_core) = wiring.channel("done", index, FREE, id, ids[1]);
                to_cores.push((0, to));
                finished.push(from_core);
                core.push(Echo::answering(time, finish, at_core, back));
            }
            let (ack, acked) = wiring.channel("ack", 0, FREE, ids[1], ack_id);
            let mut card = card(1);
            let dispatch = Arc::new(Dispatch {
                number: 0,
                label: String::new(),
                shape: ShaderShape::default(),
                groups: 0,
                invocations,
                shared_bytes: 0,
                reach: Default::default(),
                programs: Programs::default(),
            });
            let mut pieces = Vec::new();
            for (slot, &groups) in runs.iter().enumerate() {
                let packets =
                    vec![Packet { cost: 0, first_request: 0, first_shared: 0 }; (groups * invocations.div_ceil(4)) as usize];
                let costs = CostTable::from(vec![Cost::from(vec![step([1, 0, 0, 0, 0], RequestKind::End)])]);
                let groups = Groups { groups, packets, invocations: costs.into(), ..Groups::default() };
                card.compute[slot] = Some(ComputeWork { dispatch: dispatch.clone(), groups: Arc::new(groups), epoch: 0 });
                pieces.push((0, Piece { slot: slot as u16, kind: Kind::DATA }));
            }
            let config = ComputeConfig { warps_per_cycle: rate, queue: 64, latency: 1, ..ComputeConfig::default() };
            let ports = ComputePorts { input, cores: to_cores, finished, ack };
            let circuit = ComputeCircuit::new(
                wiring,
                One(TokenSource::new(pieces, output)),
                One(Compute::new(config, 32, 4, 4, ports)),
                core,
                One(Sink::new(acked)),
            );
            (circuit, card)
        },
        |c, _| c.ack.got.len() == runs.len(),
        |c, card| {
            assert_eq!((c.compute.resident(), card.warps[0].len()), (0, 0));
            let warps: u32 = runs.iter().map(|groups| groups * invocations.div_ceil(32)).sum();
            assert_eq!(c.compute.items(), u64::from(warps));
            (c.core.iter().map(Echo::times).collect(), c.ack.log(|ack| ack.slot))
        },
    )
}

#[test]
fn warps_are_made_at_the_rate() {
    // Two workgroups of two warps, from cycle 1 on; a cycle on the way. The last is done 10 later, seen a cycle after that, and
    // reported, a cycle on the way.
    for (rate, times) in [(1, [2, 3, 4, 5]), (2, [2, 2, 3, 3]), (4, [2, 2, 2, 2])] {
        let (cores, acks) = computed(rate, &[10], &[2], 64);
        assert_eq!(cores, [times], "{rate} a cycle");
        assert_eq!(acks, [(times[3] + 10 + 1 + 1, 0)], "{rate} a cycle");
    }
    // A workgroup of 65 invocations is three warps.
    assert_eq!(computed(4, &[10], &[1], 65).0, [[2, 2, 2]]);
}

#[test]
fn the_core_with_the_least_to_do_takes_a_workgroup_if_it_has_room() {
    // Three workgroups of two warps: one core, the other, and the first again, which has room for four.
    assert_eq!(computed(2, &[10, 10], &[3], 64).0, [vec![2, 2, 4, 4], vec![3, 3]]);
    // Five: the fifth waits until a core has two warps fewer. The first two are seen done in 2 + 10 + 1.
    assert_eq!(computed(2, &[10, 10], &[5], 64).0, [vec![2, 2, 4, 4, 14, 14], vec![3, 3, 5, 5]]);
    // One that a core cannot hold at once is given to a core that has nothing to do, where it runs in turns.
    assert_eq!(computed(8, &[10], &[1], 32 * 6).0, [[2; 6]]);
}

#[test]
fn runs_are_reported_as_each_is_done() {
    // The second run of one workgroup goes to the fast core and is done long before the first.
    let (cores, acks) = computed(2, &[50, 5], &[1, 1], 64);
    assert_eq!(cores, [[2, 2], [3, 3]]);
    assert_eq!(acks, [(3 + 5 + 1 + 1, 1), (2 + 50 + 1 + 1, 0)]);
    // A run without workgroups is done at once.
    assert_eq!(computed(2, &[50], &[0], 64).1, [(2 + 1, 0)]);
}
