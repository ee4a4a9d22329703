//! Facts about a recording.

use num::NameMap;
use trace::Origin;

use crate::gl::card::windows::WindowFacts;
use crate::gl::state::contexts::ContextFacts;

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

/// Facts that a machine collects about its recording.
#[derive(Default)]
pub struct Log {
    /// What is not supported.
    pub unsupported: Counts,
    /// Calls that raise an error.
    pub errors: Counts,
    /// Versions of contexts, as the recorded driver has called them.
    pub versions: NameMap<()>,
    /// Uses of occlusion queries.
    pub queries: u64,
    /// The number of the call that runs.
    pub number: u64,
}

impl Log {
    /// Counts a feature that is not supported.
    pub fn refuse(&mut self, what: String) {
        self.unsupported.get_or_insert_with(&what, || Count { times: 0, first: self.number }).times += 1;
    }

    /// Counts an OpenGL error of the call that runs.
    pub fn note_error(&mut self, what: &str) {
        self.errors.get_or_insert_with(what, || Count { times: 0, first: self.number }).times += 1;
    }
}

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
