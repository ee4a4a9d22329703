//! Benchmarks as lines of text, as JSON, and as a page.

use std::fmt::Write;

use serde_json::{Value, json};

use super::{Benchmark, BenchmarkResult, CARDS, Citation, Class};

/// Columns of [`line()`].
pub fn header() -> String {
    columns(["card", "benchmark", "published", "measured", "deviation", "class", "verdict"].map(str::to_owned))
}

fn columns([card, name, published, measured, deviation, class, verdict]: [String; 7]) -> String {
    format!("{card:<14} {name:<16} {published:<42} {measured:<42} {deviation:>10} {class:>5}  {verdict}\n")
}

/// An outcome as a line, with its reason below it where it is not met.
pub fn line(outcome: &BenchmarkResult) -> String {
    let Benchmark { card, name, published, class, because, .. } = outcome.benchmark;
    let cells = [
        (*card).to_owned(),
        (*name).to_owned(),
        numbers(published),
        numbers(&outcome.measured),
        deviation(*class, outcome.deviation),
        class.letter().to_owned(),
        outcome.verdict().text().to_owned(),
    ];
    let mut text = columns(cells);
    if let Some(off) = outcome.from_formula.filter(|off| off.abs() > super::FORMULA_ALLOWED) {
        let _ = writeln!(text, "{:14} formula: {:+.1} % off", "", 100.0 * off);
    }
    if let Some(because) = because {
        let _ = writeln!(text, "{:14} because: {}", "", because.what);
    }
    text
}

/// All outcomes as text, with the median and the number that holds.
pub fn text(outcomes: &[BenchmarkResult]) -> String {
    let mut text = header();
    outcomes.iter().for_each(|outcome| text += &line(outcome));
    text + &summary(outcomes) + "\n"
}

/// The median of the sizes of all deviations.
pub fn median(outcomes: &[BenchmarkResult]) -> f64 {
    let mut sizes: Vec<f64> = outcomes.iter().map(|outcome| outcome.deviation.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    match sizes.len() {
        0 => 0.0,
        n => 0.5 * (sizes[(n - 1) / 2] + sizes[n / 2]),
    }
}

/// What became of all of them, in a sentence.
fn summary(outcomes: &[BenchmarkResult]) -> String {
    let met = outcomes.iter().filter(|outcome| outcome.deviation.abs() <= outcome.benchmark.class.allowed()).count();
    let holding = outcomes.iter().filter(|outcome| outcome.holds()).count();
    let all = outcomes.len();
    format!(
        "{met} of {all} benchmarks are met, and {} not met say why; the median deviation is {:.1} %. {holding} of {all} are as they say.",
        outcomes.iter().filter(|outcome| outcome.verdict() == super::Verdict::Excused).count(),
        100.0 * median(outcomes)
    )
}

/// A deviation as text.
fn deviation(class: Class, off: f64) -> String {
    match class {
        _ if off.is_infinite() => "none there".into(),
        _ if off == 0.0 => "0".into(),
        Class::Shape => format!("{off:+.3}"),
        _ => format!("{:+.1} %", 100.0 * off),
    }
}

/// Numbers with three or four digits.
fn numbers(values: &[f64]) -> String {
    values.iter().map(|&value| number(value)).collect::<Vec<_>>().join(", ")
}

fn number(value: f64) -> String {
    let text = match value.abs() {
        size if size >= 1000.0 => format!("{value:.0}"),
        size if size >= 100.0 => format!("{value:.1}"),
        size if size >= 1.0 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    };
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Outcomes as JSON.
pub fn json(outcomes: &[BenchmarkResult]) -> Value {
    let one = |outcome: &BenchmarkResult| {
        let benchmark = outcome.benchmark;
        json!({
            "card": benchmark.card,
            "benchmark": benchmark.name,
            "family": benchmark.family.name(),
            "workload": benchmark.what,
            "unit": benchmark.unit,
            "published": benchmark.published,
            "source": benchmark.source.text,
            "source_seen": benchmark.source.seen,
            "measured": outcome.measured,
            "deviation": outcome.deviation,
            "class": benchmark.class.letter(),
            "from_formula": outcome.from_formula,
            "because": benchmark.because.map(|because| because.what),
            "verdict": if outcome.holds() { "pass" } else { "fail" },
        })
    };
    json!({
        "verdict": if outcomes.iter().all(BenchmarkResult::holds) { "pass" } else { "fail" },
        "median": median(outcomes),
        "benchmarks": outcomes.iter().map(one).collect::<Vec<_>>(),
    })
}

/// What stands before the tables of the page.
const INTRODUCTION: &str = "# Cards

Microbenchmarks whose answers are published, measured on the model as they are measured on silicon. `fillrate accuracy card` makes a trace for
each, replays it on the configuration of the card, and compares; `fillrate accuracy card NAME` measures one, or all of a card;
`--inject-fault` gives each card a wrong knob, as `--list` names it, and all benchmarks fail then. Numbers are per cycle of the card's clock
unless the unit says otherwise. Classes: A is 2 % (a data sheet), B 10 % (measured silicon), C 20 % (sources that differ), S the shape of a curve
(each point, as a share of the largest, within 0.1), exact no deviation. The deviation of a curve is that of its worst point. A benchmark that
the model does not reproduce says why, and fails when it no longer needs to or when its deviation grows. Where the answer follows from knobs, a
formula says how, and measurement and formula agree to 1 % (marked =). Sources marked ? were not at hand to check the number.

";

/// Outcomes as a page: a table for each card.
pub fn markdown(outcomes: &[BenchmarkResult]) -> String {
    let mut text = INTRODUCTION.to_owned();
    let _ = writeln!(text, "{}", summary(outcomes));
    for &(card, name) in CARDS {
        let of_card: Vec<&BenchmarkResult> = outcomes.iter().filter(|outcome| outcome.benchmark.card == card).collect();
        if of_card.is_empty() {
            continue;
        }
        let _ = write!(text, "\n## {name}\n\n`--config {card}`\n\n");
        text += "| benchmark | workload | published | source | measured | deviation | class | verdict |\n|---|---|--:|---|--:|--:|---|---|\n";
        for outcome in of_card {
            text += &row(outcome);
        }
    }
    text
}

fn row(outcome: &BenchmarkResult) -> String {
    let Benchmark { name, what, unit, published, class, source, because, .. } = outcome.benchmark;
    let Citation { text, seen } = source;
    let unit = if unit.is_empty() { String::new() } else { format!(" {unit}") };
    let verdict = match because {
        Some(because) => format!("{}: {}", outcome.verdict().text(), because.what),
        None => outcome.verdict().text().to_owned(),
    };
    format!(
        "| {name} | {what} | {}{unit} | {text}{} | {}{} | {} | {} | {verdict} |\n",
        numbers(published),
        if *seen { "" } else { " ?" },
        numbers(&outcome.measured),
        if outcome.from_formula.is_some() { " =" } else { "" },
        deviation(*class, outcome.deviation),
        class.letter(),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [(2048.0, "2048"), (0.75, "0.75"), (0.0, "0"), (1.5, "1.5"), (207.04, "207"), (30.0, "30")] {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn a_curve_is_off_by_its_worst_point() {
        assert_eq!(Class::B.deviation(&[1.0, 2.0], &[1.1, 1.0]), -0.5);
        assert_eq!(Class::Shape.deviation(&[1.0, 4.0], &[1.0, 2.0]), 0.25);
        assert_eq!(Class::A.deviation(&[1.0], &[f64::NAN]), f64::INFINITY);
        assert_eq!(Class::A.deviation(&[1.0], &[]), f64::INFINITY);
    }
}
