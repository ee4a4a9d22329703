//! The state of a draw, resolved once, and the scratch memory of each thread.

use std::sync::Mutex;

use crate::pipeline::{RenderPipeline, VaryingClass};
use crate::surface::TileSurface;
use gfx::clip::ClipVolume;
use gfx::format::Format;
use gfx::interpolate::Weights;
use gfx::rop::{ColorState, DepthStencilState};
use gfx::setup::{BiasUnit, DepthBias, Screen, SetupState};
use gfx::state::{DepthStencil, Topology};
use gfx::vertex::VertexSource;
use num::{LANES, Lanes, Words};
use shader::{BuiltIn, Executor, Extra, Interpolation, Program, Recorder, Resources, Uniforms};
use work::{Needless, Shade};

use super::super::needs::Need;
use super::pending::Pending;
use super::record::Room;
use super::{DrawCall, DrawError, Drawn, Skips};
use crate::ledger::Ledger;
use num::LimitOverrun;

/// A colour target of a draw.
pub struct FrameTarget {
    /// Which attachment.
    pub location: usize,
    pub state: ColorState,
    /// Output slot and components.
    pub output: (usize, usize),
    pub second: Option<(usize, usize)>,
    /// Words of a stored texel.
    pub words: usize,
    /// First word in the payload.
    pub payload: usize,
    /// Payload words a fragment, and whether they are stored texels.
    pub payload_words: usize,
    pub packed: bool,
    pub payload_second: Option<usize>,
}

/// A draw, checked and prepared: all that its stages read.
pub struct PreparedDraw<'a> {
    pub pipeline: &'a RenderPipeline,
    pub width: u32,
    pub height: u32,
    pub samples: usize,
    pub topology: Topology,
    // Vertices.
    pub vertex_resources: Resources<'a>,
    pub vertex_uniforms: Uniforms,
    pub attribute_sources: Vec<VertexSource<'a>>,
    pub vertex_builtins: &'a [(usize, BuiltIn)],
    pub vertex_in_order: bool,
    pub base_vertex: u32,
    pub first_instance: u32,
    pub draw_index: u32,
    // Primitives.
    pub clip: ClipVolume,
    pub screen: Screen,
    pub setup: SetupState,
    // Fragments.
    pub fragment_resources: Resources<'a>,
    pub fragment_uniforms: Uniforms,
    /// None where nothing reads, writes or kills with it.
    pub depth: Option<DepthStencilState>,
    pub depth_words: usize,
    /// Tests before shading.
    pub early: bool,
    /// Early tests may take whole blocks at once.
    pub tests_blocks: bool,
    /// The fragment program, where one has to run.
    pub fragment: Option<&'a Program>,
    pub classes: &'a [VaryingClass],
    /// Shading needs a triangle's planes, not only its vertices.
    pub needs_triangles: bool,
    pub fragment_builtins: &'a [(usize, BuiltIn)],
    /// 1/w or perspective weights are needed.
    pub per_sample: bool,
    pub helpers: bool,
    pub tiles_in_order: bool,
    /// Samples that may be written.
    pub sample_mask: u32,
    /// Output slot whose alpha turns into coverage.
    pub alpha_output: Option<usize>,
    pub frag_depth: Option<usize>,
    pub mask_output: Option<usize>,
    /// Coverage may shrink in the fragment stage.
    pub shrinks: bool,
    pub targets: Vec<FrameTarget>,
    /// Words of depth in a payload.
    pub depth_payload: usize,
    pub payload_words: usize,
    /// A later opaque fragment hides what was there: earlier ones need not be computed.
    pub overwrites: bool,
    /// Shade what the early test rejects too, for its cost.
    pub shade_covered: bool,
    /// What costs have beside what counts always.
    pub extra: Extra,
    /// What is recorded though it changes no picture.
    pub needless: Needless,
    /// Where work is counted.
    pub ledger: &'a Ledger,
    pub skips: Skips,
}

impl<'a> PreparedDraw<'a> {
    /// The colour output of which payloads have four components and nothing else, if they are such.
    #[inline(always)]
    pub fn sole_color(&self) -> Option<(usize, usize)> {
        match &*self.targets {
            [target] if !target.packed && self.payload_words == 4 => Some(target.output),
            _ => None,
        }
    }

    /// Resolves a call against the attachments of its pass.
    ///
    /// # Errors
    /// If pipeline and attachments do not fit each other.
    pub fn new(
        call: &DrawCall<'a>,
        extent: (u32, u32, u32),
        colors: &[Option<(TileSurface, Format)>],
        depth: Option<&TileSurface>,
    ) -> Result<PreparedDraw<'a>, DrawError> {
        let pipeline = call.pipeline;
        let (width, height, samples) = extent;
        let misfit = |message: String| DrawError::Pipeline { label: pipeline.label.clone(), message };
        if pipeline.samples != samples {
            return Err(misfit(format!("{} samples a pixel in a pass of {samples}", pipeline.samples)));
        }
        let viewport = call.viewport;
        let state = match (&pipeline.depth_stencil, depth) {
            (Some(state), Some(surface)) if state.format != surface.shape().format => {
                let format = surface.shape().format;
                return Err(misfit(format!("depth format {} in a pass with {}", state.format.name(), format.name())));
            }
            (Some(state), Some(_)) => Some(state),
            (Some(state), None) if state.depth_write || state.depth_compare != Default::default() => {
                return Err(misfit("depth state in a pass without a depth attachment".into()));
            }
            _ => None,
        };
        let depth_range = [viewport.min_depth.min(viewport.max_depth), viewport.min_depth.max(viewport.max_depth)];
        let depth_state = state
            .map(|state| DepthStencilState::new(state, call.stencil_reference, depth_range))
            .filter(|state| !state.is_idle());
        let fragment = pipeline.fragment();
        let interface = fragment.map(Program::interface);
        let colored = call.need == Need::Colors;
        let early = pipeline.early && (call.key.early_z || fragment.is_none() || !colored);
        let frag_depth = interface.and_then(|i| i.output(BuiltIn::FragDepth));
        let mask_output = interface.and_then(|i| i.output(BuiltIn::SampleMask));
        let depth_payload = if frag_depth.is_some() { 4 * samples as usize / 4 } else { 0 };
        let (mut targets, mut payload_words) = targets(call, colors, depth_payload).map_err(misfit)?;
        if !colored {
            (targets, payload_words) = (Vec::new(), depth_payload);
        }
        let side_effects = interface.is_some_and(|i| i.side_effects);
        let shrinks = interface.is_some_and(|i| i.discards || i.writes_sample_mask) || pipeline.alpha_to_coverage;
        // Without a target, a test to change or a side effect there is nothing that shading could do.
        let needed = !targets.is_empty() || side_effects || !early || shrinks && call.count_samples;
        let fragment = fragment.filter(|_| needed);
        let first_target = pipeline.targets.first().and_then(Option::as_ref);
        let alpha_output = first_target.filter(|t| t.components == 4).and_then(|t| t.output);
        let plain = targets.iter().all(|t| !t.state.reads());
        let mut setup = SetupState::new(
            (width, height),
            &viewport,
            call.scissor,
            pipeline.primitive.front_face,
            pipeline.primitive.cull_mode,
            samples,
            state.map_or(DepthBias::NONE, bias),
        );
        setup.lower_edges = pipeline.primitive.lower_edges;
        let vertex = pipeline.vertex().interface();
        let uniforms = |program: &Program, resources: &Resources<'_>| program.uniforms(resources);
        let fragment_resources = call.fragment_resources.unwrap_or_default();
        let flat = pipeline.varyings.iter().all(|v| v.interpolation == Interpolation::Flat);
        let fragment_builtins = fragment.map_or(&[][..], |_| &pipeline.builtins[1]);
        let no_builtins = fragment_builtins.is_empty();
        Ok(PreparedDraw {
            pipeline,
            width,
            height,
            samples: samples as usize,
            topology: pipeline.primitive.topology,
            vertex_resources: call.vertex_resources,
            vertex_uniforms: uniforms(pipeline.vertex(), &call.vertex_resources),
            attribute_sources: attribute_sources(call),
            vertex_builtins: &pipeline.builtins[0],
            vertex_in_order: vertex.side_effects,
            base_vertex: if call.index.is_some() { call.range.base_vertex as u32 } else { call.range.first },
            first_instance: call.range.first_instance,
            draw_index: call.range.draw_index,
            clip: ClipVolume::new(&viewport, pipeline.primitive.unclipped_depth),
            screen: Screen::new(&viewport),
            setup,
            fragment_resources,
            fragment_uniforms: fragment.map_or_else(Uniforms::default, |p| uniforms(p, &fragment_resources)),
            depth: depth_state,
            depth_words: depth.map_or(0, |d| d.shape().words()),
            early,
            tests_blocks: depth_state.is_some_and(|d| d.tests_blocks()),
            needs_triangles: !(flat && early && no_builtins),
            classes: fragment.map_or(&[], |_| &pipeline.classes),
            fragment_builtins,
            per_sample: samples > 1 && fragment.is_some_and(|p| p.interface().per_sample),
            helpers: fragment.is_some_and(|p| p.interface().uses_derivatives),
            tiles_in_order: fragment.is_some() && side_effects,
            fragment,
            sample_mask: pipeline.sample_mask & ((1 << samples) - 1),
            alpha_output: alpha_output.filter(|_| pipeline.alpha_to_coverage),
            frag_depth,
            mask_output,
            shrinks,
            overwrites: call.skips.overwritten
                && !call.record
                && plain
                && depth_state.is_none()
                && !side_effects
                && !shrinks
                && !call.count_samples
                && pipeline.sample_mask & ((1 << samples) - 1) == (1 << samples) - 1,
            targets,
            depth_payload,
            payload_words,
            shade_covered: call.record && call.key.shade == Shade::Covered,
            extra: Extra::of(&call.key),
            needless: call.key.needless,
            ledger: call.ledger,
            skips: call.skips,
        })
    }
}

/// Depth bias in the terms of setup.
fn bias(state: &DepthStencil) -> DepthBias {
    let unit = match state.format {
        Format::Depth16Unorm => BiasUnit::Fixed(1.0 / 65535.0),
        Format::Depth24Plus | Format::Depth24PlusStencil8 => BiasUnit::Fixed(1.0 / 16_777_215.0),
        _ => BiasUnit::Float,
    };
    DepthBias { constant: state.bias as f32, slope: state.bias_slope, clamp: state.bias_clamp, unit }
}

fn attribute_sources<'a>(call: &DrawCall<'a>) -> Vec<VertexSource<'a>> {
    static NOTHING: std::sync::OnceLock<Words> = std::sync::OnceLock::new();
    let nothing = NOTHING.get_or_init(Words::default);
    call.pipeline
        .attributes
        .iter()
        .map(|attribute| match call.vertex_buffers.get(attribute.buffer) {
            Some(Some(range)) => {
                VertexSource { words: &range.words, offset: range.offset, size: range.size, stride: attribute.stride }
            }
            // Robust: what is not bound reads as zeros.
            _ => VertexSource { words: nothing, offset: 0, size: 0, stride: attribute.stride },
        })
        .collect()
}

/// The colour targets that the draw writes, and the words of a payload in all.
fn targets(
    call: &DrawCall<'_>,
    colors: &[Option<(TileSurface, Format)>],
    depth_payload: usize,
) -> Result<(Vec<FrameTarget>, usize), String> {
    let mut out = Vec::new();
    let mut payload = 0;
    for (location, target) in call.pipeline.targets.iter().enumerate() {
        let Some(target) = target else { continue };
        let Some(Some((surface, format))) = colors.get(location) else {
            if target.output.is_some() && target.state.write_mask & 15 != 0 {
                return Err(format!("target {location} in a pass without such an attachment"));
            }
            continue;
        };
        if *format != target.state.format {
            return Err(format!("target {location} is {} in a pass with {}", target.state.format.name(), format.name()));
        }
        let state = ColorState::new(&target.state, call.blend_constant);
        let Some(output) = target.output.filter(|_| !state.is_idle()) else { continue };
        let words = surface.shape().words();
        let packed = !state.blends();
        let payload_words = if packed { words } else { 4 };
        let first = depth_payload + payload;
        payload += payload_words;
        let payload_second = target.second.map(|_| depth_payload + payload);
        payload += if target.second.is_some() { 4 } else { 0 };
        out.push(FrameTarget {
            location,
            state,
            output: (output, target.components),
            second: target.second,
            words,
            payload: first,
            payload_words,
            packed,
            payload_second,
        });
    }
    Ok((out, depth_payload + payload))
}

/// Weights of a batch's vertices, and 1/w.
#[derive(Default)]
pub struct FragmentWeights {
    pub weights: Weights,
    pub inv_w: Lanes,
}

/// What a thread keeps from task to task.
#[derive(Default)]
pub struct Worker {
    pub vertex: Executor,
    pub fragment: Executor,
    pub pending: Pending,
    pub weights: FragmentWeights,
    pub recorder: Recorder,
    /// How much was recorded of the last tile.
    pub room: Room,
    /// Counts of the current segment.
    pub drawn: Drawn,
    /// Pairs of tile and triangle, before they are sorted.
    pub pairs: Vec<(u32, u32)>,
}

/// Scratch memory, one a thread of the pool.
pub struct Workers {
    workers: Vec<Mutex<Worker>>,
}

impl Workers {
    /// Scratch for every thread of the current pool, and for one that is not of it.
    pub fn new() -> Workers {
        Workers { workers: (0..=rayon::current_num_threads()).map(|_| Mutex::default()).collect() }
    }

    /// Whether there is one for every thread of the current pool.
    pub fn suffice(&self) -> bool {
        self.workers.len() > rayon::current_num_threads()
    }

    /// Runs a task with the scratch of this thread. The task must not wait for other tasks.
    pub fn with<R>(&self, task: impl FnOnce(&mut Worker) -> R) -> R {
        let at = rayon::current_thread_index().map_or(0, |i| i + 1) % self.workers.len();
        // A poisoned lock means that a task panicked; its scratch holds no invariant that the next one needs.
        let mut worker = self.workers[at].lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        task(&mut worker)
    }

    /// Charges to the ledger the steps of all threads that were not charged yet; whether they are still allowed.
    ///
    /// # Errors
    /// If they are more than the limit.
    pub fn settle(&self, ledger: &Ledger) -> Result<(), LimitOverrun> {
        for worker in &self.workers {
            let mut worker = worker.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            let Worker { vertex, fragment, .. } = &mut *worker;
            ledger.steps.add(vertex.take_steps() + fragment.take_steps());
        }
        ledger.steps.verify()
    }

    /// Takes the counts of all threads, which are sums, and so the same however the work was shared.
    pub fn take_counts(&self) -> Drawn {
        let mut counts = Drawn::default();
        for worker in &self.workers {
            let mut worker = worker.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
            counts += std::mem::take(&mut worker.drawn);
        }
        counts
    }
}

const _: () = assert!(LANES == 64, "masks of blocks are lane masks");
