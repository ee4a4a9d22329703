//! Recording inside passes and bundles. A guard ends what it began when it is dropped.

use gfx::state::{IndexFormat, Rect, Viewport};
use num::*;

use super::super::command::Command;
use super::Recorder;

/// What passes of all kinds can do.
macro_rules! common_methods {
    () => {
        /// Appends any command as it is.
        #[inline]
        pub fn push(&mut self, command: Command) {
            self.recorder.push(command);
        }

        /// Binds a group.
        pub fn set_bind_group(&mut self, index: u32, group: BindGroupId) {
            self.set_bind_group_at(index, group, &[]);
        }

        /// Binds a group with dynamic offsets, one for each dynamic binding in order of binding number.
        #[inline]
        pub fn set_bind_group_at(&mut self, index: u32, group: BindGroupId, offsets: &[u32]) {
            self.push(Command::SetBindGroup { index, group: Some(group), offsets: offsets.to_vec() });
        }

        /// Writes 32-bit words at a byte offset of the immediates.
        pub fn set_immediates(&mut self, offset: u32, words: &[u32]) {
            self.push(Command::SetImmediates { offset, words: words.to_vec() });
        }
    };
}

/// What render passes and bundles can do.
macro_rules! drawing_methods {
    () => {
        common_methods!();

        /// Chooses the pipeline.
        pub fn set_pipeline(&mut self, pipeline: RenderPipelineId) {
            self.push(Command::SetRenderPipeline(pipeline));
        }

        /// Binds a whole buffer to a vertex buffer slot.
        pub fn set_vertex_buffer(&mut self, slot: u32, buffer: BufferId) {
            self.set_vertex_buffer_at(slot, buffer, 0);
        }

        /// Binds a buffer from an offset on to a vertex buffer slot.
        #[inline]
        pub fn set_vertex_buffer_at(&mut self, slot: u32, buffer: BufferId, offset: u64) {
            self.push(Command::SetVertexBuffer { slot, buffer: Some(buffer), offset, size: None });
        }

        /// Binds a whole buffer as indices.
        #[inline]
        pub fn set_index_buffer(&mut self, buffer: BufferId, format: IndexFormat) {
            self.push(Command::SetIndexBuffer { buffer, format, offset: 0, size: None });
        }

        /// Draws vertices 0 up to `vertices`, in `instances` instances.
        pub fn draw(&mut self, vertices: u32, instances: u32) {
            self.draw_from(vertices, instances, 0, 0);
        }

        /// Draws from a first vertex and a first instance on.
        pub fn draw_from(&mut self, vertices: u32, instances: u32, first_vertex: u32, first_instance: u32) {
            self.push(Command::Draw { vertices, instances, first_vertex, first_instance });
        }

        /// Draws all of the first `indices` indices, in `instances` instances.
        pub fn draw_indexed(&mut self, indices: u32, instances: u32) {
            self.draw_indexed_from(indices, instances, 0, 0, 0);
        }

        /// Draws from a first index on, with a number added to every index.
        #[inline]
        pub fn draw_indexed_from(
            &mut self,
            indices: u32,
            instances: u32,
            first_index: u32,
            base_vertex: i32,
            first_instance: u32,
        ) {
            self.push(Command::DrawIndexed { indices, instances, first_index, base_vertex, first_instance });
        }

        /// Draws with arguments from a buffer.
        pub fn draw_indirect(&mut self, buffer: BufferId, offset: u64, indexed: bool) {
            self.push(Command::DrawIndirect { buffer, offset, indexed, count: 1, count_buffer: None });
        }
    };
}

/// A render pass being recorded.
pub struct RenderPass<'a> {
    recorder: &'a mut Recorder,
}

impl<'a> RenderPass<'a> {
    pub(super) fn new(recorder: &'a mut Recorder) -> RenderPass<'a> {
        RenderPass { recorder }
    }

    drawing_methods!();

    /// Sets the viewport.
    pub fn set_viewport(&mut self, viewport: Viewport) {
        self.push(Command::SetViewport(viewport));
    }

    /// Sets the scissor rectangle.
    pub fn set_scissor(&mut self, rect: Rect) {
        self.push(Command::SetScissor(rect));
    }

    /// Sets the blend constant.
    pub fn set_blend_constant(&mut self, color: [f64; 4]) {
        self.push(Command::SetBlendConstant(color));
    }

    /// Sets the stencil reference.
    pub fn set_stencil_reference(&mut self, reference: u32) {
        self.set_stencil_references([reference; 2]);
    }

    /// Sets the stencil references of front and back faces.
    pub fn set_stencil_references(&mut self, references: [u32; 2]) {
        self.push(Command::stencil_references(references));
    }

    /// Executes bundles.
    pub fn execute_bundles(&mut self, bundles: &[BundleId]) {
        self.push(Command::ExecuteBundles(bundles.to_vec()));
    }

    /// Counts the samples that pass while `draws` records.
    pub fn occlusion_query(&mut self, index: u32, draws: impl FnOnce(&mut Self)) {
        self.push(Command::BeginOcclusionQuery { index });
        draws(self);
        self.push(Command::EndOcclusionQuery);
    }
}

impl Drop for RenderPass<'_> {
    fn drop(&mut self) {
        self.push(Command::EndRenderPass);
    }
}

/// A compute pass being recorded.
pub struct ComputePass<'a> {
    recorder: &'a mut Recorder,
}

impl<'a> ComputePass<'a> {
    pub(super) fn new(recorder: &'a mut Recorder) -> ComputePass<'a> {
        ComputePass { recorder }
    }

    common_methods!();

    /// Chooses the pipeline.
    pub fn set_pipeline(&mut self, pipeline: ComputePipelineId) {
        self.push(Command::SetComputePipeline(pipeline));
    }

    /// Runs workgroups.
    pub fn dispatch(&mut self, x: u32, y: u32, z: u32) {
        self.push(Command::Dispatch { groups: [x, y, z] });
    }

    /// Runs workgroups whose numbers are in a buffer.
    pub fn dispatch_indirect(&mut self, buffer: BufferId, offset: u64) {
        self.push(Command::DispatchIndirect { buffer, offset });
    }
}

impl Drop for ComputePass<'_> {
    fn drop(&mut self) {
        self.push(Command::EndComputePass);
    }
}

/// A bundle being recorded.
pub struct BundleEncoder<'a> {
    recorder: &'a mut Recorder,
    id: BundleId,
}

impl<'a> BundleEncoder<'a> {
    pub(super) fn new(recorder: &'a mut Recorder, id: BundleId) -> BundleEncoder<'a> {
        BundleEncoder { recorder, id }
    }

    drawing_methods!();

    /// The bundle's id, for `execute_bundles` once it has ended.
    pub fn id(&self) -> BundleId {
        self.id
    }
}

impl Drop for BundleEncoder<'_> {
    fn drop(&mut self) {
        self.push(Command::EndBundle);
    }
}
