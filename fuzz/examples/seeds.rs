//! Writes the first corpus of the fuzz targets: the kept traces, whole and in parts, in the form that each target takes.

use std::fs;
use std::io;
use std::path::Path;

use fillrate::trace::{Packing, Trace, write_zip};

#[path = "../../tests/robust/replays.rs"]
mod replays;

/// Copies the files below a folder with an extension into a corpus, each after a byte if one is given.
fn copy(from: &Path, extension: &str, tag: Option<u8>, to: &Path) -> io::Result<()> {
    for entry in fs::read_dir(from)? {
        let path = entry?.path();
        if path.is_dir() {
            copy(&path, extension, tag, to)?;
        } else if path.extension().is_some_and(|found| found == extension) {
            let bytes: Vec<u8> = tag.into_iter().chain(fs::read(&path)?).collect();
            fs::write(to.join(blake(&bytes)), bytes)?;
        }
    }
    Ok(())
}

/// A name that follows from contents.
fn blake(bytes: &[u8]) -> String {
    fillrate::trace::hash_of(bytes)[..16].to_owned()
}

fn main() -> io::Result<()> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let corpus = root.join("corpus/trace_reader");
    fs::create_dir_all(&corpus)?;
    for entry in fs::read_dir(root.join("../traces"))? {
        let path = entry?.path();
        let name = path.file_stem().and_then(|name| name.to_str()).unwrap_or("scene").to_owned();
        let trace = Trace::open(&path).map_err(io::Error::other)?;
        // 0: an archive; stored only where that is small, as a fuzzer gets nowhere in a megabyte.
        for (kind, packing) in [("stored", Packing::Stored), ("deflated", Packing::Deflated)] {
            let to = corpus.join(format!("{name}-{kind}"));
            write_zip(&trace, &to, packing).map_err(io::Error::other)?;
            let bytes = fs::read(&to)?;
            if bytes.len() > 64 << 10 {
                fs::remove_file(&to)?;
            } else {
                fs::write(&to, [&[0], &bytes[..]].concat())?;
            }
        }
        // 1: the text; 2: its commands.
        if path.is_dir() {
            let text = fs::read_to_string(path.join("trace.ron"))?;
            fs::write(corpus.join(format!("{name}-text")), format!("\u{1}{text}"))?;
            if let Some((_, commands)) = text.split_once("commands: [") {
                let commands = commands.trim_end().trim_end_matches(')').trim_end().trim_end_matches("],");
                fs::write(corpus.join(format!("{name}-commands")), format!("\u{2}{commands}"))?;
            }
        }
    }
    let corpus = root.join("corpus/wgpu_import");
    fs::create_dir_all(&corpus)?;
    for name in ["all", "refused"] {
        fs::copy(root.join("../crates/import/tests/import").join(name).join("trace.ron"), corpus.join(name))?;
    }
    let corpora = ["shaders", "configs", "replays", "experiments"].map(|name| root.join("corpus").join(name));
    corpora.iter().try_for_each(fs::create_dir_all)?;
    let repository = root.join("..");
    copy(&repository.join("crates/import/tests/import"), "wgsl", Some(b'W'), &corpora[0])?;
    copy(&repository.join("examples"), "wgsl", Some(b'W'), &corpora[0])?;
    copy(&repository.join("crates/render/tests/programs"), "spv", Some(b'S'), &corpora[0])?;
    copy(&repository.join("crates/import/tests/import/culling"), "ron", Some(b'N'), &corpora[0])?;
    copy(&repository.join("configs"), "ron", None, &corpora[1])?;
    copy(&repository.join("configs/experiments"), "ron", None, &corpora[3])?;
    fs::write(corpora[2].join("small"), replays::Small::new().text)
}
