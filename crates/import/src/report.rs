//! Facts about a recorded program.

use std::path::Path;

use num::NameMap;
use trace::{Origin, TraceError};

/// How often something occurred, and where it first occurred.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Count {
    /// How often.
    pub times: u64,
    /// Number of the first call.
    pub first: u64,
}

/// Counts by name.
pub type Counts = NameMap<Count>;

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

/// How much is known of a recording before its first command.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Survey {
    /// All: the recording is read to its end.
    Whole,
    /// Only facts from its start: a long recording is not read to its end before its first command.
    Start,
}

/// The error of a recording that uses unsupported features.
pub fn unsupported(path: &Path, refusal: &str) -> TraceError {
    TraceError::unsupported(path, format!("not supported: {refusal}; --lenient leaves it out"))
}

/// Facts about a window or another drawable.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WindowFacts {
    /// Width and height in pixels; zeros if nothing was drawn to it.
    pub size: [u32; 2],
    /// How often its buffers were swapped.
    pub swaps: u64,
    /// Whether it is a pixel buffer, which is never on a screen.
    pub off_screen: bool,
}

impl std::fmt::Display for WindowFacts {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self.size {
            [0, 0] => f.write_str("never drawn to")?,
            [width, height] => write!(f, "{width} x {height}")?,
        }
        if self.off_screen {
            f.write_str(", off screen")?;
        }
        match self.swaps {
            0 => f.write_str(", no swap"),
            1 => f.write_str(", 1 swap"),
            swaps => write!(f, ", {swaps} swaps"),
        }
    }
}

/// Facts about a context that the recording makes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ContextFacts {
    /// The call that makes it; of a context whose creation was not recorded, the first call that names it.
    pub call: u64,
    /// The number of an earlier context whose objects it shares.
    pub shares: Option<usize>,
}
