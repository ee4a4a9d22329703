//! Floor 1: WHAT a graphics card computes, as pure functions. No cycle, no thread, no file.
//!
//! ```
//! use gfx::setup::{DepthBias, ScreenVertex, SetupState, triangle};
//! use gfx::state::{CullMode, FrontFace, Rect, Viewport};
//! use gfx::traverse::blocks;
//!
//! let view = Viewport { x: 0.0, y: 0.0, width: 16.0, height: 16.0, min_depth: 0.0, max_depth: 1.0 };
//! let scissor = Rect { x: 0, y: 0, width: 16, height: 16 };
//! let state = SetupState::new((16, 16), &view, scissor, FrontFace::Ccw, CullMode::None, 1, DepthBias::NONE);
//! let vertex = |x, y| ScreenVertex { x: num::snap(x), y: num::snap(y), z: 0.5, inv_w: 1.0 };
//! let [a, b, c, d] = [vertex(0.0, 0.0), vertex(16.0, 0.0), vertex(0.0, 16.0), vertex(16.0, 16.0)];
//!
//! // The two triangles of a square cover each of its pixels once.
//! let mut pixels = 0;
//! for corners in [[a, b, c], [b, d, c]] {
//!     let primitive = triangle(&state, &corners).expect("the triangle covers samples");
//!     blocks::<1>(&primitive, primitive.bounds, |block| pixels += block.pixels().count_ones());
//! }
//! assert_eq!(pixels, 16 * 16);
//! ```

pub mod format;
pub mod image;
pub mod simd;
pub mod stage;
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
