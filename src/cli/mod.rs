//! Floor 7: the command line, one file a subcommand. Parses, calls, prints; nothing is computed here.

/// As the standard one, for a reader who may go away: see [`say`].
macro_rules! print {
    ($($text:tt)*) => { $crate::cli::say(format_args!($($text)*)) };
}

/// As [`print`], with the end of a line.
macro_rules! println {
    ($($text:tt)*) => { $crate::cli::say(format_args!("{}\n", format_args!($($text)*))) };
}

mod accuracy;
mod compare;
mod configs;
mod import;
mod inspect;
mod pareto;
mod reading;
mod replay;
mod shortcuts;
mod skips;

use std::io::{ErrorKind, Write};
use std::process::{ExitCode, exit};

use anyhow::{Context, Result};
use clap::{Parser, Subcommand};

use crate::render::is_guarded;

/// Replays recorded graphics traces on a cycle-approximate model of a graphics card.
#[derive(Parser)]
#[command(name = "fillrate", version, about, after_help = "Start with:\n  fillrate replay traces/cube --out out")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    Replay(replay::Arguments),
    Import(import::Arguments),
    Inspect(inspect::Arguments),
    Configs(configs::Arguments),
    Compare(compare::Arguments),
    Accuracy(accuracy::Arguments),
}

/// How a command ended, short of an error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Verdict {
    /// Done.
    Done,
    /// Done, and what was checked did not hold.
    Failed,
}

/// Exit code of a program whose reader has gone: what shells report for one that the signal of a broken pipe has ended.
const READER_GONE: i32 = 141;

/// Writes to the standard output. Where nobody reads on (`fillrate replay … | head`), the program ends without a word.
fn say(text: std::fmt::Arguments<'_>) {
    if let Err(error) = std::io::stdout().write_fmt(text) {
        if error.kind() == ErrorKind::BrokenPipe {
            exit(READER_GONE);
        }
        eprintln!("error: cannot write to the standard output: {error}");
        exit(2);
    }
}

/// Makes so many threads those that everything runs on.
fn use_threads(threads: Option<u16>) -> Result<()> {
    let Some(threads) = threads else { return Ok(()) };
    rayon::ThreadPoolBuilder::new().num_threads(usize::from(threads)).build_global().context("cannot start the threads")
}

/// Runs the command line and answers the exit code: 0 done, 1 a check failed, 2 bad input or use.
pub fn main() -> ExitCode {
    // A front end's panic is reported as an error, once.
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        if !is_guarded() {
            report(panic);
        }
    }));
    let arguments = Arguments::parse();
    let result = match arguments.command {
        Command::Replay(arguments) => replay::run(&arguments),
        Command::Import(arguments) => import::run(&arguments),
        Command::Inspect(arguments) => inspect::run(&arguments),
        Command::Configs(arguments) => configs::run(&arguments),
        Command::Compare(arguments) => compare::run(&arguments),
        Command::Accuracy(arguments) => accuracy::run(&arguments),
    };
    match result {
        Ok(Verdict::Done) => ExitCode::SUCCESS,
        Ok(Verdict::Failed) => ExitCode::from(1),
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::from(2)
        }
    }
}
