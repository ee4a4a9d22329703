//! What must hold for any bytes that are given as a trace. Shared by the property tests and the fuzz target.

use std::io::Cursor;
use std::path::Path;

use trace::{Bytes, Packing, Trace, TraceError, check, hash_of, write_archive};

/// Files that a text may name.
const FILES: [(&str, &[u8]); 3] = [("a.bin", &[7; 64]), ("b.bin", b"0123456789abcdef"), ("c.wgsl", b"// nothing\n")];

/// Reads bytes as the first one says: 0 an archive, 1 a text, else the commands of a text. Reads and checks all that is in it;
/// answers whether it is a good trace.
pub fn read_everything(bytes: &[u8]) -> bool {
    let Some((kind, rest)) = bytes.split_first() else { return false };
    let name = Path::new("input");
    let files = FILES.map(|(name, bytes)| (name, Bytes::from(bytes.to_vec())));
    let trace = match kind {
        0 => Trace::open_archive(name, rest.to_vec().into()),
        1 => Trace::open_files(name, rest.to_vec(), files),
        _ => {
            let mut text = header();
            text.extend(rest);
            text.extend(b"])");
            Trace::open_files(name, text, files)
        }
    };
    let Ok(trace) = trace else { return false };
    if let Ok(summary) = check(&trace) {
        // What is good can be written, and what is written reads back the same.
        for packing in [Packing::Stored, Packing::Deflated] {
            let mut out = Cursor::new(Vec::new());
            if write_archive(&trace, name, &mut out, packing).is_err() {
                // A blob that no command uses may still be damaged.
                assert!(trace.blob_names().any(|blob| trace.blob(blob).is_err()), "a good trace cannot be written");
                continue;
            }
            let again = Trace::open_archive(name, out.into_inner().into()).expect("what was written can be read");
            assert_eq!(check(&again).expect("what was written is good"), summary);
            assert_eq!(print(&again), print(&trace));
        }
        return true;
    }
    // A reader that does not check must not fall over either, nor one that looks for places.
    // Each place is found from the start of the text: of many commands it is looked for that of a few.
    let _ = trace.for_each_command(|index, _| match index < 64 || index.is_power_of_two() {
        true if trace.place(index).is_none() => Err(trace.error_at(index, "lost")),
        _ => Ok(()),
    });
    trace.blob_names().for_each(|name| drop(trace.blob(name)));
    false
}

fn header() -> Vec<u8> {
    let entry = |(name, bytes): &(&str, &[u8])| format!("{name:?}: (size: {}, hash: \"{}\"),", bytes.len(), hash_of(bytes));
    let files: String = FILES.iter().map(entry).collect();
    format!("Trace(version: 1, files: {{{files}}}, commands: [").into_bytes()
}

/// The commands as text: unlike values, texts of NaN are equal.
fn print(trace: &Trace) -> String {
    let mut all = String::new();
    trace
        .for_each_command(|_, command| {
            all += &format!("{command:?}\n");
            Ok::<_, TraceError>(())
        })
        .expect("a checked trace reads to its end");
    all
}
