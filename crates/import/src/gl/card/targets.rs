//! Framebuffers of windows: their images on the card, and swaps of their buffers.

use gfx::format::Format;
use gl_shader::COLORS_MAX;
use trace::command::*;

use crate::gl::card::device::Card;
use crate::gl::card::pass::{Buffer, Surface, Target};
use crate::gl::card::windows::Images;
use crate::gl::texels::image::DEPTH;

impl Card {
    /// The size of the window that is drawn to; zeros if there is no window, or if its size is not known.
    pub fn size(&self) -> [u32; 2] {
        self.windows.get(self.windows.draw).map_or([0; 2], |window| window.facts.size)
    }

    /// Gives the window that is drawn to its size, or changes it. It starts black.
    pub fn resize(&mut self, size: [u32; 2]) {
        let Some(number) = self.windows.draw.filter(|_| self.size() != size) else { return };
        self.end_pass();
        self.free_window(number);
        let (back, depth) = (self.create_color_buffer("window", size), self.create_surface("depth", size, DEPTH));
        let Some(window) = self.windows.drawn() else { return };
        window.facts.size = size;
        window.images = Some(Images { back, depth, front: None, encoded: None, accumulation: None });
        let early = std::mem::take(&mut window.early);
        let target = self.window_target(Buffer::Back);
        self.aim(target);
        self.pass.color = Some([0.0, 0.0, 0.0, 1.0]);
        (self.pass.depth, self.pass.stencil) = (Some(1.0), Some(0));
        self.clear(early.0, early.1, early.2);
    }

    /// Gives a pixel buffer its size, which stays.
    pub fn open_off_screen(&mut self, number: u32, size: [u32; 2]) {
        let drawn = self.windows.draw.replace(number);
        if let Some(window) = self.windows.drawn() {
            (window.facts.off_screen, window.fixed) = (true, true);
        }
        if !size.contains(&0) {
            self.resize(size);
        }
        self.windows.draw = drawn;
    }

    /// Frees the images of a window.
    pub fn free_window(&mut self, number: u32) {
        let Some(old) = self.windows.get_mut(Some(number)).and_then(|window| window.images.take()) else { return };
        if let Some(encoded) = old.encoded {
            self.recorder.push(Command::Destroy(Object::View(encoded.view)));
        }
        for surface in [Some(old.back), Some(old.depth), old.front, old.accumulation].into_iter().flatten() {
            self.destroy_surface(surface);
        }
    }

    /// The window that is drawn to as a target.
    pub fn window_target(&mut self, buffer: Buffer) -> Option<Target> {
        self.target_in(self.windows.draw?, buffer)
    }

    /// The window that is read, as a target.
    pub fn read_target(&mut self, buffer: Buffer) -> Option<Target> {
        self.target_in(self.windows.read?, buffer)
    }

    /// A window as a target. The front buffer starts as a copy of the back buffer.
    fn target_in(&mut self, number: u32, buffer: Buffer) -> Option<Target> {
        let window = self.windows.get(Some(number))?;
        let (size, images) = (window.facts.size, window.images.as_ref()?);
        let (back, depth) = (images.back, images.depth);
        let color = match (buffer, images.front) {
            (Buffer::Back, _) => back,
            (Buffer::Front, Some(front)) => front,
            (Buffer::Front, None) => {
                self.end_pass();
                let front = self.create_color_buffer("front", size);
                self.copy_surface(back, front, size);
                self.windows.get_mut(Some(number))?.images.as_mut()?.front = Some(front);
                front
            }
        };
        let (color, depth) = (Some(color), Some(depth));
        let (more, upward, alpha) = ([None; COLORS_MAX - 1], self.upward, self.window_alpha);
        let window = Some(number);
        Some(Target { size, color, more, depth, has_depth: true, has_stencil: true, upward, alpha, window })
    }

    /// The back buffer as a target that encodes linear colours as sRGB.
    pub fn encoded_target(&mut self) -> Option<Target> {
        let target = self.window_target(Buffer::Back)?;
        let back = target.color?;
        let images = self.windows.drawn()?.images.as_mut()?;
        let encoded = match images.encoded {
            Some(encoded) => encoded,
            None => {
                let format = Format::Rgba8UnormSrgb;
                let desc = ViewDesc { format: Some(format), ..ViewDesc::default() };
                let view = self.recorder.create_view_of(back.texture, desc);
                *images.encoded.insert(Surface { view, format, ..back })
            }
        };
        Some(Target { color: Some(encoded), ..target })
    }

    /// The accumulation buffer of the window that is drawn to. It starts as zeros.
    pub fn accumulation(&mut self) -> Option<Surface> {
        let size = self.size();
        if let Some(known) = self.windows.drawn()?.images.as_ref()?.accumulation {
            return Some(known);
        }
        let made = self.create_surface("accumulation", size, Format::Rgba16Float);
        self.windows.drawn()?.images.as_mut()?.accumulation = Some(made);
        Some(made)
    }

    /// Whether swapping the buffers of this window ends a frame.
    pub fn is_shown(&self, number: u32) -> bool {
        self.windows.selected.is_none_or(|selected| selected == number)
    }

    /// Swaps the buffers of a window. That ends a frame if the window is shown. The back buffer keeps its contents.
    pub fn present(&mut self, number: u32) {
        let shown = self.is_shown(number);
        self.close();
        if shown && self.frames + 1 >= self.first_frame {
            // The next frame is wanted, and begins with the present contents.
            self.end_pass();
        }
        let Some(window) = self.windows.get_mut(Some(number)) else { return };
        let Some(images) = &window.images else { return };
        let (size, back, front) = (window.facts.size, images.back, images.front);
        (window.facts.swaps, window.front_lacks) = (window.facts.swaps + 1, false);
        if shown {
            self.recorder.present(back.texture);
            self.frames += 1;
            self.drawn = false;
        }
        if let Some(front) = front {
            self.end_pass();
            self.copy_surface(back, front, size);
        }
    }
}
