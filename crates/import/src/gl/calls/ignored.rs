//! Calls without an effect on pictures.

use crate::gl::call::{Arg, Call, Fault, GlResult, Shape};
use crate::gl::machine::Gl;

/// Does nothing.
pub fn nothing(_: &mut Gl, _: &Call, _: Shape) -> GlResult {
    Ok(())
}

/// Characters that are kept of the label of a debug group.
const LABEL_MAX: usize = 256;

/// Begins a debug group. The label is the last argument.
pub fn push_group(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let label = match call.args.last() {
        Some(Arg::Str(text)) => text.chars().take(LABEL_MAX).collect(),
        Some(Arg::Blob(bytes)) => String::from_utf8_lossy(bytes).chars().take(LABEL_MAX).collect(),
        _ => String::new(),
    };
    gl.log.enter_group(&label);
    Ok(())
}

/// Ends a debug group.
pub fn pop_group(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    gl.log.leave_group().ok_or(Fault::Error("GL_STACK_UNDERFLOW"))
}
