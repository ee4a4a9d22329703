//! Circuits small enough to be counted by hand.

mod channel;
mod machine;
pub(crate) mod order;
mod pipeline;
mod units;
