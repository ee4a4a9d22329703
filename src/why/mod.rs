//! Floor 8: what holds a frame back, proven by what happens without it.
//!
//! A frame is rendered once (once per render key), and timed again on machines that have more of one resource each ([`relax`]). What
//! gains most holds it back. A unit that is busy is no proof: the cycles that it takes may hide behind another's.

mod evidence;
pub mod relax;

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use anyhow::{Result, anyhow, bail};
use serde_json::{Value, json};

use crate::host::one_line;
use crate::machine::{Config, FrameReport, Machine};
use crate::num::Cycle;
use crate::render::{self, FrameSet};
use crate::report::order;
use crate::run::replay::no_frames;
use crate::run::stored_work::{Timing, time_each};
use crate::trace::Trace;
use crate::unit::phase::PhaseKind;
use crate::work::RenderKey;
use evidence::{PhaseCounts, evidence};
use relax::{Relaxation, relaxations};

/// Cycles of a frame, and of what was done in it one after another.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Timed {
    /// Cycles of all frames.
    pub cycles: Cycle,
    /// Passes, dispatches, transfers and scan-out by their names, in order.
    pub phases: Vec<(String, Cycle)>,
    /// What is wrong with the pictures, although the machine keeps the order of the trace.
    pub fault: Option<String>,
}

/// What a relaxation gains.
#[derive(Clone, Debug)]
pub struct Gain {
    /// The change.
    pub relaxation: Relaxation,
    /// The frame with it; or why the machine stopped.
    pub timed: Result<Timed, String>,
    /// What was seen of the resource without the change, in words: in the phase that saves most, or in all where that is not known.
    pub evidence: String,
}

/// What holds frames of a trace back.
#[derive(Clone, Debug)]
pub struct Diagnosis {
    /// The frames as the machine is.
    pub base: Timed,
    /// Relaxations, those that gain most first; one that gives more of several resources comes behind one of a single resource that gains
    /// half as much.
    pub gains: Vec<Gain>,
    /// Renderings that were made.
    pub renderings: u64,
}

impl Timed {
    /// Cycles of scan-out.
    pub fn scan_out(&self) -> Cycle {
        let name = PhaseKind::ScanOut.name();
        self.phases.iter().filter(|(phase, _)| phase == name).map(|(_, cycles)| cycles).sum()
    }
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
        most(base, self.timed.as_ref().ok()?).map(|(_, name, share)| (name, share))
    }
}

/// The phase that saves most cycles: its place, its name, and the share that it saves.
fn most<'t>(before: &'t Timed, after: &Timed) -> Option<(usize, &'t str, f64)> {
    let pairs = pairs(before, after)?.into_iter().enumerate();
    let (at, (name, before, after)) = pairs.max_by_key(|(_, (_, before, after))| *before as i64 - *after as i64)?;
    Some((at, name, gain(before, after)))
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

/// The cycles of a machine's frames, and of their phases.
fn add(config: &Config, frames: &[FrameReport]) -> Timed {
    let mut sum = Timed::default();
    for frame in frames {
        sum.cycles += frame.cycles;
        sum.phases.extend(frame.phases.iter().map(|phase| (phase.phase.to_string(), phase.cycles)));
    }
    sum.fault = order::fault(config, frames.iter().map(|frame| order::wrong_pixels(&frame.tree)).sum());
    sum
}

/// A machine's time, or why it stopped; of the machine that comes first also its frames, with each draw.
type Ran = Result<(Timed, Vec<FrameReport>), String>;

/// Times frames on machines, by render key; gives what each came to, and the number of renderings.
fn time(trace: &Trace, frames: &Range<u32>, configs: &[&Config], progress: &(dyn Fn() + Sync)) -> Result<(Vec<Ran>, u64)> {
    let options = render::Options { frames: FrameSet::from(frames.clone()), ..render::Options::default() };
    let mut keys: Vec<RenderKey> = Vec::new();
    for key in configs.iter().map(|config| config.render_key()) {
        if !keys.contains(&key) {
            keys.push(key);
        }
    }
    let results: Mutex<Vec<Ran>> = Mutex::new(configs.iter().map(|_| Ok(Default::default())).collect());
    let mut renderings = 0;
    for key in keys {
        let own: Vec<usize> = (0..configs.len()).filter(|&at| configs[at].render_key() == key).collect();
        let machines: Vec<Timing<'_>> = own.iter().map(|&at| Timing { config: configs[at], per_draw: at == 0 }).collect();
        // Pictures are not needed any more.
        let read = |frame: FrameReport| FrameReport { picture: None, ..frame };
        let done = |at: usize, frames: Result<Vec<FrameReport>>| {
            let config = configs[own[at]];
            let kept = |frames: Vec<FrameReport>| (add(config, &frames), if own[at] == 0 { frames } else { Vec::new() });
            let ran = frames.map(kept).map_err(|error| format!("{error:#}"));
            results.lock().unwrap_or_else(PoisonError::into_inner)[own[at]] = ran;
            progress();
            Ok(())
        };
        renderings += time_each(trace, &options, &machines, &read, &done)?.renderings;
    }
    Ok((results.into_inner().unwrap_or_else(PoisonError::into_inner), renderings))
}

/// Finds what holds frames of a trace back on a machine. `progress` hears how many machines are done, of how many. Changes of scan-out are tried
/// with `scan_out` alone: they say nothing of a program, since every frame of its size is read for the screen alike.
///
/// # Errors
/// If the trace cannot be rendered, has no frame in the range, or the machine itself stops.
pub fn why(
    trace: &Trace,
    config: &Config,
    frames: Range<u32>,
    scan_out: bool,
    progress: &(dyn Fn(usize) + Sync),
) -> Result<Diagnosis> {
    let has = |bank: &str| Machine::new(config).is_ok_and(|machine| machine.units().any(|(name, _)| name == bank));
    let relaxed: Vec<(Relaxation, Config)> = relaxations(config, &has)
        .into_iter()
        .filter(|own| scan_out || !own.is_of_scan_out())
        .filter_map(|own| own.of(config).map(|machine| (own, machine)))
        .collect();
    let mut machines = vec![config];
    machines.extend(relaxed.iter().map(|(_, machine)| machine));
    let all = machines.len();
    let told = || progress(all);
    let (results, renderings) = time(trace, &frames, &machines, &told)?;
    let mut results = results.into_iter();
    let first = results.next().unwrap_or_else(|| Ok(Default::default()));
    let (base, reports) = first.map_err(|error| anyhow!("{error}"))?;
    let Some(report) = reports.first() else { bail!("the trace has {}", no_frames(trace, &frames)?) };
    let machine = evidence::MachineShape::of(config, report);
    let (phases, all): (Vec<PhaseCounts>, PhaseCounts) =
        (reports.iter().flat_map(PhaseCounts::phases).collect(), PhaseCounts::frames(&reports));
    let told = |(relaxation, timed): (Relaxation, Result<Timed, String>)| {
        let place = timed.as_ref().ok().and_then(|timed| most(&base, timed)).map(|(at, ..)| at);
        let seen = place.and_then(|at| phases.get(at)).unwrap_or(&all);
        let evidence = evidence(&relaxation, seen, &machine);
        Gain { relaxation, timed, evidence }
    };
    let timed = results.map(|ran| ran.map(|(timed, _)| timed));
    let mut gains: Vec<Gain> = relaxed.into_iter().map(|(relaxation, _)| relaxation).zip(timed).map(told).collect();
    gains.sort_by_key(|gain| rank(base.cycles, gain));
    Ok(Diagnosis { base, gains, renderings })
}

/// The place of a change among all: by its cycles, with half of what it saves taken off where it is [broad](Relaxation::is_broad).
/// Then a change of one resource that gains half as much comes first, since it says what was missing.
fn rank(base: Cycle, gain: &Gain) -> Cycle {
    let Ok(timed) = &gain.timed else { return Cycle::MAX };
    let saved = base.saturating_sub(timed.cycles);
    timed.cycles + if gain.relaxation.is_broad() { saved / 2 } else { 0 }
}

/// The bank of units of a section.
fn bank(section: &str) -> &str {
    if section == "memory" { "dram" } else { section }
}

/// Evidence without what has been told before: all of it, or what stands in brackets.
fn once(evidence: &str, told: &[String]) -> String {
    let known = |text: &str| told.iter().any(|before| before.contains(text));
    match evidence.find(" (").zip(evidence.find(')')) {
        _ if known(evidence) => String::new(),
        Some((from, to)) if known(&evidence[from..=to]) => [&evidence[..from], &evidence[to + 1..]].concat(),
        _ => evidence.to_owned(),
    }
}

impl Diagnosis {
    /// What is wrong with the pictures of machines that keep the order of the trace: the change of each machine, and the message.
    pub fn faults(&self) -> impl Iterator<Item = (&str, &str)> {
        let changed = self.gains.iter().filter_map(|gain| Some((gain.relaxation.title.as_str(), gain.timed.as_ref().ok()?)));
        let all = std::iter::once(("no change", &self.base)).chain(changed);
        all.filter_map(|(change, timed)| Some((change, timed.fault.as_deref()?)))
    }

    /// The answer in one sentence; only changes that [`matter`](Gain::matters). Each has what was seen of its resource without it.
    pub fn verdict(&self) -> String {
        let gains: Vec<&Gain> = self.gains.iter().filter(|gain| gain.matters(&self.base)).collect();
        let told = |gain: &Gain| {
            let share = gain.share(&self.base)?;
            let most = gain.most(&self.base).filter(|_| self.base.phases.len() > 1);
            let place = most.map_or(String::new(), |(name, share)| format!(", in {} {:+.1} %", one_line(name), -100.0 * share));
            let knob = gain.relaxation.knob().map_or(String::new(), |knob| format!(" (`{knob}`)"));
            Some(format!("{}{knob} {:+.1} %{place}", gain.relaxation.title, -100.0 * share))
        };
        // Beside the first, what is about another resource.
        let first = gains.first().map(|gain| (gain.relaxation.section, gain.relaxation.resource));
        let other = |gain: &&Gain| Some((gain.relaxation.section, gain.relaxation.resource)) != first;
        let named: Vec<&Gain> =
            gains.iter().take(1).copied().chain(gains.iter().skip(1).copied().filter(other).take(2)).collect();
        let mut parts: Vec<String> = Vec::new();
        for gain in &named {
            let seen = once(&gain.evidence, &parts);
            let seen = if seen.is_empty() { seen } else { format!(": {seen}") };
            parts.extend(told(gain).map(|text| text + &seen));
        }
        // Whether cores that are busy limit the frame is what most ask.
        let cores = gains.iter().copied().find(|gain| gain.relaxation.title == "twice the cores, each with its texture unit");
        parts.extend(cores.filter(|cores| !named.iter().any(|gain| std::ptr::eq(*gain, *cores))).and_then(told));
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
                    "most_in": gain.most(&self.base).map(|(name, _)| name),
                    "evidence": gain.evidence,
                    "error": gain.timed.as_ref().err(),
                })
            })
            .collect();
        json!({ "version": 1, "cycles": self.base.cycles, "phases": phases(&self.base), "changes": gains })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_named_by_the_change() {
        let config = Config::built_in("tiny").expect("it is built in");
        let relaxation = relaxations(&config, &|_| true).into_iter().next().expect("a change");
        let timed = |fault: Option<&str>| Timed { fault: fault.map(str::to_owned), ..Timed::default() };
        let gain = |timed| Gain { relaxation: relaxation.clone(), timed, evidence: String::new() };
        let why = |base, gains| Diagnosis { base, gains, renderings: 1 };
        let sound = why(timed(None), vec![gain(Ok(timed(None))), gain(Err("it stopped".into()))]);
        assert_eq!(sound.faults().count(), 0);
        let faulty = why(timed(Some("here")), vec![gain(Ok(timed(None))), gain(Ok(timed(Some("there"))))]);
        let title = relaxation.title.as_str();
        assert_eq!(faulty.faults().collect::<Vec<_>>(), [("no change", "here"), (title, "there")]);
    }
}
