//! Recordings that may be short. Whether one is can only be told by reading it, so it is read on a thread of its own: if it is short, its
//! trace stays in memory. If not, the first reader of its commands gets those that are there, and the thread goes on; later readers begin anew.

use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::{Builder, JoinHandle};

use trace::{CommandChunk, Origin, Stream, Trace, TraceError};

use crate::gl::recording::{Delivery, Recording, described};
use crate::report::{Report, Survey};

/// What [`Recording::import`] answers.
type Imported = Result<(Option<Trace>, Option<Report>), TraceError>;

/// What the thread has to say.
enum Message {
    /// The recording is longer than may stay in memory: the next commands.
    Chunk(CommandChunk),
    /// It has been read to its end.
    Done(Box<Imported>),
}

/// A recording that has been read in part.
struct Started {
    first: CommandChunk,
    messages: Receiver<Message>,
    thread: JoinHandle<()>,
}

/// A recording whose first reader goes on where it has been read to.
struct Resumed {
    recording: Arc<Recording>,
    started: Mutex<Option<Started>>,
}

/// Opens a recording of which no more than `most` bytes may stay in memory.
pub fn open(recording: Recording, most: u64) -> Result<(Trace, Option<Report>), TraceError> {
    let recording = Arc::new(recording);
    let (path, limits) = (recording.path.clone(), recording.reading.limits);
    // The thread waits with each part until it is asked for: no more than the one that was to be kept is in memory before there is a reader.
    let (send, messages) = sync_channel(0);
    let reader = recording.clone();
    let read = move || {
        let send = &send;
        let mut longer = |part| {
            if send.send(Message::Chunk(part)).is_ok() { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        let imported = reader.import(Delivery::All { most, survey: Survey::Start, longer: Some(&mut longer) });
        // Without a receiver nobody wants to know.
        let _ = send.send(Message::Done(Box::new(imported)));
    };
    let streamed = |started| {
        let resumed = Resumed { recording: recording.clone(), started: Mutex::new(started) };
        Trace::from_stream(&path, Box::new(resumed), limits)
    };
    let Ok(thread) = Builder::new().name("recording".to_owned()).spawn(read) else {
        let (trace, report) = recording.import(Delivery::All { most, survey: Survey::Start, longer: None })?;
        return Ok((described(trace.unwrap_or_else(|| streamed(None)), report.as_ref()), report));
    };
    match messages.recv() {
        Ok(Message::Chunk(first)) => Ok((streamed(Some(Started { first, messages, thread })), None)),
        Ok(Message::Done(imported)) => {
            let (trace, report) = (*imported)?;
            Ok((described(trace.unwrap_or_else(|| streamed(None)), report.as_ref()), report))
        }
        Err(_) => std::panic::resume_unwind(thread.join().expect_err("it has not said that it is done")),
    }
}

impl Stream for Resumed {
    fn make(&self, take: &mut dyn FnMut(CommandChunk) -> ControlFlow<()>) -> Result<(), TraceError> {
        let started = self.started.lock().unwrap_or_else(PoisonError::into_inner).take();
        let Some(Started { first, messages, thread }) = started else { return self.recording.make(take) };
        if take(first).is_break() {
            return Ok(());
        }
        loop {
            match messages.recv() {
                Ok(Message::Chunk(part)) => {
                    if take(part).is_break() {
                        return Ok(());
                    }
                }
                Ok(Message::Done(imported)) => {
                    let (_, report) = (*imported)?;
                    self.recording.note(report);
                    return Ok(());
                }
                Err(_) => std::panic::resume_unwind(thread.join().expect_err("it has not said that it is done")),
            }
        }
    }

    fn origin(&self) -> Origin {
        self.recording.origin()
    }

    fn length(&self) -> u64 {
        self.recording.length()
    }
}
