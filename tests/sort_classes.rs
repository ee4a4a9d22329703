//! Every sort class draws the picture of API order, on any number of pipelines, with any pattern, tile and network; whatever keeps the
//! order on it is needed.

mod machine_common;
mod synthetic;

use fillrate::gfx::format::Format;
use fillrate::gfx::state::Compare;
use fillrate::machine::{Config, Machine, MachineReport};
use fillrate::sim::Clock;
use fillrate::work::Shade;
use machine_common::{accounts_add_up, frames_add_up};
use synthetic::{Scene, events};

fn config(changes: &[&str]) -> Config {
    let mut config = Config::built_in("baseline").unwrap();
    for change in changes {
        config.set(change).unwrap_or_else(|error| panic!("{error}"));
    }
    config.check().unwrap_or_else(|error| panic!("{error}"));
    config
}

fn run(config: &Config, scene: &Scene, clock: Clock) -> MachineReport {
    let scene = Scene { covered: config.render_key().shade == Shade::Covered, ..scene.clone() };
    let mut machine = Machine::new(config).unwrap_or_else(|error| panic!("{error}"));
    machine.run(events(&scene).into_iter(), clock).unwrap_or_else(|error| panic!("{:?} {scene:?}: {error}", config.card))
}

/// Pixels that differ from API order.
fn wrong(report: &MachineReport) -> u64 {
    let pictures = report.frames.iter().map(|frame| frame.picture.as_ref().expect("a picture"));
    pictures.map(|picture| picture.wrong_pixels).sum()
}

fn scenes() -> Vec<Scene> {
    let plain = Scene::default();
    vec![
        plain.clone(),
        Scene { blend: true, depth_format: None, size: 120.0, discard: true, ..plain.clone() },
        Scene { samples: 4, blend: true, early: false, discard: true, ..plain.clone() },
        Scene { compare: Compare::Always, depth_format: Some(Format::Depth16Unorm), stencil: true, ..plain.clone() },
        Scene { compare: Compare::LessEqual, size: 4.0, triangles: 400, draws: 3, frames: 2, ..plain },
    ]
}

const CLASSES: [&str; 4] = ["sort-first", "sort-middle", "sort-middle-binned", "sort-last-fragment"];

#[test]
fn every_class_draws_what_api_order_draws_on_any_number_of_pipelines() {
    for class in CLASSES {
        for (pipelines, more) in [
            (1, &[][..]),
            (2, &["distribute.pattern=rows", "distribute.tile=16"][..]),
            (4, &["distribute.pattern=balanced", "distribute.tile=8"]),
            (6, &["distribute.pattern=blocks", "distribute.tile=16"]),
            (7, &["distribute.pattern=bands", "distribute.tile=8"]),
            (3, &["distribute.pattern=hashed", "distribute.overlap=bounding-box", "bin.overlap=bounding-box", "bin.hide=true"]),
            (5, &["distribute.pattern=morton", "distribute.tile=8", "assembly.batch=3", "core.warp_width=8"]),
            (8, &["assembly.deal=least-loaded", "bin.tile=8", "core.unified=false", "core.vertex_cores=8"]),
            (16, &["memory.kind=ideal", "bin.tile=64", "route.mode=immediate"]),
        ] {
            let (sort, pipes) = (format!("sort={class}"), format!("pipelines={pipelines}"));
            let config = config(&[&[sort.as_str(), pipes.as_str()], more].concat());
            for scene in scenes() {
                let report = run(&config, &scene, Clock::SkipIdle);
                assert_eq!(wrong(&report), 0, "{class} on {pipelines} pipelines: {scene:?}");
                frames_add_up(&report);
            }
        }
    }
}

#[test]
fn every_class_draws_it_over_any_network() {
    for class in CLASSES {
        for topology in ["point-to-point", "bus", "crossbar", "ring", "mesh", "butterfly"] {
            for queue in ["network.receive_queue=2", "network.receive_queue=32"] {
                let (sort, network) = (format!("sort={class}"), format!("network.topology={topology}"));
                let config = config(&[&sort, "pipelines=6", &network, queue, "network.link_bytes=32"]);
                for scene in &scenes()[1..4] {
                    assert_eq!(wrong(&run(&config, scene, Clock::SkipIdle)), 0, "{class}, {topology}, {queue}: {scene:?}");
                }
            }
        }
    }
}

#[test]
fn clocks_and_orders_of_ticks_change_nothing_on_any_class() {
    let scene = Scene { blend: true, early: false, triangles: 40, ..Scene::default() };
    for class in CLASSES {
        for topology in ["point-to-point", "ring"] {
            let (sort, network) = (format!("sort={class}"), format!("network.topology={topology}"));
            let config = config(&[&sort, "pipelines=3", &network, "assembly.deal=least-loaded", "assembly.batch=4"]);
            let every = run(&config, &scene, Clock::EveryCycle);
            accounts_add_up(&every.total);
            for clock in [Clock::SkipIdle, Clock::Shuffled(1), Clock::Shuffled(2)] {
                let other = run(&config, &scene, clock);
                assert_eq!(every.cycles, other.cycles, "{class}, {topology}, {clock:?}");
                assert_eq!(every.total.json().to_string(), other.total.json().to_string(), "{class}, {topology}, {clock:?}");
            }
        }
    }
}

#[test]
fn a_full_list_memory_is_drawn_in_parts() {
    let config = |kib: u32| config(&["sort=sort-middle-binned", &format!("bin.memory_kib={kib}"), "bin.compression=true"]);
    let mut renders = Vec::new();
    for kib in [16384, 32, 16] {
        for scene in scenes() {
            let report = run(&config(kib), &Scene { triangles: 150, ..scene.clone() }, Clock::SkipIdle);
            assert_eq!(wrong(&report), 0, "{kib} KiB: {scene:?}");
            renders.push(report.total.number("binning.partial_renders").unwrap());
        }
    }
    assert!(renders[..5].iter().all(|&n| n == 0.0), "{renders:?}");
    assert!(renders[5..].iter().all(|&n| n > 0.0), "{renders:?}");
}

#[test]
fn whatever_keeps_the_order_is_needed() {
    let blended = &scenes()[1];
    for class in ["sort-first", "sort-middle", "sort-last-fragment"] {
        let sort = format!("sort={class}");
        let changes = [sort.as_str(), "pipelines=4", "geometry_units=4", "assembly.batch=2"];
        let kept = run(&config(&changes), blended, Clock::SkipIdle);
        let lost = run(&config(&[&changes[..], &["order.keep=never"]].concat()), blended, Clock::SkipIdle);
        assert_eq!(wrong(&kept), 0, "{class}");
        assert!(wrong(&lost) > 100, "{class}: {} pixels", wrong(&lost));
    }
    let sort = "sort=sort-middle-binned";
    let mut binned = Config::built_in("baseline").unwrap();
    binned.set(sort).unwrap();
    binned.set("order.keep=never").unwrap();
    assert!(binned.check().unwrap_err().to_string().contains("order.keep is never"));
}

#[test]
fn opaque_quads_need_no_order_but_among_ties() {
    let changes = ["sort=sort-last-fragment", "pipelines=4", "assembly.batch=2"];
    let relaxed = [&changes[..], &["order.keep=where-needed"]].concat();
    for scene in scenes() {
        let (kept, free) = (run(&config(&changes), &scene, Clock::SkipIdle), run(&config(&relaxed), &scene, Clock::SkipIdle));
        // No two triangles of these scenes have the same depth in a pixel that they share.
        assert_eq!(wrong(&free), 0, "{scene:?}");
        let waited = |report: &MachineReport| report.total.number("sort.order_waiting_cycles").unwrap();
        let opaque = !scene.blend && !scene.stencil && scene.compare != Compare::Always;
        if opaque {
            assert!(waited(&free) < waited(&kept), "{scene:?}: {} of {}", waited(&free), waited(&kept));
        } else {
            assert_eq!(waited(&free), waited(&kept), "{scene:?}");
        }
    }
}

#[test]
fn what_is_hidden_in_a_tile_is_not_shaded() {
    let shaded = |scene: &Scene, hide: &str| {
        let report = run(&config(&["sort=sort-middle-binned", hide]), scene, Clock::SkipIdle);
        assert_eq!(wrong(&report), 0, "{hide}: {scene:?}");
        let of = |name: &str| report.total.number(name).unwrap();
        let hidden =
            (0..4).map(|n| report.total.number(&format!("hiding.hide[{n}].hidden_fragments")).unwrap_or(0.0)).sum::<f64>();
        (of("funnel.fragments_shaded"), of("funnel.fragments_written"), hidden)
    };
    let opaque = Scene { compare: Compare::LessEqual, draws: 1, ..Scene::default() };
    for scene in [opaque.clone(), Scene { samples: 4, ..opaque.clone() }] {
        let (all, _, none) = shaded(&scene, "bin.hide=false");
        let (seen, written, hidden) = shaded(&scene, "bin.hide=true");
        assert_eq!(none, 0.0);
        // Of one sample a pixel, each is shaded once.
        assert!(seen < 0.95 * all && seen == written && seen + hidden == all, "{seen} + {hidden} of {all}: {scene:?}");
        assert!(scene.samples > 1 || seen <= f64::from(scene.width * scene.height), "{seen} shaded");
    }
    // What shows through is not hidden.
    let blended = Scene { blend: true, ..opaque };
    assert_eq!(shaded(&blended, "bin.hide=true").2, 0.0);
}
