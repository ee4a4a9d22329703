//! All that was counted in one phase or draw, as text: what `stats.json` has of it.

use super::html::data::{CountedSpan, Statistics};
use super::peak::MemoryPeak;
use super::summary::{bytes, funnel, grouped};
use crate::host::one_line;
use crate::machine::{Moved, SHADING, Spent};
use crate::mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, DRAM};
use crate::sim::UNITS;
use crate::stats::{Group, Leaf, Node, counter};
use crate::work::FUNNEL;

/// The part of a frame that is reported.
#[derive(Clone, Debug)]
pub enum Chosen {
    /// Phases by their name, with or without their label; `all` are all.
    Phase(String),
    /// A draw, by its number in the frame.
    Draw(u64),
}

/// What was counted in the chosen parts of the frame that costs most. With the peak of the memory, traffic has rates.
///
/// # Errors
/// If the frame has no such part, or nothing was counted in it; the message says which there are.
pub fn counted(statistics: &Statistics, chosen: &Chosen, peak: Option<&MemoryPeak>) -> Result<String, String> {
    let frame = statistics.frame();
    let phases = &frame.parts;
    let place = |phase: &CountedSpan| format!("{} of frame {}", one_line(&phase.name()), statistics.number());
    let parts: Vec<(String, &CountedSpan)> = match chosen {
        Chosen::Phase(wanted) => {
            let same = |phase: &&CountedSpan| {
                let rest = phase.name().strip_prefix(wanted.as_str()).map(|rest| rest.is_empty() || rest.starts_with(' '));
                wanted == "all" || rest == Some(true)
            };
            phases.iter().filter(same).map(|phase| (place(phase), phase)).collect()
        }
        Chosen::Draw(wanted) => {
            let draws = phases.iter().flat_map(|phase| phase.parts.iter().map(move |draw| (phase, draw)));
            let own = draws.filter(|(_, draw)| draw.number == Some(*wanted));
            own.map(|(phase, draw)| (title(draw, &place(phase)), draw)).collect()
        }
    };
    if parts.is_empty() {
        return Err(missing(phases, chosen, statistics.number()));
    }
    if !parts.iter().any(|(_, part)| part.is_counted()) {
        let fidelity = statistics.text("fidelity");
        return Err(format!("nothing was counted in it by --fidelity {fidelity}: replay with --fidelity cycle"));
    }
    let all: f64 = phases.iter().map(CountedSpan::cycles).sum();
    let mut text = parts.iter().map(|(title, part)| whole(title, part, frame, all, peak)).collect::<Vec<_>>().join("\n");
    if let Chosen::Draw(_) = chosen {
        text.push_str("\nThe funnel is the draw's own. All else counts the cycles from the retirement before it to its own, with other draws in the machine.\n");
    }
    Ok(text)
}

/// A draw with its names.
fn title(draw: &CountedSpan, place: &str) -> String {
    let names = [&draw.group, &draw.label].into_iter().filter(|name| !name.is_empty());
    let names: String = names.map(|name| format!(" {name}")).collect();
    let site = if draw.site.is_empty() { String::new() } else { format!(" ({})", one_line(&draw.site)) };
    format!("draw {}{}{site}, {place}", draw.number.unwrap_or(0), one_line(&names))
}

/// Why there is none.
fn missing(phases: &[CountedSpan], chosen: &Chosen, frame: u32) -> String {
    match chosen {
        Chosen::Phase(wanted) => {
            const MOST: usize = 12;
            let mut names: Vec<String> = phases.iter().map(|phase| format!("`{}`", one_line(&phase.name()))).collect();
            names.dedup();
            let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
            names.truncate(MOST);
            format!("frame {frame} has no phase `{wanted}`: it has {}{more}", names.join(", "))
        }
        Chosen::Draw(wanted) => {
            let drawn = phases.iter().flat_map(|phase| &phase.parts).filter_map(|draw| draw.number);
            match (drawn.clone().min(), drawn.max()) {
                (Some(first), Some(last)) => format!("frame {frame} has no draw {wanted}: its draws are {first} to {last}"),
                _ => "no draw was reported: replay with --per-draw".into(),
            }
        }
    }
}

/// All of a part.
fn whole(title: &str, part: &CountedSpan, frame: &CountedSpan, all: f64, peak: Option<&MemoryPeak>) -> String {
    let own = part.cycles();
    let mut out = format!("{title}: {} cycles, {:.1} % of the frame\n", grouped(own as u64), percent(own, all));
    let mut section = |title: &str, text: String| {
        if !text.is_empty() {
            out.push_str(&format!("\n{title}\n{text}"));
        }
    };
    if !FUNNEL.find(&part.counts).is_empty() {
        section("What was drawn, and what was thrown away where", funnel(&FUNNEL.sum(&part.counts)));
    }
    section("What the units did, in cycles of the bank; units that only waited for input are left out", units(part, frame));
    section("Caches", caches(part));
    section("What cores issued, and texture units filtered", shading(part));
    section("What moved through memory", memory(part, peak));
    out
}

fn percent(part: f64, all: f64) -> f64 {
    if all > 0.0 { 100.0 * part / all } else { 0.0 }
}

/// The head of a table whose columns are counters.
fn head<G: Group>(first: &str, width: usize) -> String {
    let columns = G::DECLARATIONS.iter().map(|counter| format!("{:>width$}", counter.name));
    std::iter::once(format!("  {first:<18}")).chain(columns).collect()
}

fn units(part: &CountedSpan, frame: &CountedSpan) -> String {
    let mut rows: Vec<(String, Spent)> = UNITS
        .banks(&part.counts)
        .map(|(unit, _)| {
            let count = UNITS.find_of(&frame.counts, unit).len();
            let name = if count > 1 { format!("{unit} x{count}") } else { unit.to_owned() };
            (name, UNITS.sum_of(&part.counts, unit))
        })
        .collect();
    let share = |spent: &Spent, own: u64| percent(own as f64, spent.values().map(|cycles| cycles as f64).sum());
    rows.sort_by(|a, b| share(&b.1, b.1.busy).total_cmp(&share(&a.1, a.1.busy)));
    let mut text = String::new();
    if !rows.is_empty() {
        text.push_str(&head::<Spent>("unit", 23));
        text.push('\n');
    }
    for (name, spent) in &rows {
        text.push_str(&format!("  {name:<18}"));
        spent.values().for_each(|own| text.push_str(&format!("{:>14}{:>7.1} %", grouped(own), share(spent, own))));
        text.push('\n');
    }
    text
}

fn caches(part: &CountedSpan) -> String {
    let mut text = String::new();
    for (cache, _) in CACHES.banks(&part.counts) {
        let counts: CacheCounts = CACHES.sum_of(&part.counts, cache);
        if text.is_empty() {
            text.push_str(&head::<CacheCounts>("cache", 14));
            text.push_str("  hit rate\n");
        }
        text.push_str(&format!("  {cache:<18}"));
        counts.values().for_each(|count| text.push_str(&format!("{:>14}", grouped(count))));
        text.push_str(&format!("{:>8.1} %\n", percent(counts.hits as f64, counts.accesses as f64)));
    }
    text
}

fn shading(part: &CountedSpan) -> String {
    let count = |(name, node): (&str, &Node)| match node {
        Node::Leaf(Leaf::Count(count)) => Some(format!("{name} {}", grouped(*count))),
        _ => None,
    };
    let banks = SHADING.banks(&part.counts).filter_map(|(unit, trees)| Some((unit, trees.first()?)));
    banks
        .map(|(unit, own)| format!("  {unit:<18}{}\n", own.entries().filter_map(count).collect::<Vec<_>>().join(", ")))
        .collect()
}

fn memory(part: &CountedSpan, peak: Option<&MemoryPeak>) -> String {
    let row = |name: &str, read_bytes: u64, write_bytes: u64, requests: String| {
        let rate = peak.map(|peak| peak.rate((read_bytes + write_bytes) as f64, part.cycles()));
        let rate = rate.map_or(String::new(), |rate| format!("{:>10.2}{:>9.1} %", rate.gigabytes, 100.0 * rate.share));
        let [read, written] = [read_bytes, write_bytes].map(|n| bytes(n as f64));
        let row = format!("  {name:<18}{read:>14}{written:>14}{requests:>14}{rate}");
        row.trim_end().to_owned() + "\n"
    };
    let requests = CLIENTS.counter(counter!(ClientCounts, requests));
    let clients = CLIENTS.banks(&part.counts).map(|(name, _)| {
        let counts: ClientCounts = CLIENTS.sum_of(&part.counts, name);
        let asked = requests.of(name).sum(&part.counts).map_or(String::new(), |_| grouped(counts.requests));
        row(name, counts.read_bytes, counts.write_bytes, asked)
    });
    let mut text: String = clients.collect();
    if !DRAM.find(&part.counts).is_empty() {
        let Moved { read_bytes, write_bytes } = DRAM.sum(&part.counts);
        text.push_str(&row("DRAM", read_bytes, write_bytes, String::new()));
    }
    if text.is_empty() {
        return text;
    }
    let rates = if peak.is_some() { format!("{:>10}{:>11}", "GB/s", "of peak") } else { String::new() };
    format!("  {:<18}{:>14}{:>14}{:>14}{rates}\n{text}", "client", "read", "written", "requests")
}
