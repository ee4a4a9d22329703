//! `fillrate compare`, as scripts and readers use it.

use std::fs;
use std::path::Path;

use image::{Rgba, RgbaImage};

use crate::cli::{refused, run};

/// A folder for files, and their paths as arguments.
struct Folder(tempfile::TempDir);

impl Folder {
    fn new() -> Folder {
        Folder(tempfile::tempdir().expect("a folder"))
    }

    fn path(&self, name: &str) -> String {
        self.0.path().join(name).display().to_string()
    }

    fn text(&self, name: &str, text: &str) -> String {
        fs::write(self.0.path().join(name), text).expect("written");
        self.path(name)
    }

    /// A black image with one dot.
    fn image(&self, name: &str, size: u32, red: u8) -> String {
        let mut image = RgbaImage::from_pixel(size, size, Rgba([0, 0, 0, 255]));
        image.put_pixel(1, 2, Rgba([red, 0, 0, 255]));
        image.save(self.0.path().join(name)).expect("saved");
        self.path(name)
    }

    /// What replay leaves in a folder of it.
    fn replay(&self, name: &str, arguments: &[&str]) -> String {
        let out = self.path(name);
        let (code, _, message) = run(&[&["replay", "traces/triangle", "--config", "tiny", "--out", &out], arguments].concat());
        assert_eq!(code, 0, "{message}");
        out
    }
}

#[test]
fn images_are_told_equal_from_different() {
    let dir = Folder::new();
    let (a, b, d) = (dir.image("a.png", 4, 0), dir.image("b.png", 4, 9), dir.path("d.png"));
    assert_eq!(run(&["compare", &a, &a]).0, 0);
    let (code, text, _) = run(&["compare", &a, &b, "--difference", &d]);
    assert_eq!(code, 1);
    assert!(text.contains("1 off by more than 2"), "{text}");
    assert!(Path::new(&d).exists());
    assert_eq!(run(&["compare", &a, &b, "--allow", "10"]).0, 0);
    let message = refused(&["compare", &a, &dir.image("large.png", 5, 0)]);
    assert!(message.contains("a.png") && message.contains("large.png") && message.contains("5 x 5"), "{message}");
}

#[test]
fn statistics_sum_banks_and_list_the_largest_changes_first() {
    let dir = Folder::new();
    let a = dir.text(
        "a.json",
        r#"{"version":1,"total":{"cycles":1000,"seconds":0.5,"units":{"setup":[{"busy":10},{"busy":20}],"clip":[{"busy":4}]}},
            "frames":[{"frame":0,"cycles":1000}]}"#,
    );
    let b = dir.text(
        "b.json",
        r#"{"version":1,"total":{"cycles":1100,"seconds":0.5,"units":{"setup":[{"busy":31},{"busy":29}],"clip":[{"busy":5}]}},
            "frames":[{"frame":0,"cycles":1100}]}"#,
    );
    let words = |text: &str| text.lines().map(|l| l.split_whitespace().collect::<Vec<_>>().join(" ")).collect::<Vec<_>>();
    let (code, text, _) = run(&["compare", &a, &b]);
    assert_eq!(code, 1);
    let expected = [
        "total.units.setup[*].busy 30 -> 60 +30 +100.000 %",
        "total.units.clip[0].busy 4 -> 5 +1 +25.000 %",
        "total.cycles 1000 -> 1100 +100 +10.000 %",
        "1 of single frames: --only frames shows them",
        "4 statistics differ",
    ];
    assert_eq!(words(&text), expected);
    let (_, text, _) = run(&["compare", &a, &b, "--by", "absolute", "--most", "1"]);
    assert_eq!(words(&text)[..2], ["total.cycles 1000 -> 1100 +100 +10.000 %", "2 more: --most 0 shows all"]);
    let (_, text, _) = run(&["compare", &a, &b, "--each-bank", "--only", "total.units.setup"]);
    let expected = [
        "total.units.setup[0].busy 10 -> 31 +21 +210.000 %",
        "total.units.setup[1].busy 20 -> 29 +9 +45.000 %",
        "2 statistics differ",
    ];
    assert_eq!(words(&text), expected);
    let (_, text, _) = run(&["compare", &a, &b, "--only", "frames"]);
    assert_eq!(words(&text), ["frames[0].cycles 1000 -> 1100 +100 +10.000 %", "1 statistic differs"]);
    assert_eq!(run(&["compare", &a, &b, "--only", "total.seconds"]).0, 0);
    assert_eq!(run(&["compare", &a, &a]), (0, "0 statistics differ\n".into(), String::new()));
}

#[test]
fn a_free_running_display_shows_the_same_bytes_for_any_number_of_threads() {
    let dir = Folder::new();
    let shown = |threads: &str| {
        let out = dir.path(threads);
        let free = [
            "--config",
            "four-pipelines",
            "--set",
            "scanout.mode=free-running",
            "--set",
            "scanout.swap=immediate",
            "--set",
            "scanout.line_cycles=100",
        ];
        let arguments = ["replay", "traces/particles", "--out", &out, "--threads", threads];
        let (code, _, message) = run(&[&arguments[..], &free].concat());
        assert_eq!(code, 0, "{message}");
        let mut files: Vec<_> = fs::read_dir(&out)
            .expect("a folder")
            .map(|entry| entry.expect("an entry").path())
            .filter(|path| path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("shown")))
            .map(|path| (path.file_name().expect("a name").to_owned(), fs::read(&path).expect("read")))
            .collect();
        files.sort();
        (out, files)
    };
    let (one, files) = shown("1");
    assert!(files.len() > 2 && files[0].0 == "shown-0000.png", "{:?}", files.iter().map(|file| &file.0).collect::<Vec<_>>());
    for threads in ["2", "5"] {
        let (many, other) = shown(threads);
        assert!(files == other, "{threads} threads");
        let (code, text, message) = run(&["compare", &one, &many]);
        assert!(code == 0 && text.contains("0 statistics differ\n"), "{text}{message}");
    }
}

#[test]
fn folders_are_compared_file_by_file() {
    let dir = Folder::new();
    let (a, again, b) =
        (dir.replay("a", &[]), dir.replay("again", &["--threads", "1"]), dir.replay("b", &["--set", "setup.latency=30"]));
    let (code, text, message) = run(&["compare", &a, &again]);
    assert_eq!(code, 0, "{message}");
    let equal = "All totals are equal.\n\n0 of 1 images differ\n0 knobs differ\n0 statistics differ\n";
    assert!(text.starts_with("A: traces/triangle on tiny, cycle\nB: ") && text.ends_with(equal), "{text}");

    let (code, text, _) = run(&["compare", &a, &b]);
    assert_eq!(code, 1);
    assert!(text.lines().any(|line| line.starts_with("setup.latency ") && line.ends_with("-> 30")), "{text}");
    assert!(
        text.contains("1 knob differs\n") && text.contains("total.cycles") && text.contains("0 of 1 images differ"),
        "{text}"
    );

    // CSV by itself has the same frames.
    let table = |folder: &str| format!("{folder}/stats.csv");
    let (code, text, _) = run(&["compare", &table(&a), &table(&b), "--only", "frames[0].cycles"]);
    assert!(code == 1 && text.starts_with("frames[0].cycles  "), "{text}");
    assert_eq!(run(&["compare", &table(&a), &table(&again)]).0, 0);
    let (code, text, _) = run(&["compare", "tiny", &format!("{b}/config.ron")]);
    assert!(code == 1 && text.starts_with("setup.latency  "), "{text}");

    // Without a file of statistics in both the other one is left; an image that only one has is a difference.
    fs::remove_file(format!("{again}/stats.json")).expect("removed");
    fs::copy(format!("{again}/frame-0000.png"), format!("{again}/frame-0001.png")).expect("copied");
    let (code, text, _) = run(&["compare", &a, &again]);
    assert_eq!(code, 1);
    assert!(text.contains("frame-0001.png is in") && text.contains("stats.json is in"), "{text}");
    assert!(text.ends_with("0 of 1 images differ\n0 knobs differ\n0 statistics differ\n"), "{text}");

    // There are difference images of the images that differ.
    let (x, y, out) = (dir.path("x"), dir.path("y"), dir.path("differences"));
    for (folder, red) in [(&x, 0), (&y, 200)] {
        fs::create_dir(folder).expect("made");
        let name = Path::new(folder).file_name().expect("a name").to_str().expect("text");
        dir.image(&format!("{name}/frame-0000.png"), 4, red);
        dir.image(&format!("{name}/frame-0001.png"), 4, 7);
    }
    let (code, text, _) = run(&["compare", &x, &y, "--difference", &out]);
    assert!(code == 1 && text.starts_with("frame-0000.png: 16 pixels, 1 different"), "{text}");
    assert!(text.ends_with("1 of 2 images differ\n"), "{text}");
    assert!(Path::new(&out).join("frame-0000.png").exists() && !Path::new(&out).join("frame-0001.png").exists());
    assert_eq!(run(&["compare", &x, &y, "--allow", "10"]).0, 0);
}

#[test]
fn what_cannot_be_compared_is_refused_by_file_and_reason() {
    let dir = Folder::new();
    let json = dir.text("a.json", "{}");
    let image = dir.image("a.png", 4, 0);
    let message = refused(&["compare", &json, &image]);
    assert!(message.contains("a.json is a JSON file of statistics") && message.contains("a.png is an image"), "{message}");
    fs::create_dir(dir.path("empty")).expect("made");
    let message = refused(&["compare", &dir.path("empty"), &dir.path("empty")]);
    assert!(message.contains("empty holds nothing that replay writes"), "{message}");
    for (name, text, reason) in [
        ("cut.json", "{\"total\":", "EOF"),
        ("list.json", "[1]", "no object"),
        ("cut.csv", "frame,cycles\n0\n", "line 2 has 1 fields"),
        ("wrong.csv", "a,b\n0,1\n", "not \"frame\""),
        ("trace.ron", "Trace(version: 1)", "this is not a configuration"),
        ("text.ron", "(extends: \"baseline\", pipelines: \"8\")", "pipelines is the text \"8\""),
        ("text.png", "no picture", "cannot read"),
    ] {
        let path = dir.text(name, text);
        let message = refused(&["compare", &path, &path]);
        assert!(message.contains(name) && message.contains(reason), "{message}");
    }
    let missing = dir.path("missing.json");
    assert!(refused(&["compare", &missing, &json]).contains("missing.json"));
}

#[test]
fn two_replays_begin_with_time_phases_funnel_memory_caches_and_losses() {
    let dir = Folder::new();
    let (a, b) = (dir.replay("a", &[]), dir.replay("b", &["--set", "texture.latency=200", "--set", "setup.latency=30"]));
    let page = dir.path("page.html");
    let (code, text, message) = run(&["compare", &a, &b, "--report", &page]);
    assert_eq!(code, 1, "{message}");
    let lines: Vec<&str> = text.lines().collect();
    assert!(lines[0].starts_with("A: traces/triangle on tiny") && lines[1].contains("setup.latency=30"), "{text}");
    let cycles = |folder: &str| {
        let text = fs::read_to_string(format!("{folder}/stats.json")).expect("statistics");
        serde_json::from_str::<serde_json::Value>(&text).expect("JSON")["total"]["cycles"].as_u64().expect("cycles")
    };
    let (before, after) = (cycles(&a), cycles(&b));
    let grouped = |n: u64| if n < 1000 { n.to_string() } else { format!("{},{:03}", n / 1000, n % 1000) };
    let said = format!("cycles: {} instead of {}; the largest part of the change is +", grouped(after), grouped(before));
    assert!(lines[3].starts_with("B takes ") && lines[3].contains(&said), "{text}");
    let place = |line: &str| lines.iter().position(|own| own.starts_with(line)).unwrap_or_else(|| panic!("{line}: {text}"));
    let order = ["Time", "Cycles of phases", "Funnel", "Memory", "Caches", "Cycles of pipelines", "0 of 1 images", "2 knobs"]
        .map(place);
    assert!(order.is_sorted(), "{text}");
    let written = fs::read_to_string(&page).expect("a page");
    for part in ["<h1>Two replays</h1>", "id=\"phases\"", "id=\"funnel\"", "id=\"picture\"", "setup.latency", "data:image/png"]
    {
        assert!(written.contains(part), "{part}");
    }
    // A file of another kind is not replaced.
    fs::write(&page, "mine").expect("written");
    let message = refused(&["compare", &a, &b, "--report", &page]);
    assert!(message.contains("--force"), "{message}");
}

#[test]
fn two_machines_of_a_sweep_are_compared_as_two_replays() {
    let dir = Folder::new();
    let out = dir.path("results");
    let sweep =
        ["sweep", "traces/triangle", "traces/cube", "--config", "tiny", "--vary", "setup.latency=1,30,60", "--out", &out];
    assert_eq!(run(&sweep).0, 0);
    let (first, last) = (format!("{out}:0"), format!("{out}:2"));
    let (code, text, message) = run(&["compare", &first, &last]);
    assert_eq!(code, 1, "{message}");
    assert!(text.contains("setup.latency  1 -> 60\n1 knob differs\n") && text.contains("traces/cube: pass"), "{text}");
    assert!(text.contains("B takes ") && text.contains("Cycles of phases"), "{text}");
    let (code, text, _) = run(&["compare", &first, &first]);
    assert!(code == 0 && text.ends_with("All totals are equal.\n\n0 knobs differ\n0 statistics differ\n"), "{text}");
    let message = refused(&["compare", &first, &format!("{out}:3")]);
    assert!(message.contains("machines 0 to 2"), "{message}");
    let message = refused(&["compare", &first, &out]);
    assert!(message.contains("a machine of a sweep"), "{message}");
}
