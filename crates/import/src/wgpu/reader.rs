//! Reads a wgpu trace's list of actions one by one, each with its place in the file.
//!
//! The RON reader gets one action at a time. So at most one action is in memory, and every error can name its place.

use std::path::Path;

use host::ron_reason;
use num::nearest;
use trace::{TextLocation, TraceError};

use super::schema::{self, Action, Wrong};
use crate::detect::{block_comment, trivia};

/// Reads actions.
pub struct Reader<'a> {
    file: &'a Path,
    text: &'a str,
    /// Bytes read.
    at: usize,
    /// Place of `at`.
    place: TextLocation,
    /// Actions read.
    count: u64,
    /// Where the text ends without the end of the list.
    cut: Option<Cut>,
}

/// The end of a recording whose program was killed: the list has no `]`.
#[derive(Clone, Debug)]
pub struct Cut {
    /// Where the first action begins that is not there, or not whole.
    pub place: TextLocation,
    /// Its number.
    pub number: u64,
    /// Its name, if a part of it is there.
    pub half: Option<String>,
}

/// One action.
pub struct Step<'a> {
    /// Number of the action in the file, from 0.
    pub number: u64,
    /// Name of its variant.
    pub name: &'a str,
    /// Where it begins.
    pub place: TextLocation,
    /// The action.
    pub action: Action,
    /// The lines of the commands in it that do work ([`Command::does_work`](trace::command::Command::does_work)), in order.
    pub lines: Vec<u64>,
}

impl<'a> Reader<'a> {
    /// Begins the list.
    pub fn new(file: &'a Path, bytes: &'a [u8]) -> Result<Reader<'a>, TraceError> {
        let text = match std::str::from_utf8(bytes) {
            Ok(text) => text,
            Err(error) => {
                let good = std::str::from_utf8(&bytes[..error.valid_up_to()]).unwrap_or("");
                if error.error_len().is_some() {
                    let place = advance(TextLocation { line: 1, column: 1 }, good);
                    return Err(TraceError::new(file, "is not UTF-8 text").at(Some(place)));
                }
                // The text ends inside a character.
                good
            }
        };
        let mut reader = Reader { file, text, at: 0, place: TextLocation { line: 1, column: 1 }, count: 0, cut: None };
        reader.skip_trivia();
        if !reader.take('[') {
            return Err(reader.error("expected `[`, the beginning of a list of actions"));
        }
        Ok(reader)
    }

    /// The next action; none after the end of the list, or of the text.
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
            self.cut = Some(Cut { place: self.place, number: self.count, half: None });
            return Ok(None);
        }
        let (number, place) = (self.count, self.place);
        let name = &rest[..rest.find(|c: char| !c.is_ascii_alphanumeric()).unwrap_or(rest.len())];
        let (action, read) = match schema::action(rest) {
            Ok(read) => read,
            Err(Wrong { read, .. }) if is_last(rest) && last_token(rest).is_some_and(|token| read >= token) => {
                let half = (!name.is_empty()).then(|| name.to_owned());
                self.cut = Some(Cut { place, number, half });
                return Ok(None);
            }
            Err(Wrong { error: found, .. }) => {
                // The span is relative to the action.
                let at = found.span.end;
                let column = if at.line == 1 { place.column + at.col - 1 } else { at.col };
                let place = TextLocation { line: place.line + at.line - 1, column };
                let reason = format!("action {number} ({name}): {}", reason(&found.code));
                return Err(TraceError::new(self.file, reason).at(Some(place)));
            }
        };
        let lines = match action {
            Action::Submit(..) | Action::CreateRenderBundle { .. } => working_lines(&rest[..read], place.line as u64),
            _ => Vec::new(),
        };
        self.advance(read);
        self.count += 1;
        self.skip_trivia();
        if !self.take(',') && !self.text[self.at..].starts_with(']') && self.at < self.text.len() {
            return Err(self.error(format!("expected `,` or `]` after action {number} ({name})")));
        }
        Ok(Some(Step { number, name, place, action, lines }))
    }

    /// Where the text ends without the end of the list, once [`Reader::step`] has come to its end.
    pub fn cut(&self) -> Option<&Cut> {
        self.cut.as_ref()
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

/// Whether an action that does not end is the last: the recorder begins each on a line of its own, and the list ends with one. What else does not
/// end is damaged.
fn is_last(rest: &str) -> bool {
    let begins = |line: &str| line.starts_with(|c: char| c.is_ascii_uppercase());
    let mut lines = rest.lines();
    lines.next().is_some_and(begins) && !lines.any(|line| line == "]" || begins(line))
}

/// Where the last token begins, in a text that ends inside the action at its beginning: a word, a string, a comment, or nothing at all. What can be
/// read before it is a part of an action that was whole. None if the action ends.
fn last_token(rest: &str) -> Option<usize> {
    let bytes = rest.as_bytes();
    let (mut at, mut depth, mut token, mut opened) = (0, 0u32, 0, false);
    while at < bytes.len() {
        let next = bytes.get(at + 1).copied();
        match bytes[at] {
            b'(' | b'[' | b'{' => {
                (depth, opened) = (depth + 1, true);
                token = at + 1;
            }
            b')' | b']' | b'}' => {
                depth = depth.saturating_sub(1);
                if depth == 0 {
                    return None;
                }
                token = at + 1;
            }
            b',' | b':' | b' ' | b'\t' | b'\n' | b'\r' => token = at + 1,
            b'/' if next == Some(b'/') => {
                at += rest[at..].find('\n')?;
                token = at + 1;
            }
            b'/' if next == Some(b'*') => {
                let Some(length) = block_comment(&rest[at..]) else { return Some(at) };
                at += length - 1;
                token = at + 1;
            }
            b'"' => {
                let Some(length) = string(&rest[token..at], &rest[at..]) else { return Some(token) };
                at += length - 1;
            }
            _ => {}
        }
        at += 1;
    }
    (depth > 0 || !opened).then_some(token)
}

/// Commands of a wgpu trace that become one that does work each.
const WORKING: [&str; 15] = [
    "CopyBufferToBuffer",
    "CopyBufferToTexture",
    "CopyTextureToBuffer",
    "CopyTextureToTexture",
    "ClearBuffer",
    "ClearTexture",
    "ResolveQuerySet",
    "RunRenderPass",
    "Draw",
    "DrawIndexed",
    "DrawIndirect",
    "MultiDrawIndirectCount",
    "DispatchWorkgroups",
    "DispatchWorkgroupsIndirect",
    "ExecuteBundle",
];

/// The lines of the commands that do work in the text of an action, which begins in line `line`.
fn working_lines(text: &str, mut line: u64) -> Vec<u64> {
    let bytes = text.as_bytes();
    let (mut at, mut token, mut lines) = (0, 0, Vec::new());
    let count = |text: &str| text.bytes().filter(|&byte| byte == b'\n').count() as u64;
    while at < bytes.len() {
        let rest = &text[at..];
        let length = match bytes[at] {
            b'/' if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            b'/' if rest.starts_with("/*") => block_comment(rest).unwrap_or(rest.len()),
            b'"' => string(&text[token..at], rest).unwrap_or(rest.len()),
            byte if byte.is_ascii_alphabetic() => {
                token = at;
                let length = rest.find(|c: char| !c.is_ascii_alphanumeric() && c != '_').unwrap_or(rest.len());
                // A family of draws has the name of a command, and no fields.
                let behind = &rest[length..];
                let has_fields = behind[trivia(behind)..].starts_with('(');
                let name = &rest[..length];
                if has_fields && WORKING.contains(&name) {
                    lines.push(line);
                }
                length
            }
            _ => {
                token = at + 1;
                rest.chars().next().map_or(1, char::len_utf8)
            }
        };
        line += count(&rest[..length]);
        at += length;
    }
    lines
}

/// Length of the string at the beginning of a text, with its quotes, behind what makes it a raw one; none if it does not end.
fn string(before: &str, text: &str) -> Option<usize> {
    if let Some(hashes) = before.strip_prefix('r') {
        let end = format!("\"{hashes}");
        return Some(1 + text[1..].find(&end)? + end.len());
    }
    let bytes = text.as_bytes();
    let mut at = 1;
    while *bytes.get(at)? != b'"' {
        at += if bytes[at] == b'\\' { 2 } else { 1 };
    }
    Some(at + 1)
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
fn advance(place: TextLocation, text: &str) -> TextLocation {
    match text.rfind('\n') {
        None => TextLocation { line: place.line, column: place.column + text.chars().count() },
        Some(last) => {
            let lines = text.bytes().filter(|&byte| byte == b'\n').count();
            TextLocation { line: place.line + lines, column: text[last + 1..].chars().count() + 1 }
        }
    }
}
