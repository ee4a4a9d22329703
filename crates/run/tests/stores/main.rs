//! What the stores of a machine hold is what the renderer believes: random sequences of passes, and cases with values by hand.

mod cases;
mod check;
mod pixels;
mod sequence;

use std::num::NonZeroU32;
use std::sync::Mutex;

use check::Machines;
use machine::Config;
use num::Random;
use rayon::prelude::*;
use run::replay::{Fidelity, Options, replay};
use sequence::{Choices, Sequence};
use trace::Trace;

/// A number from the environment.
fn setting(name: &str, otherwise: u64) -> u64 {
    std::env::var(name).map_or(otherwise, |text| text.parse().unwrap_or_else(|_| panic!("{name} is no number")))
}

fn of_seed(seed: u64) -> Sequence {
    sequence::sequence(&mut Choices::Random(Random::nth(56, seed)))
}

/// Each is drawn on a third of the machines. More of them, on all: `FILLRATE_SEQUENCES=5000 cargo test -p fillrate-run --test stores random --
/// --nocapture`, from the seed `FILLRATE_SEQUENCE_FIRST` on.
#[test]
fn random_sequences_of_passes_look_the_same_on_every_machine() {
    let first = setting("FILLRATE_SEQUENCE_FIRST", 0);
    let count = setting("FILLRATE_SEQUENCES", 300);
    let parts = if std::env::var_os("FILLRATE_SEQUENCES").is_some() { 1 } else { 3 };
    let machines = Machines::new();
    let (wrong, replays) = (Mutex::new(Vec::new()), Mutex::new(0));
    (first..first + count).into_par_iter().for_each(|seed| {
        match machines.check(&of_seed(seed), seed as usize % parts, parts) {
            Ok(ran) => *replays.lock().expect("no thread has panicked") += ran,
            Err(reason) => wrong.lock().expect("no thread has panicked").push((seed, reason)),
        }
    });
    let mut wrong = wrong.into_inner().expect("no thread has panicked");
    wrong.sort();
    println!("{count} sequences, {} replays, {} wrong", replays.into_inner().expect("no thread has panicked"), wrong.len());
    let few: Vec<String> = wrong.iter().take(10).map(|(seed, reason)| format!("seed {seed}: {reason}")).collect();
    assert!(wrong.is_empty(), "{} of {count} sequences are wrong:\n{}", wrong.len(), few.join("\n"));
}

#[test]
fn frames_in_runs_show_what_frames_in_a_row_show() {
    for seed in 0..16 {
        let Sequence { trace, frames, .. } = of_seed(seed);
        let functional = replayed(&trace, Fidelity::Functional, None);
        assert_eq!(functional.len(), frames as usize);
        assert!(replayed(&trace, Fidelity::Cycle, NonZeroU32::new(2)) == functional, "seed {seed}");
    }
}

/// What the frames of a replay on a small machine show.
fn replayed(trace: &Trace, fidelity: Fidelity, frames_per_run: Option<NonZeroU32>) -> Vec<Vec<u8>> {
    let config = Config::built_in("tiny").unwrap_or_else(|error| panic!("{error}"));
    let options = Options { frames_per_run, ..Options::new(config, fidelity) };
    let replay = replay(trace, &options, &|_| ()).unwrap_or_else(|error| panic!("{error:#}"));
    replay.frames.iter().map(|frame| frame.shown.as_ref().map_or(Vec::new(), |(_, bytes)| bytes.to_vec())).collect()
}

/// Writes a sequence to a folder: `FILLRATE_SEQUENCE_FIRST=7 FILLRATE_SEQUENCE_OUT=/tmp/seven cargo test -p fillrate-run --test stores write -- --ignored`.
#[test]
#[ignore = "writes where the environment says"]
fn write_a_sequence() {
    let out = std::env::var("FILLRATE_SEQUENCE_OUT").expect("FILLRATE_SEQUENCE_OUT names a folder");
    let Sequence { trace, .. } = of_seed(setting("FILLRATE_SEQUENCE_FIRST", 0));
    trace::write(&trace, out).unwrap_or_else(|error| panic!("{error}"));
}
