//! Programs in assembly: ARB_vertex_program and ARB_fragment_program. A program becomes WGSL, instruction by instruction; the stage that has no
//! program stays that of the fixed functions.

pub mod program;

pub(crate) mod stage;
pub(crate) mod wgsl;

mod binding;
mod lex;
mod operand;
mod parse;

pub use lex::{Place, Wrong};
pub use parse::parse;

#[cfg(test)]
mod tests;
