//! Twice the unit that holds the others up, and twice each of the others.

use anyhow::{Result, ensure};

use super::{Run, layers, machine, triangles};
use crate::{Row, Section, Setting, Target};
use num::Random;
use synthetic::Scene;

pub(super) const BOTTLENECK: Target = Target {
    id: "bottleneck",
    section: Section::Memory,
    what: "One machine, scenes bound by another unit each: twice that unit makes the scene faster by min(2, its time by the next \
           unit's), twice any other makes it no slower",
    bound: "2 %",
    fault: "the unit that is to be doubled stays as it is",
    check,
};

/// A unit, and what doubles it.
const UNITS: [(&str, &[&str]); 6] = [
    ("setup", &["setup.interval=8"]),
    ("traverse", &["traverse.quads_per_cycle=4"]),
    (
        "shading",
        &["core.issue=8", "core.float_lanes=256", "core.integer_lanes=256", "core.special_lanes=256", "core.control_lanes=256"],
    ),
    ("texture", &["texture.filters_per_cycle=8"]),
    ("color", &["color.blends_per_cycle=2"]),
    ("memory", &["memory.ideal_bytes_per_cycle=32"]),
];

/// Small right triangles at random places.
fn scattered(seed: u64, count: u32) -> Scene {
    let legs = 4.0;
    let mut random = Random::new(seed);
    let shapes = (0..count).map(|_| {
        let [x, y] = [0; 2].map(|_| (32.0 - legs) * random.unit());
        [[x, y], [x + legs, y], [x, y + legs]]
    });
    triangles(32, shapes.collect())
}

/// Each scene with its name and the unit that limits it. `length` is the number of layers of a small image, and scales the other scenes.
fn scenes(seed: u64, length: u32) -> Vec<(&'static str, &'static str, Scene)> {
    let small = layers(32, length);
    let scattered = scattered(seed, 24 * length);
    vec![
        ("triangles", "setup", scattered.clone()),
        ("triangles with 70 instructions", "setup", Scene { instructions: 70, ..scattered }),
        ("plain layers", "traverse", small.clone()),
        ("layers with 100 instructions", "shading", Scene { instructions: 100, ..small.clone() }),
        ("layers with 3 textures", "texture", Scene { textures: 3, ..small.clone() }),
        ("blended layers", "color", Scene { blend: true, ..small }),
        ("layers of 128x128 pixels", "memory", layers(128, (length / 16).max(2))),
    ]
}

/// What the longer of two lengths has more.
fn beyond(changes: &[String], [short, long]: [&Scene; 2]) -> Result<Run> {
    let machine = machine(changes)?;
    Run::of(&machine, long)?.beyond(&Run::of(&machine, short)?)
}

fn check(setting: &Setting) -> Result<Vec<Row>> {
    let length = setting.pick(24, 96, 480);
    let mut rows = Vec::new();
    let all = scenes(setting.seed, length).into_iter().zip(scenes(setting.seed, 2 * length));
    for ((name, critical, short), (_, _, long)) in all {
        let scene = [&short, &long];
        let plain = beyond(&[], scene)?;
        let slowest = plain.slowest();
        ensure!(slowest.0 == critical, "{name} are bound by {}, not {critical}: {:?}", slowest.0, plain.bounds);
        let mut worst: f64 = 0.0;
        for (unit, changes) in UNITS {
            let changes: Vec<String> = changes.iter().map(|&change| change.to_owned()).collect();
            if unit != critical {
                worst = worst.max(beyond(&changes, scene)?.cycles / plain.cycles - 1.0);
                continue;
            }
            let next = plain.bounds.iter().map(|&(unit, time)| if unit == critical { time / 2.0 } else { time });
            let expected = slowest.1 / next.fold(0.0, f64::max);
            let faster = beyond(if setting.inject_fault { &[] } else { &changes }, scene)?;
            let measured = plain.cycles / faster.cycles;
            rows.push(Row::within(format!("{name}: faster with twice the {unit}"), expected, measured, 0.02 * expected));
        }
        rows.push(Row::at_most(format!("{name}: slower with twice another unit, at worst"), worst, 0.02));
    }
    Ok(rows)
}
