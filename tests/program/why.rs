//! `fillrate why` finds the resource that a test made scarce on purpose, and the gain that it states is that of a replay.

use std::path::Path;

use fillrate::machine::Config;
use fillrate::report::summary::grouped;
use fillrate::run::replay::{Fidelity, Options, replay};
use fillrate::trace::Trace;
use fillrate::why::why;

use crate::cli::{refused, run};

/// Cores that hold nothing back.
const FAST: [&str; 3] = ["core.per_pipeline=4", "core.float_lanes=512", "core.integer_lanes=512"];

/// A trace, the resource that is made scarce, and the title of the change that gains most.
const SCARCE: &[(&str, &[&str], &str)] = &[
    ("cube", &["core.float_lanes=8"], "core: twice as fast"),
    ("cube", &["core.warps=1"], "core: twice as much in flight"),
    (
        "cube",
        &["texture.filters_per_cycle=1", "texture.quads_per_cycle=1", "texture.lookups_per_cycle=1"],
        "texture: twice as fast",
    ),
    ("cube", &["texture.misses=1"], "texture: twice as much in flight"),
    ("viewer.zip", &["fetch.lookups_per_cycle=1"], "fetch: twice as fast"),
    (
        "panel.zip",
        &["memory.port_latency=1000", "memory.l2.latency=1000", "memory.dram.latency=1000"],
        "half the memory latency",
    ),
    ("panel.zip", &["memory.kind=ideal", "memory.ideal_bytes_per_cycle=4"], "twice the memory bandwidth"),
    ("panel.zip", &["memory.port_width=8"], "memory: twice as wide ports and slices"),
    ("panel.zip", &["command.command_cycles=20000"], "command: twice as fast"),
    ("panel.zip", &["command.barrier_cycles=60000"], "command: barriers half as long"),
    ("panel.zip", &["color.fast_clear=false"], "fast clears"),
    ("torus-knot.zip", &["setup.interval=16"], "setup: twice as fast"),
    ("cube", &[FAST[0], FAST[1], FAST[2], "interpolate.words_per_cycle=1"], "interpolate: twice as fast"),
    (
        "layers-back-first.zip",
        &[FAST[0], FAST[1], FAST[2], "color.quads_per_cycle=1", "color.blends_per_cycle=1"],
        "color: twice as fast",
    ),
    ("cube", &["memory.port_queue=2"], "memory: twice as many requests in flight"),
    (
        "cube",
        &[FAST[0], FAST[1], FAST[2], "texture.cache_lines=8", "texture.cache_ways=4"],
        "texture: a cache that is never full",
    ),
    (
        "cube",
        &[FAST[0], FAST[1], FAST[2], "texture.cache_lines=8", "texture.cache_ways=4", "memory.l2.lines=16"],
        "memory.l2: a cache that is never full",
    ),
    ("cube", &["distribute.tile=1024"], "screen tiles an eighth as wide"),
    ("spokes-msaa", &["resolve.block_cycles=256"], "resolve: twice as fast"),
    ("layers-front-first.zip", &["depth.early=false", "traverse.hierarchical_z=false", "core.float_lanes=8"], "early Z"),
];

#[test]
fn a_scarce_resource_of_a_unit_is_found_and_the_gain_is_that_of_a_replay() {
    found(&SCARCE[..5]);
}

#[test]
fn a_scarce_resource_of_memory_is_found_and_the_gain_is_that_of_a_replay() {
    found(&SCARCE[5..8]);
}

#[test]
fn a_scarce_resource_of_commands_is_found_and_the_gain_is_that_of_a_replay() {
    found(&SCARCE[8..11]);
}

#[test]
fn a_scarce_resource_of_pixels_is_found_and_the_gain_is_that_of_a_replay() {
    found(&SCARCE[11..]);
}

fn found(machines: &[(&str, &[&str], &str)]) {
    // Each asks some sixty machines: the usual suite takes every third.
    let step = if std::env::var_os("FILLRATE_SLOW").is_some() { 1 } else { 3 };
    for (name, scarce, title) in machines.iter().step_by(step) {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("traces").join(name);
        let trace = Trace::open(path).expect("the trace is there");
        let mut config = Config::built_in("four-pipelines").expect("it is built in");
        for setting in ["scanout.enabled=false"].iter().chain(*scarce) {
            config.set(setting).expect("a knob");
        }
        config.check().expect("a machine");
        let found = why(&trace, &config, 0..1, false, &|_| ()).expect("it runs");
        let first = &found.gains[0];
        assert_eq!(first.relaxation.title, *title, "{scarce:?}: {}", found.verdict());
        assert!(first.share(&found.base).expect("it ran") > 0.1, "{scarce:?}: {}", found.verdict());

        let relaxed = first.relaxation.of(&config).expect("a machine");
        let cycles = |config: &Config| {
            let options = Options { frames: 0..1, ..Options::new(config.clone(), Fidelity::Cycle) };
            replay(&trace, &options, &|_| ()).expect("it runs").total.number("cycles")
        };
        assert_eq!(cycles(&config), Some(found.base.cycles as f64), "{scarce:?}");
        let promised = first.timed.as_ref().expect("it ran").cycles;
        assert_eq!(cycles(&relaxed), Some(promised as f64), "{scarce:?}");
    }
}

/// What reading a frame costs is the same for every frame of its size, so that it says nothing of the frame unless it is asked for.
#[test]
fn scan_out_is_ranked_where_it_is_asked_for() {
    let of = |options: &[&str]| {
        let (code, text, message) = run(&[&["why", "traces/triangle", "--config", "four-pipelines"], options].concat());
        assert_eq!(code, 0, "{message}");
        text
    };
    let text = of(&[]);
    let head = text.lines().next().expect("a line");
    assert!(head.ends_with(" of them scan-out, which --scan-out ranks too"), "{head}");
    assert!(!text.contains("scanout."), "{text}");
    let text = of(&["--scan-out"]);
    assert!(text.lines().next().is_some_and(|line| line.ends_with(" cycles")), "{text}");
    assert!(text.contains("No scan-out (`scanout.enabled=false`) saves "), "{text}");
    let free =
        of(&["--set", "scanout.mode=free-running", "--set", "scanout.swap=immediate", "--set", "scanout.show_last=false"]);
    assert!(free.lines().next().is_some_and(|line| line.ends_with(" cycles")), "{free}");
}

#[test]
fn the_verdict_has_what_was_counted_and_the_knobs_to_set() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    // A card that asks for the indices of a draw when those of the one before are read: its small draws wait for memory.
    let set = ["--config", "four-pipelines", "--set", "fetch.runs=1"];
    let (code, replayed, message) = run(&[&["replay", "traces/town.zip", "--per-draw", "--out", &out], &set[..]].concat());
    assert_eq!(code, 0, "{message}");
    let json = std::fs::read(home.path().join("stats.json")).expect("statistics");
    let json: serde_json::Value = serde_json::from_slice(&json).expect("JSON");
    let pass = &json["frames"][0]["phases"][1];
    let count = |path: &str| pass.pointer(path).and_then(serde_json::Value::as_u64).expect(path);
    let draws = pass["draws"].as_array().expect("draws").iter().filter(|draw| !draw["number"].is_null());
    let unseen: Vec<u64> = draws
        .clone()
        .filter(|draw| draw["funnel"]["culled_frustum"] == draw["funnel"]["primitives_in"])
        .filter_map(|draw| draw["number"].as_u64())
        .collect();
    let draws = draws.count();

    let file = home.path().join("why.json").display().to_string();
    let (code, text, message) = run(&[&["why", "traces/town.zip", "--json", &file], &set[..]].concat());
    assert_eq!(code, 0, "{message}");
    let verdict = text.lines().nth(2).expect("a verdict");
    let [outside, all] = [count("/funnel/culled_frustum"), count("/funnel/primitives_in")];
    let cause = format!("{:.0} % of the primitives are off screen", 100.0 * outside as f64 / all as f64);
    assert!(verdict.starts_with(&format!("{cause}; not drawing them saves ")), "{verdict}");
    assert!(verdict.ends_with(&format!(" %. The rest waits for the indices of {draws} small draws.")), "{verdict}");
    // What counters prove, a replay says in the same words.
    let share = 100.0 * count("/units/fetch/memory") as f64 / count("/cycles") as f64;
    for told in [format!("{cause}."), format!("waits for indices: index fetch for memory {share:.0} %.")] {
        assert!(replayed.contains(&told), "{told}\n{replayed}");
    }
    let evidence = format!("{} of {} primitives of {draws} draws are out of view", grouped(outside), grouped(all));
    for told in ["\nin the frame\n", "\non the card\n", &evidence] {
        assert!(text.contains(told), "{told}\n{text}");
    }
    let found: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).expect("a file")).expect("JSON");
    assert_eq!(found["changes"][0]["most_in"], "pass 0");
    // The draws concerned are those of which no primitive is seen.
    assert_eq!(found["in_the_frame"][0]["draws"], serde_json::json!(unseen));
    assert!(found["on_the_card"].as_array().is_some_and(|list| !list.is_empty()), "{}", found["on_the_card"]);
}

#[test]
fn the_answer_is_printed_and_written() {
    let home = tempfile::tempdir().expect("a folder");
    let file = home.path().join("why.json").display().to_string();
    let (code, text, message) = run(&["why", "traces/triangle", "--config", "tiny", "--json", &file, "--rows", "2"]);
    assert_eq!(code, 0, "{message}");
    assert!(text.starts_with("traces/triangle on tiny, frame 0: "), "{text}");
    assert!(text.contains("proof of the first: replay the frame with --set "), "{text}");
    let json: serde_json::Value = serde_json::from_slice(&std::fs::read(&file).expect("a file")).expect("JSON");
    let changes = json["changes"].as_array().expect("changes");
    assert!(changes.len() > 30 && changes[0]["gain"].as_f64() >= changes[1]["gain"].as_f64());
    let phases: u64 =
        json["phases"].as_array().expect("phases").iter().map(|phase| phase["cycles"].as_u64().expect("cycles")).sum();
    assert_eq!(json["cycles"], phases, "phases add up");
    let message = refused(&["why", "traces/triangle", "--frames", "5"]);
    assert!(message.contains("no frame 5; it has 1,"), "{message}");
}
