//! The lists of tiles, where triangles are binned.

/// A triangle in a tile's list.
#[derive(Clone, Copy, Debug)]
pub struct TileEntry {
    /// Slot of its segment.
    pub slot: u16,
    /// Bytes of the entry in memory.
    pub bytes: u8,
    /// The triangle in its segment.
    pub triangle: u32,
    /// Where in memory the triangle is kept.
    pub address: u64,
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
    /// Bytes read of it and its triangles.
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
