//! Two builds of the program, compared by what their replays leave.

use assert_cmd::cargo::cargo_bin;

use super::cli::{refused, run};

/// Compares short replays. Returns the exit code and the standard output.
fn compare(other: &str) -> (i32, String) {
    let (code, text, message) = run(&[
        "accuracy",
        "builds",
        other,
        "traces/triangle",
        "--config",
        "tiny,sort-middle",
        "--fidelity",
        "functional,cycle",
    ]);
    assert_eq!(message, "");
    (code, text)
}

#[test]
fn the_program_replays_as_it_does_itself() {
    let this = cargo_bin!("fillrate").display().to_string();
    let (code, text) = compare(&this);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("traces/triangle tiny cycle: 7 files are equal\n"), "{text}");
    assert!(text.ends_with("4 of 4 replays are equal\n"), "{text}");
    // Both refuse an input alike.
    let (code, text, _) = run(&["accuracy", "builds", &this, "traces/nothing", "--config", "tiny", "--fidelity", "functional"]);
    assert_eq!(code, 0, "{text}");
    assert!(text.contains("traces/nothing tiny functional: both end with exit status: 2\n"), "{text}");
    assert!(refused(&["accuracy", "builds", "no-such-program", "traces/triangle"]).contains("no-such-program"));
}

/// The other program is a script that makes ports to memory slower.
#[cfg(unix)]
#[test]
fn a_program_that_differs_is_told_apart_by_the_first_differences() {
    use std::os::unix::fs::PermissionsExt;

    let home = tempfile::tempdir().expect("a folder");
    let other = home.path().join("other");
    let this = cargo_bin!("fillrate").display().to_string();
    std::fs::write(&other, format!("#!/bin/sh\nexec '{this}' \"$@\" --set memory.port_latency=99\n")).expect("written");
    std::fs::set_permissions(&other, std::fs::Permissions::from_mode(0o755)).expect("a program");
    let (code, text) = compare(&other.display().to_string());
    assert_eq!(code, 1, "{text}");
    // The configuration is another everywhere, cycles are others where they are simulated, and no picture is.
    assert!(text.contains("traces/triangle tiny functional: 3 differ\n"), "{text}");
    for file in ["config.ron, line ", "stats.json, line ", "stats.csv, line ", "passes.csv, line ", "report.txt, line "] {
        assert!(text.contains(&format!("  {file}")), "{file}: {text}");
    }
    assert!(text.contains("port_latency") && !text.contains(".png"), "{text}");
    assert!(text.ends_with("0 of 4 replays are equal\n"), "{text}");
}
