//! The page of a replay.

use std::collections::BTreeMap;

use maud::{Markup, html};
use serde_json::{Value, json};

use super::data::{CYCLES, CountedSpan, Statistics};
use super::{
    PageSection, advice, groups, inline, machine, maps, page, part, passes, percent, readable, series, shaders, share, state,
    tables, word,
};
use crate::machine::{Config, PhaseReport, SORTING, WRONG_PIXELS};
use crate::mem::{DRAM, DramCounts};
use crate::report::peak::MemoryPeak;
use crate::report::shaders::ShaderListing;
use crate::report::state::DrawState;
use crate::report::verdict::{Draws, counted, numbers, sentence};
use crate::report::waits::Waits;
use crate::run::bound::{FrameEstimate, PhaseEstimate};
use crate::run::maps::Maps;
use crate::run::targets::TargetPictures;
use crate::run::timeline::Timeline;
use crate::stats::{FRAME, Key, SECONDS, counter};
use crate::work::{FUNNEL, Funnel};

/// What a page of a replay is made from.
pub struct Input<'i> {
    /// The statistics.
    pub statistics: &'i Statistics,
    /// The machine; none where it is not known.
    pub config: Option<&'i Config>,
    /// The picture of the frame that is shown, as PNG.
    pub picture: Option<&'i [u8]>,
    /// The command that was given; none where it is not known.
    pub command: Option<&'i str>,
    /// What limits each phase of the frame that is shown, in order; empty where nothing was estimated.
    pub limits: &'i [Limit],
    /// What `why` found for this frame: its JSON, with the sentence of its verdict in `verdict`.
    pub why: Option<&'i Value>,
    /// The states of the draws that were reported, by their numbers; empty where the trace is not at hand.
    pub states: &'i BTreeMap<u32, DrawState>,
    /// The shaders of the frame that is shown with the cost of their lines; empty where the trace is not at hand.
    pub shaders: &'i [ShaderListing],
    /// Heat maps of the frame that is shown.
    pub maps: Option<&'i Maps>,
    /// Small pictures of what the passes of the frame that is shown leave.
    pub targets: Option<&'i TargetPictures>,
    /// What units and channels did over time in the frame that is shown.
    pub timeline: Option<&'i Timeline>,
}

/// What limits a phase, by counts and rates.
#[derive(Clone, Debug, PartialEq)]
pub struct Limit {
    /// The phase, as the terminal names it.
    pub name: String,
    /// The unit that bounds it.
    pub unit: String,
    /// Cycles that this unit needs for its work, by estimate: the measured phase may take fewer. 0 where what bounds is no unit.
    pub work: f64,
    /// The unit that would bound next, and its cycles.
    pub next: Option<(String, f64)>,
    /// Cycles of the phase by the estimate.
    pub cycles: f64,
}

/// What limits the phases of a frame.
pub fn limits(estimate: &FrameEstimate) -> Vec<Limit> {
    let limit = |(own, report): (&PhaseEstimate, &PhaseReport)| {
        let work = own.units.iter().find(|(unit, _)| *unit == own.limit).map_or(0.0, |(_, cycles)| *cycles);
        let others = own.units.iter().filter(|(unit, cycles)| *unit != own.limit && *cycles > 0.0);
        let next = others.max_by(|a, b| a.1.total_cmp(&b.1)).map(|(unit, cycles)| ((*unit).to_owned(), *cycles));
        Limit { name: report.phase.to_string(), unit: own.limited(), work, next, cycles: own.cycles }
    };
    estimate.phases.iter().zip(&estimate.phases()).map(limit).collect()
}

/// The command that replays, or asks why, as these statistics say, with more knobs set.
pub fn command(statistics: &Statistics, name: &str, more: &[String]) -> String {
    let mut text = format!("fillrate {name} {}", word(statistics.text("trace")));
    if statistics.text("config") != "baseline" {
        text.push_str(&format!(" --config {}", word(statistics.text("config"))));
    }
    for (path, values) in statistics.json()["changed_knobs"].as_object().into_iter().flatten() {
        let value = match &values["to"] {
            Value::String(name) => name.clone(),
            other => other.to_string(),
        };
        // What is tried replaces what was set.
        if !more.iter().any(|set| set.split('=').next() == Some(path)) {
            text.push_str(&format!(" --set {}", word(&format!("{path}={value}"))));
        }
    }
    more.iter().for_each(|set| text.push_str(&format!(" --set {}", word(set))));
    if statistics.frames().len() > 1 || statistics.number() > 0 {
        text.push_str(&format!(" --frames {}", statistics.number()));
    }
    if name == "replay" && statistics.text("fidelity") != "cycle" {
        text.push_str(&format!(" --fidelity {}", word(statistics.text("fidelity"))));
    }
    text
}

fn knob(value: &Value) -> String {
    value.as_str().map_or_else(|| value.to_string(), str::to_owned)
}

/// Seconds that a frame may take at 60 frames per second.
const BUDGET: f64 = 1.0 / 60.0;

/// A number that stands first, with what it is. `path` is that of the statistic; none of what is computed.
struct Tile {
    text: String,
    name: String,
    path: Option<(Key, f64)>,
    warns: bool,
}

/// Pixels of a picture, from the head of its PNG file.
fn pixels(png: &[u8]) -> Option<f64> {
    let number = |at: usize| Some(f64::from(u32::from_be_bytes(png.get(at..at + 4)?.try_into().ok()?)));
    Some(number(16)? * number(20)?).filter(|&pixels| pixels > 0.0)
}

/// The numbers that stand first.
fn tiles(input: &Input<'_>) -> Markup {
    let statistics = input.statistics;
    let (place, counts) = (statistics.place(), &statistics.frame().counts);
    let mut tiles: Vec<Tile> = Vec::new();
    let mut counted = |key: Key, text: &dyn Fn(f64) -> String, name: &dyn Fn(f64) -> String, warns: bool| {
        let value = key.sum(counts);
        tiles.extend(value.map(|value| Tile { text: text(value), name: name(value), path: Some((key, value)), warns }));
    };
    counted(CYCLES, &readable, &|_| "cycles".into(), false);
    let seconds = FRAME.statistic(&SECONDS);
    if seconds.sum(counts) > Some(0.0) {
        let late = seconds.sum(counts) > Some(BUDGET);
        counted(
            seconds,
            &|seconds| format!("{:.3} ms", 1e3 * seconds),
            &|seconds| format!("frame time, {} of 16.7 ms", percent(seconds / BUDGET)),
            late,
        );
    }
    counted(FUNNEL.counter(counter!(Funnel, fragments_shaded)), &readable, &|_| "fragments shaded".into(), false);
    if SORTING.statistic(&WRONG_PIXELS).sum(counts) > Some(0.0) {
        counted(SORTING.statistic(&WRONG_PIXELS), &readable, &|_| "wrong pixels".into(), true);
    }
    let funnel: Funnel = FUNNEL.sum(counts);
    let mut computed = |text: String, name: String| tiles.push(Tile { text, name, path: None, warns: false });
    let invocations = (funnel.fragments_shaded + funnel.helper_fragments) as f64;
    if let (Some(pixels), true) = (input.picture.and_then(pixels), invocations > 0.0) {
        let shaded = funnel.fragments_shaded as f64 / pixels;
        computed(format!("{shaded:.2}"), "overdraw: fragments shaded per pixel".into());
    }
    if invocations > 0.0 {
        computed(percent(funnel.fragments_shaded as f64 / invocations), "quad efficiency".into());
    }
    if let (Some(config), true) = (input.config, !DRAM.find(counts).is_empty()) {
        let DramCounts { read_bytes, write_bytes, .. } = DRAM.sum(counts);
        let peak = MemoryPeak::new(config);
        let rate = peak.rate((read_bytes + write_bytes) as f64, statistics.frame().cycles());
        let name = format!("of DRAM, {} of {:.0} GB/s", percent(rate.share), peak.gigabytes());
        computed(format!("{:.2} GB/s", rate.gigabytes), name);
    }
    html! {
        div.tiles { @for Tile { text, name, path, warns } in &tiles {
            div.tile.warns[*warns] {
                @match path {
                    Some((key, value)) => b data-path=(format!("{place}.{}", key.path(""))) data-value=(value) { (text) },
                    None => b { (text) },
                }
                span { (name) }
            }
        } }
    }
}

/// The picture, and what was run.
fn run(input: &Input<'_>, picture: Option<&str>) -> Markup {
    let statistics = input.statistics;
    let changed = statistics.json()["changed_knobs"].as_object();
    html! {
        div.two {
            figure {
                @match picture {
                    Some(address) => { img.shot src=(address) alt=(format!("Frame {}", statistics.number())); figcaption { "Frame " (statistics.number()) ", as the machine drew it." } },
                    None => p.note { "No picture of this frame was left." },
                }
            }
            div {
                div.scroll { table { tbody {
                    tr { th scope="row" { "trace" } td { code { (statistics.text("trace")) } } }
                    tr { th scope="row" { "machine" } td { code { (statistics.text("config")) } @if let Some(config) = input.config { ", " (config.card.sort.name()) ", " (config.card.pipelines) " pipelines at " (config.card.clock_mhz) " MHz" } } }
                    tr { th scope="row" { "fidelity" } td { (statistics.text("fidelity")) } }
                    tr { th scope="row" { "frames" } td { (statistics.frames().len()) @if statistics.frames().len() > 1 { "; shown is frame " (statistics.number()) ", which costs most" } } }
                    tr { th scope="row" { "program" } td { "fillrate " (statistics.text("fillrate")) } }
                } } }
                h3 { "Knobs that differ from " (statistics.text("config")) }
                @match changed.filter(|changed| !changed.is_empty()) {
                    Some(changed) => div.scroll { table {
                        thead { tr { th scope="col" { "knob" } th.n scope="col" { "there" } th.n scope="col" { "here" } } }
                        tbody { @for (path, values) in changed { tr { td.name { code { (path) } } td.n { (knob(&values["from"])) } td.n { b { (knob(&values["to"])) } } } } }
                    } },
                    None => p { "None." },
                }
                h3 { @if input.command.is_some() { "Command" } @else { "Command that replays it" } }
                pre { (input.command.map_or_else(|| command(statistics, "replay", &[]), str::to_owned)) }
            }
        }
    }
}

/// The two lists of findings, by their titles: what a program can do, and what a card could do.
pub const LISTS: [(&str, &str); 2] = [("In the frame", "in_the_frame"), ("On the card", "on_the_card")];

/// A finding as a line, with its evidence and the draws concerned folded below it.
fn finding(own: &Value) -> Markup {
    let evidence = own["evidence"].as_str().unwrap_or("");
    let draws: Vec<u32> = own["draws"].as_array().into_iter().flatten().filter_map(Value::as_u64).map(|n| n as u32).collect();
    let set: Vec<&str> = own["set"].as_array().into_iter().flatten().filter_map(Value::as_str).collect();
    html! {
        li {
            (super::sentence(&sentence(own["sentence"].as_str().unwrap_or(""))))
            @if !(evidence.is_empty() && draws.is_empty() && set.is_empty()) {
                details {
                    summary { "Evidence" }
                    @if !evidence.is_empty() { p.note { (evidence) } }
                    @if !draws.is_empty() { p.note { (numbers(&draws)) } }
                    @if !set.is_empty() { p.note { "Timed with " code { (set.iter().map(|set| format!("--set {set}")).collect::<Vec<_>>().join(" ")) } } }
                }
            }
        }
    }
}

/// What counters alone prove of the frame that is shown; `phase` is the place of the phase that takes most.
fn counted_verdict(input: &Input<'_>, phase: Option<usize>) -> Vec<String> {
    let frame = input.statistics.frame();
    let drawn = |at: usize| -> Option<(String, f64, (&'static str, String), Waits)> {
        let phase = frame.parts.get(at)?;
        let limit = passes::named_limit(input, at, phase).unwrap_or(("limit", String::new()));
        Some((phase.name(), share(phase.cycles(), frame.cycles()), limit, Waits::of(&phase.counts)))
    };
    let most = phase.and_then(drawn);
    let draws = phase.and_then(|at| frame.parts.get(at)).map_or(Draws::default(), |phase| {
        let count = phase.parts.iter().filter(|draw| draw.number.is_some()).count() as u64;
        Draws { count, vertices: FUNNEL.sum::<Funnel>(&phase.counts).vertices_in }
    });
    let most = most.as_ref().map(|(name, share, (word, limit), waits)| (name.as_str(), *share, (*word, limit.as_str()), waits));
    counted(&FUNNEL.sum(&frame.counts), most, draws)
}

/// What was found to hold the frame back, in a sentence, with its table.
fn proven(why: &Value) -> Markup {
    let gains = why["changes"].as_array().map_or(&[][..], Vec::as_slice);
    let gain = |value: &Value| value["gain"].as_f64();
    let (some, none): (Vec<&Value>, Vec<&Value>) =
        gains.iter().partition(|own| gain(own).is_none_or(|gain| gain.abs() >= 0.0005));
    html! {
        p.verdict { (super::sentence(why["verdict"].as_str().unwrap_or(""))) }
        @for (title, list) in LISTS {
            @let findings = why[list].as_array().map_or(&[][..], Vec::as_slice);
            @if !findings.is_empty() {
                h3 { (title) }
                ul.findings { @for own in findings { (finding(own)) } }
            }
        }
        p.note { "The frame was timed again on " (gains.len()) " machines, each with more of one resource. Caches are cold when the frame begins: " (readable(why["cycles"].as_f64().unwrap_or(0.0))) " cycles." }
        div.scroll.tall { table.sortable.stacked id="why" {
            (super::heads(&[super::Column("with this change alone", false, ""), super::Column("cycles", true, ""), super::Column("change", true, ""), super::Column("most in", false, "The phase that saves most cycles."), super::Column("seen there without it", false, "Counted in that phase, or in the frame.")]))
            tbody { @for own in some {
                tr {
                    td.name { (own["change"].as_str().unwrap_or("")) }
                    @match (own["cycles"].as_f64(), gain(own)) {
                        (Some(cycles), Some(gain)) => {
                            td.n data-value=(cycles) { (readable(cycles)) }
                            td.n data-value=(-gain) { span class=(if gain > 0.0 { "gain" } else { "loss" }) { (format!("{:+.1} %", -100.0 * gain)) } }
                        },
                        _ => { td.n data-value="" { "\u{2013}" } td.n data-value="" { "\u{2013}" } },
                    }
                    td.name { (own["most_in"].as_str().unwrap_or("")) }
                    td.evidence { (own["evidence"].as_str().unwrap_or("")) (own["error"].as_str().unwrap_or("")) }
                }
            } }
        } }
        @if !none.is_empty() { p.note { (none.len()) " changes gain less than 0.05 %." } }
    }
}

/// What holds the frame back: proven, estimated, or how to find out.
fn verdict(input: &Input<'_>) -> Markup {
    let prove = command(input.statistics, "why", &[]);
    let frame = input.statistics.frame();
    let cycles = |at: usize| frame.parts.get(at).map_or(0.0, CountedSpan::cycles);
    let most = (0..frame.parts.len()).max_by(|&a, &b| cycles(a).total_cmp(&cycles(b)));
    let said = counted_verdict(input, most);
    html! {
        @match input.why {
            Some(why) => (proven(why)),
            None => {
                @if !said.is_empty() { p.verdict { (said.join(" ")) } }
                p { "Counters prove what is off screen or hidden, and what waits. What it costs is proven by timing the frame again with more of each resource:" }
                pre { (prove) }
            },
        }
    }
}

/// The page, as one file.
pub fn replay(input: &Input<'_>) -> String {
    let statistics = input.statistics;
    let picture = input.picture.map(|png| inline("image/png", png));
    let name = statistics.text("trace").trim_end_matches('/').rsplit('/').next().unwrap_or("");
    let title = format!("{name} on {}", statistics.text("config"));
    let head = html! {
        h1 { (title) }
        p.sub { "Frame " (statistics.number()) @if statistics.frames().len() > 1 { " of " (statistics.frames().len()) " frames: the one that costs most" } ". What was drawn, how long it took, and what held it back." }
        (tiles(input))
    };
    let missing =
        "The trace is not at hand. This command adds maps and what units did over time: fillrate report DIR --trace TRACE.";
    let heat = input.maps.map_or_else(|| html! { p.note { (missing) } }, |maps| maps::section(maps, picture.as_deref()));
    let parts: Vec<PageSection> = [
        part("run", "What was run", Some(run(input, picture.as_deref()))),
        part("why", "What holds it back", Some(verdict(input))),
        part("time", "Where the time goes", passes::time(input)),
        part("tables", "Passes and draws", passes::tables(input)),
        part("groups", "Debug groups", groups::tree(input)),
        part("state", "Selected draw", state::section(input.states)),
        part("shaders", "Shaders", shaders::section(input.shaders)),
        part("sorting", "What sorting cost", tables::sorting(input)),
        part("bins", "Bins", tables::bins(input)),
        part("units", "Units and channels", machine::units(input)),
        part("timeline", "Over time", series::section(input)),
        part("maps", "Heat maps", Some(heat)),
        part("funnel", "Funnel", tables::funnel(input)),
        part("caches", "Caches", tables::caches(input)),
        part("memory", "Memory", tables::memory(input)),
        part("roofline", "Roofline", machine::roofline(input)),
        part("frames", "All frames", tables::frames(input)),
        part("machine", "The machine", machine::drawing(input)),
        part("advice", "What to try", advice::section(input)),
        part("glossary", "Glossary", tables::glossary(input)),
    ]
    .into_iter()
    .flatten()
    .collect();
    let estimates: Vec<Value> = input
        .limits
        .iter()
        .map(|limit| json!({ "phase": limit.name, "limit": limit.unit, "work_cycles": limit.work, "cycles": limit.cycles }))
        .collect();
    let more = json!({ "limits": estimates, "why": input.why, "timeline": input.timeline.map(|timeline| series::json(timeline, input.config)) });
    let states = state::json(input.states);
    let mut values = vec![("statistics", statistics.json()), ("estimates", &more)];
    if !input.states.is_empty() {
        values.push(("states", &states));
    }
    page(&title, &head, &parts, &values)
}
