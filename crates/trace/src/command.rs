//! The commands of a trace. WebGPU-shaped: explicit state objects, bind groups, passes; a stream in execution order.
//!
//! Invariants that the checker enforces: an id is created before it is used and created once; commands of a pass stand between
//! its begin and end; a bundle's commands between its begin and end; every blob exists with the length and hash stated.

use serde::{Deserialize, Serialize};

use gfx::format::Format;
use gfx::state::*;
use num::*;

pub use super::name::{DrawRange, Draws};

/// A piece of binary payload: a byte range of a blob of the trace.
#[derive(Clone, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Data {
    /// Name of the blob in the trace.
    pub blob: String,
    /// First byte.
    #[serde(default, skip_serializing_if = "is_default")]
    pub offset: u64,
    /// Number of bytes.
    pub size: u64,
}

/// Source of a shader module.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum ShaderSource {
    /// A WGSL text file of the trace, by name.
    Wgsl(String),
    /// A SPIR-V blob (little-endian words).
    SpirV(String),
    /// A naga module, as RON in a blob: what a recorder that never saw source text leaves.
    NagaIr(String),
}

/// A texture.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureDesc {
    /// Dimension.
    #[serde(default, skip_serializing_if = "is_default")]
    pub dimension: TextureDimension,
    /// Width, height, and depth or layers, in texels.
    pub size: [u32; 3],
    /// Mip levels.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub levels: u32,
    /// Samples per texel: 1 or 4.
    #[serde(default = "one", skip_serializing_if = "is_one")]
    pub samples: u32,
    /// Format.
    pub format: Format,
    /// Where it is shown, the display ignores its alpha: pictures of it have an alpha of 255. So are the windows of OpenGL.
    #[serde(default, skip_serializing_if = "is_default")]
    pub opaque: bool,
}

// A field that has its default value is left out of the text, which keeps a trace readable.

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn one() -> u32 {
    1
}

fn is_one(value: &u32) -> bool {
    *value == 1
}

/// A view of a texture. `None` is the rest of the texture, or its own format.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ViewDesc {
    /// Format, if it differs in sRGB-ness from the texture's (or names one aspect).
    #[serde(skip_serializing_if = "is_default")]
    pub format: Option<Format>,
    /// Dimension; none: 1D, 3D as the texture, 2D for one layer, else 2D array.
    #[serde(skip_serializing_if = "is_default")]
    pub dimension: Option<ViewDimension>,
    /// Aspect.
    #[serde(skip_serializing_if = "is_default")]
    pub aspect: Aspect,
    /// First level.
    #[serde(skip_serializing_if = "is_default")]
    pub base_level: u32,
    /// Number of levels.
    #[serde(skip_serializing_if = "is_default")]
    pub levels: Option<u32>,
    /// First layer.
    #[serde(skip_serializing_if = "is_default")]
    pub base_layer: u32,
    /// Number of layers.
    #[serde(skip_serializing_if = "is_default")]
    pub layers: Option<u32>,
}

/// What a binding holds, as far as execution depends on it. Everything else about a binding is in the shader.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum BindingKind {
    /// A uniform buffer.
    Uniform {
        /// Whether `SetBindGroup` gives an offset for it.
        dynamic_offset: bool,
    },
    /// A storage buffer.
    Storage {
        /// Whether shaders only read it.
        read_only: bool,
        /// Whether `SetBindGroup` gives an offset for it.
        dynamic_offset: bool,
    },
    /// A sampled texture.
    Texture,
    /// A storage texture.
    StorageTexture,
    /// A sampler.
    Sampler,
}

/// One entry of a bind group layout.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LayoutEntry {
    /// `@binding`.
    pub binding: u32,
    /// What it holds.
    pub kind: BindingKind,
    /// Elements of a binding array; none: not an array.
    #[serde(default, skip_serializing_if = "is_default")]
    pub count: Option<u32>,
}

/// What is bound.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum BoundResource {
    /// A range of a buffer; size none: to its end.
    Buffer {
        /// The buffer.
        buffer: BufferId,
        /// First byte.
        offset: u64,
        /// Bytes.
        size: Option<u64>,
    },
    /// A texture view (sampled or storage).
    View(ViewId),
    /// A sampler.
    Sampler(SamplerId),
    /// A binding array of buffers.
    Buffers(Vec<(BufferId, u64, Option<u64>)>),
    /// A binding array of views.
    Views(Vec<ViewId>),
    /// A binding array of samplers.
    Samplers(Vec<SamplerId>),
}

/// One entry of a bind group.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BindGroupEntry {
    /// `@binding`.
    pub binding: u32,
    /// What is bound.
    pub resource: BoundResource,
}

/// A programmable stage.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename = "Stage")]
pub struct StageDesc {
    /// The module.
    pub shader: ShaderId,
    /// Entry point; none: the module's only one of this stage.
    #[serde(default, skip_serializing_if = "is_default")]
    pub entry: Option<String>,
    /// Pipeline-overridable constants, by name or `@id`.
    #[serde(default, skip_serializing_if = "is_default")]
    pub constants: Vec<(String, f64)>,
    /// Whether workgroup memory starts as zeros (WebGPU: always).
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub zero_workgroup_memory: bool,
}

fn yes() -> bool {
    true
}

fn is_yes(value: &bool) -> bool {
    *value
}

/// A render pipeline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RenderPipelineDesc {
    /// Layout; none: derived from the shaders.
    #[serde(default, skip_serializing_if = "is_default")]
    pub layout: Option<PipelineLayoutId>,
    /// Vertex stage.
    pub vertex: StageDesc,
    /// Vertex buffer slots; none: an unused slot.
    #[serde(default, skip_serializing_if = "is_default")]
    pub buffers: Vec<Option<VertexBufferLayout>>,
    /// Primitive state.
    #[serde(default, skip_serializing_if = "is_default")]
    pub primitive: Primitive,
    /// Depth and stencil state.
    #[serde(default, skip_serializing_if = "is_default")]
    pub depth_stencil: Option<DepthStencil>,
    /// Multisample state.
    #[serde(default, skip_serializing_if = "is_default")]
    pub multisample: Multisample,
    /// Fragment stage; none: depth and stencil only.
    #[serde(default, skip_serializing_if = "is_default")]
    pub fragment: Option<StageDesc>,
    /// Colour targets by `@location`; none: an unused slot.
    #[serde(default, skip_serializing_if = "is_default")]
    pub targets: Vec<Option<ColorTarget>>,
}

impl RenderPipelineDesc {
    /// The stages that it has, in the order in which data flow through them.
    pub fn stages(&self) -> impl DoubleEndedIterator<Item = (gfx::stage::Stage, &StageDesc)> {
        let RenderPipelineDesc {
            layout: _,
            vertex,
            buffers: _,
            primitive: _,
            depth_stencil: _,
            multisample: _,
            fragment,
            targets: _,
        } = self;
        let stages = [(gfx::stage::Stage::Vertex, Some(vertex)), (gfx::stage::Stage::Fragment, fragment.as_ref())];
        stages.into_iter().filter_map(|(stage, desc)| Some((stage, desc?)))
    }
}

/// A colour attachment of a pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ColorAttachment {
    /// Where it renders to.
    pub view: ViewId,
    /// Slice of a 3D view.
    #[serde(default, skip_serializing_if = "is_default")]
    pub depth_slice: Option<u32>,
    /// Where samples are resolved to at the end.
    #[serde(default, skip_serializing_if = "is_default")]
    pub resolve: Option<ViewId>,
    /// Clear value (red, green, blue, alpha; integers for integer formats); none: the contents are loaded.
    #[serde(default, skip_serializing_if = "is_default")]
    pub clear: Option<[f64; 4]>,
    /// Whether the result is kept.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub store: bool,
}

/// The depth and stencil attachment of a pass.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DepthAttachment {
    /// Where it renders to.
    pub view: ViewId,
    /// Depth clear value; none: loaded.
    #[serde(default, skip_serializing_if = "is_default")]
    pub depth_clear: Option<f32>,
    /// Whether depth is kept.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub depth_store: bool,
    /// Depth is not written in this pass.
    #[serde(default, skip_serializing_if = "is_default")]
    pub depth_read_only: bool,
    /// Stencil clear value; none: loaded.
    #[serde(default, skip_serializing_if = "is_default")]
    pub stencil_clear: Option<u32>,
    /// Whether stencil is kept.
    #[serde(default = "yes", skip_serializing_if = "is_yes")]
    pub stencil_store: bool,
    /// Stencil is not written in this pass.
    #[serde(default, skip_serializing_if = "is_default")]
    pub stencil_read_only: bool,
}

/// Time stamps of a pass.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PassTimestamps {
    /// The query set.
    pub set: QuerySetId,
    /// Index written at the beginning.
    #[serde(default, skip_serializing_if = "is_default")]
    pub begin: Option<u32>,
    /// Index written at the end.
    #[serde(default, skip_serializing_if = "is_default")]
    pub end: Option<u32>,
}

/// One end of a copy between a texture and something else.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TextureEnd {
    /// The texture.
    pub texture: TextureId,
    /// Mip level.
    #[serde(default, skip_serializing_if = "is_default")]
    pub level: u32,
    /// First texel: x, y, and z or layer.
    #[serde(default, skip_serializing_if = "is_default")]
    pub origin: [u32; 3],
    /// Aspect.
    #[serde(default, skip_serializing_if = "is_default")]
    pub aspect: Aspect,
}

/// How texels lie in linear memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinearLayout {
    /// First byte.
    #[serde(default, skip_serializing_if = "is_default")]
    pub offset: u64,
    /// Bytes from one row of blocks to the next; none: tightly packed.
    #[serde(default, skip_serializing_if = "is_default")]
    pub bytes_per_row: Option<u32>,
    /// Rows of blocks from one image to the next; none: tightly packed.
    #[serde(default, skip_serializing_if = "is_default")]
    pub rows_per_image: Option<u32>,
}

/// What a query set counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum QueryKind {
    /// Samples that pass.
    Occlusion,
    /// Time in nanoseconds.
    Timestamp,
    /// Pipeline statistics: one u64 a set bit, in WebGPU-native order (vertex invocations 1, clipper invocations 2, clipper
    /// primitives out 4, fragment invocations 8, compute invocations 16).
    PipelineStatistics(u8),
}

impl QueryKind {
    /// Results of a query.
    pub const fn results(self) -> u32 {
        match self {
            QueryKind::Occlusion | QueryKind::Timestamp => 1,
            QueryKind::PipelineStatistics(mask) => mask.count_ones(),
        }
    }
}

/// Which pipeline an implicit layout is asked from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum AnyPipeline {
    /// A render pipeline.
    Render(RenderPipelineId),
    /// A compute pipeline.
    Compute(ComputePipelineId),
}

/// Sprites of a display.
pub const SPRITES: u32 = 8;

/// Texels along an edge of a sprite, at most: the cursor of a graphics card.
pub const SPRITE_EDGE: u32 = 64;

/// One command. Offsets and sizes are in bytes unless said otherwise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "the fields of a command are named as in WebGPU and typed")]
pub enum Command {
    // Resources.
    CreateBuffer {
        id: BufferId,
        size: u64,
        #[serde(default, skip_serializing_if = "is_default")]
        label: Option<String>,
    },
    WriteBuffer {
        id: BufferId,
        #[serde(default, skip_serializing_if = "is_default")]
        offset: u64,
        data: Data,
    },
    CreateTexture {
        id: TextureId,
        desc: TextureDesc,
        #[serde(default, skip_serializing_if = "is_default")]
        label: Option<String>,
    },
    /// `layout.offset` counts from the start of `data`.
    WriteTexture {
        to: TextureEnd,
        data: Data,
        layout: LinearLayout,
        size: [u32; 3],
    },
    CreateView {
        id: ViewId,
        texture: TextureId,
        #[serde(default, skip_serializing_if = "is_default")]
        desc: ViewDesc,
    },
    CreateSampler {
        id: SamplerId,
        desc: SamplerDesc,
    },
    CreateShader {
        id: ShaderId,
        source: ShaderSource,
        #[serde(default, skip_serializing_if = "is_default")]
        label: Option<String>,
    },
    CreateBindGroupLayout {
        id: BindGroupLayoutId,
        entries: Vec<LayoutEntry>,
    },
    CreatePipelineLayout {
        id: PipelineLayoutId,
        groups: Vec<Option<BindGroupLayoutId>>,
        #[serde(default, skip_serializing_if = "is_default")]
        immediate_size: u32,
    },
    CreateBindGroup {
        id: BindGroupId,
        layout: BindGroupLayoutId,
        entries: Vec<BindGroupEntry>,
    },
    CreateRenderPipeline {
        id: RenderPipelineId,
        desc: Box<RenderPipelineDesc>,
        #[serde(default, skip_serializing_if = "is_default")]
        label: Option<String>,
    },
    CreateComputePipeline {
        id: ComputePipelineId,
        #[serde(default, skip_serializing_if = "is_default")]
        layout: Option<PipelineLayoutId>,
        stage: StageDesc,
        #[serde(default, skip_serializing_if = "is_default")]
        label: Option<String>,
    },
    /// Names a derived layout of a pipeline created with `layout: None`.
    GetBindGroupLayout {
        id: BindGroupLayoutId,
        pipeline: AnyPipeline,
        group: u32,
    },
    CreateQuerySet {
        id: QuerySetId,
        kind: QueryKind,
        count: u32,
    },
    /// The object is not used by any later command.
    Destroy(Object),

    // The setup of a trace that was cut out of a longer one: the state that earlier frames have left.
    /// The first command of such a trace. What follows up to `EndSetup` belongs to no frame and takes no time.
    BeginSetup,
    /// The first frame begins.
    EndSetup {
        /// The number of commands that count as moments of time before the first frame, from which time stamps go on.
        moments: u64,
    },
    /// The next object lies at the address `to` of the card's memory or behind it.
    SkipAddresses {
        to: u64,
    },
    /// Sets an image of a texture: all its samples and aspects, as they are stored.
    RestoreTexture {
        texture: TextureId,
        #[serde(default, skip_serializing_if = "is_default")]
        level: u32,
        /// A layer, or a slice of a 3D texture.
        #[serde(default, skip_serializing_if = "is_default")]
        layer: u32,
        data: Data,
    },
    /// Sets all results of a query set, in 64 bits each.
    RestoreQueries {
        set: QuerySetId,
        data: Data,
    },

    // Between passes.
    CopyBufferToBuffer {
        from: BufferId,
        from_offset: u64,
        to: BufferId,
        to_offset: u64,
        size: u64,
    },
    CopyBufferToTexture {
        from: BufferId,
        layout: LinearLayout,
        to: TextureEnd,
        size: [u32; 3],
    },
    CopyTextureToBuffer {
        from: TextureEnd,
        to: BufferId,
        layout: LinearLayout,
        size: [u32; 3],
    },
    CopyTextureToTexture {
        from: TextureEnd,
        to: TextureEnd,
        size: [u32; 3],
    },
    ClearBuffer {
        buffer: BufferId,
        offset: u64,
        #[serde(default, skip_serializing_if = "is_default")]
        size: Option<u64>,
    },
    /// Sets the named subresources to zero; none: the rest.
    ClearTexture {
        texture: TextureId,
        aspect: Aspect,
        base_level: u32,
        levels: Option<u32>,
        base_layer: u32,
        layers: Option<u32>,
    },
    /// Also allowed inside passes.
    WriteTimestamp {
        set: QuerySetId,
        index: u32,
    },
    ResolveQuerySet {
        set: QuerySetId,
        first: u32,
        count: u32,
        to: BufferId,
        to_offset: u64,
    },
    /// From the next frame on the display lays a view over its lines, outside the frame buffer, with the upper left texel on pixel
    /// (`x`, `y`): what is opaque (alpha is not 0) replaces the picture. No view: the sprite is not shown any more.
    SetSprite {
        /// Which sprite, below [`SPRITES`]; one of a lower index lies over others.
        index: u32,
        /// One level and layer of a single-sampled 2D texture in an 8-bit RGBA or BGRA format, at most [`SPRITE_EDGE`] texels wide and high.
        #[serde(default, skip_serializing_if = "is_default")]
        view: Option<ViewId>,
        x: i32,
        y: i32,
    },
    /// Ends a frame: the texture is what is shown.
    Present {
        texture: TextureId,
    },

    // Passes. Entries of `color` are none where a location is unused.
    BeginRenderPass {
        color: Vec<Option<ColorAttachment>>,
        #[serde(default, skip_serializing_if = "is_default")]
        depth: Option<DepthAttachment>,
        #[serde(default, skip_serializing_if = "is_default")]
        occlusion: Option<QuerySetId>,
        #[serde(default, skip_serializing_if = "is_default")]
        timestamps: Option<PassTimestamps>,
        #[serde(default, skip_serializing_if = "is_default")]
        label: Option<String>,
    },
    EndRenderPass,
    BeginComputePass {
        #[serde(default, skip_serializing_if = "is_default")]
        timestamps: Option<PassTimestamps>,
        #[serde(default, skip_serializing_if = "is_default")]
        label: Option<String>,
    },
    EndComputePass,
    /// Commands up to `EndBundle` are kept, not executed.
    BeginBundle {
        id: BundleId,
    },
    EndBundle,

    // Inside passes and bundles.
    SetRenderPipeline(RenderPipelineId),
    SetComputePipeline(ComputePipelineId),
    SetBindGroup {
        index: u32,
        group: Option<BindGroupId>,
        #[serde(default, skip_serializing_if = "is_default")]
        offsets: Vec<u32>,
    },
    /// Bytes, little-endian 32-bit words, at a byte offset of the immediate range.
    SetImmediates {
        offset: u32,
        words: Vec<u32>,
    },
    SetIndexBuffer {
        buffer: BufferId,
        format: IndexFormat,
        #[serde(default, skip_serializing_if = "is_default")]
        offset: u64,
        #[serde(default, skip_serializing_if = "is_default")]
        size: Option<u64>,
    },
    SetVertexBuffer {
        slot: u32,
        buffer: Option<BufferId>,
        #[serde(default, skip_serializing_if = "is_default")]
        offset: u64,
        #[serde(default, skip_serializing_if = "is_default")]
        size: Option<u64>,
    },
    SetViewport(Viewport),
    SetScissor(Rect),
    SetBlendConstant([f64; 4]),
    /// The stencil reference of front and back faces.
    SetStencilReference(u32),
    /// Beyond WebGPU: a stencil reference for each face.
    SetStencilReferences {
        front: u32,
        back: u32,
    },
    Draw {
        vertices: u32,
        #[serde(default = "one", skip_serializing_if = "is_one")]
        instances: u32,
        #[serde(default, skip_serializing_if = "is_default")]
        first_vertex: u32,
        #[serde(default, skip_serializing_if = "is_default")]
        first_instance: u32,
    },
    DrawIndexed {
        indices: u32,
        #[serde(default = "one", skip_serializing_if = "is_one")]
        instances: u32,
        #[serde(default, skip_serializing_if = "is_default")]
        first_index: u32,
        #[serde(default, skip_serializing_if = "is_default")]
        base_vertex: i32,
        #[serde(default, skip_serializing_if = "is_default")]
        first_instance: u32,
    },
    /// `count` records, 16 (20 when indexed) bytes apart, at `offset`; with `count_buffer` the smaller of `count` and the u32 at that place.
    DrawIndirect {
        buffer: BufferId,
        offset: u64,
        #[serde(default, skip_serializing_if = "is_default")]
        indexed: bool,
        #[serde(default = "one", skip_serializing_if = "is_one")]
        count: u32,
        #[serde(default, skip_serializing_if = "is_default")]
        count_buffer: Option<(BufferId, u64)>,
    },
    Dispatch {
        groups: [u32; 3],
    },
    DispatchIndirect {
        buffer: BufferId,
        offset: u64,
    },
    BeginOcclusionQuery {
        index: u32,
    },
    EndOcclusionQuery,
    BeginStatisticsQuery {
        set: QuerySetId,
        index: u32,
    },
    EndStatisticsQuery,
    ExecuteBundles(Vec<BundleId>),
    PushDebugGroup(String),
    PopDebugGroup,
    InsertDebugMarker(String),
    /// The recorded program made the commands that follow here, up to the next of these. Allowed everywhere.
    SetCallSite(CallSite),
}

impl Command {
    /// The command that sets the stencil references of front and back faces.
    pub fn stencil_references([front, back]: [u32; 2]) -> Command {
        if front == back { Command::SetStencilReference(front) } else { Command::SetStencilReferences { front, back } }
    }
}

/// Any object that can be destroyed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[allow(missing_docs, reason = "each variant is the id it holds")]
pub enum Object {
    Buffer(BufferId),
    Texture(TextureId),
    View(ViewId),
    Sampler(SamplerId),
    Shader(ShaderId),
    BindGroupLayout(BindGroupLayoutId),
    PipelineLayout(PipelineLayoutId),
    BindGroup(BindGroupId),
    RenderPipeline(RenderPipelineId),
    ComputePipeline(ComputePipelineId),
    Bundle(BundleId),
    QuerySet(QuerySetId),
}
