//! Passes of machines that deal batches of primitives to pipelines with geometry of their own, which draw them wherever they lie: those
//! that sort fragments, and those that sort images.

use super::flow::{Pipeline, Rates, UNITS, Work, later, traversal, work_of};
use super::{Bound, Roofs};
use machine::class::Sorted;
use unit::assembly::Deal;
use unit::deal::most_groups;
use unit::network::Topology;
use unit::sorting::Keep;
use work::profile::{APART, ApartProfile, Cell, DrawProfile, Window};

/// Bytes of a quad's position, coverage and depths.
const QUAD: f64 = 24.0;

/// Groups of quads that dealing expects of a block in a triangle's bounds: half of its four.
const GROUPS: f64 = 2.0;

/// The place of traversal in [`UNITS`].
const TRAVERSE: usize = 1;

/// Places of units in [`UNITS`] that are behind the network where fragments are sorted.
const DEPTH: usize = 2;
const COLOR: usize = UNITS.len() - 1;

/// The part of a draw's quads that is shaded, and the part of its blocks that is not hidden whole, where `pipelines` pipelines draw apart.
pub(super) fn visible(apart: &ApartProfile, pipelines: f64) -> [f64; 2] {
    let part = |left: &[u64; APART.len()], all: u64| {
        if all == 0 {
            return 1.0;
        }
        let parts = left.map(|n| n as f64 / all as f64);
        let at = (libm::log2(pipelines) / 2.0).min((APART.len() - 1) as f64);
        let below = (at as usize).min(APART.len() - 2);
        parts[below] + (parts[below + 1] - parts[below]) * (at - below as f64)
    };
    [part(&apart.shaded, apart.quads), part(&apart.seen, apart.blocks)]
}

/// A ROP that takes what pipelines send in the order of batches.
#[derive(Clone, Copy, Debug, Default)]
struct Rop {
    /// The time at which it was done with the last batch.
    done: f64,
    sum: [f64; 3],
}

impl Bound<'_> {
    /// The groups of quads at which batches end that are dealt to pipelines; infinite where size does not matter.
    fn most_groups(&self) -> f64 {
        let c = self.config;
        if c.assembly.by_size && c.assembly.deal != Deal::Contiguous && c.card.pipelines > 1 {
            f64::from(most_groups(c.network.receive_queue, c.dispatch.reorder, c.core.warp_width))
        } else {
            f64::INFINITY
        }
    }

    /// The groups of quads that dealing expects of a primitive of a draw on average: one for each triangle, and what half of their bounds holds.
    pub(super) fn expected(&self, draw: &DrawProfile) -> f64 {
        (draw.triangles as f64 + GROUPS * draw.bins[1][0] as f64) / draw.primitives.max(1) as f64
    }

    /// The pipelines that draw a draw's blocks apart from each other: one where primitives are so large that each pipeline draws its own tiles of them.
    fn apart(&self, draw: &DrawProfile) -> f64 {
        if self.sorted == Sorted::Images && self.expected(draw) <= self.most_groups() { self.pipelines } else { 1.0 }
    }

    /// Copies that a block of a pass is drawn in on average: `several` where all primitives are drawn by one pipeline each.
    pub(super) fn copies_of(&self, draws: &[DrawProfile], several: f64) -> f64 {
        let blocks = |draw: &DrawProfile| draw.apart.blocks as f64;
        let apart: f64 = draws.iter().filter(|draw| self.apart(draw) > 1.0).map(blocks).sum();
        1.0 + (several - 1.0) * apart / draws.iter().map(blocks).sum::<f64>().max(1.0)
    }

    /// Primitives of a batch, where each makes `groups` groups of quads.
    pub(super) fn batch_of(&self, groups: f64) -> f64 {
        let batch = f64::from(self.config.assembly.batch);
        (self.most_groups() / groups.max(1.0)).min(batch).floor().max(1.0)
    }

    /// The part of the covered blocks of a pass that is not hidden whole where it is tested.
    pub(super) fn shown(&self, draws: &[DrawProfile]) -> f64 {
        let blocks = |draw: &DrawProfile| draw.apart.blocks as f64;
        let open: f64 = draws.iter().map(|draw| visible(&draw.apart, self.apart(draw))[1] * blocks(draw)).sum();
        let all: f64 = draws.iter().map(blocks).sum();
        if all > 0.0 { open / all } else { 1.0 }
    }

    /// Lets windows flow through pipelines to which their batches are dealt. Where fragments are sorted, each ROP takes batch after batch, so
    /// that a pipeline whose turn it is not yet goes on only as far as it can hold what it has drawn.
    pub(super) fn dealt(
        &mut self,
        roofs: &mut Roofs,
        (draws, rates): (&[DrawProfile], &[Rates]),
        owners: &[Option<u8>],
        (windows, cells): (&[Window], &[Cell]),
    ) -> f64 {
        let c = self.config;
        let pipelines = c.card.pipelines as usize;
        let most = self.most_groups();
        let fragments = self.sorted == Sorted::Fragments;
        let ordered = fragments && c.order.keep == Keep::Always;
        let waiting = [f64::from(c.setup.queue), self.waiting()[1]];
        // Quads that are shaded or being shaded, in order.
        let reorder = f64::from(c.dispatch.reorder * c.core.warp_width / 4);
        let seen: Vec<[f64; 2]> = draws.iter().map(|draw| visible(&draw.apart, self.apart(draw))).collect();
        let link = f64::from(c.network.link_bytes);
        let all: f64 = windows.iter().map(|window| f64::from(window.primitives)).sum();

        let mut done = vec![Pipeline::default(); pipelines];
        let mut geometry = vec![0.0_f64; pipelines];
        let mut sums = vec![[0.0; UNITS.len()]; pipelines];
        let mut sent = vec![0.0; pipelines];
        let mut rops = vec![Rop::default(); pipelines];
        // When all up to a batch has been sent and taken; primitives of the open batch, and those before the window in the pass.
        let (mut turn, mut first, mut within, mut before) = (0.0_f64, 0, 0.0, 0.0);
        // When the turn of the current batch came, and its quads so far.
        let (mut opened, mut drawn) = (0.0, 0.0);
        for window in windows {
            let rate = &rates[window.draw as usize];
            if window.begins {
                // The fence of the segment before has a number of its own.
                self.turn += u64::from(within > 0.0) + 1;
                within = 0.0;
            }
            let draw = &draws[window.draw as usize];
            let [shown, open] = seen[window.draw as usize];
            let quad = QUAD + 4.0 * draw.payload as f64;
            // 1. The work of the window in a pipeline, and in each ROP.
            let mut work: Work = [0.0; UNITS.len()];
            let mut behind = vec![[0.0; 3]; pipelines];
            let mut parts = vec![([0.0; UNITS.len()], [0.0; 2]); pipelines];
            let (mut shaded, mut groups, mut expected) = (0.0, 0.0, f64::from(window.triangles));
            let range = first as usize..window.end as usize;
            for (cell, owner) in cells[range.clone()].iter().zip(&owners[range]) {
                let mut own = work_of(cell, rate);
                let (owned, part) = match *owner {
                    Some(pipeline) => (usize::from(pipeline)..usize::from(pipeline) + 1, 1.0),
                    None => (0..pipelines, 1.0 / pipelines as f64),
                };
                let quads = f64::from(cell.shaded) * if fragments { 1.0 } else { shown };
                if fragments {
                    let colors = later(quads * shown * rate.color, f64::from(cell.pins) * open * rate.color_block);
                    let taken = quads / f64::from(c.dispatch.output_quads);
                    let rop = [later(taken, quads * quad / link), own[DEPTH], colors];
                    (own[DEPTH], own[COLOR]) = (0.0, 0.0);
                    for at in owned.clone() {
                        behind[at].iter_mut().zip(rop).for_each(|(sum, cycles)| *sum += cycles * part);
                    }
                } else {
                    let hidden = if c.traverse.hierarchical_z { open } else { 1.0 };
                    own[TRAVERSE] = traversal(cell, rate, hidden);
                    own[DEPTH] *= hidden;
                    own[DEPTH + 1..].iter_mut().for_each(|cycles| *cycles *= shown);
                }
                shaded += quads;
                for at in owned {
                    let (work, given) = &mut parts[at];
                    work.iter_mut().zip(own).for_each(|(sum, cycles)| *sum += cycles * part);
                    given[0] += f64::from(cell.triangles) * part;
                    given[1] += quads * part;
                }
                groups += f64::from(cell.groups);
                expected += GROUPS * f64::from(cell.tested);
                work.iter_mut().zip(own).for_each(|(sum, cycles)| *sum += cycles);
            }
            // Receivers have places for some groups of each sender.
            let held = reorder + f64::from(c.network.receive_queue) * shaded / later(groups, 1.0);
            first = window.end;
            // 2. Its batches, each with its share of the window.
            let primitives = f64::from(window.primitives);
            let batch = self.batch_of(expected / primitives.max(1.0));
            if expected / primitives.max(1.0) > most {
                // Too large for one pipeline: each draws its own tiles of them.
                let mut ended = turn;
                for (at, (own, given)) in parts.iter().enumerate() {
                    let begin = later(geometry[at], done[at].place(waiting[0]));
                    geometry[at] = begin + primitives * rate.geometry;
                    let mut own = *own;
                    own[DEPTH + 3] += primitives * rate.vertex_core;
                    own[DEPTH + 4] += primitives * rate.vertex_texture;
                    done[at].take(*given, [begin, geometry[at]], &own, waiting[1], rate.shaded);
                    sums[at].iter_mut().zip(own).for_each(|(sum, cycles)| *sum += cycles);
                    if fragments {
                        sent[at] += given[1] * quad / link;
                        let (rop, behind) = (&mut rops[at], &behind[at]);
                        let end = done[at].written();
                        rop.done = later(
                            later(rop.done, if ordered { turn } else { 0.0 }) + behind.iter().copied().fold(0.0, later),
                            end,
                        );
                        rop.sum.iter_mut().zip(behind).for_each(|(sum, cycles)| *sum += cycles);
                        ended = later(ended, end);
                        if ordered {
                            done[at].hold(end, rop.done);
                        }
                    }
                }
                self.turn += u64::from(within > 0.0) + (primitives / f64::from(c.assembly.batch)).ceil() as u64;
                (turn, within) = (if ordered { ended } else { turn }, 0.0);
                before += primitives;
                continue;
            }
            let mut left = primitives;
            while left > 0.0 {
                let room = (batch - within).max(1.0);
                let count = room.min(left);
                let at = match c.assembly.deal {
                    Deal::Turn => self.turn as usize % pipelines,
                    Deal::Least => (0..pipelines).fold(0, |least, at| if geometry[at] < geometry[least] { at } else { least }),
                    Deal::Contiguous => (((before + 0.5 * count) / all * self.pipelines) as usize).min(pipelines - 1),
                };
                let part = count / primitives;
                let place = done[at].place(waiting[0]);
                let begin = later(geometry[at], place);
                geometry[at] = begin + count * rate.geometry;
                let mut own = work.map(|cycles| cycles * part);
                // Vertices are shaded by the same cores.
                own[DEPTH + 3] += count * rate.vertex_core;
                own[DEPTH + 4] += count * rate.vertex_texture;
                let quads = shaded * part;
                if within == 0.0 {
                    (opened, drawn) = (turn, 0.0);
                }
                let given = [f64::from(window.triangles) * part, quads];
                done[at].take(given, [begin, geometry[at]], &own, waiting[1], rate.shaded);
                sums[at].iter_mut().zip(own).for_each(|(sum, cycles)| *sum += cycles);
                if fragments {
                    sent[at] += quads * quad / link;
                    let slowest = own.iter().copied().fold(0.0, later);
                    let mut end = done[at].written();
                    let mut begin = 0.0;
                    if ordered {
                        // Quads of a batch beyond those that the pipeline can hold are shaded when the batch's turn has come.
                        let over = drawn + quads - held;
                        if over > 0.0 {
                            end = later(end, opened + over * slowest / quads.max(over) + rate.shaded);
                        }
                        begin = turn;
                    }
                    let mut taken = end;
                    for (rop, behind) in rops.iter_mut().zip(&behind) {
                        let cycles = behind.iter().copied().fold(0.0, later) * part;
                        rop.done = later(later(rop.done, begin) + cycles, end);
                        rop.sum.iter_mut().zip(behind).for_each(|(sum, cycles)| *sum += cycles * part);
                        taken = later(taken, rop.done);
                    }
                    if ordered {
                        done[at].hold(end, taken);
                        turn = later(turn, end);
                    }
                }
                drawn += quads;
                within += count;
                before += count;
                left -= count;
                if within >= batch {
                    self.turn += 1;
                    within = 0.0;
                }
            }
        }
        self.turn += 2;
        for (at, unit) in UNITS.into_iter().enumerate() {
            roofs.add(unit, sums.iter().map(|sums| sums[at]).fold(0.0, f64::max));
        }
        if fragments {
            for (at, unit) in ["order", UNITS[DEPTH], UNITS[COLOR]].into_iter().enumerate() {
                roofs.add(unit, rops.iter().map(|rop| rop.sum[at]).fold(0.0, f64::max));
            }
            let carried = match c.network.topology {
                Topology::PointToPoint => 0.0,
                Topology::Bus => sent.iter().sum(),
                _ => sent.iter().copied().fold(0.0, f64::max),
            };
            roofs.add("network", carried);
        }
        let last = done.iter().map(Pipeline::written).chain(geometry).fold(0.0, f64::max);
        rops.iter().map(|rop| rop.done).fold(last, f64::max)
    }
}
