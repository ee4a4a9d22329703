//! Commands that make and destroy objects, with their claims of memory.

use std::sync::Arc;

use gfx::image::ImageDesc;
use gfx::stage::StageMap;
use gfx::texture::Sampler;
use host::one_line;
use num::{BundleId, Limits, NoMemory, TextureId, Words};
use shader::{self, Module};
use trace::command::*;
use work::CulledLate;

use super::compute::ComputePipeline;
use super::deferred::Deferred;
use super::execute::Renderer;
use super::fault::Fault;
use super::ledger::{Claim, Ledger};
use super::memory::texture_bytes;
use super::pipeline::RenderPipeline;
use super::resources::*;
use super::state::StateError;

/// Bytes that an object takes beside its contents, about: its entries in tables of the renderer and the checker.
const OBJECT: u64 = 256;

/// Bytes of a shader module for each byte of its source, about.
const MODULE: u64 = 16;

/// Bytes of an operation of a compiled program with what belongs to it, about.
const OPERATION: u64 = 128;

/// A bundle that is recorded: its commands run where it is executed.
pub(super) struct OpenBundle {
    id: BundleId,
    commands: Vec<Command>,
    claim: Claim,
}

/// The source of a shader module.
#[derive(Debug)]
pub struct ShaderText {
    /// The name of the object in messages.
    title: String,
    source: OwnedSource,
    limits: Limits,
    /// The memory of the text.
    claim: Claim,
}

#[derive(Debug)]
enum OwnedSource {
    Wgsl(String),
    SpirV(trace::Bytes),
    NagaIr(String),
}

impl OwnedSource {
    fn lend(&self) -> shader::ModuleSource<'_> {
        match self {
            OwnedSource::Wgsl(text) => shader::ModuleSource::Wgsl(text),
            OwnedSource::SpirV(bytes) => shader::ModuleSource::SpirV(bytes),
            OwnedSource::NagaIr(text) => shader::ModuleSource::NagaIr(text),
        }
    }
}

/// The description of a render pipeline.
#[derive(Debug)]
pub struct RenderPlan {
    desc: Box<RenderPipelineDesc>,
    label: String,
    /// Its number among all pipelines.
    number: u64,
    shaders: StageMap<Option<Arc<Shader>>>,
    needless: CulledLate,
}

/// The description of a compute pipeline.
#[derive(Debug)]
pub struct ComputePlan {
    stage: StageDesc,
    label: String,
    /// Its number among all pipelines.
    number: u64,
    shader: Arc<Shader>,
}

/// A render pipeline, which is compiled when it is first used.
pub type DeferredRender = Deferred<RenderPlan, RenderPipeline>;

/// A compute pipeline, which is compiled when it is first used.
pub type DeferredCompute = Deferred<ComputePlan, ComputePipeline>;

impl Shader {
    /// The module, for a stage that is about to be compiled.
    fn stage(&self, ledger: &Arc<Ledger>) -> Result<Arc<Module>, Fault> {
        let bytes = self.bytes;
        let module = self.module.get(|ShaderText { title, source, limits, claim: text }| {
            ledger.sources.charge(bytes)?;
            let claim = ledger.claim("a shader", bytes.saturating_mul(MODULE))?;
            let module = Module::with_limits(&title, source.lend(), &limits)?;
            ledger.sources.charge(module.work() - bytes)?;
            drop((source, text));
            Ok((module, claim))
        })?;
        ledger.sources.charge(bytes)?;
        Ok(module)
    }
}

impl Resources {
    /// A render pipeline that a draw uses. The first one compiles it.
    pub(super) fn render_pipeline(&self, id: u32) -> Result<Arc<RenderPipeline>, Fault> {
        let ledger = &self.ledger;
        self.render_pipelines.get(id)?.get(|RenderPlan { desc, label, number, shaders, needless }| {
            let mut modules = StageMap::default();
            for (module, shader) in modules.values_mut().zip(shaders.values()) {
                *module = shader.as_ref().map(|shader| shader.stage(ledger)).transpose()?;
            }
            let mut pipeline = RenderPipeline::new(&desc, &modules, needless, &label)?;
            pipeline.number = number;
            let programs = pipeline.stages().map(|stage| program_bytes(&stage.program)).sum();
            let claim = ledger.claim("a render pipeline", programs)?;
            Ok((pipeline, claim))
        })
    }

    /// A compute pipeline that a dispatch uses. The first one compiles it.
    pub(super) fn compute_pipeline(&self, id: u32) -> Result<Arc<ComputePipeline>, Fault> {
        let ledger = &self.ledger;
        self.compute_pipelines.get(id)?.get(|ComputePlan { stage, label, number, shader }| {
            let mut pipeline = ComputePipeline::new(&stage, &*shader.stage(ledger)?, &label)?;
            pipeline.number = number;
            let claim = ledger.claim("a compute pipeline", program_bytes(pipeline.program()))?;
            Ok((pipeline, claim))
        })
    }
}

impl Renderer<'_, '_> {
    /// Runs a command that makes or destroys an object, or that belongs to a bundle that is recorded. These may stand anywhere, and every
    /// walk over a trace does the same with them. The answer is whether it was such a command.
    pub(super) fn objects(&mut self, command: &Command) -> Result<bool, Fault> {
        if is_about_objects(command) {
            return self.object(command).map(|()| true);
        }
        match (self.bundle.as_mut(), command) {
            (None, &Command::BeginBundle { id }) => {
                self.moment += 1;
                self.bundle = Some(OpenBundle { id, commands: Vec::new(), claim: self.claim("a bundle", 0)? });
            }
            (None, _) => return Ok(false),
            (Some(_), Command::EndBundle) => {
                if let Some(OpenBundle { id, commands, claim }) = self.bundle.take() {
                    self.res.bundles.add(id.0, Arc::new(commands), claim)?;
                }
            }
            (Some(bundle), command) => {
                bundle.claim.grow("a bundle", 2 * size_of::<Command>() as u64 + payload(command))?;
                bundle.commands.push(command.clone());
            }
        }
        Ok(true)
    }

    fn object(&mut self, command: &Command) -> Result<(), Fault> {
        match command {
            &Command::CreateBuffer { id, size, .. } => {
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
                let shader = self.load_shader(source, label.as_deref())?;
                self.res.shaders.add(id.0, Arc::new(shader), self.claim("a shader", 0)?)?;
            }
            Command::CreateBindGroupLayout { id, entries } => {
                let claim = self.claim("a bind group layout", size_of_val(&**entries) as u64)?;
                self.res.bind_group_layouts.add(id.0, Some(entries.clone()), claim)?;
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
                let group = BindGroup::new(layout.as_deref(), entries.clone())?;
                self.res.bind_groups.add(id.0, group, claim)?;
            }
            Command::CreateRenderPipeline { id, desc, label } => {
                let mut shaders = StageMap::default();
                let mut bytes = size_of::<RenderPipelineDesc>() as u64;
                for (kind, stage) in desc.stages() {
                    shaders[kind] = Some(self.res.shaders.get(stage.shader.0)?.clone());
                    bytes += stage_bytes(stage);
                }
                let buffers = desc.buffers.iter().flatten().map(|buffer| size_of_val(&*buffer.attributes) as u64).sum::<u64>();
                let claim = self.claim("a render pipeline", bytes + buffers)?;
                let plan = RenderPlan {
                    desc: desc.clone(),
                    label: label.clone().unwrap_or_default(),
                    number: self.pipelines,
                    shaders,
                    needless: self.options.key.needless,
                };
                self.pipelines += 1;
                let pipeline = Arc::new(Deferred::new(self.ledger.command(), plan));
                self.res.render_pipelines.add(id.0, pipeline, claim)?;
            }
            Command::CreateComputePipeline { id, stage, label, .. } => {
                let shader = self.res.shaders.get(stage.shader.0)?.clone();
                let claim = self.claim("a compute pipeline", stage_bytes(stage))?;
                let plan = ComputePlan {
                    stage: stage.clone(),
                    label: label.clone().unwrap_or_default(),
                    number: self.pipelines,
                    shader,
                };
                self.pipelines += 1;
                let pipeline = Arc::new(Deferred::new(self.ledger.command(), plan));
                self.res.compute_pipelines.add(id.0, pipeline, claim)?;
            }
            Command::GetBindGroupLayout { id, pipeline, .. } => {
                match pipeline {
                    AnyPipeline::Render(pipeline) => self.res.render_pipelines.get(pipeline.0).map(|_| ())?,
                    AnyPipeline::Compute(pipeline) => self.res.compute_pipelines.get(pipeline.0).map(|_| ())?,
                }
                // The bindings that shaders need are known when the pipeline is compiled. Draws and dispatches check their resources against them.
                self.res.bind_group_layouts.add(id.0, None, self.claim("a bind group layout", 0)?)?;
            }
            &Command::CreateQuerySet { id, kind, count } => {
                let mut set = QuerySet { kind, values: Vec::new() };
                let values = u64::from(count) * set.stride() as u64;
                let claim = self.claim("a query set", 8 * values)?;
                self.ledger.bytes.charge(8 * values)?;
                set.values.try_reserve_exact(values as usize).map_err(|_| NoMemory { bytes: 8 * values })?;
                set.values.resize(values as usize, 0);
                self.res.query_sets.add(id.0, set, claim)?;
            }
            Command::Destroy(object) => self.destroy(*object)?,
            &Command::SkipAddresses { to } => self.addresses.skip(to)?,
            command => return Err(StateError::NoObject(command.name()).into()),
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
        let claim = self.claim("a texture", image.bytes())?;
        self.ledger.bytes.charge(image.bytes())?;
        let address = self.addresses.texture(texture_bytes(&image))?;
        let words = Arc::new(Words::try_new(image.bytes())?);
        let texture = Texture { image, words, address, version: 0, opaque: desc.opaque, images: Default::default() };
        Ok(self.res.textures.add(id.0, texture, claim)?)
    }

    /// Claims the memory of an object whose contents take `bytes` bytes.
    pub(super) fn claim(&self, what: &'static str, bytes: u64) -> Result<Claim, Fault> {
        Ok(self.ledger.claim(what, bytes.saturating_add(OBJECT))?)
    }

    fn load_shader(&self, source: &ShaderSource, label: Option<&str>) -> Result<Shader, Fault> {
        let (ShaderSource::Wgsl(name) | ShaderSource::SpirV(name) | ShaderSource::NagaIr(name)) = source;
        let source = match source {
            ShaderSource::SpirV(_) => OwnedSource::SpirV(self.trace.blob(name)?),
            ShaderSource::Wgsl(_) => OwnedSource::Wgsl(self.trace.text(name)?),
            ShaderSource::NagaIr(_) => OwnedSource::NagaIr(self.trace.text(name)?),
        };
        let title = label.map_or_else(|| name.clone(), |label| format!("{name} ({})", one_line(label)));
        let bytes = match source.lend() {
            shader::ModuleSource::Wgsl(text) | shader::ModuleSource::NagaIr(text) => text.len(),
            shader::ModuleSource::SpirV(bytes) => bytes.len(),
        } as u64;
        let claim = self.ledger.claim("a shader's text", bytes)?;
        let text = ShaderText { title, source, limits: *self.trace.limits(), claim };
        Ok(Shader { module: Deferred::new(self.ledger.command(), text), bytes })
    }

    fn destroy(&mut self, object: Object) -> Result<(), Fault> {
        match object {
            Object::Buffer(id) => drop(self.res.buffers.remove(id.0)?),
            Object::Texture(id) => {
                drop(self.res.textures.remove(id.0)?);
                self.res.holdings.forget_texture(id.0);
            }
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

/// Bytes that the description of a stage has beside itself, about.
fn stage_bytes(stage: &StageDesc) -> u64 {
    let names = stage.constants.iter().map(|(name, _)| name.len()).sum::<usize>();
    let entry = stage.entry.as_ref().map_or(0, String::len);
    (size_of::<StageDesc>() + names + entry + size_of_val(&*stage.constants)) as u64
}

/// Bytes that a command of a bundle has beside itself.
fn payload(command: &Command) -> u64 {
    (match command {
        Command::SetBindGroup { offsets, .. } => size_of_val(&**offsets),
        Command::SetImmediates { words, .. } => size_of_val(&**words),
        Command::PushDebugGroup(text) | Command::InsertDebugMarker(text) => text.len(),
        _ => 0,
    }) as u64
}

/// Bytes of a compiled program, about.
fn program_bytes(program: &shader::Program) -> u64 {
    let (body, prologue) = program.operations();
    (body + prologue) as u64 * OPERATION
}

/// Whether a command makes or destroys an object.
fn is_about_objects(command: &Command) -> bool {
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
            | Command::SkipAddresses { .. }
            | Command::Destroy(_)
    )
}
