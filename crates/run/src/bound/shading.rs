//! The time that shaders take in cores and texture units.

use super::Bound;
use unit::core::CoreConfig;
use work::Class;
use work::profile::{PIECE, ShaderProfile};

/// The cycles that a run of a shader takes in a core and its texture unit, and the time that a warp is under way.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Shading {
    pub core: f64,
    pub texture: f64,
    pub latency: f64,
}

/// The misses of warps' requests in the first-level cache, and their costs.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Requests {
    /// The part of the requests that miss one line or more.
    pub missed: f64,
    /// The part of the requests for which a missing line comes from DRAM.
    pub slow: f64,
    /// The mean time of a missing line.
    pub latency: f64,
    /// Misses per lookup of a line.
    pub line: f64,
    /// The time that each miss occupies the port to memory. Later lookups wait for it.
    pub port: f64,
}

/// The mean time that a request waits behind earlier requests, which take `latency` cycles each and come at random with a rate of `rate` per
/// cycle. It is the rest of the last request's time.
fn behind(rate: f64, latency: f64) -> f64 {
    if rate * latency < 1e-3 { 0.5 * rate * latency * latency } else { latency - (1.0 - libm::exp(-rate * latency)) / rate }
}

impl Bound<'_> {
    /// Warps that a core of a pipeline has under way, at most.
    pub(super) fn resident(&self, registers: u32) -> f64 {
        f64::from(self.config.core.resident_warps(registers.max(1)))
    }

    /// Cycles that a run of a shader takes of a core and of its texture unit where all its requests hit.
    pub(crate) fn of_run(&self, cost: &ShaderProfile, invocations: f64, registers: u32) -> [f64; 2] {
        let Shading { core, texture, .. } = self.shading(&self.config.core, cost, invocations, registers, &Requests::default());
        [core, texture]
    }

    /// The cost of shader runs (quads, vertices, packets of four invocations) in a core.
    pub(super) fn shading(
        &self,
        core: &CoreConfig,
        cost: &ShaderProfile,
        invocations: f64,
        registers: u32,
        requests: &Requests,
    ) -> Shading {
        if cost.runs == 0 {
            return Shading::default();
        }
        let (texture, constant) = (&self.config.texture, &self.config.constant);
        let cost = &if constant.enabled { *cost } else { cost.without_constants() };
        let lanes =
            [core.float_lanes, core.integer_lanes, core.special_lanes, core.control_lanes, core.multiply_lanes].map(f64::from);
        let latencies =
            [core.float_latency, core.integer_latency, core.special_latency, core.control_latency, core.multiply_latency]
                .map(f64::from);
        let width = f64::from(core.warp_width);
        let runs = width / invocations;
        let each = |sum: u64| sum as f64 / cost.runs as f64;
        let instructions: [f64; Class::COUNT] = cost.instructions.map(each);
        let issue = instructions.iter().sum::<f64>() / f64::from(core.issue);
        let taken = instructions.iter().zip(lanes).map(|(n, lanes)| n * width / lanes);
        let class = if core.overlap {
            taken.fold(issue, f64::max)
        } else {
            // Instructions issue one after another, each in at least a cycle.
            instructions.iter().zip(taken).map(|(n, taken)| taken.max(*n)).sum()
        };
        let waits = |counts: [f64; Class::COUNT]| counts.iter().zip(latencies).map(|(n, latency)| n * latency).sum::<f64>();
        let chain = if core.scoreboard {
            let together = if core.dual_issue { 2.0 } else { 1.0 };
            waits(cost.chain.map(each)).max(instructions.iter().sum::<f64>() / together)
        } else {
            waits(instructions)
        };
        let resident = f64::from(core.resident_warps(registers.max(1)));

        // The texture unit, a warp.
        let asked = each(cost.textures + cost.accesses);
        // Quads are addressed in order, so a miss that the port does not take yet holds up all behind it. The misses of one quad go one by one,
        // and quads without any (Poisson) share cycles with each other only.
        let own = requests.line * each(cost.texture_lines + cost.access_lines) / asked.max(1e-9);
        let sampled = each(cost.textures);
        let quads = asked * own * requests.port + sampled * libm::exp(-own) / f64::from(texture.quads_per_cycle);
        let lines = each(cost.texture_lines) / f64::from(texture.lookups_per_cycle);
        // If texture.access_bytes is not 128, the number of pieces is larger or smaller by that factor.
        let piece = PIECE as f64 / f64::from(texture.access_bytes);
        let accesses = each(cost.access_pieces) * piece / f64::from(texture.accesses_per_cycle);
        let operations = cost.operations.iter().zip(texture.costs()).map(|(&n, cost)| n * u64::from(cost)).sum();
        let filters = each(operations) / f64::from(texture.filters_per_cycle);
        let unit = (quads.max(lines).max(filters) + accesses) * runs;
        // Workgroup memory: its banks are those of the profile, whatever core.shared_banks is.
        let banks = 32.0 / f64::from(core.shared_banks);
        let class = class.max(each(cost.shared_cycles) * runs * banks);
        let chain = chain + each(cost.shared) * f64::from(core.shared_latency);
        // Loads from uniform buffers hit the constant cache, at one address for a warp.
        let class = class.max(each(cost.constants));
        let chain = chain + each(cost.constant_stops) * f64::from(constant.latency);
        if asked == 0.0 {
            return Shading { core: class.max(chain / resident) / runs, texture: 0.0, latency: chain };
        }

        // Requests behind a miss wait with it. How often this happens depends on how fast warps come, which depends on how long they wait.
        let plain = f64::from(texture.latency) + unit / asked;
        // A warp waits where it needs a result (core.in_flight), not at each request.
        let stops = if core.scoreboard && core.in_flight > 1 { each(cost.stops) } else { asked };
        // A miss is under way while its quad is on its way to the filter. Quads leave in order: nearly all wait for DRAM where some do.
        let beyond = |latency: f64| (latency - f64::from(texture.latency)).max(0.0);
        let latencies = [(requests.missed, beyond(self.hit_latency)), (requests.slow, beyond(self.memory_latency))];
        let (mut apart, mut stay, mut fifo) = (class.max(unit), 0.0, 0.0);
        for _ in 0..3 {
            let waits =
                latencies.map(|(missed, latency)| missed * latency + (1.0 - missed) * behind(asked * missed / apart, latency));
            let wait = waits[0].max(waits[1]);
            stay = chain + stops * (plain + wait);
            // Quads between address and filter.
            fifo = asked * runs * (f64::from(texture.latency) + wait) / f64::from(texture.fifo);
            apart = 0.5 * (apart + class.max(unit).max(fifo).max(stay / resident));
        }
        Shading { core: class.max(stay / resident) / runs, texture: unit.max(fifo) / runs, latency: stay }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn who_comes_at_random_waits_what_is_left() {
        assert!((behind(1e-6, 100.0) - 0.005).abs() < 1e-4);
        assert!((behind(10.0, 100.0) - 99.9).abs() < 1e-6);
        assert!((behind(0.01, 100.0) - 100.0 * libm::exp(-1.0)).abs() < 1e-9);
    }
}
