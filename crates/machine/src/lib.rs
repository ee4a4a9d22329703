//! Floor 4: machines. A configuration says what a machine is made of; each sort class has one file that lists its units.
//!
//! # Example
//!
//! ```
//! use gfx::format::Format;
//! use machine::{Config, Machine};
//! use sim::Clock;
//! use trace::record::{self, Recorder};
//!
//! // A pass that clears a texture to red, and a present that ends the frame.
//! let mut card = Recorder::new("clear");
//! let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
//! let view = card.create_view(target);
//! drop(card.begin_render_pass([record::clear(view, [1.0, 0.0, 0.0, 1.0])], None));
//! card.present(target);
//!
//! // The machine is given the work that the renderer leaves.
//! let config = Config::built_in("tiny")?;
//! let mut events = Vec::new();
//! let options = render::Options { key: config.render_key(), record: true, ..render::Options::default() };
//! render::render(&card.finish(), &options, &mut |event| {
//!     events.push(event);
//!     Ok(())
//! })?;
//! let report = Machine::new(&config)?.run(events.into_iter(), Clock::SkipIdle)?;
//! let picture = report.frames[0].picture.as_ref().expect("a frame that shows the texture");
//! assert_eq!(picture.bytes[..4], [255, 0, 0, 255]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod blocks;
pub mod class;
pub mod config;
mod drawing;
mod loss;
pub mod parts;
mod readings;
mod report;
mod sort_first;
mod sort_last_fragment;
mod sort_last_image;
mod sort_middle;
mod sort_middle_binned;
mod tally;
mod watch;

#[cfg(test)]
mod tests;

pub use config::{Config, ConfigError};
pub use loss::LossCounts;
pub use report::{
    CLASS, EFFICIENCY, FrameReport, LOAD_IMBALANCE, MachineReport, OVERLAP, PASSES_OUT_OF_ORDER, PassOrderCounts, Picture,
    SORTING, SORTING_LOSS, SORTING_NETWORK, STAGE, SortOutcome, Totals, WRONG_PIXELS,
};
pub use tally::{CounterGroup, DrawReport, Moved, PhaseReport, SHADING, Spent, Tally};
pub use unit::card::notes::{BlockNotes, PassNotes};
pub use unit::scanout::{Refresh, Shown};
pub use watch::Watcher;

use std::collections::VecDeque;

use self::blocks::Built;
use class::{BuildError, Sorted};
use drawing::Drawing;
use mem::{ClientCounts, Crossbar, requests};
use num::{Cycle, Limit, LimitOverrun, Limits, NEVER, OUR_FAULT};
use parts::Parts;
use report::Recorder;
use sim::{self, Circuit, Clock, Stuck, Wire};
use unit::Fault;
use unit::apply::{WarmedUnits, apply};
use unit::card::notes::Notes;
use unit::card::{Card, Pool};
use unit::class_state::ClassState;
use unit::interleave::Interleave;
use unit::network::NetworkMap;
use unit::phase::Phases;
use unit::sorting::{EarlyTest, Keep};
use unit::touch::{Touch, Touching};
use unit::warp::Warps;
use work::{EndFrame, Event, LINE, Surface};

/// Why a run stopped before its end.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum MachineError {
    /// Nothing can move any more.
    #[error(transparent)]
    Stuck(#[from] Stuck),
    /// Only a free-running display moves, and what is drawn never ends.
    #[error("nothing but the display has moved for {times} refreshes and more; what is drawn is stuck\n{OUR_FAULT}\n{0}", times = drawing::REFRESHES)]
    Drawing(String),
    /// The machine cannot do what the work asks, or the work is wrong.
    #[error(transparent)]
    Fault(#[from] Fault),
    /// The run takes more cycles than the limits allow.
    #[error(transparent)]
    Limit(#[from] LimitOverrun),
    /// Something was left inside at the end.
    #[error("at the end of the run something was left in the machine: {0}. {OUR_FAULT}")]
    Left(String),
}

/// What a run may take.
#[derive(Clone, Copy, Debug)]
struct Most {
    cycles: Limit,
    steps: Limit,
}

/// Cycles between two looks at the steps of a run.
const LOOK: Cycle = 1 << 14;

/// Steps of a machine for each step of a program that a warp begins.
const BEGIN_STEPS: u64 = 16;

/// Steps of a machine for each unit and channel of which a frame's report has counters.
const REPORT_STEPS: u64 = 48;

/// Events that are read ahead of the command processor.
const AHEAD: usize = 2;

/// A machine, from cycle 0 on. A clone goes on exactly as the machine itself would.
pub struct Machine {
    config: Config,
    circuit: Parts,
    card: Card,
    clients: Vec<(&'static str, usize)>,
    network: Option<NetworkMap>,
    /// The most cycles and steps of a run; none: as many as it takes.
    most: Option<Most>,
}

/// Written out: what a derived one calls is compiled again in each package that clones a machine.
impl Clone for Machine {
    fn clone(&self) -> Machine {
        let Machine { config, circuit, card, clients, network, most } = self;
        Machine {
            config: config.clone(),
            circuit: circuit.clone(),
            card: card.clone(),
            clients: clients.clone(),
            network: network.clone(),
            most: *most,
        }
    }
}

impl Machine {
    /// The machine of a configuration.
    ///
    /// # Errors
    /// If knobs do not fit each other.
    pub fn new(config: &Config) -> Result<Machine, ConfigError> {
        config.check()?;
        let rule = |why: BuildError| ConfigError::Rule { file: config.name.clone(), rule: why.into() };
        let class = config.card.sort.class();
        let Built { parts: circuit, clients, network } = (class.build)(config).map_err(rule)?;
        let card = Card::new(
            config.card.pipelines as usize,
            config.segments() as usize,
            config.command.workgroup_runs as usize,
            Interleave::new(config.distribute.pattern, config.card.pipelines, config.owned_tile()),
            config.core.execution,
            (class.state)(config),
        );
        Ok(Machine { config: config.clone(), circuit, card, clients, network, most: None })
    }

    /// The same machine, which stops with an error behind the cycle that is the limit, and soon behind the step that is the limit.
    pub fn within(self, limits: &Limits) -> Machine {
        Machine { most: Some(Most { cycles: limits.work_cycles, steps: limits.work_machine }), ..self }
    }

    /// From now on, each draw of a pass is reported. No result depends on it.
    pub fn watch_draws(&mut self) {
        self.card.phases = Phases::new(true);
    }

    /// From now on, what happens to blocks is noted, for maps. To be called before the first event.
    pub fn watch_blocks(&mut self) {
        self.card.notes = Some(Box::default());
    }

    /// What was noted of the blocks of each pass since, in their order; empty unless notes were asked for.
    pub fn take_notes(&mut self) -> Notes {
        self.card.notes.as_mut().map(|notes| std::mem::take(&mut **notes)).unwrap_or_default()
    }

    /// What memory's clients have counted, in the order of their ports.
    fn client_counts(&self) -> &[ClientCounts] {
        match (&self.circuit.crossbar, &self.circuit.ideal) {
            (Some(crossbar), _) => crossbar.counts(),
            (None, Some(ideal)) => ideal.counts(),
            (None, None) => &[],
        }
    }

    /// Images that a machine has of each attachment of a pass: its frame buffer, and pipelines' copies, each with as many bytes of numbers.
    pub fn images(config: &Config) -> u64 {
        let ClassState { copies, seen, .. } = (config.card.sort.class().state)(config);
        (1 + 2 * copies.len() + seen.len()) as u64
    }

    /// Pieces of work that a machine has at one time, pieces that it reads ahead included.
    pub fn pieces(config: &Config) -> u64 {
        u64::from(config.segments()) + u64::from(config.command.workgroup_runs) + AHEAD as u64
    }

    /// The configuration.
    pub fn config(&self) -> &Config {
        &self.config
    }

    /// The name of each unit and its number among those of that name, in data-flow order.
    pub fn units(&self) -> impl Iterator<Item = (&'static str, usize)> {
        self.circuit.wires().units()
    }

    /// Each channel, with the units at its ends by their place in [`Machine::units`].
    pub fn wires(&self) -> impl Iterator<Item = Wire> {
        self.circuit.wires().wires()
    }

    /// Runs a stream of events to its end and keeps every frame's report.
    ///
    /// # Errors
    /// Why the run stopped before its end.
    pub fn run(&mut self, events: impl Iterator<Item = Event>, clock: Clock) -> Result<MachineReport, MachineError> {
        let mut frames = Vec::new();
        let total = self.run_each(events, clock, |frame| frames.push(frame))?;
        Ok(MachineReport { frames, ..total })
    }

    /// Runs a stream of events to its end and hands out each frame's report as it ends. The report that is returned has no
    /// frames.
    ///
    /// # Errors
    /// Why the run stopped before its end.
    pub fn run_each(
        &mut self,
        events: impl Iterator<Item = Event>,
        clock: Clock,
        each: impl FnMut(FrameReport),
    ) -> Result<MachineReport, MachineError> {
        self.run_watched(events, clock, each, None)
    }

    /// As [`Machine::run_each`], with a watcher that reads the machine meanwhile. Results do not depend on it.
    ///
    /// # Errors
    /// Why the run stopped before its end.
    pub fn run_watched(
        &mut self,
        mut events: impl Iterator<Item = Event>,
        clock: Clock,
        mut each: impl FnMut(FrameReport),
        watcher: Option<&mut dyn Watcher>,
    ) -> Result<MachineReport, MachineError> {
        let mut recorder = Recorder::new(self);
        self.drive(&mut events, clock, Some((&mut recorder, &mut each)), watcher)?;
        Ok(recorder.total(self))
    }

    /// Functional warming with a stream of events to its end: afterwards the machine holds what it would hold if it had drawn them, as far as
    /// that does not depend on time. Nothing is reported. What is neither a draw nor a scan-out is simulated.
    ///
    /// # Errors
    /// Why the run stopped before its end. A sort class whose draws cannot be applied in place is a fault.
    pub fn warm(&mut self, events: impl Iterator<Item = Event>, clock: Clock) -> Result<(), MachineError> {
        let mut applied = events.map(|event| match event {
            Event::Segment(segment) => Event::Applied(segment),
            other => other,
        });
        self.drive(&mut applied, clock, None, None)
    }

    /// What the second level has after a surface was scanned out.
    fn scanned_out(&mut self, surface: &Surface) {
        let circuit = &mut self.circuit;
        let Some(interleave) = circuit.crossbar.as_ref().map(Crossbar::interleave) else { return };
        let texel = u64::from(surface.format.block_bytes()) * u64::from(surface.samples);
        let end = surface.address + u64::from(surface.width) * u64::from(surface.height) * texel;
        for address in (surface.address..end).step_by(LINE as usize) {
            let (slice, address) = interleave.split(address);
            circuit.l2[slice as usize].visit(address, LINE as u32, false);
        }
    }

    /// Whether functional warming ([`apply`](unit::apply)) leaves on this machine what simulating a frame leaves. On the others it does not: a
    /// tile-based machine draws tile after tile, each with all draws of a pass; pipelines of sort-last image draw into copies; with
    /// some policies of sort-last fragment draws do not end in order, or are tested against depths of one pipeline; and with masked writes it
    /// is a matter of time which blocks are written in part, raw.
    pub fn warms(config: &Config) -> bool {
        let class = config.card.sort.class();
        let in_order = config.order.keep == Keep::Always && config.order.early != EarlyTest::Local;
        class.in_place && (class.sorted != Sorted::Fragments || in_order) && !config.color.masked_writes
    }

    /// Runs a stream of events to its end; readings are taken for a report of each frame, or none.
    fn drive(
        &mut self,
        events: &mut dyn Iterator<Item = Event>,
        clock: Clock,
        mut recorder: Option<(&mut Recorder, &mut dyn FnMut(FrameReport))>,
        mut watcher: Option<&mut dyn Watcher>,
    ) -> Result<(), MachineError> {
        // Without a watcher, one comparison in each cycle that is visited.
        let next = |watcher: &dyn Watcher| watcher.due().min(watcher.looks());
        let mut due = watcher.as_deref().map_or(NEVER, next);
        let last = self.most.map_or(NEVER, |most| most.cycles.get());
        // When the steps are looked at next, and the limit once they have passed it.
        let (mut look, mut passed) = (self.most.map_or(NEVER, |_| self.circuit.wires().now() / LOOK * LOOK + LOOK), None);
        let steps = self.most.map(|most| most.steps);
        let report = REPORT_STEPS * (self.wires().count() + self.units().count()) as u64;
        let mut reported = 0_u64;
        self.card.closed = false;
        let sort = self.config.card.sort;
        // A free-running display is never quiet; what is on its way when a frame ends belongs to the next. Behind the last frame it is switched
        // off, unless it is to show that or frames follow elsewhere.
        let free = self.config.scanout.runs_free();
        let shows_last = self.config.scanout.show_last;
        // Without reports, scan-out of a frame takes no simulated time.
        let mut scanned_out = VecDeque::new();
        let mut drawing = Drawing::default();
        loop {
            // 1. There is always an event for the command processor to read, until the last.
            while !self.card.closed && self.reads_ahead() {
                match events.next() {
                    Some(Event::Applied(_)) if !sort.class().in_place => {
                        return Err(Fault::FunctionalWarming { class: sort.name() }.into());
                    }
                    Some(Event::EndFrame(end)) if recorder.is_none() && !free => {
                        let shown = end.shown.filter(|_| self.config.scanout.enabled);
                        scanned_out.push_back(shown);
                        self.card.events.push_back(Event::EndFrame(EndFrame { shown: None, ..end }));
                    }
                    Some(event) => self.card.events.push_back(event),
                    None => self.card.closed = true,
                }
            }

            // 2. Run until events are short, a frame is over, or all is done.
            self.circuit.wires_mut().wake_all();
            let patience = u64::from(self.config.card.watchdog);
            let mut done = |circuit: &Parts, card: &Card| {
                // The clock may have jumped over several of them.
                while circuit.wires().now() >= due
                    && let Some(watcher) = &mut watcher
                {
                    if watcher.due() == due {
                        watcher.read(circuit.reading_at(due));
                    }
                    if watcher.looks() == due {
                        watcher.look(circuit.wires(), card, &|| circuit.tally().1);
                    }
                    due = next(&**watcher);
                }
                let now = circuit.wires().now();
                if now >= look {
                    let at = now / LOOK * LOOK;
                    look = at + LOOK;
                    let begun: u64 = circuit.core.iter().chain(&circuit.vertex_core).map(|core| core.begun()).sum();
                    let others = BEGIN_STEPS.saturating_mul(begun).saturating_add(reported);
                    passed = steps.filter(|steps| circuit.wires().steps_at(at).saturating_add(others) > steps.get());
                }
                // In most cycles the command processor is at an event that is not the last one, and nothing asks for a stop.
                let (at, fault) = (&circuit.command, card.fault.is_some());
                let over = now > last || passed.is_some();
                let stops = fault | over | card.phases.marked() | circuit.scanout.captures() | free;
                if card.events.len() > 1 && !(stops | at.idle() | at.frame_over()) {
                    return false;
                }
                // Whether a pass has draws the command processor sees at the event behind its begin.
                let short = match card.events.front() {
                    None => true,
                    Some(Event::BeginPass(_)) => !card.closed && card.events.len() == 1,
                    // The last frame switches a display off.
                    Some(Event::EndFrame(_)) => free && !card.closed && card.events.len() == 1,
                    Some(Event::FramesFollow) => true,
                    Some(_) => false,
                };
                let applies = matches!(card.events.front(), Some(Event::Applied(_)));
                let done = short && (!card.closed || circuit.command.idle());
                // What is still on its way to memory belongs to the frame.
                let quiet = || quiet(circuit);
                let stops = card.fault.is_some()
                    || over
                    || card.phases.marked()
                    || circuit.scanout.captures()
                    || applies && circuit.command.idle()
                    || free && drawing.is_stuck(circuit, patience);
                let stays = free && matches!(card.events.front(), Some(Event::FramesFollow));
                let goes_on = free && (shows_last || !card.closed || !card.events.is_empty());
                stops
                    || if circuit.command.frame_over() {
                        goes_on || quiet()
                    } else {
                        done && (!card.closed || stays || quiet())
                    }
            };
            let ran = loop {
                let ran = sim::run(&mut self.circuit, &mut self.card, clock, patience, &mut done);
                let captured = self.circuit.scanout.capture(&self.card);
                let marked = self.card.phases.marked();
                if ran.is_err() || !(marked || captured) {
                    break ran;
                }
                if marked && let Some((recorder, _)) = &mut recorder {
                    recorder.mark(self);
                } else if marked {
                    self.card.phases.forget();
                }
            };
            // A machine with a fault may well be stuck; the fault is why.
            if let Some(fault) = self.card.fault.take() {
                return Err(fault.into());
            }
            ran?;
            let cycles = self.most.map(|most| most.cycles).filter(|cycles| self.circuit.wires().now() > cycles.get());
            if let Some(limit) = cycles.or(passed) {
                return Err(LimitOverrun::of(limit).into());
            }
            if free && drawing.is_stuck(&self.circuit, patience) {
                return Err(MachineError::Drawing(Drawing::contents(&self.circuit)));
            }
            if self.apply() {
                continue;
            }

            // 3. A frame is over: read everything.
            if self.circuit.command.frame_over() {
                let end = self.circuit.command.take_frame();
                if let Some(watcher) = &mut watcher {
                    watcher.read(self.circuit.reading());
                }
                let Some((recorder, each)) = &mut recorder else {
                    if let Some(surface) = scanned_out.pop_front().flatten()
                        && self.card.frame.find(surface.key).is_some()
                    {
                        self.scanned_out(&surface);
                    }
                    self.card.phases.forget();
                    continue;
                };
                let frame = recorder.frame(self, end);
                reported = reported.saturating_add(report);
                if let Some(watcher) = &mut watcher {
                    watcher.settled(self.circuit.reading());
                    due = next(&**watcher);
                }
                each(frame);
            } else if self.card.closed && self.circuit.command.idle() {
                match self.card.events.pop_front() {
                    None => return self.empty(),
                    // The display goes on.
                    Some(Event::FramesFollow) if free => return Ok(()),
                    Some(Event::FramesFollow) => {}
                    Some(event) => self.card.events.push_front(event),
                }
            }
        }
    }

    /// Functional warming of the segments at the head of the events that are marked for it; whether there was one.
    fn apply(&mut self) -> bool {
        let Machine { circuit, card, .. } = self;
        let interleave = circuit.crossbar.as_ref().map(Crossbar::interleave);
        let (mut any, mut touched) = (false, Touching::new());
        while let Some(slot) = circuit.command.apply(card) {
            let Parts {
                route,
                fetch,
                deal,
                assembly,
                traverse,
                depth,
                color,
                texture,
                vertex_texture,
                constant,
                crossbar,
                l2,
                ..
            } = circuit;
            let mut units =
                WarmedUnits { route, fetch, deal, assembly, traverse, depth, color, texture, vertex_texture, constant };
            apply(card, slot, &mut units, &mut touched);
            card.work[usize::from(slot)] = None;
            any = true;
            let Some(interleave) = interleave else {
                // Memory without a second level keeps nothing.
                touched.clear();
                continue;
            };
            for Touch { port, address, bytes, write } in touched.drain(..) {
                for (address, bytes) in requests(address, bytes) {
                    crossbar.iter_mut().for_each(|crossbar| crossbar.visit(port, address));
                    let (slice, address) = interleave.split(address);
                    l2[slice as usize].visit(address, bytes, write);
                }
            }
        }
        any
    }

    /// Whether another event is to be read: until there are some, and where pipelines have runs of a pass until all of it is there,
    /// whose primitives are counted before the first is dealt.
    fn reads_ahead(&self) -> bool {
        let events = &self.card.events;
        let open = || {
            let edge = events.iter().rev().find(|event| matches!(event, Event::BeginPass(_) | Event::EndPass(_)));
            matches!(edge, Some(Event::BeginPass(_)))
        };
        events.len() < AHEAD || self.card.class_state.chunks && open()
    }

    /// Nothing may be left inside.
    fn empty(&self) -> Result<(), MachineError> {
        let pools = self.card.groups.iter().map(Pool::len).sum::<usize>();
        let warps = self.card.warps.iter().map(Warps::len).sum::<usize>();
        let (_, resident) = self.circuit.tally();
        let units = resident.iter().sum::<u64>();
        let channels = self.circuit.wires().resident();
        if pools == 0 && warps == 0 && units == 0 && channels == 0 {
            return Ok(());
        }
        let text =
            format!("{pools} groups of quads, {warps} warps, {units} items in units {resident:?}, {channels} in channels");
        Err(MachineError::Left(text))
    }
}

/// Whether nothing is in any channel or in the memory's units.
fn quiet(circuit: &Parts) -> bool {
    circuit.wires().resident() == 0 && circuit.tally().1.iter().all(|&resident| resident == 0)
}
