//! Vertices and primitives, and how they are packed into buffers.

pub mod clip;
pub mod listed;
pub mod pack;
pub mod primitive;
pub mod summary;
pub mod vertex;
