//! Comparisons as text, as Markdown, as JSON.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{RecordingResult, Row, THEIR_FRAGMENTS_A_SECOND, Tolerance, geometric_mean};

/// The relative difference as text.
pub(super) fn difference(row: &Row) -> String {
    let difference = row.difference();
    if difference == 0.0 {
        "0".into()
    } else if difference.is_finite() {
        format!("{:+.1} %", 100.0 * difference)
    } else {
        "none there".into()
    }
}

fn verdict(row: &Row) -> &'static str {
    match row.bound {
        Tolerance::None => "",
        _ if row.holds() => "pass",
        _ => "FAIL",
    }
}

/// The geometric mean of our cycles of drawing by theirs.
pub(super) fn mean(outcomes: &[RecordingResult]) -> f64 {
    geometric_mean(outcomes.iter().map(RecordingResult::ratio))
}

/// The largest deviation that the geometric mean may have.
const MEAN_ALLOWED: f64 = 0.10;

/// All comparisons as text, times of the host last.
pub fn text(outcomes: &[RecordingResult]) -> String {
    let mut text = String::new();
    for outcome in outcomes {
        let _ = writeln!(text, "{}, frame {}", outcome.name, outcome.frame);
        let _ = writeln!(text, "  {:<32} {:>12} {:>12} {:>12}", "", "here", "ATTILA", "difference");
        for row in &outcome.rows {
            let (ours, theirs) = (row.ours, row.theirs);
            let _ = writeln!(text, "  {:<32} {ours:>12} {theirs:>12} {:>12}  {}", row.what, difference(row), verdict(row));
        }
    }
    let mean = mean(outcomes);
    let _ = writeln!(
        text,
        "cycles of drawing by ATTILA's, geometric mean: {mean:.3}  {}",
        if (mean - 1.0).abs() <= MEAN_ALLOWED { "pass" } else { "FAIL" }
    );
    text
}

/// Shaded fragments per second, by ATTILA's.
pub fn speeds(outcomes: &[RecordingResult], markdown: bool) -> String {
    let mut text = String::new();
    if markdown {
        text.push_str("| recording | shaded fragments a second | by ATTILA's 26,000 | at least 100 |\n|---|--:|--:|---|\n");
    }
    let times = |outcome: &RecordingResult| outcome.fragments_a_second / THEIR_FRAGMENTS_A_SECOND;
    for outcome in outcomes {
        let (name, rate, times) = (&outcome.name, outcome.fragments_a_second, times(outcome));
        let verdict = if times >= 100.0 { "pass" } else { "FAIL" };
        let _ = if markdown {
            writeln!(text, "| {name} | {rate:.0} | {times:.1} | {verdict} |")
        } else {
            writeln!(text, "host: {name}: {rate:.0} shaded fragments a second, {times:.1} times ATTILA's  {verdict}")
        };
    }
    let mean = geometric_mean(outcomes.iter().map(times));
    let verdict = if mean >= 200.0 { "pass" } else { "FAIL" };
    let _ = if markdown {
        writeln!(text, "| geometric mean, at least 200 | | {mean:.1} | {verdict} |")
    } else {
        writeln!(text, "host: geometric mean: {mean:.1} times  {verdict}")
    };
    text
}

/// All comparisons as a table for a page: a row a counter, a column a recording.
pub fn markdown(outcomes: &[RecordingResult]) -> String {
    let mut text = String::from("| here / ATTILA |");
    for outcome in outcomes {
        let _ = write!(text, " {} |", outcome.name);
    }
    let _ = writeln!(text, "\n|---|{}", "--:|".repeat(outcomes.len()));
    let Some(first) = outcomes.first() else { return text };
    for (at, row) in first.rows.iter().enumerate() {
        let allowed = row.bound.allowed().map_or(String::new(), |allowed| format!(", {:.0} %", 100.0 * allowed));
        let _ = write!(text, "| {}{allowed} |", row.what);
        for outcome in outcomes {
            let row = &outcome.rows[at];
            let mark = if row.holds() { "" } else { "**" };
            let _ = match difference(row).as_str() {
                "0" => write!(text, " {} |", row.ours),
                difference => write!(text, " {} / {} {mark}{difference}{mark} |", row.ours, row.theirs),
            };
        }
        text.push('\n');
    }
    let failed = outcomes.iter().flat_map(|outcome| &outcome.rows).filter(|row| !row.holds()).count();
    let all = outcomes.iter().flat_map(|outcome| &outcome.rows).filter(|row| row.bound != Tolerance::None).count();
    let _ = writeln!(
        text,
        "\n{} of {all} rows hold. Cycles of drawing by ATTILA's, geometric mean: {:.3}, of which 0.9 to 1.1 holds.",
        all - failed,
        mean(outcomes)
    );
    text
}

/// All comparisons as JSON.
pub fn json(outcomes: &[RecordingResult]) -> Value {
    let row = |row: &Row| {
        let difference = row.difference();
        json!({
            "what": row.what,
            "ours": row.ours,
            "attila": row.theirs,
            "difference": difference.is_finite().then_some(difference),
            "allowed": row.bound.allowed(),
            "verdict": if row.bound == Tolerance::None { None } else { Some(if row.holds() { "pass" } else { "fail" }) },
        })
    };
    let one = |outcome: &RecordingResult| {
        json!({
            "recording": outcome.name,
            "frame": outcome.frame,
            "rows": outcome.rows.iter().map(row).collect::<Vec<_>>(),
        })
    };
    json!({ "recordings": outcomes.iter().map(one).collect::<Vec<_>>(), "cycles_geometric_mean": mean(outcomes) })
}

/// Whether all that is counted holds, times of the host left out.
pub fn holds(outcomes: &[RecordingResult]) -> bool {
    outcomes.iter().flat_map(|outcome| &outcome.rows).all(Row::holds) && (mean(outcomes) - 1.0).abs() <= MEAN_ALLOWED
}
