//! State that commands set inside passes and bundles.

use gfx::state::{IndexFormat, Rect};
use num::{BindGroupId, BufferId};
use trace::command::SPRITES;

use super::draw::DynamicState;

/// The largest number of bind groups that a pipeline can use (wgpu's native limit).
pub const MAX_BIND_GROUPS: usize = 8;

/// Vertex buffer slots, at most.
pub const MAX_VERTEX_BUFFERS: usize = 32;

/// Bytes of immediates, at most.
pub const MAX_IMMEDIATES: usize = 4096;

/// A bind group and its dynamic offsets.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BoundGroup {
    /// The group.
    pub group: BindGroupId,
    /// One offset for each dynamic binding, in order of binding.
    pub offsets: Vec<u32>,
}

/// A bound vertex buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexSlot {
    /// The buffer.
    pub buffer: BufferId,
    /// First byte.
    pub offset: u64,
    /// Bytes.
    pub size: u64,
}

/// A bound index buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct IndexSlot {
    /// The buffer.
    pub buffer: BufferId,
    /// Width of an index.
    pub format: IndexFormat,
    /// First byte.
    pub offset: u64,
    /// Bytes.
    pub size: u64,
}

/// The bindings that render and compute passes have in common.
#[derive(Clone, Debug, Default)]
pub struct Bindings {
    /// Bind groups by index.
    pub groups: [Option<BoundGroup>; MAX_BIND_GROUPS],
    /// Immediate words.
    pub immediates: Vec<u32>,
}

/// A command sets state that a pass does not have.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum StateError {
    #[error("bind group index {0}, the limit is {MAX_BIND_GROUPS}")]
    BindGroupIndex(u32),
    #[error("{words} words of immediates at byte {offset}: the limit is {MAX_IMMEDIATES} bytes")]
    Immediates { words: usize, offset: u32 },
    #[error("vertex buffer slot {0}, the limit is {MAX_VERTEX_BUFFERS}")]
    VertexBufferSlot(u32),
    #[error("scissor {rect:?} reaches outside the {width} x {height} attachments")]
    Scissor { rect: Rect, width: u32, height: u32 },
    #[error("sprite {0}: a display has {SPRITES}")]
    Sprite(u32),
    #[error("attachments of {second:?} and {first:?} pixels and samples in one pass")]
    Extents { first: Option<(u32, u32, u32)>, second: (u32, u32, u32) },
    #[error("a render pass without attachments")]
    NoAttachments,
    #[error("a 3D attachment without a depth slice")]
    NoSlice,
    #[error("slice {slice} of texture {texture} is not there")]
    Slice { slice: u32, texture: u32 },
    #[error("an attachment of {levels} levels and {layers} layers")]
    AttachmentParts { levels: u32, layers: u32 },
    #[error("{name} is not possible {scope}")]
    WrongScope { name: &'static str, scope: &'static str },
    #[error("{0} is about no object")]
    NoObject(&'static str),
    #[error("a draw without a pipeline")]
    DrawWithoutPipeline,
    #[error("a dispatch without a pipeline")]
    DispatchWithoutPipeline,
    #[error("an indexed draw without an index buffer")]
    NoIndexBuffer,
    #[error("{count} indirect draws at byte {offset} reach beyond the {bytes} bytes of buffer {buffer}")]
    IndirectDraws { count: u32, offset: u64, bytes: u64, buffer: u32 },
    #[error("a draw count at byte {offset} of the {bytes} of buffer {buffer}")]
    DrawCount { offset: u64, bytes: u64, buffer: u32 },
    #[error("an indirect dispatch at byte {offset} of the {bytes} of buffer {buffer}")]
    IndirectDispatch { offset: u64, bytes: u64, buffer: u32 },
    #[error("an occlusion query in a pass without an occlusion query set")]
    OcclusionWithoutSet,
    #[error("no occlusion query set")]
    NoOcclusionSet,
    #[error("no occlusion query is open")]
    NoOcclusionQuery,
    #[error("no pipeline statistics query is open")]
    NoStatisticsQuery,
    #[error("the pass ends inside a query")]
    OpenQuery,
    #[error("the trace ends inside a pass or bundle")]
    OpenScope,
}

impl Bindings {
    /// Sets or clears a group.
    ///
    /// # Errors
    /// If the index is beyond [`MAX_BIND_GROUPS`].
    pub fn set(&mut self, index: u32, group: Option<BindGroupId>, offsets: &[u32]) -> Result<(), StateError> {
        let slot = self.groups.get_mut(index as usize).ok_or(StateError::BindGroupIndex(index))?;
        match (slot, group) {
            // The room of the offsets is used again: a program may set a group for each draw.
            (Some(bound), Some(group)) => {
                bound.group = group;
                bound.offsets.clear();
                bound.offsets.extend_from_slice(offsets);
            }
            (slot, group) => *slot = group.map(|group| BoundGroup { group, offsets: offsets.to_vec() }),
        }
        Ok(())
    }

    /// Sets immediate words from a byte offset.
    ///
    /// # Errors
    /// If the offset is not a multiple of 4 or the range exceeds [`MAX_IMMEDIATES`].
    pub fn set_immediates(&mut self, offset: u32, words: &[u32]) -> Result<(), StateError> {
        let first = offset as usize / 4;
        if !offset.is_multiple_of(4) || (first + words.len()) * 4 > MAX_IMMEDIATES {
            return Err(StateError::Immediates { words: words.len(), offset });
        }
        if self.immediates.len() < first + words.len() {
            self.immediates.resize(first + words.len(), 0);
        }
        self.immediates[first..first + words.len()].copy_from_slice(words);
        Ok(())
    }
}

/// State that the commands of a render pass set.
#[derive(Clone, Debug)]
pub struct PassState {
    /// The pipeline.
    pub pipeline: Option<u32>,
    /// Bind groups and immediates.
    pub bindings: Bindings,
    /// Vertex buffers by slot.
    pub vertex: Vec<Option<VertexSlot>>,
    /// Index buffer.
    pub index: Option<IndexSlot>,
    /// Viewport, scissor rectangle, blend constant, stencil reference.
    pub dynamic: DynamicState,
}

impl PassState {
    /// The state at the beginning of a pass of this many pixels.
    pub fn new(width: u32, height: u32) -> PassState {
        PassState {
            pipeline: None,
            bindings: Bindings::default(),
            vertex: Vec::new(),
            index: None,
            dynamic: DynamicState::new(width, height),
        }
    }

    /// Forgets what a bundle sets: pipeline, bind groups, buffers.
    pub fn reset_after_bundle(&mut self) {
        self.pipeline = None;
        self.bindings = Bindings::default();
        self.vertex.clear();
        self.index = None;
    }
}
