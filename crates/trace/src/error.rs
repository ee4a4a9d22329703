//! What is wrong with a trace, and where.

use std::fmt;
use std::path::{Path, PathBuf};

/// A place in a text file; both count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TextLocation {
    /// Line.
    pub line: usize,
    /// Column, in characters.
    pub column: usize,
}

/// Why a trace cannot be used. Displays as `file:line:column: command N: reason`, without the parts that are not known, and with
/// control characters escaped.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TraceError {
    /// The file that is wrong: the trace's text or one of its blobs.
    pub file: PathBuf,
    /// The place in that file.
    pub place: Option<TextLocation>,
    /// Number of the command in the trace, from 0.
    pub command: Option<u64>,
    /// What is wrong.
    pub reason: String,
    /// Whether the file is right, and asks for what this program does not have.
    pub unsupported: bool,
}

impl TraceError {
    /// An error about a whole file.
    pub fn new(file: impl AsRef<Path>, reason: impl fmt::Display) -> TraceError {
        TraceError {
            file: file.as_ref().to_path_buf(),
            place: None,
            command: None,
            reason: reason.to_string(),
            unsupported: false,
        }
    }

    /// An error about a file that is right, and asks for what this program does not have.
    pub fn unsupported(file: impl AsRef<Path>, reason: impl fmt::Display) -> TraceError {
        TraceError { unsupported: true, ..TraceError::new(file, reason) }
    }

    /// The same error at a place of its file.
    pub fn at(mut self, place: Option<TextLocation>) -> TraceError {
        self.place = place;
        self
    }

    /// The same error in the command of this number. What is not supported is so of the whole file.
    pub fn in_command(mut self, index: u64) -> TraceError {
        self.command = Some(index).filter(|_| !self.unsupported);
        self
    }
}

impl fmt::Display for TraceError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&host::path_line(&self.file))?;
        if let Some(place) = self.place {
            write!(f, ":{}:{}", place.line, place.column)?;
        }
        if let Some(command) = self.command {
            write!(f, ": command {command}")?;
        }
        write!(f, ": {}", host::printable(&self.reason))
    }
}

impl std::error::Error for TraceError {}
