//! Short ways to write the descriptions that most recordings need.

use gfx::format::Format;
use gfx::state::*;
use num::*;

use super::super::command::*;

/// A 2D texture with one level.
pub fn texture_2d(width: u32, height: u32, format: Format) -> TextureDesc {
    TextureDesc { dimension: TextureDimension::D2, size: [width, height, 1], levels: 1, samples: 1, format, opaque: false }
}

/// A 2D texture with this many levels.
pub fn texture_mipped(width: u32, height: u32, levels: u32, format: Format) -> TextureDesc {
    TextureDesc { levels, ..texture_2d(width, height, format) }
}

/// A 2D texture with this many samples per texel.
pub fn texture_multisampled(width: u32, height: u32, samples: u32, format: Format) -> TextureDesc {
    TextureDesc { samples, ..texture_2d(width, height, format) }
}

/// A stage: the module's only entry point of that stage, no constants.
pub fn stage(shader: ShaderId) -> StageDesc {
    StageDesc { shader, entry: None, constants: Vec::new(), zero_workgroup_memory: true }
}

/// A stage that starts at a named entry point.
pub fn stage_entry(shader: ShaderId, entry: &str) -> StageDesc {
    StageDesc { entry: Some(entry.to_owned()), ..stage(shader) }
}

/// A pipeline of one module for one colour target that replaces what is there: triangle list, no culling, no depth, no vertex
/// buffers, derived layout.
pub fn render_pipeline(shader: ShaderId, format: Format) -> RenderPipelineDesc {
    RenderPipelineDesc {
        layout: None,
        vertex: stage(shader),
        buffers: Vec::new(),
        primitive: Primitive::default(),
        depth_stencil: None,
        multisample: Multisample::default(),
        fragment: Some(stage(shader)),
        targets: vec![Some(target(format))],
    }
}

/// A colour target that is replaced.
pub fn target(format: Format) -> ColorTarget {
    ColorTarget { format, blend: None, logic: None, write_mask: 15 }
}

/// A depth test that keeps the nearer fragment and writes it.
pub fn depth_less(format: Format) -> DepthStencil {
    DepthStencil {
        format,
        depth_write: true,
        depth_compare: Compare::Less,
        stencil_front: StencilFace::default(),
        stencil_back: StencilFace::default(),
        stencil_read_mask: !0,
        stencil_write_mask: !0,
        stencil_back_masks: None,
        bias: 0.0,
        bias_slope: 0.0,
        bias_clamp: 0.0,
    }
}

/// A vertex buffer of consecutive attributes: location and format each; the stride is their sum.
pub fn vertex_buffer(attributes: &[(u32, VertexFormat)]) -> Option<VertexBufferLayout> {
    let mut stride = 0;
    let attributes = attributes
        .iter()
        .map(|&(location, format)| {
            let offset = stride;
            stride += u64::from(format.bytes());
            VertexAttribute { format, offset, location }
        })
        .collect();
    Some(VertexBufferLayout { stride, step: StepMode::Vertex, attributes })
}

/// A buffer that advances with the instance.
pub fn instance_buffer(attributes: &[(u32, VertexFormat)]) -> Option<VertexBufferLayout> {
    vertex_buffer(attributes).map(|layout| VertexBufferLayout { step: StepMode::Instance, ..layout })
}

/// A colour attachment that is cleared and kept.
pub fn clear(view: ViewId, color: [f64; 4]) -> ColorAttachment {
    ColorAttachment { view, depth_slice: None, resolve: None, clear: Some(color), store: true }
}

/// A colour attachment that is loaded and kept.
pub fn load(view: ViewId) -> ColorAttachment {
    ColorAttachment { view, depth_slice: None, resolve: None, clear: None, store: true }
}

/// A multisampled colour attachment that is cleared and resolved; its samples are not kept.
pub fn clear_and_resolve(view: ViewId, color: [f64; 4], resolve: ViewId) -> ColorAttachment {
    ColorAttachment { view, depth_slice: None, resolve: Some(resolve), clear: Some(color), store: false }
}

/// A depth attachment that is cleared to the far plane; kept if `store`.
pub fn clear_depth(view: ViewId, store: bool) -> Option<DepthAttachment> {
    Some(DepthAttachment { depth_clear: Some(1.0), depth_store: store, ..load_depth(view) })
}

/// A depth attachment whose depths and stencil values are loaded, written and kept.
pub fn load_depth(view: ViewId) -> DepthAttachment {
    DepthAttachment {
        view,
        depth_clear: None,
        depth_store: true,
        depth_read_only: false,
        stencil_clear: None,
        stencil_store: true,
        stencil_read_only: false,
    }
}

/// A uniform buffer in a layout.
pub const UNIFORM: BindingKind = BindingKind::Uniform { dynamic_offset: false };

/// A storage buffer that shaders write, in a layout.
pub const STORAGE: BindingKind = BindingKind::Storage { read_only: false, dynamic_offset: false };

/// A storage buffer that shaders only read, in a layout.
pub const STORAGE_READ: BindingKind = BindingKind::Storage { read_only: true, dynamic_offset: false };

/// A sampled texture in a layout.
pub const TEXTURE: BindingKind = BindingKind::Texture;

/// A storage texture in a layout.
pub const STORAGE_TEXTURE: BindingKind = BindingKind::StorageTexture;

/// A sampler in a layout.
pub const SAMPLER: BindingKind = BindingKind::Sampler;

/// A whole buffer in a bind group.
pub fn whole(buffer: BufferId) -> BoundResource {
    BoundResource::Buffer { buffer, offset: 0, size: None }
}

/// A sampler that filters texels and levels linearly (trilinear) and repeats.
pub fn trilinear_repeat() -> SamplerDesc {
    SamplerDesc {
        address: [AddressMode::Repeat; 3],
        mag: FilterMode::Linear,
        min: FilterMode::Linear,
        mipmap: FilterMode::Linear,
        ..SamplerDesc::default()
    }
}
