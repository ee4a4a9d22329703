//! Which kind of trace a path holds, from the first bytes of its files.

use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};

/// A kind of trace.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Our own.
    Native,
    /// An API trace of wgpu 30.
    Wgpu,
    /// An OpenGL trace by apitrace.
    Apitrace,
    /// An OpenGL trace by GLInterceptor.
    GlInterceptor,
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Kind::Native => "native",
            Kind::Wgpu => "wgpu",
            Kind::Apitrace => "apitrace",
            Kind::GlInterceptor => "GLInterceptor",
        })
    }
}

/// A trace that was found.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Found {
    /// Its kind.
    pub kind: Kind,
    /// The file or folder to open it by.
    pub path: PathBuf,
}

/// Bytes that are read of a file to know its kind: enough to pass over a comment at its top.
const PEEK: u64 = 64 << 10;

/// Finds the trace that a path means: a trace's file, its folder, or the folder above it. None if there is none, or if nothing
/// there can be read.
pub fn detect(path: &Path) -> Option<Found> {
    if !path.is_dir() {
        return Some(Found { kind: kind_of_file(path)?, path: path.to_path_buf() });
    }
    // A wgpu recorder writes into a folder that its program chose; here it is kept as `trace` below the trace's own folder.
    for file in [path.join("trace.ron"), path.join("trace").join("trace.ron")] {
        if file.is_file() {
            return Some(Found { kind: kind_of_file(&file)?, path: file });
        }
    }
    // The other kinds are single files, of any name: take the first by name that is one.
    let mut files: Vec<PathBuf> = std::fs::read_dir(path).ok()?.filter_map(|entry| Some(entry.ok()?.path())).collect();
    files.sort();
    let gl = |file: &PathBuf| {
        let name = file.file_name()?.to_str()?;
        let likely = name.ends_with(".trace") || name.ends_with(".txt") || name.ends_with(".txt.gz");
        let kind = likely.then(|| kind_of_file(file)).flatten()?;
        matches!(kind, Kind::Apitrace | Kind::GlInterceptor).then(|| Found { kind, path: file.clone() })
    };
    files.iter().find_map(gl)
}

fn kind_of_file(file: &Path) -> Option<Kind> {
    let mut start = Vec::new();
    std::fs::File::open(file).ok()?.take(PEEK).read_to_end(&mut start).ok()?;
    let name = file.file_name()?.to_str().unwrap_or("");
    if start.starts_with(b"PK") {
        Some(Kind::Native)
    } else if start.starts_with(b"GLI0.") || (start.starts_with(b"\x1f\x8b") && name.ends_with(".txt.gz")) {
        Some(Kind::GlInterceptor)
    } else if start.starts_with(b"at") && name.ends_with(".trace") {
        Some(Kind::Apitrace)
    } else if name.ends_with(".ron") {
        // A wgpu trace is a list of actions, a native one a single struct. What is neither gets the native reader's message.
        let text = String::from_utf8_lossy(&start);
        let first = text[super::wgpu::trivia(&text)..].chars().next();
        Some(if first == Some('[') { Kind::Wgpu } else { Kind::Native })
    } else {
        None
    }
}
