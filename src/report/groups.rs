//! The debug groups of a frame as a tree, with sums over their draws.

use crate::host::one_line;
use crate::machine::Moved;
use crate::mem::DRAM;
use crate::report::html::data::{CountedSpan, Statistics};
use crate::report::summary::{bytes, grouped};
use crate::stats::{Key, counter};
use crate::work::{FUNNEL, Funnel};

/// A debug group: all groups of one label in the same outer group, with the groups inside.
#[derive(Debug, Default, PartialEq)]
pub struct DrawGroup {
    /// The label; empty for the whole frame.
    pub label: String,
    /// Draws in it and in the groups inside.
    pub draws: u64,
    /// Their cycles, where these were simulated.
    pub cycles: f64,
    /// Their fragments that were shaded.
    pub fragments: u64,
    /// Bytes that DRAM read and wrote from the retirement before each of the draws to its own; none where draws retire together.
    pub bytes: Option<f64>,
    /// The groups inside, in the order of their first draws.
    pub inside: Vec<DrawGroup>,
}

const DRAM_BYTES: [Key; 2] = [DRAM.counter(counter!(Moved, read_bytes)), DRAM.counter(counter!(Moved, write_bytes))];

impl DrawGroup {
    fn add(&mut self, draw: &CountedSpan) {
        self.draws += 1;
        self.cycles += draw.cycles();
        self.fragments += FUNNEL.sum::<Funnel>(&draw.counts).fragments_shaded;
        for key in DRAM_BYTES {
            if let Some(moved) = key.sum(&draw.counts) {
                *self.bytes.get_or_insert(0.0) += moved;
            }
        }
    }
}

/// The groups of a frame whose draws were reported. None if there are no groups.
pub fn groups(frame: &CountedSpan) -> Option<DrawGroup> {
    let mut all = DrawGroup::default();
    for draw in frame.parts.iter().flat_map(|phase| &phase.parts).filter(|draw| draw.number.is_some()) {
        let mut group = &mut all;
        group.add(draw);
        for label in &draw.groups {
            let at = group.inside.iter().position(|inside| inside.label == *label).unwrap_or_else(|| {
                group.inside.push(DrawGroup { label: label.clone(), ..DrawGroup::default() });
                group.inside.len() - 1
            });
            group = &mut group.inside[at];
            group.add(draw);
        }
    }
    (!all.inside.is_empty()).then_some(all)
}

/// The groups of the frame that costs most as a table.
///
/// # Errors
/// If no draws were reported, or none of them is in a group.
pub fn text(statistics: &Statistics) -> Result<String, String> {
    let frame = statistics.frame();
    let draws = frame.parts.iter().flat_map(|phase| &phase.parts);
    if draws.clone().next().is_none() {
        return Err("no draw was reported: replay with --per-draw".into());
    }
    let all = groups(frame).ok_or_else(|| format!("no draw of frame {} is in a debug group", statistics.number()))?;
    let mut rows = Vec::new();
    row(&all, &format!("all draws of frame {}", statistics.number()), 0, &mut rows);
    let width = rows.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0).max("debug group".len());
    let titles = format!("{:>8}{:>16}{:>9}{:>18}{:>14}", "draws", "cycles", "share", "fragments shaded", "DRAM");
    let mut text = format!("{:<width$}{titles}\n", "debug group");
    for (name, group) in rows {
        let share = if all.cycles > 0.0 { 100.0 * group.cycles / all.cycles } else { 0.0 };
        let moved = group.bytes.map_or("-".to_owned(), bytes);
        text.push_str(&format!(
            "{name:<width$}{:>8}{:>16}{share:>7.1} %{:>18}{moved:>14}\n",
            grouped(group.draws),
            grouped(group.cycles as u64),
            grouped(group.fragments),
        ));
    }
    Ok(text)
}

fn row<'g>(group: &'g DrawGroup, name: &str, depth: usize, rows: &mut Vec<(String, &'g DrawGroup)>) {
    rows.push((format!("{}{}", "  ".repeat(depth), one_line(name)), group));
    group.inside.iter().for_each(|inside| row(inside, &inside.label, depth + 1, rows));
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn frame() -> CountedSpan {
        let draw = |number: u32, groups: &[&str], cycles: u32, fragments: u32| {
            json!({"number": number, "label": "", "group": groups.last().unwrap_or(&""), "groups": groups, "cycles": cycles,
                "funnel": {"fragments_shaded": fragments}, "memory": {"dram": {"read_bytes": 64, "write_bytes": 32}}})
        };
        let pass =
            |draws: Vec<serde_json::Value>| json!({"kind": "pass", "number": 0, "label": "", "cycles": 0, "draws": draws});
        CountedSpan::frame(&json!({"frame": 0, "cycles": 100, "phases": [
            pass(vec![draw(0, &[], 5, 1), draw(1, &["scene", "trees"], 10, 20), draw(2, &["scene"], 20, 30)]),
            pass(vec![draw(3, &["scene", "trees"], 30, 40), draw(4, &["sky"], 35, 9), json!({"number": null, "cycles": 7})]),
        ]}))
    }

    #[test]
    fn groups_of_one_label_are_summed_with_all_inside() {
        let all = groups(&frame()).expect("groups");
        let sums = |group: &DrawGroup| (group.draws, group.cycles, group.fragments, group.bytes);
        assert_eq!(sums(&all), (5, 100.0, 100, Some(480.0)));
        assert_eq!(all.inside.iter().map(|group| &*group.label).collect::<Vec<_>>(), ["scene", "sky"]);
        assert_eq!(sums(&all.inside[0]), (3, 60.0, 90, Some(288.0)));
        assert_eq!(sums(&all.inside[0].inside[0]), (2, 40.0, 60, Some(192.0)), "trees of both passes");
        assert_eq!(groups(&CountedSpan::default()), None);
    }
}
