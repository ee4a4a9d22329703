//! Building a trace in memory: what the recorder and the importers do.

use host::Links;
use num::Limits;
use std::path::{Path, PathBuf};

use super::command::Command;
use super::error::{TextLocation, TraceError};
use super::origin::Origin;
use super::store::{Bytes, Store};
use super::stream::CommandChunk;
use super::{Commands, Trace};

/// A trace in the making: commands in order, and named blobs that may be files of a foreign trace, used where they are.
pub struct Builder {
    file: PathBuf,
    commands: Vec<Command>,
    places: Vec<TextLocation>,
    store: Store,
}

impl Builder {
    /// An empty trace; `file` is what messages about its commands call it: the foreign trace's file, or any name.
    pub fn new(file: impl AsRef<Path>) -> Builder {
        Builder { file: file.as_ref().to_path_buf(), commands: Vec::new(), places: Vec::new(), store: Store::default() }
    }

    /// Appends a command and answers its number. Where other commands have places, it takes that of the command before it.
    #[inline]
    pub fn push(&mut self, command: Command) -> u64 {
        self.places.extend(self.places.last().copied());
        self.commands.push(command);
        self.len() - 1
    }

    /// Appends a command that was read from a place of the trace's file and answers its number.
    pub fn push_at(&mut self, command: Command, place: TextLocation) -> u64 {
        self.places.resize(self.commands.len() + 1, place);
        self.commands.push(command);
        self.len() - 1
    }

    /// Number of commands so far.
    #[inline]
    pub fn len(&self) -> u64 {
        self.commands.len() as u64
    }

    /// Whether there is no command yet.
    pub fn is_empty(&self) -> bool {
        self.commands.is_empty()
    }

    /// Adds a blob: a `Vec<u8>`, or a part of a mapped file. Fails if the name is no plain file name or is taken.
    pub fn add_blob(&mut self, name: &str, bytes: impl Into<Bytes>) -> Result<(), TraceError> {
        self.store.add_bytes(name, bytes.into(), None).map_err(|reason| TraceError::new(&self.file, reason))
    }

    /// Adds a regular file as a blob and answers its length in bytes; it is opened at first use. Fails if it is not there.
    pub fn add_file(&mut self, name: &str, path: impl AsRef<Path>) -> Result<u64, TraceError> {
        self.add_linked_file(name, path.as_ref(), Links::Follow)
    }

    /// As [`Builder::add_file`], with a rule for symbolic links.
    pub fn add_linked_file(&mut self, name: &str, path: &Path, links: Links) -> Result<u64, TraceError> {
        let size = host::length(path, links).map_err(|error| TraceError::new(path, error))?;
        let added = self.store.add_file(name, path.to_path_buf(), links, size, None);
        added.map(|()| size).map_err(|reason| TraceError::new(&self.file, reason))
    }

    /// Whether there is a blob of this name.
    pub fn has_blob(&self, name: &str) -> bool {
        self.store.contains(name)
    }

    /// The bytes of a blob, if they can be read.
    pub(crate) fn blob(&self, name: &str) -> Option<Bytes> {
        self.store.get(&self.file, name).ok()
    }

    /// Takes commands and blobs out. The blobs must be bytes, not files.
    pub fn drain(&mut self) -> CommandChunk {
        self.places.clear();
        CommandChunk { commands: std::mem::take(&mut self.commands), blobs: self.store.take_ready(), read: 0 }
    }

    /// The trace.
    pub fn finish(self) -> Trace {
        let commands = Commands::List(self.commands, self.places);
        Trace { file: self.file, commands, store: self.store, limits: Limits::default(), origin: Origin::default() }
    }
}
