//! `glPushAttrib` and `glPopAttrib`.

use super::call::{Call, Fault, Outcome, Shape};
use super::consts as e;
use super::draw::kind_of;
use super::machine::Gl;
use super::state::State;
use super::texture::Texture;

/// Maximum depth of the stack.
const DEPTH: usize = 16;

/// A saved server state.
pub struct Saved {
    mask: u32,
    state: Box<State>,
    /// The parameters of the textures that are bound, as textures without images: target, name, parameters.
    textures: Vec<(usize, u32, Texture)>,
    read_buffer: u32,
    clear_accum: [f32; 4],
}

pub(super) fn push(gl: &mut Gl, call: &Call, _: Shape) -> Outcome {
    if gl.saved.len() >= DEPTH {
        return Err(Fault::Error("GL_STACK_OVERFLOW"));
    }
    gl.settle_color_material()?;
    let mask = call.u32(0)?;
    let mut textures = Vec::new();
    if mask & e::TEXTURE_BIT != 0 {
        let mut bound: Vec<(usize, u32)> = gl.state.units.iter().flat_map(|unit| unit.bound.into_iter().enumerate()).collect();
        bound.sort_unstable();
        bound.dedup();
        for (target, name) in bound {
            if name == 0 {
                // It always exists, and is made when it is first needed.
                gl.default_textures.get_or_insert_with(target as u32, || Texture::new(kind_of(target)));
            }
            if let Some(texture) = gl.known_texture(target, name) {
                let mut parameters = Texture::new(texture.kind);
                parameters.take_parameters(texture);
                textures.push((target, name, parameters));
            }
        }
    }
    let state = Box::new(gl.state.clone());
    gl.saved.push(Saved { mask, state, textures, read_buffer: gl.read_buffer, clear_accum: gl.clear_accum });
    Ok(())
}

pub(super) fn pop(gl: &mut Gl, _: &Call, _: Shape) -> Outcome {
    let saved = gl.saved.pop().ok_or(Fault::Error("GL_STACK_UNDERFLOW"))?;
    gl.settle_color_material()?;
    gl.state.restore(saved.mask, *saved.state);
    if saved.mask & e::LIGHTING_BIT != 0 {
        gl.given.restore();
    }
    if saved.mask & e::PIXEL_MODE_BIT != 0 {
        gl.read_buffer = saved.read_buffer;
    }
    if saved.mask & e::ACCUM_BUFFER_BIT != 0 {
        gl.clear_accum = saved.clear_accum;
    }
    for (target, name, parameters) in saved.textures {
        // A texture that has been deleted stays so.
        if let Some(texture) = gl.known_texture(target, name) {
            texture.take_parameters(&parameters);
        }
    }
    Ok(())
}

impl Gl {
    /// The texture of this name, or the target's texture of name 0, if it exists.
    fn known_texture(&mut self, target: usize, name: u32) -> Option<&mut Texture> {
        if name == 0 { self.default_textures.get_mut(target as u32) } else { self.textures.get_mut(name) }
    }
}
