//! Floor 1: shaders of OpenGL as WGSL: programs in assembly ([`arb`]) and in GLSL ([`glsl`]), and the fixed functions
//! that a key names ([`wgsl`]).
//!
//! A package of its own: a program is translated once, so this code need not be optimised. What runs each call, and what gives values to
//! uniforms, is the machine of `import`.

/// A line of code.
macro_rules! line {
    ($out:expr, $($text:tt)*) => { writeln!($out, $($text)*).expect("text in memory") };
}

pub mod arb;
pub mod consts;
pub mod glsl;
pub mod key;
pub mod wgsl;

mod texels;

/// Texture units.
pub const UNITS: usize = 8;
/// Lights.
pub const LIGHTS: usize = 8;
/// User clip planes.
pub const PLANES: usize = 6;
/// Colour buffers that a draw writes at most.
pub const COLORS_MAX: usize = 8;

/// Texture targets of a unit, in order of rising precedence.
pub const TARGETS: [u32; 5] =
    [consts::TEXTURE_1D, consts::TEXTURE_2D, consts::TEXTURE_RECTANGLE, consts::TEXTURE_3D, consts::TEXTURE_CUBE_MAP];
