//! Traces whose commands are made while they are read, so that no more than a part of them is in memory.

use std::io;
use std::ops::ControlFlow;
use std::sync::mpsc::sync_channel;
use std::thread::{Builder, scope};

use super::Origin;
use super::command::Command;
use super::error::TraceError;
use super::store::Bytes;

/// Commands in order, and the blobs that they name. A blob is there as long as the commands of its part are read.
#[derive(Default)]
pub struct CommandChunk {
    /// Commands.
    pub commands: Vec<Command>,
    /// Blobs by name; no name occurs twice in a stream.
    pub blobs: Vec<(String, Bytes)>,
    /// How much had been read of what the commands are made from, when they had been made; 0 where that is not known.
    pub read: u64,
}

/// What makes commands. Each reader of the trace has them made again, the same ones each time.
pub trait Stream: Send + Sync {
    /// Makes the commands from the first on, and hands them over part by part until `take` breaks.
    ///
    /// # Errors
    /// If they cannot be made.
    fn make(&self, take: &mut dyn FnMut(CommandChunk) -> ControlFlow<()>) -> Result<(), TraceError>;

    /// What is known of the recording, if the commands have been made to their end.
    fn origin(&self) -> Origin {
        Origin::default()
    }

    /// The length of what the commands are made from, in the unit of [`CommandChunk::read`]; 0 where that is not known.
    fn length(&self) -> u64 {
        0
    }
}

/// How much of a stream had been read when its frames ended. What is kept does not grow with the stream.
#[derive(Debug, Default)]
pub(crate) struct Landmarks {
    length: u64,
    /// Frames and what was read when they had been; rising, and so far apart that there are no more than [`LANDMARKS`].
    marks: Vec<(u64, u64)>,
    /// The last.
    last: (u64, u64),
}

/// Landmarks of a stream.
const LANDMARKS: u64 = 256;

impl Landmarks {
    pub fn new(length: u64) -> Landmarks {
        Landmarks { length, ..Landmarks::default() }
    }

    /// Notes that `frames` frames and `read` bytes of the stream have been read. Several readers may note the same.
    pub fn pass(&mut self, frames: u64, read: u64) {
        if frames < self.last.0 || read < self.last.1 {
            return;
        }
        // What lies between two frames belongs to the second: a landmark is where frames have just ended.
        if frames > self.last.0 && read >= self.marks.last().map_or(0, |mark| mark.1) + self.length.div_ceil(LANDMARKS).max(1) {
            self.marks.push((frames, read));
        }
        self.last = (frames, read);
    }

    /// The share of the stream that had been read when `frames` frames had ended, in proportion between two landmarks.
    pub fn share(&self, frames: u64) -> Option<f64> {
        let after = self.marks.partition_point(|mark| mark.0 < frames);
        let before = after.checked_sub(1).map_or((0, 0), |at| self.marks[at]);
        let next = self.marks.get(after).copied().unwrap_or(self.last);
        let part = frames.min(next.0).saturating_sub(before.0) as f64 / (next.0.saturating_sub(before.0)).max(1) as f64;
        let read = before.1 as f64 + part * next.1.saturating_sub(before.1) as f64;
        (self.length > 0).then(|| (read / self.length as f64).min(1.0))
    }

    /// The share that has been read.
    pub fn read(&self) -> Option<f64> {
        (self.length > 0).then(|| (self.last.1 as f64 / self.length as f64).min(1.0))
    }
}

/// Parts that are made before the one that is read has been.
const AHEAD: usize = 1;

/// Makes parts on a thread of their own beside their reader. First the reader's errors, then whether there is such a thread, then the
/// stream's errors.
pub(crate) fn beside<E>(
    stream: &dyn Stream,
    read: &mut dyn FnMut(CommandChunk) -> Result<ControlFlow<()>, E>,
) -> Result<io::Result<Result<(), TraceError>>, E> {
    scope(|scope| {
        let (send, receive) = sync_channel(AHEAD);
        let make = move || {
            stream.make(&mut |part| if send.send(part).is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) })
        };
        let maker = match Builder::new().name("recording".to_owned()).spawn_scoped(scope, make) {
            Ok(maker) => maker,
            Err(error) => return Ok(Err(error)),
        };
        for part in &receive {
            match read(part) {
                Ok(ControlFlow::Continue(())) => {}
                Ok(ControlFlow::Break(())) => break,
                Err(error) => {
                    drop(receive);
                    return Err(error);
                }
            }
        }
        drop(receive);
        Ok(Ok(maker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_frame_ends_at_a_share_of_the_stream() {
        let mut marks = Landmarks::new(10_000);
        assert_eq!((marks.share(1), marks.read()), (Some(0.0), Some(0.0)));
        // Uploads that take half of it, then frames of one length, and two readers beside each other.
        marks.pass(0, 5000);
        for frame in 0..=1000 {
            marks.pass(frame, 5000 + 5 * frame);
            marks.pass(frame / 2, 5000 + 5 * (frame / 2));
        }
        assert_eq!(marks.read(), Some(1.0));
        for frame in [40, 300, 777, 1000, 2000] {
            let (share, truth) = (marks.share(frame).expect("it has a length"), (0.5 + frame as f64 / 2000.0).min(1.0));
            assert!((share - truth).abs() < 1.0 / LANDMARKS as f64, "{frame}: {share} for {truth}");
        }
        assert!(marks.marks.len() as u64 <= LANDMARKS, "{}", marks.marks.len());
        let mut unknown = Landmarks::new(0);
        unknown.pass(3, 7);
        assert_eq!((unknown.share(1), unknown.read()), (None, None));
    }
}
