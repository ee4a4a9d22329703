//! The ideal memory is ideal: no memory that it stands for lets a scene end earlier.

use crate::common::{Figures, config, dispatch, is_chosen, rendered, run};
use fillrate::machine::config::SortClass;
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};
use fillrate::work::{Event, Shade};

/// Changes that make DRAM or its caches as good as they can be, and units that cover as little of a latency as they can.
const CHANGES: [&[&str]; 9] = [
    &[],
    &["memory.l2.latency=1", "memory.dram.latency=1"],
    &["memory.l2.slices=16", "memory.l2.width=4096", "memory.l2.lookups_per_cycle=16", "memory.l2.latency=1"],
    &["memory.dram.clock=10", "memory.dram.card_cycles=1", "memory.dram.t_refi=0", "memory.dram.channels=1"],
    &["memory.l2.cached=false", "memory.l2.latency=1"],
    &["texture.fifo=32", "color.fifo=8", "depth.fifo=8"],
    &["texture.misses=4", "color.misses=4", "depth.misses=4", "fetch.misses=4"],
    &["memory.port_width=16", "memory.port_queue=8"],
    &["memory.port_latency=1", "memory.rop_latency=64", "core.warps=4"],
];

#[test]
fn no_memory_is_faster_than_the_ideal_one() {
    // Machines that test late want every covered quad.
    let scenes = |covered| {
        let textured = Scene { width: 256, height: 256, triangles: 40, size: 120.0, textures: 2, covered, ..Scene::default() };
        let blended = Scene { samples: 4, blend: true, early: false, discard: true, ..textured.clone() };
        let small = Scene { size: 5.0, triangles: 400, draws: 40, covered, ..Scene::default() };
        let mut scenes = vec![
            ("textured", [dispatch(12), events(&textured)].concat()),
            ("blended", events(&blended)),
            ("small triangles", events(&small)),
        ];
        if !covered {
            scenes.extend(["triangle", "cube"].map(|name| (name, rendered(name))));
        }
        scenes
    };
    let scenes = [scenes(false), scenes(true)];
    let cycles = |class: &str, changes: &[&str], kind: &str, events: &[Event]| {
        let changes = [changes, &[kind]].concat();
        Figures(&run(&config(class, &changes), events, Clock::SkipIdle).total).at("cycles")
    };
    let mut slower = Vec::new();
    for (at, class) in SortClass::NAMES.iter().enumerate() {
        for (number, changes) in CHANGES.iter().enumerate() {
            let covered = config(class, changes).render_key().shade == Shade::Covered;
            for (which, (name, events)) in scenes[usize::from(covered)].iter().enumerate() {
                if !is_chosen(6, &[at, number, which]) {
                    continue;
                }
                let [real, ideal] = ["memory.kind=dram", "memory.kind=ideal"].map(|kind| cycles(class, changes, kind, events));
                if ideal > real {
                    slower.push(format!("{name} on {class} with {changes:?}: {ideal} cycles of {real}"));
                }
            }
        }
    }
    assert!(slower.is_empty(), "the ideal memory takes longer:\n{}", slower.join("\n"));
}
