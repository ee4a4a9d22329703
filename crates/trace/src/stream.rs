//! Traces whose commands are made while they are read, so that no more than a part of them is in memory.

use std::io;
use std::ops::ControlFlow;
use std::sync::mpsc::sync_channel;
use std::thread::{Builder, scope};

use super::command::Command;
use super::error::TraceError;
use super::store::Bytes;

/// Commands in order, and the blobs that they name. A blob is there as long as the commands of its part are read.
#[derive(Default)]
pub struct Part {
    /// Commands.
    pub commands: Vec<Command>,
    /// Blobs by name; no name occurs twice in a stream.
    pub blobs: Vec<(String, Bytes)>,
}

/// What makes commands. Each reader of the trace has them made again, the same ones each time.
pub trait Stream: Send + Sync {
    /// Makes the commands from the first on, and hands them over part by part until `take` breaks.
    ///
    /// # Errors
    /// If they cannot be made.
    fn make(&self, take: &mut dyn FnMut(Part) -> ControlFlow<()>) -> Result<(), TraceError>;

    /// What was left out of the commands when they were last made to their end, because it is not supported.
    fn left_out(&self) -> Option<String> {
        None
    }
}

/// Parts that are made before the one that is read has been.
const AHEAD: usize = 1;

/// Makes parts on a thread of their own beside their reader. First the reader's errors, then whether there is such a thread, then the
/// stream's errors.
pub(crate) fn beside<E>(
    stream: &dyn Stream,
    read: &mut dyn FnMut(Part) -> Result<ControlFlow<()>, E>,
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
