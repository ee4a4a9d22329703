//! The page of a sweep: the question, the machines, what each axis does, and how far the screen was off.

use std::collections::HashMap;
use std::fmt::Write;

use super::folder::{Inputs, Results};
use super::plan::{Plan, described};
use super::timing::Screened;
use crate::knob::Setting;
use crate::machine::config::SortClass;
use crate::report::summary::grouped;

/// Machines that the page lists.
const LISTED: usize = 32;

/// Values of an axis up to which two axes make a table.
const SIDE: usize = 16;

/// A machine with its result.
struct Machine {
    number: u32,
    settings: Vec<Setting>,
    /// Cycles of all traces and frames.
    cycles: f64,
}

/// What came of a sweep.
pub struct Outcome {
    machines: Vec<Machine>,
    /// Machines without a result, and why.
    failed: Vec<(u32, Vec<Setting>, String)>,
}

impl Outcome {
    /// Reads the results of a plan.
    ///
    /// # Errors
    /// If a result cannot be read.
    pub fn read(plan: &Plan, traces: usize, results: &mut Results) -> anyhow::Result<Outcome> {
        let mut sums: HashMap<u32, (usize, u64)> = HashMap::new();
        let mut errors: HashMap<u32, String> = HashMap::new();
        results.each(|entry| {
            match (entry.cycles(), entry.error) {
                (Some(cycles), _) => {
                    let sum = sums.entry(entry.machine).or_default();
                    *sum = (sum.0 + 1, sum.1 + cycles);
                }
                (None, error) => {
                    errors.entry(entry.machine).or_insert(error.unwrap_or_default());
                }
            }
            Ok(())
        })?;
        let mut outcome = Outcome { machines: Vec::new(), failed: Vec::new() };
        for number in 0..plan.len() {
            if let Some(error) = errors.remove(&number) {
                outcome.failed.push((number, plan.machine(number)?.settings, error));
            } else if let Some((runs, cycles)) = sums.get(&number)
                && *runs == traces
            {
                let settings = plan.machine(number)?.settings;
                outcome.machines.push(Machine { number, settings, cycles: *cycles as f64 });
            }
        }
        outcome.machines.sort_by(|a, b| a.cycles.total_cmp(&b.cycles).then(a.number.cmp(&b.number)));
        Ok(outcome)
    }

    /// How many machines have a result.
    pub fn timed(&self) -> usize {
        self.machines.len()
    }

    /// The page, in Markdown.
    pub fn page(&self, inputs: &Inputs, plan: &Plan, screened: Option<&[Screened]>) -> String {
        let experiment = &inputs.experiment;
        let mut out = format!("# {}\n\n", if experiment.question.is_empty() { "A sweep" } else { &experiment.question });
        let mut base = experiment.base.clone();
        experiment.set.iter().for_each(|set| base.push_str(&format!(" --set {set}")));
        let _ = writeln!(
            out,
            "Traces: {}; {}. Base: `{base}`. {} machines: {} with a result, {} with an error{}.\n",
            experiment.traces.join(", "),
            if experiment.frames == ".." { "all frames".into() } else { format!("frames {}", experiment.frames) },
            plan.len(),
            self.machines.len(),
            self.failed.len(),
            if screened.is_some() { "; the others were estimated only" } else { "" },
        );
        for axis in &experiment.vary {
            let _ = writeln!(out, "* axis `{axis}`");
        }
        for link in &experiment.link {
            let _ = writeln!(out, "* link `{link}`");
        }
        if let Some(best) = self.machines.first() {
            self.axes(&mut out, plan, best.cycles);
            self.listed(&mut out, plan, best.cycles);
        }
        if let Some(screened) = screened {
            self.screen(&mut out, plan, screened);
        }
        if !self.failed.is_empty() {
            out.push_str("\n## Machines with an error\n\n| machine | settings | error |\n|---|---|---|\n");
            for (number, settings, error) in self.failed.iter().take(LISTED) {
                let _ =
                    writeln!(out, "| {number} | {} | {} |", described(&plan.parameters(), settings), error.replace('|', "\\|"));
            }
            if let Some(more) = self.failed.len().checked_sub(LISTED).filter(|&more| more > 0) {
                let _ = writeln!(out, "\n{more} more stand in `machines.csv`.");
            }
        }
        out
    }

    /// Geometric mean of the cycles of machines, and how many they are.
    fn mean(&self, of: impl Fn(&Machine) -> bool) -> Option<(f64, usize)> {
        let own: Vec<f64> =
            self.machines.iter().filter(|machine| of(machine)).map(|machine| libm::log(machine.cycles.max(1.0))).collect();
        (!own.is_empty()).then(|| (libm::exp(own.iter().sum::<f64>() / own.len() as f64), own.len()))
    }

    /// What each axis does, those that do most first; two axes alone as a table.
    fn axes(&self, out: &mut String, plan: &Plan, best: f64) {
        let axes = plan.axes();
        if let [rows, columns] = axes
            && rows.values.len() <= SIDE
            && columns.values.len() <= SIDE
        {
            let _ = writeln!(out, "\n## Cycles by `{}` (rows) and `{}` (columns)\n", rows.path, columns.path);
            let heads: Vec<String> = columns.values.iter().map(plain).collect();
            let _ = writeln!(out, "| | {} |\n|---|{}", heads.join(" | "), "---|".repeat(heads.len()));
            for row in &rows.values {
                let cell = |column: &Setting| {
                    let mean = self.mean(|machine| machine.settings[0] == *row && machine.settings[1] == *column);
                    mean.map_or("-".into(), |(cycles, _)| grouped(cycles.round() as u64))
                };
                let cells: Vec<String> = columns.values.iter().map(cell).collect();
                let _ = writeln!(out, "| {} | {} |", plain(row), cells.join(" | "));
            }
        }
        let mut effects = Vec::new();
        for (at, axis) in axes.iter().enumerate() {
            let means: Vec<(&Setting, f64, usize)> = axis
                .values
                .iter()
                .filter_map(|value| {
                    let (mean, machines) = self.mean(|machine| machine.settings[at] == *value)?;
                    Some((value, mean, machines))
                })
                .collect();
            let least = means.iter().map(|mean| mean.1).fold(f64::INFINITY, f64::min);
            let most = means.iter().map(|mean| mean.1).fold(0.0, f64::max);
            effects.push((most / least, axis, means));
        }
        effects.sort_by(|a, b| b.0.total_cmp(&a.0));
        for (effect, axis, means) in effects.iter().filter(|effect| !effect.2.is_empty()) {
            let _ = writeln!(
                out,
                "\n## `{}`: {effect:.3} times as many cycles at its worst value as at its best\n\n| value | machines | cycles (geometric mean) | by the fastest machine's |\n|---|---|---|---|",
                axis.path
            );
            for (value, mean, machines) in means {
                let _ =
                    writeln!(out, "| {} | {machines} | {} | {:.3} |", plain(value), grouped(mean.round() as u64), mean / best);
            }
        }
    }

    fn listed(&self, out: &mut String, plan: &Plan, best: f64) {
        let _ = writeln!(
            out,
            "\n## The fastest machines\n\n| machine | {} | cycles | by the fastest's |\n|---|{}---|---|",
            plan.parameters().join(" | "),
            "---|".repeat(plan.parameters().len())
        );
        for Machine { number, settings, cycles } in self.machines.iter().take(LISTED) {
            let settings: Vec<String> = settings.iter().map(plain).collect();
            let _ = writeln!(
                out,
                "| {number} | {} | {} | {:.3} |",
                settings.join(" | "),
                grouped(cycles.round() as u64),
                cycles / best
            );
        }
        if let Some(more) = self.machines.len().checked_sub(LISTED).filter(|&more| more > 0) {
            let _ = writeln!(out, "\n{more} more stand in `machines.csv`.");
        }
    }

    /// How far the estimates of the machines that were simulated are off.
    fn screen(&self, out: &mut String, plan: &Plan, screened: &[Screened]) {
        let mut errors: Vec<f64> = Vec::new();
        // By sort class, in the order of the list of these.
        let mut classes: Vec<Vec<f64>> = vec![Vec::new(); SortClass::NAMES.len()];
        let mut pairs: Vec<(f64, f64)> = Vec::new();
        for machine in &self.machines {
            if let Ok(traces) = &screened[machine.number as usize].estimate {
                let estimate: f64 = traces.iter().sum();
                let error = (estimate / machine.cycles - 1.0).abs();
                errors.push(error);
                // A machine with a result is one that could be made.
                if let Ok(Ok(config)) = plan.machine(machine.number).map(|planned| planned.config)
                    && let Some(class) = SortClass::NAMES.iter().position(|name| *name == config.card.sort.name())
                {
                    classes[class].push(error);
                }
                pairs.push((estimate, machine.cycles));
            }
        }
        let kept = screened.iter().filter(|machine| machine.kept).count();
        let unknown = screened.iter().filter(|machine| machine.estimate.is_err()).count();
        let _ = writeln!(
            out,
            "\n## The screen\n\n{} machines were estimated by `bound`, and {kept} simulated; {unknown} of these have no estimate.",
            screened.len() - unknown
        );
        errors.sort_by(f64::total_cmp);
        let Some(most) = errors.last() else { return };
        let agree = agreement(&pairs).map_or(String::new(), |share| {
            format!(" Of two of them the estimates name the faster one in {:.1} % of all pairs.", 100.0 * share)
        });
        let _ = writeln!(
            out,
            "Of the {} that have both, the median error of the estimate is {:.2} %, the largest {:.2} %.{agree}",
            errors.len(),
            100.0 * errors[errors.len() / 2],
            100.0 * most
        );
        if classes.iter().filter(|own| !own.is_empty()).count() < 2 {
            return;
        }
        out.push_str("\n| sort class | machines | median error | largest |\n|---|--:|--:|--:|\n");
        for (class, own) in SortClass::NAMES.iter().zip(&mut classes).filter(|(_, own)| !own.is_empty()) {
            own.sort_by(f64::total_cmp);
            let [median, most] = [own[own.len() / 2], own[own.len() - 1]].map(|error| 100.0 * error);
            let _ = writeln!(out, "| {class} | {} | {median:.2} % | {most:.2} % |", own.len());
        }
    }
}

/// A setting without the quotes of names.
fn plain(setting: &Setting) -> String {
    match setting {
        Setting::Name(name) => name.clone(),
        other => other.to_string(),
    }
}

/// The share of pairs, of those that differ in both, which two measures put into the same order.
fn agreement(pairs: &[(f64, f64)]) -> Option<f64> {
    let (mut same, mut all) = (0_u64, 0_u64);
    for (at, a) in pairs.iter().enumerate() {
        for b in &pairs[..at] {
            let sign = (a.0 - b.0) * (a.1 - b.1);
            all += u64::from(sign != 0.0);
            same += u64::from(sign > 0.0);
        }
    }
    (all > 0).then(|| same as f64 / all as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agreement_is_the_share_of_pairs_in_the_same_order() {
        assert_eq!(agreement(&[(1.0, 10.0), (2.0, 20.0), (3.0, 15.0)]), Some(2.0 / 3.0));
        assert_eq!(agreement(&[(1.0, 10.0), (1.0, 20.0)]), None);
    }
}
