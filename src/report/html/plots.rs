//! The plots of a page of a replay as files of their own.

use crate::machine::{Config, Machine};
use crate::report::diagram::Diagram;
use crate::report::plots::{Marks, Scale, Series, Stack, alone, bars, chart, roofline};

use super::data::{CYCLES, CountedSpan, Statistics};
use super::machine::{STATES, banks, roofs};
use super::{percent, readable, share};

/// The plots, each with its name: phases and frames, units, the roofline, the machine. What the statistics do not have is left out.
pub fn replay(statistics: &Statistics, config: Option<&Config>) -> Vec<(String, String)> {
    let frame = statistics.frame();
    let mut plots = Vec::new();
    let all: f64 = frame.parts.iter().map(CountedSpan::cycles).sum();
    let rows: Vec<Stack> = frame
        .parts
        .iter()
        .map(|phase| {
            let color = if phase.draws() { "draw" } else { "other" };
            let part = share(phase.cycles(), all);
            Stack { name: phase.name(), shares: vec![(color, part, percent(part))], note: readable(phase.cycles()) }
        })
        .collect();
    if !rows.is_empty() {
        let key = [("draw", "drawing"), ("other", "moving data")];
        plots.push(("phases".to_owned(), alone(&bars("Cycles by phase", &key, &rows))));
    }
    let banks = banks(frame);
    if !banks.is_empty() {
        let row = |bank: &super::machine::Bank<'_>| Stack {
            name: if bank.count > 1 { format!("{} x{}", bank.name, bank.count) } else { bank.name.to_owned() },
            shares: (0..STATES.len())
                .map(|at| (STATES[at].0, bank.shares[at], format!("{}: {}", STATES[at].1, percent(bank.shares[at]))))
                .collect(),
            note: percent(bank.shares[0]),
        };
        let rows: Vec<Stack> = banks.iter().map(row).collect();
        plots.push(("units".to_owned(), alone(&bars("What units did", &STATES, &rows))));
    }
    let point = |frame: &CountedSpan| Some((frame.number? as f64, CYCLES.sum(&frame.counts)?));
    let points: Vec<(f64, f64)> = statistics.frames().iter().filter_map(point).collect();
    if points.len() > 1 {
        let series = [Series { name: "cycles", points, line: true }];
        let svg = chart("frame", "cycles", Scale::Linear, Scale::FromZero, Marks::Round, &series).into_string();
        plots.push(("frames".to_owned(), alone(&svg)));
    }
    if let Some(config) = config {
        if let Some(roofs) = roofs(frame, config) {
            plots.push(("roofline".to_owned(), alone(&roofline(&roofs))));
        }
        if let Ok(machine) = Machine::new(config) {
            let busy = |name: &str| banks.iter().find(|bank| bank.name == name).map(|bank| bank.shares[0]);
            plots.push(("machine".to_owned(), Diagram::new(&machine).svg_by_use(&busy)));
        }
    }
    plots
}
