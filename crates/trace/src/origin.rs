//! What is known of a recording beside the commands that were made from it.

/// Lines that are kept about actions that are left out.
const SKIPPED_MAX: usize = 1000;

/// What is known of a recording beside the commands that were made from it.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Origin {
    /// What the commands leave out, because it is not supported: the pictures lack it.
    pub left_out: Option<String>,
    /// How the end of the recording is cut, and what of it is replayed: a sentence.
    pub cut: Option<String>,
    /// Other facts that a person who sees the pictures needs, a sentence each.
    pub notes: Vec<String>,
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
