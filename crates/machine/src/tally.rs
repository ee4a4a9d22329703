//! What phases of a frame, and draws of a pass, have cost: counters read at the cycles between them.

use super::Machine;
use super::readings::Readings;
use mem::{CACHES, ClientCounts, DramCounts};
use num::{CallSite, Cycle};
use sim::{Circuit, Sum};
use stats::{Cycles, Declaration, Group, Heading, Tree, counter};
use unit::phase::{DrawRecord, Mark, Phase, PhaseRecord};
use work::{DebugPath, FUNNEL, Funnel};

stats::counters! {
    /// The cycles of a bank's units by what they went to, summed over the units.
    pub struct Spent {
        /// A unit moved an item or worked on one that it held.
        busy: "cycles",
        /// A unit's output had no room.
        blocked: "cycles",
        /// A unit waited for data from memory.
        memory: "cycles",
        /// A core's instructions were not complete.
        latency: "cycles",
        /// A unit's input was empty, whether or not another item came later.
        starved: "cycles",
    }
}

impl From<Cycles> for Spent {
    fn from(Cycles { busy, starved, blocked, memory, latency, idle }: Cycles) -> Spent {
        Spent { busy, blocked, memory, latency, starved: starved + idle }
    }
}

/// Where cores, texture units and the caches of constants count what they do for shaders.
pub const SHADING: Heading = Heading::new("shading.NAME[i]", "What shading takes, by unit.");

stats::counters! {
    /// What DRAM, or an ideal memory, has moved.
    pub struct Moved {
        /// Bytes read.
        read_bytes: "bytes",
        /// Bytes written.
        write_bytes: "bytes",
    }
}

// One reader finds these counters in phases, and in whole frames, where more is counted.
const _: () = assert!(
    counter!(Spent, busy).is_named_as(&counter!(Cycles, busy))
        && counter!(Spent, blocked).is_named_as(&counter!(Cycles, blocked))
        && counter!(Spent, memory).is_named_as(&counter!(Cycles, memory))
        && counter!(Spent, latency).is_named_as(&counter!(Cycles, latency))
        && counter!(Spent, starved).is_named_as(&counter!(Cycles, starved))
        && counter!(Moved, read_bytes).is_named_as(&counter!(DramCounts, read_bytes))
        && counter!(Moved, write_bytes).is_named_as(&counter!(DramCounts, write_bytes))
);

/// What a machine has counted in a span of cycles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// What was thrown away where.
    pub funnel: Funnel,
    /// The cycles of the units, by bank.
    pub units: Vec<(&'static str, Spent)>,
    /// The caches, by name.
    pub caches: Vec<Sum>,
    /// What cores have issued and texture units filtered.
    pub shading: Vec<Sum>,
    /// Memory's clients, by name.
    pub clients: Vec<(&'static str, ClientCounts)>,
    /// What DRAM moved.
    pub dram: Moved,
}

impl Tally {
    /// The sums of readings over banks.
    fn of(machine: &Machine, readings: &Readings) -> Tally {
        let Readings { funnel, wires, sheet, memory, .. } = readings;
        let mut units: Vec<(&'static str, Spent)> = Vec::with_capacity(32);
        for ((name, _), &cycles) in machine.circuit.wires().units().zip(&wires.units) {
            match units.last_mut().filter(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += cycles.into(),
                None => units.push((name, cycles.into())),
            }
        }
        let DramCounts { read_bytes, write_bytes, .. } = memory.dram;
        Tally {
            funnel: *funnel,
            units,
            caches: sheet.sums(CACHES),
            shading: sheet.sums(SHADING),
            clients: memory.clients.clone(),
            dram: Moved { read_bytes, write_bytes },
        }
    }

    /// What was counted since an earlier reading of the same machine.
    fn since(&self, earlier: &Tally) -> Tally {
        let units = self.units.iter().zip(&earlier.units).map(|((name, now), (_, then))| (*name, now.since(then)));
        let clients = self.clients.iter().zip(&earlier.clients).map(|((name, now), (_, then))| (*name, now.since(then)));
        let sums = |now: &[Sum], then: &[Sum]| -> Vec<Sum> {
            let since = |(now, then): (&Sum, &Sum)| Sum {
                values: now.values.iter().zip(&then.values).map(|(now, then)| now - then).collect(),
                ..now.clone()
            };
            now.iter().zip(then).map(since).collect()
        };
        Tally {
            funnel: self.funnel.since(&earlier.funnel),
            units: units.collect(),
            caches: sums(&self.caches, &earlier.caches),
            shading: sums(&self.shading, &earlier.shading),
            clients: clients.collect(),
            dram: self.dram.since(&earlier.dram),
        }
    }

    /// Each group of counters in addition to the funnel, in order: its place, whether it was at work (a unit that only starved was not), its
    /// counters, and their values. Groups are `units.NAME`, `caches.NAME`,
    /// `shading.NAME`, `memory.clients.NAME` and `memory.dram`; banks are summed.
    pub fn groups(&self, mut to: impl FnMut((CounterGroup, bool), &'static [Declaration], &[u64])) {
        let mut values = Vec::with_capacity(8);
        let mut group =
            |place: CounterGroup, starved: u64, declarations: &'static [Declaration], own: &mut dyn Iterator<Item = u64>| {
                values.clear();
                values.extend(own);
                let worked = values.iter().sum::<u64>() > starved;
                to((place, worked), declarations, &values);
            };
        for (name, spent) in &self.units {
            group((&["units"], Some(name)), spent.starved, Spent::DECLARATIONS, &mut spent.values());
        }
        for (top, sums) in [(&["caches"], &self.caches), (&["shading"], &self.shading)] {
            for sum in sums {
                group((top, Some(sum.name)), 0, sum.declarations, &mut sum.values.iter().copied());
            }
        }
        for (name, counts) in &self.clients {
            group((&["memory", "clients"], Some(name)), 0, ClientCounts::DECLARATIONS, &mut counts.values());
        }
        group((&["memory", "dram"], None), 0, Moved::DECLARATIONS, &mut self.dram.values());
    }

    /// The counters as statistics, by the headings of frames.
    pub fn tree(&self) -> Tree {
        let mut tree = Tree::new();
        FUNNEL.at(&mut tree, 0).extend(self.funnel.tree());
        self.each(|(steps, of), name, value| {
            steps.iter().copied().chain(of).fold(&mut tree, Tree::child).count(name, value);
        });
        tree
    }

    /// Each of these counters: the place of its group, its name in it, and its value.
    pub fn each(&self, mut to: impl FnMut(CounterGroup, &'static str, u64)) {
        self.groups(|(place, _), declarations, values| {
            declarations.iter().zip(values).for_each(|(declaration, &value)| to(place, declaration.name, value));
        });
    }
}

/// Where a group of counters stands: the steps of its path, and what it is of.
pub type CounterGroup = (&'static [&'static str], Option<&'static str>);

/// A draw of a pass, or what follows the last of them.
#[derive(Clone, Debug)]
pub struct DrawReport {
    /// Number of the draw in its frame; none: the end of the pass, after its last draw has retired (write-back, composition, resolves).
    pub number: Option<u32>,
    /// Label of its pipeline, or empty.
    pub label: String,
    /// Where the command that draws was made; none: the end of the pass.
    pub site: Option<CallSite>,
    /// Labels of the debug groups that it is in, the outermost first.
    pub groups: DebugPath,
    /// Cycles from the retirement before it to its own. Those of a pass add up to the pass. Where tiles are drawn one after another, draws retire
    /// together: a draw then has a share of their cycles, by its work.
    pub cycles: Cycle,
    /// Where tiles are drawn one after another: its share of the geometry half, by vertices shaded and primitives, and of the tile half, by
    /// triangles set up and quads. Both add up to its cycles.
    pub halves: Option<[Cycle; 2]>,
    /// What was counted in these cycles; but the funnel is the draw's own, whenever it was counted. Draws that retire together have their
    /// funnels alone, and the end of the pass has all other counts.
    pub counts: Tally,
}

impl DrawReport {
    /// The label of the innermost debug group that it is in, or empty.
    pub fn group(&self) -> &str {
        self.groups.last().map_or("", |label| label)
    }
}

/// A phase of a frame.
#[derive(Clone, Debug)]
pub struct PhaseReport {
    /// What it is.
    pub phase: Phase,
    /// Its cycles: those of a frame add up to the frame's.
    pub cycles: Cycle,
    /// What was counted in them; none where they were estimated.
    pub counts: Option<Box<Tally>>,
    /// Its draws in order, where they were asked for.
    pub draws: Vec<DrawReport>,
}

impl PhaseReport {
    /// A phase whose cycles were estimated.
    pub fn estimated(phase: Phase, cycles: Cycle) -> PhaseReport {
        PhaseReport { phase, cycles, counts: None, draws: Vec::new() }
    }
}

/// The readings between the phases of a frame, and between their draws.
#[derive(Debug)]
pub(super) struct Tallies {
    /// At the end of the frame before.
    start: Tally,
    /// At the beginning of each phase, with the readings at which its draws retired, by their places.
    phases: Vec<(Tally, Vec<(usize, Tally)>)>,
}

impl Tallies {
    pub fn new(machine: &Machine, start: &Readings) -> Tallies {
        Tallies { start: Tally::of(machine, start), phases: Vec::new() }
    }

    /// Reads the counters for what has come to an end in the cycle gone by.
    pub fn read(&mut self, machine: &mut Machine) {
        let now = Tally::of(machine, &Readings::of(machine));
        for mark in machine.card.phases.marks() {
            let last = self.phases.len();
            match (mark, self.phases.last_mut()) {
                (Mark::Phase, _) => self.phases.push((now.clone(), Vec::new())),
                // What retires behind the end of its phase is read there.
                (Mark::Draw(phase, _), _) if phase + 1 < last => {}
                (Mark::Draw(_, at), Some((_, draws))) => match draws.last_mut().filter(|(known, _)| *known == at) {
                    // Another segment of the same draw.
                    Some((_, reading)) => reading.clone_from(&now),
                    None => draws.push((at, now.clone())),
                },
                (Mark::Draw(..), None) => {}
            }
        }
    }

    /// The phases of the frame between two readings.
    pub fn frame(&mut self, machine: &mut Machine, begin: &Readings, end: &Readings) -> Vec<PhaseReport> {
        let now = Tally::of(machine, end);
        let records = machine.card.phases.take(begin.wires.cycle, end.wires.cycle);
        let start = std::mem::replace(&mut self.start, now);
        let mut readings = std::mem::take(&mut self.phases);
        // What comes before the first phase is the first's.
        if let Some((first, _)) = readings.first_mut() {
            *first = start;
        }
        let mut reports = Vec::with_capacity(records.len());
        let mut readings = readings.into_iter().peekable();
        for (PhaseRecord { phase, draws: records, flushes, funnel, .. }, cycles) in records {
            let Some((before, retirements)) = readings.next() else { break };
            let after = readings.peek().map_or(&self.start, |(next, _)| next);
            let draws = if machine.config.card.sort.class().one_place {
                binned_draws(&phase, cycles, &records, &flushes, after.since(&before))
            } else {
                draws(&phase, cycles, &records, (&before, &retirements, after))
            };
            // What its draws have counted is the phase's, whenever they retired.
            let counts = Tally { funnel, ..after.since(&before) };
            reports.push(PhaseReport { phase, cycles, counts: Some(Box::new(counts)), draws });
        }
        reports
    }
}

/// The draws of a phase: the readings are at its beginning, where its draws retired, and at its end.
fn draws(
    phase: &Phase,
    cycles: Cycle,
    records: &[DrawRecord],
    (before, retirements, after): (&Tally, &[(usize, Tally)], &Tally),
) -> Vec<DrawReport> {
    if records.is_empty() {
        return Vec::new();
    }
    let (mut reports, mut last, mut since) = (Vec::with_capacity(records.len() + 1), before, phase.begin);
    let mut retirements = retirements.iter().peekable();
    for (at, DrawRecord { draw, funnel, retired, .. }) in records.iter().enumerate() {
        // Where passes overlap, a draw may retire behind the end of its phase.
        let own = retirements.next_if(|(known, _)| *known == at);
        let end = phase.begin + cycles;
        let reading =
            if retired.is_some_and(|retired| retired > end) { after } else { own.map_or(last, |(_, reading)| reading) };
        let until = retired.map_or(since, |retired| retired.min(end));
        let counts = Tally { funnel: *funnel, ..reading.since(last) };
        let (label, groups) = (draw.label.clone(), draw.groups.clone());
        let (number, site) = (Some(draw.number), Some(draw.site));
        reports.push(DrawReport { number, label, site, groups, cycles: until - since, halves: None, counts });
        (last, since) = (reading, until);
    }
    let counts = Tally { funnel: Funnel::default(), ..after.since(last) };
    let rest = phase.begin + cycles - since;
    reports.push(end_of_pass(rest, None, counts));
    reports
}

/// What follows the last draw of a pass.
fn end_of_pass(cycles: Cycle, halves: Option<[Cycle; 2]>, counts: Tally) -> DrawReport {
    DrawReport { number: None, label: String::new(), site: None, groups: [].into(), cycles, halves, counts }
}

/// Splits cycles by weights, whose sum is below 2^64, in whole cycles that add up to them. Nobody gets any if all weights are 0.
fn split(cycles: Cycle, weights: impl Iterator<Item = u64> + Clone) -> impl Iterator<Item = Cycle> {
    let all = weights.clone().map(u128::from).sum::<u128>().max(1);
    let (mut sum, mut given) = (0, 0);
    weights.map(move |weight| {
        sum += u128::from(weight);
        let until = (u128::from(cycles) * sum / all) as Cycle;
        until - std::mem::replace(&mut given, until)
    })
}

/// The draws of a phase whose triangles were binned before tiles were drawn: of the draws that went into the same lists, each has a share of
/// the cycles up to the flush, and of those from then on. `counts` is what was counted in the phase.
fn binned_draws(phase: &Phase, cycles: Cycle, records: &[DrawRecord], flushes: &[Cycle], counts: Tally) -> Vec<DrawReport> {
    if records.is_empty() {
        return Vec::new();
    }
    let end = phase.begin + cycles;
    let nothing = counts.since(&counts);
    // The flush that a draw's last segment went with: the last before it retired.
    let flush = |record: &DrawRecord| flushes.partition_point(|&at| at < record.retired.unwrap_or(end)).saturating_sub(1);
    let (mut reports, mut since) = (Vec::with_capacity(records.len() + 1), phase.begin);
    for draws in records.chunk_by(|a, b| flush(a) == flush(b)) {
        let until = draws.iter().filter_map(|draw| draw.retired).max().unwrap_or(since).clamp(since, end);
        let begun = flushes.get(flush(&draws[0])).copied().unwrap_or(until).clamp(since, until);
        let binning = draws.iter().map(|draw| draw.funnel.vertices_shaded + draw.funnel.primitives_in);
        let drawing = draws.iter().map(|draw| draw.funnel.triangles_setup + draw.funnel.quads_rasterized);
        let shares = split(begun - since, binning).zip(split(until - begun, drawing));
        for (DrawRecord { draw, funnel, .. }, (geometry, tiles)) in draws.iter().zip(shares) {
            let (label, groups, site) = (draw.label.clone(), draw.groups.clone(), Some(draw.site));
            let counts = Tally { funnel: *funnel, ..nothing.clone() };
            let (number, cycles) = (Some(draw.number), geometry + tiles);
            reports.push(DrawReport { number, label, site, groups, cycles, halves: Some([geometry, tiles]), counts });
        }
        since = until;
    }
    let shared: Cycle = reports.iter().map(|draw| draw.cycles).sum();
    let rest = cycles - shared;
    reports.push(end_of_pass(rest, Some([0, rest]), Tally { funnel: Funnel::default(), ..counts }));
    reports
}

#[cfg(test)]
mod tests {
    use super::split;

    #[test]
    fn cycles_are_split_by_work_and_add_up() {
        let shares = |cycles, weights: &[u64]| split(cycles, weights.iter().copied()).collect::<Vec<_>>();
        assert_eq!(shares(10, &[1, 0, 1, 2]), [2, 0, 3, 5]);
        assert_eq!(shares(7, &[1, 1, 1]), [2, 2, 3]);
        assert_eq!(shares(7, &[0, 0]), [0, 0]);
        assert_eq!(shares(u64::MAX, &[u64::MAX / 2, u64::MAX / 2 + 1]).iter().sum::<u64>(), u64::MAX);
    }
}
