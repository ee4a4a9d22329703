//! Windows and other drawables: each has a framebuffer of its own, which the card shows when its buffers are swapped.

use num::NumberMap;

use crate::gl::call::{Fault, GlResult};
use crate::gl::card::pass::Surface;
use crate::report::WindowFacts;

/// Maximum number of drawables of a recording.
const WINDOWS_MAX: usize = 1 << 12;
/// Maximum number of drawables that a message names.
const NAMED_MAX: usize = 64;

/// The images of a framebuffer.
pub struct Images {
    /// The back buffer.
    pub back: Surface,
    /// Depth and stencil.
    pub depth: Surface,
    /// The front buffer, if anything has been drawn to it or read from it.
    pub front: Option<Surface>,
    /// The back buffer with sRGB encoding, if anything was drawn with it.
    pub encoded: Option<Surface>,
    /// The accumulation buffer, if anything has been accumulated.
    pub accumulation: Option<Surface>,
}

/// A drawable.
#[derive(Default)]
pub struct Window {
    /// What is known of it.
    pub facts: WindowFacts,
    /// None before its size is known, and after it has been destroyed.
    pub images: Option<Images>,
    /// Whether the size was stated, so that viewports do not change it.
    pub fixed: bool,
    /// What it was cleared to before its size was known: colour, depth, stencil value.
    pub early: (Option<[f32; 4]>, Option<f32>, Option<u32>),
    /// Whether the front buffer lacks what was drawn to both front and back.
    pub front_lacks: bool,
    /// Whether the program has destroyed it.
    pub doomed: bool,
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
    /// A drawable, if there is one.
    pub fn get(&self, number: Option<u32>) -> Option<&Window> {
        self.list.get(number? as usize)
    }

    /// A drawable to be changed, if there is one.
    pub fn get_mut(&mut self, number: Option<u32>) -> Option<&mut Window> {
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
    pub fn number(&mut self, handle: u64) -> GlResult<u32> {
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
