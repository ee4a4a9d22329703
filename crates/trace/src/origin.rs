//! What an importer knows of a recording beside its commands.

/// Lines that are kept about actions that are left out.
const SKIPPED_MAX: usize = 1000;

/// What an importer knows of a recording beside its commands.
#[derive(Clone, Debug, Default)]
pub struct Origin {
    /// What a reader of the trace has to be warned of.
    pub warnings: Vec<String>,
    /// What the recorded program asked for and showed, by name.
    pub facts: Vec<(String, String)>,
    /// More of that, for a reader who asks for all.
    pub details: Vec<(String, String)>,
    skipped: Vec<String>,
    skips: u64,
}

impl Origin {
    /// Notes an action that is left out, because it failed when it was recorded, or because what it makes is not supported and not used.
    pub fn skip(&mut self, line: impl FnOnce() -> String) {
        self.skips += 1;
        if self.skipped.len() < SKIPPED_MAX {
            self.skipped.push(line());
        }
    }

    /// How many actions are left out, and a line about each of the first.
    pub fn skipped(&self) -> (u64, &[String]) {
        (self.skips, &self.skipped)
    }
}
