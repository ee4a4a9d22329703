//! The commands of a long trace, read from where its text lies some at a time: no more of the text is in memory.
//!
//! A [`Scanner`] finds where commands end, and the reader of the whole text reads those of a piece. What the scanner does not know, and text that
//! is wrong, is left to the reader of the whole text ([`Pieces::whole`]): there it means what it means in a short trace, with the same errors.

use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use flate2::Crc;
use flate2::read::DeflateDecoder;

use super::command::Command;
use super::error::TraceError;
use super::scanner::{Mark, Scanner};
use super::store::Bytes;
use super::text::{self, Header, Next, Piece, Visit};
use host::Links;

/// The largest text, in bytes, that is held in memory.
const WHOLE: u64 = 256 << 10;

/// Bytes that are read at a time.
const READ: usize = 32 << 10;

/// Where the text of a trace lies.
pub(super) enum CommandSource {
    /// A file, which must not change.
    File(PathBuf, Links),
    /// A part of an archive.
    Entry {
        /// What the archive was mapped from, if that is a file.
        file: Option<PathBuf>,
        /// Its bytes.
        archive: Bytes,
        /// Where the entry begins in it, and how many bytes it has there.
        packed: (usize, usize),
        deflated: bool,
        crc: u32,
    },
}

impl CommandSource {
    /// The text from its start.
    fn open(&self) -> io::Result<Box<dyn Read + '_>> {
        let (file, archive, (start, size), deflated) = match self {
            CommandSource::File(path, links) => return Ok(Box::new(host::open(path, *links)?)),
            CommandSource::Entry { file, archive, packed, deflated, .. } => (file, archive, *packed, *deflated),
        };
        let packed: Box<dyn Read> = match file {
            // Not the mapping: its pages that have been read count as memory of this process.
            Some(path) => {
                let mut file = host::open(path, Links::Follow)?;
                file.seek(SeekFrom::Start(start as u64))?;
                Box::new(BufReader::new(file.take(size as u64)))
            }
            None => {
                let bytes = archive.slice(start, size).ok_or_else(|| io::Error::other("reaches outside of the archive"))?;
                Box::new(Cursor::new(bytes))
            }
        };
        Ok(if deflated { Box::new(DeflateDecoder::new(packed)) } else { packed })
    }

    /// What the checksum of the text must be, if it has one.
    fn crc(&self) -> Option<u32> {
        match self {
            CommandSource::File(..) => None,
            CommandSource::Entry { crc, .. } => Some(*crc),
        }
    }
}

/// Text that is read in pieces.
pub(super) struct Pieces {
    source: CommandSource,
    length: u64,
}

impl Pieces {
    /// Reads the header of a long text, and checks that all of it is UTF-8 and has its checksum; nothing where the text is short, or the reader
    /// of the whole text is to tell what it means.
    ///
    /// # Errors
    /// If the text cannot be read.
    pub fn open(file: &Path, source: CommandSource, length: u64) -> io::Result<Option<(Header, Pieces)>> {
        if length <= WHOLE {
            return Ok(None);
        }
        let (mut scanner, mut crc, mut read) = (Scanner::default(), Crc::new(), 0);
        // The header, and whether it has ended; text whose last character is not complete.
        let (mut header, mut begun, mut text) = (Vec::new(), false, Vec::new());
        let (mut reader, mut bytes) = (source.open()?, vec![0; READ]);
        loop {
            let got = some(&mut reader, &mut bytes)?;
            if got == 0 {
                break;
            }
            read += got as u64;
            crc.update(&bytes[..got]);
            text.extend_from_slice(&bytes[..got]);
            let valid = match std::str::from_utf8(&text) {
                Ok(_) => text.len(),
                Err(error) if error.error_len().is_none() => error.valid_up_to(),
                Err(_) => return Ok(None),
            };
            text.drain(..valid);
            for &byte in &bytes[..got] {
                if begun {
                    break;
                }
                add(&mut header, byte)?;
                match scanner.step(byte) {
                    Mark::Begin => begun = true,
                    Mark::Unknown => return Ok(None),
                    Mark::Nothing | Mark::Comma | Mark::End => {}
                }
            }
        }
        let sound = read == length && text.is_empty() && begun && source.crc().is_none_or(|sum| sum == crc.sum());
        let Some(header) = std::str::from_utf8(&header).ok().filter(|_| sound) else { return Ok(None) };
        let header = text::read_header(file, header).ok();
        drop(reader);
        Ok(header.map(|header| (header, Pieces { source, length })))
    }

    /// The whole text.
    ///
    /// # Errors
    /// If it cannot be read, or is not as long as it was.
    pub fn whole(&self, file: &Path) -> Result<Bytes, TraceError> {
        let fail = |error: io::Error| TraceError::new(file, error);
        let mut bytes = Vec::new();
        self.source.open().map_err(fail)?.take(self.length + 1).read_to_end(&mut bytes).map_err(fail)?;
        if bytes.len() as u64 != self.length {
            return Err(TraceError::new(file, "has changed while it was in use"));
        }
        Ok(bytes.into())
    }

    /// Calls `visit` with each command and its number, until it asks to stop.
    ///
    /// # Errors
    /// As the reader of the whole text.
    pub fn read(&self, file: &Path, visit: Visit<'_>) -> Result<(), TraceError> {
        let mut next = 0;
        let mut each = |index: u64, command: Command| {
            next = index + 1;
            visit(index, command)
        };
        if self.in_pieces(&mut each).map_err(|error| TraceError::new(file, error))? {
            return Ok(());
        }
        let text = self.whole(file)?;
        let text = super::check_utf8(file, &text)?;
        text::read_commands(file, text, &mut |index, command| if index < next { Next::Continue } else { visit(index, command) })
    }

    /// Reads piece by piece; whether all was understood, to the end of the text or to where `visit` stops.
    fn in_pieces(&self, visit: Visit<'_>) -> io::Result<bool> {
        let mut reader = self.source.open()?;
        let (mut scanner, mut next, mut begun, mut ended) = (Scanner::default(), 0, false, false);
        // A piece stands in brackets, as a list. Behind the last one follows the end of the text.
        let (mut piece, mut bytes, mut read) = (vec![b'['], vec![0; READ], 0);
        loop {
            let got = some(&mut reader, &mut bytes)?;
            if got == 0 {
                break;
            }
            read += got as u64;
            // Behind the last command that ends in the piece.
            let mut end = None;
            for &byte in &bytes[..got] {
                if begun {
                    add(&mut piece, byte)?;
                }
                match if ended { Mark::Nothing } else { scanner.step(byte) } {
                    Mark::Nothing => {}
                    Mark::Begin => begun = true,
                    Mark::Comma => end = Some(piece.len()),
                    Mark::End => {
                        match text::read_piece(&piece, next, visit) {
                            Some(Piece::Read(_)) => {}
                            Some(Piece::Stopped) => return Ok(true),
                            None => return Ok(false),
                        }
                        piece.clear();
                        (ended, end) = (true, None);
                    }
                    Mark::Unknown => return Ok(false),
                }
            }
            let Some(end) = end else { continue };
            let rest = piece.split_off(end);
            piece.push(b']');
            match text::read_piece(&piece, next, visit) {
                Some(Piece::Read(behind)) => next = behind,
                Some(Piece::Stopped) => return Ok(true),
                None => return Ok(false),
            }
            piece.truncate(1);
            piece.extend_from_slice(&rest);
        }
        Ok(ended && read == self.length && text::ends_with(&piece))
    }
}

/// Adds a byte to what is held: a command, or what lies between two, has any length.
fn add(held: &mut Vec<u8>, byte: u8) -> io::Result<()> {
    if held.len() == held.capacity() {
        let fail = |_| io::Error::new(io::ErrorKind::OutOfMemory, "there is no memory for a part of the text of this length");
        held.try_reserve(1).map_err(fail)?;
    }
    held.push(byte);
    Ok(())
}

/// Reads some bytes; none at the end.
fn some(reader: &mut dyn Read, bytes: &mut [u8]) -> io::Result<usize> {
    loop {
        match reader.read(bytes) {
            Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
            read => return read,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::{COMMANDS_FILE, Trace};

    /// The text of a trace of many commands, longer than what is held in memory.
    fn long(special: &str, end: &str) -> String {
        let mut text =
            "// A (comment] of one line.\nTrace(version: 1, /* two /* deep */ [ */ files: {}, commands: [\n".to_owned();
        for id in 0..12_000 {
            text.push_str(&format!("    CreateBuffer(id: {id}, size: 16, label: \"a \\\"b\\\\\"), // ], é\n"));
            text.push_str(if id == 4000 { special } else { "    /* ** / ) */" });
        }
        text + end
    }

    /// What commands are read, as text, and the error.
    fn read(trace: &Trace, most: u64) -> (Vec<String>, Option<TraceError>) {
        let mut commands = Vec::new();
        let read = trace.try_for_each_command(|index, command| -> Result<_, TraceError> {
            assert_eq!(index, commands.len() as u64);
            commands.push(format!("{command:?}"));
            Ok(if index + 1 == most { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
        });
        (commands, read.err())
    }

    #[test]
    fn pieces_are_read_as_the_whole_text_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join(COMMANDS_FILE);
        let raw = "    CreateBuffer(id: 9000, size: 16, label: r#\"] \"#),\n";
        let wrong = "    CreateBuffer(id: 9000, sized: 16),\n";
        let cases = [
            ("", "])", true),
            ("", "], // The end.\n)\n", true),
            ("", "]) more", false),
            ("", ")", false),
            ("", "", false),
            ("", ", ])", false),
            (raw, "])", true),
            (wrong, "])", false),
            ("    'x',\n", "])", false),
            ("    /* without an end\n", "])", false),
            ("    ],\n", "])", false),
        ];
        for (special, end, right) in cases {
            let text = long(special, end);
            std::fs::write(&file, &text).expect("written");
            let size = text.len() as u64;
            assert!(size > 2 * WHOLE);
            let opened = Pieces::open(&file, CommandSource::File(file.clone(), Links::Follow), size).expect("read");
            assert!(opened.is_some(), "{special:?}, {end:?}");
            let pieces = Trace::open(&file).expect("it opens");
            let whole = Trace::open_files(&file, text.into_bytes(), []).expect("it opens");
            for most in [1, 3000, u64::MAX] {
                let ((found, error), (expected, known)) = (read(&pieces, most), read(&whole, most));
                // One command in front of a comment without an end may be read before that is noticed.
                let more = found.len() - expected.len();
                assert!(found.starts_with(&expected) && more <= usize::from(known.is_some()), "{special:?}, {end:?}: {more}");
                assert_eq!(error, known, "{special:?}, {end:?}, {most}");
                assert_eq!(known.is_none(), right || most < u64::MAX, "{special:?}, {end:?}");
            }
            for index in [0, 3999, 4001] {
                assert_eq!(pieces.place(index), whole.place(index), "command {index}");
            }
        }
    }

    #[test]
    fn a_long_text_that_is_damaged_is_refused_as_a_short_one_is() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join(COMMANDS_FILE);
        let mut text = long("", "])").into_bytes();
        let at = text.len() - 20;
        text[at] = 0xff;
        std::fs::write(&file, &text).expect("written");
        let error = Trace::open(&file).err().expect("refused");
        assert!(error.reason.contains("not UTF-8 text") && error.place.is_some_and(|place| place.line > 6000), "{error}");

        // An archive whose commands have another checksum.
        std::fs::write(&file, long("", "])")).expect("written");
        let trace = Trace::open(&file).expect("it opens");
        for packing in [crate::Packing::Stored, crate::Packing::Deflated] {
            let path = folder.path().join("a.zip");
            crate::write_zip(&trace, &path, packing).expect("written");
            let good = Trace::open(&path).expect("it opens");
            assert!(matches!(good.commands, crate::Commands::Pieces(_)));
            assert!(read(&good, u64::MAX) == read(&trace, u64::MAX));
            let mut bytes = std::fs::read(&path).expect("there");
            let at = bytes.len() / 2;
            bytes[at] ^= 1;
            std::fs::write(&path, &bytes).expect("written");
            let error = Trace::open(&path).err().expect("refused").to_string();
            assert!(error.contains(COMMANDS_FILE), "{error}");
        }
    }

    #[test]
    fn a_file_that_changes_is_an_error() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join(COMMANDS_FILE);
        let text = long("", "])");
        std::fs::write(&file, &text).expect("written");
        let trace = Trace::open(&file).expect("it opens");
        std::fs::write(&file, &text[..text.len() / 2]).expect("written");
        let (commands, error) = read(&trace, u64::MAX);
        assert!(!commands.is_empty() && error.is_some_and(|error| error.reason.contains("has changed")));
    }
}
