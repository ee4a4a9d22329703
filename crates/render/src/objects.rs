//! Commands that make and destroy objects, with their claims of memory.

use std::sync::Arc;

use gfx::image::ImageDesc;
use gfx::texture::Sampler;
use host::one_line;
use num::{NoMemory, ShaderId, TextureId, Words};
use shader::{self, Module};
use trace::command::*;

use super::compute::ComputePipeline;
use super::execute::{Fault, Renderer};
use super::ledger::Claim;
use super::memory::texture_bytes;
use super::pipeline::RenderPipeline;
use super::resources::*;

/// Bytes that an object takes beside its contents, about: its entries in tables of the renderer and the checker.
const OBJECT: u64 = 256;

/// Bytes of a shader module for each byte of its source, about.
const MODULE: u64 = 16;

/// Bytes of an operation of a compiled program with what belongs to it, about.
const OPERATION: u64 = 128;

impl Renderer<'_, '_> {
    /// Runs a command that makes or destroys an object, which may stand anywhere.
    pub(super) fn objects(&mut self, command: &Command) -> Result<(), Fault> {
        match command {
            &Command::CreateBuffer { id, size, .. } => {
                self.before(size)?;
                let claim = self.claim("a buffer", size)?;
                self.ledger.bytes.charge(size)?;
                let address = self.addresses.buffer(size)?;
                self.res.buffers.add(id.0, Buffer::new(Words::try_new(size)?, address), claim)?;
            }
            Command::CreateTexture { id, desc, .. } => self.create_texture(*id, desc)?,
            Command::CreateView { id, texture, desc } => {
                let image = self.res.textures.get(texture.0)?.image;
                let view = View::new(*texture, &image, desc)?;
                self.res.views.add(id.0, view, self.claim("a view", 0)?)?;
            }
            Command::CreateSampler { id, desc } => {
                let claim = self.claim("a sampler", 0)?;
                self.res.samplers.add(id.0, Arc::new(Sampler::new(desc)), claim)?;
            }
            Command::CreateShader { id, source, label } => {
                let (shader, claim) = self.load_shader(source, label.as_deref())?;
                self.res.shaders.add(id.0, shader, claim)?;
            }
            Command::CreateBindGroupLayout { id, entries } => {
                let claim = self.claim("a bind group layout", size_of_val(&**entries) as u64)?;
                self.res.bind_group_layouts.add(id.0, entries.clone(), claim)?;
            }
            // The groups of a pipeline layout say nothing that the bind groups, which name their layouts, do not.
            Command::CreatePipelineLayout { id, groups, .. } => {
                for group in groups.iter().flatten() {
                    self.res.bind_group_layouts.get(group.0)?;
                }
                self.res.pipeline_layouts.add(id.0, (), self.claim("a pipeline layout", 0)?)?;
            }
            Command::CreateBindGroup { id, layout, entries } => {
                let elements = |entry: &BindGroupEntry| elements_of(&entry.resource) * size_of::<BoundResource>() as u64;
                let bytes = size_of_val(&**entries) as u64 + entries.iter().map(elements).sum::<u64>();
                let claim = self.claim("a bind group", bytes)?;
                let layout = self.res.bind_group_layouts.get(layout.0)?;
                self.res.bind_groups.add(id.0, BindGroup::new(layout, entries.clone())?, claim)?;
            }
            Command::CreateRenderPipeline { id, desc, label } => {
                let vertex = self.stage_of(desc.vertex.shader)?;
                let fragment = match &desc.fragment {
                    Some(stage) => Some(self.stage_of(stage.shader)?),
                    None => None,
                };
                let label = label.as_deref().unwrap_or_default();
                let mut pipeline = RenderPipeline::new(desc, &vertex, fragment.as_deref(), self.options.key.needless, label)?;
                pipeline.number = self.pipelines;
                self.pipelines += 1;
                let programs = pipeline.programs().iter().map(program_bytes).sum();
                let claim = self.claim("a render pipeline", programs)?;
                self.res.render_pipelines.add(id.0, Arc::new(pipeline), claim)?;
            }
            Command::CreateComputePipeline { id, stage, label, .. } => {
                let module = self.stage_of(stage.shader)?;
                let pipeline = ComputePipeline::new(stage, &module, label.as_deref().unwrap_or_default())?;
                let claim = self.claim("a compute pipeline", program_bytes(pipeline.program()))?;
                self.res.compute_pipelines.add(id.0, Arc::new(pipeline), claim)?;
            }
            Command::GetBindGroupLayout { id, pipeline, group } => {
                let entries = match pipeline {
                    AnyPipeline::Render(pipeline) => self.res.render_pipelines.get(pipeline.0)?.derived_layout(*group),
                    AnyPipeline::Compute(pipeline) => self.res.compute_pipelines.get(pipeline.0)?.derived_layout(*group),
                };
                let claim = self.claim("a bind group layout", size_of_val(&*entries) as u64)?;
                self.res.bind_group_layouts.add(id.0, entries, claim)?;
            }
            &Command::CreateQuerySet { id, kind, count } => {
                let mut set = QuerySet { kind, values: Vec::new() };
                let values = u64::from(count) * set.stride() as u64;
                self.before(8 * values)?;
                let claim = self.claim("a query set", 8 * values)?;
                self.ledger.bytes.charge(8 * values)?;
                set.values.try_reserve_exact(values as usize).map_err(|_| NoMemory { bytes: 8 * values })?;
                set.values.resize(values as usize, 0);
                self.res.query_sets.add(id.0, set, claim)?;
            }
            Command::Destroy(object) => self.destroy(*object)?,
            command => return Err(format!("{} is about no object", command.name()).into()),
        }
        Ok(())
    }

    fn create_texture(&mut self, id: TextureId, desc: &TextureDesc) -> Result<(), Fault> {
        let image = ImageDesc {
            dimension: desc.dimension,
            size: desc.size,
            levels: desc.levels,
            samples: desc.samples,
            format: desc.format,
        };
        self.before(image.bytes())?;
        let claim = self.claim("a texture", image.bytes())?;
        self.ledger.bytes.charge(image.bytes())?;
        let address = self.addresses.texture(texture_bytes(&image))?;
        let words = Arc::new(Words::try_new(image.bytes())?);
        let texture = Texture { image, words, address, version: 0, opaque: desc.opaque, images: Default::default() };
        Ok(self.res.textures.add(id.0, texture, claim)?)
    }

    /// Claims the memory of an object whose contents take so many bytes.
    pub(super) fn claim(&self, what: &str, bytes: u64) -> Result<Claim, Fault> {
        Ok(self.ledger.claim(what, bytes.saturating_add(OBJECT))?)
    }

    /// The module of a stage that is about to be compiled.
    fn stage_of(&self, id: ShaderId) -> Result<Arc<Module>, Fault> {
        let shader = self.res.shaders.get(id.0)?;
        self.ledger.sources.charge(shader.bytes)?;
        Ok(shader.module.clone())
    }

    fn load_shader(&self, source: &ShaderSource, label: Option<&str>) -> Result<(Shader, Claim), Fault> {
        let (ShaderSource::Wgsl(name) | ShaderSource::SpirV(name) | ShaderSource::NagaIr(name)) = source;
        let (words, letters);
        let text = match source {
            ShaderSource::SpirV(_) => {
                words = self.trace.blob(name)?;
                shader::Source::SpirV(&words)
            }
            ShaderSource::Wgsl(_) => {
                letters = self.trace.text(name)?;
                shader::Source::Wgsl(&letters)
            }
            ShaderSource::NagaIr(_) => {
                letters = self.trace.text(name)?;
                shader::Source::NagaIr(&letters)
            }
        };
        let title = label.map_or_else(|| name.clone(), |label| format!("{name} ({})", one_line(label)));
        let bytes = match text {
            shader::Source::Wgsl(text) | shader::Source::NagaIr(text) => text.len(),
            shader::Source::SpirV(bytes) => bytes.len(),
        } as u64;
        self.ledger.sources.charge(bytes)?;
        let claim = self.claim("a shader", bytes.saturating_mul(MODULE))?;
        let module = Module::with_limits(&title, text, self.trace.limits()).map_err(|error| error.to_string())?;
        Ok((Shader { module: Arc::new(module), bytes }, claim))
    }

    fn destroy(&mut self, object: Object) -> Result<(), Fault> {
        match object {
            Object::Buffer(id) => drop(self.res.buffers.remove(id.0)?),
            Object::Texture(id) => drop(self.res.textures.remove(id.0)?),
            Object::View(id) => drop(self.res.views.remove(id.0)?),
            Object::Sampler(id) => drop(self.res.samplers.remove(id.0)?),
            Object::Shader(id) => drop(self.res.shaders.remove(id.0)?),
            Object::BindGroupLayout(id) => drop(self.res.bind_group_layouts.remove(id.0)?),
            Object::PipelineLayout(id) => drop(self.res.pipeline_layouts.remove(id.0)?),
            Object::BindGroup(id) => drop(self.res.bind_groups.remove(id.0)?),
            Object::RenderPipeline(id) => drop(self.res.render_pipelines.remove(id.0)?),
            Object::ComputePipeline(id) => drop(self.res.compute_pipelines.remove(id.0)?),
            Object::Bundle(id) => drop(self.res.bundles.remove(id.0)?),
            Object::QuerySet(id) => drop(self.res.query_sets.remove(id.0)?),
        }
        Ok(())
    }
}

/// Elements of a binding array; 1 of what is none.
fn elements_of(resource: &BoundResource) -> u64 {
    match resource {
        BoundResource::Buffers(elements) => elements.len() as u64,
        BoundResource::Views(elements) => elements.len() as u64,
        BoundResource::Samplers(elements) => elements.len() as u64,
        BoundResource::Buffer { .. } | BoundResource::View(_) | BoundResource::Sampler(_) => 1,
    }
}

/// Bytes of a compiled program, about.
fn program_bytes(program: &shader::Program) -> u64 {
    let (body, prologue) = program.operations();
    (body + prologue) as u64 * OPERATION
}

/// Whether a command makes or destroys an object.
pub(super) fn is_about_objects(command: &Command) -> bool {
    matches!(
        command,
        Command::CreateBuffer { .. }
            | Command::CreateTexture { .. }
            | Command::CreateView { .. }
            | Command::CreateSampler { .. }
            | Command::CreateShader { .. }
            | Command::CreateBindGroupLayout { .. }
            | Command::CreatePipelineLayout { .. }
            | Command::CreateBindGroup { .. }
            | Command::CreateRenderPipeline { .. }
            | Command::CreateComputePipeline { .. }
            | Command::GetBindGroupLayout { .. }
            | Command::CreateQuerySet { .. }
            | Command::Destroy(_)
    )
}
