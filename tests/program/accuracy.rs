//! Every target of the accuracy suite at its small size: it holds, and with its fault it does not.

use fillrate::accuracy::{self, Setting, Size, Target};

use super::cli::{refused, run};

fn small(target: &'static Target, inject_fault: bool) -> accuracy::TargetResult {
    let setting = Setting { seed: 1, size: Size::Small, inject_fault };
    target.run(&setting).unwrap_or_else(|error| panic!("{}: {error:#}", target.id))
}

#[test]
fn every_target_holds() {
    for target in accuracy::targets() {
        let outcome = small(target, false);
        assert!(outcome.holds(), "\n{}{}", accuracy::header(), accuracy::lines(&outcome));
    }
}

#[test]
fn no_target_holds_with_its_fault() {
    for target in accuracy::targets() {
        let outcome = small(target, true);
        assert!(!outcome.holds(), "{} was not found\n{}{}", target.fault, accuracy::header(), accuracy::lines(&outcome));
    }
}

#[test]
fn an_unknown_target_is_named_with_the_nearest() {
    let error = accuracy::find("fil-rule").unwrap_err().to_string();
    assert_eq!(error, "there is no target fil-rule; fill-rules is the nearest, and --list names all");
}

#[test]
fn the_first_word_of_names_means_all_of_them() {
    let group: Vec<&str> = accuracy::find_all("gl").expect("targets").iter().map(|target| target.id).collect();
    assert_eq!(group, ["gl-light", "gl-environment", "gl-combine", "gl-generation", "gl-fog", "gl-blend"]);
    assert_eq!(accuracy::find_all("harmonic").expect("a target").len(), 1);
    assert!(accuracy::find_all("g").is_err());
}

#[test]
fn the_page_has_every_target_and_no_failure() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/data/accuracy.md");
    let page = std::fs::read_to_string(path).expect("the page is there");
    let page = page.split_whitespace().collect::<Vec<_>>().join(" ");
    for target in accuracy::targets() {
        let about = [target.id, target.what, target.bound, target.fault].map(|text| text.replace('|', "\\|")).join(" | ");
        assert!(
            page.contains(&about),
            "{} is not in docs/data/accuracy.md as it is now: docs/README.md says how to write it anew",
            target.id
        );
    }
    assert!(!page.contains("**fail**"));
}

#[test]
fn runs_of_frames_are_compared_with_one_machine() {
    let (code, table, message) = run(&["accuracy", "runs", "--frames", "6", "--frames-per-run", "2"]);
    assert_eq!(code, 0, "{message}");
    let rows: Vec<Vec<&str>> =
        table.lines().skip(2).map(|row| row.split('|').map(str::trim).filter(|cell| !cell.is_empty()).collect()).collect();
    assert_eq!(rows.len(), 3, "{table}");
    for row in rows {
        let off: f64 = row[3].trim_end_matches(" %").parse().expect("a share of the cycles");
        assert!(row[1] == "6" && off.abs() < 2.0 && row.last() == Some(&"0"), "{row:?}");
    }
    assert!(refused(&["accuracy", "runs", "--frames", "3"]).contains("one run has 4"));

    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().display().to_string();
    let (code, _, message) = run(&["accuracy", "runs", "--frames", "2", "--record", &folder]);
    assert_eq!(code, 0, "{message}");
    for name in ["interface", "swarm", "shadow-once"] {
        let trace = out.path().join(format!("{name}.zip")).display().to_string();
        let (code, report, message) = run(&["replay", &trace, "--fidelity", "functional"]);
        assert!(code == 0 && report.contains("2 frames"), "{name}: {report}{message}");
    }
}
