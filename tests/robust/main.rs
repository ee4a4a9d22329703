//! Mutations of real shaders, configurations and traces, and random primitives: none of them makes the readers, the compiler, the
//! rasteriser or a replay crash. `fuzz/` does the same without a time limit.

mod bombs;
mod configs;
mod deep_shaders;
#[cfg(unix)]
mod endless;
#[cfg(unix)]
mod every_form;
mod experiments;
#[cfg(unix)]
mod files;
mod forms;
#[cfg(unix)]
mod glsl;
#[cfg(unix)]
mod memory;
#[cfg(unix)]
mod nested_text;
#[cfg(unix)]
mod outputs;
mod pictures;
#[cfg(unix)]
mod process;
mod raster;
mod replays;
mod shaders;
#[cfg(unix)]
mod terminal;
#[cfg(unix)]
mod texts;

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use proptest::prelude::*;

/// The files below a folder of the repository with this extension.
fn files(folder: &str, extension: &str) -> Vec<Vec<u8>> {
    fn walk(folder: &Path, extension: &str, out: &mut Vec<PathBuf>) {
        let entries = std::fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
        for path in entries.map(|entry| entry.expect("an entry").path()) {
            if path.is_dir() {
                walk(&path, extension, out);
            } else if path.extension().is_some_and(|found| found == extension) {
                out.push(path);
            }
        }
    }
    let mut paths = Vec::new();
    walk(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), extension, &mut paths);
    paths.sort();
    assert!(!paths.is_empty(), "no {extension} in {folder}");
    paths.iter().map(|path| std::fs::read(path).expect("a file")).collect()
}

/// Recorded shaders, each after the byte that says what it is.
static SHADERS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let tagged = |tag: u8, files: Vec<Vec<u8>>| files.into_iter().map(move |bytes| [vec![tag], bytes].concat());
    let naga = files("crates/import/tests/import/culling", "ron").into_iter().filter(|text| text.starts_with(b"(")).collect();
    let wgsl = files("crates/import/tests/import", "wgsl").into_iter().chain(files("crates/scenes/src", "wgsl")).collect();
    let spirv = files("crates/render/tests/programs", "spv")
        .into_iter()
        .chain(files("crates/import/tests/import/culling", "spv"))
        .collect();
    tagged(b'W', wgsl).chain(tagged(b'S', spirv)).chain(tagged(b'N', naga)).collect()
});

static CONFIGS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| {
    let settings = ["core.warps=32", "mem.l2.bytes=1 << 20", "units.geometry = 2", "color.cache_blocks=16"];
    files("configs", "ron").into_iter().chain(settings.map(|s| format!("--set {s}").into_bytes())).collect()
});

static EXPERIMENTS: LazyLock<Vec<Vec<u8>>> = LazyLock::new(|| files("configs/experiments", "ron"));

static SMALL: LazyLock<replays::Small> = LazyLock::new(replays::Small::new);

/// A change of an input, at a place in parts of its length.
#[derive(Clone, Debug)]
enum Change {
    Set(f64, u8),
    Flip(f64, u8),
    Remove(f64, usize),
    Repeat(f64, usize),
    /// Copies a piece from elsewhere.
    Move(f64, f64, usize),
    /// Replaces the number at or after the place.
    Number(f64, &'static str),
    /// Replaces the word at or after the place by another word of the input.
    Word(f64, f64),
}

const NUMBERS: [&str; 12] =
    ["0", "1", "-1", "2", "7", "65536", "4294967295", "4294967296", "18446744073709551615", "1e39", "NaN", "-2147483648"];

fn change() -> impl Strategy<Value = Change> {
    let at = || 0.0..1.0f64;
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, byte)| Change::Set(at, byte)),
        (at(), 0..8u8).prop_map(|(at, bit)| Change::Flip(at, bit)),
        (at(), 1..80usize).prop_map(|(at, n)| Change::Remove(at, n)),
        (at(), 1..200usize).prop_map(|(at, n)| Change::Repeat(at, n)),
        (at(), at(), 1..200usize).prop_map(|(from, to, n)| Change::Move(from, to, n)),
        (at(), prop::sample::select(NUMBERS.to_vec())).prop_map(|(at, number)| Change::Number(at, number)),
        (at(), prop::sample::select(NUMBERS.to_vec())).prop_map(|(at, number)| Change::Number(at, number)),
        (at(), at()).prop_map(|(at, from)| Change::Word(at, from)),
    ]
}

/// The run of bytes of a kind at or after a place.
fn run_of(bytes: &[u8], at: usize, kind: impl Fn(&u8) -> bool) -> Option<std::ops::Range<usize>> {
    let start = at + bytes[at..].iter().position(&kind)?;
    let length = bytes[start..].iter().position(|b| !kind(b)).unwrap_or(bytes.len() - start);
    Some(start..start + length)
}

fn apply(bytes: &mut Vec<u8>, change: &Change) {
    let length = bytes.len();
    let place = |at: f64| ((at * length as f64) as usize).min(length);
    let is_word = |b: &u8| b.is_ascii_alphanumeric() || *b == b'_';
    match *change {
        Change::Set(at, byte) => bytes.iter_mut().skip(place(at)).take(1).for_each(|old| *old = byte),
        Change::Flip(at, bit) => bytes.iter_mut().skip(place(at)).take(1).for_each(|old| *old ^= 1 << bit),
        Change::Remove(at, n) => drop(bytes.drain(place(at)..(place(at) + n).min(length))),
        Change::Repeat(at, n) => {
            let piece = bytes[place(at)..(place(at) + n).min(length)].to_vec();
            bytes.splice(place(at)..place(at), piece);
        }
        Change::Move(from, to, n) => {
            let piece = bytes[place(from)..(place(from) + n).min(length)].to_vec();
            bytes.splice(place(to)..place(to), piece);
        }
        Change::Number(at, number) => {
            if let Some(range) = run_of(bytes, place(at), u8::is_ascii_digit) {
                bytes.splice(range, number.bytes());
            }
        }
        Change::Word(at, from) => {
            if let (Some(range), Some(other)) = (run_of(bytes, place(at), is_word), run_of(bytes, place(from), is_word)) {
                let other = bytes[other].to_vec();
                bytes.splice(range, other);
            }
        }
    }
}

fn mutated(seed: &[u8], keep: usize, changes: &[Change]) -> Vec<u8> {
    let mut rest = seed[keep..].to_vec();
    changes.iter().for_each(|change| apply(&mut rest, change));
    [&seed[..keep], &rest].concat()
}

fn changes() -> impl Strategy<Value = Vec<Change>> {
    prop::collection::vec(change(), 1..5)
}

fn cases(cases: u32) -> ProptestConfig {
    ProptestConfig { cases, failure_persistence: None, ..ProptestConfig::default() }
}

#[test]
fn seeds_are_good() {
    SHADERS.iter().for_each(|seed| shaders::run_everything(seed));
    CONFIGS.iter().for_each(|seed| configs::read_everything(seed));
    EXPERIMENTS.iter().for_each(|seed| experiments::plan_everything(seed));
    assert!(SMALL.replay(&SMALL.text), "the small trace does not run");
}

proptest! {
    #![proptest_config(cases(2000))]

    #[test]
    fn damaged_experiments_are_refused_or_planned(which in 0..usize::MAX, changes in changes()) {
        experiments::plan_everything(&mutated(&EXPERIMENTS[which % EXPERIMENTS.len()], 0, &changes));
    }
}

proptest! {
    #![proptest_config(cases(2000))]

    #[test]
    fn damaged_shaders_are_refused_or_run(which in 0..usize::MAX, changes in changes()) {
        shaders::run_everything(&mutated(&SHADERS[which % SHADERS.len()], 1, &changes));
    }
}

proptest! {
    #![proptest_config(cases(2000))]

    #[test]
    fn damaged_configurations_are_refused_or_read(which in 0..usize::MAX, changes in changes()) {
        configs::read_everything(&mutated(&CONFIGS[which % CONFIGS.len()], 0, &changes));
    }

    #[test]
    fn damaged_traces_are_refused_or_run(changes in changes()) {
        SMALL.replay(&mutated(&SMALL.text, 0, &changes));
    }
}

proptest! {
    #![proptest_config(cases(20_000))]

    #[test]
    fn primitives_of_any_bits_are_drawn_once(bytes in prop::collection::vec(any::<u8>(), 60)) {
        raster::draw_everything(&bytes);
    }
}
