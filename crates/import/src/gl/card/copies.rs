use gfx::format::Format;
use gfx::state::*;
use gl_shader::key::Base;
use num::*;
use trace::command::*;
use trace::record;

use crate::gl::card::copy_key::{Combine, CopyKey, CopySource, Map, SAME, one_image, row_edge};
use crate::gl::card::device::Card;
use crate::gl::card::pass::{Buffer, COLOR, Surface};
use crate::gl::texels::image::DEPTH;
use crate::gl::texels::image::StoredFormat;

impl Card {
    /// A pipeline that draws such copies to images of a format.
    fn copy_pipeline(&mut self, key: &CopyKey, format: Format) -> (RenderPipelineId, BindGroupLayoutId) {
        let recorder = &mut self.recorder;
        let depth = format == DEPTH;
        let kind = match key.from {
            CopySource::Depth => "texture_depth_2d",
            CopySource::Stencil => "texture_2d<u32>",
            CopySource::Color | CopySource::Filtered => "texture_2d<f32>",
        };
        let read = match key.from {
            CopySource::Color => "textureLoad(image, vec2i(floor(p)), 0)",
            CopySource::Filtered => "textureSampleLevel(image, filtering, p / vec2f(textureDimensions(image)), 0.0)",
            CopySource::Depth | CopySource::Stencil => "vec4f(textureLoad(image, vec2i(floor(p)), 0))",
        };
        let filtering = if key.from == CopySource::Filtered { "@group(0) @binding(2) var filtering: sampler;\n" } else { "" };
        let answer = if depth { "@builtin(frag_depth) f32" } else { "@location(0) vec4f" };
        let text = format!(
            "struct Uniforms {{ map: vec4f, source: vec4f }}\n@group(0) @binding(0) var<uniform> u: Uniforms;\n\
             @group(0) @binding(1) var image: {kind};\n{filtering}\
             @vertex fn vs(@builtin(vertex_index) i: u32) -> @builtin(position) vec4f {{\n    \
             return vec4f(f32(i32(i & 1u) * 4 - 1), f32(i32(i & 2u) * 2 - 1), 0, 1);\n}}\n\
             @fragment fn fs(@builtin(position) at: vec4f) -> {answer} {{\n    \
             let p = u.source.xy + (at.xy - u.map.xy) * u.map.zw;\n    \
             // What is outside of the source is undefined.\n    \
             if any(p < vec2f(0)) || any(p >= vec2f(textureDimensions(image))) {{ discard; }}\n    \
             let c = {read};\n    return {};\n}}\n",
            key.result
        );
        let shader = recorder.create_shader("copy", &text);
        let mut entries = vec![(0, record::UNIFORM), (1, record::TEXTURE)];
        if key.from == CopySource::Filtered {
            entries.push((2, record::SAMPLER));
        }
        let layout = recorder.create_bind_group_layout(entries);
        let pipeline_layout = recorder.create_pipeline_layout([layout], 0);
        let part = |src, dst| BlendComponent { src, dst, op: BlendOp::Add };
        let blend = match key.combine {
            Combine::Replace => None,
            Combine::Add => Some(part(BlendFactor::One, BlendFactor::One)),
            Combine::Scale => Some(part(BlendFactor::Zero, BlendFactor::Constant)),
        };
        let blend = blend.map(|part| Blend { color: part, alpha: part });
        let target = ColorTarget { format, blend, logic: None, write_mask: key.mask };
        let always = DepthStencil { depth_compare: Compare::Always, ..record::depth_less(DEPTH) };
        let desc = RenderPipelineDesc {
            layout: Some(pipeline_layout),
            depth_stencil: depth.then_some(always),
            targets: if depth { Vec::new() } else { vec![Some(target)] },
            ..record::render_pipeline(shader, COLOR)
        };
        (recorder.create_render_pipeline("copy", desc), layout)
    }

    /// Draws a rectangle of a surface; each pixel is computed from one of another surface.
    pub fn copy_pixels(
        &mut self,
        key: CopyKey,
        format: Format,
        source: Surface,
        to: Surface,
        map: Map,
        number: f32,
        area: Rect,
    ) {
        if area.width == 0 || area.height == 0 {
            return;
        }
        self.end_pass();
        self.drawn = true;
        let (pipeline, layout) = match self.copies.iter().find(|(known, _)| *known == key) {
            Some(&(_, copy)) => copy,
            None => {
                let copy = self.copy_pipeline(&key, format);
                self.copies.push((key.clone(), copy));
                copy
            }
        };
        let values = [map.to, map.scale, map.from, [number, 0.0]];
        let bytes = float_bytes(values.as_flattened());
        let uniforms = self.recorder.create_buffer_init("copy", &bytes);
        let aspect = match key.from {
            CopySource::Depth => Aspect::DepthOnly,
            CopySource::Stencil => Aspect::StencilOnly,
            CopySource::Color | CopySource::Filtered => Aspect::All,
        };
        let view = self.recorder.create_view_of(source.texture, one_image(source.level, source.layer, aspect));
        let mut entries = vec![(0, record::whole(uniforms)), (1, BoundResource::View(view))];
        if key.from == CopySource::Filtered {
            let linear = SamplerDesc { mag: FilterMode::Linear, min: FilterMode::Linear, ..SamplerDesc::default() };
            entries.push((2, BoundResource::Sampler(self.sampler(linear))));
        }
        let group = self.recorder.create_bind_group(layout, entries);
        {
            let color = (format != DEPTH).then(|| record::load(to.view));
            let attached = (format == DEPTH).then(|| record::load_depth(to.view));
            let mut pass = self.recorder.begin_render_pass(color, attached);
            pass.set_pipeline(pipeline);
            pass.set_scissor(area);
            if key.combine == Combine::Scale {
                pass.set_blend_constant([f64::from(number); 4]);
            }
            pass.set_bind_group(0, group);
            pass.draw(3, 1);
        }
        for object in [Object::BindGroup(group), Object::View(view), Object::Buffer(uniforms)] {
            self.recorder.push(Command::Destroy(object));
        }
    }

    /// Copies a rectangle of a framebuffer, with `from` as its lower left pixel, to an image of a texture, whose rows are from the bottom.
    pub fn copy_to_texture(
        &mut self,
        base: Base,
        source: (Surface, [u32; 2], bool),
        image: Surface,
        to: [u32; 2],
        from: [i32; 2],
        size: [u32; 2],
    ) {
        let (surface, [width, height], upward) = source;
        // Where rows go the same way, and texels are kept as they are, the card copies without drawing. What is read of an RGB texture has no alpha.
        let same = match base {
            Base::Rgba => true,
            Base::Rgb => self.upward,
            _ => false,
        };
        let plain = same && surface.format == image.format && surface.narrow.is_none() && image.narrow.is_none();
        let reaches =
            |from: i32, size: u32, extent: u32| from >= 0 && u64::from(from.unsigned_abs()) + u64::from(size) <= extent.into();
        if upward && plain && reaches(from[0], size[0], width) && reaches(from[1], size[1], height) && !size.contains(&0) {
            self.end_pass();
            let end = |of: Surface, [x, y]: [u32; 2]| TextureEnd {
                texture: of.texture,
                level: of.level,
                origin: [x, y, of.layer],
                aspect: Aspect::All,
            };
            let ends = [end(surface, from.map(|edge| edge.unsigned_abs())), end(image, to)];
            let [read, written] = &ends;
            self.recorder.copy_texture_to_texture(read.clone(), written.clone(), [size[0], size[1], 1]);
            return;
        }
        let map = Map {
            to: to.map(|edge| edge as f32),
            from: [from[0] as f32, row_edge(height, upward, from[1] as f32)],
            scale: [1.0, if upward { 1.0 } else { -1.0 }],
        };
        let read = if base == Base::Depth { CopySource::Depth } else { CopySource::Color };
        let (result, format) = (if base == Base::Depth { "c.r" } else { base.unswizzle() }, base.format());
        let key = CopyKey { from: read, result, format: format.name(), combine: Combine::Replace, mask: 15 };
        let area = Rect { x: to[0], y: to[1], width: size[0], height: size[1] };
        self.copy_pixels(key, format, surface, image, map, 0.0, area);
    }

    /// A texture with the present colours of a framebuffer, to be read by a draw.
    pub fn frame_copy(&mut self, source: Surface, size: [u32; 2]) -> (TextureId, ViewId, SamplerId) {
        self.end_pass();
        if let Some((texture, view, _)) = self.frame_copy.take_if(|copy| copy.2 != size) {
            self.destroy(texture, &[view]);
        }
        let (texture, view, _) = match self.frame_copy {
            Some(copy) => copy,
            None => {
                let made = self.create_surface("frame", size, COLOR);
                *self.frame_copy.insert((made.texture, made.view, size))
            }
        };
        self.copy_surface(source, Surface { texture, view, format: COLOR, level: 0, layer: 0, narrow: None }, size);
        (texture, view, self.sampler(SamplerDesc::default()))
    }

    /// Fills a part of the accumulation buffer.
    pub fn clear_accumulation(&mut self, color: [f32; 4], area: Rect) {
        let Some(to) = self.accumulation() else { return };
        let [width, height] = self.size();
        if area == (Rect { x: 0, y: 0, width, height }) {
            // As the card clears other images: programs that clear all buffers in each frame need not accumulate anything.
            self.end_pass();
            drop(self.recorder.begin_render_pass([record::clear(to.view, color.map(f64::from))], None));
            return;
        }
        let Some(source) = self.window_target(Buffer::Back).and_then(|target| target.color) else { return };
        // One draw for each of the four channels: a pipeline has one number.
        for (channel, value) in color.into_iter().enumerate() {
            let mask = 1 << channel;
            let key = CopyKey {
                from: CopySource::Color,
                result: "vec4f(u.source.z)",
                format: "rgba16float",
                combine: Combine::Replace,
                mask,
            };
            self.copy_pixels(key, Format::Rgba16Float, source, to, SAME, value, area);
        }
    }
}
