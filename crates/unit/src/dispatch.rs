//! Fragment dispatch, one unit per pipeline: packs quads into warps for the pipeline's cores, and puts what they have shaded back
//! into order.

use std::collections::VecDeque;

use super::card::{Card, Fault};
use super::network::{Sender, SenderCounts};
use super::sorting::SortCounts;
use super::token::fragments;
use super::token::{GroupToken, Kind, Packing, WarpToken, bytes};
use super::warp::Item;
use gfx::stage::Stage;
use knob::Allowed;
use num::{Cycle, prefetch};
use sim::{In, Out, StallProbe, Tick, Unit, Wires};
use work::QUAD_SHADED;

knob::knobs! {
    /// Packing of quads into warps, and their order after shading.
    pub struct DispatchConfig {
        /// Quads packed per cycle.
        quads_per_cycle: u32 ["quads/cycle", Allowed::Range(1, 16), "assumed: four; ATTILA: one (bGPU.ini FRAGMENTSHADER InputsPerCycle = 4 fragments)"]
            {estimate: Used, relax: Rate, advice: []},
        /// Cycles that packing `quads_per_cycle` quads takes, for rates below one quad per cycle.
        interval: u32 ["cycles", Allowed::Range(1, 64), "pipelined; 2 where a core shades two fragments per cycle (Mali-G57, Arm GPU Datasheet v7)"]
            {estimate: Used, relax: Never, advice: []},
        /// Warps between packing and leaving in order.
        reorder: u32 ["warps", Allowed::Range(1, 1024), "all warps of four multiprocessors (CUDA, compute capability 5.2: 64 each); ATTILA bGPU.ini ShadedStampQueueSize = 640 stamps, 80 warps of 8"]
            {estimate: RefusedUnless(AtLeast(32), "few warps between dispatch and ROPs"), relax: Room, advice: []},
        /// Cycles without a further quad after which a warp is started though it is not full.
        patience: u32 ["cycles", Allowed::Range(1, 4096), "assumed: short against a texture access, so that little is lost at the end of work"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Never, advice: []},
        /// Warps queued before each core.
        queue: u32 ["warps", Allowed::Range(2, 256), "assumed: two: one arriving, one waiting"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Cycles from here to a core.
        latency: u32 ["cycles", Allowed::Range(1, 64), "assumed: loading of input registers begins as the warp arrives"]
            {estimate: Used, relax: Latency, advice: []},
        /// Quads sent on to the ROP per cycle.
        output_quads: u32 ["quads/cycle", Allowed::Range(1, 16), "assumed: four; ATTILA: one (bGPU.ini FRAGMENTSHADER OutputsPerCycle = 4 fragments)"]
            {estimate: RefusedUnless(AtLeast(2), "a narrow way from cores to ROPs"), relax: Rate, advice: []},
        /// Cycles from here to the ROP.
        output_latency: u32 ["cycles", Allowed::Range(1, 64), "assumed; ATTILA bGPU.ini FRAGMENTSHADER OutputLatency = 11"]
            {estimate: Used, relax: Latency, advice: []},
        /// Groups of quads queued before the ROP.
        output_queue: u32 ["groups", Allowed::Range(2, 4096), "assumed; ATTILA bGPU.ini COLORWRITE InputQueueSize = 8, FetchQueueSize in the ROP"]
            {estimate: RefusedUnless(AtLeast(4), "short queues behind the cores"), relax: Room, advice: []},
    }
}

/// Ports of fragment dispatch.
#[derive(Clone)]
pub struct DispatchPorts {
    /// Interpolated quads.
    pub input: In<GroupToken>,
    /// To each core of the pipeline.
    pub cores: Vec<Out<WarpToken>>,
    /// Shaded warps from each core.
    pub shaded: Vec<In<WarpToken>>,
    /// Where shaded quads go.
    pub output: Outlet,
    /// The channel on which it reports the core of its quads, if batches of vertices follow them.
    pub begun: Option<Out<Packing>>,
    /// Its state is what the network makes the unit wait for.
    pub probe: StallProbe,
}

/// Where shaded quads go.
#[derive(Clone)]
pub enum Outlet {
    /// To the pipeline's own ROP.
    Own {
        /// Quads to be tested after shading, to the depth unit.
        late: Out<GroupToken>,
        /// Other quads, to the colour unit.
        color: Out<GroupToken>,
    },
    /// To the ROPs that own their pixels, where all tests are made.
    Owners(Sender<GroupToken>),
}

/// An entry of the order in which groups leave.
#[derive(Clone, Copy, Debug)]
enum DispatchOrder {
    Warp(u32),
    /// A mark, or quads that need no shading.
    Token(GroupToken),
}

/// Fragment dispatch. Its items are quads.
#[derive(Clone)]
pub struct Dispatch {
    config: DispatchConfig,
    pipeline: u8,
    /// The number of quads that a warp holds.
    quads: u32,
    ports: DispatchPorts,
    /// The warp being packed.
    open: Option<u32>,
    /// When the open warp is started even if it is not full.
    start_at: Cycle,
    /// When the next quads may be packed, where that has an interval.
    free_at: Cycle,
    order: VecDeque<DispatchOrder>,
    /// Groups of the warp at the head that have left.
    left: usize,
    /// ROPs that the current mark has still to be sent to.
    pending: u64,
    sequence: u32,
    sorting: SortCounts,
    core: usize,
    /// The state that was sent to vertex fetch last.
    told: u16,
    /// The slot of the last warp.
    slot: Option<u16>,
    items: u64,
}

impl Dispatch {
    /// An idle dispatch unit of pipeline `pipeline`, for warps of `width` invocations.
    pub fn new(config: DispatchConfig, pipeline: u8, width: u32, ports: DispatchPorts) -> Dispatch {
        let order = VecDeque::with_capacity(config.reorder as usize + 4);
        Dispatch {
            config,
            pipeline,
            quads: width / 4,
            ports,
            open: None,
            start_at: 0,
            free_at: 0,
            order,
            left: 0,
            pending: 0,
            sequence: 0,
            sorting: SortCounts::default(),
            core: 0,
            told: 0,
            slot: None,
            items: 0,
        }
    }

    /// The counters of what the unit has sent over the network.
    pub fn sorting(&self) -> SortCounts {
        self.sorting
    }

    /// The waits at the network, if the unit sends over one.
    pub fn waits(&self) -> SenderCounts {
        match &self.ports.output {
            Outlet::Own { .. } => SenderCounts::default(),
            Outlet::Owners(network) => network.counts(),
        }
    }

    /// Sends a mark on; false while it has still to wait.
    fn send_mark(&mut self, wires: &mut Wires, mark: GroupToken) -> bool {
        match &mut self.ports.output {
            Outlet::Own { color, .. } => {
                if !wires.can_push(color) {
                    return false;
                }
                wires.push_sized(color, GroupToken { sequence: self.sequence, ..mark }, bytes::MARK);
                self.sequence = self.sequence.wrapping_add(1);
                true
            }
            Outlet::Owners(network) => {
                if self.pending == 0 {
                    self.pending = u64::MAX >> (64 - network.receivers());
                }
                let mut left = self.pending;
                while left != 0 {
                    let to = left.trailing_zeros() as usize;
                    left &= left - 1;
                    if network.can_send(wires, to) {
                        network.send(wires, to, mark, bytes::MARK);
                        self.pending &= !(1 << to);
                        self.sorting.marks += 1;
                    }
                }
                self.pending == 0
            }
        }
    }

    /// Sends quads on; false while they have to wait. Of quads that were shaded, what the shader discarded is dropped.
    #[inline(always)]
    fn send(&mut self, wires: &mut Wires, card: &mut Card, token: GroupToken) -> bool {
        let Card { groups, work, funnel, passes, frame, .. } = card;
        let group = &mut groups[usize::from(token.pool)][token.group];
        let work = work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
        let room = match &mut self.ports.output {
            Outlet::Own { late, color } => wires.can_push(if work.early { color } else { late }),
            Outlet::Owners(network) => network.can_send(wires, usize::from(token.pool)),
        };
        if !room {
            return false;
        }
        let tile = &work.segment.tiles[group.tile as usize];
        let quads = &tile.quads[group.first as usize..];
        // The host is asked for the colours that will be blended in some cycles. No part of the model.
        let surface = passes.get(work.pass).and_then(|pass| pass.color.first().copied().flatten());
        if let (Some(surface), Some(first)) = (surface, quads.first()) {
            prefetch(&frame.stores[surface].quad(group.block, first.position)[0]);
            if let Some(word) = tile.payload.get(first.payload as usize) {
                prefetch(word);
            }
        }
        // A test that comes before the shader in API order is made before what the shader discards is dropped, wherever it is made.
        let tested_there = work.early && work.depth.is_some() && matches!(self.ports.output, Outlet::Owners(_));
        let keeps = work.draw.shades() && !tested_there;
        let (mut come, mut alive) = (0, 0);
        for (live, quad) in group.live[..usize::from(group.count)].iter_mut().zip(quads) {
            come += u32::from(*live != 0);
            if keeps && *live & !quad.kept != 0 {
                let shaded = fragments(*live);
                *live &= quad.kept;
                funnel[group.slot].fragments_discarded += u64::from(shaded - fragments(*live));
            }
            alive += u8::from(*live != 0);
        }
        let count = u32::from(group.count);
        let token = GroupToken { quads: alive, ..token };
        match &mut self.ports.output {
            Outlet::Own { late, color } => {
                let output = if work.early { color } else { late };
                wires.push_sized(output, GroupToken { sequence: self.sequence, ..token }, count * bytes::QUAD);
                self.sequence = self.sequence.wrapping_add(1);
            }
            Outlet::Owners(network) => {
                // Quads that an early test has thrown away are not among them.
                let size = come * (bytes::FRAGMENT_QUAD + 4 * u32::from(work.draw.payload_words));
                network.send(wires, usize::from(token.pool), token, size);
                self.sorting.sorted_items += u64::from(come);
                self.sorting.sent += u64::from(come);
                self.sorting.copy(come, size, token.pool != self.pipeline);
            }
        }
        true
    }

    /// Sends the groups of the head of the order on, if it is shaded.
    fn drain(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        if let Outlet::Owners(network) = &mut self.ports.output
            && network.poll(wires)
        {
            did = Tick::Moved;
        }
        while let Some(&entry) = self.order.front() {
            let index = match entry {
                DispatchOrder::Token(token) => {
                    let sent =
                        if token.kind == Kind::DATA { self.send(wires, card, token) } else { self.send_mark(wires, token) };
                    if !sent {
                        return did.or(Tick::Blocked);
                    }
                    self.order.pop_front();
                    did = Tick::Moved;
                    continue;
                }
                DispatchOrder::Warp(index) => index,
            };
            let pipeline = usize::from(self.pipeline);
            if !card.warps[pipeline][index].done {
                return did;
            }
            while let Some(&token) = card.warps[pipeline][index].groups.get(self.left) {
                let sent = if token.kind == Kind::DATA { self.send(wires, card, token) } else { self.send_mark(wires, token) };
                if !sent {
                    return did.or(Tick::Blocked);
                }
                self.left += 1;
                did = Tick::Moved;
            }
            self.left = 0;
            card.warps[pipeline].remove(index);
            self.order.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Starts the open warp on the next core that has room; false if none has.
    fn start(&mut self, wires: &mut Wires, card: &mut Card) -> bool {
        let Some(index) = self.open else { return true };
        let cores = self.ports.cores.len();
        if let Some(begun) = &self.ports.begun
            && !wires.can_push(begun)
        {
            return false;
        }
        for _ in 0..cores {
            let number = usize::from(self.pipeline) * cores + self.core;
            let core = &self.ports.cores[self.core];
            self.core = (self.core + 1) % cores;
            if wires.can_push(core) {
                let pipeline = usize::from(self.pipeline);
                let mut warp = std::mem::take(&mut card.warps[pipeline][index]);
                let slot = warp.slot;
                let work = card.work(slot);
                warp.merge(|item| &work.segment.tiles[item.source as usize].invocations.costs);
                card.warps[pipeline][index] = warp;
                wires.push(core, WarpToken { warp: index });
                if let Some(begun) = &self.ports.begun {
                    let first = if self.slot.replace(slot) == Some(slot) { 0 } else { Packing::FIRST };
                    wires.push(begun, Packing { core: number as u16, state: Packing::STARTED | first });
                    self.told = 0;
                }
                self.open = None;
                return true;
            }
        }
        false
    }
}

impl Dispatch {
    /// Quads are packed now: where that has an interval, the next are when it is over.
    #[inline(always)]
    fn pace(&mut self, now: Cycle) {
        if self.config.interval > 1 {
            self.free_at = now + Cycle::from(self.config.interval);
        }
    }

    /// Tells vertex fetch what has changed for quads that wait; false while that has to wait.
    fn tell(&mut self, wires: &mut Wires, card: &Card) -> bool {
        let Some(begun) = &self.ports.begun else { return true };
        let state = match self.open {
            None => 0,
            Some(open) if card.warps[usize::from(self.pipeline)][open].items.len() as u32 == self.quads => {
                Packing::WAITING | Packing::BLOCKED
            }
            Some(_) => Packing::WAITING,
        };
        let core = usize::from(self.pipeline) * self.ports.cores.len() + self.core;
        let tells = state == self.told || wires.try_push(begun, Packing { core: core as u16, state });
        if tells {
            self.told = state;
        }
        tells
    }

    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let pipeline = usize::from(self.pipeline);
        let mut did = Tick::Starved;

        // 1. Note what the cores have shaded.
        for shaded in &self.ports.shaded {
            while let Some(token) = wires.pop(shaded) {
                card.warps[pipeline][token.warp].done = true;
                did = Tick::Moved;
            }
        }

        // 2. Shaded groups leave in order.
        did = did.or(self.drain(wires, card));

        // 3. Pack quads.
        let mut budget = if self.free_at > wires.now() { 0 } else { self.config.quads_per_cycle };
        loop {
            // A full warp is started at once.
            if let Some(open) = self.open
                && card.warps[pipeline][open].items.len() as u32 == self.quads
            {
                if !self.start(wires, card) {
                    return did.or(Tick::Blocked);
                }
                did = Tick::Moved;
            }
            let Some(token) = wires.front(&self.ports.input) else { break };
            if token.kind != Kind::DATA {
                // A fence comes after all that came before it; the end of a number does not hold up the packing of the next.
                if token.kind.is_end()
                    && let Some(open) = self.open
                {
                    card.warps[pipeline][open].groups.push(token);
                } else {
                    if !self.start(wires, card) {
                        return did.or(Tick::Blocked);
                    }
                    if self.order.len() >= 2 * self.config.reorder as usize {
                        return did.or(Tick::Blocked);
                    }
                    self.order.push_back(DispatchOrder::Token(token));
                }
                wires.take(&self.ports.input);
                did = Tick::Moved;
                continue;
            }
            let group = card.groups[usize::from(token.pool)][token.group];
            if let Some(open) = self.open
                && card.warps[pipeline][open].slot != group.slot
            {
                // A warp runs one program with one state.
                if !self.start(wires, card) {
                    return did.or(Tick::Blocked);
                }
                did = Tick::Moved;
            }
            if budget == 0 {
                if self.free_at > wires.now() {
                    wires.sleep_until(self.free_at);
                    return did.or(Tick::Working);
                }
                return Tick::Moved;
            }
            let work = card.work[usize::from(group.slot)].as_ref().expect("a group's segment is in flight");
            if !work.draw.shades() {
                // Nothing to be shaded.
                if self.order.len() >= 2 * self.config.reorder as usize {
                    return did.or(Tick::Blocked);
                }
                budget = budget.saturating_sub(u32::from(token.quads));
                self.pace(wires.now());
                self.order.push_back(DispatchOrder::Token(token));
                wires.take(&self.ports.input);
                did = Tick::Moved;
                continue;
            }
            let open = match self.open {
                Some(open) => open,
                None => {
                    if self.order.len() >= self.config.reorder as usize {
                        return did.or(Tick::Blocked);
                    }
                    let registers = work.draw.shape(Stage::Fragment).registers;
                    let open = card.warps[pipeline].insert(Stage::Fragment, group.slot, registers);
                    self.order.push_back(DispatchOrder::Warp(open));
                    self.open = Some(open);
                    open
                }
            };

            // As many quads as the cycle and the warp can take; if it is not all, the group is parted in two.
            let warp = &mut card.warps[pipeline][open];
            let room = self.quads - warp.items.len() as u32;
            let mut taken = 0;
            let mut packed = 0;
            let mut shaded = 0;
            let quads = &work.segment.tiles[group.tile as usize].quads[group.first as usize..];
            for (&live, quad) in group.live[..usize::from(group.count)].iter().zip(quads) {
                if live != 0 {
                    if packed == room || packed == budget {
                        break;
                    }
                    if quad.flags & QUAD_SHADED == 0 {
                        let block = group.block;
                        let across = card.pass_of(group.slot).map_or(1, |pass| pass.blocks_across);
                        let (x, y) = (block % across, block / across);
                        card.fault.get_or_insert(Fault::Visibility { draw: work.draw.number, x, y });
                        return Tick::Blocked;
                    }
                    warp.items.push(Item::new(group.tile, quad.first_request, quad.cost));
                    shaded += fragments(live);
                    packed += 1;
                }
                taken += 1;
            }
            let funnel = &mut card.funnel[group.slot];
            funnel.quads_shaded += u64::from(packed);
            funnel.fragments_shaded += u64::from(shaded);
            funnel.helper_fragments += u64::from(4 * packed - shaded);
            self.items += u64::from(packed);
            budget -= packed;
            self.pace(wires.now());
            let rest = usize::from(group.count) - taken;
            if rest == 0 {
                warp.groups.push(token);
                wires.take(&self.ports.input);
            } else if taken > 0 {
                let mut head = group;
                head.count = taken as u8;
                let groups = &mut card.groups[usize::from(token.pool)];
                warp.groups.push(GroupToken { group: groups.insert(head), ..token });
                let tail = &mut groups[token.group];
                tail.count = rest as u8;
                tail.first += taken as u32;
                tail.live.copy_within(taken.., 0);
                tail.live[rest..].fill(0);
            }
            self.start_at = wires.now() + Cycle::from(self.config.patience);
            did = Tick::Moved;
        }

        // 4. Nothing more has come: in time the open warp is started as it is.
        if self.open.is_some() {
            if self.start_at > wires.now() {
                wires.sleep_until(self.start_at);
            } else if self.start(wires, card) {
                did = Tick::Moved;
            } else {
                did = did.or(Tick::Blocked);
            }
        }
        did
    }
}

impl Unit<Card> for Dispatch {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = self.step(wires, card);
        if !self.tell(wires, card) {
            did = did.or(Tick::Blocked);
        }
        if let Outlet::Owners(network) = &self.ports.output {
            wires.set_probe(&self.ports.probe, network.stall() as u8);
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        self.order.len() as u64
    }
}
