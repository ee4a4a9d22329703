//! What `glPushAttrib` saves.

use crate::gl::state::server::State;
use crate::gl::state::texture::Texture;

/// A saved server state.
pub struct Saved {
    /// The attribute groups that are restored.
    pub mask: u32,
    /// The server state.
    pub state: Box<State>,
    /// The parameters of the textures that are bound, as textures without images: target, name, parameters.
    pub textures: Vec<(usize, u32, Texture)>,
    /// The colour buffer of the window that is read.
    pub read_buffer: u32,
    /// The clear value of the accumulation buffer.
    pub clear_accum: [f32; 4],
}
