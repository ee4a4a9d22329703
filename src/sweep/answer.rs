//! The answer of a sweep in sentences: which machine is fastest, what each axis does, and on what that depends.
//!
//! An axis is described by the geometric means of the cycles of its values ([`outcome`](super::outcome) says which). If its effect is larger, or different, on some traces, the answer
//! says so. The same holds for some values of another axis: of such axes, the answer names the one on which the effect depends most. Traces
//! that are one scene in several variants are an axis themselves.

use super::outcome::{Effect, MachineResult, Response, SweepResult, TOLERANCE, Within, plain, ratio};
use crate::knob::Setting;
use crate::report::summary::grouped;

/// The tolerance of the front in words.
pub fn tolerance() -> String {
    format!("{:.0} %", 100.0 * (TOLERANCE - 1.0))
}

/// Values within this of the best are as good as it.
const ENOUGH: f64 = 1.05;

/// An axis whose worst value is within this of its best does nothing.
const NOTHING: f64 = 1.005;

/// Ratios that differ by less count as equal.
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
    /// What its values do on each trace, and at each value of another axis, in sentences: numbers in their order, names where it does most first.
    /// Empty: it is much the same everywhere.
    pub by: Vec<String>,
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

/// What an axis does, as the end of a sentence.
fn short(responses: &[Response]) -> Option<String> {
    let (best, worst, ratio) = (least(responses)?, most(responses)?, ratio(responses));
    if ratio < NOTHING {
        return Some("its values make no difference".into());
    }
    let from = enough(responses).map_or(String::new(), |value| format!(" (from {value} on within 5 % of the best)"));
    Some(format!("{} is {ratio:.2} times as fast as {}{from}", plain(&best.value), plain(&worst.value)))
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
struct AxisEffect {
    value: Setting,
    text: String,
    ratio: f64,
    gain: f64,
    best: Option<Setting>,
    enough: Option<u64>,
}

/// What an axis does in each of some parts, where it does most first; and how unlike that is: the largest ratio by the smallest, by a tenth more
/// where the best value, or what is enough, is another.
fn split(parts: impl Iterator<Item = (Setting, Vec<Response>)>) -> Option<(f64, Vec<AxisEffect>)> {
    let told = |(value, own): (Setting, Vec<Response>)| {
        (own.len() > 1).then_some(())?;
        let (ratio, gain, enough) = (ratio(&own), gain(&own), enough(&own));
        Some(AxisEffect { value, text: short(&own)?, ratio, gain, best: least(&own).map(|best| best.value.clone()), enough })
    };
    let mut own: Vec<AxisEffect> = parts.filter_map(told).collect();
    if own.len() < 2 {
        return None;
    }
    let high = own.iter().map(|part| part.ratio).fold(0.0, f64::max);
    let low = own.iter().map(|part| part.ratio).fold(f64::INFINITY, f64::min);
    let other = own.iter().any(|part| part.ratio >= ENOUGH && (&part.best, part.enough) != (&own[0].best, own[0].enough));
    own.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    Some((high / low * if other { 1.1 } else { 1.0 }, own))
}

/// The sentences of the parts in which the axis does most: values of another axis, or traces where there is no name.
fn listed(name: Option<&str>, mut parts: Vec<AxisEffect>) -> String {
    parts.truncate(LISTED);
    // Numbers stand in their order; names stay where they are.
    parts.sort_by_key(|part| if let Setting::Number(number) = part.value { number } else { 0 });
    let mut sentences = Vec::new();
    for (at, AxisEffect { value, text, .. }) in parts.iter().enumerate() {
        let value = plain(value);
        sentences.push(match name {
            None => format!("On {value}, {text}."),
            Some(name) if at == 0 => format!("With `{name}` at {value}, {text}."),
            Some(_) => format!("At {value}, {text}."),
        });
    }
    sentences.join(" ")
}

/// A measure for readers: four digits behind the point, where it is neither a whole number nor a large one.
pub fn measured(value: f64) -> String {
    let whole = value.fract() == 0.0 || value >= 1000.0;
    if whole && (0.0..9e15).contains(&value) { grouped(value.round() as u64) } else { format!("{value:.4}") }
}

/// A value of an axis, and a measure there.
type AxisPoint = (Setting, f64);

/// The smallest and the largest value of a measure; none where the values of the axis do nothing to it.
fn ends(values: &[AxisPoint]) -> Option<[&AxisPoint; 2]> {
    let low = values.iter().min_by(|a, b| a.1.total_cmp(&b.1))?;
    let high = values.iter().rev().max_by(|a, b| a.1.total_cmp(&b.1))?;
    (high.1 - low.1 > (NOTHING - 1.0) * high.1.abs()).then_some([low, high])
}

/// From which number on a measure is much as at the largest, so that more of it changes nothing.
fn settled(values: &[AxisPoint]) -> String {
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
    from.map_or(String::new(), |(value, _)| format!("from {value} on it is within 5 % of its last value"))
}

/// What the values of an axis do to a measure, in a sentence; none where that is nothing.
fn moved(name: &str, values: &[AxisPoint]) -> Option<String> {
    let [low, high] = ends(values)?.map(|(setting, value)| format!("at {} ({})", plain(setting), measured(*value)));
    let from = match settled(values) {
        none if none.is_empty() => none,
        from => format!("; {from}"),
    };
    Some(format!("`{name}` is smallest {low} and largest {high}{from}."))
}

/// The same as the end of a sentence: from the smallest number to the largest, from off to on, of names from the most to the least.
fn moved_short(values: &[AxisPoint]) -> String {
    let Some([low, high]) = ends(values) else {
        return values.first().map_or(String::new(), |(_, value)| format!("it is {} at all values", measured(*value)));
    };
    let mut along: Vec<&AxisPoint> = values.iter().collect();
    along.sort_by_key(|(setting, _)| match setting {
        Setting::Number(number) => *number,
        Setting::Switch(on) => u64::from(*on),
        Setting::Name(_) => 0,
    });
    let (from, to) = match (along[0], along[along.len() - 1]) {
        ((Setting::Name(_), _), _) => (high, low),
        ends => ends,
    };
    let change = match 100.0 * (to.1 / from.1 - 1.0) {
        change if !change.is_finite() => String::new(),
        change => format!(" ({change:+.1} %)"),
    };
    let at = |(setting, value): &(Setting, f64)| format!("{} at {}", measured(*value), plain(setting));
    let settled = match settled(values) {
        none if none.is_empty() => none,
        from => format!("; {from}"),
    };
    format!("it goes from {} to {}{change}{settled}", at(from), at(to))
}

/// A measure at the values of an axis, on all traces together or on one.
fn places(sweep: &SweepResult<'_>, effect: &Effect, at: usize, trace: Option<usize>) -> Vec<AxisPoint> {
    let place = |own: &Response| Some((own.value.clone(), sweep.axis_measure(effect.axis, &own.value, at, trace)?));
    effect.responses.iter().filter_map(place).collect()
}

/// Whether an axis does something to a measure on a trace.
pub fn moves(sweep: &SweepResult<'_>, effect: &Effect, at: usize) -> bool {
    (0..sweep.inputs.experiment.traces.len()).any(|trace| ends(&places(sweep, effect, at, Some(trace))).is_some())
}

/// What the values of an axis do to a measure: in a sentence, and in another by trace.
fn measure(sweep: &SweepResult<'_>, effect: &Effect, at: usize) -> Option<String> {
    let name = &sweep.measures[at];
    let whole = moved(name, &places(sweep, effect, at, None));
    let traces = sweep.trace_names();
    if traces.len() < 2 || !moves(sweep, effect, at) {
        return whole;
    }
    let part =
        |(trace, called): (usize, &String)| format!("On {called}, {}.", moved_short(&places(sweep, effect, at, Some(trace))));
    let parts: Vec<String> = traces.iter().take(LISTED).enumerate().map(part).collect();
    let parts = parts.join(" ");
    Some(whole.map_or_else(|| format!("`{name}` is the same on the whole. {parts}"), |whole| format!("{whole} {parts}")))
}

/// What each axis does, the one that does most first.
pub fn findings(sweep: &SweepResult<'_>) -> Vec<Finding> {
    let mut findings: Vec<(f64, Finding)> = Vec::new();
    let named = !sweep.inputs.experiment.trace_axis.is_empty();
    for effect in sweep.effects() {
        let Some(mut text) = long(&effect.path, &effect.responses) else { continue };
        let mut by = Vec::new();
        let traces = sweep.trace_names().into_iter().map(Setting::Name).enumerate();
        if let Some((weight, own)) = split(traces.map(|(at, name)| (name, sweep.responses(effect.axis, Within::Trace(at))))) {
            if weight >= ALIKE {
                by.push(listed(None, own));
            } else if named {
                text.push_str(&format!(" It hardly depends on the {}.", sweep.trace_axis()));
            }
        }
        by.extend(most_by_axis(sweep, Some(effect.axis), &|within| sweep.responses(effect.axis, within)));
        let measures = (0..sweep.measures.len()).filter_map(|at| measure(sweep, &effect, at)).collect();
        findings.push((effect.ratio, Finding { path: effect.path, text, by, measures }));
    }
    let traces = if named { sweep.trace_responses(Within::All) } else { Vec::new() };
    if let Some(text) = long(sweep.trace_axis(), &traces) {
        let by = most_by_axis(sweep, None, &|within| sweep.trace_responses(within)).into_iter().collect();
        findings.push((ratio(&traces), Finding { path: sweep.trace_axis().to_owned(), text, by, measures: Vec::new() }));
    }
    // A sort that is stable: of equal ones the axis comes first.
    findings.sort_by(|a, b| b.0.total_cmp(&a.0));
    findings.into_iter().map(|(_, finding)| finding).collect()
}

/// The axis on whose values it depends most what an axis, or the traces, do; none where they do much the same everywhere.
fn most_by_axis(
    sweep: &SweepResult<'_>,
    own: Option<usize>,
    responses: &dyn Fn(Within<'_>) -> Vec<Response>,
) -> Option<String> {
    // Traces were run on the same machines. Values of an axis may have been run with other values of further axes.
    if own.is_some() && sweep.is_fitted() {
        return None;
    }
    let mut best: Option<(f64, &str, Vec<AxisEffect>)> = None;
    for (at, axis) in sweep.axes.iter().enumerate().filter(|(at, _)| Some(*at) != own) {
        let parts = axis.values.iter().map(|value| (value.clone(), responses(Within::Axis(at, value))));
        if let Some((weight, parts)) = split(parts)
            && weight >= ALIKE
            && best.as_ref().is_none_or(|(known, ..)| weight > *known)
        {
            best = Some((weight, &axis.path, parts));
        }
    }
    best.map(|(_, name, parts)| listed(Some(name), parts))
}

/// Which machine is fastest, in a sentence.
pub fn fastest(sweep: &SweepResult<'_>) -> String {
    let (Some((best, cycles)), Some((_, most))) = (sweep.timed().next(), sweep.timed().last()) else {
        return "No machine has a result.".into();
    };
    let settings = if best.settings.is_empty() { String::new() } else { format!(" (`{}`)", sweep.described(best)) };
    let traces = match sweep.inputs.experiment.traces.len() {
        1 => String::new(),
        count => format!(", the geometric mean over {count} traces"),
    };
    format!(
        "Of {} machines number {}{settings} is the fastest, with {} cycles{traces}; {}.{}{}{}{}",
        sweep.timed().count(),
        best.number,
        grouped(cycles.round() as u64),
        match most / cycles.max(1.0) {
            ratio if ratio < NOTHING => "all others are within 0.5 % of it".into(),
            ratio => format!("the slowest takes {ratio:.2} times as many"),
        },
        speed_up(sweep, cycles),
        cheapest(sweep),
        match sweep.excluded {
            0 => String::new(),
            1 => " One combination does not meet the conditions and is no machine.".into(),
            n => format!(" {} combinations do not meet the conditions and are no machines.", grouped(n)),
        },
        missing(sweep)
    )
}

/// The cheapest machine within 1 % of the fastest, and what it costs. Empty if the experiment names no cost, or if the fastest is the cheapest one.
fn cheapest(sweep: &SweepResult<'_>) -> String {
    if sweep.inputs.experiment.cost.trim().is_empty() {
        return String::new();
    }
    let (Some((best, least)), Some((_, costs))) = (sweep.timed().next(), sweep.costs()) else { return String::new() };
    let name = sweep.cost_name();
    let close = sweep.timed().zip(&costs).take_while(|((_, cycles), _)| *cycles <= TOLERANCE * least);
    let Some(((machine, cycles), cost)) = close.min_by(|a, b| a.1.total_cmp(b.1)) else { return String::new() };
    if machine.number == best.number || *cost >= costs[0] {
        return format!(" It is also the cheapest one within 1 % of that: {name} is {}.", measured(costs[0]));
    }
    format!(
        " The cheapest one within 1 % of it is number {} (`{}`), with {} cycles: {name} is {} instead of {}.",
        machine.number,
        sweep.described(machine),
        grouped(cycles.round() as u64),
        measured(*cost),
        measured(costs[0])
    )
}

/// The speed-up of the fastest machine over the base. Empty if the base has no result, or is as fast.
fn speed_up(sweep: &SweepResult<'_>, cycles: f64) -> String {
    let base = sweep.timed().find(|(machine, _)| sweep.is_base(machine)).filter(|(_, own)| own / cycles.max(1.0) >= NOTHING);
    base.map_or(String::new(), |(base, own)| {
        format!(" It is {:.2} times as fast as the base, machine {}.", own / cycles.max(1.0), base.number)
    })
}

/// Which machines have no result, and which values of axes none has; empty if all have one.
fn missing(sweep: &SweepResult<'_>) -> String {
    let count = sweep.failed().count();
    let Some((_, error)) = sweep.failed().next() else { return String::new() };
    let mut text = format!(
        " {count} of {} machines that were to be run have no result, the first because: {error}.",
        sweep.machines.len()
    );
    for (at, axis) in sweep.axes.iter().enumerate() {
        let lacks = |value: &&Setting| {
            let has = |machine: &MachineResult| machine.settings[at] == **value;
            sweep.failed().any(|(machine, _)| has(machine)) && !sweep.timed().any(|(machine, _)| has(machine))
        };
        let values: Vec<String> = axis.values.iter().filter(lacks).map(plain).collect();
        if !values.is_empty() {
            text.push_str(&format!(" No machine with `{}` at {} has one.", axis.path, values.join(", ")));
        }
    }
    text
}

/// The machines from which the findings are derived, in words. Empty if all machines of the plan were simulated.
pub fn scope(sweep: &SweepResult<'_>) -> String {
    if !sweep.ended {
        return format!(
            "The sweep has not ended: {} of {} machines have a result so far, and all of this may change.",
            sweep.timed().count(),
            sweep.planned
        );
    }
    let fitted = if sweep.is_fitted() {
        "Not all combinations of values were run. Effects are those of an additive model (least-squares means), which parts each axis from the others. "
    } else {
        ""
    };
    if !sweep.estimated.is_empty() {
        let simulated = sweep.timed().count();
        return format!("{fitted}By the estimates of {} machines, of which {simulated} were simulated:", sweep.estimated.len());
    }
    match sweep.inputs.experiment.screen {
        Some(_) => {
            format!("{fitted}Among the {} machines that were simulated, the fastest by estimate:", sweep.timed().count())
        }
        None => fitted.trim_end().to_owned(),
    }
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
        assert_eq!(short(&own).as_deref(), Some("8 is 2.00 times as fast as 1 (from 4 on within 5 % of the best)"));
        // The last value alone is enough: that it is the best says so.
        assert_eq!(enough(&responses(&[(1, 300.0), (2, 200.0), (4, 100.0)])), None);
        // A larger value may be worse again.
        assert_eq!(enough(&responses(&[(1, 300.0), (2, 100.0), (4, 100.0), (8, 150.0)])), None);
        let rates = [(16, 0.5), (32, 0.21), (64, 0.2), (128, 0.2)].map(|(value, rate)| (Setting::Number(value), rate));
        let text = moved("misses/lookups", &rates).expect("a sentence");
        assert_eq!(
            text,
            "`misses/lookups` is smallest at 64 (0.2000) and largest at 16 (0.5000); from 32 on it is within 5 % of its last value."
        );
        assert_eq!(moved("x", &rates[2..]), None);
        assert_eq!(
            moved_short(&rates),
            "it goes from 0.5000 at 16 to 0.2000 at 128 (-60.0 %); from 32 on it is within 5 % of its last value"
        );
        assert_eq!(moved_short(&rates[2..]), "it is 0.2000 at all values");
        let switch = [true, false].map(|on| (Setting::Switch(on), f64::from(u8::from(on))));
        assert_eq!(moved_short(&switch), "it goes from 0 at false to 1 at true");
        let names = [("a", 1.0), ("b", 4.0), ("c", 2.0)].map(|(name, value)| (Setting::Name(name.into()), value));
        assert_eq!(moved_short(&names), "it goes from 4 at b to 1 at a (-75.0 %)");
        let same = long("x", &responses(&[(1, 100.0), (2, 100.2)])).expect("a sentence");
        assert!(same.contains("makes no difference"), "{same}");
    }
}
