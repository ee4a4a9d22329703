//! Damaged wgpu traces: whatever the bytes are, import answers, with a trace or with an error that names the file.

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use proptest::prelude::*;

/// A trace of everything, which the checker refuses early, and one of a whole program, which it accepts.
static TEXTS: LazyLock<[(PathBuf, Vec<u8>); 2]> = LazyLock::new(|| {
    ["all", "culling/trace"].map(|name| {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/import").join(name);
        let text = std::fs::read(folder.join("trace.ron")).expect("the fixture");
        (folder, text)
    })
});

/// A change of a text.
#[derive(Clone, Debug)]
enum Edit {
    Set(usize, u8),
    Remove(usize, usize),
    /// Copies a piece to another place: valid pieces where they do not belong.
    Copy {
        from: usize,
        length: usize,
        to: usize,
    },
    /// Replaces the number at or after a place.
    Number(usize, u64),
}

fn edit() -> impl Strategy<Value = Edit> {
    let at = 0..TEXTS[0].1.len();
    let number = prop_oneof![Just(0), Just(1), Just(u64::MAX), Just(1 << 31), Just(u64::from(u32::MAX)), any::<u64>()];
    prop_oneof![
        (at.clone(), any::<u8>()).prop_map(|(at, byte)| Edit::Set(at, byte)),
        (at.clone(), 1..200usize).prop_map(|(at, length)| Edit::Remove(at, length)),
        (at.clone(), 1..400usize, at.clone()).prop_map(|(from, length, to)| Edit::Copy { from, length, to }),
        (at, number).prop_map(|(at, number)| Edit::Number(at, number)),
    ]
}

fn apply(text: &mut Vec<u8>, edit: &Edit) {
    let clip = |at: usize| at.min(text.len());
    match *edit {
        Edit::Set(at, byte) => {
            if let Some(old) = text.get_mut(at) {
                *old = byte;
            }
        }
        Edit::Remove(at, length) => {
            let range = clip(at)..clip(at + length);
            text.drain(range);
        }
        Edit::Copy { from, length, to } => {
            let piece = text[clip(from)..clip(from + length)].to_vec();
            let to = clip(to);
            text.splice(to..to, piece);
        }
        Edit::Number(at, number) => {
            let Some(start) = text.iter().skip(at).position(u8::is_ascii_digit).map(|offset| at + offset) else { return };
            let end = text[start..].iter().position(|byte| !byte.is_ascii_digit()).map_or(text.len(), |n| start + n);
            text.splice(start..end, number.to_string().into_bytes());
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 1000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_damaged_trace_is_imported_or_refused(which in 0..2usize, edits in prop::collection::vec(edit(), 1..4)) {
        let (folder, text) = &TEXTS[which];
        let mut text = text.clone();
        edits.iter().for_each(|edit| apply(&mut text, edit));
        crate::oracle::import_everything(folder, &text);
    }
}
