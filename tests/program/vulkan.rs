//! Captured Vulkan programs against reference images of Mesa's lavapipe. They are not part of the repository: `FILLRATE_PEERS` names the folder
//! that holds `vulkan/`.

use std::path::Path;

use fillrate::num::Limits;
use fillrate::report::references::{Manifest, Standing};

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
