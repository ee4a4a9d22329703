//! Commands of a command buffer, and those inside passes and bundles.

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::*;

/// How texels lie in a buffer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct TexelCopyBufferLayout {
    pub offset: u64,
    pub bytes_per_row: Option<u32>,
    pub rows_per_image: Option<u32>,
}

/// The buffer end of a copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct TexelCopyBufferInfo {
    pub buffer: Id,
    pub layout: TexelCopyBufferLayout,
}

/// The texture end of a copy.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct TexelCopyTextureInfo {
    pub texture: Id,
    pub mip_level: u32,
    #[serde(default)]
    pub origin: Origin3d,
    #[serde(default)]
    pub aspect: TextureAspect,
}

/// A command of a command buffer.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "variants and fields are named as in wgpu-core's trace")]
pub enum Command {
    CopyBufferToBuffer {
        src: Id,
        src_offset: u64,
        dst: Id,
        dst_offset: u64,
        size: Option<u64>,
    },
    CopyBufferToTexture {
        src: TexelCopyBufferInfo,
        dst: TexelCopyTextureInfo,
        size: Extent3d,
    },
    CopyTextureToBuffer {
        src: TexelCopyTextureInfo,
        dst: TexelCopyBufferInfo,
        size: Extent3d,
    },
    CopyTextureToTexture {
        src: TexelCopyTextureInfo,
        dst: TexelCopyTextureInfo,
        size: Extent3d,
    },
    ClearBuffer {
        dst: Id,
        offset: u64,
        size: Option<u64>,
    },
    ClearTexture {
        dst: Id,
        subresource_range: ImageSubresourceRange,
    },
    WriteTimestamp {
        query_set: Id,
        query_index: u32,
    },
    ResolveQuerySet {
        query_set: Id,
        start_query: u32,
        query_count: u32,
        destination: Id,
        destination_offset: u64,
    },
    PushDebugGroup(String),
    PopDebugGroup,
    InsertDebugMarker(String),
    RunComputePass {
        pass: Pass<ComputeCommand>,
        timestamp_writes: Option<PassTimestampWrites>,
    },
    RunRenderPass {
        pass: Pass<RenderCommand>,
        color_attachments: Vec<Option<RenderPassColorAttachment>>,
        depth_stencil_attachment: Option<RenderPassDepthStencilAttachment>,
        timestamp_writes: Option<PassTimestampWrites>,
        occlusion_query_set: Option<Id>,
        multiview_mask: Option<u32>,
    },
    BuildAccelerationStructures {
        blas: IgnoredAny,
        tlas: IgnoredAny,
    },
    /// Hints about states, without an effect on results.
    TransitionResources {
        buffer_transitions: IgnoredAny,
        texture_transitions: IgnoredAny,
    },
}

/// Commands of a pass or bundle, and the streams that they draw from in order.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Pass<C> {
    /// Label.
    pub label: Option<String>,
    /// Commands.
    pub commands: Vec<C>,
    /// Offsets; each `SetBindGroup` takes as many as it says.
    pub dynamic_offsets: Vec<u32>,
    /// UTF-8 text; each debug command takes as many bytes as it says.
    pub string_data: Vec<u8>,
    /// Words that `SetImmediate` indexes.
    pub immediates_data: Vec<u32>,
}

/// Time stamps of a pass.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct PassTimestampWrites {
    pub query_set: Id,
    pub beginning_of_pass_write_index: Option<u32>,
    pub end_of_pass_write_index: Option<u32>,
}

/// A colour attachment.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct RenderPassColorAttachment {
    pub view: Id,
    pub depth_slice: Option<u32>,
    pub resolve_target: Option<Id>,
    pub load_op: LoadOp<Color>,
    pub store_op: StoreOp,
}

/// The depth and stencil attachment.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct RenderPassDepthStencilAttachment {
    pub view: Id,
    pub depth: PassChannel<f32>,
    pub stencil: PassChannel<u32>,
}

/// What a pass does with depth or with stencil.
#[derive(Clone, Copy, Debug, Deserialize)]
#[allow(missing_docs, reason = "variants are named as in wgpu")]
pub enum PassChannel<V> {
    ReadOnly,
    Operational(Operations<V>),
}

/// Load and store operation.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct Operations<V> {
    pub load: LoadOp<V>,
    pub store: StoreOp,
}

/// A rectangle.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "left, top, width, height")]
pub struct Rect<T> {
    pub x: T,
    pub y: T,
    pub w: T,
    pub h: T,
}

/// What an indirect draw's records are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[allow(missing_docs, reason = "variants are named as in wgpu")]
pub enum DrawCommandFamily {
    Draw,
    DrawIndexed,
    DrawMeshTasks,
}

/// A command of a render pass or bundle.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "variants and fields are named as in wgpu-core's trace")]
pub enum RenderCommand {
    SetBindGroup {
        index: u32,
        num_dynamic_offsets: usize,
        bind_group: Option<Id>,
    },
    SetPipeline(Id),
    SetIndexBuffer {
        buffer: Id,
        index_format: IndexFormat,
        offset: u64,
        size: Option<u64>,
    },
    SetVertexBuffer {
        slot: u32,
        buffer: Option<Id>,
        offset: u64,
        size: Option<u64>,
    },
    SetBlendConstant(Color),
    SetStencilReference(u32),
    SetViewport {
        rect: Rect<f32>,
        depth_min: f32,
        depth_max: f32,
    },
    SetScissor(Rect<u32>),
    SetImmediate {
        offset: u32,
        size_bytes: u32,
        /// None writes zeros.
        values_offset: Option<u32>,
    },
    Draw {
        vertex_count: u32,
        instance_count: u32,
        first_vertex: u32,
        first_instance: u32,
    },
    DrawIndexed {
        index_count: u32,
        instance_count: u32,
        first_index: u32,
        base_vertex: i32,
        first_instance: u32,
    },
    DrawMeshTasks {
        group_count_x: u32,
        group_count_y: u32,
        group_count_z: u32,
    },
    DrawIndirect {
        buffer: Id,
        offset: u64,
        count: u32,
        family: DrawCommandFamily,
        /// Bounds that wgpu knows in bundles and uses to refuse records that would read outside: our reads are robust.
        vertex_or_index_limit: Option<u64>,
        instance_limit: Option<u64>,
    },
    MultiDrawIndirectCount {
        buffer: Id,
        offset: u64,
        count_buffer: Id,
        count_buffer_offset: u64,
        max_count: u32,
        family: DrawCommandFamily,
    },
    PushDebugGroup {
        color: u32,
        len: usize,
    },
    PopDebugGroup,
    InsertDebugMarker {
        color: u32,
        len: usize,
    },
    WriteTimestamp {
        query_set: Id,
        query_index: u32,
    },
    BeginOcclusionQuery {
        query_index: u32,
    },
    EndOcclusionQuery,
    BeginPipelineStatisticsQuery {
        query_set: Id,
        query_index: u32,
    },
    EndPipelineStatisticsQuery,
    ExecuteBundle(Id),
}

/// A command of a compute pass.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "variants and fields are named as in wgpu-core's trace")]
pub enum ComputeCommand {
    SetBindGroup { index: u32, num_dynamic_offsets: usize, bind_group: Option<Id> },
    SetPipeline(Id),
    SetImmediate { offset: u32, size_bytes: u32, values_offset: u32 },
    DispatchWorkgroups([u32; 3]),
    DispatchWorkgroupsIndirect { buffer: Id, offset: u64 },
    PushDebugGroup { color: u32, len: usize },
    PopDebugGroup,
    InsertDebugMarker { color: u32, len: usize },
    WriteTimestamp { query_set: Id, query_index: u32 },
    BeginPipelineStatisticsQuery { query_set: Id, query_index: u32 },
    EndPipelineStatisticsQuery,
    TransitionResources { buffer_transitions: IgnoredAny, texture_transitions: IgnoredAny },
}
