//! What the work of a trace depends on beside the trace: the render key.

use serde::{Deserialize, Serialize};

use crate::PrimitiveOutcome;

/// What of a render the work depends on, beside the trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderKey {
    /// Whether depth and stencil may be tested before shading where that cannot change the result.
    pub early_z: bool,
    /// Which quads' costs are recorded.
    pub shade: Shade,
    /// Whether draws and primitives are signed.
    pub signatures: bool,
    /// Whether costs have the path that was taken through the program, for machines that execute it instruction by instruction.
    pub paths: bool,
    /// Whether costs count instructions that work on up to four components at once, instead of those that work on one.
    pub vectors: bool,
    /// Work that changes no picture and is recorded all the same.
    pub needless: CulledLate,
    /// What is left out where its bounds lie outside the view volume.
    pub cull: Cull,
}

/// Work that changes no picture, which a card leaves out where it finds out in time. Recorded for machines that do not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct CulledLate {
    /// Triangles that face away, which setup finds out.
    pub facing: bool,
    /// Primitives outside the view volume, which setup finds out, or cutting them.
    pub frustum: bool,
    /// Primitives outside the scissor rectangle, which traversal finds out.
    pub scissor: bool,
    /// Primitives without area, which setup finds out, or without a covered sample, which traversal does.
    pub no_sample: bool,
    /// Attributes of vertex buffers that the vertex stage does not read.
    pub attributes: bool,
    /// What the vertex stage writes and the fragment stage does not read.
    pub varyings: bool,
    /// Texels of the second of two levels where all of a sample comes from the first.
    pub levels: bool,
}

impl CulledLate {
    /// Nothing of it.
    pub const NONE: CulledLate = CulledLate {
        facing: false,
        frustum: false,
        scissor: false,
        no_sample: false,
        attributes: false,
        varyings: false,
        levels: false,
    };

    /// Whether primitives are recorded that end so.
    pub fn keeps(&self, outcome: PrimitiveOutcome) -> bool {
        match outcome {
            PrimitiveOutcome::Drawn => false,
            PrimitiveOutcome::Degenerate | PrimitiveOutcome::NoSample => self.no_sample,
            PrimitiveOutcome::Backface => self.facing,
            PrimitiveOutcome::Frustum => self.frustum,
            PrimitiveOutcome::Scissor => self.scissor,
        }
    }
}

/// What is left out by bounds, before anything is done with its vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Cull {
    /// Nothing.
    #[default]
    None,
    /// Whole draws.
    Draws,
    /// Whole draws, and instances of the others.
    Instances,
}

/// 128 bits of what something depends on: where they are equal, so is the result.
pub type Signature = u128;

impl Default for RenderKey {
    fn default() -> Self {
        RenderKey {
            early_z: true,
            shade: Shade::Visible,
            signatures: false,
            paths: false,
            vectors: false,
            needless: CulledLate::NONE,
            cull: Cull::None,
        }
    }
}

/// Which quads' shading costs and colours are recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Shade {
    /// Those that early depth and stencil tests in API order let through.
    Visible,
    /// Every covered quad, for machines whose early tests cannot see all earlier depth.
    Covered,
}
