//! The command line, as scripts use it: files, exit codes, messages.

use std::fs;
use std::path::{Path, PathBuf};

use assert_cmd::Command;

fn fillrate() -> Command {
    let mut command = Command::new(assert_cmd::cargo::cargo_bin!("fillrate"));
    command.current_dir(env!("CARGO_MANIFEST_DIR"));
    command
}

/// Runs the program. Returns its exit code, standard output and standard error.
pub fn run(arguments: &[&str]) -> (i32, String, String) {
    let output = fillrate().args(arguments).output().expect("the program starts");
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).expect("UTF-8");
    (output.status.code().unwrap_or(-1), text(output.stdout), text(output.stderr))
}

/// Runs with bad input. The exit code must be 2, with one `error:` and no panic. Returns the message.
pub fn refused(arguments: &[&str]) -> String {
    let (code, _, message) = run(arguments);
    assert_eq!(code, 2, "{arguments:?}: {message}");
    assert!(message.starts_with("error:"), "{message}");
    assert!(!message.contains("panicked"), "{message}");
    message
}

/// A copy of the triangle trace, to be damaged.
fn damaged(folder: &Path, change: impl FnOnce(&Path, String) -> String) -> String {
    for entry in fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/triangle")).expect("the trace is there") {
        let path = entry.expect("an entry").path();
        fs::copy(&path, folder.join(path.file_name().expect("a name"))).expect("a copy");
    }
    let file = folder.join("trace.ron");
    let text = change(folder, fs::read_to_string(&file).expect("text"));
    fs::write(&file, text).expect("written");
    folder.display().to_string()
}

fn blob_of(folder: &Path, extension: &str) -> PathBuf {
    let mut found: Vec<PathBuf> = fs::read_dir(folder).expect("a folder").map(|e| e.expect("an entry").path()).collect();
    found.sort();
    found.into_iter().find(|p| p.extension().is_some_and(|e| e == extension)).expect("a blob")
}

#[test]
fn replay_leaves_image_statistics_and_configuration() {
    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().display().to_string();
    let (code, report, message) = run(&["replay", "traces/triangle", "--config", "tiny", "--out", &folder]);
    assert_eq!(code, 0, "{message}");
    for part in ["triangles set up", "A busy unit need not limit", "DRAM", "frames per second"] {
        assert!(report.contains(part), "no `{part}` in\n{report}");
    }
    let image = image::open(out.path().join("frame-0000.png")).expect("a picture");
    assert!(image.width() > 0);
    let text = fs::read_to_string(out.path().join("stats.json")).expect("statistics");
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert!(json["total"]["cycles"].as_u64().expect("cycles") > 1000);
    assert_eq!((&json["config"], &json["changed_knobs"]), (&"tiny".into(), &serde_json::json!({})));
    assert!(!report.contains("Knobs that differ"), "{report}");
    assert_eq!(json["frames"].as_array().expect("frames").len(), 1);
    assert_eq!(json["total"]["sort"]["wrong_pixels"], 0);
    assert_eq!(fs::read_to_string(out.path().join("stats.csv")).expect("a table").lines().count(), 2);
    let config = out.path().join("config.ron").display().to_string();
    let (code, _, message) = run(&["replay", "traces/triangle", "--config", &config]);
    assert_eq!(code, 0, "the resolved configuration can be used again: {message}");
}

#[test]
fn threads_and_clocks_change_no_byte() {
    let mut seen: Option<Vec<Vec<u8>>> = None;
    for (threads, clock) in [("1", "skip-idle"), ("2", "skip-idle"), ("8", "every-cycle")] {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().display().to_string();
        let (code, _, message) =
            run(&["replay", "traces/cube", "--config", "tiny", "--threads", threads, "--clock", clock, "--out", &folder]);
        assert_eq!(code, 0, "{message}");
        let files = ["frame-0000.png", "stats.json", "stats.csv", "passes.csv", "config.ron", "report.txt"]
            .map(|name| fs::read(out.path().join(name)).expect("a file"))
            .to_vec();
        match &seen {
            None => seen = Some(files),
            Some(first) => assert!(*first == files, "{threads} threads, {clock}: other bytes"),
        }
    }
}

#[test]
fn runs_of_frames_do_not_depend_on_threads() {
    let mut seen: Option<Vec<Vec<u8>>> = None;
    for threads in ["1", "2", "8"] {
        let out = tempfile::tempdir().expect("a folder");
        let folder = out.path().display().to_string();
        let (code, report, message) =
            run(&["replay", "traces/particles", "--threads", threads, "--frames-per-run", "1", "--per-draw", "--out", &folder]);
        assert_eq!(code, 0, "{message}");
        assert!(report.contains("runs of 1 frames"), "{report}");
        let files = ["frame-0000.png", "frame-0003.png", "stats.json", "stats.csv", "passes.csv", "draws.csv"]
            .map(|name| fs::read(out.path().join(name)).expect("a file"))
            .to_vec();
        match &seen {
            None => seen = Some(files),
            Some(first) => assert!(*first == files, "{threads} threads: other bytes"),
        }
    }
    let (_, report, _) = run(&["replay", "traces/particles", "--frames-per-run", "all"]);
    assert!(!report.contains("runs of"), "{report}");

    let runs = ["replay", "traces/particles", "--frames-per-run", "1"];
    let refused = |more: &[&str]| refused(&[&runs[..], more].concat());
    assert!(refused(&["--config", "sort-middle-binned"]).contains("functional warming"));
    assert!(refused(&["--set", "scanout.mode=free-running", "--set", "scanout.swap=vsync"]).contains("free-running"));
    assert!(refused(&["--fidelity", "bound"]).contains("--frames-per-run applies to --fidelity cycle only"));
    assert!(refused(&["--timeline", "t.json"]).contains("--frames-per-run all"));
    let (code, _, message) = run(&["replay", "traces/particles", "--frames-per-run", "0"]);
    assert!(code == 2 && message.contains("from 1 on, or all"), "{message}");
}

#[test]
fn frames_have_the_numbers_of_the_trace() {
    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().display().to_string();
    let (code, _, message) =
        run(&["replay", "traces/particles", "--fidelity", "functional", "--frames", "1..3", "--out", &folder]);
    assert_eq!(code, 0, "{message}");
    let there = |n: u32| out.path().join(format!("frame-{n:04}.png")).exists();
    assert_eq!([0, 1, 2, 3].map(there), [false, true, true, false]);
    assert!(
        refused(&["replay", "traces/particles", "--fidelity", "functional", "--frames", "90..91"])
            .contains("no frame 90; it has 4")
    );
    // Into a folder with pictures of an earlier replay, and one that no replay made.
    let one = tempfile::tempdir().expect("a folder");
    let folder = one.path().display().to_string();
    fs::copy(out.path().join("frame-0001.png"), one.path().join("frame-0001.png")).expect("a copy");
    fs::copy(out.path().join("frame-0001.png"), one.path().join("frame-mine.png")).expect("a copy");
    let replay = ["replay", "traces/particles", "--fidelity", "functional", "--frames", "2", "--out", &folder];
    assert!(refused(&replay).contains("frame-0001.png is there, and no replay has written it"));
    let (code, _, message) = run(&[&replay[..], &["--force"]].concat());
    assert_eq!(code, 0, "{message}");
    assert_eq!([1, 2, 3].map(|n: u32| one.path().join(format!("frame-{n:04}.png")).exists()), [false, true, false]);
    assert!(one.path().join("frame-mine.png").exists());
    // A replay that finds no frame does not change the folder.
    let missing = ["replay", "traces/particles", "--fidelity", "functional", "--frames", "7..9", "--out", &folder];
    assert!(refused(&missing).contains("no frame in 7..9; it has 4"));
    let mut names: Vec<_> =
        fs::read_dir(one.path()).expect("a folder").map(|entry| entry.expect("an entry").file_name()).collect();
    names.sort();
    assert_eq!(
        names,
        [".fillrate-files", "config.ron", "frame-0002.png", "frame-mine.png", "report.txt", "stats.csv", "stats.json"]
    );
    // One that finds fewer frames than requested says so.
    let (code, _, message) = run(&["replay", "traces/particles", "--fidelity", "functional", "--frames", "2..9"]);
    assert!(code == 0 && message.contains("warning: the trace ends with frame 3: --frames 2..9 asks for more"), "{message}");
}

#[test]
fn a_run_names_the_knobs_that_differ_from_its_configuration() {
    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().display().to_string();
    // Differences are those from the configuration of --config, or from the baseline without it. A knob set to its old value does not differ.
    for (config, name, warps) in [(&["--config", "tiny"][..], "tiny", 8), (&[], "baseline", 64)] {
        let set = ["--set", "core.warps=3", "--set", "sort=sort-middle", "--set", "memory.kind=ideal", "--out", &folder];
        let (code, report, message) = run(&[&["replay", "traces/triangle"], config, &set].concat());
        assert_eq!(code, 0, "{message}");
        let section = report.split(&format!("\nKnobs that differ from {name}\n")).nth(1).unwrap_or_else(|| panic!("{report}"));
        let lines: Vec<&str> = section.split("\n\n").next().unwrap_or_default().lines().map(str::trim).collect();
        assert_eq!(lines, [format!("core.warps   {warps} -> 3").as_str(), "memory.kind  \"dram\" -> \"ideal\""]);
        let text = fs::read_to_string(out.path().join("stats.json")).expect("statistics");
        let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let expected = serde_json::json!({
            "core.warps": { "from": warps, "to": 3 },
            "memory.kind": { "from": "dram", "to": "ideal" },
        });
        assert_eq!((&json["config"], &json["changed_knobs"]), (&name.into(), &expected));
    }
}

#[test]
fn knobs_without_effect_are_warned_of() {
    for (config, set, warning) in [
        ("sort-middle", "bin.tile=16", Some("bin.tile has no effect: a machine whose sort is sort-middle has no bins")),
        ("sort-middle-binned", "bin.tile=16", None),
        ("tiny", "core.vertex_warps=3", Some("core.vertex_warps has no effect: core.unified is true")),
        ("tiny", "core.warps=3", None),
        (
            "sort-last-image",
            "geometry_units=3",
            Some("geometry_units has no effect: a machine whose sort is sort-last-image has the"),
        ),
        ("sort-middle", "geometry_units=3", None),
        (
            "baseline --set traverse.hierarchical_z=false",
            "traverse.hierarchical_lines=4",
            Some("traverse.hierarchical_lines has no effect: traverse.hierarchical_z is false"),
        ),
        (
            "tiny --fidelity functional",
            "core.warps=3",
            Some("core.warps has no effect: --fidelity functional simulates no machine"),
        ),
        ("tiny --fidelity functional", "command.cull=draws", None),
    ] {
        let config = config.split(' ');
        let (code, _, message) =
            run(&["replay", "traces/triangle", "--config"].into_iter().chain(config).chain(["--set", set]).collect::<Vec<_>>());
        assert_eq!(code, 0, "{message}");
        assert_eq!(message.contains("has no effect"), warning.is_some(), "{message}");
        assert!(message.contains(warning.unwrap_or_default()), "{message}");
    }
}

#[test]
fn images_none_leaves_statistics_only() {
    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().display().to_string();
    let files = |images: &[&str]| {
        let (code, _, message) = run(&[&["replay", "traces/triangle", "--config", "tiny", "--out", &folder], images].concat());
        assert_eq!(code, 0, "{message}");
        let mut names: Vec<String> = fs::read_dir(out.path())
            .expect("a folder")
            .map(|entry| entry.expect("an entry").file_name().into_string().expect("a name"))
            .collect();
        names.sort();
        (names, fs::read(out.path().join("stats.json")).expect("statistics"))
    };
    let (all, statistics) = files(&["--images", "all"]);
    assert_eq!(all, [".fillrate-files", "config.ron", "frame-0000.png", "passes.csv", "report.txt", "stats.csv", "stats.json"]);
    assert!(files(&[]) == (all, statistics.clone()), "all is the default");
    // The picture of the earlier replay goes, and the statistics are the same.
    let (none, same) = files(&["--images", "none"]);
    assert_eq!(none, [".fillrate-files", "config.ron", "passes.csv", "report.txt", "stats.csv", "stats.json"]);
    assert!(same == statistics, "--images none changes the statistics");
    // Without --out the option has nothing to change.
    let (code, _, message) = run(&["replay", "traces/triangle", "--images", "none"]);
    assert!(code == 2 && message.contains("--out"), "{message}");
    let (code, _, message) = run(&["replay", "traces/triangle", "--images", "some", "--out", &folder]);
    assert!(code == 2 && message.contains("some"), "{message}");
}

/// Counts of sampled frames are estimates for the whole sequence, so overdraw is by the pictures of the whole sequence. (By those of the three
/// frames that are reported it was eight times as much.)
#[test]
fn overdraw_of_sampled_frames_is_that_of_all() {
    let overdraw = |options: &[&str]| {
        let start = ["replay", "traces/flight.zip", "--frames", "0..24", "--images", "none", "--config", "tiny"];
        let folder = tempfile::tempdir().expect("a folder");
        let out = folder.path().join("out").display().to_string();
        let (code, text, message) = run(&[&start[..], &["--out", &out], options].concat());
        assert_eq!(code, 0, "{message}");
        let line = text.lines().find(|line| line.contains("overdraw")).expect("a line of it");
        line.split_whitespace().nth(1).and_then(|number| number.parse::<f64>().ok()).expect("a number")
    };
    let all = overdraw(&["--fidelity", "functional"]);
    for fidelity in ["sampled", "bound"] {
        let estimated = overdraw(&["--fidelity", fidelity, "--samples", "2"]);
        assert!((0.5..2.0).contains(&(estimated / all)), "{fidelity}: {estimated}, and {all} of all frames");
    }
}

#[test]
fn pictures_of_frames_that_are_not_simulated_come_on_demand() {
    let out = tempfile::tempdir().expect("a folder");
    let replay = |name: &str, options: &[&str]| {
        let folder = out.path().join(name);
        let place = folder.display().to_string();
        let (code, _, message) = run(&[&["replay", "traces/panel.zip", "--out", &place], options].concat());
        assert_eq!(code, 0, "{message}");
        let read = |name: &str| fs::read(folder.join(name)).ok();
        let pictures: Vec<_> = (0..4).map(|frame| read(&format!("frame-{frame:04}.png"))).collect();
        (pictures, read("stats.json"), read("stats.csv"))
    };
    let sampled = ["--fidelity", "sampled", "--samples", "2"];
    let (some, statistics, rows) = replay("some", &sampled);
    let (all, same_statistics, same_rows) = replay("all", &[&sampled[..], &["--images", "all"]].concat());
    assert_eq!(some.iter().flatten().count(), 3, "the first frame and two others are simulated");
    assert!(all == replay("functional", &["--fidelity", "functional"]).0 && all.iter().all(Option::is_some));
    assert!(statistics == same_statistics && rows == same_rows && statistics.is_some(), "statistics know nothing of pictures");
}

#[test]
fn what_would_be_ignored_is_told() {
    for fidelity in ["functional", "bound"] {
        let message = refused(&["replay", "traces/triangle", "--fidelity", fidelity, "--clock", "every-cycle"]);
        assert!(message.contains("--clock") && message.contains("--fidelity cycle"), "{message}");
    }
    let message = refused(&["compare", "baseline", "tiny", "--each-bank"]);
    assert!(message.contains("--each-bank") && message.contains("a configuration"), "{message}");
    let message = refused(&["replay", "traces/triangle", "--samples", "4"]);
    assert!(message.contains("--samples") && message.contains("--fidelity sampled"), "{message}");
    for (option, value) in [("--lenient", None), ("--keep-draws", None), ("--window", Some("1"))] {
        let options = [option].into_iter().chain(value);
        let all: Vec<&str> = ["replay", "traces/triangle", "--fidelity", "functional"].into_iter().chain(options).collect();
        let (code, _, message) = run(&all);
        assert!(
            code == 0 && message.contains(&format!("{option} has no effect: traces/triangle is a native trace")),
            "{message}"
        );
    }
    for (change, told) in [("depth.early=false", "hierarchical Z"), ("bin.hide=true", "sort-middle-binned")] {
        let (code, _, message) = run(&["replay", "traces/triangle", "--fidelity", "functional", "--set", change]);
        assert!(code == 0 && message.contains(told), "{change}: {message}");
    }
}

#[test]
fn each_fidelity_says_what_it_expects_to_be_off_by() {
    for (fidelity, more, says) in [
        ("functional", &[][..], "counted, not timed"),
        ("bound", &[], "estimated from counts and rates: median error"),
        ("sampled", &["--samples", "2"], "What is estimated"),
        ("cycle", &[], "nothing estimated"),
    ] {
        let (code, text, message) = run(&[&["replay", "traces/particles", "--fidelity", fidelity], more].concat());
        assert_eq!(code, 0, "{message}");
        assert!(text.contains(says), "{fidelity}: {text}");
    }
}

/// The commit is the one that was checked out when the program was built; another may be by now.
#[test]
fn the_version_names_a_commit_of_the_checkout() {
    let (code, text, _) = run(&["--version"]);
    assert_eq!(code, 0);
    let rest = text.strip_prefix(concat!("fillrate ", env!("CARGO_PKG_VERSION"))).expect("the version of the package");
    let git = |arguments: &[&str]| {
        let git = std::process::Command::new("git").args(arguments).current_dir(env!("CARGO_MANIFEST_DIR")).output();
        git.is_ok_and(|output| output.status.success())
    };
    if !Path::new(env!("CARGO_MANIFEST_DIR")).join(".git").exists() || !git(&["rev-parse", "HEAD"]) {
        assert_eq!(rest, "\n");
        return;
    }
    let commit = rest.strip_prefix(" (").and_then(|rest| rest.strip_suffix(")\n")).expect("a commit in parentheses");
    assert!(commit.len() >= 12 && git(&["cat-file", "-e", &format!("{commit}^{{commit}}")]), "{commit} is no commit");
}

#[test]
fn help_shows_an_example_each() {
    for command in ["replay", "import", "inspect", "configs", "compare", "report"] {
        let (code, text, _) = run(&[command, "--help"]);
        assert_eq!(code, 0);
        assert!(text.contains("Example") && text.contains(&format!("fillrate {command}")), "{text}");
    }
}

#[test]
fn configs_lists_and_prints() {
    let (_, list, _) = run(&["configs"]);
    for (name, _) in machine::config::BUILT_IN {
        assert!(list.lines().any(|line| line.split_whitespace().next() == Some(name)), "{name} in\n{list}");
        let (code, text, _) = run(&["configs", name]);
        assert_eq!(code, 0);
        assert!(text.contains("pipelines"), "{text}");
    }
}

#[test]
fn a_machine_is_drawn_from_itself() {
    let classes = ["sort-first", "sort-middle", "sort-middle-binned", "sort-last-fragment", "sort-last-image"];
    for class in classes {
        let (code, dot, message) = run(&["configs", class, "--draw"]);
        assert_eq!(code, 0, "{message}");
        assert!(dot.starts_with("digraph") && dot.contains("label=\"setup x4\", shape=box3d"), "{dot}");
        assert_eq!(dot.matches('{').count(), dot.matches('}').count());
        assert_eq!(run(&["configs", class, "--draw", "dot"]).1, dot, "the same again");
        let (code, svg, _) = run(&["configs", class, "--draw", "svg"]);
        assert_eq!(code, 0);
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"), "{svg}");
        assert!(svg.contains(&format!(">{class}, 4 pipelines<")) && svg.contains("traverse x4"), "{svg}");
        assert_eq!(run(&["configs", class, "--draw=svg"]).1, svg, "the same again");
        // Parts that only this class has.
        let own = ["route x4", "distribute x8", "tile_fetch x4", "order x4", "compose x4"];
        let place = classes.iter().position(|c| *c == class);
        assert!(svg.contains(own[place.expect("a class")]) && dot.contains(own[place.expect("a class")]));
        assert!(!svg.contains("router"));
    }
    // The drawing is made from the machine, and follows its knobs.
    let (_, svg, _) =
        run(&["configs", "sort-first", "--set", "network.topology=ring", "--set", "pipelines=3", "--draw", "svg"]);
    assert!(svg.contains("router x3") && svg.contains("route x3"), "{svg}");
    assert!(refused(&["configs", "--draw"]).contains("NAME"));
    assert!(refused(&["configs", "tiny", "--draw", "jpeg"]).contains("jpeg"));
    assert!(refused(&["configs", "tiny", "--set", "pipelines=99", "--draw"]).contains("pipelines"));
}

#[test]
fn a_replay_tells_what_sorting_cost() {
    let sections = |changes: &[&str]| {
        let (code, report, message) = run(&[&["replay", "traces/triangle"], changes].concat());
        assert_eq!(code, 0, "{message}");
        let section = report.split("What sorting cost\n").nth(1).unwrap_or_else(|| panic!("{report}"));
        let section = section.split("\n\n").next().unwrap_or_default();
        section.lines().map(|line| line.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>()
    };
    for (class, what, own) in [
        ("sort-first", "primitives sorted 1", "to another pipeline"),
        ("sort-middle", "triangles sorted 1", "to another pipeline"),
        ("sort-middle-binned", "triangles sorted 1", "partial renders 0"),
        ("sort-last-fragment", "quads sorted", "to another pipeline"),
        ("sort-last-image", "samples sorted", "passes needing order 0"),
    ] {
        let lines = sections(&["--config", class]);
        assert_eq!(lines[0], format!("{class}, 4 pipelines"));
        let wanted =
            [what, "overlap", own, "load imbalance", "reorder stalls", "busiest link of the network", "wrong pixels 0"];
        for part in wanted {
            assert!(lines.iter().any(|line| line.contains(part)), "{part}: {lines:#?}");
        }
        assert!(lines.iter().any(|line| line.contains(" from ") && line.contains("sorted[")), "the hot spot: {lines:#?}");
    }
    // With one pipeline all that is sent stays in it.
    let lines = sections(&["--set", "pipelines=1", "--set", "geometry_units=1"]);
    assert_eq!(lines[0], "sort-middle, 1 pipeline");
    assert!(lines.contains(&"to another pipeline 0 0.0 %; 0 B".to_owned()), "{lines:#?}");
}

#[test]
fn wrong_knobs_are_refused_with_key_value_and_range() {
    let message = refused(&["replay", "traces/triangle", "--set", "pipelines=0"]);
    assert!(message.contains("pipelines") && message.contains('0'), "{message}");
    let message = refused(&["replay", "traces/triangle", "--set", "setup.nonsense=1"]);
    assert!(message.contains("setup.nonsense"), "{message}");
    let message = refused(&["replay", "traces/triangle", "--config", "no-such-card"]);
    assert!(message.contains("no-such-card") && message.contains("baseline"), "{message}");
    let folder = tempfile::tempdir().expect("a folder");
    let file = folder.path().join("mine.ron");
    fs::write(&file, "(\n    extends: \"baseline\",\n    pipelnes: 2,\n)\n").expect("written");
    let message = refused(&["replay", "traces/triangle", "--config", &file.display().to_string()]);
    assert!(message.contains("mine.ron") && message.contains("pipelnes"), "{message}");
}

#[test]
fn damaged_traces_are_refused_with_file_place_and_reason() {
    let folder = || tempfile::tempdir().expect("a folder");

    let f = folder();
    let trace = damaged(f.path(), |_, text| text[..text.len() / 2].to_owned());
    assert!(refused(&["replay", &trace]).contains("trace.ron"));

    let f = folder();
    let trace = damaged(f.path(), |folder, text| {
        fs::remove_file(blob_of(folder, "bin")).expect("removed");
        text
    });
    assert!(refused(&["replay", &trace]).contains(".bin"));

    let f = folder();
    let trace = damaged(f.path(), |folder, text| {
        let blob = blob_of(folder, "bin");
        let mut bytes = fs::read(&blob).expect("bytes");
        bytes[0] ^= 1;
        fs::write(blob, bytes).expect("written");
        text
    });
    let message = refused(&["replay", &trace]);
    assert!(message.contains("hash") && message.contains(".bin"), "{message}");

    let f = folder();
    let trace = damaged(f.path(), |_, text| text.replacen("vertices: 3", "vertices: 3000", 1));
    let message = refused(&["replay", &trace]);
    assert!(message.contains("command") && message.contains("3000"), "{message}");

    let f = folder();
    let trace = damaged(f.path(), |_, text| text.replacen("version: 1", "version: 99", 1));
    assert!(refused(&["replay", &trace]).contains("99"));

    let f = folder();
    let trace = damaged(f.path(), |_, text| text.replacen("Draw(", "Drow(", 1));
    let message = refused(&["replay", &trace]);
    assert!(message.contains("Drow"), "{message}");

    assert!(refused(&["replay", "no/such/trace"]).contains("no/such/trace"));
    assert!(refused(&["inspect", "Cargo.toml"]).contains("Cargo.toml"));
}

#[test]
fn inspect_and_import_round_trip() {
    let out = tempfile::tempdir().expect("a folder");
    let copy = out.path().join("copy").display().to_string();
    assert_eq!(run(&["import", "traces/triangle", "--out", &copy]).0, 0);
    let (_, a, _) = run(&["inspect", "traces/triangle", "--json"]);
    let (_, b, _) = run(&["inspect", &copy, "--json"]);
    assert_eq!(a, b);
    assert!(refused(&["import", "traces/triangle", "--out", &copy]).contains("not empty"));
}

#[test]
fn accuracy_lists_its_targets_and_fails_with_a_fault() {
    let (code, list, _) = run(&["accuracy", "--list"]);
    assert_eq!(code, 0);
    for part in ["B. Rasterisation and numbers\n", "  fill-rules ", "  plane-codec ", "bound: ", "fault: "] {
        assert!(list.contains(part), "no `{part}` in\n{list}");
    }
    let (code, text, message) = run(&["accuracy", "integer-shift", "--size", "small", "--seed", "3,4"]);
    assert_eq!(code, 0, "{message}");
    assert!(text.starts_with("target ") && text.contains("seed 4, size small\n") && text.ends_with("2 of 2 hold\n"), "{text}");
    let (code, text, _) = run(&["accuracy", "integer-shift", "--size", "small", "--json", "--inject-fault"]);
    assert_eq!(code, 1);
    let json: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    assert_eq!((&json["verdict"], &json["targets"][0]["target"]), (&"fail".into(), &"integer-shift".into()));
    assert_eq!(json["targets"][0]["rows"][0]["allowed"], 0.0);
    assert!(refused(&["accuracy", "integershift"]).contains("integer-shift is the nearest"));
}

#[test]
fn a_name_that_is_not_complete_or_misspelt_is_answered_with_the_one_meant() {
    for (arguments, meant) in [
        (&["replay", "traces/cube", "--set", "texture.cach=8"][..], "; texture.cache_ways is the nearest"),
        (&["replay", "traces/cube", "--config", "tinny"], "; tiny is the nearest; built in are baseline"),
        (&["replay", "traces/cube", "--config", "basel"], "; baseline is the nearest"),
        (
            &["compare", "basel", "tiny"],
            "there is no basel: neither a file or folder nor a built-in configuration; baseline is the",
        ),
        (
            &["sweep", "traces/cube", "--measure", "caches.texture.mis", "--vary", "core.warps=1,2", "--out", "/dev/null/x"],
            "; caches.texture.misses is the nearest",
        ),
        (&["repla"], "a similar subcommand exists: 'replay'"),
        (&["whi"], "a similar subcommand exists: 'why'"),
        (&["replay", "traces/cube", "--ot", "out"], "a similar argument exists: '--out'"),
        (&["replay", "traces/cube", "--time-l", "3s"], "a similar argument exists: '--time-limit'"),
        (&["replay", "traces/cube", "--fidelity", "func"], "a similar value exists: 'functional'"),
    ] {
        let (code, _, message) = run(arguments);
        assert!(code == 2 && message.contains(meant), "{arguments:?}: {message}");
    }
}

/// Runs with exit code `expected`. Returns the one document on standard output.
fn document(expected: i32, arguments: &[&str]) -> serde_json::Value {
    let (code, text, message) = run(arguments);
    assert_eq!(code, expected, "{arguments:?}: {message}");
    serde_json::from_str(&text).unwrap_or_else(|reason| panic!("{reason}: {text}"))
}

#[test]
fn replay_and_compare_answer_in_json() {
    let out = tempfile::tempdir().expect("a folder");
    let (a, b) = (out.path().join("a").display().to_string(), out.path().join("b").display().to_string());
    let replay = ["replay", "traces/triangle", "--config", "tiny", "--json", "--out"];
    let said = document(0, &[&replay[..], &[&a, "--per-draw"]].concat());
    let text = fs::read_to_string(out.path().join("a/stats.json")).expect("statistics");
    let left: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    for same in ["version", "trace", "config", "changed_knobs", "fidelity", "total"] {
        assert_eq!(said[same], left[same], "{same}");
    }
    let cycles = left["total"]["cycles"].as_f64();
    assert_eq!((&said["frame_count"], said["cycles"].as_f64()), (&1.into(), cycles));
    let phases = said["phases"].as_array().expect("phases");
    assert_eq!(phases.iter().map(|phase| phase["cycles"].as_f64().expect("cycles")).sum::<f64>(), cycles.expect("cycles"));
    assert!(said["slowest_draws"].as_array().is_some_and(|draws| !draws.is_empty()), "{said}");

    document(0, &[&replay[..], &[&b, "--set", "setup.latency=30"]].concat());
    let found = document(1, &["compare", &a, &b, "--json"]);
    assert_eq!(found["same"], false);
    assert_eq!(found["knobs"]["setup.latency"]["to"], 30);
    assert!(found["statistics"].as_array().is_some_and(|all| all.iter().any(|d| d["path"] == "total.cycles")), "{found}");
    assert_eq!((&found["images"][0]["image"], &found["images"][0]["different"]), (&"frame-0000.png".into(), &0.into()));
    let same = document(0, &["compare", &format!("{a}/frame-0000.png"), &format!("{b}/frame-0000.png"), "--json"]);
    assert_eq!((&same["same"], &same["images"][0]["psnr"]), (&true.into(), &serde_json::Value::Null));
    // Errors leave standard output empty.
    let (code, text, message) = run(&["replay", "traces/nothing", "--json"]);
    assert!(code == 2 && text.is_empty() && message.starts_with("error: "), "{text}{message}");
}

#[test]
fn quiet_leaves_results_and_errors() {
    let out = tempfile::tempdir().expect("a folder");
    let folder = |name: &str| out.path().join(name).display().to_string();
    let warned = ["replay", "traces/triangle", "--config", "tiny", "--set", "core.vertex_warps=3"];
    for (arguments, code) in [
        (&[&warned[..], &["--out", &folder("replay"), "--report", &folder("page.html")]].concat()[..], 0),
        (&["sweep", "traces/triangle", "--config", "tiny", "--vary", "core.warps=2,3", "--out", &folder("sweep")], 0),
        (&["import", "traces/triangle", "--out", &folder("trace.zip")], 0),
        (&["report", &folder("sweep"), "--plots"], 0),
    ] {
        assert_eq!(run(&[arguments, &["--quiet"]].concat()), (code, String::new(), String::new()), "{arguments:?}");
    }
    assert!(out.path().join("sweep/report.md").exists() && out.path().join("replay/stats.json").exists());
    assert_eq!(document(0, &["replay", "-q", "traces/triangle", "--config", "tiny", "--json"])["frame_count"], 1);
    assert_eq!(run(&["-q", "configs", "tiny"]), run(&["configs", "tiny"]));
    assert!(refused(&["-q", "replay", "traces/nothing"]).contains("traces/nothing"));
}

/// Runs the program until a file is there and not empty, and interrupts it as Ctrl-C does. Returns its exit code and standard error.
#[cfg(target_os = "linux")]
fn interrupted(arguments: &[&str], file: &Path) -> (Option<i32>, String) {
    // A background job of a shell ignores the signal, and so would the program.
    let process = std::process::Command::new("env")
        .args(["--default-signal=INT", env!("CARGO_BIN_EXE_fillrate")])
        .args(arguments)
        .current_dir(env!("CARGO_MANIFEST_DIR"))
        .stdout(std::process::Stdio::null())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the program starts");
    let begun = std::time::Instant::now();
    while !fs::metadata(file).is_ok_and(|file| file.len() > 0) && begun.elapsed().as_secs() < 60 {
        std::thread::sleep(std::time::Duration::from_millis(5));
    }
    let sent = std::process::Command::new("kill").args(["-INT", &process.id().to_string()]).status().expect("a signal");
    assert!(sent.success(), "it had ended before");
    let output = process.wait_with_output().expect("it ends");
    (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
}

#[cfg(target_os = "linux")]
#[test]
fn an_interrupted_command_says_what_is_kept_and_leaves_no_half_file() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("replay");
    let folder = out.display().to_string();
    let (code, message) = interrupted(&["replay", "traces/flight.zip", "--out", &folder], &out.join("frame-0000.png"));
    assert_eq!(code, Some(130), "{message}");
    assert_eq!(
        message,
        format!("interrupted: the pictures of frames that have ended are kept in {folder}, without statistics\n")
    );
    let names = fs::read_dir(&out).expect("a folder").map(|entry| entry.expect("an entry").file_name());
    let parts: Vec<_> = names.filter(|name| name.to_string_lossy().ends_with(".part")).collect();
    assert!(parts.is_empty(), "{parts:?}");

    // What a sweep has measured is no half file: it goes on from there.
    let out = home.path().join("sweep");
    let folder = out.display().to_string();
    let sweep = ["sweep", "traces/cube", "--vary", "core.warps=1..60", "--vary", "setup.latency=1..20", "--out", &folder];
    let (code, message) = interrupted(&sweep, &out.join("shard-1-of-1.jsonl.part"));
    assert_eq!(code, Some(130), "{message}");
    let kept = message
        .strip_prefix("interrupted: ")
        .and_then(|text| text.strip_suffix(" of 1200 machines are kept; the same command goes on\n"));
    let kept: usize = kept.and_then(|number| number.parse().ok()).unwrap_or_else(|| panic!("{message}"));
    let lines = fs::read_to_string(out.join("shard-1-of-1.jsonl.part")).expect("results").lines().count();
    // A result that was written when the signal came may not be counted, or not be complete.
    assert!(kept > 0 && lines.abs_diff(kept) <= 64, "{kept} {lines}");
}

#[test]
fn completions_and_manual_pages_name_all_options() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let (code, text, message) = run(&["completions", shell]);
        assert_eq!((code, message.as_str()), (0, ""));
        for part in ["frames-per-run", "slurm", "scan-out", "quiet"] {
            assert!(text.contains(part), "{shell}: no {part}");
        }
    }
    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().join("man1");
    let (code, _, message) = run(&["manual", &folder.display().to_string()]);
    assert_eq!(code, 0, "{message}");
    for (page, part) in
        [("fillrate.1", "fillrate\\-replay(1)"), ("fillrate-replay.1", "per\\-draw"), ("fillrate-sweep-merge.1", "folders")]
    {
        let text = fs::read_to_string(folder.join(page)).expect("a page").to_lowercase();
        assert!(text.contains(part), "{page}: no {part} in\n{text}");
    }
}

#[test]
fn help_has_options_under_headings_and_those_used_most_first() {
    for (command, order) in [
        (
            "replay",
            &["Machine:", "--config", "--set", "Output:", "--out", "--report", "Simulation:", "Reading the trace:", "--limit"]
                [..],
        ),
        (
            "sweep",
            &["Machines:", "--vary", "Output:", "--out", "Simulation:", "--frames", "Reading the trace:", "--keep-draws"],
        ),
        (
            "compare",
            &["Statistics and knobs:", "--only", "Images:", "--allow", "Output:", "--json", "Reading files:", "--limit"],
        ),
        ("why", &["Machine:", "--set", "Simulation:", "--frames", "Output:", "--rows", "Reading the trace:", "--lenient"]),
    ] {
        let (_, help, _) = run(&[command, "-h"]);
        let begins = |part: &str| help.lines().position(|line| line.trim_start().starts_with(part));
        let lines: Vec<_> = order.iter().map(|part| begins(part)).collect();
        assert!(lines.iter().all(Option::is_some) && lines.is_sorted(), "{command}: {lines:?} in\n{help}");
    }
}

#[test]
fn a_reader_who_goes_away_is_no_error() {
    let (reader, writer) = std::io::pipe().expect("a pipe");
    drop(reader);
    let output = std::process::Command::new(env!("CARGO_BIN_EXE_fillrate"))
        .args(["inspect", "traces/cube", "--commands"])
        .stdout(writer)
        .stderr(std::process::Stdio::piped())
        .output()
        .expect("the program runs");
    assert_eq!(output.status.code(), Some(141));
    assert_eq!(String::from_utf8_lossy(&output.stderr), "");
}
