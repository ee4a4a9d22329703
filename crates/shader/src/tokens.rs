//! The tokens of a WGSL text, in the detail that brackets, operators and names need.

/// A token.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Token<'t> {
    /// A name or a keyword.
    Word(&'t str),
    /// One of `( [ {`.
    Open(char),
    /// One of `) ] }`.
    Close(char),
    /// One of `, ; :`.
    Separator(char),
    /// An operator, `.` and `@` among them.
    Operator(&'t str),
    /// A number, or what is no token.
    Other,
}

/// Tokens with their first bytes. Comments and blanks are left out.
pub(super) struct Tokens<'t> {
    text: &'t str,
    at: usize,
}

impl<'t> Tokens<'t> {
    pub fn new(text: &'t str) -> Tokens<'t> {
        Tokens { text, at: 0 }
    }

    /// Goes over blanks and comments.
    fn skip(&mut self) {
        loop {
            let rest = &self.text[self.at..];
            if rest.starts_with("//") {
                let ends = |c| matches!(c, '\n'..='\r' | '\u{85}' | '\u{2028}' | '\u{2029}');
                self.at += rest.find(ends).unwrap_or(rest.len());
            } else if rest.starts_with("/*") {
                self.comment();
            } else {
                let Some(first) = rest.chars().next().filter(|&c| is_blank(c)) else { return };
                self.at += first.len_utf8();
            }
        }
    }

    /// Goes over a comment in `/*` and `*/`, with those inside it.
    fn comment(&mut self) {
        let bytes = self.text.as_bytes();
        let mut depth = 0u64;
        while self.at < bytes.len() {
            match bytes[self.at..] {
                [b'/', b'*', ..] => {
                    depth += 1;
                    self.at += 2;
                }
                [b'*', b'/', ..] => {
                    depth -= 1;
                    self.at += 2;
                    if depth == 0 {
                        return;
                    }
                }
                _ => self.at += 1,
            }
        }
    }
}

fn is_blank(c: char) -> bool {
    c.is_whitespace() || matches!(c, '\u{200e}' | '\u{200f}')
}

impl<'t> Iterator for Tokens<'t> {
    type Item = (usize, Token<'t>);

    fn next(&mut self) -> Option<Self::Item> {
        self.skip();
        let start = self.at;
        let rest = &self.text[start..];
        let first = rest.chars().next()?;
        // Every character that is not a mark of ASCII may be part of a name.
        let in_name = |c: char| c.is_ascii_alphanumeric() || c == '_' || !(c.is_ascii() || is_blank(c));
        let (length, token) = match first {
            '(' | '[' | '{' => (1, Token::Open(first)),
            ')' | ']' | '}' => (1, Token::Close(first)),
            ',' | ';' | ':' => (1, Token::Separator(first)),
            '0'..='9' => {
                // A dot and a sign after an exponent belong to the number; which letters it has does not matter here.
                let bytes = rest.as_bytes();
                let mut length = 1;
                while let Some(&byte) = bytes.get(length) {
                    let signed = matches!(byte, b'+' | b'-') && matches!(bytes[length - 1], b'e' | b'E' | b'p' | b'P');
                    let exponent = signed && bytes.get(length + 1).is_some_and(u8::is_ascii_digit);
                    let hexadecimal = matches!(bytes[..2.min(length)], [b'0', b'x' | b'X']);
                    let e_is_digit = hexadecimal && matches!(bytes[length - 1], b'e' | b'E');
                    if !(byte.is_ascii_alphanumeric() || byte == b'.' || (exponent && !e_is_digit)) {
                        break;
                    }
                    length += 1;
                }
                (length, Token::Other)
            }
            c if in_name(c) => {
                let length = rest.find(|c| !in_name(c)).unwrap_or(rest.len());
                (length, Token::Word(&rest[..length]))
            }
            '<' | '>' | '=' | '!' | '&' | '|' | '+' | '-' | '*' | '/' | '%' | '^' | '~' | '.' | '@' => {
                // Two of these stand for one operator; a `>` may end a template list, and another one the list around it.
                let pair = rest.get(..2).filter(|pair| matches!(*pair, "&&" | "||" | "==" | "!=" | "<=" | "<<" | "->"));
                let length = pair.map_or(1, str::len);
                (length, Token::Operator(&rest[..length]))
            }
            c => (c.len_utf8(), Token::Other),
        };
        self.at += length;
        Some((start, token))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_fall_apart_into_tokens() {
        let text = "a/* x /* y */ ( */+1.5e-3 // z (\n&&0xe-b{.é} >>";
        let tokens: Vec<Token<'_>> = Tokens::new(text).map(|(_, token)| token).collect();
        let wanted = [
            Token::Word("a"),
            Token::Operator("+"),
            Token::Other,
            Token::Operator("&&"),
            Token::Other,
            Token::Operator("-"),
            Token::Word("b"),
            Token::Open('{'),
            Token::Operator("."),
            Token::Word("é"),
            Token::Close('}'),
            Token::Operator(">"),
            Token::Operator(">"),
        ];
        assert_eq!(tokens, wanted);
        assert_eq!(Tokens::new(text).map(|(at, _)| at).take(3).collect::<Vec<_>>(), [0, 18, 19]);
        assert_eq!(Tokens::new("/* never closed ( ( (").count(), 0);
    }
}
