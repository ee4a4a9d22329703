//! The command processor: reads the stream of events, hands draws and dispatches to the machine, keeps passes apart, clears
//! attachments, moves memory.

mod event;
mod ongoing;
mod pass;
mod present;
mod proceed;
mod states;

use std::collections::VecDeque;
use std::sync::Arc;

use super::card::Card;
use super::scanout::ScanoutConfig;
use super::sorting::PassWaits;
use super::stream::Stream;
use super::token::{Ack, NextDraw, Piece};
use knob::Allowed;
use mem::MemoryPort;
use num::Cycle;
use ongoing::AllOngoing;
use present::Present;
use sim::{Counted, In, Out, StallProbe, Tick, Unit, Wires};
use states::States;
use stats::Heading;
use work::{Dispatch, Draw, EndFrame, Event, Surface, SurfaceKey};

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
        command_cycles: u32 ["cycles/command", Allowed::Range(1, 65536), "assumed: a few register writes; ATTILA writes one register per cycle"]
            {estimate: Used, relax: Interval, advice: []},
        /// Segments of draws in flight. In sort-middle-binned, those that are not binned yet.
        segments: u32 ["segments", Allowed::Range(1, 4096), "assumed; ATTILA bGPU.ini PipelinedBatchRendering = TRUE, two batches; more hides small draws"]
            {estimate: Used, relax: Room, advice: []},
        /// Different states of draws in flight: pipelines with their viewport, scissor rectangle, blend constant and stencil reference. A
        /// draw with another state waits until one of them is free.
        states: u32 ["states", Allowed::Range(1, 4096), "AMD GCN: seven contexts in flight (GPUOpen 2018, on context rolls)"]
            {estimate: RefusedUnless(AtLeast(4), "draws that wait for a free state"), relax: Never, advice: []},
        /// Cycles that a change of state between two draws takes, in addition to the command. A draw with the same state takes none.
        state_cycles: u32 ["cycles/change", Allowed::Range(0, 16384), "assumed: 16 registers, one per cycle as ATTILA writes them"]
            {estimate: RefusedUnless(AtMost(64), "changes of state"), relax: Interval, advice: []},
        /// Whether a draw is rasterised only when the one before it has left all pipelines. Its geometry does not wait. Where distribution sorts
        /// triangles only.
        drain: bool ["", Allowed::Switch, "draws follow each other in cards; ATTILA's rasteriser takes a batch when it has ended the last one (FragmentFIFO)"]
            {estimate: RefusedUnless(Is(&["false"]), "draws that wait for the one before"), relax: Never, advice: []},
        /// Runs of workgroups in flight.
        workgroup_runs: u32 ["runs", Allowed::Range(1, 256), "assumed: enough to keep the cores fed"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Room, advice: []},
        /// Requests of the copy engine in flight.
        copy_misses: u32 ["requests", Allowed::Range(1, 1024), "assumed: covers the latency of memory"]
            {estimate: Used, relax: Room, advice: []},
        /// Cycles between two passes, in addition to those that caches take.
        barrier_cycles: u32 ["cycles", Allowed::Range(0, 65536), "assumed: a wait-for-idle and the next pass's state"]
            {estimate: Used, relax: Wait("command: barriers half as long"), advice: []},
        /// Whether passes and copies of memory follow each other without waiting where neither writes what the other reads or writes. At most four
        /// passes are in flight then.
        overlap: bool ["", Allowed::Switch, "Vulkan 1.3, section 7: commands may overlap unless a dependency orders them; before that, a wait for idle between render targets (assumed)"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Skip(&[("true", "passes and copies beside each other")]), advice: []},
        /// Whether dispatches run beside passes, copies and other dispatches where neither writes what the other reads or writes.
        async_compute: bool ["", Allowed::Switch, "AMD 2012, GCN white paper: compute engines beside the graphics pipe. Maxwell parts its multiprocessors between both ahead of time (NVIDIA 2016, GTX 1080 white paper), which is not modelled"]
            {estimate: Ignored("cycles hardly depend on it"), relax: Skip(&[("true", "dispatches beside passes")]), advice: []},
        /// Whether a pass without draws only clears its attachments, and is not sent to pipelines.
        skip_empty_passes: bool ["", Allowed::Switch, "a pass is recorded before it is submitted: drivers see that it draws nothing"]
            {estimate: Used, relax: Skip(&[("true", "empty passes left out")]), advice: []},
        /// What is left out where bounds show that it lies outside the view volume.
        cull: CullChoice ["", Allowed::Choice(CullChoice::NAMES), "cards leave it to programs"]
            {estimate: RefusedUnless(Is(&["none"]), "tests of bounds"), relax: Skip(&[("draws", "draws culled by their bounds"), ("instances", "draws and instances culled by their bounds")]), advice: []},
        /// Cycles that a test of bounds takes, of a draw or of an instance.
        cull_cycles: u32 ["cycles/test", Allowed::Range(0, 65536), "assumed: eight corners of a box by four rows of a matrix, sixteen products per cycle"]
            {estimate: Ignored("without effect where command.cull is none"), relax: Interval, advice: []},
    }
}

/// The heading of the command processor in the statistics.
pub const COMMANDS: Heading = Heading::new("command", "Passes and draws, and what of them the command processor has left out.");

stats::counters! {
    /// What the command processor has done for passes, and left out.
    pub struct CommandCounts {
        /// Passes that pipelines have drawn.
        passes: "passes",
        /// Passes without draws that were not sent to pipelines.
        empty_passes: "passes",
        /// Passes, dispatches and copies that have begun while another one was under way.
        overlapped: "commands",
        /// Passes, draws, dispatches, copies and ends of frames that have waited for what was under way, where the machine overlaps any.
        waited: "commands",
        /// Changes of state between two draws of a pass, and the state of its first draw.
        state_changes: "changes",
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
        /// Surfaces copied because a pass loads what a free-running display holds, or to be shown (`scanout.swap`).
        present_copies: "copies",
        /// Their bytes, each read and written once.
        present_bytes: "bytes",
    }
}

/// Ports of the command processor.
#[derive(Clone)]
pub struct CommandPorts {
    /// Segments and fences, to vertex fetch.
    pub fetch: Out<Piece>,
    /// Runs of workgroups, to compute dispatch.
    pub compute: Out<Piece>,
    /// Runs that are done.
    pub computed: In<Ack>,
    /// Attachments to be resolved, to each pipeline's resolve unit.
    pub resolve: Vec<Out<Piece>>,
    /// Attachments of which a unit has resolved its blocks.
    pub resolved: Vec<In<Ack>>,
    /// Surfaces to be shown.
    pub scanout: Out<Piece>,
    /// Surfaces that were.
    pub scanned: In<Ack>,
    /// Passes to be composed, to each composition unit.
    pub compose: Vec<Out<Piece>>,
    /// Passes that each composition unit has composed.
    pub composed: Vec<In<Ack>>,
    /// Fences seen by each colour unit, and passes ended by each depth unit.
    pub acks: Vec<In<Ack>>,
    /// Segments that are binned, where a unit bins them.
    pub binned: Vec<In<Ack>>,
    /// The draw that may be rasterised, to each distribution unit. Used where a draw waits for the draw before it (`command.drain`).
    pub next_draw: Vec<Out<NextDraw>>,
    /// Memory, for copies and clears.
    pub memory: MemoryPort,
    /// Its state is 1 while there is a pass or a dispatch, else 0. It watches all units of the pipelines.
    pub probe: StallProbe,
}

/// The state of the command processor.
#[derive(Clone, Debug)]
enum State {
    /// The next event.
    Ready,
    /// Attachments are being cleared in memory: those still to do.
    Clearing,
    /// The pass drains, and nothing begins before it has ended.
    Ending,
    /// Memory is moved, and nothing begins before that is done.
    Moving,
    /// The frame's picture is read; or, of a free-running display, a buffer is waited for.
    Scanning,
    /// The frame is copied to the buffer that is shown.
    Presenting,
    /// The frame is over, until the run takes the machine up again.
    Over,
}

/// The stage of a pass's end.
#[derive(Clone, Debug)]
enum EndStage {
    /// Pipelines drain: their reports of its end still to come.
    Reports(u32),
    /// Copies of the attachments are being composed: units that still have to be started, and units that are not done.
    Composing(usize, usize),
    /// Attachments are being resolved: locations to be handed on, and how many reports of units are still to come.
    Resolving(VecDeque<u16>, u32),
}

/// A pass whose end has been sent to the pipelines.
#[derive(Clone, Debug)]
struct Ending {
    /// Its slot.
    pass: u8,
    /// Its number among what is under way.
    number: Option<u32>,
    stage: EndStage,
}

/// A transfer under way.
#[derive(Clone, Copy, Debug)]
struct Moving {
    /// When its command is decoded.
    from: Cycle,
    /// Its number among what is under way.
    number: Option<u32>,
    /// Surfaces that become others when it is done.
    surfaces: Option<(Surface, Surface)>,
}

/// The command processor. Its items are events.
#[derive(Clone)]
pub struct Command {
    config: CommandConfig,
    fast_clear: bool,
    clears_per_cycle: u32,
    scanout: bool,
    /// Handing frames to a free-running display.
    present: Option<Present>,
    /// Whether work that may overlap is tracked.
    tracks: bool,
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
    /// Free slots.
    free: Vec<u16>,
    /// The reports still to come for each slot in use.
    reports: Vec<u32>,
    /// The number of segments in flight.
    segments: u32,
    /// The states of the draws in flight.
    states: States,
    /// Slots in flight with their draws, in the order of the draws. Used where draws wait for each other (`command.drain`).
    flying: VecDeque<(u16, u32)>,
    /// The draw whose turn was sent last.
    turn: Option<u32>,
    free_runs: Vec<u16>,
    /// Surfaces to be cleared in memory: address and bytes.
    clears: VecDeque<(u64, u64)>,
    /// Passes that drain, in the order in which they began.
    endings: VecDeque<Ending>,
    /// Whether a pass has begun whose end has not been read.
    in_pass: bool,
    /// All that is under way, where it is tracked.
    ongoing: AllOngoing,
    /// Whether the event at the head has waited for something under way.
    held: bool,
    /// The first cycle in which what has waited for a pass can begin.
    barrier: Cycle,
    stream: Stream,
    /// The transfer that the stream makes.
    moving: Option<Moving>,
    /// The depth surface whose hierarchical Z is still true.
    depth_known: Option<SurfaceKey>,
    /// The last pass that sent the known depths to all pipelines, and these depths, as ordered keys.
    depth_began: (u32, (u32, u32)),
    /// The depth surface that a pass without draws has cleared since, and its depths as ordered keys.
    depth_cleared: Option<(SurfaceKey, (u32, u32))>,
    /// The frame that ended.
    ended: Option<EndFrame>,
    counts: CommandCounts,
    waits: PassWaits,
    items: u64,
}

impl Command {
    /// The depth surface whose hierarchical Z holds when the next pass begins, if that loads it.
    pub fn depth_known(&self) -> Option<SurfaceKey> {
        self.depth_known
    }

    /// A command processor at the beginning of the stream, of a machine that has `pipelines` pipelines and holds `segments` segments.
    /// `clearing` is whether clears are by flag, and the number of blocks that all pipelines together clear per cycle.
    pub fn new(
        config: CommandConfig,
        (pipelines, segments): (u32, u32),
        clearing: (bool, u32),
        scanout: &ScanoutConfig,
        ports: CommandPorts,
    ) -> Command {
        let segments = segments as u16;
        let runs = config.workgroup_runs as u16;
        Command {
            fast_clear: clearing.0,
            clears_per_cycle: clearing.1,
            scanout: scanout.enabled,
            present: scanout.runs_free().then(|| Present::new(scanout)),
            tracks: config.overlap || config.async_compute,
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
            segments: 0,
            states: States::new(config.states, usize::from(segments)),
            flying: VecDeque::new(),
            turn: None,
            free_runs: (0..runs).rev().collect(),
            clears: VecDeque::new(),
            endings: VecDeque::new(),
            in_pass: false,
            ongoing: AllOngoing::new(usize::from(runs)),
            held: false,
            barrier: 0,
            moving: None,
            stream: Stream::new(config.copy_misses),
            depth_known: None,
            depth_began: (0, (0, u32::MAX)),
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

    /// The time that each pipeline has waited, at the ends of passes, for the others.
    pub fn waits(&self) -> &PassWaits {
        &self.waits
    }

    /// The counters of the unit.
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
            && self.endings.is_empty()
            && self.moving.is_none()
    }

    /// Installs the segment at the head of the events for functional warming, if nothing is in flight; gives its slot.
    pub fn apply(&mut self, card: &mut Card) -> Option<u16> {
        let (Some(Event::Applied(segment)), Some(draw)) = (card.events.front(), &self.draw) else { return None };
        let slot = *self.free.last().filter(|_| self.idle())?;
        card.install(slot, segment.clone(), draw.clone(), self.draws);
        card.events.pop_front();
        self.items += 1;
        Some(slot)
    }

    /// Tells distribution of the first draw in flight, if it has not heard of it.
    fn tell_turn(&mut self, wires: &mut Wires) -> Tick {
        let Some(&(_, draw)) = self.flying.front() else { return Tick::Starved };
        if self.turn == Some(draw) {
            return Tick::Starved;
        }
        if !self.ports.next_draw.iter().all(|port| wires.can_push(port)) {
            return Tick::Blocked;
        }
        self.ports.next_draw.iter().for_each(|port| wires.push(port, NextDraw { draw }));
        self.turn = Some(draw);
        Tick::Moved
    }

    /// Workgroups are under way.
    fn computing(&self) -> bool {
        self.free_runs.len() < self.config.workgroup_runs as usize
    }
}

impl Command {
    fn step(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        // 1. Reports free slots and end passes.
        let mut did = Tick::moved_or(self.collect(wires, card), Tick::Starved);

        did = did.or(self.wait_for_display(wires, card)).or(self.tell_turn(wires));

        // 2. Pieces go on their way.
        while let Some(&piece) = self.pieces.front() {
            let port = if self.in_pass || piece.kind.is_fence() { &self.ports.fetch } else { &self.ports.compute };
            if !wires.try_push(port, piece) {
                did = did.or(Tick::Blocked);
                break;
            }
            self.pieces.pop_front();
            did = Tick::Moved;
        }

        // 3. Work under way beside the next command goes on.
        if self.tracks {
            did = did.or(self.end_passes(wires, card)).or(self.move_memory(wires, card));
        }

        // 4. The work of the last command goes on, once the command is decoded.
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

        // 5. The next event, as soon as there is place for what it brings.
        if self.pieces.is_empty() && self.event(wires, card).is_some() {
            did = Tick::Moved;
        }
        did
    }
}

impl Unit<Card> for Command {
    fn tick(&mut self, wires: &mut Wires, card: &mut Card) -> Tick {
        let did = self.step(wires, card);
        let drains = |ending: &Ending| !matches!(ending.stage, EndStage::Resolving(..));
        let drawing = self.in_pass || self.endings.iter().any(drains);
        wires.set_probe(&self.ports.probe, u8::from(drawing || self.computing()));
        did
    }

    fn items(&self) -> u64 {
        self.items
    }

    fn resident(&self) -> u64 {
        (self.reports.len() - self.free.len() + self.pieces.len()) as u64 + self.stream.resident()
    }

    fn counted(groups: &mut Counted<Self>) {
        groups.group(COMMANDS, |unit| unit.counts);
    }
}
