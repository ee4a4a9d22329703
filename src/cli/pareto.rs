//! `fillrate accuracy pareto`

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::classes;
use crate::accuracy::pareto::{Front, errors, front, plot};
use crate::accuracy::sequences::SEQUENCES;
use crate::host;
use crate::run::replay::{Fidelity, Options};
use crate::trace::Trace;

/// Run time against error of all fidelities, on traces
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate accuracy pareto traces/flight.zip traces/corridor --out out\n\n\
Leaves in --out: pareto.md (tables), pareto.json, pareto.svg (a plot). Traces of one frame have no frames to sample.")]
pub struct Arguments {
    /// Traces
    #[arg(required_unless_present = "sequences")]
    traces: Vec<PathBuf>,
    #[command(flatten)]
    reading: super::reading::Reading,
    #[command(flatten)]
    machine: super::configs::Choice,
    /// Compare generated sequences of this number of frames, too
    #[arg(long, value_name = "FRAMES", conflicts_with = "classes")]
    sequences: Option<u32>,
    /// Frames to sample beside the first; several make several runs
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "2,3,4,8,16,32", value_parser = clap::value_parser!(u32).range(2..))]
    samples: Vec<u32>,
    /// Seed of the sampling generator
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
    /// Print one table of the errors of all traces, without host times: the same on every host
    #[arg(long, conflicts_with = "out")]
    errors: bool,
    /// Print one table of the errors of bound in every sort class, with the knobs of the configuration
    #[arg(long, conflicts_with_all = ["out", "errors"])]
    classes: bool,
    /// Where to leave table and plot
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let config = arguments.machine.load()?;
    let options = Options::new(config, Fidelity::Cycle);
    let mut verdict = Verdict::Done;
    if arguments.classes {
        let mut found = Vec::new();
        for path in &arguments.traces {
            let (name, trace) = (path.display().to_string(), arguments.reading.open(path)?);
            found.push(classes::errors(&name, &trace, &options).with_context(|| name.clone())?);
            verdict = verdict.and(super::reading::verdict(&trace));
        }
        print!("{}", classes::table(&found));
        return Ok(verdict);
    }
    let mut fronts: Vec<Front> = Vec::new();
    let open = |path: &PathBuf| -> Result<(String, Trace)> { Ok((path.display().to_string(), arguments.reading.open(path)?)) };
    let opened = arguments.traces.iter().map(open);
    let generated = arguments.sequences.into_iter().flat_map(|frames| {
        SEQUENCES.iter().map(move |sequence| Ok((sequence.name.to_owned(), (sequence.record)(frames).finish())))
    });
    for trace in opened.chain(generated) {
        let (name, trace) = trace?;
        let found = front(&name, &trace, &options, &arguments.samples, arguments.seed).with_context(|| name.clone())?;
        if !arguments.errors {
            println!("{}", found.table());
        }
        fronts.push(found);
        verdict = verdict.and(super::reading::verdict(&trace));
    }
    if arguments.errors {
        print!("{}", errors(&fronts));
    }
    if let Some(out) = &arguments.out {
        std::fs::create_dir_all(out).with_context(|| format!("cannot create {}", out.display()))?;
        let put = |name: &str, text: String| {
            let path = out.join(name);
            host::write_file(&path, text.as_bytes()).with_context(|| format!("cannot write {}", path.display()))
        };
        let tables: Vec<String> = fronts.iter().map(Front::table).collect();
        put("pareto.md", tables.join("\n"))?;
        put("pareto.json", serde_json::to_string_pretty(&fronts.iter().map(Front::json).collect::<Vec<_>>())?)?;
        put("pareto.svg", plot(&fronts))?;
        println!("written to {}", out.display());
    }
    Ok(verdict)
}
