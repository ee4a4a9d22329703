//! Floor 0: the numbers that everything else counts with.
//!
//! The ids of each kind of object are a type of their own, so that they are not mixed up. This costs nothing at run time.
//!
//! ```
//! use num::{Limits, Random, TextureId, snap};
//!
//! // Coordinates in the window are whole numbers of 1/256 pixel.
//! assert_eq!(snap(1.5), 384);
//! // Each kind of object has a type of its own for its numbers.
//! assert_eq!(TextureId(3).to_string(), "TextureId(3)");
//! // Random numbers depend on their seed alone.
//! assert_eq!(Random::new(7).bits(), Random::new(7).bits());
//! // A request of a trace is compared with a limit before it is served.
//! let mut limits = Limits::default();
//! limits.set("work.cycles=1_000")?;
//! assert!(limits.work_cycles.check(1_000).is_ok() && limits.work_cycles.check(1_001).is_err());
//! # Ok::<(), String>(())
//! ```

mod bytes;
mod call_site;
mod edits;
mod fixed;
mod ids;
mod keyed;
mod lanes;
mod limits;
mod map;
mod meter;
mod prefetch;
mod random;
mod words;

pub use bytes::{float_bytes, word_bytes};
pub use call_site::CallSite;
pub use edits::{edits, nearest};
pub use fixed::{Fx8, snap};
pub use ids::*;
pub use lanes::{LANES, Lanes, Mask, QUADS};
pub use limits::{Limit, LimitExceeded, LimitInfo, LimitOverrun, Limits};
pub use map::{NameMap, Number, NumberMap};
pub use meter::Meter;
pub use prefetch::prefetch;
pub use random::{Random, hash};
pub use words::{NoMemory, Words};

/// The end of a message in which one part of the program contradicts another. No trace and no configuration is to blame for it.
pub const OUR_FAULT: &str = "This is a fault of Fillrate, not of the trace. Please report it with the trace, the configuration, the output \
                             of `fillrate --version` and the command line.";

/// A point in simulated time: clock edges of the card since the start of the replay.
pub type Cycle = u64;

/// A cycle that never comes: what a unit answers when only an input can wake it.
pub const NEVER: Cycle = Cycle::MAX;

/// Number of fractional bits of a window coordinate (DESIGN: 16.8 fixed point).
pub const SUBPIXEL_BITS: u32 = 8;

/// Sub-pixel steps in one pixel.
pub const SUBPIXEL: i32 = 1 << SUBPIXEL_BITS;
