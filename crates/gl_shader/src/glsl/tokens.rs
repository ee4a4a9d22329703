//! Source of shaders as tokens, after the preprocessor.

use std::collections::BTreeMap;

use pp_rs::pp::Preprocessor;
use pp_rs::token::{Punct, TokenValue};

use super::Wrong;

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

/// Macros that OpenGL defines for supported extensions.
const EXTENSIONS: [&str; 4] =
    ["GL_ARB_texture_rectangle", "GL_ARB_shader_texture_lod", "GL_EXT_shader_texture_lod", "GL_OES_standard_derivatives"];

/// The tokens of a text after the preprocessor.
pub fn preprocess(text: &str) -> Result<(Dialect, Vec<Token>), Wrong> {
    let dialect = dialect(text);
    let starts: Vec<usize> = text.bytes().enumerate().filter(|&(_, b)| b == b'\n').map(|(at, _)| at + 1).collect();
    let line_of = |at: u32| 1 + starts.partition_point(|&start| start <= at as usize) as u32;
    let mut source = Preprocessor::new(text);
    let version = dialect.version.to_string();
    let mut defines = vec![("__VERSION__", version.as_str())];
    defines.extend(EXTENSIONS.map(|name| (name, "1")));
    if dialect.embedded {
        defines.extend([("GL_ES", "1"), ("GL_FRAGMENT_PRECISION_HIGH", "1")]);
    }
    for (name, value) in defines {
        source.add_define(name, value).map_err(|(error, _)| Wrong::at(1, format!("{name}: {error:?}")))?;
    }
    let (mut tokens, mut line) = (Vec::new(), 1);
    for token in source {
        let token =
            token.map_err(|(error, place)| Wrong::at(line_of(place.start), format!("the preprocessor says {error:?}")))?;
        // Line numbers do not decrease, so printed tokens keep their lines.
        line = line.max(line_of(token.location.start));
        let text = match token.value {
            TokenValue::Ident(name) => name,
            TokenValue::Integer(number) => format!("{}{}", number.value, if number.signed { "" } else { "u" }),
            TokenValue::Float(number) => format!("{:?}", number.value),
            TokenValue::Punct(punct) => mark(punct).to_owned(),
            TokenValue::Version(_) | TokenValue::Extension(_) | TokenValue::Pragma(_) => continue,
        };
        tokens.push(Token::new(text, line));
        if tokens.len() > super::TOKENS_MAX {
            return Err(Wrong::at(line, format!("more than {} tokens", super::TOKENS_MAX)));
        }
    }
    Ok((dialect, tokens))
}

fn mark(punct: Punct) -> &'static str {
    match punct {
        Punct::AddAssign => "+=",
        Punct::SubAssign => "-=",
        Punct::MulAssign => "*=",
        Punct::DivAssign => "/=",
        Punct::ModAssign => "%=",
        Punct::LeftShiftAssign => "<<=",
        Punct::RightShiftAssign => ">>=",
        Punct::AndAssign => "&=",
        Punct::XorAssign => "^=",
        Punct::OrAssign => "|=",
        Punct::Increment => "++",
        Punct::Decrement => "--",
        Punct::LogicalAnd => "&&",
        Punct::LogicalOr => "||",
        Punct::LogicalXor => "^^",
        Punct::LessEqual => "<=",
        Punct::GreaterEqual => ">=",
        Punct::EqualEqual => "==",
        Punct::NotEqual => "!=",
        Punct::LeftShift => "<<",
        Punct::RightShift => ">>",
        Punct::LeftBrace => "{",
        Punct::RightBrace => "}",
        Punct::LeftParen => "(",
        Punct::RightParen => ")",
        Punct::LeftBracket => "[",
        Punct::RightBracket => "]",
        Punct::LeftAngle => "<",
        Punct::RightAngle => ">",
        Punct::Semicolon => ";",
        Punct::Comma => ",",
        Punct::Colon => ":",
        Punct::Dot => ".",
        Punct::Equal => "=",
        Punct::Bang => "!",
        Punct::Minus => "-",
        Punct::Tilde => "~",
        Punct::Plus => "+",
        Punct::Star => "*",
        Punct::Slash => "/",
        Punct::Percent => "%",
        Punct::Pipe => "|",
        Punct::Caret => "^",
        Punct::Ampersand => "&",
        Punct::Question => "?",
    }
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
                // A statement ends with its block, unless `else` follows.
                if token.is("}") && !tokens.get(at + 1).is_some_and(|next| next.is("else")) {
                    open.last_mut().into_iter().for_each(|operators| *operators = 0);
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

/// Number of tokens, with each constant's name counted as its whole value: naga expands constants at each use.
pub fn reach(tokens: &[Token]) -> u64 {
    let mut known: BTreeMap<&str, u64> = BTreeMap::new();
    let mut total = 0_u64;
    // The constant that is declared, and its tokens so far.
    let mut declared: Option<(Option<&str>, u64)> = None;
    for (at, token) in tokens.iter().enumerate() {
        let weight = known.get(token.text.as_str()).copied().unwrap_or(1);
        total = total.saturating_add(weight);
        match &mut declared {
            None if token.is("const") => declared = Some((None, 0)),
            Some((name, sum)) => {
                *sum = sum.saturating_add(weight);
                let named = tokens.get(at + 1).is_some_and(|next| matches!(next.text.as_str(), "=" | "["));
                if name.is_none() && token.word && named {
                    *name = Some(&token.text);
                }
                if token.is(";") {
                    if let Some(name) = name {
                        known.insert(name, *sum);
                    }
                    declared = None;
                }
            }
            None => {}
        }
    }
    total
}

/// Prints tokens, each on its line.
#[cfg(test)]
pub fn print(tokens: &[Token]) -> String {
    lines(tokens).0
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

/// The parts of a list between commas outside of brackets.
pub fn parts(tokens: &[Token]) -> Vec<&[Token]> {
    let (mut list, mut start, mut depth) = (Vec::new(), 0, 0_i32);
    for (at, token) in tokens.iter().enumerate() {
        match token.text.as_str() {
            "(" | "[" | "{" => depth += 1,
            ")" | "]" | "}" => depth -= 1,
            "," if depth == 0 => {
                list.push(&tokens[start..at]);
                start = at + 1;
            }
            _ => {}
        }
    }
    if start < tokens.len() || !list.is_empty() {
        list.push(&tokens[start..]);
    }
    list
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
        assert!(of("void f() { if (a) {} else if (b) {} else if (c) {} }") >= 6);
    }

    #[test]
    fn constants_of_constants_reach_far() {
        let of = |text: &str| reach(&preprocess(text).expect("a text").1);
        assert_eq!(of("const float a = 1.0;\nfloat b = a;"), 6 + 3 + 5 + 1);
        let twice: String = (0..40).map(|k| format!("const T t{} = T(t{k}, t{k});\n", k + 1)).collect();
        assert!(of(&twice) > 1 << 40);
    }

    #[test]
    fn wrong_directives_have_a_place() {
        let wrong = preprocess("float a;\n#nonsense\n").expect_err("no directive");
        assert_eq!(wrong.line, 2);
    }
}
