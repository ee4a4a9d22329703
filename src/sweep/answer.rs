//! The answer of a sweep in sentences: which machine is fastest, what each axis does, and on what that depends.
//!
//! An axis is told by the geometric means of the cycles of its values. Where it does more, or something else, at some values of another axis or
//! on some traces, the one on which it depends most is told with it.

use super::outcome::{Outcome, Response, Within, plain, ratio};
use crate::knob::Setting;
use crate::report::summary::grouped;

/// Values within this of the best are as good as it.
const ENOUGH: f64 = 1.05;

/// An axis whose worst value is within this of its best does nothing.
const NOTHING: f64 = 1.005;

/// Ratios that differ by less are told as one.
const ALIKE: f64 = 1.02;

/// Values of another axis that are listed.
const LISTED: usize = 8;

/// What an axis does.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// Its path.
    pub path: String,
    /// What its values do, all machines together.
    pub text: String,
    /// Of what that depends most, and what its values do there, where they do most first. None: it is much the same everywhere.
    pub by: Option<(String, Vec<(String, String)>)>,
    /// What its values do to each measure that depends on it.
    pub measures: Vec<String>,
}

/// The smallest number from which on all numbers of an axis are as good as the best; none of names, or where it is the largest.
fn enough(responses: &[Response]) -> Option<u64> {
    let mut numbers: Vec<(u64, f64)> = Vec::new();
    for own in responses {
        let Setting::Number(value) = own.value else { return None };
        numbers.push((value, own.cycles));
    }
    numbers.sort_by_key(|own| own.0);
    let best = numbers.iter().map(|own| own.1).fold(f64::INFINITY, f64::min);
    let worse = numbers.iter().rposition(|own| own.1 > ENOUGH * best)?;
    numbers.get(worse + 1).filter(|_| worse + 2 < numbers.len()).map(|own| own.0)
}

fn least(responses: &[Response]) -> Option<&Response> {
    responses.iter().min_by(|a, b| a.cycles.total_cmp(&b.cycles))
}

fn most(responses: &[Response]) -> Option<&Response> {
    // Of equal ones the first, as above.
    responses.iter().rev().max_by(|a, b| a.cycles.total_cmp(&b.cycles))
}

/// What an axis does, in short.
fn short(responses: &[Response]) -> Option<String> {
    let (best, worst, ratio) = (least(responses)?, most(responses)?, ratio(responses));
    if ratio < NOTHING {
        return Some("no difference".into());
    }
    let from = enough(responses).map_or(String::new(), |value| format!(" (from {value} on within 5 % of the best)"));
    Some(format!("{ratio:.2} times as fast at {} as at {}{from}", plain(&best.value), plain(&worst.value)))
}

/// By which parts are ordered: how many times faster the largest number is than the smallest; of names, the best than the worst.
fn gain(responses: &[Response]) -> f64 {
    let mut numbers: Vec<(u64, f64)> = Vec::new();
    for own in responses {
        let Setting::Number(value) = own.value else { return ratio(responses) };
        numbers.push((value, own.cycles));
    }
    numbers.sort_by_key(|own| own.0);
    numbers.first().zip(numbers.last()).map_or(1.0, |(first, last)| first.1 / last.1)
}

/// What an axis does, in a sentence.
fn long(path: &str, responses: &[Response]) -> Option<String> {
    let (best, worst, ratio) = (least(responses)?, most(responses)?, ratio(responses));
    if responses.len() < 2 {
        return None;
    }
    if ratio < NOTHING {
        return Some(format!("`{path}` makes no difference to the cycles: its values are within 0.5 % of each other."));
    }
    let from = enough(responses).map_or(String::new(), |value| format!(" From {value} on, all are within 5 % of the best."));
    Some(format!(
        "`{path}` is best at {} and worst at {}, which takes {ratio:.2} times as many cycles.{from}",
        plain(&best.value),
        plain(&worst.value)
    ))
}

/// An axis at one value of another axis, or on one trace.
struct Part {
    name: String,
    text: String,
    ratio: f64,
    gain: f64,
    best: Option<Setting>,
    enough: Option<u64>,
}

/// What an axis does in each of some parts, where it does most first; and how unlike that is: the largest ratio by the smallest, and whether the
/// best value, or what is enough, is another.
fn split(sweep: &Outcome<'_>, axis: usize, parts: &[(String, Within<'_>)]) -> Option<(f64, bool, Vec<Part>)> {
    let told = |(name, within): &(String, Within<'_>)| {
        let own = sweep.responses(axis, *within);
        (own.len() > 1).then_some(())?;
        let (ratio, gain, enough) = (ratio(&own), gain(&own), enough(&own));
        Some(Part {
            name: name.clone(),
            text: short(&own)?,
            ratio,
            gain,
            best: least(&own).map(|best| best.value.clone()),
            enough,
        })
    };
    let mut own: Vec<Part> = parts.iter().filter_map(told).collect();
    if own.len() < 2 {
        return None;
    }
    let high = own.iter().map(|part| part.ratio).fold(0.0, f64::max);
    let low = own.iter().map(|part| part.ratio).fold(f64::INFINITY, f64::min);
    let other = own.iter().any(|part| part.ratio >= ENOUGH && (&part.best, part.enough) != (&own[0].best, own[0].enough));
    own.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Some((high / low, other, own))
}

/// A measure for readers: four digits behind the point, where it is neither a whole number nor a large one.
pub fn measured(value: f64) -> String {
    let whole = value.fract() == 0.0 || value >= 1000.0;
    if whole && (0.0..9e15).contains(&value) { grouped(value.round() as u64) } else { format!("{value:.4}") }
}

/// What the values of an axis do to a measure, in a sentence; none where that is nothing.
fn moved(name: &str, values: &[(Setting, f64)]) -> Option<String> {
    let low = values.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let high = values.iter().rev().max_by(|a, b| a.1.total_cmp(&b.1))?;
    if high.1 - low.1 <= (NOTHING - 1.0) * high.1.abs() {
        return None;
    }
    // The smallest number from which on it is much as at the largest: more of it changes nothing.
    let mut numbers: Vec<(u64, f64)> = Vec::new();
    for (setting, value) in values {
        if let Setting::Number(number) = setting {
            numbers.push((*number, *value));
        }
    }
    numbers.sort_by_key(|own| own.0);
    let from = numbers.last().filter(|_| numbers.len() == values.len()).and_then(|(_, last)| {
        let far = numbers.iter().rposition(|(_, own)| (own - last).abs() > (ENOUGH - 1.0) * last.abs())?;
        numbers.get(far + 1).filter(|_| far + 2 < numbers.len())
    });
    let from = from.map_or(String::new(), |(value, _)| format!("; from {value} on within 5 % of its last value"));
    let at = |(setting, value): &(Setting, f64)| format!("{} at {}", measured(*value), plain(setting));
    Some(format!("`{name}` is least, {}, and most, {}{from}.", at(low), at(high)))
}

/// What each axis does, the one that does most first.
pub fn findings(sweep: &Outcome<'_>) -> Vec<Finding> {
    let mut findings = Vec::new();
    for effect in sweep.effects() {
        let Some(text) = long(&effect.path, &effect.responses) else { continue };
        let mut best: Option<(f64, String, Vec<Part>)> = None;
        let mut offer = |name: String, parts: Vec<(String, Within<'_>)>| {
            let Some((spread, other, own)) = split(sweep, effect.axis, &parts) else { return };
            // What is best elsewhere counts as much as a spread of a tenth.
            let weight = spread * if other { 1.1 } else { 1.0 };
            if weight >= ALIKE && best.as_ref().is_none_or(|(known, ..)| weight > *known) {
                best = Some((weight, name, own));
            }
        };
        for (at, axis) in sweep.axes.iter().enumerate().filter(|(at, _)| *at != effect.axis) {
            offer(axis.path.clone(), axis.values.iter().map(|value| (plain(value), Within::Axis(at, value))).collect());
        }
        let traces = &sweep.inputs.experiment.traces;
        offer("trace".into(), traces.iter().enumerate().map(|(at, name)| (name.clone(), Within::Trace(at))).collect());
        let by = best.map(|(_, name, own)| (name, own.into_iter().take(LISTED).map(|part| (part.name, part.text)).collect()));
        let values = |measure: usize| -> Vec<(Setting, f64)> {
            let own = |own: &Response| {
                let mean = sweep.mean_measure(measure, |machine| machine.settings[effect.axis] == own.value)?;
                Some((own.value.clone(), mean))
            };
            effect.responses.iter().filter_map(own).collect()
        };
        let measures = sweep.measures.iter().enumerate().filter_map(|(at, name)| moved(name, &values(at))).collect();
        findings.push(Finding { path: effect.path, text, by, measures });
    }
    findings
}

/// Which machine is fastest, in a sentence.
pub fn fastest(sweep: &Outcome<'_>) -> String {
    let (Some((best, cycles)), Some((_, most))) = (sweep.timed().next(), sweep.timed().last()) else {
        return "No machine has a result.".into();
    };
    let settings = if best.settings.is_empty() { String::new() } else { format!(" (`{}`)", sweep.described(best)) };
    format!(
        "Of {} machines number {}{settings} is the fastest, with {} cycles; {}.",
        sweep.timed().count(),
        best.number,
        grouped(cycles),
        match most as f64 / cycles.max(1) as f64 {
            ratio if ratio < NOTHING => "all others are within 0.5 % of it".into(),
            ratio => format!("the slowest takes {ratio:.2} times as many"),
        }
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn responses(values: &[(u64, f64)]) -> Vec<Response> {
        values.iter().map(|&(value, cycles)| Response { value: Setting::Number(value), cycles, machines: 1 }).collect()
    }

    #[test]
    fn an_axis_is_told_by_its_best_value_its_worst_and_what_is_enough() {
        let own = responses(&[(1, 200.0), (2, 120.0), (4, 104.0), (8, 100.0), (16, 101.0)]);
        let text = long("core.warps", &own).expect("a sentence");
        assert_eq!(
            text,
            "`core.warps` is best at 8 and worst at 1, which takes 2.00 times as many cycles. From 4 on, all are within 5 % of the best."
        );
        assert_eq!(short(&own).as_deref(), Some("2.00 times as fast at 8 as at 1 (from 4 on within 5 % of the best)"));
        // The last value alone is enough: that it is the best says so.
        assert_eq!(enough(&responses(&[(1, 300.0), (2, 200.0), (4, 100.0)])), None);
        // A larger value may be worse again.
        assert_eq!(enough(&responses(&[(1, 300.0), (2, 100.0), (4, 100.0), (8, 150.0)])), None);
        let rates = [(16, 0.5), (32, 0.21), (64, 0.2), (128, 0.2)].map(|(value, rate)| (Setting::Number(value), rate));
        let text = moved("misses/lookups", &rates).expect("a sentence");
        assert_eq!(
            text,
            "`misses/lookups` is least, 0.2000 at 64, and most, 0.5000 at 16; from 32 on within 5 % of its last value."
        );
        assert_eq!(moved("x", &rates[2..]), None);
        let same = long("x", &responses(&[(1, 100.0), (2, 100.2)])).expect("a sentence");
        assert!(same.contains("makes no difference"), "{same}");
    }
}
