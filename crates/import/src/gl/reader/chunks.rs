//! The expanded bytes of a file, a piece at a time: Snappy chunks as apitrace writes them, gzip, Brotli, or plain.

use std::cell::Cell;
use std::io::{BufReader, Read};
use std::rc::Rc;

use brotli_decompressor::Decompressor;
use flate2::read::MultiGzDecoder;
use num::Limits;

/// Maximum number of expanded bytes of a Snappy chunk. apitrace writes chunks of 1 MiB.
const CHUNK_MAX: usize = 64 << 20;

/// Bytes per read if the file has no chunks.
const PIECE: usize = 256 << 10;

/// Where bytes come from: a file, or memory.
pub type Input = Box<dyn Read>;

/// A file, and how many bytes of it have been read.
struct Counted {
    file: Input,
    read: Rc<Cell<u64>>,
}

impl Read for Counted {
    fn read(&mut self, buffer: &mut [u8]) -> std::io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

enum Packing {
    Snappy(BufReader<Input>, snap::raw::Decoder),
    Stream(Input),
}

/// A file that is expanded while it is read. At most one chunk is in memory.
pub struct Chunks {
    packing: Packing,
    packed: Vec<u8>,
    piece: Vec<u8>,
    at: usize,
    /// Expanded bytes before `piece`.
    before: u64,
    /// Bytes of the file that have been read.
    read: Rc<Cell<u64>>,
    limits: Limits,
}

/// Why there is no next byte. It is one word, so that `Result<u8, Stop>` is returned in registers.
#[derive(Debug)]
pub enum Stop {
    /// The file ends here.
    End,
    /// It cannot be read or expanded.
    #[expect(clippy::box_collection, reason = "a text without the box has three words")]
    Broken(Box<String>),
}

impl Stop {
    /// A reason.
    #[cold]
    pub fn broken(reason: impl Into<String>) -> Stop {
        Stop::Broken(Box::new(reason.into()))
    }
}

impl Chunks {
    /// The chunks of an apitrace file; `start` is its first two bytes, which have been read.
    pub fn apitrace(file: Input, start: [u8; 2], limits: &Limits) -> Chunks {
        let (file, read) = counted(file);
        let packing = match start {
            [b'a', b't'] => Packing::Snappy(BufReader::with_capacity(PIECE, file), snap::raw::Decoder::new()),
            [0x1f, 0x8b] => Packing::Stream(gzip(start, file)),
            // Brotli has no magic number.
            _ => Packing::Stream(Box::new(Decompressor::new(std::io::Cursor::new(start).chain(file), PIECE))),
        };
        Chunks::new(packing, read, limits)
    }

    /// A text, plain or gzip.
    pub fn text(file: Input, start: [u8; 2], limits: &Limits) -> Chunks {
        let (file, read) = counted(file);
        let stream: Input = match start {
            [0x1f, 0x8b] => gzip(start, file),
            _ => Box::new(std::io::Cursor::new(start).chain(file)),
        };
        Chunks::new(Packing::Stream(stream), read, limits)
    }

    fn new(packing: Packing, read: Rc<Cell<u64>>, limits: &Limits) -> Chunks {
        Chunks { packing, packed: Vec::new(), piece: Vec::new(), at: 0, before: 0, read, limits: *limits }
    }

    /// Number of the next expanded byte, from 0.
    pub fn offset(&self) -> u64 {
        self.before + self.at as u64
    }

    /// Checks that the limit allows a value of this length.
    pub fn allow(&self, length: u64) -> Result<(), Stop> {
        self.limits.trace_bytes.check(self.offset().saturating_add(length)).map_err(|error| Stop::broken(error.to_string()))
    }

    /// Replaces the piece, which is used up, by the next one.
    #[cold]
    fn refill(&mut self) -> Result<(), Stop> {
        self.before += self.piece.len() as u64;
        self.at = 0;
        let mut room = std::mem::take(&mut self.piece);
        let broken = |what: &str, error: &dyn std::fmt::Display| Stop::broken(format!("{what}: {error}"));
        while self.piece.is_empty() {
            match &mut self.packing {
                Packing::Stream(stream) => {
                    room.clear();
                    stream.take(PIECE as u64).read_to_end(&mut room).map_err(|error| broken("cannot be expanded", &error))?;
                    if room.is_empty() {
                        return Err(Stop::End);
                    }
                }
                Packing::Snappy(file, decoder) => {
                    let mut length = [0; 4];
                    match file.read(&mut length[..1]).map_err(|error| broken("cannot be read", &error))? {
                        0 => return Err(Stop::End),
                        _ => {
                            file.read_exact(&mut length[1..]).map_err(|_| Stop::broken("ends inside the length of a chunk"))?
                        }
                    }
                    let length = u32::from_le_bytes(length) as usize;
                    if length > snap::raw::max_compress_len(CHUNK_MAX) {
                        return Err(Stop::broken(format!("a chunk of {length} bytes, longer than any")));
                    }
                    self.packed.clear();
                    let read = file
                        .take(length as u64)
                        .read_to_end(&mut self.packed)
                        .map_err(|error| broken("cannot be read", &error))?;
                    if read < length {
                        return Err(Stop::broken(format!("ends inside a chunk: {read} of its {length} bytes are there")));
                    }
                    let expanded = snap::raw::decompress_len(&self.packed).map_err(|error| broken("a Snappy chunk", &error))?;
                    // Three bytes of Snappy expand to 64 at most.
                    if expanded > CHUNK_MAX.min(length.saturating_mul(64)) {
                        return Err(Stop::broken(format!("a Snappy chunk of {length} bytes claims to expand to {expanded}")));
                    }
                    // What was there is written over: only what is longer than the piece before is cleared first.
                    room.resize(expanded, 0);
                    let done = decoder.decompress(&self.packed, &mut room).map_err(|error| broken("a Snappy chunk", &error))?;
                    room.truncate(done);
                }
            }
            self.piece = std::mem::take(&mut room);
        }
        let expanded = self.before + self.piece.len() as u64;
        let checked =
            self.limits.trace_bytes.check(expanded).and_then(|()| self.limits.check_expansion(self.read.get(), expanded));
        checked.map_err(|error| Stop::broken(error.to_string()))
    }

    /// The next byte.
    #[inline(always)]
    pub fn byte(&mut self) -> Result<u8, Stop> {
        match self.piece.get(self.at) {
            Some(&byte) => {
                self.at += 1;
                Ok(byte)
            }
            None => self.first_of_next(),
        }
    }

    #[cold]
    fn first_of_next(&mut self) -> Result<u8, Stop> {
        self.refill()?;
        self.at = 1;
        Ok(self.piece[0])
    }

    /// The next bytes, up to the end of the current piece.
    #[inline(always)]
    pub fn here(&self) -> &[u8] {
        &self.piece[self.at..]
    }

    /// Skips bytes of [`Chunks::here`].
    #[inline(always)]
    pub fn pass(&mut self, count: usize) {
        self.at += count;
    }

    /// The next bytes; memory grows only with bytes that are present.
    pub fn bytes(&mut self, length: u64) -> Result<Rc<[u8]>, Stop> {
        self.allow(length)?;
        let end = usize::try_from(length).ok().and_then(|length| self.at.checked_add(length));
        if let Some(here) = end.and_then(|end| self.piece.get(self.at..end)) {
            self.at += here.len();
            return Ok(here.into());
        }
        let mut bytes = Vec::new();
        let mut left = length;
        while left > 0 {
            if self.at == self.piece.len() {
                self.refill()?;
            }
            let part = (left.min((self.piece.len() - self.at) as u64)) as usize;
            bytes.extend_from_slice(&self.piece[self.at..self.at + part]);
            self.at += part;
            left -= part as u64;
        }
        Ok(bytes.into())
    }

    /// Appends the next bytes up to and including the end of a line; returns whether it was found. At the end of the text, appends nothing.
    pub fn line(&mut self, line: &mut Vec<u8>) -> Result<bool, Stop> {
        if self.at == self.piece.len() {
            self.refill()?;
        }
        let rest = &self.piece[self.at..];
        let end = rest.iter().position(|&byte| byte == b'\n').map(|end| end + 1);
        let part = &rest[..end.unwrap_or(rest.len())];
        line.extend_from_slice(part);
        self.at += part.len();
        Ok(end.is_some())
    }

    /// The next `N` bytes.
    #[inline]
    pub fn array<const N: usize>(&mut self) -> Result<[u8; N], Stop> {
        let mut bytes = [0; N];
        if let Some(here) = self.piece.get(self.at..self.at + N) {
            bytes.copy_from_slice(here);
            self.at += N;
        } else {
            for byte in &mut bytes {
                *byte = self.byte()?;
            }
        }
        Ok(bytes)
    }
}

/// The file, and the count of its bytes that are read.
fn counted(file: Input) -> (Input, Rc<Cell<u64>>) {
    let read = Rc::new(Cell::new(0));
    (Box::new(Counted { file, read: read.clone() }), read)
}

fn gzip(start: [u8; 2], file: Input) -> Input {
    Box::new(MultiGzDecoder::new(BufReader::with_capacity(PIECE, std::io::Cursor::new(start).chain(file))))
}
