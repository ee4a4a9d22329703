//! Notes on the blocks of a frame that only a machine can make: where quads are rejected, where lines miss, when a block is drawn. They are made
//! if a user asks for maps, and change nothing that is counted.

use super::PassState;
use num::Cycle;
use work::{QUAD_SHADED, TileWork};

/// Notes of one block of 8x8 pixels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct BlockNotes {
    /// Quads that hierarchical Z rejects.
    pub hierarchical: u32,
    /// Quads that the early depth and stencil test rejects.
    pub early: u32,
    /// Lines that the shaders of its quads ask for, and that miss the first cache.
    pub misses: u32,
    /// The cycle of the run in which quads of it reached a colour unit last; 0: none did.
    pub drawn: Cycle,
}

/// Notes of the blocks of a pass.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct PassNotes {
    /// Number of the pass in its frame.
    pub pass: u32,
    /// Blocks across.
    pub across: u32,
    /// Its blocks, row by row.
    pub blocks: Vec<BlockNotes>,
    /// Its number on the machine.
    number: u32,
}

/// Notes of the passes of a run, in their order.
pub type Notes = Vec<PassNotes>;

/// Notes something of a block of a pass.
#[cold]
#[inline(never)]
pub(crate) fn note(notes: &mut Notes, pass: Option<&PassState>, block: u32, what: impl FnOnce(&mut BlockNotes)) {
    let Some(state) = pass else { return };
    let place = match notes.binary_search_by_key(&state.number, |known| known.number) {
        Ok(place) => place,
        Err(place) => {
            let blocks = vec![BlockNotes::default(); state.blocks];
            let own = PassNotes { pass: state.pass.number, across: state.blocks_across, blocks, number: state.number };
            notes.insert(place, own);
            place
        }
    };
    if let Some(block) = notes[place].blocks.get_mut(block as usize) {
        what(block);
    }
}

/// The block that a request of a screen tile is made for, in a pass that is `across` blocks wide.
pub(crate) fn block_of(tile: &TileWork, request: u32, across: u32) -> Option<u32> {
    // Requests of a quad lie together.
    let own = tile.quads.iter().enumerate().filter(|(_, quad)| quad.flags & QUAD_SHADED != 0 && quad.first_request <= request);
    let (quad, _) = own.max_by_key(|(at, quad)| (quad.first_request, *at))?;
    let after = tile.blocks.partition_point(|block| block.first_quad as usize <= quad);
    let block = tile.blocks.get(after.checked_sub(1)?)?;
    Some(u32::from(block.y) * across + u32::from(block.x))
}
