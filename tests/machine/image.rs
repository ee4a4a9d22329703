//! The machine's own picture is that of API order, bit for bit, whatever the machine.

use crate::common::is_chosen;
use fillrate::gfx::format::Format;
use fillrate::gfx::state::Compare;
use fillrate::machine::{Config, Machine, MachineReport};
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};

fn run(config: &Config, scene: &Scene, clock: Clock) -> MachineReport {
    let mut machine = Machine::new(config).unwrap_or_else(|error| panic!("{error}"));
    machine.run(events(scene).into_iter(), clock).unwrap_or_else(|error| panic!("{scene:?}: {error}"))
}

fn config(name: &str, changes: &[&str]) -> Config {
    let mut config = Config::built_in(name).unwrap();
    for change in changes {
        config.set(change).unwrap();
    }
    config.check().unwrap();
    config
}

fn scenes() -> Vec<Scene> {
    let plain = Scene::default();
    vec![
        plain.clone(),
        Scene { blend: true, ..plain.clone() },
        Scene { blend: true, depth_format: None, size: 200.0, ..plain.clone() },
        Scene { early: false, discard: true, ..plain.clone() },
        Scene { samples: 4, ..plain.clone() },
        Scene { samples: 4, blend: true, early: false, discard: true, ..plain.clone() },
        Scene { compare: Compare::Greater, depth_format: Some(Format::Depth24Plus), ..plain.clone() },
        Scene { compare: Compare::Always, depth_format: Some(Format::Depth16Unorm), ..plain.clone() },
        Scene { compare: Compare::LessEqual, size: 4.0, triangles: 2000, draws: 3, ..plain.clone() },
        Scene { frames: 2, textures: 0, size: 300.0, ..plain },
    ]
}

#[test]
fn every_scene_on_every_machine() {
    let machines = [
        config("four-pipelines", &[]),
        config("four-pipelines", &["memory.kind=ideal", "distribute.tile=16", "distribute.overlap=bounding-box"]),
        config("four-pipelines", &["pipelines=3", "geometry_units=3", "assembly.batch=1", "core.warp_width=8"]),
        config("tiny", &[]),
        config("attila", &[]),
        config("wide", &[]),
        config("four-pipelines", &["depth.cache_blocks=4", "color.cache_blocks=4", "traverse.hierarchical_update=write"]),
        config("four-pipelines", &["traverse.hierarchical_z=false", "color.fast_clear=false", "fetch.reuse=0"]),
    ];
    for (number, scene) in scenes().iter().enumerate() {
        for (_, config) in machines.iter().enumerate().filter(|&(at, _)| is_chosen(2, &[number, at])) {
            let report = run(config, scene, Clock::SkipIdle);
            for frame in &report.frames {
                let picture = frame.picture.as_ref().expect("a picture");
                assert_eq!(picture.wrong_pixels, 0, "{} on {scene:?}", config.name);
            }
        }
    }
}

#[test]
fn both_clocks_leave_the_same_statistics() {
    let machines = [config("four-pipelines", &[]), config("tiny", &["memory.kind=ideal"])];
    for (number, scene) in scenes().into_iter().enumerate() {
        for (_, config) in machines.iter().enumerate().filter(|&(at, _)| is_chosen(2, &[number, at])) {
            let every = run(config, &scene, Clock::EveryCycle);
            let skip = run(config, &scene, Clock::SkipIdle);
            assert_eq!(every.cycles, skip.cycles, "{scene:?}");
            let mut differing = Vec::new();
            differ("", &every.total.json(), &skip.total.json(), &mut differing);
            assert!(differing.is_empty(), "{} on {scene:?}: {differing:#?}", config.name);
        }
    }
}

/// The leaves in which two trees differ.
fn differ(path: &str, a: &serde_json::Value, b: &serde_json::Value, out: &mut Vec<String>) {
    use serde_json::Value::{Array, Object};
    match (a, b) {
        (Object(x), Object(y)) if x.len() == y.len() => {
            x.iter().for_each(|(key, value)| differ(&format!("{path}.{key}"), value, &y[key], out));
        }
        (Array(x), Array(y)) if x.len() == y.len() => {
            x.iter().zip(y).enumerate().for_each(|(n, (x, y))| differ(&format!("{path}[{n}]"), x, y, out));
        }
        _ if a != b => out.push(format!("{path}: {a} every cycle, {b} skipping")),
        _ => {}
    }
}
