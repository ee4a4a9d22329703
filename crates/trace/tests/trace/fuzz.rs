//! Random bytes and mutations of good traces never make the reader, the checker or the writer fall over.

use std::fs;
use std::path::Path;

use proptest::prelude::*;
use trace::{Packing, Trace, write_zip};

use crate::oracle::read_everything;

/// Good inputs of each kind.
fn seeds() -> Vec<Vec<u8>> {
    let kept = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../traces");
    let dir = tempfile::tempdir().unwrap();
    let mut seeds = Vec::new();
    for name in ["triangle", "particles", "spokes-msaa"] {
        let trace = Trace::open(kept.join(name)).unwrap();
        for packing in [Packing::Stored, Packing::Deflated] {
            let path = dir.path().join("a.zip");
            write_zip(&trace, &path, packing).unwrap();
            seeds.push([vec![0], fs::read(path).unwrap()].concat());
        }
        let text = fs::read(kept.join(name).join("trace.ron")).unwrap();
        seeds.push([vec![1], text].concat());
    }
    seeds.push(b"\x02CreateBuffer(id: 0, size: 16), WriteBuffer(id: 0, data: (blob: \"b.bin\", size: 16)), CreateShader(id: 0, source: Wgsl(\"c.wgsl\")), CreateTexture(id: 0, desc: (size: (4, 4, 1), format: R32Float)), CreateView(id: 0, texture: 0), WriteTexture(to: (texture: 0), data: (blob: \"a.bin\", size: 64), layout: (), size: (4, 4, 1)), BeginRenderPass(color: [(view: 0, clear: (NaN, -0.0, inf, 1e30))]), EndRenderPass, Present(texture: 0)".to_vec());
    seeds
}

/// A change of an input: where, in parts of its length, and what.
#[derive(Clone, Debug)]
enum Change {
    Set(f64, u8),
    Flip(f64, u8),
    Insert(f64, Vec<u8>),
    Remove(f64, usize),
    Repeat(f64, usize),
    Cut(f64),
    Number(f64, String),
}

fn change() -> impl Strategy<Value = Change> {
    let at = || 0.0..1.0;
    let numbers = ["0", "-1", "1", "4294967295", "18446744073709551615", "1e400", "NaN", "0x7fffffff", "2147483648"];
    prop_oneof![
        (at(), any::<u8>()).prop_map(|(at, byte)| Change::Set(at, byte)),
        (at(), 0..8u8).prop_map(|(at, bit)| Change::Flip(at, bit)),
        (at(), prop::collection::vec(any::<u8>(), 1..9)).prop_map(|(at, bytes)| Change::Insert(at, bytes)),
        (at(), 1..64usize).prop_map(|(at, length)| Change::Remove(at, length)),
        (at(), 1..200usize).prop_map(|(at, length)| Change::Repeat(at, length)),
        at().prop_map(Change::Cut),
        (at(), prop::sample::select(numbers.to_vec())).prop_map(|(at, number)| Change::Number(at, number.to_owned())),
    ]
}

fn apply(bytes: &mut Vec<u8>, change: &Change) {
    let length = bytes.len();
    let place = |at: f64| ((at * length as f64) as usize).min(length.saturating_sub(1));
    if length == 0 {
        return;
    }
    match change {
        Change::Set(at, byte) => bytes[place(*at)] = *byte,
        Change::Flip(at, bit) => bytes[place(*at)] ^= 1 << bit,
        Change::Insert(at, more) => drop(bytes.splice(place(*at)..place(*at), more.iter().copied())),
        Change::Remove(at, count) => drop(bytes.drain(place(*at)..(place(*at) + count).min(length))),
        Change::Repeat(at, count) => {
            let part = bytes[place(*at)..(place(*at) + count).min(length)].to_vec();
            drop(bytes.splice(place(*at)..place(*at), part));
        }
        Change::Cut(at) => bytes.truncate(place(*at)),
        // The next number in the text becomes another one.
        Change::Number(at, number) => {
            let Some(start) = (place(*at)..length).find(|&i| bytes[i].is_ascii_digit()) else { return };
            let end = (start..length).find(|&i| !bytes[i].is_ascii_digit()).unwrap_or(length);
            drop(bytes.splice(start..end, number.bytes()));
        }
    }
}

#[test]
fn the_seeds_are_good() {
    // Texts alone name files that are not there.
    for seed in seeds().iter().filter(|seed| seed[0] != 1) {
        assert!(read_everything(seed));
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1500, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_are_refused(bytes in prop::collection::vec(any::<u8>(), 0..400)) {
        read_everything(&bytes);
        // Random bytes after a good beginning get further.
        read_everything(&[b"\x02CreateBuffer(id: 0, size: ", &bytes[..]].concat());
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn mutated_traces_do_not_panic(changes in prop::collection::vec(change(), 1..4)) {
        for mut seed in seeds() {
            for change in &changes {
                apply(&mut seed, change);
            }
            read_everything(&seed);
        }
    }
}
