//! Units in tiny circuits: a source, the unit, a sink. Times are exact: not a cycle before, not a cycle after. What is expected is
//! worked out from the configuration, in a comment; every circuit runs under both clocks and in several orders of ticks.
//!
//! A source pushes in cycle 0 over a channel of latency 1, so that a unit sees its first item in cycle 1. What a unit pushes in
//! cycle t over a channel of latency l a sink gets in t + l.

mod assembly;
mod clip;
mod color;
mod command;
mod compute;
mod constant;
mod core;
mod deal;
mod depth;
mod dispatch;
mod display;
mod distribute;
mod early;
mod fetch;
mod interpolate;
mod kit;
mod order;
mod resolve;
pub mod scenery;
mod setup;
mod texture;
mod traverse;
mod walk;
mod warp;
