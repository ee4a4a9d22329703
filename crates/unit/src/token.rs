//! The tokens that travel between units: small plain structs of indices into the work that the [`Card`](super::Card) holds.

use bytemuck::{Pod, Zeroable};

/// The kind of a token: data, or one of the marks that travel in order with the data.
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
    /// The end of a tile: what is on the chip of it is written to memory where it is wanted.
    pub const TILE: Kind = Kind(6);
    /// To assembly: a run of primitives begins.
    pub const RUN: Kind = Kind(4);
    /// To assembly: what has been read of a run needs no more than the batch of vertices that is being gathered.
    pub const PART: Kind = Kind(5);
    /// The end of one pipeline's part of a sequence number that all pipelines draw: the number ends with the last part.
    pub const PART_END: Kind = Kind(7);

    /// Whether nothing more of a sequence number follows on this channel.
    #[inline(always)]
    pub fn is_end(self) -> bool {
        self == Kind::END || self == Kind::PART_END
    }

    /// Whether all pipelines must see it.
    #[inline(always)]
    pub fn is_fence(self) -> bool {
        self == Kind::SEGMENT || self == Kind::PASS
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
    /// Data, or a mark.
    pub kind: Kind,
    /// Running number of the batch; primitives wait until it is shaded. Of a mark, its sequence number.
    pub number: u32,
    /// Entries of the segment's stream that are read once this batch is shaded. Of a run, its first primitive.
    pub stream_end: u32,
    /// Vertices in it; a batch without any needs no shading. Of a run, how many primitives it has.
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

/// A question for the depths that an owner holds of a group's pixels.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Question {
    /// The asker's number of the question.
    pub ticket: u32,
    /// Index in the groups of the owner.
    pub group: u32,
}

/// The owner's answer: the group's quads are tested against what it holds.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct Answer {
    /// The ticket of the question.
    pub ticket: u32,
    /// Bytes of depths in it.
    pub bytes: u32,
}

/// A tile whose list is to be drawn, a fence, or the end of a round of tiles.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct TileToken {
    /// Its number, row by row.
    pub tile: u32,
    /// For a fence, its slot. For a tile, whether more of the pass follows.
    pub slot: u16,
    /// Data, fence, or end.
    pub kind: Kind,
}

/// A warp on its way between its maker, a core and a texture unit.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct WarpToken {
    /// Index in the cluster's warps.
    pub warp: u32,
}

/// The message of fragment dispatch to vertex fetch, where vertices follow fragments.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Pod, Zeroable)]
#[repr(C)]
pub struct Packing {
    /// Number of the core that a warp has gone to, or else of the one that the next warp goes to.
    pub core: u16,
    /// Which of the following hold.
    pub state: u16,
}

impl Packing {
    /// A warp has gone to the core.
    pub const STARTED: u16 = 1;
    /// It is the first of a draw.
    pub const FIRST: u16 = 2;
    /// Quads wait to fill a warp, or for the core.
    pub const WAITING: u16 = 4;
    /// The warp is full, and the core has no room for it.
    pub const BLOCKED: u16 = 8;

    /// Whether this holds.
    #[inline(always)]
    pub fn has(self, state: u16) -> bool {
        self.state & state != 0
    }
}

/// The draw that may be rasterised, where one waits for the one before it.
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
pub struct NextDraw {
    /// Its number.
    pub draw: u32,
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

/// The bytes that one item takes on a channel, where a token stands for more than itself.
pub mod bytes {
    /// A quad between rasteriser, cores and ROPs: position, coverage, depth and where its attributes are.
    pub const QUAD: u32 = 16;
    /// A quad on its way to a ROP elsewhere: position, coverage and four depths, in addition to what its shader has written.
    pub const FRAGMENT_QUAD: u32 = 24;
    /// A transformed triangle in the redistribution network: three vertices of position and, on average, eight attribute words.
    pub const TRIANGLE: u32 = 144;
    /// A question for a group's depths: the block, and which of its quads.
    pub const QUESTION: u32 = 8;
    /// A mark.
    pub const MARK: u32 = 4;
}

/// How many of the lowest four bits are set. (The plain target has no instruction that counts them.)
#[inline(always)]
pub fn bits(four: u16) -> u32 {
    // The numbers of bits of 0 to 15, in four bits each.
    const BITS: u64 = 0x4332_3221_3221_2110;
    (BITS >> (4 * (four & 15))) as u32 & 15
}

/// Pixels of a quad with a sample covered.
#[inline(always)]
pub fn fragments(coverage: u16) -> u32 {
    bits(coverage | coverage >> 4 | coverage >> 8 | coverage >> 12)
}
