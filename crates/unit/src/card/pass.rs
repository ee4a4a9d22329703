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

/// Passes that can be in flight at one time.
pub const PASSES: usize = 4;

/// The passes in flight, each in a slot of its own.
#[derive(Clone, Debug, Default)]
pub struct Passes {
    slots: [Option<PassState>; PASSES],
    /// The slot of the pass that began last, until it has ended.
    last: Option<u8>,
}

impl Passes {
    /// Whether another pass can begin.
    pub fn has_room(&self) -> bool {
        self.slots.iter().any(Option::is_none)
    }

    /// Begins a pass; gives its slot.
    ///
    /// # Panics
    /// If there is no room.
    pub fn begin(&mut self, pass: PassState) -> u8 {
        let slot = self.slots.iter().position(Option::is_none).expect("a pass begins when there is room");
        self.slots[slot] = Some(pass);
        self.last = Some(slot as u8);
        slot as u8
    }

    /// Ends the pass in a slot.
    pub fn end(&mut self, slot: u8) {
        self.slots[usize::from(slot)] = None;
        self.last = self.last.filter(|&last| last != slot);
    }

    /// The pass in a slot.
    #[inline(always)]
    pub fn get(&self, slot: u8) -> Option<&PassState> {
        self.slots[usize::from(slot)].as_ref()
    }

    /// The slot of the pass that began last, until it has ended.
    #[inline(always)]
    pub fn last(&self) -> Option<u8> {
        self.last
    }

    /// The pass that began last, until it has ended. Units of machines on which no two passes overlap read it; the others read the pass of
    /// their token's segment.
    #[inline(always)]
    pub fn current(&self) -> Option<&PassState> {
        self.last.and_then(|slot| self.get(slot))
    }

    /// See [`Passes::current`].
    pub fn current_mut(&mut self) -> Option<&mut PassState> {
        self.last.and_then(|slot| self.slots[usize::from(slot)].as_mut())
    }
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
    /// If pipelines have copies, the kind of its draws.
    pub order: PassOrder,
    /// The pass's signature without its draws, where tiles are looked for that are in memory already and this pass's may be.
    pub signature: Option<Signature>,
    /// Whether a draw of the pass up to now may have raised depths.
    pub raised: bool,
    /// Whether a draw of the pass up to now may have lowered depths.
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
