//! Sections of a text report by their names, for `--show`.

use super::terminal;

/// Sections of the report of a sweep: the name of each, and the beginning of its heading.
const OF_SWEEP: [(&str, &str); 12] = [
    ("answer", "# "),
    ("run", "## What was run"),
    ("table", "## Cycles by"),
    ("table", "## Estimated cycles by"),
    ("axes", "## `"),
    ("traces", "## By "),
    ("front", "## Cycles against cost"),
    ("machines", "## The fastest machines"),
    ("search", "## The search"),
    ("screen", "## The screen"),
    ("screen", "## Estimates"),
    ("errors", "## Machines with an error"),
];

/// The names of the sections of a replay's report.
pub fn of_replay() -> Vec<&'static str> {
    terminal::SECTIONS.iter().map(|(name, _)| *name).collect()
}

/// The names of the sections of a sweep's report.
pub fn of_sweep() -> Vec<&'static str> {
    let mut names: Vec<&str> = OF_SWEEP.iter().map(|(name, _)| *name).collect();
    names.dedup();
    names
}

/// Sections of a replay's report, in the order of the names.
///
/// # Errors
/// If the report has no section of a name; the message has the names of those that it has.
pub fn shown_of_replay(report: &str, names: &[String]) -> Result<String, String> {
    let begins = |before: &str, line: &str| {
        let begins = before.is_empty() && !line.starts_with(' ');
        begins.then(|| terminal::section_of(line).unwrap_or_default())
    };
    shown(report, names, begins).map_err(|has| format!("this replay has no section {has}"))
}

/// As [`shown_of_replay`], of a sweep's report.
///
/// # Errors
/// As [`shown_of_replay`].
pub fn shown_of_sweep(report: &str, names: &[String]) -> Result<String, String> {
    let begins = |_: &str, line: &str| {
        let heading = line.starts_with("# ") || line.starts_with("## ");
        heading.then(|| OF_SWEEP.iter().find(|(_, begin)| line.starts_with(begin)).map_or("", |(name, _)| name))
    };
    shown(report, names, begins).map_err(|has| format!("this sweep has no section {has}"))
}

/// The sections that are named. `begins` answers the name of the section that a line begins, from the line before and the line itself; none if
/// the section goes on.
fn shown<'n>(report: &str, names: &[String], begins: impl Fn(&str, &str) -> Option<&'n str>) -> Result<String, String> {
    let mut found: Vec<(&str, String)> = Vec::new();
    let mut before = "";
    for line in report.lines() {
        if let Some(name) = begins(before, line) {
            found.push((name, String::new()));
        }
        if let Some((_, text)) = found.last_mut() {
            text.push_str(line);
            text.push('\n');
        }
        before = line;
    }
    let mut out: Vec<String> = Vec::new();
    for name in names {
        let own = found.iter().filter(|(known, _)| known == name).map(|(_, text)| format!("{}\n", text.trim_end()));
        let length = out.len();
        out.extend(own);
        if out.len() == length {
            let mut known: Vec<&str> = found.iter().map(|(known, _)| *known).filter(|known| !known.is_empty()).collect();
            known.dedup();
            return Err(format!("{name}; it has {}", known.join(", ")));
        }
    }
    Ok(out.join("\n"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    #[test]
    fn sections_of_a_replay_are_found_by_their_names() {
        let report = "cube on tiny: 1 frame\n\nWhat was drawn, and where\n  a\n\nIn shares\n  b\n\n9 cycles, 1.0 frames per second at 1000 MHz\nhost: 1 s\n";
        let of = |names: &[&str]| shown_of_replay(&terminal::without_host(report), &named(names));
        assert_eq!(of(&["shares"]).as_deref(), Ok("In shares\n  b\n"));
        let both = "9 cycles, 1.0 frames per second at 1000 MHz\n\nWhat was drawn, and where\n  a\n";
        assert_eq!(of(&["cycles", "funnel"]).as_deref(), Ok(both));
        assert_eq!(of(&["draws"]), Err("this replay has no section draws; it has funnel, shares, cycles".to_owned()));
    }

    #[test]
    fn sections_of_a_sweep_are_found_by_their_names() {
        let report = "# A sweep\n\nOf 2 machines\n\n## What was run\n\nx\n\n## `a`: 2\n\n| 1 |\n\n## `b`: 1\n";
        let of = |names: &[&str]| shown_of_sweep(report, &named(names));
        assert_eq!(of(&["answer"]).as_deref(), Ok("# A sweep\n\nOf 2 machines\n"));
        assert_eq!(of(&["axes"]).as_deref(), Ok("## `a`: 2\n\n| 1 |\n\n## `b`: 1\n"));
        assert_eq!(of(&["errors"]), Err("this sweep has no section errors; it has answer, run, axes".to_owned()));
    }
}
