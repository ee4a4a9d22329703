//! Windows, and the ends of frames.

use trace::Trace;

use crate::gl::call::{Fault, GlResult};
use crate::gl::machine::Gl;

/// Maximum width and height of a window.
pub const WINDOW_MAX: u32 = 16_384;

impl Gl {
    /// Makes the window that is drawn to at least this large. If a recording does not state its size, its first viewport gives it.
    pub fn window(&mut self, size: [u32; 2], fixed: bool) -> GlResult {
        check_size(size)?;
        let old = self.card.size();
        let Some(window) = self.card.windows.drawn() else { return Ok(()) };
        let stated = window.fixed;
        window.fixed |= fixed;
        let new = if fixed { size } else { [old[0].max(size[0]), old[1].max(size[1])] };
        if (fixed || !stated) && new != old && !new.contains(&0) {
            self.flush()?;
            self.card.resize(new);
        }
        self.fit();
        Ok(())
    }

    /// Swaps the buffers of a window.
    pub fn swap(&mut self, window: u32) -> GlResult {
        self.flush()?;
        if self.card.is_shown(window) && self.card.frames + 1 == self.card.first_frame {
            self.card.end_pass();
            self.upload_changes();
        }
        self.card.present(window);
        Ok(())
    }

    /// Shows what has been drawn since the last frame as a frame, if that is wanted.
    pub fn show_rest(&mut self) -> GlResult {
        self.flush()?;
        if self.card.is_wanted() {
            self.card.end_pass();
            if let Some(window) = self.card.windows.to_show().filter(|_| self.card.drawn) {
                return self.swap(window);
            }
        }
        Ok(())
    }

    /// The finished trace.
    pub fn finish(mut self) -> GlResult<Trace> {
        self.flush()?;
        self.card.end_pass();
        Ok(self.card.recorder.finish())
    }
}

/// Checks the size of a window.
pub fn check_size(size: [u32; 2]) -> GlResult {
    if size.into_iter().any(|edge| edge > WINDOW_MAX) {
        return Err(Fault::Limit(format!("a window of {} x {} pixels, at most {WINDOW_MAX} each", size[0], size[1])));
    }
    Ok(())
}

impl Gl {
    /// Gives a context that is current with a window for the first time a viewport and a scissor of the window's size.
    pub fn fit(&mut self) {
        let [width, height] = self.card.size();
        if !self.context.has_size && self.contexts.now.context.is_some() && width > 0 {
            let whole = [0, 0, width as i32, height as i32];
            (self.state.transform.viewport, self.state.scissor, self.context.has_size) = (whole, whole, true);
        }
    }
}
