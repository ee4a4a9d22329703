//! Texture units.

use gl_shader::key::*;
use gl_shader::{TARGETS, UNITS, consts as e};

use crate::gl::call::{Fault, GlResult, INVALID_ENUM};
use crate::gl::names;

/// Products of two pairs, and their sum (`GL_COMBINE4_NV`), with a fourth argument.
pub const COMBINE4: u32 = 0x8503;
/// Dot products of `EXT_texture_env_dot3`, which are not scaled.
pub const DOT3_RGB: u32 = 0x8740;
pub const DOT3_RGBA: u32 = 0x8741;
/// Targets of textures that came after OpenGL 1.5: arrays, buffers, several samples, external images.
const LATER_TARGETS: [u32; 7] = [0x8c18, 0x8c1a, 0x9009, 0x8c2a, 0x9100, 0x9102, 0x8d65];

/// Generation of one texture coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Generation {
    /// `GL_EYE_LINEAR`, ...
    pub mode: u32,
    /// Object plane.
    pub object: [f32; 4],
    /// Eye plane, in eye space.
    pub eye: [f32; 4],
}

/// Texture environment of a unit.
#[derive(Clone, Debug, PartialEq)]
pub struct Environment {
    /// `GL_MODULATE`, ...
    pub mode: u32,
    /// Constant colour.
    pub color: [f32; 4],
    /// Combiners of colour and alpha.
    pub combine: [u32; 2],
    /// Sources of both.
    pub sources: [[u32; 4]; 2],
    /// Operands of both.
    pub operands: [[u32; 4]; 2],
    /// Scales of both.
    pub scales: [f32; 2],
    /// Bias of the level of detail.
    pub bias: f32,
}

/// A texture unit.
#[derive(Clone, Debug)]
pub struct Unit {
    /// Which of [`TARGETS`] are enabled.
    pub enabled: u8,
    /// Names of the textures that are bound to them.
    pub bound: [u32; 5],
    /// Which of s, t, r, q are generated.
    pub generated: u8,
    /// How each of them is generated.
    pub generation: [Generation; 4],
    /// Environment.
    pub environment: Environment,
}

impl Default for Unit {
    fn default() -> Unit {
        let plane = |k: usize| std::array::from_fn(|i| if i == k && k < 2 { 1.0 } else { 0.0 });
        Unit {
            enabled: 0,
            bound: [0; 5],
            generated: 0,
            generation: std::array::from_fn(|k| Generation { mode: e::EYE_LINEAR, object: plane(k), eye: plane(k) }),
            environment: Environment {
                mode: e::MODULATE,
                color: [0.0; 4],
                combine: [e::MODULATE; 2],
                sources: [[e::TEXTURE, e::PREVIOUS, e::CONSTANT, e::ZERO]; 2],
                operands: [
                    [e::SRC_COLOR, e::SRC_COLOR, e::SRC_ALPHA, e::ONE_MINUS_SRC_COLOR],
                    [e::SRC_ALPHA, e::SRC_ALPHA, e::SRC_ALPHA, e::ONE_MINUS_SRC_ALPHA],
                ],
                scales: [1.0; 2],
                bias: 0.0,
            },
        }
    }
}

/// Texture units.
#[derive(Clone, Debug)]
pub struct Texturing {
    /// The units up to the last one that the program has used, and at least those of fixed functions.
    pub units: Vec<Unit>,
    /// The active unit; it is among them.
    pub active: usize,
}

impl Default for Texturing {
    fn default() -> Self {
        Texturing { units: vec![Unit::default(); UNITS], active: 0 }
    }
}

impl Texturing {
    /// Makes sure that a unit is among those that are stored.
    pub fn reach(&mut self, unit: usize) {
        if self.units.len() <= unit {
            self.units.resize(unit + 1, Unit::default());
        }
    }

    /// Restores the groups of `mask` from a saved state.
    pub fn restore(&mut self, mask: u32, saved: &Texturing) {
        let unused = Unit::default();
        let units = self.units.iter_mut().zip(saved.units.iter().chain(std::iter::repeat(&unused)));
        if mask & e::TEXTURE_BIT != 0 {
            units.for_each(|(unit, old)| unit.clone_from(old));
            self.active = saved.active;
        } else if mask & e::ENABLE_BIT != 0 {
            units.for_each(|(unit, old)| (unit.enabled, unit.generated) = (old.enabled, old.generated));
        }
    }
}

/// The later name of a function that has two.
pub fn later(function: u32) -> u32 {
    match function {
        DOT3_RGB => e::DOT3_RGB,
        DOT3_RGBA => e::DOT3_RGBA,
        other => other,
    }
}

/// The kind of texture of a target.
pub fn kind_of(target: usize) -> TextureShape {
    [TextureShape::D1, TextureShape::D2, TextureShape::Rectangle, TextureShape::D3, TextureShape::Cube][target]
}

/// The number of a texture target.
pub fn target_of(target: u32) -> GlResult<usize> {
    if LATER_TARGETS.contains(&target) {
        return Err(Fault::Unsupported(format!("textures of target {}", names::name(target))));
    }
    TARGETS.iter().position(|&known| known == target).ok_or(INVALID_ENUM)
}
