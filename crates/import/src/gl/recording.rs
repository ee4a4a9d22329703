//! Opens recordings: the calls of a reader run on a machine, and its commands become a trace or a stream.

use std::cell::Cell;
use std::fs::File;
use std::io;
use std::io::Read;
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Mutex, PoisonError};

use host::Links;
use trace::{CommandChunk, Origin, Reading, Stream, Trace, TraceError};

use crate::gl::call::Fault;
use crate::gl::machine::Gl;
use crate::gl::reader::Reader;
use crate::gl::reader::apitrace::Apitrace;
use crate::gl::reader::chunks::{Input, ReadError};
use crate::gl::reader::gli::{GliText, Memory};
use crate::report::{Report, Survey, unsupported};

/// Bytes of GLInterceptor's memory file at most.
const MEMORY_MAX: u64 = 2 << 30;
/// By default, a recording stays in memory up to this number of bytes of commands and payload.
const IN_MEMORY: u64 = 16 << 20;
/// The bytes that may stay in memory, divided by the size of a part of a stream.
const PARTS: u64 = 16;

/// The bytes of one part of a stream, where at most `most` bytes of the stream may stay in memory.
fn part_of(most: u64) -> u64 {
    (most / PARTS).max(1 << 10)
}

/// A trace with what is known of its recording.
pub fn described(trace: Trace, report: Option<&Report>) -> Trace {
    match report {
        Some(report) => trace.with_origin(report.origin()),
        None => trace,
    }
}

/// A recording in a file.
pub struct Recording {
    /// Its file.
    pub path: PathBuf,
    apitrace: bool,
    links: Links,
    /// What is known of it.
    pub reading: Reading,
    frames: Range<u64>,
    /// Bytes of the file.
    length: u64,
    /// See [`Stream::origin`].
    origin: Mutex<Origin>,
}

impl Recording {
    /// A recording in a file.
    pub fn new(path: &Path, apitrace: bool, links: Links, reading: &Reading, frames: Range<u64>) -> Recording {
        // The error of a file that cannot be opened is reported when it is read.
        let (length, origin) = (host::length(path, links).unwrap_or(0), Mutex::default());
        Recording { path: path.to_path_buf(), apitrace, links, reading: *reading, frames, length, origin }
    }

    /// The bytes of commands that may stay in memory.
    pub fn in_memory(&self) -> u64 {
        self.reading.in_memory.unwrap_or(IN_MEMORY)
    }

    /// Notes what is to be said of commands that were made to their end.
    pub fn note(&self, report: Option<Report>) {
        if let Some(report) = report {
            *self.origin.lock().unwrap_or_else(PoisonError::into_inner) = report.origin();
        }
    }

    /// Runs its calls.
    pub fn import(&self, delivery: Delivery<'_>) -> Result<(Option<Trace>, Option<Report>), TraceError> {
        let Recording { path, apitrace, links, reading, frames, .. } = self;
        let fail = |reason: String| TraceError::new(path, reason);
        let mut file = host::open(path, *links).map_err(|error| TraceError::new(path, error))?;
        let mut start = [0; 2];
        file.read_exact(&mut start).map_err(|_| fail("is shorter than the start of a recording".into()))?;
        let read = Rc::new(Cell::new(start.len() as u64));
        let input: Input = Box::new(CountingReader { file, read: read.clone() });
        let memory = if *apitrace { Memory::default() } else { memory_of(path, reading)? };
        import(Opened { path, input, read, start, apitrace: *apitrace, memory }, reading, frames.clone(), delivery)
    }
}

/// A file, and how much of it has been read.
struct CountingReader {
    file: File,
    read: Rc<Cell<u64>>,
}

impl Read for CountingReader {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(bytes)?;
        self.read.set(self.read.get() + read as u64);
        Ok(read)
    }
}

impl Stream for Recording {
    fn make(&self, take: &mut dyn FnMut(CommandChunk) -> ControlFlow<()>) -> Result<(), TraceError> {
        let (_, report) = self.import(Delivery::Parts { part: part_of(self.in_memory()), take })?;
        self.note(report);
        Ok(())
    }

    fn length(&self) -> u64 {
        self.length
    }

    fn origin(&self) -> Origin {
        self.origin.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }
}

/// How commands are delivered.
pub enum Delivery<'a> {
    /// They are kept, unless they take more bytes than `most`: then none are kept, and only the report may be made.
    All {
        /// Bytes.
        most: u64,
        /// Whether the report is made in that case.
        survey: Survey,
        /// Takes them in that case, part by part: the one that was to be kept first.
        longer: Option<Take<'a>>,
    },
    /// They are handed over.
    Parts {
        /// Approximate bytes of a part.
        part: u64,
        /// The function that takes each part.
        take: Take<'a>,
    },
}

/// Takes parts.
type Take<'a> = &'a mut dyn FnMut(CommandChunk) -> ControlFlow<()>;

/// Imports a recording that is in memory; messages use `path` as its name. `memory` has the two files that accompany a text recording.
///
/// # Errors
/// As [`crate::gl::open()`].
pub fn import_bytes(path: &Path, bytes: Vec<u8>, memory: [&[u8]; 2], reading: &Reading) -> Result<(Trace, Report), TraceError> {
    import_frames(path, bytes, memory, reading, 0..u64::MAX)
}

/// Same as [`import_bytes`], for some frames only.
///
/// # Errors
/// As [`crate::gl::open()`].
pub fn import_frames(
    path: &Path,
    bytes: Vec<u8>,
    memory: [&[u8]; 2],
    reading: &Reading,
    frames: Range<u64>,
) -> Result<(Trace, Report), TraceError> {
    let fail = |reason: String| TraceError::new(path, reason);
    let Some((&start, rest)) = bytes.split_first_chunk::<2>() else {
        return Err(fail("is shorter than the start of a recording".into()));
    };
    let apitrace = start != *b"GL";
    let memory = Memory::parse(memory[0], memory[1]).map_err(fail)?;
    let input = Box::new(io::Cursor::new(rest.to_vec()));
    let (trace, report) = import(
        Opened { path, input, read: Rc::default(), start, apitrace, memory },
        reading,
        frames,
        Delivery::All { most: u64::MAX, survey: Survey::Whole, longer: None },
    )?;
    let (Some(trace), Some(report)) = (trace, report) else { return Err(fail("takes more memory than there is".into())) };
    Ok((trace, report))
}

/// A recording whose first two bytes have been read.
struct Opened<'a> {
    path: &'a Path,
    input: Input,
    /// Bytes of the file that have been read.
    read: Rc<Cell<u64>>,
    start: [u8; 2],
    apitrace: bool,
    memory: Memory,
}

/// Imports a recording. Returns the trace if it is kept, and the report if the recording was read to the end of the wanted frames.
fn import(
    opened: Opened<'_>,
    reading: &Reading,
    frames: Range<u64>,
    mut delivery: Delivery<'_>,
) -> Result<(Option<Trace>, Option<Report>), TraceError> {
    let Opened { path, input, read, start, apitrace, memory } = opened;
    let unit = if apitrace { "byte" } else { "line" };
    let broken =
        |broken: ReadError| TraceError::new(path, format!("call {}, {unit} {}: {}", broken.call, broken.place, broken.reason));
    let mut reader = if apitrace {
        Reader::Apitrace(Box::new(Apitrace::open(input, start, &reading.limits).map_err(broken)?))
    } else {
        Reader::Gli(Box::new(GliText::open(input, start, memory, &reading.limits).map_err(broken)?))
    };
    let mut gl = Gl::new(path, &reading.limits);
    gl.card.first_frame = frames.start;
    gl.options.keep_draws = reading.keep_draws;
    (gl.options.elements_omitted, gl.options.as_mesa) = (apitrace, apitrace);
    gl.card.all_levels = reading.keep_draws;
    (gl.card.upward, gl.card.window_alpha) = (reading.upward, reading.window_alpha);
    gl.card.windows.selected = reading.window;
    let (mut kept, mut cut) = (true, None);
    if let Delivery::Parts { .. } = delivery {
        gl.card.recorder.keep_each();
    }
    while gl.card.frames < frames.end {
        let Some(call) = reader.next().map_err(broken)? else {
            if let Some(ReadError { call, place, reason }) = reader.cut() {
                cut = Some(format!("call {call}, {unit} {place}: {reason}"));
            }
            break;
        };
        let wrong = |reason: String| TraceError::new(path, format!("call {}, {unit} {}: {reason}", call.number, call.place));
        if let Some(size) = reader.window()
            && gl.card.windows.drawn().is_some_and(|window| !window.fixed)
            && let Err(Fault::Limit(reason) | Fault::Damaged(reason)) = gl.window(size, true)
        {
            return Err(wrong(reason));
        }
        gl.call(&call).map_err(wrong)?;
        reader.done(call);
        let bytes = gl.card.recorder.bytes();
        match &mut delivery {
            Delivery::All { most, survey, longer } => {
                if bytes > *most {
                    let made = CommandChunk { read: read.get(), ..gl.card.drain() };
                    let refused = !reading.lenient && !gl.log.unsupported.is_empty();
                    if kept && *survey == Survey::Start && !refused {
                        let Some(take) = longer.take() else { return Ok((None, None)) };
                        if take(made).is_break() {
                            return Ok((None, None));
                        }
                        gl.card.recorder.keep_each();
                        delivery = Delivery::Parts { part: part_of(*most), take };
                        continue;
                    }
                    (kept, *most, gl.options.survey) = (false, *most / PARTS, true);
                }
            }
            Delivery::Parts { part, take } => {
                // Commands after an unsupported feature would give wrong pictures. Further unsupported features are still counted.
                gl.options.survey |= !reading.lenient && !gl.log.unsupported.is_empty();
                if bytes > *part {
                    let made = CommandChunk { read: read.get(), ..gl.card.drain() };
                    if !gl.options.survey && take(made).is_break() {
                        return Ok((None, None));
                    }
                }
            }
        }
    }
    // Where the end is cut, what was drawn of the last frame is shown, unless no frame was: such a trace has a frame at its end.
    let ended = if cut.is_some() && gl.card.frames > 0 { gl.show_rest() } else { gl.flush() };
    if let Err(Fault::Limit(reason) | Fault::Damaged(reason)) = ended {
        return Err(TraceError::new(path, reason));
    }
    if let Some(reason) = gl.card.windows.wrong_choice() {
        return Err(TraceError::new(path, reason));
    }
    let mut report = Report { calls: gl.calls(), frames: gl.card.frames, cut, ..Report::default() };
    (report.queries, report.dropped) = (gl.log.queries, gl.card.dropped);
    (report.contexts, report.windows) = (std::mem::take(&mut gl.contexts.facts), gl.card.windows.facts());
    report.shaders = std::mem::take(&mut gl.drawing.texts);
    report.versions = gl.log.versions.iter().map(|(version, ())| version.to_owned()).collect();
    report.unsupported = std::mem::take(&mut gl.log.unsupported);
    report.errors = std::mem::take(&mut gl.log.errors);
    if let Delivery::Parts { take, .. } = delivery {
        if let Some(refusal) = report.refusal().filter(|_| !reading.lenient) {
            return Err(unsupported(path, &refusal));
        }
        gl.card.end_pass();
        // This is the last part.
        let _ = take(CommandChunk { read: read.get(), ..gl.card.drain() });
        return Ok((None, Some(report)));
    }
    let trace = gl.finish().map_err(|fault| TraceError::new(path, format!("{fault:?}")))?;
    Ok((kept.then(|| trace.with_limits(reading.limits)), Some(report)))
}

/// The memory file that accompanies a text recording, if there is one.
fn memory_of(path: &Path, reading: &Reading) -> Result<Memory, TraceError> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut contents = Vec::new();
    for name in ["BufferDescriptors.dat", "MemoryRegions.dat"] {
        let file = folder.join(name);
        if std::fs::symlink_metadata(&file).is_err() {
            return Ok(Memory::default());
        }
        let fail = |error: io::Error| TraceError::new(&file, error);
        let mut bytes = Vec::new();
        host::open(&file, reading.links()).map_err(fail)?.take(MEMORY_MAX + 1).read_to_end(&mut bytes).map_err(fail)?;
        if bytes.len() as u64 > MEMORY_MAX {
            return Err(TraceError::new(&file, format!("is longer than {MEMORY_MAX} bytes")));
        }
        reading.limits.trace_bytes.check(bytes.len() as u64).map_err(|error| TraceError::new(&file, error))?;
        contents.push(bytes);
    }
    Memory::parse(&contents[0], &contents[1]).map_err(|reason| TraceError::new(folder.join("MemoryRegions.dat"), reason))
}
