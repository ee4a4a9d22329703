//! The recorder: a small typed API that leaves a trace. Shaped like WebGPU: create resources, begin a pass, draw, present, save.
//!
//! ```
//! use gfx::format::Format;
//! use trace::record::{self, Recorder};
//!
//! let mut card = Recorder::new("triangle");
//! let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
//! let view = card.create_view(target);
//! let shader = card.create_shader(
//!     "triangle",
//!     "@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
//!          return vec4f(f32(i32(i) - 1), f32(i32(i & 1) * 2 - 1), 0, 1);
//!      }
//!      @fragment fn fs() -> @location(0) vec4f { return vec4f(1); }",
//! );
//! let pipeline = card.create_render_pipeline("triangle", record::render_pipeline(shader, Format::Rgba8Unorm));
//! {
//!     let mut pass = card.begin_render_pass([record::clear(view, [0.0, 0.0, 0.0, 1.0])], None);
//!     pass.set_pipeline(pipeline);
//!     pass.draw(3, 1);
//! }
//! card.present(target);
//! let trace = card.finish();
//! assert_eq!(trace.blob_names().collect::<Vec<_>>(), ["triangle.wgsl"]);
//! ```
//!
//! Contents given twice are kept once. The recorder checks nothing: [`crate::check()`] does.

mod desc;
mod pass;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::path::Path;

use gfx::state::{Aspect, SamplerDesc};
use num::*;

use super::command::*;
use super::{Builder, CommandChunk, Packing, Trace, TraceError};

pub use desc::*;
pub use pass::{BundleEncoder, ComputePass, RenderPass};

/// Records commands into a trace in memory.
pub struct Recorder {
    builder: Builder,
    /// Blobs by length and [`sample`]: the name of the first, until there is a second and both have a hash.
    by_sample: BTreeMap<(usize, u64), Option<String>>,
    /// Blobs by contents: the name under which they are kept.
    by_hash: BTreeMap<[u8; 32], String>,
    /// Whether contents that are given twice are kept once.
    joins: bool,
    /// Numbers of the names that have been given, by stem.
    numbers: BTreeMap<String, u32>,
    /// Bytes of the blobs.
    bytes: u64,
    textures: Vec<TextureDesc>,
    next: NextIds,
    /// Where the commands that follow are made, and what the trace says of that so far.
    site: Option<CallSite>,
    stated: Option<CallSite>,
}

#[derive(Default)]
struct NextIds {
    buffer: u32,
    view: u32,
    sampler: u32,
    shader: u32,
    bind_group_layout: u32,
    pipeline_layout: u32,
    bind_group: u32,
    render_pipeline: u32,
    compute_pipeline: u32,
    bundle: u32,
    query_set: u32,
}

fn take(next: &mut u32) -> u32 {
    let id = *next;
    *next += 1;
    id
}

/// A number of some of the bytes, by which most contents of one length are told apart.
fn sample(bytes: &[u8]) -> u64 {
    const WORDS: usize = 64;
    let words = bytes.as_chunks::<8>();
    let step = (words.0.len() / WORDS).max(1);
    let of = |sum: u64, word: u64| (sum ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15).rotate_left(29);
    let sum = words.0.iter().step_by(step).fold(0, |sum, word| of(sum, u64::from_le_bytes(*word)));
    words.1.iter().fold(sum, |sum, byte| of(sum, (*byte).into()))
}

fn some_label(label: &str) -> Option<String> {
    (!label.is_empty()).then(|| label.to_owned())
}

impl Recorder {
    /// An empty recording; `name` is what messages call it.
    pub fn new(name: impl AsRef<Path>) -> Recorder {
        Recorder {
            builder: Builder::new(name),
            by_sample: BTreeMap::new(),
            by_hash: BTreeMap::new(),
            joins: true,
            numbers: BTreeMap::new(),
            bytes: 0,
            textures: Vec::new(),
            next: NextIds::default(),
            site: None,
            stated: None,
        }
    }

    /// Keeps contents as often as they are given from now on: what is soon drained need not be compared.
    pub fn keep_each(&mut self) {
        self.joins = false;
    }

    /// Bytes that commands and blobs take, about.
    pub fn bytes(&self) -> u64 {
        self.bytes + self.builder.len() * size_of::<Command>() as u64
    }

    /// Takes what has been recorded so far; the recording goes on behind it.
    pub fn drain(&mut self) -> CommandChunk {
        self.by_sample.clear();
        self.by_hash.clear();
        self.bytes = 0;
        self.builder.drain()
    }

    /// Appends any command as it is. The trace says where commands that do work are made: see [`Recorder::set_call_site`].
    #[inline]
    pub fn push(&mut self, command: Command) {
        if let Command::SetCallSite(site) = command {
            return self.set_call_site(site);
        }
        if self.site != self.stated && command.does_work() {
            self.state_call_site();
        }
        self.builder.push(command);
    }

    #[cold]
    fn state_call_site(&mut self) {
        self.stated = self.site;
        if let Some(site) = self.site {
            self.builder.push(Command::SetCallSite(site));
        }
    }

    /// Says where the recorded program makes the commands that follow.
    #[inline]
    pub fn set_call_site(&mut self, site: CallSite) {
        self.site = Some(site);
    }

    /// Where the recorded program makes the commands that follow, if that is known.
    pub fn call_site(&self) -> Option<CallSite> {
        self.site
    }

    /// Keeps bytes as a blob called after `label`, or finds the blob that has these contents already. The answer is its name.
    pub fn keep(&mut self, label: &str, extension: &str, bytes: Cow<'_, [u8]>) -> String {
        let sampled = (bytes.len(), sample(&bytes));
        let hash = self.hash(sampled, &bytes);
        if let Some(name) = hash.and_then(|hash| self.by_hash.get(&hash)) {
            return name.clone();
        }
        let mut stem: String = label
            .chars()
            .map(|c| if c.is_ascii_alphanumeric() || c == '_' { c.to_ascii_lowercase() } else { '-' })
            .take(64)
            .collect();
        if stem.is_empty() {
            stem.push_str("data");
        }
        // Names are not given twice, also where blobs have been taken out.
        let number = self.numbers.entry(format!("{stem}.{extension}")).or_insert(0);
        let mut name;
        loop {
            name = if *number == 0 { format!("{stem}.{extension}") } else { format!("{stem}-{number}.{extension}") };
            *number += 1;
            if !self.builder.has_blob(&name) {
                break;
            }
        }
        self.bytes += bytes.len() as u64;
        self.builder.add_blob(&name, bytes.into_owned()).expect("the name is plain and free");
        match hash {
            Some(hash) => {
                self.by_hash.insert(hash, name.clone());
            }
            None if self.joins => {
                self.by_sample.insert(sampled, Some(name.clone()));
            }
            None => {}
        }
        name
    }

    /// The hash of bytes that may be known; most contents differ from all others in length or in what is sampled, and need none.
    fn hash(&mut self, sampled: (usize, u64), bytes: &[u8]) -> Option<[u8; 32]> {
        let first = self.by_sample.get_mut(&sampled).filter(|_| self.joins)?;
        if let Some(first) = first.take()
            && let Some(bytes) = self.builder.blob(&first)
        {
            self.by_hash.insert(*blake3::hash(&bytes).as_bytes(), first);
        }
        Some(*blake3::hash(bytes).as_bytes())
    }

    /// As [`Recorder::keep`], as what commands write.
    pub fn data<'a>(&mut self, label: &str, bytes: impl Into<Cow<'a, [u8]>>) -> Data {
        let bytes = bytes.into();
        let size = bytes.len() as u64;
        Data { blob: self.keep(label, "bin", bytes), offset: 0, size }
    }

    /// A buffer of this many bytes, all zero.
    pub fn create_buffer(&mut self, label: &str, size: u64) -> BufferId {
        let id = BufferId(take(&mut self.next.buffer));
        self.push(Command::CreateBuffer { id, size, label: some_label(label) });
        id
    }

    /// A buffer with these contents: a vector is kept as it is, other bytes are copied.
    pub fn create_buffer_init<'a>(&mut self, label: &str, bytes: impl Into<Cow<'a, [u8]>>) -> BufferId {
        let bytes = bytes.into();
        let id = self.create_buffer(label, bytes.len() as u64);
        self.write_buffer(id, 0, label, bytes);
        id
    }

    /// Writes bytes at an offset; `label` names the blob. A vector is kept as it is, other bytes are copied.
    pub fn write_buffer<'a>(&mut self, id: BufferId, offset: u64, label: &str, bytes: impl Into<Cow<'a, [u8]>>) {
        let data = self.data(label, bytes);
        self.push(Command::WriteBuffer { id, offset, data });
    }

    /// A texture, all zero.
    pub fn create_texture(&mut self, label: &str, desc: TextureDesc) -> TextureId {
        let id = TextureId(self.textures.len() as u32);
        self.textures.push(desc.clone());
        self.push(Command::CreateTexture { id, desc, label: some_label(label) });
        id
    }

    /// Writes one whole level of a texture (all layers or slices), tightly packed; `label` names the blob.
    ///
    /// # Panics
    /// If the texture was not created by this recorder.
    pub fn write_level(&mut self, texture: TextureId, level: u32, label: &str, bytes: &[u8]) {
        let size = self.textures[texture.index()].level_size(level);
        let to = TextureEnd { texture, level, origin: [0; 3], aspect: Aspect::All };
        self.write_texture(to, LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None }, size, label, bytes);
    }

    /// Writes texels that lie in `bytes` as `layout` says; `label` names the blob.
    pub fn write_texture(&mut self, to: TextureEnd, layout: LinearLayout, size: [u32; 3], label: &str, bytes: &[u8]) {
        let data = self.data(label, bytes);
        self.push(Command::WriteTexture { to, data, layout, size });
    }

    /// A view of a whole texture.
    pub fn create_view(&mut self, texture: TextureId) -> ViewId {
        self.create_view_of(texture, Default::default())
    }

    /// A view.
    pub fn create_view_of(&mut self, texture: TextureId, desc: ViewDesc) -> ViewId {
        let id = ViewId(take(&mut self.next.view));
        self.push(Command::CreateView { id, texture, desc });
        id
    }

    /// A sampler.
    pub fn create_sampler(&mut self, desc: SamplerDesc) -> SamplerId {
        let id = SamplerId(take(&mut self.next.sampler));
        self.push(Command::CreateSampler { id, desc });
        id
    }

    /// A shader module from WGSL; kept as a text file called after `label`.
    pub fn create_shader(&mut self, label: &str, wgsl: &str) -> ShaderId {
        let id = ShaderId(take(&mut self.next.shader));
        let source = ShaderSource::Wgsl(self.keep(label, "wgsl", wgsl.as_bytes().into()));
        self.push(Command::CreateShader { id, source, label: some_label(label) });
        id
    }

    /// A shader module from a SPIR-V binary.
    pub fn create_shader_spirv(&mut self, label: &str, binary: &[u8]) -> ShaderId {
        let id = ShaderId(take(&mut self.next.shader));
        let source = ShaderSource::SpirV(self.keep(label, "spv", binary.into()));
        self.push(Command::CreateShader { id, source, label: some_label(label) });
        id
    }

    /// A shader module from naga's own form, as RON.
    pub fn create_shader_naga_ir(&mut self, label: &str, ron: &str) -> ShaderId {
        let id = ShaderId(take(&mut self.next.shader));
        let source = ShaderSource::NagaIr(self.keep(label, "ron", ron.as_bytes().into()));
        self.push(Command::CreateShader { id, source, label: some_label(label) });
        id
    }

    /// A bind group layout: kinds by binding number.
    pub fn create_bind_group_layout(&mut self, entries: impl IntoIterator<Item = (u32, BindingKind)>) -> BindGroupLayoutId {
        let entry = |(binding, kind)| LayoutEntry { binding, kind, count: None };
        self.create_bind_group_layout_of(entries.into_iter().map(entry).collect())
    }

    /// A bind group layout, with arrays.
    pub fn create_bind_group_layout_of(&mut self, entries: Vec<LayoutEntry>) -> BindGroupLayoutId {
        let id = BindGroupLayoutId(take(&mut self.next.bind_group_layout));
        self.push(Command::CreateBindGroupLayout { id, entries });
        id
    }

    /// The derived layout of a group of a pipeline that has no explicit one.
    pub fn get_bind_group_layout(&mut self, pipeline: AnyPipeline, group: u32) -> BindGroupLayoutId {
        let id = BindGroupLayoutId(take(&mut self.next.bind_group_layout));
        self.push(Command::GetBindGroupLayout { id, pipeline, group });
        id
    }

    /// A pipeline layout, with `immediate_size` bytes of immediates.
    pub fn create_pipeline_layout(
        &mut self,
        groups: impl IntoIterator<Item = BindGroupLayoutId>,
        immediate_size: u32,
    ) -> PipelineLayoutId {
        self.create_pipeline_layout_of(groups.into_iter().map(Some).collect(), immediate_size)
    }

    /// A pipeline layout, some of whose groups may be unused.
    pub fn create_pipeline_layout_of(
        &mut self,
        groups: Vec<Option<BindGroupLayoutId>>,
        immediate_size: u32,
    ) -> PipelineLayoutId {
        let id = PipelineLayoutId(take(&mut self.next.pipeline_layout));
        self.push(Command::CreatePipelineLayout { id, groups, immediate_size });
        id
    }

    /// A bind group: resources by binding number.
    pub fn create_bind_group(
        &mut self,
        layout: BindGroupLayoutId,
        entries: impl IntoIterator<Item = (u32, BoundResource)>,
    ) -> BindGroupId {
        let id = BindGroupId(take(&mut self.next.bind_group));
        let entries = entries.into_iter().map(|(binding, resource)| BindGroupEntry { binding, resource }).collect();
        self.push(Command::CreateBindGroup { id, layout, entries });
        id
    }

    /// A render pipeline.
    pub fn create_render_pipeline(&mut self, label: &str, desc: RenderPipelineDesc) -> RenderPipelineId {
        let id = RenderPipelineId(take(&mut self.next.render_pipeline));
        self.push(Command::CreateRenderPipeline { id, desc: Box::new(desc), label: some_label(label) });
        id
    }

    /// A compute pipeline; no layout: derived from the shader.
    pub fn create_compute_pipeline(
        &mut self,
        label: &str,
        layout: Option<PipelineLayoutId>,
        stage: StageDesc,
    ) -> ComputePipelineId {
        let id = ComputePipelineId(take(&mut self.next.compute_pipeline));
        self.push(Command::CreateComputePipeline { id, layout, stage, label: some_label(label) });
        id
    }

    /// A query set.
    pub fn create_query_set(&mut self, kind: QueryKind, count: u32) -> QuerySetId {
        let id = QuerySetId(take(&mut self.next.query_set));
        self.push(Command::CreateQuerySet { id, kind, count });
        id
    }

    /// Copies bytes between two buffers.
    pub fn copy_buffer_to_buffer(&mut self, from: (BufferId, u64), to: (BufferId, u64), size: u64) {
        self.push(Command::CopyBufferToBuffer { from: from.0, from_offset: from.1, to: to.0, to_offset: to.1, size });
    }

    /// Copies texels from a buffer to a texture.
    pub fn copy_buffer_to_texture(&mut self, from: BufferId, layout: LinearLayout, to: TextureEnd, size: [u32; 3]) {
        self.push(Command::CopyBufferToTexture { from, layout, to, size });
    }

    /// Copies texels from a texture to a buffer.
    pub fn copy_texture_to_buffer(&mut self, from: TextureEnd, to: BufferId, layout: LinearLayout, size: [u32; 3]) {
        self.push(Command::CopyTextureToBuffer { from, to, layout, size });
    }

    /// Copies texels between two textures.
    pub fn copy_texture_to_texture(&mut self, from: TextureEnd, to: TextureEnd, size: [u32; 3]) {
        self.push(Command::CopyTextureToTexture { from, to, size });
    }

    /// Writes query results, eight bytes each, to a buffer.
    pub fn resolve_queries(&mut self, set: QuerySetId, first: u32, count: u32, to: BufferId, to_offset: u64) {
        self.push(Command::ResolveQuerySet { set, first, count, to, to_offset });
    }

    /// From the next frame on the display lays a view over its lines, its upper left texel on a pixel; with none, the sprite is not shown any more.
    pub fn set_sprite(&mut self, index: u32, view: Option<ViewId>, [x, y]: [i32; 2]) {
        self.push(Command::SetSprite { index, view, x, y });
    }

    /// Ends a frame and shows a texture.
    pub fn present(&mut self, texture: TextureId) {
        self.push(Command::Present { texture });
    }

    /// Begins a render pass; it ends when the guard is dropped.
    pub fn begin_render_pass(
        &mut self,
        color: impl IntoIterator<Item = ColorAttachment>,
        depth: Option<DepthAttachment>,
    ) -> RenderPass<'_> {
        self.begin_render_pass_with(color, depth, None)
    }

    /// Begins a render pass whose occlusion queries go to a set; it ends when the guard is dropped.
    pub fn begin_render_pass_with(
        &mut self,
        color: impl IntoIterator<Item = ColorAttachment>,
        depth: Option<DepthAttachment>,
        occlusion: Option<QuerySetId>,
    ) -> RenderPass<'_> {
        let color = color.into_iter().map(Some).collect();
        self.push(Command::BeginRenderPass { color, depth, occlusion, timestamps: None, label: None });
        RenderPass::new(self)
    }

    /// Begins a compute pass; it ends when the guard is dropped.
    pub fn begin_compute_pass(&mut self) -> ComputePass<'_> {
        self.push(Command::BeginComputePass { timestamps: None, label: None });
        ComputePass::new(self)
    }

    /// Begins a bundle; it ends when the guard is dropped.
    pub fn begin_bundle(&mut self) -> BundleEncoder<'_> {
        let id = BundleId(take(&mut self.next.bundle));
        self.push(Command::BeginBundle { id });
        BundleEncoder::new(self, id)
    }

    /// The trace.
    pub fn finish(self) -> Trace {
        self.builder.finish()
    }

    /// Writes the trace as a folder.
    pub fn save(self, folder: impl AsRef<Path>) -> Result<(), TraceError> {
        super::write(&self.finish(), folder)
    }

    /// Writes the trace as one archive.
    pub fn save_zip(self, path: impl AsRef<Path>, packing: Packing) -> Result<(), TraceError> {
        super::write_zip(&self.finish(), path, packing)
    }
}
