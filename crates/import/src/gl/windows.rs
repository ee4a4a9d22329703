//! Windows and other drawables: each has a framebuffer of its own, which the card shows when its buffers are swapped.

use gfx::format::Format;
use num::NumberMap;
use trace::command::*;

use super::call::{Fault, Outcome};
use super::card::{Buffer, COLORS_MAX, Card, DEPTH, Surface, Target};

/// Maximum number of drawables of a recording.
const WINDOWS_MAX: usize = 1 << 12;

/// Maximum number of drawables that a message names.
const NAMED_MAX: usize = 64;

/// The images of a framebuffer.
struct Images {
    back: Surface,
    depth: Surface,
    /// The front buffer, if anything has been drawn to it or read from it.
    front: Option<Surface>,
    /// The back buffer with sRGB encoding, if anything was drawn with it.
    encoded: Option<Surface>,
    /// The accumulation buffer, if anything has been accumulated.
    accumulation: Option<Surface>,
}

/// A drawable.
#[derive(Default)]
pub struct Window {
    /// What is known of it.
    pub facts: WindowFacts,
    /// None before its size is known, and after it has been destroyed.
    images: Option<Images>,
    /// Whether the size was stated, so that viewports do not change it.
    pub fixed: bool,
    /// What it was cleared to before its size was known: colour, depth, stencil value.
    pub early: (Option<[f32; 4]>, Option<f32>, Option<u32>),
    /// Whether the front buffer lacks what was drawn to both front and back.
    pub front_lacks: bool,
    /// Whether the program has destroyed it.
    pub doomed: bool,
}

/// Facts about a window or another drawable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WindowFacts {
    /// Width and height in pixels; zeros if nothing was drawn to it.
    pub size: [u32; 2],
    /// How often its buffers were swapped.
    pub swaps: u64,
    /// Whether it is a pixel buffer, which is never on a screen.
    pub off_screen: bool,
}

/// All drawables of a recording, by number: in the order in which the recording first uses them.
pub struct Windows {
    list: Vec<Window>,
    /// Numbers by the values that the recording calls drawables by.
    handles: NumberMap<u64, u32>,
    /// Windows of X by the GLX windows that were made for them.
    aliases: NumberMap<u64, u64>,
    /// Sizes of pixel buffers, by their handles.
    sizes: NumberMap<u64, [u32; 2]>,
    /// The drawable that is drawn to.
    pub draw: Option<u32>,
    /// The drawable that is read.
    pub read: Option<u32>,
    /// The drawable that was swapped last, if no call has made a context current.
    pub last: Option<u64>,
    /// The only window whose swaps end frames; none: all do.
    pub selected: Option<u32>,
}

impl Default for Windows {
    /// One window without a name: calls before the first one that makes a context current draw to it.
    fn default() -> Self {
        Windows {
            list: vec![Window::default()],
            handles: NumberMap::new(),
            aliases: NumberMap::new(),
            sizes: NumberMap::new(),
            draw: Some(0),
            read: Some(0),
            last: None,
            selected: None,
        }
    }
}

impl Windows {
    fn get(&self, number: Option<u32>) -> Option<&Window> {
        self.list.get(number? as usize)
    }

    fn get_mut(&mut self, number: Option<u32>) -> Option<&mut Window> {
        self.list.get_mut(number? as usize)
    }

    /// The window that is drawn to.
    pub fn drawn(&mut self) -> Option<&mut Window> {
        self.get_mut(self.draw)
    }

    /// A drawable by its number.
    pub fn at(&mut self, number: u32) -> Option<&mut Window> {
        self.get_mut(Some(number))
    }

    /// The window that is read.
    pub fn reading(&self) -> Option<&Window> {
        self.get(self.read)
    }

    /// The back buffer of a window.
    pub fn back(&self, number: u32) -> Option<Surface> {
        self.get(Some(number))?.images.as_ref().map(|images| images.back)
    }

    fn canonical(&self, handle: u64) -> u64 {
        self.aliases.get(handle).copied().unwrap_or(handle)
    }

    /// The number of a drawable that the recording has used.
    pub fn known(&self, handle: u64) -> Option<u32> {
        self.handles.get(self.canonical(handle)).copied()
    }

    /// The number of a drawable.
    ///
    /// # Errors
    /// If there are too many.
    pub fn number(&mut self, handle: u64) -> Outcome<u32> {
        if let Some(known) = self.known(handle) {
            return Ok(known);
        }
        let handle = self.canonical(handle);
        // The window without a name is the first that gets one, unless it has been shown.
        let unnamed = self.handles.is_empty() && self.list.len() == 1 && self.list[0].facts.swaps == 0;
        if !unnamed {
            if self.list.len() >= WINDOWS_MAX {
                return Err(Fault::Limit(format!("more than {WINDOWS_MAX} windows")));
            }
            self.list.push(Window::default());
        }
        let number = self.list.len() as u32 - 1;
        self.handles.insert(handle, number);
        Ok(number)
    }

    /// Gives a drawable another handle.
    pub fn rename(&mut self, handle: u64, number: u32) {
        self.handles.insert(handle, number);
    }

    /// Notes that a GLX window belongs to a window of X: both are the same drawable.
    pub fn alias(&mut self, handle: u64, of: u64) {
        self.aliases.insert(handle, of);
    }

    /// Notes the size of a pixel buffer.
    pub fn off_screen(&mut self, handle: u64, size: [u32; 2]) {
        self.sizes.insert(handle, size);
    }

    /// The size of a pixel buffer that nothing was drawn to yet.
    pub fn take_size(&mut self, handle: u64) -> Option<[u32; 2]> {
        self.sizes.remove(handle)
    }

    /// Forgets the handle of a drawable that the program destroys: its number, if the recording has used it.
    pub fn forget(&mut self, handle: u64) -> Option<u32> {
        self.sizes.remove(handle);
        let canonical = self.canonical(handle);
        self.aliases.remove(handle);
        self.handles.remove(canonical)
    }

    /// The window whose contents are shown at the end of a recording.
    pub fn to_show(&self) -> Option<u32> {
        self.selected.or(self.draw)
    }

    /// Facts about all drawables that were used.
    pub fn facts(&self) -> Vec<WindowFacts> {
        self.list.iter().map(|window| window.facts).collect()
    }

    /// What is wrong with the choice of a window; none if it has been shown.
    pub fn wrong_choice(&self) -> Option<String> {
        let chosen = self.selected?;
        let reason = match self.get(Some(chosen)) {
            Some(window) if window.facts.swaps > 0 => return None,
            Some(_) => "is never shown",
            None => "is not there",
        };
        let named = self.list.iter().enumerate().take(NAMED_MAX);
        let mut all: Vec<_> = named.map(|(number, window)| format!("window {number} ({})", window.facts)).collect();
        if self.list.len() > NAMED_MAX {
            all.push(format!("and {} others", self.list.len() - NAMED_MAX));
        }
        Some(format!("window {chosen} {reason}; the recording has {}", all.join(", ")))
    }
}

impl std::fmt::Display for WindowFacts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.size {
            [0, 0] => f.write_str("never drawn to")?,
            [width, height] => write!(f, "{width} x {height}")?,
        }
        if self.off_screen {
            f.write_str(", off screen")?;
        }
        match self.swaps {
            0 => f.write_str(", no swap"),
            1 => f.write_str(", 1 swap"),
            swaps => write!(f, ", {swaps} swaps"),
        }
    }
}

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
