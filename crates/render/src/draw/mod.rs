//! Draws: from vertices to attachments, in parallel over batches of vertices, of primitives, and over screen tiles.
//!
//! A draw is cut into segments of whole primitives ([`plan`]), so that memory is bounded. Each goes through four stages with all
//! threads in each: the stream of vertices ([`stream`]), vertex shading ([`vertex`]), assembly to setup and sorting into tiles
//! ([`primitive`], [`batch`]), and the tiles ([`tile`]), each of which one thread takes through traversal, tests, shading and blending with
//! every primitive of the segment in API order. The first three are the geometry half of a segment ([`geometry`]), the last is its fragment half
//! ([`fragments`]). What a thread computes never depends on which thread it is.

mod areas;
mod batch;
mod clip_distance;
mod cull;
mod early;
mod fragments;
mod geometry;
mod late;
mod needless;
mod pass;
mod pending;
mod plan;
mod primitive;
mod record;
mod shade;
mod signature;
mod small;
mod state;
mod stream;
mod tile;
mod vertex;
mod workers;

#[cfg(test)]
mod tests;

use std::ops::Deref;
use std::sync::{Arc, Mutex, OnceLock};

use gfx::stage::{Stage, StageMap};
use gfx::state::{IndexFormat, Rect, Viewport};
use gfx::vertex::VertexSource;
use num::{CallSite, Words};
use shader::{Program, Resources, Uniforms};
use work::{Areas, DebugPath, Extent, Funnel, Reach, RenderKey, Signature};

use super::ledger::Ledger;
use super::needs::Need;
use super::pipeline::{Attribute, PipelineStage};

pub use cull::Boxes;
pub use signature::Signer;

pub use pass::{DrawError, EndedPass, RenderPass};
pub use state::DrawState;
pub use trace::command::DrawRange;

/// A range of a buffer.
#[derive(Clone, Debug)]
pub struct BufferRange {
    /// The buffer's bytes.
    pub words: Arc<Words>,
    /// First byte.
    pub offset: u64,
    /// Bytes.
    pub size: u64,
    /// Address of the first byte of the range in the card's memory.
    pub address: u64,
    /// Counts changes of the buffer's contents.
    pub version: u64,
}

impl BufferRange {
    /// The card's memory of it. A range that is longer than the buffer ends with the buffer.
    pub fn extent(&self) -> Extent {
        Extent::new(self.address, self.words.len().saturating_sub(self.offset).min(self.size))
    }
}

/// The indices of a draw.
#[derive(Clone, Debug)]
pub struct IndexRange {
    /// Where they are.
    pub range: BufferRange,
    /// Width of an index.
    pub format: IndexFormat,
}

/// Work that the renderer leaves out where the image cannot change. Each can be switched off.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Skips {
    /// Colours of a tile that a later opaque triangle of the same segment covers whole are not computed, and counted as if they were.
    pub overwritten: bool,
    /// Blocks that lie inside of all edges of a triangle are not tested sample by sample.
    pub full_blocks: bool,
    /// A fragment program whose inputs are the same all over a triangle runs once for the triangle's whole batches in a tile.
    pub repeated: bool,
}

impl Default for Skips {
    fn default() -> Self {
        Skips { overwritten: true, full_blocks: true, repeated: true }
    }
}

impl Skips {
    /// Nothing is left out.
    pub const NONE: Skips = Skips { overwritten: false, full_blocks: false, repeated: false };
}

/// State that commands set and that draws take as it is.
#[derive(Clone, Copy, Debug)]
pub struct DynamicState {
    /// Viewport.
    pub viewport: Viewport,
    /// Scissor rectangle.
    pub scissor: Rect,
    /// Blend constant.
    pub blend_constant: [f32; 4],
    /// Stencil references of front and back faces.
    pub stencil_references: [u32; 2],
}

impl DynamicState {
    /// The state at the beginning of a pass of this many pixels.
    pub fn new(width: u32, height: u32) -> DynamicState {
        DynamicState {
            viewport: Viewport { x: 0.0, y: 0.0, width: width as f32, height: height as f32, min_depth: 0.0, max_depth: 1.0 },
            scissor: Rect { x: 0, y: 0, width, height },
            blend_constant: [0.0; 4],
            stencil_references: [0; 2],
        }
    }
}

impl PartialEq for DynamicState {
    /// Whether all bits are equal: zeros of both signs are different numbers here.
    fn eq(&self, other: &DynamicState) -> bool {
        let viewport = |Viewport { x, y, width, height, min_depth, max_depth }: Viewport| {
            [x, y, width, height, min_depth, max_depth].map(f32::to_bits)
        };
        let DynamicState { viewport: own, scissor, blend_constant, stencil_references } = *self;
        viewport(own) == viewport(other.viewport)
            && scissor == other.scissor
            && blend_constant.map(f32::to_bits) == other.blend_constant.map(f32::to_bits)
            && stencil_references == other.stencil_references
    }
}

/// The queries that are open during a draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OpenQueries {
    /// An occlusion query: samples that pass are counted.
    pub occlusion: bool,
    /// A statistics query: the program sees how many fragments the machine shades.
    pub statistics: bool,
}

/// The results that are wanted of the draws of a pass.
#[derive(Clone, Copy, Debug)]
pub struct PassOptions {
    /// The results that are needed. Without colours, fragment shaders run for coverage, depth and what they write to memory alone.
    pub need: Need,
    /// Whether areas are wanted ([`Drawn::areas`]). A survey always wants them.
    pub areas: bool,
    /// The key on which the recorded work depends.
    pub key: RenderKey,
    /// Whether work is recorded.
    pub record: bool,
    /// The work that may be left out.
    pub skips: Skips,
}

/// A stage of a draw: its program, and what all invocations read.
#[derive(Clone, Copy)]
pub struct BoundStage<'a> {
    /// The stage of the pipeline.
    pub stage: &'a PipelineStage,
    /// Resources of its program.
    pub resources: Resources<'a>,
    /// Values that its invocations share.
    pub uniforms: &'a Uniforms,
}

impl<'a> BoundStage<'a> {
    /// Binds resources to a stage. What invocations share is computed in the memory of `uniforms`.
    pub fn new(stage: &'a PipelineStage, resources: Resources<'a>, uniforms: &'a mut Uniforms) -> BoundStage<'a> {
        stage.program.uniforms_into(&resources, uniforms);
        BoundStage { stage, resources, uniforms }
    }
}

/// A draw call with everything resolved.
pub struct DrawCall<'a> {
    /// The state that it is drawn with.
    pub state: &'a DrawState,
    /// Number in its frame, from 0.
    pub number: u32,
    /// Where its command was made.
    pub site: CallSite,
    /// Labels of the debug groups that are open, the outermost first.
    pub groups: &'a DebugPath,
    /// Vertex buffers by slot.
    pub vertex_buffers: &'a [Option<BufferRange>],
    /// Indices; none: not indexed.
    pub index: Option<&'a IndexRange>,
    /// The range of vertices or indices, and of instances, that is drawn.
    pub range: DrawRange,
    /// The stages that [run](DrawState::runs).
    pub stages: StageMap<Option<BoundStage<'a>>>,
    /// Signature of what the pixels depend on beside attachments and primitives.
    pub signature: Option<Signature>,
    /// Memory that it may touch beside attachments.
    pub reach: &'a Arc<Reach>,
    /// Known ranges of buffers, for tests of bounds ahead of vertex shading. None: nothing is tested, because something counts vertices or
    /// primitives.
    pub boxes: Option<&'a Mutex<Boxes>>,
    /// Where work is counted.
    pub ledger: &'a Ledger,
}

impl Deref for DrawCall<'_> {
    type Target = DrawState;

    #[inline(always)]
    fn deref(&self) -> &DrawState {
        self.state
    }
}

impl<'a> DrawCall<'a> {
    /// The vertex stage.
    fn vertex(&self) -> &BoundStage<'a> {
        self.stages[Stage::Vertex].as_ref().expect("vertices are shaded by the vertex stage")
    }

    /// The fragment stage, where it has to run.
    #[inline(always)]
    fn fragment(&self) -> Option<&BoundStage<'a>> {
        self.stages[Stage::Fragment].as_ref()
    }

    /// The program of a stage that runs.
    fn program(&self, stage: Stage) -> Option<&'a Program> {
        self.stages[stage].as_ref().map(|bound| &bound.stage.program)
    }

    /// The first vertex; with indices, what is added to each of them.
    fn base_vertex(&self) -> u32 {
        if self.index.is_some() { self.range.base_vertex as u32 } else { self.range.first }
    }

    /// Where an attribute is read from.
    fn source(&self, attribute: &Attribute) -> VertexSource<'a> {
        static NOTHING: OnceLock<Words> = OnceLock::new();
        match self.vertex_buffers.get(attribute.buffer) {
            Some(Some(range)) => {
                VertexSource { words: &range.words, offset: range.offset, size: range.size, stride: attribute.stride }
            }
            // Robust: what is not bound reads as zeros.
            _ => {
                let nothing = NOTHING.get_or_init(Words::default);
                VertexSource { words: nothing, offset: 0, size: 0, stride: attribute.stride }
            }
        }
    }
}

/// The results of a draw beside the image.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Drawn {
    /// Samples that passed all tests.
    pub samples_passed: u64,
    /// The numbers of items that each stage threw away.
    pub funnel: Funnel,
    /// Fragments whose colours were not computed ([`Skips::overwritten`]); the funnel has them as shaded and written.
    pub overwritten: u64,
    /// The areas that primitives are expected to cover. Empty unless a survey asks for them.
    pub areas: Areas,
}

impl std::ops::AddAssign for Drawn {
    fn add_assign(&mut self, other: Drawn) {
        self.samples_passed += other.samples_passed;
        self.funnel += other.funnel;
        self.overwritten += other.overwritten;
        self.areas += other.areas;
    }
}

/// Indices, borrowed.
#[derive(Clone, Copy, Debug)]
struct IndexBuffer<'a> {
    words: &'a Words,
    offset: u64,
    size: u64,
    format: IndexFormat,
}

impl IndexRange {
    fn buffer(&self) -> IndexBuffer<'_> {
        let BufferRange { words, offset, size, .. } = &self.range;
        let size = (*size).min(words.len().saturating_sub(*offset));
        IndexBuffer { words, offset: *offset, size, format: self.format }
    }
}
