//! The two sides of `fillrate compare`: what a replay left in a folder, or a machine of a sweep.

use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use serde_json::{Map, Value, json};

use crate::host;
use crate::machine::{Config, LOAD_IMBALANCE, SORTING};
use crate::report::beside::Side;
use crate::stats::Tree;
use crate::sweep::folder::Results;
use crate::sweep::inputs::{INPUTS, begun};

/// Bytes of a statistics file at most: hours of frames.
const TEXT_MAX: u64 = 1 << 30;

/// A replay or a machine of a sweep.
pub struct Replayed {
    /// Its statistics, as `stats.json` has them.
    pub json: Value,
    /// Its totals and phases. None if the file is not a whole `stats.json`.
    pub side: Option<Side>,
    /// One line that says what was replayed on which machine.
    pub about: String,
}

impl Replayed {
    /// Reads a `stats.json`.
    ///
    /// # Errors
    /// If it cannot be read, or is no object.
    pub fn read(path: &Path) -> Result<Replayed> {
        let text = host::read_text(path, TEXT_MAX).with_context(|| format!("cannot read {}", path.display()))?;
        let not = || format!("{} is not a statistics file", path.display());
        let json: Value = serde_json::from_str(&text).with_context(not)?;
        if !json.is_object() {
            return Err(anyhow!("it holds no object").context(not()));
        }
        let word = |name: &str| json[name].as_str().unwrap_or("?").to_owned();
        let changed = json["changed_knobs"].as_object().into_iter().flatten();
        let changed: Vec<String> = changed.map(|(path, change)| format!("{path}={}", change["to"])).collect();
        let changed = if changed.is_empty() { String::new() } else { format!(" with {}", changed.join(" ")) };
        let about = format!("{} on {}{changed}, {}", word("trace"), word("config"), word("fidelity"));
        Ok(Replayed { side: Side::read(&json), json, about })
    }

    /// Reads the results of a machine of a sweep, all its traces together, with its configuration.
    ///
    /// # Errors
    /// If the sweep cannot be read, has no such machine, or the machine has no result; the message has the reason.
    pub fn machine(folder: &Path, number: u32) -> Result<(Replayed, Config)> {
        let (inputs, plan) = begun(folder)?;
        if number >= plan.len() {
            return Err(anyhow!("{} has machines 0 to {}, and no machine {number}", folder.display(), plan.len() - 1));
        }
        let config = plan.machine(number)?.config;
        let config = config.map_err(|reason| anyhow!("machine {number} of {}: {reason}", folder.display()))?;
        let mut side = Side::default();
        let (mut total, mut cycles, mut seconds) = (Map::new(), 0, 0.0);
        let imbalance = SORTING.statistic(&LOAD_IMBALANCE).path("");
        let (mut ran, mut failed) = (0, None);
        let mut results = Results::open(&[folder.to_owned()], inputs.shards)?;
        results.each(|entry| {
            if entry.machine != number {
                return Ok(());
            }
            if let Some(error) = entry.error {
                failed = Some(error);
                return Ok(());
            }
            ran += 1;
            let traces = &inputs.experiment.traces;
            let prefix = match traces.get(entry.trace as usize) {
                Some(trace) if traces.len() > 1 => format!("{trace}: "),
                _ => String::new(),
            };
            for row in &entry.frames {
                cycles += row.cycles;
                seconds += row.seconds;
                let numbered = |name: &str| {
                    // The number of a pass says where it is in its frame; phases are aligned by their labels.
                    let mut words = name.splitn(3, ' ');
                    let (kind, second, label) = (words.next().unwrap_or(""), words.next(), words.next());
                    match second {
                        Some(second) if second.parse::<u64>().is_ok() => format!("{kind} {}", label.unwrap_or("")),
                        _ => name.to_owned(),
                    }
                };
                side.add_phases(&prefix, row.passes.iter().map(|pass| (numbered(&pass.name), pass.cycles as f64)));
                // Counters add up; a mean over pipelines does not.
                let counted = entry.paths.iter().zip(&row.values).filter(|(path, _)| **path != imbalance);
                counted.for_each(|(path, value)| add(&mut total, path, *value));
            }
            Ok(())
        })?;
        if let Some(reason) = failed {
            return Err(anyhow!("machine {number} of {} has no result: {reason}", folder.display()));
        }
        if ran == 0 {
            return Err(anyhow!("machine {number} of {} has no result: it was not simulated", folder.display()));
        }
        total.insert("cycles".into(), json!(cycles));
        total.insert("seconds".into(), json!(seconds));
        let total = Value::Object(total);
        side.total = Tree::from_json(&total);
        let about = format!("machine {number} of {}: {}", folder.display(), config.name);
        Ok((Replayed { json: json!({ "total": total }), side: Some(side), about }, config))
    }
}

/// Adds a value to what stands at a path.
fn add(tree: &mut Map<String, Value>, path: &str, value: f64) {
    match path.split_once('.') {
        Some((step, rest)) => {
            if let Value::Object(below) = tree.entry(step).or_insert_with(|| Value::Object(Map::new())) {
                add(below, rest, value);
            }
        }
        None => {
            let sum = tree.get(path).and_then(Value::as_f64).unwrap_or(0.0) + value;
            let whole = sum.fract() == 0.0 && sum.abs() < 9e15;
            tree.insert(path.to_owned(), if whole { json!(sum as u64) } else { json!(sum) });
        }
    }
}

/// The folder of a sweep and the number of a machine, from `FOLDER:NUMBER`.
pub fn of_sweep(path: &Path) -> Option<(PathBuf, u32)> {
    let (folder, number) = path.to_str()?.rsplit_once(':')?;
    let folder = Path::new(folder);
    Some((folder.to_owned(), number.parse().ok()?)).filter(|_| !path.exists() && folder.join(INPUTS).is_file())
}
