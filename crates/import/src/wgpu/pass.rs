//! Passes and bundles.

use gfx::state::{Rect, Viewport};
use num::*;
use trace::command::*;
use trace::record;

use super::objects::Reason;
use super::pipeline::check_multiview;
use super::schema::{self, DrawCommandFamily, Id, LoadOp, Pass, PassChannel, StoreOp};
use super::translate::Translator;

/// The data that a trace stores beside the commands of a pass.
struct Streams {
    offsets: std::vec::IntoIter<u32>,
    text: Vec<u8>,
    /// Bytes of `text` that have been read.
    taken: usize,
    immediates: Vec<u32>,
}

impl Streams {
    fn new(dynamic_offsets: Vec<u32>, string_data: Vec<u8>, immediates_data: Vec<u32>) -> Streams {
        Streams { offsets: dynamic_offsets.into_iter(), text: string_data, taken: 0, immediates: immediates_data }
    }

    fn offsets(&mut self, count: usize) -> Result<Vec<u32>, Reason> {
        if count > self.offsets.len() {
            return Err(damaged(format!("{count} dynamic offsets are asked for, {} are left", self.offsets.len())));
        }
        Ok(self.offsets.by_ref().take(count).collect())
    }

    fn text(&mut self, length: usize) -> Result<String, Reason> {
        let left = self.text.len() - self.taken;
        if length > left {
            return Err(damaged(format!("a command needs a label of {length} bytes, and {left} bytes of labels are left")));
        }
        let bytes = &self.text[self.taken..self.taken + length];
        let text = std::str::from_utf8(bytes).map_err(|_| damaged("a label is not UTF-8 text".into()))?.to_owned();
        self.taken += length;
        Ok(text)
    }

    fn immediates(&self, bytes: u32, first: Option<u32>) -> Result<Vec<u32>, Reason> {
        if !bytes.is_multiple_of(4) {
            return Err(damaged(format!("{bytes} bytes of immediates are no whole words")));
        }
        let count = (bytes / 4) as usize;
        let Some(first) = first else {
            return zeros(count);
        };
        let words = (first as usize).checked_add(count).and_then(|end| self.immediates.get(first as usize..end));
        words.map(<[u32]>::to_vec).ok_or_else(|| {
            damaged(format!(
                "{count} words of immediates from word {first} on are asked for, there are {}",
                self.immediates.len()
            ))
        })
    }
}

/// The most immediates that a trace may have. A file that states more is damaged, and no memory is allocated for it.
const IMMEDIATE_WORDS_MAX: usize = 1 << 16;

fn zeros(count: usize) -> Result<Vec<u32>, Reason> {
    if count > IMMEDIATE_WORDS_MAX {
        return Err(damaged(format!("{count} words of immediates are more than any device has")));
    }
    Ok(vec![0; count])
}

impl Translator {
    pub(super) fn compute_pass(
        &mut self,
        pass: Pass<schema::ComputeCommand>,
        timestamps: Option<schema::PassTimestampWrites>,
    ) -> Result<(), Reason> {
        let timestamps = self.timestamps(timestamps)?;
        self.emit(Command::BeginComputePass { timestamps, label: pass.label });
        let mut streams = Streams::new(pass.dynamic_offsets, pass.string_data, pass.immediates_data);
        for (index, command) in pass.commands.into_iter().enumerate() {
            self.compute_command(command, &mut streams).map_err(|reason| within(index, reason))?;
        }
        self.emit(Command::EndComputePass);
        Ok(())
    }

    fn compute_command(&mut self, command: schema::ComputeCommand, streams: &mut Streams) -> Result<(), Reason> {
        use schema::ComputeCommand as Wire;
        let command = match command {
            Wire::SetBindGroup { index, num_dynamic_offsets, bind_group } => {
                self.set_bind_group(index, num_dynamic_offsets, bind_group, streams)?
            }
            Wire::SetPipeline(id) => Command::SetComputePipeline(self.objects.compute_pipelines.get(id)?.id),
            Wire::SetImmediate { offset, size_bytes, values_offset } => {
                Command::SetImmediates { offset, words: streams.immediates(size_bytes, Some(values_offset))? }
            }
            Wire::DispatchWorkgroups(groups) => Command::Dispatch { groups },
            Wire::DispatchWorkgroupsIndirect { buffer, offset } => {
                Command::DispatchIndirect { buffer: self.buffer(buffer)?, offset }
            }
            Wire::PushDebugGroup { len, .. } => Command::PushDebugGroup(streams.text(len)?),
            Wire::PopDebugGroup => Command::PopDebugGroup,
            Wire::InsertDebugMarker { len, .. } => Command::InsertDebugMarker(streams.text(len)?),
            Wire::WriteTimestamp { query_set, query_index } => {
                Command::WriteTimestamp { set: *self.objects.query_sets.get(query_set)?, index: query_index }
            }
            Wire::BeginPipelineStatisticsQuery { query_set, query_index } => {
                Command::BeginStatisticsQuery { set: *self.objects.query_sets.get(query_set)?, index: query_index }
            }
            Wire::EndPipelineStatisticsQuery => Command::EndStatisticsQuery,
            Wire::TransitionResources { .. } => return Ok(()),
        };
        self.emit(command);
        Ok(())
    }

    pub(super) fn render_pass(
        &mut self,
        pass: Pass<schema::RenderCommand>,
        colors: Vec<Option<schema::RenderPassColorAttachment>>,
        depth: Option<schema::RenderPassDepthStencilAttachment>,
        timestamps: Option<schema::PassTimestampWrites>,
        occlusion: Option<Id>,
    ) -> Result<(), Reason> {
        let color = |a: schema::RenderPassColorAttachment| {
            Ok::<_, Reason>(ColorAttachment {
                view: self.objects.views.get(a.view)?.id,
                depth_slice: a.depth_slice,
                resolve: a.resolve_target.map(|id| Ok::<_, Reason>(self.objects.views.get(id)?.id)).transpose()?,
                clear: match a.load_op {
                    LoadOp::Clear(color) => Some(color.into()),
                    LoadOp::Load => None,
                },
                store: a.store_op == StoreOp::Store,
            })
        };
        let color = colors.into_iter().map(|slot| slot.map(color).transpose()).collect::<Result<_, _>>()?;
        let begin = Command::BeginRenderPass {
            color,
            depth: depth.map(|depth| self.depth_attachment(depth)).transpose()?,
            occlusion: occlusion.map(|id| self.objects.query_sets.get(id).copied()).transpose()?,
            timestamps: self.timestamps(timestamps)?,
            label: pass.label.clone(),
        };
        self.emit(begin);
        self.render_commands(pass)?;
        self.emit(Command::EndRenderPass);
        Ok(())
    }

    fn depth_attachment(&self, a: schema::RenderPassDepthStencilAttachment) -> Result<DepthAttachment, Reason> {
        let view = self.objects.views.get(a.view)?;
        let mut native = record::load_depth(view.id);
        // wgpu marks an aspect that the format does not have as read-only.
        if view.format.has_depth() {
            (native.depth_clear, native.depth_store, native.depth_read_only) = channel(a.depth);
        }
        if view.format.has_stencil() {
            (native.stencil_clear, native.stencil_store, native.stencil_read_only) = channel(a.stencil);
        }
        Ok(native)
    }

    pub(super) fn create_bundle(
        &mut self,
        desc: schema::RenderBundleDescriptor,
        base: Pass<schema::RenderCommand>,
    ) -> Result<BundleId, Reason> {
        check_multiview(desc.multiview)?;
        let id = self.objects.new_bundle();
        self.emit(Command::BeginBundle { id });
        self.render_commands(base)?;
        self.emit(Command::EndBundle);
        Ok(id)
    }

    fn render_commands(&mut self, pass: Pass<schema::RenderCommand>) -> Result<(), Reason> {
        let mut streams = Streams::new(pass.dynamic_offsets, pass.string_data, pass.immediates_data);
        for (index, command) in pass.commands.into_iter().enumerate() {
            let command = self.render_command(command, &mut streams).map_err(|reason| within(index, reason))?;
            self.emit(command);
        }
        Ok(())
    }

    fn render_command(&self, command: schema::RenderCommand, streams: &mut Streams) -> Result<Command, Reason> {
        use schema::RenderCommand as Wire;
        Ok(match command {
            Wire::SetBindGroup { index, num_dynamic_offsets, bind_group } => {
                self.set_bind_group(index, num_dynamic_offsets, bind_group, streams)?
            }
            Wire::SetPipeline(id) => Command::SetRenderPipeline(self.objects.render_pipelines.get(id)?.id),
            Wire::SetIndexBuffer { buffer, index_format, offset, size } => {
                Command::SetIndexBuffer { buffer: self.buffer(buffer)?, format: index_format.into(), offset, size }
            }
            Wire::SetVertexBuffer { slot, buffer, offset, size } => {
                let buffer = buffer.map(|id| self.buffer(id)).transpose()?;
                Command::SetVertexBuffer { slot, buffer, offset, size }
            }
            Wire::SetBlendConstant(color) => Command::SetBlendConstant(color.into()),
            Wire::SetStencilReference(value) => Command::SetStencilReference(value),
            Wire::SetViewport { rect, depth_min, depth_max } => Command::SetViewport(Viewport {
                x: rect.x,
                y: rect.y,
                width: rect.w,
                height: rect.h,
                min_depth: depth_min,
                max_depth: depth_max,
            }),
            Wire::SetScissor(rect) => Command::SetScissor(Rect { x: rect.x, y: rect.y, width: rect.w, height: rect.h }),
            Wire::SetImmediate { offset, size_bytes, values_offset } => {
                Command::SetImmediates { offset, words: streams.immediates(size_bytes, values_offset)? }
            }
            Wire::Draw { vertex_count, instance_count, first_vertex, first_instance } => {
                Command::Draw { vertices: vertex_count, instances: instance_count, first_vertex, first_instance }
            }
            Wire::DrawIndexed { index_count, instance_count, first_index, base_vertex, first_instance } => {
                Command::DrawIndexed {
                    indices: index_count,
                    instances: instance_count,
                    first_index,
                    base_vertex,
                    first_instance,
                }
            }
            Wire::DrawMeshTasks { .. } => return Err(mesh()),
            Wire::DrawIndirect { buffer, offset, count, family, .. } => Command::DrawIndirect {
                buffer: self.buffer(buffer)?,
                offset,
                indexed: indexed(family)?,
                count,
                count_buffer: None,
            },
            Wire::MultiDrawIndirectCount { buffer, offset, count_buffer, count_buffer_offset, max_count, family } => {
                Command::DrawIndirect {
                    buffer: self.buffer(buffer)?,
                    offset,
                    indexed: indexed(family)?,
                    count: max_count,
                    count_buffer: Some((self.buffer(count_buffer)?, count_buffer_offset)),
                }
            }
            Wire::PushDebugGroup { len, .. } => Command::PushDebugGroup(streams.text(len)?),
            Wire::PopDebugGroup => Command::PopDebugGroup,
            Wire::InsertDebugMarker { len, .. } => Command::InsertDebugMarker(streams.text(len)?),
            Wire::WriteTimestamp { query_set, query_index } => {
                Command::WriteTimestamp { set: *self.objects.query_sets.get(query_set)?, index: query_index }
            }
            Wire::BeginOcclusionQuery { query_index } => Command::BeginOcclusionQuery { index: query_index },
            Wire::EndOcclusionQuery => Command::EndOcclusionQuery,
            Wire::BeginPipelineStatisticsQuery { query_set, query_index } => {
                Command::BeginStatisticsQuery { set: *self.objects.query_sets.get(query_set)?, index: query_index }
            }
            Wire::EndPipelineStatisticsQuery => Command::EndStatisticsQuery,
            Wire::ExecuteBundle(id) => Command::ExecuteBundles(vec![*self.objects.bundles.get(id)?]),
        })
    }

    fn set_bind_group(&self, index: u32, offsets: usize, group: Option<Id>, streams: &mut Streams) -> Result<Command, Reason> {
        let group = group.map(|id| self.objects.bind_groups.get(id).copied()).transpose()?;
        Ok(Command::SetBindGroup { index, group, offsets: streams.offsets(offsets)? })
    }

    fn buffer(&self, id: Id) -> Result<BufferId, Reason> {
        Ok(self.objects.buffers.get(id)?.id)
    }

    fn timestamps(&self, writes: Option<schema::PassTimestampWrites>) -> Result<Option<PassTimestamps>, Reason> {
        let Some(writes) = writes else { return Ok(None) };
        Ok(Some(PassTimestamps {
            set: *self.objects.query_sets.get(writes.query_set)?,
            begin: writes.beginning_of_pass_write_index,
            end: writes.end_of_pass_write_index,
        }))
    }
}

/// Clear value, whether it is stored, whether it is read-only.
fn channel<V>(channel: PassChannel<V>) -> (Option<V>, bool, bool) {
    match channel {
        PassChannel::ReadOnly => (None, true, true),
        PassChannel::Operational(schema::Operations { load, store }) => {
            let clear = match load {
                LoadOp::Clear(value) => Some(value),
                LoadOp::Load => None,
            };
            (clear, store == StoreOp::Store, false)
        }
    }
}

fn indexed(family: DrawCommandFamily) -> Result<bool, Reason> {
    match family {
        DrawCommandFamily::Draw => Ok(false),
        DrawCommandFamily::DrawIndexed => Ok(true),
        DrawCommandFamily::DrawMeshTasks => Err(mesh()),
    }
}

fn mesh() -> Reason {
    "mesh shading is not supported".into()
}

fn within(index: usize, reason: Reason) -> Reason {
    reason.within(format_args!("command {index} of the pass"))
}

/// What no recorder writes.
fn damaged(reason: String) -> Reason {
    Reason::Damaged(reason)
}
