//! The time of a frame: its phases one after another, its passes and its draws.

use maud::{Markup, html};

use super::data::{CYCLES, CountedSpan};
use super::replay::{Input, Limit};
use super::targets;
use super::{Column, bar, cell, cell_behind, cell_of, cell_share, heads, key, percent, readable, share};
use crate::machine::{Moved, Spent};
use crate::mem::{CACHES, CacheCounts, DRAM};
use crate::report::peak::{MemoryPeak, MemoryRate};
use crate::report::rows::{GEOMETRY, TILES};
use crate::report::waits::{Waits, limited};
use crate::sim::UNITS;
use crate::stats::{Counter, FRAME, Key, counter};
use crate::unit::phase::PhaseKind;
use crate::work::{FUNNEL, Funnel};

/// The phases of a frame on a line, and what drawing and all else take.
pub fn time(input: &Input<'_>) -> Option<Markup> {
    let statistics = input.statistics;
    let frame = statistics.frame();
    let phases = &frame.parts;
    if phases.is_empty() {
        return None;
    }
    let all: f64 = phases.iter().map(CountedSpan::cycles).sum();
    let drawn: f64 = phases.iter().filter(|phase| phase.draws()).map(CountedSpan::cycles).sum();
    let class = |phase: &CountedSpan| if phase.draws() { "k-draw" } else { "k-other" };
    let strip: Vec<(&str, f64, String)> = phases
        .iter()
        .map(|phase| {
            let (cycles, part) = (phase.cycles(), share(phase.cycles(), all));
            (class(phase), part, format!("{}: {} cycles, {}", phase.name(), readable(cycles), percent(part)))
        })
        .collect();
    let kinds: Vec<(PhaseKind, f64, usize)> = [PhaseKind::Pass, PhaseKind::Dispatch, PhaseKind::Transfers, PhaseKind::ScanOut]
        .into_iter()
        .map(|kind| {
            let own = phases.iter().filter(|phase| phase.is(kind));
            (kind, own.clone().map(CountedSpan::cycles).sum(), own.count())
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
                @let own = if matches!(kind, PhaseKind::Pass | PhaseKind::Dispatch) { "k-draw" } else { "k-other" };
                tr { td.name { (kind.name()) } td.n { (count) } td.n data-value=(sum) { (readable(*sum)) } (cell_share(share(*sum, all)))
                    td { (bar("bar", &[(own, share(*sum, all), percent(share(*sum, all)))])) } }
            } }
        } }
    })
}

const fn counted(counter: Counter<Funnel>) -> Key {
    FUNNEL.counter(counter)
}

const fn cached(cache: &'static str, counter: Counter<CacheCounts>) -> Key {
    CACHES.named(cache).counter(counter)
}

/// Statistics of phases and draws that are columns, with their headings. What is 0 everywhere is left out.
const COLUMNS: [(Key, &str); 13] = [
    (counted(counter!(Funnel, vertices_shaded)), "vertices shaded"),
    (counted(counter!(Funnel, triangles_setup)), "triangles set up"),
    (counted(counter!(Funnel, quads_rasterized)), "quads"),
    (counted(counter!(Funnel, quads_early_culled)), "quads hidden early"),
    (counted(counter!(Funnel, fragments_shaded)), "fragments shaded"),
    (counted(counter!(Funnel, helper_fragments)), "helpers"),
    (counted(counter!(Funnel, fragments_written)), "fragments written"),
    (DRAM.counter(counter!(Moved, read_bytes)), "bytes from DRAM"),
    (DRAM.counter(counter!(Moved, write_bytes)), "bytes to DRAM"),
    (cached("texture", counter!(CacheCounts, accesses)), "texture lookups"),
    (cached("texture", counter!(CacheCounts, misses)), "texture misses"),
    (cached("vertex", counter!(CacheCounts, misses)), "vertex misses"),
    (cached("l2", counter!(CacheCounts, misses)), "L2 misses"),
];

/// The two halves of a draw's cycles on a machine that bins, with their headings and what they are.
const HALVES: [(Key, &str, &str); 2] = [
    (
        FRAME.statistic(&GEOMETRY),
        "geometry half",
        "Its share of the cycles before tiles are drawn, by vertices shaded and primitives.",
    ),
    (FRAME.statistic(&TILES), "tile half", "Its share of the cycles in which tiles are drawn, by triangles set up and quads."),
];

/// The columns that some of these entries have.
fn columns(entries: &[&CountedSpan]) -> Vec<(Key, &'static str)> {
    let has = |key: &Key| entries.iter().any(|entry| key.sum(&entry.counts).is_some_and(|value| value != 0.0));
    COLUMNS.into_iter().filter(|(key, _)| has(key)).collect()
}

/// The heads of these columns, each with the path of its statistic.
fn heads_of(columns: &[(Key, &'static str)]) -> Vec<(&'static str, String)> {
    columns.iter().map(|(key, name)| (*name, key.path(""))).collect()
}

/// The unit of a span that was busy in the largest share of its cycles, and that share: how far it is used, not what limits. `frame` tells how
/// many there are of each.
fn most_used<'v>(entry: &'v CountedSpan, frame: &CountedSpan) -> Option<(&'v str, f64)> {
    let busy = UNITS.counter(counter!(Spent, busy));
    let units = UNITS.banks(&entry.counts).filter_map(|(name, _)| {
        let count = UNITS.find_of(&frame.counts, name).len().max(1);
        Some((name, busy.of(name).sum(&entry.counts)? / (entry.cycles() * count as f64)))
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
fn used_cell(entry: &CountedSpan, frame: &CountedSpan) -> Markup {
    html! { td.unit { @match most_used(entry, frame) { Some((unit, share)) => { (unit) " " span.note { (percent(share)) } }, None => "\u{2013}" } } }
}

/// The estimate of what limits a phase.
fn estimated<'i>(input: &'i Input<'_>, at: usize, phase: &CountedSpan) -> Option<&'i Limit> {
    input.limits.get(at).filter(|own| own.name == phase.name())
}

/// What limits a phase, by estimate, or what it waits for, as counted, with the word for it.
pub fn named_limit(input: &Input<'_>, at: usize, phase: &CountedSpan) -> Option<(&'static str, String)> {
    let told = || Some(phase.limit.as_str()).filter(|told| !told.is_empty());
    let limit = estimated(input, at, phase).map(|own| own.unit.as_str()).or_else(told)?;
    let (word, what) = limited(limit, &Waits::of(&phase.counts));
    Some((word, what.into_owned()))
}

/// What limits a phase: the unit, or what is waited for.
fn unit_limit(input: &Input<'_>, at: usize, phase: &CountedSpan) -> Option<String> {
    named_limit(input, at, phase).map(|(word, what)| if word == "waits" { format!("waits: {what}") } else { what })
}

/// What limits a phase, and the evidence.
fn limit(input: &Input<'_>, at: usize, phase: &CountedSpan) -> Markup {
    html! {
        td.reason {
            @match estimated(input, at, phase) {
                Some(own) => {
                    b { (unit_limit(input, at, phase).unwrap_or_default()) }
                    @let next = own.next.as_ref().map_or(String::new(), |(unit, cycles)| format!("; next {unit}, {}", readable(cycles.round())));
                    @if own.work > 0.0 { span.note { " about " (readable(own.work.round())) " cycles of work by estimate" (next) } }
                },
                None => @match unit_limit(input, at, phase) { Some(unit) => b { (unit) }, None => span.note { "\u{2013}" } },
            }
        }
    }
}

/// The cell of a counter of a phase or a draw. Where these have counters, those that are 0 are left out of the file.
fn counted_cell(entry: &CountedSpan, base: &str, key: &Key) -> Markup {
    if key.sum(&entry.counts).is_none() && entry.is_counted() {
        return html! { td.n data-value="0" { "0" } };
    }
    cell(entry, base, key)
}

/// The table of phases, those that take most first, with what was counted in each.
fn phases(input: &Input<'_>) -> Option<Markup> {
    let statistics = input.statistics;
    let frame = statistics.frame();
    let phases = &frame.parts;
    let all: f64 = phases.iter().map(CountedSpan::cycles).sum();
    let mut order: Vec<usize> = (0..phases.len()).collect();
    order.sort_by(|&a, &b| phases[b].cycles().total_cmp(&phases[a].cycles()).then(a.cmp(&b)));
    let more = columns(&phases.iter().collect::<Vec<_>>());
    let counted = phases.iter().any(CountedSpan::is_counted);
    let mut titles = vec![
        Column("phase", false, "Passes and dispatches have their numbers in the frame, from 0."),
        Column("order", true, "Its place in the frame."),
        Column("cycles", true, "From its beginning to that of the next."),
        Column("share", true, "Of the cycles of the frame."),
        Column(
            "limited by",
            false,
            "The unit whose work takes most time by counts and rates. Where none works nearly all the time, what the unit that waits most waits for, as counted.",
        ),
    ];
    if counted {
        titles.push(USED);
    }
    let peak = input.config.map(MemoryPeak::new).filter(|_| counted);
    if peak.is_some() {
        titles.push(Column("DRAM GB/s", true, "Bytes of DRAM both ways, in 10^9 per second of the card's time."));
        titles.push(Column("of peak", true, "The same as a share of what all channels move in bursts without gaps."));
    }
    let named = heads_of(&more);
    titles.extend(named.iter().map(|(name, path)| Column(name, true, path)));
    (!phases.is_empty()).then(|| {
        html! {
            div.scroll.tall { table.sortable id="passes" data-shown=(SHOWN_OF_PASSES.join("|")) {
                (heads(&titles))
                tbody { @for at in order {
                    @let phase = &phases[at];
                    @let base = format!("{}.phases[{at}]", statistics.place());
                    tr {
                        td.name { (phase.name()) }
                        td.n data-value=(at) { (at + 1) }
                        (cell(phase, &base, &CYCLES))
                        (cell_share(share(phase.cycles(), all)))
                        (limit(input, at, phase))
                        @if counted { (used_cell(phase, frame)) }
                        @if let Some(peak) = &peak {
                            @let MemoryRate { gigabytes, share } = peak.rate(moved(phase), phase.cycles());
                            td.n data-value=(gigabytes) { (format!("{gigabytes:.2}")) }
                            (cell_share(share))
                        }
                        @for (key, _) in &more { (counted_cell(phase, &base, key)) }
                    }
                } }
            } }
        }
    })
}

/// Bytes of DRAM both ways.
fn moved(of: &CountedSpan) -> f64 {
    let Moved { read_bytes, write_bytes } = DRAM.sum(&of.counts);
    (read_bytes + write_bytes) as f64
}

/// Columns of passes that the page shows at first. The others can be chosen.
const SHOWN_OF_PASSES: [&str; 8] =
    ["phase", "cycles", "share", "limited by", "most used", "DRAM GB/s", "of peak", "fragments shaded"];

/// Columns of draws that the page shows at first. The others can be chosen.
const SHOWN: [&str; 10] =
    ["draw", "label", "made", "pass", "cycles", "share", "most used", "out of view", "fragments shaded", "bytes from DRAM"];

/// The primitives of a draw that are out of view, as a share of all.
fn out_of_view(draw: &CountedSpan) -> Option<(u64, u64)> {
    let Funnel { primitives_in, culled_frustum, .. } = FUNNEL.sum(&draw.counts);
    (primitives_in > 0).then_some((culled_frustum, primitives_in))
}

/// The name of a draw, with its pipeline and the debug group around it.
fn label(draw: &CountedSpan) -> String {
    let end = if draw.number.is_none() { "end of the pass" } else { "" };
    [draw.group.as_str(), &draw.label, end].into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join(" / ")
}

/// The table of draws, where the replay reported each draw (`--per-draw`). The row of draw N has the id `draw-N`.
fn draw_table(input: &Input<'_>) -> Option<Markup> {
    /// Draws that are listed: those with most cycles.
    const MOST: usize = 1000;
    let statistics = input.statistics;
    let frame = statistics.frame();
    let phases = frame.parts.iter().enumerate();
    let mut draws: Vec<(usize, usize, &CountedSpan, &CountedSpan)> =
        phases.flat_map(|(at, phase)| phase.parts.iter().enumerate().map(move |(own, draw)| (at, own, phase, draw))).collect();
    if draws.is_empty() {
        return None;
    }
    let all: f64 = draws.iter().map(|(.., draw)| draw.cycles()).sum();
    // In a stable order: of equal ones the first.
    draws.sort_by(|a, b| b.3.cycles().total_cmp(&a.3.cycles()));
    let most = draws[0].3.cycles();
    let left = draws.len().saturating_sub(MOST);
    draws.truncate(MOST);
    let more = columns(&draws.iter().map(|(.., draw)| *draw).collect::<Vec<_>>());
    let halves = draws.iter().any(|(.., draw)| HALVES.iter().any(|(key, ..)| key.sum(&draw.counts).is_some()));
    let passes = draws.iter().any(|(at, ..)| *at != draws[0].0);
    let mut titles = vec![
        Column("draw", true, "Its number in the frame, from 0; what follows the last draw of a pass has none."),
        Column("label", false, "Its pipeline, and the debug group around it."),
        Column(
            "made",
            false,
            "Where its command was made: a call of the recording, a line of a wgpu trace, a block of a capture, a command of a native trace.",
        ),
    ];
    if passes {
        titles.push(Column(
            "pass",
            true,
            "The table of passes has the limit of each pass: its draws are in the machine together.",
        ));
    }
    titles.push(Column(
        "cycles",
        true,
        if halves {
            "Its shares of the geometry half and of the tile half."
        } else {
            "From the retirement before it to its own."
        },
    ));
    titles.push(Column("share", true, "Of the cycles of all draws."));
    if halves {
        titles.extend(HALVES.map(|(_, name, about)| Column(name, true, about)));
    }
    // Draws that retire together have no cycles of units.
    let used = draws.iter().any(|(.., draw)| most_used(draw, frame).is_some());
    titles.extend(used.then_some(USED));
    titles.push(Column("out of view", true, "Primitives that lie outside the view, of those that the draw has."));
    let named = heads_of(&more);
    titles.extend(named.iter().map(|(name, path)| Column(name, true, path)));
    let number =
        |of: &CountedSpan, base: &str| cell_of(of.number.map(|number| number as f64), &format!("{base}.number"), readable);
    let shown = SHOWN.into_iter().chain(HALVES.map(|(_, name, _)| name)).collect::<Vec<_>>().join("|");
    Some(html! {
        h3 { "Draws" }
        @if halves { p.note { "This machine bins, so that draws retire together: each has a share of the cycles by its work. What cannot be told apart is blank, and the end of the pass has it." } }
        @if left > 0 { p.note { "The " (readable(MOST as f64)) " draws with most cycles; " (readable(left as f64)) " more are in draws.csv." } }
        p.note.script { "A click on a row selects its draw on the whole page." }
        div.scroll.tall { table.sortable id="draws" data-shown=(shown) data-sorted="cycles" {
            (heads(&titles))
            tbody { @for (at, own, phase, draw) in &draws {
                @let pass = format!("{}.phases[{at}]", statistics.place());
                @let base = format!("{pass}.draws[{own}]");
                @let name = draw.number.map(|number| format!("{}: {} cycles", [format!("draw {number}"), label(draw), phase.name()].into_iter().filter(|text| !text.is_empty()).collect::<Vec<_>>().join(", "), readable(draw.cycles())));
                tr id=[draw.number.map(|number| format!("draw-{number}"))] data-draw=[draw.number] data-name=[name] {
                    (number(draw, &base))
                    td.name { (label(draw)) }
                    td.name { (draw.site) }
                    @if passes { (number(phase, &pass)) }
                    (cell_behind(CYCLES.sum(&draw.counts), &format!("{base}.{}", CYCLES.path(draw.units)), share(draw.cycles(), most)))
                    (cell_share(share(draw.cycles(), all)))
                    @if halves { @for (key, ..) in &HALVES { (cell(draw, &base, key)) } }
                    @if used { (used_cell(draw, frame)) }
                    @match out_of_view(draw) {
                        Some((out, primitives)) => td.n data-value=(share(out as f64, primitives as f64)) title=(format!("{} of {} primitives", readable(out as f64), readable(primitives as f64))) { (percent(share(out as f64, primitives as f64))) },
                        None => td.n data-value="" { "\u{2013}" },
                    }
                    @for (key, _) in &more { @if halves { (cell(draw, &base, key)) } @else { (counted_cell(draw, &base, key)) } }
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
        @if let Some(targets) = input.targets { @if let Some(pictures) = targets::section(targets) { (pictures) } }
        @match draw_table(input) {
            Some(draws) => (draws),
            None => p.note { "Draws have no cycles of their own in these statistics: replay with " code { "--per-draw" } "." },
        }
    })
}
