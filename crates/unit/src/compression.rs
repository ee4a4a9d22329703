//! The memory that a block takes.

use super::frame::{BlockState, Store};
use gfx::codec;

knob::choices! {
    /// How a block is compressed.
    pub enum Codec {
        /// Planes of depth and neighbours of colour: in whole memory lines, without loss.
        Planes "planes",
        /// Lower bits behind the block's least or greatest code; codes of 32 bits only.
        References "references",
        /// The same, but not to three quarters of the size: a quarter, half, or raw.
        HalfReferences "half-references",
    }
}

/// How blocks of a surface are compressed as they leave a ROP cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Compression {
    /// Whether blocks are compressed.
    pub enabled: bool,
    /// The codec with which they are compressed.
    pub codec: Codec,
    /// Whether a block that is stored raw is compressed when it is written again.
    pub again: bool,
}

impl Compression {
    /// Bytes that a block will take when it is written: whole memory lines, at most its raw size.
    pub fn bytes(self, store: &Store, block: u32) -> u32 {
        let full = store.block_bytes();
        let raw = |state| matches!(state, BlockState::Stored(bytes) | BlockState::Shared(bytes) if u32::from(bytes) == full);
        if !self.enabled || !self.again && raw(store.blocks[block as usize]) {
            return full;
        }
        let (format, samples, codes) = (store.surface.format, store.surface.samples as usize, store.block(block));
        let bytes = match self.codec {
            Codec::Planes => codec::stored_bytes(format, samples, codes),
            Codec::References => codec::stored_bytes_by_references(format, samples, codes, full),
            Codec::HalfReferences => codec::stored_bytes_by_references(format, samples, codes, full / 2),
        };
        bytes.min(full)
    }
}
