//! Machines for checks, and their statistics.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use anyhow::{Context, Result, anyhow, ensure};

use machine::config::SortClass;
use machine::{Config, Machine, MachineReport};
use num::OUR_FAULT;
use sim::{Clock, UNITS, UnitCounts};
use stats::{Group, Heading, Tree};
use synthetic::{Scene, events};
use work::{Event, FUNNEL, Funnel, Shade};

/// A built-in configuration with changes. The name of a sort class is the machine of four pipelines with it.
///
/// # Errors
/// If there is none of that name, a change is none, or the knobs do not fit each other.
pub fn config(name: &str, changes: &[&str]) -> Result<Config> {
    let class = SortClass::NAMES.contains(&name);
    let mut config = Config::built_in(if class { "four-pipelines" } else { name })?;
    if class {
        config.set(&format!("sort={name}"))?;
    }
    for change in changes {
        config.set(change)?;
    }
    config.check()?;
    Ok(config)
}

/// Runs work from cycle 0 to its end.
///
/// # Errors
/// If the machine stops before.
pub fn run(config: &Config, events: impl IntoIterator<Item = Event>) -> Result<MachineReport> {
    Ok(Machine::new(config)?.run(events.into_iter(), Clock::SkipIdle)?)
}

/// Runs a scene as a machine of this configuration wants it rendered.
///
/// # Errors
/// If the machine stops before its end.
pub fn replay(config: &Config, scene: &Scene) -> Result<MachineReport> {
    let covered = config.render_key().shade == Shade::Covered;
    run(config, events(&Scene { covered, ..scene.clone() }))
}

/// What each unit under a heading has counted; units of all names where the heading is given none.
///
/// # Errors
/// If nothing stands there, or a unit has none of the counters: a check must not take for 0 what nothing has counted.
pub fn each<G: Group>(tree: &Tree, heading: Heading) -> Result<Vec<G>> {
    let found = heading.find(tree);
    let all = !found.is_empty() && found.iter().all(|counts| counts.has::<G>());
    ensure!(all, "the statistics have no such counters under {heading}");
    Ok(found.into_iter().map(Tree::read).collect())
}

/// What all these units have counted together.
///
/// # Errors
/// As [`each`].
pub fn counts<G: Group>(tree: &Tree, heading: Heading) -> Result<G> {
    Ok(each(tree, heading)?.into_iter().sum())
}

/// The funnel of a run.
///
/// # Errors
/// If there is none.
pub fn funnel(tree: &Tree) -> Result<Funnel> {
    counts(tree, FUNNEL)
}

/// What went through all units of a kind.
///
/// # Errors
/// If there is no such unit.
pub fn items(tree: &Tree, units: &'static str) -> Result<f64> {
    Ok(counts::<UnitCounts>(tree, UNITS.named(units))?.items as f64)
}

/// Pixels in which the pictures of a run differ from API order's.
///
/// # Errors
/// If a frame has no picture.
pub fn wrong_pixels(report: &MachineReport) -> Result<u64> {
    ensure!(!report.frames.is_empty(), "the run has no frame");
    let wrong = report.frames.iter().map(|frame| frame.picture.as_ref().map(|picture| picture.wrong_pixels));
    wrong.sum::<Option<u64>>().context("a frame has no picture")
}

/// Runs `pieces` pieces of work, as many at once as there are threads. The results are in the order of the pieces. A machine waits for its
/// renderer, so none of these threads may be one on which renderers draw.
///
/// # Errors
/// The first piece's that fails, or that a thread cannot be started. `name` is what messages call a piece.
pub fn on_threads<T: Send>(pieces: usize, name: &str, run: &(dyn Fn(usize) -> Result<T> + Sync)) -> Result<Vec<T>> {
    let next = AtomicUsize::new(0);
    let work = || {
        let mut done = Vec::new();
        loop {
            let at = next.fetch_add(1, Ordering::Relaxed);
            if at >= pieces {
                return done;
            }
            done.push((at, run(at)));
        }
    };
    let done = std::thread::scope(|scope| -> Result<BTreeMap<usize, Result<T>>> {
        let start = |_| std::thread::Builder::new().name(name.to_owned()).spawn_scoped(scope, work);
        let threads = (0..rayon::current_num_threads().min(pieces)).map(start).collect::<Result<Vec<_>, _>>();
        let threads = threads.with_context(|| format!("cannot start a thread for a {name}"))?;
        let ended = threads
            .into_iter()
            .map(|thread| thread.join().map_err(|_| anyhow!("a {name} stopped on an internal error. {OUR_FAULT}")));
        Ok(ended.collect::<Result<Vec<_>>>()?.into_iter().flatten().collect())
    })?;
    done.into_values().collect()
}
