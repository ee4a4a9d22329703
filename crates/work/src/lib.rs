//! Floor 2: the work that `render` leaves for a machine to do, as plain data: the micro-trace.
//!
//! Work depends on the trace and on a [`RenderKey`], never on a machine: no unit count, cache size, latency or sort class is
//! in it. It comes as a stream of [`Event`]s in API order, in bounded pieces ([`Segment`]s), so that a frame larger than memory
//! flows through; a sweep keeps the pieces and times every machine from them.
//!
//! Addresses are bytes in the card's memory, given out by `render`; a *line* is an address divided by [`LINE`]. Larger cache
//! lines are unions of these.

mod cost;
mod funnel;
pub mod profile;

use std::sync::Arc;

use serde::{Deserialize, Serialize};

use gfx::format::Format;
use gfx::setup::DepthPlane;
use gfx::state::{Blend, DepthStencil, StepMode};

pub use cost::{Class, Cost, CostId, CostTable, Point, RequestKind, Span, Step};
pub use funnel::Funnel;

/// Bytes of a memory line, the granularity at which work names memory.
pub const LINE: u64 = 64;

/// Width and height of a traversal block in pixels: the unit of hierarchical Z, of fast clear and of compression.
pub const BLOCK: u32 = 8;

/// Width and height in pixels of the screen tiles in which work is grouped.
pub const TILE: u32 = 64;

/// What of a render the work depends on, beside the trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RenderKey {
    /// Whether depth and stencil may be tested before shading where that cannot change the result.
    pub early_z: bool,
    /// Which quads' costs are recorded.
    pub shade: Shade,
    /// Whether draws and primitives are signed.
    pub signatures: bool,
    /// Whether costs have the path that was taken through the program, for machines that execute it instruction by instruction.
    pub paths: bool,
    /// Whether costs count instructions that work on up to four components at once, instead of those that work on one.
    pub vectors: bool,
    /// Work that changes no picture and is recorded all the same.
    pub needless: Needless,
    /// What is left out where its bounds lie outside the view volume.
    pub cull: Cull,
}

/// Work that changes no picture, which a card leaves out where it finds out in time. Recorded for machines that do not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Needless {
    /// Triangles that face away, which setup finds out.
    pub facing: bool,
    /// Primitives outside the view volume, which setup finds out, or cutting them.
    pub frustum: bool,
    /// Primitives outside the scissor rectangle, which traversal finds out.
    pub scissor: bool,
    /// Primitives without area, which setup finds out, or without a covered sample, which traversal does.
    pub no_sample: bool,
    /// Attributes of vertex buffers that the vertex stage does not read.
    pub attributes: bool,
    /// What the vertex stage writes and the fragment stage does not read.
    pub varyings: bool,
    /// Texels of the second of two levels where all of a sample comes from the first.
    pub levels: bool,
}

impl Needless {
    /// Nothing of it.
    pub const NONE: Needless = Needless {
        facing: false,
        frustum: false,
        scissor: false,
        no_sample: false,
        attributes: false,
        varyings: false,
        levels: false,
    };

    /// Whether primitives are recorded that end so.
    pub fn keeps(&self, outcome: Outcome) -> bool {
        match outcome {
            Outcome::Drawn => false,
            Outcome::Degenerate | Outcome::NoSample => self.no_sample,
            Outcome::Backface => self.facing,
            Outcome::Frustum => self.frustum,
            Outcome::Scissor => self.scissor,
        }
    }
}

/// What is left out by bounds, before anything is done with its vertices.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Cull {
    /// Nothing.
    #[default]
    None,
    /// Whole draws.
    Draws,
    /// Whole draws, and instances of the others.
    Instances,
}

/// 128 bits of what something depends on: where they are equal, so is the result.
pub type Signature = u128;

impl Default for RenderKey {
    fn default() -> Self {
        RenderKey {
            early_z: true,
            shade: Shade::Visible,
            signatures: false,
            paths: false,
            vectors: false,
            needless: Needless::NONE,
            cull: Cull::None,
        }
    }
}

/// Which quads' shading costs and colours are recorded.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Shade {
    /// Those that early depth and stencil tests in API order let through.
    Visible,
    /// Every covered quad, for machines whose early tests cannot see all earlier depth.
    Covered,
}

/// One step of the stream.
#[derive(Clone, Debug)]
pub enum Event {
    /// A surface has these bytes now, put there by something that is not a draw (upload, copy, compute). Comes before a pass that
    /// loads it, when the machine cannot know the contents.
    Contents(Contents),
    /// A render pass begins.
    BeginPass(Arc<Pass>),
    /// The next segments belong to this draw.
    Draw(Arc<Draw>),
    /// A piece of the current draw.
    Segment(Arc<Segment>),
    /// A piece of the current draw for functional warming: it changes pixels, caches and hierarchical Z and takes no cycles, where a run
    /// simulates only some frames. Rendering makes none of these.
    Applied(Arc<Segment>),
    /// The render pass ends: attachments are stored and resolved.
    EndPass,
    /// A compute dispatch begins.
    Dispatch(Arc<Dispatch>),
    /// A run of workgroups of the current dispatch.
    Groups(Arc<Groups>),
    /// Memory is copied, cleared or uploaded.
    Transfer(Transfer),
    /// A frame ends.
    EndFrame(EndFrame),
}

impl Event {
    /// Bytes of the work in it; what is shared with the renderer and small is not counted.
    pub fn bytes(&self) -> u64 {
        match self {
            Event::Segment(segment) | Event::Applied(segment) => segment.bytes(),
            Event::Groups(groups) => groups.bytes(),
            Event::Contents(contents) => contents.bytes.len() as u64,
            Event::EndFrame(end) => {
                end.reference.len() as u64 + end.sprites.iter().map(|sprite| sprite.texels.len() as u64).sum::<u64>()
            }
            _ => 0,
        }
    }
}

/// Names one image of a texture: all samples of one layer (or slice) of one level.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct SurfaceKey {
    /// The texture's id in the trace.
    pub texture: u32,
    /// Mip level.
    pub level: u32,
    /// Layer, or slice of a 3D texture.
    pub layer: u32,
}

/// A surface: where it is and what its texels are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Its name.
    pub key: SurfaceKey,
    /// Format of the stored texels (sRGB-ness is the view's).
    pub format: Format,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Address of the first byte; blocks lie as in `gfx::tiling`.
    pub address: u64,
}

/// Bytes of a surface: rows top to bottom, pixels left to right, samples in order, `block_bytes` each, tightly packed.
#[derive(Clone, Debug)]
pub struct Contents {
    /// Which surface.
    pub surface: Surface,
    /// Its bytes.
    pub bytes: Arc<[u8]>,
}

/// What an attachment holds when a pass begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Load {
    /// What it held before.
    Load,
    /// This value: the bits that `gfx::texel::encode` takes (f32, u32 or i32 bits by the format's kind); for a depth attachment
    /// [depth as f32 bits, stencil, 0, 0].
    Clear([u32; 4]),
}

/// One attachment of a pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Attachment {
    /// Where it is.
    pub surface: Surface,
    /// What it holds at the beginning (colour, or depth).
    pub load: Load,
    /// Whether the result is kept (colour, or depth).
    pub store: bool,
    /// Stencil: what it holds at the beginning.
    pub stencil_load: Load,
    /// Stencil: whether the result is kept.
    pub stencil_store: bool,
    /// Where samples are resolved to at the end.
    pub resolve: Option<Surface>,
}

/// A render pass.
#[derive(Clone, Debug)]
pub struct Pass {
    /// Number in the trace, from 0.
    pub number: u32,
    /// Label, or empty.
    pub label: String,
    /// Width in pixels.
    pub width: u32,
    /// Height in pixels.
    pub height: u32,
    /// Samples a pixel.
    pub samples: u32,
    /// Colour attachments by location.
    pub color: Vec<Option<Attachment>>,
    /// Depth and stencil attachment.
    pub depth: Option<Attachment>,
}

/// Shading of a colour target, as the ROPs need it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Target {
    /// Blending; none replaces.
    pub blend: Option<Blend>,
    /// Channels written.
    pub write_mask: u8,
    /// First entry of this target's colours in a quad's payload (depths counted), or none where the fragment stage writes nothing to
    /// it. Word `w` of pixel `p` is entry `4 w + p` from there.
    pub payload: Option<u8>,
    /// Words a fragment: 4 (bits for `gfx::texel::encode`, before blending), or fewer where `packed`.
    pub words: u8,
    /// The payload holds stored texels (1 word for up to 4 bytes, 2 for 8, 4 for 16), not values: nothing is left to blend.
    pub packed: bool,
    /// First entry of the second source colour in a quad's payload (dual-source blending; 4 words a fragment).
    pub second: Option<u8>,
}

/// Where an attribute comes from in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AttributeFetch {
    /// Address of the attribute of vertex (or instance) 0.
    pub address: u64,
    /// Bytes from one vertex to the next.
    pub stride: u64,
    /// What advances it.
    pub step: StepMode,
    /// Bytes read.
    pub bytes: u32,
}

/// What a shader asks of a core, apart from its instructions.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShaderShape {
    /// 32-bit registers an invocation, which bound the warps in flight.
    pub registers: u32,
    /// 32-bit words in: attributes of a vertex, or interpolated varyings of a fragment.
    pub inputs: u32,
    /// 32-bit words out.
    pub outputs: u32,
}

/// A draw call's state, shared by its segments.
#[derive(Clone, Debug)]
pub struct Draw {
    /// Number in the trace, from 0.
    pub number: u32,
    /// Label of the pipeline, or empty.
    pub label: String,
    /// Label of the innermost debug group that the draw is in, or empty.
    pub group: Arc<str>,
    /// Vertex stage.
    pub vertex: ShaderShape,
    /// Fragment stage; none: depth and stencil only.
    pub fragment: Option<ShaderShape>,
    /// Where attributes come from.
    pub attributes: Vec<AttributeFetch>,
    /// Depth and stencil state, if the pass has such an attachment and the draw uses it.
    pub depth_stencil: Option<DepthStencil>,
    /// Stencil reference.
    pub stencil_reference: u8,
    /// Colour targets by location; none: nothing is written.
    pub targets: Vec<Option<Target>>,
    /// Blend constant.
    pub blend_constant: [f32; 4],
    /// Words a quad's payload has for depth: 4 times the samples when the fragment stage writes depth, else 0 and the plane counts.
    /// They come first; sample `s` of pixel `p` is word `4 s + p`.
    pub depth_words: u8,
    /// Words of payload of a shaded quad in all; word `4 w + p` after the depth words is word `w` of pixel `p`.
    pub payload_words: u8,
    /// Depth and stencil are tested and written before shading (nothing in the fragment stage can change them).
    pub early: bool,
    /// Hierarchical Z may cull: the fragment stage does not write depth, and culling loses no side effect, query or change of the stencil.
    pub hierarchical_z: bool,
    /// Viewport's depth range, to which depth is clamped.
    pub depth_range: [f32; 2],
    /// Signature of all that its pixels depend on beside attachments and primitives; none: not asked for, or there is more to the draw
    /// than pixels.
    pub signature: Option<Signature>,
    /// What of it was left out by bounds.
    pub culling: Culling,
}

/// What tests of bounds against the view volume came to.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Culling {
    /// Tests of the draw and of its instances.
    pub tests: u64,
    /// Whole draws left out: 1 or none.
    pub draws: u64,
    /// Instances left out, those of a whole draw included.
    pub instances: u64,
    /// Their primitives.
    pub primitives: u64,
    /// Their indices (or vertices, of draws without indices).
    pub vertices: u64,
}

/// How an input primitive ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
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
    /// Outside the view volume, which is found out by cutting it: nothing is left ([`Needless::frustum`]).
    pub cut_away: bool,
    /// How it ended.
    pub outcome: Outcome,
}

/// Where it is found out that nothing of a triangle is drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum End {
    /// Nowhere: something may be drawn. Who looks for its receivers finds none where it covers no sample.
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
    /// Where it ends, if nothing of it is drawn and that is not found out before ([`Needless`]).
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
    /// Quads with at least one sample (with a fragment stage that runs once a sample, one for each such sample).
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
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Request {
    /// First of its lines in `lines`.
    pub first_line: u32,
    /// Distinct lines.
    pub lines: u8,
    /// Texture: bilinear filter operations over the quad's live fragments (1 each for bilinear, 2 trilinear, more anisotropic), at
    /// least 1. Memory: words moved.
    pub operations: u8,
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
    /// Requests of shaded quads.
    pub requests: Vec<Request>,
    /// Lines of the requests: address / [`LINE`].
    pub lines: Vec<u32>,
    /// Costs of the quads.
    pub costs: CostTable,
}

impl TileWork {
    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        let quads = size_of_val(&*self.blocks) + size_of_val(&*self.quads) + size_of_val(&*self.payload);
        (quads + size_of_val(&*self.requests) + size_of_val(&*self.lines)) as u64 + self.costs.bytes()
    }
}

impl Segment {
    /// Bytes that it takes.
    pub fn bytes(&self) -> u64 {
        let geometry = size_of_val(&*self.stream) + size_of_val(&*self.vertices) + size_of_val(&*self.primitives);
        let triangles = size_of_val(&*self.triangles) + size_of_val(&*self.visits) + size_of_val(&*self.signatures);
        let memory = size_of_val(&*self.requests) + size_of_val(&*self.lines);
        let tiles: u64 = self.tiles.iter().map(TileWork::bytes).sum();
        (geometry + triangles + memory) as u64 + tiles + self.costs.bytes()
    }
}

impl Groups {
    /// Bytes that they take.
    pub fn bytes(&self) -> u64 {
        let memory = size_of_val(&*self.requests) + size_of_val(&*self.lines);
        (size_of_val(&*self.packets) + memory) as u64 + self.costs.bytes()
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
    /// Memory requests of vertices.
    pub requests: Vec<Request>,
    /// Lines of these requests.
    pub lines: Vec<u32>,
    /// Signatures of the primitives, if the draw has one.
    pub signatures: Vec<Signature>,
    /// Costs of the vertices.
    pub costs: CostTable,
    /// What was thrown away where, in API order on a machine with full post-transform reuse.
    pub funnel: Funnel,
}

/// A compute dispatch.
#[derive(Clone, Debug)]
pub struct Dispatch {
    /// Number in the trace, from 0.
    pub number: u32,
    /// Label of the pipeline, or empty.
    pub label: String,
    /// The shader.
    pub shape: ShaderShape,
    /// Workgroups in all.
    pub groups: u64,
    /// Invocations a group.
    pub invocations: u32,
    /// Bytes of workgroup memory a group.
    pub shared_bytes: u32,
}

/// Four consecutive invocations of a workgroup.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Packet {
    /// Cost of running them.
    pub cost: CostId,
    /// First of their requests.
    pub first_request: u32,
}

/// Consecutive workgroups of a dispatch.
#[derive(Clone, Debug, Default)]
pub struct Groups {
    /// Workgroups here.
    pub groups: u32,
    /// Packets: `ceil(invocations / 4)` a group, in order.
    pub packets: Vec<Packet>,
    /// Their memory requests.
    pub requests: Vec<Request>,
    /// Lines of the requests.
    pub lines: Vec<u32>,
    /// Costs of the packets.
    pub costs: CostTable,
}

/// What a transfer is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TransferKind {
    /// From the host.
    Upload,
    /// Inside the card's memory.
    Copy,
    /// A value is written.
    Clear,
    /// The image of a sprite, to the display.
    Sprite,
    /// Query results and the like.
    Other,
}

/// Memory that the command processor's copy engine moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Transfer {
    /// What it is.
    pub kind: TransferKind,
    /// First byte read, if the card's memory is read.
    pub from: Option<u64>,
    /// First byte written, if the card's memory is written.
    pub to: Option<u64>,
    /// Bytes.
    pub bytes: u64,
    /// Surfaces: this one becomes that one, whole (a texture copy that the machine must repeat in its own frame buffers).
    pub surfaces: Option<(SurfaceKey, SurfaceKey)>,
}

/// The end of a frame.
#[derive(Clone, Debug)]
pub struct EndFrame {
    /// The trace's own frame number, from 0.
    pub number: u32,
    /// What is shown; none: nothing can be (no colour target was ever written).
    pub shown: Option<Surface>,
    /// Its bytes in API order, as `render` has them, laid out as in [`Contents`].
    pub reference: Arc<[u8]>,
    /// Whether the frame's last writer of the shown surface was a draw, so that the machine's own bytes are the picture.
    pub drawn: bool,
    /// The sprites that the display lays over the picture, by index.
    pub sprites: Arc<[Sprite]>,
}

/// A small picture that the display lays over its lines, outside the frame buffer. Its texels are 4 bytes of 8 bits a channel, in the
/// order of the shown surface; where the last of them, alpha, is not 0, the texel replaces the pixel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sprite {
    /// Which of the display's: one of a lower index lies over others.
    pub index: u8,
    /// The pixel of the picture on which its upper left texel lies; parts outside of the picture are not shown.
    pub at: [i32; 2],
    /// Width and height in texels.
    pub size: [u32; 2],
    /// Its texels, rows from top to bottom.
    pub texels: Arc<[u8]>,
}
