//! Pixel rectangles that become fragments: bitmaps, drawn and copied pixels (OpenGL 1.5, sections 3.6.4, 3.7 and 4.3.3).
//!
//! Positions are rounded to whole pixels as in Mesa: those of bitmaps down, those of pixel rectangles to the nearest.

use gfx::format::Format;
use gfx::state::*;
use gl_shader::key::FogDistance;
use gl_shader::{UNITS, consts as e};
use glam::Mat4;
use num::*;
use trace::command::*;
use trace::record;

use crate::gl::call::{Call, Fault, GlResult, INVALID_ENUM, Shape};
use crate::gl::card::copy_key::{Combine, CopyKey, CopySource, Map, row_edge};
use crate::gl::card::pass::{Draw, Order, PipelineState, Surface, VertexRange};
use crate::gl::geometry::vertex::Vertex;
use crate::gl::machine::Gl;
use crate::gl::matrix;
use crate::gl::state::fragments::compare;
use crate::gl::state::prepared::PixelRectangle;
use crate::gl::state::server::capability;
use crate::gl::texels::transfer::values;
use crate::gl::texels::unpack::can_have;

/// Kinds of copies of `NV_copy_depth_to_color`.
const DEPTH_STENCIL_TO_RGBA: u32 = 0x886e;
const DEPTH_STENCIL_TO_BGRA: u32 = 0x886f;
/// Maximum width and height of a rectangle.
const EDGE_MAX: u32 = 16_384;
/// Fragments of drawn pixels that are depths, or bits of stencil values.
const DEPTH_TEXT: &str = "struct Uniforms { place: vec4f, color: vec4f, terms: vec4f }\n@group(0) @binding(0) var<uniform> u: Uniforms;\n\
    @group(1) @binding(0) var pixels: texture_2d<f32>;\n\
    @vertex fn vs(@location(0) position: vec2f) -> @builtin(position) vec4f { return vec4f(position, 0, 1); }\n\
    struct Out { @location(0) color: vec4f, @builtin(frag_depth) depth: f32 }\n\
    @fragment fn fs(@builtin(position) at: vec4f) -> Out {\n    \
    let p = floor((vec2f(at.x, u.terms.x + u.terms.y * at.y) - u.place.xy) * u.place.zw);\n    \
    let last = vec2i(textureDimensions(pixels)) - 1;\n    \
    return Out(u.color, textureLoad(pixels, clamp(vec2i(p), vec2i(), last), 0).r);\n}\n";

const STENCIL_TEXT: &str = "struct Uniforms { place: vec4f, color: vec4f, terms: vec4f }\n@group(0) @binding(0) var<uniform> u: Uniforms;\n\
    @group(1) @binding(0) var pixels: texture_2d<f32>;\n\
    @vertex fn vs(@location(0) position: vec2f) -> @builtin(position) vec4f { return vec4f(position, 0, 1); }\n\
    @fragment fn fs(@builtin(position) at: vec4f) -> @location(0) vec4f {\n    \
    let p = floor((vec2f(at.x, u.terms.x + u.terms.y * at.y) - u.place.xy) * u.place.zw);\n    \
    let last = vec2i(textureDimensions(pixels)) - 1;\n    \
    let value = u32(textureLoad(pixels, clamp(vec2i(p), vec2i(), last), 0).r);\n    \
    if (value & u32(u.terms.z)) == 0u { discard; }\n    return u.color;\n}\n";

impl Gl {
    /// Draws in window coordinates with the attributes of the raster position; vertex processing is skipped.
    fn in_window(&mut self, depth: f32, run: impl FnOnce(&mut Gl, Vertex) -> GlResult) -> GlResult {
        self.flush()?;
        let target = self.aim()?;
        let state = self.state.clone();
        if state.is(e::FOG) && !state.fog.from_coordinate && state.fog.distance != FogDistance::Absolute {
            return Err(Fault::Unsupported("pixel rectangles with a mode of the fog's distance".into()));
        }
        let (modelview, projection) = (self.context.matrices.modelview.top, self.context.matrices.projection.top);
        let textures: [Mat4; UNITS] = std::array::from_fn(|unit| self.context.matrices.texture[unit].top);
        let mut vertex = state.raster.vertex.clone();
        let off = [e::LIGHTING, e::CULL_FACE, e::POLYGON_STIPPLE, e::POLYGON_SMOOTH, e::POLYGON_OFFSET_FILL];
        let bits = |caps: &mut dyn Iterator<Item = u32>| caps.filter_map(capability).fold(0, |all, bit| all | bit);
        self.state.enabled &= !bits(&mut off.into_iter().chain((0..6).map(|k| e::CLIP_PLANE0 + k)));
        if state.is(e::LIGHTING) {
            // The secondary colour of a lit vertex is added if specular light is separate.
            let sum = bits(&mut [e::COLOR_SUM].into_iter());
            self.state.enabled = self.state.enabled & !sum | if state.lighting.separate_specular { sum } else { 0 };
        }
        self.state.polygon.modes = [e::FILL; 2];
        (self.state.lighting.flat, self.state.lighting.two_side, self.state.fog.from_coordinate) = (false, false, true);
        self.state.texturing.units.iter_mut().for_each(|unit| unit.generated = 0);
        self.context.matrices.texture.iter_mut().for_each(|stack| stack.top = Mat4::IDENTITY);
        let [width, height] = target.size.map(f64::from);
        self.state.transform.viewport = [0, 0, target.size[0] as i32, target.size[1] as i32];
        self.state.transform.depth_range = [0.0, 1.0];
        self.context.matrices.modelview.top = Mat4::IDENTITY;
        self.context.matrices.projection.top = matrix::ortho([0.0, width, 0.0, height, 1.0, -1.0]);
        vertex.position = [0.0, 0.0, 2.0 * depth - 1.0, 1.0];
        // As in Mesa, whatever the raster position's distance is.
        vertex.fog = 0.0;
        let outcome = run(self, vertex).and_then(|()| self.flush());
        self.state = state;
        (self.context.matrices.modelview.top, self.context.matrices.projection.top) = (modelview, projection);
        for (stack, top) in self.context.matrices.texture.iter_mut().zip(textures) {
            stack.top = top;
        }
        outcome
    }

    /// The corners of a pixel rectangle in the window; the first is that of its first pixel.
    fn corners(&self, at: [f32; 4], size: [u32; 2]) -> ([f32; 2], [f32; 2]) {
        let [x, y] = [at[0], at[1]].map(libm::roundf);
        let [zx, zy] = self.state.pixels.zoom;
        ([x, y], [x + zx * size[0] as f32, y + zy * size[1] as f32])
    }

    /// Draws a rectangle whose colours come from a source.
    fn rectangle(&mut self, bound: (TextureId, ViewId, SamplerId), at: [f32; 4], size: [u32; 2], first: [f32; 3]) -> GlResult {
        let ([x0, y0], [x1, y1]) = self.corners(at, size);
        let [zx, zy] = self.state.pixels.zoom;
        if zx == 0.0 || zy == 0.0 {
            return Ok(());
        }
        let (scale, bias) = if first[2] == 0.0 {
            ([1.0; 4], [0.0; 4])
        } else {
            (self.state.pixels.transfer.scale, self.state.pixels.transfer.bias)
        };
        let rows = if first[2] == 0.0 { 1.0 } else { first[2] };
        let uniforms = [[x0, y0, 1.0 / zx, 1.0 / zy], [first[0], first[1], 1.0, rows], scale, bias];
        self.in_window(at[2], |gl, vertex| {
            gl.drawing.pixels = Some(PixelRectangle { bound, uniforms });
            let corners = [[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|at| placed(&vertex, at));
            let outcome = gl.primitive(e::QUADS, &corners).and_then(|()| gl.flush());
            gl.drawing.pixels = None;
            outcome
        })
    }

    /// A draw of a rectangle whose depths or stencil values come from a source.
    fn values_rectangle(
        &mut self,
        source: Surface,
        at: [f32; 4],
        size: [u32; 2],
        fixed: &PipelineState,
        reference: u32,
        bit: f32,
    ) -> GlResult {
        let target = self.aim()?;
        let Some(scissor) = self.scissor() else { return Ok(()) };
        let ([x0, y0], [x1, y1]) = self.corners(at, size);
        let [zx, zy] = self.state.pixels.zoom;
        if zx == 0.0 || zy == 0.0 {
            return Ok(());
        }
        let pipeline = self.card.pipeline(fixed);
        let [width, height] = target.size.map(|edge| edge as f32);
        let terms = if target.upward { [0.0, 1.0, bit, 0.0] } else { [height, -1.0, bit, 0.0] };
        let uniforms = [[x0, y0, 1.0 / zx, 1.0 / zy], self.state.raster.vertex.color, terms];
        let bytes = float_bytes(uniforms.as_flattened());
        let uniforms = self.card.uniforms(&bytes);
        let sampler = self.card.sampler(SamplerDesc::default());
        let group = self.card.textures(&[(source.texture, source.view, sampler)]);
        let pass = &mut self.card.pass;
        pass.textures.insert(source.texture, ());
        let (vertices, first) = (pass.vertices.len() as u64, pass.indices.len() as u32);
        for [x, y] in [[x0, y0], [x1, y0], [x1, y1], [x0, y1]] {
            let up = 2.0 * y / height - 1.0;
            for value in [2.0 * x / width - 1.0, if target.upward { -up } else { up }] {
                pass.vertices.extend_from_slice(&f32::to_le_bytes(value));
            }
        }
        pass.indices.extend([0, 1, 2, 0, 2, 3]);
        let viewport = Viewport { x: 0.0, y: 0.0, width, height, min_depth: 0.0, max_depth: 1.0 };
        self.card.draw(Draw {
            pipeline,
            uniforms,
            vertices: vec![VertexRange { buffer: None, offset: vertices }],
            order: Order::pass(first),
            count: 6,
            textures: Some(group),
            viewport,
            scissor,
            blend: [0.0; 4],
            stencil: [reference; 2],
            writes: fixed.writes(),
            query: self.context.query,
            made: self.made(),
        });
        Ok(())
    }

    /// Draws a rectangle of depths, and frees their surface. They are tested and written like those of fragments. Beside stencil values they
    /// are written without tests and colours, as in Mesa.
    fn draw_depths(&mut self, source: Surface, at: [f32; 4], size: [u32; 2], beside: bool) -> GlResult {
        let mut fixed = self.values_state("depths", DEPTH_TEXT)?;
        if beside {
            if let Some(depth) = &mut fixed.depth {
                depth.depth_write = self.state.depth.write;
            }
            self.values_rectangle(source, at, size, &fixed, 0, 0.0)?;
            self.card.destroy_surface(source);
            return Ok(());
        }
        let (tested, front) = (self.state.is(e::DEPTH_TEST), self.state.stencil.sides[0]);
        let face = if self.state.is(e::STENCIL_TEST) { front.face()? } else { StencilFace::default() };
        if let Some(depth) = &mut fixed.depth {
            if tested {
                depth.depth_write = self.state.depth.write;
                depth.depth_compare = compare(self.state.depth.func);
            }
            (depth.stencil_front, depth.stencil_back) = (face, face);
            (depth.stencil_read_mask, depth.stencil_write_mask) = (front.read & 0xff, front.write & 0xff);
        }
        fixed.mask = if fixed.color.is_some() { self.mask() } else { 0 };
        self.values_rectangle(source, at, size, &fixed, front.reference as u32, 0.0)?;
        self.card.destroy_surface(source);
        Ok(())
    }

    /// Draws a rectangle of stencil values, and frees their surface. All bits are cleared first. The texture decides which are set again, one
    /// bit a draw.
    fn draw_stencil(&mut self, source: Surface, at: [f32; 4], size: [u32; 2]) -> GlResult {
        let mut fixed = self.values_state("stencil", STENCIL_TEXT)?;
        let ones = self.numbers_surface(size, &vec![255.0; (size[0] * size[1]) as usize]);
        for bit in std::iter::once(0).chain((0..8).map(|bit| 1 << bit)) {
            if let Some(depth) = &mut fixed.depth {
                let face = StencilFace { pass_op: StencilOp::Replace, ..StencilFace::default() };
                (depth.stencil_front, depth.stencil_back) = (face, face);
                depth.stencil_write_mask = self.state.stencil.sides[0].write & if bit == 0 { 0xff } else { bit };
            }
            let (from, tested) = if bit == 0 { (ones, 255) } else { (source, bit) };
            self.values_rectangle(from, at, size, &fixed, bit, tested as f32)?;
        }
        self.card.destroy_surface(source);
        self.card.destroy_surface(ones);
        Ok(())
    }

    /// Depths or stencil values of a rectangle of the frame buffer, as numbers, rows from the bottom.
    fn copied_numbers(&mut self, from: CopySource, [x, y]: [i32; 2], size: [u32; 2]) -> GlResult<Surface> {
        self.flush()?;
        let (source, [_, height], upward) = self.read_source(true)?;
        let to = self.card.create_surface("pixels", size, Format::R32Float);
        let map = Map {
            to: [0.0; 2],
            from: [x as f32, row_edge(height, upward, y as f32)],
            scale: [1.0, if upward { 1.0 } else { -1.0 }],
        };
        let key = CopyKey { from, result: "c", format: Format::R32Float.name(), combine: Combine::Replace, mask: 15 };
        let area = Rect { x: 0, y: 0, width: size[0], height: size[1] };
        self.card.copy_pixels(key, Format::R32Float, source, to, map, 0.0, area);
        Ok(to)
    }

    /// A surface with numbers, one per pixel.
    fn numbers_surface(&mut self, size: [u32; 2], numbers: &[f32]) -> Surface {
        let surface = self.card.create_surface("pixels", size, Format::R32Float);
        let bytes = float_bytes(numbers);
        self.write_surface(surface, size, &bytes);
        surface
    }

    fn write_surface(&mut self, surface: Surface, size: [u32; 2], bytes: &[u8]) {
        let to = TextureEnd { texture: surface.texture, level: 0, origin: [0; 3], aspect: Aspect::All };
        let layout = LinearLayout { offset: 0, bytes_per_row: None, rows_per_image: None };
        self.card.recorder.write_texture(to, layout, [size[0], size[1], 1], "pixels", bytes);
    }

    /// The state that draws of depths and draws of stencil values have in common.
    fn values_state(&mut self, label: &'static str, text: &str) -> GlResult<PipelineState> {
        let target = self.aim()?;
        if target.more[0].is_some() {
            return Err(Fault::Unsupported("pixel rectangles in several colour buffers".into()));
        }
        let shader = self.card.plain_shader(label, text);
        Ok(PipelineState {
            shader,
            buffers: record::vertex_buffer(&[(0, VertexFormat::Float32x2)]).into_iter().collect(),
            primitive: Primitive::default(),
            color: target.color.map(|surface| surface.format),
            more: Vec::new(),
            depth: target.depth.map(|surface| DepthStencil {
                depth_write: false,
                depth_compare: Compare::Always,
                ..record::depth_less(surface.format)
            }),
            blend: None,
            logic: None,
            mask: 0,
            textures: 1,
        })
    }
}

/// A vertex at a place in the window.
fn placed(vertex: &Vertex, [x, y]: [f32; 2]) -> Vertex {
    let mut moved = vertex.clone();
    (moved.position[0], moved.position[1]) = (x, y);
    moved
}

pub fn bitmap(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(2, |gl| draw_bitmap(gl, call))
}

fn draw_bitmap(gl: &mut Gl, call: &Call) -> GlResult {
    let (width, height) = (call.size(0)?, call.size(1)?);
    let (origin, step) = ([call.f32(2)?, call.f32(3)?], [call.f32(4)?, call.f32(5)?]);
    let Some(at) = gl.state.raster.position else { return Ok(()) };
    if width.max(height) > EDGE_MAX {
        return Err(Fault::Limit(format!("a bitmap of {width} x {height} pixels, at most {EDGE_MAX} each")));
    }
    let drawn = width > 0 && height > 0 && gl.context.render_mode.draws();
    if let Some(bytes) = if drawn { gl.pixel_bytes(call.arg(6))? } else { None } {
        let bits = values(&gl.context.unpack, [width, height, 1], e::BITMAP, &bytes, false)?;
        let [left, low] = [0, 1].map(|k| (at[k] + 1e-4 - origin[k]).floor());
        gl.in_window(at[2], |gl, vertex| {
            let mut corners = Vec::new();
            for (y, row) in bits.chunks_exact(width as usize).enumerate() {
                // A run of set bits becomes one rectangle.
                let mut x = 0;
                while let Some(start) = row[x..].iter().position(|&bit| bit != 0.0).map(|k| x + k) {
                    x = row[start..].iter().position(|&bit| bit == 0.0).map_or(row.len(), |k| start + k);
                    let [x0, x1] = [start, x].map(|x| left + x as f32);
                    let [y0, y1] = [y, y + 1].map(|y| low + y as f32);
                    corners.extend([[x0, y0], [x1, y0], [x1, y1], [x0, y1]].map(|at| placed(&vertex, at)));
                }
            }
            gl.primitive(e::QUADS, &corners)
        })?;
    }
    gl.state.raster.position = Some([at[0] + step[0], at[1] + step[1], at[2], at[3]]);
    Ok(())
}

fn size_of(call: &Call, first: usize) -> GlResult<[u32; 2]> {
    let size = [call.size(first)?, call.size(first + 1)?];
    if size.into_iter().any(|edge| edge > EDGE_MAX) {
        return Err(Fault::Limit(format!("pixels in a rectangle of {} x {}, at most {EDGE_MAX} each", size[0], size[1])));
    }
    Ok(size)
}

pub fn draw_pixels(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.unpacking(2, |gl| draw(gl, call))
}

fn draw(gl: &mut Gl, call: &Call) -> GlResult {
    let ([width, height], format, kind) = (size_of(call, 0)?, call.u32(2)?, call.u32(3)?);
    can_have(format, kind)?;
    let Some(at) = gl.state.raster.position else { return Ok(()) };
    if width == 0 || height == 0 || !gl.context.render_mode.draws() {
        return Ok(());
    }
    let bytes = gl.pixel_bytes(call.arg(4))?.ok_or_else(|| Fault::Damaged("the pixels were not recorded".into()))?;
    let size = [width, height];
    match format {
        e::DEPTH_COMPONENT => {
            let depths = gl.depths([width, height, 1], kind, &bytes)?;
            let source = gl.numbers_surface(size, &depths);
            gl.draw_depths(source, at, size, false)?;
        }
        e::DEPTH_STENCIL => {
            let (depths, values) = gl.depths_and_stencil([width, height, 1], kind, &bytes)?;
            let source = gl.numbers_surface(size, &depths);
            gl.draw_depths(source, at, size, true)?;
            let values: Vec<f32> = values.into_iter().map(f32::from).collect();
            let source = gl.numbers_surface(size, &values);
            gl.draw_stencil(source, at, size)?;
        }
        e::STENCIL_INDEX => {
            let indices = gl.stencil_indices([width, height, 1], kind, &bytes)?;
            let numbers: Vec<f32> = indices.iter().map(|&index| f32::from(index)).collect();
            let source = gl.numbers_surface(size, &numbers);
            gl.draw_stencil(source, at, size)?;
        }
        _ => {
            let texels = gl.texels([width, height, 1], format, kind, &bytes)?;
            let source = gl.card.create_surface("pixels", size, Format::Rgba8Unorm);
            gl.write_surface(source, size, texels.as_flattened());
            let sampler = gl.card.sampler(SamplerDesc::default());
            gl.rectangle((source.texture, source.view, sampler), at, size, [0.0; 3])?;
            gl.card.destroy_surface(source);
        }
    }
    Ok(())
}

pub fn copy_pixels(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (x, y, size, kind) = (call.i32(0)?, call.i32(1)?, size_of(call, 2)?, call.u32(4)?);
    let Some(at) = gl.state.raster.position else { return Ok(()) };
    if size.contains(&0) || !gl.context.render_mode.draws() {
        return Ok(());
    }
    match kind {
        e::COLOR if gl.state.pixels.transfer.map_color => Err(Fault::Unsupported("copies of pixels through pixel maps".into())),
        e::COLOR => {
            gl.flush()?;
            let (source, extent, upward) = gl.read_source(false)?;
            if source.format != Format::Rgba8Unorm || source.level != 0 || source.layer != 0 {
                return Err(Fault::Unsupported("copies of pixels from levels and layers of textures".into()));
            }
            let bound = gl.card.frame_copy(source, extent);
            // The row of the copy that holds the first row of pixels.
            let (row, rows) = if upward { (y as f32, 1.0) } else { (row_edge(extent[1], false, y as f32) - 1.0, -1.0) };
            gl.rectangle(bound, at, size, [x as f32, row, rows])
        }
        e::DEPTH | e::STENCIL | e::DEPTH_STENCIL => {
            let transfer = &gl.state.pixels.transfer;
            if transfer.depth != [1.0, 0.0] || transfer.index != [0; 2] || transfer.map_stencil {
                return Err(Fault::Unsupported("copies of depths and stencil values through pixel transfer".into()));
            }
            // Both are read before either is written: source and destination may overlap.
            let copied = |gl: &mut Gl, from, wanted: bool| wanted.then(|| gl.copied_numbers(from, [x, y], size)).transpose();
            let depths = copied(gl, CopySource::Depth, kind != e::STENCIL)?;
            let values = copied(gl, CopySource::Stencil, kind != e::DEPTH)?;
            depths.map_or(Ok(()), |source| gl.draw_depths(source, at, size, kind == e::DEPTH_STENCIL))?;
            values.map_or(Ok(()), |source| gl.draw_stencil(source, at, size))
        }
        DEPTH_STENCIL_TO_RGBA | DEPTH_STENCIL_TO_BGRA => {
            Err(Fault::Unsupported("copies of depths and stencil values to colours".into()))
        }
        _ => Err(INVALID_ENUM),
    }
}
