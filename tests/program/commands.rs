//! Commands on pages print what the pages say.
//!
//! A page holds commands in two forms. A fenced block that begins with ` ```console ` has commands, each on a line after `$ `, and below
//! each what it prints on the standard output. A comment `<!-- $ COMMAND -->` stands above Markdown that the command prints, which ends at
//! `<!-- end -->`.
//!
//! All commands of a page run in order, by `sh`, in one empty folder where `traces`, `configs`, `examples` and `crates` are the repository's
//! and `fillrate` is the program under test. `FILLRATE_BLESS=1 cargo test --test program commands` writes the output anew.
//!
//! * ` ```console slow ` or `<!-- slow $ COMMAND -->` runs only where `FILLRATE_SLOW` is set.
//! * ` ```console host ` or `<!-- host $ COMMAND -->` prints what depends on the host, such as times. It runs only where `FILLRATE_HOST` is
//!   set. Nothing is compared: the output is written with the host and the date.
//! * `slow host` runs where both are set.
//!
//! A comment `<!-- picture FILE -->` stands above an image, which is that file as the commands of the page have left it.
//!
//! `FILLRATE_ONLY=TEXT` runs only blocks with a command that holds the text, as in `FILLRATE_ONLY="accuracy pareto"`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A command and the lines below it.
#[derive(Clone, PartialEq, Eq)]
struct Step {
    command: String,
    output: String,
}

/// When commands run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum When {
    Always,
    Slow,
    Host,
    SlowHost,
}

impl When {
    fn of(word: &str) -> When {
        match word {
            "" => When::Always,
            "slow" => When::Slow,
            "host" => When::Host,
            "slow host" => When::SlowHost,
            other => panic!("a command that is `{other}`: slow and host are known"),
        }
    }

    fn is_slow(self) -> bool {
        matches!(self, When::Slow | When::SlowHost)
    }

    /// Whether what is printed depends on the host.
    fn is_host(self) -> bool {
        matches!(self, When::Host | When::SlowHost)
    }
}

/// A part of a page.
enum Piece {
    /// Lines that are kept.
    Text(String),
    /// A block of commands, between its first and its last line; `fenced`: the commands are lines of it.
    Block { first: String, last: &'static str, fenced: bool, when: When, steps: Vec<Step> },
}

/// The line that ends Markdown that a command prints.
const END: &str = "<!-- end -->";

/// The beginning of the line with the host and the date. It follows the output of a command that depends on the host.
const MEASURED: &str = "Measured on ";

fn pieces(page: &str) -> Vec<Piece> {
    let mut pieces = Vec::new();
    let mut text = String::new();
    let mut lines = page.lines();
    while let Some(line) = lines.next() {
        let comment = line.strip_prefix("<!-- ").and_then(|rest| rest.strip_suffix(" -->"));
        if let Some((word, command)) = comment.and_then(|rest| rest.split_once("$ ")) {
            pieces.push(Piece::Text(std::mem::take(&mut text)));
            let output = lines.by_ref().take_while(|line| *line != END).map(|line| format!("{line}\n")).collect();
            let steps = vec![Step { command: command.to_owned(), output }];
            pieces.push(Piece::Block { first: line.to_owned(), last: END, fenced: false, when: When::of(word.trim()), steps });
            continue;
        }
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
        pieces.push(Piece::Block { first: line.to_owned(), last: "```", fenced: true, when: When::of(kind.trim()), steps });
    }
    pieces.push(Piece::Text(text));
    pieces
}

fn written(pieces: &[Piece]) -> String {
    let mut page = String::new();
    for piece in pieces {
        match piece {
            Piece::Text(text) => page.push_str(text),
            Piece::Block { first, last, fenced, steps, .. } => {
                page.push_str(&format!("{first}\n"));
                for Step { command, output } in steps {
                    page.push_str(&if *fenced { format!("$ {command}\n{output}") } else { output.clone() });
                }
                page.push_str(&format!("{last}\n"));
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

/// The host and how busy it is, how the program was built, and the date.
#[cfg(unix)]
fn measured(room: &Path) -> String {
    let model = "sed -n 's/^model name[^:]*: *//p' /proc/cpuinfo | head -n 1";
    let host = run(&format!("echo \"$({model}), $(nproc) processors, load $(cut -d' ' -f1 /proc/loadavg)\""), room);
    let build = if cfg!(debug_assertions) { "dev" } else { "release" };
    format!("{MEASURED}{}, {build} build, {}", host.trim_end(), run("date -u +%F", room))
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

/// Pictures of a page: the file that a command leaves, and the image that shows it.
fn pictures(page: &str) -> Vec<(&str, &str)> {
    let lines = page.lines().zip(page.lines().skip(1));
    let found = lines.filter_map(|(above, line)| {
        let file = above.strip_prefix("<!-- picture ")?.strip_suffix(" -->")?;
        let image = line.strip_prefix("![")?.split_once("](")?.1.strip_suffix(')')?;
        Some((file, image))
    });
    found.collect()
}

/// Bytes of a picture on a page at most.
const PICTURE_MAX: u64 = 150_000;

#[cfg(unix)]
#[test]
fn commands_on_pages_print_what_the_pages_say() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = vec![root.join("README.md")];
    pages(&root.join("docs"), &mut found);
    found.sort();
    let is_set = |name: &str| std::env::var_os(name).is_some();
    let (slow_too, host_too, bless) = (is_set("FILLRATE_SLOW"), is_set("FILLRATE_HOST"), is_set("FILLRATE_BLESS"));
    let only = std::env::var("FILLRATE_ONLY").ok();
    let (mut ran, mut left_out, mut stale) = (0, [0, 0], Vec::new());
    for page in found {
        let old = fs::read_to_string(&page).expect("a page");
        let mut pieces = pieces(&old);
        let room = room();
        for piece in &mut pieces {
            let Piece::Block { when, steps, fenced, .. } = piece else { continue };
            if only.as_ref().is_some_and(|text| !steps.iter().any(|step| step.command.contains(text))) {
                continue;
            }
            match when {
                when if when.is_slow() && !slow_too => left_out[0] += steps.len(),
                when if when.is_host() && !host_too => left_out[1] += steps.len(),
                _ => {
                    for step in &mut *steps {
                        let output = run(&step.command, room.path());
                        if output != step.output && !when.is_host() {
                            stale.push(format!("{}: $ {}\n{output}", page.display(), step.command));
                        }
                        step.output = output;
                        ran += 1;
                    }
                    if let (true, Some(last)) = (when.is_host(), steps.last_mut()) {
                        let between = if *fenced { "" } else { "\n" };
                        last.output.push_str(&format!("{between}{}", measured(room.path())));
                    }
                }
            }
        }
        for (file, image) in pictures(&old) {
            let shown = page.with_file_name(image);
            // A command that is left out leaves nothing.
            let Ok(made) = fs::read(room.path().join(file)) else { continue };
            if fs::read(&shown).ok() != Some(made) {
                stale.push(format!("{}: {image} is not {file}", page.display()));
                if bless {
                    fs::copy(room.path().join(file), &shown).expect("the picture is written");
                }
            }
        }
        if bless && written(&pieces) != old {
            fs::write(&page, written(&pieces)).expect("the page is written");
        }
    }
    let [slow, host] = left_out;
    println!(
        "{ran} commands ran; {slow} slow ones were left out (FILLRATE_SLOW=1 runs them), {host} of the host (FILLRATE_HOST=1)"
    );
    assert!(ran > 20 || only.is_some(), "only {ran} commands were found: the test looks at the wrong place");
    assert!(stale.is_empty() || bless, "stale, FILLRATE_BLESS=1 writes them anew:\n{}", stale.join("\n"));
}

#[test]
fn a_page_is_read_and_written_back() {
    let page = "Text.\n\n```console slow\n$ a | b\n1\n2\n$ c\n```\nMore.\n<!-- A remark. -->\n<!-- slow host $ d $ e -->\n| 1 |\n<!-- end -->\nLast.\n";
    let parts = pieces(page);
    let Piece::Block { when: When::Slow, fenced: true, steps, .. } = &parts[1] else { panic!("a slow block") };
    assert_eq!(steps.len(), 2);
    assert_eq!((steps[0].command.as_str(), steps[0].output.as_str()), ("a | b", "1\n2\n"));
    let Piece::Block { when: When::SlowHost, fenced: false, steps, .. } = &parts[3] else { panic!("a block of the host") };
    assert_eq!((steps[0].command.as_str(), steps[0].output.as_str()), ("d $ e", "| 1 |\n"));
    assert_eq!(written(&parts), page);
    let page = "<!-- picture out/a.png -->\n![A cube](a.png)\n![Another](b.png)\n<!-- picture out/c.png -->\n";
    assert_eq!(pictures(page), [("out/a.png", "a.png")]);
}

/// Each tutorial shows pictures, and every picture on it is one that its own commands make.
#[test]
fn tutorials_have_pictures_of_their_own_commands() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/tutorials");
    for entry in fs::read_dir(folder).expect("a folder") {
        let page = entry.expect("an entry").path();
        if page.extension().is_none_or(|extension| extension != "md") {
            continue;
        }
        let text = fs::read_to_string(&page).expect("a page");
        let made = pictures(&text);
        assert!(!made.is_empty() && made.len() == text.matches("![").count(), "{}: {made:?}", page.display());
        for (file, image) in made {
            let size = fs::metadata(page.with_file_name(image)).expect("the picture is there").len();
            assert!(size > 0 && size <= PICTURE_MAX, "{image} has {size} bytes");
            // The first part of its path is a folder that a command is given, or the file itself.
            let home = file.split('/').next().unwrap_or(file);
            assert!(text.lines().any(|line| line.starts_with("$ ") && line.contains(home)), "no command leaves {file}");
        }
    }
}

/// All pages together have at most 16,000 words of prose. Tables, code blocks and comments do not count.
#[test]
fn pages_stay_short() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = vec![root.join("README.md")];
    for folder in ["docs", "docs/data", "docs/tutorials"] {
        let entries = fs::read_dir(root.join(folder)).expect("a folder").map(|entry| entry.expect("an entry").path());
        found.extend(entries.filter(|path| path.extension().is_some_and(|extension| extension == "md")));
    }
    let all: usize = found.iter().map(|path| words_of_prose(&fs::read_to_string(path).expect("a page"))).sum();
    assert!(all <= 16_000, "README.md and docs/**/*.md have {all} words of prose");
}

/// The number of words outside of tables, code blocks and comments of Markdown.
fn words_of_prose(page: &str) -> usize {
    let (mut words, mut code, mut comment) = (0, false, false);
    for line in page.lines() {
        if line.starts_with("```") {
            code = !code;
        } else if comment || !code && line.starts_with("<!--") {
            comment = !line.contains("-->");
        } else if !code && !line.starts_with('|') {
            words += line.split_whitespace().count();
        }
    }
    words
}

#[test]
fn tables_code_and_comments_are_no_prose() {
    let page = "# Two words\n```text\nnot counted\n```\n<!-- nor\nthis -->\n| nor | this |\nThree words more.\n";
    assert_eq!(words_of_prose(page), 6);
}
