//! Fillrate replays recorded command traces on a cycle-approximate model of a graphics card.
//!
//! A program records what it draws, chooses cards, replays and reads counters:
//!
//! ```
//! use fillrate::gfx::format::Format;
//! use fillrate::mem::{CLIENTS, ClientCounts};
//! use fillrate::record::{self, Recorder};
//! use fillrate::stats::{FRAME, FrameCounts};
//! use fillrate::{Config, Fidelity, Options, replay};
//!
//! let mut card = Recorder::new("triangle");
//! let shader = card.create_shader(
//!     "triangle",
//!     "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
//!         return vec4f(f32(i & 1u), f32(i >> 1u), 0.0, 1.0);
//!     }
//!     @fragment fn fs() -> @location(0) vec4f { return vec4f(1.0, 0.5, 0.0, 1.0); }",
//! );
//! let texture = card.create_texture("shown", record::texture_2d(128, 128, Format::Rgba8Unorm));
//! let view = card.create_view(texture);
//! let pipeline = card.create_render_pipeline("triangle", record::render_pipeline(shader, Format::Rgba8Unorm));
//! let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
//! pass.set_pipeline(pipeline);
//! pass.draw(3, 1);
//! drop(pass);
//! card.present(texture);
//! let trace = card.finish();
//!
//! for name in ["baseline", "sort-middle-binned"] {
//!     let config = Config::built_in(name).expect("it is built in");
//!     let done = replay(&trace, &Options::new(config, Fidelity::Cycle), &|_| ())?;
//!     let FrameCounts { cycles } = FRAME.sum(&done.total);
//!     let ClientCounts { write_bytes: written, .. } = CLIENTS.named("color").sum(&done.total);
//!     println!("{name}: {cycles} cycles, {written} bytes written by the ROPs");
//!     assert_eq!(done.frames.len(), 1);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! [`import::open`] reads a trace from a file, [`scenes`] has traces that are built in, [`Config::set`] changes a knob, [`Replay::frames`] have
//! pictures, and [`Statistics`] are read by group, as above, or by path. Errors are [`TraceError`], [`ConfigError`] and [`ReplayError`].
//! `docs/library.md` is a guide.
//!
//! Floors, each a package or module that depends only on floors below:
//!
//! | floor | packages (`crates/`), modules of this library |
//! |---|---|
//! | 0 | [`num`], [`host`], `gfxr` |
//! | 1 | [`gfx`], [`trace`], [`knob`], [`stats`], [`sim`] |
//! | 2 | [`work`], [`shader`], [`mem`], [`import`], [`scenes`] |
//! | 3 | [`render`], [`mod@unit`], [`synthetic`] |
//! | 4 | [`machine`] |
//! | 5 | [`run`] |
//! | 6 | [`accuracy`] |
//! | 7 | [`report`] |
//! | 8 | [`sweep`], [`why`](mod@why) |
//! | 9 | [`cli`] |
//!
//! Without the default feature `cli` the floors from 7 on, and the packages that they need, are left out; without `accuracy`, the checks of the
//! model; without `opengl` or `wgpu`, the importer of such traces.

#[cfg(feature = "accuracy")]
pub use accuracy;
#[cfg(feature = "vulkan")]
pub use gfxr;
pub use {gfx, host, import, knob, machine, mem, num, render, run, scenes, shader, sim, stats, synthetic, trace, unit, work};

pub use machine::{Config, ConfigError};
pub use run::error::ReplayError;
pub use run::picture;
pub use run::replay::{Fidelity, Options, Replay, replay};
pub use stats::Tree as Statistics;
pub use trace::{Trace, TraceError, record};

#[cfg(feature = "cli")]
pub mod report;

#[cfg(feature = "cli")]
pub mod sweep;
#[cfg(feature = "cli")]
pub mod why;

#[cfg(feature = "cli")]
pub mod cli;
