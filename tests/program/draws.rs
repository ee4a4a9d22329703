//! Passes and draws in the files of a replay.

use std::fs;
use std::path::Path;

use fillrate::gfx::format::Format;
use fillrate::num::CallSite;
use fillrate::record::{self, Recorder};
use fillrate::render;
use fillrate::report::summary::{bytes, grouped};
use serde_json::Value;

use crate::cli::{refused, run};

/// Replays into a folder; the report and `stats.json`.
fn replayed(out: &Path, more: &[&str]) -> (String, Value) {
    let folder = out.display().to_string();
    let (code, report, message) =
        run(&[&["replay", "traces/town.zip", "--config", "four-pipelines", "--out", &folder], more].concat());
    assert_eq!(code, 0, "{message}");
    let text = fs::read_to_string(out.join("stats.json")).expect("statistics");
    (report, serde_json::from_str(&text).expect("JSON"))
}

/// The sum of a column of a table, by its name.
fn column(text: &str, name: &str) -> u64 {
    let mut rows = text.lines().map(|row| row.split(',').collect::<Vec<_>>());
    let at = rows.next().expect("a header").iter().position(|&field| field == name).expect(name);
    rows.map(|row| row[at].parse::<u64>().expect("a number")).sum()
}

/// Every counter stands in a text, by its value.
fn told(value: &Value, path: &str, text: &str) {
    match value {
        Value::Object(map) => map.iter().for_each(|(name, value)| told(value, &format!("{path}.{name}"), text)),
        value => {
            let count = value.as_u64().expect("a count");
            let readable = if path.ends_with("_bytes") { bytes(count as f64) } else { grouped(count) };
            // The whole number, not digits of another one.
            let digit = |c: Option<char>| c.is_some_and(|c| c.is_ascii_digit());
            let alone = text.match_indices(&readable).any(|(at, found)| {
                let (before, mut behind) = (text[..at].chars().next_back(), text[at + found.len()..].chars());
                let next = behind.next();
                let goes_on = digit(next) || matches!(next, Some(',' | '.')) && digit(behind.next());
                !digit(before) && !matches!(before, Some(',' | '.')) && !goes_on
            });
            assert!(alone, "{path} is {readable}: {text}");
        }
    }
}

#[test]
fn draws_add_up_to_their_passes_in_every_file_and_change_nothing_else() {
    let out = tempfile::tempdir().expect("a folder");
    let (with, without) = (out.path().join("with"), out.path().join("without"));
    let (report, mut json) = replayed(&with, &["--per-draw"]);
    let (plain, expected) = replayed(&without, &[]);
    assert!(report.contains("The draws that took most, from one retirement to the next\n  draw 390 one "), "{report}");
    assert!(!plain.contains("The draws that took most"), "{plain}");

    let frame = &mut json["frames"][0];
    let cycles = frame["cycles"].as_u64().expect("cycles");
    let phases = frame["phases"].as_array_mut().expect("phases");
    let (mut drawn, mut shaded) = (0, 0);
    for phase in phases.iter_mut() {
        let Some(Value::Array(draws)) = phase.as_object_mut().expect("a phase").shift_remove("draws") else { continue };
        drawn += draws.len();
        let sum = |path: &str| draws.iter().map(|draw| draw.pointer(path).and_then(Value::as_u64).unwrap_or(0)).sum::<u64>();
        for path in
            ["/cycles", "/funnel/fragments_shaded", "/units/core/busy", "/caches/l2/hits", "/memory/clients/texture/read_bytes"]
        {
            assert_eq!(Some(sum(path)), phase.pointer(path).and_then(Value::as_u64), "{path}");
        }
        shaded += sum("/funnel/fragments_shaded");
        assert_eq!(draws.last().expect("an end")["number"], Value::Null);
    }
    assert_eq!(drawn, 399, "398 draws, and the end of the pass");
    assert_eq!(json, expected, "but for its draws");

    let [passes, draws] = ["passes.csv", "draws.csv"].map(|name| fs::read_to_string(with.join(name)).expect(name));
    assert_eq!(column(&passes, "cycles"), cycles);
    assert_eq!((column(&passes, "funnel.fragments_shaded"), column(&draws, "funnel.fragments_shaded")), (shaded, shaded));
    assert_eq!(draws.lines().count(), drawn + 1);
    assert_eq!(passes, fs::read_to_string(without.join("passes.csv")).expect("a table"));
    assert!(!without.join("draws.csv").exists());

    // All of it stands on the terminal, too, when it is asked for.
    let statistics: Value = serde_json::from_slice(&fs::read(with.join("stats.json")).expect("statistics")).expect("JSON");
    let folder = with.display().to_string();
    let pass = &statistics["frames"][0]["phases"][1];
    let draw = pass["draws"].as_array().expect("draws").iter().find(|draw| draw["number"] == 390).expect("a draw");
    for (asked, part) in [(["--phase", "pass 0"], pass), (["--draw", "390"], draw)] {
        let (code, text, message) = run(&[&["report", &folder], &asked[..]].concat());
        assert_eq!(code, 0, "{message}");
        for name in ["funnel", "units", "caches", "shading", "memory"] {
            told(&part[name], name, &text);
        }
        assert!(text.contains(&format!(": {} cycles, ", grouped(part["cycles"].as_u64().expect("cycles")))), "{text}");
        // The trace is there, so that the state of a draw follows.
        assert_eq!(text.contains("\nRasteriser\n  culls "), asked[0] == "--draw", "{text}");
    }
    let (_, text, _) = run(&["report", &folder, "--phase", "all"]);
    for phase in ["transfers of frame 0: ", "pass 0 of frame 0: ", "scan-out of frame 0: "] {
        assert!(text.contains(phase), "{text}");
    }
    for (asked, told) in [
        (&["--phase", "pass 7"][..], "has no phase `pass 7`: it has `transfers`, `pass 0`, `scan-out`"),
        (&["--draw", "398"], "has no draw 398: its draws are 0 to 397"),
        (&["--phase", "all", "--frame", "1"], "has no frame 1"),
        (&["--frame", "0"], "--frame applies to --phase, --draw and --groups only"),
    ] {
        let message = refused(&[&["report", &folder], asked].concat());
        assert!(message.contains(told), "{message}");
    }
    let message = refused(&["report", &without.display().to_string(), "--draw", "0"]);
    assert!(message.contains("replay with --per-draw"), "{message}");

    // Draws of an earlier replay do not survive.
    replayed(&with, &[]);
    assert!(!with.join("draws.csv").exists());
}

#[test]
fn draws_of_a_tiler_share_its_cycles_by_their_work() {
    let out = tempfile::tempdir().expect("a folder");
    let (report, json) = replayed(out.path(), &["--per-draw", "--set", "sort=sort-middle-binned"]);
    assert!(report.contains("by their share of the work of all that retired with them"), "{report}");
    let pass = &json["frames"][0]["phases"][1];
    let draws = pass["draws"].as_array().expect("draws");
    let of = |draw: &Value, path: &str| draw.pointer(path).and_then(Value::as_u64).unwrap_or(0);
    let sum = |path: &str| draws.iter().map(|draw| of(draw, path)).sum::<u64>();
    assert_eq!(sum("/cycles"), of(pass, "/cycles"), "draws add up to their pass");
    assert_eq!(sum("/geometry_cycles") + sum("/tile_cycles"), sum("/cycles"));
    assert_eq!(sum("/units/core/busy"), of(pass, "/units/core/busy"), "the end of the pass has what no draw has");
    for draw in draws.iter().filter(|draw| !draw["number"].is_null()) {
        let drawn = of(draw, "/funnel/triangles_setup") + of(draw, "/funnel/quads_rasterized") > 0;
        assert!(drawn || of(draw, "/tile_cycles") == 0, "a draw without a triangle costs tiles nothing: {draw}");
        assert!(draw.get("units").is_none(), "{draw}");
    }
    // No draw has the cycles of the others.
    let most = draws.iter().filter(|draw| !draw["number"].is_null()).map(|draw| of(draw, "/cycles")).max().unwrap_or(0);
    assert!(most < of(pass, "/cycles") / 4, "{most}");
    let rows = fs::read_to_string(out.path().join("draws.csv")).expect("a table");
    assert_eq!(column(&rows, "geometry_cycles") + column(&rows, "tile_cycles"), column(&rows, "cycles"));
}

#[test]
fn draws_are_shown_without_a_folder_and_are_not_ignored_in_silence() {
    let (code, shown, message) = run(&["replay", "traces/cube", "--per-draw", "--show", "draws"]);
    assert!(code == 0 && shown.contains("The draws that took most") && shown.contains("  draw 0 "), "{message}{shown}");
    let message = refused(&["replay", "traces/cube", "--per-draw", "--show", "funnel"]);
    assert!(message.contains("--per-draw applies to --out, --report, --timeline and --show draws only"), "{message}");
}

#[test]
fn draws_are_refused_where_no_cycle_is_simulated() {
    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().display().to_string();
    for fidelity in ["bound", "functional"] {
        let message = refused(&["replay", "traces/cube", "--per-draw", "--out", &folder, "--fidelity", fidelity]);
        assert!(message.contains("--per-draw applies to --fidelity cycle and sampled only"), "{message}");
    }
}

#[test]
fn an_error_names_the_call_of_the_recording() {
    let mut card = Recorder::new("wrong");
    let target = card.create_texture("target", record::texture_2d(8, 8, Format::Rgba8Unorm));
    let view = card.create_view(target);
    card.set_call_site(CallSite::Call(5024));
    {
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.draw(3, 1);
    }
    let error = render::render(&card.finish(), &render::Options::default(), &mut |_| Ok(())).unwrap_err().to_string();
    assert!(error.contains("Draw: ") && error.ends_with(" (call 5024 of the recording)"), "{error}");
}
