//! The card's side: frame buffer, passes and pipelines. Draws are gathered into passes, so that all bytes of a pass are written before it.

use std::collections::{BTreeMap, BTreeSet};

use gfx::format::Format;
use gfx::state::*;
use num::*;
use trace::command::*;
use trace::record::{self, Recorder};

use super::image::Base;

/// Format of the window's colours. It has no alpha: that stays 1.
pub const COLOR: Format = Format::Rgba8Unorm;
/// Format of depth and stencil.
pub const DEPTH: Format = Format::Depth24PlusStencil8;

/// Bytes of vertices and indices of a pass after which it is ended.
const PASS_BYTES: usize = 64 << 20;
/// Uniform blocks begin at multiples of this.
const BLOCK_ALIGN: usize = 64;

/// One draw of a pass.
#[derive(Clone, Debug)]
pub struct Draw {
    /// What draws it.
    pub pipeline: RenderPipelineId,
    /// Its uniforms in the pass.
    pub uniforms: u32,
    /// Its first vertex byte in the pass.
    pub vertices: u64,
    /// Its first index in the pass.
    pub first: u32,
    /// Number of indices.
    pub count: u32,
    /// Textures.
    pub textures: Option<BindGroupId>,
    /// Viewport.
    pub viewport: Viewport,
    /// Scissor.
    pub scissor: Rect,
    /// Blend constant.
    pub blend: [f32; 4],
    /// Stencil reference.
    pub stencil: u32,
}

/// Draws that wait for their pass.
#[derive(Default)]
pub struct Pass {
    color: Option<[f64; 4]>,
    depth: Option<f32>,
    stencil: Option<u32>,
    draws: Vec<Draw>,
    /// Vertices of all draws.
    pub vertices: Vec<u8>,
    /// Indices of all draws.
    pub indices: Vec<u32>,
    uniforms: Vec<u8>,
    /// Where the last block begins.
    last_block: usize,
    /// Bytes of the largest block.
    block: usize,
    /// Textures that are read.
    pub textures: BTreeSet<TextureId>,
}

/// What a pipeline is made of beside its shader.
#[derive(Clone, Debug, PartialEq)]
pub struct Fixed {
    /// The module.
    pub shader: ShaderId,
    /// Attributes: location and format.
    pub attributes: Vec<(u32, VertexFormat)>,
    /// Primitive.
    pub primitive: Primitive,
    /// Depth and stencil.
    pub depth: DepthStencil,
    /// Blending.
    pub blend: Option<Blend>,
    /// Channels.
    pub mask: u8,
    /// Number of textures.
    pub textures: usize,
}

/// What a group of textures binds.
type GroupKey = Vec<(ViewId, SamplerId)>;

/// The frame buffer.
struct Window {
    size: [u32; 2],
    color: (TextureId, ViewId),
    depth: (TextureId, ViewId),
}

/// The card.
pub struct Card {
    /// What is recorded.
    pub recorder: Recorder,
    window: Option<Window>,
    /// The pass that waits.
    pub pass: Pass,
    pipelines: BTreeMap<ShaderId, Vec<(Fixed, RenderPipelineId)>>,
    uniform_layout: Option<BindGroupLayoutId>,
    texture_layouts: BTreeMap<usize, BindGroupLayoutId>,
    pipeline_layouts: BTreeMap<usize, PipelineLayoutId>,
    groups: BTreeMap<GroupKey, (BindGroupId, Vec<TextureId>)>,
    samplers: Vec<(SamplerDesc, SamplerId)>,
    copies: BTreeMap<Base, (RenderPipelineId, BindGroupLayoutId)>,
    clear_shader: Option<ShaderId>,
    /// What logic operations read.
    frame_copy: Option<(TextureId, ViewId)>,
    /// Frames so far.
    pub frames: u64,
    /// Bytes of vertices, indices and uniforms so far: the trace keeps them.
    pub bytes: u64,
}

impl Card {
    /// A card without a window.
    pub fn new(name: &std::path::Path) -> Card {
        Card {
            recorder: Recorder::new(name),
            window: None,
            pass: Pass::default(),
            pipelines: BTreeMap::new(),
            uniform_layout: None,
            texture_layouts: BTreeMap::new(),
            pipeline_layouts: BTreeMap::new(),
            groups: BTreeMap::new(),
            samplers: Vec::new(),
            copies: BTreeMap::new(),
            clear_shader: None,
            frame_copy: None,
            frames: 0,
            bytes: 0,
        }
    }

    /// The window's size; nothing where there is none.
    pub fn size(&self) -> [u32; 2] {
        self.window.as_ref().map_or([0; 2], |window| window.size)
    }

    /// Opens a window of this size, or changes its size. It starts black.
    pub fn resize(&mut self, size: [u32; 2]) {
        if self.size() == size {
            return;
        }
        self.end_pass();
        if let Some(old) = self.window.take() {
            for (texture, view) in [old.color, old.depth] {
                self.recorder.push(Command::Destroy(Object::View(view)));
                self.recorder.push(Command::Destroy(Object::Texture(texture)));
            }
        }
        if let Some((texture, view)) = self.frame_copy.take() {
            self.destroy(texture, &[view]);
        }
        let mut make = |label: &str, format| {
            let texture = self.recorder.create_texture(label, record::texture_2d(size[0], size[1], format));
            (texture, self.recorder.create_view(texture))
        };
        self.window = Some(Window { size, color: make("window", COLOR), depth: make("depth", DEPTH) });
        self.pass.color = Some([0.0, 0.0, 0.0, 1.0]);
        (self.pass.depth, self.pass.stencil) = (Some(1.0), Some(0));
    }

    /// Clears whole buffers.
    pub fn clear(&mut self, color: Option<[f32; 4]>, depth: Option<f32>, stencil: Option<u32>) {
        if !self.pass.draws.is_empty() {
            self.end_pass();
        }
        let pass = &mut self.pass;
        pass.color = color.map(|[r, g, b, _]| [f64::from(r), f64::from(g), f64::from(b), 1.0]).or(pass.color);
        pass.depth = depth.or(pass.depth);
        pass.stencil = stencil.or(pass.stencil);
    }

    /// Places a block of uniforms in the pass; one that equals the last is kept once.
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
        self.pass.draws.push(draw);
        if self.pass.vertices.len() + 4 * self.pass.indices.len() > PASS_BYTES {
            self.end_pass();
        }
    }

    /// Ends the pass that waits, if anything does.
    pub fn end_pass(&mut self) {
        let pass = std::mem::take(&mut self.pass);
        let Some(window) = &self.window else { return };
        if pass.draws.is_empty() && pass.color.is_none() && pass.depth.is_none() && pass.stencil.is_none() {
            return;
        }
        let (color, depth) = (window.color.1, window.depth.1);
        let mut buffers = Vec::new();
        let mut group = None;
        if !pass.draws.is_empty() {
            let mut uniforms = pass.uniforms;
            uniforms.resize(uniforms.len().next_multiple_of(BLOCK_ALIGN) + pass.block, 0);
            let indices: Vec<u8> = pass.indices.iter().flat_map(|index| index.to_le_bytes()).collect();
            self.bytes += (pass.vertices.len() + indices.len() + uniforms.len()) as u64;
            buffers = [("vertices", &pass.vertices), ("indices", &indices), ("uniforms", &uniforms)]
                .map(|(label, bytes)| self.recorder.create_buffer_init(label, bytes))
                .to_vec();
            let layout = self.uniform_layout();
            let bound = BoundResource::Buffer { buffer: buffers[2], offset: 0, size: Some(pass.block as u64) };
            group = Some(self.recorder.create_bind_group(layout, [(0, bound)]));
        }
        let color = ColorAttachment { clear: pass.color, ..record::load(color) };
        let depth = DepthAttachment {
            view: depth,
            depth_clear: pass.depth,
            depth_store: true,
            depth_read_only: false,
            stencil_clear: pass.stencil,
            stencil_store: true,
            stencil_read_only: false,
        };
        {
            let mut open = self.recorder.begin_render_pass([color], Some(depth));
            if let (Some(group), [vertices, indices, _]) = (group, &buffers[..]) {
                open.set_index_buffer(*indices, IndexFormat::Uint32);
                let mut last: Option<&Draw> = None;
                for draw in &pass.draws {
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
                        open.push(Command::SetStencilReference(draw.stencil));
                    }
                    open.set_bind_group_at(0, group, &[draw.uniforms]);
                    if let Some(textures) = draw.textures.filter(|&group| new(&|d| d.textures != Some(group))) {
                        open.set_bind_group(1, textures);
                    }
                    open.set_vertex_buffer_at(0, *vertices, draw.vertices);
                    open.draw_indexed_from(draw.count, 1, draw.first, 0, 0);
                    last = Some(draw);
                }
            }
        }
        if let Some(group) = group {
            self.recorder.push(Command::Destroy(Object::BindGroup(group)));
        }
        for buffer in buffers {
            self.recorder.push(Command::Destroy(Object::Buffer(buffer)));
        }
    }

    /// Shows the frame. The buffer keeps its contents.
    pub fn present(&mut self) {
        self.end_pass();
        if let Some(window) = &self.window {
            self.recorder.present(window.color.0);
            self.frames += 1;
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
        *self.texture_layouts.entry(count).or_insert_with(|| {
            let entries = (0..count as u32).flat_map(|k| [(2 * k, record::TEXTURE), (2 * k + 1, record::SAMPLER)]);
            recorder.create_bind_group_layout(entries)
        })
    }

    /// The pipeline of a shader and fixed state; made once.
    pub fn pipeline(&mut self, fixed: &Fixed) -> RenderPipelineId {
        let known = self.pipelines.get(&fixed.shader).and_then(|list| list.iter().find(|(known, _)| known == fixed));
        if let Some(&(_, id)) = known {
            return id;
        }
        let uniforms = self.uniform_layout();
        let count = fixed.textures;
        let layout = match self.pipeline_layouts.get(&count) {
            Some(&layout) => layout,
            None => {
                let mut groups = vec![uniforms];
                if count > 0 {
                    groups.push(self.texture_layout(count));
                }
                let layout = self.recorder.create_pipeline_layout(groups, 0);
                self.pipeline_layouts.insert(count, layout);
                layout
            }
        };
        let target = ColorTarget { format: COLOR, blend: fixed.blend, write_mask: fixed.mask };
        let desc = RenderPipelineDesc {
            layout: Some(layout),
            buffers: vec![record::vertex_buffer(&fixed.attributes)],
            primitive: fixed.primitive,
            depth_stencil: Some(fixed.depth),
            targets: vec![Some(target)],
            ..record::render_pipeline(fixed.shader, COLOR)
        };
        let id = self.recorder.create_render_pipeline("", desc);
        self.pipelines.entry(fixed.shader).or_default().push((fixed.clone(), id));
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
        if self.pass.textures.contains(&texture) {
            self.end_pass();
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

    /// A texture with the colours of the window as they are now, to be read by a draw.
    pub fn frame_copy(&mut self) -> Option<(TextureId, ViewId, SamplerId)> {
        self.end_pass();
        let window = self.window.as_ref()?;
        let (from, size) = (window.color.0, window.size);
        let (texture, view) = match self.frame_copy {
            Some(copy) => copy,
            None => {
                let texture = self.recorder.create_texture("frame", record::texture_2d(size[0], size[1], COLOR));
                *self.frame_copy.insert((texture, self.recorder.create_view(texture)))
            }
        };
        let end = |texture| TextureEnd { texture, level: 0, origin: [0; 3], aspect: Aspect::All };
        self.recorder.copy_texture_to_texture(end(from), end(texture), [size[0], size[1], 1]);
        Some((texture, view, self.sampler(SamplerDesc::default())))
    }

    /// The shader that clears parts of buffers.
    pub fn clear_shader(&mut self) -> ShaderId {
        let recorder = &mut self.recorder;
        *self.clear_shader.get_or_insert_with(|| {
            recorder.create_shader(
                "clear",
                "struct Uniforms { color: vec4f, depth: vec4f }\n@group(0) @binding(0) var<uniform> u: Uniforms;\n\
                 @vertex fn vs(@location(0) position: vec2f) -> @builtin(position) vec4f { return vec4f(position, u.depth.x, 1); }\n\
                 @fragment fn fs() -> @location(0) vec4f { return u.color; }\n",
            )
        })
    }

    /// Copies a rectangle of the window, whose lower left pixel is `from`, to a level of a texture, whose rows are from the bottom.
    pub fn copy_to_texture(
        &mut self,
        base: Base,
        texture: TextureId,
        layer: u32,
        level: u32,
        to: [u32; 2],
        from: [i32; 2],
        size: [u32; 2],
    ) {
        self.end_pass();
        let Some(window) = &self.window else { return };
        let (frame, height) = (window.color.1, window.size[1] as i32);
        let recorder = &mut self.recorder;
        let (pipeline, layout) = *self.copies.entry(base).or_insert_with(|| {
            let text = format!(
                "struct Uniforms {{ by: vec4i }}\n@group(0) @binding(0) var<uniform> u: Uniforms;\n\
                 @group(0) @binding(1) var frame: texture_2d<f32>;\n\
                 @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{\n    \
                 return vec4f(f32(i32(i & 1u) * 4 - 1), f32(i32(i & 2u) * 2 - 1), 0, 1);\n}}\n\
                 @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {{\n    \
                 let p = vec2i(u.by.x + i32(at.x), u.by.y - i32(at.y));\n    let size = vec2i(textureDimensions(frame));\n    \
                 // What is outside of the window is undefined.\n    \
                 if any(p < vec2i(0)) || any(p >= size) {{ discard; }}\n    \
                 let c = textureLoad(frame, p, 0);\n    return {};\n}}\n",
                base.unswizzle()
            );
            let shader = recorder.create_shader("copy", &text);
            let layout = recorder.create_bind_group_layout([(0, record::UNIFORM), (1, record::TEXTURE)]);
            let pipeline_layout = recorder.create_pipeline_layout([layout], 0);
            let desc = RenderPipelineDesc { layout: Some(pipeline_layout), ..record::render_pipeline(shader, base.format()) };
            (recorder.create_render_pipeline("copy", desc), layout)
        });
        // Texel y has the window's row height - 1 - (from + y - to).
        let by = [from[0] - to[0] as i32, height - 1 - from[1] + to[1] as i32, 0, 0];
        let bytes: Vec<u8> = by.iter().flat_map(|value| value.to_le_bytes()).collect();
        let uniforms = self.recorder.create_buffer_init("copy", &bytes);
        let desc = ViewDesc {
            base_level: level,
            levels: Some(1),
            base_layer: layer,
            layers: Some(1),
            dimension: Some(ViewDimension::D2),
            ..ViewDesc::default()
        };
        let view = self.recorder.create_view_of(texture, desc);
        let group = self.recorder.create_bind_group(layout, [(0, record::whole(uniforms)), (1, BoundResource::View(frame))]);
        {
            let mut pass = self.recorder.begin_render_pass([record::load(view)], None);
            pass.set_pipeline(pipeline);
            pass.set_scissor(Rect { x: to[0], y: to[1], width: size[0], height: size[1] });
            pass.set_bind_group(0, group);
            pass.draw(3, 1);
        }
        for object in [Object::BindGroup(group), Object::View(view), Object::Buffer(uniforms)] {
            self.recorder.push(Command::Destroy(object));
        }
    }
}
