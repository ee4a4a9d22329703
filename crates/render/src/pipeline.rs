//! A render pipeline made ready: programs, how their values are connected, and what its state allows.

use std::sync::Arc;

use gfx::format::{Format, TexelKind};
use gfx::stage::{Stage, StageMap};
use gfx::state::{
    BlendFactor, ColorTarget, DepthStencil, Primitive, StepMode, VertexAttribute, VertexBufferLayout, VertexFormat,
};
use gfx::vertex::{ComponentKind, component_kind};
use host::one_line;
use shader::{
    self, BuiltIn, Connection, InputRegister, Interface, Interpolation, Module, Program, Sampling, Scalar, ShaderError, Slot,
};
use trace::command::RenderPipelineDesc;
use work::{CulledLate, Programs};

/// A vertex attribute that the vertex stage reads.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Attribute {
    /// Vertex buffer slot.
    pub buffer: usize,
    /// Format in memory.
    pub format: VertexFormat,
    /// Bytes from the start of the vertex.
    pub offset: u64,
    /// Bytes from one vertex to the next.
    pub stride: u64,
    /// What advances it.
    pub step: StepMode,
    /// Input slot of the vertex program.
    pub input: usize,
    /// Components that the program reads.
    pub components: usize,
}

/// A value that goes from the geometry stage through the rasteriser to the fragment stage.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Varying {
    /// Output slot of the geometry stage's program.
    pub output: usize,
    /// Input slot of the fragment program.
    pub input: usize,
    /// First word in a vertex's record.
    pub word: usize,
    /// Words.
    pub components: usize,
    /// How it is interpolated.
    pub interpolation: Interpolation,
    /// Where it is interpolated.
    pub sampling: Sampling,
}

/// What a colour target receives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TargetOutput {
    /// The target's state.
    pub state: ColorTarget,
    /// Output slot of the fragment program; none: nothing is written.
    pub output: Option<usize>,
    /// Its components.
    pub components: usize,
    /// Output slot of the second source and its components.
    pub second: Option<(usize, usize)>,
}

/// A render pipeline.
#[derive(Debug)]
pub struct RenderPipeline {
    pub(super) label: String,
    /// Number among all pipelines that the trace creates: no other has it, whatever its id.
    pub(super) number: u64,
    stages: StageMap<Option<PipelineStage>>,
    /// The last stage before the rasteriser.
    geometry: Stage,
    pub(super) attributes: Vec<Attribute>,
    /// Other attributes of its vertex buffers, of which no components are read; none where they are not asked for.
    pub(super) unread: Vec<Attribute>,
    pub(super) varyings: Vec<Varying>,
    /// Words of a vertex's varyings.
    pub(super) varying_words: usize,
    /// The number of interpolated words. Words that no fragment program reads are included if `needless.varyings` asks for them.
    pub(super) interpolated: usize,
    /// Output slot of the position.
    pub(super) position: usize,
    /// Output slot and number of clip distances.
    pub(super) clip_distances: Option<(usize, usize)>,
    pub(super) targets: Vec<Option<TargetOutput>>,
    pub(super) primitive: Primitive,
    pub(super) depth_stencil: Option<DepthStencil>,
    pub(super) samples: u32,
    pub(super) sample_mask: u32,
    pub(super) alpha_to_coverage: bool,
    /// Depth and stencil may be tested (and written) before shading.
    pub(super) early: bool,
    /// The varyings that the fragment program reads.
    pub(super) classes: Vec<VaryingClass>,
}

/// A stage of a pipeline.
#[derive(Debug)]
pub struct PipelineStage {
    /// The compiled program.
    pub program: Program,
    /// The inputs that the card gives: the slot of each, and its meaning.
    pub builtins: Vec<(usize, BuiltIn)>,
}

/// Varyings that are interpolated with the same weights.
#[derive(Debug)]
pub(super) struct VaryingClass {
    pub interpolation: Interpolation,
    pub sampling: Sampling,
    /// The inputs of the fragment program: its registers, and the words of a vertex that go there.
    pub inputs: Vec<(InputRegister, usize)>,
}

/// Groups the varyings by their weights; with one sample per pixel all places are the centre.
fn classes(varyings: &[Varying], program: &Program, samples: u32) -> Vec<VaryingClass> {
    let mut classes: Vec<VaryingClass> = Vec::new();
    for varying in varyings {
        let sampling =
            if samples == 1 || varying.interpolation == Interpolation::Flat { Sampling::Center } else { varying.sampling };
        let read = (0..varying.components)
            .filter_map(|c| Some((program.input_register(varying.input, c)?, varying.word + c)))
            .collect::<Vec<_>>();
        if read.is_empty() {
            continue;
        }
        let same = |c: &&mut VaryingClass| c.interpolation == varying.interpolation && c.sampling == sampling;
        match classes.iter_mut().find(same) {
            Some(class) => class.inputs.extend(read),
            None => classes.push(VaryingClass { interpolation: varying.interpolation, sampling, inputs: read }),
        }
    }
    classes
}

impl PipelineStage {
    fn new(program: Program) -> PipelineStage {
        let builtin = |(at, slot): (usize, &Slot)| match slot.connection {
            Connection::BuiltIn(builtin) if slot.used => Some((at, builtin)),
            _ => None,
        };
        let builtins = program.interface().inputs.iter().enumerate().filter_map(builtin).collect();
        PipelineStage { program, builtins }
    }

    /// Which stage it is.
    pub fn kind(&self) -> Stage {
        self.interface().stage
    }

    /// The interface of its program.
    pub fn interface(&self) -> &Interface {
        self.program.interface()
    }

    /// The locations that the program reads.
    fn read_locations(&self) -> Vec<u32> {
        self.interface().inputs.iter().filter(|slot| slot.used).filter_map(Slot::location).collect()
    }
}

/// A render pipeline cannot be made.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("render pipeline{}: {why}", labelled(.label))]
pub struct PipelineError {
    /// The pipeline's label.
    pub label: String,
    /// What does not compile or fit.
    pub why: Box<Unfit>,
}

fn labelled(label: &str) -> String {
    if label.is_empty() { String::new() } else { format!(" `{}`", one_line(label)) }
}

/// What of a render pipeline does not compile, or does not fit its other parts.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[allow(missing_docs, reason = "the message explains each variant")]
pub enum Unfit {
    #[error(transparent)]
    Shader(#[from] ShaderError),
    #[error("the {} stage's module is missing", .0.name())]
    NoModule(Stage),
    #[error("there is no geometry stage")]
    NoGeometry,
    #[error("the {} stage writes no position", .0.name())]
    NoPosition(Stage),
    #[error("{0} samples per pixel; 1 and 4 are possible")]
    Samples(u32),
    #[error("{} is no depth or stencil format", .0.name())]
    DepthFormat(Format),
    #[error("no vertex buffer gives @location({0}), which the vertex stage reads")]
    NoAttribute(u32),
    #[error("@location({location}) is {} in the vertex buffer and {scalar:?} in the vertex stage", .format.name())]
    Attribute { location: u32, format: VertexFormat, scalar: Scalar },
    #[error("the fragment stage reads @location({location}), which the {} stage does not write", .writer.name())]
    NoVarying { location: u32, writer: Stage },
    #[error(
        "@location({location}) is {:?} x {} in the {} stage and {:?} x {} in the fragment stage",
        from.0, from.1, .writer.name(), to.0, to.1
    )]
    Varying { location: u32, from: (Scalar, u32), writer: Stage, to: (Scalar, u32) },
    #[error("target {location}: {} cannot be rendered to", .format.name())]
    TargetFormat { location: usize, format: Format },
    #[error("target {0} is written, and the fragment stage has no such output")]
    NoOutput(usize),
    #[error("target {location} is {} and the fragment stage writes {scalar:?}", .format.name())]
    Output { location: usize, format: Format, scalar: Scalar },
    #[error("target {0} blends with a second source, and the fragment stage has none")]
    NoSecondSource(usize),
}

impl RenderPipeline {
    /// Its number, and what its programs have of instructions.
    pub(super) fn named(&self) -> Programs {
        let of = |stage: Stage| self.stage(stage).map(|stage| stage.program.instructions()).unwrap_or_default();
        Programs { pipeline: self.number, instructions: StageMap::from_fn(of) }
    }

    /// Compiles and connects the stages of a description, each from its module; of what nobody reads, with what is `needless`.
    ///
    /// # Errors
    /// If a stage does not compile or the parts do not fit each other; the message names what.
    pub fn new(
        desc: &RenderPipelineDesc,
        modules: &StageMap<Option<Arc<Module>>>,
        needless: CulledLate,
        label: &str,
    ) -> Result<Self, PipelineError> {
        Self::build(desc, modules, needless, label).map_err(|why| PipelineError { label: label.to_owned(), why: Box::new(why) })
    }

    fn build(
        desc: &RenderPipelineDesc,
        modules: &StageMap<Option<Arc<Module>>>,
        needless: CulledLate,
        label: &str,
    ) -> Result<Self, Unfit> {
        let written = |(location, target): (usize, &Option<ColorTarget>)| {
            let coverage = location == 0 && desc.multisample.alpha_to_coverage;
            target.filter(|t| t.write_mask & 15 != 0 || coverage).map(|_| location as u32)
        };
        // Outputs that are neither stored nor read are not computed. So the last stage is compiled first.
        let mut stages = StageMap::<Option<PipelineStage>>::default();
        let mut read = Vec::new();
        for (kind, stage) in desc.stages().rev() {
            let module = modules[kind].as_ref().ok_or(Unfit::NoModule(kind))?;
            let outputs = match kind {
                Stage::Vertex => (!needless.varyings).then_some(read),
                Stage::Fragment => Some(desc.targets.iter().enumerate().filter_map(written).collect()),
                Stage::Compute => None,
            };
            let options = shader::Options { constants: &stage.constants, outputs: outputs.as_deref(), ..Default::default() };
            let program = shader::compile(module, kind, stage.entry.as_deref(), &options)?;
            let stage = stages[kind].insert(PipelineStage::new(program));
            read = stage.read_locations();
        }
        let last = stages.values().flatten().rfind(|stage| stage.kind().is_geometry()).ok_or(Unfit::NoGeometry)?;
        let (geometry, outputs) = (last.kind(), last.interface());
        let fragment = stages[Stage::Fragment].as_ref();
        let position = outputs.output(BuiltIn::Position).ok_or(Unfit::NoPosition(geometry))?;
        let clip_distances =
            outputs.output(BuiltIn::ClipDistances).map(|slot| (slot, outputs.outputs[slot].components as usize));
        let attributes = match &stages[Stage::Vertex] {
            Some(vertex) => attributes(desc, vertex.interface())?,
            None => Vec::new(),
        };
        let unread = if needless.attributes { unread(desc, &attributes) } else { Vec::new() };
        let (varyings, varying_words) = match fragment {
            Some(fragment) => connect(last.interface(), fragment.interface())?,
            None => (Vec::new(), 0),
        };
        let written =
            outputs.outputs.iter().filter(|slot| slot.location().is_some()).map(|slot| slot.components as usize).sum();
        let interpolated = if needless.varyings { written } else { varying_words };
        if !matches!(desc.multisample.count, 1 | 4) {
            return Err(Unfit::Samples(desc.multisample.count));
        }
        let targets = targets(desc, fragment.map(PipelineStage::interface))?;
        if let Some(state) = &desc.depth_stencil
            && !state.format.is_depth_stencil()
        {
            return Err(Unfit::DepthFormat(state.format));
        }
        Ok(RenderPipeline {
            classes: fragment.map_or_else(Vec::new, |stage| classes(&varyings, &stage.program, desc.multisample.count)),
            early: early(desc, fragment.map(PipelineStage::interface)),
            label: label.to_owned(),
            number: 0,
            attributes,
            unread,
            varyings,
            varying_words,
            interpolated,
            position,
            clip_distances,
            targets,
            primitive: desc.primitive,
            depth_stencil: desc.depth_stencil,
            samples: desc.multisample.count,
            sample_mask: desc.multisample.mask,
            alpha_to_coverage: desc.multisample.alpha_to_coverage && desc.multisample.count > 1,
            geometry,
            stages,
        })
    }

    /// The stages, in the order in which data flow through them.
    pub fn stages(&self) -> impl Iterator<Item = &PipelineStage> {
        self.stages.values().flatten()
    }

    /// A stage, if the pipeline has it.
    pub fn stage(&self, stage: Stage) -> Option<&PipelineStage> {
        self.stages[stage].as_ref()
    }

    /// The geometry stage: the last one before the rasteriser, which reads its outputs.
    pub fn geometry(&self) -> &PipelineStage {
        self.stages[self.geometry].as_ref().expect("a pipeline has its geometry stage")
    }

    /// The fragment stage. None: depth and stencil only.
    pub fn fragment(&self) -> Option<&PipelineStage> {
        self.stage(Stage::Fragment)
    }

    /// Whether the fragment stage has to run even if its colours are not needed: it decides which samples are covered, or writes memory.
    pub fn shades_for_coverage(&self) -> bool {
        let decides = |i: &Interface| i.side_effects || i.discards || i.writes_sample_mask;
        !self.early || self.alpha_to_coverage || self.fragment().is_some_and(|stage| decides(stage.interface()))
    }

    /// Whether a stage writes memory.
    pub fn has_side_effects(&self) -> bool {
        self.stages().any(|stage| stage.interface().side_effects)
    }
}

/// The attributes that the vertex stage reads.
fn attributes(desc: &RenderPipelineDesc, vertex: &Interface) -> Result<Vec<Attribute>, Unfit> {
    let mut out = Vec::new();
    for (input, slot) in vertex.inputs.iter().enumerate() {
        let Some(location) = slot.location() else { continue };
        let mut found = desc.buffers.iter().enumerate().filter_map(|(buffer, layout)| {
            let layout = layout.as_ref()?;
            let attribute = layout.attributes.iter().find(|a| a.location == location)?;
            Some((buffer, layout, attribute))
        });
        let (buffer, layout, attribute) = found.next().ok_or(Unfit::NoAttribute(location))?;
        let kind = match component_kind(attribute.format) {
            ComponentKind::Float => Scalar::Float,
            ComponentKind::Uint => Scalar::Uint,
            ComponentKind::Sint => Scalar::Sint,
        };
        if kind != slot.scalar {
            return Err(Unfit::Attribute { location, format: attribute.format, scalar: slot.scalar });
        }
        if slot.used {
            out.push(Attribute {
                buffer,
                format: attribute.format,
                offset: attribute.offset,
                stride: layout.stride,
                step: layout.step,
                input,
                components: slot.components as usize,
            });
        }
    }
    Ok(out)
}

/// The attributes of the vertex buffers that are not among those read.
fn unread(desc: &RenderPipelineDesc, read: &[Attribute]) -> Vec<Attribute> {
    let of_buffer = |(buffer, layout): (usize, &Option<VertexBufferLayout>)| {
        let all = layout.iter().flat_map(|layout| layout.attributes.iter().map(move |attribute| (layout, attribute)));
        let attribute = |(layout, attribute): (&VertexBufferLayout, &VertexAttribute)| Attribute {
            buffer,
            format: attribute.format,
            offset: attribute.offset,
            stride: layout.stride,
            step: layout.step,
            input: usize::MAX,
            components: 0,
        };
        all.map(attribute).collect::<Vec<_>>()
    };
    let place = |a: &Attribute| (a.buffer, a.offset, a.format);
    let others = desc.buffers.iter().enumerate().flat_map(of_buffer);
    others.filter(|one| read.iter().all(|known| place(known) != place(one))).collect()
}

/// Matches what the fragment stage reads with what the geometry stage writes.
fn connect(geometry: &Interface, fragment: &Interface) -> Result<(Vec<Varying>, usize), Unfit> {
    let (mut varyings, mut words) = (Vec::new(), 0);
    for (input, slot) in fragment.inputs.iter().enumerate() {
        let &Slot { connection: Connection::Location { location, interpolation, sampling, .. }, components, scalar, used } =
            slot
        else {
            continue;
        };
        // The geometry stage was compiled without the outputs that the fragment stage does not read.
        if !used {
            continue;
        }
        let writer = geometry.stage;
        let output = geometry.output_location(location).ok_or(Unfit::NoVarying { location, writer })?;
        let from = &geometry.outputs[output];
        if from.scalar != scalar || from.components < components {
            let (from, to) = ((from.scalar, from.components), (scalar, components));
            return Err(Unfit::Varying { location, from, writer, to });
        }
        let components = components as usize;
        varyings.push(Varying { output, input, word: words, components, interpolation, sampling });
        words += components;
    }
    Ok((varyings, words))
}

/// Checks the fragment outputs against the targets.
fn targets(desc: &RenderPipelineDesc, fragment: Option<&Interface>) -> Result<Vec<Option<TargetOutput>>, Unfit> {
    let mut out = Vec::new();
    for (location, target) in desc.targets.iter().enumerate() {
        let Some(state) = *target else {
            out.push(None);
            continue;
        };
        let format = state.format;
        if format.is_depth_stencil() || format.is_compressed() || matches!(format, Format::Rgb9e5Ufloat) {
            return Err(Unfit::TargetFormat { location, format });
        }
        let find = |source: u32| {
            let fragment = fragment?;
            let at = fragment.outputs.iter().position(|slot| {
                matches!(slot.connection, Connection::Location { location: l, blend_src, .. }
                    if l == location as u32 && blend_src == source)
            })?;
            Some((at, fragment.outputs[at]))
        };
        let Some((output, slot)) = find(0) else {
            if state.write_mask & 15 != 0 && fragment.is_some() {
                return Err(Unfit::NoOutput(location));
            }
            out.push(Some(TargetOutput { state, output: None, components: 0, second: None }));
            continue;
        };
        let expected = match format.kind() {
            TexelKind::Uint => Scalar::Uint,
            TexelKind::Sint => Scalar::Sint,
            _ => Scalar::Float,
        };
        if slot.scalar != expected {
            return Err(Unfit::Output { location, format, scalar: slot.scalar });
        }
        let dual = state.blend.is_some_and(|b| {
            [b.color.src, b.color.dst, b.alpha.src, b.alpha.dst].iter().any(|f| {
                use BlendFactor::*;
                matches!(f, Src1 | OneMinusSrc1 | Src1Alpha | OneMinusSrc1Alpha)
            })
        });
        let second = find(1).map(|(at, slot)| (at, slot.components as usize));
        if dual && second.is_none() {
            return Err(Unfit::NoSecondSource(location));
        }
        out.push(Some(TargetOutput {
            state,
            output: Some(output),
            components: slot.components as usize,
            second: second.filter(|_| dual),
        }));
    }
    Ok(out)
}

/// Whether testing and writing depth and stencil before shading gives what testing afterwards would.
fn early(desc: &RenderPipelineDesc, fragment: Option<&Interface>) -> bool {
    let Some(fragment) = fragment else { return true };
    if fragment.force_early_depth {
        return true;
    }
    let Some(state) = &desc.depth_stencil else { return true };
    let stencil_writes = state.format.has_stencil() && state.writes_stencil();
    let updates = state.depth_write && state.format.has_depth() || stencil_writes;
    let shrinks =
        fragment.discards || fragment.writes_sample_mask || desc.multisample.alpha_to_coverage && desc.multisample.count > 1;
    // Side effects of fragments that fail the test count, and so do they when the test comes after.
    !(fragment.writes_depth.is_some() || fragment.side_effects || updates && shrinks)
}
