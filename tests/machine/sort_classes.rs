//! Every sort class draws the picture of API order, on any number of pipelines, with any pattern, tile and network; whatever keeps the
//! order on it is needed.

use std::sync::Arc;

use crate::common::{accounts_add_up, frames_add_up, is_chosen};
use fillrate::gfx::format::Format;
use fillrate::gfx::state::Compare;
use fillrate::machine::{Config, Machine, MachineReport};
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events, in_two_passes};
use fillrate::work::{Event, Shade};

fn config(changes: &[&str]) -> Config {
    let mut config = Config::built_in("four-pipelines").unwrap();
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
        Scene { compare: Compare::Always, depth_format: Some(Format::Depth16Unorm), ..plain.clone() },
        Scene { compare: Compare::LessEqual, size: 4.0, triangles: 400, draws: 3, frames: 2, ..plain },
    ]
}

/// Classes that keep API order.
const CLASSES: [&str; 4] = ["sort-first", "sort-middle", "sort-middle-binned", "sort-last-fragment"];

/// All classes; the last one keeps it where the order of primitives in different pipelines does not matter, and says where it does.
const ALL: [&str; 5] = ["sort-first", "sort-middle", "sort-middle-binned", "sort-last-fragment", "sort-last-image"];

/// Whether the machine has kept the order of all passes.
fn in_order(report: &MachineReport) -> bool {
    report.total.number("sort.passes_needing_order").unwrap_or(0.0) == 0.0
}

#[test]
fn every_class_draws_what_api_order_draws_on_any_number_of_pipelines() {
    let (mut unordered, mut expected) = (0, 0);
    for (at, class) in ALL.into_iter().enumerate() {
        for (other, (pipelines, more)) in [
            (1, &[][..]),
            (2, &["distribute.pattern=rows", "distribute.tile=16"][..]),
            (4, &["distribute.pattern=balanced", "distribute.tile=8"]),
            (6, &["distribute.pattern=blocks", "distribute.tile=16"]),
            (7, &["distribute.pattern=bands", "distribute.tile=8"]),
            (3, &["distribute.pattern=hashed", "distribute.overlap=bounding-box", "bin.overlap=bounding-box", "bin.hide=true"]),
            (5, &["distribute.pattern=morton", "distribute.tile=8", "assembly.batch=3", "core.warp_width=8"]),
            (8, &["assembly.deal=least-loaded", "bin.tile=8", "core.unified=false", "core.vertex_cores=8"]),
            (16, &["memory.kind=ideal", "bin.tile=64", "route.mode=immediate"]),
        ]
        .into_iter()
        .enumerate()
        {
            let (sort, pipes) = (format!("sort={class}"), format!("pipelines={pipelines}"));
            let config = config(&[&[sort.as_str(), pipes.as_str()], more].concat());
            for (number, scene) in scenes().into_iter().enumerate() {
                if !is_chosen(2, &[at, other, number]) {
                    continue;
                }
                // Blended scenes, on all numbers of pipelines but one.
                expected += u32::from(scene.blend && class == ALL[4] && pipelines > 1);
                let report = run(&config, &scene, Clock::SkipIdle);
                assert!(in_order(&report) || scene.blend && class == ALL[4], "{class} on {pipelines} pipelines: {scene:?}");
                if in_order(&report) {
                    assert_eq!(wrong(&report), 0, "{class} on {pipelines} pipelines: {scene:?}");
                } else {
                    unordered += 1;
                }
                frames_add_up(&report);
            }
        }
    }
    assert_eq!(unordered, expected);
    assert!(expected >= 8, "{expected}");
}

#[test]
fn every_class_draws_it_over_any_network() {
    for (at, class) in ALL.into_iter().enumerate() {
        for (other, topology) in ["point-to-point", "bus", "crossbar", "ring", "mesh", "butterfly"].into_iter().enumerate() {
            for (more, queue) in ["network.receive_queue=2", "network.receive_queue=32"].into_iter().enumerate() {
                let (sort, network) = (format!("sort={class}"), format!("network.topology={topology}"));
                let config = config(&[&sort, "pipelines=6", &network, queue, "network.link_bytes=32"]);
                for (number, scene) in scenes()[1..4].iter().enumerate() {
                    if !is_chosen(3, &[at, other, more, number]) {
                        continue;
                    }
                    let report = run(&config, scene, Clock::SkipIdle);
                    assert!(!in_order(&report) || wrong(&report) == 0, "{class}, {topology}, {queue}: {scene:?}");
                }
            }
        }
    }
}

#[test]
fn clocks_and_orders_of_ticks_change_nothing_on_any_class() {
    let scene = Scene { blend: true, early: false, triangles: 40, ..Scene::default() };
    for class in ALL {
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
            assert_eq!(report.total.number("binning.memory_full"), renders.last().copied());
        }
    }
    assert!(renders[..5].iter().all(|&n| n == 0.0), "{renders:?}");
    assert!(renders[5..].iter().all(|&n| n > 0.0), "{renders:?}");
}

#[test]
fn a_pass_is_binned_whole_however_many_draws_it_has() {
    let scene = Scene { draws: 100, triangles: 4, size: 20.0, segments: 2, ..Scene::default() };
    let binned = |segments: u32| {
        let changes = ["sort=sort-middle-binned", "command.segments=4", &format!("bin.segments={segments}")];
        let report = run(&config(&changes), &scene, Clock::SkipIdle);
        assert_eq!(wrong(&report), 0, "{segments} segments");
        ["partial_renders", "segments_full", "memory_full"].map(|name| report.total.number(&format!("binning.{name}")))
    };
    // Few segments are in flight in front of the bins, and all 200 are kept in lists.
    assert_eq!(binned(1024), [Some(0.0); 3]);
    assert_eq!(binned(202), [Some(0.0); 3]);
    // With 50 of them, 49 fences are held back at a time, four times; the last four segments end with the pass.
    assert_eq!(binned(50), [Some(4.0), Some(4.0), Some(0.0)]);
    // Each segment is drawn for itself where only one is kept.
    assert_eq!(binned(1), [Some(200.0), Some(200.0), Some(0.0)]);
}

#[test]
fn whatever_keeps_the_order_is_needed() {
    let blended = &scenes()[1];
    for class in CLASSES {
        let sort = format!("sort={class}");
        let changes = [sort.as_str(), "pipelines=4", "geometry_units=4", "assembly.batch=2"];
        let kept = run(&config(&changes), blended, Clock::SkipIdle);
        let lost = run(&config(&[&changes[..], &["order.keep=never"]].concat()), blended, Clock::SkipIdle);
        assert_eq!(wrong(&kept), 0, "{class}");
        assert!(wrong(&lost) > 100, "{class}: {} pixels", wrong(&lost));
    }
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
        let opaque = !scene.blend && scene.compare != Compare::Always;
        if opaque {
            assert!(waited(&free) < waited(&kept), "{scene:?}: {} of {}", waited(&free), waited(&kept));
        } else {
            assert_eq!(waited(&free), waited(&kept), "{scene:?}");
        }
    }
}

#[test]
fn opaque_draws_of_two_kinds_keep_their_order() {
    // Some leave depths only, before those with colours: a colour that came first would stay where a nearer depth follows.
    let scene = Scene { blind: true, size: 150.0, triangles: 60, draws: 6, ..Scene::default() };
    for early in ["order.early=none", "order.early=remote"] {
        let changes = ["sort=sort-last-fragment", "pipelines=4", "assembly.batch=2", "assembly.by_size=false", early];
        assert_eq!(wrong(&run(&config(&[&changes[..], &["order.keep=where-needed"]].concat()), &scene, Clock::SkipIdle)), 0);
        let lost = wrong(&run(&config(&[&changes[..], &["order.keep=never"]].concat()), &scene, Clock::SkipIdle));
        // Asked owners hide most of what would come too early.
        assert!(lost > if early.ends_with("none") { 100 } else { 0 }, "{early}: {lost} pixels");
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
        // Of one sample per pixel, each is shaded once.
        assert!(seen < 0.95 * all && seen == written && seen + hidden == all, "{seen} + {hidden} of {all}: {scene:?}");
        assert!(scene.samples > 1 || seen <= f64::from(scene.width * scene.height), "{seen} shaded");
    }
    // Nothing is hidden behind blended triangles.
    let blended = Scene { blend: true, ..opaque };
    assert_eq!(shaded(&blended, "bin.hide=true").2, 0.0);
}

/// Scenes in which depth decides one way, the other way, or does not, and early tests must know which.
fn scenes_of_all_directions() -> Vec<Scene> {
    use Compare::{Always, Equal, Greater, GreaterEqual, Less, LessEqual, NotEqual};
    let plain = Scene { width: 88, height: 72, size: 80.0, triangles: 20, draws: 4, segments: 1, ..Scene::default() };
    let of = |compares: &[Compare]| Scene { compares: compares.to_vec(), ..plain.clone() };
    let counted = Scene { depth_format: Some(Format::Depth24PlusStencil8), stencil: true, ..plain.clone() };
    vec![
        of(&[Less, Greater]),
        of(&[LessEqual, GreaterEqual, LessEqual, LessEqual]),
        of(&[Less, Always, Less, Less]),
        of(&[Less, NotEqual, Less, Equal]),
        of(&[Less, Less, Equal, Greater]),
        Scene { samples: 4, ..of(&[Less, GreaterEqual, Less]) },
        // Reversed: what is far is 0.
        Scene { compare: Greater, ..of(&[Greater, GreaterEqual]) },
        Scene { compare: Greater, depth_format: Some(Format::Depth24PlusStencil8), ..of(&[GreaterEqual, Less, Greater]) },
        counted.clone(),
        Scene { compares: vec![Less, Greater], discard: true, early: false, ..counted },
        // Fragments that a late draw discards write no depth.
        Scene { discard: true, early: false, ..of(&[Less]) },
        Scene { discard: true, early: false, samples: 4, blend: true, ..of(&[LessEqual]) },
    ]
}

#[test]
fn early_tests_change_no_picture() {
    let mut culled = 0.0;
    for scene in scenes().into_iter().chain(scenes_of_all_directions()) {
        for early in ["order.early=local", "order.early=remote"] {
            for (pipelines, more) in [
                (1, &[][..]),
                (2, &["depth.cache_blocks=4", "depth.cache_ways=2", "assembly.batch=3"][..]),
                (4, &["order.early_latency=40", "order.early_queue=3", "color.fast_clear=false"]),
                (7, &["order.early_bytes=4", "assembly.batch=2", "network.topology=ring", "distribute.tile=8"]),
            ] {
                let pipes = format!("pipelines={pipelines}");
                let config = config(&[&["sort=sort-last-fragment", early, &pipes], more].concat());
                let report = run(&config, &scene, Clock::SkipIdle);
                assert_eq!(wrong(&report), 0, "{early} on {pipelines} pipelines: {scene:?}");
                frames_add_up(&report);
                culled += report.total.number("funnel.quads_early_culled").unwrap();
            }
        }
    }
    assert!(culled > 50_000.0, "{culled} quads");
}

#[test]
fn early_tests_know_what_a_pass_has_loaded() {
    let scene = Scene { draws: 2, segments: 1, size: 110.0, covered: true, ..Scene::default() };
    for early in ["local", "remote"] {
        for pipelines in [1, 3, 4] {
            let (pipes, early) = (format!("pipelines={pipelines}"), format!("order.early={early}"));
            let config = config(&["sort=sort-last-fragment", &pipes, &early]);
            let mut machine = Machine::new(&config).unwrap();
            let report = machine.run(in_two_passes(&scene).into_iter(), Clock::SkipIdle).unwrap();
            assert_eq!(wrong(&report), 0, "{pipes} {early}");
            assert!(report.total.number("funnel.quads_early_culled").unwrap() > 1000.0);
        }
    }
}

#[test]
fn clocks_and_orders_of_ticks_change_nothing_on_early_tests() {
    let opaque = Scene { width: 88, height: 72, size: 60.0, triangles: 20, ..Scene::default() };
    for scene in [opaque.clone(), Scene { samples: 4, early: false, discard: true, ..opaque }] {
        for early in ["order.early=local", "order.early=remote"] {
            for keep in ["always", "where-needed", "never"] {
                let keep = format!("order.keep={keep}");
                let config = config(&["sort=sort-last-fragment", "pipelines=3", early, &keep, "assembly.batch=4"]);
                let every = run(&config, &scene, Clock::EveryCycle);
                accounts_add_up(&every.total);
                for clock in [Clock::SkipIdle, Clock::Shuffled(1), Clock::Shuffled(2)] {
                    let other = run(&config, &scene, clock);
                    assert_eq!(every.total.json().to_string(), other.total.json().to_string(), "{early}, {keep}, {clock:?}");
                    assert!(every.frames[0].picture == other.frames[0].picture, "{early}, {keep}, {clock:?}");
                }
            }
        }
    }
}

#[test]
fn depths_of_a_shader_that_comes_after_the_test_do_not_count() {
    let scene = Scene { covered: true, ..scenes()[0].clone() };
    let with_depths = |event| match event {
        Event::Draw(draw) => {
            let mut draw = draw.as_ref().clone();
            let state = Arc::make_mut(&mut draw.state);
            (state.depth_words, state.payload_words) = (4, state.payload_words + 4);
            state.targets.iter_mut().flatten().for_each(|target| target.payload = Some(4));
            Event::Draw(Arc::new(draw))
        }
        Event::Segment(segment) => {
            let mut segment = segment.as_ref().clone();
            for tile in &mut segment.tiles {
                let old = std::mem::take(&mut tile.payload);
                for quad in &mut tile.quads {
                    let words = &old[quad.payload as usize..][..4];
                    quad.payload = tile.payload.len() as u32;
                    tile.payload.extend([0.125_f32.to_bits(); 4]);
                    tile.payload.extend(words);
                }
            }
            Event::Segment(Arc::new(segment))
        }
        other => other,
    };
    let events: Vec<Event> = events(&scene).into_iter().map(with_depths).collect();
    for class in ALL {
        for early in if class == ALL[3] { &["none", "local", "remote"][..] } else { &["none"] } {
            let config = config(&[&format!("sort={class}"), &format!("order.early={early}"), "pipelines=3"]);
            let report = Machine::new(&config).unwrap().run(events.iter().cloned(), Clock::SkipIdle).unwrap();
            assert_eq!(wrong(&report), 0, "{class} {early}");
        }
    }
}

#[test]
fn early_tests_save_shading_and_traffic() {
    let scene = Scene { size: 150.0, triangles: 120, ..Scene::default() };
    for samples in [1, 4] {
        let scene = Scene { samples, ..scene.clone() };
        let of = |early: &str| {
            let report = run(
                &config(&["sort=sort-last-fragment", early, "pipelines=4", "assembly.by_size=false"]),
                &scene,
                Clock::SkipIdle,
            );
            assert_eq!(wrong(&report), 0, "{early}");
            let number = |path: &str| report.total.number(path).unwrap_or(0.0) as u64;
            let each = |name: &str| (0..4).map(|n| number(&format!("early.early[{n}].{name}"))).sum::<u64>();
            let (asked, culled) = (each("asked"), each("culled"));
            // Every question has an answer, and all quads that are not discarded are shaded and sent.
            assert_eq!(asked, each("answered"), "{early}");
            assert_eq!(culled, number("funnel.quads_early_culled"), "{early}");
            assert_eq!(number("funnel.quads_rasterized") - culled, number("funnel.quads_shaded"), "{early}");
            assert_eq!(number("sort.sorted_items"), number("funnel.quads_shaded"), "{early}");
            assert_eq!(number("sort.redistributed_bytes"), 40 * number("funnel.quads_shaded"), "{early}");
            // Depths of four bytes per sample; a question for each group of up to four quads.
            let (questions, answers) = (each("question_bytes"), each("answer_bytes"));
            if early.ends_with("remote") {
                assert_eq!(answers, asked * 16 * u64::from(samples));
                assert!((8 * asked.div_ceil(4)..=8 * asked).contains(&questions), "{questions}");
            } else {
                assert_eq!((questions, answers), (0, 0), "{early}");
            }
            (number("funnel.quads_shaded"), number("funnel.fragments_written"))
        };
        let [(none, written), (local, other), (remote, another)] =
            ["order.early=none", "order.early=local", "order.early=remote"].map(of);
        assert_eq!((written, written), (other, another));
        // One of four pipelines knows a quarter of the occluders; the owner knows all that have arrived.
        assert!(local < none * 9 / 10 && remote < local, "{none}, {local}, {remote} quads shaded");
    }
}

#[test]
fn early_tests_ahead_of_an_owner_are_refused_where_pipelines_own_what_they_draw() {
    for class in ALL {
        let mut config = Config::built_in("four-pipelines").unwrap();
        config.set(&format!("sort={class}")).unwrap();
        config.set("order.early=remote").unwrap();
        let checked = config.check();
        if class == "sort-last-fragment" {
            assert!(checked.is_ok());
        } else {
            let text = checked.unwrap_err().to_string();
            assert!(text.contains("order.early is \"remote\"") && text.contains(class), "{text}");
        }
    }
}
