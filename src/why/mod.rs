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
use crate::knob::Setting;
use crate::machine::{Config, FrameReport, Machine};
use crate::num::Cycle;
use crate::render::{self, FrameSet};
use crate::report::order;
use crate::report::verdict::{self, Cause, Draws, Finding, sentence};
use crate::report::waits::{Waited, Waits};
use crate::run::replay::no_frames;
use crate::run::stored_work::{Timing, time_each};
use crate::trace::Trace;
use crate::unit::phase::PhaseKind;
use crate::work::{Funnel, RenderKey};
use evidence::{PhaseCounts, evidence};
use relax::{Relaxation, Resource, relaxations};

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
    /// What was counted in the frames as the machine is.
    pub seen: Counted,
    /// Renderings that were made.
    pub renderings: u64,
}

/// What was counted in the frames as the machine is.
#[derive(Clone, Debug, Default)]
pub struct Counted {
    /// The counts of all draws.
    pub funnel: Funnel,
    /// The phase that takes most cycles, what units wait for in it, and its draws.
    pub phase: String,
    /// What units wait for in it.
    pub waits: Waits,
    /// Its draws.
    pub draws: Draws,
    /// By cause, the draws of which nothing is used for that reason.
    pub concerned: Vec<(Cause, Vec<u32>)>,
}

impl Counted {
    fn of(reports: &[FrameReport], phases: &[PhaseCounts], all: &PhaseCounts) -> Counted {
        let names: Vec<String> = reports
            .iter()
            .flat_map(|frame| &frame.phases)
            .map(|phase| one_line(&phase.phase.to_string()).to_string())
            .collect();
        let most = phases.iter().zip(&names).rev().max_by_key(|(phase, _)| phase.cycles());
        let (funnel, ..) = all.counted();
        let (_, draws, waits) = most.map_or_else(|| all.counted(), |(phase, _)| phase.counted());
        let drawn = || reports.iter().flat_map(|frame| &frame.phases).flat_map(|phase| &phase.draws);
        let concerned = Cause::ALL.map(|cause| {
            (cause, drawn().filter(|draw| cause.is_all_of(&draw.counts.funnel)).filter_map(|draw| draw.number).collect())
        });
        let phase = most.map_or(String::new(), |(_, name)| name.clone());
        Counted { funnel, phase, waits, draws, concerned: concerned.to_vec() }
    }
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

/// The least share of the cycles that a change must save to be named in the verdict.
const WORTH: f64 = 0.02;

/// The share below which twice the room gains nothing.
const LITTLE: f64 = 0.01;

/// Changes of the card that the verdict lists.
const CARD: usize = 4;

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
    let (results, mut renderings) = time(trace, &frames, &machines, &told)?;
    let mut results = results.into_iter();
    let first = results.next().unwrap_or_else(|| Ok(Default::default()));
    let (base, reports) = first.map_err(|error| anyhow!("{error}"))?;
    let Some(report) = reports.first() else { bail!("the trace has {}", no_frames(trace, &frames)?) };
    let machine = evidence::MachineShape::of(config, report);
    let (phases, all_seen): (Vec<PhaseCounts>, PhaseCounts) =
        (reports.iter().flat_map(PhaseCounts::phases).collect(), PhaseCounts::frames(&reports));
    let told = |(relaxation, timed): (Relaxation, Result<Timed, String>)| {
        let place = timed.as_ref().ok().and_then(|timed| most(&base, timed)).map(|(at, ..)| at);
        let seen = place.and_then(|at| phases.get(at)).unwrap_or(&all_seen);
        let evidence = evidence(&relaxation, seen, &machine);
        Gain { relaxation, timed, evidence }
    };
    let mut timed: Vec<Result<Timed, String>> = results.map(|ran| ran.map(|(timed, _)| timed)).collect();
    // Room that gains nothing at twice, of a unit that is held up all the same, is tried at eight times.
    let again = relaxed.iter().zip(&timed).filter(|((own, _), timed)| {
        let little = timed.as_ref().is_ok_and(|timed| gain(base.cycles, timed.cycles) < LITTLE);
        own.resource == Resource::Room && little && all_seen.is_full(bank(own.section))
    });
    let again = again.filter_map(|((own, _), _)| own.eightfold(config));
    let again: Vec<(Relaxation, Config)> = again.filter_map(|own| own.of(config).map(|machine| (own, machine))).collect();
    if !again.is_empty() {
        let machines: Vec<&Config> = again.iter().map(|(_, machine)| machine).collect();
        let (results, own) = time(trace, &frames, &machines, &|| progress(all + again.len()))?;
        timed.extend(results.into_iter().map(|ran| ran.map(|(timed, _)| timed)));
        renderings += own;
    }
    let relaxed = relaxed.into_iter().chain(again).map(|(relaxation, _)| relaxation);
    let mut gains: Vec<Gain> = relaxed.zip(timed).map(told).collect();
    gains.sort_by_key(|gain| rank(base.cycles, gain));
    let seen = Counted::of(&reports, &phases, &all_seen);
    Ok(Diagnosis { base, gains, seen, renderings })
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

impl Diagnosis {
    /// What is wrong with the pictures of machines that keep the order of the trace: the change of each machine, and the message.
    pub fn faults(&self) -> impl Iterator<Item = (&str, &str)> {
        let changed = self.gains.iter().filter_map(|gain| Some((gain.relaxation.title.as_str(), gain.timed.as_ref().ok()?)));
        let all = std::iter::once(("no change", &self.base)).chain(changed);
        all.filter_map(|(change, timed)| Some((change, timed.fault.as_deref()?)))
    }

    /// The best gain among changes of some knobs, from [`WORTH`] on; and whether any was tried.
    fn best(&self, knobs: &[&str]) -> (Option<(&Gain, f64)>, bool) {
        let tried =
            self.gains.iter().filter(|gain| gain.relaxation.changes.iter().any(|(path, _)| knobs.contains(&path.as_str())));
        let shares = tried.clone().filter_map(|gain| Some((gain, gain.share(&self.base)?)));
        let best = shares.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, share)| *share >= WORTH);
        (best, tried.count() > 0)
    }

    /// What the program can do in the frame: causes that were counted, each with what its remedy saves where that was timed. A cause whose remedy saves
    /// nothing is left out.
    pub fn in_the_frame(&self) -> Vec<Finding> {
        let Counted { funnel, concerned, .. } = &self.seen;
        let mut found: Vec<(f64, Finding)> = Vec::new();
        for cause in Cause::ALL {
            let Some(text) = cause.share(funnel).map(|share| cause.text(share)) else { continue };
            let draws = concerned.iter().find(|(known, _)| *known == cause).map_or(Vec::new(), |(_, draws)| draws.clone());
            match self.best(cause.knobs()) {
                (Some((gain, share)), _) => {
                    let sentence = format!("{text}; {} saves {:.0} %", cause.remedy(), 100.0 * share);
                    let (evidence, set) = (gain.evidence.clone(), gain.relaxation.settings().collect());
                    found.push((share, Finding { sentence, evidence, set, draws }));
                }
                (None, true) => {}
                (None, false) => found.push((0.0, Finding { sentence: text, draws, ..Finding::default() })),
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        let mut found: Vec<Finding> = found.into_iter().map(|(_, finding)| finding).collect();
        if let Some((Waited::Indices(unit), share)) = self.seen.waits.longest()
            && let Some(object) = verdict::object(&self.seen.waits, self.seen.draws)
        {
            let sentence = format!("{unit} waits for {object}; fewer and larger draws wait less");
            let evidence = format!("{unit} waits for memory in {:.0} % of the cycles of {}", 100.0 * share, self.seen.phase);
            found.push(Finding { sentence, evidence, ..Finding::default() });
        }
        found
    }

    /// What a card could do, the best first: changes that save 2 % or more, one for each resource.
    pub fn on_the_card(&self) -> Vec<Finding> {
        let in_frame = |gain: &Gain| {
            let path = |(path, _): &(String, Setting)| Cause::ALL.iter().any(|cause| cause.knobs().contains(&path.as_str()));
            gain.relaxation.changes.iter().any(path)
        };
        let mut named: Vec<&Gain> = Vec::new();
        for gain in
            self.gains.iter().filter(|gain| !in_frame(gain) && gain.share(&self.base).is_some_and(|share| share >= WORTH))
        {
            let own = (gain.relaxation.section, gain.relaxation.resource);
            if named.len() < CARD && named.iter().all(|other| (other.relaxation.section, other.relaxation.resource) != own) {
                named.push(gain);
            }
        }
        let told = |gain: &Gain| {
            let share = gain.share(&self.base).unwrap_or(0.0);
            let knob = gain.relaxation.knob().map_or(String::new(), |knob| format!(" (`{knob}`)"));
            let most = gain.most(&self.base).filter(|_| self.base.phases.len() > 1);
            let place = most.map_or(String::new(), |(name, share)| format!(", {:.1} % of {}", 100.0 * share, one_line(name)));
            Finding {
                sentence: format!("{}{knob} saves {:.1} %{place}", gain.relaxation.title, 100.0 * share),
                evidence: gain.evidence.clone(),
                set: gain.relaxation.settings().collect(),
                draws: Vec::new(),
            }
        };
        named.into_iter().map(told).collect()
    }

    /// The answer in a few sentences: cause, size and remedy of what the program can do, and what the rest waits for; else what a card could do.
    pub fn verdict(&self) -> String {
        let proven = self.in_the_frame().into_iter().find(|finding| !finding.set.is_empty());
        let rest = verdict::object(&self.seen.waits, self.seen.draws);
        let mut said = Vec::new();
        said.extend(proven.as_ref().map(|finding| sentence(&finding.sentence)));
        said.extend(rest.map(|object| {
            let who = if proven.is_some() { "the rest" } else { self.seen.phase.as_str() };
            sentence(&format!("{who} waits for {object}"))
        }));
        if proven.is_none() {
            said.extend(self.on_the_card().first().map(|finding| sentence(&finding.sentence)));
        }
        if said.is_empty() { "No change alone saves 2 % or more.".into() } else { said.join(" ") }
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
        let list = |findings: Vec<Finding>| findings.iter().map(Finding::json).collect::<Vec<_>>();
        json!({
            "version": 1,
            "verdict": self.verdict(),
            "in_the_frame": list(self.in_the_frame()),
            "on_the_card": list(self.on_the_card()),
            "cycles": self.base.cycles,
            "phases": phases(&self.base),
            "changes": gains,
        })
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
        let why = |base, gains| Diagnosis { base, gains, seen: Counted::default(), renderings: 1 };
        let sound = why(timed(None), vec![gain(Ok(timed(None))), gain(Err("it stopped".into()))]);
        assert_eq!(sound.faults().count(), 0);
        let faulty = why(timed(Some("here")), vec![gain(Ok(timed(None))), gain(Ok(timed(Some("there"))))]);
        let title = relaxation.title.as_str();
        assert_eq!(faulty.faults().collect::<Vec<_>>(), [("no change", "here"), (title, "there")]);
    }
}
