//! Shader modules, layouts and pipelines.

use gfx::state::*;
use num::{PipelineLayoutId, ShaderId};
use trace::check::{BIND_GROUPS_MAX, rules};
use trace::command::*;

use super::objects::*;
use super::resource::check_samples;
use super::schema::{self, DataKind, Id};
use super::translate::Translator;

impl Translator {
    pub(super) fn create_shader(&mut self, label: Option<String>, data: schema::Data) -> Result<ShaderId, Reason> {
        let Some(kind) = data.kind() else {
            return Err(Reason::Damaged("the name of the shader's data does not say its language".into()));
        };
        let as_source = match kind {
            DataKind::Wgsl => ShaderSource::Wgsl,
            DataKind::Spv => ShaderSource::SpirV,
            DataKind::Ron => ShaderSource::NagaIr,
            other => return Err(format!("shaders in {} are not supported", other.name()).into()),
        };
        let (blob, size) = self.blobs.add(&mut self.builder, data)?;
        if kind == DataKind::Spv && !size.is_multiple_of(4) {
            return Err(Reason::Data(format!("the SPIR-V in {blob:?} has {size} bytes, which are no whole words")));
        }
        let id = self.objects.new_shader();
        self.emit(Command::CreateShader { id, source: as_source(blob), label });
        Ok(id)
    }

    /// A shader that wgpu passed to its driver unchanged, in one or several languages. Any of WGSL and SPIR-V is read.
    pub(super) fn create_passthrough(&mut self, label: Option<String>, data: Vec<schema::Data>) -> Result<ShaderId, Reason> {
        let names: Vec<_> = data.iter().map(|data| data.kind().map_or("unknown", DataKind::name)).collect();
        let usable = |wanted| data.iter().position(|data| data.kind() == Some(wanted));
        match usable(DataKind::Wgsl).or_else(|| usable(DataKind::Spv)) {
            Some(index) => self.create_shader(label, data[index].clone()),
            None => Err(format!("passthrough shaders in {} are not supported", names.join(", ")).into()),
        }
    }

    /// A bind group layout; none: the id names it already.
    pub(super) fn create_group_layout(
        &mut self,
        id: Id,
        desc: schema::BindGroupLayoutDescriptor,
    ) -> Result<Option<GroupLayout>, Reason> {
        let mut entries = Vec::with_capacity(desc.entries.len());
        for entry in desc.entries {
            let binding = entry.binding;
            let kind = binding_kind(entry.ty).map_err(|reason| reason.within(format_args!("binding {binding}")))?;
            entries.push(LayoutEntry { binding, kind, count: entry.count });
        }
        // Dynamic offsets are given in the order of the bindings.
        let entries = rules::bind_group_layout(&entries)?;
        Ok(self.new_group_layout(id, LayoutOrigin::Explicit(entries)))
    }

    /// A layout. wgpu shares equal layouts, so that a trace often creates a layout again with the same id.
    fn new_group_layout(&mut self, id: Id, origin: LayoutOrigin) -> Option<GroupLayout> {
        if self.objects.group_layouts.find(id).is_some_and(|known| known.origin == origin) {
            return None;
        }
        let native = self.objects.new_group_layout();
        self.emit(match &origin {
            LayoutOrigin::Explicit(entries) => Command::CreateBindGroupLayout { id: native, entries: entries.clone() },
            &LayoutOrigin::Derived(pipeline, group) => Command::GetBindGroupLayout { id: native, pipeline, group },
        });
        Some(GroupLayout { id: native, origin })
    }

    /// The layout of one of a pipeline's groups. A derived layout gets a new id; an explicit one is the layout that was given.
    pub(super) fn get_group_layout(
        &mut self,
        id: Id,
        pipeline: Result<(AnyPipeline, Groups), Reason>,
        index: u32,
    ) -> Result<Option<GroupLayout>, Reason> {
        let (pipeline, groups) = pipeline?;
        let Some(groups) = groups else {
            if index >= BIND_GROUPS_MAX {
                return Err(format!("group {index}, there are {BIND_GROUPS_MAX}").into());
            }
            return Ok(self.new_group_layout(id, LayoutOrigin::Derived(pipeline, index)));
        };
        match groups.into_iter().nth(index as usize).flatten() {
            Some(layout) if self.objects.group_layouts.find(id).is_some_and(|known| known.id == layout.id) => Ok(None),
            Some(layout) => Ok(Some(layout)),
            None => Err(format!("the pipeline's layout has no group {index}").into()),
        }
    }

    pub(super) fn create_pipeline_layout(&mut self, desc: schema::PipelineLayoutDescriptor) -> Result<PipelineLayout, Reason> {
        let layouts = &self.objects.group_layouts;
        let groups = desc.bind_group_layouts.into_iter();
        let groups: Vec<Option<GroupLayout>> =
            groups.map(|group| group.map(|id| layouts.get(id).cloned()).transpose()).collect::<Result<_, _>>()?;
        rules::pipeline_layout(groups.len(), desc.immediate_size)?;
        let id = self.objects.new_pipeline_layout();
        let ids = groups.iter().map(|group| group.as_ref().map(|group| group.id)).collect();
        self.emit(Command::CreatePipelineLayout { id, groups: ids, immediate_size: desc.immediate_size });
        Ok(PipelineLayout { id, groups })
    }

    fn pipeline_layout(&self, id: Option<Id>) -> Result<(Option<PipelineLayoutId>, Groups), Reason> {
        let Some(id) = id else { return Ok((None, None)) };
        let layout = self.objects.pipeline_layouts.get(id)?;
        Ok((Some(layout.id), Some(layout.groups.clone())))
    }

    fn stage(&self, stage: schema::ProgrammableStage) -> Result<StageDesc, Reason> {
        let stage = StageDesc {
            shader: *self.objects.shaders.get(stage.module)?,
            entry: stage.entry_point,
            constants: stage.constants.into_iter().collect(),
            zero_workgroup_memory: stage.zero_initialize_workgroup_memory,
        };
        rules::constants(&stage)?;
        Ok(stage)
    }

    pub(super) fn create_compute_pipeline(
        &mut self,
        desc: schema::ComputePipelineDescriptor,
    ) -> Result<ComputePipeline, Reason> {
        let (layout, groups) = self.pipeline_layout(desc.layout)?;
        let stage = self.stage(desc.stage)?;
        let id = self.objects.new_compute_pipeline();
        self.emit(Command::CreateComputePipeline { id, layout, stage, label: desc.label });
        Ok(ComputePipeline { id, groups })
    }

    pub(super) fn create_render_pipeline(&mut self, desc: schema::RenderPipelineDescriptor) -> Result<RenderPipeline, Reason> {
        let schema::VertexProcessor::Vertex(vertex) = desc.vertex else {
            return Err("mesh pipelines are not supported".into());
        };
        if desc.primitive.conservative {
            return Err("conservative rasterisation is not supported".into());
        }
        check_multiview(desc.multiview_mask)?;
        check_samples(desc.multisample.count)?;
        let (layout, groups) = self.pipeline_layout(desc.layout)?;
        let (fragment, targets) = match desc.fragment {
            Some(fragment) => (Some(self.stage(fragment.stage)?), fragment.targets),
            None => (None, Vec::new()),
        };
        let native = RenderPipelineDesc {
            layout,
            vertex: self.stage(vertex.stage)?,
            buffers: vertex.buffers.into_iter().map(|slot| slot.map(vertex_buffer)).collect(),
            primitive: primitive(desc.primitive),
            depth_stencil: desc.depth_stencil.map(depth_stencil).transpose()?,
            multisample: Multisample {
                count: desc.multisample.count,
                // wgpu's mask has 64 bits; the lowest ones belong to the samples of the target.
                mask: desc.multisample.mask as u32,
                alpha_to_coverage: desc.multisample.alpha_to_coverage_enabled,
            },
            fragment,
            targets: targets.into_iter().map(|slot| slot.map(color_target).transpose()).collect::<Result<_, _>>()?,
        };
        rules::render_pipeline(&native)?;
        let id = self.objects.new_render_pipeline();
        self.emit(Command::CreateRenderPipeline { id, desc: Box::new(native), label: desc.label });
        Ok(RenderPipeline { id, groups })
    }
}

/// Refuses rendering to several layers at once.
pub(super) fn check_multiview(mask: Option<u32>) -> Result<(), Reason> {
    mask.map_or(Ok(()), |_| Err("multiview is not supported".into()))
}

fn binding_kind(ty: schema::BindingType) -> Result<BindingKind, Reason> {
    use schema::{BindingType as Wire, BufferBindingType};
    Ok(match ty {
        Wire::Buffer { ty: BufferBindingType::Uniform, has_dynamic_offset, .. } => {
            BindingKind::Uniform { dynamic_offset: has_dynamic_offset }
        }
        Wire::Buffer { ty: BufferBindingType::Storage { read_only }, has_dynamic_offset, .. } => {
            BindingKind::Storage { read_only, dynamic_offset: has_dynamic_offset }
        }
        Wire::Sampler(_) => BindingKind::Sampler,
        Wire::Texture { .. } => BindingKind::Texture,
        Wire::StorageTexture { .. } => BindingKind::StorageTexture,
        Wire::AccelerationStructure { .. } => {
            return Err("ray tracing (acceleration structures) is not supported".into());
        }
        Wire::ExternalTexture => return Err("external textures are not supported".into()),
    })
}

fn vertex_buffer(layout: schema::VertexBufferLayout) -> VertexBufferLayout {
    let attribute =
        |a: schema::VertexAttribute| VertexAttribute { format: a.format.0, offset: a.offset, location: a.shader_location };
    VertexBufferLayout {
        stride: layout.array_stride,
        step: layout.step_mode.into(),
        attributes: layout.attributes.into_iter().map(attribute).collect(),
    }
}

fn primitive(state: schema::PrimitiveState) -> Primitive {
    Primitive {
        topology: state.topology.into(),
        strip_index_format: state.strip_index_format.map(Into::into),
        front_face: state.front_face.into(),
        cull_mode: state.cull_mode.map_or(CullMode::None, Into::into),
        polygon_mode: state.polygon_mode.into(),
        unclipped_depth: state.unclipped_depth,
        provoking_last: false,
        lower_edges: false,
        line_width: None,
    }
}

fn depth_stencil(state: schema::DepthStencilState) -> Result<DepthStencil, Reason> {
    let format = state.format.known()?;
    let face = |face: schema::StencilFaceState| StencilFace {
        compare: face.compare.into(),
        fail_op: face.fail_op.into(),
        depth_fail_op: face.depth_fail_op.into(),
        pass_op: face.pass_op.into(),
    };
    // As in wgpu: where both masks are 0, or the format has no stencil, the faces are ignored and there is no stencil test.
    let mut stencil = state.stencil;
    if (stencil.read_mask | stencil.write_mask) == 0 || !format.has_stencil() {
        stencil.front = schema::StencilFaceState::default();
        stencil.back = schema::StencilFaceState::default();
    }
    Ok(DepthStencil {
        format,
        depth_write: state.depth_write_enabled.unwrap_or(false),
        depth_compare: state.depth_compare.map_or(Compare::Always, Into::into),
        stencil_front: face(stencil.front),
        stencil_back: face(stencil.back),
        stencil_read_mask: stencil.read_mask,
        stencil_write_mask: stencil.write_mask,
        stencil_back_masks: None,
        bias: state.bias.constant as f32,
        bias_slope: state.bias.slope_scale,
        bias_clamp: state.bias.clamp,
    })
}

fn color_target(state: schema::ColorTargetState) -> Result<ColorTarget, Reason> {
    let component = |c: schema::BlendComponent| BlendComponent {
        src: c.src_factor.into(),
        dst: c.dst_factor.into(),
        op: c.operation.into(),
    };
    Ok(ColorTarget {
        format: state.format.known()?,
        blend: state.blend.map(|blend| Blend { color: component(blend.color), alpha: component(blend.alpha) }),
        logic: None,
        write_mask: (state.write_mask & 15) as u8,
    })
}
