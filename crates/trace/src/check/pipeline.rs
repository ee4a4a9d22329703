//! Rules of pipelines.

use std::collections::BTreeSet;
use std::rc::Rc;

use gfx::format::TexelKind;
use gfx::state::*;

use super::bind::GroupLayout;
use super::*;

/// Bytes from one vertex to the next, at most.
pub const VERTEX_STRIDE_MAX: u64 = 65_536;

/// Width of lines in pixels, at most.
pub const LINE_WIDTH_MAX: f32 = 255.0;

/// What draws need to know of a render pipeline.
#[derive(Clone)]
pub struct Render {
    /// Groups; none: derived.
    pub layout: Option<Rc<[Option<GroupLayout>]>>,
    pub buffers: Rc<[Option<Slot>]>,
    /// Formats of the colour targets, without trailing empty ones.
    pub targets: Vec<Option<Format>>,
    pub depth: Option<Format>,
    pub writes_depth: bool,
    pub writes_stencil: bool,
    pub samples: u32,
}

/// A vertex buffer slot.
#[derive(Clone, Copy)]
pub struct Slot {
    pub stride: u64,
    /// Bytes of a vertex up to the end of its last attribute.
    pub extent: u64,
    pub step: StepMode,
}

/// What dispatches need to know of a compute pipeline.
#[derive(Clone)]
pub struct Compute {
    /// Groups; none: derived.
    pub layout: Option<Rc<[Option<GroupLayout>]>>,
}

impl Checker<'_> {
    fn layout_groups(&self, layout: Option<PipelineLayoutId>) -> Result<Option<Rc<[Option<GroupLayout>]>>, Reason> {
        Ok(layout.map(|id| self.pipeline_layouts.get(id.0).map(|layout| layout.groups.clone())).transpose()?)
    }

    fn stage(&self, stage: &StageDesc) -> CheckResult {
        self.shaders.get(stage.shader.0)?;
        Ok(constants(stage)?)
    }

    pub(super) fn create_compute_pipeline(
        &mut self,
        id: ComputePipelineId,
        layout: Option<PipelineLayoutId>,
        stage: &StageDesc,
    ) -> CheckResult {
        self.stage(stage)?;
        let layout = self.layout_groups(layout)?;
        Ok(self.compute_pipelines.create(id.0, Compute { layout })?)
    }

    pub(super) fn get_bind_group_layout(&mut self, id: BindGroupLayoutId, pipeline: AnyPipeline, group: u32) -> CheckResult {
        let layout = match pipeline {
            AnyPipeline::Render(id) => &self.render_pipelines.get(id.0)?.layout,
            AnyPipeline::Compute(id) => &self.compute_pipelines.get(id.0)?.layout,
        };
        ensure!(group < BIND_GROUPS_MAX, "group {group}, there are {BIND_GROUPS_MAX}");
        let group = match layout {
            None => None,
            Some(groups) => match groups.get(group as usize) {
                Some(Some(layout)) => layout.clone(),
                _ => return Err(format!("the pipeline's layout has no group {group}").into()),
            },
        };
        Ok(self.group_layouts.create(id.0, group)?)
    }

    pub(super) fn create_render_pipeline(&mut self, id: RenderPipelineId, desc: &RenderPipelineDesc) -> CheckResult {
        let layout = self.layout_groups(desc.layout)?;
        desc.stages().try_for_each(|(_, stage)| self.stage(stage))?;
        let buffers = render_pipeline(desc)?;
        let samples = desc.multisample.count;
        let mut targets: Vec<_> = desc.targets.iter().map(|target| target.map(|target| target.format)).collect();
        while let Some(None) = targets.last() {
            targets.pop();
        }
        let state = desc.depth_stencil.as_ref();
        let pipeline = Render {
            layout,
            buffers: buffers.into(),
            targets,
            depth: state.map(|state| state.format),
            writes_depth: state.is_some_and(|state| state.depth_write),
            writes_stencil: state.is_some_and(DepthStencil::writes_stencil),
            samples,
        };
        Ok(self.render_pipelines.create(id.0, pipeline)?)
    }
}

/// The rules of a stage's constants.
///
/// # Errors
/// The rule that is broken.
pub fn constants(stage: &StageDesc) -> Result<(), String> {
    let mut names = BTreeSet::new();
    for (name, value) in &stage.constants {
        ensure!(names.insert(name), "constant {name:?} is given twice");
        ensure!(value.is_finite(), "constant {name:?} is {value}");
    }
    Ok(())
}

/// The vertex buffer slots of a render pipeline, if its description keeps the rules. What its stages are is not looked at.
///
/// # Errors
/// The rule that is broken.
pub fn render_pipeline(desc: &RenderPipelineDesc) -> Result<Vec<Option<Slot>>, String> {
    let buffers = vertex_buffers(&desc.buffers)?;
    color_targets(desc)?;
    let samples = desc.multisample.count;
    ensure!(matches!(samples, 1 | 4), "{samples} samples, only 1 and 4 are possible");
    ensure!(!desc.multisample.alpha_to_coverage || samples == 4, "alpha to coverage without multisampling");
    let restart = desc.primitive.strip_index_format.is_none() || desc.primitive.topology.is_strip();
    ensure!(restart, "a strip index format for {:?}", desc.primitive.topology);
    if let Some(width) = desc.primitive.line_width {
        ensure!(
            width > 0.0 && width <= LINE_WIDTH_MAX,
            "lines of a width of {width}, it must be above 0 and {LINE_WIDTH_MAX} at most"
        );
    }
    if let Some(state) = &desc.depth_stencil {
        depth_stencil(state)?;
    }
    Ok(buffers)
}

fn vertex_buffers(buffers: &[Option<VertexBufferLayout>]) -> Result<Vec<Option<Slot>>, String> {
    ensure!(buffers.len() <= VERTEX_BUFFERS_MAX as usize, "{} vertex buffers, at most {VERTEX_BUFFERS_MAX}", buffers.len());
    let mut locations = BTreeSet::new();
    let mut slots = Vec::with_capacity(buffers.len());
    for (slot, layout) in buffers.iter().enumerate() {
        let Some(layout) = layout else {
            slots.push(None);
            continue;
        };
        let stride = layout.stride;
        ensure!(stride <= VERTEX_STRIDE_MAX, "vertex buffer {slot} has a stride of {stride}, at most {VERTEX_STRIDE_MAX}");
        let mut extent = 0;
        for attribute in &layout.attributes {
            let (location, offset) = (attribute.location, attribute.offset);
            ensure!(locations.insert(location), "vertex attribute {location} is given twice");
            ensure!(
                (location as usize) < VERTEX_ATTRIBUTES_MAX,
                "vertex attribute {location}, there are {VERTEX_ATTRIBUTES_MAX}"
            );
            let end = offset.checked_add(u64::from(attribute.format.bytes()));
            let at_most = if stride == 0 { VERTEX_STRIDE_MAX } else { stride };
            let Some(end) = end.filter(|&end| end <= at_most) else {
                let bytes = attribute.format.bytes();
                return Err(format!("vertex attribute {location}: bytes {offset} + {bytes} reach past the stride {at_most}"));
            };
            extent = extent.max(end);
        }
        slots.push(Some(Slot { stride, extent, step: layout.step }));
    }
    Ok(slots)
}

fn color_targets(desc: &RenderPipelineDesc) -> Result<(), String> {
    ensure!(desc.targets.len() <= COLOR_TARGETS_MAX, "{} colour targets, at most {COLOR_TARGETS_MAX}", desc.targets.len());
    let some = desc.targets.iter().any(Option::is_some) || desc.depth_stencil.is_some();
    ensure!(some, "neither a colour target nor depth and stencil");
    for (index, target) in desc.targets.iter().enumerate() {
        let Some(target) = target else { continue };
        let name = target.format.name();
        ensure!(resource::renderable(target.format), "colour target {index}: {name} cannot be rendered to");
        ensure!(target.write_mask < 16, "colour target {index}: write mask {} has more than four bits", target.write_mask);
        let blends = target.format.kind() == TexelKind::Float || target.blend.is_none();
        ensure!(blends, "colour target {index}: {name} cannot be blended");
        if let Some(logic) = target.logic {
            ensure!(LogicOp::applies_to(target.format), "colour target {index}: {name} has no logic operations");
            let blended = desc.targets.iter().flatten().any(|target| target.blend.is_some());
            ensure!(!blended, "colour target {index}: the logic operation {logic:?} in a pipeline that blends");
        }
    }
    Ok(())
}

fn depth_stencil(state: &DepthStencil) -> Result<(), String> {
    let name = state.format.name();
    ensure!(state.format.is_depth_stencil(), "{name} is no depth or stencil format");
    let depth_used = state.depth_write || state.depth_compare != Compare::Always;
    ensure!(!depth_used || state.format.has_depth(), "a depth test with {name}");
    let stencil_used = [state.stencil_front, state.stencil_back].iter().any(|face| *face != StencilFace::default());
    ensure!(!stencil_used || state.format.has_stencil(), "a stencil test with {name}");
    let (constant, slope, clamp) = (state.bias, state.bias_slope, state.bias_clamp);
    let finite = [constant, slope, clamp].iter().all(|value| value.is_finite());
    ensure!(finite, "a depth bias of constant {constant}, slope {slope} and clamp {clamp}");
    Ok(())
}
