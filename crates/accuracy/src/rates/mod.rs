//! Section E, rates: what units of known rates take, alone and together.

mod bottleneck;
mod queue;
mod roofline;

use anyhow::{Result, ensure};

use super::Target;
use super::harness::{config, counts, each, replay};
use machine::config::MemoryKind;
use machine::{Config, MachineReport};
use mem::{CACHES, CLIENTS, CacheCounts, ClientCounts, DRAM, DramCounts};
use sim::{UNITS, UnitCounts};
use stats::{Counter, Group, Heading, Tree, counter};
use synthetic::Scene;
use unit::core::{CORES, CoreCounts};
use unit::texture::{TEXTURES, TextureCounts};

/// Targets of the group, in order.
pub const TARGETS: &[Target] = &[queue::QUEUE, roofline::ROOFLINE, bottleneck::BOTTLENECK];

/// A machine of one pipeline in which nothing but six units takes time worth mentioning: one triangle is set up in 16 cycles, two quads
/// are found, four instructions of warps issued, four filter operations made and one quad blended per cycle, and memory moves 16 bytes.
const MACHINE: &[&str] = &[
    "pipelines=1",
    "geometry_units=1",
    "scanout.enabled=false",
    "fetch.indices_per_cycle=32",
    "fetch.lookups_per_cycle=32",
    "assembly.primitives_per_cycle=16",
    "clip.primitives_per_cycle=16",
    "clip.clip_cycles=1",
    "distribute.triangles_per_cycle=16",
    "setup.interval=16",
    "setup.queue=256",
    "network.receive_queue=256",
    "network.link_bytes=4096",
    "traverse.tests_per_cycle=64",
    "traverse.blocks_per_cycle=8",
    "traverse.quads_per_cycle=2",
    "traverse.queue=256",
    "traverse.hierarchical_z=false",
    "interpolate.quads_per_cycle=16",
    "interpolate.words_per_cycle=64",
    "interpolate.queue=128",
    "dispatch.quads_per_cycle=16",
    "dispatch.output_quads=16",
    "dispatch.output_queue=256",
    "dispatch.reorder=512",
    "core.issue=4",
    "core.float_lanes=128",
    "core.control_lanes=128",
    "core.special_lanes=128",
    "texture.quads_per_cycle=16",
    "texture.lookups_per_cycle=32",
    "texture.filters_per_cycle=4",
    "color.quads_per_cycle=16",
    "color.blends_per_cycle=1",
    "color.cache_blocks=64",
    "color.cache_ways=64",
    "color.misses=512",
    "color.fifo=512",
    "color.compression=false",
    "memory.kind=ideal",
    "memory.ideal_latency=50",
    "memory.ideal_bytes_per_cycle=16",
    "memory.port_width=256",
];

/// That machine with changes.
fn machine(changes: &[String]) -> Result<Config> {
    let changes: Vec<&str> = MACHINE.iter().copied().chain(changes.iter().map(String::as_str)).collect();
    config("sort-middle", &changes)
}

/// A square image with `count` layers of two triangles from border to border, without depth.
fn layers(edge: u32, count: u32) -> Scene {
    let e = edge as f32;
    let halves = [[[0.0, 0.0], [e, 0.0], [0.0, e]], [[e, 0.0], [e, e], [0.0, e]]];
    triangles(edge, (0..count).flat_map(|_| halves).collect())
}

/// These triangles on a square image, without depth.
fn triangles(edge: u32, shapes: Vec<[[f32; 2]; 3]>) -> Scene {
    Scene::plain(edge, edge, shapes, 512)
}

/// What a run has taken, and what its units had to do.
#[derive(Clone, Debug)]
struct Run {
    cycles: f64,
    /// By unit, the cycles that its work takes at its rate, of the one of a kind that has most.
    bounds: Vec<(&'static str, f64)>,
    /// Instructions of warps, times the invocations of a warp.
    instructions: f64,
    /// Bytes between units and memory.
    bytes: f64,
}

impl Run {
    fn of(config: &Config, scene: &Scene) -> Result<Run> {
        let MachineReport { total: tree, cycles, .. } = replay(config, scene)?;
        let instructions: f64 = classes(&counts(&tree, CORES)?).iter().sum();
        Ok(Run {
            cycles: cycles as f64,
            bounds: bounds(config, scene, &tree)?,
            instructions: instructions * f64::from(config.core.warp_width),
            bytes: clients(&tree)?.iter().map(|[read, written]| read + written).sum(),
        })
    }

    /// What the second of two runs has more: what neither begins nor ends with.
    fn beyond(&self, shorter: &Run) -> Result<Run> {
        let more = |(long, short): (&(&'static str, f64), &(&'static str, f64))| {
            ensure!(long.0 == short.0, "runs of two machines are compared");
            Ok((long.0, long.1 - short.1))
        };
        Ok(Run {
            cycles: self.cycles - shorter.cycles,
            bounds: self.bounds.iter().zip(&shorter.bounds).map(more).collect::<Result<_>>()?,
            instructions: self.instructions - shorter.instructions,
            bytes: self.bytes - shorter.bytes,
        })
    }

    /// The unit that has most to do, and how long that takes.
    fn slowest(&self) -> (&'static str, f64) {
        self.bounds.iter().copied().fold(("none", 0.0), |most, bound| if bound.1 > most.1 { bound } else { most })
    }
}

/// Instructions of warps by class: float, integer, special, control, multiplications.
fn classes(core: &CoreCounts) -> [f64; 5] {
    [core.float, core.integer, core.special, core.control, core.multiply].map(|instructions| instructions as f64)
}

/// Bytes read and written by each client of memory.
fn clients(tree: &Tree) -> Result<Vec<[f64; 2]>> {
    let bytes = |counts: ClientCounts| [counts.read_bytes, counts.write_bytes].map(|bytes| bytes as f64);
    Ok(each(tree, CLIENTS)?.into_iter().map(bytes).collect())
}

/// What each kind of unit needs at least for what it has done: its work by its rate, as both are declared.
fn bounds(config: &Config, scene: &Scene, tree: &Tree) -> Result<Vec<(&'static str, f64)>> {
    fn most<G: Group>(tree: &Tree, heading: Heading, counter: Counter<G>) -> Result<f64> {
        Ok(each(tree, heading)?.iter().map(|counts| counter.of(counts)).max().unwrap_or(0) as f64)
    }
    let items = |units| most(tree, UNITS.named(units), counter!(UnitCounts, items));
    let by = |work: f64, rate: u32| work / f64::from(rate);
    let core = &config.core;
    let lanes = core.lanes();
    let mut shading: f64 = 0.0;
    for counts in each(tree, CORES)? {
        let issued = classes(&counts);
        shading = shading.max(by(issued.iter().sum(), core.issue));
        shading = (0..5).map(|class| by(issued[class] * f64::from(core.warp_width), lanes[class])).fold(shading, f64::max);
    }
    // Every fragment of these scenes has eight words.
    let turns = f64::from(8_u32.div_ceil(config.interpolate.words_per_cycle));
    let setup = if config.setup.interval > 1 {
        items("setup")? * f64::from(config.setup.interval)
    } else {
        by(items("setup")?, config.setup.triangles_per_cycle)
    };
    let blends = if scene.blend { config.color.blends_per_cycle } else { config.color.quads_per_cycle };
    let texture = by(most(tree, TEXTURES, counter!(TextureCounts, operations))?, config.texture.filters_per_cycle)
        .max(by(most(tree, TEXTURES, counter!(TextureCounts, quads))?, config.texture.quads_per_cycle))
        .max(by(most(tree, CACHES.named("texture"), counter!(CacheCounts, accesses))?, config.texture.lookups_per_cycle));
    let clients = clients(tree)?;
    let ports = clients.iter().flatten().fold(0.0, |most: f64, &bytes| most.max(by(bytes, config.memory.port_width)));
    let mut bounds = vec![
        ("fetch", by(items("fetch")?, config.fetch.indices_per_cycle)),
        ("assembly", by(items("assembly")?, config.assembly.primitives_per_cycle)),
        ("clip", by(items("clip")?, config.clip.primitives_per_cycle)),
        ("setup", setup),
        ("traverse", by(items("traverse")?, config.traverse.quads_per_cycle)),
        ("depth", by(items("depth")?, config.depth.quads_per_cycle)),
        ("interpolate", by(turns * items("interpolate")?, config.interpolate.quads_per_cycle)),
        ("dispatch", by(items("dispatch")?, config.dispatch.quads_per_cycle)),
        ("shading", shading),
        ("texture", texture),
        ("color", by(items("color")?, blends)),
        ("ports", ports),
    ];
    if config.memory.kind == MemoryKind::Ideal {
        let bytes = clients.iter().flatten().sum::<f64>();
        bounds.push(("memory", by(bytes, config.memory.ideal_bytes_per_cycle)));
    } else {
        let dram = &config.dram;
        let DramCounts { read_bytes, write_bytes, .. } = counts(tree, DRAM)?;
        let bytes = (read_bytes + write_bytes) as f64;
        // Bursts of all channels in cycles of their clock, and these in cycles of the card.
        let bursts = bytes / f64::from(dram.burst_bytes * dram.channels) * f64::from(dram.burst_cycles);
        bounds.push(("memory", bursts * f64::from(dram.card_cycles) / f64::from(dram.clock)));
    }
    Ok(bounds)
}
