//! Functions with the names of built-in functions. One that another shader object defines, or that is declared later, does not replace the
//! built-in function where that is called (OpenGL Shading Language 1.10, section 6.1), so it gets a name of its own.

use std::collections::{BTreeMap, BTreeSet};

use super::outline::items;
use super::tokens::{Dialect, Token};

/// Renames the functions of a stage's shaders whose names are also called where none of them is declared. `functions` are their names.
pub fn overrides(shaders: &mut [(Dialect, Vec<Token>)], functions: &BTreeSet<String>) {
    let mut hidden = BTreeSet::new();
    let all: Vec<BTreeSet<usize>> = shaders
        .iter()
        .map(|(_, tokens)| items(tokens).into_iter().filter_map(|item| Some(item.function?.name)).collect())
        .collect();
    for ((_, tokens), headers) in shaders.iter().zip(&all) {
        calls(tokens, headers, functions, |at, seen| {
            if !seen {
                hidden.insert(tokens[at].text.clone());
            }
        });
    }
    if hidden.is_empty() {
        return;
    }
    for ((_, tokens), headers) in shaders.iter_mut().zip(&all) {
        let mut renamed = BTreeMap::new();
        calls(tokens, headers, &hidden, |at, seen| {
            if seen {
                renamed.insert(at, format!("glx_own_{}_", tokens[at].text));
            }
        });
        for (at, name) in renamed {
            tokens[at].text = name;
        }
    }
}

/// Calls `visit` with each place where one of these functions is named, and whether it is declared there.
fn calls(tokens: &[Token], headers: &BTreeSet<usize>, functions: &BTreeSet<String>, mut visit: impl FnMut(usize, bool)) {
    let mut seen = BTreeSet::new();
    for (at, token) in tokens.iter().enumerate() {
        let is_call = token.word && tokens.get(at + 1).is_some_and(|next| next.is("("));
        let is_member = at > 0 && tokens[at - 1].is(".");
        if is_call && !is_member && functions.contains(&token.text) {
            if headers.contains(&at) {
                seen.insert(token.text.as_str());
            }
            visit(at, seen.contains(token.text.as_str()));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lazy::functions;
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(texts: &[&str]) -> String {
        let mut shaders: Vec<_> = texts.iter().map(|text| preprocess(text).expect("tokens")).collect();
        let names = functions(&shaders);
        overrides(&mut shaders, &names);
        let text: String = shaders.iter().map(|(_, tokens)| print(tokens)).collect();
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn built_in_functions_are_called_where_no_other_is_declared() {
        let one = "float g(float x) { return abs(x); } float abs(float x) { return x; } void main() { abs(1.0); }";
        let two = "float h(float x) { return abs(x); }";
        let wanted = "float g ( float x ) { return abs ( x ) ; } float glx_own_abs_ ( float x ) { return x ; } \
            void main ( ) { glx_own_abs_ ( 1.0 ) ; } float h ( float x ) { return abs ( x ) ; }";
        assert_eq!(of(&[one, two]), wanted);
        let plain = "float abs ( float x ) ; void main ( ) { abs ( 1.0 ) ; } float abs ( float x ) { return x ; }";
        assert_eq!(of(&[plain]), plain);
    }
}
