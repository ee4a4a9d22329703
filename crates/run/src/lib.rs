//! Floor 5: replay: one rendering, and the readers of its work side by side.
//!
//! # Example
//!
//! ```
//! use gfx::format::Format;
//! use machine::Config;
//! use run::replay::{Fidelity, Options, replay};
//! use stats::{FRAME, FrameCounts};
//! use trace::record::{self, Recorder};
//!
//! // A pass that clears a texture to red, and a present that ends the frame.
//! let mut card = Recorder::new("clear");
//! let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
//! let view = card.create_view(target);
//! drop(card.begin_render_pass([record::clear(view, [1.0, 0.0, 0.0, 1.0])], None));
//! card.present(target);
//!
//! let options = Options::new(Config::built_in("tiny")?, Fidelity::Cycle);
//! let done = replay(&card.finish(), &options, &|_| ())?;
//! assert_eq!(done.frames.len(), 1);
//! assert!(FRAME.sum::<FrameCounts>(&done.total).cycles > 0);
//! # Ok::<(), anyhow::Error>(())
//! ```

pub mod bound;
pub mod cycle;
pub mod error;
pub mod frame_runs;
pub mod frame_sink;
pub mod functional;
pub mod host;
pub mod machines;
pub mod maps;
pub mod picture;
pub mod pipeline;
pub mod pixel;
pub mod profiles;
pub mod rendering;
pub mod replay;
pub mod sample;
pub mod shader_cost;
pub mod stored_work;
pub mod targets;
pub mod timeline;
