//! Traces of other programs.

mod fuzz;
mod oracle;
mod peers;
mod shaders;
mod wgpu;
