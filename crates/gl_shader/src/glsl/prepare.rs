//! The passes that write what naga does not do as the language says in words that it does right.

use std::collections::BTreeSet;

use super::braces::braces;
use super::cases::separate;
use super::declarators::declarators;
use super::equality::equality;
use super::initial::initial;
use super::lazy::{functions, lazy};
use super::loops::loops;
use super::overrides::overrides;
use super::returns::returns;
use super::shadows::shadows;
use super::swizzles::swizzles;
use super::tokens::{Dialect, Token};

/// What the passes that follow need to know.
pub struct Prepared {
    /// The names of all functions.
    pub functions: BTreeSet<String>,
    /// Variables that keep their initialisers.
    pub kept: BTreeSet<String>,
    /// Whether initialisers of others have moved to `main`.
    pub moved: bool,
}

/// Rewrites the shaders of a stage. `members` are words in the bodies of structures.
pub fn prepare(shaders: &mut [(Dialect, Vec<Token>)], members: &BTreeSet<String>) -> Prepared {
    shadows(shaders);
    shaders.iter_mut().for_each(|(_, tokens)| braces(tokens));
    declarators(shaders);
    equality(shaders);
    let names = functions(shaders);
    overrides(shaders, &names);
    let functions = functions(shaders);
    for (_, tokens) in shaders.iter_mut() {
        returns(tokens);
        separate(tokens);
        swizzles(tokens, members);
        *tokens = loops(tokens).unwrap_or_else(|| std::mem::take(tokens));
        *tokens = lazy(tokens, &functions).unwrap_or_else(|| std::mem::take(tokens));
    }
    let (kept, moved) = initial(shaders, &functions);
    Prepared { functions, kept, moved }
}
