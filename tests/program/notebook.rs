//! The notebook reads what a sweep leaves, and draws it. It runs where Python is there, with pandas, pyarrow and matplotlib.

use std::fs;
use std::path::Path;
use std::process::Command;

use fillrate::num::Limits;
use fillrate::picture::read_png;

use crate::cli::run;

/// The interpreter: `FILLRATE_PYTHON`, else `python3`.
pub fn python() -> String {
    std::env::var("FILLRATE_PYTHON").unwrap_or_else(|_| "python3".into())
}

#[test]
fn the_notebook_reads_a_sweep() {
    let there = Command::new(python()).args(["-c", "import pandas, pyarrow, matplotlib"]).output();
    if !there.is_ok_and(|output| output.status.success()) {
        eprintln!(
            "LEFT OUT: there is no python3 with pandas, pyarrow and matplotlib (FILLRATE_PYTHON names another interpreter)"
        );
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
    let vary = ["--vary", "core.warps=2..8*2", "--vary", "memory.port_latency=4,64", "--vary", "memory.l2.slices=3,16"];
    let asked = ["sweep", "traces/triangle", "traces/cube", "--out", &folder, "--set", "memory.dram.channels=8"];
    let (code, _, message) = run(&[&asked, &vary[..]].concat());
    assert_eq!(code, 1, "{message}");
    let plots = tempfile::tempdir().expect("a folder");
    let mut command = Command::new(python());
    command.args(["-c", &program.join("\n\n")]).env("FILLRATE_SWEEP", &folder).env("FILLRATE_PLOTS", plots.path());
    let ran = command.env("MPLBACKEND", "Agg").output().expect("it ran");
    let [printed, message] = [ran.stdout, ran.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(ran.status.success(), "{message}");
    // Two machines break a rule between knobs. Each trace has a row of them.
    let told = "6 machines with a result, 6 without\n6 machines: memory.l2.slices is 3, ";
    assert!(printed.starts_with(told), "{printed}");
    for name in ["response-core.warps", "response-memory.port_latency", "sensitivity", "two-axes", "passes"] {
        let file = fs::read(plots.path().join(format!("{name}.png"))).expect(name);
        let image = read_png(&file, &Limits::default()).expect("a picture").into_rgb8();
        let colours: std::collections::BTreeSet<[u8; 3]> = image.pixels().map(|pixel| pixel.0).collect();
        assert!(image.width() > 300 && colours.len() > 20, "{name}: {} colours", colours.len());
    }
    for part in ["core.warps", "memory.port_latency", "scan-out"] {
        assert!(printed.contains(part), "no {part} in\n{printed}");
    }
}
