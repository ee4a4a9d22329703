//! Programs in GLSL.
//!
//! The preprocessor ([`preprocess`]) makes [`tokens`] of [`lexemes`], the parser ([`parse`]) makes a syntax [`tree`] of tokens. [`rewrite`] joins
//! the trees of several shader objects ([`link`]) and lowers them to version 4.50, as naga's front end reads it: variables at global scope
//! ([`globals`]), functions ([`lower`], with types in [`scope`]), and what naga does not do as the language says ([`arrays`], [`compare`], [`flow`]).
//! [`print`] writes the tree. Then follow naga's front end, components as arguments ([`outs`]) and WGSL writer ([`emit`]), the replacement of
//! variables by uniforms ([`access`]), and the stage in the machine's module ([`stage`]), where fixed-function code does the rest.

mod access;
mod arrays;
pub mod blocks;
mod builtins;
mod compare;
mod condition;
mod emit;
mod flow;
mod globals;
mod lexemes;
mod link;
mod lower;
mod outs;
mod parse;
mod prelude;
mod preprocess;
mod print;
mod rewrite;
mod sampler;
mod scope;
pub mod stage;
#[cfg(test)]
mod tests;
mod tokens;
mod tree;
mod words;

use std::rc::Rc;

use host::with_room_for;
use num::Limits;

use crate::arb::program::ProgramStage;
pub use access::Layout;
pub use emit::Translated;
use emit::translate;

/// Levels of WGSL that take as much stack as a level of GLSL: naga's front end takes up to 72 KiB for a constructor inside of another in a
/// release, where it is not optimised.
const LEVEL: u64 = 8;

/// Statements inside each other that are refused before naga reads them. It would refuse those beyond 127, after it has written them all.
const BLOCKS_MAX: u64 = 200;

/// Maximum number of tokens of a shader.
const TOKENS_MAX: usize = 1 << 18;

/// An error in a shader.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Wrong {
    /// The line of its source; 0 if that is not known.
    pub line: u32,
    /// The reason.
    pub reason: String,
}

impl Wrong {
    fn at(line: u32, reason: impl Into<String>) -> Wrong {
        Wrong { line, reason: reason.into() }
    }
}

type TranslateResult<T = ()> = Result<T, Wrong>;

/// Sources of both stages.
pub type Sources = [Vec<Rc<str>>; 2];

/// Both stages of a program after they have been translated.
pub struct Linked {
    /// Its number among all distinct programs.
    pub number: u32,
    /// Vertex and fragment stage, where there is one.
    pub stages: [Option<Translated>; 2],
}

impl Linked {
    /// The stages that it has.
    #[inline]
    pub fn stages(&self) -> [Option<&Translated>; 2] {
        self.stages.each_ref().map(Option::as_ref)
    }
}

/// Translates both stages of a program.
///
/// # Errors
/// If a shader is wrong or is not supported: its stage, the line of its source, and the reason.
pub fn link(number: u32, sources: &Sources, limits: &Limits) -> Result<Rc<Linked>, String> {
    let mut stages = [None, None];
    for (k, (stage, texts)) in [ProgramStage::Vertex, ProgramStage::Fragment].into_iter().zip(sources).enumerate() {
        if texts.is_empty() {
            continue;
        }
        let array = ["u.vertex_params", "u.fragment_params"][k];
        // Counted references stay on their thread.
        let texts: Vec<&str> = texts.iter().map(|text| &**text).collect();
        let run = || {
            let tokens = texts.iter().map(|text| preprocess::preprocess(text, limits)).collect::<TranslateResult<Vec<_>>>()?;
            for (_, tokens) in &tokens {
                let levels = tokens::nesting(tokens);
                limits.shader_nesting.check(levels).map_err(|error| Wrong::at(0, error.to_string()))?;
                limits.shader_constants.check(tokens::reach(tokens)).map_err(|error| Wrong::at(0, error.to_string()))?;
                let blocks = tokens::blocks(tokens);
                if blocks > BLOCKS_MAX {
                    let reason = format!(
                        "{blocks} statements inside each other, and WGSL has at most 127 blocks; a part can be a function"
                    );
                    return Err(Wrong::at(0, reason));
                }
                limits.shader_pairs.check(tokens::pairs(tokens)).map_err(|error| Wrong::at(0, error.to_string()))?;
            }
            let source = rewrite::rewrite(stage, tokens)?;
            // The passes add brackets, and copies of functions.
            limits.shader_nesting.check(source.nesting).map_err(|error| Wrong::at(0, error.to_string()))?;
            limits.shader_pairs.check(source.pairs).map_err(|error| Wrong::at(0, error.to_string()))?;
            Ok(source)
        };
        let no_stack = |reason| Wrong::at(0, reason);
        let rewritten = with_room_for(limits.shader_nesting.get(), run).map_err(no_stack).flatten();
        let translated = rewritten.and_then(|source| {
            let levels = source.nesting.saturating_mul(LEVEL);
            with_room_for(levels, || translate(stage, &source, array)).map_err(no_stack).flatten()
        });
        let name = ["vertex", "fragment"][k];
        stages[k] = Some(translated.map_err(|wrong| match wrong.line {
            0 => format!("{name} shader: {}", wrong.reason),
            line => format!("{name} shader, line {line}: {}", wrong.reason),
        })?);
    }
    share(&mut stages);
    Ok(Rc::new(Linked { number, stages }))
}

/// Gives uniforms that only one of the stages initialises that value in both.
fn share(stages: &mut [Option<Translated>; 2]) {
    let [Some(vertex), Some(fragment)] = stages else { return };
    for a in &vertex.uniforms {
        let Some(b) = fragment.uniforms.iter().find(|b| b.name == a.name && b.initialised != a.initialised) else { continue };
        let count = a.layout.slots();
        if b.layout.slots() == count {
            let (from, to) = (a.first..a.first + count, b.first..b.first + count);
            if a.initialised {
                fragment.defaults[to].copy_from_slice(&vertex.defaults[from]);
            } else {
                vertex.defaults[from].copy_from_slice(&fragment.defaults[to]);
            }
        }
    }
}
