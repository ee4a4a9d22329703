//! Knobs over their whole ranges: whatever their values, no machine gets stuck, no number is taken for another, and the picture is that
//! of API order.

use std::panic::{AssertUnwindSafe, catch_unwind};

use crate::common::{config, dispatch, everything, rendered, run};
use fillrate::gfx::format::Format;
use fillrate::knob::{Allowed, Knob, Setting};
use fillrate::machine::config::SortClass;
use fillrate::machine::{Config, Machine, MachineReport};
use fillrate::num::Random;
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};
use fillrate::unit::sorting::Keep;
use fillrate::work::{Event, Shade};

/// More draws than any unit has in flight, so that all numbers go round their rings: 1,100 draws of two small triangles, or one draw.
fn many(covered: bool, draws: u32) -> Vec<Event> {
    let triangles = 2200 / draws;
    events(&Scene { width: 64, height: 48, draws, triangles, size: 9.0, segments: 1, covered, ..Scene::default() })
}

/// Scenes of eight kinds, for machines that shade quads which early tests reject and for others.
fn scenes(covered: bool) -> Vec<Vec<Event>> {
    let plain = Scene { width: 72, height: 56, triangles: 16, size: 40.0, covered, ..Scene::default() };
    let scenes = [
        plain.clone(),
        Scene { samples: 4, ..plain.clone() },
        Scene { blend: true, early: false, discard: true, ..plain.clone() },
        Scene { size: 5.0, triangles: 120, draws: 3, textures: 2, frames: 2, ..plain.clone() },
        Scene { stencil: true, depth_format: Some(Format::Depth24PlusStencil8), ..plain },
    ];
    let mut all: Vec<_> = scenes.iter().map(|scene| [dispatch(6), events(scene)].concat()).collect();
    all.extend([many(covered, 550), many(covered, 1)]);
    if !covered {
        all.push(rendered("triangle"));
    }
    all
}

/// Runs work to its end under a clock and checks its picture.
fn drawn(config: &Config, events: &[Event], clock: Clock) -> MachineReport {
    let report = run(config, events, clock);
    for frame in report.frames.iter().filter(|_| config.order.keep == Keep::Always) {
        // What needs an order that pipelines with copies do not keep is reported.
        if frame.tree.number("sort.passes_needing_order").unwrap_or(0.0) == 0.0 {
            assert_eq!(frame.picture.as_ref().map(|picture| picture.wrong_pixels), Some(0), "{}", config.name);
        }
    }
    report
}

/// Knobs that say how many of something are in flight: their upper ends need the longest rings of numbers.
const IN_FLIGHT: [&str; 17] = [
    "command.segments",
    "command.states",
    "bin.segments",
    "fetch.runs",
    "fetch.index_lines",
    "fetch.misses",
    "fetch.batches",
    "fetch.announced",
    "fetch.queue",
    "assembly.queue",
    "core.warps",
    "dispatch.reorder",
    "texture.fifo",
    "depth.fifo",
    "depth.misses",
    "color.fifo",
    "color.misses",
];

#[test]
fn as_many_as_can_be_are_in_flight_and_none_is_taken_for_another() {
    let works = [false, true].map(|covered| [many(covered, 1100), many(covered, 1)]);
    for class in SortClass::NAMES {
        let mut all = config(class, &[]);
        for (path, knob) in all.clone().knobs().filter(|(path, _)| IN_FLIGHT.contains(&path.as_str())) {
            let Allowed::Range(_, high) = knob.allowed else { panic!("{path} is a number") };
            all.put("", &path, &Setting::Number(high)).expect("its upper end");
        }
        let works = &works[usize::from(all.render_key().shade == Shade::Covered)];
        for reuse in ["replaced", "batch"] {
            let mut config = all.clone();
            config.set(&format!("fetch.reuse_until={reuse}")).expect("a value of the knob");
            config.check().expect("they fit together");
            works.iter().for_each(|work| drop(drawn(&config, work, Clock::SkipIdle)));
        }
        // Batches alone, and small ones.
        let config = config(class, &["fetch.batches=1024", "core.warp_width=4"]);
        works.iter().for_each(|work| drop(drawn(&config, work, Clock::SkipIdle)));
    }
}

/// A value from the whole range of a knob: one of its ends or any, small ones as likely as large ones.
fn any(allowed: Allowed, random: &mut Random) -> Setting {
    let up_to = |most: u64, random: &mut Random| {
        (libm::exp2(f64::from(random.unit()) * libm::log2((most + 1) as f64)) as u64).clamp(1, most + 1) - 1
    };
    match allowed {
        Allowed::Range(low, high) => Setting::Number(match random.below(4) {
            0 => low,
            1 => high,
            _ => low + up_to(high - low, random),
        }),
        Allowed::PowerOfTwo(low, high) => Setting::Number(low << random.below(high.ilog2() - low.ilog2() + 1)),
        Allowed::Switch => Setting::Switch(random.below(2) == 1),
        Allowed::Choice(names) => Setting::Name(names[random.below(names.len() as u32) as usize].to_owned()),
    }
}

/// A display that any memory serves: what is too fast for it is refused when the first frame is shown.
const DISPLAY: [&str; 2] = ["scanout.line_cycles=300", "scanout.blank_lines=3"];

/// Knobs that are not varied: whether a run is stuck is what is asked, and displays that are too fast are refused.
const KEPT: [&str; 4] = ["watchdog", "sort", "scanout.line_cycles", "scanout.blank_lines"];

#[test]
fn any_knob_with_three_others_at_random_runs_to_the_same_picture() {
    // The usual suite takes one in 100 of some thousand machines.
    let all = std::env::var_os("FILLRATE_SLOW").is_some();
    let works = [scenes(false), scenes(true)];
    let mut random = Random::new(41);
    let (mut made, mut ran, mut failed) = (0, 0, Vec::new());
    for class in SortClass::NAMES {
        let plain = config(class, &DISPLAY);
        let knobs: Vec<(String, &Knob)> = plain.knobs().collect();
        for (path, knob) in knobs.iter().filter(|(path, _)| !KEPT.contains(&path.as_str())) {
            let ends = match knob.allowed {
                Allowed::Range(low, high) | Allowed::PowerOfTwo(low, high) => vec![Setting::Number(low), Setting::Number(high)],
                Allowed::Switch => [true, false].map(Setting::Switch).to_vec(),
                Allowed::Choice(names) => names.iter().map(|&name| Setting::Name(name.to_owned())).collect(),
            };
            let inside = [any(knob.allowed, &mut random), any(knob.allowed, &mut random)];
            for (n, value) in ends.into_iter().chain(inside).enumerate() {
                let mut changed = plain.clone();
                changed.name = format!("{class} {path}={value}");
                changed.put("", path, &value).expect("a value of the knob");
                // The first of them alone.
                for _ in 0..if n == 0 { 0 } else { 3 } {
                    let (other, knob) = &knobs[random.below(knobs.len() as u32) as usize];
                    if !KEPT.contains(&other.as_str()) && other != path {
                        let value = any(knob.allowed, &mut random);
                        changed.put("", other, &value).expect("a value of the knob");
                        changed.name.push_str(&format!(" {other}={value}"));
                    }
                }
                // What does not fit together is refused by name, and has a test of its own.
                if changed.check().is_err() || Machine::new(&changed).is_err() {
                    continue;
                }
                made += 1;
                let works = &works[usize::from(changed.render_key().shade == Shade::Covered)];
                if !all && made % 100 != 7 {
                    continue;
                }
                ran += 1;
                let work = &works[made % works.len()];
                let both = || {
                    let skipped = drawn(&changed, work, Clock::SkipIdle);
                    // Cycles are counted one by one where there are not too many of them.
                    if skipped.total.number("cycles").unwrap_or(0.0) < 100_000.0 {
                        let counted = drawn(&changed, work, Clock::EveryCycle);
                        assert!(everything(&counted) == everything(&skipped), "clocks differ");
                    }
                };
                if let Err(why) = catch_unwind(AssertUnwindSafe(both)) {
                    let why = why.downcast_ref::<String>().cloned().unwrap_or_default();
                    failed.push(format!("{}: {}", changed.name, why.chars().take(300).collect::<String>()));
                }
            }
        }
    }
    assert!(failed.is_empty(), "{} of {ran} failed:\n{}", failed.len(), failed.join("\n"));
    assert!(made > 2000 && ran > made / 110, "{ran} of {made} ran");
}
