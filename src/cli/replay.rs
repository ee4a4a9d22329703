//! `fillrate replay`

use std::io::IsTerminal;
use std::ops::Range;
use std::path::PathBuf;
use std::str::FromStr;
use std::sync::mpsc::{RecvTimeoutError, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

use anyhow::{Result, anyhow, bail};
use indicatif::{ProgressBar, ProgressStyle};

use super::Verdict;
use super::threads::MOST;
use crate::render::Watch;
use crate::report::files::About;
use crate::report::folder::Folder;
use crate::report::summary::{self, Phases};
use crate::run::replay::{Fidelity, Frame, Options, Outcome, replay_to};
use crate::run::sample::Sampling;
use crate::sim::Clock;

/// Replay a trace on a configured card: images, statistics, a short report
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate replay traces/torus-knot.zip --out out\n  \
fillrate replay traces/cube --config tiny --set memory.port_latency=400 --clock every-cycle\n  \
fillrate replay recorded/trace --frames 2..4 --fidelity functional --out out\n\n\
Leaves in --out: frame-NNNN.png (the trace's own frame numbers), stats.json, stats.csv, config.ron.")]
pub struct Arguments {
    /// The trace: a file, or its folder; native or foreign
    trace: PathBuf,
    #[command(flatten)]
    reading: super::reading::Reading,
    #[command(flatten)]
    machine: super::configs::Choice,
    /// Frames to replay: half-open, as in 2..4, 2.. or ..4
    #[arg(long, value_name = "A..B", default_value = "..")]
    frames: Frames,
    /// Where to leave images and statistics
    #[arg(long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Threads; no result depends on it [default: all processors]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
    /// How much is simulated
    #[arg(long, value_enum, default_value = "cycle")]
    fidelity: FidelityName,
    /// With --fidelity sampled: frames that are simulated and counted
    #[arg(long, value_name = "N", default_value = "8", value_parser = clap::value_parser!(u32).range(2..))]
    samples: u32,
    /// With --fidelity sampled: frames before each of these that warm the caches and are not counted
    #[arg(long, value_name = "N", default_value = "1")]
    warm_up: u32,
    /// With --fidelity sampled: seed of the sampling generator
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
    /// Which clock drives the units; every statistic is the same under both
    #[arg(long, value_enum, default_value = "skip-idle")]
    clock: ClockName,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum FidelityName {
    /// Images and counts, no time
    Functional,
    /// Images, counts, and cycles from counts and rates: the slowest unit of each pass
    Bound,
    /// Every cycle of some frames, which stand for all that are like them; the rest is estimated, with intervals
    Sampled,
    /// Every cycle of every unit
    Cycle,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum ClockName {
    /// Jump over cycles in which nothing can move
    SkipIdle,
    /// Visit every cycle
    EveryCycle,
}

/// A half-open range of frames.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Frames(Range<u32>);

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Frames, String> {
        let (a, b) = text.split_once("..").ok_or("write it as A..B")?;
        let number = |text: &str, default: u32| match text {
            "" => Ok(default),
            text => text.parse().map_err(|_| format!("`{text}` is no frame number")),
        };
        let range = number(a, 0)?..number(b, u32::MAX)?;
        if range.is_empty() { Err("it holds no frame".into()) } else { Ok(Frames(range)) }
    }
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let config = arguments.machine.load()?;
    for warning in config.warnings() {
        eprintln!("warning: {warning}");
    }
    let watch = Arc::new(Watch::default());
    let options = Options {
        config,
        fidelity: match arguments.fidelity {
            FidelityName::Functional => Fidelity::Functional,
            FidelityName::Bound => Fidelity::Bound,
            FidelityName::Sampled => {
                Fidelity::Sampled(Sampling { samples: arguments.samples, seed: arguments.seed, warm_up: arguments.warm_up })
            }
            FidelityName::Cycle => Fidelity::Cycle,
        },
        clock: match arguments.clock {
            ClockName::SkipIdle => Clock::SkipIdle,
            ClockName::EveryCycle => Clock::EveryCycle,
        },
        frames: arguments.frames.0.clone(),
        watch: Some(watch.clone()),
    };
    let trace = arguments.reading.open(&arguments.trace)?;
    let name = arguments.trace.display().to_string();
    let about = About { trace: name, config: options.config.name.clone(), fidelity: options.fidelity.name() };
    let create = |out| Folder::create(out, about, &options.config.resolved());
    let mut folder = arguments.out.as_deref().map(create).transpose()?;
    // What is said of all frames; the frames themselves are kept by nobody.
    let mut seen = Seen::default();
    let mut taker = |frame: Frame| {
        seen.frames += 1;
        seen.phases.add(&frame.phases);
        folder.as_mut().map_or(Ok(()), |folder| folder.put(frame))
    };
    let bar = progress_bar();
    let told = Told::begin(&bar, &watch);
    let done = replay_to(&trace, &options, &|frame| told.frame(frame), &mut taker);
    told.end();
    let done = done?;
    if seen.frames == 0 {
        bail!("the trace has no frame in {}..{}", options.frames.start, options.frames.end);
    }
    if let Some(folder) = folder {
        folder.end(done.total.clone())?;
    }
    print(&done, &seen, &options, arguments)
}

/// What is kept of frames that have left.
#[derive(Default)]
struct Seen {
    frames: usize,
    phases: Phases,
}

/// A spinner on a terminal, nothing elsewhere.
fn progress_bar() -> ProgressBar {
    if !std::io::stderr().is_terminal() {
        return ProgressBar::hidden();
    }
    let style = ProgressStyle::with_template("{spinner} {elapsed} {msg}").unwrap_or_else(|_| ProgressStyle::default_spinner());
    let bar = ProgressBar::new_spinner().with_style(style).with_message("rendering");
    let ticking = bar.clone();
    let tick = move || {
        while !ticking.is_finished() {
            ticking.tick();
            std::thread::sleep(Duration::from_millis(100));
        }
    };
    // Not the library's own ticker: it panics where no thread can be started. Without one the bar moves at the end of each frame.
    let _ = std::thread::Builder::new().name("progress".into()).spawn(tick);
    bar
}

/// What the spinner says: the last frame, and once a limit comes near, the command that runs and how much of the limit is used.
struct Told {
    bar: ProgressBar,
    frame: Arc<Mutex<String>>,
    /// Goes when the replay is over, which the thread that tells waits for.
    over: Sender<()>,
    teller: Option<JoinHandle<()>>,
}

impl Told {
    fn begin(bar: &ProgressBar, watch: &Arc<Watch>) -> Told {
        let (over, end) = channel();
        let frame = Arc::new(Mutex::new(String::from("rendering")));
        let (mine, bar_of, watch) = (frame.clone(), bar.clone(), watch.clone());
        let tell = move || {
            while end.recv_timeout(Duration::from_millis(500)) == Err(RecvTimeoutError::Timeout) {
                let frame = mine.lock().unwrap_or_else(PoisonError::into_inner).clone();
                bar_of.set_message(watch.line().map_or(frame.clone(), |line| format!("{frame}; {line}")));
            }
        };
        // Without a terminal nobody reads it; without a thread to be had it is left out.
        let teller = if bar.is_hidden() { None } else { std::thread::Builder::new().spawn(tell).ok() };
        Told { bar: bar.clone(), frame, over, teller }
    }

    fn frame(&self, frame: u32) {
        let text = format!("frame {frame} done");
        self.bar.set_message(text.clone());
        self.bar.inc(1);
        *self.frame.lock().unwrap_or_else(PoisonError::into_inner) = text;
    }

    fn end(self) {
        drop(self.over);
        // A teller that panicked told nothing more; the replay is not touched by that.
        drop(self.teller.map(JoinHandle::join));
        self.bar.finish_and_clear();
    }
}

fn print(done: &Outcome, seen: &Seen, options: &Options, arguments: &Arguments) -> Result<Verdict> {
    let frames = seen.frames;
    let s = if frames == 1 { "" } else { "s" };
    println!("{} on {}: {frames} frame{s}", arguments.trace.display(), options.config.name);
    print!("\nWhat was drawn, and what was thrown away where\n{}", summary::funnel(&done.total));
    let host = done.machine_time.as_secs_f64();
    let all = done.clock_time.as_secs_f64();
    if options.fidelity == Fidelity::Functional {
        println!(
            "\ncounted, not timed: as on a card that reuses every shaded vertex (docs/fidelity.md)\nhost: {all:.3} s in all"
        );
    } else {
        let number = |path: &str| done.total.number(path).ok_or_else(|| anyhow!("the statistics have no {path}"));
        let (cycles, seconds) = (number("cycles")?, number("seconds")?);
        if !seen.phases.is_empty() {
            print!("\nWhere the cycles went, one phase after another\n{}", seen.phases.text(12));
        }
        if options.fidelity != Fidelity::Bound {
            print!("\nWhat the units did, in shares of the cycles\n{}", summary::units(&done.total));
            print!("\nWhat moved through memory\n{}", summary::memory(&done.total));
            let pipelines = options.config.card.pipelines;
            print!("\nWhat sorting cost\n{}", summary::sorting(&done.total, pipelines));
        }
        if let Some(sampled) = &done.sampled {
            print!("\nWhat is estimated\n{}", summary::sampled(sampled));
        }
        let frames = done.sampled.as_ref().map_or(frames as f64, |sampled| sampled.frames as f64);
        let rate = if seconds > 0.0 { frames / seconds } else { 0.0 };
        println!(
            "\n{} cycles, {rate:.1} frames a second at {} MHz",
            summary::grouped(cycles as u64),
            options.config.card.clock_mhz
        );
        let shaded = done.total.number("funnel.fragments_shaded").unwrap_or(0.0);
        match options.fidelity {
            Fidelity::Bound => {
                println!(
                    "estimated from counts and rates: off by 3 % in the middle, up to 15 % on the baseline, more on short queues (docs/fidelity.md)"
                );
                println!("host: {:.3} ms for the estimates, {all:.3} s in all", 1e3 * host);
            }
            Fidelity::Sampled(_) => {
                println!("host: {host:.2} s in the machine, {all:.2} s in all")
            }
            _ => println!(
                "every cycle of every unit, nothing estimated\n\
                 host: {host:.2} s in the machine ({:.2} million cycles and {:.2} million shaded fragments a second), {all:.2} s in all",
                cycles / host.max(1e-9) / 1e6,
                shaded / host.max(1e-9) / 1e6,
            ),
        }
    }
    if let Some(out) = &arguments.out {
        println!("written to {}", out.display());
    }
    Ok(Verdict::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_are_half_open_and_may_leave_out_an_end() {
        assert_eq!("2..4".parse(), Ok(Frames(2..4)));
        assert_eq!("..".parse(), Ok(Frames(0..u32::MAX)));
        assert_eq!("3..".parse(), Ok(Frames(3..u32::MAX)));
        assert!("4..4".parse::<Frames>().is_err());
        assert!("x..4".parse::<Frames>().unwrap_err().contains('x'));
        assert!("4".parse::<Frames>().is_err());
    }
}
