//! Source of shaders as tokens, after the preprocessor.

use std::collections::BTreeMap;

/// A token.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Token {
    /// How it is written.
    pub text: String,
    /// Whether it is a name or a keyword.
    pub word: bool,
    /// Its line, from 1.
    pub line: u32,
}

impl Token {
    /// A token of this text on this line.
    pub fn new(text: impl Into<String>, line: u32) -> Token {
        let text = text.into();
        let word = text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_');
        Token { text, word, line }
    }

    /// Whether it is written so.
    pub fn is(&self, text: &str) -> bool {
        self.text == text
    }
}

/// A shader's dialect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Dialect {
    /// The number after `#version`; 110 if there is none.
    pub version: u32,
    /// Whether it is that of OpenGL ES.
    pub embedded: bool,
}

/// The dialect that a text states. Only white space and comments may come before it.
pub fn dialect(text: &str) -> Dialect {
    let mut rest = text;
    loop {
        rest = rest.trim_start();
        if let Some(comment) = rest.strip_prefix("//") {
            rest = comment.split_once('\n').map_or("", |(_, after)| after);
        } else if let Some(comment) = rest.strip_prefix("/*") {
            rest = comment.split_once("*/").map_or("", |(_, after)| after);
        } else {
            break;
        }
    }
    let mut words = match rest.strip_prefix('#').map(str::trim_start).and_then(|rest| rest.strip_prefix("version")) {
        Some(rest) => rest.lines().next().unwrap_or("").split_whitespace(),
        None => "".split_whitespace(),
    };
    let version = words.next().and_then(|word| word.parse().ok()).unwrap_or(110);
    Dialect { version, embedded: version == 100 || words.next() == Some("es") }
}

/// The tokens of a text after the preprocessor, within the default limits.
#[cfg(test)]
pub fn preprocess(text: &str) -> Result<(Dialect, Vec<Token>), super::Wrong> {
    super::preprocess::preprocess(text, &num::Limits::default())
}

/// Maximum nesting of tokens in brackets, operators and `else`: the parser recurses for each level.
pub fn nesting(tokens: &[Token]) -> u64 {
    // For each open bracket: operators since the last separator.
    let (mut open, mut outside, mut deepest) = (vec![0_u64], 0_u64, 0);
    for (at, token) in tokens.iter().enumerate() {
        let operators = open.last_mut().expect("the outermost level stays");
        match token.text.as_str() {
            "(" | "[" | "{" => {
                outside += *operators + 1;
                open.push(0);
            }
            ")" | "]" | "}" => {
                if open.len() > 1 {
                    open.pop();
                    outside -= open.last().copied().unwrap_or(0) + 1;
                }
                // An index is an operator. A statement ends with its block, unless `else` follows.
                let ended = token.is("}") && !tokens.get(at + 1).is_some_and(|next| next.is("else"));
                if let Some(operators) = open.last_mut() {
                    *operators = if ended { 0 } else { *operators + u64::from(token.is("]")) };
                }
            }
            ";" | "," => *operators = 0,
            // A branch without a block, and one after a block.
            "else" | "if" | "for" | "while" | "do" | "?" => *operators += 1,
            text if !token.word && !text.starts_with(|c: char| c.is_ascii_digit()) => *operators += 1,
            _ => {}
        }
        deepest = deepest.max(outside + open.last().copied().unwrap_or(0));
    }
    deepest
}

/// Maximum nesting of blocks, and of statements that are bodies without one. WGSL has at most 127 blocks inside each other; naga indents what is
/// inside of them, so that its text grows with the square of their depth.
pub fn blocks(tokens: &[Token]) -> u64 {
    // For each open bracket: statements since the last separator, and how many it added.
    let (mut open, mut outside, mut deepest) = (vec![(0_u64, 0_u64)], 0, 0);
    for (at, token) in tokens.iter().enumerate() {
        let (statements, _) = *open.last().expect("the outermost level stays");
        match token.text.as_str() {
            "(" | "[" => open.push((0, 0)),
            "{" => {
                let added = statements.max(1);
                outside += added;
                open.push((0, added));
            }
            ")" | "]" | "}" if open.len() > 1 => outside -= open.pop().map_or(0, |(_, added)| added),
            _ => {}
        }
        let statements = &mut open.last_mut().expect("the outermost level stays").0;
        match token.text.as_str() {
            ";" => *statements = 0,
            // A statement ends with its block, unless `else` follows.
            "}" if !tokens.get(at + 1).is_some_and(|next| next.is("else")) => *statements = 0,
            "if" | "for" | "while" | "do" => *statements += 1,
            _ => {}
        }
        deepest = deepest.max(outside + *statements);
    }
    deepest
}

/// What each token stands for: the name of a constant for its whole value, and the name of a structure for all of its members. Naga expands
/// constants at each use, and asks of each part of a structure, and of the parts of those, what it is.
fn weights(tokens: &[Token]) -> Vec<u64> {
    let mut known: BTreeMap<&str, u64> = BTreeMap::new();
    let mut weights = Vec::with_capacity(tokens.len());
    // What is declared, its tokens so far, and the mark that ends it; and what the members of one declaration have each.
    let mut declared: Option<(Option<&str>, u64, &str)> = None;
    let mut each = 0_u64;
    for (at, token) in tokens.iter().enumerate() {
        let weight = known.get(token.text.as_str()).copied().unwrap_or(1);
        weights.push(weight);
        match &mut declared {
            None if token.is("const") => declared = Some((None, 0, ";")),
            None if token.is("struct") => {
                let name = tokens.get(at + 1).filter(|name| name.word);
                declared = Some((name.map(|name| name.text.as_str()), 0, "}"));
            }
            Some((name, sum, end)) => {
                match token.text.as_str() {
                    "{" | ";" => each = 0,
                    "," => *sum = sum.saturating_add(each),
                    _ => each = each.saturating_add(weight),
                }
                *sum = sum.saturating_add(weight);
                let named = tokens.get(at + 1).is_some_and(|next| matches!(next.text.as_str(), "=" | "["));
                if name.is_none() && token.word && named {
                    *name = Some(&token.text);
                }
                if token.is(end) {
                    if let Some(name) = name {
                        known.insert(name, *sum);
                    }
                    declared = None;
                }
            }
            None => {}
        }
    }
    weights
}

/// Number of tokens, with constants and structures written out.
pub fn reach(tokens: &[Token]) -> u64 {
    weights(tokens).into_iter().fold(0, u64::saturating_add)
}

/// Pairs of tokens of one function, for all functions together, with constants and structures written out: for each expression that it reads,
/// naga goes over those that the function has so far. Each function begins with an expression for each variable outside of functions.
pub fn pairs(tokens: &[Token]) -> u64 {
    let weights = weights(tokens);
    // Tokens, and what they stand for: of each function, and of all that stands outside.
    let (mut functions, mut outside): (Vec<[u64; 2]>, [u64; 2]) = Default::default();
    let (mut current, mut depth, mut blocks) = ([0_u64; 2], 0_u64, false);
    for (token, weight) in tokens.iter().zip(weights) {
        current = [current[0] + 1, current[1].saturating_add(weight)];
        match token.text.as_str() {
            "{" => (depth, blocks) = (depth + 1, true),
            "}" => depth = depth.saturating_sub(1),
            _ => {}
        }
        if depth == 0 && (token.is(";") || token.is("}") && blocks) {
            // A structure and its variables are no function; a mark behind its bracket ends nothing else.
            let [own, all] = std::mem::take(&mut current);
            match std::mem::take(&mut blocks) {
                true => functions.push([own, all]),
                false => outside = [outside[0] + own, outside[1].saturating_add(all)],
            }
        }
    }
    let product = |[own, all]: [u64; 2]| own.saturating_mul(all.saturating_add(outside[1]));
    functions.into_iter().map(product).fold(product([outside[0], 0]), u64::saturating_add)
}

/// Prints tokens, those of one source line on one line; and the source line of each.
pub fn lines(tokens: &[Token]) -> (String, Vec<u32>) {
    let (mut text, mut lines) = (String::new(), Vec::new());
    for token in tokens {
        if lines.last() != Some(&token.line) {
            // Naga counts lines from the first.
            if !lines.is_empty() {
                text.push('\n');
            }
            lines.push(token.line);
        }
        text.push_str(&token.text);
        text.push(' ');
    }
    (text, lines)
}

/// The position of the bracket that closes the one at `open`.
pub fn closing(tokens: &[Token], open: usize) -> Option<usize> {
    let mut depth = 0_u32;
    for (at, token) in tokens.iter().enumerate().skip(open) {
        match token.text.as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => {
                depth = depth.checked_sub(1)?;
                if depth == 0 {
                    return Some(at);
                }
            }
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_dialect_may_stand_behind_comments() {
        let of = |text| {
            let Dialect { version, embedded } = dialect(text);
            (version, embedded)
        };
        assert_eq!(of("void main() {}"), (110, false));
        assert_eq!(of("// one\n/* two */ # version 130\nvoid"), (130, false));
        assert_eq!(of("#version 100\n"), (100, true));
        assert_eq!(of("#version 300 es\n"), (300, true));
    }

    #[test]
    fn tokens_keep_their_lines_and_macros_are_replaced() {
        let (_, tokens) =
            preprocess("#version 120\n#define TWO 2.0\n#if __VERSION__ < 130\nfloat a\n= TWO;\n#endif\n").expect("a text");
        assert_eq!(lines(&tokens), ("float a \n= 2.0 ; ".to_owned(), vec![4, 5]));
        assert_eq!(closing(&[Token::new("(", 1), Token::new("a", 1), Token::new(")", 1)], 0), Some(2));
    }

    #[test]
    fn nesting_is_that_of_brackets_operators_and_branches() {
        let of = |text: &str| nesting(&preprocess(text).expect("a text").1);
        assert_eq!(of("int a = 1; int b = 2;"), 1);
        assert_eq!(of("void f() { if (a) { b(); } if (a) { b(); } }"), 4);
        assert!(of("int a = -(-(-1));") >= 6);
        assert!(of("int a = b[0][0][0];") >= 4);
        assert!(of("void f() { if (a) {} else if (b) {} else if (c) {} }") >= 6);
    }

    #[test]
    fn blocks_are_counted_with_bodies_that_are_none() {
        let of = |text: &str| blocks(&preprocess(text).expect("a text").1);
        assert_eq!(of("void f() { { { } } }"), 3);
        assert_eq!(of("void f() { if (a) { if (b) { c; } } }"), 3);
        assert_eq!(of("void f() { if (a) if (b) c; if (c) d; }"), 3);
        assert_eq!(of("void f() { if (a) { } else if (b) { } else if (c) { } if (d) { } }"), 4);
        assert_eq!(of("void f() { for (a; b; c) for (a; b; c) d; }"), 3);
        assert_eq!(of("void f() { do { a; } while (b); do { } while (c); } void g() { }"), 2);
        assert_eq!(of("} ) ] }"), 0);
    }

    #[test]
    fn constants_of_constants_reach_far() {
        let of = |text: &str| reach(&preprocess(text).expect("a text").1);
        assert_eq!(of("const float a = 1.0;\nfloat b = a;"), 6 + 3 + 5 + 1);
        let twice: String = (0..40).map(|k| format!("const T t{} = T(t{k}, t{k});\n", k + 1)).collect();
        assert!(of(&twice) > 1 << 40);
    }

    #[test]
    fn structures_of_structures_reach_far() {
        let of = |text: &str| reach(&preprocess(text).expect("a text").1);
        assert_eq!(of("struct A { float a; };\nA b;"), 8 + 6 + 2);
        let twice: String = (0..40).map(|k| format!("struct S{} {{ S{k} a; S{k} b; }};\n", k + 1)).collect();
        assert!(of(&twice) > 1 << 40);
        assert!(of(&twice.replace("a; S", "a, b; /*").replace("b; }", "*/ }")) > 1 << 40);
    }

    #[test]
    fn pairs_are_those_of_each_function() {
        let of = |text: &str| pairs(&preprocess(text).expect("a text").1);
        assert_eq!(of("float a; void f() { a; } void g() { }"), 3 * 3 + 8 * (8 + 3) + 6 * (6 + 3));
        assert_eq!(of("const int n = 1; void f() { n; }"), 6 * 6 + 8 * (7 + 5 + 6));
        let statements = |n: usize| of(&format!("void main() {{ {} }}", "x += 1.0; ".repeat(n)));
        assert!(statements(20_000) > 1 << 32 && statements(5_000) < 1 << 29);
    }

    #[test]
    fn wrong_directives_have_a_place() {
        let wrong = preprocess("float a;\n#nonsense\n").expect_err("no directive");
        assert_eq!(wrong.line, 2);
    }
}
