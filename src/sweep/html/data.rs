//! What the page of a sweep shows, read from the results: machines, what each axis does, and the Pareto front.

use std::collections::BTreeMap;

use anyhow::Result;
use serde_json::{Value, json};

use crate::knob::Setting;
use crate::sweep::folder::{Inputs, Results};
use crate::sweep::plan::{Axis, Plan, described};

/// Statistics that add up to the bytes that DRAM moves.
const DRAM: [&str; 2] = ["memory.dram.read_bytes", "memory.dram.write_bytes"];

/// A machine with its result.
#[derive(Clone, Debug)]
pub struct Machine {
    /// Its number in the plan.
    pub number: u32,
    /// Values of the parameters.
    pub settings: Vec<Setting>,
    /// Cycles of all traces and frames; none: it has no result.
    pub cycles: Option<u64>,
    /// Bytes that DRAM moved; none where the sweep did not keep them.
    pub dram: Option<f64>,
    /// What the experiment says that the machine costs.
    pub cost: Option<u64>,
    /// Why it has no result.
    pub error: Option<String>,
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
pub struct Sweep<'s> {
    /// What it was made from.
    pub inputs: &'s Inputs,
    /// The machines of the plan that were run, those that take fewest cycles first, those without a result last.
    pub machines: Vec<Machine>,
    /// Knobs in which they differ.
    pub parameters: Vec<String>,
    /// The axes.
    pub axes: Vec<Axis>,
    /// Machines of the plan.
    pub planned: u32,
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

impl<'s> Sweep<'s> {
    /// Reads the results of a plan.
    ///
    /// # Errors
    /// If a result cannot be read.
    pub fn read(inputs: &'s Inputs, plan: &Plan, results: &mut Results) -> Result<Sweep<'s>> {
        #[derive(Default)]
        struct Sum {
            traces: usize,
            cycles: u64,
            dram: Option<f64>,
            error: Option<String>,
        }
        let mut sums: BTreeMap<u32, Sum> = BTreeMap::new();
        results.each(|entry| {
            let sum = sums.entry(entry.machine).or_default();
            let Some(cycles) = entry.cycles() else {
                sum.error.get_or_insert_with(|| entry.error.unwrap_or_default());
                return Ok(());
            };
            let places: Vec<usize> =
                DRAM.iter().filter_map(|path| entry.paths.iter().position(|known| known == path)).collect();
            let bytes = || entry.frames.iter().map(|row| places.iter().map(|&at| row.values[at]).sum::<f64>()).sum::<f64>();
            let own = (places.len() == DRAM.len()).then(bytes);
            sum.dram = if sum.traces == 0 { own } else { sum.dram.zip(own).map(|(sum, own)| sum + own) };
            (sum.traces, sum.cycles) = (sum.traces + 1, sum.cycles + cycles);
            Ok(())
        })?;
        let mut machines = Vec::with_capacity(sums.len());
        for (number, sum) in sums {
            let planned = plan.machine(number)?;
            let cost = planned.config.as_ref().ok().map(|config| plan.cost(config)).transpose()?.flatten();
            let whole = sum.error.is_none() && sum.traces == inputs.traces.len();
            let (cycles, dram) = if whole { (Some(sum.cycles), sum.dram) } else { (None, None) };
            machines.push(Machine { number, settings: planned.settings, cycles, dram, cost, error: sum.error });
        }
        machines.sort_by_key(|machine| (machine.cycles.is_none(), machine.cycles, machine.number));
        let parameters = plan.parameters().iter().map(|path| (*path).to_owned()).collect();
        Ok(Sweep { inputs, machines, parameters, axes: plan.axes().to_vec(), planned: plan.len() })
    }

    /// Machines with a result, those that take fewest cycles first.
    pub fn timed(&self) -> impl Iterator<Item = (&Machine, u64)> {
        self.machines.iter().filter_map(|machine| Some((machine, machine.cycles?)))
    }

    /// The geometric mean of the cycles of some machines.
    pub fn mean(&self, of: impl Fn(&Machine) -> bool) -> Option<(f64, usize)> {
        mean(self.timed().filter(|(machine, _)| of(machine)).map(|(_, cycles)| cycles))
    }

    /// What each axis does, the one that does most first.
    pub fn effects(&self) -> Vec<Effect> {
        let mut effects: Vec<Effect> = Vec::new();
        for (at, axis) in self.axes.iter().enumerate() {
            let response = |value: &Setting| {
                let (cycles, machines) = self.mean(|machine| machine.settings[at] == *value)?;
                Some(Response { value: value.clone(), cycles, machines })
            };
            let responses: Vec<Response> = axis.values.iter().filter_map(response).collect();
            let least = responses.iter().map(|own| own.cycles).fold(f64::INFINITY, f64::min);
            let most = responses.iter().map(|own| own.cycles).fold(0.0, f64::max);
            if !responses.is_empty() {
                effects.push(Effect { axis: at, path: axis.path.clone(), responses, ratio: most / least });
            }
        }
        effects.sort_by(|a, b| b.ratio.total_cmp(&a.ratio).then(a.axis.cmp(&b.axis)));
        effects
    }

    /// What machines cost beside cycles: the name of the measure, and each machine's, in the order of [`Sweep::timed`]. None where there is no
    /// measure that all have.
    pub fn costs(&self) -> Option<(String, Vec<f64>)> {
        let named = &self.inputs.experiment.cost;
        let cost = |machine: &Machine| if named.is_empty() { machine.dram } else { machine.cost.map(|cost| cost as f64) };
        let costs: Option<Vec<f64>> = self.timed().map(|(machine, _)| cost(machine)).collect();
        let name = if named.is_empty() { "bytes of DRAM traffic".to_owned() } else { named.clone() };
        costs.filter(|costs| !costs.is_empty()).map(|costs| (name, costs))
    }

    /// As JSON.
    pub fn json(&self) -> Value {
        let machine = |machine: &Machine| {
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
            json!({ "machine": machine.number, "settings": settings, "cycles": machine.cycles, "dram_bytes": machine.dram, "cost": machine.cost, "error": machine.error })
        };
        json!({ "version": 1, "experiment": self.inputs.experiment, "planned": self.planned, "machines": self.machines.iter().map(machine).collect::<Vec<_>>() })
    }

    /// A machine's settings as the command line takes them.
    pub fn described(&self, machine: &Machine) -> String {
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
