//! Recorded OpenGL programs against reference images: Mesa's llvmpipe for apitrace's recordings, ATTILA for GLInterceptor's. They are not part
//! of the repository: `FILLRATE_PEERS` names the folder that holds `gl/` and `attila/`. Only short recordings are replayed here.

use std::path::Path;

use fillrate::num::Limits;
use fillrate::report::references::{Manifest, Standing};

#[test]
fn recordings_look_as_their_references() {
    let Some(root) = std::env::var_os("FILLRATE_PEERS") else {
        return eprintln!("left out: FILLRATE_PEERS is not set, so there are no recorded OpenGL programs to replay");
    };
    let manifest = Manifest::read(Path::new("tests/program/recordings.ron")).expect("the manifest");
    let mut failures = Vec::new();
    for recording in manifest.recordings.iter().filter(|recording| recording.least.is_some()) {
        let name = recording.folder.display();
        for row in recording.compare(Path::new(&root), &Limits::default()).unwrap_or_else(|error| panic!("{name}: {error:#}")) {
            if recording.standing(&manifest, &row) == Standing::Off {
                failures.push(format!("{name}: {row:?}"));
            }
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
}

#[test]
fn a_manifest_says_what_is_wrong_with_it() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("m.ron");
    let error = |text: &str| {
        std::fs::write(&path, text).expect("a file");
        format!("{:#}", Manifest::read(&path).expect_err("no manifest"))
    };
    let kinds = r#"kinds: {"a": (psnr: 32.0, off: 1.0)}"#;
    let unknown = error(&format!(r#"({kinds}, recordings: [(folder: "x", kind: "b")])"#));
    assert!(unknown.contains("m.ron") && unknown.contains(r#"x: kind "b" is none of: a"#), "{unknown}");
    let key = error(&format!(r#"({kinds}, recordings: [(folder: "x", kind: "a", psnr: 3.0)])"#));
    assert!(key.contains("m.ron") && key.contains("psnr"), "{key}");
    let empty = error(&format!("({kinds}, recordings: [])"));
    assert!(empty.contains("it names no recording"), "{empty}");
    std::fs::write(&path, format!(r#"({kinds}, recordings: [(folder: "x", kind: "a")])"#)).expect("a file");
    let manifest = Manifest::read(&path).expect("a manifest");
    let missing =
        format!("{:#}", manifest.recordings[0].compare(folder.path(), &Limits::default()).expect_err("nothing there"));
    assert!(missing.contains("x has no reference"), "{missing}");
}
