//! The short text that a replay prints.

mod phases;

pub use phases::{Phases, draw, draw_json};

use crate::machine::class::{Class, Sorted};
use crate::machine::config::SortClass;
use crate::machine::{LossCounts, PassOrderCounts, SORTING, SORTING_LOSS, SortOutcome};
use crate::mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, DRAM, DramCounts};
use crate::report::peak::{MemoryPeak, MemoryRate};
use crate::run::sample::clusters::LEVEL;
use crate::run::sample::survey::Count;
use crate::run::sample::{Margin, Quantity, Sampled};
use crate::sim::UNITS;
use crate::stats::{Cycles, FRAME, FrameCounts, Group, Tree, counter};
use crate::unit::bin::{BINNING, BinCounts};
use crate::unit::core::{CORES, CoreCounts};
use crate::unit::early::{EARLY_TESTS, EarlyCounts};
use crate::unit::sorting::{OrderCounts, SortCounts};
use crate::work::Funnel;

/// Writes the funnel: what went in, and what was thrown away where. A row is the row before it, less what that one lists, and what the row itself
/// lists with a plus.
pub fn funnel(n: &Funnel) -> String {
    let mut text = String::new();
    let mut row = |name: &str, count: u64, of: u64, parts: &[(&str, u64)]| {
        let part = |(why, n): &(&str, u64)| match why.strip_prefix('+') {
            Some(why) => format!("+{}{why}", grouped(*n)),
            None => format!("{} {why}", grouped(*n)),
        };
        let parts: Vec<String> = parts.iter().filter(|(_, n)| *n > 0).map(part).collect();
        let share = if of > 0 && of != count { format!("{:.1} %", 100.0 * count as f64 / of as f64) } else { String::new() };
        let line = format!("  {name:<22}{:>14}  {share:>8}   {}", grouped(count), parts.join(", "));
        text.push_str(line.trim_end());
        text.push('\n');
    };
    row("vertices read", n.vertices_in, 0, &[]);
    row("  shaded", n.vertices_shaded, n.vertices_in, &[]);
    row(
        "primitives",
        n.primitives_in,
        0,
        &[
            ("facing away", n.culled_backface),
            ("out of view", n.culled_frustum),
            ("degenerate", n.culled_degenerate),
            ("scissored", n.culled_scissor),
            ("between samples", n.culled_no_sample),
        ],
    );
    row(
        "triangles set up",
        n.triangles_setup,
        n.primitives_in,
        &[
            ("+ culled after setup", n.setup_culled),
            ("+ parts of clipped primitives", n.setup_parts),
            ("+ copies in other pipelines", n.setup_copies),
            ("primitives clipped", n.clipped),
        ],
    );
    row("blocks of 8x8", n.tiles_visited, 0, &[("behind (hierarchical Z)", n.tiles_hiz_culled)]);
    let [quads, fragments] = [n.quads_rasterized.saturating_sub(n.quads_early_culled), n.fragments_covered];
    row(
        "quads",
        n.quads_rasterized,
        0,
        &[
            ("rejected early", n.quads_early_culled),
            ("of them by hierarchical Z", n.quads_hiz_culled),
            ("without shading", quads.saturating_sub(n.quads_shaded)),
        ],
    );
    row("  shaded", n.quads_shaded, n.quads_rasterized, &[]);
    row("fragments covered", fragments, 0, &[("in quads that are not shaded", fragments.saturating_sub(n.fragments_shaded))]);
    row(
        "  shaded",
        n.fragments_shaded,
        fragments,
        &[("discarded", n.fragments_discarded), ("behind (late tests)", n.fragments_late_failed)],
    );
    let left = n.fragments_shaded.saturating_sub(n.fragments_discarded + n.fragments_late_failed);
    row("  written", n.fragments_written, fragments, &[("+ without shading", n.fragments_written.saturating_sub(left))]);
    row("helper invocations", n.helper_fragments, 0, &[]);
    text
}

/// Writes how busy each kind of unit was and what it did in its other cycles, the largest share of busy cycles first; units of one kind
/// are averaged.
pub fn units(total: &Tree) -> String {
    if UNITS.find(total).is_empty() {
        return String::new();
    }
    let mut rows: Vec<(&str, usize, [f64; 6])> = Vec::new();
    for (name, list) in UNITS.banks(total) {
        let Cycles { busy, starved, blocked, memory, latency, idle } = UNITS.sum_of(total, name);
        let sum = [busy, starved, blocked, memory, latency, idle].map(|cycles| cycles as f64);
        let all: f64 = sum.iter().sum();
        if all > 0.0 {
            rows.push((name, list.len(), sum.map(|n| 100.0 * n / all)));
        }
    }
    rows.sort_by(|a, b| b.2[0].total_cmp(&a.2[0]));
    let mut text =
        format!("  {:<26}{:>8}{:>9}{:>9}{:>9}{:>9}{:>8}\n", "unit", "busy", "starved", "blocked", "memory", "latency", "idle");
    for (name, count, share) in &rows {
        let name = if *count > 1 { format!("{name} x{count}") } else { (*name).to_owned() };
        let [busy, starved, blocked, memory, latency, idle] = share;
        text.push_str(&format!(
            "  {name:<26}{busy:>6.1} %{starved:>7.1} %{blocked:>7.1} %{memory:>7.1} %{latency:>7.1} %{idle:>6.1} %\n"
        ));
    }
    text.push_str(
        "  starved: no input; blocked: no room in the output; memory: waits for data from memory; latency: a core's warps wait for\n  \
         their instructions; idle: nothing left to do\n",
    );
    text.push_str(&cores(total));
    text.push_str("  A busy unit need not limit the frame: `fillrate why` shows what does.\n");
    text
}

/// How many instructions cores issued and how many warps they held, in words.
pub fn occupancy(counts: &CoreCounts, cores: Cycles) -> Vec<String> {
    let CoreCounts { float, integer, special, control, multiply, warp_cycles, slot_cycles, texture_waits, .. } = *counts;
    let per = |part: u64, all: u64| part as f64 / all.max(1) as f64;
    let cycles = cores.total();
    let mut said = vec![
        format!("{:.2} instructions issued per cycle and core", per(float + integer + special + control + multiply, cycles)),
        format!(
            "{:.1} of {:.0} warps held ({:.0} %)",
            per(warp_cycles, cycles),
            per(slot_cycles, cycles),
            100.0 * per(warp_cycles, slot_cycles)
        ),
    ];
    if 100 * cores.memory >= cycles.max(1) {
        said.push(format!(
            "{:.0} % of the waits for memory are for the texture unit",
            100.0 * per(texture_waits, cores.memory)
        ));
    }
    said.push(match full(counts, cycles) {
        Some((what, share)) => format!("{what} limit the warps in {:.0} % of the cycles", 100.0 * share),
        None => "no warp waits outside for long".into(),
    });
    said
}

/// What keeps warps outside in most of the cycles in which any waits there, and the share of these; none if that is less than a hundredth.
fn full(counts: &CoreCounts, cycles: u64) -> Option<(&'static str, f64)> {
    let kinds =
        [("slots for warps", counts.full_warps), ("registers", counts.full_registers), ("workgroups", counts.full_workgroups)];
    let most = kinds.into_iter().rev().max_by_key(|(_, cycles)| *cycles)?;
    let share = most.1 as f64 / cycles.max(1) as f64;
    (share >= 0.01).then_some((most.0, share))
}

/// A line about the warps of cores; none where there are no cores.
fn cores(total: &Tree) -> String {
    let counts: CoreCounts = CORES.sum(total);
    if counts.slot_cycles == 0 {
        return String::new();
    }
    format!("  core: {}\n", occupancy(&counts, UNITS.sum_of(total, "core")).join("; "))
}

/// Writes the bytes that each client moved, and what the DRAM did, with rates over all cycles and their shares of the DRAM's peak.
pub fn memory(total: &Tree, peak: &MemoryPeak) -> String {
    let FrameCounts { cycles } = FRAME.sum(total);
    let line = |name: &str, read: f64, written: f64| {
        let MemoryRate { gigabytes, share } = peak.rate(read + written, cycles as f64);
        let [read, written] = [read, written].map(bytes);
        format!("  {name:<26}{read:>14}{written:>14}{gigabytes:>10.2}{:>9.1} %", 100.0 * share)
    };
    let mut text = String::new();
    let moved = |(name, _)| {
        let ClientCounts { read_bytes, write_bytes, .. } = CLIENTS.sum_of(total, name);
        (name, read_bytes as f64, write_bytes as f64)
    };
    let mut rows: Vec<(&str, f64, f64)> = CLIENTS.banks(total).map(moved).collect();
    if !rows.is_empty() {
        rows.retain(|(_, read, write)| read + write > 0.0);
        rows.sort_by(|a, b| (b.1 + b.2).total_cmp(&(a.1 + a.2)));
        text.push_str(&format!("  {:<26}{:>14}{:>14}{:>10}{:>11}\n", "client", "read", "written", "GB/s", "of peak"));
        for (name, read, write) in &rows {
            text.push_str(&format!("{}\n", line(name, *read, *write)));
        }
        let [read, written] = [1, 2].map(|at| rows.iter().map(|row| if at == 1 { row.1 } else { row.2 }).sum());
        text.push_str(&format!("{}\n", line("all clients", read, written)));
    }
    let dram: DramCounts = DRAM.sum(total);
    let rows = dram.row_hits + dram.row_misses;
    if dram.read_bytes + dram.write_bytes > 0 {
        text.push_str(&line("DRAM", dram.read_bytes as f64, dram.write_bytes as f64));
        if rows > 0 {
            text.push_str(&format!("   row hits {:.1} %", 100.0 * dram.row_hits as f64 / rows as f64));
        }
        text.push('\n');
    }
    if !text.is_empty() {
        text.push_str(&format!(
            "  peak: {:.1} GB/s, what all DRAM channels move in bursts without gaps; the second level serves clients beside that\n",
            peak.gigabytes()
        ));
    }
    text
}

/// Writes what the sort class cost: copies and their bytes, uneven load, reorder stalls, the network, wrong pixels.
pub fn sorting(total: &Tree, class: SortClass, pipelines: u32) -> String {
    let s = if pipelines == 1 { "" } else { "s" };
    let mut out = format!("  {}, {pipelines} pipeline{s}\n", class.name());
    for [name, value, rest] in sorting_rows(total, class) {
        // A long name takes room of its value's column.
        let left = 40usize.saturating_sub(name.len());
        out.push_str(format!("  {name}{value:>left$}   {rest}").trim_end());
        out.push('\n');
    }
    out
}

/// Names of the rows about lists of tiles.
const LISTED: [&str; 4] = ["entries in tiles' lists", "triangles and lists", "tiles drawn", "partial renders"];

/// Of [`sorting_rows`] those about the lists of tiles; none where triangles are not binned.
pub fn bin_rows(total: &Tree, class: SortClass) -> Vec<[String; 3]> {
    let rows = if class.class().one_place { sorting_rows(total, class) } else { Vec::new() };
    rows.into_iter().filter(|[name, ..]| LISTED.contains(&name.as_str())).collect()
}

/// What the sort class cost: a name, a value, and what else is to say of it.
pub fn sorting_rows(total: &Tree, class: SortClass) -> Vec<[String; 3]> {
    let Class { sorted: items, one_place, .. } = class.class();
    let outcome = SortOutcome::read(total);
    let mut out: Vec<[String; 3]> = Vec::new();
    let mut row = |name: &str, value: String, rest: String| out.push([name.to_owned(), value, rest]);
    let sort: SortCounts = SORTING.sum(total);
    let share = |part: u64, all: u64| if all > 0 { 100.0 * part as f64 / all as f64 } else { 0.0 };
    let size = |n: u64| bytes(n as f64);

    // 1. What was sorted, and sent how often.
    let SortCounts { sorted_items: sorted, sent, redistributed_items: copies, .. } = sort;
    let nowhere = if sent < sorted { format!("{} of them sent nowhere", grouped(sorted - sent)) } else { String::new() };
    row(&format!("{} sorted", items.items()), grouped(sorted), nowhere);
    let copied = if *one_place { LISTED[0] } else { "copies sent" };
    let overlap = if sent > 0 { copies as f64 / sent as f64 } else { 0.0 };
    row(copied, grouped(copies), format!("overlap {overlap:.3}; {}", size(sort.redistributed_bytes)));
    if *one_place {
        let bin: BinCounts = BINNING.sum(total);
        let written = size(bin.triangle_bytes + bin.list_bytes);
        row(LISTED[1], written, format!("written; {} read back", size(bin.read_bytes)));
        row(LISTED[2], grouped(bin.tiles), format!("and {} empty tiles", grouped(bin.empty_tiles)));
        let causes = [bin.memory_full, bin.segments_full].map(grouped);
        let causes = format!("{} because memory was full, {} because of as many segments", causes[0], causes[1]);
        row(LISTED[3], grouped(bin.partial_renders), causes);
    } else {
        let away = format!("{:.1} %; {}", share(sort.foreign_items, copies), size(sort.foreign_bytes));
        row("  to another pipeline", grouped(sort.foreign_items), away);
    }

    let early: EarlyCounts = EARLY_TESTS.sum(total);
    if early.asked > 0 {
        let asked = size(early.question_bytes + early.answer_bytes);
        let behind = share(early.culled, early.asked);
        let culled = format!("{} behind, {behind:.1} %; {asked} asked and answered", grouped(early.culled));
        row("quads tested early", grouped(early.asked), culled);
    }
    if *items == Sorted::Images {
        let PassOrderCounts { passes_needing_order: passes } = SORTING.sum(total);
        row("passes needing order", grouped(passes), outcome.passes_out_of_order);
    }

    // 2. Where the pipelines' cycles went.
    let loss: LossCounts = SORTING_LOSS.sum(total);
    if loss.pipeline_cycles > 0 {
        let at = |cycles: u64| format!("{:.1} %", share(cycles, loss.pipeline_cycles));
        row("pipelines' cycles used", at(loss.useful), format!("measured at {}", outcome.stage));
        // All that the counters declare beside the sum and the use.
        let others = LossCounts { pipeline_cycles: 0, useful: 0, ..loss };
        for (part, cycles) in others.named().filter(|&(_, cycles)| cycles > 0) {
            let outside = part == counter!(LossCounts, outside_pass).name();
            let name = if outside { "outside the pass".into() } else { part.replace('_', " ") };
            row(&format!("  lost to {name}"), at(cycles), String::new());
        }
    }

    // 3. What else it cost.
    let imbalance = format!("{:.3}", outcome.load_imbalance);
    row("load imbalance", imbalance, "quads of the busiest pipeline, divided by the mean".to_owned());
    let order: OrderCounts = SORTING.sum(total);
    let stalls = grouped(order.order_waiting_cycles);
    row("reorder stalls", stalls, "cycles, summed over the units that restore order".to_owned());
    if let Some(traffic) = SortOutcome::network(total).filter(|traffic| traffic.carried.hops > 0) {
        let busiest = format!("{:.1} %", 100.0 * traffic.hottest);
        let mean = 100.0 * traffic.mean;
        row("busiest link of the network", busiest, format!("{}; mean of all {mean:.1} %", traffic.hot_spot));
    }
    row("wrong pixels", grouped(outcome.wrong_pixels), "pixels that differ from API order".to_owned());
    out
}

/// Writes shares that sum a drawing up: the overdraw of the pictures, the share of invocations that shaded a fragment, and the hit rates of
/// caches.
pub fn shares(total: &Tree, funnel: &Funnel, picture: Option<&Pictures>) -> String {
    let mut text = String::new();
    let mut row = |name: &str, value: String| text.push_str(&format!("  {name:<22}{value}\n"));
    if let Some(Pictures { width, height, frames, same }) = picture {
        let size = format!("{width} x {height} pixels{}", if *same { "" } else { ", the first of several sizes" });
        row("picture", size);
        let pixels = (u64::from(*width) * u64::from(*height) * frames) as f64;
        if *same && pixels > 0.0 {
            let [covered, shaded] = [funnel.fragments_covered, funnel.fragments_shaded].map(|n| n as f64 / pixels);
            row(
                "overdraw",
                format!("{covered:.2} fragments covered per pixel of the picture, {shaded:.2} shaded (all passes)"),
            );
        }
    }
    let invocations = funnel.fragments_shaded + funnel.helper_fragments;
    if invocations > 0 {
        let share = 100.0 * funnel.fragments_shaded as f64 / invocations as f64;
        row("quad efficiency", format!("{share:.1} % of the invocations shade a fragment, the others are helper invocations"));
    }
    let mut counts = CACHES.banks(total).map(|(name, _)| (name, CACHES.sum_of::<CacheCounts>(total, name))).peekable();
    if counts.peek().is_some() {
        let rate = |(name, counts): (&str, CacheCounts)| {
            format!("{name} {:.1} %", 100.0 * counts.hits as f64 / counts.accesses as f64)
        };
        let rates: Vec<String> = counts.filter(|(_, counts)| counts.accesses > 0).map(rate).collect();
        row("hit rates of caches", rates.join(", "));
    }
    text
}

/// What is known of the pictures of frames.
#[derive(Clone, Copy, Debug)]
pub struct Pictures {
    /// Width of the first.
    pub width: u32,
    /// Its height.
    pub height: u32,
    /// How many there are.
    pub frames: u64,
    /// Whether all have this size.
    pub same: bool,
}

/// What a sampled replay estimates, with the margins of its intervals.
pub fn sampled(sampled: &Sampled) -> String {
    let from = format!("{} of {} frames ({} simulated)", sampled.counted, sampled.frames, sampled.simulated);
    let mut out = format!("  from {from}; intervals hold with a probability of {:.1} %\n", 100.0 * LEVEL);
    for Margin { of, value, margin } in &sampled.margins {
        let name = of.to_string();
        match of {
            Quantity::HitRate(_) => {
                out.push_str(&format!("  {name:<34} {:>15.2} %   +- {:.2} points\n", 100.0 * value, 100.0 * margin));
            }
            // The report states both elsewhere.
            Quantity::Count(Count::DramBytes | Count::Cache(..)) => {}
            Quantity::Count(_) if *value > 0.0 => {
                let share = 100.0 * margin / value;
                out.push_str(&format!("  {name:<34} {:>17}   +- {share:.2} %\n", grouped(*value as u64)));
            }
            Quantity::Count(_) => {}
        }
    }
    out
}

/// A count with thin groups of three digits.
pub fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let mut text = String::with_capacity(digits.len() + digits.len() / 3);
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}

/// Bytes in a readable unit (powers of 1024).
pub fn bytes(n: f64) -> String {
    let mut value = n;
    for unit in ["B", "KiB", "MiB", "GiB"] {
        if value < 1024.0 {
            return if unit == "B" { format!("{value} B") } else { format!("{value:.2} {unit}") };
        }
        value /= 1024.0;
    }
    format!("{value:.2} TiB")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_readable() {
        assert_eq!(grouped(0), "0");
        assert_eq!(grouped(999), "999");
        assert_eq!(grouped(1_234_567), "1,234,567");
        assert_eq!(bytes(1000.0), "1000 B");
        assert_eq!(bytes(1536.0), "1.50 KiB");
    }

    #[test]
    fn the_unit_with_the_largest_busy_share_comes_first() {
        let mut total = Tree::new();
        let units_tree = total.child("units");
        for (name, busy, starved) in [("setup", 10, 90), ("rop", 70, 30)] {
            for i in 0..2 {
                let unit = units_tree.element(name, i);
                unit.count("busy", busy);
                unit.count("starved", starved);
                for key in ["blocked", "memory", "latency", "idle"] {
                    unit.count(key, 0);
                }
            }
        }
        let text = units(&total);
        assert!(text.find("rop x2").unwrap() < text.find("setup x2").unwrap(), "{text}");
        assert!(text.contains("\n  starved: no input; blocked: "), "{text}");
    }

    #[test]
    fn sorting_names_the_class_and_what_it_cost() {
        let mut total = Tree::new();
        let sort = total.child("sort");
        sort.text("class", "sort-first");
        for (name, value) in [
            ("sorted_items", 1000),
            ("sent", 900),
            ("redistributed_items", 1800),
            ("redistributed_bytes", 28800),
            ("foreign_items", 1350),
            ("foreign_bytes", 21600),
            ("order_waiting_cycles", 4321),
            ("wrong_pixels", 7),
        ] {
            sort.count(name, value);
        }
        sort.real("overlap", 2.0);
        sort.real("load_imbalance", 1.25);
        let loss = sort.child("loss");
        loss.text("stage", "core");
        for (name, value) in [("pipeline_cycles", 4000), ("useful", 3000), ("overlap", 0), ("reorder_stalls", 1000)] {
            loss.count(name, value);
        }
        let network = sort.child("network");
        network.count("hops", 5);
        network.real("hottest_share", 0.5);
        network.real("mean_share", 0.125);
        network.text("hot_spot", "sorted[1] from a[0] to b[1]");
        let text = sorting(&total, SortClass::First, 4);
        let lines: Vec<String> = text.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect();
        let expected = [
            "sort-first, 4 pipelines",
            "primitives sorted 1,000 100 of them sent nowhere",
            "copies sent 1,800 overlap 2.000; 28.12 KiB",
            "to another pipeline 1,350 75.0 %; 21.09 KiB",
            "pipelines' cycles used 75.0 % measured at core",
            "lost to reorder stalls 25.0 %",
            "load imbalance 1.250 quads of the busiest pipeline, divided by the mean",
            "reorder stalls 4,321 cycles, summed over the units that restore order",
            "busiest link of the network 50.0 % sorted[1] from a[0] to b[1]; mean of all 12.5 %",
            "wrong pixels 7 pixels that differ from API order",
        ];
        assert_eq!(lines, expected);
    }

    #[test]
    fn the_funnel_says_where_things_went() {
        let text = funnel(&Funnel { primitives_in: 1000, culled_backface: 400, triangles_setup: 600, ..Funnel::default() });
        assert!(text.contains("400 facing away"), "{text}");
        assert!(text.contains("60.0 %"), "{text}");
    }
}
