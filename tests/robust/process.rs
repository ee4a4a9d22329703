//! Runs the program on hostile input as a separate process, under bounds of memory and time. Only here are crashes and hangs of the
//! process detected.

use std::ffi::{OsStr, OsString};
use std::io::Read;
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

/// One run of the program, and its bounds.
#[derive(Clone, Debug)]
pub struct Run {
    arguments: Vec<OsString>,
    variables: Vec<(OsString, OsString)>,
    folder: Option<PathBuf>,
    stdout: Option<PathBuf>,
    memory_mib: u64,
    cpu_seconds: u64,
    wall: Duration,
    file_kib: Option<u64>,
    stack_kib: Option<u64>,
}

/// How a run ended.
#[derive(Debug)]
pub struct Output {
    pub status: ExitStatus,
    pub stdout: String,
    pub stderr: String,
    /// It was killed because its wall time was up.
    pub timed_out: bool,
    /// The largest resident memory that was seen, in bytes: looked at every few milliseconds, so a short peak can be missed.
    pub peak: u64,
    pub wall: Duration,
    /// Time of all processors together, as far as it was seen: looked at as often as memory.
    pub busy: Duration,
}

/// A run of the program with these arguments. Bounds: 4 GiB of address space, 20 s of processor time, 40 s of wall time; two threads.
pub fn fillrate<A: AsRef<OsStr>>(arguments: impl IntoIterator<Item = A>) -> Run {
    Run {
        arguments: arguments.into_iter().map(|argument| argument.as_ref().to_owned()).collect(),
        // Address space is reserved by each thread: the bound must not depend on the machine's number of cores.
        variables: vec![("RAYON_NUM_THREADS".into(), "2".into())],
        folder: None,
        stdout: None,
        memory_mib: 4096,
        cpu_seconds: 20,
        wall: Duration::from_secs(40),
        file_kib: None,
        stack_kib: None,
    }
}

impl Run {
    /// Adds an argument.
    pub fn arg(mut self, argument: impl AsRef<OsStr>) -> Run {
        self.arguments.push(argument.as_ref().to_owned());
        self
    }

    /// Sets an environment variable.
    pub fn env(mut self, name: &str, value: impl AsRef<OsStr>) -> Run {
        self.variables.push((name.into(), value.as_ref().to_owned()));
        self
    }

    /// Runs in this folder.
    pub fn current_dir(mut self, folder: impl AsRef<Path>) -> Run {
        self.folder = Some(folder.as_ref().to_owned());
        self
    }

    /// Writes the standard output to this file.
    pub fn stdout(mut self, file: impl AsRef<Path>) -> Run {
        self.stdout = Some(file.as_ref().to_owned());
        self
    }

    /// Bounds the address space, in MiB (`ulimit -v`): an allocation beyond fails.
    pub fn memory_mib(mut self, mib: u64) -> Run {
        self.memory_mib = mib;
        self
    }

    /// Bounds the time of all processors together, in seconds (`ulimit -t`): the process is killed after.
    pub fn cpu_seconds(mut self, seconds: u64) -> Run {
        self.cpu_seconds = seconds;
        self
    }

    /// Bounds the wall time, in seconds: the process is killed after.
    pub fn wall_seconds(mut self, seconds: u64) -> Run {
        self.wall = Duration::from_secs(seconds);
        self
    }

    /// Bounds each file that is written, in KiB (`ulimit -f`): writing beyond fails as on a full disk, and sends a signal that ends a process which does
    /// not ignore it.
    pub fn file_kib(mut self, kib: u64) -> Run {
        self.file_kib = Some(kib);
        self
    }

    /// Bounds the stack of the first thread, in KiB (`ulimit -s`).
    pub fn stack_kib(mut self, kib: u64) -> Run {
        self.stack_kib = Some(kib);
        self
    }

    /// Starts it, and answers the process.
    pub fn spawn(&self) -> Child {
        // Blocks of `ulimit -f` are 512 bytes.
        let files = self.file_kib.map(|kib| format!("ulimit -f {} &&", 2 * kib)).unwrap_or_default();
        let stack = self.stack_kib.map(|kib| format!("ulimit -s {kib} &&")).unwrap_or_default();
        let script = format!(
            "ulimit -c 0; {files} {stack} ulimit -v {} && ulimit -t {} && exec \"$0\" \"$@\"",
            self.memory_mib * 1024,
            self.cpu_seconds
        );
        let mut command = Command::new("/bin/sh");
        command.arg("-c").arg(script).arg(env!("CARGO_BIN_EXE_fillrate")).args(&self.arguments);
        command.envs(self.variables.iter().map(|(name, value)| (name, value)));
        if let Some(folder) = &self.folder {
            command.current_dir(folder);
        }
        let stdout = self.stdout.as_ref().map_or_else(Stdio::piped, |path| {
            let file = std::fs::OpenOptions::new().write(true).create(true).truncate(true).open(path);
            file.unwrap_or_else(|error| panic!("{}: {error}", path.display())).into()
        });
        command.stdin(Stdio::null()).stdout(stdout).stderr(Stdio::piped());
        command.spawn().expect("the program starts")
    }

    /// Runs it to its end, or to the end of its time.
    pub fn run(&self) -> Output {
        let begin = Instant::now();
        let mut child = self.spawn();
        let stdout = child.stdout.take().map(collect);
        let stderr = child.stderr.take().map(collect);
        let (mut peak, mut timed_out, mut busy) = (0, false, Duration::ZERO);
        let mut pause = Duration::from_millis(1);
        let status = loop {
            if let Some(status) = child.try_wait().expect("a process of ours") {
                break status;
            }
            peak = peak.max(resident_peak(child.id()));
            busy = busy.max(busy_time(child.id()));
            if !timed_out && begin.elapsed() > self.wall {
                timed_out = true;
                child.kill().expect("a process of ours");
            }
            thread::sleep(pause);
            pause = (pause * 2).min(Duration::from_millis(10));
        };
        let text = |reader: Option<thread::JoinHandle<Vec<u8>>>| {
            let bytes = reader.map(|reader| reader.join().expect("the output is read")).unwrap_or_default();
            String::from_utf8_lossy(&bytes).into_owned()
        };
        Output { status, stdout: text(stdout), stderr: text(stderr), timed_out, peak, wall: begin.elapsed(), busy }
    }
}

fn collect(mut from: impl Read + Send + 'static) -> thread::JoinHandle<Vec<u8>> {
    thread::spawn(move || {
        let mut bytes = Vec::new();
        from.read_to_end(&mut bytes).expect("the output can be read");
        bytes
    })
}

/// The largest resident memory of a process so far, in bytes; 0 where the system does not say.
fn resident_peak(process: u32) -> u64 {
    // A process that begins has the memory of the one that starts it, for a moment after that goes on.
    let program = std::fs::read_link(format!("/proc/{process}/exe"));
    if program.ok() == std::env::current_exe().ok() {
        return 0;
    }
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap_or_default();
    line.trim().trim_end_matches(" kB").parse::<u64>().unwrap_or(0) * 1024
}

/// The time that all processors have spent on a process so far; 0 where the system does not say.
fn busy_time(process: u32) -> Duration {
    let status = std::fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    // Behind the name, which may have blanks: 11 fields, then the time of the program and the time of the system, in hundredths of a second.
    let fields = status.rsplit(')').next().unwrap_or_default().split_whitespace();
    Duration::from_millis(10 * fields.skip(11).take(2).filter_map(|ticks| ticks.parse::<u64>().ok()).sum::<u64>())
}

/// Asserts that a run refused its input: exit status 2, one message on the standard error that has all of these texts, and neither
/// a panic nor anything that a terminal would obey.
#[track_caller]
pub fn refused(output: &Output, texts: &[&str]) {
    assert!(!output.timed_out, "killed after {:?}: {output:?}", output.wall);
    assert_eq!(output.status.signal(), None, "{output:?}");
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    assert!(output.stderr.starts_with("error: "), "{output:?}");
    assert!(!output.stderr.contains("panicked"), "{output:?}");
    for text in texts {
        assert!(output.stderr.contains(text), "no {text:?} in the message: {output:?}");
    }
    printable(output);
}

/// Asserts that a run ended well.
#[track_caller]
pub fn done(output: &Output) {
    assert!(!output.timed_out, "killed after {:?}: {output:?}", output.wall);
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    printable(output);
}

/// Asserts that nothing was printed that a terminal would obey: of all control characters only the ends of lines.
#[track_caller]
pub fn printable(output: &Output) {
    for text in [&output.stdout, &output.stderr] {
        let obeyed = |c: char| {
            c.is_control() && c != '\n'
                || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
        };
        assert!(!text.contains(obeyed), "control characters in {text:?}");
    }
}

/// Asserts that the resident memory of a run stayed below this number of MiB.
#[track_caller]
pub fn below_mib(output: &Output, mib: u64) {
    assert!(output.peak < mib << 20, "{} MiB of resident memory, wanted less than {mib}", output.peak >> 20);
}

mod tests {
    use super::*;

    #[test]
    fn an_input_that_is_not_there_is_refused() {
        let output = fillrate(["inspect", "/nowhere/at/all"]).run();
        refused(&output, &["/nowhere/at/all"]);
    }

    #[test]
    fn a_run_is_bounded_in_memory_and_time() {
        let help = fillrate(["--help"]).memory_mib(1).run();
        assert_ne!(help.status.code(), Some(0), "a program that runs in 1 MiB: {help:?}");
        let late = fillrate(["replay", "traces/town.zip"]).current_dir(env!("CARGO_MANIFEST_DIR")).wall_seconds(0).run();
        assert!(late.timed_out && late.status.signal() == Some(9), "{late:?}");
    }
}
