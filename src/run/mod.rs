//! Floor 5: replay: render and machine side by side.

pub mod bound;
pub mod host;
pub mod replay;
pub mod sample;
pub mod sampled;
