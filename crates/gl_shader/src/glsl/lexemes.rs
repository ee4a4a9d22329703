//! Source of shaders as the preprocessor sees it: names, numbers, marks, ends of lines.

use std::rc::Rc;

use super::{TranslateResult, Wrong};

/// What a lexeme is.
#[derive(Clone, Debug, PartialEq)]
pub enum LexemeKind {
    /// A name or a keyword.
    Name(Rc<str>),
    /// A whole number, and whether it has the suffix `u`.
    Whole(u64, bool),
    /// A number with a fraction or an exponent.
    Real(f32),
    /// An operator or a bracket.
    Mark(&'static str),
    /// `#`.
    Hash,
    /// The end of a line.
    NewLine,
    /// Text that is no lexeme. It is an error only where it is not skipped.
    Unknown(Unknown),
}

/// Text that is no lexeme.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unknown {
    /// A character that GLSL does not have outside of comments.
    Character(char),
    /// A number with an incomplete exponent or digits that its base does not have, or that is too large.
    Number,
    /// A number of 16 or 64 bits.
    Width,
}

/// A lexeme and its position.
#[derive(Clone, Debug)]
pub struct Lexeme {
    /// What it is.
    pub kind: LexemeKind,
    /// Its line, from 1.
    pub line: u32,
    /// Whether a blank or a comment stands directly before it.
    pub spaced: bool,
    /// Whether it is the first one of its line.
    pub first: bool,
}

impl Lexeme {
    /// Whether it is this mark.
    pub fn is(&self, mark: &str) -> bool {
        matches!(self.kind, LexemeKind::Mark(own) if own == mark)
    }

    /// How it is written after the preprocessor: whole numbers are decimal.
    pub fn text(&self) -> String {
        match &self.kind {
            LexemeKind::Name(name) => name.to_string(),
            LexemeKind::Whole(value, unsigned) => format!("{value}{}", if *unsigned { "u" } else { "" }),
            LexemeKind::Real(value) => format!("{value:?}"),
            LexemeKind::Mark(mark) => (*mark).to_owned(),
            LexemeKind::Hash => "#".to_owned(),
            LexemeKind::NewLine => "the end of the line".to_owned(),
            LexemeKind::Unknown(Unknown::Character(c)) => c.to_string(),
            LexemeKind::Unknown(_) => "a number".to_owned(),
        }
    }

    /// An error if it is no lexeme of the language.
    pub fn known(self) -> TranslateResult<Lexeme> {
        let reason = match self.kind {
            LexemeKind::Hash => "`#` is neither at the beginning of a line nor an operator that is supported".to_owned(),
            LexemeKind::Unknown(Unknown::Character(c)) => format!("the character {c:?} is not part of the language"),
            LexemeKind::Unknown(Unknown::Number) => "a number that is not well formed, or too large".to_owned(),
            LexemeKind::Unknown(Unknown::Width) => "numbers of 16 or 64 bits are not supported".to_owned(),
            _ => return Ok(self),
        };
        Err(Wrong::at(self.line, reason))
    }
}

/// All marks, longer ones before those that they begin with.
const MARKS: [&str; 46] = [
    "<<=", ">>=", "<<", ">>", "<=", ">=", "==", "!=", "++", "--", "+=", "-=", "*=", "/=", "%=", "&&", "&=", "||", "|=", "^^",
    "^=", "<", ">", "+", "-", "*", "/", "%", "&", "|", "^", "=", "!", "(", ")", "{", "}", "[", "]", ",", ";", ":", "~", "?",
    ".", "\\",
];

/// Reads lexemes one at a time.
pub struct Lexer {
    /// Characters with their lines; a comment is a blank, continued lines are joined.
    chars: Vec<(char, u32)>,
    at: usize,
    first: bool,
}

impl Lexer {
    /// Begins to read a text.
    pub fn new(text: &str) -> TranslateResult<Lexer> {
        Ok(Lexer { chars: without_comments(joined(text))?, at: 0, first: true })
    }

    fn peek(&self) -> Option<char> {
        self.chars.get(self.at).map(|&(c, _)| c)
    }

    /// Takes the next character if it is of a kind.
    fn take(&mut self, kind: impl Fn(char) -> bool) -> Option<char> {
        let c = self.peek().filter(|&c| kind(c))?;
        self.at += 1;
        Some(c)
    }

    fn take_all(&mut self, into: &mut String, kind: impl Fn(char) -> bool) {
        while let Some(c) = self.take(&kind) {
            into.push(c);
        }
    }

    fn number(&mut self) -> LexemeKind {
        let digit = |c: char| c.is_ascii_digit();
        let (mut text, mut base, mut real) = (String::new(), 10, false);
        if self.take(|c| c == '0').is_some() {
            if self.take(|c| matches!(c, 'x' | 'X')).is_some() {
                base = 16;
                self.take_all(&mut text, |c| c.is_ascii_hexdigit());
            } else {
                // `0` alone, an octal number, or a real one that begins with it.
                base = if self.peek().is_some_and(digit) { 8 } else { 10 };
                text.push('0');
            }
        }
        if base != 16 {
            self.take_all(&mut text, digit);
            if self.take(|c| c == '.').is_some() {
                real = true;
                text.push('.');
                self.take_all(&mut text, digit);
            }
            if self.take(|c| matches!(c, 'e' | 'E')).is_some() {
                real = true;
                text.push('e');
                if let Some(sign) = self.take(|c| matches!(c, '+' | '-')) {
                    text.push(sign);
                }
                self.take_all(&mut text, digit);
            }
        }
        let unsigned = !real && self.take(|c| matches!(c, 'u' | 'U')).is_some();
        let wide = if real { ['l', 'L', 'h', 'H'] } else { ['l', 'L', 's', 'S'] };
        if self.take(|c| wide.contains(&c)).is_some() {
            return LexemeKind::Unknown(Unknown::Width);
        }
        if real {
            self.take(|c| matches!(c, 'f' | 'F'));
            return text.parse().map_or(LexemeKind::Unknown(Unknown::Number), LexemeKind::Real);
        }
        u64::from_str_radix(&text, base)
            .map_or(LexemeKind::Unknown(Unknown::Number), |value| LexemeKind::Whole(value, unsigned))
    }
}

impl Iterator for Lexer {
    type Item = Lexeme;

    fn next(&mut self) -> Option<Lexeme> {
        let mut spaced = self.first;
        while self.take(|c| matches!(c, ' ' | '\t' | '\x0b' | '\x0c')).is_some() {
            spaced = true;
        }
        let Some(&(c, line)) = self.chars.get(self.at) else {
            // The last line has an end, too.
            let line = self.chars.last().map_or(1, |&(_, line)| line);
            return (!std::mem::replace(&mut self.first, true)).then_some(Lexeme {
                kind: LexemeKind::NewLine,
                line,
                spaced,
                first: false,
            });
        };
        let first = std::mem::replace(&mut self.first, c == '\n');
        let follows =
            |offset: usize, kind: &dyn Fn(char) -> bool| self.chars.get(self.at + offset).is_some_and(|&(c, _)| kind(c));
        let kind = if c.is_ascii_digit() || c == '.' && follows(1, &|c| c.is_ascii_digit()) {
            self.number()
        } else if c.is_ascii_alphabetic() || c == '_' {
            let mut name = String::new();
            self.take_all(&mut name, |c| c.is_ascii_alphanumeric() || c == '_');
            LexemeKind::Name(name.into())
        } else if let Some(mark) =
            MARKS.into_iter().find(|mark| mark.chars().enumerate().all(|(k, own)| follows(k, &|c| c == own)))
        {
            self.at += mark.len();
            if mark == "\\" { LexemeKind::Unknown(Unknown::Character('\\')) } else { LexemeKind::Mark(mark) }
        } else {
            self.at += 1;
            match c {
                '\n' => LexemeKind::NewLine,
                '#' => LexemeKind::Hash,
                c => LexemeKind::Unknown(Unknown::Character(c)),
            }
        };
        Some(Lexeme { kind, line, spaced, first })
    }
}

/// The characters of a text with their lines. Ends of lines are `\n`, and those after a backslash are left out.
fn joined(text: &str) -> Vec<(char, u32)> {
    let (mut out, mut line) = (Vec::with_capacity(text.len()), 1);
    let mut chars = text.chars().peekable();
    while let Some(c) = chars.next() {
        let pair = match c {
            '\n' => '\r',
            '\r' => '\n',
            _ => {
                out.push((c, line));
                continue;
            }
        };
        chars.next_if_eq(&pair);
        // What a removed end of line leaves joins nothing again.
        match out.last() {
            Some(('\\', at)) if *at == line => drop(out.pop()),
            _ => out.push(('\n', line)),
        }
        line += 1;
    }
    out
}

/// The characters with a blank for each comment.
fn without_comments(chars: Vec<(char, u32)>) -> TranslateResult<Vec<(char, u32)>> {
    let is = |at: usize, c: char| chars.get(at).is_some_and(|&(own, _)| own == c);
    let (mut out, mut at) = (Vec::with_capacity(chars.len()), 0);
    while let Some(&(c, line)) = chars.get(at) {
        let rest = chars.get(at + 2..).unwrap_or(&[]);
        if c == '/' && is(at + 1, '/') {
            at += 2 + rest.iter().position(|&(c, _)| c == '\n').unwrap_or(rest.len());
            out.push((' ', line));
        } else if c == '/' && is(at + 1, '*') {
            let Some(end) = rest.windows(2).position(|pair| pair[0].0 == '*' && pair[1].0 == '/') else {
                return Err(Wrong::at(line, "a comment without an end"));
            };
            at += 2 + end + 2;
            out.push((' ', line));
        } else {
            out.push((c, line));
            at += 1;
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn kinds(text: &str) -> Vec<LexemeKind> {
        Lexer::new(text).expect("a text").map(|lexeme| lexeme.kind).collect()
    }

    fn whole(value: u64) -> LexemeKind {
        LexemeKind::Whole(value, false)
    }

    #[test]
    fn numbers_are_read_in_their_bases() {
        assert_eq!(
            kinds("0 010 0x1Fu 42U 00009.5 1. .5e-3f 1e2 0e1"),
            [
                whole(0),
                whole(8),
                LexemeKind::Whole(31, true),
                LexemeKind::Whole(42, true),
                LexemeKind::Real(9.5),
                LexemeKind::Real(1.0),
                LexemeKind::Real(0.5e-3),
                LexemeKind::Real(100.0),
                LexemeKind::Real(0.0),
                LexemeKind::NewLine
            ]
        );
        for (text, unknown) in
            [("09", Unknown::Number), ("1e", Unknown::Number), ("0x", Unknown::Number), ("1.0lf", Unknown::Width)]
        {
            assert_eq!(kinds(text)[0], LexemeKind::Unknown(unknown), "{text}");
        }
        assert_eq!(kinds("v.x.y0")[1..4], [LexemeKind::Mark("."), LexemeKind::Name("x".into()), LexemeKind::Mark(".")]);
    }

    #[test]
    fn the_longest_mark_is_read() {
        let marks: Vec<LexemeKind> = ["<<=", "<", "<", "-", "--", "^^", "==", "="].map(LexemeKind::Mark).into_iter().collect();
        assert_eq!(kinds("<<=< < - --^^==="), [marks, vec![LexemeKind::NewLine]].concat());
    }

    #[test]
    fn lines_and_comments_are_as_in_the_text() {
        let text = "a\\\nb /* c\n\n*/ d // e \\\n f\r\ng\n\rh\ri";
        let lexemes: Vec<(String, u32, bool)> =
            Lexer::new(text).expect("a text").map(|lexeme| (lexeme.text(), lexeme.line, lexeme.first)).collect();
        let end = "the end of the line";
        let wanted = [("ab", 1, true), ("d", 4, false), (end, 5, false), ("g", 6, true), (end, 6, false)];
        assert_eq!(lexemes[..5], wanted.map(|(text, line, first)| (text.to_owned(), line, first)));
        assert_eq!(
            lexemes[5..].iter().map(|(text, line, _)| (&**text, *line)).collect::<Vec<_>>(),
            [("h", 7), (end, 7), ("i", 8), (end, 8)]
        );
        assert_eq!(Lexer::new("a\n/* b").map(|_| ()).map_err(|wrong| wrong.line), Err(2));
        assert!(kinds("/*/ x */ y").len() == 2);
    }
}
