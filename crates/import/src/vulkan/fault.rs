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

/// Something that is not supported, with how often and where it is asked for.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Refusal {
    /// The name of what is not supported, or why.
    pub cause: String,
    /// The call that asks for it.
    pub call: String,
    /// The number of times.
    pub times: u64,
    /// The number of the first block that asks for it.
    pub first: u64,
}

/// What is not supported, and so left out.
#[derive(Default)]
pub struct Log {
    refused: NameMap<Refusal>,
    /// What a person who sees the pictures needs to know.
    pub notes: Vec<String>,
    /// The number of the block that is read.
    pub block: u64,
}

impl Log {
    /// Counts what is refused of a call.
    pub fn refuse(&mut self, call: &str, block: u64, what: &str) {
        let new = || Refusal { cause: what.to_owned(), call: call.to_owned(), times: 0, first: block };
        self.refused.get_or_insert_with(&format!("{call}: {what}"), new).times += 1;
    }

    /// Notes what a person who sees the pictures needs to know, once.
    pub fn note(&mut self, note: String) {
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// All that was refused, by the first block: what is refused because of something else comes behind that.
    pub fn refusals(&self) -> Vec<&Refusal> {
        let mut all: Vec<(&str, &Refusal)> = self.refused.iter().collect();
        all.sort_by_key(|(what, refusal)| (refusal.first, *what));
        all.into_iter().map(|(_, refusal)| refusal).collect()
    }

    /// All that was refused on one line, by the first block; none if nothing was.
    pub fn refusal(&self) -> Option<String> {
        let all = self.refusals();
        let one = |Refusal { cause, call, times, first }: &Refusal| {
            format!("{call}: {cause} ({times} times, first in block {first})")
        };
        (!all.is_empty()).then(|| all.into_iter().map(one).collect::<Vec<_>>().join("; "))
    }
}
