//! Section B: rasterisation and numbers. The targets need no machine: each compares a function of the card with an independent one over many
//! random cases.

mod arithmetic;
mod builtins;
mod draw;
mod extreme;
mod numbers;
mod oracle;
mod overshade;
mod programs;
mod shared;

use super::Target;

/// Targets of the section, in order.
pub const TARGETS: &[Target] = &[
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
