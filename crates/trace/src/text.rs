//! The text of a trace: a RON value `Trace(version: 1, files: {...}, commands: [...])`, read one command at a time.

use std::cell::Cell;
use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use ron::extensions::Extensions;
use serde::de::{DeserializeSeed, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Serialize};

use super::VERSION;
use super::command::Command;
use super::error::{TextLocation, TraceError};
use host::ron_reason;
use num::Limits;

/// What a trace says of one of its files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct FileEntry {
    pub size: u64,
    pub hash: blake3::Hash,
}

/// The form of [`FileEntry`] in the text.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, rename = "File")]
pub(super) struct WrittenEntry {
    pub size: u64,
    pub hash: String,
}

/// Everything before the commands.
#[derive(Default)]
pub(super) struct Header {
    pub files: BTreeMap<String, FileEntry>,
}

impl Header {
    /// Checks what the files and the text of the commands need together, before any of the files is read.
    pub fn check(&self, file: &Path, text: u64, limits: &Limits) -> Result<(), TraceError> {
        let fail = |error| TraceError::new(file, error);
        limits.trace_files.check(self.files.len() as u64).map_err(fail)?;
        let bytes = self.files.values().fold(text, |sum, entry| sum.saturating_add(entry.size));
        limits.trace_bytes.check(bytes).map_err(fail)
    }
}

/// The dialect: an optional value is written as the value itself.
pub(super) fn dialect() -> ron::Options {
    ron::Options::default().with_default_extension(Extensions::IMPLICIT_SOME)
}

/// What a reader of commands wants next.
pub(super) enum Next {
    Continue,
    Stop,
}

/// Takes each command and its number. No type parameter: the reader of fifty commands is compiled once, in this package.
pub(super) type Visit<'a> = &'a mut dyn FnMut(u64, Command) -> Next;

/// Reads the header only.
pub(super) fn read_header(file: &Path, text: &str) -> Result<Header, TraceError> {
    let mut header = Header::default();
    let stopped = Cell::new(false);
    let number = Cell::new(None);
    let document = Document { header: Some(&mut header), commands: None, number: &number, stopped: &stopped };
    finish(file, text, dialect().from_str_seed(text, document), &stopped, &number)?;
    Ok(header)
}

/// Calls `visit` with each command and its number, until it asks to stop. Never holds more than one command.
pub(super) fn read_commands(file: &Path, text: &str, visit: Visit<'_>) -> Result<(), TraceError> {
    let stopped = Cell::new(false);
    let number = Cell::new(None);
    let document = Document { header: None, commands: Some(visit), number: &number, stopped: &stopped };
    finish(file, text, dialect().from_str_seed(text, document), &stopped, &number)
}

/// What came of a piece of the commands.
pub(super) enum Piece {
    /// It was read; the number of the command behind it.
    Read(u64),
    /// The visitor stopped.
    Stopped,
}

/// Calls `visit` with each command of a list and its number, from that of the first on; nothing where the list is wrong.
pub(super) fn read_piece(list: &[u8], first: u64, visit: Visit<'_>) -> Option<Piece> {
    let (stopped, number) = (Cell::new(false), Cell::new(Some(first)));
    let mut behind = first;
    let mut each = |index: u64, command: Command| {
        behind = index + 1;
        visit(index, command)
    };
    let commands = Commands { visit: Some(&mut each), first, number: &number, stopped: &stopped };
    let read = dialect().from_str_seed(std::str::from_utf8(list).ok()?, commands);
    if stopped.get() {
        return Some(Piece::Stopped);
    }
    read.ok().map(|()| Piece::Read(behind))
}

/// Whether a trace may end so behind its commands.
pub(super) fn ends_with(end: &[u8]) -> bool {
    let Ok(end) = std::str::from_utf8(end) else { return false };
    let (stopped, number) = (Cell::new(false), Cell::new(None));
    let mut none = |_, _| Next::Continue;
    let document = Document { header: None, commands: Some(&mut none), number: &number, stopped: &stopped };
    dialect().from_str_seed(&format!("Trace(version: {VERSION}, files: {{}}, commands: []{end}"), document).is_ok()
}

/// The place of a command: for messages only, as it reads the text up to there.
pub(super) fn place_of(text: &str, wanted: u64) -> Option<TextLocation> {
    let stopped = Cell::new(false);
    let number = Cell::new(None);
    let mut stop_before = |index: u64, _: Command| if index + 1 >= wanted { Next::Stop } else { Next::Continue };
    // A document without commands stops right after the opening bracket.
    let commands: Option<Visit<'_>> = if wanted > 0 { Some(&mut stop_before) } else { None };
    let document = Document { header: None, commands, number: &number, stopped: &stopped };
    let error = dialect().from_str_seed(text, document).err()?;
    if !stopped.get() {
        return None;
    }
    // What follows are separators and comments, then the command.
    let end = offset_of(text, error.span.end.line, error.span.end.col)?;
    let start = end + skip_blank(&text[end..]);
    let before = &text[..start];
    let line_start = before.rfind('\n').map_or(0, |at| at + 1);
    Some(TextLocation { line: before.matches('\n').count() + 1, column: before[line_start..].chars().count() + 1 })
}

/// Byte offset of a line and column, both from 1.
fn offset_of(text: &str, line: usize, column: usize) -> Option<usize> {
    let mut start = 0;
    for _ in 1..line {
        start += text[start..].find('\n')? + 1;
    }
    let (offset, _) = text[start..].char_indices().chain([(text.len() - start, ' ')]).nth(column.checked_sub(1)?)?;
    Some(start + offset)
}

/// Bytes of white space, comments, the opening bracket and commas before a command.
fn skip_blank(text: &str) -> usize {
    let mut rest = text;
    loop {
        let trimmed = rest.trim_start_matches(|c: char| c.is_whitespace() || matches!(c, ',' | '[' | ':'));
        let after = if trimmed.starts_with("//") {
            trimmed.find('\n').map_or("", |end| &trimmed[end..])
        } else if trimmed.starts_with("/*") {
            trimmed.find("*/").map_or("", |end| &trimmed[end + 2..])
        } else {
            return text.len() - trimmed.len();
        };
        rest = after;
    }
}

fn finish(
    file: &Path,
    text: &str,
    result: Result<(), ron::error::SpannedError>,
    stopped: &Cell<bool>,
    number: &Cell<Option<u64>>,
) -> Result<(), TraceError> {
    match result {
        _ if stopped.get() => Ok(()),
        Ok(()) => Ok(()),
        Err(error) => {
            let place = TextLocation { line: error.span.start.line, column: error.span.start.col };
            let reason = match &error.code {
                // The list of all fifty commands would bury the message.
                ron::Error::NoSuchEnumVariant { expected, found, .. } if expected.len() > 30 => {
                    format!("there is no {found:?}")
                }
                code => ron_reason(code),
            };
            let end = offset_of(text, error.span.end.line, error.span.end.col).unwrap_or(text.len());
            let reason = if text[end..].trim().is_empty() {
                format!("the file ends too early: {reason}; a native trace is written whole, so copy or record it again")
            } else {
                reason
            };
            Err(TraceError { place: Some(place), command: number.get(), ..TraceError::new(file, reason) })
        }
    }
}

/// Reads the whole document: header into `header`, commands through `commands` (none: stops there).
struct Document<'a> {
    header: Option<&'a mut Header>,
    commands: Option<Visit<'a>>,
    number: &'a Cell<Option<u64>>,
    stopped: &'a Cell<bool>,
}

impl<'de> DeserializeSeed<'de> for Document<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_struct("Trace", &["version", "files", "commands"], self)
    }
}

#[derive(Deserialize)]
#[serde(field_identifier, rename_all = "snake_case")]
enum Field {
    Version,
    Files,
    Commands,
}

impl<'de> Visitor<'de> for Document<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("Trace(version: 1, files: {...}, commands: [...])")
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<(), A::Error> {
        // The order is fixed: a reader learns the version before anything that could have changed with it, and the files before
        // the commands that use them.
        match map.next_key::<Field>()? {
            Some(Field::Version) => {}
            _ => return Err(A::Error::custom("a trace starts with its version")),
        }
        let version: u64 = map.next_value()?;
        if version != u64::from(VERSION) {
            let reason = format!("the trace has format version {version}, this program reads version {VERSION}");
            return Err(A::Error::custom(reason));
        }
        match map.next_key::<Field>()? {
            Some(Field::Files) => {}
            _ => return Err(A::Error::custom("`files` must follow the version")),
        }
        let Files(files) = map.next_value()?;
        if let Some(header) = self.header {
            header.files = files;
        }
        match map.next_key::<Field>()? {
            Some(Field::Commands) => {}
            _ => return Err(A::Error::custom("`commands` must follow the files")),
        }
        map.next_value_seed(Commands { visit: self.commands, first: 0, number: self.number, stopped: self.stopped })?;
        match map.next_key::<Field>()? {
            None => Ok(()),
            Some(_) => Err(A::Error::custom("nothing may follow the commands")),
        }
    }
}

struct Files(BTreeMap<String, FileEntry>);

impl<'de> Deserialize<'de> for Files {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Files, D::Error> {
        struct FilesVisitor;
        impl<'de> Visitor<'de> for FilesVisitor {
            type Value = Files;

            fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
                f.write_str("a map from file names to (size: BYTES, hash: \"BLAKE3\")")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Files, A::Error> {
                let mut files = BTreeMap::new();
                while let Some(name) = map.next_key::<String>()? {
                    super::store::check_name(&name).map_err(A::Error::custom)?;
                    let entry: WrittenEntry = map.next_value()?;
                    let hash = blake3::Hash::from_hex(&entry.hash)
                        .map_err(|_| A::Error::custom(format!("the hash of {name:?} is not 64 hexadecimal digits")))?;
                    if files.insert(name.clone(), FileEntry { size: entry.size, hash }).is_some() {
                        return Err(A::Error::custom(format!("file {name:?} is listed twice")));
                    }
                }
                Ok(Files(files))
            }
        }
        deserializer.deserialize_map(FilesVisitor)
    }
}

struct Commands<'a> {
    visit: Option<Visit<'a>>,
    /// The number of the first.
    first: u64,
    number: &'a Cell<Option<u64>>,
    stopped: &'a Cell<bool>,
}

impl<'de> DeserializeSeed<'de> for Commands<'_> {
    type Value = ();

    fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<(), D::Error> {
        deserializer.deserialize_seq(self)
    }
}

impl<'de> Visitor<'de> for Commands<'_> {
    type Value = ();

    fn expecting(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str("a list of commands")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<(), A::Error> {
        // An error is the only way out of the middle of a document; `stopped` tells it from a real one.
        let stop = || {
            self.stopped.set(true);
            Err(A::Error::custom("stopped by the reader"))
        };
        let Some(visit) = self.visit else { return stop() };
        for index in self.first.. {
            self.number.set(Some(index));
            match seq.next_element::<Command>()? {
                Some(command) => {
                    if let Next::Stop = visit(index, command) {
                        return stop();
                    }
                }
                None => break,
            }
        }
        self.number.set(None);
        Ok(())
    }
}
