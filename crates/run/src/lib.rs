//! Floor 5: replay: one rendering, and the readers of its work side by side.

pub mod bound;
pub mod cycle;
pub mod frame_runs;
pub mod frame_sink;
pub mod functional;
pub mod host;
pub mod machines;
pub mod maps;
pub mod profiles;
pub mod rendering;
pub mod replay;
pub mod sample;
pub mod stored_work;
pub mod timeline;
