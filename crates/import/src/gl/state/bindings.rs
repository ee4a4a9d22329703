//! Names of objects in bindings.

use crate::gl::call::Fault;

/// The name in bindings to objects that are deleted in another context, or while they are attached to a frame buffer object that is not bound. OpenGL
/// keeps such objects as long as something needs them; here their use is refused.
pub const GONE: u32 = u32::MAX;

/// Replaces a name in bindings by [`GONE`].
pub fn lose<'a>(bindings: impl IntoIterator<Item = &'a mut u32>, name: u32) {
    bindings.into_iter().filter(|bound| **bound == name).for_each(|bound| *bound = GONE);
}

/// The fault of a binding whose object is missing.
pub fn missing(name: u32, fault: Fault) -> Fault {
    match name {
        GONE => Fault::Unsupported(
            "objects that are deleted while they are bound in another context, or attached to a frame buffer object that is not bound".into(),
        ),
        _ => fault,
    }
}
