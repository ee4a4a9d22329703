//! Text from elsewhere, made harmless for a terminal: control characters are shown, not sent.

use std::borrow::Cow;
use std::fmt::{self, Write};
use std::io;
use std::path::Path;

/// Whether a terminal obeys a character rather than showing it: controls (C0, DEL, C1), characters that change the direction of text, and
/// those that end lines or have no width.
pub fn is_obeyed(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{61c}' | '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
        || matches!(c, '\u{e0000}'..='\u{e007f}')
}

/// A name or label on one line: everything that [`is_obeyed`] is written as in a Rust string.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, |_| false)
}

/// A path on one line.
pub fn path_line(path: &Path) -> String {
    one_line(&path.to_string_lossy()).into_owned()
}

/// As [`one_line`], with ends of lines and tabs left as they are: for text that is laid out in lines.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, is_layout)
}

fn is_layout(c: char) -> bool {
    matches!(c, '\n' | '\t')
}

fn escaped(text: &str, keep: impl Fn(char) -> bool) -> Cow<'_, str> {
    let escape = |c: char| is_obeyed(c) && !keep(c);
    if !text.contains(escape) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        if escape(c) { out.extend(c.escape_default()) } else { out.push(c) }
    }
    Cow::Owned(out)
}

/// Why a text in RON cannot be read. The reader's own word on nesting is for those who program with it.
pub fn ron_reason(error: &ron::Error) -> String {
    match error {
        ron::Error::ExceededRecursionLimit => "it is nested deeper than 128 levels, which is fixed".to_owned(),
        other => other.to_string(),
    }
}

/// A text of at most about `most` bytes: the beginning and the end of a longer text, since messages name the remedy last.
pub fn excerpt(text: &str, most: usize) -> Cow<'_, str> {
    if text.len() <= most {
        return Cow::Borrowed(text);
    }
    let boundary = |at: usize, step: isize| {
        let mut at = at;
        while !text.is_char_boundary(at) {
            at = at.saturating_add_signed(step);
        }
        at
    };
    let (head, tail) = (boundary(most / 4 * 3, -1), boundary(text.len() - most / 4, 1));
    Cow::Owned(format!("{} [{} bytes left out] {}", &text[..head], tail - head, &text[tail..]))
}

/// A place to print to: what is written through it is made [`printable`].
pub struct Fence<W> {
    out: W,
    result: io::Result<()>,
}

impl<W: io::Write> Fence<W> {
    /// Prints text to `out`.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn print(out: W, text: fmt::Arguments<'_>) -> io::Result<()> {
        let mut fence = Fence { out, result: Ok(()) };
        let written = fence.write_fmt(text);
        fence.result?;
        written.map_err(|_| io::Error::other("a text cannot be formatted"))
    }
}

impl<W: io::Write> Write for Fence<W> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.result = self.out.write_all(printable(text).as_bytes());
        if self.result.is_ok() { Ok(()) } else { Err(fmt::Error) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_obeys_is_shown() {
        let hostile = "a\x1b]0;owned\x07\x1b[2J\u{9b}31m\u{202e}b\u{2028}\x7f";
        let shown = "a\\u{1b}]0;owned\\u{7}\\u{1b}[2J\\u{9b}31m\\u{202e}b\\u{2028}\\u{7f}";
        assert_eq!(one_line(hostile), shown);
        assert_eq!(one_line("two\nlines\tand a \r"), "two\\nlines\\tand a \\r");
        assert_eq!(printable("two\nlines\tand a \r"), "two\nlines\tand a \\r");
        assert!(matches!(one_line("Würfel 立方体 …"), Cow::Borrowed(_)));
        let mut out = Vec::new();
        Fence::print(&mut out, format_args!("{hostile}\n")).expect("a vector takes it");
        assert_eq!(out, format!("{shown}\n").as_bytes());
    }

    #[test]
    fn long_texts_keep_their_beginning_and_end() {
        let text = format!("file: {}: remedy", "ä".repeat(1000));
        let short = excerpt(&text, 101);
        assert!(short.len() < 140 && short.starts_with("file: ä") && short.ends_with("ä: remedy"), "{short}");
        assert!(short.contains("bytes left out"));
        assert_eq!(excerpt("short", 5), "short");
    }
}
