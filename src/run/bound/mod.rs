//! The `bound` fidelity: cycles from counts, without a simulation.
//!
//! A frame is phases that follow each other (passes, dispatches, transfers, scan-out). In each, every unit has so much work and a
//! rate (the roofline of Williams et al. 2009 with a roof for each unit). In a pass, runs of primitives flow through geometry and the
//! pipelines that own the screen ([`flow`]), so that imbalance and what queues hold are in it; then the slowest of that, of DRAM and
//! of the ports takes the time. What nothing overlaps comes on top: the way of the first item through the machine and of the last
//! block to memory. Misses of caches come from counts of what first-in-first-out caches of several sizes miss; arbitration, conflicts
//! of sets and banks, and the order in which warps share a cache are not in it.

mod flow;

use anyhow::{Result, bail};

use flow::Rates;

use crate::machine::Config;
use crate::machine::config::SortClass;
use crate::mem::REQUEST_BYTES;
use crate::num::Cycle;
use crate::unit::phase::{Phase, PhaseKind};
use crate::work::profile::{
    AttachmentProfile, BLOCK_CACHES, DrawProfile, FrameProfile, LINE_CACHES, PhaseProfile, REUSE, ShaderProfile,
};
use crate::work::{BLOCK, Class, LINE, TILE};

/// What a colour or depth block that leaves its cache takes of its raw size, where compression is on: between flat blocks (an eighth)
/// and such that cannot be compressed. Measured over the traces of the repository.
const COMPRESSED: f64 = 0.5;

/// Blocks along the edge of a screen tile.
const BLOCKS: u32 = TILE / BLOCK;

/// What DRAM sustains of what its refreshes leave, in streams with some turns of the bus and misses of rows.
const STREAMING: f64 = 0.93;

/// Cycles of a phase.
#[derive(Clone, Debug, PartialEq)]
pub struct PhaseEstimate {
    /// What it is.
    pub kind: PhaseKind,
    /// Number of the pass or dispatch in the trace.
    pub number: u32,
    /// Label.
    pub label: String,
    /// Cycles.
    pub cycles: f64,
    /// The unit that bounds it.
    pub limit: &'static str,
    /// Each unit's own time.
    pub units: Vec<(&'static str, f64)>,
    /// Bytes read from DRAM, and written.
    pub dram: [f64; 2],
}

/// Cycles of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameEstimate {
    /// The trace's own number.
    pub number: u32,
    /// Its phases in order.
    pub phases: Vec<PhaseEstimate>,
}

impl FrameEstimate {
    /// Cycles of all phases.
    pub fn cycles(&self) -> f64 {
        self.phases.iter().map(|phase| phase.cycles).sum()
    }

    /// The phases with whole cycles, as a report has them.
    pub fn phases(&self) -> Vec<(Phase, Cycle)> {
        let phase =
            |p: &PhaseEstimate| Phase { kind: p.kind, number: p.number, label: p.label.clone(), begin: 0, limit: p.limit };
        self.phases.iter().map(|p| (phase(p), p.cycles.round() as Cycle)).collect()
    }

    /// Bytes that DRAM reads and writes.
    pub fn dram_bytes(&self) -> f64 {
        self.phases.iter().map(|phase| phase.dram[0] + phase.dram[1]).sum()
    }
}

/// Estimates for one configuration.
pub struct Bound<'c> {
    config: &'c Config,
    pipelines: f64,
    /// Cycles of an access to memory that misses every cache, unloaded.
    memory_latency: f64,
    /// Bytes a cycle of all DRAM channels.
    dram_rate: f64,
}

/// What a run of a shader takes of a core and its texture unit, in cycles, and how long a warp is under way.
#[derive(Clone, Copy, Debug, Default)]
struct Shading {
    core: f64,
    texture: f64,
    latency: f64,
}

/// The work of the units in a phase, in cycles.
#[derive(Default)]
struct Roofs {
    units: Vec<(&'static str, f64)>,
}

impl Roofs {
    fn add(&mut self, unit: &'static str, cycles: f64) {
        match self.units.iter_mut().find(|(known, _)| *known == unit) {
            Some((_, sum)) => *sum += cycles,
            None => self.units.push((unit, cycles)),
        }
    }

    fn slowest(&self) -> (&'static str, f64) {
        self.units.iter().copied().fold(("nothing", 0.0), |most, unit| if unit.1 > most.1 { unit } else { most })
    }
}

impl<'c> Bound<'c> {
    /// Estimates for a configuration.
    ///
    /// # Errors
    /// If its sort class is one that no rates are known of here.
    pub fn new(config: &'c Config) -> Result<Bound<'c>> {
        if config.card.sort != SortClass::Middle {
            bail!("the bound fidelity knows sort-middle only, and {} is {}: use cycle", config.name, config.card.sort.name());
        }
        Ok(Bound::proxy(config))
    }

    /// Estimates as for sort-middle, whatever the configuration sorts: near enough to tell frames apart, not to be reported.
    pub fn proxy(config: &'c Config) -> Bound<'c> {
        let (memory, dram) = (&config.memory, &config.dram);
        let tick = f64::from(dram.card_cycles) / f64::from(dram.clock);
        let ways = 2.0 * f64::from(memory.port_latency);
        let ideal = memory.kind == crate::machine::config::MemoryKind::Ideal;
        let memory_latency = if ideal {
            ways + f64::from(memory.ideal_latency)
        } else {
            ways + 2.0 * f64::from(config.l2.latency) + tick * f64::from(dram.t_rcd + dram.cl + dram.burst_cycles)
        };
        let refresh = if dram.t_refi == 0 { 0.0 } else { f64::from(dram.t_rfc) / f64::from(dram.t_refi) };
        let peak = f64::from(dram.channels) * f64::from(dram.burst_bytes) / (f64::from(dram.burst_cycles) * tick);
        let dram_rate = if ideal { f64::from(memory.ideal_bytes_per_cycle) } else { peak * (1.0 - refresh) * STREAMING };
        Bound { config, pipelines: f64::from(config.card.pipelines), memory_latency, dram_rate }
    }

    /// The frame's time, by phases.
    pub fn frame(&self, frame: &FrameProfile) -> FrameEstimate {
        let phases = frame.phases.iter().map(|phase| self.phase(phase));
        FrameEstimate { number: frame.number, phases: phases.collect() }
    }

    fn phase(&self, phase: &PhaseProfile) -> PhaseEstimate {
        match phase {
            PhaseProfile::Pass { .. } => self.pass(phase),
            PhaseProfile::Dispatch { number, label, cost, registers, lines, runs } => {
                let mut roofs = Roofs::default();
                roofs.add("command", *runs as f64 * f64::from(self.config.command.command_cycles));
                let cores = self.pipelines * f64::from(self.config.core.per_pipeline);
                let shading =
                    self.shading(cost, 4.0, *registers, *lines as f64 / (cost.texture_lines + cost.access_lines).max(1) as f64);
                let latency = shading.latency + 2.0 * self.memory_latency;
                roofs.add("core", shading.core * cost.runs as f64 / cores);
                roofs.add("texture", shading.texture * cost.runs as f64 / cores);
                let bytes = (lines * LINE) as f64;
                roofs.add("dram", bytes / self.dram_rate);
                let (limit, most) = roofs.slowest();
                let (number, label, kind) = (*number, label.clone(), PhaseKind::Dispatch);
                PhaseEstimate { kind, number, label, cycles: most + latency, limit, units: roofs.units, dram: [bytes, 0.0] }
            }
            PhaseProfile::Transfers { transfers } => {
                let (mut cycles, mut dram) = (0.0, [0.0; 2]);
                for &[read, written] in transfers {
                    let (read, written) = (read as f64, written as f64);
                    // What goes and what comes have wires of their own.
                    let port = read.max(written) / f64::from(self.config.memory.port_width);
                    let bytes = (read + written) / self.dram_rate;
                    let latency = if read > 0.0 { self.memory_latency } else { 0.0 };
                    cycles += port.max(bytes).max(self.in_flight(read, self.config.command.copy_misses))
                        + latency
                        + f64::from(self.config.command.command_cycles);
                    dram[0] += read;
                    dram[1] += written;
                }
                let (kind, number, label) = (PhaseKind::Transfers, 0, String::new());
                PhaseEstimate { kind, number, label, cycles, limit: "command", units: vec![("command", cycles)], dram }
            }
            &PhaseProfile::ScanOut { bytes } => {
                let bytes = if self.config.scanout.enabled { bytes as f64 } else { 0.0 };
                let port = bytes / f64::from(self.config.memory.port_width);
                let mut roofs = Roofs::default();
                roofs.add("scanout", port.max(self.in_flight(bytes, self.config.scanout.misses)));
                roofs.add("dram", bytes / self.dram_rate);
                let (limit, most) = roofs.slowest();
                let cycles = most + if bytes > 0.0 { self.memory_latency } else { 0.0 };
                let (kind, number, label) = (PhaseKind::ScanOut, 0, String::new());
                PhaseEstimate { kind, number, label, cycles, limit, units: roofs.units, dram: [bytes, 0.0] }
            }
        }
    }

    /// Cycles of a stream of reads, of which so many are in flight at most (Little).
    fn in_flight(&self, bytes: f64, misses: u32) -> f64 {
        bytes / REQUEST_BYTES as f64 * self.memory_latency / f64::from(misses)
    }

    /// What shader runs (quads, vertices, packets of four invocations) take.
    /// Of a warp's requests, a line is missed by the first-level cache with a probability of `misses`.
    fn shading(&self, cost: &ShaderProfile, invocations: f64, registers: u32, misses: f64) -> Shading {
        if cost.runs == 0 {
            return Shading::default();
        }
        let core = &self.config.core;
        let lanes = [core.float_lanes, core.integer_lanes, core.special_lanes, core.control_lanes].map(f64::from);
        let latencies = [core.float_latency, core.integer_latency, core.special_latency, core.control_latency].map(f64::from);
        let width = f64::from(core.warp_width);
        let runs = width / invocations;
        let each = |sum: u64| sum as f64 / cost.runs as f64;
        let instructions: [f64; Class::COUNT] = cost.instructions.map(each);
        let issue = instructions.iter().sum::<f64>() / f64::from(core.issue);
        let class = instructions.iter().zip(lanes).map(|(n, lanes)| n * width / lanes).fold(issue, f64::max);
        let chain: f64 = instructions.iter().zip(latencies).map(|(n, latency)| n * latency).sum();
        let requests = each(cost.textures + cost.accesses);
        let lines = each(cost.texture_lines + cost.access_lines) / requests.max(f64::MIN_POSITIVE);
        // A warp waits for the last line of its quads.
        let missed = 1.0 - (1.0 - misses).powf(lines * runs);
        let latency = chain + requests * (f64::from(self.config.texture.latency) + missed * self.memory_latency);
        let resident = f64::from(core.warps).min(f64::from(core.registers) / (width * f64::from(registers.max(1)))).max(1.0);
        let texture = &self.config.texture;
        let quads = (cost.textures + cost.accesses) as f64 / f64::from(texture.quads_per_cycle);
        let lines = (cost.texture_lines + cost.access_lines) as f64 / f64::from(texture.lookups_per_cycle);
        let filters = cost.operations as f64 / f64::from(texture.filters_per_cycle);
        Shading {
            core: class.max(latency / resident) / runs,
            texture: quads.max(lines).max(filters) / cost.runs as f64,
            latency,
        }
    }

    fn pass(&self, phase: &PhaseProfile) -> PhaseEstimate {
        let PhaseProfile::Pass {
            number,
            label,
            size,
            draws,
            windows,
            cells,
            color,
            depth,
            blocks,
            block_misses,
            lines,
            line_misses,
        } = phase
        else {
            unreachable!("a pass")
        };
        let config = self.config;
        let mut roofs = Roofs::default();
        let segments = draws.iter().map(|draw| draw.segments).sum::<u64>();
        roofs.add("command", (segments + 2) as f64 * f64::from(config.command.command_cycles));
        let mut dram = [0.0; 2];
        let looked_up: u64 = draws.iter().map(|draw| draw.fragment.texture_lines + draw.fragment.access_lines).sum();
        let first_level = f64::from(config.texture.cache_lines) * self.pipelines * f64::from(config.core.per_pipeline);
        let missed = interpolated(&LINE_CACHES, line_misses, first_level as usize);
        let misses = (missed / looked_up.max(1) as f64).min(1.0);
        let rates: Vec<Rates> = draws.iter().map(|draw| self.rates(&mut roofs, draw, misses, &mut dram)).collect();
        let fluid = self.fluid(&mut roofs, &rates, *size, windows, cells);
        self.attachments(&mut roofs, color, depth.as_ref(), blocks, block_misses, &mut dram);
        let textures = (lines * LINE) as f64;
        dram[0] += textures;
        let port = f64::from(config.memory.port_width);
        roofs.add("texture port", missed * LINE as f64 / self.pipelines / port);
        roofs.add("dram", (dram[0] + dram[1]) / self.dram_rate);
        let (mut limit, mut most) = roofs.slowest();
        if fluid > most {
            // What is between units that take turns at being the slowest.
            (limit, most) = (if most > 0.9 * fluid { limit } else { "imbalance" }, fluid);
        }
        let latency = rates.iter().map(|rates| rates.latency).fold(0.0, f64::max);
        let drawn = if draws.iter().any(|draw| draw.primitives > 0) { latency + self.fill() } else { 0.0 };
        let skipped = draws.is_empty() && config.command.skip_empty_passes;
        let barrier = if skipped { 0.0 } else { f64::from(config.command.barrier_cycles) };
        let cycles = most + drawn + barrier;
        let (kind, number, label) = (PhaseKind::Pass, *number, label.clone());
        PhaseEstimate { kind, number, label, cycles, limit, units: roofs.units, dram }
    }

    /// Cycles of the first item from the command processor to the ROPs, without what shaders take, and of the last block to memory.
    fn fill(&self) -> f64 {
        let c = self.config;
        let ways = [
            c.command.command_cycles,
            c.fetch.latency,
            c.assembly.latency,
            c.clip.latency,
            c.network.link_latency,
            c.setup.latency,
            c.traverse.latency,
            c.depth.latency,
            c.depth.output_latency,
            c.interpolate.latency,
            c.dispatch.latency,
            c.dispatch.output_latency,
            c.color.latency,
        ];
        ways.iter().map(|&n| f64::from(n)).sum::<f64>() + 2.0 * self.memory_latency
    }

    /// What the units take for an item of a draw; adds what its geometry takes in all.
    fn rates(&self, roofs: &mut Roofs, draw: &DrawProfile, misses: f64, dram: &mut [f64; 2]) -> Rates {
        let c = self.config;
        let per = |n: u64, rate: u32| n as f64 / f64::from(rate);
        let units = f64::from(c.card.geometry_units);

        // Geometry, for all primitives.
        let vertices = interpolated(&REUSE, &draw.shaded_vertices, c.fetch.reuse as usize);
        let attribute_lines = (draw.vertex_bytes as f64 / LINE as f64).max(draw.attributes.min(1) as f64);
        let lookups = vertices * attribute_lines / f64::from(c.fetch.lookups_per_cycle);
        let distinct = draw.shaded_vertices[REUSE.len() - 1].min(draw.vertex.runs) as f64;
        let fetched = distinct * draw.vertex_bytes as f64 + (draw.indices * draw.index_bytes) as f64;
        dram[0] += fetched;
        let shading = self.shading(&draw.vertex, 1.0, draw.registers[0], 1.0);
        // A batch is in flight from its indices to the assembly of its last primitive.
        let stay = shading.latency + self.memory_latency + f64::from(c.fetch.latency + c.assembly.latency);
        let batches = vertices / f64::from(c.core.warp_width);
        let clipping =
            per(draw.primitives, c.clip.primitives_per_cycle) + (draw.clipped * u64::from(c.clip.clip_cycles)) as f64;
        let geometry = [
            ("fetch", per(draw.indices, c.fetch.indices_per_cycle).max(lookups)),
            ("vertex batches", batches * stay / f64::from(c.fetch.batches)),
            ("fetch port", fetched / f64::from(c.memory.port_width)),
            ("assembly", per(draw.primitives, c.assembly.primitives_per_cycle)),
            ("clip", clipping / units),
            ("distribute", per(draw.triangles, c.distribute.triangles_per_cycle) / units),
        ];
        geometry.iter().for_each(|&(unit, cycles)| roofs.add(unit, cycles));
        let slowest = geometry.iter().map(|unit| unit.1).fold(0.0, f64::max);
        let primitives = (draw.primitives.max(1)) as f64;
        let cores = self.pipelines * f64::from(c.core.per_pipeline);

        // Rasterisers.
        let fragment = self.shading(&draw.fragment, 4.0, draw.registers[1], misses);
        let turns = draw.varyings.div_ceil(u64::from(c.interpolate.words_per_cycle)).max(1);
        let written = (draw.targets - draw.blended) as f64 / f64::from(c.color.quads_per_cycle);
        Rates {
            geometry: slowest / primitives,
            vertex_core: shading.core * vertices / cores / primitives,
            vertex_texture: shading.texture * vertices / cores / primitives,
            latency: shading.latency + fragment.latency,
            setup: f64::from(c.setup.interval) / f64::from(c.setup.triangles_per_cycle),
            test: 1.0 / f64::from(c.traverse.tests_per_cycle),
            block: 1.0 / f64::from(c.traverse.blocks_per_cycle),
            group: 4.0 / f64::from(c.traverse.quads_per_cycle),
            depth: if draw.depth { 4.0 / f64::from(c.depth.quads_per_cycle) } else { 0.0 },
            interpolate: turns as f64 / f64::from(c.interpolate.quads_per_cycle),
            dispatch: 1.0 / f64::from(c.dispatch.quads_per_cycle),
            core: fragment.core / f64::from(c.core.per_pipeline),
            texture: fragment.texture / f64::from(c.core.per_pipeline),
            color: written + draw.blended as f64 / f64::from(c.color.blends_per_cycle),
        }
    }

    /// Adds what the attachments of a pass move.
    fn attachments(
        &self,
        roofs: &mut Roofs,
        color: &[AttachmentProfile],
        depth: Option<&AttachmentProfile>,
        blocks: &[u64; 2],
        misses: &[[u64; BLOCK_CACHES.len()]; 2],
        dram: &mut [f64; 2],
    ) {
        let (port, c) = (f64::from(self.config.memory.port_width), self.config);
        let mut rop = |unit: &'static str, attachment: &AttachmentProfile, at: usize, compression: bool, cache: f64| {
            let part = if compression { COMPRESSED } else { 1.0 };
            let bytes = attachment.block_bytes as f64;
            let distinct = blocks[at] as f64;
            let missed = interpolated(&BLOCK_CACHES, &misses[at], (cache * self.pipelines) as usize);
            // What is not cleared by flag is read at the first touch; what came back is read again.
            let first = if attachment.loads || !c.color.fast_clear { distinct * bytes } else { 0.0 };
            let (read, written) = (first + (missed - distinct).max(0.0) * bytes * part, missed * bytes * part);
            roofs.add(unit, read.max(written) / self.pipelines / port);
            dram[0] += first;
            dram[1] += distinct * bytes * part;
        };
        for attachment in color {
            rop("color port", attachment, 1, c.color.compression, f64::from(c.color.cache_blocks) / color.len() as f64);
        }
        if let Some(depth) = depth {
            rop("depth port", depth, 0, c.depth.compression, f64::from(c.depth.cache_blocks));
        }
        for attachment in color.iter().filter(|attachment| attachment.resolved > 0) {
            let bytes = attachment.resolved as f64;
            dram[1] += bytes;
            dram[0] += blocks[1] as f64 * attachment.block_bytes as f64 * COMPRESSED;
            roofs.add("resolve", bytes / 256.0 * f64::from(self.config.resolve.block_cycles));
        }
    }
}

/// A count behind a cache of some size, between those for which it is known.
fn interpolated<const N: usize>(sizes: &[usize; N], counts: &[u64; N], size: usize) -> f64 {
    let above = sizes.iter().position(|&known| known >= size).unwrap_or(N - 1);
    let below = above.saturating_sub(1);
    if above == below || size >= sizes[above] || size <= sizes[below] {
        return counts[if size <= sizes[below] { below } else { above }] as f64;
    }
    let part = (size - sizes[below]) as f64 / (sizes[above] - sizes[below]) as f64;
    counts[below] as f64 + part * (counts[above] as f64 - counts[below] as f64)
}
