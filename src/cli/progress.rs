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

/// A spinner on a terminal, nothing elsewhere or with `--quiet`.
pub fn bar(template: &str) -> ProgressBar {
    if super::is_quiet() || !std::io::stderr().is_terminal() {
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

/// What the spinner says: the last frame, how many are done of how many, or what share of a recording that is read as a stream, how many per second,
/// how long the rest takes; and once a limit comes near, the command that runs and how much of the limit is used.
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
    trace: Arc<Trace>,
    /// The first frame that is asked for.
    first: u32,
}

/// Frames that end in the same way, one after another.
struct Step {
    begun: Instant,
    done: u64,
    last: Option<Ended>,
}

impl Far {
    fn new(trace: Arc<Trace>, first: u32) -> Far {
        let step = Step { begun: Instant::now(), done: 0, last: None };
        Far { step: Mutex::new(step), frames: AtomicU64::new(0), trace, first }
    }

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
        self.line_after(begun.elapsed(), done, last)
    }

    /// The line when `done` frames have ended after the time `elapsed`.
    fn line_after(&self, elapsed: Duration, done: u64, last: Option<Ended>) -> String {
        let Some(Ended { frame, surveyed, of }) = last else {
            // Nothing comes out of a stream before its first frame that is asked for, nor while only its commands are read.
            let Some(read) = self.trace.share_read().filter(|&read| read > 0.0) else { return "rendering".into() };
            return format!("{:.1} % of the recording read", 100.0 * read);
        };
        let what = if surveyed { "surveyed" } else { "done" };
        let counted = Some(self.frames.load(Ordering::Relaxed)).filter(|&frames| frames > 0);
        let left = of.or(counted).and_then(|of| of.checked_sub(done));
        // Where frames are chosen, or a survey reads several parts at once, their numbers do not tell how far it is.
        let share = if of.is_none() { self.trace.share_of(u64::from(frame) + 1) } else { None };
        let by_share = share.and_then(|share| {
            let before = self.trace.share_of(u64::from(self.first)).unwrap_or(0.0);
            (share > before).then(|| time_left(elapsed, share - before, 1.0 - share))
        });
        let by_count = left.map(|left| time_left(elapsed, done as f64, left as f64));
        // A replay ends with the last frame that is asked for, or with the recording, whichever comes first.
        let Some(time) = by_share.into_iter().chain(by_count).min() else { return format!("frame {frame} {what}") };
        let mut line = format!("frame {frame} {what}; ");
        if let Some(left) = left {
            line += &format!("{done} of {}, ", done + left);
        }
        if let Some(share) = share {
            line += &format!("{:.1} % of the recording, ", 100.0 * share);
        }
        let rate = done as f64 / elapsed.as_secs_f64().max(1e-9);
        line + &format!("{rate:.1} frames per second, {:#} left", HumanDuration(time))
    }
}

/// The time for the rest, at the mean rate until now.
fn time_left(elapsed: Duration, done: f64, left: f64) -> Duration {
    Duration::try_from_secs_f64(elapsed.as_secs_f64() * left / done).unwrap_or_default()
}

/// Counts these frames of a trace, until the replay is over. A recording that is translated while it is read would be translated twice: there
/// it is those that are asked for, 0 if that is all.
fn count(trace: &Trace, frames: &Range<u32>, over: impl Fn() -> bool) -> u64 {
    if trace.is_stream() {
        return if frames.end == u32::MAX { 0 } else { frames.len() as u64 };
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
        let far = Arc::new(Far::new(trace.clone(), frames.start));
        let (mine, bar_of, watch) = (far.clone(), bar.clone(), watch.clone());
        let write = move || {
            let counted = count(&mine.trace, &frames, || end.try_recv() == Err(TryRecvError::Disconnected));
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
    use crate::import::open_frames;
    use crate::machine::Config;
    use crate::run::replay::{Fidelity, Options, replay_to};
    use crate::trace::Reading;
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

        let far = Far::new(Arc::new(trace), 0);
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
        let line = far.line_after(Duration::from_secs(6), 3, Some(Ended { frame: 2, surveyed: false, of: Some(13) }));
        assert_eq!(line, "frame 2 done; 3 of 13, 0.5 frames per second, 20s left");
    }

    /// A recording of `frames` equal frames, opened as a stream. Each has a comment of `comment` bytes.
    fn recording(frames: usize, comment: usize, wanted: Range<u64>) -> (tempfile::TempDir, Arc<Trace>) {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("frames.txt");
        let frame = "glClear(GL_COLOR_BUFFER_BIT)\nglRectf(-1,-1,0,0)\nwglSwapBuffers(1)\n";
        let frame = format!("#{}\n{frame}", "-".repeat(comment));
        std::fs::write(&path, format!("GLI0.t\n#! RES 8x8\n{}", frame.repeat(frames))).expect("a file");
        let reading = Reading { in_memory: Some(0), ..Default::default() };
        let (trace, _) = open_frames(&path, &reading, wanted).expect("a recording");
        assert!(trace.is_stream());
        (folder, Arc::new(trace))
    }

    #[test]
    fn a_stream_says_what_share_of_the_recording_is_done() {
        // Text is read in pieces of 256 KiB, of which there have to be some.
        const FRAMES: u32 = 4000;
        let (_folder, trace) = recording(FRAMES as usize, 600, 0..u64::MAX);
        assert_eq!(count(&trace, &(0..u32::MAX), || false), 0);
        let far = Far::new(trace.clone(), 0);
        let lines = Mutex::new(Vec::new());
        let config = Config::built_in("baseline").expect("it is built in");
        let options = Options { pictures: false, ..Options::new(config, Fidelity::Functional) };
        let progress = |ended: Ended| {
            // As if each frame took a second.
            let (done, last) = (u64::from(ended.frame) + 1, Some(ended));
            if done % u64::from(FRAMES / 10) == 0 {
                let line = far.line_after(Duration::from_secs(done), done, last);
                lines.lock().expect("a list").push((done, line));
            }
        };
        replay_to(&trace, &options, &progress, &mut |_| Ok(())).expect("a replay");
        let lines = lines.into_inner().expect("a list");
        assert_eq!(lines.len(), 10);
        for (done, line) in lines {
            let share = line
                .strip_prefix(&format!("frame {} done; ", done - 1))
                .and_then(|rest| rest.split_once(" % of the recording, "));
            let (share, rest) = share.unwrap_or_else(|| panic!("{line}"));
            let (share, truth) = (share.parse::<f64>().expect("a number"), 100.0 * done as f64 / f64::from(FRAMES));
            // A piece has been read before its first frame is.
            let piece = 100.0 * f64::from(256 << 10) / trace.file().metadata().expect("a file").len() as f64;
            assert!((share - truth).abs() <= piece && piece < 15.0, "{share} for {truth}, {piece}");
            assert!(rest.starts_with("1.0 frames per second, ") && rest.ends_with(" left"), "{line}");
        }
    }

    #[test]
    fn frames_that_are_asked_for_or_the_end_of_a_stream_end_it() {
        let (_folder, trace) = recording(100, 0, 0..20);
        assert_eq!(count(&trace, &(4..20), || false), 16);
        let far = Far::new(trace.clone(), 4);
        assert_eq!(far.line(), "rendering");
        trace.for_each_command(|_, _| -> Result<(), TraceError> { Ok(()) }).expect("commands");
        assert_eq!(far.line(), format!("{:.1} % of the recording read", 100.0 * trace.share_read().expect("a length")));
        far.frames.store(16, Ordering::Relaxed);
        let line = |frame: u32, done| {
            let ended = Ended { frame, surveyed: false, of: None };
            far.line_after(Duration::from_secs(8), done, Some(ended))
        };
        // By the count twelve frames are left, and each took two seconds.
        let (first, last) = (line(7, 4), line(19, 16));
        assert!(first.starts_with("frame 7 done; 4 of 16, ") && first.contains("0.5 frames per second"), "{first}");
        assert!(last.ends_with(" 0s left"), "{last}");
    }
}
