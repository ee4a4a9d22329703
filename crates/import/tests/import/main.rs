//! Traces of other programs.

mod capture;
mod damaged;
mod fuzz;
mod gl;
mod gl_terms;
mod gl_windows;
mod oracle;
mod peers;
mod recorder;
mod shaders;
mod sites;
mod vulkan;
mod wgpu;
