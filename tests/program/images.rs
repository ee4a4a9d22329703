//! Images: against references that another renderer made, and the machine's own against the renderer's, bit for bit.
//!
//! References are Mesa 22.3.6 lavapipe's (`tests/references`, `crates/import/tests/import/*/ref*.png`, and the visible wgpu traces where
//! `FILLRATE_PEERS` names the folder that holds `wgpu/`). A failure leaves the image and its difference from the reference in
//! the folder for temporary files of the build (`target/tmp`), and names both. `FILLRATE_BLESS` writes the numbers into `docs/data/images.md`.

use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};

use assert_cmd::Command;
use assert_cmd::cargo::cargo_bin;
use fillrate::gfx::format::Format;
use fillrate::import;
use fillrate::machine::Config;
use fillrate::picture::{self, Difference, TOLERANCE, picture};
use fillrate::run::replay::{Fidelity, Frame, Options, Replay, replay};
use fillrate::stats::Group;
use fillrate::trace::command::TextureDesc;
use fillrate::trace::record::{self, Recorder};
use fillrate::work::Funnel;
use image::RgbaImage;

/// How much an image may differ from its reference: pixels with a channel off by more than 2, and the least PSNR in dB.
type Limit = (u64, f64);

/// The page with the table.
const PAGE: &str = "docs/data/images.md";

/// Held while the page is read or written.
static PAGE_IN_USE: Mutex<()> = Mutex::new(());

/// Writes the numbers of an image into its row of the table.
fn bless(name: &str, d: &Difference) {
    let _held = PAGE_IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
    let page = std::fs::read_to_string(here(PAGE)).expect("the page");
    let row = |line: &str| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        match cells.as_slice() {
            [_, image, .., remains, _] if *image == name => {
                format!("| {name} | {} | {} | {} | {:.2} | {remains} |\n", d.pixels, d.off, d.largest, d.psnr)
            }
            _ => format!("{line}\n"),
        }
    };
    std::fs::write(here(PAGE), page.lines().map(row).collect::<String>()).expect("the page can be written");
}

/// The limits by image, from the table of `docs/data/images.md`, which explains the differences that remain. The limits are a little larger
/// than the differences, so that a change of rounding alone does not fail here.
fn limits() -> Vec<(String, Limit)> {
    let _held = PAGE_IN_USE.lock().unwrap_or_else(PoisonError::into_inner);
    let page = std::fs::read_to_string(here(PAGE)).expect("the page");
    let rows = page.lines().filter(|line| line.starts_with("| ") && !line.starts_with("| image "));
    let limits: Vec<_> = rows
        .map(|line| {
            let cells: Vec<&str> = line.split('|').map(str::trim).collect();
            let number = |cell: usize| cells[cell].parse::<f64>().unwrap_or_else(|error| panic!("{line}: {error}"));
            let (wrong, psnr) = (number(3), number(5));
            (cells[1].to_owned(), ((wrong * 1.1) as u64 + 3, psnr - 0.5))
        })
        .collect();
    assert!(limits.len() > 20, "{} rows in the table", limits.len());
    limits
}

/// A trace with the reference of some of its frames.
struct Case {
    name: String,
    trace: PathBuf,
    /// The reference of the n-th frame shown, where there is one.
    references: Vec<PathBuf>,
}

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<PathBuf> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.sort();
    paths
}

fn stem(path: &Path) -> String {
    path.file_stem().expect("a name").to_string_lossy().into_owned()
}

/// Scenes that are recorded in several orders, all with the same picture.
const ORDERS: [&[&str]; 2] =
    [&["layers-front-first", "layers-random", "layers-back-first"], &["torus-bands", "torus-rows", "torus-random"]];

/// The scenes kept in `traces/`. Those of `ORDERS` are compared with each other. Four more go without another renderer's pictures: the long sequence is for
/// `tests/machine/estimates.rs`, which compares its pictures between fidelities; the dials are for `tests/machine/sort_traces.rs`,
/// which compares those of machines with the renderer's; the town (many small draws, most of them out of view) and the viewer (resources
/// that are bound and not read) show nothing that other scenes do not.
fn scenes() -> Vec<Case> {
    let references = entries(&here("tests/references"));
    entries(&here("traces"))
        .into_iter()
        .filter(|trace| !["flight", "panel", "town", "viewer"].contains(&stem(trace).as_str()))
        .filter(|trace| !ORDERS.concat().contains(&stem(trace).as_str()))
        .map(|trace| {
            let name = stem(&trace);
            let start = format!("{name}-");
            let own = |path: &&PathBuf| stem(path).strip_prefix(&start).is_some_and(|frame| frame.parse::<u32>().is_ok());
            let references: Vec<PathBuf> = references.iter().filter(own).cloned().collect();
            assert!(!references.is_empty(), "{name} has no reference in tests/references");
            Case { name, trace, references }
        })
        .collect()
}

/// The programs recorded for the tests of the importer.
fn fixtures() -> Vec<Case> {
    let names = ["culling", "deferred", "formats", "window"];
    names
        .into_iter()
        .map(|name| {
            let trace = here("crates/import/tests/import").join(name);
            let is_reference = |path: &PathBuf| path.extension().is_some_and(|extension| extension == "png");
            let references = entries(&trace).into_iter().filter(is_reference).collect();
            Case { name: name.into(), references, trace }
        })
        .collect()
}

/// The visible wgpu traces, where they are.
fn peers() -> Vec<Case> {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded wgpu traces to compare");
        return Vec::new();
    };
    let folders = entries(&Path::new(&root).join("wgpu")).into_iter().filter(|path| path.is_dir());
    let cases: Vec<Case> = folders
        .map(|trace| {
            let name = format!("wgpu/{}", stem(&trace));
            Case { name, references: vec![trace.join("ref.png")], trace }
        })
        .collect();
    assert!(!cases.is_empty(), "no traces in FILLRATE_PEERS/wgpu");
    cases
}

/// A built-in configuration, with room for the largest workgroups of the programs: `tiny` has too few warps and registers for them.
fn config(name: &str) -> Config {
    let mut config = Config::built_in(name).expect("a built-in configuration");
    if name == "tiny" {
        config.set("core.warps=32").expect("a setting");
        config.set("core.registers=65536").expect("a setting");
        config.check().expect("a valid configuration");
    }
    config
}

fn run(case: &Case, fidelity: Fidelity, config: Config) -> Replay {
    let trace = import::open(&case.trace).unwrap_or_else(|error| panic!("{error}"));
    let options = Options::new(config, fidelity);
    replay(&trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{}: {error:#}", case.name))
}

fn image_of(case: &Case, frame: &Frame) -> RgbaImage {
    let (surface, bytes) = frame.shown.as_ref().unwrap_or_else(|| panic!("{} shows nothing", case.name));
    picture(surface, bytes).unwrap_or_else(|error| panic!("{}: {error}", case.name))
}

/// Compares the frames of a replay with the references. Returns those beyond the limits.
fn differences(case: &Case, replay: &Replay, limits: &[(String, Limit)]) -> Vec<String> {
    let mut failures = Vec::new();
    // A trace that shows several frames but has one reference is compared at its last.
    let skip = replay.frames.len().saturating_sub(case.references.len());
    assert_eq!(replay.frames.len() - skip, case.references.len(), "{}: frames with references", case.name);
    for (frame, path) in replay.frames[skip..].iter().zip(&case.references) {
        let ours = image_of(case, frame);
        let reference = image::open(path).unwrap_or_else(|error| panic!("{}: {error}", path.display())).to_rgba8();
        let d = picture::compare(&ours, &reference).unwrap_or_else(|error| panic!("{}: {error}", case.name));
        let name = format!("{}-{:04}", case.name, frame.number);
        let numbers = format!(
            "{name:<25} {:>8} pixels, {:>6} off by more than {} ({:.4} %), at most {:>3}, PSNR {:.2} dB",
            d.pixels,
            d.off,
            TOLERANCE,
            100.0 * d.off_share(),
            d.largest,
            d.psnr
        );
        println!("{numbers}");
        let limit = limits.iter().find(|(image, _)| *image == name);
        let &(_, (off, psnr)) = limit.unwrap_or_else(|| panic!("{name} is not in the table of {PAGE}"));
        if std::env::var_os("FILLRATE_BLESS").is_some() {
            bless(&name, &d);
            continue;
        }
        if d.off as u64 > off || d.psnr < psnr {
            let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
            let file = name.replace('/', "-");
            let (image, difference) = (folder.join(format!("{file}.png")), folder.join(format!("{file}-difference.png")));
            ours.save(&image).expect("a file for the image");
            d.picture.save(&difference).expect("a file for the difference");
            let files = [image.display(), difference.display()];
            failures.push(format!(
                "{numbers}\n  allowed: {off} pixels, {psnr} dB; the image is {}, the difference {}",
                files[0], files[1]
            ));
        }
    }
    failures
}

/// Replays traces without a machine, hands on each replay, and compares all with the references.
fn compare_all(cases: &[Case], also: impl Fn(&Case, &Replay)) {
    let limits = limits();
    let mut failures = Vec::new();
    for case in cases {
        let functional = run(case, Fidelity::Functional, config("baseline"));
        failures.extend(differences(case, &functional, &limits));
        also(case, &functional);
    }
    assert!(failures.is_empty(), "images beyond their limits:\n{}", failures.join("\n"));
}

/// From this number of shaded fragments on, a trace is drawn by one machine only, since more machines take long.
const LARGE: f64 = 200_000.0;

/// Counters that depend on the machine: how long it keeps shaded vertices, and which fragments it finds hidden before tests.
const OF_MACHINES: [&str; 3] = ["vertices_shaded", "tiles_hiz_culled", "quads_hiz_culled"];

/// The card's own image is the renderer's on every machine, and so are its counters.
fn machines_agree(case: &Case, functional: &Replay) {
    // Of large pictures one machine: `tests/machine/sort_traces.rs` draws them on one of each class.
    let large = functional.total.number("funnel.fragments_shaded").is_some_and(|shaded| shaded > LARGE);
    let cards: &[&str] = if large { &["baseline"] } else { &["baseline", "tiny"] };
    for &card in cards {
        let cycle = run(case, Fidelity::Cycle, config(card));
        assert_eq!(cycle.frames.len(), functional.frames.len(), "{} on {card}: frames", case.name);
        for (a, b) in functional.frames.iter().zip(&cycle.frames) {
            assert_eq!(a.number, b.number, "{} on {card}", case.name);
            let bytes = |frame: &Frame| frame.shown.as_ref().map(|(_, bytes)| bytes.clone());
            assert!(bytes(a) == bytes(b), "{} on {card}: frame {} differs", case.name, a.number);
        }
        for name in Funnel::DECLARATIONS.iter().map(|counter| counter.name).filter(|name| !OF_MACHINES.contains(name)) {
            let count = |replay: &Replay| replay.total.number(&format!("funnel.{name}"));
            assert_eq!(count(functional), count(&cycle), "{} on {card}: {name}", case.name);
        }
        let json = cycle.total.json();
        let wrong = json.pointer("/sort/wrong_pixels").and_then(serde_json::Value::as_u64);
        assert_eq!(wrong, Some(0), "{} on {card}: wrong pixels", case.name);
    }
}

#[test]
fn scenes_are_near_their_references() {
    compare_all(&scenes(), |case, functional| {
        // Machines draw the others in `tests/machine/laws.rs`.
        if case.name == "torus-knot" {
            machines_agree(case, functional);
        }
    });
}

#[test]
fn a_scene_in_several_orders_has_one_picture() {
    for names in ORDERS {
        let picture = |name: &&str| {
            let case = Case { name: (*name).into(), trace: here(&format!("traces/{name}.zip")), references: Vec::new() };
            // Machines draw each as the renderer does: `tests/machine/sort_traces.rs`.
            let replay = run(&case, Fidelity::Functional, config("baseline"));
            (replay.frames[0].shown.as_ref().expect("a picture").1.clone(), replay.total.number("funnel.triangles_setup"))
        };
        let pictures: Vec<_> = names.iter().map(picture).collect();
        assert!(pictures[0].1.is_some_and(|triangles| triangles > 500.0), "{names:?} show little");
        assert!(pictures.iter().all(|own| *own == pictures[0]), "{names:?} differ");
    }
}

#[test]
fn fixtures_are_near_their_references_and_machines_draw_them_as_the_renderer_does() {
    compare_all(&fixtures(), machines_agree);
}

#[test]
fn visible_traces_are_near_their_references_and_machines_draw_them_as_the_renderer_does() {
    compare_all(&peers(), machines_agree);
}

#[test]
fn pictures_keep_alpha_unless_the_display_ignores_it() {
    let home = tempfile::tempdir().expect("a folder");
    for (opaque, alpha) in [(false, 64), (true, 255)] {
        let mut card = Recorder::new("alpha");
        let desc = TextureDesc { opaque, ..record::texture_2d(3, 2, Format::Rgba8Unorm) };
        let texture = card.create_texture("shown", desc);
        let view = card.create_view(texture);
        drop(card.begin_render_pass([record::clear(view, [1.0, 0.0, 0.2, 0.25])], None));
        card.present(texture);
        let trace = home.path().join(format!("trace-{opaque}"));
        std::fs::create_dir(&trace).expect("a folder");
        card.save(&trace).expect("written");
        for fidelity in ["functional", "cycle"] {
            let out = home.path().join(format!("{opaque}-{fidelity}"));
            let mut replay = Command::new(cargo_bin!("fillrate"));
            replay.arg("replay").arg(&trace).args(["--config", "tiny", "--fidelity", fidelity, "--out"]).arg(&out);
            replay.assert().success();
            let image = image::open(out.join("frame-0000.png")).expect("a picture");
            assert!(image.color().has_alpha());
            let image = image.into_rgba8();
            assert!(image.pixels().all(|pixel| pixel.0 == [255, 0, 51, alpha]), "{fidelity}: {:?}", image.get_pixel(0, 0));
            // A picture without alpha is compared by its colours.
            let reference = out.join("reference.png");
            image::RgbImage::from_pixel(3, 2, image::Rgb([255, 0, 51])).save(&reference).expect("written");
            let mut compare = Command::new(cargo_bin!("fillrate"));
            compare.arg("compare").arg(out.join("frame-0000.png")).arg(&reference).assert().success();
        }
    }
}
