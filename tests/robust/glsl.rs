//! Hostile GLSL in recordings of OpenGL: shaders that are nested, that repeat one construct, or that stand for more than they say. Each is
//! refused by name or drawn, in bounded time and memory, on a stack that is large enough.

use std::fmt::Write;

use tempfile::TempDir;

use super::forms::TextForm;
use super::forms::glsl::{DEEP, LARGE, LONG};
use super::process::{Output, below_mib, fillrate, printable};

/// A recording that draws the window with a fragment shader, in a folder of its own.
fn recording(fragment: &str) -> TempDir {
    let mut text = "GLI0.t\n#! RES 8x8\nwglMakeCurrent(1,1)=1\nglCreateProgram()=3\n".to_owned();
    for (name, stage, source) in [(1, "VERTEX", "void main() { gl_Position = gl_Vertex; }"), (2, "FRAGMENT", fragment)] {
        let calls = format!(
            "glCreateShader(GL_{stage}_SHADER)={name}\nglShaderSource({name},1,\"{source}\",0)\nglCompileShader({name})\n\
             glAttachShader(3,{name})\n"
        );
        text.push_str(&calls);
    }
    write!(text, "glLinkProgram(3)\nglUseProgram(3)\nglRectf(-1,-1,1,1)\nwglSwapBuffers(1)\n").expect("a text");
    let folder = TempDir::new().expect("a folder");
    std::fs::write(folder.path().join("t.txt"), text).expect("a file");
    folder
}

/// Replays a recording with a fragment shader in a process of its own.
fn draw(fragment: &str, limits: &[&str]) -> Output {
    let folder = recording(fragment);
    let path = folder.path().join("t.txt");
    let run = fillrate(["replay".as_ref(), path.as_os_str(), "--fidelity".as_ref(), "functional".as_ref()]);
    limits.iter().fold(run, |run, limit| run.arg("--limit").arg(limit)).run()
}

/// Asserts that a run has drawn, or said why not: it ends by itself, and names no panic.
#[track_caller]
fn answered(name: &str, output: &Output, mib: u64) {
    assert!(!output.timed_out, "{name}: killed after {:?}: {}", output.wall, output.stderr);
    assert!(matches!(output.status.code(), Some(0..=2)), "{name}: {:?}: {:.400}", output.status, output.stderr);
    assert!(!output.stderr.contains("panicked"), "{name}: {:.400}", output.stderr);
    printable(output);
    below_mib(output, mib);
}

/// Asserts that a limit is named by what was said.
#[track_caller]
fn limited(name: &str, output: &Output, limits: &[&str]) {
    answered(name, output, 700);
    let said = format!("{}{}", output.stderr, output.stdout);
    assert!(limits.iter().any(|limit| said.contains(&format!("--limit {limit}=N"))), "{name}: none of {limits:?}: {said:.600}");
}

/// Each kind of a list, two processes at a time.
fn each(kinds: &[TextForm], check: impl Fn(&str, fn(usize) -> String) + Sync) {
    std::thread::scope(|scope| {
        for part in 0..2 {
            let check = &check;
            scope.spawn(move || kinds.iter().skip(part).step_by(2).for_each(|(name, make)| check(name, *make)));
        }
    });
}

#[test]
fn nested_shaders_are_drawn_or_refused() {
    each(DEEP, |name, make| {
        answered(name, &draw(&make(40), &[]), 300);
        let output = draw(&make(1_500), &[]);
        answered(name, &output, 1_500);
        // What is deeper than this is refused for the limit before anything calls itself for it.
        let output = draw(&make(1_500), &["shader.nesting=200", "shader.constants=4000", "shader.pairs=1000000"]);
        let flat = ["brackets of a condition", "operators of a condition", "conditional blocks", "members"];
        match flat.contains(&name) {
            true => answered(name, &output, 300),
            false => limited(name, &output, &["shader.nesting", "shader.constants", "shader.pairs", "shader.declarations"]),
        }
    });
}

#[test]
fn shaders_that_repeat_a_form_are_refused_beyond_the_limits() {
    each(LONG, |name, make| {
        answered(name, &draw(&make(60), &[]), 300);
        let output = draw(&make(2_000), &["shader.constants=3000", "shader.pairs=1000000"]);
        match ["conditions", "comments", "blanks", "semicolons"].contains(&name) {
            true => answered(name, &output, 300),
            false => limited(name, &output, &["shader.constants", "shader.pairs"]),
        }
    });
}

#[test]
fn shaders_that_stand_for_more_than_any_limit_are_refused() {
    each(LARGE, |name, make| {
        answered(name, &draw(&make(4), &[]), 300);
        let output = draw(&make(40), &["shader.constants=20000"]);
        let limits = ["shader.constants", "shader.pairs", "shader.instructions"];
        match name {
            // Functions are copied for their samplers, and their copies are shared.
            "functions of samplers" => answered(name, &output, 300),
            _ => limited(name, &output, &limits),
        }
    });
    // Within the default limits, too.
    for name in ["arguments of macros", "structures"] {
        let (_, make) = LARGE.iter().find(|(kind, _)| *kind == name).expect("a kind");
        limited(name, &draw(&make(40), &[]), &["shader.constants"]);
    }
}

/// Each form at sizes up to a megabyte under the default limits. Prints a table. It takes minutes: `cargo test --release --test robust
/// every_form -- --ignored --nocapture`.
#[test]
#[ignore = "minutes"]
fn every_form_up_to_a_megabyte_is_answered() {
    let (mut slow, mut large) = (0.0_f64, 0);
    for (class, kinds) in [("deep", DEEP), ("long", LONG), ("large", LARGE)] {
        for (name, make) in kinds {
            for bytes in [20_000, 100_000, 1_000_000] {
                let one = make(20).len() - make(10).len();
                let size = if class == "large" { bytes / 25_000 } else { (10 * bytes / one).max(1) };
                let text = make(size);
                let output = draw(&text, &[]);
                let seconds = output.wall.as_secs_f64();
                println!(
                    "{class:6} {name:34} {:8} bytes {seconds:6.2} s {:5} MiB {:?} {:.110}",
                    text.len(),
                    output.peak >> 20,
                    output.status.code(),
                    output.stderr
                );
                answered(name, &output, 3_000);
                assert!(seconds < 30.0, "{name}: {seconds} s");
                (slow, large) = (slow.max(seconds), large.max(output.peak >> 20));
            }
        }
    }
    println!("at most {slow:.1} s and {large} MiB");
}
