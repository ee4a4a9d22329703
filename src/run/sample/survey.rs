//! What is estimated of all frames, by which they are compared and to which counts are in proportion.

use std::fmt;
use std::time::Duration;

use super::clusters::{Clusters, Interval, signature};
use crate::machine::Config;
use crate::run::bound::{Bound, PhaseEstimate};
use crate::run::host::Stopwatch;
use crate::run::profiles::{Profiled, Reader};
use crate::run::rendering::Rendering;
use crate::stats::{Leaf, Node, Tree};

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
    pub fn name(self) -> &'static str {
        match self {
            Way::Read => "read_bytes",
            Way::Write => "write_bytes",
        }
    }

    fn named(name: &str) -> Option<Way> {
        [Way::Read, Way::Write].into_iter().find(|way| way.name() == name)
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
    pub fn name(self) -> &'static str {
        match self {
            CacheCount::Accesses => "accesses",
            CacheCount::Hits => "hits",
            CacheCount::Misses => "misses",
            CacheCount::Evictions => "evictions",
        }
    }

    /// That of one cache.
    pub fn of(self, cache: &Tree) -> f64 {
        cache.number(self.name()).unwrap_or(0.0)
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

/// The caches of a kind, in the statistics of a machine.
pub(super) fn banks<'t>(tree: &'t Tree, cache: &str) -> Option<&'t [Tree]> {
    let Some(Node::Tree(caches)) = tree.get("caches") else { return None };
    match caches.get(cache) {
        Some(Node::List(banks)) => Some(banks),
        _ => None,
    }
}

/// The bytes of each client of memory and of DRAM, as the statistics of a machine have them.
pub(super) fn traffic(tree: &Tree) -> Vec<Count> {
    let Some(Node::Tree(memory)) = tree.get("memory") else { return Vec::new() };
    let ways = |tree: &Tree| -> Vec<Way> {
        let counted = tree.entries().filter(|(_, node)| matches!(node, Node::Leaf(Leaf::Count(_))));
        counted.filter_map(|(name, _)| Way::named(name)).collect()
    };
    let mut found = Vec::new();
    for (name, node) in memory.entries() {
        match (name, node) {
            ("clients", Node::Tree(clients)) => {
                for (client, node) in clients.entries() {
                    let Node::Tree(tree) = node else { continue };
                    found.extend(ways(tree).into_iter().map(|way| Count::Client(client.to_owned(), way)));
                }
            }
            ("dram", Node::Tree(dram)) => found.extend(ways(dram).into_iter().map(Count::Dram)),
            _ => {}
        }
    }
    found
}

impl Count {
    /// Whether the statistics of a machine have it.
    pub fn is_in(&self, tree: &Tree) -> bool {
        match self {
            Count::Cache(name, what) => {
                banks(tree, name).and_then(<[Tree]>::first).is_some_and(|cache| cache.get(what.name()).is_some())
            }
            Count::DramBytes => Count::Dram(Way::Read).is_in(tree),
            count => tree.number(&count.to_string()).is_some(),
        }
    }

    /// Its value in the statistics of a machine; the sum over a kind of cache.
    pub fn of(&self, tree: &Tree) -> f64 {
        match self {
            Count::Cache(name, what) => banks(tree, name).map_or(0.0, |banks| banks.iter().map(|cache| what.of(cache)).sum()),
            Count::DramBytes => Count::Dram(Way::Read).of(tree) + Count::Dram(Way::Write).of(tree),
            count => tree.number(&count.to_string()).unwrap_or(0.0),
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
