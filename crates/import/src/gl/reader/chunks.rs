//! The expanded bytes of a file, a piece at a time: Snappy chunks as apitrace writes them, gzip, Brotli, or plain.

use std::cell::Cell;
use std::io;
use std::io::{BufReader, ErrorKind, Read};
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
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.file.read(buffer)?;
        self.read.set(self.read.get() + count as u64);
        Ok(count)
    }
}

enum Packing {
    Snappy(BufReader<Input>, snap::raw::Decoder),
    /// A stream, and whether it has asked for bytes behind the end of the file.
    Stream(Input, Rc<Cell<bool>>),
}

/// A file that notes when bytes behind its end are asked for.
struct Watched {
    file: Input,
    ended: Rc<Cell<bool>>,
}

impl Read for Watched {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(bytes)?;
        self.ended.set(self.ended.get() || read == 0 && !bytes.is_empty());
        Ok(read)
    }
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
    /// How the end of the file is cut, if it has been reached and `piece` has the bytes before it.
    cut: Option<String>,
    limits: Limits,
}

/// Why there is no next byte. It is one word, so that `Result<u8, Stop>` is returned in registers.
#[derive(Debug)]
pub enum Stop {
    /// The file ends here.
    End,
    /// It cannot be read or expanded.
    ReadError(Box<Failure>),
}

/// Why a file cannot be read further.
#[derive(Debug)]
pub struct Failure {
    /// The reason.
    pub reason: String,
    /// Whether the file is whole up to here and its end is missing.
    pub cut: bool,
}

impl Stop {
    /// The reason why a file is damaged.
    #[cold]
    pub fn broken(reason: impl Into<String>) -> Stop {
        Stop::ReadError(Box::new(Failure { reason: reason.into(), cut: false }))
    }

    /// How the end of a file is cut.
    #[cold]
    pub fn cut(reason: impl Into<String>) -> Stop {
        Stop::ReadError(Box::new(Failure { reason: reason.into(), cut: true }))
    }
}

impl Chunks {
    /// The chunks of an apitrace file; `start` is its first two bytes, which have been read.
    pub fn apitrace(file: Input, start: [u8; 2], limits: &Limits) -> Chunks {
        let (file, read) = counted(file);
        let packing = match start {
            [b'a', b't'] => Packing::Snappy(BufReader::with_capacity(PIECE, file), snap::raw::Decoder::new()),
            [0x1f, 0x8b] => stream(start, file, gzip),
            // Brotli has no magic number.
            _ => stream(start, file, |file| Box::new(Decompressor::new(file, PIECE))),
        };
        Chunks::new(packing, read, limits)
    }

    /// A text, plain or gzip.
    pub fn text(file: Input, start: [u8; 2], limits: &Limits) -> Chunks {
        let (file, read) = counted(file);
        let expand: fn(Input) -> Input = if start == [0x1f, 0x8b] { gzip } else { |file| file };
        Chunks::new(stream(start, file, expand), read, limits)
    }

    fn new(packing: Packing, read: Rc<Cell<u64>>, limits: &Limits) -> Chunks {
        let piece = Vec::new();
        Chunks { packing, packed: Vec::new(), piece, at: 0, before: 0, read, cut: None, limits: *limits }
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
        if let Some(reason) = &self.cut {
            self.piece.clear();
            return Err(Stop::cut(reason));
        }
        let mut room = std::mem::take(&mut self.piece);
        let broken = |what: &str, error: &dyn std::fmt::Display| Stop::broken(format!("{what}: {error}"));
        while self.piece.is_empty() {
            match &mut self.packing {
                Packing::Stream(stream, ended) => {
                    room.clear();
                    if let Err(error) = stream.take(PIECE as u64).read_to_end(&mut room) {
                        // Brotli has no error of its own for an end that is missing.
                        if error.kind() != ErrorKind::UnexpectedEof && !ended.get() {
                            return Err(broken("cannot be expanded", &error));
                        }
                        self.cut = Some("cannot be expanded further: the end of what is compressed is missing".to_owned());
                    }
                }
                Packing::Snappy(file, decoder) => {
                    let mut length = Vec::new();
                    file.take(4).read_to_end(&mut length).map_err(|error| broken("cannot be read", &error))?;
                    let &[a, b, c, d] = &*length else {
                        if length.is_empty() {
                            return Err(Stop::End);
                        }
                        return Err(Stop::cut("ends inside the length of a chunk"));
                    };
                    let length = u32::from_le_bytes([a, b, c, d]) as usize;
                    if length > snap::raw::max_compress_len(CHUNK_MAX) {
                        return Err(Stop::broken(format!("a chunk of {length} bytes, longer than any")));
                    }
                    self.packed.clear();
                    let read = file
                        .take(length as u64)
                        .read_to_end(&mut self.packed)
                        .map_err(|error| broken("cannot be read", &error))?;
                    let cut = (read < length).then(|| format!("ends inside a chunk: {read} of its {length} bytes are there"));
                    if let Some(reason) = cut.as_ref().filter(|_| read < SNAPPY_HEAD) {
                        return Err(Stop::cut(reason));
                    }
                    let expanded = snap::raw::decompress_len(&self.packed).map_err(|error| broken("a Snappy chunk", &error))?;
                    // Three bytes of Snappy expand to 64 at most.
                    if expanded > CHUNK_MAX.min(length.saturating_mul(64)) {
                        return Err(Stop::broken(format!("a Snappy chunk of {length} bytes claims to expand to {expanded}")));
                    }
                    if cut.is_some() {
                        self.cut = cut;
                        room = snappy_start(&self.packed, expanded).map_err(|error| broken("a Snappy chunk", &error))?;
                    } else {
                        // What was there is written over: only what is longer than the piece before is cleared first.
                        room.resize(expanded, 0);
                        let done =
                            decoder.decompress(&self.packed, &mut room).map_err(|error| broken("a Snappy chunk", &error))?;
                        room.truncate(done);
                    }
                }
            }
            if room.is_empty() && (self.cut.is_some() || matches!(self.packing, Packing::Stream(..))) {
                return Err(self.cut.as_ref().map_or(Stop::End, Stop::cut));
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

/// A file whose first two bytes have been read, expanded by a function.
fn stream(start: [u8; 2], file: Input, expand: impl FnOnce(Input) -> Input) -> Packing {
    let ended = Rc::new(Cell::new(false));
    let file = Watched { file: Box::new(io::Cursor::new(start).chain(file)), ended: ended.clone() };
    Packing::Stream(expand(Box::new(file)), ended)
}

fn gzip(file: Input) -> Input {
    Box::new(MultiGzDecoder::new(BufReader::with_capacity(PIECE, file)))
}

/// Bytes of the longest length that a Snappy chunk begins with.
const SNAPPY_HEAD: usize = 5;

/// Expands the start of a Snappy chunk whose end is missing: all elements that are whole, up to the chunk's length.
fn snappy_start(packed: &[u8], length: usize) -> Result<Vec<u8>, &'static str> {
    let mut rest = packed.iter().position(|byte| byte & 0x80 == 0).map_or(&[][..], |last| &packed[last + 1..]);
    let mut out: Vec<u8> = Vec::new();
    while let Some((&tag, behind)) = rest.split_first() {
        // A number of one to four bytes, the lowest first.
        let number = |bytes: usize| {
            let (number, behind) = behind.split_at_checked(bytes)?;
            Some((number.iter().rev().fold(0, |all, &byte| all << 8 | usize::from(byte)), behind))
        };
        let high = usize::from(tag >> 2);
        if tag & 3 == 0 {
            // Bytes that are stored.
            let found = if high < 60 { Some((high, behind)) } else { number(high - 59) };
            let Some((count, behind)) = found else { break };
            let taken = (count + 1).min(behind.len());
            out.extend_from_slice(&behind[..taken]);
            rest = &behind[taken..];
        } else {
            // Bytes that are repeated.
            let found = match tag & 3 {
                1 => number(1).map(|(low, behind)| (4 + (high & 7), (high >> 3) << 8 | low, behind)),
                2 => number(2).map(|(offset, behind)| (high + 1, offset, behind)),
                _ => number(4).map(|(offset, behind)| (high + 1, offset, behind)),
            };
            let Some((count, offset, behind)) = found else { break };
            if offset == 0 || offset > out.len() {
                return Err("repeats bytes before its start");
            }
            for _ in 0..count {
                out.push(out[out.len() - offset]);
            }
            rest = behind;
        }
        if out.len() > length {
            return Err("expands to more than its length");
        }
    }
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Text that repeats near and far, and noise: all kinds of elements.
    fn sample() -> Vec<u8> {
        let mut state = 1_u32;
        let mut noise = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 24) as u8
        };
        let mut bytes: Vec<u8> = (0..3000).map(|_| noise()).collect();
        for k in 0..40 {
            let from = 37 * k;
            bytes.extend_from_within(from..from + 3 + 5 * k);
            bytes.extend((0..k % 7).map(|_| noise()));
        }
        bytes
    }

    #[test]
    fn a_snappy_chunk_that_is_cut_anywhere_has_the_start_of_its_bytes() {
        let whole = sample();
        let packed = snap::raw::Encoder::new().compress_vec(&whole).expect("packed");
        let mut last = 0;
        for cut in SNAPPY_HEAD..packed.len() {
            let start = snappy_start(&packed[..cut], whole.len()).expect("a start");
            assert!(whole.starts_with(&start) && start.len() >= last, "{cut}");
            last = start.len();
        }
        assert_eq!(snappy_start(&packed, whole.len()), Ok(whole.clone()));
        assert_eq!(snappy_start(&packed, whole.len() - 1), Err("expands to more than its length"));
        // A copy from before the start.
        assert_eq!(snappy_start(&[4, 0 << 2, 7, 1, 9], 8), Err("repeats bytes before its start"));
    }

    /// All bytes that can be read, and whether the end is cut.
    fn read(mut chunks: Chunks) -> (Vec<u8>, bool) {
        let mut bytes = Vec::new();
        loop {
            match chunks.byte() {
                Ok(byte) => bytes.push(byte),
                Err(Stop::End) => return (bytes, false),
                Err(Stop::ReadError(failure)) => {
                    assert!(failure.cut, "{}", failure.reason);
                    return (bytes, true);
                }
            }
        }
    }

    #[test]
    fn what_is_compressed_is_read_up_to_where_it_is_cut() {
        use std::io::Write;
        let whole = sample();
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        gzip.write_all(&whole).expect("memory");
        let gzip = gzip.finish().expect("memory");
        let mut chunked = b"at".to_vec();
        for part in whole.chunks(1000) {
            let packed = snap::raw::Encoder::new().compress_vec(part).expect("packed");
            chunked.extend((packed.len() as u32).to_le_bytes());
            chunked.extend(packed);
        }
        for file in [&gzip, &chunked] {
            let open = |end: usize| {
                let (start, rest) = file[..end].split_first_chunk::<2>().expect("two bytes");
                Chunks::apitrace(Box::new(io::Cursor::new(rest.to_vec())), *start, &Limits::default())
            };
            assert_eq!(read(open(file.len())), (whole.clone(), false));
            let mut cuts = 0;
            for end in (3..file.len()).step_by(7) {
                let (start, cut) = read(open(end));
                assert!(whole.starts_with(&start), "{end}");
                cuts += u32::from(cut);
                // Between two chunks nothing is seen to be missing.
                assert!(cut || start.len().is_multiple_of(1000), "{end}");
            }
            assert!(cuts > 100, "{cuts}");
        }
    }

    #[test]
    fn damage_is_no_cut() {
        use std::io::Write;
        let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
        gzip.write_all(&sample()).expect("memory");
        let mut gzip = gzip.finish().expect("memory");
        // The checksum.
        let at = gzip.len() - 7;
        gzip[at] ^= 1;
        let (start, rest) = gzip.split_first_chunk::<2>().expect("two bytes");
        let mut chunks = Chunks::apitrace(Box::new(io::Cursor::new(rest.to_vec())), *start, &Limits::default());
        let wrong = loop {
            match chunks.byte() {
                Ok(_) => {}
                Err(Stop::End) => panic!("the checksum is wrong"),
                Err(Stop::ReadError(failure)) => break failure,
            }
        };
        assert!(!wrong.cut, "{}", wrong.reason);
    }
}

/// What is wrong with a recording, and where.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ReadError {
    /// The number of the call, from 0.
    pub call: u64,
    /// The byte of the expanded stream, or the line of the text.
    pub place: u64,
    /// What is wrong.
    pub reason: String,
}
