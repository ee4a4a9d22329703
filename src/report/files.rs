//! What stands in `stats.json` before its frames.

use serde_json::{Map, Value, json};

use super::compare::KnobDifference;
use crate::stats::Tree;

/// The version of `stats.json`. It rises when a name goes or means something else, so that readers notice; what is only added leaves it.
pub const VERSION: u32 = 1;

/// What statistics are of.
#[derive(Clone, Debug, Default)]
pub struct About {
    /// The trace, as it was named.
    pub trace: String,
    /// The configuration's name.
    pub config: String,
    /// Every knob that differs from that configuration.
    pub changed: Vec<KnobDifference>,
    /// The fidelity.
    pub fidelity: &'static str,
}

/// The changed knobs by path, each with its value in the named configuration and in this run.
pub fn changed_json(changed: &[KnobDifference]) -> Value {
    // Numbers, texts and truth values are the same in RON and in JSON; what is not is kept as text.
    let value = |ron: &str| serde_json::from_str(ron).unwrap_or_else(|_| Value::String(ron.to_owned()));
    let knob = |d: &KnobDifference| (d.path.clone(), json!({ "from": value(&d.a), "to": value(&d.b) }));
    Value::Object(changed.iter().map(knob).collect::<Map<_, _>>())
}

/// What statistics are of, and the statistics over all frames.
pub fn head(about: &About, total: &Tree) -> Value {
    json!({
        "version": VERSION,
        "fillrate": env!("CARGO_PKG_VERSION"),
        "trace": about.trace,
        "config": about.config,
        "changed_knobs": changed_json(&about.changed),
        "fidelity": about.fidelity,
        "total": total.json(),
    })
}

/// `stats.json` up to its first frame.
///
/// # Errors
/// If it cannot be written as JSON.
pub fn json_head(about: &About, total: &Tree) -> serde_json::Result<String> {
    let mut head = serde_json::to_string_pretty(&head(about, total))?;
    // The object goes on.
    head.truncate(head.strip_suffix("\n}").unwrap_or(&head).len());
    head.push_str(",\n  \"frames\": [");
    Ok(head)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::PhaseReport;
    use crate::report::rows::{csv_rows, json_end, json_frame};
    use crate::run::replay::Frame;
    use crate::unit::phase::{Phase, PhaseKind};

    #[test]
    fn changed_knobs_have_both_values() {
        let knob = |path: &str, a: &str, b: &str| KnobDifference { path: path.into(), a: a.into(), b: b.into() };
        let changed = [knob("pipelines", "4", "8"), knob("sort", "\"sort-middle\"", "\"sort-first\"")];
        let expected = json!({
            "pipelines": { "from": 4, "to": 8 },
            "sort": { "from": "sort-middle", "to": "sort-first" },
        });
        assert_eq!(changed_json(&changed), expected);
        assert_eq!(changed_json(&[]), json!({}));
    }

    #[test]
    fn a_row_a_frame_and_the_same_names_in_both_files() {
        let tree = |quads| {
            let mut tree = Tree::new();
            tree.count("cycles", 10);
            tree.child("funnel").count("quads_shaded", quads);
            tree
        };
        let phase = Phase { kind: PhaseKind::Pass, number: 7, label: "sky\n}".into(), begin: 0, limit: String::new() };
        let frame = |number, quads| Frame {
            number,
            shown: None,
            tree: tree(quads),
            phases: vec![PhaseReport::estimated(phase.clone(), 10)],
            display: Default::default(),
        };
        let frames = [frame(3, 1), frame(4, 2)];
        let csv: String = frames.iter().enumerate().map(|(at, frame)| csv_rows(frame, at == 0)).collect();
        assert_eq!(csv, "frame,cycles,funnel.quads_shaded\n3,10,1\n4,10,2\n");

        let mut text = json_head(&About::default(), &tree(3)).expect("a text");
        for (at, frame) in frames.iter().enumerate() {
            text.push_str(&json_frame(frame, at == 0).expect("a text"));
        }
        text.push_str(json_end(true));
        let json: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(serde_json::to_string_pretty(&json).expect("a text"), text, "laid out as a whole");
        assert_eq!(json["frames"][1]["frame"], 4);
        assert_eq!(json["frames"][1]["phases"][0], json!({ "kind": "pass", "number": 7, "label": "sky\n}", "cycles": 10 }));
        assert_eq!(json["frames"][1]["funnel"]["quads_shaded"], 2);
        assert_eq!(json["total"]["funnel"]["quads_shaded"], 3);
        // A reader that stops at the version has not seen anything else.
        assert_eq!(json.as_object().and_then(|map| map.iter().next()), Some((&"version".to_owned(), &json!(VERSION))));

        let text = json_head(&About::default(), &tree(3)).expect("a text") + json_end(false);
        let json: Value = serde_json::from_str(&text).expect("JSON");
        assert_eq!(serde_json::to_string_pretty(&json).expect("a text"), text);
    }
}
