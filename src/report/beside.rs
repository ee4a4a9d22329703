//! Two replays beside each other: time, phases aligned by name, the funnel, bytes of memory, caches, and what the sort class lost.

use serde_json::{Value, json};

use super::html::data::{CYCLES, CountedSpan};
use super::summary::{bytes, grouped};
use crate::host::one_line;
use crate::machine::{LOAD_IMBALANCE, LossCounts, SORTING, SORTING_LOSS};
use crate::mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, DRAM, DramCounts};
use crate::stats::{FRAME, Group, Heading, Key, SECONDS, Tree, counter};
use crate::work::{FUNNEL, Funnel};

/// The seconds of a run.
const TIME: Key = FRAME.statistic(&SECONDS);

/// One of two replays.
#[derive(Clone, Debug, Default)]
pub struct Side {
    /// Statistics of all frames together.
    pub total: Tree,
    /// Each phase with its cycles, summed over the frames, in the order in which they first occur.
    pub phases: Vec<(String, f64)>,
}

impl Side {
    /// Reads a `stats.json`. None if the value is not one.
    pub fn read(json: &Value) -> Option<Side> {
        json.get("version").and(json["trace"].as_str())?;
        let (total, frames) = (json.get("total").filter(|total| total.is_object())?, json["frames"].as_array()?);
        let mut side = Side { total: Tree::from_json(total), phases: Vec::new() };
        for frame in frames {
            let phases = CountedSpan::frame(frame).parts;
            side.add_phases("", phases.iter().map(|phase| (format!("{} {}", phase.kind, phase.label), phase.cycles())));
        }
        Some(side)
    }

    /// Adds the phases of a frame: of those that have one name, the first of each frame is one phase, the second another one.
    pub fn add_phases(&mut self, prefix: &str, phases: impl Iterator<Item = (String, f64)>) {
        let mut seen: Vec<(String, usize)> = Vec::new();
        for (name, cycles) in phases {
            let name = format!("{prefix}{}", name.trim_end());
            let times = match seen.iter_mut().find(|(known, _)| *known == name) {
                Some((_, times)) => {
                    *times += 1;
                    *times
                }
                None => {
                    seen.push((name.clone(), 1));
                    1
                }
            };
            let name = if times == 1 { name } else { format!("{name} ({times})") };
            match self.phases.iter_mut().find(|(known, _)| *known == name) {
                Some((_, sum)) => *sum += cycles,
                None => self.phases.push((name, cycles)),
            }
        }
    }
}

/// What a value counts, and how it is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Unit {
    /// A whole number.
    Count,
    /// Bytes.
    Bytes,
    /// A part of a whole, from 0 to 1.
    Share,
    /// A real number.
    Real,
}

impl Unit {
    /// A value as readers see it.
    pub fn text(self, value: f64) -> String {
        match self {
            Unit::Count => grouped(value as u64),
            Unit::Bytes => bytes(value),
            Unit::Share => format!("{:.1} %", 100.0 * value),
            Unit::Real if value != 0.0 && value.abs() < 0.01 => format!("{value:.4e}"),
            Unit::Real => format!("{value:.4}"),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Unit::Count => "count",
            Unit::Bytes => "bytes",
            Unit::Share => "share",
            Unit::Real => "real",
        }
    }
}

/// A quantity of both replays. None: a replay does not have it.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// What it is.
    pub name: String,
    /// What it counts.
    pub unit: Unit,
    /// In the first replay.
    pub a: Option<f64>,
    /// In the second.
    pub b: Option<f64>,
}

impl Row {
    /// Whether both have the same value.
    pub fn same(&self) -> bool {
        self.a == self.b
    }

    /// The change from the first to the second as readers see it: of shares in percentage points, of others as a percentage of the first value.
    /// Empty where there is nothing to compare.
    pub fn change(&self) -> String {
        match (self.a, self.b) {
            (Some(a), Some(b)) if a == b => "=".into(),
            (Some(a), Some(b)) if self.unit == Unit::Share => format!("{:+.1} points", 100.0 * (b - a)),
            (Some(a), Some(b)) if a != 0.0 => format!("{:+.1} %", 100.0 * (b - a) / a),
            _ => String::new(),
        }
    }
}

/// Quantities of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Its heading.
    pub title: &'static str,
    /// Its quantities. None of them is 0 or absent in both replays.
    pub rows: Vec<Row>,
}

/// The quantities of two replays, section by section.
pub fn sections(a: &Side, b: &Side) -> Vec<Section> {
    let (x, y) = (&a.total, &b.total);
    let keyed = |name: &str, unit, key: &Key| Row { name: name.into(), unit, a: key.sum(x), b: key.sum(y) };
    let time = vec![keyed("cycles", Unit::Count, &CYCLES), keyed("seconds", Unit::Real, &TIME)];

    let cycles = |side: &Side, name: &str| side.phases.iter().find(|(known, _)| known == name).map(|(_, cycles)| *cycles);
    let mut names: Vec<&String> = a.phases.iter().map(|(name, _)| name).collect();
    for (name, _) in &b.phases {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let phase = |name: &String| Row { name: name.clone(), unit: Unit::Count, a: cycles(a, name), b: cycles(b, name) };
    let phases = names.into_iter().map(phase).collect();

    let has = |heading: Heading| [x, y].map(|total| !heading.find(total).is_empty());
    let paired = |has: [bool; 2], name: String, unit, values: [f64; 2]| Row {
        name,
        unit,
        a: has[0].then_some(values[0]),
        b: has[1].then_some(values[1]),
    };
    let counted = has(FUNNEL);
    let funnels: [Funnel; 2] = [x, y].map(|total| FUNNEL.sum(total));
    let stages = funnels[0].named().zip(funnels[1].named());
    let funnel = stages
        .map(|((name, one), (_, other))| paired(counted, name.replace('_', " "), Unit::Count, [one as f64, other as f64]))
        .collect();

    let counted = has(DRAM);
    let drams: [DramCounts; 2] = [x, y].map(|total| DRAM.sum(total));
    let mut memory = vec![
        paired(counted, "read from DRAM".into(), Unit::Bytes, drams.map(|dram| dram.read_bytes as f64)),
        paired(counted, "written to DRAM".into(), Unit::Bytes, drams.map(|dram| dram.write_bytes as f64)),
    ];
    let rate = |part: u64, all: u64| if all > 0 { part as f64 / all as f64 } else { 0.0 };
    let hits = drams.map(|dram| rate(dram.row_hits, dram.row_hits + dram.row_misses));
    memory.push(paired(counted, "row hits of DRAM".into(), Unit::Share, hits));
    for name in banks(CLIENTS, x, y) {
        let found = [x, y].map(|total| !CLIENTS.find_of(total, &name).is_empty());
        let moved = [x, y].map(|total| {
            let ClientCounts { read_bytes, write_bytes, .. } = CLIENTS.sum_of(total, &name);
            (read_bytes + write_bytes) as f64
        });
        memory.push(paired(found, format!("moved by {name}"), Unit::Bytes, moved));
    }

    let mut caches = Vec::new();
    for name in banks(CACHES, x, y) {
        let counts: [CacheCounts; 2] = [x, y].map(|total| CACHES.sum_of(total, &name));
        let used = counts.map(|counts| counts.accesses > 0);
        caches.push(paired(used, format!("hit rate of {name}"), Unit::Share, counts.map(|c| rate(c.hits, c.accesses))));
        caches.push(paired(used, format!("misses of {name}"), Unit::Count, counts.map(|c| c.misses as f64)));
    }

    let losses: [LossCounts; 2] = [x, y].map(|total| SORTING_LOSS.sum(total));
    let counted = losses.map(|loss| loss.pipeline_cycles > 0);
    let all = counter!(LossCounts, pipeline_cycles).name();
    let used = counter!(LossCounts, useful).name();
    let parts = losses[0].named().zip(losses[1].named()).filter(|((name, _), _)| *name != all);
    let mut sorting: Vec<Row> = parts
        .map(|((name, one), (_, other))| {
            let title = if name == used { "used".to_owned() } else { format!("lost to {}", name.replace('_', " ")) };
            let share = [rate(one, losses[0].pipeline_cycles), rate(other, losses[1].pipeline_cycles)];
            paired(counted, title, Unit::Share, share)
        })
        .collect();
    sorting.push(keyed("load imbalance", Unit::Real, &SORTING.statistic(&LOAD_IMBALANCE)));

    let sections = [
        ("Time", time),
        ("Cycles of phases", phases),
        ("Funnel", funnel),
        ("Memory", memory),
        ("Caches", caches),
        ("Cycles of pipelines", sorting),
    ];
    let shown = |row: &Row| [row.a, row.b].iter().any(|value| value.is_some_and(|value| value != 0.0));
    let section = |(title, rows): (&'static str, Vec<Row>)| Section { title, rows: rows.into_iter().filter(shown).collect() };
    sections.into_iter().map(section).filter(|section| !section.rows.is_empty()).collect()
}

/// The names that either of two replays has under a heading, in order.
fn banks(heading: Heading, x: &Tree, y: &Tree) -> Vec<String> {
    let mut names: Vec<String> = Vec::new();
    for (name, _) in [x, y].into_iter().flat_map(|total| heading.banks(total)) {
        if !names.iter().any(|known| known == name) {
            names.push(name.to_owned());
        }
    }
    names
}

/// One sentence: how the times compare, and which phase accounts for most of the difference. None if a replay has no cycles.
pub fn verdict(a: &Side, b: &Side) -> Option<String> {
    let (before, after) = (CYCLES.sum(&a.total)?, CYCLES.sum(&b.total)?);
    if before == after {
        return Some(format!("Both take {} cycles.", grouped(before as u64)));
    }
    let change = 100.0 * (after - before) / before.max(1.0);
    let relation = if change > 0.0 { format!("{change:.1} % more") } else { format!("{:.1} % fewer", -change) };
    let mut text = format!("B takes {relation} cycles: {} instead of {}", grouped(after as u64), grouped(before as u64));
    let phases = sections(a, b).into_iter().find(|section| section.title == "Cycles of phases");
    let moved = |row: &Row| row.b.unwrap_or(0.0) - row.a.unwrap_or(0.0);
    let along = |row: &&Row| moved(row) * (after - before) > 0.0;
    let rows = phases.iter().flat_map(|section| &section.rows);
    if let Some(most) = rows.filter(along).max_by(|x, y| moved(x).abs().total_cmp(&moved(y).abs())) {
        let sign = if moved(most) < 0.0 { "\u{2212}" } else { "+" };
        text.push_str(&format!(
            "; the largest part of the change is {sign}{} in {}",
            grouped(moved(most).abs() as u64),
            most.name
        ));
    }
    Some(text + ".")
}

/// The sections as text, quantities that are equal left out.
pub fn text(sections: &[Section]) -> String {
    if sections.iter().flat_map(|section| &section.rows).all(Row::same) {
        return "All totals are equal.\n".into();
    }
    let mut out = String::new();
    let cells = |row: &Row| {
        let value = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| row.unit.text(value));
        [row.name.clone(), value(row.a), value(row.b), row.change()]
    };
    for Section { title, rows } in sections {
        let different: Vec<[String; 4]> = rows.iter().filter(|row| !row.same()).map(cells).collect();
        let equal = rows.len() - different.len();
        let note = match (different.is_empty(), equal) {
            (true, _) => ": equal".to_owned(),
            (false, 0) => String::new(),
            (false, n) => format!(" ({n} more equal)"),
        };
        out.push_str(&format!("{title}{note}\n"));
        for [name, a, b, change] in different {
            let line = format!("  {:<34} {a:>16} {b:>16}   {change:>12}", one_line(&name));
            out.push_str(line.trim_end());
            out.push('\n');
        }
    }
    out
}

/// The sections as JSON.
pub fn json(sections: &[Section]) -> Value {
    let row = |row: &Row| json!({ "name": row.name, "unit": row.unit.name(), "a": row.a, "b": row.b });
    sections.iter().map(|s| json!({ "title": s.title, "rows": s.rows.iter().map(row).collect::<Vec<_>>() })).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn replay(cycles: u64, passes: &[(&str, u64)], shaded: u64, hits: u64) -> Side {
        let phases: Vec<Value> =
            passes.iter().map(|(label, n)| json!({ "kind": "pass", "label": label, "cycles": n })).collect();
        let total = json!({
            "cycles": cycles,
            "funnel": { "fragments_shaded": shaded, "quads_shaded": 7 },
            "caches": { "texture": [{ "accesses": 10, "hits": hits, "misses": 10 - hits }] },
            "memory": { "dram": { "read_bytes": 2048, "write_bytes": 0 } },
        });
        Side::read(&json!({ "version": 1, "trace": "t", "total": total, "frames": [{ "frame": 0, "phases": phases }] }))
            .expect("statistics")
    }

    #[test]
    fn phases_are_aligned_by_name_and_by_their_turn_among_equal_names() {
        let a = replay(100, &[("shadow", 30), ("blur", 20), ("blur", 50)], 5, 9);
        let b = replay(130, &[("blur", 20), ("blur", 90), ("bloom", 20)], 5, 9);
        let all = sections(&a, &b);
        let phases = &all.iter().find(|section| section.title == "Cycles of phases").expect("phases").rows;
        let rows: Vec<_> = phases.iter().map(|row| (row.name.as_str(), row.a, row.b)).collect();
        assert_eq!(
            rows,
            [
                ("pass shadow", Some(30.0), None),
                ("pass blur", Some(20.0), Some(20.0)),
                ("pass blur (2)", Some(50.0), Some(90.0)),
                ("pass bloom", None, Some(20.0)),
            ]
        );
        assert_eq!(
            verdict(&a, &b).expect("both have cycles"),
            "B takes 30.0 % more cycles: 130 instead of 100; the largest part of the change is +40 in pass blur (2)."
        );
        assert_eq!(verdict(&a, &a).expect("both have cycles"), "Both take 100 cycles.");
    }

    #[test]
    fn the_text_has_what_differs_and_says_what_is_equal() {
        let (a, b) = (replay(100, &[("", 100)], 5, 9), replay(80, &[("", 80)], 6, 4));
        assert_eq!(text(&sections(&a, &a)), "All totals are equal.\n");
        let said = text(&sections(&a, &b));
        let lines: Vec<String> = said.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
        assert_eq!(
            lines,
            [
                "Time",
                "cycles 100 80 -20.0 %",
                "Cycles of phases",
                "pass 100 80 -20.0 %",
                "Funnel (1 more equal)",
                "fragments shaded 5 6 +20.0 %",
                "Memory: equal",
                "Caches",
                "hit rate of texture 90.0 % 40.0 % -50.0 points",
                "misses of texture 1 6 +500.0 %",
            ]
        );
    }

    #[test]
    fn what_is_no_statistics_has_no_summary() {
        assert!(Side::read(&json!({ "total": 3 })).is_none() && Side::read(&json!([])).is_none());
    }
}
