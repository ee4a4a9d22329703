//! The frames of a replay as text: in `stats.json`, and as rows of `stats.csv`, `passes.csv` and `draws.csv`.

mod phases;

use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::run::replay::Frame;

pub use phases::{DRAWS, GEOMETRY, PASSES, TILES, draw_rows, pass_rows};

/// A frame as it stands in `stats.json`.
struct Whole<'f>(&'f Frame);

impl Serialize for Whole<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let Frame { number, tree, phases, .. } = self.0;
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("frame", number)?;
        tree.entries().try_for_each(|(name, node)| map.serialize_entry(name, node))?;
        if !phases.is_empty() {
            map.serialize_entry("phases", &phases.iter().map(phases::Json).collect::<Vec<_>>())?;
        }
        map.end()
    }
}

/// A frame in `stats.json`.
///
/// # Errors
/// If it cannot be written as JSON.
pub fn json_frame(frame: &Frame, first: bool) -> serde_json::Result<String> {
    // As deep as in the file, where it is in a list of an object.
    let text = serde_json::to_string_pretty(&[[Whole(frame)]])?;
    let inner = text.strip_prefix("[\n  [").and_then(|text| text.strip_suffix("\n  ]\n]")).unwrap_or(&text);
    Ok([if first { "" } else { "," }, inner].concat())
}

/// `stats.json` behind its last frame.
pub fn json_end(frames: bool) -> &'static str {
    if frames { "\n  ]\n}" } else { "]\n}" }
}

/// A frame in `stats.csv`: a row, behind the header if it is the first.
pub fn csv_rows(frame: &Frame, first: bool) -> String {
    let row = format!("{},{}\n", frame.number, frame.tree.csv_row());
    if first { format!("frame,{}\n{row}", frame.tree.csv_header()) } else { row }
}
