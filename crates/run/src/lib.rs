//! Floor 5: replay: one rendering, and those who read its work side by side.

pub mod apart;
pub mod bound;
pub mod cycle;
pub mod exit;
pub mod functional;
pub mod host;
pub mod kept;
pub mod machines;
pub mod maps;
pub mod profiles;
pub mod rendering;
pub mod replay;
pub mod sample;
pub mod timeline;
