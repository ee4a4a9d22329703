//! Passes, dispatches and copies that do not depend on each other run beside each other where the card lets them: never slower, with the same
//! pictures, under all laws; those that depend on each other follow as before.

use crate::common::{Figures, config, conserved, dispatch, everything, frames_add_up, run};
use fillrate::machine::{Config, MachineReport};
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events, in_two_passes};
use fillrate::work::*;

/// Machines on which passes overlap. On the two other classes they do not, whatever the knob says.
const OVERLAPPING: [&str; 3] = ["sort-first", "sort-middle", "sort-last-fragment"];

fn machine(class: &str, overlap: bool, async_compute: bool) -> Config {
    let set = [format!("command.overlap={overlap}"), format!("command.async_compute={async_compute}")];
    config(class, &[&set[0], &set[1]])
}

/// The passes of a scene of one frame without its end, in surfaces of their own.
fn apart(scene: &Scene, number: u32) -> Vec<Event> {
    let own = |surface: Surface| Surface {
        key: SurfaceKey { texture: surface.key.texture + 10 * number, ..surface.key },
        address: surface.address + (u64::from(number) << 30),
        ..surface
    };
    let attachment = |of: Attachment| Attachment { surface: own(of.surface), resolve: of.resolve.map(own), ..of };
    let of = |event| match event {
        Event::BeginPass(pass) => {
            let (color, depth) = (pass.color.iter().map(|of| of.map(attachment)).collect(), pass.depth.map(attachment));
            Event::BeginPass(Pass { number, color, depth, ..(*pass).clone() }.into())
        }
        Event::EndFrame(end) => Event::EndFrame(EndFrame { shown: end.shown.map(own), ..end }),
        other => other,
    };
    events(scene).into_iter().map(of).collect()
}

/// Passes in surfaces of their own, one behind the other in one frame, which shows what the last one draws.
fn independent(scenes: &[Scene]) -> Vec<Event> {
    let last = scenes.len() - 1;
    let of = |(number, scene): (usize, &Scene)| {
        let mut passes = apart(scene, number as u32);
        passes.retain(|event| number == last || !matches!(event, Event::EndFrame(_)));
        passes
    };
    scenes.iter().enumerate().flat_map(of).collect()
}

fn scenes(config: &Config) -> [Scene; 3] {
    let covered = config.render_key().shade == Shade::Covered;
    let plain = Scene { width: 104, height: 88, triangles: 24, size: 50.0, covered, ..Scene::default() };
    [
        plain.clone(),
        Scene { samples: 4, blend: true, early: false, discard: true, seed: 3, ..plain.clone() },
        Scene { size: 6.0, triangles: 150, draws: 3, textures: 2, seed: 5, ..plain },
    ]
}

fn commands(report: &MachineReport) -> [u64; 2] {
    ["command.overlapped", "command.waited"].map(|path| Figures(&report.total).at(path))
}

/// A run that keeps all laws and draws what it should, the same under all clocks.
fn lawful(config: &Config, events: &[Event]) -> MachineReport {
    let report = run(config, events, Clock::SkipIdle);
    frames_add_up(&report);
    conserved(config, &report.total, true);
    for frame in &report.frames {
        assert_eq!(frame.picture.as_ref().map(|picture| picture.wrong_pixels), Some(0), "{}", config.name);
    }
    for clock in [Clock::EveryCycle, Clock::Shuffled(5)] {
        assert!(everything(&run(config, events, clock)) == everything(&report), "{}, {clock:?}", config.name);
    }
    report
}

#[test]
fn independent_passes_overlap_and_are_never_slower() {
    for class in OVERLAPPING {
        let (off, on) = (machine(class, false, false), machine(class, true, false));
        let scenes = scenes(&on);
        for order in [[0, 1, 2], [1, 2, 0]] {
            let events = independent(&order.map(|at: usize| scenes[at].clone()));
            let (one_by_one, beside) = (run(&off, &events, Clock::SkipIdle), lawful(&on, &events));
            assert_eq!((commands(&one_by_one), commands(&beside)), ([0, 0], [2, 1]), "{class}, {order:?}");
            // The front of a pass runs while the one before drains: of some thousand cycles, some hundred.
            let [before, now] = [&one_by_one, &beside].map(|report| report.frames[0].cycles as f64);
            eprintln!("{class}, {order:?}: {before} cycles one by one, {now} beside each other");
            assert!(now < 0.95 * before, "{class}, {order:?}: {before} cycles one by one, {now} beside each other");
        }
    }
}

#[test]
fn a_pass_that_loads_what_the_one_before_has_drawn_waits_for_it() {
    for class in OVERLAPPING {
        let (off, on) = (machine(class, false, false), machine(class, true, true));
        let events = in_two_passes(&Scene { draws: 2, segments: 1, covered: scenes(&on)[0].covered, ..Scene::default() });
        let (one_by_one, beside) = (run(&off, &events, Clock::SkipIdle), lawful(&on, &events));
        assert_eq!(commands(&beside), [0, 2], "{class}");
        assert_eq!(one_by_one.frames[0].cycles, beside.frames[0].cycles, "{class}");
    }
}

#[test]
fn classes_that_draw_one_pass_at_a_time_say_so_and_do_not_change() {
    for class in ["sort-middle-binned", "sort-last-image"] {
        let (off, on) = (machine(class, false, false), machine(class, true, false));
        let why = on.no_effect("command.overlap").expect("it has no effect");
        assert!(why.contains(class), "{why}");
        let [scene, ..] = scenes(&on);
        let events = independent(&[scene.clone(), scene]);
        assert!(everything(&run(&off, &events, Clock::SkipIdle)) == everything(&run(&on, &events, Clock::SkipIdle)), "{class}");
    }
    for change in ["order.keep=never", "distribute.pattern=bands", "distribute.pattern=balanced"] {
        assert!(config("sort-middle", &["command.overlap=true", change]).no_effect("command.overlap").is_some(), "{change}");
    }
    assert_eq!(config("sort-middle", &[]).no_effect("command.overlap"), None);
}

#[test]
fn dispatches_and_copies_run_beside_passes_in_all_classes() {
    let [from, to] = [5_u64 << 32, 6_u64 << 32];
    let bytes = 64 << 10;
    let copy = Event::Transfer(Transfer {
        kind: TransferKind::Copy,
        from: Some(from),
        to: Some(to),
        bytes,
        reads: Some(Extent::new(from, bytes)),
        writes: Some(Extent::new(to, bytes)),
        surfaces: None,
    });
    for class in ["sort-first", "sort-middle", "sort-middle-binned", "sort-last-fragment", "sort-last-image"] {
        let cycles = |overlap, async_compute, overlapped| {
            let config = machine(class, overlap, async_compute);
            let scenes = scenes(&config);
            let parts = [apart(&scenes[0], 1), vec![copy.clone()], dispatch(40), apart(&scenes[2], 2)];
            let mut events = parts.concat();
            let first = events.iter().position(|event| matches!(event, Event::EndFrame(_))).expect("an end");
            events.remove(first);
            let report =
                if class == "sort-last-image" { run(&config, &events, Clock::SkipIdle) } else { lawful(&config, &events) };
            assert!(commands(&report)[0] >= overlapped, "{class}: {overlap}, {async_compute}");
            report.frames[0].cycles as f64
        };
        let copies = u64::from(OVERLAPPING.contains(&class));
        let [none, compute, all] = [cycles(false, false, 0), cycles(false, true, 1), cycles(true, true, 1 + 2 * copies)];
        eprintln!("{class}: {none}, {compute}, {all}");
        assert!(compute < none && all <= 1.02 * compute, "{class}: {none}, {compute}, {all}");
        if copies > 0 {
            assert!(all < 0.97 * compute, "{class}: {none}, {compute}, {all}");
        }
    }
}
