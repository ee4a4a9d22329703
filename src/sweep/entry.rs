//! What is kept of a machine's run: one line of a shard's file.

use std::collections::HashMap;

use serde::{Deserialize, Serialize};

use crate::machine::{FrameReport, PhaseReport};
use crate::num::Cycle;
use crate::report::order::wrong_pixels;
use crate::stats::{Group, Tree};

/// A pass, a dispatch, transfers or scan-out on one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pass {
    /// Kind, number and label.
    pub name: String,
    /// Cycles.
    pub cycles: Cycle,
    /// The statistics that are kept and not 0: the place of each in [`Entry::paths`], and its value.
    pub values: Vec<(u32, u64)>,
}

/// A frame on one machine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row {
    /// Its number in the trace.
    pub frame: u32,
    /// Cycles.
    pub cycles: Cycle,
    /// Seconds at the configuration's clock.
    pub seconds: f64,
    /// What was done one after another.
    pub passes: Vec<Pass>,
    /// The other statistics that are kept, by [`Entry::paths`].
    pub values: Vec<f64>,
    /// Pixels that the machine shows otherwise than functional rendering.
    #[serde(default)]
    pub wrong_pixels: u64,
}

/// A machine's run on a trace.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Entry {
    /// The trace's place in the experiment, from 0.
    pub trace: u32,
    /// The machine's number in the plan, from 0.
    pub machine: u32,
    /// Hash of its resolved configuration; empty where there is none.
    pub config: String,
    /// Why it did not run to its end.
    pub error: Option<String>,
    /// Paths of the statistics in `values`, banks summed.
    pub paths: Vec<String>,
    /// The frames.
    pub frames: Vec<Row>,
}

impl Entry {
    /// A machine without a result.
    pub fn failed(trace: u32, machine: u32, config: String, error: String) -> Entry {
        Entry { trace, machine, config, error: Some(error), paths: Vec::new(), frames: Vec::new() }
    }

    /// Cycles of all frames; none where it failed.
    pub fn cycles(&self) -> Option<Cycle> {
        self.error.is_none().then(|| self.frames.iter().map(|row| row.cycles).sum())
    }
}

/// Which statistics are kept: those at these paths and below; all, where there is none.
#[derive(Clone, Debug, Default)]
pub struct Keep(Vec<String>);

impl Keep {
    /// Keeps these paths.
    pub fn new(paths: &[String]) -> Keep {
        Keep(paths.to_vec())
    }

    /// Whether a statistic is kept.
    pub fn keeps(&self, path: &str) -> bool {
        let below = |own: &String| path.strip_prefix(own.as_str()).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        self.0.is_empty() || self.0.iter().any(below)
    }

    /// Paths and values of what is kept of a frame's statistics, banks summed. Cycles and seconds are columns of their own.
    fn of(&self, tree: &Tree) -> (Vec<String>, Vec<f64>) {
        let (mut paths, mut values) = (Vec::new(), Vec::new());
        tree.banks_summed().leaves(&mut |path, leaf| {
            if let Some(value) = leaf.number().filter(|_| !matches!(path, "cycles" | "seconds") && self.keeps(path)) {
                paths.push(path.to_owned());
                values.push(value);
            }
        });
        (paths, values)
    }

    /// What is kept of a frame: the paths, and the row.
    pub fn row(&self, report: &FrameReport) -> (Vec<String>, Row) {
        let (paths, values) = self.of(&report.tree);
        let places: HashMap<&str, u32> = paths.iter().map(String::as_str).zip(0..).collect();
        let passes = report.phases.iter().map(|phase| pass(phase, &places)).collect();
        let wrong_pixels = wrong_pixels(&report.tree);
        (paths, Row { frame: report.number, cycles: report.cycles, seconds: report.seconds, passes, values, wrong_pixels })
    }
}

/// What is kept of a phase, whose statistics have places.
fn pass(report: &PhaseReport, places: &HashMap<&str, u32>) -> Pass {
    let mut values = Vec::new();
    let mut put = |path: &str, value: u64| {
        if let (Some(&place), true) = (places.get(path), value > 0) {
            values.push((place, value));
        }
    };
    if let Some(counts) = &report.counts {
        counts.funnel.named().for_each(|(name, value)| put(&format!("funnel.{name}"), value));
        let mut path = String::new();
        counts.each(|(steps, of), name, value| {
            path.clear();
            steps.iter().copied().chain(of).for_each(|step| path.extend([step, "."]));
            path.push_str(name);
            put(&path, value);
        });
    }
    Pass { name: report.phase.to_string(), cycles: report.cycles, values }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn banks_are_summed_and_only_what_is_asked_for_is_kept() {
        let mut tree = Tree::new();
        tree.count("cycles", 100);
        for (unit, busy) in [(0, 10), (1, 30)] {
            tree.child("units").element("setup", unit).count("busy", busy);
            tree.child("units").element("setup", unit).ratio("share", busy, 100);
        }
        tree.child("sort").text("class", "sort-middle");
        tree.child("sorted").count("items", 3);
        let of = |paths: &[&str]| Keep::new(&paths.iter().map(|path| (*path).to_owned()).collect::<Vec<_>>()).of(&tree);
        let all = of(&[]);
        assert_eq!(all.0, ["units.setup.busy", "units.setup.share", "sorted.items"]);
        assert_eq!(all.1, [40.0, 0.2, 3.0]);
        assert_eq!(of(&["units.setup.busy"]).0, ["units.setup.busy"]);
        assert_eq!(of(&["sort"]).0, Vec::<String>::new(), "not the prefix of another word");
        assert_eq!(of(&["units"]).0.len(), 2);
    }
}
