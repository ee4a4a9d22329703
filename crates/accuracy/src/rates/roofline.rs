//! Arithmetic against memory.

use anyhow::{Context, Result};

use super::{Run, layers, machine};
use crate::harness::config;
use crate::{Row, Section, Setting, Target};
use machine::config::SortClass;
use synthetic::Scene;

pub(super) const ROOFLINE: Target = Target {
    id: "roofline",
    section: Section::Memory,
    what: "No run takes fewer cycles than any of its units needs for its work at its rate (machines of several classes, DRAM included). \
           With ever more arithmetic per fragment, memory takes the time first, then the cores: both lines meet \
           at peak/bandwidth instructions per byte (Williams et al. 2009)",
    bound: "exact; 2 % of the knee",
    fault: "the core issues one instruction per cycle fewer than its configuration says",
    check,
};

/// Edge of the image: its blocks are four times as many as the colour cache holds, so that all of a layer's come from memory and go back.
const EDGE: u32 = 128;

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let (count, steps) = setting.pick((2, 3), (4, 9), (16, 17));
    let mut rows = Vec::new();
    let (mut runs, mut too_fast, mut nearest) = (0_u64, 0_u64, f64::INFINITY);
    let mut note = |run: &Run| {
        let room = run.cycles / run.slowest().1;
        runs += 1;
        too_fast += u64::from(room < 1.0);
        nearest = nearest.min(room);
    };
    for bandwidth in [8, 32] {
        let told = machine(&[format!("memory.ideal_bytes_per_cycle={bandwidth}"), "traverse.quads_per_cycle=4".into()])?;
        let mut given = told.clone();
        given.core.issue -= u32::from(setting.inject_fault);
        // Invocations that an instruction is executed for, per cycle.
        let peak = f64::from(told.core.issue * told.core.warp_width);
        let knee = peak / f64::from(bandwidth);
        let mut sweep = Vec::new();
        for step in 0..steps {
            // From an instruction per fragment, of eight bytes, to four times as many as the knee has.
            let instructions = 1 + (4.0 * knee * 8.0 * f64::from(step) / f64::from(steps - 1)) as u32;
            let scene = |count| Scene { instructions, ..layers(EDGE, count) };
            let [short, long] = [Run::of(&given, &scene(count))?, Run::of(&given, &scene(2 * count))?];
            note(&short);
            note(&long);
            sweep.push(long.beyond(&short)?);
        }
        let [first, last] = [sweep.first(), sweep.last()].map(|run| run.context("nothing was swept"));
        let (flat, slope) = (first?, last?);
        // Cycles per byte where memory takes them, cycles per instruction where the core does.
        let measured = (flat.cycles / flat.bytes) / (slope.cycles / slope.instructions);
        let case = format!("{bandwidth} bytes, {peak} instructions per cycle: instructions per byte at the knee");
        rows.push(Row::within(case, knee, measured, 0.02 * knee));
    }
    let triangles = setting.pick(16, 60, 300);
    for class in [SortClass::First, SortClass::Middle, SortClass::MiddleBinned, SortClass::LastFragment] {
        for changes in [&["traverse.hierarchical_z=false"][..], &["traverse.hierarchical_z=false", "memory.kind=ideal"]] {
            for (size, blend, textures) in [(6.0, false, 1), (60.0, true, 3)] {
                let scene = Scene { triangles, size, blend, textures, seed: setting.seed, ..Scene::default() };
                note(&Run::of(&config(class.name(), changes)?, &scene)?);
            }
        }
    }
    rows.push(Row::none(format!("of {runs} runs, those that end before their slowest unit can"), too_fast));
    rows.push(Row::at_least("cycles of the run that is nearest to that, by those of its slowest unit", 1.0, nearest));
    Ok(rows)
}
