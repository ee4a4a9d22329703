//! Speed-up by pipelines: linear if nothing limits it; if something does, the loss is attributed to its causes, exact to the cycle.

use crate::common::{Figures, config, run};
use fillrate::gfx::state::Compare;
use fillrate::machine::{Config, MachineReport};
use fillrate::sim::Clock;
use fillrate::stats::{Leaf, Node};
use fillrate::synthetic::{Scene, events};
use fillrate::work::{Event, Shade};

const CLASSES: [&str; 5] = ["sort-first", "sort-middle", "sort-middle-binned", "sort-last-fragment", "sort-last-image"];

/// The parts into which the pipelines' cycles are split.
const PARTS: [&str; 11] = [
    "useful",
    "overlap",
    "imbalance",
    "network",
    "reorder_stalls",
    "memory",
    "latency",
    "upstream",
    "downstream_backpressure",
    "front_end",
    "outside_pass",
];

/// What makes a machine ideal but for its shader cores: a memory without time, links as wide as anything that is sent, with a latency of
/// a cycle and places for all of it, fronts that are never behind, and no scan-out. A core issues an instruction per cycle.
const IDEAL: &[&str] = &[
    "memory.kind=ideal",
    "memory.ideal_latency=1",
    "memory.ideal_bytes_per_cycle=65536",
    "memory.port_width=4096",
    "memory.port_latency=1",
    "network.topology=point-to-point",
    "network.link_bytes=65536",
    "network.link_latency=1",
    "network.receive_queue=4096",
    "fetch.indices_per_cycle=32",
    "fetch.lookups_per_cycle=32",
    "assembly.batch=1",
    "distribute.tile=32",
    "bin.tile=32",
    "compose.samples_per_cycle=4096",
    "scanout.enabled=false",
    "core.per_pipeline=1",
    "core.issue=1",
    "core.float_latency=1",
    "core.special_latency=1",
    "core.control_latency=1",
];

fn machine(class: &str, pipelines: u32, more: &[&str]) -> Config {
    let (pipelines, geometry) = (format!("pipelines={pipelines}"), format!("geometry_units={}", pipelines.min(16)));
    config(class, &[IDEAL, &[&pipelines, &geometry], more].concat())
}

const TILE: u32 = 32;

/// A right triangle at the beginning of a tile in the row. One with legs of 31 pixels has 120 quads, which fill 15 warps.
fn in_tile(tile: u32, legs: f32) -> [[f32; 2]; 3] {
    let x = (tile * TILE) as f32;
    [[x, 0.0], [x + legs, 0.0], [x, legs]]
}

/// A row of tiles with these triangles. Every pipeline owns the same number of tiles if the number of pipelines divides that of tiles.
fn row(tiles: u32, shapes: Vec<[[f32; 2]; 3]>, instructions: u32) -> Scene {
    Scene {
        width: TILE * tiles,
        height: TILE,
        draws: 1,
        segments: 1,
        triangles: shapes.len() as u32,
        depth_format: None,
        compare: Compare::Always,
        textures: 0,
        instructions,
        shapes,
        ..Scene::default()
    }
}

/// This number of triangles within each tile, in turn.
fn balanced(tiles: u32, rounds: u32, instructions: u32) -> Scene {
    row(tiles, (0..tiles * rounds).map(|n| in_tile(n % tiles, 31.0)).collect(), instructions)
}

/// The work of a scene for a class of machines.
fn work(class: &str, scene: &Scene) -> Vec<Event> {
    let covered = config(class, &[]).render_key().shade == Shade::Covered;
    events(&Scene { covered, ..scene.clone() })
}

/// Shares of the pipelines' cycles by cause. All of them add up to the whole, in the run and in its frames.
struct Split(Vec<(&'static str, f64)>);

impl Split {
    fn of(report: &MachineReport, pipelines: u32) -> Split {
        let mut shares = Vec::new();
        for tree in report.frames.iter().map(|frame| &frame.tree).chain([&report.total]) {
            let f = Figures(tree);
            let whole = f.at("sort.loss.pipeline_cycles");
            assert_eq!(whole, u64::from(pipelines) * f.at("cycles"));
            let parts = PARTS.map(|part| (part, f.at(&format!("sort.loss.{part}"))));
            assert_eq!(parts.iter().map(|(_, cycles)| cycles).sum::<u64>(), whole, "{parts:?}");
            shares = parts.map(|(part, cycles)| (part, cycles as f64 / whole as f64)).to_vec();
        }
        Split(shares)
    }

    fn at(&self, part: &str) -> f64 {
        self.0.iter().find(|(name, _)| *name == part).map_or(f64::NAN, |(_, share)| *share)
    }

    /// Asserts that a cause loses more than all others together.
    fn is_most(&self, cause: &str, of: &str) {
        let lost = 1.0 - self.at("useful");
        assert!(self.at(cause) > lost / 2.0 && lost > 0.5, "{of}: not {cause}, but {:?}", self.0);
    }
}

/// A run, with the shares of its pipelines' cycles.
fn split(class: &str, pipelines: u32, more: &[&str], scene: &Scene) -> (MachineReport, Split) {
    let report = run(&machine(class, pipelines, more), &work(class, scene), Clock::SkipIdle);
    let split = Split::of(&report, pipelines);
    (report, split)
}

#[test]
fn balanced_work_without_overlap_scales_linearly() {
    for (tiles, of_image, counts) in [(64, 4, &[1_u32, 16, 64][..]), (63, 3, &[1, 63])] {
        for class in CLASSES {
            // Composition takes the longer the larger the picture. Where primitives are dealt, pipelines need no tiles of their own.
            let across = if class == "sort-last-image" { of_image } else { tiles };
            let work = work(class, &balanced(across, 3 * tiles / across, 2500));
            let mut one = 0.0;
            for &pipelines in counts {
                let report = run(&machine(class, pipelines, &[]), &work, Clock::SkipIdle);
                let split = Split::of(&report, pipelines);
                let cycles = report.cycles as f64;
                one = if pipelines == 1 { cycles } else { one };
                for share in [one / cycles / f64::from(pipelines), split.at("useful")] {
                    assert!((share - 1.0).abs() < 0.005, "{class}, {pipelines}: {share:.4} of linear; {:?}", split.0);
                }
                assert_eq!(report.total.number("sort.loss.efficiency"), Some(split.at("useful")));
            }
        }
    }
}

#[test]
fn copies_are_overlap() {
    // A band over all tiles, whose setup takes longer than its pixels in a tile.
    let scene = row(16, vec![[[0.0, 0.0], [512.0, 0.0], [0.0, 1.5]]; 600], 1);
    for class in ["sort-first", "sort-middle", "sort-middle-binned"] {
        let (report, split) = split(class, 4, &["setup.interval=64", "core.issue=8"], &scene);
        assert!(report.total.get("sort.loss.stage") == Some(&Node::Leaf(Leaf::Text("setup".to_owned()))), "{class}");
        let copies = report.total.number("sort.overlap").unwrap();
        assert!(copies >= 4.0, "{class}: {copies}");
        // Only one copy of each triangle is useful work.
        let (useful, overlap) = (split.at("useful"), split.at("overlap"));
        assert!((overlap / (useful + overlap) - (1.0 - 1.0 / copies)).abs() < 1e-4, "{class}: {copies}, {:?}", split.0);
        split.is_most("overlap", class);
    }
    for class in CLASSES {
        let (_, split) = split(class, 4, &[], &balanced(4, 4, 500));
        assert_eq!(split.at("overlap"), 0.0, "{class}");
    }
}

#[test]
fn uneven_work_is_imbalance() {
    for class in CLASSES {
        // One tile has all; where primitives are dealt, every fourth is large.
        let dealt = class.starts_with("sort-last");
        let shape = |n: u32| match (dealt, n % 4) {
            (false, _) => in_tile(0, 31.0),
            (true, 0) => in_tile(n / 4 % 4, 31.0),
            _ => in_tile(n / 4 % 4, 2.0),
        };
        let scene = Scene { frames: 2, ..row(4, (0..100).map(shape).collect(), 500) };
        let (report, split) = split(class, 4, &[], &scene);
        crate::common::frames_add_up(&report);
        split.is_most("imbalance", class);
        // Except for small triangles, a quarter of the pipelines works.
        assert!((split.at("useful") - 0.25).abs() < 0.02, "{class}: {:?}", split.0);
    }
}

#[test]
fn a_narrow_network_is_network() {
    let scene = row(4, (0..400).map(|n| in_tile(n % 4, 3.0)).collect(), 1);
    for class in CLASSES {
        let of = |network: [&str; 2]| split(class, 4, &[&network[..], &["core.issue=8"]].concat(), &scene);
        let (wide, before) = of(["network.topology=point-to-point", "network.link_bytes=65536"]);
        let (narrow, after) = of(["network.topology=bus", "network.link_bytes=1"]);
        assert!(narrow.cycles > 10 * wide.cycles, "{class}");
        assert!(before.at("network") < 0.1, "{class}: {:?}", before.0);
        after.is_most("network", class);
    }
}

#[test]
fn waiting_for_a_turn_is_order() {
    // Pipelines have as much work each, but not at the same time, and can hold little.
    let shape = |n: u32| in_tile(n % 4, if (n / 4 + n).is_multiple_of(4) { 31.0 } else { 2.0 });
    let scene = row(4, (0..400).map(shape).collect(), 500);
    let little = ["network.receive_queue=1", "dispatch.reorder=1", "setup.queue=2", "assembly.queue=2"];
    let of = |keep| split("sort-last-fragment", 4, &[&little[..], &[keep]].concat(), &scene);
    let (kept, before) = of("order.keep=always");
    let (free, after) = of("order.keep=never");
    before.is_most("reorder_stalls", "kept");
    assert!(after.at("reorder_stalls") < 0.01 && after.at("useful") > 0.95, "{:?}", after.0);
    // The time lost to the order equals the time gained without it.
    let gained = 1.0 - free.cycles as f64 / kept.cycles as f64;
    assert!((gained - before.at("reorder_stalls")).abs() < 0.02, "{gained} gained, {:?}", before.0);
}
