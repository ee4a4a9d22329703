//! A frame on its way to the display.

use std::sync::Arc;

use num::Cycle;
use work::{Sprite, Surface};

/// A frame that is handed to the display.
#[derive(Clone, Debug)]
pub struct Presented {
    /// Its number in the trace.
    pub frame: u32,
    /// Its surface.
    pub surface: Surface,
    /// Where the display reads it.
    pub address: u64,
    /// Its bytes, as those of [`Contents`](work::Contents).
    pub bytes: Arc<[u8]>,
    /// When the command processor handed it over.
    pub at: Cycle,
    /// The sprites that are laid over its lines.
    pub sprites: Arc<[Sprite]>,
}
