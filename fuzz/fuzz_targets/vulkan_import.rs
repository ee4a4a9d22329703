//! Whatever is changed in a capture of a Vulkan program, importing and checking it ends with a trace or a message. The first byte chooses the
//! capture, and six each a change.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

#[path = "../../crates/import/tests/import/capture.rs"]
mod capture;
#[path = "../../crates/import/tests/import/damaged.rs"]
mod damaged;

/// The file that holds the capture.
static FILE: LazyLock<PathBuf> =
    LazyLock::new(|| std::env::temp_dir().join(format!("fillrate-vulkan-import-{}.gfxr", std::process::id())));

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    damaged::import_damaged(&FILE, data);
});
