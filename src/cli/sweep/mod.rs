//! `fillrate sweep`

mod slurm;

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};
use clap::builder::PossibleValuesParser;
use indicatif::ProgressBar;

use crate::cli::Verdict;
use crate::cli::built_in::{Found, named, scene};
use crate::cli::configs::load;
use crate::cli::interrupt::keeps;
use crate::cli::threads::MOST;
use crate::host;
use crate::report::sections::{of_sweep, shown_of_sweep};
use crate::run::replay::frame_range;
use crate::sweep::entry::Keep;
use crate::sweep::experiment::{Design, Experiment, Screen, Screener, Search};
use crate::sweep::folder::{Results, Shard};
use crate::sweep::html;
use crate::sweep::inputs::{Begun, Inputs, begin, begun, differences, hash, hash_path, read_base, read_inputs};
use crate::sweep::outcome::{SweepResult, mean};
use crate::sweep::plan::{MOST_MACHINES, Plan};
use crate::sweep::report;
use crate::sweep::search::halving;
use crate::sweep::table::{Cell, ColumnKind, write};
use crate::sweep::tables;
use crate::sweep::timing::{Screened, Screening, Step, Sweep, Took, run as run_shard};
use crate::trace::Trace;

/// Ask one question of many machines: traces are rendered once, and every machine is timed from that work
#[derive(clap::Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "Examples:\n  fillrate sweep @sort-class --out results\n  \
fillrate sweep traces/torus-knot.zip --vary texture.cache_lines=16..1024*2 --vary sort=all --out results\n  \
fillrate sweep traces/cube --vary card.pipelines=2,4,8 --link card.geometry_units=card.pipelines/2 --out results\n  \
fillrate sweep traces/shadow --let size=4096..65536*2 --vary texture.line_bytes=64..256*2 --link texture.cache_lines=size/texture.line_bytes \
--where \"texture.cache_lines<=1024\" --out results\n\n\
Values: 8,16,32; 1..8; 0..100+25; 16..1024*2; all. Both ends of a range belong to it.\n\n\
Leaves in --out: report.md, report.html, machines.csv (a row for each machine and frame), long.csv (a row for each statistic), both as Parquet, too, \
screen.csv and screen.json with a screen or a search, rung-I-of-N.jsonl with a search, experiment.ron, base.ron, configs/N.ron (the fastest machines), inputs.json (hashes of all inputs) and \
shard-I-of-N.jsonl. `fillrate sweep config DIR N` prints the configuration of any machine. \
A sweep that was killed goes on when the same command is given again."
)]
pub struct Arguments {
    #[command(subcommand)]
    command: Option<Command>,
    /// An experiment (a .ron file, or @NAME for a built-in one), or traces
    #[arg(required = true, value_name = "EXPERIMENT|TRACE")]
    inputs: Vec<PathBuf>,
    /// An axis: a knob and the values that it takes; may be repeated
    #[arg(help_heading = "Machines", long, value_name = "PATH=VALUES")]
    vary: Vec<String>,
    /// A knob that follows from others, with + - * / min(,) max(,); may be repeated
    #[arg(help_heading = "Machines", long, value_name = "PATH=FORMULA")]
    link: Vec<String>,
    /// An axis that is no knob: a name and whole numbers, which links and conditions read; may be repeated
    #[arg(help_heading = "Machines", long = "let", value_name = "NAME=VALUES")]
    variables: Vec<String>,
    /// Leave out the combinations that do not meet this, such as "pipelines*core.per_pipeline<=16"; may be repeated
    #[arg(help_heading = "Machines", long = "where", value_name = "CONDITION")]
    conditions: Vec<String>,
    /// The configuration that is varied: a built-in one, or a file [default: baseline]
    #[arg(help_heading = "Machines", long, value_name = "NAME|FILE")]
    config: Option<String>,
    /// Set one knob of all machines; may be repeated
    #[arg(help_heading = "Machines", long, value_name = "PATH=VALUE")]
    set: Vec<String>,
    /// Which combinations: grid, one-at-a-time, random:MACHINES[:SEED] or latin-hypercube:MACHINES[:SEED] [default: grid]
    #[arg(help_heading = "Machines", long, value_name = "DESIGN")]
    design: Option<DesignName>,
    /// Estimate all machines by `bound`, and simulate this number of the fastest
    #[arg(help_heading = "Machines", long, value_name = "MACHINES", value_parser = clap::value_parser!(u32).range(1..))]
    screen: Option<u32>,
    /// Search the fastest machines: halving:MACHINES estimates all, simulates this number of the fastest on few frames, half of these on twice as
    /// many, and so on, the last four or more on all
    #[arg(help_heading = "Machines", long, value_name = "halving:MACHINES", conflicts_with_all = ["screen", "shard", "slurm"])]
    search: Option<SearchName>,
    /// Where to leave the results
    #[arg(help_heading = "Output", long, value_name = "DIR", required = true)]
    out: Option<PathBuf>,
    /// Print only these sections of the report; several with commas between them
    #[arg(help_heading = "Output", long, value_name = "SECTIONS", value_delimiter = ',', value_parser = PossibleValuesParser::new(of_sweep()), conflicts_with_all = ["shard", "slurm"])]
    show: Vec<String>,
    /// Tell this of machines beside cycles: a formula over statistics, such as caches.texture.misses/caches.texture.accesses; may be repeated
    #[arg(help_heading = "Output", long, value_name = "[NAME=]FORMULA")]
    measure: Vec<String>,
    /// What a machine costs, such as pipelines*core.per_pipeline, or area (bytes of SRAM by a model): the page sets it against cycles [default: bytes
    /// of DRAM traffic]
    #[arg(help_heading = "Output", long, value_name = "FORMULA")]
    cost: Option<String>,
    /// Keep the statistics at this path and below; may be repeated [default: all]
    #[arg(help_heading = "Output", long, value_name = "PATH")]
    keep: Vec<String>,
    /// The question, as the heading of the report
    #[arg(help_heading = "Output", long, value_name = "TEXT")]
    question: Option<String>,
    /// What the traces differ in, where they are one scene that was recorded in several ways, such as "depth order": the report compares them by it
    #[arg(help_heading = "Output", long, value_name = "TEXT")]
    trace_axis: Option<String>,
    /// Frames: one, as in 3, or half-open, as in 2..4, 2.. or ..4 [default: all]
    #[arg(help_heading = "Simulation", long, value_name = "A..B")]
    frames: Option<String>,
    /// Run the I-th of N parts of the machines only; `fillrate sweep merge` puts the parts together
    #[arg(help_heading = "Simulation", long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Run as a job array of Slurm with this number of tasks, and merge when all have ended; --out is a folder that all nodes share
    #[arg(help_heading = "Simulation", long, value_name = "TASKS", conflicts_with = "shard", value_parser = clap::value_parser!(u32).range(1..=100_000))]
    slurm: Option<u32>,
    /// Threads; no result depends on it [default: all processors]
    #[arg(help_heading = "Simulation", long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=i64::from(MOST)))]
    pub threads: Option<u16>,
    /// Run more than a million machines
    #[arg(help_heading = "Simulation", long)]
    yes: bool,
    #[command(flatten, next_help_heading = "Reading the trace")]
    reading: crate::cli::reading::Reading,
}

#[derive(clap::Subcommand)]
enum Command {
    /// Make the tables and the report of a sweep whose shards have all ended, in any order
    Merge {
        /// The folders that the shards were given as --out; the first one takes the tables and the report
        #[arg(required = true)]
        folders: Vec<PathBuf>,
    },
    /// Print the configuration of a machine, complete: `fillrate replay TRACE --config FILE` runs it again
    #[command(
        after_help = "Example:\n  fillrate sweep config results 17 > 17.ron && fillrate replay traces/cube --config 17.ron"
    )]
    Config {
        /// The folder of a sweep
        #[arg(value_name = "DIR")]
        folder: PathBuf,
        /// The machine's number
        machine: u32,
    },
}

#[derive(Clone, Debug, PartialEq)]
struct DesignName(Design);

impl FromStr for DesignName {
    type Err = String;

    fn from_str(text: &str) -> Result<DesignName, String> {
        let mut parts = text.split(':');
        let name = parts.next().unwrap_or_default();
        let number = |text: Option<&str>| match text {
            Some(text) => text.parse().map(Some).map_err(|_| format!("`{text}` is no whole number")),
            None => Ok(None),
        };
        let (machines, seed) = (number(parts.next())?, number(parts.next())?.unwrap_or(1));
        let counted = || {
            let machines = machines.ok_or(format!("say how many machines, as in {name}:100"))?;
            u32::try_from(machines).map_err(|_| "too many machines".to_owned())
        };
        let design = match name {
            "grid" if machines.is_none() => Design::Grid,
            "one-at-a-time" if machines.is_none() => Design::OneAtATime,
            "random" => Design::Random { machines: counted()?, seed },
            "latin-hypercube" => Design::LatinHypercube { machines: counted()?, seed },
            _ => {
                return Err("write it as grid, one-at-a-time, random:MACHINES[:SEED] or latin-hypercube:MACHINES[:SEED]".into());
            }
        };
        if parts.next().is_some() {
            Err("has more than a number of machines and a seed".into())
        } else {
            Ok(DesignName(design))
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct SearchName(Search);

impl FromStr for SearchName {
    type Err = String;

    fn from_str(text: &str) -> Result<SearchName, String> {
        let machines =
            text.strip_prefix("halving:").and_then(|machines| machines.parse().ok()).filter(|&machines| machines > 0);
        machines
            .map(|machines| SearchName(Search::Halving { machines }))
            .ok_or_else(|| "write it as halving:MACHINES, such as halving:32".into())
    }
}

/// Whether a path or name is that of an experiment, and not of a trace.
fn is_experiment(path: &Path) -> bool {
    match named(path) {
        Ok(Some(Found::Experiment(_))) => true,
        Ok(Some(Found::Scene(_))) => false,
        _ => path.extension().is_some_and(|ending| ending == "ron") && path.file_name().is_some_and(|name| name != "trace.ron"),
    }
}

/// The experiment that is asked for, by a file or by options.
fn experiment(arguments: &Arguments) -> Result<Experiment> {
    if let [path] = &*arguments.inputs
        && is_experiment(path)
    {
        let given = [
            ("--config", arguments.config.is_some()),
            ("--set", !arguments.set.is_empty()),
            ("--vary", !arguments.vary.is_empty()),
            ("--link", !arguments.link.is_empty()),
            ("--let", !arguments.variables.is_empty()),
            ("--where", !arguments.conditions.is_empty()),
            ("--design", arguments.design.is_some()),
            ("--screen", arguments.screen.is_some()),
            ("--search", arguments.search.is_some()),
            ("--keep", !arguments.keep.is_empty()),
            ("--measure", !arguments.measure.is_empty()),
            ("--frames", arguments.frames.is_some()),
            ("--question", arguments.question.is_some()),
            ("--cost", arguments.cost.is_some()),
            ("--trace-axis", arguments.trace_axis.is_some()),
        ];
        if let Some((option, _)) = given.into_iter().find(|&(_, given)| given) {
            bail!("{option} is part of the experiment {}: write it there", path.display());
        }
        return match named(path)? {
            Some(Found::Experiment(built_in)) => Experiment::parse(&path.display().to_string(), built_in.text),
            _ => Experiment::open(path),
        };
    }
    if let Some(path) = arguments.inputs.iter().find(|path| is_experiment(path)) {
        bail!("{} is an experiment, which names its traces itself: give it alone", path.display());
    }
    Ok(Experiment {
        question: arguments.question.clone().unwrap_or_default(),
        traces: arguments.inputs.iter().map(|path| path.display().to_string()).collect(),
        trace_axis: arguments.trace_axis.clone().unwrap_or_default(),
        frames: arguments.frames.clone().unwrap_or_else(|| "..".into()),
        base: arguments.config.clone().unwrap_or_else(|| "baseline".into()),
        set: arguments.set.clone(),
        vary: arguments.vary.clone(),
        variables: arguments.variables.clone(),
        link: arguments.link.clone(),
        conditions: arguments.conditions.clone(),
        design: arguments.design.clone().map(|DesignName(design)| design).unwrap_or_default(),
        screen: arguments.screen.map(|keep| Screen { by: Screener::Bound, keep }),
        search: arguments.search.map(|SearchName(search)| search),
        keep: arguments.keep.clone(),
        measures: arguments.measure.clone(),
        cost: arguments.cost.clone().unwrap_or_default(),
    })
}

/// The hash of the program that runs.
fn program() -> Result<String> {
    hash_path(&std::env::current_exe().context("cannot find the program's own file")?)
}

/// How far a sweep is, on a terminal.
fn bar() -> ProgressBar {
    let style = "{spinner} {elapsed} {msg} {pos} of {len}, {eta} left";
    let bar = crate::cli::progress::bar(style);
    bar.set_message("rendering");
    bar
}

fn told(bar: &ProgressBar, step: Step, kept: &(AtomicU64, AtomicU64)) {
    let (done, of) = kept;
    match step {
        Step::Screen(all) => {
            bar.set_length(all);
            bar.set_message("machines estimated:");
        }
        Step::Simulate { all, done: before } => {
            bar.set_length(all);
            bar.set_position(before);
            of.store(all, Ordering::Relaxed);
            done.store(before, Ordering::Relaxed);
            // What an earlier run has done says nothing of this one's speed.
            bar.reset_eta();
            bar.set_message("machines simulated:");
        }
        Step::Done => {
            bar.inc(1);
            done.fetch_add(1, Ordering::Relaxed);
        }
    }
    // A screen leaves nothing.
    let (done, of) = (done.load(Ordering::Relaxed), of.load(Ordering::Relaxed));
    if of > 0 {
        keeps(format!("{done} of {of} machines are kept; the same command goes on"));
    }
}

pub fn run(arguments: &Arguments) -> Result<Verdict> {
    match &arguments.command {
        Some(Command::Merge { folders }) => return merge(folders, &arguments.reading),
        Some(Command::Config { folder, machine }) => return config(folder, *machine),
        None => {}
    }
    let experiment = experiment(arguments)?;
    let out = arguments.out.as_deref().context("--out is missing")?;
    let shard = match (arguments.shard, arguments.slurm) {
        (Some(shard), _) => shard,
        (None, Some(of)) => Shard { index: 1, of },
        (None, None) => Shard::default(),
    };
    let plan = match &*arguments.inputs {
        // What is wrong stands in the file.
        [path] if is_experiment(path) => plan(&experiment, arguments.yes).with_context(|| path.display().to_string())?,
        _ => plan(&experiment, arguments.yes)?,
    };
    let (frames, traces, inputs) = open(&experiment, &plan, shard.of, &arguments.reading)?;
    let complete = verdict(&traces);
    begin(out, &inputs, &plan.base().resolved())?;
    if let Some((count, rule)) = plan.broken() {
        eprintln!(
            "note: {count} of {} machines break a rule between knobs and cannot be run, the first because: {rule}; --link lets one knob follow another",
            plan.len()
        );
    }
    if let Some(tasks) = arguments.slurm {
        return Ok(slurm::submit(out, tasks, &arguments.reading.options(), arguments.yes)?.and(complete));
    }

    let started = Instant::now();
    let bar = bar();
    let kept = Default::default();
    let progress = |step| told(&bar, step, &kept);
    let keep = Keep::new(&experiment.keep);
    let sweep = Sweep { plan: &plan, traces: &traces, frames, first: None, keep, shard, progress: &progress };
    let (screening, on_rungs) = match (&experiment.screen, experiment.search) {
        (Some(screen), _) => (Some(sweep.screened(screen.keep)?), Took::default()),
        (None, Some(Search::Halving { .. })) if shard.of > 1 => {
            bail!("a search is run in one part: which machines it simulates depends on all results before")
        }
        (None, Some(Search::Halving { machines })) => {
            let (screening, took) = halving(out, &sweep, machines)?;
            (Some(screening), took)
        }
        (None, None) => (None, Took::default()),
    };
    let chosen_time = started.elapsed();
    let took = run_shard(out, &sweep, screening.as_ref())?;
    bar.finish_and_clear();
    match took {
        _ if !arguments.show.is_empty() => {}
        None => tell!("nothing is left to simulate: {} is complete", shard.file(out).display()),
        Some(took) => {
            let s = |count: u64| if count == 1 { "" } else { "s" };
            let time = started.elapsed() - if experiment.screen.is_some() { chosen_time } else { Default::default() };
            let (seconds, took) = (time.as_secs_f64(), took.and(on_rungs));
            tell!(
                "{} machine{} simulated in {seconds:.1} s ({:.1} per minute), {} rendering{}, at most {} of work kept",
                took.machines,
                s(took.machines),
                60.0 * took.machines as f64 / seconds.max(1e-9),
                took.renderings,
                s(took.renderings),
                crate::report::summary::bytes(took.kept_bytes as f64)
            );
            if experiment.screen.is_some() {
                tell!("{} machines estimated in {:.1} s", plan.len(), chosen_time.as_secs_f64());
            }
        }
    }
    if shard.of > 1 {
        tell!("shard {} of {}; when all have ended: fillrate sweep merge {}", shard.index, shard.of, out.display());
        return Ok(complete);
    }
    let results = Results::open(&[out.to_owned()], 1)?;
    Ok(finish(out, results, &inputs, &plan, screening.as_ref(), &arguments.show)?.and(complete))
}

/// The machines of an experiment.
fn plan(experiment: &Experiment, yes: bool) -> Result<Plan> {
    let base = load(&experiment.base, &experiment.set)?;
    if experiment.traces.is_empty() {
        bail!("the experiment names no trace");
    }
    Plan::new(base, experiment, if yes { u64::from(u32::MAX) } else { MOST_MACHINES })
}

/// A trace with its name.
type Named = (String, Trace);

/// The traces of an experiment, and what it is made from.
fn open(
    experiment: &Experiment,
    plan: &Plan,
    shards: u32,
    reading: &crate::cli::reading::Reading,
) -> Result<(Range<u32>, Vec<Named>, Inputs)> {
    let frames = frame_range(&experiment.frames).map_err(|reason| anyhow::anyhow!("frames {}: {reason}", experiment.frames))?;
    let (mut traces, mut hashes) = (Vec::new(), Vec::new());
    for name in &experiment.traces {
        let path = Path::new(name);
        traces.push((name.clone(), reading.open(path)?));
        hashes.push(match scene(path)? {
            Some(scene) => hash(&scene.archive()?),
            None => hash_path(path)?,
        });
    }
    let inputs = Inputs {
        fillrate: env!("CARGO_PKG_VERSION").into(),
        program: program()?,
        experiment: experiment.clone(),
        base: hash(plan.base().resolved().as_bytes()),
        traces: hashes,
        machines: plan.len(),
        shards,
    };
    Ok((frames, traces, inputs))
}

/// How a sweep of these traces ends at best.
fn verdict(traces: &[Named]) -> Verdict {
    traces.iter().fold(Verdict::Done, |sum, (_, trace)| sum.and(crate::cli::reading::verdict(trace)))
}

/// Puts shards together.
fn merge(folders: &[PathBuf], reading: &crate::cli::reading::Reading) -> Result<Verdict> {
    let folder = folders.first().context("no folder is given")?;
    let (inputs, plan) = begun(folder)?;
    let base = plan.base().resolved();
    for other in &folders[1..] {
        let (others, others_base) = (read_inputs(other)?, read_base(other)?);
        let (first, second) = (Begun { inputs: &inputs, base: &base }, Begun { inputs: &others, base: &others_base });
        let (one, two) = (format!("in {}", folder.display()), format!("in {}", other.display()));
        let found = differences(&first, &second, [&one, &two])?;
        if !found.is_empty() {
            bail!("these are folders of different sweeps: {}; give the folders of one", found.join("; "));
        }
    }
    // All shards have ended before anything is rendered.
    let results = Results::open(folders, inputs.shards)?;
    let mut complete = Verdict::Done;
    let screening = match &inputs.experiment.screen {
        // A search is not run in parts: what it chose stands in the folder.
        None => Screening::read(folder)?,
        Some(screen) => {
            let (frames, traces, now) = open(&inputs.experiment, &plan, inputs.shards, reading)?;
            complete = verdict(&traces);
            if now != inputs {
                bail!("the traces or the program are others than when {} was begun", folder.display());
            }
            let keep = Keep::default();
            let shard = Shard::default();
            let sweep = Sweep { plan: &plan, traces: &traces, frames, first: None, keep, shard, progress: &|_| () };
            Some(sweep.screened(screen.keep)?)
        }
    };
    Ok(finish(folder, results, &inputs, &plan, screening.as_ref(), &[])?.and(complete))
}

/// Prints the configuration of a machine.
fn config(folder: &Path, machine: u32) -> Result<Verdict> {
    let (_, plan) = begun(folder)?;
    if machine >= plan.len() {
        bail!("{} has no machine {machine}; it has {}, numbered from 0", folder.display(), plan.len());
    }
    let config = plan.machine(machine)?.config.map_err(|rule| anyhow::anyhow!("machine {machine} cannot be built: {rule}"))?;
    print!("{}", config.resolved());
    Ok(Verdict::Done)
}

/// Writes the configurations of the machines that the page lists.
fn configurations(folder: &Path, plan: &Plan, sweep: &SweepResult<'_>) -> Result<()> {
    let place = folder.join("configs");
    std::fs::create_dir_all(&place).with_context(|| format!("cannot create {}", place.display()))?;
    for (machine, _) in sweep.timed().take(report::LISTED) {
        let path = place.join(format!("{}.ron", machine.number));
        // A machine with a result is one that could be made.
        if let Ok(config) = plan.machine(machine.number)?.config {
            host::write_file(&path, config.resolved().as_bytes())
                .with_context(|| format!("cannot write {}", path.display()))?;
        }
    }
    Ok(())
}

/// Makes the tables and the page from the results of all shards. Prints these sections of the page; none: all of it.
fn finish(
    folder: &Path,
    mut results: Results,
    inputs: &Inputs,
    plan: &Plan,
    screening: Option<&Screening>,
    show: &[String],
) -> Result<Verdict> {
    let chosen = |machine: &u32| screening.is_none_or(|screening| screening.keeps(*machine));
    let traces = inputs.experiment.traces.len();
    let wanted = (0..plan.len()).filter(chosen).count() * traces;
    let pairs = (0..traces as u32).flat_map(|trace| (0..plan.len()).filter(chosen).map(move |machine| (trace, machine)));
    if let Some((trace, machine)) = results.missing(pairs) {
        let shard = Shard { index: machine % inputs.shards + 1, of: inputs.shards };
        bail!(
            "{} has no result of machine {machine} on trace {trace}: shards disagree; remove {} and run it again with --shard {}/{}",
            folder.display(),
            shard.file(folder).display(),
            shard.index,
            shard.of
        );
    }
    if results.len() != wanted {
        bail!(
            "{} has {} results, and the experiment {wanted}: shards disagree; merge only folders of this sweep",
            folder.display(),
            results.len()
        );
    }
    tables::all(folder, inputs, plan, &mut results)?;
    if let Some(screening) = screening {
        screen_table(folder, plan, screening)?;
        screening.write(folder)?;
    }
    let mut sweep = SweepResult::read(inputs, plan, &mut results)?;
    if let Some(screening) = screening {
        sweep = sweep.screened(plan, screening)?;
    }
    configurations(folder, plan, &sweep)?;
    let page = report::page(&sweep, plan, screening);
    for (name, text) in [(report::REPORT, &page), ("report.html", &html::page(&sweep))] {
        let path = folder.join(name);
        host::write_file(&path, host::printable(text).as_bytes())
            .with_context(|| format!("cannot write {}", path.display()))?;
    }
    if show.is_empty() {
        tell!("\n{}\nwritten to {}", page, folder.display());
    } else {
        print!("{}", shown_of_sweep(&page, show).map_err(|reason| anyhow!("--show: {reason}"))?);
    }
    let faults: Vec<(u32, &String)> = sweep.machines.iter().filter_map(|own| Some((own.number, own.fault.as_ref()?))).collect();
    for (machine, fault) in &faults {
        eprintln!("error: machine {machine}: {fault}");
    }
    let failed = sweep.failed().count();
    if failed > 0 {
        eprintln!(
            "error: {failed} of {} machines have no result: see the end of {}",
            sweep.machines.len(),
            folder.join("report.md").display()
        );
    }
    Ok(if faults.is_empty() && failed == 0 { Verdict::Done } else { Verdict::Failed })
}

/// Writes what the screen found.
fn screen_table(folder: &Path, plan: &Plan, screening: &Screening) -> Result<()> {
    let mut columns = vec![("machine".to_owned(), ColumnKind::Whole)];
    columns.extend(tables::parameters(plan)?);
    columns.extend([
        ("cycles".into(), ColumnKind::Number),
        ("simulated".into(), ColumnKind::Text),
        ("error".into(), ColumnKind::Text),
    ]);
    let is_search = screening.frames > 0;
    if is_search {
        columns.push(("rungs".into(), ColumnKind::Whole));
    }
    write(folder, "screen", &columns, |table| {
        for Screened { machine, estimate, kept, rungs } in &screening.machines {
            let mut cells = vec![Cell::Whole((*machine).into())];
            cells.extend(tables::settings(plan, *machine)?);
            let (cycles, error) = match estimate {
                Ok(traces) => (mean(traces.iter().copied()).map_or(Cell::Empty, |mean| Cell::Number(mean.0)), Cell::Empty),
                Err(error) => (Cell::Empty, Cell::Text(error.clone())),
            };
            cells.extend([cycles, Cell::Text(kept.to_string()), error]);
            if is_search {
                cells.push(Cell::Whole((*rungs).into()));
            }
            table.row(&cells)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn searches_are_named() {
        assert_eq!("halving:12".parse(), Ok(SearchName(Search::Halving { machines: 12 })));
        for wrong in ["halving", "halving:", "halving:0", "halving:x", "random:3", ""] {
            assert!(wrong.parse::<SearchName>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn designs_are_named() {
        assert_eq!("random:12".parse(), Ok(DesignName(Design::Random { machines: 12, seed: 1 })));
        assert_eq!("latin-hypercube:12:9".parse(), Ok(DesignName(Design::LatinHypercube { machines: 12, seed: 9 })));
        assert_eq!("grid".parse(), Ok(DesignName(Design::Grid)));
        for wrong in ["random", "random:x", "grid:3", "grit", "random:3:4:5", ""] {
            assert!(wrong.parse::<DesignName>().is_err(), "{wrong}");
        }
    }
}
