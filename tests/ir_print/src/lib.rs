//! naga's IR as RON text, as wgpu records modules that a program has built. For tests alone: a package of its own because the code that
//! serde generates is a fifth of the tests of the shader engine, and here it is compiled once and not optimised.

/// The text of a module.
///
/// # Panics
/// If a part of the module has no RON form.
pub fn ron(module: &naga::Module) -> String {
    ron::to_string(module).expect("a module is text")
}
