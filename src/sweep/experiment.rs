//! An experiment as written: traces, a base configuration, axes, links, and the question.

use std::path::Path;

use anyhow::{Context, Result, bail};
use serde::{Deserialize, Serialize};

use crate::host;

/// Bytes of an experiment's text at most.
const TEXT_MAX: u64 = 1 << 20;

/// An experiment that is built in.
pub struct BuiltIn {
    /// Its name.
    pub name: &'static str,
    /// Its text.
    pub text: &'static str,
}

impl BuiltIn {
    /// The question that it asks: the comment in its first line.
    pub fn question(&self) -> &'static str {
        self.text.lines().next().unwrap_or_default().trim_start_matches(['/', ' '])
    }
}

macro_rules! built_in {
    ($($name:literal)*) => {
        &[$(BuiltIn { name: $name, text: include_str!(concat!("../../configs/experiments/", $name, ".ron")) }),*]
    };
}

/// All experiments that are built in. Their traces are built-in scenes.
pub const BUILT_IN: &[BuiltIn] = built_in!(
    "latency-hiding" "texture-cache" "depth" "sort-class" "vertex-reuse" "tile-size" "unified-shaders" "compression"
);

/// How machines are chosen from the axes.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Design {
    /// Every combination of values.
    #[default]
    Grid,
    /// The base, and each value of each axis alone.
    OneAtATime,
    /// A number of combinations, each value drawn from its axis with the same probability.
    Random {
        /// Machines.
        machines: u32,
        /// Seed of the generator.
        seed: u64,
    },
    /// A number of combinations in which the values of each axis come equally often, as nearly as their numbers allow (McKay, Beckman and
    /// Conover 1979).
    LatinHypercube {
        /// Machines.
        machines: u32,
        /// Seed of the generator.
        seed: u64,
    },
}

/// What estimates a machine before it is simulated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "&str", try_from = "String")]
pub enum Screener {
    /// The `bound` fidelity.
    #[default]
    Bound,
}

impl From<Screener> for &str {
    fn from(by: Screener) -> &'static str {
        match by {
            Screener::Bound => "bound",
        }
    }
}

impl TryFrom<String> for Screener {
    type Error = String;

    fn try_from(text: String) -> Result<Screener, String> {
        if text == "bound" {
            Ok(Screener::Bound)
        } else {
            Err(format!("machines are screened by \"bound\", not by \"{text}\""))
        }
    }
}

/// A screen: all machines are estimated, and those with the fewest cycles are simulated.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Screen {
    /// What estimates them.
    #[serde(default)]
    pub by: Screener,
    /// How many are simulated.
    pub keep: u32,
}

/// How machines are searched for the fastest, instead of simulating all or those that a screen chooses.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Search {
    /// Successive halving: all machines are estimated; the fastest are simulated on few frames, half of these on twice as many, and so on.
    Halving {
        /// Machines of the first rung.
        machines: u32,
    },
}

/// An experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Experiment {
    /// What is asked, in words.
    #[serde(default)]
    pub question: String,
    /// Traces; relative paths begin at the current folder.
    pub traces: Vec<String>,
    /// What the traces differ in, where they are one scene that was recorded in several ways: the page compares them by it, as by an axis.
    #[serde(default)]
    pub trace_axis: String,
    /// Frames, as in `replay --frames`.
    #[serde(default = "all")]
    pub frames: String,
    /// The configuration that is varied: a built-in one or a file.
    #[serde(default = "baseline")]
    pub base: String,
    /// Knobs set for all machines, as in `replay --set`.
    #[serde(default)]
    pub set: Vec<String>,
    /// Axes, each `PATH=VALUES`.
    #[serde(default)]
    pub vary: Vec<String>,
    /// Variables that are no knobs, each `NAME=VALUES` with whole numbers: axes that links and conditions read.
    #[serde(default, rename = "let", skip_serializing_if = "Vec::is_empty")]
    pub variables: Vec<String>,
    /// Knobs that follow from others and from variables, each `PATH=FORMULA`.
    #[serde(default)]
    pub link: Vec<String>,
    /// Conditions that a combination must meet to be a machine, each two formulae with `<=`, `<`, `>=`, `>`, `==` or `!=` between them.
    #[serde(default, rename = "where", skip_serializing_if = "Vec::is_empty")]
    pub conditions: Vec<String>,
    /// How machines are chosen from the axes.
    #[serde(default)]
    pub design: Design,
    /// A screen before the simulation.
    #[serde(default)]
    pub screen: Option<Screen>,
    /// A search instead of a screen.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub search: Option<Search>,
    /// Statistics that are kept: paths, each with all below it. Empty: all.
    #[serde(default)]
    pub keep: Vec<String>,
    /// What is measured of machines beside cycles: formulae over statistics that are kept, banks, frames and traces summed; each as `FORMULA`
    /// or `NAME = FORMULA`.
    #[serde(default)]
    pub measures: Vec<String>,
    /// What a machine costs, a formula over its knobs as links have, and over `area`, the bytes of SRAM of the [area model](super::area): the page sets
    /// it against cycles. Empty: the bytes of DRAM traffic are.
    #[serde(default)]
    pub cost: String,
}

fn all() -> String {
    "..".into()
}

fn baseline() -> String {
    "baseline".into()
}

impl Experiment {
    /// Reads an experiment from a file.
    ///
    /// # Errors
    /// If it cannot be read or is none; the message has file, line and column.
    pub fn open(path: &Path) -> Result<Experiment> {
        let name = path.display();
        let text = host::read_text(path, TEXT_MAX).with_context(|| format!("cannot read {name}"))?;
        Experiment::parse(&name.to_string(), &text)
    }

    /// Reads an experiment from its text; `name` is what messages call it.
    ///
    /// # Errors
    /// If it is none; the message has line and column.
    pub fn parse(name: &str, text: &str) -> Result<Experiment> {
        let options = ron::Options::default().with_default_extension(ron::extensions::Extensions::IMPLICIT_SOME);
        let read: Result<Experiment, _> = options.from_str(text);
        match read {
            Ok(experiment) => Ok(experiment),
            // What does not begin as RON does.
            Err(error) if matches!(error.code, ron::Error::ExpectedAttribute) => {
                bail!("{name}: this is not an experiment, which is (traces: [...], vary: [...], ...)")
            }
            Err(error) => {
                let ron::error::Position { line, col } = error.span.start;
                bail!(
                    "{name}:{line}:{col}: {} (an experiment is (traces: [...], vary: [...], ...))",
                    host::ron_reason(&error.code)
                )
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_left_out_has_defaults() {
        let text = "// Why?\n(traces: [\"a\"], vary: [\"pipelines=1..4\"], screen: (by: \"bound\", keep: 3), design: latin_hypercube(machines: 9, seed: 2))";
        let experiment = Experiment::parse("e.ron", text).expect("an experiment");
        assert_eq!((experiment.base.as_str(), experiment.frames.as_str()), ("baseline", ".."));
        assert_eq!(experiment.screen, Some(Screen { by: Screener::Bound, keep: 3 }));
        assert_eq!(experiment.design, Design::LatinHypercube { machines: 9, seed: 2 });
    }

    #[test]
    fn a_wrong_text_is_told_its_place() {
        for (text, told) in [
            ("(traces: [\"a\"],\n varry: [])", "e.ron:2:"),
            ("(vary: [])", "traces"),
            ("(traces: [\"a\"], design: grit)", "e.ron:1:"),
            ("(traces: [\"a\"], screen: (by: \"cycle\", keep: 1))", "by \"bound\""),
            ("# a page", "e.ron: this is not an experiment"),
        ] {
            let error = format!("{:#}", Experiment::parse("e.ron", text).unwrap_err());
            assert!(error.contains(told), "{text}: {error}");
        }
    }
}
