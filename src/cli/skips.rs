//! `fillrate accuracy skips`

use std::path::PathBuf;
use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::Verdict;
use crate::accuracy::skips::{SKIPS, Saved, Saving, Turns, across, savings, table};

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
    /// Print tables over all traces, a row a skip and a column a trace; without host, host times are not measured
    #[arg(long, value_enum, value_name = "WHAT", value_delimiter = ',')]
    table: Vec<TableName>,
    /// Seconds of host time for each skip; longer runs measure smaller differences [default: 1]
    #[arg(long, value_name = "SECONDS")]
    seconds: Option<f64>,
    #[command(flatten)]
    machine: super::configs::Choice,
}

#[derive(Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum TableName {
    /// Work saved, of what there would be without the skip
    Work,
    /// Simulated cycles saved
    Cycles,
    /// Host time saved, in per cent
    Host,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let config = arguments.machine.load()?;
    if arguments.list {
        for skip in SKIPS {
            println!("{}: {}\n  {}", skip.name, skip.what, skip.switch(&config)?);
        }
        return Ok(Verdict::Done);
    }
    let is_timed = arguments.table.is_empty() || arguments.table.contains(&TableName::Host);
    let turns = if is_timed {
        Turns { least: 3, time: Duration::try_from_secs_f64(arguments.seconds.unwrap_or(1.0)).context("--seconds")? }
    } else if arguments.seconds.is_some() {
        bail!("--seconds applies to host times only, which --table work and cycles do not have");
    } else {
        Turns { least: 1, time: Duration::ZERO }
    };
    let mut verdict = Verdict::Done;
    let mut all: Vec<(String, Vec<Saving>)> = Vec::new();
    for path in &arguments.traces {
        let trace = arguments.reading.open(path)?;
        verdict = verdict.and(super::reading::verdict(&trace));
        let name = path.display().to_string();
        let found = savings(&trace, &config, turns).with_context(|| name.clone())?;
        if arguments.table.is_empty() {
            println!("{}", table(&name, &found));
        }
        for saving in &found {
            let Some(what) = &saving.differs else { continue };
            if !arguments.table.is_empty() {
                eprintln!("{name}: {} changes {what}", saving.skip.name);
            }
            verdict = Verdict::Failed;
        }
        let stem = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        all.push((stem, found));
    }
    for (at, table) in arguments.table.iter().enumerate() {
        let what = match table {
            TableName::Work => Saved::Work,
            TableName::Cycles => Saved::Cycles,
            TableName::Host => Saved::Host,
        };
        print!("{}{}", if at > 0 { "\n" } else { "" }, across(what, &all));
    }
    Ok(verdict)
}
