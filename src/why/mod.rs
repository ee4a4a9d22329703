//! Floor 8: what holds a frame back, proven by what happens without it.
//!
//! A frame is rendered once (once per render key), and timed again on machines that have more of one resource each ([`relax`]). What
//! gains most holds it back. A unit that is busy is no proof: the cycles that it takes may hide behind another's.

pub mod relax;

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use anyhow::{Result, anyhow, bail};
use serde_json::{Value, json};

use crate::machine::{Config, FrameReport, Machine};
use crate::mem::CacheCounts;
use crate::num::Cycle;
use crate::render::{self, FrameSet};
use crate::run::replay::no_frames;
use crate::run::stored_work::time_each;
use crate::stats::{Cycles, Node, Tree};
use crate::trace::Trace;
use crate::work::RenderKey;
use relax::{Relaxation, Resource, relaxations};

/// Cycles of a frame, and of what was done in it one after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timed {
    /// Cycles of all frames.
    pub cycles: Cycle,
    /// Passes, dispatches, transfers and scan-out by their names, in order.
    pub phases: Vec<(String, Cycle)>,
}

/// What a relaxation gains.
#[derive(Clone, Debug)]
pub struct Gain {
    /// The change.
    pub relaxation: Relaxation,
    /// The frame with it; or why the machine stopped.
    pub timed: Result<Timed, String>,
    /// What was seen of the resource without the change, in words.
    pub evidence: String,
}

/// What holds frames of a trace back.
#[derive(Clone, Debug)]
pub struct Why {
    /// The frames as the machine is.
    pub base: Timed,
    /// Relaxations, those that gain most first.
    pub gains: Vec<Gain>,
    /// Renderings that were made.
    pub renderings: u64,
}

impl Gain {
    /// The share of the cycles that the change saves; negative where it costs cycles. None where the machine stopped.
    pub fn share(&self, base: &Timed) -> Option<f64> {
        self.timed.as_ref().ok().map(|timed| gain(base.cycles, timed.cycles))
    }

    /// Whether it is worth naming: a change by 0.05 % or more, or a machine that stopped.
    pub fn matters(&self, base: &Timed) -> bool {
        self.share(base).is_none_or(|share| share.abs() >= 0.0005)
    }

    /// The phase that saves most cycles: its name, and the share that it saves. None where the two machines have different phases.
    pub fn most<'t>(&self, base: &'t Timed) -> Option<(&'t str, f64)> {
        let timed = self.timed.as_ref().ok()?;
        let pairs = pairs(base, timed)?;
        let (name, before, after) = pairs.into_iter().max_by_key(|(_, before, after)| *before as i64 - *after as i64)?;
        Some((name, gain(before, after)))
    }
}

fn gain(before: Cycle, after: Cycle) -> f64 {
    if before == 0 { 0.0 } else { 1.0 - after as f64 / before as f64 }
}

/// Phases of two machines side by side; none where they are not the same phases.
fn pairs<'t>(before: &'t Timed, after: &Timed) -> Option<Vec<(&'t str, Cycle, Cycle)>> {
    let same = before.phases.len() == after.phases.len()
        && before.phases.iter().zip(&after.phases).all(|(before, after)| before.0 == after.0);
    let side = |(before, after): (&'t (String, Cycle), &(String, Cycle))| (before.0.as_str(), before.1, after.1);
    same.then(|| before.phases.iter().zip(&after.phases).map(side).collect())
}

fn add(frames: Vec<(Timed, Tree)>) -> Timed {
    let mut sum = Timed::default();
    for (frame, _) in frames {
        sum.cycles += frame.cycles;
        sum.phases.extend(frame.phases);
    }
    sum
}

/// A frame's cycles, and all its statistics.
type Read = (Timed, Tree);

/// A machine's frames, or why it stopped.
type Ran = Result<Vec<Read>, String>;

/// Times frames on machines, by render key; gives each machine's frames, or why it stopped, and the number of renderings.
fn time(trace: &Trace, frames: &Range<u32>, configs: &[&Config], progress: &(dyn Fn() + Sync)) -> Result<(Vec<Ran>, u64)> {
    let options = render::Options { frames: FrameSet::from(frames.clone()), ..render::Options::default() };
    let read = |frame: FrameReport| {
        let phases = frame.phases.iter().map(|phase| (phase.phase.to_string(), phase.cycles)).collect();
        (Timed { cycles: frame.cycles, phases }, frame.tree)
    };
    let mut keys: Vec<RenderKey> = Vec::new();
    for key in configs.iter().map(|config| config.render_key()) {
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let results: Mutex<Vec<Ran>> = Mutex::new(configs.iter().map(|_| Ok(Vec::new())).collect());
    let mut renderings = 0;
    for key in keys {
        let own: Vec<usize> = (0..configs.len()).filter(|&at| configs[at].render_key() == key).collect();
        let machines: Vec<&Config> = own.iter().map(|&at| configs[at]).collect();
        let done = |at: usize, frames: Result<Vec<Read>>| {
            let frames = frames.map_err(|error| format!("{error:#}"));
            results.lock().unwrap_or_else(PoisonError::into_inner)[own[at]] = frames;
            progress();
            Ok(())
        };
        renderings += time_each(trace, &options, &machines, &read, &done)?.renderings;
    }
    Ok((results.into_inner().unwrap_or_else(PoisonError::into_inner), renderings))
}

/// Finds what holds frames of a trace back on a machine. `progress` hears how many machines are done, of how many.
///
/// # Errors
/// If the trace cannot be rendered, has no frame in the range, or the machine itself stops.
pub fn why(trace: &Trace, config: &Config, frames: Range<u32>, progress: &(dyn Fn(usize) + Sync)) -> Result<Why> {
    let has = |bank: &str| Machine::new(config).is_ok_and(|machine| machine.units().any(|(name, _)| name == bank));
    let relaxed: Vec<(Relaxation, Config)> =
        relaxations(config, &has).into_iter().filter_map(|own| own.of(config).map(|machine| (own, machine))).collect();
    let mut machines = vec![config];
    machines.extend(relaxed.iter().map(|(_, machine)| machine));
    let all = machines.len();
    let told = || progress(all);
    let (results, renderings) = time(trace, &frames, &machines, &told)?;
    let mut results = results.into_iter();
    let base = results.next().unwrap_or_else(|| Ok(Vec::new())).map_err(|error| anyhow!("{error}"))?;
    if base.is_empty() {
        bail!("the trace has {}", no_frames(trace, &frames)?);
    }
    let tree = Tree::weighted(&base.iter().map(|(_, tree)| (1.0, tree)).collect::<Vec<_>>()).banks_summed();
    let base = add(base);
    let mut gains: Vec<Gain> = relaxed
        .into_iter()
        .zip(results)
        .map(|((relaxation, _), timed)| {
            let evidence = evidence(&relaxation, &tree);
            Gain { relaxation, timed: timed.map(add), evidence }
        })
        .collect();
    let rank = |gain: &Gain| gain.timed.as_ref().map_or(Cycle::MAX, |timed| timed.cycles);
    gains.sort_by_key(rank);
    Ok(Why { base, gains, renderings })
}

/// The bank of units of a section.
fn bank(section: &str) -> &str {
    if section == "memory" { "dram" } else { section }
}

/// What was seen of a resource on the machine as it is.
fn evidence(relaxation: &Relaxation, tree: &Tree) -> String {
    let cycles = |unit: &str| tree.group::<Cycles>(&format!("units.{unit}"));
    let share = |unit: &str, of: fn(&Cycles) -> u64| {
        let cycles = cycles(unit);
        100.0 * of(&cycles) as f64 / cycles.total().max(1) as f64
    };
    let unit = bank(relaxation.section);
    match relaxation.resource {
        Resource::Cache => {
            let cache = match relaxation.section {
                "fetch" => "vertex",
                "route" => "position",
                "memory.l2" => "l2",
                own => own,
            };
            let CacheCounts { hits, accesses: all, .. } = tree.group(&format!("caches.{cache}"));
            let share = 100.0 * hits as f64 / all.max(1) as f64;
            if all > 0 { format!("{share:.1} % of {all} lookups hit") } else { String::new() }
        }
        Resource::MemoryLatency => {
            let mut waits: Vec<(&str, f64)> = Vec::new();
            if let Some(Node::Tree(units)) = tree.get("units") {
                waits.extend(units.entries().map(|(name, _)| (name, share(name, |cycles| cycles.memory))));
            }
            waits.sort_by(|a, b| b.1.total_cmp(&a.1));
            let text = |(name, share): &(&str, f64)| format!("{name} {share:.0} %");
            let most: Vec<String> = waits.iter().take(3).filter(|wait| wait.1 >= 1.0).map(text).collect();
            if most.is_empty() { String::new() } else { format!("cycles in which units wait for memory: {}", most.join(", ")) }
        }
        Resource::MemoryBandwidth => {
            let busy = share("dram", |cycles| cycles.busy);
            if busy > 0.0 { format!("dram is busy in {busy:.0} % of the cycles") } else { String::new() }
        }
        Resource::Rate | Resource::Room | Resource::Units if cycles(unit).busy > 0 => format!(
            "{unit}: busy {:.0} %, starved {:.0} %, blocked {:.0} %, waits for memory {:.0} %",
            share(unit, |cycles| cycles.busy),
            share(unit, |cycles| cycles.starved),
            share(unit, |cycles| cycles.blocked),
            share(unit, |cycles| cycles.memory)
        ),
        _ => String::new(),
    }
}

impl Why {
    /// The answer in one sentence; only changes that [`matter`](Gain::matters).
    pub fn verdict(&self) -> String {
        let gains: Vec<&Gain> = self.gains.iter().filter(|gain| gain.matters(&self.base)).collect();
        let told = |gain: &Gain| {
            let share = gain.share(&self.base)?;
            let most = gain.most(&self.base).filter(|_| self.base.phases.len() > 1);
            let place = most.map_or(String::new(), |(name, share)| format!(" (most in {name}: {:+.1} %)", -100.0 * share));
            Some(format!("{} {:+.1} %{place}", gain.relaxation.title, -100.0 * share))
        };
        let mut parts: Vec<String> = gains.iter().take(1).copied().filter_map(told).collect();
        // Beside the first, what is about another resource.
        let first = gains.first().map(|gain| (gain.relaxation.section, gain.relaxation.resource));
        let other = |gain: &&&Gain| Some((gain.relaxation.section, gain.relaxation.resource)) != first;
        parts.extend(gains.iter().skip(1).filter(other).take(2).copied().filter_map(told));
        let cores = gains.iter().skip(1).copied().find(|gain| gain.relaxation.title == "twice the cores");
        if let Some(text) = cores.and_then(told).filter(|text| !parts.contains(text)) {
            parts.push(text);
        }
        if parts.is_empty() { "no change alone gains 0.05 % or more".into() } else { parts.join("; ") }
    }

    /// As JSON.
    pub fn json(&self) -> Value {
        let phases = |timed: &Timed| -> Value {
            timed.phases.iter().map(|(name, cycles)| json!({ "name": name, "cycles": cycles })).collect()
        };
        let gains: Vec<Value> = self
            .gains
            .iter()
            .map(|gain| {
                let changes: serde_json::Map<String, Value> =
                    gain.relaxation.changes.iter().map(|(path, setting)| (path.clone(), json!(setting.to_string()))).collect();
                json!({
                    "change": gain.relaxation.title,
                    "set": changes,
                    "cycles": gain.timed.as_ref().ok().map(|timed| timed.cycles),
                    "gain": gain.share(&self.base),
                    "phases": gain.timed.as_ref().ok().map(phases),
                    "evidence": gain.evidence,
                    "error": gain.timed.as_ref().err(),
                })
            })
            .collect();
        json!({ "version": 1, "cycles": self.base.cycles, "phases": phases(&self.base), "changes": gains })
    }
}
