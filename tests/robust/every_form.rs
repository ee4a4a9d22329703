//! Each form of hostile input is answered: refused by name, or replayed. Small ones here; up to a megabyte, under the default limits, by the
//! tests that are ignored, which take many minutes and print a table:
//!
//! ```sh
//! cargo test --release --test robust every_form -- --ignored --nocapture --test-threads 1
//! ```
//!
//! Their seconds are those of the clock, so that the host must have nothing else to do. With `FILLRATE_FORMS=pixels,loops` they run the forms
//! alone whose names have one of these parts.

use std::path::Path;

use fillrate::gfx::format::Format;
use fillrate::import;
use fillrate::machine::Config;
use fillrate::render::{self, Options};
use fillrate::sweep::experiment::Experiment;
use fillrate::trace::command::AnyPipeline;
use fillrate::trace::record::{self, Recorder};
use fillrate::trace::{Packing, Reading, Trace, check};
use tempfile::TempDir;

use super::forms::ron::{CONFIGURATION, EXPERIMENT, FileTemplate, NATIVE, VALUES, WGPU};
use super::forms::{TextForm, binary, calls, grammar, work};
use super::pictures;
use super::process::{Run, fillrate, printable};
use super::shaders::run_everything;

/// Sizes in bytes.
const SIZES: [usize; 3] = [20_000, 100_000, 1_000_000];
/// Seconds on the clock of two processors, and memory, within which every input below a megabyte is answered.
const SECONDS: f64 = 30.0;
/// The same for a machine that may take 600 million steps: those of functional rendering, and the machine's own behind it.
const CYCLE_SECONDS: f64 = 60.0;
const MIB: u64 = 3_000;

/// What took longest and what took most.
struct Worst {
    /// The seconds that an answer may take.
    most: f64,
    seconds: f64,
    mib: u64,
    late: Vec<String>,
}

impl Worst {
    fn new(most: f64) -> Worst {
        Worst { most, seconds: 0.0, mib: 0, late: Vec::new() }
    }

    /// Runs a process and notes what it took. It must end by itself, in time, without a panic.
    fn take(&mut self, name: &str, bytes: usize, run: Run) {
        if std::env::var("FILLRATE_FORMS").is_ok_and(|parts| !parts.split(',').any(|part| name.contains(part))) {
            return;
        }
        let output = run.cpu_seconds(150).wall_seconds(1_000).memory_mib(8_000).run();
        let (seconds, mib) = (output.wall.as_secs_f64(), output.peak >> 20);
        let said: String = output.stderr.lines().next().unwrap_or_default().chars().rev().take(90).collect();
        let said: String = said.chars().rev().collect();
        println!(
            "{name:60} {bytes:8} bytes {seconds:6.2} s, {:6.2} s of processors, {mib:5} MiB {:?} {said}",
            output.busy.as_secs_f64(),
            output.status.code()
        );
        let fails = output.timed_out
            || !matches!(output.status.code(), Some(0..=2))
            || output.stderr.contains("panicked")
            || output.stderr.contains("fault of Fillrate");
        printable(&output);
        // Limits grow with every megabyte of a larger input.
        let most = self.most * bytes.div_ceil(1 << 20).max(1) as f64;
        if fails || seconds > most || mib > MIB {
            self.late.push(format!("{name}, {bytes} bytes: {seconds:.1} s, {mib} MiB, {:?}: {said}", output.status));
        }
        (self.seconds, self.mib) = (self.seconds.max(seconds), self.mib.max(mib));
    }

    fn end(self) {
        println!("at most {:.1} s and {} MiB", self.seconds, self.mib);
        assert!(self.late.is_empty(), "{} are not answered in time:\n{}", self.late.len(), self.late.join("\n"));
    }
}

/// A size that gives a text of about `bytes` bytes.
fn size_for(bytes: usize, length: impl Fn(usize) -> usize) -> usize {
    (100 * bytes / (length(300) - length(200)).max(1)).max(1)
}

/// Recordings that use a shader: of a compute pass of one workgroup, or of a draw.
fn shading(wgsl: &str) -> Recorder {
    let mut card = Recorder::new("hostile");
    let shader = card.create_shader("hostile", wgsl);
    if wgsl.contains("@fragment") {
        let format = Format::Rgba8Unorm;
        let texture = card.create_texture("target", record::texture_2d(8, 8, format));
        let view = card.create_view(texture);
        let pipeline = card.create_render_pipeline("hostile", record::render_pipeline(shader, format));
        let mut pass = card.begin_render_pass([record::clear(view, [0.0; 4])], None);
        pass.set_pipeline(pipeline);
        pass.draw(3, 1);
    } else {
        let buffer = card.create_buffer("b", 1 << 16);
        let pipeline = card.create_compute_pipeline("hostile", None, record::stage_entry(shader, "main"));
        let layout = card.get_bind_group_layout(AnyPipeline::Compute(pipeline), 0);
        let group = card.create_bind_group(layout, [(0, record::whole(buffer))]);
        let mut pass = card.begin_compute_pass();
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group);
        pass.dispatch(1, 1, 1);
    }
    card
}

fn replay(card: Recorder, options: &[&str]) -> (TempDir, Run) {
    let folder = TempDir::new().expect("a folder");
    card.save(folder.path()).unwrap_or_else(|error| panic!("{error}"));
    let run = fillrate(["replay".as_ref(), folder.path().as_os_str()]);
    (folder, options.iter().fold(run, |run, option| run.arg(option)))
}

/// Runs the program on a file, or on the folder of a file that is called `trace.ron`.
fn on_file(name: &str, bytes: &[u8], command: &[&str]) -> (TempDir, Run) {
    let folder = TempDir::new().expect("a folder");
    let path = folder.path().join(name);
    std::fs::write(&path, bytes).expect("a file");
    let run = command.iter().fold(fillrate(&[] as &[&str]), |run, argument| run.arg(argument));
    (folder, run.arg(path))
}

/// Runs a check on all elements, in as many threads as there are processors. A stack of a thread is the program's own.
fn each<T: Sync>(all: &[T], check: impl Fn(&T) + Sync) {
    std::thread::scope(|scope| {
        for part in 0..2 {
            let check = &check;
            let work = move || all.iter().skip(part).step_by(2).for_each(check);
            std::thread::Builder::new().stack_size(8 << 20).spawn_scoped(scope, work).expect("a thread");
        }
    });
}

#[test]
fn shaders_of_every_form_are_compiled_or_refused() {
    let all: Vec<TextForm> = grammar::ALL.concat();
    each(&all, |(name, make)| {
        for size in [2, 25] {
            println!("{name} {size}");
            run_everything(format!("W{}", make(size)).as_bytes());
        }
    });
}

/// Reads a text as a file of a kind; whatever it is, there is an answer.
type Read = fn(&str);

#[test]
fn texts_of_every_form_are_read_or_refused() {
    let readers: [(&[FileTemplate], Read); 4] = [
        (NATIVE, |text| {
            let trace = Trace::open_files(Path::new("t.ron"), text.as_bytes().to_vec(), std::iter::empty());
            drop(trace.map(|trace| check(&trace)));
        }),
        (WGPU, |text| {
            let trace = import::wgpu::import(Path::new("/nowhere/trace.ron"), text.as_bytes());
            drop(trace.map(|trace| check(&trace)));
        }),
        (CONFIGURATION, |text| drop(Config::parse("c.ron", text))),
        (EXPERIMENT, |text| drop(Experiment::parse("e.ron", text))),
    ];
    each(VALUES, |(_, make)| {
        let value = make(300);
        for (places, read) in readers {
            places.iter().for_each(|(_, before, behind)| read(&format!("{before}{value}{behind}")));
        }
    });
}

#[test]
fn recordings_of_every_form_are_imported_or_refused() {
    let texts = [calls::CALLS, calls::LARGE].concat();
    let reading = Reading { lenient: true, ..Reading::default() };
    let imported = |bytes: Vec<u8>| {
        if let Ok((trace, _)) = import::gl::import_bytes(Path::new("t.txt"), bytes, [&[], &[]], &reading) {
            check(&trace).unwrap_or_else(|error| panic!("{error}"));
        }
    };
    each(&texts, |(_, make)| [1, 8].into_iter().for_each(|size| imported(make(size).into_bytes())));
    each(binary::RECORDINGS, |(_, make)| imported(make(3_000)));
}

#[test]
fn files_of_every_form_are_read_or_refused() {
    each(binary::PICTURES, |(_, make)| pictures::read_everything(&make(3_000)));
    each(binary::ARCHIVES, |(_, make)| drop(Trace::open_archive(Path::new("t.zip"), make(5_000).into())));
}

#[test]
fn commands_of_every_form_are_replayed_or_refused() {
    each(work::COMMANDS, |(name, make)| {
        let rendered = render::render(&make(20).finish(), &Options::default(), &mut |_| Ok(()));
        // Only a draw whose arguments are in no buffer is wrong.
        assert!(rendered.is_ok() || *name == "indirect draws", "{name}: {:?}", rendered.err());
    });
}

#[test]
#[ignore = "minutes"]
fn every_form_of_shaders_up_to_a_megabyte_is_answered() {
    let mut worst = Worst::new(SECONDS);
    for (name, make) in grammar::ALL.iter().filter(|kinds| !std::ptr::eq(**kinds, grammar::LARGE)).copied().flatten() {
        for bytes in SIZES {
            let text = make(size_for(bytes, |n| make(n).len()));
            let (_folder, run) = replay(shading(&text), &["--fidelity", "functional"]);
            worst.take(name, text.len(), run);
        }
    }
    for (name, make) in grammar::LARGE {
        for size in [4, 12, 20, 30, 60, 120, 1000] {
            let text = make(size);
            let (_folder, run) = replay(shading(&text), &["--fidelity", "functional"]);
            worst.take(&format!("{name}: {size}"), text.len(), run);
        }
    }
    worst.end();
}

#[test]
#[ignore = "minutes"]
fn every_form_of_texts_up_to_a_megabyte_is_answered() {
    let mut worst = Worst::new(SECONDS);
    for (what, places, file, command) in [
        ("native", NATIVE, "trace.ron", &["inspect"][..]),
        ("wgpu", WGPU, "trace.ron", &["inspect"]),
        ("configuration", CONFIGURATION, "c.ron", &["configs"]),
        ("experiment", EXPERIMENT, "e.ron", &["sweep", "--dry-run"]),
    ] {
        for (place, before, behind) in places {
            for (name, make) in VALUES {
                for bytes in SIZES {
                    // A configuration has 256 KiB at most.
                    let bytes = if what == "configuration" { bytes.min(250_000) } else { bytes };
                    let text = format!("{before}{}{behind}", make(size_for(bytes, |n| make(n).len())));
                    let (_folder, run) = on_file(file, text.as_bytes(), command);
                    worst.take(&format!("{what}, {place}: {name}"), text.len(), run);
                }
            }
        }
    }
    worst.end();
}

#[test]
#[ignore = "minutes"]
fn every_form_of_recordings_up_to_a_megabyte_is_answered() {
    let mut worst = Worst::new(SECONDS);
    for (name, make) in calls::CALLS {
        for bytes in SIZES {
            let text = make(size_for(bytes, |n| make(n).len()));
            let (_folder, run) = on_file("t.txt", text.as_bytes(), &["replay", "--fidelity", "functional"]);
            worst.take(name, text.len(), run);
        }
    }
    for (name, make) in calls::LARGE {
        for size in [4, 12, 20, 25, 30, 40, 400] {
            let text = make(size);
            let (_folder, run) = on_file("t.txt", text.as_bytes(), &["replay", "--fidelity", "functional"]);
            worst.take(&format!("{name}: {size}"), text.len(), run);
        }
    }
    for (name, make) in binary::RECORDINGS {
        for bytes in SIZES {
            let file = make(bytes);
            let (_folder, run) = on_file("t.trace", &file, &["replay", "--fidelity", "functional"]);
            worst.take(name, file.len(), run);
        }
    }
    worst.end();
}

#[test]
#[ignore = "minutes"]
fn every_form_of_files_up_to_a_megabyte_is_answered() {
    let mut worst = Worst::new(SECONDS);
    for (name, make) in binary::PICTURES {
        for bytes in SIZES {
            let file = make(bytes);
            let (folder, run) = on_file("a.png", &file, &["compare"]);
            worst.take(name, file.len(), run.arg(folder.path().join("a.png")));
        }
    }
    for (name, make) in binary::ARCHIVES {
        for bytes in SIZES {
            let file = make(bytes);
            let (_folder, run) = on_file("t.zip", &file, &["inspect"]);
            worst.take(name, file.len(), run);
        }
    }
    worst.end();
}

/// What a replay of commands and of endless work takes with a fidelity.
fn replayed(fidelity: &[&str], most: f64) {
    let mut worst = Worst::new(most);
    let length = |make: fn(usize) -> Recorder, n: usize| {
        let folder = TempDir::new().expect("a folder");
        let path = folder.path().join("t.zip");
        make(n).save_zip(&path, Packing::Stored).unwrap_or_else(|error| panic!("{error}"));
        std::fs::metadata(path).expect("a file").len() as usize
    };
    for (name, make) in work::COMMANDS {
        for bytes in SIZES {
            let size = size_for(bytes, |n| length(*make, n));
            let (_folder, run) = replay(make(size), fidelity);
            worst.take(name, bytes, run);
        }
    }
    for (name, make) in work::ENDLESS {
        for amount in [10, 1_000, 60_000] {
            let (_folder, run) = replay(make(amount), fidelity);
            worst.take(&format!("{name}: {amount}"), length(*make, amount), run);
        }
    }
    worst.end();
}

#[test]
#[ignore = "minutes"]
fn every_form_of_work_is_answered() {
    replayed(&["--fidelity", "functional"], SECONDS);
}

#[test]
#[ignore = "minutes"]
fn every_form_of_work_in_cycles_is_answered() {
    replayed(&["--fidelity", "cycle", "--config", "wide", "--limit", "work.machine_steps=600_000_000"], CYCLE_SECONDS);
}
