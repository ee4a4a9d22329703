//! Captured Vulkan programs: against reference images of Mesa's lavapipe, which are not part of the repository (`FILLRATE_PEERS` names the folder
//! that holds `vulkan/`), against the trace that wgpu made of the same program, and such as the writer of the format makes.

use std::fs;
use std::path::Path;

use fillrate::num::Limits;
use fillrate::report::references::{Manifest, Standing};
use image::RgbaImage;

use crate::cli::run;

#[path = "../../crates/import/tests/import/capture.rs"]
#[expect(dead_code, reason = "tests of the importer use the rest")]
mod capture;

/// What a functional replay leaves of a trace of one frame: its statistics without the trace's name, and its picture.
fn replayed(trace: &Path) -> (serde_json::Value, RgbaImage) {
    let out = tempfile::tempdir().expect("a folder");
    let [trace, folder] = [trace, out.path()].map(|path| path.display().to_string());
    let (code, _, message) = run(&["replay", &trace, "--fidelity", "functional", "--force", "--out", &folder]);
    assert_eq!(code, 0, "{trace}: {message}");
    let text = fs::read_to_string(out.path().join("stats.json")).expect("statistics");
    let mut statistics: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    statistics["trace"] = serde_json::Value::Null;
    (statistics, image::open(out.path().join("frame-0000.png")).expect("a picture").into_rgba8())
}

/// The picture of a capture of one frame.
fn picture(capture: &capture::Capture) -> RgbaImage {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("made.gfxr");
    fs::write(&path, capture.bytes()).expect("a file");
    replayed(&path).1
}

#[test]
fn inspect_counts_shaders_and_names_what_is_refused_with_its_cause_first() {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("made.gfxr");
    fs::write(&path, capture::with_geometry().bytes()).expect("a file");
    let (code, text, message) = run(&["inspect", &path.display().to_string()]);
    assert_eq!(code, 1, "{message}");
    let mut lines = text.lines().skip_while(|line| !line.starts_with("  shaders accepted "));
    assert!(lines.next().is_some_and(|line| line.ends_with(" 5 of 6")), "{text}");
    let shader = "shader refused: shader stage VK_SHADER_STAGE_GEOMETRY_BIT: a pipeline, 1 times, first in block ";
    assert!(lines.next().is_some_and(|line| line.starts_with(shader)), "{text}");
    let draws = "refused: a geometry stage: vkCmdDraw, 2 times, first in block ";
    assert!(lines.next().is_some_and(|line| line.starts_with(draws)), "{text}");
    let (_, json, _) = run(&["inspect", &path.display().to_string(), "--json"]);
    let json: serde_json::Value = serde_json::from_str(&json).expect("JSON");
    assert_eq!((&json["translation"]["accepted_shaders"], &json["translation"]["refused"][0]["times"]), (&5.into(), &2.into()));
}

#[test]
fn a_wgpu_program_gives_the_same_picture_and_funnel_as_vulkan() {
    let pair = Path::new("crates/import/tests/import/pair");
    let (own, through_vulkan) = (replayed(&pair.join("trace")), replayed(&pair.join("cube.gfxr")));
    assert!(own.0["total"]["funnel"]["triangles_setup"].as_u64() > Some(0), "{}", own.0);
    assert_eq!(through_vulkan.0, own.0);
    assert!(through_vulkan.1 == own.1, "the pictures differ");
}

#[test]
fn passes_that_touch_the_same_memory_are_ordered_with_or_without_a_barrier() {
    let home = tempfile::tempdir().expect("a folder");
    let path = home.path().join("made.gfxr").display().to_string();
    let out = home.path().join("out").display().to_string();
    let waits = |own: bool, barrier: bool, config: &str| {
        fs::write(&path, capture::two_passes(own, barrier).bytes()).expect("a file");
        let (code, _, message) = run(&["replay", &path, "--config", config, "--images", "none", "--force", "--out", &out]);
        assert_eq!(code, 0, "{message}");
        let text = fs::read_to_string(Path::new(&out).join("stats.json")).expect("statistics");
        let statistics: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let count = |name: &str| statistics["total"]["command"][name].as_u64().expect("a count");
        (count("overlapped"), count("waited"))
    };
    // The end of the frame waits, too.
    assert_eq!([false, true].map(|barrier| waits(false, barrier, "baseline")), [(0, 2); 2]);
    assert_eq!([false, true].map(|barrier| waits(true, barrier, "baseline")), [(1, 1); 2]);
    // Where tiles are drawn from bins no pass begins before the one before has ended.
    assert_eq!([false, true].map(|own| waits(own, true, "sort-middle-binned")), [(0, 0); 2]);
}

#[test]
fn a_subpass_reads_one_sample_of_a_multisampled_attachment() {
    let picture = picture(&capture::multisampled_attachment());
    assert_eq!(picture.dimensions(), (8, 4));
    for (x, _, pixel) in picture.enumerate_pixels() {
        let green = (x as f32 / 8.0 * 255.0).round() as u8;
        assert!(pixel[0].abs_diff(128) <= 1 && pixel[1].abs_diff(green) <= 1, "{pixel:?} in column {x}");
    }
}

#[test]
fn shaders_read_the_programs_numbers_of_draws_and_workgroups() {
    let filled = |capture: &capture::Capture, channel: usize| -> Vec<u32> {
        let picture = picture(capture);
        picture.enumerate_pixels().filter(|(.., pixel)| pixel[channel] == 255).map(|(x, y, _)| y * 8 + x).collect()
    };
    let rows =
        |columns: std::ops::Range<u32>| -> Vec<u32> { (0..4).flat_map(|y| columns.clone().map(move |x| y * 8 + x)).collect() };
    assert_eq!(filled(&capture::numbered(naga::BuiltIn::BaseInstance), 0), rows(0..5));
    assert_eq!(filled(&capture::numbered(naga::BuiltIn::DrawIndex), 0), rows(2..5));
    assert_eq!(filled(&capture::dispatched_from(), 0), [3, 4, 9, 10, 19, 20, 25, 26]);
}

#[test]
fn captures_look_as_their_references_or_are_refused_by_name() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        return eprintln!("left out: FILLRATE_PEERS is not set, so there are no captured Vulkan programs to replay");
    };
    let manifest = Manifest::read(Path::new("tests/program/vulkan.ron")).expect("the manifest");
    let mut failures = Vec::new();
    for recording in &manifest.recordings {
        let name = recording.folder.display();
        match recording.compare(Path::new(&root), &Limits::default()) {
            Ok(rows) => failures.extend(
                rows.iter()
                    .filter(|row| recording.standing(&manifest, row) == Standing::Off)
                    .map(|row| format!("{name}: {row:?}")),
            ),
            Err(error) => failures.push(format!("{name}: {error:#}")),
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}
