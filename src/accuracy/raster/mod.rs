//! Section B: rasterisation and numbers.

mod draw;
mod extreme;
mod oracle;
mod shared;

use super::Target;

/// Targets of the section, in order.
pub const TARGETS: &[Target] =
    &[shared::FILL_RULES, oracle::ORACLE, extreme::SNAP, extreme::EXTREME, shared::WATERTIGHT, shared::INTEGER_SHIFT];
