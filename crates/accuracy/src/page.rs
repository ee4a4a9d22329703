//! What was measured, as lines of text, as JSON, and as a page.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{Row, Section, Size, Target, TargetResult};

/// Columns of [`lines`].
pub fn header() -> String {
    line(["target", "case", "expected", "measured", "error", "allowed", "verdict"].map(str::to_owned))
}

fn line([target, case, expected, measured, error, allowed, verdict]: [String; 7]) -> String {
    format!("{target:<15} {case:<64} {expected:>12} {measured:>12} {error:>10} {allowed:>10}  {verdict}\n")
}

/// The rows of an outcome as lines.
pub fn lines(outcome: &TargetResult) -> String {
    let mut text = String::new();
    for row in &outcome.rows {
        let [expected, measured, error, allowed] = [row.expected, row.measured, row.error, row.allowed].map(number);
        text += &line([outcome.target.id.into(), row.case.clone(), expected, measured, error, allowed, verdict(row.holds())]);
    }
    if outcome.rows.is_empty() {
        text += &format!("{:<15} nothing was measured: fail\n", outcome.target.id);
    }
    text
}

fn verdict(holds: bool) -> String {
    if holds { "pass".into() } else { "FAIL".into() }
}

/// A number in at most eleven characters or so: whole numbers whole, others with five digits.
fn number(value: f64) -> String {
    if value.fract() == 0.0 && value.abs() < 1e12 {
        return format!("{}", value + 0.0);
    }
    let magnitude = value.abs();
    if (1e-3..1e6).contains(&magnitude) {
        let places = (4 - magnitude.log10().floor() as i32).max(1) as usize;
        return format!("{value:.places$}");
    }
    format!("{value:.3e}")
}

/// The name of a size.
pub fn size_name(size: Size) -> &'static str {
    match size {
        Size::Small => "small",
        Size::Standard => "standard",
        Size::Large => "large",
    }
}

/// Outcomes as JSON.
pub fn json(outcomes: &[TargetResult]) -> Value {
    let row = |row: &Row| {
        json!({
            "case": row.case,
            "expected": row.expected,
            "measured": row.measured,
            "error": row.error,
            "allowed": row.allowed,
            "verdict": if row.holds() { "pass" } else { "fail" },
        })
    };
    let one = |outcome: &TargetResult| {
        json!({
            "target": outcome.target.id,
            "section": &outcome.target.section.title()[..1],
            "seed": outcome.setting.seed,
            "size": size_name(outcome.setting.size),
            "verdict": if outcome.holds() { "pass" } else { "fail" },
            "rows": outcome.rows.iter().map(row).collect::<Vec<_>>(),
        })
    };
    json!({
        "verdict": if outcomes.iter().all(TargetResult::holds) { "pass" } else { "fail" },
        "targets": outcomes.iter().map(one).collect::<Vec<_>>(),
    })
}

/// The text before the tables of a page.
const INTRODUCTION: &str = "# Accuracy

A target states a result that a correct model must reproduce: an identity or a rule of a specification, which allows no deviation, or a
closed form with a bound. Its check makes its own input from a seed, runs the code that a replay runs, and compares the result with the
formula or with arithmetic of any precision (`gfx::reference`). `fillrate accuracy --list` names the targets, `fillrate accuracy TARGET`
measures one, and `--size large` measures millions of cases. `--inject-fault` spoils the input of each check by the fault in the table:
every target must then fail. The tests run every target at its small size, with and without its fault.

";

/// Outcomes as a page. Each section has a table of its targets. Each target has a table of its cases, with the numbers of the first of the
/// largest runs and the worst error of all runs.
pub fn markdown(outcomes: &[TargetResult]) -> String {
    let mut text = INTRODUCTION.to_owned();
    let failed = outcomes.iter().filter(|outcome| !outcome.holds()).count();
    let mut seeds: Vec<String> = Vec::new();
    let mut sizes: Vec<&str> = Vec::new();
    for outcome in outcomes {
        let (seed, size) = (outcome.setting.seed.to_string(), size_name(outcome.setting.size));
        if !seeds.contains(&seed) {
            seeds.push(seed);
        }
        if !sizes.contains(&size) {
            sizes.push(size);
        }
    }
    let (seeds, sizes) = (seeds.join(","), sizes.join(","));
    let made = format!(
        "`fillrate accuracy --seed {seeds} --size {sizes} --markdown` writes this page: {} of {} runs of targets hold. Each row has the \
         numbers of the first seed at the largest size. The column `worst of all runs` has the largest error of all runs: as a share of \
         the allowed error, or as it is where no error is allowed.",
        outcomes.len() - failed,
        outcomes.len()
    );
    text += &wrapped(&made);
    for section in Section::ALL {
        let mut of_section: Vec<&'static Target> = Vec::new();
        for outcome in outcomes.iter().filter(|outcome| outcome.target.section == section) {
            if !of_section.iter().any(|known| known.id == outcome.target.id) {
                of_section.push(outcome.target);
            }
        }
        if of_section.is_empty() {
            continue;
        }
        let _ = write!(text, "\n## {}\n\n", section.title());
        text += "| target | rule | bound | fault that it finds |\n|---|---|---|---|\n";
        for target in &of_section {
            let [what, bound, fault] = [target.what, target.bound, target.fault].map(cell);
            let _ = writeln!(text, "| {} | {what} | {bound} | {fault} |", target.id);
        }
        for target in of_section {
            let runs: Vec<&TargetResult> = outcomes.iter().filter(|outcome| outcome.target.id == target.id).collect();
            let _ = write!(text, "\n### {}\n\n", target.id);
            text += "| case | expected | measured | error | allowed | worst of all runs | |\n|---|--:|--:|--:|--:|--:|---|\n";
            let Some(shown) = runs.iter().rev().max_by_key(|run| run.setting.size) else { continue };
            for row in &shown.rows {
                let same: Vec<&Row> = runs.iter().flat_map(|run| &run.rows).filter(|other| other.case == row.case).collect();
                let [expected, measured, error, allowed] = [row.expected, row.measured, row.error, row.allowed].map(number);
                let worst = same.iter().map(|row| share(row)).fold(0.0, f64::max);
                let worst = if row.allowed == 0.0 { number(worst) } else { format!("{:.1} %", 100.0 * worst) };
                let verdict = if same.iter().all(|row| row.holds()) { "pass" } else { "**fail**" };
                let case = cell(&row.case);
                let _ = writeln!(text, "| {case} | {expected} | {measured} | {error} | {allowed} | {worst} | {verdict} |");
            }
        }
    }
    text
}

/// The content of a table's cell.
fn cell(text: &str) -> String {
    text.replace('|', "\\|")
}

/// A paragraph in lines.
fn wrapped(paragraph: &str) -> String {
    let (mut text, mut column) = (String::new(), 0);
    for word in paragraph.split(' ') {
        let length = word.chars().count();
        if column > 0 {
            let fits = column + 1 + length <= 128;
            text.push(if fits { ' ' } else { '\n' });
            column = if fits { column + 1 } else { 0 };
        }
        text.push_str(word);
        column += length;
    }
    text.push('\n');
    text
}

/// An error as a share of what is allowed; as it is where nothing is.
fn share(row: &Row) -> f64 {
    if row.allowed == 0.0 { row.error } else { row.error / row.allowed }
}

#[cfg(test)]
mod tests {
    use super::number;

    #[test]
    fn numbers_are_short_and_say_what_they_can() {
        for (value, text) in [
            (0.0, "0"),
            (-3.0, "-3"),
            (123_456_789.0, "123456789"),
            (0.758, "0.75800"),
            (3.018_877, "3.0189"),
            (99_999.5, "99999.5"),
            (1.5e-7, "1.500e-7"),
            (f64::NAN, "NaN"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
