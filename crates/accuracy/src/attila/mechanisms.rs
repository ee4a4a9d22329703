//! What each mechanism of ATTILA's machine is worth: the comparison without it.

use std::fmt::Write;

use anyhow::Result;

use super::page::{difference, mean};
use super::{Case, RecordingResult, Row, Tolerance, Window};
use machine::Config;

/// A machine without one mechanism.
struct Without {
    /// Settings that take it away.
    set: &'static [&'static str],
    /// How the window is stored otherwise, and its name.
    window: Option<(Window, &'static str)>,
}

const fn without(set: &'static [&'static str]) -> Without {
    Without { set, window: None }
}

/// The mechanisms that configs/attila.ron has and the baseline has not, one by one, and other sizes of one that ATTILA's sources do not give.
const ALL: &[Without] = &[
    without(&[
        "core.instructions=scalar",
        "core.float_lanes=16",
        "core.integer_lanes=16",
        "core.special_lanes=4",
        "core.special_latency=9",
    ]),
    without(&["traverse.hierarchical_lines=0"]),
    without(&["traverse.hierarchical_lines=2"]),
    without(&["traverse.hierarchical_lines=3"]),
    without(&["traverse.hierarchical_lines=8"]),
    without(&["traverse.hierarchical_test=block"]),
    without(&["depth.pass_end=write-back"]),
    without(&["depth.recompress=true", "color.recompress=true"]),
    without(&["memory.l2.cached=true"]),
    without(&["fetch.reuse_until=replaced"]),
    without(&["fetch.deal=round-robin"]),
    without(&["fetch.vertices_per_cycle=0"]),
    without(&["command.drain=false"]),
    without(&["distribute.interval=1"]),
    without(&["traverse.gather=false"]),
    without(&["core.overlap=true"]),
    without(&["dispatch.patience=16"]),
    without(&["dispatch.quads_per_cycle=4", "dispatch.output_quads=4"]),
    Without {
        set: &[],
        window: Some((Window { upward: false, alpha: true }, "rows of the window highest first (no setting)")),
    },
    Without { set: &[], window: Some((Window { upward: true, alpha: false }, "window without alpha (no setting)")) },
];

/// The row of a recording that a change moves most, of those that may be compared with ATTILA's.
fn moved<'o>(
    before: &'o [RecordingResult],
    after: &'o [RecordingResult],
    of: impl Fn(Tolerance) -> bool,
) -> Option<(&'o str, &'o Row, &'o Row)> {
    let recordings = before.iter().zip(after);
    let rows = recordings
        .flat_map(|(old, new)| old.rows.iter().zip(&new.rows).map(|(old_row, row)| (old.name.as_str(), old_row, row)));
    let distance = |(_, old, new): &(&str, &Row, &Row)| (new.difference() - old.difference()).abs();
    rows.filter(|(_, old, new)| {
        of(old.bound) && old.difference().is_finite() && new.ours != old.ours && new.difference().is_finite()
    })
    .max_by(|a, b| distance(a).total_cmp(&distance(b)))
}

/// All of them as a table for a page: the rows that move most, how many hold, and the geometric mean of cycles. The first row is the machine as it is.
///
/// # Errors
/// As [`Case::run`].
pub fn mechanisms(cases: &[Case], machine: &Config) -> Result<String> {
    let run = |machine: &Config, window| cases.iter().map(|case| case.run_stored(machine, window)).collect::<Result<Vec<_>>>();
    let before = run(machine, Window::default())?;
    let mut text = String::from(
        "| set | counts or bytes that move most | cycles that move most | rows that hold | cycles, geometric mean |\n|---|---|---|--:|--:|\n",
    );
    let mut line = |what: &str, [counted, cycles]: [String; 2], after: &[RecordingResult]| {
        let bounded = || after.iter().flat_map(|outcome| &outcome.rows).filter(|row| row.bound != Tolerance::None);
        let held = bounded().filter(|row| row.holds()).count();
        let _ = writeln!(text, "| {what} | {counted} | {cycles} | {held} of {} | {:.3} |", bounded().count(), mean(after));
    };
    line("nothing", [String::new(), String::new()], &before);
    for Without { set, window } in ALL {
        let mut machine = machine.clone();
        for assignment in *set {
            machine.set(assignment)?;
        }
        machine.check()?;
        let after = run(&machine, window.map_or_else(Window::default, |(window, _)| window))?;
        let most = |of: fn(Tolerance) -> bool| match moved(&before, &after, of) {
            Some((name, old, new)) => format!("`{name}`: {} {} ({})", new.what, difference(new), difference(old)),
            None => "-".into(),
        };
        let set: Vec<String> = set.iter().map(|assignment| format!("`{assignment}`")).collect();
        let what = window.map_or_else(|| set.join(", "), |(_, name)| name.into());
        line(
            &what,
            [most(|bound| !matches!(bound, Tolerance::None | Tolerance::Cycles)), most(|bound| bound == Tolerance::Cycles)],
            &after,
        );
    }
    Ok(text)
}
