//! What came of a sweep, read from its results: machines, what each axis does, by the values of another or by trace, and the Pareto front.

use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};

use super::experiment::Design;
use super::folder::Results;
use super::inputs::Inputs;
use super::link::Formula;
use super::plan::{Axis, Plan, described};
use super::timing::Screened;
use crate::knob::Setting;
use crate::report::order;

/// Statistics that add up to the bytes that DRAM moves.
const DRAM: [&str; 2] = ["memory.dram.read_bytes", "memory.dram.write_bytes"];

/// A machine with its result.
#[derive(Clone, Debug)]
pub struct MachineResult {
    /// Its number in the plan.
    pub number: u32,
    /// Values of the parameters.
    pub settings: Vec<Setting>,
    /// Cycles of all traces and frames; none: it has no result.
    pub cycles: Option<u64>,
    /// Cycles of each trace, in the experiment's order; empty where it has no result.
    pub traces: Vec<u64>,
    /// The experiment's measures, in its order; none where a part of one was not counted on this machine, or is divided by nothing.
    pub measures: Vec<Option<f64>>,
    /// The same of each trace alone; empty where it has no result.
    pub trace_measures: Vec<Vec<Option<f64>>>,
    /// Bytes that DRAM moved; none where the sweep did not keep them.
    pub dram: Option<f64>,
    /// What the experiment says that the machine costs.
    pub cost: Option<u64>,
    /// Why it has no result.
    pub error: Option<String>,
    /// What is wrong with its pictures, although it keeps the order of the trace.
    pub fault: Option<String>,
}

/// What one value of an axis does.
#[derive(Clone, Debug)]
pub struct Response {
    /// The value.
    pub value: Setting,
    /// Geometric mean of the cycles of its machines.
    pub cycles: f64,
    /// How many they are.
    pub machines: usize,
}

/// The machines and traces that a statement is about.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Within<'w> {
    /// All.
    All,
    /// Those whose axis has a value.
    Axis(usize, &'w Setting),
    /// All machines, on one trace.
    Trace(usize),
}

/// What an axis does.
#[derive(Clone, Debug)]
pub struct Effect {
    /// Its place among the axes.
    pub axis: usize,
    /// Its path.
    pub path: String,
    /// Its values, those without a result left out.
    pub responses: Vec<Response>,
    /// How many times the cycles of its best value its worst value takes.
    pub ratio: f64,
}

/// Everything that the page shows.
pub struct SweepResult<'s> {
    /// What it was made from.
    pub inputs: &'s Inputs,
    /// The machines of the plan that were run, those that take fewest cycles first, those without a result last.
    pub machines: Vec<MachineResult>,
    /// All machines of the plan that have an estimate, if a screen has chosen the machines that were run. The effects of axes are derived from
    /// these machines, since only the fastest were run. Their cycles are the estimates.
    pub estimated: Vec<MachineResult>,
    /// Knobs in which they differ.
    pub parameters: Vec<String>,
    /// What is measured of each beside its cycles: names.
    pub measures: Vec<String>,
    /// The axes.
    pub axes: Vec<Axis>,
    /// What the base configuration has at each axis.
    pub base: Vec<Setting>,
    /// Machines of the plan.
    pub planned: u32,
    /// Whether all machines that were to be run have been run.
    pub ended: bool,
    /// Combinations that are no machines, because they do not meet a condition.
    pub excluded: u64,
}

/// A setting without the quotes of names.
pub fn plain(setting: &Setting) -> String {
    match setting {
        Setting::Name(name) => name.clone(),
        other => other.to_string(),
    }
}

/// Geometric mean; none of nothing.
fn mean(values: impl Iterator<Item = u64>) -> Option<(f64, usize)> {
    let logs: Vec<f64> = values.map(|cycles| libm::log((cycles as f64).max(1.0))).collect();
    (!logs.is_empty()).then(|| (libm::exp(logs.iter().sum::<f64>() / logs.len() as f64), logs.len()))
}

/// How many times the cycles of the best response the worst takes.
pub fn ratio(responses: &[Response]) -> f64 {
    let least = responses.iter().map(|own| own.cycles).fold(f64::INFINITY, f64::min);
    let most = responses.iter().map(|own| own.cycles).fold(0.0, f64::max);
    most / least
}

/// What is read of a machine's run on a trace: cycles, and what somebody asks for, by its place among that; none: it was not counted.
struct TraceRun {
    cycles: u64,
    statistics: Vec<Option<f64>>,
}

/// What is read of a machine's results.
#[derive(Default)]
struct Sum {
    traces: BTreeMap<u32, TraceRun>,
    error: Option<String>,
    wrong_pixels: u64,
}

impl Sum {
    /// The sum of a statistic over the traces, which must all have it.
    fn whole(&self, at: usize) -> Option<f64> {
        self.traces.values().map(|part| part.statistics[at]).sum()
    }
}

impl<'s> SweepResult<'s> {
    /// Reads the results of a plan.
    ///
    /// # Errors
    /// If a result cannot be read.
    pub fn read(inputs: &'s Inputs, plan: &Plan, results: &mut Results) -> Result<SweepResult<'s>> {
        let measures: Vec<&Formula> = plan.measures().iter().map(|(_, formula)| formula).collect();
        let asked: Vec<&str> = DRAM.into_iter().chain(measures.iter().flat_map(|formula| formula.reads())).collect();
        let place = |path: &str| asked.iter().position(|known| *known == path);
        let mut sums: BTreeMap<u32, Sum> = BTreeMap::new();
        results.each(|entry| {
            let sum = sums.entry(entry.machine).or_default();
            sum.wrong_pixels += entry.frames.iter().map(|row| row.wrong_pixels).sum::<u64>();
            let Some(cycles) = entry.cycles() else {
                sum.error.get_or_insert_with(|| entry.error.unwrap_or_default());
                return Ok(());
            };
            let frames = |at: usize| entry.frames.iter().map(|row| row.values[at]).sum::<f64>();
            let statistic = |path: &&str| match *path {
                "cycles" => Some(cycles as f64),
                "seconds" => Some(entry.frames.iter().map(|row| row.seconds).sum()),
                path => entry.paths.iter().position(|own| own == path).map(frames),
            };
            sum.traces.insert(entry.trace, TraceRun { cycles, statistics: asked.iter().map(statistic).collect() });
            Ok(())
        })?;
        let traces = inputs.traces.len();
        let mut machines = Vec::with_capacity(sums.len());
        for (number, mut sum) in sums {
            let planned = plan.machine(number)?;
            let cost = planned.config.as_ref().ok().map(|config| plan.cost(config)).transpose()?.flatten();
            let mut machine = MachineResult {
                number,
                settings: planned.settings,
                cycles: None,
                traces: Vec::new(),
                measures: vec![None; measures.len()],
                trace_measures: Vec::new(),
                dram: None,
                cost,
                error: sum.error.take(),
                fault: planned.config.as_ref().ok().and_then(|config| order::fault(config, sum.wrong_pixels)),
            };
            if machine.error.is_none() && sum.traces.len() == traces {
                machine.traces = sum.traces.values().map(|part| part.cycles).collect();
                machine.cycles = Some(machine.traces.iter().sum());
                machine.dram = DRAM.iter().map(|path| place(path).and_then(|at| sum.whole(at))).sum();
                let told = |read: &dyn Fn(usize) -> Option<f64>| -> Vec<Option<f64>> {
                    measures.iter().map(|formula| formula.real(&|path: &str| place(path).and_then(read))).collect()
                };
                machine.measures = told(&|at| sum.whole(at));
                machine.trace_measures = sum.traces.values().map(|part| told(&|at| part.statistics[at])).collect();
            }
            // A machine that some traces have not been run on has no result yet.
            if machine.cycles.is_some() || machine.error.is_some() {
                machines.push(machine);
            }
        }
        machines.sort_by_key(|machine| (machine.cycles.is_none(), machine.cycles, machine.number));
        let parameters = plan.parameters().iter().map(|path| (*path).to_owned()).collect();
        let measures = plan.measures().iter().map(|(text, _)| text.clone()).collect();
        let base = plan.axes().iter().map(|axis| plan.base_setting(axis)).collect::<Result<_>>()?;
        let axes = plan.axes().to_vec();
        Ok(SweepResult {
            inputs,
            machines,
            estimated: Vec::new(),
            parameters,
            measures,
            axes,
            base,
            planned: plan.len(),
            ended: true,
            excluded: plan.excluded(),
        })
    }

    /// The same, of a sweep that runs or was killed.
    pub fn unfinished(self) -> SweepResult<'s> {
        SweepResult { ended: false, ..self }
    }

    /// Tells what axes do by the estimates of a screen.
    ///
    /// # Errors
    /// If a machine is not in the plan.
    pub fn screened(mut self, plan: &Plan, screened: &[Screened]) -> Result<SweepResult<'s>> {
        for Screened { machine, estimate, .. } in screened {
            let Ok(traces) = estimate else { continue };
            let traces: Vec<u64> = traces.iter().map(|cycles| cycles.round() as u64).collect();
            self.estimated.push(MachineResult {
                number: *machine,
                settings: plan.machine(*machine)?.settings,
                cycles: Some(traces.iter().sum()),
                traces,
                measures: vec![None; self.measures.len()],
                trace_measures: Vec::new(),
                dram: None,
                cost: None,
                error: None,
                fault: None,
            });
        }
        Ok(self)
    }

    /// Machines with a result, those that take fewest cycles first.
    pub fn timed(&self) -> impl Iterator<Item = (&MachineResult, u64)> {
        self.machines.iter().filter_map(|machine| Some((machine, machine.cycles?)))
    }

    /// The machines from which the effects of axes are derived, each with its cycles: after a screen the machines with an estimate, else those
    /// with a result.
    pub fn telling(&self) -> impl Iterator<Item = (&MachineResult, u64)> {
        let of = if self.estimated.is_empty() { &self.machines } else { &self.estimated };
        of.iter().filter_map(|machine| Some((machine, machine.cycles?)))
    }

    /// Machines that were to be run and have no result.
    pub fn failed(&self) -> impl Iterator<Item = (&MachineResult, &str)> {
        self.machines.iter().filter_map(|machine| Some((machine, machine.error.as_deref()?)))
    }

    /// The geometric mean of the cycles of those of the [machines from which effects are derived](SweepResult::telling) that `of` accepts.
    pub fn mean(&self, of: impl Fn(&MachineResult) -> bool) -> Option<(f64, usize)> {
        mean(self.telling().filter(|(machine, _)| of(machine)).map(|(_, cycles)| cycles))
    }

    /// The mean of a measure over some machines, on all traces together or on one; none where none of them has it.
    pub fn mean_measure(&self, measure: usize, trace: Option<usize>, of: impl Fn(&MachineResult) -> bool) -> Option<f64> {
        let value = |machine: &MachineResult| match trace {
            None => machine.measures[measure],
            Some(trace) => machine.trace_measures.get(trace)?[measure],
        };
        let own: Vec<f64> = self.timed().filter(|(machine, _)| of(machine)).filter_map(|(machine, _)| value(machine)).collect();
        (!own.is_empty()).then(|| own.iter().sum::<f64>() / own.len() as f64)
    }

    /// Whether a machine says what a value of an axis does: where the design changes one knob at a time, only if its other knobs are the base's.
    pub fn tells(&self, axis: usize, machine: &MachineResult) -> bool {
        let base = &self.base;
        self.inputs.experiment.design != Design::OneAtATime
            || (0..self.axes.len()).all(|other| other == axis || machine.settings[other] == base[other])
    }

    /// What each value of an axis does, those without a result left out.
    pub fn responses(&self, axis: usize, within: Within<'_>) -> Vec<Response> {
        let response = |value: &Setting| {
            let own = self.telling().filter(|(machine, _)| machine.settings[axis] == *value && self.tells(axis, machine));
            let cycles = own.filter_map(|(machine, cycles)| match within {
                Within::All => Some(cycles),
                Within::Axis(other, wanted) => (machine.settings[other] == *wanted).then_some(cycles),
                Within::Trace(trace) => machine.traces.get(trace).copied(),
            });
            let (cycles, machines) = mean(cycles)?;
            Some(Response { value: value.clone(), cycles, machines })
        };
        self.axes[axis].values.iter().filter_map(response).collect()
    }

    /// The mean of a measure over the machines that an axis gives a value, on all traces together or on one; none where none of them has it.
    pub fn axis_measure(&self, axis: usize, value: &Setting, measure: usize, trace: Option<usize>) -> Option<f64> {
        self.mean_measure(measure, trace, |machine| machine.settings[axis] == *value && self.tells(axis, machine))
    }

    /// What each trace takes, as if traces were the values of an axis.
    pub fn trace_responses(&self, within: Within<'_>) -> Vec<Response> {
        let response = |(at, name): (usize, String)| {
            let own = self.telling().filter(|(machine, _)| match within {
                Within::All => true,
                Within::Axis(axis, value) => machine.settings[axis] == *value && self.tells(axis, machine),
                Within::Trace(only) => at == only,
            });
            let (cycles, machines) = mean(own.filter_map(|(machine, _)| machine.traces.get(at).copied()))?;
            Some(Response { value: Setting::Name(name), cycles, machines })
        };
        self.trace_names().into_iter().enumerate().filter_map(response).collect()
    }

    /// What the page calls the traces: the names of their files without folder and ending, or of scenes without `@`, where these differ.
    pub fn trace_names(&self) -> Vec<String> {
        let whole = &self.inputs.experiment.traces;
        let stem = |path: &String| {
            let scene = path.strip_prefix('@').map(str::to_owned);
            scene.or(Path::new(path).file_stem().map(|stem| stem.to_string_lossy().into_owned())).unwrap_or(path.clone())
        };
        let short: Vec<String> = whole.iter().map(stem).collect();
        let differ = short.iter().enumerate().all(|(at, name)| !short[..at].contains(name));
        if differ { short } else { whole.clone() }
    }

    /// What the page calls that in which the traces differ.
    pub fn trace_axis(&self) -> &str {
        let named = &self.inputs.experiment.trace_axis;
        if named.is_empty() { "trace" } else { named }
    }

    /// What each axis does, the one that does most first.
    pub fn effects(&self) -> Vec<Effect> {
        let mut effects: Vec<Effect> = Vec::new();
        for (at, axis) in self.axes.iter().enumerate() {
            let responses = self.responses(at, Within::All);
            if !responses.is_empty() {
                effects.push(Effect { axis: at, path: axis.path.clone(), ratio: ratio(&responses), responses });
            }
        }
        effects.sort_by(|a, b| b.ratio.total_cmp(&a.ratio).then(a.axis.cmp(&b.axis)));
        effects
    }

    /// What machines cost beside cycles: the name of the measure, and each machine's, in the order of [`SweepResult::timed`]. None where there is no
    /// measure that all have.
    pub fn costs(&self) -> Option<(String, Vec<f64>)> {
        let named = &self.inputs.experiment.cost;
        let cost = |machine: &MachineResult| if named.is_empty() { machine.dram } else { machine.cost.map(|cost| cost as f64) };
        let costs: Option<Vec<f64>> = self.timed().map(|(machine, _)| cost(machine)).collect();
        let name = if named.is_empty() { "bytes of DRAM traffic".to_owned() } else { named.clone() };
        costs.filter(|costs| !costs.is_empty()).map(|costs| (name, costs))
    }

    /// As JSON.
    pub fn json(&self) -> Value {
        let machine = |machine: &MachineResult| {
            let settings: serde_json::Map<String, Value> = self
                .parameters
                .iter()
                .zip(&machine.settings)
                .map(|(path, setting)| {
                    let value = match setting {
                        Setting::Number(number) => json!(number),
                        Setting::Switch(on) => json!(on),
                        Setting::Name(name) => json!(name),
                    };
                    (path.clone(), value)
                })
                .collect();
            let named = |values: &[Option<f64>]| -> serde_json::Map<String, Value> {
                self.measures.iter().zip(values).map(|(name, value)| (name.clone(), json!(value))).collect()
            };
            let by_trace: Vec<_> = machine.trace_measures.iter().map(|values| named(values)).collect();
            json!({
                "machine": machine.number,
                "settings": settings,
                "cycles": machine.cycles,
                "traces": machine.traces,
                "measures": named(&machine.measures),
                "trace_measures": by_trace,
                "dram_bytes": machine.dram,
                "cost": machine.cost,
                "error": machine.error,
            })
        };
        json!({ "version": 1, "experiment": self.inputs.experiment, "planned": self.planned, "machines": self.machines.iter().map(machine).collect::<Vec<_>>() })
    }

    /// A machine's settings as the command line takes them.
    pub fn described(&self, machine: &MachineResult) -> String {
        let paths: Vec<&str> = self.parameters.iter().map(String::as_str).collect();
        described(&paths, &machine.settings)
    }
}

/// Which of some points no other is better than: none has fewer cycles and costs no more, or costs less with no more cycles. Points are sorted by
/// cycles.
pub fn front(points: &[(u64, f64)]) -> Vec<bool> {
    // Of those with fewer cycles, and of those with as many, the cheapest decide.
    let (mut before, mut at) = (f64::INFINITY, 0);
    let mut on = Vec::with_capacity(points.len());
    while at < points.len() {
        let same = points[at..].iter().take_while(|other| other.0 == points[at].0).count();
        let least = points[at..at + same].iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
        on.extend(points[at..at + same].iter().map(|point| point.1 == least && least < before));
        before = before.min(least);
        at += same;
    }
    on
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whether no point is better than this one.
    fn on_front(points: &[(u64, f64)], own: &(u64, f64)) -> bool {
        !points.iter().any(|other| other.0 <= own.0 && other.1 <= own.1 && (other.0 < own.0 || other.1 < own.1))
    }

    #[test]
    fn the_front_has_what_nothing_is_better_than() {
        let points = [(10, 9.0), (12, 9.0), (12, 7.0), (15, 8.0), (20, 3.0), (20, 3.0), (30, 3.0)];
        assert_eq!(front(&points), [true, false, true, false, true, true, false]);
        let all: Vec<bool> = points.iter().map(|point| on_front(&points, point)).collect();
        assert_eq!(front(&points), all);
        assert!(front(&[]).is_empty());
    }
}
