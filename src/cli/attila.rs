//! `fillrate accuracy attila`

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::attila::{self, RecordingResult};

/// Counters of the simulator ATTILA for recordings, beside those of this one on configs/attila.ron
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate accuracy attila peers/attila\n  FILLRATE_PEERS=peers fillrate accuracy attila --markdown\n\n\
Each folder in it has a GLInterceptor recording and reference/stats.frames.csv.gz. Exit code 1 where a bound does not hold."
)]
pub struct Arguments {
    /// Folder of recordings [default: attila in the folder that FILLRATE_PEERS names]
    #[arg(value_name = "DIR")]
    folder: Option<PathBuf>,
    /// Recordings by name [default: all]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    only: Vec<String>,
    /// Change a knob of the machine; may be repeated
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// As JSON; times of the host are left out
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// As the table of docs/data/attila.md; ends with exit code 0 whatever holds
    #[arg(long)]
    markdown: bool,
    /// Times of the host alone
    #[arg(long, conflicts_with = "json")]
    speed: bool,
    /// What each mechanism of ATTILA's machine is worth: the comparison without it, as the table of docs/data/attila.md
    #[arg(long, conflicts_with_all = ["json", "markdown", "speed"])]
    mechanisms: bool,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let folder = match &arguments.folder {
        Some(folder) => folder.clone(),
        None => {
            PathBuf::from(std::env::var_os("FILLRATE_PEERS").context("name a folder of recordings, or set FILLRATE_PEERS")?)
                .join("attila")
        }
    };
    let mut cases = attila::cases(&folder)?;
    for name in &arguments.only {
        if !cases.iter().any(|case| case.name == *name) {
            anyhow::bail!("{}: no recording {name}", folder.display());
        }
    }
    if !arguments.only.is_empty() {
        cases.retain(|case| arguments.only.contains(&case.name));
    }
    let mut machine = attila::machine()?;
    for assignment in &arguments.set {
        machine.set(assignment)?;
    }
    machine.check()?;
    if arguments.mechanisms {
        print!("{}", attila::mechanisms(&cases, &machine)?);
        return Ok(Verdict::Done);
    }
    // One after another: times of the host are of one recording at a time.
    let outcomes = cases.iter().map(|case| case.run(&machine)).collect::<Result<Vec<RecordingResult>>>()?;
    if arguments.json {
        super::say_json(&attila::json(&outcomes))?;
    } else if arguments.speed {
        print!("{}", attila::speeds(&outcomes, arguments.markdown));
    } else if arguments.markdown {
        print!("{}", attila::markdown(&outcomes));
    } else {
        print!("{}{}", attila::text(&outcomes), attila::speeds(&outcomes, false));
    }
    Ok(if arguments.markdown || attila::holds(&outcomes) { Verdict::Done } else { Verdict::Failed })
}
