//! Arrays in declarations. Naga gives the brackets of one variable to those that follow it in the same declaration, so each of these gets a
//! declaration of its own; and arrays without a size get the one that the language gives them (OpenGL Shading Language 1.20, section 4.1.9).

use std::collections::{BTreeMap, BTreeSet};

use super::outline::{Variables, initialiser};
use super::tokens::{Dialect, Token, closing, parts};

/// A variable: the bracket of the block that it is declared in, or none at global scope, and its name.
type ScopedName = (Option<(usize, usize)>, String);

/// Rewrites the declarations of all shaders of a stage.
pub fn declarators(shaders: &mut [(Dialect, Vec<Token>)]) {
    if !shaders.iter().any(|(_, tokens)| tokens.iter().any(|token| token.is("["))) {
        return;
    }
    // The sizes that are known, arrays with empty brackets, variables with values.
    let (mut sizes, mut open, mut given) = (BTreeMap::new(), BTreeSet::new(), BTreeSet::new());
    let mut reach: BTreeMap<String, u64> = BTreeMap::new();
    for (k, (_, tokens)) in shaders.iter_mut().enumerate() {
        *tokens = counted(tokens);
        for of in tokens.windows(4).filter(|of| of[0].word && of[1].is("[") && of[3].is("]")) {
            if let Ok(index) = of[2].text.trim_end_matches('u').parse::<u64>() {
                let reach = reach.entry(of[0].text.clone()).or_default();
                *reach = index.saturating_add(1).max(*reach);
            }
        }
        each(k, tokens, |place, of, name| {
            let (is_open, size) = size(of, name);
            if is_open {
                open.insert(place.clone());
            }
            if initialiser(name).is_some() {
                given.insert(place.clone());
            }
            if let Some(size) = size {
                sizes.entry(place).or_insert(size);
            }
        });
    }
    let mut written = BTreeSet::new();
    for (k, (_, tokens)) in shaders.iter_mut().enumerate() {
        let (mut out, mut from): (Vec<Token>, usize) = (Vec::with_capacity(tokens.len()), 0);
        statements(k, tokens, |block, start, end| {
            let Some(of) = Variables::of(&tokens[start..=end]) else { return };
            let place = |name: &[Token]| (block, name[0].text.clone());
            let is_open = |name: &&[Token]| open.contains(&place(name));
            if !of.names.iter().any(is_open) && of.names.iter().rev().skip(1).all(|name| !is_array(name)) {
                return;
            }
            out.extend_from_slice(&tokens[from..start]);
            from = end + 1;
            for name in &of.names {
                let line = name[0].line;
                let valued = initialiser(name).is_some();
                if is_open(name)
                    && (written.contains(&place(name)) || !valued && block.is_none() && given.contains(&place(name)))
                {
                    // What is left of a second declaration in a block is its value.
                    if let Some(at) = initialiser(name) {
                        out.push(name[0].clone());
                        out.extend_from_slice(&name[at - 1..]);
                        out.push(tokens[end].clone());
                    }
                    continue;
                }
                written.insert(place(name));
                out.extend_from_slice(of.qualifiers);
                out.extend_from_slice(of.kind);
                let known = || {
                    let reach = reach.get(&name[0].text).copied().unwrap_or(1);
                    sizes.get(&place(name)).cloned().unwrap_or_else(|| vec![Token::new(reach.to_string(), line)])
                };
                if is_open(name) && size(&of, name).0 {
                    out.push(name[0].clone());
                    out.push(Token::new("[", line));
                    out.extend(known());
                    out.push(Token::new("]", line));
                    out.extend(initialiser(name).into_iter().flat_map(|at| name[at - 1..].iter().cloned()));
                } else {
                    out.extend_from_slice(of.count);
                    out.extend_from_slice(name);
                }
                out.push(tokens[end].clone());
            }
        });
        out.extend_from_slice(&tokens[from..]);
        *tokens = out;
    }
}

/// Whether a variable has brackets of its own.
fn is_array(name: &[Token]) -> bool {
    name.get(1).is_some_and(|token| token.is("["))
}

/// Whether a variable is an array with empty brackets, and the size of an array if it is known: that between its brackets, or that of its
/// initialiser.
fn size(of: &Variables, name: &[Token]) -> (bool, Option<Vec<Token>>) {
    let value = initialiser(name);
    let brackets = if is_array(name) { &name[1..value.map_or(name.len(), |at| at - 1)] } else { of.count };
    // `float[2](1.0, 2.0)`
    let given = |value: &[Token]| {
        let close = value.get(1).filter(|token| token.is("[")).and_then(|_| closing(value, 1))?;
        value.get(close + 1).is_some_and(|token| token.is("(")).then(|| value[2..close].to_vec())
    };
    match brackets {
        [open, close] if open.is("[") && close.is("]") => (true, value.and_then(|at| given(&name[at..]))),
        [open, inner @ .., close] if open.is("[") && close.is("]") => (false, Some(inner.to_vec())),
        _ => (false, None),
    }
}

/// Calls `visit` with each variable that is declared.
fn each(shader: usize, tokens: &[Token], mut visit: impl FnMut(ScopedName, &Variables, &[Token])) {
    statements(shader, tokens, |block, start, end| {
        if let Some(of) = Variables::of(&tokens[start..=end]) {
            of.names.iter().for_each(|name| visit((block, name[0].text.clone()), &of, name));
        }
    });
}

/// Calls `visit` with each statement that is a declaration of variables: the block that it is in, its first and its last token.
fn statements(shader: usize, tokens: &[Token], mut visit: impl FnMut(Option<(usize, usize)>, usize, usize)) {
    let (mut blocks, mut at, mut starts) = (Vec::new(), 0, true);
    while let Some(token) = tokens.get(at) {
        if let Some(end) = starts.then(|| declaration(tokens, at)).flatten() {
            visit(blocks.last().copied(), at, end);
            at = end + 1;
            continue;
        }
        match token.text.as_str() {
            "{" => blocks.push((shader, at)),
            "}" => drop(blocks.pop()),
            _ => {}
        }
        starts = matches!(token.text.as_str(), "{" | "}" | ";");
        at += 1;
    }
}

/// The last token of the declaration of variables that begins here.
pub fn declaration(tokens: &[Token], start: usize) -> Option<usize> {
    let mut at = start;
    // Qualifiers, the type, the name: words that follow each other.
    let mut words = 0;
    loop {
        let token = tokens.get(at)?;
        match token.text.as_str() {
            "return" | "else" | "case" | "do" | "precision" | "struct" | "default" => return None,
            "layout" => at = closing(tokens, at + 1)?,
            "[" if words > 0 && tokens.get(closing(tokens, at)? + 1)?.word => at = closing(tokens, at)?,
            _ if token.word => words += 1,
            "[" | "=" | "," | ";" if words > 1 => break,
            _ => return None,
        }
        at += 1;
    }
    let mut depth = 0_u32;
    for (end, token) in tokens.iter().enumerate().skip(at) {
        match token.text.as_str() {
            "{" if depth == 0 && !tokens[end - 1].is("=") => return None,
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth = depth.checked_sub(1)?,
            ";" => return (depth == 0).then_some(end),
            _ => {}
        }
    }
    None
}

/// The tokens with the sizes of array constructors: `float[](1.0, 2.0)`.
fn counted(tokens: &[Token]) -> Vec<Token> {
    let mut out = Vec::with_capacity(tokens.len());
    for (at, token) in tokens.iter().enumerate() {
        let is_open = at >= 2
            && token.is("]")
            && tokens[at - 1].is("[")
            && tokens[at - 2].word
            && tokens.get(at + 1).is_some_and(|next| next.is("("));
        if let Some(close) = is_open.then(|| closing(tokens, at + 1)).flatten() {
            out.push(Token::new(parts(&tokens[at + 2..close]).len().to_string(), token.line));
        }
        out.push(token.clone());
    }
    out
}

#[cfg(test)]
mod tests {
    use super::super::tokens::{preprocess, print};
    use super::*;

    fn of(texts: &[&str]) -> String {
        let mut shaders: Vec<_> = texts.iter().map(|text| preprocess(text).expect("tokens")).collect();
        declarators(&mut shaders);
        let text: String = shaders.iter().map(|(_, tokens)| print(tokens)).collect();
        text.split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn a_variable_after_an_array_gets_its_own_declaration() {
        for (text, wanted) in [
            ("float a, b[2], c = f(1, 2);", "float a ; float b [ 2 ] ; float c = f ( 1 , 2 ) ;"),
            (
                "void f() { const lowp S a[2], b; c[1], d; }",
                "void f ( ) { const lowp S a [ 2 ] ; const lowp S b ; c [ 1 ] , d ; }",
            ),
            ("struct S { float a[2], b; };", "struct S { float a [ 2 ] ; float b ; } ;"),
            ("float a, b[2]; float[2] c, d;", "float a , b [ 2 ] ; float [ 2 ] c , d ;"),
            (
                "float f(float a[2], float b) { return a[1], b; }",
                "float f ( float a [ 2 ] , float b ) { return a [ 1 ] , b ; }",
            ),
        ] {
            assert_eq!(of(&[text]), wanted);
        }
    }

    #[test]
    fn arrays_get_their_sizes() {
        for (text, wanted) in [
            ("const vec2 a[] = vec2[](vec2(1, 2), b);", "const vec2 a [ 2 ] = vec2 [ 2 ] ( vec2 ( 1 , 2 ) , b ) ;"),
            ("float[] a = float[3](1, 2, 3);", "float a [ 3 ] = float [ 3 ] ( 1 , 2 , 3 ) ;"),
            ("uniform float a[]; void f() { a[3]; a[1]; }", "uniform float a [ 4 ] ; void f ( ) { a [ 3 ] ; a [ 1 ] ; }"),
            ("void f() { float a[]; a[0]; float a[5]; }", "void f ( ) { float a [ 5 ] ; a [ 0 ] ; }"),
            (
                "void f() { float a[]; float a[] = float[](1, 2); }",
                "void f ( ) { float a [ 2 ] ; a = float [ 2 ] ( 1 , 2 ) ; }",
            ),
            ("float a[]; float a[] = float[](1, 2);", "float a [ 2 ] = float [ 2 ] ( 1 , 2 ) ;"),
            ("void f() { float a[]; a[0]; { float a[5]; } }", "void f ( ) { float a [ 6 ] ; a [ 0 ] ; { float a [ 5 ] ; } }"),
        ] {
            assert_eq!(of(&[text]), wanted);
        }
        // One of several objects has the size.
        assert_eq!(of(&["float a[];", "float a[3];"]), "float a [ 3 ] ;");
        for text in ["float a[", "float a[] = ;", "float [] [", "layout( float a[];", "[ ] = ; float a[]", "float a[], ;"] {
            of(&[text]);
        }
    }
}
