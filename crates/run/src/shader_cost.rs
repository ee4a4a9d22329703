//! What shaders cost by line of their source: the instructions that each line executes in a frame, summed over all invocations.
//!
//! A rendering of the frame records the path of each invocation through its program, and each piece of a path has its instructions by line. The
//! counts are those that machines issue whose instructions work on one component.

use std::collections::BTreeMap;

use anyhow::{Result, bail};

use super::rendering::{Consumer, Rendering, Work};
use gfx::stage::Stage;
use render::{self, ConsumerMemory, FrameSet};
use trace::Trace;
use work::{CostId, CostTable, Event, QUAD_SHADED, RenderKey, Segment};

/// What a stage of a pipeline costs in a frame.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct StageCost {
    /// Invocations, with the helpers of quads.
    pub invocations: u64,
    /// Instructions of all invocations, as their costs have them.
    pub instructions: u64,
    /// The same by line of the source, from 1. Line 0 has what belongs to no line, such as what all invocations share.
    pub lines: BTreeMap<u32, u64>,
}

/// The costs of a frame by the number of the pipeline among all that the trace creates, and by stage.
pub type ShaderCosts = BTreeMap<(u64, Stage), StageCost>;

/// Counts what shaders cost in a frame.
///
/// # Errors
/// If the trace cannot be rendered, or has no such frame.
pub fn shader_costs(trace: &Trace, frame: u32) -> Result<ShaderCosts> {
    let mut found = None;
    let frames = FrameSet::from(frame..frame.saturating_add(1));
    let mut rendering = Rendering::new(trace, render::Options { frames, ..render::Options::default() });
    let out = &mut found;
    let run = move |work: Work| {
        let (mut costs, mut dispatched) = (ShaderCosts::new(), 0);
        for event in work {
            match event {
                Event::Segment(segment) => add_segment(&mut costs, &segment),
                Event::Dispatch(dispatch) => dispatched = dispatch.programs.pipeline,
                Event::Groups(groups) => {
                    let packets = groups.packets.iter().map(|packet| (packet.cost, 4));
                    add(costs.entry((dispatched, Stage::Compute)).or_default(), &groups.invocations.costs, packets);
                }
                Event::EndFrame(_) => *out = Some(std::mem::take(&mut costs)),
                _ => {}
            }
        }
        Ok(())
    };
    let consumer = Consumer { memory: ConsumerMemory::default(), recorded: true, stored: false, run: Box::new(run) };
    rendering.consume(RenderKey { paths: true, ..RenderKey::default() }, consumer);
    rendering.run()?;
    match found {
        Some(costs) => Ok(costs),
        None => bail!("the trace has {}", super::replay::no_frames(trace, &(frame..frame.saturating_add(1)))?),
    }
}

fn add_segment(costs: &mut ShaderCosts, segment: &Segment) {
    let pipeline = segment.programs.pipeline;
    let vertices = segment.vertices.iter().map(|vertex| (vertex.cost, 1));
    add(costs.entry((pipeline, Stage::Vertex)).or_default(), &segment.invocations[Stage::Vertex].costs, vertices);
    for tile in &segment.tiles {
        let quads = tile.quads.iter().filter(|quad| quad.flags & QUAD_SHADED != 0).map(|quad| (quad.cost, 4));
        add(costs.entry((pipeline, Stage::Fragment)).or_default(), &tile.invocations.costs, quads);
    }
}

/// Adds invocations: the cost of each, and how many there are.
fn add(sum: &mut StageCost, table: &CostTable, invocations: impl Iterator<Item = (CostId, u64)>) {
    let mut times = vec![0; table.costs.len()];
    for (cost, count) in invocations {
        // Without a fragment stage there are no costs.
        if let Some(times) = times.get_mut(usize::from(cost)) {
            *times += count;
        }
    }
    for (cost, times) in table.costs.iter().zip(times).filter(|(_, times)| *times > 0) {
        sum.invocations += times;
        sum.instructions += times * cost.instructions().iter().map(|&count| u64::from(count)).sum::<u64>();
        for &(line, count) in cost.path.iter().flat_map(|point| &table.spans[point.span as usize].lines) {
            *sum.lines.entry(line).or_default() += times * u64::from(count);
        }
    }
}
