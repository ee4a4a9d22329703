//! Pages of replays and sweeps: their numbers are those of the files, text of a trace stays text, and bad input is reported.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use fillrate::machine::Config;
use fillrate::run::maps::{MapKind, Surface, details};
use fillrate::trace::Trace;
use serde_json::{Value, json};

use crate::cli::{refused, run};

/// A folder with a replay of a trace in it.
pub fn replayed(trace: &str, more: &[&str]) -> tempfile::TempDir {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    let (code, _, message) = run(&[&["replay", trace, "--out", &out], more].concat());
    assert_eq!(code, 0, "{message}");
    home
}

pub fn json_of(path: &Path) -> Value {
    serde_json::from_slice(&fs::read(path).expect("a file")).expect("JSON")
}

/// The number at a path such as `frames[0].funnel.quads_shaded`. `caches.texture[*].hits` is the sum over the list.
fn number(value: &Value, path: &str) -> Option<f64> {
    let Some((head, rest)) = path.split_once("[*]") else { return at(value, path)?.as_f64() };
    let list = at(value, head)?.as_array()?;
    let numbers: Vec<f64> = list.iter().filter_map(|element| number(element, rest.trim_start_matches('.'))).collect();
    (!numbers.is_empty()).then(|| numbers.iter().sum())
}

/// The value at a path of names and places in lists.
fn at<'v>(value: &'v Value, path: &str) -> Option<&'v Value> {
    path.split('.').try_fold(value, |value, step| {
        let (name, place) = step.split_once('[').map_or((step, None), |(name, place)| (name, place.strip_suffix(']')));
        let value = value.get(name)?;
        place.map_or(Some(value), |place| value.get(place.parse::<usize>().ok()?))
    })
}

/// The JSON that a page holds under an id.
fn embedded(page: &str, id: &str) -> Value {
    let begin = format!("<script type=\"application/json\" id=\"{id}\">");
    let text = page.split(&begin).nth(1).unwrap_or_else(|| panic!("no {id}")).split("</script>").next().expect("an end");
    serde_json::from_str(text).expect("JSON")
}

/// The value of an attribute of a tag.
fn attribute<'t>(tag: &'t str, name: &str) -> Option<&'t str> {
    tag.split(&format!(" {name}=\"")).nth(1)?.split('"').next()
}

/// All numbers of the tables of a page that say which statistic they are: path, value, and the text that is read.
fn cells(page: &str) -> Vec<(String, f64, String)> {
    let mut found = Vec::new();
    for piece in page.split('<').skip(1) {
        let Some((tag, text)) = piece.split_once('>') else { continue };
        if let (Some(path), Some(value)) = (attribute(tag, "data-path"), attribute(tag, "data-value")) {
            found.push((path.to_owned(), value.parse().expect("a number"), text.to_owned()));
        }
    }
    found
}

#[test]
fn the_numbers_of_a_page_are_those_of_the_json() {
    let home = replayed("traces/torus-knot.zip", &["--per-draw"]);
    let page = home.path().join("of-replay.html").display().to_string();
    let (code, _, message) = run(&["replay", "traces/torus-knot.zip", "--per-draw", "--report", &page]);
    assert_eq!(code, 0, "{message}");
    let folder = home.path().display().to_string();
    assert_eq!(run(&["report", &folder]).0, 0);
    let statistics = json_of(&home.path().join("stats.json"));
    for name in ["of-replay.html", "report.html"] {
        let page = fs::read_to_string(home.path().join(name)).expect("a page");
        assert!(page.len() < 5 << 20, "{name} has {} bytes", page.len());
        let own = embedded(&page, "statistics");
        assert_eq!(own["frames"][0], statistics["frames"][0], "{name}");
        assert_eq!(own["total"], statistics["total"], "{name}");
        // The charts over time add up to the accounts.
        let units = embedded(&page, "estimates")["timeline"]["units"].as_array().expect("a timeline").clone();
        assert!(units.len() > 10, "{name}");
        for unit in units {
            let bank = unit["unit"].as_str().expect("a name");
            for state in ["busy", "blocked", "memory"] {
                let sum: u64 = unit[state].as_array().expect("cycles").iter().filter_map(Value::as_u64).sum();
                assert_eq!(Some(sum as f64), number(&own["frames"][0], &format!("units.{bank}[*].{state}")), "{name}: {bank}");
            }
        }
        let cells = cells(&page);
        assert!(cells.len() > 100, "{name}: {} numbers", cells.len());
        for (path, value, text) in cells {
            assert_eq!(number(&statistics, &path), Some(value), "{name}: {path}");
            // Whole numbers are read as they are; bytes and times have a unit.
            if value.fract() == 0.0 && !text.ends_with('B') && !text.ends_with("ms") {
                assert_eq!(text.replace(',', ""), value.to_string(), "{name}: {path}");
            }
        }
        // How much a unit is used is no reason. What limits a pass stands in its row, and not in that of each draw.
        assert!(page.contains(">limited by<") && page.contains(">most used<") && !page.contains("usiest unit"), "{name}");
        assert!(!page.contains(">limit of its pass<"), "{name}");
        // Words of the page are explained. Wrong pixels stand first only where there are any.
        for term in
            ["limit", "transfers", "occupancy", "SIMT", "port", "slice", "roofline", "peak", "overdraw", "quad efficiency"]
        {
            assert!(page.contains(&format!("<dt>{term}</dt>")), "{name}: {term}");
        }
        for tile in ["frame time, ", "overdraw: fragments shaded per pixel", "quad efficiency", "of DRAM, "] {
            assert!(page.contains(&format!("<span>{tile}")), "{name}: {tile}");
        }
        assert!(!page.contains("<span>wrong pixels"), "{name}");
        // Each draw has a row that links find.
        let draws = own["frames"][0]["phases"].as_array().expect("phases").iter().filter_map(|phase| phase["draws"].as_array());
        let numbers: Vec<u64> = draws.flatten().filter_map(|draw| draw["number"].as_u64()).collect();
        assert!(!numbers.is_empty());
        for number in numbers {
            assert_eq!(page.matches(&format!(" id=\"draw-{number}\"")).count(), 1, "{name}: draw {number}");
        }
        for asked in ["http://", "https://", "@import", "url("] {
            let page =
                page.replace("xmlns=\"http://www.w3.org/2000/svg\"", "").replace("url(#plain)", "").replace("url(#sorts)", "");
            assert!(!page.contains(asked), "{name} asks for {asked}");
        }
    }
    let plots = home.path().join("plots");
    assert_eq!(run(&["report", &folder, "--plots"]).0, 0);
    for name in ["phases", "units", "roofline", "machine"] {
        let svg = fs::read_to_string(plots.join(format!("{name}.svg"))).expect("a plot");
        assert!(svg.starts_with("<svg") && svg.trim_end().ends_with("</svg>"), "{name}");
    }
}

/// The numbers in the last cells of the rows of a table whose head has this text in front, with the first of each row.
fn last_cells(page: &str, head: &str) -> Vec<(String, f64)> {
    let table = page.split(head).nth(1).expect("the table").split("</table>").next().expect("its end");
    let row = |row: &str| {
        let cells: Vec<&str> = row.split("<td").skip(1).collect();
        let name = cells.first()?.split('>').nth(1)?.split('<').next()?.to_owned();
        let value = cells.iter().rev().find_map(|cell| attribute(cell, "data-value"))?;
        Some((name, value.parse().ok()?))
    };
    table.split("<tr").filter_map(row).collect()
}

#[test]
fn shares_of_clients_add_up_to_that_of_all() {
    let home = replayed("traces/torus-knot.zip", &[]);
    assert_eq!(run(&["report", &home.path().display().to_string()]).0, 0);
    let page = fs::read_to_string(home.path().join("report.html")).expect("a page");
    let mut shares = last_cells(&page, "<h2>Memory</h2>");
    let (name, all) = shares.pop().expect("a row of all clients");
    assert!(name == "all clients" && shares.len() > 4 && all > 0.0, "{shares:?}");
    let sum: f64 = shares.iter().map(|(_, share)| share).sum();
    assert!((sum - all).abs() < 1e-9, "{sum}, {all}");
    // The peak of the baseline in bytes per cycle: 8 channels, each with 32 bytes in 2 cycles of a clock that ticks 1,753 times in 1,126 of the
    // card's cycles.
    let peak = 8.0 * 32.0 / 2.0 * 1753.0 / 1126.0;
    let statistics = json_of(&home.path().join("stats.json"));
    let frame = &statistics["frames"][0];
    let bytes: f64 = frame["memory"]["clients"]
        .as_object()
        .expect("clients")
        .values()
        .map(|client| client["read_bytes"].as_f64().unwrap_or(0.0) + client["write_bytes"].as_f64().unwrap_or(0.0))
        .sum();
    assert!((bytes / frame["cycles"].as_f64().expect("cycles") / peak - all).abs() < 1e-9, "{bytes}, {all}");
}

#[test]
fn the_slowest_of_several_frames_is_shown() {
    let home = replayed("traces/particles", &[]);
    let folder = home.path().display().to_string();
    assert_eq!(run(&["report", &folder]).0, 0);
    let statistics = json_of(&home.path().join("stats.json"));
    let cycles = |frame: &Value| frame["cycles"].as_u64().expect("cycles");
    let frames = statistics["frames"].as_array().expect("frames");
    let most = frames.iter().max_by_key(|frame| (cycles(frame), std::cmp::Reverse(frame["frame"].as_u64()))).expect("a frame");
    let page = fs::read_to_string(home.path().join("report.html")).expect("a page");
    assert!(page.contains(&format!("Frame {} of 4 frames", most["frame"])), "{}", &page[..400]);
    let own = embedded(&page, "statistics");
    let units =
        |value: &Value| value["frames"].as_array().expect("frames").iter().filter(|frame| frame.get("units").is_some()).count();
    assert_eq!((units(&own), units(&statistics)), (1, 4));
    for (path, value, _) in cells(&page) {
        assert_eq!(number(&statistics, &path), Some(value), "{path}");
    }
}

/// What a trace, or a file, may hold to get out of its place.
const HOSTILE: &str = "</script><img src=x onerror=alert(1)>\"'&<!--";

/// A copy of the triangle trace whose pass has a hostile label.
fn hostile(folder: &Path) -> String {
    let from = Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/triangle");
    for entry in fs::read_dir(from).expect("the trace is there") {
        let path = entry.expect("an entry").path();
        fs::copy(&path, folder.join(path.file_name().expect("a name"))).expect("a copy");
    }
    let file = folder.join("trace.ron");
    let text = fs::read_to_string(&file).expect("text");
    let label = HOSTILE.replace('\\', "\\\\").replace('"', "\\\"");
    let changed: String = text
        .split_inclusive("label: \"")
        .enumerate()
        .map(|(at, piece)| match at {
            0 => piece.to_owned(),
            // The label that was there follows.
            _ => format!("{label}{}", piece),
        })
        .collect();
    assert_ne!(changed, text, "the trace has labels");
    fs::write(&file, changed).expect("written");
    folder.display().to_string()
}

/// A page holds no tag that is not its own.
fn harmless(page: &str) {
    assert!(!page.contains("<img src=x") && !page.contains("<!--"), "a text became a tag");
    let scripts = page.matches("<script").count();
    assert_eq!((scripts, page.matches("</script").count()), (scripts, scripts));
}

#[test]
fn labels_stay_text() {
    let home = tempfile::tempdir().expect("a folder");
    let trace = hostile(home.path());
    let page = home.path().join("page.html").display().to_string();
    let timeline = home.path().join("timeline.json");
    let (code, _, message) = run(&[
        "replay",
        &trace,
        "--config",
        "tiny",
        "--per-draw",
        "--report",
        &page,
        "--timeline",
        &timeline.display().to_string(),
    ]);
    assert_eq!(code, 0, "{message}");
    let text = fs::read_to_string(&page).expect("a page");
    harmless(&text);
    assert!(text.contains("&lt;/script&gt;&lt;img src=x onerror=alert(1)&gt;&quot;'&amp;&lt;!--"), "the label is shown");
    let label = embedded(&text, "statistics")["frames"][0]["phases"].to_string();
    assert!(label.contains("onerror=alert(1)"), "{label}");
    assert!(json_of(&timeline)["traceEvents"].to_string().contains("onerror=alert(1)"));

    // In the files of a replay, and in the question of a sweep.
    let home = replayed("traces/triangle", &["--config", "tiny"]);
    let file = home.path().join("stats.json");
    let mut statistics = json_of(&file);
    for name in ["trace", "config", "fidelity", "fillrate"] {
        statistics[name] = json!(HOSTILE);
    }
    statistics["changed_knobs"] = json!({ HOSTILE: { "from": HOSTILE, "to": HOSTILE } });
    statistics["frames"][0]["phases"][0]["kind"] = json!(HOSTILE);
    let units = statistics["frames"][0]["units"].as_object_mut().expect("units");
    let core = units["core"].clone();
    units.insert(HOSTILE.into(), core);
    fs::write(&file, statistics.to_string()).expect("written");
    assert_eq!(run(&["report", &home.path().display().to_string(), "--plots"]).0, 0);
    harmless(&fs::read_to_string(home.path().join("report.html")).expect("a page"));
    for entry in fs::read_dir(home.path().join("plots")).expect("plots") {
        harmless(&fs::read_to_string(entry.expect("an entry").path()).expect("a plot"));
    }
    let sweep = tempfile::tempdir().expect("a folder");
    let out = sweep.path().display().to_string();
    let asked =
        ["sweep", "traces/triangle", "--config", "tiny", "--vary", "core.warps=2,4", "--question", HOSTILE, "--out", &out];
    assert_eq!(run(&asked).0, 0);
    harmless(&fs::read_to_string(sweep.path().join("report.html")).expect("a page"));
}

#[test]
fn what_is_no_folder_of_a_replay_is_told() {
    let home = replayed("traces/triangle", &["--config", "tiny"]);
    let folder = home.path().display().to_string();
    let file = home.path().join("stats.json");
    let whole = fs::read_to_string(&file).expect("statistics");
    for (text, told) in [
        (whole.replace("\"version\": 1", "\"version\": 7"), "has version 7, and this program reads version 1"),
        (whole[..whole.len() / 2].to_owned(), "is no JSON"),
        ("[]".to_owned(), "holds no object"),
        ("{}".to_owned(), "has no `version`"),
        (whole.replace("\"total\"", "\"sum\""), "has no object `total`"),
        (whole.replace("\"frames\"", "\"pictures\""), "has no list `frames`"),
    ] {
        fs::write(&file, text).expect("written");
        let message = refused(&["report", &folder]);
        assert!(message.contains("stats.json") && message.contains(told), "{message}");
    }
    fs::write(&file, &whole).expect("written");
    assert_eq!(run(&["report", &folder]).0, 0);
    let message = refused(&["report", &folder, "--trace", "traces/cube"]);
    assert!(message.contains("traces/cube") && message.contains("is not the trace of these statistics"), "{message}");
    let message = refused(&["report", &folder, "--trace", "traces/none"]);
    assert!(message.contains("traces/none"), "{message}");

    fs::write(home.path().join("frame-0000.png"), "no picture").expect("written");
    let message = refused(&["report", &folder]);
    assert!(message.contains("frame-0000.png is no picture"), "{message}");
    fs::remove_file(home.path().join("frame-0000.png")).expect("removed");
    assert_eq!(run(&["report", &folder]).0, 0, "pictures may be left out");
    fs::write(home.path().join("config.ron"), "(pipelines: 0)").expect("written");
    assert!(refused(&["report", &folder]).contains("config.ron"));
    fs::remove_file(&file).expect("removed");
    let message = refused(&["report", &folder]);
    assert!(message.contains("stats.json") && message.contains("no folder of a replay or a sweep"), "{message}");
    assert!(refused(&["report", "traces/nowhere"]).contains("traces/nowhere"));
}

fn values(surface: &Surface, kind: MapKind) -> u64 {
    surface.maps[kind as usize].values.iter().map(|&value| u64::from(value)).sum()
}

#[test]
fn maps_add_up_to_the_funnel() {
    // One pass to what is shown; of several layers; with textures; of several samples per pixel.
    let mut empty = 0;
    for (name, passes) in [("torus-knot.zip", 1), ("layers", 1), ("cube", 1), ("particles", 1), ("spokes-msaa", 1)] {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("traces").join(name);
        let trace = Trace::open(path).expect("the trace is there");
        let config = Config::built_in("baseline").expect("it is built in");
        let found = details(&trace, &config, 0, true).expect("it renders");
        let (maps, estimate) = (found.maps, found.estimate.expect("an estimate"));
        assert_eq!(maps.left_out, 0);
        let sum = |kind: MapKind| maps.surfaces.iter().map(|surface| values(surface, kind)).sum::<u64>();
        assert_eq!(sum(MapKind::Overdraw), maps.funnel.fragments_covered, "{name}");
        // A fragment that is hidden beside others that are not is shaded as a helper: quads are rejected whole.
        let shaded = sum(MapKind::Overdraw) - sum(MapKind::Hidden);
        assert!(shaded >= maps.funnel.fragments_shaded, "{name}: {shaded}");
        assert_eq!(shaded + sum(MapKind::Waste), maps.funnel.fragments_shaded + maps.funnel.helper_fragments, "{name}");
        assert_eq!(maps.surfaces.iter().map(|surface| surface.passes.len()).sum::<usize>(), passes, "{name}");
        assert!(estimate.phases.iter().any(|phase| phase.cycles > 0.0));
        // The machine's values by block add up to its counters.
        let home = replayed(&format!("traces/{name}"), &["--frames", "0"]);
        let json = json_of(&home.path().join("stats.json"));
        let counted = |path: &str| number(&json["total"], path).unwrap_or(0.0) as u64;
        let noted = |kind: MapKind| {
            let map = |surface: &Surface| {
                let map = surface.maps.iter().find(|map| map.kind == kind).expect("a map");
                let first = |at: &usize| {
                    surface.cell == 1
                        && (at % surface.columns as usize).is_multiple_of(8)
                        && (at / surface.columns as usize).is_multiple_of(8)
                };
                (0..map.values.len()).filter(first).map(|at| u64::from(map.values[at])).collect::<Vec<_>>()
            };
            maps.surfaces.iter().flat_map(map).collect::<Vec<u64>>()
        };
        let total = |kind: MapKind| noted(kind).iter().sum::<u64>();
        assert_eq!(total(MapKind::HierarchicalZ) + total(MapKind::EarlyZ), counted("funnel.quads_early_culled"), "{name}");
        // Misses of vertex shaders belong to no block.
        let (noted_misses, all) = (total(MapKind::Misses), counted("caches.texture[*].misses"));
        assert!(
            noted_misses <= all && (name == "particles" || all - noted_misses <= all / 100),
            "{name}: {noted_misses} of {all}"
        );
        let when = noted(MapKind::When);
        assert!(when.iter().any(|&at| at > 0) && when.iter().all(|&at| at < counted("cycles")), "{name}");
        let draws: Vec<u32> = maps.draws.iter().map(|draw| draw.number).collect();
        for surface in &maps.surfaces {
            let last = &surface.maps[MapKind::Draw as usize].values;
            assert!(last.iter().all(|&draw| draw == 0 || draws.contains(&(draw - 1))), "{name}");
            // Where nothing is covered, nothing costs.
            let none = surface.maps[MapKind::Overdraw as usize].values.iter().zip(last).filter(|(covered, _)| **covered == 0);
            empty += none.clone().count();
            assert!(none.clone().all(|(_, &draw)| draw == 0), "{name}");
        }
    }
    assert!(empty > 10_000, "{empty} pixels are empty");
}

#[test]
fn attachments_of_each_pass_are_shown() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("traces/shadow");
    let trace = Trace::open(path).expect("the trace is there");
    let config = Config::built_in("baseline").expect("it is built in");
    let found = details(&trace, &config, 0, false).expect("it renders").targets;
    assert_eq!(found.left_out, 0);
    // The shadow map of the first pass alone, then the picture and its depths.
    let kinds: Vec<(u32, Option<u32>)> = found.pictures.iter().map(|of| (of.pass, of.location)).collect();
    assert_eq!(kinds, [(0, None), (1, Some(0)), (1, None)]);
    for of in &found.pictures {
        let (width, height) = of.image.dimensions();
        assert!(width.max(height) <= 160 && width.max(height) >= 150, "{width} x {height}");
        let mut shades: Vec<_> = of.image.pixels().map(|pixel| pixel.0).collect();
        shades.sort_unstable();
        shades.dedup();
        assert!(shades.len() > 50, "pass {}: {} shades", of.pass, shades.len());
        assert_eq!(of.depths.is_some(), of.location.is_none());
        assert!(of.depths.is_none_or(|[least, most]| 0.0 <= least && least < most && most <= 1.0), "{:?}", of.depths);
    }
    // The picture in small has the colours of the picture.
    let home = replayed("traces/shadow", &[]);
    let picture = image::open(home.path().join("frame-0000.png")).expect("a picture").into_rgb8();
    let (small, mean) = (&found.pictures[1].image, |image: &image::RgbImage| {
        let sums = image.pixels().fold([0.0; 3], |sums, pixel| std::array::from_fn(|c| sums[c] + f64::from(pixel.0[c])));
        sums.map(|sum: f64| sum / f64::from(image.width() * image.height()))
    });
    for (a, b) in std::iter::zip(mean(small), mean(&picture)) {
        assert!((a - b).abs() < 2.0, "{a}, {b}");
    }
    assert_eq!(run(&["report", &home.path().display().to_string()]).0, 0);
    let page = fs::read_to_string(home.path().join("report.html")).expect("a page");
    let section = page.split("<div class=\"targets\">").nth(1).expect("the pictures").split("</div>").next().expect("an end");
    assert_eq!(section.matches("<figure><img src=\"data:image/png;base64,").count(), 3);
}

#[test]
fn a_sweeps_page_has_what_its_tables_have() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().display().to_string();
    let axes = ["--vary", "core.warps=2..16*2", "--vary", "memory.kind=all", "--vary", "memory.l2.slices=3,4"];
    let asked = [&["sweep", "traces/cube", "--cost", "core.warps*pipelines", "--out", &out], &axes[..]].concat();
    let (code, _, message) = run(&asked);
    // Half of the machines break a rule.
    assert_eq!(code, 1, "{message}");
    let written = fs::read(home.path().join("report.html")).expect("a page");
    assert_eq!(run(&["report", &out, "--plots"]).0, 0);
    assert!(fs::read(home.path().join("report.html")).expect("a page") == written, "the same page again");
    let page = String::from_utf8(written).expect("UTF-8");
    let own = embedded(&page, "sweep");
    let table = fs::read_to_string(home.path().join("machines.csv")).expect("a table");
    let mut lines = table.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().expect("a header");
    let column = |name: &str| head.iter().position(|own| *own == name).expect(name);
    let rows: BTreeMap<u64, Vec<&str>> = lines.map(|row| (row[0].parse().expect("a number"), row)).collect();
    let machines = own["machines"].as_array().expect("machines");
    assert_eq!((machines.len(), rows.len()), (16, 16));
    let mut last = 0;
    for machine in machines {
        let row = &rows[&machine["machine"].as_u64().expect("a number")];
        let Some(cycles) = machine["cycles"].as_u64() else {
            assert!(row[column("error")].contains("memory.l2.slices"), "{machine}");
            continue;
        };
        assert!(cycles >= last, "the fastest come first");
        last = cycles;
        assert_eq!(row[column("cycles")], cycles.to_string());
        let bytes: f64 = ["read", "write"]
            .map(|way| row[column(&format!("memory.dram.{way}_bytes"))].parse::<f64>().expect("bytes"))
            .iter()
            .sum();
        assert_eq!(machine["dram_bytes"].as_f64(), Some(bytes));
        assert_eq!(machine["cost"].as_u64(), machine["settings"]["core.warps"].as_u64().map(|warps| 4 * warps));
    }
    for part in
        ["Sensitivities", "Response curves", "Two axes", "Cycles against cost", "All machines", "Machines with an error"]
    {
        assert!(page.contains(&format!("<h2>{part}</h2>")), "{part}");
    }
    for name in ["response-core.warps", "two-axes", "pareto"] {
        assert!(home.path().join("plots").join(format!("{name}.svg")).exists(), "{name}");
    }
    let message = refused(&["report", &out, "--trace", "traces/cube"]);
    assert!(message.contains("--trace"), "{message}");
    let elsewhere = home.path().join("x").display().to_string();
    let message = refused(&["sweep", "traces/cube", "--vary", "core.warps=2", "--cost", "core.wraps", "--out", &elsewhere]);
    assert!(message.contains("core.warps is the nearest"), "{message}");
}

/// A browser that runs without a screen.
fn browser() -> Option<PathBuf> {
    let named = std::env::var_os("FILLRATE_BROWSER").map(PathBuf::from);
    let paths = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome", "chrome"];
    let found =
        std::env::split_paths(&paths).flat_map(|folder| names.map(|name| folder.join(name))).find(|path| path.is_file());
    named.or(found)
}

/// A script for a page: it counts errors, sorts a table twice, points at a map and at a time, selects draws by pixel, row and time, and sets
/// filters. It writes the results into an element.
const ACTS: &str = r##"<script>
addEventListener("load", async () => {
  const out = { errors: window.errors, wide: document.documentElement.scrollWidth - document.documentElement.clientWidth };
  const wait = (time) => new Promise((done) => setTimeout(done, time));
  const column = (table, at) => [...table.tBodies[0].rows].filter((row) => !row.hidden).map((row) => Number(row.cells[at].dataset.value));
  const table = document.querySelector("#passes") || document.querySelector("#machines");
  const at = [...table.tHead.rows[0].cells].findIndex((cell) => cell.textContent === "cycles");
  const button = table.tHead.rows[0].cells[at].querySelector("button");
  button.click();
  out.first = [table.tHead.rows[0].cells[at].getAttribute("aria-sort"), column(table, at)];
  button.click();
  out.second = [table.tHead.rows[0].cells[at].getAttribute("aria-sort"), column(table, at)];
  const heat = document.querySelector(".heat:has(canvas)");
  if (heat) {
    await wait(500);
    const place = heat.getBoundingClientRect();
    heat.dispatchEvent(new PointerEvent("pointermove", { clientX: place.left + place.width * 0.75, clientY: place.top + place.height * 0.5 }));
    await wait(500);
    out.readout = document.querySelector(".readout").innerText.split("\n");
    document.querySelectorAll(".tabs button")[5].click();
    await wait(200);
    out.pressed = document.querySelector(".tabs button[aria-pressed=true]").textContent;
    out.scale = document.querySelector(".scale").offsetHeight;
    const lines = () => document.querySelector(".readout").innerText.split("\n");
    const number = (text) => Number(/draw (\d+)/.exec(text)[1]);
    const picked = () => [...document.querySelectorAll("tr[aria-selected=true]")].map((row) => Number(row.dataset.draw));
    const events = [];
    document.addEventListener("select", (event) => events.push(event.detail));
    // A pixel selects the draw that is last there, on the map and in the table.
    const spot = heat.getBoundingClientRect();
    heat.dispatchEvent(new MouseEvent("click", { bubbles: true, clientX: spot.left + spot.width * 0.75, clientY: spot.top + spot.height * 0.5 }));
    await wait(500);
    const layer = document.querySelector("canvas.chosen"), all = layer.getContext("2d").getImageData(0, 0, layer.width, layer.height).data;
    let clear = 0;
    for (let i = 3; i < all.length; i += 4) clear += all[i] === 0;
    out.pixel = { last: number(lines().find((line) => line.startsWith("last draw"))), rows: picked(), hidden: layer.hidden, clear, told: lines().find((line) => line.startsWith("Highlighted")) };
    const row = document.querySelector("tr[aria-selected=true]").getBoundingClientRect();
    out.pixel.seen = row.top >= 0 && row.bottom <= innerHeight;
    const before = lines()[0];
    heat.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    await wait(200);
    out.moved = [before, lines()[0]];
    // A row selects its draw, and again none.
    const draws = document.querySelector("#draws"), shown = () => [...draws.tBodies[0].rows].filter((row) => !row.hidden);
    const other = shown().find((row) => row.dataset.draw && row.getAttribute("aria-selected") === null);
    other.cells[0].click();
    out.row = [Number(other.dataset.draw), picked(), events[events.length - 1]];
    other.cells[0].click();
    await wait(200);
    out.none = [picked(), events[events.length - 1], layer.hidden];
    // A time of the track selects the draw that retires then.
    const track = document.querySelector("canvas.track"), line = track.getBoundingClientRect();
    const at = { bubbles: true, clientX: Math.round(line.left + line.width * 0.5), clientY: line.top + 3 };
    track.dispatchEvent(new PointerEvent("pointermove", at));
    out.when = document.querySelector(".when").textContent;
    track.dispatchEvent(new MouseEvent("click", at));
    out.time = [picked(), document.querySelectorAll("table.timeline.spanned").length > 0, document.querySelectorAll(".axis span").length];
    out.event = events[events.length - 1];
    select(null);
    // Twenty rows, all rows, and those that a filter finds; columns that are chosen.
    const box = draws.closest(".scroll"), tools = box.previousElementSibling, more = box.nextElementSibling;
    out.rows = [shown().length, draws.tBodies[0].rows.length];
    more.querySelector("button").click();
    out.rows.push(shown().length);
    const filter = tools.querySelector("input[type=search]");
    filter.value = "many";
    filter.dispatchEvent(new Event("input"));
    out.rows.push(shown().length);
    filter.value = "";
    filter.dispatchEvent(new Event("input"));
    const check = [...tools.querySelectorAll("label")].find((label) => label.textContent === "quads").firstChild;
    const quads = [...draws.tHead.rows[0].cells].find((cell) => cell.textContent === "quads");
    out.columns = [quads.hidden];
    check.click();
    out.columns.push(quads.hidden);
    out.wide = Math.max(out.wide, document.documentElement.scrollWidth - document.documentElement.clientWidth);
  }
  const filter = document.querySelector(".filters select");
  if (filter) {
    filter.value = filter.options[1].value;
    filter.dispatchEvent(new Event("input", { bubbles: true }));
    out.filtered = document.querySelector(".filters output").textContent;
  }
  out.errors = window.errors;
  const told = document.createElement("pre");
  told.id = "told";
  told.textContent = JSON.stringify(out);
  document.body.append(told);
});
</script>"##;

/// Opens a page, runs the script in it, and returns its results.
fn acted(browser: &Path, page: &Path, width: u32) -> Value {
    let text = fs::read_to_string(page).expect("a page");
    let watched = text.replacen(
        "<head>",
        "<head><script>window.errors = []; addEventListener('error', (e) => errors.push(e.message)); addEventListener('unhandledrejection', (e) => errors.push(String(e.reason))); console.error = (...e) => errors.push(e.join(' '));</script>",
        1,
    );
    let home = tempfile::tempdir().expect("a folder");
    let copy = home.path().join("page.html");
    let acting = format!("{watched}{ACTS}");
    // A window of Chromium is 500 pixels wide at least; a frame in it may be narrower. It hands on what its page tells.
    let narrow = width < 500;
    let shown = if narrow {
        let escaped = acting.replace('&', "&amp;").replace('"', "&quot;");
        format!(
            "<body><iframe style=\"width:{width}px;height:850px;border:0\" srcdoc=\"{escaped}\"></iframe><script>
            setInterval(() => {{
                const told = document.querySelector('iframe').contentDocument?.querySelector('#told');
                if (!told || document.querySelector('#told')) return;
                const own = document.body.appendChild(document.createElement('pre'));
                [own.id, own.textContent] = ['told', told.textContent];
            }}, 50);
            </script>"
        )
    } else {
        acting
    };
    fs::write(&copy, shown).expect("written");
    let profile = home.path().join("profile").display().to_string();
    let done = std::process::Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--disable-quic",
            "--no-first-run",
            "--disable-background-networking",
        ])
        .args(["--disable-component-update", "--disable-sync", "--virtual-time-budget=8000", "--dump-dom"])
        .arg(format!("--user-data-dir={profile}"))
        .arg(format!("--window-size={},900", width.max(500)))
        .arg(format!("file://{}", copy.display()))
        .output()
        .expect("the browser starts");
    let dom = String::from_utf8_lossy(&done.stdout).into_owned();
    let told = dom.split("<pre id=\"told\">").nth(1).and_then(|rest| rest.split("</pre>").next());
    let told = told.unwrap_or_else(|| panic!("the page reports nothing: {}", String::from_utf8_lossy(&done.stderr)));
    serde_json::from_str(&told.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&")).expect("JSON")
}

#[test]
fn pages_work_in_a_browser() {
    let Some(browser) = browser() else {
        eprintln!("left out: no Chromium is in PATH, and FILLRATE_BROWSER names none");
        return;
    };
    let home = tempfile::tempdir().expect("a folder");
    let replay = home.path().join("replay.html");
    assert_eq!(run(&["replay", "traces/town.zip", "--per-draw", "--report", &replay.display().to_string()]).0, 0);
    let sweep = home.path().join("sweep");
    assert_eq!(run(&["sweep", "traces/cube", "--vary", "core.warps=2,4,8", "--out", &sweep.display().to_string()]).0, 0);
    let sweep = sweep.join("report.html");
    for (page, width) in [(&replay, 1280), (&replay, 400), (&sweep, 1280), (&sweep, 400)] {
        let told = acted(&browser, page, width);
        assert_eq!((&told["errors"], &told["wide"]), (&json!([]), &json!(0)), "{}: {told}", page.display());
        let column = |name: &str| {
            told[name][1].as_array().expect("a column").iter().map(|value| value.as_f64().expect("cycles")).collect::<Vec<_>>()
        };
        let (first, second) = (column("first"), column("second"));
        assert!(first.len() > 1 && first.windows(2).all(|pair| pair[0] >= pair[1]), "{told}");
        assert!(second.windows(2).all(|pair| pair[0] <= pair[1]), "{told}");
        assert_eq!([&told["first"][0], &told["second"][0]], ["descending", "ascending"]);
        if page.ends_with("replay.html") {
            let readout = told["readout"].as_array().expect("a read-out");
            assert!(readout.len() == 11 && readout[0].as_str().is_some_and(|text| text.starts_with("pixel 2")), "{told}");
            // Colours of draws have no scale.
            assert_eq!((&told["pressed"], &told["scale"]), (&json!("last draw"), &json!(0)), "{told}");
            let pixel = &told["pixel"];
            assert_eq!(
                (&pixel["rows"], &pixel["hidden"], &pixel["seen"]),
                (&json!([pixel["last"]]), &json!(false), &json!(true)),
                "{told}"
            );
            let clear = pixel["clear"].as_u64().expect("a number");
            let said = pixel["told"].as_str().expect("a line").replace(',', "");
            assert!(clear > 0 && said.starts_with(&format!("Highlighted: {clear} pixels")), "{told}");
            let [before, after] = [&told["moved"][0], &told["moved"][1]].map(|text| {
                let text = text.as_str().and_then(|text| text.strip_prefix("pixel ")).expect("a pixel");
                text.split(", ").map(|number| number.parse().expect("a number")).collect::<Vec<u32>>()
            });
            assert_eq!([before[0] + 1, before[1]], after[..], "{told}");
            assert_eq!((&told["row"][1], &told["row"][2]), (&json!([told["row"][0]]), &told["row"][0]), "{told}");
            assert_eq!(told["none"], json!([[], null, true]), "{told}");
            let when = told["when"].as_str().expect("a time");
            assert!(when.starts_with("Cycle ") && when.contains(&format!("; pass 0; draw {},", told["event"])), "{told}");
            assert_eq!((&told["time"][0], &told["time"][1]), (&json!([told["event"]]), &json!(true)), "{told}");
            assert!(told["time"][2].as_u64() > Some(3), "{told}");
            assert_eq!(told["rows"], json!([20, 399, 399, 2]), "{told}");
            assert_eq!(told["columns"], json!([true, false]), "{told}");
        } else {
            assert_eq!(told["filtered"], "1 of 3");
        }
    }
}
