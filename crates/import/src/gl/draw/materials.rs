//! When materials and colour material take effect.

use gl_shader::consts as e;

use crate::gl::call::GlResult;
use crate::gl::machine::Gl;
use crate::gl::state::materials::{tracked_parameters, tracks};

impl Gl {
    /// Writes the tracked colour to the materials: they keep it when colour material is switched off (OpenGL 1.5, section 2.14.3).
    pub fn settle_color_material(&mut self) -> GlResult {
        if !self.state.is(e::COLOR_MATERIAL) {
            return Ok(());
        }
        self.apply_materials()?;
        let state = &mut self.state;
        let (color, tracked) = (state.current.color, tracked_parameters(state));
        let kept = self.context.material_tracking.unchanged(color);
        for (side, material) in state.lighting.materials.iter_mut().enumerate() {
            let set = tracked[side] & !kept[side];
            for (bit, value) in [
                (tracks::AMBIENT, &mut material.ambient),
                (tracks::DIFFUSE, &mut material.diffuse),
                (tracks::SPECULAR, &mut material.specular),
                (tracks::EMISSION, &mut material.emission),
            ] {
                *value = if set & bit != 0 { color } else { *value };
            }
        }
        Ok(())
    }

    /// Applies the stored materials when a primitive begins or colour material was switched.
    pub fn apply_materials(&mut self) -> GlResult {
        if self.context.open_primitive.is_some() || self.context.compiling.is_some() {
            return Ok(());
        }
        let (next, changes) = self.context.material_tracking.at_primitive(&self.state);
        if changes {
            // The batch uses the state before this.
            self.flush()?;
        }
        self.context.material_tracking = next;
        Ok(())
    }
}
