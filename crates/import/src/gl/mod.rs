//! Converts recorded OpenGL programs to traces: two readers, and one machine for the fixed-function pipeline of OpenGL 1.5, assembly
//! programs ([`arb`]) and GLSL programs ([`glsl`]).
//!
//! The machine holds OpenGL's state. Primitives between two changes of state become one draw. Fixed-function state becomes WGSL, which is
//! generated from a small key ([`gl_shader::key`]), so equal state has one shader and one pipeline. Draws are gathered into passes. A pass
//! ends at a clear, a copy of the framebuffer, a write to a texture that it reads, and the end of the frame.
//!
//! * Buffer objects stay on the card ([`buffers`]). Draws read them from there where the card can ([`resident`]); other draws have their
//!   vertices in buffers of their pass.
//! * Clip space: the matrix maps depths from [-w, w] to [0, w]. The window's origin is at the lower left; the viewport, the scissor and
//!   copies flip rows.
//! * A texture's first row is its lowest in OpenGL, and the first in memory in both, so images are not changed. Only copies of the
//!   framebuffer flip rows.
//! * Framebuffer objects store rows as textures do: positions are flipped instead, and so is the winding of front faces.
//! * In frames that are not wanted, passes that draw to the window are held back until something can read their results. A clear of all
//!   that they write drops them.
//! * The window has no alpha unless the program asks for it: alpha stays 1.
//! * A call that raises an OpenGL error has no effect.
//! * Unsupported features are counted by name, with the first call ([`Report`]); they never give a wrong picture without a message.

mod accumulate;
mod arb;
mod arrays;
mod begun;
mod buffers;
mod call;
mod card;
mod clear;
mod compact;
mod components;
mod contexts;
mod copies;
mod draw;
mod draw_key;
mod elements;
mod environment;
mod evaluator;
mod fixed;
mod fragments;
mod framebuffer;
mod geometry;
mod glsl;
mod idle;
mod image;
mod immediate;
mod indirect;
mod lists;
mod lit;
mod machine;
mod materials;
mod matrix;
mod names;
mod outline;
mod pack;
mod packed;
mod pass;
mod pixel_data;
mod pixels;
mod prepare;
mod primitive;
mod quads;
mod raster;
mod reach;
mod reader;
mod rectangles;
mod resident;
mod restart;
mod s3tc;
mod samplers;
mod saved;
mod state;
mod stipple;
mod summary;
mod table;
mod texture;
mod texturing;
mod transform;
mod uniforms;
mod unpack;
mod window_system;
mod windows;

use std::cell::Cell;
use std::fs::File;
use std::io::{self, Read};
use std::ops::{ControlFlow, Range};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::{Mutex, PoisonError};

use num::NameMap;

use gl_shader::{consts, key};
use host::Links;
use trace::{Origin, Part, Reading, Stream, Trace, TraceError};

use call::Fault;
pub use contexts::ContextFacts;
use machine::Gl;
pub use machine::{Count, Counts};
use reader::{Apitrace, Broken, GliText, Input, Memory, Reader};
pub use windows::WindowFacts;

/// Bytes of GLInterceptor's memory file at most.
const MEMORY_MAX: u64 = 2 << 30;

/// Facts about a recording.
#[derive(Clone, Debug, Default)]
pub struct Report {
    /// Calls by name.
    pub calls: NameMap<u64>,
    /// Frames.
    pub frames: u64,
    /// Features that are not supported.
    pub unsupported: Counts,
    /// Calls that raise an OpenGL error, and so have no effect.
    pub errors: Counts,
    /// Shaders generated from fixed-function state and programs: label and WGSL.
    pub shaders: Vec<(String, String)>,
    /// Uses of occlusion queries.
    pub queries: u64,
    /// Dropped draws of frames that are not wanted, whose results nothing can read.
    pub dropped: u64,
    /// Contexts that the recording makes, in order.
    pub contexts: Vec<ContextFacts>,
    /// Windows and other drawables, in the order in which they are first used.
    pub windows: Vec<WindowFacts>,
    /// How the recording's end is cut, and in which call.
    pub cut: Option<String>,
    /// Versions of OpenGL, with their profiles, as the recorded driver has called them.
    pub versions: Vec<String>,
}

/// Counts on one line, by the first call; none if there are none.
fn listed(counts: &Counts) -> Option<String> {
    let mut all: Vec<(&str, &Count)> = counts.iter().collect();
    all.sort_by_key(|(what, count)| (count.first, *what));
    let one = |(what, count): (&str, &Count)| format!("{what} ({} times, first in call {})", count.times, count.first);
    (!all.is_empty()).then(|| all.into_iter().map(one).collect::<Vec<_>>().join("; "))
}

impl Report {
    /// The unsupported features on one line; none if all are supported.
    pub fn refusal(&self) -> Option<String> {
        listed(&self.unsupported)
    }

    /// The window systems whose functions the program calls.
    pub fn systems(&self) -> Vec<&'static str> {
        const SYSTEMS: [(&str, &str); 4] = [("glX", "GLX"), ("egl", "EGL"), ("wgl", "WGL"), ("CGL", "CGL")];
        let called = |prefix: &str| self.calls.iter().any(|(name, _)| name.starts_with(prefix));
        SYSTEMS.into_iter().filter(|(prefix, _)| called(prefix)).map(|(_, name)| name).collect()
    }

    /// What a trace that was made from the recording says of it.
    pub fn origin(&self) -> Origin {
        let ignored = |list| format!("these calls raise an OpenGL error and have no effect: {list}");
        let whole = "no call swaps buffers: the whole recording is one frame".to_owned();
        let notes = listed(&self.errors).map(ignored).into_iter().chain((self.frames == 0).then_some(whole)).collect();
        let missing = |place: &String| format!("the end of the recording is missing: {place}; the calls before are replayed");
        let mut origin = Origin::default();
        (origin.left_out, origin.cut, origin.notes) = (self.refusal(), self.cut.as_ref().map(missing), notes);
        origin
    }
}

/// By default, a recording stays in memory up to this number of bytes of commands and payload.
const IN_MEMORY: u64 = 16 << 20;
/// The bytes that may stay in memory, divided by the size of a part of a stream.
const PARTS: u64 = 16;

/// The bytes of one part of a stream, where at most `most` bytes of the stream may stay in memory.
fn part_of(most: u64) -> u64 {
    (most / PARTS).max(1 << 10)
}

/// How much is known of a recording before its first command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Survey {
    /// All: the recording is read to its end.
    Whole,
    /// Only facts from its start: a long recording is not read to its end before its first command.
    Start,
}

/// Opens a recording of apitrace or GLInterceptor, with the wanted frames. The recording is read up to the last of them. Of earlier frames,
/// only results that later frames can read are kept. The commands of a long recording are generated again at each reading
/// (`reading.in_memory`). A recording that has not been read to its end has no report: an unsupported feature then ends its commands with
/// an error (`TraceError::unsupported`), or is [left out](Origin::left_out) if `reading.lenient` is set.
///
/// # Errors
/// If it is damaged, or asks for more than a limit allows; with the number of the call and its place.
pub fn open(
    path: &Path,
    apitrace: bool,
    links: Links,
    reading: &Reading,
    frames: Range<u64>,
    survey: Survey,
) -> Result<(Trace, Option<Report>), TraceError> {
    let recording = Recording {
        path: path.to_path_buf(),
        apitrace,
        links,
        reading: *reading,
        frames,
        // The error of a file that cannot be opened is reported below.
        length: host::length(path, links).unwrap_or(0),
        origin: Mutex::default(),
    };
    let most = recording.in_memory();
    // What a long file has for its commands is longer as well: none of them would stay, and all would be read twice.
    let long = || host::open(path, links).and_then(|file| file.metadata()).is_ok_and(|file| file.len() > most);
    if survey == Survey::Start && long() {
        return Ok((Trace::from_stream(path, Box::new(recording), reading.limits), None));
    }
    if survey == Survey::Start {
        return begun::open(recording, most);
    }
    let (trace, report) = recording.import(Keep::All { most, survey, longer: None })?;
    let trace = trace.unwrap_or_else(|| Trace::from_stream(path, Box::new(recording), reading.limits));
    Ok((described(trace, report.as_ref()), report))
}

/// A trace with what is known of its recording.
fn described(trace: Trace, report: Option<&Report>) -> Trace {
    match report {
        Some(report) => trace.with_origin(report.origin()),
        None => trace,
    }
}

/// A recording in a file.
struct Recording {
    path: PathBuf,
    apitrace: bool,
    links: Links,
    reading: Reading,
    frames: Range<u64>,
    /// Bytes of the file.
    length: u64,
    /// See [`Stream::origin`].
    origin: Mutex<Origin>,
}

impl Recording {
    fn in_memory(&self) -> u64 {
        self.reading.in_memory.unwrap_or(IN_MEMORY)
    }

    /// Notes what is to be said of commands that were made to their end.
    fn note(&self, report: Option<Report>) {
        if let Some(report) = report {
            *self.origin.lock().unwrap_or_else(PoisonError::into_inner) = report.origin();
        }
    }

    fn import(&self, keep: Keep<'_>) -> Result<(Option<Trace>, Option<Report>), TraceError> {
        let Recording { path, apitrace, links, reading, frames, .. } = self;
        let fail = |reason: String| TraceError::new(path, reason);
        let mut file = host::open(path, *links).map_err(|error| TraceError::new(path, error))?;
        let mut start = [0; 2];
        file.read_exact(&mut start).map_err(|_| fail("is shorter than the start of a recording".into()))?;
        let read = Rc::new(Cell::new(start.len() as u64));
        let input: Input = Box::new(Counted { file, read: read.clone() });
        let memory = if *apitrace { Memory::default() } else { memory_of(path, reading)? };
        import(Opened { path, input, read, start, apitrace: *apitrace, memory }, reading, frames.clone(), keep)
    }
}

/// A file, and how much of it has been read.
struct Counted {
    file: File,
    read: Rc<Cell<u64>>,
}

impl Read for Counted {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.file.read(bytes)?;
        self.read.set(self.read.get() + read as u64);
        Ok(read)
    }
}

impl Stream for Recording {
    fn make(&self, take: &mut dyn FnMut(Part) -> ControlFlow<()>) -> Result<(), TraceError> {
        let (_, report) = self.import(Keep::Parts { part: part_of(self.in_memory()), take })?;
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
enum Keep<'a> {
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
type Take<'a> = &'a mut dyn FnMut(Part) -> ControlFlow<()>;

/// Imports a recording that is in memory; messages use `path` as its name. `memory` has the two files that accompany a text recording.
///
/// # Errors
/// As [`open`].
pub fn import_bytes(path: &Path, bytes: Vec<u8>, memory: [&[u8]; 2], reading: &Reading) -> Result<(Trace, Report), TraceError> {
    import_frames(path, bytes, memory, reading, 0..u64::MAX)
}

/// Same as [`import_bytes`], for some frames only.
///
/// # Errors
/// As [`open`].
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
        Keep::All { most: u64::MAX, survey: Survey::Whole, longer: None },
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
    mut keep: Keep<'_>,
) -> Result<(Option<Trace>, Option<Report>), TraceError> {
    let Opened { path, input, read, start, apitrace, memory } = opened;
    let unit = if apitrace { "byte" } else { "line" };
    let broken =
        |broken: Broken| TraceError::new(path, format!("call {}, {unit} {}: {}", broken.call, broken.place, broken.reason));
    let mut reader = if apitrace {
        Reader::Apitrace(Box::new(Apitrace::open(input, start, &reading.limits).map_err(broken)?))
    } else {
        Reader::Gli(Box::new(GliText::open(input, start, memory, &reading.limits).map_err(broken)?))
    };
    let mut gl = Gl::new(path, &reading.limits);
    gl.card.first_frame = frames.start;
    gl.keep_draws = reading.keep_draws;
    (gl.elements_omitted, gl.as_mesa) = (apitrace, apitrace);
    gl.card.all_levels = reading.keep_draws;
    (gl.card.upward, gl.card.window_alpha) = (reading.upward, reading.window_alpha);
    gl.card.windows.selected = reading.window;
    let (mut kept, mut cut) = (true, None);
    if let Keep::Parts { .. } = keep {
        gl.card.recorder.keep_each();
    }
    while gl.card.frames < frames.end {
        let Some(call) = reader.next().map_err(broken)? else {
            if let Some(Broken { call, place, reason }) = reader.cut() {
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
        match &mut keep {
            Keep::All { most, survey, longer } => {
                if bytes > *most {
                    let made = Part { read: read.get(), ..gl.card.drain() };
                    let refused = !reading.lenient && !gl.unsupported.is_empty();
                    if kept && *survey == Survey::Start && !refused {
                        let Some(take) = longer.take() else { return Ok((None, None)) };
                        if take(made).is_break() {
                            return Ok((None, None));
                        }
                        gl.card.recorder.keep_each();
                        keep = Keep::Parts { part: part_of(*most), take };
                        continue;
                    }
                    (kept, *most, gl.survey) = (false, *most / PARTS, true);
                }
            }
            Keep::Parts { part, take } => {
                // Commands after an unsupported feature would give wrong pictures. Further unsupported features are still counted.
                gl.survey |= !reading.lenient && !gl.unsupported.is_empty();
                if bytes > *part {
                    let made = Part { read: read.get(), ..gl.card.drain() };
                    if !gl.survey && take(made).is_break() {
                        return Ok((None, None));
                    }
                }
            }
        }
    }
    gl.finish_counts();
    // Where the end is cut, what was drawn of the last frame is shown, unless no frame was: such a trace has a frame at its end.
    let ended = if cut.is_some() && gl.card.frames > 0 { gl.show_rest() } else { gl.flush() };
    if let Err(Fault::Limit(reason) | Fault::Damaged(reason)) = ended {
        return Err(TraceError::new(path, reason));
    }
    if let Some(reason) = gl.card.windows.wrong_choice() {
        return Err(TraceError::new(path, reason));
    }
    let mut report = Report { calls: std::mem::take(&mut gl.calls), frames: gl.card.frames, cut, ..Report::default() };
    (report.queries, report.dropped) = (gl.queries, gl.card.dropped);
    (report.contexts, report.windows) = (std::mem::take(&mut gl.contexts.facts), gl.card.windows.facts());
    report.shaders = std::mem::take(&mut gl.texts);
    report.versions = gl.versions.iter().map(|(version, ())| version.to_owned()).collect();
    report.unsupported = std::mem::take(&mut gl.unsupported);
    report.errors = std::mem::take(&mut gl.errors);
    if let Keep::Parts { take, .. } = keep {
        if let Some(refusal) = report.refusal().filter(|_| !reading.lenient) {
            return Err(unsupported(path, &refusal));
        }
        gl.card.end_pass();
        // This is the last part.
        let _ = take(Part { read: read.get(), ..gl.card.drain() });
        return Ok((None, Some(report)));
    }
    let trace = gl.finish().map_err(|fault| TraceError::new(path, format!("{fault:?}")))?;
    Ok((kept.then(|| trace.with_limits(reading.limits)), Some(report)))
}

/// The error of a recording that uses unsupported features.
pub fn unsupported(path: &Path, refusal: &str) -> TraceError {
    TraceError::unsupported(path, format!("not supported: {refusal}; --lenient leaves it out"))
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
