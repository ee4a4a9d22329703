//! `fillrate accuracy skips`

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::skips::{SKIPS, Turns, savings, table};

/// What is skipped because a scene does not need it: work and time saved, and that nothing else changes
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate accuracy skips traces/layers traces/shadow\n\n\
Host times: the median of what a run with the skip takes less than one without, three pairs of runs or more by turns, \
and two standard errors of it. Exit code 1 where a skip changes a picture or a counter that it must not.")]
pub struct Arguments {
    /// Traces
    #[arg(required_unless_present = "list")]
    traces: Vec<PathBuf>,
    #[command(flatten)]
    reading: super::reading::Reading,
    /// Name the skips and their switches
    #[arg(long)]
    list: bool,
    /// Seconds for which both sides of each skip are run by turns; more tell host times apart
    #[arg(long, default_value_t = 1.0, value_name = "SECONDS")]
    seconds: f64,
    #[command(flatten)]
    machine: super::configs::Choice,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    if arguments.list {
        for skip in SKIPS {
            println!("{}: {}\n  {}", skip.name, skip.what, skip.switch);
        }
        return Ok(Verdict::Done);
    }
    let config = arguments.machine.load()?;
    let time = Duration::try_from_secs_f64(arguments.seconds).context("--seconds")?;
    let turns = Turns { least: 3, time };
    let mut verdict = Verdict::Done;
    for path in &arguments.traces {
        let trace = arguments.reading.open(path)?;
        let name = path.display().to_string();
        let found = savings(&trace, &config, turns).with_context(|| name.clone())?;
        println!("{}", table(&name, &found));
        if found.iter().any(|saving| saving.differs.is_some()) {
            verdict = Verdict::Failed;
        }
    }
    Ok(verdict)
}
