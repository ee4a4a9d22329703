//! Writing a native trace: the same trace gives the same bytes, in a folder and in an archive.

use std::cell::Cell;
use std::fs::{self, File};
use std::io::{self, BufWriter, Seek, SeekFrom, Write};
use std::path::Path;
use std::rc::Rc;

use ron::ser::PrettyConfig;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, DateTime, System, ZipWriter};

use super::command::Command;
use super::error::TraceError;
use super::text::dialect;
use super::{COMMANDS_FILE, Trace, VERSION};

/// Stored entries start at multiples of this many bytes, so that a mapped blob is as well aligned as one in its own file.
const ALIGNMENT: u16 = 64;

/// Longest command that is kept on one line, in bytes.
const LINE_MAX: usize = 120;

/// How the files of an archive are kept.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Packing {
    /// As they are: used without a copy.
    Stored,
    /// Deflated: smaller, inflated at first use.
    Deflated,
}

/// Writes a trace as a folder, which is created if need be. Files of the same name are replaced, others stay; a trace may be
/// written over itself, as a file is complete before it takes the place of the old one.
pub fn write(trace: &Trace, folder: impl AsRef<Path>) -> Result<(), TraceError> {
    write_folder(trace, folder.as_ref())
}

fn write_folder(trace: &Trace, folder: &Path) -> Result<(), TraceError> {
    whole(trace)?;
    fs::create_dir_all(folder).map_err(|error| TraceError::new(folder, error))?;
    for name in trace.blob_names() {
        let bytes = trace.blob(name)?;
        replace(&folder.join(name), |file| Ok(file.write_all(&bytes)?))?;
    }
    replace(&folder.join(COMMANDS_FILE), |file| write_commands(trace, file))
}

/// Refuses a trace whose blobs are gone before they are written.
fn whole(trace: &Trace) -> Result<(), TraceError> {
    if trace.is_stream() {
        return Err(TraceError::new(trace.file(), "is read as a stream (`Reading::in_memory`), which cannot be written"));
    }
    Ok(())
}

/// Writes a trace as one zip archive.
pub fn write_zip(trace: &Trace, path: impl AsRef<Path>, packing: Packing) -> Result<(), TraceError> {
    replace(path.as_ref(), |file| pack(trace, file, packing))
}

/// Writes a trace as one zip archive to any place; `name` is what messages call it.
pub fn write_archive(trace: &Trace, name: &Path, out: impl Write + Seek, packing: Packing) -> Result<(), TraceError> {
    pack(trace, out, packing).map_err(|failure| failure.at(name))
}

fn pack(trace: &Trace, out: impl Write + Seek, packing: Packing) -> Result<(), Failure> {
    whole(trace)?;
    let failure = Rc::default();
    let mut archive = ZipWriter::new(Quiet { out, at: 0, failure: Rc::clone(&failure) });
    let check = || failure.take().map_or(Ok(()), Err);
    // Neither the time nor the host may show in the bytes.
    let method = match packing {
        Packing::Stored => CompressionMethod::Stored,
        Packing::Deflated => CompressionMethod::Deflated,
    };
    let options = SimpleFileOptions::default()
        .compression_method(method)
        .last_modified_time(DateTime::default())
        .system(System::Unix)
        .unix_permissions(0o644)
        .with_alignment(if packing == Packing::Stored { ALIGNMENT } else { 1 });
    archive.start_file(COMMANDS_FILE, options).map_err(io::Error::from)?;
    write_commands(trace, &mut archive)?;
    for name in trace.blob_names() {
        let bytes = trace.blob(name)?;
        let large = bytes.len() as u64 >= u64::from(u32::MAX);
        archive.start_file(name, options.large_file(large)).map_err(io::Error::from)?;
        archive.write_all(&bytes)?;
        check()?;
    }
    archive.finish().map_err(io::Error::from)?;
    Ok(check()?)
}

/// Where an archive is written to. The library's writer, dropped after a failure, writes about it on the standard error: so it learns of
/// none, and the first is kept here.
struct Quiet<W> {
    out: W,
    /// The position, also after a failure.
    at: u64,
    failure: Rc<Cell<Option<io::Error>>>,
}

impl<W> Quiet<W> {
    /// What an operation answers, or `otherwise` if it fails.
    fn quiet<T>(&self, result: io::Result<T>, otherwise: T) -> T {
        result.unwrap_or_else(|error| {
            // The first failure counts.
            let first = self.failure.take().unwrap_or(error);
            self.failure.set(Some(first));
            otherwise
        })
    }
}

impl<W: Write> Write for Quiet<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let written = self.out.write_all(bytes);
        self.quiet(written, ());
        self.at += bytes.len() as u64;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let flushed = self.out.flush();
        self.quiet(flushed, ());
        Ok(())
    }
}

impl<W: Seek> Seek for Quiet<W> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        let there = match to {
            SeekFrom::Start(at) => at,
            SeekFrom::Current(by) | SeekFrom::End(by) => self.at.saturating_add_signed(by),
        };
        let sought = self.out.seek(to);
        self.at = self.quiet(sought, there);
        Ok(self.at)
    }
}

/// What can go wrong while a file is written.
enum Failure {
    Trace(TraceError),
    Io(io::Error),
}

impl Failure {
    fn at(self, path: &Path) -> TraceError {
        match self {
            Failure::Trace(error) => error,
            Failure::Io(error) => TraceError::new(path, format!("cannot be written: {error}")),
        }
    }
}

impl From<TraceError> for Failure {
    fn from(error: TraceError) -> Failure {
        Failure::Trace(error)
    }
}

impl From<io::Error> for Failure {
    fn from(error: io::Error) -> Failure {
        Failure::Io(error)
    }
}

/// Writes a file of a trace: complete, or not at all.
fn replace(path: &Path, fill: impl FnOnce(&mut BufWriter<File>) -> Result<(), Failure>) -> Result<(), TraceError> {
    host::replace(path, fill).map_err(|failure| failure.at(path))
}

/// Writes the text, a command at a time.
fn write_commands(trace: &Trace, out: &mut dyn Write) -> Result<(), Failure> {
    writeln!(out, "Trace(\n    version: {VERSION},\n    files: {{")?;
    for name in trace.blob_names() {
        let bytes = trace.blob(name)?;
        writeln!(out, "        {name:?}: (size: {}, hash: \"{}\"),", bytes.len(), blake3::hash(&bytes).to_hex())?;
    }
    writeln!(out, "    }},\n    commands: [")?;
    let mut line = String::new();
    trace.for_each_command(|index, command| -> Result<(), Failure> {
        line.clear();
        print(command, &mut line).map_err(|error| trace.error_at(index, format!("cannot be written: {error}")))?;
        line.push_str(",\n");
        Ok(out.write_all(line.as_bytes())?)
    })?;
    Ok(writeln!(out, "    ],\n)")?)
}

/// Appends a command: on one line, or as an indented block if that would be long.
fn print(command: &Command, out: &mut String) -> Result<(), ron::Error> {
    let style = PrettyConfig::new().new_line("\n").compact_arrays(true);
    let mut text = dialect().to_string_pretty(command, style.clone().depth_limit(0))?;
    if text.len() > LINE_MAX {
        text = dialect().to_string_pretty(command, style.depth_limit(2).indentor("    "))?;
    }
    // RON announces an extension that is on; here the format itself says so.
    let text = text.strip_prefix("#![enable(implicit_some)]").unwrap_or(&text).trim_start();
    for (index, line) in text.lines().enumerate() {
        out.push_str(if index == 0 { "        " } else { "\n        " });
        out.push_str(line);
    }
    Ok(())
}
