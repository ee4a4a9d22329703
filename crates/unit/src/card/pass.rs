//! The pass that is being drawn.

use std::sync::Arc;

use super::super::stamps::PassOrder;
use gfx::hierarchical::may_raise_lower;
use gfx::rop::DepthStencilState;
use work::{Pass, Signature};

/// How the depth attachment starts a pass.
#[derive(Clone, Copy, Debug)]
pub struct DepthStart {
    /// New bounds for all blocks, as ordered keys; none: those of the pass before still hold.
    pub bounds: Option<(u32, u32)>,
    /// The last pass that had new ones, and which: a pipeline of which nothing was drawn in that pass begins with these.
    pub began: (u32, (u32, u32)),
}

/// The pass that is being drawn, as pipelines need it.
#[derive(Clone, Debug)]
pub struct PassState {
    /// Number of the pass on this machine, from 0.
    pub number: u32,
    /// How the depth attachment starts, if there is one.
    pub depth_start: Option<DepthStart>,
    /// Blocks of the pass's area.
    pub blocks: usize,
    /// The pass.
    pub pass: Arc<Pass>,
    /// Index in the frame of each colour attachment.
    pub color: Vec<Option<usize>>,
    /// Index in the frame of the depth attachment.
    pub depth: Option<usize>,
    /// Blocks across the pass's area.
    pub blocks_across: u32,
    /// Primitives of the pass, where they are known before it is drawn.
    pub primitives: u64,
    /// Where pipelines have copies, of what kind its draws are.
    pub order: PassOrder,
    /// The pass's signature without its draws, where tiles are looked for that are in memory already and this pass's may be.
    pub signature: Option<Signature>,
    /// Whether a draw of it up to now may have raised depths, and lowered them.
    pub raised: bool,
    /// See `raised`.
    pub lowered: bool,
}

impl PassState {
    /// Notes which way a draw can move depths, and gives the test that its quads may have ahead, against a depth that was stored before
    /// by something that comes earlier in API order.
    pub(super) fn ahead(&mut self, early: bool, depth: &DepthStencilState) -> Option<DepthStencilState> {
        if depth.writes_depth() {
            let (raises, lowers) = may_raise_lower(depth.compare());
            self.raised |= raises;
            self.lowered |= lowers;
        }
        // Where the shader comes first it may change depths and coverage; where stencil values are written, failures count.
        if !early || depth.writes_stencil() {
            return None;
        }
        let ahead = depth.ahead(!self.raised, !self.lowered)?;
        // Only the owner knows what the stencil test throws away, and thus which depths are written.
        Some(if depth.uses_stencil() { ahead.read_only() } else { ahead })
    }
}
