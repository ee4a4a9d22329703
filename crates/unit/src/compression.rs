//! What a block takes in memory.

use super::frame::Store;
use gfx::codec;

/// How blocks of a surface are compressed as they leave a ROP cache.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Compression {
    /// Whether they are.
    pub enabled: bool,
}

impl Compression {
    /// Bytes that a block takes: whole memory lines, at most its raw size.
    pub fn bytes(self, store: &Store, block: u32) -> u32 {
        let full = store.block_bytes();
        if !self.enabled {
            return full;
        }
        codec::stored_bytes(store.surface.format, store.surface.samples as usize, store.block(block)).min(full)
    }
}
