//! Each knob at the ends of its range: whether estimates of cycles follow what the machine does.
//!
//! On traces, a machine with one knob at an end of its range is compared with the machine that it was made from, with `cycle` and with `bound`. If
//! cycles move by more than [`MOVED`], the estimate has to move the same way, by at least [`SHARE`] of the logarithm of the ratio, or it has to
//! refuse the machine.

use anyhow::{Context, Result};
use serde_json::{Value, json};

use super::harness::on_threads;
use knob::{Allowed, Knob, Setting};
use machine::{Config, Machine};
use run::bound::Bound;
use run::replay::{Fidelity, Options, replay_to};
use trace::Trace;

/// The change of cycles, relative to those before, from which on an estimate has to follow.
pub const MOVED: f64 = 0.05;

/// The part of a change that an estimate has to have, both taken as logarithms of ratios.
pub const SHARE: f64 = 0.25;

/// Knobs that are not varied: a limit that stops runs, and the class, which selects the machine.
const KEPT: [&str; 2] = ["watchdog", "sort"];

/// Steps towards the value before, where an end does not fit the other knobs.
const STEPS: u32 = 24;

/// A machine that differs in one knob from another machine.
#[derive(Clone, Debug)]
pub struct Change {
    /// The knob.
    pub path: String,
    /// Its value.
    pub value: Setting,
    /// Its value before.
    pub before: Setting,
    /// The setting without which the knob has no effect on the given machine, if there is one.
    pub with: Option<String>,
    machine: Config,
    from: Config,
}

/// Cycles of a changed machine on a trace, relative to those of the machine before.
#[derive(Clone, Debug)]
pub struct Moved {
    /// The trace.
    pub trace: String,
    /// The ratio with `cycle`.
    pub cycle: f64,
    /// The ratio with `bound`.
    pub bound: f64,
}

impl Moved {
    /// Whether cycles moved at all.
    pub fn counts(&self) -> bool {
        (self.cycle - 1.0).abs() > MOVED
    }

    /// The part of the change that the estimate has; below zero, it moved the other way.
    pub fn share(&self) -> f64 {
        libm::log(self.bound) / libm::log(self.cycle)
    }
}

/// The result of a change.
#[derive(Clone, Debug)]
pub enum Answer {
    /// Estimates refuse the machine: the message.
    Refused(String),
    /// The machine cannot draw a trace: the message.
    Failed(String),
    /// Ratios on each trace.
    Compared(Vec<Moved>),
}

impl Answer {
    /// The trace on which the estimate follows least, of those on which cycles moved.
    pub fn worst(&self) -> Option<&Moved> {
        let Answer::Compared(moved) = self else { return None };
        moved.iter().filter(|moved| moved.counts()).min_by(|a, b| a.share().total_cmp(&b.share()))
    }

    /// Whether cycles moved on a trace and the estimate did not follow.
    pub fn is_missed(&self) -> bool {
        self.worst().is_some_and(|moved| moved.share() < SHARE)
    }
}

/// Whether a machine can be built.
fn fits(config: &Config) -> bool {
    config.check().is_ok() && Machine::new(config).is_ok()
}

/// The machine with a knob at a value, if that fits.
fn with(config: &Config, path: &str, value: &Setting) -> Option<Config> {
    let mut changed = config.clone();
    changed.put("", path, value).ok()?;
    (fits(&changed) && changed.no_effect(path).is_none()).then_some(changed)
}

/// The values of a knob that is at `before`: ends of its range, or all of a few names.
fn ends(knob: &Knob, before: &Setting) -> Vec<Setting> {
    let all = match knob.allowed {
        Allowed::Range(low, high) | Allowed::PowerOfTwo(low, high) => vec![Setting::Number(low), Setting::Number(high)],
        Allowed::Switch => [true, false].map(Setting::Switch).to_vec(),
        Allowed::Choice(names) => names.iter().map(|&name| Setting::Name(name.to_owned())).collect(),
    };
    all.into_iter().filter(|value| value != before).collect()
}

/// The value between an end and the value before, `step` steps of a factor of two from the end.
fn towards(end: u64, before: u64, step: u32) -> Option<u64> {
    let value = if end < before { end.max(1) << step } else { end >> step };
    (if end < before { value < before } else { value > before }).then_some(value)
}

/// A machine on which a knob has an effect: the given one, or one that differs from it in a switch or a name.
fn where_it_counts(config: &Config, path: &str) -> Option<(Config, Option<String>)> {
    if config.no_effect(path).is_none() {
        return Some((config.clone(), None));
    }
    config.knobs().filter(|(other, _)| other != path).find_map(|(other, knob)| {
        if matches!(knob.allowed, Allowed::Range(..) | Allowed::PowerOfTwo(..)) {
            return None;
        }
        let (_, before) = config.knob("", &other).ok()?;
        ends(knob, &before).into_iter().find_map(|value| {
            let changed = with(config, &other, &value)?;
            changed.no_effect(path).is_none().then(|| (changed, Some(format!("{other}={value}"))))
        })
    })
}

/// Every knob at both ends of its range, or at the values next to them that fit the other knobs; and the knobs that have an effect on no machine
/// that differs from the given one in one switch or name.
pub fn changes(config: &Config) -> (Vec<Change>, Vec<String>) {
    let (mut all, mut idle) = (Vec::new(), Vec::new());
    for (path, knob) in config.knobs().filter(|(path, _)| !KEPT.contains(&path.as_str())) {
        let Some((from, on)) = where_it_counts(config, &path) else {
            idle.push(path);
            continue;
        };
        let Ok((_, before)) = from.knob("", &path) else { continue };
        for end in ends(knob, &before) {
            let found = match (&end, &before) {
                (Setting::Number(end), Setting::Number(before)) => (0..STEPS).find_map(|step| {
                    let value = Setting::Number(towards(*end, *before, step)?);
                    with(&from, &path, &value).map(|machine| (value, machine))
                }),
                _ => with(&from, &path, &end).map(|machine| (end, machine)),
            };
            let Some((value, machine)) = found else { continue };
            let (path, before, on, from) = (path.clone(), before.clone(), on.clone(), from.clone());
            all.push(Change { path, value, before, with: on, machine, from });
        }
    }
    (all, idle)
}

/// Cycles of a machine on a trace.
fn cycles(config: &Config, trace: &Trace, fidelity: Fidelity) -> Result<f64> {
    let options = Options { pictures: false, ..Options::new(config.clone(), fidelity) };
    replay_to(trace, &options, &|_| (), &mut |_| Ok(()))?.cycles.context("no cycles were counted")
}

/// What each change does on traces, with both fidelities.
///
/// # Errors
/// If a machine that is not changed cannot draw a trace.
pub fn compare(changes: Vec<Change>, traces: &[(String, Trace)]) -> Result<Vec<(Change, Answer)>> {
    // Machines before a change are few.
    let mut froms: Vec<&Config> = Vec::new();
    for change in &changes {
        if !froms.contains(&&change.from) {
            froms.push(&change.from);
        }
    }
    let both = |config: &Config, trace: &Trace| -> Result<[f64; 2]> {
        Ok([cycles(config, trace, Fidelity::Cycle)?, cycles(config, trace, Fidelity::Bound)?])
    };
    // Estimates may refuse the machine before the change; then they refuse the one behind it.
    froms.retain(|config| Bound::new(config).is_ok());
    let before = |at: usize| traces.iter().map(|(_, trace)| both(froms[at], trace)).collect::<Result<Vec<[f64; 2]>>>();
    let befores = on_threads(froms.len(), "machine", &before)?;
    let answer = |change: &Change| -> Answer {
        if let Err(error) = Bound::new(&change.machine) {
            return Answer::Refused(error.to_string());
        }
        let Some(at) = froms.iter().position(|config| **config == change.from) else {
            return Answer::Failed("estimates refuse the machine before the change".to_owned());
        };
        let moved = traces.iter().zip(&befores[at]).map(|((name, trace), before)| {
            let [cycle, bound] = both(&change.machine, trace)?;
            Ok(Moved { trace: name.clone(), cycle: cycle / before[0], bound: bound / before[1] })
        });
        moved.collect::<Result<_>>().map_or_else(|error| Answer::Failed(format!("{error:#}")), Answer::Compared)
    };
    let answers = on_threads(changes.len(), "machine", &|at| Ok(answer(&changes[at])))?;
    Ok(changes.into_iter().zip(answers).collect())
}

/// The changes that move cycles, and those that estimates refuse, as a table in Markdown, with a line of sums in front.
pub fn table(found: &[(Change, Answer)], idle: &[String]) -> String {
    let count = |is: fn(&Answer) -> bool| found.iter().filter(|(_, answer)| is(answer)).count();
    let mut out = format!(
        "{} changes: {} move cycles by more than {:.0} % and estimates follow, {} and they do not, {} move them by less, {} are refused, {} \
         fail.\n",
        found.len(),
        count(|answer| answer.worst().is_some() && !answer.is_missed()),
        100.0 * MOVED,
        count(Answer::is_missed),
        count(|answer| matches!(answer, Answer::Compared(_)) && answer.worst().is_none()),
        count(|answer| matches!(answer, Answer::Refused(_))),
        count(|answer| matches!(answer, Answer::Failed(_))),
    );
    if !idle.is_empty() {
        out +=
            &format!("\nWithout an effect: {}.\n", idle.iter().map(|path| format!("`{path}`")).collect::<Vec<_>>().join(", "));
    }
    out += "\n| knob | with | before | value | trace | cycles | estimate | |\n|---|---|--:|--:|---|--:|--:|---|\n";
    for (change, answer) in found {
        let on = change.with.as_ref().map_or(String::new(), |with| format!("`{with}`"));
        let mut row = |trace: &str, cycle: &str, bound: &str, verdict: &str| {
            let Change { path, value, before, .. } = change;
            out += &format!("| `{path}` | {on} | {before} | {value} | {trace} | {cycle} | {bound} | {verdict} |\n");
        };
        match answer {
            Answer::Refused(_) => row("", "", "", "refused"),
            Answer::Failed(why) => row("", "", "", why.lines().next().unwrap_or("failed")),
            Answer::Compared(_) => {
                if let Some(moved) = answer.worst() {
                    let [cycle, bound] = [moved.cycle, moved.bound].map(|ratio| format!("{ratio:.2}"));
                    row(&moved.trace, &cycle, &bound, if answer.is_missed() { "missed" } else { "follows" });
                }
            }
        }
    }
    out
}

/// What was found, as JSON.
pub fn json(found: &[(Change, Answer)], idle: &[String]) -> Value {
    let one = |(change, answer): &(Change, Answer)| {
        let mut value = json!({
            "knob": change.path,
            "with": change.with,
            "before": change.before.to_string(),
            "value": change.value.to_string(),
        });
        let (key, what) = match answer {
            Answer::Refused(why) => ("refused", json!(why)),
            Answer::Failed(why) => ("failed", json!(why)),
            Answer::Compared(moved) => {
                let one = |moved: &Moved| json!({ "trace": moved.trace, "cycle": moved.cycle, "bound": moved.bound });
                ("compared", moved.iter().map(one).collect())
            }
        };
        value[key] = what;
        value
    };
    json!({ "without_effect": idle, "changes": found.iter().map(one).collect::<Vec<_>>() })
}
