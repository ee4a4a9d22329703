//! Tables of what a frame counted: the funnel, caches, memory, all frames, and the meanings of the names.

use std::collections::BTreeMap;

use maud::{Markup, html};

use super::data::{CYCLES, CountedSpan};
use super::replay::Input;
use super::{Column, bar, cell, cell_bytes, cell_of, cell_share, heads, key, percent, readable, share};
use crate::mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, DRAM, DramCounts};
use crate::report::pages::Glossary;
use crate::report::peak::{MemoryPeak, MemoryRate};
use crate::report::plots::{Marks, Scale, Series, chart};
use crate::report::summary::{bin_rows, sorting_rows};
use crate::run::maps::MapKind;
use crate::sim::{CHANNELS, UNITS, UnitCounts};
use crate::stats::{Counter, Cycles, Declaration, Group, Heading, Key, Tree, counter};
use crate::work::{FUNNEL, Funnel};

/// A row of the funnel: the counter, its name, and the counter that it is a part of.
type Row = (Counter<Funnel>, &'static str, Option<Counter<Funnel>>);

/// Rows of the funnel.
const ROWS: [Row; 24] = [
    (counter!(Funnel, vertices_in), "vertices read", None),
    (counter!(Funnel, vertices_shaded), "vertices shaded", Some(counter!(Funnel, vertices_in))),
    (counter!(Funnel, primitives_in), "primitives", None),
    (counter!(Funnel, culled_backface), "\u{2212} facing away", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, culled_frustum), "\u{2212} outside the view", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, culled_degenerate), "\u{2212} degenerate", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, culled_scissor), "\u{2212} outside the scissor", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, culled_no_sample), "\u{2212} between samples", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, setup_culled), "+ culled after setup", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, setup_parts), "+ parts of clipped primitives", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, setup_copies), "+ copies in other pipelines", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, triangles_setup), "triangles set up", Some(counter!(Funnel, primitives_in))),
    (counter!(Funnel, tiles_visited), "blocks of 8x8 visited", None),
    (counter!(Funnel, tiles_hiz_culled), "\u{2212} hidden (hierarchical Z)", Some(counter!(Funnel, tiles_visited))),
    (counter!(Funnel, quads_rasterized), "quads", None),
    (counter!(Funnel, quads_early_culled), "\u{2212} hidden early", Some(counter!(Funnel, quads_rasterized))),
    (counter!(Funnel, quads_hiz_culled), "of these by hierarchical Z", Some(counter!(Funnel, quads_early_culled))),
    (counter!(Funnel, quads_shaded), "quads shaded", Some(counter!(Funnel, quads_rasterized))),
    (counter!(Funnel, fragments_covered), "fragments covered", None),
    (counter!(Funnel, fragments_shaded), "fragments shaded", Some(counter!(Funnel, fragments_covered))),
    (counter!(Funnel, helper_fragments), "+ helper invocations", Some(counter!(Funnel, fragments_shaded))),
    (counter!(Funnel, fragments_discarded), "\u{2212} discarded", Some(counter!(Funnel, fragments_shaded))),
    (counter!(Funnel, fragments_late_failed), "\u{2212} hidden (late Z)", Some(counter!(Funnel, fragments_shaded))),
    (counter!(Funnel, fragments_written), "fragments written", Some(counter!(Funnel, fragments_covered))),
];

/// What went in, and where it was thrown away.
pub fn funnel(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let place = input.statistics.place();
    let funnel: Funnel = FUNNEL.sum(&frame.counts);
    (!FUNNEL.find(&frame.counts).is_empty()).then(|| {
        html! { div.scroll { table {
            thead { tr { th scope="col" { "stage" } th.n scope="col" { "count" } th.n scope="col" { "share" } th.wide scope="col" { "" } } }
            tbody { @for (counter, text, of) in ROWS {
                tr {
                    td.name { (text) }
                    (cell(frame, &place, &FUNNEL.counter(counter)))
                    @match of {
                        None => { td.n {} td.wide {} },
                        Some(of) => {
                            @let part = share(counter.of(&funnel) as f64, of.of(&funnel) as f64);
                            td.n data-value=(part) title=(format!("of {}", of.name().replace('_', " "))) { (percent(part)) }
                            td.wide { (bar("bar", &[("b-read", part.min(1.0), percent(part))])) }
                        },
                    }
                }
            } }
        } } }
    })
}

/// The first-level caches and the second level.
pub fn caches(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let caches: Vec<_> = CACHES.banks(&frame.counts).collect();
    let place = input.statistics.place();
    let key = |counter, cache: &str| CACHES.counter(counter).of(cache);
    let columns = [
        Column("cache", false, ""),
        Column("units", true, "How many there are of it; the counts are their sum."),
        Column("lookups", true, ""),
        Column("hits", true, ""),
        Column("hit rate", true, ""),
        Column("misses", true, ""),
        Column("evictions", true, ""),
    ];
    (!caches.is_empty()).then(|| html! { div.scroll { table.sortable {
        (heads(&columns))
        tbody { @for (name, list) in caches {
            @let CacheCounts { accesses, hits, .. } = CACHES.sum_of(&frame.counts, name);
            tr {
                td.name { (name) }
                td.n data-value=(list.len()) { (list.len()) }
                (cell(frame, &place, &key(counter!(CacheCounts, accesses), name)))
                (cell(frame, &place, &key(counter!(CacheCounts, hits), name)))
                @if accesses > 0 { (cell_share(share(hits as f64, accesses as f64))) } @else { td.n data-value="" { "\u{2013}" } }
                (cell(frame, &place, &key(counter!(CacheCounts, misses), name)))
                (cell(frame, &place, &key(counter!(CacheCounts, evictions), name)))
            }
        } }
    } } })
}

/// A row of a rate beside its share of the peak; nothing where the machine is not known.
fn rate_cells(peak: Option<&MemoryPeak>, bytes: f64, cycles: f64) -> Markup {
    html! {
        @if let Some(peak) = peak {
            @let MemoryRate { gigabytes, share } = peak.rate(bytes, cycles);
            td.n data-value=(gigabytes) { (format!("{gigabytes:.2}")) }
            (cell_share(share))
        }
    }
}

/// Bytes by client, and what the DRAM did, with rates and their shares of the peak.
pub fn memory(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let place = input.statistics.place();
    let sum = |counts: &ClientCounts| (counts.read_bytes + counts.write_bytes) as f64;
    let clients = CLIENTS.banks(&frame.counts).map(|(name, _)| (name, CLIENTS.sum_of(&frame.counts, name)));
    let mut clients: Vec<(&str, ClientCounts)> = clients.filter(|(_, counts)| sum(counts) > 0.0).collect();
    clients.sort_by(|a, b| sum(&b.1).total_cmp(&sum(&a.1)).then(a.0.cmp(b.0)));
    let most = clients.first().map_or(0.0, |(_, counts)| sum(counts));
    if clients.is_empty() && DRAM.find(&frame.counts).is_empty() {
        return None;
    }
    let DramCounts { row_hits, row_misses, read_bytes, write_bytes, .. } = DRAM.sum(&frame.counts);
    let rows = row_hits + row_misses;
    let (peak, cycles) = (input.config.map(MemoryPeak::new), frame.cycles());
    let mut columns = vec![
        Column("client", false, "The unit that asks."),
        Column("read", true, "Bytes read from the memory system."),
        Column("written", true, "Bytes written."),
        Column("requests", true, ""),
    ];
    let rates = [
        Column("GB/s", true, "Bytes both ways, in 10^9 per second of the card's time."),
        Column("of peak", true, "The same as a share of what all DRAM channels move in bursts without gaps."),
    ];
    columns.extend(rates.into_iter().filter(|_| peak.is_some()));
    let all = clients.iter().map(|(_, counts)| sum(counts)).sum::<f64>();
    Some(html! {
        @if let Some(peak) = &peak {
            p { "The DRAM of this machine moves " (format!("{:.1}", peak.gigabytes())) " GB/s at most, its peak. Clients ask the second level, which serves what it has, so that they can have more than the DRAM." }
        }
        @if !clients.is_empty() {
            (key(&[("b-read", "read"), ("b-write", "written")]))
            div.scroll { table.sortable {
                (heads(&columns))
                tbody { @for (name, counts) in &clients {
                    @let key = |counter| CLIENTS.counter(counter).of(name);
                    @let [read, written] = [counts.read_bytes, counts.write_bytes].map(|bytes| bytes as f64);
                    tr {
                        td.name { (name) }
                        (cell_bytes(frame, &place, &key(counter!(ClientCounts, read_bytes))))
                        (cell_bytes(frame, &place, &key(counter!(ClientCounts, write_bytes))))
                        (cell(frame, &place, &key(counter!(ClientCounts, requests))))
                        (rate_cells(peak.as_ref(), read + written, cycles))
                        td.wide { (bar("bar", &[
                            ("b-read", share(read, most), format!("read {} bytes", readable(read))),
                            ("b-write", share(written, most), format!("written {} bytes", readable(written))),
                        ])) }
                    }
                } }
                @if peak.is_some() { tfoot { tr.sum { td.name { "all clients" } td {} td {} td {} (rate_cells(peak.as_ref(), all, cycles)) td.wide {} } } }
            } }
        }
        div.scroll { table {
            thead { tr {
                th scope="col" { "DRAM" } th.n scope="col" { "read" } th.n scope="col" { "written" } th.n scope="col" { "row hits" }
                @if peak.is_some() { th.n scope="col" { "GB/s" } th.n scope="col" { "of peak" } }
            } }
            tbody { tr {
                td.name { "all channels" }
                (cell_bytes(frame, &place, &DRAM.counter(counter!(DramCounts, read_bytes))))
                (cell_bytes(frame, &place, &DRAM.counter(counter!(DramCounts, write_bytes))))
                @if rows > 0 { (cell_share(row_hits as f64 / rows as f64)) } @else { td.n data-value="" { "\u{2013}" } }
                (rate_cells(peak.as_ref(), (read_bytes + write_bytes) as f64, cycles))
            } }
        } }
        @if peak.is_some() { p.note { "The table of passes has the rate of each phase." } }
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
    let cycles = |frame: &CountedSpan| CYCLES.sum(&frame.counts);
    let points: Vec<(f64, f64)> = frames.iter().filter_map(|frame| Some((frame.number? as f64, cycles(frame)?))).collect();
    let mut order: Vec<usize> = (0..frames.len()).collect();
    order.sort_by(|&a, &b| cycles(&frames[b]).unwrap_or(0.0).total_cmp(&cycles(&frames[a]).unwrap_or(0.0)).then(a.cmp(&b)));
    order.truncate(LISTED);
    let funnel = |counter| FUNNEL.counter(counter);
    let shown: [Key; 4] = [
        CYCLES,
        funnel(counter!(Funnel, primitives_in)),
        funnel(counter!(Funnel, fragments_shaded)),
        funnel(counter!(Funnel, fragments_written)),
    ];
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
                    (chart("frame", "cycles", Scale::Linear, Scale::FromZero, Marks::Round, &[Series { name: "cycles", points, line: true }]))
                    figcaption { "Cycles by frame. The page shows frame " (input.statistics.number()) "." }
                }
            }
            div.scroll.tall { table.sortable {
                (heads(&columns))
                tbody { @for at in &order {
                    @let (frame, place) = (&frames[*at], format!("frames[{at}]"));
                    tr {
                        (cell_of(frame.number.map(|number| number as f64), &format!("{place}.frame"), readable))
                        @for key in &shown { (cell(frame, &place, key)) }
                    }
                } }
            } }
        }
        @if frames.len() > LISTED { p.note { "The " (LISTED) " frames that cost most; all " (readable(frames.len() as f64)) " are in stats.json." } }
    })
}

/// Rows of a name, a value and a remark.
fn told(rows: &[[String; 3]]) -> Markup {
    html! {
        div.scroll { table.told { tbody { @for [name, value, rest] in rows {
            tr { th scope="row" { (name.trim_start()) } td.n { (value) } td { (rest) } }
        } } } }
    }
}

/// What the sort class cost.
pub fn sorting(input: &Input<'_>) -> Option<Markup> {
    let (frame, card) = (input.statistics.frame(), &input.config?.card);
    if UNITS.find(&frame.counts).is_empty() {
        return None;
    }
    let rows = sorting_rows(&frame.counts, card.sort);
    Some(html! {
        p { "This machine is of the class " b { (card.sort.name()) } ", with " (card.pipelines) @if card.pipelines == 1 { " pipeline." } @else { " pipelines." } }
        (told(&rows))
    })
}

/// The lists of tiles, where triangles are binned.
pub fn bins(input: &Input<'_>) -> Option<Markup> {
    let (frame, config) = (input.statistics.frame(), input.config?);
    let rows = bin_rows(&frame.counts, config.card.sort);
    if rows.is_empty() || UNITS.find(&frame.counts).is_empty() {
        return None;
    }
    Some(html! {
        p {
            "Triangles wait in lists of " (config.bin.tile) "\u{00d7}" (config.bin.tile) " pixels until their pass is complete, or until as much memory ("
            (readable(f64::from(config.bin.memory_kib))) " KiB) or as many segments (" (readable(f64::from(config.bin.segments))) ") as the machine keeps are in them. Then all lists are drawn: a partial render."
        }
        (told(&rows))
        @if input.maps.is_some_and(|maps| maps.surfaces.iter().any(|surface| surface.maps.iter().any(|map| map.kind == MapKind::Tile))) {
            p.note { "The heat map " b { "tile cost" } " has the cycles of each tile." }
        }
    })
}

/// Words that the page uses beside the names of statistics.
const TERMS: [(&str, &str); 26] = [
    (
        "busy",
        "The unit works in this cycle. A core is busy where its lanes take in an instruction; in other cycles it waits for what its oldest warp waits for.",
    ),
    ("starved", "The unit has no input."),
    ("blocked", "The unit has output for which the next unit has no room."),
    ("waits for memory", "The unit waits for data from memory."),
    (
        "waits for instructions",
        "A core holds warps, and the instructions that they have issued are not complete. More warps would hide this latency.",
    ),
    ("warp", "Invocations of a shader that a core executes together, one in each lane."),
    ("SIMT", "Single instruction, multiple threads: all lanes of a warp take the same instruction."),
    (
        "occupancy",
        "The warps that cores hold at a time, of their slots for warps. Slots, registers or workgroups may limit it.",
    ),
    ("idle", "The unit has nothing to do until the frame ends."),
    (
        "phase",
        "What the command processor does one after another: a pass, a dispatch, transfers, or scan-out. Phases do not overlap.",
    ),
    ("transfers", "Uploads, copies and clears outside passes."),
    ("limit", "The unit that needs most time for the work of a phase, by counts and rates."),
    ("waits", "No unit works nearly all the time: the unit that waits in most of its cycles, and for what."),
    ("frustum", "The part of space that is in view. Primitives outside are out of view."),
    ("overdraw", "Fragments per pixel of the picture, over all passes."),
    (
        "quad efficiency",
        "The share of invocations of fragment shaders that shade a fragment. The others are helper invocations.",
    ),
    ("channel", "A bounded FIFO between two units. Of DRAM: a part with a data bus of its own."),
    ("port", "The connection of a unit to the memory system. It carries some bytes per cycle and adds latency."),
    ("slice", "A part of the second-level cache with addresses of its own. Slices work side by side."),
    ("peak", "The rate at which all DRAM channels move bytes in bursts without gaps: channels x bytes per clock x clock."),
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
    let counts = &input.statistics.frame().counts;
    for heading in [FUNNEL, DRAM] {
        let names = heading.find(counts).into_iter().flat_map(Tree::entries);
        names.for_each(|(name, _)| add(&format!("{heading}.{name}")));
    }
    let first = |heading: Heading| heading.banks(counts).next();
    let mut declared = |heading: Heading, declarations: &[Declaration]| {
        let Some((name, _)) = first(heading) else { return };
        declarations.iter().for_each(|declaration| add(&heading.statistic(declaration).of(name).path("[0]")));
    };
    declared(UNITS, UnitCounts::DECLARATIONS);
    declared(UNITS, Cycles::DECLARATIONS);
    declared(CACHES, CacheCounts::DECLARATIONS);
    if let Some((name, [channel, ..])) = first(CHANNELS) {
        let place = CHANNELS.path.replace("NAME[i]", &format!("{name}[0]"));
        channel.entries().for_each(|(leaf, _)| add(&format!("{place}.{leaf}")));
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
