//! Runs of frames on machines of their own, against one machine that simulates all frames.

use std::num::NonZeroU32;
use std::path::Path;

use crate::common::entries;
use fillrate::import;
use fillrate::machine::Config;
use fillrate::run::cycle::{Simulated, simulate};
use fillrate::run::frame_runs::simulate_in_runs;
use fillrate::run::frame_sink::{Frame, FrameSink};
use fillrate::run::replay::{Fidelity, Options, replay};
use fillrate::sim::Clock;
use fillrate::trace::Trace;

fn open(trace: &str) -> Trace {
    Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces").join(trace)).expect("a trace of the repository")
}

fn card(changes: &[&str]) -> Config {
    let mut config = Config::built_in("baseline").expect("it is built in");
    changes.iter().for_each(|change| config.set(change).expect("a knob"));
    config
}

/// Frames and totals on one machine, or in runs of this number of frames.
fn simulated(trace: &Trace, config: &Config, frames: u32, frames_per_run: Option<u32>) -> (Vec<Frame>, Simulated) {
    let (mut taken, mut out) = (Vec::new(), Simulated::default());
    let options = Options { frames: 0..frames, ..Options::new(config.clone(), Fidelity::Cycle) };
    let mut rendering = options.rendering(trace);
    let sink = FrameSink::new(|frame| {
        taken.push(frame);
        Ok(())
    });
    match frames_per_run {
        None => simulate(&mut rendering, (config, Clock::SkipIdle), sink, &mut out),
        Some(frames) => simulate_in_runs(&mut rendering, (config, Clock::SkipIdle), frames, sink, &mut out),
    }
    .expect("knobs that fit");
    rendering.run().expect("a replay");
    (taken, out)
}

/// One run of all frames is what one machine makes of them.
fn one_run(name: &str, trace: &Trace, changes: &[&str], frames: u32) {
    let config = card(changes);
    let (one, in_all) = simulated(trace, &config, frames, None);
    let (run, sum) = simulated(trace, &config, frames, Some(1000));
    assert_eq!((in_all.cycles, &in_all.total), (sum.cycles, &sum.total), "{name}, {changes:?}");
    assert!(!one.is_empty() && one.len() == run.len(), "{name}");
    for (one, run) in one.iter().zip(&run) {
        assert_eq!((one.number, &one.tree, &one.shown), (run.number, &run.tree, &run.shown), "{name}, {changes:?}");
    }
}

#[test]
fn one_run_is_one_machine() {
    let machines: [(&str, &[&str]); 9] = [
        ("triangle", &[]),
        ("cube", &[]),
        ("sprites", &[]),
        ("particles", &[]),
        ("spokes-msaa", &[]),
        ("panel.zip", &[]),
        ("viewer.zip", &[]),
        ("particles", &["sort=sort-first"]),
        ("particles", &["sort=sort-last-fragment"]),
    ];
    for (name, changes) in machines {
        one_run(name, &open(name), changes, u32::MAX);
    }
}

#[test]
fn one_run_is_one_machine_on_all_traces() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        return eprintln!("left out: FILLRATE_PEERS is not set: `one_run_is_one_machine` has some of the traces");
    };
    let own = entries(&Path::new(env!("CARGO_MANIFEST_DIR")).join("traces"));
    let recorded = ["wgpu", "gl", "attila"].into_iter().flat_map(|kind| entries(&Path::new(&root).join(kind)));
    let mut compared = 0;
    for path in own.into_iter().chain(recorded.filter(|path| path.is_dir())) {
        let name = path.display().to_string();
        let Ok(trace) = import::open(&path) else {
            eprintln!("left out: {name} is no trace that is supported");
            continue;
        };
        // Of long sequences, the first frames.
        one_run(&name, &trace, &[], 2);
        compared += 1;
    }
    eprintln!("{compared} traces compared");
    assert!(compared > 30);
}

#[test]
fn runs_show_the_same_pictures_and_take_nearly_the_same_cycles() {
    for (name, frames, frames_per_run, allowed) in [("particles", 4, 1, 3e-3), ("flight.zip", 12, 3, 2e-3)] {
        // What a class carries over is the same for a long sequence.
        let classes: [&[&str]; 3] = [&[], &["sort=sort-first"], &["sort=sort-last-fragment"]];
        for changes in classes.into_iter().take(if frames > 4 { 1 } else { 3 }) {
            let (trace, config) = (open(name), card(changes));
            let (one, all) = simulated(&trace, &config, frames, None);
            let (runs, sum) = simulated(&trace, &config, frames, Some(frames_per_run));
            assert_eq!(one.len(), runs.len());
            for (one, run) in one.iter().zip(&runs) {
                assert!(one.number == run.number && one.shown == run.shown, "{changes:?}: frame {}", one.number);
            }
            let cycles: f64 = runs.iter().map(|frame| frame.tree.number("cycles").expect("cycles")).sum();
            assert_eq!(cycles, sum.cycles as f64);
            let off = sum.cycles as f64 / all.cycles as f64 - 1.0;
            assert!(off.abs() < allowed, "{name}, {changes:?}: {} cycles in runs, {} in all", sum.cycles, all.cycles);
        }
    }
}

#[test]
fn cards_whose_frames_need_all_before_them_refuse() {
    let trace = open("particles");
    for (change, why) in [
        ("sort=sort-middle-binned", "functional warming"),
        ("sort=sort-last-image", "functional warming"),
        ("scanout.mode=free-running", "free-running"),
    ] {
        let options = Options { frames_per_run: NonZeroU32::new(1), ..Options::new(card(&[change]), Fidelity::Cycle) };
        let error = replay(&trace, &options, &|_| ()).expect_err("a refusal").to_string();
        assert!(error.contains("in runs") && error.contains(why), "{change}: {error}");
    }
}

#[test]
fn a_taker_that_fails_ends_all_runs() {
    let (trace, config) = (open("flight.zip"), card(&[]));
    let mut out = Simulated::default();
    let mut taken = Vec::new();
    let sink = FrameSink::new(|frame: Frame| {
        taken.push(frame.number);
        if frame.number == 4 { anyhow::bail!("the disk is full") } else { Ok(()) }
    });
    let options = Options { frames: 0..40, ..Options::new(config.clone(), Fidelity::Cycle) };
    let mut rendering = options.rendering(&trace);
    simulate_in_runs(&mut rendering, (&config, Clock::SkipIdle), 2, sink, &mut out).expect("knobs that fit");
    assert_eq!(rendering.run().expect_err("it fails").to_string(), "the disk is full");
    assert_eq!(taken, [0, 1, 2, 3, 4]);
}
