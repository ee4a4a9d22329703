//! Generated pages and drawings are up to date, and explain every statistic of a replay.

use std::fs;
use std::path::Path;

use fillrate::machine::config::SortClass;
use fillrate::machine::{Config, Machine};
use fillrate::report::diagram::Diagram;
use fillrate::report::{limits, pages};
use fillrate::run::bound::STATED_ERRORS;
use fillrate::run::replay::{Fidelity, Options, replay};
use fillrate::trace::Trace;

fn check(name: &str, expected: &str) {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs").join(name);
    if std::env::var_os("FILLRATE_BLESS").is_some() {
        fs::write(&path, expected).expect("the page can be written");
    }
    let text = fs::read_to_string(&path).unwrap_or_default();
    assert!(text == expected, "docs/{name} is stale: FILLRATE_BLESS=1 cargo test --test program pages writes it anew");
}

#[test]
fn statistics_page_is_up_to_date() {
    check("data/statistics.md", &pages::statistics());
}

#[test]
fn configuration_page_is_up_to_date() {
    check("data/configuration.md", &pages::configuration().expect("the baseline is sound"));
}

#[test]
fn area_page_is_up_to_date() {
    check("data/area.md", &fillrate::sweep::area::page().expect("the baseline is sound"));
}

#[test]
fn limits_page_is_up_to_date() {
    check("data/limits.md", &limits::page());
}

#[test]
fn drawings_are_up_to_date() {
    for class in SortClass::NAMES {
        let config = Config::built_in(class).expect("built in");
        let machine = Machine::new(&config).expect("a sound configuration");
        check(&format!("{class}.svg"), &Diagram::new(&machine).svg());
    }
}

#[test]
fn every_statistic_of_a_replay_is_explained() {
    let trace = Trace::open(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/triangle")).expect("the trace is there");
    let glossary = pages::Glossary::default();
    let classes = SortClass::NAMES.iter().map(|class| ("baseline", Some(format!("sort={class}"))));
    for (config, class) in [("tiny", None), ("baseline", None)].into_iter().chain(classes) {
        let mut machine = Config::built_in(config).expect("built in");
        if let Some(class) = &class {
            let early = if class.ends_with("fragment") { "order.early=local" } else { "order.early=none" };
            for change in [class.as_str(), early, "bin.hide=true", "network.topology=crossbar"] {
                machine.set(change).expect("a knob");
            }
        }
        let options = Options::new(machine, Fidelity::Cycle);
        let done = replay(&trace, &options, &|_| ()).expect("the replay runs");
        let mut unexplained = Vec::new();
        let mut seen = 0;
        done.total.leaves(&mut |path, _| {
            seen += 1;
            if glossary.find(path).is_none() {
                unexplained.push(path.to_owned());
            }
        });
        assert!(seen > 200, "{seen} statistics");
        assert!(unexplained.is_empty(), "{config} {class:?}: not in docs/data/statistics.md: {unexplained:#?}");
    }
    for unknown in ["units.setup[0].nonsense", "setup[0].busy", "setup.busy"] {
        assert_eq!(glossary.find(unknown), None);
    }
    // Of summed banks, too.
    assert_eq!(glossary.find("units.setup.busy").map(|of| of.unit), Some("cycles"));
}

/// The errors of estimates that the terminal states are those of the page of errors, on generated scenes.
#[test]
fn stated_errors_of_estimates_are_those_of_the_page() {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/data/fidelity.md");
    let page = fs::read_to_string(page).expect("the page is there");
    let table = page.split("## Generated scenes").nth(1).expect("a section of generated scenes");
    // | all | median | nine of ten within | largest | ...
    let all = table.lines().find(|line| line.starts_with("| all |")).expect("a row of all classes");
    let errors =
        all.split('|').skip(2).take(2).map(|cell| cell.trim().trim_end_matches(" %").parse::<f64>().expect("a percentage"));
    for (error, stated) in errors.zip(STATED_ERRORS) {
        assert!(error <= f64::from(stated) && error > f64::from(stated) - 2.0, "{error} %, stated as {stated} %");
    }
}
