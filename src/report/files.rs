//! The files that a replay leaves: `stats.json` and `stats.csv`.

use serde_json::{Value, json};

use crate::num::Cycle;
use crate::stats::Tree;
use crate::unit::phase::Phase;
use crate::work::Funnel;

/// The version of `stats.json`. It rises when a name goes or means something else, so that readers notice; what is only added leaves it.
pub const VERSION: u32 = 1;

/// The statistics of a frame.
#[derive(Clone, Debug, Default)]
pub struct FrameStatistics {
    /// The trace's own number of it.
    pub number: u32,
    /// Its counters.
    pub tree: Tree,
    /// What was done one after another, and for how long; empty where no time is simulated.
    pub phases: Vec<(Phase, Cycle)>,
}

/// The statistics of a replay.
#[derive(Clone, Debug, Default)]
pub struct Statistics {
    /// The trace, as it was named.
    pub trace: String,
    /// The configuration's name.
    pub config: String,
    /// The fidelity.
    pub fidelity: String,
    /// Over all frames.
    pub total: Tree,
    /// By frame.
    pub frames: Vec<FrameStatistics>,
}

impl Statistics {
    /// The contents of `stats.json`.
    pub fn json(&self) -> Value {
        let frames: Vec<Value> = self
            .frames
            .iter()
            .map(|FrameStatistics { number, tree, phases }| {
                let mut frame = tree.json();
                if let Value::Object(map) = &mut frame {
                    map.shift_insert(0, "frame".into(), json!(number));
                    if !phases.is_empty() {
                        map.insert("phases".into(), phases.iter().map(phase_json).collect());
                    }
                }
                frame
            })
            .collect();
        json!({
            "version": VERSION,
            "fillrate": env!("CARGO_PKG_VERSION"),
            "trace": self.trace,
            "config": self.config,
            "fidelity": self.fidelity,
            "total": self.total.json(),
            "frames": frames,
        })
    }

    /// The contents of `stats.csv`: a header, then a row a frame.
    pub fn csv(&self) -> String {
        let mut text = String::new();
        if let Some(first) = self.frames.first() {
            text.push_str(&format!("frame,{}\n", first.tree.csv_header()));
        }
        for FrameStatistics { number, tree, .. } in &self.frames {
            text.push_str(&format!("{number},{}\n", tree.csv_row()));
        }
        text
    }
}

fn phase_json((phase, cycles): &(Phase, Cycle)) -> Value {
    let mut value = json!({ "kind": phase.kind.name(), "number": phase.number, "label": phase.label, "cycles": cycles });
    if let (Value::Object(map), false) = (&mut value, phase.limit.is_empty()) {
        map.insert("limit".into(), phase.limit.into());
    }
    value
}

/// A funnel as a subtree of counters.
pub fn funnel_tree(funnel: &Funnel) -> Tree {
    let mut tree = Tree::new();
    for (name, value) in Funnel::NAMES.iter().zip(funnel.values()) {
        tree.count(name, value);
    }
    tree
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::stats::Node;
    use crate::unit::phase::PhaseKind;

    #[test]
    fn a_row_a_frame_and_the_same_names_in_both_files() {
        let tree = |quads| {
            let mut tree = Tree::new();
            tree.count("cycles", 10);
            tree.set("funnel", Node::Tree(funnel_tree(&Funnel { quads_shaded: quads, ..Funnel::default() })));
            tree
        };
        let phase = Phase { kind: PhaseKind::Pass, number: 7, label: "sky".into(), begin: 0, limit: "" };
        let frame = |number, quads| FrameStatistics { number, tree: tree(quads), phases: vec![(phase.clone(), 10)] };
        let statistics = Statistics { frames: vec![frame(3, 1), frame(4, 2)], total: tree(3), ..Statistics::default() };
        let csv = statistics.csv();
        let lines: Vec<_> = csv.lines().collect();
        assert_eq!(lines.len(), 3);
        assert!(lines[0].starts_with("frame,cycles,funnel.vertices_in,"), "{csv}");
        assert!(lines[1].starts_with("3,10,"));
        let json = statistics.json();
        assert_eq!(json["frames"][1]["frame"], 4);
        assert_eq!(json["frames"][1]["phases"][0], json!({ "kind": "pass", "number": 7, "label": "sky", "cycles": 10 }));
        assert_eq!(json["frames"][1]["funnel"]["quads_shaded"], 2);
        assert_eq!(json["total"]["funnel"]["quads_shaded"], 3);
        // A reader that stops at the version has not seen anything else.
        assert_eq!(json.as_object().and_then(|map| map.iter().next()), Some((&"version".to_owned(), &json!(VERSION))));
    }
}
