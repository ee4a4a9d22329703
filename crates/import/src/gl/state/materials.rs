//! The interaction of `glMaterial` and colour material, in the order in which Mesa applies the calls.
//!
//! By the standard, colour material sets the materials that it tracks as soon as it is enabled. Mesa stores the values of `glMaterial` and
//! `glColor` until a primitive begins or colour material is switched, and then applies the colour first. So materials that were set before
//! colour material was enabled replace the tracked colour, until a primitive has another colour. Programs that end each frame with a
//! material and begin the next with colour material (OpenSceneGraph is one) show the difference. The reference images are Mesa's.

use gl_shader::consts as e;
use gl_shader::key::LightingKey;

use crate::gl::geometry::summary::Summary;
use crate::gl::geometry::vertex::Vertex;
use crate::gl::state::server::State;

/// Bits of the parameters that colour material can track.
pub mod tracks {
    /// The ambient colour.
    pub const AMBIENT: u8 = 1;
    /// The diffuse colour.
    pub const DIFFUSE: u8 = 2;
    /// The specular colour.
    pub const SPECULAR: u8 = 4;
    /// The emission.
    pub const EMISSION: u8 = 8;
}

/// How vertices between Begin and End get materials that change between them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ChangingMaterial {
    /// One colour of the material changes, as the arguments of `glMaterial` name it: its present value becomes the colour of vertices.
    Color([u32; 2], [f32; 4]),
    /// Vertices are lit when they are sent.
    Lit,
}

/// Which parameters `glMaterial` has set, beside the values themselves. Bits of [`tracks`], for front and back.
#[derive(Clone, Debug)]
pub struct MaterialTracking {
    /// Parameters set since the last primitive.
    waiting: [u8; 2],
    /// Parameters that keep their value although colour material tracks them, as long as the colour does not change.
    kept: [u8; 2],
    /// The current colour when the last primitive began.
    color: [f32; 4],
}

impl Default for MaterialTracking {
    fn default() -> Self {
        MaterialTracking { waiting: [0; 2], kept: [0; 2], color: [1.0; 4] }
    }
}

/// The bits of a parameter of `glMaterial` or a mode of colour material.
fn bits(name: u32) -> u8 {
    match name {
        e::AMBIENT => tracks::AMBIENT,
        e::DIFFUSE => tracks::DIFFUSE,
        e::AMBIENT_AND_DIFFUSE => tracks::AMBIENT | tracks::DIFFUSE,
        e::SPECULAR => tracks::SPECULAR,
        e::EMISSION => tracks::EMISSION,
        _ => 0,
    }
}

/// The parameters that colour material tracks on each side.
pub fn tracked_parameters(state: &State) -> [u8; 2] {
    if !state.is(e::COLOR_MATERIAL) {
        return [0; 2];
    }
    let [face, mode] = state.lighting.color_material;
    [e::FRONT, e::BACK].map(|side| if face == side || face == e::FRONT_AND_BACK { bits(mode) } else { 0 })
}

impl MaterialTracking {
    /// `glMaterial` sets a parameter.
    pub fn note_set(&mut self, state: &State, faces: std::ops::Range<usize>, name: u32) {
        let tracked = tracked_parameters(state);
        for side in faces {
            self.waiting[side] |= bits(name) & !tracked[side];
        }
    }

    /// Colour material is switched: it sets all that it tracks.
    pub fn note_switched(&mut self) {
        self.kept = [0; 2];
    }

    /// What is noted once a primitive begins with this state; and whether that changes which parameters keep their value.
    pub fn at_primitive(&self, state: &State) -> (MaterialTracking, bool) {
        let color = state.current.color;
        let mut kept = self.unchanged(color);
        for (side, tracked) in tracked_parameters(state).into_iter().enumerate() {
            kept[side] |= self.waiting[side] & tracked;
        }
        (MaterialTracking { waiting: [0; 2], kept, color }, kept != self.kept)
    }

    /// Materials are restored as a whole.
    pub fn note_restored(&mut self) {
        (self.waiting, self.kept) = ([0; 2], [0; 2]);
    }

    /// The parameters that keep their value with this colour.
    pub fn unchanged(&self, color: [f32; 4]) -> [u8; 2] {
        if color == self.color { self.kept } else { [0; 2] }
    }

    /// Removes from a draw's tracked parameters those that keep their value.
    pub fn untrack_unchanged(&self, lighting: &mut LightingKey, constant: &Vertex, summary: &Summary) {
        if !summary.varying.color {
            let kept = self.unchanged(constant.color);
            for (tracked, kept) in lighting.color_material.iter_mut().zip(kept) {
                *tracked &= !kept;
            }
        }
    }
}
