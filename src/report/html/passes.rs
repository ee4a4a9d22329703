//! The time of a frame: its phases one after another, its passes and its draws.

use maud::{Markup, html};
use serde_json::Value;

use super::data::number;
use super::replay::{Input, Limit};
use super::{Column, bar, cell, cell_share, heads, key, percent, readable, share};

/// Kinds of phases in which something is drawn or computed; the others move data.
pub fn draws(phase: &Value) -> bool {
    matches!(phase["kind"].as_str(), Some("pass" | "dispatch"))
}

/// The name of a phase as the terminal has it.
pub fn name(phase: &Value) -> String {
    let [kind, label] = ["kind", "label"].map(|name| phase[name].as_str().unwrap_or(""));
    let number = if draws(phase) { format!(" {}", phase["number"].as_u64().unwrap_or(0)) } else { String::new() };
    let gap = if label.is_empty() { "" } else { " " };
    format!("{kind}{number}{gap}{label}")
}

/// The cycles of a phase or a draw.
pub fn cycles(phase: &Value) -> f64 {
    phase["cycles"].as_f64().unwrap_or(0.0)
}

/// A list of a frame; empty where there is none.
pub fn list<'v>(frame: &'v Value, name: &str) -> &'v [Value] {
    frame[name].as_array().map_or(&[], Vec::as_slice)
}

/// The phases of a frame on a line, and what drawing and all else take.
pub fn time(input: &Input<'_>) -> Option<Markup> {
    let statistics = input.statistics;
    let frame = statistics.frame();
    let phases = list(frame, "phases");
    if phases.is_empty() {
        return None;
    }
    let all: f64 = phases.iter().map(cycles).sum();
    let drawn: f64 = phases.iter().filter(|phase| draws(phase)).map(cycles).sum();
    let class = |phase: &Value| if draws(phase) { "k-draw" } else { "k-other" };
    let strip: Vec<(&str, f64, String)> = phases
        .iter()
        .map(|phase| {
            let text = format!("{}: {} cycles, {}", name(phase), readable(cycles(phase)), percent(share(cycles(phase), all)));
            (class(phase), share(cycles(phase), all), text)
        })
        .collect();
    let kinds: Vec<(&str, f64, usize)> = ["pass", "dispatch", "transfers", "scan-out"]
        .into_iter()
        .map(|kind| {
            let own = phases.iter().filter(|phase| phase["kind"].as_str() == Some(kind));
            (kind, own.clone().map(cycles).sum(), own.count())
        })
        .filter(|(_, _, count)| *count > 0)
        .collect();
    Some(html! {
        p {
            "Frame " (statistics.number()) " takes " (readable(all)) " cycles: drawing and computing " b { (readable(drawn)) " (" (percent(share(drawn, all))) ")" }
            ", moving data (uploads, copies, scan-out) " b { (readable(all - drawn)) " (" (percent(share(all - drawn, all))) ")" } "."
        }
        (bar("strip", &strip))
        (key(&[("k-draw", "drawing: passes and dispatches"), ("k-other", "moving data: transfers and scan-out")]))
        div.scroll { table {
            thead { tr { th scope="col" { "kind" } th.n scope="col" { "number" } th.n scope="col" { "cycles" } th.n scope="col" { "share" } th scope="col" { "" } } }
            tbody { @for (kind, sum, count) in &kinds {
                @let own = if matches!(*kind, "pass" | "dispatch") { "k-draw" } else { "k-other" };
                tr { td.name { (kind) } td.n { (count) } td.n data-value=(sum) { (readable(*sum)) } (cell_share(share(*sum, all)))
                    td { (bar("bar", &[(own, share(*sum, all), percent(share(*sum, all)))])) } }
            } }
        } }
    })
}

/// Statistics of phases and draws that are columns: a path and a heading. What is 0 everywhere is left out.
const COLUMNS: [(&str, &str); 13] = [
    ("funnel.vertices_shaded", "vertices shaded"),
    ("funnel.triangles_setup", "triangles set up"),
    ("funnel.quads_rasterized", "quads"),
    ("funnel.quads_early_culled", "quads hidden early"),
    ("funnel.fragments_shaded", "fragments shaded"),
    ("funnel.helper_fragments", "helpers"),
    ("funnel.fragments_written", "fragments written"),
    ("memory.dram.read_bytes", "bytes from DRAM"),
    ("memory.dram.write_bytes", "bytes to DRAM"),
    ("caches.texture.accesses", "texture lookups"),
    ("caches.texture.misses", "texture misses"),
    ("caches.vertex.misses", "vertex misses"),
    ("caches.l2.misses", "L2 misses"),
];

/// The columns that some of these entries have.
fn columns(entries: &[&Value]) -> Vec<(&'static str, &'static str)> {
    let has = |path: &str| entries.iter().any(|entry| number(entry, path).is_some_and(|value| value != 0.0));
    COLUMNS.into_iter().filter(|(path, _)| has(path)).collect()
}

/// The unit of a span that was busy in the largest share of its cycles, and that share: how far it is used, not what limits. `frame` tells how
/// many there are of each.
pub fn most_used<'v>(entry: &'v Value, frame: &Value) -> Option<(&'v str, f64)> {
    let all = cycles(entry);
    let units = entry.get("units")?.as_object()?.iter().filter_map(|(name, states)| {
        let count = frame["units"][name].as_array().map_or(1, Vec::len);
        Some((name.as_str(), states.get("busy")?.as_f64()? / (all * count as f64)))
    });
    units.filter(|(_, share)| share.is_finite()).max_by(|a, b| a.1.total_cmp(&b.1))
}

/// The column of the unit that is used most.
const USED: Column<'static> = Column(
    "most used",
    false,
    "The unit that is busy in the largest share of these cycles, and the share. It is a figure of use: a busy unit need not limit anything.",
);

/// The cell of the unit that is used most.
fn used_cell(entry: &Value, frame: &Value) -> Markup {
    html! { td.unit { @match most_used(entry, frame) { Some((unit, share)) => { (unit) " " span.note { (percent(share)) } }, None => "\u{2013}" } } }
}

/// The estimate of what limits a phase.
fn estimated<'i>(input: &'i Input<'_>, at: usize, phase: &Value) -> Option<&'i Limit> {
    input.limits.get(at).filter(|own| own.name == name(phase))
}

/// The unit that limits a phase, by estimate.
fn unit_limit<'i>(input: &'i Input<'_>, at: usize, phase: &'i Value) -> Option<&'i str> {
    let told = || phase["limit"].as_str().filter(|told| !told.is_empty());
    estimated(input, at, phase).map(|own| own.unit.as_str()).or_else(told)
}

/// What limits a phase, and the evidence.
fn limit(input: &Input<'_>, at: usize, phase: &Value) -> Markup {
    html! {
        td.reason {
            @match estimated(input, at, phase) {
                Some(own) => {
                    b { (own.unit) }
                    @let next = own.next.as_ref().map_or(String::new(), |(unit, cycles)| format!("; next {unit}, {}", readable(cycles.round())));
                    @if own.work > 0.0 { span.note { " about " (readable(own.work.round())) " cycles of work by estimate" (next) } }
                },
                None => @match unit_limit(input, at, phase) { Some(unit) => b { (unit) }, None => span.note { "\u{2013}" } },
            }
        }
    }
}

/// The cell of a counter of a phase or a draw. Where these have counters, those that are 0 are left out of the file.
fn counted_cell(entry: &Value, base: &str, path: &str) -> Markup {
    if number(entry, path).is_none() && entry.get("units").is_some() {
        return html! { td.n data-value="0" { "0" } };
    }
    cell(entry, base, path)
}

/// The table of phases, those that take most first, with what was counted in each.
fn phases(input: &Input<'_>) -> Option<Markup> {
    let statistics = input.statistics;
    let frame = statistics.frame();
    let phases = list(frame, "phases");
    let all: f64 = phases.iter().map(cycles).sum();
    let mut order: Vec<usize> = (0..phases.len()).collect();
    order.sort_by(|&a, &b| cycles(&phases[b]).total_cmp(&cycles(&phases[a])).then(a.cmp(&b)));
    let more = columns(&phases.iter().collect::<Vec<_>>());
    let counted = phases.iter().any(|phase| phase.get("units").is_some());
    let mut titles = vec![
        Column("phase", false, "Passes and dispatches have their numbers in the trace."),
        Column("order", true, "Its place in the frame."),
        Column("cycles", true, "From its beginning to that of the next."),
        Column("share", true, "Of the cycles of the frame."),
        Column(
            "limited by",
            false,
            "The unit whose work takes most time by counts and rates; imbalance: units and pipelines take turns, and none works all the time.",
        ),
    ];
    if counted {
        titles.push(USED);
    }
    titles.extend(more.iter().map(|(path, name)| Column(name, true, path)));
    (!phases.is_empty()).then(|| {
        html! {
            div.scroll.tall { table.sortable id="passes" {
                (heads(&titles))
                tbody { @for at in order {
                    @let phase = &phases[at];
                    @let base = format!("{}.phases[{at}]", statistics.place());
                    tr {
                        td.name { (name(phase)) }
                        td.n data-value=(at) { (at + 1) }
                        (cell(phase, &base, "cycles"))
                        (cell_share(share(cycles(phase), all)))
                        (limit(input, at, phase))
                        @if counted { (used_cell(phase, frame)) }
                        @for (path, _) in &more { (counted_cell(phase, &base, path)) }
                    }
                } }
            } }
        }
    })
}

/// The table of draws, where the replay reported each draw (`--per-draw`).
fn draw_table(input: &Input<'_>) -> Option<Markup> {
    /// Draws that are listed: those with most cycles.
    const MOST: usize = 1000;
    let statistics = input.statistics;
    let frame = statistics.frame();
    let phases = list(frame, "phases").iter().enumerate();
    let mut draws: Vec<(usize, usize, &Value, &Value)> = phases
        .flat_map(|(at, phase)| list(phase, "draws").iter().enumerate().map(move |(own, draw)| (at, own, phase, draw)))
        .collect();
    if draws.is_empty() {
        return None;
    }
    let all: f64 = draws.iter().map(|(.., draw)| cycles(draw)).sum();
    // In a stable order: of equal ones the first.
    draws.sort_by(|a, b| cycles(b.3).total_cmp(&cycles(a.3)));
    let left = draws.len().saturating_sub(MOST);
    draws.truncate(MOST);
    let more = columns(&draws.iter().map(|(.., draw)| *draw).collect::<Vec<_>>());
    let mut titles = vec![
        Column("draw", true, "Its number in the trace; what follows the last draw of a pass has none."),
        Column("label", false, "Its pipeline, and the debug groups around it."),
        Column("pass", true, ""),
        Column("cycles", true, "From its beginning to that of the next."),
        Column("share", true, "Of the cycles of all draws."),
        Column(
            "limit of its pass",
            false,
            "By counts and rates. Draws of a pass are in the machine together, so a limit is one of the pass, not of a draw.",
        ),
        USED,
    ];
    titles.extend(more.iter().map(|(path, name)| Column(name, true, path)));
    let label = |draw: &Value| {
        let [group, label] = ["group", "label"].map(|name| draw[name].as_str().unwrap_or("").to_owned());
        let end = if draw["number"].is_null() { "end of the pass".to_owned() } else { String::new() };
        [group, label, end].into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join(" / ")
    };
    Some(html! {
        h3 { "Draws" }
        @if left > 0 { p.note { "The " (readable(MOST as f64)) " draws with most cycles; " (readable(left as f64)) " more are in draws.csv." } }
        div.scroll.tall { table.sortable id="draws" {
            (heads(&titles))
            tbody { @for (at, own, phase, draw) in &draws {
                @let base = format!("{}.phases[{at}].draws[{own}]", statistics.place());
                tr {
                    (cell(draw, &base, "number"))
                    td.name { (label(draw)) }
                    (cell(phase, &format!("{}.phases[{at}]", statistics.place()), "number"))
                    (cell(draw, &base, "cycles"))
                    (cell_share(share(cycles(draw), all)))
                    td.reason { @match unit_limit(input, *at, phase) { Some(unit) => b { (unit) }, None => span.note { "\u{2013}" } } }
                    (used_cell(draw, frame))
                    @for (path, _) in &more { (counted_cell(draw, &base, path)) }
                }
            } }
        } }
    })
}

/// Passes and draws with their cost and what limits them.
pub fn tables(input: &Input<'_>) -> Option<Markup> {
    let table = phases(input)?;
    let why = if input.limits.is_empty() {
        "What limits a pass is estimated where the trace is at hand: fillrate report DIR --trace TRACE."
    } else {
        "What limits a pass is estimated from counts and rates, as --fidelity bound does; fillrate why proves it by timing the frame without it."
    };
    Some(html! {
        (table)
        p.note { (why) }
        @match draw_table(input) {
            Some(draws) => (draws),
            None => p.note { "Draws have no cycles of their own in these statistics: replay with " code { "--per-draw" } "." },
        }
    })
}
