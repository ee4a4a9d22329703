//! Where the traffic was: the busiest link against the mean.

use sim::ChannelCounts;
use stats::{Node, Tree};

/// A link, by its channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MapLink {
    pub name: &'static str,
    pub index: usize,
    pub from: String,
    pub to: String,
}

/// Where the links of a network are. Their channels count for themselves; this finds the busiest of them.
#[derive(Clone, Debug)]
pub struct NetworkMap {
    link_bytes: u32,
    links: Vec<MapLink>,
}

/// The traffic of a network over some cycles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Links.
    pub links: u64,
    /// Parcels, counted once on each link.
    pub hops: u64,
    /// Their bytes.
    pub bytes: u64,
    /// What links carried of what they could have, on average.
    pub mean: f64,
    /// What the busiest link carried of what it could have.
    pub hottest: f64,
    /// Its channel and its ends.
    pub hot_spot: String,
}

impl NetworkMap {
    pub(super) fn new(link_bytes: u32, links: Vec<MapLink>) -> NetworkMap {
        NetworkMap { link_bytes, links }
    }

    /// The traffic over so many cycles by the counts in `channels`, the subtree of that name.
    pub fn traffic(&self, channels: &Tree, cycles: u64) -> Traffic {
        let mut traffic = Traffic { links: self.links.len() as u64, ..Traffic::default() };
        let mut most = 0;
        for link in &self.links {
            let Some(Node::List(bank)) = channels.get(link.name) else { continue };
            let ChannelCounts { items, bytes, .. } = bank.get(link.index).map(Tree::read).unwrap_or_default();
            traffic.hops += items;
            traffic.bytes += bytes;
            if bytes > most {
                most = bytes;
                traffic.hot_spot = format!("{}[{}] from {} to {}", link.name, link.index, link.from, link.to);
            }
        }
        let capacity = cycles as f64 * f64::from(self.link_bytes);
        if capacity > 0.0 {
            traffic.hottest = most as f64 / capacity;
            traffic.mean = traffic.bytes as f64 / (capacity * self.links.len() as f64);
        }
        traffic
    }
}

impl Traffic {
    /// As leaves of the statistics.
    pub fn tree(&self) -> Tree {
        let mut tree = Tree::new();
        tree.level("links", self.links);
        tree.count("hops", self.hops);
        tree.count("link_bytes", self.bytes);
        tree.real("mean_share", self.mean);
        tree.real("hottest_share", self.hottest);
        tree.text("hot_spot", &self.hot_spot);
        tree
    }

    /// What [`Traffic::tree`] has written; zeros where it has not.
    pub fn read(tree: &Tree) -> Traffic {
        let number = |name| tree.number(name).unwrap_or(0.0);
        Traffic {
            links: number("links") as u64,
            hops: number("hops") as u64,
            bytes: number("link_bytes") as u64,
            mean: number("mean_share"),
            hottest: number("hottest_share"),
            hot_spot: tree.text_at("hot_spot").to_owned(),
        }
    }
}
