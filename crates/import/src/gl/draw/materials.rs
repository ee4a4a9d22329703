//! When materials and colour material take effect.

use gl_shader::consts as e;

use crate::gl::call::Outcome;
use crate::gl::machine::Gl;
use crate::gl::state::materials::{Given, tracked, tracks};

impl Gl {
    /// Writes the tracked colour to the materials: they keep it when colour material is switched off (OpenGL 1.5, section 2.14.3).
    pub fn settle_color_material(&mut self) -> Outcome {
        if !self.state.is(e::COLOR_MATERIAL) {
            return Ok(());
        }
        self.materials_meet()?;
        let state = &mut self.state;
        let (color, tracked) = (state.current.color, tracked(state));
        let kept = self.context.given.kept(color);
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
}

impl Gl {
    /// Applies the stored materials when a primitive begins or colour material was switched.
    pub fn materials_meet(&mut self) -> Outcome {
        if self.context.begun.is_some() || self.context.compiling.is_some() {
            return Ok(());
        }
        let color = self.state.current.color;
        let mut kept = self.context.given.kept(color);
        for (side, tracked) in tracked(&self.state).into_iter().enumerate() {
            kept[side] |= self.context.given.waiting[side] & tracked;
        }
        if kept != self.context.given.kept {
            // The batch uses the state before this.
            self.flush()?;
        }
        self.context.given = Given { waiting: [0; 2], kept, color };
        Ok(())
    }
}
