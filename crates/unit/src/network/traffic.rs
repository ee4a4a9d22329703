//! The distribution of traffic: the busiest link against the mean.

use sim::{CHANNELS, ChannelCounts};
use stats::{Declaration, Group, Leaf, Tree};

/// A link, by its channel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct MapLink {
    pub name: &'static str,
    pub index: usize,
    pub from: String,
    pub to: String,
}

/// The channels of a network's links. Channels count for themselves; this finds the busiest of them.
#[derive(Clone, Debug)]
pub struct NetworkMap {
    link_bytes: u32,
    links: Vec<MapLink>,
}

stats::counters! {
    /// What the links of a network have carried together.
    pub struct LinkCounts {
        /// Parcels, counted once on each link on their way.
        hops: "parcels",
        /// Their bytes, counted so too.
        link_bytes: "bytes",
    }
}

/// The traffic of a network over some cycles.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Traffic {
    /// Links.
    pub links: u64,
    /// The traffic that they carried.
    pub carried: LinkCounts,
    /// The mean utilisation of the links: the bytes carried, divided by the bytes that they could have carried.
    pub mean: f64,
    /// The utilisation of the busiest link.
    pub hottest: f64,
    /// The channel and the ends of the busiest link.
    pub hot_spot: String,
}

impl NetworkMap {
    pub(super) fn new(link_bytes: u32, links: Vec<MapLink>) -> NetworkMap {
        NetworkMap { link_bytes, links }
    }

    /// The traffic over `cycles` cycles, from the channels' counters in the statistics.
    pub fn traffic(&self, statistics: &Tree, cycles: u64) -> Traffic {
        let mut traffic = Traffic { links: self.links.len() as u64, ..Traffic::default() };
        let mut most = 0;
        let banks = self.links.chunk_by(|a, b| a.name == b.name).flat_map(|links| {
            let bank = CHANNELS.named(links[0].name).find(statistics);
            links.iter().map(move |link| (link, bank.get(link.index).map(|channel| channel.read()).unwrap_or_default()))
        });
        for (link, ChannelCounts { items, bytes, .. }) in banks {
            traffic.carried += LinkCounts { hops: items, link_bytes: bytes };
            if bytes > most {
                most = bytes;
                traffic.hot_spot = format!("{}[{}] from {} to {}", link.name, link.index, link.from, link.to);
            }
        }
        let capacity = cycles as f64 * f64::from(self.link_bytes);
        if capacity > 0.0 {
            traffic.hottest = most as f64 / capacity;
            traffic.mean = traffic.carried.link_bytes as f64 / (capacity * self.links.len() as f64);
        }
        traffic
    }
}

/// The number of a network's links.
pub const LINKS: Declaration = Declaration::new("links", "links", "Links: channels of the network.");

/// The mean use of a network's links.
pub const MEAN_SHARE: Declaration =
    Declaration::new("mean_share", "ratio", "What links carried of what they could have, on average.");

/// The use of a network's busiest link.
pub const HOTTEST_SHARE: Declaration =
    Declaration::new("hottest_share", "ratio", "What the busiest link carried of what it could have.");

/// The busiest link of a network.
pub const HOT_SPOT: Declaration = Declaration::new("hot_spot", "", "The busiest link: its channel and its ends.");

impl Traffic {
    /// As leaves of the statistics.
    pub fn tree(&self) -> Tree {
        let mut tree = Tree::new();
        tree.level(LINKS.name, self.links);
        tree.extend(self.carried.tree());
        tree.real(MEAN_SHARE.name, self.mean);
        tree.real(HOTTEST_SHARE.name, self.hottest);
        tree.text(HOT_SPOT.name, &self.hot_spot);
        tree
    }

    /// The traffic that [`Traffic::tree`] has written into a tree. Zeros if the tree has none.
    pub fn read(tree: &Tree) -> Traffic {
        let number = |of| tree.leaf(of).and_then(Leaf::number).unwrap_or(0.0);
        Traffic {
            links: number(&LINKS) as u64,
            carried: tree.read(),
            mean: number(&MEAN_SHARE),
            hottest: number(&HOTTEST_SHARE),
            hot_spot: tree.leaf(&HOT_SPOT).map_or("", Leaf::text).to_owned(),
        }
    }
}
