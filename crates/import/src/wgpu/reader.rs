//! Reads a wgpu trace's list of actions one by one, each with its place in the file.
//!
//! The RON reader gets one action at a time. So at most one action is in memory, and every error can name its place.

use std::path::Path;

use host::ron_reason;
use num::nearest;
use trace::{Place, TraceError};

use wgpu_text::{Action, Wrong};

/// Reads actions.
pub struct Reader<'a> {
    file: &'a Path,
    text: &'a str,
    /// Bytes read.
    at: usize,
    /// Place of `at`.
    place: Place,
    /// Actions read.
    count: u64,
}

/// One action.
pub struct Step<'a> {
    /// Number of the action in the file, from 0.
    pub number: u64,
    /// Name of its variant.
    pub name: &'a str,
    /// Where it begins.
    pub place: Place,
    /// The action.
    pub action: Action,
}

impl<'a> Reader<'a> {
    /// Begins the list.
    pub fn new(file: &'a Path, bytes: &'a [u8]) -> Result<Reader<'a>, TraceError> {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => {
                let good = std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or("");
                let place = advance(Place { line: 1, column: 1 }, good);
                return Err(TraceError::new(file, "is not UTF-8 text").at(Some(place)));
            }
        };
        let mut reader = Reader { file, text, at: 0, place: Place { line: 1, column: 1 }, count: 0 };
        reader.skip_trivia();
        if !reader.take('[') {
            return Err(reader.error("expected `[`, the beginning of a list of actions"));
        }
        Ok(reader)
    }

    /// The next action; none after the end of the list.
    pub fn step(&mut self) -> Result<Option<Step<'a>>, TraceError> {
        self.skip_trivia();
        if self.take(']') {
            self.skip_trivia();
            return if self.at == self.text.len() {
                Ok(None)
            } else {
                Err(self.error("there is text after the end of the list"))
            };
        }
        let rest = &self.text[self.at..];
        if rest.is_empty() {
            let reason = format!(
                "the file ends after {} actions without the closing `]`: truncated, or its recorder was killed",
                self.count
            );
            return Err(self.error(reason));
        }
        let (number, place) = (self.count, self.place);
        let name = &rest[..rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len())];
        let wrong = |Wrong { error: found, ends }| {
            // The span is relative to the action.
            let at = found.span.end;
            let column = if at.line == 1 { place.column + at.col - 1 } else { at.col };
            let place = Place { line: place.line + at.line - 1, column };
            let ends = if ends { ": the file ends inside this action, it is truncated" } else { "" };
            let reason = format!("action {number} ({name}): {}{ends}", reason(&found.code));
            TraceError::new(self.file, reason).at(Some(place))
        };
        let (action, read) = wgpu_text::action(rest).map_err(wrong)?;
        self.advance(read);
        self.count += 1;
        self.skip_trivia();
        if !self.take(',') && !self.text[self.at..].starts_with(']') && self.at < self.text.len() {
            return Err(self.error(format!("expected `,` or `]` after action {number} ({name})")));
        }
        Ok(Some(Step { number, name, place, action }))
    }

    fn skip_trivia(&mut self) {
        let length = trivia(&self.text[self.at..]);
        self.advance(length);
    }

    fn take(&mut self, token: char) -> bool {
        let found = self.text[self.at..].starts_with(token);
        if found {
            self.advance(token.len_utf8());
        }
        found
    }

    fn advance(&mut self, bytes: usize) {
        let end = self.at + bytes;
        self.place = advance(self.place, &self.text[self.at..end]);
        self.at = end;
    }

    fn error(&self, reason: impl std::fmt::Display) -> TraceError {
        TraceError::new(self.file, reason).at(Some(self.place))
    }
}

/// What is wrong with an action. Of up to fifty valid names the message gives only the nearest.
fn reason(error: &ron::Error) -> String {
    let (what, within, expected, found) = match error {
        ron::Error::NoSuchEnumVariant { expected, found, outer } => ("variant", outer, expected, found),
        ron::Error::NoSuchStructField { expected, found, outer } => ("field", outer, expected, found),
        other => return ron_reason(other),
    };
    let within = within.as_ref().map_or(String::new(), |outer| format!(" of {outer}"));
    let nearest =
        nearest(expected.iter().copied(), found).map_or(String::new(), |nearest| format!("; {nearest} is the nearest"));
    format!("there is no {what} {found}{within}{nearest}")
}

/// The place after some text.
fn advance(place: Place, text: &str) -> Place {
    match text.rfind('\n') {
        None => Place { line: place.line, column: place.column + text.chars().count() },
        Some(last) => {
            let lines = text.bytes().filter(|&byte| byte == b'\n').count();
            Place { line: place.line + lines, column: text[last + 1..].chars().count() + 1 }
        }
    }
}

/// Length of the white space and comments at the beginning of a RON text. A comment that does not end is not counted.
pub fn trivia(text: &str) -> usize {
    let mut at = 0;
    loop {
        let rest = &text[at..];
        let blank = rest.len() - rest.trim_start().len();
        at += blank;
        let rest = &rest[blank..];
        let comment = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest).unwrap_or(0)
        } else {
            0
        };
        if comment == 0 {
            return at;
        }
        at += comment;
    }
}

/// Length of the block comment at the beginning, which may hold others.
fn block_comment(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut at, mut depth) = (0, 0u32);
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => depth += 1,
            b"*/" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return Some(at);
        }
    }
    None
}
