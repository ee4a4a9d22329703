//! Floor 9: the command line, one file a subcommand. Parses, calls, prints; nothing is computed here.

/// As the standard one, for a reader who may go away: see [`say`].
macro_rules! print {
    ($($text:tt)*) => { $crate::cli::say(format_args!($($text)*)) };
}

/// As [`print`], with the end of a line.
macro_rules! println {
    ($($text:tt)*) => { $crate::cli::say(format_args!("{}\n", format_args!($($text)*))) };
}

/// As [`println`], of a summary that `--quiet` leaves out.
macro_rules! tell {
    ($($text:tt)*) => { if !$crate::cli::is_quiet() { println!($($text)*) } };
}

/// As the standard one; what is said comes from others too, and must not steer a terminal.
macro_rules! eprintln {
    ($($text:tt)*) => { $crate::cli::complain(format_args!($($text)*)) };
}

#[cfg(feature = "accuracy")]
mod accuracy;
#[cfg(feature = "accuracy")]
mod attila;
mod beside;
#[cfg(feature = "accuracy")]
mod builds;
mod built_in;
#[cfg(feature = "accuracy")]
mod card;
mod compare;
mod configs;
mod demo;
#[cfg(feature = "accuracy")]
mod estimates;
mod import;
mod inspect;
mod interrupt;
#[cfg(feature = "accuracy")]
mod knobs;
mod manual;
#[cfg(feature = "accuracy")]
mod pareto;
mod pixel;
mod progress;
mod reading;
mod replay;
mod report;
#[cfg(feature = "accuracy")]
mod runs;
#[cfg(feature = "accuracy")]
mod scenes;
mod shaders;
#[cfg(feature = "accuracy")]
mod shortcuts;
#[cfg(feature = "accuracy")]
mod skips;
mod suggest;
mod sweep;
mod threads;
mod why;

use std::io::{ErrorKind, Write};
use std::process::{ExitCode, exit};
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::Result;
use clap::{CommandFactory, Parser, Subcommand};

use crate::host::{Fence, excerpt, is_obeyed};
use crate::num::OUR_FAULT;
use host::is_guarded;

/// Replays recorded graphics traces on a cycle-approximate model of a graphics card.
#[derive(Parser)]
#[command(name = "fillrate", version = env!("FILLRATE_VERSION"), about, after_help = "Start with:\n  fillrate demo cube")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// No progress, no summary, no notes and warnings: results and errors only
    #[arg(short, long, global = true)]
    quiet: bool,
}

#[derive(Subcommand)]
enum Command {
    Demo(demo::Arguments),
    Replay(replay::Arguments),
    Import(import::Arguments),
    Inspect(inspect::Arguments),
    Configs(configs::Arguments),
    Compare(compare::Arguments),
    #[cfg(feature = "accuracy")]
    Accuracy(accuracy::Arguments),
    Sweep(sweep::Arguments),
    Why(why::Arguments),
    Pixel(pixel::Arguments),
    Shaders(shaders::Arguments),
    Report(report::Arguments),
    Completions(manual::Completions),
    Manual(manual::Manual),
}

/// How a command ended, short of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// Done.
    Done,
    /// Done, and what was checked did not hold.
    Failed,
}

impl Verdict {
    /// [`Verdict::Failed`] if either part failed.
    fn and(self, other: Verdict) -> Verdict {
        if other == Verdict::Failed { other } else { self }
    }
}

/// Exit code of a program whose reader has gone: what shells report for one that the signal of a broken pipe has ended.
const READER_GONE: i32 = 141;

/// Bytes of a message at most: one that quotes a file of gigabytes is of no use.
const MESSAGE_MAX: usize = 16 << 10;

/// Whether `--quiet` is given.
static QUIET: AtomicBool = AtomicBool::new(false);

/// Whether summaries, progress, notes and warnings are left out.
fn is_quiet() -> bool {
    QUIET.load(Ordering::Relaxed)
}

/// Writes to the standard output, with control characters escaped: labels and file names come from the trace. Where no process
/// reads on (`fillrate replay … | head`), the program ends without a word.
fn say(text: std::fmt::Arguments<'_>) {
    said(Fence::print(std::io::stdout().lock(), text));
}

/// Writes what was said and not yet written.
fn flush() {
    said(std::io::stdout().flush());
}

fn said(result: std::io::Result<()>) {
    let Err(error) = result else { return };
    if error.kind() == ErrorKind::BrokenPipe {
        exit(READER_GONE);
    }
    eprintln!("error: cannot write to the standard output: {error}");
    exit(2);
}

/// Writes JSON to the standard output, on lines. What a terminal would obey is written as JSON escapes it: the same value.
fn say_json(value: &impl serde::Serialize) -> Result<()> {
    let text = serde_json::to_string_pretty(value)?;
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            c if c == '\n' || !is_obeyed(c) => out.push(c),
            c => c.encode_utf16(&mut [0; 2]).iter().for_each(|unit| out.push_str(&format!("\\u{unit:04x}"))),
        }
    }
    println!("{out}");
    Ok(())
}

/// Writes a line to the standard error, with control characters escaped. Errors alone if `--quiet` is given.
fn complain(text: std::fmt::Arguments<'_>) {
    let text = text.to_string();
    if is_quiet() && ["warning: ", "note: "].iter().any(|kind| text.starts_with(kind)) {
        return;
    }
    // There is no other place to report that this fails.
    let _ = Fence::print(std::io::stderr().lock(), format_args!("{}\n", excerpt(&text, MESSAGE_MAX)));
}

fn run(command: &Command) -> Result<Verdict> {
    threads::start(match command {
        Command::Demo(arguments) => arguments.threads,
        Command::Replay(arguments) => arguments.threads,
        #[cfg(feature = "accuracy")]
        Command::Accuracy(arguments) => arguments.threads,
        Command::Sweep(arguments) => arguments.threads,
        Command::Why(arguments) => arguments.threads,
        Command::Pixel(arguments) => arguments.threads,
        Command::Shaders(arguments) => arguments.threads,
        Command::Report(arguments) => arguments.threads,
        Command::Import(_) | Command::Inspect(_) | Command::Configs(_) | Command::Compare(_) => None,
        Command::Completions(_) | Command::Manual(_) => None,
    })?;
    match command {
        Command::Demo(arguments) => demo::run(arguments),
        Command::Replay(arguments) => replay::run(arguments),
        Command::Import(arguments) => import::run(arguments),
        Command::Inspect(arguments) => inspect::run(arguments),
        Command::Configs(arguments) => configs::run(arguments),
        Command::Compare(arguments) => compare::run(arguments),
        #[cfg(feature = "accuracy")]
        Command::Accuracy(arguments) => accuracy::run(arguments),
        Command::Sweep(arguments) => sweep::run(arguments),
        Command::Why(arguments) => why::run(arguments),
        Command::Pixel(arguments) => pixel::run(arguments),
        Command::Shaders(arguments) => shaders::run(arguments),
        Command::Report(arguments) => report::run(arguments),
        Command::Completions(arguments) => manual::completions(arguments),
        Command::Manual(arguments) => manual::manual(arguments),
    }
}

/// Runs the command line and answers the exit code: 0 done, 1 a check failed or a recording is not supported, 2 bad input or use.
pub fn main() -> ExitCode {
    // A front end's panic is reported as an error, once.
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !is_guarded() {
            report(panic);
            // Another thread's panic becomes an error that says so.
            if std::thread::current().name() == Some("main") {
                eprintln!("{OUR_FAULT}");
            }
        }
    }));
    let arguments = match Arguments::try_parse() {
        Ok(arguments) => arguments,
        // What is wrong repeats the arguments; help is ours alone.
        Err(mut wrong) if wrong.use_stderr() => {
            suggest::correct(&mut wrong, &Arguments::command());
            eprintln!("{}", wrong.to_string().trim_end());
            return ExitCode::from(2);
        }
        Err(help) => {
            said(help.print());
            flush();
            return ExitCode::SUCCESS;
        }
    };
    QUIET.store(arguments.quiet, Ordering::Relaxed);
    interrupt::watch();
    let result = run(&arguments.command);
    flush();
    match result {
        Ok(Verdict::Done) => ExitCode::SUCCESS,
        Ok(Verdict::Failed) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(if reading::is_unsupported(&error) { 1 } else { 2 })
        }
    }
}
