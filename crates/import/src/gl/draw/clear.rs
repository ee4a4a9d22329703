//! Clears, scissor and write masks.

use gfx::state::*;
use gl_shader::narrow::Narrow;
use gl_shader::{COLORS_MAX, consts as e};
use num::float_bytes;
use trace::record;

use crate::gl::call::{Fault, GlResult};
use crate::gl::card::pass::{Draw, Order, PipelineState, Surface, VertexRange, stored_channels};
use crate::gl::machine::Gl;
use crate::gl::state::server::State;
use crate::gl::texels::image::byte;

/// Clear values of the buffers.
#[derive(Clone, Copy, Debug)]
pub struct ClearValues {
    /// Colour.
    pub color: [f32; 4],
    /// Depth.
    pub depth: f32,
    /// Stencil value; only the lowest 8 bits are used.
    pub stencil: i32,
    /// The only colour buffer that is cleared; none: all.
    pub buffer: Option<usize>,
}

impl ClearValues {
    /// The clear values of the state.
    pub fn of(state: &State) -> ClearValues {
        ClearValues { color: state.color.clear, depth: state.depth.clear, stencil: state.stencil.clear, buffer: None }
    }
}

/// Labels of clear shaders, by number of colour buffers.
const LABELS: [&str; COLORS_MAX] = ["clear", "clear 2", "clear 3", "clear 4", "clear 5", "clear 6", "clear 7", "clear 8"];

/// The shader that clears a part of this number of colour buffers.
fn clear_text(colors: usize) -> String {
    let fields: String = (0..colors).map(|k| format!("@location({k}) color{k}: vec4f, ")).collect();
    let values: Vec<String> = (0..colors).map(|_| "u.color".to_owned()).collect();
    format!(
        "struct Uniforms {{ color: vec4f, depth: vec4f }}\n@group(0) @binding(0) var<uniform> u: Uniforms;\n\
         struct Pixel {{ {fields}}}\n\
         @vertex fn vs(@location(0) position: vec2f) -> @builtin(position) vec4f {{ return vec4f(position, u.depth.x, 1); }}\n\
         @fragment fn fs() -> Pixel {{ return Pixel({}); }}\n",
        values.join(", ")
    )
}

impl Gl {
    /// The scissor in the card's rows; none if it is empty.
    pub fn scissor(&self) -> Option<Rect> {
        let target = self.card.target()?;
        let [width, height] = target.size.map(i64::from);
        let [mut x0, mut y0, mut x1, mut y1] = [0, 0, width, height];
        if self.state.is(e::SCISSOR_TEST) {
            let [x, y, w, h] = self.state.scissor.map(i64::from);
            (x0, y0, x1, y1) = (x0.max(x), y0.max(y), x1.min(x + w), y1.min(y + h));
        }
        if x0 >= x1 || y0 >= y1 {
            return None;
        }
        let y = if target.upward { y0 } else { height - y1 };
        Some(Rect { x: x0 as u32, y: y as u32, width: (x1 - x0) as u32, height: (y1 - y0) as u32 })
    }

    /// Channels that are written; a window may have no alpha.
    pub fn mask(&self) -> u8 {
        let Some(target) = self.card.target().filter(|target| target.color.is_some()) else { return 0 };
        let off = self.context.framebuffers.draw == 0 && self.state.color.draw_buffer == e::NONE;
        if off { 0 } else { self.state.color.writes[0].mask & stored_channels(target.alpha) }
    }

    /// Clears the window before its size is known: it begins with these values.
    fn clear_early(&mut self, mask: u32, values: ClearValues) -> GlResult {
        let (state, wanted) = (&self.state, |bit: u32| mask & bit != 0);
        let whole = !state.is(e::SCISSOR_TEST)
            && state.color.writes[0].mask == 15
            && state.depth.write
            && state.stencil.sides[0].write & 0xff == 0xff;
        if !whole {
            return Err(Fault::Unsupported("clearing a part before the size of the window is known".into()));
        }
        let color =
            wanted(e::COLOR_BUFFER_BIT) && state.color.draw_buffer != e::NONE && values.buffer.is_none_or(|only| only == 0);
        let [color, depth, stencil] = [color, wanted(e::DEPTH_BUFFER_BIT), wanted(e::STENCIL_BUFFER_BIT)];
        let Some(window) = self.card.windows.drawn() else { return Ok(()) };
        let early = &mut window.early;
        early.0 = color.then_some(values.color).or(early.0);
        early.1 = depth.then_some(values.depth).or(early.1);
        early.2 = stencil.then_some(values.stencil as u32 & 0xff).or(early.2);
        Ok(())
    }

    /// Clears buffers to these values, as far as scissor and masks allow.
    pub fn clear_buffers(&mut self, mask: u32, values: ClearValues) -> GlResult {
        let target = match self.aim() {
            Err(Fault::Unsupported(_)) if self.context.framebuffers.draw == 0 && self.card.size() == [0; 2] => {
                return self.clear_early(mask, values);
            }
            target => target?,
        };
        let Some(scissor) = self.scissor() else { return Ok(()) };
        let [width, height] = target.size;
        let whole = scissor == Rect { x: 0, y: 0, width, height };
        let state = &self.state;
        let wanted = |bit: u32| mask & bit != 0;
        let on = wanted(e::COLOR_BUFFER_BIT) && !(self.context.framebuffers.draw == 0 && state.color.draw_buffer == e::NONE);
        // The channels of a colour buffer that are cleared, by its number.
        let written = |k: usize, alpha: bool| {
            let cleared = on && values.buffer.is_none_or(|only| only == k);
            if cleared { state.color.writes[k].mask & stored_channels(alpha) } else { 0 }
        };
        let colors: Vec<(usize, Surface, bool)> =
            target.colors().enumerate().map(|(k, (color, alpha))| (k, color, alpha)).collect();
        let depth = wanted(e::DEPTH_BUFFER_BIT) && state.depth.write && target.has_depth;
        let stencil_mask =
            if wanted(e::STENCIL_BUFFER_BIT) && target.has_stencil { state.stencil.sides[0].write & 0xff } else { 0 };
        // Only the single colour buffer of a target may have fewer bits.
        let kept =
            |narrow: Narrow| narrow.computed(values.color.map(|value| byte(value.into()))).map(|code| f32::from(code) / 255.0);
        let color = target.color.and_then(|color| color.narrow).map_or(values.color, kept);
        let (z, stencil) = (values.depth, values.stencil as u32 & 0xff);
        // Whether all stored channels of each colour buffer are cleared.
        let whole_colors =
            !colors.is_empty() && colors.iter().all(|&(k, _, alpha)| written(k, alpha) == stored_channels(alpha));
        let channels = colors.first().map_or(0, |&(k, _, alpha)| written(k, alpha));
        let more = |&(k, color, alpha): &(usize, Surface, bool)| ColorTarget {
            format: color.format,
            blend: None,
            logic: None,
            write_mask: written(k, alpha),
        };
        let some_colors = colors.iter().any(|&(k, _, alpha)| written(k, alpha) != 0);
        let more = colors.iter().skip(1).map(more).collect();
        let partial = !whole || some_colors && !whole_colors || !matches!(stencil_mask, 0 | 0xff);
        if !partial {
            self.card.clear(whole_colors.then_some(color), depth.then_some(z), (stencil_mask == 0xff).then_some(stencil));
            return Ok(());
        }
        let face = StencilFace { pass_op: StencilOp::Replace, depth_fail_op: StencilOp::Replace, ..StencilFace::default() };
        let fixed = PipelineState {
            shader: {
                let colors = target.colors().count().max(1);
                self.card.plain_shader(LABELS[colors - 1], &clear_text(colors))
            },
            buffers: record::vertex_buffer(&[(0, VertexFormat::Float32x2)]).into_iter().collect(),
            primitive: Primitive::default(),
            color: target.color.map(|surface| surface.format),
            more,
            depth: target.depth.map(|surface| DepthStencil {
                format: surface.format,
                depth_write: depth,
                depth_compare: Compare::Always,
                stencil_front: if stencil_mask != 0 { face } else { StencilFace::default() },
                stencil_back: if stencil_mask != 0 { face } else { StencilFace::default() },
                stencil_read_mask: 0xff,
                stencil_write_mask: stencil_mask,
                stencil_back_masks: None,
                bias: 0.0,
                bias_slope: 0.0,
                bias_clamp: 0.0,
            }),
            blend: None,
            logic: None,
            mask: channels,
            textures: 0,
        };
        let pipeline = self.card.pipeline(&fixed);
        let alpha = if target.alpha { color[3] } else { 1.0 };
        let values = [color[0], color[1], color[2], alpha, z, 0.0, 0.0, 0.0];
        let uniforms = self.card.uniforms(&float_bytes(&values));
        let pass = &mut self.card.pass;
        let (vertices, first) = (pass.vertices.len() as u64, pass.indices.len() as u32);
        pass.vertices.extend(float_bytes(&[-1.0, -1.0, 3.0, -1.0, -1.0, 3.0]));
        pass.indices.extend([0, 1, 2]);
        let viewport = Viewport { x: 0.0, y: 0.0, width: width as f32, height: height as f32, min_depth: 0.0, max_depth: 1.0 };
        let blend = [0.0; 4];
        self.card.draw(Draw {
            pipeline,
            uniforms,
            vertices: vec![VertexRange { buffer: None, offset: vertices }],
            order: Order::pass(first),
            count: 3,
            textures: None,
            viewport,
            scissor,
            blend,
            stencil: [stencil; 2],
            writes: fixed.writes(),
            query: None,
            made: self.made(),
        });
        Ok(())
    }
}
