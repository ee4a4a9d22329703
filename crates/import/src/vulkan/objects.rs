//! The objects that the program holds, by their number in the capture. What is never changed after its creation is shared: it stays with
//! those that were made from it after the program has destroyed it.

use std::rc::Rc;

use gfx::state::*;
use gfxr::Call;
use num::*;
use trace::command::{TextureDesc, ViewDesc};

use super::fault::{Fault, Outcome};
use super::state::Fixed;

/// The number of an object in the capture.
pub type Handle = u64;

/// A memory object.
pub struct Memory {
    /// Bytes that the program asked for.
    pub size: u64,
    /// Where its mapping begins.
    pub mapped: u64,
    /// Where the last of the buffers in it ends: a native buffer reaches as far when it is made, since draws that wait must not lose it.
    pub end: u64,
    /// The native buffer with its contents, and the bytes of that; none until a buffer in it is used.
    pub native: Option<(BufferId, u64)>,
    /// Images with linear tiling in it.
    pub linear: Vec<Handle>,
}

/// A buffer: a range of a memory object.
pub struct Buffer {
    /// Bytes.
    pub size: u64,
    /// The memory object and the first byte in it.
    pub bound: Option<(Handle, u64)>,
}

/// How the texels of an image with linear tiling lie in its memory.
#[derive(Clone, Copy)]
pub struct LinearTexels {
    /// First byte.
    pub offset: u64,
    /// Bytes from one row to the next.
    pub row: u64,
}

/// An image.
pub struct Image {
    /// The native texture's description, or why there is none.
    pub desc: Result<TextureDesc, Fault>,
    /// Whether its tiling is linear.
    pub linear: bool,
    /// Its memory object and the first byte in it.
    pub bound: Option<(Handle, u64)>,
    /// How its texels lie, if it has linear tiling and the program has asked.
    pub texels: Option<LinearTexels>,
    /// Whether the program has written its linear texels since they were last copied.
    pub stale: bool,
    /// The native texture, once it is used.
    pub native: Option<TextureId>,
    /// Native views of it.
    pub views: Vec<(ViewDesc, ViewId)>,
}

/// A view of an image.
pub struct View {
    /// The image.
    pub image: Handle,
    /// The native view's description, without the aspect.
    pub desc: ViewDesc,
    /// The aspects, as `VkImageAspectFlags`.
    pub aspects: u32,
    /// Its `VkFormat`.
    pub code: u32,
    /// What each channel reads, as `VkComponentSwizzle`, where that is not the channel itself.
    pub swizzle: Option<[u32; 4]>,
}

/// A sampler.
#[derive(Clone)]
pub struct Sampler {
    /// The native one.
    pub desc: SamplerDesc,
    /// What it adds to the level.
    pub bias: f32,
}

/// A view of a buffer as texels.
pub struct BufferView {
    /// The buffer.
    pub buffer: Handle,
    /// The `VkFormat` of a texel.
    pub code: u32,
    /// First byte.
    pub offset: u64,
    /// Bytes; none: to the end.
    pub range: Option<u64>,
}

/// The type of a descriptor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptorKind {
    Sampler,
    Combined,
    Sampled,
    StorageImage,
    UniformTexels,
    StorageTexels,
    Uniform,
    Storage,
    UniformDynamic,
    StorageDynamic,
    Input,
    Inline,
}

impl DescriptorKind {
    /// The kind of a `VkDescriptorType`.
    pub fn new(code: u32) -> Outcome<DescriptorKind> {
        use DescriptorKind::*;
        let all = [
            Sampler,
            Combined,
            Sampled,
            StorageImage,
            UniformTexels,
            StorageTexels,
            Uniform,
            Storage,
            UniformDynamic,
            StorageDynamic,
            Input,
        ];
        match (all.get(code as usize), code) {
            (Some(&kind), _) => Ok(kind),
            (None, 1_000_138_000) => Ok(Inline),
            _ => super::fault::unsupported(format!("descriptors of {}", super::formats::name("VkDescriptorType", code))),
        }
    }

    /// Whether binding a set gives an offset for it.
    pub fn is_dynamic(self) -> bool {
        matches!(self, DescriptorKind::UniformDynamic | DescriptorKind::StorageDynamic)
    }
}

/// A binding of a set's layout.
#[derive(Clone)]
pub struct LayoutBinding {
    /// Its number.
    pub binding: u32,
    /// Its type, or why it is not supported.
    pub kind: Result<DescriptorKind, Fault>,
    /// Descriptors; of an inline block: bytes.
    pub count: u32,
    /// Samplers that cannot be changed.
    pub immutable: Vec<Handle>,
}

/// A layout of descriptor sets.
pub struct SetLayout {
    /// Bindings, by number.
    pub bindings: Vec<LayoutBinding>,
}

impl SetLayout {
    /// A binding and the place of its first descriptor among those of the set.
    pub fn find(&self, binding: u32) -> Option<(&LayoutBinding, usize)> {
        let mut first = 0;
        for known in &self.bindings {
            if known.binding == binding {
                return Some((known, first));
            }
            first += known.slots();
        }
        None
    }
}

impl LayoutBinding {
    /// Descriptors that a set has for it.
    pub fn slots(&self) -> usize {
        if self.kind == Ok(DescriptorKind::Inline) { 1 } else { self.count as usize }
    }
}

/// A layout of pipelines.
pub struct PipelineLayout {
    /// The layout of each set; none: not used.
    pub sets: Vec<Option<Rc<SetLayout>>>,
}

/// What a descriptor holds.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Descriptor {
    /// Nothing has been written.
    #[default]
    Empty,
    /// A view and a sampler, or only one of them.
    Image {
        /// The view.
        view: Handle,
        /// The sampler.
        sampler: Handle,
    },
    /// A range of a buffer.
    Buffer {
        /// The buffer.
        buffer: Handle,
        /// First byte.
        offset: u64,
        /// Bytes; none: to the end.
        range: Option<u64>,
    },
    /// A view of a buffer.
    Texels(Handle),
    /// An inline block.
    Inline(Rc<Vec<u8>>),
}

/// A descriptor set.
#[derive(Clone)]
pub struct Set {
    /// Its layout.
    pub layout: Rc<SetLayout>,
    /// The pool that it is from.
    pub pool: Handle,
    /// The descriptors of all bindings.
    pub slots: Rc<Vec<Descriptor>>,
}

impl Set {
    /// A set without contents, but for the samplers of its layout.
    pub fn new(layout: &Rc<SetLayout>, pool: Handle) -> Set {
        let mut slots = Vec::new();
        for binding in &layout.bindings {
            let slot = |at: usize| match binding.immutable.get(at) {
                Some(&sampler) => Descriptor::Image { view: 0, sampler },
                None if binding.kind == Ok(DescriptorKind::Inline) => {
                    Descriptor::Inline(Rc::new(vec![0; binding.count as usize]))
                }
                None => Descriptor::Empty,
            };
            slots.extend((0..binding.slots()).map(slot));
        }
        Set { layout: layout.clone(), pool, slots: Rc::new(slots) }
    }
}

/// An attachment of a render pass.
#[derive(Clone, Copy)]
pub struct Attachment {
    /// The contents are cleared at first use.
    pub clear: bool,
    /// The contents are kept.
    pub store: bool,
    /// Stencil is cleared at first use.
    pub stencil_clear: bool,
    /// Stencil is kept.
    pub stencil_store: bool,
}

/// A subpass: numbers of attachments.
pub struct Subpass {
    /// Colour targets; none: unused.
    pub color: Vec<Option<usize>>,
    /// Where they are resolved to.
    pub resolve: Vec<Option<usize>>,
    /// Depth and stencil.
    pub depth: Option<usize>,
    /// Attachments that it reads.
    pub input: Vec<usize>,
    /// A bit for each view that it draws; 0: no views.
    pub views: u32,
    /// What it asks for and is not supported.
    pub refused: Option<String>,
}

/// A render pass.
pub struct RenderPass {
    /// Attachments.
    pub attachments: Vec<Attachment>,
    /// Subpasses in order.
    pub subpasses: Vec<Subpass>,
}

/// A framebuffer.
pub struct Framebuffer {
    /// Views; empty where they are given when the pass begins.
    pub views: Vec<Handle>,
    /// Layers.
    pub layers: u32,
}

/// A shader module.
pub struct ShaderModule {
    /// No other module of the capture has this number.
    pub number: u64,
    /// SPIR-V.
    pub words: Vec<u32>,
}

/// A stage of a pipeline.
#[derive(Clone)]
pub struct Stage {
    /// `VkShaderStageFlagBits`.
    pub stage: u32,
    /// The module.
    pub module: Rc<ShaderModule>,
    /// The entry point.
    pub entry: String,
    /// Specialisation constants: id and bits.
    pub constants: Rc<Vec<(u32, Vec<u8>)>>,
}

/// A pipeline for draws or dispatches.
pub struct Pipeline {
    /// No other pipeline of the capture has this number.
    pub number: u64,
    /// Stages.
    pub stages: Vec<Stage>,
    /// Layout.
    pub layout: Rc<PipelineLayout>,
    /// State that is fixed, and which of it is not.
    pub fixed: Fixed,
    /// State that commands set, as `VkDynamicState`.
    pub dynamic: Vec<u32>,
    /// What it asks for and is not supported.
    pub refused: Option<Fault>,
}

/// A swapchain.
pub struct Swapchain {
    /// Its images are made as this.
    pub desc: Result<TextureDesc, Fault>,
    /// Its images, once the program has asked for them.
    pub images: Vec<Handle>,
}

/// What a query pool counts.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum PoolKind {
    /// Samples.
    Occlusion,
    /// Time.
    Timestamp,
    /// Pipeline statistics of `VkQueryPipelineStatisticFlags`.
    Statistics(u32),
    /// Something else.
    Other,
}

/// A query pool.
pub struct QueryPool {
    /// What it counts.
    pub kind: PoolKind,
    /// Queries.
    pub count: u32,
    /// The native query set, once it is used.
    pub native: Option<QuerySetId>,
    /// Whether a query of it was not counted, since it began outside of a pass.
    pub uncounted: bool,
}

/// A recorded call and the block that holds it.
pub struct Recorded {
    /// The number of the block.
    pub block: u64,
    /// The call.
    pub call: Call,
}

/// A command buffer: a list of calls, which run when it is submitted.
pub struct CommandBuffer {
    /// The pool that it is from.
    pub pool: Handle,
    /// Calls.
    pub list: Rc<Vec<Recorded>>,
}

/// An entry of an update template.
#[derive(Clone, Copy)]
pub struct TemplateEntry {
    /// The first binding that it writes.
    pub binding: u32,
    /// The first descriptor of that.
    pub element: u32,
    /// Descriptors.
    pub count: u32,
    /// Their type, as `VkDescriptorType`.
    pub kind: u32,
}

/// An update template: its entries, and the bind point that it pushes to.
pub type Template = (Rc<Vec<TemplateEntry>>, u32);

/// All objects.
#[derive(Default)]
pub struct Objects {
    pub memories: NumberMap<Handle, Memory>,
    pub buffers: NumberMap<Handle, Buffer>,
    pub images: NumberMap<Handle, Image>,
    pub views: NumberMap<Handle, View>,
    pub buffer_views: NumberMap<Handle, BufferView>,
    pub samplers: NumberMap<Handle, Outcome<Sampler>>,
    /// Whether shaders depend on views or samplers: one exchanges channels or adds to the level.
    pub rewritten: bool,
    pub set_layouts: NumberMap<Handle, Rc<SetLayout>>,
    pub pipeline_layouts: NumberMap<Handle, Rc<PipelineLayout>>,
    pub sets: NumberMap<Handle, Set>,
    pub templates: NumberMap<Handle, Template>,
    pub render_passes: NumberMap<Handle, Rc<RenderPass>>,
    pub framebuffers: NumberMap<Handle, Rc<Framebuffer>>,
    pub modules: NumberMap<Handle, Rc<ShaderModule>>,
    pub pipelines: NumberMap<Handle, Rc<Pipeline>>,
    pub swapchains: NumberMap<Handle, Swapchain>,
    pub query_pools: NumberMap<Handle, QueryPool>,
    pub commands: NumberMap<Handle, CommandBuffer>,
}

/// An object that must be there.
pub fn known<T>(found: Option<T>, what: &str, handle: Handle) -> Outcome<T> {
    found.ok_or_else(|| Fault::Damaged(format!("there is no {what} {handle}")))
}
