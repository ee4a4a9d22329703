//! Counters of ATTILA beside ours, for its recordings. They are not part of the repository: `FILLRATE_PEERS` names the folder that holds `attila/`.

use std::path::Path;

use fillrate::accuracy::attila::{cases, geometric_mean, machine, mechanisms};

/// Counters that do not agree yet, and for which recordings. `docs/data/attila.md` says why.
const MISSES: &[(&str, &[&str])] = &[("upload bytes", &["micropolygon", "triangle"])];

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

#[test]
fn a_mechanism_that_is_taken_away_moves_counters() {
    let Some(peers) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS names no folder with the recordings of ATTILA");
        return;
    };
    let mut cases = cases(&Path::new(&peers).join("attila")).expect("recordings with counters");
    cases.retain(|case| case.name == "simplefog");
    let table = mechanisms(&cases, &machine().expect("the built-in configuration")).expect("the recordings replay");
    let rows: Vec<Vec<&str>> = table.lines().skip(2).map(|row| row.split('|').map(str::trim).collect()).collect();
    assert_eq!(rows[0][1..4], ["nothing", "", ""], "{table}");
    let row = |set: &str| rows.iter().find(|row| row[1].starts_with(set)).unwrap_or_else(|| panic!("{set}: {table}"));
    assert!(row("`core.instructions=scalar`")[3].starts_with("`simplefog`: cycles of drawing +"), "{table}");
    assert!(row("`depth.pass_end=write-back`")[2].starts_with("`simplefog`: depth bytes +"), "{table}");
}
