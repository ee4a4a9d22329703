//! From text to configuration.

use std::collections::BTreeMap;

use ron::Value;
use ron::error::Position;
use ron::value::Number;

use super::places::{self, Place};
use super::{BUILT_IN, Config, ConfigError};
use knob::{Allowed, Setting};
use num::edits;

/// A knob as written: its path and value.
type Written = (String, Setting);

/// Reads a configuration, base first; `depth` counts how often one extends another.
pub fn parse(file: &str, text: &str, depth: u32) -> Result<Config, ConfigError> {
    let syntax = |message: String| ConfigError::Syntax { file: file.to_owned(), message };
    let value: Value = ron::from_str(text).map_err(|error| {
        let Position { line, col } = error.span.start;
        ConfigError::Syntax { file: format!("{file}:{line}:{col}"), message: error.code.to_string() }
    })?;
    let Value::Map(map) = value else { return Err(syntax("a configuration is (key: value, …)".to_owned())) };
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
        None => {
            complete(file, &written)?;
            Config::default()
        }
    };
    config.name = file.to_owned();
    for (path, setting) in &written {
        let place = places.get(path.as_str());
        apply(&mut config, &place.map_or(file.to_owned(), |place| at(file, place)), path, setting)?;
    }
    Ok(config)
}

/// A place as messages name it.
fn at(file: &str, Place { at: [line, column], .. }: &Place) -> String {
    format!("{file}:{line}:{column}")
}

/// `path.to.key=value`.
pub fn assign(config: &mut Config, assignment: &str) -> Result<(), ConfigError> {
    const FILE: &str = "--set";
    let syntax = |message: String| ConfigError::Syntax { file: FILE.to_owned(), message };
    let Some((path, value)) = assignment.split_once('=') else {
        return Err(syntax(format!("{assignment} is not path.to.key=value")));
    };
    let (path, value) = (path.trim(), value.trim());
    // Names may be written without quotes here, where a shell would eat them.
    let setting = match value {
        "true" => Setting::Switch(true),
        "false" => Setting::Switch(false),
        _ => match value.replace('_', "").parse::<u64>() {
            Ok(number) => Setting::Number(number),
            Err(_) => Setting::Name(value.trim_matches('"').to_owned()),
        },
    };
    apply(config, FILE, path, &setting)
}

/// Turns nested sections into paths.
fn flatten(file: &str, path: String, value: &Value, written: &mut Vec<Written>) -> Result<(), ConfigError> {
    let setting = match value {
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
        Value::Bool(value) => Setting::Switch(*value),
        Value::String(name) => Setting::Name(name.clone()),
        Value::Number(number) => match whole(number) {
            Some(number) => Setting::Number(number),
            // Not a whole number from 0: kept as text for the message, which no knob takes.
            None => Setting::Name(format!("{}", number.into_f64())),
        },
        other => Setting::Name(format!("{other:?}")),
    };
    written.push((path, setting));
    Ok(())
}

fn whole(number: &Number) -> Option<u64> {
    let value = number.into_f64();
    (value >= 0.0 && value.fract() == 0.0 && value < 9.0e15).then_some(value as u64)
}

/// Whether every knob is written.
fn complete(file: &str, written: &[Written]) -> Result<(), ConfigError> {
    for (section, knobs) in Config::default().sections() {
        for knob in knobs.knobs() {
            let path = join(section, knob.name);
            if !written.iter().any(|(known, _)| *known == path) {
                return Err(ConfigError::Missing { file: file.to_owned(), key: path });
            }
        }
    }
    Ok(())
}

/// The path of a knob.
pub fn join(section: &str, name: &str) -> String {
    if section.is_empty() { name.to_owned() } else { format!("{section}.{name}") }
}

/// Sets one knob.
fn apply(config: &mut Config, file: &str, path: &str, setting: &Setting) -> Result<(), ConfigError> {
    let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
    let found = config.sections_mut().into_iter().find(|(known, _)| *known == section);
    let knob = found.as_ref().and_then(|(_, knobs)| knobs.knobs().iter().find(|knob| knob.name == name));
    let (Some((_, knobs)), Some(knob)) = (found, knob) else {
        return Err(ConfigError::UnknownKey { file: file.to_owned(), key: path.to_owned(), hint: hint(path) });
    };
    if knobs.set(name, setting) {
        return Ok(());
    }
    let value = match setting {
        // What was no whole number was kept as its text.
        Setting::Name(text) if !matches!(knob.allowed, Allowed::Choice(_)) => text.clone(),
        other => other.to_string(),
    };
    let allowed = knob.allowed.to_string();
    Err(ConfigError::Value { file: file.to_owned(), key: path.to_owned(), value, allowed })
}

/// The key that is nearest to one that there is not.
fn hint(path: &str) -> String {
    let config = Config::default();
    let paths = config
        .sections()
        .into_iter()
        .flat_map(|(section, knobs)| knobs.knobs().iter().map(move |knob| join(section, knob.name)));
    let nearest = paths.min_by_key(|known| edits(known, path));
    nearest
        .filter(|known| edits(known, path) <= 2 + path.len() / 3)
        .map_or(String::new(), |known| format!("; {known} is the nearest"))
}
