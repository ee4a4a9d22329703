//! What `glPushAttrib` saves.

use crate::gl::state::server::State;
use crate::gl::state::texture::Texture;

/// A saved server state.
pub struct Saved {
    pub mask: u32,
    pub state: Box<State>,
    /// The parameters of the textures that are bound, as textures without images: target, name, parameters.
    pub textures: Vec<(usize, u32, Texture)>,
    pub read_buffer: u32,
    pub clear_accum: [f32; 4],
}
