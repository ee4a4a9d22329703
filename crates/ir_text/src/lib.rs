//! Floor 0: shaders in naga's IR as RON text, as wgpu's traces have it, and in SPIR-V.
//!
//! A package of its own, because the code that reads the text of 200 types is ten times as long as what needs it and no faster where
//! it is optimised: the build leaves that out.
//!
//! ```
//! use std::cell::Cell;
//!
//! // The five words of the header of a SPIR-V module without instructions.
//! let (words, taken) = ([0x0723_0203, 0x0001_0000, 0, 1, 0], Cell::new(0));
//! let module = ir_text::read_spirv(&words, &Default::default(), &taken).expect("an empty module");
//! assert!(module.entry_points.is_empty());
//! assert_eq!(taken.get(), 5);
//! ```

use std::cell::Cell;

/// Reads a module. It is what the text says, not validated.
///
/// # Errors
/// RON's, with the place in the text.
pub fn read(text: &str) -> Result<naga::Module, ron::error::SpannedError> {
    ron::from_str(text)
}

/// Reads a module of SPIR-V, and counts the words that it has taken: on an error, the last one belongs to the instruction at fault.
///
/// # Errors
/// naga's.
pub fn read_spirv(
    words: &[u32],
    options: &naga::front::spv::Options,
    taken: &Cell<usize>,
) -> Result<naga::Module, naga::front::spv::Error> {
    let counted = words.iter().copied().inspect(|_| taken.set(taken.get() + 1));
    naga::front::spv::Frontend::new(counted, options).parse()
}
