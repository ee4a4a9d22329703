//! Files in RON that are nested far deeper than their readers go: refused with file, place and reason, on the stack that there is.

use tempfile::TempDir;

use super::deep_shaders::compiling;
use super::process::{Run, below_mib, fillrate, refused};

/// Nesting depth.
const LEVELS: usize = 100_000;

/// What is nested: with what a level begins and ends.
const KINDS: [(&str, &str); 5] = [("(", ")"), ("[", "]"), ("Some(", ")"), ("{1:", "}"), ("(a: ", ")")];

/// Texts that are nested in each of the ways, ended or not.
fn texts() -> impl Iterator<Item = String> {
    let text = |(begin, end): (&str, &str)| [begin.repeat(LEVELS), begin.repeat(LEVELS) + "1" + &end.repeat(LEVELS)];
    KINDS.into_iter().flat_map(text)
}

/// Asserts that a run refuses a file at a place in it. Answers whether it is for its nesting: most kinds are no file of the kind sooner.
#[track_caller]
fn refused_at(run: &Run, file: &str, what: &str) -> bool {
    let output = run.run();
    refused(&output, &[file]);
    let number = |part: Option<&str>| part.is_some_and(|part| part.parse::<u32>().is_ok());
    let is_place = |word: &str| {
        let mut parts = word.trim_end_matches([':', ',']).rsplit(':');
        number(parts.next()) && number(parts.next())
    };
    // A whole file that is something else has no place in it.
    let other = output.stderr.contains("this is not a configuration");
    assert!(other || output.stderr.split_whitespace().any(is_place), "{what}: no place in {output:?}");
    assert!(output.stderr.len() < 20_000, "{what}: {} bytes of message", output.stderr.len());
    below_mib(&output, 300);
    output.stderr.contains("nested deeper than 128 levels")
}

fn shortened(text: &str) -> String {
    text.chars().take(40).collect()
}

/// A file of this name in a folder of its own, and a run of the program on it.
fn on_file(name: &str, text: &str, command: &[&str]) -> (TempDir, Run) {
    let folder = TempDir::new().expect("a folder");
    std::fs::write(folder.path().join(name), text).expect("a file");
    let run = command.iter().fold(fillrate(&command[..0]), |run, argument| run.arg(argument));
    let path = if name == "trace.ron" { folder.path().to_owned() } else { folder.path().join(name) };
    (folder, run.arg(path))
}

#[test]
fn traces_are_refused() {
    // A native trace has no place for a value of any shape: what is nested is refused for what it is not.
    let out = TempDir::new().expect("a folder");
    let out = out.path().join("out");
    let out = out.to_str().expect("a plain name");
    for nested in texts() {
        // Where a value stands that the reader knows, and where one stands that it does not.
        for text in [
            nested.clone(),
            format!("Trace(version: {nested}"),
            format!("Trace(version: 1, files: {{ \"a\": {nested}"),
            format!("Trace(version: 1, files: {{}}, commands: [CreateBuffer(id: 0, unknown: {nested}"),
            format!("Trace(version: 1, files: {{}}, commands: [CreateBuffer({nested}"),
        ] {
            for command in [&["inspect"][..], &["replay", "--out", out]] {
                let (_folder, run) = on_file("trace.ron", &text, command);
                refused_at(&run, "trace.ron", &shortened(&text));
            }
        }
    }
}

#[test]
fn traces_of_wgpu_are_refused() {
    let mut nested_too_deep = 0;
    for nested in texts() {
        for text in [
            format!("[Init(desc: {nested}"),
            format!("[{nested}"),
            format!("[CreateBuffer({nested}"),
            format!("[Init(desc: (), backend: \"vulkan\"), {nested}"),
        ] {
            let (_folder, run) = on_file("trace.ron", &text, &["inspect"]);
            nested_too_deep += u32::from(refused_at(&run, "trace.ron", &shortened(&text)));
        }
    }
    assert!(nested_too_deep > 0);
}

#[test]
fn configurations_are_refused() {
    let mut nested_too_deep = 0;
    for nested in texts() {
        // A configuration has 256 KiB at most: half of the levels do.
        for text in [
            nested.clone(),
            format!("(core: {nested}"),
            format!("(core: (warps: {nested}"),
            nested.replacen(char::is_alphabetic, "", 1),
        ] {
            let text: String = text.chars().take(250_000).collect();
            let (_folder, run) = on_file("deep.ron", &text, &["configs"]);
            nested_too_deep += u32::from(refused_at(&run, "deep.ron", &shortened(&text)));
        }
    }
    assert!(nested_too_deep > 0);
}

#[test]
fn shaders_in_nagas_form_are_refused() {
    let mut nested_too_deep = 0;
    for nested in texts() {
        for text in [nested.clone(), format!("(types: {nested}"), format!("(types: [], functions: [(body: {nested}")] {
            let (_folder, run) = compiling(|card| card.create_shader_naga_ir("hostile", &text));
            nested_too_deep += u32::from(refused_at(&run, "hostile", &shortened(&text)));
        }
    }
    assert!(nested_too_deep > 0);
}
