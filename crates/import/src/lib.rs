//! Floor 3: foreign traces → trace.
//!
//! [`open`] takes any trace, native or foreign, and answers the same [`Trace`] for all of them: a foreign one with its commands
//! translated in memory and its blobs where they are. [`wgpu`] reads API traces of wgpu, [`gl`] recorded OpenGL programs, [`vulkan`] captures of
//! Vulkan programs. Each is a feature of the package; without it, [`open`] refuses such traces.
//!
//! ```
//! use gfx::format::Format;
//! use trace::record::{self, Recorder};
//!
//! // A native trace, saved to a folder.
//! let mut card = Recorder::new("clear");
//! let target = card.create_texture("target", record::texture_2d(64, 64, Format::Rgba8Unorm));
//! let view = card.create_view(target);
//! drop(card.begin_render_pass([record::clear(view, [1.0, 0.0, 0.0, 1.0])], None));
//! card.present(target);
//! let folder = tempfile::tempdir()?;
//! card.save(folder.path())?;
//!
//! let found = import::detect(folder.path()).expect("a trace");
//! assert_eq!(found.kind, import::TraceKind::Native);
//! assert_eq!(trace::check(&import::open(folder.path())?)?.frames, 1);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "opengl")]
pub mod gl;
#[cfg(feature = "vulkan")]
pub mod vulkan;
#[cfg(feature = "wgpu")]
pub mod wgpu;

mod detect;
mod report;

use std::ops::Range;
use std::path::Path;

use host::Links;
use trace::{Reading, Trace, TraceError};

pub use detect::{FoundTrace, TraceKind, detect};
pub use report::{ContextFacts, Count, Counts, Report, Survey, WindowFacts, unsupported};

/// Opens a trace of any kind. Errors name the file, and the place in it where there is one.
pub fn open(path: impl AsRef<Path>) -> Result<Trace, TraceError> {
    open_with(path, &Reading::default())
}

/// As [`open`], with limits and rules for its files other than the default ones.
pub fn open_with(path: impl AsRef<Path>, reading: &Reading) -> Result<Trace, TraceError> {
    open_path(path.as_ref(), reading)
}

/// As [`open_with`], with what is known of a recorded OpenGL program. What it asks for and is not supported is no error here.
pub fn open_reported(path: &Path, reading: &Reading) -> Result<(Trace, Option<Report>), TraceError> {
    open_as(path, reading, 0..u64::MAX, Survey::Whole)
}

/// As [`open_reported`]. Of a recorded OpenGL program only these frames are translated, and what they need of the ones before; other traces
/// are whole. A long one is not read to its end first: then there is no report, and [`gl::open`] says what becomes of what is not supported.
pub fn open_frames(path: &Path, reading: &Reading, frames: Range<u64>) -> Result<(Trace, Option<Report>), TraceError> {
    open_as(path, reading, frames, Survey::Start)
}

#[cfg_attr(not(feature = "opengl"), allow(unused_variables, reason = "recorded OpenGL programs alone are read in part"))]
fn open_as(path: &Path, reading: &Reading, frames: Range<u64>, survey: Survey) -> Result<(Trace, Option<Report>), TraceError> {
    // The path is the user's own; files that are found in a folder are the trace's.
    let in_folder = std::fs::metadata(path).map_err(|error| TraceError::new(path, error))?.is_dir();
    let links = if in_folder { reading.links() } else { Links::Follow };
    match detect::detect_with(path, reading.links())? {
        Some(FoundTrace { kind: TraceKind::Native, path: file }) => match file.parent() {
            Some(folder) if in_folder => Trace::open_with(folder, reading),
            _ => Trace::open_with(file, reading),
        },
        #[cfg(feature = "wgpu")]
        Some(FoundTrace { kind: TraceKind::Wgpu, path: file }) => wgpu::open_linked(&file, links, reading),
        #[cfg(feature = "opengl")]
        Some(FoundTrace { kind: kind @ (TraceKind::Apitrace | TraceKind::GlInterceptor), path }) => {
            return gl::open(&path, kind == TraceKind::Apitrace, links, reading, frames, survey);
        }
        #[cfg(feature = "vulkan")]
        Some(FoundTrace { kind: TraceKind::Gfxr, path: file }) => vulkan::open(&file, links, reading, frames),
        #[cfg(not(all(feature = "opengl", feature = "vulkan", feature = "wgpu")))]
        Some(FoundTrace { kind, path }) => {
            let feature = kind.feature().unwrap_or_default();
            Err(TraceError::new(
                path,
                format!("is a {kind} trace, which this build cannot read: build with the feature `{feature}`"),
            ))
        }
        None => {
            let held = traces_in(path);
            Err(TraceError::new(
                path,
                match held.is_empty() {
                    false => format!("is no trace, and holds traces: {}", held.join(", ")),
                    true => "is no trace: neither a native one (folder with trace.ron, or zip archive), nor a wgpu API trace (folder \
                             with trace.ron), nor an apitrace, GLInterceptor or GFXReconstruct file"
                        .into(),
                },
            ))
        }
    }
    .map(|trace| (trace, None))
}

/// Traces in a folder that are listed at most.
const LISTED: usize = 8;

/// The names of the first traces in a folder, in order.
fn traces_in(folder: &Path) -> Vec<String> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let mut paths: Vec<_> = entries.filter_map(|entry| Some(entry.ok()?.path())).collect();
    paths.sort();
    // Files of RON are traces by their folder.
    paths.retain(|path| path.extension().is_none_or(|ending| ending != "ron"));
    let found = paths.iter().filter(|path| detect::detect_with(path, Links::Refuse).is_ok_and(|found| found.is_some()));
    found.take(LISTED).map(|path| host::path_line(path)).collect()
}

fn open_path(path: &Path, reading: &Reading) -> Result<Trace, TraceError> {
    let (trace, report) = open_reported(path, reading)?;
    match report.and_then(|report| report.refusal()) {
        Some(refusal) if !reading.lenient => Err(unsupported(path, &refusal)),
        _ => Ok(trace),
    }
}
