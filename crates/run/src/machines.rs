//! Several machines behind one rendering, compared by their statistics and by what they show.

use std::time::Duration;

use anyhow::Result;

use super::cycle::{Simulated, simulate};
use super::frame_sink::{Frame, FrameSink};
use super::rendering::Rendering;
use machine::Config;
use num::Cycle;
use render;
use sim::Clock;
use stats::Tree;
use trace::Trace;
use work::Surface;

/// The picture of a frame, without its bytes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Shown {
    /// The frame.
    pub number: u32,
    /// The shown surface, and the hash of its bytes.
    pub picture: Option<(Surface, blake3::Hash)>,
}

impl Shown {
    /// The picture of frame `number`.
    pub fn new(number: u32, picture: Option<(Surface, &[u8])>) -> Shown {
        Shown { number, picture: picture.map(|(surface, bytes)| (surface, blake3::hash(bytes))) }
    }
}

/// The result of a machine.
#[derive(Clone, Debug, Default)]
pub struct Ran {
    /// The pictures of its frames, in order.
    pub shown: Vec<Shown>,
    /// Cycles.
    pub cycles: Cycle,
    /// Statistics over all frames.
    pub total: Tree,
    /// Host time in the machine (processor time where the system has it).
    pub machine_time: Duration,
}

/// Runs machines on a trace, which is rendered once for all that ask for the same work. They compute one at a time and by turns, so that what else
/// the host does is spread over all of them.
///
/// # Errors
/// If the trace cannot be rendered, or a machine stops.
pub fn run(trace: &Trace, machines: &[(&Config, Clock)]) -> Result<Vec<Ran>> {
    let mut shown: Vec<Vec<Shown>> = vec![Vec::new(); machines.len()];
    let mut simulated: Vec<Simulated> = vec![Simulated::default(); machines.len()];
    let mut rendering = Rendering::new(trace, render::Options::default());
    rendering.one_at_a_time();
    for ((&machine, shown), out) in machines.iter().zip(&mut shown).zip(&mut simulated) {
        let sink = FrameSink::new(|frame: Frame| {
            shown.push(Shown::new(frame.number, frame.shown.as_ref().map(|(surface, bytes)| (*surface, &bytes[..]))));
            Ok(())
        });
        simulate(&mut rendering, machine, sink, out)?;
    }
    rendering.run()?;
    let ran = |(shown, Simulated { cycles, total, machine_time, .. })| Ran { shown, cycles, total, machine_time };
    Ok(shown.into_iter().zip(simulated).map(ran).collect())
}
