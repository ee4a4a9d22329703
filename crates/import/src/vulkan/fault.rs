//! What is wrong with a call, and what is collected over a whole capture.

use num::NameMap;

/// Why a call is not carried out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Fault {
    /// The capture contradicts itself or the format.
    Damaged(String),
    /// The capture asks for more than a limit allows.
    Limit(String),
    /// It asks for what is not supported.
    Unsupported(String),
}

/// What a call comes to.
pub type Outcome<T = ()> = Result<T, Fault>;

/// A call is refused by the name of what it asks for.
pub fn unsupported<T>(what: impl Into<String>) -> Outcome<T> {
    Err(Fault::Unsupported(what.into()))
}

/// How often something is refused, and where first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Count {
    times: u64,
    first: u64,
}

/// What is not supported, and so left out.
#[derive(Default)]
pub struct Log {
    refused: NameMap<Count>,
    /// What a person who sees the pictures needs to know.
    pub notes: Vec<String>,
    /// The number of the block that is read.
    pub block: u64,
}

impl Log {
    /// Counts what is refused of a call.
    pub fn refuse(&mut self, call: &str, block: u64, what: &str) {
        self.refused.get_or_insert_with(&format!("{call}: {what}"), || Count { times: 0, first: block }).times += 1;
    }

    /// Notes what a person who sees the pictures needs to know, once.
    pub fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// All that was refused on one line, by the first block; none if nothing was.
    pub fn refusal(&self) -> Option<String> {
        let mut all: Vec<(&str, &Count)> = self.refused.iter().collect();
        all.sort_by_key(|(what, count)| (count.first, *what));
        let one = |(what, count): (&str, &Count)| format!("{what} ({} times, first in block {})", count.times, count.first);
        (!all.is_empty()).then(|| all.into_iter().map(one).collect::<Vec<_>>().join("; "))
    }
}
