//! The tables of a sweep: one with a row per machine and frame, and a long form with a row per statistic.

use std::collections::{HashMap, HashSet};
use std::path::Path;

use anyhow::{Context, Result};

use super::entry::Entry;
use super::folder::Results;
use super::inputs::Inputs;
use super::link::Formula;
use super::plan::Plan;
use super::table::{Cell, ColumnKind, Table, write};
use crate::knob::Setting;
use crate::report::pages::Glossary;

/// A setting as a field.
fn cell(setting: &Setting) -> Cell {
    match setting {
        Setting::Number(value) => Cell::Whole(*value as i64),
        Setting::Switch(value) => Cell::Text(value.to_string()),
        Setting::Name(name) => Cell::Text(name.clone()),
    }
}

/// Columns of the knobs in which machines differ.
pub fn parameters(plan: &Plan) -> Result<Vec<(String, ColumnKind)>> {
    let kind = |path: &str| -> Result<(String, ColumnKind)> {
        let variable = plan.axes().iter().find(|axis| axis.is_variable && axis.path == path);
        let setting = match variable {
            Some(axis) => axis.values[0].clone(),
            None => plan.base().knob("the base", path)?.1,
        };
        let kind = if matches!(setting, Setting::Number(_)) { ColumnKind::Whole } else { ColumnKind::Text };
        Ok((path.to_owned(), kind))
    };
    plan.parameters().into_iter().map(kind).collect()
}

/// A machine's values of these.
pub fn settings(plan: &Plan, machine: u32) -> Result<Vec<Cell>> {
    Ok(plan.machine(machine)?.settings.iter().map(cell).collect())
}

/// Writes `machines.csv`, `long.csv` and the same as Parquet.
///
/// # Errors
/// If one cannot be written.
pub fn all(folder: &Path, inputs: &Inputs, plan: &Plan, results: &mut Results) -> Result<()> {
    // Machines of different classes have different units: columns are those of all, in the order in which they come.
    let mut paths: Vec<String> = Vec::new();
    let mut known = HashSet::new();
    results.each(|entry| {
        for path in entry.paths {
            if known.insert(path.clone()) {
                paths.push(path);
            }
        }
        Ok(())
    })?;
    let whole = |name: &str| (name.to_owned(), ColumnKind::Whole);
    let text = |name: &str| (name.to_owned(), ColumnKind::Text);
    let numbers = |name: &str| (name.to_owned(), ColumnKind::Number);

    let mut columns = vec![whole("machine"), text("trace"), whole("frame"), text("error"), text("config_hash")];
    columns.extend(parameters(plan)?);
    columns.extend([whole("cycles"), numbers("seconds")]);
    let has_cost = !inputs.experiment.cost.trim().is_empty();
    if has_cost {
        columns.push(whole("cost"));
    }
    // A statistic may be a measure, too: its column is there once.
    let measures: Vec<&(String, Formula)> = plan
        .measures()
        .iter()
        .filter(|(name, _)| !paths.contains(name) && columns.iter().all(|(known, _)| known != name))
        .collect();
    columns.extend(measures.iter().map(|(name, _)| numbers(name)));
    columns.extend(paths.iter().map(|path| numbers(path)));
    let name = |entry: &Entry| Cell::Text(inputs.experiment.traces[entry.trace as usize].clone());
    let wide = |table: &mut Table<'_>| {
        results.each(|entry| {
            let settings = settings(plan, entry.machine)?;
            let own: HashMap<&str, usize> = entry.paths.iter().enumerate().map(|(at, path)| (path.as_str(), at)).collect();
            let places: Vec<Option<usize>> = paths.iter().map(|path| own.get(path.as_str()).copied()).collect();
            let head = |frame, error| {
                let mut cells =
                    vec![Cell::Whole(entry.machine.into()), name(&entry), frame, error, Cell::Text(entry.config.clone())];
                cells.extend(settings.iter().cloned());
                cells
            };
            if let Some(error) = &entry.error {
                let mut cells = head(Cell::Empty, Cell::Text(error.clone()));
                cells.resize(cells.len() + 2 + usize::from(has_cost) + measures.len() + paths.len(), Cell::Empty);
                return table.row(&cells);
            }
            let config = plan.machine(entry.machine)?.config.ok();
            let cost = config.map(|config| plan.cost(&config)).transpose()?.flatten();
            for row in &entry.frames {
                let mut cells = head(Cell::Whole(row.frame.into()), Cell::Empty);
                cells.extend([Cell::Whole(row.cycles as i64), Cell::Number(row.seconds)]);
                if has_cost {
                    cells.push(cost.map_or(Cell::Empty, |cost| Cell::Whole(cost as i64)));
                }
                let read = |path: &str| match path {
                    "cycles" => Some(row.cycles as f64),
                    "seconds" => Some(row.seconds),
                    path => own.get(path).map(|&at| row.values[at]),
                };
                cells.extend(measures.iter().map(|(_, formula)| formula.real(&read).map_or(Cell::Empty, Cell::Number)));
                let value = |place: &Option<usize>| place.map_or(Cell::Empty, |place| Cell::Number(row.values[place]));
                cells.extend(places.iter().map(value));
                table.row(&cells)?;
            }
            Ok(())
        })
    };
    write(folder, "machines", &columns, wide)?;

    let glossary = Glossary::default();
    let measures: HashMap<&str, &str> =
        paths.iter().map(|path| (path.as_str(), glossary.find(path).map_or("", |declared| declared.unit))).collect();
    let columns = [
        whole("machine"),
        text("trace"),
        whole("frame"),
        text("pass"),
        text("unit"),
        text("counter"),
        numbers("value"),
        text("measure"),
    ];
    let long = |table: &mut Table<'_>| {
        results.each(|entry| {
            for row in &entry.frames {
                let mut put = |pass: Option<&str>, path: &str, value: f64, measure: &str| {
                    let (unit, counter) = path.rsplit_once('.').unwrap_or(("", path));
                    let text = |text: &str| if text.is_empty() { Cell::Empty } else { Cell::Text(text.to_owned()) };
                    table.row(&[
                        Cell::Whole(entry.machine.into()),
                        name(&entry),
                        Cell::Whole(row.frame.into()),
                        text(pass.unwrap_or("")),
                        text(unit),
                        text(counter),
                        Cell::Number(value),
                        text(measure),
                    ])
                };
                put(None, "cycles", row.cycles as f64, "cycles")?;
                for pass in &row.passes {
                    put(Some(&pass.name), "cycles", pass.cycles as f64, "cycles")?;
                    for &(place, value) in &pass.values {
                        let path =
                            entry.paths.get(place as usize).context("a pass has a statistic that its machine has not")?;
                        put(Some(&pass.name), path, value as f64, measures.get(path.as_str()).copied().unwrap_or(""))?;
                    }
                }
                for (path, value) in entry.paths.iter().zip(&row.values) {
                    put(None, path, *value, measures.get(path.as_str()).copied().unwrap_or(""))?;
                }
            }
            Ok(())
        })
    };
    write(folder, "long", &columns, long)
}
