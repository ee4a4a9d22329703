//! The estimates of frames as a replay has them: one reader of profiles.

use std::time::Duration;

use anyhow::Result;

use super::{Bound, FrameEstimate, Traffic};
use crate::frame_sink::{Frame, FrameSink, reference};
use crate::functional;
use crate::host::Stopwatch;
use crate::profiles::{Profiled, Reader};
use crate::rendering::{Consumer, Rendering, Work};
use machine::{Config, Machine, PhaseReport};
use mem::{CACHES, CacheCounts, DRAM, DramCounts};
use render::ConsumerMemory;
use stats::{FrameCounts, Group, SECONDS, Tree, counter};
use work::profile::Profiler;
use work::{Event, Funnel};

/// The sum of the estimates of phases, over a frame or over all frames.
#[derive(Clone, Debug, Default)]
pub struct Estimated {
    /// Cycles.
    pub cycles: f64,
    /// The counts of the stages.
    pub funnel: Funnel,
    /// The traffic of the second-level cache and of DRAM.
    pub memory: Traffic,
    /// Lookups of the first-level texture caches by fragments, and misses.
    pub textures: [f64; 2],
    /// Host time of the estimates.
    pub time: Duration,
}

impl Estimated {
    /// Phase by phase, so that the sum over all frames does not depend on where one ends.
    fn add(&mut self, estimate: &FrameEstimate) {
        for phase in &estimate.phases {
            self.cycles += phase.cycles;
            self.memory += phase.memory;
            self.textures = [0, 1].map(|side: usize| self.textures[side] + phase.textures[side]);
        }
    }

    /// As statistics.
    pub fn tree(&self, config: &Config) -> Tree {
        let mut tree = Tree::new();
        tree.extend(FrameCounts { cycles: self.cycles.round() as u64 }.tree());
        tree.real(SECONDS.name, config.seconds(self.cycles));
        tree.extend(functional::tree(&self.funnel));
        let dram = DRAM.at(&mut tree, 0);
        counter!(DramCounts, read_bytes).put(dram, self.memory.read.round() as u64);
        counter!(DramCounts, write_bytes).put(dram, self.memory.written.round() as u64);
        let [lookups, misses] = self.textures;
        for (name, lookups, misses) in [("texture", lookups, misses), ("l2", self.memory.lookups, self.memory.misses)] {
            let [lookups, misses] = [lookups, misses].map(|n| n.round() as u64);
            // All pipelines' caches, and all slices, as one.
            let counts = CACHES.named(name).at(&mut tree, 0);
            counter!(CacheCounts, accesses).put(counts, lookups);
            counter!(CacheCounts, hits).put(counts, lookups.saturating_sub(misses));
            counter!(CacheCounts, misses).put(counts, misses);
        }
        tree
    }
}

/// Frames of which it is estimated what limits their phases.
const LIMITED: usize = 4;

/// Adds to a rendering that is simulated what limits the phases of its first frames by estimate. Nothing, where no rates are known of the
/// configuration.
pub fn limits<'r>(rendering: &mut Rendering<'r>, config: &'r Config, out: &'r mut Vec<Vec<PhaseReport>>) {
    let Ok(mut bound) = Bound::new(config) else { return };
    // No more pieces than the machine has that they are simulated on.
    let memory = ConsumerMemory { pieces: Machine::pieces(config), ..ConsumerMemory::default() };
    let run = move |work: Work| {
        let mut profiler = if bound.deals() { Profiler::default() } else { Profiler::default().whole() };
        let mut waiting = Vec::new();
        for event in work {
            let ends = matches!(event, Event::EndFrame(_));
            waiting.push(event);
            // A frame's work waits for its end, if there is not too much of it: before that all processors render.
            if !ends && (waiting.len() as u64) < memory.pieces {
                continue;
            }
            let profile = waiting.drain(..).filter_map(|event| profiler.event(&event)).last();
            out.extend(profile.map(|profile| bound.frame(&profile).phases()));
            if out.len() == LIMITED {
                break;
            }
        }
        Ok(())
    };
    rendering.consume(config.render_key(), Consumer { memory, recorded: true, stored: true, run: Box::new(run) });
}

/// Adds estimates for a configuration to a rendering.
///
/// # Errors
/// If a knob has an effect that is not estimated.
pub fn estimate<'r>(
    rendering: &mut Rendering<'r>,
    config: &'r Config,
    mut sink: FrameSink<'r>,
    sum: &'r mut Estimated,
) -> Result<()> {
    let mut bound = Bound::new(config)?;
    let keeps = sink.keeps;
    let read = move |frames: &[Profiled]| {
        let watch = Stopwatch::start();
        let estimates: Vec<FrameEstimate> = frames.iter().map(|frame| bound.frame(&frame.profile)).collect();
        sum.time += watch.elapsed();
        for (estimate, Profiled { end, funnel, .. }) in estimates.into_iter().zip(frames) {
            let mut own = Estimated { funnel: *funnel, ..Estimated::default() };
            own.add(&estimate);
            sum.funnel += *funnel;
            sum.add(&estimate);
            let tree = own.tree(config);
            sink.put(Frame {
                number: end.number,
                shown: reference(end),
                tree,
                phases: estimate.phases(),
                display: Default::default(),
            })?;
        }
        Ok(())
    };
    rendering.profile(config.render_key(), Reader { keeps, read: Box::new(read) });
    Ok(())
}
