//! The notebook reads what a sweep leaves. It runs where Python is there, with pandas and pyarrow.

use std::fs;
use std::path::Path;
use std::process::Command;

use crate::cli::run;

/// The interpreter: `FILLRATE_PYTHON`, else `python3`.
pub fn python() -> String {
    std::env::var("FILLRATE_PYTHON").unwrap_or_else(|_| "python3".into())
}

#[test]
fn the_notebook_reads_a_sweep() {
    let there = Command::new(python()).args(["-c", "import pandas, pyarrow"]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        eprintln!("LEFT OUT: there is no python3 with pandas and pyarrow (FILLRATE_PYTHON names another interpreter)");
        return;
    }
    let text = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/sweep.ipynb")).expect("the notebook");
    let notebook: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let cells = notebook["cells"].as_array().expect("cells").iter().filter(|cell| cell["cell_type"] == "code");
    let source = |cell: &serde_json::Value| -> String {
        cell["source"].as_array().expect("lines").iter().map(|line| line.as_str().expect("a line")).collect()
    };
    let program: Vec<String> = cells.map(source).collect();

    let out = tempfile::tempdir().expect("a folder");
    let folder = out.path().display().to_string();
    let vary = ["--vary", "core.warps=2..8*2", "--vary", "memory.port_latency=4,64"];
    let (code, _, message) = run(&[&["sweep", "traces/triangle", "--config", "tiny", "--out", &folder], &vary[..]].concat());
    assert_eq!(code, 0, "{message}");
    let ran =
        Command::new(python()).args(["-c", &program.join("\n\n")]).env("FILLRATE_SWEEP", &folder).output().expect("it ran");
    let [printed, message] = [ran.stdout, ran.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(ran.status.success(), "{message}");
    assert!(printed.starts_with("6 machines, 0 without a result, "), "{printed}");
    for part in ["core.warps", "memory.port_latency", "scan-out"] {
        assert!(printed.contains(part), "no {part} in\n{printed}");
    }
}
