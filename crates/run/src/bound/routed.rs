//! Passes of machines that sort primitives: routers find bounds and send each primitive to the pipelines under it, which have geometry of
//! their own.

use super::flow::{Pipeline, Rates, UNITS, later, work_of};
use super::{Bound, Roofs};
use work::profile::{Cell, Window};

/// Bytes of a primitive on the network: three numbers of vertices, and a mark.
const PRIMITIVE: f64 = 16.0;

/// A pipeline's geometry: primitives up to the end of each window, and when they were through.
#[derive(Clone, Debug, Default)]
struct Front {
    windows: Vec<[f64; 2]>,
    /// The number of windows, from the first, that have to be through before receivers have room for another.
    left: usize,
}

impl Front {
    fn last(&self) -> [f64; 2] {
        self.windows.last().copied().unwrap_or_default()
    }

    /// The time at which there was room for more primitives, if at most `waiting` primitives wait.
    fn place(&mut self, waiting: f64) -> f64 {
        let [all, _] = self.last();
        while self.windows.get(self.left).is_some_and(|window| all - window[0] > waiting) {
            self.left += 1;
        }
        if self.left == 0 { 0.0 } else { self.windows[self.left - 1][1] }
    }
}

impl Bound<'_> {
    /// Lets windows flow through routers and then through the pipelines that own what is under them. Cycles until the last is done.
    pub(super) fn routed(
        &self,
        roofs: &mut Roofs,
        rates: &[Rates],
        owners: &[Option<u8>],
        (windows, cells): (&[Window], &[Cell]),
    ) -> f64 {
        let c = self.config;
        let pipelines = c.card.pipelines as usize;
        let mut done = vec![Pipeline::default(); pipelines];
        let mut fronts = vec![Front::default(); pipelines];
        let mut sums = vec![[0.0; UNITS.len() + 2]; pipelines];
        let waiting = [f64::from(c.setup.queue), self.waiting()[1]];
        // Receivers have places for each router, and runs wait for fetch.
        let places = f64::from(c.network.receive_queue) * self.pipelines + f64::from(c.assembly.queue);
        let (mut routed, mut first, mut routing) = (0.0_f64, 0, 0.0);
        for window in windows {
            let rate = &rates[window.draw as usize];
            let primitives = f64::from(window.primitives);
            let mut work = vec![[0.0; UNITS.len()]; pipelines];
            // Triangles, quads.
            let mut given = vec![[0.0; 2]; pipelines];
            let range = first as usize..window.end as usize;
            for (cell, owner) in cells[range.clone()].iter().zip(&owners[range]) {
                let own = work_of(cell, rate);
                let (owners, part) = match *owner {
                    Some(pipeline) => (usize::from(pipeline)..usize::from(pipeline) + 1, 1.0),
                    None => (0..pipelines, 1.0 / pipelines as f64),
                };
                for at in owners {
                    work[at].iter_mut().zip(own).for_each(|(sum, cycles)| *sum += cycles * part);
                    given[at][0] += f64::from(cell.triangles) * part;
                    given[at][1] += f64::from(cell.shaded) * part;
                }
            }
            first = window.end;
            // A triangle in several tiles of one pipeline comes there once: neighbouring tiles have different owners.
            let triangles = f64::from(window.triangles);
            let tiles = given.iter().map(|given| given[0]).sum::<f64>() / triangles.max(1.0);
            let copies = if tiles > 0.0 { tiles.min(self.pipelines) / tiles } else { 1.0 };

            let place = fronts.iter_mut().map(|front| front.place(places)).fold(0.0, later);
            let begin = later(routed, place);
            let cycles = primitives * rate.route / self.pipelines;
            routed = begin + cycles;
            routing += cycles;
            for at in 0..pipelines {
                let count = (given[at][0] * copies).min(triangles);
                let pipeline = &mut done[at];
                let [all, before] = fronts[at].last();
                let from = later(later(before, begin), pipeline.place(waiting[0]));
                let to = later(from + count * rate.geometry, routed);
                fronts[at].windows.push([all + count, to]);
                let own = &mut work[at];
                // Vertices are shaded by the same cores.
                own[5] += count * rate.vertex_core;
                own[6] += count * rate.vertex_texture;
                given[at][0] = count;
                pipeline.take(given[at], [from, to], own, waiting[1], rate.shaded);
                sums[at].iter_mut().zip(own.iter()).for_each(|(sum, cycles)| *sum += cycles);
                sums[at][UNITS.len()] += count * rate.geometry;
                sums[at][UNITS.len() + 1] += count / f64::from(c.assembly.primitives_per_cycle);
            }
        }
        for (at, unit) in UNITS.into_iter().chain(["fetch", "gather"]).enumerate() {
            roofs.add(unit, sums.iter().map(|sums| sums[at]).fold(0.0, f64::max));
        }
        roofs.add("route", routing);
        let copies: f64 = fronts.iter().map(|front| front.last()[0]).fold(0.0, f64::max);
        roofs.add("network", copies * PRIMITIVE / f64::from(c.network.link_bytes) / self.pipelines);
        done.iter().map(Pipeline::written).fold(routed, f64::max)
    }
}
