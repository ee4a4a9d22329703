//! Commands on pages print what the pages say.
//!
//! A fenced block that begins with ` ```console ` holds commands, each on a line after `$ `, and below each what it prints on the standard
//! output. All blocks of a page run in order, by `sh`, in one empty folder where `traces`, `configs`, `examples` and `crates` are the repository's
//! and `fillrate` is the program under test. A block that begins with ` ```console slow ` runs only where `FILLRATE_SLOW` is set.
//! `FILLRATE_BLESS=1 cargo test --test program commands` writes the output anew.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A command and the lines below it.
#[derive(Clone, PartialEq, Eq)]
struct Step {
    command: String,
    output: String,
}

/// What one page is made of.
enum Piece {
    /// Lines that are kept.
    Text(String),
    /// A block of commands.
    Block { fence: String, slow: bool, steps: Vec<Step> },
}

fn pieces(page: &str) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut text = String::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        let Some(kind) = line.strip_prefix("```console") else {
            text.push_str(line);
            text.push('\n');
            continue;
        };
        pieces.push(Piece::Text(std::mem::take(&mut text)));
        let mut steps: Vec<Step> = Vec::new();
        for line in lines.by_ref().take_while(|line| *line != "```") {
            match (line.strip_prefix("$ "), steps.last_mut()) {
                (Some(command), _) => steps.push(Step { command: command.to_owned(), output: String::new() }),
                (None, Some(step)) => {
                    step.output.push_str(line);
                    step.output.push('\n');
                }
                (None, None) => panic!("a block begins with `{line}`, not with a command"),
            }
        }
        pieces.push(Piece::Block { fence: line.to_owned(), slow: kind.trim() == "slow", steps });
    }
    pieces.push(Piece::Text(text));
    pieces
}

fn written(pieces: &[Piece]) -> String {
    let mut page = String::new();
    for piece in pieces {
        match piece {
            Piece::Text(text) => page.push_str(text),
            Piece::Block { fence, steps, .. } => {
                page.push_str(fence);
                page.push('\n');
                for step in steps {
                    page.push_str(&format!("$ {}\n{}", step.command, step.output));
                }
                page.push_str("```\n");
            }
        }
    }
    page
}

/// The folder that commands run in.
#[cfg(unix)]
fn room() -> tempfile::TempDir {
    let room = tempfile::tempdir().expect("a folder");
    for name in ["traces", "configs", "examples", "crates"] {
        let here = Path::new(env!("CARGO_MANIFEST_DIR")).join(name);
        std::os::unix::fs::symlink(here, room.path().join(name)).expect("a link");
    }
    room
}

#[cfg(unix)]
fn run(command: &str, room: &Path) -> String {
    let program = Path::new(env!("CARGO_BIN_EXE_fillrate")).parent().expect("a folder");
    let path = format!("{}:{}", program.display(), std::env::var("PATH").unwrap_or_default());
    let out = Command::new("sh").args(["-c", command]).current_dir(room).env("PATH", path).output().expect("sh runs");
    assert!(
        out.status.success(),
        "`{command}` ends with {}: {}{}",
        out.status,
        String::from_utf8_lossy(&out.stdout),
        String::from_utf8_lossy(&out.stderr)
    );
    // Trailing blanks are not kept on a page.
    String::from_utf8_lossy(&out.stdout).lines().map(|line| format!("{}\n", line.trim_end())).collect()
}

#[cfg(unix)]
fn pages(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of pages") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            pages(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "md") {
            found.push(path);
        }
    }
}

#[cfg(unix)]
#[test]
fn commands_on_pages_print_what_the_pages_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = vec![root.join("README.md")];
    pages(&root.join("docs"), &mut found);
    found.sort();
    let slow_too = std::env::var_os("FILLRATE_SLOW").is_some();
    let bless = std::env::var_os("FILLRATE_BLESS").is_some();
    let (mut ran, mut left_out, mut stale) = (0, 0, Vec::new());
    for page in found {
        let old = fs::read_to_string(&page).expect("a page");
        let mut pieces = pieces(&old);
        let room = room();
        for piece in &mut pieces {
            let Piece::Block { slow, steps, .. } = piece else { continue };
            if *slow && !slow_too {
                left_out += steps.len();
                continue;
            }
            for step in steps {
                let output = run(&step.command, room.path());
                if output != step.output {
                    stale.push(format!("{}: $ {}\n{output}", page.display(), step.command));
                }
                step.output = output;
                ran += 1;
            }
        }
        if bless && written(&pieces) != old {
            fs::write(&page, written(&pieces)).expect("the page is written");
        }
    }
    println!("{ran} commands ran; {left_out} slow ones were left out (FILLRATE_SLOW=1 runs them)");
    assert!(ran > 20, "only {ran} commands were found: the test looks at the wrong place");
    assert!(stale.is_empty() || bless, "stale, FILLRATE_BLESS=1 writes them anew:\n{}", stale.join("\n"));
}

#[test]
fn a_page_is_read_and_written_back() {
    let page = "Text.\n\n```console slow\n$ a | b\n1\n2\n$ c\n```\nMore.\n";
    let parts = pieces(page);
    let Piece::Block { slow: true, steps, .. } = &parts[1] else { panic!("a slow block") };
    assert_eq!(steps.len(), 2);
    assert_eq!((steps[0].command.as_str(), steps[0].output.as_str()), ("a | b", "1\n2\n"));
    assert_eq!(written(&parts), page);
}
