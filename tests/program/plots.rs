//! Plots as files of their own, as programs beside browsers show them: with colours, and with all that stands beside the axes.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use fillrate::num::Limits;
use fillrate::picture::read_png;

use crate::cli::run;
use crate::report::replayed;

/// The plots that `fillrate report` leaves of a folder.
fn plots(folder: &Path) -> Vec<PathBuf> {
    let (code, _, message) = run(&["report", &folder.display().to_string(), "--plots"]);
    assert_eq!(code, 0, "{message}");
    let mut found: Vec<PathBuf> =
        fs::read_dir(folder.join("plots")).expect("plots").map(|entry| entry.expect("an entry").path()).collect();
    found.sort();
    found
}

/// Whether `rsvg-convert` is there, which pandoc and LaTeX use for SVG.
fn has_rsvg() -> bool {
    Command::new("rsvg-convert").arg("--version").output().is_ok_and(|output| output.status.success())
}

/// Renders a drawing with librsvg and counts its pixels that are neither black nor white nor grey.
fn coloured_pixels(svg: &Path, picture: &Path) -> usize {
    let done = Command::new("rsvg-convert").arg(svg).arg("-o").arg(picture).output().expect("rsvg-convert runs");
    assert!(done.status.success(), "{}: {}", svg.display(), String::from_utf8_lossy(&done.stderr));
    let image = read_png(&fs::read(picture).expect("a picture"), &Limits::default()).expect("a picture").into_rgb8();
    let is_coloured = |pixel: &&image::Rgb<u8>| {
        let [low, high] = [pixel.0.iter().min(), pixel.0.iter().max()].map(|own| *own.expect("three components"));
        high - low > 48
    };
    image.pixels().filter(is_coloured).count()
}

#[test]
fn plots_have_colours_outside_browsers_and_whole_labels() {
    let sweep = tempfile::tempdir().expect("a folder");
    let out = sweep.path().display().to_string();
    let axes =
        ["--vary", "core.warps=1,2,8", "--vary", "depth.early=all", "--vary", "sort=sort-middle-binned,sort-last-fragment"];
    let measure = "caches.color.misses/(caches.color.accesses+caches.depth.accesses+caches.texture.accesses+units.core.busy)";
    let asked = [
        "sweep",
        "traces/cube",
        "traces/triangle",
        "--config",
        "tiny",
        "--measure",
        measure,
        "--cost",
        "area",
        "--set",
        "bin.tile=16",
        "--out",
        &out,
    ];
    let (code, _, message) = run(&[&asked[..], &axes].concat());
    assert_eq!(code, 0, "{message}");
    let replay = replayed("traces/cube", &["--config", "tiny"]);
    let mut found = plots(sweep.path());
    let names: Vec<String> =
        found.iter().map(|path| path.file_stem().expect("a name").to_string_lossy().into_owned()).collect();
    for name in [
        "response-core.warps",
        "response-depth.early",
        "response-sort",
        "measure-1-core.warps",
        "trace-core.warps",
        "two-axes",
        "pareto",
    ] {
        assert!(names.iter().any(|own| own == name), "no {name}: {names:?}");
    }
    let text = |name: &str| fs::read_to_string(sweep.path().join(format!("plots/{name}.svg"))).expect("a plot");
    for (name, labels) in [
        ("response-core.warps", &[">1<", ">2<", ">8<"][..]),
        ("response-depth.early", &[">false<", ">true<"]),
        ("response-sort", &[">sort-middle-binned<", ">sort-last-fragment<"]),
    ] {
        assert!(labels.iter().all(|label| text(name).contains(label)), "{name}: {}", text(name));
    }
    found.extend(plots(replay.path()));
    found.push(Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/pareto.svg"));
    assert!(found.len() > 12, "{found:?}");
    for path in &found {
        let text = fs::read_to_string(path).expect("a plot");
        assert!(!text.contains("var("), "{}: a variable is no colour outside browsers", path.display());
    }
    if !has_rsvg() {
        eprintln!("LEFT OUT: there is no rsvg-convert (Debian: librsvg2-bin), so no plot was rendered");
        return;
    }
    let picture = sweep.path().join("picture.png");
    for path in &found {
        let coloured = coloured_pixels(path, &picture);
        assert!(coloured > 100, "{}: {coloured} pixels with a colour", path.display());
    }
}
