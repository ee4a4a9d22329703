//! From text to configuration.

use std::collections::BTreeMap;

use ron::Value;
use ron::error::Position;
use ron::value::Number;

use super::places::{self, KeyLocation};
use super::{BUILT_IN, Config, ConfigError};
use host::ron_reason;
use knob::{Allowed, Knob, Section, Setting};
use num::{edits, nearest};

/// A knob as written.
struct Written {
    path: String,
    value: WrittenValue,
}

/// A value as written.
struct WrittenValue {
    /// What a knob can take; none: a value of a kind that no knob takes.
    setting: Option<Setting>,
    /// How messages show it.
    shown: String,
}

impl From<Setting> for WrittenValue {
    fn from(setting: Setting) -> WrittenValue {
        WrittenValue { shown: setting.to_string(), setting: Some(setting) }
    }
}

impl WrittenValue {
    /// A value that no knob takes.
    fn unfit(shown: impl Into<String>) -> WrittenValue {
        WrittenValue { setting: None, shown: shown.into() }
    }
}

/// Reads a configuration, base first; `depth` counts how often one extends another.
pub fn parse(file: &str, text: &str, depth: u32) -> Result<Config, ConfigError> {
    let syntax = |message: String| ConfigError::Syntax { file: file.to_owned(), message };
    let value: Value = ron::from_str(text).map_err(|error| {
        if !opens(text) {
            return syntax(NO_CONFIGURATION.to_owned());
        }
        let Position { line, col } = error.span.start;
        ConfigError::Syntax { file: format!("{file}:{line}:{col}"), message: ron_reason(&error.code) }
    })?;
    let map = match value {
        Value::Map(map) if is_configuration(&map) => map,
        _ => return Err(syntax(NO_CONFIGURATION.to_owned())),
    };
    let keys = places::keys(text);
    let mut places = BTreeMap::new();
    for place in &keys {
        if places.insert(place.path.as_str(), place).is_some() {
            return Err(ConfigError::Syntax { file: at(file, place), message: format!("{} is given twice", place.path) });
        }
    }
    let (mut base, mut written) = (None, Vec::new());
    for (key, value) in map.iter() {
        let Value::String(key) = key else { return Err(syntax(format!("a key is a name, not {key:?}"))) };
        match (key.as_str(), value) {
            ("extends", Value::String(name)) => base = Some(name.clone()),
            ("extends", _) => return Err(syntax("extends is the name of a configuration, in quotes".to_owned())),
            _ => flatten(file, key.clone(), value, &mut written)?,
        }
    }
    let mut config = match &base {
        Some(name) => {
            let found = BUILT_IN.iter().find(|(known, _)| known == name);
            let Some((known, text)) = found.filter(|(known, _)| *known != file && depth < 8) else {
                return Err(ConfigError::Unknown { file: file.to_owned(), name: name.clone() });
            };
            parse(known, text, depth + 1)?
        }
        None => Config::default(),
    };
    config.name = file.to_owned();
    for Written { path, value } in &written {
        let place = places.get(path.as_str());
        apply(&mut config, &place.map_or(file.to_owned(), |place| at(file, place)), path, value)?;
    }
    // A key that there is not comes first: it may be the one that is missing.
    if base.is_none() {
        complete(file, &written)?;
    }
    Ok(config)
}

/// What is said of a text that is something else: a page, a trace, a list.
const NO_CONFIGURATION: &str =
    "this is not a configuration, which is (key: value, ...), for instance (extends: \"baseline\", pipelines: 8)";

/// Whether a text begins as a configuration does, after comments, blanks and attributes of RON.
fn opens(text: &str) -> bool {
    let mut left = text.trim_start_matches('\u{feff}').trim_start();
    loop {
        let skipped = if left.starts_with("//") {
            left.find('\n').unwrap_or(left.len())
        } else if left.starts_with("/*") {
            places::comment(left)
        } else if left.starts_with("#!") {
            left.find(']').map_or(left.len(), |end| end + 1)
        } else {
            return left.starts_with(['(', '{']);
        };
        left = left[skipped..].trim_start();
    }
}

/// Whether these keys of the outermost level are those of a configuration: one is a section, a knob of the card or `extends`, or at least
/// half of them are so spelled that one of these is meant, and the message that names the nearest helps.
fn is_configuration(map: &ron::Map) -> bool {
    let sections = Config::default();
    let nearest = |key: &Value| {
        let Value::String(key) = key else { return usize::MAX };
        let of = |(section, knobs): (&str, &dyn Section)| {
            let names = if section.is_empty() { knobs.knobs().iter().map(|knob| knob.name).collect() } else { vec![section] };
            names.into_iter().map(|name| edits(name, key)).min().unwrap_or(usize::MAX)
        };
        sections.sections().into_iter().map(of).min().unwrap_or(usize::MAX).min(edits("extends", key))
    };
    let distances: Vec<usize> = map.iter().map(|(key, _)| nearest(key)).collect();
    let meant = distances.iter().filter(|&&distance| distance <= 2).count();
    distances.contains(&0) || meant > 0 && 2 * meant >= distances.len()
}

/// A place as messages name it.
fn at(file: &str, KeyLocation { at: [line, column], .. }: &KeyLocation) -> String {
    format!("{file}:{line}:{column}")
}

/// `path.to.key=value`.
pub fn assign(config: &mut Config, assignment: &str) -> Result<(), ConfigError> {
    const FILE: &str = "--set";
    let syntax = |message: String| ConfigError::Syntax { file: FILE.to_owned(), message };
    let Some((path, value)) = assignment.split_once('=') else {
        return Err(syntax(format!("{assignment} is not path.to.key=value")));
    };
    let (path, value) = (Config::path(path), value.trim());
    let digits = value.replace('_', "");
    let given = match value {
        "true" => Setting::Switch(true).into(),
        "false" => Setting::Switch(false).into(),
        _ => match digits.parse::<u64>() {
            Ok(number) => Setting::Number(number).into(),
            // A number, but no whole one from 0. Rust reads `inf` and `nan` as numbers, too: here they are names.
            Err(_) if digits.ends_with(|c: char| c.is_ascii_digit()) && digits.parse::<f64>().is_ok() => {
                WrittenValue::unfit(value)
            }
            // Names may be written without quotes here, where a shell would eat them.
            Err(_) => Setting::Name(value.trim_matches('"').to_owned()).into(),
        },
    };
    apply(config, FILE, path, &given)
}

/// Turns nested sections into paths.
fn flatten(file: &str, path: String, value: &Value, written: &mut Vec<Written>) -> Result<(), ConfigError> {
    let value = match value {
        Value::Map(map) => {
            for (key, value) in map.iter() {
                let Value::String(key) = key else {
                    let message = format!("{path}: a key is a name, not {key:?}");
                    return Err(ConfigError::Syntax { file: file.to_owned(), message });
                };
                flatten(file, format!("{path}.{key}"), value, written)?;
            }
            return Ok(());
        }
        Value::Bool(value) => Setting::Switch(*value).into(),
        Value::String(name) => Setting::Name(name.clone()).into(),
        Value::Number(number) => match whole(number) {
            Some(number) => Setting::Number(number).into(),
            None => WrittenValue::unfit(number.into_f64().to_string()),
        },
        Value::Char(c) => WrittenValue::unfit(format!("the character {c:?}")),
        Value::Seq(_) => WrittenValue::unfit("a list"),
        Value::Option(_) => WrittenValue::unfit("an option"),
        Value::Unit => WrittenValue::unfit("empty"),
        Value::Bytes(_) => WrittenValue::unfit("a string of bytes"),
    };
    written.push(Written { path, value });
    Ok(())
}

fn whole(number: &Number) -> Option<u64> {
    let value = number.into_f64();
    (value >= 0.0 && value.fract() == 0.0 && value < 9.0e15).then_some(value as u64)
}

/// Whether every knob is written.
fn complete(file: &str, written: &[Written]) -> Result<(), ConfigError> {
    let missing = Config::default().knobs().find(|(path, _)| !written.iter().any(|known| known.path == *path));
    missing.map_or(Ok(()), |(key, _)| Err(ConfigError::Missing { file: file.to_owned(), key }))
}

/// The knob at a path, and its value.
pub fn find(config: &Config, file: &str, path: &str) -> Result<(&'static Knob, Setting), ConfigError> {
    let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
    let found = config.sections().into_iter().find(|(known, _)| *known == section);
    let knob = found.and_then(|(_, knobs)| {
        let knob = knobs.knobs().iter().find(|knob| knob.name == name)?;
        Some((knob, knobs.get(name)?))
    });
    knob.ok_or_else(|| ConfigError::UnknownKey { file: file.to_owned(), key: path.to_owned(), hint: hint(path) })
}

/// Sets the knob at a path.
pub fn put(config: &mut Config, file: &str, path: &str, setting: &Setting) -> Result<(), ConfigError> {
    apply(config, file, path, &WrittenValue::from(setting.clone()))
}

/// Sets one knob.
fn apply(config: &mut Config, file: &str, path: &str, given: &WrittenValue) -> Result<(), ConfigError> {
    let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
    let found = config.sections_mut().into_iter().find(|(known, _)| *known == section);
    let knob = found.as_ref().and_then(|(_, knobs)| knobs.knobs().iter().find(|knob| knob.name == name));
    let (Some((_, knobs)), Some(knob)) = (found, knob) else {
        return Err(ConfigError::UnknownKey { file: file.to_owned(), key: path.to_owned(), hint: hint(path) });
    };
    if given.setting.as_ref().is_some_and(|setting| knobs.set(name, setting)) {
        return Ok(());
    }
    let value = match &given.setting {
        // Quotes alone are easily overlooked around a number.
        Some(Setting::Name(_)) if !matches!(knob.allowed, Allowed::Choice(_)) => format!("the text {}", given.shown),
        _ => given.shown.clone(),
    };
    let allowed = knob.allowed.to_string();
    Err(ConfigError::Value { file: file.to_owned(), key: path.to_owned(), value, allowed })
}

/// The key that is nearest to one that there is not: one that has sections in front of it, else the one with the fewest edits.
fn hint(path: &str) -> String {
    let paths: Vec<String> = Config::default().knobs().map(|(path, _)| path).collect();
    let in_section = |known: &&str| known.strip_suffix(path).is_some_and(|sections| sections.ends_with('.'));
    let known = || paths.iter().map(String::as_str);
    let nearest = known().filter(in_section).min_by_key(|known| known.len()).or_else(|| nearest(known(), path));
    nearest.map_or(String::new(), |known| format!("; {known} is the nearest"))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(text: &str) -> String {
        Config::parse("mine.ron", text).unwrap_err().to_string()
    }

    #[test]
    fn what_is_no_configuration_is_told_so() {
        let trace = "Trace(version: 1, files: {}, commands: [Draw(vertices: 3), Draw(vertices: 3)])";
        let bare = "(version: 1, files: {}, commands: [(vertices: 3), (vertices: 3)])";
        let texts = [trace, bare, "# A page\n\nwith text", "", "[1, 2]", "42", "\"baseline\"", "()", "{1: 2}", "{\"name\": 1}"];
        for text in texts {
            assert_eq!(message(text), format!("mine.ron: {NO_CONFIGURATION}"), "{text}");
        }
        assert_eq!(message("(pipelnes: 4)"), "mine.ron:1:2: there is no key pipelnes; pipelines is the nearest");
        // `clip.latency` has fewer edits, and another section.
        let nearest = message("(extends: \"baseline\", l2: (latency: 9))");
        assert_eq!(nearest, "mine.ron:1:28: there is no key l2.latency; memory.l2.latency is the nearest");
        assert!(message("(pipelines: 4)").contains("extends nothing must be complete"), "{}", message("(pipelines: 4)"));
        assert_eq!(message("// (extends: 1)\n# A page"), format!("mine.ron: {NO_CONFIGURATION}"));
    }

    #[test]
    fn a_configuration_that_is_no_ron_is_told_the_place() {
        let head = "// mine\n/* and /* only */ */ ";
        for (text, place) in
            [("(extends: \"baseline\", pipelines 8)", "2:"), ("(pipelines = 8)", "2:"), ("(core: (warps: 4)", "2:")]
        {
            let message = message(&format!("{head}{text}"));
            assert!(message.starts_with(&format!("mine.ron:{place}")) && !message.contains(NO_CONFIGURATION), "{message}");
        }
        // Keys in quotes, and attributes of RON, are as good.
        for text in
            ["{\"extends\": \"baseline\", \"pipelines\": 8}", "#![enable(implicit_some)] (extends: \"baseline\", pipelines: 8)"]
        {
            assert_eq!(Config::parse("mine.ron", text).unwrap().card.pipelines, 8);
        }
    }

    #[test]
    fn a_value_of_another_kind_is_told_its_kind() {
        let base = |rest: &str| message(&format!("(extends: \"baseline\", {rest})"));
        let number = "and must be a whole number from 1 to 64";
        for (value, told) in [
            ("\"8\"", "the text \"8\""),
            ("\"\"", "the text \"\""),
            ("'8'", "the character '8'"),
            ("[8]", "a list"),
            ("Some(8)", "an option"),
            ("true", "true"),
            ("8.5", "8.5"),
            ("-8", "-8"),
        ] {
            assert_eq!(base(&format!("pipelines: {value}")), format!("mine.ron:1:23: pipelines is {told}, {number}"));
        }
        assert_eq!(
            base("scanout: (enabled: \"true\")"),
            "mine.ron:1:33: scanout.enabled is the text \"true\", and must be true or false"
        );
        assert!(base("sort: 3").starts_with("mine.ron:1:23: sort is 3, and must be one of \"sort-"), "{}", base("sort: 3"));
    }

    #[test]
    fn an_assignment_of_another_kind_is_told_its_kind() {
        let set = |text: &str| Config::built_in("baseline").unwrap().set(text).unwrap_err().to_string();
        let number = "and must be a whole number from 1 to 64";
        for (value, told) in [
            ("\"8\"", "the text \"8\""),
            ("eight", "the text \"eight\""),
            ("inf", "the text \"inf\""),
            ("", "the text \"\""),
            ("false", "false"),
            ("-8", "-8"),
            ("8.5", "8.5"),
            ("65", "65"),
        ] {
            assert_eq!(set(&format!("pipelines={value}")), format!("--set: pipelines is {told}, {number}"));
        }
        assert_eq!(set("scanout.enabled=on"), "--set: scanout.enabled is the text \"on\", and must be true or false");
    }
}
