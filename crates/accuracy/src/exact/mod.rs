//! Section A: identities that hold on every trace.

mod circuits;
mod image;
mod machines;
mod statistics;

use super::Target;

/// Targets of the section, in order.
pub const TARGETS: &[Target] = &[
    machines::CONSERVATION,
    circuits::LITTLE,
    machines::ACCOUNT,
    machines::CLOCKS,
    image::IMAGE,
    statistics::STATISTICS,
    circuits::PIPELINE,
    circuits::CREDIT,
];
