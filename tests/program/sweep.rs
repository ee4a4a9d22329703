//! `fillrate sweep`, as scripts use it: tables, shards, interruptions, bad input.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use fillrate::machine::Config;
use fillrate::scenes;
use fillrate::sweep::experiment::{BUILT_IN, Experiment};
use fillrate::sweep::plan::Plan;

use crate::cli::{refused, run};

/// Six machines on the cube, of which the first has a rule against it.
const AXES: [&str; 8] = [
    "--vary",
    "memory.l2.slices=3,16",
    "--vary",
    "texture.cache_lines=16..256*4",
    "--keep",
    "caches.texture",
    "--set",
    "scanout.enabled=false",
];

/// The exit status of a sweep of these axes: half of its machines break a rule, and have no result.
const LACKING: i32 = 1;

fn sweep(out: &Path, more: &[&str]) -> (i32, String, String) {
    let out = out.display().to_string();
    run(&[&["sweep", "traces/cube", "--out", &out], &AXES[..], more].concat())
}

/// The files of a folder and those below it, by name.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    for entry in fs::read_dir(folder).expect("a folder") {
        let path = entry.expect("an entry").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        if path.is_dir() {
            found.extend(files(&path).into_iter().map(|(below, bytes)| (format!("{name}/{below}"), bytes)));
        } else {
            found.insert(name, fs::read(path).expect("a file"));
        }
    }
    found
}

/// A folder as a sweep leaves it that is killed: what it was made from, and such a journal.
fn killed(folder: &Path, whole: &BTreeMap<String, Vec<u8>>, journal: Option<&str>) {
    fs::create_dir(folder).expect("a folder");
    for name in ["inputs.json", "base.ron", "experiment.ron"] {
        fs::write(folder.join(name), &whole[name]).expect("written");
    }
    if let Some(lines) = journal {
        fs::write(folder.join("shard-1-of-1.jsonl.part"), lines).expect("written");
    }
}

/// The rows of a table, by column.
fn table(folder: &Path, name: &str) -> Vec<BTreeMap<String, String>> {
    let text = fs::read_to_string(folder.join(name)).expect("a table");
    let mut lines = text.lines().map(|line| line.split(',').map(str::to_owned).collect::<Vec<_>>());
    let header = lines.next().expect("a header");
    lines.map(|row| header.iter().cloned().zip(row).collect()).collect()
}

#[test]
fn a_sweep_is_the_replays_that_it_stands_for() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("s");
    let (code, text, message) = sweep(&out, &[]);
    assert_eq!(code, LACKING, "{message}");
    assert!(text.contains("6 machines: 3 with a result, 3 with an error") && text.contains(" 1 rendering, "), "{text}");
    // The answer says so at once, and which value was never run.
    let answer = text.lines().find(|line| line.starts_with("Of 3 machines ")).expect("an answer");
    assert!(
        answer.contains(" 3 of 6 machines that were to be run have no result, the first because: memory.l2.slices is 3"),
        "{answer}"
    );
    assert!(answer.ends_with(" No machine with `memory.l2.slices` at 3 has one."), "{answer}");
    assert!(message.contains("error: 3 of 6 machines have no result: see the end of "), "{message}");
    let rows = table(&out, "machines.csv");
    assert_eq!(rows.len(), 6);
    // A reason stands there once, and before anything runs.
    assert!(text.contains("| 3 | 0 | memory.l2.slices=3 texture.cache_lines=16 | memory.l2.slices is 3"), "{:?}", rows[0]);
    let note = "note: 3 of 6 machines break a rule between knobs and cannot be run, the first because: memory.l2.slices is 3, ";
    assert!(message.starts_with(note), "{message}");
    for row in &rows[3..] {
        let one = home.path().join("r");
        let lines = format!("texture.cache_lines={}", row["texture.cache_lines"]);
        let replay = ["replay", "traces/cube", "--set", "scanout.enabled=false", "--set", &lines, "--out"];
        assert_eq!(run(&[&replay[..], &[&one.display().to_string()]].concat()).0, 0);
        let json: serde_json::Value =
            serde_json::from_slice(&fs::read(one.join("stats.json")).expect("statistics")).expect("JSON");
        assert_eq!(row["cycles"], json["total"]["cycles"].to_string());
        let misses: u64 = json["total"]["caches"]["texture"]
            .as_array()
            .expect("a bank")
            .iter()
            .map(|unit| unit["misses"].as_u64().expect("a count"))
            .sum();
        assert_eq!(row["caches.texture.misses"], misses.to_string(), "banks are summed");
    }
    let long = table(&out, "long.csv");
    let passes: u64 = long
        .iter()
        .filter(|row| row["machine"] == "3" && !row["pass"].is_empty() && row["counter"] == "cycles")
        .map(|row| row["value"].parse::<u64>().expect("cycles"))
        .sum();
    assert_eq!(passes.to_string(), rows[3]["cycles"], "the passes add up to the frame");
    let misses = |pass: bool| -> u64 {
        let own = long.iter().filter(|row| row["machine"] == "3" && row["pass"].is_empty() != pass);
        let own = own.filter(|row| row["unit"] == "caches.texture" && row["counter"] == "misses");
        own.map(|row| row["value"].parse::<f64>().expect("a count") as u64).sum()
    };
    assert_eq!(misses(true), misses(false), "so do their counters");
    assert!(
        long.iter().any(|row| row["unit"] == "caches.texture" && row["counter"] == "misses" && row["measure"] == "lookups"),
        "{:?}",
        long.last()
    );
    assert!(out.join("machines.parquet").exists() && out.join("long.parquet").exists());
}

#[test]
fn the_answer_is_what_the_table_says() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    let measure = "caches.color.misses/caches.color.accesses";
    let asked = ["sweep", "traces/cube", "traces/triangle", "--config", "tiny", "--vary", "core.warps=1..8*2", "--vary"];
    let base = ["--set", "core.warps=2", "--set", "scanout.enabled=false"];
    let more = ["depth.early=all", "--measure", measure, "--out", &out];
    let (code, text, message) = run(&[&asked[..], &more[..], &base[..]].concat());
    assert_eq!(code, 0, "{message}");
    let rows = table(home.path(), "machines.csv");
    assert_eq!(rows.len(), 16);
    let number = |row: &BTreeMap<String, String>, column: &str| row[column].parse::<f64>().expect("a number");
    // The geometric mean of the cycles of each machine over both traces, with its settings, and the measure of the sums.
    let mut machines: BTreeMap<&str, (f64, &str, [f64; 2])> = BTreeMap::new();
    for row in &rows {
        let own = machines.entry(&row["machine"]).or_insert((1.0, &row["core.warps"], [0.0; 2]));
        own.0 *= number(row, "cycles").sqrt();
        own.2[0] += number(row, "caches.color.misses");
        own.2[1] += number(row, "caches.color.accesses");
    }
    let least = machines.values().map(|own| own.0).fold(f64::INFINITY, f64::min);
    let best = fillrate::report::summary::grouped(least.round() as u64);
    let told = format!("is the fastest, with {best} cycles, the geometric mean over 2 traces;");
    assert!(text.contains("Of 8 machines number") && text.contains(&told), "{text}");
    // The base has 2 warps and early tests.
    let base = rows.iter().find(|row| row["core.warps"] == "2" && row["depth.early"] == "true").expect("the base");
    let speed_up = machines[base["machine"].as_str()].0 / least;
    let told = format!("It is {speed_up:.2} times as fast as the base, machine {}.", base["machine"]);
    assert!(text.contains(&told), "{told}: {text}");
    let mean = |warps: &str| {
        let own: Vec<f64> = machines.values().filter(|own| own.1 == warps).map(|own| own.0.ln()).collect();
        (own.iter().sum::<f64>() / own.len() as f64).exp()
    };
    let means = ["1", "2", "4", "8"].map(mean);
    let ratio = means.iter().copied().fold(0.0, f64::max) / means.iter().copied().fold(f64::INFINITY, f64::min);
    let told = text.lines().find(|line| line.starts_with("* `core.warps` is best at")).expect("a sentence");
    assert!(told.contains(&format!("which takes {ratio:.2} times as many cycles")), "{told} {ratio}");
    assert!(text.contains("\n  On cube, ") && text.contains("## By trace"), "{text}");
    for (number, (_, _, [misses, accesses])) in &machines {
        let row = text.lines().rfind(|line| line.starts_with(&format!("| {number} | "))).expect("a row");
        assert!(row.contains(&format!(" {:.4} |", misses / accesses)), "{row}");
    }
    let page = fs::read_to_string(home.path().join("report.html")).expect("a page");
    assert!(page.contains("is the fastest, with") && page.contains("<h2>By trace</h2>"), "the page has the same sentences");
}

#[test]
fn threads_shards_and_interruptions_change_no_byte() {
    let home = tempfile::tempdir().expect("a folder");
    let whole = home.path().join("whole");
    assert_eq!(sweep(&whole, &["--threads", "1"]).0, LACKING);
    let wanted = files(&whole);

    // Killed in the middle of a line; results stand in the order in which they were found.
    let part = home.path().join("part");
    let journal = "shard-1-of-1.jsonl";
    let text = String::from_utf8(wanted[journal].clone()).expect("text");
    let mut lines: Vec<&str> = text.lines().take(5).collect();
    lines.swap(0, 4);
    let cut = &text.lines().nth(5).expect("a sixth machine")[..100];
    killed(&part, &wanted, Some(&format!("{}\n{cut}", lines.join("\n"))));
    // A page can be made of what there is.
    let (code, _, message) = run(&["report", &part.display().to_string()]);
    assert_eq!(code, 0, "{message}");
    let page = fs::read_to_string(part.join("report.html")).expect("a page");
    assert!(page.contains("The sweep has not ended: ") && page.contains(" of 6 machines have a result so far"), "{part:?}");
    fs::remove_file(part.join("report.html")).expect("removed");
    let (code, text, message) = sweep(&part, &["--threads", "2"]);
    assert_eq!(code, LACKING, "{message}");
    assert!(text.contains("1 machine simulated"), "{text}");
    assert!(files(&part) == wanted, "the interrupted sweep differs");
    // Once more: nothing is left to do.
    assert!(sweep(&part, &[]).1.contains("nothing is left to simulate"));
    assert!(files(&part) == wanted);

    // Shards, one of them in a folder of its own.
    let (shared, own) = (home.path().join("shared"), home.path().join("own"));
    for (folder, shard) in [(&own, "2/3"), (&shared, "3/3")] {
        assert_eq!(sweep(folder, &["--shard", shard]).0, 0);
    }
    let [shared_name, own_name] = [&shared, &own].map(|folder| folder.display().to_string());
    let message = refused(&["sweep", "merge", &shared_name, &own_name]);
    assert!(message.contains("1 of 3 shards have not ended, shard 1/3 among them"), "{message}");
    assert_eq!(sweep(&shared, &["--shard", "1/3"]).0, 0);
    assert_eq!(run(&["sweep", "merge", &shared_name, &own_name]).0, LACKING);
    let merged = files(&shared);
    for name in ["machines.csv", "machines.parquet", "long.csv", "long.parquet", "report.md"] {
        assert!(merged[name] == wanted[name], "{name} of the shards differs");
    }
    // The same shard in two folders: equal results are one, others are refused.
    let copy = home.path().join("copy");
    fs::create_dir(&copy).expect("a folder");
    for (name, bytes) in files(&own).into_iter().filter(|(name, _)| !name.contains('/')) {
        fs::write(copy.join(name), bytes).expect("written");
    }
    let copy_name = copy.display().to_string();
    assert_eq!(run(&["sweep", "merge", &shared_name, &own_name, &copy_name]).0, LACKING);
    let shard = copy.join("shard-2-of-3.jsonl");
    let changed = fs::read_to_string(&shard).expect("results").replacen("\"cycles\":", "\"cycles\":1", 1);
    fs::write(&shard, changed).expect("written");
    let message = refused(&["sweep", "merge", &shared_name, &copy_name, &own_name]);
    assert!(message.contains("shards disagree: ") && message.contains("shard-2-of-3.jsonl"), "{message}");
    let message = refused(&["sweep", "merge", &shared_name, &whole.display().to_string()]);
    assert!(message.contains(&format!("different sweeps: shards: 3 in {shared_name}, 1 in ")), "{message}");
}

#[test]
fn a_screen_simulates_the_fastest() {
    let home = tempfile::tempdir().expect("a folder");
    let (code, text, message) = sweep(home.path(), &["--screen", "2", "--question", "Which cache?"]);
    assert_eq!(code, LACKING, "{message}");
    assert!(text.contains("# Which cache?") && text.contains("3 machines were estimated by `bound`"), "{text}");
    let screen = table(home.path(), "screen.csv");
    let simulated = screen.iter().filter(|row| row["simulated"] == "true" && row["error"].is_empty()).count();
    assert_eq!((screen.len(), simulated), (6, 2));
    // A machine without an estimate is not dropped silently.
    assert_eq!(table(home.path(), "machines.csv").len(), 5);
}

#[test]
fn what_axes_do_is_told_by_all_machines_of_a_screen() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    let axes = ["--vary", "core.warps=1,64", "--vary", "texture.cache_lines=64..256*2"];
    let asked = ["sweep", "traces/cube", "--config", "four-pipelines", "--screen", "2", "--out", &out];
    let (code, text, message) = run(&[&asked[..], &axes].concat());
    assert_eq!(code, 0, "{message}");
    // The two that were simulated have the same number of warps.
    let machines = table(home.path(), "machines.csv");
    assert!(machines.len() == 2 && machines[0]["core.warps"] == machines[1]["core.warps"], "{machines:?}");
    assert!(text.contains("\nBy the estimates of 6 machines, of which 2 were simulated:\n"), "{text}");
    assert!(text.contains("* `core.warps` is best at 64 and worst at 1, which takes "), "{text}");
    let heads = "| value | machines | estimated cycles (geometric mean) | speed-up over the base, machine ";
    assert!(text.contains(heads), "{text}");
    // The same from the folder alone, byte for byte.
    let page = fs::read(home.path().join("report.html")).expect("a page");
    assert_eq!(run(&["report", &out]).0, 0);
    assert!(fs::read(home.path().join("report.html")).expect("a page") == page, "`report` tells something else");
}

#[test]
fn axes_that_were_run_together_are_parted() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    // One warp only with one pipeline, and many only with four: means of what was run would give pipelines all that warps do.
    let asked =
        ["sweep", "traces/cube", "--config", "four-pipelines", "--vary", "core.warps=1,4,64", "--vary", "pipelines=1,2,4"];
    let conditions = ["--where", "core.warps<=pipelines*16", "--where", "pipelines<=core.warps*2", "--out", &out];
    let (code, text, message) = run(&[&asked[..], &conditions].concat());
    assert_eq!(code, 0, "{message}");
    assert!(text.contains("Not all combinations of values were run. Effects are those of an additive model"), "{text}");
    assert!(!text.contains("  With `"), "values of further axes differ: {text}");
}

#[test]
fn a_search_finds_the_best_of_the_grid_with_fewer_runs() {
    let home = tempfile::tempdir().expect("a folder");
    let space = ["traces/particles", "traces/cube", "--config", "four-pipelines", "--set", "scanout.enabled=false"];
    let axes = ["core.warps=1,4,16,64", "core.per_pipeline=1,2,4", "memory.port_latency=10,160"];
    let vary: Vec<&str> = axes.iter().flat_map(|axis| ["--vary", axis]).collect();
    let asked = |folder: &str, more: &[&str]| -> (std::path::PathBuf, String) {
        let out = home.path().join(folder);
        let name = out.display().to_string();
        let (code, text, message) =
            run(&[&["sweep"], &space[..], &vary[..], &["--keep", "funnel", "--out", &name], more].concat());
        assert_eq!(code, 0, "{message}");
        (out, text)
    };
    let (_, grid) = asked("grid", &[]);
    let (found, searched) = asked("search", &["--search", "halving:16"]);
    let best = |text: &str| {
        let line = text.lines().find(|line| line.starts_with("Of ")).expect("an answer");
        line.split(" is the fastest, with ")
            .next()
            .and_then(|head| head.split(" number ").nth(1))
            .expect("a machine")
            .to_owned()
    };
    assert_eq!(best(&grid), best(&searched), "{searched}");
    // 24 machines on 5 frames are 120; 16 machines on 2 frames, 8 on 3 and 4 on all are 76.
    assert!(
        searched.contains("\n| estimated | 24 | 5 | 0 |\n| 1 | 16 | 2 | 32 |\n| 2 | 8 | 3 | 24 |\n| 3 | 4 | 5 | 20 |\n"),
        "{searched}"
    );
    assert!(searched.contains("76 frames were simulated; all machines would take 120."), "{searched}");
    assert!(searched.contains("By the estimates of 24 machines, of which 4 were simulated:"), "{searched}");
    let screen = table(&found, "screen.csv");
    let counted = |rungs: &str| screen.iter().filter(|row| row["rungs"] == rungs).count();
    assert_eq!((counted("0"), counted("1"), counted("2"), table(&found, "machines.csv").len()), (8, 8, 8, 4 * 5));
    // What was simulated whole is what the grid has.
    let rows = |folder: &str| table(&home.path().join(folder), "machines.csv");
    let whole = rows("grid");
    let same = |row: &BTreeMap<String, String>| {
        let is_it =
            |other: &&BTreeMap<String, String>| ["machine", "trace", "frame"].iter().all(|key| other[*key] == row[*key]);
        whole.iter().find(is_it).is_some_and(|other| other["cycles"] == row["cycles"])
    };
    assert!(rows("search").iter().all(same));

    // Killed on the second rung, in the middle of a line: the same bytes for any number of threads.
    let wanted = files(&found);
    let part = home.path().join("killed");
    killed(&part, &wanted, None);
    fs::write(part.join("rung-1-of-2.jsonl"), &wanted["rung-1-of-2.jsonl"]).expect("written");
    let second = String::from_utf8(wanted["rung-2-of-2.jsonl"].clone()).expect("text");
    let lines: Vec<&str> = second.lines().collect();
    fs::write(part.join("rung-2-of-2.jsonl.part"), format!("{}\n{}", lines[5], &lines[2][..40])).expect("written");
    let (again, _) = asked("killed", &["--search", "halving:16", "--threads", "1"]);
    assert!(files(&again) == wanted, "the interrupted search differs");
    let out = home.path().join("shard").display().to_string();
    let message = refused(&[
        "sweep",
        "traces/cube",
        "--vary",
        "core.warps=1,2",
        "--search",
        "halving:8",
        "--shard",
        "1/2",
        "--out",
        &out,
    ]);
    assert!(message.contains("--search") && message.contains("--shard"), "{message}");
}

#[test]
fn area_is_a_cost_and_the_front_has_a_tolerance() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    let axes = ["--vary", "texture.cache_lines=16..1024*2", "--vary", "core.warps=1,64"];
    let asked = ["sweep", "traces/shadow", "--config", "four-pipelines", "--cost", "area", "--out", &out];
    let (code, text, message) = run(&[&asked[..], &axes].concat());
    assert_eq!(code, 0, "{message}");
    let rows = table(home.path(), "machines.csv");
    let points: Vec<[f64; 2]> =
        rows.iter().map(|row| ["cycles", "cost"].map(|name| row[name].parse().expect("a number"))).collect();
    let at = |warps: &str, lines: &str| {
        let is_it = |row: &&BTreeMap<String, String>| row["core.warps"] == warps && row["texture.cache_lines"] == lines;
        rows.iter().find(is_it).expect("a machine")["cost"].parse::<f64>().expect("a cost")
    };
    assert!(at("64", "32") > at("64", "16") && at("64", "16") > at("1", "16"), "{points:?}");
    let section = text.split("\n## Cycles against cost: ").nth(1).expect("a section").split("\n## ").next().expect("its text");
    let front: Vec<usize> =
        section.lines().filter_map(|line| line.strip_prefix("| ")?.split(' ').next()?.parse().ok()).collect();
    assert!(section.contains("Machines within 1 % of each other in both count as one."), "{section}");
    // All machines are worse than one of the front, by the tolerance at most better.
    for [cycles, cost] in &points {
        let stands = |&at: &usize| points[at][0] <= 1.01 * cycles && points[at][1] <= 1.01 * cost;
        assert!(front.iter().any(stands), "{cycles} {cost}: {section}");
    }
    assert!(front.len() > 1 && front.len() < rows.len(), "{section}");
    let page = fs::read_to_string(home.path().join("report.html")).expect("a page");
    assert!(
        page.contains("area in bytes of SRAM") && page.contains("Machines within 1 % of each other"),
        "the page says so, too"
    );
}

#[test]
fn a_screen_that_is_killed_begins_again_and_ends_with_the_same_bytes() {
    let home = tempfile::tempdir().expect("a folder");
    let whole = home.path().join("whole");
    assert_eq!(sweep(&whole, &["--screen", "2"]).0, LACKING);
    let wanted = files(&whole);
    let journal = String::from_utf8(wanted["shard-1-of-1.jsonl"].clone()).expect("text");
    // While machines are estimated, the folder has no results; then it has some, the last of which is cut off.
    let some = format!("{}\n{}", journal.lines().nth(1).expect("a machine"), &journal[..50]);
    for (name, lines, left) in [("estimating", None, 5), ("empty", Some(""), 5), ("simulating", Some(some.as_str()), 4)] {
        let part = home.path().join(name);
        killed(&part, &wanted, lines);
        let (code, text, message) = sweep(&part, &["--screen", "2"]);
        assert_eq!(code, LACKING, "{message}");
        assert!(text.contains("6 machines estimated"), "{text}");
        let failed = journal.lines().filter(|line| line.contains("memory.l2.slices is 3")).count();
        let done = usize::from(lines.is_some_and(|lines| lines.contains("l2.slices is 3")));
        assert!(text.contains(&format!("{} machine", left - (failed - done))), "{failed} {done}: {text}");
        assert!(files(&part) == wanted, "{name}: the interrupted sweep differs");
    }
    // A process that is killed at any time.
    for patience in [0, 20, 60] {
        let part = home.path().join(patience.to_string());
        let mut command = std::process::Command::new(assert_cmd::cargo::cargo_bin!("fillrate"));
        command.current_dir(env!("CARGO_MANIFEST_DIR")).args(["sweep", "traces/cube", "--screen", "2"]).args(AXES);
        let quiet = std::process::Stdio::null;
        let mut process = command.arg("--out").arg(&part).stdout(quiet()).stderr(quiet()).spawn().expect("it starts");
        while !part.join("inputs.json").exists() && process.try_wait().expect("a process").is_none() {
            std::thread::sleep(std::time::Duration::from_millis(1));
        }
        std::thread::sleep(std::time::Duration::from_millis(patience));
        // It may have ended.
        let _ = process.kill();
        process.wait().expect("it has ended");
        let (code, _, message) = sweep(&part, &["--screen", "2"]);
        assert_eq!(code, LACKING, "{message}");
        assert!(files(&part) == wanted, "killed after {patience} ms: the interrupted sweep differs");
    }
}

#[test]
fn a_machine_can_be_replayed_alone() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("s");
    assert_eq!(sweep(&out, &[]).0, LACKING);
    let name = out.display().to_string();
    let mut replayed = 0;
    for row in table(&out, "machines.csv") {
        let config = ["sweep", "config", &name, &row["machine"]];
        if !row["error"].is_empty() {
            assert!(refused(&config).contains("cannot be built: memory.l2.slices is 3"));
            continue;
        }
        let (code, text, message) = run(&config);
        assert_eq!(code, 0, "{message}");
        // What is printed is what the hash in the table is of, and what stands beside the results.
        assert_eq!(fillrate::sweep::inputs::hash(text.as_bytes()), row["config_hash"]);
        assert_eq!(fs::read_to_string(out.join(format!("configs/{}.ron", row["machine"]))).expect("a file"), text);
        let file = home.path().join("machine.ron");
        fs::write(&file, text).expect("written");
        let (file, one) = (file.display().to_string(), home.path().join("r").display().to_string());
        assert_eq!(run(&["replay", "traces/cube", "--config", &file, "--out", &one]).0, 0);
        let json: serde_json::Value =
            serde_json::from_slice(&fs::read(Path::new(&one).join("stats.json")).expect("statistics")).expect("JSON");
        assert_eq!(json["total"]["cycles"].to_string(), row["cycles"]);
        replayed += 1;
    }
    assert_eq!(replayed, 3);
    let message = refused(&["sweep", "config", &name, "6"]);
    assert!(message.contains("has no machine 6; it has 6, numbered from 0"), "{message}");
    let message = refused(&["sweep", "config", "traces/cube", "0"]);
    assert!(message.contains("no folder of a sweep"), "{message}");
}

#[test]
fn traces_in_several_orders_are_an_axis() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("out").display().to_string();
    let (code, text, message) = run(&["sweep", "configs/experiments/depth.ron", "--out", &out]);
    assert_eq!(code, 0, "{message}");
    for told in [
        "Of 3 machines number 2 (`depth.early=true traverse.hierarchical_z=true`) is the fastest",
        "* `depth order` is best at layers-front-first and worst at layers-back-first",
        "`share of fragments shaded` is smallest",
        "On layers-front-first, it goes from 1 at false to 0.1000 at true (-90.0 %). \
         On layers-random, it goes from 1 at false to 0.2969 at true (-70.3 %). On layers-back-first, it is 1 at all values.",
        "On layers-front-first, it goes from 0 at false to 0.8674 at true",
        "### Cycles by `depth.early` and depth order\n\n| | layers-front-first | layers-random | layers-back-first |",
        "* measure `share of fragments shaded = funnel.fragments_shaded/funnel.fragments_covered`",
    ] {
        assert!(text.contains(told), "{told}: {text}");
    }
    // Without early tests the order makes no difference, and neither does hierarchical Z with the front last.
    assert!(
        text.contains("  With `depth.early` at true, ") && text.contains(" At false, its values make no difference.\n"),
        "{text}"
    );
    let page = fs::read_to_string(Path::new(&out).join("report.html")).expect("a page");
    assert!(page.contains("By depth order</h2>") && page.contains("Cycles by depth order and depth.early"), "plots by trace");

    let out = home.path().join("reuse").display().to_string();
    let (code, text, message) = run(&["sweep", "configs/experiments/vertex-reuse.ron", "--out", &out]);
    assert_eq!(code, 0, "{message}");
    for told in [
        "On torus-bands, it goes from 1 at 0 to 0.1980 at 128 (-80.2 %); from 16 on it is within 5 % of its last value. ",
        "On torus-rows, it goes from 1 at 0 to 0.1701 at 128 (-83.0 %); from 64 on it is within 5 % of its last value. ",
    ] {
        assert!(text.contains(told), "{told}: {text}");
    }
    let plots = ["report", &out, "--plots"];
    assert_eq!(run(&plots).0, 0);
    let curve = fs::read_to_string(Path::new(&out).join("plots/trace-measure-1-fetch.reuse.svg")).expect("a plot");
    assert!(["torus-bands", "torus-rows", "torus-random"].iter().all(|trace| curve.contains(trace)), "a curve for each trace");
}

#[test]
fn every_statistic_of_the_long_table_has_a_unit_of_measure() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    let (code, _, message) = run(&["sweep", "traces/triangle", "--vary", "sort=all", "--out", &out]);
    assert_eq!(code, 0, "{message}");
    let rows = table(home.path(), "long.csv");
    let unknown: Vec<_> = rows.iter().filter(|row| row["measure"].is_empty()).collect();
    assert!(rows.len() > 1000 && unknown.is_empty(), "{unknown:?}");
    assert!(rows.iter().any(|row| row["counter"] == "overlap" && row["measure"] == "ratio"));
}

#[test]
fn a_screen_estimates_every_sort_class() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("classes").display().to_string();
    let (code, text, message) = run(&["sweep", "traces/triangle", "--vary", "sort=all", "--screen", "4", "--out", &out]);
    assert_eq!(code, 0, "{message}");
    assert!(text.contains("5 machines were estimated by `bound`, and 4 simulated; 0 of these have no estimate"), "{text}");
    // The slowest is not simulated; how far the others' estimates are off stands by class.
    let classes: Vec<&str> = text.lines().skip_while(|line| !line.contains("| sort class |")).skip(2).collect();
    let named = |class: &str| classes.iter().any(|line| line.starts_with(&format!("| {class} | 1 |")));
    assert!(named("sort-first") && named("sort-middle-binned") && !named("sort-last-image"), "{text}");
}

#[test]
fn an_experiment_in_a_file_is_the_same_as_its_options() {
    let home = tempfile::tempdir().expect("a folder");
    let (options, written) = (home.path().join("options"), home.path().join("written"));
    let file = home.path().join("caches.ron");
    let text = "// Why?\n(\n    traces: [\"traces/cube\"],\n    set: [\"scanout.enabled=false\"],\n    \
                vary: [\"memory.l2.slices=3,16\", \"texture.cache_lines=16..256*4\"],\n    keep: [\"caches.texture\"],\n)\n";
    fs::write(&file, text).expect("written");
    assert_eq!(sweep(&options, &[]).0, LACKING);
    let [file, out] = [&file, &written].map(|path| path.display().to_string());
    assert_eq!(run(&["sweep", &file, "--out", &out]).0, LACKING);
    assert!(files(&options) == files(&written));
    let message = refused(&["sweep", &file, "--vary", "pipelines=1", "--out", &out]);
    assert!(message.contains("--vary is part of the experiment"), "{message}");
    fs::write(&file, text.replace("slices", "slises")).expect("written");
    let message = refused(&["sweep", &file, "--out", &out]);
    assert!(message.contains("caches.ron") && message.contains("memory.l2.slices is the nearest"), "{message}");
}

#[test]
fn wrong_pixels_of_a_machine_that_keeps_its_order_are_a_fault() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("s");
    assert_eq!(sweep(&out, &[]).0, LACKING);
    let results = out.join("shard-1-of-1.jsonl");
    let text = fs::read_to_string(&results).expect("results");
    let marked: Vec<String> = text
        .lines()
        .map(|line| match line.contains("\"machine\":4,") {
            true => line.replace("\"wrong_pixels\":0", "\"wrong_pixels\":7"),
            false => line.to_owned(),
        })
        .collect();
    fs::write(&results, marked.join("\n") + "\n").expect("written");
    // The tables are made again from the results.
    let (code, _, message) = sweep(&out, &[]);
    assert_eq!(code, 1, "{message}");
    let told = "error: machine 4: 7 pixels are not those of functional rendering, and this machine keeps its order. This is a fault of Fillrate";
    assert!(message.contains(told) && message.matches("pixels").count() == 1, "{message}");
}

#[test]
fn bad_input_is_refused_with_its_place() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("out").display().to_string();
    let cube = |more: &[&str]| refused(&[&["sweep", "traces/cube", "--out", &out], more].concat());
    for (more, told) in [
        (&["--vary", "pipelnes=1..4"][..], "pipelines is the nearest"),
        (&["--vary", "pipelines="], "the axis pipelines has an empty value"),
        (&["--vary", "pipelines=1..65"], "the axis pipelines has the value 65, and must be a whole number from 1 to 64"),
        (&["--vary", "pipelines=3", "--link", "geometry_units=pipelines/2"], "3 / 2 is no whole number"),
        (&["--vary", "memory.dram.t_refi=0..99999", "--vary", "pipelines=1..64"], "6400000 machines; more than 1000000"),
        (&["--vary", "pipelines=1", "--frames", "7"], "traces/cube has no frame 7; it has 1, numbered from 0"),
        (&["--vary", "pipelines=1", "--shard", "3/2"], "I from 1 to N"),
        (&["--vary", "pipelines=1", "--design", "grit"], "one-at-a-time"),
        (&["--vary", "pipelines=1", "--measure", "caches.texture.mises"], "caches.texture.mises, which is no statistic"),
        (
            &["--vary", "pipelines=1", "--keep", "funnel", "--measure", "cycles/caches.depth.hits"],
            "reads caches.depth.hits, which the experiment does not keep",
        ),
        (&["--vary", "pipelines=1", "--measure", "1+"], "the measure `1+` ends where"),
    ] {
        let message = cube(more);
        assert!(message.contains(told), "{more:?}: {message}");
    }
    let out = home.path().join("other");
    assert_eq!(sweep(&out, &[]).0, LACKING);
    let before = files(&out);
    let message = refused(&["sweep", "traces/cube", "--vary", "pipelines=2", "--out", &out.display().to_string()]);
    for told in [
        "holds the results of another experiment: scanout.enabled of the base configuration: false there, true here; ",
        "axis texture.cache_lines: 16..256*4 there, none here; axis pipelines: none there, 2 here; ",
        "kept statistics: caches.texture there, none here; use another --out, remove that folder, or go on",
    ] {
        assert!(message.contains(told), "{message}");
    }
    assert!(files(&out) == before, "nothing is lost");
    let message = refused(&["sweep", "merge", "traces/cube"]);
    assert!(message.contains("no folder of a sweep"), "{message}");

    // A shard that lacks a machine, one that has it twice, and one that has another's.
    let (file, whole) =
        (out.join("shard-1-of-1.jsonl"), String::from_utf8(before["shard-1-of-1.jsonl"].clone()).expect("text"));
    let merged = |text: &str| {
        fs::write(&file, text).expect("written");
        refused(&["sweep", "merge", &out.display().to_string()])
    };
    let lines: Vec<&str> = whole.lines().collect();
    let message = merged(&format!("{}\n", lines[1..].join("\n")));
    assert!(message.contains("no result of machine 0 on trace 0") && message.contains("--shard 1/1"), "{message}");
    let message = merged(&format!("{whole}{}\n", lines[2]));
    assert!(message.contains("jsonl:7: machine 2 has two results on trace 0"), "{message}");
    let message = merged(&format!("{whole}{}\n", lines[2].replacen("\"machine\":2", "\"machine\":9", 1)));
    assert!(message.contains("has 7 results, and the experiment 6"), "{message}");
}

#[test]
fn every_experiment_of_the_repository_has_a_question_and_machines() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = 0;
    for entry in fs::read_dir(root.join("configs/experiments")).expect("a folder") {
        let path = entry.expect("an entry").path();
        let text = fs::read_to_string(&path).expect("text");
        let experiment = Experiment::open(&path).expect("an experiment");
        let first = text.lines().next().expect("a line");
        // The question, and perhaps who asked it first.
        let asked = format!("// {}", experiment.question);
        assert!(first.starts_with(&asked) && asked.ends_with('?'), "{}: {first}", path.display());
        // They run in every folder.
        let is_built_in = |trace: &String| trace.strip_prefix('@').is_some_and(|name| scenes::named(name).is_some());
        assert!(experiment.traces.iter().all(is_built_in), "{}", path.display());
        let name = path.file_stem().and_then(|name| name.to_str()).expect("a name");
        let built_in = BUILT_IN.iter().find(|own| own.name == name).expect("each is built in");
        assert!(built_in.text == text && built_in.question().starts_with(&experiment.question), "{name}");
        let mut base = Config::built_in(&experiment.base).expect("it is built in");
        experiment.set.iter().for_each(|setting| base.set(setting).expect("a knob"));
        let plan = Plan::new(base, &experiment, 1000).expect("a plan");
        let machines = (0..plan.len()).filter(|&number| plan.machine(number).expect("a machine").config.is_ok()).count();
        assert!(machines > 1 && 2 * machines > plan.len() as usize, "{}: {machines} of {}", path.display(), plan.len());
        found += 1;
    }
    assert_eq!(found, 8);
}

/// `tests/slurm.sh`: a job array of a real Slurm. It starts services, so it runs only on request.
#[test]
fn a_job_array_leaves_what_one_process_leaves() {
    if std::env::var_os("FILLRATE_SLURM").is_none() {
        eprintln!("left out: a job array of Slurm runs where FILLRATE_SLURM is set (tests/slurm.sh)");
        return;
    }
    let mut command = std::process::Command::new("sh");
    command.arg("tests/slurm.sh").arg(assert_cmd::cargo::cargo_bin!("fillrate")).current_dir(env!("CARGO_MANIFEST_DIR"));
    let done = command.output().expect("sh runs");
    let text = String::from_utf8_lossy(&done.stdout).into_owned() + &String::from_utf8_lossy(&done.stderr);
    match done.status.code() {
        Some(0) => {}
        Some(77) => eprintln!("{}", text.trim()),
        code => panic!("{code:?}: {text}"),
    }
}

#[test]
fn variables_conditions_cost_and_measures_are_in_the_tables_and_in_the_answer() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("s");
    let name = out.display().to_string();
    let (code, _, message) = run(&[
        "sweep",
        "traces/cube",
        "--config",
        "tiny",
        "--let",
        "size=1024..8192*2",
        "--vary",
        "texture.line_bytes=64,128",
        "--link",
        "texture.cache_lines=size/texture.line_bytes",
        "--where",
        "texture.cache_lines<=64",
        "--cost",
        "texture.cache_lines*texture.line_bytes",
        "--measure",
        "miss rate=caches.texture.misses/caches.texture.accesses",
        "--out",
        &name,
    ]);
    assert_eq!(code, 0, "{message}");
    let rows = table(&out, "machines.csv");
    assert_eq!(rows.len(), 7, "8,192 bytes in lines of 64 are 128 lines");
    for row in &rows {
        let number = |column: &str| row[column].parse::<f64>().expect(column);
        assert_eq!(number("size"), number("texture.cache_lines") * number("texture.line_bytes"));
        assert!(number("texture.cache_lines") <= 64.0 && number("cost") == number("size"));
        let rate = number("caches.texture.misses") / number("caches.texture.accesses");
        assert!((number("miss rate") - rate).abs() < 1e-12);
    }
    // The answer names the machine of least cost within 1 % of the fastest.
    let cycles = |row: &BTreeMap<String, String>| row["cycles"].parse::<f64>().expect("cycles");
    let best = rows.iter().map(cycles).fold(f64::INFINITY, f64::min);
    let close = rows.iter().filter(|row| cycles(row) <= 1.01 * best);
    let least = close.map(|row| row["cost"].parse::<u64>().expect("a cost")).min().expect("the fastest");
    let report = fs::read_to_string(out.join("report.md")).expect("a report");
    let grouped = if least < 1000 { least.to_string() } else { format!("{},{:03}", least / 1000, least % 1000) };
    assert!(report.contains(&format!("`texture.cache_lines*texture.line_bytes` is {grouped}")), "{report}");
    assert!(report.contains("within 1 % of") && report.contains(" One combination does not meet the conditions"), "{report}");
    assert!(report.contains("* variable `size=1024..8192*2`") && report.contains("* condition `texture.cache_lines<=64`"));
    // The experiment that the folder keeps is the same one.
    let again = home.path().join("again").display().to_string();
    assert_eq!(run(&["sweep", &format!("{name}/experiment.ron"), "--out", &again]).0, 0);
    assert!(files(&out) == files(Path::new(&again)));
}
