//! Declarations at global scope.

use std::ops::Range;

use super::tokens::{Token, closing, parts};

/// The header of a function or of a prototype: positions of its name and of the brackets around its parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Header {
    /// Its name.
    pub name: usize,
    /// The bracket before its parameters.
    pub open: usize,
    /// The bracket after them.
    pub close: usize,
}

/// A declaration at global scope.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Item {
    /// Its tokens.
    pub whole: Range<usize>,
    /// If it is a function or a prototype.
    pub function: Option<Header>,
}

impl Item {
    /// The position of the bracket that opens a function's body.
    pub fn body(&self, tokens: &[Token]) -> Option<usize> {
        let open = self.function?.close + 1;
        tokens.get(open).is_some_and(|token| token.is("{")).then_some(open)
    }
}

/// The declarations at global scope. What has no end is left to the passes that follow.
pub fn items(tokens: &[Token]) -> Vec<Item> {
    let (mut list, mut start) = (Vec::new(), 0);
    while start < tokens.len() {
        let (mut at, mut function, mut values) = (start, None, false);
        let end = loop {
            let Some(token) = tokens.get(at) else { break tokens.len() };
            if matches!(token.text.as_str(), "(" | "[" | "{") {
                let close = closing(tokens, at).unwrap_or(tokens.len() - 1);
                if token.is("(") && function.is_none() && at > start && !tokens[at - 1].is("layout") && !values {
                    function = Some(Header { name: at - 1, open: at, close });
                } else if token.is("{") && function.is_some() {
                    break close + 1;
                }
                at = close;
            } else if token.is(";") {
                break at + 1;
            }
            values |= token.is("=");
            at += 1;
        };
        list.push(Item { whole: start..end, function });
        start = end;
    }
    list
}

/// Words before a type.
const QUALIFIERS: [&str; 19] = [
    "const",
    "uniform",
    "attribute",
    "varying",
    "in",
    "out",
    "buffer",
    "shared",
    "flat",
    "smooth",
    "noperspective",
    "centroid",
    "invariant",
    "precise",
    "highp",
    "mediump",
    "lowp",
    "inout",
    "layout",
];

/// Qualifiers of variables that are not the stage's own.
const INTERFACE: [&str; 7] = ["uniform", "attribute", "varying", "in", "out", "buffer", "shared"];

/// A declaration of variables: its parts.
#[derive(Clone, Debug)]
pub struct Variables<'a> {
    /// Words before the type.
    pub qualifiers: &'a [Token],
    /// The type; the whole structure if it declares one.
    pub kind: &'a [Token],
    /// Brackets after the type.
    pub count: &'a [Token],
    /// Each variable: its name, and what follows.
    pub names: Vec<&'a [Token]>,
}

impl<'a> Variables<'a> {
    /// The parts of a declaration that ends in a semicolon; none if it is of another form.
    pub fn of(tokens: &'a [Token]) -> Option<Variables<'a>> {
        let (last, tokens) = tokens.split_last()?;
        let mut at = 0;
        while tokens.get(at).is_some_and(|token| QUALIFIERS.contains(&token.text.as_str())) {
            if tokens[at].is("layout") {
                at = closing(tokens, at + 1)?;
            }
            at += 1;
        }
        let first = tokens.get(at).filter(|token| token.word && last.is(";"))?;
        let mut end = at + 1;
        if first.is("struct") {
            let open = at + tokens[at..].iter().take(3).position(|token| token.is("{"))?;
            end = closing(tokens, open)? + 1;
        }
        let after = if tokens.get(end).is_some_and(|token| token.is("[")) { closing(tokens, end)? + 1 } else { end };
        let names: Vec<&[Token]> = parts(&tokens[after..]).into_iter().filter(|name| !name.is_empty()).collect();
        let (qualifiers, kind, count) = (&tokens[..at], &tokens[at..end], &tokens[end..after]);
        names.iter().all(|name| name[0].word).then_some(Variables { qualifiers, kind, count, names })
    }

    /// Whether a qualifier is there.
    pub fn has(&self, qualifier: &str) -> bool {
        self.qualifiers.iter().any(|token| token.is(qualifier))
    }

    /// Whether they are variables or constants of the stage's own.
    pub fn is_own(&self) -> bool {
        !INTERFACE.iter().any(|qualifier| self.has(qualifier))
    }
}

/// The position of the initialiser of one variable of a declaration.
pub fn initialiser(name: &[Token]) -> Option<usize> {
    // Brackets before it have no `=`.
    name.iter().position(|token| token.is("=")).map(|at| at + 1)
}

#[cfg(test)]
mod tests {
    use super::super::tokens::preprocess;
    use super::*;

    #[test]
    fn declarations_are_found_with_their_parts() {
        let (_, tokens) = preprocess(
            "layout(location = 1) out vec4 c; float f(float x); float a = g(1.0), b[2]; struct S { int i; } s;\n\
             float f(float x) { return x; } const float[2] k = float[2](1.0, 2.0);",
        )
        .expect("tokens");
        let items = items(&tokens);
        let functions: Vec<bool> = items.iter().map(|item| item.function.is_some()).collect();
        assert_eq!(functions, [false, true, false, false, true, false]);
        assert_eq!(items.iter().filter(|item| item.body(&tokens).is_some()).count(), 1);
        let of = |k: usize| Variables::of(&tokens[items[k].whole.clone()]).expect("variables");
        assert!(!of(0).is_own() && of(2).is_own() && of(5).has("const"));
        assert_eq!(of(2).names.iter().map(|name| initialiser(name)).collect::<Vec<_>>(), [Some(2), None]);
        // What names no variable is another thing: a block, or damaged.
        for text in ["uniform B { float a; } b;", "float = 1.0;", "float a, = 1.0;"] {
            assert!(Variables::of(&preprocess(text).expect("tokens").1).is_none(), "{text}");
        }
        assert_eq!((of(3).kind.len(), of(3).names.len(), of(5).count.len()), (7, 1, 3));
    }
}
