//! `fillrate replay`

use std::num::NonZeroU32;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::Arc;
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use clap::builder::PossibleValuesParser;

use super::Verdict;
use super::interrupt::keeps;
use super::progress::ProgressLine;
use super::report::{self, Gathering};
use super::threads::MOST;
use crate::machine::{Config, Watcher};
use crate::render::Watch;
use crate::report::compare::KnobDifference;
use crate::report::files::About;
use crate::report::folder::{Folder, Images};
use crate::report::order::{fault, wrong_pixels};
use crate::report::owned::check_replaceable;
use crate::report::sections::{of_replay, shown_of_replay};
use crate::report::terminal::{self, ReportedFrames};
use crate::report::{html, timeline};
use crate::run::pipeline::{self, PipelineLog, Scope};
use crate::run::replay::{Fidelity, Frame, Options, frame_range, no_frames, replay_pictured, replay_to, replay_watched};
use crate::run::sample::Sampling;
use crate::run::timeline::Timeline;
use crate::sim::Clock;
use crate::trace::{Summary, check};

/// Replay a trace on a configured card: images, statistics, a short report
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate replay traces/torus-knot.zip --out out\n  \
fillrate replay traces/cube --config tiny --set memory.port_latency=400 --clock every-cycle\n  \
fillrate replay recorded/trace --frames 2..4 --fidelity functional --out out\n  \
fillrate replay traces/flight.zip --fidelity sampled --images none --out out\n\n\
Leaves in --out: frame-NNNN.png (the trace's own frame numbers; none with --images none), stats.json, stats.csv (a row for each frame),\npasses.csv (a row for each phase: a pass, a dispatch, transfers or scan-out), draws.csv (a row for each draw, with --per-draw),\nconfig.ron, report.txt (what is printed, without the host's time).\n\
`fillrate report DIR --phase NAME` prints all that was counted in a phase, `--draw N` in a draw.")]
pub struct Arguments {
    /// The trace: a file, or its folder; native or foreign
    trace: PathBuf,
    #[command(flatten, next_help_heading = "Machine")]
    machine: super::configs::Choice,
    /// Where to leave images and statistics. Files that an earlier replay has left there are removed
    #[arg(help_heading = "Output", long, value_name = "DIR")]
    out: Option<PathBuf>,
    /// Where to leave a page that shows the frame that costs most: one HTML file with all that is in it
    #[arg(help_heading = "Output", long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Print only these sections of the report, without the host's time; several with commas between them
    #[arg(help_heading = "Output", long, value_name = "SECTIONS", value_delimiter = ',', value_parser = PossibleValuesParser::new(of_replay()))]
    show: Vec<String>,
    /// Print one JSON document with all that the report says, and all statistics over the frames
    #[arg(help_heading = "Output", long, conflicts_with = "show")]
    json: bool,
    /// Where to leave a timeline of phases, units and channels, for Perfetto (https://ui.perfetto.dev)
    #[arg(help_heading = "Output", long, value_name = "FILE.json")]
    timeline: Option<PathBuf>,
    /// Report every draw of a pass: draws.csv, and draws in stats.json (cycle and sampled)
    #[arg(help_heading = "Output", long)]
    per_draw: bool,
    /// With --report: prove what holds this frame back, by timing it on some 60 machines (as `fillrate why` does)
    #[arg(help_heading = "Output", long, requires = "report")]
    why: bool,
    /// Which pictures to leave in --out [default: all; with --fidelity sampled: simulated]
    #[arg(help_heading = "Output", long, value_enum, requires = "out")]
    images: Option<ImagesName>,
    /// With --timeline: cycles between two readings of the machine [default: as few as 2,000 to 4,000 readings of the run allow]
    #[arg(help_heading = "Output", long, value_name = "CYCLES", requires = "timeline", value_parser = clap::value_parser!(u64).range(1..))]
    timeline_interval: Option<u64>,
    /// Where to leave a log of vertices, primitives, triangles, quads and warps on their way through the units of a sort-middle card, for Konata
    /// (https://github.com/shioyadan/Konata)
    #[arg(help_heading = "Output", long, value_name = "FILE")]
    pipeline: Option<PathBuf>,
    /// With --pipeline: cycles of the run in which items begin that are logged, half-open, as in 1000..2000 [default: all]
    #[arg(help_heading = "Output", long, value_name = "A..B", requires = "pipeline", value_parser = cycle_range)]
    pipeline_cycles: Option<Range<u64>>,
    /// With --pipeline: draws of a frame whose items are logged, by their numbers: one, as in 3, or half-open, as in 2..4 [default: all]
    #[arg(help_heading = "Output", long, value_name = "A..B", requires = "pipeline", value_parser = frame_range)]
    pipeline_draws: Option<Range<u32>>,
    /// Replace files in --out, --report, --timeline and --pipeline that fillrate has not written
    #[arg(help_heading = "Output", long)]
    force: bool,
    /// Frames to replay: one, as in 3, or half-open, as in 2..4, 2.. or ..4
    #[arg(help_heading = "Simulation", long, value_name = "A..B", default_value = "..")]
    frames: Frames,
    /// How much is simulated
    #[arg(help_heading = "Simulation", long, value_enum, default_value = "cycle")]
    fidelity: FidelityName,
    /// With --fidelity sampled: frames that are drawn and simulated beside the first [default: 8]; with bound: frames that are estimated
    /// beside the first, and stand for all [default: all]
    #[arg(help_heading = "Simulation", long, value_name = "N", value_parser = clap::value_parser!(u32).range(2..))]
    samples: Option<u32>,
    /// With --fidelity sampled or bound: simulate or estimate as many frames as the whole replay has time for on this host, as in 60s or 5m;
    /// the interval says what error to expect
    #[arg(help_heading = "Simulation", long, value_name = "TIME", conflicts_with = "samples", value_parser = time)]
    time_limit: Option<Duration>,
    /// With sampled frames: frames before each of these that warm the caches and are not counted [default: 1]
    #[arg(help_heading = "Simulation", long, value_name = "N")]
    warm_up: Option<u32>,
    /// With sampled frames: seed of the sampling generator [default: 1]
    #[arg(help_heading = "Simulation", long, value_name = "N")]
    seed: Option<u64>,
    /// With --fidelity cycle: frames that one machine simulates in a row. Runs of N frames are simulated side by side, each on a machine
    /// that begins behind functional warming with all frames before it. With `all`, one machine simulates all frames [default: 4; all of
    /// up to 16 frames, and where functional warming is not exact]
    #[arg(help_heading = "Simulation", long, value_name = "N|all")]
    frames_per_run: Option<FramesPerRun>,
    /// Threads; no result depends on it [default: all processors]
    #[arg(help_heading = "Simulation", long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
    /// Which clock drives the units; every statistic is the same under both [default: skip-idle]
    #[arg(help_heading = "Simulation", long, value_enum)]
    clock: Option<ClockName>,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: super::reading::Reading,
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
enum ImagesName {
    /// One for each frame
    All,
    /// One for each frame that is simulated; others are not drawn
    Simulated,
    /// No pictures: statistics only
    None,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum ClockName {
    /// Jump over cycles in which nothing can move
    SkipIdle,
    /// Visit every cycle
    EveryCycle,
}

/// Frames that one machine simulates in a row, where nothing else is asked for. The longer the runs, the more work waits for machines side by
/// side; the shorter, the more often a run begins, with caches that time has not touched (docs/data/fidelity.md).
pub(super) const FRAMES_PER_RUN: NonZeroU32 = NonZeroU32::new(4).unwrap();

/// By default one machine simulates all frames of sequences up to this number of frames: that is exact, and soon done.
const FRAMES_OF_ONE_RUN: u32 = 16;

/// A time, as in `90s` or `5m`.
fn time(text: &str) -> Result<Duration, String> {
    let (number, unit) = text.split_at(text.len() - text.chars().last().map_or(0, char::len_utf8));
    let seconds = match unit {
        "s" => 1.0,
        "m" => 60.0,
        "h" => 3600.0,
        _ => return Err("write it with its unit, as in 90s, 5m or 1h".into()),
    };
    let number: f64 = number.parse().map_err(|_| format!("`{number}` is no number"))?;
    match Duration::try_from_secs_f64(number * seconds) {
        Ok(time) if !time.is_zero() => Ok(time),
        _ => Err("it is no time".into()),
    }
}

/// Reads a half-open range of cycles, as in `1000..2000`, `1000..` or `..2000`.
fn cycle_range(text: &str) -> Result<Range<u64>, String> {
    let number = |text: &str, default: u64| match text {
        "" => Ok(default),
        text => text.parse().map_err(|_| format!("`{text}` is no number of a cycle")),
    };
    let (first, end) = text.split_once("..").ok_or("write it as A..B")?;
    let range = number(first, 0)?..number(end, u64::MAX)?;
    if range.is_empty() { Err("it holds no cycle".into()) } else { Ok(range) }
}

/// A half-open range of frames, or one frame.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Frames(Range<u32>);

impl FromStr for Frames {
    type Err = String;

    fn from_str(text: &str) -> Result<Frames, String> {
        frame_range(text).map(Frames)
    }
}

/// Frames in a run, or all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct FramesPerRun(Option<NonZeroU32>);

impl FromStr for FramesPerRun {
    type Err = String;

    fn from_str(text: &str) -> Result<FramesPerRun, String> {
        match text {
            "all" => Ok(FramesPerRun(None)),
            number => match number.parse() {
                Ok(number) => Ok(FramesPerRun(Some(number))),
                Err(_) => Err("write the number of frames, from 1 on, or all".into()),
            },
        }
    }
}

impl Arguments {
    /// How frames are sampled.
    fn sampling(&self) -> Sampling {
        let given = Sampling::default();
        Sampling {
            samples: self.samples.unwrap_or(given.samples),
            seed: self.seed.unwrap_or(given.seed),
            warm_up: self.warm_up.unwrap_or(given.warm_up),
            time_limit: self.time_limit,
        }
    }

    /// A pipeline log at a place.
    fn log(&self, config: &Config, path: &Path) -> Result<PipelineLog> {
        let scope = Scope { cycles: self.pipeline_cycles.clone().unwrap_or(0..u64::MAX), draws: self.pipeline_draws.clone() };
        PipelineLog::new(config, scope, path)
    }
}

/// An option that the fidelity would ignore is an error: a user who gives it expects an effect.
fn refuse_ignored(arguments: &Arguments) -> Result<()> {
    let given = [
        ("--samples", arguments.samples.is_some()),
        ("--time-limit", arguments.time_limit.is_some()),
        ("--warm-up", arguments.warm_up.is_some()),
        ("--seed", arguments.seed.is_some()),
    ];
    match given.into_iter().find(|&(_, given)| given) {
        Some((option, _)) if matches!(arguments.fidelity, FidelityName::Functional | FidelityName::Cycle) => {
            bail!("{option} applies to --fidelity sampled and bound only, and would be ignored here")
        }
        Some((option @ ("--warm-up" | "--seed"), _))
            if matches!(arguments.fidelity, FidelityName::Bound)
                && arguments.samples.is_none()
                && arguments.time_limit.is_none() =>
        {
            bail!("{option} applies to sampled frames only, and would be ignored here: give --samples or --time-limit")
        }
        _ if matches!(
            (&arguments.fidelity, arguments.images),
            (FidelityName::Functional | FidelityName::Bound, Some(ImagesName::Simulated))
        ) =>
        {
            bail!("--images simulated applies to --fidelity sampled and cycle only: no frame is simulated here")
        }
        _ if arguments.per_draw
            && arguments.out.is_none()
            && arguments.report.is_none()
            && arguments.timeline.is_none()
            && !arguments.show.iter().any(|section| section == "draws") =>
        {
            bail!("--per-draw applies to --out, --report, --timeline and --show draws only, and would be ignored here")
        }
        _ if arguments.per_draw && matches!(arguments.fidelity, FidelityName::Functional | FidelityName::Bound) => {
            bail!("--per-draw applies to --fidelity cycle and sampled only, and would be ignored here")
        }
        _ if arguments.timeline.is_some() && !matches!(arguments.fidelity, FidelityName::Cycle) => {
            bail!("--timeline applies to --fidelity cycle only: no other runs one machine through all frames")
        }
        _ if arguments.pipeline.is_some() && !matches!(arguments.fidelity, FidelityName::Cycle) => {
            bail!("--pipeline applies to --fidelity cycle only: no other runs one machine through all frames")
        }
        _ if arguments.pipeline.is_some() && arguments.timeline.is_some() => {
            bail!("--pipeline and --timeline watch one machine each: give one of them at a time")
        }
        _ if arguments.pipeline.is_some() && matches!(arguments.frames_per_run, Some(FramesPerRun(Some(_)))) => {
            bail!("--pipeline watches one machine that simulates all frames: use --frames-per-run all with it")
        }
        _ if arguments.frames_per_run.is_some() && !matches!(arguments.fidelity, FidelityName::Cycle) => {
            bail!("--frames-per-run applies to --fidelity cycle only, and would be ignored here")
        }
        _ if arguments.timeline.is_some() && matches!(arguments.frames_per_run, Some(FramesPerRun(Some(_)))) => {
            bail!("--timeline reads one machine that simulates all frames: use --frames-per-run all with it")
        }
        _ if arguments.clock.is_some() && matches!(arguments.fidelity, FidelityName::Functional | FidelityName::Bound) => {
            bail!("--clock applies to --fidelity cycle and sampled only, and would be ignored here")
        }
        _ => Ok(()),
    }
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    refuse_ignored(arguments)?;
    let marks = [(&arguments.report, html::MARK), (&arguments.timeline, timeline::MARK), (&arguments.pipeline, pipeline::MARK)];
    for (file, mark) in marks {
        file.as_ref().map_or(Ok(()), |file| check_replaceable(file, mark, arguments.force))?;
    }
    let config = arguments.machine.load()?;
    let changed = arguments.machine.changed(&config)?;
    let warnings = config.warnings();
    for warning in &warnings {
        eprintln!("warning: {warning}");
    }
    for KnobDifference { path, a: from, .. } in &changed {
        // Without a machine, a knob matters only if the renderer asks for it.
        let renders_alike = || {
            let mut other = config.clone();
            other.set(&format!("{path}={from}")).is_ok() && other.render_key() == config.render_key()
        };
        let ignored = matches!(arguments.fidelity, FidelityName::Functional) && renders_alike();
        let no_effect = config.no_effect(path).filter(|_| !warnings.iter().any(|warning| warning.starts_with(path)));
        if let Some(reason) = no_effect.or(ignored.then(|| "--fidelity functional simulates no machine".to_owned())) {
            eprintln!("warning: {path} has no effect: {reason}");
        }
    }
    let images = match arguments.images {
        None | Some(ImagesName::All | ImagesName::Simulated) => Images::All,
        Some(ImagesName::None) => Images::None,
    };
    let watch = Arc::new(Watch::default());
    let options = Options {
        config,
        fidelity: match arguments.fidelity {
            FidelityName::Functional => Fidelity::Functional,
            FidelityName::Bound if arguments.samples.is_none() && arguments.time_limit.is_none() => Fidelity::Bound,
            FidelityName::Bound => Fidelity::BoundSampled(arguments.sampling()),
            FidelityName::Sampled => Fidelity::Sampled(arguments.sampling()),
            FidelityName::Cycle => Fidelity::Cycle,
        },
        clock: match arguments.clock {
            None | Some(ClockName::SkipIdle) => Clock::SkipIdle,
            Some(ClockName::EveryCycle) => Clock::EveryCycle,
        },
        frames: arguments.frames.0.clone(),
        watch: Some(watch.clone()),
        per_draw: arguments.per_draw,
        pictures: arguments.report.is_some() || (arguments.out.is_some() && images == Images::All),
        frames_per_run: None,
    };
    let frames = &arguments.frames.0;
    let end = if frames.end == u32::MAX { u64::MAX } else { u64::from(frames.end) };
    let trace = Arc::new(arguments.reading.open_frames(&arguments.trace, u64::from(frames.start)..end)?);
    let opened = trace.origin();
    let in_runs = || {
        let timed = matches!(options.fidelity, Fidelity::Cycle) && arguments.timeline.is_none() && arguments.pipeline.is_none();
        timed && options.no_runs().is_none() && options.more_than(FRAMES_OF_ONE_RUN, &trace)
    };
    let frames_per_run = match arguments.frames_per_run {
        Some(FramesPerRun(given)) => given,
        None => in_runs().then_some(FRAMES_PER_RUN),
    };
    let options = Options { frames_per_run, ..options };
    let name = arguments.trace.display().to_string();
    let about = About {
        trace: name.clone(),
        config: options.config.name.clone(),
        changed: changed.clone(),
        fidelity: options.fidelity.name(),
    };
    let create = |out| Folder::create(out, about.clone(), &options.config.resolved(), images, arguments.force);
    let mut folder = arguments.out.as_deref().map(create).transpose()?;
    // Of sampled frames alone there are statistics; the survey draws the pictures of all, where they are asked for.
    let some = matches!(options.fidelity, Fidelity::Sampled(_) | Fidelity::BoundSampled(_));
    let wanted = some && matches!(arguments.images, Some(ImagesName::All));
    let pictures = folder.as_ref().filter(|_| wanted).map(Folder::pictures);
    // What is said of all frames; no frame is kept.
    let mut seen = ReportedFrames::default();
    let mut timed = timeline::Frames::default();
    let mut recorder =
        arguments.timeline.is_some().then(|| Timeline::new(&options.config, arguments.timeline_interval)).transpose()?;
    let mut log = arguments.pipeline.as_deref().map(|path| arguments.log(&options.config, path)).transpose()?;
    let mut gathering = arguments.report.is_some().then(Gathering::default);
    let mut taker = |frame: Frame| {
        seen.add(&frame);
        if arguments.timeline.is_some() {
            timed.add(&frame);
        }
        gathering.as_mut().map_or(Ok(()), |gathering| gathering.add(&frame))?;
        folder.as_mut().map_or(Ok(()), |folder| folder.put(frame))
    };
    if let (Some(out), Images::All) = (&arguments.out, images) {
        keeps(format!("the pictures of frames that have ended are kept in {}, without statistics", out.display()));
    }
    let line = ProgressLine::begin(&watch, &trace, options.frames.clone());
    let progress = |ended| line.frame(ended);
    let timeline = recorder.as_mut().map(|timeline| timeline as &mut (dyn Watcher + Send));
    let watcher = timeline.or_else(|| log.as_mut().map(|log| log as &mut (dyn Watcher + Send)));
    let done = match (watcher, &pictures) {
        (None, None) => replay_to(&trace, &options, &progress, &mut taker),
        (None, Some(pictures)) => replay_pictured(&trace, &options, &progress, &mut taker, pictures),
        (Some(watcher), _) => replay_watched(&trace, &options, &progress, &mut taker, watcher),
    };
    drop(pictures);
    line.end();
    let done = match done {
        Ok(done) => done,
        Err(error) => {
            return Err(match folder {
                Some(folder) => folder.fail(error),
                None => error,
            });
        }
    };
    arguments.reading.say_at_end(&arguments.trace, &trace, &opened);
    if seen.frames == 0 {
        bail!("the trace has {}", no_frames(&trace, &options.frames)?);
    }
    // Rare, so that the trace is read once more to know.
    let without_picture = if seen.has_picture() { None } else { Some(check(&trace)?) };
    let nothing = without_picture.as_ref().is_some_and(Summary::draws_nothing);
    if nothing && let Some(path) = &arguments.report {
        bail!("{}: the trace draws nothing, so that there is no frame to show in a page", path.display());
    }
    let replayed = done.sampled.as_ref().map_or(seen.frames as u64, |sampled| sampled.frames);
    if options.frames.end != u32::MAX && replayed < options.frames.len() as u64 {
        let last = u64::from(options.frames.start) + replayed - 1;
        eprintln!(
            "warning: the trace ends with frame {last}: --frames {}..{} asks for more",
            options.frames.start, options.frames.end
        );
    }
    let report = match nothing {
        true => format!(
            "{name}: nothing is drawn: the trace has no pass and presents nothing, so that there is no picture and nothing to time\n"
        ),
        false => {
            let mut text = terminal::report(&done, &mut seen, &options, &changed);
            if without_picture.is_some_and(|summary| summary.render_passes == 0 && summary.presented.is_none()) {
                text.push_str("\nthere is no picture: no pass draws, and nothing is presented");
            }
            format!("{name} on {}: {text}\n", options.config.name)
        }
    };
    let told = terminal::without_host(&report);
    if let Some(folder) = folder {
        folder.end(done.total.clone(), done.display.clone(), told.clone())?;
        keeps("pictures and statistics are kept".into());
    }
    if let (Some(path), Some(recorder)) = (&arguments.timeline, &recorder) {
        recorder.check().context("--timeline-interval")?;
        timeline::write(path, &timed, recorder, options.config.card.clock_mhz)?;
    }
    let logged = log.map(PipelineLog::finish).transpose()?;
    if let (Some(path), Some(gathering)) = (&arguments.report, gathering) {
        let (statistics, picture) = gathering.end(&about, &done.total)?;
        let subject =
            report::Subject { statistics, picture, config: Some(options.config.clone()), command: Some(report::given()) };
        subject.write(path, Some(&trace), arguments.why)?;
    }
    if arguments.json {
        let mut document = terminal::json(&done, &mut seen, &options, &about);
        document["draws_nothing"] = nothing.into();
        super::say_json(&document)?;
    } else if arguments.show.is_empty() {
        tell!("{}", report.trim_end());
        written(arguments, recorder.as_ref(), logged);
    } else {
        print!("{}", shown_of_replay(&told, &arguments.show).map_err(|reason| anyhow!("--show: {reason}"))?);
    }
    if let Some(fault) = fault(&options.config, wrong_pixels(&done.total)) {
        eprintln!("error: {fault}");
        return Ok(Verdict::Failed);
    }
    Ok(super::reading::verdict(&trace))
}

/// Names the files that are left.
fn written(arguments: &Arguments, recorder: Option<&Timeline>, logged: Option<u64>) {
    if let Some(out) = &arguments.out {
        tell!("written to {}", out.display());
    }
    if let Some(path) = &arguments.report {
        tell!("the page: {}", path.display());
    }
    if let (Some(path), Some(recorder)) = (&arguments.timeline, recorder) {
        tell!(
            "the timeline: {}, read every {} cycles; open it at https://ui.perfetto.dev",
            path.display(),
            recorder.interval()
        );
    }
    if let (Some(path), Some(items)) = (&arguments.pipeline, logged) {
        tell!("the pipeline log: {}, {items} items; open it with Konata (https://github.com/shioyadan/Konata)", path.display());
    }
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
        assert_eq!("4".parse(), Ok(Frames(4..5)));
        assert!("".parse::<Frames>().is_err());
        assert!("4294967295".parse::<Frames>().is_err());
    }
}
