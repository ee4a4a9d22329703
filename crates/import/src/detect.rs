//! Which kind of trace a path holds, from the first bytes of its files.

use host::Links;
use std::fmt;
use std::io::{self, Read};
use std::path::{Path, PathBuf};
use trace::{COMMANDS_FILE, TraceError};

/// A kind of trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TraceKind {
    /// Our own.
    Native,
    /// An API trace of wgpu 30.
    Wgpu,
    /// An OpenGL trace by apitrace.
    Apitrace,
    /// An OpenGL trace by GLInterceptor.
    GlInterceptor,
    /// A capture of a Vulkan program by GFXReconstruct.
    Gfxr,
}

impl fmt::Display for TraceKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            TraceKind::Native => "native",
            TraceKind::Wgpu => "wgpu",
            TraceKind::Apitrace => "apitrace",
            TraceKind::GlInterceptor => "GLInterceptor",
            TraceKind::Gfxr => "GFXReconstruct",
        })
    }
}

impl TraceKind {
    /// The feature of this package that reads such traces. None if every build reads them.
    pub fn feature(self) -> Option<&'static str> {
        match self {
            TraceKind::Native => None,
            TraceKind::Wgpu => Some("wgpu"),
            TraceKind::Apitrace | TraceKind::GlInterceptor => Some("opengl"),
            TraceKind::Gfxr => Some("vulkan"),
        }
    }
}

/// A trace that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FoundTrace {
    /// Its kind.
    pub kind: TraceKind,
    /// The file or folder to open it by.
    pub path: PathBuf,
}

/// Bytes that are read of a file to know its kind: enough to pass over a comment at its top.
const PEEK: u64 = 64 << 10;

/// Finds the trace that a path means: a trace's file, its folder, or the folder above it. None if there is none, or if nothing
/// there can be read.
pub fn detect(path: &Path) -> Option<FoundTrace> {
    detect_with(path, Links::Follow).ok().flatten()
}

/// As [`detect`], with a rule for symbolic links in the folder. What has the name of a trace and cannot be read is an error.
pub(super) fn detect_with(path: &Path, links: Links) -> Result<Option<FoundTrace>, TraceError> {
    if !path.is_dir() {
        // The user's own path.
        return found(path, Links::Follow);
    }
    // A wgpu recorder writes into a folder that its program chose; here it is kept as `trace` below the trace's own folder.
    let below = path.join("trace");
    for folder in [path, &below] {
        let file = folder.join(COMMANDS_FILE);
        // Whatever else bears the name is refused by name.
        if std::fs::symlink_metadata(&file).is_ok() {
            if folder == below {
                host::check_folder(folder, links).map_err(|error| TraceError::new(folder, error))?;
            }
            return found(&file, links);
        }
    }
    // The other kinds are single files, of any name: take the first by name that is one.
    let Ok(entries) = std::fs::read_dir(path) else { return Ok(None) };
    let mut files: Vec<PathBuf> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.sort();
    let single = |file: &PathBuf| {
        let name = file.file_name()?.to_str()?;
        let likely = name.ends_with(".trace") || name.ends_with(".txt") || name.ends_with(".txt.gz") || name.ends_with(".gfxr");
        let kind = likely.then(|| found(file, links).ok().flatten()).flatten()?.kind;
        matches!(kind, TraceKind::Apitrace | TraceKind::GlInterceptor | TraceKind::Gfxr)
            .then(|| FoundTrace { kind, path: file.clone() })
    };
    Ok(files.iter().find_map(single))
}

/// The trace in a file.
fn found(file: &Path, links: Links) -> Result<Option<FoundTrace>, TraceError> {
    let kind = kind_of_file(file, links).map_err(|error| TraceError::new(file, error))?;
    Ok(kind.map(|kind| FoundTrace { kind, path: file.to_path_buf() }))
}

/// Whether bytes are the start of Brotli, which has no mark, and of a version of apitrace's container in it.
fn is_brotli(start: &[u8]) -> bool {
    let mut version = [0];
    let read = brotli_decompressor::Decompressor::new(start, PEEK as usize).read(&mut version);
    read.is_ok_and(|count| count == 1) && (1..=6).contains(&version[0])
}

fn kind_of_file(file: &Path, links: Links) -> io::Result<Option<TraceKind>> {
    let mut start = Vec::new();
    host::open(file, links)?.take(PEEK).read_to_end(&mut start)?;
    let name = file.file_name().and_then(|name| name.to_str()).unwrap_or("");
    Ok(if start.starts_with(b"PK") {
        Some(TraceKind::Native)
    } else if start.starts_with(b"GFXR") {
        Some(TraceKind::Gfxr)
    } else if start.starts_with(b"GLI0.") || (start.starts_with(b"\x1f\x8b") && name.ends_with(".txt.gz")) {
        Some(TraceKind::GlInterceptor)
    } else if name.ends_with(".trace") && (start.starts_with(b"at") || start.starts_with(b"\x1f\x8b") || is_brotli(&start)) {
        Some(TraceKind::Apitrace)
    } else if name.ends_with(".ron") {
        // A wgpu trace is a list of actions, a native one a single struct. What is neither gets the native reader's message.
        let text = String::from_utf8_lossy(&start);
        let first = text[trivia(&text)..].chars().next();
        Some(if first == Some('[') { TraceKind::Wgpu } else { TraceKind::Native })
    } else {
        None
    })
}

/// Length of the white space and comments at the beginning of a RON text. A comment that does not end is not counted.
pub fn trivia(text: &str) -> usize {
    let mut at = 0;
    loop {
        let rest = &text[at..];
        let blank = rest.len() - rest.trim_start().len();
        at += blank;
        let rest = &rest[blank..];
        let comment = if rest.starts_with("//") {
            rest.find('\n').unwrap_or(rest.len())
        } else if rest.starts_with("/*") {
            block_comment(rest).unwrap_or(0)
        } else {
            0
        };
        if comment == 0 {
            return at;
        }
        at += comment;
    }
}

/// Length of the block comment at the beginning, which may hold others.
pub fn block_comment(text: &str) -> Option<usize> {
    let bytes = text.as_bytes();
    let (mut at, mut depth) = (0, 0u32);
    while at + 1 < bytes.len() {
        match &bytes[at..at + 2] {
            b"/*" => depth += 1,
            b"*/" => depth -= 1,
            _ => {
                at += 1;
                continue;
            }
        }
        at += 2;
        if depth == 0 {
            return Some(at);
        }
    }
    None
}
