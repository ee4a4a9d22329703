//! The state that draws of one pass with the same pipeline and dynamic state share. Most draws differ from the draw before only in their
//! vertices, their indices, and the resources that they read.

use std::sync::Arc;

use crate::pipeline::{PipelineStage, RenderPipeline};
use crate::surface::Shape;
use gfx::clip::ClipVolume;
use gfx::format::Format;
use gfx::rop::{ColorState, DepthStencilState};
use gfx::setup::{BiasUnit, DepthBias, Screen, SetupState};
use gfx::stage::Stage;
use gfx::state::{DepthStencil, Topology};
use shader::{BuiltIn, Extra, Interpolation};
use work::{RecordedState, Shade};

use super::super::needs::Need;
use super::pass::Misfit;
use super::{DrawError, DynamicState, OpenQueries, PassOptions, record};

/// The cost of traversal and tests of a quad, in steps.
const QUAD_STEPS: u64 = 3;

/// The additional cost of blending a quad in a format that has not four bytes, in steps for each sample of a pixel: each texel is unpacked, blended
/// as floats and packed.
const BLEND_STEPS: u64 = 24;

/// The cost of a quad without its shader, in steps.
fn quad_steps(targets: &[FrameTarget], samples: u32) -> u64 {
    let slow = |target: &&FrameTarget| {
        let format = target.state.format();
        target.state.blends() && !matches!(format, Format::Rgba8Unorm | Format::Bgra8Unorm)
    };
    QUAD_STEPS + BLEND_STEPS * u64::from(samples) * targets.iter().filter(slow).count() as u64
}

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
    /// Payload words per fragment, and whether they are stored texels.
    pub payload_words: usize,
    pub packed: bool,
    pub payload_second: Option<usize>,
}

/// The attachments of a pass, as far as draws are resolved against them.
pub struct Attachments {
    pub width: u32,
    pub height: u32,
    /// Samples per pixel.
    pub samples: u32,
    /// Colour attachments by location, with the format in which they are drawn.
    pub color: Vec<Option<(Shape, Format)>>,
    /// Depth and stencil.
    pub depth: Option<Shape>,
}

/// The state of draws, resolved against the attachments of their pass.
pub struct DrawState {
    pub(super) pipeline: Arc<RenderPipeline>,
    pub(super) dynamic: DynamicState,
    pub(super) queries: OpenQueries,
    pub(super) options: PassOptions,
    /// The same as a machine needs it; none where no work is recorded.
    pub(super) recorded: Option<Arc<RecordedState>>,
    /// Number in the pass, which a change of the pipeline or the dynamic state counts up.
    pub(super) number: u32,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) samples: usize,
    pub(super) topology: Topology,
    pub(super) vertex_in_order: bool,
    // Primitives.
    pub(super) clip: ClipVolume,
    pub(super) screen: Screen,
    pub(super) setup: SetupState,
    // Fragments.
    /// None where nothing reads, writes or kills with it.
    pub(super) depth: Option<DepthStencilState>,
    pub(super) depth_words: usize,
    /// Tests before shading.
    pub(super) early: bool,
    /// Early tests may take whole blocks at once.
    pub(super) tests_blocks: bool,
    /// The fragment program has to run.
    pub(super) shades: bool,
    /// Shading needs a triangle's planes, not only its vertices.
    pub(super) needs_triangles: bool,
    /// 1/w or perspective weights are needed.
    pub(super) per_sample: bool,
    pub(super) helpers: bool,
    pub(super) tiles_in_order: bool,
    /// Samples that may be written.
    pub(super) sample_mask: u32,
    /// Output slot whose alpha turns into coverage.
    pub(super) alpha_output: Option<usize>,
    pub(super) frag_depth: Option<usize>,
    pub(super) mask_output: Option<usize>,
    /// Coverage may shrink in the fragment stage.
    pub(super) shrinks: bool,
    pub(super) targets: Vec<FrameTarget>,
    /// The cost of a quad without its shader, in steps.
    pub(super) quad_steps: u64,
    /// Words of depth in a payload.
    pub(super) depth_payload: usize,
    pub(super) payload_words: usize,
    /// A later opaque fragment hides what was there: earlier ones need not be computed.
    pub(super) overwrites: bool,
    /// What the fragment program writes depends on its inputs alone, and on nothing that differs within a triangle but these.
    pub(super) repeats: bool,
    /// Shade what the early test rejects too: for its cost, or because its fragments are counted.
    pub(super) shade_covered: bool,
    /// The parts of costs that are recorded in addition to what always counts.
    pub(super) extra: Extra,
}

impl DrawState {
    /// Whether the program of a stage has to run.
    pub fn runs(&self, stage: Stage) -> bool {
        match stage {
            Stage::Vertex => true,
            Stage::Fragment => self.shades,
            Stage::Compute => false,
        }
    }

    /// Whether this is the state of draws with this pipeline and dynamic state while these queries are open.
    fn fits(&self, pipeline: &Arc<RenderPipeline>, dynamic: &DynamicState, queries: OpenQueries) -> bool {
        self.same_number(pipeline, dynamic) && self.queries == queries
    }

    /// Whether the state of draws with this pipeline and dynamic state has the same number.
    fn same_number(&self, pipeline: &Arc<RenderPipeline>, dynamic: &DynamicState) -> bool {
        Arc::ptr_eq(&self.pipeline, pipeline) && self.dynamic == *dynamic
    }

    /// The colour output of which payloads have four components and nothing else, if they are such.
    #[inline(always)]
    pub fn sole_color(&self) -> Option<(usize, usize)> {
        match &*self.targets {
            [target] if !target.packed && self.payload_words == 4 => Some(target.output),
            _ => None,
        }
    }

    /// The state of draws with this pipeline and dynamic state while these queries are open. Reuses `last`, the state of the draw before, if
    /// it is the same.
    ///
    /// # Errors
    /// If pipeline and attachments do not fit each other.
    pub(super) fn next(
        last: Option<Arc<DrawState>>,
        pipeline: &Arc<RenderPipeline>,
        dynamic: &DynamicState,
        queries: OpenQueries,
        pass: (&Attachments, &PassOptions),
    ) -> Result<Arc<DrawState>, DrawError> {
        let number = match last {
            Some(last) if last.fits(pipeline, dynamic, queries) => return Ok(last),
            Some(last) => last.number + u32::from(!last.same_number(pipeline, dynamic)),
            None => 1,
        };
        DrawState::new(number, pipeline.clone(), *dynamic, queries, pass).map(Arc::new)
    }

    fn new(
        number: u32,
        pipeline: Arc<RenderPipeline>,
        dynamic: DynamicState,
        queries: OpenQueries,
        (attachments, &options): (&Attachments, &PassOptions),
    ) -> Result<DrawState, DrawError> {
        let &Attachments { width, height, samples, color: ref colors, depth } = attachments;
        let misfit = |misfit| DrawError::Pipeline { label: pipeline.label.clone(), misfit };
        if pipeline.samples != samples {
            return Err(misfit(Misfit::Samples { pipeline: pipeline.samples, pass: samples }));
        }
        let viewport = dynamic.viewport;
        let state = match (&pipeline.depth_stencil, depth) {
            (Some(state), Some(Shape { format, .. })) if state.format != format => {
                return Err(misfit(Misfit::DepthFormat { pipeline: state.format, pass: format }));
            }
            (Some(state), Some(_)) => Some(state),
            (Some(state), None) if state.depth_write || state.depth_compare != Default::default() => {
                return Err(misfit(Misfit::NoDepth));
            }
            _ => None,
        };
        let depth_range = [viewport.min_depth.min(viewport.max_depth), viewport.min_depth.max(viewport.max_depth)];
        let depth_state = state
            .map(|state| DepthStencilState::new(state, dynamic.stencil_references, depth_range))
            .filter(|state| !state.is_idle());
        let fragment = pipeline.fragment();
        let interface = fragment.map(PipelineStage::interface);
        let colored = options.need == Need::Colors;
        let early = pipeline.early && (options.key.early_z || fragment.is_none() || !colored);
        let frag_depth = interface.and_then(|i| i.output(BuiltIn::FragDepth));
        let mask_output = interface.and_then(|i| i.output(BuiltIn::SampleMask));
        let depth_payload = if frag_depth.is_some() { 4 * samples as usize / 4 } else { 0 };
        let (mut targets, mut payload_words) = targets(&pipeline, &dynamic, colors, depth_payload).map_err(misfit)?;
        if !colored {
            (targets, payload_words) = (Vec::new(), depth_payload);
        }
        let side_effects = interface.is_some_and(|i| i.side_effects);
        let shrinks = interface.is_some_and(|i| i.discards || i.writes_sample_mask) || pipeline.alpha_to_coverage;
        // Without a target, a test to change or a side effect there is nothing that shading could do.
        let needed = !targets.is_empty() || side_effects || !early || shrinks && queries.occlusion;
        let fragment = fragment.filter(|_| needed);
        let first_target = pipeline.targets.first().and_then(Option::as_ref);
        let alpha_output = first_target.filter(|t| t.components == 4).and_then(|t| t.output);
        let plain = targets.iter().all(|t| !t.state.reads());
        let mut setup = SetupState::new(
            (width, height),
            &viewport,
            dynamic.scissor,
            pipeline.primitive.front_face,
            pipeline.primitive.cull_mode,
            samples,
            state.map_or(DepthBias::NONE, bias),
        );
        setup.lower_edges = pipeline.primitive.lower_edges;
        setup.unclipped_depth = pipeline.primitive.unclipped_depth;
        // Half of it in 1/256 pixel; the trace's checker knows no width above 255.
        setup.half_width = pipeline.primitive.line_width.map(|width| (width * 128.0).round().clamp(1.0, 32640.0) as u16);
        let flat = pipeline.varyings.iter().all(|v| v.interpolation == Interpolation::Flat);
        let no_builtins = fragment.is_none_or(|stage| stage.builtins.is_empty());
        let of_triangle = |&(_, builtin): &(usize, BuiltIn)| matches!(builtin, BuiltIn::FrontFacing | BuiltIn::PrimitiveIndex);
        let repeats = options.skips.repeated
            && !options.record
            && samples == 1
            && !side_effects
            && !shrinks
            && pipeline.fragment().is_some_and(|stage| !stage.interface().subgroups && stage.builtins.iter().all(of_triangle));
        let all_samples = (1 << samples) - 1;
        let mut made = DrawState {
            number,
            dynamic,
            queries,
            options,
            recorded: None,
            width,
            height,
            samples: samples as usize,
            quad_steps: quad_steps(&targets, samples),
            topology: pipeline.primitive.topology,
            vertex_in_order: pipeline.geometry().interface().side_effects,
            clip: ClipVolume::new(&viewport, pipeline.primitive.unclipped_depth),
            screen: Screen::new(&viewport),
            setup,
            depth: depth_state,
            depth_words: depth.map_or(0, |shape| shape.words()),
            early,
            tests_blocks: depth_state.is_some_and(|d| d.tests_blocks()),
            needs_triangles: !(flat && early && no_builtins),
            per_sample: samples > 1 && fragment.is_some_and(|stage| stage.interface().per_sample),
            helpers: fragment.is_some_and(|stage| stage.interface().uses_derivatives),
            tiles_in_order: fragment.is_some() && side_effects,
            shades: fragment.is_some(),
            sample_mask: pipeline.sample_mask & all_samples,
            alpha_output: alpha_output.filter(|_| pipeline.alpha_to_coverage),
            frag_depth,
            mask_output,
            shrinks,
            overwrites: options.skips.overwritten
                && !options.record
                && plain
                && depth_state.is_none()
                && !side_effects
                && !shrinks
                && !queries.occlusion
                && pipeline.sample_mask & all_samples == all_samples,
            repeats,
            targets,
            depth_payload,
            payload_words,
            shade_covered: (options.record || queries.statistics) && options.key.shade == Shade::Covered,
            extra: Extra::of(&options.key),
            pipeline,
        };
        made.recorded = options.record.then(|| Arc::new(record::state(&made, depth.is_some())));
        Ok(made)
    }
}

/// Depth bias in the terms of setup.
fn bias(state: &DepthStencil) -> DepthBias {
    let unit = match state.format {
        Format::Depth16Unorm => BiasUnit::Fixed(1.0 / 65535.0),
        Format::Depth24Plus | Format::Depth24PlusStencil8 => BiasUnit::Fixed(1.0 / 16_777_215.0),
        _ => BiasUnit::Float,
    };
    DepthBias { constant: state.bias, slope: state.bias_slope, clamp: state.bias_clamp, unit }
}

/// The colour targets that the draw writes, and the words of a payload in all.
fn targets(
    pipeline: &RenderPipeline,
    dynamic: &DynamicState,
    colors: &[Option<(Shape, Format)>],
    depth_payload: usize,
) -> Result<(Vec<FrameTarget>, usize), Misfit> {
    let mut out = Vec::new();
    let mut payload = 0;
    for (location, target) in pipeline.targets.iter().enumerate() {
        let Some(target) = target else { continue };
        let Some(Some((shape, format))) = colors.get(location) else {
            if target.output.is_some() && target.state.write_mask & 15 != 0 {
                return Err(Misfit::NoTarget(location));
            }
            continue;
        };
        if *format != target.state.format {
            return Err(Misfit::TargetFormat { location, pipeline: target.state.format, pass: *format });
        }
        let state = ColorState::new(&target.state, dynamic.blend_constant);
        let Some(output) = target.output.filter(|_| !state.is_idle()) else { continue };
        let words = shape.words();
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
