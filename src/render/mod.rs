//! Floor 3: executes a trace functionally, in API order, in parallel over screen tiles; it knows no cycle.

pub mod draw;
pub mod pipeline;
pub mod surface;
