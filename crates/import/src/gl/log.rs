//! What a machine notes about its recording.

use std::rc::Rc;

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
    /// Labels of the debug groups that are open, the outermost first.
    pub groups: Rc<[Rc<str>]>,
    /// Groups inside these, which are only counted.
    pub deeper: u64,
}

/// Debug groups whose labels are kept, from the outermost on.
const GROUPS_MAX: usize = 64;

impl Log {
    /// A debug group begins.
    pub fn enter_group(&mut self, label: &str) {
        if self.groups.len() == GROUPS_MAX {
            self.deeper += 1;
        } else {
            self.groups = self.groups.iter().cloned().chain([label.into()]).collect();
        }
    }

    /// A debug group ends. None: there is none.
    pub fn leave_group(&mut self) -> Option<()> {
        if self.deeper > 0 {
            self.deeper -= 1;
        } else {
            let (_, outer) = self.groups.split_last()?;
            self.groups = outer.into();
        }
        Some(())
    }

    /// Counts a feature that is not supported.
    pub fn refuse(&mut self, what: String) {
        self.unsupported.get_or_insert_with(&what, || Count { times: 0, first: self.number }).times += 1;
    }

    /// Counts an OpenGL error of the call that runs.
    pub fn note_error(&mut self, what: &str) {
        self.errors.get_or_insert_with(what, || Count { times: 0, first: self.number }).times += 1;
    }
}
