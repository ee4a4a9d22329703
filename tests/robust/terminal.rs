//! Labels, names, paths and messages from input: shown, but never interpreted by a terminal.

use std::path::{Path, PathBuf};

use tempfile::TempDir;

use crate::process::{Output, done, fillrate, printable, refused};

const REPOSITORY: &str = env!("CARGO_MANIFEST_DIR");

/// Sets the title, clears the screen, turns text around, ends a line in other ways.
const HOSTILE: &str = "\x1b]0;owned\x07\x1b[2J\u{9b}31m\u{202e}\u{2066}\u{200b}\u{2028}\x7f\r\x08";

/// How it begins where it is shown.
const SHOWN: &str = "\\u{1b}]0;owned\\u{7}\\u{1b}[2J\\u{9b}31m\\u{202e}\\u{2066}\\u{200b}\\u{2028}\\u{7f}\\r\\u{8}";

/// Makes another text of a trace's.
type Change<'a> = Box<dyn Fn(&str) -> String + 'a>;

/// A copy of a recorded trace with another text.
fn changed(from: &str, change: impl Fn(&str) -> String) -> (TempDir, PathBuf) {
    let home = tempfile::tempdir().expect("a folder");
    let trace = home.path().join("trace");
    std::fs::create_dir(&trace).expect("a folder");
    for entry in std::fs::read_dir(Path::new(REPOSITORY).join(from)).expect("a trace") {
        let path = entry.expect("an entry").path();
        std::fs::copy(&path, trace.join(path.file_name().expect("a name"))).expect("copied");
    }
    let text = std::fs::read_to_string(trace.join("trace.ron")).expect("a text");
    std::fs::write(trace.join("trace.ron"), change(&text)).expect("written");
    (home, trace)
}

fn run<A: AsRef<std::ffi::OsStr>>(arguments: &[A]) -> Output {
    fillrate(arguments).run()
}

/// A text as it is written in RON; escapes are read as the characters that they stand for.
fn ron(text: &str) -> String {
    text.chars()
        .map(|c| if c.is_ascii_graphic() || c == ' ' { c.to_string() } else { c.escape_unicode().to_string() })
        .collect()
}

#[test]
fn labels_are_shown() {
    for written in [HOSTILE.to_owned(), ron(HOSTILE)] {
        // Every label of the trace, and a debug group.
        let label = |text: &str| {
            let mut out = String::new();
            let text = text.replace("BeginRenderPass(", "BeginRenderPass(label: \"pass\", ");
            let mut rest = text.as_str();
            while let Some(at) = rest.find("label: \"") {
                let from = at + "label: \"".len();
                let end = from + rest[from..].find('"').expect("the end of a label");
                out.push_str(&rest[..from]);
                out.push_str(&written);
                out.push_str(" \\nforged line");
                rest = &rest[end..];
            }
            out + rest
        };
        let (home, trace) = changed("traces/shadow", label);
        let trace = trace.to_string_lossy();
        let out = home.path().join("out").to_string_lossy().into_owned();
        let listed = run(&["inspect", &trace, "--commands"]);
        done(&listed);
        assert!(listed.stdout.contains("owned"), "{listed:?}");
        let page = home.path().join("page.html").to_string_lossy().into_owned();
        let replayed = run(&["replay", &trace, "--config", "tiny", "--fidelity", "bound", "--out", &out, "--report", &page]);
        done(&replayed);
        let page = std::fs::read_to_string(&page).expect("written");
        assert!(page.contains("\\u{202e}\\u{2066}"), "the label is on the page");
        let obeyed = page.find(|c: char| host::is_obeyed(c) && c != '\n');
        assert!(obeyed.is_none(), "{:?}", obeyed.map(|at| &page[at - 40..at + 4]));
        assert!(replayed.stdout.contains("\\u{1b}]0;owned"), "{replayed:?}");
        assert!(!replayed.stdout.lines().any(|line| line.trim_start().starts_with("forged line")), "{replayed:?}");
        // The output for scripts has the label unchanged.
        let text = std::fs::read_to_string(Path::new(&out).join("stats.json")).expect("written");
        let statistics: serde_json::Value = serde_json::from_str(&text).expect("JSON");
        let phases = statistics["frames"][0]["phases"].as_array().expect("phases");
        let expected = format!("{HOSTILE} \nforged line");
        assert!(phases.iter().any(|phase| phase["label"] == expected.as_str()), "{phases:?}");
    }
}

#[test]
fn messages_about_a_trace_are_shown() {
    let written = ron(HOSTILE);
    let shadow = "traces/shadow";
    let refusals: [(&str, Change<'_>); 4] = [
        // In the text itself: names of commands, of fields, of files.
        ("Frob", Box::new(|text| text.replacen("CreateBuffer", &format!("Frob{HOSTILE}"), 1))),
        ("owned", Box::new(|text| text.replacen("files: {", &format!("files: {{ \"{written}\": (size: 1, hash: \"\"),"), 1))),
        ("owned", Box::new(|text| text.replacen("blob: \"", &format!("blob: \"{written}"), 1))),
        ("owned", Box::new(|text| text.replace("entry: \"", &format!("entry: \"{written}")))),
    ];
    for (word, change) in refusals {
        let (_home, trace) = changed(shadow, change);
        let output = run(&["replay", &trace.to_string_lossy(), "--fidelity", "functional"]);
        refused(&output, &["trace.ron", word]);
    }
    // A shader, quoted by its front end.
    let (_home, trace) = changed(shadow, |text| text.to_owned());
    let folder = std::fs::read_dir(&trace).expect("a folder").map(|entry| entry.expect("an entry").path());
    let shader = folder.filter(|path| path.extension().is_some_and(|e| e == "wgsl")).min().expect("a shader");
    let bad = format!("fn {HOSTILE}() {{}} /* {HOSTILE} */ const x = {HOSTILE};");
    std::fs::write(&shader, &bad).expect("written");
    let text = std::fs::read_to_string(trace.join("trace.ron")).expect("a text");
    let name = shader.file_name().expect("a name").to_string_lossy().into_owned();
    let at = text.find(&format!("\"{name}\": (")).expect("listed");
    let end = at + text[at..].find('\n').expect("a line");
    let hash = trace::hash_of(bad.as_bytes());
    let text = format!("{}\"{name}\": (size: {}, hash: \"{hash}\"),{}", &text[..at], bad.len(), &text[end..]);
    std::fs::write(trace.join("trace.ron"), text).expect("written");
    refused(&run(&["replay", &trace.to_string_lossy()]), &[&name]);
    // A foreign trace: names of actions and files.
    let changes: [Change<'_>; 3] = [
        Box::new(|text| text.replacen("CreateBuffer", &format!("Frob{HOSTILE}"), 1)),
        Box::new(|text| text.replacen("data1.bin", &format!("{written}.bin"), 1)),
        Box::new(|text| text.replacen("label: Some(\"", &format!("label: Some({HOSTILE}\""), 1)),
    ];
    for change in changes {
        let (_home, trace) = changed("crates/import/tests/import/all", change);
        refused(&run(&["inspect", &trace.to_string_lossy()]), &["trace.ron"]);
    }
}

#[test]
fn paths_and_settings_are_shown() {
    let name = HOSTILE;
    let (home, trace) = changed("traces/triangle", |text| text.to_owned());
    let hostile = home.path().join(name);
    std::fs::rename(&trace, &hostile).expect("renamed");
    let path = hostile.to_string_lossy().into_owned();
    let inspected = run(&["inspect", &path]);
    done(&inspected);
    assert!(inspected.stdout.contains(SHOWN), "{inspected:?}");
    let out = home.path().join(format!("out{name}")).to_string_lossy().into_owned();
    let config = home.path().join(format!("config{name}.ron")).to_string_lossy().into_owned();
    std::fs::write(&config, "(extends: \"tiny\")").expect("written");
    let replayed = run(&["replay", &path, "--config", &config, "--fidelity", "functional", "--out", &out]);
    done(&replayed);
    assert!(replayed.stdout.contains(&format!("out{SHOWN}")), "{replayed:?}");
    done(&run(&["configs", &config]));
    for arguments in [
        &["inspect", name][..],
        &["replay", name],
        &[name],
        &["replay", &path, "--frames", name],
        &["replay", &path, "--set", name],
        &["replay", &path, "--set", &format!("{name}=1")],
        &["replay", &path, "--config", name],
        &["replay", &path, "--limit", name],
        &["compare", name, name],
        &["accuracy", name],
        &["import", &path, "--out", &out],
    ] {
        let output = run(arguments);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        assert!(output.stderr.contains("\\u{9b}31m"), "{output:?}");
        printable(&output);
    }
    // Texts of a configuration.
    for text in
        [format!("({name}: 1)"), format!("(extends: \"{}\")", ron(name)), format!("(memory: (kind: \"{}\"))", ron(name))]
    {
        std::fs::write(&config, text).expect("written");
        refused(&run(&["configs", &config]), &["owned"]);
    }
    let imported = home.path().join(format!("new{name}")).to_string_lossy().into_owned();
    done(&run(&["import", &path, "--out", &imported]));
    let json = run(&["inspect", &imported, "--json"]);
    done(&json);
    serde_json::from_str::<serde_json::Value>(&json.stdout).expect("JSON");
}
