//! The parts of a pass of the card: its render target, its draws, and the state in their pipelines.

use std::ops::Range;
use std::rc::Rc;

use gfx::format::Format;
use gfx::state::*;
use gl_shader::COLORS_MAX;
use gl_shader::narrow::Narrow;
use num::*;

/// Layouts of vertex buffers.
pub type Layouts = Rc<[VertexBufferLayout]>;

/// Format of the window's colours. If the window has no alpha, alpha stays 1.
pub const COLOR: Format = Format::Rgba8Unorm;

/// One draw of a pass.
#[derive(Clone, Debug)]
pub struct Draw {
    /// Its pipeline.
    pub pipeline: RenderPipelineId,
    /// Offset of its uniforms in the pass.
    pub uniforms: u32,
    /// Its vertex buffers, in the order of their slots.
    pub vertices: Vec<VertexRange>,
    /// The order of its vertices.
    pub order: Order,
    /// Number of indices, or of vertices.
    pub count: u32,
    /// Textures.
    pub textures: Option<BindGroupId>,
    /// Viewport.
    pub viewport: Viewport,
    /// Scissor.
    pub scissor: Rect,
    /// Blend constant.
    pub blend: [f32; 4],
    /// Stencil references of front and back faces.
    pub stencil: [u32; 2],
    /// The buffers that it may write: a bit of [`writes`] each.
    pub writes: u8,
    /// The occlusion query that counts it, by its number in the recording.
    pub query: Option<u64>,
    /// The call that draws it, or begins to draw what was joined.
    pub made: Made,
}

/// Where the program draws: a call, in debug groups.
#[derive(Clone, Debug, Default)]
pub struct Made {
    /// Number of the call.
    pub call: u64,
    /// Labels of the debug groups that are open, the outermost first.
    pub groups: Rc<[Rc<str>]>,
}

/// A vertex buffer of a draw.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VertexRange {
    /// The buffer; none: that of the pass.
    pub buffer: Option<BufferId>,
    /// Its first byte that is bound.
    pub offset: u64,
}

/// The order of a draw's vertices.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Order {
    /// Consecutive ones, from this one on.
    Sequence(u32),
    /// Those that indices select.
    Indices {
        /// The index buffer; none: that of the pass.
        buffer: Option<BufferId>,
        /// Type of the indices.
        format: IndexFormat,
        /// The first index.
        first: u32,
        /// Added to each index.
        base: i32,
    },
}

impl Order {
    /// Indices of the pass, from this one on.
    pub fn pass(first: u32) -> Order {
        Order::Indices { buffer: None, format: IndexFormat::Uint32, first, base: 0 }
    }
}

/// Bits of the buffers that a draw or a clear writes.
pub mod writes {
    /// Colour.
    pub const COLOR: u8 = 1;
    /// Depth.
    pub const DEPTH: u8 = 2;
    /// Stencil.
    pub const STENCIL: u8 = 4;
}

/// One image that can be drawn to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Surface {
    /// Its texture.
    pub texture: TextureId,
    /// A view of this image alone.
    pub view: ViewId,
    /// Its format.
    pub format: Format,
    /// Its level.
    pub level: u32,
    /// Its layer.
    pub layer: u32,
    /// Set if it keeps fewer than eight bits of a channel.
    pub narrow: Option<Narrow>,
}

impl Surface {
    /// Whether values outside of [0, 1] are kept.
    pub fn is_float(&self) -> bool {
        use Format::{R16Float, R32Float, Rg16Float, Rg32Float, Rgba16Float, Rgba32Float};
        matches!(self.format, R16Float | Rg16Float | Rgba16Float | R32Float | Rg32Float | Rgba32Float)
    }
}

/// A render target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Target {
    /// Width and height in pixels.
    pub size: [u32; 2],
    /// Colours.
    pub color: Option<Surface>,
    /// Further colour buffers, and whether each stores alpha; after the first `None` there are no others.
    pub more: [Option<(Surface, bool)>; COLORS_MAX - 1],
    /// Depth and stencil.
    pub depth: Option<Surface>,
    /// Whether it has depths.
    pub has_depth: bool,
    /// Whether it has stencil values.
    pub has_stencil: bool,
    /// Whether the first row is the lowest, as in textures. The window's first row is its highest.
    pub upward: bool,
    /// Whether alpha is stored. If not, it stays 1.
    pub alpha: bool,
    /// The number of the window that it is; none: a frame buffer object.
    pub window: Option<u32>,
}

/// The channels that a colour buffer stores, a bit each: all, or all but alpha.
pub fn stored_channels(alpha: bool) -> u8 {
    if alpha { 15 } else { 7 }
}

impl Target {
    /// Its colour buffers, and whether each stores alpha.
    pub fn colors(&self) -> impl Iterator<Item = (Surface, bool)> {
        let alpha = self.alpha;
        self.color.map(|color| (color, alpha)).into_iter().chain(self.more.into_iter().flatten())
    }

    /// All images that it has.
    pub fn surfaces(&self) -> impl Iterator<Item = Surface> {
        self.colors().map(|(color, _)| color).chain(self.depth)
    }
}

/// A colour buffer of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Buffer {
    /// The one that is shown next.
    Back,
    /// The one that is shown now.
    Front,
}

/// Draws that wait for their pass.
#[derive(Default)]
pub struct Pass {
    /// Its render target.
    pub target: Option<Target>,
    /// Clear colour, if colours are cleared.
    pub color: Option<[f64; 4]>,
    /// Clear depth, if depths are cleared.
    pub depth: Option<f32>,
    /// Clear value of the stencil buffer, if it is cleared.
    pub stencil: Option<u32>,
    /// Its draws.
    pub draws: Vec<Draw>,
    /// Vertices of all draws.
    pub vertices: Vec<u8>,
    /// Gaps between the arrays in `vertices`, which are not uploaded: begin and end.
    pub gaps: Vec<[usize; 2]>,
    /// Indices of all draws.
    pub indices: Vec<u32>,
    /// Blocks of uniforms.
    pub uniforms: Vec<u8>,
    /// Where the last block begins.
    pub last_block: usize,
    /// Bytes of the largest block.
    pub block: usize,
    /// Textures that are read.
    pub textures: NumberMap<TextureId, ()>,
    /// Buffers that are read beside the pass's own, and their bytes that are read.
    pub buffers: NumberMap<BufferId, Range<u64>>,
    /// The last call that clears buffers as the pass begins, if one does.
    pub clear: Option<CallSite>,
}

impl Pass {
    /// The vertex bytes to upload, with their offsets.
    pub fn uploads(&self) -> impl Iterator<Item = (u64, &[u8])> {
        let ends = self.gaps.iter().map(|gap| gap[0]).chain([self.vertices.len()]);
        let starts = [0].into_iter().chain(self.gaps.iter().map(|gap| gap[1]));
        starts.zip(ends).filter(|(start, end)| start < end).map(|(start, end)| (start as u64, &self.vertices[start..end]))
    }

    /// Whether it does nothing.
    pub fn is_empty(&self) -> bool {
        self.draws.is_empty() && self.clears() == 0
    }

    /// Buffers that are cleared as a whole.
    pub fn clears(&self) -> u8 {
        let bit = |set: bool, bit: u8| if set { bit } else { 0 };
        bit(self.color.is_some(), writes::COLOR)
            | bit(self.depth.is_some(), writes::DEPTH)
            | bit(self.stencil.is_some(), writes::STENCIL)
    }

    /// Notes that draws read these bytes of a buffer.
    pub fn read(&mut self, buffer: BufferId, bytes: Range<u64>) {
        let known = self.buffers.get_or_insert_with(buffer, || bytes.clone());
        *known = known.start.min(bytes.start)..known.end.max(bytes.end);
    }

    /// Whether it reads or draws to a texture.
    pub fn uses(&self, texture: TextureId) -> bool {
        let drawn = |target: Target| target.surfaces().any(|surface| surface.texture == texture);
        self.textures.contains(texture) || self.target.is_some_and(drawn)
    }
}

/// The state of a pipeline.
#[derive(Clone, Debug, PartialEq)]
pub struct PipelineState {
    /// The module.
    pub shader: ShaderId,
    /// Layouts of the vertex buffers.
    pub buffers: Layouts,
    /// Primitive.
    pub primitive: Primitive,
    /// Format of colours.
    pub color: Option<Format>,
    /// Further colour buffers.
    pub more: Vec<ColorTarget>,
    /// Depth and stencil.
    pub depth: Option<DepthStencil>,
    /// Blending of the first colour buffer.
    pub blend: Option<Blend>,
    /// Logic operation on the first colour buffer.
    pub logic: Option<LogicOp>,
    /// Channels of the first colour buffer that are written.
    pub mask: u8,
    /// Number of textures.
    pub textures: usize,
}

impl PipelineState {
    /// Buffers that draws may write: bits of [`writes`].
    pub fn writes(&self) -> u8 {
        let colors = self.color.is_some() && self.mask != 0 || self.more.iter().any(|target| target.write_mask != 0);
        let mut bits = if colors { writes::COLOR } else { 0 };
        if let Some(depth) = &self.depth {
            bits |= if depth.depth_write { writes::DEPTH } else { 0 };
            let kept = [depth.stencil_front, depth.stencil_back].iter().all(|face| *face == StencilFace::default());
            bits |= if kept || depth.stencil_masks().iter().all(|masks| masks.write == 0) { 0 } else { writes::STENCIL };
        }
        bits
    }
}
