//! Floor 3: the units of a graphics card. Each file is one unit: configuration, state, counters, and a `tick` that reads as
//! numbered sentences, its stages last to first. WHEN things happen is here; WHAT they compute is in [`gfx`].
//!
//! Units share a [`Card`]: the work that tokens point into, the frame buffer, pools of what is too large for a token. No unit knows
//! which machine it is part of; a machine lists its units in data-flow order (see the package `machine`).
//!
//! # Example
//!
//! Four pipelines share the screen in tiles of 16x16 pixels. Two tiles across and two down belong to different pipelines:
//!
//! ```
//! use unit::interleave::{Interleave, Pattern};
//!
//! let interleave = Interleave::new(Pattern::Skewed, 4, 16);
//! // A block has 8x8 pixels, a tile has two by two blocks.
//! let mut owners = [[0, 0], [2, 0], [0, 2], [2, 2]].map(|[x, y]| interleave.owner(x, y));
//! owners.sort();
//! assert_eq!(owners, [0, 1, 2, 3]);
//! ```

pub mod apply;
pub mod assembly;
pub mod bin;
pub mod block_cache;
pub mod block_sets;
pub mod card;
pub mod class_state;
pub mod clears;
pub mod clip;
pub mod color;
pub mod command;
pub mod compose;
pub mod compression;
pub mod compute;
pub mod constant;
pub mod copies;
pub mod core;
pub mod deal;
pub mod depth;
pub mod depths;
pub mod dispatch;
pub mod distribute;
pub mod early;
pub mod fetch;
pub mod frame;
pub mod gather;
pub mod hide;
pub mod index_runs;
pub mod interleave;
pub mod interpolate;
pub mod misses;
pub mod network;
pub mod order;
pub mod phase;
pub mod rendering_elimination;
pub mod resolve;
pub mod route;
pub mod scanout;
pub mod setup;
pub mod sorting;
pub mod stamps;
pub mod stream;
pub mod tags;
pub mod texture;
pub mod tile_fetch;
pub mod token;
pub mod touch;
pub mod traverse;
pub mod warp;

pub use card::{Card, Fault};

#[cfg(test)]
mod tests;
