//! The state of the machine in its parts. No part knows the machine, or the calls that change it.

pub mod arb;
pub mod arrays;
pub mod bindings;
pub mod buffers;
pub mod compact;
pub mod contexts;
pub mod drawing;
pub mod evaluator;
pub mod fragments;
pub mod framebuffers;
pub mod glsl;
pub mod lighting;
pub mod lists;
pub mod materials;
pub mod placement;
pub mod prepared;
pub mod raster;
pub mod restart;
pub mod saved;
pub mod selection;
pub mod server;
pub mod texture;
pub mod texturing;
pub mod transform;
