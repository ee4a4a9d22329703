//! `fillrate accuracy knobs`

use std::path::PathBuf;

use anyhow::Result;

use super::Verdict;
use crate::accuracy::knobs::{changes, compare, json, table};

/// Each knob at the ends of its range: whether estimates follow what it does to cycles
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate accuracy knobs traces/torus-rows.zip traces/viewer.zip\n  \
fillrate accuracy knobs --only memory.dram traces/viewer.zip\n\n\
An estimate misses a change if cycles move by more than 5 % on a trace, and the estimate moves neither the same way nor refuses the machine.")]
pub struct Arguments {
    /// Traces
    #[arg(required = true)]
    traces: Vec<PathBuf>,
    #[command(flatten)]
    reading: super::reading::Reading,
    /// Only knobs whose paths begin like this
    #[arg(long, value_name = "PREFIX", default_value = "")]
    only: String,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    machine: super::configs::Choice,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let config = arguments.machine.load()?;
    let open = |path: &PathBuf| {
        let trace = arguments.reading.open(path)?;
        Ok((path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned(), trace))
    };
    let traces = arguments.traces.iter().map(open).collect::<Result<Vec<_>>>()?;
    let verdict = traces.iter().fold(Verdict::Done, |verdict, (_, trace)| verdict.and(super::reading::verdict(trace)));
    let (mut all, mut idle) = changes(&config);
    all.retain(|change| change.path.starts_with(&arguments.only));
    idle.retain(|path| path.starts_with(&arguments.only));
    let found = compare(all, &traces)?;
    if arguments.json {
        super::say_json(&json(&found, &idle))?;
    } else {
        print!("{}", table(&found, &idle));
    }
    Ok(verdict)
}
