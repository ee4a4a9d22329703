//! The state that a sort class adds to the card.

use super::frame::FrameBuffers;

/// The state that a sort class adds to the card: what pipelines have of a pass for themselves, and what else the class asks of all units. So no
/// unit knows its class. By default pipelines share the machine's surfaces.
#[derive(Clone, Default)]
pub struct ClassState {
    /// Where pipelines draw apart from each other, each one's copies of the pass's attachments, by the same index; else none.
    pub copies: Vec<FrameBuffers>,
    /// Where pipelines test ahead of the owners of their pixels against what they have drawn themselves, each one's copy of the pass's
    /// depths, by the same index; else none.
    pub seen: Vec<FrameBuffers>,
    /// Whether each of these pipelines has one run of a pass's primitives, so that copies that are blended can be put over each other.
    pub chunks: bool,
    /// Whether copies are composed without the numbers of primitives.
    pub unnumbered: bool,
    /// Whether there is rendering elimination: tiles that are in memory already are not drawn.
    pub same_tiles: bool,
}
