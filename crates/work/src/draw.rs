//! Draws: what all segments of one have in common.

use std::sync::Arc;

use crate::{Reach, Signature};
use gfx::stage::{Stage, StageMap};
use gfx::state::{Blend, DepthStencil, LogicOp, StepMode};
use num::CallSite;

/// Shading of a colour target, as the ROPs need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Blending; none replaces.
    pub blend: Option<Blend>,
    /// Logic operation on stored texels, which the payload has.
    pub logic: Option<LogicOp>,
    /// Channels written.
    pub write_mask: u8,
    /// First entry of this target's colours in a quad's payload (depths counted), or none where the fragment stage writes nothing to
    /// it. Word `w` of pixel `p` is entry `4 w + p` from there.
    pub payload: Option<u8>,
    /// Words per fragment: 4 (bits for `gfx::texel::encode`, before blending), or fewer where `packed`.
    pub words: u8,
    /// The payload holds stored texels (1 word for up to 4 bytes, 2 for 8, 4 for 16), not values: nothing is left to blend.
    pub packed: bool,
    /// First entry of the second source colour in a quad's payload (dual-source blending; 4 words per fragment).
    pub second: Option<u8>,
}

impl Target {
    /// Whether colours are combined with what is stored.
    pub fn combines(&self) -> bool {
        self.blend.is_some() || self.logic.is_some_and(LogicOp::reads)
    }
}

/// Where an attribute comes from in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttributeFetch {
    /// Address of the attribute of vertex (or instance) 0.
    pub address: u64,
    /// Bytes from one vertex to the next.
    pub stride: u64,
    /// What advances it.
    pub step: StepMode,
    /// Bytes read.
    pub bytes: u32,
}

/// What a shader asks of a core, apart from its instructions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShaderShape {
    /// 32-bit registers per invocation, which bound the warps in flight.
    pub registers: u32,
    /// 32-bit words in: attributes of a vertex, or interpolated varyings of a fragment.
    pub inputs: u32,
    /// 32-bit words out.
    pub outputs: u32,
}

/// A draw call, shared by its segments.
#[derive(Clone, Debug)]
pub struct Draw {
    /// Number in its frame, from 0.
    pub number: u32,
    /// Where the command that draws was made.
    pub site: CallSite,
    /// Labels of the debug groups that the draw is in, the outermost first.
    pub groups: DebugPath,
    /// The state that it is drawn with.
    pub state: Arc<RecordedState>,
    /// Where attributes come from.
    pub attributes: Vec<AttributeFetch>,
    /// Signature of all that its pixels depend on beside attachments and primitives; none: not asked for, or there is more to the draw
    /// than pixels.
    pub signature: Option<Signature>,
    /// What of it was left out by bounds.
    pub culling: Culling,
    /// Memory that it may touch beside the attachments of its pass.
    pub reach: Arc<Reach>,
}

/// The labels of debug groups inside each other, the outermost first.
pub type DebugPath = Arc<[Arc<str>]>;

impl Draw {
    /// The label of the innermost debug group that the draw is in, or empty.
    pub fn group(&self) -> &str {
        self.groups.last().map_or("", |label| label)
    }
}

impl std::ops::Deref for Draw {
    type Target = RecordedState;

    #[inline(always)]
    fn deref(&self) -> &RecordedState {
        &self.state
    }
}

/// The state of a draw. Draws that follow each other mostly share it.
#[derive(Clone, Debug)]
pub struct RecordedState {
    /// Number of the state in its pass. Of two draws of a pass that follow each other, the second has the same number if no command between
    /// them has changed the pipeline, the viewport, the scissor rectangle, the blend constant or a stencil reference.
    pub number: u32,
    /// Label of the pipeline, or empty.
    pub label: String,
    /// The stages that run. Without a fragment stage, depth and stencil are all that is drawn.
    pub shapes: StageMap<Option<ShaderShape>>,
    /// Depth and stencil state, if the pass has such an attachment and the draw uses it.
    pub depth_stencil: Option<DepthStencil>,
    /// Stencil references of front and back faces.
    pub stencil_references: [u8; 2],
    /// Colour targets by location; none: nothing is written.
    pub targets: Vec<Option<Target>>,
    /// Blend constant.
    pub blend_constant: [f32; 4],
    /// The words of a quad's payload for depth: 4 times the samples if the fragment stage writes depth, else 0 and the plane counts.
    /// They come first; sample `s` of pixel `p` is word `4 s + p`.
    pub depth_words: u8,
    /// Words of payload of a shaded quad in all; word `4 w + p` after the depth words is word `w` of pixel `p`.
    pub payload_words: u8,
    /// Depth and stencil are tested and written before shading (nothing in the fragment stage can change them).
    pub early: bool,
    /// Hierarchical Z may cull: the fragment stage does not write depth, and culling loses no side effect, query or change of the stencil.
    pub hierarchical_z: bool,
    /// Viewport's depth range, to which depth is clamped.
    pub depth_range: [f32; 2],
}

impl RecordedState {
    /// Whether fragments are shaded.
    #[inline(always)]
    pub fn shades(&self) -> bool {
        self.shapes[Stage::Fragment].is_some()
    }

    /// The shape of a stage; zeros for a stage that does not run.
    #[inline(always)]
    pub fn shape(&self, stage: Stage) -> ShaderShape {
        self.shapes[stage].unwrap_or_default()
    }
}

/// What tests of bounds against the view volume came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Culling {
    /// Tests of the draw and of its instances.
    pub tests: u64,
    /// Whole draws left out: 1 or none.
    pub draws: u64,
    /// Instances left out, those of a whole draw included.
    pub instances: u64,
    /// Their primitives.
    pub primitives: u64,
    /// Their indices (or vertices, of draws without indices).
    pub vertices: u64,
}
