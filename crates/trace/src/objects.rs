//! The objects that commands name.

use super::command::{AnyPipeline, BindGroupEntry, BoundResource, Command, Object};

/// Visits each object that a command names. `$visit` is a macro of a kind of [`Object`] and the place of an id; `mut`: ids may be changed.
/// Every command stands here, so that none is forgotten.
macro_rules! visit_objects {
    ($command:ident, $visit:ident $(, $m:tt)?) => {
        match $command {
            Command::CreateBuffer { id, .. } | Command::WriteBuffer { id, .. } => $visit!(Buffer, *id),
            Command::CreateTexture { id, .. } => $visit!(Texture, *id),
            Command::WriteTexture { to, .. } => $visit!(Texture, to.texture),
            Command::CreateView { id, texture, .. } => {
                $visit!(View, *id);
                $visit!(Texture, *texture);
            }
            Command::CreateSampler { id, .. } => $visit!(Sampler, *id),
            Command::CreateShader { id, .. } => $visit!(Shader, *id),
            Command::CreateBindGroupLayout { id, .. } => $visit!(BindGroupLayout, *id),
            Command::CreatePipelineLayout { id, groups, .. } => {
                $visit!(PipelineLayout, *id);
                for group in groups {
                    if let Some(group) = group {
                        $visit!(BindGroupLayout, *group);
                    }
                }
            }
            Command::CreateBindGroup { id, layout, entries } => {
                $visit!(BindGroup, *id);
                $visit!(BindGroupLayout, *layout);
                for BindGroupEntry { resource, .. } in entries {
                    match resource {
                        BoundResource::Buffer { buffer, .. } => $visit!(Buffer, *buffer),
                        BoundResource::View(view) => $visit!(View, *view),
                        BoundResource::Sampler(sampler) => $visit!(Sampler, *sampler),
                        BoundResource::Buffers(all) => {
                            for (buffer, ..) in all {
                                $visit!(Buffer, *buffer);
                            }
                        }
                        BoundResource::Views(all) => {
                            for view in all {
                                $visit!(View, *view);
                            }
                        }
                        BoundResource::Samplers(all) => {
                            for sampler in all {
                                $visit!(Sampler, *sampler);
                            }
                        }
                    }
                }
            }
            Command::CreateRenderPipeline { id, desc, .. } => {
                $visit!(RenderPipeline, *id);
                if let Some(layout) = &$($m)? desc.layout {
                    $visit!(PipelineLayout, *layout);
                }
                $visit!(Shader, desc.vertex.shader);
                if let Some(stage) = &$($m)? desc.fragment {
                    $visit!(Shader, stage.shader);
                }
            }
            Command::CreateComputePipeline { id, layout, stage, .. } => {
                $visit!(ComputePipeline, *id);
                if let Some(layout) = layout {
                    $visit!(PipelineLayout, *layout);
                }
                $visit!(Shader, stage.shader);
            }
            Command::GetBindGroupLayout { id, pipeline, .. } => {
                $visit!(BindGroupLayout, *id);
                match pipeline {
                    AnyPipeline::Render(pipeline) => $visit!(RenderPipeline, *pipeline),
                    AnyPipeline::Compute(pipeline) => $visit!(ComputePipeline, *pipeline),
                }
            }
            Command::CreateQuerySet { id, .. } => $visit!(QuerySet, *id),
            Command::Destroy(object) => match object {
                Object::Buffer(id) => $visit!(Buffer, *id),
                Object::Texture(id) => $visit!(Texture, *id),
                Object::View(id) => $visit!(View, *id),
                Object::Sampler(id) => $visit!(Sampler, *id),
                Object::Shader(id) => $visit!(Shader, *id),
                Object::BindGroupLayout(id) => $visit!(BindGroupLayout, *id),
                Object::PipelineLayout(id) => $visit!(PipelineLayout, *id),
                Object::BindGroup(id) => $visit!(BindGroup, *id),
                Object::RenderPipeline(id) => $visit!(RenderPipeline, *id),
                Object::ComputePipeline(id) => $visit!(ComputePipeline, *id),
                Object::Bundle(id) => $visit!(Bundle, *id),
                Object::QuerySet(id) => $visit!(QuerySet, *id),
            },
            Command::CopyBufferToBuffer { from, to, .. } => {
                $visit!(Buffer, *from);
                $visit!(Buffer, *to);
            }
            Command::CopyBufferToTexture { from, to, .. } => {
                $visit!(Buffer, *from);
                $visit!(Texture, to.texture);
            }
            Command::CopyTextureToBuffer { from, to, .. } => {
                $visit!(Texture, from.texture);
                $visit!(Buffer, *to);
            }
            Command::CopyTextureToTexture { from, to, .. } => {
                $visit!(Texture, from.texture);
                $visit!(Texture, to.texture);
            }
            Command::ClearBuffer { buffer, .. } => $visit!(Buffer, *buffer),
            Command::ClearTexture { texture, .. }
            | Command::RestoreTexture { texture, .. }
            | Command::Present { texture } => $visit!(Texture, *texture),
            Command::RestoreQueries { set, .. }
            | Command::WriteTimestamp { set, .. }
            | Command::BeginStatisticsQuery { set, .. } => $visit!(QuerySet, *set),
            Command::ResolveQuerySet { set, to, .. } => {
                $visit!(QuerySet, *set);
                $visit!(Buffer, *to);
            }
            Command::SetSprite { view, .. } => {
                if let Some(view) = view {
                    $visit!(View, *view);
                }
            }
            Command::BeginRenderPass { color, depth, occlusion, timestamps, .. } => {
                for target in color {
                    if let Some(target) = target {
                        $visit!(View, target.view);
                        if let Some(view) = &$($m)? target.resolve {
                            $visit!(View, *view);
                        }
                    }
                }
                if let Some(depth) = depth {
                    $visit!(View, depth.view);
                }
                if let Some(set) = occlusion {
                    $visit!(QuerySet, *set);
                }
                if let Some(times) = timestamps {
                    $visit!(QuerySet, times.set);
                }
            }
            Command::BeginComputePass { timestamps, .. } => {
                if let Some(times) = timestamps {
                    $visit!(QuerySet, times.set);
                }
            }
            Command::BeginBundle { id } => $visit!(Bundle, *id),
            Command::SetRenderPipeline(id) => $visit!(RenderPipeline, *id),
            Command::SetComputePipeline(id) => $visit!(ComputePipeline, *id),
            Command::SetBindGroup { group, .. } => {
                if let Some(group) = group {
                    $visit!(BindGroup, *group);
                }
            }
            Command::SetIndexBuffer { buffer, .. } | Command::DispatchIndirect { buffer, .. } => $visit!(Buffer, *buffer),
            Command::SetVertexBuffer { buffer, .. } => {
                if let Some(buffer) = buffer {
                    $visit!(Buffer, *buffer);
                }
            }
            Command::DrawIndirect { buffer, count_buffer, .. } => {
                $visit!(Buffer, *buffer);
                if let Some((buffer, _)) = count_buffer {
                    $visit!(Buffer, *buffer);
                }
            }
            Command::ExecuteBundles(bundles) => {
                for bundle in bundles {
                    $visit!(Bundle, *bundle);
                }
            }
            Command::BeginSetup
            | Command::EndSetup { .. }
            | Command::SkipAddresses { .. }
            | Command::EndRenderPass
            | Command::EndComputePass
            | Command::EndBundle
            | Command::SetImmediates { .. }
            | Command::SetViewport(_)
            | Command::SetScissor(_)
            | Command::SetBlendConstant(_)
            | Command::SetStencilReference(_)
            | Command::SetStencilReferences { .. }
            | Command::Draw { .. }
            | Command::DrawIndexed { .. }
            | Command::Dispatch { .. }
            | Command::BeginOcclusionQuery { .. }
            | Command::EndOcclusionQuery
            | Command::EndStatisticsQuery
            | Command::SetCallSite(_)
            | Command::PushDebugGroup(_)
            | Command::PopDebugGroup
            | Command::InsertDebugMarker(_) => {}
        }
    };
}

impl Command {
    /// Calls `see` with each object that the command names, the object that it creates first.
    pub fn for_each_object(&self, mut see: impl FnMut(Object)) {
        macro_rules! visit {
            ($kind:ident, $id:expr) => {
                see(Object::$kind($id))
            };
        }
        visit_objects!(self, visit);
    }

    /// Replaces the id of each object that the command names by what `id_of` answers.
    pub fn renumber(&mut self, mut id_of: impl FnMut(Object) -> u32) {
        macro_rules! visit {
            ($kind:ident, $id:expr) => {
                $id.0 = id_of(Object::$kind($id))
            };
        }
        visit_objects!(self, visit, mut);
    }

    /// The object that the command creates. None if it creates nothing.
    pub fn creates(&self) -> Option<Object> {
        Some(match *self {
            Command::CreateBuffer { id, .. } => Object::Buffer(id),
            Command::CreateTexture { id, .. } => Object::Texture(id),
            Command::CreateView { id, .. } => Object::View(id),
            Command::CreateSampler { id, .. } => Object::Sampler(id),
            Command::CreateShader { id, .. } => Object::Shader(id),
            Command::CreateBindGroupLayout { id, .. } | Command::GetBindGroupLayout { id, .. } => Object::BindGroupLayout(id),
            Command::CreatePipelineLayout { id, .. } => Object::PipelineLayout(id),
            Command::CreateBindGroup { id, .. } => Object::BindGroup(id),
            Command::CreateRenderPipeline { id, .. } => Object::RenderPipeline(id),
            Command::CreateComputePipeline { id, .. } => Object::ComputePipeline(id),
            Command::CreateQuerySet { id, .. } => Object::QuerySet(id),
            Command::BeginBundle { id } => Object::Bundle(id),
            _ => return None,
        })
    }
}
