//! The contents of attachments at the end of passes, for a reader that shows them.

use std::fmt;
use std::sync::Arc;

use work::Surface;

/// An attachment as a pass leaves it, before its contents are discarded.
#[derive(Clone, Debug)]
pub struct PassTarget {
    /// Number of the pass in the trace.
    pub pass: u32,
    /// Location of a colour attachment. None for depth and stencil.
    pub location: Option<u32>,
    /// Whether any of its contents are kept after the pass.
    pub kept: bool,
    /// The surface, in the format in which it is drawn. Of samples that are resolved, the one that they are resolved to.
    pub surface: Surface,
    /// Its bytes, laid out as in [`work::Contents`].
    pub bytes: Vec<u8>,
}

/// Reads attachments as passes end.
#[derive(Clone)]
pub struct TargetReader(Arc<dyn Fn(PassTarget) + Send + Sync>);

impl TargetReader {
    /// A reader that calls `read` on the renderer's thread, for each attachment that a pass may write, in the order of the trace.
    pub fn new(read: impl Fn(PassTarget) + Send + Sync + 'static) -> TargetReader {
        TargetReader(Arc::new(read))
    }

    /// Hands an attachment on.
    pub(super) fn read(&self, target: PassTarget) {
        (self.0)(target);
    }
}

impl fmt::Debug for TargetReader {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        out.write_str("TargetReader")
    }
}
