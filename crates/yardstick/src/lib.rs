//! Yardsticks: what a target of accuracy is, and the targets that need no machine. Those have loops of their own over many random
//! cases, so that this package is optimised where `accuracy` is not.
//!
//! A [`Target`] is an identity, a closed form or a rule of a specification. Its check makes its own input, runs the code that a replay
//! runs, and leaves [`Row`]s of what was expected and what came out. With [`Setting::inject_fault`] a check spoils what it hands from one stage
//! to the next, as its target says: then it must fail, which shows that it can.
//!
//! ```
//! use yardstick::{RASTER, Setting, Size};
//!
//! let target = RASTER.iter().find(|target| target.id == "fill-rules").expect("a target");
//! let rows = (target.check)(&Setting { seed: 1, size: Size::Small, inject_fault: false })?;
//! assert!(rows.iter().all(|row| row.holds()));
//! # Ok::<(), anyhow::Error>(())
//! ```

mod arithmetic;
mod builtins;
mod draw;
mod extreme;
mod numbers;
mod oracle;
mod overshade;
mod programs;
mod queue;
mod shared;
mod target;

pub use queue::QUEUE;
pub use target::{Row, Section, Setting, Size, Target, TargetResult};

/// Targets of rasterisation and numbers, in order.
pub const RASTER: &[Target] = &[
    shared::FILL_RULES,
    oracle::ORACLE,
    extreme::SNAP,
    extreme::EXTREME,
    shared::WATERTIGHT,
    shared::INTEGER_SHIFT,
    numbers::INTERPOLATION,
    numbers::DEPTH,
    arithmetic::ARITHMETIC,
    builtins::BUILTINS,
    overshade::QUAD_OVERSHADE,
];
