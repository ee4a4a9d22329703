//! What must hold of the import of any bytes as a wgpu trace, for the property tests and the fuzz target.

use std::path::Path;

use trace::{self, TraceError};

/// Imports a text whose files are those in `folder`: the answer is a trace, which can be checked, or an error with a place in
/// the file.
pub fn import_everything(folder: &Path, text: &[u8]) {
    let file = folder.join("trace.ron");
    match import::wgpu::import(&file, text) {
        Ok(imported) => {
            // The checker may refuse it, with a message.
            if let Err(error) = trace::check(&imported) {
                assert!(!error.to_string().is_empty());
            }
            imported.for_each_command::<TraceError>(|_, _| Ok(())).expect("commands in memory");
        }
        Err(error) => {
            assert_eq!(error.file, file);
            assert!(error.place.is_some(), "without a place: {error}");
            assert!(!error.reason.is_empty());
        }
    }
}
