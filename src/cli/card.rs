//! `fillrate accuracy card`

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::card::{self, Benchmark, BenchmarkResult};
use crate::host;

/// Microbenchmarks with published answers, measured on the models of real cards
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate accuracy card\n  fillrate accuracy card lat-l1 rop-blend\n  fillrate accuracy card gtx-980 --json\n  \
fillrate accuracy card --page docs/data\n\nExit code 1 where a benchmark is not as it says."
)]
pub struct Arguments {
    /// Benchmarks by name, or all of a card by the name of its configuration [default: all]
    #[arg(value_name = "NAME")]
    benchmarks: Vec<String>,
    /// Name the benchmarks, what each measures and its fault
    #[arg(long)]
    list: bool,
    /// Change a knob of every card; may be repeated. Formulas follow it, published answers do not
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// Inject the fault that --list names for each benchmark, which must then fail
    #[arg(long)]
    inject_fault: bool,
    /// As JSON
    #[arg(long)]
    json: bool,
    /// Write the page of all benchmarks into this folder, as cards.md
    #[arg(long, value_name = "DIR", conflicts_with_all = ["inject_fault", "benchmarks", "set", "json"])]
    page: Option<PathBuf>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let chosen: Vec<&'static Benchmark> = if arguments.benchmarks.is_empty() {
        card::benchmarks().collect()
    } else {
        arguments.benchmarks.iter().map(|name| card::find(name)).collect::<Result<Vec<_>>>()?.concat()
    };
    if arguments.list {
        for Benchmark { card, name, what, fault, .. } in chosen {
            println!("{card:<15} {name:<18} {what}\n{:<34} fault: {}", "", fault.join(" "));
        }
        return Ok(Verdict::Done);
    }
    let changes: Vec<&str> = arguments.set.iter().map(String::as_str).collect();
    let outcomes = card::run(&chosen, &changes, arguments.inject_fault)?;
    if arguments.json {
        super::say_json(&card::json(&outcomes))?;
    } else {
        print!("{}", card::text(&outcomes));
    }
    if let Some(folder) = &arguments.page {
        let path = folder.join("cards.md");
        host::write_file(&path, card::markdown(&outcomes).as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    Ok(if outcomes.iter().all(BenchmarkResult::holds) { Verdict::Done } else { Verdict::Failed })
}
