//! `fillrate accuracy builds`

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhow::{Context, Result};

use super::Verdict;
use crate::host::one_line;
use crate::machine::class::SortClass;

/// Bytes that are shown of a line, at most: before the first difference, and from there on.
const SHOWN: [usize; 2] = [24, 48];

/// Compare this program with another build of it: all files that replays leave, byte by byte
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate accuracy builds ../before/fillrate traces/*\n  \
fillrate accuracy builds ../before/fillrate --config sort-middle --fidelity functional recordings/*/trace\n\n\
Both programs replay each trace on each configuration with each fidelity. Two replays that end with the same error are equal.\n\
Exit code 1 where files differ.")]
pub struct Arguments {
    /// The other program
    other: PathBuf,
    /// Traces
    #[arg(required = true)]
    traces: Vec<PathBuf>,
    /// Configurations [default: one of each sort class]
    #[arg(long, value_name = "NAME", value_delimiter = ',')]
    config: Vec<String>,
    /// Fidelities
    #[arg(long, value_name = "NAME", value_delimiter = ',', default_value = "functional,bound,cycle")]
    fidelity: Vec<String>,
    /// Frames of each trace, as replay takes them
    #[arg(long, value_name = "RANGE")]
    frames: Option<String>,
}

/// Folders of two replays, which are removed with what is in them.
struct Folders([PathBuf; 2]);

impl Folders {
    fn new() -> Folders {
        let folder = |name: &str| std::env::temp_dir().join(format!("fillrate-builds-{}-{name}", std::process::id()));
        Folders(["this", "other"].map(folder))
    }

    fn remove(&self) -> Result<()> {
        for folder in self.0.iter().filter(|folder| folder.exists()) {
            fs::remove_dir_all(folder).with_context(|| folder.display().to_string())?;
        }
        Ok(())
    }
}

impl Drop for Folders {
    fn drop(&mut self) {
        // What an error left behind is in the way of nobody: the next process has a folder of its own.
        let _ = self.remove();
    }
}

/// The names of the files below a folder.
fn names(folder: &Path) -> Result<BTreeSet<PathBuf>> {
    let (mut found, mut open) = (BTreeSet::new(), vec![PathBuf::new()]);
    while let Some(within) = open.pop() {
        let path = folder.join(&within);
        if !path.exists() {
            continue;
        }
        for entry in fs::read_dir(&path).with_context(|| path.display().to_string())? {
            let entry = entry?;
            let name = within.join(entry.file_name());
            if entry.file_type()?.is_dir() {
                open.push(name);
            } else {
                found.insert(name);
            }
        }
    }
    Ok(found)
}

/// Where two files differ first: a line of texts, or a byte of others.
fn first_difference([a, b]: [&[u8]; 2]) -> Option<String> {
    let at = a.iter().zip(b).position(|(a, b)| a != b).or((a.len() != b.len()).then(|| a.len().min(b.len())))?;
    let [Ok(this), Ok(other)] = [a, b].map(std::str::from_utf8) else {
        return Some(format!("byte {at} of {} and {}", a.len(), b.len()));
    };
    let number = a[..at].iter().filter(|&&byte| byte == b'\n').count();
    // Both texts are the same before the difference.
    let same = this.floor_char_boundary(at);
    let begin = this[..same].rfind('\n').map_or(0, |end| end + 1).max(this.floor_char_boundary(same.saturating_sub(SHOWN[0])));
    let shown = |text: &str| match text[begin..text.floor_char_boundary(at + SHOWN[1])].lines().next() {
        None => "the end".to_owned(),
        Some(line) => one_line(line.trim()).into_owned(),
    };
    Some(format!("line {}: {} and {}", number + 1, shown(this), shown(other)))
}

/// What differs between two replays: how they end, and their files. Both are empty where nothing does.
fn differences(outputs: &[Output; 2], folders: &[PathBuf; 2]) -> Result<(Vec<String>, usize)> {
    let mut found = Vec::new();
    let [this, other] = outputs;
    if this.status.code() != other.status.code() {
        found.push(format!("ends with {} and {}", this.status, other.status));
    }
    if let Some(difference) = first_difference([&this.stderr, &other.stderr]) {
        found.push(format!("messages, {difference}"));
    }
    let [own, others] = [names(&folders[0])?, names(&folders[1])?];
    for name in own.union(&others) {
        let path = name.display();
        if !own.contains(name) || !others.contains(name) {
            found.push(format!("{path}: only of {} program", if own.contains(name) { "this" } else { "the other" }));
            continue;
        }
        let read = |folder: &Path| fs::read(folder.join(name)).with_context(|| path.to_string());
        let [a, b] = [read(&folders[0])?, read(&folders[1])?];
        found.extend(first_difference([&a, &b]).map(|difference| format!("{path}, {difference}")));
    }
    Ok((found, own.len()))
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let this = std::env::current_exe().context("this program")?;
    let programs = [&this, &arguments.other];
    let configs: Vec<&str> = arguments.config.iter().map(String::as_str).collect();
    let configs = if configs.is_empty() { SortClass::NAMES.to_vec() } else { configs };
    let folders = Folders::new();
    let (mut verdict, mut all, mut equal) = (Verdict::Done, 0, 0);
    for trace in &arguments.traces {
        for &config in &configs {
            for fidelity in &arguments.fidelity {
                folders.remove()?;
                let replay = |at: usize| -> Result<Output> {
                    let mut command = Command::new(programs[at]);
                    command.args(["-q", "replay"]).arg(trace).args(["--config", config, "--fidelity", fidelity.as_str()]);
                    command.args(arguments.frames.iter().flat_map(|frames| ["--frames", frames.as_str()]));
                    command.arg("--out").arg(&folders.0[at]);
                    command.output().with_context(|| programs[at].display().to_string())
                };
                let outputs = [replay(0)?, replay(1)?];
                let (found, files) = differences(&outputs, &folders.0)?;
                let name = format!("{} {config} {fidelity}", trace.display());
                all += 1;
                equal += usize::from(found.is_empty());
                if found.is_empty() && !outputs[0].status.success() {
                    println!("{name}: both end with {}", outputs[0].status);
                } else if found.is_empty() {
                    println!("{name}: {files} files are equal");
                } else {
                    verdict = Verdict::Failed;
                    println!("{name}: {} differ", found.len());
                    found.iter().for_each(|difference| println!("  {difference}"));
                }
                super::flush();
            }
        }
    }
    println!("{equal} of {all} replays are equal");
    Ok(verdict)
}

#[cfg(test)]
mod tests {
    use super::first_difference;

    #[test]
    fn a_difference_is_named_by_line_or_byte() {
        assert_eq!(first_difference([b"a\nb\n", b"a\nb\n"]), None);
        assert_eq!(first_difference([b"a\nb\n", b"a\nc\n"]).as_deref(), Some("line 2: b and c"));
        assert_eq!(first_difference([b"a\n", b"a\nc\n"]).as_deref(), Some("line 2: the end and c"));
        assert_eq!(first_difference([&[255, 1], &[255, 2]]).as_deref(), Some("byte 1 of 2 and 2"));
    }
}
