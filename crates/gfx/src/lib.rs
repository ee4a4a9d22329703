//! Floor 1: WHAT a graphics card computes, as pure functions. No cycle, no thread, no file.

pub mod format;
pub mod image;
pub mod simd;
pub mod state;

pub mod math;
pub mod texel;
pub mod texture;
pub mod tiling;

pub mod assemble;
pub mod clip;
pub mod interpolate;
pub mod reference;
pub mod setup;
pub mod traverse;
pub mod vertex;

pub mod codec;
pub mod hierarchical;
pub mod rop;
