//! What is estimated of all frames, by which they are compared and to which counts are in proportion.

use std::fmt;
use std::time::Duration;

use super::clusters::{Clusters, Interval, signature};
use crate::machine::Config;
use crate::mem::{CacheCounts, ClientCounts, DramCounts};
use crate::run::bound::{Bound, PhaseEstimate};
use crate::run::host::Stopwatch;
use crate::run::profiles::{Profiled, Reader};
use crate::run::rendering::Rendering;
use crate::stats::{Node, Tree};

/// Reading or writing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Way {
    /// Reading.
    Read,
    /// Writing.
    Write,
}

impl Way {
    /// What the statistics call its bytes.
    fn name(self) -> &'static str {
        match self {
            Way::Read => "read_bytes",
            Way::Write => "write_bytes",
        }
    }
}

/// What a cache counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CacheCount {
    /// Lookups.
    Accesses,
    /// Lookups that found their line.
    Hits,
    /// Lookups that did not.
    Misses,
    /// Lines that made room.
    Evictions,
}

impl CacheCount {
    /// What the statistics call it.
    fn name(self) -> &'static str {
        match self {
            CacheCount::Accesses => "accesses",
            CacheCount::Hits => "hits",
            CacheCount::Misses => "misses",
            CacheCount::Evictions => "evictions",
        }
    }

    /// That of some caches.
    pub fn of(self, counts: &CacheCounts) -> f64 {
        let count = match self {
            CacheCount::Accesses => counts.accesses,
            CacheCount::Hits => counts.hits,
            CacheCount::Misses => counts.misses,
            CacheCount::Evictions => counts.evictions,
        };
        count as f64
    }
}

/// Something that machines count and whose sum over all frames is estimated.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Count {
    /// Cycles.
    Cycles,
    /// Bytes of a client of memory.
    Client(String, Way),
    /// Bytes of DRAM.
    Dram(Way),
    /// Bytes of DRAM both ways.
    DramBytes,
    /// What all caches of a kind count.
    Cache(String, CacheCount),
}

impl fmt::Display for Count {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Count::Cycles => f.write_str("cycles"),
            Count::Client(name, way) => write!(f, "memory.clients.{name}.{}", way.name()),
            Count::Dram(way) => write!(f, "memory.dram.{}", way.name()),
            Count::DramBytes => f.write_str("memory.dram.bytes"),
            Count::Cache(name, what) => write!(f, "caches.{name}.{}", what.name()),
        }
    }
}

/// Where DRAM's counters stand.
const DRAM: &str = "memory.dram";

/// Where those of a client stand.
fn client(name: &str) -> String {
    format!("memory.clients.{name}")
}

/// The caches of a kind, in the statistics of a machine.
pub(super) fn banks(tree: &Tree, cache: &str) -> Vec<CacheCounts> {
    match tree.get(&format!("caches.{cache}")) {
        Some(Node::List(banks)) => banks.iter().map(Tree::read).collect(),
        _ => Vec::new(),
    }
}

/// The bytes of each client of memory and of DRAM, as the statistics of a machine have them.
pub(super) fn traffic(tree: &Tree) -> Vec<Count> {
    let ways = [Way::Read, Way::Write];
    let mut found = Vec::new();
    if let Some(Node::Tree(clients)) = tree.get("memory.clients") {
        let names = clients.entries().map(|(name, _)| name);
        found.extend(names.flat_map(|name| ways.map(|way| Count::Client(name.to_owned(), way))));
    }
    found.extend(ways.map(Count::Dram).into_iter().filter(|count| count.is_in(tree)));
    found
}

impl Count {
    /// Whether the statistics of a machine have it.
    pub fn is_in(&self, tree: &Tree) -> bool {
        match self {
            Count::Cycles => true,
            Count::Client(name, _) => tree.get(&client(name)).is_some(),
            Count::Dram(_) | Count::DramBytes => tree.get(DRAM).is_some(),
            Count::Cache(name, _) => !banks(tree, name).is_empty(),
        }
    }

    /// Its value in the statistics of a machine; the sum over a kind of cache.
    pub fn of(&self, tree: &Tree) -> f64 {
        let bytes = |read: u64, written: u64, way: &Way| (if *way == Way::Read { read } else { written }) as f64;
        match self {
            Count::Cycles => tree.number("cycles").unwrap_or(0.0),
            Count::Client(name, way) => {
                let counts: ClientCounts = tree.group(&client(name));
                bytes(counts.read_bytes, counts.write_bytes, way)
            }
            Count::Dram(way) => {
                let counts: DramCounts = tree.group(DRAM);
                bytes(counts.read_bytes, counts.write_bytes, way)
            }
            Count::DramBytes => Count::Dram(Way::Read).of(tree) + Count::Dram(Way::Write).of(tree),
            Count::Cache(name, what) => what.of(&tree.group(&format!("caches.{name}"))),
        }
    }

    /// Puts bytes of a client or of DRAM into statistics that have them.
    pub(super) fn put(&self, tree: &mut Tree, bytes: u64) {
        let memory = tree.child("memory");
        match self {
            Count::Client(name, way) => memory.child("clients").child(name).count(way.name(), bytes),
            Count::Dram(way) => memory.child("dram").count(way.name(), bytes),
            Count::Cycles | Count::DramBytes | Count::Cache(..) => {}
        }
    }

    /// To what it is in proportion: what is estimated of just this, where it is, else cycles.
    fn by(&self) -> usize {
        use CacheCount::{Accesses, Misses};
        match self {
            Count::Dram(Way::Read) => 1,
            Count::Dram(Way::Write) => 2,
            Count::DramBytes => 3,
            Count::Cache(name, Accesses) if name == "l2" => 4,
            Count::Cache(name, Misses) if name == "l2" => 5,
            Count::Cache(name, Accesses) if name == "texture" => 6,
            Count::Cache(name, Misses) if name == "texture" => 7,
            // Texture caches read the lines that they miss.
            Count::Client(name, Way::Read) if name == "texture" => 7,
            _ => 0,
        }
    }
}

/// What is estimated of a frame, in the order of [`Count::by`].
const ESTIMATES: [fn(&PhaseEstimate) -> f64; 8] = [
    |phase| phase.cycles,
    |phase| phase.memory.read,
    |phase| phase.memory.written,
    |phase| phase.memory.read + phase.memory.written,
    |phase| phase.memory.lookups,
    |phase| phase.memory.misses,
    |phase| phase.textures[0],
    |phase| phase.textures[1],
];

/// The estimates of all frames: a few numbers each.
#[derive(Clone, Debug, Default)]
pub struct Survey {
    /// The trace's own numbers of the frames.
    pub numbers: Vec<u32>,
    /// Their signatures.
    pub signatures: Vec<Vec<f64>>,
    estimates: Vec<[f64; ESTIMATES.len()]>,
    /// Host time of the estimates, rendering and profiles left out.
    pub time: Duration,
}

/// Lets a survey read the frames of a rendering.
pub fn take<'r>(rendering: &mut Rendering<'r>, config: &'r Config, survey: &'r mut Survey) {
    let mut bound = Bound::proxy(config);
    let mut units = Vec::new();
    let read = move |frames: &[Profiled]| {
        let watch = Stopwatch::start();
        for frame in frames {
            let estimate = bound.frame(&frame.profile);
            let work = estimate.phases.iter().flat_map(|phase| phase.units.iter().copied());
            survey.signatures.push(signature(work, &mut units));
            survey.estimates.push(ESTIMATES.map(|of| estimate.phases.iter().map(of).sum()));
            survey.numbers.push(estimate.number);
        }
        survey.time += watch.elapsed();
        Ok(())
    };
    rendering.profile(config.render_key(), Reader { keeps: false, read: Box::new(read) });
}

impl Survey {
    /// What is estimated by frame, of what a count is in proportion to.
    pub fn estimates(&self, count: &Count) -> Vec<f64> {
        self.estimates.iter().map(|frame| frame[count.by()]).collect()
    }

    /// The sum over all frames of what was counted in those drawn.
    pub fn total(&self, clusters: &Clusters, drawn: &[usize], count: &Count, frames: &[&Tree]) -> Interval {
        let own: Vec<f64> = frames.iter().map(|tree| count.of(tree)).collect();
        clusters.total(drawn, &self.estimates(count), &own)
    }
}
