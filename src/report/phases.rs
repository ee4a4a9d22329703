//! Phases of frames, and the draws of passes: in `stats.json`, and as tables of their own.

use std::fmt::Write;

use serde_json::{Map, Value};

use crate::machine::{DrawReport, PhaseReport, Tally};
use crate::num::Cycle;
use crate::run::replay::Frame;
use crate::unit::phase::PhaseKind;
use crate::work::Funnel;

/// The table of phases: a row a phase of a frame.
pub const PASSES: &str = "passes.csv";

/// The table of draws: a row a draw, and one for the end of its pass.
pub const DRAWS: &str = "draws.csv";

/// A phase in `stats.json`.
pub fn json(report: &PhaseReport) -> Value {
    let PhaseReport { phase, cycles, counts, draws } = report;
    let mut map = Map::new();
    map.insert("kind".into(), phase.kind.name().into());
    map.insert("number".into(), phase.number.into());
    map.insert("label".into(), phase.label.as_str().into());
    map.insert("cycles".into(), (*cycles).into());
    if !phase.limit.is_empty() {
        map.insert("limit".into(), phase.limit.into());
    }
    if let Some(counts) = counts {
        told(&mut map, counts, phase.kind == PhaseKind::Pass);
    }
    if !draws.is_empty() {
        map.insert("draws".into(), draws.iter().map(draw).collect());
    }
    map.into()
}

fn draw(report: &DrawReport) -> Value {
    let DrawReport { number, label, group, cycles, counts } = report;
    let mut map = Map::new();
    map.insert("number".into(), (*number).into());
    map.insert("label".into(), label.as_str().into());
    map.insert("group".into(), group.as_str().into());
    map.insert("cycles".into(), (*cycles).into());
    told(&mut map, counts, number.is_some());
    map.into()
}

/// What was counted and is not 0; of units those that did something, not only waited for input.
fn told(map: &mut Map<String, Value>, counts: &Tally, draws: bool) {
    let object = |names: &mut dyn Iterator<Item = (&'static str, u64)>| -> Map<String, Value> {
        names.filter(|(_, value)| *value > 0).map(|(name, value)| (name.to_owned(), value.into())).collect()
    };
    if draws {
        let funnel = object(&mut Funnel::NAMES.iter().copied().zip(counts.funnel.values()));
        map.insert("funnel".into(), funnel.into());
    }
    counts.groups(|((steps, of), worked), declarations, values| {
        if !worked {
            return;
        }
        let own = object(&mut declarations.iter().map(|declaration| declaration.name).zip(values.iter().copied()));
        let mut at = &mut *map;
        let path = steps.iter().copied().chain(of);
        for step in path {
            let entry = at.entry(step).or_insert_with(|| Value::Object(Map::new()));
            let Value::Object(inner) = entry else { return };
            at = inner;
        }
        *at = own;
    });
}

/// The rows of a frame in `passes.csv`, behind the header if they are the first. Empty where nothing was simulated.
pub fn pass_rows(frame: &Frame, first: bool) -> String {
    let mut text = String::new();
    for (at, report) in frame.phases.iter().enumerate() {
        let (Some(counts), phase) = (&report.counts, &report.phase) else { continue };
        if first && text.is_empty() {
            header(&mut text, "frame,phase,kind,number,label,cycles", counts);
        }
        let start =
            [&frame.number.to_string(), &at.to_string(), phase.kind.name(), &phase.number.to_string(), &field(&phase.label)];
        row(&mut text, &start, report.cycles, counts);
    }
    text
}

/// The rows of a frame in `draws.csv`, behind the header if they are the first. Empty where draws were not asked for.
pub fn draw_rows(frame: &Frame, first: bool) -> String {
    let mut text = String::new();
    for (at, report) in frame.phases.iter().enumerate() {
        let pass = [frame.number, at as u32, report.phase.number].map(|number| number.to_string());
        for draw in &report.draws {
            if first && text.is_empty() {
                header(&mut text, "frame,phase,pass,draw,group,label,cycles", &draw.counts);
            }
            let number = draw.number.map_or("end of the pass".into(), |number| number.to_string());
            let start = [&*pass[0], &pass[1], &pass[2], &number, &field(&draw.group), &field(&draw.label)];
            row(&mut text, &start, draw.cycles, &draw.counts);
        }
    }
    text
}

fn header(text: &mut String, start: &str, counts: &Tally) {
    text.push_str(start);
    Funnel::NAMES.iter().for_each(|name| text.extend([",funnel.", name]));
    counts.each(|(steps, of), name, _| {
        text.push(',');
        steps.iter().copied().chain(of).for_each(|step| text.extend([step, "."]));
        text.push_str(name);
    });
    text.push('\n');
}

fn row(text: &mut String, start: &[&str], cycles: Cycle, counts: &Tally) {
    text.push_str(&start.join(","));
    let mut add = |value: u64| {
        // A text takes all that is written to it.
        let _ = write!(text, ",{value}");
    };
    add(cycles);
    counts.funnel.values().into_iter().for_each(&mut add);
    counts.each(|_, _, value| add(value));
    text.push('\n');
}

/// A label as one field of a row, quoted where it must be.
fn field(label: &str) -> String {
    if label.contains([',', '"', '\n', '\r']) { format!("\"{}\"", label.replace('"', "\"\"")) } else { label.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{Moved, Spent};
    use crate::unit::phase::Phase;

    fn frame() -> Frame {
        let counts = |busy, read_bytes| Tally {
            funnel: Funnel { quads_shaded: busy, ..Funnel::default() },
            units: vec![("core", Spent { busy, ..Spent::default() }), ("idle", Spent::default())],
            dram: Moved { read_bytes, write_bytes: 0 },
            ..Tally::default()
        };
        let draw = |number: Option<u32>, cycles, busy| DrawReport {
            number,
            label: "a \"b\", c".into(),
            group: "sky".into(),
            cycles,
            counts: counts(busy, 0),
        };
        let pass = PhaseReport {
            phase: Phase { kind: PhaseKind::Pass, number: 7, label: "main".into(), begin: 0, limit: "" },
            cycles: 30,
            counts: Some(Box::new(counts(9, 64))),
            draws: vec![draw(Some(3), 20, 9), draw(None, 10, 0)],
        };
        let phase = Phase { kind: PhaseKind::ScanOut, number: 0, label: String::new(), begin: 30, limit: "" };
        Frame {
            number: 2,
            shown: None,
            tree: Default::default(),
            phases: vec![pass, PhaseReport::estimated(phase, 5)],
            display: Default::default(),
        }
    }

    #[test]
    fn what_is_zero_is_left_out_of_the_json() {
        let pass = json(&frame().phases[0]);
        assert_eq!(pass["units"], serde_json::json!({ "core": { "busy": 9 } }));
        assert_eq!(pass["memory"], serde_json::json!({ "dram": { "read_bytes": 64 } }));
        assert_eq!(pass["funnel"], serde_json::json!({ "quads_shaded": 9 }));
        assert_eq!((&pass["draws"][0]["number"], &pass["draws"][0]["group"]), (&3.into(), &"sky".into()));
        assert_eq!((&pass["draws"][1]["number"], pass["draws"][1].get("funnel")), (&Value::Null, None));
        assert_eq!(json(&frame().phases[1])["cycles"], 5);
    }

    #[test]
    fn rows_fit_their_headers() {
        let passes = pass_rows(&frame(), true);
        let lines: Vec<Vec<&str>> = passes.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!((lines.len(), lines[0].len()), (2, lines[1].len()), "{passes}");
        let at = |name: &str| lines[0].iter().position(|&known| known == name).expect(name);
        assert_eq!(
            (lines[1][at("cycles")], lines[1][at("units.core.busy")], lines[1][at("memory.dram.read_bytes")]),
            ("30", "9", "64")
        );
        let draws = draw_rows(&frame(), true);
        assert!(draws.contains("\n2,0,7,3,sky,\"a \"\"b\"\", c\",20,"), "{draws}");
        assert!(draws.contains("\n2,0,7,end of the pass,sky,"), "{draws}");
        assert_eq!(draw_rows(&frame(), false).lines().count(), 2, "no header");
    }
}
