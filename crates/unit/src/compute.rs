//! Compute dispatch: makes warps of workgroups and gives each workgroup to a core.

use super::card::Card;
use super::token::{Ack, Kind, Piece, WarpToken};
use super::warp::Item;
use gfx::stage::Stage;
use knob::Allowed;
use sim::{In, Out, Tick, Unit, Wires};
use work::Service;

knob::knobs! {
    /// Compute dispatch.
    pub struct ComputeConfig {
        /// Warps made per cycle.
        warps_per_cycle: u32 ["warps/cycle", Allowed::Range(1, 16), "assumed: a workgroup of 64 per cycle and a warp width of 32 take two"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Rate, advice: []},
        /// Warps queued before each core.
        queue: u32 ["warps", Allowed::Range(2, 256), "assumed: two: one arriving, one waiting"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Cycles from here to a core.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed: as the fragment dispatch"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Latency, advice: []},
    }
}

/// Ports of compute dispatch.
#[derive(Clone)]
pub struct ComputePorts {
    /// Runs of workgroups from the command processor.
    pub input: In<Piece>,
    /// To each core, with its cluster of warps.
    pub cores: Vec<(usize, Out<WarpToken>)>,
    /// Warps that each core has finished; the token's warp is the run's slot.
    pub finished: Vec<In<WarpToken>>,
    /// Runs that are done, to the command processor.
    pub ack: Out<Ack>,
}

/// Compute dispatch. Its items are warps.
#[derive(Clone)]
pub struct Compute {
    config: ComputeConfig,
    width: u32,
    /// Warps that a core holds.
    warps: u32,
    ports: ComputePorts,
    /// Group and warp of the run at the head.
    group: u32,
    warp: u32,
    /// Running number of the workgroup being made.
    number: u32,
    /// The core that takes the workgroup being made.
    core: Option<usize>,
    /// Warps on each core.
    load: Vec<u32>,
    /// Warps in flight of each slot's run, and whether all of them have been made.
    in_flight: Vec<u32>,
    complete: Vec<bool>,
    items: u64,
}

/// Bits of a warp's number that name the slot of its run; the rest tells workgroups apart.
const SLOT_BITS: u32 = 8;

/// Slots of runs of workgroups.
pub const SLOTS: usize = 1 << SLOT_BITS;

impl Compute {
    /// An idle compute dispatch unit, for cores that hold `warps` warps of `width` invocations.
    pub fn new(config: ComputeConfig, width: u32, warps: u32, slots: usize, ports: ComputePorts) -> Compute {
        assert!(slots <= SLOTS, "runs of workgroups have at most {SLOTS} slots");
        Compute {
            config,
            width,
            warps,
            group: 0,
            warp: 0,
            number: 0,
            core: None,
            load: vec![0; ports.cores.len()],
            in_flight: vec![0; slots],
            complete: vec![false; slots],
            items: 0,
            ports,
        }
    }
}

impl Unit<Card> for Compute {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;

        // 1. Warps that are done.
        for (core, finished) in self.ports.finished.iter().enumerate() {
            while let Some(token) = wires.pop(finished) {
                self.load[core] -= 1;
                self.in_flight[(token.warp as usize) % SLOTS] -= 1;
                did = Tick::Moved;
            }
        }

        // 2. Runs that are done.
        for slot in 0..self.in_flight.len() {
            if self.complete[slot] && self.in_flight[slot] == 0 {
                if !wires.try_push(&self.ports.ack, Ack { slot: slot as u16, kind: Kind::DATA }) {
                    return did.or(Tick::Blocked);
                }
                self.complete[slot] = false;
                did = Tick::Moved;
            }
        }

        // 3. Make warps of the next workgroup.
        let mut budget = self.config.warps_per_cycle;
        while let Some(piece) = wires.front(&self.ports.input) {
            let Card { compute, warps, .. } = card;
            let work = compute[usize::from(piece.slot)].as_ref().expect("a run is in flight");
            let invocations = work.dispatch.invocations.max(1);
            let siblings = invocations.div_ceil(self.width);
            let packets = invocations.div_ceil(4);
            if self.group == work.groups.groups {
                self.group = 0;
                self.complete[usize::from(piece.slot)] = true;
                wires.pop(&self.ports.input);
                did = Tick::Moved;
                continue;
            }
            if budget == 0 {
                return Tick::Moved;
            }
            // The core with the least to do takes the workgroup, if that is little enough.
            let core = match self.core {
                Some(core) => core,
                None => {
                    let (core, &load) = self.load.iter().enumerate().min_by_key(|&(_, &load)| load).expect("there are cores");
                    if load > 0 && load + siblings > self.warps {
                        return did.or(Tick::Blocked);
                    }
                    core
                }
            };
            let (cluster, output) = &self.ports.cores[core];
            if !wires.can_push(output) {
                return did.or(Tick::Blocked);
            }
            let number = self.number << SLOT_BITS | u32::from(piece.slot);
            let index = warps[*cluster].insert(Stage::Compute, piece.slot, work.dispatch.shape.registers);
            let warp = &mut warps[*cluster][index];
            (warp.number, warp.siblings, warp.shared_bytes) = (number, siblings, work.dispatch.shared_bytes);
            let first = self.group * packets + self.warp * (self.width / 4);
            let count = (self.width / 4).min(packets - self.warp * (self.width / 4));
            for packet in &work.groups.packets[first as usize..][..count as usize] {
                let mut item = Item::new(0, packet.first_request, packet.cost);
                item.next[Service::Shared] = packet.first_shared;
                warp.items.push(item);
            }
            warp.merge(|_| &work.groups.invocations.costs);
            wires.push(output, WarpToken { warp: index });
            budget -= 1;
            self.items += 1;
            self.load[core] += 1;
            self.in_flight[usize::from(piece.slot)] += 1;
            self.core = Some(core);
            self.warp += 1;
            if self.warp == siblings {
                self.warp = 0;
                self.core = None;
                self.group += 1;
                self.number = self.number.wrapping_add(1);
            }
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.in_flight.iter().map(|&n| u64::from(n)).sum()
    }
}
