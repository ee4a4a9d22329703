//! `fillrate accuracy skips`

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::skips::{SKIPS, savings, table};
use crate::import;

/// Host times are the least of so many runs.
const RUNS: usize = 3;

/// What is skipped because a scene does not need it: work and time saved, and that nothing else changes
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate accuracy skips traces/layers traces/shadow\n\n\
Host times are the least of three runs of both, by turns. Exit code 1 where a skip changes a picture or a counter that it must not.")]
pub struct Arguments {
    /// Traces
    #[arg(required_unless_present = "list")]
    traces: Vec<PathBuf>,
    /// Name the skips and their switches
    #[arg(long)]
    list: bool,
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
    let mut verdict = Verdict::Done;
    for path in &arguments.traces {
        let trace = import::open(path)?;
        let name = path.display().to_string();
        let found = savings(&trace, &config, RUNS).with_context(|| name.clone())?;
        println!("{}", table(&name, &found));
        if found.iter().any(|saving| saving.differs.is_some()) {
            verdict = Verdict::Failed;
        }
    }
    Ok(verdict)
}
