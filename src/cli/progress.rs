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
pub struct Told {
    bar: ProgressBar,
    frame: Arc<Mutex<String>>,
    /// Goes when the replay is over, which the thread that tells waits for.
    over: Sender<()>,
    teller: Option<JoinHandle<()>>,
}

impl Told {
    /// Begins to tell, on a terminal.
    pub fn begin(watch: &Arc<Watch>) -> Told {
        let bar = bar("{spinner} {elapsed} {msg}");
        let (over, end) = channel();
        let frame = Arc::new(Mutex::new(String::from("rendering")));
        let (mine, bar_of, watch) = (frame.clone(), bar.clone(), watch.clone());
        let tell = move || {
            while end.recv_timeout(Duration::from_millis(500)) == Err(RecvTimeoutError::Timeout) {
                let frame = mine.lock().unwrap_or_else(PoisonError::into_inner).clone();
                bar_of.set_message(watch.line().map_or(frame.clone(), |line| format!("{frame}; {line}")));
            }
        };
        // Without a terminal nobody reads it; without a thread it is left out.
        let teller = if bar.is_hidden() { None } else { std::thread::Builder::new().spawn(tell).ok() };
        Told { bar, frame, over, teller }
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
        // A teller that panicked told nothing more; the replay is not touched by that.
        drop(self.teller.map(JoinHandle::join));
        self.bar.finish_and_clear();
    }
}
