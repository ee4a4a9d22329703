//! What a page of a replay shows: `stats.json`, checked, of which one frame is kept whole.

use serde_json::{Map, Value};

use crate::host::is_obeyed;
use crate::report::files::VERSION;
use crate::sim::UNITS;
use crate::stats::{FRAME, FrameCounts, Key, Node, SECONDS, Tree, counter};
use crate::unit::phase::PhaseKind;
use crate::work::{FUNNEL, Funnel};

/// The cycles of a frame, a phase or a draw.
pub const CYCLES: Key = FRAME.counter(counter!(FrameCounts, cycles));

/// A frame, a phase of a frame or a draw of a pass, as `stats.json` has it.
#[derive(Clone, Debug, Default)]
pub struct CountedSpan {
    /// Its number in the frame. None at the end of a pass, behind its last draw.
    pub number: Option<u64>,
    /// The kind of a phase.
    pub kind: String,
    /// The label of a phase or a draw.
    pub label: String,
    /// Where the command of a draw was made: a call of the recording, a line, a block.
    pub site: String,
    /// Labels of the debug groups of a draw, the outermost first.
    pub groups: Vec<String>,
    /// The innermost debug group of a draw.
    pub group: String,
    /// What limits a phase, where the replay has estimated it.
    pub limit: String,
    /// What was counted in it. Below a frame, banks are summed.
    pub counts: Tree,
    /// The phases of a frame, or the draws of a phase.
    pub parts: Vec<CountedSpan>,
    /// The text in place of unit numbers in paths of the file: `[*]`, or nothing where banks are summed.
    pub units: &'static str,
}

impl CountedSpan {
    /// Reads a frame. What the file does not have is empty.
    pub fn frame(json: &Value) -> CountedSpan {
        CountedSpan { units: "[*]", ..CountedSpan::read(json) }
    }

    fn read(json: &Value) -> CountedSpan {
        let mut part = CountedSpan::default();
        let text = |value: &Value| value.as_str().unwrap_or("").to_owned();
        for (name, value) in json.as_object().into_iter().flatten() {
            match name.as_str() {
                "frame" | "number" => part.number = value.as_u64(),
                "kind" => part.kind = text(value),
                "label" => part.label = text(value),
                "site" => part.site = text(value),
                "groups" => part.groups = value.as_array().into_iter().flatten().map(text).collect(),
                "group" => part.group = text(value),
                "limit" => part.limit = text(value),
                "phases" | "draws" => part.parts = value.as_array().into_iter().flatten().map(CountedSpan::read).collect(),
                _ => {
                    if let Some(node) = Node::from_json(value) {
                        part.counts.set(name.clone(), node);
                    }
                }
            }
        }
        // A single group has its label alone.
        if part.groups.is_empty() && !part.group.is_empty() {
            part.groups.push(part.group.clone());
        }
        part
    }

    /// Its cycles; 0 where they are not known.
    pub fn cycles(&self) -> f64 {
        CYCLES.sum(&self.counts).unwrap_or(0.0)
    }

    /// Whether this is a phase of a kind.
    pub fn is(&self, kind: PhaseKind) -> bool {
        self.kind == kind.name()
    }

    /// Whether something is drawn or computed in this phase. The others move data.
    pub fn draws(&self) -> bool {
        self.is(PhaseKind::Pass) || self.is(PhaseKind::Dispatch)
    }

    /// Whether units were read at its ends. What they count is left out of the file where it is 0.
    pub fn is_counted(&self) -> bool {
        !UNITS.find(&self.counts).is_empty()
    }

    /// The name of a phase as the terminal has it.
    pub fn name(&self) -> String {
        let number = if self.draws() { format!(" {}", self.number.unwrap_or(0)) } else { String::new() };
        let gap = if self.label.is_empty() { "" } else { " " };
        format!("{}{number}{gap}{}", self.kind, self.label)
    }
}

/// Frames up to which each is kept with its funnel and its phases; of more, only the cycles are.
const DETAILED: usize = 500;

/// The names that are kept of a frame if there are more than [`DETAILED`].
const FEW: [&str; 3] = ["frame", counter!(FrameCounts, cycles).name(), SECONDS.name];

/// The names that are kept of a frame that is not the shown one.
const KEPT: [&str; 5] = [FEW[0], FEW[1], FEW[2], FUNNEL.path, "phases"];

/// The names that are kept of the phases of such a frame.
const PHASE: [&str; 5] = ["kind", "number", "label", FEW[1], "limit"];

/// The statistics of a replay. They have the names of `stats.json`; of all frames but one only a part is kept.
#[derive(Clone, Debug)]
pub struct Statistics {
    json: Value,
    frames: Vec<CountedSpan>,
    shown: usize,
}

/// Puts statistics together, frame by frame: only the frame that costs most so far is held whole.
#[derive(Debug, Default)]
pub struct Gather {
    frames: Vec<Value>,
    most: Option<(usize, f64, Value)>,
}

/// What a frame costs: its cycles, or where none are known what it shades.
fn cost(frame: &CountedSpan) -> f64 {
    let shaded = || FUNNEL.sum::<Funnel>(&frame.counts).fragments_shaded as f64;
    CYCLES.sum(&frame.counts).unwrap_or_else(shaded)
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
        let own = cost(&CountedSpan::frame(&kept));
        self.frames.push(kept);
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
        let frames = self.frames.iter().map(CountedSpan::frame).collect();
        head.insert("frames".into(), Value::Array(self.frames));
        Statistics { json: Value::Object(head), frames, shown }
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

    /// The frames, in order. All but the one that is shown have lost most of what was counted.
    pub fn frames(&self) -> &[CountedSpan] {
        &self.frames
    }

    /// The frame that the page shows: the one that costs most.
    pub fn frame(&self) -> &CountedSpan {
        &self.frames[self.shown]
    }

    /// Its number in the trace.
    pub fn number(&self) -> u32 {
        self.frame().number.and_then(|number| u32::try_from(number).ok()).unwrap_or(0)
    }

    /// Its path.
    pub fn place(&self) -> String {
        format!("frames[{}]", self.shown)
    }

    /// A text at the top.
    pub fn text(&self, name: &str) -> &str {
        self.json[name].as_str().unwrap_or("")
    }
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
    fn a_script_holds_no_tag_and_is_the_same_value() {
        let value = json!({ "label": "</script><!--<script>&\u{2028}\u{202e}\u{e0041}\"" });
        let text = script(&value);
        assert!(!text.contains(['<', '>', '&']) && !text.contains(is_obeyed), "{text}");
        assert_eq!(serde_json::from_str::<Value>(&text).expect("JSON"), value);
    }

    #[test]
    fn the_frame_that_costs_most_is_whole() {
        let mut gather = Gather::default();
        let frame = |n: u64, cycles: u64| json!({ "frame": n, "cycles": cycles, "units": { "clip": {} }, "funnel": { "clipped": n }, "phases": [{ "kind": "pass", "draws": [] }] });
        let most: Vec<bool> = [5, 9, 9, 7].iter().zip(3..).map(|(&cycles, n)| gather.add(frame(n, cycles))).collect();
        assert_eq!(most, [true, true, false, false]);
        let found = gather.end(Map::new());
        assert_eq!((found.number(), found.place().as_str()), (4, "frames[1]"));
        assert!(found.frame().is_counted());
        assert_eq!(
            found.json()["frames"][3],
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
