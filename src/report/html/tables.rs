//! Tables of what a frame counted: the funnel, caches, memory, all frames, and the meanings of the names.

use std::collections::BTreeMap;

use maud::{Markup, html};
use serde_json::Value;

use super::data::number;
use super::replay::Input;
use super::{Column, bar, cell, cell_bytes, cell_share, heads, key, percent, readable, share};
use crate::report::pages::Glossary;
use crate::report::plots::{Scale, Series, chart};

/// Rows of the funnel: the counter, its name, and the counter that it is a part of.
const FUNNEL: [(&str, &str, &str); 24] = [
    ("vertices_in", "vertices read", ""),
    ("vertices_shaded", "vertices shaded", "vertices_in"),
    ("primitives_in", "primitives", ""),
    ("culled_backface", "\u{2212} facing away", "primitives_in"),
    ("culled_frustum", "\u{2212} outside the view", "primitives_in"),
    ("culled_degenerate", "\u{2212} degenerate", "primitives_in"),
    ("culled_scissor", "\u{2212} outside the scissor", "primitives_in"),
    ("culled_no_sample", "\u{2212} between samples", "primitives_in"),
    ("setup_culled", "+ culled after setup", "primitives_in"),
    ("setup_parts", "+ parts of clipped primitives", "primitives_in"),
    ("setup_copies", "+ copies in other pipelines", "primitives_in"),
    ("triangles_setup", "triangles set up", "primitives_in"),
    ("tiles_visited", "blocks of 8x8 visited", ""),
    ("tiles_hiz_culled", "\u{2212} hidden (hierarchical Z)", "tiles_visited"),
    ("quads_rasterized", "quads", ""),
    ("quads_early_culled", "\u{2212} hidden early", "quads_rasterized"),
    ("quads_hiz_culled", "of these by hierarchical Z", "quads_early_culled"),
    ("quads_shaded", "quads shaded", "quads_rasterized"),
    ("fragments_covered", "fragments covered", ""),
    ("fragments_shaded", "fragments shaded", "fragments_covered"),
    ("helper_fragments", "+ helper invocations", "fragments_shaded"),
    ("fragments_discarded", "\u{2212} discarded", "fragments_shaded"),
    ("fragments_late_failed", "\u{2212} hidden (late Z)", "fragments_shaded"),
    ("fragments_written", "fragments written", "fragments_covered"),
];

/// What went in, and where it was thrown away.
pub fn funnel(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let place = input.statistics.place();
    let n = |name: &str| number(frame, &format!("funnel.{name}")).unwrap_or(0.0);
    frame.get("funnel").is_some().then(|| {
        html! { div.scroll { table {
            thead { tr { th scope="col" { "stage" } th.n scope="col" { "count" } th.n scope="col" { "share" } th.wide scope="col" { "" } } }
            tbody { @for (name, text, of) in FUNNEL {
                tr {
                    td.name { (text) }
                    (cell(frame, &place, &format!("funnel.{name}")))
                    @if of.is_empty() { td.n {} td.wide {} } @else {
                        @let part = share(n(name), n(of));
                        td.n data-value=(part) title=(format!("of {}", of.replace('_', " "))) { (percent(part)) }
                        td.wide { (bar("bar", &[("b-read", part.min(1.0), percent(part))])) }
                    }
                }
            } }
        } } }
    })
}

/// The first-level caches and the second level.
pub fn caches(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let caches = frame.get("caches")?.as_object()?;
    let place = input.statistics.place();
    let columns = [
        Column("cache", false, ""),
        Column("units", true, "How many there are of it; the counts are their sum."),
        Column("lookups", true, ""),
        Column("hits", true, ""),
        Column("hit rate", true, ""),
        Column("misses", true, ""),
        Column("evictions", true, ""),
    ];
    Some(html! { div.scroll { table.sortable {
        (heads(&columns))
        tbody { @for (name, list) in caches {
            @let path = |leaf: &str| format!("caches.{name}[*].{leaf}");
            @let lookups = number(frame, &path("accesses")).unwrap_or(0.0);
            tr {
                td.name { (name) }
                td.n data-value=(list.as_array().map_or(0, Vec::len)) { (list.as_array().map_or(0, Vec::len)) }
                (cell(frame, &place, &path("accesses")))
                (cell(frame, &place, &path("hits")))
                @if lookups > 0.0 { (cell_share(share(number(frame, &path("hits")).unwrap_or(0.0), lookups))) } @else { td.n data-value="" { "\u{2013}" } }
                (cell(frame, &place, &path("misses")))
                (cell(frame, &place, &path("evictions")))
            }
        } }
    } } })
}

/// Bytes by client, and what the DRAM did.
pub fn memory(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let place = input.statistics.place();
    let n = |path: &str| number(frame, path).unwrap_or(0.0);
    let of = |name: &str, leaf: &str| n(&format!("memory.clients.{name}.{leaf}"));
    let mut clients: Vec<&str> = frame
        .get("memory")?
        .get("clients")
        .and_then(Value::as_object)
        .into_iter()
        .flatten()
        .map(|(name, _)| name.as_str())
        .collect();
    let sum = |name: &str| of(name, "read_bytes") + of(name, "write_bytes");
    clients.retain(|name| sum(name) > 0.0);
    clients.sort_by(|a, b| sum(b).total_cmp(&sum(a)).then(a.cmp(b)));
    let most = clients.first().map_or(0.0, |name| sum(name));
    let dram = n("memory.dram.row_hits") + n("memory.dram.row_misses");
    let columns = [
        Column("client", false, "The unit that asks."),
        Column("read", true, "Bytes read from the memory system."),
        Column("written", true, "Bytes written."),
        Column("requests", true, ""),
        Column("", false, ""),
    ];
    Some(html! {
        @if !clients.is_empty() {
            (key(&[("b-read", "read"), ("b-write", "written")]))
            div.scroll { table.sortable {
                (heads(&columns[..4]))
                tbody { @for name in &clients {
                    @let path = |leaf: &str| format!("memory.clients.{name}.{leaf}");
                    tr {
                        td.name { (name) }
                        (cell_bytes(frame, &place, &path("read_bytes")))
                        (cell_bytes(frame, &place, &path("write_bytes")))
                        (cell(frame, &place, &path("requests")))
                        td.wide { (bar("bar", &[
                            ("b-read", share(of(name, "read_bytes"), most), format!("read {} bytes", readable(of(name, "read_bytes")))),
                            ("b-write", share(of(name, "write_bytes"), most), format!("written {} bytes", readable(of(name, "write_bytes")))),
                        ])) }
                    }
                } }
            } }
        }
        div.scroll { table {
            thead { tr { th scope="col" { "DRAM" } th.n scope="col" { "read" } th.n scope="col" { "written" } th.n scope="col" { "row hits" } } }
            tbody { tr {
                td.name { "all channels" }
                (cell_bytes(frame, &place, "memory.dram.read_bytes"))
                (cell_bytes(frame, &place, "memory.dram.write_bytes"))
                @if dram > 0.0 { (cell_share(n("memory.dram.row_hits") / dram)) } @else { td.n data-value="" { "\u{2013}" } }
            } }
        } }
    })
}

/// Frames that the table lists.
const LISTED: usize = 200;

/// All frames, where there are several.
pub fn frames(input: &Input<'_>) -> Option<Markup> {
    let frames = input.statistics.frames();
    if frames.len() < 2 {
        return None;
    }
    let cycles = |frame: &Value| frame["cycles"].as_f64();
    let points: Vec<(f64, f64)> = frames.iter().filter_map(|frame| Some((frame["frame"].as_f64()?, cycles(frame)?))).collect();
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by(|&a, &b| cycles(&frames[b]).unwrap_or(0.0).total_cmp(&cycles(&frames[a]).unwrap_or(0.0)).then(a.cmp(&b)));
    order.truncate(LISTED);
    let columns = [
        Column("frame", true, "Its number in the trace."),
        Column("cycles", true, ""),
        Column("primitives", true, ""),
        Column("fragments shaded", true, ""),
        Column("fragments written", true, ""),
    ];
    Some(html! {
        div.two {
            @if !points.is_empty() {
                figure {
                    (chart("frame", "cycles", Scale::Linear, Scale::FromZero, &[Series { name: "cycles", points, line: true }]))
                    figcaption { "Cycles by frame. The page shows frame " (input.statistics.number()) "." }
                }
            }
            div.scroll.tall { table.sortable {
                (heads(&columns))
                tbody { @for at in &order {
                    @let (frame, place) = (&frames[*at], format!("frames[{at}]"));
                    tr { @for path in ["frame", "cycles", "funnel.primitives_in", "funnel.fragments_shaded", "funnel.fragments_written"] { (cell(frame, &place, path)) } }
                } }
            } }
        }
        @if frames.len() > LISTED { p.note { "The " (LISTED) " frames that cost most; all " (readable(frames.len() as f64)) " are in stats.json." } }
    })
}

/// Words that the page uses beside the names of statistics.
const TERMS: [(&str, &str); 12] = [
    ("busy", "The unit works in this cycle."),
    ("starved", "The unit has no input."),
    ("blocked", "The unit has output for which the next unit has no room."),
    ("waits for memory", "The unit waits for data from memory."),
    ("idle", "The unit has nothing to do until the frame ends."),
    (
        "phase",
        "What the command processor does one after another: a pass, a dispatch, transfers, or scan-out. Phases do not overlap.",
    ),
    ("quad", "2x2 pixels of one triangle, which are shaded together."),
    (
        "helper invocation",
        "An invocation of a quad's shader whose result is not used. It exists so that derivatives can be computed.",
    ),
    ("early Z", "The depth test before shading, by quads."),
    ("hierarchical Z", "The depth test before rasterization, by blocks of 8x8 pixels."),
    ("scan-out", "The reading of the picture for the display."),
    (
        "roofline",
        "The highest rate of instructions that memory bandwidth and cores allow, by instructions per byte (Williams et al. 2009).",
    ),
];

/// What the names on the page mean.
pub fn glossary(input: &Input<'_>) -> Option<Markup> {
    let glossary = Glossary::default();
    let mut found: BTreeMap<String, (&str, &str)> = BTreeMap::new();
    let mut add = |path: &str| {
        if let Some(declared) = glossary.find(path) {
            let plain: String = path.replace("[0]", "");
            found.insert(plain, (declared.meaning, declared.unit));
        }
    };
    let frame = input.statistics.frame();
    for place in ["funnel", "memory.dram"] {
        let names = super::data::at(frame, place).and_then(Value::as_object);
        names.into_iter().flatten().for_each(|(name, _)| add(&format!("{place}.{name}")));
    }
    for (bank, leaves) in [
        ("units", &["items", "busy", "starved", "blocked", "memory", "idle"][..]),
        ("channels", &["items", "bytes", "full_cycles", "mean_occupancy", "capacity"]),
        ("caches", &["accesses", "hits", "misses", "evictions"]),
    ] {
        if let Some((name, _)) = frame.get(bank).and_then(Value::as_object).and_then(|map| map.iter().next()) {
            leaves.iter().for_each(|leaf| add(&format!("{bank}.{name}[0].{leaf}")));
        }
    }
    let named = |path: &str| {
        let steps: Vec<&str> = path.split('.').collect();
        match steps[..] {
            [bank @ ("units" | "channels" | "caches"), _, leaf] => format!("{bank}.NAME.{leaf}"),
            _ => path.to_owned(),
        }
    };
    Some(html! {
        dl.terms { @for (term, meaning) in TERMS { dt { (term) } dd { (meaning) } } }
        details {
            summary { "Names of statistics" }
            dl.terms { @for (path, (meaning, unit)) in &found { dt { code { (named(path)) } } dd { (meaning) @if !unit.is_empty() { " (" (unit) ")" } } } }
        }
    })
}
