//! The images that are drawn to and read.

use gl_shader::key::{Base, TextureShape};
use gl_shader::{COLORS_MAX, consts as e};

use crate::gl::call::{Fault, GlResult, INVALID_OPERATION};
use crate::gl::card::pass::{Buffer, Surface, Target};
use crate::gl::machine::Gl;
use crate::gl::state::bindings::missing;
use crate::gl::state::framebuffers::{Attachment, EDGE_MAX, Framebuffer};
use crate::gl::state::texture::FromTarget;

/// The error of an incomplete framebuffer object.
const INCOMPLETE: Fault = Fault::Error("GL_INVALID_FRAMEBUFFER_OPERATION");

impl Gl {
    /// Has frame buffer objects part from an object that is deleted: those that are bound `detach` it, and the others `lose` it.
    pub fn part_from(&mut self, detach: impl Fn(&mut Framebuffer), lose: impl Fn(&mut Framebuffer)) {
        for name in self.context.framebuffers.objects.keys() {
            let is_bound = [self.context.framebuffers.draw, self.context.framebuffers.read].contains(&name);
            let Some(object) = self.context.framebuffers.objects.get_mut(name) else { continue };
            if is_bound { detach(object) } else { lose(object) }
        }
    }

    /// Has frame buffer objects part from a texture that is deleted.
    pub fn part_from_texture(&mut self, name: u32) {
        self.part_from(|object| object.detach_texture(name), |object| object.lose_texture(name));
    }
}

/// An attached image: its surface, its size, its base format.
type Image = (Surface, [u32; 2], Base);

impl Gl {
    fn image(&mut self, attached: Attachment) -> GlResult<Option<Image>> {
        match attached {
            Attachment::Nothing => Ok(None),
            Attachment::Renderbuffer(name) => {
                let image = self.objects.renderbuffers.get(name).and_then(|buffer| buffer.image);
                image.map(Some).ok_or_else(|| missing(name, INCOMPLETE))
            }
            Attachment::Texture(name, layer, level) => {
                let texture = self.objects.textures.get_mut(name).ok_or_else(|| missing(name, INCOMPLETE))?;
                let face = if texture.kind == TextureShape::Cube { layer } else { 0 };
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
    fn color_image(&mut self, object: &Framebuffer, buffer: u32) -> GlResult<Option<Image>> {
        if buffer == e::NONE {
            return Ok(None);
        }
        let attached = object.color(buffer);
        let image = self.image(attached)?;
        if image.is_some_and(|(surface, ..)| surface.format.is_compressed()) {
            return Err(INCOMPLETE);
        }
        if image.is_some_and(|(_, _, base)| !matches!(base.plain(), Base::Rgb | Base::Rgba | Base::Red | Base::Rg)) {
            return Err(Fault::Unsupported("frame buffer objects with luminance, alpha, intensity or sRGB".into()));
        }
        Ok(image)
    }

    /// The images of a frame buffer object.
    pub fn target_of(&mut self, name: u32) -> GlResult<Target> {
        let object = self.context.framebuffers.objects.get(name).cloned().ok_or(INCOMPLETE)?;
        let mut images = [None; COLORS_MAX];
        for (image, &buffer) in images.iter_mut().zip(object.draw_buffers()) {
            *image = self.color_image(&object, buffer)?;
        }
        let count = images.iter().take_while(|image| image.is_some()).count();
        if images[count..].iter().any(Option::is_some) {
            return Err(Fault::Unsupported("drawing to several colour buffers with one between them left out".into()));
        }
        let color = images[0];
        let (depth, stencil) = (self.image(object.depth())?, self.image(object.stencil())?);
        if let Attachment::Texture(name, ..) = object.stencil()
            && self.objects.textures.get(name).is_some_and(|texture| texture.given_stencil)
        {
            return Err(Fault::Unsupported("drawing with stencil values that a texture was given".into()));
        }
        let attached = depth.or(stencil);
        if depth.is_some() && stencil.is_some() && object.depth() != object.stencil() {
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
    pub fn aim(&mut self) -> GlResult<Target> {
        if self.context.framebuffers.draw == 0 {
            self.settle_window()?;
        }
        let target = match (self.context.framebuffers.draw, self.state.color.draw_buffer) {
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
    fn settle_window(&mut self) -> GlResult {
        // A context without a drawable has no window.
        self.card.windows.draw.ok_or(INCOMPLETE)?;
        let [x, y, width, height] = self.state.transform.viewport;
        let size = [x.saturating_add(width), y.saturating_add(height)].map(|edge| edge.clamp(0, EDGE_MAX as i32) as u32);
        if self.card.size() == [0; 2] && !size.contains(&0) {
            self.card.resize(size);
        }
        Ok(())
    }

    /// The image that copies and reads take: colours or depths. No primitives wait.
    pub fn read_source(&mut self, depth: bool) -> GlResult<FromTarget> {
        let none = || Fault::Unsupported("reading before the size of the window is known".into());
        if self.context.framebuffers.read == 0 {
            let window = self.card.windows.reading().ok_or(INCOMPLETE)?;
            let front = matches!(self.context.framebuffers.window_read, e::FRONT | e::FRONT_LEFT | e::LEFT | e::FRONT_AND_BACK);
            if front && window.front_lacks && !depth {
                return Err(Fault::Unsupported("reading the front buffer after drawing to front and back".into()));
            }
            let target = self.card.read_target(if front { Buffer::Front } else { Buffer::Back }).ok_or_else(none)?;
            let surface = if depth { target.depth } else { target.color };
            return Ok((surface.ok_or(INVALID_OPERATION)?, target.size, target.upward));
        }
        let object = self.context.framebuffers.objects.get(self.context.framebuffers.read).cloned().ok_or(INCOMPLETE)?;
        let image = if depth { self.image(object.depth())? } else { self.color_image(&object, object.read_buffer())? };
        let (surface, size, _) = image.ok_or(INVALID_OPERATION)?;
        Ok((surface, size, true))
    }
}
