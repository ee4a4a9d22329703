//! Commands between passes, and the sizes of copies.

use gfx::state::Aspect;
use trace::command::*;

use super::objects::Reason;
use super::schema;
use super::translate::Translator;

impl Translator {
    /// Translates a command of a command buffer.
    pub(super) fn command(&mut self, command: schema::Command) -> Result<(), Reason> {
        use schema::Command as Wire;
        let command = match command {
            Wire::CopyBufferToBuffer { src, src_offset, dst, dst_offset, size } => {
                let from = self.objects.buffers.get(src)?;
                let rest = from.size.checked_sub(src_offset);
                let size =
                    size.or(rest).ok_or_else(|| format!("copy from offset {src_offset} of a buffer of {} bytes", from.size))?;
                let (from, to) = (from.id, self.objects.buffers.get(dst)?.id);
                Command::CopyBufferToBuffer { from, from_offset: src_offset, to, to_offset: dst_offset, size }
            }
            Wire::CopyBufferToTexture { src, dst, size } => Command::CopyBufferToTexture {
                from: self.objects.buffers.get(src.buffer)?.id,
                layout: layout(src.layout),
                to: self.texture_end(dst)?,
                size: size.into(),
            },
            Wire::CopyTextureToBuffer { src, dst, size } => Command::CopyTextureToBuffer {
                from: self.texture_end(src)?,
                to: self.objects.buffers.get(dst.buffer)?.id,
                layout: layout(dst.layout),
                size: size.into(),
            },
            Wire::CopyTextureToTexture { src, dst, size } => {
                Command::CopyTextureToTexture { from: self.texture_end(src)?, to: self.texture_end(dst)?, size: size.into() }
            }
            Wire::ClearBuffer { dst, offset, size } => {
                Command::ClearBuffer { buffer: self.objects.buffers.get(dst)?.id, offset, size }
            }
            Wire::ClearTexture { dst, subresource_range: range } => Command::ClearTexture {
                texture: self.objects.textures.get(dst)?.id,
                aspect: aspect(range.aspect)?,
                base_level: range.base_mip_level,
                levels: range.mip_level_count,
                base_layer: range.base_array_layer,
                layers: range.array_layer_count,
            },
            Wire::WriteTimestamp { query_set, query_index } => {
                Command::WriteTimestamp { set: *self.objects.query_sets.get(query_set)?, index: query_index }
            }
            Wire::ResolveQuerySet { query_set, start_query, query_count, destination, destination_offset } => {
                Command::ResolveQuerySet {
                    set: *self.objects.query_sets.get(query_set)?,
                    first: start_query,
                    count: query_count,
                    to: self.objects.buffers.get(destination)?.id,
                    to_offset: destination_offset,
                }
            }
            Wire::PushDebugGroup(text) => Command::PushDebugGroup(text),
            Wire::PopDebugGroup => Command::PopDebugGroup,
            Wire::InsertDebugMarker(text) => Command::InsertDebugMarker(text),
            Wire::RunComputePass { pass, timestamp_writes } => return self.compute_pass(pass, timestamp_writes),
            Wire::RunRenderPass {
                pass,
                color_attachments,
                depth_stencil_attachment,
                timestamp_writes,
                occlusion_query_set,
                multiview_mask,
            } => {
                super::pipeline::check_multiview(multiview_mask)?;
                return self.render_pass(
                    pass,
                    color_attachments,
                    depth_stencil_attachment,
                    timestamp_writes,
                    occlusion_query_set,
                );
            }
            Wire::BuildAccelerationStructures { .. } => {
                return Err("ray tracing (acceleration structures) is not supported".into());
            }
            Wire::TransitionResources { .. } => return Ok(()),
        };
        self.emit(command);
        Ok(())
    }

    /// One end of a copy.
    pub(super) fn texture_end(&self, end: schema::TexelCopyTextureInfo) -> Result<TextureEnd, Reason> {
        Ok(TextureEnd {
            texture: self.objects.textures.get(end.texture)?.id,
            level: end.mip_level,
            origin: end.origin.into(),
            aspect: aspect(end.aspect)?,
        })
    }
}

/// An aspect, without those of multi-planar formats.
pub(super) fn aspect(aspect: schema::TextureAspect) -> Result<Aspect, Reason> {
    use schema::TextureAspect as Wire;
    match aspect {
        Wire::All => Ok(Aspect::All),
        Wire::DepthOnly => Ok(Aspect::DepthOnly),
        Wire::StencilOnly => Ok(Aspect::StencilOnly),
        Wire::Plane0 | Wire::Plane1 | Wire::Plane2 => Err("planes of multi-planar textures are not supported".into()),
    }
}

/// How texels lie in a buffer.
pub(super) fn layout(layout: schema::TexelCopyBufferLayout) -> LinearLayout {
    LinearLayout { offset: layout.offset, bytes_per_row: layout.bytes_per_row, rows_per_image: layout.rows_per_image }
}
