//! A free-running display on whole machines: closed forms for the frames shown and their duration, the same result under all clocks, and
//! refused settings.

use std::path::Path;

use crate::common::{config, everything, run};
use fillrate::gfx::format::Format;
use fillrate::machine::config::SortClass;
use fillrate::machine::{Config, Machine, MachineReport, Refresh, Shown};
use fillrate::run::replay::{Fidelity, Options, replay};
use fillrate::run::sample::Sampling;
use fillrate::sim::Clock;
use fillrate::synthetic::{Scene, events};
use fillrate::trace::Trace;
use fillrate::work::*;

/// Lines of the frames here and of the vertical blank, and bytes of a line.
const LINES: u64 = 32;
const BLANK: u64 = 4;
const ROW: u64 = 256;

fn free(changes: &[&str]) -> Config {
    let blank = format!("scanout.blank_lines={BLANK}");
    let ideal = ["memory.kind=ideal", "scanout.mode=free-running", &blank];
    config("sort-middle", &[&ideal, changes].concat())
}

/// Frames that first copy a number of bytes from one place to another, and are then shown: all bytes of frame f are f.
fn frames(count: u32, bytes: u64) -> Vec<Event> {
    let key = SurfaceKey { texture: 1, level: 0, layer: 0 };
    let surface = Surface {
        key,
        format: Format::Rgba8Unorm,
        width: 64,
        height: LINES as u32,
        samples: 1,
        address: 1 << 20,
        opaque: false,
    };
    let of = |number: u32| {
        let (from, to) = (1 << 24, 1 << 25);
        let transfer = Transfer {
            kind: TransferKind::Copy,
            from: Some(from),
            to: Some(to),
            bytes,
            reads: Some(Extent::new(from, bytes)),
            writes: Some(Extent::new(to, bytes)),
            surfaces: None,
        };
        let reference = vec![number as u8; (LINES * ROW) as usize].into();
        [
            Event::Transfer(transfer),
            Event::EndFrame(EndFrame { number, shown: Some(surface), reference, drawn: false, sprites: [].into() }),
        ]
    };
    (0..count).flat_map(of).collect()
}

/// All refreshes, tears and dry lines of a run.
fn shown(report: &MachineReport) -> Shown {
    let mut all = Shown::default();
    for part in report.frames.iter().map(|frame| &frame.shown).chain([&report.shown]) {
        all.refreshes.extend(part.refreshes.iter().cloned());
        all.tears.extend(&part.tears);
        all.dry.extend(&part.dry);
    }
    assert!((0..).zip(&all.refreshes).all(|(number, refresh)| refresh.number == number));
    all
}

/// First lines and frames of the parts of a refresh.
fn parts(refresh: &Refresh) -> Vec<(u32, u32)> {
    refresh.parts.iter().map(|(line, frame)| (*line, frame.frame)).collect()
}

/// Number of refreshes that show each frame, for a display that never tears.
fn times_shown(report: &MachineReport) -> Vec<u64> {
    let mut times = vec![0; report.frames.len()];
    for refresh in &shown(report).refreshes {
        assert_eq!(refresh.parts.len(), 1);
        times[refresh.parts[0].1.frame as usize] += 1;
    }
    times
}

/// Cycles between the hand-overs of two frames, if frames wait for nothing.
fn pace(work: &[Event]) -> u64 {
    let report = run(&free(&["scanout.swap=immediate", "scanout.line_cycles=10000"]), work, Clock::SkipIdle);
    let cycles: Vec<u64> = report.frames.iter().skip(1).map(|frame| frame.cycles).collect();
    assert!(cycles.windows(2).all(|pair| pair[0] == pair[1]), "{cycles:?}");
    cycles[0]
}

#[test]
fn with_vsync_frames_of_t_cycles_are_shown_for_ceil_of_t_over_p_with_two_buffers_and_one_in_max_t_p_with_three() {
    let work = frames(25, 64 << 10);
    let t = pace(&work);
    assert!(t > 1000, "{t}");
    // Periods on both sides of T/3, T/2, T and 2 T, not so near that a few cycles from a swap to the next frame's first make a difference.
    for (numerator, denominator) in [(3, 10), (9, 20), (11, 20), (4, 5), (6, 5), (19, 10), (5, 2)] {
        let line = t * numerator / denominator / (LINES + BLANK);
        let p = line * (LINES + BLANK);
        let of = |buffers: u32| {
            let changes = [format!("scanout.line_cycles={line}"), format!("scanout.buffers={buffers}")];
            let report = run(&free(&[&changes[0], &changes[1], "scanout.swap=vsync"]), &work, Clock::SkipIdle);
            assert_eq!(report.total.number("display.tears"), Some(0.0));
            (times_shown(&report), report)
        };
        let (two, report) = of(2);
        // The first frame is shown before the second is begun; the last is shown once.
        assert_eq!(two[1..24], [t.div_ceil(p); 23], "T = {t}, P = {p}");
        assert_eq!(two[24], 1);
        // Each refresh reads the visible surface once.
        let refreshes = two.iter().sum::<u64>();
        assert_eq!(report.total.number("display.refreshes"), Some(refreshes as f64));
        assert_eq!(report.total.number("memory.clients.scanout.read_bytes"), Some((refreshes * LINES * ROW) as f64));
        // With three the frames come one in max(T, P): in T each if the display is faster, else one per refresh, once the buffers are full.
        let (three, report) = of(3);
        let (middle, from) = (&report.frames[20..24], report.frames[20..24].iter().map(|frame| frame.cycles).sum::<u64>());
        if t < p {
            assert_eq!((three[18..24].to_vec(), from), (vec![1; 6], 4 * p), "T = {t}, P = {p}");
        } else {
            assert!(middle.iter().all(|frame| frame.cycles.abs_diff(t) <= 8), "T = {t}, P = {p}: {from}");
            let (n, t, p) = (22.0, t as f64, p as f64);
            let mean = three[2..24].iter().sum::<u64>() as f64;
            assert!((mean - n * t / p).abs() <= 1.0 + n * 8.0 / p, "T = {t}, P = {p}: {three:?}");
        }
    }
}

#[test]
fn immediate_swaps_tear_at_the_line_of_their_cycle() {
    let work = frames(12, 64 << 10);
    let line = 90;
    let p = line * (LINES + BLANK);
    let report = run(&free(&[&format!("scanout.line_cycles={line}"), "scanout.swap=immediate"]), &work, Clock::SkipIdle);
    let all = shown(&report);
    // Frames are handed over in the last of their cycles, and the display hears of it in the next, which is the first of cycle counts from 0.
    let mut end = 0;
    let handed: Vec<u64> = report
        .frames
        .iter()
        .map(|frame| {
            end += frame.cycles;
            end
        })
        .collect();
    let origin = handed[0] + BLANK * line;
    let torn = handed[1..]
        .iter()
        .map(|at| at.wrapping_sub(origin))
        .filter(|t| *t < 1 << 40 && !t.is_multiple_of(p) && t % p / line < LINES);
    let torn: Vec<_> = torn.map(|t| (t / p, (t % p / line) as u32)).collect();
    assert!(torn.len() > 5, "{torn:?}");
    assert_eq!(all.tears, torn);
    // The picture: bytes of each frame are its number.
    for refresh in &all.refreshes {
        let (_, bytes) = refresh.picture();
        let parts = parts(refresh);
        for (y, row) in bytes.chunks_exact(ROW as usize).enumerate() {
            let frame = parts.iter().rev().find(|(line, _)| *line as usize <= y).expect("a part").1;
            assert!(row.iter().all(|&byte| u32::from(byte) == frame), "refresh {}, line {y}", refresh.number);
        }
    }
}

/// All that a run has shown, with all its bytes.
fn pictures(report: &MachineReport) -> String {
    let all = shown(report);
    let hash = |refresh: &Refresh| blake3::hash(&refresh.picture().1).to_hex().to_string();
    let refreshes: Vec<_> = all.refreshes.iter().map(|refresh| (parts(refresh), hash(refresh))).collect();
    format!("{refreshes:?} {:?} {:?}", all.tears, all.dry)
}

#[test]
fn clocks_and_orders_of_ticks_agree_and_frames_are_those_that_are_read_after_the_frame() {
    for class in SortClass::NAMES {
        let base = config(class, &[]);
        let covered = base.render_key().shade == Shade::Covered;
        let scene = Scene { width: 72, height: 56, triangles: 16, size: 40.0, frames: 3, covered, ..Scene::default() };
        let work = events(&scene);
        let after = run(&base, &work, Clock::SkipIdle);
        for swap in ["immediate", "vsync", "copy"] {
            for buffers in ["1", "2", "3"] {
                if (swap, buffers) == ("copy", "1") {
                    continue;
                }
                let changes =
                    ["scanout.mode=free-running", "scanout.line_cycles=40", "scanout.blank_lines=3", "scanout.fifo=1024"];
                let set = [format!("scanout.swap={swap}"), format!("scanout.buffers={buffers}")];
                let own = [&changes[..], &[&set[0], &set[1]]].concat();
                let config = config(class, &own);
                let report = run(&config, &work, Clock::SkipIdle);
                let what = format!("{class}, {swap}, {buffers} buffers");
                for (own, other) in report.frames.iter().zip(&after.frames) {
                    assert_eq!(own.picture, other.picture, "{what}");
                }
                let (statistics, display) = (everything(&report), pictures(&report));
                // The last refresh shows the last frame.
                let last = &report.shown.refreshes[report.shown.refreshes.len() - 1];
                let picture = after.frames[2].picture.as_ref().expect("a picture");
                assert!(last.picture().1 == picture.bytes, "{what}");
                let clocks: &[Clock] =
                    if *class == "sort-middle" { &[Clock::EveryCycle, Clock::Shuffled(7)] } else { &[Clock::Shuffled(7)] };
                for &clock in clocks {
                    let other = run(&config, &work, clock);
                    assert!(everything(&other) == statistics, "{what}: {clock:?}");
                    assert!(pictures(&other) == display, "{what}: {clock:?}");
                }
            }
        }
    }
}

#[test]
fn a_single_buffer_shows_what_is_being_drawn() {
    let work = events(&Scene { width: 64, height: 64, frames: 4, triangles: 200, ..Scene::default() });
    let of = |buffers: &str| {
        let buffers = format!("scanout.buffers={buffers}");
        run(&free(&["scanout.swap=immediate", "scanout.line_cycles=100", &buffers]), &work, Clock::SkipIdle)
    };
    let known: Vec<_> = of("2").frames.iter().filter_map(|frame| Some(frame.picture.as_ref()?.bytes.clone())).collect();
    // Between two frames the screen shows neither.
    let live = shown(&of("1")).refreshes.iter().filter(|refresh| !known.contains(&refresh.picture().1)).count();
    assert!(live > 0);
    let whole =
        shown(&of("2")).refreshes.iter().filter(|refresh| refresh.parts.len() == 1).all(|r| known.contains(&r.picture().1));
    assert!(whole);
}

#[test]
fn loading_what_was_presented_copies_and_is_counted() {
    let work = |load: bool| {
        let mut events =
            events(&Scene { width: 64, height: 64, frames: 3, triangles: 4, depth_format: None, ..Scene::default() });
        let mut contents = None;
        for event in events.iter_mut().filter(|_| load) {
            if let Event::BeginPass(pass) = event {
                let mut own = (**pass).clone();
                let target = own.color[0].as_mut().expect("a target");
                target.load = Load::Load;
                // The first frame loads it, too.
                contents = Some(Event::Contents(Contents { surface: target.surface, bytes: vec![0; 64 * 64 * 4].into() }));
                *pass = own.into();
            }
        }
        contents.into_iter().chain(events).collect::<Vec<_>>()
    };
    let of = |load, changes: &[&str]| {
        let tree = run(&free(changes), &work(load), Clock::SkipIdle).total;
        ["present_copies", "present_bytes"].map(|name| tree.number(&format!("command.{name}")).expect("a counter"))
    };
    let bytes = f64::from(64 * 64 * 4);
    // Nothing has been presented when the first frame loads it.
    assert_eq!(of(true, &["scanout.swap=vsync"]), [2.0, 2.0 * bytes]);
    assert_eq!(of(true, &["scanout.swap=immediate"]), [2.0, 2.0 * bytes]);
    assert_eq!(of(false, &["scanout.swap=vsync"]), [0.0, 0.0]);
    assert_eq!(of(true, &["scanout.swap=vsync", "scanout.buffers=1"]), [0.0, 0.0]);
    // Copies are shown, and the surface keeps its bytes.
    for load in [false, true] {
        assert_eq!(of(load, &["scanout.swap=copy"]), [3.0, 3.0 * bytes]);
    }
}

#[test]
fn a_display_beside_drawing_reads_at_its_rate_and_is_no_time_of_a_frame() {
    for class in SortClass::NAMES {
        let covered = config(class, &[]).render_key().shade == Shade::Covered;
        let scene = Scene { width: 72, height: 56, triangles: 120, size: 30.0, frames: 6, covered, ..Scene::default() };
        let work = events(&scene);
        let beside = ["scanout.mode=free-running", "scanout.swap=immediate", "scanout.show_last=false"];
        let beside = [&beside[..], &["scanout.line_cycles=40", "scanout.blank_lines=3"]].concat();
        let with = run(&config(class, &beside), &work, Clock::SkipIdle);
        let without = run(&config(class, &["scanout.enabled=false"]), &work, Clock::SkipIdle);
        let sum = |report: &MachineReport| report.frames.iter().map(|frame| frame.cycles).sum::<u64>();
        let (drawn, alone) = (sum(&with), sum(&without));
        assert!(drawn as f64 <= 1.05 * alone as f64, "{class}: {drawn} cycles beside a display, {alone} without");
        // The run ends with the last frame, which is over when what the display has asked for has come.
        assert_eq!(with.cycles, drawn, "{class}");
        // From the first frame on, to less than a refresh.
        let (bytes, period) = (56 * 288, (56 + 3) * 40);
        let read = with.total.number("memory.clients.scanout.read_bytes").expect("a counter");
        let due = (with.cycles - with.frames[0].cycles) as f64 / period as f64 * bytes as f64;
        assert!(due > 3.0 * bytes as f64, "{class}: {due} bytes are no stream");
        assert!((read - due).abs() < bytes as f64, "{class}: {read} bytes read, {due} by its rate");
    }
}

#[test]
fn a_machine_that_is_given_its_frames_in_parts_goes_on_as_if_it_had_all() {
    let cases: [(&[&str], &[&str]); 2] = [
        (&["sort-middle", "sort-middle-binned", "sort-last-image"], &["scanout.mode=after-frame"]),
        (SortClass::NAMES, &["scanout.mode=free-running", "scanout.show_last=false", "scanout.line_cycles=40"]),
    ];
    for (classes, changes) in cases {
        for class in classes {
            let config = config(class, changes);
            let covered = config.render_key().shade == Shade::Covered;
            let scene = Scene { width: 72, height: 56, triangles: 40, size: 30.0, frames: 4, covered, ..Scene::default() };
            let work = events(&scene);
            let whole = run(&config, &work, Clock::SkipIdle);
            let mut machine = Machine::new(&config).expect("knobs that fit");
            machine.watch_draws();
            let parts: Vec<&[Event]> = work.split_inclusive(|event| matches!(event, Event::EndFrame(_))).collect();
            for (number, part) in parts.iter().enumerate() {
                let follow = (number + 1 < parts.len()).then_some(Event::FramesFollow);
                let report = machine.run(part.iter().cloned().chain(follow), Clock::SkipIdle).expect("a frame");
                let (own, all) = (&report.frames[0], &whole.frames[number]);
                let what = format!("{class}, {changes:?}: frame {number}");
                assert_eq!((report.frames.len(), report.cycles, own.cycles), (1, own.cycles, all.cycles), "{what}");
                assert!(own.tree.json() == all.tree.json(), "{what}: statistics");
                assert!(own.picture == all.picture, "{what}: picture");
            }
        }
    }
}

#[test]
fn estimates_and_samples_know_a_display_beside_drawing() {
    let trace = Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/flight.zip")).expect("a trace");
    let of = |fidelity, changes: &[&str]| {
        let mut config = Config::built_in("baseline").expect("built in");
        changes.iter().for_each(|change| config.set(change).expect("a knob"));
        let options = Options { frames: 0..12, ..Options::new(config, fidelity) };
        let total = replay(&trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{changes:?}: {error}")).total;
        ["cycles", "memory.dram.read_bytes"].map(|path| total.number(path).expect("a number"))
    };
    // 1,280 bytes in 200 cycles: some of the bandwidth, which is what the estimate adds.
    let fast: &[&str] = &["scanout.mode=free-running", "scanout.line_cycles=200"];
    let none: &[&str] = &["scanout.enabled=false"];
    let [cycles, _] = of(Fidelity::Cycle, fast);
    let [[bound, read], [_, before]] = [fast, none].map(|changes| of(Fidelity::Bound, changes));
    assert!((bound / cycles - 1.0).abs() < 0.2, "{bound} cycles by estimate, {cycles} simulated");
    let own = |fidelity| {
        let [with, without] = [fast, none].map(|changes| of(fidelity, changes)[1]);
        with - without
    };
    let (estimated, simulated) = (read - before, own(Fidelity::Cycle));
    assert!(simulated > 100_000.0 && (estimated / simulated - 1.0).abs() < 0.25, "{estimated} bytes, {simulated} simulated");
    let [sampled, _] = of(Fidelity::Sampled(Sampling { samples: 4, ..Sampling::default() }), fast);
    assert!((sampled / cycles - 1.0).abs() < 0.05, "{sampled} cycles by sample, {cycles} simulated");
}

#[test]
fn a_window_that_changes_its_size_changes_the_mode() {
    let mut work = frames(3, 256);
    for event in &mut work {
        if let Event::EndFrame(end) = event
            && end.number == 1
            && let Some(surface) = &mut end.shown
        {
            surface.width = 32;
            end.reference = vec![1; (LINES * ROW / 2) as usize].into();
        }
    }
    for class in SortClass::NAMES {
        let mut config = config(class, &["memory.kind=ideal", "scanout.mode=free-running", "scanout.swap=vsync"]);
        config.set("scanout.show_last=true").expect("a knob");
        config.set("scanout.line_cycles=100").expect("a knob");
        let report = run(&config, &work, Clock::SkipIdle);
        assert_eq!(report.total.number("display.modes"), Some(2.0), "{class}");
        let pictures: Vec<_> = shown(&report).refreshes.iter().map(Refresh::picture).collect();
        let mut sizes: Vec<_> = pictures.iter().map(|(surface, bytes)| (surface.width, bytes.len() as u64, bytes[0])).collect();
        sizes.dedup();
        assert_eq!(sizes, [(64, LINES * ROW, 0), (32, LINES * ROW / 2, 1), (64, LINES * ROW, 2)], "{class}");
    }
}

#[test]
fn what_cannot_be_shown_is_refused_by_name_and_place() {
    let stopped = |config: &Config, work: &[Event]| {
        let mut machine = Machine::new(config).expect("a machine");
        machine.run(work.iter().cloned(), Clock::SkipIdle).expect_err("it cannot be shown").to_string()
    };
    let fast = free(&["scanout.line_cycles=3", "memory.port_width=32"]);
    assert_eq!(
        stopped(&fast, &frames(1, 256)),
        "frame 0 cannot be shown: a line has 256 bytes, and in 3 cycles (scanout.line_cycles) memory brings at most 96: no FIFO \
         serves that; use 8 cycles or more"
    );
    let rule = |changes: &[&str]| {
        let mut config = Config::built_in("four-pipelines").expect("built in");
        changes.iter().for_each(|change| config.set(change).expect("a knob"));
        config.check().expect_err("a rule").to_string()
    };
    let error = rule(&["scanout.mode=free-running", "scanout.swap=copy", "scanout.buffers=1"]);
    assert!(error.contains("scanout.buffers is 1, and must be at least 2"), "{error}");

    let trace = Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/cube")).expect("a trace");
    let refused = |fidelity, changes: &[&str]| {
        let options = Options::new(free(changes), fidelity);
        replay(&trace, &options, &|_| ()).map(|_| ()).expect_err("not known").to_string()
    };
    for changes in [&[][..], &["scanout.swap=immediate"]] {
        let error = refused(Fidelity::Sampled(Sampling::default()), changes);
        assert!(error.contains("scanout.mode=\"free-running\"") && error.contains("use cycle"), "{error}");
    }
    for (changes, knob) in [(&[][..], "scanout.show_last is true"), (&["scanout.show_last=false"], "scanout.swap is")] {
        let error = refused(Fidelity::Bound, changes);
        assert!(error.contains(knob) && error.contains("use --fidelity cycle"), "{error}");
    }
}
