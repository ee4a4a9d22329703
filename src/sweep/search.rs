//! A search beside the grid: successive halving (Karnin, Koren and Somekh 2013; Jamieson and Talwalkar 2016), by estimate and then by cycles.
//!
//! All machines of the plan are estimated. The fastest of these go up a ladder: on each rung its machines are simulated on more frames than on
//! the rung below, and the faster half goes on. The last rung is simulated whole, and its results are those of a sweep. What has not been
//! simulated of a machine is estimated, times the cycles of its simulated frames divided by their estimates.

use std::path::Path;

use anyhow::Result;
use serde::{Deserialize, Serialize};

use super::entry::Keep;
use super::folder::{Journal, Results, Shard};
use super::outcome::mean;
use super::timing::{Screened, Screening, Sweep, Took};

/// Machines that are simulated whole, at least: fewer say nothing of what costs less and is nearly as fast.
const WHOLE: u32 = 4;

/// A rung of the ladder: machines that were simulated on a part of the frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Rung {
    /// Machines.
    pub machines: u32,
    /// Frames of all traces together on which each was simulated.
    pub frames: u32,
}

/// The frames on each rung but the last, which has all: half as many as on the rung above, rounded up.
fn ladder(frames: u32, machines: u32) -> Vec<u32> {
    let rungs = (machines / WHOLE).checked_ilog2().unwrap_or(0).min(frames.checked_ilog2().unwrap_or(0));
    (1..=rungs).rev().map(|below| frames.div_ceil(1 << below)).collect()
}

/// The frames of each trace that are among the first frames of all, trace by trace.
fn first(traces: &[u32], mut frames: u32) -> Vec<u32> {
    let own = |&all: &u32| {
        let own = all.min(frames);
        frames -= own;
        own
    };
    traces.iter().map(own).collect()
}

/// The cycles of a machine that is simulated on the first frames of traces, and estimated on all: the geometric mean over the traces.
fn cycles(simulated: &[Vec<u64>], estimates: &[Vec<f64>]) -> f64 {
    let measured: f64 = simulated.iter().flatten().map(|&cycles| cycles as f64).sum();
    let own = simulated.iter().zip(estimates).flat_map(|(simulated, estimates)| &estimates[..simulated.len()]);
    let estimated: f64 = own.sum();
    let correction = if estimated > 0.0 { measured / estimated } else { 1.0 };
    let trace = |(simulated, estimates): (&Vec<u64>, &Vec<f64>)| {
        let left: f64 = estimates[simulated.len()..].iter().sum();
        simulated.iter().map(|&cycles| cycles as f64).sum::<f64>() + correction * left
    };
    mean(simulated.iter().zip(estimates).map(trace)).map_or(f64::INFINITY, |mean| mean.0)
}

/// Chooses the machines of a plan that are simulated whole: `machines` begin the ladder. The results of each rung are in a file of the folder, so that a
/// search that was killed goes on. Machines without an estimate, and machines that stop, are chosen, too: they are not dropped silently.
///
/// # Errors
/// If a trace cannot be rendered or has no frame in the range, or a file cannot be read or written.
pub fn halving(folder: &Path, sweep: &Sweep<'_>, machines: u32) -> Result<(Screening, Took)> {
    let found = sweep.estimates(&|frames| frames)?;
    let mut order: Vec<(f64, u32)> = Vec::new();
    for (machine, estimates) in (0..).zip(&found) {
        if let Ok(estimates) = estimates {
            order.push((cycles(&vec![Vec::new(); estimates.len()], estimates), machine));
        }
    }
    let frames: Vec<u32> = match order.first() {
        Some(&(_, machine)) => found[machine as usize].iter().flatten().map(|frames| frames.len() as u32).collect(),
        None => vec![0; sweep.traces.len()],
    };
    let fastest = |order: &mut Vec<(f64, u32)>, keep: usize| {
        order.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        order.truncate(keep);
    };
    fastest(&mut order, machines as usize);
    let mut kept: Vec<bool> = found.iter().map(Result::is_err).collect();
    let mut climbed = vec![0; found.len()];
    let (mut rungs, mut took) = (Vec::new(), Took::default());
    let budgets = ladder(frames.iter().sum(), order.len() as u32);
    for (number, &budget) in (1..).zip(&budgets) {
        let own: std::collections::BTreeSet<u32> = order.iter().map(|own| own.1).collect();
        own.iter().for_each(|&machine| climbed[machine as usize] = number);
        rungs.push(Rung { machines: own.len() as u32, frames: budget });
        let rung = Sweep {
            plan: sweep.plan,
            traces: sweep.traces,
            frames: sweep.frames.clone(),
            first: Some(first(&frames, budget)),
            // Cycles are kept whatever else is.
            keep: Keep::new(&["cycles".to_owned()]),
            shard: Shard::default(),
            progress: sweep.progress,
        };
        let place = folder.join(format!("rung-{number}-of-{}.jsonl", budgets.len()));
        if let Some((journal, done)) = Journal::open(&place)? {
            took = took.and(rung.run(&|machine| own.contains(&machine), journal, &done)?);
        }
        let mut simulated = vec![vec![Vec::new(); frames.len()]; found.len()];
        Results::read(&place)?.each(|entry| {
            let machine = entry.machine as usize;
            kept[machine] |= entry.error.is_some();
            simulated[machine][entry.trace as usize] = entry.frames.iter().map(|row| row.cycles).collect();
            Ok(())
        })?;
        order.retain(|&(_, machine)| !kept[machine as usize]);
        for (own, machine) in &mut order {
            if let Ok(estimates) = &found[*machine as usize] {
                *own = cycles(&simulated[*machine as usize], estimates);
            }
        }
        let half = order.len().div_ceil(2);
        fastest(&mut order, half);
    }
    order.iter().for_each(|&(_, machine)| kept[machine as usize] = true);
    let mut machines = Vec::with_capacity(found.len());
    for (machine, estimates) in found.into_iter().enumerate() {
        machines.push(Screened {
            machine: machine as u32,
            estimate: estimates.map(|traces| traces.iter().map(|frames| frames.iter().sum()).collect()),
            kept: kept[machine],
            rungs: climbed[machine],
        });
    }
    Ok((Screening { machines, rungs, frames: frames.iter().sum() }, took))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ladder_halves_machines_and_doubles_frames() {
        assert_eq!(ladder(16, 64), [1, 2, 4, 8]);
        assert_eq!(ladder(3, 16), [2]);
        assert_eq!(ladder(100, 16), [25, 50]);
        assert!(ladder(1, 64).is_empty() && ladder(100, 7).is_empty() && ladder(0, 0).is_empty());
        assert_eq!(first(&[2, 1, 5], 4), [2, 1, 1]);
        assert_eq!(first(&[2, 1, 5], 1), [1, 0, 0]);
    }

    #[test]
    fn what_is_not_simulated_is_estimated_times_the_error_so_far() {
        let estimates = [vec![100.0, 100.0], vec![400.0]];
        assert!((cycles(&[vec![], vec![]], &estimates) - (200.0_f64 * 400.0).sqrt()).abs() < 1e-9);
        // The first frame takes twice its estimate.
        assert!((cycles(&[vec![200], vec![]], &estimates) - (400.0_f64 * 800.0).sqrt()).abs() < 1e-9);
        assert!((cycles(&[vec![200, 100], vec![300]], &estimates) - (300.0_f64 * 300.0).sqrt()).abs() < 1e-9);
    }
}
