//! Floor 0: naga's IR in RON text, as wgpu's traces have it.
//!
//! A package of its own, because the code that reads the text of 200 types is ten times as long as what needs it and no faster where
//! it is optimised for speed: the build gives it the optimisation of a parser.

/// Reads a module. It is what the text says, not validated.
///
/// # Errors
/// RON's, with the place in the text.
pub fn read(text: &str) -> Result<naga::Module, ron::error::SpannedError> {
    ron::from_str(text)
}
