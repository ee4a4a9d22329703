//! The `cycle` fidelity: a machine that reads the work of a rendering.

use std::cell::Cell;
use std::time::Duration;

use anyhow::Result;

use super::frame_sink::FrameSink;
use super::host::Stopwatch;
use super::rendering::{Consumer, Rendering, Work};
use machine::{Config, FrameReport, Machine, Shown, Watcher};
use num::Cycle;
use render::ConsumerMemory;
use sim::Clock;
use stats::Tree;

/// The results of simulated frames.
#[derive(Clone, Debug, Default)]
pub struct Simulated {
    /// Cycles.
    pub cycles: Cycle,
    /// Statistics over all frames.
    pub total: Tree,
    /// Host time in the machine (processor time where the system has it).
    pub machine_time: Duration,
    /// That part of it in which a machine was only warmed, for the runs of frames to begin with.
    pub warming_time: Duration,
    /// The refreshes of a free-running display since the last frame ended.
    pub display: Shown,
}

/// Adds a machine to a rendering.
///
/// # Errors
/// If knobs do not fit each other.
pub fn simulate<'r>(
    rendering: &mut Rendering<'r>,
    (config, clock): (&'r Config, Clock),
    mut sink: FrameSink<'r>,
    out: &'r mut Simulated,
) -> Result<()> {
    let mut machine = Machine::new(config)?.within(rendering.limits());
    if sink.per_draw {
        machine.watch_draws();
    }
    let memory = ConsumerMemory { images: Machine::images(config), pieces: Machine::pieces(config), frames: sink.keeps };
    let run = move |work: Work| {
        let busy = Stopwatch::start();
        let (closed, mut failed) = (Cell::new(false), None);
        let mut watcher = sink.watcher.take();
        let watcher = watcher.as_deref_mut().map(|watcher| watcher as &mut dyn Watcher);
        let each = |frame: FrameReport| {
            if failed.is_some() {
                return;
            }
            failed = sink.put(frame.into()).err();
            closed.set(failed.is_some());
        };
        let run = machine.run_watched(work.take_while(|_| !closed.get()), clock, each, watcher);
        let machine_time = busy.elapsed();
        // A machine that lost its input has nothing to add.
        if let Some(failed) = failed {
            return Err(failed);
        }
        let run = run?;
        *out = Simulated { cycles: run.cycles, total: run.total, machine_time, display: run.shown, ..Simulated::default() };
        Ok(())
    };
    rendering.consume(config.render_key(), Consumer { memory, recorded: true, stored: false, run: Box::new(run) });
    Ok(())
}
