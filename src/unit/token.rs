//! What travels between units: small plain structs of indices into the work that the [`Card`](super::Card) holds.

use bytemuck::{Pod, Zeroable};

/// What a token is: data, or one of the marks that travel in order with the data.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(transparent)]
pub struct Kind(pub u16);

impl Kind {
    /// Data.
    pub const DATA: Kind = Kind(0);
    /// The end of a sequence number: nothing more of it follows on this channel.
    pub const END: Kind = Kind(1);
    /// The end of a segment: when all pipelines have seen it, its slot is free.
    pub const SEGMENT: Kind = Kind(2);
    /// The end of a pass: caches are written back.
    pub const PASS: Kind = Kind(3);

    /// Whether all pipelines must see it.
    #[inline(always)]
    pub fn is_fence(self) -> bool {
        self.0 >= Kind::SEGMENT.0
    }
}

/// A segment for the geometry front, or a fence.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Piece {
    /// Slot of the segment.
    pub slot: u16,
    /// Data or fence.
    pub kind: Kind,
}

/// A batch of vertices whose indices have been read, or a fence.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct VertexBatch {
    /// Slot of the segment.
    pub slot: u16,
    /// Data or fence.
    pub kind: Kind,
    /// Running number of the batch; primitives wait until it is shaded.
    pub number: u32,
    /// Entries of the segment's stream that are read once this batch is shaded.
    pub stream_end: u32,
    /// Vertices in it; a batch without any needs no shading.
    pub vertices: u32,
}

/// A run of primitives, of triangles, or a mark.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Run {
    /// Slot of the segment.
    pub slot: u16,
    /// Data, end of sequence number, or fence.
    pub kind: Kind,
    /// Sequence number, by which rasterisers restore API order.
    pub sequence: u32,
    /// First of the run.
    pub first: u32,
    /// How many.
    pub count: u32,
}

/// A triangle for one rasteriser, or a mark.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TriangleToken {
    /// Slot of the segment.
    pub slot: u16,
    /// Data, end of sequence number, or fence.
    pub kind: Kind,
    /// Sequence number.
    pub sequence: u32,
    /// Its index in the segment.
    pub triangle: u32,
}

/// A group of up to four quads of one block, or a mark.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct GroupToken {
    /// Index in the groups of `pool`; of a fence, the slot.
    pub group: u32,
    /// Up to the ROP the sequence number of its primitives; from there its place in the ROP's order.
    pub sequence: u32,
    /// Data, end of sequence number, or fence.
    pub kind: Kind,
    /// Quads alive.
    pub quads: u8,
    /// The pipeline whose ROP owns its pixels, and in whose groups it lies.
    pub pool: u8,
}

/// New bounds of a block's depths for the hierarchical Z buffer.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct DepthBounds {
    /// Number of the block on the surface.
    pub block: u32,
    /// Smallest depth, as an ordered key.
    pub min: u32,
    /// Largest depth.
    pub max: u32,
    /// The pass in which they were found.
    pub pass: u32,
}

/// A warp on its way between its maker, a core and a texture unit.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct WarpToken {
    /// Index in the cluster's warps.
    pub warp: u32,
}

/// A fence that has arrived, reported to the command processor.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Ack {
    /// Slot of the fence.
    pub slot: u16,
    /// Which fence.
    pub kind: Kind,
}

/// What moving one thing over a channel costs in bytes, where a token stands for more than itself.
pub mod bytes {
    /// A quad between rasteriser, cores and ROPs: position, coverage, depth and where its attributes are.
    pub const QUAD: u32 = 16;
    /// A transformed triangle in the redistribution network: three vertices of position and, on average, eight attribute words.
    pub const TRIANGLE: u32 = 144;
    /// A mark.
    pub const MARK: u32 = 4;
}
