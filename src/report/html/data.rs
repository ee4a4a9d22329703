//! What a page of a replay shows: `stats.json`, checked, of which one frame is kept whole.

use serde_json::{Map, Value};

use crate::host::is_obeyed;
use crate::report::files::VERSION;

/// Frames up to which each is kept with its funnel and its phases; of more, only the cycles are.
const DETAILED: usize = 500;

/// The statistics that are kept of a frame that is not the shown one.
const KEPT: [&str; 5] = ["frame", "cycles", "seconds", "funnel", "phases"];

/// The statistics that are kept of the phases of such a frame.
const PHASE: [&str; 5] = ["kind", "number", "label", "cycles", "limit"];

/// The statistics that are kept of a frame if there are more than [`DETAILED`].
const FEW: [&str; 3] = ["frame", "cycles", "seconds"];

/// The statistics of a replay. They have the names of `stats.json`; of all frames but one only a part is kept.
#[derive(Clone, Debug)]
pub struct Statistics {
    json: Value,
    shown: usize,
}

/// Puts statistics together, frame by frame: only the frame that costs most so far is held whole.
#[derive(Debug, Default)]
pub struct Gather {
    frames: Vec<Value>,
    most: Option<(usize, f64, Value)>,
}

/// What a frame costs: its cycles, or where none are known what it shades.
fn cost(frame: &Value) -> f64 {
    let cycles = frame.get("cycles").and_then(Value::as_f64);
    cycles.or_else(|| frame.get("funnel")?.get("fragments_shaded")?.as_f64()).unwrap_or(0.0)
}

fn part(frame: &Value, names: &[&str]) -> Value {
    let kept = |(name, value): (&String, &Value)| names.contains(&name.as_str()).then(|| (name.clone(), value.clone()));
    frame.as_object().map_or(Value::Null, |map| map.iter().filter_map(kept).collect::<Map<_, _>>().into())
}

impl Gather {
    /// Adds a frame as `stats.json` has it; whether it costs more than all before.
    pub fn add(&mut self, frame: Value) -> bool {
        let mut kept = part(&frame, &KEPT);
        for phase in kept.get_mut("phases").and_then(Value::as_array_mut).into_iter().flatten() {
            *phase = part(phase, &PHASE);
        }
        self.frames.push(kept);
        let own = cost(&frame);
        let most = self.most.as_ref().is_none_or(|(_, cost, _)| own > *cost);
        if most {
            self.most = Some((self.frames.len() - 1, own, frame));
        }
        most
    }

    /// The statistics; `head` has what stands in front of the frames.
    pub fn end(mut self, mut head: Map<String, Value>) -> Statistics {
        if self.frames.len() > DETAILED {
            self.frames.iter_mut().for_each(|frame| *frame = part(frame, &FEW));
        }
        let mut shown = 0;
        if let Some((at, _, whole)) = self.most {
            shown = at;
            self.frames[at] = whole;
        }
        head.insert("frames".into(), Value::Array(self.frames));
        Statistics { json: Value::Object(head), shown }
    }
}

impl Statistics {
    /// Reads the text of a `stats.json`; `only` leaves out all frames but the one of this number.
    ///
    /// # Errors
    /// If it is no JSON, of another version, or without what every such file has; the message has the place.
    pub fn parse(text: &str, only: Option<u32>) -> Result<Statistics, String> {
        let json: Value = serde_json::from_str(text).map_err(|error| format!("is no JSON: {error}"))?;
        let Value::Object(mut head) = json else { return Err("holds no object: it is not what replay leaves".into()) };
        match head.get("version") {
            Some(version) if version.as_u64() == Some(VERSION.into()) => {}
            Some(version) => return Err(format!("has version {version}, and this program reads version {VERSION}")),
            None => return Err("has no `version`: it is not what replay leaves".into()),
        }
        for name in ["trace", "config", "fidelity"] {
            if !head.get(name).is_some_and(Value::is_string) {
                return Err(format!("has no text `{name}`"));
            }
        }
        for name in ["total", "changed_knobs"] {
            if !head.get(name).is_some_and(Value::is_object) {
                return Err(format!("has no object `{name}`"));
            }
        }
        let Some(Value::Array(frames)) = head.shift_remove("frames") else { return Err("has no list `frames`".into()) };
        let mut gather = Gather::default();
        for (at, frame) in frames.into_iter().enumerate() {
            let Some(own) = frame.get("frame").and_then(Value::as_u64) else {
                return Err(format!("has no number in frames[{at}].frame"));
            };
            if only.is_none_or(|only| u64::from(only) == own) {
                gather.add(frame);
            }
        }
        if gather.most.is_none() {
            return Err(only.map_or("has no frame".into(), |only| format!("has no frame {only}")));
        }
        Ok(gather.end(head))
    }

    /// All of it.
    pub fn json(&self) -> &Value {
        &self.json
    }

    /// The frames, in order.
    pub fn frames(&self) -> &[Value] {
        self.json["frames"].as_array().map_or(&[], Vec::as_slice)
    }

    /// The frame that the page shows: the one that costs most.
    pub fn frame(&self) -> &Value {
        self.frames().get(self.shown).unwrap_or(&Value::Null)
    }

    /// Its number in the trace.
    pub fn number(&self) -> u32 {
        self.frame()["frame"].as_u64().and_then(|number| u32::try_from(number).ok()).unwrap_or(0)
    }

    /// Its path.
    pub fn place(&self) -> String {
        format!("frames[{}]", self.shown)
    }

    /// A text at the top.
    pub fn text(&self, name: &str) -> &str {
        self.json[name].as_str().unwrap_or("")
    }

    /// The number at a path below the frame that is shown.
    pub fn own(&self, path: &str) -> Option<f64> {
        number(self.frame(), path)
    }
}

/// The number at a path, such as `funnel.quads_shaded`. `caches.texture[*].hits` is the sum over the list.
pub fn number(value: &Value, path: &str) -> Option<f64> {
    let Some((head, rest)) = path.split_once("[*]") else { return at(value, path)?.as_f64() };
    let list = at(value, head)?.as_array()?;
    let numbers: Vec<f64> = list.iter().filter_map(|element| number(element, rest.trim_start_matches('.'))).collect();
    (!numbers.is_empty()).then(|| numbers.iter().sum())
}

/// The value at a path of names and places in lists.
pub fn at<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    path.split('.').try_fold(value, |value, step| {
        let (name, places) = step.split_once('[').map_or((step, None), |(name, places)| (name, Some(places)));
        let value = if name.is_empty() { value } else { value.get(name)? };
        let Some(places) = places else { return Some(value) };
        places.trim_end_matches(']').split("][").try_fold(value, |value, place| value.get(place.parse::<usize>().ok()?))
    })
}

/// JSON that may stand in a `script` of a page: nothing in it ends the script, begins a tag, or changes how the page's text is shown.
pub fn script(value: &Value) -> String {
    let mut out = String::new();
    for c in value.to_string().chars() {
        match c {
            c if is_obeyed(c) || matches!(c, '<' | '>' | '&') => {
                c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| out.push_str(&format!("\\u{unit:04x}")));
            }
            c => out.push(c),
        }
    }
    out
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn numbers_are_found_by_path_and_banks_are_summed() {
        let value = json!({ "frames": [{ "caches": { "l2": [{ "hits": 2 }, { "hits": 3 }] } }] });
        assert_eq!(number(&value, "frames[0].caches.l2[*].hits"), Some(5.0));
        assert_eq!(number(&value, "frames[0].caches.l2[1].hits"), Some(3.0));
        assert_eq!(number(&value, "frames[1].caches.l2[1].hits"), None);
        assert_eq!(number(&value, "frames[0].caches.l2[*].misses"), None);
    }

    #[test]
    fn a_script_holds_no_tag_and_is_the_same_value() {
        let value = json!({ "label": "</script><!--<script>&\u{2028}\u{202e}\u{e0041}\"" });
        let text = script(&value);
        assert!(!text.contains(['<', '>', '&']) && !text.contains(is_obeyed), "{text}");
        assert_eq!(serde_json::from_str::<Value>(&text).expect("JSON"), value);
    }

    #[test]
    fn the_frame_that_costs_most_is_whole() {
        let mut gather = Gather::default();
        let frame = |n: u64, cycles: u64| json!({ "frame": n, "cycles": cycles, "units": {}, "funnel": { "clipped": n }, "phases": [{ "kind": "pass", "draws": [] }] });
        let most: Vec<bool> = [5, 9, 9, 7].iter().zip(3..).map(|(&cycles, n)| gather.add(frame(n, cycles))).collect();
        assert_eq!(most, [true, true, false, false]);
        let found = gather.end(Map::new());
        assert_eq!((found.number(), found.place().as_str()), (4, "frames[1]"));
        assert!(found.frame().get("units").is_some());
        assert_eq!(
            found.frames()[3],
            json!({ "frame": 6, "cycles": 7, "funnel": { "clipped": 6 }, "phases": [{ "kind": "pass" }] })
        );
    }

    #[test]
    fn what_is_no_statistics_is_told() {
        let whole = json!({ "version": VERSION, "trace": "t", "config": "c", "fidelity": "cycle", "changed_knobs": {}, "total": {}, "frames": [{ "frame": 0 }] });
        assert!(Statistics::parse(&whole.to_string(), None).is_ok());
        assert_eq!(Statistics::parse(&whole.to_string(), Some(0)).expect("it is there").number(), 0);
        assert!(Statistics::parse(&whole.to_string(), Some(7)).expect_err("none").contains("no frame 7"));
        let without = |name: &str| {
            let mut value = whole.clone();
            value.as_object_mut().expect("an object").shift_remove(name);
            Statistics::parse(&value.to_string(), None).expect_err(name)
        };
        for name in ["version", "trace", "total", "frames"] {
            assert!(without(name).contains(name), "{}", without(name));
        }
        let mut other = whole.clone();
        other["version"] = json!(VERSION + 1);
        assert!(Statistics::parse(&other.to_string(), None).expect_err("another version").contains("version 2"));
        other = whole.clone();
        other["frames"] = json!([]);
        assert!(Statistics::parse(&other.to_string(), None).expect_err("no frame").contains("no frame"));
        assert!(Statistics::parse(&whole.to_string()[..40], None).expect_err("cut").contains("line 1 column"));
    }
}
