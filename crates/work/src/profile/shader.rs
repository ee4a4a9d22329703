//! What shader invocations cost.

use super::super::{
    Class, Cost, Groups, InFlight, Invocations, LINE, Packet, QUAD_SHADED, Request, RequestKind, Service, Step, TileWork,
};

/// What shader invocations cost, summed up: an entry per vertex, a quad, or four invocations of a workgroup.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ShaderProfile {
    /// Vertices, quads or packets.
    pub runs: u64,
    /// Instructions by class, summed over the runs.
    pub instructions: [u64; Class::COUNT],
    /// Those of the longest chains of their steps.
    pub chain: [u64; Class::COUNT],
    /// Texture requests.
    pub textures: u64,
    /// Filter operations of texture requests by [`Request::rate`].
    pub operations: [u64; Request::RATES],
    /// Lines that texture requests look up.
    pub texture_lines: u64,
    /// Steps before which a run waits for requests, where it goes on until it needs a result.
    pub stops: u64,
    /// Those before which it waits for loads from uniform buffers alone.
    pub constant_stops: u64,
    /// Accesses to workgroup memory.
    pub shared: u64,
    /// Cycles that 32 banks of 4 bytes take for those of [`TOGETHER`] runs.
    pub shared_cycles: u64,
    /// Loads, stores and atomics, without loads from uniform buffers.
    pub accesses: u64,
    /// Their lines.
    pub access_lines: u64,
    /// Pieces of [`PIECE`] bytes that they have in common with those beside them, counted once for [`TOGETHER`] runs.
    pub access_pieces: u64,
    /// Loads from uniform buffers.
    pub constants: u64,
    /// Lines of the loads from uniform buffers.
    pub constant_lines: u64,
    /// Pieces of the loads from uniform buffers, counted as those of accesses.
    pub constant_pieces: u64,
}

/// Runs of four invocations that ask at once: a warp of 32.
pub const TOGETHER: usize = 8;

/// Bytes of the pieces of memory that accesses of a warp have in common.
pub const PIECE: u64 = 128;

/// Banks of workgroup memory.
const BANKS: usize = 32;

impl std::ops::AddAssign for ShaderProfile {
    fn add_assign(&mut self, other: ShaderProfile) {
        fn all<const N: usize>(sums: &mut [u64; N], others: [u64; N]) {
            sums.iter_mut().zip(others).for_each(|(sum, other)| *sum += other);
        }
        self.runs += other.runs;
        all(&mut self.instructions, other.instructions);
        all(&mut self.chain, other.chain);
        self.textures += other.textures;
        all(&mut self.operations, other.operations);
        self.texture_lines += other.texture_lines;
        self.stops += other.stops;
        self.constant_stops += other.constant_stops;
        self.shared += other.shared;
        self.shared_cycles += other.shared_cycles;
        self.accesses += other.accesses;
        self.access_lines += other.access_lines;
        self.access_pieces += other.access_pieces;
        self.constants += other.constants;
        self.constant_lines += other.constant_lines;
        self.constant_pieces += other.constant_pieces;
    }
}

impl ShaderProfile {
    /// Adds a run.
    pub(super) fn add(&mut self, cost: &Cost, requests: &[Request]) {
        self.add_cost(cost, 1);
        self.add_requests(asking(cost), requests);
    }

    /// Adds the packets of workgroups.
    pub(super) fn add_groups(&mut self, groups: &Groups) {
        for together in groups.packets.chunks(TOGETHER) {
            let before = [self.access_pieces, self.constant_pieces];
            for packet in together {
                self.add(&groups.invocations.costs[packet.cost], &groups.invocations.requests[packet.first_request as usize..]);
            }
            let cost = &groups.invocations.costs[together[0].cost];
            // Those that take different paths ask one by one.
            if together.iter().all(|packet| packet.cost == together[0].cost) {
                let [accesses, constants] = [false, true].map(|constants| pieces(groups, together, cost, constants));
                (self.access_pieces, self.constant_pieces) = (before[0] + accesses, before[1] + constants);
            }
            self.shared_cycles += shared_cycles(groups, together, cost);
        }
    }

    /// Adds the shaded quads of a tile.
    pub(super) fn add_tile(&mut self, tile: &TileWork) {
        let Invocations { costs, requests, .. } = &tile.invocations;
        // 1. Costs, of which there are few, times the quads that have them.
        let mut runs = vec![0_u64; costs.costs.len()];
        let shaded = || tile.quads.iter().filter(|quad| quad.flags & QUAD_SHADED != 0);
        shaded().for_each(|quad| runs[usize::from(quad.cost)] += 1);
        for (cost, &runs) in costs.costs.iter().zip(&runs) {
            self.add_cost(cost, runs);
        }
        // 2. Requests: what they ask differs from quad to quad.
        let textures = |cost: &Cost| asking(cost).all(|step| step.then == RequestKind::Texture);
        if costs.costs.iter().all(textures) {
            self.textures += requests.len() as u64;
            for request in requests {
                self.operations[request.rate()] += u64::from(request.operations);
                self.texture_lines += u64::from(request.lines);
            }
            return;
        }
        for quad in shaded() {
            self.add_requests(asking(&costs[quad.cost]), &requests[quad.first_request as usize..]);
        }
    }

    fn add_cost(&mut self, cost: &Cost, runs: u64) {
        self.runs += runs;
        for (sum, n) in self.instructions.iter_mut().zip(cost.instructions()) {
            *sum += u64::from(n) * runs;
        }
        let (mut unanswered, mut constants) = (0_u64, 0_u64);
        for step in &cost.steps {
            let allowed = if step.then.service().is_none() { InFlight::NONE } else { step.in_flight };
            let (allowed, of_constants) = (u64::from(allowed[Service::Texture]), u64::from(allowed[Service::Constant]));
            self.stops += u64::from(unanswered > allowed) * runs;
            self.constant_stops += u64::from(unanswered <= allowed && constants > of_constants) * runs;
            (unanswered, constants) = (unanswered.min(allowed), constants.min(of_constants));
            match step.then.service() {
                Some(Service::Texture) => unanswered += 1,
                Some(Service::Constant) => constants += 1,
                Some(Service::Shared) => self.shared += runs,
                None => {}
            }
            self.chain.iter_mut().zip(step.chain).for_each(|(sum, n)| *sum += u64::from(n) * runs);
        }
    }

    fn add_requests<'c>(&mut self, asking: impl Iterator<Item = &'c Step>, requests: &[Request]) {
        for (step, request) in asking.zip(requests) {
            match step.then {
                RequestKind::Texture => {
                    self.textures += 1;
                    self.operations[request.rate()] += u64::from(request.operations);
                    self.texture_lines += u64::from(request.lines);
                }
                RequestKind::Constant => {
                    self.constants += 1;
                    self.constant_lines += u64::from(request.lines);
                    self.constant_pieces += u64::from(request.lines);
                }
                RequestKind::Load | RequestKind::Store | RequestKind::Atomic => {
                    self.accesses += 1;
                    self.access_lines += u64::from(request.lines);
                    self.access_pieces += u64::from(request.lines);
                }
                RequestKind::End | RequestKind::Barrier | RequestKind::Shared => {}
            }
        }
    }

    /// The same where loads from uniform buffers are accesses like others.
    #[must_use]
    pub fn without_constants(&self) -> ShaderProfile {
        ShaderProfile {
            stops: self.stops + self.constant_stops,
            accesses: self.accesses + self.constants,
            access_lines: self.access_lines + self.constant_lines,
            access_pieces: self.access_pieces + self.constant_pieces,
            constant_stops: 0,
            constants: 0,
            constant_lines: 0,
            constant_pieces: 0,
            ..*self
        }
    }

    /// All requests to memory, without loads from uniform buffers.
    pub fn requests(&self) -> u64 {
        self.textures + self.accesses
    }
}

/// Pieces that the accesses of packets with one cost ask for, or their loads from uniform buffers, each once per access.
fn pieces(groups: &Groups, together: &[Packet], cost: &Cost, constants: bool) -> u64 {
    let (mut sum, mut found) = (0, Vec::new());
    let counts = |step: &Step| step.then != RequestKind::Texture && (step.then == RequestKind::Constant) == constants;
    for (at, step) in asking(cost).enumerate().filter(|(_, step)| counts(step)) {
        found.clear();
        for packet in together {
            let request = &groups.invocations.requests[packet.first_request as usize + at];
            let lines = &groups.invocations.lines[request.first_line as usize..][..usize::from(request.lines)];
            found.extend(lines.iter().map(|&line| u64::from(line) * LINE / PIECE));
        }
        found.sort_unstable();
        found.dedup();
        sum += found.len() as u64;
        debug_assert!(step.then.has_request());
    }
    sum
}

/// Cycles that banks take for the accesses of packets to workgroup memory.
fn shared_cycles(groups: &Groups, together: &[Packet], cost: &Cost) -> u64 {
    let (mut sum, mut found) = (0, Vec::new());
    for at in 0..cost.steps.iter().filter(|step| step.then == RequestKind::Shared).count() {
        found.clear();
        let mut atomic = false;
        for packet in together.iter().filter(|packet| packet.cost == together[0].cost) {
            let request = &groups.shared[packet.first_shared as usize + at];
            let words = &groups.words[request.first_line as usize..][..usize::from(request.lines)];
            atomic |= request.operations == 0;
            found.extend((0..u32::from(request.operations.max(1))).flat_map(|k| words.iter().map(move |word| word + k)));
        }
        if !atomic {
            found.sort_unstable();
            found.dedup();
        }
        let mut banks = [0_u64; BANKS];
        found.iter().for_each(|&word| banks[word as usize % BANKS] += 1);
        sum += banks.into_iter().max().unwrap_or(0);
    }
    sum
}

/// The steps of a cost that ask memory.
pub(super) fn asking(cost: &Cost) -> impl Iterator<Item = &Step> {
    cost.asking()
}
