//! What a machine notes about its recording.

use num::NameMap;

use crate::report::{Count, Counts};

/// Facts that a machine collects about its recording.
#[derive(Default)]
pub struct Log {
    /// What is not supported.
    pub unsupported: Counts,
    /// Calls that raise an error.
    pub errors: Counts,
    /// Versions of contexts, as the recorded driver has called them.
    pub versions: NameMap<()>,
    /// Uses of occlusion queries.
    pub queries: u64,
    /// The number of the call that runs.
    pub number: u64,
}

impl Log {
    /// Counts a feature that is not supported.
    pub fn refuse(&mut self, what: String) {
        self.unsupported.get_or_insert_with(&what, || Count { times: 0, first: self.number }).times += 1;
    }

    /// Counts an OpenGL error of the call that runs.
    pub fn note_error(&mut self, what: &str) {
        self.errors.get_or_insert_with(what, || Count { times: 0, first: self.number }).times += 1;
    }
}
