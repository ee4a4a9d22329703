//! Frame buffer objects and render buffers.

use gl_shader::key::Base;
use gl_shader::{COLORS_MAX, consts as e};
use num::NumberMap;

use crate::gl::call::{GlResult, INVALID_ENUM};
use crate::gl::card::device::Card;
use crate::gl::card::pass::Surface;
use crate::gl::state::bindings::lose;

/// Number of colour attachments.
pub const COLORS: usize = 16;

/// What is attached to a frame buffer object.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Attachment {
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
    colors: [Attachment; COLORS],
    depth: Attachment,
    stencil: Attachment,
    draw: [u32; COLORS_MAX],
    read: u32,
}

/// Maximum width and height of renderbuffers.
pub const EDGE_MAX: u32 = 16_384;

/// A list of draw buffers with this one first and `NONE` for the others.
fn alone(buffer: u32) -> [u32; COLORS_MAX] {
    std::array::from_fn(|k| if k == 0 { buffer } else { e::NONE })
}

impl Framebuffer {
    fn attached(&mut self) -> impl Iterator<Item = &mut Attachment> {
        self.colors.iter_mut().chain([&mut self.depth, &mut self.stencil])
    }

    /// Detaches a texture.
    pub fn detach_texture(&mut self, name: u32) {
        let attached = self.attached().filter(|at| matches!(at, Attachment::Texture(own, ..) if *own == name));
        attached.for_each(|at| *at = Attachment::Nothing);
    }

    /// Detaches a render buffer.
    pub fn detach_renderbuffer(&mut self, name: u32) {
        let attached = self.attached().filter(|at| matches!(at, Attachment::Renderbuffer(own) if *own == name));
        attached.for_each(|at| *at = Attachment::Nothing);
    }

    /// Attaches an image, or nothing, to a point.
    pub fn attach(&mut self, point: u32, what: Attachment) -> GlResult {
        match point {
            e::DEPTH_ATTACHMENT => self.depth = what,
            e::STENCIL_ATTACHMENT => self.stencil = what,
            e::DEPTH_STENCIL_ATTACHMENT => (self.depth, self.stencil) = (what, what),
            _ => {
                let index = point.wrapping_sub(e::COLOR_ATTACHMENT0) as usize;
                *self.colors.get_mut(index).ok_or(INVALID_ENUM)? = what;
            }
        }
        Ok(())
    }

    /// The image that is attached as a colour buffer.
    pub fn color(&self, buffer: u32) -> Attachment {
        self.colors.get(buffer.wrapping_sub(e::COLOR_ATTACHMENT0) as usize).copied().unwrap_or_default()
    }

    /// The depth image.
    pub fn depth(&self) -> Attachment {
        self.depth
    }

    /// The stencil image.
    pub fn stencil(&self) -> Attachment {
        self.stencil
    }

    /// The colour buffers that are drawn to.
    pub fn draw_buffers(&self) -> &[u32; COLORS_MAX] {
        &self.draw
    }

    /// The colour buffer that is read.
    pub fn read_buffer(&self) -> u32 {
        self.read
    }

    /// Sets the colour buffers that are drawn to.
    pub fn draw_to(&mut self, buffers: [u32; COLORS_MAX]) {
        self.draw = buffers;
    }

    /// Sets the single colour buffer that is drawn to.
    pub fn draw_to_one(&mut self, buffer: u32) {
        self.draw = alone(buffer);
    }

    /// Sets the colour buffer that is read.
    pub fn read_from(&mut self, buffer: u32) {
        self.read = buffer;
    }

    /// Marks attachments of a texture that is deleted and would stay alive as long as it is attached.
    pub fn lose_texture(&mut self, name: u32) {
        let names = self.attached().filter_map(|at| if let Attachment::Texture(name, ..) = at { Some(name) } else { None });
        lose(names, name);
    }

    /// Marks attachments of a render buffer that is deleted and would stay alive as long as it is attached.
    pub fn lose_renderbuffer(&mut self, name: u32) {
        let names = self.attached().filter_map(|at| if let Attachment::Renderbuffer(name) = at { Some(name) } else { None });
        lose(names, name);
    }
}

impl Default for Framebuffer {
    fn default() -> Self {
        let (draw, read) = (alone(e::COLOR_ATTACHMENT0), e::COLOR_ATTACHMENT0);
        Framebuffer {
            colors: [Attachment::Nothing; COLORS],
            depth: Attachment::Nothing,
            stencil: Attachment::Nothing,
            draw,
            read,
        }
    }
}

/// The frame buffer objects of a context, and what is bound.
pub struct Framebuffers {
    /// The objects by name.
    pub objects: NumberMap<u32, Framebuffer>,
    /// The one that is drawn to; 0: the window.
    pub draw: u32,
    /// The one that is read; 0: the window.
    pub read: u32,
    /// The colour buffer of the window that is read.
    pub window_read: u32,
    /// The bound render buffer.
    pub renderbuffer: u32,
    /// The clear value of the accumulation buffer.
    pub clear_accum: [f32; 4],
}

impl Default for Framebuffers {
    fn default() -> Self {
        let (objects, window_read) = (NumberMap::new(), e::BACK);
        Framebuffers { objects, draw: 0, read: 0, window_read, renderbuffer: 0, clear_accum: [0.0; 4] }
    }
}

/// What becomes of primitives: `GL_RENDER`, `GL_FEEDBACK` or `GL_SELECT`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RenderMode(pub u32);

impl Default for RenderMode {
    fn default() -> Self {
        RenderMode(e::RENDER)
    }
}

impl RenderMode {
    /// Whether primitives are drawn.
    pub fn draws(self) -> bool {
        self.0 == e::RENDER
    }
}

/// A renderbuffer: its image, its size, its base format.
#[derive(Clone, Debug, Default)]
pub struct Renderbuffer {
    /// Its image, if it has storage: surface, size, base format.
    pub image: Option<(Surface, [u32; 2], Base)>,
}

impl Renderbuffer {
    /// Frees its image.
    pub fn free(&mut self, card: &mut Card) {
        if let Some((surface, ..)) = self.image.take() {
            card.destroy_surface(surface);
        }
    }
}
