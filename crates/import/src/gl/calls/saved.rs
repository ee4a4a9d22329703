//! `glPushAttrib` and `glPopAttrib`.

use gl_shader::consts as e;

use crate::gl::call::{Call, Fault, GlResult, Shape};
use crate::gl::machine::Gl;
use crate::gl::state::saved::Saved;
use crate::gl::state::texture::Texture;
use crate::gl::state::texturing::kind_of;

/// Maximum depth of the stack.
const DEPTH: usize = 16;

pub fn push(gl: &mut Gl, call: &Call, _: Shape) -> GlResult {
    if gl.context.saved.len() >= DEPTH {
        return Err(Fault::Error("GL_STACK_OVERFLOW"));
    }
    gl.settle_color_material()?;
    let mask = call.u32(0)?;
    let mut textures = Vec::new();
    if mask & e::TEXTURE_BIT != 0 {
        let mut bound: Vec<(usize, u32)> =
            gl.state.texturing.units.iter().flat_map(|unit| unit.bound.into_iter().enumerate()).collect();
        bound.sort_unstable();
        bound.dedup();
        for (target, name) in bound {
            if name == 0 {
                // It always exists, and is made when it is first needed.
                gl.objects.default_textures.get_or_insert_with(target as u32, || Texture::new(kind_of(target)));
            }
            if let Some(texture) = gl.known_texture(target, name) {
                let mut parameters = Texture::new(texture.kind);
                parameters.take_parameters(texture);
                textures.push((target, name, parameters));
            }
        }
    }
    let state = Box::new(gl.state.clone());
    gl.context.saved.push(Saved {
        mask,
        state,
        textures,
        read_buffer: gl.context.framebuffers.window_read,
        clear_accum: gl.context.framebuffers.clear_accum,
    });
    Ok(())
}

pub fn pop(gl: &mut Gl, _: &Call, _: Shape) -> GlResult {
    let saved = gl.context.saved.pop().ok_or(Fault::Error("GL_STACK_UNDERFLOW"))?;
    gl.settle_color_material()?;
    gl.state.restore(saved.mask, *saved.state);
    if saved.mask & e::LIGHTING_BIT != 0 {
        gl.context.material_tracking.note_restored();
    }
    if saved.mask & e::PIXEL_MODE_BIT != 0 {
        gl.context.framebuffers.window_read = saved.read_buffer;
    }
    if saved.mask & e::ACCUM_BUFFER_BIT != 0 {
        gl.context.framebuffers.clear_accum = saved.clear_accum;
    }
    for (target, name, parameters) in saved.textures {
        // A texture that has been deleted stays so.
        if let Some(texture) = gl.known_texture(target, name) {
            texture.take_parameters(&parameters);
        }
    }
    Ok(())
}
