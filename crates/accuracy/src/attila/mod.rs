//! Counters of another simulator, ATTILA, beside those of this one for the same recordings. Both count the same machine:
//! `configs/attila.ron` is that one's configuration as far as this model has it.

mod counters;
mod mechanisms;
mod page;
mod rows;

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, ensure};

use crate::harness::funnel;
use import::{self, TraceKind};
use machine::Config;
use num::Limits;
use run::replay::{Fidelity, Options, replay};
use trace::Reading;

pub use counters::Counters;
pub use mechanisms::mechanisms;
pub use page::{holds, json, markdown, speeds, text};
pub use rows::{Row, Tolerance};

/// Fragments per second that ATTILA shades on a host of our time.
pub const THEIR_FRAGMENTS_A_SECOND: f64 = 26_000.0;

/// Where the counters of a recording lie in its folder.
const COUNTERS: &str = "reference/stats.frames.csv.gz";

/// A recording with counters.
#[derive(Clone, Debug)]
pub struct Case {
    /// Its folder's name.
    pub name: String,
    recording: PathBuf,
    counters: Counters,
    /// The frame that was counted.
    pub frame: u32,
}

/// What came of one.
#[derive(Clone, Debug)]
pub struct RecordingResult {
    /// The recording's name.
    pub name: String,
    /// The frame that was counted.
    pub frame: u32,
    /// Counters of both.
    pub rows: Vec<Row>,
    /// Shaded fragments per second of host time, from the first command to the last statistic.
    pub fragments_a_second: f64,
}

impl RecordingResult {
    /// Our cycles of drawing by theirs.
    pub fn ratio(&self) -> f64 {
        self.rows.iter().find(|row| row.bound == Tolerance::Cycles).map_or(1.0, |row| row.ours / row.theirs)
    }
}

/// The recordings in a folder: each folder in it that has one, in the order of their names.
///
/// # Errors
/// If the folder cannot be read or has none, or the counters of one are missing or damaged.
pub fn cases(folder: &Path) -> Result<Vec<Case>> {
    let fail = || format!("cannot read {}", folder.display());
    let mut folders = Vec::new();
    for entry in std::fs::read_dir(folder).with_context(fail)? {
        let path = entry.with_context(fail)?.path();
        if path.is_dir() {
            folders.push(path);
        }
    }
    folders.sort();
    let mut cases = Vec::new();
    for path in folders {
        let Some(found) = import::detect(&path).filter(|found| found.kind == TraceKind::GlInterceptor) else { continue };
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let counters = Counters::read(&path.join(COUNTERS))?;
        let frame = counters.one("Frame")?;
        ensure!(
            frame.fract() == 0.0 && frame < f64::from(u32::MAX),
            "{}: frame {frame} is none",
            path.join(COUNTERS).display()
        );
        cases.push(Case { name, recording: found.path, counters, frame: frame as u32 });
    }
    ensure!(!cases.is_empty(), "{}: no folder in it has a GLInterceptor recording", folder.display());
    Ok(cases)
}

/// ATTILA's machine, as far as this model has it.
///
/// # Errors
/// As [`Config::built_in`].
pub fn machine() -> Result<Config> {
    Ok(Config::built_in("attila")?)
}

/// How the window is stored, which is a matter of reading; the default is ATTILA's way.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    /// Whether its rows are stored as OpenGL numbers them, the lowest first.
    upward: bool,
    /// Whether it has alpha even if the program does not ask for it.
    alpha: bool,
}

impl Default for Window {
    fn default() -> Window {
        Window { upward: true, alpha: true }
    }
}

impl Case {
    /// Draws the frame that was counted on a machine, and compares.
    ///
    /// # Errors
    /// If the recording does not replay, or a counter is missing.
    pub fn run(&self, machine: &Config) -> Result<RecordingResult> {
        self.run_stored(machine, Window::default())
    }

    /// As [`Case::run`], with the window stored in another way.
    fn run_stored(&self, machine: &Config, Window { upward, alpha }: Window) -> Result<RecordingResult> {
        let frames = self.frame..self.frame + 1;
        let reading =
            Reading { limits: Limits::default(), keep_draws: true, upward, window_alpha: alpha, ..Reading::default() };
        let wanted = u64::from(frames.start)..u64::from(frames.end);
        let (trace, report) = import::open_frames(&self.recording, &reading, wanted)?;
        if let Some(refusal) = report.and_then(|report| report.refusal()) {
            anyhow::bail!("{}: not supported: {refusal}", self.recording.display());
        }
        let options = Options { frames, per_draw: true, ..Options::new(machine.clone(), Fidelity::Cycle) };
        let replayed = replay(&trace, &options, &|_| ()).with_context(|| self.name.clone())?;
        let frame = replayed
            .frames
            .iter()
            .find(|frame| frame.number == self.frame)
            .with_context(|| format!("{}: no frame {}", self.recording.display(), self.frame))?;
        let rows = rows::rows(&self.counters, frame)?;
        let shaded = 4.0 * funnel(&frame.tree)?.quads_shaded as f64;
        let fragments_a_second = shaded / replayed.clock_time.as_secs_f64().max(1e-9);
        Ok(RecordingResult { name: self.name.clone(), frame: self.frame, rows, fragments_a_second })
    }
}

/// The geometric mean.
pub fn geometric_mean(values: impl Iterator<Item = f64>) -> f64 {
    let (mut sum, mut count) = (0.0, 0.0);
    for value in values {
        sum += libm::log(value);
        count += 1.0;
    }
    libm::exp(sum / f64::max(count, 1.0))
}
