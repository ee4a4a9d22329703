//! Where the cycles of frames went: phases, and draws.

use serde_json::{Value, json};

use super::{bytes, grouped};
use crate::host::one_line;
use crate::machine::{DrawReport, PhaseReport};
use crate::num::Cycle;
use crate::report::verdict;
use crate::report::waits::{Waits, limited};
use crate::unit::phase::{Phase, PhaseKind};
use crate::work::Funnel;

/// Where the cycles of frames went: phases of the same kind, number in their frame and label are one line over all frames.
#[derive(Default)]
pub struct Phases {
    lines: Vec<Line>,
}

struct Line {
    phase: Phase,
    frames: usize,
    cycles: Cycle,
    /// Fragments shaded.
    shaded: u64,
    /// Bytes of DRAM both ways.
    bytes: u64,
    waits: Waits,
}

impl Phases {
    /// Adds those of a frame.
    pub fn add(&mut self, phases: &[PhaseReport]) {
        // The number of each line's kind and label so far in this frame.
        let mut from = 0;
        for PhaseReport { phase, cycles, counts, .. } in phases {
            let counts = counts.as_deref();
            let shaded = counts.map_or(0, |counts| counts.funnel.fragments_shaded);
            let bytes = counts.map_or(0, |counts| counts.dram.read_bytes + counts.dram.write_bytes);
            let waits = counts.map_or(Waits::default(), |counts| Waits::of(&counts.tree()));
            let same = |line: &Line| line.phase.kind == phase.kind && line.phase.label == phase.label;
            match self.lines[from..].iter().position(same) {
                Some(at) => {
                    let line = &mut self.lines[from + at];
                    (line.frames, line.cycles) = (line.frames + 1, line.cycles + cycles);
                    (line.shaded, line.bytes) = (line.shaded + shaded, line.bytes + bytes);
                    line.waits.add(&waits);
                    from += at + 1;
                }
                None => {
                    self.lines.insert(from, Line { phase: phase.clone(), frames: 1, cycles: *cycles, shaded, bytes, waits });
                    from += 1;
                }
            }
        }
    }

    /// Whether no frame had one.
    pub fn is_empty(&self) -> bool {
        self.lines.is_empty()
    }

    /// Takes over what limits each phase, from estimates of some of the frames.
    pub fn limit(&mut self, estimated: &Phases) {
        let mut known = estimated.lines.iter();
        for line in &mut self.lines {
            let same = |of: &&Line| of.phase.kind == line.phase.kind && of.phase.label == line.phase.label;
            if let Some(found) = known.clone().position(|of| same(&of)) {
                line.phase.limit = known.nth(found).map_or(String::new(), |of| of.phase.limit.clone());
            }
        }
    }

    /// Whether it is known of any what limits it.
    pub fn limited(&self) -> bool {
        self.lines.iter().any(|line| !line.phase.limit.is_empty())
    }

    /// Whether of any is said what it waits for.
    pub fn waits(&self) -> bool {
        self.lines.iter().any(|line| limited(&line.phase.limit, &line.waits).0 == "waits")
    }

    /// What counters alone prove: causes, and what the phase that takes most waits for.
    pub fn counted(&self, funnel: &Funnel) -> Vec<String> {
        let all: Cycle = self.lines.iter().map(|line| line.cycles).sum();
        let line = self.lines.iter().rev().max_by_key(|line| line.cycles);
        let name = line.map(|line| one_line(&line.phase.to_string()).to_string());
        let limit = line.map(|line| limited(&line.phase.limit, &line.waits));
        let most = line.zip(name.as_deref()).zip(limit.as_ref()).map(|((line, name), (word, limit))| {
            (name, line.cycles as f64 / all.max(1) as f64, (*word, &**limit), &line.waits)
        });
        verdict::counted(funnel, most, verdict::Draws::default())
    }

    /// Cycles of passes and dispatches.
    pub fn drawing(&self) -> Cycle {
        let draws = |line: &&Line| matches!(line.phase.kind, PhaseKind::Pass | PhaseKind::Dispatch);
        self.lines.iter().filter(draws).map(|line| line.cycles).sum()
    }

    /// All phases in order, as JSON.
    pub fn json(&self) -> Value {
        let line = |Line { phase, frames, cycles, shaded, bytes, waits }: &Line| {
            json!({
                "kind": phase.kind.name(),
                "number": phase.number,
                "label": phase.label,
                "frames": frames,
                "cycles": cycles,
                "dram_bytes": bytes,
                "fragments_shaded": shaded,
                "limit": phase.limit,
                "waits": waits.text(),
            })
        };
        self.lines.iter().map(line).collect()
    }

    /// The phases in order, those that took least left out; at most `most` lines.
    pub fn text(&self, most: usize) -> String {
        let lines = &self.lines;
        let total: Cycle = lines.iter().map(|line| line.cycles).sum();
        let mut by_cycles: Vec<usize> = (0..lines.len()).collect();
        by_cycles.sort_by_key(|&at| (std::cmp::Reverse(lines[at].cycles), at));
        let left_out = by_cycles.split_off(most.min(lines.len()));
        by_cycles.sort_unstable();
        let mut out = String::new();
        let share = |cycles: Cycle| 100.0 * cycles as f64 / total.max(1) as f64;
        for Line { phase, frames, cycles, shaded, bytes, waits } in by_cycles.into_iter().map(|at| &lines[at]) {
            let number = match phase.kind {
                PhaseKind::Pass | PhaseKind::Dispatch if *frames == 1 => format!(" {}", phase.number),
                _ => String::new(),
            };
            let name = format!("{}{number} {}", phase.kind.name(), one_line(&phase.label));
            let times = if *frames > 1 { format!("   {frames} times") } else { String::new() };
            let row = format!("  {:<34} {:>12} {:>7.1} %{times}", clip(name.trim_end(), 34), grouped(*cycles), share(*cycles));
            out.push_str(&row);
            if *bytes > 0 {
                out.push_str(&format!("   {:>10} of DRAM", super::bytes(*bytes as f64)));
            }
            if *shaded > 0 {
                out.push_str(&format!("   {:>11} shaded", grouped(*shaded)));
            }
            if !phase.limit.is_empty() {
                let (word, what) = limited(&phase.limit, waits);
                out.push_str(&format!("   {word}: {what}"));
            }
            out.push('\n');
        }
        if !left_out.is_empty() {
            let cycles: Cycle = left_out.iter().map(|&at| lines[at].cycles).sum();
            let name = format!("{} more", left_out.len());
            out.push_str(&format!("  {name:<34} {:>12} {:>7.1} %\n", grouped(cycles), share(cycles)));
        }
        out
    }
}

/// A draw as JSON, with what its line says.
pub fn draw_json(frame: u32, phase: &Phase, draw: &DrawReport) -> Value {
    json!({
        "frame": frame,
        "phase": phase.to_string(),
        "draw": draw.number,
        "site": draw.site.map(|site| site.to_string()),
        "group": draw.group(),
        "label": draw.label,
        "cycles": draw.cycles,
        "geometry_cycles": draw.halves.map(|[geometry, _]| geometry),
        "tile_cycles": draw.halves.map(|[_, tiles]| tiles),
        "dram_bytes": draw.counts.dram.read_bytes + draw.counts.dram.write_bytes,
        "fragments_shaded": draw.counts.funnel.fragments_shaded,
    })
}

/// A draw as a line: where it is, its cycles, what it shaded and moved.
pub fn draw(frame: u32, phase: &Phase, draw: &DrawReport) -> String {
    let name = match draw.number {
        None => format!("end of {phase}"),
        Some(number) => {
            let names = [draw.group(), draw.label.as_str()].into_iter().filter(|name| !name.is_empty());
            format!("draw {number} {}", names.collect::<Vec<_>>().join(": "))
        }
    };
    let name = clip(one_line(name.trim_end()).to_string().as_str(), 34);
    let shaded = grouped(draw.counts.funnel.fragments_shaded);
    if let Some([geometry, tiles]) = draw.halves {
        let [cycles, geometry, tiles] = [draw.cycles, geometry, tiles].map(grouped);
        return format!(
            "  {name:<34} {cycles:>12}   geometry {geometry:>10}   tiles {tiles:>10}   {shaded} fragments shaded   frame {frame}\n"
        );
    }
    let moved = bytes((draw.counts.dram.read_bytes + draw.counts.dram.write_bytes) as f64);
    format!("  {name:<34} {:>12}   {moved:>10} of DRAM   {shaded} fragments shaded   frame {frame}\n", grouped(draw.cycles))
}

/// The beginning of a text, at most `most` characters.
fn clip(text: &str, most: usize) -> String {
    if text.chars().count() <= most { text.to_owned() } else { text.chars().take(most - 1).chain(['…']).collect() }
}
