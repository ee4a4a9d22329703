//! What a scene does not need is skipped, and nothing else changes.

use std::path::Path;
use std::time::Duration;

use fillrate::accuracy::skips::{SKIPS, Saving, Turns, savings};
use fillrate::machine::Config;
use fillrate::trace::Trace;

fn all(trace: &str) -> Vec<Saving> {
    let trace =
        Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces").join(trace)).expect("a trace of the repository");
    let turns = Turns { least: 1, time: Duration::ZERO };
    savings(&trace, &Config::built_in("baseline").expect("it is built in"), turns).expect("all run")
}

#[test]
fn skips_change_no_picture_and_save_work() {
    // One after the other: a replay on a thread of the pool waits for its renderer, which needs threads of the pool.
    let scenes = ["cube", "layers", "panel.zip", "viewer.zip", "town.zip"];
    let found: Vec<Vec<Saving>> = scenes.into_iter().map(all).collect();
    for saving in found.iter().flatten() {
        assert_eq!(saving.differs, None, "{}", saving.skip.name);
    }
    for (at, skip) in SKIPS.iter().enumerate() {
        let saves = |saving: &Saving| saving.work.is_some_and(|[on, off]| on < off);
        // What only the host saves is not counted in work.
        if found[0][at].work.is_some() {
            assert!(found.iter().any(|savings| saves(&savings[at])), "{} saves nothing", skip.name);
        }
    }
}
