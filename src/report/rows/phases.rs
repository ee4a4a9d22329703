//! Phases of frames, and the draws of passes: in `stats.json`, and as tables of their own.

use std::ops::Range;

use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::machine::{CounterGroup, DrawReport, PhaseReport, Tally};
use crate::num::Cycle;
use crate::run::replay::Frame;
use crate::stats::{Declaration, Group as _, csv_field};
use crate::unit::phase::PhaseKind;
use crate::work::Funnel;

/// The table of phases: a row for each phase of a frame.
pub const PASSES: &str = "passes.csv";

/// The table of draws: a row per draw, and one for the end of its pass.
pub const DRAWS: &str = "draws.csv";

/// A phase as it stands in `stats.json`.
pub struct Json<'r>(pub &'r PhaseReport);

impl Serialize for Json<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let PhaseReport { phase, cycles, counts, draws } = self.0;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("kind", phase.kind.name())?;
        map.serialize_entry("number", &phase.number)?;
        map.serialize_entry("label", &phase.label)?;
        map.serialize_entry("cycles", cycles)?;
        if !phase.limit.is_empty() {
            map.serialize_entry("limit", &phase.limit)?;
        }
        if let Some(counts) = counts {
            told(&mut map, counts, phase.kind == PhaseKind::Pass)?;
        }
        if !draws.is_empty() {
            map.serialize_entry("draws", &draws.iter().map(Drawn).collect::<Vec<_>>())?;
        }
        map.end()
    }
}

/// The share of a draw in the geometry half of a pass whose tiles are drawn one after another.
pub const GEOMETRY: Declaration = Declaration::new(
    "geometry_cycles",
    "cycles",
    "Of a draw, where tiles are drawn one after another: its share of the cycles before tiles are drawn, by vertices shaded and primitives.",
);

/// The share of a draw in the tile half of such a pass.
pub const TILES: Declaration = Declaration::new(
    "tile_cycles",
    "cycles",
    "The same of the cycles in which tiles are drawn, by triangles set up and quads. Both add up to the draw's cycles.",
);

/// A draw as it stands there.
struct Drawn<'r>(&'r DrawReport);

impl Serialize for Drawn<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let DrawReport { number, label, site, groups, cycles, halves, counts } = self.0;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("number", number)?;
        map.serialize_entry("label", label)?;
        if let Some(site) = site {
            map.serialize_entry("site", &site.to_string())?;
        }
        map.serialize_entry("group", self.0.group())?;
        if groups.len() > 1 {
            map.serialize_entry("groups", &groups.iter().map(|label| &**label).collect::<Vec<&str>>())?;
        }
        map.serialize_entry("cycles", cycles)?;
        if let Some([geometry, tiles]) = halves {
            map.serialize_entry(GEOMETRY.name, geometry)?;
            map.serialize_entry(TILES.name, tiles)?;
        }
        told(&mut map, counts, number.is_some())?;
        map.end()
    }
}

/// Counters that are not 0.
struct Counters<I>(I);

impl<I: Iterator<Item = (&'static str, u64)> + Clone> Serialize for Counters<I> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        for (name, value) in self.0.clone().filter(|(_, value)| *value > 0) {
            map.serialize_entry(name, &value)?;
        }
        map.end()
    }
}

/// A group of counters that did something: its place, and where its values are among all.
struct Group {
    place: CounterGroup,
    declarations: &'static [Declaration],
    values: Range<usize>,
}

impl Group {
    /// The step of its path at a depth; none behind the last.
    fn step(&self, depth: usize) -> Option<&'static str> {
        let (steps, of) = self.place;
        steps.get(depth).copied().or(if depth == steps.len() { of } else { None })
    }
}

/// Groups whose paths are the same down to a depth. Those that share the next step stand together.
struct Level<'g> {
    groups: &'g [Group],
    values: &'g [u64],
    depth: usize,
}

impl Level<'_> {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        let Level { values, depth, .. } = *self;
        for run in self.groups.chunk_by(|a, b| a.step(depth) == b.step(depth)) {
            let Some(name) = run[0].step(depth) else { continue };
            if run[0].step(depth + 1).is_some() {
                map.serialize_entry(name, &Level { groups: run, values, depth: depth + 1 })?;
            } else {
                let names = run[0].declarations.iter().map(|declaration| declaration.name);
                map.serialize_entry(name, &Counters(names.zip(values[run[0].values.clone()].iter().copied())))?;
            }
        }
        Ok(())
    }
}

impl Serialize for Level<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        self.put(&mut map)?;
        map.end()
    }
}

/// What was counted and is not 0; of units those that did something, not only waited for input.
fn told<M: SerializeMap>(map: &mut M, counts: &Tally, draws: bool) -> Result<(), M::Error> {
    if draws {
        map.serialize_entry("funnel", &Counters(counts.funnel.named()))?;
    }
    let (mut groups, mut values) = (Vec::with_capacity(64), Vec::with_capacity(256));
    counts.groups(|(place, worked), declarations, own| {
        if worked {
            let first = values.len();
            values.extend_from_slice(own);
            groups.push(Group { place, declarations, values: first..values.len() });
        }
    });
    Level { groups: &groups, values: &values, depth: 0 }.put(map)
}

/// The rows of a frame in `passes.csv`, behind the header if they are the first. Empty where nothing was simulated.
pub fn pass_rows(frame: &Frame, first: bool) -> String {
    let mut text = String::new();
    for (at, report) in frame.phases.iter().enumerate() {
        let (Some(counts), phase) = (&report.counts, &report.phase) else { continue };
        if first && text.is_empty() {
            header(&mut text, "frame,phase,kind,number,label,cycles", counts);
        }
        let start = [
            &frame.number.to_string(),
            &at.to_string(),
            phase.kind.name(),
            &phase.number.to_string(),
            &csv_field(&phase.label),
        ];
        row(&mut text, &start, [report.cycles].into_iter(), counts);
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
                let halves = if draw.halves.is_some() { [",", GEOMETRY.name, ",", TILES.name].concat() } else { String::new() };
                header(&mut text, &format!("frame,phase,pass,draw,site,group,label,cycles{halves}"), &draw.counts);
            }
            let number = draw.number.map_or("end of the pass".into(), |number| number.to_string());
            let site = draw.site.map_or(String::new(), |site| site.to_string());
            let path = draw.groups.join("/");
            let (group, label) = (csv_field(&path), csv_field(&draw.label));
            let start = [&*pass[0], &pass[1], &pass[2], &number, &site, &group, &label];
            row(&mut text, &start, [draw.cycles].into_iter().chain(draw.halves.into_iter().flatten()), &draw.counts);
        }
    }
    text
}

fn header(text: &mut String, start: &str, counts: &Tally) {
    text.push_str(start);
    Funnel::DECLARATIONS.iter().for_each(|counter| text.extend([",funnel.", counter.name]));
    counts.each(|(steps, of), name, _| {
        text.push(',');
        steps.iter().copied().chain(of).for_each(|step| text.extend([step, "."]));
        text.push_str(name);
    });
    text.push('\n');
}

fn row(text: &mut String, start: &[&str], cycles: impl Iterator<Item = Cycle>, counts: &Tally) {
    text.push_str(&start.join(","));
    let mut add = |value: u64| digits(text, value);
    cycles.for_each(&mut add);
    counts.funnel.values().for_each(&mut add);
    counts.each(|_, _, value| add(value));
    text.push('\n');
}

/// Appends a comma and a number. A row has hundreds of them, most of them 0.
fn digits(text: &mut String, mut value: u64) {
    if value < 10 {
        text.extend([',', (b'0' + value as u8).into()]);
        return;
    }
    let (mut digits, mut at) = ([0; 20], 20);
    while value > 0 {
        at -= 1;
        digits[at] = b'0' + (value % 10) as u8;
        value /= 10;
    }
    text.push(',');
    digits[at..].iter().for_each(|&digit| text.push(digit.into()));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::{Moved, Spent};
    use crate::num::CallSite;
    use crate::unit::phase::Phase;
    use serde_json::Value;

    fn json(report: &PhaseReport) -> Value {
        serde_json::to_value(Json(report)).expect("JSON")
    }

    #[test]
    fn numbers_are_written_as_they_are() {
        for value in [0, 7, 10, 99, 100, 12_345_678_901, u64::MAX] {
            let mut text = String::new();
            digits(&mut text, value);
            assert_eq!(text, format!(",{value}"));
        }
    }

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
            site: number.map(|_| CallSite::Call(41)),
            groups: ["sky".into()].into(),
            cycles,
            halves: None,
            counts: counts(busy, 0),
        };
        let pass = PhaseReport {
            phase: Phase { kind: PhaseKind::Pass, number: 7, label: "main".into(), begin: 0, limit: String::new() },
            cycles: 30,
            counts: Some(Box::new(counts(9, 64))),
            draws: vec![draw(Some(3), 20, 9), draw(None, 10, 0)],
        };
        let phase = Phase { kind: PhaseKind::ScanOut, number: 0, label: String::new(), begin: 30, limit: String::new() };
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
        assert!(draws.contains("\n2,0,7,3,call 41,sky,\"a \"\"b\"\", c\",20,"), "{draws}");
        assert!(draws.contains("\n2,0,7,end of the pass,,sky,"), "{draws}");
        assert_eq!(draw_rows(&frame(), false).lines().count(), 2, "no header");
        // On a machine that bins, cycles have two halves.
        let mut binned = frame();
        binned.phases[0].draws.iter_mut().for_each(|draw| draw.halves = Some([draw.cycles, 0]));
        let draws = draw_rows(&binned, true);
        assert!(draws.contains(",cycles,geometry_cycles,tile_cycles,") && draws.contains(",20,20,0,"), "{draws}");
        assert_eq!(json(&binned.phases[0])["draws"][0]["geometry_cycles"], 20);
    }
}
