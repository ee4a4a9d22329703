//! Laws that every machine keeps on every scene: accounts that add up, conservation, one outcome whatever the clock and the order of
//! ticks.

use crate::common::{accounts_add_up, config, conserved, dispatch, everything, frames_add_up, rendered, run};
use fillrate::accuracy::Random;
use fillrate::accuracy::synthetic::{Scene, events};
use fillrate::machine::{Config, Machine, MachineError};
use fillrate::sim::Clock;
use fillrate::unit::Fault;
use fillrate::unit::knob::Allowed;
use fillrate::unit::sorting::Keep;
use fillrate::work::{Event, Funnel, Shade};

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

/// What `tiny` needs to hold the workgroups of `particles`.
const ROOM: [&str; 2] = ["core.warps=32", "core.registers=65536"];

/// Machines of every kind; for large scenes fewer, since the small ones take long over them.
fn machines(scene: &str) -> Vec<Config> {
    let mut machines = vec![
        config("baseline", &[]),
        config("baseline", &["memory.kind=ideal", "distribute.tile=8", "distribute.overlap=bounding-box", "geometry_units=3"]),
    ];
    if matches!(scene, "triangle" | "cube" | "spokes-msaa") {
        let one = ["pipelines=1", "geometry_units=1", "core.unified=false", "traverse.hierarchical_update=write"];
        machines.extend([config("tiny", &ROOM), config("attila", &[]), config("wide", &[]), config("baseline", &one)]);
    }
    machines
}

#[test]
fn accounts_add_up_and_nothing_is_lost_on_any_scene() {
    for (name, fragments) in SCENES {
        let events = rendered(name);
        // The renderer's own count, made without a machine.
        let mut funnel = Funnel::default();
        for event in &events {
            if let Event::Segment(segment) = event {
                funnel += segment.funnel;
            }
        }
        for config in machines(name) {
            let report = run(&config, &events, Clock::SkipIdle);
            accounts_add_up(&report.total);
            frames_add_up(&report);
            conserved(&config, &report.total, fragments);
            for (leaf, expected) in Funnel::NAMES.iter().zip(funnel.values()) {
                // The renderer shades each vertex once and tests every quad; a machine forgets vertices and culls whole blocks.
                if !matches!(*leaf, "vertices_shaded" | "tiles_hiz_culled") {
                    let path = format!("funnel.{leaf}");
                    assert_eq!(report.total.number(&path), Some(expected as f64), "{path} of {name} on {}", config.name);
                }
            }
        }
    }
}

#[test]
fn clocks_and_orders_of_ticks_leave_the_same_statistics_on_every_scene() {
    let (baseline, ideal) = (config("baseline", &[]), config("baseline", &["memory.kind=ideal"]));
    let tiny = config("tiny", &[]);
    for (name, _) in SCENES {
        let events = rendered(name);
        // The small machine takes long over large scenes; so do many machines.
        let machines = match name {
            "triangle" => vec![&baseline, &ideal, &tiny],
            "cube" | "spokes-msaa" => vec![&baseline, &ideal],
            _ => vec![&baseline],
        };
        for config in machines {
            let expected = everything(&run(config, &events, Clock::SkipIdle));
            for clock in [Clock::EveryCycle, Clock::Shuffled(events.len() as u64)] {
                assert!(everything(&run(config, &events, clock)) == expected, "{name} on {}, {clock:?}", config.name);
            }
        }
    }
    let events = rendered("triangle");
    let expected = everything(&run(&baseline, &events, Clock::SkipIdle));
    for seed in 0..8 {
        assert!(everything(&run(&baseline, &events, Clock::Shuffled(seed))) == expected, "order {seed}");
    }
}

/// Small work of all kinds: opaque, blended, late, multisampled; compute before.
fn mixture(covered: bool) -> Vec<Vec<Event>> {
    let plain = Scene { width: 72, height: 56, triangles: 16, size: 40.0, covered, ..Scene::default() };
    let scenes = [
        plain.clone(),
        Scene { samples: 4, blend: true, early: false, discard: true, ..plain.clone() },
        Scene { size: 5.0, triangles: 120, draws: 3, textures: 2, frames: 2, ..plain },
    ];
    scenes.iter().map(|scene| [dispatch(6), events(scene)].concat()).collect()
}

/// Every law on one machine, which has its work as it needs it.
fn lawful(config: &Config, works: &[Vec<Vec<Event>>; 2], number: usize, clocks: &[Clock]) {
    let work = &works[usize::from(config.render_key().shade == Shade::Covered)];
    let events = &work[number % work.len()];
    // A workgroup of 64 invocations of 16 registers is left out where no core can hold it.
    let core = &config.core;
    let fits = core.warps * core.warp_width >= 64 && core.registers >= 64 * 16;
    let of_dispatch = |event: &Event| matches!(event, Event::Dispatch(_) | Event::Groups(_));
    let events: Vec<Event> = events.iter().filter(|event| fits || !of_dispatch(event)).cloned().collect();
    let events = &events[..];
    let report = run(config, events, Clock::SkipIdle);
    let text = everything(&report);
    frames_add_up(&report);
    conserved(config, &report.total, true);
    // Without order the picture is what it is.
    for frame in report.frames.iter().filter(|_| config.order.keep == Keep::Always) {
        // Blending needs an order, which pipelines with frame buffers of their own do not keep, and say so.
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

#[test]
fn every_knob_at_its_ends_makes_a_lawful_machine() {
    let work = [mixture(false), mixture(true)];
    let baseline = Config::built_in("baseline").unwrap();
    let (mut ran, mut refused) = (0, Vec::new());
    for (section, knobs) in baseline.sections() {
        for knob in knobs.knobs() {
            let path = if section.is_empty() { knob.name.to_owned() } else { format!("{section}.{}", knob.name) };
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
                ] {
                    if path.starts_with(sections) && path != "network.topology" {
                        changed.set(setting).unwrap();
                    }
                }
                // What does not fit the other knobs is refused by name, and a machine of it is not built.
                if let Err(error) = changed.check() {
                    assert!(error.to_string().contains(knob.name), "{path}={value}: {error}");
                    assert!(Machine::new(&changed).is_err());
                    refused.push(changed.name);
                    continue;
                }
                lawful(&changed, &work, ran, &[Clock::EveryCycle]);
                ran += 1;
            }
        }
    }
    assert!(ran > 250 && refused.len() < 20, "{ran} ran; refused: {refused:?}");
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
    let work = [mixture(false), mixture(true)];
    let mut random = Random::new(17);
    let mut made = 0;
    while made < 16 {
        let mut config = Config::built_in("baseline").unwrap();
        config.name = format!("machine {made} made at random");
        for (section, knobs) in Config::built_in("baseline").unwrap().sections() {
            for knob in knobs.knobs() {
                // Some keep the baseline's value: a refresh as often as once in a few cycles, or a core without room for a workgroup,
                // is no machine. The watchdog is none of the machine's business.
                let kept = matches!(knob.name, "watchdog" | "t_refi" | "t_rfc" | "registers" | "warps" | "interleave");
                if !kept && random.below(3) > 0 {
                    let path = if section.is_empty() { knob.name.to_owned() } else { format!("{section}.{}", knob.name) };
                    config.set(&format!("{path}={}", some(knob.allowed, &mut random))).unwrap();
                }
            }
        }
        if config.check().is_err() {
            continue;
        }
        lawful(&config, &work, made, &[Clock::Shuffled(made as u64)]);
        made += 1;
    }
}

#[test]
fn a_workgroup_that_does_not_fit_a_core_is_refused_by_name() {
    for (change, text) in [
        (
            "core.warps=1",
            "dispatch 0: warps of a workgroup asks for 2, and a core of this machine has 1 (configuration key core.warps)",
        ),
        (
            "core.registers=512",
            "dispatch 0: registers of a workgroup asks for 1024, and a core of this machine has 512 (configuration key \
             core.registers)",
        ),
    ] {
        for clock in [Clock::SkipIdle, Clock::EveryCycle] {
            let mut machine = Machine::new(&config("baseline", &[change])).unwrap();
            let error = machine.run(dispatch(1).into_iter(), clock).unwrap_err();
            assert!(matches!(error, MachineError::Fault(Fault::Resources { .. })), "{clock:?}: {error}");
            assert_eq!(error.to_string(), text, "{clock:?}");
        }
    }
}

#[test]
fn a_machine_that_waits_too_long_is_stopped_and_shows_what_it_holds() {
    // A memory that takes longer than the watchdog waits. All that the machine waits for is shown.
    let config = config("baseline", &["watchdog=1000", "memory.kind=ideal", "memory.ideal_latency=65535"]);
    let events = rendered("triangle");
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
    assert!(text.starts_with("nothing moved from cycle "), "{text}");
    assert!(text.contains("; the machine is stuck\n"), "{text}");
    // Every unit by name with its reason: vertex fetch waits for the memory, which holds its requests.
    for unit in ["unit command[0]: ", "unit fetch[0]: memory, ", "unit color[3]: ", "unit ideal[0]: busy, "] {
        assert!(text.contains(&format!("\n{unit}")), "{unit} in\n{text}");
    }
    // The piece that is being fetched, and the mark behind it.
    assert!(text.contains("\nchannel pieces[0] (command[0] to fetch[0]): 2 of 16, head Piece { slot: 0, "), "{text}");
}
