//! What shader invocations cost.

use super::super::{Class, Cost, QUAD_SHADED, Request, RequestKind, Step, TileWork};

/// What shader invocations cost, summed up: an entry a vertex, a quad, or four invocations of a workgroup.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShaderProfile {
    /// Vertices, quads or packets.
    pub runs: u64,
    /// Instructions by class, summed over the runs.
    pub instructions: [u64; Class::COUNT],
    /// Texture requests.
    pub textures: u64,
    /// Their filter operations,
    pub operations: u64,
    /// and lines looked up.
    pub texture_lines: u64,
    /// Loads, stores and atomics.
    pub accesses: u64,
    /// Their lines.
    pub access_lines: u64,
}

impl ShaderProfile {
    /// Adds a run.
    pub(super) fn add(&mut self, cost: &Cost, requests: &[Request]) {
        self.add_cost(cost, 1);
        self.add_requests(asking(cost), requests);
    }

    /// Adds the shaded quads of a tile.
    pub(super) fn add_tile(&mut self, tile: &TileWork) {
        // 1. Costs, of which there are few, times the quads that have them.
        let mut runs = vec![0_u64; tile.costs.costs.len()];
        let shaded = || tile.quads.iter().filter(|quad| quad.flags & QUAD_SHADED != 0);
        shaded().for_each(|quad| runs[usize::from(quad.cost)] += 1);
        for (cost, &runs) in tile.costs.costs.iter().zip(&runs) {
            self.add_cost(cost, runs);
        }
        // 2. Requests: what they ask differs from quad to quad.
        let textures = |cost: &Cost| asking(cost).all(|step| step.then == RequestKind::Texture);
        if tile.costs.costs.iter().all(textures) {
            self.textures += tile.requests.len() as u64;
            for request in &tile.requests {
                self.operations += u64::from(request.operations);
                self.texture_lines += u64::from(request.lines);
            }
            return;
        }
        for quad in shaded() {
            self.add_requests(asking(&tile.costs[quad.cost]), &tile.requests[quad.first_request as usize..]);
        }
    }

    fn add_cost(&mut self, cost: &Cost, runs: u64) {
        self.runs += runs;
        for (sum, n) in self.instructions.iter_mut().zip(cost.instructions()) {
            *sum += u64::from(n) * runs;
        }
    }

    fn add_requests<'c>(&mut self, asking: impl Iterator<Item = &'c Step>, requests: &[Request]) {
        for (step, request) in asking.zip(requests) {
            if step.then == RequestKind::Texture {
                self.textures += 1;
                self.operations += u64::from(request.operations);
                self.texture_lines += u64::from(request.lines);
            } else {
                self.accesses += 1;
                self.access_lines += u64::from(request.lines);
            }
        }
    }

    /// All requests to memory.
    pub fn requests(&self) -> u64 {
        self.textures + self.accesses
    }
}

/// The steps of a cost that ask memory.
pub(super) fn asking(cost: &Cost) -> impl Iterator<Item = &Step> {
    cost.steps.iter().filter(|step| step.then.has_request())
}
