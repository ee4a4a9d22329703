//! A run over time, as the JSON of trace events that Perfetto and Chromium open (<https://ui.perfetto.dev>).
//!
//! Frames, phases and draws (with `--per-draw`) are slices. Each bank of units has a track of slices, of what most of its cycles went to, and a counter of its busy cycles. The
//! channels of each name have a counter of the items in them. Times are those of the card, in microseconds.

use std::io::Write;
use std::path::Path;

use anyhow::{Context, Result};
use serde_json::{Value, json};

use crate::host;
use crate::machine::PhaseReport;
use crate::num::Cycle;
use crate::run::replay::Frame;
use crate::run::timeline::{Bank, Timeline};
use crate::stats::{Cycles, FrameCounts};

/// Frames that have ended, with what was done in them one after another.
#[derive(Clone, Debug, Default)]
pub struct Frames(Vec<(u32, Cycle, Vec<PhaseReport>)>);

impl Frames {
    /// A frame has ended.
    pub fn add(&mut self, frame: &Frame) {
        let FrameCounts { cycles } = frame.tree.read();
        self.0.push((frame.number, cycles, frame.phases.clone()));
    }
}

/// What tells a timeline from other files.
pub const MARK: &[u8] = br#""generator":"fillrate""#;

/// Tracks of the file, each with its number as a process.
const TRACKS: [(u32, &str); 5] = [
    (1, "frames and phases"),
    (2, "units: what most cycles went to"),
    (3, "units: busy cycles"),
    (4, "channels: items inside"),
    (5, "cores: warps held"),
];

/// What most of the cycles of a bank went to.
fn state(cycles: &Cycles) -> &'static str {
    let states = [
        ("busy", cycles.busy),
        ("waits for memory", cycles.memory),
        ("waits for instructions", cycles.latency),
        ("blocked", cycles.blocked),
        ("starved", cycles.starved),
        ("idle", cycles.idle),
    ];
    // Of equal ones the first.
    states.into_iter().rev().max_by_key(|(_, cycles)| *cycles).map_or("idle", |(name, _)| name)
}

/// Writes events, each on a line.
struct Events<'o> {
    out: &'o mut dyn Write,
    first: bool,
    mhz: f64,
}

impl Events<'_> {
    fn put(&mut self, event: &Value) -> Result<()> {
        let before = if std::mem::replace(&mut self.first, false) { "\n" } else { ",\n" };
        write!(self.out, "{before}{event}")?;
        Ok(())
    }

    /// A cycle in microseconds.
    fn time(&self, cycle: Cycle) -> f64 {
        cycle as f64 / self.mhz
    }

    fn slice(&mut self, track: [u32; 2], name: &str, begin: Cycle, end: Cycle) -> Result<()> {
        let [pid, tid] = track;
        let (ts, dur) = (self.time(begin), self.time(end - begin));
        self.put(&json!({ "ph": "X", "pid": pid, "tid": tid, "name": name, "ts": ts, "dur": dur, "args": { "cycle": begin, "cycles": end - begin } }))
    }

    /// Perfetto names the track by the counter and by what is measured.
    fn counter(&mut self, (pid, measure): (u32, &str), name: &str, at: Cycle, value: f64) -> Result<()> {
        let ts = self.time(at);
        self.put(&json!({ "ph": "C", "pid": pid, "name": name, "ts": ts, "args": { measure: value } }))
    }

    fn named(&mut self, kind: &str, pid: u32, tid: u32, name: &str) -> Result<()> {
        self.put(&json!({ "ph": "M", "pid": pid, "tid": tid, "name": kind, "args": { "name": name } }))
    }
}

fn times(bank: &Bank) -> String {
    if bank.count == 1 { bank.name.to_owned() } else { format!("{} x{}", bank.name, bank.count) }
}

/// A share with a thousandth as its last digit: shorter, and the same on every host.
fn thousandths(value: f64) -> f64 {
    (value * 1000.0).round() / 1000.0
}

/// Writes the events of a run.
fn events(out: &mut dyn Write, frames: &Frames, timeline: &Timeline, mhz: u32) -> Result<()> {
    write!(
        out,
        "{{\"displayTimeUnit\":\"ns\",\"otherData\":{{\"generator\":\"fillrate\",\"clock_mhz\":{mhz},\"interval_cycles\":{}}},\"traceEvents\":[",
        timeline.interval()
    )?;
    let mut events = Events { out, first: true, mhz: f64::from(mhz) };
    for (pid, name) in TRACKS {
        events.named("process_name", pid, 0, name)?;
    }
    events.named("thread_name", 1, 1, "frames")?;
    events.named("thread_name", 1, 2, "phases")?;
    if frames.0.iter().any(|(.., phases)| phases.iter().any(|phase| !phase.draws.is_empty())) {
        events.named("thread_name", 1, 3, "draws")?;
    }
    let mut begin = 0;
    for (number, cycles, phases) in &frames.0 {
        events.slice([1, 1], &format!("frame {number}"), begin, begin + cycles)?;
        let mut at = begin;
        for report in phases {
            events.slice([1, 2], &report.phase.to_string(), at, at + report.cycles)?;
            let mut draw_at = at;
            for draw in &report.draws {
                let number = draw.number.map_or("end of the pass".into(), |number| format!("draw {number}"));
                let words = [number.as_str(), draw.group(), &draw.label];
                let name = words.into_iter().filter(|word| !word.is_empty()).collect::<Vec<_>>().join(" ");
                events.slice([1, 3], &name, draw_at, draw_at + draw.cycles)?;
                draw_at += draw.cycles;
            }
            at += report.cycles;
        }
        begin += cycles;
    }
    for (bank, unit) in timeline.units.iter().enumerate() {
        let track = [2, bank as u32 + 1];
        events.named("thread_name", track[0], track[1], &times(unit))?;
        let mut open: Option<(&str, Cycle, Cycle)> = None;
        for sample in &timeline.samples {
            let now = state(&sample.units[bank]);
            open = match open {
                Some((name, begin, _)) if name == now => Some((name, begin, sample.end)),
                Some((name, begin, end)) => {
                    events.slice(track, name, begin, end)?;
                    Some((now, sample.begin, sample.end))
                }
                None => Some((now, sample.begin, sample.end)),
            };
        }
        if let Some((name, begin, end)) = open {
            events.slice(track, name, begin, end)?;
        }
        let busy = |cycles: &Cycles| thousandths(100.0 * cycles.busy as f64 / cycles.total().max(1) as f64);
        let held = |at: usize| {
            let sample = &timeline.samples[at];
            thousandths(sample.held[bank] as f64 / ((sample.end - sample.begin) * unit.count as u64) as f64)
        };
        counters(&mut events, (5, "warps held"), &times(unit), timeline, held)?;
        counters(&mut events, (3, "% busy"), &times(unit), timeline, |at| busy(&timeline.samples[at].units[bank]))?;
    }
    for (bank, channel) in timeline.channels.iter().enumerate() {
        let inside = |at: usize| {
            let sample = &timeline.samples[at];
            thousandths(sample.occupancy[bank] as f64 / (sample.end - sample.begin) as f64)
        };
        counters(&mut events, (4, "items"), &times(channel), timeline, inside)?;
    }
    out.write_all(b"\n]}\n")?;
    Ok(())
}

/// Writes a counter where it changes; none that stays 0.
fn counters(
    events: &mut Events<'_>,
    track: (u32, &str),
    name: &str,
    timeline: &Timeline,
    value: impl Fn(usize) -> f64,
) -> Result<()> {
    if (0..timeline.samples.len()).all(|at| value(at) == 0.0) {
        return Ok(());
    }
    let mut last = None;
    for (at, sample) in timeline.samples.iter().enumerate() {
        let now = value(at);
        if last != Some(now) {
            events.counter(track, name, sample.begin, now)?;
            last = Some(now);
        }
    }
    match timeline.samples.last() {
        Some(sample) => events.counter(track, name, sample.end, 0.0),
        None => Ok(()),
    }
}

/// Writes the file.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, frames: &Frames, timeline: &Timeline, mhz: u32) -> Result<()> {
    host::replace(path, |file| events(file, frames, timeline, mhz)).with_context(|| format!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bank_is_in_the_state_that_most_of_its_cycles_went_to() {
        let of = |busy, starved, memory| state(&Cycles { busy, starved, memory, ..Cycles::default() });
        assert_eq!([of(5, 3, 2), of(1, 3, 2), of(0, 1, 7), of(2, 2, 2)], ["busy", "starved", "waits for memory", "busy"]);
    }
}
