//! Calls without an effect on pictures.

use crate::gl::call::{Call, GlResult, Shape};
use crate::gl::machine::Gl;

/// Does nothing.
pub fn nothing(_: &mut Gl, _: &Call, _: Shape) -> GlResult {
    Ok(())
}
