//! The kept scenes: recording them again gives the same bytes, they keep all rules, and their shaders are valid.

use std::fs;
use std::path::{Path, PathBuf};

use fillrate::scenes;
use fillrate::trace::{Trace, check};

/// Bytes of a scene at most.
const LARGEST: u64 = 2 << 20;

fn kept() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("traces")
}

/// The files of a scene, by name, in order.
fn files(path: &Path) -> Vec<(String, Vec<u8>)> {
    if path.is_file() {
        return vec![("archive".into(), fs::read(path).unwrap())];
    }
    let mut files: Vec<_> = fs::read_dir(path)
        .unwrap_or_else(|error| panic!("{}: {error}", path.display()))
        .map(|entry| {
            let path = entry.unwrap().path();
            (path.file_name().unwrap().to_str().unwrap().to_owned(), fs::read(path).unwrap())
        })
        .collect();
    files.sort();
    files
}

#[test]
fn recording_again_gives_the_kept_bytes() {
    let dir = tempfile::tempdir().unwrap();
    for scene in scenes::ALL {
        scene.save(dir.path()).unwrap();
        let (new, old) = (files(&scene.path(dir.path())), files(&scene.path(&kept())));
        let names = |files: &[(String, Vec<u8>)]| files.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>();
        assert_eq!(names(&new), names(&old), "{}", scene.name);
        for ((name, new), (_, old)) in new.iter().zip(&old) {
            assert!(
                new == old,
                "{}/{name} has changed: run `cargo run --example record_scenes` and look at the image",
                scene.name
            );
        }
        let bytes: usize = new.iter().map(|(_, bytes)| bytes.len()).sum();
        assert!((bytes as u64) < LARGEST, "{} has {bytes} bytes", scene.name);
    }
    let count = fs::read_dir(kept()).unwrap().count();
    assert_eq!(count, scenes::ALL.len(), "traces/ holds something that is not recorded");
}

#[test]
fn scenes_keep_all_rules() {
    for scene in scenes::ALL {
        let trace = Trace::open(scene.path(&kept())).unwrap();
        let summary = check(&trace).unwrap_or_else(|error| panic!("{error}"));
        println!("{}: {summary:?}", scene.name);
        assert!(summary.draws > 0 && summary.presented.is_some(), "{}", scene.name);
        let frames = match scene.name {
            "particles" => 4,
            "flight" => 600,
            "panel" => 4,
            _ => 1,
        };
        assert_eq!(summary.frames, frames, "{}", scene.name);
    }
}

#[test]
fn shaders_are_valid() {
    for scene in scenes::ALL {
        let trace = Trace::open(scene.path(&kept())).unwrap();
        for name in trace.blob_names().filter(|name| name.ends_with(".wgsl")) {
            let text = trace.text(name).unwrap();
            let module = naga::front::wgsl::parse_str(&text)
                .unwrap_or_else(|error| panic!("{}: {}", scene.name, error.emit_to_string_with_path(&text, name)));
            naga::valid::Validator::new(naga::valid::ValidationFlags::all(), naga::valid::Capabilities::all())
                .validate(&module)
                .unwrap_or_else(|error| panic!("{}: {}", scene.name, error.emit_to_string_with_path(&text, name)));
        }
    }
}
