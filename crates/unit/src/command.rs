//! The command processor: reads the stream of events, hands draws and dispatches to the machine, keeps passes apart, clears
//! attachments, moves memory.

use std::collections::VecDeque;
use std::sync::Arc;

use super::card::{Card, ComputeWork, DepthStart, Fault, PassState};
use super::clears::Clears;
use super::copies::{self, PassOrder};
use super::phase::PhaseKind;
use super::same::{self, Use};
use super::sorting::PassWaits;
use super::stream::Stream;
use super::token::{Ack, Kind, Piece};
use gfx::hierarchical::depth_key;
use gfx::texel;
use knob::Allowed;
use mem::MemoryPort;
use num::Cycle;
use sim::{Counted, Gate, Heading, In, Out, Tick, Unit, Wires};
use work::{Attachment, BLOCK, Dispatch, Draw, EndFrame, Event, Load, Pass, SurfaceKey};

knob::choices! {
    /// What is left out where bounds show that it lies outside the view volume.
    pub enum CullChoice {
        /// Nothing.
        None "none",
        /// Whole draws.
        Draws "draws",
        /// Whole draws, and instances of the others.
        Instances "instances",
    }
}

knob::knobs! {
    /// The command processor.
    pub struct CommandConfig {
        /// Cycles that a command takes: a draw's segment, a dispatch, a pass.
        command_cycles: u32 ["cycles/command", Allowed::Range(1, 65536), "a few register writes; ATTILA writes one register a cycle"],
        /// Segments of draws in flight.
        segments: u32 ["segments", Allowed::Range(1, 4096), "ATTILA bGPU.ini PipelinedBatchRendering = TRUE, two batches; more hides small draws"],
        /// Runs of workgroups in flight.
        workgroup_runs: u32 ["runs", Allowed::Range(1, 256), "enough to keep the cores fed"],
        /// Requests of the copy engine in flight.
        copy_misses: u32 ["requests", Allowed::Range(1, 1024), "covers the latency of memory"],
        /// Cycles between two passes, beside those that caches take.
        barrier_cycles: u32 ["cycles", Allowed::Range(0, 65536), "a wait-for-idle and the next pass's state"],
        /// Whether a pass without draws only clears what it clears, and no pipeline hears of it.
        skip_empty_passes: bool ["", Allowed::Switch, "a pass is recorded before it is submitted: drivers see that it draws nothing"],
        /// What is left out where bounds show that it lies outside the view volume.
        cull: CullChoice ["", Allowed::Choice(CullChoice::NAMES), "cards leave it to programs"],
        /// Cycles that a test of bounds takes, of a draw or of an instance.
        cull_cycles: u32 ["cycles/test", Allowed::Range(0, 65536), "assumed: eight corners of a box by four rows of a matrix, sixteen products a cycle"],
    }
}

stats::counters! {
    /// What the command processor has done for passes, and left out.
    pub struct CommandCounts {
        /// Passes that pipelines have drawn.
        passes: "passes",
        /// Passes without draws that no pipeline has heard of.
        empty_passes: "passes",
        /// Draws, and instances of draws, whose bounds were tested against the view volume.
        bounds_tested: "tests",
        /// Draws left out because their bounds lie outside.
        draws_culled: "draws",
        /// Instances left out because their bounds lie outside, those of draws left out included.
        instances_culled: "instances",
        /// Their primitives, which were never assembled.
        primitives_culled: "primitives",
        /// Their indices (or vertices, of draws without indices), which were never read.
        vertices_culled: "vertices",
    }
}

/// Ports of the command processor.
pub struct CommandPorts {
    /// Segments and fences, to vertex fetch.
    pub fetch: Out<Piece>,
    /// Runs of workgroups, to compute dispatch.
    pub compute: Out<Piece>,
    /// Runs that are done.
    pub computed: In<Ack>,
    /// Attachments to be resolved.
    pub resolve: Out<Piece>,
    /// Attachments that are.
    pub resolved: In<Ack>,
    /// Surfaces to be shown.
    pub scanout: Out<Piece>,
    /// Surfaces that were.
    pub scanned: In<Ack>,
    /// Passes to be composed, to each composition unit; and what each of them has composed.
    pub compose: Vec<Out<Piece>>,
    /// See `compose`.
    pub composed: Vec<In<Ack>>,
    /// Fences seen by each colour unit, and passes ended by each depth unit.
    pub acks: Vec<In<Ack>>,
    /// Memory, for copies and clears.
    pub memory: MemoryPort,
    /// Where all units of the pipelines are told whether there is a pass or a dispatch: 1 if so, else 0.
    pub work: Gate,
}

/// What the command processor is at.
#[derive(Clone, Debug)]
enum State {
    /// The next event.
    Ready,
    /// Attachments are being cleared in memory: those still to do.
    Clearing,
    /// The pass drains: reports of its end still to come.
    Ending(u32),
    /// Copies of the attachments are being composed: units still to be told, and those that are not done.
    Composing(usize, usize),
    /// Attachments are being resolved: how many still.
    Resolving(u32),
    /// Memory is moved.
    Moving(Option<(SurfaceKey, SurfaceKey)>),
    /// The frame's picture is read.
    Scanning,
    /// The frame is over, until the run takes the machine up again.
    Over,
}

/// The command processor. Its items are events.
pub struct Command {
    config: CommandConfig,
    fast_clear: bool,
    clears_per_cycle: u32,
    scanout: bool,
    pipelines: u32,
    ports: CommandPorts,
    state: State,
    /// Nothing is begun before this cycle.
    busy_until: Cycle,
    /// Tests of bounds to be made one after the other from then on.
    tests: u64,
    /// Pieces on their way to vertex fetch.
    pieces: VecDeque<Piece>,
    draw: Option<Arc<Draw>>,
    draws: u32,
    passes: u32,
    dispatch: Option<Arc<Dispatch>>,
    /// Free slots, and the reports still to come for those in use.
    free: Vec<u16>,
    reports: Vec<u32>,
    free_runs: Vec<u16>,
    /// Surfaces to be cleared in memory: address and bytes.
    clears: VecDeque<(u64, u64)>,
    /// Attachments to be resolved, to be handed on.
    resolves: VecDeque<u16>,
    stream: Stream,
    /// The depth surface whose hierarchical Z is still true.
    depth_known: Option<SurfaceKey>,
    /// The depth surface that a pass without draws has cleared since, and its depths as ordered keys.
    depth_cleared: Option<(SurfaceKey, (u32, u32))>,
    /// The frame that ended.
    ended: Option<EndFrame>,
    counts: CommandCounts,
    waits: PassWaits,
    items: u64,
}

impl Command {
    /// One at the beginning of the stream. `clearing` is whether clears are by flag, and how many blocks a cycle all pipelines clear.
    pub fn new(config: CommandConfig, pipelines: u32, clearing: (bool, u32), scanout: bool, ports: CommandPorts) -> Command {
        let segments = config.segments.min(u32::from(u16::MAX)) as u16;
        let runs = config.workgroup_runs as u16;
        Command {
            fast_clear: clearing.0,
            clears_per_cycle: clearing.1,
            scanout,
            pipelines,
            ports,
            state: State::Ready,
            busy_until: 0,
            tests: 0,
            pieces: VecDeque::with_capacity(4),
            draw: None,
            draws: 0,
            passes: 0,
            dispatch: None,
            free: (0..segments).rev().collect(),
            reports: vec![0; usize::from(segments)],
            free_runs: (0..runs).rev().collect(),
            clears: VecDeque::new(),
            resolves: VecDeque::new(),
            stream: Stream::new(config.copy_misses),
            depth_known: None,
            depth_cleared: None,
            ended: None,
            counts: CommandCounts::default(),
            waits: PassWaits::new(pipelines as usize),
            items: 0,
            config,
        }
    }

    /// Whether a frame has ended and waits to be taken.
    pub fn frame_over(&self) -> bool {
        matches!(self.state, State::Over)
    }

    /// How long each pipeline has waited, at the ends of passes, for the others.
    pub fn waits(&self) -> &PassWaits {
        &self.waits
    }

    /// What it has counted.
    pub fn counts(&self) -> CommandCounts {
        self.counts
    }

    /// Takes the frame that has ended; the machine goes on with the next.
    pub fn take_frame(&mut self) -> Option<EndFrame> {
        self.state = State::Ready;
        self.ended.take()
    }

    /// Whether nothing is under way.
    pub fn idle(&self) -> bool {
        matches!(self.state, State::Ready)
            && self.pieces.is_empty()
            && self.free.len() == self.reports.len()
            && self.free_runs.len() == self.config.workgroup_runs as usize
    }

    /// Installs the segment at the head of the events, which is to be drawn at once, if nothing is in flight; gives its slot.
    pub fn apply(&mut self, card: &mut Card) -> Option<u16> {
        let (Some(Event::Applied(segment)), Some(draw)) = (card.events.front(), &self.draw) else { return None };
        let slot = *self.free.last().filter(|_| self.idle())?;
        card.install(slot, segment.clone(), draw.clone(), self.draws);
        card.events.pop_front();
        self.items += 1;
        Some(slot)
    }

    /// Workgroups are under way.
    fn computing(&self) -> bool {
        self.free_runs.len() < self.config.workgroup_runs as usize
    }

    /// Takes reports; true if any came.
    fn collect(&mut self, wires: &mut Wires, card: &mut Card) -> bool {
        let mut moved = false;
        for (unit, port) in self.ports.acks.iter().enumerate() {
            while let Some(ack) = wires.pop(port) {
                moved = true;
                if ack.kind == Kind::PASS {
                    if let State::Ending(left) = &mut self.state {
                        *left -= 1;
                        self.waits.ended(unit, wires.now(), *left == 0);
                    }
                    continue;
                }
                let slot = usize::from(ack.slot);
                self.reports[slot] -= 1;
                if self.reports[slot] == 0 {
                    card.work[slot] = None;
                    self.free.push(ack.slot);
                }
            }
        }
        while let Some(ack) = wires.pop(&self.ports.computed) {
            card.compute[usize::from(ack.slot)] = None;
            self.free_runs.push(ack.slot);
            moved = true;
        }
        moved
    }

    /// Clears what a pass clears of the surfaces themselves; gives the index of each attachment's.
    fn clear(&self, card: &mut Card, pass: &Pass, of: Use, clears: &mut Clears) -> (Vec<Option<usize>>, Option<usize>) {
        let color = pass.color.iter().map(|attachment| {
            attachment.map(|attachment| {
                let index = card.frame.surface(&attachment.surface);
                let store = &mut card.frame.stores[index];
                store.surface = attachment.surface;
                if card.apart.same_tiles {
                    same::begin(store, &attachment, of, self.fast_clear);
                }
                clears.color(store, &attachment);
                index
            })
        });
        let color = color.collect();
        clears.color_flags = clears.flags;
        let depth = pass.depth.map(|attachment| {
            let index = card.frame.surface(&attachment.surface);
            let store = &mut card.frame.stores[index];
            store.drawn.forget();
            clears.depth(store, &attachment);
            index
        });
        (color, depth)
    }

    /// Does all that a pass without draws asks for: it clears. The surfaces are in memory, where the pass before has left them.
    fn skip_pass(&mut self, card: &mut Card, pass: &Pass) -> Cycle {
        let mut clears = Clears::new(self.fast_clear);
        self.clear(card, pass, Use::Empty, &mut clears);
        if let Some(attachment) = &pass.depth
            && let Some(bounds) = cleared_depths(attachment)
        {
            let key = attachment.surface.key;
            // Pipelines would still have the bounds of before.
            self.depth_known = self.depth_known.filter(|&known| known != key);
            self.depth_cleared = Some((key, bounds));
        }
        self.counts.empty_passes += 1;
        self.clears = clears.writes;
        u64::from(clears.flags).div_ceil(u64::from(self.clears_per_cycle))
    }

    /// Installs a pass: its surfaces, its clears.
    fn begin_pass(&mut self, card: &mut Card, pass: &Arc<Pass>) -> Cycle {
        let signature = if card.apart.same_tiles && self.fast_clear { same::sign(pass) } else { None };
        let of = if signature.is_some() { Use::Signed } else { Use::Drawn };
        for target in pass.color.iter().flatten().filter_map(|attachment| attachment.resolve) {
            if let Some(index) = card.frame.find(target.key) {
                card.frame.stores[index].drawn.forget();
            }
        }
        let mut clears = Clears::new(self.fast_clear);
        let (color, depth) = self.clear(card, pass, of, &mut clears);
        let Clears { mut flags, color_flags, writes: mut clears, .. } = clears;
        let depth_start = pass.depth.map(|attachment| {
            let key = attachment.surface.key;
            let bounds = match cleared_depths(&attachment) {
                Some(bounds) => Some(bounds),
                None if self.depth_known == Some(key) && card.apart.copies.is_empty() => None,
                None => {
                    Some(self.depth_cleared.filter(|(cleared, _)| *cleared == key).map_or((0, u32::MAX), |(_, bounds)| bounds))
                }
            };
            self.depth_known = Some(key);
            self.depth_cleared = self.depth_cleared.filter(|(cleared, _)| *cleared != key);
            DepthStart { bounds }
        });
        let (across, down) = (pass.width.div_ceil(BLOCK), pass.height.div_ceil(BLOCK));
        let number = self.passes;
        self.passes += 1;
        let blocks = (across * down) as usize;
        let (order, primitives) = (PassOrder::default(), primitives_ahead(card));
        let state = PassState {
            number,
            depth_start,
            blocks,
            pass: pass.clone(),
            color,
            depth,
            blocks_across: across,
            primitives,
            order,
            signature,
            raised: false,
            lowered: false,
        };
        if let Some(surface) = state.depth
            && !card.apart.seen.is_empty()
        {
            // Each pipeline's copy of the depths is cleared as the surface is: by flag, or in memory.
            flags += (flags - color_flags) * card.apart.seen.len() as u32;
            let address = card.frame.stores[surface].surface.address;
            let written = clears.iter().find(|&&(at, _)| at == address).copied();
            copies::begin_seen(&card.frame, &mut card.apart.seen, surface, written.is_some());
            if let Some((address, bytes)) = written {
                clears.extend((0..card.apart.seen.len()).map(|pipeline| (address + copies::behind(pipeline), bytes)));
            }
        }
        if !card.apart.copies.is_empty() {
            let cleared = |&&surface: &&usize| {
                let address = card.frame.stores[surface].surface.address;
                clears.iter().any(|&(at, _)| at == address)
            };
            let written: Vec<usize> = state.color.iter().flatten().chain(&state.depth).filter(cleared).copied().collect();
            copies::begin(&card.frame, &mut card.apart.copies, &state, &written);
            card.apart.primitives = 0;
            // Beside the surfaces all copies are cleared; a single pipeline's is the surface.
            let pipelines = card.apart.copies.len();
            if pipelines > 1 {
                let own = clears.clone();
                for pipeline in 0..pipelines {
                    let behind = copies::offset(pipeline, pipelines);
                    clears.extend(own.iter().map(|&(address, bytes)| (address + behind, bytes)));
                }
                flags *= pipelines as u32 + 1;
            }
        }
        self.counts.passes += 1;
        card.pass = Some(state);
        card.interleave.begin_pass(pass.width, pass.height);
        self.clears = clears;
        u64::from(flags).div_ceil(u64::from(self.clears_per_cycle))
    }

    /// Hands the next event out; `None` if it has to wait.
    fn event(&mut self, wires: &mut Wires, card: &mut Card) -> Option<()> {
        let now = wires.now();
        let order = |event: u64, what: &'static str| Fault::Order { event, what };
        let drained = self.free.len() == self.reports.len() && self.pieces.is_empty();
        let in_pass = card.pass.is_some();
        let wrong = match card.events.front()? {
            Event::Draw(_) | Event::Segment(_) | Event::Applied(_) | Event::EndPass if !in_pass => Some("outside a pass"),
            Event::Segment(_) | Event::Applied(_) if self.draw.is_none() => Some("a segment without a draw"),
            Event::Groups(_) if self.dispatch.is_none() => Some("workgroups without a dispatch"),
            Event::BeginPass(_) | Event::Dispatch(_) | Event::Groups(_) | Event::Contents(_) | Event::EndFrame(_)
                if in_pass =>
            {
                Some("inside a pass")
            }
            _ => None,
        };
        if let Some(what) = wrong {
            let event = self.items;
            card.stop(order(event, what));
            return None;
        }
        // What is not part of a dispatch waits for the dispatch.
        if self.computing() && !matches!(card.events.front()?, Event::Groups(_)) {
            return None;
        }
        let mut cycles = Cycle::from(self.config.command_cycles);
        match card.events.front()? {
            Event::Segment(segment) => {
                let slot = self.free.pop()?;
                let (segment, draw) = (segment.clone(), self.draw.clone()?);
                card.install(slot, segment, draw, self.draws);
                self.reports[usize::from(slot)] = self.pipelines;
                self.pieces.push_back(Piece { slot, kind: Kind::DATA });
                self.pieces.push_back(Piece { slot, kind: Kind::SEGMENT });
            }
            // Waits until nothing is in flight; then it is taken from here ([`Command::apply`]).
            Event::Applied(_) => return None,
            Event::Draw(draw) => {
                self.draw = Some(draw.clone());
                self.draws = self.draws.wrapping_add(1);
                let culling = draw.culling;
                self.counts.bounds_tested += culling.tests;
                self.counts.draws_culled += culling.draws;
                self.counts.instances_culled += culling.instances;
                self.counts.primitives_culled += culling.primitives;
                self.counts.vertices_culled += culling.vertices;
                cycles = self.begin_tests(culling.tests);
            }
            Event::BeginPass(pass) => {
                let pass = pass.clone();
                let next = card.events.get(1);
                let skips =
                    self.config.skip_empty_passes && !pass.color.iter().flatten().any(|target| target.resolve.is_some());
                if skips && next.is_none() && !card.closed {
                    return None;
                }
                let skipped = skips && matches!(next, Some(Event::EndPass));
                card.phases.begin(PhaseKind::Pass, pass.number, &pass.label, now);
                if skipped {
                    cycles += self.skip_pass(card, &pass);
                    card.events.pop_front();
                    self.items += 1;
                } else {
                    cycles += self.begin_pass(card, &pass);
                }
                card.epoch += 1;
                self.state = State::Clearing;
            }
            Event::EndPass => {
                self.pieces.push_back(Piece { slot: 0, kind: Kind::PASS });
                self.state = State::Ending(2 * self.pipelines);
                self.draw = None;
            }
            Event::Dispatch(dispatch) => {
                card.phases.begin(PhaseKind::Dispatch, dispatch.number, &dispatch.label, now);
                self.dispatch = Some(dispatch.clone());
                card.epoch += 1;
            }
            Event::Groups(groups) => {
                let slot = self.free_runs.pop()?;
                let (dispatch, groups) = (self.dispatch.clone()?, groups.clone());
                if card.apart.same_tiles {
                    same::touched(card, groups.lines.iter());
                }
                card.compute[usize::from(slot)] = Some(ComputeWork { dispatch, groups });
                self.pieces.push_back(Piece { slot, kind: Kind::DATA });
                self.state = State::Ready;
            }
            Event::Contents(contents) => {
                let index = card.frame.surface(&contents.surface);
                let store = &mut card.frame.stores[index];
                if !store.load(&contents.bytes) {
                    let event = self.items;
                    card.stop(order(event, "contents of a surface have the wrong number of bytes"));
                    return None;
                }
                store.in_memory();
                let key = contents.surface.key;
                self.forget_depths(key);
                cycles = 0;
            }
            Event::Transfer(transfer) => {
                if !drained {
                    return None;
                }
                let transfer = *transfer;
                if let (true, Some(to)) = (card.apart.same_tiles, transfer.to) {
                    same::written(card, to, transfer.bytes);
                }
                card.phases.begin(PhaseKind::Transfers, 0, "", now);
                self.stream.begin(transfer.from, transfer.to, transfer.bytes);
                self.state = State::Moving(transfer.surfaces);
                card.epoch += 1;
            }
            Event::EndFrame(end) => {
                if !drained {
                    return None;
                }
                self.state = match end.shown.as_ref().and_then(|shown| card.frame.find(shown.key)) {
                    Some(index) if self.scanout => {
                        if !wires.try_push(&self.ports.scanout, Piece { slot: index as u16, kind: Kind::DATA }) {
                            return None;
                        }
                        State::Scanning
                    }
                    _ => State::Over,
                };
                card.phases.begin(PhaseKind::ScanOut, 0, "", now);
                card.interleave.end_frame();
                self.ended = Some(end.clone());
            }
        }
        card.events.pop_front();
        self.items += 1;
        self.busy_until = now + cycles;
        Some(())
    }

    /// Begins tests of bounds; the cycles of the first of them.
    fn begin_tests(&mut self, tests: u64) -> Cycle {
        let cycles = Cycle::from(self.config.cull_cycles);
        self.tests = if cycles > 0 { tests.saturating_sub(1) } else { 0 };
        cycles * tests.min(1)
    }

    /// Something other than a draw has written a surface.
    fn forget_depths(&mut self, key: SurfaceKey) {
        self.depth_known = self.depth_known.filter(|&known| known != key);
        self.depth_cleared = self.depth_cleared.filter(|(cleared, _)| *cleared != key);
    }

    /// The pass is drawn: its attachments are resolved.
    fn begin_resolves(&mut self, card: &Card) {
        let Some(pass) = &card.pass else { return };
        let resolves = |attachment: &Option<Attachment>| attachment.is_some_and(|a| a.resolve.is_some());
        let locations = pass.pass.color.iter().enumerate().filter(|(_, attachment)| resolves(attachment));
        self.resolves = locations.map(|(location, _)| location as u16).collect();
        self.state = State::Resolving(self.resolves.len() as u32);
    }

    /// Goes on with what takes longer than an event.
    fn proceed(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        match &mut self.state {
            State::Ready | State::Over => Tick::Starved,
            State::Clearing => {
                if self.stream.done() {
                    match self.clears.pop_front() {
                        Some((address, bytes)) => self.stream.begin(None, Some(address), bytes),
                        None => self.state = State::Ready,
                    }
                    return Tick::Moved;
                }
                self.stream.step(wires, &self.ports.memory)
            }
            State::Ending(left) => {
                if *left > 0 {
                    return Tick::Starved;
                }
                let Some(pass) = &card.pass else { return Tick::Starved };
                if pass.order.drawn {
                    if pass.order.matters && card.apart.copies.len() > 1 {
                        card.apart.disordered.push((pass.pass.number, pass.pass.label.clone()));
                    }
                    self.state = State::Composing(0, self.ports.compose.len());
                    return Tick::Moved;
                }
                self.begin_resolves(card);
                Tick::Moved
            }
            State::Composing(told, left) => {
                let mut did = Tick::Starved;
                while *told < self.ports.compose.len() {
                    if !wires.try_push(&self.ports.compose[*told], Piece { slot: 0, kind: Kind::PASS }) {
                        did = Tick::Blocked;
                        break;
                    }
                    *told += 1;
                    did = Tick::Moved;
                }
                for port in &self.ports.composed {
                    while wires.pop(port).is_some() {
                        *left -= 1;
                        did = Tick::Moved;
                    }
                }
                if *left == 0 {
                    self.begin_resolves(card);
                    did = Tick::Moved;
                }
                did
            }
            State::Resolving(left) => {
                let mut did = Tick::Starved;
                while let Some(&location) = self.resolves.front() {
                    if !wires.try_push(&self.ports.resolve, Piece { slot: location, kind: Kind::DATA }) {
                        did = Tick::Blocked;
                        break;
                    }
                    self.resolves.pop_front();
                    did = Tick::Moved;
                }
                while wires.pop(&self.ports.resolved).is_some() {
                    *left -= 1;
                    did = Tick::Moved;
                }
                if *left == 0 {
                    card.pass = None;
                    card.epoch += 1;
                    self.state = State::Ready;
                    self.busy_until = wires.now() + Cycle::from(self.config.barrier_cycles);
                    did = Tick::Moved;
                }
                did
            }
            State::Moving(surfaces) => {
                let did = self.stream.step(wires, &self.ports.memory);
                if !self.stream.done() {
                    return did;
                }
                if let Some((from, to)) = surfaces.take() {
                    card.frame.copy(from, to);
                    self.forget_depths(to);
                }
                self.state = State::Ready;
                Tick::Moved
            }
            State::Scanning => {
                if wires.pop(&self.ports.scanned).is_none() {
                    return Tick::Starved;
                }
                self.state = State::Over;
                Tick::Moved
            }
        }
    }
}

/// Primitives up to the end of the pass, of the events that are here.
fn primitives_ahead(card: &Card) -> u64 {
    let pass = card.events.iter().skip(1).take_while(|event| !matches!(event, Event::EndPass));
    let primitives = |event: &Event| if let Event::Segment(segment) = event { segment.primitives.len() as u64 } else { 0 };
    pass.map(primitives).sum()
}

/// The bounds of all blocks of a depth attachment that a pass clears, as ordered keys; none: it does not.
fn cleared_depths(attachment: &Attachment) -> Option<(u32, u32)> {
    let format = attachment.surface.format;
    match attachment.load {
        Load::Clear(value) if format.has_depth() => {
            let key = depth_key(format, texel::depth_code(format, f32::from_bits(value[0])));
            Some((key, key))
        }
        _ => None,
    }
}

impl Command {
    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Reports free slots and end passes.
        let mut did = Tick::moved_or(self.collect(wires, card), Tick::Starved);

        // 2. Pieces go on their way.
        while let Some(&piece) = self.pieces.front() {
            let port = if card.pass.is_some() { &self.ports.fetch } else { &self.ports.compute };
            if !wires.try_push(port, piece) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.pieces.pop_front();
            did = Tick::Moved;
        }

        // 3. What is begun goes on, when its command is decoded.
        if self.busy_until > wires.now() {
            wires.sleep_until(self.busy_until);
            return did.or(Tick::Working);
        }
        if self.tests > 0 {
            // Each of them is progress: a draw may have more of them than units may wake in vain.
            self.tests -= 1;
            self.busy_until = wires.now() + Cycle::from(self.config.cull_cycles);
            return Tick::Moved;
        }
        if !matches!(self.state, State::Ready) {
            return did.or(self.proceed(wires, card));
        }

        // 4. The next event, as soon as there is place for what it brings.
        if self.pieces.is_empty() && self.event(wires, card).is_some() {
            did = Tick::Moved;
        }
        did
    }
}

impl Unit<Card> for Command {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let did = self.step(wires, card);
        let drawing = card.pass.is_some() && !matches!(self.state, State::Resolving(_));
        wires.tell(&self.ports.work, u8::from(drawing || self.computing()));
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        (self.reports.len() - self.free.len() + self.pieces.len()) as u64 + self.stream.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        let about = "Passes and draws, and what of them the command processor has left out.";
        groups.group(Heading::new("command", about), |unit| unit.counts);
    }
}
