//! The frame over time: what units did and how full channels were, from a machine that was read while it drew the frame.

use maud::{Markup, html};
use serde_json::{Value, json};

use super::replay::Input;
use super::{key, percent, readable};
use crate::machine::Config;
use crate::run::timeline::{Sample, Span, Timeline};
use crate::stats::Cycles;

/// Columns of a drawing at most.
pub const COLUMNS: usize = 160;

/// Height of a row, in units of the drawing. Its width is that of the frame, 1000.
const HEIGHT: f64 = 24.0;

/// A value of each sample as steps over time, on top of others.
struct Steps {
    path: String,
}

impl Steps {
    /// `top` and `bottom` of a sample are shares of the height.
    fn new(samples: &[Sample], end: f64, range: impl Fn(&Sample) -> [f64; 2]) -> Steps {
        let x = |cycle: u64| 1000.0 * cycle as f64 / end;
        let y = |share: f64| HEIGHT * (1.0 - share);
        let Some(first) = samples.first() else { return Steps { path: String::new() } };
        let mut path = format!("M{:.0} {:.1}", x(first.begin), y(range(first)[0]));
        for sample in samples {
            path.push_str(&format!("V{:.1}H{:.0}", y(range(sample)[1]), x(sample.end)));
        }
        for sample in samples.iter().rev() {
            path.push_str(&format!("V{:.1}H{:.0}", y(range(sample)[0]), x(sample.begin)));
        }
        path.push('Z');
        Steps { path }
    }
}

/// A row of a table over time. The script finds its numbers by `kind` and `at`.
fn row(name: &str, about: &str, drawn: &[(&str, Steps)], last: &str, (kind, at): (&str, usize)) -> Markup {
    html! {
        tr data-kind=(kind) data-at=(at) {
            td.name { (name) }
            td.over { svg viewBox=(format!("0 0 1000 {HEIGHT}")) preserveAspectRatio="none" role="img" aria-label=(about) {
                @for (color, steps) in drawn { path d=(steps.path) style=(format!("fill:var(--{color})")) {} }
            } }
            td.n { (last) }
        }
    }
}

/// Marks of an axis from 0 to `end`, at most nine: 1, 2 or 5 times a power of ten apart.
fn marks(end: f64) -> Vec<f64> {
    const MOST: f64 = 8.0;
    if end <= 0.0 {
        return vec![0.0];
    }
    let power = 10.0_f64.powi((end / MOST).log10().floor() as i32);
    let step = [1.0, 2.0, 5.0, 10.0].map(|of| of * power).into_iter().find(|step| end / step <= MOST).unwrap_or(end);
    (0..=(end / step) as usize).map(|at| at as f64 * step).collect()
}

/// An axis with marks at shares of the width: cycles, or microseconds.
fn axis(name: &str, end: f64) -> Markup {
    let list = marks(end);
    // As many digits as tell marks apart.
    let step = list.get(1).copied().unwrap_or(1.0);
    let digits = if step < 1.0 { (-step.log10()).ceil() as usize } else { 0 };
    let text = |mark: f64| if digits == 0 { readable(mark.round()) } else { format!("{mark:.digits$}") };
    html! {
        tr.axis {
            td.name { (name) }
            td.over { div { @for mark in &list { span style=(format!("left:{:.2}%", 100.0 * mark / end)) { (text(*mark)) } } } }
            td.n {}
        }
    }
}

/// Shares of the cycles of a bank's units in a sample: busy, blocked, waiting for memory, and for instructions.
fn shares(cycles: &Cycles) -> [f64; 4] {
    let all = cycles.total().max(1) as f64;
    [cycles.busy, cycles.blocked, cycles.memory, cycles.latency].map(|own| own as f64 / all)
}

/// The section.
pub fn section(input: &Input<'_>) -> Option<Markup> {
    let timeline = input.timeline?;
    let samples = &timeline.samples;
    let end = samples.last()?.end as f64;
    let units = timeline.units.iter().enumerate().filter_map(|(at, bank)| {
        let sum = samples.iter().fold(Cycles::default(), |mut sum, sample| {
            sum += sample.units[at];
            sum
        });
        if sum.busy == 0 {
            return None;
        }
        let stacked = |state: usize| {
            Steps::new(samples, end, |sample| {
                let shares = shares(&sample.units[at]);
                let below: f64 = shares[..state].iter().sum();
                [below, below + shares[state]]
            })
        };
        let busy = percent(shares(&sum)[0]);
        let name = if bank.count > 1 { format!("{} \u{d7}{}", bank.name, bank.count) } else { bank.name.to_owned() };
        let about = format!("{name} over time: busy in {busy} of its cycles");
        Some(row(
            &name,
            &about,
            &[("busy", stacked(0)), ("blocked", stacked(1)), ("memory", stacked(2)), ("latency", stacked(3))],
            &busy,
            ("unit", at),
        ))
    });
    let warps = timeline
        .units
        .iter()
        .enumerate()
        .filter(|(at, bank)| bank.name == "core" && samples.iter().any(|sample| sample.held[*at] > 0));
    let warps = warps.map(|(at, bank)| {
        let mean = |sample: &Sample| sample.held[at] as f64 / ((sample.end - sample.begin) * bank.count as u64) as f64;
        let slots = f64::from(timeline.warps);
        let steps = Steps::new(samples, end, |sample| [0.0, (mean(sample) / slots).min(1.0)]);
        let held: u64 = samples.iter().map(|sample| sample.held[at]).sum();
        let last = format!("{:.1} of {slots}", held as f64 / (end * bank.count as f64));
        row(
            &format!("warps in {}", bank.name),
            &format!("warps that {} holds over time, {last}", bank.name),
            &[("draw", steps)],
            &last,
            ("warps", at),
        )
    });
    let channels = timeline.channels.iter().enumerate().filter_map(|(at, bank)| {
        let mean = |sample: &Sample| sample.occupancy[at] as f64 / (sample.end - sample.begin) as f64;
        let most = samples.iter().map(mean).fold(0.0, f64::max);
        let steps = Steps::new(samples, end, |sample| [0.0, if most > 0.0 { mean(sample) / most } else { 0.0 }]);
        let name = if bank.count > 1 { format!("{} \u{d7}{}", bank.name, bank.count) } else { bank.name.to_owned() };
        let last = format!("{most:.1}");
        let about = format!("items in {name} over time, at most {last}");
        (most > 0.0).then(|| row(&name, &about, &[("draw", steps)], &last, ("channel", at)))
    });
    let binned = timeline.phases.iter().any(Span::is_shared);
    let time = input.config.map(|config| (config.card.clock_mhz, 1e6 * config.seconds(end)));
    let axes = html! { (axis("cycles", end)) @if let Some((_, time)) = time { (axis("\u{3bc}s", time)) } };
    Some(html! {
        p {
            "From left to right " (readable(end)) " cycles" @if let Some((clock, time)) = time { ", " (format!("{time:.2}")) " \u{3bc}s at " (clock) " MHz" }
            ", read " (samples.len()) " times. This machine draws frame " (input.statistics.number()) " alone, with empty caches."
        }
        (key(&[("s-busy", "busy"), ("s-blocked", "no room behind it"), ("s-memory", "waits for memory"), ("s-latency", "waits for instructions")]))
        p.note.when role="status" { "Point at a time, or move with the arrow keys." @if !binned { " A click selects the draw that retires then." } }
        div.scroll { table.timeline tabindex="0" aria-label="What units did over time" {
            thead { tr { th scope="col" { "unit" } th.over scope="col" {} th.n scope="col" { "busy" } } }
            tbody {
                (axes)
                @if !timeline.phases.is_empty() {
                    tr data-kind="phase" { td.name { "phases" } td.over { svg viewBox=(format!("0 0 1000 {HEIGHT}")) preserveAspectRatio="none" role="img" aria-label="phases" {
                        @for phase in &timeline.phases {
                            @let [from, to] = [phase.begin, phase.end].map(|cycle| 1000.0 * cycle as f64 / end);
                            rect x=(format!("{from:.1}")) y="2" width=(format!("{:.1}", to - from)) height=(HEIGHT - 4.0) style=(format!("fill:var(--{})", if phase.draws { "draw" } else { "other" })) { title { (phase.name) } }
                        }
                    } } td.n {} }
                    @if binned {
                        tr { td.name { "draws" } td.over { span.note { "Draws of a pass retire together." } } td.n {} }
                    } @else if timeline.phases.iter().any(|phase| !phase.parts.is_empty()) {
                        tr data-kind="draw" { td.name { "draws" } td.over { canvas.track width="2000" height="1" role="img" aria-label="Draws, from one retirement to the next, in the colours of the map of last draws" {} } td.n {} }
                    }
                }
                @for unit in units { (unit) }
                @for bank in warps { (bank) }
                (axes)
            }
        } }
        details {
            summary { "Channels: items in them" }
            div.scroll { table.timeline tabindex="0" aria-label="Items in channels over time" {
                thead { tr { th scope="col" { "channel" } th.over scope="col" {} th.n scope="col" { "most" } } }
                tbody { (axes) @for channel in channels { (channel) } }
            } }
        }
    })
}

/// The numbers that are drawn. `clock_mhz` is that of the card, where it is known.
pub fn json(timeline: &Timeline, config: Option<&Config>) -> Value {
    let samples = &timeline.samples;
    let ends: Vec<u64> = samples.iter().map(|sample| sample.end).collect();
    let unit = |at: usize| {
        let of = |state: fn(&Cycles) -> u64| samples.iter().map(|sample| state(&sample.units[at])).collect::<Vec<u64>>();
        let bank = timeline.units[at];
        json!({ "unit": bank.name, "count": bank.count, "busy": of(|c| c.busy), "blocked": of(|c| c.blocked), "memory": of(|c| c.memory), "latency": of(|c| c.latency), "held": samples.iter().map(|sample| sample.held[at]).collect::<Vec<u64>>() })
    };
    let channel = |at: usize| {
        let items: Vec<u64> = samples.iter().map(|sample| sample.occupancy[at]).collect();
        json!({ "channel": timeline.channels[at].name, "items": items })
    };
    let phase = |span: &Span| json!([span.name, span.begin, span.end]);
    let draws = timeline.phases.iter().flat_map(|phase| &phase.parts);
    let draws: Vec<Value> = draws.filter_map(|draw| Some(json!([draw.number?, draw.begin, draw.end, draw.name]))).collect();
    json!({
        "ends": ends,
        "clock_mhz": config.map(|config| config.card.clock_mhz),
        "units": (0..timeline.units.len()).map(unit).collect::<Vec<_>>(),
        "channels": (0..timeline.channels.len()).map(channel).collect::<Vec<_>>(),
        "phases": timeline.phases.iter().map(phase).collect::<Vec<_>>(),
        "draws": draws,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_few_and_round() {
        assert_eq!(marks(24_888.0), [0.0, 5000.0, 10_000.0, 15_000.0, 20_000.0]);
        assert_eq!(marks(10.0), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0]);
        assert_eq!(marks(0.0), [0.0]);
        for end in [1.0, 3.7, 99.0, 123_456.0, 0.02] {
            assert!((4..=9).contains(&marks(end).len()), "{end}: {:?}", marks(end));
        }
    }
}
