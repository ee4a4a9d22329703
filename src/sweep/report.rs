//! The page of a sweep in Markdown: the answer, the machines, what each axis does, and how far the screen was off.

use std::fmt::Write;

use super::answer;
use super::outcome::{FrontMachine, MachineResult, SweepResult, Within, mean, plain, ratio};
use super::plan::Plan;
use super::search::Rung;
use super::timing::Screening;
use crate::knob::Setting;
use crate::machine::config::SortClass;
use crate::report::summary::grouped;

/// Machines that the page lists.
pub const LISTED: usize = 32;

/// Values of an axis up to which two axes make a table.
const SIDE: usize = 16;

/// The file of a folder that has the page.
pub const REPORT: &str = "report.md";

/// The page, in Markdown.
pub fn page(sweep: &SweepResult<'_>, plan: &Plan, screening: Option<&Screening>) -> String {
    let experiment = &sweep.inputs.experiment;
    let mut out = format!("# {}\n\n", if experiment.question.is_empty() { "A sweep" } else { &experiment.question });
    answered(&mut out, sweep);
    let mut base = experiment.base.clone();
    experiment.set.iter().for_each(|set| base.push_str(&format!(" --set {set}")));
    let failed = sweep.failed().count();
    let _ = writeln!(
        out,
        "\n## What was run\n\nTraces: {}; {}. Base: `{base}`. {} machines: {} with a result, {failed} with an error{}.\n",
        experiment.traces.join(", "),
        if experiment.frames == ".." { "all frames".into() } else { format!("frames {}", experiment.frames) },
        sweep.planned,
        sweep.timed().count(),
        if screening.is_some() { "; the others were estimated only" } else { "" },
    );
    for axis in &experiment.vary {
        let _ = writeln!(out, "* axis `{axis}`");
    }
    for variable in &experiment.variables {
        let _ = writeln!(out, "* variable `{variable}`");
    }
    for link in &experiment.link {
        let _ = writeln!(out, "* link `{link}`");
    }
    for condition in &experiment.conditions {
        let _ = writeln!(out, "* condition `{condition}`");
    }
    for measure in &experiment.measures {
        let _ = writeln!(out, "* measure `{measure}`");
    }
    if sweep.timed().next().is_some() {
        two(&mut out, sweep);
        axes(&mut out, sweep);
        by_trace(&mut out, sweep);
        costs(&mut out, sweep);
        listed(&mut out, sweep);
    }
    if let Some(screening) = screening {
        search(&mut out, sweep, screening);
        screen(&mut out, sweep, plan, screening);
    }
    errors(&mut out, sweep);
    out
}

/// The answer in sentences.
fn answered(out: &mut String, sweep: &SweepResult<'_>) {
    let _ = writeln!(out, "{}\n", answer::fastest(sweep));
    let scope = answer::scope(sweep);
    if !scope.is_empty() {
        let _ = writeln!(out, "{scope}\n");
    }
    for answer::Finding { text, by, measures, .. } in answer::findings(sweep) {
        let _ = writeln!(out, "* {text}");
        for text in by.iter().chain(&measures) {
            let _ = writeln!(out, "  {text}");
        }
    }
}

/// What the cycles of axes are.
fn cycles(sweep: &SweepResult<'_>) -> &'static str {
    if sweep.estimated.is_empty() { "cycles" } else { "estimated cycles" }
}

fn errors(out: &mut String, sweep: &SweepResult<'_>) {
    let failed: Vec<_> = sweep.failed().collect();
    if failed.is_empty() {
        return;
    }
    // Each reason once, with the first machine that it stopped.
    let mut reasons: Vec<(&str, &MachineResult, u32)> = Vec::new();
    for &(machine, error) in &failed {
        match reasons.iter_mut().find(|known| known.0 == error) {
            Some(known) => known.2 += 1,
            None => reasons.push((error, machine, 1)),
        }
    }
    out.push_str("\n## Machines with an error\n\n| machines | the first of them | settings | error |\n|---|---|---|---|\n");
    for (error, machine, count) in reasons.iter().take(LISTED) {
        let _ =
            writeln!(out, "| {count} | {} | {} | {} |", machine.number, sweep.described(machine), error.replace('|', "\\|"));
    }
    more(out, reasons.len());
}

/// Says how many rows are left out.
fn more(out: &mut String, rows: usize) {
    if rows > LISTED {
        let _ = writeln!(out, "\n{} more stand in `machines.csv`.", rows - LISTED);
    }
}

/// Two axes alone as a table.
fn two(out: &mut String, sweep: &SweepResult<'_>) {
    let [rows, columns] = &sweep.axes[..] else { return };
    if rows.values.len() > SIDE || columns.values.len() > SIDE {
        return;
    }
    let what = if sweep.estimated.is_empty() { "Cycles" } else { "Estimated cycles" };
    let _ = writeln!(out, "\n## {what} by `{}` (rows) and `{}` (columns)\n", rows.path, columns.path);
    let heads: Vec<String> = columns.values.iter().map(plain).collect();
    let _ = writeln!(out, "| | {} |\n|---|{}", heads.join(" | "), "---|".repeat(heads.len()));
    for row in &rows.values {
        let cell = |column: &Setting| {
            let mean = sweep.mean(|machine| machine.settings[0] == *row && machine.settings[1] == *column);
            mean.map_or("-".into(), |(cycles, _)| grouped(cycles.round() as u64))
        };
        let cells: Vec<String> = columns.values.iter().map(cell).collect();
        let _ = writeln!(out, "| {} | {} |", plain(row), cells.join(" | "));
    }
}

/// What each axis does, those that do most first.
fn axes(out: &mut String, sweep: &SweepResult<'_>) {
    let Some(reference) = sweep.reference() else { return };
    for effect in sweep.effects() {
        let _ = writeln!(
            out,
            "\n## `{}`: {:.3} times as many cycles at its worst value as at its best\n",
            effect.path, effect.ratio
        );
        let heads: String = sweep.measures.iter().map(|name| format!(" `{name}` (arithmetic mean) |")).collect();
        let rule = "---|".repeat(sweep.measures.len());
        let _ = writeln!(
            out,
            "| value | machines | {} (geometric mean) | speed-up over {} (geometric mean) |{heads}\n|---|---|---|---|{rule}",
            cycles(sweep),
            reference.name()
        );
        for own in &effect.responses {
            let measure = |at: usize| sweep.axis_measure(effect.axis, &own.value, at, None);
            let measures: String = (0..sweep.measures.len())
                .map(|at| format!(" {} |", measure(at).map_or("-".into(), answer::measured)))
                .collect();
            let _ = writeln!(
                out,
                "| {} | {} | {} | {:.3} |{measures}",
                plain(&own.value),
                own.machines,
                grouped(own.cycles.round() as u64),
                reference.cycles / own.cycles
            );
        }
    }
}

/// What each axis does on each trace: how much, and then the cycles and measures of each value.
fn by_trace(out: &mut String, sweep: &SweepResult<'_>) {
    let traces = sweep.trace_names();
    if traces.len() < 2 {
        return;
    }
    let rule = "---|".repeat(traces.len());
    let heads = traces.join(" | ");
    let name = sweep.trace_axis();
    let what = cycles(sweep);
    let _ = writeln!(
        out,
        "\n## By {name}: {what} at the worst value divided by those at the best\n\n| axis | {heads} |\n|---|{rule}"
    );
    let effects = sweep.effects();
    for effect in &effects {
        let cell = |trace: usize| format!("{:.3}", ratio(&sweep.responses(effect.axis, Within::Trace(trace))));
        let cells: Vec<String> = (0..traces.len()).map(cell).collect();
        let _ = writeln!(out, "| `{}` | {} |", effect.path, cells.join(" | "));
    }
    for effect in &effects {
        let mut table = |what: &str, cell: &dyn Fn(&Setting, usize) -> Option<String>| {
            let _ = writeln!(out, "\n### {what} by `{}` and {name}\n\n| | {heads} |\n|---|{rule}", effect.path);
            for own in &effect.responses {
                let cells: Vec<String> =
                    (0..traces.len()).map(|trace| cell(&own.value, trace).unwrap_or_else(|| "-".into())).collect();
                let _ = writeln!(out, "| {} | {} |", plain(&own.value), cells.join(" | "));
            }
        };
        table(if sweep.estimated.is_empty() { "Cycles" } else { "Estimated cycles" }, &|value, trace| {
            let mut own = sweep.responses(effect.axis, Within::Trace(trace)).into_iter();
            own.find(|own| own.value == *value).map(|own| grouped(own.cycles.round() as u64))
        });
        for (at, measure) in sweep.measures.iter().enumerate().filter(|(at, _)| answer::moves(sweep, effect, *at)) {
            table(&format!("`{measure}`"), &|value, trace| {
                sweep.axis_measure(effect.axis, value, at, Some(trace)).map(answer::measured)
            });
        }
    }
}

/// The Pareto front of cycles and cost.
fn costs(out: &mut String, sweep: &SweepResult<'_>) {
    let Some((_, front)) = sweep.front() else { return };
    let name = sweep.cost_name();
    let _ = writeln!(
        out,
        "\n## Cycles against cost: {}\n\nEach machine here takes fewer cycles than all that cost less. Machines within {} of each other in both count as one.\n\n\
         | machine | {} | cycles | {name} | machines alike |\n|---|{}---|---|---|",
        match front.len() {
            1 => "1 machine is on the front".to_owned(),
            count => format!("{count} machines are on the front"),
        },
        answer::tolerance(),
        sweep.parameters.join(" | "),
        "---|".repeat(sweep.parameters.len())
    );
    for FrontMachine { machine, cycles, cost, alike } in front.iter().take(LISTED) {
        let cells: Vec<String> = machine.settings.iter().map(plain).collect();
        let [cycles, cost] = [cycles, cost].map(|value| grouped(value.round() as u64));
        let _ = writeln!(out, "| {} | {} | {cycles} | {cost} | {alike} |", machine.number, cells.join(" | "));
    }
    more(out, front.len());
}

fn listed(out: &mut String, sweep: &SweepResult<'_>) {
    // Speed-ups here are of what was simulated.
    let base = sweep.timed().find(|(machine, _)| sweep.is_base(machine));
    let over = base.map_or(String::new(), |(base, _)| format!(" speed-up over the base, machine {} |", base.number));
    let heads: Vec<&str> = sweep.parameters.iter().chain(&sweep.measures).map(String::as_str).collect();
    let mean = if sweep.inputs.experiment.traces.len() > 1 { " (geometric mean over the traces)" } else { "" };
    let _ = writeln!(
        out,
        "\n## The fastest machines\n\n| machine | {} | cycles{mean} |{over}\n|---|{}---|{}",
        heads.join(" | "),
        "---|".repeat(heads.len()),
        if base.is_some() { "---|" } else { "" }
    );
    for (machine, cycles) in sweep.timed().take(LISTED) {
        let cells = machine.settings.iter().map(plain);
        let measures = machine.measures.iter().map(|value| value.map_or("-".into(), answer::measured));
        let cells: Vec<String> = cells.chain(measures).collect();
        let speed_up = base.map_or(String::new(), |(_, base)| format!(" {:.3} |", base / cycles));
        let shown = grouped(cycles.round() as u64);
        let _ = writeln!(out, "| {} | {} | {shown} |{speed_up}", machine.number, cells.join(" | "));
    }
    more(out, sweep.timed().count());
    out.push_str(
        "\nTheir configurations are `configs/NUMBER.ron`; `fillrate sweep config DIR NUMBER` prints that of any machine.\n",
    );
}

/// The rungs of a search: machines, and the frames on which they were simulated.
fn search(out: &mut String, sweep: &SweepResult<'_>, screening: &Screening) {
    if sweep.inputs.experiment.search.is_none() {
        return;
    }
    let whole = screening.machines.iter().filter(|machine| machine.kept).count();
    let last = Rung { machines: whole as u32, frames: screening.frames };
    out.push_str("\n## The search\n\n| rung | machines | frames of each | frames simulated |\n|---|--:|--:|--:|\n");
    let all = u64::from(sweep.planned);
    let _ = writeln!(out, "| estimated | {all} | {} | 0 |", screening.frames);
    let mut simulated = 0;
    for (number, rung) in (1..).zip(screening.rungs.iter().chain([&last])) {
        let own = u64::from(rung.machines) * u64::from(rung.frames);
        simulated += own;
        let _ = writeln!(out, "| {number} | {} | {} | {} |", rung.machines, rung.frames, grouped(own));
    }
    let _ = writeln!(
        out,
        "\n{} frames were simulated; all machines would take {}. A machine that the search left early was estimated on the frames that it was not simulated on, and may be the fastest.",
        grouped(simulated),
        grouped(all * u64::from(screening.frames))
    );
}

/// How far the estimates of the machines that were simulated are off.
fn screen(out: &mut String, sweep: &SweepResult<'_>, plan: &Plan, screening: &Screening) {
    let screened = &screening.machines;
    let mut errors: Vec<f64> = Vec::new();
    // By sort class, in the order of the list of these.
    let mut classes: Vec<Vec<f64>> = vec![Vec::new(); SortClass::NAMES.len()];
    let mut pairs: Vec<(f64, f64)> = Vec::new();
    for (machine, cycles) in sweep.timed() {
        if let Ok(traces) = &screened[machine.number as usize].estimate
            && let Some((estimate, _)) = mean(traces.iter().copied())
        {
            let error = (estimate / cycles - 1.0).abs();
            errors.push(error);
            // A machine with a result is one that could be made.
            if let Ok(Ok(config)) = plan.machine(machine.number).map(|planned| planned.config)
                && let Some(class) = SortClass::NAMES.iter().position(|name| *name == config.card.sort.name())
            {
                classes[class].push(error);
            }
            pairs.push((estimate, cycles));
        }
    }
    let kept = screened.iter().filter(|machine| machine.kept).count();
    let unknown = screened.iter().filter(|machine| machine.estimate.is_err()).count();
    let _ = writeln!(
        out,
        "\n## {}\n\n{} machines were estimated by `bound`, and {kept} simulated; {unknown} of these have no estimate.",
        if screening.frames > 0 { "Estimates" } else { "The screen" },
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
