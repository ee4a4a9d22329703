//! `fillrate demo`

use std::path::PathBuf;

use anyhow::{Context, Result, bail};
use clap::Parser;

use super::Verdict;
use super::built_in::scene;
use super::threads::MOST;
use crate::num::Limits;
use crate::report::html::word;
use crate::scenes;
use crate::sweep::experiment;
use crate::trace::check;

/// Frames of a scene up to which a demonstration simulates all; of more it simulates some.
const ALL_OF: u64 = 16;

/// Replay a built-in scene and leave its picture and its page; without a scene, list scenes and experiments
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate demo\n  fillrate demo cube\n  fillrate demo town --config sort-middle-binned --out town\n\n\
Every command takes @NAME for a built-in scene in place of a trace, and `sweep` takes @NAME for a built-in experiment."
)]
pub struct Arguments {
    /// The scene; without it, list all
    scene: Option<String>,
    /// List scenes and experiments
    #[arg(long, conflicts_with = "scene")]
    list: bool,
    #[command(flatten, next_help_heading = "Machine")]
    machine: super::configs::Choice,
    /// Where to leave pictures, statistics and report.html [default: demo-SCENE]
    #[arg(help_heading = "Output", long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads; no result depends on it [default: all processors]
    #[arg(help_heading = "Simulation", long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let Some(name) = &arguments.scene else {
        list();
        return Ok(Verdict::Done);
    };
    let name = name.trim_start_matches('@');
    let title = format!("@{name}");
    let Some(scene) = scene(title.as_ref())? else { bail!("{title} is no scene") };
    let out = arguments.out.clone().unwrap_or_else(|| format!("demo-{name}").into());
    let out = out.to_str().context("--out is no Unicode")?;
    let mut words = vec!["fillrate".to_owned(), "replay".into(), title.clone()];
    words.extend(arguments.machine.options());
    let frames = check(&scene.open(&Limits::default())?)?.frames;
    if frames > ALL_OF {
        words.extend(["--fidelity", "sampled"].map(String::from));
    }
    words.extend(["--out".into(), out.to_owned(), "--report".into(), format!("{out}/report.html")]);
    let super::Command::Replay(replayed) = super::Arguments::try_parse_from(&words)?.command else {
        bail!("the command of {title} is no replay")
    };
    let verdict = super::replay::run(&replayed)?;
    tell!("\nThe same by hand: {}", words.iter().map(|text| word(text)).collect::<Vec<_>>().join(" "));
    Ok(verdict)
}

/// Prints all scenes and experiments.
fn list() {
    println!("Scenes: `fillrate demo NAME`, or @NAME in place of a trace");
    for scene in scenes::ALL {
        println!("  {:<20}{}", scene.name, scene.about);
    }
    println!("\nExperiments: `fillrate sweep @NAME --out DIR`");
    for experiment in experiment::BUILT_IN {
        println!("  {:<20}{}", experiment.name, experiment.question());
    }
}
