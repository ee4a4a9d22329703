//! Floor 1: traces: commands, reader, writer, check, recorder. Versioned.
//!
//! A trace is a folder with `trace.ron` and the files that it names, or a zip archive of that folder:
//!
//! ```text
//! // Comments are allowed everywhere.
//! Trace(
//!     version: 1,
//!     files: {
//!         "positions.bin": (size: 36, hash: "<BLAKE3 of the contents, 64 hexadecimal digits>"),
//!         "triangle.wgsl": (size: 412, hash: "..."),
//!     },
//!     commands: [
//!         CreateBuffer(id: 0, size: 36),
//!         WriteBuffer(id: 0, data: (blob: "positions.bin", size: 36)),
//!         ...
//!     ],
//! )
//! ```
//!
//! Commands are those of [`command::Command`], in execution order. Bulk data is never in the text: commands name byte ranges of
//! the files beside it, which are mapped, not copied. A file is compared with its length and hash when it is first used.
//!
//! An imported trace is the same [`Trace`], with its commands in memory and its blobs where the foreign trace has them.
//!
//! # Example
//!
//! ```
//! use gfx::format::Format;
//! use trace::record::{self, Recorder};
//!
//! // A pass that clears a texture to red, and a present that ends the frame.
//! let mut card = Recorder::new("clear");
//! let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
//! let view = card.create_view(target);
//! drop(card.begin_render_pass([record::clear(view, [1.0, 0.0, 0.0, 1.0])], None));
//! card.present(target);
//!
//! let summary = trace::check(&card.finish())?;
//! assert_eq!((summary.frames, summary.presented), (1, Some([64, 64])));
//! # Ok::<(), trace::TraceError>(())
//! ```

mod archive;
mod archive_end;
mod build;
mod error;
mod geometry;
mod name;
mod objects;
mod origin;
mod pieces;
mod scanner;
mod store;
mod stream;
mod text;
mod write;

pub mod check;
pub mod command;
pub mod record;

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, MutexGuard, PoisonError};

pub use build::Builder;
pub use check::{Checker, Summary, check};
use command::{Command, Data};
pub use error::{TextLocation, TraceError};
pub use geometry::{LinearExtent, copy_block_bytes};
use host::Links;
use num::Limits;
pub use origin::Origin;
use pieces::{CommandSource, Pieces};
use store::Store;
pub use store::check_name;
pub use store::{Bytes, NAME_MAX};
use stream::Landmarks;
pub use stream::{CommandChunk, Stream};
pub use write::{Packing, write, write_archive, write_zip};

/// The version of the format that is written and read.
pub const VERSION: u32 = 1;

/// Name of the file that holds the commands.
pub const COMMANDS_FILE: &str = "trace.ron";

/// A trace: commands in order, and the blobs that they name.
///
/// The files of an open trace are mapped: they must not be changed by others while it is in use.
pub struct Trace {
    /// What messages call it: the file that holds the commands.
    file: PathBuf,
    commands: Commands,
    store: Store,
    limits: Limits,
    origin: Origin,
}

/// How far a trace from elsewhere is trusted.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reading {
    /// What it may ask for.
    pub limits: Limits,
    /// Whether files that symbolic links lead to are read, inside the trace's folder and outside of it.
    pub follow_links: bool,
    /// Whether a foreign trace is taken that asks for what is not supported; that is then left out.
    pub lenient: bool,
    /// Whether draws of a recorded OpenGL program stay as it called them: each for itself, with all components of the attributes that it sends,
    /// and vertices by their indices. Else draws of one state are joined, and only what differs between vertices is kept.
    pub keep_draws: bool,
    /// Whether the rows of a recorded OpenGL program's window are stored as OpenGL numbers them, the lowest first, so that blocks of pixels
    /// are where a card has them that counts so. Its pictures are upside down then.
    pub upward: bool,
    /// Whether the window of a recorded OpenGL program has alpha even if the program does not ask for it.
    pub window_alpha: bool,
    /// The number of the only window of a recorded OpenGL program whose swaps end frames, in the order in which they are first used; none: all
    /// do.
    pub window: Option<u32>,
    /// Bytes of commands and payload up to which a recorded OpenGL program is held in memory, as writing a trace needs; none: 16 MiB. The
    /// commands of a longer one are made while they are read ([`Trace::is_stream`]).
    pub in_memory: Option<u64>,
}

impl Reading {
    /// What symbolic links among the files of the trace mean.
    pub fn links(&self) -> Links {
        if self.follow_links { Links::Follow } else { Links::Refuse }
    }
}

enum Commands {
    /// The text of a native trace, valid UTF-8.
    Text(Bytes),
    /// A long one, which is not in memory.
    Pieces(Pieces),
    /// Commands in memory, and their places in the file that they were read from, if there is one.
    List(Vec<Command>, Vec<TextLocation>),
    /// Commands that are made while they are read, and how far that is.
    Stream(Box<dyn Stream>, Mutex<Landmarks>),
}

impl Trace {
    /// Opens a native trace: its folder, its zip archive, or the `trace.ron` of its folder. Reads the header and checks that all
    /// files are there with the length stated; contents are checked at first use. Only regular files are read. The path itself may be
    /// a symbolic link, the files in the trace's folder may not.
    pub fn open(path: impl AsRef<Path>) -> Result<Trace, TraceError> {
        Trace::open_with(path, &Reading::default())
    }

    /// As [`Trace::open`], with limits and rules for its files other than the default ones.
    pub fn open_with(path: impl AsRef<Path>, reading: &Reading) -> Result<Trace, TraceError> {
        Trace::open_path(path.as_ref(), reading)
    }

    fn open_path(path: &Path, reading: &Reading) -> Result<Trace, TraceError> {
        if path.is_dir() {
            Trace::open_folder(path, &path.join(COMMANDS_FILE), reading.links(), reading)
        } else if path.file_name().is_some_and(|name| name == COMMANDS_FILE) {
            Trace::open_folder(path.parent().unwrap_or(Path::new("")), path, Links::Follow, reading)
        } else {
            let bytes = Bytes::from_file(path).map_err(|error| TraceError::new(path, error))?;
            Trace::open_archive_in(path, bytes, Some(path), &reading.limits)
        }
    }

    /// A trace whose commands are made while they are read; `file` is what messages call it.
    pub fn from_stream(file: impl AsRef<Path>, stream: Box<dyn Stream>, limits: Limits) -> Trace {
        let landmarks = Mutex::new(Landmarks::new(stream.length()));
        Trace {
            file: file.as_ref().to_path_buf(),
            commands: Commands::Stream(stream, landmarks),
            store: Store::default(),
            limits,
            origin: Origin::default(),
        }
    }

    /// Whether commands are made while they are read. Such a trace has a blob only while the commands near it are read, and is not written.
    pub fn is_stream(&self) -> bool {
        matches!(self.commands, Commands::Stream(..))
    }

    /// The share of a stream that had been read when `frames` of its frames had ended, about, as its foremost reader noted it. None for other
    /// traces, and for streams of unknown length.
    pub fn share_of(&self, frames: u64) -> Option<f64> {
        self.landmarks()?.share(frames)
    }

    /// Of a stream, the share that has been read; none as for [`Trace::share_of`].
    pub fn share_read(&self) -> Option<f64> {
        self.landmarks()?.read()
    }

    fn landmarks(&self) -> Option<MutexGuard<'_, Landmarks>> {
        match &self.commands {
            Commands::Stream(_, landmarks) => Some(landmarks.lock().unwrap_or_else(PoisonError::into_inner)),
            Commands::Text(_) | Commands::Pieces(_) | Commands::List(..) => None,
        }
    }

    /// The same trace, replayed within these limits.
    pub fn with_limits(self, limits: Limits) -> Trace {
        Trace { limits, ..self }
    }

    /// The same trace, with what is known of the recording that it was made from.
    pub fn with_origin(self, origin: Origin) -> Trace {
        Trace { origin, ..self }
    }

    /// What is known of the recording that the trace was made from. Of a stream it may be known only when the commands have been read to their
    /// end.
    pub fn origin(&self) -> Origin {
        match &self.commands {
            Commands::Stream(stream, _) if self.origin == Origin::default() => stream.origin(),
            _ => self.origin.clone(),
        }
    }

    /// What the trace may ask for.
    pub fn limits(&self) -> &Limits {
        &self.limits
    }

    /// Opens an archive that is in memory; `name` is what messages call it.
    pub fn open_archive(name: &Path, bytes: Bytes) -> Result<Trace, TraceError> {
        Trace::open_archive_with(name, bytes, &Limits::default())
    }

    /// As [`Trace::open_archive`], within these limits.
    pub fn open_archive_with(name: &Path, bytes: Bytes, limits: &Limits) -> Result<Trace, TraceError> {
        Trace::open_archive_in(name, bytes, None, limits)
    }

    /// Opens an archive that is in memory, or mapped from a file.
    fn open_archive_in(name: &Path, bytes: Bytes, mapped: Option<&Path>, limits: &Limits) -> Result<Trace, TraceError> {
        let mut package = archive::Package::open(name, bytes, limits)?;
        let file = name.join(COMMANDS_FILE);
        let (source, size) = package.commands_source(name, mapped, limits)?;
        let damaged = |error| TraceError::new(name, format!("{COMMANDS_FILE} is damaged: {error}"));
        let (header, commands) = match Pieces::open(&file, source, size).map_err(damaged)? {
            Some((header, pieces)) => (header, Commands::Pieces(pieces)),
            None => {
                let text = package.commands(name)?;
                (text::read_header(&file, check_utf8(&file, &text)?)?, Commands::Text(text))
            }
        };
        header.check(&file, size, limits)?;
        let mut store = Store::default();
        for (blob, entry) in &header.files {
            package.add(name, &mut store, blob, entry)?;
        }
        Ok(Trace { file, commands, store, limits: *limits, origin: Origin::default() })
    }

    /// Opens a trace whose files are in memory: the text of `trace.ron`, and the files that it names; `name` is what messages
    /// call the text.
    pub fn open_files<'a>(
        name: &Path,
        text: impl Into<Bytes>,
        files: impl IntoIterator<Item = (&'a str, Bytes)>,
    ) -> Result<Trace, TraceError> {
        let text = text.into();
        let mut header = text::read_header(name, check_utf8(name, &text)?)?;
        let mut store = Store::default();
        for (blob, bytes) in files {
            let Some(entry) = header.files.remove(blob) else { continue };
            if bytes.len() as u64 != entry.size {
                let reason = format!("blob {blob:?} is {} bytes long, the trace says {}", bytes.len(), entry.size);
                return Err(TraceError::new(name, reason));
            }
            store.add_bytes(blob, bytes, Some(entry.hash)).map_err(|reason| TraceError::new(name, reason))?;
        }
        if let Some(missing) = header.files.keys().next() {
            return Err(TraceError::new(name, format!("file {missing:?} is not there")));
        }
        let (commands, limits) = (Commands::Text(text), Limits::default());
        Ok(Trace { file: name.to_path_buf(), commands, store, limits, origin: Origin::default() })
    }

    /// Opens the trace in a folder; `links` is about the file of its commands.
    fn open_folder(folder: &Path, file: &Path, links: Links, reading: &Reading) -> Result<Trace, TraceError> {
        let limits = reading.limits;
        let fail = |error| TraceError::new(file, error);
        let size = commands_file_size(file, links, &limits)?;
        let (header, commands, size) =
            match Pieces::open(file, CommandSource::File(file.to_owned(), links), size).map_err(fail)? {
                Some((header, pieces)) => (header, Commands::Pieces(pieces), size),
                None => {
                    let text = read_commands_file(file, links, &limits)?;
                    let size = text.len() as u64;
                    (text::read_header(file, check_utf8(file, &text)?)?, Commands::Text(text), size)
                }
            };
        header.check(file, size, &limits)?;
        let mut store = Store::default();
        for (name, entry) in header.files {
            let path = folder.join(&name);
            let gone = |error| TraceError::new(&path, format!("{error}; {} names it under `files`", file.display()));
            let size = host::length(&path, reading.links()).map_err(gone)?;
            if size != entry.size {
                let reason = format!("is {size} bytes long, the trace says {}", entry.size);
                return Err(TraceError::new(&path, reason));
            }
            store
                .add_file(&name, path, reading.links(), size, Some(entry.hash))
                .map_err(|reason| TraceError::new(file, reason))?;
        }
        Ok(Trace { file: file.to_path_buf(), commands, store, limits, origin: Origin::default() })
    }

    /// What messages call the trace: the file that holds its commands.
    pub fn file(&self) -> &Path {
        &self.file
    }

    /// The bytes of a blob, where they lie: nothing is copied. The first call loads and checks it.
    pub fn blob(&self, name: &str) -> Result<Bytes, TraceError> {
        self.store.get(&self.file, name)
    }

    /// A range of a blob.
    pub fn data(&self, data: &Data) -> Result<Bytes, TraceError> {
        let blob = self.blob(&data.blob)?;
        let range = usize::try_from(data.offset).ok().zip(usize::try_from(data.size).ok());
        range.and_then(|(start, size)| blob.slice(start, size)).ok_or_else(|| {
            let (offset, size, length) = (data.offset, data.size, blob.len());
            TraceError::new(&self.file, format!("bytes {offset} + {size} of blob {:?} reach past its {length}", data.blob))
        })
    }

    /// A text blob.
    pub fn text(&self, name: &str) -> Result<String, TraceError> {
        let bytes = self.blob(name)?;
        std::str::from_utf8(&bytes).map(str::to_owned).map_err(|error| {
            let reason = format!("blob {name:?} is not UTF-8 text: byte {} is invalid", error.valid_up_to());
            TraceError::new(&self.file, reason)
        })
    }

    /// Whether there is a blob of this name.
    pub fn has_blob(&self, name: &str) -> bool {
        self.store.contains(name)
    }

    /// Size of a blob in bytes, without reading it.
    pub fn blob_size(&self, name: &str) -> Option<u64> {
        self.store.size(name)
    }

    /// Names of all blobs, in order.
    pub fn blob_names(&self) -> impl Iterator<Item = &str> {
        self.store.names()
    }

    /// Calls `visit` with the number of each command (from 0) and the command, in order, until it breaks or fails. A native trace
    /// is read as a stream: no more than one command is in memory.
    pub fn try_for_each_command<E: From<TraceError>>(
        &self,
        mut visit: impl FnMut(u64, &Command) -> Result<ControlFlow<()>, E>,
    ) -> Result<(), E> {
        match &self.commands {
            Commands::List(commands, _) => {
                for (index, command) in commands.iter().enumerate() {
                    if visit(index as u64, command)?.is_break() {
                        break;
                    }
                }
                Ok(())
            }
            Commands::Stream(stream, landmarks) => {
                let (mut index, mut frames) = (0, 0);
                // What has been visited; an error of the stream comes behind the parts before it.
                let mut parts = |CommandChunk { commands, blobs, read }: CommandChunk| -> Result<ControlFlow<()>, E> {
                    frames += commands.iter().filter(|command| matches!(command, Command::Present { .. })).count() as u64;
                    landmarks.lock().unwrap_or_else(PoisonError::into_inner).pass(frames, read);
                    self.store.with(blobs, || -> Result<ControlFlow<()>, E> {
                        for command in &commands {
                            if visit(index, command)?.is_break() {
                                return Ok(ControlFlow::Break(()));
                            }
                            index += 1;
                        }
                        Ok(ControlFlow::Continue(()))
                    })
                };
                let made = stream::beside(&**stream, &mut parts)?;
                Ok(made.map_err(|error| TraceError::new(&self.file, error))??)
            }
            Commands::Text(text) => {
                let mut failed = None;
                text::read_commands(&self.file, check_utf8(&self.file, text)?, &mut next(visit, &mut failed))?;
                failed.map_or(Ok(()), Err)
            }
            Commands::Pieces(pieces) => {
                let mut failed = None;
                pieces.read(&self.file, &mut next(visit, &mut failed))?;
                failed.map_or(Ok(()), Err)
            }
        }
    }

    /// Calls `visit` with the number of each command (from 0) and the command, in order, until it fails.
    pub fn for_each_command<E: From<TraceError>>(
        &self,
        mut visit: impl FnMut(u64, &Command) -> Result<(), E>,
    ) -> Result<(), E> {
        self.try_for_each_command(|index, command| visit(index, command).map(ControlFlow::Continue))
    }

    /// Whether the trace has at least `frames` frames. Reading stops at the frame with this number, or at a command that cannot be read.
    pub fn presents(&self, frames: u64) -> bool {
        let mut left = frames;
        let counted = self.try_for_each_command(|_, command| -> Result<_, TraceError> {
            left = left.saturating_sub(matches!(command, Command::Present { .. }).into());
            Ok(if left == 0 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        });
        // Who runs the commands meets the error.
        counted.is_ok() && left == 0
    }

    /// An error about the command of this number, with its place in the file. Looks the place up: not for hot paths.
    pub fn error_at(&self, index: u64, reason: impl std::fmt::Display) -> TraceError {
        TraceError::new(&self.file, reason).at(self.place(index)).in_command(index)
    }

    /// Where a command is in the trace's file, if it has one.
    pub fn place(&self, index: u64) -> Option<TextLocation> {
        match &self.commands {
            Commands::List(_, places) => places.get(usize::try_from(index).ok()?).copied(),
            Commands::Stream(..) => None,
            Commands::Text(text) => text::place_of(std::str::from_utf8(text).ok()?, index),
            Commands::Pieces(pieces) => text::place_of(std::str::from_utf8(&pieces.whole(&self.file).ok()?).ok()?, index),
        }
    }
}

/// The bytes of a file that holds the commands of a trace, native or foreign.
///
/// # Errors
/// If it is no regular file, cannot be read, or is longer than all files of a trace may be.
pub fn read_commands_file(file: &Path, links: Links, limits: &Limits) -> Result<Bytes, TraceError> {
    commands_file_size(file, links, limits)?;
    Bytes::read(file, links).map_err(|error| TraceError::new(file, error))
}

fn commands_file_size(file: &Path, links: Links, limits: &Limits) -> Result<u64, TraceError> {
    let size = host::length(file, links).map_err(|error| TraceError::new(file, error))?;
    limits.trace_bytes.check(size).map_err(|error| TraceError::new(file, error))?;
    Ok(size)
}

/// A visitor of commands as the reader of their text takes it: what it fails with is kept for its caller.
fn next<E>(
    mut visit: impl FnMut(u64, &Command) -> Result<ControlFlow<()>, E>,
    failed: &mut Option<E>,
) -> impl FnMut(u64, Command) -> text::Next {
    move |index, command| match visit(index, &command) {
        Ok(ControlFlow::Continue(())) => text::Next::Continue,
        Ok(ControlFlow::Break(())) => text::Next::Stop,
        Err(error) => {
            *failed = Some(error);
            text::Next::Stop
        }
    }
}

/// The hash of a file's contents as the text of a trace states it: BLAKE3, 64 hexadecimal digits.
pub fn hash_of(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

fn check_utf8<'a>(file: &Path, text: &'a [u8]) -> Result<&'a str, TraceError> {
    std::str::from_utf8(text).map_err(|error| {
        let good = String::from_utf8_lossy(&text[..error.valid_up_to()]);
        let line = good.matches('\n').count() + 1;
        let column = good.rsplit('\n').next().map_or(0, |last| last.chars().count()) + 1;
        TraceError::new(file, "is not UTF-8 text").at(Some(TextLocation { line, column }))
    })
}
