//! `fillrate configs`

use std::path::Path;

use anyhow::{Context, Result};

use super::Verdict;
use crate::host;
use crate::machine::config::BUILT_IN;
use crate::machine::{Config, Machine};
use crate::report::compare::{KnobDifference, configurations};
use crate::report::diagram::Diagram;

/// List the built-in configurations; with NAME, print one fully resolved, or draw its machine
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  fillrate configs\n  fillrate configs tiny\n  fillrate configs baseline --set memory.kind=ideal > mine.ron\n  \
fillrate configs sort-first --draw | dot -Tpdf > machine.pdf\n  fillrate configs sort-first --draw=svg > machine.svg"
)]
pub struct Arguments {
    /// A built-in configuration, or a file
    name: Option<String>,
    /// Set one knob; may be repeated
    #[arg(long, value_name = "PATH=VALUE", requires = "name")]
    set: Vec<String>,
    /// Draw the machine from itself, units and channels as they are wired: for Graphviz, or as a picture
    #[arg(long, value_enum, value_name = "FORMAT", requires = "name", num_args = 0..=1, default_missing_value = "dot")]
    draw: Option<Drawing>,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum Drawing {
    /// The language of Graphviz
    Dot,
    /// A picture, laid out here
    Svg,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    match &arguments.name {
        Some(name) => {
            let config = load(name, &arguments.set)?;
            match arguments.draw {
                None => print!("{}", config.resolved()),
                Some(Drawing::Dot) => print!("{}", Diagram::new(&Machine::new(&config)?).dot()),
                Some(Drawing::Svg) => print!("{}", Diagram::new(&Machine::new(&config)?).svg()),
            }
        }
        None => {
            for (name, text) in BUILT_IN {
                println!("{name:<20}{}", about(text));
            }
        }
    }
    Ok(Verdict::Done)
}

/// The machine that a command is asked to run.
#[derive(clap::Args)]
pub struct Choice {
    /// A built-in configuration, or a file
    #[arg(long, value_name = "NAME|FILE", default_value = "baseline")]
    config: String,
    /// Set one knob of the configuration; may be repeated
    #[arg(long, value_name = "PATH=VALUE")]
    set: Vec<String>,
}

impl Choice {
    /// The options as they were given, for another command.
    pub fn options(&self) -> Vec<String> {
        let set = self.set.iter().flat_map(|setting| ["--set".to_owned(), setting.clone()]);
        ["--config".to_owned(), self.config.clone()].into_iter().chain(set).collect()
    }

    /// Its configuration.
    pub fn load(&self) -> Result<Config> {
        load(&self.config, &self.set)
    }

    /// Every knob in which a configuration differs from the one that is named.
    pub fn changed(&self, config: &Config) -> Result<Vec<KnobDifference>> {
        if self.set.is_empty() {
            return Ok(Vec::new());
        }
        Ok(configurations(&load(&self.config, &[])?, config))
    }
}

/// Bytes of a configuration at most; the largest built-in one has 45,000.
const TEXT_MAX: u64 = 256 << 10;

/// A built-in configuration or one in a file, with knobs set.
pub fn load(name: &str, settings: &[String]) -> Result<Config> {
    let is_built_in = BUILT_IN.iter().any(|(known, _)| *known == name);
    let mut config = if is_built_in || !Path::new(name).exists() {
        Config::built_in(name)?
    } else {
        let text = host::read_text(Path::new(name), TEXT_MAX).with_context(|| format!("cannot read {name}"))?;
        Config::parse(name, &text)?
    };
    for setting in settings {
        config.set(setting)?;
    }
    config.check()?;
    Ok(config)
}

/// The first sentence of the comment at the top of a configuration.
fn about(text: &str) -> String {
    let comment: Vec<&str> = text.lines().map_while(|line| line.strip_prefix("//")).map(str::trim).collect();
    let comment = comment.join(" ");
    comment.split_inclusive(". ").next().unwrap_or_default().trim().to_owned()
}
