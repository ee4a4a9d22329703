//! Native pipelines: made when a draw needs them, from the program's pipeline, the state that commands have set, and the pass.

use std::rc::Rc;

use gfx::format::{Format, TexelKind};
use gfx::state::*;
use gfx::vertex::{ComponentKind, component_kind};
use num::*;
use shader::{BindingKind as Bound, BuiltIn, Connection, Interface, Scalar};
use trace::check::rules;
use trace::command::*;
use trace::record::Recorder;

use super::fault::{Fault, Outcome, unsupported};
use super::formats;
use super::groups::{Origin, Plan, Planned};
use super::machine::Vulkan;
use super::objects::{DescriptorKind, Pipeline, SetLayout};
use super::points;
use super::shaders::{Bound as Reads, Form, Numbers, Shader};
use super::state::{Fixed, Stencil};

/// What a pass draws to.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PassFormats {
    /// Formats of colour targets.
    pub color: Vec<Option<Format>>,
    /// Format of depth and stencil.
    pub depth: Option<Format>,
    /// Samples for each pixel.
    pub samples: u32,
    /// The view that is drawn, in a pass of several.
    pub view: Option<u32>,
}

/// Where the native draw takes a vertex buffer from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VertexSlot {
    /// The program's number of the buffer.
    pub binding: u32,
    /// Bytes from one element to the next and instances for each in the program's terms, where the native buffer begins at the first instance.
    pub at_first_instance: Option<(u32, u32)>,
}

/// A pipeline that is ready to draw.
#[derive(Debug)]
pub struct Ready {
    /// The native pipeline.
    pub id: RenderPipelineId,
    /// Groups.
    pub groups: Vec<Plan>,
    /// Vertex buffers by native slot.
    pub slots: Vec<VertexSlot>,
    /// Their layouts.
    pub layouts: Vec<VertexBufferLayout>,
    /// Bytes of immediates that the shaders read.
    pub immediates: u32,
    /// The blend constant's alpha stands for all its channels.
    pub constant_alpha: bool,
    /// Points are drawn as squares.
    pub points: bool,
    /// The vertex shader writes to memory.
    pub writes: bool,
    /// The numbers of the draw that it was made for, as far as its shader reads them.
    numbers: Numbers,
    /// The vertex shader as it is without such numbers.
    plain: Rc<Shader>,
}

/// A compute pipeline that is ready.
#[derive(Debug)]
pub struct ReadyCompute {
    /// The native pipeline.
    pub id: ComputePipelineId,
    /// Groups.
    pub groups: Vec<Plan>,
    /// Bytes of immediates that the shader reads.
    pub immediates: u32,
    /// The first workgroup that it was made for, if its shader reads it.
    base: [u32; 3],
    /// The shader as it is for a dispatch that begins at workgroup 0.
    plain: Rc<Shader>,
}

impl ReadyCompute {
    /// Whether it also serves a dispatch whose first workgroup this is.
    pub fn serves(&self, numbers: Numbers) -> bool {
        numbers.read_by(&self.plain.interface).base_workgroup == self.base
    }
}

impl Ready {
    /// Whether it draws with these numbers, too.
    pub fn serves(&self, numbers: Numbers) -> bool {
        numbers.read_by(&self.plain.interface) == self.numbers
    }

    /// Whether the vertex shader reads the number of the draw among several.
    pub fn reads_draw(&self) -> bool {
        self.plain.interface.input(BuiltIn::DrawIndex).is_some()
    }
}

/// Layouts of a pipeline: the native one, and its groups.
type Layouts = (PipelineLayoutId, Vec<Plan>, u32);

/// What a native pipeline layout is made of: its groups, and bytes of immediates.
type LayoutKey = (Vec<Option<BindGroupLayoutId>>, u32);

/// Pipelines that have been made.
#[derive(Default)]
pub struct Pipelines {
    render: NumberMap<u64, Vec<(RenderPipelineDesc, RenderPipelineId)>>,
    compute: NumberMap<u64, Vec<(ShaderId, ComputePipelineId)>>,
    group_layouts: Vec<(Vec<LayoutEntry>, BindGroupLayoutId)>,
    layouts: Vec<(LayoutKey, PipelineLayoutId)>,
}

impl Pipelines {
    /// Ends what was made from a pipeline of the program.
    pub fn forget(&mut self, number: u64, card: &mut Recorder) {
        for (_, id) in self.render.remove(number).into_iter().flatten() {
            card.push(Command::Destroy(Object::RenderPipeline(id)));
        }
        for (_, id) in self.compute.remove(number).into_iter().flatten() {
            card.push(Command::Destroy(Object::ComputePipeline(id)));
        }
    }

    fn group_layout(&mut self, entries: Vec<LayoutEntry>, card: &mut Recorder) -> BindGroupLayoutId {
        if let Some(&(_, id)) = self.group_layouts.iter().find(|(known, _)| *known == entries) {
            return id;
        }
        let id = card.create_bind_group_layout_of(entries.clone());
        self.group_layouts.push((entries, id));
        id
    }

    fn layout(&mut self, groups: Vec<Option<BindGroupLayoutId>>, immediates: u32, card: &mut Recorder) -> PipelineLayoutId {
        let key = (groups, immediates);
        if let Some(&(_, id)) = self.layouts.iter().find(|(known, _)| *known == key) {
            return id;
        }
        let id = card.create_pipeline_layout_of(key.0.clone(), immediates);
        self.layouts.push((key, id));
        id
    }
}

/// The native bindings of a shader, by group.
fn plan(shader: &Shader, sets: &[Option<Rc<SetLayout>>], out: &mut Vec<(u32, Planned, LayoutEntry)>) -> Outcome {
    let interface = &shader.interface;
    let is_texels = |set: u32, binding: u32| {
        shader.translated.texel_buffers.iter().any(|place| (place.set, place.binding) == (set, binding))
    };
    for bound in &interface.bindings {
        let (set, native) = (bound.group, bound.binding);
        let split = |combined: &&spirv::Combined| combined.place.set == set && combined.sampler_binding == native;
        let moved = |own: &&spirv::Moved| own.place.set == set && own.binding == native;
        let split = shader.translated.combined.iter().find(split).map(|combined| combined.place.binding);
        let moved = shader.translated.uniform_as_storage.iter().find(moved).map(|own| own.place.binding);
        let binding = split.or(moved).unwrap_or(native);
        let place = format!("set {set}, binding {binding}");
        let Some(Some(layout)) = sets.get(set as usize) else {
            return unsupported(format!("{place}, whose set the pipeline's layout does not have"));
        };
        let Some((wanted, _)) = layout.find(binding) else {
            return unsupported(format!("{place}, which the set's layout does not have"));
        };
        use DescriptorKind::*;
        let kind = wanted.kind.clone()?;
        let (origin, own, fits) = match bound.kind {
            Bound::Uniform { min_size } => {
                let kinds = matches!(kind, Uniform | UniformDynamic | Inline);
                (Origin::Buffer(min_size), BindingKind::Uniform { dynamic_offset: false }, kinds)
            }
            Bound::Storage { min_size, writable } => {
                let own = BindingKind::Storage { read_only: !writable, dynamic_offset: false };
                let texels = is_texels(set, binding) && matches!(kind, UniformTexels | StorageTexels);
                let kinds = texels || matches!(kind, Storage | StorageDynamic | Uniform | UniformDynamic | Inline);
                (Origin::Buffer(min_size), own, kinds)
            }
            Bound::Texture { .. } => (Origin::View, BindingKind::Texture, matches!(kind, Combined | Sampled | Input)),
            Bound::StorageTexture { .. } => (Origin::Storage, BindingKind::StorageTexture, kind == StorageImage),
            Bound::Sampler { .. } => (Origin::Sampler, BindingKind::Sampler, matches!(kind, Combined | Sampler)),
        };
        if !fits {
            return unsupported(format!("{place}: the shader's binding is of another type than the layout's"));
        }
        let array = bound.count.is_some();
        let count = array.then(|| (wanted.slots() as u32).max(1));
        let planned = Planned { native, binding, origin, array };
        let entry = LayoutEntry { binding: native, kind: own, count };
        let Some((_, known, layout)) = out.iter_mut().find(|(of, known, _)| (*of, known.native) == (set, native)) else {
            out.push((set, planned, entry));
            continue;
        };
        match (&mut known.origin, origin, &mut layout.kind, own) {
            (Origin::Buffer(size), Origin::Buffer(needed), BindingKind::Uniform { .. }, BindingKind::Uniform { .. }) => {
                *size = needed.max(*size);
            }
            (
                Origin::Buffer(size),
                Origin::Buffer(needed),
                BindingKind::Storage { read_only, .. },
                BindingKind::Storage { read_only: only, .. },
            ) => {
                *size = needed.max(*size);
                *read_only &= only;
            }
            (known, own, _, _) if *known == own => {}
            _ => return unsupported(format!("{place}: two stages read it in different forms")),
        }
    }
    Ok(())
}

/// Whether the fragment stage gets all that it reads.
fn connects(vertex: &Interface, fragment: &Interface) -> Outcome {
    for slot in fragment.inputs.iter().filter(|slot| slot.used) {
        let Connection::Location { location, .. } = slot.connection else { continue };
        let Some(from) = vertex.output_location(location).map(|at| &vertex.outputs[at]) else {
            return unsupported(format!(
                "the fragment shader reads location {location}, which the vertex shader does not write"
            ));
        };
        if from.scalar != slot.scalar || from.components < slot.components {
            return unsupported(format!("location {location} is of different types in the vertex and the fragment shader"));
        }
    }
    Ok(())
}

impl Vulkan {
    /// The layouts of these shaders.
    fn layouts(&mut self, shaders: &[&Shader], sets: &[Option<Rc<SetLayout>>]) -> Outcome<Layouts> {
        let mut planned = Vec::new();
        for shader in shaders {
            plan(shader, sets, &mut planned)?;
        }
        planned.sort_by_key(|(set, planned, _)| (*set, planned.native));
        let mut plans: Vec<Plan> = Vec::new();
        let mut native = Vec::new();
        for group in planned.chunk_by(|a, b| a.0 == b.0) {
            let set = group[0].0;
            if set >= trace::check::BIND_GROUPS_MAX {
                return unsupported(format!("descriptor set {set}"));
            }
            let entries: Vec<LayoutEntry> = group.iter().map(|(.., entry)| *entry).collect();
            rules::bind_group_layout(&entries).map_err(Fault::Unsupported)?;
            let layout = self.pipelines.group_layout(entries, &mut self.card);
            native.resize(set as usize + 1, None);
            native[set as usize] = Some(layout);
            plans.push(Plan { set, layout, bindings: group.iter().map(|(_, planned, _)| *planned).collect() });
        }
        let immediates = shaders.iter().map(|shader| shader.interface.immediate_bytes).max().unwrap_or(0).next_multiple_of(4);
        let layout = self.pipelines.layout(native, immediates, &mut self.card);
        Ok((layout, plans, immediates))
    }

    /// The compute pipeline, ready.
    pub fn ready_compute(&mut self, pipeline: &Pipeline, bound: Reads, numbers: Numbers) -> Outcome<ReadyCompute> {
        let Some(stage) = pipeline.stages.first() else { return unsupported("a compute pipeline without a shader") };
        let mut form = Form { bound, ..Form::default() };
        let plain = self.shaders.get(stage, &form, &mut self.card, &self.limits)?;
        form.numbers = numbers.read_by(&plain.interface);
        let shader = self.shaders.get(stage, &form, &mut self.card, &self.limits)?;
        let (layout, groups, immediates) = self.layouts(&[&shader], &pipeline.layout.sets)?;
        let known = self.pipelines.compute.get_or_insert_with(pipeline.number, Vec::new);
        let id = match known.iter().find(|(of, _)| *of == shader.id) {
            Some(&(_, id)) => id,
            None => {
                let stage = native_stage(&shader);
                let id = self.card.create_compute_pipeline("compute", Some(layout), stage);
                known.push((shader.id, id));
                id
            }
        };
        Ok(ReadyCompute { id, groups, immediates, base: form.numbers.base_workgroup, plain })
    }

    /// The render pipeline for this state and pass, ready.
    pub fn ready(
        &mut self,
        pipeline: &Pipeline,
        state: &Fixed,
        pass: &PassFormats,
        index: Option<IndexFormat>,
        bound: Reads,
        numbers: Numbers,
    ) -> Outcome<Ready> {
        if let Some(refused) = &pipeline.refused {
            return Err(refused.clone());
        }
        refuse_state(state, pass)?;
        let find = |bit: u32| pipeline.stages.iter().find(|stage| stage.stage == bit);
        let Some(vertex_stage) = find(1) else { return unsupported("a pipeline without a vertex shader") };
        let viewport = state.viewports.first();
        let topology = formats::topology(state.topology)?;
        let flip = viewport.is_none_or(|viewport| viewport.height >= 0.0);
        let mut form = Form { flip, from_minus_one: state.negative_one_to_one, view: pass.view, bound, ..Form::default() };
        let plain = self.shaders.get(vertex_stage, &form, &mut self.card, &self.limits)?;
        let points = topology == Topology::PointList && points::writes_size(&plain.translated.words);
        let numbers = numbers.read_by(&plain.interface);
        form.numbers = numbers;
        let mut vertex = self.shaders.get(vertex_stage, &form, &mut self.card, &self.limits)?;
        let mut fragment_form = Form { view: pass.view, bound: form.bound.clone(), ..Form::default() };
        fragment_form.each_sample = state.sample_shading * pass.samples as f32 > 1.0;
        let mut fragment = match find(16) {
            Some(stage) => Some(self.shaders.get(stage, &fragment_form, &mut self.card, &self.limits)?),
            None => None,
        };
        if points {
            let size = viewport.map_or([1.0; 2], |viewport| [viewport.width, viewport.height.abs()]);
            form.points = Some(size.map(f32::to_bits));
            // Native instances are points, and the program's draw has one instance, the first.
            form.numbers.base_instance = Numbers { base_instance: Some(0), ..numbers }.read_by(&plain.interface).base_instance;
            let used = vertex.interface.outputs.iter().filter_map(|slot| slot.location()).max();
            form.point_coord = Some(used.map_or(0, |location| location + 1));
            fragment_form.point_coord = form.point_coord;
            vertex = self.shaders.get(vertex_stage, &form, &mut self.card, &self.limits)?;
            if let (Some(stage), Some(old)) = (find(16), &fragment)
                && old.interface.input(BuiltIn::PointCoord).is_some()
            {
                fragment = Some(self.shaders.get(stage, &fragment_form, &mut self.card, &self.limits)?);
            }
        }
        if let Some(fragment) = &fragment {
            connects(&vertex.interface, &fragment.interface)?;
        }
        let shaders: Vec<&Shader> = [Some(&vertex), fragment.as_ref()].into_iter().flatten().map(|shader| &**shader).collect();
        let (layout, groups, immediates) = self.layouts(&shaders, &pipeline.layout.sets)?;
        let (buffers, slots) = vertex_buffers(state, &vertex.interface, points)?;
        let (targets, constant_alpha) = targets(state, pass, fragment.as_ref().map(|shader| &shader.interface))?;
        let strip = state.restart && topology.is_strip();
        let unclipped = state.depth_clip.map_or(state.depth_clamp, |clip| !clip);
        let primitive = Primitive {
            topology: if points { Topology::TriangleStrip } else { topology },
            strip_index_format: index.filter(|_| strip),
            front_face: if state.front_face == 0 { FrontFace::Ccw } else { FrontFace::Cw },
            cull_mode: match state.cull_mode {
                _ if points => CullMode::None,
                1 => CullMode::Front,
                2 => CullMode::Back,
                _ => CullMode::None,
            },
            polygon_mode: match state.polygon_mode {
                0 => PolygonMode::Fill,
                1 => PolygonMode::Line,
                2 => PolygonMode::Point,
                _ => return unsupported("a polygon mode beyond fill, line and point"),
            },
            unclipped_depth: unclipped,
            provoking_last: state.provoking_last,
            lower_edges: false,
            line_width: draws_lines(state).then_some(state.line_width).filter(|_| state.line_mode != BRESENHAM),
        };
        let multisample = Multisample {
            count: pass.samples,
            mask: state.sample_mask,
            alpha_to_coverage: state.alpha_to_coverage && pass.samples > 1,
        };
        let desc = RenderPipelineDesc {
            layout: Some(layout),
            vertex: native_stage(&vertex),
            buffers: buffers.iter().cloned().map(Some).collect(),
            primitive,
            depth_stencil: pass.depth.map(|format| depth_stencil(state, format)).transpose()?,
            multisample,
            fragment: fragment.as_deref().map(native_stage),
            targets,
        };
        rules::render_pipeline(&desc).map_err(Fault::Unsupported)?;
        let known = self.pipelines.render.get_or_insert_with(pipeline.number, Vec::new);
        let id = match known.iter().find(|(known, _)| *known == desc) {
            Some(&(_, id)) => id,
            None => {
                let id = self.card.create_render_pipeline("draw", desc.clone());
                known.push((desc, id));
                id
            }
        };
        let writable = |bound: &shader::Binding| {
            matches!(bound.kind, Bound::Storage { writable: true, .. } | Bound::StorageTexture { .. })
        };
        let writes = vertex.interface.bindings.iter().any(writable);
        Ok(Ready { id, groups, slots, layouts: buffers, immediates, constant_alpha, points, writes, numbers, plain })
    }
}

fn native_stage(shader: &Shader) -> StageDesc {
    StageDesc { shader: shader.id, entry: Some(shader.entry.clone()), constants: Vec::new(), zero_workgroup_memory: false }
}

/// The mode of lines that draw what leaves a pixel's diamond; lines of other modes are rectangles, as they are in lavapipe.
const BRESENHAM: u32 = 2;

/// Whether primitives are lines, or polygons that are drawn as lines.
fn draws_lines(state: &Fixed) -> bool {
    matches!(state.topology, 1 | 2) || state.topology > 2 && state.polygon_mode == 1
}

/// Refuses state that the card does not have.
fn refuse_state(state: &Fixed, pass: &PassFormats) -> Outcome {
    let lines = draws_lines(state);
    if state.depth_bounds {
        return unsupported("a test of depth bounds");
    }
    if lines && state.line_mode == BRESENHAM && state.line_width != 1.0 {
        return unsupported("Bresenham's lines of a width other than a pixel");
    }
    if lines && state.line_mode > BRESENHAM {
        return unsupported("smooth lines");
    }
    if lines && state.stippled {
        return unsupported("stippled lines");
    }
    if state.alpha_to_one {
        return unsupported("alpha that is set to one");
    }
    if !matches!(pass.samples, 1 | 4) {
        return unsupported(format!("{} samples", pass.samples));
    }
    Ok(())
}

fn scalar_of(format: VertexFormat) -> Scalar {
    match component_kind(format) {
        ComponentKind::Float => Scalar::Float,
        ComponentKind::Uint => Scalar::Uint,
        ComponentKind::Sint => Scalar::Sint,
    }
}

/// The native vertex buffers, and where they come from.
fn vertex_buffers(state: &Fixed, vertex: &Interface, points: bool) -> Outcome<(Vec<VertexBufferLayout>, Vec<VertexSlot>)> {
    let (mut layouts, mut slots): (Vec<VertexBufferLayout>, Vec<VertexSlot>) = (Vec::new(), Vec::new());
    for input in &vertex.inputs {
        let Some(location) = input.location() else { continue };
        let Some(attribute) = state.attributes.iter().find(|attribute| attribute.location == location) else {
            return unsupported(format!("vertex attribute {location}, which the shader reads and the pipeline does not have"));
        };
        let format = formats::vertex_format(attribute.format)?;
        if scalar_of(format) != input.scalar {
            let own = format.name();
            return unsupported(format!("vertex attribute {location} is {own} in memory and {:?} in the shader", input.scalar));
        }
        let Some(binding) = state.bindings.iter().find(|binding| binding.binding == attribute.binding) else {
            return unsupported(format!("vertex buffer {}, which the pipeline does not have", attribute.binding));
        };
        if points && binding.instance && binding.divisor > 1 {
            return unsupported(format!("points of a size with attributes that change every {} instances", binding.divisor));
        }
        // Draws are cut where others than 0 and 1 change.
        let fixed = binding.instance && (binding.divisor != 1 || points);
        let stride = if fixed { 0 } else { binding.stride.into() };
        let step = if binding.instance || points { StepMode::Instance } else { StepMode::Vertex };
        let at_first_instance = fixed.then_some((binding.stride, binding.divisor));
        let slot = VertexSlot { binding: binding.binding, at_first_instance };
        let at = slots.iter().position(|known| *known == slot).unwrap_or_else(|| {
            slots.push(slot);
            layouts.push(VertexBufferLayout { stride, step, attributes: Vec::new() });
            slots.len() - 1
        });
        let offset = attribute.offset.into();
        layouts[at].attributes.push(VertexAttribute { format, offset, location });
    }
    Ok((layouts, slots))
}

fn blend_component(equation: &[u32]) -> Outcome<BlendComponent> {
    Ok(BlendComponent {
        src: formats::blend_factor(equation[0])?,
        dst: formats::blend_factor(equation[1])?,
        op: formats::blend_op(equation[2])?,
    })
}

/// The native colour targets, and whether the blend constant's alpha stands for its colour.
fn targets(state: &Fixed, pass: &PassFormats, fragment: Option<&Interface>) -> Outcome<(Vec<Option<ColorTarget>>, bool)> {
    let (mut targets, mut alpha, mut color) = (Vec::new(), false, false);
    for (number, format) in pass.color.iter().enumerate() {
        let Some(format) = *format else {
            targets.push(None);
            continue;
        };
        let blend = state.blend.get(number).copied().unwrap_or_default();
        let on = state.color_write.get(number).copied().unwrap_or(true);
        let mut write_mask = if on { blend.write_mask as u8 & 15 } else { 0 };
        if let Some(fragment) = fragment {
            let output = fragment.output_location(number as u32).map(|at| fragment.outputs[at]);
            let expected = match format.kind() {
                TexelKind::Uint => Scalar::Uint,
                TexelKind::Sint => Scalar::Sint,
                _ => Scalar::Float,
            };
            match output {
                // What is not written stays as it is.
                None => write_mask = 0,
                Some(output) if output.scalar != expected => {
                    return unsupported(format!(
                        "target {number} is {} and the shader writes {:?}",
                        format.name(),
                        output.scalar
                    ));
                }
                Some(_) => {}
            }
        }
        // A logic operation ends blending everywhere, also where the format has none.
        let logic = state.logic()?;
        let blends = blend.enabled && format.kind() == TexelKind::Float && logic.is_none();
        let blend = if blends {
            let equation = &blend.equation;
            let factors = [equation[0], equation[1]];
            alpha |= factors.into_iter().any(formats::is_constant_alpha);
            color |= factors.into_iter().any(formats::is_constant_color);
            Some(Blend { color: blend_component(&equation[..3])?, alpha: blend_component(&equation[3..])? })
        } else {
            None
        };
        let logic = logic.filter(|&operation| operation != LogicOp::Copy && LogicOp::applies_to(format));
        targets.push(Some(ColorTarget { format, blend, logic, write_mask }));
    }
    if alpha && color {
        return unsupported("blending with the colour and with the alpha of the constant in one draw");
    }
    Ok((targets, alpha))
}

fn depth_stencil(state: &Fixed, format: Format) -> Outcome<DepthStencil> {
    let tested = state.depth_test && format.has_depth();
    let stencilled = state.stencil_test && format.has_stencil();
    let face = |own: Stencil| -> Outcome<StencilFace> {
        Ok(StencilFace {
            compare: formats::compare(own.compare)?,
            fail_op: formats::stencil_op(own.fail)?,
            depth_fail_op: formats::stencil_op(own.depth_fail)?,
            pass_op: formats::stencil_op(own.pass)?,
        })
    };
    let mut faces = [StencilFace::default(); 2];
    let mut masks = [StencilMasks { read: !0, write: !0 }; 2];
    if stencilled {
        let sides = state.stencil_sides();
        faces = [face(sides[0])?, face(sides[1])?];
        masks = sides.map(|own| StencilMasks { read: own.compare_mask, write: own.write_mask });
    }
    let [front, back] = masks;
    let [constant, clamp, slope] = if state.depth_bias { state.bias } else { [0.0; 3] };
    Ok(DepthStencil {
        format,
        depth_write: tested && state.depth_write,
        depth_compare: if tested { formats::compare(state.depth_compare)? } else { Compare::Always },
        stencil_front: faces[0],
        stencil_back: faces[1],
        stencil_read_mask: front.read,
        stencil_write_mask: front.write,
        stencil_back_masks: (back != front).then_some(back),
        bias: constant,
        bias_slope: slope,
        bias_clamp: clamp,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn biases_and_stencil_masks_are_as_the_program_has_them() {
        let front = Stencil { compare: 2, pass: 2, compare_mask: 15, write_mask: 3, ..Stencil::default() };
        let back = Stencil { compare_mask: 240, ..front };
        let mut state = Fixed { stencil_test: true, stencil: [front, back], depth_bias: true, ..Fixed::default() };
        state.bias = [1.25, 0.5, 1.75];
        let made = depth_stencil(&state, Format::Depth24PlusStencil8).expect("state");
        assert_eq!([made.bias, made.bias_clamp, made.bias_slope], state.bias);
        assert_eq!((made.stencil_read_mask, made.stencil_write_mask), (15, 3));
        assert_eq!(made.stencil_back_masks, Some(StencilMasks { read: 240, write: 3 }));
        // Lines are front faces.
        (state.topology, state.depth_bias) = (1, false);
        let made = depth_stencil(&state, Format::Depth24PlusStencil8).expect("state");
        assert_eq!((made.bias, made.stencil_back_masks), (0.0, None));
    }

    #[test]
    fn logic_operations_end_blending_and_leave_formats_without_them() {
        let formats = [Format::Rgba8Unorm, Format::Rgba8UnormSrgb, Format::R32Uint, Format::Rgba16Float];
        let pass = PassFormats { color: formats.map(Some).to_vec(), samples: 1, ..PassFormats::default() };
        let blend = super::super::state::Blend { enabled: true, equation: [1, 1, 0, 1, 1, 0], write_mask: 15 };
        let mut state = Fixed { blend: vec![blend; 4], logic_op_enable: true, ..Fixed::default() };
        let made = |state: &Fixed| {
            let (targets, _) = targets(state, &pass, None).expect("targets");
            targets.into_iter().flatten().map(|target| (target.logic, target.blend.is_some())).collect::<Vec<_>>()
        };
        for number in 0..16 {
            state.logic_op = Some(number);
            let logic = Some(LogicOp::ALL[number as usize]).filter(|_| number != 3);
            assert_eq!(made(&state), [(logic, false), (None, false), (logic, false), (None, false)]);
        }
        state.logic_op = Some(16);
        assert!(targets(&state, &pass, None).is_err());
        state.logic_op_enable = false;
        assert_eq!(made(&state), [(None, true), (None, true), (None, false), (None, true)]);
    }
}
