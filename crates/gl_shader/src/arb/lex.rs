//! The lexer of assembly programs.

use std::fmt;

/// A place in a program's text, both from 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ProgramLocation {
    /// Line.
    pub line: u32,
    /// Column, in characters.
    pub column: u32,
}

/// An error in a program, and its place.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Wrong {
    /// The place.
    pub place: ProgramLocation,
    /// The reason.
    pub reason: String,
}

impl fmt::Display for Wrong {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "line {}, column {}: {}", self.place.line, self.place.column, self.reason)
    }
}

/// A word.
#[derive(Clone, Debug, PartialEq)]
pub enum Word {
    /// A name, a keyword or a texture target (`2D`).
    Name(String),
    /// A number, and whether it is written as an integer.
    Number(f32, bool),
    /// A sign.
    Sign(char),
    /// `..`
    Range,
    /// The end of the text.
    End,
}

impl fmt::Display for Word {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Word::Name(name) => write!(f, "`{name:.40}`"),
            Word::Number(number, _) => write!(f, "`{number}`"),
            Word::Sign(sign) => write!(f, "`{sign}`"),
            Word::Range => f.write_str("`..`"),
            Word::End => f.write_str("the end of the text"),
        }
    }
}

/// Splits a text into words; the last one is [`Word::End`].
pub fn words(text: &str) -> Result<Vec<(Word, ProgramLocation)>, Wrong> {
    let characters: Vec<char> = text.chars().collect();
    let mut list = Vec::new();
    let mut place = ProgramLocation { line: 1, column: 1 };
    let mut at = 0;
    while let Some(&c) = characters.get(at) {
        let mut length = 1;
        let rest = &characters[at..];
        let run = |wanted: &dyn Fn(char) -> bool| rest.iter().take_while(|&&c| wanted(c)).count();
        let in_name = |c: char| c.is_ascii_alphanumeric() || matches!(c, '_' | '$');
        match c {
            '\n' => {
                place = ProgramLocation { line: place.line + 1, column: 1 };
                at += 1;
                continue;
            }
            '#' => length = run(&|c| c != '\n'),
            // Texts from memory may end in zeros.
            c if c.is_whitespace() || c == '\0' => {}
            c if c.is_ascii_alphabetic() || matches!(c, '_' | '$') => {
                length = run(&in_name);
                list.push((Word::Name(rest[..length].iter().collect()), place));
            }
            '1'..='3' if matches!(rest.get(1), Some('D' | 'd')) && !rest.get(2).is_some_and(|&c| in_name(c)) => {
                length = 2;
                list.push((Word::Name(rest[..2].iter().collect()), place));
            }
            '.' if rest.get(1) == Some(&'.') => {
                length = 2;
                list.push((Word::Range, place));
            }
            c if c.is_ascii_digit() || c == '.' && rest.get(1).is_some_and(char::is_ascii_digit) => {
                let (number, used, whole) = number(rest);
                length = used;
                let number = number.filter(|number| number.is_finite());
                let number = number.ok_or_else(|| Wrong { place, reason: "a number that is too large".into() })?;
                list.push((Word::Number(number, whole), place));
            }
            '.' | ',' | ';' | '[' | ']' | '{' | '}' | '+' | '-' | '=' => list.push((Word::Sign(c), place)),
            _ => return Err(Wrong { place, reason: format!("{c:?} has no meaning") }),
        }
        at += length;
        place.column += length as u32;
    }
    list.push((Word::End, place));
    Ok(list)
}

/// A number at the start of a text: its value, its length, whether it is written as an integer.
fn number(text: &[char]) -> (Option<f32>, usize, bool) {
    let digits = |from: usize| text[from..].iter().take_while(|c| c.is_ascii_digit()).count();
    let mut end = digits(0);
    let mut whole = true;
    // `0..3` is a range.
    if text.get(end) == Some(&'.') && text.get(end + 1) != Some(&'.') {
        whole = false;
        end += 1;
        end += digits(end);
    }
    if matches!(text.get(end), Some('e' | 'E')) {
        let signed = usize::from(matches!(text.get(end + 1), Some('+' | '-')));
        let exponent = digits((end + 1 + signed).min(text.len()));
        if exponent > 0 {
            whole = false;
            end += 1 + signed + exponent;
        }
    }
    let number: String = text[..end].iter().collect();
    (number.parse().ok(), end, whole)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn words_have_their_places() {
        let list = words("MOV r.x,\n  c[0..3]; # no\n2D 1.5e-1").expect("words");
        let shown: Vec<String> = list.iter().map(|(word, place)| format!("{word}@{}:{}", place.line, place.column)).collect();
        let wanted = "`MOV`@1:1 `r`@1:5 `.`@1:6 `x`@1:7 `,`@1:8 `c`@2:3 `[`@2:4 `0`@2:5 `..`@2:6 `3`@2:8 `]`@2:9 `;`@2:10 `2D`@3:1 \
                      `0.15`@3:4 the end of the text@3:10";
        assert_eq!(shown.join(" "), wanted);
        assert_eq!(words("a ?").expect_err("no word").to_string(), "line 1, column 3: '?' has no meaning");
        assert!(words("1e99").is_err());
    }
}
