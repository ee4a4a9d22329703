//! Composition: when a pass is drawn, the copies of its attachments in which pipelines have drawn become one.

use super::memory::Traffic;
use super::{Bound, compressed};
use unit::compose::steps;
use unit::compression::Codec;
use work::profile::{APART, AttachmentProfile, DrawProfile};
use work::{BLOCK, LINE};

/// Lines from a surface to the first copy of it in the cache in miniature, and from that to the next one's. More than surfaces have: a copy is
/// followed with its surface.
const COPY: u64 = 1 << 32;

/// Samples of a pixel that has several: what traces have.
const SAMPLES: f64 = 4.0;

/// The first line of a pipeline's copy of what lies there.
pub(super) fn copy(line: u32, pipeline: u32) -> u64 {
    u64::from(line) + COPY * (u64::from(pipeline) + 1)
}

/// The pipelines that draw into a block, where `copies` pipelines draw into each block on average. They follow each other in number.
pub(super) fn drawn_by(block: u32, copies: f64, pipelines: u32) -> impl Iterator<Item = u32> {
    let before = |block: u32| (f64::from(block) * copies) as u32;
    (0..before(block + 1) - before(block)).map(move |at| (block + at) % pipelines)
}

/// The cost of composing a pass.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Composed {
    /// Cycles in all, and those of the units without memory.
    pub cycles: f64,
    pub units: f64,
    /// The traffic of the second level.
    pub traffic: Traffic,
}

/// An attachment that is composed.
struct Plane {
    line: u32,
    /// Bytes of a block; of one that a ROP has written; of one that was composed.
    raw: u64,
    drawn: u64,
    composed: u64,
    /// Blocks that no pipeline has written are in memory.
    loads: bool,
    stores: bool,
}

impl Bound<'_> {
    /// How many pipelines draw into a block that any of them draws into, on average.
    pub(super) fn copies(&self, copies: &[u64; APART.len()]) -> f64 {
        if copies[0] == 0 {
            return 1.0;
        }
        let each = copies.map(|n| n as f64 / copies[0] as f64);
        let at = (libm::log2(self.pipelines) / 2.0).min((APART.len() - 1) as f64);
        let below = (at as usize).min(APART.len() - 2);
        (each[below] + (each[below + 1] - each[below]) * (at - below as f64)).clamp(1.0, self.pipelines)
    }

    /// Composes the copies of a pass: `drawn` of its blocks are drawn, each in `copies` copies on average.
    pub(super) fn composed(
        &mut self,
        draws: &[DrawProfile],
        (color, depth): (&[AttachmentProfile], Option<&AttachmentProfile>),
        size: [u32; 2],
        [drawn, copies]: [f64; 2],
    ) -> Composed {
        let c = self.config;
        let pipelines = c.card.pipelines;
        if pipelines < 2 {
            return Composed::default();
        }
        let depth = depth.filter(|_| draws.iter().any(|draw| draw.writes_depth));
        let plane = |attachment: &AttachmentProfile, codec: Option<Codec>| {
            let whole = |codec| (attachment.block_bytes as f64 * compressed(attachment, codec)) as u64;
            Plane {
                line: attachment.line,
                raw: attachment.block_bytes,
                drawn: whole(codec),
                composed: whole(self.composed_codec()),
                loads: attachment.loads || !c.color.fast_clear,
                stores: attachment.stores,
            }
        };
        let mut planes: Vec<Plane> =
            color.iter().filter(|target| target.stores).map(|target| plane(target, self.color_codec())).collect();
        planes.extend(depth.map(|depth| plane(depth, self.depth_codec())));
        let across = size[0].div_ceil(BLOCK);
        let blocks = across * size[1].div_ceil(BLOCK);
        if planes.is_empty() || blocks == 0 {
            return Composed::default();
        }
        // The part of all blocks that a pipeline has drawn into.
        let part = (drawn * copies / f64::from(pipelines) / f64::from(blocks)).min(1.0);
        let pixels = f64::from(size[0]) * f64::from(size[1]) / f64::from(blocks);
        // Bytes of a pixel on the network: all its samples, each with the number of the primitive that wrote it.
        let sample: f64 = planes.iter().map(|plane| plane.raw as f64).sum::<f64>() / f64::from(BLOCK * BLOCK);
        let multisampled = color.iter().chain(depth).any(|attachment| attachment.multisampled);
        let multiplied = if multisampled { SAMPLES } else { 1.0 };
        let numbers = f64::from(c.compose.number_bytes) * multiplied;
        let port = f64::from(c.memory.port_width);

        let plans: Vec<_> =
            (0..pipelines).map(|node| steps(c.compose.scheme, node as usize, pipelines as usize, blocks)).collect();
        let rounds = plans.iter().map(Vec::len).max().unwrap_or(0);
        let mut composed = Composed::default();
        // Blocks that a node has composed before.
        let mut whole = vec![0..0_u32; pipelines as usize];
        for round in 0..rounds {
            let mut slowest = 0.0_f64;
            let mut traffic = Traffic::default();
            let longest = plans.iter().filter_map(|plan| plan.get(round));
            let longest =
                longest.flat_map(|step| step.send.iter().chain(&step.receive)).map(|run| run.1.len()).max().unwrap_or(0);
            let mut moved = vec![[0.0; 2]; pipelines as usize];
            for at in 0..longest as u32 {
                for (node, plan) in (0..).zip(&plans) {
                    let Some(step) = plan.get(round) else { continue };
                    let read = step.send.iter().filter(|_| !step.forward).chain(&step.receive);
                    for block in read.filter_map(|run| run.1.clone().nth(at as usize)) {
                        for plane in &planes {
                            let line = plane.line + (u64::from(block) * plane.raw / LINE) as u32;
                            let composed = whole[node as usize].contains(&block);
                            let read = if plane.loads { 1.0 } else { part } * plane.drawn as f64;
                            moved[node as usize][0] += if composed { plane.composed as f64 } else { read };
                            // Copies are followed with the surface.
                            if !self.shared.follows_any(line) {
                                continue;
                            }
                            let own = || drawn_by(block, copies, pipelines).any(|own| own == node);
                            let (line, bytes) = if composed {
                                (copy(line, node), plane.composed)
                            } else if self.drawn.contains(&line) && own() {
                                (copy(line, node), plane.drawn)
                            } else if plane.loads {
                                (u64::from(line), plane.drawn)
                            } else {
                                continue;
                            };
                            traffic += self.shared.access(line, bytes, false);
                        }
                    }
                    let Some(block) = step.receive.as_ref().and_then(|run| run.1.clone().nth(at as usize)) else { continue };
                    for plane in planes.iter().filter(|plane| !step.forward && (plane.stores || !step.last)) {
                        let line = plane.line + (u64::from(block) * plane.raw / LINE) as u32;
                        moved[node as usize][1] += plane.composed as f64;
                        if self.shared.follows_any(line) {
                            let line = if step.last { u64::from(line) } else { copy(line, node) };
                            traffic += self.shared.access(line, plane.composed, true);
                        }
                    }
                }
            }
            let latency = self.latency(&traffic);
            for (node, plan) in plans.iter().enumerate() {
                let Some(step) = plan.get(round) else { continue };
                let count = |run: &Option<(usize, std::ops::Range<u32>)>| run.as_ref().map_or(0.0, |run| run.1.len() as f64);
                let [read, written] = moved[node];
                let sent = count(&step.send).max(count(&step.receive)) * pixels * (sample + numbers);
                let taken = count(&step.receive) * pixels * multiplied / f64::from(c.compose.samples_per_cycle);
                let units = [
                    sent / f64::from(c.network.link_bytes),
                    taken,
                    read.max(written) / port,
                    self.in_flight(read, c.compose.misses, latency),
                ];
                slowest = units.into_iter().fold(slowest, f64::max);
                if let Some((_, run)) = step.receive.as_ref().filter(|_| !step.last) {
                    whole[node] = run.clone();
                }
            }
            composed.units += slowest;
            composed.cycles += slowest.max(self.dram(&traffic)) + latency + f64::from(c.network.link_latency);
            composed.traffic += traffic;
        }
        composed
    }
}

#[cfg(test)]
mod tests {
    use super::drawn_by;

    #[test]
    fn blocks_are_drawn_in_as_many_copies_as_told_by_pipelines_that_differ() {
        for copies in [1.0, 1.3, 2.75, 4.0] {
            let of = |block: u32| drawn_by(block, copies, 4).collect::<Vec<u32>>();
            let all: Vec<Vec<u32>> = (0..400).map(of).collect();
            assert_eq!(all.iter().map(Vec::len).sum::<usize>(), (400.0 * copies) as usize);
            for own in &all {
                let bits = own.iter().fold(0_u32, |bits, pipeline| bits | 1 << pipeline);
                assert!((1..=4).contains(&own.len()) && bits.count_ones() as usize == own.len() && bits < 16, "{own:?}");
            }
        }
    }
}
