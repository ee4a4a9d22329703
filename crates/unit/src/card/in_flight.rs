//! Work in flight: draws' segments, their quads, workgroups.

use std::sync::Arc;

use super::super::stamps::Marks;
use gfx::format::Format;
use gfx::rop::{ColorState, DepthStencilState};
use work::{Dispatch, Draw, Groups, Segment, Target, Triangle, Visit};

/// A draw's segment in flight.
#[derive(Clone, Debug)]
pub struct Work {
    /// The segment.
    pub segment: Arc<Segment>,
    /// Its draw.
    pub draw: Arc<Draw>,
    /// Fragments of this draw are tested before shading.
    pub early: bool,
    /// Number of the draw on this machine, from 0: segments of one draw share it.
    pub draw_number: u32,
    /// Number of the segment on this machine, from 0.
    pub number: u32,
    /// The slot of its pass.
    pub pass: u8,
    /// The card's epoch when it began.
    pub epoch: u32,
    /// Quads may reach the ROP out of order once all sequence numbers before this one have ended. None: each quad waits for all numbers before
    /// its own.
    pub order_from: Option<u32>,
    /// For each of the segment's tiles its owner; empty where a tile has several.
    pub owners: Vec<u8>,
    /// Which of the segment's primitives go to all pipelines, each of which draws its own tiles of them; empty if none do.
    pub shared: Vec<bool>,
    /// Depth and stencil tests, if the draw has any.
    pub depth: Option<DepthStencilState>,
    /// Format of the stored depths; that of no depth where there are none.
    pub depth_format: Format,
    /// The depth test that its quads may have ahead of that at the ROP, if there is one that is safe.
    pub ahead: Option<DepthStencilState>,
    /// For each colour target of the draw how it is written.
    pub colors: Vec<Option<ColorState>>,
    /// The colour targets that the draw writes, in their order.
    pub outputs: Vec<Output>,
    /// The marks that its quads leave in the stamps of a copy, if pipelines have copies.
    pub marks: Marks,
}

impl Work {
    /// Whether a primitive goes to all pipelines, each of which draws its own tiles of it.
    #[inline(always)]
    pub fn is_shared(&self, primitive: u32) -> bool {
        self.shared.get(primitive as usize).is_some_and(|&shared| shared)
    }

    /// Whether a primitive of the segment goes to all pipelines. If so, the vertices of the whole segment are counted where it is dealt.
    #[inline(always)]
    pub fn has_shared(&self) -> bool {
        !self.shared.is_empty()
    }

    /// The visits of a triangle.
    #[inline(always)]
    pub fn visits(&self, triangle: &Triangle) -> &[Visit] {
        &self.segment.visits[triangle.first_visit as usize..][..triangle.visits as usize]
    }
}

/// A colour target that a draw writes.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    /// Index of its surface in the frame.
    pub surface: usize,
    /// How it is written.
    pub state: ColorState,
    /// Whether the stored colours are needed ([`ColorState::reads`]).
    pub reads: bool,
    /// Whether the stored colours are combined with new ones ([`ColorState::combines`]).
    pub combines: bool,
    /// Where its colours are in a quad's payload.
    pub payload: u8,
    /// The words of a fragment, as [`Target::words`].
    pub words: u8,
    /// Whether these are stored texels, as [`Target::packed`].
    pub packed: bool,
    /// The second source colour, as [`Target::second`].
    pub second: Option<u8>,
}

impl Output {
    /// A target, unless nothing is ever written to it.
    pub(super) fn new(state: Option<&ColorState>, target: Option<&Target>, surface: Option<usize>) -> Option<Output> {
        let (&state, &Target { payload, words, packed, second, .. }, surface) = (state?, target?, surface?);
        let payload = payload.filter(|_| !state.is_idle())?;
        Some(Output { surface, state, reads: state.reads(), combines: state.combines(), payload, words, packed, second })
    }
}

/// The result of a block's test, as far as it is known before the test is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Ahead {
    /// Nothing.
    #[default]
    Nothing,
    /// All samples pass, and none is written.
    Passes,
    /// All samples pass and are written: what was there before need not be known.
    Writes,
}

/// Up to four quads of one block of one triangle, on their way through a pipeline.
#[derive(Clone, Copy, Debug, Default)]
pub struct Group {
    /// Slot of the segment.
    pub slot: u16,
    /// Number of quads.
    pub count: u8,
    /// The triangle in its segment.
    pub triangle: u32,
    /// The tile in the segment's tiles.
    pub tile: u32,
    /// The first quad in the tile's quads.
    pub first: u32,
    /// The block on the surface, numbered row by row.
    pub block: u32,
    /// For each quad the samples still alive.
    pub live: [u16; 4],
    /// The result of the early test, as far as hierarchical Z knows it.
    pub ahead: Ahead,
}

/// A dispatch's workgroups in flight.
#[derive(Clone, Debug)]
pub struct ComputeWork {
    /// The dispatch.
    pub dispatch: Arc<Dispatch>,
    /// The groups.
    pub groups: Arc<Groups>,
    /// The card's epoch when they began.
    pub epoch: u32,
}
