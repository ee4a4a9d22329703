//! Floor 3: executes a trace functionally, in API order, in parallel over screen tiles; it knows no cycle.
//!
//! [`render`] runs the commands and hands on [`Event`](work::Event)s: the work of each draw, in API order, and each frame's
//! image.

mod attachments;
mod bind;
mod compute;
mod copy;
mod debug_groups;
mod deferred;
mod execute;
mod flight;
mod inspection;
mod ledger;
mod memory;
mod needs;
mod objects;
mod parallel;
mod pass;
mod queued;
mod resources;
mod sprites;
mod state;
mod stored;
mod transfer;

pub mod draw;
pub mod pipeline;
pub mod surface;

pub use draw::Skips;
pub use execute::{FrameSet, Options, Sink, Stop, Summary, render};
pub use inspection::{Frames, Image, Inspection, inspect};
pub use ledger::{ConsumerMemory, Ledger, Watch};
pub use needs::{Dependencies, Need, Needs, Want};
