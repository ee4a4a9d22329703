//! The frame over time: what units did and how full channels were, from a machine that was read while it drew the frame.

use maud::{Markup, html};
use serde_json::{Value, json};

use super::data::CountedSpan;
use super::replay::Input;
use super::{key, percent, readable};
use crate::run::timeline::{Sample, Timeline};
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

fn row(name: &str, about: &str, drawn: &[(&str, Steps)], last: &str) -> Markup {
    html! {
        tr {
            td.name { (name) }
            td.over { svg viewBox=(format!("0 0 1000 {HEIGHT}")) preserveAspectRatio="none" role="img" aria-label=(about) {
                @for (color, steps) in drawn { path d=(steps.path) style=(format!("fill:var(--{color})")) {} }
            } }
            td.n { (last) }
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
    let phases = &input.statistics.frame().parts;
    let total: f64 = phases.iter().map(CountedSpan::cycles).sum();
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
        )
    });
    let channels = timeline.channels.iter().enumerate().filter_map(|(at, bank)| {
        let mean = |sample: &Sample| sample.occupancy[at] as f64 / (sample.end - sample.begin) as f64;
        let most = samples.iter().map(mean).fold(0.0, f64::max);
        let steps = Steps::new(samples, end, |sample| [0.0, if most > 0.0 { mean(sample) / most } else { 0.0 }]);
        let name = if bank.count > 1 { format!("{} \u{d7}{}", bank.name, bank.count) } else { bank.name.to_owned() };
        let last = format!("{most:.1}");
        (most > 0.0).then(|| row(&name, &format!("items in {name} over time, at most {last}"), &[("draw", steps)], &last))
    });
    let at = |n: usize| phases[..n].iter().map(CountedSpan::cycles).sum::<f64>() / total.max(1.0);
    Some(html! {
        p { "From left to right " (readable(end)) " cycles, read " (samples.len()) " times. This machine draws frame " (input.statistics.number()) " alone, with empty caches." }
        (key(&[("s-busy", "busy"), ("s-blocked", "no room behind it"), ("s-memory", "waits for memory"), ("s-latency", "waits for instructions")]))
        div.scroll { table.timeline {
            thead { tr { th scope="col" { "unit" } th.over scope="col" {} th.n scope="col" { "busy" } } }
            tbody {
                @if total > 0.0 { tr { td.name { "phases" } td.over { svg viewBox=(format!("0 0 1000 {HEIGHT}")) preserveAspectRatio="none" role="img" aria-label="phases" {
                    @for (n, phase) in phases.iter().enumerate() {
                        rect x=(format!("{:.1}", 1000.0 * at(n))) y="2" width=(format!("{:.1}", 1000.0 * (at(n + 1) - at(n)))) height=(HEIGHT - 4.0) style=(format!("fill:var(--{})", if phase.draws() { "draw" } else { "other" })) {
                            title { (phase.name()) }
                        }
                    }
                } } td.n {} } }
                @for unit in units { (unit) }
                @for bank in warps { (bank) }
            }
        } }
        details {
            summary { "Channels: items in them" }
            div.scroll { table.timeline {
                thead { tr { th scope="col" { "channel" } th.over scope="col" {} th.n scope="col" { "most" } } }
                tbody { @for channel in channels { (channel) } }
            } }
        }
    })
}

/// The numbers that are drawn.
pub fn json(timeline: &Timeline) -> Value {
    let ends: Vec<u64> = timeline.samples.iter().map(|sample| sample.end).collect();
    let unit = |at: usize| {
        let of =
            |state: fn(&Cycles) -> u64| timeline.samples.iter().map(|sample| state(&sample.units[at])).collect::<Vec<u64>>();
        let bank = timeline.units[at];
        json!({ "unit": bank.name, "count": bank.count, "busy": of(|c| c.busy), "blocked": of(|c| c.blocked), "memory": of(|c| c.memory), "latency": of(|c| c.latency), "held": timeline.samples.iter().map(|sample| sample.held[at]).collect::<Vec<u64>>() })
    };
    json!({ "ends": ends, "units": (0..timeline.units.len()).map(unit).collect::<Vec<_>>() })
}
