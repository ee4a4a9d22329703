//! Where the cycles of the pipelines go: what they work, and what sorting and the rest of the machine make them lose.
//!
//! All is measured at one stage, the one whose busiest unit worked most: nothing else could have made the machine faster. In each
//! pipeline the busiest unit of that stage stands for the pipeline. Of N pipelines and T cycles, N x T cycles are to be accounted for.
//! What each has worked is known, and so is by how much it has worked less than the busiest. In the cycles in which even that one did
//! not work, none of the others needed to work either, so that each of these cycles counts N times; the busiest one's account and what was
//! counted at the ends of the network say why. Each of its cycles goes to one cause, and no cause gets more than was counted for it:
//! the parts are whole numbers that add up to N x T.

use super::class::{Class, Sorted};
use super::parts::{Parts, PipelineSection};
use sim::{STATES, StallProbeCounts};
use stats::Cycles;
use unit::network::{SenderCounts, Stall};
use unit::sorting::SortCounts;

stats::counters! {
    /// What became of the cycles of the pipelines.
    pub struct LossCounts {
        /// Cycles of the frame, once for each pipeline. All that follow add up to this.
        pipeline_cycles: "cycles",
        /// The stage's work, without that on copies.
        useful: "cycles",
        /// The stage's work on copies after the first, in proportion to copies; for cores, on copies of vertices. Stages that work by
        /// quads have none.
        overlap: "cycles",
        /// Cycles that pipelines worked less than the busiest one, and cycles that the busiest one waited for others: at the ends of passes,
        /// and behind work for a pipeline that had no room.
        imbalance: "cycles",
        /// The network did not take what was to be sent, or frame buffers were composed.
        network: "cycles",
        /// Reorder stalls: what had come was not next in order.
        reorder_stalls: "cycles",
        /// Data from memory had not come, to the stage or to the units that fetch for it.
        memory: "cycles",
        /// Cores held warps, and the instructions that these had issued were not complete.
        latency: "cycles",
        /// Units upstream in the same pipeline had not done their part yet.
        upstream: "cycles",
        /// Backpressure: units downstream in the same pipeline had no room.
        downstream_backpressure: "cycles",
        /// Nothing had come to the pipeline from the front end: geometry in front of the network was behind, or a pass began or ended.
        front_end: "cycles",
        /// There was no pass: copies, resolves, scan-out.
        outside_pass: "cycles",
    }
}

/// Readings of all that pipelines wait for.
#[derive(Clone, Debug, Default)]
pub(super) struct Waits {
    /// By sender of the network that sorts.
    pub senders: Vec<SenderCounts>,
    /// By unit that restores the order there, where senders wait for it.
    pub order: Vec<u64>,
    /// By pipeline: for the others, at the ends of passes.
    pub passes: Vec<u64>,
    /// By pipeline: for the composition of frame buffers.
    pub composing: Vec<u64>,
    /// By core: instructions in all, and those of vertices.
    pub instructions: Vec<(u64, u64)>,
    /// What the probes counted: first the card's, by whether there was a pass, then those at the ends of the network, by their stalls.
    pub probes: Vec<StallProbeCounts>,
}

impl Waits {
    /// The difference from an earlier reading.
    pub fn since(&self, earlier: &Waits) -> Waits {
        let counts = |now: &[u64], then: &[u64]| now.iter().zip(then).map(|(now, then)| now - then).collect();
        let senders = self.senders.iter().zip(&earlier.senders).map(|(now, then)| now.since(then));
        let instructions =
            self.instructions.iter().zip(&earlier.instructions).map(|(now, then)| (now.0 - then.0, now.1 - then.1));
        Waits {
            senders: senders.collect(),
            order: counts(&self.order, &earlier.order),
            passes: counts(&self.passes, &earlier.passes),
            composing: counts(&self.composing, &earlier.composing),
            instructions: instructions.collect(),
            probes: self.probes.iter().zip(&earlier.probes).map(|(now, then)| now.since(then)).collect(),
        }
    }
}

/// A frame's accounts, and what its loss is found by.
pub(super) struct Accounts<'a> {
    pub class: &'static Class,
    pub pipelines: usize,
    pub cycles: u64,
    /// Names of the units, and their accounts.
    pub units: &'a [(&'static str, Cycles)],
    pub sort: SortCounts,
    pub waits: &'a Waits,
}

/// The stages of a class's pipelines.
fn stages(class: &Class) -> impl Iterator<Item = &'static str> {
    let own = class.sorted.own_geometry();
    let front = Parts::stages(PipelineSection::Geometry).filter(move |_| own);
    front.chain(Parts::stages(PipelineSection::Pixels)).chain(Parts::stages(PipelineSection::Rop))
}

/// Whether a bank is of a stage.
fn is_of(stage: PipelineSection, bank: &str) -> bool {
    Parts::stages(stage).any(|name| name == bank)
}

/// A part of a number.
fn part(of: u64, numerator: u64, denominator: u64) -> u64 {
    if denominator == 0 { 0 } else { (u128::from(of) * u128::from(numerator) / u128::from(denominator)) as u64 }
}

/// A unit that stands for its pipeline.
#[derive(Clone, Copy)]
struct Busiest {
    /// Its place among all units, and its number in its bank.
    place: usize,
    number: usize,
    account: Cycles,
}

/// The cycles in which the busiest unit of all had no input, or no work for another reason, by the state of the probe that watches it.
/// Causes take from them.
struct UnexplainedCycles {
    /// What is left, by the probe's state.
    left: [u64; STATES],
    pipelines: u64,
}

impl UnexplainedCycles {
    /// Takes at most `counted` of the cycles in these states. Returns the cycles taken, times the number of pipelines.
    fn take(&mut self, states: &[Stall], mut counted: u64) -> u64 {
        let mut sum = 0;
        for &state in states {
            let left = &mut self.left[state as usize];
            let taken = counted.min(*left);
            *left -= taken;
            counted -= taken;
            sum += taken;
        }
        self.pipelines * sum
    }
}

fn mean(values: impl Iterator<Item = u64>) -> u64 {
    let (count, sum) = values.fold((0, 0), |(count, sum), value| (count + 1, sum + value));
    if count == 0 { 0 } else { sum / count }
}

impl Accounts<'_> {
    /// The units of a bank.
    fn bank(&self, name: &str) -> impl Iterator<Item = Busiest> {
        let named = self.units.iter().enumerate().filter(move |(_, (unit, _))| *unit == name);
        named.enumerate().map(|(number, (place, &(_, account)))| Busiest { place, number, account })
    }

    /// The busiest unit of a stage in each pipeline; none if the machine has no such stage.
    fn stage(&self, name: &str) -> Vec<Busiest> {
        let bank: Vec<Busiest> = self.bank(name).collect();
        let each = (bank.len() / self.pipelines).max(1);
        let busier = |most: Busiest, unit: &Busiest| if unit.account.busy > most.account.busy { *unit } else { most };
        bank.chunks_exact(each).map(|units| units.iter().fold(units[0], busier)).collect()
    }

    /// The part of a unit's work that is on copies after the first.
    fn overlap(&self, stage: &str, unit: &Busiest) -> u64 {
        let busy = unit.account.busy;
        let copied = match self.class.sorted {
            Sorted::Primitives if stage == "core" => {
                let (all, vertices) = self.waits.instructions[unit.number];
                part(busy, vertices, all)
            }
            Sorted::Primitives if is_of(PipelineSection::Geometry, stage) || stage == "setup" => busy,
            Sorted::Triangles if matches!(stage, "tile_fetch" | "setup") => busy,
            _ => 0,
        };
        let copies = self.sort.redistributed_items;
        part(copied, copies.saturating_sub(self.sort.sent), copies)
    }

    /// What became of the cycles, and the stage that this is about; none where no pipeline has worked.
    pub fn split(&self) -> (Option<&'static str>, LossCounts) {
        let n = self.pipelines as u64;
        let mut loss = LossCounts { pipeline_cycles: n * self.cycles, ..LossCounts::default() };
        // The first of the stages, and of the pipelines, that worked most.
        let mut chosen: Option<(&'static str, Vec<Busiest>, usize, u64)> = None;
        for name in stages(self.class) {
            let units = self.stage(name);
            for (pipeline, unit) in units.iter().enumerate() {
                if unit.account.busy > chosen.as_ref().map_or(0, |&(.., most)| most) {
                    chosen = Some((name, units.clone(), pipeline, unit.account.busy));
                }
            }
        }
        let Some((stage, units, busiest, worked)) = chosen else {
            loss.outside_pass = loss.pipeline_cycles;
            return (None, loss);
        };
        // 1. Work, and work that others had more of.
        for unit in &units {
            let copied = self.overlap(stage, unit);
            loss.overlap += copied;
            loss.useful += unit.account.busy - copied;
            loss.imbalance += worked - unit.account.busy;
        }
        // 2. The busiest one's other cycles.
        self.attribute(&mut loss, stage, busiest, &units[busiest]);
        (Some(stage), loss)
    }

    /// Attributes the cycles in which the busiest unit of all did not work.
    fn attribute(&self, loss: &mut LossCounts, stage: &str, pipeline: usize, unit: &Busiest) {
        let (n, waits, account) = (self.pipelines as u64, self.waits, unit.account);
        let (card, probes) = waits.probes.split_first().expect("a card has a probe");
        let of_pipeline = |list: &[u64]| list.get(pipeline).copied().unwrap_or(0);
        let all = [Stall::NoInput, Stall::None, Stall::Memory];
        // 1. By the state of the probe. What comes after a unit may have no room because the network has none.
        let rested = probes.iter().find_map(|probe| probe.rested(unit.place));
        let [mut left, mut blocked] = rested.expect("a probe watches each unit of a pipeline");
        let stuck: u64 = blocked.iter().sum();
        for state in [Stall::NetworkFull, Stall::ReceiverFull] {
            left[state as usize] += std::mem::take(&mut blocked[state as usize]);
        }
        let held = self.cycles - left.iter().chain(&blocked).sum::<u64>();
        let mut rest = UnexplainedCycles { left, pipelines: n };
        // 2. The unit held something. A probe knows less of a core than the core: not what it waits for.
        let mut waited = held.saturating_sub(account.busy);
        let mut take = |counted: u64| {
            let taken = counted.min(waited);
            waited -= taken;
            n * taken
        };
        loss.memory += take(account.memory);
        loss.downstream_backpressure += take(account.blocked.saturating_sub(stuck));
        loss.latency += take(u64::MAX);
        loss.downstream_backpressure += n * blocked.iter().sum::<u64>();
        // 3. There was no pass; pipelines waited for each other to end it; it was composed.
        let [outside, ..] = card.rested(unit.place).expect("the card's probe watches each unit of a pipeline")[0];
        loss.outside_pass += rest.take(&all, outside);
        loss.imbalance += rest.take(&all, of_pipeline(&waits.passes));
        loss.network += rest.take(&all, of_pipeline(&waits.composing));
        // 4. Before a network that sorts fragments, its own sender set the state. Receivers have no place left as they keep order, or others
        //    send more.
        let behind = self.class.sorted != Sorted::Fragments || is_of(PipelineSection::Rop, stage);
        loss.network += rest.take(&[Stall::NetworkFull], u64::MAX);
        loss.reorder_stalls += rest.take(&[Stall::ReceiverFull], mean(waits.order.iter().copied()));
        loss.imbalance += rest.take(&[Stall::ReceiverFull], u64::MAX);
        // 5. Behind a network, its own receiver set the state by what had come, and the senders counted why no more had: the network on average over them,
        //    and receivers without a place as long as all of them met one.
        if behind {
            let full = waits.senders.iter().map(|sender| sender.receiver).min();
            let full = full.filter(|_| !self.class.one_place).unwrap_or(0);
            loss.network +=
                rest.take(&[Stall::NoInput, Stall::OutOfOrder], mean(waits.senders.iter().map(|sender| sender.network)));
            loss.imbalance += rest.take(&[Stall::NoInput], full);
        }
        loss.reorder_stalls += rest.take(&[Stall::OutOfOrder], u64::MAX);
        // 6. Batches are dealt in turn: one that found no room kept others from pipelines that had.
        if let Some(deal) = self.bank("deal").next() {
            let mut fronts = probes.iter().filter_map(|probe| probe.rested(deal.place));
            let kept = fronts.nth(pipeline).map_or(0, |[_, blocked]| blocked[Stall::NoInput as usize]);
            loss.imbalance += rest.take(&all, kept);
        }
        // 7. Memory kept the front waiting: the pipeline's own, or that of all.
        loss.memory += rest.take(&[Stall::Memory], u64::MAX);
        let fronts: Vec<Cycles> = self.bank("fetch").map(|unit| unit.account).collect();
        let front = fronts.get(pipeline).or(fronts.last()).copied().unwrap_or_default();
        if stage != "fetch" && self.class.sorted != Sorted::Images {
            loss.memory += rest.take(if fronts.len() == 1 { &[Stall::NoInput] } else { &[Stall::None] }, front.memory);
        }
        // 8. Nothing had come to the pipeline, or it had not come as far as this unit.
        loss.front_end += rest.take(&[Stall::NoInput], u64::MAX);
        if !behind {
            loss.front_end += rest.take(&[Stall::None], front.starved);
        }
        loss.upstream += rest.take(&[Stall::None], u64::MAX);
    }
}
