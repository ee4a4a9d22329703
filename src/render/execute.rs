//! Runs a trace's commands in order.

use std::collections::{BTreeMap, VecDeque};
use std::ops::Range;
use std::sync::{Arc, Mutex};

use crate::gfx::image::ImageDesc;
use crate::gfx::texture::Sampler;
use crate::num::*;
use crate::shader::{self, Module};
use crate::trace::check::Checker;
use crate::trace::command::*;
use crate::trace::{Trace, TraceError};
use crate::work::{EndFrame, Event, RenderKey, Surface, SurfaceKey, Transfer, TransferKind};

use super::compute::{ActiveCompute, ComputePipeline};
use super::draw::{Boxes, DrawError, Skips};
use super::ledger::{Claim, Held, Ledger, Watch};
use super::memory::{AddressSpace, texture_bytes};
use super::pass::ActivePass;
use super::pipeline::RenderPipeline;
use super::resources::*;
use super::transfer::{Region, clear_image, layers_of};

/// Some of a trace's frames, in ranges.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameSet(Vec<Range<u32>>);

impl FrameSet {
    /// Whether a frame is among them.
    pub fn contains(&self, frame: u32) -> bool {
        self.0.iter().any(|range| range.contains(&frame))
    }

    /// The number behind the last.
    pub fn end(&self) -> u32 {
        self.0.iter().map(|range| range.end).max().unwrap_or(0)
    }

    /// The first of them from a number on.
    pub fn next(&self, from: u32) -> Option<u32> {
        self.0.iter().filter(|range| range.end > from.max(range.start)).map(|range| range.start.max(from)).min()
    }

    /// How many there are, of ranges that do not overlap.
    pub fn count(&self) -> u64 {
        self.0.iter().map(|range| range.len() as u64).sum()
    }
}

impl From<Range<u32>> for FrameSet {
    fn from(range: Range<u32>) -> FrameSet {
        FrameSet(std::iter::once(range).collect())
    }
}

impl FromIterator<Range<u32>> for FrameSet {
    fn from_iter<I: IntoIterator<Item = Range<u32>>>(ranges: I) -> FrameSet {
        FrameSet(ranges.into_iter().collect())
    }
}

/// How a trace is rendered.
#[derive(Clone, Debug)]
pub struct Options {
    /// What the recorded work depends on.
    pub key: RenderKey,
    /// Whether work is recorded; if not, segments carry their funnels only.
    pub record: bool,
    /// Frames whose events are handed on; the others are rendered for what they leave behind.
    pub frames: FrameSet,
    /// Shortcuts that leave the image as it is.
    pub skips: Skips,
    /// What the receiver keeps of the events.
    pub held: Held,
    /// Is told that the rendering begins.
    pub watch: Option<Arc<Watch>>,
}

impl Default for Options {
    fn default() -> Self {
        Options {
            key: RenderKey::default(),
            record: false,
            frames: (0..u32::MAX).into(),
            skips: Skips::default(),
            held: Held::default(),
            watch: None,
        }
    }
}

/// The receiver has had enough: rendering stops without an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stop;

/// Takes events in order.
pub type Sink<'s> = dyn FnMut(Event) -> Result<(), Stop> + 's;

/// Why a command could not be run.
pub(super) enum Fault {
    /// What is wrong.
    Reason(String),
    /// A blob or text of the trace could not be read; the error names it.
    Trace(TraceError),
    /// The receiver stopped.
    Stop,
}

impl From<String> for Fault {
    fn from(reason: String) -> Fault {
        Fault::Reason(reason)
    }
}

impl From<&str> for Fault {
    fn from(reason: &str) -> Fault {
        Fault::Reason(reason.into())
    }
}

impl From<TraceError> for Fault {
    fn from(error: TraceError) -> Fault {
        Fault::Trace(error)
    }
}

impl From<DrawError> for Fault {
    fn from(error: DrawError) -> Fault {
        Fault::Reason(error.to_string())
    }
}

impl From<LimitExceeded> for Fault {
    fn from(error: LimitExceeded) -> Fault {
        Fault::Reason(error.to_string())
    }
}

impl From<LimitOverrun> for Fault {
    fn from(error: LimitOverrun) -> Fault {
        Fault::Reason(error.to_string())
    }
}

impl From<Stop> for Fault {
    fn from(_: Stop) -> Fault {
        Fault::Stop
    }
}

/// What a render came to.
#[derive(Clone, Debug)]
pub struct Summary {
    /// Frames in the trace.
    pub frames: u32,
    /// Commands run.
    pub commands: u64,
    /// Fragments whose colours were not computed ([`Skips::overwritten`]).
    pub overwritten: u64,
    /// What was done, and what was alive.
    pub ledger: Arc<Ledger>,
}

/// Bytes that an object takes beside its contents, about: its entries in tables of the renderer and the checker.
const OBJECT: u64 = 256;

/// Bytes that a frame's statistics take until they are written, about.
const FRAME: u64 = 16 << 10;

/// Bytes of a shader module for each byte of its source, about.
const MODULE: u64 = 16;

/// Bytes of an operation of a compiled program with what belongs to it, about.
const OPERATION: u64 = 128;

/// Renders a trace and hands its work on.
///
/// # Errors
/// If the trace cannot be read, or a command cannot be run; the error names the command.
pub fn render(trace: &Trace, options: &Options, sink: &mut Sink<'_>) -> Result<Summary, TraceError> {
    let ledger = Arc::new(Ledger::new(trace.limits()));
    if let Some(watch) = &options.watch {
        watch.begin(&ledger);
    }
    let mut renderer = Renderer::new(trace, options.clone(), ledger.clone(), sink);
    let mut checker = Checker::new(trace);
    let mut commands = 0;
    let mut result = trace.for_each_command(|index, command| {
        commands = index;
        ledger.begin(index, command.name())?;
        checker.command(index, command)?;
        renderer.run(command)
    });
    if result.is_ok() {
        result = checker.finish().map_err(Fault::Trace).and_then(|_| renderer.finish());
    }
    match result {
        Ok(()) | Err(Fault::Stop) => {
            let frames = renderer.frame.max(u32::from(renderer.implicit_frame));
            Ok(Summary { frames, commands: commands + 1, overwritten: renderer.overwritten, ledger })
        }
        Err(Fault::Reason(reason)) => Err(trace.error_at(commands, format!("{}: {reason}", ledger.command().1))),
        Err(Fault::Trace(error)) if error.command.is_none() => Err(error.in_command(commands)),
        Err(Fault::Trace(error)) => Err(error),
    }
}

/// What is running between a begin and an end.
enum Scope {
    Outside,
    Render(Box<ActivePass>),
    Compute(Box<ActiveCompute>),
    Bundle(BundleId, Vec<Command>, Claim),
}

/// A trace in execution.
pub(super) struct Renderer<'t, 's> {
    trace: &'t Trace,
    pub(super) options: Options,
    pub(super) res: Resources,
    addresses: AddressSpace,
    sink: &'s mut Sink<'s>,
    scope: Scope,
    /// Number of the current frame.
    frame: u32,
    /// The trace had no present, so that its end was the end of frame 0.
    implicit_frame: bool,
    pub(super) passes: u32,
    pub(super) draws: u32,
    /// Fragments whose colours were not computed.
    pub(super) overwritten: u64,
    /// Render pipelines created.
    pipelines: u64,
    pub(super) dispatches: u32,
    /// Commands that count as moments of time, for time stamps.
    pub(super) moment: u64,
    /// What the last texture-to-buffer copy read.
    copied: Option<(TextureId, u32, u32)>,
    /// The last colour target written.
    pub(super) drawn: Option<(TextureId, u32, u32)>,
    /// What tests of bounds know of buffers.
    pub(super) boxes: Arc<Mutex<Boxes>>,
    /// Work, and memory of all that is alive.
    pub(super) ledger: Arc<Ledger>,
    /// Memory of the pieces of work that the receiver may still have, the oldest first.
    pieces: VecDeque<Claim>,
    /// Memory of the images that the receiver keeps.
    images: BTreeMap<SurfaceKey, (u64, Claim)>,
    /// Memory of frames that have ended.
    frames: Option<Claim>,
    /// The image that was shown last, by the address of its texture, and the version of the contents.
    shown: Option<(u64, SurfaceKey, u64, Arc<[u8]>)>,
}

impl<'t, 's> Renderer<'t, 's> {
    fn new<'a: 's>(trace: &'t Trace, options: Options, ledger: Arc<Ledger>, sink: &'s mut Sink<'a>) -> Renderer<'t, 's> {
        Renderer {
            trace,
            options,
            res: Resources::new(ledger.clone()),
            addresses: AddressSpace::new(),
            sink,
            scope: Scope::Outside,
            frame: 0,
            implicit_frame: false,
            passes: 0,
            draws: 0,
            overwritten: 0,
            pipelines: 0,
            dispatches: 0,
            moment: 0,
            copied: None,
            drawn: None,
            boxes: Arc::default(),
            ledger,
            pieces: VecDeque::new(),
            images: BTreeMap::new(),
            frames: None,
            shown: None,
        }
    }

    /// Whether the current frame's events are handed on.
    pub(super) fn in_range(&self) -> bool {
        self.options.frames.contains(self.frame)
    }

    /// Whether work is recorded now.
    pub(super) fn recording(&self) -> bool {
        self.options.record && self.in_range()
    }

    /// Hands an event on, if the frame is wanted.
    pub(super) fn emit(&mut self, event: Event) -> Result<(), Fault> {
        if !self.in_range() {
            return Ok(());
        }
        let piece = match &event {
            Event::Segment(segment) if self.options.record => segment.bytes(),
            Event::Groups(groups) => groups.bytes(),
            Event::Contents(contents) => contents.bytes.len() as u64,
            _ => 0,
        };
        if piece > 0 {
            if self.pieces.len() as u64 >= self.options.held.pieces {
                self.pieces.pop_front();
            }
            self.pieces.push_back(self.ledger.claim("recorded work", piece)?);
        }
        Ok((self.sink)(event)?)
    }

    /// Claims the images that the receiver keeps of an attachment; it keeps them to the end.
    pub(super) fn claim_images(&mut self, surface: &Surface) -> Result<(), Fault> {
        let (texels, copies) = (u64::from(surface.width) * u64::from(surface.height), self.options.held.images);
        // Words of 4 bytes a sample, at least.
        let words = u64::from(surface.samples) * u64::from(surface.format.block_bytes().div_ceil(4));
        let bytes = texels.saturating_mul(4 * words).saturating_mul(copies);
        if bytes == 0 || self.images.get(&surface.key).is_some_and(|(claimed, _)| *claimed == bytes) {
            return Ok(());
        }
        self.images.remove(&surface.key);
        let claim = self.ledger.claim("the machine's images of an attachment", bytes)?;
        self.images.insert(surface.key, (bytes, claim));
        Ok(())
    }

    fn run(&mut self, command: &Command) -> Result<(), Fault> {
        if is_about_objects(command) {
            return self.objects(command);
        }
        match std::mem::replace(&mut self.scope, Scope::Outside) {
            Scope::Outside => self.outside(command),
            Scope::Render(mut pass) => {
                if matches!(command, Command::EndRenderPass) {
                    return pass.end(self);
                }
                let result = pass.run(self, command);
                self.scope = Scope::Render(pass);
                result
            }
            Scope::Compute(mut pass) => {
                if matches!(command, Command::EndComputePass) {
                    return pass.end(self);
                }
                let result = pass.run(self, command);
                self.scope = Scope::Compute(pass);
                result
            }
            Scope::Bundle(id, mut commands, mut claim) => {
                if matches!(command, Command::EndBundle) {
                    return Ok(self.res.bundles.add(id.0, Arc::new(commands), claim)?);
                }
                claim.grow("a bundle", 2 * size_of::<Command>() as u64 + payload(command))?;
                commands.push(command.clone());
                self.scope = Scope::Bundle(id, commands, claim);
                Ok(())
            }
        }
    }

    /// Runs a command that makes or destroys an object, which may stand anywhere.
    fn objects(&mut self, command: &Command) -> Result<(), Fault> {
        match command {
            &Command::CreateBuffer { id, size, .. } => {
                let claim = self.claim("a buffer", size)?;
                self.ledger.bytes.charge(size)?;
                let address = self.addresses.buffer(size)?;
                self.res.buffers.add(id.0, Buffer::new(size, address), claim)?;
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
                let claim = self.claim("a query set", 8 * values)?;
                self.ledger.bytes.charge(8 * values)?;
                set.values.resize(values as usize, 0);
                self.res.query_sets.add(id.0, set, claim)?;
            }
            Command::Destroy(object) => self.destroy(*object)?,
            command => return Err(format!("{} is about no object", command.name()).into()),
        }
        Ok(())
    }

    fn outside(&mut self, command: &Command) -> Result<(), Fault> {
        self.moment += 1;
        match command {
            Command::BeginBundle { id } => self.scope = Scope::Bundle(*id, Vec::new(), self.claim("a bundle", 0)?),
            Command::BeginRenderPass { color, depth, occlusion, timestamps, label } => {
                let label = label.clone().unwrap_or_default();
                let pass = ActivePass::begin(self, color, depth.as_ref(), *occlusion, timestamps.clone(), label)?;
                self.scope = Scope::Render(Box::new(pass));
            }
            Command::BeginComputePass { timestamps, .. } => {
                let pass = ActiveCompute::begin(self, timestamps.clone())?;
                self.scope = Scope::Compute(Box::new(pass));
            }
            Command::PushDebugGroup(_) | Command::PopDebugGroup | Command::InsertDebugMarker(_) => {}
            command => self.transfer(command)?,
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
        let words = Arc::new(Words::new(image.bytes()));
        let texture = Texture { image, words, address, version: 0, images: Default::default() };
        Ok(self.res.textures.add(id.0, texture, claim)?)
    }

    /// Claims the memory of an object whose contents take so many bytes.
    fn claim(&self, what: &str, bytes: u64) -> Result<Claim, Fault> {
        Ok(self.ledger.claim(what, bytes.saturating_add(OBJECT))?)
    }

    /// The module of a stage that is about to be compiled.
    fn stage_of(&self, id: ShaderId) -> Result<Arc<Module>, Fault> {
        let shader = self.res.shaders.get(id.0)?;
        self.ledger.sources.charge(shader.bytes)?;
        Ok(shader.module.clone())
    }

    fn load_shader(&self, source: &ShaderSource, label: Option<&str>) -> Result<(Shader, Claim), Fault> {
        let (name, text) = match source {
            ShaderSource::Wgsl(name) => (name, shader::Source::Wgsl(self.trace.text(name)?)),
            ShaderSource::SpirV(name) => (name, shader::Source::SpirV(self.trace.blob(name)?)),
            ShaderSource::NagaIr(name) => (name, shader::Source::NagaIr(self.trace.text(name)?)),
        };
        let title = label.map_or_else(|| name.clone(), |label| format!("{name} ({label})"));
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

    /// Counts bytes that are about to be moved; whether those of them that wait between reading and writing find room.
    fn moves(&self, bytes: u64, waiting: u64) -> Result<(), Fault> {
        self.ledger.bytes.charge(bytes)?;
        Ok(self.ledger.passing("a copy", waiting)?)
    }

    fn transfer(&mut self, command: &Command) -> Result<(), Fault> {
        let mut moved = Transfer { kind: TransferKind::Copy, from: None, to: None, bytes: 0, surfaces: None };
        match command {
            &Command::WriteBuffer { id, offset, ref data } => {
                let buffer = self.res.buffers.get(id.0)?;
                let bytes = self.trace.data(data)?;
                buffer.range(id, offset, Some(bytes.len() as u64))?;
                self.moves(bytes.len() as u64, 0)?;
                buffer.words.write(offset, bytes);
                buffer.changed();
                moved = Transfer {
                    kind: TransferKind::Upload,
                    to: Some(buffer.address + offset),
                    bytes: bytes.len() as u64,
                    ..moved
                };
            }
            Command::WriteTexture { to, data, layout, size } => {
                let bytes = self.trace.data(data)?;
                let (region, words, address) = self.texture_end(to, *size, true)?;
                self.moves(region.bytes(), 0)?;
                region.write_from(&words, bytes, layout)?;
                moved = Transfer { kind: TransferKind::Upload, to: Some(address), bytes: region.bytes(), ..moved };
            }
            &Command::CopyBufferToBuffer { from, from_offset, to, to_offset, size } => {
                let source = self.res.buffers.get(from.0)?;
                source.range(from, from_offset, Some(size))?;
                let target = self.res.buffers.get(to.0)?;
                target.range(to, to_offset, Some(size))?;
                self.moves(size, size)?;
                copy_words(&source.words, from_offset, &target.words, to_offset, size);
                target.changed();
                moved.from = Some(source.address + from_offset);
                moved.to = Some(target.address + to_offset);
                moved.bytes = size;
            }
            Command::CopyBufferToTexture { from, layout, to, size } => {
                let source = self.res.buffers.get(from.0)?;
                let (source, address) = (source.words.clone(), source.address);
                let (region, words, to_address) = self.texture_end(to, *size, true)?;
                self.moves(region.bytes(), 0)?;
                region.write_from_buffer(&words, &source, layout)?;
                moved.from = Some(address + layout.offset);
                moved.to = Some(to_address);
                moved.bytes = region.bytes();
            }
            Command::CopyTextureToBuffer { from, to, layout, size } => {
                let (region, words, address) = self.texture_end(from, *size, false)?;
                let target = self.res.buffers.get(to.0)?;
                self.moves(region.bytes(), 0)?;
                region.read_to_buffer(&words, &target.words, layout)?;
                target.changed();
                moved.from = Some(address);
                moved.to = Some(target.address + layout.offset);
                moved.bytes = region.bytes();
                self.copied = Some((from.texture, from.level, from.origin[2]));
            }
            Command::CopyTextureToTexture { from, to, size } => self.copy_texture(from, to, *size, &mut moved)?,
            &Command::ClearBuffer { buffer: id, offset, size } => {
                let buffer = self.res.buffers.get(id.0)?;
                let (offset, size) = buffer.range(id, offset, size)?;
                self.moves(size, 0)?;
                fill_zero(&buffer.words, offset, size);
                buffer.changed();
                moved = Transfer { kind: TransferKind::Clear, to: Some(buffer.address + offset), bytes: size, ..moved };
            }
            &Command::ClearTexture { texture: id, aspect, base_level, levels, base_layer, layers } => {
                let image = self.res.textures.get(id.0)?.image;
                let view = ViewDesc { base_level, levels, base_layer, layers, ..ViewDesc::default() };
                let view = View::new(id, &image, &view)?;
                for level in base_level..base_level + view.range.levels {
                    let layers = layers_of(&image, level, base_layer, view.range.layers).len() as u64;
                    self.moves(layers * image.layer_bytes(level), 0)?;
                }
                let texture = self.res.flushed(id)?;
                for level in base_level..base_level + view.range.levels {
                    for layer in layers_of(&image, level, base_layer, view.range.layers) {
                        clear_image(&image, &texture.words, level, layer, aspect);
                        texture.overwritten(level, layer);
                        moved.bytes += image.layer_bytes(level);
                    }
                }
                moved.kind = TransferKind::Clear;
                moved.to = Some(texture.address);
            }
            &Command::WriteTimestamp { set, index } => return self.write_timestamp(set, index),
            &Command::ResolveQuerySet { set: id, first, count, to, to_offset } => {
                let buffer = self.res.buffers.get(to.0)?;
                let (words, address) = (buffer.words.clone(), buffer.address);
                let set = self.res.query_sets.get_mut(id.0)?;
                let size = u64::from(count) * set.stride() as u64 * 8;
                self.ledger.bytes.charge(size)?;
                let target = self.res.buffers.get(to.0)?;
                target.range(to, to_offset, Some(size))?;
                target.changed();
                for index in first..first.saturating_add(count) {
                    let at = to_offset + u64::from(index - first) * set.stride() as u64 * 8;
                    for (k, value) in set.slot(index)?.iter().enumerate() {
                        words.write(at + k as u64 * 8, &value.to_le_bytes());
                    }
                }
                moved = Transfer { kind: TransferKind::Other, to: Some(address + to_offset), bytes: size, ..moved };
            }
            &Command::Present { texture } => {
                self.end_frame(Some((texture, 0, 0)))?;
                self.frame += 1;
                // Nobody asks for what comes after the last frame that is wanted.
                return if self.options.frames.end() > self.frame { Ok(()) } else { Err(Fault::Stop) };
            }
            command => return Err(format!("{} is not possible outside a pass", command.name()).into()),
        }
        Ok(self.emit(Event::Transfer(moved))?)
    }

    fn copy_texture(&mut self, from: &TextureEnd, to: &TextureEnd, size: [u32; 3], moved: &mut Transfer) -> Result<(), Fault> {
        let (source, source_words, source_address) = self.texture_end(from, size, false)?;
        let knows = self.res.textures.get(from.texture.0)?.images.get(&(from.level, from.origin[2]));
        let (knows, drawn) = knows.map_or((false, false), |state| (state.machine_knows, state.drawn));
        let (target, target_words, target_address) = self.texture_end(to, size, true)?;
        // A layer is read whole before it is written.
        self.moves(source.bytes(), source.bytes())?;
        source.copy_to(&source_words, &target, &target_words)?;
        moved.from = Some(source_address);
        moved.to = Some(target_address);
        moved.bytes = source.bytes();
        if knows && source.is_whole_image() && target.is_whole_image() {
            let texture = self.res.textures.get_mut(to.texture.0)?;
            let state = texture.images.entry((to.level, to.origin[2])).or_default();
            state.machine_knows = true;
            state.drawn = drawn;
            let key = |end: &TextureEnd| {
                self.res.textures.get(end.texture.0).map(|t| t.surface(end.texture, end.level, end.origin[2]).key)
            };
            moved.surfaces = Some((key(from)?, key(to)?));
        }
        Ok(())
    }

    /// One end of a copy: the box, the texture's bytes brought up to date, and the address of the image.
    fn texture_end(&mut self, end: &TextureEnd, size: [u32; 3], written: bool) -> Result<(Region, Arc<Words>, u64), Fault> {
        let region = Region::new(&self.res.textures.get(end.texture.0)?.image, end, size)?;
        let texture = self.res.flushed(end.texture)?;
        if written {
            for layer in region.layers() {
                texture.overwritten(end.level, layer);
            }
        }
        let address = texture.surface(end.texture, end.level, end.origin[2]).address;
        Ok((region, texture.words.clone(), address))
    }

    /// Time stamps count commands: no clock is known here, and a trace's results must not depend on the machine.
    pub(super) fn write_timestamp(&mut self, set: QuerySetId, index: u32) -> Result<(), Fault> {
        let moment = self.moment;
        self.res.query_sets.get_mut(set.0)?.slot(index)?[0] = moment;
        Ok(())
    }

    fn end_frame(&mut self, shown: Option<(TextureId, u32, u32)>) -> Result<(), Fault> {
        if !self.in_range() {
            return Ok(());
        }
        let frames = self.frames.take();
        let mut frames = frames.map_or_else(|| self.ledger.claim("the statistics of frames", 0), Ok)?;
        frames.grow("the statistics of a frame", FRAME)?;
        let mut end = EndFrame { number: self.frame, shown: None, reference: Arc::from([]), drawn: false };
        if let Some((id, level, layer)) = shown {
            let texture = self.res.flushed(id)?;
            let surface: Surface = texture.surface(id, level, layer);
            let (address, version, bytes) = (texture.address, texture.version, texture.image.layer_bytes(level));
            end.drawn = texture.images.get(&(level, layer)).is_some_and(|state| state.machine_knows && state.drawn);
            end.shown = Some(surface);
            self.ledger.bytes.charge(bytes)?;
            match &self.shown {
                // What is shown again as it was is one picture.
                Some((at, key, known, bytes)) if (*at, *key, *known) == (address, surface.key, version) => {
                    end.reference = bytes.clone();
                }
                _ => {
                    self.shown = None;
                    match self.options.held.pictures {
                        true => frames.grow("the picture of a frame", bytes)?,
                        false => self.ledger.passing("the picture of a frame", bytes)?,
                    }
                    end.reference = self.res.textures.get(id.0)?.image_bytes(level, layer);
                    self.shown = Some((address, surface.key, version, end.reference.clone()));
                }
            }
        }
        self.frames = Some(frames);
        Ok(self.emit(Event::EndFrame(end))?)
    }

    fn finish(&mut self) -> Result<(), Fault> {
        if !matches!(self.scope, Scope::Outside) {
            return Err("the trace ends inside a pass or bundle".into());
        }
        if self.frame == 0 {
            self.implicit_frame = true;
            let exists = |shown: &(TextureId, u32, u32)| self.res.textures.get(shown.0.0).is_ok();
            let shown = self.copied.filter(exists).or(self.drawn.filter(exists));
            self.end_frame(shown)?;
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

/// Copies bytes between (or inside) buffers as if through a copy.
fn copy_words(from: &Words, from_offset: u64, to: &Words, to_offset: u64, size: u64) {
    let mut bytes = vec![0; size as usize];
    from.read(from_offset, &mut bytes);
    to.write(to_offset, &bytes);
}

fn fill_zero(words: &Words, offset: u64, size: u64) {
    const ZEROS: [u8; 4096] = [0; 4096];
    let mut at = 0;
    while at < size {
        let n = (size - at).min(ZEROS.len() as u64);
        words.write(offset + at, &ZEROS[..n as usize]);
        at += n;
    }
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
            | Command::Destroy(_)
    )
}
