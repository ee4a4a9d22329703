//! The shaders of a frame with what each line of their source costs.

use std::collections::BTreeMap;

use serde_json::{Value, json};

use crate::gfx::stage::Stage;
use crate::host::{one_line, printable};
use crate::num::ShaderId;
use crate::report::summary::grouped;
use crate::run::shader_cost::{ShaderCosts, StageCost};
use crate::trace::command::{Command, ShaderSource, StageDesc};
use crate::trace::{Trace, TraceError};

/// A stage of some pipelines, with its source.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ShaderListing {
    /// The name of the source in the trace.
    pub file: String,
    /// The label of the module, or empty.
    pub label: String,
    /// The entry point; none: the only one of its stage.
    pub entry: Option<String>,
    /// The stage.
    pub stage: Stage,
    /// The text; none if the trace has no text.
    pub text: Option<String>,
    /// What it costs in all pipelines that have it.
    pub cost: StageCost,
}

impl ShaderListing {
    /// The lines of the text, each with its number from 1 and its instructions. Without a text those that cost something.
    pub fn lines(&self) -> Vec<(u32, u64, &str)> {
        let cost = |line: u32| self.cost.lines.get(&line).copied().unwrap_or(0);
        match &self.text {
            Some(text) => (1..).zip(text.lines()).map(|(line, text)| (line, cost(line), text)).collect(),
            None => self.cost.lines.iter().filter(|(line, _)| **line > 0).map(|(&line, &cost)| (line, cost, "")).collect(),
        }
    }

    /// The name for readers.
    pub fn name(&self) -> String {
        let label = if self.label.is_empty() { String::new() } else { format!(" {:?}", self.label) };
        let entry = self.entry.as_ref().map_or(String::new(), |entry| format!(", {entry}"));
        format!("{}{label}{entry}, {} stage", self.file, self.stage.name())
    }
}

/// Gives the costs of a frame their sources, those with most instructions first. Pipelines with one entry point of one module are joined.
///
/// # Errors
/// If the trace cannot be read.
pub fn listings(trace: &Trace, costs: &ShaderCosts) -> Result<Vec<ShaderListing>, TraceError> {
    let mut shaders: BTreeMap<ShaderId, (String, String, Option<String>)> = BTreeMap::new();
    let mut found: BTreeMap<(u64, Option<String>, Stage), ShaderListing> = BTreeMap::new();
    // A module's id may be used again when it has been destroyed.
    let (mut pipelines, mut modules, mut module_of) = (0, 0_u64, BTreeMap::new());
    trace.for_each_command(|_, command| -> Result<(), TraceError> {
        let stages: Vec<(Stage, &StageDesc)> = match command {
            Command::CreateShader { id, source, label } => {
                let (file, text) = match source {
                    ShaderSource::Wgsl(file) => (file, Some(trace.text(file)?)),
                    ShaderSource::SpirV(file) | ShaderSource::NagaIr(file) => (file, None),
                };
                shaders.insert(*id, (file.clone(), label.clone().unwrap_or_default(), text));
                module_of.insert(*id, modules);
                modules += 1;
                return Ok(());
            }
            Command::CreateRenderPipeline { desc, .. } => desc.stages().collect(),
            Command::CreateComputePipeline { stage, .. } => vec![(Stage::Compute, stage)],
            _ => return Ok(()),
        };
        for (stage, desc) in stages {
            let (Some(cost), Some(module)) = (costs.get(&(pipelines, stage)), module_of.get(&desc.shader)) else { continue };
            let listing = found.entry((*module, desc.entry.clone(), stage)).or_insert_with(|| {
                let (file, label, text) = shaders.get(&desc.shader).cloned().unwrap_or_default();
                ShaderListing { file, label, entry: desc.entry.clone(), stage, text, cost: StageCost::default() }
            });
            listing.cost.invocations += cost.invocations;
            listing.cost.instructions += cost.instructions;
            cost.lines.iter().for_each(|(&line, &count)| *listing.cost.lines.entry(line).or_default() += count);
        }
        pipelines += 1;
        Ok(())
    })?;
    let mut all: Vec<ShaderListing> = found.into_values().filter(|listing| listing.cost.invocations > 0).collect();
    all.sort_by_key(|listing| std::cmp::Reverse(listing.cost.instructions));
    Ok(all)
}

/// Characters of the longest bar.
const BAR: u64 = 20;

/// Listings as text.
pub fn text(listings: &[ShaderListing], frame: u32) -> String {
    let all: u64 = listings.iter().map(|listing| listing.cost.instructions).sum();
    let mut out = format!("frame {frame}: {} instructions of shaders, helper invocations included\n", grouped(all));
    for listing in listings {
        let StageCost { invocations, instructions, lines } = &listing.cost;
        out.push_str(&format!(
            "\n{}: {} instructions ({:.1} %) in {} invocations\n",
            one_line(&listing.name()),
            grouped(*instructions),
            100.0 * *instructions as f64 / all.max(1) as f64,
            grouped(*invocations),
        ));
        let most = lines.values().copied().max().unwrap_or(0).max(1);
        let mut row = |line: &str, cost: u64, text: &str| {
            let cells = if cost == 0 {
                format!("{:>16} {:>7}  {:20}", "", "", "")
            } else {
                let bar = "#".repeat((cost * BAR).div_ceil(most) as usize);
                format!("{:>16} {:>5.1} %  {bar:20}", grouped(cost), 100.0 * cost as f64 / (*instructions).max(1) as f64)
            };
            out.push_str(format!("{cells} {line:>5} | {}", printable(text)).trim_end());
            out.push('\n');
        };
        if let Some(&cost) = lines.get(&0) {
            row("", cost, "(what belongs to no line, such as values that all invocations share)");
        }
        for (line, cost, text) in listing.lines() {
            row(&line.to_string(), cost, text);
        }
        if listing.text.is_none() {
            out.push_str("  The trace has no text of it.\n");
        }
    }
    out
}

/// Listings as JSON.
pub fn json(listings: &[ShaderListing], frame: u32) -> Value {
    let listing = |listing: &ShaderListing| {
        let lines: Vec<Value> = listing
            .cost
            .lines
            .iter()
            .map(|(line, count)| {
                let text = listing.text.as_ref().and_then(|text| text.lines().nth((*line as usize).checked_sub(1)?));
                json!({"line": line, "instructions": count, "text": text})
            })
            .collect();
        json!({
            "file": listing.file,
            "label": listing.label,
            "entry": listing.entry,
            "stage": listing.stage.name(),
            "invocations": listing.cost.invocations,
            "instructions": listing.cost.instructions,
            "lines": lines,
        })
    };
    json!({"frame": frame, "shaders": listings.iter().map(listing).collect::<Vec<_>>()})
}
