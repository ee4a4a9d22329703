//! Section D: depth. Layers over blocks of pixels, each block with an order of its own, on a whole machine.

use anyhow::{Result, ensure};

use super::harness::{config, counts, funnel, replay, wrong_pixels};
use super::{Row, Section, Setting, Target};
use gfx::codec;
use gfx::format::Format;
use gfx::reference;
use gfx::setup::{self, Bounds, DepthBias, ScreenVertex, SetupState, Triangle};
use gfx::state::{Compare, CullMode, FrontFace};
use gfx::texel::depth_code;
use machine::{Config, MachineReport};
use mem::{CLIENTS, ClientCounts};
use num::Random;
use stats::Tree;
use synthetic::Scene;
use unit::block_cache::{BlockCounts, ROP};
use unit::depth::DepthCounts;
use unit::traverse::{TRAVERSAL, TraverseCounts};

/// Targets of the section, in order.
pub const TARGETS: &[Target] = &[HARMONIC, HIZ, FAST_CLEAR, PLANE_CODEC];

const HARMONIC: Target = Target {
    id: "harmonic",
    section: Section::Depth,
    what: "Depth writes of a pixel under d layers: 1 + 1/2 + ... + 1/d in random order, 1 front to back, d back to front (blocks of 8x8 \
           pixels, each with an order of its own)",
    bound: "4 standard deviations, of variance sum(1/k - 1/k^2); exact in order",
    fault: "the first triangle of each frame is lost on its way to the machine",
    check: harmonic,
};

const HIZ: Target = Target {
    id: "hiz",
    section: Section::Depth,
    what: "Blocks that hierarchical Z lets through under d layers of constant depth in random order: as many as change the block's \
           depth; never fewer than the exact test passes, the picture that of API order. Where blocks are accepted by their least \
           depth, too, layers that cover them whole are drawn without any depth being read; blocks covered in part still are, and \
           no sample that is accepted fails",
    bound: "4 standard deviations of the harmonic number; exact against the exact test",
    fault: "hierarchical Z learns of depths only when blocks leave the Z cache",
    check: hierarchical,
};

const FAST_CLEAR: Target = Target {
    id: "fast-clear",
    section: Section::Depth,
    what: "Clears by flag move no memory (flags are on the chip, a block takes 1/clears_per_cycle of a cycle) and blocks that nothing \
           was drawn in are neither read nor written; clears in memory write pixels x bytes",
    bound: "exact",
    fault: "attachments are cleared in memory",
    check: fast_clear,
};

const PLANE_CODEC: Target = Target {
    id: "plane-codec",
    section: Section::Depth,
    what: "Blocks of depth that one triangle covers always compress; white noise never takes more than its size and a header of a byte; \
           all come back as they were",
    bound: "exact",
    fault: "depths have white noise added",
    check: plane_codec,
};

/// Edge of a block.
const BLOCK: u32 = 8;

/// Layers over every block: of each layer two triangles per block, whose depth is that of the layer's place in the block's order.
fn layers(edge: u32, depths: impl Fn(u32) -> Vec<f32>) -> Scene {
    let across = edge / BLOCK;
    let orders: Vec<Vec<f32>> = (0..across * across).map(depths).collect();
    let mut scene =
        Scene { width: edge, height: edge, draws: 1, textures: 0, instructions: 1, compare: Compare::Less, ..Scene::default() };
    for layer in 0..orders[0].len() {
        for (block, order) in orders.iter().enumerate() {
            let (x, y) = (block as u32 % across * BLOCK, block as u32 / across * BLOCK);
            let [x0, y0, x1, y1] = [x, y, x + BLOCK, y + BLOCK].map(|v| v as f32);
            scene.shapes.extend([[[x0, y0], [x1, y0], [x0, y1]], [[x1, y0], [x1, y1], [x0, y1]]]);
            scene.depths.extend([order[layer]; 2]);
        }
    }
    scene.triangles = scene.shapes.len() as u32;
    scene.segments = scene.triangles.div_ceil(2048);
    scene
}

/// The depth of layer `k` of `layers`, nearest first.
fn depth_of(k: usize, layers: usize) -> f32 {
    (k + 1) as f32 / (layers + 1) as f32
}

fn in_random_order(edge: u32, count: usize, seed: u64) -> Scene {
    layers(edge, |block| {
        let mut order: Vec<f32> = (0..count).map(|k| depth_of(k, count)).collect();
        Random::nth(seed ^ (count as u64) << 32, block.into()).shuffle(&mut order);
        order
    })
}

/// The mean number of layers that are nearer than all before them, and its variance.
fn records(layers: usize) -> (f64, f64) {
    (1..=layers).map(|k| k as f64).fold((0.0, 0.0), |(mean, variance), k| (mean + 1.0 / k, variance + 1.0 / k - 1.0 / (k * k)))
}

/// A machine whose hierarchical Z knows of a layer before the next one comes.
fn machine(hierarchical: bool, update: &str) -> Result<Config> {
    let changes = [
        "pipelines=1",
        "memory.kind=ideal",
        "traverse.hierarchical_latency=1",
        &format!("traverse.hierarchical_z={hierarchical}"),
        &format!("traverse.hierarchical_update={update}"),
        "scanout.enabled=false",
    ];
    config("four-pipelines", &changes)
}

/// Depth writes per pixel that a machine counts under a scene, which loses its first triangle where a fault is injected.
fn writes(setting: &Setting, mut scene: Scene) -> Result<f64> {
    if setting.inject_fault {
        scene.shapes[0] = [[0.0; 2]; 3];
    }
    let report = replay(&machine(true, "write")?, &scene)?;
    Ok(funnel(&report.total)?.fragments_written as f64 / f64::from(scene.width * scene.height))
}

/// Numbers of layers, and the edge of the image: so large that a layer has passed before the next one comes.
fn sizes(setting: &Setting) -> (&'static [usize], u32) {
    setting.pick((&[4, 11], 128), (&[4, 11, 31, 83], 384), (&[4, 11, 31, 83], 768))
}

fn harmonic(setting: &Setting) -> Result<Vec<Row>> {
    let (counts, edge) = sizes(setting);
    let blocks = f64::from((edge / BLOCK).pow(2));
    let mut rows = Vec::new();
    for &count in counts {
        let (mean, variance) = records(count);
        let measured = writes(setting, in_random_order(edge, count, setting.seed))?;
        rows.push(Row::within(format!("{count} layers, random order"), mean, measured, 4.0 * (variance / blocks).sqrt()));
    }
    let ordered = |back: bool| layers(edge, |_| (0..11).map(|k| depth_of(if back { 10 - k } else { k }, 11)).collect());
    rows.push(Row::exact("11 layers, front to back", 1.0, writes(setting, ordered(false))?));
    rows.push(Row::exact("11 layers, back to front", 11.0, writes(setting, ordered(true))?));
    Ok(rows)
}

fn hierarchical(setting: &Setting) -> Result<Vec<Row>> {
    let (counts, edge) = sizes(setting);
    let blocks = f64::from((edge / BLOCK).pow(2));
    let update = if setting.inject_fault { "eviction" } else { "write" };
    let mut rows = Vec::new();
    for &count in counts {
        let scene = in_random_order(edge, count, setting.seed.wrapping_add(1));
        let with = replay(&machine(true, update)?, &scene)?;
        let without = replay(&machine(false, update)?, &scene)?;
        let survivors = |tree: &Tree| -> Result<f64> {
            let funnel = funnel(tree)?;
            // Two triangles make a layer of a block.
            Ok((funnel.tiles_visited as f64 - funnel.tiles_hiz_culled as f64) / (2.0 * blocks))
        };
        let passed =
            |tree: &Tree| -> Result<f64> { Ok(funnel(tree)?.fragments_written as f64 / f64::from(scene.width * scene.height)) };
        ensure!(funnel(&without.total)?.tiles_hiz_culled == 0, "hierarchical Z culls where it is switched off");
        let (mean, variance) = records(count);
        let measured = survivors(&with.total)?;
        rows.push(Row::within(format!("{count} layers: blocks let through"), mean, measured, 4.0 * (variance / blocks).sqrt()));
        rows.push(Row::exact(format!("{count} layers: those that the exact test passes"), passed(&without.total)?, measured));
        rows.push(Row::exact(
            format!("{count} layers: fragments written with and without"),
            passed(&without.total)?,
            passed(&with.total)?,
        ));
        rows.push(Row::none(format!("{count} layers: pixels not those of API order"), wrong_pixels(&with)?));
    }
    rows.extend(accepted(setting, edge)?);
    Ok(rows)
}

/// Layers from border to border, each one triangle, and how often the depth of a pixel changes under them.
fn whole_layers(edge: u32, count: usize, seed: u64) -> (Scene, f64) {
    let mut depths: Vec<f32> = (0..count).map(|k| depth_of(k, count)).collect();
    Random::new(seed).shuffle(&mut depths);
    let changes = (0..count).filter(|&k| depths[..k].iter().all(|&before| depths[k] < before)).count();
    let far = 2.0 * edge as f32 + 8.0;
    let scene = Scene {
        triangles: count as u32,
        segments: 1,
        shapes: vec![[[-1.0, -1.0], [far, -1.0], [-1.0, far]]; count],
        depths,
        ..Scene { width: edge, height: edge, ..layers(BLOCK, |_| Vec::new()) }
    };
    (scene, changes as f64)
}

/// Acceptance by the least depth, with a Z cache that holds a small part of the image.
fn accepted(setting: &Setting, edge: u32) -> Result<Vec<Row>> {
    let run = |accept: bool, scene: &Scene| -> Result<(Tree, u64)> {
        let mut config = machine(true, if setting.inject_fault { "eviction" } else { "write" })?;
        config.set("depth.cache_blocks=4")?;
        config.set(&format!("traverse.hierarchical_accept={accept}"))?;
        config.check()?;
        let report = replay(&config, scene)?;
        let wrong = wrong_pixels(&report)?;
        Ok((report.total, wrong))
    };
    let read = |tree: &Tree| Ok::<_, anyhow::Error>(counts::<ClientCounts>(tree, CLIENTS.named("depth"))?.read_bytes);
    let mut rows = Vec::new();
    let blocks = f64::from((edge / BLOCK).pow(2));
    for count in [4, 31] {
        // Not the nearest first, which leaves nothing to be told apart.
        let seeds = (0..).map(|k| whole_layers(edge, count, setting.seed.wrapping_add(k)));
        let Some((scene, changes)) = seeds.into_iter().find(|&(_, changes)| changes > 1.0) else { continue };
        let (with, wrong) = run(true, &scene)?;
        let (without, _) = run(false, &scene)?;
        let name = format!("{count} layers that cover blocks whole");
        let accepted = counts::<TraverseCounts>(&with, TRAVERSAL)?.accepted as f64 / blocks;
        rows.push(Row::exact(format!("{name}: accepted of a block"), changes, accepted));
        // The first layer finds all blocks cleared by flag, and the others in memory.
        let overwritten = counts::<BlockCounts>(&with, ROP.named("depth"))?.overwritten as f64 / blocks;
        rows.push(Row::exact(format!("{name}: written over without a look of a block"), changes - 1.0, overwritten));
        rows.push(Row::none(format!("{name}: bytes of depth read"), read(&with)?));
        rows.push(Row::at_least(format!("{name}: bytes of depth read where none is accepted"), 1.0, read(&without)? as f64));
        let failed = counts::<DepthCounts>(&with, ROP.named("depth"))?.accepted_failed;
        rows.push(Row::none(format!("{name}: accepted samples that fail"), failed));
        rows.push(Row::none(format!("{name}: pixels not those of API order"), wrong));
    }
    let scene = in_random_order(edge, 4, setting.seed);
    let (with, wrong) = run(true, &scene)?;
    rows.push(Row::at_least("layers that cover blocks in part: bytes of depth read", 1.0, read(&with)? as f64));
    rows.push(Row::none("layers that cover blocks in part: pixels not those of API order", wrong));
    Ok(rows)
}

fn fast_clear(setting: &Setting) -> Result<Vec<Row>> {
    let edge = setting.pick(64, 256, 1024);
    // One triangle in one block: all others are only cleared.
    let mut scene = layers(BLOCK, |_| vec![0.5]);
    (scene.width, scene.height) = (edge, edge);
    let run = |by_flag: bool, rate: u32, scene: &Scene| -> Result<MachineReport> {
        let changes = [
            "pipelines=1",
            "memory.kind=ideal",
            "scanout.enabled=false",
            &format!("color.fast_clear={by_flag}"),
            &format!("color.clears_per_cycle={rate}"),
        ];
        replay(&config("four-pipelines", &changes)?, scene)
    };
    let by_flag = run(!setting.inject_fault, 1, &scene)?;
    let faster = run(!setting.inject_fault, 2, &scene)?;
    let in_memory = run(false, 1, &scene)?;
    let (blocks, pixels) = (f64::from((edge / BLOCK).pow(2)), f64::from(edge * edge));
    let client = |report: &MachineReport, name| counts::<ClientCounts>(&report.total, CLIENTS.named(name));
    let rop = |report: &MachineReport, name| counts::<BlockCounts>(&report.total, ROP.named(name));
    let written = |report: &MachineReport| Ok::<_, anyhow::Error>(client(report, "command")?.write_bytes as f64);
    let mut rows = vec![
        Row::exact("by flag: bytes written by clears", 0.0, written(&by_flag)?),
        // Colour and depth.
        Row::exact("by flag: cycles a block and surface", 1.0, (by_flag.cycles as f64 - faster.cycles as f64) / blocks),
        Row::exact("in memory: bytes written by clears", 2.0 * 4.0 * pixels, written(&in_memory)?),
    ];
    for name in ["depth", "color"] {
        let (flagged, loaded) = (rop(&by_flag, name)?, rop(&in_memory, name)?);
        let read = client(&by_flag, name)?.read_bytes;
        rows.push(Row::exact(format!("by flag: bytes of {name} read"), 0.0, read as f64));
        rows.push(Row::exact(format!("by flag: blocks of {name} filled from flags"), 1.0, flagged.cleared_fills as f64));
        rows.push(Row::exact(format!("by flag: blocks of {name} written back"), 1.0, flagged.write_backs as f64));
        rows.push(Row::exact(format!("in memory: blocks of {name} read"), 1.0, loaded.fills as f64));
    }
    Ok(rows)
}

/// A triangle that covers the block at (64, 64), of random slope.
fn over_a_block(random: &mut Random, samples: u32) -> Option<Triangle> {
    let state = SetupState {
        bounds: Bounds { x0: 64, y0: 64, x1: 72, y1: 72 },
        depth_range: [0.0, 1.0],
        bias: DepthBias::NONE,
        front_face: FrontFace::Ccw,
        cull: CullMode::None,
        samples,
        lower_edges: false,
        unclipped_depth: false,
        half_width: None,
    };
    let size = 16 << random.below(10);
    let v: [ScreenVertex; 3] = std::array::from_fn(|_| ScreenVertex {
        x: 68 * 256 + random.between(-size * 128, size * 128),
        y: 68 * 256 + random.between(-size * 128, size * 128),
        z: random.unit(),
        inv_w: 1.0,
    });
    let corners = [[64, 64], [72, 64], [64, 72], [72, 72]].map(|p| p.map(|v: i64| v * 256));
    let at = v.map(|v| [i64::from(v.x), i64::from(v.y)]);
    let covers = corners.into_iter().all(|corner| reference::triangle_covers(at, corner));
    covers.then(|| setup::triangle(&state, &v).ok()).flatten()
}

/// The codes of a block in the order of tiles: quads row by row, in a quad sample after sample, in a sample the four pixels.
fn codes(samples: u32, mut code: impl FnMut([f32; 2]) -> u32) -> Vec<u32> {
    let places = reference::samples(samples);
    let mut out = Vec::new();
    for quad in 0..16 {
        for place in &places {
            for pixel in 0..4 {
                let at = [64 + quad % 4 * 2 + pixel % 2, 64 + quad / 4 * 2 + pixel / 2];
                out.push(code([0, 1].map(|k| at[k] as f32 + place[k] as f32 / 256.0)));
            }
        }
    }
    out
}

fn plane_codec(setting: &Setting) -> Result<Vec<Row>> {
    let mut rows = Vec::new();
    let (n, each) = (setting.pick(20, 500, 10_000), 100);
    for format in [Format::Depth16Unorm, Format::Depth24Plus, Format::Depth32Float] {
        for samples in [1, 4] {
            let raw = codec::raw_bytes(format, samples as usize);
            let counts = setting.pieces(n, |_, random| {
                let [mut covered, mut large, mut most, mut lost] = [0_u64; 4];
                for _ in 0..each {
                    if let Some(triangle) = over_a_block(random, samples) {
                        let noise = if setting.inject_fault { !0 } else { 0 };
                        let mask = if format == Format::Depth16Unorm { 0xffff } else { 0x00ff_ffff };
                        let block =
                            codes(samples, |[x, y]| depth_code(format, triangle.depth.at(x, y)) ^ random.bits() & noise & mask);
                        covered += 1;
                        large += u64::from(codec::stored_bytes(format, samples as usize, &block) >= raw);
                        let encoded = codec::encode(format, samples as usize, &block);
                        lost += u64::from(codec::decode(format, samples as usize, &encoded) != Some(block));
                    }
                    let mask = if format == Format::Depth16Unorm { 0xffff } else { !0 };
                    let noise = codes(samples, |_| random.bits() & mask);
                    let encoded = codec::encode(format, samples as usize, &noise);
                    most = most.max((encoded.len() as u64).saturating_sub(raw.into()));
                    lost += u64::from(codec::decode(format, samples as usize, &encoded) != Some(noise));
                }
                [covered, large, most, lost]
            });
            let sum = |k: usize| counts.iter().map(|counts| counts[k]).sum::<u64>();
            ensure!(sum(0) > 20, "only {} triangles covered the block", sum(0));
            let name = format!("{}, {samples}x", format.name());
            rows.push(Row::none(format!("{name}: covered by one triangle and not smaller"), sum(1)));
            let most = counts.iter().map(|counts| counts[2]).max().unwrap_or(0);
            rows.push(Row::at_most(format!("{name}: bytes of white noise beyond its size"), most as f64, 1.0));
            rows.push(Row::none(format!("{name}: blocks that did not come back as they were"), sum(3)));
        }
    }
    // On a machine, whose picture is one triangle from border to border.
    let mut scene = layers(BLOCK, |_| Vec::new());
    (scene.width, scene.height, scene.triangles, scene.segments) = (64, 64, 1, 1);
    scene.shapes = vec![[[-1.0, -1.0], [200.0, -1.0], [-1.0, 200.0]]];
    let total = replay(&config("four-pipelines", &["memory.kind=ideal"])?, &scene)?.total;
    let compressed = counts::<BlockCounts>(&total, ROP.named("depth"))?.compressed;
    rows.push(Row::exact("blocks that a machine writes compressed", 64.0, compressed as f64));
    Ok(rows)
}
