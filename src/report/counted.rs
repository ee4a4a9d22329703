//! All that was counted in one phase or draw, as text: what `stats.json` has of it.

use serde_json::Value;

use super::html::data::{Statistics, number};
use super::html::passes::{cycles, list, name};
use super::summary::{bytes, funnel, grouped};
use crate::host::one_line;
use crate::stats::Group as _;
use crate::work::Funnel;

/// The part of a frame that is reported.
#[derive(Clone, Debug)]
pub enum Chosen {
    /// Phases by their name, with or without their label; `all` are all.
    Phase(String),
    /// A draw, by its number in the trace.
    Draw(u64),
}

/// What was counted in the chosen parts of the frame that costs most.
///
/// # Errors
/// If the frame has no such part, or nothing was counted in it; the message says which there are.
pub fn counted(statistics: &Statistics, chosen: &Chosen) -> Result<String, String> {
    let frame = statistics.frame();
    let phases = list(frame, "phases");
    let place = |phase: &Value| format!("{} of frame {}", one_line(&name(phase)), statistics.number());
    let parts: Vec<(String, &Value)> = match chosen {
        Chosen::Phase(wanted) => {
            let same = |phase: &&Value| {
                let rest = name(phase).strip_prefix(wanted.as_str()).map(|rest| rest.is_empty() || rest.starts_with(' '));
                wanted == "all" || rest == Some(true)
            };
            phases.iter().filter(same).map(|phase| (place(phase), phase)).collect()
        }
        Chosen::Draw(wanted) => {
            let draws = phases.iter().flat_map(|phase| list(phase, "draws").iter().map(move |draw| (phase, draw)));
            let own = draws.filter(|(_, draw)| draw["number"].as_u64() == Some(*wanted));
            own.map(|(phase, draw)| (title(draw, &place(phase)), draw)).collect()
        }
    };
    if parts.is_empty() {
        return Err(missing(phases, chosen, statistics.number()));
    }
    if parts.iter().all(|(_, part)| part.get("units").is_none()) {
        let fidelity = statistics.text("fidelity");
        return Err(format!("nothing was counted in it by --fidelity {fidelity}: replay with --fidelity cycle"));
    }
    let all: f64 = phases.iter().map(cycles).sum();
    let mut text = parts.iter().map(|(title, part)| whole(title, part, frame, all)).collect::<Vec<_>>().join("\n");
    if let Chosen::Draw(_) = chosen {
        text.push_str("\nThe funnel is the draw's own. All else counts the cycles from the retirement before it to its own, with other draws in the machine.\n");
    }
    Ok(text)
}

/// A draw with its names.
fn title(draw: &Value, place: &str) -> String {
    let names = ["group", "label"].map(|key| draw[key].as_str().unwrap_or("")).into_iter().filter(|name| !name.is_empty());
    let names: String = names.map(|name| format!(" {name}")).collect();
    format!("draw {}{}, {place}", draw["number"], one_line(&names))
}

/// Why there is none.
fn missing(phases: &[Value], chosen: &Chosen, frame: u32) -> String {
    match chosen {
        Chosen::Phase(wanted) => {
            const MOST: usize = 12;
            let mut names: Vec<String> = phases.iter().map(|phase| format!("`{}`", one_line(&name(phase)))).collect();
            names.dedup();
            let more = if names.len() > MOST { format!(" and {} more", names.len() - MOST) } else { String::new() };
            names.truncate(MOST);
            format!("frame {frame} has no phase `{wanted}`: it has {}{more}", names.join(", "))
        }
        Chosen::Draw(wanted) => {
            let drawn = phases.iter().flat_map(|phase| list(phase, "draws")).filter_map(|draw| draw["number"].as_u64());
            match (drawn.clone().min(), drawn.max()) {
                (Some(first), Some(last)) => format!("frame {frame} has no draw {wanted}: its draws are {first} to {last}"),
                _ => "no draw was reported: replay with --per-draw".into(),
            }
        }
    }
}

/// All of a part.
fn whole(title: &str, part: &Value, frame: &Value, all: f64) -> String {
    let own = cycles(part);
    let mut out = format!("{title}: {} cycles, {:.1} % of the frame\n", grouped(own as u64), percent(own, all));
    let mut section = |title: &str, text: String| {
        if !text.is_empty() {
            out.push_str(&format!("\n{title}\n{text}"));
        }
    };
    let count = |path: &str| number(part, path).unwrap_or(0.0) as u64;
    if part.get("funnel").is_some() {
        let counts = Funnel::collect(|name| count(&format!("funnel.{name}")));
        section("What was drawn, and what was thrown away where", funnel(&counts));
    }
    section("What the units did, in cycles of the bank; units that only waited for input are left out", units(part, frame));
    section("Caches", caches(part));
    section("What cores issued, and texture units filtered", shading(part));
    section("What moved through memory", memory(part));
    out
}

fn percent(part: f64, all: f64) -> f64 {
    if all > 0.0 { 100.0 * part / all } else { 0.0 }
}

/// The entries of an object.
fn entries<'v>(part: &'v Value, name: &str) -> impl Iterator<Item = (&'v str, &'v Value)> {
    part[name].as_object().into_iter().flatten().map(|(name, value)| (name.as_str(), value))
}

fn units(part: &Value, frame: &Value) -> String {
    const STATES: [&str; 4] = ["busy", "blocked", "memory", "starved"];
    let mut rows: Vec<(String, [f64; 4])> = entries(part, "units")
        .map(|(unit, own)| {
            let count = frame["units"][unit].as_array().map_or(1, Vec::len);
            let name = if count > 1 { format!("{unit} x{count}") } else { unit.to_owned() };
            (name, STATES.map(|state| own[state].as_f64().unwrap_or(0.0)))
        })
        .collect();
    let share = |states: &[f64; 4], at: usize| percent(states[at], states.iter().sum());
    rows.sort_by(|a, b| share(&b.1, 0).total_cmp(&share(&a.1, 0)));
    let mut text = String::new();
    if !rows.is_empty() {
        text.push_str(&format!("  {:<18}", "unit"));
        STATES.iter().for_each(|state| text.push_str(&format!("{state:>23}")));
        text.push('\n');
    }
    for (name, states) in &rows {
        text.push_str(&format!("  {name:<18}"));
        for at in 0..STATES.len() {
            text.push_str(&format!("{:>14}{:>7.1} %", grouped(states[at] as u64), share(states, at)));
        }
        text.push('\n');
    }
    text
}

fn caches(part: &Value) -> String {
    const COUNTS: [&str; 4] = ["accesses", "hits", "misses", "evictions"];
    let mut text = String::new();
    for (cache, own) in entries(part, "caches") {
        let counts = COUNTS.map(|count| own[count].as_u64().unwrap_or(0));
        if text.is_empty() {
            text.push_str(&format!("  {:<18}", "cache"));
            COUNTS.iter().for_each(|count| text.push_str(&format!("{count:>14}")));
            text.push_str("  hit rate\n");
        }
        text.push_str(&format!("  {cache:<18}"));
        counts.iter().for_each(|&count| text.push_str(&format!("{:>14}", grouped(count))));
        text.push_str(&format!("{:>8.1} %\n", percent(counts[1] as f64, counts[0] as f64)));
    }
    text
}

fn shading(part: &Value) -> String {
    let line = |(unit, own): (&str, &Value)| {
        let counts = own.as_object().into_iter().flatten();
        let counts: Vec<String> =
            counts.map(|(name, count)| format!("{name} {}", grouped(count.as_u64().unwrap_or(0)))).collect();
        format!("  {unit:<18}{}\n", counts.join(", "))
    };
    entries(part, "shading").map(line).collect()
}

fn memory(part: &Value) -> String {
    let row = |name: &str, own: &Value| {
        let [read, written] = ["read_bytes", "write_bytes"].map(|count| own[count].as_f64().unwrap_or(0.0));
        let requests = own["requests"].as_u64().map_or(String::new(), grouped);
        let row = format!("  {name:<18}{:>14}{:>14}{requests:>14}", bytes(read), bytes(written));
        row.trim_end().to_owned() + "\n"
    };
    let mut text: String = entries(&part["memory"], "clients").map(|(name, own)| row(name, own)).collect();
    if part["memory"].get("dram").is_some() {
        text.push_str(&row("DRAM", &part["memory"]["dram"]));
    }
    if text.is_empty() { text } else { format!("  {:<18}{:>14}{:>14}{:>14}\n{text}", "client", "read", "written", "requests") }
}
