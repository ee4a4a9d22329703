//! Running a sweep: each trace is rendered once per render key, machines run side by side on the work that is kept.

use std::collections::HashMap;
use std::path::Path;
use std::sync::{Mutex, PoisonError};

use anyhow::{Context, Result, anyhow, bail};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::entry::{Entry, Keep, Row};
use super::folder::{Done, Journal, Shard};
use super::inputs::hash;
use super::outcome::mean;
use super::plan::{Plan, Planned};
use super::search::Rung;
use crate::host;
use crate::machine::{Config, FrameReport};
use crate::render::{self, FrameSet};
use crate::run::bound::FrameEstimate;
use crate::run::replay::no_frames;
use crate::run::stored_work::{Profiles, Timing, time_each};
use crate::trace::Trace;
use crate::work::RenderKey;

/// Machines that are held at one time while plans are gone through, and that are estimated at one time.
const CHUNK: u32 = 4096;

/// What a sweep runs on.
pub struct Sweep<'s> {
    /// The machines.
    pub plan: &'s Plan,
    /// Traces with their names, in the experiment's order.
    pub traces: &'s [(String, Trace)],
    /// Frames.
    pub frames: std::ops::Range<u32>,
    /// How many of these frames are run, of each trace; none: all.
    pub first: Option<Vec<u32>>,
    /// Statistics that are kept.
    pub keep: Keep,
    /// The machines that are run here.
    pub shard: Shard,
    /// Hears of every machine that is done: how many of how many.
    pub progress: &'s (dyn Fn(Step) + Sync),
}

/// How far a sweep is.
#[derive(Clone, Copy, Debug)]
pub enum Step {
    /// Machines are about to be estimated. The number of estimates: each machine once per trace.
    Screen(u64),
    /// Machines are about to be simulated. An earlier run has done some of them.
    Simulate {
        /// All simulations: each machine once per trace.
        all: u64,
        /// The simulations that an earlier run has done.
        done: u64,
    },
    /// One more is done.
    Done,
}

/// A machine and its estimate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Screened {
    /// Its number.
    pub machine: u32,
    /// Estimated cycles of each trace; or why there is no estimate.
    pub estimate: Result<Vec<f64>, String>,
    /// Whether it is simulated.
    pub kept: bool,
    /// The rungs of a search on which it was simulated, on a part of the frames.
    pub rungs: u32,
}

/// The estimates of all machines of a plan, and which machines were chosen by them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Screening {
    /// The machines, in the order of their numbers.
    pub machines: Vec<Screened>,
    /// The rungs of a search but the last, on which machines are simulated whole; empty after a screen.
    pub rungs: Vec<Rung>,
    /// The frames of all traces; 0 after a screen.
    pub frames: u32,
}

/// The file of a folder that has a screening.
const SCREENING: &str = "screen.json";

/// Bytes of a screening at most: a hundred for each of many millions of machines.
const SCREENING_MAX: u64 = 1 << 32;

impl Screening {
    /// Writes it into the folder of a sweep.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write(&self, folder: &Path) -> Result<()> {
        let path = folder.join(SCREENING);
        host::write_file(&path, &serde_json::to_vec(self)?).with_context(|| format!("cannot write {}", path.display()))
    }

    /// Reads what is in the folder of a sweep; none: it has none, or has not ended.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn read(folder: &Path) -> Result<Option<Screening>> {
        let path = folder.join(SCREENING);
        if !path.exists() {
            return Ok(None);
        }
        let text = host::read_text(&path, SCREENING_MAX).with_context(|| format!("cannot read {}", path.display()))?;
        serde_json::from_str(&text).map(Some).with_context(|| format!("{} has no estimates of machines", path.display()))
    }

    /// Whether a machine was chosen to be simulated whole.
    pub fn keeps(&self, machine: u32) -> bool {
        self.machines[machine as usize].kept
    }
}

/// What a sweep took.
#[derive(Clone, Copy, Debug, Default)]
pub struct Took {
    /// Machines simulated in this run, once per trace.
    pub machines: u64,
    /// Renderings.
    pub renderings: u64,
    /// Most bytes of work kept at one time.
    pub kept_bytes: u64,
}

impl Took {
    /// One run after another.
    pub fn and(self, other: Took) -> Took {
        Took {
            machines: self.machines + other.machines,
            renderings: self.renderings + other.renderings,
            kept_bytes: self.kept_bytes.max(other.kept_bytes),
        }
    }
}

impl Sweep<'_> {
    fn options(&self, trace: usize) -> render::Options {
        let mut frames = self.frames.clone();
        if let Some(first) = &self.first {
            frames.end = frames.end.min(frames.start.saturating_add(first[trace]));
        }
        render::Options { frames: FrameSet::from(frames), ..render::Options::default() }
    }

    /// Estimates all machines: of each, what `read` makes of the estimated cycles of the frames of each trace, or why there is no estimate.
    ///
    /// # Errors
    /// If a trace cannot be rendered, or has no frame in the range.
    pub fn estimates<T: Clone + Send>(&self, read: &(dyn Fn(Vec<f64>) -> T + Sync)) -> Result<Vec<Result<Vec<T>, String>>> {
        (self.progress)(Step::Screen(u64::from(self.plan.len()) * self.traces.len() as u64));
        let mut found: Vec<Result<Vec<T>, String>> = vec![Ok(Vec::new()); self.plan.len() as usize];
        for (at, (name, trace)) in self.traces.iter().enumerate() {
            let mut profiles: HashMap<RenderKey, Profiles> = HashMap::new();
            for begin in (0..self.plan.len()).step_by(CHUNK as usize) {
                let machines = begin..self.plan.len().min(begin + CHUNK);
                let planned: Vec<Planned> = machines.map(|number| self.plan.machine(number)).collect::<Result<_>>()?;
                for config in planned.iter().flat_map(|machine| &machine.config) {
                    let key = config.render_key();
                    if let std::collections::hash_map::Entry::Vacant(place) = profiles.entry(key) {
                        place.insert(Profiles::render(trace, &self.options(at), key)?);
                    }
                }
                let estimate = |machine: &Planned| -> Result<T> {
                    let config = machine.config.as_ref().map_err(|error| anyhow!("{error}"))?;
                    let frames = profiles[&config.render_key()].estimate(config)?;
                    if frames.is_empty() {
                        bail!("{name} has {}", no_frames(trace, &self.frames)?);
                    }
                    (self.progress)(Step::Done);
                    let cycles = |frame: &FrameEstimate| frame.phases.iter().map(|phase| phase.cycles).sum();
                    Ok(read(frames.iter().map(cycles).collect()))
                };
                let estimates: Vec<Result<T>> = planned.par_iter().map(estimate).collect();
                for (machine, estimate) in planned.iter().zip(estimates) {
                    let own = &mut found[machine.number as usize];
                    match (own.as_mut(), estimate) {
                        (Ok(traces), Ok(cycles)) => traces.push(cycles),
                        (Ok(_), Err(error)) => *own = Err(format!("{error:#}")),
                        (Err(_), _) => {}
                    }
                }
            }
        }
        Ok(found)
    }

    /// Estimates all machines and chooses those that are simulated: those with the fewest cycles, and all that there is no estimate of.
    ///
    /// # Errors
    /// As [`Sweep::estimates`].
    pub fn screened(&self, keep: u32) -> Result<Screening> {
        let found = self.estimates(&|frames| frames.iter().sum::<f64>())?;
        let mut order: Vec<(f64, usize)> = Vec::new();
        for (machine, estimate) in found.iter().enumerate() {
            if let Ok(traces) = estimate {
                order.push((mean(traces.iter().copied()).map_or(f64::INFINITY, |mean| mean.0), machine));
            }
        }
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        let mut kept: Vec<bool> = found.iter().map(Result::is_err).collect();
        order.iter().take(keep as usize).for_each(|&(_, machine)| kept[machine] = true);
        let screened = |(machine, (estimate, kept))| Screened { machine: machine as u32, estimate, kept, rungs: 0 };
        let machines = found.into_iter().zip(kept).enumerate().map(screened).collect();
        Ok(Screening { machines, rungs: Vec::new(), frames: 0 })
    }

    /// Runs the machines of the shard that have no result yet, and adds them to its journal. `chosen` says which machines are simulated.
    ///
    /// # Errors
    /// If a trace cannot be rendered or has no frame in the range, or a result cannot be written. What a machine stops on is its result.
    pub fn run(&self, chosen: &(dyn Fn(u32) -> bool + Sync), journal: Journal, done: &Done) -> Result<Took> {
        let own: Vec<u32> = (0..self.plan.len()).filter(|&machine| self.shard.has(machine) && chosen(machine)).collect();
        let traces = (0..self.traces.len()).filter(|&at| self.first.as_ref().is_none_or(|first| first[at] > 0));
        let traces: Vec<u32> = traces.map(|at| at as u32).collect();
        let all = own.len() as u64 * traces.len() as u64;
        (self.progress)(Step::Simulate { all, done: done.len() as u64 });
        let journal = Mutex::new(journal);
        let mut took = Took::default();
        for at in traces {
            let left = own.iter().copied().filter(|&machine| !done.contains(&(at, machine)));
            // Machines by render key, keys in the order in which they come.
            let (mut keys, mut groups): (Vec<RenderKey>, Vec<Vec<(u32, Config)>>) = (Vec::new(), Vec::new());
            for number in left {
                match self.plan.machine(number)?.config {
                    Err(error) => self.add(&journal, &Entry::failed(at, number, String::new(), error))?,
                    Ok(config) => {
                        let key = config.render_key();
                        let group = keys.iter().position(|known| *known == key).unwrap_or_else(|| {
                            keys.push(key);
                            groups.push(Vec::new());
                            keys.len() - 1
                        });
                        groups[group].push((number, config));
                    }
                }
            }
            for group in groups {
                self.group(at, &group, &journal, &mut took)?;
            }
        }
        journal.into_inner().unwrap_or_else(PoisonError::into_inner).end()?;
        Ok(took)
    }

    fn add(&self, journal: &Mutex<Journal>, entry: &Entry) -> Result<()> {
        journal.lock().unwrap_or_else(PoisonError::into_inner).add(entry)?;
        (self.progress)(Step::Done);
        Ok(())
    }

    /// Runs machines of one render key on a trace.
    fn group(&self, at: u32, group: &[(u32, Config)], journal: &Mutex<Journal>, took: &mut Took) -> Result<()> {
        let (name, trace) = &self.traces[at as usize];
        let read = |report: FrameReport| self.keep.row(&report);
        let entry = |number: u32, config: &Config, frames: Result<Vec<(Vec<String>, Row)>>| -> Result<Entry> {
            let config = hash(config.resolved().as_bytes());
            let frames = match frames {
                Err(error) => return Ok(Entry::failed(at, number, config, format!("{error:#}"))),
                Ok(frames) if frames.is_empty() => bail!("{name} has {}", no_frames(trace, &self.frames)?),
                Ok(frames) => frames,
            };
            let paths = frames[0].0.clone();
            Ok(Entry {
                trace: at,
                machine: number,
                config,
                error: None,
                paths,
                frames: frames.into_iter().map(|f| f.1).collect(),
            })
        };
        let machines: Vec<Timing<'_>> = group.iter().map(|(_, config)| Timing { config, per_draw: false }).collect();
        let done = |machine: usize, frames| {
            let (number, config) = &group[machine];
            self.add(journal, &entry(*number, config, frames)?)
        };
        let own = time_each(trace, &self.options(at as usize), &machines, &read, &done)?;
        took.renderings += own.renderings;
        took.machines += group.len() as u64;
        took.kept_bytes = took.kept_bytes.max(own.kept_bytes);
        Ok(())
    }
}

/// Runs a shard of a sweep in a folder; none: it had ended before.
///
/// # Errors
/// As [`Sweep::run`], or if the folder cannot be written.
pub fn run(folder: &Path, sweep: &Sweep<'_>, screening: Option<&Screening>) -> Result<Option<Took>> {
    let Some((journal, done)) = Journal::open(&sweep.shard.file(folder))? else { return Ok(None) };
    let chosen = |machine: u32| screening.is_none_or(|screening| screening.keeps(machine));
    sweep.run(&chosen, journal, &done).map(Some)
}
