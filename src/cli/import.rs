//! `fillrate import`

use std::ops::Range;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::Verdict;
use crate::render;
use crate::run::replay::{frame_range, no_frames};
use crate::trace::{self, Packing, Trace};

/// Turn a foreign trace, or some frames of any trace, into a native one (replay also takes foreign traces directly)
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate import recorded/trace --out mine\n  fillrate import recorded/trace --out mine.zip\n  \
                  fillrate import recorded/trace --frames 60..62 --out piece.zip"
)]
pub struct Arguments {
    /// The trace: a file, or its folder
    trace: PathBuf,
    /// Take these frames only: one, as in 3, or half-open, as in 2..4, 2.. or ..4. The trace replays as they do in the whole, with the same
    /// pictures and cycles, and numbers them from 0
    #[arg(help_heading = "Output", long, value_name = "A..B", value_parser = frame_range)]
    frames: Option<Range<u32>>,
    /// Where to write the native trace: a folder that does not exist or is empty, or a file ending in .zip
    #[arg(help_heading = "Output", long, value_name = "DIR")]
    out: PathBuf,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: super::reading::Reading,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let out = &arguments.out;
    let (read, cut);
    let trace = match &arguments.frames {
        None => {
            read = arguments.reading.open_whole(&arguments.trace)?;
            &read
        }
        Some(frames) => {
            let end = if frames.end == u32::MAX { u64::MAX } else { frames.end.into() };
            read = arguments.reading.open_frames(&arguments.trace, frames.start.into()..end)?;
            let opened = read.origin();
            let Some(piece) = render::piece(&read, frames.clone())? else {
                bail!("{}: there is {}", arguments.trace.display(), no_frames(&read, frames)?);
            };
            arguments.reading.say_at_end(&arguments.trace, &read, &opened);
            cut = piece;
            &cut
        }
    };
    if out.extension().is_some_and(|e| e == "zip") {
        if out.exists() {
            bail!("{} is there already", out.display());
        }
        trace::write_zip(trace, out, Packing::Deflated)?;
    } else {
        let occupied = std::fs::read_dir(out).is_ok_and(|mut entries| entries.next().is_some());
        if occupied || out.is_file() {
            bail!("{} is there already and not empty", out.display());
        }
        let is_new = !out.exists();
        std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
        trace::write(trace, out).inspect_err(|_| remove(trace, out, is_new))?;
    }
    tell!("{}", out.display());
    Ok(super::reading::verdict(&read))
}

/// Removes what has been written of a trace: without its command list, which is written last, it is none, and would be in the way of the
/// next try. What cannot be removed stays: the error that is being reported is the first one.
fn remove(trace: &Trace, folder: &Path, with_folder: bool) {
    for name in trace.blob_names() {
        let _ = std::fs::remove_file(folder.join(name));
    }
    if with_folder {
        let _ = std::fs::remove_dir(folder);
    }
}
