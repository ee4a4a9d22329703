//! Framebuffer objects, renderbuffers, and the choice of the images that are drawn to and read.

use gfx::state::Rect;
use gl_shader::key::{Base, TextureShape};
use gl_shader::narrow::restored;
use gl_shader::{COLORS_MAX, TARGETS, consts as e};

use crate::gl::call::{Arg, Call, Fault, GlResult, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Shape};
use crate::gl::card::copy_key::{Combine, CopyKey, CopySource, Map, row_edge};
use crate::gl::card::pass::Surface;
use crate::gl::draw::frames::WINDOW_MAX;
use crate::gl::machine::Gl;
use crate::gl::names;
use crate::gl::state::framebuffers::{Attachment, COLORS, EDGE_MAX, Renderbuffer};
use crate::gl::state::texture::Level;
use crate::gl::state::texturing::kind_of;
use crate::gl::texels::image::{DEPTH, StoredFormat};

/// Colour buffers that windows do not have: those of the right eye, and auxiliary ones.
const NO_BUFFERS: [u32; 7] = [0x401, 0x403, 0x407, 0x409, 0x40a, 0x40b, 0x40c];

/// Which bindings a target selects: draw, read.
fn bindings(target: u32) -> GlResult<[bool; 2]> {
    match target {
        e::FRAMEBUFFER => Ok([true, true]),
        e::DRAW_FRAMEBUFFER => Ok([true, false]),
        e::READ_FRAMEBUFFER => Ok([false, true]),
        _ => Err(INVALID_ENUM),
    }
}

/// The program chooses the format of the window. The window has alpha if the attribute list asks for at least one bit of alpha. A program
/// may make several such calls until one succeeds; one that asks for alpha is enough.
pub fn choose(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    // A window has an accumulation buffer only if the program asks for one. EGL windows have none.
    let accumulates = [14.0, 15.0, 16.0, 17.0];
    let asks = &*call.function.name != "eglChooseConfig";
    gl.accumulates.get_or_insert(false);
    let (list, alpha_size, flags): (_, _, &[f64]) = match &*call.function.name {
        "eglChooseConfig" => (1, 0x3021, &[]),
        "glXChooseFBConfig" => (2, 11, &[]),
        // GLX_USE_GL, GLX_RGBA, GLX_DOUBLEBUFFER and GLX_STEREO have no value.
        _ => (2, 11, &[1.0, 4.0, 5.0, 6.0]),
    };
    // A null pointer is an empty attribute list.
    let Ok(list) = call.numbers(list) else { return Ok(()) };
    let mut rest = list.iter();
    while let Some(name) = rest.next() {
        let value = if flags.contains(name) { 1.0 } else { *rest.next().unwrap_or(&0.0) };
        gl.card.window_alpha |= *name == f64::from(alpha_size) && value > 0.0;
        if asks && accumulates.contains(name) && value > 0.0 {
            gl.accumulates = Some(true);
        }
    }
    Ok(())
}

pub fn bind(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let ([draw, read], name) = (bindings(call.u32(0)?)?, call.u32(1)?);
    if name != 0 {
        gl.context.framebuffers.objects.get_or_insert_with(name, Default::default);
    }
    if draw {
        gl.context.framebuffers.draw = name;
    }
    if read {
        gl.context.framebuffers.read = name;
    }
    Ok(())
}

/// `glCheckFramebufferStatus(target)`: if the recorded driver could draw to the object and the machine cannot, draws are lost.
pub fn status(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let [draw, _] = bindings(call.u32(0)?)?;
    let name = if draw { gl.context.framebuffers.draw } else { gl.context.framebuffers.read };
    if name == 0 || !draw || call.result != Arg::Num(f64::from(e::FRAMEBUFFER_COMPLETE)) {
        return Ok(());
    }
    match gl.target_of(name) {
        Err(Fault::Error(_)) => {
            Err(Fault::Unsupported("a frame buffer object that is complete for the recorded driver".into()))
        }
        // What is not supported is named by the draws.
        _ => Ok(()),
    }
}

pub fn delete(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        gl.context.framebuffers.objects.remove(name);
        for bound in
            [&mut gl.context.framebuffers.draw, &mut gl.context.framebuffers.read].into_iter().filter(|bound| **bound == name)
        {
            *bound = 0;
        }
    }
    Ok(())
}

fn attach(gl: &mut Gl, target: u32, point: u32, what: Attachment) -> GlResult {
    let [draw, _] = bindings(target)?;
    let name = if draw { gl.context.framebuffers.draw } else { gl.context.framebuffers.read };
    let object = gl.context.framebuffers.objects.get_mut(name).filter(|_| name != 0).ok_or(INVALID_OPERATION)?;
    object.attach(point, what)
}

/// The texture image that a call attaches; its target selects the layer.
fn textured(gl: &Gl, target: u32, name: u32, level: u32) -> GlResult<Attachment> {
    if name == 0 {
        return Ok(Attachment::Nothing);
    }
    let face = target.wrapping_sub(e::TEXTURE_CUBE_MAP_POSITIVE_X);
    let (kind, layer) = match TARGETS.iter().position(|&known| known == target) {
        Some(k) => (kind_of(k), 0),
        None if face < 6 => (TextureShape::Cube, face),
        None => return Err(INVALID_ENUM),
    };
    if gl.objects.textures.get(name).is_none_or(|texture| texture.kind != kind) {
        return Err(INVALID_OPERATION);
    }
    Ok(Attachment::Texture(name, layer, level))
}

pub fn texture_1d_or_2d(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let what = textured(gl, call.u32(2)?, call.u32(3)?, call.size(4)?)?;
    attach(gl, call.u32(0)?, call.u32(1)?, what)
}

pub fn texture_any(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let (name, level) = (call.u32(2)?, call.size(3)?);
    let kind = gl.objects.textures.get(name).map(|texture| texture.kind);
    if matches!(kind, Some(TextureShape::Cube | TextureShape::D3)) {
        return Err(Fault::Unsupported("frame buffer objects with all layers of a texture".into()));
    }
    let what = match kind {
        Some(_) => Attachment::Texture(name, 0, level),
        None if name == 0 => Attachment::Nothing,
        None => return Err(INVALID_VALUE),
    };
    attach(gl, call.u32(0)?, call.u32(1)?, what)
}

pub fn renderbuffer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let name = call.u32(3)?;
    if call.u32(2)? != e::RENDERBUFFER {
        return Err(INVALID_ENUM);
    }
    let what = if name == 0 { Attachment::Nothing } else { Attachment::Renderbuffer(name) };
    attach(gl, call.u32(0)?, call.u32(1)?, what)
}

pub fn bind_renderbuffer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if call.u32(0)? != e::RENDERBUFFER {
        return Err(INVALID_ENUM);
    }
    gl.context.framebuffers.renderbuffer = call.u32(1)?;
    if gl.context.framebuffers.renderbuffer != 0 {
        gl.objects.renderbuffers.get_or_insert_with(gl.context.framebuffers.renderbuffer, Default::default);
    }
    Ok(())
}

pub fn delete_renderbuffers(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        if let Some(mut buffer) = gl.objects.renderbuffers.remove(name as u32) {
            gl.contexts.sharing().for_each(|context| context.lose_renderbuffer(name as u32));
            gl.part_from(|object| object.detach_renderbuffer(name as u32), |object| object.lose_renderbuffer(name as u32));
            buffer.free(&mut gl.card);
        }
    }
    Ok(())
}

fn storage(gl: &mut Gl, internal: u32, size: [u32; 2]) -> GlResult {
    if size.into_iter().any(|edge| edge > EDGE_MAX) {
        return Err(INVALID_VALUE);
    }
    let base = match internal {
        e::STENCIL_INDEX | e::STENCIL_INDEX8 => Base::Depth,
        _ => Base::of(internal)?,
    };
    let format = match base {
        Base::Depth => DEPTH,
        Base::Rgb | Base::Rgba | Base::Red | Base::Rg | Base::Float(..) => base.format(),
        Base::Narrow(narrow) if narrow.plain() != Base::LuminanceAlpha => base.format(),
        _ => return Err(Fault::Unsupported(format!("render buffers of internal format {}", names::name(internal)))),
    };
    let name = gl.context.framebuffers.renderbuffer;
    let old = gl.objects.renderbuffers.get_mut(name).ok_or(INVALID_OPERATION)?.image.take();
    if let Some((surface, ..)) = old {
        gl.card.destroy_surface(surface);
    }
    if !size.contains(&0) {
        let surface = gl.card.create_surface("renderbuffer", size, format);
        let image = (Surface { narrow: base.narrow(), ..surface }, size, base);
        gl.objects.renderbuffers.insert(name, Renderbuffer { image: Some(image) });
    }
    Ok(())
}

pub fn renderbuffer_storage(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if call.u32(0)? != e::RENDERBUFFER {
        return Err(INVALID_ENUM);
    }
    storage(gl, call.u32(1)?, [call.size(2)?, call.size(3)?])
}

pub fn renderbuffer_storage_multisample(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if call.size(1)? > 1 {
        return Err(Fault::Unsupported("render buffers of several samples".into()));
    }
    storage(gl, call.u32(2)?, [call.size(3)?, call.size(4)?])
}

/// Sets the single colour buffer that is drawn to.
fn set_draw(gl: &mut Gl, buffer: u32) -> GlResult {
    let color = buffer.wrapping_sub(e::COLOR_ATTACHMENT0) < COLORS as u32;
    if gl.context.framebuffers.draw != 0 {
        if buffer != e::NONE && !color {
            return Err(INVALID_OPERATION);
        }
        let object = gl.context.framebuffers.objects.get_mut(gl.context.framebuffers.draw).ok_or(INVALID_OPERATION)?;
        object.draw_to_one(buffer);
        return Ok(());
    }
    match buffer {
        e::BACK | e::BACK_LEFT | e::FRONT_AND_BACK | e::NONE | e::FRONT | e::FRONT_LEFT | e::LEFT => {
            gl.state.color.draw_buffer = buffer;
            Ok(())
        }
        _ if color || NO_BUFFERS.contains(&buffer) => Err(INVALID_OPERATION),
        _ => Err(INVALID_ENUM),
    }
}

pub fn draw_buffer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    set_draw(gl, call.u32(0)?)
}

pub fn draw_buffers(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    // Of an empty list there may be no pointer: then nothing is drawn to.
    let count = call.size(0)? as usize;
    let buffers = if count == 0 { Default::default() } else { call.numbers(1)? };
    let buffers = &buffers[..count.min(buffers.len())];
    if gl.context.framebuffers.draw != 0 {
        let mut draw = [e::NONE; COLORS_MAX];
        if buffers.len() > draw.len() {
            return Err(INVALID_VALUE);
        }
        for (to, &buffer) in draw.iter_mut().zip(buffers.iter()) {
            *to = buffer as u32;
            if *to != e::NONE && to.wrapping_sub(e::COLOR_ATTACHMENT0) >= COLORS as u32 {
                return Err(INVALID_ENUM);
            }
        }
        gl.context.framebuffers.objects.get_mut(gl.context.framebuffers.draw).ok_or(INVALID_OPERATION)?.draw_to(draw);
        return Ok(());
    }
    match buffers.iter().filter(|&&buffer| buffer != 0.0).count() {
        0 => set_draw(gl, e::NONE),
        1 if buffers[0] != 0.0 => set_draw(gl, buffers[0] as u32),
        _ => Err(Fault::Unsupported("drawing to several colour buffers".into())),
    }
}

pub fn read_buffer(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let buffer = call.u32(0)?;
    let color = buffer.wrapping_sub(e::COLOR_ATTACHMENT0) < COLORS as u32;
    let window = [e::BACK, e::BACK_LEFT, e::FRONT, e::FRONT_LEFT, e::LEFT, e::FRONT_AND_BACK].contains(&buffer);
    if !color && !window && buffer != e::NONE && !NO_BUFFERS.contains(&buffer) {
        return Err(INVALID_ENUM);
    }
    if buffer != e::NONE && if gl.context.framebuffers.read == 0 { !window } else { !color } {
        return Err(INVALID_OPERATION);
    }
    if let Some(object) =
        gl.context.framebuffers.objects.get_mut(gl.context.framebuffers.read).filter(|_| gl.context.framebuffers.read != 0)
    {
        object.read_from(buffer);
    } else {
        gl.context.framebuffers.window_read = buffer;
    }
    Ok(())
}

pub fn generate_mipmap(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let k = TARGETS.iter().position(|&target| Ok(target) == call.u32(0)).ok_or(INVALID_ENUM)?;
    gl.generate_levels(k, 0..if kind_of(k) == TextureShape::Cube { 6 } else { 1 })
}

impl Gl {
    /// Generates the mipmap levels of these faces from the base level. The texture is the one bound to this target of the active unit.
    pub fn generate_levels(&mut self, target: usize, faces: std::ops::Range<u32>) -> GlResult {
        let unit = self.state.texturing.active;
        self.texture(unit, target);
        let name = self.state.texturing.units[unit].bound[target];
        let texture =
            if name == 0 { self.objects.default_textures.get_mut(target as u32) } else { self.objects.textures.get_mut(name) };
        let texture = texture.ok_or(INVALID_OPERATION)?;
        if texture.kind == TextureShape::D3 {
            return Err(Fault::Unsupported("automatic mipmaps of 3D textures whose texels are on the card".into()));
        }
        let first = texture.range[0];
        for face in faces {
            let image = texture.levels.get((face, first)).cloned().ok_or(INVALID_OPERATION)?;
            if image.base == Base::Depth || image.format != image.base.format() {
                return Err(Fault::Unsupported(
                    "automatic mipmaps of depth textures and of compressed ones on the card".into(),
                ));
            }
            let ([mut width, mut height, _], mut level) = (image.size, first);
            while width.max(height) > 1 {
                let from = [width, height];
                (width, height, level) = ((width / 2).max(1), (height / 2).max(1), level + 1);
                let size = [width, height, 1];
                if texture.levels.get((face, level)).is_none_or(|old| old.size != size || old.base != image.base) {
                    let bytes = vec![0; (width * height * image.format.block_bytes()) as usize];
                    texture.define(&mut self.card, face, level, Level::plain(size, image.base, Some(bytes)));
                }
                let to = texture.surface(&mut self.card, face, level)?.ok_or(INVALID_OPERATION)?;
                let source = texture.surface(&mut self.card, face, level - 1)?.ok_or(INVALID_OPERATION)?;
                // The centre of a texel lies between the texels whose mean it is.
                let (format, result) = (image.format.name(), restored(image.base.narrow()));
                let key = CopyKey { from: CopySource::Filtered, result, format, combine: Combine::Replace, mask: 15 };
                let scale = [from[0] as f32 / width as f32, from[1] as f32 / height as f32];
                let map = Map { to: [0.0; 2], from: [0.0; 2], scale };
                let area = Rect { x: 0, y: 0, width, height };
                self.card.copy_pixels(key, image.format, source, to, map, 0.0, area);
            }
        }
        Ok(())
    }
}

pub fn blit(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    let mut edges = [0; 8];
    for (k, edge) in edges.iter_mut().enumerate() {
        *edge = call.i32(k)?;
    }
    let [sx0, sy0, sx1, sy1, x0, y0, x1, y1] = edges.map(|edge| edge as f32);
    let (mask, filter) = (call.u32(8)?, call.u32(9)?);
    if !matches!(filter, e::NEAREST | e::LINEAR) {
        return Err(INVALID_ENUM);
    }
    if x0 == x1 || y0 == y1 || sx0 == sx1 || sy0 == sy1 {
        return Ok(());
    }
    if mask & e::STENCIL_BUFFER_BIT != 0 {
        return Err(Fault::Unsupported("blits of stencil values".into()));
    }
    // A program that draws everything into framebuffer objects gives the window no viewport: what it copies there says how large the window is.
    if gl.context.framebuffers.draw == 0 {
        let reach = |a: f32, b: f32| a.max(b).clamp(0.0, WINDOW_MAX as f32) as u32;
        gl.window([reach(x0, x1), reach(y0, y1)], false)?;
    }
    let target = gl.aim()?;
    if target.more[0].is_some() && mask & e::COLOR_BUFFER_BIT != 0 {
        return Err(Fault::Unsupported("blits into several colour buffers".into()));
    }
    let Some(scissor) = gl.scissor() else { return Ok(()) };
    for depth in [false, true] {
        let bit = if depth { e::DEPTH_BUFFER_BIT } else { e::COLOR_BUFFER_BIT };
        let to = if depth { target.depth } else { target.color };
        let Some(to) = to.filter(|_| mask & bit != 0) else { continue };
        gl.flush()?;
        let (source, size, upward) = gl.read_source(depth)?;
        if (source.texture, source.level, source.layer) == (to.texture, to.level, to.layer) {
            return Err(Fault::Unsupported("blits of a frame buffer into itself".into()));
        }
        let (row, source_row) = (|y| row_edge(target.size[1], target.upward, y), |y| row_edge(size[1], upward, y));
        let scale = [(sx1 - sx0) / (x1 - x0), (source_row(sy1) - source_row(sy0)) / (row(y1) - row(y0))];
        let map = Map { to: [x0, row(y0)], from: [sx0, source_row(sy0)], scale };
        let span = |a: f32, b: f32, from: u32, size: u32| {
            let (low, high) = (a.min(b).max(from as f32), a.max(b).min((from + size) as f32));
            (low as u32, (high - low).max(0.0) as u32)
        };
        let (x, width) = span(x0, x1, scissor.x, scissor.width);
        let (y, height) = span(row(y0), row(y1), scissor.y, scissor.height);
        let from = match (depth, filter) {
            (true, _) => CopySource::Depth,
            (_, e::LINEAR) if scale.map(f32::abs) != [1.0; 2] => CopySource::Filtered,
            _ => CopySource::Color,
        };
        let result = if depth {
            "c.r"
        } else if let Some(narrow) = to.narrow {
            narrow.unswizzle()
        } else if target.alpha {
            "c"
        } else {
            "vec4f(c.rgb, 1)"
        };
        let key = CopyKey { from, result, format: to.format.name(), combine: Combine::Replace, mask: 15 };
        gl.card.copy_pixels(key, to.format, source, to, map, 0.0, Rect { x, y, width, height });
    }
    Ok(())
}
