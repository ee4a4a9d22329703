//! The FIFO between address and filter against the latency of memory.

use anyhow::Result;

use super::{ALONE, bilinear, rendered, textured};
use crate::draws::COVER;
use crate::harness::{config, run};
use crate::{Row, Section, Setting, Target};
use gfx::format::Format;
use trace::record;
use work::Event;

pub(super) const PREFETCH: Target = Target {
    id: "prefetch",
    section: Section::Memory,
    what: "Against the same trace on a memory that answers in a cycle: a texture unit whose FIFO is as deep as the latency is long keeps \
           97 % of the speed or more (Igehy, Eldridge and Proudfoot 1998), one of depth D keeps D/latency of it (a quad a cycle, each \
           with a line of its own; the latency with the way there and back)",
    bound: "97 % at least; 3 % of D/latency",
    fault: "three quarters as many misses in flight as the FIFO is deep",
    check,
};

/// A texture of which each quad of the screen reads a line of its own (`texels` = 2 for each pixel), or a quarter of one (1).
fn drawn(edge: u32, texels: u32) -> Result<Vec<Event>> {
    let texture = record::texture_2d(edge * texels, edge * texels, Format::Rgba8Unorm);
    let color = format!("textureSampleLevel(t, s, p.xy / {edge}.0, 0.0)");
    rendered(&textured([edge; 2], texture, bilinear(), 3, COVER, &color))
}

/// Cycles of a machine whose texture unit addresses a quad per cycle and holds nothing up but by its FIFO.
fn cycles(setting: &Setting, events: &[Event], depth: u32, latency: u32) -> Result<f64> {
    let misses = if setting.inject_fault { depth * 3 / 4 } else { depth };
    let changes = [
        "core.warps=64",
        "core.warp_width=64",
        "core.registers=1048576",
        "dispatch.reorder=256",
        "dispatch.quads_per_cycle=4",
        "texture.quads_per_cycle=1",
        "texture.lookups_per_cycle=32",
        "texture.filters_per_cycle=128",
        "texture.latency=1",
        "texture.queue=64",
        "memory.port_latency=1",
        "memory.port_width=4096",
        "memory.ideal_bytes_per_cycle=65536",
        &format!("texture.fifo={depth}"),
        &format!("texture.misses={misses}"),
        &format!("memory.ideal_latency={latency}"),
    ];
    let changes = [&ALONE[..], &changes].concat();
    Ok(run(&config("four-pipelines", &changes)?, events.iter().cloned())?.cycles as f64)
}

/// Cycles to the memory, and back.
const HOPS: u32 = 2;

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let edge = setting.pick(256, 512, 1024);
    let latencies: &[u32] = setting.pick(&[62], &[62, 254, 510], &[62, 126, 254, 510]);
    let mut rows = Vec::new();
    let own = drawn(edge, 2)?;
    let at_once = cycles(setting, &own, 1024, 1)?;
    for &latency in latencies {
        let trip = latency + HOPS;
        for depth in [trip / 4, trip / 2, trip * 3 / 4] {
            let expected = f64::from(depth) / f64::from(trip);
            let measured = at_once / cycles(setting, &own, depth, latency)?;
            rows.push(Row::within(format!("{trip} cycles, {depth} places: speed"), expected, measured, 0.03 * expected));
        }
        let measured = at_once / cycles(setting, &own, trip, latency)?;
        rows.push(Row::at_least(format!("{trip} cycles, {trip} places: speed"), 0.97, measured));
    }
    // What textures are drawn with as a rule: a line for every four quads.
    let shared = drawn(edge, 1)?;
    let latency = latencies[latencies.len() - 1];
    let trip = latency + HOPS;
    let measured = cycles(setting, &shared, 1024, 1)? / cycles(setting, &shared, trip, latency)?;
    rows.push(Row::at_least(format!("{trip} cycles, {trip} places, a texel a pixel: speed"), 0.97, measured));
    Ok(rows)
}
