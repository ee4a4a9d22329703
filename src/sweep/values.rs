//! The values of an axis as written: lists, ranges, doublings.

use std::collections::HashSet;

use crate::knob::{Allowed, Knob, Setting};

/// Values of one axis at most.
const MOST: usize = 100_000;

/// Reads the values that a knob takes one after another: `8,16,32`; `1..8`; `0..100+25`; `16..1024*2`; `all`. Both ends of a range belong to it.
///
/// # Errors
/// What is wrong with the text, or which value the knob does not take.
pub fn values(knob: &Knob, text: &str) -> Result<Vec<Setting>, String> {
    let mut values = Vec::new();
    for part in text.split(',').map(str::trim) {
        if part.is_empty() {
            return Err("has an empty value; write values as 8,16,32 or 16..1024*2, or `all`".into());
        }
        values.extend(one(knob, part)?);
        if values.len() > MOST {
            return Err(format!("has more than {MOST} values"));
        }
    }
    let mut seen = HashSet::new();
    for value in &values {
        if !knob.allowed.admits(value) {
            return Err(format!("has the value {value}, and must be {}", knob.allowed));
        }
        if !seen.insert(value.to_string()) {
            return Err(format!("has the value {value} twice"));
        }
    }
    Ok(values)
}

/// Reads the values of a variable that is no knob: whole numbers, written as those of a knob.
///
/// # Errors
/// What is wrong with the text.
pub fn numbers(text: &str) -> Result<Vec<Setting>, String> {
    let mut values = Vec::new();
    for part in text.split(',').map(str::trim) {
        match number(part) {
            Some(number) => values.push(Setting::Number(number)),
            None if part.contains("..") => values.extend(range(part)?),
            None => {
                return Err(format!("has the value `{part}`, which is no whole number; write values as 8,16,32 or 16..1024*2"));
            }
        }
        if values.len() > MOST {
            return Err(format!("has more than {MOST} values"));
        }
    }
    let mut seen = HashSet::new();
    match values.iter().map(Setting::to_string).find(|value| !seen.insert(value.clone())) {
        Some(value) => Err(format!("has the value {value} twice")),
        None => Ok(values),
    }
}

fn one(knob: &Knob, part: &str) -> Result<Vec<Setting>, String> {
    if part == "all" {
        return match knob.allowed {
            Allowed::Switch => Ok(vec![Setting::Switch(false), Setting::Switch(true)]),
            Allowed::Choice(names) => Ok(names.iter().map(|name| Setting::Name((*name).to_owned())).collect()),
            Allowed::Range(low, high) => range(&format!("{low}..{high}")),
            Allowed::PowerOfTwo(low, high) => range(&format!("{low}..{high}*2")),
        };
    }
    if part.contains("..") {
        return range(part);
    }
    Ok(vec![match part {
        "true" => Setting::Switch(true),
        "false" => Setting::Switch(false),
        _ => match number(part) {
            Some(number) => Setting::Number(number),
            None => Setting::Name(part.trim_matches('"').to_owned()),
        },
    }])
}

fn number(text: &str) -> Option<u64> {
    text.trim().replace('_', "").parse().ok()
}

/// `A..B`, `A..B+STEP` or `A..B*FACTOR`.
fn range(text: &str) -> Result<Vec<Setting>, String> {
    let wrong = || format!("has `{text}`, which is no range: write it as A..B, A..B+STEP or A..B*FACTOR, with whole numbers");
    let (low, rest) = text.split_once("..").ok_or_else(wrong)?;
    let (high, grow) = match (rest.split_once('+'), rest.split_once('*')) {
        (Some((high, step)), None) => (high, Grow::By(number(step).ok_or_else(wrong)?)),
        (None, Some((high, factor))) => (high, Grow::Times(number(factor).ok_or_else(wrong)?)),
        (None, None) => (rest, Grow::By(1)),
        _ => return Err(wrong()),
    };
    let (low, high) = number(low).zip(number(high)).ok_or_else(wrong)?;
    match grow {
        Grow::By(0) | Grow::Times(0 | 1) => return Err(format!("has `{text}`, which never ends")),
        Grow::Times(_) if low == 0 => return Err(format!("has `{text}`, which never leaves 0")),
        _ if low > high => return Err(format!("has `{text}`, which is empty: {low} is above {high}")),
        _ => {}
    }
    let mut values = Vec::new();
    let mut next = Some(low);
    while let Some(value) = next.filter(|&value| value <= high) {
        values.push(Setting::Number(value));
        if values.len() > MOST {
            return Err(format!("has `{text}`, which is more than {MOST} values"));
        }
        next = match grow {
            Grow::By(step) => value.checked_add(step),
            Grow::Times(factor) => value.checked_mul(factor),
        };
    }
    Ok(values)
}

/// From one value of a range to the next.
enum Grow {
    By(u64),
    Times(u64),
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::machine::Config;

    fn of(path: &str, text: &str) -> Result<Vec<String>, String> {
        let config = Config::built_in("baseline").expect("it is built in");
        let (knob, _) = config.knob("test", path).expect("a knob");
        Ok(values(knob, text)?.iter().map(Setting::to_string).collect())
    }

    #[test]
    fn lists_ranges_doublings_and_all() {
        assert_eq!(of("pipelines", "1..4").unwrap(), ["1", "2", "3", "4"]);
        assert_eq!(of("pipelines", "1..16*2").unwrap(), ["1", "2", "4", "8", "16"]);
        assert_eq!(of("pipelines", "4..15+5, 64").unwrap(), ["4", "9", "14", "64"]);
        assert_eq!(of("depth.early", "all").unwrap(), ["false", "true"]);
        assert_eq!(of("sort", "sort-first,\"sort-middle\"").unwrap(), ["\"sort-first\"", "\"sort-middle\""]);
        assert_eq!(of("sort", "all").unwrap().len(), 5);
        assert_eq!(of("color.cache_ways", "all").unwrap().len(), 16);
    }

    #[test]
    fn what_is_no_value_is_said_so() {
        for (path, text, told) in [
            ("pipelines", "", "empty value"),
            ("pipelines", "1,,2", "empty value"),
            ("pipelines", "0..4", "value 0, and must be a whole number from 1 to 64"),
            ("pipelines", "8..4", "is empty: 8 is above 4"),
            ("pipelines", "1..8*1", "never ends"),
            ("pipelines", "1..8+0", "never ends"),
            ("pipelines", "0..8*2", "never leaves 0"),
            ("pipelines", "1..x", "no range"),
            ("pipelines", "1..8*2+1", "no range"),
            ("pipelines", "2,1..4", "value 2 twice"),
            ("pipelines", "many", "value \"many\""),
            ("color.cache_ways", "3", "a power of two"),
            ("memory.dram.t_refi", "all", "more than 100000"),
            ("sort", "sort-any", "one of \"sort-first\""),
        ] {
            let error = of(path, text).unwrap_err();
            assert!(error.contains(told), "{path}={text}: {error}");
        }
    }

    proptest::proptest! {
        #[test]
        fn any_text_is_read_or_refused_and_a_range_has_its_ends(
            text in "[0-9a-z.,*+]{0,24}",
            other in ".{0,40}",
            [low, more, step] in [1_u64..30, 0_u64..30, 1_u64..9],
        ) {
            for text in [text, other] {
                let _ = (of("pipelines", &text), of("sort", &text), of("depth.early", &text));
            }
            let high = low + more * step;
            if high <= 64 {
                let values = of("pipelines", &format!("{low}..{high}+{step}")).expect("a range");
                let ends = [values.first(), values.last()].map(|value| value.cloned());
                proptest::prop_assert_eq!(ends, [Some(low.to_string()), Some(high.to_string())]);
                proptest::prop_assert_eq!(values.len() as u64, more + 1);
            }
        }
    }
}
