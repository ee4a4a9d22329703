//! Segments of draws: primitives, triangles, and the quads that they cover.

use crate::{Class, CostId, Funnel, Invocations, Signature};
use gfx::format::TexelClass;
use gfx::setup::DepthPlane;
use gfx::stage::StageMap;

/// How an input primitive ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrimitiveOutcome {
    /// At least one triangle, line or point went to setup and covers samples.
    Drawn,
    /// Zero area, NaN, or repeated vertices.
    Degenerate,
    /// Faces away.
    Backface,
    /// Outside the view volume.
    Frustum,
    /// Outside the scissor rectangle or the attachment.
    Scissor,
    /// Set up, but covers no sample.
    NoSample,
}

/// A primitive as assembled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Primitive {
    /// Its vertices in the segment's vertex table; a line repeats its second, a point its only one.
    pub vertices: [u32; 3],
    /// Entries of the segment's `stream` that must have been read before it can be assembled.
    pub stream_end: u32,
    /// First of its triangles.
    pub first_triangle: u32,
    /// Triangles (lines, points) that reach setup; more than one after clipping.
    pub triangles: u8,
    /// Whether it had to be clipped against a plane.
    pub clipped: bool,
    /// Outside the view volume, which is found out by cutting it: nothing is left ([`CulledLate::frustum`](crate::CulledLate::frustum)).
    pub cut_away: bool,
    /// How it ended.
    pub outcome: PrimitiveOutcome,
}

/// Where it is found out that nothing of a triangle is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum End {
    /// Nowhere: something may be drawn. A search for its receivers finds none where it covers no sample.
    #[default]
    Nowhere,
    /// In setup.
    Setup,
    /// In traversal, after all of its bounds.
    Traversal,
}

/// One vertex invocation: unique in its segment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Vertex {
    /// Vertex index, base vertex added.
    pub index: u32,
    /// Instance index.
    pub instance: u32,
    /// Cost of shading it.
    pub cost: CostId,
    /// First of its memory requests in the segment's.
    pub first_request: u32,
}

/// A triangle, line or point after clipping and culling: what setup works on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangle {
    /// Its primitive in the segment.
    pub primitive: u32,
    /// Depth over the screen, bias included.
    pub depth: DepthPlane,
    /// Whether it faces away, which chooses the stencil state.
    pub back: bool,
    /// Bounds of the blocks it may touch, in blocks: x0, y0, x1, y1, half-open. Traversal visits these.
    pub bounds: [u16; 4],
    /// The same bounds in pixels, as setup has them: those of its samples, cut to what may be drawn.
    pub pixels: [u16; 4],
    /// Pixels of its bounding box before it is cut to the attachments, the viewport and the scissor rectangle.
    pub unclipped: u64,
    /// First of its visits.
    pub first_visit: u32,
    /// Screen tiles in which it covers samples.
    pub visits: u32,
    /// Where it ends, if nothing of it is drawn and that is not found out before ([`CulledLate`](crate::CulledLate)).
    pub end: End,
}

/// The blocks of one triangle in one screen tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Visit {
    /// The tile in the segment's `tiles`.
    pub tile: u32,
    /// First block in that tile's `blocks`.
    pub first_block: u32,
    /// Number of blocks.
    pub blocks: u32,
}

/// A block of 8x8 pixels that one triangle covers in part or whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Block {
    /// First quad in the tile's `quads`.
    pub first_quad: u32,
    /// Block column on the screen.
    pub x: u16,
    /// Block row on the screen.
    pub y: u16,
    /// Quads with at least one sample (with a fragment stage that runs once per sample, one for each such sample).
    pub quads: u8,
    /// Whether all samples of all 64 pixels are covered.
    pub full: bool,
}

/// A quad has been shaded by `render`: its cost, requests and payload are valid.
pub const QUAD_SHADED: u8 = 1;

/// Four pixels of one triangle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Quad {
    /// Samples covered by geometry, scissor and sample mask: bit `4 s + p` is sample `s` of pixel `p`.
    pub coverage: u16,
    /// What is left of `coverage` after discard, the shader's sample mask and alpha to coverage.
    pub kept: u16,
    /// Position in the block in quads: x + 4 y.
    pub position: u8,
    /// [`QUAD_SHADED`].
    pub flags: u8,
    /// Cost of shading it.
    pub cost: CostId,
    /// First word of its payload in the tile's `payload`.
    pub payload: u32,
    /// First of its memory requests in the tile's `requests`; their number is that of its cost's steps with a request.
    pub first_request: u32,
}

/// One memory or texture request of a quad (or of a vertex, or of four invocations of a workgroup).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Request {
    /// First of its lines in `lines`.
    pub first_line: u32,
    /// Distinct lines.
    pub lines: u8,
    /// Texture: bilinear filter operations over the quad's live fragments (1 each for bilinear, 2 trilinear, more anisotropic), at
    /// least 1. Memory: words moved.
    pub operations: u8,
    /// Texture: how wide the texels are.
    pub texel: TexelClass,
    /// Texture: they are loaded, not filtered.
    pub loads: bool,
}

/// Memory lines of a card. Higher numbers are none of lines: [`Request::words`] stand among them.
pub const LINES: u32 = u32::MAX << 16;

impl Request {
    /// Of a load from a uniform buffer: the words of each of its lines at which an invocation reads, a bit each. They stand behind its lines, as
    /// complements, which are no numbers of lines.
    #[inline(always)]
    pub fn words<'a>(&self, lines: &'a [u32]) -> impl Iterator<Item = (u32, u16)> + 'a {
        let (lines, words) = lines[self.first_line as usize..][..2 * usize::from(self.lines)].split_at(usize::from(self.lines));
        lines.iter().zip(words).map(|(&line, &words)| (line, !words as u16))
    }

    /// Of a load from another buffer: which halves of one of its lines invocations read, the lower one in bit 0. They stand behind its lines, two
    /// bits for each, as complements.
    #[inline(always)]
    pub fn halves(&self, lines: &[u32], line: u32) -> u8 {
        let at = (self.first_line + u32::from(self.lines) + line / 8) as usize;
        (!lines[at] >> (2 * (line % 8)) & 3) as u8
    }

    /// Number of [`Request::rate`]s.
    pub const RATES: usize = TexelClass::ALL.len() + 1;

    /// By which rate a texture unit works on it: that of the texels' class where they are filtered. Loads have that of the narrowest texels, and
    /// those of 128 bits the last one.
    #[inline(always)]
    pub fn rate(&self) -> usize {
        match (self.loads, self.texel) {
            (false, texel) => texel as usize,
            (true, TexelClass::Full) => Request::RATES - 1,
            (true, _) => TexelClass::Bytes as usize,
        }
    }
}

/// The work of a draw segment in one screen tile.
#[derive(Clone, Debug, Default)]
pub struct TileWork {
    /// Tile column.
    pub x: u16,
    /// Tile row.
    pub y: u16,
    /// Blocks in primitive order.
    pub blocks: Vec<Block>,
    /// Quads, in the order of the blocks.
    pub quads: Vec<Quad>,
    /// Depths and colours of shaded quads.
    pub payload: Vec<u32>,
    /// The invocations of the fragment stage for shaded quads.
    pub invocations: Invocations,
}

impl TileWork {
    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        let quads = size_of_val(&*self.blocks) + size_of_val(&*self.quads) + size_of_val(&*self.payload);
        quads as u64 + self.invocations.bytes()
    }
}

impl Segment {
    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        let geometry = size_of_val(&*self.stream) + size_of_val(&*self.vertices) + size_of_val(&*self.primitives);
        let triangles = size_of_val(&*self.triangles) + size_of_val(&*self.visits) + size_of_val(&*self.signatures);
        let tiles: u64 = self.tiles.iter().map(TileWork::bytes).sum();
        (geometry + triangles) as u64 + tiles + self.invocations.values().map(Invocations::bytes).sum::<u64>()
    }
}

/// A bounded piece of a draw: whole primitives in API order.
#[derive(Clone, Debug, Default)]
pub struct Segment {
    /// Address of the first index of the segment; none: the draw has no indices.
    pub index_address: Option<u64>,
    /// Bytes of an index.
    pub index_bytes: u32,
    /// The vertex of each input index, in order ([`u32::MAX`] for a strip restart).
    pub stream: Vec<u32>,
    /// Unique vertices.
    pub vertices: Vec<Vertex>,
    /// Primitives in API order.
    pub primitives: Vec<Primitive>,
    /// Triangles in API order.
    pub triangles: Vec<Triangle>,
    /// Visits, in the order of the triangles; tiles in row-major order inside a triangle.
    pub visits: Vec<Visit>,
    /// Tiles with work, in row-major order.
    pub tiles: Vec<TileWork>,
    /// The invocations of the stages before the rasteriser; [`TileWork`] has those of the fragment stage.
    pub invocations: StageMap<Invocations>,
    /// Signatures of the primitives, if the draw has one.
    pub signatures: Vec<Signature>,
    /// What was thrown away where, in API order on a machine with full post-transform reuse.
    pub funnel: Funnel,
    /// What its primitives are expected to cover; zero where nobody asks.
    pub areas: Areas,
    /// The programs that it is drawn with.
    pub programs: Programs,
}

/// The programs of a pipeline, as far as they are known before they run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Programs {
    /// Number of the pipeline among all that the trace creates.
    pub pipeline: u64,
    /// For each stage the instructions by [`Class`] of an invocation whose loops make one turn; zeros for a stage that the pipeline has not.
    pub instructions: StageMap<[u32; Class::COUNT]>,
}

/// What primitives are expected to cover, estimated from their areas and extents without traversal, in 1/256, so that sums do not depend on
/// their order; and what is left of them in some tiles.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Areas {
    /// Fragments, in 1/256.
    pub fragments: u64,
    /// Quads, in 1/256.
    pub quads: u64,
    /// Blocks of 8 x 8 pixels, in 1/256.
    pub blocks: u64,
    /// Quads of one screen tile in four that pass the early tests; all that are rasterised there where tests come late.
    pub visible: u64,
}

impl std::ops::AddAssign for Areas {
    fn add_assign(&mut self, other: Areas) {
        self.fragments += other.fragments;
        self.quads += other.quads;
        self.blocks += other.blocks;
        self.visible += other.visible;
    }
}
