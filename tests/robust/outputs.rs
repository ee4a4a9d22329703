//! Disks that are full, programs that are killed, and threads that cannot be started.

use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use crate::process::{Run, done, fillrate, refused};

const REPOSITORY: &str = env!("CARGO_MANIFEST_DIR");

fn run(arguments: &[&str]) -> Run {
    fillrate(arguments).current_dir(REPOSITORY)
}

fn files(folder: &Path) -> Vec<String> {
    let entries: Vec<_> = std::fs::read_dir(folder).map(|entries| entries.flatten().collect()).unwrap_or_default();
    let mut names: Vec<String> = entries.iter().map(|entry| entry.file_name().to_string_lossy().into_owned()).collect();
    names.sort();
    names
}

#[test]
fn the_program_runs_on_a_stack_of_its_own() {
    for kib in [64, 128, 256] {
        done(&run(&["inspect", "traces/triangle"]).stack_kib(kib).run());
        done(&run(&["replay", "traces/triangle", "--config", "tiny"]).stack_kib(kib).run());
    }
}

#[test]
fn a_full_disk_leaves_no_half_written_file() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("out");
    let path = |name: &str| home.path().join(name).to_string_lossy().into_owned();
    // Pictures of 64 x 64 pixels fit, the statistics do not.
    let replay = run(&["replay", "traces/triangle", "--config", "tiny", "--fidelity", "functional", "--out", &path("out")]);
    done(&replay.run());
    let complete = files(&out);
    assert!(complete.contains(&"stats.json".to_owned()), "{complete:?}");
    let before = std::fs::read(out.join("config.ron")).expect("there");
    refused(&replay.clone().file_kib(8).run(), &["out/", "cannot write", "File too large"]);
    let left = files(&out);
    assert!(!left.contains(&"stats.json".to_owned()), "statistics of an earlier replay beside new pictures: {left:?}");
    assert!(left.iter().all(|name| complete.contains(name)), "{left:?}");
    assert_eq!(std::fs::read(out.join("config.ron")).expect("there"), before, "a file is as it was, or complete");
    done(&replay.run());
    assert_eq!(files(&out), complete);

    // A trace: as an archive, as a folder, and as a folder that was there, empty.
    std::fs::create_dir(path("empty")).expect("a folder");
    for name in ["small.zip", "small", "empty"] {
        let import = run(&["import", "traces/corridor", "--out", &path(name)]);
        refused(&import.clone().file_kib(16).run(), &[name, "cannot be written", "File too large"]);
        assert_eq!(files(Path::new(&path(name))), [""; 0], "{name}");
        assert!(!Path::new(&path("small.zip")).exists() || name != "small.zip");
        // The next attempt succeeds.
        done(&import.run());
    }
    let archive = path("small.zip");
    done(&run(&["inspect", &archive]).run());

    // A picture of differences.
    let picture = out.join("frame-0000.png").to_string_lossy().into_owned();
    let compare = run(&["compare", &picture, &picture, "--difference", &path("difference.png")]);
    refused(&compare.clone().file_kib(0).run(), &["difference.png", "cannot write"]);
    assert!(!Path::new(&path("difference.png")).exists());
    done(&compare.run());
    let mut expected = vec!["difference.png", "empty", "out", "small", "small.zip"];
    expected.sort();
    assert_eq!(files(home.path()), expected, "temporary files are left");
}

#[test]
fn one_replay_at_a_time_writes_to_a_folder() {
    let home = tempfile::tempdir().expect("a folder");
    let out = home.path().join("out");
    let replay = ["replay", "traces/triangle", "--config", "tiny", "--fidelity", "functional", "--out"];
    let replay = run(&replay).arg(&out);
    done(&replay.run());
    let complete = files(&out);
    // As another replay does while it runs.
    let held = std::fs::File::open(out.join(".fillrate-files")).expect("the list");
    held.try_lock().expect("nobody writes there");
    refused(&replay.run(), &["out", "another process writes to", "--out"]);
    assert_eq!(files(&out), complete, "the refused replay changed the folder");
    drop(held);
    done(&replay.run());
    assert_eq!(files(&out), complete);
    // Several at once: those that are not refused leave whole outputs.
    let together: Vec<_> = (0..4).map(|_| replay.spawn()).collect();
    let ends: Vec<_> = together.into_iter().map(|child| child.wait_with_output().expect("it ends")).collect();
    for end in &ends {
        let message = String::from_utf8_lossy(&end.stderr);
        assert!(end.status.success() || message.contains("another process writes to"), "{message}");
    }
    assert!(ends.iter().any(|end| end.status.success()), "{ends:?}");
    assert_eq!(files(&out), complete);
}

#[test]
fn files_of_others_stay() {
    let home = tempfile::tempdir().expect("a folder");
    let path = |name: &str| home.path().join(name);
    let text = |name: &str| path(name).to_string_lossy().into_owned();
    let out = text("out");
    let replay = run(&["replay", "traces/triangle", "--config", "tiny", "--fidelity", "functional", "--out", &out]);
    std::fs::create_dir(path("out")).expect("a folder");
    let mine = ["frame-0000.png", "frame-0007.png", "notes.txt"].map(|name| path("out").join(name));
    mine.iter().for_each(|file| std::fs::write(file, "mine").expect("written"));
    refused(&replay.run(), &["frame-0000.png is there (and 1 more)", "no replay has written it", "--force"]);
    assert_eq!(files(&path("out")), ["frame-0000.png", "frame-0007.png", "notes.txt"]);
    assert!(mine.iter().all(|file| std::fs::read(file).is_ok_and(|bytes| bytes == b"mine")));
    done(&replay.clone().arg("--force").run());
    let left = files(&path("out"));
    assert!(left.contains(&"notes.txt".to_owned()) && !left.contains(&"frame-0007.png".to_owned()), "{left:?}");
    // A picture that somebody has put there since.
    std::fs::write(path("out").join("frame-0007.png"), "mine").expect("written");
    refused(&replay.run(), &["frame-0007.png is there,"]);

    // Single files: others are kept, our own are replaced.
    let bound = ["replay", "traces/triangle", "--config", "tiny", "--fidelity", "bound"];
    let timed = ["replay", "traces/triangle", "--config", "tiny"];
    let pictures = [path("out").join("frame-0000.png").to_string_lossy().into_owned(), text("other.png")];
    std::fs::copy("tests/references/triangle-0000.png", path("other.png")).expect("copied");
    let commands = [
        (run(&bound).arg("--report"), "page.html"),
        (run(&timed).arg("--timeline"), "time.json"),
        (run(&["compare", "--allow", "100", &pictures[0], &pictures[1], "--difference"]), "difference.png"),
        (run(&["why", "traces/triangle", "--config", "tiny", "--json"]), "why.json"),
        (run(&["report", &out, "--out"]), "of-folder.html"),
    ];
    for (command, name) in commands {
        let command = command.arg(path(name));
        std::fs::write(path(name), "mine").expect("written");
        refused(&command.run(), &[name, "is there, and fillrate has not written it", "--force"]);
        assert_eq!(std::fs::read(path(name)).expect("there"), b"mine", "{name}");
        done(&command.clone().arg("--force").run());
        assert_ne!(std::fs::read(path(name)).expect("there"), b"mine", "{name}");
        done(&command.run());
    }
    for special in ["/dev/null", &out] {
        refused(&run(&bound).arg("--report").arg(special).run(), &["cannot write", special]);
    }
}

#[test]
fn a_full_standard_output_is_an_error() {
    for arguments in [
        &["--help"][..],
        &["inspect", "traces/triangle"],
        &["inspect", "traces/triangle", "--json"],
        &["configs"],
        &["configs", "tiny"],
        &["configs", "tiny", "--draw"],
        &["replay", "traces/triangle", "--fidelity", "functional"],
        &["accuracy", "--list"],
    ] {
        refused(&run(arguments).stdout("/dev/full").run(), &["standard output", "No space left"]);
    }
}

/// Kills a run again and again, a little later each time, and looks at what it left.
fn killed(run: &Run, mut look: impl FnMut()) {
    let begin = Instant::now();
    let (mut wait, mut ends) = (Duration::from_millis(2), 0);
    while ends < 2 && begin.elapsed() < Duration::from_secs(20) {
        let mut child = run.spawn();
        std::thread::sleep(wait);
        child.kill().expect("a process of ours");
        let output = child.wait().expect("it ends");
        look();
        ends += u32::from(output.signal().is_none());
        wait *= 2;
    }
    assert!(ends > 0, "it never came to its end");
}

#[test]
fn a_killed_program_leaves_nothing_that_looks_complete() {
    let home = tempfile::tempdir().expect("a folder");
    let path = |name: &str| home.path().join(name);
    let text = |path: &Path| path.to_string_lossy().into_owned();
    let reads = |path: &Path| done(&run(&["inspect", &text(path)]).run());
    let clear = |path: &PathBuf| {
        let _ = std::fs::remove_dir_all(path);
        let _ = std::fs::remove_file(path);
    };
    let (folder, archive, out) = (path("folder"), path("archive.zip"), path("out"));
    killed(&run(&["import", "traces/town.zip", "--out", &text(&folder)]), || {
        if folder.join("trace.ron").exists() {
            reads(&folder);
        }
        clear(&folder);
    });
    killed(&run(&["import", "traces/town.zip", "--out", &text(&archive)]), || {
        if archive.exists() {
            reads(&archive);
        }
        clear(&archive);
    });
    let replay = run(&["replay", "traces/triangle", "--config", "tiny", "--fidelity", "functional", "--out", &text(&out)]);
    done(&replay.run());
    // The list of files grows while they are written.
    let outputs = || -> Vec<String> { files(&out).into_iter().filter(|name| name != ".fillrate-files").collect() };
    let complete = outputs();
    let contents =
        |names: &[String]| -> Vec<Vec<u8>> { names.iter().map(|name| std::fs::read(out.join(name)).expect("there")).collect() };
    let expected = contents(&complete);
    clear(&out);
    killed(&replay, || {
        let left: Vec<String> = outputs().into_iter().filter(|name| !name.ends_with(".part")).collect();
        if left.contains(&"stats.json".to_owned()) {
            assert_eq!(left, complete);
        }
        for (name, bytes) in left.iter().zip(contents(&left)) {
            let at = complete.iter().position(|other| other == name).expect("a file of the replay");
            assert!(bytes == expected[at], "{name} is half written");
        }
        clear(&out);
    });
}

#[test]
fn too_many_threads_are_refused() {
    let replay = ["replay", "traces/triangle", "--fidelity", "functional"];
    for bad in ["1025", "100000", "two", "-1"] {
        for command in [&replay[..], &["inspect", "traces/triangle"], &["configs"], &["accuracy", "--list"]] {
            refused(&run(command).env("RAYON_NUM_THREADS", bad).run(), &["RAYON_NUM_THREADS", bad, "1024"]);
        }
        refused(&run(&replay).arg(format!("--threads={bad}")).run(), &["--threads", bad]);
    }
    done(&run(&replay).env("RAYON_NUM_THREADS", "").run());
    done(&run(&replay).env("RAYON_NUM_THREADS", "0").memory_mib(1 << 16).run());
    done(&run(&replay).arg("--threads=1024").memory_mib(1 << 16).run());
}

#[test]
fn threads_that_cannot_be_started_are_an_error() {
    // The stacks of this number of threads do not fit.
    for command in [&["replay", "traces/triangle"][..], &["inspect", "traces/triangle"], &["accuracy", "--list"], &["configs"]]
    {
        let output = run(command).env("RAYON_NUM_THREADS", "1000").memory_mib(1000).run();
        refused(&output, &["cannot start 1000 threads", "--threads", "RAYON_NUM_THREADS", "ulimit"]);
    }
    let output = run(&["replay", "traces/triangle", "--threads", "900"]).memory_mib(1000).run();
    refused(&output, &["cannot start 900 threads"]);
}
