//! Where tiles cost most.

use anyhow::{Context, Result};

use super::{right_triangle, scene_of};
use crate::harness::{config, funnel, replay};
use crate::{Row, Section, Setting, Target};
use machine::config::SortClass;
use num::Random;

pub(super) const CHEN_PEAK: Target = Target {
    id: "chen-peak",
    section: Section::Sorting,
    what: "Tiles make triangles be set up once for each tile. Where setup takes longer than the pixels anyway that costs more the \
           larger the triangles; where the pixels take longer, setup hides behind them again: the slow-down peaks where both take as \
           long (Chen et al. 1998)",
    bound: "a factor of 2 in area; the peak a fifth above both ends",
    fault: "setup of the machine takes four times as long as its configuration says",
    check,
};

/// The cycles of right triangles with legs of `legs` pixels at random positions, and the quads of each triangle.
fn cycles(setting: &Setting, class: SortClass, interval: u32, legs: f32) -> Result<(f64, f64)> {
    let triangles = setting.pick(150, 400, 3000);
    let mut random = Random::new(setting.seed);
    let mut at = || (192.0 - legs) * random.unit();
    let scene = scene_of(192, 192, (0..triangles).map(|_| right_triangle(at(), at(), legs, legs)).collect());
    let interval = if setting.inject_fault { 4 * interval } else { interval };
    // Nothing but setup and traversal, at one quad per cycle, is to take time.
    let changes = [
        "pipelines=1",
        "geometry_units=1",
        "memory.kind=ideal",
        "memory.ideal_latency=1",
        "memory.ideal_bytes_per_cycle=65536",
        "memory.port_width=4096",
        "bin.tile=16",
        "bin.triangles_per_cycle=16",
        "bin.entries_per_cycle=64",
        "fetch.indices_per_cycle=32",
        "fetch.lookups_per_cycle=32",
        "traverse.quads_per_cycle=1",
        "traverse.tests_per_cycle=64",
        "traverse.blocks_per_cycle=8",
        "color.quads_per_cycle=16",
        "core.issue=8",
        "scanout.enabled=false",
        &format!("setup.interval={interval}"),
    ];
    let report = replay(&config(class.name(), &changes)?, &scene)?;
    Ok((report.cycles as f64, funnel(&report.total)?.quads_rasterized as f64 / f64::from(triangles)))
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let intervals: &[u32] = setting.pick(&[16], &[16, 48], &[16, 48]);
    let mut rows = Vec::new();
    for &interval in intervals {
        let mut sweep = Vec::new();
        for legs in [4.0_f32, 6.0, 8.0, 11.0, 16.0, 23.0, 32.0] {
            // Both draw the same quads; only the one that bins has tiles.
            let (tiled, _) = cycles(setting, SortClass::MiddleBinned, interval, legs)?;
            let (whole, quads) = cycles(setting, SortClass::Middle, interval, legs)?;
            // The time of a triangle's pixels by that of its setup, and the slow-down.
            sweep.push((quads / f64::from(interval), tiled / whole));
        }
        let peak = sweep.iter().copied().max_by(|a, b| a.1.total_cmp(&b.1)).context("nothing was measured")?;
        let ends = sweep[0].1.max(sweep[sweep.len() - 1].1);
        let case = format!("setup of {interval} cycles");
        // Half and twice are equally far off.
        let error = peak.0.max(1.0 / peak.0);
        rows.push(Row {
            case: format!("{case}: pixels' time by setup's at the peak (error: factor)"),
            expected: 1.0,
            measured: peak.0,
            error,
            allowed: 2.0,
        });
        rows.push(Row::at_least(format!("{case}: the peak by the higher of both ends"), 1.2, peak.1 / ends));
    }
    Ok(rows)
}
