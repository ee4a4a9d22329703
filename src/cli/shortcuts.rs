//! `fillrate accuracy shortcuts`

use std::path::PathBuf;

use anyhow::{Context, Result};

use super::Verdict;
use crate::accuracy::shortcuts::{SHORTCUTS, ShortcutResult, UNMEASURED, diverging, json, shortcuts, table};

/// Edge in pixels of the scene that is made to diverge.
const EDGE: u32 = 256;

/// What the model's shortcuts cost: each against the exact but slow way, in cycles
#[derive(clap::Args)]
#[command(after_help = "Example:\n  fillrate accuracy shortcuts traces/shadow traces/particles\n\n\
A scene made to diverge is measured beside the traces. Exit code 1 where the exact way shows another picture: shortcuts are about time.")]
pub struct Arguments {
    /// Traces
    #[arg(required_unless_present = "list")]
    traces: Vec<PathBuf>,
    #[command(flatten)]
    reading: super::reading::Reading,
    /// Name the shortcuts and their exact ways, and those that have none
    #[arg(long)]
    list: bool,
    /// As JSON
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    machine: super::configs::Choice,
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    if arguments.list {
        for shortcut in SHORTCUTS {
            println!("{}: {}\n  exact: {}", shortcut.name, shortcut.what, shortcut.exact);
        }
        for (name, why) in UNMEASURED {
            println!("{name}\n  not measured: {why}");
        }
        return Ok(Verdict::Done);
    }
    let config = arguments.machine.load()?;
    let mut verdict = Verdict::Done;
    let mut found: Vec<(String, Vec<ShortcutResult>)> = Vec::new();
    for path in &arguments.traces {
        let trace = arguments.reading.open(path)?;
        verdict = verdict.and(super::reading::verdict(&trace));
        let taken = shortcuts(&trace, &config).with_context(|| path.display().to_string())?;
        let name = path.file_stem().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        found.push((name, taken));
    }
    // What no trace of a real program shows.
    found.push(("diverging".to_owned(), shortcuts(&diverging(EDGE), &config).context("the scene made to diverge")?));
    if arguments.json {
        super::say_json(&json(&found))?;
    } else {
        print!("{}", table(&found));
    }
    for (name, taken) in &found {
        for taken in taken.iter().filter(|taken| !taken.same_pictures) {
            eprintln!("{name}: {} shows another picture than the exact way", taken.shortcut.name);
            verdict = Verdict::Failed;
        }
    }
    Ok(verdict)
}
