//! Counters of ATTILA beside ours, for its recordings. They are not part of the repository: `FILLRATE_PEERS` names the folder that holds `attila/`.

use std::path::Path;

use fillrate::accuracy::attila::{cases, geometric_mean, machine};

/// Counters that do not agree yet, and for which recordings. `docs/data/attila.md` says why.
const MISSES: &[(&str, &[&str])] = &[("upload bytes", &["micropolygon", "triangle"]), ("vertex bytes", &["micropolygon"])];

#[test]
fn counters_of_another_simulator_hold_but_for_those_listed() {
    let Some(peers) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS names no folder with the recordings of ATTILA");
        return;
    };
    let cases = cases(&Path::new(&peers).join("attila")).expect("recordings with counters");
    let machine = machine().expect("the built-in configuration");
    let outcomes: Vec<_> =
        cases.iter().map(|case| case.run(&machine).unwrap_or_else(|error| panic!("{}: {error:#}", case.name))).collect();
    for outcome in &outcomes {
        let misses = |what: &str| MISSES.iter().any(|(row, of)| *row == what && of.contains(&outcome.name.as_str()));
        for row in outcome.rows.iter().filter(|row| !row.holds()) {
            assert!(misses(row.what), "{}: {}: {} here, {} there", outcome.name, row.what, row.ours, row.theirs);
        }
        let held = outcome.rows.iter().filter(|row| row.holds() && misses(row.what)).map(|row| row.what).collect::<Vec<_>>();
        assert!(held.is_empty(), "{}: no longer missed, to be taken off the list: {held:?}", outcome.name);
    }
    let mean = geometric_mean(outcomes.iter().map(|outcome| outcome.ratio()));
    assert!((0.9..=1.1).contains(&mean), "geometric mean of the cycles of drawing: {mean}");
}
