//! Initialisers of global variables. Naga evaluates constant ones only and leaves the others out, so these become assignments at the start
//! of `main`, in order (OpenGL Shading Language 1.20, section 4.3).

use std::collections::BTreeSet;

use super::outline::{Variables, initialiser, items};
use super::prelude;
use super::tokens::{Dialect, Token};
use super::words::is_type;

/// Moves the initialisers that are no constants into `main`. Returns the names of the variables whose initialisers stay, and whether some
/// have moved.
pub fn initial(shaders: &mut [(Dialect, Vec<Token>)], functions: &BTreeSet<String>) -> (BTreeSet<String>, bool) {
    let (mut constants, mut kept, mut moved) = (BTreeSet::new(), BTreeSet::new(), Vec::new());
    // Constants that become variables, since naga cannot evaluate calls of functions.
    let mut variable = BTreeSet::new();
    for (_, tokens) in shaders.iter_mut() {
        let mut out = Vec::with_capacity(tokens.len());
        for item in items(tokens) {
            let whole = &tokens[item.whole];
            let variables = Variables::of(whole).filter(|of| item.function.is_none() && of.is_own());
            let Some(of) = variables.filter(|of| of.names.iter().any(|name| initialiser(name).is_some())) else {
                out.extend_from_slice(whole);
                continue;
            };
            let calls = |token: &Token| prelude::renamed(&token.text).is_some() && !functions.contains(&token.text);
            let is_const = of.has("const")
                && !of.names.concat().iter().any(|token| token.word && (calls(token) || variable.contains(&token.text)));
            out.extend(of.qualifiers.iter().filter(|token| is_const || !token.is("const")).cloned());
            out.extend([of.kind, of.count].concat());
            for (k, name) in of.names.iter().enumerate() {
                let line = name[0].line;
                if k > 0 {
                    out.push(Token::new(",", line));
                }
                let stays = |at: usize| is_const || name[at..].first().is_some_and(|token| token.is("{"));
                match initialiser(name) {
                    Some(at) if !stays(at) && !is_constant(&name[at..], &constants) => {
                        out.extend_from_slice(&name[..at - 1]);
                        moved.push(name[0].clone());
                        moved.extend_from_slice(&name[at - 1..]);
                        moved.push(Token::new(";", line));
                    }
                    value => {
                        out.extend_from_slice(name);
                        if value.is_some() {
                            kept.insert(name[0].text.clone());
                        }
                    }
                }
                if is_const {
                    constants.insert(name[0].text.clone());
                } else if of.has("const") {
                    variable.insert(name[0].text.clone());
                }
            }
            out.extend(whole.last().cloned());
        }
        *tokens = out;
    }
    let has_moved = !moved.is_empty();
    if has_moved {
        start_main(shaders, moved);
    }
    (kept, has_moved)
}

/// Whether naga evaluates this initialiser: numbers, constants, constructors and the arithmetic of scalars. It need not find all of them.
fn is_constant(value: &[Token], constants: &BTreeSet<String>) -> bool {
    value.iter().enumerate().all(|(at, token)| {
        if token.word {
            let name = token.text.as_str();
            matches!(name, "true" | "false") || is_type(name) && !name.starts_with("mat") || constants.contains(name)
        } else {
            let array = || at > 0 && is_type(&value[at - 1].text);
            match token.text.as_str() {
                "(" | ")" | "," | "+" | "-" | "*" | "/" | "]" => true,
                "[" => array(),
                text => text.starts_with(|c: char| c.is_ascii_digit()),
            }
        }
    })
}

/// Inserts statements at the start of `main`.
fn start_main(shaders: &mut [(Dialect, Vec<Token>)], mut statements: Vec<Token>) {
    for (_, tokens) in shaders {
        let found = items(tokens).into_iter().find_map(|item| {
            let named = item.function.is_some_and(|header| tokens[header.name].is("main"));
            item.body(tokens).filter(|_| named)
        });
        if let Some(open) = found {
            tokens.splice(open + 1..open + 1, statements.drain(..));
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(texts: &[&str]) -> (String, BTreeSet<String>) {
        let mut shaders: Vec<_> = texts.iter().map(|text| preprocess(text).expect("tokens")).collect();
        let (kept, _) = initial(&mut shaders, &BTreeSet::new());
        let text: String = shaders.iter().map(|(_, tokens)| print(tokens)).collect();
        (text.split_whitespace().collect::<Vec<_>>().join(" "), kept)
    }

    #[test]
    fn initialisers_that_are_no_constants_move_to_main() {
        let (text, kept) = of(&[
            "uniform float u = 1.0; const float k = 2.0; float a = k * 0.5, b[2] = float[2](u, 1.0), c;\n\
             struct S { float x; } s = S(u); void f() {}",
            "float d = sin(k); vec2 e = vec2(1).yx; void main() { f(); } float g = a;",
        ]);
        assert_eq!(
            text,
            "uniform float u = 1.0 ; const float k = 2.0 ; float a = k * 0.5 , b [ 2 ] , c ; struct S { float x ; } s ; void f ( ) { } \
             float d ; vec2 e ; void main ( ) { b = float [ 2 ] ( u , 1.0 ) ; s = S ( u ) ; d = sin ( k ) ; e = vec2 ( 1 ) . yx ; \
             g = a ; f ( ) ; } float g ;"
        );
        assert_eq!(kept.into_iter().collect::<Vec<_>>(), ["a", "k"]);
    }

    #[test]
    fn damaged_declarations_are_left_alone() {
        for text in ["float a = ;", "float = u;", "= u;", "float a = u", "float a[ = u; void main() {}", "layout( float a = u;"]
        {
            of(&[text]);
        }
    }
}
