//! `fillrate why`

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail};

use super::Verdict;
use super::threads::MOST;
use crate::host;
use crate::machine::Config;
use crate::render::{self, FrameSet};
use crate::report::owned::check_replaceable;
use crate::report::summary::grouped;
use crate::report::verdict::sentence;
use crate::run::replay::frame_range;
use crate::run::stored_work::slowest;
use crate::trace::{Trace, check};
use crate::why::{Diagnosis, Gain, why};

/// Find what holds a frame back: time it again with more of one resource at a time, and rank what that gains
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate why traces/town.zip\n  fillrate why traces/flight.zip --frames 100 --config sort-middle-binned\n\n\
Without --frames, of a trace with several frames the one is taken that takes most cycles by estimate. Caches are cold when the first frame begins."
)]
pub struct Arguments {
    /// The trace: a file, or its folder; native or foreign
    trace: PathBuf,
    #[command(flatten, next_help_heading = "Machine")]
    machine: super::configs::Choice,
    /// Frames: one, as in 3, or half-open, as in 2..4, 2.. or ..4 [default: the slowest one]
    #[arg(help_heading = "Simulation", long, value_name = "A..B")]
    frames: Option<String>,
    /// Try changes of scan-out, too: what reading the frame for the screen costs is the same for every frame of its size
    #[arg(help_heading = "Simulation", long)]
    scan_out: bool,
    /// Threads; no result depends on it [default: all processors]
    #[arg(help_heading = "Simulation", long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
    /// Changes that are listed
    #[arg(help_heading = "Output", long, value_name = "N", default_value = "12")]
    rows: usize,
    /// Where to leave all of it as JSON; -: print it instead of the text
    #[arg(help_heading = "Output", long, value_name = "FILE")]
    json: Option<PathBuf>,
    /// With --json: replace a file that fillrate has not written
    #[arg(help_heading = "Output", long, requires = "json")]
    force: bool,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: super::reading::Reading,
}

/// What tells the file of `--json` from others.
const MARK: &[u8] = br#""generator": "fillrate""#;

/// The frame that takes most cycles by estimate.
fn chosen(trace: &Trace, config: &Config) -> Result<u32> {
    let frames = check(trace)?.frames;
    match frames {
        0 => bail!("the trace has no frame"),
        1 => Ok(0),
        _ => slowest(trace, &render::Options { frames: FrameSet::from(0..u32::MAX), ..render::Options::default() }, config),
    }
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let printed = arguments.json.as_deref().is_some_and(|path| path == Path::new("-"));
    if let Some(path) = arguments.json.as_ref().filter(|_| !printed) {
        check_replaceable(path, MARK, arguments.force)?;
    }
    let config = arguments.machine.load()?;
    // A recording is read for these frames alone, as a replay of them reads it: so its passes have the same numbers and cycles there.
    let frames = match &arguments.frames {
        Some(text) => frame_range(text).map_err(|reason| anyhow::anyhow!("--frames {text}: {reason}"))?,
        None => {
            let trace = arguments.reading.open(&arguments.trace)?;
            let frame = if trace.presents(1) || !check(&trace)?.draws_nothing() { chosen(&trace, &config)? } else { 0 };
            frame..frame + 1
        }
    };
    let end = if frames.end == u32::MAX { u64::MAX } else { u64::from(frames.end) };
    let trace = arguments.reading.open_frames(&arguments.trace, u64::from(frames.start)..end)?;
    let opened = trace.origin();
    if !trace.presents(1) && check(&trace)?.draws_nothing() {
        bail!("{}: the trace draws nothing, so that nothing holds a frame back", arguments.trace.display());
    }
    let bar = super::progress::bar("{spinner} {elapsed} machines timed: {pos} of {len}, {eta} left");
    let told = |all| {
        bar.set_length(all as u64);
        bar.inc(1);
    };
    let found = why(&trace, &config, frames.clone(), arguments.scan_out, &told)?;
    bar.finish_and_clear();
    arguments.reading.say_at_end(&arguments.trace, &trace, &opened);
    if let Some(path) = &arguments.json {
        let mut json = found.json();
        if let Some(json) = json.as_object_mut() {
            json.shift_insert(0, "generator".into(), "fillrate".into());
        }
        if printed {
            super::say_json(&json)?;
        } else {
            let text = serde_json::to_string_pretty(&json)?;
            host::write_file(path, format!("{text}\n").as_bytes())
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
    }
    let last = frames.end.saturating_sub(1);
    let named = if frames.start == last { format!("frame {last}") } else { format!("frames {}..{}", frames.start, frames.end) };
    let (cycles, read) = (found.base.cycles, found.base.scan_out());
    // A display that runs beside drawing takes the cycles of a hand-over.
    let apart = if !arguments.scan_out && 100 * read >= cycles {
        format!(", {} of them scan-out, which --scan-out ranks too", grouped(read))
    } else {
        String::new()
    };
    if !printed {
        println!("{} on {}, {named}: {} cycles{apart}\n", arguments.trace.display(), config.name, grouped(cycles));
        print!("{}", table(&found, arguments.rows));
    }
    let mut verdict = super::reading::verdict(&trace);
    for (change, fault) in found.faults() {
        eprintln!("error: with {change}: {fault}");
        verdict = Verdict::Failed;
    }
    Ok(verdict)
}

/// The ranked changes.
fn table(found: &Diagnosis, rows: usize) -> String {
    let mut out = format!("{}\n\n", found.verdict());
    for (title, findings) in [("in the frame", found.in_the_frame()), ("on the card", found.on_the_card())] {
        if !findings.is_empty() {
            out.push_str(&format!("{title}\n"));
        }
        for finding in &findings {
            out.push_str(&format!("  {}\n", sentence(&finding.sentence)));
            let draws = finding.draws();
            for line in [&finding.evidence, &draws].into_iter().filter(|line| !line.is_empty()) {
                out.push_str(&format!("    {line}\n"));
            }
        }
        out.push_str(if findings.is_empty() { "" } else { "\n" });
    }
    out.push_str(&format!(
        "  {:<44}{:>14}{:>9}   {}\n",
        "with this change alone", "cycles", "change", "most in: what was seen there without the change"
    ));
    let (some, none): (Vec<&Gain>, Vec<&Gain>) = found.gains.iter().partition(|gain| gain.matters(&found.base));
    for gain in some.iter().take(rows) {
        let title = &gain.relaxation.title;
        match (&gain.timed, gain.share(&found.base)) {
            (Ok(timed), Some(share)) => {
                let most = gain.most(&found.base).map_or("other passes than before".into(), |(name, share)| {
                    format!("{} {:+.1} %", host::one_line(name), -100.0 * share)
                });
                let seen = if gain.evidence.is_empty() { String::new() } else { format!(": {}", gain.evidence) };
                out.push_str(&format!("  {title:<44}{:>14}{:>+8.1} %  {most}{seen}\n", grouped(timed.cycles), -100.0 * share));
            }
            (timed, _) => {
                out.push_str(&format!("  {title:<44}{:>14}           {}\n", "-", timed.as_ref().err().map_or("", |e| e)))
            }
        }
    }
    if some.len() > rows {
        out.push_str(&format!("  {} more changes gain less; --rows N lists them\n", some.len() - rows));
    }
    if !none.is_empty() {
        out.push_str(&format!("  {} changes gain less than 0.05 %\n", none.len()));
    }
    if let Some(best) = found.gains.first().filter(|gain| gain.share(&found.base).is_some_and(|share| share > 0.0)) {
        out.push_str(&format!("\nproof of the first: replay the frame with {}\n", best.relaxation.options()));
    }
    out
}
