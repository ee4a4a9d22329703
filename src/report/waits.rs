//! What units wait for in a part of a frame, by their accounts.

use std::borrow::Cow;
use std::fmt;

use crate::machine::Spent;
use crate::mem::{CLIENTS, ClientCounts};
use crate::run::bound::IN_TURN;
use crate::sim::UNITS;
use crate::stats::{Group, Tree};
use crate::unit::core::{CORES, CoreCounts};

/// The least share of a unit's cycles that is worth naming.
const LEAST: f64 = 0.25;

/// What was counted of units' waits in a phase, or in equal phases of several frames.
#[derive(Clone, Debug, Default)]
pub struct Waits {
    /// Cycles of the banks of units, in data-flow order.
    banks: Vec<(String, Spent)>,
    /// Requests for indices and for attributes.
    requests: [u64; 2],
    /// Of the cores' waits for memory, those for texture units.
    textures: u64,
}

impl Waits {
    /// The waits of a phase, whose banks are summed.
    pub fn of(counts: &Tree) -> Waits {
        let banks = UNITS.banks(counts).map(|(name, _)| (name.to_owned(), UNITS.sum_of(counts, name)));
        let asked = |client| CLIENTS.sum_of::<ClientCounts>(counts, client).requests;
        let CoreCounts { texture_waits: textures, .. } = CORES.sum(counts);
        Waits { banks: banks.collect(), requests: ["index", "vertex"].map(asked), textures }
    }

    /// Adds the waits of an equal phase.
    pub fn add(&mut self, other: &Waits) {
        for (name, spent) in &other.banks {
            match self.banks.iter_mut().find(|(known, _)| known == name) {
                Some((_, sum)) => *sum += *spent,
                None => self.banks.push((name.clone(), *spent)),
            }
        }
        self.requests.iter_mut().zip(other.requests).for_each(|(sum, own)| *sum += own);
        self.textures += other.textures;
    }

    /// What the unit that waits most waits for, and the share of its cycles; none where all wait little. Memory itself is left out.
    pub fn longest(&self) -> Option<(Waited<'_>, f64)> {
        let drawing = self.banks.iter().filter(|(name, _)| !matches!(name.as_str(), "l2" | "dram" | "scanout"));
        let waits = drawing.flat_map(|(name, spent)| {
            let all = spent.values().sum::<u64>().max(1) as f64;
            let [memory, latency] = [spent.memory, spent.latency].map(|cycles| cycles as f64 / all);
            [(self.asks(name, spent.memory), memory), (Waited::Instructions(name), latency)]
        });
        waits.filter(|(_, share)| *share >= LEAST).max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// A unit that waits for memory, with what it asks for.
    fn asks<'w>(&self, unit: &'w str, cycles: u64) -> Waited<'w> {
        let [indices, attributes] = self.requests;
        match unit {
            "fetch" | "route" if indices >= attributes && indices > 0 => Waited::Indices(unit),
            "core" if 2 * self.textures >= cycles => Waited::Textures,
            unit => Waited::Memory(unit),
        }
    }

    /// In words: `index fetch for memory 64 %`.
    pub fn text(&self) -> Option<String> {
        self.longest().map(|(what, share)| format!("{what} {:.0} %", 100.0 * share))
    }
}

/// What a unit waits for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waited<'w> {
    /// Memory, for indices.
    Indices(&'w str),
    /// Memory, for other data.
    Memory(&'w str),
    /// Cores wait for texture units.
    Textures,
    /// Instructions that are not complete.
    Instructions(&'w str),
}

impl fmt::Display for Waited<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Waited::Indices(unit) => write!(f, "index {unit} for memory"),
            Waited::Memory(unit) => write!(f, "{unit} for memory"),
            Waited::Textures => f.write_str("core for textures"),
            Waited::Instructions(unit) => write!(f, "{unit} for instructions"),
        }
    }
}

/// What a phase is said to be limited by: the unit, or where units take turns, what is waited for, if that was counted. With the word for it.
pub fn limited<'l>(limit: &'l str, waits: &Waits) -> (&'static str, Cow<'l, str>) {
    match waits.text().filter(|_| limit.ends_with(IN_TURN)) {
        Some(text) => ("waits", text.into()),
        None => ("limit", limit.into()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn phase(units: &[(&'static str, [u64; 4])], requests: [u64; 2], textures: u64) -> Waits {
        let mut tree = Tree::new();
        for (unit, cycles) in units {
            let own = tree.child("units").child(*unit);
            ["busy", "memory", "latency", "starved"].iter().zip(cycles).for_each(|(name, cycles)| own.count(name, *cycles));
        }
        for (client, requests) in ["index", "vertex"].iter().zip(requests) {
            tree.child("memory").child("clients").child(*client).count("requests", requests);
        }
        tree.child("shading").child("core").count("texture_waits", textures);
        Waits::of(&tree)
    }

    #[test]
    fn the_longest_wait_is_named_with_what_is_asked_for() {
        let units = [("fetch", [20, 64, 0, 16]), ("core", [30, 40, 10, 20]), ("dram", [10, 90, 0, 0])];
        assert_eq!(phase(&units, [9, 3], 0).text().as_deref(), Some("index fetch for memory 64 %"));
        assert_eq!(phase(&units, [3, 9], 0).text().as_deref(), Some("fetch for memory 64 %"));
        assert_eq!(phase(&units[1..], [0, 0], 30).text().as_deref(), Some("core for textures 40 %"));
        assert_eq!(phase(&[("core", [30, 10, 50, 10])], [0, 0], 0).text().as_deref(), Some("core for instructions 50 %"));
        assert_eq!(phase(&[("core", [90, 10, 0, 0])], [0, 0], 0).text(), None);
        // Equal phases of two frames.
        let mut both = phase(&units, [9, 3], 0);
        both.add(&phase(&[("fetch", [100, 0, 0, 0])], [0, 0], 0));
        assert_eq!(both.text().as_deref(), Some("core for memory 40 %"));
    }

    #[test]
    fn where_units_take_turns_the_wait_is_said_if_it_was_counted() {
        let waits = phase(&[("fetch", [20, 64, 0, 16])], [9, 3], 0);
        assert_eq!(limited("fetch and core in turn", &waits), ("waits", "index fetch for memory 64 %".into()));
        assert_eq!(limited("fetch and core in turn", &Waits::default()), ("limit", "fetch and core in turn".into()));
        assert_eq!(limited("core", &waits), ("limit", "core".into()));
    }
}
