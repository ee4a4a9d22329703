//! The state of the selected draw, in words. The states of the draws that the page lists are in it, equal parts once.

use std::collections::BTreeMap;

use maud::{Markup, html};
use serde_json::{Value, json};

use crate::report::state::{DrawState, StatePart};

/// Bytes of text that a page has of states, about. Draws behind these have none.
const MOST: usize = 2 << 20;

/// The section that shows the state of the selected draw. None if no states are known.
pub fn section(states: &BTreeMap<u32, DrawState>) -> Option<Markup> {
    (!states.is_empty()).then(|| {
        html! {
            p.note.script { "A click on a row of the table of draws shows the state of that draw: what its pipeline is, and what is bound." }
            noscript { p.note { code { "fillrate report DIR --draw N" } " prints the state of a draw." } }
            div id="state-of" aria-live="polite" {}
        }
    })
}

/// The states as JSON: the parts, and for each draw where it was made with the numbers of its parts.
pub fn json(states: &BTreeMap<u32, DrawState>) -> Value {
    let mut numbers: BTreeMap<&StatePart, usize> = BTreeMap::new();
    let (mut parts, mut draws, mut bytes) = (Vec::new(), serde_json::Map::new(), 0);
    for (draw, state) in states {
        if bytes > MOST {
            break;
        }
        let mut own = Vec::new();
        for part in &state.parts {
            let number = *numbers.entry(part).or_insert_with(|| {
                let (title, lines) = part;
                bytes += lines.iter().map(|(name, value)| name.len() + value.len()).sum::<usize>();
                parts.push(json!([title, lines]));
                parts.len() - 1
            });
            own.push(number);
        }
        draws.insert(draw.to_string(), json!({"site": state.site.to_string(), "parts": own}));
    }
    json!({"parts": parts, "draws": draws})
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::CallSite;

    #[test]
    fn equal_parts_stand_once() {
        let state = |call, range: &str| DrawState {
            site: CallSite::Call(call),
            parts: vec![
                ("Vertices", vec![("draws".into(), range.into())]),
                ("Rasteriser", vec![("culls".into(), "back".into())]),
            ],
        };
        let states = BTreeMap::from([(3, state(70, "3 vertices")), (4, state(71, "6 vertices")), (9, state(80, "3 vertices"))]);
        let json = json(&states);
        assert_eq!(json["parts"].as_array().map(Vec::len), Some(3), "{json}");
        assert_eq!(json["draws"]["4"], json!({"site": "call 71", "parts": [2, 1]}));
        assert_eq!(json["draws"]["9"]["parts"], json["draws"]["3"]["parts"]);
    }
}
