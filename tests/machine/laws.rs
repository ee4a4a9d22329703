//! Laws for every machine on every scene: accounts add up, items are conserved, and the result does not depend on the clock or the order
//! of ticks.

use crate::common::{
    Figures, accounts_add_up, config, conserved, dispatch, dispatch_of, everything, frames_add_up, is_chosen, rendered, run,
};
use std::sync::Arc;

use fillrate::knob::{Allowed, Knob};
use fillrate::machine::config::SortClass;
use fillrate::machine::{Config, Machine, MachineError};
use fillrate::num::Random;
use fillrate::sim::Clock;
use fillrate::stats::Group;
use fillrate::synthetic::{Scene, events};
use fillrate::unit::Fault;
use fillrate::unit::sorting::Keep;
use fillrate::work::{Event, Funnel, RequestKind, Shade};

/// Scenes of `traces/`, and whether all their draws have a fragment stage.
const SCENES: [(&str, bool); 8] = [
    ("triangle", true),
    ("cube", true),
    ("corridor", true),
    ("layers", true),
    ("spokes-msaa", true),
    ("sprites", true),
    ("particles", true),
    ("shadow", false),
];

/// Machines of every kind, and whether other clocks are tried; for large scenes fewer, since the small machines and the clocks that count
/// every cycle take long over them.
fn machines(scene: &str) -> Vec<(Config, bool)> {
    let ideal = ["memory.kind=ideal", "distribute.tile=8", "distribute.overlap=bounding-box", "geometry_units=3"];
    let mut machines = vec![(config("four-pipelines", &[]), scene != "sprites")];
    // Of these two one run takes as long as all of most others.
    if !matches!(scene, "sprites" | "shadow") {
        machines.push((config("four-pipelines", &ideal), false));
    }
    if matches!(scene, "triangle" | "cube" | "spokes-msaa") {
        let one = ["pipelines=1", "geometry_units=1", "core.unified=false", "traverse.hierarchical_update=write"];
        let small = scene == "triangle";
        machines.push((config("four-pipelines", &["memory.kind=ideal"]), true));
        machines.extend([
            (config("tiny", &[]), small),
            (config("attila", &[]), false),
            (config("wide", &[]), false),
            (config("four-pipelines", &one), false),
        ]);
    }
    machines
}

#[test]
fn accounts_add_up_nothing_is_lost_and_clocks_agree_on_any_scene() {
    for (name, fragments) in SCENES {
        let events = rendered(name);
        // The renderer's own count, made without a machine.
        let mut funnel = Funnel::default();
        for event in &events {
            if let Event::Segment(segment) = event {
                funnel += segment.funnel;
            }
        }
        for (config, clocked) in machines(name) {
            let report = run(&config, &events, Clock::SkipIdle);
            accounts_add_up(&report.total);
            frames_add_up(&report);
            conserved(&config, &report.total, fragments);
            for frame in &report.frames {
                let wrong = frame.picture.as_ref().map(|picture| picture.wrong_pixels);
                assert_eq!(wrong, Some(0), "frame {} of {name} on {}", frame.number, config.name);
            }
            for (leaf, expected) in funnel.named() {
                // The renderer shades each vertex once and tests every quad; a machine forgets vertices and culls whole blocks.
                if leaf != "vertices_shaded" && !leaf.ends_with("hiz_culled") {
                    let path = format!("funnel.{leaf}");
                    assert_eq!(report.total.number(&path), Some(expected as f64), "{path} of {name} on {}", config.name);
                }
            }
            // An order that is shuffled skips no cycle either; every cycle in the usual order beside it where that is cheap.
            let every = (name == "triangle").then_some(Clock::EveryCycle);
            let clocks = every.into_iter().chain([Clock::Shuffled(events.len() as u64)]).filter(|_| clocked);
            let mut expected = None;
            for clock in clocks {
                let expected = expected.get_or_insert_with(|| everything(&report));
                assert!(everything(&run(&config, &events, clock)) == *expected, "{name} on {}, {clock:?}", config.name);
            }
        }
    }
}

#[test]
fn no_order_of_ticks_changes_the_statistics() {
    let baseline = config("four-pipelines", &[]);
    let events = rendered("triangle");
    let expected = everything(&run(&baseline, &events, Clock::SkipIdle));
    for seed in 0..8 {
        assert!(everything(&run(&baseline, &events, Clock::Shuffled(seed))) == expected, "order {seed}");
    }
}

/// Small work of all kinds: opaque, blended, late, multisampled; compute before. With `less`, about a third of it.
fn mixture(covered: bool, less: bool) -> Vec<Vec<Event>> {
    let of = |n: u32, fewer: u32| if less { fewer } else { n };
    let plain = Scene { width: of(72, 56), height: of(56, 40), triangles: of(16, 7), size: 40.0, covered, ..Scene::default() };
    let scenes = [
        plain.clone(),
        Scene { samples: 4, blend: true, early: false, discard: true, ..plain.clone() },
        Scene { size: 5.0, triangles: of(120, 40), draws: 3, textures: 2, frames: 2, ..plain },
    ];
    scenes.iter().map(|scene| [dispatch(6), events(scene)].concat()).collect()
}

/// Checks every law on one machine, with the work that suits it.
fn lawful(config: &Config, works: &[Vec<Vec<Event>>; 2], number: usize, clocks: &[Clock]) {
    let work = &works[usize::from(config.render_key().shade == Shade::Covered)];
    let events = &work[number % work.len()];
    let report = run(config, events, Clock::SkipIdle);
    let text = everything(&report);
    frames_add_up(&report);
    conserved(config, &report.total, true);
    // Without order, the picture is not checked.
    for frame in report.frames.iter().filter(|_| config.order.keep == Keep::Always) {
        // Blending needs an order. Pipelines with their own framebuffers do not keep it, and report this.
        if frame.tree.number("sort.passes_needing_order").unwrap_or(0.0) == 0.0 {
            assert_eq!(frame.picture.as_ref().map(|picture| picture.wrong_pixels), Some(0), "{}", config.resolved());
        }
    }
    for &clock in clocks {
        let other = everything(&run(config, events, clock));
        let at = text.bytes().zip(other.bytes()).take_while(|(a, b)| a == b).count();
        let around = |text: &str| text[at.saturating_sub(200)..(at + 100).min(text.len())].to_owned();
        assert!(other == text, "{clock:?}: {}\nagainst {}\non {}", around(&other), around(&text), config.resolved());
    }
}

/// Ends at which a run is millions of cycles, and values with which these can be counted one by one.
const LONG: [(&str, &str); 3] = [
    ("command.command_cycles=65536", "command.command_cycles=4000"),
    ("memory.dram.card_cycles=10000", "memory.dram.card_cycles=500"),
    ("memory.ideal_latency=65535", "memory.ideal_latency=5000"),
];

/// A display that any memory serves and whose refreshes are short: what is too fast is refused when the first frame is shown.
const DISPLAY: [&str; 2] = ["scanout.line_cycles=300", "scanout.blank_lines=3"];

#[test]
fn every_knob_at_its_ends_makes_a_lawful_machine() {
    // Some hundreds of machines, of which the usual suite takes one in three.
    let work = [mixture(false, true), mixture(true, true)];
    let baseline = Config::built_in("four-pipelines").unwrap();
    let (mut number, mut ran, mut refused) = (0, 0, Vec::new());
    for (section, knobs) in baseline.sections() {
        for knob in knobs.knobs() {
            let path = knob.path(section);
            let ends = match knob.allowed {
                Allowed::Range(low, high) | Allowed::PowerOfTwo(low, high) => vec![low.to_string(), high.to_string()],
                Allowed::Switch => vec!["true".into(), "false".into()],
                Allowed::Choice(names) => names.iter().map(|&name| name.to_owned()).collect(),
            };
            for value in ends {
                let mut changed = baseline.clone();
                changed.set(&format!("{path}={value}")).unwrap_or_else(|error| panic!("{error}"));
                changed.name = format!("{path}={value}");
                for (sections, setting) in [
                    ("memory.ideal", "memory.kind=ideal"),
                    ("route.", "sort=sort-first"),
                    ("bin.", "sort=sort-middle-binned"),
                    ("order.", "sort=sort-last-fragment"),
                    ("order.early_", "order.early=remote"),
                    ("compose.", "sort=sort-last-image"),
                    ("network.", "network.topology=butterfly"),
                    ("scanout.swap", "scanout.mode=free-running"),
                    ("scanout.buffers", "scanout.mode=free-running"),
                    ("scanout.fifo", "scanout.mode=free-running"),
                    ("scanout.show_last", "scanout.mode=free-running"),
                    ("scanout.", DISPLAY[0]),
                    ("traverse.pixel_tests", "traverse.walk=box"),
                    ("core.overlap", "core.issue=1"),
                ] {
                    if path.starts_with(sections) && !setting.starts_with(&format!("{path}=")) {
                        changed.set(setting).unwrap();
                    }
                }
                number += 1;
                // A value that conflicts with other knobs is refused by name, and no machine is built.
                if let Err(error) = changed.check() {
                    assert!(error.to_string().contains(knob.name), "{path}={value}: {error}");
                    assert!(Machine::new(&changed).is_err());
                    refused.push(changed.name);
                    continue;
                }
                // As a rule two values a knob: one in three takes lower and upper ends in turn.
                if !is_chosen(3, &[number]) {
                    continue;
                }
                let clocks = if LONG.iter().any(|(end, _)| *end == changed.name) { &[][..] } else { &[Clock::EveryCycle] };
                lawful(&changed, &work, ran, clocks);
                ran += 1;
            }
        }
    }
    for (end, shorter) in LONG {
        let ideal = if end.contains("ideal") { "memory.kind=ideal" } else { "memory.kind=dram" };
        lawful(&config("four-pipelines", &[ideal, shorter]), &work, ran, &[Clock::EveryCycle]);
        ran += 1;
    }
    assert!(number > 250 && ran >= number / 3 - refused.len(), "{ran} of {number} ran");
    assert!(refused.len() < 20, "refused: {refused:?}");
}

/// A value that a knob takes, near the lower end as a rule: there queues are full, caches miss, and units wait for each other.
fn some(allowed: Allowed, random: &mut Random) -> String {
    match allowed {
        Allowed::Range(low, high) => {
            let span = 1 << random.below(6);
            (low + u64::from(random.below(span))).min(high).to_string()
        }
        Allowed::PowerOfTwo(low, high) => (low << random.below(5)).min(high).to_string(),
        Allowed::Switch => (random.below(2) == 1).to_string(),
        Allowed::Choice(names) => names[random.below(names.len() as u32) as usize].to_owned(),
    }
}

#[test]
fn machines_made_at_random_are_lawful() {
    let work = [mixture(false, true), mixture(true, true)];
    let mut random = Random::new(17);
    let mut made = 0;
    while made < 16 {
        let mut config = Config::built_in("four-pipelines").unwrap();
        config.name = format!("machine {made} made at random");
        // Some keep the baseline's value: a refresh as often as once in a few cycles is no machine, and a core with few registers takes
        // long over all this work.
        let kept = |knob: &Knob| matches!(knob.name, "watchdog" | "t_refi" | "t_rfc" | "registers" | "warps" | "interleave");
        change_at_random(&mut config, |knob| (!kept(knob) && random.below(3) > 0).then(|| some(knob.allowed, &mut random)));
        DISPLAY.iter().for_each(|change| config.set(change).expect("a knob"));
        if config.check().is_err() {
            continue;
        }
        if is_chosen(4, &[made]) {
            lawful(&config, &work, made, &[Clock::Shuffled(made as u64)]);
        }
        made += 1;
    }
}

/// Gives knobs the values that are drawn for them.
fn change_at_random(config: &mut Config, mut value: impl FnMut(&Knob) -> Option<String>) {
    for (section, knobs) in Config::built_in("four-pipelines").unwrap().sections() {
        for knob in knobs.knobs() {
            if let Some(value) = value(knob) {
                let path = knob.path(section);
                config.set(&format!("{path}={value}")).unwrap();
            }
        }
    }
}

/// One of the two ends of what a knob takes.
fn end(allowed: Allowed, random: &mut Random) -> String {
    match allowed {
        Allowed::Range(low, high) | Allowed::PowerOfTwo(low, high) => [low, high][random.below(2) as usize].to_string(),
        other => some(other, random),
    }
}

#[test]
fn knobs_that_are_said_to_have_no_effect_have_none() {
    let work = [mixture(false, true), mixture(true, true)];
    let mut silent = 0;
    for class in SortClass::NAMES {
        for memory in ["dram", "ideal"] {
            let mut plain = Config::built_in(class).unwrap();
            plain.set(&format!("memory.kind={memory}")).unwrap();
            let mut changed = plain.clone();
            for (section, knobs) in plain.sections() {
                for knob in knobs.knobs() {
                    let path = knob.path(section);
                    if plain.no_effect(&path).is_none() {
                        continue;
                    }
                    let ends = match knob.allowed {
                        Allowed::Range(low, high) | Allowed::PowerOfTwo(low, high) => vec![low.to_string(), high.to_string()],
                        Allowed::Switch => vec!["true".into(), "false".into()],
                        Allowed::Choice(names) => names.iter().map(|&name| name.to_owned()).collect(),
                    };
                    // Rules between knobs refuse some values even so.
                    for value in ends {
                        let mut next = changed.clone();
                        next.set(&format!("{path}={value}")).unwrap();
                        if next.check().is_ok() && next != changed {
                            changed = next;
                            silent += 1;
                        }
                    }
                }
            }
            let events = &work[usize::from(plain.render_key().shade == Shade::Covered)][0];
            let [plain, changed] = [plain, changed].map(|config| everything(&run(&config, events, Clock::SkipIdle)));
            assert!(plain == changed, "{class}, {memory}");
        }
    }
    assert!(silent > 300, "only {silent} changes were tried");
}

/// How many machines of each class.
const ROUNDS: u32 = 30;

/// Knobs whose upper ends cost the host much: units and channels by the thousand.
const LARGE: [&str; 4] = ["pipelines", "per_pipeline", "vertex_cores", "geometry_units"];

/// The DRAM's clock: at its lower end memory is some hundred times as slow, a display that runs free takes all of it, and drawing counts as stuck.
const CLOCK: &str = "clock";

#[test]
fn machines_of_all_classes_with_many_knobs_at_their_ends_run_or_are_refused_by_name() {
    let work = [mixture(false, false), mixture(true, false)];
    let mut random = Random::new(23);
    let (mut ran, mut refused) = (0, 0);
    for round in 0..ROUNDS {
        for class in SortClass::NAMES {
            let mut config = Config::built_in(class).unwrap();
            config.name = format!("{class} {round} with knobs at their ends");
            // From one in 32 to one in two.
            let share = 2 << random.below(5);
            change_at_random(&mut config, |knob| {
                let kept = ["sort", CLOCK].contains(&knob.name) || LARGE.contains(&knob.name);
                let ends = random.below(share) == 0 && !kept;
                ends.then(|| end(knob.allowed, &mut random))
            });
            DISPLAY.iter().for_each(|change| config.set(change).expect("a knob"));
            match config.check() {
                Ok(()) => {
                    lawful(&config, &work, ran, &[]);
                    ran += 1;
                }
                Err(error) => {
                    let message = error.to_string();
                    let sections: Vec<&str> = config.sections().into_iter().map(|(section, _)| section).collect();
                    let named = sections.iter().any(|section| !section.is_empty() && message.contains(section));
                    assert!(named, "{message}");
                    assert!(Machine::new(&config).is_err());
                    refused += 1;
                }
            }
        }
    }
    assert!(ran > 50 && refused > 10, "{ran} ran, {refused} were refused");
}

/// Changes that make everything wait as long as it can.
const SLOW: [&str; 26] = [
    "watchdog=1000",
    "memory.port_latency=1024",
    "memory.port_queue=2",
    "memory.l2.latency=1024",
    "network.link_latency=256",
    "texture.latency=256",
    "depth.latency=256",
    "color.latency=256",
    "fetch.patience=4096",
    "dispatch.patience=4096",
    "core.float_latency=63",
    "core.integer_latency=63",
    "core.special_latency=63",
    "memory.dram.clock=1",
    "memory.dram.card_cycles=10000",
    "memory.dram.t_rcd=1000",
    "memory.dram.t_rp=1000",
    "memory.dram.cl=1000",
    "memory.dram.cwl=1000",
    "memory.dram.t_ras=1000",
    "memory.dram.t_faw=1000",
    "memory.dram.t_wr=1000",
    "memory.dram.t_wtr=1000",
    "memory.dram.t_rtw=1000",
    "memory.dram.t_rfc=10000",
    "memory.dram.t_refi=1000000",
];

#[test]
fn the_slowest_machine_of_each_class_is_not_taken_for_stuck() {
    let work = [mixture(false, false), mixture(true, false)];
    for class in SortClass::NAMES {
        lawful(&config(class, &SLOW), &work, 0, &[]);
    }
    // Both clocks agree where cycles can be counted one by one.
    lawful(
        &config("four-pipelines", &[&SLOW[..13], &["memory.kind=ideal", "memory.ideal_latency=65535"]].concat()),
        &work,
        1,
        &[Clock::EveryCycle],
    );
}

#[test]
fn a_workgroup_of_256_invocations_runs_on_the_smallest_machine() {
    let machines = [
        ("tiny", &[][..]),
        ("four-pipelines", &["core.warps=1"]),
        ("four-pipelines", &["core.registers=256"]),
        ("tiny", &["core.warp_width=4", "core.warps=1", "core.registers=256"]),
    ];
    for (name, changes) in machines {
        let config = config(name, changes);
        for barrier in [false, true] {
            let events = dispatch_of(5, 256, 16_384, barrier);
            let report = run(&config, &events, Clock::SkipIdle);
            accounts_add_up(&report.total);
            conserved(&config, &report.total, true);
            let warps = 5.0 * 256.0 / f64::from(config.core.warp_width);
            let instructions = if barrier { 21.0 } else { 15.0 };
            let cores: f64 = Figures(&report.total).sum("units.core", "items") as f64;
            assert_eq!(cores, instructions * warps, "{name} {changes:?}");
            for clock in [Clock::EveryCycle, Clock::Shuffled(3)] {
                assert!(everything(&run(&config, &events, clock)) == everything(&report), "{name} {changes:?}, {clock:?}");
            }
        }
    }
    // A recorded one of 64, of which the smallest machine holds half.
    let config = config("tiny", &["core.warps=4"]);
    let report = run(&config, &rendered("particles"), Clock::SkipIdle);
    accounts_add_up(&report.total);
    conserved(&config, &report.total, true);
    assert!(report.frames.iter().all(|frame| frame.picture.as_ref().is_some_and(|picture| picture.wrong_pixels == 0)));
}

#[test]
fn workgroup_memory_beyond_a_cores_is_refused_by_name() {
    let text = "dispatch 0: workgroup memory asks for 16385, and a core of this machine has 16384 (configuration key core.shared_bytes)";
    for clock in [Clock::SkipIdle, Clock::EveryCycle] {
        let mut machine = Machine::new(&config("tiny", &[])).unwrap();
        let error = machine.run(dispatch_of(1, 64, 16_385, true).into_iter(), clock).unwrap_err();
        assert!(matches!(error, MachineError::Fault(Fault::Resources { .. })), "{clock:?}: {error}");
        assert_eq!(error.to_string(), text, "{clock:?}");
    }
}

#[test]
fn a_machine_that_is_stuck_is_stopped_at_once_and_shows_what_it_holds() {
    // Fragments that end at a barrier, which no fragment shader has: nobody ever releases them. What was before them goes on to its
    // end, and the most patient machine waits no longer than that.
    let config = config("four-pipelines", &["watchdog=1000000000"]);
    let at_barrier = |event| match event {
        Event::Segment(segment) => {
            let mut segment = (*segment).clone();
            for cost in segment.tiles.iter_mut().flat_map(|tile| &mut tile.invocations.costs.costs) {
                cost.steps.last_mut().expect("a step").then = RequestKind::Barrier;
            }
            Event::Segment(Arc::new(segment))
        }
        other => other,
    };
    let events: Vec<Event> = rendered("triangle").into_iter().map(at_barrier).collect();
    let messages: Vec<String> = [Clock::SkipIdle, Clock::EveryCycle, Clock::Shuffled(5)]
        .iter()
        .map(|&clock| {
            let mut machine = Machine::new(&config).unwrap();
            let error = machine.run(events.iter().cloned(), clock).unwrap_err();
            assert!(matches!(error, MachineError::Stuck(_)), "{error}");
            error.to_string()
        })
        .collect();
    assert!(messages.iter().all(|message| *message == messages[0]), "{messages:#?}");
    let text = &messages[0];
    assert!(text.starts_with("nothing has moved since cycle "), "{text}");
    assert!(text.contains(", and nothing is on its way to any unit; the machine is stuck\n"), "{text}");
    // Every unit by name with its reason, and what it holds.
    for unit in ["unit command[0]: ", "unit fetch[0]: starved, ", "unit core[0]: memory, 64 inside", "unit dram[0]: "] {
        assert!(text.contains(&format!("\n{unit}")), "{unit} in\n{text}");
    }
}

#[test]
fn a_display_that_goes_on_does_not_hide_that_drawing_is_stuck() {
    // As above, from the second frame on: the first one is shown again and again.
    let free = ["scanout.mode=free-running", "scanout.line_cycles=100", "scanout.buffers=2", "watchdog=1000"];
    let config = config("four-pipelines", &free);
    let mut ended = 0;
    let at_barrier = |event| match event {
        Event::Segment(segment) if ended > 0 => {
            let mut segment = (*segment).clone();
            for cost in segment.tiles.iter_mut().flat_map(|tile| &mut tile.invocations.costs.costs) {
                cost.steps.last_mut().expect("a step").then = RequestKind::Barrier;
            }
            Event::Segment(Arc::new(segment))
        }
        Event::EndFrame(_) => {
            ended += 1;
            event
        }
        other => other,
    };
    let events: Vec<Event> = rendered("particles").into_iter().map(at_barrier).collect();
    let error = Machine::new(&config).unwrap().run(events.into_iter(), Clock::SkipIdle).unwrap_err();
    assert!(matches!(error, MachineError::Drawing(_)), "{error}");
    let text = error.to_string();
    assert!(text.starts_with("nothing but the display has moved for 8 refreshes and more"), "{text}");
    assert!(text.contains("\nunit core[0]: ") && !text.contains("unit scanout"), "{text}");
}
