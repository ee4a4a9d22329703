//! What came of a sweep, read from its results: machines, what each axis does, by the values of another or by trace, and the Pareto front.
//!
//! Cycles have one kind of mean, the geometric one: over traces and over machines. The ratio of two such means is the geometric mean of
//! speed-ups, whatever the base, so that no trace counts for more than another because it is longer (Fleming and Wallace 1986). If not all
//! combinations of values were run, values of an axis were run with other values of the other axes. Then means are those of an additive model,
//! fitted to the logarithms of cycles: least-squares means (Searle, Speed and Milliken 1980), which are the geometric means otherwise.

use std::cell::OnceCell;
use std::collections::BTreeMap;
use std::path::Path;

use anyhow::Result;
use serde_json::{Value, json};

use super::experiment::Design;
use super::folder::Results;
use super::inputs::Inputs;
use super::link::Formula;
use super::plan::{Axis, Plan, described};
use super::timing::{Screened, Screening};
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
    /// The geometric mean over the traces of the cycles of all frames; of one trace its cycles. None: the machine has no result.
    pub cycles: Option<f64>,
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
    /// What the base configuration has at each knob that a link sets.
    base_links: Vec<Setting>,
    /// Machines of the plan.
    pub planned: u32,
    /// Whether all machines that were to be run have been run.
    pub ended: bool,
    /// Combinations that are no machines, because they do not meet a condition.
    pub excluded: u64,
    /// Least-squares means of the values of each axis, as logarithms: of all traces, then of each trace. Computed when they are first read.
    fits: OnceCell<Vec<Vec<Vec<Option<f64>>>>>,
}

/// The machine that others are compared with.
pub struct Reference {
    /// Its number in the plan.
    pub number: u32,
    /// Whether it is the base configuration. If no machine is, it is the first machine with a result.
    pub is_base: bool,
    /// Its cycles.
    pub cycles: f64,
}

impl Reference {
    /// The machine in words.
    pub fn name(&self) -> String {
        if self.is_base { format!("the base, machine {}", self.number) } else { format!("machine {}", self.number) }
    }
}

/// A setting without the quotes of names.
pub fn plain(setting: &Setting) -> String {
    match setting {
        Setting::Name(name) => name.clone(),
        other => other.to_string(),
    }
}

/// The geometric mean of some cycles, and how many they are; none of nothing. Of one number it is that number.
pub fn mean(values: impl Iterator<Item = f64>) -> Option<(f64, usize)> {
    let values: Vec<f64> = values.collect();
    let mean = match &values[..] {
        [] => return None,
        [only] => *only,
        all => libm::exp(all.iter().map(|cycles| log(*cycles)).sum::<f64>() / all.len() as f64),
    };
    Some((mean, values.len()))
}

/// The logarithm of cycles; of none, that of one cycle.
fn log(cycles: f64) -> f64 {
    libm::log(cycles.max(1.0))
}

/// The passes over the axes after which an additive model is taken as it is.
const PASSES: usize = 1000;

/// The change of an effect in one pass over the axes at which an additive model is fitted.
const FITTED: f64 = 1e-9;

/// Fits logarithms of cycles as a sum of an effect of each axis: for each value of each axis, the mean of the logarithms over all combinations of
/// values, had they been run. None for a value that no machine has. `values` has how many values each axis has; a machine is the
/// place of its value on each axis, and its logarithm.
fn fitted(values: &[usize], machines: &[(Vec<usize>, f64)]) -> Vec<Vec<Option<f64>>> {
    let whole = machines.iter().map(|machine| machine.1).sum::<f64>() / machines.len().max(1) as f64;
    let mut effects: Vec<Vec<Option<f64>>> = values.iter().map(|&count| vec![None; count]).collect();
    for (places, _) in machines {
        places.iter().zip(&mut effects).for_each(|(&place, own)| own[place] = Some(0.0));
    }
    // Axis by axis, each value takes what the others leave: the Gauss-Seidel method for the normal equations.
    let mut left: Vec<f64> = machines.iter().map(|machine| machine.1 - whole).collect();
    for _ in 0..PASSES {
        let mut moved = 0.0_f64;
        for (axis, own) in effects.iter_mut().enumerate() {
            let mut sums = vec![(0.0, 0_u32); own.len()];
            for ((places, _), left) in machines.iter().zip(&left) {
                let sum = &mut sums[places[axis]];
                *sum = (sum.0 + left, sum.1 + 1);
            }
            let steps: Vec<f64> = sums.iter().map(|(sum, count)| sum / f64::from((*count).max(1))).collect();
            for (effect, step) in own.iter_mut().zip(&steps) {
                if let Some(effect) = effect {
                    *effect += step;
                    moved = moved.max(step.abs());
                }
            }
            machines.iter().zip(&mut left).for_each(|((places, _), left)| *left -= steps[places[axis]]);
        }
        if moved < FITTED {
            break;
        }
    }
    let average = |own: &Vec<Option<f64>>| {
        let known: Vec<f64> = own.iter().copied().flatten().collect();
        known.iter().sum::<f64>() / known.len().max(1) as f64
    };
    let averages: Vec<f64> = effects.iter().map(average).collect();
    let all: f64 = whole + averages.iter().sum::<f64>();
    let level = |(own, average): (Vec<Option<f64>>, &f64)| own.into_iter().map(|e| e.map(|e| all - average + e)).collect();
    effects.into_iter().zip(&averages).map(level).collect()
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
                machine.cycles = mean(machine.traces.iter().map(|&cycles| cycles as f64)).map(|mean| mean.0);
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
        machines.sort_by(|a, b| {
            let cycles = |machine: &MachineResult| machine.cycles.unwrap_or(f64::INFINITY);
            cycles(a).total_cmp(&cycles(b)).then(a.number.cmp(&b.number))
        });
        let parameters = plan.parameters().iter().map(|path| (*path).to_owned()).collect();
        let measures = plan.measures().iter().map(|(text, _)| text.clone()).collect();
        let base = plan.axes().iter().map(|axis| plan.base_setting(axis)).collect::<Result<_>>()?;
        let axes = plan.axes().to_vec();
        let linked = plan.parameters().into_iter().skip(axes.len());
        let base_links = linked.map(|path| Ok(plan.base().knob("the base", path)?.1)).collect::<Result<_>>()?;
        Ok(SweepResult {
            inputs,
            machines,
            estimated: Vec::new(),
            parameters,
            measures,
            axes,
            base,
            base_links,
            planned: plan.len(),
            ended: true,
            excluded: plan.excluded(),
            fits: OnceCell::new(),
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
    pub fn screened(mut self, plan: &Plan, screening: &Screening) -> Result<SweepResult<'s>> {
        for Screened { machine, estimate, .. } in &screening.machines {
            let Ok(traces) = estimate else { continue };
            let traces: Vec<u64> = traces.iter().map(|cycles| cycles.round() as u64).collect();
            self.estimated.push(MachineResult {
                number: *machine,
                settings: plan.machine(*machine)?.settings,
                cycles: mean(traces.iter().map(|&cycles| cycles as f64)).map(|mean| mean.0),
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
    pub fn timed(&self) -> impl Iterator<Item = (&MachineResult, f64)> {
        self.machines.iter().filter_map(|machine| Some((machine, machine.cycles?)))
    }

    /// The machines from which the effects of axes are derived, each with its cycles: after a screen the machines with an estimate, else those
    /// with a result.
    pub fn telling(&self) -> impl Iterator<Item = (&MachineResult, f64)> {
        let of = if self.estimated.is_empty() { &self.machines } else { &self.estimated };
        of.iter().filter_map(|machine| Some((machine, machine.cycles?)))
    }

    /// Whether a machine has the base configuration's value at each knob that is varied or linked.
    pub fn is_base(&self, machine: &MachineResult) -> bool {
        // A variable changes machines through links alone.
        let axes = (0..self.axes.len()).all(|at| self.axes[at].is_variable || machine.settings[at] == self.base[at]);
        axes && machine.settings[self.axes.len()..] == self.base_links
    }

    /// The machine among those from which effects are derived that others are compared with: the base, or else the first one. None if there is no
    /// result.
    pub fn reference(&self) -> Option<Reference> {
        let of = |is_base: bool| {
            move |(machine, cycles): (&MachineResult, f64)| Reference { number: machine.number, is_base, cycles }
        };
        let first = || self.telling().min_by_key(|(machine, _)| machine.number).map(of(false));
        self.telling().find(|(machine, _)| self.is_base(machine)).map(of(true)).or_else(first)
    }

    /// Whether the machines from which effects are derived are all combinations of the values that they have.
    pub fn is_complete(&self) -> bool {
        let has = |at: usize, value: &Setting| self.telling().any(|(machine, _)| machine.settings[at] == *value);
        let values = |(at, axis): (usize, &Axis)| axis.values.iter().filter(|value| has(at, value)).count();
        let all = self.axes.iter().enumerate().map(values).try_fold(1_usize, |all, count| all.checked_mul(count));
        all == Some(self.telling().count())
    }

    /// Whether means are least-squares means: the design does not change one knob at a time, and not all combinations were run.
    pub fn is_fitted(&self) -> bool {
        self.inputs.experiment.design != Design::OneAtATime && !self.fits().is_empty()
    }

    /// The least-squares means; empty if all combinations were run.
    fn fits(&self) -> &[Vec<Vec<Option<f64>>>] {
        self.fits.get_or_init(|| {
            if self.is_complete() || self.inputs.experiment.design == Design::OneAtATime {
                return Vec::new();
            }
            let values: Vec<usize> = self.axes.iter().map(|axis| axis.values.len()).collect();
            let places = |machine: &MachineResult| -> Vec<usize> {
                let place = |(axis, own): (&Axis, &Setting)| axis.values.iter().position(|value| value == own).unwrap_or(0);
                self.axes.iter().zip(&machine.settings).map(place).collect()
            };
            let whole = self.telling().map(|(machine, cycles)| (places(machine), log(cycles))).collect();
            let trace = |at: usize| -> Vec<(Vec<usize>, f64)> {
                let own = self.telling().filter_map(|(machine, _)| Some((machine, *machine.traces.get(at)?)));
                own.map(|(machine, cycles)| (places(machine), log(cycles as f64))).collect()
            };
            let traces = (0..self.inputs.experiment.traces.len()).map(trace);
            std::iter::once(whole).chain(traces).map(|machines| fitted(&values, &machines)).collect()
        })
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
                Within::Trace(trace) => machine.traces.get(trace).map(|&cycles| cycles as f64),
            });
            let (cycles, machines) = mean(cycles)?;
            Some(Response { value: value.clone(), cycles, machines })
        };
        let fit = match within {
            Within::All => self.fits().first(),
            Within::Trace(trace) => self.fits().get(1 + trace),
            Within::Axis(..) => None,
        };
        let fitted = |(at, value): (usize, &Setting)| {
            let own = response(value)?;
            let log = fit.and_then(|fit| fit[axis][at]);
            Some(Response { cycles: log.map_or(own.cycles, libm::exp), ..own })
        };
        self.axes[axis].values.iter().enumerate().filter_map(fitted).collect()
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
            let cycles = own.filter_map(|(machine, _)| machine.traces.get(at).map(|&cycles| cycles as f64));
            let (cycles, machines) = mean(cycles)?;
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
        costs.filter(|costs| !costs.is_empty()).map(|costs| (self.cost_name().replace('`', ""), costs))
    }

    /// The cost in a sentence: a formula between backticks.
    pub fn cost_name(&self) -> String {
        match self.inputs.experiment.cost.trim() {
            "" => "bytes of DRAM traffic".to_owned(),
            "area" => "area in bytes of SRAM".to_owned(),
            formula => format!("`{formula}`"),
        }
    }

    /// The name of the cost, and the machines on the Pareto front of cycles and cost. None if there are fewer than two machines with a cost.
    pub fn front(&self) -> Option<(String, Vec<FrontMachine<'_>>)> {
        let (name, costs) = self.costs()?;
        let machines: Vec<(&MachineResult, f64)> = self.timed().collect();
        let points: Vec<(f64, f64)> = machines.iter().map(|machine| machine.1).zip(costs).collect();
        let of = |FrontPoint { at, alike }| {
            let (cycles, cost) = points[at];
            FrontMachine { machine: machines[at].0, cycles, cost, alike }
        };
        (points.len() > 1).then(|| (name, front(&points).into_iter().map(of).collect()))
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
            // Of one trace cycles are whole.
            let whole = |cycles: Option<f64>| match (cycles, &machine.traces[..]) {
                (_, [only]) => json!(only),
                (cycles, _) => json!(cycles),
            };
            let by_trace: Vec<_> = machine.trace_measures.iter().map(|values| named(values)).collect();
            json!({
                "machine": machine.number,
                "settings": settings,
                "cycles": whole(machine.cycles),
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

/// Machines that differ by at most this factor, in cycles and in cost, count as equal on the front.
pub const TOLERANCE: f64 = 1.01;

/// A machine on the Pareto front.
#[derive(Clone, Copy, Debug)]
pub struct FrontMachine<'s> {
    /// The machine.
    pub machine: &'s MachineResult,
    /// Its cycles.
    pub cycles: f64,
    /// Its cost.
    pub cost: f64,
    /// Number of other machines whose cycles and cost differ from its own by at most the [tolerance](TOLERANCE).
    pub alike: usize,
}

/// A point of the front.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrontPoint {
    /// Its place among the points.
    pub at: usize,
    /// How many other points differ from it by at most the tolerance in both.
    pub alike: usize,
}

/// The Pareto front of points of cycles and cost, with a tolerance: for each point that is not on it, a point on it takes at most 1.01 times the
/// cycles and costs at most 1.01 times as much. Of points on the front, each that costs more takes fewer cycles, by more than the tolerance. They
/// stand in order of cost.
pub fn front(points: &[(f64, f64)]) -> Vec<FrontPoint> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    order.sort_by(|&a, &b| points[a].1.total_cmp(&points[b].1).then(points[a].0.total_cmp(&points[b].0)).then(a.cmp(&b)));
    // The cost of the cheapest point that the last one stands for: a faster one that costs hardly more takes its place.
    let (mut front, mut cheapest): (Vec<usize>, f64) = (Vec::new(), 0.0);
    for at in order {
        let (cycles, cost) = points[at];
        match front.last_mut() {
            Some(last) if cycles >= points[*last].0 => {}
            Some(last) if cost <= TOLERANCE * cheapest => *last = at,
            Some(last) if TOLERANCE * cycles >= points[*last].0 => {}
            _ => {
                front.push(at);
                cheapest = cost;
            }
        }
    }
    let close = |a: f64, b: f64| a <= TOLERANCE * b && b <= TOLERANCE * a;
    let point = |at: usize| {
        let (cycles, cost) = points[at];
        let alike = points.iter().filter(|other| close(other.0, cycles) && close(other.1, cost)).count() - 1;
        FrontPoint { at, alike }
    };
    front.into_iter().map(point).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::num::Random;

    #[test]
    fn the_front_stands_for_all_points_within_its_tolerance() {
        let points =
            [(1000.0, 100.0), (999.0, 400.0), (500.0, 100.5), (500.0, 101.0), (250.0, 300.0), (251.0, 299.0), (250.0, 9000.0)];
        // The second is hardly faster than the first. The third is much faster and costs as much.
        assert_eq!(front(&points), [FrontPoint { at: 2, alike: 1 }, FrontPoint { at: 4, alike: 1 }]);
        assert!(front(&[]).is_empty());
        assert_eq!(front(&[(5.0, 0.0), (5.0, 0.0)]), [FrontPoint { at: 0, alike: 1 }]);
        let mut random = Random::new(7);
        for _ in 0..200 {
            let points: Vec<(f64, f64)> =
                (0..40).map(|_| (f64::from(1000 + random.below(60)), f64::from(500 + random.below(40)))).collect();
            let found = front(&points);
            for (cycles, cost) in &points {
                let stands = |own: &FrontPoint| points[own.at].0 <= TOLERANCE * cycles && points[own.at].1 <= TOLERANCE * cost;
                assert!(found.iter().any(stands), "{cycles} {cost}: {found:?} of {points:?}");
            }
            for pair in found.windows(2) {
                let [a, b] = [points[pair[0].at], points[pair[1].at]];
                assert!(b.1 > a.1 && b.0 < a.0, "{a:?} {b:?}");
            }
        }
    }

    #[test]
    fn an_additive_model_parts_axes_that_were_run_together() {
        // The first axis doubles, the second is 3 times: logarithms 1 and 2 of what was run.
        let effect = |a: usize, b: usize| [0.0, 1.0][a] + [0.0, 2.0, 3.0][b];
        let run = [(0, 0), (0, 1), (1, 1), (1, 2)];
        let machines: Vec<(Vec<usize>, f64)> = run.map(|(a, b)| (vec![a, b], effect(a, b))).to_vec();
        let found = fitted(&[2, 3], &machines);
        let value = |axis: usize, at: usize| found[axis][at].expect("it was run");
        assert!((value(0, 1) - value(0, 0) - 1.0).abs() < 1e-6, "{found:?}");
        assert!((value(1, 1) - value(1, 0) - 2.0).abs() < 1e-6 && (value(1, 2) - value(1, 0) - 3.0).abs() < 1e-6, "{found:?}");
        // Means of what was run would say 1.5 of the first axis. Of all combinations the model has the means.
        let all: Vec<(Vec<usize>, f64)> = (0..6).map(|at| (vec![at / 3, at % 3], effect(at / 3, at % 3))).collect();
        let found = fitted(&[2, 3], &all);
        assert!((found[0][0].expect("a mean") - 5.0 / 3.0).abs() < 1e-9, "{found:?}");
        assert_eq!(fitted(&[2], &[(vec![1], 4.0)]), [[None, Some(4.0)]]);
    }
}
