//! Section E, rates: what units of known rates take, alone and together.

mod bottleneck;
mod roofline;

use anyhow::{Result, ensure};

use super::Target;
use super::harness::{config, figure, replay};
use machine::Config;
use machine::config::MemoryKind;
use mem::ClientCounts;
use stats::{Node, Tree};
use synthetic::Scene;

/// Targets of the group, in order.
pub const TARGETS: &[Target] = &[yardstick::QUEUE, roofline::ROOFLINE, bottleneck::BOTTLENECK];

/// A machine of one pipeline in which nothing but six units takes time worth mentioning: one triangle is set up in 16 cycles, two quads
/// are found, four instructions of warps issued, four filter operations made and one quad blended a cycle, and memory moves 16 bytes.
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

/// So many layers of two triangles from border to border of a square image, without depth.
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
        let tree = replay(config, scene)?.total;
        let instructions: f64 = CLASSES.iter().map(|class| each(&tree, "shading.core", class).iter().sum::<f64>()).sum();
        Ok(Run {
            cycles: figure(&tree, "cycles")?,
            bounds: bounds(config, scene, &tree)?,
            instructions: instructions * f64::from(config.core.warp_width),
            bytes: clients(&tree).iter().map(|[read, written]| read + written).sum(),
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

/// Classes of instructions, as the statistics name them.
const CLASSES: [&str; 4] = ["float", "integer", "special", "control"];

/// One figure of every tree of a list; nothing where there is no such list.
fn each(tree: &Tree, list: &str, leaf: &str) -> Vec<f64> {
    (0..).map_while(|index| tree.number(&format!("{list}[{index}].{leaf}"))).collect()
}

/// Bytes read and written by each client of memory.
fn clients(tree: &Tree) -> Vec<[f64; 2]> {
    let Some(Node::Tree(clients)) = tree.get("memory.clients") else { return Vec::new() };
    let bytes = |name: &str| {
        let counts: ClientCounts = tree.group(&format!("memory.clients.{name}"));
        [counts.read_bytes, counts.write_bytes].map(|bytes| bytes as f64)
    };
    clients.entries().map(|(name, _)| bytes(name)).collect()
}

/// What each kind of unit needs at least for what it has done: its work by its rate, as both are declared.
fn bounds(config: &Config, scene: &Scene, tree: &Tree) -> Result<Vec<(&'static str, f64)>> {
    let most = |list: &str, leaf: &str| each(tree, list, leaf).into_iter().fold(0.0, f64::max);
    let by = |work: f64, rate: u32| work / f64::from(rate);
    let core = &config.core;
    let lanes = [core.float_lanes, core.integer_lanes, core.special_lanes, core.control_lanes];
    let classes = CLASSES.map(|class| each(tree, "shading.core", class));
    let mut shading: f64 = 0.0;
    for index in 0..classes[0].len() {
        let of = |class: usize| classes[class][index];
        shading = shading.max(by((0..4).map(of).sum(), core.issue));
        shading = (0..4).map(|class| by(of(class) * f64::from(core.warp_width), lanes[class])).fold(shading, f64::max);
    }
    // Every fragment of these scenes has eight words.
    let turns = f64::from(8_u32.div_ceil(config.interpolate.words_per_cycle));
    let setup = if config.setup.interval > 1 {
        most("units.setup", "items") * f64::from(config.setup.interval)
    } else {
        by(most("units.setup", "items"), config.setup.triangles_per_cycle)
    };
    let blends = if scene.blend { config.color.blends_per_cycle } else { config.color.quads_per_cycle };
    let texture = by(most("shading.texture", "operations"), config.texture.filters_per_cycle)
        .max(by(most("shading.texture", "quads"), config.texture.quads_per_cycle))
        .max(by(most("caches.texture", "accesses"), config.texture.lookups_per_cycle));
    let clients = clients(tree);
    let ports = clients.iter().flatten().fold(0.0, |most: f64, &bytes| most.max(by(bytes, config.memory.port_width)));
    let mut bounds = vec![
        ("fetch", by(most("units.fetch", "items"), config.fetch.indices_per_cycle)),
        ("assembly", by(most("units.assembly", "items"), config.assembly.primitives_per_cycle)),
        ("clip", by(most("units.clip", "items"), config.clip.primitives_per_cycle)),
        ("setup", setup),
        ("traverse", by(most("units.traverse", "items"), config.traverse.quads_per_cycle)),
        ("depth", by(most("units.depth", "items"), config.depth.quads_per_cycle)),
        ("interpolate", by(turns * most("units.interpolate", "items"), config.interpolate.quads_per_cycle)),
        ("dispatch", by(most("units.dispatch", "items"), config.dispatch.quads_per_cycle)),
        ("shading", shading),
        ("texture", texture),
        ("color", by(most("units.color", "items"), blends)),
        ("ports", ports),
    ];
    if config.memory.kind == MemoryKind::Ideal {
        let bytes = clients.iter().flatten().sum::<f64>();
        bounds.push(("memory", by(bytes, config.memory.ideal_bytes_per_cycle)));
    } else {
        let dram = &config.dram;
        let bytes = figure(tree, "memory.dram.read_bytes")? + figure(tree, "memory.dram.write_bytes")?;
        // Bursts of all channels in cycles of their clock, and these in cycles of the card.
        let bursts = bytes / f64::from(dram.burst_bytes * dram.channels) * f64::from(dram.burst_cycles);
        bounds.push(("memory", bursts * f64::from(dram.card_cycles) / f64::from(dram.clock)));
    }
    Ok(bounds)
}
