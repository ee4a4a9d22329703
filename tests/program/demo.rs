//! What is built in works in any folder: scenes, experiments, and parts of a report by their names.

use std::fs;
use std::path::Path;

use assert_cmd::Command;
use fillrate::scenes;
use fillrate::sweep::experiment;

use crate::cli;

/// Runs the program in a folder. Returns its exit code, standard output and standard error.
fn run_in(folder: &Path, arguments: &[&str]) -> (i32, String, String) {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("fillrate"));
    let output = command.current_dir(folder).args(arguments).output().expect("the program starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

#[test]
fn a_demonstration_leaves_picture_and_page_in_any_folder() {
    let home = tempfile::tempdir().expect("a folder");
    let (code, list, _) = run_in(home.path(), &["demo"]);
    let (_, same, _) = run_in(home.path(), &["demo", "--list"]);
    assert!(code == 0 && list == same, "{list}");
    let names = scenes::ALL.iter().map(|scene| scene.name).chain(experiment::BUILT_IN.iter().map(|own| own.name));
    for name in names {
        assert!(list.lines().any(|line| line.starts_with(&format!("  {name} "))), "no {name} in {list}");
    }

    let (code, text, message) = run_in(home.path(), &["demo", "triangle", "--config", "tiny"]);
    assert_eq!(code, 0, "{message}");
    let command = "fillrate replay @triangle --config tiny --out demo-triangle --report demo-triangle/report.html";
    assert!(text.contains("@triangle on tiny: 1 frame") && text.contains(command), "{text}");
    let read = |name: &str| fs::read(home.path().join(name)).expect("a file");
    assert!(String::from_utf8_lossy(&read("demo-triangle/report.html")).contains("Heat maps"), "a page of the trace");
    // The scene is the file that is kept, to the byte of what a replay leaves.
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/triangle").display().to_string();
    let (code, _, message) = run_in(home.path(), &["replay", &kept, "--config", "tiny", "--out", "kept"]);
    assert_eq!(code, 0, "{message}");
    for name in ["frame-0000.png", "stats.csv", "passes.csv"] {
        assert!(read(&format!("demo-triangle/{name}")) == read(&format!("kept/{name}")), "{name}");
    }
    // A page is made again from the name alone.
    let (code, _, message) = run_in(home.path(), &["report", "demo-triangle"]);
    assert!(code == 0 && message.is_empty(), "{message}");
}

#[test]
fn names_of_scenes_stand_for_traces() {
    let home = tempfile::tempdir().expect("a folder");
    let (code, text, message) = run_in(home.path(), &["inspect", "@cube"]);
    assert!(code == 0 && text.starts_with("@cube: native trace"), "{message}");
    let (code, text, message) = run_in(home.path(), &["why", "@triangle", "--config", "tiny", "--rows", "1"]);
    assert!(code == 0 && text.starts_with("@triangle on tiny, frame 0: "), "{message}");
    let (code, text, message) = run_in(home.path(), &["why", "@triangle", "--config", "tiny", "--json", "-"]);
    let json: serde_json::Value = serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error}: {text}{message}"));
    assert!(code == 0 && json["generator"] == "fillrate" && !home.path().join("-").exists(), "{json}");
    let (code, _, message) = run_in(home.path(), &["import", "@triangle", "--out", "triangle.zip"]);
    assert!(code == 0 && home.path().join("triangle.zip").exists(), "{message}");

    let refused = |arguments: &[&str]| {
        let (code, _, message) = run_in(home.path(), arguments);
        assert!(code == 2 && message.starts_with("error: "), "{message}");
        message
    };
    let message = refused(&["replay", "@cub"]);
    assert!(message.contains("there is no scene or experiment @cub; @cube is the nearest; scenes are @triangle"), "{message}");
    assert!(refused(&["demo", "latency-hiding"]).contains("@latency-hiding is an experiment, not a trace"));
    assert!(refused(&["sweep", "@latency-hidin", "--out", "out"]).contains("@latency-hiding is the nearest"));
    assert!(refused(&["replay", "@cube", "--limit", "work.commands=3"]).contains("--limit work.commands=N allows more"));
    let (_, _, message) = run_in(home.path(), &["inspect", "@cube", "--lenient"]);
    assert!(message.contains("--lenient has no effect: @cube is a native trace"), "{message}");
}

#[test]
fn a_folder_of_traces_and_a_scene_that_is_elsewhere_are_named() {
    let message = cli::refused(&["replay", "traces"]);
    assert!(message.contains("traces: is no trace, and holds traces: traces/corridor, traces/cube, "), "{message}");
    // A configuration is none.
    let message = cli::refused(&["replay", "configs"]);
    assert!(message.contains("configs: is no trace: neither a native one"), "{message}");
    let home = tempfile::tempdir().expect("a folder");
    let (code, _, message) = run_in(home.path(), &["replay", "traces/torus-knot.zip"]);
    assert!(code == 2 && message.contains("; @torus-knot is built in"), "{message}");
}

/// The options that stand under no heading are those of all commands.
#[test]
fn options_stand_under_headings() {
    for command in ["demo", "replay", "import", "inspect", "compare", "sweep", "why", "report"] {
        let (_, help, _) = cli::run(&[command, "--help"]);
        let lines = help.lines().skip_while(|line| *line != "Options:").skip(1);
        let first: Vec<&str> = lines.take_while(|line| line.is_empty() || line.starts_with(' ')).map(str::trim).collect();
        let names: Vec<&str> = first.into_iter().filter(|line| line.starts_with('-')).collect();
        let of_all = |line: &&str| ["-q, --quiet", "-h, --help", "--list "].iter().any(|name| line.starts_with(name));
        assert!(names.iter().all(of_all), "{command}: {names:?}");
        assert!(names.len() >= 2, "{command}: {help}");
    }
}

#[test]
fn built_in_experiments_run_in_any_folder() {
    let home = tempfile::tempdir().expect("a folder");
    let (code, text, message) = run_in(home.path(), &["sweep", "@vertex-reuse", "--out", "reuse"]);
    assert_eq!(code, 0, "{message}");
    assert!(text.contains("How many vertices should the post-transform cache remember"), "{text}");
    assert!(text.contains("On torus-bands, it goes from 1 at 0 to ") && !text.contains("`@torus-bands`"), "{text}");
    // The folder says from which traces it is, and the same command goes on with it.
    let (code, text, message) = run_in(home.path(), &["sweep", "@vertex-reuse", "--out", "reuse"]);
    assert!(code == 0 && text.contains("nothing is left to simulate"), "{message}{text}");
    let inputs = fs::read_to_string(home.path().join("reuse/inputs.json")).expect("a file");
    let inputs: serde_json::Value = serde_json::from_str(&inputs).expect("JSON");
    let hashes = inputs["traces"].as_array().expect("hashes");
    assert_eq!(hashes.len(), 3);
    assert!(hashes.iter().enumerate().all(|(at, hash)| !hashes[..at].contains(hash)), "{hashes:?}");
    let (code, _, message) = run_in(home.path(), &["sweep", "@vertex-reuse", "--set", "core.warps=1", "--out", "other"]);
    assert!(code == 2 && message.contains("--set is part of the experiment @vertex-reuse: write it there"), "{message}");
}

#[test]
fn sections_of_a_report_are_shown_by_name() {
    let home = tempfile::tempdir().expect("a folder");
    let (code, shown, message) = run_in(home.path(), &["replay", "@cube", "--out", "out", "--show", "funnel,phases"]);
    assert_eq!(code, 0, "{message}");
    let titles: Vec<&str> = shown.lines().filter(|line| !line.is_empty() && !line.starts_with(' ')).collect();
    assert_eq!(titles, ["What was drawn, and what was thrown away where", "Where the cycles went, one phase after another"]);
    let (code, again, message) = run_in(home.path(), &["report", "out", "--show", "funnel,phases"]);
    assert!(code == 0 && again == shown, "{message}{again}");
    let (_, whole, _) = run_in(home.path(), &["replay", "@cube"]);
    for section in shown.split("\n\n") {
        assert!(whole.contains(section.trim_end()), "{section}");
    }
    let (code, cycles, _) = run_in(home.path(), &["report", "out", "--show", "cycles"]);
    assert!(code == 0 && cycles.contains(" frames per second at ") && !cycles.contains("host: "), "{cycles}");

    let (code, _, message) = run_in(home.path(), &["replay", "@cube", "--show", "funel"]);
    assert!(code == 2 && message.contains("funnel, shares, phases, causes, draws"), "{message}");
    let (code, _, message) = run_in(home.path(), &["report", "out", "--show", "draws"]);
    assert!(code == 2 && message.contains("has no section draws; it has funnel, shares, phases"), "{message}");
    assert!(cli::refused(&["report", "traces/cube", "--show", "funnel"]).contains("is no folder of a replay"));
}
