//! Random sequences of passes, copies, uploads and clears, for the property test and the fuzz target.
//!
//! All that decides what a machine's stores hold is left to choice: formats, views with and without sRGB, samples, levels, layers and slices, load
//! and store operations of each aspect, attachments that are only read, resolves, copies of whole images, of parts, of one aspect and of several layers,
//! uploads and dispatches between passes, textures that are destroyed and made again. At the end each image that a pass can load is loaded and shown,
//! depths and stencil values by tests against them.

use std::collections::BTreeMap;

use gfx::format::{Format, TexelKind};
use gfx::state::*;
use num::*;
use trace::Trace;
use trace::command::*;
use trace::record::{self, Recorder};

/// Where choices come from.
pub enum Choices<'b> {
    /// A generator of random numbers.
    Random(Random),
    /// A fuzzer's bytes; zeros behind them.
    #[allow(dead_code, reason = "the fuzz target makes these")]
    Bytes(std::slice::Iter<'b, u8>),
}

impl Choices<'_> {
    fn below(&mut self, n: u32) -> u32 {
        match self {
            Choices::Random(random) => random.below(n),
            Choices::Bytes(bytes) => bytes.next().map_or(0, |&byte| u32::from(byte)) % n,
        }
    }

    /// True `part` times of `of`.
    fn chance(&mut self, part: u32, of: u32) -> bool {
        self.below(of) < part
    }

    fn of<T: Copy>(&mut self, things: &[T]) -> T {
        things[self.below(things.len() as u32) as usize]
    }
}

/// A sequence.
pub struct Sequence {
    /// The trace.
    pub trace: Trace,
    /// No pixel depends on the order of draws: machines that keep no order draw it too.
    pub unordered: bool,
    /// Frames.
    pub frames: u32,
}

/// Colour formats of textures, and of each the other format that views may have.
const COLORS: [(Format, Option<Format>); 13] = [
    (Format::Rgba8Unorm, Some(Format::Rgba8UnormSrgb)),
    (Format::Rgba8UnormSrgb, Some(Format::Rgba8Unorm)),
    (Format::Bgra8Unorm, Some(Format::Bgra8UnormSrgb)),
    (Format::Bgra8UnormSrgb, Some(Format::Bgra8Unorm)),
    (Format::R8Unorm, None),
    (Format::Rg8Unorm, None),
    (Format::Rg16Float, None),
    (Format::Rgba16Float, None),
    (Format::R32Float, None),
    (Format::Rgba32Float, None),
    (Format::Rgb10a2Unorm, None),
    (Format::R32Uint, None),
    (Format::Rgba8Sint, None),
];

const DEPTHS: [Format; 6] = [
    Format::Stencil8,
    Format::Depth16Unorm,
    Format::Depth24Plus,
    Format::Depth24PlusStencil8,
    Format::Depth32Float,
    Format::Depth32FloatStencil8,
];

const CLEAR_DEPTHS: [f32; 5] = [0.0, 0.25, 0.3, 0.75, 1.0];

/// Stencil values that clears and draws leave, or are one step beside these.
const STENCILS: [u32; 8] = [0, 1, 2, 126, 127, 128, 254, 255];

const COMPARES: [Compare; 6] =
    [Compare::Always, Compare::Less, Compare::LessEqual, Compare::Greater, Compare::Equal, Compare::NotEqual];

const OPS: [StencilOp; 5] = [StencilOp::Keep, StencilOp::Replace, StencilOp::Zero, StencilOp::IncrementWrap, StencilOp::Invert];

/// The formats that views of a colour texture may have.
fn view_formats(format: Format) -> Vec<Format> {
    let other = COLORS.iter().find(|(of, _)| *of == format).and_then(|(_, other)| *other);
    std::iter::once(format).chain(other).collect()
}

struct Texture {
    id: TextureId,
    desc: TextureDesc,
    /// Views of one image each.
    views: BTreeMap<(Format, u32, u32), ViewId>,
}

/// An image: a layer or slice of a level of a texture.
#[derive(Clone, Copy, PartialEq, Eq)]
struct Image {
    texture: usize,
    level: u32,
    layer: u32,
}

/// A view of an image as an attachment.
#[derive(Clone, Copy)]
struct Target {
    image: Image,
    format: Format,
    view: ViewId,
    slice: Option<u32>,
}

/// What a draw covers, in eighths of the attachments; its depth in eighths; and the number of its colour.
pub fn instance([left, top]: [u32; 2], [right, bottom]: [u32; 2], depth: u32, color: u32) -> u32 {
    left | top << 3 | (right - 1) << 6 | (bottom - 1) << 9 | depth << 12 | color << 15
}

/// What covers all of the attachments.
pub const EVERYWHERE: ([u32; 2], [u32; 2]) = ([0, 0], [8, 8]);

/// A module whose fragment stage writes colours of these kinds.
pub fn shader(kinds: &[Option<TexelKind>], discards: bool) -> String {
    let value = |kind| match kind {
        TexelKind::Uint => ("vec4u", "vec4u(k >> 15u & 15u, 7u, 9u, 3u)"),
        TexelKind::Sint => ("vec4i", "vec4i(i32(k >> 15u & 15u) - 8, 7, -9, 3)"),
        _ => ("vec4f", "vec4f(vec3f(vec3u(k >> 15u, k >> 19u, k >> 23u) & vec3u(15u)), f32(k >> 27u & 3u) * 5.0 + 1.0) / 16.0"),
    };
    let (mut members, mut stores) = (String::new(), String::new());
    for (location, kind) in kinds.iter().enumerate() {
        let Some(kind) = *kind else { continue };
        let (name, value) = value(kind);
        members.push_str(&format!("@location({location}) c{location}: {name},"));
        stores.push_str(&format!("out.c{location} = {value};"));
    }
    let discard = if discards { "if (u32(p.x) + u32(p.y)) % 3u == 0u { discard; }" } else { "" };
    let fragment = match members.is_empty() {
        true => format!("@fragment fn fs(@builtin(position) p: vec4f) {{ {discard} }}"),
        false => format!(
            "struct Out {{ {members} }}
             @fragment fn fs(@builtin(position) p: vec4f, @location(0) @interpolate(flat) k: u32) -> Out {{
                 var out: Out; {discard} {stores} return out;
             }}"
        ),
    };
    format!(
        "struct V {{ @builtin(position) p: vec4f, @location(0) @interpolate(flat) k: u32 }}
         @vertex fn vs(@builtin(vertex_index) v: u32, @builtin(instance_index) k: u32) -> V {{
             let low = vec2f(f32(k & 7u), f32(k >> 3u & 7u));
             let high = vec2f(f32(k >> 6u & 7u), f32(k >> 9u & 7u)) + 1.0;
             let right = v == 1u || v == 2u || v == 4u;
             let bottom = v == 2u || v == 4u || v == 5u;
             let at = vec2f(select(low.x, high.x, right), select(low.y, high.y, bottom)) / 4.0 - 1.0;
             return V(vec4f(at.x, -at.y, f32(k >> 12u & 7u) / 8.0, 1.0), k);
         }}
         {fragment}"
    )
}

/// What a pipeline is made of.
#[derive(Clone, PartialEq)]
struct PipelineKey {
    targets: Vec<Option<ColorTarget>>,
    depth_stencil: Option<DepthStencil>,
    samples: u32,
    discards: bool,
    /// Whether what is drawn, clockwise, shows its front.
    front: bool,
}

struct Generator<'c, 'b> {
    card: Recorder,
    choose: &'c mut Choices<'b>,
    unordered: bool,
    frames: u32,
    textures: Vec<Texture>,
    /// Textures that show what cannot be shown itself.
    shown: Vec<usize>,
    shaders: Vec<(String, ShaderId)>,
    pipelines: Vec<(PipelineKey, RenderPipelineId)>,
    store: Option<(BindGroupLayoutId, ComputePipelineId)>,
    buffer: BufferId,
}

/// Bytes of the buffer that copies go to and come from.
const BUFFER: u64 = 1 << 16;

/// Bytes of no order.
fn bytes(length: usize, seed: u32) -> Vec<u8> {
    (0..length as u32).map(|at| hash(at.wrapping_mul(31).wrapping_add(seed)) as u8 & 0x7f).collect()
}

const TIGHT: LinearLayout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };

/// Makes a sequence.
pub fn sequence(choose: &mut Choices<'_>) -> Sequence {
    let mut card = Recorder::new("sequence");
    let buffer = card.create_buffer_init("buffer", bytes(BUFFER as usize, 1));
    let unordered = choose.chance(1, 4);
    let mut generator = Generator {
        card,
        choose,
        unordered,
        frames: 0,
        textures: Vec::new(),
        shown: Vec::new(),
        shaders: Vec::new(),
        pipelines: Vec::new(),
        store: None,
        buffer,
    };
    generator.create();
    for _ in 0..4 + generator.choose.below(10) {
        generator.step();
    }
    generator.show_all();
    Sequence { trace: generator.card.finish(), unordered, frames: generator.frames }
}

impl Generator<'_, '_> {
    /// Makes textures: few shapes, so that images fit each other.
    fn create(&mut self) {
        let size = [12 + self.choose.below(25), 12 + self.choose.below(9)];
        let families = [self.choose.below(4) as usize, self.choose.below(COLORS.len() as u32) as usize];
        let depths = [self.choose.of(&DEPTHS), self.choose.of(&DEPTHS)];
        let samples = if self.choose.chance(1, 2) { 4 } else { 1 };
        for _ in 0..2 + self.choose.below(3) {
            let (format, other) = COLORS[families[self.choose.below(2) as usize]];
            let format = other.filter(|_| self.choose.chance(1, 3)).unwrap_or(format);
            self.create_texture(size, format, samples, true);
        }
        for _ in 0..1 + self.choose.below(2) {
            let format = depths[self.choose.below(2) as usize];
            self.create_texture(size, format, samples, false);
        }
    }

    /// Makes a texture of which some levels have this size.
    fn create_texture(&mut self, size: [u32; 2], format: Format, samples: u32, color: bool) {
        let samples = if samples > 1 && self.choose.chance(2, 3) { samples } else { 1 };
        let flat = samples > 1 || self.choose.chance(1, 2);
        let mut desc = record::texture_multisampled(size[0], size[1], samples, format);
        if !flat {
            let levels = self.choose.below(2);
            desc.size = [size[0] << levels, size[1] << levels, 1 + self.choose.below(3)];
            desc.levels = 1 + self.choose.below(2);
            if color && self.choose.chance(1, 4) {
                desc.dimension = TextureDimension::D3;
            }
        }
        let id = self.card.create_texture("image", desc.clone());
        self.textures.push(Texture { id, desc, views: BTreeMap::new() });
    }

    fn images(&self) -> Vec<Image> {
        let textures = self.textures.iter().enumerate();
        let of = textures.flat_map(|(texture, Texture { desc, .. })| {
            (0..desc.levels).flat_map(move |level| {
                let layers = if desc.dimension == TextureDimension::D3 { desc.level_size(level)[2] } else { desc.size[2] };
                (0..layers).map(move |layer| Image { texture, level, layer })
            })
        });
        of.collect()
    }

    fn desc(&self, image: Image) -> &TextureDesc {
        &self.textures[image.texture].desc
    }

    fn size(&self, image: Image) -> [u32; 2] {
        let [width, height, _] = self.desc(image).level_size(image.level);
        [width, height]
    }

    fn is_depth(&self, image: Image) -> bool {
        self.desc(image).format.is_depth_stencil()
    }

    /// Some view of an image.
    fn target(&mut self, image: Image) -> Target {
        let format = self.desc(image).format;
        let format = self.choose.of(&view_formats(format));
        self.view(image, format)
    }

    fn view(&mut self, image: Image, format: Format) -> Target {
        let Image { texture, level, layer } = image;
        let of = &mut self.textures[texture];
        let solid = of.desc.dimension == TextureDimension::D3;
        let own = (format != of.desc.format).then_some(format);
        let desc = ViewDesc {
            format: own,
            dimension: Some(if solid { ViewDimension::D3 } else { ViewDimension::D2 }),
            base_level: level,
            levels: Some(1),
            base_layer: if solid { 0 } else { layer },
            layers: Some(1),
            ..ViewDesc::default()
        };
        let card = &mut self.card;
        let place = (format, level, desc.base_layer);
        let view = *of.views.entry(place).or_insert_with(|| card.create_view_of(of.id, desc));
        Target { image, format, view, slice: solid.then_some(layer) }
    }

    fn end(&self, image: Image, aspect: Aspect) -> TextureEnd {
        let texture = self.textures[image.texture].id;
        TextureEnd { texture, level: image.level, origin: [0, 0, image.layer], aspect }
    }

    fn step(&mut self) {
        match self.choose.below(16) {
            0..8 => self.pass(),
            8 | 9 => self.copy(),
            10 => self.copy_through_buffer(),
            11 => self.upload(),
            12 => self.clear(),
            13 => self.dispatch(),
            14 => self.make_again(),
            _ => self.present(),
        }
    }

    /// Whether an image is one of a set of attachments that fit each other.
    fn fits(&self, image: Image, first: Image) -> bool {
        self.size(image) == self.size(first) && self.desc(image).samples == self.desc(first).samples
    }

    fn pass(&mut self) {
        let images = self.images();
        let first = self.choose.of(&images);
        let (mut colors, mut depths): (Vec<Image>, Vec<Image>) =
            images.iter().copied().filter(|&image| self.fits(image, first)).partition(|&image| !self.is_depth(image));
        let mut of: Vec<Option<Target>> = Vec::new();
        let most = if self.is_depth(first) { self.choose.below(3) } else { 1 + self.choose.below(2) };
        if !self.is_depth(first) {
            colors.retain(|&image| image != first);
            of.push(Some(self.target(first)));
        }
        while (of.len() as u32) < most && !colors.is_empty() {
            let image = colors.swap_remove(self.choose.below(colors.len() as u32) as usize);
            of.push(Some(self.target(image)));
        }
        if of.len() == 1 && self.choose.chance(1, 8) {
            of.insert(0, None);
        }
        if self.is_depth(first) {
            depths = vec![first];
        }
        let depth = (!depths.is_empty() && (self.is_depth(first) || self.choose.chance(2, 3)))
            .then(|| depths[self.choose.below(depths.len() as u32) as usize])
            .map(|image| self.target(image));
        let mut resolved = Vec::new();
        let color: Vec<Option<ColorAttachment>> =
            of.iter().map(|target| target.map(|target| self.color_attachment(target, &images, &mut resolved))).collect();
        let attachment = depth.map(|target| self.depth_attachment(target));
        let samples = self.desc(first).samples;
        let most = if self.unordered { 2 } else { 4 };
        let mut draws = Vec::new();
        for _ in 0..self.choose.below(most) {
            draws.push(self.draw(&of, depth.zip(attachment.as_ref()), samples));
        }
        let size = self.size(first);
        self.card.push(Command::BeginRenderPass { color, depth: attachment, occlusion: None, timestamps: None, label: None });
        for (pipeline, references, instance) in draws {
            self.card.push(Command::SetRenderPipeline(pipeline));
            self.card.push(Command::stencil_references(references));
            if self.choose.chance(1, 4) {
                let [x, y] = size.map(|side| self.choose.below(side));
                let rect = Rect { x, y, width: size[0] - x, height: size[1] - y };
                self.card.push(Command::SetScissor(rect));
            }
            self.card.push(Command::Draw { vertices: 6, instances: 1, first_vertex: 0, first_instance: instance });
        }
        self.card.push(Command::EndRenderPass);
    }

    fn color_attachment(&mut self, target: Target, images: &[Image], resolved: &mut Vec<Image>) -> ColorAttachment {
        let part = |choose: &mut Choices<'_>| f64::from(choose.below(9)) / 8.0;
        let clear = self.choose.chance(2, 5).then(|| [(); 4].map(|()| part(self.choose)));
        let mut resolve = None;
        if self.desc(target.image).samples > 1 && self.choose.chance(1, 2) {
            let fits = |&&image: &&Image| {
                let to = self.desc(image);
                let flat = to.samples == 1 && to.dimension == TextureDimension::D2;
                flat && self.size(image) == self.size(target.image)
                    && view_formats(to.format).contains(&target.format)
                    && !resolved.contains(&image)
            };
            let fits: Vec<Image> = images.iter().filter(fits).copied().collect();
            if !fits.is_empty() {
                let to = self.choose.of(&fits);
                resolved.push(to);
                resolve = Some(self.view(to, target.format).view);
            }
        }
        ColorAttachment { view: target.view, depth_slice: target.slice, resolve, clear, store: self.choose.chance(4, 5) }
    }

    fn depth_attachment(&mut self, target: Target) -> DepthAttachment {
        let format = target.format;
        let depth_clear = (format.has_depth() && self.choose.chance(2, 5)).then(|| self.choose.of(&CLEAR_DEPTHS));
        let stencil_clear = (format.has_stencil() && self.choose.chance(2, 5)).then(|| self.choose.of(&STENCILS) + 256);
        DepthAttachment {
            view: target.view,
            depth_clear,
            depth_store: self.choose.chance(3, 4),
            depth_read_only: depth_clear.is_none() && self.choose.chance(1, 5),
            stencil_clear,
            stencil_store: self.choose.chance(3, 4),
            stencil_read_only: stencil_clear.is_none() && self.choose.chance(1, 5),
        }
    }

    /// A draw of a pass: its pipeline, its stencil references and its instance.
    fn draw(
        &mut self,
        targets: &[Option<Target>],
        depth: Option<(Target, &DepthAttachment)>,
        samples: u32,
    ) -> (RenderPipelineId, [u32; 2], u32) {
        let component = |src, dst, op| BlendComponent { src, dst, op };
        let over = component(BlendFactor::SrcAlpha, BlendFactor::OneMinusSrcAlpha, BlendOp::Add);
        let sum = component(BlendFactor::One, BlendFactor::One, BlendOp::Add);
        let blends = !self.unordered && self.choose.chance(1, 2);
        let logic = (!self.unordered && !blends && self.choose.chance(1, 2)).then(|| self.choose.of(LogicOp::ALL));
        let blend = if self.choose.chance(1, 2) { over } else { sum };
        let write_mask = if self.choose.chance(1, 4) { self.choose.of(&[1, 6, 8, 0]) } else { 15 };
        let target = |target: &Target| {
            let blend = (blends && target.format.kind() == TexelKind::Float).then_some(Blend { color: blend, alpha: blend });
            let logic = logic.filter(|_| LogicOp::applies_to(target.format));
            ColorTarget { format: target.format, blend, logic, write_mask }
        };
        let targets: Vec<_> = targets.iter().map(|of| of.as_ref().map(target)).collect();
        let depth_stencil = depth.map(|(target, attachment)| {
            let (has_depth, has_stencil) = (target.format.has_depth(), target.format.has_stencil());
            let stencil = has_stencil && !self.unordered && self.choose.chance(2, 3);
            let writes = stencil && !attachment.stencil_read_only;
            let choose = &mut self.choose;
            let mut op = || if writes { choose.of(&OPS) } else { StencilOp::Keep };
            let (fail_op, depth_fail_op, pass_op) = (op(), op(), op());
            let compare = if stencil { self.choose.of(&COMPARES) } else { Compare::Always };
            let face = StencilFace { compare, fail_op, depth_fail_op, pass_op };
            let masks = (stencil && self.choose.chance(1, 3)).then(|| {
                let [read, write] = [(); 2].map(|()| self.choose.of(&[0xff, 0x0f, 0xf0, 0x7f]));
                StencilMasks { read, write }
            });
            DepthStencil {
                depth_write: has_depth && !attachment.depth_read_only && self.choose.chance(2, 3),
                depth_compare: if has_depth { self.choose.of(&COMPARES) } else { Compare::Always },
                stencil_front: face,
                stencil_back: face,
                stencil_back_masks: masks,
                ..record::depth_less(target.format)
            }
        });
        let discards = self.choose.chance(1, 5);
        let front = self.choose.chance(1, 2);
        let pipeline = self.pipeline(PipelineKey { targets, depth_stencil, samples, discards, front });
        let low = [(); 2].map(|()| self.choose.below(5));
        let high = low.map(|low| low + 1 + self.choose.below(8 - low));
        let (low, high) = if self.choose.chance(1, 3) { EVERYWHERE } else { (low, high) };
        let color = self.choose.below(1 << 7) | self.choose.below(1 << 7) << 7;
        let references = [(); 2].map(|()| self.choose.of(&STENCILS));
        (pipeline, references, instance(low, high, self.choose.below(8), color))
    }

    fn pipeline(&mut self, key: PipelineKey) -> RenderPipelineId {
        if let Some((_, id)) = self.pipelines.iter().find(|(known, _)| *known == key) {
            return *id;
        }
        let kinds: Vec<_> = key.targets.iter().map(|target| target.map(|target| target.format.kind())).collect();
        let text = shader(&kinds, key.discards);
        let known = self.shaders.iter().find(|(known, _)| *known == text).map(|(_, id)| *id);
        let module = known.unwrap_or_else(|| {
            let id = self.card.create_shader("draw", &text);
            self.shaders.push((text, id));
            id
        });
        let front_face = if key.front { FrontFace::Cw } else { FrontFace::Ccw };
        let desc = RenderPipelineDesc {
            primitive: Primitive { front_face, ..Primitive::default() },
            depth_stencil: key.depth_stencil,
            multisample: Multisample { count: key.samples, ..Multisample::default() },
            targets: key.targets.clone(),
            ..record::render_pipeline(module, Format::Rgba8Unorm)
        };
        let id = self.card.create_render_pipeline("draw", desc);
        self.pipelines.push((key, id));
        id
    }

    /// Whether texels can be copied from one image to another.
    fn copies_to(&self, from: Image, to: Image) -> bool {
        let (a, b) = (self.desc(from), self.desc(to));
        from != to && a.samples == b.samples && (a.format == b.format || view_formats(a.format).contains(&b.format))
    }

    fn copy(&mut self) {
        let images = self.images();
        let from = self.choose.of(&images);
        let fits: Vec<Image> = images.iter().filter(|&&to| self.copies_to(from, to)).copied().collect();
        if fits.is_empty() {
            return;
        }
        let to = self.choose.of(&fits);
        let (mut a, mut b) = (self.end(from, Aspect::All), self.end(to, Aspect::All));
        let both: [u32; 2] = std::array::from_fn(|axis| self.size(from)[axis].min(self.size(to)[axis]));
        let mut size = [both[0], both[1], 1];
        let flat = self.desc(from).dimension == TextureDimension::D2 && self.desc(to).dimension == TextureDimension::D2;
        if self.desc(from).samples == 1 && self.choose.chance(1, 4) {
            // A part.
            for axis in 0..2 {
                size[axis] = 1 + self.choose.below(both[axis]);
                a.origin[axis] = self.choose.below(self.size(from)[axis] - size[axis] + 1);
                b.origin[axis] = self.choose.below(self.size(to)[axis] - size[axis] + 1);
            }
        } else if flat && from.texture != to.texture && self.choose.chance(1, 4) {
            // Several layers.
            let left = |image: Image| self.desc(image).size[2] - image.layer;
            size[2] = left(from).min(left(to));
        } else if self.desc(from).format.has_stencil() && self.desc(from).format.has_depth() && self.choose.chance(1, 4) {
            (a.aspect, b.aspect) = (Aspect::StencilOnly, Aspect::StencilOnly);
        }
        self.card.copy_texture_to_texture(a, b, size);
    }

    /// The aspect of an image that linear bytes can be copied to, and the bytes of a texel there.
    fn linear(&self, image: Image) -> Option<(Aspect, u32)> {
        let TextureDesc { format, samples, .. } = *self.desc(image);
        match format {
            _ if samples > 1 => None,
            Format::Depth24Plus | Format::Depth32Float => None,
            format if format.has_stencil() => Some((Aspect::StencilOnly, 1)),
            format => Some((Aspect::All, format.block_bytes())),
        }
    }

    /// An image with its aspect that linear bytes are copied to, and their number.
    fn linear_image(&mut self) -> Option<(TextureEnd, [u32; 3], u32)> {
        let images = self.images();
        let image = self.choose.of(&images);
        let (aspect, texel) = self.linear(image)?;
        let mut end = self.end(image, aspect);
        let mut size = self.size(image);
        if self.choose.chance(1, 3) {
            for (axis, side) in size.iter_mut().enumerate() {
                end.origin[axis] = self.choose.below(*side);
                *side = 1 + self.choose.below(*side - end.origin[axis]);
            }
        }
        Some((end, [size[0], size[1], 1], size[0] * size[1] * texel))
    }

    fn upload(&mut self) {
        let Some((end, size, length)) = self.linear_image() else { return };
        let seed = self.choose.below(4);
        self.card.write_texture(end, TIGHT, size, "upload", &bytes(length as usize, seed));
    }

    fn copy_through_buffer(&mut self) {
        let Some((from, size, _)) = self.linear_image() else { return };
        let buffer = self.buffer;
        self.card.copy_texture_to_buffer(from, buffer, TIGHT, size);
        if let Some((to, size, _)) = self.linear_image() {
            self.card.copy_buffer_to_texture(buffer, TIGHT, to, size);
        }
    }

    fn clear(&mut self) {
        let images = self.images();
        let image = self.choose.of(&images);
        let format = self.desc(image).format;
        let aspects: &[Aspect] = match (format.has_depth(), format.has_stencil()) {
            (true, true) => &[Aspect::All, Aspect::DepthOnly, Aspect::StencilOnly],
            _ => &[Aspect::All],
        };
        let solid = self.desc(image).dimension == TextureDimension::D3;
        self.card.push(Command::ClearTexture {
            texture: self.textures[image.texture].id,
            aspect: self.choose.of(aspects),
            base_level: image.level,
            levels: Some(1),
            base_layer: if solid { 0 } else { image.layer },
            layers: Some(1),
        });
    }

    /// A dispatch that writes an image.
    fn dispatch(&mut self) {
        let can = |&&image: &&Image| {
            let desc = self.desc(image);
            desc.format == Format::Rgba8Unorm && desc.samples == 1 && desc.dimension == TextureDimension::D2
        };
        let fits: Vec<Image> = self.images().iter().filter(can).copied().collect();
        if fits.is_empty() {
            return;
        }
        let image = self.choose.of(&fits);
        let view = self.view(image, Format::Rgba8Unorm).view;
        let card = &mut self.card;
        let (layout, pipeline) = *self.store.get_or_insert_with(|| {
            let module = card.create_shader(
                "store",
                "@group(0) @binding(0) var image: texture_storage_2d<rgba8unorm, write>;
                 @compute @workgroup_size(8, 8) fn main(@builtin(global_invocation_id) id: vec3u) {
                     textureStore(image, id.xy, vec4f(vec2f(id.xy) / 64.0, 0.25, 1.0));
                 }",
            );
            let layout = card.create_bind_group_layout([(0, record::STORAGE_TEXTURE)]);
            let pipeline_layout = card.create_pipeline_layout([layout], 0);
            (layout, card.create_compute_pipeline("store", Some(pipeline_layout), record::stage(module)))
        });
        let group = self.card.create_bind_group(layout, [(0, BoundResource::View(view))]);
        let [across, down] = self.size(image).map(|side| side.div_ceil(8));
        let mut pass = self.card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.dispatch(across, down, 1);
    }

    /// Destroys a texture and makes another like it, which holds zeros.
    fn make_again(&mut self) {
        let at = self.choose.below(self.textures.len() as u32) as usize;
        let texture = &mut self.textures[at];
        for (_, view) in std::mem::take(&mut texture.views) {
            self.card.push(Command::Destroy(Object::View(view)));
        }
        self.card.push(Command::Destroy(Object::Texture(texture.id)));
        texture.id = self.card.create_texture("image", texture.desc.clone());
    }

    fn can_be_shown(&self, image: Image) -> bool {
        let desc = self.desc(image);
        let flat = desc.samples == 1 && desc.dimension == TextureDimension::D2;
        flat && !desc.format.is_depth_stencil() && (image.level, image.layer) == (0, 0)
    }

    fn show(&mut self, texture: usize) {
        self.card.present(self.textures[texture].id);
        self.frames += 1;
    }

    fn present(&mut self) {
        let fits: Vec<Image> = self.images().into_iter().filter(|&image| self.can_be_shown(image)).collect();
        if !fits.is_empty() {
            let image = self.choose.of(&fits);
            self.show(image.texture);
        }
    }

    /// A texture of one image that shows others.
    fn shown(&mut self, [width, height]: [u32; 2], samples: u32, format: Format) -> usize {
        let desc = record::texture_multisampled(width, height, samples, format);
        if let Some(&at) = self.shown.iter().find(|&&at| self.textures[at].desc == desc) {
            return at;
        }
        let id = self.card.create_texture("shown", desc.clone());
        self.textures.push(Texture { id, desc, views: BTreeMap::new() });
        self.shown.push(self.textures.len() - 1);
        self.textures.len() - 1
    }

    fn show_all(&mut self) {
        for image in self.images() {
            if self.is_depth(image) { self.show_tests(image) } else { self.show_colors(image) }
        }
    }

    /// Loads colours and shows them.
    fn show_colors(&mut self, image: Image) {
        let (size, samples, base) = (self.size(image), self.desc(image).samples, self.desc(image).format);
        let from = self.target(image);
        let load =
            |target: Target, resolve| ColorAttachment { depth_slice: target.slice, resolve, ..record::load(target.view) };
        if samples > 1 {
            let to = self.shown(size, 1, base);
            let view = self.view(Image { texture: to, level: 0, layer: 0 }, from.format).view;
            self.card.begin_render_pass([load(from, Some(view))], None);
            self.show(to);
            return;
        }
        self.card.begin_render_pass([load(from, None)], None);
        if self.can_be_shown(image) {
            self.show(image.texture);
            return;
        }
        let to = self.shown(size, 1, base);
        let copy = Image { texture: to, level: 0, layer: 0 };
        let ends = (self.end(image, Aspect::All), self.end(copy, Aspect::All));
        self.card.copy_texture_to_texture(ends.0, ends.1, [size[0], size[1], 1]);
        let target = self.target(copy);
        self.card.begin_render_pass([load(target, None)], None);
        self.show(to);
    }

    /// Loads depths and stencil values, and shows which tests pass against them: of depths how many levels are below, of stencil values which
    /// of some they equal.
    fn show_tests(&mut self, image: Image) {
        let (size, samples, format) = (self.size(image), self.desc(image).samples, self.desc(image).format);
        let to = self.shown(size, samples, Format::Rgba8Unorm);
        let color = self.view(Image { texture: to, level: 0, layer: 0 }, Format::Rgba8Unorm);
        let (mut shown, mut resolve) = (to, None);
        if samples > 1 {
            shown = self.shown(size, 1, Format::Rgba8Unorm);
            resolve = Some(self.view(Image { texture: shown, level: 0, layer: 0 }, Format::Rgba8Unorm).view);
        }
        let depth = self.target(image);
        let mut draws = Vec::new();
        let sum = BlendComponent { src: BlendFactor::One, dst: BlendFactor::One, op: BlendOp::Add };
        let blend = (!self.unordered).then_some(Blend { color: sum, alpha: sum });
        let state = record::depth_less(format);
        let target = |write_mask| vec![Some(ColorTarget { format: Format::Rgba8Unorm, blend, logic: None, write_mask })];
        // Without blending the pass has one draw.
        let only = self.choose.below(8);
        for at in 0..8 {
            if self.unordered && at != only {
                continue;
            }
            if format.has_depth() {
                let state = DepthStencil { depth_write: false, depth_compare: Compare::LessEqual, ..state };
                let key =
                    PipelineKey { targets: target(1), depth_stencil: Some(state), samples, discards: false, front: false };
                draws.push((self.pipeline(key), 0, instance(EVERYWHERE.0, EVERYWHERE.1, at, 1)));
            }
            if format.has_stencil() && !(self.unordered && format.has_depth()) {
                let face = StencilFace { compare: Compare::Equal, ..StencilFace::default() };
                let state = DepthStencil {
                    depth_write: false,
                    depth_compare: Compare::Always,
                    stencil_front: face,
                    stencil_back: face,
                    ..state
                };
                let key =
                    PipelineKey { targets: target(2), depth_stencil: Some(state), samples, discards: false, front: false };
                let instance = instance(EVERYWHERE.0, EVERYWHERE.1, 0, (at + 1) << 4);
                draws.push((self.pipeline(key), STENCILS[at as usize], instance));
            }
        }
        let attachment = record::load_depth(depth.view);
        let color = ColorAttachment { resolve, ..record::clear(color.view, [0.0, 0.0, 0.0, 1.0]) };
        let mut pass = self.card.begin_render_pass([color], Some(attachment));
        for (pipeline, reference, instance) in draws {
            pass.set_pipeline(pipeline);
            pass.set_stencil_reference(reference);
            pass.draw_from(6, 1, 0, instance);
        }
        drop(pass);
        self.show(shown);
    }
}
