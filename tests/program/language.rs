//! Comments and pages use plain words: none has a phrase that leaves open what it speaks of.

use std::fs;
use std::path::{Path, PathBuf};

/// The phrases to avoid, in lower case. No comment and no page contains one of them. A phrase joins the list when it is gone everywhere.
/// A sentence names the parameter that it counts, and a rate has "per" before its unit.
const AVOIDED: &[&str] = &[
    "so many",
    "so much",
    "so few",
    "whoever",
    "is told",
    "of which it says so",
    "an idle one",
    "bits a channel",
    "bytes a cycle",
    "bytes a pixel",
    "cycles a pixel",
    "fragments a second",
    "frames a second",
    "instructions a byte",
    "instructions a cycle",
    "items a cycle",
    "pixels a cycle",
    "pixels a second",
    "quads a cycle",
    "sample a pixel",
    "samples a pixel",
    "samples a texel",
    "tests a cycle",
    "texels a cycle",
    "texels a pixel",
    "triangles a cycle",
    "vertices a cycle",
    "once a draw",
    "once a frame",
    "unit a pipeline",
];

/// Appends the files below a folder with this extension, without those that builds leave.
fn files(folder: &Path, extension: &str, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).expect("a folder of the project") {
        let path = entry.expect("an entry").path();
        if path.is_dir() {
            if path.file_name().is_some_and(|name| name != "target") {
                files(&path, extension, found);
            }
        } else if path.extension().is_some_and(|of| of == extension) {
            found.push(path);
        }
    }
}

/// The comment of each line in small letters; empty for a line that begins with code.
fn comments(text: &str) -> Vec<String> {
    let comment = |line: &str| {
        let text = line.trim_start().strip_prefix("//")?;
        Some(text.trim_start_matches(['/', '!']).trim().to_lowercase())
    };
    text.lines().map(|line| comment(line).unwrap_or_default()).collect()
}

/// The prose of each line of a page in small letters; empty in code blocks and tables.
fn prose(page: &str) -> Vec<String> {
    let mut in_code = false;
    let mut lines = Vec::new();
    for line in page.lines() {
        let line = line.trim();
        let is_fence = line.starts_with("```");
        if is_fence {
            in_code = !in_code;
        }
        let is_prose = !in_code && !is_fence && !line.starts_with('|');
        lines.push(if is_prose { line.to_lowercase() } else { String::new() });
    }
    lines
}

/// The numbers of lines in which avoided phrases begin, with the phrases. A phrase may end in the next line.
fn avoided(lines: &[String]) -> Vec<(usize, &'static str)> {
    let mut found = Vec::new();
    for (at, line) in lines.iter().enumerate() {
        let next = lines.get(at + 1).map_or("", String::as_str);
        let text = format!("{line} {next}");
        for &phrase in AVOIDED {
            let stands_alone = |begin: usize| {
                let before = text[..begin].chars().next_back();
                let after = text[begin + phrase.len()..].chars().next();
                !before.is_some_and(char::is_alphanumeric) && !after.is_some_and(char::is_alphanumeric)
            };
            if text.match_indices(phrase).any(|(begin, _)| begin < line.len() && stands_alone(begin)) {
                found.push((at + 1, phrase));
            }
        }
    }
    found
}

#[test]
fn comments_and_pages_avoid_phrases_that_leave_open_what_they_mean() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut sources = Vec::new();
    for folder in ["src", "crates", "tests", "benches", "examples", "fuzz/fuzz_targets"] {
        files(&root.join(folder), "rs", &mut sources);
    }
    // This file has the phrases themselves.
    sources.retain(|path| !path.ends_with("tests/program/language.rs"));
    let mut pages = vec![root.join("README.md")];
    files(&root.join("docs"), "md", &mut pages);
    assert!(sources.len() > 500 && pages.len() > 20, "the test looks at {} sources and {} pages", sources.len(), pages.len());

    let mut wrong = Vec::new();
    let mut look = |path: &Path, lines_of: fn(&str) -> Vec<String>| {
        let text = fs::read_to_string(path).expect("text");
        let name = path.strip_prefix(root).unwrap_or(path).display();
        for (line, phrase) in avoided(&lines_of(&text)) {
            wrong.push(format!("{name}:{line}: {phrase}"));
        }
    };
    for path in &sources {
        look(path, comments);
    }
    for path in &pages {
        look(path, prose);
    }
    wrong.sort();
    assert!(wrong.is_empty(), "say plainly what is meant:\n{}", wrong.join("\n"));
}

#[test]
fn avoided_phrases_are_found_across_lines_and_as_whole_words() {
    let source = "/// Gives so many.\nlet so = many; // so many\n    // so\n    //! Many.\n// Also many.";
    assert_eq!(avoided(&comments(source)), [(1, "so many"), (3, "so many")]);
    let page = "| so many |\n```\nso many\n```\nThe unit is\ntold.";
    assert_eq!(avoided(&prose(page)), [(5, "is told")]);
}
