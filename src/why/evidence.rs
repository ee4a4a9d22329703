//! Evidence: what was counted of a resource while a machine had no more of it, in words.
//!
//! Counters say who is busy, who waits, and for how many requests of whom. They do not say what holds a frame back: that is timed.

use super::bank;
use super::relax::{Relaxation, Resource};
use crate::knob::Setting;
use crate::machine::{Config, FrameReport, Moved, PhaseReport};
use crate::mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, DRAM};
use crate::num::Cycle;
use crate::report::summary::{bytes, grouped};
use crate::report::verdict::Draws;
use crate::report::waits::Waits;
use crate::sim::UNITS;
use crate::stats::{Cycles, Heading, Tree};
use crate::unit::core::{CORES, CoreCounts};
use crate::unit::texture::{TEXTURES, TextureCounts};
use crate::work::{FUNNEL, Funnel};

/// What evidence must know of a machine.
#[derive(Clone, Debug, Default)]
pub struct MachineShape {
    /// Bytes per cycle of a port to memory.
    port_width: u32,
    /// Banks of units, and how many each has.
    banks: Vec<(String, usize)>,
    /// How even the load of pipelines is, in words; empty where there is one.
    balance: String,
}

/// How even the load is between the units of the pipelines' bank whose busiest unit is busiest: that unit, and the mean of the bank.
fn balance(tree: &Tree) -> String {
    let spread = |name: &'static str| {
        let cycles = UNITS.named(name).find(tree).into_iter().map(Tree::read);
        let shares: Vec<f64> = cycles.map(|unit: Cycles| unit.busy as f64 / unit.total().max(1) as f64).collect();
        let most = shares.iter().copied().fold(0.0, f64::max);
        (shares.len() > 1 && most > 0.0).then(|| (name, shares.len(), most, shares.iter().sum::<f64>() / shares.len() as f64))
    };
    let banks = ["traverse", "core", "color"].into_iter().filter_map(spread);
    banks.max_by(|a, b| a.2.total_cmp(&b.2)).map_or(String::new(), |(name, units, most, mean)| {
        format!(
            "the busiest of {units} {name} units is busy in {:.0} % of its cycles, all in {:.0} % on average",
            100.0 * most,
            100.0 * mean
        )
    })
}

impl MachineShape {
    /// The machine that has drawn a frame.
    pub fn of(config: &Config, frame: &FrameReport) -> MachineShape {
        let banks = UNITS.banks(&frame.tree).map(|(name, units)| (name.to_owned(), units.len()));
        MachineShape { port_width: config.memory.port_width, banks: banks.collect(), balance: balance(&frame.tree) }
    }
}

/// What was counted in a phase, or in whole frames; banks are summed.
#[derive(Clone, Debug, Default)]
pub struct PhaseCounts {
    tree: Tree,
    cycles: Cycle,
    /// Draws that retired.
    draws: usize,
}

impl PhaseCounts {
    /// What was counted in each phase of a frame.
    pub fn phases(frame: &FrameReport) -> Vec<PhaseCounts> {
        frame.phases.iter().map(PhaseCounts::phase).collect()
    }

    fn phase(report: &PhaseReport) -> PhaseCounts {
        let tree = report.counts.as_ref().map_or(Tree::new(), |counts| counts.tree());
        PhaseCounts { tree, cycles: report.cycles, draws: draws(report) }
    }

    /// What was counted in whole frames.
    pub fn frames(frames: &[FrameReport]) -> PhaseCounts {
        let trees: Vec<(f64, &Tree)> = frames.iter().map(|frame| (1.0, &frame.tree)).collect();
        PhaseCounts {
            tree: Tree::weighted(&trees).banks_summed(),
            cycles: frames.iter().map(|frame| frame.cycles).sum(),
            draws: frames.iter().flat_map(|frame| &frame.phases).map(draws).sum(),
        }
    }

    /// The share of a bank's cycles, in per cent.
    fn share(&self, unit: &str, of: fn(&Cycles) -> u64) -> f64 {
        let cycles: Cycles = UNITS.sum_of(&self.tree, unit);
        100.0 * of(&cycles) as f64 / cycles.total().max(1) as f64
    }

    /// Whether a unit is held up in a quarter of its cycles: room for more in flight may help.
    pub fn is_full(&self, unit: &str) -> bool {
        self.share(unit, |cycles| cycles.memory + cycles.blocked) >= 25.0
    }

    /// The counts of all draws, how many there are, and what units wait for.
    pub fn counted(&self) -> (Funnel, Draws, Waits) {
        let funnel = self.funnel();
        let draws = Draws { count: self.draws as u64, vertices: funnel.vertices_in };
        (funnel, draws, Waits::of(&self.tree))
    }

    /// Its cycles.
    pub fn cycles(&self) -> Cycle {
        self.cycles
    }

    /// The names under a heading.
    fn names(&self, heading: Heading) -> Vec<&str> {
        heading.banks(&self.tree).map(|(name, _)| name).collect()
    }

    /// The bank that a client of memory belongs to.
    fn owner<'c>(&self, client: &'c str) -> &'c str {
        match client {
            // Units that route have read the indices.
            "index" if self.names(UNITS).contains(&"route") => "route",
            "index" | "vertex" => "fetch",
            "position" => "route",
            own => own,
        }
    }

    /// The clients of memory that a unit has, each with its counts; none of those that ask for nothing.
    fn clients(&self, unit: &str) -> Vec<(&str, ClientCounts)> {
        let own = |client: &&str| self.owner(client) == unit;
        let counted = |client| (client, CLIENTS.sum_of::<ClientCounts>(&self.tree, client));
        self.names(CLIENTS).into_iter().filter(own).map(counted).filter(|(_, counts)| counts.requests > 0).collect()
    }

    /// The draws, with their size.
    fn drawn(&self) -> String {
        let Funnel { vertices_in: vertices, .. } = self.funnel();
        let s = if self.draws == 1 { "" } else { "s" };
        let each = if self.draws > 1 { " on average" } else { "" };
        let size = vertices.checked_div(self.draws as u64).unwrap_or(0);
        format!("{} draw{s} of {} vertices{each}", grouped(self.draws as u64), grouped(size))
    }

    fn funnel(&self) -> Funnel {
        FUNNEL.sum(&self.tree)
    }

    /// What a unit was given to do, where that is counted; empty elsewhere.
    fn work(&self, unit: &str) -> String {
        let funnel = self.funnel();
        match unit {
            "fetch" | "route" if self.draws > 0 => {
                let kind = |client| match client {
                    "index" => "indices",
                    "vertex" => "attributes",
                    _ => "positions",
                };
                let asked = self.clients(unit);
                let asked = asked.iter().enumerate().map(|(at, (client, counts))| {
                    let what = if at == 0 { " requests" } else { "" };
                    format!("{}{what} for {}", grouped(counts.requests), kind(client))
                });
                let asked = asked.collect::<Vec<_>>().join(" and ");
                if asked.is_empty() { self.drawn() } else { format!("{asked}, by {}", self.drawn()) }
            }
            "core" => {
                let CoreCounts { float, integer, special, control, multiply, .. } = CORES.sum(&self.tree);
                let what = [
                    (funnel.fragments_shaded, "fragments"),
                    (funnel.helper_fragments, "helper invocations"),
                    (funnel.vertices_shaded, "vertices"),
                ];
                let what: Vec<String> =
                    what.iter().filter(|(n, _)| *n > 0).map(|(n, name)| format!("{} {name}", grouped(*n))).collect();
                let issued = float + integer + special + control + multiply;
                let of = if what.is_empty() { String::new() } else { format!(" for {}", what.join(", ")) };
                if issued > 0 { format!("{} warp instructions{of}", grouped(issued)) } else { String::new() }
            }
            "texture" => {
                let TextureCounts { quads, operations, .. } = TEXTURES.sum(&self.tree);
                let text = || format!("{} bilinear filter operations for {} quads", grouped(operations), grouped(quads));
                if quads > 0 { text() } else { String::new() }
            }
            _ => {
                let requests: u64 = self.clients(unit).iter().map(|(_, counts)| counts.requests).sum();
                if requests > 0 { format!("{} requests to memory", grouped(requests)) } else { String::new() }
            }
        }
    }

    /// What a bank's cycles went to, and its work. Empty where it had none.
    fn states(&self, unit: &str) -> String {
        let cycles: Cycles = UNITS.sum_of(&self.tree, unit);
        let share = |own: u64| 100.0 * own as f64 / cycles.total().max(1) as f64;
        let Cycles { busy, memory, blocked, latency, starved, .. } = cycles;
        if share(busy + memory + blocked + latency) < 1.0 {
            return String::new();
        }
        let states = [
            ("is busy in", busy),
            ("waits for memory in", memory),
            ("for instructions in", latency),
            ("for room behind it in", blocked),
            ("for input in", starved),
        ];
        let mut text = String::new();
        let mut waits = false;
        for (at, (name, own)) in states.into_iter().enumerate() {
            let share = share(own);
            if share < 1.0 {
                continue;
            }
            // The first that it waits for has the verb.
            let verb = if at > 1 && !waits { "waits " } else { "" };
            waits |= at > 0;
            let before = if text.is_empty() { format!("{unit} ") } else { ", ".into() };
            text.push_str(&format!("{before}{verb}{name} {share:.0} %"));
            if !text.contains(" of its cycles") {
                text.push_str(" of its cycles");
            }
        }
        with(text, &self.work(unit))
    }

    /// Which units wait for memory, and for what the first of them does.
    fn waits(&self) -> String {
        let share = |unit| (unit, self.share(unit, |cycles| cycles.memory));
        let mut waits: Vec<(&str, f64)> = self.names(UNITS).into_iter().map(share).filter(|(_, share)| *share >= 1.0).collect();
        waits.sort_by(|a, b| b.1.total_cmp(&a.1));
        let Some(&(most, share)) = waits.first() else { return String::new() };
        let others: Vec<String> =
            waits.iter().skip(1).take(2).map(|(unit, share)| format!(", {unit} in {share:.0} %")).collect();
        let asks = if self.clients(most).is_empty() { String::new() } else { self.work(most) };
        with(format!("{most} waits for memory in {share:.0} % of its cycles"), &asks) + &others.concat()
    }

    /// What the clients of a unit move.
    fn moved(&self, unit: &str) -> String {
        let clients = self.clients(unit);
        let sum = |of: fn(&ClientCounts) -> u64| clients.iter().map(|(_, counts)| of(counts)).sum::<u64>();
        let sides = [("reads", sum(|counts| counts.read_bytes)), ("writes", sum(|counts| counts.write_bytes))];
        let text: Vec<String> =
            sides.iter().filter(|(_, n)| *n > 0).map(|(verb, n)| format!("{verb} {}", bytes(*n as f64))).collect();
        if text.is_empty() { String::new() } else { format!("{unit} {}", text.join(" and ")) }
    }

    /// The client that moves most through each of its ports, and how fast.
    fn ports(&self, machine: &MachineShape) -> String {
        let rate = |client| {
            let ClientCounts { read_bytes, write_bytes, .. } = CLIENTS.sum_of(&self.tree, client);
            let ports = machine.banks.iter().find(|(name, _)| name == self.owner(client)).map_or(1, |(_, units)| *units);
            (client, read_bytes.max(write_bytes) as f64 / (self.cycles.max(1) * ports as u64) as f64)
        };
        let most = self.names(CLIENTS).into_iter().map(rate).max_by(|a, b| a.1.total_cmp(&b.1));
        let Some((client, rate)) = most.filter(|(_, rate)| *rate > 0.0) else { return String::new() };
        format!("{client} moves {rate:.1} bytes per cycle through a port of {}", machine.port_width)
    }

    /// What DRAM, or an ideal memory, does.
    fn dram(&self) -> String {
        let busy = self.share("dram", |cycles| cycles.busy);
        let Moved { read_bytes, write_bytes } = DRAM.sum(&self.tree);
        let moved = read_bytes + write_bytes;
        let rate = format!("memory moves {:.1} bytes per cycle", moved as f64 / self.cycles.max(1) as f64);
        match (busy >= 1.0, moved > 0) {
            (true, _) => with(format!("dram is busy in {busy:.0} % of its cycles"), &rate),
            (false, true) => rate,
            _ => String::new(),
        }
    }

    /// What there is to be left out, by the section of the switch and its name.
    fn skipped(&self, section: &str, knob: &str) -> String {
        let funnel = self.funnel();
        let share = |part: u64, all: u64, what: &str| {
            if part > 0 { format!("{} of {} {what}", grouped(part), grouped(all)) } else { String::new() }
        };
        match (section, knob) {
            ("command", "cull") | ("clip", "cull_frustum") => {
                let draws = if self.draws > 1 { format!(" of {} draws", grouped(self.draws as u64)) } else { String::new() };
                share(funnel.culled_frustum, funnel.primitives_in, &format!("primitives{draws} are out of view"))
            }
            ("depth", "early") => share(
                funnel.fragments_late_failed,
                funnel.fragments_shaded,
                "shaded fragments are hidden by what was drawn before",
            ),
            ("traverse", "hierarchical_z") => {
                share(funnel.quads_early_culled, funnel.quads_rasterized, "quads are rejected, each by a test of its own")
            }
            ("interpolate" | "command", _) => String::new(),
            (unit, _) => self.moved(unit),
        }
    }
}

/// Draws of a phase.
fn draws(report: &PhaseReport) -> usize {
    report.draws.iter().filter(|draw| draw.number.is_some()).count()
}

/// A text with its cause.
fn with(text: String, more: &str) -> String {
    if text.is_empty() || more.is_empty() { text } else { format!("{text} ({more})") }
}

/// What was seen of a resource on the machine as it is. Empty where nothing counted tells of it.
pub fn evidence(relaxation: &Relaxation, seen: &PhaseCounts, machine: &MachineShape) -> String {
    let knob = |name: &str| relaxation.changes.iter().any(|(path, _)| path == name);
    let unit = bank(relaxation.section);
    match relaxation.resource {
        Resource::Cache => {
            let cache = match relaxation.section {
                "fetch" => "vertex",
                "route" => "position",
                "memory.l2" => "l2",
                own => own,
            };
            let CacheCounts { hits, accesses: all, .. } = CACHES.sum_of(&seen.tree, cache);
            let share = 100.0 * hits as f64 / all.max(1) as f64;
            if all > 0 { format!("{share:.1} % of {} lookups hit", grouped(all)) } else { String::new() }
        }
        Resource::MemoryLatency => seen.waits(),
        Resource::Room if unit == "dram" => seen.waits(),
        Resource::MemoryBandwidth if knob("memory.port_width") => seen.ports(machine),
        Resource::MemoryBandwidth => seen.dram(),
        Resource::Balance => machine.balance.clone(),
        Resource::Units if knob("pipelines") => machine.balance.clone(),
        // Geometry units are several banks; each of them clips.
        Resource::Units if unit.is_empty() => seen.states("clip"),
        Resource::Rate | Resource::Room | Resource::Units | Resource::Latency if !unit.is_empty() => seen.states(unit),
        Resource::Skip => match relaxation.changes.first() {
            Some((path, Setting::Switch(_) | Setting::Name(_))) => {
                seen.skipped(relaxation.section, path.rsplit('.').next().unwrap_or(""))
            }
            _ => String::new(),
        },
        _ => String::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn seen() -> PhaseCounts {
        let mut tree = Tree::new();
        for (unit, [busy, memory, starved]) in [("fetch", [20, 70, 10]), ("core", [94, 0, 6]), ("setup", [0, 0, 100])] {
            let own = tree.child("units").child(unit);
            [("busy", busy), ("memory", memory), ("starved", starved)].iter().for_each(|(name, n)| own.count(name, *n));
        }
        for (client, requests) in [("index", 2309), ("vertex", 651)] {
            tree.child("memory").child("clients").child(client).count("requests", requests);
        }
        tree.child("funnel").count("vertices_in", 1000);
        PhaseCounts { tree, cycles: 100, draws: 5 }
    }

    #[test]
    fn who_waits_for_memory_comes_with_what_it_asked_for() {
        assert_eq!(
            seen().waits(),
            "fetch waits for memory in 70 % of its cycles (2,309 requests for indices and 651 for attributes, by 5 draws of 200 vertices on \
             average)"
        );
        assert_eq!(PhaseCounts::default().waits(), "");
    }

    #[test]
    fn units_say_what_their_cycles_went_to() {
        assert_eq!(seen().states("core"), "core is busy in 94 % of its cycles, waits for input in 6 %");
        assert_eq!(seen().states("setup"), "", "one that has no work tells nothing");
        let fetch = seen().states("fetch");
        assert!(
            fetch.starts_with("fetch is busy in 20 % of its cycles, waits for memory in 70 %, for input in 10 % (2,309 "),
            "{fetch}"
        );
    }
}
