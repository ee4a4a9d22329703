//! Runs of frames on machines of their own, against one machine that simulates all frames.

use std::num::NonZeroU32;
use std::path::Path;

use crate::common::{entries, is_chosen};
use fillrate::accuracy::runs::one_run;
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
    changed("four-pipelines", changes)
}

fn changed(name: &str, changes: &[&str]) -> Config {
    let mut config = Config::built_in(name).expect("it is built in");
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

/// One run of the first frames is what one machine makes of them.
fn one_run_of(path: &Path, changes: &[&str], frames: u32) {
    let name = path.display().to_string();
    let trace = import::open(path).unwrap_or_else(|error| panic!("{name}: {error}"));
    let options = Options { frames: 0..frames, ..Options::new(card(changes), Fidelity::Cycle) };
    let compared = one_run(&name, &trace, &options).unwrap_or_else(|error| panic!("{name}: {error:#}"));
    assert!(compared.equal(), "{changes:?}: {compared:?}");
}

// `fillrate accuracy runs --one-run` compares whole sequences.
#[test]
fn one_run_is_one_machine() {
    let traces = Path::new(env!("CARGO_MANIFEST_DIR")).join("traces");
    let chosen = entries(&traces).into_iter().enumerate().filter(|(at, _)| is_chosen(2, &[*at]));
    chosen.for_each(|(_, path)| one_run_of(&path, &[], 4));
    for class in ["sort=sort-first", "sort=sort-last-fragment"] {
        one_run_of(&traces.join("particles"), &[class], 4);
    }
}

/// Some of the recorded traces, which are soon done: compute, shadows, samples, stencil; fixed functions, textures that are copied from what was
/// drawn, accumulation; indexed lists.
#[test]
fn one_run_is_one_machine_on_recorded_traces() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        return eprintln!("left out: FILLRATE_PEERS is not set");
    };
    let chosen = [
        ("wgpu", &["particles", "msaa-thin", "stencil-mirror", "skybox-knot"][..]),
        ("gl", &["glxgears", "rss-feedback", "lavalite", "timetunnel", "engine"]),
        ("attila", &["simplefog", "spaceship"]),
    ];
    for (kind, names) in chosen {
        let chosen = names.iter().enumerate().filter(|(at, _)| is_chosen(2, &[*at]));
        chosen.for_each(|(_, name)| one_run_of(&Path::new(&root).join(kind).join(name), &[], 2));
    }
}

#[test]
fn runs_show_the_same_pictures_and_take_nearly_the_same_cycles() {
    // The display of the baseline runs beside drawing.
    for (name, base, frames, frames_per_run, allowed) in [
        ("particles", "four-pipelines", 4, 1, 3e-3),
        ("flight.zip", "four-pipelines", 12, 3, 4e-3),
        ("flight.zip", "baseline", 32, 4, 3e-3),
    ] {
        // What a class carries over is the same for a long sequence.
        let classes: [&[&str]; 3] = [&[], &["sort=sort-first"], &["sort=sort-last-fragment"]];
        for changes in classes.into_iter().take(if frames > 4 { 1 } else { 3 }) {
            let (trace, config) = (open(name), changed(base, changes));
            let (one, all) = simulated(&trace, &config, frames, None);
            let (runs, sum) = simulated(&trace, &config, frames, Some(frames_per_run));
            assert_eq!(one.len(), runs.len());
            for (one, run) in one.iter().zip(&runs) {
                assert!(one.number == run.number && one.shown == run.shown, "{changes:?}: frame {}", one.number);
            }
            let cycles: f64 = runs.iter().map(|frame| frame.tree.number("cycles").expect("cycles")).sum();
            assert_eq!(cycles, sum.cycles as f64);
            let off = sum.cycles as f64 / all.cycles as f64 - 1.0;
            assert!(off.abs() < allowed, "{name}, {base}, {changes:?}: {} cycles in runs, {} in all", sum.cycles, all.cycles);
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
