//! Profiles of frames, made once for all readers.

use std::time::Duration;

use anyhow::Result;

use super::host::Stopwatch;
use super::rendering::{Consumer, Work};
use render::ConsumerMemory;
use work::profile::{FrameProfile, Profiler};
use work::{EndFrame, Event, Funnel, Shade};

/// Frames of which profiles are gathered before readers get them: between two frames of a renderer whatever estimates need has left the host's
/// caches.
const BATCH: usize = 64;

/// Bytes of pictures that wait with their profiles: a batch ends with them.
const BATCH_BYTES: usize = 16 << 20;

/// A frame that has ended.
pub struct Profiled {
    /// The work of the frame.
    pub profile: FrameProfile,
    /// Its number, and what it shows.
    pub end: EndFrame,
    /// The counts of the frame's stages.
    pub funnel: Funnel,
}

/// Reads the next frames.
type Read<'r> = dyn FnMut(&[Profiled]) -> Result<()> + Send + 'r;

/// Reads profiles of frames in order, some at a time.
pub struct Reader<'r> {
    /// Whether the frames are kept to the end, with their pictures.
    pub keeps: bool,
    /// Reads the next ones.
    pub read: Box<Read<'r>>,
}

/// Makes profiles of the work for readers; `time` is what that takes, without the readers.
pub(super) fn consumer<'c>(shade: Shade, mut readers: Vec<Reader<'c>>, time: &'c mut Duration) -> Consumer<'c> {
    let memory = ConsumerMemory { frames: readers.iter().any(|reader| reader.keeps), ..ConsumerMemory::default() };
    let run = move |work: Work| {
        let (watch, mut read) = (Stopwatch::start(), Duration::ZERO);
        let mut hand_on = |gathered: &[Profiled]| -> Result<()> {
            let watch = Stopwatch::start();
            readers.iter_mut().try_for_each(|reader| (reader.read)(gathered))?;
            read += watch.elapsed();
            Ok(())
        };
        let (mut profiler, mut funnel) = (Profiler::new(shade), Funnel::default());
        let (mut gathered, mut bytes) = (Vec::with_capacity(BATCH), 0);
        for event in work {
            let profile = profiler.event(&event);
            match event {
                Event::Segment(segment) => funnel += segment.funnel,
                Event::EndFrame(end) => {
                    bytes += end.reference.len();
                    let (profile, funnel) = (profile.unwrap_or_default(), std::mem::take(&mut funnel));
                    gathered.push(Profiled { profile, end, funnel });
                }
                _ => {}
            }
            if gathered.len() == BATCH || bytes >= BATCH_BYTES {
                hand_on(&gathered)?;
                gathered.clear();
                bytes = 0;
            }
        }
        hand_on(&gathered)?;
        *time = watch.elapsed().saturating_sub(read);
        Ok(())
    };
    Consumer { memory, recorded: true, stored: true, run: Box::new(run) }
}
