//! The machine at work: units, channels, the roofline, and the machine's own drawing.

use maud::{Markup, PreEscaped, html};

use super::data::CountedSpan;
use super::replay::Input;
use super::{Column, bar, cell, cell_share, heads, key, percent, readable, share};
use crate::machine::{Config, Machine, Moved};
use crate::mem::DRAM;
use crate::report::diagram::Diagram;
use crate::report::peak::MemoryPeak;
use crate::report::plots::{Roofline, roofline as draw_roofline};
use crate::report::summary::occupancy;
use crate::sim::{CAPACITY, CHANNELS, ChannelCounts, MEAN_OCCUPANCY, UNITS, UnitCounts};
use crate::stats::{Cycles, Group, Key, counter};
use crate::unit::core::{CORES, CoreCounts};

/// What a unit does in a cycle, in the order of [`Cycles`], with the class of its colour.
pub const STATES: [(&str, &str); 6] = [
    ("busy", "busy"),
    ("starved", "no input"),
    ("blocked", "no room behind it"),
    ("memory", "waits for memory"),
    ("latency", "waits for instructions"),
    ("idle", "idle"),
];

const CLASSES: [&str; 6] = ["s-busy", "s-starved", "s-blocked", "s-memory", "s-latency", "s-idle"];

/// A bank of equal units and the shares of their cycles.
pub struct Bank<'v> {
    /// What they are called.
    pub name: &'v str,
    /// How many.
    pub count: usize,
    /// Shares of the cycles, by [`STATES`].
    pub shares: [f64; 6],
    /// Smallest and largest share of busy cycles of one of them.
    pub range: [f64; 2],
}

/// The banks of a frame, in data-flow order.
pub fn banks(frame: &CountedSpan) -> Vec<Bank<'_>> {
    let mut banks = Vec::new();
    for (name, list) in UNITS.banks(&frame.counts) {
        let (mut sums, mut range) = ([0.0; 6], [1.0_f64, 0.0_f64]);
        for unit in list {
            let own: Cycles = unit.read();
            let busy = share(own.busy as f64, own.total() as f64);
            range = [range[0].min(busy), range[1].max(busy)];
            sums.iter_mut().zip(own.values()).for_each(|(sum, own)| *sum += own as f64);
        }
        let all: f64 = sums.iter().sum();
        if all > 0.0 {
            banks.push(Bank { name, count: list.len(), shares: sums.map(|sum| sum / all), range });
        }
    }
    banks
}

/// The number of items that went through units.
const ITEMS: Key = UNITS.counter(counter!(UnitCounts, items));

/// How busy the units were, and how full the channels.
pub fn units(input: &Input<'_>) -> Option<Markup> {
    let frame = input.statistics.frame();
    let place = input.statistics.place();
    let mut banks = banks(frame);
    if banks.is_empty() {
        return None;
    }
    banks.sort_by(|a, b| b.shares[0].total_cmp(&a.shares[0]));
    let columns = [
        Column("unit", false, ""),
        Column("count", true, "How many there are; shares are averages."),
        Column("busy", true, "Share of the cycles."),
        Column("least", true, "Of the unit that is busy least."),
        Column("most", true, "Of the unit that is busy most."),
        Column("items", true, "What went through."),
    ];
    let keys: Vec<(&str, &str)> = CLASSES.iter().zip(STATES).map(|(class, (_, text))| (*class, text)).collect();
    Some(html! {
        (key(&keys))
        div.scroll { table.sortable {
            (heads(&columns))
            tbody { @for bank in &banks {
                @let parts: Vec<(&str, f64, String)> = (0..6).map(|at| (CLASSES[at], bank.shares[at], format!("{}: {}", STATES[at].1, percent(bank.shares[at])))).collect();
                tr {
                    td.name { (bank.name) (bar("bar", &parts)) }
                    td.n data-value=(bank.count) { (bank.count) }
                    (cell_share(bank.shares[0])) (cell_share(bank.range[0])) (cell_share(bank.range[1]))
                    (cell(frame, &place, &ITEMS.of(bank.name)))
                }
            } }
        } }
        @let cores: CoreCounts = CORES.sum(&frame.counts);
        @if cores.slot_cycles > 0 {
            p { "Cores: " (occupancy(&cores, UNITS.sum_of(&frame.counts, "core")).join("; ")) "." }
        }
        p.note {
            "A busy unit need not limit the frame. These are sums over the frame; "
            code { "fillrate replay --timeline FILE" } " shows units and channels over time, in Perfetto."
        }
        (channels(frame, &place))
    })
}

fn channels(frame: &CountedSpan, place: &str) -> Markup {
    let list: Vec<_> = CHANNELS.banks(&frame.counts).collect();
    let [items, bytes, full] =
        [counter!(ChannelCounts, items), counter!(ChannelCounts, bytes), counter!(ChannelCounts, full_cycles)]
            .map(|counter| CHANNELS.counter(counter));
    let columns = [
        Column("channel", false, "A bounded FIFO between two units."),
        Column("count", true, "Parallel channels; the counts are their sum."),
        Column("items", true, ""),
        Column("bytes", true, ""),
        Column("fill", true, "Mean occupancy by capacity."),
        Column("full cycles", true, "Cycles in which it had no room, the sum over the channels."),
    ];
    html! {
        @if !list.is_empty() {
            details {
                summary { "Channels: how full the FIFOs between units were" }
                div.scroll.tall { table.sortable {
                    (heads(&columns))
                    tbody { @for (name, channels) in list {
                        @let n = |key: &Key| key.of(name).sum(&frame.counts).unwrap_or(0.0);
                        @if n(&items) > 0.0 {
                            tr {
                                td.name { (name) }
                                td.n data-value=(channels.len()) { (channels.len()) }
                                (cell(frame, place, &items.of(name)))
                                (cell(frame, place, &bytes.of(name)))
                                (cell_share(share(n(&CHANNELS.statistic(&MEAN_OCCUPANCY)), n(&CHANNELS.statistic(&CAPACITY)))))
                                (cell(frame, place, &full.of(name)))
                            }
                        }
                    } }
                } }
                p.note { "Channels through which nothing went are left out." }
            }
        }
    }
}

/// Passes that have a point of their own in the roofline: those that take most cycles.
const POINTS: usize = 7;

/// What the cores did by what memory moved, under the roofs of the machine: the frame, and the passes and dispatches that take most of it.
pub fn roofs(frame: &CountedSpan, config: &Config) -> Option<Roofline> {
    let width = f64::from(config.core.warp_width);
    let point = |name: String, of: &CountedSpan| {
        let CoreCounts { float, integer, special, control, multiply, .. } = CORES.sum(&of.counts);
        let instructions = (float + integer + special + control + multiply) as f64 * width;
        let Moved { read_bytes, write_bytes } = DRAM.sum(&of.counts);
        let (bytes, cycles) = ((read_bytes + write_bytes) as f64, of.cycles());
        (instructions > 0.0 && bytes > 0.0 && cycles > 0.0).then(|| (name, instructions / bytes, instructions / cycles))
    };
    let cores = UNITS.named("core").find(&frame.counts).len() as f64;
    let whole = point("frame".into(), frame).filter(|_| cores > 0.0)?;
    let mut phases: Vec<&CountedSpan> = frame.parts.iter().filter(|phase| phase.draws()).collect();
    phases.sort_by(|a, b| b.cycles().total_cmp(&a.cycles()));
    let own = phases.into_iter().filter_map(|phase| point(phase.name(), phase)).take(POINTS);
    let peak = f64::from(config.core.issue) * width * cores;
    let lanes = f64::from(config.core.float_lanes) * cores;
    Some(Roofline {
        bandwidth: MemoryPeak::new(config).bytes_per_cycle,
        peak: peak.min(lanes),
        points: std::iter::once(whole).chain(own).collect(),
    })
}

/// The roofline, with the figures in words.
pub fn roofline(input: &Input<'_>) -> Option<Markup> {
    let config = input.config?;
    let roofs = roofs(input.statistics.frame(), config)?;
    let columns = [
        Column("", false, ""),
        Column("per byte", true, "Instructions for each byte of DRAM traffic."),
        Column("per cycle", true, "Instructions per cycle."),
        Column("of the roof", true, "Of the lower one of both roofs at this place."),
        Column("lower roof", false, ""),
    ];
    Some(html! {
        figure.two {
            (PreEscaped(draw_roofline(&roofs)))
            div {
                div.scroll { table.sortable {
                    (heads(&columns))
                    tbody { @for (name, intensity, rate) in &roofs.points {
                        @let memory = intensity * roofs.bandwidth;
                        tr {
                            td.name { (name) }
                            td.n data-value=(intensity) { (format!("{intensity:.2}")) }
                            td.n data-value=(rate) { (format!("{rate:.1}")) }
                            (cell_share(share(*rate, memory.min(roofs.peak))))
                            td { @if memory < roofs.peak { "bandwidth" } @else { "cores" } }
                        }
                    } }
                } }
                figcaption {
                    "Roofs: " (format!("{:.0}", roofs.peak)) " instructions and " (format!("{:.1}", roofs.bandwidth)) " bytes per cycle. "
                    "An instruction counts once for each invocation of its warp. Uploads and scan-out move bytes of the frame that belong to no pass. "
                    "A point far below both roofs waits for something else: latency, another unit, or the pipelines for each other."
                }
            }
        }
    })
}

/// The machine, drawn from itself, with each unit in the colour of its use.
pub fn drawing(input: &Input<'_>) -> Option<Markup> {
    let machine = Machine::new(input.config?).ok()?;
    let banks = banks(input.statistics.frame());
    let busy = |name: &str| banks.iter().find(|bank| bank.name == name).map(|bank| bank.shares[0]);
    Some(html! {
        p.note { "Boxes are units, lines are channels. The stronger the colour of a box, the larger the share of the cycles in which the unit is busy." }
        div.scale { span { "0 %" } i.use {} span { "100 % busy" } }
        div.diagram.scroll tabindex="0" role="img" aria-label="The machine" { (PreEscaped(Diagram::new(&machine).svg_by_use(&busy))) }
        p.note { (readable(banks.iter().map(|bank| bank.count as f64).sum())) " units. Only units that had cycles in these statistics are coloured." }
    })
}
