//! Whatever bytes are given as the text of a wgpu trace, importing and checking them ends with a trace or a message.

#![no_main]

use std::path::Path;

#[path = "../../crates/import/tests/import/oracle.rs"]
mod oracle;

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    oracle::import_everything(&Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/import/tests/import/all"), data);
});
