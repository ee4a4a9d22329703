//! Translates actions into commands.

use std::path::Path;

use trace::command::*;
use trace::{Builder, Place, Reading, Trace, TraceError};

use super::blob::Blobs;
use super::lifetime;
use super::objects::{Objects, Reason, Surface};
use wgpu_text::{self as schema, Action, Id};

/// Translates the actions of one trace, in order.
pub struct Translator {
    pub(super) objects: Objects,
    pub(super) blobs: Blobs,
    pub(super) builder: Builder,
    commands: Vec<Command>,
    places: Vec<Place>,
    place: Place,
    dropped: Vec<Object>,
}

impl Translator {
    /// A translator of the trace whose actions are in this file, a text of this number of bytes.
    pub fn new(file: &Path, reading: &Reading, text: u64) -> Translator {
        Translator {
            objects: Objects::new(),
            blobs: Blobs::new(file.parent().unwrap_or(Path::new("")), reading, text),
            builder: Builder::new(file),
            commands: Vec::new(),
            places: Vec::new(),
            place: Place { line: 1, column: 1 },
            dropped: Vec::new(),
        }
    }

    /// The trace.
    pub fn finish(mut self) -> Result<Trace, TraceError> {
        let destroyed = lifetime::destructions(&self.commands, &self.dropped);
        let mut destroyed = destroyed.into_iter().peekable();
        for (index, (command, &place)) in self.commands.into_iter().zip(&self.places).enumerate() {
            self.builder.push_at(command, place);
            while let Some((_, object)) = destroyed.next_if(|&(after, _)| after == index) {
                self.builder.push_at(Command::Destroy(object), place);
            }
        }
        Ok(self.builder.finish())
    }

    /// Appends a command.
    pub(super) fn emit(&mut self, command: Command) {
        self.commands.push(command);
        self.places.push(self.place);
    }

    /// An object that no later action can name.
    pub(super) fn gone(&mut self, object: Option<Object>) {
        self.dropped.extend(object);
    }

    /// Translates one action, which begins at this place.
    pub fn action(&mut self, place: Place, action: Action) -> Result<(), Reason> {
        self.place = place;
        match action {
            Action::Init { .. } => Ok(()),
            // These commands never ran. The objects that they name may be invalid.
            Action::FailedCommands { .. } => Ok(()),

            Action::CreateBuffer(id, desc) => self.create_buffer(id, desc),
            Action::CreateTexture(id, desc) => self.create_texture(id, desc),
            Action::CreateTextureError(id, _) => {
                let old = self.objects.textures.set_invalid(id);
                self.gone(old.map(|old| Object::Texture(old.id)));
                Ok(())
            }
            Action::CreateTextureView { id, parent, desc } => self.create_view(id, parent, desc),
            Action::CreateSampler(id, desc) => self.create_sampler(id, desc),
            Action::CreateQuerySet { id, desc } => self.create_query_set(id, desc),
            Action::CreateBindGroupLayout(id, desc) => self.create_group_layout(id, desc),
            Action::CreateBindGroup(id, desc) => self.create_bind_group(id, desc),
            Action::CreatePipelineLayout(id, desc) => self.create_pipeline_layout(id, desc),
            Action::CreateShaderModule { id, desc, data } => self.create_shader(id, desc.label, data),
            Action::CreateShaderModulePassthrough { id, data, label, .. } => self.create_passthrough(id, label, data),
            Action::CreateComputePipeline { id, desc } => self.create_compute_pipeline(id, *desc),
            Action::CreateGeneralRenderPipeline { id, desc } => self.create_render_pipeline(id, *desc),
            Action::GetRenderPipelineBindGroupLayout { id, pipeline, index } => {
                let pipeline = self.objects.render_pipelines.get(pipeline)?;
                let (native, groups) = (AnyPipeline::Render(pipeline.id), pipeline.groups.clone());
                self.get_group_layout(id, native, groups, index)
            }
            Action::GetComputePipelineBindGroupLayout { id, pipeline, index } => {
                let pipeline = self.objects.compute_pipelines.get(pipeline)?;
                let (native, groups) = (AnyPipeline::Compute(pipeline.id), pipeline.groups.clone());
                self.get_group_layout(id, native, groups, index)
            }
            Action::CreateRenderBundle { id, desc, base } => self.create_bundle(id, desc, base),

            Action::WriteBuffer { id, data, offset, size, queued: _ } => self.write_buffer(id, data, offset, size),
            Action::WriteTexture { to, data, layout, size } => self.write_texture(to, data, layout, size),
            Action::Submit(_, commands) => commands.into_iter().try_for_each(|command| self.command(command)),

            Action::ConfigureSurface(id, desc) => {
                self.configure_surface(id, desc);
                Ok(())
            }
            Action::GetSurfaceTexture { id, parent } => self.acquire(id, parent),
            Action::Present(surface) => {
                let texture = self.objects.surfaces.surface(surface).acquired.take();
                let texture = texture.ok_or("the surface has no texture acquired, so there is none to present")?;
                self.emit(Command::Present { texture });
                self.gone(Some(Object::Texture(texture)));
                Ok(())
            }
            Action::DiscardSurfaceTexture(surface) | Action::ReleaseSurfaceTexture(surface) => {
                let texture = self.objects.surfaces.surface(surface).acquired.take();
                self.gone(texture.map(Object::Texture));
                Ok(())
            }

            Action::CreateExternalTexture { .. } => Err("external textures are not supported".into()),
            Action::CreateBlas { .. } | Action::CreateTlas { .. } => {
                Err("ray tracing (acceleration structures) is not supported".into())
            }
            // A cache does not change what a pipeline does.
            Action::CreatePipelineCache { .. } | Action::DropPipelineCache(_) => Ok(()),

            drop @ (Action::DropBuffer(_)
            | Action::DestroyBuffer(_)
            | Action::DropTexture(_)
            | Action::DestroyTexture(_)
            | Action::DropTextureView(_)
            | Action::DropSampler(_)
            | Action::DropBindGroupLayout(_)
            | Action::DropPipelineLayout(_)
            | Action::DropBindGroup(_)
            | Action::DropShaderModule(_)
            | Action::DropComputePipeline(_)
            | Action::DropRenderPipeline(_)
            | Action::DropRenderBundle(_)
            | Action::DropQuerySet(_)
            | Action::DestroyQuerySet(_)) => {
                self.drop_object(drop);
                Ok(())
            }
            // Their creation is refused, so there is nothing to drop.
            Action::DropExternalTexture(_) | Action::DestroyExternalTexture(_) | Action::DropBlas(_) | Action::DropTlas(_) => {
                Ok(())
            }
        }
    }

    /// Notes that an object was dropped. It stays usable: a submit that was encoded before may come later in the file. A trace also
    /// drops objects that no action creates (derived pipeline layouts): these drops are ignored.
    fn drop_object(&mut self, action: Action) {
        let o = &self.objects;
        let object = match action {
            Action::DropBuffer(id) | Action::DestroyBuffer(id) => o.buffers.find(id).map(|b| Object::Buffer(b.id)),
            Action::DropTexture(id) | Action::DestroyTexture(id) => o.textures.find(id).map(|t| Object::Texture(t.id)),
            Action::DropTextureView(id) => o.views.find(id).map(|v| Object::View(v.id)),
            Action::DropSampler(id) => o.samplers.find(id).map(|&s| Object::Sampler(s)),
            Action::DropBindGroupLayout(id) => o.group_layouts.find(id).map(|l| Object::BindGroupLayout(l.id)),
            Action::DropPipelineLayout(id) => o.pipeline_layouts.find(id).map(|l| Object::PipelineLayout(l.id)),
            Action::DropBindGroup(id) => o.bind_groups.find(id).map(|&g| Object::BindGroup(g)),
            Action::DropShaderModule(id) => o.shaders.find(id).map(|&s| Object::Shader(s)),
            Action::DropComputePipeline(id) => o.compute_pipelines.find(id).map(|p| Object::ComputePipeline(p.id)),
            Action::DropRenderPipeline(id) => o.render_pipelines.find(id).map(|p| Object::RenderPipeline(p.id)),
            Action::DropRenderBundle(id) => o.bundles.find(id).map(|&b| Object::Bundle(b)),
            Action::DropQuerySet(id) | Action::DestroyQuerySet(id) => o.query_sets.find(id).map(|&q| Object::QuerySet(q)),
            _ => None,
        };
        self.gone(object);
    }

    fn configure_surface(&mut self, id: Id, desc: schema::SurfaceConfiguration) {
        let desc = TextureDesc {
            dimension: gfx::state::TextureDimension::D2,
            size: [desc.width, desc.height, 1],
            levels: 1,
            samples: 1,
            format: desc.format.0,
            opaque: false,
        };
        let surface = self.objects.surfaces.surface(id);
        let old = std::mem::replace(surface, Surface { desc: Some(desc), acquired: None });
        self.gone(old.acquired.map(Object::Texture));
    }
}
