//! Floor 1: what is counted, and how counts become a report.
//!
//! * [`counters!`](crate::counters) declares a set of counters once: the declaration is the struct, its documentation, its
//!   place in the statistics tree and its row in the generated page.
//! * [`Heading`] is a place in the tree, with what is there.
//! * [`Account`] gives each cycle of a unit to exactly one of busy, starved, blocked, memory and idle.
//! * [`Histogram`] counts values in power-of-two classes.
//! * [`Tree`] is the ordered set of named leaves that a run leaves behind; [`Tree::since`] makes a frame's statistics out of
//!   two readings of counters that only ever grow.

mod account;
mod counters;
mod heading;
mod histogram;
mod page;
mod tree;

pub use account::{Account, Cycles, FrameCounts, Why};
pub use counters::{Counter, Declaration, Group};
pub use heading::Heading;
pub use histogram::Histogram;
pub use page::page;
pub use tree::{Leaf, Node, Tree, csv_field};
