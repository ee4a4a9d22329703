//! Assembly programs: ARB_vertex_program and ARB_fragment_program. A program becomes WGSL, instruction by instruction. A stage without a
//! program uses the fixed functions.

pub mod program;

pub(crate) mod stage;
pub(crate) mod wgsl;

mod binding;
mod lex;
mod operand;
mod parse;

pub use lex::{ProgramLocation, Wrong};
pub use parse::parse;

#[cfg(test)]
mod tests;
