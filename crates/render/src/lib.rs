//! Floor 3: executes a trace functionally, in API order, in parallel over screen tiles; it knows no cycle.
//!
//! [`render`] runs the commands and hands on [`Event`](work::Event)s: the work of each draw, in API order, and each frame's
//! image.
//!
//! # Example
//!
//! ```
//! use gfx::format::Format;
//! use render::{Options, render};
//! use trace::record::{self, Recorder};
//! use work::Event;
//!
//! // A pass that clears a texture to red, and a present that ends the frame.
//! let mut card = Recorder::new("clear");
//! let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
//! let view = card.create_view(target);
//! drop(card.begin_render_pass([record::clear(view, [1.0, 0.0, 0.0, 1.0])], None));
//! card.present(target);
//!
//! let mut pictures = Vec::new();
//! render(&card.finish(), &Options::default(), &mut |event| {
//!     if let Event::EndFrame(frame) = event {
//!         pictures.push(frame.reference);
//!     }
//!     Ok(())
//! })?;
//! assert_eq!(pictures.len(), 1);
//! assert_eq!(&pictures[0][..4], [255, 0, 0, 255]);
//! # Ok::<(), trace::TraceError>(())
//! ```

mod attachments;
mod bind;
mod compute;
mod copy;
mod debug_groups;
mod deferred;
mod execute;
mod fault;
mod inspection;
mod ledger;
mod memory;
mod needs;
mod objects;
mod parallel;
mod pass;
mod piece;
mod resources;
mod sprites;
mod state;
mod stored;
mod targets;
mod transfer;

pub mod draw;
pub mod pipeline;
pub mod surface;

pub use draw::Skips;
pub use execute::{FrameSet, Options, Sink, Stop, Summary, render};
pub use inspection::{Frames, Image, Inspection, inspect};
pub use ledger::{ConsumerMemory, Ledger, Watch};
pub use needs::{Dependencies, Need, Needs, Want};
pub use piece::piece;
pub use targets::{PassTarget, TargetReader};
