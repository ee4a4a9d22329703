//! Estimates against the cycles that they stand for.

use std::path::Path;

use fillrate::machine::Config;
use fillrate::run::replay::{Fidelity, Options, Replay, replay};
use fillrate::sim::Clock;
use fillrate::trace::Trace;

fn run(trace: &str, fidelity: Fidelity, changes: &[&str]) -> Replay {
    let trace =
        Trace::open(&Path::new(env!("CARGO_MANIFEST_DIR")).join("traces").join(trace)).expect("a trace of the repository");
    let mut config = Config::built_in("baseline").expect("it is built in");
    for change in changes {
        config.set(change).expect("a knob");
    }
    let options = Options { config, fidelity, clock: Clock::SkipIdle, frames: 0..u32::MAX };
    replay(&trace, &options, &|_| ()).expect("a replay")
}

fn cycles(replay: &Replay) -> f64 {
    replay.total.number("cycles").expect("cycles")
}

#[test]
fn bounds_are_near_the_cycles_that_they_stand_for() {
    // `docs/accuracy.md` has all scenes, those with larger errors and why.
    for (trace, allowed) in [("cube", 0.08), ("corridor", 0.05), ("layers", 0.08), ("sprites", 0.05), ("triangle", 0.05)] {
        let (bound, cycle) = (run(trace, Fidelity::Bound, &[]), run(trace, Fidelity::Cycle, &[]));
        let error = cycles(&bound) / cycles(&cycle) - 1.0;
        assert!(error.abs() < allowed, "{trace}: {} for {}", cycles(&bound), cycles(&cycle));
        for (bound, cycle) in bound.frames.iter().zip(&cycle.frames) {
            let kinds = |phases: &[(fillrate::unit::phase::Phase, u64)]| phases.iter().map(|p| p.0.kind).collect::<Vec<_>>();
            assert_eq!(kinds(&bound.phases), kinds(&cycle.phases), "{trace}");
            assert_eq!(bound.shown, cycle.shown, "{trace}: the picture is that of the trace");
        }
    }
}

#[test]
fn a_bound_moves_with_the_unit_that_bounds_and_with_no_other() {
    let base = cycles(&run("corridor", Fidelity::Bound, &[]));
    let with = |change: &str| cycles(&run("corridor", Fidelity::Bound, &[change]));
    let limit = |replay: &Replay| replay.frames[0].phases.iter().map(|p| p.0.limit).collect::<Vec<_>>();
    assert!(limit(&run("corridor", Fidelity::Bound, &[])).contains(&"core"));
    // Half the rate of issue takes twice the pass; twice the triangles a cycle takes nothing off.
    assert!(with("core.issue=2") > 1.6 * base);
    assert!((with("setup.triangles_per_cycle=2") / base - 1.0).abs() < 0.01);
    assert!(with("pipelines=8") < 0.75 * base);
}

#[test]
fn a_class_whose_rates_are_not_known_is_refused() {
    let trace = Trace::open(&Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/triangle")).expect("a trace");
    let config = Config::built_in("sort-first").expect("it is built in");
    let options = Options { config, fidelity: Fidelity::Bound, clock: Clock::SkipIdle, frames: 0..1 };
    let error = replay(&trace, &options, &|_| ()).expect_err("not known").to_string();
    assert!(error.contains("sort-first") && error.contains("cycle"), "{error}");
}
