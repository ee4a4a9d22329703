//! The one state: what the program has made, and the native commands so far.

use std::path::Path;

use gfx::format::Format;
use gfx::state::{Aspect, ViewDimension};
use num::{BufferId, Limits, TextureId, ViewId};
use trace::check::rules;
use trace::command::*;
use trace::record::Recorder;

use super::conversions::Conversions;
use super::fault::{Fault, Log, Outcome, unsupported};
use super::generated::Generated;
use super::groups::Groups;
use super::objects::{Handle, Objects, View, known};
use super::pipelines::Pipelines;
use super::shaders::Shaders;
use super::survey::Stages;

/// Native buffers have this many bytes more than their contents, so that a shader's block may end behind them.
const MARGIN: u64 = 256;

/// The state.
pub struct Vulkan {
    /// Native commands.
    pub card: Recorder,
    /// What the program has made.
    pub objects: Objects,
    /// Shaders that have been translated.
    pub shaders: Shaders,
    /// Pipelines that have been made.
    pub pipelines: Pipelines,
    /// Bind groups that have been made.
    pub groups: Groups,
    /// Pipelines of draws that stand for commands that the card does not have.
    pub generated: Generated,
    /// Dispatches that convert what commands read.
    pub conversions: Conversions,
    /// Debug groups that are open.
    pub debug_groups: u64,
    /// What was refused.
    pub log: Log,
    /// Frames so far.
    pub frames: u64,
    /// A copy of the image that was copied out last, of a program without a window.
    pub copied_out: Option<(TextureId, TextureDesc)>,
    /// The swapchain and the image in it that the frame shows.
    pub presented: Option<(Handle, u64)>,
    /// Whether the program has windows.
    pub windows: bool,
    /// What is allowed.
    pub limits: Limits,
    /// Number of pipelines and shader modules so far.
    pub made: u64,
    /// What is known of the program, for its origin.
    pub facts: Vec<(String, String)>,
    /// The stages of pipelines, if they are asked for.
    pub stages: Option<Stages>,
}

impl Vulkan {
    /// A state without objects; `name` is what messages call the capture.
    pub fn new(name: &Path, limits: &Limits) -> Vulkan {
        Vulkan {
            card: Recorder::new(name),
            objects: Objects::default(),
            shaders: Shaders::default(),
            pipelines: Pipelines::default(),
            groups: Groups::default(),
            generated: Generated::default(),
            conversions: Conversions::default(),
            debug_groups: 0,
            log: Log::default(),
            frames: 0,
            copied_out: None,
            presented: None,
            windows: false,
            limits: *limits,
            made: 0,
            facts: Vec::new(),
            stages: None,
        }
    }

    /// The native buffer of a memory object that has at least its first `end` bytes.
    pub fn memory(&mut self, handle: Handle, end: u64) -> Outcome<BufferId> {
        let memory = known(self.objects.memories.get_mut(handle), "memory object", handle)?;
        if let Some((id, _)) = memory.native.filter(|&(_, bytes)| bytes >= end) {
            return Ok(id);
        }
        // What is suballocated grows from the front, so a large memory object that is used in part stays small here.
        let old = memory.native;
        let wanted = end.max(memory.end).max(old.map_or(0, |(_, bytes)| bytes.saturating_mul(2).min(memory.size)));
        let bytes = wanted.saturating_add(MARGIN).checked_next_multiple_of(MARGIN).unwrap_or(u64::MAX);
        if let Err(error) = self.limits.memory_bytes.check(bytes) {
            return Err(Fault::Limit(format!("memory object {handle}: {error}")));
        }
        let id = self.card.create_buffer("memory", bytes);
        memory.native = Some((id, bytes));
        if let Some((old, bytes)) = old {
            self.card.copy_buffer_to_buffer((old, 0), (id, 0), bytes);
            self.groups.forget_buffer(old, &mut self.card);
            self.card.push(Command::Destroy(Object::Buffer(old)));
        }
        Ok(id)
    }

    /// Makes the native buffers that a list of buffers needs, since a pass must not be interrupted for it.
    pub fn range(&mut self, handle: Handle, offset: u64, size: Option<u64>) -> Outcome<(BufferId, u64, u64)> {
        let buffer = known(self.objects.buffers.get(handle), "buffer", handle)?;
        let Some((memory, first)) = buffer.bound else {
            return Err(Fault::Damaged(format!("buffer {handle} has no memory")));
        };
        let left = buffer.size.checked_sub(offset);
        let size = size.or(left).filter(|&size| left.is_some_and(|left| size <= left));
        let Some(size) = size else {
            let reason = format!("bytes from {offset} of buffer {handle} reach past its {}", buffer.size);
            return Err(Fault::Damaged(reason));
        };
        let whole = first.saturating_add(buffer.size);
        let id = self.memory(memory, whole)?;
        Ok((id, first + offset, size))
    }

    /// The native texture of an image.
    pub fn texture(&mut self, handle: Handle) -> Outcome<TextureId> {
        let image = known(self.objects.images.get_mut(handle), "image", handle)?;
        if let Some(id) = image.native {
            return Ok(id);
        }
        let desc = image.desc.clone()?;
        rules::texture(&desc).map_err(Fault::Unsupported)?;
        let id = self.card.create_texture("image", desc);
        image.native = Some(id);
        Ok(id)
    }

    /// The description of an image's native texture.
    pub fn texture_desc(&self, handle: Handle) -> Outcome<TextureDesc> {
        known(self.objects.images.get(handle), "image", handle)?.desc.clone()
    }

    /// A native view of an image.
    pub fn native_view(&mut self, image: Handle, desc: ViewDesc) -> Outcome<ViewId> {
        let texture = self.texture(image)?;
        let owner = known(self.objects.images.get_mut(image), "image", image)?;
        if let Some(&(_, id)) = owner.views.iter().find(|(known, _)| *known == desc) {
            return Ok(id);
        }
        rules::view(texture, &owner.desc.clone()?, &desc).map_err(Fault::Unsupported)?;
        let id = self.card.create_view_of(texture, desc.clone());
        owner.views.push((desc, id));
        Ok(id)
    }

    /// The native view that shaders read or write.
    pub fn bound_view(&mut self, handle: Handle, storage: bool) -> Outcome<ViewId> {
        let view = known(self.objects.views.get(handle), "image view", handle)?;
        let (image, mut desc, aspects) = (view.image, view.desc.clone(), view.aspects);
        // Shaders exchange channels of other views.
        if storage && view.swizzle.is_some() {
            return unsupported("a storage image whose view exchanges channels");
        }
        let format = self.texture_desc(image)?.format;
        if format.has_depth() && format.has_stencil() {
            let depth = aspects & 2 != 0;
            desc.aspect = if depth { Aspect::DepthOnly } else { Aspect::StencilOnly };
            desc.format = Some(match format {
                _ if !depth => Format::Stencil8,
                Format::Depth24PlusStencil8 => Format::Depth24Plus,
                _ => Format::Depth32Float,
            });
        }
        if storage && desc.levels.is_none_or(|levels| levels > 1) {
            desc.levels = Some(1);
        }
        self.native_view(image, desc)
    }

    /// The native view of one layer, or the slice, of a view that is drawn to, with the slice.
    pub fn target_view(&mut self, handle: Handle, layer: u32) -> Outcome<(ViewId, Option<u32>)> {
        let view = known(self.objects.views.get(handle), "image view", handle)?;
        let View { image, desc, .. } = view;
        let (image, format, level, layer) = (*image, desc.format, desc.base_level, desc.base_layer + layer);
        self.subresource(image, format, level, layer)
    }

    /// The native view of one level and layer, or the slice, of an image.
    pub fn subresource(
        &mut self,
        image: Handle,
        format: Option<Format>,
        level: u32,
        layer: u32,
    ) -> Outcome<(ViewId, Option<u32>)> {
        let owner = self.texture_desc(image)?;
        let format = format.filter(|&format| format != owner.format);
        let desc = ViewDesc { format, base_level: level, levels: Some(1), ..ViewDesc::default() };
        Ok(match owner.dimension {
            gfx::state::TextureDimension::D3 => {
                (self.native_view(image, ViewDesc { dimension: Some(ViewDimension::D3), ..desc })?, Some(layer))
            }
            gfx::state::TextureDimension::D2 => {
                let desc = ViewDesc { dimension: Some(ViewDimension::D2), base_layer: layer, layers: Some(1), ..desc };
                (self.native_view(image, desc)?, None)
            }
            gfx::state::TextureDimension::D1 => return unsupported("drawing to a 1D image"),
        })
    }

    /// Ends an image.
    pub fn destroy_image(&mut self, handle: Handle) {
        let Some(image) = self.objects.images.remove(handle) else { return };
        if let Some((memory, _)) = image.bound
            && let Some(memory) = self.objects.memories.get_mut(memory)
        {
            memory.linear.retain(|&other| other != handle);
        }
        let Some(texture) = image.native else { return };
        for (_, view) in image.views {
            self.groups.forget_view(view, &mut self.card);
            self.card.push(Command::Destroy(Object::View(view)));
        }
        self.card.push(Command::Destroy(Object::Texture(texture)));
    }

    /// Ends a memory object.
    pub fn free_memory(&mut self, handle: Handle) {
        let Some(memory) = self.objects.memories.remove(handle) else { return };
        if let Some((buffer, _)) = memory.native {
            self.groups.forget_buffer(buffer, &mut self.card);
            self.card.push(Command::Destroy(Object::Buffer(buffer)));
        }
    }

    /// Copies linear texels that the program has written into their textures.
    pub fn flush_linear(&mut self) -> Outcome {
        let stale: Vec<Handle> =
            self.objects.images.iter().filter(|(_, image)| image.stale).map(|(handle, _)| handle).collect();
        for handle in stale {
            let image = known(self.objects.images.get_mut(handle), "image", handle)?;
            image.stale = false;
            let (Some((memory, first)), Ok(desc)) = (image.bound, image.desc.clone()) else { continue };
            let Some(texels) = image.texels else {
                return unsupported("an image with linear tiling whose layout the program has not asked for");
            };
            let [width, height, _] = desc.size;
            let offset = first + texels.offset;
            let bytes = texels.row.saturating_mul(height.into());
            let buffer = self.memory(memory, offset.saturating_add(bytes))?;
            let layout = LinearLayout { offset, bytes_per_row: Some(texels.row as u32), rows_per_image: None };
            let texture = self.texture(handle)?;
            let to = TextureEnd { texture, level: 0, origin: [0; 3], aspect: Aspect::All };
            self.card.copy_buffer_to_texture(buffer, layout, to, [width, height, 1]);
        }
        Ok(())
    }
}
