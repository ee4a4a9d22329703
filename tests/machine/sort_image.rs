//! Sort-last-image: pipelines with their own framebuffers draw the picture of API order wherever order does not matter, send the bytes
//! that the composition formulas give, and name the passes whose order they do not keep.

use std::sync::Arc;

use crate::common::{accounts_add_up, frames_add_up, is_chosen};
use fillrate::gfx::format::Format;
use fillrate::gfx::state::{Blend, BlendComponent, BlendFactor, BlendOp, Compare};
use fillrate::machine::{Config, Machine, MachineReport};
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events, in_two_passes};
use fillrate::work::Event;

const SCHEMES: [&str; 3] = ["binary-swap", "direct-send", "pipeline"];

fn config(changes: &[&str]) -> Config {
    let mut config = Config::built_in("four-pipelines").unwrap();
    for change in ["sort=sort-last-image"].iter().chain(changes) {
        config.set(change).unwrap_or_else(|error| panic!("{error}"));
    }
    config.check().unwrap_or_else(|error| panic!("{error}"));
    config
}

fn run_events(config: &Config, events: Vec<Event>, clock: Clock) -> MachineReport {
    let mut machine = Machine::new(config).unwrap_or_else(|error| panic!("{error}"));
    machine.run(events.into_iter(), clock).unwrap_or_else(|error| panic!("{:?}: {error}", config.card))
}

fn run(config: &Config, scene: &Scene, clock: Clock) -> MachineReport {
    run_events(config, events(&Scene { covered: true, ..scene.clone() }), clock)
}

fn wrong(report: &MachineReport) -> u64 {
    report.frames.iter().map(|frame| frame.picture.as_ref().expect("a picture").wrong_pixels).sum()
}

fn number(report: &MachineReport, path: &str) -> u64 {
    report.total.number(path).unwrap_or_else(|| panic!("no {path}")) as u64
}

/// Scenes whose draws are all of one kind.
fn opaque() -> Vec<Scene> {
    let plain = Scene::default();
    vec![
        plain.clone(),
        Scene { compare: Compare::LessEqual, size: 4.0, triangles: 300, draws: 3, frames: 2, ..plain.clone() },
        Scene { compare: Compare::Greater, depth_format: Some(Format::Depth16Unorm), ..plain.clone() },
        Scene { compare: Compare::GreaterEqual, depth_format: Some(Format::Depth24Plus), size: 140.0, ..plain.clone() },
        Scene { compare: Compare::Always, depth_format: Some(Format::Depth24Plus), ..plain.clone() },
        Scene { depth_format: None, size: 100.0, ..plain.clone() },
        Scene { samples: 4, early: false, discard: true, ..plain.clone() },
        Scene { samples: 4, depth_format: None, triangles: 30, ..plain },
    ]
}

#[test]
fn opaque_scenes_are_those_of_api_order() {
    for (at, (pipelines, more)) in [
        (1, &[][..]),
        (2, &["assembly.batch=1", "traverse.hierarchical_update=write"][..]),
        (3, &["assembly.deal=contiguous", "compose.misses=1"]),
        (5, &["assembly.batch=3", "core.warp_width=8", "color.fast_clear=false"]),
        (8, &["assembly.deal=least-loaded", "core.unified=false", "core.vertex_cores=8", "network.receive_queue=1"]),
    ]
    .into_iter()
    .enumerate()
    {
        for (other, scheme) in SCHEMES.into_iter().enumerate() {
            let (pipes, scheme) = (format!("pipelines={pipelines}"), format!("compose.scheme={scheme}"));
            let config = config(&[&[pipes.as_str(), scheme.as_str()], more].concat());
            for (which, scene) in opaque().into_iter().enumerate() {
                if !is_chosen(2, &[at, other, which]) {
                    continue;
                }
                let report = run(&config, &scene, Clock::SkipIdle);
                assert_eq!(wrong(&report), 0, "{scheme} on {pipelines} pipelines: {scene:?}");
                assert_eq!(number(&report, "sort.passes_needing_order"), 0, "{scene:?}");
                frames_add_up(&report);
            }
        }
    }
}

#[test]
fn clocks_and_orders_of_ticks_change_nothing() {
    let scene = Scene { samples: 4, early: false, blend: true, triangles: 24, ..Scene::default() };
    for (at, scheme) in SCHEMES.into_iter().enumerate() {
        for (number, topology) in ["point-to-point", "ring", "bus"].into_iter().enumerate() {
            if !is_chosen(2, &[at, number]) {
                continue;
            }
            let (scheme, network) = (format!("compose.scheme={scheme}"), format!("network.topology={topology}"));
            let config = config(&["pipelines=5", &scheme, &network, "assembly.batch=4", "assembly.deal=contiguous"]);
            let every = run(&config, &scene, Clock::EveryCycle);
            accounts_add_up(&every.total);
            for clock in [Clock::SkipIdle, Clock::Shuffled(1), Clock::Shuffled(2)] {
                let other = run(&config, &scene, clock);
                assert_eq!(every.total.json().to_string(), other.total.json().to_string(), "{scheme}, {topology}, {clock:?}");
                assert!(every.frames[0].picture == other.frames[0].picture, "{scheme}, {topology}, {clock:?}");
            }
        }
    }
}

/// A scene in which all triangles are drawn twice, at the same depths, in two colours; and the picture of the colours given first or
/// last.
fn twice(compare: Compare, kept_first: bool) -> Vec<Event> {
    let scene = Scene { compare, draws: 1, segments: 1, triangles: 50, covered: true, ..Scene::default() };
    let mut out = Vec::new();
    let mut draw = None;
    for event in events(&scene) {
        if let Event::Draw(it) = &event {
            draw = Some(it.clone());
        }
        let Event::Segment(segment) = &event else {
            out.push(event);
            continue;
        };
        let mut other = segment.as_ref().clone();
        for tile in &mut other.tiles {
            tile.payload.iter_mut().for_each(|word| *word ^= 0x00ff_ffff);
        }
        let (own, other) = (event, Event::Segment(Arc::new(other)));
        let (first, second) = if kept_first { (own, other) } else { (other, own) };
        out.extend([first, Event::Draw(draw.clone().unwrap()), second]);
    }
    out
}

#[test]
fn ties_go_to_the_primitive_that_api_order_keeps() {
    for pipelines in [2, 3, 4, 7] {
        for scheme in SCHEMES {
            for deal in ["round-robin", "contiguous"] {
                let changes =
                    [format!("pipelines={pipelines}"), format!("compose.scheme={scheme}"), format!("assembly.deal={deal}")];
                let config = config(&[&changes[0], &changes[1], &changes[2], "assembly.batch=3"]);
                for (compare, kept_first) in [
                    (Compare::Less, true),
                    (Compare::LessEqual, false),
                    (Compare::Greater, true),
                    (Compare::GreaterEqual, false),
                ] {
                    let report = run_events(&config, twice(compare, kept_first), Clock::SkipIdle);
                    assert_eq!(wrong(&report), 0, "{changes:?} {compare:?}");
                    // The other picture differs.
                    let other = run_events(&config, twice(compare, !kept_first), Clock::SkipIdle);
                    assert!(wrong(&other) > 1000, "{changes:?} {compare:?}");
                }
            }
        }
    }
}

#[test]
fn the_numbers_of_primitives_are_needed_for_ties() {
    for scheme in SCHEMES {
        let scheme = format!("compose.scheme={scheme}");
        let lost = config(&["pipelines=4", &scheme, "assembly.batch=3", "order.keep=never"]);
        // Depths are equal everywhere; the colour shows which pipeline was composed first.
        let both = [twice(Compare::Less, true), twice(Compare::LessEqual, false)];
        let wrong: u64 = both.into_iter().map(|events| wrong(&run_events(&lost, events, Clock::SkipIdle))).sum();
        assert!(wrong > 1000, "{scheme}: {wrong} pixels");
        // If no two depths are equal, the primitives' numbers do not matter.
        let scene = &opaque()[0];
        assert_eq!(self::wrong(&run(&lost, scene, Clock::SkipIdle)), 0, "{scheme}");
    }
}

/// The scene with colours that have their alpha multiplied in, all blended "over".
fn premultiplied(scene: &Scene) -> Vec<Event> {
    let over = BlendComponent { src: BlendFactor::One, dst: BlendFactor::OneMinusSrcAlpha, op: BlendOp::Add };
    let premultiply = |event| match event {
        Event::Draw(draw) => {
            let mut draw = draw.as_ref().clone();
            let targets = Arc::make_mut(&mut draw.state).targets.iter_mut();
            targets.flatten().for_each(|target| target.blend = Some(Blend { color: over, alpha: over }));
            Event::Draw(Arc::new(draw))
        }
        Event::Segment(segment) => {
            let mut segment = segment.as_ref().clone();
            for tile in &mut segment.tiles {
                for colors in tile.payload.chunks_exact_mut(16) {
                    for p in 0..4 {
                        let alpha = f32::from_bits(colors[12 + p]) * 0.6;
                        (0..3).for_each(|c| colors[4 * c + p] = (f32::from_bits(colors[4 * c + p]) * alpha).to_bits());
                        colors[12 + p] = alpha.to_bits();
                    }
                }
            }
            Event::Segment(Arc::new(segment))
        }
        other => other,
    };
    events(scene).into_iter().map(premultiply).collect()
}

#[test]
fn chunks_are_put_over_each_other_in_their_order() {
    let scene = Scene { blend: true, depth_format: None, size: 110.0, covered: true, ..Scene::default() };
    let picture = |changes: &[&str]| {
        let report = run_events(&config(changes), premultiplied(&scene), Clock::SkipIdle);
        let needs = number(&report, "sort.passes_needing_order");
        (report.frames[0].picture.as_ref().unwrap().bytes.clone(), needs)
    };
    let (truth, none) = picture(&["pipelines=1"]);
    assert_eq!(none, 0, "one pipeline keeps every order");
    let most = |a: &[u8]| a.iter().zip(&truth).map(|(&a, &b)| a.abs_diff(b)).max().unwrap();
    for pipelines in [2, 3, 4, 6, 8] {
        for scheme in SCHEMES {
            let (pipes, scheme) = (format!("pipelines={pipelines}"), format!("compose.scheme={scheme}"));
            let (chunks, named) = picture(&[&pipes, &scheme, "assembly.deal=contiguous", "assembly.batch=5"]);
            // Each copy is rounded to 8 bits before it is put over another.
            assert!(most(&chunks) <= pipelines + 1, "{pipes} {scheme}: {}", most(&chunks));
            let (turns, _) = picture(&[&pipes, &scheme, "assembly.batch=5"]);
            assert!(most(&turns) > 50, "{pipes} {scheme}: {}", most(&turns));
            assert_eq!(named, 1);
        }
    }
}

#[test]
fn passes_that_need_order_are_counted_and_named() {
    let plain = Scene::default();
    for (scene, needs, label) in [
        (plain.clone(), 0, ""),
        (Scene { blend: true, depth_format: None, frames: 2, ..plain.clone() }, 2, "0 sprites, 1 sprites"),
        (Scene { compare: Compare::NotEqual, ..plain.clone() }, 1, "0 sprites"),
    ] {
        let name = |event| match event {
            Event::BeginPass(pass) => {
                let mut pass = pass.as_ref().clone();
                pass.label = "sprites".to_owned();
                Event::BeginPass(Arc::new(pass))
            }
            other => other,
        };
        let events: Vec<Event> = events(&Scene { covered: true, ..scene.clone() }).into_iter().map(name).collect();
        let report = run_events(&config(&["pipelines=3"]), events, Clock::SkipIdle);
        assert_eq!(number(&report, "sort.passes_needing_order"), needs, "{scene:?}");
        let text = report.total.json()["sort"]["passes_out_of_order"].as_str().unwrap().to_owned();
        assert_eq!(text, label);
        // A picture that may depend on the order need not do so: no two of these triangles have the same depth anywhere.
        assert_eq!(wrong(&report) > 0, scene.blend, "{scene:?}");
    }
}

#[test]
fn what_is_loaded_is_in_every_copy() {
    // Two passes: the second loads what the first has drawn. Together they are the picture of one.
    let out = in_two_passes(&Scene { draws: 2, segments: 1, covered: true, ..Scene::default() });
    for pipelines in [1, 2, 4, 5] {
        for scheme in SCHEMES {
            let (pipes, scheme) = (format!("pipelines={pipelines}"), format!("compose.scheme={scheme}"));
            let report = run_events(&config(&[&pipes, &scheme]), out.clone(), Clock::SkipIdle);
            assert_eq!(wrong(&report), 0, "{pipes} {scheme}");
            assert_eq!(number(&report, "sort.passes_needing_order"), 0);
        }
    }
}
