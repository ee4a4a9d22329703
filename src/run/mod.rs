//! Floor 5: replay: render and machine side by side.

pub mod host;
pub mod replay;
