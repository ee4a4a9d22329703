//! The card's side: framebuffer, passes and pipelines. Draws are gathered into passes, so all bytes of a pass are written before it starts.

use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use gfx::format::Format;
use gfx::state::*;
use num::*;
use trace::command::*;
use trace::record;
use trace::record::Recorder;

use crate::gl::card::copy_key::CopyKey;
use crate::gl::card::pass::{COLOR, Draw, Order, Pass, PipelineState, Surface, Target};
use crate::gl::card::windows::Windows;

/// A pass ends after this number of bytes of vertices and indices.
const PASS_BYTES: usize = 64 << 20;
/// Maximum number of buffers that wait to be freed.
const CONDEMNED_MAX: usize = 1024;
/// Uniform blocks begin at multiples of this.
const BLOCK_ALIGN: usize = 64;

/// What a group of textures binds.
type GroupKey = Vec<(ViewId, SamplerId)>;

/// Maximum number of bytes that stay on the card: primitives of lists, and conversions of buffer objects.
pub const ON_CARD_MAX: u64 = 64 << 20;

/// The card.
pub struct Card {
    /// The recorder of the commands.
    pub recorder: Recorder,
    /// Windows and other drawables.
    pub windows: Windows,
    /// Whether windows have alpha: the program has asked for it, or the reader of the trace.
    pub window_alpha: bool,
    target: Option<Target>,
    /// The pass that waits.
    pub pass: Pass,
    /// Passes that draw to windows in frames that are not wanted. They are recorded once something can read their results.
    held: Vec<Pass>,
    /// The first frame whose draws are wanted.
    pub first_frame: u64,
    /// Number of draws that were dropped, since nothing reads their results.
    pub dropped: u64,
    pipelines: NumberMap<ShaderId, Vec<(PipelineState, RenderPipelineId)>>,
    uniform_layout: Option<BindGroupLayoutId>,
    texture_layouts: NumberMap<u32, BindGroupLayoutId>,
    pipeline_layouts: NumberMap<u32, PipelineLayoutId>,
    groups: BTreeMap<GroupKey, (BindGroupId, Vec<TextureId>)>,
    samplers: Vec<(SamplerDesc, SamplerId)>,
    /// Pipelines that compute images from images.
    pub copies: Vec<(CopyKey, (RenderPipelineId, BindGroupLayoutId))>,
    /// Shaders that are not generated from a key, by name.
    plain_shaders: NameMap<ShaderId>,
    /// A copy of the framebuffer for logic operations to read, and its size.
    pub frame_copy: Option<(TextureId, ViewId, [u32; 2])>,
    /// Whether the first row of windows is their lowest.
    pub upward: bool,
    /// Whether all levels of textures are uploaded, not only those that can be read.
    pub all_levels: bool,
    /// Frames so far.
    pub frames: u64,
    /// Whether anything has been recorded that draws since the last frame.
    pub drawn: bool,
    /// Bytes of vertices, indices and uniforms so far: the trace keeps them.
    pub bytes: u64,
    /// Bytes of the primitives of display lists and of the conversions of buffer objects that stay on the card.
    pub on_card_bytes: u64,
    /// Buffers that are freed as soon as no pending pass reads them, and their bytes.
    condemned: Vec<(BufferId, u64)>,
}

impl Card {
    /// A card without a window.
    pub fn new(name: &std::path::Path) -> Card {
        Card {
            recorder: Recorder::new(name),
            windows: Windows::default(),
            window_alpha: false,
            target: None,
            pass: Pass::default(),
            held: Vec::new(),
            first_frame: 0,
            dropped: 0,
            pipelines: NumberMap::new(),
            uniform_layout: None,
            texture_layouts: NumberMap::new(),
            pipeline_layouts: NumberMap::new(),
            groups: BTreeMap::new(),
            samplers: Vec::new(),
            copies: Vec::new(),
            plain_shaders: NameMap::new(),
            frame_copy: None,
            all_levels: false,
            upward: false,
            frames: 0,
            drawn: false,
            bytes: 0,
            on_card_bytes: 0,
            condemned: Vec::new(),
        }
    }

    /// Makes an image that can be drawn to.
    pub fn create_surface(&mut self, label: &str, size: [u32; 2], format: Format) -> Surface {
        self.create_surface_of(label, record::texture_2d(size[0], size[1], format))
    }

    /// Makes a colour buffer of a window: the display ignores its alpha.
    pub fn create_color_buffer(&mut self, label: &str, size: [u32; 2]) -> Surface {
        self.create_surface_of(label, TextureDesc { opaque: true, ..record::texture_2d(size[0], size[1], COLOR) })
    }

    fn create_surface_of(&mut self, label: &str, desc: TextureDesc) -> Surface {
        let format = desc.format;
        let texture = self.recorder.create_texture(label, desc);
        Surface { texture, view: self.recorder.create_view(texture), format, level: 0, layer: 0, narrow: None }
    }

    /// Frees an image that [`Card::create_surface`] made.
    pub fn destroy_surface(&mut self, surface: Surface) {
        self.destroy(surface.texture, &[surface.view]);
    }

    /// Copies an image to another one of the same size.
    pub fn copy_surface(&mut self, from: Surface, to: Surface, size: [u32; 2]) {
        let end =
            |of: Surface| TextureEnd { texture: of.texture, level: of.level, origin: [0, 0, of.layer], aspect: Aspect::All };
        self.recorder.copy_texture_to_texture(end(from), end(to), [size[0], size[1], 1]);
    }

    /// Takes the recorded commands; pending passes stay.
    pub fn drain(&mut self) -> trace::CommandChunk {
        self.bytes = 0;
        self.recorder.drain()
    }

    /// Whether the current frame is wanted.
    pub fn is_wanted(&self) -> bool {
        self.frames >= self.first_frame
    }

    /// The current render target.
    pub fn target(&self) -> Option<Target> {
        self.target
    }

    /// Sets the render target.
    pub fn aim(&mut self, target: Option<Target>) {
        if self.target == target {
            return;
        }
        self.close();
        for surface in target.iter().flat_map(Target::surfaces) {
            if target.is_some_and(|target| target.window.is_none()) {
                self.release(surface.texture);
            }
        }
        self.target = target;
    }

    /// Clears whole buffers.
    pub fn clear(&mut self, color: Option<[f32; 4]>, depth: Option<f32>, stencil: Option<u32>) {
        if !self.pass.draws.is_empty() {
            self.close();
        }
        let clear = self.recorder.call_site();
        let pass = &mut self.pass;
        pass.clear = clear.or(pass.clear);
        pass.color = color.map(|color| color.map(f64::from)).or(pass.color);
        pass.depth = depth.or(pass.depth);
        pass.stencil = stencil.or(pass.stencil);
    }

    /// Appends a block of uniforms to the pass, unless it equals the last one.
    pub fn uniforms(&mut self, bytes: &[u8]) -> u32 {
        let pass = &mut self.pass;
        if pass.draws.is_empty() || pass.uniforms.get(pass.last_block..) != Some(bytes) {
            pass.uniforms.resize(pass.uniforms.len().next_multiple_of(BLOCK_ALIGN), 0);
            pass.last_block = pass.uniforms.len();
            pass.uniforms.extend_from_slice(bytes);
            pass.block = pass.block.max(bytes.len());
        }
        pass.last_block as u32
    }

    /// Adds a draw to the pass.
    pub fn draw(&mut self, draw: Draw) {
        let indices = match draw.order {
            Order::Indices { buffer, .. } => buffer,
            Order::Sequence(_) => None,
        };
        for buffer in draw.vertices.iter().map(|range| range.buffer).chain([indices]).flatten() {
            // Draws that read only parts of a buffer have noted them.
            self.pass.buffers.get_or_insert_with(buffer, || 0..u64::MAX);
        }
        self.pass.draws.push(draw);
        if self.pass.vertices.len() + 4 * self.pass.indices.len() > PASS_BYTES {
            self.close();
        }
    }

    /// Ends the pending pass, if any, and records all held passes, so that their results can be read.
    pub fn end_pass(&mut self) {
        self.close();
        for pass in std::mem::take(&mut self.held) {
            self.emit(pass);
        }
        self.free_condemned();
    }

    /// Frees a buffer of this size as soon as no pending pass reads it.
    pub fn condemn(&mut self, buffer: BufferId, bytes: u64) {
        if !self.reads(buffer, &(0..u64::MAX)) {
            return self.recorder.push(Command::Destroy(Object::Buffer(buffer)));
        }
        self.condemned.push((buffer, bytes));
        let all: u64 = self.condemned.iter().map(|&(_, bytes)| bytes).sum();
        if all > PASS_BYTES as u64 || self.condemned.len() > CONDEMNED_MAX {
            // A program may replace a buffer before each draw, and passes may be held back for many frames.
            self.end_pass();
        }
    }

    /// Frees condemned buffers that no pending pass reads any more.
    fn free_condemned(&mut self) {
        let mut condemned = std::mem::take(&mut self.condemned);
        condemned.retain(|&(buffer, _)| {
            let read = self.reads(buffer, &(0..u64::MAX));
            if !read {
                self.recorder.push(Command::Destroy(Object::Buffer(buffer)));
            }
            read
        });
        self.condemned = condemned;
    }

    /// Whether a pending pass reads any of these bytes of a buffer.
    pub fn reads(&self, buffer: BufferId, bytes: &Range<u64>) -> bool {
        let reads = |pass: &Pass| pass.buffers.get(buffer).is_some_and(|read| read.start < bytes.end && bytes.start < read.end);
        self.held.iter().chain([&self.pass]).any(reads)
    }

    /// Ends the pending passes if any of them reads or writes this texture.
    pub fn release(&mut self, texture: TextureId) {
        self.pass.target = self.target;
        if self.held.iter().chain([&self.pass]).any(|pass| pass.uses(texture)) {
            self.end_pass();
        }
    }

    /// Ends the pending pass. In a frame that is not wanted, it is held back if it draws to a window. If it clears all that held passes
    /// wrote to that window, they are dropped.
    pub fn close(&mut self) {
        let mut pass = std::mem::take(&mut self.pass);
        pass.target = self.target;
        if pass.is_empty() || pass.target.is_none() {
            return;
        }
        let back = |pass: &Pass| pass.target.and_then(|target| target.color);
        let window = pass.target.and_then(|target| target.window);
        if self.is_wanted() || window.is_none_or(|window| back(&pass) != self.windows.back(window)) {
            // Held passes may stay held if they and this pass do not read or write the same images.
            let drawn: Vec<Surface> = pass.target.iter().flat_map(Target::surfaces).collect();
            let shared = drawn.into_iter().any(|surface| self.held.iter().any(|held| held.uses(surface.texture)));
            let reads = self.held.iter().filter_map(back).any(|surface| pass.textures.contains(surface.texture));
            if self.is_wanted() || shared || reads {
                for held in std::mem::take(&mut self.held) {
                    self.emit(held);
                }
            }
            self.emit(pass);
            return self.free_condemned();
        }
        let same = |held: &Pass| held.target.is_some_and(|target| target.window == window);
        let drawn = self.held.iter().filter(|held| same(held)).flat_map(|held| &held.draws);
        if drawn.fold(0, |all, draw| all | draw.writes) & !pass.clears() == 0 {
            let gone: Vec<Pass> = self.held.extract_if(.., |held| same(held)).collect();
            self.dropped += gone.iter().map(|held| held.draws.len() as u64).sum::<u64>();
            for held in gone.into_iter().rev() {
                // Their clears of other buffers are kept.
                pass.color = pass.color.or(held.color);
                pass.depth = pass.depth.or(held.depth);
                pass.stencil = pass.stencil.or(held.stencil);
            }
        }
        self.held.push(pass);
        self.free_condemned();
    }

    /// Records a pass.
    fn emit(&mut self, mut pass: Pass) {
        let Some(target) = pass.target else { return };
        self.drawn = true;
        let mut buffers = Vec::new();
        let mut group = None;
        if !pass.draws.is_empty() {
            let mut uniforms = std::mem::take(&mut pass.uniforms);
            uniforms.resize(uniforms.len().next_multiple_of(BLOCK_ALIGN) + pass.block, 0);
            let indices = word_bytes(&pass.indices);
            self.bytes += (pass.vertices.len() + indices.len() + uniforms.len()) as u64;
            let mut own = [None; 2];
            if !pass.vertices.is_empty() {
                let vertices = self.recorder.create_buffer("vertices", pass.vertices.len() as u64);
                if pass.gaps.is_empty() {
                    self.recorder.write_buffer(vertices, 0, "vertices", std::mem::take(&mut pass.vertices));
                } else {
                    for (at, bytes) in pass.uploads() {
                        self.recorder.write_buffer(vertices, at, "vertices", bytes);
                    }
                }
                own[0] = Some(vertices);
            }
            if !indices.is_empty() {
                own[1] = Some(self.recorder.create_buffer_init("indices", indices));
            }
            let uniforms = self.recorder.create_buffer_init("uniforms", uniforms);
            buffers = own.into_iter().flatten().chain([uniforms]).collect();
            let layout = self.uniform_layout();
            let bound = BoundResource::Buffer { buffer: uniforms, offset: 0, size: Some(pass.block as u64) };
            group = Some((self.recorder.create_bind_group(layout, [(0, bound)]), own));
        }
        // A buffer without alpha has alpha 1, and only floating-point buffers store values outside [0, 1].
        let cleared = |[r, g, b, a]: [f64; 4], color: Surface, alpha: bool| {
            let value = [r, g, b, if alpha { a } else { 1.0 }];
            if color.is_float() { value } else { value.map(|channel| channel.clamp(0.0, 1.0)) }
        };
        let attachment = |(color, alpha): (Surface, bool)| ColorAttachment {
            clear: pass.color.map(|value| cleared(value, color, alpha)),
            ..record::load(color.view)
        };
        let color: Vec<_> = target.colors().map(attachment).collect();
        let depth = target.depth.map(|depth| DepthAttachment {
            depth_clear: pass.depth,
            stencil_clear: pass.stencil,
            ..record::load_depth(depth.view)
        });
        // A query of the recording becomes one query of the set in each pass that it spans.
        let mut queries: Vec<u64> = pass.draws.iter().filter_map(|draw| draw.query).collect();
        queries.sort_unstable();
        queries.dedup();
        let set = (!queries.is_empty()).then(|| self.recorder.create_query_set(QueryKind::Occlusion, queries.len() as u32));
        let now = self.recorder.call_site();
        let drawn = pass.draws.first().map(|draw| CallSite::Call(draw.made.call));
        pass.clear.or(drawn).into_iter().for_each(|site| self.recorder.set_call_site(site));
        {
            let mut open = self.recorder.begin_render_pass_with(color, depth, set);
            if let Some((group, own)) = group {
                let mut last: Option<&Draw> = None;
                let (mut bound_vertices, mut bound_indices) = (Vec::new(), None);
                let mut groups: &[Rc<str>] = &[];
                for draw in &pass.draws {
                    let query = last.and_then(|last| last.query);
                    if query != draw.query {
                        if query.is_some() {
                            open.push(Command::EndOcclusionQuery);
                        }
                        if let Some(index) = draw.query.and_then(|query| queries.iter().position(|&known| known == query)) {
                            open.push(Command::BeginOcclusionQuery { index: index as u32 });
                        }
                    }
                    let new = |differs: &dyn Fn(&Draw) -> bool| last.is_none_or(differs);
                    if new(&|d| d.pipeline != draw.pipeline) {
                        open.set_pipeline(draw.pipeline);
                    }
                    if new(&|d| d.viewport != draw.viewport) {
                        open.set_viewport(draw.viewport);
                    }
                    if new(&|d| d.scissor != draw.scissor) {
                        open.set_scissor(draw.scissor);
                    }
                    if new(&|d| d.blend != draw.blend) {
                        open.set_blend_constant(draw.blend.map(f64::from));
                    }
                    if new(&|d| d.stencil != draw.stencil) {
                        open.set_stencil_references(draw.stencil);
                    }
                    open.set_bind_group_at(0, group, &[draw.uniforms]);
                    if let Some(textures) = draw.textures.filter(|&group| new(&|d| d.textures != Some(group))) {
                        open.set_bind_group(1, textures);
                    }
                    bound_vertices.resize(bound_vertices.len().max(draw.vertices.len()), None);
                    for (slot, (&range, bound)) in draw.vertices.iter().zip(&mut bound_vertices).enumerate() {
                        let Some(buffer) = range.buffer.or(own[0]).filter(|_| *bound != Some(range)) else { continue };
                        open.set_vertex_buffer_at(slot as u32, buffer, range.offset);
                        *bound = Some(range);
                    }
                    enter_groups(&mut open, groups, &draw.made.groups);
                    groups = &draw.made.groups;
                    open.push(Command::SetCallSite(CallSite::Call(draw.made.call)));
                    match draw.order {
                        Order::Sequence(first) => open.draw_from(draw.count, 1, first, 0),
                        Order::Indices { buffer, format, first, base } => {
                            let wanted = buffer.or(own[1]).map(|buffer| (buffer, format));
                            if let Some((buffer, format)) = wanted.filter(|_| bound_indices != wanted) {
                                open.set_index_buffer(buffer, format);
                                bound_indices = wanted;
                            }
                            open.draw_indexed_from(draw.count, 1, first, base, 0);
                        }
                    }
                    last = Some(draw);
                }
                if last.is_some_and(|last| last.query.is_some()) {
                    open.push(Command::EndOcclusionQuery);
                }
                enter_groups(&mut open, groups, &[]);
            }
        }
        now.into_iter().for_each(|site| self.recorder.set_call_site(site));
        if let Some(set) = set {
            self.recorder.push(Command::Destroy(Object::QuerySet(set)));
        }
        if let Some((group, _)) = group {
            self.recorder.push(Command::Destroy(Object::BindGroup(group)));
        }
        for buffer in buffers {
            self.recorder.push(Command::Destroy(Object::Buffer(buffer)));
        }
    }

    fn uniform_layout(&mut self) -> BindGroupLayoutId {
        let recorder = &mut self.recorder;
        *self
            .uniform_layout
            .get_or_insert_with(|| recorder.create_bind_group_layout([(0, BindingKind::Uniform { dynamic_offset: true })]))
    }

    fn texture_layout(&mut self, count: usize) -> BindGroupLayoutId {
        let recorder = &mut self.recorder;
        *self.texture_layouts.get_or_insert_with(count as u32, || {
            let entries = (0..count as u32).flat_map(|k| [(2 * k, record::TEXTURE), (2 * k + 1, record::SAMPLER)]);
            recorder.create_bind_group_layout(entries)
        })
    }

    /// The pipeline of a shader and fixed state; made once.
    pub fn pipeline(&mut self, fixed: &PipelineState) -> RenderPipelineId {
        let known = self.pipelines.get(fixed.shader).and_then(|list| list.iter().find(|(known, _)| known == fixed));
        if let Some(&(_, id)) = known {
            return id;
        }
        let uniforms = self.uniform_layout();
        let count = fixed.textures;
        let layout = match self.pipeline_layouts.get(count as u32) {
            Some(&layout) => layout,
            None => {
                let mut groups = vec![uniforms];
                if count > 0 {
                    groups.push(self.texture_layout(count));
                }
                let layout = self.recorder.create_pipeline_layout(groups, 0);
                self.pipeline_layouts.insert(count as u32, layout);
                layout
            }
        };
        let desc = RenderPipelineDesc {
            layout: Some(layout),
            buffers: fixed.buffers.iter().cloned().map(Some).collect(),
            primitive: fixed.primitive,
            depth_stencil: fixed.depth,
            targets: {
                let first = |format| ColorTarget { format, blend: fixed.blend, logic: fixed.logic, write_mask: fixed.mask };
                fixed.color.map(first).into_iter().chain(fixed.more.iter().cloned()).map(Some).collect()
            },
            ..record::render_pipeline(fixed.shader, COLOR)
        };
        let id = self.recorder.create_render_pipeline("", desc);
        self.pipelines.get_or_insert_with(fixed.shader, Default::default).push((fixed.clone(), id));
        id
    }

    /// A sampler; made once.
    pub fn sampler(&mut self, desc: SamplerDesc) -> SamplerId {
        if let Some(&(_, id)) = self.samplers.iter().find(|(known, _)| *known == desc) {
            return id;
        }
        let id = self.recorder.create_sampler(desc);
        self.samplers.push((desc, id));
        id
    }

    /// The group of these textures; made once.
    pub fn textures(&mut self, bound: &[(TextureId, ViewId, SamplerId)]) -> BindGroupId {
        let key: GroupKey = bound.iter().map(|&(_, view, sampler)| (view, sampler)).collect();
        if let Some(&(id, _)) = self.groups.get(&key) {
            return id;
        }
        let layout = self.texture_layout(bound.len());
        let entries = key.iter().enumerate().flat_map(|(k, &(view, sampler))| {
            let k = k as u32;
            [(2 * k, BoundResource::View(view)), (2 * k + 1, BoundResource::Sampler(sampler))]
        });
        let id = self.recorder.create_bind_group(layout, entries.collect::<Vec<_>>());
        self.groups.insert(key, (id, bound.iter().map(|&(texture, ..)| texture).collect()));
        id
    }

    /// Destroys a texture with its views, after the pass that may read it.
    pub fn destroy(&mut self, texture: TextureId, views: &[ViewId]) {
        self.release(texture);
        if self.target.is_some_and(|target| target.surfaces().any(|surface| surface.texture == texture)) {
            self.target = None;
        }
        let gone: Vec<_> =
            self.groups.iter().filter(|(_, (_, used))| used.contains(&texture)).map(|(key, _)| key.clone()).collect();
        for key in gone {
            if let Some((group, _)) = self.groups.remove(&key) {
                self.recorder.push(Command::Destroy(Object::BindGroup(group)));
            }
        }
        for &view in views {
            self.recorder.push(Command::Destroy(Object::View(view)));
        }
        self.recorder.push(Command::Destroy(Object::Texture(texture)));
    }

    /// A shader that is not generated from a key; made once.
    pub fn plain_shader(&mut self, label: &'static str, text: &str) -> ShaderId {
        let recorder = &mut self.recorder;
        *self.plain_shaders.get_or_insert_with(label, || recorder.create_shader(label, text))
    }
}

/// Leaves the debug groups that are open in a pass for others. Those that both have from the outermost one on stay open.
fn enter_groups(pass: &mut record::RenderPass<'_>, open: &[Rc<str>], wanted: &[Rc<str>]) {
    let shared = open.iter().zip(wanted).take_while(|(a, b)| a == b).count();
    open[shared..].iter().for_each(|_| pass.push(Command::PopDebugGroup));
    wanted[shared..].iter().for_each(|label| pass.push(Command::PushDebugGroup(label.to_string())));
}
