//! Floor 1: translates OpenGL's shaders to WGSL: assembly programs ([`arb`]), GLSL programs ([`glsl`]), and the fixed-function
//! stages of a key ([`wgsl`]).
//!
//! It is a separate package: a program is translated once, so this code need not be optimised. The machine of `import` runs the calls and
//! computes the uniforms.
//!
//! ```
//! use gl_shader::arb::parse;
//! use gl_shader::arb::program::ProgramStage;
//!
//! let program = parse("!!ARBfp1.0\nMOV result.color, fragment.color;\nEND", ProgramStage::Fragment).expect("a program");
//! assert_eq!(program.instructions[0].name, "MOV");
//! let wrong = parse("!!ARBfp1.0\nMOV result.colour, 1;\nEND", ProgramStage::Fragment).expect_err("a wrong name");
//! assert_eq!(wrong.place.line, 2);
//! ```

/// A line of code.
macro_rules! line {
    ($out:expr, $($text:tt)*) => { writeln!($out, $($text)*).expect("text in memory") };
}

pub mod arb;
pub mod consts;
pub mod expand;
pub mod glsl;
pub mod key;
pub mod narrow;
pub mod wgsl;

mod lit;
mod texels;

/// Number of texture units that fixed functions have: coordinates, matrices, environments.
pub const UNITS: usize = 8;
/// Number of texture units that programs read, of all stages.
pub const IMAGES: usize = 192;
/// Maximum number of textures that a stage reads.
pub const STAGE_IMAGES: usize = 32;
/// Number of lights.
pub const LIGHTS: usize = 8;
/// Number of user clip planes.
pub const PLANES: usize = 6;
/// Maximum number of colour buffers that a draw writes.
pub const COLORS_MAX: usize = 8;

/// Texture targets of a unit, in order of rising precedence.
pub const TARGETS: [u32; 5] =
    [consts::TEXTURE_1D, consts::TEXTURE_2D, consts::TEXTURE_RECTANGLE, consts::TEXTURE_3D, consts::TEXTURE_CUBE_MAP];
