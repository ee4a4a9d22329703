//! How far a replay is, on a terminal.

use std::io::IsTerminal;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};

use crate::render::Watch;

/// A spinner on a terminal, nothing elsewhere.
pub fn bar(template: &str) -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style).with_message("rendering");
    let ticking = bar.clone();
    let tick = move || {
        while !ticking.is_finished() {
            ticking.tick();
            std::thread::sleep(Duration::from_millis(100));
        }
    };
    // Not the library's own ticker: it panics where no thread can be started. Without one the bar moves at the end of each frame.
    let _ = std::thread::Builder::new().name("progress".into()).spawn(tick);
    bar
}

/// What the spinner says: the last frame, and once a limit comes near, the command that runs and how much of the limit is used.
pub struct ProgressLine {
    bar: ProgressBar,
    frame: Arc<Mutex<String>>,
    /// Dropped when the replay is over, for which the writer waits.
    over: Sender<()>,
    /// The thread that writes the line.
    writer: Option<JoinHandle<()>>,
}

impl ProgressLine {
    /// Begins to write it, on a terminal.
    pub fn begin(watch: &Arc<Watch>) -> ProgressLine {
        let bar = bar("{spinner} {elapsed} {msg}");
        let (over, end) = channel();
        let frame = Arc::new(Mutex::new(String::from("rendering")));
        let (mine, bar_of, watch) = (frame.clone(), bar.clone(), watch.clone());
        let write = move || {
            while end.recv_timeout(Duration::from_millis(500)) == Err(RecvTimeoutError::Timeout) {
                let frame = mine.lock().unwrap_or_else(PoisonError::into_inner).clone();
                bar_of.set_message(watch.line().map_or(frame.clone(), |line| format!("{frame}; {line}")));
            }
        };
        // Without a terminal there is no reader; without a thread the line is left out.
        let writer = if bar.is_hidden() { None } else { std::thread::Builder::new().spawn(write).ok() };
        ProgressLine { bar, frame, over, writer }
    }

    /// A frame has ended.
    pub fn frame(&self, frame: u32) {
        let text = format!("frame {frame} done");
        self.bar.set_message(text.clone());
        self.bar.inc(1);
        *self.frame.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }

    /// The replay is over.
    pub fn end(self) {
        drop(self.over);
        // A writer that panicked wrote no more lines; the replay does not depend on it.
        drop(self.writer.map(JoinHandle::join));
        self.bar.finish_and_clear();
    }
}
