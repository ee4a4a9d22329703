//! Draws that stand for commands that the card does not have: blits between sizes and formats, clears of parts of targets.

use gfx::format::{Format, TexelKind};
use gfx::state::*;
use num::{BindGroupLayoutId, RenderPipelineId, ShaderId};
use trace::command::*;
use trace::record::{self, Recorder};

use super::fault::{Fault, Outcome, unsupported};
use super::formats;
use super::machine::Vulkan;
use super::objects::Handle;
use super::pass::OpenPass;
use super::pipelines::PassFormats;
use super::state::Area;

/// A triangle that covers the target.
const COVER: &str = "
@vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {
    return vec4f(f32(i & 1) * 4 - 1, f32(i >> 1) * 4 - 1, values.depth, 1);
}
";

/// A blit between one layer or slice of two images.
pub struct Blit {
    pub from: Handle,
    pub from_level: u32,
    pub from_layer: u32,
    pub to: Handle,
    pub to_level: u32,
    pub to_layer: u32,
    pub aspects: u32,
    /// Left, top, right, bottom; may be turned.
    pub source: [i32; 4],
    pub target: [i32; 4],
    pub linear: bool,
}

/// What a generated pipeline does.
#[derive(Clone, Debug, PartialEq)]
enum Task {
    /// Fills a colour target.
    Color(usize),
    /// Fills depth, stencil or both.
    Depth(bool, bool),
    /// Samples a texture: its dimension, and whether it is multisampled depth.
    Blit(ViewDimension, TexelKind),
}

/// Pipelines of generated draws.
#[derive(Default)]
pub struct Generated {
    known: Vec<((Task, PassFormats), RenderPipelineId, Option<BindGroupLayoutId>)>,
    shaders: Vec<(String, ShaderId)>,
}

impl Generated {
    fn shader(&mut self, text: String, card: &mut Recorder) -> ShaderId {
        if let Some((_, id)) = self.shaders.iter().find(|(known, _)| *known == text) {
            return *id;
        }
        let id = card.create_shader("generated", &text);
        self.shaders.push((text, id));
        id
    }

    fn pipeline(
        &mut self,
        task: Task,
        pass: &PassFormats,
        card: &mut Recorder,
    ) -> (RenderPipelineId, Option<BindGroupLayoutId>) {
        let pass = PassFormats { view: None, ..pass.clone() };
        let key = (task, pass);
        if let Some((_, id, layout)) = self.known.iter().find(|(known, ..)| *known == key) {
            return (*id, *layout);
        }
        let (task, pass) = &key;
        let shader = self.shader(text(task, pass), card);
        let group = match task {
            Task::Blit(..) => Some(card.create_bind_group_layout([(0, record::TEXTURE), (1, record::SAMPLER)])),
            _ => None,
        };
        let layout = card.create_pipeline_layout(group, 48);
        let written = |number: usize| match task {
            Task::Color(own) => *own == number,
            Task::Blit(_, kind) => *kind != TexelKind::Depth,
            Task::Depth(..) => false,
        };
        let target = |(number, format): (usize, &Option<Format>)| {
            format.map(|format| ColorTarget {
                format,
                blend: None,
                logic: None,
                write_mask: if written(number) { 15 } else { 0 },
            })
        };
        let replace = StencilFace { pass_op: StencilOp::Replace, ..StencilFace::default() };
        let depth_stencil = pass.depth.map(|format| {
            let (depth, stencil) = match task {
                Task::Depth(depth, stencil) => (*depth && format.has_depth(), *stencil && format.has_stencil()),
                Task::Blit(_, TexelKind::Depth) => (true, false),
                _ => (false, false),
            };
            let face = if stencil { replace } else { StencilFace::default() };
            let test = DepthStencil { depth_compare: Compare::Always, depth_write: depth, ..record::depth_less(format) };
            DepthStencil { stencil_front: face, stencil_back: face, ..test }
        });
        let fragment = match task {
            Task::Depth(..) => None,
            _ => Some(record::stage_entry(shader, "fs")),
        };
        let desc = RenderPipelineDesc {
            layout: Some(layout),
            vertex: record::stage_entry(shader, "vs"),
            buffers: Vec::new(),
            primitive: Primitive { unclipped_depth: true, ..Primitive::default() },
            depth_stencil,
            multisample: Multisample { count: pass.samples, ..Multisample::default() },
            fragment,
            targets: pass.color.iter().enumerate().map(target).collect(),
        };
        let id = card.create_render_pipeline("generated", desc);
        self.known.push((key, id, group));
        (id, group)
    }
}

/// The type of four channels of a format in WGSL.
fn vector(kind: TexelKind) -> (&'static str, &'static str) {
    match kind {
        TexelKind::Uint => ("vec4u", "u32"),
        TexelKind::Sint => ("vec4i", "i32"),
        TexelKind::Float | TexelKind::Depth => ("vec4f", "f32"),
    }
}

/// The text of a generated shader.
fn text(task: &Task, pass: &PassFormats) -> String {
    let of = |number: usize| pass.color.get(number).copied().flatten().map_or(TexelKind::Float, Format::kind);
    match task {
        Task::Depth(..) => format!("struct Values {{ depth: f32 }}\nvar<immediate> values: Values;\n{COVER}"),
        Task::Color(number) => {
            let (kind, _) = vector(of(*number));
            // Targets that are not written need an output of their type nevertheless, where they stand before.
            format!(
                "struct Values {{ color: {kind}, depth: f32 }}\nvar<immediate> values: Values;\n{COVER}\
                 @fragment fn fs() -> @location({number}) {kind} {{ return values.color; }}\n"
            )
        }
        Task::Blit(dimension, kind) => {
            let (own, scalar) = vector(*kind);
            let flat = *dimension != ViewDimension::D3;
            let texture = match (flat, kind) {
                (_, TexelKind::Depth) => "texture_depth_2d".to_owned(),
                (true, _) => format!("texture_2d<{scalar}>"),
                (false, _) => format!("texture_3d<{scalar}>"),
            };
            let values = "struct Values { scale: vec2f, offset: vec2f, size: vec2f, slice: f32, depth: f32 }";
            let at = "let at = p.xy * values.scale + values.offset;";
            let texel = "vec2i(clamp(floor(at), vec2f(0), values.size - 1))";
            let body = match (flat, kind) {
                (_, TexelKind::Depth) => format!("{at} return textureLoad(image, {texel}, 0);"),
                (true, TexelKind::Float) => format!("{at} return textureSampleLevel(image, own, at / values.size, 0.0);"),
                (false, TexelKind::Float) => {
                    format!("{at} return textureSampleLevel(image, own, vec3f(at / values.size, values.slice), 0.0);")
                }
                (true, _) => format!("{at} return textureLoad(image, {texel}, 0);"),
                (false, _) => format!("{at} return textureLoad(image, vec3i({texel}, i32(values.slice)), 0);"),
            };
            let output = match kind {
                TexelKind::Depth => "@builtin(frag_depth) f32".to_owned(),
                _ => format!("@location(0) {own}"),
            };
            format!(
                "{values}\nvar<immediate> values: Values;\n@group(0) @binding(0) var image: {texture};\n\
                 @group(0) @binding(1) var own: sampler;\n{COVER}\
                 @fragment fn fs(@builtin(position) p: vec4f) -> {output} {{ {body} }}\n"
            )
        }
    }
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

impl OpenPass {
    /// Adds a draw that covers an area with a generated pipeline.
    fn cover(&mut self, pipeline: RenderPipelineId, immediates: Vec<u32>, reference: Option<u32>, area: Area) {
        let [width, height] = self.size;
        let area = area.common(self.area).common(Area { x: 0, y: 0, width, height });
        if area.width == 0 || area.height == 0 {
            return;
        }
        let viewport = Viewport { x: 0.0, y: 0.0, width: width as f32, height: height as f32, min_depth: 0.0, max_depth: 1.0 };
        let scissor = Rect { x: area.x as u32, y: area.y as u32, width: area.width, height: area.height };
        self.commands.extend([
            Command::SetRenderPipeline(pipeline),
            Command::SetViewport(viewport),
            Command::SetScissor(scissor),
            Command::SetImmediates { offset: 0, words: immediates.clone() },
        ]);
        if let Some(reference) = reference {
            self.commands.push(Command::SetStencilReference(reference));
            self.emitted.stencil = Some([reference; 2]);
        }
        self.commands.push(Command::Draw { vertices: 3, instances: 1, first_vertex: 0, first_instance: 0 });
        self.emitted.pipeline = Some(pipeline);
        (self.emitted.viewport, self.emitted.scissor) = (Some(viewport), Some(scissor));
        self.emitted.immediates = immediates;
    }
}

impl Vulkan {
    /// Clears a part of a colour target of a pass.
    pub fn clear_color_part(&mut self, pass: &mut OpenPass, number: usize, value: [u32; 4], area: Area) -> Outcome {
        let Some(Some(_)) = pass.formats.color.get(number) else { return Ok(()) };
        let (pipeline, _) = self.generated.pipeline(Task::Color(number), &pass.formats, &mut self.card);
        let mut immediates = value.to_vec();
        immediates.push(0);
        pass.cover(pipeline, immediates, None, area);
        Ok(())
    }

    /// Clears a part of depth or stencil of a pass.
    pub fn clear_depth_part(&mut self, pass: &mut OpenPass, aspects: u32, value: [u32; 4], area: Area) -> Outcome {
        if pass.formats.depth.is_none() {
            return Ok(());
        }
        let task = Task::Depth(aspects & 2 != 0, aspects & 4 != 0);
        let (pipeline, _) = self.generated.pipeline(task, &pass.formats, &mut self.card);
        pass.cover(pipeline, vec![value[0]], Some(value[1] & 255), area);
        Ok(())
    }

    /// Draws one image into another.
    pub fn blit(&mut self, blit: &Blit) -> Outcome {
        let (a, b) = (self.texture_desc(blit.from)?, self.texture_desc(blit.to)?);
        let aspect = formats::aspect(blit.aspects, a.format)?;
        let kind = a.format.kind();
        if a.samples != 1 || b.samples != 1 {
            return unsupported("a blit of an image with several samples");
        }
        if kind == TexelKind::Depth && (aspect == Aspect::StencilOnly || blit.aspects & 4 != 0) {
            return unsupported("a blit of stencil");
        }
        let renderable = b.format.is_depth_stencil() || !(b.format.is_compressed() || matches!(b.format, Format::Rgb9e5Ufloat));
        if !renderable || kind != b.format.kind() {
            return unsupported(format!("a blit from {} to {}", a.format.name(), b.format.name()));
        }
        let area =
            |[x0, y0, x1, y1]: [i32; 4]| Area { x: x0.min(x1), y: y0.min(y1), width: x0.abs_diff(x1), height: y0.abs_diff(y1) };
        let target = area(blit.target);
        if target.width == 0 || target.height == 0 {
            return Ok(());
        }
        let size = a.level_size(blit.from_level);
        let three = a.dimension == TextureDimension::D3;
        let format = match a.format {
            Format::Depth24PlusStencil8 => Some(Format::Depth24Plus),
            Format::Depth32FloatStencil8 => Some(Format::Depth32Float),
            _ => None,
        };
        let desc = ViewDesc {
            format,
            dimension: Some(if three { ViewDimension::D3 } else { ViewDimension::D2 }),
            aspect: if format.is_some() { Aspect::DepthOnly } else { Aspect::All },
            base_level: blit.from_level,
            levels: Some(1),
            base_layer: if three { 0 } else { blit.from_layer },
            layers: Some(1),
        };
        let view = self.native_view(blit.from, desc)?;
        self.draw_image(blit, (view, if three { ViewDimension::D3 } else { ViewDimension::D2 }, kind), size, (&b, target))
    }

    fn draw_image(
        &mut self,
        blit: &Blit,
        (view, dimension, kind): (num::ViewId, ViewDimension, TexelKind),
        size: [u32; 3],
        (b, target): (&TextureDesc, Area),
    ) -> Outcome {
        let filter = if blit.linear && kind == TexelKind::Float { FilterMode::Linear } else { FilterMode::Nearest };
        let sampler =
            self.groups.sampler(SamplerDesc { mag: filter, min: filter, ..SamplerDesc::default() }, &mut self.card)?;
        let (native, slice) = self.subresource(blit.to, None, blit.to_level, blit.to_layer)?;
        let [width, height, _] = b.level_size(blit.to_level);
        let depth = b.format.is_depth_stencil();
        let pass = PassFormats {
            color: if depth { Vec::new() } else { vec![Some(b.format)] },
            depth: depth.then_some(b.format),
            samples: b.samples,
            view: None,
        };
        let (pipeline, layout) = self.generated.pipeline(Task::Blit(dimension, kind), &pass, &mut self.card);
        let layout = layout.ok_or_else(|| Fault::Damaged("a blit without a layout".into()))?;
        let group = self.card.create_bind_group(layout, [(0, BoundResource::View(view)), (1, BoundResource::Sampler(sampler))]);
        let ([x0, y0, x1, y1], [u0, v0, u1, v1]) = (blit.target.map(|at| at as f32), blit.source.map(|at| at as f32));
        let scale = [(u1 - u0) / (x1 - x0), (v1 - v0) / (y1 - y0)];
        let offset = [u0 - x0 * scale[0], v0 - y0 * scale[1]];
        let slice_of = if dimension == ViewDimension::D3 && kind == TexelKind::Float {
            (blit.from_layer as f32 + 0.5) / size[2] as f32
        } else {
            blit.from_layer as f32
        };
        let values = bits(&[scale[0], scale[1], offset[0], offset[1], size[0] as f32, size[1] as f32, slice_of, 0.0]);
        let color = (!depth).then(|| ColorAttachment { depth_slice: slice, ..record::load(native) });
        let mut open = OpenPass::of(pass, [width, height], color, depth.then(|| record::load_depth(native)));
        open.commands.push(Command::SetBindGroup { index: 0, group: Some(group), offsets: Vec::new() });
        open.cover(pipeline, values, None, target);
        self.close(&mut super::pass::Open::Render(Box::new(open)));
        self.card.push(Command::Destroy(Object::BindGroup(group)));
        Ok(())
    }

    /// Gives all samples of an image the texels that a trimmed capture has of it: those of a resolved image.
    pub fn spread_samples(&mut self, image: Handle, texels: &[u8]) -> Outcome {
        let desc = self.texture_desc(image)?;
        let [width, height, _] = desc.size;
        let single = TextureDesc { samples: 1, ..desc.clone() };
        let texture = self.card.create_texture("samples", single);
        self.card.write_level(texture, 0, "samples", texels);
        let view = self.card.create_view(texture);
        let ends = [0, 0, width as i32, height as i32];
        let blit = Blit {
            from: 0,
            from_level: 0,
            from_layer: 0,
            to: image,
            to_level: 0,
            to_layer: 0,
            aspects: 1,
            source: ends,
            target: ends,
            linear: false,
        };
        let area = Area { x: 0, y: 0, width, height };
        self.draw_image(&blit, (view, ViewDimension::D2, desc.format.kind()), [width, height, 1], (&desc, area))?;
        self.card.push(Command::Destroy(Object::View(view)));
        self.card.push(Command::Destroy(Object::Texture(texture)));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use gfx::format::Format;

    use crate::vulkan::pass::clear_color;

    #[test]
    fn clear_values_are_read_as_their_format_has_them() {
        assert_eq!(clear_color([1.5f32.to_bits(), 0, 0, 1f32.to_bits()], Format::Rgba8Unorm), [1.5, 0.0, 0.0, 1.0]);
        assert_eq!(clear_color([u32::MAX, 1, 2, 3], Format::Rgba32Sint), [-1.0, 1.0, 2.0, 3.0]);
        assert_eq!(clear_color([u32::MAX, 1, 2, 3], Format::Rgba32Uint), [4_294_967_295.0, 1.0, 2.0, 3.0]);
    }
}
