//! `fillrate report`

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use clap::builder::PossibleValuesParser;
use serde_json::{Map, Value};

use super::Verdict;
use super::built_in::is_there;
use super::threads::MOST;
use crate::host;
use crate::machine::Config;
use crate::num::Limits;
use crate::picture;
use crate::report::counted::{Chosen, counted};
use crate::report::files::{About, json_head};
use crate::report::folder::REPORT;
use crate::report::groups;
use crate::report::html::data::{CountedSpan, Gather, Statistics};
use crate::report::html::replay::{Input, limits, replay};
use crate::report::html::series::COLUMNS;
use crate::report::html::{self as pages, plots, word};
use crate::report::owned::check_replaceable;
use crate::report::peak::MemoryPeak;
use crate::report::rows::json_frame;
use crate::report::sections::{of_replay, of_sweep, shown_of_replay, shown_of_sweep};
use crate::report::shaders::listings;
use crate::report::state::{DrawState, states};
use crate::run::maps::{FrameDetails, details};
use crate::run::replay::Frame;
use crate::run::shader_cost::shader_costs;
use crate::stats::{Tree, counter};
use crate::sweep::folder::Results;
use crate::sweep::html;
use crate::sweep::inputs::begun;
use crate::sweep::outcome::SweepResult;
use crate::sweep::report::REPORT as SWEEP_REPORT;
use crate::sweep::timing::Screening;
use crate::trace::Trace;
use crate::why::why;
use crate::work::{FUNNEL, Funnel};

/// Make a page of what a replay left, or a sweep: one HTML file with its pictures, tables, plots and numbers
#[derive(clap::Args)]
#[command(after_help = "Examples:\n  fillrate replay traces/torus-knot.zip --out out\n  fillrate report out\n  \
fillrate report out --trace traces/torus-knot.zip --why\n  fillrate report out --plots\n  \
fillrate report out --phase 'pass 0'\n\n\
The page opens from the disk without a network. Of a sweep that runs or was killed it shows the machines that have a result so far. Of a replay with several frames it shows the one that costs most. That frame is rendered once \
more, for heat maps and for what limits each pass: from the trace that the replay names, if it is still there, or from --trace.")]
pub struct Arguments {
    /// What `replay --out` or `sweep --out` left
    dir: PathBuf,
    /// The page [default: report.html in DIR]
    #[arg(help_heading = "Output", long, value_name = "FILE.html")]
    out: Option<PathBuf>,
    /// Make no page: print these sections of the text that the replay or sweep printed, without the host's time; several with commas between them
    #[arg(help_heading = "Output", long, value_name = "SECTIONS", value_delimiter = ',', value_parser = PossibleValuesParser::new([of_replay(), of_sweep()].concat()), conflicts_with_all = ["phase", "draw", "trace", "why", "out", "force", "plots"])]
    show: Vec<String>,
    /// Make no page: print all that was counted in a phase (funnel, cycles of units, caches, bytes by client), named as `replay` names it:
    /// `pass 0`, `scan-out`; `all`: in each phase
    #[arg(help_heading = "Output", long, value_name = "NAME", conflicts_with_all = ["trace", "why", "out", "force", "plots"])]
    phase: Option<String>,
    /// The same of a draw, by its number, of a replay with --per-draw; and its state, if the trace is there
    #[arg(help_heading = "Output", long, value_name = "N", conflicts_with_all = ["phase", "why", "out", "force", "plots"])]
    draw: Option<u32>,
    /// Make no page: print the debug groups of a replay with --per-draw as a tree, with the draws, cycles, fragments and bytes of each
    #[arg(help_heading = "Output", long, conflicts_with_all = ["phase", "draw", "trace", "why", "out", "force", "plots"])]
    groups: bool,
    /// With --phase, --draw or --groups: of this frame [default: the one that costs most]
    #[arg(help_heading = "Output", long, value_name = "N")]
    frame: Option<u32>,
    /// Leave the plots as SVG in DIR/plots, too
    #[arg(help_heading = "Output", long)]
    plots: bool,
    /// Replace a file that is no page of fillrate
    #[arg(help_heading = "Output", long)]
    force: bool,
    /// Prove what holds the frame back, by timing it on some 60 machines (as `fillrate why` does)
    #[arg(help_heading = "Simulation", long)]
    why: bool,
    /// Threads; no result depends on it [default: all processors]
    #[arg(help_heading = "Simulation", long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
    /// The trace of the replay [default: the one that its statistics name, if it is there]
    #[arg(help_heading = "Reading the trace", long, value_name = "TRACE")]
    trace: Option<PathBuf>,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: super::reading::Reading,
}

/// Bytes of statistics that are read at most: hours of frames.
const STATISTICS_MAX: u64 = 1 << 30;

/// Bytes of a configuration at most.
const CONFIG_MAX: u64 = 256 << 10;

/// Bytes of a picture at most.
const PICTURE_MAX: u64 = 64 << 20;

/// The command that was given, as a shell takes it.
pub fn given() -> String {
    let words = std::env::args().skip(1).map(|argument| word(&argument));
    std::iter::once("fillrate".to_owned()).chain(words).collect::<Vec<_>>().join(" ")
}

/// Takes the frames of a replay for its page: one of them is held.
#[derive(Default)]
pub struct Gathering {
    frames: Gather,
    picture: Option<Vec<u8>>,
}

impl Gathering {
    /// A frame has ended.
    ///
    /// # Errors
    /// If its picture cannot be made.
    pub fn add(&mut self, frame: &Frame) -> Result<()> {
        let json: Value = serde_json::from_str(&json_frame(frame, true)?)?;
        if !self.frames.add(json) {
            return Ok(());
        }
        self.picture = None;
        if let Some((surface, bytes)) = &frame.shown {
            let image = picture::colors(surface, bytes).map_err(|reason| anyhow!("frame {}: {reason}", frame.number))?;
            self.picture = Some(picture::png(&image)?);
        }
        Ok(())
    }

    /// The replay has ended.
    ///
    /// # Errors
    /// If its statistics cannot be written as JSON.
    pub fn end(self, about: &About, total: &Tree) -> Result<(Statistics, Option<Vec<u8>>)> {
        let mut head: Map<String, Value> = serde_json::from_str(&format!("{}]}}", json_head(about, total)?))?;
        head.shift_remove("frames");
        Ok((self.frames.end(head), self.picture))
    }
}

/// What a page is about.
pub struct Subject {
    /// The statistics.
    pub statistics: Statistics,
    /// The picture of the frame that is shown, as PNG.
    pub picture: Option<Vec<u8>>,
    /// The machine.
    pub config: Option<Config>,
    /// The command.
    pub command: Option<String>,
}

/// Reads the statistics in a folder that a replay left; `frame` is the one that is kept whole, none the one that costs most.
fn statistics(folder: &Path, frame: Option<u32>) -> Result<Statistics> {
    let path = folder.join("stats.json");
    let name = path.display();
    let text = host::read_text(&path, STATISTICS_MAX)
        .with_context(|| format!("{} is no folder of a replay or a sweep: cannot read {name}", folder.display()))?;
    Statistics::parse(&text, frame).map_err(|reason| anyhow!("{name} {reason}"))
}

/// Reads the machine that a replay left in a folder; none if it is not there.
fn config(folder: &Path) -> Result<Option<Config>> {
    let path = folder.join("config.ron");
    if !path.exists() {
        return Ok(None);
    }
    let name = path.display().to_string();
    let text = host::read_text(&path, CONFIG_MAX).with_context(|| format!("cannot read {name}"))?;
    Ok(Some(Config::parse(&name, &text)?))
}

impl Subject {
    /// Reads what a replay left in a folder.
    fn open(folder: &Path, limits: &Limits) -> Result<Subject> {
        let statistics = statistics(folder, None)?;
        let path = folder.join(format!("frame-{:04}.png", statistics.number()));
        let picture = path.exists().then(|| png(&path, limits));
        Ok(Subject { statistics, picture: picture.transpose()?, config: config(folder)?, command: None })
    }

    /// Renders the frame again, if there is a trace.
    fn details(&self, trace: Option<&Trace>) -> Result<Option<FrameDetails>> {
        let (Some(trace), Some(config)) = (trace, &self.config) else { return Ok(None) };
        let number = self.statistics.number();
        let mut details = details(trace, config, number, self.statistics.text("fidelity") == "cycle")?;
        let primitives = FUNNEL.counter(counter!(Funnel, primitives_in)).sum(&self.statistics.frame().counts);
        let here = details.maps.funnel.primitives_in as f64;
        if let Some(there) = primitives.filter(|&there| there != here) {
            bail!(
                "{} is not the trace of these statistics: its frame {number} has {here} primitives, and theirs {there}",
                trace.file().display(),
            );
        }
        if let Some(timeline) = &mut details.timeline {
            timeline.reduce(COLUMNS);
        }
        Ok(Some(details))
    }

    /// The states of the draws that were reported, if there is a trace.
    fn states(&self, trace: Option<&Trace>) -> Result<BTreeMap<u32, DrawState>> {
        let draws = self.statistics.frame().parts.iter().flat_map(|phase| &phase.parts);
        let numbers: BTreeSet<u32> = draws.filter_map(|draw| u32::try_from(draw.number?).ok()).collect();
        match trace.filter(|_| !numbers.is_empty()) {
            Some(trace) => Ok(states(trace, &numbers)?),
            None => Ok(BTreeMap::new()),
        }
    }

    /// Times the frame on other machines.
    fn why(&self, trace: &Trace) -> Result<Option<Value>> {
        let Some(config) = &self.config else { return Ok(None) };
        let bar = super::progress::bar("{spinner} {elapsed} machines timed: {pos} of {len}, {eta} left");
        let told = |all| {
            bar.set_length(all as u64);
            bar.inc(1);
        };
        let number = self.statistics.number();
        let found = why(trace, config, number..number + 1, false, &told)?;
        bar.finish_and_clear();
        Ok(Some(found.json()))
    }

    /// Writes the page.
    ///
    /// # Errors
    /// If the trace cannot be rendered, or the page cannot be written.
    pub fn write(&self, path: &Path, trace: Option<&Trace>, prove: bool) -> Result<()> {
        let details = self.details(trace)?;
        let shaders = match trace {
            Some(trace) => listings(trace, &shader_costs(trace, self.statistics.number())?)?,
            None => Vec::new(),
        };
        let states = self.states(trace).unwrap_or_else(|reason| {
            eprintln!("note: the page has no states of draws: {reason:#}");
            BTreeMap::new()
        });
        let why = trace.filter(|_| prove).map(|trace| self.why(trace)).transpose()?.flatten();
        let limits = details.as_ref().and_then(|details| details.estimate.as_ref()).map(limits).unwrap_or_default();
        let page = replay(&Input {
            statistics: &self.statistics,
            config: self.config.as_ref(),
            picture: self.picture.as_deref(),
            command: self.command.as_deref(),
            limits: &limits,
            why: why.as_ref(),
            states: &states,
            shaders: &shaders,
            maps: details.as_ref().map(|details| &details.maps),
            targets: details.as_ref().map(|details| &details.targets),
            timeline: details.as_ref().and_then(|details| details.timeline.as_ref()),
        });
        host::write_file(path, page.as_bytes()).with_context(|| format!("cannot write {}", path.display()))
    }
}

/// A picture of a replay, without alpha: the page has a background of its own.
fn png(path: &Path, limits: &Limits) -> Result<Vec<u8>> {
    let name = path.display();
    let read = || format!("cannot read {name}");
    let mut bytes = Vec::new();
    let file = host::open(path, host::Links::Follow).with_context(read)?;
    std::io::Read::read_to_end(&mut std::io::Read::take(file, PICTURE_MAX), &mut bytes).with_context(read)?;
    let image = picture::read_png(&bytes, limits).with_context(|| format!("{name} is no picture of a replay"))?;
    Ok(picture::png(&image.into_rgb8())?)
}

/// Writes plots as files.
fn write_plots(folder: &Path, plots: &[(String, String)]) -> Result<()> {
    let folder = folder.join("plots");
    std::fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for (name, svg) in plots {
        let path = folder.join(format!("{name}.svg"));
        host::write_file(&path, host::printable(svg).as_bytes()).with_context(|| format!("cannot write {}", path.display()))?;
    }
    tell!("{} plots written to {}", plots.len(), folder.display());
    Ok(())
}

/// The page of a sweep whose shards have ended and stand in one folder.
fn sweep(arguments: &Arguments, out: &Path) -> Result<Verdict> {
    if arguments.trace.is_some() {
        bail!("--trace applies to a replay only, and {} is of a sweep", arguments.dir.display());
    }
    let folder = &arguments.dir;
    let (inputs, plan) = begun(folder)?;
    let (mut results, ended) = Results::so_far(folder, inputs.shards)?;
    let sweep = SweepResult::read(&inputs, &plan, &mut results)?;
    let mut sweep = if ended { sweep } else { sweep.unfinished() };
    // Effects of axes come from all estimates, as on the page that the sweep leaves.
    if let Some(screening) = Screening::read(folder)?.filter(|_| ended) {
        if screening.machines.len() != plan.len() as usize {
            bail!("{} has the estimates of other machines: run the sweep again", folder.display());
        }
        sweep = sweep.screened(&plan, &screening)?;
    }
    host::write_file(out, html::page(&sweep).as_bytes()).with_context(|| format!("cannot write {}", out.display()))?;
    if arguments.plots {
        write_plots(folder, &html::plots(&sweep))?;
    }
    tell!("the page: {}", out.display());
    Ok(Verdict::Done)
}

/// The trace of a replay, read for the same frames as the replay has read it for: so its passes and draws have the same numbers.
fn opened(arguments: &Arguments, statistics: &Statistics, path: &Path) -> Result<Trace> {
    let number = |frame: Option<&CountedSpan>| frame.and_then(|frame| frame.number).unwrap_or(0);
    let frames = statistics.frames();
    arguments.reading.open_frames(path, number(frames.first())..number(frames.last()) + 1)
}

/// Prints the state of a draw, if the trace is there.
fn print_state(arguments: &Arguments, statistics: &Statistics, draw: u32) -> Result<()> {
    let stated = Path::new(statistics.text("trace"));
    let read = |path: &Path| -> Result<String> {
        let found = states(&opened(arguments, statistics, path)?, &BTreeSet::from([draw]))?;
        let state = found.get(&draw).with_context(|| format!("{} has no draw {draw}", path.display()))?;
        Ok(state.text())
    };
    match &arguments.trace {
        Some(path) => print!("{}", read(path)?),
        None if stated.exists() => match read(stated) {
            Ok(text) => print!("{text}"),
            Err(reason) => eprintln!("note: the state of the draw is not known: {reason:#}"),
        },
        None => {
            eprintln!("note: the state of the draw is in the trace, and {} is not there: name it by --trace", stated.display())
        }
    }
    Ok(())
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    let folder = &arguments.dir;
    let out = arguments.out.clone().unwrap_or_else(|| folder.join("report.html"));
    let phase = arguments.phase.clone().map(Chosen::Phase);
    if let Some(chosen) = phase.or(arguments.draw.map(|draw| Chosen::Draw(draw.into()))) {
        if folder.join("inputs.json").exists() {
            bail!("--phase and --draw apply to a replay only, and {} is of a sweep", folder.display());
        }
        let peak = config(folder)?.as_ref().map(MemoryPeak::new);
        let statistics = statistics(folder, arguments.frame)?;
        let text = counted(&statistics, &chosen, peak.as_ref());
        print!("{}", text.map_err(|reason| anyhow!("{}: {reason}", folder.display()))?);
        if let Some(draw) = arguments.draw {
            print_state(arguments, &statistics, draw)?;
        }
        return Ok(Verdict::Done);
    }
    if arguments.groups {
        if folder.join("inputs.json").exists() {
            bail!("--groups applies to a replay only, and {} is of a sweep", folder.display());
        }
        let text = groups::text(&statistics(folder, arguments.frame)?);
        print!("{}", text.map_err(|reason| anyhow!("{}: {reason}", folder.display()))?);
        return Ok(Verdict::Done);
    }
    if !arguments.show.is_empty() {
        let of_sweep = folder.join("inputs.json").exists();
        let path = folder.join(if of_sweep { SWEEP_REPORT } else { REPORT });
        let name = path.display();
        let text = host::read_text(&path, STATISTICS_MAX).with_context(|| {
            format!("{} is no folder of a replay or of a sweep that has ended: cannot read {name}", folder.display())
        })?;
        let shown = if of_sweep { shown_of_sweep } else { shown_of_replay };
        print!("{}", shown(&text, &arguments.show).map_err(|reason| anyhow!("{name}: {reason}"))?);
        return Ok(Verdict::Done);
    }
    if arguments.frame.is_some() {
        bail!("--frame applies to --phase, --draw and --groups only: a page shows the frame that costs most");
    }
    check_replaceable(&out, pages::MARK, arguments.force)?;
    if folder.join("inputs.json").exists() {
        return sweep(arguments, &out);
    }
    let subject = Subject::open(folder, &arguments.reading.limits()?)?;
    if arguments.trace.is_some() && subject.config.is_none() {
        bail!("{} is missing: it says which machine the trace was replayed on", folder.join("config.ron").display());
    }
    let stated = Path::new(subject.statistics.text("trace"));
    let with_trace = |path: &Path| -> Result<Verdict> {
        let trace = opened(arguments, &subject.statistics, path)?;
        subject.write(&out, Some(&trace), arguments.why)?;
        Ok(super::reading::verdict(&trace))
    };
    let without_trace = || subject.write(&out, None, false).map(|()| Verdict::Done);
    let verdict = match &arguments.trace {
        Some(path) => with_trace(path)?,
        None if subject.config.is_some() && is_there(stated) => match with_trace(stated) {
            Ok(verdict) => verdict,
            Err(reason) if arguments.why => return Err(reason),
            Err(reason) => {
                eprintln!("note: the page has no heat maps and no limits of passes: {reason:#}");
                without_trace()?
            }
        },
        None if arguments.why => {
            bail!("--why renders the trace again, and {} is not there: name it by --trace", stated.display());
        }
        None => without_trace()?,
    };
    if arguments.plots {
        write_plots(folder, &plots::replay(&subject.statistics, subject.config.as_ref()))?;
    }
    tell!("the page: {}", out.display());
    Ok(verdict)
}
