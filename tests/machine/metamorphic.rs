//! Laws between two runs, which need no right answer: more of a resource does no harm, and a scene that is described in another way takes
//! about as long.

use std::sync::Arc;

use crate::common::{config, is_chosen, run};
use fillrate::knob::{Allowed, Knob, Setting};
use fillrate::machine::config::SortClass;
use fillrate::machine::{Config, Machine};
use fillrate::num::Random;
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events, in_two_passes};
use fillrate::work::{Event, Shade};

/// A triangle in pixels.
type Shape = [[f32; 2]; 3];

/// Edge of the square targets, in pixels.
const EDGE: f32 = 512.0;

/// Triangles anywhere, each in a square of `size` pixels. A tile's width at the left and at the top stays empty.
fn anywhere(count: u32, size: f32) -> Vec<Shape> {
    let mut random = Random::new(3);
    let one = |_| {
        let corner = [0; 2].map(|_| random.range(64.0, EDGE - 64.0 - size));
        [0; 3].map(|_| corner.map(|at| at + random.range(0.0, size)))
    };
    (0..count).map(one).collect()
}

/// Scenes of small triangles, of large ones, and of some with textures.
fn scenes() -> [(&'static str, Scene); 3] {
    let plain = |count, size| Scene::plain(EDGE as u32, EDGE as u32, anywhere(count, size), u32::MAX);
    [
        ("small", Scene { instructions: 4, ..plain(900, 12.0) }),
        ("large", Scene { instructions: 8, ..plain(24, 200.0) }),
        ("textured", Scene { instructions: 16, textures: 2, ..plain(120, 50.0) }),
    ]
}

/// The work of a scene for a machine.
fn work(config: &Config, scene: &Scene) -> Vec<Event> {
    events(&Scene { covered: config.render_key().shade == Shade::Covered, ..scene.clone() })
}

fn cycles(config: &Config, events: &[Event]) -> f64 {
    run(config, events, Clock::SkipIdle).cycles as f64
}

/// Numbers that are no resource: what is dealt or moved at once, the time between refreshes, and the two sides of a ratio.
const NO_RESOURCE: [&str; 9] = [
    "assembly.batch",
    "bin.position_bytes",
    "bin.triangle_bytes",
    "bin.word_bytes",
    "distribute.tile",
    "memory.dram.card_cycles",
    "memory.dram.clock",
    "memory.dram.t_refi",
    "memory.l2.interleave",
];

/// Whether more of a resource brings work of its own: each pipeline of sort-last image has a whole picture to compose.
fn brings_work(class: &str, path: &str) -> bool {
    class == "sort-last-image" && path == "pipelines"
}

/// The value of a knob with which a machine has twice as much of a resource, or waits half as long; none where it is none.
fn more(config: &Config, path: &str, knob: &Knob) -> Option<Setting> {
    if NO_RESOURCE.contains(&path) {
        return None;
    }
    let (section, name) = path.rsplit_once('.').unwrap_or(("", path));
    let (_, knobs) = config.sections().into_iter().find(|(known, _)| *known == section)?;
    let Setting::Number(now) = knobs.get(name)? else { return None };
    let (Allowed::Range(low, high) | Allowed::PowerOfTwo(low, high)) = knob.allowed else { return None };
    let time = knob.unit.contains("cycles");
    let other = if time { now / 2 } else { now * 2 }.clamp(low, high);
    (other != now).then_some(Setting::Number(other))
}

#[test]
fn more_of_a_resource_costs_at_most_two_per_cent() {
    let (mut tried, mut failed) = (0, Vec::new());
    for (c, class) in SortClass::NAMES.iter().enumerate() {
        // When DRAM refreshes depends on all that was before, and moves a frame by a per cent or two.
        let plain = config(class, &["memory.dram.t_refi=0"]);
        for (s, (scene, made)) in scenes().iter().enumerate() {
            let work = work(&plain, made);
            let before = cycles(&plain, &work);
            for (section, knobs) in plain.sections() {
                for (k, knob) in knobs.knobs().iter().enumerate() {
                    let path = knob.path(section);
                    if !is_chosen(23, &[3 * c, s, k]) {
                        continue;
                    }
                    let Some(value) = more(&plain, &path, knob).filter(|_| !brings_work(class, &path)) else { continue };
                    let mut changed = plain.clone();
                    changed.put("", &path, &value).expect("a value of the knob");
                    // What does not fit together is refused by name.
                    if changed.check().is_err() || Machine::new(&changed).is_err() {
                        continue;
                    }
                    tried += 1;
                    let ratio = cycles(&changed, &work) / before;
                    if ratio > 1.02 {
                        failed.push(format!("{class}, {scene}, {path}={value}: {:+.1} %", 100.0 * (ratio - 1.0)));
                    }
                }
            }
        }
    }
    assert!(failed.is_empty(), "{} of {tried} cost more:\n{}", failed.len(), failed.join("\n"));
}

/// A scene told in another way, in its shapes.
type Retold = fn(&[Shape]) -> Vec<Shape>;

#[test]
fn a_scene_told_in_another_way_takes_as_long() {
    let ways: [(&str, Retold); 7] = [
        ("mirrored left to right", |shapes| shapes.iter().map(|shape| shape.map(|[x, y]| [EDGE - x, y])).collect()),
        ("mirrored top to bottom", |shapes| shapes.iter().map(|shape| shape.map(|[x, y]| [x, EDGE - y])).collect()),
        ("transposed", |shapes| shapes.iter().map(|shape| shape.map(|[x, y]| [y, x])).collect()),
        ("with other first vertices", |shapes| shapes.iter().map(|&[a, b, c]| [b, c, a]).collect()),
        ("in reverse order", |shapes| shapes.iter().rev().copied().collect()),
        ("shifted by a tile", |shapes| shapes.iter().map(|shape| shape.map(|[x, y]| [x + 64.0, y])).collect()),
        ("shifted by two tiles down", |shapes| shapes.iter().map(|shape| shape.map(|[x, y]| [x, y + 64.0])).collect()),
    ];
    let mut failed = Vec::new();
    for (c, class) in SortClass::NAMES.iter().enumerate() {
        let plain = config(class, &[]);
        for (s, (scene, made)) in scenes().iter().enumerate() {
            let chosen = |n: usize| is_chosen(3, &[c, s, n]);
            let before = cycles(&plain, &work(&plain, made));
            for (_, (way, retold)) in (0..).zip(ways).filter(|&(n, _)| chosen(n)) {
                let told = Scene { shapes: retold(&made.shapes), ..made.clone() };
                let ratio = cycles(&plain, &work(&plain, &told)) / before;
                // The lines that a synthetic scene looks up follow places on the screen.
                let allowed = if *scene == "textured" { 0.08 } else { 0.03 };
                if (ratio - 1.0).abs() > allowed {
                    failed.push(format!("{class}, {scene}, {way}: {:+.1} %", 100.0 * (ratio - 1.0)));
                }
            }
            for (_, draws) in (0..).zip([2, 10, 100]).filter(|&(n, _)| chosen(n)) {
                let ratio = cycles(&plain, &in_draws(&plain, made, draws)) / before;
                // Each draw begins batches of its own, and ends with some that are not full.
                if (ratio - 1.0).abs() > 0.05 {
                    failed.push(format!("{class}, {scene}, in {draws} draws: {:+.1} %", 100.0 * (ratio - 1.0)));
                }
            }
            if chosen(0) {
                let halves = Scene {
                    draws: 2,
                    shapes: made.shapes[..made.shapes.len() / 2].to_vec(),
                    triangles: made.triangles / 2,
                    ..made.clone()
                };
                let whole = cycles(&plain, &work(&plain, &halves));
                let covered = plain.render_key().shade == Shade::Covered;
                let apart = cycles(&plain, &in_two_passes(&Scene { covered, ..halves }));
                let ratio = apart / whole;
                // Bins are drawn, and the pictures of all pipelines composed, at the end of each pass.
                let most = match *class {
                    "sort-middle-binned" => 1.35,
                    "sort-last-image" => 2.0,
                    _ => 1.1,
                };
                if !(0.99..most).contains(&ratio) {
                    failed.push(format!("{class}, {scene}, in two passes: {:+.1} %", 100.0 * (ratio - 1.0)));
                }
            }
            if !chosen(1) {
                continue;
            }
            let mut twice = plain.clone();
            for (section, knobs) in plain.sections() {
                for knob in knobs.knobs().iter().filter(|knob| knob.unit.contains("/cycle") || knob.unit == "lanes") {
                    let path = knob.path(section);
                    if let Some(value) = more(&plain, &path, knob) {
                        twice.put("", &path, &value).expect("a value of the knob");
                    }
                }
            }
            let ratio = cycles(&twice, &work(&plain, made)) / before;
            if !(0.5..1.0).contains(&ratio) {
                failed.push(format!("{class}, {scene}, at twice all rates: {:+.1} %", 100.0 * (ratio - 1.0)));
            }
        }
    }
    assert!(failed.is_empty(), "{}", failed.join("\n"));
}

/// The work of a scene of one draw, in `draws` draws.
fn in_draws(config: &Config, scene: &Scene, draws: u32) -> Vec<Event> {
    let parts = Scene { segments: draws.min(scene.triangles), ..scene.clone() };
    let mut draw = None;
    let mut number = 0;
    let mut out = Vec::new();
    for event in work(config, &parts) {
        match &event {
            Event::Draw(first) => draw = Some(first.clone()),
            Event::Segment(_) => {
                let mut next = draw.as_deref().expect("a draw before its segments").clone();
                next.number = number;
                number += 1;
                out.push(Event::Draw(Arc::new(next)));
                out.push(event);
            }
            _ => out.push(event),
        }
    }
    out
}
