//! `fillrate accuracy`

use anyhow::{Context, Result};

use super::threads::MOST;
use super::{Verdict, attila, builds, card, estimates, knobs, pareto, runs, scenes, shortcuts, skips};
use crate::accuracy::{self, Setting, Size, Target, TargetResult};

/// Measure what a correct model must reproduce: identities, rules of specifications, closed forms
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    after_help = "Examples:\n  fillrate accuracy\n  fillrate accuracy oracle --size large\n  \
fillrate accuracy fill-rules depth --seed 1,2,3 --json\n  \
fillrate accuracy --seed 1,2,3 --size small,standard --markdown\n\n\
Exit code 1 where a target does not hold."
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// Targets by name, or by the first word of their names (`gl`) [default: all]
    #[arg(value_name = "TARGET")]
    targets: Vec<String>,
    /// Name the targets, and what each is about
    #[arg(long)]
    list: bool,
    /// As JSON, when all is done
    #[arg(long, conflicts_with = "markdown")]
    json: bool,
    /// As the page docs/data/accuracy.md, when all is done
    #[arg(long)]
    markdown: bool,
    /// Seed of the random number generator; several make several runs
    #[arg(long, value_name = "N", value_delimiter = ',', default_value = "1")]
    seed: Vec<u64>,
    /// How much is done; several make several runs
    #[arg(long, value_enum, value_delimiter = ',', default_value = "standard")]
    size: Vec<SizeName>,
    /// Inject the fault that --list names for each target, which must then fail
    #[arg(long)]
    inject_fault: bool,
    /// Threads; no result depends on it [default: all processors]
    #[arg(long, global = true, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
}

#[derive(clap::Subcommand)]
enum Command {
    Attila(attila::Arguments),
    Builds(builds::Arguments),
    Card(card::Arguments),
    Estimates(estimates::Arguments),
    Knobs(knobs::Arguments),
    Pareto(pareto::Arguments),
    Runs(runs::Arguments),
    Scenes(scenes::Arguments),
    Shortcuts(shortcuts::Arguments),
    Skips(skips::Arguments),
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum SizeName {
    /// Seconds: what the test suite does
    Small,
    /// As much as each target asks for, or more
    Standard,
    /// Minutes: millions of cases
    Large,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    match &arguments.command {
        Some(Command::Attila(arguments)) => return attila::run(arguments),
        Some(Command::Builds(arguments)) => return builds::run(arguments),
        Some(Command::Card(arguments)) => return card::run(arguments),
        Some(Command::Estimates(arguments)) => return estimates::run(arguments),
        Some(Command::Knobs(arguments)) => return knobs::run(arguments),
        Some(Command::Pareto(arguments)) => return pareto::run(arguments),
        Some(Command::Runs(arguments)) => return runs::run(arguments),
        Some(Command::Scenes(arguments)) => return scenes::run(arguments),
        Some(Command::Shortcuts(arguments)) => return shortcuts::run(arguments),
        Some(Command::Skips(arguments)) => return skips::run(arguments),
        None => {}
    }
    let targets: Vec<&'static Target> = if arguments.targets.is_empty() {
        accuracy::targets().collect()
    } else {
        arguments.targets.iter().map(|id| accuracy::find_all(id)).collect::<Result<Vec<_>>>()?.concat()
    };
    if arguments.list {
        list(&targets);
        return Ok(Verdict::Done);
    }
    let quiet = arguments.json || arguments.markdown;
    if !quiet {
        print!("{}", accuracy::header());
    }
    let mut outcomes: Vec<TargetResult> = Vec::new();
    for (&size, &seed) in arguments.size.iter().flat_map(|size| arguments.seed.iter().map(move |seed| (size, seed))) {
        let size = match size {
            SizeName::Small => Size::Small,
            SizeName::Standard => Size::Standard,
            SizeName::Large => Size::Large,
        };
        let setting = Setting { seed, size, inject_fault: arguments.inject_fault };
        if !quiet && arguments.size.len() * arguments.seed.len() > 1 {
            println!("seed {seed}, size {}", accuracy::size_name(size));
        }
        for target in &targets {
            let outcome = target.run(&setting).with_context(|| format!("target {}", target.id))?;
            if !quiet {
                print!("{}", accuracy::lines(&outcome));
                super::flush();
            }
            outcomes.push(outcome);
        }
    }
    if arguments.json {
        super::say_json(&accuracy::json(&outcomes))?;
    } else if arguments.markdown {
        print!("{}", accuracy::markdown(&outcomes));
    }
    let failed = outcomes.iter().filter(|outcome| !outcome.holds()).count();
    if !quiet {
        println!("{} of {} hold", outcomes.len() - failed, outcomes.len());
    }
    Ok(if failed > 0 { Verdict::Failed } else { Verdict::Done })
}

fn list(targets: &[&'static Target]) {
    let mut section = None;
    for target in targets {
        if section.replace(target.section) != Some(target.section) {
            println!("{}", target.section.title());
        }
        println!("  {:<16} {}", target.id, target.what);
        println!("  {:<16} bound: {}; fault: {}", "", target.bound, target.fault);
    }
}
