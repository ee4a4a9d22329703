//! Descriptors of shader modules, pipelines and their layouts.

use std::collections::BTreeMap;

use serde::Deserialize;
use serde::de::IgnoredAny;

use super::*;

/// A shader module.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct ShaderModuleDescriptor {
    pub label: Option<String>,
    #[serde(default)]
    pub runtime_checks: IgnoredAny,
}

/// A pipeline layout.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct PipelineLayoutDescriptor {
    pub label: Option<String>,
    pub bind_group_layouts: Vec<Option<Id>>,
    pub immediate_size: u32,
}

/// A programmable stage. The constants are sorted, because a recorder writes them in the order of a hash map.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct ProgrammableStage {
    pub module: Id,
    pub entry_point: Option<String>,
    pub constants: BTreeMap<String, f64>,
    pub zero_initialize_workgroup_memory: bool,
}

/// A compute pipeline.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct ComputePipelineDescriptor {
    pub label: Option<String>,
    pub layout: Option<Id>,
    pub stage: ProgrammableStage,
    pub cache: Option<Id>,
}

/// A render pipeline, with a vertex or a mesh stage.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct RenderPipelineDescriptor {
    pub label: Option<String>,
    pub layout: Option<Id>,
    pub vertex: VertexProcessor,
    #[serde(default)]
    pub primitive: PrimitiveState,
    #[serde(default)]
    pub depth_stencil: Option<DepthStencilState>,
    #[serde(default)]
    pub multisample: MultisampleState,
    pub fragment: Option<FragmentState>,
    pub multiview_mask: Option<u32>,
    pub cache: Option<Id>,
}

/// Where primitives come from.
#[derive(Clone, Debug, Deserialize)]
#[allow(missing_docs, reason = "variants are named as in wgpu")]
pub enum VertexProcessor {
    Vertex(VertexState),
    Mesh(IgnoredAny, IgnoredAny),
}

/// The vertex stage and its buffers.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct VertexState {
    pub stage: ProgrammableStage,
    pub buffers: Vec<Option<VertexBufferLayout>>,
}

/// One vertex buffer slot.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct VertexBufferLayout {
    pub array_stride: u64,
    pub step_mode: VertexStepMode,
    pub attributes: Vec<VertexAttribute>,
}

/// One vertex attribute.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct VertexAttribute {
    pub format: VertexFormat,
    pub offset: u64,
    pub shader_location: u32,
}

/// The fragment stage and its targets.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct FragmentState {
    pub stage: ProgrammableStage,
    pub targets: Vec<Option<ColorTargetState>>,
}

/// A colour target.
#[derive(Clone, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct ColorTargetState {
    pub format: TextureFormat,
    #[serde(default)]
    pub blend: Option<BlendState>,
    #[serde(default = "all_channels")]
    pub write_mask: u32,
}

fn all_channels() -> u32 {
    15
}

/// Blending of a target.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BlendState {
    pub color: BlendComponent,
    pub alpha: BlendComponent,
}

/// Blending of colour or alpha.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct BlendComponent {
    pub src_factor: BlendFactor,
    pub dst_factor: BlendFactor,
    pub operation: BlendOperation,
}

/// Primitive state.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct PrimitiveState {
    pub topology: PrimitiveTopology,
    #[serde(default)]
    pub strip_index_format: Option<IndexFormat>,
    #[serde(default = "ccw")]
    pub front_face: FrontFace,
    #[serde(default)]
    pub cull_mode: Option<Face>,
    #[serde(default)]
    pub unclipped_depth: bool,
    #[serde(default = "fill")]
    pub polygon_mode: PolygonMode,
    pub conservative: bool,
}

fn ccw() -> FrontFace {
    FrontFace::Ccw
}

fn fill() -> PolygonMode {
    PolygonMode::Fill
}

impl Default for PrimitiveState {
    fn default() -> Self {
        PrimitiveState {
            topology: PrimitiveTopology::TriangleList,
            strip_index_format: None,
            front_face: FrontFace::Ccw,
            cull_mode: None,
            unclipped_depth: false,
            polygon_mode: PolygonMode::Fill,
            conservative: false,
        }
    }
}

/// Multisample state.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct MultisampleState {
    pub count: u32,
    pub mask: u64,
    pub alpha_to_coverage_enabled: bool,
}

impl Default for MultisampleState {
    fn default() -> Self {
        MultisampleState { count: 1, mask: !0, alpha_to_coverage_enabled: false }
    }
}

/// Depth and stencil state.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct DepthStencilState {
    pub format: TextureFormat,
    pub depth_write_enabled: Option<bool>,
    pub depth_compare: Option<CompareFunction>,
    #[serde(default)]
    pub stencil: StencilState,
    #[serde(default)]
    pub bias: DepthBiasState,
}

/// Stencil state.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct StencilState {
    pub front: StencilFaceState,
    pub back: StencilFaceState,
    pub read_mask: u32,
    pub write_mask: u32,
}

/// Stencil state of a face.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "camelCase", deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct StencilFaceState {
    pub compare: CompareFunction,
    pub fail_op: StencilOperation,
    pub depth_fail_op: StencilOperation,
    pub pass_op: StencilOperation,
}

impl Default for StencilFaceState {
    fn default() -> Self {
        StencilFaceState {
            compare: CompareFunction::Always,
            fail_op: StencilOperation::Keep,
            depth_fail_op: StencilOperation::Keep,
            pass_op: StencilOperation::Keep,
        }
    }
}

/// Depth bias.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct DepthBiasState {
    pub constant: i32,
    pub slope_scale: f32,
    pub clamp: f32,
}

/// What a bundle renders to. Its pipelines say the same.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "fields are named as in wgpu")]
pub struct RenderBundleDescriptor {
    pub label: Option<String>,
    pub color_formats: IgnoredAny,
    pub depth_stencil: IgnoredAny,
    pub sample_count: u32,
    pub multiview: Option<u32>,
}
