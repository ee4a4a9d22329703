//! The state that a sort class adds to the card.

use super::frame::FrameBuffers;

/// The state that a sort class adds to the card: what pipelines have of a pass for themselves, and what else the class asks of all units. So no
/// unit knows its class. By default pipelines share the machine's surfaces.
#[derive(Clone, Default)]
pub struct ClassState {
    /// Each pipeline's copies of the pass's attachments, by the same index, if pipelines draw apart from each other. Else empty.
    pub copies: Vec<FrameBuffers>,
    /// Each pipeline's copy of the pass's depths, by the same index, if pipelines make early tests against what they have drawn themselves,
    /// ahead of the owners of the pixels. Else empty.
    pub seen: Vec<FrameBuffers>,
    /// Whether each of these pipelines has a single run of a pass's primitives, so that blended copies can be put over each other.
    pub chunks: bool,
    /// Whether copies are composed without the numbers of primitives.
    pub unnumbered: bool,
    /// Whether the machine has rendering elimination: tiles that are in memory already are not drawn.
    pub same_tiles: bool,
}
