//! Framebuffer objects, renderbuffers, and the choice of the images that are drawn to and read.

use gfx::state::Rect;

use super::call::{Arg, Call, Fault, INVALID_ENUM, INVALID_OPERATION, INVALID_VALUE, Outcome, Shape};
use super::card::{Buffer, COLORS_MAX, Card, DEPTH, Surface, Target};
use super::consts as e;
use super::contexts::{lose, missing};
use super::copies::{CopyKey, From, Map, Meet, row_edge};
use super::draw::kind_of;
use super::image::Kept;
use super::key::{Base, Kind};
use super::machine::{Gl, WINDOW_MAX};
use super::names;
use super::state::TARGETS;
use super::texture::{FromTarget, Level};
use gl_shader::narrow::restored;

/// The error of an incomplete framebuffer object.
const INCOMPLETE: Fault = Fault::Error("GL_INVALID_FRAMEBUFFER_OPERATION");
/// Number of colour attachments.
const COLORS: usize = 16;
/// Maximum width and height of renderbuffers.
const EDGE_MAX: u32 = 16_384;

/// What is attached to a frame buffer object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Attached {
    /// Nothing.
    #[default]
    Nothing,
    /// An image of a texture: its name, its layer or face, its level.
    Texture(u32, u32, u32),
    /// A render buffer.
    Renderbuffer(u32),
}

/// A frame buffer object.
#[derive(Clone, Debug)]
pub struct Framebuffer {
    colors: [Attached; COLORS],
    depth: Attached,
    stencil: Attached,
    draw: [u32; COLORS_MAX],
    read: u32,
}

/// A list of draw buffers with this one first and `NONE` for the others.
fn alone(buffer: u32) -> [u32; COLORS_MAX] {
    std::array::from_fn(|k| if k == 0 { buffer } else { e::NONE })
}

impl Framebuffer {
    fn attached(&mut self) -> impl Iterator<Item = &mut Attached> {
        self.colors.iter_mut().chain([&mut self.depth, &mut self.stencil])
    }

    /// Detaches a texture.
    fn detach_texture(&mut self, name: u32) {
        let attached = self.attached().filter(|at| matches!(at, Attached::Texture(own, ..) if *own == name));
        attached.for_each(|at| *at = Attached::Nothing);
    }

    /// Detaches a render buffer.
    fn detach_renderbuffer(&mut self, name: u32) {
        let attached = self.attached().filter(|at| matches!(at, Attached::Renderbuffer(own) if *own == name));
        attached.for_each(|at| *at = Attached::Nothing);
    }

    /// Marks attachments of a texture that is deleted and would stay alive as long as it is attached.
    pub fn lose_texture(&mut self, name: u32) {
        let names = self.attached().filter_map(|at| if let Attached::Texture(name, ..) = at { Some(name) } else { None });
        lose(names, name);
    }

    /// Marks attachments of a render buffer that is deleted and would stay alive as long as it is attached.
    pub fn lose_renderbuffer(&mut self, name: u32) {
        let names = self.attached().filter_map(|at| if let Attached::Renderbuffer(name) = at { Some(name) } else { None });
        lose(names, name);
    }
}

impl Default for Framebuffer {
    fn default() -> Self {
        let (draw, read) = (alone(e::COLOR_ATTACHMENT0), e::COLOR_ATTACHMENT0);
        Framebuffer { colors: [Attached::Nothing; COLORS], depth: Attached::Nothing, stencil: Attached::Nothing, draw, read }
    }
}

impl Gl {
    /// Has frame buffer objects part from an object that is deleted: those that are bound `detach` it, and the others `lose` it.
    fn part_from(&mut self, detach: impl Fn(&mut Framebuffer), lose: impl Fn(&mut Framebuffer)) {
        for name in self.framebuffers.keys() {
            let is_bound = [self.draw_framebuffer, self.read_framebuffer].contains(&name);
            let Some(object) = self.framebuffers.get_mut(name) else { continue };
            if is_bound { detach(object) } else { lose(object) }
        }
    }

    /// Has frame buffer objects part from a texture that is deleted.
    pub(super) fn part_from_texture(&mut self, name: u32) {
        self.part_from(|object| object.detach_texture(name), |object| object.lose_texture(name));
    }
}

/// Colour buffers that windows do not have: those of the right eye, and auxiliary ones.
const NO_BUFFERS: [u32; 7] = [0x401, 0x403, 0x407, 0x409, 0x40a, 0x40b, 0x40c];

/// A renderbuffer: its image, its size, its base format.
#[derive(Clone, Debug, Default)]
pub struct Renderbuffer {
    image: Option<(Surface, [u32; 2], Base)>,
}

impl Renderbuffer {
    /// Frees its image.
    pub(super) fn free(&mut self, card: &mut Card) {
        if let Some((surface, ..)) = self.image.take() {
            card.destroy_surface(surface);
        }
    }
}

/// An attached image: its surface, its size, its base format.
type Image = (Surface, [u32; 2], Base);

impl Gl {
    fn image(&mut self, attached: Attached) -> Outcome<Option<Image>> {
        match attached {
            Attached::Nothing => Ok(None),
            Attached::Renderbuffer(name) => {
                let image = self.renderbuffers.get(name).and_then(|buffer| buffer.image);
                image.map(Some).ok_or_else(|| missing(name, INCOMPLETE))
            }
            Attached::Texture(name, layer, level) => {
                let texture = self.textures.get_mut(name).ok_or_else(|| missing(name, INCOMPLETE))?;
                let face = if texture.kind == Kind::Cube { layer } else { 0 };
                let Some(image) = texture.levels.get((face, level)) else { return Err(INCOMPLETE) };
                let (size, base) = ([image.size[0], image.size[1]], image.base);
                let surface = texture.surface(&mut self.card, layer, level)?;
                let refused =
                    || Fault::Unsupported("drawing into images of textures before their base level, and of 3D textures".into());
                Ok(Some((surface.ok_or_else(refused)?, size, base)))
            }
        }
    }

    /// The image at an attachment of a framebuffer object; `buffer` is the enumerant of the colour buffer.
    fn color_image(&mut self, object: &Framebuffer, buffer: u32) -> Outcome<Option<Image>> {
        if buffer == e::NONE {
            return Ok(None);
        }
        let attached = object.colors.get(buffer.wrapping_sub(e::COLOR_ATTACHMENT0) as usize).copied().unwrap_or_default();
        let image = self.image(attached)?;
        if image.is_some_and(|(surface, ..)| surface.format.is_compressed()) {
            return Err(INCOMPLETE);
        }
        if image.is_some_and(|(_, _, base)| !matches!(base.plain(), Base::Rgb | Base::Rgba | Base::Red | Base::Rg)) {
            return Err(Fault::Unsupported("frame buffer objects with luminance, alpha, intensity or sRGB".into()));
        }
        Ok(image)
    }

    pub(super) fn target_of(&mut self, name: u32) -> Outcome<Target> {
        let object = self.framebuffers.get(name).cloned().ok_or(INCOMPLETE)?;
        let mut images = [None; COLORS_MAX];
        for (image, &buffer) in images.iter_mut().zip(&object.draw) {
            *image = self.color_image(&object, buffer)?;
        }
        let count = images.iter().take_while(|image| image.is_some()).count();
        if images[count..].iter().any(Option::is_some) {
            return Err(Fault::Unsupported("drawing to several colour buffers with one between them left out".into()));
        }
        let color = images[0];
        let (depth, stencil) = (self.image(object.depth)?, self.image(object.stencil)?);
        if let Attached::Texture(name, ..) = object.stencil
            && self.textures.get(name).is_some_and(|texture| texture.given_stencil)
        {
            return Err(Fault::Unsupported("drawing with stencil values that a texture was given".into()));
        }
        let attached = depth.or(stencil);
        if depth.is_some() && stencil.is_some() && object.depth != object.stencil {
            return Err(Fault::Unsupported("frame buffer objects with depth and stencil in two images".into()));
        }
        if attached.is_some_and(|(_, _, base)| base != Base::Depth) {
            return Err(INCOMPLETE);
        }
        let sizes: Vec<[u32; 2]> = images.into_iter().chain([attached]).flatten().map(|(_, size, _)| size).collect();
        let &size = sizes.first().ok_or(INCOMPLETE)?;
        if count > 1 && images.iter().flatten().any(|(surface, ..)| surface.narrow.is_some()) {
            return Err(Fault::Unsupported("several colour images, of which some have fewer than eight bits a channel".into()));
        }
        if sizes.iter().any(|&other| other != size) {
            return Err(Fault::Unsupported("frame buffer objects with images of different sizes".into()));
        }
        Ok(Target {
            size,
            color: color.map(|(surface, ..)| surface),
            more: std::array::from_fn(|k| images[k + 1].map(|(surface, _, base)| (surface, base.plain() == Base::Rgba))),
            depth: attached.map(|(surface, ..)| surface),
            has_depth: depth.is_some(),
            has_stencil: stencil.is_some(),
            upward: true,
            alpha: color.is_some_and(|(_, _, base)| base.plain() == Base::Rgba),
            window: None,
        })
    }

    /// Selects the render target by the current state.
    ///
    /// # Errors
    /// If there is no such target; also while the size of the window is not known.
    pub fn aim(&mut self) -> Outcome<Target> {
        if self.draw_framebuffer == 0 {
            self.settle_window()?;
        }
        let target = match (self.draw_framebuffer, self.state.draw_buffer) {
            (0, e::FRONT | e::FRONT_LEFT) if self.state.is(e::FRAMEBUFFER_SRGB) => {
                return Err(Fault::Unsupported("drawing to the front with GL_FRAMEBUFFER_SRGB".into()));
            }
            (0, e::FRONT | e::FRONT_LEFT) => self.card.window_target(Buffer::Front),
            // Only the back buffer is drawn to, since nothing may read the front one before the buffers are swapped.
            (0, e::LEFT | e::FRONT_AND_BACK) => {
                if let Some(window) = self.card.windows.drawn() {
                    window.front_lacks = true;
                }
                match self.state.is(e::FRAMEBUFFER_SRGB) {
                    true => self.card.encoded_target(),
                    false => self.card.window_target(Buffer::Back),
                }
            }
            (0, _) if self.state.is(e::FRAMEBUFFER_SRGB) => self.card.encoded_target(),
            (0, _) => self.card.window_target(Buffer::Back),
            (name, _) => Some(self.target_of(name)?),
        };
        self.card.aim(target);
        target.ok_or_else(|| Fault::Unsupported("drawing before the size of the window is known".into()))
    }

    /// Gives the window that is drawn to the size of the viewport if no call has given it one.
    fn settle_window(&mut self) -> Outcome {
        // A context without a drawable has no window.
        self.card.windows.draw.ok_or(INCOMPLETE)?;
        let [x, y, width, height] = self.state.viewport;
        let size = [x.saturating_add(width), y.saturating_add(height)].map(|edge| edge.clamp(0, EDGE_MAX as i32) as u32);
        if self.card.size() == [0; 2] && !size.contains(&0) {
            self.card.resize(size);
        }
        Ok(())
    }

    /// The image that copies and reads take: colours or depths.
    pub fn read_source(&mut self, depth: bool) -> Outcome<FromTarget> {
        self.flush()?;
        let none = || Fault::Unsupported("reading before the size of the window is known".into());
        if self.read_framebuffer == 0 {
            let window = self.card.windows.reading().ok_or(INCOMPLETE)?;
            let front = matches!(self.read_buffer, e::FRONT | e::FRONT_LEFT | e::LEFT | e::FRONT_AND_BACK);
            if front && window.front_lacks && !depth {
                return Err(Fault::Unsupported("reading the front buffer after drawing to front and back".into()));
            }
            let target = self.card.read_target(if front { Buffer::Front } else { Buffer::Back }).ok_or_else(none)?;
            let surface = if depth { target.depth } else { target.color };
            return Ok((surface.ok_or(INVALID_OPERATION)?, target.size, target.upward));
        }
        let object = self.framebuffers.get(self.read_framebuffer).cloned().ok_or(INCOMPLETE)?;
        let image = if depth { self.image(object.depth)? } else { self.color_image(&object, object.read)? };
        let (surface, size, _) = image.ok_or(INVALID_OPERATION)?;
        Ok((surface, size, true))
    }
}

/// Which bindings a target selects: draw, read.
fn bindings(target: u32) -> Outcome<[bool; 2]> {
    match target {
        e::FRAMEBUFFER => Ok([true, true]),
        e::DRAW_FRAMEBUFFER => Ok([true, false]),
        e::READ_FRAMEBUFFER => Ok([false, true]),
        _ => Err(INVALID_ENUM),
    }
}

/// The program chooses the format of the window. The window has alpha if the attribute list asks for at least one bit of alpha. A program
/// may make several such calls until one succeeds; one that asks for alpha is enough.
pub(super) fn choose(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
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

pub(super) fn bind(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let ([draw, read], name) = (bindings(call.u32(0)?)?, call.u32(1)?);
    if name != 0 {
        gl.framebuffers.get_or_insert_with(name, Default::default);
    }
    if draw {
        gl.draw_framebuffer = name;
    }
    if read {
        gl.read_framebuffer = name;
    }
    Ok(())
}

/// `glCheckFramebufferStatus(target)`: if the recorded driver could draw to the object and the machine cannot, draws are lost.
pub(super) fn status(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let [draw, _] = bindings(call.u32(0)?)?;
    let name = if draw { gl.draw_framebuffer } else { gl.read_framebuffer };
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

pub(super) fn delete(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        let name = name as u32;
        gl.framebuffers.remove(name);
        for bound in [&mut gl.draw_framebuffer, &mut gl.read_framebuffer].into_iter().filter(|bound| **bound == name) {
            *bound = 0;
        }
    }
    Ok(())
}

fn attach(gl: &mut Gl, target: u32, point: u32, what: Attached) -> Outcome {
    let [draw, _] = bindings(target)?;
    let name = if draw { gl.draw_framebuffer } else { gl.read_framebuffer };
    let object = gl.framebuffers.get_mut(name).filter(|_| name != 0).ok_or(INVALID_OPERATION)?;
    match point {
        e::DEPTH_ATTACHMENT => object.depth = what,
        e::STENCIL_ATTACHMENT => object.stencil = what,
        e::DEPTH_STENCIL_ATTACHMENT => (object.depth, object.stencil) = (what, what),
        _ => {
            let index = point.wrapping_sub(e::COLOR_ATTACHMENT0) as usize;
            *object.colors.get_mut(index).ok_or(INVALID_ENUM)? = what;
        }
    }
    Ok(())
}

/// The texture image that a call attaches; its target selects the layer.
fn textured(gl: &Gl, target: u32, name: u32, level: u32) -> Outcome<Attached> {
    if name == 0 {
        return Ok(Attached::Nothing);
    }
    let face = target.wrapping_sub(e::TEXTURE_CUBE_MAP_POSITIVE_X);
    let (kind, layer) = match TARGETS.iter().position(|&known| known == target) {
        Some(k) => (kind_of(k), 0),
        None if face < 6 => (Kind::Cube, face),
        None => return Err(INVALID_ENUM),
    };
    if gl.textures.get(name).is_none_or(|texture| texture.kind != kind) {
        return Err(INVALID_OPERATION);
    }
    Ok(Attached::Texture(name, layer, level))
}

pub(super) fn texture_1d_or_2d(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let what = textured(gl, call.u32(2)?, call.u32(3)?, call.size(4)?)?;
    attach(gl, call.u32(0)?, call.u32(1)?, what)
}

pub(super) fn texture_any(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let (name, level) = (call.u32(2)?, call.size(3)?);
    let kind = gl.textures.get(name).map(|texture| texture.kind);
    if matches!(kind, Some(Kind::Cube | Kind::D3)) {
        return Err(Fault::Unsupported("frame buffer objects with all layers of a texture".into()));
    }
    let what = match kind {
        Some(_) => Attached::Texture(name, 0, level),
        None if name == 0 => Attached::Nothing,
        None => return Err(INVALID_VALUE),
    };
    attach(gl, call.u32(0)?, call.u32(1)?, what)
}

pub(super) fn renderbuffer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let name = call.u32(3)?;
    if call.u32(2)? != e::RENDERBUFFER {
        return Err(INVALID_ENUM);
    }
    let what = if name == 0 { Attached::Nothing } else { Attached::Renderbuffer(name) };
    attach(gl, call.u32(0)?, call.u32(1)?, what)
}

pub(super) fn bind_renderbuffer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    if call.u32(0)? != e::RENDERBUFFER {
        return Err(INVALID_ENUM);
    }
    gl.renderbuffer = call.u32(1)?;
    if gl.renderbuffer != 0 {
        gl.renderbuffers.get_or_insert_with(gl.renderbuffer, Default::default);
    }
    Ok(())
}

pub(super) fn delete_renderbuffers(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    gl.flush()?;
    for &name in call.numbers(1)?.iter() {
        if let Some(mut buffer) = gl.renderbuffers.remove(name as u32) {
            gl.contexts.sharing().for_each(|context| context.lose_renderbuffer(name as u32));
            gl.part_from(|object| object.detach_renderbuffer(name as u32), |object| object.lose_renderbuffer(name as u32));
            buffer.free(&mut gl.card);
        }
    }
    Ok(())
}

fn storage(gl: &mut Gl, internal: u32, size: [u32; 2]) -> Outcome {
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
    let name = gl.renderbuffer;
    let old = gl.renderbuffers.get_mut(name).ok_or(INVALID_OPERATION)?.image.take();
    if let Some((surface, ..)) = old {
        gl.card.destroy_surface(surface);
    }
    if !size.contains(&0) {
        let surface = gl.card.create_surface("renderbuffer", size, format);
        let image = (Surface { narrow: base.narrow(), ..surface }, size, base);
        gl.renderbuffers.insert(name, Renderbuffer { image: Some(image) });
    }
    Ok(())
}

pub(super) fn renderbuffer_storage(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    if call.u32(0)? != e::RENDERBUFFER {
        return Err(INVALID_ENUM);
    }
    storage(gl, call.u32(1)?, [call.size(2)?, call.size(3)?])
}

pub(super) fn renderbuffer_storage_multisample(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    if call.size(1)? > 1 {
        return Err(Fault::Unsupported("render buffers of several samples".into()));
    }
    storage(gl, call.u32(2)?, [call.size(3)?, call.size(4)?])
}

/// Sets the single colour buffer that is drawn to.
fn set_draw(gl: &mut Gl, buffer: u32) -> Outcome {
    let color = buffer.wrapping_sub(e::COLOR_ATTACHMENT0) < COLORS as u32;
    if gl.draw_framebuffer != 0 {
        if buffer != e::NONE && !color {
            return Err(INVALID_OPERATION);
        }
        let object = gl.framebuffers.get_mut(gl.draw_framebuffer).ok_or(INVALID_OPERATION)?;
        object.draw = alone(buffer);
        return Ok(());
    }
    match buffer {
        e::BACK | e::BACK_LEFT | e::FRONT_AND_BACK | e::NONE | e::FRONT | e::FRONT_LEFT | e::LEFT => {
            gl.state.draw_buffer = buffer;
            Ok(())
        }
        _ if color || NO_BUFFERS.contains(&buffer) => Err(INVALID_OPERATION),
        _ => Err(INVALID_ENUM),
    }
}

pub(super) fn draw_buffer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    set_draw(gl, call.u32(0)?)
}

pub(super) fn draw_buffers(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    // Of an empty list there may be no pointer: then nothing is drawn to.
    let count = call.size(0)? as usize;
    let buffers = if count == 0 { Default::default() } else { call.numbers(1)? };
    let buffers = &buffers[..count.min(buffers.len())];
    if gl.draw_framebuffer != 0 {
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
        gl.framebuffers.get_mut(gl.draw_framebuffer).ok_or(INVALID_OPERATION)?.draw = draw;
        return Ok(());
    }
    match buffers.iter().filter(|&&buffer| buffer != 0.0).count() {
        0 => set_draw(gl, e::NONE),
        1 if buffers[0] != 0.0 => set_draw(gl, buffers[0] as u32),
        _ => Err(Fault::Unsupported("drawing to several colour buffers".into())),
    }
}

pub(super) fn read_buffer(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let buffer = call.u32(0)?;
    let color = buffer.wrapping_sub(e::COLOR_ATTACHMENT0) < COLORS as u32;
    let window = [e::BACK, e::BACK_LEFT, e::FRONT, e::FRONT_LEFT, e::LEFT, e::FRONT_AND_BACK].contains(&buffer);
    if !color && !window && buffer != e::NONE && !NO_BUFFERS.contains(&buffer) {
        return Err(INVALID_ENUM);
    }
    if buffer != e::NONE && if gl.read_framebuffer == 0 { !window } else { !color } {
        return Err(INVALID_OPERATION);
    }
    if let Some(object) = gl.framebuffers.get_mut(gl.read_framebuffer).filter(|_| gl.read_framebuffer != 0) {
        object.read = buffer;
    } else {
        gl.read_buffer = buffer;
    }
    Ok(())
}

pub(super) fn generate_mipmap(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    let k = TARGETS.iter().position(|&target| Ok(target) == call.u32(0)).ok_or(INVALID_ENUM)?;
    gl.generate_levels(k, 0..if kind_of(k) == Kind::Cube { 6 } else { 1 })
}

impl Gl {
    /// Generates the mipmap levels of these faces from the base level. The texture is the one bound to this target of the active unit.
    pub(super) fn generate_levels(&mut self, target: usize, faces: std::ops::Range<u32>) -> Outcome {
        let unit = self.state.active;
        self.texture(unit, target);
        let name = self.state.units[unit].bound[target];
        let texture = if name == 0 { self.default_textures.get_mut(target as u32) } else { self.textures.get_mut(name) };
        let texture = texture.ok_or(INVALID_OPERATION)?;
        if texture.kind == Kind::D3 {
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
                let key = CopyKey { from: From::Filtered, result, format, meet: Meet::Replace, mask: 15 };
                let scale = [from[0] as f32 / width as f32, from[1] as f32 / height as f32];
                let map = Map { to: [0.0; 2], from: [0.0; 2], scale };
                let area = Rect { x: 0, y: 0, width, height };
                self.card.copy_pixels(key, image.format, source, to, map, 0.0, area);
            }
        }
        Ok(())
    }
}

pub(super) fn blit(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
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
    if gl.draw_framebuffer == 0 {
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
            (true, _) => From::Depth,
            (_, e::LINEAR) if scale.map(f32::abs) != [1.0; 2] => From::Filtered,
            _ => From::Color,
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
        let key = CopyKey { from, result, format: to.format.name(), meet: Meet::Replace, mask: 15 };
        gl.card.copy_pixels(key, to.format, source, to, map, 0.0, Rect { x, y, width, height });
    }
    Ok(())
}
