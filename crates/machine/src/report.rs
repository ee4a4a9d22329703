//! What a run leaves behind: statistics by frame, and pictures.

use std::rc::Rc;

use super::Machine;
use super::loss::{Accounts, LossCounts, Waits};
use super::readings::Readings;
use super::tally::{PhaseReport, Tallies};
use num::Cycle;
use sim::{Circuit, UNITS, UnitCounts};
use stats::{Declaration, FrameCounts, Group, Heading, Leaf, SECONDS, Tree};
use unit::network::Traffic;
use unit::scanout::Shown;
use unit::sorting::{OrderCounts, SortCounts};
use work::{EndFrame, Surface};

/// The picture of a frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Its format and size.
    pub surface: Surface,
    /// Its bytes, laid out as in [`Contents`](work::Contents): the machine's own, unless the last writer was no draw.
    pub bytes: Vec<u8>,
    /// Pixels in which the machine's bytes differ from those of API order.
    pub wrong_pixels: u64,
}

/// A frame.
#[derive(Clone, Debug)]
pub struct FrameReport {
    /// The trace's own number.
    pub number: u32,
    /// Cycles that it took.
    pub cycles: Cycle,
    /// The same in seconds, at the card's clock.
    pub seconds: f64,
    /// Its statistics, by the names of the design.
    pub tree: Tree,
    /// What the command processor did one after another: the cycles add up to the frame's.
    pub phases: Vec<PhaseReport>,
    /// What was shown.
    pub picture: Option<Picture>,
    /// What a free-running display has shown since the frame before.
    pub shown: Shown,
}

/// Where the statistics say what sorting costs.
pub const SORTING: Heading = Heading::new("sort", "What redistribution costs.");

/// Where they say where the cycles of the pipelines go.
pub const SORTING_LOSS: Heading = Heading::new(
    "sort.loss",
    "Where the cycles of the pipelines go: work, and what each cause made them lose, at one stage. The busiest unit of the stage in each pipeline stands for the pipeline; cycles in which not even the busiest of them worked count once for each pipeline. Docs: `sort-classes.md`, \"Where the rest goes\".",
);

/// Where they say what the network that sorts has carried.
pub const SORTING_NETWORK: Heading = Heading::new("sort.network", "The network that sorts.");

/// The sort class of the machine.
pub const CLASS: Declaration = Declaration::new("class", "", "The sort class of the machine.");

/// The mean number of copies per item that was sent.
pub const OVERLAP: Declaration = Declaration::new(
    "overlap",
    "ratio",
    "Copies sent by items sent at all (`redistributed_items` by `sent`): how many pipelines the average item meets that meets any. At least 1 where there is one.",
);

/// How uneven the load of the pipelines is.
pub const LOAD_IMBALANCE: Declaration =
    Declaration::new("load_imbalance", "ratio", "Quads of the busiest pipeline, divided by the mean of all; 1 is even.");

/// The passes whose picture needs an order that the machine does not keep.
pub const PASSES_OUT_OF_ORDER: Declaration =
    Declaration::new("passes_out_of_order", "", "Numbers and labels of the passes that need order, up to 16.");

/// Pixels that are not those of API order.
pub const WRONG_PIXELS: Declaration = Declaration::new(
    "wrong_pixels",
    "pixels",
    "Pixels of the shown pictures that differ from API order; 0 on every machine that keeps it.",
);

/// The stage at which the cycles of the pipelines are split.
pub const STAGE: Declaration = Declaration::new(
    "stage",
    "",
    "The stage of the pipelines whose busiest unit worked most; of a run, that with most work over its frames.",
);

/// The part of the pipelines' cycles that is useful.
pub const EFFICIENCY: Declaration =
    Declaration::new("efficiency", "ratio", "`useful` by `pipeline_cycles`: what the pipelines reach of linear speed-up.");

stats::counters! {
    /// What a sort class counts whose pipelines do not keep API order among them; the others have no such counter.
    pub struct PassOrderCounts {
        /// Sort-last-image: passes whose picture may depend on an order that its pipelines do not keep: blended, stencilled, or with draws that treat depths or channels differently.
        passes_needing_order: "passes",
    }
}

/// A run.
#[derive(Clone, Debug)]
pub struct MachineReport {
    /// Its frames.
    pub frames: Vec<FrameReport>,
    /// Its statistics.
    pub total: Tree,
    /// Cycles in all.
    pub cycles: Cycle,
    /// What a free-running display has shown since the last frame ended.
    pub shown: Shown,
    /// What the statistics are made of.
    pub totals: Totals,
}

/// What a machine has counted in a run. The totals of runs of frames that follow each other add up to those of all.
#[derive(Clone, Debug)]
pub struct Totals {
    span: Span,
    sums: Sums,
}

impl Totals {
    /// Adds the frames of a later run on a machine of the same configuration.
    pub fn add(&mut self, later: &Totals) {
        self.span.add(&later.span);
        self.sums.add(&later.sums);
    }

    /// Cycles in all.
    pub fn cycles(&self) -> Cycle {
        self.span.cycles()
    }

    /// The statistics, of a machine of that configuration.
    pub fn tree(&self, machine: &Machine) -> Tree {
        statistics(machine, &self.span, &self.sums)
    }
}

/// What was counted between two readings.
#[derive(Clone, Debug)]
struct Span {
    counts: Readings,
    /// What went through each unit.
    items: Vec<u64>,
    sort: SortCounts,
    order: OrderCounts,
    /// Numbers and labels of the passes that need an order which the machine does not keep.
    disordered: Vec<(u32, String)>,
}

impl Span {
    fn between(machine: &Machine, earlier: &Reading, now: &Reading) -> Span {
        Span {
            counts: now.counts.since(&earlier.counts),
            items: now.items.iter().zip(&earlier.items).map(|(now, then)| now - then).collect(),
            sort: now.sort.since(&earlier.sort),
            order: now.order.since(&earlier.order),
            disordered: machine.card.disordered[earlier.disordered..now.disordered].to_vec(),
        }
    }

    fn cycles(&self) -> Cycle {
        self.counts.wires.cycle
    }

    fn add(&mut self, later: &Span) {
        self.counts.add(&later.counts);
        self.items.iter_mut().zip(&later.items).for_each(|(sum, own)| *sum += own);
        self.sort += later.sort;
        self.order += later.order;
        self.disordered.extend_from_slice(&later.disordered);
    }
}

/// A reading where a frame ends: with all counters, what sorting counts and what pipelines have waited for.
#[derive(Clone, Debug)]
struct Reading {
    counts: Readings,
    /// What went through each unit.
    items: Vec<u64>,
    sort: SortCounts,
    order: OrderCounts,
    waits: Waits,
    /// Passes that need an order which the machine does not keep.
    disordered: usize,
}

/// Reads a machine at the ends of frames, phases and draws, and makes reports of them.
pub(super) struct Recorder {
    start: Rc<Reading>,
    last: Rc<Reading>,
    sums: Sums,
    tallies: Tallies,
}

/// Sums over frames that are no differences of counters.
#[derive(Clone, Debug, Default)]
struct Sums {
    wrong_pixels: u64,
    loss: LossCounts,
    /// By stage, the work of frames whose loss is measured there.
    stages: Vec<(&'static str, u64)>,
}

impl Sums {
    fn stage(&mut self, (stage, loss): (Option<&'static str>, LossCounts)) {
        self.loss += loss;
        let Some(stage) = stage else { return };
        self.work(stage, loss.useful + loss.overlap);
    }

    fn add(&mut self, later: &Sums) {
        self.wrong_pixels += later.wrong_pixels;
        self.loss += later.loss;
        later.stages.iter().for_each(|&(stage, work)| self.work(stage, work));
    }

    fn work(&mut self, stage: &'static str, work: u64) {
        match self.stages.iter_mut().find(|(known, _)| *known == stage) {
            Some((_, sum)) => *sum += work,
            None => self.stages.push((stage, work)),
        }
    }
}

/// What a machine has counted up to now.
fn read(machine: &mut Machine) -> Reading {
    machine.circuit.wires_mut().settle();
    let circuit = &machine.circuit;
    let sort = (machine.config.card.sort.class().sorting)(circuit);
    let mut order = OrderCounts::default();
    circuit.gather.iter().for_each(|unit| order += unit.counts());
    circuit.order.iter().for_each(|unit| order += unit.counts());
    circuit.setup.iter().for_each(|unit| order += unit.counts());
    circuit.bin.iter().for_each(|unit| order += unit.order());
    let disordered = machine.card.disordered.len();
    let items = circuit.tally().0;
    Reading { counts: Readings::of(machine), items, sort, order, waits: waits(machine), disordered }
}

/// What the pipelines have waited for up to now.
fn waits(machine: &Machine) -> Waits {
    let circuit = &machine.circuit;
    let class = machine.config.card.sort.class();
    Waits {
        senders: (class.senders)(circuit),
        order: (class.order)(circuit),
        passes: circuit.command.waits().waited().to_vec(),
        composing: circuit.compose.iter().map(|unit| unit.counts().cycles).collect(),
        instructions: circuit.core.iter().map(|core| core.instructions()).collect(),
        probes: circuit.wires().stall_probes().collect(),
    }
}

/// The split of the pipelines' cycles in a span. `waits` is what they waited for in it.
fn loss(machine: &Machine, span: &Span, waits: &Waits) -> (Option<&'static str>, LossCounts) {
    let names = machine.circuit.wires().units().map(|(name, _)| name);
    let units: Vec<_> = names.zip(span.counts.wires.units.iter().copied()).collect();
    let accounts = Accounts {
        class: machine.config.card.sort.class(),
        pipelines: machine.config.card.pipelines as usize,
        cycles: span.cycles(),
        units: &units,
        sort: span.sort,
        waits,
    };
    accounts.split()
}

/// Results of sorting that are not counters.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SortOutcome {
    /// Quads of the busiest pipeline by the mean of all.
    pub load_imbalance: f64,
    /// Pixels of the pictures that differ from API order's.
    pub wrong_pixels: u64,
    /// The stage of the pipelines at which their cycles are split.
    pub stage: String,
    /// The passes whose picture needs an order that the machine does not keep.
    pub passes_out_of_order: String,
}

impl SortOutcome {
    /// Reads it from the statistics of a machine; zeros and empty texts where they lack it.
    pub fn read(total: &Tree) -> SortOutcome {
        let leaf = |heading: Heading, of| heading.find(total).first().and_then(|sort| sort.leaf(of));
        let number = |of| leaf(SORTING, of).and_then(Leaf::number).unwrap_or(0.0);
        let text = |heading, of| leaf(heading, of).map_or("", Leaf::text).to_owned();
        SortOutcome {
            load_imbalance: number(&LOAD_IMBALANCE),
            wrong_pixels: number(&WRONG_PIXELS) as u64,
            stage: text(SORTING_LOSS, &STAGE),
            passes_out_of_order: text(SORTING, &PASSES_OUT_OF_ORDER),
        }
    }

    /// What the network that sorts has carried, where a machine has one.
    pub fn network(total: &Tree) -> Option<Traffic> {
        SORTING_NETWORK.find(total).first().map(|network| Traffic::read(network))
    }
}

/// The statistics of what was counted.
fn statistics(machine: &Machine, span: &Span, sums: &Sums) -> Tree {
    let Span { counts, items, sort, order, disordered } = span;
    let cycles = span.cycles();
    let mut tree = Tree::new();
    tree.extend(FrameCounts { cycles }.tree());
    tree.real(SECONDS.name, machine.config.seconds(cycles as f64));
    counts.put(machine, items, &mut tree);

    let traversed = UNITS.named("traverse").find(&tree).into_iter();
    let quads: Vec<u64> = traversed.map(|unit| unit.read::<UnitCounts>().items).collect();
    let (most, sum) = (quads.iter().copied().max().unwrap_or(0), quads.iter().sum::<u64>());
    let quotient = |a: f64, b: f64| if b == 0.0 { 0.0 } else { a / b };
    let leaves = SORTING.at(&mut tree, 0);
    leaves.text(CLASS.name, machine.config.card.sort.name());
    leaves.extend(sort.tree());
    leaves.real(OVERLAP.name, quotient(sort.redistributed_items as f64, sort.sent as f64));
    let stage = sums.stages.iter().rev().max_by_key(|(_, work)| *work);
    let outcome = SortOutcome {
        load_imbalance: quotient((most * quads.len() as u64) as f64, sum as f64),
        wrong_pixels: sums.wrong_pixels,
        stage: stage.map_or("", |(stage, _)| stage).to_owned(),
        passes_out_of_order: names(disordered),
    };
    leaves.real(LOAD_IMBALANCE.name, outcome.load_imbalance);
    leaves.extend(order.tree());
    leaves.count(WRONG_PIXELS.name, outcome.wrong_pixels);
    let split = SORTING_LOSS.at(&mut tree, 0);
    split.text(STAGE.name, &outcome.stage);
    split.real(EFFICIENCY.name, quotient(sums.loss.useful as f64, sums.loss.pipeline_cycles as f64));
    split.extend(sums.loss.tree());
    let leaves = SORTING.at(&mut tree, 0);
    if !machine.card.class_state.copies.is_empty() {
        leaves.extend(PassOrderCounts { passes_needing_order: disordered.len() as u64 }.tree());
        leaves.text(PASSES_OUT_OF_ORDER.name, &outcome.passes_out_of_order);
    }
    if let Some(network) = &machine.network {
        let traffic = network.traffic(&tree, cycles).tree();
        SORTING_NETWORK.at(&mut tree, 0).extend(traffic);
    }
    tree
}

/// The numbers and labels of some passes, as far as a line goes.
fn names(passes: &[(u32, String)]) -> String {
    const MOST: usize = 16;
    let name =
        |(number, label): &(u32, String)| if label.is_empty() { number.to_string() } else { format!("{number} {label}") };
    let mut text = passes.iter().take(MOST).map(name).collect::<Vec<_>>().join(", ");
    if passes.len() > MOST {
        text.push_str(&format!(" and {} more", passes.len() - MOST));
    }
    text
}

impl Recorder {
    /// The first reading.
    pub fn new(machine: &mut Machine) -> Recorder {
        let start = Rc::new(read(machine));
        let tallies = Tallies::new(machine, &start.counts);
        Recorder { last: start.clone(), start, sums: Sums::default(), tallies }
    }

    /// A phase has begun, or a draw has retired.
    pub fn mark(&mut self, machine: &mut Machine) {
        self.tallies.read(machine);
    }

    /// A frame has ended.
    pub fn frame(&mut self, machine: &mut Machine, end: Option<EndFrame>) -> FrameReport {
        let now = read(machine);
        let number = end.as_ref().map_or(0, |end| end.number);
        let picture = end.and_then(|end| {
            let shown = end.shown?;
            Some(match machine.card.drawn_picture(&end) {
                Some(store) => {
                    let bytes = store.to_bytes();
                    let wrong_pixels = store.differing(&bytes, &end.reference);
                    Picture { surface: shown, bytes, wrong_pixels }
                }
                None => Picture { surface: shown, bytes: end.reference.to_vec(), wrong_pixels: 0 },
            })
        });
        let wrong_pixels = picture.as_ref().map_or(0, |picture| picture.wrong_pixels);
        let span = Span::between(machine, &self.last, &now);
        let loss = loss(machine, &span, &now.waits.since(&self.last.waits));
        self.sums.wrong_pixels += wrong_pixels;
        self.sums.stage(loss);
        let mut sums = Sums { wrong_pixels, ..Sums::default() };
        sums.stage(loss);
        let (tree, cycles) = (statistics(machine, &span, &sums), span.cycles());
        let phases = self.tallies.frame(machine, &self.last.counts, &now.counts);
        self.last = Rc::new(now);
        let shown = machine.circuit.scanout.take_shown();
        FrameReport { number, cycles, seconds: machine.config.seconds(cycles as f64), tree, phases, picture, shown }
    }

    /// The run has ended.
    pub fn total(mut self, machine: &mut Machine) -> MachineReport {
        // Where no cycle has gone by since the last frame, nothing was counted.
        let same = machine.circuit.wires().now() == self.last.counts.wires.cycle;
        let now = if same { self.last.clone() } else { Rc::new(read(machine)) };
        let rest = Span::between(machine, &self.last, &now);
        self.sums.stage(loss(machine, &rest, &now.waits.since(&self.last.waits)));
        let totals = Totals { span: Span::between(machine, &self.start, &now), sums: self.sums };
        let shown = machine.circuit.scanout.take_shown();
        MachineReport { frames: Vec::new(), total: totals.tree(machine), cycles: totals.cycles(), shown, totals }
    }
}
