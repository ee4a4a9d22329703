//! `fillrate accuracy estimates`

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::{classes, estimates};
use crate::run::replay::{Fidelity, Options};

/// Errors of bound on generated scenes, in every sort class
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate accuracy estimates --scenes 10 --each\n\n\
Takes about five seconds for each scene.")]
pub struct Arguments {
    #[command(flatten)]
    machine: super::configs::Choice,
    /// Scenes
    #[arg(long, value_name = "N", default_value = "40", value_parser = clap::value_parser!(u32).range(1..=10_000))]
    scenes: u32,
    /// Seed of the first scene; each has the next
    #[arg(long, value_name = "SEED", default_value = "1000")]
    seed: u64,
    /// Leave the scenes as traces here, and do no more
    #[arg(long, value_name = "DIR", conflicts_with = "each")]
    traces: Option<PathBuf>,
    /// Print the errors of each scene too
    #[arg(long)]
    each: bool,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let options = Options::new(arguments.machine.load()?, Fidelity::Cycle);
    let seeds = (0..u64::from(arguments.scenes)).map(|n| arguments.seed.saturating_add(n));
    if let Some(folder) = &arguments.traces {
        for seed in seeds {
            let path = folder.join(format!("scene-{seed}"));
            estimates::record(seed).save(&path).with_context(|| format!("cannot write {}", path.display()))?;
        }
        println!("written to {}", folder.display());
        return Ok(Verdict::Done);
    }
    let found = estimates::generated(seeds, &options)?;
    if arguments.each {
        println!("{}", classes::table(&found));
    }
    print!("{}", estimates::table(&found));
    Ok(Verdict::Done)
}
