//! What holds a frame back, in the words that `replay`, `why` and pages share: cause, size, remedy.
//!
//! Counters prove causes and their sizes. What a remedy saves is known where the frame was timed with it (`why`).

use serde_json::{Value, json};

use super::summary::grouped;
use super::waits::{Waited, Waits};
use crate::work::Funnel;

/// A cause that a program can remove from its frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// Primitives out of view.
    OffScreen,
    /// Fragments that are shaded and hidden by what was drawn before.
    Hidden,
    /// Helper invocations.
    Helpers,
}

/// The least share of its kind for which a cause is named.
const LEAST: f64 = 0.2;

/// Vertices of a draw on average, below which draws are called small.
const SMALL: u64 = 1000;

impl Cause {
    /// All of them, in the order of the stages that they burden.
    pub const ALL: [Cause; 3] = [Cause::OffScreen, Cause::Hidden, Cause::Helpers];

    /// The part and the whole that it is a share of.
    fn counts(self, of: &Funnel) -> (u64, u64) {
        match self {
            Cause::OffScreen => (of.culled_frustum, of.primitives_in),
            Cause::Hidden => (of.fragments_late_failed, of.fragments_shaded),
            Cause::Helpers => (of.helper_fragments, of.helper_fragments + of.fragments_shaded),
        }
    }

    /// Its share, if that is worth naming.
    pub fn share(self, of: &Funnel) -> Option<f64> {
        let (part, all) = self.counts(of);
        let share = part as f64 / all.max(1) as f64;
        (share >= LEAST).then_some(share)
    }

    /// Whether nothing of a draw is used: each primitive, fragment or invocation is one of this cause.
    pub fn is_all_of(self, draw: &Funnel) -> bool {
        let (part, all) = self.counts(draw);
        part > 0 && part == all
    }

    /// The cause with its size: `71 % of the primitives are off screen`.
    pub fn text(self, share: f64) -> String {
        let share = format!("{:.0} % of the", 100.0 * share);
        match self {
            Cause::OffScreen => format!("{share} primitives are off screen"),
            Cause::Hidden => format!("{share} shaded fragments are hidden by what was drawn before"),
            Cause::Helpers => format!("{share} fragment invocations are helpers at the edges of triangles"),
        }
    }

    /// The remedy.
    pub fn remedy(self) -> &'static str {
        match self {
            Cause::OffScreen => "not drawing them",
            Cause::Hidden => "rejecting them before shading",
            Cause::Helpers => "drawing larger triangles",
        }
    }

    /// Knobs of a card that removes the cause in place of the program, so that an experiment knows what the remedy saves.
    pub fn knobs(self) -> &'static [&'static str] {
        match self {
            Cause::OffScreen => &["command.cull"],
            Cause::Hidden => &["depth.early", "bin.hide"],
            Cause::Helpers => &[],
        }
    }
}

/// Draws with their mean size.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Draws {
    /// How many; 0: not known.
    pub count: u64,
    /// Vertices that they read.
    pub vertices: u64,
}

/// The object of "waits for", where units of a phase wait long.
pub fn object(waits: &Waits, draws: Draws) -> Option<String> {
    let (waited, _) = waits.longest()?;
    Some(match waited {
        Waited::Indices(_) if draws.count > 1 => {
            let small = if draws.vertices / draws.count < SMALL { "small " } else { "" };
            format!("the indices of {} {small}draws", grouped(draws.count))
        }
        Waited::Indices(_) => "indices".into(),
        Waited::Textures => "textures".into(),
        Waited::Instructions(unit) => format!("the latency of instructions in {unit}"),
        Waited::Memory(unit) => format!("the memory of {unit}"),
    })
}

/// A finding: a sentence, with what proves it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Finding {
    /// Cause, size and remedy, without a full stop.
    pub sentence: String,
    /// What was counted.
    pub evidence: String,
    /// Settings that repeat the experiment.
    pub set: Vec<String>,
    /// Numbers of the draws concerned.
    pub draws: Vec<u32>,
}

impl Finding {
    /// As JSON.
    pub fn json(&self) -> Value {
        json!({ "sentence": self.sentence, "evidence": self.evidence, "set": self.set, "draws": self.draws })
    }

    /// The draws concerned, in words; empty where there are none.
    pub fn draws(&self) -> String {
        numbers(&self.draws)
    }
}

/// Numbers of draws as a list of spans, as far as a few lines go.
pub fn numbers(draws: &[u32]) -> String {
    const MOST: usize = 24;
    if draws.is_empty() {
        return String::new();
    }
    let spans: Vec<&[u32]> = draws.chunk_by(|a, b| a + 1 == *b).collect();
    let told = spans.iter().take(MOST).map(|span| match span {
        [one] => one.to_string(),
        [first, second] => format!("{first}, {second}"),
        [first, .., last] => format!("{first} to {last}"),
        [] => String::new(),
    });
    let more: usize = spans.iter().skip(MOST).map(|span| span.len()).sum();
    let rest = if more > 0 { format!(" and {} more", grouped(more as u64)) } else { String::new() };
    let s = if draws.len() == 1 { "draw" } else { "draws" };
    format!("{} {s}: {}{rest}", grouped(draws.len() as u64), told.collect::<Vec<_>>().join(", "))
}

/// A sentence with its capital and its full stop.
pub fn sentence(text: &str) -> String {
    let mut letters = text.chars();
    let stop = if text.ends_with('.') { "" } else { "." };
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect::<String>() + stop)
}

/// What counters alone prove: the causes with their sizes, and what the phase that takes most waits for. `phase`: its name, its share of the
/// frame, what limits it, by the word for it, and its waits.
pub fn counted(funnel: &Funnel, phase: Option<(&str, f64, (&str, &str), &Waits)>, draws: Draws) -> Vec<String> {
    let named = |cause: Cause| Some(sentence(&cause.text(cause.share(funnel)?)));
    let mut said: Vec<String> = Cause::ALL.into_iter().filter_map(named).collect();
    if let Some((name, share, (word, limit), waits)) = phase {
        let takes = format!("{name} takes {:.0} % of the cycles", 100.0 * share);
        // Where nothing was estimated, what waits long is known all the same.
        let waited = object(waits, draws).zip(waits.text()).filter(|_| word == "waits" || limit.is_empty());
        said.push(match waited {
            Some((object, text)) => sentence(&format!("{takes} and waits for {object}: {text}")),
            None if limit.is_empty() => sentence(&takes),
            None => sentence(&format!("{takes}; by counts and rates, {limit} limits it")),
        });
    }
    said
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn causes_are_named_from_a_fifth_on() {
        let funnel =
            Funnel { primitives_in: 100, culled_frustum: 71, fragments_shaded: 90, helper_fragments: 10, ..Funnel::default() };
        assert_eq!(counted(&funnel, None, Draws::default()), ["71 % of the primitives are off screen."]);
        assert_eq!(counted(&Funnel::default(), None, Draws::default()), [""; 0]);
        assert!(Cause::OffScreen.is_all_of(&Funnel { primitives_in: 3, culled_frustum: 3, ..Funnel::default() }));
        assert!(!Cause::OffScreen.is_all_of(&Funnel::default()));
        let limit = ("limit", "core");
        let said = counted(&Funnel::default(), Some(("pass 0", 0.8, limit, &Waits::default())), Draws::default());
        assert_eq!(said, ["Pass 0 takes 80 % of the cycles; by counts and rates, core limits it."]);
    }

    #[test]
    fn draws_are_listed_as_spans() {
        assert_eq!(numbers(&[3]), "1 draw: 3");
        assert_eq!(numbers(&[0, 1, 2, 5, 8, 9]), "6 draws: 0 to 2, 5, 8, 9");
        let apart: Vec<u32> = (0..30).map(|at| 2 * at).collect();
        assert!(numbers(&apart).ends_with(", 46 and 6 more"), "{}", numbers(&apart));
    }
}
