//! Circuits small enough to be counted by hand.

mod channel;
mod machine;
mod order;
mod pipeline;
mod units;
