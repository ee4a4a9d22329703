//! Composition, one unit per pipeline: when a pass is drawn, the copies of its attachments in which pipelines have drawn apart from each
//! other become one. The units exchange blocks of 8x8 pixels over the sort network, by a [`Scheme`].
//!
//! A unit reads blocks to be sent from its copy in memory, and blocks to be composed when others come; what it has composed it
//! writes back to its copy, or in the last step to the surface itself. Along a chain a block goes on without being written. Of a block
//! the sender never changes anything after it was sent, so that the receiver takes the bytes from the sender's copy. See
//! [`super::copies`] for which bytes remain.

mod plan;

use std::collections::VecDeque;

use bytemuck::{Pod, Zeroable};

pub use plan::{Step, steps};

use super::card::{Card, PassState};
use super::class_state::ClassState;
use super::compression::{Codec, Compression};
use super::copies;
use super::frame::{BlockState, FrameBuffers, Store};
use super::misses::Misses;
use super::network::{Receiver, Sender};
use super::resolve::{Operation, requests};
use super::sorting::SortCounts;
use super::token::{Ack, Kind, Piece};
use knob::Allowed;
use mem::MemoryPort;
use num::Cycle;
use sim::{Counted, In, Out, Tick, Unit, Wires};
use stats::Heading;
use work::BLOCK;

knob::choices! {
    /// How copies are composed.
    pub enum Scheme {
        /// Rounds in which pairs of nodes exchange halves of what they have left.
        BinarySwap "binary-swap",
        /// Each node gets its part of the picture from all others.
        DirectSend "direct-send",
        /// From the last node to the first, each of which composes its own copy into what comes.
        Pipeline "pipeline",
    }
}

knob::knobs! {
    /// Composition of the pipelines' frame buffers.
    pub struct ComposeConfig {
        /// Which unit sends what to which other. Where the number of pipelines is no power of two, binary swap first composes the surplus in pairs.
        scheme: Scheme ["", Allowed::Choice(Scheme::NAMES), "binary swap (Ma et al. 1994); direct send (Hsu 1993); a chain (PixelFlow: Molnar et al. 1992)"]
            {estimate: RefusedUnless(Is(&["binary-swap", "pipeline"]), "pipelines that receive from all others at once"), relax: Never, advice: []},
        /// Samples of pixels that a unit composes per cycle.
        samples_per_cycle: u32 ["samples/cycle", Allowed::Range(1, 4096), "assumed: a quad of each of four ROPs"]
            {estimate: Used, relax: Rate, advice: []},
        /// Bytes of a primitive's number, sent with each sample to decide between equal depths; 0 where nothing is sent.
        number_bytes: u32 ["bytes/sample", Allowed::Range(0, 4), "assumed: 0: colour and depth alone (Molnar et al. 1994), ties by what a pipeline knows"]
            {estimate: Used, relax: Never, advice: []},
        /// Whether composed blocks are compressed as they are written.
        compression: bool ["", Allowed::Switch, "composers of the literature have no compressors; ROPs' have"]
            {estimate: Used, relax: Skip(&[("true", "compressed composition")]), advice: []},
        /// Requests to memory in flight, and blocks between request and use.
        misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory"]
            {estimate: RefusedUnless(AtMost(64), "blocks that composition reads far ahead"), relax: Room, advice: []},
    }
}

/// The heading of composition in the statistics.
pub const COMPOSITION: Heading =
    Heading::new("composition.compose[i]", "Sort-last-image: what each pipeline sends and composes.");

stats::counters! {
    /// What composition sends and composes.
    pub struct ComposeCounts {
        /// Passes composed.
        passes: "passes",
        /// Steps in which something was sent or came, over all passes.
        rounds: "rounds",
        /// Messages sent: runs of blocks from one node to another.
        messages: "messages",
        /// Pixels sent.
        pixels_sent: "pixels",
        /// Bytes sent.
        bytes_sent: "bytes",
        /// Pixels that came and were composed.
        pixels_composed: "pixels",
        /// Cycles from the beginning of a pass's composition in this pipeline to its end there.
        cycles: "cycles",
    }
}

/// A block of the sender's copies.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct BlockToken {
    /// Its number.
    pub block: u32,
}

/// Ports of a composition unit.
#[derive(Clone)]
pub struct ComposePorts {
    /// A pass is drawn, from the command processor.
    pub start: In<Piece>,
    /// It is composed, as far as this unit goes.
    pub done: Out<Ack>,
    /// Blocks to all composition units.
    pub sender: Sender<BlockToken>,
    /// Blocks from all composition units.
    pub receiver: Receiver<BlockToken>,
    /// Memory.
    pub memory: MemoryPort,
}

/// A block that is being read.
#[derive(Clone, Copy, Debug)]
struct PendingBlock {
    block: u32,
    needs: u32,
}

/// An attachment that is composed.
#[derive(Clone, Copy, Debug)]
struct Plane {
    surface: usize,
    /// Whether the result is written to memory.
    stored: bool,
}

/// Writes that may wait for the port before the next block is composed.
const WRITES: usize = 64;

/// A composition unit. Its items are blocks composed.
#[derive(Clone)]
pub struct Compose {
    config: ComposeConfig,
    node: usize,
    nodes: usize,
    ports: ComposePorts,
    misses: Misses,
    reads: VecDeque<Operation>,
    writes: VecDeque<Operation>,
    /// The steps of the current pass that are still to be done.
    steps: VecDeque<Step>,
    planes: Vec<Plane>,
    active: bool,
    /// Since when.
    since: Cycle,
    /// Blocks to be sent in the current step that are still to be asked for.
    to_send: std::ops::Range<u32>,
    /// Blocks to be composed in the current step that are still to be asked for.
    to_compose: std::ops::Range<u32>,
    /// Blocks to be sent that were asked for.
    sends: VecDeque<PendingBlock>,
    /// Blocks to be composed that were asked for.
    composes: VecDeque<PendingBlock>,
    /// Whether the next block to be asked for is a block to be composed, if there are blocks of both kinds.
    turn: bool,
    /// When the composer is free, in cycles times `samples_per_cycle`.
    free_at: u64,
    counts: ComposeCounts,
    sorting: SortCounts,
    items: u64,
}

impl Compose {
    /// An idle composition unit: number `node` of `nodes`.
    pub fn new(config: ComposeConfig, node: usize, nodes: usize, ports: ComposePorts) -> Compose {
        Compose {
            misses: Misses::new(config.misses),
            config,
            node,
            nodes,
            ports,
            reads: VecDeque::new(),
            writes: VecDeque::new(),
            steps: VecDeque::new(),
            planes: Vec::new(),
            active: false,
            since: 0,
            to_send: 0..0,
            to_compose: 0..0,
            sends: VecDeque::new(),
            composes: VecDeque::new(),
            turn: false,
            free_at: 0,
            counts: ComposeCounts::default(),
            sorting: SortCounts::default(),
            items: 0,
        }
    }

    /// The counters of the unit.
    pub fn counts(&self) -> ComposeCounts {
        self.counts
    }

    /// The cost of sorting: samples of whole frame buffers.
    pub fn sorting(&self) -> SortCounts {
        self.sorting
    }

    /// Takes a pass in hand.
    fn begin(&mut self, card: &mut Card) {
        let Card { passes, frame, class_state: ClassState { copies, .. }, .. } = card;
        let pass = passes.current().expect("a pass is being composed");
        self.active = true;
        self.counts.passes += 1;
        self.planes.clear();
        for (attachment, surface) in pass.pass.color.iter().zip(&pass.color) {
            // An attachment that is neither stored nor resolved need not be composed.
            if let (Some(attachment), &Some(surface)) = (attachment, surface)
                && (attachment.store || attachment.resolve.is_some())
            {
                self.planes.push(Plane { surface, stored: true });
            }
        }
        if let (Some(attachment), Some(surface)) = (&pass.pass.depth, pass.depth)
            && pass.order.writes_depth
        {
            self.planes.push(Plane { surface, stored: attachment.store || attachment.stencil_store });
        }
        let blocks = pass.blocks as u32;
        if self.nodes == 1 {
            // The only pipeline has drawn in the surface itself.
            for block in 0..blocks {
                copies::finish(frame, &copies[0], pass, block);
                for plane in &self.planes {
                    let state = copies[0].stores[plane.surface].blocks[block as usize];
                    let own = if let BlockState::Shared(bytes) = state { BlockState::Stored(bytes) } else { state };
                    frame.stores[plane.surface].blocks[block as usize] = own;
                }
            }
        }
        let samples: u64 = (0..blocks).map(|block| u64::from(samples(pass, block))).sum();
        self.sorting.sorted_items += samples;
        self.sorting.sent += samples;
        if self.nodes == 1 {
            self.sorting.redistributed_items += samples;
            self.sorting.redistributed_bytes += samples * u64::from(self.sample_bytes(frame));
        }
        self.steps = steps(self.config.scheme, self.node, self.nodes, blocks).into();
        self.begin_step();
    }

    /// Takes the next step in hand, if there is one.
    fn begin_step(&mut self) {
        let Some(step) = self.steps.front() else { return };
        let range = |end: &Option<(usize, std::ops::Range<u32>)>| end.as_ref().map_or(0..0, |(_, blocks)| blocks.clone());
        self.to_compose = range(&step.receive);
        // If blocks are sent on once they are composed, none is read in order to be sent.
        self.to_send = if step.forward { 0..0 } else { range(&step.send) };
        self.counts.rounds += 1;
        self.counts.messages += u64::from(step.send.is_some());
    }

    /// Bytes that a sample takes on the network.
    fn sample_bytes(&self, frame: &FrameBuffers) -> u32 {
        let bytes = self.planes.iter().map(|plane| frame.stores[plane.surface].surface.format.block_bytes());
        bytes.sum::<u32>() + self.config.number_bytes
    }

    /// Sends a block to a node that has room.
    fn send(&mut self, wires: &mut Wires, card: &Card, to: usize, block: u32) {
        let pass = card.passes.current().expect("a pass is being composed");
        let samples = samples(pass, block);
        let bytes = samples * self.sample_bytes(&card.frame);
        self.ports.sender.send(wires, to, BlockToken { block }, bytes);
        self.counts.pixels_sent += u64::from(samples / pass.pass.samples);
        self.counts.bytes_sent += u64::from(bytes);
        self.sorting.copy(samples, bytes, true);
    }

    /// Composes blocks that have come with this node's own.
    fn compose(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let mut did = Tick::Starved;
        let Some(&Step { receive: Some((from, _)), ref send, forward, last }) = self.steps.front() else { return did };
        let on = send.as_ref().map(|&(to, _)| to).filter(|_| forward);
        let rate = u64::from(self.config.samples_per_cycle);
        let compression = Compression { enabled: self.config.compression, codec: Codec::Planes, again: true };
        while let Some(&PendingBlock { block, needs }) = self.composes.front() {
            if self.ports.receiver.front(wires, from).is_none() {
                return did;
            }
            if !self.misses.reached(needs) {
                return did.or(Tick::Memory);
            }
            if self.free_at >= (wires.now() + 1) * rate {
                wires.sleep_until(self.free_at / rate);
                return did.or(Tick::Working);
            }
            if self.writes.len() >= WRITES || on.is_some_and(|to| !self.ports.sender.can_send(wires, to)) {
                return did.or(Tick::Blocked);
            }
            let Card { passes, frame, class_state: ClassState { copies, .. }, .. } = card;
            let pass = passes.current().expect("a pass is being composed");
            copies::merge(copies, pass, self.node, from, block);
            let samples = samples(pass, block);
            if last {
                copies::finish(frame, &copies[self.node], pass, block);
                let bytes = samples * self.sample_bytes(frame);
                self.sorting.copy(samples, bytes, false);
            }
            self.counts.pixels_composed += u64::from(samples / pass.pass.samples);
            self.free_at = self.free_at.max(wires.now() * rate) + u64::from(samples);
            if on.is_none() {
                let target = if last { frame } else { &mut copies[self.node] };
                for plane in self.planes.iter().filter(|plane| plane.stored || !last) {
                    write(&mut target.stores[plane.surface], block, compression, &mut self.writes);
                }
            }
            self.ports.receiver.take(wires, from);
            self.composes.pop_front();
            self.items += 1;
            if let Some(to) = on {
                self.send(wires, card, to, block);
            }
            did = Tick::Moved;
        }
        did
    }

    /// Sends blocks that have been read.
    fn send_read(&mut self, wires: &mut Wires, card: &Card) -> Tick {
        let mut did = Tick::Starved;
        let Some(&Step { send: Some((to, _)), .. }) = self.steps.front() else { return did };
        while let Some(&PendingBlock { block, needs }) = self.sends.front() {
            if !self.misses.reached(needs) {
                return did.or(Tick::Memory);
            }
            if !self.ports.sender.can_send(wires, to) {
                return did.or(Tick::Blocked);
            }
            self.send(wires, card, to, block);
            self.sends.pop_front();
            did = Tick::Moved;
        }
        did
    }

    /// Asks memory for the next blocks, of each run in turn.
    fn ask(&mut self, card: &Card) -> bool {
        let mut moved = false;
        let most = self.config.misses as usize;
        while self.reads.is_empty() {
            let (send, compose) = (
                !self.to_send.is_empty() && self.sends.len() < most,
                !self.to_compose.is_empty() && self.composes.len() < most,
            );
            if !send && !compose {
                break;
            }
            let composes = if send && compose { self.turn } else { compose };
            self.turn = !composes;
            let run = if composes { &mut self.to_compose } else { &mut self.to_send };
            let Some(block) = run.next() else { break };
            let copy = &card.class_state.copies[self.node];
            let mut count = 0;
            for plane in &self.planes {
                if let Some((address, bytes)) = copy.stores[plane.surface].stored(block) {
                    count += requests(address, bytes, &mut self.reads);
                }
            }
            let asked = PendingBlock { block, needs: self.misses.issued().wrapping_add(count) };
            if composes { &mut self.composes } else { &mut self.sends }.push_back(asked);
            moved = true;
        }
        moved
    }

    /// Memory's answers, and requests to it; true if anything moved.
    fn exchange(&mut self, wires: &mut Wires) -> bool {
        let memory = &self.ports.memory;
        let mut moved = false;
        while let Some(tag) = memory.answer(wires) {
            self.misses.answer(tag);
            moved = true;
        }
        while let Some(&Operation { address, bytes }) = self.writes.front() {
            if !memory.can_send(wires) {
                return moved;
            }
            memory.write(wires, address, bytes);
            self.writes.pop_front();
            moved = true;
        }
        while let Some(&Operation { address, bytes }) = self.reads.front() {
            if self.misses.room() == 0 || !memory.can_send(wires) {
                return moved;
            }
            let tag = self.misses.issue();
            memory.read(wires, address, bytes, tag);
            self.reads.pop_front();
            moved = true;
        }
        moved
    }
}

/// Samples of a block that lie on the pass's area.
fn samples(pass: &PassState, block: u32) -> u32 {
    let (x, y) = (block % pass.blocks_across * BLOCK, block / pass.blocks_across * BLOCK);
    let inside = |at: u32, size: u32| size.saturating_sub(at).min(BLOCK);
    inside(x, pass.pass.width) * inside(y, pass.pass.height) * pass.pass.samples
}

/// Writes a block.
fn write(store: &mut Store, block: u32, compression: Compression, writes: &mut VecDeque<Operation>) {
    let bytes = compression.bytes(store, block);
    store.blocks[block as usize] = BlockState::Stored(bytes as u16);
    requests(store.address(block), bytes, writes);
}

impl Unit<Card> for Compose {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Memory, and the network.
        let mut did = Tick::moved_or(self.exchange(wires), Tick::Starved);
        did = did.or(Tick::moved_or(self.ports.sender.poll(wires), Tick::Starved));
        self.ports.receiver.poll(wires);

        // 2. A pass that is drawn.
        let Some(piece) = wires.front(&self.ports.start) else { return did };
        if !self.active {
            self.begin(card);
            self.since = wires.now();
            did = Tick::Moved;
        }

        // 3. Compose blocks that have come, send blocks that have been read, and read more.
        did = did.or(self.compose(wires, card));
        did = did.or(self.send_read(wires, card));
        did = did.or(Tick::moved_or(self.ask(card), Tick::Starved));

        // 4. The next step.
        let left =
            !self.to_send.is_empty() || !self.to_compose.is_empty() || !self.sends.is_empty() || !self.composes.is_empty();
        if !left && self.steps.pop_front().is_some() {
            self.begin_step();
            did = Tick::Moved;
        }

        // 5. All done.
        if !left && self.steps.is_empty() && self.writes.is_empty() {
            if !wires.try_push(&self.ports.done, Ack { slot: piece.slot, kind: Kind::DATA }) {
                return did.or(Tick::Blocked);
            }
            wires.take(&self.ports.start);
            self.active = false;
            self.counts.cycles += wires.now() - self.since;
            did = Tick::Moved;
        }
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        let asked = self.sends.len() + self.composes.len() + self.writes.len() + usize::from(self.active);
        asked as u64 + u64::from(self.misses.in_flight()) + self.ports.receiver.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(COMPOSITION, |unit| unit.counts);
    }
}
