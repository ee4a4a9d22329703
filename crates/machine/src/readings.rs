//! All counters of a machine, up to a cycle or between two. Reports of frames, phases and draws are made from these readings.

use super::Machine;
use mem::MemoryCounts;
use sim::{Circuit, Reading, Sheet};
use stats::{Group, Heading, Tree};
use work::{FUNNEL, Funnel};

/// All counters of a machine, up to now or between two readings.
#[derive(Clone, Debug)]
pub(super) struct Readings {
    /// The funnel of all draws.
    pub funnel: Funnel,
    /// The accounts of units, the channels, and the cycles.
    pub wires: Reading,
    /// The groups of counters that units have besides.
    pub sheet: Sheet,
    /// The counts of memory's clients and channels.
    pub memory: MemoryCounts,
}

/// Places in the statistics in their order: those in front of memory, and those behind. Places that are not listed here follow, in
/// data-flow order.
const BEFORE_MEMORY: &[&str] = &[
    "caches.vertex",
    "caches.position",
    "caches.texture",
    "caches.constant",
    "caches.constant-second",
    "caches.depth",
    "caches.early",
    "caches.color",
    "caches.l2",
];
const BEHIND_MEMORY: &[&str] = &[
    "memory",
    "rop.depth",
    "rop.early",
    "rop.color",
    "hierarchical",
    "setup",
    "shading.core",
    "shading.texture",
    "shading.fills",
    "shading.constant",
    "command",
    "binning",
    "early",
    "hiding",
    "routing",
    "composition",
    "display",
];

/// The first of these paths that a heading is below.
fn place(heading: &Heading, paths: &[&str]) -> Option<usize> {
    let is_below = |path: &&str| {
        let (mut steps, _) = heading.steps();
        path.split('.').all(|step| steps.next() == Some(step))
    };
    paths.iter().position(is_below)
}

impl Readings {
    /// What a machine has counted up to now.
    pub fn of(machine: &Machine) -> Readings {
        let circuit = &machine.circuit;
        Readings {
            funnel: machine.card.funnel.total(),
            wires: circuit.reading(),
            sheet: circuit.sheet(),
            memory: MemoryCounts::read(&machine.clients, machine.client_counts(), &circuit.dram, circuit.ideal.as_ref()),
        }
    }

    /// What was counted since an earlier reading of the same machine.
    pub fn since(&self, earlier: &Readings) -> Readings {
        Readings {
            funnel: self.funnel.since(&earlier.funnel),
            wires: self.wires.since(&earlier.wires),
            sheet: self.sheet.since(&earlier.sheet),
            memory: self.memory.since(&earlier.memory),
        }
    }

    /// Adds what a machine of the same configuration has counted.
    pub fn add(&mut self, later: &Readings) {
        self.funnel += later.funnel;
        self.wires.add(&later.wires);
        self.sheet.add(&later.sheet);
        self.memory.add(&later.memory);
    }

    /// Puts all of it into statistics, by its headings, with what went through each unit.
    pub fn put(&self, machine: &Machine, items: &[u64], tree: &mut Tree) {
        FUNNEL.at(tree, 0).extend(self.funnel.tree());
        tree.extend(machine.circuit.wires().tree(&self.wires, items));
        self.sheet.put(tree, |heading| place(heading, BEFORE_MEMORY));
        tree.extend(self.memory.tree());
        self.sheet.put(tree, |heading| match place(heading, BEFORE_MEMORY) {
            Some(_) => None,
            None => Some(place(heading, BEHIND_MEMORY).unwrap_or(BEHIND_MEMORY.len())),
        });
    }
}
