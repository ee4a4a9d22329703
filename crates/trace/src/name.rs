//! Names of commands, for messages and statistics, and what they draw.

use num::BufferId;

use super::command::Command;

/// Which vertices and instances are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DrawRange {
    /// First vertex, or first index.
    pub first: u32,
    /// Number of vertices, or of indices.
    pub count: u32,
    /// Added to every index.
    pub base_vertex: i32,
    /// First instance.
    pub first_instance: u32,
    /// Number of instances.
    pub instances: u32,
    /// Number of the draw in a multi-draw.
    pub draw_index: u32,
}

impl DrawRange {
    /// Nothing.
    pub const NONE: DrawRange =
        DrawRange { first: 0, count: 0, base_vertex: 0, first_instance: 0, instances: 0, draw_index: 0 };

    /// Vertices of all instances.
    pub const fn vertices(&self) -> u64 {
        self.count as u64 * self.instances as u64
    }
}

/// What a command draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Draws {
    /// A range of vertices, or of indices.
    Direct {
        /// Whether the range is one of indices.
        indexed: bool,
        /// What is drawn.
        range: DrawRange,
    },
    /// Ranges that lie in a buffer.
    Indirect {
        /// The buffer.
        buffer: BufferId,
        /// First byte of the ranges.
        offset: u64,
        /// Whether the ranges are ranges of indices.
        indexed: bool,
        /// Number of the ranges, at most.
        count: u32,
        /// The buffer, and the byte in it, where the number of the ranges lies.
        count_buffer: Option<(BufferId, u64)>,
    },
}

impl Draws {
    /// Whether indices are read.
    pub const fn indexed(&self) -> bool {
        match *self {
            Draws::Direct { indexed, .. } | Draws::Indirect { indexed, .. } => indexed,
        }
    }

    /// The vertices that are drawn. None: a buffer says it.
    pub const fn vertices(&self) -> Option<u64> {
        match self {
            Draws::Direct { range, .. } => Some(range.vertices()),
            Draws::Indirect { .. } => None,
        }
    }
}

impl Command {
    /// The name of the command, as in the text of a trace.
    pub const fn name(&self) -> &'static str {
        self.described().0
    }

    /// What the command draws. None if it draws nothing.
    #[inline]
    pub const fn draws(&self) -> Option<Draws> {
        self.described().1
    }

    /// Whether it draws, computes, copies or clears, so that reports and messages say where it was made.
    pub const fn does_work(&self) -> bool {
        matches!(
            self,
            Command::CopyBufferToBuffer { .. }
                | Command::CopyBufferToTexture { .. }
                | Command::CopyTextureToBuffer { .. }
                | Command::CopyTextureToTexture { .. }
                | Command::ClearBuffer { .. }
                | Command::ClearTexture { .. }
                | Command::ResolveQuerySet { .. }
                | Command::BeginRenderPass { .. }
                | Command::Draw { .. }
                | Command::DrawIndexed { .. }
                | Command::DrawIndirect { .. }
                | Command::Dispatch { .. }
                | Command::DispatchIndirect { .. }
                | Command::ExecuteBundles(_)
        )
    }

    /// The name, and what is drawn. Every command is named here, so that none is forgotten.
    #[inline]
    const fn described(&self) -> (&'static str, Option<Draws>) {
        match *self {
            Command::CreateBuffer { .. } => ("CreateBuffer", None),
            Command::WriteBuffer { .. } => ("WriteBuffer", None),
            Command::CreateTexture { .. } => ("CreateTexture", None),
            Command::WriteTexture { .. } => ("WriteTexture", None),
            Command::CreateView { .. } => ("CreateView", None),
            Command::CreateSampler { .. } => ("CreateSampler", None),
            Command::CreateShader { .. } => ("CreateShader", None),
            Command::CreateBindGroupLayout { .. } => ("CreateBindGroupLayout", None),
            Command::CreatePipelineLayout { .. } => ("CreatePipelineLayout", None),
            Command::CreateBindGroup { .. } => ("CreateBindGroup", None),
            Command::CreateRenderPipeline { .. } => ("CreateRenderPipeline", None),
            Command::CreateComputePipeline { .. } => ("CreateComputePipeline", None),
            Command::GetBindGroupLayout { .. } => ("GetBindGroupLayout", None),
            Command::CreateQuerySet { .. } => ("CreateQuerySet", None),
            Command::Destroy(_) => ("Destroy", None),
            Command::BeginSetup => ("BeginSetup", None),
            Command::EndSetup { .. } => ("EndSetup", None),
            Command::SkipAddresses { .. } => ("SkipAddresses", None),
            Command::RestoreTexture { .. } => ("RestoreTexture", None),
            Command::RestoreQueries { .. } => ("RestoreQueries", None),
            Command::CopyBufferToBuffer { .. } => ("CopyBufferToBuffer", None),
            Command::CopyBufferToTexture { .. } => ("CopyBufferToTexture", None),
            Command::CopyTextureToBuffer { .. } => ("CopyTextureToBuffer", None),
            Command::CopyTextureToTexture { .. } => ("CopyTextureToTexture", None),
            Command::ClearBuffer { .. } => ("ClearBuffer", None),
            Command::ClearTexture { .. } => ("ClearTexture", None),
            Command::WriteTimestamp { .. } => ("WriteTimestamp", None),
            Command::ResolveQuerySet { .. } => ("ResolveQuerySet", None),
            Command::SetSprite { .. } => ("SetSprite", None),
            Command::Present { .. } => ("Present", None),
            Command::BeginRenderPass { .. } => ("BeginRenderPass", None),
            Command::EndRenderPass => ("EndRenderPass", None),
            Command::BeginComputePass { .. } => ("BeginComputePass", None),
            Command::EndComputePass => ("EndComputePass", None),
            Command::BeginBundle { .. } => ("BeginBundle", None),
            Command::EndBundle => ("EndBundle", None),
            Command::SetRenderPipeline(_) => ("SetRenderPipeline", None),
            Command::SetComputePipeline(_) => ("SetComputePipeline", None),
            Command::SetBindGroup { .. } => ("SetBindGroup", None),
            Command::SetImmediates { .. } => ("SetImmediates", None),
            Command::SetIndexBuffer { .. } => ("SetIndexBuffer", None),
            Command::SetVertexBuffer { .. } => ("SetVertexBuffer", None),
            Command::SetViewport(_) => ("SetViewport", None),
            Command::SetScissor(_) => ("SetScissor", None),
            Command::SetBlendConstant(_) => ("SetBlendConstant", None),
            Command::SetStencilReference(_) => ("SetStencilReference", None),
            Command::SetStencilReferences { .. } => ("SetStencilReferences", None),
            Command::Draw { vertices, instances, first_vertex, first_instance } => {
                let range = DrawRange { first: first_vertex, count: vertices, first_instance, instances, ..DrawRange::NONE };
                ("Draw", Some(Draws::Direct { indexed: false, range }))
            }
            Command::DrawIndexed { indices, instances, first_index, base_vertex, first_instance } => {
                let range =
                    DrawRange { first: first_index, count: indices, base_vertex, first_instance, instances, ..DrawRange::NONE };
                ("DrawIndexed", Some(Draws::Direct { indexed: true, range }))
            }
            Command::DrawIndirect { buffer, offset, indexed, count, count_buffer } => {
                ("DrawIndirect", Some(Draws::Indirect { buffer, offset, indexed, count, count_buffer }))
            }
            Command::Dispatch { .. } => ("Dispatch", None),
            Command::DispatchIndirect { .. } => ("DispatchIndirect", None),
            Command::BeginOcclusionQuery { .. } => ("BeginOcclusionQuery", None),
            Command::EndOcclusionQuery => ("EndOcclusionQuery", None),
            Command::BeginStatisticsQuery { .. } => ("BeginStatisticsQuery", None),
            Command::EndStatisticsQuery => ("EndStatisticsQuery", None),
            Command::ExecuteBundles(_) => ("ExecuteBundles", None),
            Command::PushDebugGroup(_) => ("PushDebugGroup", None),
            Command::PopDebugGroup => ("PopDebugGroup", None),
            Command::InsertDebugMarker(_) => ("InsertDebugMarker", None),
            Command::SetCallSite(_) => ("SetCallSite", None),
        }
    }
}
