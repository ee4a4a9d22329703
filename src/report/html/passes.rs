//! The time of a frame: its phases one after another, its passes and its draws.

use maud::{Markup, html};
use serde_json::Value;

use super::data::number;
use super::replay::{Input, Limit};
use super::{Column, bar, cell, cell_share, heads, key, percent, readable, share};

/// Kinds of phases in which something is drawn or computed; the others move data.
fn draws(phase: &Value) -> bool {
    matches!(phase["kind"].as_str(), Some("pass" | "dispatch"))
}

/// The name of a phase as the terminal has it.
pub fn name(phase: &Value) -> String {
    let [kind, label] = ["kind", "label"].map(|name| phase[name].as_str().unwrap_or(""));
    let number = if draws(phase) { format!(" {}", phase["number"].as_u64().unwrap_or(0)) } else { String::new() };
    let gap = if label.is_empty() { "" } else { " " };
    format!("{kind}{number}{gap}{label}")
}

fn cycles(phase: &Value) -> f64 {
    phase["cycles"].as_f64().unwrap_or(0.0)
}

fn list<'v>(frame: &'v Value, name: &str) -> &'v [Value] {
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

/// Leaves of the entry of a pass or a draw that are numbers, by their paths.
fn leaves(value: &Value, path: &str, out: &mut Vec<String>) {
    for (name, value) in value.as_object().into_iter().flatten() {
        let path = if path.is_empty() { name.clone() } else { format!("{path}.{name}") };
        match value {
            Value::Number(_) if !matches!(path.as_str(), "number" | "cycles" | "pass" | "frame") && !out.contains(&path) => {
                out.push(path)
            }
            Value::Object(_) => leaves(value, &path, out),
            _ => {}
        }
    }
}

/// Columns that a table of passes or draws has at most, beside its first ones.
const COLUMNS: usize = 14;

/// The statistics of these entries that are columns: those that tell most, and none that is 0 everywhere.
fn columns(entries: &[&Value]) -> Vec<String> {
    const FIRST: [&str; 8] = [
        "share",
        "funnel.vertices_shaded",
        "funnel.triangles_setup",
        "funnel.quads_rasterized",
        "funnel.fragments_shaded",
        "funnel.helper_fragments",
        "funnel.quads_early_culled",
        "funnel.fragments_written",
    ];
    let mut paths = Vec::new();
    entries.iter().for_each(|entry| leaves(entry, "", &mut paths));
    paths.retain(|path| entries.iter().any(|entry| number(entry, path).is_some_and(|value| value != 0.0)));
    let rank = |path: &String| {
        FIRST.iter().position(|first| first == path).unwrap_or(FIRST.len() + usize::from(path.starts_with("funnel")))
    };
    paths.sort_by_key(rank);
    paths.truncate(COLUMNS);
    paths
}

/// The last words of a path, as a heading.
fn heading(path: &str) -> String {
    let words: Vec<&str> = path.rsplit('.').take(2).collect();
    let text = match words[..] {
        [last, "funnel" | "total"] | [last] => last.to_owned(),
        [last, before] => format!("{before} {last}"),
        _ => path.to_owned(),
    };
    text.replace('_', " ")
}

/// What limits a phase, and the evidence.
fn limit(limit: Option<&Limit>, told: &str) -> Markup {
    html! {
        td {
            @match limit {
                Some(own) => {
                    b { (own.unit) }
                    @let next = own.next.as_ref().map_or(String::new(), |(unit, cycles)| format!("; next {unit}, {}", readable(cycles.round())));
                    @if own.work > 0.0 { span.note { " at least " (readable(own.work.round())) " cycles" (next) } }
                },
                None if !told.is_empty() => b { (told) },
                None => span.note { "\u{2013}" },
            }
        }
    }
}

/// The table of phases, those that take most first; with the statistics of passes where there are any.
fn phases(input: &Input<'_>) -> Option<Markup> {
    let statistics = input.statistics;
    let frame = statistics.frame();
    let phases = list(frame, "phases");
    let passes = list(frame, "passes");
    let all: f64 = phases.iter().map(cycles).sum();
    let mut order: Vec<usize> = (0..phases.len()).collect();
    order.sort_by(|&a, &b| cycles(&phases[b]).total_cmp(&cycles(&phases[a])).then(a.cmp(&b)));
    // The statistics of a pass, by its number; a list that has kinds holds others, too.
    let detail = |phase: &Value| {
        passes.iter().position(|pass| {
            pass["number"] == phase["number"] && pass.get("kind").map_or(phase["kind"] == "pass", |kind| *kind == phase["kind"])
        })
    };
    let entries: Vec<&Value> = passes.iter().collect();
    let more = columns(&entries);
    let names: Vec<String> = more.iter().map(|path| heading(path)).collect();
    let mut titles = vec![
        Column("phase", false, "Passes and dispatches have their numbers in the trace."),
        Column("order", true, "Its place in the frame."),
        Column("cycles", true, "From its beginning to that of the next."),
        Column("share", true, "Of the cycles of the frame."),
        Column("limited by", false, "The unit whose work takes most time by counts and rates."),
    ];
    titles.extend(names.iter().zip(&more).map(|(name, path)| Column(name, true, path)));
    (!phases.is_empty()).then(|| {
        html! {
            div.scroll.tall { table.sortable id="passes" {
                (heads(&titles))
                tbody { @for at in order {
                    @let phase = &phases[at];
                    @let own = detail(phase);
                    tr {
                        td.name { (name(phase)) }
                        td.n data-value=(at) { (at + 1) }
                        (cell(phase, &format!("{}.phases[{at}]", statistics.place()), "cycles"))
                        (cell_share(share(cycles(phase), all)))
                        (limit(input.limits.get(at).filter(|own| own.name == name(phase)), phase["limit"].as_str().unwrap_or("")))
                        @for path in &more {
                            @match own {
                                Some(place) => (cell(&passes[place], &format!("{}.passes[{place}]", statistics.place()), path)),
                                None => td.n data-value="" { "\u{2013}" },
                            }
                        }
                    }
                } }
            } }
        }
    })
}

/// The table of draws, where the replay told of each.
fn draw_table(input: &Input<'_>) -> Option<Markup> {
    /// Draws that are listed: those with most cycles.
    const MOST: usize = 1000;
    let statistics = input.statistics;
    let draws = list(statistics.frame(), "draws");
    if draws.is_empty() {
        return None;
    }
    let all: f64 = draws.iter().map(cycles).sum();
    let mut order: Vec<usize> = (0..draws.len()).collect();
    order.sort_by(|&a, &b| cycles(&draws[b]).total_cmp(&cycles(&draws[a])).then(a.cmp(&b)));
    let left = order.len().saturating_sub(MOST);
    order.truncate(MOST);
    let more = columns(&draws.iter().collect::<Vec<_>>());
    let names: Vec<String> = more.iter().map(|path| heading(path)).collect();
    let mut titles = vec![Column("draw", true, "Its number in the trace."), Column("label", false, "")];
    titles.extend([Column("cycles", true, ""), Column("share", true, "Of the cycles of all draws.")]);
    titles.extend(names.iter().zip(&more).map(|(name, path)| Column(name, true, path)));
    Some(html! {
        h3 { "Draws" }
        @if left > 0 { p.note { "The " (readable(MOST as f64)) " draws with most cycles; " (readable(left as f64)) " more are in stats.json." } }
        div.scroll.tall { table.sortable id="draws" {
            (heads(&titles))
            tbody { @for at in order {
                @let draw = &draws[at];
                @let base = format!("{}.draws[{at}]", statistics.place());
                tr {
                    (cell(draw, &base, "number"))
                    td.name { (draw["label"].as_str().unwrap_or("")) }
                    (cell(draw, &base, "cycles"))
                    (cell_share(share(cycles(draw), all)))
                    @for path in &more { (cell(draw, &base, path)) }
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
            None => p.note { "Draws have no cycles of their own in these statistics." },
        }
    })
}
