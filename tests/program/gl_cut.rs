//! Recordings of programs that crashed or were killed, and what is said of recordings beside their pictures.

use std::fs;

use super::cli::run;

const FRAME: &str = "glClearColor(1,0,0,1)\nglClear(GL_COLOR_BUFFER_BIT)\nglRectf(-1,-1,0,0)\nwglSwapBuffers(1)\n";

/// The last frame: green, and the call in which the recording ends.
const REST: &str = "glClearColor(0,1,0,1)\nglClear(GL_COLOR_BUFFER_BIT)\nglRectf(-1,-1,0,";

fn written(folder: &tempfile::TempDir, name: &str, text: &str) -> String {
    let path = folder.path().join(name);
    fs::write(&path, text).expect("a file");
    path.display().to_string()
}

#[test]
fn a_recording_whose_end_is_missing_is_replayed_up_to_there() {
    let folder = tempfile::tempdir().expect("a folder");
    let trace = written(&folder, "cut.txt", &format!("GLI0.t\n#! RES 8x8\n{FRAME}{REST}"));
    let out = folder.path().join("out");
    let (code, _, message) =
        run(&["replay", &trace, "--config", "tiny", "--fidelity", "functional", "--out", &out.display().to_string()]);
    assert_eq!(code, 0, "{message}");
    let place = "the end of the recording is missing: call 6, line 9: glRectf: arguments without an end";
    assert!(message.contains("warning: ") && message.contains(place), "{message}");
    // The window has the red frame, and then what was drawn of the next one.
    for (frame, wanted) in [(0, [255, 0, 0]), (1, [0, 255, 0])] {
        let picture = image::open(out.join(format!("frame-{frame:04}.png"))).expect("a picture").to_rgb8();
        assert_eq!(picture.get_pixel(6, 1).0, wanted, "frame {frame}");
    }
    let stats = fs::read_to_string(out.join("stats.json")).expect("statistics");
    let stats: serde_json::Value = serde_json::from_str(&stats).expect("JSON");
    assert_eq!(stats["frames"].as_array().map(Vec::len), Some(2));
    // `inspect` has its table, and the same warning.
    let (code, table, message) = run(&["inspect", &trace]);
    assert_eq!(code, 0, "{message}");
    assert!(table.contains("window 0: 8 x 8") && table.contains("glClearColor") && message.contains(place), "{table}{message}");
    // Nonsense is no cut.
    let trace = written(&folder, "damaged.txt", &format!("GLI0.t\n#! RES 8x8\n{FRAME}glRectf(-1,-1,0,\n{FRAME}"));
    let (code, _, message) = run(&["replay", &trace, "--config", "tiny", "--fidelity", "functional"]);
    assert!(code == 2 && message.contains("call 4, line 7"), "{message}");
}

#[test]
fn what_is_left_out_or_has_no_effect_is_said_and_decides_the_exit_code() {
    let folder = tempfile::tempdir().expect("a folder");
    let trace = written(&folder, "refused.txt", &format!("GLI0.t\n#! RES 8x8\nglNoSuchThing(1)\nglPopMatrix()\n{FRAME}"));
    let replay = |trace: &str, more: &[&str]| {
        run(&[&["replay", trace, "--config", "tiny", "--fidelity", "functional"][..], more].concat())
    };
    let (code, _, message) = replay(&trace, &[]);
    assert!(code == 1 && message.contains("not supported: glNoSuchThing (1 times, first in call 0)"), "{message}");
    // A picture that lacks something is no success.
    let out = folder.path().join("out").display().to_string();
    let (code, _, message) = replay(&trace, &["--lenient", "--out", &out]);
    assert!(code == 1 && message.contains("left out, not supported: glNoSuchThing"), "{message}");
    assert!(fs::exists(format!("{out}/frame-0000.png")).expect("a folder"));
    let error = "note: {}: these calls raise an OpenGL error and have no effect: glPopMatrix: GL_STACK_UNDERFLOW (1 times, first in call 1)";
    assert!(message.contains(&error.replace("{}", &trace)), "{message}");
    // An error of the program alone loses nothing. Without a swap, the end is a frame.
    let trace = written(&folder, "whole.txt", "GLI0.t\n#! RES 8x8\nglPopMatrix()\nglRectf(-1,-1,0,0)\n");
    let (code, _, message) = replay(&trace, &[]);
    assert!(code == 0 && message.contains("GL_STACK_UNDERFLOW"), "{message}");
    assert!(message.contains("no call swaps buffers: the whole recording is one frame"), "{message}");
    let (code, table, _) = run(&["inspect", &trace]);
    assert!(code == 0 && table.contains("no call swaps buffers"), "{table}");
}
