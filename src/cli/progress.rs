//! How far a replay is, on a terminal.

use std::io::IsTerminal;
use std::ops::{ControlFlow, Range};
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, Sender, TryRecvError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};

use crate::render::Watch;
use crate::run::replay::Ended;
use crate::trace::command::Command;
use crate::trace::{Trace, TraceError};

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

/// What the spinner says: the last frame, how many are left and for how long, and once a limit comes near, the command that runs and how
/// much of the limit is used.
pub struct ProgressLine {
    bar: ProgressBar,
    far: Arc<Far>,
    /// Dropped when the replay is over, for which the writer waits.
    over: Sender<()>,
    /// The thread that writes the line.
    writer: Option<JoinHandle<()>>,
}

/// How far a replay is.
struct Far {
    step: Mutex<Step>,
    /// How many frames the trace has of those that are asked for, once they have been counted; 0 before.
    frames: AtomicU64,
}

/// Frames that end in the same way, one after another.
struct Step {
    begun: Instant,
    done: u64,
    last: Option<Ended>,
}

impl Far {
    /// A frame has ended.
    fn add(&self, ended: Ended) {
        let mut step = self.step.lock().unwrap_or_else(PoisonError::into_inner);
        if step.last.is_some_and(|last| last.surveyed != ended.surveyed) {
            (step.begun, step.done) = (Instant::now(), 0);
        }
        step.done += 1;
        step.last = Some(ended);
    }

    fn line(&self) -> String {
        let Step { begun, done, last } = *self.step.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(Ended { frame, surveyed, of }) = last else { return "rendering".into() };
        let what = if surveyed { "surveyed" } else { "done" };
        let counted = Some(self.frames.load(Ordering::Relaxed)).filter(|&frames| frames > 0);
        let Some(left) = of.or(counted).and_then(|of| of.checked_sub(done)) else { return format!("frame {frame} {what}") };
        let time = HumanDuration(time_left(begun.elapsed(), done, left));
        format!("frame {frame} {what}; {done} of {}, {time:#} left", done + left)
    }
}

/// The time for so many frames more, at the mean rate until now.
fn time_left(elapsed: Duration, done: u64, left: u64) -> Duration {
    Duration::try_from_secs_f64(elapsed.as_secs_f64() * left as f64 / done as f64).unwrap_or_default()
}

/// Counts these frames of a trace, until the replay is over; 0 for a recording that is translated while it is read, which would be
/// translated twice.
fn count(trace: &Trace, frames: &Range<u32>, over: impl Fn() -> bool) -> u64 {
    if trace.is_stream() {
        return 0;
    }
    let mut seen = 0;
    let counted = trace.try_for_each_command(|_, command| -> Result<_, TraceError> {
        seen += u64::from(matches!(command, Command::Present { .. }));
        let enough = seen == u64::from(frames.end) || over();
        Ok(if enough { ControlFlow::Break(()) } else { ControlFlow::Continue(()) })
    });
    // The replay reports the error.
    counted.map_or(0, |()| seen.saturating_sub(u64::from(frames.start)))
}

impl ProgressLine {
    /// Begins to write it, on a terminal, for some frames of a trace.
    pub fn begin(watch: &Arc<Watch>, trace: &Arc<Trace>, frames: Range<u32>) -> ProgressLine {
        let bar = bar("{spinner} {elapsed} {msg}");
        let (over, end) = channel();
        let step = Step { begun: Instant::now(), done: 0, last: None };
        let far = Arc::new(Far { step: Mutex::new(step), frames: AtomicU64::new(0) });
        let (mine, bar_of, watch, trace) = (far.clone(), bar.clone(), watch.clone(), trace.clone());
        let write = move || {
            let counted = count(&trace, &frames, || end.try_recv() == Err(TryRecvError::Disconnected));
            mine.frames.store(counted, Ordering::Relaxed);
            while end.recv_timeout(Duration::from_millis(500)) == Err(RecvTimeoutError::Timeout) {
                let line = mine.line();
                bar_of.set_message(watch.line().map_or(line.clone(), |limit| format!("{line}; {limit}")));
            }
        };
        // Without a terminal there is no reader; without a thread the line is left out.
        let writer = if bar.is_hidden() { None } else { std::thread::Builder::new().spawn(write).ok() };
        ProgressLine { bar, far, over, writer }
    }

    /// A frame has ended.
    pub fn frame(&self, ended: Ended) {
        if self.bar.is_hidden() {
            return;
        }
        self.far.add(ended);
        self.bar.set_message(self.far.line());
        self.bar.inc(1);
    }

    /// The replay is over.
    pub fn end(self) {
        drop(self.over);
        // A writer that panicked wrote no more lines; the replay does not depend on it.
        drop(self.writer.map(JoinHandle::join));
        self.bar.finish_and_clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trace::record::{self, Recorder};

    #[test]
    fn frames_are_counted_and_the_rest_takes_as_long_as_those_before() {
        let mut card = Recorder::new("frames");
        let texture = card.create_texture("shown", record::texture_2d(4, 4, gfx::format::Format::Rgba8Unorm));
        (0..10).for_each(|_| card.present(texture));
        let trace = card.finish();
        let counts = [0..u32::MAX, 0..4, 4..8, 8..20, 12..20].map(|frames| count(&trace, &frames, || false));
        assert_eq!(counts, [10, 4, 4, 2, 0]);
        assert_eq!(count(&trace, &(0..u32::MAX), || true), 0);

        let step = Step { begun: Instant::now(), done: 0, last: None };
        let far = Far { step: Mutex::new(step), frames: AtomicU64::new(0) };
        assert_eq!(far.line(), "rendering");
        let ended = |frame, surveyed, of| far.add(Ended { frame, surveyed, of });
        ended(7, false, None);
        assert_eq!(far.line(), "frame 7 done");
        far.frames.store(10, Ordering::Relaxed);
        assert!(far.line().starts_with("frame 7 done; 1 of 10, "), "{}", far.line());
        // A survey counts what it reads, and what it chooses is counted anew.
        (0..3).for_each(|frame| ended(frame, true, Some(40)));
        assert!(far.line().starts_with("frame 2 surveyed; 3 of 40, "), "{}", far.line());
        ended(5, false, Some(9));
        assert!(far.line().starts_with("frame 5 done; 1 of 9, "), "{}", far.line());
        assert_eq!(time_left(Duration::from_secs(6), 3, 10), Duration::from_secs(20));
    }
}
