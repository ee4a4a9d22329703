//! Counts the calls and other blocks of captures: `cargo run -p fillrate-gfxr --example count -- FILE ...`.

use std::collections::BTreeMap;
use std::fs::File;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    for path in std::env::args().skip(1) {
        let mut reader = gfxr::Reader::new(File::open(&path)?)?;
        let mut counts = BTreeMap::<&str, u64>::new();
        while let Some(block) = reader.next_block()? {
            *counts.entry(block.body.name()).or_default() += 1;
        }
        println!("{path}");
        for (name, count) in counts {
            println!("{count:7} {name}");
        }
        if let Some(cut) = reader.cut() {
            println!("the file ends within the block at byte {}", cut.offset);
        }
    }
    Ok(())
}
