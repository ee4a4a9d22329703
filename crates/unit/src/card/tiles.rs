//! The lists of tiles, where triangles are binned.

use std::num::NonZeroU64;

/// A triangle in a tile's list.
#[derive(Clone, Copy, Debug)]
pub struct TileEntry {
    /// Slot of its segment.
    pub slot: u16,
    /// Bytes of the entry in memory.
    pub bytes: u8,
    /// The triangle in its segment.
    pub triangle: u32,
    /// The address of its record in memory, behind the vertices that are its own.
    pub address: u64,
}

/// The addresses at which vertices that triangles in lists share are kept in memory.
#[derive(Clone, Debug, Default)]
pub struct KeptVertices {
    /// By slot of the segment and number of the vertex.
    addresses: Vec<Vec<Option<NonZeroU64>>>,
}

impl KeptVertices {
    /// The address of a vertex, if it is kept.
    #[inline(always)]
    pub fn of(&self, slot: u16, vertex: u32) -> Option<u64> {
        self.addresses.get(usize::from(slot))?.get(vertex as usize)?.map(NonZeroU64::get)
    }

    /// Keeps a vertex at an address, which is not 0; with the vertex comes the number of vertices of its segment.
    pub fn keep(&mut self, slot: u16, (vertex, count): (u32, usize), address: u64) {
        let slot = usize::from(slot);
        if self.addresses.len() <= slot {
            self.addresses.resize_with(slot + 1, Vec::new);
        }
        let own = &mut self.addresses[slot];
        own.resize(count, None);
        own[vertex as usize] = NonZeroU64::new(address);
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.addresses.iter_mut().for_each(Vec::clear);
    }
}

/// The list of a tile. Binning writes it, and the pipeline that draws the tile reads it, from the tile's token on.
#[derive(Clone, Debug, Default)]
pub struct TileList {
    /// Its triangles in API order.
    pub entries: Vec<TileEntry>,
    /// Where its pieces are in memory.
    pub chunks: Vec<u64>,
    /// Bytes of its entries.
    pub bytes: u64,
    /// Bytes read of it, its triangles and their vertices.
    pub read_bytes: u64,
}

impl TileList {
    /// Appends an entry.
    pub fn push(&mut self, entry: TileEntry) {
        self.bytes += u64::from(entry.bytes);
        self.entries.push(entry);
    }

    /// Empties it, and keeps its room.
    pub fn clear(&mut self) {
        self.entries.clear();
        self.chunks.clear();
        (self.bytes, self.read_bytes) = (0, 0);
    }
}
