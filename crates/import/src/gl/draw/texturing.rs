//! The textures that are bound.

use crate::gl::machine::Gl;
use crate::gl::state::texture::Texture;
use crate::gl::state::texturing::kind_of;

impl Gl {
    /// The texture that is bound to a target of a unit.
    pub fn texture(&mut self, unit: usize, target: usize) -> &mut Texture {
        let name = self.state.texturing.units[unit].bound[target];
        let kind = kind_of(target);
        let (table, key) =
            if name == 0 { (&mut self.objects.default_textures, target as u32) } else { (&mut self.objects.textures, name) };
        table.get_or_insert_with(key, || Texture::new(kind))
    }
}

impl Gl {
    /// The texture of this name, or the target's texture of name 0, if it exists.
    pub fn known_texture(&mut self, target: usize, name: u32) -> Option<&mut Texture> {
        if name == 0 { self.objects.default_textures.get_mut(target as u32) } else { self.objects.textures.get_mut(name) }
    }
}
