//! Where frames leave a replay.

use std::ops::Deref;
use std::sync::Arc;

use anyhow::Result;

use machine::{FrameReport, PhaseReport, Shown, Watcher};
use stats::Tree;
use work::{EndFrame, Surface};

/// The bytes of a picture. They are not copied on their way out.
#[derive(Clone, Debug)]
pub enum Bytes {
    /// A machine's own.
    Own(Vec<u8>),
    /// The renderer's, which it may show again.
    Shared(Arc<[u8]>),
}

impl Deref for Bytes {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        match self {
            Bytes::Own(bytes) => bytes,
            Bytes::Shared(bytes) => bytes,
        }
    }
}

impl PartialEq for Bytes {
    fn eq(&self, other: &Bytes) -> bool {
        self[..] == other[..]
    }
}

/// One frame of a replay.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Its number in the trace.
    pub number: u32,
    /// The shown surface and its bytes. None if nothing was ever drawn.
    pub shown: Option<(Surface, Bytes)>,
    /// Its statistics.
    pub tree: Tree,
    /// The phases of the frame, one after another. Empty if no time is simulated.
    pub phases: Vec<PhaseReport>,
    /// The refreshes of a free-running display since the frame before.
    pub display: Shown,
}

impl From<FrameReport> for Frame {
    fn from(frame: FrameReport) -> Frame {
        let FrameReport { number, picture, tree, phases, shown: display, .. } = frame;
        Frame { number, shown: picture.map(|picture| (picture.surface, Bytes::Own(picture.bytes))), tree, phases, display }
    }
}

/// Is given the frames in order, each when it ends.
pub type FrameConsumer<'t> = dyn FnMut(Frame) -> Result<()> + Send + 't;

/// Is given what each frame of a sampled sequence shows, simulated or not: in any order, by several threads. The statistics are empty.
pub type Pictures<'p> = dyn Fn(Frame) -> Result<()> + Sync + 'p;

/// How far a replay is: a frame has ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Ended {
    /// Its number.
    pub frame: u32,
    /// Whether the survey that chooses frames is done with this frame. Otherwise the frame leaves the replay.
    pub surveyed: bool,
    /// How many end in this way, if that is known.
    pub of: Option<u64>,
}

/// Called for each frame when it ends. Frames of a survey end in any order, on several threads.
pub type Progress<'p> = dyn Fn(Ended) + Sync + 'p;

/// Where frames leave a replay: passes each on, and reports progress.
pub struct FrameSink<'s> {
    /// Is given the frames.
    pub taker: Box<FrameConsumer<'s>>,
    /// Whether the receiver keeps the frames. If so, they count as memory in use.
    pub keeps: bool,
    /// Whether the frames of a simulated machine report their draws.
    pub per_draw: bool,
    /// Whether the limits of the phases are estimated for the first frames of a simulated machine.
    pub limits: bool,
    /// Is given the pictures of all frames, where some are sampled.
    pub pictures: Option<&'s Pictures<'s>>,
    /// Reads the machine while it runs, under the cycle fidelity.
    pub watcher: Option<Box<dyn Watcher + Send + 's>>,
    /// Called for each frame.
    pub progress: &'s Progress<'s>,
    /// How many frames leave, if that is known.
    pub of: Option<u64>,
}

impl<'s> FrameSink<'s> {
    /// Frames go to a taker that does not keep them.
    pub fn new(taker: impl FnMut(Frame) -> Result<()> + Send + 's) -> FrameSink<'s> {
        FrameSink {
            taker: Box::new(taker),
            keeps: false,
            per_draw: false,
            limits: false,
            pictures: None,
            watcher: None,
            progress: &|_| (),
            of: None,
        }
    }

    /// A frame has ended.
    ///
    /// # Errors
    /// The taker's error.
    pub fn put(&mut self, frame: Frame) -> Result<()> {
        (self.progress)(Ended { frame: frame.number, surveyed: false, of: self.of });
        (self.taker)(frame)
    }
}

/// The picture of a frame, if the renderer's picture is the frame's.
pub(super) fn reference(end: &EndFrame) -> Option<(Surface, Bytes)> {
    end.shown.map(|surface| (surface, Bytes::Shared(end.reference.clone())))
}

/// A frame that has only its picture, the renderer's.
pub(super) fn pictured(end: &EndFrame) -> Frame {
    Frame { number: end.number, shown: reference(end), tree: Tree::new(), phases: Vec::new(), display: Shown::default() }
}
