//! Floor 1: what is counted, and how counts become a report.
//!
//! * [`counters!`](crate::counters) declares a set of counters once: the declaration is the struct, its documentation, its
//!   place in the statistics tree and its row in the generated page.
//! * [`Heading`] is a place in the tree, with what is there; [`Key`] is a statistic under it. Readers use them and the declared fields: no reader spells
//!   the name of a counter.
//! * [`Account`] gives each cycle of a unit to exactly one of busy, starved, blocked, memory and idle.
//! * [`Histogram`] counts values in power-of-two classes.
//! * [`Tree`] is the ordered set of named leaves that a run leaves behind.
//!
//! ```
//! use stats::{Account, Cycles, Group, Heading, Tree, Why};
//!
//! stats::counters! {
//!     /// The counters of triangle setup.
//!     pub struct SetupCounts {
//!         /// Triangles that face away.
//!         culled: "triangles",
//!     }
//! }
//! const SETUP: Heading = Heading::new("setup[i]", "Triangle setup.");
//!
//! // The unit waited for four cycles, then worked for six.
//! let mut account = Account::new(0);
//! account.note(0, Why::Starved);
//! account.note(4, Why::Busy);
//!
//! let mut tree = Tree::new();
//! SETUP.at(&mut tree, 0).extend(SetupCounts { culled: 2 }.tree());
//! SETUP.at(&mut tree, 0).extend(account.read(10).tree());
//! assert_eq!(tree.number("setup[0].culled"), Some(2.0));
//! assert_eq!(SETUP.sum::<Cycles>(&tree), Cycles { busy: 6, starved: 4, ..Cycles::default() });
//! ```

mod account;
mod counters;
mod heading;
mod histogram;
mod page;
mod tree;

pub use account::{Account, Cycles, FRAME, FrameCounts, SECONDS, Why};
pub use counters::{Counter, Declaration, Group};
pub use heading::{Heading, Key};
pub use histogram::Histogram;
pub use page::page;
pub use tree::{Leaf, Node, Tree, csv_field};
