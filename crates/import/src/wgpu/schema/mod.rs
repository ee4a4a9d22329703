//! A serde schema, of our own, of the traces that wgpu 30 writes: one RON list of [`Action`]s.
//!
//! Names and shapes follow what `wgpu-core` and `wgpu-types` 30.0.1 serialise. Structs refuse unknown fields: a field that
//! this schema does not know could change the picture, so it must not be skipped in silence. What has no meaning for
//! execution (labels of layouts, caches) is read and dropped. Types that exist only to be refused by name
//! (ray tracing, external textures, mesh pipelines) carry no contents.
//!
//! ```
//! use import::wgpu::schema::{Action, action};
//!
//! let text = "Present(PointerId(16)), DropBuffer(PointerId(32))";
//! let (first, read) = action(text).expect("an action");
//! assert!(matches!(first, Action::Present(surface) if surface.address() == 16));
//! assert_eq!(read, "Present(PointerId(16))".len());
//! ```

mod command;
mod pipeline;
mod resource;
mod state;

pub use command::*;
pub use pipeline::*;
pub use resource::*;
pub use state::*;

use serde::Deserialize;
use serde::de::IgnoredAny;

/// Why some text is no action.
#[derive(Debug)]
pub struct Wrong {
    /// RON's reason, with the place in the text.
    pub error: ron::error::SpannedError,
    /// Bytes of the text that were read.
    pub read: usize,
}

/// Reads the action at the beginning of some text, and how many bytes of it that took.
///
/// # Errors
/// If there is none, or one that this schema does not know.
pub fn action(text: &str) -> Result<(Action, usize), Wrong> {
    let mut deserializer = ron::Deserializer::from_str(text).map_err(|error| Wrong { error, read: 0 })?;
    let action = Action::deserialize(&mut deserializer);
    let read = text.len() - deserializer.remainder().len();
    match action {
        Ok(action) => Ok((action, read)),
        Err(error) => Err(Wrong { error: deserializer.span_error(error), read }),
    }
}

/// An object's name in a wgpu trace: the address that it had. Addresses come back for later objects.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Deserialize)]
pub enum Id {
    /// The only form that a recorder writes.
    PointerId(std::num::NonZeroU64),
}

impl Id {
    /// The address.
    pub fn address(self) -> u64 {
        let Id::PointerId(address) = self;
        address.get()
    }
}

/// Payload of an action.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub enum Data {
    /// A file beside `trace.ron`.
    File(String),
    /// Text inside the action.
    String(DataKind, String),
    /// Bytes inside the action.
    Binary(DataKind, Vec<u8>),
}

/// What inline payload is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs, reason = "each variant is the language it names")]
pub enum DataKind {
    Bin,
    Wgsl,
    Ron,
    Spv,
    Dxil,
    Hlsl,
    MetalLib,
    Msl,
    Glsl,
}

impl DataKind {
    /// The kind that a file name's extension states.
    pub fn of_file(name: &str) -> Option<DataKind> {
        Some(match name.rsplit_once('.')?.1 {
            "bin" => DataKind::Bin,
            "wgsl" => DataKind::Wgsl,
            "ron" => DataKind::Ron,
            "spv" => DataKind::Spv,
            "dxil" => DataKind::Dxil,
            "hlsl" => DataKind::Hlsl,
            "metallib" => DataKind::MetalLib,
            "metal" => DataKind::Msl,
            "glsl" => DataKind::Glsl,
            _ => return None,
        })
    }

    /// The language's name.
    pub fn name(self) -> &'static str {
        match self {
            DataKind::Bin => "binary",
            DataKind::Wgsl => "WGSL",
            DataKind::Ron => "naga IR",
            DataKind::Spv => "SPIR-V",
            DataKind::Dxil => "DXIL",
            DataKind::Hlsl => "HLSL",
            DataKind::MetalLib => "Metal library",
            DataKind::Msl => "MSL",
            DataKind::Glsl => "GLSL",
        }
    }
}

impl Data {
    /// The kind of the payload; none for a file of an unknown extension.
    pub fn kind(&self) -> Option<DataKind> {
        match self {
            Data::File(name) => DataKind::of_file(name),
            Data::String(kind, _) | Data::Binary(kind, _) => Some(*kind),
        }
    }
}

/// One recorded call.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
#[allow(missing_docs, reason = "variants and fields are named as in wgpu-core's trace")]
pub enum Action {
    Init {
        desc: DeviceDescriptor,
        backend: IgnoredAny,
    },
    ConfigureSurface(Id, SurfaceConfiguration),
    CreateBuffer(Id, BufferDescriptor),
    DestroyBuffer(Id),
    DropBuffer(Id),
    CreateTexture(Id, TextureDescriptor),
    /// A texture that was invalid when it was recorded.
    CreateTextureError(Id, IgnoredAny),
    DestroyTexture(Id),
    DropTexture(Id),
    CreateTextureView {
        id: Id,
        parent: Id,
        desc: TextureViewDescriptor,
    },
    DropTextureView(Id),
    CreateExternalTexture {
        id: Id,
        desc: IgnoredAny,
        planes: IgnoredAny,
    },
    DestroyExternalTexture(Id),
    DropExternalTexture(Id),
    CreateSampler(Id, SamplerDescriptor),
    DropSampler(Id),
    GetSurfaceTexture {
        id: Id,
        parent: Id,
    },
    Present(Id),
    DiscardSurfaceTexture(Id),
    ReleaseSurfaceTexture(Id),
    CreateBindGroupLayout(Id, BindGroupLayoutDescriptor),
    GetRenderPipelineBindGroupLayout {
        id: Id,
        pipeline: Id,
        index: u32,
    },
    GetComputePipelineBindGroupLayout {
        id: Id,
        pipeline: Id,
        index: u32,
    },
    DropBindGroupLayout(Id),
    CreatePipelineLayout(Id, PipelineLayoutDescriptor),
    DropPipelineLayout(Id),
    CreateBindGroup(Id, BindGroupDescriptor),
    DropBindGroup(Id),
    CreateShaderModule {
        id: Id,
        desc: ShaderModuleDescriptor,
        data: Data,
    },
    CreateShaderModulePassthrough {
        id: Id,
        data: Vec<Data>,
        label: Option<String>,
        entry_points: IgnoredAny,
    },
    DropShaderModule(Id),
    CreateComputePipeline {
        id: Id,
        desc: Box<ComputePipelineDescriptor>,
    },
    DropComputePipeline(Id),
    CreateGeneralRenderPipeline {
        id: Id,
        desc: Box<RenderPipelineDescriptor>,
    },
    DropRenderPipeline(Id),
    CreatePipelineCache {
        id: Id,
        desc: IgnoredAny,
    },
    DropPipelineCache(Id),
    CreateRenderBundle {
        id: Id,
        desc: RenderBundleDescriptor,
        base: Pass<RenderCommand>,
    },
    DropRenderBundle(Id),
    CreateQuerySet {
        id: Id,
        desc: QuerySetDescriptor,
    },
    DropQuerySet(Id),
    DestroyQuerySet(Id),
    WriteBuffer {
        id: Id,
        data: Data,
        offset: u64,
        size: u64,
        queued: bool,
    },
    WriteTexture {
        to: TexelCopyTextureInfo,
        data: Data,
        layout: TexelCopyBufferLayout,
        size: Extent3d,
    },
    Submit(u64, Vec<Command>),
    /// Commands that never ran.
    FailedCommands {
        commands: IgnoredAny,
        /// The submission that failed with them; none: the command buffer was invalid when it was finished.
        failed_at_submit: Option<u64>,
        error: String,
    },
    CreateBlas {
        id: Id,
        desc: IgnoredAny,
        sizes: IgnoredAny,
    },
    DropBlas(Id),
    CreateTlas {
        id: Id,
        desc: IgnoredAny,
    },
    DropTlas(Id),
}
