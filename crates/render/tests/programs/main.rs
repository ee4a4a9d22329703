//! Shaders the whole way, from a trace to the bits that they leave.

mod common;
mod compute;
mod draw;
mod feedback;
mod language;
mod modules;
mod needs;
mod textures;
mod threads;
