//! Traces of other programs.

mod fuzz;
mod gl;
mod oracle;
mod peers;
mod recorder;
mod shaders;
mod wgpu;
